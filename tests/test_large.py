"""Large mechanisms: the sparse path against the dense one, against closed forms, and what it says where nothing is unique."""

from __future__ import annotations

import dataclasses
import gc
import weakref
from functools import partial
from itertools import pairwise

import mechanisms as known
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lattices import BAR, LATTICES, ladder, parallelograms, scissors
from numpy.testing import assert_allclose
from strategies import body, motions, solvable

import mechgraph as mg
from mechgraph.graph import linkgraph
from mechgraph.graph.linkgraph import Tree, link_graph
from mechgraph.kinematics.assembly import assembled, scaled_start
from mechgraph.kinematics.solver import engine_for
from mechgraph.kinematics.sparse_system import LoopSystem
from mechgraph.kinematics.state import ClosureRows, Configuration
from mechgraph.kinematics.system import Numbers, System
from mechgraph.maths.linear import BlockTriangular, SparseFactors
from mechgraph.model.parameters import parameters

AGREE = 1e-9
LONG = [pytest.param(name, marks=pytest.mark.slow) if name == "tree" else name for name in LATTICES]
"""A tree of thousands of links takes its time."""
VALUES = ("position", "velocity", "acceleration", "reaction", "total", "effort", "applied_effort", "force", "moment")


def is_sparse(s: mg.Solution) -> bool:
    return s.engine == "sparse"


def solved(m: mg.Mechanism, motion: object, engine: str, **options: str) -> mg.Solution:
    """The mechanism solved by one engine."""
    return mg.solve(m, {m.drives[0].freedom: motion}, engine=engine, **options)


def assert_same(one: mg.Solution, other: mg.Solution) -> None:
    """All values of all pairs agree, NaN in the same places."""
    assert (one.status == other.status).all()
    largest = 1.0
    for what in VALUES:
        a, b = (np.concatenate([getattr(s[p.name], what).ravel() for p in s.mechanism.pairs]) for s in (one, other))
        size = np.nanmax(np.abs(a), initial=0.0)
        largest = max(largest, size) if what in ("reaction", "total", "force") else largest
        scale = largest if what in ("effort", "applied_effort", "moment") else max(1.0, size)
        assert_allclose(a, b, rtol=0, atol=AGREE * scale, err_msg=what)
    for p in one.mechanism.pairs:
        a, b = one[p.name].components, other[p.name].components
        assert {k: np.isnan(v).tolist() for k, v in a.items()} == {k: np.isnan(v).tolist() for k, v in b.items()}


def heavy(m: mg.Mechanism, seed: int) -> mg.Mechanism:
    """The same with masses, gravity, a spring and a force that turns with its link."""
    rng = np.random.default_rng(seed)
    links = [body(rng, link.name, rng.uniform(-1, 1, 3)) if link.name != m.frame else link for link in m.links]
    a, b = m.links[1].name, m.links[-1].name
    loads = [
        mg.Gravity((0.4, -9.81, 0.3)),
        mg.Spring(a, b, (0, 0, 0), (1, 2, 0.3), stiffness=3.0, free_length=0.4, damping=0.2),
        mg.Wrench(b, force=(1.0, 2.0, -0.5), point=(0.2, 0.1, 0), frame="link"),
    ]
    return m.replace(links=links, loads=loads)


FEW = {
    "windows": lambda: known.windows(5),
    "parallelograms side by side": lambda: known.windows(6, general=False),
    "three cranks": known.three_cranks,
    "rssr-sc": known.rssr_sc,
    "rccc": known.rccc,
    "rsur": known.rsur,
    "planar": known.planar,
    "spherical": known.spherical,
    "bennett": known.bennett,
    "sarrus": known.sarrus,
    "bricard": known.bricard_cube,
    "grid": lambda: parallelograms(14),
    "scissors": lambda: scissors(12),
}


@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
@given(name=st.sampled_from(list(FEW)), seed=st.integers(0, 999), many=st.booleans(), least=st.booleans())
def test_sparse_and_dense_agree(name: str, seed: int, many: bool, least: bool) -> None:
    m = heavy(FEW[name](), seed)
    positions = np.linspace(0.0, 0.2, 4) if many else 0.0
    motion = mg.Motion(positions, velocity=0.7, acceleration=-0.3)
    options = {"redundant": "minimum_norm" if least else "nan"}
    sparse, dense = (solved(m, motion, engine, **options) for engine in ("sparse", "dense"))
    assert is_sparse(sparse)
    assert not is_sparse(dense)
    assert_same(sparse, dense)
    assert np.max(sparse.checks.equilibrium) < 1e-11
    assert np.max(np.abs(sparse.checks.power)) < 1e-11


@pytest.mark.slow
@pytest.mark.daily(2)
@pytest.mark.parametrize("name", LONG)
def test_three_hundred_links(name: str) -> None:
    """Above the crossover by themselves, against the dense path."""
    m = LATTICES[name](300 if name in ("ladder", "scissors") else 130)
    motion = mg.Motion(0.02, velocity=1.0)
    sparse = mg.solve(m, {"J0": motion})
    assert is_sparse(sparse)
    assert_same(sparse, solved(m, motion, "dense"))


@pytest.mark.parametrize("method", ["newton_euler", "loop_wrench"])
def test_both_methods_agree_in_a_large_mechanism(method: str) -> None:
    m = LATTICES["spatial"](40)
    one = solved(m, 0.0, "sparse", method=method)
    assert is_sparse(one)
    assert_same(one, solved(m, 0.0, "dense"))


@pytest.mark.reference
def test_effort_of_a_ladder_of_parallelograms() -> None:
    """Virtual work: every crank turns like the first and every rod moves like a crank's head.

    ``tau = g cos(a) l (m (n + 1) / 2 + m n)`` with ``a`` the angle of the cranks and ``l`` their length.
    """
    m = ladder(400, equal=True)
    n = (len(m.links) - 2) // 2
    turns = np.linspace(0.0, 0.5, 3)
    s = mg.solve(m, {"J0": turns})
    length, angle = np.hypot(0.5, 1.0), np.arctan2(1.0, 0.5) + turns
    expected = 9.81 * BAR * length * np.cos(angle) * ((n + 1) / 2 + n)
    assert_allclose(s["J0"].effort[:, 0], expected, rtol=1e-10)


@pytest.mark.reference
def test_rates_of_a_chain_of_scissors() -> None:
    """All crossings turn alike, and the end moves n times as far along the chain as one of them opens it."""
    m = scissors(200)
    s = mg.kinematics(m, {"J0": mg.Motion(0.0, velocity=1.0)})
    n = len(m.links) // 2
    for i in (1, n // 2, n - 1):
        assert_allclose(np.abs(s[f"J{3 * i}"].velocity), 1.0, rtol=1e-9)


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", LATTICES)
def test_verdicts_are_those_of_the_dense_check(name: str) -> None:
    """NaN in a solution exactly where the report says that a component is not unique."""
    m = LATTICES[name](14)
    s = solved(m, 0.0, "sparse")
    assert is_sparse(s)
    unique = mg.check(m).unique
    for p in m.pairs:
        found = {k: not np.isnan(v) for k, v in s[p.name].components.items()}
        assert found == {k: v for k, v in unique[p.name].items() if k != "effort"}


def test_independent_cases_and_flagged_positions() -> None:
    m = ladder(60)
    motion = mg.Motion(np.array([[0.0, 0.1, 0.2], [0.0, -0.1, -0.2]]), velocity=1.0)
    assert_same(solved(m, motion, "sparse"), solved(m, motion, "dense"))


def crank_rocker_ladder() -> mg.Mechanism:
    """A ladder whose first crank cannot turn fully."""
    return known.windows(60).replace(drives=["A0"])


@pytest.mark.slow
def test_the_end_of_the_reach_is_found() -> None:
    m = crank_rocker_ladder()
    with pytest.raises((mg.ReachError, mg.DeadPointError)) as caught:
        mg.solve(m, {"A0": np.linspace(0.0, 2 * np.pi, 60)})
    flagged = mg.solve(m, {"A0": np.linspace(0.0, 2 * np.pi, 60)}, on_reach="flag")
    assert is_sparse(flagged)
    dense = solved(m, np.linspace(0.0, 2 * np.pi, 60), "dense", on_reach="flag")
    first = [int(np.flatnonzero(s.status != "ok")[0]) for s in (flagged, dense)]
    assert first[0] == first[1]
    assert 0 < first[0] < 60
    assert caught.value.value["A0.Rz"] == pytest.approx(np.linspace(0.0, 2 * np.pi, 60)[first[0]], abs=0.11)


@pytest.mark.daily(2)
@pytest.mark.parametrize(("engine", "cells"), [("dense", 20), ("sparse", 60)])
def test_parallelograms_pass_their_change_point_as_parallelograms(engine: str, cells: int) -> None:
    """Folded flat, every cell could go on as an antiparallelogram; the branch of continuous velocity is the one that stays parallel."""
    m = ladder(cells, equal=True)
    turns = np.linspace(0.0, 3.0, 8)
    s = mg.solve(m, {"J0": turns}, on_reach="flag", engine=engine)
    assert (s.status == "ok").all()
    cranks = [p.name for p in m.pairs if p.a == m.frame]
    for name in cranks:
        assert_allclose(s[name].position[:, 0], turns, atol=1e-9)


def test_small_mechanisms_are_dense_and_what_is_left_free_is_an_error_on_both_engines() -> None:
    assert not is_sparse(mg.solve(mg.load("7r"), {"O1": 0.1}))
    free = known.grid(5).replace(drives=["N0_0v0_0"])
    for engine in ("dense", "sparse"):
        with pytest.raises(mg.IndeterminateError):
            mg.solve(free, {"N0_0v0_0": 0.0}, engine=engine)


@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
def test_passive_freedoms_are_the_same_on_both_engines() -> None:
    m = heavy(mg.load("rssr").replace(loads=()), 3)
    turns = np.linspace(0.0, 2.0, 9)
    sparse, dense = (mg.solve(m, {"A": mg.Motion(turns, velocity=1.0)}, engine=e) for e in ("sparse", "dense"))
    assert is_sparse(sparse)
    assert_same(sparse, dense)
    for name, effort in dense.passive_effort.items():
        assert_allclose(np.abs(sparse.passive_effort[name]), np.abs(effort), atol=1e-9)


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", FEW)
def test_a_bordered_system_proves_the_rank(name: str) -> None:
    system, x = assembled(FEW[name]())
    here = Configuration(system, x[:, None])
    driven = np.array([0])
    loops = LoopSystem.at(here, driven)
    J = np.delete(here.J[:, :, 0], driven, axis=1)
    assert loops.regular
    assert loops.rank == np.linalg.matrix_rank(J, 1e-9)
    assert loops.redundant == J.shape[0] - loops.rank
    assert loops.held == J.shape[1] - loops.rank
    rows = ClosureRows.of(here, np.arange(1))
    stress = loops.random_stress(SparseFactors([loops.first]), rows, np.random.default_rng(1), 3)[:, :, 0]
    assert np.abs(J.T @ stress).max(initial=0.0) < 1e-11 * np.abs(stress).max(initial=1.0)


def test_dependent_rows_and_columns_are_no_proof() -> None:
    """Concurrent cranks move instantaneously though their count forbids it: the pivots say that nothing is proved."""
    system, x = assembled(known.concurrent_cranks())
    loops = LoopSystem.at(Configuration(system, x[:, None]), np.zeros(0, dtype=np.intp))
    assert not loops.regular


@pytest.mark.parametrize("name", ["rcsr", "7r", "pphchp", "r-sg-c", "ladder", "scissors"])
def test_the_poses_of_a_start_are_taken_over_when_it_is_scaled(name: str) -> None:
    """They are those of the scaled system, at the first call and where the start is known."""
    m = {"ladder": partial(ladder, 40), "scissors": partial(scissors, 6000)}.get(name, partial(mg.load, name))()
    for here in (scaled_start(m), scaled_start(m.replace(loads=[]))):
        fresh = Configuration(here.system, here.x)
        points = here.pair_points - here.pair_points.mean(axis=1, keepdims=True)
        assert_allclose(here.poses, fresh.poses, atol=1e-11)
        assert_allclose(here.S, fresh.S, atol=1e-11)
        assert_allclose(here.pair_points.mean(axis=1), 0, atol=1e-12)
        assert 0.5 < np.sqrt((points**2).sum(axis=0).mean()) < 2


@pytest.mark.parametrize("name", ["rcsr", "7r", "pphchp", "r-sg-c", "geneva"])
def test_poses_are_the_same_whether_coefficients_are_kept_or_not(name: str) -> None:
    """The declared state of many pairs is evaluated a few factors at a time, with nothing kept."""
    system, again = (System(mg.load(name)) for _ in range(2))
    x = system.state_of(np.random.default_rng(0).uniform(-0.3, 0.3, (system.n_freedoms, 1)))
    parts = (system.par, system.walk, system.batches, system.n_factors, system.n_freedoms)
    vars(again)["numbers"] = Numbers(*parts, for_one=True)
    assert_allclose(Configuration(again, x).poses, Configuration(system, x).poses, rtol=1e-13, atol=1e-13)
    assert "poses" not in vars(again.numbers)


def test_factors_of_one_pattern_are_renewed() -> None:
    """The second factorization takes the column order of the first; solutions are the same."""
    system, x = assembled(ladder(40))
    here = Configuration(system, x[:, None])
    loops = LoopSystem.at(here, np.array([0]))
    again, first = SparseFactors([loops.factor(loops.rows)]), SparseFactors([loops.first])
    b = np.random.default_rng(2).normal(size=(6 * system.graph.n_loops, 2, 1))
    assert_allclose(loops.solve(again, b), loops.solve(first, b), atol=1e-11)
    tau = np.random.default_rng(3).normal(size=(system.n_freedoms, 2, 1))
    assert_allclose(loops.solve_transposed(again, tau), loops.solve_transposed(first, tau), atol=1e-10)


def test_deep_trees_by_pointer_doubling(monkeypatch: pytest.MonkeyPatch) -> None:
    m = scissors(60)
    system, _ = assembled(m)
    rng = np.random.default_rng(4)
    n, P = len(m.links), len(m.pairs)
    x = system.state_of(rng.uniform(-1, 1, (system.n_freedoms, 2)))
    terms, loads = rng.normal(size=(6, P, 2)), rng.normal(size=(6, n, 2))
    shallow, poses = Tree(link_graph(m)), Configuration(system, x).poses
    monkeypatch.setattr(linkgraph, "DEEP", 0)
    deep = Tree(link_graph(m))
    assert deep.deep
    assert not shallow.deep
    assert_allclose(Configuration(system, x).poses, poses, atol=1e-11)
    assert_allclose(deep.sums(terms), shallow.sums(terms), atol=1e-11)
    assert_allclose(deep.carried(loads), shallow.carried(loads), atol=1e-11)


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", LONG)
def test_five_thousand_links(name: str) -> None:
    m = LATTICES[name](5000)
    s = mg.solve(m, {"J0": mg.Motion(0.0, velocity=1.0)})
    assert is_sparse(s)
    assert s.checks.closure < 1e-10
    assert s.checks.equilibrium < 1e-10
    assert abs(s.checks.power) < 1e-8
    planar = name != "spatial"
    assert np.isnan(s["J7"].components["Fz"]) == planar
    assert np.isfinite([s["J7"].components[k] for k in ("Fx", "Fy")]).all()
    report = mg.check(m)
    assert report.mobility == 1
    assert report.redundancy == (3 * report.graph.n_loops if planar else 0)


def test_a_thousand_links_along_a_path() -> None:
    m = ladder(1000)
    s = mg.solve(m, {"J0": mg.Motion(np.linspace(0.0, 0.3, 12), velocity=1.0)})
    assert is_sparse(s)
    assert (s.status == "ok").all()
    assert s["J5"].reaction.shape == (12, 6)
    assert np.max(s.checks.equilibrium) < 1e-11


def test_a_new_load_leaves_links_and_pairs_as_they_are() -> None:
    m = ladder(20)
    other = m.replace(loads=[mg.Gravity((0, 0, -1))], drives=["J1"])
    assert other.links is m.links
    assert other.pairs is m.pairs
    assert other.drives == (mg.Drive("J1"),)
    with pytest.raises(mg.DeclarationError, match="nothing"):
        m.replace(drives=["nothing"])
    heavier = m.replace(links=[dataclasses.replace(k, mass=0.0, inertia=None) for k in m.links])
    assert heavier != m


@pytest.mark.parametrize(
    ("m", "positions"),
    [(mg.load("rcsr"), 46), (mg.load("four-bar"), 3000), (ladder(200), 2)],
    ids=["one piece", "blocks", "sparse"],
)
def test_memory_is_given_back_at_once(m: mg.Mechanism, positions: int) -> None:
    """No cycle of references keeps a solution that is let go, or the mechanism."""
    m = m.replace(name="to be forgotten")
    name = m.drives[0].freedom
    begin = 2.7 if m.start else 0.0
    gc.collect()
    gc.disable()
    try:
        s = mg.solve(m, {name: np.linspace(begin, begin + 0.3, positions)})
        assert np.isfinite(s[m.pairs[1].name].reaction).any()
        here, gone = weakref.ref(s._values), weakref.ref(m)
        del s
        assert here() is None
        del m
        assert gone() is None
    finally:
        gc.enable()


def test_graph_and_numbers_are_kept_with_the_mechanism() -> None:
    """Copies with other drives and loads share them; one with other links has its own."""
    m = ladder(20)
    graph, numbers = m.once(link_graph), m.once(parameters)
    assert m.replace(drives=["J1"], loads=[]).once(link_graph) is graph
    assert m.replace(drives=["J1"], loads=[]).once(parameters) is numbers
    heavier = m.replace(links=[dataclasses.replace(k, mass=2 * k.mass) for k in m.links])
    assert heavier.once(parameters) is not numbers
    assert_allclose(heavier.once(parameters).mass, 2 * numbers.mass)


PATHS = {
    "on this side again": [0.0, 0.05, 3.0, 0.1, 0.2],
    "first beyond": [3.0, 0.1, 0.05],
    "all beyond": [3.0, 3.1],
    "one beyond": 3.0,
    "twice": [0.1, 4.0, 0.2, 4.1, 0.3],
    "there and back": np.concatenate([np.linspace(0.0, 3.0, 7), np.linspace(3.0, -0.3, 9)]),
}


@pytest.mark.daily(1)
@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize("name", ["ladder", "spatial"])
def test_what_cannot_be_reached_is_told_as_in_a_small_mechanism(name: str, path: object) -> None:
    m = LATTICES[name](24)
    sparse, dense = (solved(m, path, engine, on_reach="flag") for engine in ("sparse", "dense"))
    assert is_sparse(sparse)
    np.testing.assert_array_equal(sparse.status, dense.status)
    for key in ("Fx", "Fy"):
        value, wanted = sparse["J3"].components[key], dense["J3"].components[key]
        assert_allclose(value, wanted, rtol=1e-6, atol=1e-9 * np.abs(np.nan_to_num(wanted)).max())


def test_drivers_that_contradict_each_other() -> None:
    m = ladder(60).replace(drives=["J0", "J1"])
    with pytest.raises(mg.IndeterminateError, match="conflict"):
        mg.solve(m, {"J0": 0.1, "J1": 0.3}, engine="sparse")
    assert mg.solve(m, {"J0": 0.0, "J1": 0.0}, engine="sparse").status == "ok"


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_start_between_two_folds(engine):
    """1.6e-5 before one fold and 3.7e-4 behind another: the way back that ends at the other one tells nothing of a dead point."""
    m = solvable(78)
    s = mg.solve(m, motions(m, 78, np.linspace(0, 1, 3)), engine=engine, on_reach="flag")
    assert s.status.tolist() == ["ok", "out of reach", "out of reach"]


SIZES = (3, 1, 4, 3, 2)


T = 7


def block_systems(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and values ``(T, entries)`` of systems that are block triangular once permuted, and the matrices."""
    rng = np.random.default_rng(seed)
    ends = np.cumsum((0, *SIZES))
    mask = np.zeros((ends[-1], ends[-1]), dtype=bool)
    for k, (a, b) in enumerate(pairwise(ends)):
        mask[a:b, a:b] = True
        mask[a:b, :a] = rng.random((b - a, a)) < (0.3 if k != 2 else 0.0)
    p, q = rng.permutation(ends[-1]), rng.permutation(ends[-1])
    rows, cols = np.nonzero(mask[p][:, q])
    A = np.where(mask[p][:, q], rng.normal(size=(T, *mask.shape)) + 4.0 * np.eye(ends[-1])[p][:, q], 0.0)
    return rows, cols, A[:, rows, cols], A


@pytest.mark.parametrize("seed", range(5))
def test_block_triangular_systems(seed: int) -> None:
    rows, cols, values, A = block_systems(seed)
    form = BlockTriangular(rows, cols, sum(SIZES))
    assert form.sizes == {1: 1, 2: 1, 3: 2, 4: 1}
    factor = form.factor(values)
    b = np.random.default_rng(seed).normal(size=(sum(SIZES), 2, T))
    for transposed in (False, True):
        x = factor.solve(b, transposed)
        for t in range(T):
            expected = np.linalg.solve(A[t].T if transposed else A[t], b[:, :, t])
            assert_allclose(x[:, :, t], expected, atol=1e-12 * np.abs(expected).max())
    some = np.array([5, 2])
    assert_allclose(factor.part(some).solve(b[:, :, some]), factor.solve(b)[:, :, some], atol=1e-14)


def test_a_singular_block_spoils_its_own_system_only() -> None:
    rows, cols, values, A = block_systems(1)
    form = BlockTriangular(rows, cols, sum(SIZES))
    alone = form._diagonal[0][2]
    values[3, alone] = 0.0
    factor = form.factor(values)
    assert np.flatnonzero(factor.smallest_pivot == 0).tolist() == [3]
    b = np.ones((sum(SIZES), 1, T))
    assert np.isnan(factor.solve(b)[..., 3]).any()
    assert_allclose(A[2] @ factor.solve(b)[:, 0, 2], b[:, 0, 2], atol=1e-12)


def test_no_matching_no_blocks() -> None:
    form = BlockTriangular(np.array([0, 1, 2, 2]), np.array([0, 0, 1, 2]), 3)
    assert form.blocks == 0
    assert not form.pays(1000)


def test_engines_by_size_and_positions() -> None:
    assert [engine_for(60, positions, "auto") for positions in (1, 8, 36, 1000)] == [
        "dense",
        "dense",
        "sparse",
        "sparse",
    ]
    assert engine_for(30, 10**6, "auto") == "dense"
