"""A globoid cam: a groove on a drum, hollowed like an hourglass, swings an arm with a ball to and fro, and pushes it both ways.

The groove is the path of the ball on the drum, for an arm that shall swing by 20 degrees as a sine of the turn of the drum. By hand: so it
does; the part of the force of the groove along the way of the ball carries inertia and load of the arm.
"""

import numpy as np

import mechgraph as mg

DISTANCE, ARM, SWING = 0.12, 0.08, np.deg2rad(20.0)  # pivot to axis of the drum, length of the arm, half swing
INERTIA, FRICTION, SPEED = 2e-3, 0.5, 12.0
Z = (0.0, 0.0, 1.0)


def ball(psi: np.ndarray) -> np.ndarray:
    """Center of the ball for angles of the arm ``(T,)``, ``(T, 3)``: the arm turns about y in front of the drum."""
    return np.stack([DISTANCE - ARM * np.cos(psi), 0 * psi, ARM * np.sin(psi)], axis=-1)


def groove(points: int) -> mg.Curve:
    """The path of the ball on the drum, which turns about z by u."""
    u = np.linspace(0.0, 2 * np.pi, points, endpoint=False)
    x, _, z = ball(SWING * np.sin(u)).T
    return mg.Curve.through(points=np.stack([np.cos(u) * x, -np.sin(u) * x, z], axis=-1), closed=True)


def mechanism() -> mg.Mechanism:
    return mg.Mechanism(
        "globoid cam",
        [
            mg.Link("frame"),
            mg.Link("drum"),
            mg.Link("ball"),
            mg.Link("arm", 0.3, (DISTANCE, 0, 0), np.diag([INERTIA] * 3)),
        ],
        [
            mg.Pair("A", "R", "frame", "drum", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "Sg", "drum", "ball", curve=groove(720), point=(DISTANCE - ARM, 0, 0), radius=0.006),
            mg.Pair(
                "P", "P", "arm", "ball", point=(DISTANCE - ARM, 0, 0), axis=(1, 0, 0)
            ),  # on a pin: the groove has no bottom
            mg.Pair("C", "R", "frame", "arm", point=(DISTANCE, 0, 0), axis=(0, 1, 0)),
        ],
        drives=["A"],
        loads=[mg.Effort("C", FRICTION)],
        units={"length": "m", "mass": "kg", "time": "s"},
    )


def main() -> None:
    m = mechanism()
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 0)
    u = np.deg2rad(np.arange(0.0, 360.0))
    s = mg.solve(m, {"A": mg.Motion(u, SPEED)})
    psi, rate, second = SWING * np.sin(u), SWING * np.cos(u) * SPEED, -SWING * np.sin(u) * SPEED**2
    arm = s["C"]
    for found, wanted in ((arm.position, psi), (arm.velocity, rate), (arm.acceleration, second)):
        assert np.abs(found[:, 0] - wanted).max() < 1e-5 * np.abs(wanted).max()
    torque = INERTIA * second - FRICTION
    assert np.abs(s["A"].effort[:, 0] * SPEED - torque * rate).max() < 1e-4 * np.abs(torque * rate).max()
    c = s.contact("B")
    way = np.stack([np.sin(psi), 0 * psi, np.cos(psi)], axis=-1)  # of the center of the ball
    along = (c.normal * way).sum(axis=-1)
    assert np.allclose(c.normal_force * along * ARM, torque, rtol=1e-6, atol=1e-6)
    assert np.abs(s["P"].position).max() < 1e-8
    print(
        f"arm by {np.rad2deg(np.ptp(arm.position)):.4f} deg, drive {s['A'].effort.min():.3f} to {s['A'].effort.max():.3f} N m"
    )
    off, sliding = np.rad2deg(np.arccos(np.abs(along))), np.linalg.norm(c.sliding, axis=1)
    print(
        f"groove: {c.normal_force.max():.2f} N, {off.max():.1f} deg off the way of the ball, sliding {sliding.max():.2f} m/s at most"
    )


if __name__ == "__main__":
    main()
