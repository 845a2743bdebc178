"""The equations of a task without its rods: links that do nothing but keep two points at a distance, for one row each.

A rod has two pairs, balls or turns of a planar mechanism, placed by point (and axis), of which nothing is asked and no direction is
sought. With ``l`` between its points at the declared position and ``d`` between those of the bodies that it joins,

    (d . d - l . l) / 2 = 0

is polynomial in poses and points, and the loops of a rod fall away with its coordinates. Rods stay where bodies would float without them.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Index, compose, matrix_quaternion, quaternion_matrix, rotate, rotate_back, rotation_exp
from mechgraph.model.pair import Pair
from mechgraph.modes.family import Array
from mechgraph.modes.form import RodPoints, RodSystem, angle_about, is_ball, least_turn
from mechgraph.pairs.pair_type import PairType
from mechgraph.synthesis.system import ArrowRows, RowNumbers, RowProblem


class RodEnd(NamedTuple):
    """An end of a rod: its pair, there the side of the rod (0 or 1), and the body beyond."""

    pair: int
    side: int
    body: int


Rod = tuple[RodEnd, RodEnd]


def rods_of(p: RowProblem) -> list[Rod]:
    """The rods of a problem; no two share a pair."""
    s, m = p.system, p.whole
    coupled = np.flatnonzero(s.coupling_matrix[:, :, 0].any(axis=0))
    busy = {*s.pair_of_freedom[[*p.columns, *coupled]].tolist(), *(q.pair for own in p.places for q in own if q.turns)}
    ends = {k for k, pair in enumerate(m.pairs[: p.own]) if k not in busy and _is_end(pair, m.planar)}
    kept, out = list(range(len(m.pairs))), list[Rod]()
    for link in (i for i in range(len(m.links)) if i != s.graph.frame):
        mine = [k for k in range(len(m.pairs)) if link in s.graph.ends[k]]
        rod = [RodEnd(k, s.graph.ends[k].index(link), sum(s.graph.ends[k]) - link) for k in mine if k in ends]
        if len(mine) != 2 or len(rod) != 2 or rod[0].body == rod[1].body or not set(mine).issubset(kept):
            continue
        left = [k for k in kept if k not in mine]
        gone = {link, *(i for i in range(len(m.links)) if not any(i in s.graph.ends[k] for k in kept))}
        component = components_of_edges(len(m.links), [s.graph.ends[k] for k in left])
        if len({int(component[i]) for i in range(len(m.links)) if i not in gone}) == 1:
            kept = left
            out.append((rod[0], rod[1]))
    return out


def _is_end(pair: Pair, planar: bool) -> bool:
    """Whether a pair leaves a rod all directions about one point."""
    twists = np.array([f.twist for f in pair.type.freedoms])
    turn = planar and len(twists) == 1 and not twists[0, 3:].any() and not pair.type.takes_pitch
    return pair.on_a is None and pair.contact is None and (is_ball(pair.type) or turn)


class RodProblem(RowProblem):
    """What is left of a problem ``full``; of pairs and numbers those of rods stand last, ``order`` are their places in ``full``."""

    def __init__(self, full: RowProblem, rods: list[Rod]) -> None:
        vars(self).update(vars(copy(full)))
        for name in ("places", "at_rest", "loop_signs", "asked_columns", "turns", "plain_angles"):
            vars(self).pop(name, None)
        self.full, s, m = full, full.system, full.whole
        gone = [end.pair for rod in rods for end in rod]
        kept = [k for k in range(len(m.pairs)) if k not in gone]
        links = [i for i in range(len(m.links)) if any(i in s.graph.ends[k] for k in kept)]
        self.order: Index = np.array([*kept, *gone], dtype=np.intp)
        place = np.argsort(self.order)
        self.rods: list[Rod] = [
            cast("Rod", tuple(end._replace(pair=int(place[end.pair]), body=links.index(end.body)) for end in rod))
            for rod in rods
        ]
        self.own = full.own - len(gone)
        start = {name: value for name, value in m.start.items() if m.freedom(name)[0] in kept}
        self.whole = m.replace(links=[m.links[i] for i in links], pairs=[m.pairs[k] for k in kept], start=start)
        self.numbers = full.numbers.of_pairs(self.order)
        columns = [np.arange(s.first_column[k], s.first_column[k + 1]) for k in kept]
        self.columns = np.searchsorted(np.concatenate(columns), full.columns)
        self.state_rows: Index = np.concatenate([np.arange(s.first_row[k], s.first_row[k + 1]) for k in kept])
        vars(self)["at_rest"] = full.at_rest[self.state_rows]
        vars(self)["places"] = self.placed(full.places)
        par = replace(
            s.par,
            **{name: getattr(s.par, name)[:, :, kept] for name in ("marker_a", "marker_b")},
            pitch=s.par.pitch[kept],
            mass=s.par.mass[links],
            center=s.par.center[:, links],
            inertia=s.par.inertia[:, :, links],
            offset=s.par.offset[:, links],
        )
        self.system = RodSystem(self.whole, None, par, self._points(self.numbers))

    def _points(self, numbers: RowNumbers) -> RodPoints:
        """Points and squares of lengths of rods with such numbers of markers."""
        near, far = (
            [numbers.point[[abs(end.side - at) for end in ends], :, [end.pair for end in ends]] for at in (0, 1)]
            for ends in zip(*self.rods, strict=True)
        )
        a, b = (np.array([end.body for end in ends], dtype=np.intp) for ends in zip(*self.rods, strict=True))
        on_rod, on_body = (np.stack([near[at], far[at]]).swapaxes(1, 2) for at in (0, 1))
        return RodPoints(a, b, on_body[0], on_body[1], ((on_rod[1] - on_rod[0]) ** 2).sum(axis=0), on_rod)

    def system_with(self, numbers: RowNumbers) -> System:
        """See there."""
        kept = super().system_with(numbers.of_pairs(np.arange(len(self.whole.pairs))))
        return cast("RodSystem", kept).with_points(self._points(numbers))

    def equations(self, numbers: RowNumbers, x: Array, drive: Array | None = None) -> RodArrowRows:
        """See there."""
        return RodArrowRows(self, numbers, x, drive)

    def lifted(self, numbers: RowNumbers, x: Array) -> Array:
        """States ``(R, nx, T)`` of the whole mechanism: rods put back, balls of which turn as little as can be; without rates."""
        s, (R, _, T) = self.full.system, x.shape
        states, one = np.moveaxis(x, 1, 0).reshape(x.shape[1], -1), numbers.point.shape[-1] == 1
        many = np.zeros(R * T, dtype=np.intp) if one else np.tile(np.arange(T), R)
        here = Configuration(self.system_with(numbers).cases(many), states)
        par = self.full.system_with(numbers.of_pairs(np.argsort(self.order))).par
        sides = [np.broadcast_to(M, (*M.shape[:3], 1 if one else T))[..., many] for M in (par.marker_a, par.marker_b)]
        out = np.repeat(self.full.at_rest[:, None].astype(x.dtype), R * T, axis=1)
        out[self.state_rows] = states
        for rod in self.rods:
            bodies, pairs = [here.poses[:, :, end.body] for end in rod], [int(self.order[end.pair]) for end in rod]
            near, far = (
                compose(X, sides[1 - end.side][:, :, k])[:, 3] for X, end, k in zip(bodies, rod, pairs, strict=True)
            )
            first, last = (sides[end.side][:, :, k] for end, k in zip(rod, pairs, strict=True))
            row, link = s.m.pairs[pairs[0]].type, np.empty_like(first, dtype=x.dtype)
            if is_ball(row):
                turn = least_turn(last[:, 3] - first[:, 3], far - near, _STILL)
                link[:, :3] = quaternion_matrix(turn if np.iscomplexobj(x) else turn.real)
            else:
                axis = rotate(first[:, :3], np.repeat(np.array(row.freedoms[0].twist[:3])[:, None], R * T, axis=1))
                turn = angle_about(last[:, 3] - first[:, 3], far - near, axis)
                link[:, :3] = rotation_exp(axis * (turn if np.iscomplexobj(x) else turn.real))
            link[:, 3] = near - rotate(link[:, :3], first[:, 3])
            for end, k, body in zip(rod, pairs, bodies, strict=True):
                A, B = (link, body) if end.side == 0 else (body, link)
                D = rotate_back(compose(A, sides[0][:, :, k])[:, :3], compose(B, sides[1][:, :, k])[:, :3])
                row = s.m.pairs[k].type
                state = matrix_quaternion(D) if is_ball(row) else _turned(row, D)
                out[s.first_row[k] : s.first_row[k + 1]] = state if np.iscomplexobj(x) else state.real
        return np.moveaxis(out.reshape(len(out), R, T), 0, 1)


_STILL = np.eye(4)[:, :1]


def _turned(row: PairType, D: Array) -> Array:
    """Angles ``(1, T)`` of turns ``D (3, 3, T)`` about the axis of a pair."""
    axis = np.array(row.freedoms[0].twist[:3])
    across = np.eye(3)[np.argmin(np.abs(axis))]
    across = (across - axis * (axis @ across))[:, None] + np.zeros(D.shape[2])
    return np.asarray(angle_about(across, np.einsum("ijt,jt->it", D, across), axis[:, None])[None])


class RodArrowRows(ArrowRows):
    """The rows of loops and rods."""

    problem: RodProblem

    def opened(self, side: Index, pair: Index, V: Array) -> Array:
        """See there; rods grow longer too."""
        out, system = super().opened(side, pair, V), cast("RodSystem", self.here.system)
        ways = system.ways[:, pair] * np.where(side == 0, 1.0, -1.0)
        out[len(out) - len(self.problem.rods) :] = np.einsum(
            "nk,int,ikt->nkt", ways, system.rod_rows.lines(self.here)[1], V
        )
        return out

    def moved(self, side: Index, pair: Index, rates: Array) -> Array:
        """See there; markers of rods move their points and lengths."""
        p, here, B = self.problem, self.here, rates.shape[-1]
        n, own = len(p.rods), pair < len(p.whole.pairs)
        V = self.twists(side[own], pair[own], rates[:, :, own])
        out = np.zeros((len(here.residual), len(pair), here.T), dtype=V.dtype)
        out[:, own] = self.opened(side[own], pair[own], V)
        W = cast("RodSystem", here.system).rod_rows.lines(here)[1]
        moves = np.tile(
            np.broadcast_to(rates[0], (3, len(pair), self.T if B > 1 else 1)), self.R * self.N if B > 1 else 1
        )
        for i, rod in enumerate(p.rods):
            (a, b), row = rod, len(out) - n + i
            inside = self.numbers.point[b.side, :, b.pair] - self.numbers.point[a.side, :, a.pair]
            inside = np.tile(inside, self.R * self.N) if inside.shape[-1] > 1 else inside
            for sign, end in ((-1.0, a), (1.0, b)):
                for c in np.flatnonzero(pair == end.pair):
                    line = -inside if side[c] == end.side else rotate_back(here.poses[:, :3, end.body], W[3:, i])
                    out[row, c] += sign * (line * moves[:, c]).sum(axis=0)
        return self._by_row(out)
