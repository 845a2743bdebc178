"""Advice that can be applied: drivers to add or to exchange, and changes of pairs and couplings with their computed effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, rotation_exp
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.pair_table import TABLE
from mechgraph.report.findings import Finding
from mechgraph.report.words import exchange, joined
from mechgraph.structure.pair_changes import LEFT_OUT, Effect


@dataclass(frozen=True)
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
        return self.text if self.effect is None else f"{exchanges(self.effect.changes)}: {consequence(self.effect)}"

    def apply(self) -> Mechanism:
        """The changed mechanism, at the position of the report."""
        m = self.mechanism
        if self.effect is None:
            kept = [d for d in m.drives if m.full_name(d.freedom) not in self.replaced]
            return m.replace(drives=[*kept, *self.freedoms])
        for (name, _, new), turn in zip(self.effect.changes, self.effect.turns, strict=True):
            if new == LEFT_OUT:
                m = m.replace(couplings=[c for c in m.couplings if c.name != name])
                continue
            m = m.with_pair_type(name, new)
            if turn:
                m = m.replace(pairs=[_turned(p, np.radians(turn)) if p.name == name else p for p in m.pairs])
        return m


def exchanges(changes: Iterable[tuple[str, str, str]], word: str = "and") -> str:
    """Changes (pair, old type, new type) by their parts: ``floating bearing (R -> C) at A, ball joint or ... (R -> S) at B``."""
    at: dict[tuple[str, str], list[str]] = {}
    for name, old, new in changes:
        at.setdefault((old, new), []).append(name)
    return ", ".join(
        f"coupling {joined(names, word)} left out"
        if new == LEFT_OUT
        else f"{exchange(old, TABLE[new])} at {joined(names, word)}"
        for (old, new), names in at.items()
    )


def consequence(effect: Effect) -> str:
    """What changes: ``redundancy 3 -> 0``."""
    values = {"redundancy": effect.redundancy, "mobility": effect.mobility, "passive freedoms": effect.passive}
    return ", ".join(f"{name} {old} -> {new}" for name, (old, new) in values.items() if old != new)


def alternatives(advice: Iterable[Advice]) -> list[str]:
    """Advice in brief, single changes of one kind with the same effect together: ``... (R -> S) at A or B: redundancy 3 -> 1``."""
    found: dict[tuple[Any, ...], list[tuple[str, str, str]]] = {}
    for a in advice:
        if a.effect is not None:
            key = (tuple(sorted(change[1:] for change in a.effect.changes)), consequence(a.effect))
            if key not in found or len(a.effect.changes) == 1:
                found.setdefault(key, []).extend(a.effect.changes)
    return [
        f"{exchanges(changes, 'or' if len(kinds) == 1 else 'and')}: {does}" for (kinds, does), changes in found.items()
    ]


def _turned(pair: Pair, angle: float) -> Pair:
    """A pair with the second directions of its markers turned about the axis."""

    def second(of: Marker | Pair) -> Array:
        axis = np.asarray(of.axis) / np.linalg.norm(of.axis)
        return rotation_exp(angle * axis) @ np.asarray(of.second)

    if pair.on_a is None or pair.on_b is None:
        return pair.replace(second=second(pair))
    a, b = (Marker(side.point, side.axis, second(side)) for side in (pair.on_a, pair.on_b))
    return pair.replace(on_a=a, on_b=b)
