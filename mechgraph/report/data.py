"""The facts of a determinacy report as plain data, and the JSON Schema of these."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from mechgraph.data import Json, members, plain, schema_of
from mechgraph.equations.terms import Ledger
from mechgraph.report.facts import Facts
from mechgraph.report.sentences import verdict


@dataclass(frozen=True)
class LoopData:
    """One loop taken alone: ``steps`` (pair, sign), ``chain`` of links and pairs, freedoms, rank and excess of its six equations."""

    steps: tuple[tuple[str, int], ...]
    chain: str
    pairs: tuple[str, ...]
    freedoms: int
    rank: int | None
    excess: int | None


@dataclass(frozen=True)
class LedgerData:
    """Unknowns and equations in one bookkeeping; ``by_kind``: count, unknowns and equations of pair symbols, couplings, drivers, links."""

    unknowns: int
    equations: int
    balance: int
    by_kind: Mapping[str, tuple[int, int, int]]


@dataclass(frozen=True)
class KindData:
    """``name`` "planar", "spherical" or ""; ``place``: unit normal (``is_direction``) or centre; ``by_pairs``: all pairs are of it."""

    name: str
    is_direction: bool
    place: tuple[float, ...]
    by_pairs: bool


@dataclass(frozen=True)
class AdviceData:
    """What would help, in words (``brief``: those of a workshop), and the freedoms and links that are meant."""

    text: str
    freedoms: tuple[str, ...]
    links: tuple[str, ...]
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None
    brief: str


@dataclass(frozen=True)
class DirectionData:
    """Force or moment (``kind``) of a pair that is unique along (or ``across``) a direction of its marker; ``in_space`` the global one."""

    text: str
    pair: str
    kind: str
    direction: tuple[float, ...]
    across: bool
    in_space: tuple[float, ...]


def _like(record: type, value: Any, **more: Any) -> Any:
    """A record with the attributes of a value."""
    return record(**{f.name: getattr(value, f.name) for f in fields(record) if f.name not in more}, **more)


def _ledger(book: Ledger) -> LedgerData:
    kinds = {kind: (row.count, row.unknowns, row.equations) for kind, row in book.by_kind.items()}
    return LedgerData(book.unknowns, book.equations, book.balance, kinds)


class _Fact(NamedTuple):
    """A fact whose plain data are not those of the attribute of its name: their type, what they are, and how they are made."""

    type: Any
    words: str
    of: Callable[[Facts], Any]


OTHER: dict[str, _Fact] = {
    "mechanism": _Fact(str, "Name of the mechanism.", lambda r: r.mechanism.name),
    "verdict": _Fact(str, "The verdict in one sentence.", verdict),
    "note": _Fact(str, "Why facts that need geometry are missing; empty where they are not.", lambda r: r.note),
    "loops": _Fact(
        tuple[LoopData, ...],
        "Independent loops.",
        lambda r: [_like(LoopData, fact, steps=loop) for loop, fact in zip(r.loops, r.loop_facts, strict=True)],
    ),
    "ledger": _Fact(
        Mapping[str, LedgerData],
        "Unknowns against equations in both bookkeepings.",
        lambda r: {name: _ledger(r.ledger(name)) for name in ("lee", "minimal")},
    ),
    "kind": _Fact(KindData, "The kind of the mechanism.", lambda r: _like(KindData, r.kind)),
    "loop_kinds": _Fact(
        tuple[str, ...], "The kind of every loop by its pairs.", lambda r: [kind.name for kind in r.loop_kinds]
    ),
    "advice": _Fact(
        tuple[AdviceData, ...], "What would help, the best first.", lambda r: [_like(AdviceData, a) for a in r.advice]
    ),
    "self_stress_count": _Fact(
        int | None,
        "Number of self-stresses with the drivers in place.",
        lambda r: r.reactions.count if r.reactions else None,
    ),
    "unique_directions": _Fact(
        tuple[DirectionData, ...],
        "Directions in which forces or moments are unique though their components are not.",
        lambda r: [_like(DirectionData, d) for d in r.reactions.unique_directions] if r.reactions else [],
    ),
    "combinations": _Fact(
        tuple[tuple[int, str], ...],
        "Sums of components that are unique though their terms are not, with the number of their group.",
        lambda r: r.reactions.combinations if r.reactions else [],
    ),
    "groups_without_combinations": _Fact(
        int,
        "Groups of so many components that such sums were not sought.",
        lambda r: r.reactions.unsought if r.reactions else 0,
    ),
}


def to_dict(r: Facts, keys: Iterable[str]) -> Json:
    """Facts as plain data."""
    return {key: plain(OTHER[key].of(r) if key in OTHER else getattr(r, key)) for key in keys}


def schemas(keys: Iterable[str], defs: Json) -> Json:
    """The JSON Schemas of facts by key; those of records go to ``defs``."""
    out = {}
    for key in keys:
        if key in OTHER:
            out[key] = {"description": OTHER[key].words, **schema_of(OTHER[key].type, defs)}
        else:
            out |= members(Facts, [key], defs)
    return out
