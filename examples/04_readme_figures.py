"""Pictures of the README and the manual: the four-bar of the README, the ball press of example 02, the excavator of example 12.

Asserted: the mean power of the crank over a turn equals the mean power against the resistance, zero here, since the lever returns
and weights and kinetic energy come back: ``int T dtheta = 0`` over a cycle.

``python examples/04_readme_figures.py [FOLDER]`` draws them all, and notes beside them what they were drawn from: a test compares that
with what would be drawn now.
"""

import hashlib
import inspect
import json
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import mechgraph as mg
from mechgraph import show
from mechgraph.show import canvas

HERE = Path(__file__).resolve().parent
FIGURES = HERE / "figures"
NOTES = "drawn_from.json"
POSITION = 30
SPEED = 10.0
Made = Callable[[], tuple[mg.Mechanism, mg.Solution]]


def four_bar() -> tuple[mg.Mechanism, mg.Solution]:
    """As the first block of the README declares and solves it."""
    page = (HERE.parent / "README.md").read_text(encoding="utf-8")
    block = page.partition("```python\n")[2].partition("\nB = ")[0]
    names: dict[str, Any] = {}
    exec(compile(block, "README.md", "exec"), names)
    return names["m"], names["s"]


def press() -> tuple[mg.Mechanism, mg.Solution]:
    m = runpy.run_path(str(HERE / "02_new_topology.py"))["ball_press"]()
    s = mg.solve(m, {"A": mg.Motion(np.deg2rad(np.arange(0.0, 360.0)), velocity=SPEED)})
    torque = s["A"].effort[:, 0]
    assert abs(torque.mean()) < 1e-9 * np.abs(torque).max()
    return m, s


def excavator() -> tuple[mg.Mechanism, mg.Solution]:
    example = runpy.run_path(str(HERE / "12_excavator.py"))
    m = example["excavator"]()
    return m, example["dig"](m)


def draw_four_bar(figure: Any, m: mg.Mechanism, s: mg.Solution) -> None:
    figure.set_size_inches(10.4, 4.0)
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    show.draw_skeleton(s, 60, ax=figure.add_subplot(grid[0]), forces=True, traces=False)
    show.effort_curve(s, ax=figure.add_subplot(grid[1]), marked=60)


def draw_press(figure: Any, m: mg.Mechanism, s: mg.Solution) -> None:
    figure.set_size_inches(10.4, 4.3)
    grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    show.draw_skeleton(s, POSITION, ax=figure.add_subplot(grid[0], projection="3d"))
    show.effort_curve(s, ax=figure.add_subplot(grid[1]), marked=POSITION)


def draw_graphs(figure: Any, m: mg.Mechanism, s: mg.Solution) -> None:
    figure.set_size_inches(10.4, 4.6)
    grid = figure.add_gridspec(1, 3, width_ratios=(1.05, 1.05, 1.0))
    show.draw_graph(m, ax=figure.add_subplot(grid[0]))
    show.draw_structure(m, ax=figure.add_subplot(grid[1]))
    show.draw_sparsity(mg.formulate(m, bookkeeping="minimal"), ax=figure.add_subplot(grid[2]))


def draw_forces(figure: Any, m: mg.Mechanism, s: mg.Solution) -> None:
    figure.set_size_inches(10.4, 3.6)
    grid = figure.add_gridspec(1, 3, width_ratios=(1.0, 0.95, 1.0))
    show.reaction_ranges(s, ax=figure.add_subplot(grid[0]))
    show.polar_force(s, "A", ax=figure.add_subplot(grid[1], projection="polar"))
    show.reaction_curve(s, "E", ax=figure.add_subplot(grid[2]), marked=POSITION)


def draw_excavator(figure: Any, m: mg.Mechanism, s: mg.Solution) -> None:
    figure.set_size_inches(10.4, 7.2)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.45, 1.0))
    show.draw_skeleton(s, 0, ax=figure.add_subplot(grid[0, :]), forces=True, ghosts=3, traces=False)
    show.effort_curve(s, ax=figure.add_subplot(grid[1, 0]))
    show.reaction_ranges(s, ax=figure.add_subplot(grid[1, 1]))


PICTURES: dict[str, tuple[Made, Callable[[Any, mg.Mechanism, mg.Solution], None]]] = {
    "four_bar.png": (four_bar, draw_four_bar),
    "readme.png": (press, draw_press),
    "graphs.png": (press, draw_graphs),
    "forces.png": (press, draw_forces),
    "excavator.png": (excavator, draw_excavator),
}


def fingerprint(name: str) -> str:
    """A hash of what a picture is drawn from: the mechanism as a file, where it moves, how it is drawn, and in which colors."""
    made, draw = PICTURES[name]
    m, s = made()
    with tempfile.TemporaryDirectory() as folder:
        mg.save(m, Path(folder) / "m.toml")
        declared = (Path(folder) / "m.toml").read_text(encoding="utf-8")
    moved = {q: np.round(s[s.whole.pairs[s.whole.freedom(q)[0]].name].position, 6).tolist() for q in s.prescribed}
    text = json.dumps([declared, moved, inspect.getsource(draw), canvas.PALETTE, canvas.REACTION, canvas.LOAD])
    return hashlib.sha256(text.encode()).hexdigest()


def main(folder: Path) -> None:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    folder.mkdir(exist_ok=True)
    for name, (made, draw) in PICTURES.items():
        m, s = made()
        with rc_context({"font.size": 9.0}):
            figure = Figure(layout="constrained")
            draw(figure, m, s)
            show.save_picture(figure.axes[0], folder / name, dpi=86.0)
        print(f"{name}: {(folder / name).stat().st_size / 1000:.0f} kB")
    notes = {name: fingerprint(name) for name in PICTURES}
    (folder / NOTES).write_text(json.dumps(notes, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FIGURES)
