"""Force laws: a gas spring, a bump stop, a pressure and a motor, each against a number by hand; with a path, the picture of the README.

A law gives the force ``F`` along a coordinate ``x`` from ``x``, its rate ``v`` and time: positive where it drives the coordinate on. In a
freedom that is + on link b, - on link a; between two points ``x`` is their distance, and a positive force pushes them apart.
"""

import sys
from pathlib import Path

import numpy as np

import mechgraph as mg

Z, GRAVITY = (0, 0, 1), mg.Gravity((0, -9.81, 0))
GAS = mg.ForceTable(x=[0.3, 0.5], force=[480, 400])
STOP = mg.ForceTable(x=[0.0, 0.08, 0.09, 0.10], force=[0, 0, -500, -2000])


def tailgate() -> mg.Mechanism:
    """A lid of 20 kg, hinged at the origin, on a gas spring of 480 N pressed to 0.3 m and 400 N at its full length of 0.5 m."""
    return mg.Mechanism(
        "tailgate",
        [
            mg.Link("body", points={"seat": (0.1, -0.3, 0)}),
            mg.Link("lid", 20.0, (0.5, 0, 0), points={"eye": (0.4, 0, 0)}),
        ],
        [mg.Pair("A", "R", "body", "lid", point=(0, 0, 0), axis=Z)],
        ["A"],
        [GRAVITY, mg.ForceLaw(("body", "lid", "seat", "eye"), law=GAS)],
    )


def slide(*loads: object) -> mg.Mechanism:
    pair = mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=(1, 0, 0))
    return mg.Mechanism("slide", [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))], [pair], ["P"], loads)  # type: ignore[arg-type]


def check_gas_spring() -> None:
    # lid level: the spring stands at 45 deg, 0.3 sqrt 2 = 0.4243 m long, 480 - 400 * 0.1243 = 430.3 N; its arm about the hinge is
    # 0.4 sin 45 deg = 0.2828 m
    by_hand = 20 * 9.81 * 0.5 - (480 - 400 * (0.3 * np.sqrt(2) - 0.3)) * 0.4 * np.sin(np.pi / 4)
    torque = float(mg.solve(tailgate(), {"A": 0.0})["A"].effort[0])
    print(f"gas spring: the hand holds the level lid with {torque:.3f} N m, by hand {by_hand:.3f}")
    assert abs(torque - by_hand) < 1e-9


def check_bump_stop() -> None:
    s = mg.solve(slide(mg.ForceLaw("P", law=STOP)), {"P": [0.05, 0.08, 0.09]})
    print("bump stop: the drive pushes with", s["P"].effort[:, 0] + 0.0, "N")
    np.testing.assert_allclose(s["P"].effort[:, 0], [0, 0, 500], atol=1e-9)


def check_pressure() -> None:
    """Gas of 6 bar and 1 litre behind a piston of 0.01 m^2 expands at constant temperature: W = p V ln(V2 / V1)."""
    bar, area = 1e5, 0.01
    gas = mg.ForceLaw("P", law=lambda x, v, t: 6 * bar * area * 0.1 / (0.1 + x))
    x = np.linspace(0, 0.2, 2001)
    force = -mg.solve(slide(gas), {"P": x})["P"].effort[:, 0]
    work, by_hand = np.trapezoid(force, x), 6 * bar * 1e-3 * np.log(3)
    print(f"pressure: work {work:.3f} J, by hand {by_hand:.3f}")
    assert abs(work / by_hand - 1) < 1e-6


def check_motor() -> None:
    """A motor of 10 N m at rest and 0 at 20 rad/s on a wheel of 0.5 kg m^2: w = 20 (1 - exp(-t)), the time constant 0.5 * 20 / 10."""
    wheel = mg.Mechanism(
        "wheel",
        [mg.Link("frame"), mg.Link("wheel", 1.0, (0, 0, 0), np.diag([0.3, 0.3, 0.5]))],
        [mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=Z)],
        loads=[mg.ForceLaw("A", law=mg.ForceTable(v=[0, 20], force=[10, 0]))],
    )
    r = mg.respond(wheel, [0.0, 1.0, 2.0])
    print("motor: speeds", np.round(r["A"].velocity[:, 0], 4), "rad/s")
    np.testing.assert_allclose(r["A"].velocity[:, 0], 20 * (1 - np.exp([0.0, -1.0, -2.0])), atol=1e-5)


def draw(target: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 10.0, "figure.dpi": 110.0})
    figure, (points, freedom, curve) = plt.subplots(
        1, 3, figsize=(10.4, 2.9), layout="constrained", width_ratios=(1.2, 1, 1.1)
    )
    push = {"arrowstyle": "-|>", "color": "C3", "lw": 2.0}
    span = {"arrowstyle": "<->", "color": "0.35", "lw": 1.0}
    for ax, title in ((points, "between points: (link a, link b, p, q)"), (freedom, "in a freedom: + on b, - on a")):
        ax.set(title=title, aspect="equal")
        ax.set_axis_off()
    points.plot([0, 2], [0, 0], "o-", color="0.6", lw=3, mfc="w", mec="k")
    for x, way, label, link in ((0, -1, "p", "link a"), (2, 1, "q", "link b")):
        points.annotate("", (x + 0.7 * way, 0), (x + 0.08 * way, 0), arrowprops=push)
        points.text(x + 0.4 * way, 0.13, "F > 0", color="C3", ha="center")
        points.text(x, 0.13, f"{label}", ha="center")
        points.text(x, 0.42, link, ha="center")
    for width, y, text in ((2.0, -0.3, "x, the distance"), (1.4, -0.7, "free: where the law's own x is 0")):
        points.annotate("", (width, y), (0, y), arrowprops=span)
        points.text(width / 2, y - 0.22, text, ha="center", color="0.35")
    points.set(xlim=(-0.9, 2.9), ylim=(-1.0, 0.7))
    turn = np.linspace(0, 0.9, 30)
    freedom.plot([0, 1.5], [0, 0], color="0.6", lw=3)
    freedom.plot([0, 1.5 * np.cos(0.9)], [0, 1.5 * np.sin(0.9)], color="C0", lw=3)
    freedom.plot(0, 0, "o", mfc="w", mec="k", ms=9)
    freedom.plot(0.6 * np.cos(turn), 0.6 * np.sin(turn), color="0.35", lw=1.0)
    freedom.text(0.68, 0.24, "x", color="0.35")
    freedom.text(1.55, -0.05, "link a")
    freedom.text(1.5 * np.cos(0.9) + 0.08, 1.5 * np.sin(0.9) - 0.05, "link b")
    for angle, rad, text in ((0.95, 0.35, "F > 0"), (-0.05, -0.35, "-F")):
        tip = angle + (0.55 if rad > 0 else -0.55)
        ends = [(1.15 * np.cos(a), 1.15 * np.sin(a)) for a in (tip, angle)]
        freedom.annotate("", *ends, arrowprops={**push, "connectionstyle": f"arc3,rad={rad}"})
        freedom.text(1.35 * np.cos(tip), 1.35 * np.sin(tip), text, color="C3", ha="center", va="center")
    freedom.set(xlim=(-0.3, 2.1), ylim=(-0.9, 1.6))
    x = np.linspace(0.0, 0.1, 200)
    force = [mg.solve(slide(mg.ForceLaw("P", law=STOP)), {"P": x})["P"].applied_effort[:, 0]]
    curve.plot(x, force[0], "C3")
    curve.plot(STOP.x, STOP.force, "o", color="k", mfc="w")
    curve.axhline(0, color="0.8", lw=0.8, zorder=0)
    curve.set(title="a bump stop by four points", xlabel="x [m]", ylabel="F [N]")
    figure.savefig(target, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    check_gas_spring()
    check_bump_stop()
    check_pressure()
    check_motor()
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]))
