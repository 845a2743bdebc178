"""Tables of a force over coordinate and rate, read between their points by the piecewise cubics of ``scipy.interpolate``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import POSITION, RATE, SAMPLES, TEXT
from mechgraph.quantities import shown, wrong
from mechgraph.units import FORCE, MOMENT

CUBICS = {"monotone": "PchipInterpolator", "cubic": "CubicSpline"}
"""Piecewise cubics of ``scipy.interpolate`` by the name of the interpolation."""


@dataclass(frozen=True)
class ForceTable(Described):
    """A force over the coordinate ``x``, over the rate ``v``, or over a grid of both (then ``force[i][j]`` at ``x[i]``, ``v[j]``).

    ``interpolation``: ``"monotone"`` (once differentiable, never beyond the neighbouring values: Fritsch and Butland, 1984) or ``"cubic"``
    (twice differentiable spline). ``outside`` of the table: ``"error"``, or ``"hold"``, the value at its end.
    """

    x: Annotated[Any, SAMPLES("coordinates or distances, rising", **POSITION, default="this,")] = None
    v: Annotated[Any, SAMPLES("rates, rising", **RATE, default="this, or both")] = None
    force: Annotated[Any, SAMPLES("one for each `x` or `v`, or for both a row of `v` for each `x`", FORCE, MOMENT)] = ()
    interpolation: Annotated[
        Literal["monotone", "cubic"],
        TEXT('`"monotone"`: not beyond the neighbouring values; `"cubic"`: smoother', choices=tuple(CUBICS)),
    ] = "monotone"
    outside: Annotated[
        Literal["error", "hold"],
        TEXT('beyond the ends an `"error"`, or the value there (`"hold"`)', choices=("error", "hold")),
    ] = "error"

    def __post_init__(self) -> None:
        self.read_numbers()

    def faults(self, where: str) -> list[str]:
        """What is wrong with the table."""
        faults = self.value_faults(where)
        axes = {name: axis for name in "xv" if (axis := getattr(self, name)) is not None}
        if faults or not axes:
            return faults or [f"{where}x, {where}v: neither is given; give the places of the table"]
        for name, axis in axes.items():
            if np.ndim(axis) != 1 or len(axis) < 2 or not (np.diff(axis) > 0).all():
                faults.append(wrong(axis, where + name, "at least two rising numbers"))
        shape = tuple(np.size(axis) for axis in axes.values())
        if np.shape(self.force) != shape:
            faults.append(
                f"{where}force: expected {' x '.join(map(str, shape))} numbers, got shape {np.shape(self.force)}"
            )
        return faults

    @property
    def has_energy(self) -> bool:
        """Whether the force depends on the coordinate alone."""
        return self.v is None

    def within(self, name: str, at: Array) -> Array:
        """Places ``(T,)`` moved to the nearest in the table, where that may be.

        Raises
        ------
        ValueError
            where a place lies outside of a table that ends there.
        """
        axis = getattr(self, name)
        inside = np.clip(at, axis[0], axis[-1])
        rounding = 1e-9 * (axis[-1] - axis[0])  # a stroke that ends with the table is within it
        if self.outside == "error" and not (np.abs(at - inside) <= rounding).all():
            worst = at[np.argmax(np.abs(at - inside))]
            raise ValueError(
                f"{name} = {worst:.6g} lies outside of the table, which ends at {axis[0]:.6g} and {axis[-1]:.6g}; extend the table, or "
                "give outside='hold'"
            )
        return inside

    def _cubic(self, places: Any, values: Any, axis: int) -> Any:
        return getattr(scipy.interpolate, CUBICS[self.interpolation])(places, values, axis=axis)

    @cached_property
    def _last(self) -> Any:
        """The piecewise cubic over the last axis."""
        return self._cubic(self.x if self.v is None else self.v, self.force, -1)

    def at(self, x: Array, v: Array) -> Array:
        """The force ``(T,)`` at coordinates and rates ``(T,)``."""
        if self.v is None or self.x is None:
            return np.asarray(self._last(self.within("x", x) if self.v is None else self.within("v", v)))
        rows, x = self._last(self.within("v", v)), self.within("x", x)
        pieces = self._cubic(self.x, rows, 0)
        i = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        c, d = pieces.c[:, i, np.arange(len(x))], x - pieces.x[i]
        return np.asarray(((c[0] * d + c[1]) * d + c[2]) * d + c[3])

    def energy(self, x: Array) -> Array:
        """``-int F dx (T,)`` from the beginning of a table over ``x`` alone."""
        inside = self.within("x", x)
        return -np.asarray(self._last.antiderivative()(inside) + self._last(inside) * (x - inside))

    def __repr__(self) -> str:
        given = {name: shown(value) for name in self.formats if (value := getattr(self, name)) is not None}
        return f"ForceTable({', '.join(f'{name}={value}' for name, value in given.items())})"
