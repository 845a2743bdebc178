"""What the summary of a solution tells, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mechgraph.result.contact_ranges import LiftOff, Overlap
from mechgraph.result.contacts import lift_offs, overlaps
from mechgraph.result.extremes import Greatest, Range, efforts, multipliers, reactions
from mechgraph.result.places import OK, Places, coupling_unit
from mechgraph.result.values import LoadBearing, PassedCrossing, Values
from mechgraph.units import unit_of

Index = Annotated[int, "number of the position, counted from 0 over all of them in order"]


@dataclass(frozen=True)
class At:
    """A value, and the first position at which it is reached: radians and the declared units."""

    value: float
    position: Index
    drivers: Annotated[Mapping[str, float | None], "the values of the drivers there, in radians or the unit of length"]


@dataclass(frozen=True)
class EffortRange:
    """The range of an effort over the positions; without values where it is not unique and nothing of least norm stands for it."""

    freedom: str
    unit: str
    unique: bool
    least: At | None
    greatest: At | None


@dataclass(frozen=True)
class MultiplierRange:
    """The range of the multiplier of a coupling over the positions, as that of an effort."""

    coupling: str
    unit: str
    unique: bool
    least: At | None
    greatest: At | None


@dataclass(frozen=True)
class ReactionSize:
    """The greatest force or moment of a reaction; where it is not unique as a whole that of ``parts``, or that of least norm."""

    unit: str
    unique: bool
    parts: Annotated[tuple[str, ...], "the components that the value contains, where these are not all"]
    greatest: At | None


@dataclass(frozen=True)
class ReactionData:
    """The reaction of a pair, of link ``of`` on link ``on``; the moment about the pair's own point on link ``on``."""

    pair: str
    type: str
    on: str
    of: Annotated[str, "the link that exerts it"]
    force: ReactionSize
    moment: ReactionSize
    not_unique: Annotated[tuple[str, ...], "components and efforts of the pair that are not unique somewhere"]


@dataclass(frozen=True)
class Unsolved:
    """A range of positions that were not solved, first to last, and why."""

    first: Index
    last: Index
    status: str


@dataclass(frozen=True)
class ChecksData:
    """The worst of every check over the positions; None where it was not made."""

    closure: float | None
    equilibrium: float | None
    power: float | None
    accuracy: Annotated[float | None, "estimated relative error of rates and forces"]


@dataclass(frozen=True)
class SolutionData:
    """What the summary of a solution tells, of all pairs."""

    mechanism: str
    units: Annotated[Mapping[str, str], "names of the units of length, mass and time, where they are declared"]
    positions: int
    solved: int
    not_solved: tuple[Unsolved, ...]
    drivers: Annotated[Mapping[str, tuple[float, float]], "least and greatest value, in radians or the unit of length"]
    least_norm: Annotated[bool, "values of least norm stand for what is not unique, an assumption"]
    efforts: Annotated[tuple[EffortRange, ...], "what the drives supply"]
    applied_efforts: Annotated[tuple[EffortRange, ...], "what springs, dampers and given efforts do"]
    multipliers: Annotated[
        tuple[MultiplierRange, ...], "what the couplings exert, a moment or force for a coefficient of 1"
    ]
    reactions: tuple[ReactionData, ...]
    warnings: Annotated[tuple[LoadBearing, ...], "passive freedoms that carry load"]
    lift_off: Annotated[tuple[LiftOff, ...], "positions at which contacts that are only pushed would have to pull"]
    overlap: Annotated[tuple[Overlap, ...], "positions at which the elements of contacts cut into each other"]
    crossings: Annotated[tuple[PassedCrossing, ...], "crossings of branches that the path was led over"]
    passive: Annotated[tuple[str, ...], "names of all passive freedoms"]
    checks: ChecksData
    engine: str
    method: Annotated[str | None, "how the forces were solved; none for a motion alone"]
    work: Annotated[Mapping[str, int], "how much was computed"]


def solution_data(values: Values) -> SolutionData:
    """All that a summary tells."""
    places, checks = Places(values), values.checks()
    forces = values.has_forces and bool(places.solved.any())
    own, applied = efforts(values) if forces else (None, None)
    worst = [
        float(np.nanmax(np.abs(of))) if np.isfinite(of).any() else None
        for of in (checks.closure, checks.equilibrium, checks.power, checks.accuracy)
    ]
    names = values.whole.freedom_names()
    driven = [names.index(name) for name in values.actuated]
    loaded = [] if applied is None else np.flatnonzero(applied.size[: len(places.m.freedom_names())] > 0).tolist()
    return SolutionData(
        values.mechanism.name,
        dict(values.mechanism.units),
        places.status.size,
        int(places.solved.sum()),
        tuple(Unsolved(a, b, str(places.status[a])) for a, b in places.runs() if places.status[a] != OK),
        {
            name: (float(np.nanmin(of)), float(np.nanmax(of)))
            for name, of in zip(places.drivers, places.driver_values, strict=True)
            if np.isfinite(of).any()
        },
        values.least_norm,
        () if own is None else tuple(_effort(places, own, k, names[k]) for k in driven),
        () if applied is None else tuple(_effort(places, applied, k, names[k]) for k in loaded),
        _multipliers(places) if forces else (),
        _reactions(places) if forces else (),
        values.load_bearing(),
        lift_offs(values),
        overlaps(values),
        values.crossings(),
        tuple(values.passive_efforts()) if forces else (),
        ChecksData(*worst),
        values.engine,
        values.method,
        {name: number for number, name in values.work.counts},
    )  # fmt: skip


def _at(places: Places, found: Greatest, k: int, sign: float = 1.0) -> At | None:
    """An extreme with its place; none where there is no number."""
    if not np.isfinite(found.best[k]):
        return None
    at = int(found.at[k])
    there = {name: float(of[at]) for name, of in zip(places.drivers, places.driver_values, strict=True)}
    return At(sign * float(found.best[k]), at, there)


def _effort(places: Places, found: Range, k: int, name: str) -> EffortRange:
    m = places.values.whole
    pair, j = m.freedom(name)
    unit = unit_of(m.units, (2 if m.pairs[pair].type.efforts[j].is_couple else 1, 1, -2))
    return EffortRange(name, unit, *_ends(places, found, k))


def _multipliers(places: Places) -> tuple[MultiplierRange, ...]:
    found, m = multipliers(places.values), places.m
    return tuple(
        MultiplierRange(c.name, coupling_unit(m, c), *_ends(places, found, k)) for k, c in enumerate(m.couplings)
    )


def _ends(places: Places, found: Range, k: int) -> tuple[bool, At | None, At | None]:
    """Whether a quantity is unique, and its extremes where it has a value."""
    loose = bool(found.loose[k])
    known = not loose or places.values.least_norm
    return not loose, *((_at(places, found.low, k, -1.0), _at(places, found.high, k)) if known else (None, None))


def _reactions(places: Places) -> tuple[ReactionData, ...]:
    values, m = places.values, places.m
    found = reactions(values)
    units = [unit_of(m.units, (power, 1, -2)) for power in (1, 2)]
    out = []
    for k, pair in enumerate(m.pairs):
        sizes = []
        for i, one in enumerate((found.force, found.moment)):
            loose, names = bool(found.loose[i, k]), pair.type.component_names
            parts = tuple(names[c] for c in np.flatnonzero(found.kept[i, :, k])) if loose else ()
            known = not loose or values.least_norm or bool(parts)
            sizes.append(ReactionSize(units[i], not loose, parts, _at(places, one, k) if known else None))
        some = found.loose[:, k].any() or any(values.whole.freedom(name)[0] == k for name in values.actuated)
        unique = values.unique(k) if some else {}
        not_unique = tuple(name for name, ok in unique.items() if not places.flat(ok)[places.solved].all())
        out.append(ReactionData(pair.name, pair.type.symbol, pair.b, pair.a, sizes[0], sizes[1], not_unique))
    return tuple(out)
