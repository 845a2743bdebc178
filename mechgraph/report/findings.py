"""Findings in words and by name: passive and locked freedoms, what can drive and what cannot, loops, with their geometry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.force.passive_hold import hold_at_rest, hold_names, is_idle
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import independent_rows, rank_of, singular_values
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.structure.mobility import Freedoms, drive_order, single_freedoms
from mechgraph.structure.position import Position
from mechgraph.units import unit_of

NAMED = 8
"""Most freedoms named for one motion."""
MOST_INPUTS = 200
"""Number of input freedoms above which freedoms that move in proportion are not sought."""


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
class LoopFact:
    """One loop: its chain of links and pairs, freedoms, rank and excess of its own six equations."""

    chain: str
    pairs: tuple[str, ...]
    freedoms: int
    rank: int | None
    excess: int | None


def loop_facts(
    m: Mechanism, loops: tuple[tuple[tuple[str, int], ...], ...], position: Position | None
) -> tuple[LoopFact, ...]:
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
        out.append(LoopFact(chain, pairs, freedoms, rank, None if rank is None else 6 - rank))
    return tuple(out)


# --- passive and locked freedoms ------------------------------------------------------------------------------------------


def number(value: float) -> str:
    """A coordinate for people: four digits, no negative zero."""
    return f"{0.0 if abs(value) < 1e-9 else value:.4g}"


def vector(values: tuple[float, ...]) -> str:
    """A point or direction for people."""
    return f"({', '.join(number(v) for v in values)})"


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
        out.append(Finding(f"{name} cannot drive: {why}", (name,)))
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
    if not names or freedoms.inputs.shape[1] > MOST_INPUTS:
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
