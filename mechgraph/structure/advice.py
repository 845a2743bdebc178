"""Advice: the changes worth making, with their computed effect. Those that can be built come first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from time import monotonic
from typing import TypeVar

import numpy as np

from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import EngineName
from mechgraph.structure.change_sets import CYLINDER, between_balls, cylinders, mixed, relieving, spread
from mechgraph.structure.mobility import Freedoms
from mechgraph.structure.pair_changes import CHANGES_SHOWN, PLANE, Effect, changes_of, effect
from mechgraph.structure.self_aligning import self_aligning_sets
from mechgraph.structure.splines import splines

Item = TypeVar("Item")

SPLINE = 1
"""How hard a spline is to build (see ``pair_changes.EFFORTS``)."""
FREEING = 3
"""Changes reported that let a structure move."""
FEW_CHANGES, LARGEST_SET = 80, 3
"""Changes up to which the best of all sets of so many heads the advice, some hundredths of a second; of more, the best of a beam."""


def advice(
    freedoms: Freedoms, driven: Index, finite_mobility: int, engine: EngineName = "auto", until: float = np.inf
) -> tuple[Effect, ...]:
    """Changes worth making: those that remove redundancy without adding input freedoms; for a structure, those that free it.

    At the time ``until`` (of ``time.monotonic``) those whose effect is known by then.
    """
    position, changes = freedoms.position, changes_of(freedoms)
    effects: list[Effect] = []
    if not (freedoms.mobility - len(freedoms.passive) and finite_mobility):
        wider = sorted((c for c in changes if c.added > c.relief), key=lambda c: (c.added, c.item))
        for plane in (False, True):
            some = spread([c for c in wider if (c.effort == PLANE) == plane])[:FREEING]
            freeing = [effect(freedoms, driven, (c,), engine) for c in timely(some, until)] if not effects else []
            effects += [e for e in freeing if e.inputs[1] > e.inputs[0]]
    if freedoms.redundancy:
        singles, complete = relieving(position, changes, freedoms.redundancy, until)
        found: list[tuple[int, Effect]] = []
        on_balls = between_balls(position, changes, freedoms.redundancy)
        best = (
            islice(self_aligning_sets(changes, freedoms.redundancy, LARGEST_SET), 1)
            if len(changes) <= FEW_CHANGES
            else ()
        )
        for chosen in timely(dict.fromkeys((*on_balls, *best, *mixed(complete), *singles)), until):
            new = effect(freedoms, driven, chosen, engine)
            if any(new == other for _, other in found):
                continue
            if new.inputs[1] == new.inputs[0] and new.redundancy[1] < new.redundancy[0] and new not in effects:
                found.append((max(c.effort for c in chosen), new))
        found += [(SPLINE, new) for new in timely(splines(freedoms, driven, engine), until)]
        found.sort(key=lambda item: (item[0] == PLANE, item[1].redundancy[1] > 0, item[0]))
        threes = [tuple(position.m.pairs[k].name for k in three) for three in cylinders(position)]
        effects += [replace(new, cylinders=_among(threes, new)) for _, new in found]
    return tuple(effects[: CHANGES_SHOWN + FREEING])


def timely(items: Iterable[Item], until: float) -> Iterator[Item]:
    """The items up to the time ``until`` (of ``time.monotonic``)."""
    for item in items:
        if monotonic() > until:
            return
        yield item


def _among(threes: list[tuple[str, ...]], effect: Effect) -> tuple[tuple[str, ...], ...]:
    """The cylinders all of whose pairs become those of one between balls."""
    made = {(name, new) for name, _, new in effect.changes}
    return tuple(three for three in threes if made.issuperset(zip(three, CYLINDER, strict=True)))
