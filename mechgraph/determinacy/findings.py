"""Findings in words and by name: passive and locked freedoms, what can drive and what cannot, loops with their geometry, advice.

Words for people are rows of data: reaction components by pair type and direction, what a pair is as a part, kinds of mechanisms. Advice
can be applied: drivers to add or to exchange, and changes of pairs and couplings with their computed effect. Rounded numbers: the
smallest tolerance at which a verdict changes, and what is then special about the mechanism.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.determinacy.families import kind_of
from mechgraph.determinacy.mobility import Freedoms, Position, drive_order, single_freedoms
from mechgraph.determinacy.pair_changes import (
    LEFT_OUT,
    RIGID,
    WHOLE,
    Effect,
    changes_of,
    effect,
    self_aligning_sets,
    with_spline,
)
from mechgraph.determinacy.snapping import EXACT, SnappedMechanism, candidates, snapped
from mechgraph.document import NAMED
from mechgraph.errors import Budget, MechgraphError, SearchEnded
from mechgraph.files import patch
from mechgraph.force.loads import hold_at_rest, hold_names, is_idle
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.solver import EngineName
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import independent_rows, rank_of, singular_values
from mechgraph.maths.se3 import Array, Index, rotation_exp
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.toml import to_data
from mechgraph.pairs.factors import Component
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.quantities import unit_of

LINES = {
    "R": "pin", "P": "slide", "H": "screw", "C": "shaft", "U": "first pin", "E": "normal of the plane",
    "Sc": "groove", "Sg": "groove", "Cp": "normal of the plane", "Sp": "normal of the plane",
}  # fmt: skip
"""What z of the marker is, by pair type; "axis" for the others that have one."""

PARTS = {
    "C": "floating bearing", "S": "ball joint or self-aligning bearing",
    "Sg": "floating self-aligning bearing", "U": "universal joint", "E": "plane contact",
    "Cp": "cylinder on a plane", "Sp": "ball on a plane", "Sc": "pinned ball in a slotted cylinder",
    ("P", "C"): "round guide that lets it turn", ("P", "Sg"): "ball in a groove", ("P", "E"): "flat guide",
}  # fmt: skip
"""What a new pair is as a part that can be bought or made, by its type or by the old and the new one; else its name in the pair table."""


@dataclass(frozen=True)
class KindWords:
    """The forces that a kind of mechanism is about, and the others where all pairs are of this kind (and where none turns)."""

    own: str
    others: str
    without_pins: str


KINDS = {
    "planar": KindWords(
        "in-plane forces", "axial forces and tilting moments at the pins", "forces across the plane and moments in it"
    ),
    "spherical": KindWords("moments about the center", "forces through the center", "forces through the center"),
}
"""By the kind of ``determinacy.families``."""


def plural(count: int, one: str, many: str = "") -> str:
    """``1 driver``, ``3 drivers``."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def joined(names: Sequence[str], word: str = "and", most: int = NAMED) -> str:
    """``A, B and C``, the first few of many."""
    shown = [*names[:most], *([f"{len(names) - most} more"] if len(names) > most else [])]
    return f" {word} ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))


def component_words(row: PairType, names: Iterable[str]) -> str:
    """Components of a pair type with their direction in words: ``Fz (along the pin), Mx and My (moments across the pin)``."""
    components = {c.name: c for c in row.reactions or ()}
    by_words: dict[str, list[str]] = {}
    for name in names:
        by_words.setdefault(_direction(row, components.get(name)), []).append(name)
    parts = [joined(some) + (f" ({words})" if words else "") for words, some in by_words.items()]
    return ", ".join(parts) if len(by_words) > 1 or "" not in by_words else parts[0]


def _direction(row: PairType, c: Component | None) -> str:
    """The direction of a force or moment against z of its frame; nothing for a pair without an axis."""
    if c is None or not row.directed:
        return ""
    if row.normal is not None and c.is_couple:
        return "moment M in the plane"
    turning, slot = divmod(int(np.flatnonzero(c.wrench)[0]), 3)
    how = {(0, True): "moment about", (0, False): "moment across", (1, True): "along", (1, False): "across"}
    return f"{how[turning, slot == 2]} the {LINES.get(row.symbol, 'axis')}"


def exchange(old: str, new: PairType) -> str:
    """A new pair as a part, with the symbols: ``ball joint or self-aligning bearing (R -> S)``."""
    return f"{PARTS.get((old, new.symbol), PARTS.get(new.symbol, new.name))} ({old} -> {new.symbol})"


LARGEST_TOL = 1e-2
"""Largest tolerance that is tried."""
LIMIT = 20.0
"""Seconds that the search for near-special geometry may take unless another limit is given."""
TOO_MANY = "of {} pairs it is not looked for (of up to {} it is)"
"""What is said of more."""
SAFE = 4.0
"""Tolerance that is advised, in largest changes of a pair: closure errors add up along a loop."""


@dataclass(frozen=True)
class Rounding:
    """A tolerance at which the verdict changes.

    ``tol`` to pass on, ``angle`` (radians) and ``distance`` (unit of length) that directions and distances have to be meant to,
    ``kind`` ("planar", "spherical" or ""), ``mobility`` then (finite), ``misses`` of pairs in words, and the ``text`` of it all.
    """

    tol: float
    angle: float
    distance: float
    kind: str
    mobility: int
    misses: tuple[str, ...]
    text: str

    def __str__(self) -> str:
        return self.text


def rounding(m: Mechanism, verdict: Callable[[Mechanism], tuple[Any, ...]], limit: float = LIMIT) -> Rounding | None:
    """The smallest tolerance (of decades up to 1e-2) that changes ``verdict(m)``, its mobility first; None where there is none.

    The verdict is a tuple that begins with the finite mobility; empty where there is none. Changes of pairs beyond what ``plausible``
    says are no rounding: a mechanism may come near a special one by chance.

    Raises
    ------
    SearchEnded
        where it takes more than ``limit`` seconds (see ``errors.Budget``), and of more than 300 pairs.
    """
    budget = Budget(limit)
    if isinstance(m, SnappedMechanism) or not m.has_geometry:
        return None
    most_pairs = 300  # pairs up to which rounding is looked for without being asked
    if len(m.pairs) > most_pairs:
        raise SearchEnded(TOO_MANY.format(len(m.pairs), most_pairs))
    own: tuple[Any, ...] | None = None
    other: tuple[SnappedMechanism, float, tuple[Any, ...]] | None = None
    try:
        sizes = candidates(m, LARGEST_TOL)
    except MechgraphError:  # the loops do not close to that either
        return None
    # relations within a tolerance, in all and a pair, above which they are no rounding: of many pairs some come near
    # any relation
    by_chance = (60, 1.5)
    for tol in _decades(sizes):
        if (sizes <= tol).sum() > max(by_chance[0], by_chance[1] * len(m.pairs)):
            break
        try:
            exact = snapped(m, tol, budget)
        except SearchEnded:
            raise
        except MechgraphError:
            continue
        if (not exact.changes.moved and exact.changes.closure <= EXACT) or exact.changes.largest > plausible(
            m, exact.changes.L
        ):
            continue
        budget.spend(2e-3 * len(m.pairs))  # two verdicts, measured
        own = verdict(m) if own is None else own
        then = verdict(exact)
        if then and (not own or then[0] != own[0]):
            return _worded(exact, tol, then)
        other = (exact, tol, then) if other is None and then and then != own else other
    return _worded(*other) if other else None


def plausible(m: Mechanism, L: float) -> float:
    """Largest change (radians, or length / ``L``) that rounding explains: some half units of the last digit in which points and axes are
    written, at least ``CLOSE``.

    A last digit so coarse that half a unit exceeds ``LARGEST_TOL``, as in (0, 0, 1), was not rounded to: such numbers are exact.
    """
    units = []
    for pair in m.pairs:
        for place in (pair,) if pair.on_a is None or pair.on_b is None else (pair.on_a, pair.on_b):
            sizes = L, math.hypot(*place.axis), math.hypot(*place.second)
            vectors = zip((place.point, place.axis, place.second), sizes, strict=True)
            units += [0.5 * 10.0 ** -max(map(_decimals, vector)) / size for vector, size in vectors]
    # change of a pair up to which numbers of any number of digits are taken for rounded: of random mechanisms hardly
    # one comes so near
    return max(1e-3, SAFE * max((unit for unit in units if unit <= LARGEST_TOL), default=0.0))


def _decimals(value: float) -> int:
    """Digits behind the point in the shortest decimal that is this number."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return max(-exponent, 0) if isinstance(exponent, int) else 0


def _decades(sizes: Array) -> Iterator[float]:
    """The powers of ten from the smallest of the sizes up."""
    if (sizes > EXACT).any():
        first = int(np.ceil(np.log10(np.clip(sizes[sizes > EXACT].min(), 1e-12, LARGEST_TOL))))
        yield from (10.0**p for p in range(first, int(np.log10(LARGEST_TOL)) + 1))


def _worded(exact: SnappedMechanism, tol: float, verdict: tuple[Any, ...]) -> Rounding:
    moved, mobility = exact.changes.moved, int(verdict[0])
    angle = max((c.angle for c in moved), default=0.0)
    distance = max((c.shift for c in moved), default=0.0)
    unit = exact.units.get("length", "")
    meant = []
    if angle > EXACT:
        meant.append(f"directions accurate to {np.degrees(angle):.2g} deg")
    if distance > EXACT * exact.changes.L:
        meant.append(f"distances {'' if meant else 'accurate '}to {distance:.2g} {unit}".rstrip())
    kind = kind_of(closed_start(exact).S[:, :, 0]).name
    moves = f"moves (mobility {mobility})" if mobility else "is a structure (mobility 0)"
    off = {"planar": "off the normal", "spherical": "off the line through the center"}.get(kind, "off")
    # most pairs that are named
    misses = tuple(
        f"Axis of {c.pair}: {np.degrees(c.angle):.2g} deg {off}"
        if c.angle * exact.changes.L >= c.shift
        else f"{c.pair}: {c.shift:.2g} {unit}".rstrip() + " off"
        for c in sorted(moved, key=lambda c: -max(c.angle, c.shift / exact.changes.L))[:3]
    )
    advised = _rounded_up(max(tol, SAFE * exact.changes.largest))
    text = f"With {' and '.join(meant) or f'loops that close to {exact.changes.closure:.2g}'} the mechanism "
    text += f"{f'is {kind} and ' if kind else ''}{moves}. {'. '.join(misses)}{'. ' if misses else ''}"
    text += f"Pass tol={advised:g} to treat it as exact"
    return Rounding(advised, angle, distance, kind, mobility, misses, text + ".")


def _rounded_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(k * power for k in (1, 2, 5, 10) if k * power >= value * (1 - 1e-9)))


@dataclass(frozen=True, repr=False)
class Finding:
    """One finding, in words and by name; ``axis`` is (point, direction) in the global frame where there is one."""

    text: str
    freedoms: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.text!r})"


@dataclass(frozen=True, repr=False)
class PassiveFinding(Finding):
    """A passive freedom by ``name``: idle under the declared loads at rest here, or load-bearing (None: a load varies over positions).

    ``effort`` (of a ``unit``) is the couple, or for a slide the force, that would have to hold it; no part supplies that.
    """

    name: str = ""
    load_bearing: bool | None = False
    effort: float = 0.0
    unit: str = ""
    turns: bool = True

    @property
    def size(self) -> str:
        """The effort with its unit."""
        return f"{self.effort:.4g} {self.unit}".rstrip()


@dataclass(frozen=True)
class LoopData:
    """One loop taken alone: ``steps`` (pair, sign), ``chain`` of links and pairs, freedoms, rank and excess of its six equations."""

    steps: tuple[tuple[str, int], ...]
    chain: str
    pairs: tuple[str, ...]
    freedoms: int
    rank: int | None
    excess: int | None


def loop_facts(
    m: Mechanism, loops: tuple[tuple[tuple[str, int], ...], ...], position: Position | None
) -> tuple[LoopData, ...]:
    """The facts of every loop taken alone; ranks where there is geometry."""
    ends = {p.name: (p.a, p.b) for p in m.pairs}
    freedom_count = {p.name: p.type.f for p in m.pairs}
    out = []
    for i, loop in enumerate(loops):
        chain = ends[loop[0][0]][0 if loop[0][1] > 0 else 1]
        for name, sign in loop:
            chain += f" -{name}- {ends[name][1 if sign > 0 else 0]}"
        rank = None
        if position is not None:
            columns, _ = position.declared.system.loop_columns[i]
            rank = rank_of(singular_values(position.rows.S[:, columns]))
        pairs = tuple(name for name, _ in loop)
        freedoms = sum(freedom_count[p] for p in pairs)
        out.append(
            LoopData(
                loop,
                chain,
                pairs,
                freedoms,
                rank,
                None if position is None or rank is None else position.graph.width - rank,
            )
        )
    return tuple(out)


# --- passive and locked freedoms ------------------------------------------------------------------------------------------


def vector(values: tuple[float, ...]) -> str:
    """A point or direction for people: four digits, no negative zero."""
    return f"({', '.join(f'{0.0 if abs(v) < 1e-9 else v:.4g}' for v in values)})"


def screw_axis(system: System, twist: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A point and the direction of the axis of a twist (of the slide where it does not turn), in the global frame."""
    w, v = twist[:3], twist[3:]
    point: Array
    if np.linalg.norm(w) > 1e-9 * max(1.0, float(np.linalg.norm(v))):
        point, direction = np.cross(w, v) / (w @ w), w / np.linalg.norm(w)
    else:
        point, direction = np.zeros(3), v / np.linalg.norm(v)
    par = system.par
    return tuple((par.L * point + par.origin).tolist()), tuple(direction.tolist())


def passive_findings(system: System, x: Array, passive: tuple[PassiveMotion, ...]) -> tuple[PassiveFinding, ...]:
    """Passive freedoms at a state ``x (nx,)``: which links move, how, between which pairs, and whether the declared loads move them."""
    if not passive:
        return ()
    m = system.m
    q = system.coordinates_of(x[:, None], system.start_coordinates(m.start))
    held = hold_at_rest(Configuration(system, x[:, None]), q, m.loads, passive)
    out = []
    for i, (motion, name) in enumerate(zip(passive, hold_names(m, passive), strict=True)):
        unit = unit_of(m.units, (2 if motion.turns else 1, 1, -2))
        bearing = None if held is None else not is_idle(held[0][i], held[1][i])
        scale = system.par.L ** (2 if motion.turns else 1)
        effort = abs(float(held[0][i, 0])) * scale if held is not None and bearing else 0.0
        found = PassiveFinding("", (), (), None, name, bearing, effort, unit, motion.turns)
        out.append(_passive_finding(system, motion, found))
    return tuple(out)


def _passive_finding(system: System, motion: PassiveMotion, found: PassiveFinding) -> PassiveFinding:
    m = system.m
    names = m.link_names()
    links = tuple(names[i] for i in motion.links)
    freedoms = tuple(n for n, r in zip(m.freedom_names(), motion.rates, strict=True) if abs(r) > MOTIONS.still)
    pairs = [p for p in m.pairs if any(n in freedoms for n in p.freedom_names)]
    axis = screw_axis(system, motion.twist)
    one = len(links) == 1
    line = f"the line {'-'.join(p.name for p in pairs)} ({'-'.join(p.type.symbol for p in pairs)})"
    if motion.turns:
        how = f"turn{'s' if one else ''} about {line}, through {vector(axis[0])} along {vector(axis[1])}"
    else:
        how = f"slide{'s' if one else ''} along {vector(axis[1])} in the pairs {', '.join(p.name for p in pairs)}"
    together = "" if one else " together"
    what = "couple" if motion.turns else "force"
    load = {
        True: f"load-bearing, only a {what} of {found.size} that no part supplies would hold it",
        False: "carries no load",
        None: "the loads on it vary over positions, see the warnings of a solution",
    }[found.load_bearing]
    text = f"{' and '.join(links)} {how}{together}: {load}, moves no other link"
    return replace(found, text=text, freedoms=freedoms, links=links, axis=axis)


def locked(freedoms: Freedoms, null_nearby: Array | None) -> tuple[Finding, ...]:
    """Freedoms that cannot move here, grouped by the reason; those that move in the motions ``null_nearby`` stand still only here."""
    names = freedoms.position.m.freedom_names()
    still = np.abs(freedoms.null).max(axis=1, initial=0.0) < MOTIONS.still
    only_here = still & moves_nearby(null_nearby, len(names))
    left = {int(i) for i in np.flatnonzero(still & ~only_here)}
    out = []
    for turning, why in _locked_turns(freedoms.position, left):
        out.append(_still(names, turning, f"still: {why}"))
        left -= set(turning)
    if left:
        why = "the closure equations leave it no rate" if freedoms.mobility else "the mechanism is a structure here"
        out.append(_still(names, sorted(left), f"still: {why}"))
    resting = np.flatnonzero(only_here).tolist()
    if resting:
        why = "it moves in nearby positions" if len(resting) == 1 else "they move in nearby positions"
        out.append(_still(names, resting, f"still in this position only: {why}"))
    return tuple(out)


def _still(names: tuple[str, ...], columns: list[int], how: str) -> Finding:
    group = tuple(names[c] for c in columns)
    return Finding(f"{', '.join(group)} {'stands' if len(group) == 1 else 'stand'} {how}", group)


def _locked_turns(position: Position, still: set[int]) -> list[tuple[list[int], str]]:
    """The turns of loops in which none can turn, as their directions are independent; and why."""
    turns = np.array([f.turns for p in position.m.pairs for f in p.type.freedoms], dtype=bool)
    reasons = {
        1: "it is the only turn of its loop",
        2: "no other turn in the loop, and their axes are not parallel",
        3: "no other turn in the loop, and their axes form a rigid spherical triangle",
    }
    out, taken = [], set[int]()
    for columns, _ in position.declared.system.loop_columns:
        turning = columns[turns[columns]].tolist()
        if 0 < len(turning) <= 3 and set(turning) <= still - taken:
            if np.linalg.matrix_rank(position.rows.S[:3, turning], tol=1e-9) == len(turning):
                out.append((turning, reasons[len(turning)]))
                taken |= set(turning)
    return out


def moves_nearby(null_nearby: Array | None, count: int) -> NDArray[np.bool_]:
    """Which of ``count`` freedoms move in the motions ``(F, M)`` of a nearby position; none where that is not known."""
    if null_nearby is None:
        return np.zeros(count, dtype=bool)
    return np.asarray(np.abs(null_nearby).max(axis=1, initial=0.0) > MOTIONS.nearby)


# --- drivers ----------------------------------------------------------------------------------------------------------------


def left_free(freedoms: Freedoms) -> tuple[Finding, ...]:
    """Motions that are neither driven nor passive: the freedoms that move in each, those that could be driven first."""
    single = {name for _, name in single_freedoms(freedoms.position.m)} if freedoms.undriven else set()
    out = []
    for motion in freedoms.undriven:
        names = sorted(motion.names, key=lambda n: n not in single)
        shown = ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")
        out.append(Finding(f"{shown} {'moves' if len(names) == 1 else 'move together'}", motion.names))
    return tuple(out)


def drivable(freedoms: Freedoms) -> tuple[Finding, ...]:
    """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions."""
    moves = np.abs(freedoms.inputs).max(axis=1, initial=0.0) > MOTIONS.still
    return tuple(Finding(f"{n} can drive", (n,)) for i, n in single_freedoms(freedoms.position.m) if moves[i])


def not_drivable(freedoms: Freedoms, able: tuple[Finding, ...], null_nearby: Array | None) -> tuple[Finding, ...]:
    """Single freedoms that cannot drive here, with the reason: a dead point, locked, or moving only passively."""
    good = {name for finding in able for name in finding.freedoms}
    still = np.abs(freedoms.null).max(axis=1, initial=0.0) < MOTIONS.still
    nearby = moves_nearby(null_nearby, len(still))
    out = []
    for i, name in single_freedoms(freedoms.position.m):
        if name in good:
            continue
        why = "moves only in a passive motion"
        if still[i]:
            dead = nearby[i] and freedoms.mobility
            why = "dead point here (moves in nearby positions)" if dead else "stands still"
        out.append(Finding(f"{name} is not a valid driver: {why}", (name,)))
    return tuple(out)


def completing(freedoms: Freedoms, able: NDArray[np.bool_]) -> list[int]:
    """Columns among those ``able (F,)`` that complete the drivers: free of passive motions and at the frame first, independent.

    A driver on a freedom that also moves in a passive motion would stop that motion and leave another one undriven.
    """
    rest, _ = np.linalg.qr(np.stack([f.rates for f in freedoms.undriven], axis=1))
    order = [i for i in drive_order(freedoms.position.m, freedoms.passive) if able[i]]
    return independent_rows(rest, order, rest.shape[1])


def proportional(freedoms: Freedoms, able: tuple[Finding, ...]) -> tuple[tuple[str, ...], ...]:
    """Sets of freedoms of which only one can be driven, as they move in proportion."""
    column = {name: i for i, name in single_freedoms(freedoms.position.m)}
    names = [name for finding in able for name in finding.freedoms]
    # number of input freedoms above which freedoms that move in proportion are not sought
    if not names or freedoms.inputs.shape[1] > 200:
        return ()
    rows = freedoms.inputs[[column[n] for n in names]]
    size = np.linalg.norm(rows, axis=1)
    rows = rows / size[:, None]
    first: list[int] = []
    groups: list[list[str]] = []
    for i, name in enumerate(names):
        sine = np.sqrt(np.maximum(1.0 - (rows[first] @ rows[i]) ** 2, 0.0))
        alike = np.flatnonzero(sine < MOTIONS.proportional + MOTIONS.error / np.minimum(size[first], size[i]))
        if alike.size:
            groups[int(alike[0])].append(name)
        else:
            first.append(i)
            groups.append([name])
    return tuple(tuple(g) for g in groups if len(g) > 1)


@dataclass(frozen=True, repr=False)
class Advice(Finding):
    """What would help, in words (``text``; ``brief`` with parts that can be bought or made), and as a changed mechanism: ``apply()``.

    ``effect`` is the computed effect of changes of pairs and couplings; without one the drivers ``freedoms`` are meant, in place of
    those ``replaced``.
    """

    effect: Effect | None = None
    replaced: tuple[str, ...] = ()
    mechanism: Mechanism = field(kw_only=True, repr=False)

    @property
    def brief(self) -> str:
        """The advice in the words of a workshop, with what it does."""
        return self.text if self.effect is None else f"{exchanges(self.effect)}: {consequence(self.effect)}"

    def patch(self) -> list[dict[str, Any]]:
        """The change as a JSON Patch (RFC 6902) of what a file holds, ``mechgraph.load`` of which gives the same as ``apply()``."""
        return patch(to_data(self.mechanism), to_data(self.apply()))

    def apply(self) -> Mechanism:
        """The changed mechanism, at the position of the report; without the friction of a pair that changes."""
        m = self.mechanism
        if self.effect is None:
            kept = [d for d in m.drives if m.full_name(d.freedom) not in self.replaced]
            return m.replace(drives=[*kept, *self.freedoms])
        for (name, old, new), turn in zip(self.effect.changes, self.effect.turns, strict=True):
            if new == LEFT_OUT:
                m = m.replace(couplings=[c for c in m.couplings if c.name != name])
                continue
            if old == RIGID:
                m = with_spline(m, name)
                continue
            m = m.replace(loads=[load for load in m.loads if not (isinstance(load, Friction) and load.of == name)])
            m = m.with_pair_type(name, new)
            if turn:
                m = m.replace(pairs=[_turned(p, np.radians(turn)) if p.name == name else p for p in m.pairs])
        return m


def driving_advice(m: Mechanism, names: tuple[str, ...], replaced: tuple[str, ...], beside: bool) -> tuple[Advice, ...]:
    """The advice to drive ``names``, in place of the drivers ``replaced``; ``beside`` a change point."""
    if not names:
        return ()
    also = "also " if m.drives and not replaced else ""
    instead = f" instead of {', '.join(replaced)}" if replaced else ""
    where = " beside the change point" if beside else ""
    text = f"drive {also}{', '.join(names)}{instead}: then every freedom is driven or passive{where}"
    return (Advice(text, names, replaced=replaced, mechanism=m),)


def exchanges(effect: Effect, names: Iterable[str] = ()) -> str:
    """Changes by their parts: ``floating bearing (R -> C) at A, ball joint ... (R -> S) at B``; ``names`` are others to choose among."""
    others = list(names)
    in_cylinders = {name for three in effect.cylinders for name in three}
    slides = [slide for _, slide, _ in effect.cylinders]
    parts = [f"cylinder{'s' * (len(slides) > 1)} {joined(slides)} between ball joints (S-C-S)"] if slides else []
    at: dict[tuple[str, str], list[str]] = {}
    for name, old, new in effect.changes:
        if name not in in_cylinders:
            at.setdefault((old, new), []).append(name)
    for (old, new), mine in at.items():
        where = joined([*mine, *others], "or" if others else "and")
        parts.append(WHOLE[old].format(where) if old in WHOLE else f"{exchange(old, TABLE[new])} at {where}")
    return ", ".join(parts)


def consequence(effect: Effect) -> str:
    """What changes: ``redundancy 3 -> 0``."""
    values = {"redundancy": effect.redundancy, "mobility": effect.mobility, "passive freedoms": effect.passive}
    return ", ".join(f"{name} {old} -> {new}" for name, (old, new) in values.items() if old != new)


def alternatives(advice: Iterable[Advice]) -> list[str]:
    """Advice in brief, changes of one kind and effect together: ``2-3: ... at A or B: redundancy 3 -> 1``."""
    first: dict[tuple[Any, ...], Effect] = {}
    others: dict[tuple[Any, ...], list[str]] = {}
    numbers: dict[tuple[Any, ...], list[int]] = {}
    for number, e in enumerate(a.effect for a in advice):
        if e is not None:
            key = (tuple(sorted(change[1:] for change in e.changes)), consequence(e))
            if key in first:
                others.setdefault(key, []).append(joined([change[0] for change in e.changes]))
            numbers.setdefault(key, []).append(number)
            first.setdefault(key, e)
    out = []
    for key, e in first.items():
        also, several = others.get(key, []), len(e.changes) > 1
        text = exchanges(e, () if several else also)
        if also and several:  # sets by all their places
            text += f" (or at {joined(also, 'or')})" if len(also) < 3 else f" (or at {len(also)} other sets of places)"
        out.append(f"{_ranged(numbers[key])}: {text}: {consequence(e)}")
    return out


def _ranged(numbers: Sequence[int]) -> str:
    """Rising numbers: ``2-4`` where none is left out, else ``2, 4``."""
    whole = 1 < len(numbers) == numbers[-1] - numbers[0] + 1
    return f"{numbers[0]}-{numbers[-1]}" if whole else ", ".join(map(str, numbers))


def _turned(pair: Pair, angle: float) -> Pair:
    """A pair with the second directions of its markers turned about the axis."""

    def second(of: Marker | Pair) -> Array:
        axis = np.asarray(of.axis) / np.linalg.norm(of.axis)
        return rotation_exp(angle * axis) @ np.asarray(of.second)

    if pair.on_a is None or pair.on_b is None:
        return pair.replace(second=second(pair))
    a, b = (Marker(side.point, side.axis, second(side)) for side in (pair.on_a, pair.on_b))
    return pair.replace(on_a=a, on_b=b)


def variants(m: Mechanism, freedoms: Freedoms, driven: Index, engine: EngineName, most: int | None) -> Iterator[Advice]:
    """Sets of up to ``most`` wider pairs that leave no redundancy and the mobility as it is, each as an advice."""
    for chosen in self_aligning_sets(changes_of(freedoms), freedoms.redundancy, most):
        e = effect(freedoms, driven, chosen, engine)
        if e.redundancy[1] == 0 and e.mobility[1] == e.mobility[0]:
            yield Advice(e.text, tuple(item for item, *_ in e.changes), effect=e, mechanism=m)
