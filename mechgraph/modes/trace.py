"""The trace test: a sum over all assemblies of a class is a rational function of its parameters, a sum over some of them is not.

In every loop one marker turns by ``phi`` about a line that the algebra of the loop allows, and the squares of the lengths of all rods
are linear in ``z``. Over this pencil of members all equations are
rational in ``z = exp(i phi)``, and the assemblies are an irreducible curve over the plane of ``z`` (see ``family``), whose points are
permuted as ``z`` goes round the places where they meet. With ``g`` a number that tells assemblies apart and ``c`` a random one, the sum
of ``1 / (g - c)`` over all assemblies is the same whichever way ``z`` came: a rational function, its degree the number of ``z`` with
``g = c``. A sum over some of them only is not.

Where all loops move in one plane, markers slide along an isotropic direction ``v`` of it instead (``v . v = 0``). With ``w`` the complex
numbers by which links have turned, the loops are linear in ``w`` along ``v``, which stands still, and in ``1 / w`` along its conjugate,
which moves: parallel planes cut the assemblies out of the inverses of a linear space, an irreducible curve. The sum is that of ``g``
itself, of points along ``v``, linear in ``w``: its degree is the number of ``z`` where an assembly goes to infinity, less than a tenth.
(Of groups that do not depend on each other a linear sum does not tell every part from the whole; they are solved one after the other.)

Whether a function is rational its Loewner matrix ``(f(a_i) - f(b_j)) / (a_i - b_j)`` tells: the rank is the degree (Antoulas and
Anderson, On the scalar rational interpolation problem, IMA J. Math. Control Inform. 3, 1986). The singular values of a rational function
end at once, in rounding; those of another one fade, each a few times less than the one before. Samples beside the poles that the matrix
and its shifted one tell so far (Mayo and Antoulas, A framework for the solution of the generalized realization problem, Linear Algebra
Appl. 425, 2007) make every pole of a rational function count; of another one there are ever more.

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
from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.modes.family import SPAN, Array, Family, Member, common
from mechgraph.modes.homotopy import Care, Equations, Leg, follow

SAMPLES, SAMPLES_ALONG = 48, 16
"""Members of a pencil that are sampled first, of one with turns and of one along an isotropic direction; then as many again, until they
tell."""
ENOUGH, PENCILS = 5, 4
"""Members for every pole at which a pencil that does not tell is left for another one; pencils of which one has to tell."""
MOST_TRACKS = 24_000
"""Tracks over all of them, at most."""
BY_POLE = 0.3
"""Distance of samples from a pole, as part of that to the next one."""
NEAREST = 1e-3
"""The least that counts of the distance of two poles, as part of their size."""
POLE_RANGE = 200.0
"""Size of ``z`` or ``1 / z`` up to which poles are sampled."""
PENCIL_SPREAD = 1.2
"""Standard deviation of the imaginary part of ``phi``."""
RATIONAL = 1e-11
"""Singular value, as part of the largest, below which the Loewner matrix of a rational function ends."""
ENDS = 1e4
"""Ratio of two singular values, one after the other, at which they end; where they fade it is below 300."""
POLES_TOLD = 1e-11
"""Singular value, as part of the largest, down to which poles are told."""
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
    N, tracks = x.shape[1], 0
    for _ in range(PENCILS):
        pencil = _Pencil(equations, base, rng)
        phi = pencil.anywhere(pencil.first, rng)
        z, f, weights = np.zeros(0, dtype=complex), np.zeros(0, dtype=complex), np.zeros(0)
        while (tracks := tracks + len(phi) * N) <= MOST_TRACKS:
            if progress is not None:
                progress(f"trace test: {N} tracks to each of {len(phi)} random mechanisms of the class")
            new = pencil.sums(x, phi)
            z, f, weights = (np.concatenate(pair) for pair in zip((z, f, weights), new, strict=True))
            found = rational(z, f, weights)
            if found.passed:
                return found
            poles = _poles(z, f, weights)
            if len(z) > ENOUGH * len(poles):
                break
            phi = _beside(poles, rng)
            phi = np.concatenate([phi, pencil.anywhere(max(pencil.first, len(z)) - len(phi), rng)])
    return NOT_PASSED


def rational(z: Array, f: Array, weights: Array) -> Trace:
    """Whether a function with values ``f (n,)`` at ``z (n,)`` is rational, and of which degree; ``weights (n,)`` fall with rounding."""
    if len(z) // 2 <= SPARE_VALUES:
        return NOT_PASSED
    loewner, _ = _loewner(z, f, weights)
    sigma = np.linalg.svd(loewner, compute_uv=False)
    sigma = np.concatenate([sigma[:1], sigma]) / sigma[0] if sigma[0] > 0 else np.ones(1)
    ends = 1 + np.flatnonzero(
        (sigma[1:-SPARE_VALUES] < RATIONAL) & (sigma[1:-SPARE_VALUES] * ENDS < sigma[: -SPARE_VALUES - 1])
    )
    if not ends.size:
        return NOT_PASSED
    at = int(ends[0])
    return Trace(at - 1, len(z), float(sigma[at - 1]), float(sigma[at]))


def _loewner(z: Array, f: Array, weights: Array) -> tuple[Array, Array]:
    """The Loewner matrix of every other value against those between, and the shifted one, scaled alike."""
    scale = weights / (1.0 + np.abs(f))
    a, fa, wa = (v[::2, None] for v in (z, f, scale))
    b, fb, wb = (v[1::2] for v in (z, f, scale))
    over = wa * wb / (a - b)
    return over * (fa - fb), over * (a * fa - b * fb)


def _poles(z: Array, f: Array, weights: Array) -> Array:
    """The poles that values tell."""
    loewner, shifted = _loewner(z, f, weights)
    U, sigma, Vt = np.linalg.svd(loewner)
    rank = int((sigma > POLES_TOLD * sigma[0]).sum())
    left, right = U[:, :rank].conj().T, Vt[:rank].conj().T
    return np.linalg.eigvals((left @ shifted @ right) / sigma[:rank, None])


def _beside(poles: Array, rng: np.random.Generator) -> Array:
    """Two ``phi`` beside every pole that is not far away."""
    poles = poles[(np.abs(poles) < POLE_RANGE) & (np.abs(poles) > 1.0 / POLE_RANGE)]
    gaps = np.abs(poles[:, None] - poles)
    np.fill_diagonal(gaps, np.abs(poles))
    gap = np.clip(gaps.min(axis=1, initial=np.inf), NEAREST * np.abs(poles), np.abs(poles))
    near = np.repeat(poles, 2) + BY_POLE * np.repeat(gap, 2) * np.exp(2j * np.pi * rng.random(2 * len(poles)))
    return np.asarray(-1j * np.log(near))


class _Pencil:
    """Members of a class in which one marker of every loop has turned by ``phi`` about a line, and all rods have other lengths."""

    def __init__(self, equations: Equations, base: Member, rng: np.random.Generator) -> None:
        self.equations, self.family, self.base = equations, equations.family, base
        s = self.family.system
        P = len(s.m.pairs)
        self.lines = np.zeros((6, len(self.family.bearers), 1), dtype=complex)
        self.along = _isotropic(self.family)
        self.first = SAMPLES if self.along is None else SAMPLES_ALONG
        for chord, algebra in zip(s.chords.tolist(), self.family.loop_algebras, strict=True):
            self.lines[:, P + chord, 0] = _line(
                algebra if self.along is None else np.append(np.zeros(3), self.along)[:, None], rng
            )
        self.drive = self.family.lengths_of(_random(rng, len(base.drive)))[:, None]
        self.c = _random(rng, 1)[0]
        self.weights = _random(rng, len(self._told(self.family.here)))

    def members(self, phi: Array) -> Member:
        """Members at ``phi (n,)``; a line without a turn is a direction, along which it goes by ``z - 1``, as squares of rods do."""
        slides = np.abs(self.lines[:3]).max(axis=0) < SPAN
        turned = self.lines * np.where(slides, np.exp(1j * phi) - 1.0, phi)
        markers = compose(pose_exp(self.family.in_links(turned)), self.base.markers)
        return Member(markers, self.base.drive + self.drive * (np.exp(1j * phi) - 1.0))

    @staticmethod
    def anywhere(n: int, rng: np.random.Generator) -> Array:
        """Random ``phi (n,)``."""
        return np.asarray(rng.uniform(-np.pi, np.pi, n) + 1j * PENCIL_SPREAD * rng.normal(size=n))

    def sums(self, x: Array, phi: Array) -> tuple[Array, Array, Array]:
        """``z``, the sum and weights at pairs of members ``phi (n,)`` to both of which all tracks from ``x`` come."""
        (n, N), members = (len(phi), x.shape[1]), self.members(phi)
        leg = Leg(self.equations, self.base, members, np.repeat(np.arange(n), N))
        tracked = follow(leg, np.tile(x, n), Care())
        good = tracked.arrived.reshape(n, N).all(axis=1)
        with np.errstate(all="ignore"):
            here = leg.at(tracked.x, np.ones(n * N), np.arange(n * N)).here
            g = (self.weights @ self._told(here)).reshape(n, N)
            f = (1.0 / (g - self.c) if self.along is None else g).sum(axis=1)
            size = np.abs(here.poses).max(axis=(0, 1, 2)).reshape(n, N).max(axis=1)
        good &= np.isfinite(f)
        good = np.repeat(good.reshape(-1, 2).all(axis=1), 2)
        z = np.exp(1j * phi)
        return z[good], f[good], (np.maximum(1.0, np.abs(z)) / size)[good]

    def _told(self, here: Configuration) -> Array:
        """Numbers ``(n, T)`` of which ``g`` is made."""
        if self.along is None:
            return _told(self.family, here)
        poses = here.poses[:, :, self.family.settled_links]
        return np.tensordot(self.along, poses, 1).reshape(-1, here.T)


def _random(rng: np.random.Generator, n: int) -> Array:
    return np.asarray(rng.normal(size=(n, 2)) @ [1.0, 1.0j])


def _isotropic(family: Family) -> Array | None:
    """An isotropic direction ``(3,)`` of the plane in which all loops move, and nothing else; None where they have none in common."""
    algebras = family.loop_algebras
    shared, plane = common(algebras), {h.shape[1] for h in algebras} == {3}
    if family.points or family.idle.shape[1] or not plane or shared.shape[1] != 3:
        return None
    _, turns, Vt = np.linalg.svd(shared[:3])
    return (shared @ Vt[1:].T)[3:] @ [1.0, 1.0j] if (turns > SPAN).sum() == 1 else None


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
