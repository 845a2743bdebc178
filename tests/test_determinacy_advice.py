"""Advice: every effect said is that of the changed mechanism, computed anew at the same position."""

from __future__ import annotations

from itertools import combinations, islice, product

import mechanisms as known
import numpy as np
import pytest
from lattices import ladder
from screws import rotation_exp

import mechgraph as mg
from mechgraph.determinacy import pair_changes
from mechgraph.determinacy.pair_changes import Effect, changes_of, rank_key, self_aligning_sets, wider_types

BUILDERS = {
    "planar": known.planar,
    "library four-bar": lambda: mg.load("four-bar"),
    "slider-crank": lambda: mg.load("slider-crank"),
    "spherical": known.spherical,
    "bennett": known.bennett,
    "sarrus": known.sarrus,
    "three cranks": known.three_cranks,
    "door": known.door,
    "prprrh": known.prprrh_special,
}


def changed(m: mg.Mechanism, effect: Effect) -> mg.DeterminacyReport:
    for (pair, old, new), turn in zip(effect.changes, effect.turns, strict=True):
        if new == "left out":
            assert old == "coupling"
            m = m.replace(couplings=[c for c in m.couplings if c.name != pair])
            continue
        assert m.pair(pair).type.symbol == old
        m = m.with_pair_type(pair, new)
        if turn:
            changed = m.pair(pair)
            axis = np.array(changed.axis) / np.linalg.norm(changed.axis)
            second = rotation_exp(np.radians(turn) * axis) @ changed.second
            m = m.replace(pairs=[p.replace(second=second) if p.name == pair else p for p in m.pairs])
    return mg.check(m)


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", BUILDERS)
def test_effects_are_true(name: str) -> None:
    report = mg.check(BUILDERS[name]())
    assert report.effects
    assert report.inputs is not None
    for effect in report.effects:
        after = changed(report.mechanism, effect)
        assert effect.redundancy == (report.redundancy, after.redundancy), effect.text
        assert effect.mobility == (report.mobility, after.mobility), effect.text
        assert effect.passive == (len(report.passive), len(after.passive)), effect.text
        assert effect.redundancy[1] < effect.redundancy[0]
        assert after.inputs == report.inputs
        assert len(after.mechanism.drives) == len(report.mechanism.drives)


@pytest.mark.parametrize("name", [n for n in BUILDERS if n != "three cranks"])
def test_some_advice_removes_all_redundancy(name: str) -> None:
    """Three cranks are left out: the tie in their plane takes a slide across the axes, which adds a turn or a slide too many."""
    report = mg.check(BUILDERS[name]())
    assert min(effect.redundancy[1] for effect in report.effects) == 0


def test_planar_four_bar_is_offered_single_changes_and_sets() -> None:
    """C with S, as in L. Reshetov, Self-Aligning Mechanisms, 1982: a planar four-bar without redundant constraints."""
    effects = mg.check(known.planar()).effects
    kinds = {tuple(sorted(new for _, _, new in e.changes)) for e in effects}
    assert ("C", "S") in kinds
    assert any(len(kind) == 1 for kind in kinds)


@pytest.mark.parametrize("build", [lambda: mg.load("prprrh"), lambda: known.three_cranks(0.05), known.folded_bars])
def test_a_structure_is_told_what_frees_it(build: object) -> None:
    report = mg.check(build())  # type: ignore[operator]
    freeing = [e for e in report.effects if e.mobility[1] - e.passive[1] > (report.finite_mobility or 0)]
    assert freeing
    for effect in freeing:
        after = changed(report.mechanism, effect)
        assert effect.mobility[1] == after.mobility


def test_under_driven_mechanisms_get_the_drivers_that_complete_them() -> None:
    for m in (
        known.pphchp(known.Z, known.Z, known.Z),
        known.hexapod("UPS", driven=False),
        mg.load("7r").replace(drives=[]),
    ):
        report = mg.check(m)
        assert report.undriven
        whole = mg.check(m.replace(drives=[*m.drives, *report.suggested_drives]))
        assert not whole.undriven
        assert not whole.contradicting_drives
        assert report.advice[0].freedoms == report.suggested_drives


# --- couplings -----------------------------------------------------------------------------------------------------------


def gears(*ratios: float) -> mg.Mechanism:
    """Wheels on the frame, each after the first tied to the one before."""
    names = [chr(ord("A") + i) for i in range(len(ratios) + 1)]
    pairs = [mg.Pair(n, "R", "frame", f"wheel{n}", point=(i, 0, 0), axis=known.Z) for i, n in enumerate(names)]
    couplings = [mg.Coupling({a: r, b: -1.0}) for a, b, r in zip(names, names[1:], ratios, strict=False)]
    return mg.Mechanism("gears", None, pairs, ["A"], couplings=couplings)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_redundant_couplings_are_advised_to_be_left_out(engine: str) -> None:
    """A second coupling of A and C says what g1 and g2 say together: any one of the three may go, no other change helps."""
    m = gears(2.0, 3.0, 0.5)
    m = m.replace(couplings=[*m.couplings, mg.Coupling({"A": -6.0, "C": 1.0}, name="again")])
    report = mg.check(m, engine=engine)  # type: ignore[arg-type]
    assert (report.redundancy, report.mobility) == (1, 1)
    assert {e.changes for e in report.effects} == {((g, "coupling", "left out"),) for g in ("g1", "g2", "again")}
    for e in report.effects:
        after = changed(m, e)
        assert (e.redundancy, e.mobility, e.passive) == ((1, after.redundancy), (1, after.mobility), (0, 0))
        assert after.redundancy == 0
    assert "coupling g1 left out: redundancy 1 -> 0, mobility 1 -> 1, passive 0 -> 0" in report.text(full=True)


def test_advice_keeps_freedoms_that_couplings_tie() -> None:
    """A planar four-bar with two of its turns coupled is a structure; a pair whose turn is coupled keeps it as a single freedom."""
    m = known.planar().replace(couplings=[mg.Coupling({"O2": 1.0, "O3": -1.0})])
    report = mg.check(m)
    assert report.mobility == 0
    kinds = {new for e in report.effects for pair, _, new in e.changes if pair in ("O2", "O3")}
    assert not kinds & {"S", "Sg", "Sp"}
    for e in report.effects:
        after = changed(m, e)
        assert (e.redundancy[1], e.mobility[1]) == (after.redundancy, after.mobility), e.text
    assert any(e.changes == (("g1", "coupling", "left out"),) and e.mobility == (0, 1) for e in report.effects)
    assert str(report)


def test_advice_keeps_pairs_of_gears_and_of_springs_and_can_be_applied() -> None:
    """A four-bar behind gears, a torsion spring at its rocker: a bearing that floats does not hold a gear, and a ball has no angle."""
    pairs = [
        mg.Pair("M", "R", "frame", "pinion", point=(-0.06, 0, 0), axis=known.Z),
        mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=known.Z),
        mg.Pair("B", "R", "wheel", "rod", point=(0.02, 0, 0), axis=known.Z),
        mg.Pair("C", "R", "rod", "rocker", point=(0.02, 0.1, 0), axis=known.Z),
        mg.Pair("D", "R", "frame", "rocker", point=(0.1, 0, 0), axis=known.Z),
    ]
    gear = mg.SpurGears("teeth", "M", "A", teeth=(20, 40))
    m = mg.Mechanism("geared", None, pairs, ["M"], couplings=[gear], loads=[mg.TorsionSpring("D", stiffness=1.0)])
    report = mg.check(m)
    assert report.advice
    for advice in report.advice:
        assert advice.effect is not None
        assert mg.check(advice.apply()).redundancy == advice.effect.redundancy[1] < report.redundancy


def test_effects_hold_where_pairs_have_moved() -> None:
    """A universal joint away from its zero: made a sphere it adds one passive freedom or mobility, here as where it was declared."""
    declared, moved = mg.check(known.rsur()), mg.check(known.rsur(), at={"A": 0.3})
    for report in (declared, moved):
        g = report.geometry
        assert g is not None
        k = next(i for i, p in enumerate(report.mechanism.pairs) if p.type.symbol == "U")
        (wider,) = [c for c in changes_of(g.freedoms) if c.item == k and c.pair and c.pair.type.symbol == "S"]
        done = pair_changes.effect(g.freedoms, g.driven, (wider,))
        after = mg.check(known.rsur().with_pair_type(report.mechanism.pairs[k].name, "S"))
        assert (done.redundancy[1], done.mobility[1], done.passive[1]) == (
            after.redundancy,
            after.mobility,
            len(after.passive),
        )


# --- frames turned about their axis ----------------------------------------------------------------------------------------


def test_turned_frames_are_frames_and_turn_to_the_left() -> None:
    rng = np.random.default_rng(3)
    frames = np.concatenate([rotation_exp(rng.normal(size=(3, 5))), rng.normal(size=(3, 1, 5))], axis=1)
    angles = rng.uniform(-3, 3, 5)
    turned = pair_changes.turned(frames, angles)
    about_z = rotation_exp(np.array([np.zeros(5), np.zeros(5), angles]))
    np.testing.assert_allclose(turned[:, :3], np.einsum("ijn,jkn->ikn", frames[:, :3], about_z), atol=1e-14)
    np.testing.assert_array_equal(turned[:, 3], frames[:, 3])


def test_the_best_turn_lays_x_along_the_largest_bending_moment() -> None:
    """A self-stress with its moment in a known direction across the axis: x comes to lie on that line, the angle in (-90, 90] degrees."""
    rng = np.random.default_rng(4)
    frames = np.concatenate([rotation_exp(rng.normal(size=(3, 9))), rng.normal(size=(3, 1, 9))], axis=1)
    wanted = np.linspace(-1.5, 1.5, 9)
    moment = np.cos(wanted) * frames[:, 0] + np.sin(wanted) * frames[:, 1] + rng.normal(size=9) * frames[:, 2]
    force = rng.normal(size=(3, 9))
    wrenches = np.concatenate([moment + np.cross(frames[:, 3], force, axis=0), force]).T[:, :, None]
    np.testing.assert_allclose(pair_changes.best_turns(frames, wrenches), wanted, atol=1e-12)
    assert pair_changes.best_turns(frames, wrenches[:, :, :0]).tolist() == [0.0] * 9


def test_cylinders_between_balls_are_completed_until_nothing_is_redundant():
    """A crane arm on a cylinder that carries a planar four-bar: three redundant constraints each, the cylinder takes away its own three."""
    bars = [
        ("A", "R", "frame", "arm", (0, 0, 0)), ("B", "R", "frame", "tube", (1, -1, 0)), ("C", "R", "rod", "arm", (2, 0, 0)),
        ("E", "R", "arm", "stick", (5, 0, 0)), ("H", "R", "stick", "bar", (6, 0, 0)), ("K", "R", "bar", "crank", (7, 0.5, 0)),
        ("L", "R", "crank", "arm", (4, -1, 0)),
    ]  # fmt: skip
    pairs = [mg.Pair(name, kind, a, b, point=at, axis=(0, 0, 1)) for name, kind, a, b, at in bars]
    pairs.append(mg.Pair("lift", "P", "tube", "rod", point=(1, -1, 0), axis=(1, 1, 0)))
    report = mg.check(mg.Mechanism("crane", pairs=pairs, drives=["lift", "L"]))
    assert report.redundancy == 6
    whole, alone = [advice for advice in report.advice if advice.brief.startswith("cylinder lift between ball joints")]
    assert "redundancy 6 -> 0" in whole.brief
    assert "redundancy 6 -> 3" in alone.brief
    assert mg.check(whole.apply()).redundancy == 0


# --- self-aligning variants ---------------------------------------------------------------------------------------------


OVERCONSTRAINED = ["four-bar", "slider-crank", "bennett", "spherical-four-bar", "windows-2"]


@pytest.mark.daily(2)
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


def test_rows_that_hold_nothing_are_no_advice() -> None:
    table = mg.pair_types()
    wider = {other.symbol for row in table.values() for other in wider_types(row)}
    assert wider == {symbol for symbol, row in table.items() if row.f} - {"H", "Tc", "Fr"}
