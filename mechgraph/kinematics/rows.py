"""The rows of the closure equations: every constraint contributes its own, a loop six (in the plane three), a coupling one.

A new kind of constraint is a class of ``Rows``; nothing else in the package knows how many rows there are or where they come from: they
stand at the places that each contributor names, the loops first.

Couplings whose force acts along a line between two links are evaluated from the poses of both (see ``model.lines``).

With the line at the point P along n, ``G = (P x n, n)``, a row is ``phi - constant``, its rate and acceleration

    phi' = G . (V_b - V_a) = J q',   J_j = s_j G . S_j,   phi'' = J q'' + G . sum s_j bias_j + G' . (V_b - V_a)

over the freedoms j on the way from link a to link b, ``bias_j`` the velocity parts of the relative accelerations of its pairs. G' is the
derivative of the line along the motion of both poses, by a complex step.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.maths.linear import Place
from mechgraph.maths.se3 import Array, Index, cross, rotate
from mechgraph.maths.tolerances import COMPLEX_STEP
from mechgraph.model.gears import LineCoupling, LinePlaces, LinesAt, Relation
from mechgraph.quantities import LENGTH, unit_of


class Evaluated(Protocol):
    """What rows need of a configuration of ``T`` positions."""

    x: Array
    T: int

    @property
    def S(self) -> Array:
        """Twists of all freedoms ``(6, F, T)``."""

    @property
    def poses(self) -> Array:
        """Poses of all links ``(3, 4, N, T)``."""

    @property
    def chord_gaps(self) -> Array:
        """Closure errors of the chords at their pair points, ``(6, chords, T)``."""

    @property
    def loop_errors(self) -> Array:
        """Closure errors of the loops about their middles, stacked ``(loop rows, T)``."""

    @property
    def loop_jacobian(self) -> Array:
        """Twists of the freedoms in the rows of every loop, about its middle, ``(loop rows, F, T)``."""

    def pair_sums(self, terms: Array) -> Array:
        """``(6, F, T)`` -> ``(6, P, T)``."""

    def loop_sums(self, per_pair: Array) -> Array:
        """``(6, P, T)`` -> ``(loop rows, T)``."""


class Rows:
    """``n`` closure rows ``phi(q) = 0`` of one contributor at ``places`` among all rows, at a configuration of ``T`` positions.

    Rows for positions alone have ``scale``, ``residual`` and ``jacobian``.
    """

    places: Place
    scale: Array
    """Factors ``(n, 1)`` or one a position by which each row was multiplied, from the user's relation in the user's units."""

    def residual(self, here: Evaluated) -> Array:
        """``phi (n, T)``."""
        raise NotImplementedError

    def error(self, here: Evaluated) -> Array:
        """The closure error ``(T,)``: the largest angle, length over L, or scaled residual."""
        return np.asarray(np.abs(self.residual(here)).max(axis=0, initial=0.0))

    def jacobian(self, here: Evaluated) -> Array:
        """``J (n, F, T)`` with ``d phi/dt = J q'``."""
        raise NotImplementedError

    def sparse_jacobian(self, here: Evaluated, t: int) -> scipy.sparse.csr_array | None:
        """``J (n, F)`` at one position, entries at the same places at all of them; None for loops (see ``kinematics.state``)."""
        raise NotImplementedError

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``J q' (n, T)`` for rates ``dq (F, T)``."""
        return np.asarray((self.jacobian(here) * dq).sum(axis=1))

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """Velocity part ``(n, T)`` of ``d^2 phi/dt^2 = J q'' + bias``, from that of the relative accelerations of ``pairs (6, P, T)`` and
        the twists ``V (6, N, T)`` of all links.
        """
        raise NotImplementedError

    def efforts(self, here: Evaluated, x: Array) -> Array | None:
        """``J^T x (F, k, T)`` for multipliers ``x (n, k, T)``; None where the rows act through pair wrenches, as loops do."""
        return np.asarray(np.einsum("rft,rkt->fkt", self.jacobian(here), x))


def in_places(rows: Iterable[Rows], values: Sequence[Array]) -> Array:
    """Values ``(n, ...)`` of several contributors, at the places of their rows."""
    if len(values) == 1:
        return values[0]
    shape = np.broadcast_shapes(*(own.shape[1:] for own in values))
    out = np.empty((sum(map(len, values)), *shape), dtype=np.result_type(*values))
    for part, own in zip(rows, values, strict=True):
        out[part.places] = own
    return out


class LoopRows(Rows):
    """Six rows a loop: the finite twist by which the loop is open, about its middle (the mean of its pair points), which moves with it.

    ``J`` and ``bias`` are the derivatives where the loops are closed and rates meet the rows, as the middle moves otherwise.
    """

    def __init__(self, n_loops: int, count: int) -> None:
        self.n_loops, self.places, self.scale = n_loops, slice(0, count), np.ones((count, 1))

    def residual(self, here: Evaluated) -> Array:
        """Closure errors of the loops."""
        return here.loop_errors

    def error(self, here: Evaluated) -> Array:
        """Largest of angle and length / L over all chords."""
        if not self.n_loops:
            return np.zeros(here.T)
        gaps = here.chord_gaps
        angle, length = (np.sqrt(np.abs(part * part).sum(axis=0)).max(axis=0) for part in (gaps[:3], gaps[3:]))
        return np.maximum(angle, length)

    def jacobian(self, here: Evaluated) -> Array:
        """``(C x I6) diag(S_k)``."""
        return here.loop_jacobian

    def sparse_jacobian(self, here: Evaluated, t: int) -> None:
        """None: ``kinematics.state`` makes it."""

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_k C_lk S_k q'_k``."""
        return here.loop_sums(here.pair_sums(here.S * dq))

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """The velocity parts of the relative accelerations, summed along the loops."""
        return here.loop_sums(pairs)

    def efforts(self, here: Evaluated, x: Array) -> None:
        """None: loops act through pair wrenches, ``Configuration.pair_wrenches``."""


class CouplingRows(Rows):
    """One row a coupling: a linear relation ``sum_j c_j q_j = constant`` between single freedoms.

    ``coefficients (K, B)`` of all terms stand in ``rows (K,)``, one after the other, and ``columns (K,)`` of the matrix; with ``constant
    (n, B)`` they are in internal coordinates (lengths over L), every row scaled so that its largest coefficient is one. B is 1, or one a
    position. Coordinates are those of the state (rows ``state_rows (F,)``): turns count on, they are not wrapped.
    """

    def __init__(
        self,
        places: Place,
        coefficients: Array,
        rows: Index,
        columns: Index,
        constant: Array,
        scale: Array,
        state_rows: Index,
    ) -> None:
        self.places, self.coefficients, self.constant, self.scale = places, coefficients, constant, scale
        self.term_rows, self.term_columns, self._state_rows = rows, columns, state_rows
        self._first = np.searchsorted(rows, np.arange(len(constant)))

    @cached_property
    def matrix(self) -> Array:
        """The coefficients ``(n, F, B)``."""
        shape = len(self.constant), len(self._state_rows), self.coefficients.shape[1]
        out = np.zeros(shape, dtype=self.coefficients.dtype)
        out[self.term_rows, self.term_columns] = self.coefficients
        return out

    def _sums(self, values: Array) -> Array:
        """``sum_j c_j v_j (n, T)`` of values ``(K, T)``, one a term."""
        return np.asarray(np.add.reduceat(self.coefficients * values, self._first, axis=0))

    def residual(self, here: Evaluated) -> Array:
        """``sum_j c_j q_j - constant``."""
        return self._sums(here.x[self._state_rows[self.term_columns]]) - self.constant

    def jacobian(self, here: Evaluated) -> Array:
        """The coefficients."""
        return np.broadcast_to(self.matrix, (*self.matrix.shape[:2], here.T))

    def sparse_jacobian(self, here: Evaluated, t: int) -> scipy.sparse.csr_array:
        """The coefficients ``(n, F)`` at one position, entries at the same places at all of them."""
        values = self.coefficients[:, t if self.coefficients.shape[1] > 1 else 0]
        return scipy.sparse.csr_array((values, (self.term_rows, self.term_columns)), shape=self.matrix.shape[:2])

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_j c_j q'_j``."""
        return self._sums(dq[self.term_columns])

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """Zero: the relation is linear."""
        return np.zeros((len(self.constant), here.T), dtype=pairs.dtype)


class LineRows(Rows):
    """Rows of the line couplings at some places among the couplings of a system; lengths over L, so that rows are forces over ``1 / L``."""

    def __init__(self, system: Any, which: Index) -> None:
        m, self.system, self.which = system.m, system, which
        self.places, self.scale = system.graph.loop_rows + which, np.full((len(which), 1), 1.0 / system.par.L)
        self.couplings: list[LineCoupling] = [m.couplings[g] for g in which]
        self.links = np.array([[m.place_of_link(end.link) for end in c.ends] for c in self.couplings], dtype=np.intp).T
        steps = [(i, step) for i, c in enumerate(self.couplings) for step in c.steps]
        self._pairs = tuple(
            np.array(part) for part in zip(*((i, step.pair, step.sense) for i, step in steps), strict=True)
        )
        first = system.first_column
        terms = [(i, k, step.sense) for i, step in steps for k in range(first[step.pair], first[step.pair + 1])]
        self._on_ways = len(terms)
        terms += [(i, self._column(c.play), -1.0) for i, c in enumerate(self.couplings) if c.play]
        rows, columns, senses = (np.array(part) for part in zip(*terms, strict=True))
        self._last: tuple[Array, bool, LinesAt] | None = None
        self._start_poses: Array | None = None
        self._at_start: tuple[Array, Array] | None = None
        self._terms = rows.astype(np.intp), columns.astype(np.intp), senses.astype(float)

    @cached_property
    def _groups(self) -> list[tuple[Relation, Relation, Index, Array]]:
        """The relations of both flanks, the rows that have them, and their numbers ``(k, n, B)`` over L."""
        found: dict[tuple[Relation, Relation], list[int]] = {}
        for i, c in enumerate(self.couplings):
            found.setdefault((c.relation, c.other or c.relation), []).append(i)
        numbers = [np.array([[c.numbers for c in own] for own in self._items[rows]]) for rows in found.values()]
        return [
            (*both, np.array(rows), own.transpose(2, 0, 1) / self.system.par.L)
            for (both, rows), own in zip(found.items(), numbers, strict=True)
        ]

    @cached_property
    def _local(self) -> list[tuple[Array, Array, Array]]:
        """Points from the origins of the internal link frames over L, axes and marks there ``(3, n, B)``, on links a and on links b."""
        par, out = self.system.par, []
        for side in (0, 1):
            places = np.array([[c.ends[side][1:] for c in own] for own in self._items])
            point, axis, mark = places.transpose(2, 3, 0, 1)
            out.append(((point - par.offset[:, self.links[side], None]) / par.L, axis, mark))
        return out

    @property
    def _items(self) -> Any:
        """The couplings of every variant ``(n, B)``, of which gears have numbers of their own."""
        return self.system.par.items[self.which]

    def _places(self, poses: Array, side: int, rows: Index) -> LinePlaces:
        """The places on links a (side 0) or b of some rows, where all links have the poses ``(3, 4, N, T)``."""
        X = poses[:, :, self.links[side, rows]]
        local, axis, mark = (part[:, rows] for part in self._local[side])
        R = X[:, :3]
        return LinePlaces(rotate(R, local) + X[:, 3], rotate(R, axis), rotate(R, mark))

    def lines(self, poses: Array, other: bool = False) -> LinesAt:
        """Values and lines of all rows, or of their other flanks, where all links have the poses ``(3, 4, N, T)``."""
        if self._last is not None and self._last[0] is poses and self._last[1] is other:
            return self._last[2]
        n, T = len(self.couplings), poses.shape[-1]
        value, point, along = (np.zeros((*shape, T), dtype=poses.dtype) for shape in ((n,), (3, n), (3, n)))
        for relation, behind, rows, numbers in self._groups:
            made = (behind if other else relation)(self._places(poses, 0, rows), self._places(poses, 1, rows), numbers)
            value[rows], point[:, rows], along[:, rows] = made
        found = LinesAt(value, point, along)
        self._last = poses, other, found  # the same poses are asked for several times
        return found

    def wrenches(self, poses: Array, other: bool = False) -> Array:
        """Unit forces on b along the lines, ``(6, n, T)`` about the internal origin."""
        at = self.lines(poses, other)
        out = np.concatenate([cross(at.point, at.along), at.along])
        if self.system.m.planar:  # of gears with a helix the axial force leaves the plane
            out[np.delete(np.arange(6), self.system.graph.span)] = 0.0
        return out

    def screws(self, poses: Array) -> tuple[Array, Array]:
        """Screws ``(6, T)`` in which both gears of the first row turn against their carrier; a rack slides."""
        found = []
        for side, turns in enumerate(self.couplings[0].turning):
            place = self._places(poses, side, np.array([0]))
            z = place.axis[:, 0]
            found.append(
                np.concatenate([z, cross(place.point[:, 0], z)]) if turns else np.concatenate([np.zeros_like(z), z])
            )
        return found[0], found[1]

    def _closed(self, like: type) -> tuple[Array, Array]:
        """Values ``(n, B)`` of closed rows, and the start state ``(nx, B)``; ``like`` is the class of configurations."""
        if self._at_start is None:
            s = self.system
            x = np.repeat(s.state_of(s.start_coordinates(s.m.start)[:, None]), s.par.batch, axis=1)
            at_start = like(s, x)
            self._at_start, self._start_poses = (self._values_at(at_start), x), at_start.poses
        return self._at_start

    def _values_at(self, here: Any) -> Array:
        longer = np.array([[c.longer] for c in self.couplings]) / self.system.par.L
        return self.lines(here.poses).value + longer

    def residual(self, here: Any) -> Array:
        """``phi - constant``, turns counted by the freedoms that turn."""
        (closed, x0), at = self._closed(type(here)), self.lines(here.poses)
        rows, out = np.arange(len(self.couplings)), at.value - closed
        ends = [self._places(here.poses, side, rows) for side in (0, 1)]

        def turned(name: str) -> Array:
            return self._gained(here.x, x0, name)

        for i, c in enumerate(self.couplings):
            own = [LinePlaces(*(part[:, i : i + 1] for part in end)) for end in ends]
            more = c.whole_turns(at.along[:, i : i + 1], own[0], own[1], turned)
            period = c.period / self.system.par.L
            if c.play:
                out[i] -= turned(c.play)
            if more is not None:
                out[i] += more / self.system.par.L
            elif np.isfinite(period):
                out[i] -= period * np.round(out[i].real / period)
        return out

    def _gained(self, x: Array, x0: Array, name: str) -> Array:
        """By how much a freedom has grown since the start, ``(T,)``."""
        row = self.system.single_rows[self._column(name)]
        return np.asarray((x[row] - x0[row]).real)

    def _column(self, name: str) -> int:
        """The column of a freedom."""
        pair, number = self.system.m.freedom(name)
        return int(self.system.first_column[pair]) + number

    def strayed(self, here: Any, tolerance: float) -> str | None:
        """Which shafts leave the places that a relation is about, by more than a tolerance (radians, lengths over L); None for none."""
        self._closed(type(here))
        assert self._start_poses is not None
        rows = np.arange(len(self.couplings))
        now, then = ([self._places(X, side, rows) for side in (0, 1)] for X in (here.poses, self._start_poses))
        L, unit = float(self.system.par.L), unit_of(self.system.m.units, LENGTH)
        for i, c in enumerate(self.couplings):
            own = [LinePlaces(*(part[:, i : i + 1] for part in end)) for end in (*now, *then)]
            leans, off = (float(part.max(initial=0.0)) for part in c.strayed(*own))
            if max(leans, off) > tolerance:
                moved = [np.abs(np.subtract(p[:2], p0[:2])).max() for p, p0 in zip(own[:2], own[2:], strict=True)]
                names = " or ".join(
                    repr(end.link) for end, by in zip(c.ends, moved, strict=True) if 2.0 * by > tolerance
                )
                size = (
                    f"{np.rad2deg(np.arcsin(min(leans, 1.0))):.3g} degrees" if leans > off else f"{off * L:.3g} {unit}"
                )
                why = f"the axis on {names} moves against the other one, by up to {size.rstrip()}; it needs {c.keeps}"
                return f"coupling {c.name!r}: {why}"
        return None

    def _entries(self, here: Any, other: bool = False) -> Array:
        """``s_j G . S_j`` for every freedom on the ways, -1 for those by which flanks part, ``(K, T)``."""
        rows, columns, senses = self._terms
        G = self.wrenches(here.poses, other)
        powers = (G[:, rows] * here.S[:, columns]).sum(axis=0)
        powers[self._on_ways :] = 1.0
        return np.asarray(senses[:, None] * powers)

    def jacobian(self, here: Any, other: bool = False) -> Array:
        """``J (n, F, T)``."""
        rows, columns, _ = self._terms
        values = self._entries(here, other)
        out = np.zeros((len(self.couplings), self.system.n_freedoms, here.T), dtype=values.dtype)
        out[rows, columns] = values
        return out

    def sparse_jacobian(self, here: Any, t: int) -> scipy.sparse.csr_array:
        """``J (n, F)`` at one position."""
        rows, columns, _ = self._terms
        shape = len(self.couplings), self.system.n_freedoms
        one = here if here.T == 1 else here.part(np.array([t]))
        return scipy.sparse.csr_array((self._entries(one)[:, 0], (rows, columns)), shape=shape)

    def rates(self, here: Any, dq: Array) -> Array:
        """``J q'``."""
        rows, columns, _ = self._terms
        return _summed(rows, self._entries(here) * dq[columns], len(self.couplings))

    def bias(self, here: Any, pairs: Array, V: Array) -> Array:
        """``G . sum s_j bias_j + G' . (V_b - V_a)``."""
        rows, pair, sense = self._pairs
        X, G = here.poses, self.wrenches(here.poses)
        change = np.stack([cross(V[:3], X[:, k]) for k in range(4)], axis=1)
        change[:, 3] += V[3:]
        dG = self.wrenches(X + 1j * COMPLEX_STEP * change).imag / COMPLEX_STEP
        a, b = self.links
        own = sense[:, None] * (G[:, rows] * pairs[:, pair]).sum(axis=0)
        return _summed(rows, own, len(self.couplings)) + (dG * (V[:, b] - V[:, a])).sum(axis=0)


def _summed(rows: Index, values: Array, count: int) -> Array:
    """Sums ``(count, T)`` of values ``(K, T)`` by rows."""
    out = np.zeros((count, values.shape[1]), dtype=values.dtype)
    np.add.at(out, rows, values)
    return out
