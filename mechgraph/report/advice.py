"""Advice that can be applied: drivers to add or to exchange, and changes of pairs and couplings with their computed effect."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, rotation_exp
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import EngineName
from mechgraph.data import patch
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.pair_table import TABLE
from mechgraph.model.toml import to_data
from mechgraph.report.findings import Finding
from mechgraph.report.words import exchange, joined
from mechgraph.structure.mobility import Freedoms
from mechgraph.structure.pair_changes import LEFT_OUT, RIGID, WHOLE, Effect, changes_of, effect
from mechgraph.structure.self_aligning import self_aligning_sets
from mechgraph.structure.splines import with_spline


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
        """The changed mechanism, at the position of the report."""
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
    """Advice in brief, single changes of one kind with the same effect together: ``... (R -> S) at A or B: redundancy 3 -> 1``."""
    first: dict[tuple[Any, ...], Effect] = {}
    others: dict[tuple[Any, ...], list[str]] = {}
    for e in (a.effect for a in advice):
        if e is not None:
            key = (tuple(sorted(change[1:] for change in e.changes)), consequence(e))
            if key in first and len(e.changes) == 1:
                others.setdefault(key, []).append(e.changes[0][0])
            first.setdefault(key, e)
    return [f"{exchanges(e, others.get(key, ()))}: {consequence(e)}" for key, e in first.items()]


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
