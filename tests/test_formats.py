"""Files for other programs: what is written comes back, with units and coordinates; suffixes choose; nothing is left of what fails."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import unquote

import networkx as nx
import numpy as np
import pytest
from test_hostile_names import NAMES, named

import mechgraph as mg

UNITS = {"length": "mm", "mass": "t", "time": "s"}
T = np.linspace(0.0, 0.5, 6)


def crank(shape: tuple[int, ...] = (2, 3)) -> mg.Solution:
    """A crank with a weight, in millimetres, at positions of a given shape; all columns have units where they have a dimension."""
    links = [mg.Link("frame"), mg.Link("crank", 2.0, (0.5, 0, 0), points={"tip": (1, 0, 0)})]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    m = mg.Mechanism("crank", links, pairs, ["A"], [mg.Gravity((0, -10.0, 0))], units=UNITS, description="a crank")
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.1, 0.9, int(np.prod(shape, dtype=int))).reshape(shape), 2.0)})


def swinging() -> mg.Response:
    return mg.respond(crank().mechanism.replace(drives=[]), T, rates={"A": 1.0})


def timed() -> mg.Solution:
    return mg.solve(crank().mechanism, {"A": mg.Motion(T**2, t=T)})


SOLUTIONS = {"cases": crank, "row": lambda: crank((4,)), "one": lambda: crank(()), "response": swinging, "timed": timed}
EVERY = ["points", "links", "centers", "loads"]


@pytest.fixture(params=SOLUTIONS)
def solution(request: pytest.FixtureRequest) -> mg.Solution:
    return SOLUTIONS[request.param]()


@pytest.mark.daily(2)
def test_netcdf_comes_back(solution: mg.Solution, tmp_path: Path) -> None:
    xr = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    made = solution.to_xarray(EVERY)
    solution.write(tmp_path / "x.nc", EVERY)
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf", decode_timedelta=False) as read:
        assert read.equals(made)
        assert read.attrs == made.attrs == {
            "mechanism": "crank", "description": "a crank", "engine": "dense", "method": "loop_wrench",
            "unit of length": "mm", "unit of mass": "t", "unit of time": "s",
        }  # fmt: skip
        assert set(read.coords) == set(made.coords)
        for name, values in made.variables.items():
            assert read[name].attrs == values.attrs, name
        assert read["crank.tip velocity:x"].attrs["units"] == "mm/s"
        assert read["A:Fx"].attrs["units"] == "N"
        assert "units" not in read["closure"].attrs


def test_a_solution_over_time_has_a_time_coordinate() -> None:
    pytest.importorskip("xarray")
    for s in (swinging(), timed()):
        data = s.to_xarray()
        assert data["A.Rz"].dims == ("t",)
        assert data.t.attrs == {"units": "s"}
        assert float(data["A.Rz"].sel(t=0.3, method="nearest")) == s["A"].position[3, 0]
    assert set(timed().to_xarray().coords) == {"t", "A.Rz"}
    assert crank((4,)).to_xarray()["A:Fx"].dims == ("position",)
    cases = mg.solve(crank().mechanism, {"A": mg.Motion(np.array([[1.0], [2.0]]) * T, t=T)}).to_xarray()
    assert cases["A.Rz"].dims == cases["t"].dims == ("case", "position")


def test_parquet_comes_back(solution: mg.Solution, tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    made = solution.to_pandas(EVERY)
    solution.write(tmp_path / "x.parquet", EVERY)
    read = pd.read_parquet(tmp_path / "x.parquet")
    pd.testing.assert_frame_equal(read, made)
    assert read.attrs == made.attrs
    assert read.attrs["units"]["A.Rz effort [N mm]"] == "N mm"
    assert read.attrs["mechanism"] == "crank"


@pytest.mark.daily(3)
def test_all_formats_hold_the_same_numbers(solution: mg.Solution, tmp_path: Path) -> None:
    pd, xr = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    pytest.importorskip("pyarrow")
    pytest.importorskip("h5netcdf")
    for suffix in (".csv", ".parquet", ".nc"):
        solution.write(tmp_path / f"x{suffix}")
    # read as texts: old versions of pandas round numbers unless told otherwise, new ones warn of being told
    texts, parquet = pd.read_csv(tmp_path / "x.csv", dtype=str), pd.read_parquet(tmp_path / "x.parquet")
    csv = {name: column if name == "status" else column.astype(float) for name, column in texts.items()}
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf", decode_timedelta=False) as data:
        for label, values in solution.columns().items():
            name = label.partition(" [")[0]
            for found in (csv[label], parquet[label], data[name]):
                np.testing.assert_array_equal(np.asarray(found).reshape(values.shape), values, err_msg=label)


@pytest.mark.slow
@pytest.mark.daily(4)
@pytest.mark.parametrize("name", NAMES)
def test_names_that_files_cannot_hold(name: str, tmp_path: Path) -> None:
    pd, xr = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    pytest.importorskip("pyarrow")
    pytest.importorskip("h5netcdf")
    m = named(name)
    s = mg.solve(m, {f"{name}p0": np.array([0.1, 0.2])})
    s.write(tmp_path / "x.nc", ["links"])
    s.write(tmp_path / "x.parquet")
    columns = s.columns()
    assert pd.read_parquet(tmp_path / "x.parquet").shape == (2, len(columns))
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as read:
        back = {unquote(str(n)): values for n, values in read.variables.items()}
        effort = next(n for n in back if n.endswith("p0.Rz effort"))
        np.testing.assert_array_equal(back[effort], s[f"{name}p0"].effort[:, 0])
        assert [n.endswith("p0.Rz") for n in map(str, read.coords)] == [True]


def test_a_suffix_that_says_nothing(tmp_path: Path) -> None:
    with pytest.raises(mg.FileError, match=r"known: .csv \(CSV\), .nc \(NetCDF\), .parquet \(Parquet\)"):
        crank().write(tmp_path / "x.xlsx")
    with pytest.raises(mg.DeclarationError, match="expected a text or a path"):
        crank().write(3)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_missing_package_names_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "h5netcdf", None)
    pytest.importorskip("xarray")
    with pytest.raises(
        mg.MissingExtraError, match=r"h5netcdf is not installed. Run: pip install 'mechgraph\[netcdf\]'"
    ):
        crank().write(tmp_path / "x.nc")


# --- the graph -----------------------------------------------------------------------------------------------------------


def read_back(path: Path) -> nx.MultiGraph:
    if path.suffix == ".graphml":
        return nx.read_graphml(path, force_multigraph=True)
    return nx.node_link_graph(json.loads(path.read_text(encoding="utf-8")), edges="edges")


@pytest.mark.parametrize("suffix", [".graphml", ".json"])
@pytest.mark.parametrize("name", ["rcsr-csr", "four-bar", "windows-2", "RPRHRRR"])
def test_the_graph_comes_back(name: str, suffix: str, tmp_path: Path) -> None:
    m = mg.load(name) if name in mg.library() else mg.chain(name)
    mg.save(m, tmp_path / f"x{suffix}")
    graph = read_back(tmp_path / f"x{suffix}")
    assert graph.is_multigraph()
    assert graph.graph["name"] == m.name
    assert dict(graph.nodes(data="mass")) == {link.name: link.mass for link in m.links}
    assert [n for n, frame in graph.nodes(data="frame") if frame] == [m.frame]
    edges = {key: (ends, data) for *ends, key, data in graph.edges(keys=True, data=True)}
    assert set(edges) == {p.name for p in m.pairs}
    loops: dict[int, dict[str, int]] = {}
    for pair in m.pairs:
        ends, data = edges[pair.name]
        assert set(ends) == {pair.a, pair.b}
        assert (data["a"], data["b"], data["type"]) == (pair.a, pair.b, pair.type.symbol)
        assert data["freedoms"].split() == [f.name for f in pair.type.freedoms]
        if pair.point is not None:
            assert [data[f"point_{x}"] for x in "xyz"] == list(pair.point)
        for number in map(int, data["loops"].split()):
            loops.setdefault(abs(number), {})[pair.name] = 1 if number > 0 else -1
    assert [loops[n] for n in sorted(loops)] == [dict(loop) for loop in mg.check(m).loops]
    driven = {f"{key}.{q}" for key, (_, data) in edges.items() for q in data["driven"].split()}
    assert driven == {m.full_name(d.freedom) for d in m.drives}


def test_pairs_that_join_the_same_links_stay_two(tmp_path: Path) -> None:
    pairs = [mg.Pair(name, "R", "frame", "door", point=(0, 0, z), axis=(0, 0, 1)) for name, z in (("A", 0), ("B", 1))]
    for suffix in (".graphml", ".json"):
        mg.save(mg.Mechanism("door", pairs=pairs), tmp_path / f"x{suffix}")
        assert {key for *_, key in read_back(tmp_path / f"x{suffix}").edges(keys=True)} == {"A", "B"}


@pytest.mark.parametrize("name", NAMES)
def test_graphs_with_names_that_would_be_commands(name: str, tmp_path: Path) -> None:
    for suffix in (".graphml", ".json"):
        mg.save(named(name), tmp_path / f"x{suffix}")
        assert len(read_back(tmp_path / f"x{suffix}")) == 4
        assert set(read_back(tmp_path / f"x{suffix}").edges(keys=True)).__len__() == 4
