"""The trace test: a sum over all assemblies of a class is a rational function of its parameters, a sum over some of them is not.

In every loop one marker turns by ``phi`` about a line that the algebra of the loop allows, and the squares of the lengths of all rods
are linear in ``z``. Over this pencil of members all equations are
rational in ``z = exp(i phi)``, and the assemblies are an irreducible curve over the plane of ``z`` (see ``family``), whose points are
permuted as ``z`` goes round the places where they meet. With ``g`` a number that tells assemblies apart and ``c`` a random one, the sum
of ``1 / (g - c)`` over all assemblies is the same whichever way ``z`` came: a rational function, its degree the number of ``z`` with
``g = c``. A sum over some of them only is not.

Whether a function is rational its Loewner matrix ``(f(a_i) - f(b_j)) / (a_i - b_j)`` tells: the rank is the degree (Antoulas and
Anderson, On the scalar rational interpolation problem, IMA J. Math. Control Inform. 3, 1986). The singular values of a rational function
end at once, in rounding; those of another one fade, each a few times less than the one before.

Sources of trace tests: Sommese, Verschelde and Wampler, Symmetric functions applied to decomposing solution sets of polynomial systems,
SIAM J. Numer. Anal. 40, 2002 (sums linear in a slice moved in parallel); Leykin, Rodriguez and Sottile, Trace
test, Arnold Math. J. 4, 2018.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import compose, pose_exp
from mechgraph.closure.configuration import Configuration
from mechgraph.modes.family import SPAN, Array, Family, Member
from mechgraph.modes.homotopy import Care, Equations, Leg, follow
from mechgraph.topology.components import components_of_edges

SAMPLES = (48, 96, 192, 192, 384)
"""Members of pencils, one pencil after the other until one tells."""
MOST_TRACKS = 6500
"""Tracks over a pencil, at most."""
PENCIL_SPREAD = 1.2
"""Standard deviation of the imaginary part of ``phi``."""
RATIONAL = 1e-9
"""Singular value, as part of the largest, below which the Loewner matrix of a rational function ends."""
ENDS = 1e4
"""Ratio of two singular values, one after the other, at which they end; where they fade it is below 300."""
SPARE_VALUES = 4
"""Singular values beyond the degree, at least."""


@dataclass(frozen=True)
class Trace:
    """A trace test over ``samples`` members: the sum is rational of ``degree``, or not known to be (-1).

    ``last`` and ``beyond`` are the singular values of the Loewner matrix at the degree and after it, as parts of the largest.
    """

    degree: int
    samples: int
    last: float
    beyond: float

    @property
    def passed(self) -> bool:
        """Whether no assembly is missing."""
        return self.degree >= 0


NOT_PASSED = Trace(-1, 0, 1.0, 1.0)
"""No trace test was passed."""


def trace_test(
    equations: Equations,
    base: Member,
    x: Array,
    rng: np.random.Generator,
    progress: Callable[[str], None] | None = None,
) -> Trace:
    """The trace test of the assemblies ``x (nx, N)`` of a member."""
    N = x.shape[1]
    for n in SAMPLES:
        if n * N > MOST_TRACKS:
            break
        if progress is not None:
            progress(f"trace test: {N} tracks to each of {n} random mechanisms of the class")
        found = rational(*_Pencil(equations, base, rng).sums(x, n, rng))
        if found.passed:
            return found
    return NOT_PASSED


def rational(z: Array, f: Array, weights: Array) -> Trace:
    """Whether a function with values ``f (n,)`` at ``z (n,)`` is rational, and of which degree; ``weights (n,)`` fall with rounding."""
    half = len(z) // 2
    if half <= SPARE_VALUES:
        return NOT_PASSED
    a, b, scale = z[:half, None], z[half : 2 * half], weights / (1.0 + np.abs(f))
    loewner = scale[:half, None] * scale[half : 2 * half] * (f[:half, None] - f[half : 2 * half]) / (a - b)
    sigma = np.linalg.svd(loewner, compute_uv=False)
    sigma = np.concatenate([sigma[:1], sigma]) / sigma[0] if sigma[0] > 0 else np.ones(1)
    ends = 1 + np.flatnonzero(
        (sigma[1:-SPARE_VALUES] < RATIONAL) & (sigma[1:-SPARE_VALUES] * ENDS < sigma[: -SPARE_VALUES - 1])
    )
    if not ends.size:
        return NOT_PASSED
    at = int(ends[0])
    return Trace(at - 1, len(z), float(sigma[at - 1]), float(sigma[at]))


class _Pencil:
    """Members of a class in which one marker of every loop has turned by ``phi`` about a line, and all rods have other lengths."""

    def __init__(self, equations: Equations, base: Member, rng: np.random.Generator) -> None:
        self.equations, self.family, self.base = equations, equations.family, base
        s = self.family.system
        P = len(s.m.pairs)
        self.lines = np.zeros((6, len(self.family.bearers), 1), dtype=complex)
        for chord, algebra in zip(s.chords.tolist(), self.family.loop_algebras, strict=True):
            self.lines[:, P + chord, 0] = _line(algebra, rng)
        self.drive = self.family.lengths_of(_random(rng, len(base.drive)))[:, None]
        self.c = _random(rng, 1)[0]
        self.weights = _random(rng, len(_told(self.family, self.family.here)))

    def members(self, phi: Array) -> Member:
        """Members at ``phi (n,)``; a line without a turn is a direction, along which it goes by ``z - 1``, as squares of rods do."""
        slides = np.abs(self.lines[:3]).max(axis=0) < SPAN
        turned = self.lines * np.where(slides, np.exp(1j * phi) - 1.0, phi)
        markers = compose(pose_exp(self.family.in_links(turned)), self.base.markers)
        return Member(markers, self.base.drive + self.drive * (np.exp(1j * phi) - 1.0))

    def sums(self, x: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """``z``, the sum of ``1 / (g - c)`` and weights at those of ``n`` random members to which all tracks from ``x (nx, N)`` come."""
        phi = rng.uniform(-np.pi, np.pi, n) + 1j * PENCIL_SPREAD * rng.normal(size=n)
        N, members = x.shape[1], self.members(phi)
        leg = Leg(self.equations, self.base, members, np.repeat(np.arange(n), N))
        tracked = follow(leg, np.tile(x, n), Care())
        good = tracked.arrived.reshape(n, N).all(axis=1)
        with np.errstate(all="ignore"):
            here = leg.at(tracked.x, np.ones(n * N), np.arange(n * N)).here
            f = (1.0 / (self.weights @ _told(self.family, here) - self.c)).reshape(n, N).sum(axis=1)
            size = np.abs(here.poses).max(axis=(0, 1, 2)).reshape(n, N).max(axis=1)
        good &= np.isfinite(f)
        z = np.exp(1j * phi)
        return z[good], f[good], (np.maximum(1.0, np.abs(z)) / size)[good]


def _random(rng: np.random.Generator, n: int) -> Array:
    return np.asarray(rng.normal(size=(n, 2)) @ [1.0, 1.0j])


def _line(algebra: Array, rng: np.random.Generator) -> Array:
    """A random turn ``(6,)`` about a line in an algebra ``(6, k)``; a direction where it has no turns."""
    w, v = (algebra @ (rng.normal(size=(algebra.shape[1], 2)) @ [1.0, 0.5j])).reshape(2, 3)
    if np.abs(w).max() < SPAN:
        return np.concatenate([w, v])
    return np.asarray(np.concatenate([w, v - w * (w @ v) / (w @ w)]) / np.sqrt(w @ w))


def _told(family: Family, here: Configuration) -> Array:
    """What tells assemblies apart ``(n, T)``: coordinates that no passive motion changes, and poses of links that these do not settle."""
    s = family.system
    angles, lengths = (np.setdiff1d(rows, family.rows) for rows in family.settled_rows)
    settled = np.isin(s.single_rows, np.concatenate([*family.settled_rows]))
    first = s.first_column
    rigid = [s.graph.ends[k] for k in range(len(s.m.pairs)) if settled[first[k] : first[k + 1]].all()]
    component = components_of_edges(len(s.m.links), rigid)
    reached = np.flatnonzero(component == component[s.graph.frame])
    poses = here.poses[:, :, np.setdiff1d(family.settled_links, reached)]
    return np.concatenate([np.exp(1j * here.x[angles]), here.x[lengths], poses.reshape(-1, here.T)])
