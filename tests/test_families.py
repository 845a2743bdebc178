"""Families and mobility: every statement of the chapter on a concrete geometry, mobility tables, and where counts fail.

Source: Marghitu, Fundamentals, tables 2.1 to 2.5 and figures 2.11 to 2.49 (the figures are not in the text: the geometry is ours, in
the freedoms that each statement asks for).
"""

from itertools import cycle

import numpy as np
import pytest
from planar import named

import mechgraph as mg

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = mg.PairType("Rt", "pin in a slot", freedoms=("Tx", "Rz"))


def mechanism(name: str, *pairs: tuple) -> mg.Mechanism:
    """Links 0, 1, ... with pairs (type, a, b, point, axis[, pitch]); driven by the first."""
    made = [
        mg.Pair(f"P{k}", kind, str(a), str(b), point=point, axis=axis, pitch=pitch[0] if pitch else None)
        for k, (kind, a, b, point, axis, *pitch) in enumerate(pairs)
    ]
    return mg.Mechanism(name, pairs=made, frame="0", drives=["P0"])


SARRUS = mechanism(
    "figure 2.13",
    ("R", 0, 1, (-1, 0, 0), Z), ("R", 1, 2, (-1.5, 0.7, 0), Z), ("R", 2, 3, (-1, 1.5, 0), Z),
    ("R", 3, 4, (0, 1.5, -1), X), ("R", 4, 5, (0, 0.8, -1.6), X), ("R", 5, 0, (0, 0, -1), X),
)  # fmt: skip
SCREW = mechanism(
    "figure 2.14",
    ("R", 0, 1, (0, 0, 0), Z), ("R", 1, 2, (0.5, 0.3, 0), X), ("H", 2, 3, (0.9, 0.3, 0), X, 0.2),
    ("R", 3, 4, (2, 0.6, 0), Z), ("R", 4, 0, (2.2, -0.4, 0), Z),
)  # fmt: skip
FOUR_BAR = mechanism(
    "figure 2.11",
    ("R", 0, 1, (0, 0, 0), Z), ("R", 1, 2, (0.2, 0.9, 0), Z), ("R", 2, 3, (2, 1.6, 0), Z), ("R", 3, 0, (2.2, 0, 0), Z),
)  # fmt: skip
TWO_RTR = mechanism(
    "figure 2.12",
    ("R", 0, 1, (0, 0, 0), Z), ("R", 1, 2, (0.3, 0.8, 0), Z), ("P", 2, 3, (0.3, 0.8, 0), (0.6, 0.8, 0)),
    ("R", 3, 0, (-0.3, 0, 0), Z), ("R", 3, 4, (0.9, 1.6, 0), Z), ("P", 4, 5, (0.9, 1.6, 0), (0.9, 1.6, 0)),
    ("R", 5, 0, (0, 0, 0), Z),
)  # fmt: skip
WEDGES = mechanism(
    "figure 2.15", ("P", 0, 1, (0, 0, 0), Y), ("P", 1, 2, (0.3, 0.4, 0), (1, 0.5, 0)), ("P", 2, 0, (1, 0, 0), X)
)
TABLES = [
    (SARRUS, 1, {"1": "Rz", "2": "TxTyRz", "3": "Ty", "4": "TyTzRx", "5": "Rx"}),
    (SCREW, 2, {"1": "Rz", "3": "TxTyRz", "4": "Rz"}),
    (FOUR_BAR, 3, {"1": "Rz", "2": "TxTyRz", "3": "Rz"}),
    (TWO_RTR, 3, {"1": "Rz", "2": "TxTyRz", "3": "Rz", "4": "TxTyRz", "5": "Rz"}),
    (WEDGES, 4, {"1": "Ty", "2": "Tx"}),
]
"""Tables 2.1 to 2.5. (Link 2 of table 2.2 turns about the screw, which turns with link 1; the table has it at one position.)"""


@pytest.mark.reference
@pytest.mark.parametrize(("m", "family", "table"), TABLES, ids=lambda value: getattr(value, "name", ""))
def test_mobility_tables(m: mg.Mechanism, family: int, table: dict[str, str]) -> None:
    r = mg.check(m)
    f = r.families
    columns = ("Tx", "Ty", "Tz", "Rx", "Ry", "Rz")
    found = {row.link: "".join(c for c, has in zip(columns, row.columns, strict=True) if has) for row in f.table}
    assert {link: found[link] for link in table} == table
    assert (f.family, f.dobrovolski, f.mobility) == (family, 1, 1)
    assert r.redundancy == family * len(r.loops)
    assert r.family == family
    assert not f.why


@pytest.mark.parametrize("kind", ["R", "P"])
def test_a_driver_link_is_of_family_five(kind: str) -> None:
    """Figure 2.16: M = n."""
    f = mg.check(mechanism("driver", (kind, 0, 1, (0.3, 0.1, 0), Z))).families
    assert (f.family, f.dobrovolski, f.mobility) == (5, 1, 1)


@pytest.mark.parametrize(
    "symbol",
    [
        "R - D42", "R - D20", "R - D10 - D10 - 1 + 0", "R - D10 - D10 - 1 + 2", "R - D10 - D10 - 2 + 0",
        "R - D10 - D10 - 2 + 3", "R - D10 - D10 - 3 + 0", "R - D10 - D10 - 1 + 3", "R - D21 - D30 - 1 + 3",
        "R - D43 - D50 - 2 + 0", "R - D31 - D20 - 3 + 0", "R - D10 - D10 - D10 - 1 + 2 - 4 + 0",
        "R - D10 - D10 - D10 - 2 + 0 - 2 + 5", "R - D42 - D30 - D21 - 1 + 2 - 4 + 0",
    ],
)  # fmt: skip
def test_planar_mechanisms(symbol: str) -> None:
    """Figures 2.22 to 2.28: M = 3 n - 2 c5 = 1."""
    f = mg.check(named(symbol)).families
    assert (f.dobrovolski, f.mobility) == (1, 1)
    assert f.classes == (0, 0, 0, 0, 3 * symbol.count("D") + 1)


def test_figure_223_is_degenerate() -> None:
    """T - D54: the turn at A cannot move; family 4, M = 2 * 2 - 3 = 1."""
    f = mg.check(named("T - D54")).families
    (loop,) = f.loops
    assert (f.family, loop.family, loop.rank, loop.locked) == (4, 4, 3, ("P1",))
    assert f.degenerate == (0,)
    assert (f.apparent, f.by_apparent, f.mobility) == (4.0, 1.0, 1)
    assert "P1 cannot move" in f.why[0]


def test_figure_226_has_an_apparent_family() -> None:
    """T - D21 - D50 - 2 + 0: families 3 and 4, f_a = 7/2, n = 4 as two links move as one, M = (6 - 7/2) 4 - (5 - 7/2) 6 = 1."""
    f = mg.check(named("T - D21 - D50 - 2 + 0")).families
    assert sorted(loop.family for loop in f.loops) in ([3, 4], [4, 4])
    assert f.mobility == 1
    assert len(f.degenerate) >= 1
    assert f.by_apparent == pytest.approx(1.0)


# --- system groups, each on a platform with N + 1 legs ------------------------------------------------------------------


def leg(rng: np.random.Generator, family: int, classes: list[int], turn: cycle) -> list[tuple]:
    """Pairs (type, point, axis) of a leg in the freedoms of a family: of family 1 they turn about axes across y, of family 2 about z.

    Of two pairs of class 3 (4) one is another: two balls, or two cylinders along z, would leave a link free between them.
    """
    out = []
    for i, j in enumerate(classes):
        point, random = rng.uniform(-1, 1, 3), rng.normal(size=3)
        if family == 0:
            kind = {5: "R", 4: "C", 3: ("S", "Sc")[next(turn) if j == 3 else 0], 2: "Sg", 1: "Sp"}[j]
        elif family == 1:
            kind, random = {5: "R", 4: "C", 3: "E", 2: "Cp"}[j], (Z if j == 2 else random * (1, 0, 1))
        elif family == 2:
            slides = j == 5 and i % 2 == 0
            kind, random = (
                {5: "P" if slides else "R", 4: ("C", HALF)[next(turn) if j == 4 else 0], 3: "E"}[j],
                (random if slides else Z),
            )
        elif family == 3:
            kind, point, random = {5: "R", 4: HALF}[j], point * (1, 1, 0), Z
        else:
            kind, point, random = "P", point * (1, 1, 0), random * (1, 1, 0)
        out.append((kind, point, random))
    return out


def platform(name: str, family: int, pairs: tuple[int, ...], contours: int, drivers: int = 0) -> mg.Mechanism:
    """The pairs shared evenly among the legs of a platform; drivers as one more turn at the frame of a leg each."""
    rng = np.random.default_rng(7)
    legs: list[list[int]] = [[] for _ in range(contours + 1)]
    for j, count in enumerate(pairs, start=1):
        for _ in range(count):
            min(legs, key=lambda mine: sum(6 - j for j in mine)).append(j)
    made, links, turn = [], 1, cycle((0, 1))
    for number, mine in enumerate(legs):
        at = "0"
        steps = [*([5] if number < drivers else []), *mine]
        for i, (kind, point, axis) in enumerate(leg(rng, family, steps, turn)):
            end = i == len(steps) - 1
            to = "platform" if end else str(links)
            links += not end
            made.append(
                mg.Pair(f"P{len(made)}", kind, at, to, point=point, axis=axis, second=X if kind == "Cp" else None)
            )
            at = to
    first = np.cumsum([0, *(len(mine) + (i < drivers) for i, mine in enumerate(legs))])[:drivers]
    return mg.Mechanism(name, pairs=made, frame="0", drives=[f"P{k}" for k in first])


GROUPS = [(g.family, g.pairs, 1) for g in mg.system_groups(1)] + [
    (1, (0, 0, 0, 0, 10), 2), (2, (0, 0, 0, 1, 6), 2), (2, (0, 0, 1, 1, 3), 2), (3, (0, 0, 0, 0, 6), 2),
    (3, (0, 0, 0, 1, 4), 2), (4, (0, 0, 0, 0, 4), 2), (2, (0, 0, 1, 1, 7), 3), (3, (0, 0, 0, 1, 7), 3),
    (4, (0, 0, 0, 0, 6), 3),
]  # fmt: skip
"""Table 2.7 whole (figures 2.31 to 2.37 among it), and the groups of figures 2.38 to 2.41 and 2.43 to 2.45."""


@pytest.mark.reference
@pytest.mark.parametrize(("family", "pairs", "contours"), GROUPS, ids=str)
def test_system_groups_take_up_no_mobility(family: int, pairs: tuple[int, ...], contours: int) -> None:
    m = platform("group", family, pairs, contours)
    r = mg.check(m)
    assert len(m.links) - 1 == sum(pairs) - contours
    assert len(r.loops) == contours
    assert (r.mobility, r.redundancy) == (0, family * contours)


@pytest.mark.reference
@pytest.mark.parametrize(
    ("name", "pairs", "contours", "drivers"),
    [
        ("figure 2.32", (0, 0, 0, 1, 4), 1, 1),
        ("figure 2.42", (0, 0, 1, 2, 5), 2, 2),
        ("figure 2.46", (0, 0, 3, 4, 1), 3, 3),
    ],
)
def test_spatial_mechanisms_of_family_zero(name: str, pairs: tuple[int, ...], contours: int, drivers: int) -> None:
    """M = 6 n - 5 c5 - 4 c4 - 3 c3 is the number of drivers."""
    r = mg.check(platform(name, 0, pairs, contours, drivers))
    f = r.families
    assert (f.family, f.dobrovolski, f.mobility) == (0, drivers, drivers)
    assert f.links == sum(pairs) - contours + drivers
    assert not r.groups.free


def test_where_counts_fail() -> None:
    bennett = mg.check(mg.load("bennett")).families
    assert bennett.dobrovolski < bennett.mobility == 1
    assert "moves by its dimensions" in bennett.why[0]
    rssr = mg.check(mg.load("rssr")).families
    assert (rssr.dobrovolski, rssr.mobility, rssr.passive) == (2, 2, 1)
    assert "passive" in rssr.why[0]
    fixed = mg.check(mg.load("prprrh")).families
    assert fixed.why == ("Nothing moves: what family it would be of cannot be told.",)


def test_families_do_not_depend_on_the_frame() -> None:
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    pose[:3, :3] *= np.linalg.det(pose[:3, :3])
    pose[:3, 3] = (5, -3, 8)
    for m, family, _ in TABLES:
        f = mg.check(m.moved(pose)).families
        assert (f.family, f.dobrovolski) == (family, 1)
        assert [row.dimension for row in f.table] == [row.dimension for row in mg.check(m).families.table]
