"""Lee's RCSR-CSR mechanism end to end: two loops, kinematics, kinetostatics, and his Tables X and XXV to XXXI.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, sections 2.7 and 3.6: a cylindric, a spherical and a revolute pair hang
a second loop on the coupler of an RCSR mechanism. The links are massless; couples of 1 about O4 and 4 about O7 are the output.
Find the motion, the input torque and the reactions.

The second loop of the thesis carries two errors in its geometry and two more in its forces, so that its columns are no mechanism's;
``rcsr-csr`` has the true geometry with P6 = 1 in place of .4, with which it closes over his whole range. Checked: the first loop
against Table X, to 0.7 of the last printed digit; the input torque against virtual work, ``M1 w1 + 1 w4 + 4 w7 = 0``; and
Tables XXV to XXX with his errors copied, to .002.

    python examples/06_lee_rcsr_csr.py picture.png
"""

import sys
from pathlib import Path

import numpy as np
from lee_1977 import pictures, rcsr_csr
from lee_1977.tables import table

import mechgraph as mg
from mechgraph.show import draw_skeleton

OUTPUT = {"O4": 1.0, "O7": 4.0}
ROW = 14
"""The position that the picture shows."""
VIEW = (74.0, 20.0)
FORCES = (("XXV", ("F41x", "F41y", "F41z"), "O1"), ("XXX", ("FE", "FF", "FG"), "O6"))
"""Table, columns and pair of the reactions that the picture shows."""


def solved() -> mg.Solution:
    """The mechanism of the library over its stored sweep, 160 to 214 degrees, w1 = .1 rad/s, alpha1 = .2 rad/s2."""
    m = mg.load("rcsr-csr")
    report = mg.check(m)
    assert report.determinate
    assert len(report.loops) == 2
    print(report.verdict)
    f = mg.formulate(m, bookkeeping="lee")
    assert len(f.unknowns) == len(f.equations) == 40
    print(f.text(components=False))
    return mg.solve(m)


def by_virtual_work(s: mg.Solution) -> np.ndarray:
    """Effort of O1 from the velocities alone: massless links, no springs, so the powers add up to zero."""
    power = sum(couple * s[name].velocity[:, 0] for name, couple in OUTPUT.items())
    return -power / s["O1"].velocity[:, 0]


def compare() -> None:
    """Largest differences from the tables, loop 1 as it is and the rest with the errors of the thesis."""
    loop_1, copied = rcsr_csr.loop_1(), rcsr_csr.kinetostatics()
    assert loop_1["S2"] <= 0.7e-3
    assert loop_1["angles"] <= 0.7e-3 + 1e-5 * 216.0
    assert max(copied.values()) <= 2e-3
    print(f"loop 1 against Table X: S2 {loop_1['S2']:.4f} in, angles {loop_1['angles']:.4f} degrees")
    print("with his errors (printed to .001):", {n: round(v, 4) for n, v in copied.items()})
    print(f"with P6 = .4 the second loop stays {rcsr_csr.gap_without_errors():.3f} in open on the branch of Table X")


def draw(s: mg.Solution, target: Path) -> None:
    """Skeleton; output angles with Table X; input torque with virtual work; forces at O1 and O6 with Tables XXV and XXX.

    Lee's M_IN is minus the effort. The axes of O1 and O2 are long and nearly parallel: the view is almost along them.
    """
    figure = pictures.figure(14.4, 7.6)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.25, 1.0, 1.0))
    theta = np.rad2deg(s["O1"].position[:, 0])
    space = figure.add_subplot(grid[:, 0], projection="3d")
    draw_skeleton(s, ROW, ax=space, ghosts=0, traces=False, view=VIEW)
    space.set_title(f"RCSR-CSR at theta1 = {theta[ROW]:.0f} deg", fontsize=10.5, loc="left")

    left, x = figure.add_subplot(grid[0, 1]), table("X")
    for k, (name, pair) in enumerate({"theta2": "O2", "theta4": "O4", "theta7": "O7"}.items()):
        angle = np.rad2deg(s[pair].position[:, 0])
        left.plot(theta, angle, color=pictures.COLOURS[k], lw=2.0, label=name + " (P6 = 1)" * (pair == "O7"))
    for name in ("theta2", "theta4"):
        left.plot(x["theta1"], x[name], label="Table X" if name == "theta4" else None, **pictures.PRINTED)
    pictures.finish(left, "theta1 [deg]", "angle [deg]", "Angles of O2, O4 and O7")

    right = figure.add_subplot(grid[0, 2])
    right.plot(theta, -s["O1"].effort[:, 0], color=pictures.COLOURS[0], lw=2.0, label="M_IN")
    work = {**pictures.PRINTED, "marker": "x"}
    right.plot(theta, -by_virtual_work(s), label="virtual work of the outputs", **work)
    pictures.finish(right, "theta1 [deg]", "M_IN [lb in2/s2]", "Input torque against 1 at O4 and 4 at O7")

    for column, (number, names, pair) in enumerate(FORCES, 1):
        ax = figure.add_subplot(grid[1, column])
        pictures.reactions(ax, number, names, rcsr_csr.copied()[number])
        pictures.finish(ax, "theta1 [deg]", "force [lb in/s2]", f"Force at {pair}, his errors copied")
    pictures.save(figure, target)


def main() -> None:
    s = solved()
    other = mg.solve(s.mechanism, method="newton_euler")
    assert np.allclose(other["O1"].effort, s["O1"].effort, rtol=1e-9, atol=1e-9)
    assert max(s.checks.closure.max(), np.abs(s.checks.power).max(), s.checks.equilibrium.max()) < 1e-10
    error = np.abs(by_virtual_work(s) - s["O1"].effort[:, 0]).max()
    assert error < 1e-9
    print(f"closure error {s.checks.closure.max():.0e}; input torque from virtual work: {error:.0e}")
    compare()
    if len(sys.argv) > 1:
        draw(s, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
