"""A new spatial topology with two loops: a ball press.

Problem: a skew crank drives a slider through a rod with a spherical and a universal pair (R-S-U-P); a ball on the slider presses on
the flat face of a lever (Sp), which turns against a resistance. Is it determinate, what does the crank need, and what presses
on the ball?

Checked against virtual work: for a standing press the torque of the crank is the derivative of the potential energy by the crank
angle, here by central differences of positions alone, so that no force of the solution enters.
"""

import numpy as np

import mechgraph as mg

RESISTANCE = 30.0
GRAVITY = 9.81


def ball_press() -> mg.Mechanism:
    return mg.Mechanism(
        "ball press",
        links=[
            mg.Link("frame"),
            mg.Link("crank", mass=0.4, center=(0.01, 0.01, 0.03)),
            mg.Link("rod", mass=0.6, center=(0.13, 0.02, 0.03)),
            mg.Link("slider", mass=1.5, center=(0.28, 0.02, 0)),
            mg.Link("lever", mass=0.9, center=(0.37, 0.02, 0.07)),
        ],
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0.3, 1, -0.2)),
            mg.Pair("B", "S", "crank", "rod", point=(0.02, 0.006, 0.06)),
            mg.Pair("C", "U", "rod", "slider", point=(0.24, 0.04, 0.02), axis=(0, 0, 1), second=(0, 1, 0)),
            mg.Pair("D", "P", "frame", "slider", point=(0.30, 0.04, -0.02), axis=(1, 0, 0)),
            mg.Pair("E", "Sp", "lever", "slider", point=(0.36, 0.04, 0.02), axis=(1, 0.1, 0.1)),
            mg.Pair("F", "R", "frame", "lever", point=(0.38, 0.04, 0.16), axis=(0, 1, 0.2)),
        ],
        drives=["A"],
        loads=[mg.Gravity((0, 0, -GRAVITY)), mg.Effort("F", -RESISTANCE)],
        units={"length": "m", "mass": "kg", "time": "s"},
    )


def torque_by_virtual_work(m: mg.Mechanism, theta: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """``d/dtheta`` of the weight's potential energy and of the work against the resistance, from positions."""

    def energy(at: np.ndarray) -> np.ndarray:
        s = mg.kinematics(m, {"A": at})
        lifted = sum(link.mass * GRAVITY * s.link(link.name).center[:, 2] for link in m.links if link.mass)
        return lifted + RESISTANCE * s["F"].position[:, 0]

    return (energy(theta + step) - energy(theta - step)) / (2 * step)


def main() -> None:
    m = ball_press()
    report = mg.check(m)
    assert report.determinate
    assert report.ledger("lee").unknowns == report.ledger("lee").equations == 30

    theta = np.deg2rad(np.arange(0.0, 360.0))
    standing = mg.solve(m, {"A": theta})
    torque = standing["A"].effort[:, 0]
    assert np.allclose(torque, torque_by_virtual_work(m, theta), atol=1e-6 * np.abs(torque).max())

    running = mg.solve(m, {"A": mg.Motion(theta, velocity=10.0)})
    contact = running["E"].components["Fz"]
    assert contact.min() > 0 or contact.max() < 0  # the ball is always pressed: a contact suffices
    print(report.verdict)
    print(f"torque of the crank at rest: {torque.min():.3f} to {torque.max():.3f} N m")
    print(f"force on the ball at 10 rad/s: {np.abs(contact).min():.1f} to {np.abs(contact).max():.1f} N")


if __name__ == "__main__":
    main()
