"""Prescribed motions of a driver.

A `Motion` holds position, velocity and acceleration of a driven freedom (and, where it is known, the time); the laws that generate them
stand in ``motion_law``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import SERIES
from mechgraph.model.motion_law import LAWS, Law, LawFault, Smooth, rates_of_samples, read_series
from mechgraph.quantities import has_quantity, shown, wrong
from mechgraph.units import LENGTH, PURE, TIME

__all__ = ["LAWS", "Motion"]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Motion(Described):
    """What a driver prescribes: position, velocity and acceleration of one freedom, one value a position.

    The arrays are broadcast against each other, copied, and read-only. Two motions are equal if all their
    arrays are equal, entry by entry, with no tolerance.

    Parameters
    ----------
    position : (...) array_like
        Radians or lengths. Quantities of pint are converted by the mechanism that they are used for, if it declares units.
    velocity, acceleration : (...) array_like, optional
        First and second time derivative. Left out: those of the spline through the samples where ``t`` is given (of velocities, where
        they are; see `Sampled`), else 0. ``velocity=0.0`` says at rest.
    t : (...) array_like, optional
        Times. Where given they are broadcast with the rest.

    Of a point of a link the arrays are ``(..., 3)``, of a link poses ``(..., 4, 4)`` with twists and their rates ``(..., 6)`` about the
    global origin; ``t`` stays ``(...)``. The arrays as they were given are kept in ``given``.

    Raises
    ------
    DeclarationError
        Values that are not finite real numbers, shapes that do not broadcast; all of them at once.
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
    ) -> Motion:
        """Return the motion that a law prescribes at times t, with t stored.

        ==================  ========================  ===================================================
        law                 arguments                 position
        ==================  ========================  ===================================================
        ``cycloidal``       rise, duration            start + rise y(t / duration), y in the text of `LAWS`;
        ``harmonic``                                  held before 0 and after duration, where velocity and
        ``poly345``                                   acceleration are 0
        ``poly4567``
        ``constant_speed``  rise, duration; or speed  start + speed t for all t, speed = rise / duration
        ``sampled``         samples=(times, values)   spline through the samples (`Sampled`)
        a callable          none                      f(t) (`Smooth`)
        ==================  ========================  ===================================================

        Parameters
        ----------
        name : str or callable
            Name of a law, or a function of t that returns the position or (position, velocity, acceleration).
        rise, duration, start, speed : (...) array_like
            Numbers, or arrays that broadcast against t (many cases); duration > 0; start is 0 where left out.
        t : (...) array_like
            Times; a scalar gives a motion without leading axis. Needed by every law.
        samples : pair of (n,) array_like
            Times, increasing, and values there; n >= 4.
        degree : int
            Degree of the spline through samples, 3 or 5; left out: 5, with fewer than 6 samples 3.

        Raises
        ------
        DeclarationError
            Unknown name, an argument that is missing or that the law does not use, values out of range; all
            at once where they can be known at once.
        """
        rule: Law
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


def _argument_faults(rule: Law, given: Mapping[str, Any]) -> list[str]:
    """Return the arguments that are missing for every alternative of a law, or that it does not use."""
    usable = {key for choice in rule.choices for key in choice} | set(rule.optional)
    faults = [f"{key} is not an argument of this law" for key in given if key not in usable]
    fitting = [choice for choice in rule.choices if set(choice) <= set(given)]
    needs = ", or ".join(" and ".join(choice) for choice in rule.choices)
    if not fitting:
        return [*faults, f"it needs {needs}"]
    surplus = usable - set(rule.optional) - set(fitting[0])
    return [*faults, f"it needs {needs}, not both"] if surplus & set(given) else faults
