"""Tables of a Solution: DataFrame and Dataset over the batch axes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg


def crank(shape: tuple[int, ...]) -> mg.Solution:
    """A crank with a weight at positions of a given shape."""
    links = [mg.Link("frame"), mg.Link("crank", 2.0, (0.5, 0, 0))]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    m = mg.Mechanism("crank", links, pairs, ["A"], [mg.Gravity((0, -10.0, 0))])
    angles = np.linspace(0.1, 0.9, int(np.prod(shape, dtype=int))).reshape(shape)
    return mg.solve(m, {"A": angles})


BATCHES = [
    ((), ()),
    ((3,), ("position",)),
    ((2, 3), ("case", "position")),
    ((2, 1, 3), ("case0", "case1", "position")),
]


@pytest.mark.parametrize(("shape", "dims"), BATCHES)
def test_dataset(shape: tuple[int, ...], dims: tuple[str, ...]) -> None:
    pytest.importorskip("xarray")
    s = crank(shape)
    data = s.to_xarray()
    assert data.attrs["mechanism"] == "crank"
    assert tuple(data["closure"].dims) == dims
    for name in data:
        assert data[name].dims == dims
    assert any(np.array_equal(data[name], s["A"].effort[..., 0]) for name in data)


@pytest.mark.parametrize(("shape", "dims"), BATCHES[1:])
def test_frame(shape: tuple[int, ...], dims: tuple[str, ...]) -> None:
    pytest.importorskip("pandas")
    s = crank(shape)
    frame = s.to_pandas()
    assert len(frame) == np.prod(shape)
    if len(shape) > 1:
        assert list(frame.index.names) == list(dims)
        assert frame.index[-1] == tuple(n - 1 for n in shape)
    assert any(np.array_equal(frame[name], s["A"].effort.ravel()) for name in frame)


# --- more on request -------------------------------------------------------------------------------------------------------

SPRING = mg.Spring("frame", "crank", "seat", "eye", stiffness=100.0, free_length=0.5, damping=2.0)
LAW = mg.ForceLaw("A", law=lambda x, v, t: -3.0 * x**2)
Q = np.array([[0.0, 0.5, 1.0], [1.5, 2.0, 2.5]])
RATE = 4.0


def loaded(**units: str) -> mg.Solution:
    """A crank with every kind of load, turning at 4 rad/s; two cases of three positions."""
    links = [
        mg.Link("frame", points={"seat": (2, 0, 0)}),
        mg.Link("crank", 2.0, (0.5, 0, 0), points={"eye": (1, 0, 0), "tip": (1, 0.5, 0)}),
    ]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    wrench = mg.Wrench("crank", force=(0.0, 7.0, 0.0), moment=(0, 0, 1.5), point="tip")
    loads = [mg.Gravity((0, -10.0, 0)), SPRING, LAW, mg.Effort("A", Q), wrench, mg.Damper("A", coefficient=0.3)]
    return mg.solve(mg.Mechanism("crank", links, pairs, ["A"], loads, units=units), {"A": mg.Motion(Q, RATE, 1.0)})


def test_paths_poses_and_centres_by_hand() -> None:
    table = loaded().columns(["points", "links", "centers"])
    c, s = np.cos(Q), np.sin(Q)
    expected = {
        "crank.tip:x": c - 0.5 * s, "crank.tip:y": s + 0.5 * c, "crank.tip velocity:x": RATE * (-s - 0.5 * c),
        "crank.eye acceleration:y": c * 1.0 - RATE**2 * s, "frame.seat:x": 2 + 0 * Q, "crank:x": 0 * Q, "crank:Rxx": c, "crank:Rxy": -s,
        "crank:Rzz": 1 + 0 * Q, "crank angular velocity:z": RATE + 0 * Q, "crank angular acceleration:z": 1 + 0 * Q,
        "crank center:y": 0.5 * s, "crank center velocity:y": 0.5 * RATE * c, "crank center acceleration:x": -0.5 * (s + RATE**2 * c),
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_allclose(table[name], values, atol=1e-12, err_msg=name)
    assert "frame center:x" not in table
    assert not set(expected) & set(loaded().columns())


def test_what_loads_do_by_hand() -> None:
    solution = loaded()
    table = solution.columns(["loads"])
    c, s = np.cos(Q), np.sin(Q)
    length = np.sqrt(5 - 4 * c)
    rate = 2 * s / length * RATE
    pull = -100 * (length - 0.5) - 2 * rate
    expected = {
        "loads[0] gravity on crank:Fy": -20 + 0 * Q, "loads[0] gravity on crank:Mz": -10 * c, "loads[0] gravity power": -10 * c * RATE,
        "loads[1] spring x": length, "loads[1] spring v": rate, "loads[1] spring force": pull, "loads[1] spring power": pull * rate,
        "loads[2] force_law x": Q, "loads[2] force_law v": RATE + 0 * Q, "loads[2] force_law force": -3 * Q**2,
        "loads[2] force_law power": -3 * Q**2 * RATE, "loads[3] effort force": Q, "loads[3] effort power": RATE * Q,
        "loads[4] wrench on crank:Mz": 1.5 + 7 * (c - 0.5 * s), "loads[4] wrench on crank:Fy": 7 + 0 * Q,
        "loads[4] wrench power": RATE * (1.5 + 7 * (c - 0.5 * s)), "loads[5] damper force": -0.3 * RATE + 0 * Q,
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_allclose(table[name], values, atol=1e-11, err_msg=name)
    total = sum(values for name, values in table.items() if name.startswith("loads") and name.endswith("power"))
    inertia = 2.0 * 0.25 * RATE * 1.0
    np.testing.assert_allclose(total + RATE * solution["A"].effort[..., 0], inertia, atol=1e-11)
    on_frame = solution.load(1).wrenches["frame"]
    np.testing.assert_allclose(on_frame, -solution.load(1).wrenches["crank"], atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(on_frame[..., 3:], axis=-1), np.abs(pull))
    with pytest.raises(mg.DeclarationError, match="a number below 6"):
        solution.load(6)


def test_all_tables_take_it_and_know_the_units(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    s = loaded(length="mm", mass="t", time="s")
    every = ["points", "links", "centers", "loads"]
    names = list(s.columns(every))
    assert list(s.to_pandas(include=every)) == names
    data = s.to_xarray(include=every)
    assert {
        f"{name} [{x.attrs['units']}]" if "units" in x.attrs else name for name, x in data.variables.items()
    } == set(names)
    assert set(data.coords) == {"A.Rz"}
    for name in ("crank.tip velocity:x [mm/s]", "crank:Rxx", "loads[1] spring force [N]", "loads[1] spring x [mm]",
                 "loads[2] force_law x [rad]", "loads[4] wrench on crank:Mz [N mm]", "A.Rz effort [N mm]"):  # fmt: skip
        assert name in names
    s.to_csv(tmp_path / "table.csv", include=["loads"])
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()))
    found = [float(row["loads[3] effort force [N mm]"]) for row in rows]
    assert found == Q.ravel().tolist()
    with pytest.raises(mg.DeclarationError, match="'points', 'links', 'centers', 'loads'"):
        s.columns(["everything"])  # type: ignore[list-item]
    with pytest.raises(mg.DeclarationError, match="a list"):
        s.columns("loads")  # type: ignore[arg-type]


def test_tables_in_parts_read_the_loads_of_their_own_positions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Values over positions, and functions of time, in a table that is written two rows at a time."""
    s = loaded()
    whole = s.columns(["loads"])
    monkeypatch.setattr("mechgraph.result.solution.ROWS_TOGETHER", 2)
    s.to_csv(tmp_path / "table.csv", include=["loads"])
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()))
    for name in ("loads[3] effort force", "loads[2] force_law force", "loads[1] spring power"):
        np.testing.assert_allclose([float(row[name]) for row in rows], whole[name].ravel())


def test_positions_that_were_not_solved_are_empty() -> None:
    m = mg.load("four-bar").replace(loads=[mg.Gravity((0, -9.81, 0))], drives=["D"])
    s = mg.solve(m, {"D": [m.start.get("D.Rz", 0.0), 9.0]}, on_reach="flag")
    power = s.columns(["loads"])[next(name for name in s.columns(["loads"]) if "gravity power" in name)]
    assert np.isfinite(power[0])
    assert np.isnan(power[1])


def test_a_response_has_what_loads_do_over_time() -> None:
    m = mg.Mechanism(
        "block", [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))],
        [mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=(1, 0, 0))],
        loads=[mg.ForceLaw("P", law=lambda x, v, t: 2 * np.cos(t))],
    )  # fmt: skip
    t = np.linspace(0, 2, 5)
    r = mg.respond(m, t)
    np.testing.assert_allclose(r.columns(["loads"])["loads[0] force_law power"], 2 * np.cos(t) * np.sin(t), atol=1e-7)


# --- units as people write them --------------------------------------------------------------------------------------------

WRITTEN = [
    (("m", "kg", "s"), "N", "N m", ""),
    (("mm", "t", "s"), "N", "N mm", ""),
    (("mm", "g", "ms"), "N", "N mm", ""),
    (("mm", "kg", "ms"), "kN", "kN mm", ""),
    (("mm", "kg", "s"), "mN", "mN mm", "mass='t'"),
    (("cm", "g", "s"), "dyn", "dyn cm", "length='m'"),
    (("ft", "slug", "s"), "lbf", "lbf ft", ""),
    (("yd", "kg", "s"), "kg yd/s^2", "kg yd^2/s^2", ""),
]


@pytest.mark.parametrize(("base", "force", "moment", "advice"), WRITTEN)
def test_units_and_the_hint(base: tuple[str, ...], force: str, moment: str, advice: str) -> None:
    s = loaded(**dict(zip(("length", "mass", "time"), base, strict=True)))
    assert (s["A"].units["force"], s["A"].units["moment"]) == (force, moment)
    text = s.summary()
    assert ("loads are read" in text) == bool(advice)
    assert advice in " ".join(text.split())


def test_what_the_hint_advises_makes_it_newtons() -> None:
    pytest.importorskip("pint")
    kg, t = (
        loaded(length="mm", mass="kg", time="s").mechanism.replace(loads=[mg.Gravity((0, -9810.0, 0))])
        for _ in range(2)
    )
    t = t.to_units(mass="t")
    mN, N = (mg.solve(m, {"A": 0.0}) for m in (kg, t))
    assert "loads are read" in mN.summary()
    assert "loads are read" not in N.summary()
    in_mN, in_N = (s["A"].effort[0] for s in (mN, N))
    np.testing.assert_allclose(in_mN, 1e3 * in_N)
