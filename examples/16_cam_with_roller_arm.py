"""A cam that swings an arm through a roller against a spring: motion, contact force, pressure, and the speed at which the roller lifts off.

The cam rises by 12 mm over 120 degrees and falls again (polynomial 3-4-5, dwells between); the arm is 110 mm long. By hand: the center of
the roller stays on its path on the cam, the normal force balances inertia and spring about the pivot, and as it is a static part and one
with the square of the speed, the greatest speed at which the cam never has to pull follows from both.
"""

import warnings

import numpy as np

import mechgraph as mg

BASE, ROLLER, LIFT, WIDTH = 0.03, 0.01, 0.012, 0.008
FAR = BASE + ROLLER
PIVOT, START = np.array([0.11, FAR, 0.0]), np.array([0.0, FAR, 0.0])
INERTIA, STIFFNESS, FREE = 4e-4, 8.0, 0.2  # kg m2, N m / rad, rad: how far the arm would swing without the cam
Z = (0.0, 0.0, 1.0)


def law(u: np.ndarray) -> np.ndarray:
    """Lift of the center of the roller, its slope and bend at angles of the cam ``(3, ...)``."""
    rise, fall = np.deg2rad(120.0), np.deg2rad(180.0)
    u = np.mod(u, 2 * np.pi)
    back = u > fall
    x = np.clip(np.where(back, (u - fall) / rise, u / rise), 0.0, 1.0)
    s = np.stack(
        [x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2 / rise, 60 * x * (1 - 3 * x + 2 * x**2) / rise**2]
    )
    s = np.where(back, -s, s)
    s[0] += back
    return LIFT * s


def mechanism() -> mg.Mechanism:
    u = np.deg2rad(np.arange(0.0, 360.1, 5.0))
    lift, slope, bend = law(u)
    cam = mg.Curve.cam(
        angle=u, lift=lift, slope=slope, bend=bend, base_radius=BASE, roller_radius=ROLLER, second=(0, 1, 0)
    )
    steel = mg.Hertz((210e9, 210e9), length=WIDTH)
    return mg.Mechanism(
        "cam with roller arm",
        [mg.Link("frame"), mg.Link("cam"), mg.Link("arm", 0.15, PIVOT, np.diag([INERTIA, INERTIA, INERTIA]))],
        [
            mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "Ps", "cam", "arm", curve=cam, point=START, closed="force", hertz=steel),
            mg.Pair("C", "R", "frame", "arm", point=PIVOT, axis=Z),
        ],
        drives=["A"],
        loads=[mg.TorsionSpring("C", stiffness=STIFFNESS, free=FREE)],
        units={"length": "m", "mass": "kg", "time": "s"},
    )


def by_hand(s: mg.Solution, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Static normal force, and that of the arm's inertia over the square of the speed."""
    theta, arm = s["A"].position[:, 0], s["C"]
    phi = arm.position[:, 0]
    d = START - PIVOT
    centre = PIVOT[:2] + np.stack(
        [d[0] * np.cos(phi) - d[1] * np.sin(phi), d[0] * np.sin(phi) + d[1] * np.cos(phi)], axis=-1
    )
    u = np.pi / 2 - (np.arctan2(centre[:, 1], centre[:, 0]) - theta)  # where on the cam the center of the roller is
    assert np.abs(np.linalg.norm(centre, axis=1) - FAR - law(u)[0]).max() < 1e-7
    rho, slope = FAR + law(u)[0], law(u)[1]
    out = centre / rho[:, None]
    n = (
        out + np.stack([-out[:, 1], out[:, 0]], axis=-1) * (slope / rho)[:, None]
    )  # normal of the path: rho' = -d rho / d angle
    n /= np.linalg.norm(n, axis=1)[:, None]
    lever = (centre - PIVOT[:2])[:, 0] * n[:, 1] - (centre - PIVOT[:2])[:, 1] * n[:, 0]
    return STIFFNESS * (phi - FREE) / lever, INERTIA * arm.acceleration[:, 0] / speed**2 / lever


def main() -> None:
    m = mechanism()
    theta = np.deg2rad(np.arange(0.0, 360.0, 0.5))
    s = mg.solve(m, {"A": mg.Motion(theta, 20.0)})
    c = s.contact("B")
    still, moving = by_hand(s, 20.0)
    assert np.allclose(c.normal_force, still + 400.0 * moving, atol=1e-4 * np.abs(still).max())
    power = s["A"].effort[:, 0] * 20.0
    arm = (INERTIA * s["C"].acceleration[:, 0] + STIFFNESS * (s["C"].position[:, 0] - FREE)) * s["C"].velocity[:, 0]
    assert np.allclose(power, arm, atol=1e-9 * np.abs(arm).max())
    swing = np.rad2deg(np.ptp(s["C"].position))
    print(
        f"the arm swings by {swing:.3f} deg; contact {c.normal_force.min():.2f} to {c.normal_force.max():.2f} N at 20 rad/s, ",
        end="",
    )
    print(
        f"{1e-6 * c.hertz.pressure.max():.0f} N/mm2, pressure angle of the arm {np.rad2deg(c.pressure_angle('arm').max()):.1f} deg at most"
    )

    least = np.where(moving < 0, still / np.where(moving < 0, -moving, 1.0), np.inf)
    greatest = float(np.sqrt(least.min()))
    print(
        f"never lifts off below {greatest:.2f} rad/s, first at {np.rad2deg(theta[least.argmin()]):.1f} deg of the cam"
    )
    assert not mg.solve(m, {"A": mg.Motion(theta, 0.995 * greatest)}).contact("B").lifts.any()
    with warnings.catch_warnings(action="ignore", category=mg.MechgraphWarning):
        fast = mg.solve(m, {"A": mg.Motion(theta, 1.02 * greatest)})
    (gap,) = fast.contact("B").lift_off
    assert gap.begins["A.Rz"] < theta[least.argmin()] < gap.ends["A.Rz"]
    print(gap.text)


if __name__ == "__main__":
    main()
