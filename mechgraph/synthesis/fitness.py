"""Whether a mechanism can run through the positions that it meets: defects, transmission, sizes.

A position of a mechanism with one driver lies on a curve of positions, its circuit. Where the driver has to turn back the curve folds;
between folds it is a branch, on which the driver moves the mechanism. The circuits of all mechanisms of one topology are followed together,
by their length, to which a fold is a place like any other: by steps along the one motion that the closure leaves, from the first position
both ways until these meet. A step that leads to another circuit, nearby, changes the sign of the bordered Jacobian's determinant. Every
other position is on one of the branches, or on another circuit.

Sources: Chase and Mirth, Circuits and branches of single-degree-of-freedom planar linkages, J. Mech. Des. 115, 1993; Filemon, Useful ranges
of centerpoint curves, Mech. Mach. Theory 7, 1972; Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapter 8.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np

from mechgraph.determinacy.mobility import free_motion
from mechgraph.errors import DeclarationError, MechgraphWarning, did_you_mean, near_names
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.motion_path import FARTHEST
from mechgraph.kinematics.reach import BEYOND_END, beyond
from mechgraph.kinematics.state import CLOSED, Configuration
from mechgraph.kinematics.system import System
from mechgraph.kinetostatics import kinematics, solve, transmission
from mechgraph.maths.newton import cubic
from mechgraph.maths.se3 import Array, Index, Mask, cross
from mechgraph.maths.tolerances import MODES, MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import is_interval, two_ends
from mechgraph.modes.branches import in_order
from mechgraph.modes.family import Family
from mechgraph.quantities import wrong
from mechgraph.variants.numbers import side_by_side
from mechgraph.variants.work import Output, named_outputs, quantity

Defect = Literal["branch", "circuit", "order", "full_turn"]
"""What may be required of a mechanism that runs through positions."""


@dataclass(frozen=True)
class Fitness:
    """What a mechanism is worth that meets positions one after the other.

    Without a driver that alone determines all positions nothing is known of defects, full turn (None) and transmission (NaN).

    Attributes
    ----------
    branch, circuit, order : bool or None
        Defects: positions on another branch than the first one, on another circuit, not in the order in which the driver passes them.
        Where the first one is a dead point the driver leads to no other: a defect of branch, of the others nothing is known.
    full_turn : bool or None
        Whether the driver turns right round on the branch of the first position.
    transmission, transmission_between : float
        Least transmission angle at the positions, and from the first to the last [rad]; NaN where the driver holds no output, at change
        points, or where it does not come to the last.
    size, ratio : float
        Largest distance of two elements of a link; longest over shortest of such distances.
    error : float
        Largest distance from what was asked, in the units of the task.
    """

    branch: bool | None
    circuit: bool | None
    order: bool | None
    full_turn: bool | None
    transmission: Annotated[float, "radians"]
    transmission_between: Annotated[float, "radians"]
    size: float
    ratio: float
    error: float = 0.0

    @property
    def good(self) -> bool:
        """Whether no defect is known; so too without a driver."""
        return not (self.branch or self.circuit or self.order)

    @property
    def words(self) -> str:
        """Defects and transmission, as under a picture."""
        defects = [name for name in ("branch", "circuit", "order") if getattr(self, name)]
        told = f"{' and '.join(defects)} defect" if defects else "good" if self.branch is not None else "no driver"
        return told + (f", {np.rad2deg(self.transmission):.3g} deg" if np.isfinite(self.transmission) else "")

    def lacks(self, wanted: Iterable[Defect]) -> tuple[Defect, ...]:
        """Those of what is wanted (no defect of that name; a full turn) that it falls short of."""
        return tuple(name for name in wanted if getattr(self, name) is not (name == "full_turn"))


@dataclass
class _Nodes:
    """States ``x (nx, T)`` of mechanisms ``case (T,)`` at places along their circuits, and what is known there.

    ``t (F, T)``: the motion, of unit size; ``N (F, k, T)`` all motions, ``U (m, l, T)`` rows that no motion meets, and ``J (m, F, T)``.
    """

    case: Index
    place: Array
    x: Array
    t: Array
    N: Array
    U: Array
    J: Array

    def taken(self, which: Any) -> _Nodes:
        """Some of them."""
        return _Nodes(*(v[..., which] for v in vars(self).values()))

    def put(self, which: Index, new: _Nodes) -> None:
        """Put others in the places of some."""
        for mine, other in zip(vars(self).values(), vars(new).values(), strict=True):
            mine[..., which] = other

    def leads_to(self, other: _Nodes) -> Mask:
        """Whether the bordered Jacobian ``[[J, U], [N^T, 0]]``, with the borders from here, has a determinant of one sign here and there.

        It changes where a step leads from one of two circuits that nearly meet straight on to the other, and where they meet.
        """
        m, F, T = self.J.shape
        B = np.zeros((2, m + self.N.shape[1], F + self.U.shape[1], T))
        B[:, :m, :F], B[:, :m, F:], B[:, m:, :F] = (self.J, other.J), self.U, self.N.swapaxes(0, 1)
        return np.asarray(np.linalg.slogdet(np.moveaxis(B, -1, 1))[0].prod(axis=0) > 0)

    @staticmethod
    def joined(parts: Iterable[_Nodes]) -> _Nodes:
        """All of them, one circuit after the other, in the order of their places."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        out = _Nodes(*(np.concatenate(column, axis=-1) for column in columns))
        return out.taken(np.lexsort((out.place, out.case)))


class _Circuits:
    """The circuits of mechanisms of one topology, cases of a ``system``, each through the first of its states ``x (nx, V, n)``.

    Attributes
    ----------
    branch, value (V, n) : the number of the branch of every state, 0 that of the first one, and the driver value there (internal units,
        turns counted from the first); NaN for states of other circuits.
    turns (V,) : turns of the driver after which the branch of the first one comes back, 0 where it does not.
    """

    def __init__(self, system: System, family: Family, column: int, rank: int, x: Array) -> None:
        self.s, self.family, self.x, self.column, self.rank = system, family, x, column, rank
        self.V, self.n = x.shape[1:]
        self.row, self.period = int(system.single_rows[column]), float(system.periods[column])
        self.settled = np.flatnonzero(np.abs(family.idle).max(axis=1, initial=0.0) < MODES.span)
        self.back = np.flatnonzero((system.single_rows >= 0) & np.isfinite(family.periods))
        self.turns, self.closes = np.zeros(self.V, dtype=np.intp), np.zeros(self.V, dtype=bool)
        points = self.here(x[:, :, 0], np.arange(self.V)).pair_points
        sizes = np.sqrt(((points - points.mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean(axis=0))
        sizes = np.where(sizes > CLOSED, sizes, 1.0)
        # that of the first is the unit of length
        self.size = sizes / sizes[0]
        self.nodes = self._joined(self._followed())
        self._number()
        self._place()

    def here(self, x: Array, case: Index) -> Configuration:
        """Mechanisms at states ``(nx, T)``."""
        return Configuration(self.s.cases(case), x)

    def at(self, x: Array, case: Index) -> tuple[Array, _Nodes]:
        """Least Newton steps ``(F, T)`` at states, and what is known there."""
        here, r = self.here(x, case), self.rank
        J = here.J
        with np.errstate(all="ignore"):
            U, sigma, V = np.linalg.svd(np.nan_to_num(J).transpose(2, 0, 1))
            step = -np.einsum("trf,tmr,mt->ft", V[:, :r], U[:, :, :r] / sigma[:, None, :r], here.residual)
        N = V[:, r:].swapaxes(1, 2)
        if N.shape[2] > 1:
            # passive motions come last: what they do not change moves in one way
            N = N @ np.linalg.svd(N[:, self.settled])[2].swapaxes(1, 2)
        N, U = N.transpose(1, 2, 0), U[:, :, r:].transpose(1, 2, 0)
        return step, _Nodes(case, np.zeros(len(case)), x, N[:, 0].copy(), N.copy(), U.copy(), J)

    def closed(self, x: Array, case: Index, ahead: Array, goal: Array | None = None) -> tuple[_Nodes, Array]:
        """Nodes near states ``(nx, T)``, with motions that lead ``ahead (F, T)``, where the driver has the values of a ``goal (T,)``; and
        the last Newton steps.
        """
        # Newton steps, of which each doubles the digits
        for _ in range(4):
            step, node = self.at(x, case)
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

    def _followed(self) -> list[_Nodes]:
        """Nodes along all circuits, by steps both ways until these meet or end; places count them."""
        s, lengths = self.s, self.s.single_rows[self.s.is_length]
        case, sense = np.repeat(np.arange(self.V), 2), np.tile([1.0, -1.0], self.V)
        _, last = self.at(self.x[:, case, 0], case)
        rate = np.abs(last.t[self.column])
        self.dead = (rate <= MOTIONS.dependent * np.abs(last.t).max(axis=0))[::2]
        last.t *= sense * np.where(last.t[self.column] < 0, -1.0, 1.0)
        goals, turns = self.x[self.row], np.isfinite(self.period)
        # turns of the driver after which a branch may come back, at most
        far = 8 * self.period if turns else np.inf
        low, high = (ends(goals[:, :1] if turns else goals, axis=1)[case] for ends in (np.min, np.max))
        h, wide, going, out = np.full(2 * self.V, 0.1), np.zeros(2 * self.V), ~self.dead[case], list[_Nodes]()
        (before, clear), closing = (last.taken(np.arange(2 * self.V)) for _ in range(2)), np.zeros(self.V, dtype=bool)
        out.append(last.taken(np.arange(0, 2 * self.V, 2)))
        # steps after which a circuit is left open
        for _ in range(3000):
            self._meet(last, h, going, closing)
            at = np.flatnonzero(going)
            if not at.size:
                break
            # what is no longer than this is no gap between circuits: they meet there, and are passed straight on
            leap, here = h[at] < 1e-6, last.taken(at)
            ahead = np.where(leap, 1e-3, h[at])
            dq = here.t * ahead
            known = np.flatnonzero((wide[at] > 0) & ~leap)
            some = before.taken(at[known])
            y, _ = self._way(here.taken(known), some)
            dq[:, known] = cubic(y, here.t[:, known], s.tangent(y, some.t), -wide[at[known]], ahead[known])
            # beside where they meet motions are noise, ways that lead there are not
            y, w = self._way(clear.taken(at[leap]), here.taken(leap))
            dq[:, leap] = np.where(w > 0, 1e-3 / np.where(w > 0, w, 1.0) * y, dq[:, leap])
            x = s.advance(here.x, dq)
            one, _ = self.at(x, here.case)
            two, new = self.at(s.advance(x, one), here.case)
            new.x, new.place = s.advance(new.x, two), here.place + sense[at]
            turn = (new.t * here.t).sum(axis=0)
            new.t *= np.where(turn < 0, -1.0, 1.0)
            size = np.abs(one).max(axis=0)
            good = (size <= np.where(leap, 1e-5, 0.06)) & (np.abs(two).max(axis=0) <= 0.1 * size + 1e-9)
            good &= (np.abs(turn) > 0.8) & np.isfinite(new.x).all(axis=0) & (leap | here.leads_to(new))
            longest = 0.7 * np.maximum(1.0, np.abs(new.x[lengths]).max(axis=0, initial=0.0))
            grown = ahead * np.clip((0.02 / np.maximum(size, 1e-12)) ** 0.25, 0.5, 2.0)
            h[at] = np.where(good, np.minimum(grown, longest), 0.4 * ahead)
            going[at[leap & ~good]] = False
            on, new, here = at[good], new.taken(good), here.taken(good)
            wide[on] = self._way(here, new)[1]
            before.put(on, here)
            clear.put(on[wide[on] > 1e-4], here.taken(wide[on] > 1e-4))
            last.put(on, new)
            out.append(new)
            gone = np.maximum(low - last.x[self.row], last.x[self.row] - high) > far
            gone |= np.abs(last.x[lengths]).max(axis=0, initial=0.0) > FARTHEST
            going &= ~gone & (beyond(s, last.x) <= BEYOND_END).all(axis=0)
        return out

    def _meet(self, last: _Nodes, h: Array, going: Mask, closing: Mask) -> None:
        """See which of both ways come together, and let the first one end at the other."""
        p, m = last.taken(slice(0, None, 2)), last.taken(slice(1, None, 2))
        y = self.s.difference(m.x, p.x)
        y[self.back] -= self.s.rounds(self.back, y[self.back])
        # of what no passive motion changes: the way between both, and how far it leads on along each of unit size
        y, (a, b) = y[self.settled], ((n.t[self.settled]) for n in (p, m))
        size = np.sqrt(np.sqrt((a * a).sum(axis=0) * (b * b).sum(axis=0)))
        y, a, b = y / size, a / size, b / size
        d, ahead, behind = np.sqrt((y * y).sum(axis=0)), (a * y).sum(axis=0), (b * y).sum(axis=0)
        done = closing & going[::2] & (ahead <= 0)
        self.closes |= done
        if np.isfinite(self.period):
            self.turns[done] = np.abs(np.round((p.x - m.x)[self.row, done] / self.period))
        going[::2][done] = False
        near = going[::2] & going[1::2] & (ahead > 0) & (behind < 0) & (d < h[::2] + h[1::2])
        # steps that are short beside what is left still go round a corner, which may lead elsewhere
        met = near & ((a * b).sum(axis=0) < -0.8) & (ahead > 0.9 * d) & (d <= 3.01 * np.minimum(h[::2], h[1::2]))
        met[met] = p.taken(met).leads_to(m.taken(met))
        going[1::2][met], closing[met] = False, True
        # a little more than what is left
        h[::2][closing] = np.minimum(h[::2], d + 2e-6)[closing]
        apart = near & ~met
        for way in (h[::2], h[1::2]):
            way[apart] = np.minimum(way, np.maximum(d / 3.0, 1e-5))[apart]

    def _way(self, a: _Nodes, b: _Nodes) -> tuple[Array, Array]:
        """Increments ``(F, T)`` between nodes, without passive motions, and lengths of the arcs."""
        y, idle = self.s.difference(b.x, a.x), a.N[:, 1:]
        y = y - np.einsum("fkt,gkt,gt->ft", idle, idle, y)
        half = 0.5 * np.arccos(np.clip((a.t * b.t).sum(axis=0), -1.0, 1.0))
        return y, np.sqrt((y * y).sum(axis=0)) / np.sinc(half / np.pi)

    def _between(self, a: _Nodes, b: _Nodes, part: Array) -> Array:
        """States at parts of the arcs between nodes."""
        y, w = self._way(a, b)
        return self.s.advance(a.x, cubic(y, a.t, self.s.tangent(y, b.t), w, part * w))

    def _joined(self, parts: list[_Nodes]) -> _Nodes:
        """All nodes in their order, with others at folds, between which the driver rises or falls."""
        nodes = _Nodes.joined(parts)
        nodes.t[:, nodes.place < 0] *= -1.0
        places, (nodes, _) = nodes.place, self.closed(nodes.x, nodes.case, nodes.t)
        nodes.place = places
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
            some = np.flatnonzero(fold | dips)
            if not some.size:
                break
            ra, B, C, a, b = ra[some], B[some], C[some], a.taken(some), b.taken(some)
            bottom = -0.5 * (B + np.copysign(np.sqrt(np.maximum(B * B - 4.0 * C * ra, 0.0)), B))
            one = ra / np.where(bottom == 0, 1.0, bottom)
            other = bottom / np.where(C == 0, 1.0, C)
            part = np.where(fold[some], np.where((one >= 0) & (one <= 1), one, other), least[some])
            more, _ = self.closed(self._between(a, b, part), a.case, a.t + b.t)
            more.place = a.place + part * (b.place - a.place)
            nodes = _Nodes.joined([nodes, more])
        return nodes

    @staticmethod
    def _steps(nodes: _Nodes) -> tuple[_Nodes, _Nodes]:
        """Neighbors on the same circuit."""
        left = np.flatnonzero(nodes.case[1:] == nodes.case[:-1])
        return nodes.taken(left), nodes.taken(left + 1)

    def _number(self) -> None:
        """Number the branches of all steps between nodes."""
        self.a, self.b = a, b = self._steps(self.nodes)
        self.rises = np.sign((b.x - a.x)[self.row])
        turned = (a.case[1:] == a.case[:-1]) & (self.rises[1:] != self.rises[:-1])
        number = np.append(0, np.cumsum(turned))[: len(a.case)]
        first, folds = np.zeros(self.V, dtype=np.intp), np.zeros(self.V, dtype=np.intp)
        np.add.at(folds, a.case[1:][turned], 1)
        for place in (b.place, a.place):
            at = np.flatnonzero(place == 0)
            first[a.case[at]] = number[at]
        number = number - first[a.case]
        self.turns[folds > 0] = 0
        self.of_branch = np.where(
            self.closes[a.case] & (folds[a.case] > 0), number % np.maximum(folds[a.case], 1), number
        )

    def _place(self) -> None:
        """Find the states on their circuits."""
        case, goal = np.repeat(np.arange(self.V), self.n), self.x.reshape(len(self.x), -1)
        self.branch, self.value = np.full((2, self.V, self.n), np.nan)
        self.branch[:, 0], self.value[:, 0] = 0.0, self.x[self.row, :, 0]
        step, k, value = self._steps_at(case, goal[self.row])
        order = np.argsort(-np.abs(self.of_branch[step]), kind="stable")
        step, k, value = step[order], k[order], value[order]
        x, good = self.states(step, value)
        here, there = (self.family.prints(self.here(y, case[k])) for y in (goal[:, k], x))
        near = np.abs(there - here).max(axis=0, initial=0.0)
        good &= near < MODES.arrives * np.maximum(1.0, np.abs(here).max(axis=0, initial=0.0))
        # of several the one of the lowest number, which comes last
        self.branch.ravel()[k[good]], self.value.ravel()[k[good]] = self.of_branch[step[good]], value[good]

    def _steps_at(self, case: Index, value: Array) -> tuple[Index, Index, Array]:
        """On which steps drivers of mechanisms have some values, but for whole turns; the number of each, and its value there."""
        count = np.bincount(self.a.case, minlength=self.V)
        k = np.repeat(np.arange(len(case)), count[case])
        step = np.arange(len(k)) + np.repeat(
            (np.cumsum(count) - count)[case] - np.cumsum(count[case]) + count[case], count[case]
        )
        # rounding of values of the driver (radians, or lengths over L)
        slip, value = 1e-9, value[k]
        low, high = np.sort([self.a.x[self.row, step], self.b.x[self.row, step]], axis=0)
        if np.isfinite(self.period):
            value = value + self.period * np.ceil((low - slip - value) / self.period)
        on = (value >= low - slip) & (value <= high + slip)
        return step[on], k[on], value[on]

    def states(self, step: Index, value: Array) -> tuple[Array, Mask]:
        """States on steps between nodes where the driver has some values, and whether they were met there."""
        x, met, left = self.a.x[:, step], np.zeros(len(step), dtype=bool), np.arange(len(step))
        a, b = self.a.taken(step), self.b.taken(step)
        straight = a.leads_to(b)
        # parts at which steps are divided where a circuit nearby is come to instead
        for part in (0.5, 0.25, 0.75, 0.1, 0.9) * 4:
            node, last = self._met(a, b, value[left])
            good = (last < 1e-8) & (node.t[self.column] * self.rises[step[left]] > -1e-6)
            good &= ~straight[left] | (a.leads_to(node) & node.leads_to(b))
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

    def _met(self, a: _Nodes, b: _Nodes, value: Array) -> tuple[_Nodes, Array]:
        """Nodes next to the arcs between others where the driver has some values, and the last Newton steps."""
        y, w = (b.x - a.x)[self.row], self._way(a, b)[1]
        ra, rb, off = a.t[self.column], b.t[self.column], a.x[self.row] - value
        part = _root(lambda u: off + cubic(y, ra, rb, w, u * w), len(value))
        return self.closed(self._between(a, b, part), a.case, a.t + b.t, value)

    def along(self, case: Index, value: Array) -> tuple[Array, Mask]:
        """States on the branches of the first states where the driver has some values."""
        step, k, at = self._steps_at(case, value)
        turns = (at - value[k]) / self.period
        first = (
            np.where(self.turns[case[k]] > 0, np.round(turns) % np.maximum(self.turns[case[k]], 1), np.round(turns))
            == 0
        )
        on = np.flatnonzero((self.of_branch[step] == 0) & first)
        every, one = np.unique(k[on], return_index=True)
        x, met = np.repeat(self.x[:, case, 0], 1, axis=1), np.zeros(len(case), dtype=bool)
        x[:, every], met[every] = self.states(step[on[one]], at[on[one]])
        return x, met


def _root(value: Callable[[Array], Array], n: int) -> Array:
    """Where values change their signs between 0 and 1, by bisection to rounding."""
    low, high = np.zeros(n), np.ones(n)
    rises = value(high) >= value(low)
    for _ in range(50):
        middle = 0.5 * (low + high)
        below = (value(middle) < 0) == rises
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def fitnesses(
    mechanisms: Sequence[Mechanism],
    q: Array,
    driver: str | None = None,
    output: str | None = None,
    errors: Sequence[float] = (),
) -> list[Fitness]:
    """Fitness of mechanisms of one topology that meet positions with coordinates ``q (V, n, F)``; the start of each is its first.

    ``driver`` and ``output`` are freedoms; without a driver nothing is said of defects and transmission, without an output that freedom at
    the frame counts that is moved worst.
    """
    each = zip(mechanisms, errors or [0.0] * len(mechanisms), strict=True)
    out = [Fitness(None, None, None, None, np.nan, np.nan, *sizes(m), error) for m, error in each]
    if driver is None or not out:
        return out
    m, V = mechanisms[0], len(out)
    driver = m.full_name(driver)
    outputs = [m.full_name(output)] if output else frame_outputs(m, driver)
    base = closed_start(m.replace(drives=[driver], start=dict(zip(m.freedom_names(), q[0, 0].tolist(), strict=True))))
    s, par = base.system, base.system.par
    columns = s.columns_of([driver])
    passive = [motion.rates for motion in free_motion(s, base.x[:, 0], columns).passive]
    numbers = side_by_side(mechanisms).parameters(m, par.offset, par.origin, par.L)
    # one array with all of them says how many there are
    s = s.with_parameters(replace(numbers, mass=np.broadcast_to(numbers.mass, (len(m.links), V))))
    x, case = s.state_of(q.reshape(-1, q.shape[2]).T), np.repeat(np.arange(V), q.shape[1])
    rows = Configuration(s.cases(case), x)
    sigma = np.linalg.svd(rows.J.transpose(2, 0, 1), compute_uv=False)
    rank = int((sigma > MODES.generic * sigma[:, :1]).sum(axis=1).max())
    if s.n_freedoms - rank - len(passive) != 1:
        return out
    idle = np.array(passive).reshape(-1, s.n_freedoms).T
    of = _Circuits(s, Family(base, columns, idle), int(columns[0]), rank, x.reshape(-1, *q.shape[:2]))
    angles = partial(_transmitted, of, mechanisms, driver, outputs)
    at = angles(rows, case, np.arange(len(case))).reshape(q.shape[:2]).min(axis=1) if outputs else np.full(V, np.nan)
    branch, circuit = (of.branch != 0).any(axis=1), np.isnan(of.branch).any(axis=1)
    periods = np.where(of.turns > 0, of.turns, np.inf) * of.period
    ways = [None if branch[v] else in_order(of.value[v], float(periods[v])) for v in range(V)]
    good, between = np.array([v for v in range(V) if ways[v] is not None], dtype=np.intp), np.full(V, np.nan)
    if good.size and outputs:
        low, high = np.sort([way[[0, -1]] for way in ways if way is not None], axis=1).T
        between[good] = np.minimum(at[good], _least_between(of, good, low, high, angles))
    full_turn = (of.turns > 0) & m.turns(driver)
    for v, (one, dead, off, apart, turns) in enumerate(
        zip(out, *(np.asarray(told).tolist() for told in (of.dead, branch, circuit, full_turn)), strict=True)
    ):
        known = Fitness(
            off, apart, not off and ways[v] is None, turns, float(at[v]), float(between[v]), one.size, one.ratio
        )
        out[v] = replace(one, branch=True) if dead else replace(known, error=one.error)
    return out


def _least_between(
    of: _Circuits, cases: Index, low: Array, high: Array, angles: Callable[[Configuration, Index, Index], Array]
) -> Array:
    """Least ``angles (n,)`` of some mechanisms between driver values on the branches of their first states; NaN where not all are met."""
    least = np.full(of.V, np.inf)
    # samples, and all nodes, which are dense where circuits nearly meet; the least value lies between the neighbors of a low one
    case, places = of.a.case[of.of_branch == 0], of.a.x[of.row, of.of_branch == 0]
    some = np.flatnonzero(np.isin(case, cases))
    k = np.searchsorted(cases, case[some])
    some = some[(places[some] > low[k]) & (places[some] < high[k])]
    own = np.append(np.repeat(cases, 91), case[some])
    values = np.append(np.linspace(low, high, 91, axis=1), places[some])
    for _ in range(3):
        if not own.size:
            break
        order = np.lexsort((values, own))
        own, values = own[order], values[order]
        there, met = of.along(own, values)
        found = np.where(met, angles(of.here(there, own), own, own), np.nan)
        # what is not known stays so
        with np.errstate(invalid="ignore"):
            np.minimum.at(least, own, found)
        # of two dips the lower one may be the sharper one
        before, behind = (np.clip(np.arange(len(own)) + i, 0, len(own) - 1) for i in (-1, 1))
        before, behind = (np.where(own[at] == own, at, np.arange(len(own))) for at in (before, behind))
        dips = (found <= found[before]) & (found <= found[behind]) & (found <= 8.0 * least[own])
        own, values = (
            np.repeat(own[dips], 45),
            np.linspace(values[before[dips]], values[behind[dips]], 45, axis=1).ravel(),
        )
    return least[cases]


def _transmitted(
    of: _Circuits,
    mechanisms: Sequence[Mechanism],
    driver: str,
    outputs: list[str],
    here: Configuration,
    case: Index,
    run: Index,
) -> Array:
    """Least transmission angles to ``outputs`` at states ``(T,)``, as ``kinetostatics.transmission`` defines them; NaN where a driver
    holds nothing. States of a ``run`` lie on one branch.
    """
    m, out = mechanisms[0], np.full((len(outputs), here.T), np.nan)
    if any(c.steps for c in m.couplings) or any(pair.type.touching for pair in m.pairs):
        # forces act along lines of gears, and at points that move
        names, q = m.freedom_names(), here.system.coordinates_of(here.x)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            for at in (np.flatnonzero(run == k) for k in dict.fromkeys(run.tolist())):
                start = dict(zip(names, q[:, at[0]].tolist(), strict=True))
                one = mechanisms[case[at[0]]].replace(drives=[driver], start=start)
                held = kinematics(one, {driver: q[names.index(driver), at]}, on_reach="flag")
                out[:, at] = [transmission(held, name).transmission_angle for name in outputs]
        return np.asarray(out.min(axis=0))
    s, r, free = here.system, of.rank, np.delete(np.arange(here.system.n_freedoms), of.column)
    U, sigma, V = np.linalg.svd(here.J[:, free].transpose(2, 1, 0))
    sigma = np.where(sigma[:, r - 1 : r] > MODES.generic * sigma[:, :1], sigma[:, :r], np.nan)
    for i, output in enumerate(s.columns_of(outputs).tolist()):
        # multipliers of the closure with a unit effort in the output, and self-stresses; least forces, and moments over the size
        loaded = U[:, np.searchsorted(free, output), :r] / sigma
        every = np.concatenate([loaded[:, None] @ V[:, :r], V[:, r:]], axis=1)
        w, p = here.pair_wrenches(every.transpose(2, 1, 0)), here.pair_points
        reactions = w.copy()
        for f in (of.column, output):
            own = reactions[:, s.pair_of_freedom[f]]
            own -= here.E[:, f, None] * (here.S[:, f, None] * own).sum(axis=0)
        for wrenches in (w, reactions):
            wrenches[:3] -= cross(p[:, :, None], wrenches[3:])
        reactions[:3] /= of.size[case]
        least = np.nan_to_num(reactions.transpose(3, 0, 1, 2).reshape(here.T, -1, w.shape[2]))
        y = np.linalg.pinv(least[:, :, 1:]) @ least[:, :, :1]
        guide = int(s.pair_of_freedom[output])
        link = s.a[guide] if s.b[guide] == s.graph.frame else s.b[guide]
        pairs = np.flatnonzero(((s.a == link) | (s.b == link)) & (np.arange(len(s.a)) != guide))
        w = (w[:, :, 0] - np.einsum("cpst,ts->cpt", w[:, :, 1:], y[..., 0]))[:, pairs]
        turn = np.broadcast_to(here.S[:3, [output]], w[:3].shape)
        rates = np.concatenate([turn, here.S[3:, [output]] + cross(turn, p[:, pairs])])
        does = (np.where(s.b[pairs] == link, 1.0, -1.0)[:, None] * (w * rates).sum(axis=0)).sum(axis=0)
        w, rates = (np.linalg.norm(v.reshape(2, 3, *v.shape[1:]), axis=1) for v in (w, rates))
        could = (w * rates).sum(axis=(0, 1))
        # what wrenches on the output could do for a unit effort, below which nothing is transmitted
        out[i] = np.arcsin(np.minimum(np.abs(does) / np.where(could > 1e-12, could, np.nan), 1.0))
    return np.asarray(out.min(axis=0))


class Measure:
    """A quantity of a mechanism that meets positions: ``size``, ``ratio``, ``transmission D``, an output of ``study``, or a function.

    It is taken at the positions, or ``over`` driver values, freedom -> values.
    """

    def __init__(self, m: Mechanism, what: Output, over: Mapping[str, Any] | None = None) -> None:
        self.what, self.over = what, over
        self.of_dimensions = what in ("size", "ratio")
        self.output = what.removeprefix("transmission ") if isinstance(what, str) and "transmission " in what else None
        if self.output is not None and (fault := m.freedom_fault(self.output, single=True)):
            raise DeclarationError(f"synthesis of {m.name!r}", [f"{what!r}: {fault}"])
        if not self.of_dimensions and self.output is None:
            try:
                named_outputs(m, {str(what): what}, ())
            except DeclarationError as error:
                own = ("size", "ratio", *(f"transmission {name}" for name in m.freedom_names()))
                faults = [
                    f"{one}; {hint}" if (hint := did_you_mean(near_names(str(what), own))) else one
                    for one in error.faults
                ]
                raise DeclarationError(f"synthesis of {m.name!r}", faults) from None

    def __call__(self, m: Mechanism, q: Array, driver: str | None, smooth: bool = False) -> Array:
        """Its values ``(k,)`` of a mechanism at positions ``q (n, F)``, NaN where the driver does not lead to one.

        ``smooth`` asks for smooth functions of the dimensions of which it is the largest one.
        """
        if self.of_dimensions and smooth:
            lengths = distances(m)
            return lengths if self.what == "size" else np.divide.outer(lengths, lengths).ravel()
        if self.of_dimensions:
            return np.array([sizes(m)[self.what == "ratio"]])
        names = m.freedom_names()
        m = m.replace(start=dict(zip(names, q[0].tolist(), strict=True)))
        motions = self.over or ({} if driver is None else {driver: q[:, names.index(m.full_name(driver))]})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            s = solve(m, motions, on_reach="flag")
            if self.output is not None:
                return transmission(s, self.output).transmission_angle.ravel()
            return np.asarray(
                self.what(s) if callable(self.what) else quantity(s, self.what, self.what), dtype=float
            ).ravel()


def limits_of(
    m: Mechanism, conditions: Any, over: Mapping[str, Any] | None, faults: list[str]
) -> list[tuple[str, Measure, float | None, float | None]]:
    """Conditions as quantities with their least and greatest values; what is wrong is put to ``faults``."""
    out = []
    items = conditions.items() if isinstance(conditions, Mapping) else ()
    if not isinstance(conditions, Mapping | None):
        faults.append(wrong(conditions, "conditions", "a mapping quantity -> (least, greatest)"))
    for what, ends in items:
        if not is_interval(two_ends(ends)):
            faults.append(wrong(ends, f"conditions[{what!r}]", "(least, greatest), None for no end"))
            continue
        least, most = (None if np.isinf(end) else end for end in two_ends(ends))
        try:
            out.append((getattr(what, "__name__", str(what)), Measure(m, what, over), least, most))
        except DeclarationError as error:
            faults += error.faults
    return out


def keeps(values: Array, least: float | None, most: float | None) -> bool:
    """Whether all values lie between limits, but for the accuracy of an optimizer; no value that is none does."""
    slip = 1e-6 * max([1.0, *(abs(end) for end in (least, most) if end is not None and np.isfinite(end))])
    return bool(
        np.isfinite(values).all()
        and (least is None or (values >= least - slip).all())
        and (most is None or (values <= most + slip).all())
    )


def frame_outputs(m: Mechanism, driver: str) -> list[str]:
    """The freedoms that a driver moves at the frame: those of pairs with one freedom beside its own."""
    at_frame = [p for p in m.pairs if m.frame in (p.a, p.b) and p.type.f == 1]
    return [name for p in at_frame if (name := p.freedom_names[0]) != driver]


def distances(m: Mechanism) -> Array:
    """Distances of two elements of a link (points of its pairs, named points), of all links; elements at one place left out."""
    at: dict[str, list[Array]] = {link.name: [np.asarray(p) for p in link.points.values()] for link in m.links}
    for pair in m.pairs:
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True):
            at[link].append(np.asarray(marker.point))
    lengths = np.array([np.linalg.norm(a - b) for points in at.values() for a, b in combinations(points, 2)])
    # elements nearer to each other, as part of the longest distance, are at one place
    return lengths[lengths > 1e-9 * lengths.max(initial=0.0)]


def sizes(m: Mechanism) -> tuple[float, float]:
    """The largest of all distances, and its ratio to the least one; NaN where there are none."""
    lengths = distances(m)
    longest = float(lengths.max(initial=0.0))
    return longest, longest / float(lengths.min(initial=np.inf)) if lengths.size else np.nan
