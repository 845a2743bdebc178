"""Self-aligning variants: complete, without redundancy, and headed by the advice."""

from itertools import combinations, islice, product

import numpy as np
import pytest
from lattices import ladder

import mechgraph as mg
from mechgraph.determinacy.pair_changes import changes_of, rank_key, self_aligning_sets, wider_types

OVERCONSTRAINED = ["four-bar", "slider-crank", "bennett", "spherical-four-bar", "windows-2"]


@pytest.mark.parametrize("name", OVERCONSTRAINED)
def test_every_variant_is_self_aligning(name: str) -> None:
    """Applied, the first ones and some of the others have no redundancy, the mobility of before and unique reactions."""
    found = list(mg.check(mg.load(name)).self_aligning(3))
    assert len({a.text for a in found}) == len(found) > 0
    for advice in [*found[:3], *found[3 :: max(1, len(found) // 4)]]:
        report = mg.check(advice.apply())
        assert (report.redundancy, report.mobility) == (0, 1), advice.text


@pytest.mark.parametrize("name", OVERCONSTRAINED)
def test_the_advice_is_the_head(name: str) -> None:
    """Sets of the advice that leave no redundancy and add no passive freedom are among the variants, the first one first."""
    report = mg.check(mg.load(name))
    variants = [a.effect.changes for a in report.self_aligning(3)]
    sets = [a.effect for a in report.advice if a.effect and a.effect.redundancy[1] == 0 and a.effect.passive[1] == 0]
    changes = [e.changes for e in sets if len(e.changes) <= 3]
    assert set(changes) <= set(variants)
    assert changes[0] == variants[0]


def test_none_is_missing() -> None:
    """A general planar four-bar: all sets of wider pairs of the table at the coupler, tried one by one."""
    places = [(0, 0), (0.3, 1.1), (2.1, 1.7), (2.6, 0.1)]
    pairs = [mg.Pair(n, "R", f"l{k}", f"l{(k + 1) % 4}", point=(x, y, 0), axis=(0, 0, 1), second=(0.3, 1, 0))
             for k, (n, (x, y)) in enumerate(zip("ABCD", places, strict=True))]  # fmt: skip
    m = mg.Mechanism("four-bar", pairs=pairs, drives=["A"])
    types = [t.symbol for t in wider_types(pairs[0].type)]
    expected = set()
    for size in (1, 2):
        for names in combinations("BC", size):
            for symbols in product(types, repeat=size):
                changed = m
                for n, s in zip(names, symbols, strict=True):
                    changed = changed.with_pair_type(n, s)
                rows = mg.check(changed)
                if (rows.redundancy, rows.mobility) == (0, 1):
                    expected.add(tuple((n, "R", s) for n, s in zip(names, symbols, strict=True)))
    found = {a.effect.changes for a in mg.check(m).self_aligning(2) if not any(a.effect.turns)}
    found = {changes for changes in found if {name for name, *_ in changes} <= {*"BC"}}
    assert expected
    assert found == expected


def test_the_order_is_that_of_the_rank_and_nothing_comes_twice() -> None:
    """Sought one by one, by effort, number, width and place: the list is sorted, and its head is the same whatever the limit."""
    freedoms = mg.check(mg.load("windows-2")).geometry.freedoms
    found = list(self_aligning_sets(changes_of(freedoms), freedoms.redundancy, 3))
    assert [rank_key(s) for s in found] == sorted(rank_key(s) for s in found)
    assert len({tuple(map(id, s)) for s in found}) == len(found) > 100
    longer = islice(self_aligning_sets(changes_of(freedoms), freedoms.redundancy, None), 20)
    texts = [[(c.item, c.pair.type.symbol) for c in s] for s in longer]
    efforts = [max(c.effort for c in s) for s in found]
    same = [[(c.item, c.pair.type.symbol) for c in s] for s, e in zip(found, efforts, strict=True) if e == efforts[0]]
    assert texts[: len(same)] == same[:20]


def test_the_first_of_very_many_comes_soon() -> None:
    """A ladder of eight parallelograms, redundancy 24: sets of any number, of which the first ones are not waited for."""
    report = mg.check(ladder(16, equal=True))
    assert report.redundancy == 24
    first = next(report.self_aligning())
    assert first.effect.redundancy == (24, 0)
    assert mg.check(first.apply()).redundancy == 0


def test_limits_that_are_none() -> None:
    report = mg.check(mg.load("four-bar"))
    with pytest.raises(mg.DeclarationError, match=r"most = 0: expected a whole number from 1, or None for any"):
        report.self_aligning(0)
    assert {len(a.effect.changes) for a in report.self_aligning()} == {1, 2}


def test_nothing_to_align() -> None:
    assert list(mg.check(mg.load("rcsr")).self_aligning()) == []
    assert list(mg.check(mg.chain("RSSR")).self_aligning()) == []
    assert np.all([a.effect.redundancy[0] == 3 for a in mg.check(mg.load("four-bar")).self_aligning(1)])
