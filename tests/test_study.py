"""Studies of many variants: against solving each variant by itself, closed forms, executors, failures of single variants."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import mechanisms as known
import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import closed_mechanism, with_drives, with_loads

import mechgraph as mg
from mechgraph.model.parameters import declared
from mechgraph.variants import study as module
from mechgraph.variants.fields import Variants, field_values, find_field, varied

ANGLES = np.deg2rad(np.arange(150.0, 190.0, 5.0))
RCSR = {"O1": mg.Motion(ANGLES, 0.1, 0.2)}


def spread_of(value: float) -> Any:
    return scipy.stats.norm(value, 0.01 * max(abs(value), 0.1))


def variants_of(m: mg.Mechanism, names: list[str], values: np.ndarray) -> Variants:
    fields = {name: find_field(m, name) for name in names}
    assert not [f for f in fields.values() if isinstance(f, str)], fields
    return varied(m, fields, values)  # type: ignore[arg-type]


def sprung() -> mg.Mechanism:
    """A crank-rocker with every kind of load."""
    z = (0, 0, 1)
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, (0.5, 0, 0), mg.inertia.from_components(0.02, 0.1, 0.11)),
        mg.Link("coupler", 2.0, (2, 1, 0)),
        mg.Link("rocker", 1.5, (3, 1, 0)),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z),
        mg.Pair("B", "S", "crank", "coupler", point=(1, 0, 0)),
        mg.Pair("C", "C", "coupler", "rocker", point=(3, 2, 0), axis=z),
        mg.Pair("D", "R", "frame", "rocker", point=(3, 0, 0), axis=z),
    ]
    loads = [
        mg.Gravity((0, -9.81, 0)),
        mg.Wrench("rocker", force=(1, 2, 0), moment=(0, 0, 3), point=(3, 1, 0), frame="link"),
        mg.Effort("D", -2.0),
        mg.Spring("crank", "rocker", (0.5, 0, 0), (3, 1, 0), 20.0, 1.0, 0.5),
        mg.TorsionSpring("D", 5.0, 0.1, 0.2),
    ]
    return mg.Mechanism("sprung", links, pairs, ["A"], loads)  # fmt: skip


FIELDS = {
    "rcsr": ["length[2]", "twist[0]", "offset[3]", "twist[3]", "link1.mass", "link2.center.x", "link3.inertia.xy", "loads[0].value"],
    "sprung": [
        "crank.mass", "coupler.center.y", "crank.inertia.yy", "B.point.x", "D.axis.x", "loads[0].acceleration.y",
        "loads[1].force.x", "loads[1].moment.z", "loads[1].point.y", "loads[2].value", "loads[3].stiffness",
        "loads[3].free_length", "loads[3].damping", "loads[3].p.x", "loads[4].stiffness", "loads[4].free", "loads[4].damping",
    ],
    "rchch": ["O3.pitch", "O2.on_a.point.x", "link2.mass"],
}  # fmt: skip
MECHANISMS = {"rcsr": lambda: mg.load("rcsr"), "sprung": sprung, "rchch": lambda: mg.load("rchch")}
MOTIONS = {
    "rcsr": RCSR,
    "sprung": {"A": mg.Motion(np.linspace(0, 6.0, 25), 2.0, 1.0)},
    "rchch": {"O1": mg.Motion(np.deg2rad(np.arange(-60.0, 60.0, 10.0)), 0.1, 0.1)},
}
OUTPUTS = ("effort", "position", "acceleration", "reaction", "moment")


def assert_same(study: mg.Study, i: int, motions: dict[str, Any], names: list[str]) -> None:
    """Outputs of one variant agree with ``mg.solve`` of that variant by itself."""
    alone = mg.solve(study.variant(i), motions)
    for name in names:
        owner, _, part = name.partition(".")
        link = owner in study.mechanism.link_names()
        value = np.asarray(getattr(alone.link(owner) if link else alone[owner], part))
        value = value[..., 0] if value.shape[-1] == 1 else value
        found = study.outputs[name][i]
        assert found.shape == value.shape
        assert np.array_equal(np.isnan(found), np.isnan(value))
        assert np.nanmax(np.abs(found - value), initial=0.0) <= 1e-9 * (1.0 + np.nanmax(np.abs(value), initial=0.0)), (
            name
        )


# --- numbers by name -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIELDS)
def test_arrays_of_variants_are_those_of_each_variant_by_itself(name: str) -> None:
    """What the kernels read is what each variant declares; read back by name it is what was put in."""
    m, names = MECHANISMS[name](), FIELDS[name]
    fields = {n: find_field(m, n) for n in names}
    start = np.array(list(field_values(m, fields).values()))  # type: ignore[arg-type]
    values = start[:, None] * (1 + 0.01 * np.random.default_rng(0).normal(size=(len(names), 3)))
    together = variants_of(m, names, values)
    if name == "rcsr":
        assert not together.valid().any() or together.valid().all()
    for i in range(3):
        one = together.one(i)
        mine, alone = together.numbers, declared(one)
        for f in dataclasses.fields(mine):
            part = getattr(mine, f.name)
            assert np.allclose(part[..., i if part.shape[-1] > 1 else 0], getattr(alone, f.name)[..., 0], atol=1e-14), (
                f.name
            )
        again = field_values(one, {n: find_field(one, n) for n in names})  # type: ignore[misc]
        assert np.allclose(list(again.values()), values[:, i], rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("crank.weight", "no declared number"), ("nobody.mass", "no declared number"), ("A.pitch", "no declared number"),
        ("length[2]", "is no chain"), ("loads[9].value", "there are 5 loads"), ("loads[2].force.x", "no number of that name"),
        ("A.on_a.point.x", "no declared number"), ("crank.center.w", "no declared number"), ("frame.center.x", "no declared number"),
    ],
)  # fmt: skip
def test_names_that_are_no_numbers_are_refused(name: str, told: str) -> None:
    with pytest.raises(mg.DeclarationError, match=told):
        mg.study(sprung(), {name: [1.0, 2.0]}, "A.effort", n=2, motions={"A": 0.0})


# --- against each variant by itself ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIELDS)
def test_variants_agree_with_solving_each_by_itself(name: str) -> None:
    m, motions = MECHANISMS[name](), MOTIONS[name]
    fields = {n: find_field(m, n) for n in FIELDS[name]}
    start = field_values(m, fields)  # type: ignore[arg-type]
    kept = [f"{p.name}.{part}" for p in m.pairs for part in OUTPUTS] + [f"{m.links[1].name}.center"]
    study = mg.study(m, {n: spread_of(v) for n, v in start.items()}, kept, n=8, seed=3, motions=motions)
    assert not study.failed.any(), study.messages
    for i in range(0, 8, 3):
        assert_same(study, i, motions, kept)


def test_passive_bodies_of_variants() -> None:
    """The coupler of every RSSR variant is held as that of the variant by itself."""
    m = mg.load("rssr")
    name = next(k.name for k in m.links if k.mass > 0)
    first = next(p for p in m.pairs if p.type.symbol == "S")
    field = f"{first.name}.point.x" if first.point is not None else f"{first.name}.on_a.point.x"
    start = field_values(m, {field: find_field(m, field)})[field]  # type: ignore[dict-item]
    kept = [f"{p.name}.{part}" for p in m.pairs for part in ("effort", "velocity", "force")]
    study = mg.study(m, {field: spread_of(start), f"{name}.mass": [1.0, 2.0]}, kept, n=4, seed=1)
    drives = {d.freedom: d.motion for d in m.drives}
    for i in range(4):
        assert_same(study, i, drives, kept)


@given(seed=st.integers(0, 3000))
def test_random_mechanisms(seed: int) -> None:
    """Any topology, any pairs: masses and markers of every variant changed; also redundant ones and many drivers.

    Not those with passive bodies: how such a body stands depends on the way from the start, here the way of its numbers.
    """
    m = closed_mechanism(seed)
    driven = with_drives(m, seed)
    assume(driven is not None)
    report = mg.check(driven)
    assume(not report.passive and not report.near)
    m = with_loads(driven, seed, constant=True)
    motions = {d.freedom: mg.Motion(np.linspace(0, 0.05, 4), 0.3, 0.1) for d in m.drives}
    try:
        s = mg.solve(m, motions)
    except mg.MechgraphError:
        assume(False)
    assume((s.status == "ok").all() and s.checks.closure.max() < 1e-12)
    massive = next(k.name for k in m.links if k.mass > 0)
    pair = m.pairs[0]
    kept = [f"{p.name}.{part}" for p in m.pairs for part in ("effort", "total", "acceleration")]
    ways = {f"{massive}.mass": [1.0, 2.0, 3.0], f"{pair.name}.point.x": scipy.stats.uniform(pair.point[0], 0.002)}
    study = mg.study(m, ways, kept, n=3, seed=seed, motions=motions)
    for i in np.flatnonzero(~study.failed):
        try:
            assert_same(study, int(i), motions, kept)
        except mg.DeadPointError:
            assume(False)


# --- against closed forms ----------------------------------------------------------------------------------------------------


def pendulum(**numbers: float) -> mg.Mechanism:
    mass, length = numbers.get("mass", 2.0), numbers.get("length", 0.5)
    return mg.Mechanism("pendulum", [mg.Link("frame"), mg.Link("bob", mass, (length, 0, 0))],
                        [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1))], ["A"], [mg.Gravity((0, -10, 0))])  # fmt: skip


def test_sensitivities_worst_case_and_quantiles_of_a_pendulum() -> None:
    """Torque m g l cos(theta): derivatives g l and m g, worst case at the ends, quantiles of the product."""
    ways = {"bob.mass": scipy.stats.uniform(1.9, 0.2), "bob.center.x": scipy.stats.norm(0.5, 0.001)}
    study = mg.study(
        pendulum(), ways, {"torque": "A.effort"}, n=4000, seed=5, motions={"A": [0.0, np.pi / 3]}, sampling="latin"
    )
    half = np.array([1.0, 0.5])
    slopes = study.sensitivities("torque")
    assert np.allclose(study.nominal["torque"], 10.0 * half, rtol=1e-12)
    assert np.allclose(slopes["bob.mass"], 5.0 * half, rtol=1e-7)
    assert np.allclose(slopes["bob.center.x"], 20.0 * half, rtol=1e-7)
    low, high = study.worst_case("torque")
    reach = 20 * 0.001 * scipy.stats.norm.ppf(0.99865)
    assert np.allclose(high - 10.0 * half, (5 * 0.1 + reach) * half, rtol=1e-6)
    assert np.allclose(10.0 * half - low, (5 * 0.1 + reach) * half, rtol=1e-6)
    torque = 10.0 * study.parameters["bob.mass"] * study.parameters["bob.center.x"]
    assert np.allclose(study.outputs["torque"][:, 0], torque, rtol=1e-12)
    assert np.allclose(study.quantiles("torque", [0.1, 0.9])[:, 0], np.quantile(torque, [0.1, 0.9]))
    assert np.allclose(study.mean("torque")[0], 10.0, rtol=1e-4)
    assert study.std("torque")[0] == pytest.approx(10 * np.sqrt((0.5 * 0.2) ** 2 / 12 + (2 * 0.001) ** 2), rel=0.01)
    assert study.linear_std("torque")[0] == pytest.approx(np.hypot(5 * 0.2 / np.sqrt(12), 0.02), rel=1e-6)


def test_grid_takes_every_combination() -> None:
    study = mg.study(
        pendulum(),
        {"bob.mass": [1, 2], "bob.center.x": [0.1, 0.2, 0.3]},
        "A.effort",
        motions={"A": 0.0},
        sampling="grid",
    )
    assert study.outputs["A.effort"][:, 0] == pytest.approx([1, 2, 3, 2, 4, 6])


def test_function_that_builds_and_function_that_reduces() -> None:
    study = mg.study(pendulum, {"mass": [1.0, 2.0, 4.0], "length": scipy.stats.uniform(0.4, 0.2)},
                     {"peak": lambda s: np.abs(s["A"].effort[..., 0]).max(axis=1)}, n=6, seed=2, motions={"A": [0.0, 0.4]})  # fmt: skip
    assert np.allclose(study.outputs["peak"], 10 * study.parameters["mass"] * study.parameters["length"])
    assert study.nominal["peak"] == pytest.approx(10 * 2.0 * 0.5)


def test_every_variant_may_have_its_own_motion() -> None:
    angles = np.linspace(0, 1, 15).reshape(5, 3)
    study = mg.study(pendulum(), {"bob.mass": [1.0, 3.0]}, "A.effort", n=5, motions={"A": angles})
    assert np.allclose(study.outputs["A.effort"], 5 * study.parameters["bob.mass"][:, None] * np.cos(angles))


# --- executors ---------------------------------------------------------------------------------------------------------------


def test_same_seed_same_result_whatever_the_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CHUNK", 3 * len(ANGLES))
    ways = {"length[2]": scipy.stats.norm(0.4, 0.004), "link1.mass": scipy.stats.uniform(1, 2)}
    found = []
    calls: list[tuple[int, int]] = []
    with ThreadPoolExecutor(2) as threads:
        for executor in (None, threads):
            found.append(
                mg.study(
                    mg.load("rcsr"),
                    ways,
                    ["O1.effort", "O3.force"],
                    n=10,
                    seed=7,
                    motions=RCSR,
                    executor=executor,
                    progress=lambda done, of: calls.append((done, of)),
                )
            )
    here = mg.study(
        mg.load("rcsr"),
        ways,
        {"O1.effort": lambda s: s["O1"].effort[..., 0], "O3.force": "O3.force"},
        n=10,
        seed=7,
        motions=RCSR,
    )
    for other in (found[1], here):
        for name in ("O1.effort", "O3.force"):
            assert np.array_equal(found[0].outputs[name], other.outputs[name])
    assert sorted(calls) == sorted(2 * [(i, 5) for i in range(1, 6)])
    other = mg.study(mg.load("rcsr"), ways, "O1.effort", n=10, seed=8, motions=RCSR)
    assert not np.array_equal(found[0].outputs["O1.effort"], other.outputs["O1.effort"])


def test_dask_cluster() -> None:
    """A real local cluster through its executor."""
    distributed = pytest.importorskip("distributed")
    ways = {"length[2]": scipy.stats.norm(0.4, 0.004)}
    here = mg.study(mg.load("rcsr"), ways, "O1.effort", n=6, seed=7, motions=RCSR)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        there = mg.study(mg.load("rcsr"), ways, "O1.effort", n=6, seed=7, motions=RCSR, executor=client.get_executor())
    assert np.array_equal(here.outputs["O1.effort"], there.outputs["O1.effort"])


# --- variants that fail ------------------------------------------------------------------------------------------------------


def test_variants_that_cannot_be_are_told_and_do_not_stop_the_others() -> None:
    """A negative mass, a loop that cannot close, positions out of reach."""
    ways = {"link1.mass": [-1.0, 2.0], "length[2]": [0.4, 9.0], "O1.on_a.point.z": [0.0]}
    study = mg.study(
        mg.load("rcsr"),
        {k: v for k, v in ways.items() if "O1" not in k},
        ["O1.effort", "O4.position"],
        motions=RCSR,
        sampling="grid",
    )
    assert study.failed.tolist() == [True, True, False, True]
    assert np.isnan(study.outputs["O1.effort"][study.failed]).all()
    assert "mass = -1" in study.messages[0]
    assert "cannot be closed" in study.messages[3]
    assert (study.status[2] == "ok").all()
    reach = mg.study(
        mg.load("rcsr"), {"length[2]": [0.4]}, "O1.effort", n=2, motions={"O1": np.deg2rad([150.0, 200.0, 215.0])}
    )
    assert reach.status.tolist() == 2 * [["ok", "ok", "out of reach"]]
    assert np.isnan(reach.outputs["O1.effort"][:, 2]).all()
    assert np.isfinite(reach.outputs["O1.effort"][:, :2]).all()


def test_overconstrained_loop_with_other_dimensions_is_a_structure() -> None:
    """A Bennett loop moves for its own dimensions only: variants of it are not solved, and say so."""
    m = known.bennett()
    name = f"{m.pairs[1].name}.point.x" if m.pairs[1].point is not None else f"{m.pairs[1].name}.on_a.point.x"
    start = field_values(m, {name: find_field(m, name)})[name]  # type: ignore[dict-item]
    motions = {m.drives[0].freedom: np.array([0.0, 0.2])}
    study = mg.study(m, {name: [start, start + 0.05]}, f"{m.pairs[0].name}.effort", sampling="grid", motions=motions)
    assert study.failed.tolist() == [False, True]
    assert np.isnan(study.outputs[f"{m.pairs[0].name}.effort"][1]).any()


def test_bad_arguments_are_all_told() -> None:
    with pytest.raises(mg.DeclarationError, match="expected a distribution") as caught:
        mg.study(pendulum(), {"bob.mass": "heavy", "bob.center.x": [np.nan]}, "A.effort")
    assert str(caught.value).count("expected a distribution") == 2
    with pytest.raises(mg.DeclarationError, match="is no quantity"):
        mg.study(pendulum(), {"bob.mass": [1.0]}, "A.weight", motions={"A": 0.0})
    with pytest.raises(mg.DeclarationError, match="expected one of random, latin, grid"):
        mg.study(pendulum(), {"bob.mass": [1.0]}, "A.effort", motions={"A": 0.0}, sampling="sobol")
    with pytest.raises(mg.DeclarationError, match="reduce over axis 1"):
        mg.study(pendulum(), {"bob.mass": [1.0]}, {"x": lambda s: s["A"].effort.max()}, n=3, motions={"A": 0.0})
    with pytest.raises(mg.DeclarationError, match="its function failed: ZeroDivisionError"):
        mg.study(pendulum(), {"bob.mass": [1.0]}, {"x": lambda s: 1 / 0}, n=3, motions={"A": 0.0})


def test_tables() -> None:
    pytest.importorskip("xarray")
    outputs = {"torque": "A.effort", "force": "A.force", "peak": lambda s: s["A"].effort[..., 0].max(axis=1)}
    study = mg.study(pendulum(), {"bob.mass": [1.0, 2.0]}, outputs, n=3, motions={"A": [0.0, 0.1]})
    data = study.to_xarray()
    assert data["torque"].dims == ("variant", "position")
    assert data["force"].sizes == {"variant": 3, "position": 2, "force 0": 3}
    assert np.array_equal(data.coords["bob.mass"], study.parameters["bob.mass"])
    table = study.to_pandas()
    assert list(table.columns) == ["bob.mass", "peak", "positions not solved"]
    assert "3 variants, 0 not solved" in repr(study)
