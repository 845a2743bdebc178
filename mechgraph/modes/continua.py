"""Assemblies that are not isolated: sought by Newton steps and near singular ends.

What lies about an assembly at which the closure rows are nearly singular: a root alone, two that meet, or a continuum.

Let ``sigma`` be the smallest singular value beside those of passive motions, ``n`` and ``u`` its directions of freedoms and of rows. Along
``n``, all else closed,

    u . f(x + s n) = u . f(x) + sigma s + kappa s^2 / 2 + ...,    kappa = u . f''(n, n),

which has two roots ``2 sqrt(sigma^2 - 2 kappa u . f) / kappa`` apart, real or not: near each other at a fold, far from each other where
equations are ill-conditioned. Where a step along what the rows leave free is closed again elsewhere, the assembly can move. Source:
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, chapter 3 (reduction of Lyapunov and Schmidt).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mechgraph.kinematics.assembly import CLOSED, close_all
from mechgraph.kinematics.reach import BEYOND_END, beyond
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import MODES
from mechgraph.modes.family import Array, Family, parts

GUESSES_TOGETHER = 200
"""Guesses closed together."""


def searched(
    system: System,
    x: Array,
    columns: Index,
    drive: Array,
    starts: int,
    turns: float,
    rng: np.random.Generator,
    progress: Callable[[str], None] | None = None,
) -> Array:
    """Closed states ``(nx, n)`` from ``starts`` random guesses within so many ``turns`` about ``x (nx,)``, drivers at ``drive (d,)``.

    None has a pair beyond an end of its curve or surface.
    """
    found = []
    turning = ~system.is_length
    for i in range(0, starts, GUESSES_TOGETHER):
        n = min(GUESSES_TOGETHER, starts - i)
        if progress is not None:
            progress(f"guess {i + 1} to {i + n} of {starts}")
        dq = rng.uniform(-2 * np.pi * turns, 2 * np.pi * turns, (system.n_freedoms, n))
        # standard deviation of guessed slides, over L
        dq[~turning] = rng.normal(0.0, 1.5, (int((~turning).sum()), n))
        guess = system.advance(np.repeat(x[:, None], n, axis=1), dq)
        guess[system.single_rows[columns]] = drive[:, None]
        closed, error = close_all(system, guess, columns)
        found.append(closed[:, (error <= CLOSED) & (beyond(system, closed) <= BEYOND_END).all(axis=0)])
    return np.concatenate(found, axis=1)


def least_value(family: Family, here: Configuration) -> Array:
    """Smallest singular values ``(T,)`` of the closure rows beside those of passive motions, as parts of the largest."""
    if not family.unknowns:
        return np.ones(here.T)
    sigma = np.linalg.svd(here.J[:, family.free].transpose(2, 0, 1), compute_uv=False)
    return np.asarray(np.maximum(parts(sigma)[:, family.unknowns - 1], MODES.vanished))


def irregular(family: Family, here: Configuration) -> Array:
    """Which states ``(T,)`` are to be looked at more closely."""
    s = here.system
    lengths = here.x[s.single_rows[s.is_length]]
    large = np.maximum(np.abs(here.x.imag).max(axis=0, initial=0.0), np.abs(lengths).max(axis=0, initial=0.0))
    # imaginary part, or length over L, in a state from which on small singular values are a matter of scale
    return np.asarray((least_value(family, here) < MODES.singular) & (large <= 10.0))


class Nearby:
    """The closure rows of a class about a closed state ``x (nx, 1)``, real or complex, of a system with its drivers at rest."""

    def __init__(self, family: Family, system: System, x: Array) -> None:
        self.family, self.system, self.here = family, system, Configuration(system, x)
        self._U, sigma, Vt = np.linalg.svd(self.here.J[:, family.free, 0])
        size = parts(sigma)
        wanted = family.unknowns
        self.rank = min(int((size > MODES.singular).sum()), wanted)
        self._left = Vt[self.rank :].conj().T

    @property
    def regular(self) -> bool:
        """Whether the rows are far from singular, as far as the state is not large."""
        return not irregular(self.family, self.here)[0]

    @cached_property
    def motions(self) -> Array:
        """Motions ``(free, k)`` of largest rate 1 that the rows leave free, or nearly so, beside passive ones, which tell nothing apart."""
        rates = self._prints(self._stepped(MODES.curved * self._left)) - self._prints(
            self._stepped(-MODES.curved * self._left)
        )
        told = np.linalg.svd(rates)[2][: self.family.unknowns - self.rank]
        out = self._left @ told.conj().T
        return np.asarray(out / np.abs(out).max(axis=0))

    @cached_property
    def landed(self) -> Array:
        """Closed states ``(nx, n)`` elsewhere to which steps along these motions lead; none where the assembly cannot move."""
        k = self.motions.shape[1]
        mixed = (
            np.concatenate([np.eye(k), np.random.default_rng(0).normal(size=(k, k))], axis=1) if k > 1 else np.eye(k)
        )
        ways = self.motions @ mixed
        ways = ways / np.abs(ways).max(axis=0)
        x, error = close_all(
            self.system, self._stepped(MODES.away * np.concatenate([ways, -ways], axis=1)), self.family.columns
        )
        gone = np.abs(self._prints(x) - self._prints(self.here.x)).max(axis=0, initial=0.0)
        # part of the step by which what tells assemblies apart must have changed
        return x[:, (error < CLOSED) & (gone > 0.2 * MODES.away)]

    @property
    def moves(self) -> bool:
        """Whether it is a point of a continuum."""
        return not self.regular and self.landed.shape[1] > 0

    @property
    def dimension(self) -> int:
        """Of the continuum here, where it does not cross others: independent motions along which it goes on."""
        ways = self._prints(self.landed) - self._prints(self.here.x)
        sigma = np.linalg.svd(ways, compute_uv=False)
        # singular value of motions, as part of the largest, from which on they count for the dimension of a continuum
        return int((sigma > 0.1 * sigma[0]).sum()) if sigma.size else 0

    @cached_property
    def _bent(self) -> tuple[complex, complex, float]:
        """What the rows leave open, its rate and ``kappa`` along the only motion, each in the direction of rows that these two have."""
        dq = self.motions
        ahead, back = (
            Configuration(self.system, self._stepped(sign * MODES.curved * dq)).residual[:, 0] for sign in (1, -1)
        )
        f = self.here.residual[:, 0]
        across = self._U[:, self.rank :].conj().T
        kappa = across @ (ahead + back - 2 * f) / MODES.curved**2
        size = max(float(np.linalg.norm(kappa)), MODES.vanished)
        u = kappa.conj() / size
        rates = self.here.J[:, self.family.free, 0] @ dq[:, 0]
        return complex(u @ (across @ f)), complex(u @ (across @ rates)), size

    @property
    def gap(self) -> float:
        """How far the other root is (largest increment); infinite where there is none near, 0 where more than two may meet."""
        if self.regular:
            return np.inf
        if self.motions.shape[1] > 1:
            return 0.0
        f, sigma, kappa = self._bent
        return float(2 * np.abs(np.sqrt(sigma**2 - 2 * kappa * f + 0j)) / kappa)

    def both(self) -> Array:
        """The two roots near here ``(nx, 2)``, closed each for itself, the nearer one first."""
        f, sigma, kappa = self._bent
        apart = np.sqrt(sigma**2 - 2 * kappa * f + 0j)
        larger = max(sigma + apart, sigma - apart, key=abs)
        s = np.array([-2 * f / larger, -larger / kappa])
        return close_all(self.system, self._stepped(self.motions * s), self.family.columns)[0]

    def _stepped(self, part: Array) -> Array:
        """States ``(nx, T)`` after increments ``part (free, T)``."""
        dq = np.zeros((self.system.n_freedoms, part.shape[1]), dtype=part.dtype)
        dq[self.family.free] = part
        x = np.repeat(self.here.x, part.shape[1], axis=1)
        return self.system.advance(x.astype(np.result_type(x, dq)), dq)

    def _prints(self, x: Array) -> Array:
        return self.family.prints(Configuration(self.system, x))


MOST_STEPS_ALONG, STEP_ALONG, NEAREST_POINT = 200, 0.3, 1e-9
"""Steps along a continuum to its point nearest to the start, at most; the largest; and that at which it ends."""


class Found(NamedTuple):
    """A continuum: its real point ``x (nx,)`` nearest to the start, its ``dimension``, and freedoms ``moves (F,)`` that change in it."""

    x: Array
    dimension: int
    moves: Array


def continua(
    family: Family, system: System, ends: Array, drive: Array, progress: Callable[[str], None] | None
) -> list[Found]:
    """Continua with real points, drivers at ``drive (d,)``: those to which tracks came at ``ends (nx, n)``, and those that guesses find."""
    start = family.here.x[:, :1]
    # random guesses from which real points of continua are looked for, the same ones for any seed
    guessed = searched(system, start[:, 0], family.columns, drive, 100, 0.5, np.random.default_rng(0), progress)
    guessed = guessed[:, irregular(family, Configuration(system, guessed))]
    guessed = guessed[:, np.argsort(np.abs(_apart(system, guessed, start)).max(axis=0), kind="stable")]
    out: list[tuple[Found, Array]] = []

    def put(x: Array) -> None:
        about = Nearby(family, system, x)
        if about.moves:
            told = _described(about)
            if not any(_one(*told, *one) for one in out):
                out.append(_described(_nearest(about, start)))

    for x in guessed.T:
        put(x[:, None])
    for end in ends.T:
        real = _real(family, system, end[:, None])
        if real is not None:
            put(real)
    return [found for found, _ in out]


def _one(a: Found, at_rest: Array, b: Found, at_rest_b: Array) -> bool:
    """Whether the same freedoms move and all else is at the same place."""
    if a.dimension != b.dimension or (a.moves != b.moves).any():
        return False
    return bool(np.nanmax(np.abs(at_rest - at_rest_b), initial=0.0) < MODES.same_place)


def _along(about: Nearby) -> Array:
    """Orthonormal motions ``(F, k)`` along a continuum."""
    out = np.zeros((about.system.n_freedoms, about.motions.shape[1]), dtype=about.motions.dtype)
    out[about.family.free] = np.linalg.qr(about.motions)[0]
    return out


def _apart(system: System, x: Array, start: Array) -> Array:
    """Increments ``(F, T)`` from ``start (nx, 1)`` to states without whole rounds."""
    d = system.difference(x, np.repeat(start, x.shape[1], axis=1))
    whole = (system.single_rows >= 0) & np.isfinite(system.periods)
    period = system.periods[whole, None]
    d[whole] -= period * np.round(d[whole] / period)
    return np.asarray(d)


def _real(family: Family, system: System, x: Array) -> Array | None:
    """A real point ``(nx, 1)`` of a continuum near a complex one: along it against its imaginary part; None where there is none."""
    for _ in range(MOST_STEPS_ALONG):
        if np.abs(x.imag).max() < NEAREST_POINT:
            break
        ways = _along(Nearby(family, system, x))
        gone = 1j * system.difference(x, x.real.astype(complex))[:, 0].imag
        c = ways.conj().T @ gone
        if np.abs(c).max(initial=0.0) < NEAREST_POINT:
            return None
        x, _ = close_all(system, system.advance(x, -_limited(ways @ c)[:, None]), family.columns)
    closed, error = close_all(system, x.real, family.columns)
    return closed if error[0] < CLOSED else None


def _nearest(about: Nearby, start: Array) -> Nearby:
    """The point of a continuum to which the way towards the start leads from another one, as far as it can move there."""
    for _ in range(MOST_STEPS_ALONG):
        ways = _along(about)
        step = ways @ (ways.T @ _apart(about.system, about.here.x, start))
        if np.abs(step).max() < NEAREST_POINT:
            break
        x, _ = close_all(about.system, about.system.advance(about.here.x, -_limited(step)), about.family.columns)
        there = Nearby(about.family, about.system, x)
        if not there.moves:
            break
        about = there
    return about


def _limited(step: Array) -> Array:
    return np.asarray(step * min(1.0, STEP_ALONG / max(float(np.abs(step).max()), 1e-300)))


def _described(about: Nearby) -> tuple[Found, Array]:
    """What moves, told at points next to it, as some of it may stand still there; and what does not (``Family.prints``, else NaN)."""
    family, system, landed = about.family, about.system, about.landed
    beside = [Nearby(family, system, landed[:, [i]]) for i in range(landed.shape[1])]
    least = min(len(one.motions.T) for one in beside)
    ways = np.concatenate([_along(one) for one in beside if len(one.motions.T) == least], axis=1)
    moves = np.abs(ways).max(axis=1) > MODES.same_place
    here, there = (family.prints(Configuration(system, of)) for of in (about.here.x, landed))
    still = np.abs(there - here).max(axis=1) < MODES.same_place
    found = Found(about.here.x[:, 0], min(one.dimension for one in beside), moves)
    return found, np.where(still, here[:, 0], np.nan)
