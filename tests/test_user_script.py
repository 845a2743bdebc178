"""The typed script of a user runs; its types are checked by mypy with the package (``files`` in pyproject.toml)."""

import tomllib
from pathlib import Path

import user_script

import mechgraph as mg


def test_the_script_runs():
    s = user_script.solved()
    assert set(user_script.read(s)) == {"effort", "reaction", "Fx", "center", "pose"}
    determinate, by_count, _ = user_script.looked_at(user_script.boom())
    assert not determinate  # planar: its reactions are redundant
    assert by_count == -2


def test_loads_by_freedom_and_by_points_are_read_alike():
    one, two = user_script.placed()[3:]
    assert (one.freedom, one.a) == ("C", None)
    assert (two.freedom, two.a, two.b, two.p, two.q) == (None, "boom", "ground", (2, 0, 0), (2, -1, 0))
    assert all(isinstance(load, mg.ForceLaw | mg.Damper) for load in user_script.placed())


def test_mypy_checks_the_script():
    root = Path(__file__).resolve().parents[1]
    options = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    assert options["strict"]
    assert Path(user_script.__file__).relative_to(root).as_posix() in options["files"]
