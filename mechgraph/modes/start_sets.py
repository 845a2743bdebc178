"""Start sets: bounds, monodromy, the trace test, and the folder that keeps them.

Bounds of the number of assemblies: products over loops that can be solved one after the other, each with a published bound.

With the drivers at rest every loop in turn must have as many unknown freedoms as its group has dimensions; then the assemblies are at
most the product of those of the loops. A loop counts by the letters of its freedoms that are still unknown, in order round the loop.
A slide is a turn about a line far away, and regular assemblies stay where dimensions change a little: what bounds turns bounds slides.

The trace test: a sum over all assemblies of a class is a rational function of its parameters, a sum over some of them is not.

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
(Of groups that do not depend on each other a linear sum does not tell every part from the whole: it is only taken of what is known to
be one group. Groups are solved one after the other, but for large classes, whose groups are not looked for.)

Whether a function is rational its Loewner matrix ``(f(a_i) - f(b_j)) / (a_i - b_j)`` tells: the rank is the degree (Antoulas and
Anderson, On the scalar rational interpolation problem, IMA J. Math. Control Inform. 3, 1986). The singular values of a rational function
end at once, in rounding; those of another one fade, each a few times less than the one before. Samples beside the poles that the matrix
and its shifted one tell so far (Mayo and Antoulas, A framework for the solution of the generalized realization problem, Linear Algebra
Appl. 425, 2007) make every pole of a rational function count; of another one there are ever more.

Sources of trace tests: Sommese, Verschelde and Wampler, Symmetric functions applied to decomposing solution sets of polynomial systems,
SIAM J. Numer. Anal. 40, 2002 (sums linear in a slice moved in parallel); Leykin, Rodriguez and Sottile, Trace
test, Arnold Math. J. 4, 2018.

All assemblies of a random member of a class, by monodromy: paths of members that come back permute the assemblies.

How many there are is estimated while some are missing, by capture and recapture: a loop leads the ``N`` that are known to ``N`` others, of
which ``N^2 / total`` are known already, where all permutations are as likely. Over all loops ``total = sum N n / sum m`` with ``n`` that
came back and ``m`` of them known (Schnabel, The estimation of the total fish population of a lake, Amer. Math. Monthly 45, 1938).

Sources: Duff, Hill, Jensen, Lee, Leykin and Sommars, Solving polynomial systems via homotopy continuation and monodromy, IMA J. Numer.
Anal. 39, 2019; Sommese and Wampler, The Numerical Solution of Systems of Polynomials, 2005, section 15.4.

Start sets kept in a folder of the user, one file for each class of mechanisms; a file is written whole or not at all.

The folder is ``writing.cache_folder``. Where it cannot be read or written, start sets are worked out anew. Those of the library's
mechanisms, of common topologies and of trusses in a plane come with the package (``PACKED``, see ``tests/benchmarks/make_start_sets.py``).
"""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mechgraph.errors import MechgraphError, counted
from mechgraph.files import cache_folder, whole_file
from mechgraph.graph.chains import Code, code_of
from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import compose, pose_exp
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array, Family, Labelling, Member
from mechgraph.modes.form import RodFamily, is_one_group
from mechgraph.modes.homotopy import TRACKS_TOGETHER, Care, Equated, Equations, Leg, Linear, follow

SIX_TURNS = (
    "Lee, Woernle and Hiller, A complete solution for the inverse kinematic problem of the general 6R robot manipulator, "
    "J. Mech. Des. 113, 1991, page 481"
)
FORTY = (
    "Mourrain, The 40 generic positions of a parallel robot, ISSAC 1993; Ronga and Vust, Stewart platforms without computer?, "
    "Real Analytic and Algebraic Geometry, 1995"
)
SIXTEEN = (
    "three joints on circles at given distances from each other: three equations of degree 2 in the half-angle tangents of two of "
    "them each have 16 solutions or fewer (Bezout in a product of lines)"
)
LOOPS: tuple[tuple[int, str, int, str], ...] = (
    (3, "RRR", 2, "two circles in a plane or on a sphere meet in two points"),
    (3, "RRT", 2, "a circle and a line meet in two points"),
    (3, "RTT", 1, "the sides of a triangle follow from their directions"),
    (6, "RRRRRR", 16, SIX_TURNS),
    (6, "RRRRRT", 16, f"{SIX_TURNS}; a slide is a turn about a far line"),
)
"""Dimension of the group, freedoms still unknown (R turns, T slides), the bound, and its source."""


PLATFORMS: tuple[tuple[str, int, tuple[int, ...], int, str], ...] = (
    ("R", 1, (), 2, "a circle and a sphere meet in two points"),
    ("T", 1, (), 2, "a line and a sphere meet in two points"),
    ("S", 3, (), 8, "three quadrics in the quaternion of a rotation meet in 8 points or fewer (Bezout)"),
    ("TTTS", 6, (2, 2, 2), 16, SIXTEEN),
    ("TTTS", 6, (), 40, FORTY),
    ("TTS", 5, (), 40, f"{FORTY}; a point on a plane is on a rod from far away"),
)
"""What lets one body move against another (R turns, T slides, S is a ball), and rods between them: their number, how many have each joint
of the one body in common, whatever their joints on the other (nothing where it does not matter), the bound, and its source."""
SEVEN_LINKS = (
    "Rojas and Thomas, Distance-based position analysis of the three seven-link Assur kinematic chains, Mech. Mach. Theory 46, 2011: "
    "characteristic polynomials of degrees 14, 16 and 18"
)
TRUSSES = (
    (
        "02 12 03 13 04 14",
        6,
        "a coupler curve, of degree six and threefold in the circular points, meets a circle in 12 - 6 others",
    ),
    ("01 05 06 12 23 26 34 45 46", 14, SEVEN_LINKS),
    ("01 03 06 12 14 23 35 45 46", 16, SEVEN_LINKS),
    ("01 02 05 06 14 23 34 36 45", 18, SEVEN_LINKS),
)
"""Trusses in a plane of two loops and more, by the links that turn on each other, the bound, and its source."""


@dataclass(frozen=True)
class Bound:
    """At most so many assemblies, and who says so."""

    count: int
    source: str


def bound(family: Family) -> Bound | None:
    """The bound for a class, where the tables have one."""
    return _of_platform(family) if isinstance(family, RodFamily) else _of_truss(family) or _of_loops(family)


def _of_platform(family: RodFamily) -> Bound | None:
    """The bound of two bodies joined by rods and one pair, those one between which all is driven."""
    s = family.system
    free = set(family.free.tolist())
    columns = [set(range(s.first_column[k], s.first_column[k + 1])) for k in range(len(s.m.pairs))]
    moving = [k for k, own in enumerate(columns) if not free.isdisjoint(own)]
    body = components_of_edges(len(s.m.links), [ends for k, ends in enumerate(s.graph.ends) if k not in moving])
    joined = {tuple(sorted(body[[a, b]].tolist())) for a, b in zip(s.points.a, s.points.b, strict=True)}
    if len(moving) != 1 or not free.issuperset(columns[moving[0]]) or joined != {(0, 1)}:
        return None
    word = "".join(
        "S" if step.holds_rotation else "R" if step.freedoms[0].turns else "T"
        for step in s.m.pairs[moving[0]].type.steps
    )
    shared = [(), *(tuple(sorted(Counter(side.tolist()).values())) for side in np.split(family.joints, 2))]
    for letters, rods, joints, count, source in PLATFORMS:
        if letters in (word, word[::-1]) and rods == family.rods and joints in shared:
            return Bound(count, source)
    return None


def _of_loops(family: Family) -> Bound | None:
    """The product over loops solved one after the other, where the table has one for each of them."""
    s = family.system
    known = np.ones(s.n_freedoms, dtype=bool)
    known[family.free] = False
    if family.passive.shape[1]:
        return None
    left, count, sources = list(range(s.graph.n_loops)), 1, []
    while left:
        for loop in left:
            columns = s.loop_columns[loop][0]
            unknown = columns[~known[columns]]
            entry = _entry(
                family.loop_algebras[loop].shape[1], "".join("T" if s.is_length[c] else "R" for c in unknown)
            )
            if entry is not None:
                break
        else:
            return None
        count *= entry.count
        if entry.source not in sources:
            sources.append(entry.source)
        known[unknown] = True
        left.remove(loop)
    return Bound(count, "; ".join(sources) or "no loop has to be closed")


def _entry(dimension: int, letters: str) -> Bound | None:
    """The bound of one loop, its freedoms in any order round it."""
    turned = {letters[i:] + letters[:i] for i in range(len(letters))}
    for group, known, count, source in LOOPS:
        if group == dimension and (known in turned or known[::-1] in turned):
            return Bound(count, source)
    return None


def _of_truss(family: Family) -> Bound | None:
    """The bound of links that turn on each other in a plane; links between which all is driven are one."""
    s, P = family.system, range(len(family.system.m.pairs))
    if family.plane is None or s.is_length[family.free].any():
        return None
    locked = [k for k in P if not np.isin(np.arange(s.first_column[k], s.first_column[k + 1]), family.free).any()]
    body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in locked])
    own = [(int(body[a]), int(body[b])) for k, (a, b) in enumerate(s.graph.ends) if k not in locked]
    for joints, count, source in TRUSSES:
        known = [(int(ends[0]), int(ends[1])) for ends in joints.split()]
        if len(own) == len(known) and _truss(own) == _truss(known):
            return Bound(count, source)
    return None


def _truss(joints: list[tuple[int, int]]) -> Code:
    """What trusses have in common that are the same up to the numbers of their links."""
    return code_of([()] * (1 + max(map(max, joints), default=0)), [(a, b, ()) for a, b in joints])


MOST_TRACKS = 48_000
"""Tracks over all of them, at most: the sums of 66 six-bars end after some 650 tasks."""


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
NOT_TESTED = "No trace test passed; solutions may be missing. A call with another seed tries it again."
"""What is said of that."""


def trace_test(
    equations: Equated,
    base: Any,
    x: Array,
    rng: np.random.Generator,
    progress: Callable[[str], None] | None = None,
    of: Callable[..., Any] | None = None,
) -> Trace:
    """The trace test of the assemblies ``x (nx, N)`` of a member, over pencils of members (those of ``of``)."""
    N, tracks = x.shape[1], 0
    # pencils of which one has to tell
    for _ in range(4):
        pencil = (of or Pencil)(equations, base, rng)
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
            poles = _poles(z, f, weights) if len(z) else z
            # members for every pole at which a pencil that does not tell is left for another one
            if len(z) >= 8 * len(poles):
                break
            phi = _beside(poles, rng)
            # half as many again, an even number of them
            more = max(pencil.first, len(z) // 4 * 2, len(phi))
            phi = np.concatenate([phi, pencil.anywhere(more - len(phi), rng)])
    return NOT_PASSED


def rational(z: Array, f: Array, weights: Array) -> Trace:
    """Whether a function with values ``f (n,)`` at ``z (n,)`` is rational, and of which degree; ``weights (n,)`` fall with rounding."""
    # singular values beyond the degree, at least
    spare_values = 4
    # what varies by less than 1e-4 of its size is rounding (1e-15) where the matrix has to end, 1e-11 of it: that says nothing
    if len(z) // 2 <= spare_values or np.abs(f - f[0]).max() <= 1e-4 * np.abs(f).max():
        return NOT_PASSED
    loewner, _ = _loewner(z, f, weights)
    sigma = np.linalg.svd(loewner, compute_uv=False)
    sigma = np.concatenate([sigma[:1], sigma]) / sigma[0] if sigma[0] > 0 else np.ones(1)
    # singular value, as part of the largest, below which the Loewner matrix of a rational function ends
    # ratio of two singular values, one after the other, at which they end; where they fade it is below 300
    ends = 1 + np.flatnonzero(
        (sigma[1:-spare_values] < 1e-11) & (sigma[1:-spare_values] * 1e4 < sigma[: -spare_values - 1])
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
    # singular value, as part of the largest, down to which poles are told
    rank = int((sigma > 1e-11 * sigma[0]).sum())
    left, right = U[:, :rank].conj().T, Vt[:rank].conj().T
    return np.linalg.eigvals((left @ shifted @ right) / sigma[:rank, None])


def _beside(poles: Array, rng: np.random.Generator) -> Array:
    """Two ``phi`` beside every pole that is not far away."""
    poles = poles[(np.abs(poles) < MODES.pole_range) & (np.abs(poles) > 1.0 / MODES.pole_range)]
    gaps = np.abs(poles[:, None] - poles)
    np.fill_diagonal(gaps, np.abs(poles))
    # the least that counts of the distance of two poles, as part of their size
    gap = np.clip(gaps.min(axis=1, initial=np.inf), 1e-3 * np.abs(poles), np.abs(poles))
    # distance of samples from a pole, as part of that to the next one
    near = np.repeat(poles, 2) + 0.3 * np.repeat(gap, 2) * np.exp(2j * np.pi * rng.random(2 * len(poles)))
    return np.asarray(-1j * np.log(near))


class Pencil:
    """Members of a class in which one marker of every loop has turned by ``phi`` about a line, and all rods have other lengths."""

    def __init__(self, equations: Equations, base: Member, rng: np.random.Generator) -> None:
        self.equations, self.family, self.base = equations, equations.family, base
        s = self.family.system
        P = len(s.m.pairs)
        self.lines = np.zeros((6, len(self.family.bearers), 1), dtype=complex)
        self.along = _isotropic(self.family)
        # members of a pencil that are sampled first, of one with turns and of one along an isotropic direction; then as many again,
        # until they tell
        self.first = 48 if self.along is None else 16
        for chord, algebra in zip(s.chords.tolist(), self.family.loop_algebras, strict=True):
            self.lines[:, P + chord, 0] = _line(
                algebra if self.along is None else np.append(np.zeros(3), self.along)[:, None], rng
            )
        self.drive = self.family.lengths_of(_random(rng, len(base.drive)))[:, None]
        self.c = _random(rng, 1)[0]
        self.weights = _random(rng, len(self._told(self.family.here)))

    def members(self, phi: Array) -> Member:
        """Members at ``phi (n,)``; a line without a turn is a direction, along which it goes by ``z - 1``, as squares of rods do."""
        slides = np.abs(self.lines[:3]).max(axis=0) < MODES.span
        turned = self.lines * np.where(slides, np.exp(1j * phi) - 1.0, phi)
        markers = compose(pose_exp(self.family.in_links(turned)), self.base.markers)
        return Member(markers, self.base.drive + self.drive * (np.exp(1j * phi) - 1.0))

    @staticmethod
    def anywhere(n: int, rng: np.random.Generator) -> Array:
        """Random ``phi (n,)``."""
        # standard deviation of the imaginary part of ``phi``
        return np.asarray(rng.uniform(-np.pi, np.pi, n) + 1j * 1.2 * rng.normal(size=n))

    def sums(self, x: Array, phi: Array) -> tuple[Array, Array, Array]:
        """``z``, the sum and weights at pairs of members ``phi (n,)`` to both of which all tracks from ``x`` come."""
        (n, N), members = (len(phi), x.shape[1]), self.members(phi)
        leg = self.equations.leg(self.base, members, np.repeat(np.arange(n), N))
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
    if family.points or family.idle.shape[1] or family.plane is None or not is_one_group(family):
        return None
    return np.asarray([1.0, 1.0j] @ family.plane[:2])


def _line(algebra: Array, rng: np.random.Generator) -> Array:
    """A random turn ``(6,)`` about a line in an algebra ``(6, k)``; a direction where it has no turns."""
    w, v = (algebra @ (rng.normal(size=(algebra.shape[1], 2)) @ [1.0, 0.5j])).reshape(2, 3)
    if np.abs(w).max() < MODES.span:
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


MISSED, MISSED_AGAIN = 1e-4, 1e-6
"""Chance of an assembly having been missed at which loops of members end, where every permutation is as likely as any other: at the
first member, and at the one that is kept."""
MOST_TRACKED = 60_000
"""Tracks in all, after which they are not either."""


class Irregular(Exception):
    """Random members of a class are not closed by regular equations: its relations are not those of the mechanism."""


@dataclass(frozen=True)
class StartSet:
    """All assemblies ``x (nx, N)`` known of a member, and the mixing of its rows.

    ``loops`` is the number of loops of members that brought no further assembly, ``chance`` that of one having been missed by them, were
    every permutation as likely; ``lost`` of the tracks ``followed`` did not come to the end of their leg. ``trace`` is the trace test,
    which is left out where a bound is met. ``estimate``: how many there are in words, where loops bring further ones.
    """

    member: Member
    x: Array
    mixing: Array | None
    loops: int
    chance: float
    lost: int
    followed: int
    whole: bool
    trace: Trace
    estimate: str = ""

    def fits(self, family: Family) -> bool:
        """Whether it is closed for a class."""
        s = family.system
        if self.member.markers.shape != family.target.shape or self.x.ndim != 2 or len(self.x) != s.n_state:
            return False
        if (self.mixing is None) != family.whole or not np.isfinite(self.x).all():
            return False
        here = Configuration(family.system_of(self.member), self.x)
        size = np.maximum(1.0, np.abs(here.poses).max(axis=(0, 1, 2)))
        return bool((here.closure < MODES.member_closed * size).all())


def distinct(poses: Array, known: Array | None = None, least: Array | None = None) -> Array:
    """Places of assemblies that are new, each once: poses ``(n, V)`` that differ from those ``known (n, N)`` and before.

    ``least (V,)`` are differences, against their size, up to which they are one.
    """
    n, out = 0 if known is None else known.shape[1], list[int]()
    have = np.concatenate([known, poses], axis=1) if known is not None and n else poses.copy()
    for i in np.flatnonzero(np.isfinite(poses).all(axis=0)).tolist():
        size = max(1.0, float(np.abs(poses[:, i]).max(initial=0.0)))
        one = MODES.one_assembly if least is None else least[i]
        if (np.abs(have[:, : n + len(out)] - poses[:, [i]]).max(axis=0, initial=0.0) > one * size).all():
            have[:, n + len(out)] = poses[:, i]
            out.append(i)
    return np.array(out, dtype=np.intp)


def start_set(family: Family, rng: np.random.Generator, progress: Callable[[str], None] | None = None) -> StartSet:
    """All assemblies of a random member of a class.

    Raises
    ------
    Irregular
        where random members are not closed by regular equations.
    """
    # random members tried until one is regular
    for _ in range(8):
        closed = family.random_closed(rng)
        if closed is None:
            continue
        member, x = closed
        equations = Equations(family, family.mixing(rng))
        leg = Leg(equations, member, member)
        here = leg.at(x[:, None], np.zeros(1), np.zeros(1, dtype=np.intp))
        if rank_of(singular_values(here.J[:, :, 0]), MODES.generic) == family.rank and not _told_by_idle(family, here):
            return _permuted(equations, member, x, rng, progress)
    raise Irregular


def _told_by_idle(family: Family, here: Linear) -> bool:
    """Whether motions that the equations leave free move what tells assemblies apart: such members have not the passive motions."""
    s, idle = family.system, here.idle()[0].conj()
    rates = np.zeros((s.n_freedoms, len(idle)), dtype=complex)
    rates[family.free] = idle.T
    moved = [here.here.link_twists(rate[:, None])[:, family.settled_links] for rate in rates.T]
    single = np.flatnonzero(np.isin(s.single_rows, np.concatenate(family.settled_rows)))
    return bool(
        np.abs(np.array(moved)).max(initial=0.0) > MODES.span or np.abs(rates[single]).max(initial=0.0) > MODES.span
    )


def _permuted(
    equations: Equations, base: Member, x: Array, rng: np.random.Generator, progress: Callable[[str], None] | None
) -> StartSet:
    """The assemblies to which loops of members lead from one, until more loops than chance can explain bring none.

    They begin at one member and then at another: what is hard to reach at the first, large numbers in its poses, is not at the second.
    Where a bound is met, no loop could bring a further one.
    """
    known = bound(equations.family)
    # assemblies of one member from which on they are not looked for any further
    most_found = 1200
    group = TrackGroup(equations, base, x[:, None], most_found if known is None else known.count)
    group.grow(MISSED, rng, progress)
    group.move(*tame(equations, group.base, group.x, rng))
    group.grow(MISSED_AGAIN, rng, progress)
    N = group.x.shape[1]
    met = known is not None and known.count == N
    whole = met or (most_found > N and group.chance <= MISSED_AGAIN)
    test = whole and not met
    trace = trace_test(equations, group.base, group.x, rng, progress) if test else NOT_PASSED
    return StartSet(
        group.base,
        group.x,
        equations.mixing,
        group.quiet,
        group.chance,
        group.lost,
        group.followed,
        whole,
        trace,
        group.estimate,
    )


class TrackGroup:
    """Assemblies ``x (nx, N)`` known of a member ``base``, and the loops that brought no further one."""

    def __init__(self, equations: Equated, base: Any, x: Array, most: int) -> None:
        self.equations, self.most, self.lost, self.followed = equations, most, 0, 0
        # sums over loops of how many were known before times how many came back, and of how many of these were known
        self.caught, self.again = 0, 0
        self.move(base, x)

    def move(self, base: Any, x: Array) -> None:
        """Go on at another member."""
        self.base, self.x, self.known = base, x, self.equations.fingerprints(base, x)
        self.quiet, self.chance = 0, 1.0

    def grow(self, missed: float, rng: np.random.Generator, progress: Callable[[str], None] | None) -> None:
        """Loops until the chance of one having been missed is small."""
        family = self.equations.family
        # rounds of loops at a member
        for _ in range(60):
            if (N := self.x.shape[1]) >= self.most or self.chance <= missed or self.followed >= MOST_TRACKED:
                break
            if progress is not None:
                progress(
                    f"{counted(N, 'solution')} of a random member so far{self.estimate}, {self.quiet} loops brought no further one"
                )
            # so many that where none brings a further one they are enough, and no more than are followed at the cost of one
            enough = int(np.ceil(np.log(missed / self.chance) / -np.log(N + 1.0)))
            loops = max(min(enough, TRACKS_TOGETHER // N), 1)
            there, loop = self._round(family, loops, rng, progress)
            poses = self.equations.fingerprints(self.base, there)
            for mine in (loop == k for k in range(loops)):
                new = distinct(poses[:, mine], self.known)
                self.caught += self.x.shape[1] * int(mine.sum())
                self.again += int(mine.sum()) - new.size
                self.x = np.concatenate([self.x, there[:, mine][:, new]], axis=1)
                self.known = np.concatenate([self.known, poses[:, mine][:, new]], axis=1)
            # a further one stays outside where the loop leaves it where it is, or where its track is lost
            outside = min(1.0 / (N + 1.0) + (1.0 - there.shape[1] / (N * loops)), 1.0)
            quiet = self.x.shape[1] == N
            self.quiet, self.chance = (self.quiet + loops, self.chance * outside**loops) if quiet else (0, 1.0)

    @property
    def estimate(self) -> str:
        """How many there are in all, by what loops bring again; nothing is said where loops bring all again."""
        caught, again = self.caught, self.again
        # the number that is counted again is off by its root; three are not counted with a chance of .95 where none is
        least = caught / (again + 2 * again**0.5 + 3)
        if self.quiet or (again < 10 and least <= self.x.shape[1]):
            return ""
        if again < 10:
            return f", of more than {least:.2g} by what loops bring again"
        return f", of some {caught / again:.4g} (+-{100 / again**0.5:.0f} %) by what loops bring again"

    def _round(
        self, family: Any, loops: int, rng: np.random.Generator, progress: Callable[[str], None] | None
    ) -> tuple[Array, Array]:
        """Where all assemblies come to on several loops through two random members each, and on which of these."""
        base, corners = self.base.joined([self.base] * loops), family.random_members(rng, 2 * loops)
        first, second = (self.base.joined(corners[i::2]) for i in range(2))
        begin, end = self.base.joined([base, first, second]), self.base.joined([first, second, base])
        N, laps = self.x.shape[1], 3
        leg = self.equations.leg(begin, end, np.repeat(np.arange(laps * loops), N))
        tracked = follow(leg, np.tile(self.x, loops), Care(), laps=laps, told=progress)
        self.lost += int((~tracked.arrived).sum())
        self.followed += laps * N * loops
        return tracked.x[:, tracked.arrived], np.repeat(np.arange(loops), N)[tracked.arrived]


def tame(equations: Equated, base: Any, x: Array, rng: np.random.Generator) -> tuple[Any, Array]:
    """Of some random members that with the smallest numbers in its assemblies, from which tracks are the least likely to be lost.

    Assemblies ``x (nx, N)`` that come to one there are one, which large numbers had told apart by their rounding.
    """
    family, N = equations.family, x.shape[1]
    # members of which the best one is kept
    candidates = 6
    members = family.random_members(rng, candidates)
    which = np.repeat(np.arange(candidates), N)
    tracked = follow(equations.leg(base, base.joined(members), which), np.tile(x, candidates), Care())
    keep, found = np.arange(N), []
    for number, member in enumerate(members):
        mine = which == number
        there, poses = tracked.x[:, mine], equations.fingerprints(member, tracked.x[:, mine])
        arrived = np.flatnonzero(tracked.arrived[mine])
        keep = np.setdiff1d(keep, np.delete(arrived, distinct(poses[:, arrived])))
        found.append((member, there, poses, tracked.arrived[mine]))
    best, least = (base, x[:, keep]), np.abs(equations.fingerprints(base, x[:, keep])).max()
    for member, there, poses, came in found:
        size = np.abs(poses[:, keep]).max() if came[keep].all() else np.inf
        if size < least:
            best, least = (member, there[:, keep]), size
    return best


PACKED = Path(__file__).with_name("start-sets.npz")
"""Start sets that come with the package, one after the other: names are ``key/array``."""


def key(labelling: Labelling) -> str:
    """What a start set serves for: the topology; where relations are kept, the geometry too."""
    # 6: the version of the files and of what start sets mean
    return f"6-{labelling.key}"


def kept(family: Family) -> StartSet | None:
    """The start set of a class, where one is kept and closed: the user's, or else that of the package."""
    labelling = Labelling(family)
    return _read(cache_folder() / f"start-{key(labelling)}.npz", "", labelling) or packed(labelling)


def packed(labelling: Labelling) -> StartSet | None:
    """The start set of a class that came with the package."""
    return _read(PACKED, f"{key(labelling)}/", labelling)


def _read(file: Path, prefix: str, labelling: Labelling) -> StartSet | None:
    try:
        with file.open("rb") as handle, np.load(handle, allow_pickle=False) as f:
            loops, lost, followed, degree, samples = f[prefix + "counts"].tolist()
            chance, last, beyond = f[prefix + "sizes"].tolist()
            member, x = labelling.taken(*(f[prefix + name] for name in ("markers", "squares", "x")))
        trace = Trace(degree, samples, last, beyond)
        # any combinations of the rows will do that are not special
        mixing = labelling.family.mixing(np.random.default_rng(0))
        found = StartSet(member, x, mixing, loops, chance, lost, followed, True, trace)
        return found if found.fits(labelling.family) else None
    except (OSError, ValueError, KeyError, IndexError, EOFError, RuntimeError, zipfile.BadZipFile, TypeError):
        return None


def arrays(labelling: Labelling, start: StartSet) -> dict[str, Any]:
    """A start set as arrays by name."""
    return {
        **labelling.ordered(start.member, start.x),
        "sizes": np.array([start.chance, start.trace.last, start.trace.beyond]),
        "counts": np.array([start.loops, start.lost, start.followed, start.trace.degree, start.trace.samples]),
    }


def keep(family: Family, start: StartSet) -> None:
    """Keep a start set, as far as the folder allows."""
    labelling = Labelling(family)
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with whole_file(cache_folder() / f"start-{key(labelling)}.npz") as temporary, temporary.open("xb") as handle:
            np.savez_compressed(handle, **arrays(labelling, start))
    except (OSError, RuntimeError, MechgraphError):
        return


def tested(
    family: Family, known: StartSet, rng: np.random.Generator, progress: Callable[[str], None] | None
) -> StartSet:
    """A kept start set, the trace test of which is tried again where it passed none."""
    met = bound(family)
    if not known.whole or known.trace.passed or (met is not None and met.count == known.x.shape[1]):
        return known
    known = replace(known, trace=trace_test(Equations(family, known.mixing), known.member, known.x, rng, progress))
    if known.trace.passed:
        keep(family, known)
    return known
