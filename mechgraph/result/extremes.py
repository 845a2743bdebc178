"""Extremes over the solved positions, of all pairs and freedoms together, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.values import Mask, Values

TIE = 1e-9
"""Relative difference below which two values share the extreme; the first position is named."""


class Greatest:
    """The greatest values ``best (n,)`` of some rows, and the flat places ``at (n,)`` at which they are reached first."""

    def __init__(self, count: int) -> None:
        self.best, self.at = np.full(count, -np.inf), np.zeros(count, dtype=np.intp)

    def look(self, values: Array, places: Index) -> None:
        """Take note of values ``(n, T)`` at places that follow those seen so far; NaN counts for nothing."""
        values = np.where(np.isnan(values), -np.inf, values)
        high = values.max(axis=1)
        room = TIE * np.abs(values).max(axis=1, where=np.isfinite(values), initial=0.0)
        first = np.argmax(values >= (high - room)[:, None], axis=1)
        better = high > self.best + room
        self.best = np.where(better, high, self.best)
        self.at = np.where(better, places[first], self.at)


class Range:
    """Least (as greatest of what is turned round) and greatest values of some rows, and which rows are not unique somewhere."""

    def __init__(self, count: int) -> None:
        self.low, self.high, self.loose = Greatest(count), Greatest(count), np.zeros(count, dtype=bool)

    def look(self, values: Array, places: Index, loose: Mask | None = None) -> None:
        """Take note of values ``(n, T)``."""
        self.high.look(values, places)
        self.low.look(-values, places)
        if loose is not None:
            self.loose |= loose.any(axis=1)

    @property
    def size(self) -> Array:
        """Greatest size of every row."""
        return np.asarray(np.maximum(self.high.best, self.low.best))


@dataclass(frozen=True)
class Reactions:
    """Greatest ``force`` and ``moment`` of the reaction of every pair, and where they are ``loose``, not unique.

    There they are those of the components alone that are ``kept`` as unique ``(2, 6, P)``, unless values of least norm stand for all.
    ``touched (6, P)`` are the components, in the order of the pair table, that are not unique somewhere.
    """

    force: Greatest
    moment: Greatest
    loose: Mask
    kept: Mask
    touched: Mask


def multipliers(values: Values) -> Range:
    """Ranges of the multipliers of all couplings."""
    found, loose = values.multipliers()
    out = Range(len(found))
    if len(found):
        out.look(found, np.arange(found.shape[1]), loose)
    return out


def efforts(values: Values) -> tuple[Range, Range]:
    """Ranges of own and of applied efforts of all freedoms."""
    own, applied = (Range(len(values.whole.freedom_names())) for _ in range(2))
    for places in values.blocks():
        mine, given, loose = values.efforts_at(places)
        own.look(mine, places, loose)
        applied.look(given, places)
    return own, applied


def reactions(values: Values) -> Reactions:
    """The greatest reactions of all pairs."""
    P = len(values.whole.pairs)
    force, moment, loose = Greatest(P), Greatest(P), np.zeros((2, P), dtype=bool)
    for places in values.blocks():
        wrenches, open_ = values.reactions_at(places)
        moment.look(np.linalg.norm(wrenches[:3], axis=0), places)
        force.look(np.linalg.norm(wrenches[3:], axis=0), places)
        loose |= np.stack([open_[3:].any(axis=(0, 2)), open_[:3].any(axis=(0, 2))])
    kept, touched = np.zeros((2, 6, P), dtype=bool), np.zeros((6, P), dtype=bool)
    if loose.any():
        found, touched = _of_what_is_unique(values)
        if not values.least_norm:
            kept = _kept(values.whole, touched)
            for one, whole, open_ in zip(found, (force, moment), loose, strict=True):
                whole.best, whole.at = np.where(open_, one.best, whole.best), np.where(open_, one.at, whole.at)
    return Reactions(force, moment, loose, kept, touched)


def _of_what_is_unique(values: Values) -> tuple[tuple[Greatest, Greatest], Mask]:
    """The greatest forces and moments of the components that are unique everywhere, and which are not.

    Where a block shows another one that is not, all is begun again without it; nearly always the first one shows them all.
    """
    P = len(values.whole.pairs)
    touched = np.zeros((6, P), dtype=bool)
    while True:
        found, kept = (Greatest(P), Greatest(P)), _kept(values.whole, touched)
        for places in values.blocks():
            components, loose = values.components_at(places)
            here = loose.any(axis=2)
            if (here & ~touched).any():
                touched |= here
                break
            for one, mine in zip(found, kept, strict=True):
                one.look(np.sqrt((np.where(mine[:, :, None], components, 0.0) ** 2).sum(axis=0)), places)
        else:
            return found, touched


def _kept(m: Mechanism, touched: Mask) -> Mask:
    """Which components are forces and which are moments, those that are ``touched`` left out."""
    kinds = _kinds(m)
    return np.stack([(kinds == kind) & ~touched for kind in (0, 1)])


def _kinds(m: Mechanism) -> Array:
    """``(6, P)``: 0 for a component that is a force, 1 for a couple, -1 where a pair has none or they mix both."""
    columns = {id(p.type): [int(c.is_couple) for c in p.type.reactions or ()] for p in m.pairs}
    out = np.full((6, len(m.pairs)), -1)
    for k, pair in enumerate(m.pairs):
        mine = columns[id(pair.type)]
        out[: len(mine), k] = mine
    return out
