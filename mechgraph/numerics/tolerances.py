"""Tolerances, each with its reason; one frozen object a subject, passed on as a default and nowhere repeated."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RankTolerances:
    """When a singular value or a pivot counts as zero. Rows are those of a loop in its own measure, columns of unit size."""

    loop: float = 1e-9
    """Singular value of a loop's own rows; seven digits above rounding, so that printed geometry of ten digits stays redundant."""
    position: float = 1e-9
    """Singular value of all rows against the largest, and pivot of an elimination against unit rows; as for one loop."""
    generic: float = 1e-7
    """The same for random geometry of size one, where no dimension is meant to be special: far from rounding on both sides."""
    nearby: float = 1e-6
    """The same at positions reached by a motion: closing a double root to 1e-13 leaves 3e-7 of the way that returns."""
    proved: float = 1e-3
    """Pivot of a bordered system from which on it proves the rank by itself."""
    distance: float = 1e-8
    """Distance to a singular matrix from which on the bordered system decides whatever its pivots."""
    near: float = 1e-3
    """Margin of one loop below which a position is called nearly singular: forces are a thousand times the loads."""
    doubt: float = 1e-11
    """Largest dropped value above which it may be more than rounding."""
    damping: float = 1e-13
    """Square of the singular value (3e-7) below which the normal equations leave a direction alone; rounding of a square is 1e-16."""


RANKS = RankTolerances()
