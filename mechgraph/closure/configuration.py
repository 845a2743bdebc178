"""A mechanism made ready for evaluation: index arrays from the graph, numbers from the parameters, one batched kernel.

Everything here is internal: lengths over L, positions about the internal origin (see ``model.parameters``), component axes
first and positions last. ``S`` are the twists of all freedoms about the internal origin, one column a freedom.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.screw import cross_twist
from mechgraph.algebra.se3 import Array, compose, cross, inverse, pose_log
from mechgraph.closure.tree import Tree
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair_frames import (
    Factor,
    Frame,
    displaced,
    factor_values,
    factors_between,
    frames_along,
    moved_marker,
)
from mechgraph.model.pair_type import PairType
from mechgraph.model.parameters import Parameters, parameters
from mechgraph.numerics.linear import Place, compact
from mechgraph.topology.linkgraph import LinkGraph, link_graph

Index = NDArray[np.intp]

MANY_LOOPS = 16
"""Loops above which the loop matrix is applied as a sparse one (measured: from here on it is the faster one)."""


@dataclass(frozen=True)
class Group:
    """The pairs of one type: their indices, the columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``."""

    row: PairType
    pairs: Index
    columns: Index
    state_rows: Index

    @cached_property
    def at_pairs(self) -> Place:
        """The pairs, as a slice where that can be."""
        return compact(self.pairs)

    @cached_property
    def at_columns(self) -> list[Place]:
        """The columns of every freedom, as slices where that can be."""
        return [compact(columns) for columns in self.columns]


class System:
    """A mechanism with geometry, indexed for the kernels."""

    def __init__(self, m: Mechanism, graph: LinkGraph | None = None, par: Parameters | None = None) -> None:
        self.m = m
        self.graph = graph or m.once(link_graph)
        self.par = par or m.once(parameters)
        self.first_column = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
        self.first_row = np.concatenate([[0], np.cumsum([p.type.nx for p in m.pairs])]).astype(np.intp)
        self.n_freedoms, self.n_state = int(self.first_column[-1]), int(self.first_row[-1])
        self.a = np.array([a for a, _ in self.graph.ends], dtype=np.intp)
        self.b = np.array([b for _, b in self.graph.ends], dtype=np.intp)
        self.chords = np.array(self.graph.chords, dtype=np.intp)
        self.groups = self._group_pairs()
        self.tree = Tree(self.graph)
        self.marker_b_inverse = inverse(self.par.marker_b)
        self.is_length = np.zeros(self.n_freedoms, dtype=bool)
        for g in self.groups:
            self.is_length[g.columns] = np.array([not f.turns for f in g.row.freedoms], dtype=bool)[:, None]

    @cached_property
    def factors(self) -> list[list[Factor]]:
        """For every group the factors of its relative poses between the link frames."""
        par = self.par
        return [
            factors_between(
                g.row, par.pitch[g.pairs], par.marker_a[:, :, g.pairs], self.marker_b_inverse[:, :, g.pairs]
            )
            for g in self.groups
        ]

    def weld(self, g: Group) -> Array:
        """Constant relative poses of pairs without freedom, ``(3, 4, n, 1)``."""
        return compose(self.par.marker_a[:, :, g.pairs], self.marker_b_inverse[:, :, g.pairs])

    @cached_property
    def owners(self) -> Place:
        """For every freedom its pair."""
        return compact(np.repeat(np.arange(len(self.m.pairs)), np.diff(self.first_column)))

    @cached_property
    def carriers(self) -> list[Place]:
        """For every group the links a of its pairs."""
        return [compact(self.a[g.pairs]) for g in self.groups]

    @cached_property
    def chord_ends(self) -> tuple[Place, Place]:
        """Links a and b of the chords."""
        return compact(self.a[self.chords]), compact(self.b[self.chords])

    def with_parameters(self, par: Parameters) -> System:
        """The same graph with other numbers."""
        out = copy(self)
        out.__dict__.pop("factors", None)
        out.par, out.marker_b_inverse = par, inverse(par.marker_b)
        rows = [self.m.pairs[int(g.pairs[0])].type.scaled(par.L) for g in self.groups]
        out.groups = [replace(g, row=row) for g, row in zip(self.groups, rows, strict=True)]
        return out

    @cached_property
    def loop_columns(self) -> list[tuple[Index, Array]]:
        """Columns of the freedoms along every loop, and their signs."""
        return [self._columns_of_loop(loop) for loop in self.graph.loops]

    def _group_pairs(self) -> list[Group]:
        same: dict[int, list[int]] = {}
        for k, pair in enumerate(self.m.pairs):
            same.setdefault(id(pair.type), []).append(k)
        by_type: dict[PairType, list[int]] = {}
        for pairs in same.values():
            by_type.setdefault(self.m.pairs[pairs[0]].type, []).extend(pairs)
        groups = []
        for row, pairs in by_type.items():
            index = np.array(sorted(pairs), dtype=np.intp)
            columns = self.first_column[index] + np.arange(row.f, dtype=np.intp)[:, None]
            state = self.first_row[index] + np.arange(row.nx, dtype=np.intp)[:, None]
            groups.append(Group(row.scaled(self.par.L), index, columns, state))
        return groups

    @cached_property
    def _group_of(self) -> Index:
        out = np.empty(len(self.m.pairs), dtype=np.intp)
        for number, g in enumerate(self.groups):
            out[g.pairs] = number
        return out

    def place_of(self, pair: int) -> tuple[int, int]:
        """Number of the group of a pair, and its place there."""
        number = int(self._group_of[pair])
        return number, int(np.searchsorted(self.groups[number].pairs, pair))

    def _columns_of_loop(self, loop: tuple[tuple[int, int], ...]) -> tuple[Index, Array]:
        columns = [np.arange(self.first_column[k], self.first_column[k + 1]) for k, _ in loop]
        signs = [np.full(len(c), float(sign)) for c, (_, sign) in zip(columns, loop, strict=True)]
        return np.concatenate(columns), np.concatenate(signs)

    @property
    def many_loops(self) -> bool:
        """Whether sums along loops are taken with the sparse loop matrix."""
        return len(self.graph.loops) > MANY_LOOPS

    @cached_property
    def loop_pieces(self) -> list[list[tuple[slice, Array]]]:
        """For every loop the runs of its columns without a gap, with their signs ``(n, 1)``."""
        out = []
        for columns, signs in self.loop_columns:
            order = np.argsort(columns)
            breaks = np.flatnonzero(np.diff(columns[order]) != 1) + 1
            runs = zip(np.split(columns[order], breaks), np.split(signs[order], breaks), strict=True)
            out.append([(slice(int(c[0]), int(c[-1]) + 1), sign[:, None]) for c, sign in runs if len(c)])
        return out

    @cached_property
    def loops_of_chords(self) -> Array:
        """Which chord closures make up a loop, ``(loops, chords)`` with signs."""
        return self.graph.loop_matrix[:, self.chords]

    # --- state numbers -----------------------------------------------------------------------------------------------

    def state_of(self, coordinates: Array) -> Array:
        """State ``(nx, T)`` from user coordinates ``(F, T)`` (lengths in the user's units)."""
        q = np.where(self.is_length[:, None], coordinates / self.par.L, coordinates)
        x = np.empty((self.n_state, q.shape[1]))
        for g in self.groups:
            x[g.state_rows] = evaluation.coordinates_to_state(g.row, q[g.columns])
        return x

    def coordinates_of(self, x: Array, start: Array | None = None) -> Array:
        """User coordinates ``(F, ..., T)`` of states ``(nx, ..., T)``; rotation vectors continued along the last axis."""
        q = np.empty((self.n_freedoms, *x.shape[1:]))
        for g in self.groups:
            near = None if start is None else start[g.columns]
            q[g.columns] = evaluation.state_to_coordinates(g.row, x[g.state_rows], near)
        q[self.is_length] *= self.par.L
        return q

    def start_coordinates(self, start: Mapping[str, float]) -> Array:
        """User coordinates ``(F,)`` from a mapping freedom -> value, zero elsewhere."""
        q = np.zeros(self.n_freedoms)
        for name, value in start.items():
            k, j = self.m.freedom(name)
            q[self.first_column[k] + j] = value
        return q

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments ``dq (F, ...)``."""
        out = np.empty((self.n_state, *np.broadcast_shapes(x.shape[1:], dq.shape[1:])))
        for g in self.groups:
            out[g.state_rows] = evaluation.advance(g.row, x[g.state_rows], dq[g.columns])
        return out

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments ``(F, ...)`` from ``x0`` to ``x1``."""
        out = np.empty((self.n_freedoms, *np.broadcast_shapes(x1.shape[1:], x0.shape[1:])))
        for g in self.groups:
            out[g.columns] = evaluation.difference(g.row, x1[g.state_rows], x0[g.state_rows])
        return out

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments ``dq (F, ...)`` at the state that they lead to, from the rates of the freedoms there."""
        out = np.empty_like(rates)
        for g in self.groups:
            out[g.columns] = evaluation.tangent(g.row, dq[g.columns], rates[g.columns])
        return out

    def at(self, x: Array) -> Configuration:
        """Evaluate states ``(nx, T)``."""
        return Configuration(self, x)


def _indices(m: Mechanism) -> dict[str, Any]:
    """What a system knows of links, pairs and frame alone."""
    made = System(m)
    return {"factors": made.factors, **{name: value for name, value in vars(made).items() if name != "m"}}


def indexed(m: Mechanism) -> System:
    """The system of a mechanism with its declared numbers; what follows from links, pairs and frame is worked out once."""
    out = System.__new__(System)
    vars(out).update(m.once(_indices), m=m)
    return out


class Configuration:
    """Poses, twists of freedoms and closure of a batch of states; parts are computed when first asked for."""

    def __init__(self, system: System, x: Array) -> None:
        self.system = system
        self.x = x
        self.T = x.shape[1]

    @cached_property
    def _values(self) -> list[list[list[Array]]]:
        """For every group the values of the factors of its displacements."""
        s = self.system
        return [
            factor_values(g.row, factors, self.x[g.state_rows]) for g, factors in zip(s.groups, s.factors, strict=True)
        ]

    @cached_property
    def _placed(self) -> tuple[Array, Array]:
        """Poses of all links ``(3, 4, N, T)``, and of b seen from a at the chords ``(3, 4, chords, T)``."""
        s = self.system
        relative = np.empty((3, 4, len(s.m.pairs), self.T))
        for g, factors, values in zip(s.groups, s.factors, self._values, strict=True):
            relative[:, :, g.at_pairs] = displaced(factors, values) if factors else s.weld(g)
        chords = relative[:, :, s.chords]
        return s.tree.poses(relative, s.par.frame), chords

    @property
    def poses(self) -> Array:
        """Poses of all links ``(3, 4, N, T)``."""
        return self._placed[0]

    def forget(self) -> None:
        """Give back all memory but that of the states; what is asked for again is computed again."""
        for name, value in vars(type(self)).items():
            if isinstance(value, cached_property):
                self.__dict__.pop(name, None)

    @cached_property
    def _columns(self) -> list[list[Frame]]:
        """For every group the pair frames 0, 1, ..., by columns."""
        s = self.system
        out = []
        for g, factors, values, links in zip(s.groups, s.factors, self._values, s.carriers, strict=True):
            base = moved_marker(self.poses[:, :, links], s.par.marker_a[:, :, g.at_pairs])
            out.append(frames_along(g.row, factors, values, base))
        return out

    def part(self, at: Index) -> Configuration:
        """Some of the positions, evaluated by themselves."""
        par = self.system.par
        system = self.system if par.batch == 1 else self.system.with_parameters(par.taken(at))
        return Configuration(system, self.x[:, at])

    @cached_property
    def frames(self) -> list[list[Array]]:
        """For every group the pair frames 0, 1, ... about the internal origin."""
        return [
            [whole[id(X)] for X in group]
            for group in self._columns
            for whole in [{id(X): np.stack([X.column(i) for i in range(4)], axis=1) for X in group}]
        ]

    @cached_property
    def S(self) -> Array:
        """Twists of all freedoms ``(6, F, T)``."""
        s = self.system
        out = np.empty((6, s.n_freedoms, self.T))
        points = np.empty((3, s.n_freedoms, self.T))
        slides = []
        for g, frames in zip(s.groups, self._columns, strict=True):
            for freedom, before, at in zip(g.row.freedoms, g.row.frame_before, g.at_columns, strict=True):
                turn, slide = evaluation.twist_parts(freedom, before, s.par.pitch[g.pairs], frames)
                out[:3, at] = 0.0 if turn is None else turn
                points[:, at] = 0.0 if turn is None else evaluation.frame_origin(before, frames)
                if slide is not None:
                    slides.append((at, slide))
        cross(points, out[:3], out[3:])
        for at, slide in slides:
            out[3:, at] += slide
        return out

    @cached_property
    def E(self) -> Array:
        """Effort wrenches of all freedoms ``(6, F, T)``."""
        s = self.system
        out = np.empty((6, s.n_freedoms, self.T))
        for g, frames in zip(s.groups, self._columns, strict=True):
            E = evaluation.efforts_of(g.row, s.par.pitch[g.pairs], frames)
            for j, at in enumerate(g.at_columns):
                out[:, at] = E[:, j]
        return out

    @cached_property
    def W(self) -> list[Array]:
        """For every group the reaction wrenches ``(6, 6 - f, n, T)``."""
        s = self.system
        return [
            evaluation.reactions_of(g.row, s.par.pitch[g.pairs], frames)
            for g, frames in zip(s.groups, self.frames, strict=True)
        ]

    @cached_property
    def lee_screws(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """For every pair the axial wrenches ``(6, n, T)`` and condition twists ``(6, n, T)`` of Lee's bookkeeping."""
        s = self.system
        along, conditions = ([np.zeros((6, 0, self.T))] * len(s.m.pairs) for _ in range(2))
        for g, frames in zip(s.groups, self.frames, strict=True):
            book = g.row.bookkeeping
            if book is None:
                continue
            pitch = s.par.pitch[g.pairs]
            wrenches = evaluation.components_of(book.along, pitch, frames)
            twists = evaluation.freedoms_of(book.conditions, (0,) * len(book.conditions), pitch, frames)
            for i, k in enumerate(g.pairs):
                along[k], conditions[k] = wrenches[:, :, i], twists[:, :, i]
        return tuple(along), tuple(conditions)

    @cached_property
    def pair_points(self) -> Array:
        """Origins of the markers B, ``(3, P, T)``."""
        out = np.empty((3, len(self.system.m.pairs), self.T))
        for g, frames in zip(self.system.groups, self._columns, strict=True):
            out[:, g.at_pairs] = frames[-1].column(3)
        return out

    @cached_property
    def chord_errors(self) -> Array:
        """Closure errors ``(6, chords, T)``: finite twist from marker B reached through b to that reached through a."""
        s = self.system
        a, b = s.chord_ends
        poses, chords = self._placed
        reached = compose(poses[:, :, a], chords)
        return pose_log(compose(reached, inverse(poses[:, :, b])))

    @cached_property
    def closure(self) -> Array:
        """Closure error ``(T,)``: largest of angle and length / L over all loops."""
        if not len(self.system.chords):
            return np.zeros(self.T)
        e = self.chord_errors
        angle, length = (np.sqrt((part * part).sum(axis=0)).max(axis=0) for part in (e[:3], e[3:]))
        return np.maximum(angle, length)

    @cached_property
    def residual(self) -> Array:
        """Closure errors of the loops, stacked ``(6 loops, T)``."""
        s = self.system
        if s.many_loops:
            per_pair = np.zeros((6, len(s.m.pairs), self.T))
            per_pair[:, s.chords] = self.chord_errors
            return self.loop_sums(per_pair)
        return _combined(s.loops_of_chords, self.chord_errors)

    @cached_property
    def J(self) -> Array:
        """Closure Jacobian ``(6 loops, F, T)``: ``J = (C x I6) diag(S_k)``."""
        return self.stacked(self.S)

    def stacked(self, S: Array) -> Array:
        """Columns ``(6, F, T)`` placed with their signs into the rows of every loop."""
        s = self.system
        out = np.zeros((6 * len(s.loop_columns), s.n_freedoms, S.shape[2]))
        for i, pieces in enumerate(s.loop_pieces):
            rows = out[6 * i : 6 * i + 6]
            for at, signs in pieces:
                np.multiply(S[:, at], signs, out=rows[:, at])
        return out

    # --- rates -----------------------------------------------------------------------------------------------------

    def link_twists(self, dq: Array) -> Array:
        """Twists of all links ``(6, N, T)`` for rates ``dq (F, T)``, along the tree."""
        return self.system.tree.sums(self.pair_sums(self.S * dq))

    def pair_sums(self, terms: Array) -> Array:
        """Sum of the columns of every pair: ``(6, F, T)`` -> ``(6, P, T)``."""
        s = self.system
        out = np.zeros((6, len(s.m.pairs), terms.shape[2]))
        for g in s.groups:
            for i, at in enumerate(g.at_columns):
                if i == 0:
                    out[:, g.at_pairs] = terms[:, at]
                else:
                    out[:, g.at_pairs] += terms[:, at]
        return out

    def bias(self, dq: Array, V: Array) -> Array:
        """Velocity part of the relative accelerations ``(6, P, T)``: ``sum_j ad(V of the frame before j) S_j q'_j``."""
        s = self.system
        moving = self.S * dq
        out = np.zeros((6, len(s.m.pairs), self.T))
        for g, links in zip(s.groups, s.carriers, strict=True):
            carrier = V[:, links]
            for factor in g.row.factors:
                steps = [moving[:, g.at_columns[j]] for j in factor]
                step = steps[0] if len(steps) == 1 else steps[0] + steps[1] + steps[2]
                if factor[0] == 0:
                    out[:, g.at_pairs] = cross_twist(carrier, step)
                else:
                    out[:, g.at_pairs] += cross_twist(carrier, step)
                if factor[-1] + 1 < g.row.f:
                    carrier = carrier + step
        return out

    def loop_sums(self, per_pair: Array) -> Array:
        """Signed sum of pair terms along every loop, stacked ``(6 loops, T)``."""
        s = self.system
        if s.many_loops:
            flat = per_pair.transpose(1, 0, 2).reshape(per_pair.shape[1], 6 * per_pair.shape[2])
            return np.asarray(s.graph.sparse_loop_matrix @ flat).reshape(6 * len(s.graph.loops), per_pair.shape[2])
        return _combined(s.graph.loop_matrix, per_pair)

    def pair_wrenches(self, x: Array) -> Array:
        """Pair wrenches ``(6, P, k, T)`` of loop wrenches ``(6 loops, k, T)``: ``w = C^T x``."""
        s = self.system
        loops = x.reshape(len(s.graph.loops), 6, *x.shape[1:])
        if s.many_loops:
            flat = np.asarray(s.graph.sparse_loop_matrix.T @ loops.reshape(len(loops), loops.size // len(loops)))
            return np.moveaxis(flat.reshape(len(s.m.pairs), 6, *x.shape[1:]), 1, 0)
        return np.asarray(np.einsum("lp,list->ipst", s.graph.loop_matrix, loops))

    def closure_rates(self, dq: Array) -> Array:
        """``J q'`` for rates ``(F, T)`` without forming J, ``(m, T)``."""
        return self.loop_sums(self.pair_sums(self.S * dq))

    def closure_bias(self, dq: Array, V: Array) -> Array:
        """Velocity part of the closure accelerations ``(m, T)``."""
        return self.loop_sums(self.bias(dq, V))

    def link_accelerations(self, dq: Array, ddq: Array, V: Array) -> Array:
        """Accelerations dV/dt of all links ``(6, N, T)``."""
        return self.accelerations_with(ddq, self.bias(dq, V))

    def accelerations_with(self, ddq: Array, bias: Array) -> Array:
        """Accelerations dV/dt of all links ``(6, N, T)``, the velocity part ``bias (6, P, T)`` known."""
        relative = self.pair_sums(self.S * ddq)
        relative += bias
        return self.system.tree.sums(relative)


def _combined(matrix: Array, terms: Array) -> Array:
    """Combinations ``(6 rows, T)`` of terms ``(6, n, T)`` by a matrix ``(rows, n)``."""
    sums = matrix @ terms
    return sums.swapaxes(0, 1).reshape(sums.shape[0] * sums.shape[1], terms.shape[2])
