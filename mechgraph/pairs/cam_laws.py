"""Laws of cams: segments of a follower's motion, their joints, and the factors by which laws are compared.

A law is kept as exact pieces, polynomials with one sine each,

    s(x) = sum_k c_k x^k + W sin(w x + phi),

so that all derivatives are exact. The standard rises y(tau), 0 <= tau <= 1, are polynomials or of the family SCCA: over half of the motion
the acceleration is a sine over b/2, constant over c/2, a cosine over d/2 and zero over the rest; the other half is its mirror image.

Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2009, chapters 3 to 5 (SCCA after C. N. Neklutin).
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
import scipy

from mechgraph.document import Document, Paragraph, RowsByName, Shown, Table
from mechgraph.errors import DeclarationError, FileError, MechgraphWarning
from mechgraph.fields import (
    NUMBER,
    POSITION,
    POSITIVE,
    SAMPLES,
    TABLES,
    TEXT,
    Described,
    FieldKind,
    are_rows,
)
from mechgraph.files import text_of
from mechgraph.maths.se3 import Array
from mechgraph.memo import Once, dataclass
from mechgraph.pairs.curves import ORDERS, derivatives
from mechgraph.quantities import door, factor_of, has_quantity, items_of, real_array, wrong

SEAM_ROUNDING = 1e-9
"""Part of the largest value of a derivative below which a jump at a seam is rounding."""


@dataclass(frozen=True)
class LawPieces:
    """Pieces between ``breaks (n + 1,)``: polynomials ``(n, degree + 1)``, lowest power first, and sines ``(n, 3)``: W, w, phi."""

    breaks: Array
    polynomials: Array
    sines: Array

    @cached_property
    def _terms(self) -> Array:
        """Coefficients of the value and five derivatives, ``(n, 6, degree + 1)``."""
        return np.ascontiguousarray(derivatives(self.polynomials.T, 6).transpose(2, 0, 1))

    def at(self, u: Array, orders: int = ORDERS) -> Array:
        """Value and derivatives ``(orders, ...)`` at ``u (...)``, real or complex; at a break those of the piece behind it."""
        flat = np.asarray(u).reshape(-1)
        piece = self.breaks[1:-1].searchsorted(flat.real, side="right")
        return self.of(piece, flat - self.breaks[piece], orders).reshape(orders, *np.shape(u))

    def of(self, piece: Any, x: Any, orders: int = ORDERS) -> Array:
        """The same at ``x (n,)`` behind the beginnings of pieces ``(n,)``."""
        powers = x[:, None] ** np.arange(self.polynomials.shape[1])
        out = np.asarray((self._terms[piece, :orders] @ powers[..., None])[..., 0].T)
        W, w, phi = self.sines[piece].T
        if W.any():
            k = np.arange(orders)[:, None]
            out = out + W * w**k * np.sin(w * x + phi + 0.5 * np.pi * k)
        return out

    @property
    def ends(self) -> tuple[Array, Array]:
        """Value and three derivatives where the first piece begins and where the last one ends."""
        last = len(self.breaks) - 2
        places = np.array([0, last]), np.array([0.0, self.breaks[-1] - self.breaks[-2]])
        begin, end = self.of(*places).T
        return begin, end

    def scaled(self, rise: float, over: float) -> LawPieces:
        """``rise y(x / over)``."""
        k = np.arange(self.polynomials.shape[1])
        sines = self.sines * np.array([rise, 1.0 / over, 1.0])
        return LawPieces(self.breaks * over, self.polynomials * rise / over**k, sines)

    def shifted(self, x: float, y: float) -> LawPieces:
        """The same further by ``x``, higher by ``y``."""
        up = self.polynomials.copy()
        up[:, 0] += y
        return LawPieces(self.breaks + x, up, self.sines)

    def largest(self, order: int) -> float:
        """The largest amount of a derivative, found piece by piece where the next one is zero, to rounding."""
        pieces = np.arange(len(self.breaks) - 1)
        lengths = np.diff(self.breaks)
        tried = lengths[:, None] * np.linspace(0.0, 1.0, 65)
        which = np.repeat(pieces, 65)
        values = self.of(which, tried.ravel(), order + 2)
        most = float(np.abs(values[order]).max())
        slope = values[order + 1].reshape(tried.shape)
        at, cell = np.nonzero(slope[:, :-1] * slope[:, 1:] < 0)
        low, high, sign = tried[at, cell], tried[at, cell + 1], np.sign(slope[at, cell])
        for _ in range(60):  # halvings: to rounding
            middle = 0.5 * (low + high)
            before = sign * self.of(at, middle, order + 2)[order + 1] > 0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return max(most, float(np.abs(self.of(at, low, order + 1)[order]).max(initial=0.0)))

    def jumps(self, order: int) -> bool:
        """Whether a derivative jumps from piece to piece."""
        piece = np.arange(len(self.breaks) - 2)
        after, before = (
            self.of(p, x)[order] for p, x in ((piece + 1, 0.0 * piece), (piece, np.diff(self.breaks)[:-1]))
        )
        return bool(np.abs(after - before).max(initial=0.0) > SEAM_ROUNDING * self.largest(order))


def joined(parts: Sequence[LawPieces]) -> LawPieces:
    """Pieces one behind the other."""
    width = max(part.polynomials.shape[1] for part in parts)
    polynomials = [np.pad(part.polynomials, ((0, 0), (0, width - part.polynomials.shape[1]))) for part in parts]
    breaks = np.concatenate([*(part.breaks[:-1] for part in parts), parts[-1].breaks[-1:]])
    return LawPieces(breaks, np.concatenate(polynomials), np.concatenate([part.sines for part in parts]))


def of_polynomial(coefficients: Sequence[float]) -> LawPieces:
    """One polynomial over 0 to 1."""
    return LawPieces(np.array([0.0, 1.0]), np.array([coefficients], dtype=float), np.zeros((1, 3)))


def of_scca(b: float, c: float, d: float) -> LawPieces:
    """The rise whose half is a sine over b/2, constant over c/2, a cosine over d/2, of constant speed over the rest."""
    quarter = 0.5 * np.pi
    half = [(b, 0.0, 1.0, 0.0), (c, 1.0, 0.0, 0.0), (d, 0.0, 1.0, quarter), (1.0 - b - c - d, 0.0, 0.0, 0.0)]
    mirror = [(l, -g, -a, quarter - phi if a else 0.0) for l, g, a, phi in reversed(half)]
    lengths, rows, sines, s, v = [], [], [], 0.0, 0.0
    for part, g, a, phi in (*half, *mirror):
        if part < 1e-12:  # a part of no length, to rounding
            continue
        x, w = 0.5 * part, np.pi / part
        over, over2 = a / w, a / w**2
        row = [s + over2 * math.sin(phi), v + over * math.cos(phi), 0.5 * g]
        lengths.append(x)
        rows.append(row)
        sines.append([-over2, w, phi])
        s = row[0] + row[1] * x + row[2] * x * x - over2 * math.sin(w * x + phi)
        v = row[1] + g * x - over * math.cos(w * x + phi)
    made = LawPieces(np.concatenate([[0.0], np.cumsum(lengths)]), np.array(rows), np.array(sines))
    return made.scaled(1.0 / s, 1.0)


RISES: dict[str, tuple[float, ...]] = {
    "constant_speed": (0.0, 1.0),
    "poly345": (0, 0, 0, 10, -15, 6),
    "poly4567": (0, 0, 0, 0, 35, -84, 70, -20),
}
"""Rises that are polynomials of ``tau``, coefficients from the constant term up."""
SCCA: dict[str, tuple[float, float, float]] = {
    "constant_acceleration": (0.0, 1.0, 0.0),
    "harmonic": (0.0, 0.0, 1.0),
    "cycloidal": (0.5, 0.0, 0.5),
    "modified_trapezoid": (0.25, 0.5, 0.25),
    "modified_sine": (0.25, 0.0, 0.75),
}
"""Rises of the family SCCA: shares of sine, constant and cosine acceleration."""
OWN = ("dwell", "scca", "polynomial", "bspline", "sampled")
"""Laws with arguments of their own, and the dwell."""
NAMES = (*RISES, *SCCA, *OWN)
TAKES = {
    "scca": ("rise", "sine", "constant", "cosine"),
    "polynomial": ("rise", "coefficients", "conditions"),
    "bspline": ("conditions", "knots"),
    "sampled": ("samples", "smooth", "conditions"),
    "dwell": (),
}
"""What a law takes beside ``over``; all others a rise."""


def rise_of(name: str) -> LawPieces:
    """The rise of a name over 0 to 1."""
    return of_polynomial(RISES[name]) if name in RISES else of_scca(*SCCA[name])


_NUMBERS = {"type": "array", "items": {"type": "number"}}
CONDITIONS = FieldKind(
    "n × 3",
    {"type": "array", "items": {**_NUMBERS, "minItems": 3, "maxItems": 3}},
    wanted="a table (angle, order of the derivative) -> value, or rows of these three numbers",
    fits=partial(are_rows, 3),
)
"""Conditions of a motion law, each an angle, the order of the derivative there, and its value."""
POINTS_OF_LAW = FieldKind(
    "n × 2",
    {"type": "array", "items": {**_NUMBERS, "minItems": 2, "maxItems": 2}},
    wanted="(angles, values), or rows of an angle and a value",
    fits=partial(are_rows, 2),
)
"""Samples of a motion law."""


@dataclass(frozen=True)
class Segment(Described):
    """Declare one segment of a cam law: what the follower does while the cam turns by ``over``.

    ``dwell``, ``constant_speed``, ``constant_acceleration``, ``harmonic``, ``cycloidal``, ``modified_trapezoid``, ``modified_sine``,
    ``poly345``, ``poly4567`` take a rise alone; ``scca`` the shares ``sine``, ``constant``, ``cosine`` of its acceleration as well.
    ``polynomial`` takes ``rise`` and ``coefficients`` of ``y = sum c_k tau^k``, ``tau = angle / over``, or ``conditions``, which say
    lift and derivatives at angles behind the beginning of the segment, where the lift counts from; its degree is one less than their
    number. ``bspline`` takes ``knots`` besides, and its degree is lower by their number. ``sampled`` takes ``samples``, angles and lifts
    from the beginning on: a spline of degree 5 passes them, or the smoothest one that stays within ``smooth`` of each.

    Examples
    --------
    >>> import mechgraph as mg
    >>> rest = {(0, 0): 0, (0, 1): 0, (0, 2): 0, (1, 0): 0.02, (1, 1): 0, (1, 2): 0}
    >>> round(mg.Segment("polynomial", over=1.0, conditions=rest).rise_found, 9)
    0.02
    """

    law: Annotated[str, TEXT("how it moves", choices=NAMES)]
    rise: Annotated[float | None, NUMBER("change of the lift", default="0", **POSITION)] = None
    over: Annotated[float, POSITIVE("angle by which the cam turns meanwhile", degrees=True)] = 1.0
    sine: Annotated[float, NUMBER("share of scca with sine acceleration", minimum=0.0)] = 0.0
    constant: Annotated[float, NUMBER("share with constant acceleration", minimum=0.0)] = 0.0
    cosine: Annotated[float, NUMBER("share with cosine acceleration", minimum=0.0)] = 0.0
    coefficients: Annotated[Any, SAMPLES("of a polynomial, lowest power first", default="none")] = None
    conditions: Annotated[Any, CONDITIONS("angle, order of the derivative, value there", default="none")] = None
    knots: Annotated[Any, SAMPLES("angles of the inner knots of a bspline, in order", default="none")] = None
    samples: Annotated[Any, POINTS_OF_LAW("angles and lifts", default="none")] = None
    smooth: Annotated[
        float | None, NUMBER("largest distance from a sample", default="0: passes them", minimum=0.0, **POSITION)
    ] = None

    def __post_init__(self) -> None:
        self.read_numbers()
        given = {"conditions": self.conditions, "samples": self.samples}
        if isinstance(self.conditions, Mapping):
            keyed = ((key if isinstance(key, tuple) else (key,), value) for key, value in self.conditions.items())
            given["conditions"] = tuple(sorted((*key, value) for key, value in keyed))
        samples = real_array(self.samples) if isinstance(self.samples, tuple) else None
        if samples is not None and len(samples) == 2 and samples.shape[1:] != (2,):
            given["samples"] = samples.T
        for name, value in given.items():
            array = real_array(value)
            rows = value if array is None or array.ndim != 2 else tuple(map(tuple, array.tolist()))
            object.__setattr__(self, name, rows)

    def _times(self, factor: float) -> dict[str, Any]:
        """Its conditions and samples with values times a factor."""
        given = {name: rows for name in ("conditions", "samples") if (rows := getattr(self, name)) is not None}
        return {name: tuple((*row[:-1], factor * row[-1]) for row in rows) for name, rows in given.items()}

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """See ``Described``; of conditions and samples the lifts."""
        about = self.formats["rise"]
        factor = factor_of(about.turn if turns else about.slide, base)
        return super().in_units(base, turns).replace(**self._times(factor))

    def __neg__(self) -> Segment:
        """The same downwards."""
        return self.replace(rise=None if self.rise is None else -self.rise, **self._times(-1.0))

    def faults(self, where: str) -> list[str]:
        """What is wrong with it, one line each."""
        found = self.value_faults(where)
        if found:
            return found
        takes = TAKES.get(self.law, ("rise",))
        for name in ("rise", "coefficients", "conditions", "knots", "samples", "smooth", "sine", "constant", "cosine"):
            if name not in takes and getattr(self, name):
                found.append(f"{where}{name}: the law {self.law!r} takes none; it takes {', '.join(('over', *takes))}")
        needed = {
            "polynomial": self.conditions or self.coefficients,
            "bspline": self.conditions,
            "sampled": self.samples,
        }
        if not needed.get(self.law, True):
            found.append(
                f"{where}{' or '.join(takes[1:] if self.law == 'polynomial' else takes[:1])}: {self.law} needs it"
            )
        if (self.law not in OWN or self.law == "scca" or self.coefficients) and self.rise is None:
            found.append(f"{where}rise: is missing; give the change of the lift")
        if self.law == "polynomial" and self.conditions and (self.coefficients or self.rise is not None):
            found.append(f"{where}conditions: say the polynomial and its rise; leave rise and coefficients out")
        shares = self.sine + self.constant + self.cosine
        if self.law == "scca" and not 0.0 < shares <= 1.0 + SEAM_ROUNDING:
            found.append(f"{where}sine + constant + cosine = {shares:g}: expected more than 0 and at most 1")
        if self.law == "polynomial" and self.coefficients and not found:
            c = np.atleast_1d(self.coefficients)
            if abs(c[0]) > SEAM_ROUNDING or abs(c.sum() - 1.0) > SEAM_ROUNDING:
                found.append(
                    f"{where}coefficients: y is {c[0]:g} at 0 and {c.sum():g} at 1; expected 0 and 1 (the rise multiplies y)"
                )
        return found or [*self._list_faults(where)]

    def _list_faults(self, where: str) -> Iterator[str]:
        """Conditions, knots and samples that do not fit the segment or each other."""
        for name in ("conditions", "samples"):
            angles = np.array([row[0] for row in getattr(self, name) or ()])
            outside = angles[(angles < -SEAM_ROUNDING * self.over) | (angles > (1 + SEAM_ROUNDING) * self.over)]
            if outside.size:
                yield f"{where}{name}: angle {outside[0]:g} is not between 0 and over = {self.over:g}"
        for angle, order, _ in self.conditions or ():
            if order not in range(ORDERS):
                yield f"{where}conditions: order {order:g} at angle {angle:g}; expected 0 (the lift) to 3"
        if self.samples is not None:
            angles = np.array([row[0] for row in self.samples])
            if (
                len(angles) < 6
                or (np.diff(angles) <= 0).any()
                or abs(angles[0]) > SEAM_ROUNDING
                or abs(angles[-1] - self.over) > SEAM_ROUNDING * self.over
            ):
                yield f"{where}samples: expected 6 or more, whose angles increase from 0 to over = {self.over:.9g}"
            if self.smooth and self.conditions:
                yield f"{where}conditions: are not kept where samples are smoothed; leave one out"
        elif self.conditions is not None:
            degree = len(self.conditions) - 1 - np.size(self.knots if self.knots is not None else ())
            if not 1 <= degree <= 15:
                yield f"{where}conditions: {len(self.conditions)} make degree {degree} with the knots given; expected 1 to 15"
            elif isinstance(self._solved(), str):
                yield f"{where}conditions: {self._solved()}"

    def _solved(self) -> LawPieces | str:
        """The spline of the conditions over 0 to ``over``, or why there is none."""
        knots = np.atleast_1d(np.array(self.knots if self.knots is not None else (), dtype=float)) / self.over
        if (np.diff(knots, prepend=0.0, append=1.0) <= 0).any():
            return f"knots must increase between 0 and over = {self.over:g}"
        n = len(self.conditions)
        degree = n - 1 - len(knots)
        t = np.concatenate([np.zeros(degree + 1), knots, np.ones(degree + 1)])
        basis: Any = scipy.interpolate.BSpline(t, np.eye(n), degree)
        rows = np.array([basis(angle / self.over, int(order)) for angle, order, _ in self.conditions])
        values = np.array([value * self.over**order for _, order, value in self.conditions])
        size = np.abs(rows).max(axis=1, keepdims=True)
        if not size.all() or np.linalg.matrix_rank(rows / size) < n:
            return "do not determine the law; one of them follows from others, or too few lie between some knots"
        return _of_spline(scipy.interpolate.BSpline(t, np.linalg.solve(rows, values), degree)).scaled(1.0, self.over)

    @property
    def deviation(self) -> float:
        """The largest distance from a sample; 0 where there are none."""
        if self.samples is None:
            return 0.0
        angles, values = np.array(self.samples).T
        return float(np.abs(self.pieces().at(angles, 1)[0] - (values - values[0])).max())

    @property
    def rise_found(self) -> float:
        """The change of the lift over the segment."""
        if self.law in ("polynomial", "bspline") and self.conditions:
            begin, end = self.pieces().ends
            return float(end[0] - begin[0])
        if self.samples is not None:
            return self.samples[-1][1] - self.samples[0][1]
        return self.rise or 0.0

    def pieces(self, closed: bool = False) -> LawPieces:
        """The law from 0 to ``over``, beginning at lift 0; ``closed``: samples go round."""
        if self.law == "dwell":
            return of_polynomial((0.0,)).scaled(1.0, self.over)
        if self.samples is not None:
            return self._splined(closed)
        if self.conditions is not None:
            made = self._solved()
            assert not isinstance(made, str)
            return made.shifted(0.0, -float(made.ends[0][0]))
        if self.coefficients is not None:
            shape = of_polynomial(np.atleast_1d(self.coefficients).tolist())
        else:
            shape = of_scca(self.sine, self.constant, self.cosine) if self.law == "scca" else rise_of(self.law)
        return shape.scaled(self.rise or 0.0, self.over)

    def _splined(self, closed: bool) -> LawPieces:
        """The spline of degree 5 through the samples, or the smoothest one near them: FITPACK's, its sum of squares by bisection."""
        u, y = np.array(self.samples).T
        u, y = u / self.over, y - y[0]
        if not self.smooth:
            ends: Any = "periodic" if closed else None
            if self.conditions:
                ends = tuple(
                    [(int(k), v * self.over**k) for a, k, v in self.conditions if (a > 0.5 * self.over) == last]
                    for last in (False, True)
                )
            return _of_spline(scipy.interpolate.make_interp_spline(u, y, 5, bc_type=ends)).scaled(1.0, self.over)

        def fitted(s: float) -> Any:
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "ignore", RuntimeWarning
                )  # of a sum that is met only nearly: the distance is measured
                return scipy.interpolate.BSpline(*scipy.interpolate.splrep(u, y, k=5, s=s, per=closed))

        low, high = math.log(len(u) * self.smooth**2) - 20.0, math.log(len(u) * self.smooth**2)
        for _ in range(40):  # halvings of the sum of squares, on a logarithmic scale
            middle = 0.5 * (low + high)
            near = np.abs(fitted(math.exp(middle))(u) - y).max() <= self.smooth
            low, high = (middle, high) if near else (low, middle)
        return _of_spline(fitted(math.exp(low))).scaled(1.0, self.over)


def _of_spline(spline: Any) -> LawPieces:
    """The polynomials of a spline over 0 to 1."""
    made = scipy.interpolate.PPoly.from_spline(spline)
    kept = np.flatnonzero((np.diff(made.x) > 0) & (made.x[:-1] >= 0) & (made.x[1:] <= 1))
    return LawPieces(np.append(made.x[kept], made.x[kept[-1] + 1]), made.c[::-1, kept].T, np.zeros((len(kept), 3)))


class LawFactors(NamedTuple):
    """Part of ``CamLaw.factors`` and ``cam_laws()``: largest rates ``s' over / rise``, ``s'' over^2 / rise``, ``s''' over^3 / rise``."""

    Cv: float
    Ca: float
    Cj: float


class Seam(NamedTuple):
    """Part of ``CamLaw.seams``: the angle where a segment begins, and by how much position and three derivatives ``(4,)`` jump there."""

    angle: float
    jump: Array


@dataclass(frozen=True)
class CamLaw(Described, Once, Shown):
    """Declare the law of a follower over a turn of the cam: segments, one behind the other.

    Positions follow on from ``start``. Segments must fill the turn, and lead back to where they begin; position and slope must not jump.
    A jump of the acceleration is a warning, one of the jerk a line of the document. ``-law`` is the law downwards.

    Raises
    ------
    DeclarationError
        With every fault: of the segments, of their angles, and jumps of position or slope.

    Examples
    --------
    >>> import mechgraph as mg
    >>> law = mg.CamLaw(
    ...     [mg.Segment("cycloidal", 0.02, 3.0), mg.Segment("poly345", -0.02, 2.0), mg.Segment("dwell", over=1.0)],
    ...     turn=6.0,
    ... )
    >>> float(law.at(1.5)[0].round(6)), round(law.factors[1].Cv, 6)
    (0.01, 1.875)
    """

    segments: Annotated[Any, TABLES("segments, in order", key="segment", table="segment")]
    start: Annotated[float, NUMBER("position where the first one begins", **POSITION)] = 0.0
    turn: Annotated[float, POSITIVE("angle after which the law repeats", degrees=True)] = math.tau

    def __post_init__(self) -> None:
        self.read_numbers()
        if self._waits:
            return
        if found := self._all_faults():
            raise DeclarationError("cam law", found)
        for text in self.warnings:
            warnings.warn(f"cam law: {text}", MechgraphWarning, stacklevel=4)

    @property
    def _waits(self) -> bool:
        """Whether it holds quantities, whose units a mechanism alone knows."""
        each = self.segments if isinstance(self.segments, tuple) else ()
        return has_quantity(self.start) or any(
            has_quantity(getattr(one, name)) for one in each if isinstance(one, Segment) for name in ("rise", "smooth")
        )

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """See ``Described``; of the segments too."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)  # said when it was declared
            return self.replace(
                start=self.start
                * factor_of(self.formats["start"].turn if turns else self.formats["start"].slide, base),
                segments=tuple(one.in_units(base, turns) for one in self.segments),
            )

    def without_quantities(self, units: Mapping[str, str], turns: bool = False) -> Self:
        """See ``Described``; of the segments too."""
        if not self._waits:
            return self
        segments = tuple(one.without_quantities(units, turns) for one in self.segments)
        bare = object.__new__(type(self))
        vars(bare).update(segments=segments, start=self.start, turn=self.turn)
        return super(CamLaw, bare).without_quantities(units, turns).replace(segments=segments)

    def __neg__(self) -> CamLaw:
        """The law downwards, that of the second disc of a conjugate cam."""
        return self.replace(start=-self.start, segments=tuple(-one for one in self.segments))

    def faults(self, where: str) -> list[str]:
        """Quantities that no units were given for; all else is refused where the law is made."""
        return [f"{where}law: holds quantities; a mechanism with units converts them"] if self._waits else []

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        return self.faults(where)

    def _all_faults(self) -> list[str]:
        found = [fault for name in ("start", "turn") if (fault := self.formats[name].fault(getattr(self, name), name))]
        segments = items_of(self.segments, "segments", found)
        for i, one in enumerate(segments):
            name = f"segment {i + 1}"
            found += (
                one.faults(f"{name}: ")
                if isinstance(one, Segment)
                else [wrong(one, name, "a Segment, mg.Segment(...)")]
            )
        if found or not segments:
            return found or ["segments: none given; give one or more that fill the turn"]
        filled = sum(one.over for one in segments)
        if abs(filled - self.turn) > SEAM_ROUNDING * self.turn:
            left = self.turn - filled
            return [
                f"segments: fill {filled:.9g} rad of the turn of {self.turn:.9g}; {abs(left):.6g} is {'left' if left > 0 else 'too much'}: "
                f"change over=, or {'add a dwell' if left > 0 else 'leave a segment out'}"
            ]
        return [
            f"seam at {seam.angle:.6g} rad: {what} jumps by {seam.jump[order]:.6g}; {remedy}"
            for seam in self.seams
            for order, what, remedy in (
                (0, "the lift", "the rises must add up to zero"),
                (1, "the slope", "choose segments whose slopes agree where they meet"),
            )
            if seam.jump[order]
        ]

    # --- what it says ------------------------------------------------------------------------------------------------

    @cached_property
    def parts(self) -> tuple[LawPieces, ...]:
        """The exact pieces of every segment, one behind the other."""
        alone = len(self.segments) == 1
        out, angle, level = [], 0.0, self.start
        for one in self.segments:
            made = one.pieces(closed=alone and abs(one.rise_found) <= SEAM_ROUNDING * (one.smooth or 1.0))
            out.append(made.shifted(angle, level))
            angle, level = angle + one.over, float(out[-1].ends[1][0])
        return tuple(out)

    @cached_property
    def pieces(self) -> LawPieces:
        """The exact pieces over the turn."""
        return joined(self.parts)

    @door
    def at(self, angle: Any, orders: int = ORDERS) -> Array:
        """Position, slope, bend and jerk at angles of the cam.

        Parameters
        ----------
        angle : (...) array_like
            Angles [rad]; the law repeats after a turn. At a seam the values are those behind it.
        orders : int
            How many of position and derivatives are wanted, up to 6.

        Returns
        -------
        (orders, ...) array
            By radian, radian squared, radian cubed.

        Examples
        --------
        >>> import mechgraph as mg
        >>> law = mg.CamLaw([mg.Segment("poly345", 1.0, 3.0), mg.Segment("poly345", -1.0, 3.0)], turn=6.0)
        >>> law.at(1.5).round(6) + 0
        array([ 0.5     ,  0.625   ,  0.      , -1.111111])
        """
        u = angle if isinstance(angle, np.ndarray) and np.iscomplexobj(angle) else real_array(angle)
        if u is None:
            raise DeclarationError("CamLaw.at", [wrong(angle, "angle", "real numbers")])
        return self.pieces.at(u - self.turn * np.floor(u.real / self.turn), orders)

    @cached_property
    def seams(self) -> tuple[Seam, ...]:
        """Where segments begin, the first at 0: the angle, and jumps ``(4,)`` of position, slope, bend and jerk; 0 for rounding."""
        size = [max(max(part.largest(k) for part in self.parts), 1e-300) for k in range(ORDERS)]
        size[0] = max(size[0] - abs(self.start), 1e-300)
        out = []
        for i, part in enumerate(self.parts):
            jump = part.ends[0] - self.parts[i - 1].ends[1]
            out.append(Seam(float(part.breaks[0]), np.where(np.abs(jump) > SEAM_ROUNDING * np.array(size), jump, 0.0)))
        return tuple(out)

    @cached_property
    def factors(self) -> tuple[LawFactors, ...]:
        """Largest slope, bend and jerk of every segment, over its rise and angle; infinite where the derivative before jumps."""
        out = []
        for i, (one, part) in enumerate(zip(self.segments, self.parts, strict=True)):
            beside = [self.seams[i].jump, self.seams[(i + 1) % len(self.parts)].jump]
            ends = [bool(beside[0][k] or beside[1][k]) for k in range(ORDERS)]
            out.append(_factors(part, one.rise_found, one.over, ends))
        return tuple(out)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Seams at which the acceleration jumps, a sentence each."""
        return tuple(
            f"the acceleration jumps by {seam.jump[2]:.6g} per rad^2 at {seam.angle:.6g} rad, and the force with it; "
            "take a law that begins and ends there with the same acceleration"
            for seam in self.seams
            if seam.jump[2]
        )

    @property
    def deviation(self) -> float:
        """The largest distance of the law from a sample that it was read from."""
        return max(one.deviation for one in self.segments)

    def document(self) -> Document:
        """Segments with their factors, jumps at the seams, and how far samples were moved."""
        rows, angle = [], 0.0
        for one, f in zip(self.segments, self.factors, strict=True):
            numbers = (math.degrees(angle), math.degrees(angle + one.over), one.rise_found, *f)
            rows.append((one.law, *(f"{v:.6g}" for v in numbers)))
            angle += one.over
        seams = [
            (f"{math.degrees(seam.angle):.6g}", *(f"{v:.6g}" for v in seam.jump[2:]))
            for seam in self.seams
            if seam.jump.any()
        ]
        blocks: list[Any] = [Table(("law", "from [deg]", "to [deg]", "rise", "Cv", "Ca", "Cj"), tuple(rows))]
        if seams:
            blocks.append(Table(("seam [deg]", "jump of the acceleration", "jump of the jerk"), tuple(seams)))
        if any(one.samples for one in self.segments):
            blocks.append(Paragraph(f"Largest deviation from a sample: {self.deviation:.4g}."))
        return Document("Cam law", tuple(blocks))

    @classmethod
    @door
    def read(
        cls,
        source: Any,
        angle: str = "angle",
        lift: str = "lift",
        unit: str = "deg",
        smooth: float | None = None,
        scale: float = 1.0,
    ) -> CamLaw:
        """Read the law of a whole turn from a table.

        Parameters
        ----------
        source : path, DataFrame or mapping
            A CSV file with a line of names, or columns by name.
        angle, lift : str
            Names of the columns. The angles increase; where the last is not a turn behind the first, the first sample closes the turn.
        unit : {"deg", "rad"}
            Unit of the angles.
        smooth : float, optional
            Largest distance of the law from a sample. Default: the law passes them.
        scale : float
            Factor of the lifts, such as 0.001 for millimeters in a mechanism in meters.

        Returns
        -------
        CamLaw
            ``law.deviation`` is the largest distance from a sample.

        Raises
        ------
        DeclarationError, FileError
            A column or number is missing; the samples do not close.

        Examples
        --------
        >>> import mechgraph as mg
        >>> import numpy as np
        >>> u = np.arange(0.0, 360.0, 5.0)
        >>> law = mg.CamLaw.read({"angle": u, "lift": 0.01 * np.sin(np.deg2rad(u)) ** 2})
        >>> float(law.at(np.pi / 2)[0].round(9))
        0.01
        """
        if unit not in ("deg", "rad"):
            raise DeclarationError("cam law", [wrong(unit, "unit", "'deg' or 'rad'")])
        table = _columns(Path(source)) if isinstance(source, str | os.PathLike) else source
        found: list[str] = []
        columns: list[Any] = []
        for name in (angle, lift):
            try:
                array = real_array(np.asarray(table[name]))
            except (KeyError, TypeError, ValueError, IndexError):
                array = None
            if array is None or array.ndim != 1 or len(array) < 6 or not np.isfinite(array).all():
                have = ", ".join(map(str, table)) if isinstance(table, Mapping) or hasattr(table, "columns") else "none"
                found.append(f"column {name!r}: expected six or more numbers (columns: {have})")
            columns.append(array)
        if found:
            raise DeclarationError("cam law", found)
        u = np.deg2rad(columns[0]) if unit == "deg" else np.array(columns[0], dtype=float)
        y = scale * np.array(columns[1], dtype=float)
        u = u - u[0]
        if abs(u[-1] - math.tau) <= 1e-6:  # angles are rounded
            u[-1] = math.tau
            if smooth and abs(y[-1] - y[0]) <= smooth:
                y[-1] = y[0]
        else:
            u, y = np.append(u, math.tau), np.append(y, y[0])
        return cls([Segment("sampled", over=math.tau, samples=(u, y), smooth=smooth)], start=float(y[0]))


def _columns(path: Path) -> dict[str, Array]:
    """The columns of a CSV file."""
    import csv

    rows = [row for row in csv.reader(text_of(path, "table").splitlines()) if row]
    try:
        values = np.array([[float(cell) for cell in row] for row in rows[1:]])
        return {name.strip(): values[:, i] for i, name in enumerate(rows[0])}
    except (ValueError, IndexError) as error:
        raise FileError(path, f"is not a table of numbers below a line of names: {error}") from None


def _factors(part: LawPieces, rise: float, over: float, at_ends: Sequence[bool]) -> LawFactors:
    """Factors of a segment; ``at_ends``: of position and derivatives, whether each jumps where it begins or ends."""
    if not rise:  # of a law that goes and comes back there are none
        return LawFactors(*(3 * [math.nan if part.largest(1) else 0.0]))
    found = []
    for order in (1, 2, 3):
        jumps = [at_ends[k] or part.jumps(k) for k in range(order)]
        found.append(math.inf if any(jumps) else part.largest(order) * over**order / abs(rise))
    return LawFactors(*found)


class CamLaws(RowsByName[LawFactors]):
    """The factors of the standard laws by name; prints as a table."""

    def __init__(self) -> None:
        shapes = {name: rise_of(name) for name in (*SCCA, *RISES)}
        shapes["scca (1/3, 1/3, 1/3)"] = of_scca(1 / 3, 1 / 3, 1 / 3)
        shapes["scca (1/5, 0, 3/5)"] = of_scca(0.2, 0.0, 0.6)
        out = {}
        for name, shape in shapes.items():
            size = [shape.largest(k) for k in range(ORDERS)]
            ends = np.abs(shape.ends - np.array([[0.0] * 4, [1.0, 0, 0, 0]])).max(axis=0)
            out[name] = _factors(
                shape, 1.0, 1.0, [bool(e > SEAM_ROUNDING * max(s, 1.0)) for e, s in zip(ends, size, strict=True)]
            )
        self._rows = dict(sorted(out.items(), key=lambda item: item[1].Ca))

    def document(self) -> Document:
        """The table as a document."""
        rows = tuple((name, *(f"{v:.6f}" if math.isfinite(v) else "inf" for v in f)) for name, f in self.items())
        return Document("Cam laws from dwell to dwell", (Table(("law", "Cv", "Ca", "Cj"), rows),))


@door
def cam_laws() -> CamLaws:
    """Return the standard cam laws, a mapping of name to factors that prints as a table.

    ``Cv``, ``Ca`` and ``Cj`` are the largest velocity, acceleration and jerk of a rise between two dwells, over ``rise / over``, its
    square and its cube; infinite where the derivative before jumps. They are computed from the exact pieces.

    Returns
    -------
    CamLaws

    Examples
    --------
    >>> import mechgraph as mg
    >>> round(mg.cam_laws()["modified_sine"].Cv, 6)
    1.759603
    """
    return CamLaws()
