"""Studies of many variants: how they are sampled, and what was found."""

from __future__ import annotations

import concurrent.futures
import os
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from mechgraph.determinacy.snapping import meant
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphError, MechgraphWarning, StudyError, counted
from mechgraph.files import optional
from mechgraph.force.reactions import MethodName
from mechgraph.kinematics.prescribed import Actuators, Motions, actuators, driven
from mechgraph.kinematics.solver import MotionEngineName
from mechgraph.kinetostatics import RedundantName
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import Tolerances
from mechgraph.memo import ASKED, dataclass, under
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.quantities import Count, Index, door, has_quantity, is_numeric, real_array, shown, wrong
from mechgraph.result.values import number
from mechgraph.variants.numbers import AnyField, clashes, field_values, find_field
from mechgraph.variants.work import (
    STATUSES,
    Output,
    Source,
    StudyPart,
    StudyTask,
    as_rows,
    motion_of_case,
    named_outputs,
    solved,
    unit_of_output,
    unsolved,
    worst,
)

if TYPE_CHECKING:
    import pandas
    import xarray

IGNORED_TAIL = 0.00135
"""Part of a distribution without end that is ignored at either end: three standard deviations of a normal one."""
SPREAD = (0.15866, 0.84134)
"""Quantiles whose half distance is called the spread: the standard deviation of a normal distribution."""


@dataclass(frozen=True)
class Levels:
    """Numbers that a parameter may take, each as likely as the others; in place of a distribution."""

    values: Array

    def ppf(self, u: Any) -> Array:
        """The number at quantile ``u`` (0 to 1)."""
        at = np.minimum((np.asarray(u) * len(self.values)).astype(int), len(self.values) - 1)
        return np.asarray(self.values[at])

    def support(self) -> tuple[float, float]:
        """Smallest and largest number."""
        return float(self.values[0]), float(self.values[-1])

    def std(self) -> float:
        """Standard deviation of the numbers."""
        return float(self.values.std())


@dataclass(frozen=True)
class InverseDistribution:
    """A distribution that speaks ``icdf`` and ``standard_deviation`` in place of ``ppf`` and ``std`` (``scipy.stats.Normal``)."""

    distribution: Any

    def ppf(self, u: Any) -> Array:
        """The number at quantile ``u`` (0 to 1)."""
        return np.asarray(self.distribution.icdf(u))

    def support(self) -> tuple[float, float]:
        """Smallest and largest number."""
        low, high = self.distribution.support()
        return float(low), float(high)

    def std(self) -> float:
        """Standard deviation."""
        return float(self.distribution.standard_deviation())


def distributions(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Every parameter as something with quantiles ``ppf``.

    Raises
    ------
    DeclarationError
        where a value is neither a distribution nor a sequence of numbers.
    """
    if not isinstance(parameters, Mapping):
        raise DeclarationError(
            "study: parameters", [wrong(parameters, "parameters", "a mapping name -> distribution or numbers")]
        )
    out, faults = {}, []
    for name, given in parameters.items():
        distribution = _with_quantiles(given)
        if isinstance(distribution, str):
            faults.append(f"{name!r} = {shown(given)}: {distribution}")
        else:
            out[name] = distribution
    if faults:
        raise DeclarationError("study: parameters", faults)
    return out


def _with_quantiles(given: Any) -> Any:
    """Something with quantiles, or what is wrong with it."""
    found = InverseDistribution(given) if hasattr(given, "icdf") else given
    if hasattr(found, "ppf") and not hasattr(found, "freeze"):
        return found if _has_median(found) else "has no median; check the arguments of the distribution"
    if has_quantity(given):
        return "has units; a study takes plain numbers, in the units in which the number is declared"
    levels = real_array(given)
    if levels is None or levels.ndim != 1 or not levels.size or not np.isfinite(levels).all():
        return "expected a distribution of scipy.stats with its numbers, e.g. scipy.stats.norm(10, 0.1), or a sequence of numbers"
    return Levels(np.sort(levels))


def _has_median(distribution: Any) -> bool:
    try:
        return is_numeric(distribution.ppf(0.5), ())
    except Exception:  # whatever the numbers that it was given do in the methods of a distribution
        return False


def deviation(distribution: Any) -> float:
    """Standard deviation; where a distribution has none, its spread."""
    found = float(distribution.std())
    return found if np.isfinite(found) else spread(distribution)


def reach(distribution: Any) -> tuple[float, float]:
    """Smallest and largest value; where a distribution has no end, its quantiles at ``IGNORED_TAIL``."""
    low, high = (float(end) for end in distribution.support())
    return (
        low if np.isfinite(low) else float(distribution.ppf(IGNORED_TAIL)),
        high if np.isfinite(high) else float(distribution.ppf(1 - IGNORED_TAIL)),
    )


def spread(distribution: Any) -> float:
    """Half the distance of the quantiles ``SPREAD``; where that is zero, half the reach."""
    low, high = (float(distribution.ppf(u)) for u in SPREAD)
    if high == low:
        low, high = reach(distribution)
    return (high - low) / 2


def _random(distributions: Sequence[Any], n: int, rng: np.random.Generator) -> Array:
    return _quantiles(distributions, rng.random((n, len(distributions))))


def _latin(distributions: Sequence[Any], n: int, rng: np.random.Generator) -> Array:
    return _quantiles(distributions, scipy.stats.qmc.LatinHypercube(d=len(distributions), seed=rng).random(n))


def _grid(distributions: Sequence[Any], n: int, rng: np.random.Generator) -> Array:
    levels = [w.values if isinstance(w, Levels) else w.ppf((np.arange(n) + 0.5) / n) for w in distributions]
    return np.stack([part.reshape(-1) for part in np.meshgrid(*levels, indexing="ij")])


def _quantiles(distributions: Sequence[Any], u: Array) -> Array:
    return np.stack([np.asarray(w.ppf(column), dtype=float) for w, column in zip(distributions, u.T, strict=True)])


def grid_size(distributions: Sequence[Any], n: int) -> float:
    """Number of variants of a grid with ``n`` levels of every distribution."""
    return float(np.prod([float(len(w.values)) if isinstance(w, Levels) else n for w in distributions]))


SamplingName = Literal["random", "latin", "grid"]
SAMPLINGS: dict[str, Callable[[Sequence[Any], int, np.random.Generator], Array]] = {
    "random": _random,
    "latin": _latin,
    "grid": _grid,
}
"""Ways of sampling by name: ``(distributions, n, generator) -> (parameters, samples)``."""


VARIANTS_LISTED = 10
"""Most variants that are named with the reason why they were not solved."""


class Study(Shown):
    """Results of many variants; arrays have the variants first, then positions, then components. Returned by ``study``.

    Attributes
    ----------
    parameters : mapping of str to (n,) array
        Values of the parameters.
    outputs : mapping of str to (n, ...) array
        NaN for variants and positions that were not solved.
    nominal : mapping of str to (...) array
        Outputs of the mechanism itself (with the motion of the first variant, if each has its own).
    units : mapping
        Unit of each output, one per entry of its last axis if they differ; empty if unknown.
    messages : mapping of int to str
        Variant -> why it was not solved.
    warnings : tuple
        As ``Solution.warnings``, with the largest values of all variants.

    Examples
    --------
    >>> import mechgraph as mg
    >>> study = mg.study(
    ...     mg.load("four-bar"), {"crank.mass": [0.03, 0.04]}, "A.effort", sampling="grid", motions={"A": 0.5}
    ... )
    >>> study.outputs["A.effort"][:, 0].round(4)
    array([0.2641, 0.2618])
    """

    def __init__(
        self,
        source: Source,
        ways: Mapping[str, Any],
        values: Array,
        steps: Array,
        names: Mapping[str, Output],
        motions: Mapping[str, Motion],
        near: StudyPart,
        parts: Sequence[StudyPart],
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
        """Return the ``i``-th variant as a mechanism.

        Parameters
        ----------
        i : int
            Number of the variant.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            Its numbers declare no valid mechanism.

        Examples
        --------
        >>> import mechgraph as mg
        >>> study = mg.study(
        ...     mg.load("four-bar"), {"crank.mass": [0.03, 0.04]}, "A.effort", sampling="grid", motions={"A": 0.5}
        ... )
        >>> study.variant(1).link("crank").mass
        0.04
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
        """Compute quantiles of an output over the solved variants.

        Parameters
        ----------
        name : str
            Name of the output.
        q : (...) array_like
            Probabilities, 0 to 1.

        Returns
        -------
        array (shape of q, ...)
            NaN if no variant was solved.

        Examples
        --------
        >>> import mechgraph as mg
        >>> masses = {"crank.mass": [0.03, 0.04, 0.05]}
        >>> study = mg.study(mg.load("four-bar"), masses, "A.effort", sampling="grid", motions={"A": 0.5})
        >>> study.quantiles("A.effort", 0.5).round(4)
        array([0.2618])
        """
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
        """Compute the mean of an output over the solved variants.

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        (...) array
        """
        values = self._output(name)
        count = np.isfinite(values).sum(axis=0)
        return np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan)

    def std(self, name: str) -> Array:
        """Compute the standard deviation of an output over the solved variants (of the sample, ``n - 1``).

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        (...) array
        """
        values = self._output(name)
        count = np.isfinite(values).sum(axis=0)
        squares = np.nansum((values - self.mean(name)) ** 2, axis=0)
        return np.where(count > 1, np.sqrt(squares / np.maximum(count - 1, 1)), np.nan)

    def sensitivities(self, name: str) -> dict[str, Array]:
        """Compute the derivatives of an output by every parameter at the mechanism itself, by central differences.

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        dict of str to (...) array
            Unit of the output per unit of the parameter.

        Examples
        --------
        >>> import mechgraph as mg
        >>> masses = {"crank.mass": [0.03, 0.04]}
        >>> study = mg.study(mg.load("four-bar"), masses, "A.effort", sampling="grid", motions={"A": 0.5})
        >>> study.sensitivities("A.effort")["crank.mass"].round(4)  # -9.81 * 0.05 * sin(0.5)
        array([-0.2352])
        """
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
        """Compute how much each parameter alone changes an output, to first order, at its two ends (see ``worst_case``).

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        dict of str to (2, ...) array
        """
        return {
            parameter: np.stack([g * end for end in ends])
            for (parameter, g), ends in zip(self.sensitivities(name).items(), self._ends, strict=True)
        }

    def worst_case(self, name: str) -> tuple[Array, Array]:
        """Compute the smallest and largest value of an output, to first order, with every parameter at its worse end.

        ``f_0 + sum_j min(or max)(df/dp_j low_j, df/dp_j high_j)``; a distribution without end ends at three standard deviations.
        Compare with the extremes of the sample: the mechanism may be far from linear.

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        low, high : (...) array
        """
        middle, moves = self._near_output(name)[0], self.moves(name).values()
        low, high = (
            middle + sum((pick(move, axis=0) for move in moves), np.zeros_like(middle)) for pick in (np.min, np.max)
        )
        return low, high

    def linear_std(self, name: str) -> Array:
        """Compute the standard deviation to first order, ``sqrt(sum_j (df/dp_j sigma_j)^2)``, of independent parameters.

        Parameters
        ----------
        name : str
            Name of the output.

        Returns
        -------
        (...) array
        """
        sigma = [deviation(way) for way in self._ways.values()]
        return np.sqrt(
            sum(
                ((g * s) ** 2 for g, s in zip(self.sensitivities(name).values(), sigma, strict=True)),
                start=np.array(0.0),
            )
        )

    # --- tables --------------------------------------------------------------------------------------------------------------

    def to_xarray(self) -> xarray.Dataset:
        """Return a Dataset over variants and positions, with the parameters as coordinates (``xarray`` extra).

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        MissingExtraError
            Without xarray.
        """
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
        """Return a DataFrame with one row per variant: parameters, outputs of one number, positions not solved (``pandas`` extra).

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingExtraError
            Without pandas.
        """
        pd = optional("pandas", "pandas")
        single = {name: v.reshape(len(v)) for name, v in self.outputs.items() if v.size == len(v)}
        missing = (self._outcomes != 0).sum(axis=1)
        return pd.DataFrame({**self.parameters, **single, "positions not solved": missing})


POSITIONS_TOGETHER = 60_000
"""Positions of all variants that are solved together: bounds the memory."""
FEW_ALONE = 20
"""Variants in a part where each is solved alone: so few that all processors have some."""

MOST_VARIANTS = 10_000_000
"""Largest study: its outputs are kept in memory."""

Progress = Callable[[int, int], None]


@door
def study(
    m: Mechanism | Callable[..., Mechanism],
    parameters: Mapping[str, Any],
    outputs: Any,
    n: Count = 1000,
    seed: Index = 0,
    *,
    motions: Mapping[str, Any] | None = None,
    actuate: Actuators | None = None,
    sampling: SamplingName = "random",
    executor: concurrent.futures.Executor | None = None,
    method: MethodName = "loop_wrench",
    redundant: RedundantName = "nan",
    engine: MotionEngineName = "auto",
    tol: float | None = None,
    progress: Progress | None = None,
    tolerances: Tolerances | None = None,
) -> Study:
    """Solve many variants of a mechanism (Monte Carlo, Latin hypercube, grid).

    Parameters
    ----------
    m : Mechanism or callable
        A mechanism, or a function ``build(**parameters)`` that returns one of constant topology.
    parameters : mapping
        Declared number (``crank.mass``, ``B.on_a.point.x``, ``loads[0].stiffness``, ``length[2]`` of a chain) -> distribution of
        ``scipy.stats`` or numbers.
    outputs : str, iterable or mapping
        Quantities by name (``"A.effort"``, ``"B.force"``, ``"B:Fx"``, ``"coupler.center"``; of a named point ``"coupler.tip"``,
        ``"coupler.tip.x"``, ``"coupler.tip.velocity"``; of couplings ``"g.normal_force"``,
        ``"belt.tension.p1-p2"``), or name -> quantity or function of a Solution with the batch
        ``(variants, positions)``.
    n : int
        Number of variants; on a grid, levels of every distribution (lists of numbers are taken as given).
    seed : int
        Seed of the sample. The same seed gives the same result on any executor.
    motions : mapping, optional
        As in ``solve``; a leading axis of length ``n`` gives every variant its own motion.
    actuate, method, redundant, engine, tol
        As in ``solve``.
    sampling : {"random", "latin", "grid"}
        How the parameters are sampled.
    executor : concurrent.futures.Executor, optional
        Default: the processors of this machine, threads if the compiled kernel serves, else processes.
    progress : callable, optional
        Called with the numbers of parts done and of all parts.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    Study
        A variant that cannot be built, assembled or moved has NaN outputs, with the reason in ``status`` and ``messages``. Every
        variant starts on the branch of the mechanism itself: mechgraph tracks the start while the numbers change.

    Raises
    ------
    DeclarationError
        With all faults of parameters and outputs. Errors of the mechanism itself as in ``solve``.
    StudyError
        Processes ended before their variants were solved, or ``progress`` raised; ``error.study`` has the others.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import scipy.stats
    >>> sizes = {"crank.mass": scipy.stats.uniform(0.03, 0.01)}
    >>> study = mg.study(mg.load("four-bar"), sizes, "A.effort", n=20, motions={"A": 0.5})
    >>> study.outputs["A.effort"].shape
    (20, 1)
    """
    ways = distributions(parameters)
    faults = [] if ways else ["parameters: none are named"]
    faults += [wrong(n, "n", f"at most {MOST_VARIANTS} variants")] if n > MOST_VARIANTS else []
    if faults:
        raise DeclarationError("study", faults)
    source, given = _source(m, ways, motions, tol)
    acting = None if actuate is None else actuators(source.mechanism, actuate)
    kept = named_outputs(source.mechanism, outputs, ways)
    if sampling == "grid" and (count := grid_size(list(ways.values()), int(n))) > MOST_VARIANTS:
        raise DeclarationError("study", [f"a grid of {count:.3g} variants: at most {MOST_VARIANTS} are solved"])
    values = SAMPLINGS[sampling](list(ways.values()), int(n), np.random.default_rng(seed))
    paths = {name: _rows_of(name, motion, values.shape[1]) for name, motion in given.items()}
    # steps of central differences: a part of the spread of the parameter, and no less than a part of it (of one, where it is zero)
    steps = np.array(
        [max(1e-4 * spread(way), 1e-6 * (abs(p) or 1.0)) for way, p in zip(ways.values(), source.start, strict=True)]
    )
    near = np.concatenate([np.zeros((len(steps), 1)), np.diag(steps), -np.diag(steps)], axis=1) + source.start[:, None]

    def task(some: slice) -> StudyTask:
        own = Motions({name: motion_of_case(motion, at[some]) for name, motion in paths.items()}, given.free)
        return StudyTask(source, whole[:, some], own, kept, method, redundant, engine, acting)

    # variants that are followed together: their arrays stay in the cache
    size = max(1, min(500, POSITIONS_TOGETHER // max(motion.shape[-1] for motion in paths.values())))
    size = min(size, FEW_ALONE) if source.one_by_one else size
    # those near the mechanism itself and the first ones together: of few positions a part takes calls, not numbers
    few, whole = near.shape[1], np.concatenate([near, values], axis=1)
    at = np.concatenate([np.zeros(few, dtype=np.intp), np.arange(values.shape[1])])
    cuts = [0, *range(max(size, few), whole.shape[1], size), whole.shape[1]]
    tasks = [task(slice(*ends)) for ends in pairwise(cuts)]
    done, why, cause = _all_solved(tasks, executor, progress)
    parts = [done[i] if i in done else unsolved(one, why) for i, one in enumerate(tasks)]
    beside, first = parts[0].cut(few)
    found = Study(
        source, ways, values, steps, kept, paths, beside, [*([first] if first.status.size else []), *parts[1:]]
    )
    if why:
        raise StudyError(f"study of {source.mechanism.name!r}: {why}", found) from cause
    for warning in found.warnings:
        warnings.warn(f"study of {source.mechanism.name!r}: {warning}", MechgraphWarning, stacklevel=3)
    return found


def _source(
    m: Mechanism | Callable[..., Mechanism],
    ways: Mapping[str, Any],
    motions: Mapping[str, Any] | None,
    tol: float | None,
) -> tuple[Source, Motions]:
    names = tuple(ways)
    if isinstance(m, Mechanism):
        own, given = driven(m, motions)
        found = {name: find_field(own, name) for name in names}
        faults = [fault for fault in found.values() if isinstance(fault, str)]
        fields: dict[str, AnyField] = {name: f for name, f in found.items() if not isinstance(f, str)}
        faults += clashes(own, fields)
        if faults:
            raise DeclarationError(f"study of {m.name!r}", faults)
        start = field_values(own, fields)
        tol = own.tol if tol is None else tol
        begin = np.array([start[name] for name in names])
        return Source(meant(own, tol, "study"), names, begin, fields, tol=tol), given
    middle = np.array([float(way.ppf(0.5)) for way in ways.values()])
    try:
        first = m(**dict(zip(names, middle.tolist(), strict=True)))
    except Exception as error:
        raise DeclarationError(
            "study", [f"the function failed at the medians of the parameters: {type(error).__name__}: {error}"]
        ) from error
    if not isinstance(first, Mechanism):
        raise DeclarationError("study", [f"the function gave {type(first).__name__}; expected a Mechanism"])
    own, given = driven(first, motions)
    named = {own.full_name(key) for key in motions or {} if own.freedom_fault(key, single=True) is None}
    stored = tuple(name for name in given if name in own.freedom_names() and name not in named)
    tol = own.tol if tol is None else tol
    exact = meant(own, tol, "study")
    return Source(exact, names, middle, build=m, stored=stored, redriven=own is not first, tol=tol), given


def _rows_of(name: str, motion: Motion, count: int) -> Motion:
    """The motion as ``(1 or count, N)``."""
    out = as_rows(motion)
    if len(out.shape) != 2 or out.shape[0] not in (1, count) or not out.shape[1]:
        raise DeclarationError(
            "study", [f"motion of {name!r}: shape {motion.shape}; expected positions, or {count} variants x positions"]
        )
    return out


def _all_solved(
    tasks: Sequence[StudyTask], executor: concurrent.futures.Executor | None, progress: Progress | None
) -> tuple[dict[int, StudyPart], str, Exception | None]:
    """Parts by the numbers of their tasks; why some are missing, and the error that it came from."""
    done: dict[int, StudyPart] = {}
    try:
        for i, part in _streamed(tasks, executor):
            done[i] = part
            try:
                if progress is not None:
                    progress(len(done), len(tasks))
            except Exception as error:
                return done, f"progress raised {type(error).__name__}: {error}", error
    except MechgraphError:
        raise
    except Exception as error:
        lost = counted(len(tasks) - len(done), "part")
        return done, f"{lost} of {len(tasks)} ended with {type(error).__name__}: {error}", error
    missing = len(tasks) - len(done)
    why = (
        f"the process of {counted(missing, 'part')} of {len(tasks)} ended before it was done (out of memory, or killed)"
    )
    return done, why if missing else "", None


def _streamed(
    tasks: Sequence[StudyTask], executor: concurrent.futures.Executor | None
) -> Iterator[tuple[int, StudyPart]]:
    """Parts as they come: from the executor, from threads or processes of this machine where there is much to do, or from here.

    Threads, where the compiled kernel does nearly all of the work, for which Python's lock is released.
    """
    workers, left = os.cpu_count() or 1, dict(enumerate(tasks))
    if executor is not None:
        yield from _submitted(left, executor)
        return
    if len(tasks) > 2 and workers > 1:
        threads = False
        if tasks[0].may_be_compiled:
            first = solved(left.pop(0))
            yield 0, first
            threads = first.compiled
        if threads:
            with concurrent.futures.ThreadPoolExecutor(min(workers, len(left))) as pool:
                yield from _submitted(left, pool)
            return
        if _can_be_sent(tasks[0]):
            yield from _in_processes(left, workers)
            return
    for i, task in left.items():
        yield i, solved(task)


def _in_processes(left: dict[int, StudyTask], workers: int) -> Iterator[tuple[int, StudyPart]]:
    """Parts as they come from processes of this machine.

    Those that a process took with it when it ended are tried again, as long as others come, then each in a process of its own; those that
    end this one too are left out.
    """
    before = len(left) + 1
    while 0 < len(left) < before:
        before = len(left)
        with concurrent.futures.ProcessPoolExecutor(min(workers, before)) as pool:
            for i, part in _submitted(left, pool):
                del left[i]
                yield i, part
    for i, task in left.items():
        with concurrent.futures.ProcessPoolExecutor(1) as pool:
            yield from _submitted({i: task}, pool)


def _submitted(
    tasks: Mapping[int, StudyTask], executor: concurrent.futures.Executor
) -> Iterator[tuple[int, StudyPart]]:
    """Parts as they come, as far as the processes of the executor live.

    Where one fails for a reason of the executor's own, as a cluster that gives up a task, the others are waited for.
    """
    futures: dict[concurrent.futures.Future[StudyPart], int] = {}
    failed: BaseException | None = None
    try:
        for i, task in tasks.items():
            futures[executor.submit(under, ASKED.get(), solved, task)] = i
        for future in concurrent.futures.as_completed(futures):
            error = future.exception()
            if error is None or isinstance(error, MechgraphError):
                yield futures[future], future.result()
            elif not isinstance(error, concurrent.futures.BrokenExecutor):
                failed = failed or error
        if failed is not None:
            raise failed
    except concurrent.futures.BrokenExecutor:  # in the midst of being given tasks
        return
    finally:
        for future in futures:
            future.cancel()


def _can_be_sent(task: StudyTask) -> bool:
    """Whether a task can go to another process: functions typed at a prompt, or without a name, cannot."""
    try:
        pickle.dumps(task)
    except Exception:
        return False
    return True
