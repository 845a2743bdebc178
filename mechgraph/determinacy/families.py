"""Kinds of mobility, and families of bodies that move with the same freedoms.

The kind of a mechanism or of one loop: planar, spherical, or neither, found from the twists of its pairs.
Planar twists are parallel to one plane with normal n, spherical ones are turns about one center O:

    planar  n x w = 0,  n . v = 0        spherical  v + w x O = 0

Where not all pairs have such twists alone (balls in place of pins, cylinders between balls), the mechanism still moves as a planar or
spherical one if its motions at a nearby position, passive ones set aside, are such motions of every pair.
Source: Herve, The Lie group of rigid body displacements, Mechanism and Machine Theory 34, 1999.

Families: the freedoms that no link has over a finite motion, of the mechanism and of every loop; textbook counts beside the rank.
The twists of all pairs that move, at positions along the motion, span a space of dimension d, whatever the frame: the family is f = 6 - d,
seen from that link from which it is least (a plane may turn with another link). The links themselves may do less, as where balls turn in
one plane only; the dimension that the twists of the links span stands in the mobility table. Dobrovolski's count for n moving links and
c_j pairs of class j, which leave 6 - j freedoms:

    M = (6 - f) n - sum_{j > f} (j - f) c_j,

and for loops of several families, with the apparent family f_a, the mean of those of the independent loops, links joined by pairs that
stand still counted as one:

    M = (6 - f_a) n - sum_j (j - f_a) c_j.

Source: Marghitu, Fundamentals, equations 2.1 and 2.4; for several families Antonescu, Mechanisms, 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from mechgraph.determinacy.finite_motion import FiniteMotion
from mechgraph.determinacy.mobility import Freedoms, Position, freedoms_at
from mechgraph.kinematics.solver import ClosureRank
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array, Index, skew
from mechgraph.maths.tolerances import MOTIONS, RANKS
from mechgraph.memo import dataclass
from mechgraph.model.parameters import Parameters


@dataclass(frozen=True)
class MotionKind:
    """A kind by ``name`` ("" for neither) with its ``place (3,)``: the unit normal (``is_direction``), or the center.

    ``outside (3, 6)`` are functionals that vanish on its twists about the internal origin; ``by_pairs`` whether all pairs have such
    twists alone.
    """

    name: str = ""
    place: tuple[float, ...] = ()
    outside: Array | None = field(default=None, repr=False)
    is_direction: bool = False
    by_pairs: bool = True

    @property
    def twists(self) -> Array:
        """Orthonormal twists ``(6, 3)`` of the kind; none for neither."""
        return np.zeros((6, 0)) if self.outside is None else np.linalg.svd(self.outside)[2][3:].T

    def in_global(self, par: Parameters) -> MotionKind:
        """The kind with its center in the global frame."""
        centre = par.L * np.array(self.place) + par.origin if self.place and not self.is_direction else self.place
        return replace(self, place=tuple(map(float, centre)))

    def holds(self, twists: Array) -> bool:
        """Whether twists ``(6, n)`` are all of this kind."""
        if self.outside is None or not twists.size:
            return False
        size = np.abs(twists).max()
        return bool(np.abs(self.outside @ twists).max() <= RANKS.position * size * np.abs(self.outside).max())


def planar(twists: Array) -> MotionKind:
    """The plane to which the turns ``(6, n)`` (without any: the slides) are parallel."""
    turning = np.linalg.norm(twists[:3], axis=0) > RANKS.position
    if turning.any():
        normal = _principal(twists[:3, turning])[0][:, 0]
    else:
        U, s = _principal(twists[3:])
        if (s > RANKS.position).sum() != 2:
            return MotionKind()
        normal = U[:, 2]
    normal = normal * np.sign(normal[np.argmax(np.abs(normal) > 1e-6)])
    normal = np.where(np.abs(normal) < RANKS.position, 0.0, normal)
    normal /= np.linalg.norm(normal)
    across = skew(normal)[np.argsort(-np.linalg.norm(skew(normal), axis=1))[:2]]
    return MotionKind(
        "planar",
        tuple(normal.tolist()),
        np.block([[across, np.zeros((2, 3))], [np.zeros(3), normal]]),
        is_direction=True,
    )


def _principal(vectors: Array) -> tuple[Array, Array]:
    """Left singular vectors ``(3, 3)`` and singular values of vectors ``(3, n)``, by way of their triangular factor."""
    triangular: Array = np.asarray(np.linalg.qr(vectors.T, mode="r"))
    U, s, _ = np.linalg.svd(triangular.T)
    return U, s


def spherical(twists: Array) -> MotionKind:
    """The center through which the turns ``(6, n)`` pass: of the least squares of ``v + w x O``."""
    rows = np.moveaxis(skew(twists[:3]), -1, 0).reshape(-1, 3)
    if np.linalg.matrix_rank(rows, tol=RANKS.position) < 3:
        return MotionKind()
    centre: Array = np.asarray(np.linalg.lstsq(rows, -twists[3:].T.ravel(), rcond=None)[0])
    return MotionKind("spherical", tuple(centre.tolist()), np.concatenate([-skew(centre), np.eye(3)], axis=1))


KINDS: tuple[Callable[[Array], MotionKind], ...] = (planar, spherical)
"""What is looked for, in this order: turns about one line alone are both."""


def kind_of(twists: Array) -> MotionKind:
    """The kind of twists ``(6, n)`` about the internal origin."""
    found = (make(twists) for make in KINDS if twists.size)
    return next((kind for kind in found if kind.holds(twists)), MotionKind())


def kind_of_mechanism(freedoms: Freedoms, motion: FiniteMotion | None) -> MotionKind:
    """The kind of all pairs, else of the motions beside the passive ones at a position nearby."""
    rows = freedoms.position.rows
    if freedoms.position.m.planar:
        return planar(np.eye(6)[:, 2:3])
    kind = kind_of(rows.S)
    # mobility up to which the motions of pairs of other kinds are looked at
    look = motion and not kind.name and freedoms.mobility <= 200
    nearby = motion.closure_nearby if motion and look else None
    if nearby is None:
        return kind
    alone = rows.S[:, rows.first_column[:-1][np.diff(rows.first_column) == 1]]
    pins = alone[:, np.linalg.norm(alone[:3], axis=0) > 0.5]
    if not pins.size:
        return kind
    alike = np.abs(pins[:3].T @ pins[:3]) > 1 - RANKS.position
    candidates = (planar(pins[:, alike[np.argmax(alike.sum(axis=1))]]), spherical(pins))
    return next((replace(c, by_pairs=False) for c in candidates if _moves_so(c, freedoms, nearby)), kind)


def plane_of_motion(freedoms: Freedoms, motion: FiniteMotion, normal: Array | None = None) -> Array | None:
    """The normal of the plane to which the motions nearby are parallel, whatever the pairs could; the one given, if it is that.

    Not given, it is the direction about which the pairs turn most.
    """
    if motion.closure_nearby is None:
        return None
    rows, motions = motion.closure_nearby.reduced.rows, motion.closure_nearby.motions
    if normal is None:
        some = rows.first_column[:-1][np.diff(rows.first_column) > 0]
        normal = _principal(np.add.reduceat(rows.S[:3, :, None] * motions, some, axis=1).reshape(3, -1))[0][:, 0]
    kind = planar(np.concatenate([normal, np.zeros(3)])[:, None])
    return np.array(kind.place) if _moves_so(kind, freedoms, motion.closure_nearby) else None


def _moves_so(kind: MotionKind, freedoms: Freedoms, nearby: ClosureRank) -> bool:
    """Whether the motions nearby, but for as many as there are passive ones of other kinds, keep every pair to this kind."""
    if kind.outside is None:
        return False
    rows, motions = nearby.reduced.rows, nearby.motions
    some = rows.first_column[:-1][np.diff(rows.first_column) > 0]
    leaving = np.add.reduceat((kind.outside @ rows.S)[:, :, None] * motions, some, axis=1).reshape(-1, motions.shape[1])
    of_kind = int((np.linalg.eigvalsh(leaving.T @ leaving) < MOTIONS.nearby**2).sum())
    others = sum(not kind.holds(p.twist[:, None]) for p in freedoms.passive)
    return 0 < of_kind == motions.shape[1] - others


COLUMNS = ("Tx", "Ty", "Tz", "Rx", "Ry", "Rz")
"""Columns of a mobility table."""
SPAN = 1e-6
"""Singular value of twists of size one below which they do not span a direction: a direction that bends by the square of a step shows."""


@dataclass(frozen=True)
class MobilityRow:
    """What a link does over the motion: ``columns`` Tx to Rz of a frame along the global axes, ``dimension`` the span of its twists."""

    link: str
    columns: tuple[bool, bool, bool, bool, bool, bool]
    dimension: int


@dataclass(frozen=True)
class LoopFamily:
    """A loop: its ``pairs``, ``family``, the ``rank`` of its closure, and pairs of it that are ``locked`` (stand still all along)."""

    pairs: tuple[str, ...]
    family: int
    rank: int
    locked: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class Families:
    """Families of a mechanism, the counts made of them, and the mobility by rank. Attribute ``families`` of a report.

    The family is the number of freedoms that no pair has along the motion; Dobrovolski's count is ``M = sum f - (6 - family) loops``.

    Attributes
    ----------
    table : tuple
        The mobility table.
    family : int
        Family of the mechanism; 6 if nothing moves.
    loops : tuple
        Family of every loop of the cycle basis.
    classes : 5 int
        Numbers of pairs of the classes 1 to 5.
    links : int
        Number of moving links.
    welded : 5 int
        Pairs that are stationary, so that their links move as one.
    mobility, passive : int
        Finite mobility by rank, and the passive freedoms among it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> f = mg.check(mg.load("four-bar")).families
    >>> f.family, f.dobrovolski, f.mobility
    (3, 1, 1)
    """

    table: tuple[MobilityRow, ...]
    family: int
    loops: tuple[LoopFamily, ...]
    classes: tuple[int, int, int, int, int]
    links: int
    welded: tuple[int, int, int, int, int]
    mobility: int
    passive: int

    def __repr__(self) -> str:
        return f"Families(family {self.family}, Dobrovolski {self.dobrovolski}, mobility by rank {self.mobility})"

    @property
    def dobrovolski(self) -> int:
        """Mobility by Dobrovolski's count with the family of the mechanism."""
        f = self.family
        return (6 - f) * self.links - sum((j - f) * c for j, c in enumerate(self.classes, start=1) if j > f)

    @property
    def apparent(self) -> float:
        """Apparent family: the mean of those of the loops."""
        return sum(loop.family for loop in self.loops) / len(self.loops) if self.loops else float(self.family)

    @property
    def by_apparent(self) -> float:
        """Mobility by the count with the apparent family, pairs that stand still taken as welds."""
        n = self.links - sum(self.welded)
        fa = self.apparent
        moving = [c - w for c, w in zip(self.classes, self.welded, strict=True)]
        return (6 - fa) * n - sum((j - fa) * c for j, c in enumerate(moving, start=1))

    @property
    def degenerate(self) -> tuple[int, ...]:
        """Numbers of loops with pairs that cannot move, without which the family is higher."""
        return tuple(i for i, loop in enumerate(self.loops) if loop.locked and 6 - loop.family < loop.rank)

    @cached_property
    def why(self) -> tuple[str, ...]:
        """Where textbook counts and the rank disagree, and why."""
        if not self.mobility:
            return ("Nothing moves: what family it would be of cannot be told.",)
        out = []
        for i, loop in enumerate(self.loops, start=1):
            if i - 1 in self.degenerate:
                out.append(
                    f"Loop {i} is degenerate: {', '.join(loop.locked)} cannot move. The others make it a loop of family {loop.family}, "
                    f"with them its closure has rank {loop.rank}."
                )
            elif loop.rank < 6 - loop.family:
                out.append(
                    f"Loop {i} moves by its dimensions: its pairs span {6 - loop.family} freedoms along the motion, but the rank of its "
                    f"closure is {loop.rank} everywhere. No family counts that; the rank does."
                )
        if len({loop.family for loop in self.loops}) > 1 and self.dobrovolski != self.mobility:
            out.append(
                "The loops are of different families, so the count with one family for all fails; take the apparent one."
            )
        if self.passive and self.mobility in (self.dobrovolski, round(self.by_apparent)):
            out.append(f"{self.passive} of the mobility is passive: it moves no other link.")
        elif not out and self.mobility not in (self.dobrovolski, self.by_apparent):
            out.append("Loops share redundant constraints, which no count loop by loop sees; the rank does.")
        return tuple(out)


def families(freedoms: Freedoms, driven: Index, motion: FiniteMotion) -> Families:
    """The families over the motion from a closed position; what cannot move is of family 6."""
    m, position = freedoms.position.m, freedoms.position
    positions = [freedoms, *_along(freedoms, driven, motion)]
    twists = np.concatenate([_link_twists(f) for f in positions], axis=2)
    names = m.link_names()
    rows = tuple(MobilityRow(names[i], *_row(twists[:, i])) for i in range(len(names)))
    moves = np.max([np.abs(f.null).max(axis=1, initial=0.0) for f in positions], axis=0) > MOTIONS.nearby
    still = [k for k in range(len(m.pairs)) if not moves[list(position.columns(k))].any()]
    moving = np.array([c for k in range(len(m.pairs)) if k not in still for c in position.columns(k)], dtype=np.intp)
    loops = []
    for loop, (columns, _) in zip(position.graph.loops, position.declared.system.loop_columns, strict=True):
        links = sorted({link for k, _ in loop for link in position.graph.ends[k]})
        loops.append(
            LoopFamily(
                tuple(m.pairs[k].name for k, _ in loop),
                6 - _span(positions, np.intersect1d(columns, moving), links),
                max(rank_of(singular_values(f.position.rows.S[:, columns])) for f in positions),
                tuple(m.pairs[k].name for k, _ in loop if k in still),
            )
        )
    return Families(
        rows,
        6 - _span(positions, moving, range(len(names))),
        tuple(loops),
        _classes(freedoms, range(len(m.pairs))),
        len(names) - 1,
        _classes(freedoms, still),
        min(freedoms.mobility, motion.mobility),
        len(freedoms.passive),
    )


def _span(positions: Sequence[Freedoms], columns: Index, links: Sequence[int] | range) -> int:
    """Dimension that twists of freedoms span at all positions, seen from that one of the links from which it is least."""
    least = 6
    for link in links:
        seen = []
        for f in positions:
            S, pose = f.position.rows.S[:, columns], f.position.declared.poses[:, :, link, 0]
            moved = S[3:] + np.cross(S[:3], pose[:, 3], axis=0)
            seen.append(np.concatenate([pose[:, :3].T @ S[:3], pose[:, :3].T @ moved]))
        least = min(least, _rank(np.concatenate(seen, axis=1)))
    return least


def _classes(freedoms: Freedoms, pairs: Sequence[int] | range) -> tuple[int, int, int, int, int]:
    counts = [0] * 7
    for k in pairs:
        counts[6 - len(freedoms.position.columns(k))] += 1
    c1, c2, c3, c4, c5 = counts[1:6]
    return c1, c2, c3, c4, c5


def _along(freedoms: Freedoms, driven: Index, motion: FiniteMotion) -> list[Freedoms]:
    """What can move at positions along random motions."""
    if not motion.begin or not motion.mobility:
        return []
    start, _ = motion.begin
    rng = np.random.default_rng(19)
    system = start.system
    out = []
    for _ in range(1 if start.N.shape[1] == 1 else 3):
        v = start.random(rng)
        # lengths (radians, or lengths / L) of the steps along a motion at which the links are looked at
        reached = [start.moved(np.sign(h) * v, abs(h)) for h in (0.02, 0.06, 0.11, 0.17, -0.04, -0.09, -0.15)]
        out += [freedoms_at(Position.at(Configuration(system, x[:, None])), driven) for x in reached if x is not None]
    return out


def _link_twists(f: Freedoms) -> Array:
    """Twists ``(6, links, M)`` of the links for the motions of a position without passive ones, each of size one."""
    here = f.position.declared
    motions = f.inputs
    out = [here.link_twists(rate[:, None])[:, :, 0] for rate in motions.T if np.abs(rate).max() > MOTIONS.nearby]
    if not out:
        return np.zeros((6, f.position.graph.n_links, 0))
    return np.stack([V / np.abs(V).max() for V in out], axis=2)


def _rank(twists: Array) -> int:
    """Dimension that twists ``(6, n)`` span."""
    return (
        int((np.linalg.svd(twists, compute_uv=False) > SPAN * np.sqrt(max(twists.shape[1], 1))).sum())
        if twists.size
        else 0
    )


def _row(twists: Array) -> tuple[tuple[bool, bool, bool, bool, bool, bool], int]:
    """The columns of a link with twists ``(6, n)``, translations those of the point that moves least; the dimension of their span."""
    if not twists.size or np.abs(twists).max() < SPAN:
        return (False,) * 6, 0
    rows = np.moveaxis(skew(twists[:3]), -1, 0).reshape(-1, 3)
    point = np.linalg.lstsq(rows, -twists[3:].T.ravel(), rcond=SPAN)[0]
    slides = twists[3:] + np.cross(twists[:3], point, axis=0)
    size = np.abs(np.concatenate([slides, twists[:3]])).max(axis=1) > SPAN
    a, b, c, d, e, f = size.tolist()
    return (a, b, c, d, e, f), _rank(twists)
