"""Lee's RCSR mechanism end to end: check, equations, kinematics, kinetostatics, and his Tables III to IX and XV to XVIII.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, sections 2.6 and 3.4: a spatial four-link mechanism with revolute,
cylindric, spherical and revolute pair is driven at the first pair against a couple of 10 about the last. Find angles, rates,
accelerations, the input torque and the reactions.

Checked against every row of his tables, to 0.7 of the last printed digit. Tables III to IX are right (angles: and 1e-5 relative,
they were made with a truncated degree). Tables XV to XVIII come out only when the inertia torque of his equation 3.31 is put in as
a load in place of the true one; the true input torque is another, and the picture shows both:

    python examples/03_lee_rcsr.py picture.png
"""

import sys
from pathlib import Path

import numpy as np
from lee_1977 import pictures, rcsr
from lee_1977.tables import table

import mechgraph as mg
from mechgraph.show import draw_skeleton

ROW = 10
"""The position that the picture shows."""
VIEW = (74.0, 20.0)
FORCES = (("XV", ("F41x", "F41y", "F41z"), "O1"), ("XVI", ("F21x", "F21y", "F21z"), "O2"))
"""Table, columns and pair of the reactions that the picture shows (Table XVI is headed F21 and holds F12)."""


def solved() -> mg.Solution:
    """The mechanism of the library over its stored sweep, 150 to 202 degrees, w1 = .1 rad/s, alpha1 = .2 rad/s2."""
    m = mg.load("rcsr")
    report = mg.check(m)
    assert report.determinate
    print(report.verdict)
    f = mg.formulate(m, bookkeeping="lee")
    assert len(f.unknowns) == len(f.equations) == 24
    print(f.text(components=False))
    return mg.solve(m)


def compare() -> None:
    """Largest differences from the tables."""
    kinematics, kinetostatics = rcsr.kinematics(), rcsr.kinetostatics()
    angles = kinematics.pop("III angles")
    assert angles <= 0.7e-3 + 1e-5 * 202.0
    assert max(kinematics.values()) <= 0.7e-3
    assert max(kinetostatics.values()) <= 0.7e-2
    print(f"angles of Table III: {angles:.4f} degrees")
    print("Tables III to IX (printed to .001):", {n: round(v, 5) for n, v in kinematics.items()})
    print(
        "Tables XV to XVIII (printed to .01) with the torque of 3.31:",
        {n: round(v, 4) for n, v in kinetostatics.items()},
    )
    for theta, (found, printed) in rcsr.true_driver().items():
        print(f"M_IN at {theta} degrees: {found:.2f} with the true inertia, printed {printed:.2f}")


def draw(s: mg.Solution, target: Path) -> None:
    """Skeleton; angles with Table III; input torque with Table XVIII; forces at O1 and O2 with Tables XV and XVI.

    Lee's M_IN is minus the effort. The axes of O1 and O2 are long and nearly parallel: the view is almost along them.
    """
    figure = pictures.figure(14.4, 7.6)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.25, 1.0, 1.0))
    theta = np.rad2deg(s["O1"].position[:, 0])
    space = figure.add_subplot(grid[:, 0], projection="3d")
    draw_skeleton(s, ROW, ax=space, ghosts=0, traces=False, view=VIEW)
    space.set_title(f"RCSR at theta1 = {theta[ROW]:.0f} deg", fontsize=10.5, loc="left")

    left, iii = figure.add_subplot(grid[0, 1]), table("III")
    for k, name in enumerate(("theta2", "theta4")):
        angle = np.rad2deg(s[f"O{name[-1]}"].position[:, 0])
        left.plot(theta, angle, color=pictures.COLOURS[k], lw=2.0, label=name)
        left.plot(iii["theta1"], iii[name], label="Table III" if k else None, **pictures.PRINTED)
    pictures.finish(left, "theta1 [deg]", "angle [deg]", "Angles of O2 and O4")

    right, xviii = figure.add_subplot(grid[0, 2]), table("XVIII")
    right.plot(theta, -s["O1"].effort[:, 0], color=pictures.COLOURS[0], lw=2.0, label="true inertia")
    copied = -rcsr.as_lee()["O1"].effort[:, 0]
    right.plot(theta, copied, color=pictures.COLOURS[1], lw=2.0, ls="--", label="inertia torque of eq. 3.31")
    right.plot(xviii["theta1"], xviii["MIN"], label="Table XVIII", **pictures.PRINTED)
    pictures.finish(right, "theta1 [deg]", "M_IN [lb in2/s2]", "Input torque")

    with_3_31 = rcsr.reactions(rcsr.as_lee())
    for column, (number, names, pair) in enumerate(FORCES, 1):
        ax = figure.add_subplot(grid[1, column])
        pictures.reactions(ax, number, names, with_3_31[number])
        pictures.finish(ax, "theta1 [deg]", "force [lb in/s2]", f"Force at {pair}, inertia torque of eq. 3.31")
    pictures.save(figure, target)


def main() -> None:
    s = solved()
    other = mg.solve(s.mechanism, method="newton_euler")
    assert np.allclose(other["O1"].effort, s["O1"].effort, rtol=1e-9)
    assert max(s.checks.closure.max(), np.abs(s.checks.power).max(), s.checks.equilibrium.max()) < 1e-10
    print(f"closure error {s.checks.closure.max():.0e}, power balance {np.abs(s.checks.power).max():.0e}")
    compare()
    if len(sys.argv) > 1:
        draw(s, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
