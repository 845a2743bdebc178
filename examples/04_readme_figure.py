"""The picture of the README: skeleton of the ball press of example 02 and the torque of its crank at 10 rad/s.

Asserted: the mean power of the crank over a turn equals the mean power against the resistance, zero here, since the lever returns
and weights and kinetic energy come back: ``int T dtheta = 0`` over a cycle.
"""

import runpy
import sys
from pathlib import Path

import numpy as np

import mechgraph as mg
from mechgraph.show import draw_skeleton, effort_curve

HERE = Path(__file__).resolve().parent
POSITION = 30


def main(target: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    m = runpy.run_path(str(HERE / "02_new_topology.py"))["ball_press"]()
    theta = np.deg2rad(np.arange(0.0, 360.0))
    s = mg.solve(m, {"A": mg.Motion(theta, velocity=10.0)})
    torque = s["A"].effort[:, 0]
    assert abs(torque.mean()) < 1e-9 * np.abs(torque).max()

    plt.rcParams.update({"font.size": 10.0, "figure.dpi": 110.0})
    figure = plt.figure(figsize=(10.4, 4.3), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    draw_skeleton(s, POSITION, ax=figure.add_subplot(grid[0], projection="3d"))
    effort_curve(s, ax=figure.add_subplot(grid[1]), marked=POSITION)
    figure.savefig(target, metadata={"Software": None})
    plt.close(figure)
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "figures" / "readme.png")
