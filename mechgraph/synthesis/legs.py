"""Tracks of a class of tasks: ways between members, and the equations along them, linearized.

A step of Newton's method eliminates row by row: with ``J_i dq_i + B_i dz = b_i`` and ``N_i`` the left null space of ``J_i``, at last

    (N_i B_i) dz = N_i b_i,    dq_i = J_i^+ (b_i - B_i dz).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any, TypeAlias, cast

import numpy as np

from mechgraph.maths.se3 import Index, cross, finite_twist, pose_exp
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.compiled_tracks import CompiledTracks, Led, LedRow, LegNumbers
from mechgraph.modes.family import Array
from mechgraph.modes.homotopy import Corrected, Ways, rounding, solved
from mechgraph.synthesis.rods import RodProblem
from mechgraph.synthesis.system import ArrowRows, RowNumbers, RowProblem
from mechgraph.synthesis.unknowns import UnknownPlace
from mechgraph.variants.numbers import MARKER

TaskClass: TypeAlias = Any
"""See ``synthesis.classes``, which stands on this module."""


@dataclass(frozen=True)
class ClassMember:
    """Mechanisms, their ``numbers`` of markers, and the values asked of them ``drive (R, d, n)``; what is not asked is ignored."""

    numbers: RowNumbers
    drive: Array

    def taken(self, which: Index) -> ClassMember:
        """Some of them; one serves for all."""
        return self if self.drive.shape[-1] == 1 else ClassMember(self.numbers.taken(which), self.drive[..., which])

    @staticmethod
    def joined(members: Sequence[ClassMember]) -> ClassMember:
        """Several, one after the other."""
        drive = np.concatenate([m.drive for m in members], axis=-1)
        return ClassMember(RowNumbers.joined([m.numbers for m in members]), drive)


@dataclass(frozen=True)
class RowBlock:
    """Rows ``rows (G,)`` of equal shape.

    Of their equations the combinations ``mixing (G, rank, n)`` are independent, of their coordinates ``ways (G, F, f)`` are free, and so
    many combinations are ``settled``: along passive motions, which the equations leave free, nothing moves.
    """

    rows: Index
    settled: int
    ways: Array
    mixing: Array | None


class TaskLeg(Ways):
    """Straight ways between members ``begin`` and ``end``, one or several; ``which (V,)`` says which of them a track follows."""

    def __init__(self, of: TaskClass, begin: ClassMember, end: ClassMember, which: Index | None = None) -> None:
        self.equations, self.begin, self.end, self._which = of, begin, end, which
        M0, M1 = begin.numbers.poses, end.numbers.poses
        R = np.einsum("ijspb,kjspb->ikspb", M1[:, :3], M0[:, :3])
        turned = np.einsum("ijspb,jspb->ispb", R, M0[:, 3])
        eta = finite_twist(R, M1[:, 3] - turned, np.zeros_like(turned))
        eta[:, of.turning.reshape(2, -1)] = 0.0
        # rounding of a pose that stands still
        self._eta = np.where(np.abs(eta).max(axis=(0, 3), keepdims=True) > MODES.slide, eta, 0.0)
        self._change = [
            np.where(of.turning.reshape(2, 1, -1, 1), b - a, 0.0)
            for a, b in zip(begin.numbers.vectors, end.numbers.vectors, strict=True)
        ]
        sought = {(p.array, *p.index) for own in of.problem.places for p in own}
        plain = {name: getattr(end.numbers, name) - getattr(begin.numbers, name) for name in ("pitch", "couplings")}
        self.plain = {
            UnknownPlace(name, 0, i, i if name == "pitch" else -1): change
            for name, changes in plain.items()
            for i, change in enumerate(changes)
            if change.any() and (name, i) not in sought
        }

    @cached_property
    def moving(self) -> tuple[Index, Index]:
        """Sides and pairs of the markers that move."""
        changes = np.any([(c != 0).any(axis=(1, 3)) for c in self._change], axis=0)
        side, pair = np.nonzero((self._eta != 0).any(axis=(0, 3)) | changes)
        return side, pair

    def prints(self, x: Array, t: Array, tracks: Index) -> Array:
        """What tells mechanisms apart."""
        return self.equations.told(x)

    def at(self, x: Array, t: Array, tracks: Index) -> Arrow:
        """The equations at states of tracks at ``t (T,)``."""
        return (Arrow if self.compiled is None else CompiledArrow)(self, t, tracks, x)

    @cached_property
    def compiled(self) -> CompiledTracks | None:
        """Tracks in the kernel, where it serves them: pitches and numbers of couplings are those of the task."""
        here, own = self.begin.numbers, self.equations.problem.numbers
        same = all(
            np.array_equal(a, np.broadcast_to(b, a.shape))
            for a, b in ((here.pitch, own.pitch), (here.couplings, own.couplings))
        )
        return self.equations.compiled if same and not self.plain else None

    def corrected(self, x: Array, t: Array, dt: Array, tracks: Index, idle: Array) -> Corrected:
        """See there."""
        if self.compiled is None:
            return super().corrected(x, t, dt, tracks, idle)
        x, _, v, (*sizes, size) = self.compiled.tracked(self.numbers, self.ways(tracks), t, x, rate=dt)
        return Corrected(x, v, sizes, noise_of(size, x[: self.equations.u]), idle)

    @cached_property
    def numbers(self) -> LegNumbers:
        """The ways as the kernel takes them."""
        begin, change = (
            np.stack(np.broadcast_arrays(*v)).swapaxes(1, 2) for v in (self.begin.numbers.vectors, self._change)
        )
        return LegNumbers(begin, self._eta, change, self.begin.drive, self.end.drive - self.begin.drive).joined

    def ways(self, tracks: Index) -> Index:
        """On which way each track is."""
        return np.zeros(len(tracks), dtype=np.intp) if self._which is None else self._which[tracks]

    def member(self, t: Array, tracks: Index) -> tuple[ClassMember, Array, Array, dict[UnknownPlace, Array]]:
        """Members on the way, with the rates of what is asked ``(R, d, T)``, of all vectors ``(3, 3, 2, P, T)``, and of other numbers."""
        if self._which is None:
            begin, last, eta, change = self.begin, self.end.drive, self._eta, [*self._change, *self.plain.values()]
        else:
            which, moved = self._which[tracks], (self.end.drive, self._eta, *self._change, *self.plain.values())
            begin, (last, eta, *change) = (
                self.begin.taken(which),
                (v[..., which] if v.shape[-1] > 1 else v for v in moved),
            )
        change, plain = change[:3], dict(zip(self.plain, change[3:], strict=True))
        X = pose_exp(t * eta)
        vectors = begin.numbers.moved(X).vectors
        w, (point, axis, second) = eta[:3], (v.swapaxes(0, 1) for v in vectors)
        rates = np.stack([cross(w, point) + eta[3:], cross(w, axis), cross(w, second)])
        rates = rates + np.stack([c.swapaxes(0, 1) for c in change])
        numbers = begin.numbers.with_vectors(*(v + t * c for v, c in zip(vectors, change, strict=True)))
        if plain:
            values = np.array([begin.numbers.at([p]) + t * c for p, c in plain.items()])
            numbers = numbers.with_values([[p] for p in plain], values)
        drive = last - begin.drive
        return ClassMember(numbers, begin.drive + t * drive), drive, rates, plain


class Arrow:
    """The equations linearized at a batch of states, row by row."""

    def __init__(self, leg: TaskLeg, t: Array, tracks: Index, x: Array) -> None:
        self.leg, self.of, self._t, self._tracks = leg, leg.equations, t, tracks
        self.rows = self.of.at(self._way[0], x)

    @cached_property
    def _way(self) -> tuple[ClassMember, Array, Array, dict[UnknownPlace, Array]]:
        return self.leg.member(self._t, self._tracks)

    @cached_property
    def x(self) -> Array:
        """The states."""
        return self.of.state(self.rows)

    def again(self, x: Array) -> Arrow:
        """The equations of the same members at other states."""
        out = copy(self)
        for name in ("x", "_factored"):
            vars(out).pop(name, None)
        out.rows = self.of.at(self._way[0], x)
        return out

    def idle(self) -> Array:
        """None: what equations leave free stays at rest in the least norm."""
        return np.zeros((self.rows.T, 0, 0))

    @property
    def noise(self) -> Array:
        """Rounding ``(T,)`` to be expected of a Newton step."""
        return noise_of(self._size, self.x[: self.of.u])

    @property
    def _size(self) -> Array:
        """The largest number ``(T,)`` in a pose of a link."""
        return np.asarray(np.abs(self.rows.here.poses).max(axis=(0, 1, 2)).reshape(-1, self.rows.T).max(axis=0))

    def _mixed(self, block: RowBlock, values: Array) -> Array:
        """``(R, n, k, T)`` as the combinations of every row of a block, ``(G, T, rank, k)``."""
        own = values[block.rows].transpose(0, 3, 1, 2)
        mixed = own if block.mixing is None else block.mixing[:, None] @ own
        return np.where(np.isfinite(mixed), mixed, 0.0)

    @cached_property
    def _factored(self) -> tuple[list[tuple[Array, Array, Array]], Array]:
        """``N_i``, ``J_i^+`` and ``B_i`` ``(G, T, ., .)`` of the rows of all blocks, and the matrix of the unknowns."""
        out, T = [], self.rows.T
        for block in self.of.blocks:
            J, B = (self._mixed(block, v) for v in (self.rows.by_coordinates, self.rows.by_unknowns))
            J, n = J @ block.ways[:, None], block.settled
            if n < J.shape[3]:
                # of passive motions, which a moving frame of the states turns, only the least norm is never led astray
                Q, sigma, V = np.linalg.svd(J)
                back = V[..., :n, :].conj().swapaxes(2, 3) / np.maximum(sigma[..., None, :n], 1e-300)
            else:
                Q, upper = np.linalg.qr(J, mode="complete")
                back = np.linalg.inv(
                    upper[:, :, :n] + np.where(np.eye(n, dtype=bool) & (upper[:, :, :n] == 0), 1e-300, 0.0)
                )
            back = block.ways[:, None] @ back @ Q[..., :n].conj().swapaxes(2, 3)
            out.append((Q[..., n:].conj().swapaxes(2, 3), back, B))
        return out, np.concatenate([_beneath(N @ B, T) for N, _, B in out], axis=1)

    @property
    def matrix(self) -> Array:
        """The matrix of the unknowns ``(T, u, u)``, all else eliminated."""
        return self._factored[1]

    def solve(self, right: Array, by: Callable[[Array, Array], Array] = solved) -> Array:
        """Increments ``(head + R F, T)`` for a right side ``(R, n, T)``; NaN where singular, unless ``by`` knows more."""
        of, (parts, S) = self.of, self._factored
        T, b = self.rows.T, [self._mixed(block, right[:, :, None]) for block in of.blocks]
        dz = by(S, np.concatenate([_beneath(N @ own, T) for (N, _, _), own in zip(parts, b, strict=True)], axis=1))
        dq = np.zeros((of.R, of.F, T), dtype=complex)
        for block, (_, back, B), own in zip(of.blocks, parts, b, strict=True):
            dq[block.rows] = (back @ (own - B @ dz))[..., 0].swapaxes(1, 2)
        return np.concatenate([dz[:, :, 0].T, np.zeros((of.W, T)), dq.reshape(of.R * of.F, T)])

    def newton(self, idle: Array) -> Array:
        """The Newton step."""
        return self.solve(-self.rows.residual)

    def rates(self, idle: Array) -> tuple[Array, Array]:
        """Rates of increments with ``t``."""
        of, columns = self.of, self.of.columns
        change = np.where(of.given[:, :, None], self._way[1] * of.problem.factors(self.rows.numbers), 0.0)
        J = self.rows.by_coordinates
        opened = np.einsum("rndt,rdt->rnt", J[:, :, columns], np.broadcast_to(change, (*change.shape[:2], self.rows.T)))
        side, pair = self.leg.moving
        if len(side):
            opened = opened + self.rows.moved(side, pair, self._known_rates()).sum(axis=2)
        for place, rate in self._way[3].items():
            opened = opened + self.rows.by_number(place) * rate
        out = self.solve(-opened)
        whole, factor_of = out[of.head :].reshape(of.R, of.F, -1), of.problem.factor_of
        if (scaled := factor_of >= 0).any() and self.rows.drive is not None:
            first = of.u - 1 - factor_of.max()
            change[:, scaled] += self.rows.drive[:, scaled] * out[first + factor_of[scaled]]
        for i, given in enumerate(of.given):
            whole[i][columns[given]] = change[i, given]
        return out, idle

    def _known_rates(self) -> Array:
        """Rates ``(3, 3, n, T)`` of points, axes and second directions of markers that move, as far as they are known."""
        out = self._way[2].copy()
        for places in self.of.problem.places:
            for p in (p for p in places if p.array in MARKER):
                out[MARKER.index(p.array), p.component, p.side, p.pair] = 0.0
        side, pair = self.leg.moving
        return out[:, :, side, pair]


def noise_of(size: Array, z: Array) -> Array:
    """Rounding ``(T,)`` to be expected of a Newton step where the largest numbers in poses are of a ``size``, for unknowns ``z (u, T)``."""
    lengths = np.maximum(size, np.abs(z).max(axis=0, initial=1.0))
    # of rows in squares of lengths; seen at tracks on which these are thousands
    return 6.0 * rounding(np.cbrt(size * lengths**2))


def compiled_tracks(of: TaskClass) -> CompiledTracks | None:
    """Tracks of a class in the kernel, where that is there and serves it."""
    p, s, places = of.problem, of.problem.system, marker_places(of.problem)
    if places is None:
        return None
    rods, ways = (p.rods, cast("Any", s).ways) if isinstance(p, RodProblem) else ([], np.zeros(0))
    height = s.graph.loop_rows + len(p.whole.couplings) + len(rods)
    rows = list[LedRow]()
    for i in range(of.R):
        block, at = next((b, int(np.flatnonzero(b.rows == i)[0])) for b in of.blocks if i in b.rows)
        mixing = None if block.mixing is None else block.mixing[at]
        rows.append(LedRow(height if mixing is None else len(mixing), block.settled, of.free[i], mixing))
    led = Led(
        s, p.at_rest, of.nx, of.columns, of.given, rows, len(p.order), [[*near, *far] for near, far in rods], ways,
        np.full(len(rods), -1), of.u, of.head, places,
        np.where(p.factor_of < 0, -1, of.u - 1 - p.factor_of.max(initial=0) + p.factor_of),
    )  # fmt: skip
    return CompiledTracks(led) if led.served else None


def marker_places(p: RowProblem) -> list[tuple[int, ...]] | None:
    """Places of the unknowns at markers as the kernel takes them; None where other numbers are sought, or rates."""
    every = [(k, q) for k, own in enumerate(p.places) for q in own if q.array != "factors"]
    if p.rates or not all(q.array in MARKER for _, q in every):
        return None
    return [(k, MARKER.index(q.array), q.component, q.side, q.pair) for k, q in every]


class CompiledArrow(Arrow):
    """The same from the kernel; rows are made where more is asked for."""

    def __init__(self, leg: TaskLeg, t: Array, tracks: Index, x: Array) -> None:
        assert leg.compiled is not None
        self.leg, self.of, self._t, self._tracks = leg, leg.equations, t, tracks
        self.x, self._step, self._led_on, sizes = leg.compiled.tracked(leg.numbers, leg.ways(tracks), t, x)
        self._largest = sizes[2]

    @cached_property
    def rows(self) -> ArrowRows:
        """The equations."""
        return self.of.at(self._way[0], self.x)

    def again(self, x: Array) -> Arrow:
        """See there."""
        return CompiledArrow(self.leg, self._t, self._tracks, x)

    @property
    def _size(self) -> Array:
        return self._largest

    def newton(self, idle: Array) -> Array:
        """See there."""
        return self._step

    def rates(self, idle: Array) -> tuple[Array, Array]:
        """See there."""
        return self._led_on, idle


def _beneath(values: Array, T: int) -> Array:
    """``(G, T, n, k)`` of rows, one beneath the other ``(T, G n, k)``."""
    return values.swapaxes(0, 1).reshape(T, -1, values.shape[3])
