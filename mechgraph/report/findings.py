"""Findings in words and by name: passive and locked freedoms, drivers, loops, with their geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.structure.mobility import Freedoms
from mechgraph.structure.passive import PassiveMotion


@dataclass(frozen=True)
class Finding:
    """One finding, in words and by name; ``axis`` is (point, direction) in the global frame where there is one."""

    text: str
    freedoms: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class LoopFact:
    """One loop: its chain of links and pairs, freedoms, rank and excess of its own six equations."""

    chain: str
    pairs: tuple[str, ...]
    freedoms: int
    rank: int | None
    excess: int | None


def loop_facts(
    m: Mechanism, loops: tuple[tuple[tuple[str, int], ...], ...], system: System | None, x: Array | None
) -> tuple[LoopFact, ...]:
    """The facts of every loop taken alone; ranks where there is geometry."""
    ends = {p.name: (p.a, p.b) for p in m.pairs}
    freedom_count = {p.name: p.type.f for p in m.pairs}
    S = Configuration(system, x[:, None]).S[:, :, 0] if system is not None and x is not None else None
    out = []
    for i, loop in enumerate(loops):
        chain = ends[loop[0][0]][0 if loop[0][1] > 0 else 1]
        for name, sign in loop:
            chain += f" -{name}- {ends[name][1 if sign > 0 else 0]}"
        rank = None
        if system is not None and S is not None:
            rank = rank_of(singular_values(S[:, system.loop_columns[i][0]]))
        pairs = tuple(name for name, _ in loop)
        out.append(
            LoopFact(chain, pairs, sum(freedom_count[p] for p in pairs), rank, None if rank is None else 6 - rank)
        )
    return tuple(out)


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


def passive_finding(system: System, motion: PassiveMotion) -> Finding:
    """A passive freedom: which links move, how, between which pairs."""
    m = system.m
    names = m.link_names()
    links = tuple(names[i] for i in motion.links)
    freedoms = tuple(n for n, r in zip(m.freedom_names(), motion.rates, strict=True) if abs(r) > MOTIONS.still)
    pairs = [p for p in m.pairs if any(n in freedoms for n in p.freedom_names)]
    axis = screw_axis(system, motion.twist)
    turning = bool(np.linalg.norm(motion.twist[:3]) > 1e-9)
    one = len(links) == 1
    line = f"the line {'-'.join(p.name for p in pairs)} ({'-'.join(p.type.symbol for p in pairs)})"
    if turning:
        how = f"turn{'s' if one else ''} about {line}, through {vector(axis[0])} along {vector(axis[1])}"
    else:
        how = f"slide{'s' if one else ''} along {vector(axis[1])} in the pairs {', '.join(p.name for p in pairs)}"
    together = "" if one else " together"
    return Finding(
        f"{' and '.join(links)} {how}{together}: carries no load, moves no other link", freedoms, links, axis
    )


def locked_findings(system: System, x: Array, freedoms: Freedoms, null_nearby: Array | None) -> tuple[Finding, ...]:
    """Freedoms that cannot move here, grouped by the reason; those that move in the motions ``null_nearby`` stand still only here."""
    m = system.m
    still = np.abs(freedoms.null).max(axis=1, initial=0.0) < MOTIONS.still
    names = m.freedom_names()
    rests = still & moves_nearby(null_nearby, len(names))
    left = {names[i]: i for i in np.flatnonzero(still & ~rests)}
    S = Configuration(system, x[:, None]).S[:, :, 0]
    turns = np.array([f.turns for p in m.pairs for f in p.type.freedoms], dtype=bool)
    out = []
    for columns, _ in system.loop_columns:
        turning = [int(c) for c in columns if turns[c]]
        if not turning or any(names[c] not in left for c in turning):
            continue
        rank = int(np.linalg.matrix_rank(S[:3, turning], tol=1e-9))
        if rank < len(turning):
            continue
        why = {1: "it is the only turn of its loop", 2: "their axes are not parallel"}.get(
            rank, "their axes form a rigid spherical triangle"
        )
        group = tuple(names[c] for c in turning)
        for name in group:
            left.pop(name)
        verb = "stands" if len(group) == 1 else "stand"
        out.append(
            Finding(
                f"{', '.join(group)} {verb} still: no other turn in the loop, and {why}"
                if rank > 1
                else f"{group[0]} stands still: {why}",
                group,
            )
        )
    mobile = freedoms.mobility > 0
    rest = tuple(left)
    if rest:
        verb = "stands" if len(rest) == 1 else "stand"
        why = "the closure equations leave it no rate" if mobile else "the mechanism is a structure here"
        out.append(Finding(f"{', '.join(rest)} {verb} still: {why}", rest))
    resting = tuple(names[i] for i in np.flatnonzero(rests))
    if resting:
        verb, pronoun = ("stands", "it moves") if len(resting) == 1 else ("stand", "they move")
        out.append(
            Finding(f"{', '.join(resting)} {verb} still in this position only: {pronoun} in nearby positions", resting)
        )
    return tuple(out)


def moves_nearby(null_nearby: Array | None, count: int) -> NDArray[np.bool_]:
    """Which of ``count`` freedoms move in the motions ``(F, M)`` of a nearby position; none where that is not known."""
    if null_nearby is None:
        return np.zeros(count, dtype=bool)
    return np.asarray(np.abs(null_nearby).max(axis=1, initial=0.0) > MOTIONS.nearby)


def input_motions(freedoms: Freedoms, null: Array) -> Array:
    """Motions without their passive part."""
    if not freedoms.passive:
        return null
    P, _ = np.linalg.qr(np.stack([p.rates for p in freedoms.passive], axis=1))
    return np.asarray(null - P @ (P.T @ null))
