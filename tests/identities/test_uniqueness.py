"""Uniqueness against brute force: reactions from random null-space additions differ exactly in the components called not unique."""

from __future__ import annotations

import mechanisms as known
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mechgraph as mg

TYPES = ("R", "P", "C", "S", "U", "E", "H", "Sg", "R", "R", "P")
MOVES = 1e-6


def brute_force(m: mg.Mechanism) -> dict[str, dict[str, bool]]:
    """Component -> whether two solutions of the printed equations agree in it; position as declared."""
    f = mg.formulate(m, "minimal")
    s = mg.solve(m, {d.freedom: 0.0 for d in m.drives}, redundant="minimum_norm")
    A, b = f.assemble(s.state(()))
    A = A.toarray()
    _, sigma, Vt = np.linalg.svd(A)
    null = Vt[int((sigma > 1e-10 * sigma[0]).sum()) :].T
    rng = np.random.default_rng(3)
    first = np.linalg.lstsq(A, b, rcond=1e-11)[0]
    others = first[:, None] + null @ rng.normal(size=(null.shape[1], 4))
    scale = 1.0 + float(np.abs(b).max(initial=0.0))
    assert np.abs(A @ others - (A @ first)[:, None]).max(initial=0.0) < 1e-8 * scale
    same = np.abs(others - first[:, None]).max(axis=1) < MOVES
    out: dict[str, dict[str, bool]] = {p.name: {} for p in m.pairs}
    names = {p.name: list(p.type.component_names) for p in m.pairs}
    for unknown, ok in zip(f.unknowns, same, strict=True):
        if unknown.freedom:
            out[m.pairs[m.freedom(unknown.freedom)[0]].name]["effort"] = bool(ok)
        else:
            out[unknown.owner][names[unknown.owner].pop(0)] = bool(ok)
    return out


NAMED = {
    "bennett": known.bennett,
    "goldberg": known.goldberg,
    "sarrus": known.sarrus,
    "spherical": known.spherical,
    "planar": known.planar,
    "three cranks": known.three_cranks,
    "bricard": known.bricard_cube,
    "door": known.door,
    "prprrh": known.prprrh_special,
    "rssr": lambda: mg.load("rssr").replace(loads=()),
    "6-sps": lambda: known.hexapod("SPS"),
    "3-upu": known.three_upu,
}


@pytest.mark.parametrize("name", NAMED)
def test_known_mechanisms(name: str) -> None:
    m = NAMED[name]()
    assert mg.check(m).unique == brute_force(m)


def random_mechanism(seed: int, letters: list[str], parallel: list[bool], concurrent: list[bool]) -> mg.Mechanism:
    """A loop with some axes parallel to one direction and some through one point; a second chain where there are letters enough."""
    rng = np.random.default_rng(seed)
    direction, centre = rng.normal(size=3), rng.normal(size=3)
    cut = len(letters) if len(letters) < 8 else 5
    pairs = []
    for k, kind in enumerate(letters):
        point = rng.normal(size=3)
        axis = direction if parallel[k] else centre - point if concurrent[k] else rng.normal(size=3)
        second = np.cross(axis, rng.normal(size=3))
        if k < cut:
            ends = ("frame" if k == 0 else f"link{k}", "frame" if k == cut - 1 else f"link{k + 1}")
        else:
            first, last = k == cut, k == len(letters) - 1
            ends = ("link2" if first else f"side{k}", "frame" if last else f"side{k + 1}")
        pitch = float(rng.uniform(0.2, 0.5)) if kind == "H" else None
        pairs.append(mg.Pair(f"O{k}", kind, *ends, point=point, axis=axis, second=second, pitch=pitch))
    return mg.Mechanism("random", None, pairs)


@given(
    seed=st.integers(0, 10**6),
    letters=st.lists(st.sampled_from(TYPES), min_size=3, max_size=10),
    parallel=st.lists(st.booleans(), min_size=10, max_size=10),
    concurrent=st.lists(st.booleans(), min_size=10, max_size=10),
)
def test_random_mechanisms_with_planted_redundancy(
    seed: int, letters: list[str], parallel: list[bool], concurrent: list[bool]
) -> None:
    m = random_mechanism(seed, letters, parallel, concurrent)
    bare = mg.check(m)
    assume(bare.mobility and bare.suggested_drives and len(bare.suggested_drives) == len(bare.undriven))
    driven = m.replace(drives=bare.suggested_drives)
    report = mg.check(driven)
    assume(not report.undriven)
    assert not report.contradicting_drives
    assume(not report.near)
    found = brute_force(driven)
    several = {p.name for p in driven.pairs if sum(d.freedom.startswith(p.name + ".") for d in driven.drives) > 1}
    for pair, verdicts in report.unique.items():
        if pair not in several:
            assert verdicts == found[pair], pair


def test_self_stresses_balance_and_span_everything() -> None:
    """The listed self-stresses are as many as the redundancy with the drivers in place, and independent."""
    for build in (known.planar, known.three_cranks, known.sarrus, known.door):
        report = mg.check(build())
        labels = sorted({name for s in report.self_stresses for name in s.components})
        table = np.array([[s.components.get(name, 0.0) for name in labels] for s in report.self_stresses])
        assert np.linalg.matrix_rank(table) == len(report.self_stresses) == report.redundancy
