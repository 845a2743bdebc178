"""Samples of numbers that vary: at random, by Latin hypercube, or on a grid. A new way of sampling is a new row of ``SAMPLINGS``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.quantities import has_quantity, is_numeric, real_array, shown, wrong

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
