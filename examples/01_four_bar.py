"""Planar four-bar: angle of the rocker and static torque of the crank.

Problem: crank 1, coupler sqrt(8), rocker 2, ground 3; a couple of 10 resists the rocker, gravity is left out. Find the angle of
the rocker and the torque that the crank needs over one turn.

Checked against closed forms: the angle against Freudenstein's equation
``K1 cos phi - K2 cos theta + K3 = cos(theta - phi)`` (F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77,
1955), the torque against virtual work, ``T = M dphi/dtheta``, with ``dphi/dtheta`` from the derivative of that equation.
"""

import numpy as np

import mechgraph as mg

a, b, c, d = 1.0, np.sqrt(8.0), 2.0, 3.0
RESISTANCE = 10.0


def four_bar() -> mg.Mechanism:
    z = (0, 0, 1)
    return mg.Mechanism(
        "four-bar",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z),
            mg.Pair("B", "R", "crank", "coupler", point=(1, 0, 0), axis=z),
            mg.Pair("C", "R", "coupler", "rocker", point=(3, 2, 0), axis=z),
            mg.Pair("D", "R", "frame", "rocker", point=(3, 0, 0), axis=z),
        ],
        drives=["A"],
        loads=[mg.Effort("D", -RESISTANCE)],
    )


def rocker_by_freudenstein(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle of the rocker on the branch with the coupler above the ground, and its derivative."""
    K1, K2, K3 = d / a, d / c, (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
    # (K1 - cos theta) cos phi - sin theta sin phi = K2 cos theta - K3
    P, Q, R = K1 - np.cos(theta), -np.sin(theta), K2 * np.cos(theta) - K3
    phi = np.arctan2(Q, P) + np.arccos(R / np.hypot(P, Q))
    slope = (K2 * np.sin(theta) + np.sin(theta - phi)) / (K1 * np.sin(phi) + np.sin(theta - phi))
    return phi, slope


def main() -> None:
    theta = np.deg2rad(np.arange(0.0, 360.0, 5.0))
    m = four_bar()
    s = mg.solve(m, {"A": theta})

    phi, slope = rocker_by_freudenstein(theta)
    rocker = np.pi / 2 + s["D"].position[:, 0]  # the rocker is declared upright: phi = 90 deg there
    torque = s["A"].effort[:, 0]
    assert np.allclose(rocker, phi, atol=1e-11)
    assert np.allclose(torque, RESISTANCE * slope, atol=1e-10)

    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (
        1,
        3,
    )  # three axes out of the plane: redundant, as every planar loop in space
    print(report.verdict)
    i = int(np.argmax(torque))
    print(f"torque of the crank: {torque.min():.4f} to {torque.max():.4f}, greatest at {np.rad2deg(theta[i]):.0f} deg")
    print(f"largest difference from virtual work: {np.abs(torque - RESISTANCE * slope).max():.1e}")


if __name__ == "__main__":
    main()
