"""The dense and the sparse engine, and the elimination along the loops, give the same report; reports hold the same at any size."""

from __future__ import annotations

import re
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mechanisms as known
import numpy as np
import pytest
import scipy
import scipy.stats
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lattices import LATTICES
from planar import of_chain
from strategies import closed_mechanism, with_drives

import mechgraph as mg
from mechgraph.determinacy import findings, snapping
from mechgraph.determinacy.decomposition import LinkRows, _by_pattern, _by_rank
from mechgraph.determinacy.facts import counted_ledger
from mechgraph.determinacy.families import kind_of
from mechgraph.determinacy.findings import plausible
from mechgraph.determinacy.mobility import free_motion, random_rows
from mechgraph.determinacy.uniqueness import canonical, uniqueness
from mechgraph.graph.linkgraph import link_graph
from mechgraph.kinematics.assembly import assembled
from mechgraph.kinematics.solver import ClosureRank, closure_rank, rank_of_rows
from mechgraph.kinematics.sparse_system import Elimination
from mechgraph.kinematics.state import ClosureRows, Configuration, ReducedRows
from mechgraph.maths.tolerances import RANKS

ENGINES = ("dense", "sparse")


def braced(n: int) -> mg.Mechanism:
    """Parallelograms side by side, whose ties in the plane run over several loops, with spheres that spin here and there."""
    m = known.windows(n, general=False)
    for i in range(0, n, 7):
        for name in (f"B{i}", f"C{i}"):
            m = m.with_pair_type(name, "S")
    cross = [
        mg.Pair(f"D{k}", "R", f"rod{3 * i}" if k % 2 == 0 else f"brace{i}", f"brace{i}" if k % 2 == 0 else f"rod{3 * i + 1}",
                point=(3 * i + 0.8 + (k % 2), 1.0, 0.0), axis=(0, 0, 1))
        for i in range(1, n // 3 - 1)
        for k in (2 * i, 2 * i + 1)
    ]  # fmt: skip
    return m.replace(pairs=[*m.pairs, *cross], links=[*m.links, *(mg.Link(f"brace{i}") for i in range(1, n // 3 - 1))])


CASES: dict[str, Callable[[], mg.Mechanism]] = {
    "windows": lambda: known.windows(40),
    "parallelograms": lambda: known.windows(40, general=False),
    "grid": lambda: known.grid(6),
    "braced": lambda: braced(24),
    "hexapod": lambda: known.hexapod("SPS", driven=False),
    "pphchp": lambda: known.pphchp(known.Z, known.Z, known.Z),
}


def here_and_driven(m: mg.Mechanism) -> tuple[Any, np.ndarray]:
    system, x = assembled(m)
    return Configuration(system, x[:, None]), np.array([0]) if m.drives else np.zeros(0, dtype=np.intp)


def engines(m: mg.Mechanism) -> list[ClosureRank]:
    """Both engines, and the elimination where the bordered system would decide."""
    here, _ = here_and_driven(m)
    rows = ClosureRows.at(here)
    swept = rank_of_rows(rows, None, "sparse", proved=np.inf)
    return [closure_rank(here, engine="dense"), closure_rank(here, engine="sparse"), swept]


@pytest.mark.parametrize("name", CASES)
def test_engines_agree(name: str) -> None:
    dense, *others = engines(CASES[name]())
    assert dense.engine == "dense"
    for found in others:
        assert found.engine == "sparse"
        assert (found.rank, found.shared, found.sets) == (dense.rank, dense.shared, dense.sets)
        assert found.margin == pytest.approx(dense.margin, rel=1e-6)
        assert np.abs(found.motions @ (found.motions.T @ dense.motions) - dense.motions).max(initial=0.0) < 1e-9
        one, two = (np.linalg.qr(f.connecting(np.eye(f.shared)))[0] for f in (found, dense))
        assert np.abs(one @ (one.T @ two) - two).max(initial=0.0) < 1e-8


@pytest.mark.parametrize("name", CASES)
def test_self_stresses_balance_every_freedom(name: str) -> None:
    """They are as many as rows minus rank, and independent."""
    m = CASES[name]()
    J = here_and_driven(m)[0].J[:, :, 0]
    for found in engines(m):
        columns = [found.connecting(np.eye(found.shared))]
        for i, Y, s in zip(*found.local[:1], np.moveaxis(found.local[1], 2, 0), found.local[2], strict=True):
            full = np.zeros((J.shape[0], s))
            full[6 * i : 6 * i + 6] = Y[:, :s]
            columns.append(full)
        everything = np.hstack(columns)
        assert everything.shape[1] == J.shape[0] - found.rank == sum(n for n, _ in found.sets)
        assert np.linalg.matrix_rank(everything) == everything.shape[1]
        assert np.abs(J.T @ everything).max(initial=0.0) < 1e-9 * np.abs(everything).max(initial=1.0)
        probes = found.random_stress(np.random.default_rng(0), 2)
        assert np.abs(J.T @ probes).max(initial=0.0) < 1e-9 * np.abs(probes).max(initial=1.0)


@pytest.mark.parametrize("name", CASES)
def test_free_motions_agree(name: str) -> None:
    m = CASES[name]()
    system, x = assembled(m)
    driven = here_and_driven(m)[1]
    dense, sparse = (free_motion(system, x, driven, engine) for engine in ENGINES)
    assert [p.links for p in sparse.passive] == [p.links for p in dense.passive]
    assert len(sparse.undriven) == len(dense.undriven)
    assert sparse.drive == pytest.approx(dense.drive, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_elimination_of_random_rows(name: str) -> None:
    """More rows than columns, dependent ones among them: ranks, self-stresses and motions against one decomposition."""
    m = CASES[name]()
    reduced = ReducedRows(random_rows(m, link_graph(m)), np.arange(3))
    K = reduced.matrix.toarray()
    found = Elimination(reduced.matrix, reduced.owners, RANKS.generic)
    assert found.rank == np.linalg.matrix_rank(K, RANKS.generic)
    y, q = found.stresses(np.eye(len(found.zero_rows))), found.motions()
    assert y.shape[1] == K.shape[0] - found.rank
    assert q.shape[1] == K.shape[1] - found.rank
    assert np.abs(K.T @ y).max(initial=0.0) < 1e-8
    assert np.abs(K @ q).max(initial=0.0) < 1e-8 * np.abs(q).max(initial=1.0)


@pytest.mark.parametrize("name", ["windows", "grid", "pphchp"])
def test_rows_behind_those_of_the_loops(name: str) -> None:
    """Relations between freedoms, one of them twice: rank, motions and self-stresses with them, by both engines."""
    here, _ = here_and_driven(CASES[name]())
    rows = ClosureRows.at(here)
    J = here.J[:, :, 0]
    more = np.zeros((3, J.shape[1]))
    more[0, [0, 2]] = 2.0, -3.0
    more[1, [1, -1]] = 1.0, 0.5
    more[2] = -2.0 * more[0]
    whole = np.vstack([J, more])
    rank = np.linalg.matrix_rank(whole, 1e-9)
    for engine in ENGINES:
        found = rank_of_rows(replace(rows, more=scipy.sparse.csr_array(more)), None, engine)  # type: ignore[arg-type]
        assert (found.rank, found.count) == (rank, len(whole))
        assert np.abs(whole @ found.motions).max(initial=0.0) < 1e-9
        assert found.motions.shape[1] == whole.shape[1] - rank
        stress = found.random_stress(np.random.default_rng(0), 4)
        assert np.abs(whole.T @ stress).max() < 1e-9 * np.abs(stress).max()
        assert np.abs(stress[-1]).max() > 0
        assert sum(n for n, _ in found.sets) == len(whole) - rank


# --- the whole report -----------------------------------------------------------------------------------------------------


def difference(a: Any, b: Any, where: str = "") -> list[str]:
    """Where two reports differ: words, names and counts exactly, numbers to six digits; numbers below 1e-9 are rounding."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = [f"{where}: keys {sorted(set(a) ^ set(b))}"] if set(a) != set(b) else []
        return keys + [d for k in a.keys() & b.keys() if k != "engine" for d in difference(a[k], b[k], f"{where}.{k}")]
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        size = [f"{where}: {len(a)} and {len(b)} items"] if len(a) != len(b) else []
        return size + [d for i, (x, y) in enumerate(zip(a, b, strict=False)) for d in difference(x, y, f"{where}[{i}]")]
    if isinstance(a, float) and isinstance(b, float):
        return [] if abs(a - b) <= 1e-9 + 1e-6 * abs(a) else [f"{where}: {a} and {b}"]
    return [] if a == b else [f"{where}: {a} and {b}"]


def assert_same_report(m: mg.Mechanism) -> None:
    dense, sparse = (mg.check(m, engine=engine) for engine in ENGINES)
    assert (dense.engine, sparse.engine) == ENGINES
    assert not difference(dense.to_dict(), sparse.to_dict())
    assert str(dense) == str(sparse).replace("the sparse engine", "the dense engine")


LOOPS = mg.library()
KNOWN = ("goldberg", "myard", "bricard_cube", "sarrus", "spherical", "three_cranks", "concurrent_cranks", "rsur", "rssr_sc",
         "rccc", "door", "prprrh_special", "hexapod", "three_upu", "folded_bars", "two_four_bars")  # fmt: skip


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", LOOPS)
def test_library_reports_do_not_depend_on_the_engine(name: str) -> None:
    assert_same_report(mg.load(name))


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", [n for n in KNOWN if hasattr(known, n)])
def test_known_reports_do_not_depend_on_the_engine(name: str) -> None:
    assert_same_report(getattr(known, name)())


@pytest.mark.daily(2)
@pytest.mark.parametrize("kind", LATTICES)
@pytest.mark.parametrize("links", [6, 12, 20])
def test_lattice_reports_do_not_depend_on_the_engine(kind: str, links: int) -> None:
    assert_same_report(LATTICES[kind](links))


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10**6))
@example(64911)  # near a dead point
def test_random_reports_do_not_depend_on_the_engine(seed: int) -> None:
    m = closed_mechanism(seed)
    assert_same_report(with_drives(m, seed) or m)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 3))
def test_topologies_do_not_depend_on_the_engine(seed: int, loops: int) -> None:
    m = closed_mechanism(seed, loops=loops)
    bare = [mg.Pair(p.name, p.type, p.a, p.b, pitch=p.pitch) for p in m.pairs]
    dense, sparse = (mg.check(mg.Mechanism("graph", m.links, bare), engine=engine) for engine in ENGINES)
    assert dense.to_dict() == sparse.to_dict()
    assert str(dense) == str(sparse)


@pytest.mark.parametrize("name", mg.library())
@pytest.mark.parametrize("bookkeeping", ["lee", "minimal"])
def test_counted_ledger_agrees_with_the_registry(name: str, bookkeeping: str) -> None:
    m = mg.load(name)
    counted, read = counted_ledger(m, bookkeeping), mg.formulate(m, bookkeeping).ledger()
    assert dict(counted.by_kind) == dict(read.by_kind)


@pytest.mark.daily(2)
@pytest.mark.parametrize("n", [15, 16, 17, 60])
def test_a_report_holds_the_same_at_any_size(n: int) -> None:
    """15, 16 and 17 loops once had other keys, other counts and other words."""
    report = mg.check(known.windows(n))
    text = " ".join(report.text(full=True).split())
    assert (report.mobility, report.finite_mobility, report.redundancy) == (1, 1, 3 * n)
    assert report.excess == {"structural": 3 * n - 1, "dimensions": 1, "here": 0}
    assert [len(e.changes) for e in report.effects] == (
        [n, n, n + 1, n + 1, 1, 1, 1, 1, 1] if n < 60 else [60, 1, 1, 1, 1, 1, 1]
    )
    assert report.effects[0].redundancy == (3 * n, 0)
    assert (
        report.sets_not_sought
        == ("Smaller sets of changes were not sought: redundancy above 120." in text)
        == (n == 60)
    )
    assert report.reactions is not None
    assert report.reactions.groups == 1
    assert len(report.self_stresses) == 3 * n
    assert "Motion verified" in text
    assert "form one self-stress group" in text
    assert "not sought as" not in text


def skeleton(report: Any) -> list[str]:
    """Headings, first words and sentences of a report, every number and every list of names taken out."""
    blocks = report.document(full=True).blocks
    names = re.compile("|".join(sorted(map(re.escape, [*report.pairs, *report.links]), key=len, reverse=True)))
    out = []
    for block in blocks:
        lines = getattr(block, "items", ()) or (getattr(block, "text", ""),)
        for line in lines:
            plain = re.sub(r"-?[0-9]+([.][0-9]+)?(e-?[0-9]+)?", "#", names.sub("@", str(line)))
            plain = re.sub(r"(\w+ at @ -> \w+(, )?)+", "CHANGES", plain).replace("sparse engine", "dense engine")
            plain = re.sub(r"@[-.:@# ,+]*(and @)?", "@", plain)
            out.append("group" if plain.startswith("group #: ") else plain)
    return list(dict.fromkeys(out))


@pytest.mark.daily(1)
@pytest.mark.parametrize("kind", ["ladder", "four-bars"])
def test_words_keys_and_advice_do_not_change_with_size(kind: str) -> None:
    """The same ladder of 15, 16, 17 and 26 loops: the engine changes between 23 and 24."""
    first, *others = [mg.check(LATTICES[kind](2 * n)) for n in (15, 16, 17, 26)]
    assert (first.engine, others[-1].engine) == ("dense", "sparse")
    for report in others:
        assert set(report.to_dict()) == set(first.to_dict())
        assert set(report.excess) == set(first.excess)
        assert {k: v for k, v in report.excess.items() if k != "structural"} == {"dimensions": 1, "here": 0}
        assert [len(e.changes) == 1 for e in report.effects] == [len(e.changes) == 1 for e in first.effects]
        singles = [e.changes for e in report.effects if len(e.changes) == 1]
        assert singles == [e.changes for e in first.effects if len(e.changes) == 1]
        assert skeleton(report) == skeleton(first)


def test_a_long_report_lists_the_first_and_says_what_was_left_out() -> None:
    report = mg.check(known.windows(60))
    text = " ".join(report.text(full=True).split())
    assert "and 160 more" in text
    assert len(report.text(full=True).splitlines()) < 300
    assert max(map(len, str(report).splitlines())) <= 80
    assert len(report.to_dict()["unique"]) == len(report.pairs)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", CASES)
def test_all_self_stresses_are_listed(name: str, engine: Any) -> None:
    """With the drivers in place: as many as there are, independent, and all parts of random ones."""
    here, driven = here_and_driven(CASES[name]())
    found = uniqueness(here, driven, engine)
    assert found.listed == found.count
    listed = found.basis.states.toarray()
    assert np.linalg.matrix_rank(listed) == found.count
    Q, _ = np.linalg.qr(listed)
    assert np.abs(found.table - Q @ (Q.T @ found.table)).max(initial=0.0) < 1e-6
    assert [s.text for s in found.first_states(5)] == [s.text for s in found.states[:5]]


def test_an_unknown_engine_is_refused() -> None:
    with pytest.raises(mg.DeclarationError, match="expected one of 'auto', 'compiled', 'dense', 'sparse'"):
        mg.check(mg.load("four-bar"), engine="fast")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["planar", "spherical", ""])
def test_the_kind_of_many_pairs_takes_no_more_memory_than_their_twists(kind: str) -> None:
    """A square matrix over the pairs (800 MB here) is never made."""
    rng = np.random.default_rng(0)
    n, (a, b) = 10_000, np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    w, p = rng.normal(size=(2, 3, n))
    if kind == "planar":
        w = np.outer(np.cross(a, b), rng.choice([-1.0, 1.0], n))
    elif kind == "spherical":
        p = np.repeat(rng.normal(size=(3, 1)), n, axis=1)
    twists = np.concatenate([w, np.cross(p, w, axis=0)])
    tracemalloc.start()
    try:
        found = kind_of(twists)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 40 * twists.nbytes
    assert found.name == kind
    if kind == "planar":
        np.testing.assert_allclose(np.abs(found.place @ np.cross(a, b)), 1.0, atol=1e-12)
    elif kind == "spherical":
        np.testing.assert_allclose(found.place, p[:, 0], atol=1e-12)


@pytest.mark.slow
def test_near_relations_by_chance_do_not_hold_up_the_report_of_a_long_ring(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 200 axes that stand anyhow hundreds of pairs come near something special; taking them so is minutes of work for no hint."""
    rng, tried = np.random.default_rng(0), []
    ring = known.ring("R" * 200, rng.normal(size=(200, 3)), rng.normal(size=(200, 3)))
    monkeypatch.setattr(findings, "snapped", lambda m, tol, *more: tried.append(tol) or snapping.snapped(m, tol, *more))
    report = mg.check(ring)
    assert report.rounding is None
    assert "mobility 194" in str(report)
    near = snapping.candidates(ring, findings.LARGEST_TOL)
    assert len(near) > 2 * max(int((near <= tol).sum()) for tol in tried)


def turns_and_slides(n: int) -> mg.Mechanism:
    """Turns about z and slides across it in turn, in one loop: mobility n - 3 and redundancy 3."""
    turn, odd = 2 * np.pi * np.arange(n) / n, np.arange(n) % 2
    points = n * np.array([np.cos(turn), np.sin(turn), 0 * turn]).T
    axes = np.array([odd * np.cos(np.arange(n)), odd * np.sin(np.arange(n)), 1 - odd]).T
    return known.ring("RP" * (n // 2), points, axes)


def test_what_a_report_leaves_out_of_a_large_ring_is_said() -> None:
    """Above 300 pairs rounding was not looked for without a word."""
    report = mg.check(turns_and_slides(302), limit=1e-6)
    assert (report.mobility, report.redundancy) == (299, 3)
    text = " ".join(str(report).split())
    assert "special geometry is not known: of 302 pairs it is not looked for (of up to 300 it is); pass tol=" in text
    assert "What changes of pairs would help was looked for during 1e-06 s and not to the end; pass limit=" in text
    assert report.to_dict()["not_sought"] == list(report.not_sought)
    with pytest.raises(
        mg.MechgraphError, match=r"exact to tol=0.0001 was not found in 1e-06 s; pass limit= to look longer"
    ):
        mg.check(turns_and_slides(302), tol=1e-4, limit=1e-6)


def test_a_start_with_many_motions_is_refused_without_large_arrays() -> None:
    """The search for branches took 128 positions a motion at once, 15 GiB for a ring of 1,000 links."""
    tracemalloc.start()
    try:
        with pytest.raises(mg.IndeterminateError, match="298 freedoms are neither driven nor passive"):
            mg.solve(turns_and_slides(302), {"O1": [0.0, 0.1]})
        assert tracemalloc.get_traced_memory()[1] < 1e8
    finally:
        tracemalloc.stop()


def test_of_two_echelon_forms_of_as_many_terms_the_first_rows_decide() -> None:
    """A general plane of four components: the form taken from its first row on has its zeros there, in any basis."""
    columns = np.random.default_rng(5).normal(size=(1, 4, 2))
    found = canonical(columns)
    np.testing.assert_array_equal(found[0, :2] == 0.0, [[False, True], [True, False]])
    assert (found[0, 2:] != 0.0).all()
    np.testing.assert_allclose(canonical(columns @ [[1.0, 2.0], [3.0, -1.0]]), found, atol=1e-12)


@pytest.mark.parametrize(
    ("point", "axis", "allowed"),
    [((0, 0, 0), (0, 0, 1), 1e-3), ((0, 0, 0), (0.37, 0.56, 0.74), 2e-2), ((0.5, 0, 0), (0, 0.6, 0.8), 1e-3),
     ((1 / 3, 0, 0), (2**0.5, 0, 1), 1e-3), ((123, 40, 0), (0, 0, 1), 0.02), ((1.25, 0, 0), (3, 4, 0), 0.02),
     ((1.251, 0, 0), (371, 557, 743), 0.002 / 0.9997)],
)  # fmt: skip
def test_what_rounding_explains(point: tuple[float, ...], axis: tuple[float, ...], allowed: float) -> None:
    """Four half units of the last digit, over L or over the length of the axis; whole directions are exact."""
    pairs = [mg.Pair("A", "R", "frame", "arm", point=point, axis=axis, second=(0, 0, 1) if axis[2] == 0 else (1, 0, 0))]
    m, L = mg.Mechanism("m", pairs=pairs), 100.0 if point[0] > 100 else 1.0
    assert plausible(m, L) == pytest.approx(allowed, rel=1e-2)


@pytest.mark.parametrize("links", [6, 8])
def test_pattern_and_ranks_agree(links: int) -> None:
    """On all inversions with all drivers up to symmetry, at random places."""
    for number, chain in enumerate(list(mg.atlas(links))[:: 1 if links == 6 else 5]):
        for group in chain.inversions:
            m = of_chain(chain, group[0], seed=number)
            freedoms = mg.check(m).geometry.freedoms
            twists = np.zeros((6, 3))
            twists[[2, 3, 4], [0, 1, 2]] = 1.0
            for alike in chain.drivers(group[0]):
                rows = LinkRows(freedoms.position, np.array(alike[:1]), twists)
                links_of = {i for i in range(links) if i != group[0]}
                assert sorted(_by_pattern(rows, links_of)) == sorted(_by_rank(rows, links_of))
