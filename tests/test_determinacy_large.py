"""Large mechanisms: elimination along the loops against dense decompositions, and the report on them."""

from __future__ import annotations

from collections.abc import Callable

import mechanisms as known
import numpy as np
import pytest

import mechgraph as mg
from mechgraph.closure.assembly import assembled
from mechgraph.report.facts import counted_ledger
from mechgraph.structure import generic
from mechgraph.structure import mobility as freedom
from mechgraph.structure import uniqueness as stress
from mechgraph.structure.elimination import Elimination, loop_rows
from mechgraph.structure.mobility import free_motion
from mechgraph.topology.linkgraph import link_graph


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


@pytest.mark.parametrize("name", CASES)
def test_elimination_agrees_with_dense(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m = CASES[name]()
    system, x = assembled(m)
    driven = np.array([0]) if m.drives else np.zeros(0, dtype=np.intp)
    here = system.at(x[:, None])
    monkeypatch.setattr(freedom, "LARGE", 10**9)
    dense, dense_stress = free_motion(system, x, driven), stress.uniqueness(here, driven)
    monkeypatch.setattr(freedom, "LARGE", 0)
    swept, swept_stress = free_motion(system, x, driven), stress.uniqueness(here, driven)
    assert swept.rank == dense.rank
    assert [p.links for p in swept.passive] == [p.links for p in dense.passive]
    assert len(swept.undriven) == len(dense.undriven)
    assert np.abs(swept.null @ (swept.null.T @ dense.null) - dense.null).max() < 1e-9
    assert swept_stress.unique == dense_stress.unique
    assert swept_stress.count == dense_stress.count
    assert swept_stress.groups <= dense_stress.groups  # connected parts, which groups share
    assert [t.pair for t in swept_stress.transverse] == [t.pair for t in dense_stress.transverse]


@pytest.mark.parametrize("name", CASES)
def test_self_stresses_of_the_elimination(name: str) -> None:
    """They balance every freedom, and are as many as rows minus rank."""
    m = CASES[name]()
    system, x = assembled(m)
    here = system.at(x[:, None])
    points = here.pair_points[:, :, 0]
    rows = loop_rows(here.S[:, :, 0], system.loop_columns)
    found = Elimination(rows, [points[:, [k for k, _ in loop]] for loop in system.graph.loops], 1e-9)
    shared = found.wrenches(np.eye(len(found.zero_rows)))
    local = np.zeros((shared.shape[0], 0))
    for i, Y in found.local:
        full = np.zeros((shared.shape[0], Y.shape[1]))
        full[6 * i : 6 * i + 6] = Y
        local = np.hstack([local, full])
    everything = np.hstack([shared, local])
    J = here.J[:, :, 0]
    assert everything.shape[1] == J.shape[0] - found.rank
    assert np.linalg.matrix_rank(everything) == everything.shape[1]
    assert np.abs(J.T @ everything).max(initial=0.0) < 1e-9 * np.abs(everything).max(initial=1.0)
    assert sum(n for n, _ in found.sets) == everything.shape[1]


@pytest.mark.parametrize("name", ["windows", "grid", "hexapod"])
def test_generic_rank_agrees(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m = CASES[name]()
    graph = link_graph(m)
    monkeypatch.setattr(generic, "LARGE", 10**9)
    dense = generic.generic(m, graph)
    monkeypatch.setattr(generic, "LARGE", 0)
    assert generic.generic(m, graph) == dense


@pytest.mark.parametrize("name", mg.library())
@pytest.mark.parametrize("bookkeeping", ["lee", "minimal"])
def test_counted_ledger_agrees_with_the_registry(name: str, bookkeeping: str) -> None:
    m = mg.load(name)
    counted, read = counted_ledger(m, bookkeeping), mg.formulate(m, bookkeeping).ledger()
    assert dict(counted.by_kind) == dict(read.by_kind)


def test_a_large_report_lists_the_first_and_says_what_was_left_out() -> None:
    report = mg.check(known.windows(60))
    text = " ".join(str(report).split())
    assert report.mobility == 1
    assert report.redundancy == 180
    assert not report.thorough
    assert not report.effects
    assert "check(m, thorough=True)" in text
    assert "and 160 more" in text
    assert len(str(report).splitlines()) < 300
    assert max(map(len, str(report).splitlines())) <= 80
    assert len(report.to_dict()["unique"]) == len(report.pairs)


def test_thorough_on_request() -> None:
    m = known.windows(16)
    report = mg.check(m, thorough=True)
    assert mg.check(m).finite_mobility is None
    assert report.finite_mobility == 1
    assert report.effects


@pytest.mark.parametrize("name", CASES)
def test_all_self_stresses_are_listed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the drivers in place: as many as there are, readable, and spanning the components of the dense null space."""
    m = CASES[name]()
    system, x = assembled(m)
    driven = np.array([0]) if m.drives else np.zeros(0, dtype=np.intp)
    here = system.at(x[:, None])
    labels, dense = stress.component_table(here, stress.stress_at(here, driven), driven)
    monkeypatch.setattr(freedom, "LARGE", 0)
    found = stress.uniqueness(here, driven)
    states = stress.self_stresses(here, driven, found)
    assert len(states) == found.count == dense.shape[1]
    names = [pair if part == "effort" else f"{pair}:{part}" for pair, part in labels]
    listed = np.array([[{**s.components, **s.efforts}.get(n, 0.0) for s in states] for n in names])
    Q, _ = np.linalg.qr(dense)
    assert np.linalg.matrix_rank(listed) == found.count
    assert np.abs(listed - Q @ (Q.T @ listed)).max(initial=0.0) < 1e-6
    assert [s.text for s in found.states] == [s.text for s in states[: len(found.states)]]
