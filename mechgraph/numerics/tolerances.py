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


@dataclass(frozen=True)
class MotionTolerances:
    """When something counts as at rest. Motions are of size one; lengths over the length of the mechanism."""

    still: float = 1e-8
    """Part of a motion below which a freedom or a link stands still: the square root of rounding."""
    dependent: float = 1e-8
    """Part of a motion below which the weakest driver stands still: drivers depend on each other, or a dead point."""
    rounding: float = 1e-11
    """Part of a unit rate that counts as zero."""
    nearby: float = 1e-5
    """Part of a motion above which a freedom that stands still here moves near by, a trial step of 0.05 away."""
    common: float = 1e-9
    """Singular value against the largest below which twists of a border are common to its pairs; as for a rank."""
    in_place: float = 1e-5
    """Rate at which a pair element may leave its place in a passive motion; central differences of step 1e-4 are good to 1e-8."""
    tied: float = 1e-7
    """Singular value against the largest below which passive motions depend on each other."""
    proportional: float = 3e-5
    """Sine of the angle between the parts of two freedoms in the motions up to which they move in proportion."""
    error: float = 1e-9
    """Error of such a part that has to be expected near a singular position: near a dead point parts are small."""


@dataclass(frozen=True)
class StressTolerances:
    """When a part of a self-stress counts as zero. Self-stresses are of size one, moments over the length of the mechanism."""

    unique: float = 1e-7
    """Part in a component above which the component is not unique: far from rounding and from shares that are meant."""
    shown: float = 1e-6
    """Part (of a largest part of one) below which a component is not shown."""
    drivers_alone: float = 1e-9
    """Part below which reactions count as none: drivers that strain each other alone."""
    relieved: float = 1e-6
    """Power of a unit twist on a self-stress above which the twist relieves it."""


RANKS = RankTolerances()
MOTIONS = MotionTolerances()
STRESSES = StressTolerances()
