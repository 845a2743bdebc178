"""Families: mechanisms that differ in numbers alone, and an order that all of them share.

The class of a mechanism: its pairs moved about by complex rigid motions that keep what its closure rows rest on.

Relative to a closed position all that a loop can do is a product of motions of the algebra ``h`` that its twists generate: all of
se(3), plane motions where axes are parallel, rotations where they meet. A marker of a pair is moved by motions of the algebra that all
loops through the pair share, so that every member of the class has closure equations of the same rank: the dimension of ``h``, summed
over the loops. Over all members the assemblies form one irreducible variety, as every set of pair coordinates is closed by exactly one
motion of the last marker of each loop. Its monodromy group is therefore transitive: from one assembly all others are reached.

Sources: Herve, Analyse structurelle des mecanismes par groupe des deplacements, Mech. Mach. Theory 13, 1978; Sommese and Wampler, The
Numerical Solution of Systems of Polynomials, 2005, chapters 7 and 15.

A class whatever the order of its declaration: links, pairs and rods by number alone, and start sets in that order.

Links, pairs, rods and the points at the ends of rods are the nodes of a graph, of which the canonical form is the class, see
``atlas.canonical``: names are left out, and which link of a pair is the first where its motions are a group that says as much the other
way round. A pair declared the other way round has its markers exchanged and the inverse of its motion: the coordinates of turns and slides
that commute change their signs, and so does the vector part of a rotation's quaternion.

Where all loops move in one plane (``Family.plane``), a class keeps of its pairs only how they stand to the normal. Let ``C`` turn the
normal into ``z``, ``T`` shift both markers of a pair into the plane ``z = 0``, and ``F`` turn them, with ``F exp(q s) F^-1 = exp(+-q s)``.
As ``T`` and plane motions commute, markers ``T C M F^-1`` have the same closed states up to these signs: one start set serves all
trusses of a topology.

Assemblies that are not isolated: sought by Newton steps and near singular ends.

What lies about an assembly at which the closure rows are nearly singular: a root alone, two that meet, or a continuum.

Let ``sigma`` be the smallest singular value beside those of passive motions, ``n`` and ``u`` its directions of freedoms and of rows. Along
``n``, all else closed,

    u . f(x + s n) = u . f(x) + sigma s + kappa s^2 / 2 + ...,    kappa = u . f''(n, n),

which has two roots ``2 sqrt(sigma^2 - 2 kappa u . f) / kappa`` apart, real or not: near each other at a fold, far from each other where
equations are ill-conditioned. Where a step along what the rows leave free is closed again elsewhere, the assembly can move. Source:
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, chapter 3 (reduction of Lyapunov and Schmidt).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.graph.chains import least_order, ranked
from mechgraph.kinematics.reach import BEYOND_END, beyond
from mechgraph.kinematics.solver import closure_rank
from mechgraph.kinematics.state import CLOSED, Configuration, close_all
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Index, compose, cross_twist, finite_twist, inverse, move_twist, multiplied, pose_exp
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.pairs.pair_type import PairType

Array = NDArray[Any]
"""Numbers, real or complex."""
NO_NUMBERS: Index = np.zeros(0, dtype=np.intp)
"""No freedoms, no links."""


@dataclass(frozen=True)
class Member:
    """Members of a class: markers ``(3, 4, 2 P, n)`` of links a, then of links b, complex, and driver values ``(d, n)``."""

    markers: Array
    drive: Array

    def taken(self, which: Index) -> Member:
        """Some of the members; markers of one serve for all."""
        one = self.markers.shape[-1] == 1
        return Member(self.markers if one else self.markers[..., which], self.drive[:, which])

    @staticmethod
    def joined(members: Sequence[Member]) -> Member:
        """Several members, one after the other along the last axis."""
        return Member(*(np.concatenate([getattr(m, f) for m in members], axis=-1) for f in ("markers", "drive")))


class Family:
    """The class of a mechanism with drivers ``columns``, told at a closed position ``here``.

    ``idle (F, p)`` are passive motions, by which assemblies are not told apart, of which rest of ``held`` freedoms stops some: ``passive``
    are those left.
    """

    def __init__(self, here: Configuration, columns: Index, idle: Array, held: Index = NO_NUMBERS) -> None:
        self.here, self.system, self.columns, self.idle, self.held = here, here.system, columns, idle, held
        self.passive = at_rest(idle, held)
        self.free = complement(np.concatenate([columns, held]), self.system.n_freedoms)
        self.rows = self.system.single_rows[columns]
        par = self.system.par
        self.target: Array = np.concatenate([par.marker_a, par.marker_b], axis=2).astype(complex)
        self.bearers: Index = np.concatenate([self.system.a, self.system.b])
        """Links that bear the markers."""

    @cached_property
    def loop_algebras(self) -> list[Array]:
        """For every loop an orthonormal basis ``(6, k)`` of the algebra that its twists generate."""
        S = self.here.S[:, :, 0]
        return [generated(S[:, columns]) for columns, _ in self.system.loop_columns]

    @cached_property
    def algebras(self) -> list[Array]:
        """For every pair a basis of the motions by which its markers may be moved."""
        through: list[list[Array]] = [[] for _ in self.system.m.pairs]
        for algebra, loop in zip(self.loop_algebras, self.system.graph.loops, strict=True):
            for pair, _ in loop:
                through[pair].append(algebra)
        return [common(algebras) for algebras in through]

    @cached_property
    def plane(self) -> Array | None:
        """Two directions of the plane in which all loops move, and its normal ``(3, 3)``; None where they move otherwise."""
        shared = common(self.loop_algebras)
        if shared.shape[1] != 3 or {h.shape[1] for h in self.loop_algebras} != {3}:
            return None
        _, turns, Vt = np.linalg.svd(shared[:3])
        one, other = (shared @ Vt[1:].T)[3:].T
        return np.stack([one, other, np.cross(one, other)]) if (turns > MODES.span).sum() == 1 else None

    @cached_property
    def moving(self) -> list[Array]:
        """The same without the motions that the pair does itself, where these are a group: to move a marker so renames coordinates."""
        S, out = self.here.S[:, :, 0], []
        for pair, basis in enumerate(self.algebras):
            own = S[:, self.system.first_column[pair] : self.system.first_column[pair + 1]]
            own = span(own) if generated(own).shape[1] == own.shape[1] else own[:, :0]
            out.append(span(basis - own @ (own.T @ basis)))
        return out

    @property
    def points(self) -> list[list[int]]:
        """Links, and points that are one, at the ends of rods; here there are none."""
        return []

    @property
    def rank(self) -> int:
        """Rank of the closure equations of the members."""
        return sum(algebra.shape[1] for algebra in self.loop_algebras)

    @property
    def whole(self) -> bool:
        """Whether no relation is kept: every loop may do all rigid motions."""
        return self.rank == self.system.n_rows

    @property
    def unknowns(self) -> int:
        """Freedoms that the closure equations have to determine."""
        return len(self.free) - self.passive.shape[1]

    @cached_property
    def fault(self) -> str:
        """Why members of the class are no guide to the assemblies of the mechanism, in words; empty where they are."""
        if self.system.m.couplings:
            return "couplings of freedoms tie angles beyond a turn"
        if self.system.moving_batches:
            return "a pair guides along a curve"
        S = self.here.S[:, :, 0]
        if np.abs((S[:3] * S[3:]).sum(axis=0)).max(initial=0.0) > MODES.span:
            return "helical pairs make the closure transcendental"
        if self.unknowns != self.rank or not self.independent:
            return "its closure rows depend on each other by relations that no known class keeps"
        return ""

    @property
    def independent(self) -> bool:
        """Whether the closure rows have at the start the rank that they have for all members."""
        return closure_rank(self.here, self.columns).rank == self.rank

    @cached_property
    def settled_links(self) -> Index:
        """Links that no passive motion moves."""
        V = [self.here.link_twists(rates[:, None]) for rates in self.idle.T]
        links = np.arange(len(self.system.m.links))
        still = np.abs(V).max(axis=(0, 1, 3)) < MODES.span if V else np.ones(len(links), dtype=bool)
        return links[still]

    @cached_property
    def periods(self) -> Array:
        """By how much freedoms ``(F,)`` grow until all is as it was: turns, closed curves; infinite for slides and helical motions."""
        S = self.here.S[:, :, 0]
        helical = ~self.system.is_length & (np.abs((S[:3] * S[3:]).sum(axis=0)) > MODES.span)
        return np.where(helical, np.inf, self.system.periods)

    @cached_property
    def settled_rows(self) -> tuple[Index, Index]:
        """State rows of freedoms that come back and of those that do not, which no passive motion changes."""
        s = self.system
        still = (s.single_rows >= 0) & (np.abs(self.idle).max(axis=1, initial=0.0) < MODES.span)
        back = np.isfinite(self.periods)
        return s.single_rows[still & back], s.single_rows[still & ~back]

    def without(self, links: Index) -> Family:
        """The same, but for links, as of legs that can stand in several ways, by which assemblies are not told apart."""
        s, out = self.system, copy(self)
        rows = s.single_rows[(np.isin(s.a, links) | np.isin(s.b, links))[s.pair_of_freedom]]
        vars(out)["settled_links"] = np.setdiff1d(self.settled_links, links)
        vars(out)["settled_rows"] = tuple(np.setdiff1d(own, rows) for own in self.settled_rows)
        return out

    @property
    def settled_rotations(self) -> Index:
        """State rows ``(4, n)`` of rotations that no passive motion changes."""
        if self.system.rotations is None:
            return np.zeros((4, 0), dtype=np.intp)
        columns, rows = self.system.rotations
        still = np.abs(self.idle).max(axis=1, initial=0.0) < MODES.span
        return rows[:, still[columns].all(axis=0)]

    def prints(self, here: Configuration) -> Array:
        """What tells assemblies apart ``(n, T)``: poses of links that no passive motion moves, coordinates that none changes."""
        poses = here.poses[:, :, self.settled_links]
        back, others = self.settled_rows
        angles = here.x[back] * (2 * np.pi / self._period_of_row[back])[:, None]
        return np.concatenate(
            [poses.reshape(12 * poses.shape[2], here.T), np.cos(angles), np.sin(angles), here.x[others]]
        )

    @cached_property
    def _period_of_row(self) -> Array:
        out, s = np.full(self.system.n_state, np.inf), self.system
        single = s.single_rows >= 0
        out[s.single_rows[single]] = self.periods[single]
        return out

    def system_of(self, member: Member) -> System:
        """The system of members."""
        return self.system_with(member.markers, member.drive)

    def system_with(self, markers: Array, drive: Array) -> System:
        """The system with other markers ``(3, 4, 2 P, B)``, of which ``drive (d, B)`` are the driver values."""
        P = len(self.system.m.pairs)
        return self.system.with_parameters(
            replace(self.system.par, marker_a=markers[:, :, :P], marker_b=markers[:, :, P:])
        )

    def drive_of(self, markers: Array, x: Array) -> Array:
        """The driver values ``(d, 1)`` of a member with such markers that stands at ``x (nx, 1)``."""
        return x[self.rows]

    @property
    def bases(self) -> list[Array]:
        """For every marker a basis of the motions by which members differ."""
        return [*self.moving, *self.moving]

    @property
    def moved_as(self) -> Index:
        """For every marker the first one that moves with it."""
        return np.arange(2 * len(self.system.m.pairs))

    def random_member(self, rng: np.random.Generator) -> Member:
        """A random complex member."""
        moves = np.zeros((6, len(self.bearers), 1), dtype=complex)
        for k, basis in enumerate(self.bases):
            parts = rng.normal(size=(basis.shape[1], 2)) @ [1.0, 0.7j]
            moves[:, k, 0] = 0.35 * (basis @ parts)
        moves = self.in_links(moves[:, self.moved_as])
        return Member(compose(pose_exp(moves), self.target), self.random_drive(rng)[:, None])

    def random_drive(self, rng: np.random.Generator) -> Array:
        """Random complex driver values ``(d,)``."""
        drive = rng.uniform(-np.pi, np.pi, len(self.columns)) + 0.5j * rng.normal(size=len(self.columns))
        drive[self.system.is_length[self.columns]] *= 0.3
        return np.asarray(drive)

    def lengths_of(self, drive: Array) -> Array:
        """Of numbers ``(d,)``, one a driver, those that are lengths of rods; zero elsewhere."""
        return np.zeros_like(drive)

    def in_links(self, moves: Array) -> Array:
        """Twists ``(6, 2 P, 1)`` given in the global frame at the closed position, in the frames of the links that bear the markers."""
        X = inverse(self.here.poses[:, :, self.bearers])
        return move_twist(X, moves)

    def open_by(self, here: Configuration, V: Array, change: Array) -> Array:
        """Rates ``(rows, T)`` at which markers that move with twists ``V (6, 2 P, T)``, and drivers, open the rows."""
        s, P = self.system, len(self.system.m.pairs)
        out = (here.J[:, self.columns] * change[: len(self.columns)]).sum(axis=1)
        out[: s.graph.loop_rows] += here.loop_sums(V[:, :P] - V[:, P:])
        return np.asarray(out)

    def random_members(self, rng: np.random.Generator, n: int) -> list[Member]:
        """Several of them."""
        return [self.random_member(rng) for _ in range(n)]

    def random_closed(self, rng: np.random.Generator) -> tuple[Member, Array] | None:
        """A random member with an assembly ``x (nx,)`` of it; None where random coordinates cannot be closed within the class."""
        member, s = self.random_member(rng), self.system
        dq = rng.uniform(-np.pi, np.pi, s.n_freedoms) + 0.4j * rng.normal(size=s.n_freedoms)
        dq[s.is_length] = rng.normal(size=(int(s.is_length.sum()), 2)) @ [0.5, 0.3j]
        dq[self.held] = 0.0
        x = s.advance(self.here.x, dq[:, None])
        markers, P = member.markers.copy(), len(s.m.pairs)
        chords, b = s.chords, s.b[s.chords]
        for _ in range(3):
            open_ = Configuration(self.system_with(markers, member.drive), x)
            T = open_.poses[:, :, b]
            moved = compose(pose_exp(open_.chord_errors), compose(T, markers[:, :, P + chords]))
            markers[:, :, P + chords] = compose(inverse(T), moved)
        found = Member(markers, self.drive_of(markers, x))
        closed = Configuration(self.system_of(found), x)
        if not closed.closure[0] < MODES.member_closed or not self.within(markers, P + chords):
            return None
        return found, x[:, 0]

    def within(self, markers: Array, at: Index) -> bool:
        """Whether markers of pairs, those with the numbers ``at``, lie in the class."""
        marker, target = markers[:, :, at], self.target[:, :, at]
        e = finite_twist(multiplied(marker[:, :3], target[:, :3].swapaxes(0, 1)), marker[:, 3], target[:, 3])
        e = move_twist(self.here.poses[:, :, self.bearers[at]], e)[:, :, 0]
        for i, k in enumerate((at % len(self.system.m.pairs)).tolist()):
            basis = self.algebras[k]
            if np.abs(e[:, i] - basis @ (basis.T @ e[:, i])).max() > 1e3 * MODES.member_closed * max(
                1.0, np.abs(e[:, i]).max()
            ):
                return False
        return True

    def mixing(self, rng: np.random.Generator) -> Array | None:
        """Random combinations ``(rank, rows)`` of the closure rows; None where all are independent."""
        if self.whole:
            return None
        n = self.system.n_rows
        Q = np.linalg.qr(rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)))[0]
        return np.asarray(Q[: self.rank])


def generated(S: Array) -> Array:
    """Orthonormal basis ``(6, k)`` of the Lie algebra generated by twists ``S (6, n)``."""
    basis = span(S)
    while True:
        k = basis.shape[1]
        brackets = cross_twist(np.repeat(basis, k, axis=1), np.tile(basis, (1, k)))
        larger = span(np.concatenate([basis, brackets], axis=1))
        if larger.shape[1] == k:
            return basis
        basis = larger


def at_rest(motions: Array, held: Index) -> Array:
    """Those of ``motions (F, p)`` in which freedoms ``held`` rest."""
    if not held.size:
        return motions
    _, sigma, Vt = np.linalg.svd(motions[held])
    return np.asarray(motions @ Vt[int((sigma > MODES.span).sum()) :].T)


def parts(sigma: Array) -> Array:
    """Singular values ``(..., n)`` of closure rows as parts of the largest, or of 1, the size of rows of turns: a lone rod has but one."""
    return np.asarray(sigma / np.maximum(sigma[..., :1], 1.0))


def span(S: Array) -> Array:
    """Orthonormal basis of the span of columns."""
    if not S.size:
        return np.zeros((6, 0))
    U, s, _ = np.linalg.svd(S, full_matrices=False)
    return np.asarray(U[:, s > MODES.span * max(1.0, s[0])])


def common(spaces: list[Array]) -> Array:
    """Orthonormal basis of what spans with orthonormal bases ``(6, k)`` share; of none: nothing."""
    if not spaces:
        return np.zeros((6, 0))
    outside, vectors = np.linalg.eigh(sum(np.eye(6) - B @ B.T for B in spaces))
    return np.asarray(vectors[:, outside < MODES.span])


class Labelling:
    """Links, pairs and rods of a class in canonical order."""

    def __init__(self, family: Family) -> None:
        self.family, self._system = family, family.system
        s = self._system
        self._P, self._n = len(s.m.pairs), len(family.bearers) // 2 - len(s.m.pairs)
        # links, pairs, rods, and points
        self._links = len(s.m.links)
        self._rods = self._links + self._P
        matrix, self._labels = ranked(self._graph())
        order = least_order(matrix)
        self._code = [matrix[u][v] for u in order for v in order]
        place = np.argsort(order)
        self.pairs: Index = np.argsort(place[self._links : self._rods])
        self.rods: Index = np.argsort(place[self._rods : self._rods + self._n])
        may = np.array([same_back(pair.type) for pair in s.m.pairs], dtype=bool)
        self._turned = may & (place[s.a] > place[s.b])
        ends = place[family.bearers[2 * self._P :]].reshape(2, self._n)
        points = place[self._points].reshape(2, self._n)
        self._rods_turned = np.where(ends[0] == ends[1], points[0] > points[1], ends[0] > ends[1])

    @cached_property
    def key(self) -> str:
        """What a start set serves for, without what its files are."""
        family = self.family
        parts = [self._code, [repr(label) for label in self._labels], family.rank, family.passive.shape[1]]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    # --- the graph ---------------------------------------------------------------------------------------------------

    @cached_property
    def _points(self) -> Index:
        """The node of the point at each end ``(2 n,)`` of the rods."""
        joints = self.family.points[2] if self._n else []
        return self._rods + self._n + np.unique(joints, return_inverse=True)[1].astype(np.intp).reshape(-1)

    @cached_property
    def _still(self) -> Array:
        """The markers where the class is told, in the frame in which they are kept, as far as it keeps them."""
        # decimals of markers, over L, that a class keeps
        return np.round(self._kept(self.family.target)[..., 0].real, 9) + 0.0

    def _kept(self, markers: Array) -> Array:
        """Markers as they are kept."""
        return compose(compose(self._gauge, markers), inverse(self._turns))

    @cached_property
    def _flat(self) -> bool:
        """Whether of the geometry only a plane is kept."""
        family = self.family
        every = all(algebra.shape[1] == 3 for algebra in family.algebras)
        return every and not self._n and not family.idle.shape[1] and family.plane is not None

    @cached_property
    def _gauge(self) -> Array:
        """Poses ``(3, 4, markers, 1)`` of the frames in which markers are kept: links' own, or the global one where relations are kept."""
        poses = self.family.here.poses[:, :, self.family.bearers, :1]
        if self.family.whole:
            return np.broadcast_to(np.eye(3, 4)[:, :, None, None], poses.shape)
        if not self._flat:
            return poses
        poses = compose(np.concatenate([self.family.plane, np.zeros((3, 1))], axis=1)[..., None, None], poses)
        poses[2, 3] -= np.tile(compose(poses, self.family.target)[2, 3, : self._P].real, (2, 1))
        return poses

    @cached_property
    def _turns(self) -> Array:
        """Turns ``(3, 4, markers, 1)`` after which markers are kept."""
        out = np.tile(np.eye(3, 4)[:, :, None, None], (1, 1, len(self.family.bearers), 1))
        out[:, :3, : 2 * self._P] = np.tile(self._sides[0], 2)[..., None]
        return out

    @cached_property
    def _sides(self) -> tuple[Array, Array]:
        """Of every pair the turn ``(3, 3, P)`` after which its markers are kept, and whether that turns its motions back ``(P,)``."""
        turns, back = np.tile(np.eye(3)[:, :, None], (1, 1, self._P)), np.zeros(self._P, dtype=bool)
        if not self._flat:
            return turns, back
        normals = compose(self._gauge, self.family.target)[2, :3, :, 0].real
        half = np.array([1.0, -1.0, -1.0])[:, None]
        for k, pair in enumerate(self._system.m.pairs):
            (x, y, z), S = normals[:, k], twists_of(pair.type)
            if np.hypot(x, y) > MODES.span and not cross_twist(np.eye(6)[:, [2]], S).any():
                turns[:2, :2, k] = np.array([[x, y], [-y, x]]) / np.hypot(x, y)
            if z < -MODES.span and (np.tile(half, (2, 1)) * S == -S).all():
                turns[:, :, k] *= half
                back[k] = True
        return turns, back

    def _geometry(self, marker: int) -> Hashable:
        """What a class keeps of a marker; of a point its place."""
        if self.family.whole:
            return ()
        if self._flat:
            return tuple(self._still[2, :3, marker].tolist())
        kept = self._still[:, :, marker] if marker < 2 * self._P else self._still[:, 3, marker]
        return tuple(kept.ravel().tolist())

    def _graph(self) -> list[list[Hashable]]:
        """What stands at nodes and between them."""
        family, s = self.family, self._system
        nodes = self._rods + self._n + len(set(self._points.tolist()))
        out: list[list[Hashable]] = [[()] * nodes for _ in range(nodes)]

        def join(u: int, v: int, *label: Hashable) -> None:
            out[u][v] = out[v][u] = tuple(sorted([*(out[u][v] or ()), label], key=repr))  # type: ignore[misc]

        # from where it is seen what tells assemblies apart that something idle leaves alone
        seen = s.graph.frame if family.idle.shape[1] else -1
        for i in range(self._links):
            out[i][i] = ("link", i == seen)
        for k, ends in enumerate(s.graph.ends):
            out[self._links + k][self._links + k] = ("pair", *self._pair(k))
            sides = ("end", "end") if same_back(s.m.pairs[k].type) else ("a", "b")
            for marker, side, link in zip((k, self._P + k), sides, ends, strict=True):
                join(self._links + k, link, side, self._geometry(marker))
        for i, (point, link) in enumerate(
            zip(self._points.tolist(), family.bearers[2 * self._P :].tolist(), strict=True)
        ):
            rod = self._rods + i % self._n
            out[rod][rod] = ("rod",)
            out[point][point] = ("point", self._geometry(2 * self._P + i))
            out[point][link] = out[link][point] = ("of",)
            join(rod, point, "end")
        return out

    def _pair(self, k: int) -> tuple[Hashable, ...]:
        """What is known of a pair: its motions, which of them are given or rest, and how its markers may be moved."""
        family, s = self.family, self._system
        columns = range(s.first_column[k], s.first_column[k + 1])
        freedoms = [
            (step.holds_rotation, *((f.label, *f.twist) for f in step.freedoms)) for step in s.m.pairs[k].type.steps
        ]
        B = family.algebras[k]
        # decimals that a class keeps of the motions by which markers may be moved
        algebra = () if family.whole or self._flat else (np.round(B @ B.T, 6) + 0.0).ravel().tolist()
        given, rest = ([c in of.tolist() for c in columns] for of in (family.columns, family.held))
        return (tuple(freedoms), tuple(given), tuple(rest), tuple(algebra))

    # --- start sets --------------------------------------------------------------------------------------------------

    @cached_property
    def _markers(self) -> Index:
        """For every marker in canonical order its number in the class."""
        both = [
            np.where(turned, [second, first], [first, second])[:, order]
            for turned, first, second, order in (
                (self._turned, np.arange(self._P), self._P + np.arange(self._P), self.pairs),
                (
                    self._rods_turned,
                    2 * self._P + np.arange(self._n),
                    2 * self._P + self._n + np.arange(self._n),
                    self.rods,
                ),
            )
        ]
        return np.concatenate([both[0].ravel(), both[1].ravel()])

    @cached_property
    def _rows(self) -> tuple[Index, Array]:
        """For every state row in canonical order its number in the class, and its sign there."""
        s = self._system
        sign = np.ones(s.n_state)
        for k in np.flatnonzero(self._turned != self._sides[1]).tolist():
            sign[s.first_row[k] : s.first_row[k + 1]] = -1.0
        if s.rotations is not None:
            sign[s.rotations[1][0]] = 1.0
        rows = [np.arange(s.first_row[k], s.first_row[k + 1]) for k in self.pairs.tolist()]
        order = np.concatenate([*rows, np.zeros(0, dtype=np.intp)]).astype(np.intp)
        return order, sign[order]

    def ordered(self, member: Member, x: Array) -> dict[str, Array]:
        """Markers, squares of lengths and states ``(nx, N)`` of a member in canonical order; values of drivers are in the states."""
        rows, sign = self._rows
        return {
            "markers": self._kept(member.markers)[:, :, self._markers],
            "squares": member.drive[len(member.drive) - self._n :][self.rods],
            "x": sign[:, None] * x[rows],
        }

    def taken(self, markers: Array, squares: Array, x: Array) -> tuple[Member, Array]:
        """A member and its states from those in canonical order."""
        rows, sign = self._rows
        own, out, drive = np.empty_like(markers), np.empty_like(x), np.empty_like(squares)
        own[:, :, self._markers] = markers
        own = compose(compose(inverse(self._gauge), own), self._turns)
        own[:, :3, 2 * self._P :] = np.eye(3)[:, :, None, None]
        out[rows] = sign[:, None] * x
        drive[self.rods] = squares
        return Member(own, np.concatenate([out[self.family.rows, :1], drive])), out


def twists_of(row: PairType) -> Array:
    """The twists ``(6, n)`` of a pair, one after the other."""
    return np.array([f.twist for f in row.freedoms]).reshape(-1, 6).T


def same_back(row: PairType) -> bool:
    """Whether a pair is the same with its links exchanged: turns and slides that commute, or a rotation and nothing else."""
    if len(row.steps) == 1 and row.steps[0].holds_rotation:
        return True
    S = twists_of(row)
    n = S.shape[1]
    return bool(np.abs(cross_twist(np.repeat(S, n, axis=1), np.tile(S, (1, n)))).max(initial=0.0) < MODES.span)


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
    # guesses closed together
    guesses_together = 200
    for i in range(0, starts, guesses_together):
        n = min(guesses_together, starts - i)
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
