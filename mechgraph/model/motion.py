"""Drives and their motion.

A `Motion` holds position, velocity and acceleration of a driven freedom (and, where it is known, the time). A law is a row of `LAWS`:
an object that says which arguments it takes and evaluates (s, s', s'') at times t. A callable of t is a law too (`Smooth`); where it
gives the position alone it is differentiated by Chebyshev interpolation, to a stated error.

First and second derivative of a function that is known by its values, with an estimate of the error.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Protocol

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechgraph.errors import DeclarationError
from mechgraph.fields import FREEDOM_NAME, SERIES, TABLE, Described, between
from mechgraph.maths.linear import chebyshev
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.pairs.cam_laws import RISES, SCCA, Segment
from mechgraph.quantities import LENGTH, PURE, TIME, has_quantity, real_array, shown, wrong

CHEBYSHEV_POINTS = 32
"""Points of one panel where a callable is differentiated."""

CHEBYSHEV_NOISE = 8.0 * float(np.finfo(np.float64).eps)
"""Relative size below which a Chebyshev coefficient of a callable is taken for rounding."""


class NotSmooth(ArithmeticError):
    """A function whose derivatives cannot be found near ``t``."""

    def __init__(self, t: float) -> None:
        super().__init__(f"not smooth enough near t = {t:g} to be differentiated twice")
        self.t = t


@dataclass(frozen=True)
class _Panel:
    """A piece of a callable: Chebyshev coefficients on left <= t <= right, and the rounding in its values."""

    left: float
    right: float
    coefficients: Array
    rounding: float

    @property
    def slope(self) -> float:
        """The derivative of the Chebyshev variable, dx/dt = 2 / (right - left)."""
        return 2.0 / (self.right - self.left)

    @property
    def error(self) -> float:
        """Estimated error of the second derivative: rounding times T_n''(1) = n^2 (n^2 - 1) / 3."""
        n = self.coefficients.size - 1
        return self.rounding * self.slope**2 * n**2 * (n**2 - 1) / 3.0

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the interpolant and its two derivatives at t."""
        series = np.polynomial.Chebyshev(self.coefficients, (self.left, self.right))
        position, velocity, acceleration = (series.deriv(k)(t) for k in range(3))
        return position, velocity, acceleration


def derivatives(
    function: Callable[[Array], Array], t: Array, position: Array, low: float, high: float
) -> tuple[Array, Array]:
    """Return first and second derivative of a function at t, low <= t <= high, where it has the values ``position``.

    Taken from Chebyshev interpolants of degree 31 on panels of the range, halved until the last coefficients are down to rounding;
    coefficients below that are dropped. With n coefficients on a panel of length l the error of the second derivative is about

        8 eps max(|f| + |t f'| / 4) (2 / l)^2 n^4 / 3

    (Trefethen, Approximation Theory and Approximation Practice, 2013). The interpolants must also meet the given positions at t, unseen by
    their nodes, and each other: a jump of the velocity or acceleration from panel to panel is a kink.

    Raises
    ------
    NotSmooth
        at a kink, or where the estimated error exceeds ``DERIVATIVE_TOLERANCE``.
    """
    velocity, acceleration = np.empty(t.shape), np.empty(t.shape)
    panels = _panels(function, low, high)
    for panel in panels:
        here = (t >= panel.left) & (t <= panel.right)
        met, velocity[here], acceleration[here] = panel.at(t[here])
        # how many times its rounding the interpolant of a callable may miss a position
        missed = np.abs(met - position[here]) > 1e3 * panel.rounding
        if missed.any():
            raise NotSmooth(float(t[here][missed][0]))
    size = max(float(np.abs(panel.coefficients).sum()) for panel in panels)
    span = high - low
    # largest estimated error of s'' relative to max |s''| or 4 max |s| / range^2, and likewise of s'
    most = 1e-6
    fast = most * max(float(np.abs(velocity).max()), 2.0 * size / span)
    steep = most * max(float(np.abs(acceleration).max()), 4.0 * size / span**2)
    for panel in panels:
        if panel.error > steep:
            raise NotSmooth((panel.left + panel.right) / 2.0)
    for panel, following in itertools.pairwise(panels):
        before, after = (side.at(np.array(panel.right)) for side in (panel, following))
        if abs(before[1] - after[1]) > fast or abs(before[2] - after[2]) > steep:
            raise NotSmooth(panel.right)
    return velocity, acceleration


def _panels(function: Callable[[Array], Array], low: float, high: float) -> list[_Panel]:
    """Return panels, in order, whose Chebyshev coefficients go down to rounding.

    The rounding in the values is 8 eps (|f| + |t f'| / 4), the second term from that in t.
    """
    nodes, _, to_series = chebyshev(CHEBYSHEV_POINTS)
    done: list[_Panel] = []
    ends = [(low, high)]
    # part of the range of a callable below which it counts as not smooth
    least = (high - low) / 2.0**16.5
    while ends:
        # of many the last ones first, down to where they are smooth or too short: noise is found out by few
        ends, some = ends[:-64], ends[-64:]
        left, right = np.array(some).T[:, :, None]
        times = (left + right) / 2.0 + (right - left) / 2.0 * nodes
        values = function(times)
        steep = np.abs(times).max(1) * np.abs(np.diff(values) / np.diff(times)).max(1)
        rounding = CHEBYSHEV_NOISE * (np.abs(values).max(1) + steep / 4.0)
        halves: list[tuple[float, float]] = []
        for (a, b), coefficients, floor in zip(some, values @ to_series.T, rounding, strict=True):
            significant = np.flatnonzero(np.abs(coefficients) > floor)
            length = int(significant[-1]) + 1 if significant.size else 1
            if length <= CHEBYSHEV_POINTS - 4:
                done.append(_Panel(a, b, coefficients[:length], float(floor)))
            else:
                halves += [(a, (a + b) / 2.0), ((a + b) / 2.0, b)]
        for a, b in halves:
            if b - a < least:
                raise NotSmooth(a)
        ends += halves
    return sorted(done, key=lambda panel: panel.left)


Rates = tuple[Array, Array, Array]
"""Position, velocity, acceleration."""


def read_series(value: Any, what: str, faults: list[str]) -> Array:
    """Return `value` as a new float64 array; what keeps it from being finite goes to `faults`."""
    array = real_array(value)
    if array is None:
        faults.append(wrong(value, what, "a real number, or an array of them with rows of one length"))
        return np.zeros(())
    numbers = np.array(array)
    if not np.isfinite(numbers).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        faults.append(f"{what} must be finite, got {numbers[where]}{f' at index {where}' if where else ''}")
    return numbers


class LawFault(Exception):
    """Why a law cannot be evaluated; `Motion.law` raises it as a DeclarationError that names the law."""


class MotionLaw(Protocol):
    """A rule that gives position, velocity and acceleration at times t."""

    @property
    def choices(self) -> tuple[tuple[str, ...], ...]:
        """Alternative sets of arguments, of which exactly one is needed."""

    @property
    def optional(self) -> tuple[str, ...]:
        """Arguments that may be given besides."""

    def rates(self, t: Array, given: Mapping[str, Any]) -> Rates:
        """Return position, velocity, acceleration at t (shapes that broadcast with t), or raise LawFault."""


@dataclass(frozen=True)
class DwellRise:
    """Dwell, rise, dwell: the law of a segment of a cam (``pairs.cam_laws``) over a duration T.

    s = start + rise y(tau), s' = rise / T y'(tau), s'' = rise / T^2 y''(tau), tau = t / T.

    y(0) = 0 and y(1) = 1, but for laws by conditions, which say the rise. Outside, the position is held and the rates are 0; at
    the ends themselves they are those of the rise.
    """

    name: str
    choices: tuple[tuple[str, ...], ...] = (("rise", "duration"),)
    optional: tuple[str, ...] = ("start",)

    def rates(self, t: Array, given: Mapping[str, Any]) -> Rates:
        """Return position, velocity and acceleration at t."""
        shape = {key: value for key, value in given.items() if key in SHAPE_OF_LAW}
        rise, duration, whole = given.get("rise", 1.0), given.get("duration", 1.0), 1.0
        if "conditions" in shape:
            if np.ndim(duration):
                raise LawFault("duration must be one number beside conditions, which stand at times")
            whole = float(duration)
        numbers = {"rise": 1.0} if "rise" in given else {}
        segment = Segment(self.name, over=whole, **numbers, **shape)
        if faults := segment.faults(""):
            raise LawFault("; ".join(faults))
        inside = (t >= 0.0) & (t <= duration)
        tau = np.clip(t / duration, 0.0, 1.0)
        pieces = segment.pieces().scaled(1.0, 1.0 / whole)
        y = pieces.at(tau, 3)
        y = np.where(tau == 1.0, pieces.ends[1][:3].reshape(3, *(1,) * tau.ndim), y)
        return (
            given.get("start", 0.0) + rise * y[0],
            np.where(inside, rise / duration * y[1], 0.0),
            np.where(inside, rise / duration**2 * y[2], 0.0),
        )


@dataclass(frozen=True)
class ConstantSpeed:
    """Constant speed for all t: s = start + speed t, with speed = rise / duration where those are given."""

    choices: tuple[tuple[str, ...], ...] = (("rise", "duration"), ("speed",))
    optional: tuple[str, ...] = ("start",)

    def rates(self, t: Array, given: Mapping[str, Any]) -> Rates:
        """Return position, velocity and acceleration at t."""
        start = given.get("start", 0.0)
        if "speed" in given:
            speed: Array = given["speed"]
            return start + speed * t, speed, np.zeros(())
        rise, duration = given["rise"], given["duration"]
        return start + rise * (t / duration), rise / duration, np.zeros(())


@dataclass(frozen=True)
class SampledLaw:
    """Spline through samples, with "not-a-knot" ends (de Boor, A Practical Guide to Splines, 1978).

    Of degree 5 the error of position, velocity and acceleration falls as h^6, h^5 and h^4 with the spacing h,
    of degree 3 as h^4, h^3, h^2 (for values that are themselves smooth). There is no smoothing: noise in the
    values is amplified by 1 / h^2 in the acceleration.
    """

    choices: tuple[tuple[str, ...], ...] = (("samples",),)
    optional: tuple[str, ...] = ("degree",)

    def rates(self, t: Array, given: Mapping[str, Any]) -> Rates:
        """Return position, velocity and acceleration at t; outside the range of the samples is a fault."""
        times, values = _checked_samples(given["samples"])
        degree = given.get("degree", 5 if times.size >= 6 else 3)
        if type(degree) is not int or degree not in (3, 5) or times.size <= degree:
            raise LawFault(
                f"degree must be 3 (from 4 samples) or 5 (from 6), got {shown(degree)} with {times.size} samples"
            )
        # times may leave the range of the samples by this part of its length (rounding) and count as its end
        margin = 1e-12 * (times[-1] - times[0])
        outside = t[(t < times[0] - margin) | (t > times[-1] + margin)]
        if outside.size:
            span = f"{times[0]:g} to {times[-1]:g}"
            raise LawFault(f"t = {outside[0]:g} is outside the samples, which run from {span}")
        return _splined(times, values, degree, np.clip(t, times[0], times[-1]))


def _splined(times: Array, values: Array, degree: int, t: Array) -> Rates:
    """Value and first two derivatives at t of the spline through samples; times are scaled to -1 ... 1 before."""
    middle, half = (times[0] + times[-1]) / 2.0, (times[-1] - times[0]) / 2.0
    spline = scipy.interpolate.make_interp_spline((times - middle) / half, values, k=degree)
    x = (t - middle) / half
    first, second = (np.asarray(spline(x, n), dtype=np.float64) / half**n for n in (1, 2))
    return np.asarray(spline(x), dtype=np.float64), first, second


def rates_of_samples(times: Array, values: Array) -> Rates:
    """Values and rates ``(..., n)`` of the spline of `SampledLaw` through values at times, row by row; zero where all are the same.

    Raises
    ------
    LawFault
        where times do not increase along the last axis.
    """
    n = values.shape[-1] if values.ndim else 1
    if n == 1 or not np.diff(values, axis=-1).any():
        return values, np.zeros(values.shape), np.zeros(values.shape)
    if (np.diff(times, axis=-1) <= 0.0).any():
        raise LawFault(
            "t must increase along its last axis, as the rates are those of the spline through the samples; or give velocity"
        )
    degree = 5 if n >= 6 else min(3, n - 1)
    rows = [_splined(t, q, degree, t) for t, q in zip(times.reshape(-1, n), values.reshape(-1, n), strict=True)]
    position, first, second = (np.stack(part).reshape(values.shape) for part in zip(*rows, strict=True))
    return position, first, second


def _checked_samples(samples: Any) -> tuple[Array, Array]:
    """Return times and values of samples; LawFault where they are no increasing times with one value each."""
    try:
        first, second = samples
    except (TypeError, ValueError):
        raise LawFault(wrong(samples, "samples", "a pair (times, values)")) from None
    faults: list[str] = []
    times = read_series(first, "times of the samples", faults)
    values = read_series(second, "values of the samples", faults)
    if faults:
        raise LawFault("; ".join(faults))
    if times.ndim != 1 or values.shape != times.shape or times.size < 4:
        shapes = f"{times.shape} and {values.shape}"
        raise LawFault(f"samples must be two lists of the same length, at least 4, got shapes {shapes}")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        early, late = times[back[0] : back[0] + 2]
        raise LawFault(f"times of the samples must increase, but {early:g} is followed by {late:g}")
    return times, values


@dataclass(frozen=True)
class Smooth:
    """A callable of t: s = f(t), or (s, s', s'') = f(t), taken unchanged where rates are the derivatives of what they belong to.

    It is called with arrays, and if it cannot take them (TypeError, ValueError) with one float at a time.
    Where it returns the position alone, it is differentiated (`derivatives`), in practice to below 1e-10 of the largest
    acceleration for a motion of some cycles; a kink, or an estimated error above 1e-6, is a fault and never a wrong number. A range of
    times is never left; one single time is taken as the middle of a range of length max(1, |t|), or of the first tenth of it, and so
    on, in which the callable exists and is smooth.
    """

    function: Callable[[Any], Any]
    choices: tuple[tuple[str, ...], ...] = ((),)
    optional: tuple[str, ...] = ()

    def rates(self, t: Array, given: Mapping[str, Any]) -> Rates:
        """Return position, velocity and acceleration at t."""
        result = self._called(t)
        if isinstance(result, tuple):
            if len(result) != 3:
                wanted = "the position or (position, velocity, acceleration)"
                raise LawFault(f"it must return {wanted}, got a tuple of {len(result)}")
            position, velocity, acceleration = (self._values(part, t) for part in result)
            self._compare(t)
            return position, velocity, acceleration
        position = self._values(result, t)
        if t.size == 0:
            return position, position, position
        low, high = float(t.min()), float(t.max())
        if low < high:
            try:
                return position, *derivatives(self.position, t, position, low, high)
            except NotSmooth as found:
                raise _not_smooth(found.t) from None
        # ranges that are tried about one single time, each a tenth of the one before
        halves = [max(1.0, abs(low)) / 2.0 / 10.0**k for k in range(7)]
        for half in halves:
            try:
                with np.errstate(all="ignore"):
                    rates = derivatives(self.position, t, position, low - half, high + half)
            except (LawFault, NotSmooth):
                continue
            return position, *rates
        raise _not_smooth(low)

    def _compare(self, t: Array) -> None:
        """Refuse rates that are not the derivatives of what they belong to, by central differences between up to 64 of the times.

        The step that fits best counts, as a true rate may change fast; a thousandth of the largest rate is taken for rounding.
        """
        times = np.unique(t)[:: max(1, t.size // 64)]
        if times.size < 2:
            return
        at = between(times)

        def ask(u: Array) -> Array:
            return np.array([self._values(part, u) for part in self._called(u)])

        known = ask(at)
        for high, words in ((1, ("velocity", "position")), (2, ("acceleration", "velocity"))):
            miss = np.full(at.shape, np.inf)
            for part in (1e-2, 1e-3, 1e-4):
                h = part * np.diff(times)
                slope = (ask(at + h)[high - 1] - ask(at - h)[high - 1]) / (2.0 * h)
                miss = np.minimum(miss, np.abs(slope - known[high]))
            least = np.abs(known[high - 1]).max() * 1e-12 / np.diff(times).min() * 1e4  # rounding of a difference
            if miss.max() > max(1e-3 * np.abs(known[high]).max(), least):
                worst = int(np.argmax(miss))
                raise LawFault(
                    f"the {words[0]} that it returns is not the rate of the {words[1]}: it differs by {miss[worst]:.3g} from that at "
                    f"t = {at[worst]:.6g}, where it is {known[high][worst]:.6g}"
                )

    def position(self, t: Array) -> Array:
        """Return the position alone at t, whatever the function returns."""
        return self._values(self._called(t), t)

    def _called(self, t: Array) -> Any:
        """Call the function with the array, or value by value where it takes no arrays."""
        try:
            return self.function(t.copy() if t.ndim else float(t))
        except Exception as error:  # what a user's function raises may be anything
            if t.ndim == 0:
                raise LawFault(f"it fails at t = {float(t):g}: {type(error).__name__}: {error}") from None
        single = [self._called(np.asarray(value)) for value in t.ravel()]
        try:
            if single and isinstance(single[0], tuple):
                return tuple(np.reshape(column, t.shape) for column in zip(*single, strict=True))
            return np.reshape(single, t.shape)
        except (TypeError, ValueError):
            raise LawFault(f"it must return one number a time, got {single[0]!r}") from None

    @staticmethod
    def _values(result: Any, t: Array) -> Array:
        """Return what the function returned as an array of the shape of t."""
        faults: list[str] = []
        values = read_series(result, "what it returns", faults)
        if faults:
            raise LawFault("; ".join(faults))
        if values.shape not in (t.shape, ()):
            raise LawFault(f"it must return one value a time, shape {t.shape}, got shape {values.shape}")
        return np.array(np.broadcast_to(values, t.shape))


def _not_smooth(t: float) -> LawFault:
    """Return the fault of a callable whose derivatives cannot be found."""
    return LawFault(
        f"it is not smooth enough near t = {t:g} to be differentiated twice; "
        "let it return (position, velocity, acceleration), or use the law 'sampled'"
    )


SHAPE_OF_LAW = ("sine", "constant", "cosine", "coefficients", "conditions", "knots")
"""Arguments that say the shape of a rise."""
LAWS: Mapping[str, MotionLaw] = {
    **{name: DwellRise(name) for name in (*SCCA, *RISES)},
    "scca": DwellRise("scca", optional=("start", "sine", "constant", "cosine")),
    "polynomial": DwellRise("polynomial", (("rise", "duration", "coefficients"), ("duration", "conditions"))),
    "bspline": DwellRise("bspline", (("duration", "conditions", "knots"),)),
    "dwell": DwellRise("dwell", ((),)),
    "constant_speed": ConstantSpeed(),
    "sampled": SampledLaw(),
}
"""The laws by name; those of the segments of a cam, from dwell to dwell, and two that have no ends."""


__all__ = ["LAWS", "Motion"]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Motion(Described):
    """Prescribe position, velocity and acceleration of a freedom, one value per position.

    The arrays are broadcast against each other, copied and read-only. Two motions are equal if all arrays are equal entry by entry.
    Of a point of a link the arrays are ``(..., 3)``; of link poses ``(..., 4, 4)``, with twists and their rates ``(..., 6)`` about
    the global origin. ``given`` keeps the arrays as given.

    Parameters
    ----------
    position : (...) array_like
        [rad, length]. Quantities of pint are converted by a mechanism that declares units.
    velocity, acceleration : (...) array_like, optional
        First and second time derivative. Default: those of the spline through the samples if ``t`` is given, else 0. ``velocity=0.0``
        means stationary.
    t : (...) array_like, optional
        Times.

    Raises
    ------
    DeclarationError
        With every fault: values that are not finite real numbers, shapes that do not broadcast.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import numpy as np
    >>> turn = mg.Motion(np.linspace(0, 6, 4), velocity=10.0)
    >>> mg.solve(mg.load("four-bar"), {"A": turn})["A"].effort.shape
    (4, 1)
    """

    position: Annotated[Array, SERIES("one a position", LENGTH, PURE, degrees=True, default="this or a sweep")]
    velocity: Annotated[
        Array, SERIES("its rate", (1, 0, -1), (0, 0, -1), degrees=True, default="of a spline over `t`; without `t` 0")
    ]
    acceleration: Annotated[Array, SERIES("the rate of that", (1, 0, -2), (0, 0, -2), degrees=True, default="likewise")]
    t: Annotated[Array | None, SERIES("times, where known", TIME, default="none")]
    given: ClassVar[tuple[Any, ...]] = ()

    def __init__(
        self,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        t: ArrayLike | None = None,
    ) -> None:
        given: dict[str, Any] = {
            "position": position,
            "velocity": velocity,
            "acceleration": acceleration,
            "t": t,
        }
        if any(map(has_quantity, given.values())):  # kept as given: only a mechanism knows its units
            self._set(given, tuple(given.values()))
            return
        faults: list[str] = []
        arrays = {
            name: read_series(value, name, faults)
            for name, value in given.items()
            if value is not None or name == "position"
        }
        read = tuple(arrays.get(name) for name in given)
        shape: tuple[int, ...] = ()
        try:
            shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        except ValueError:
            if not faults and _is_of_vectors(arrays):
                self._set(dict(zip(given, read, strict=True)), read)
                return
            shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            faults.append(f"shapes do not broadcast against each other: {shapes}")
        if faults:
            raise DeclarationError("motion", faults)
        arrays = {name: np.array(np.broadcast_to(array, shape)) for name, array in arrays.items()}
        try:
            arrays |= _missing_rates(arrays)
        except LawFault as fault:
            raise DeclarationError("motion", [str(fault)]) from None
        self._set({name: arrays.get(name) for name in given}, read)

    def _set(self, fields: Mapping[str, Any], given: tuple[Any, ...]) -> None:
        for array in (*fields.values(), *given):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "given", given)

    @property
    def _quantities(self) -> dict[str, Any]:
        """What holds quantities that are not converted to plain numbers yet."""
        return {name: value for name in self.formats if has_quantity(value := getattr(self, name))}

    def faults(self, where: str = "") -> list[str]:
        """Quantities that are not converted to plain numbers yet, one line each."""
        left = self._quantities
        if not left and self.velocity is None:
            return [f"{where}holds points or poses, shape {self.shape}; expected one number a position"]
        return [wrong(value, where + name, "plain numbers") for name, value in left.items()]

    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape of the arrays; empty for one position."""
        return self.position.shape

    @property
    def _arrays(self) -> tuple[Array | None, ...]:
        """All arrays, in the order of the parameters."""
        return tuple(getattr(self, name) for name in self.formats)

    def __eq__(self, other: object) -> bool:
        """Compare all arrays exactly; a motion without times differs from one with."""
        if not isinstance(other, Motion):
            return NotImplemented
        if self._quantities or other._quantities:
            return self is other
        return all(
            (mine is None) == (theirs is None) and (mine is None or theirs is None or np.array_equal(mine, theirs))
            for mine, theirs in zip(self._arrays, other._arrays, strict=True)
        )

    def __hash__(self) -> int:
        """Return a hash of shapes and values; 0.0 and -0.0 hash alike since they compare equal."""
        if self._quantities:
            return id(self)
        return hash((self.shape, *((array + 0.0).tobytes() for array in self._arrays if array is not None)))

    def __repr__(self) -> str:
        """Return the shape and the range of every quantity."""
        if self._quantities:
            return f"Motion({', '.join(f'{name}={shown(getattr(self, name))}' for name in self.formats)})"
        parts = [f"shape={self.shape}"] if self.shape else []
        for name, array in zip(self.formats, self._arrays, strict=True):
            if array is not None and array.size:
                low, high = float(array.min()), float(array.max())
                parts.append(f"{name}={low:g}" if low == high else f"{name}={low:g}..{high:g}")
        return f"Motion({', '.join(parts)})"

    def __reduce__(self) -> tuple[type[Motion], tuple[Array | None, ...]]:
        """Copy and unpickle through the constructor, so that the arrays are read-only again."""
        return type(self), self.given

    @classmethod
    def law(
        cls,
        name: str | Callable[[Any], Any],
        rise: ArrayLike | None = None,
        duration: ArrayLike | None = None,
        t: ArrayLike | None = None,
        *,
        start: ArrayLike | None = None,
        speed: ArrayLike | None = None,
        samples: tuple[ArrayLike, ArrayLike] | None = None,
        degree: int | None = None,
        sine: float | None = None,
        constant: float | None = None,
        cosine: float | None = None,
        coefficients: ArrayLike | None = None,
        conditions: Mapping[Any, float] | ArrayLike | None = None,
        knots: ArrayLike | None = None,
    ) -> Motion:
        """Return the motion that a law prescribes at times t, with t stored.

        ==================  ========================  ===================================================
        law                 arguments                 position
        ==================  ========================  ===================================================
        those of            rise, duration            start + rise y(t / duration), constant before 0 and
        ``mg.cam_laws()``                             after duration
        ``scca``            and sine, constant,       likewise
                            cosine
        ``polynomial``      and coefficients; or      likewise; by conditions, which say the rise
                            duration, conditions
        ``bspline``         duration, conditions,     by conditions
                            knots
        ``dwell``           none                      start
        ``constant_speed``  rise, duration; or speed  start + speed t for all t, speed = rise / duration
        ``sampled``         samples=(times, values)   spline through the samples
        a function          none                      f(t)
        ==================  ========================  ===================================================

        Parameters
        ----------
        name : str or callable
            Name of a law, or a function of t that returns the position or (position, velocity, acceleration).
        rise, duration, start, speed : (...) array_like
            Numbers, or arrays that broadcast against t (many cases); duration > 0. Default of start: 0.
        t : (...) array_like
            Times; a scalar gives a motion without leading axis. Required by every law.
        samples : pair of (n,) array_like
            Times, increasing, and values there; n >= 4.
        degree : int
            Degree of the spline through samples, 3 or 5. Default: 5, with fewer than 6 samples 3.
        sine, constant, cosine, coefficients, conditions, knots
            Shape of the law, as of ``mg.Segment``, with times in place of angles.

        Returns
        -------
        Motion

        Raises
        ------
        DeclarationError
            Unknown name, a missing or unused argument, values out of range.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.Motion.law("cycloidal", rise=2.0, duration=1.0, t=[0.0, 0.5, 1.0]).position
        array([0., 1., 2.])
        """
        rule: MotionLaw
        if callable(name):
            rule, title = Smooth(name), f"motion law {getattr(name, '__name__', name)!r}"
        elif isinstance(name, str) and name in LAWS:
            rule, title = LAWS[name], f"motion law {name!r}"
        else:
            raise DeclarationError(
                "motion law", [f"no law is named {shown(name)}; use {', '.join(LAWS)} or a callable of t"]
            )
        numeric: dict[str, Any] = {"rise": rise, "duration": duration, "start": start, "speed": speed}
        everything: dict[str, Any] = {**numeric, "samples": samples, "degree": degree}
        everything |= dict(zip(SHAPE_OF_LAW, (sine, constant, cosine, coefficients, conditions, knots), strict=True))
        given = {key: value for key, value in everything.items() if value is not None}
        faults = _argument_faults(rule, given)
        if t is None:
            faults.append("t is missing: the times at which the motion is wanted")
        times = read_series(0.0 if t is None else t, "t", faults)
        numbers = {key: read_series(given[key], key, faults) for key in numeric if key in given}
        if "duration" in numbers and not faults and not (numbers["duration"] > 0).all():
            faults.append(f"duration must be positive, got {duration!r}")
        if not faults:
            try:
                np.broadcast_shapes(times.shape, *(array.shape for array in numbers.values()))
            except ValueError:
                shapes = ", ".join(f"{key} {array.shape}" for key, array in [("t", times), *numbers.items()])
                faults.append(f"shapes do not broadcast against each other: {shapes}")
        if faults:
            raise DeclarationError(title, faults)
        try:
            return cls(*rule.rates(times, {**given, **numbers}), t=times)
        except LawFault as fault:
            raise DeclarationError(title, [str(fault)]) from None


def _is_of_vectors(arrays: Mapping[str, Array]) -> bool:
    """Whether arrays are those of points ``(..., 3)`` or poses ``(..., 4, 4)``: their times have one or two axes less."""
    position = arrays["position"].shape
    for entry, rate in (((3,), (3,)), ((4, 4), (6,))):
        batch = position[: -len(entry)]
        if position[-len(entry) :] != entry:
            continue
        own = {"position": position, "velocity": (*batch, *rate), "acceleration": (*batch, *rate), "t": batch}
        try:
            return all(np.broadcast_shapes(own[name], array.shape) == own[name] for name, array in arrays.items())
        except ValueError:
            return False
    return False


def _missing_rates(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Rates that were left out: of the spline through the samples where there are times, else 0."""
    position, t = arrays["position"], arrays.get("t")
    missing = {"velocity", "acceleration"} - arrays.keys()
    found = (np.zeros(position.shape), np.zeros(position.shape))
    if t is not None and missing:
        known = arrays.get("velocity")
        found = rates_of_samples(t, position)[1:] if known is None else (known, rates_of_samples(t, known)[1])
    return {name: value for name, value in zip(("velocity", "acceleration"), found, strict=True) if name in missing}


def _argument_faults(rule: MotionLaw, given: Mapping[str, Any]) -> list[str]:
    """Return the arguments that are missing for every alternative of a law, or that it does not use."""
    usable = {key for choice in rule.choices for key in choice} | set(rule.optional)
    faults = [f"{key} is not an argument of this law" for key in given if key not in usable]
    fitting = [choice for choice in rule.choices if set(choice) <= set(given)]
    needs = ", or ".join(" and ".join(choice) for choice in rule.choices)
    if not fitting:
        return [*faults, f"it needs {needs}"]
    surplus = usable - set(rule.optional) - set(fitting[0])
    return [*faults, f"it needs {needs}, not both"] if surplus & set(given) else faults


@dataclass(frozen=True)
class Drive(Described):
    """Declare a driven freedom, ``"A"`` or ``"B.Tz"``, with the motion to use if ``solve`` is given none.

    Rotations of S, Sg and Sp take efforts, not drives.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("four-bar").replace(drives=[mg.Drive("A", mg.Motion([0.0, 0.5]))])
    >>> mg.solve(m)["A"].position[:, 0]
    array([0. , 0.5])
    """

    freedom: Annotated[str, FREEDOM_NAME("the driven freedom; not one of a rotation of S, Sg, Sp")]
    motion: Annotated[Motion | None, TABLE("used where `solve` is given none", table="motion", default="none")] = None

    def faults(self) -> list[str]:
        """What is wrong with the motion, one line each."""
        where = f"drive {self.freedom!r}: motion"
        if isinstance(self.motion, Motion):
            return self.motion.faults(f"{where}.")
        return [] if self.motion is None else [wrong(self.motion, where, "a Motion, mg.Motion(position, ...)")]
