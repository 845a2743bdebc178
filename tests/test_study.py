"""Studies of many variants: against solving each variant by itself, closed forms, executors, failures of single variants."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import functools
import multiprocessing
import os
import pickle
from pathlib import Path
from typing import Any

import mechanisms as known
import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import closed_mechanism, with_drives, with_loads
from test_prescribed import hexapod, poses

import mechgraph as mg
from mechgraph.kinematics.prescribed import driven
from mechgraph.model.parameters import declared
from mechgraph.variants import study as module
from mechgraph.variants import work
from mechgraph.variants.numbers import Variants, field_values, find_field, varied

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


def geared() -> mg.Mechanism:
    """A five-bar whose cranks are geared, and a slide that follows one of them by a rack."""
    z = (0, 0, 1)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z),
        mg.Pair("B", "R", "crank", "rod", point=(0.3, 0.9, 0), axis=z),
        mg.Pair("C", "R", "rod", "link", point=(1.6, 2.0, 0), axis=z),
        mg.Pair("D", "R", "link", "arm", point=(2.8, 1.0, 0), axis=z),
        mg.Pair("E", "R", "frame", "arm", point=(3, 0, 0), axis=z),
        mg.Pair("X", "P", "frame", "slide", point=(5, 0, 0), axis=(1, 0, 0)),
    ]
    couplings = [
        mg.Coupling({"A": 1.0, "E": -2.0}, name="g", constant=0.0),
        mg.Coupling({"E": 1.0, "X": -8.0}, name="rack"),
    ]
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, (0.1, 0.4, 0)),
        mg.Link("rod", 2.0, (1, 1.5, 0)),
        mg.Link("link", 1.0, (2, 1.5, 0)),
        mg.Link("arm"),
    ]
    links.append(mg.Link("slide", 0.5, (5, 0, 0)))
    return mg.Mechanism(
        "geared five-bar",
        links,
        pairs,
        ["A"],
        [mg.Gravity((0, -9.81, 0)), mg.Effort("X", 2.0)],
        couplings=couplings,
        start={"A": 0.02, "E": 0.01, "X": 0.1},
    )


FIELDS = {
    "geared": ["g.A", "g.E", "g.constant", "rack.X", "B.point.x", "rod.mass"],
    "rcsr": ["length[2]", "twist[0]", "offset[3]", "twist[3]", "link1.mass", "link2.center.x", "link3.inertia.xy", "loads[0].value"],
    "sprung": [
        "crank.mass", "coupler.center.y", "crank.inertia.yy", "B.point.x", "D.axis.x", "loads[0].acceleration.y",
        "loads[1].force.x", "loads[1].moment.z", "loads[1].point.y", "loads[2].value", "loads[3].stiffness",
        "loads[3].free_length", "loads[3].damping", "loads[3].p.x", "loads[4].stiffness", "loads[4].free", "loads[4].damping",
    ],
    "rchch": ["O3.pitch", "O2.on_a.point.x", "link2.mass"],
}  # fmt: skip
MECHANISMS = {"geared": geared, "rcsr": lambda: mg.load("rcsr"), "sprung": sprung, "rchch": lambda: mg.load("rchch")}
MOTIONS = {
    "geared": {"A": mg.Motion(np.linspace(0.02, 1.0, 9), 2.0, 1.0)},
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
    assert together.valid().all()
    for i in range(3):
        one = together.one(i)
        mine, alone = together.numbers, declared(one)
        for f in dataclasses.fields(mine):
            part = getattr(mine, f.name)
            if part.dtype == object:
                assert (part[:, 0] == getattr(alone, f.name)[:, 0]).all() or name == "geared"
                continue
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


@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
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


@settings(max_examples=5)
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


def test_grid_takes_the_middle_of_equal_parts_of_a_distribution() -> None:
    ways = {"bob.mass": scipy.stats.uniform(1.0, 1.0), "bob.center.x": scipy.stats.norm(0.5, 1e-300)}
    study = mg.study(pendulum(), ways, "A.effort", n=2, motions={"A": 0.0}, sampling="grid")
    assert study.parameters["bob.mass"].tolist() == [1.25, 1.25, 1.75, 1.75]
    assert study.parameters["bob.center.x"].tolist() == [0.5] * 4
    assert study.outputs["A.effort"][:, 0] == pytest.approx([6.25, 6.25, 8.75, 8.75])


def test_lead_of_a_screw_varies_as_a_lead() -> None:
    """Axial force F on a nut: the driver holds it with ``F lead / (2 pi)``."""
    screw = mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=(0, 0, 1), lead=0.5)
    m = mg.Mechanism("screw", None, [screw], ["A"], [mg.Wrench("nut", force=(0, 0, -3.0), point=(0, 0, 0))])
    study = mg.study(m, {"A.lead": [0.5, 1.0, 2.0]}, "A.effort", sampling="grid", motions={"A": 0.0})
    assert study.outputs["A.effort"].ravel() == pytest.approx([3.0 * lead / (2 * np.pi) for lead in (0.5, 1.0, 2.0)])
    assert study.nominal["A.effort"].ravel() == pytest.approx([3.0 * 0.5 / (2 * np.pi)])


def test_function_that_builds_and_function_that_reduces() -> None:
    study = mg.study(pendulum, {"mass": [1.0, 2.0, 4.0], "length": scipy.stats.uniform(0.4, 0.2)},
                     {"peak": lambda s: np.abs(s["A"].effort[..., 0]).max(axis=1)}, n=6, seed=2, motions={"A": [0.0, 0.4]})  # fmt: skip
    assert np.allclose(study.outputs["peak"], 10 * study.parameters["mass"] * study.parameters["length"])
    assert study.nominal["peak"] == pytest.approx(10 * 2.0 * 0.5)


def test_functions_that_fail_say_so_for_their_variant() -> None:
    def build(length: float = 0.5) -> Any:
        if length > 3.0:
            raise ValueError("too long")
        if length > 2.0:
            return pendulum(length=length).replace(loads=[])
        return pendulum(length=length) if length < 1.0 else 3

    study = mg.study(
        build, {"length": [0.4, 0.5, 0.6, 0.7, 1.5, 2.5, 3.5]}, "A.effort", motions={"A": 0.0}, sampling="grid"
    )
    assert study.failed.tolist() == [False] * 4 + [True] * 3
    assert study.outputs["A.effort"][:4, 0] == pytest.approx([8.0, 10.0, 12.0, 14.0])
    assert np.isnan(study.outputs["A.effort"][4:]).all()
    for i, words in (
        (4, "gave int; expected a Mechanism"),
        (5, "only numbers may differ"),
        (6, "ValueError: too long"),
    ):
        assert words in study.messages[i]


def test_every_variant_may_have_its_own_motion() -> None:
    angles = np.linspace(0, 1, 15).reshape(5, 3)
    study = mg.study(pendulum(), {"bob.mass": [1.0, 3.0]}, "A.effort", n=5, motions={"A": angles})
    assert np.allclose(study.outputs["A.effort"], 5 * study.parameters["bob.mass"][:, None] * np.cos(angles))


# --- executors ---------------------------------------------------------------------------------------------------------------


def test_variants_solved_alone_keep_the_outcome_of_every_position() -> None:
    """A rocker whose length goes through zero to its negative cannot be followed there: that variant is solved alone, as by ``solve``."""
    m = known.marked_four_bar()
    drive = {"A": np.linspace(0.5, 5.5, 6)}
    study = mg.study(m, {"C.on_b.point.x": [-2.5, -0.9, 2.4]}, ["A.effort"], n=3, motions=drive, sampling="grid")
    for i in range(3):
        s = mg.solve(study.variant(i), drive, on_reach="flag")
        assert study.status[i].tolist() == s.status.tolist()
        np.testing.assert_allclose(study.outputs["A.effort"][i], s["A"].effort[:, 0], rtol=1e-9, atol=1e-9)
    assert study.failed.tolist() == [False, True, False]
    assert set(study.status[1]) == {"ok", "out of reach"}


class Lazy(concurrent.futures.Executor):
    """Does the first task at once, and the others never."""

    def __init__(self) -> None:
        self.futures: list[concurrent.futures.Future[Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        self.futures.append(concurrent.futures.Future())
        if len(self.futures) == 1:
            self.futures[0].set_result(fn(*args, **kwargs))
        return self.futures[-1]


def test_what_is_not_begun_is_cancelled_where_a_study_ends_early(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", len(ANGLES))
    lazy = Lazy()

    def stop(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mg.study(
            mg.load("rcsr"),
            {"link1.mass": [1.0, 2.0, 3.0]},
            "O1.effort",
            n=3,
            motions=RCSR,
            executor=lazy,
            progress=stop,
        )
    assert len(lazy.futures) == 4
    assert [future.cancelled() for future in lazy.futures] == [False, True, True, True]


def deadly(ground: float, once: str = "") -> mg.Mechanism:
    """A builder that ends its process above 2.6, of several; ``once``: where there is no such file yet."""
    if ground > 2.6 and multiprocessing.parent_process() is not None:
        if not once:
            os._exit(9)
        with contextlib.suppress(FileExistsError), open(once, "x", encoding="utf-8"):
            os._exit(9)
    return four_bar(ground)


@pytest.mark.daily(1)
@pytest.mark.parametrize("again", [True, False])
def test_a_process_that_is_killed_takes_only_what_kills_it_again(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "FEW_ALONE", 2)
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", 2)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    grounds = [2.45, 2.46, 2.47, 2.48, 2.7, 2.71]
    build = functools.partial(deadly, once="" if again else str(tmp_path / "once"))

    def study() -> mg.Study:
        return mg.study(build, {"ground": grounds}, "A.effort", n=6, motions={"A": [0.5]})

    expected = mg.study(four_bar, {"ground": grounds}, "A.effort", n=6, motions={"A": [0.5]}).outputs["A.effort"]
    if not again:
        assert np.array_equal(study().outputs["A.effort"], expected)
        return
    with pytest.raises(mg.StudyError, match="the process of 1 part of 4 ended before it was done") as caught:
        study()
    found = caught.value.study
    assert np.array_equal(found.outputs["A.effort"][:4], expected[:4])
    assert np.isnan(found.outputs["A.effort"][4:]).all()
    assert list(found.failed) == [False] * 4 + [True] * 2
    assert "ended before it was done" in found.messages[4]


def test_progress_that_raises_keeps_the_parts_that_are_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", len(ANGLES))
    monkeypatch.setattr(os, "cpu_count", lambda: 1)

    def stop(done: int, of: int) -> None:
        if done == 3:
            raise ValueError("mine")

    with pytest.raises(mg.StudyError, match="progress raised ValueError: mine") as caught:
        mg.study(
            mg.load("rcsr"),
            {"link1.mass": [1.0, 2.0, 3.0]},
            "O1.effort",
            n=3,
            motions=RCSR,
            progress=stop,
        )
    assert list(caught.value.study.failed) == [False, False, True]


def test_same_seed_same_result_whatever_the_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", 3 * len(ANGLES))
    ways = {"length[2]": scipy.stats.norm(0.4, 0.004), "link1.mass": scipy.stats.uniform(1, 2)}
    found = []
    calls: list[tuple[int, int]] = []
    with concurrent.futures.ThreadPoolExecutor(2) as threads:
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


@pytest.mark.slow
def test_dask_cluster_of_which_a_worker_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A real local cluster through its executor: what a worker that is killed had is done by the other one."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", 2 * len(ANGLES))
    ways = {"length[2]": scipy.stats.norm(0.4, 0.004)}
    here = mg.study(mg.load("rcsr"), ways, "O1.effort", n=8, seed=7, motions=RCSR, executor=Here(), engine="dense")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        victim = min(client.run(os.getpid).values())
        there = mg.study(
            mg.load("rcsr"), ways, "O1.effort", n=8, seed=7, motions=RCSR, executor=client.get_executor(),
            engine="dense", progress=lambda done, of: os.kill(victim, 9) if done == 1 else None,
        )  # fmt: skip
    assert np.array_equal(here.outputs["O1.effort"], there.outputs["O1.effort"])


class Here(concurrent.futures.Executor):
    """Works in this thread; the task of number ``lost`` is given up for reasons of its own."""

    def __init__(self, lost: int = -1) -> None:
        self.lost, self.count = lost, 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        future: concurrent.futures.Future[Any] = concurrent.futures.Future()
        if self.count == self.lost:
            future.set_exception(RuntimeError("worker died four times"))
        else:
            future.set_result(fn(*args, **kwargs))
        self.count += 1
        return future


def test_what_an_executor_gives_up_leaves_the_other_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POSITIONS_TOGETHER", len(ANGLES))
    with pytest.raises(mg.StudyError, match="1 part of 4 ended with RuntimeError: worker died four times") as caught:
        mg.study(mg.load("rcsr"), {"link1.mass": [1, 2, 3]}, "O1.effort", n=3, motions=RCSR, executor=Here(2))
    assert caught.value.study.failed.tolist() == [False, True, False]
    assert isinstance(caught.value.__cause__, RuntimeError)


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
    assert "no closed configuration" in study.messages[3]
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
    with pytest.raises(mg.DeclarationError, match="expected one of 'random', 'latin', 'grid'"):
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


# --- what a review found -----------------------------------------------------------------------------------------------------


def four_bar(ground: float = 2.5, up: float = 1.0, speed: float | None = None) -> mg.Mechanism:
    """A four-bar by markers; ``up`` is the side of the coupler on which it is assembled."""
    M, o, z = mg.Marker, (0, 0, 0), (0, 0, 1)
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, (0.5, 0, 0)),
        mg.Link("coupler"),
        mg.Link("rocker", 1.5, (1, 0, 0)),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", on_a=M(o, z), on_b=M(o, z)),
        mg.Pair("B", "S", "crank", "coupler", on_a=M((1, 0, 0), z), on_b=M(o, z)),
        mg.Pair("C", "C", "coupler", "rocker", on_a=M((2.24, 0, 0), z), on_b=M((2, 0, 0), z)),
        mg.Pair("D", "R", "frame", "rocker", on_a=M((ground, 0, 0), z), on_b=M(o, z)),
    ]
    drive = mg.Drive("A") if speed is None else mg.Drive("A", mg.Motion(np.linspace(0.5, 1, 4), speed))
    return mg.Mechanism("four-bar", links, pairs, [drive], [mg.Gravity((0, -9.81, 0))],
                        start={"A": 0.5, "B": (0, 0, 0.9 * up - 0.5), "D": 1.5 * up})  # fmt: skip


@pytest.mark.slow
def test_builders_may_choose_start_and_stored_motion() -> None:
    """Variants on another branch or with another stored motion are as they are by themselves; a bad one stops none."""
    kept, motions = ["D.position", "A.effort"], {"A": [0.5, 0.6]}
    study = mg.study(lambda up=1.0: four_bar(up=up), {"up": [-1.0, 1.0, 1.0]}, kept, motions=motions, sampling="grid")
    assert np.ptp(study.outputs["D.position"][:, 0]) > 1.0
    for i in range(3):
        assert_same(study, i, motions, kept)
    study = mg.study(lambda speed=2.0: four_bar(speed=speed), {"speed": [1.0, 2.0, 3.0]}, "A.effort", sampling="grid")
    alone = [mg.solve(study.variant(i))["A"].effort[-1, 0] for i in range(3)]
    assert study.outputs["A.effort"][:, -1] == pytest.approx(alone)
    assert len(set(np.round(alone, 6))) == 3
    study = mg.study(
        lambda ground=2.5: four_bar(ground), {"ground": [-20.0, 2.3, 2.5]}, "A.effort", motions=motions, sampling="grid"
    )
    assert study.failed.tolist() == [True, False, False]
    assert "no closed configuration" in study.messages[0]


def test_builders_may_close_over_what_they_vary() -> None:
    def build(pull: float = 1.0) -> mg.Mechanism:
        return pendulum().replace(loads=[mg.Effort("A", lambda pose, twist, t: np.full(np.shape(pose)[:-2], pull))])

    study = mg.study(build, {"pull": [1.0, 2.0]}, "A.effort", motions={"A": [0.0, 0.1]}, sampling="grid")
    assert study.outputs["A.effort"] == pytest.approx(np.array([[-1.0, -1.0], [-2.0, -2.0]]))


def test_a_ring_by_markers_that_is_no_chain_has_no_chain_numbers() -> None:
    assert "is no chain" in str(find_field(four_bar(), "length[0]"))


def test_numbers_of_a_chain_and_of_a_marker_together() -> None:
    """A marker that no chain number places may vary beside them; the one that a chain number places may not."""
    ways = {"length[2]": [0.4, 0.401], "O2.on_a.point.x": [0.499, 0.501]}
    study = mg.study(mg.load("rcsr"), ways, ["O1.effort"], motions=RCSR, sampling="grid")
    for i in range(4):
        assert_same(study, i, RCSR, ["O1.effort"])
    assert len(set(np.round(study.outputs["O1.effort"][:, 0], 9))) == 4
    with pytest.raises(mg.DeclarationError, match="set the same numbers"):
        mg.study(mg.load("rcsr"), {"length[0]": [0.5], "O2.on_a.point.x": [0.5]}, "O1.effort", motions=RCSR)


def test_rotation_vectors_are_continued_between_positions() -> None:
    for angles in ([4.0, 4.1], [0.1, 3.2, 6.0, 9.0]):
        motions = {"A": np.array(angles)}
        study = mg.study(sprung(), {"crank.mass": [1.0, 2.0]}, "B.position", motions=motions, sampling="grid")
        assert_same(study, 1, motions, ["B.position"])


def test_ends_steps_and_deviations_of_distributions() -> None:
    motions = {"A": 0.0}
    study = mg.study(pendulum(), {"bob.mass": scipy.stats.randint(1, 4)}, "A.effort", n=5, motions=motions)
    low, high = study.worst_case("A.effort")
    assert (float(low[0]), float(high[0])) == pytest.approx((5.0, 15.0))
    study = mg.study(
        pendulum(), {"bob.mass": [2.0], "bob.center.x": scipy.stats.norm(0.5, 1e-12)}, "A.effort", n=2, motions=motions
    )
    slopes = study.sensitivities("A.effort")
    assert (slopes["bob.mass"][0], slopes["bob.center.x"][0]) == pytest.approx((5.0, 20.0), rel=1e-6)
    study = mg.study(pendulum(), {"bob.mass": scipy.stats.uniform(1.9, 0.2)}, "A.effort", n=2, motions=motions)
    assert study.linear_std("A.effort")[0] == pytest.approx(5 * 0.2 / np.sqrt(12), rel=1e-6)


def test_what_a_declaration_refuses_is_refused_in_a_variant() -> None:
    study = mg.study(sprung(), {"loads[3].free_length": [-1.0, 1.0]}, "A.effort", motions={"A": 0.0}, sampling="grid")
    assert study.failed.tolist() == [True, False]
    assert "free_length" in study.messages[0]
    with pytest.raises(mg.DeclarationError, match="has no mass center"):
        mg.study(four_bar(), {"coupler.mass": [1.0]}, "A.effort", motions={"A": 0.5})


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"parameters": ["bob.mass"]}, "expected a mapping"), ({"m": "pendulum"}, "expected a Mechanism"), ({"seed": -1}, "seed = -1"),
        ({"sampling": ["grid"]}, "expected one of"), ({"executor": 4}, "expected an Executor"), ({"progress": 3}, "expected a function"),
        ({"parameters": {"bob.mass": scipy.stats.norm}}, "with its numbers"),
        ({"parameters": {"bob.mass": scipy.stats.norm(1, -1)}}, "no median"),
        ({"outputs": "frame.center"}, "is no quantity"), ({"outputs": {"status": "A.effort"}}, "is taken"),
        ({"outputs": {"bob.mass": "A.effort"}}, "is taken"), ({"n": 0}, "n = 0"), ({"m": lambda **k: 1 / 0}, "failed at the medians"),
    ],
)  # fmt: skip
def test_each_bad_argument_is_told(changes: dict[str, Any], told: str) -> None:
    arguments: dict[str, Any] = {
        "m": pendulum(),
        "parameters": {"bob.mass": [1.0]},
        "outputs": "A.effort",
        "n": 2,
        "motions": {"A": 0.0},
    }
    with pytest.raises(mg.DeclarationError, match=told):
        mg.study(**{**arguments, **changes})


def test_bad_questions_to_a_study_are_told() -> None:
    study = mg.study(pendulum(), {"bob.mass": [1.0]}, "A.effort", n=2, motions={"A": 0.0})
    ends = study.quantiles("A.effort", [0.0, 1.0])
    assert ends.ravel() == pytest.approx([5.0, 5.0])
    for ask in (
        lambda: study.variant(2),
        lambda: study.quantiles("A.effort", 5),
        lambda: study.mean("A.weight"),
        lambda: study.sensitivities("A.weight"),
    ):
        with pytest.raises(mg.DeclarationError):
            ask()
    assert list(study.to_pandas()["A.effort"]) == pytest.approx([5.0, 5.0])


def test_coefficients_of_a_coupling_vary() -> None:
    """Gears ``2 A + c B = 0``: the other wheel turns by ``-2 / c`` of the first."""
    wheel = {"axis": (0, 0, 1)}
    pairs = [
        mg.Pair("A", "R", "f", "a", point=(0, 0, 0), **wheel),
        mg.Pair("B", "R", "f", "b", point=(1, 0, 0), **wheel),
    ]
    m = mg.Mechanism("gears", pairs=pairs, couplings=[mg.Coupling({"A": 2.0, "B": -3.0}, name="g")], drives=["A"])
    s = mg.study(m, {"g.B": [-3.0, -2.0, -1.0]}, ["B.position"], n=3, motions={"A": [0.0, 1.0]})
    np.testing.assert_allclose(s.outputs["B.position"][:, 1].ravel(), -2.0 / s.parameters["g.B"], rtol=1e-12)


@pytest.mark.daily(4)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("number", ["g.E", "g.constant", "rack.X", "rod.mass"])
def test_couplings_of_variants_are_solved_together(number: str, engine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Positions, efforts and multipliers are those of every variant by itself, and none is solved by itself."""
    m = geared()
    (value,) = field_values(m, {number: find_field(m, number)}).values()  # type: ignore[dict-item]
    motions = {"A": mg.Motion(np.linspace(0.02, 0.8, 5), 2.0, 1.0)}
    outputs: dict[str, Any] = {"A": "A.effort", "B": "B.reaction", "X": "X.position"}
    outputs |= {name: lambda s, name=name: s.coupling(name).effort for name in ("g", "rack")}
    monkeypatch.setattr(work, "_solved_alone", None)
    study = mg.study(m, {number: value + np.array([0.0, 0.02, -0.03])}, outputs, n=3, motions=motions, engine=engine)
    assert not study.failed.any(), study.messages
    for i in range(3):
        s = mg.solve(study.variant(i), motions, engine=engine)
        expected = [
            s["A"].effort[:, 0],
            s["B"].reaction,
            s["X"].position[:, 0],
            s.coupling("g").effort,
            s.coupling("rack").effort,
        ]
        for name, value in zip(outputs, expected, strict=True):
            np.testing.assert_allclose(study.outputs[name][i], value, rtol=1e-9, atol=1e-9)


def test_shares_of_couplings_that_say_the_same_are_those_of_every_variant() -> None:
    """Of two couplings ``c A - B`` of which one is ``k`` times the other, the least norm is that of their own scales."""
    z = {"axis": (0, 0, 1)}

    def build(c: float = 2.0, k: float = 2.0) -> mg.Mechanism:
        pairs = [mg.Pair("A", "R", "f", "a", point=(0, 0, 0), **z), mg.Pair("B", "R", "f", "b", point=(1, 0, 0), **z)]
        couplings = [mg.Coupling({"A": c, "B": -1.0}, name="g1"), mg.Coupling({"A": k * c, "B": -k}, name="g2")]
        return mg.Mechanism("wheels", None, pairs, ["A"], [mg.Effort("B", 3.0)], couplings=couplings)

    shares = {name: lambda s, name=name: s.coupling(name).effort for name in ("g1", "g2")}
    ways = {"c": [1.5, 2.5], "k": [2.0, 5.0]}
    study = mg.study(build, ways, shares, sampling="grid", motions={"A": [0.0, 0.3]}, redundant="minimum_norm")  # type: ignore[arg-type]
    for i in range(4):
        s = mg.solve(study.variant(i), {"A": [0.0, 0.3]}, redundant="minimum_norm")
        for name in shares:
            np.testing.assert_allclose(study.outputs[name][i], s.coupling(name).effort, rtol=1e-10)
        np.testing.assert_allclose(
            s.coupling("g1").effort, study.parameters["k"][i] * s.coupling("g2").effort, rtol=1e-10
        )


@pytest.mark.daily(2)
@pytest.mark.filterwarnings(
    "ignore::mechgraph.MechgraphWarning"
)  # the center of mass does not move with the varied point
@pytest.mark.parametrize("number", ["coupler.mass", "B.point.x"])
@pytest.mark.parametrize("positions", [[2.0], [0.0339174, 2.0]])
def test_no_position_solved_of_a_mechanism_with_passive_freedoms(number: str, positions: list[float]) -> None:
    m = mg.load("rssr").replace(drives=["D"])  # its dead point lies at 0.033917
    s = mg.study(m, {number: [0.06, 0.061]}, ["D.effort", "A.position"], n=2, motions={"D": positions})
    assert s.status[:, -1].tolist() == ["out of reach"] * 2
    assert np.isnan(s.outputs["D.effort"][:, -1]).all()


def test_motions_of_a_prescribed_pose_go_to_other_processes() -> None:
    motions = driven(hexapod("U"), {"platform": mg.Motion(*poses(np.linspace(0, 1.5, 4)))})[1]
    assert pickle.loads(pickle.dumps(motions)).free == motions.free != ()
