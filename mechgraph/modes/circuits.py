"""Circuits of mechanisms with one driver, followed by their length.

A position of a mechanism with one driver lies on a curve of positions, its circuit. Where the driver has to turn back the curve folds;
between folds it is a branch, on which the driver moves the mechanism. The circuits of mechanisms of one topology are followed together,
by their length, to which a fold is a place like any other: by steps along the one motion that the closure leaves, from a known position
both ways until these meet. Where the closure is singular between the ends of a step, as on the way to another circuit nearby, the step is
divided; what is too short to be a gap is passed straight on, and circuits meet there.

Sources: Chase and Mirth, Circuits and branches of single-degree-of-freedom planar linkages, J. Mech. Des. 115, 1993; Allgower and Georg,
Introduction to Numerical Continuation Methods, 2003, chapters 2, 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mechgraph.kinematics.motion_path import FARTHEST
from mechgraph.kinematics.reach import BEYOND_END, beyond
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import inverses
from mechgraph.maths.newton import cubic
from mechgraph.maths.se3 import Array, Index, Mask, finite_twist, multiplied
from mechgraph.maths.tolerances import MODES, MOTIONS
from mechgraph.memo import dataclass
from mechgraph.modes.compiled_tracks import CompiledClosure
from mechgraph.modes.family import NO_NUMBERS, Family

SAME_VALUE = 1e-9
"""Difference of two values of the driver (radians, or lengths over L) that is rounding."""


@dataclass
class CircuitNodes:
    """States ``x (nx, T)`` of mechanisms ``case (T,)`` at places along their circuits, and what is known there.

    ``t (F, T)``: the motion, of unit size; ``J = U diag(S) V^T``, there or at a neighbor, of which the last columns of ``U (m, m, T)`` are
    met by no motion and those of ``V (F, F, T)`` are motions, passive ones last; ``meets`` says that circuits meet there.
    """

    case: Index
    place: Array
    x: Array
    t: Array
    J: Array
    U: Array
    S: Array
    V: Array
    meets: Mask

    def taken(self, which: Any) -> CircuitNodes:
        """Some of them."""
        return CircuitNodes(*(v[..., which] for v in vars(self).values()))

    def put(self, which: Index, new: CircuitNodes) -> None:
        """Put others in the places of some."""
        for mine, other in zip(vars(self).values(), vars(new).values(), strict=True):
            mine[..., which] = other

    def leads_to(self, other: CircuitNodes) -> Mask:
        """Whether the closure is singular nowhere between: ``D = S^-1 U^T J V``, 1 here, has no eigenvalue there beyond zero.

        One changes its sign where a step leads from one of two circuits that nearly meet straight on to the other, and where they meet.
        """
        r = len(self.S)
        U, J, V, S = (np.moveaxis(v, -1, 0) for v in (self.U[:, :r], other.J, self.V[:, :r], self.S))
        # singular values of other circuits at rounding
        D = np.nan_to_num(U.swapaxes(1, 2) @ J @ V / np.maximum(S, 1e-300)[:, :, None])
        out = ((D - np.eye(r)) ** 2).sum(axis=(1, 2)) < 1.0
        out[~out] = (np.linalg.eigvals(D[~out]).real > 0).all(axis=1)
        return np.asarray(out)

    @staticmethod
    def joined(parts: Iterable[CircuitNodes]) -> CircuitNodes:
        """All of them, one circuit after the other, in the order of their places."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        out = CircuitNodes(*(np.concatenate(column, axis=-1) for column in columns))
        return out.taken(np.lexsort((out.place, out.case)))


class Circuits:
    """The circuits of mechanisms of one topology through states ``x (nx, V)``: of ``V`` cases of a system, or of one.

    The driver is the freedom ``column``, others are ``held``; ``rank`` is that of the closure with these. ``rims`` are the ends of the
    range of the driver where it has one.

    Attributes
    ----------
    a, b : nodes
        Ends of all steps, one circuit after the other; closed circuits with folds are laid out from one of these to itself.
    run, of_branch, rises (steps,)
        The branch of every step: its number among all; on its circuit, 0 that through ``x``; 1 where the driver rises, else -1.
    home (V,)
        The branches through ``x``, by their numbers among all.
    closes, dead (V,)
        Whether a circuit comes back to its beginning; whether the driver stands still there, so that nothing is followed.
    twin (V,)
        Whether a state lies on the circuit of one before it, so that nothing is followed: told of states of one system at one driver value.
    turns (V,)
        Turns of the driver after which a circuit without folds comes back, 0 where it does not.
    """

    def __init__(
        self,
        family: Family,
        system: System,
        column: int,
        rank: int,
        x: Array,
        held: Index = NO_NUMBERS,
        rims: tuple[float, float] | None = None,
    ) -> None:
        self.family, self.s, self.column, self.rank, self.x, self.held = family, system, column, rank, x, held
        self.V, self.row = x.shape[1], int(system.single_rows[column])
        self.compiled = CompiledClosure.of(system)
        self.period = np.inf if rims else float(system.periods[column])
        # turns of the driver after which a branch may come back, at most
        far = 8 * self.period if np.isfinite(self.period) else np.inf
        self.ends: Array = np.outer(rims, np.ones(self.V)) if rims else np.stack([x[self.row] - far, x[self.row] + far])
        self.settled = np.flatnonzero(np.abs(family.idle).max(axis=1, initial=0.0) < MODES.span)
        self.links, self.ways = NO_NUMBERS, np.zeros((0, system.n_freedoms))
        if family.idle.shape[1]:
            # on the way of links from the frame, 1 or -1 of each freedom
            ways = system.tree.sums(np.ones((6, 1, 1)) * np.eye(len(system.m.pairs)))[0][:, system.pair_of_freedom]
            self.links = family.settled_links[ways[family.settled_links].any(axis=1)]
            self.ways = ways[self.links]
        back = (system.single_rows >= 0) & np.isfinite(family.periods)
        back[column] &= rims is None
        self.back = np.flatnonzero(back)
        self.turns, self.closes = np.zeros(self.V, dtype=np.intp), np.zeros(self.V, dtype=bool)
        self.gap, self.twin = np.zeros(self.V), np.zeros(self.V, dtype=bool)
        one = system.par.batch == 1 and self.V > 1 and np.ptp(x[self.row]) == 0
        self.first = family.prints(Configuration(system, x)) if one else None
        nodes = self._unrolled(self._with_folds(self._whole(self._followed())))
        self.a, self.b = a, b = self._steps(nodes)
        self.rises = np.sign((b.x - a.x)[self.row])
        new = (np.diff(self.rises, prepend=0) != 0) | (np.diff(a.case, prepend=-1) != 0)
        self.run, self.home = np.cumsum(new) - 1, np.zeros(self.V, dtype=np.intp)
        for place in (b.place, a.place):
            at = np.flatnonzero(place == 0)
            self.home[a.case[at]] = self.run[at]
        self.of_branch = self.run - self.home[a.case]

    def __repr__(self) -> str:
        return f"<{self.V} circuits of {self.s.m.name}>"

    def here(self, x: Array, case: Index) -> Configuration:
        """Mechanisms at states ``(nx, T)``."""
        return Configuration(self.s.cases(case), x)

    def _told(self, x: Array, case: Index, rates: Array) -> Array:
        """Of rates ``(F, k, T)`` at states what is no passive motion: of freedoms, and twists of links, that none moves, ``(n, k, T)``."""
        if not self.links.size:
            return rates[self.settled]
        twists = np.einsum("lf,ift,fkt->ilkt", self.ways, self.here(x, case).S, rates, optimize=True)
        return np.concatenate([rates[self.settled], *twists])

    def at(self, x: Array, case: Index, beside: CircuitNodes | None = None) -> tuple[Array, CircuitNodes]:
        """Least Newton steps ``(F, T)`` at states, and what is known there.

        With nodes ``beside`` them motions are those with ``[[J, U], [N^T, 0]]``, bordered by what no motion meets and by motions there.
        """
        r, (F, T) = self.rank, (self.s.n_freedoms, x.shape[1])
        if self.compiled is None:
            here = self.here(x, case)
            left, J = here.residual, here.J
        else:
            left, J = self.compiled.at(x, case)
        if self.held.size:
            # each step carries on by a few times what they are off, unless they are led back
            rest, rows = (
                np.broadcast_to(np.eye(F)[self.held, :, None], (len(self.held), F, T)),
                self.s.single_rows[self.held],
            )
            J, left = np.concatenate([J, rest]), np.concatenate([left, x[rows] - self.x[np.ix_(rows, case)]])
        m = len(J)
        with np.errstate(all="ignore"):
            if beside is None:
                U, S, V = np.linalg.svd(np.nan_to_num(J).transpose(2, 0, 1))
                V, S = V.swapaxes(1, 2), S[:, :r]
                step = -V[:, :, :r] @ (U[:, :, :r].swapaxes(1, 2) @ left.T[:, :, None] / S[:, :, None])
                N = V[:, :, r:]
            else:
                B = np.zeros((T, m + F - r, F + m - r))
                B[:, :m, :F], B[:, :m, F:], B[:, m:, :F] = (
                    np.moveaxis(v, -1, 0) for v in (J, beside.U[:, r:], beside.V[:, r:].swapaxes(0, 1))
                )
                B = inverses(B)
                step, N = -B[:, :F, :m] @ left.T[:, :, None], np.nan_to_num(B[:, :F, m:])
                N = np.linalg.qr(N)[0]
            if N.shape[2] > 1:
                # passive motions come last: what they do not change moves in one way
                told = np.moveaxis(self._told(x, case, np.moveaxis(N, 0, -1)), -1, 0)
                N = N @ np.linalg.svd(np.nan_to_num(told))[2].swapaxes(1, 2)
        if beside is None:
            V[:, :, r:] = N
            U, S, V = (np.moveaxis(v, 0, -1) for v in (U, S, V))
        else:
            U, S, V = beside.U, beside.S, beside.V
        nothing = np.zeros(T)
        return step[:, :, 0].T, CircuitNodes(case, nothing, x, N[:, :, 0].T.copy(), J, U, S, V, nothing > 0)

    def closed(
        self, x: Array, case: Index, ahead: Array, goal: Array | None = None, beside: CircuitNodes | None = None
    ) -> tuple[CircuitNodes, Array]:
        """Nodes near states ``(nx, T)``, with motions that lead ``ahead (F, T)``, where the driver has the values of a ``goal (T,)``; and
        the last Newton steps.
        """
        # Newton steps, of which each doubles the digits
        for _ in range(4):
            step, node = self.at(x, case, beside)
            if goal is not None:
                rate = node.t[self.column]
                left = (goal - x[self.row] - step[self.column]) / np.where(rate == 0, 1.0, rate)
                step = step + node.t * np.clip(left, -0.1, 0.1)
            x, last = self.s.advance(x, step), np.abs(step).max(axis=0)
            if (last < 1e-9).all():
                break
        node.x = x
        node.t *= np.where((node.t * ahead).sum(axis=0) < 0, -1.0, 1.0)
        return node, last

    def _followed(self) -> CircuitNodes:
        """Nodes along all circuits, by steps both ways until these meet or end; places count them."""
        s, lengths = self.s, self.s.single_rows[self.s.is_length]
        case, sense = np.repeat(np.arange(self.V), 2), np.tile([1.0, -1.0], self.V)
        _, last = self.at(self.x[:, case], case)
        rate = np.abs(last.t[self.column])
        self.dead = (rate <= MOTIONS.dependent * np.abs(last.t).max(axis=0))[::2]
        last.t *= sense * np.where(last.t[self.column] < 0, -1.0, 1.0)
        low, high = self.ends[:, case]
        h, wide, going, out = np.full(2 * self.V, 0.25), np.zeros(2 * self.V), ~self.dead[case], list[CircuitNodes]()
        before, closing = last.taken(np.arange(2 * self.V)), np.zeros(self.V, dtype=bool)
        ending = np.zeros(2 * self.V, dtype=bool)

        def beyond_end(x: Array, which: Index) -> Array:
            """By how much states are beyond the ranges of the driver and of coordinates; at most zero within."""
            value = x[self.row]
            return np.max([low[which] - value, value - high[which], *beyond(s, x)], axis=0)

        out.append(last.taken(np.arange(0, 2 * self.V, 2)))
        # steps after which a circuit is left open
        for _ in range(3000):
            self._meet(last, h, going, closing)
            at = np.flatnonzero(going)
            if not at.size:
                break
            # what is no longer than this is no gap between circuits: they meet there, and are passed straight on
            leap, here = (h[at] < 1e-6) & ~ending[at], last.taken(at)
            ahead = np.where(leap, 1e-3, h[at])
            dq = here.t * ahead
            known = np.flatnonzero(wide[at] > 0)
            some, w = before.taken(at[known]), wide[at[known]]
            y, _ = self._way(here.taken(known), some)
            on = cubic(y, here.t[:, known], s.tangent(y, some.t), -w, ahead[known])
            # beside where circuits meet motions are noise, ways that lead there are not
            dq[:, known] = np.where(leap[known], -1e-3 / w * y, on)
            x = s.advance(here.x, dq)
            one, _ = self.at(x, here.case)
            two, new = self.at(s.advance(x, one), here.case)
            new.x, new.place = s.advance(new.x, two), here.place + sense[at]
            turn = (new.t * here.t).sum(axis=0)
            new.t *= np.where(turn < 0, -1.0, 1.0)
            size, straight = np.abs(one).max(axis=0), here.leads_to(new)
            good = (size <= np.where(leap, 1e-5, 0.1)) & (np.abs(two).max(axis=0) <= 0.1 * size + 1e-9)
            good &= (np.abs(turn) > 0.7) & np.isfinite(new.x).all(axis=0) & (leap | straight)
            # ends of ranges are come to by shorter steps, each to where the last one tells
            over = beyond_end(new.x, at)
            cut = good & (over > BEYOND_END)
            ending[at[cut]], good = True, good & ~cut
            longest = 1.0 * np.maximum(1.0, np.abs(new.x[lengths]).max(axis=0, initial=0.0))
            grown = ahead * np.clip((0.03 / np.maximum(size, 1e-12)) ** 0.25, 0.5, 2.0)
            h[at] = np.where(good, np.minimum(grown, longest), 0.4 * ahead)
            going[at[(~good & leap & ~cut) | (good & (over >= -BEYOND_END))]] = False
            if cut.any():
                left = -beyond_end(here.x[:, cut], at[cut])
                h[at[cut]] = ahead[cut] * np.clip(left / (left + over[cut]), 0.0, 0.9)
                going[at[cut]] = left > BEYOND_END
            if (leap & good).any():
                out.append(replace(here, t=here.t * sense[at], meets=~straight).taken(leap & good))
            on, new, here = at[good], new.taken(good), here.taken(good)
            long = self._way(here, new)[1] > 1e-4
            before.put(on[long], here.taken(long))
            last.put(on, new)
            wide[on] = self._way(before.taken(on), new)[1]
            out.append(replace(new, t=new.t * sense[on]))
            going &= np.abs(last.x[lengths]).max(axis=0, initial=0.0) <= FARTHEST
            self._find_twins(here, new)
            going &= ~self.twin[case]
        nodes = CircuitNodes.joined(out)
        # of nodes that are told twice the second one says whether circuits meet
        again = (np.diff(nodes.case, append=-1) == 0) & (np.diff(nodes.place, append=0) == 0)
        return nodes.taken(~again & ~(self.twin[nodes.case] & (nodes.place != 0)))

    def _find_twins(self, a: CircuitNodes, b: CircuitNodes) -> None:
        """See which steps lead through the first states of other cases: of two on one circuit the former is followed on."""
        if self.first is None:
            return
        begin = a.x[self.row]
        on, value = self._crossed(begin, b.x[self.row], self.x[self.row, a.case])
        # where a step begins the one before has ended, or it is the case's own first state
        further = np.abs(value - begin[on]) > SAME_VALUE
        on[on], value = further, value[further]
        if not on.any():
            return
        a, b = a.taken(on), b.taken(on)
        node, last = self._met(a, b, value)
        there = self.family.prints(self.here(node.x, node.case))
        gaps = np.abs(there[:, :, None] - self.first[:, None]).max(axis=0, initial=0.0)
        same = gaps < MODES.arrives * np.maximum(1.0, np.abs(there).max(axis=0, initial=0.0))[:, None]
        k, other = np.nonzero(same & ((last < 1e-8) & a.leads_to(node) & b.leads_to(node))[:, None])
        mine = a.case[k]
        self.twin[np.maximum(mine, other)[mine != other]] = True

    def _meet(self, last: CircuitNodes, h: Array, going: Mask, closing: Mask) -> None:
        """See which of both ways come together, and let the first one end at the other."""
        d, ahead, behind, facing = self._apart(last)
        # the last step leads to the end of the other way, or straight over it, or these were parts of a circuit that pass each other
        there = closing & going[::2]
        # nodes are off their circuit by more than the last step may be short of the other end, or beyond it
        at = np.flatnonzero(np.repeat(there, 2))
        if at.size:
            last.x[:, at] = self.closed(last.x[:, at], last.case[at], last.t[:, at])[0].x
            d, ahead, behind, facing = self._apart(last)
        # behind a corner one of both ends alone leads straight to the other
        done = there & (ahead <= 0) & ((d < 1e-5) | (np.maximum(-ahead, behind) > (1.0 - 1e-4) * d))
        lost = there & ~done & ((ahead <= 0) | (d > self.gap))
        self.closes |= done
        if np.isfinite(self.period):
            self.turns[done] = np.abs(np.round((last.x[self.row, ::2] - last.x[self.row, 1::2])[done] / self.period))
        going[::2][done], going[1::2][lost], closing[lost] = False, True, False
        # steps are longer than they were meant to be by what they are off
        near = going[::2] & going[1::2] & (ahead > 0) & (behind < 0) & (d < 1.2 * (h[::2] + h[1::2]))
        # steps that are short beside what is left still go round a corner, which may lead elsewhere
        met = near & (facing < -0.8) & (ahead > 0.9 * d) & (d <= 3.01 * np.minimum(h[::2], h[1::2]))
        going[1::2][met], closing[met] = False, True
        self.gap[closing] = d[closing]
        # a little more than what is left, or less, by what a step may be off
        left, step = d[closing], h[::2][closing]
        short = left * (1.0 - 0.2 * np.minimum(2.0 * left / step, 1.0) ** 4)
        h[::2][closing] = np.minimum(step, short + 2e-6)
        apart = near & ~met
        for way in (h[::2], h[1::2]):
            way[apart] = np.minimum(way, np.maximum(d / 3.0, 1e-5))[apart]

    def _apart(self, last: CircuitNodes) -> tuple[Array, Array, Array, Array]:
        """How far the ends of both ways are from each other, how far that leads on along each of them, and the cosine between these."""
        y = self.s.difference(last.x[:, 1::2], last.x[:, ::2])
        y[self.back] -= self.s.rounds(self.back, y[self.back])
        # of what no passive motion changes, along ways of unit size
        y, t = y[self.settled], self._told(last.x, last.case, last.t[:, None])[:, 0]
        if self.links.size:
            here = self.here(last.x, last.case)
            R, p = here.poses[:, :3, self.links], here.poses[:, 3, self.links]
            turn = multiplied(R[..., 1::2], R[..., ::2].swapaxes(0, 1))
            y = np.concatenate([y, *finite_twist(turn, p[..., 1::2], p[..., ::2])])
        a, b = t[:, ::2], t[:, 1::2]
        size = np.sqrt(np.sqrt((a * a).sum(axis=0) * (b * b).sum(axis=0)))
        y, a, b = y / size, a / size, b / size
        return np.sqrt((y * y).sum(axis=0)), (a * y).sum(axis=0), (b * y).sum(axis=0), (a * b).sum(axis=0)

    def _way(self, a: CircuitNodes, b: CircuitNodes) -> tuple[Array, Array]:
        """Increments ``(F, T)`` between nodes, without passive motions, and lengths of the arcs."""
        y, idle = self.s.difference(b.x, a.x), a.V[:, len(a.S) + 1 :]
        y = y - np.einsum("fkt,gkt,gt->ft", idle, idle, y)
        half = 0.5 * np.arccos(np.clip((a.t * b.t).sum(axis=0), -1.0, 1.0))
        return y, np.sqrt((y * y).sum(axis=0)) / np.sinc(half / np.pi)

    def _between(self, a: CircuitNodes, b: CircuitNodes, part: Array) -> Array:
        """States at parts of the arcs between nodes."""
        y, w = self._way(a, b)
        return self.s.advance(a.x, cubic(y, a.t, self.s.tangent(y, b.t), w, part * w))

    def _whole(self, nodes: CircuitNodes) -> CircuitNodes:
        """The nodes closed to rounding; a circuit that comes back ends with its beginning, whole turns further."""
        places, meets, (nodes, _) = nodes.place, nodes.meets, self.closed(nodes.x, nodes.case, nodes.t)
        nodes.place, nodes.meets = places, meets
        first, last = self._ends(nodes, np.flatnonzero(self.closes))
        begin = nodes.taken(first)
        rows = self.s.single_rows[self.back]
        begin.x[rows] += self.s.rounds(self.back, nodes.x[rows[:, None], last] - begin.x[rows])
        begin.place = nodes.place[last]
        nodes.put(last, begin)
        return nodes

    @staticmethod
    def _ends(nodes: CircuitNodes, case: Index) -> tuple[Index, Index]:
        """Places of the first and the last node of some circuits."""
        return np.searchsorted(nodes.case, case), np.searchsorted(nodes.case, case, side="right") - 1

    def _with_folds(self, nodes: CircuitNodes) -> CircuitNodes:
        """The nodes, with others at folds, between which the driver rises or falls."""
        # times that nodes are put where the rate of the driver vanishes, or is least
        for _ in range(8):
            a, b = self._steps(nodes)
            (_, w), (ra, rb) = self._way(a, b), (n.t[self.column] for n in (a, b))
            rise = (b.x - a.x)[self.row] / np.where(w > 0, w, 1.0)
            B, C = 2.0 * (3.0 * rise - 2.0 * ra - rb), 3.0 * (ra + rb - 2.0 * rise)
            # a rate so small is that of a fold: the driver is off it by its square
            fold = (ra * rb < 0) & (np.minimum(np.abs(ra), np.abs(rb)) > 1e-6)
            least = np.clip(-0.5 * B / np.where(C == 0, 1.0, C), 0.0, 1.0)
            lowest = (ra + least * (B + least * C)) * np.sign(ra)
            dips = (ra * rb > 0) & (lowest < 0.25 * np.minimum(np.abs(ra), np.abs(rb))) & (np.abs(least - 0.5) < 0.45)
            # nodes may lie at one place
            some = np.flatnonzero((fold | dips) & (w > 0))
            if not some.size:
                break
            ra, B, C, a, b = ra[some], B[some], C[some], a.taken(some), b.taken(some)
            bottom = -0.5 * (B + np.copysign(np.sqrt(np.maximum(B * B - 4.0 * C * ra, 0.0)), B))
            one = ra / np.where(bottom == 0, 1.0, bottom)
            other = bottom / np.where(C == 0, 1.0, C)
            part = np.where(fold[some], np.where((one >= 0) & (one <= 1), one, other), least[some])
            more, _ = self.closed(self._between(a, b, part), a.case, a.t + b.t)
            more.place = a.place + part * (b.place - a.place)
            nodes = CircuitNodes.joined([nodes, more])
        return nodes

    def _steps(self, nodes: CircuitNodes) -> tuple[CircuitNodes, CircuitNodes]:
        """Neighbors on the same circuit, of the second one bodies in passive motion as near to those of the first as they come."""
        left = np.flatnonzero(nodes.case[1:] == nodes.case[:-1])
        a, b = nodes.taken(left), nodes.taken(left + 1)
        # a circuit comes back with its passive bodies elsewhere; steps that bring them there
        for _ in range(8 if self.family.idle.shape[1] else 0):
            idle = b.V[:, len(b.S) + 1 :]
            gone = np.einsum("fkt,ft->kt", idle, self.s.difference(a.x, b.x))
            far = np.flatnonzero(np.abs(gone).max(axis=0, initial=0.0) > 0.1)
            if not far.size:
                break
            off, back = b.taken(far), np.einsum("fkt,kt->ft", idle[..., far], gone[:, far])
            new, _ = self.closed(self.s.advance(off.x, back), off.case, a.t[:, far])
            b.put(far, replace(new, place=off.place, meets=off.meets))
        return a, b

    def _unrolled(self, nodes: CircuitNodes) -> CircuitNodes:
        """Closed circuits with folds from the last of these before the first state on, or to the first one behind it, to the same again."""
        a, b = self._steps(nodes)
        rises = np.sign((b.x - a.x)[self.row])
        k = 1 + np.flatnonzero((np.diff(a.case) == 0) & (np.diff(rises) != 0))
        first, last = np.full(self.V, np.inf), np.full(self.V, -np.inf)
        np.minimum.at(first, a.case[k], a.place[k])
        np.maximum.at(last, a.case[k], a.place[k])
        self.turns[np.isfinite(first)] = 0
        up = first <= 0
        begin, end = self._ends(nodes, np.arange(self.V))
        rows, case = self.s.single_rows[self.back], nodes.case
        gained, length = (
            nodes.x[rows[:, None], end] - nodes.x[rows[:, None], begin],
            nodes.place[end] - nodes.place[begin],
        )
        cut, mine = np.where(up, first, last)[case], (self.closes & np.isfinite(first))[case]
        double = mine & (np.arange(len(case)) == end[case])
        moved = mine & ~double & np.where(up[case], nodes.place < cut, nodes.place > cut)
        again, kept = nodes.taken(moved | (mine & (nodes.place == cut))), nodes.taken(~moved & ~double)
        sense = np.where(up, 1.0, -1.0)[again.case]
        again.x[rows] += sense * gained[:, again.case]
        again.place = again.place + sense * length[again.case]
        return CircuitNodes.joined([kept, again])

    def steps_at(self, case: Index, value: Array) -> tuple[Index, Index, Array]:
        """On which steps drivers of mechanisms have some values, but for whole turns; the number of each, and its value there."""
        count = np.bincount(self.a.case, minlength=self.V)
        k = np.repeat(np.arange(len(case)), count[case])
        step = np.arange(len(k)) + np.repeat(
            (np.cumsum(count) - count)[case] - np.cumsum(count[case]) + count[case], count[case]
        )
        on, value = self._crossed(self.a.x[self.row, step], self.b.x[self.row, step], value[k])
        return step[on], k[on], value

    def _crossed(self, a: Array, b: Array, value: Array) -> tuple[Mask, Array]:
        """Which values of the driver, but for whole turns, lie between two others, and what they are there."""
        low, high = np.sort([a, b], axis=0)
        if np.isfinite(self.period):
            value = value + self.period * np.ceil((low - SAME_VALUE - value) / self.period)
        on = (value >= low - SAME_VALUE) & (value <= high + SAME_VALUE)
        return on, value[on]

    def states(self, step: Index, value: Array) -> tuple[Array, Mask]:
        """States on steps between nodes where the driver has some values, and whether they were met there."""
        x, met, left = self.a.x[:, step], np.zeros(len(step), dtype=bool), np.arange(len(step))
        a, b = self.a.taken(step), self.b.taken(step)
        straight = a.leads_to(b)
        # parts at which steps are divided where a circuit nearby is come to instead
        for part in (0.5, 0.25, 0.75, 0.1, 0.9) * 4:
            node, last = self._met(a, b, value[left])
            good = (last < 1e-8) & (node.t[self.column] * self.rises[step[left]] > -1e-6)
            good &= ~straight[left] | (a.leads_to(node) & b.leads_to(node))
            x[:, left[good]], met[left[good]] = node.x[:, good], True
            left, a, b = left[~good], a.taken(~good), b.taken(~good)
            if not left.size:
                break
            middle, last = self.closed(self._between(a, b, np.full(len(left), part)), a.case, a.t + b.t)
            whole = (last < 1e-8) & a.leads_to(middle) & middle.leads_to(b)
            beyond_it = (value[left] - middle.x[self.row]) * self.rises[step[left]] > 0
            for ends_, some in ((a, whole & beyond_it), (b, whole & ~beyond_it)):
                ends_.put(np.flatnonzero(some), middle.taken(some))
        return x, met

    def _met(self, a: CircuitNodes, b: CircuitNodes, value: Array) -> tuple[CircuitNodes, Array]:
        """Nodes next to the arcs between others where the driver has some values, and the last Newton steps."""
        y, w = (b.x - a.x)[self.row], self._way(a, b)[1]
        ra, rb, off = a.t[self.column], b.t[self.column], a.x[self.row] - value
        part = root_between(lambda u: off + cubic(y, ra, rb, w, u * w), len(value))
        return self.closed(self._between(a, b, part), a.case, a.t + b.t, value, a)

    def along(self, run: int, value: Array) -> tuple[Index, Array]:
        """The steps of a branch on which the driver has some values, and the values there, on one that comes back but for its turns."""
        first, last = np.searchsorted(self.run, [run, run + 1]).tolist()
        ends, sense = self.values(run), self.rises[first]
        if turns := self.turns[self.a.case[first]]:
            value = ends[0] + np.mod(value - ends[0], self.period * turns)
        step = np.searchsorted(sense * ends, sense * value) - 1
        return first + np.clip(step, 0, last - first - 1), value

    def values(self, run: int) -> Array:
        """Driver values at the nodes of a branch, one after the other."""
        mine = np.flatnonzero(self.run == run)
        return np.append(self.a.x[self.row, mine], self.b.x[self.row, mine[-1]])

    def placed(
        self, case: Index, x: Array, told: Callable[[Configuration, Index], Array] | None = None
    ) -> tuple[Index, Index, Array, Array]:
        """The steps on which states ``(nx, T)`` of mechanisms lie, the number of each state, driver values and states there.

        ``told`` returns what counts of states, of which numbers are given, where that is not all of them.
        """
        step, k, value = self.steps_at(case, x[self.row])
        y, good = self.states(step, value)
        told = told or (lambda here, _: self.family.prints(here))
        here, there = (told(self.here(z, case[k]), k) for z in (x[:, k], y))
        near = np.abs(there - here).max(axis=0, initial=0.0)
        good &= near < MODES.arrives * np.maximum(1.0, np.abs(here).max(axis=0, initial=0.0))
        return step[good], k[good], value[good], y[:, good]


def in_order(values: Array, period: float) -> Array | None:
    """Driver values ``(n,)`` of a branch, with whole periods such that they rise or fall; None where the driver has to turn back."""
    steps, ways = np.diff(values), []
    if not np.isfinite(period):
        return None if (steps > 0).any() and (steps < 0).any() else values
    for sense in (1.0, -1.0):
        ahead = np.mod(sense * steps, period)
        # a step back by rounding (radians) is none
        ways.append(sense * np.cumsum([0.0, *np.where(period - ahead < 1e-12, 0.0, ahead)]))
    way = min(ways, key=lambda way: abs(way[-1]))
    return values[0] + way if abs(way[-1]) < period else None


def root_between(value: Callable[[Array], Array], n: int) -> Array:
    """Where values ``(n,)`` change their signs between 0 and 1, by bisection to rounding."""
    low, high = np.zeros(n), np.ones(n)
    rises = value(high) >= value(low)
    for _ in range(50):
        middle = 0.5 * (low + high)
        below = (value(middle) < 0) == rises
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))
