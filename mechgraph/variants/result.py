"""What a study found: labelled arrays, quantiles, sensitivities, and every variant as a mechanism that can be checked alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, counted
from mechgraph.files import optional
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.result.values import number
from mechgraph.variants.outputs import Output, unit_of_output
from mechgraph.variants.sampling import deviation, reach
from mechgraph.variants.work import STATUSES, Part, Source, worst

if TYPE_CHECKING:
    import pandas
    import xarray

VARIANTS_LISTED = 10
"""Most variants that are named with the reason why they were not solved."""


class Study(Shown):
    """Results of ``study``; arrays have the variants first, then the positions, then components.

    Attributes
    ----------
    parameters : name -> values ``(n,)``.
    outputs : name -> array ``(n, ...)``, NaN where a variant or position was not solved.
    nominal : name -> array ``(...)`` of the mechanism itself (with the motion of the first variant, where each has its own).
    units : name -> unit of an output, one for every entry of its last axis where they differ; empty where it is not known.
    messages : variant -> why it could not be solved.
    warnings : what makes reactions doubtful, as in ``Solution.warnings``, with the greatest effort, pull or error in all variants.
    """

    def __init__(
        self,
        source: Source,
        ways: Mapping[str, Any],
        values: Array,
        steps: Array,
        names: Mapping[str, Output],
        motions: Mapping[str, Motion],
        near: Part,
        parts: Sequence[Part],
    ) -> None:
        self._source, self._ways, self._values, self._steps, self._near = source, ways, values, steps, near
        self.motions: Mapping[str, Motion] = dict(motions)
        self.parameters: Mapping[str, Array] = dict(zip(ways, values, strict=True))
        self._outcomes: NDArray[np.int8] = np.concatenate([part.status for part in parts])
        shape = next((part.outputs for part in [near, *parts] if part.outputs is not None), None)
        shapes = {name: self._outcomes.shape[1:] if shape is None else shape[name].shape[1:] for name in names}
        self.outputs: Mapping[str, Array] = {
            name: np.concatenate(
                [
                    np.full((len(part.status), *shapes[name]), np.nan)
                    if part.outputs is None
                    else part.outputs.pop(name)
                    for part in parts
                ]
            )
            for name in names
        }
        self.units: Mapping[str, str | tuple[str, ...]] = {
            name: unit_of_output(source.mechanism, what) for name, what in names.items()
        }
        self.warnings = worst(warning for part in [near, *parts] for warning in part.warnings)
        self.messages: dict[int, str] = {}
        first = 0
        for part in parts:
            self.messages |= {first + i: text for i, text in part.messages.items()}
            first += len(part.status)

    def __repr__(self) -> str:
        count, bad = len(self._outcomes), int(self.failed.sum())
        return f"Study({self._source.mechanism.name!r}, {count} variants, {bad} not solved, outputs {', '.join(self.outputs)})"

    def document(self) -> Document:
        """Ranges of the parameters and outputs, and why variants were not solved."""
        n, bad = len(self._outcomes), int(self.failed.sum())
        names, values = list(self.parameters), list(self.parameters.values())
        rows = [
            (name, *map(number, (at, v.min(), v.max())))
            for name, at, v in zip(names, self._source.start, values, strict=True)
        ]
        blocks: list[Block] = [
            Paragraph(
                f"{counted(n, 'variant')} at {counted(self._outcomes.shape[1], 'position')}, {bad} not solved at all positions."
            ),
            Heading("Parameters", 2),
            Table(("parameter", "mechanism itself", "least", "greatest"), rows, "lrrr"),
            Heading("Outputs, over variants and positions", 2),
            Table(
                ("output", "mechanism itself", "least", "mean", "greatest"), list(map(self._row, self.outputs)), "lrrrr"
            ),
        ]
        if self.warnings:
            blocks += [Heading("Doubtful reactions", 2), Bullets([*map(str, self.warnings)])]
        if self.messages:
            told = [f"variant {i}: {text}" for i, text in list(self.messages.items())[:VARIANTS_LISTED]]
            more = (
                [f"... and {len(self.messages) - VARIANTS_LISTED} more (messages)"]
                if len(self.messages) > VARIANTS_LISTED
                else []
            )
            blocks += [Heading("Not solved", 2), Bullets([*told, *more])]
        return Document(f"Study of {self.mechanism.name}", blocks)

    def _row(self, name: str) -> tuple[str, ...]:
        """The range of an output; that of the mechanism itself where it has several values."""
        values, own = (v[np.isfinite(v)] for v in (self.outputs[name], self.nominal[name]))
        if not values.size:
            return name, "", "no value", "", ""
        ends = list(dict.fromkeys(map(number, (own.min(), own.max())))) if own.size else ["no value"]
        return name, " to ".join(ends), *map(number, (values.min(), values.mean(), values.max()))

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism itself."""
        return self._source.mechanism

    @property
    def status(self) -> NDArray[np.str_]:
        """Named outcomes ``(n, positions)``."""
        return np.asarray(STATUSES[self._outcomes])

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Variants some position of which was not solved, ``(n,)``."""
        return np.asarray(self._outcomes.any(axis=1))

    def variant(self, i: int) -> Mechanism:
        """The ``i``-th variant as a mechanism, to be solved and checked alone.

        Raises
        ------
        DeclarationError
            where no such mechanism can be.
        """
        n = self._values.shape[1]
        if isinstance(i, bool) or not isinstance(i, int | np.integer) or not -n <= i < n:
            raise DeclarationError("study", [f"variant {i!r}: expected a whole number from 0 to {n - 1}"])
        return self._source.one(self._values[:, i])

    # --- what varies with what ---------------------------------------------------------------------------------------------

    def _output(self, name: str) -> Array:
        if name not in self.outputs:
            raise DeclarationError("study", [f"{name!r} is no output; outputs: {', '.join(self.outputs)}"])
        return self.outputs[name]

    @property
    def nominal(self) -> Mapping[str, Array]:
        """Outputs of the mechanism itself."""
        return {name: self._near_output(name)[0] for name in self.outputs}

    def _near_output(self, name: str) -> Array:
        self._output(name)
        if self._near.outputs is None:
            return np.full((len(self._near.status), *self.outputs[name].shape[1:]), np.nan)
        return self._near.outputs[name]

    def quantiles(self, name: str, q: ArrayLike = (0.00135, 0.5, 0.99865)) -> Array:
        """Quantiles of an output over the variants that were solved, ``(*shape of q, ...)``; NaN where none was."""
        values = self._output(name)
        if not ((np.asarray(q) >= 0) & (np.asarray(q) <= 1)).all():
            raise DeclarationError("study", [f"quantiles q = {q!r}: expected numbers from 0 to 1"])
        at = np.asarray(q, dtype=float)
        out = np.full((at.size, int(np.prod(values.shape[1:]))), np.nan)
        for column, own in zip(out.T, values.reshape(len(values), -1).T, strict=True):  # a copy of all might not fit
            solved = own[~np.isnan(own)]
            if np.isfinite(solved).any():
                column[:] = np.quantile(solved, at.ravel())
        return out.reshape(at.shape + values.shape[1:])

    def mean(self, name: str) -> Array:
        """Mean of an output over the variants that were solved."""
        values = self._output(name)
        count = np.isfinite(values).sum(axis=0)
        return np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan)

    def std(self, name: str) -> Array:
        """Standard deviation of an output over the variants that were solved (of the sample, ``n - 1``)."""
        values = self._output(name)
        count = np.isfinite(values).sum(axis=0)
        squares = np.nansum((values - self.mean(name)) ** 2, axis=0)
        return np.where(count > 1, np.sqrt(squares / np.maximum(count - 1, 1)), np.nan)

    def sensitivities(self, name: str) -> dict[str, Array]:
        """Derivative of an output after every parameter at the mechanism itself, ``(...)`` each, by central differences."""
        near = self._near_output(name)
        k = len(self._ways)
        return {
            parameter: (near[1 + j] - near[1 + k + j]) / (2 * self._steps[j]) for j, parameter in enumerate(self._ways)
        }

    @cached_property
    def _ends(self) -> Array:
        """Furthest departures of every parameter from the mechanism itself, ``(parameters, 2)``."""
        return np.array([reach(way) for way in self._ways.values()]) - self._source.start[:, None]

    def moves(self, name: str) -> dict[str, Array]:
        """What every parameter alone changes of an output, to first order, at its two ends (see ``worst_case``), ``(2, ...)``."""
        return {
            parameter: np.stack([g * end for end in ends])
            for (parameter, g), ends in zip(self.sensitivities(name).items(), self._ends, strict=True)
        }

    def worst_case(self, name: str) -> tuple[Array, Array]:
        """Smallest and largest value of an output, to first order, with every parameter at its worse end.

        ``f_0 + sum_j min(or max)(df/dp_j low_j, df/dp_j high_j)``; a distribution without end ends at three standard deviations (of a
        normal one). Compare with the extremes of the sample: the mechanism may be far from linear.
        """
        middle, moves = self._near_output(name)[0], self.moves(name).values()
        low, high = (
            middle + sum((pick(move, axis=0) for move in moves), np.zeros_like(middle)) for pick in (np.min, np.max)
        )
        return low, high

    def linear_std(self, name: str) -> Array:
        """Standard deviation to first order, ``sqrt(sum_j (df/dp_j sigma_j)^2)``, of independent parameters."""
        sigma = [deviation(way) for way in self._ways.values()]
        return np.sqrt(
            sum(
                ((g * s) ** 2 for g, s in zip(self.sensitivities(name).values(), sigma, strict=True)),
                start=np.array(0.0),
            )
        )

    # --- tables --------------------------------------------------------------------------------------------------------------

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset over variants and positions, parameters as coordinates of the variants (``xarray`` extra)."""
        xr = optional("xarray", "xarray")
        N = self._outcomes.shape[1]
        data: dict[str, Any] = {}
        for name, values in self.outputs.items():
            placed = values.ndim > 1 and values.shape[1] == N
            rest = [f"{name} {i}" for i in range(values.ndim - 1 - placed)]
            data[name] = (["variant", *(["position"] if placed else []), *rest], values)
        data["status"] = (["variant", "position"], self.status)
        return xr.Dataset(
            data,
            coords={name: ("variant", values) for name, values in self.parameters.items()},
            attrs={"mechanism": self.mechanism.name},
        )

    def to_pandas(self) -> pandas.DataFrame:
        """A DataFrame, one row a variant: parameters, outputs that are one number a variant, positions not solved (``pandas`` extra)."""
        pd = optional("pandas", "pandas")
        single = {name: v.reshape(len(v)) for name, v in self.outputs.items() if v.size == len(v)}
        missing = (self._outcomes != 0).sum(axis=1)
        return pd.DataFrame({**self.parameters, **single, "positions not solved": missing})
