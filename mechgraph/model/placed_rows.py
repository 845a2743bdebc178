"""Rows with places for curves and surfaces, which a pair fills in: what those of curves and those of surfaces share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import ShapeError
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.along_curve import AlongCurve
from mechgraph.model.curves import Curve
from mechgraph.model.on_surface import OnSurface
from mechgraph.model.pair_type import PairType, fill_row
from mechgraph.model.row_parts import Touching
from mechgraph.model.surfaces import Surface
from mechgraph.units import LENGTH

OFF_CURVE = 1e-6
"""Part of the extent of a curve, or angle, by which the contact may miss it."""
UNIT_ROUNDING = 1e-12
"""Miss (in the unit of length) that is rounding at any size of a mechanism, as of a point in a plane through the origin."""
PLACE_STEP = 1e-14
"""Part of the greatest length by which a place on a curve or surface is found to which it is rounded, so that the place of that place is
the same: some fifty roundings."""
TRIED_PLACES = 16
"""Places at which it is tried whether components do work."""


def pair_row(
    symbol: str,
    name: str,
    freedoms: Sequence[object],
    reactions: Sequence[str],
    efforts: Sequence[str],
    touching: Touching | None = None,
) -> PairType:
    """A row of which efforts are combined to be dual to the freedoms; it has places for curves or surfaces."""
    row = object.__new__(PairType)
    fill_row(row, symbol, name, freedoms, reactions, efforts, touching=touching)
    object.__setattr__(row, "computed_efforts", True)
    return row


@dataclass(frozen=True)
class Contact:
    """A row with its curves, the markers at coordinates zero on links a and b ``(3, 4)``, and by how much each misses its curve.

    ``marker_b`` is None where no curve of link b says it; a pair without a place for one has it where it likes.
    """

    row: PairType
    marker: Array
    misses: tuple[float, ...]
    marker_b: Array | None = None


def extent(shape: Curve | Surface, x: Array) -> float:
    """The greatest length among those declared of a curve or surface and the coordinates of its point ``x (3,)``."""
    named = [getattr(shape, name) for name, of in shape.formats.items() if of.slide == LENGTH]
    return max(float(np.abs(values).max()) for values in (x, *(v for v in named if v is not None)))


def rounded(at: float, size: float) -> float:
    """A place to ``PLACE_STEP`` of the ``size`` of the numbers behind it; steps are powers of two, so that sizes near by have the same."""
    step = math.ldexp(1.0, math.frexp(PLACE_STEP * size)[1])
    return step * round(at / step)


def travels(row: Any) -> bool:
    """Whether a row has a place for a curve or a surface."""
    return isinstance(row, PairType) and any(isinstance(step, AlongCurve | OnSurface) for step in row.steps)


def filled(row: PairType, factors: Sequence[AlongCurve | OnSurface], pair: str) -> PairType:
    """The row with factors in the places for curves and surfaces; components that would do work are combined with efforts."""
    out = copy(row)
    for name in ("factors", "nx", "has_lengths", "takes_pitch"):
        vars(out).pop(name, None)
    left = (replace(factor, pair=pair) for factor in factors)
    steps = tuple(next(left) if isinstance(step, AlongCurve | OnSurface) else step for step in row.steps)
    object.__setattr__(out, "steps", steps)
    held = tuple(
        columns.start
        for step, (columns, _) in zip(steps, evaluation.places(out), strict=True)
        if isinstance(step, AlongCurve) and step.held
    )
    if held:  # no component is constant in a frame that does not turn with the curve
        object.__setattr__(out, "pushed", held)
        object.__setattr__(out, "reactions", None)
        return out
    x = evaluation.random_coordinates(out, np.random.default_rng(12345), 1, TRIED_PLACES)
    for step, (_, numbers) in zip(steps, evaluation.places(out), strict=True):
        if isinstance(step, AlongCurve):
            low, high = (end if np.isfinite(end) else np.copysign(step.travel.length, end) for end in step.ranges[0])
            x[numbers] = np.linspace(low, high, TRIED_PLACES)
        elif isinstance(step, OnSurface):
            x[numbers] = 0.0
    pitch = np.zeros((1, 1))
    frames = evaluation.frames_of(out, pitch, x)
    S, W = evaluation.twists_of(out, pitch, frames, x), evaluation.reactions_of(out, pitch, frames, x)
    work = np.abs(np.einsum("ifnt,icnt->fcnt", S, W)).max(initial=0.0)
    object.__setattr__(out, "computed_reactions", bool(work > 1e-12 * max(1.0, np.abs(S).max())))
    return out


def of_function(faults: Callable[[], list[str]], where: str) -> list[str]:
    """Faults of a shape, also that its function returns what is none; what the function raises goes on, with its cause."""
    try:
        return faults()
    except ShapeError as error:
        if error.__cause__ is not None:
            raise
        return [where + error.text]
