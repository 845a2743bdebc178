"""Lee's RCHCH mechanism end to end: its four assembly modes, kinetostatics, and his Tables XI to XIII and XXXIII to XXXVII.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, sections 2.8 and 3.7: one loop of a revolute, two cylindric and two
helical pairs (pitches 2 and 5 in per radian), driven at the revolute pair against a couple of 10 about the last. Find the motion, the
input torque and the reactions.

No row of his Table XI is a closure, for his equations 2.100 and 2.107 are one and the same, so nothing of it can be compared but the
conditions of the pitches. With the turns of the helical pairs within half a turn the loop closes in four ways at theta1 = 0; each can
be followed over a full turn. Checked: closures and power balance; the work of the driver over a turn at constant speed is zero
since the output comes back, ``int M dtheta1 = 0``, for each mode; the gap of Table XI is 81 to 160 degrees.

    python examples/07_lee_rchch.py picture.png
"""

import sys
from pathlib import Path

import numpy as np
from lee_1977 import pictures, rchch
from lee_1977.tables import table
from matplotlib.axes import Axes

import mechgraph as mg
from mechgraph.show import draw_skeleton

TURN = np.deg2rad(np.arange(0.0, 360.0, 3.0))


def over_a_turn() -> list[mg.Solution]:
    """The four assembly modes, each over a full turn at w1 = .1 rad/s."""
    m = mg.load("rchch")
    names = m.freedom_names()
    modes = [m.replace(start=dict(zip(names, mode, strict=True))) for mode in rchch.modes()]
    return [mg.solve(mode, {"O1": mg.Motion(TURN, velocity=0.1)}) for mode in modes]


def check_mode(s: mg.Solution) -> None:
    """Determinate, closed, in balance, the same by both methods; no net work over the turn."""
    assert mg.check(s.mechanism).determinate
    assert max(s.checks.closure.max(), np.abs(s.checks.power).max(), s.checks.equilibrium.max()) < 1e-10
    effort = s["O1"].effort[:, 0]
    other = mg.solve(s.mechanism, {"O1": mg.Motion(TURN, velocity=0.1)}, method="newton_euler")
    assert np.allclose(other["O1"].effort[:, 0], effort, rtol=1e-9, atol=1e-9 * np.abs(effort).max())
    assert abs(effort.mean()) < 1e-9 * np.abs(effort).max()


def compare() -> None:
    """What is in the printed tables: conditions of the pitches and sums of forces, no closure."""
    low, high = rchch.gap_of_table_xi()
    assert low > 80.0
    print(f"Table XI: the two directions of A4 are {low:.0f} to {high:.0f} degrees apart; a closure has 0")
    pitch, forces = rchch.pitch_identities(), rchch.force_identities()
    assert max(pitch.values()) < 0.03
    print("S = rho theta (printed to .01) in Tables XI to XIII:", {n: round(v, 3) for n, v in pitch.items()})
    print("what holds in Tables XXXIII to XXXVII:", {n: round(v, 3) for n, v in forces.items()})


def draw(found: list[mg.Solution], target: Path) -> None:
    """The four modes at theta1 = 0; theta5 of each with the numbers of Table XI; input torque; forces at O1 and O5 with the tables'."""
    figure = pictures.figure(14.4, 11.0)
    grid = figure.add_gridspec(3, 3, width_ratios=(1.0, 1.0, 1.2), wspace=0.08)
    for k, s in enumerate(found):
        space = figure.add_subplot(grid[divmod(k, 2)], projection="3d")
        draw_skeleton(s, 0, ax=space, ghosts=0, traces=False)
        space.set_title(f"mode {k + 1} at theta1 = 0", fontsize=10.5, loc="left")
    left, right = figure.add_subplot(grid[0, 2]), figure.add_subplot(grid[1, 2])
    theta = (np.rad2deg(TURN) + 180.0) % 360.0 - 180.0
    order = np.argsort(theta)
    for k, s in enumerate(found):
        style = {"color": pictures.COLOURS[k], "lw": 2.0, "ls": "--" if k in (1, 3) else "-", "label": f"mode {k + 1}"}
        left.plot(theta[order], np.rad2deg(s["O5"].position[order, 0]), **style)
        right.plot(theta[order], -s["O1"].effort[order, 0], **style)
    xi = table("XI")
    left.plot(xi["theta1"], xi["theta5"], label="Table XI (no closure)", **pictures.PRINTED)
    pictures.finish(left, "theta1 [deg]", "theta5 [deg]", "Angle of O5: modes 1 and 2, 3 and 4 share it", "upper left")
    pictures.finish(right, "theta1 [deg]", "M_IN [lb in2/s2]", "Input torque at w1 = .1 rad/s")
    for column, (number, pair) in enumerate((("XXXIII", "O1"), ("XXXVII", "O5"))):
        forces(figure.add_subplot(grid[2, column]), number, pair)
    for ax in (left, right):
        ax.set_xticks(np.arange(-180.0, 181.0, 60.0))
    pictures.save(figure, target)


def forces(ax: Axes, number: str, pair: str) -> None:
    """Size of the force at a pair over the range of his tables, with the printed one, whose F^ leaves out the part along the axis."""
    shown = table(number)
    for k, s in enumerate(rchch.branches()):
        theta = np.rad2deg(s["O1"].position[:, 0])
        style = {"color": pictures.COLOURS[k], "lw": 2.0, "ls": "--" if k in (1, 3) else "-", "label": f"mode {k + 1}"}
        ax.semilogy(theta, np.linalg.norm(s[pair].force, axis=1), **style)
    names = list(shown)
    free, along = np.array([shown[n] for n in names[1:4]]), shown[f"FA{pair[1]}"]
    size = np.sqrt((free**2).sum(axis=0) + along**2)
    ax.semilogy(shown["theta1"], size, label=f"Table {number} (no closure)", **pictures.PRINTED)
    pictures.finish(ax, "theta1 [deg]", "force [lb in/s2]", f"Force at {pair}", "upper left")


def main() -> None:
    f = mg.formulate(mg.load("rchch"), bookkeeping="lee")
    assert len(f.unknowns) == len(f.equations) == 34
    print(f.text(components=False))
    found = over_a_turn()
    assert len(found) == 4
    for k, s in enumerate(found, 1):
        check_mode(s)
        torque = -s["O1"].effort[:, 0]
        swing = np.ptp(np.rad2deg(s["O5"].position[:, 0]))
        print(f"mode {k}: theta5 swings {swing:.1f} degrees, M_IN {torque.min():.2f} to {torque.max():.2f} lb in2/s2")
    compare()
    if len(sys.argv) > 1:
        draw(found, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
