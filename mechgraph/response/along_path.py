"""Stages along a path, for mobility 1.

Loads along a path: what depends on the place alone is tabulated, other laws of place, rate and time are asked for one state.

At a rate ``u'`` of the path's coordinate a freedom has the rate ``z(u) u'`` and a link the twist ``V(u) u'``; a load that exerts the
force ``F`` on a link and the effort ``e`` in a freedom has the generalized force ``V . F + z e``. A law, a table or a function reads a few
tabulated values, as ``model.load_base.LoadSite`` says, and no loop is closed for it.

A path followed one way from a closed state and tabulated: closed states and the terms of its equation of motion, place by place.

Places are distances of the coordinate from the start. Change points are leapt over where that can be proved (see
``maths.singular_point``), and otherwise passed by the careful march, or the table ends. Where the compiled kernel serves, it follows the
path between them and evaluates the terms.

Stages along a path, for mobility 1: what the equation of motion needs is tabulated once along the path, which is then cheap to follow.

On the path every state is a function of one coordinate ``u``, that of the freedom which moves fastest, and

    (M(u) u'^2 / 2)' = Q(u, u', t) u',    Q = Q_0(u) + P_1(u) + P_2(u) u' + F(u, u', t)

with ``F`` of the loads that are no smooth function of the place, linear in the rates: laws, tables and functions (see ``along_terms``);
and with the rate ``w = sqrt(M / M_0) u'``, in which the mass is that at the start, M_0,

    u' = w / sqrt(M / M_0),    w' = Q / sqrt(M M_0).

No derivative of the mass is needed, which is the accelerations of the mechanism: beside a change point these magnify rounding by the
cube of the distance, rates by the square.

The path is followed by the follower that kinetostatics uses, so that change points are passed on the branch of continuous velocity,
with certificates. In pieces of the path the terms are Chebyshev series.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.force.loads import NOT_FINITE, Site, user_twists
from mechgraph.kinematics.motion_path import DriverPath
from mechgraph.kinematics.solver import closure_rank, closure_solver
from mechgraph.kinematics.state import Configuration, FactoredClosure, user_poses
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import chebyshev
from mechgraph.maths.newton import Interpolation, Nodes, Paths
from mechgraph.maths.se3 import Array, Index, cross, rotate
from mechgraph.maths.singular_point import WINDOW, Crossing, leapt, passed
from mechgraph.maths.tolerances import PATH, RESPONSE
from mechgraph.maths.tracker import End, Follower
from mechgraph.memo import dataclass
from mechgraph.model.loads import Load
from mechgraph.outcome import COMPILED
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import ClosedChart, KernelPath, Loads, Stopped, along_one

OF_LOADS = 4
"""Tabulated terms of the loads that depend on the place, and on rates linearly: see ``along_one``."""
VALUES_OF_FREEDOM, VALUES_OF_LINK = 2, 18
"""Tabulated values of a freedom, ``q`` and ``z``, and of a link, its pose ``(3, 4)`` and ``V``; in the user's units."""


class AlongTerms:
    """What is tabulated for loads along a path of one coordinate, and what the other loads do there."""

    def __init__(self, system: System, loads: Loads) -> None:
        self.system, m = system, system.m
        parts = [loads.stored, loads.rest]
        stored, rest = (tuple(load for load in some if load.smooth) for some in parts)
        self.smooth = Loads(stored, rest)
        self.stored, self.rest = (tuple(load for load in some if not load.smooth) for some in parts)
        others = (*self.stored, *self.rest)
        named = dict.fromkeys(name for load in others for name in load.freedoms)
        self.columns = {name: i for i, name in enumerate(named)}
        links = dict.fromkeys(
            link for load in others if load.in_freedom is None or not load.by_position for link in load.links(m)
        )
        self.links = {name: len(self.columns) * VALUES_OF_FREEDOM + i * VALUES_OF_LINK for i, name in enumerate(links)}
        self._columns = system.columns_of(self.columns)
        self._links = [m.link_index[name] for name in self.links]
        L, lengths = system.par.L, system.is_length[self._columns]
        unit = np.where(lengths, L, 1.0)
        of_link = np.ones((VALUES_OF_LINK, len(self.links)))
        of_link[[3, 7, 11, 15, 16, 17]] = L
        self.sizes = np.concatenate([np.repeat(unit, VALUES_OF_FREEDOM), of_link.T.ravel()])
        """The units of the values behind the first terms."""

    def tabulated(self, here: Configuration, f: FactoredClosure) -> Array:
        """All terms ``(OF_LOADS + m, T)`` at closed states."""
        Z = f.sensitivity()[:, 0]
        s, columns = self.system, self._columns
        unit = np.where(s.is_length[columns], s.par.L, 1.0)[:, None]
        freedoms = np.stack([s.coordinates_of(here.x)[columns], unit * Z[columns]], axis=1)
        poses = user_poses(here)[self._links, :, :3].transpose(0, 2, 3, 1).reshape(-1, 12, here.T)
        twists = user_twists(here, here.link_twists(Z))[:, self._links].transpose(1, 0, 2)
        links = np.concatenate([poses, twists], axis=1)
        more = np.concatenate([freedoms.reshape(-1, here.T), links.reshape(-1, here.T)]) / self.sizes[:, None]
        return np.concatenate([along_one(here, f, self.smooth), more])

    def after_turns(self, advance: Array, turns: float) -> Array:
        """What the values behind the first terms have grown by after turns in which the state advances ``(nx,)``."""
        s, out = self.system, np.zeros(len(self.sizes))
        rows = s.single_rows[self._columns]
        moved = np.where(rows >= 0, advance[rows], 0.0) * np.where(s.is_length[self._columns], s.par.L, 1.0)
        out[: len(rows) * VALUES_OF_FREEDOM : VALUES_OF_FREEDOM] = turns * moved
        return out

    def forces(self, values: Array, rate: Array | float, t: Array) -> tuple[Array, Array]:
        """Generalized forces ``(T,)`` of the other loads, stored and not, at times ``(T,)``; internal units.

        ``values``: of one place ``(m,)``, or ``(m, T)`` with a rate each.
        """
        stored, rest = (
            _AlongSite(self, values, rate, t).collected(some) if some else np.zeros(len(t))
            for some in (self.stored, self.rest)
        )
        return stored, rest


class _AlongSite(Site):
    """What loads see at places of a path at times ``(T,)``, about the global origin; ``found`` is their power for a unit rate."""

    def __init__(self, terms: AlongTerms, values: Array, rate: Array | float, t: Array) -> None:
        self.m, self.L = terms.system.m, terms.system.par.L
        self.terms, self.rate, self.t = terms, rate, t
        self.batch, self.good = (len(t),), np.arange(len(t))
        self.tabulated = values
        self.found = np.zeros(len(t))

    def collected(self, loads: Iterable[Load]) -> Array:
        """The generalized force ``(T,)``."""
        for load in loads:
            load.act(self)
            if not np.isfinite(self.found).all():
                raise DeclarationError(f"load {load.where.removesuffix(': ')}", [NOT_FINITE])
        return self.found / self.L**2

    def _of_link(self, link: str) -> tuple[Array, Array]:
        """Pose ``(3, 4, 1 or T)`` and unit twist ``(6, 1 or T)``."""
        at = self.terms.links[link]
        values = self.tabulated[at : at + VALUES_OF_LINK].reshape(VALUES_OF_LINK, -1)
        return values[:12].reshape(3, 4, -1), values[12:]

    def _of_freedom(self, name: str) -> tuple[Any, Any]:
        at = VALUES_OF_FREEDOM * self.terms.columns[name]
        return self.tabulated[at], self.tabulated[at + 1]

    def rotation(self, link: str) -> Array:
        """See ``LoadSite``."""
        return self._spread(self._of_link(link)[0][:, :3])

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """See ``LoadSite``."""
        X, V = self._of_link(link)
        local = np.asarray(self.m.link(link).point(p) if isinstance(p, str) else p, dtype=float).reshape(3, -1)
        at = rotate(X[:, :3], local) + X[:, 3]
        return self._spread(at), self._spread(self.rate * (V[3:] + cross(V[:3], at)))

    def center(self, link: str) -> Any:
        """See ``LoadSite``."""
        return self.m.link(link).center

    def motion_of(self, link: str) -> tuple[Array, Array]:
        """See ``Site``."""
        X, V = self._of_link(link)
        pose = np.broadcast_to(np.eye(4), (*self.batch, 4, 4)).copy()
        pose[:, :3] = np.moveaxis(X, -1, 0)
        return pose, self._spread(self.rate * V).T

    def _spread(self, value: Array) -> Array:
        return np.broadcast_to(value, (*value.shape[:-1], *self.batch))

    def freedom(self, name: str) -> tuple[Array, Array]:
        """See ``LoadSite``."""
        q, z = self._of_freedom(name)
        return np.full(self.batch, q), np.full(self.batch, z * self.rate)

    def add_force(self, link: str, force: Array, at: Array) -> None:
        """See ``LoadSite``."""
        V = self._of_link(link)[1]
        self.found = self.found + ((V[3:] + cross(V[:3], at)) * force).sum(axis=0)

    def add_couple(self, link: str, moment: Array) -> None:
        """See ``LoadSite``."""
        self.found = self.found + (self._of_link(link)[1][:3] * moment).sum(axis=0)

    def add_effort(self, name: str, effort: Array) -> None:
        """See ``LoadSite``."""
        self.found = self.found + self._of_freedom(name)[1] * effort


POINTS = 16
"""Points of a series; even, so that none lies in the middle."""


@dataclass(frozen=True)
class SeriesPiece:
    """The path between two values of its coordinate: Chebyshev series ``(POINTS, 4 + m)`` of the terms (see ``along_terms``).

    ``steepness``: the largest rate of another freedom for a unit rate of the coordinate.
    """

    begin: float
    end: float
    series: Array
    steepness: float


class Way:
    """The path from a closed state ``x (nx,)`` on; tabulated up to ``length``, and no further where it is ``closed``."""

    def __init__(
        self, path: DriverPath, terms: AlongTerms, x: Array, sense: float, kernel: KernelPath | None = None
    ) -> None:
        self.path, self.terms, self.sense, self.kernel = path, terms, sense, kernel
        self.begin = float(x[path.rows[0]])
        path.variant_of = np.zeros(1, dtype=np.intp)
        self.follower = Follower(path)
        self.length, self.closed = 0.0, False
        self.crossings: list[Crossing] = []
        # length of path that is tabulated first (radians, or lengths / L); every further part is twice as long as the one before
        self._next, self._ended = 0.8, False
        self.pieces: list[SeriesPiece] = []
        self._starts: list[float] = []
        self._roots: list[Array] = []
        self._metrics = [0.0]
        here = Paths([self._drives(np.zeros(2))])
        self._nodes = self.follower.follow(x[:, None], here).nodes

    def __getstate__(self) -> dict[str, Any]:
        """Without the kernel, a thing of this process: numpy tabulates what is asked for later."""
        return vars(self) | {"kernel": None}

    def piece(self, at: float) -> SeriesPiece:
        """The piece in which a place lies."""
        return self.pieces[max(0, bisect_right(self._starts, at) - 1)]

    def number(self, at: float) -> float:
        """How many pieces lie before a place, in parts of the last."""
        if not self.pieces:
            return 0.0
        k = max(0, bisect_right(self._starts, at) - 1)
        return k + (at - self._starts[k]) / abs(self.pieces[k].end - self.pieces[k].begin)

    def metric(self, at: float) -> float:
        """The integral of the root of the mass up to a place."""
        for p in self.pieces[len(self._roots) :]:
            root = _TO_SERIES @ np.sqrt(np.maximum(_VALUES @ p.series[:, 0], 0.0))
            self._roots.append(np.asarray(0.5 * abs(p.end - p.begin) * np.polynomial.chebyshev.chebint(root, lbnd=-1)))
            self._metrics.append(self._metrics[-1] + float(self._roots[-1].sum()))
        k = max(0, bisect_right(self._starts, at) - 1)
        z = 2.0 * (self.number(at) - k) - 1.0
        return self._metrics[k] + float(np.cos(_ORDERS * math.acos(min(1.0, max(-1.0, z)))) @ self._roots[k])

    def extend(self, most: float) -> None:
        """Tabulate the next part, up to ``most`` at first; further than asked for where the kernel leads there."""
        place, beside = min(self.length + self._next, most), RESPONSE.around_crossing / 2
        if self.kernel is not None:
            far = min(self.length + max(self._next, FURTHEST / 2), most)
            self._take(self._led(self.kernel, far + beside), [])
            place = far if self._reached >= far + beside else max(place, self._reached - 2.0 * beside)
        self._next *= 2.0
        self._follow(place + beside)
        # a part does not end beside a change point
        while near := [c.place for c in self.crossings if abs(place - c.place) < beside - RESPONSE.at_crossing]:
            place = max(near) + beside
            self._follow(place + beside)
        known = self._known()
        self.closed = place > known
        place = min(place, known)
        self._interpolation = Interpolation(self.path, self._nodes)
        if place > self.length:
            pieces = self._tabulated(self.length, place)
            self.pieces += pieces
            self._starts += [self.sense * (p.begin - self.begin) for p in pieces]
            self.length = place

    # --- following -------------------------------------------------------------------------------------------------------

    def _follow(self, goal: float) -> None:
        """Follow the path to a place, or to where it cannot be followed on."""
        there = goal - PATH.shortest  # by rounding the last node may lie before the goal
        while not self._ended and self._reached < there:
            begin = self._reached
            self._take(self._march(goal, careful=False) if self.kernel is None else self._led(self.kernel, goal), [])
            if self._reached >= there or self._known() < self._reached:
                return
            if self.kernel is not None and self._reached > begin:
                continue
            self.follower.paths = Paths([self._drives(np.array([0.0, goal]))])
            found = leapt(self.follower, self._nodes)
            if found is not None:
                self._take(found[1], [found[0]])
                continue
            start = self._reached
            nodes = self._march(goal, careful=True)
            places = [start + at for _, at in self.follower.crossings]
            self._ended = self.follower.ends[0] is not End.REACHED
            self._take(nodes, [])
            self.follower.paths = Paths([self._drives(np.array([0.0, goal]))])
            across = [passed(self.follower, self._nodes, 0, at) for at in places]
            self.crossings += [crossing for crossing in across if crossing is not None]

    def _march(self, goal: float, careful: bool) -> Nodes:
        """Nodes from the last one on."""
        last = self._nodes.take(np.array([-1]))
        # first step where the path is taken up again
        start, first = float(last.place[0]), 0.1 if len(self._nodes) > 1 else PATH.first
        paths = Paths([self._drives(np.array([start, goal]))])
        found = self.follower.follow(last.x, paths, first, last.which, careful).nodes
        return replace(found, place=start + found.place)

    def _led(self, kernel: KernelPath, goal: float) -> Nodes:
        """Nodes from the last one on by the kernel, up to where the form of the equations there serves no more."""
        last = self._nodes.take(np.array([-1]))
        at, x = kernel.nodes(last.x[:, 0], float(self._drives(np.array([goal]))[0, 0]))
        if not at.size:
            return last.take(np.zeros(0, dtype=np.intp))
        at += last.place
        track, drive = np.zeros(len(at), dtype=np.intp), self._drives(at)
        found = self.follower.newton.nodes(x, drive, track, np.repeat(last.which, len(at)), PATH.node)
        same = found.done & (found.which == last.which) & (found.correction <= PATH.node)
        poor = ~(found.condition <= PATH.fair)
        serves = np.cumsum(np.concatenate([[False], poor])[:-1] | ~same) == 0
        nodes = Nodes.closed(found, drive, track, at, sure=True).take(serves)
        renewed = self.follower.renewed(nodes)
        return Nodes.join([nodes, renewed.take(renewed.which != nodes.which)])

    def _take(self, nodes: Nodes, crossings: list[Crossing]) -> None:
        """Add nodes, without another one of the form and place of the last, and crossings."""
        last = self._nodes.take(np.array([-1]))
        new = (nodes.place > last.place) | (nodes.which != last.which)
        self._nodes = Nodes.join([self._nodes, nodes.take(new)])
        self.crossings += crossings

    def _drives(self, at: Array) -> Array:
        """Values ``(1, n)`` of the coordinate at places."""
        return np.asarray(self.begin + self.sense * at[None])

    @property
    def _reached(self) -> float:
        return float(self._nodes.place[-1])

    def _known(self) -> float:
        """How far the coordinate serves: to before the first node at which another freedom moves much faster."""
        nodes, singles = self._nodes, self.path.system.single_rows >= 0
        near = np.array([np.abs(nodes.place - c.place) < RESPONSE.at_crossing for c in self.crossings]).any(axis=0)
        # rate of another freedom against that of the coordinate at which the table ends
        steep = np.flatnonzero((np.abs(nodes.Z[singles]).max(axis=(0, 1)) > 6.0) & ~near)
        return float(nodes.place[max(int(steep[0]) - 1, 0)]) if steep.size else self._reached

    # --- tabulating ------------------------------------------------------------------------------------------------------

    def states(self, at: Array) -> tuple[Array, Index]:
        """Closed states ``(nx, T)`` at places ``(T,)``, and their forms."""
        x, u, step = self._predicted(at)
        which = self._nodes.which[self._interpolation.left[step]]
        closed = None if self.kernel is None or self._beside_crossings(at) else self.kernel.closed(x, u[0])
        if closed is not None:
            return closed[0], which
        found = self.follower.newton.close(x, u, np.zeros(len(at), dtype=np.intp), which)
        x = found.x.copy()
        for c in self.crossings:
            near = np.abs(at - c.place) < WINDOW
            x[:, near] = c.states(at[near])
        return x, found.which

    def _predicted(self, at: Array) -> tuple[Array, Array, Index]:
        """States ``(nx, T)`` interpolated at places ``(T,)``, path values ``(1, T)`` there and the steps in which they lie."""
        u, step = self._drives(at), self._interpolation.find(np.zeros(len(at), dtype=np.intp), at)
        return self._interpolation(step, at, u), u, step

    def _beside_crossings(self, at: Array) -> bool:
        """Whether a place ``(T,)`` is so near to a change point that its state is interpolated."""
        return any((np.abs(at - c.place) < WINDOW).any() for c in self.crossings)

    def _tabulated(self, begin: float, end: float) -> list[SeriesPiece]:
        """Pieces between two places with their series, halved until these have converged."""
        spans, out = self._spans(begin, end), []
        middles = np.array([c.place for c in self.crossings])
        while spans:
            again = []
            for (a, b), c, steepness, noise in zip(spans, *self._series(spans), strict=True):
                # shortest piece: where branches all but cross, a path turns from one towards the other within the root of what opens
                # the crossing
                if (
                    (_coarse(c, noise) or b - a > POINTS * self._step(a, b))
                    and b - a > 1e-8
                    and not (np.abs(middles - 0.5 * (a + b)) < 0.25 * (b - a)).any()
                ):
                    again += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
                else:
                    begin, end = self._drives(np.array([a, b]))[0].tolist()
                    out.append(SeriesPiece(begin, end, c, float(steepness)))
            spans = again
        return sorted(out, key=lambda piece: self.sense * piece.begin)

    def _step(self, begin: float, end: float) -> float:
        """The shortest step of the path between two places: where it turns between two points of a series, its nodes are close."""
        places = self._nodes.place
        steps = np.diff(places[max(0, np.searchsorted(places, begin) - 1) : np.searchsorted(places, end) + 1])
        return float(steps[steps > 0.0].min())

    def _spans(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Places between which pieces are tried first: change points in the middle of theirs."""
        places = sorted(c.place for c in self.crossings if begin < c.place < end)
        cuts = [begin, end]
        for i, place in enumerate(places):
            room = min(
                place - begin, end - place, *np.abs(np.delete(places, i) - place) / 2, RESPONSE.around_crossing / 2
            )
            cuts += [place - room, place + room]
        out = []
        for a, b in pairwise(np.unique(cuts).tolist()):
            whole = any(a < place < b for place in places)
            # longest piece of one series (radians, or lengths / L)
            edges = np.linspace(a, b, 1 + (1 if whole else max(1, int(np.ceil((b - a) / 0.64 - 1e-9)))))
            out += list(pairwise(edges.tolist()))
        return out

    def _series(self, spans: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
        """Series ``(spans, POINTS, 4 + m)`` over spans of places, how steep the path is in each, and the noise of the series."""
        at = np.concatenate([0.5 * (a + b) + 0.5 * (b - a) * _NODES for a, b in spans])
        values, steepness, condition = self._tabulated_at(at)
        values, steepness, condition = (
            part.T.reshape(len(spans), POINTS, *part.shape[:-1]) for part in (values, steepness, condition)
        )
        # rounding over the square of the distance from a singular position, which the condition measures
        # rounding of what a series is made of, times the square of the condition
        noise = 1e-14 * condition.max(axis=1) ** 2
        return np.einsum("kp,spq->skq", _TO_SERIES, values), steepness.max(axis=1), noise

    def _tabulated_at(self, at: Array) -> tuple[Array, Array, Array]:
        """Terms ``(4 + m, T)`` at places ``(T,)``, how steep the path is there and the condition ``(T,)``."""
        x, u, _ = self._predicted(at)
        if self.kernel is not None and not len(self.terms.sizes) and not self._beside_crossings(at):
            found = self.kernel.terms(x, u[0])
            if found is not None:
                return found
        x, which = self.states(at)
        here = Configuration(self.path.system, x)
        f = self.path.solver.factored(here, which)
        singles = self.path.system.single_rows >= 0
        return self.terms.tabulated(here, f), np.abs(f.sensitivity()[singles, 0]).max(axis=0), f.condition


def _coarse(c: Array, noise: float) -> bool:
    """Whether series ``(POINTS, 4 + m)`` leave more out than rounding, which stays however short the piece is."""
    late, last = np.abs(c[-8:-4]).max(axis=0), np.abs(c[-4:]).max(axis=0)
    tail, size = np.abs(c[-2:]).max(axis=0), np.abs(c).max(axis=0)
    # the mass beside itself, forces beside what gives the mass an acceleration of one as well, places beside one (radian, length / L)
    of_forces, others = np.full(OF_LOADS - 1, size[:2].max()), np.maximum(size[OF_LOADS:], 1.0)
    largest = np.concatenate([size[:1], of_forces, others])
    # part of the coefficients before them that the last ones of a series have where they are noise: those of a smooth series of that
    # size (1e-9, against the largest term) fall by a hundred from four to four
    rounding = (last > 0.3 * late) & (last < max(1e-9, noise) * largest)
    # part of the largest coefficient that the last two of a series may have; what a smooth series leaves out behind them is far
    # smaller
    small = tail <= 1e-12 * np.maximum(size, 1e-3 * largest)
    return bool(not (small | rounding).all())


FURTHEST = 4.0 * np.pi
"""Distance beyond what is tabulated to which a trial step may lead; what is further off asks for a shorter one."""

AT_DEAD_POINT = (
    "only links without inertia move in this position, as a massless crank at its dead point does, and nothing decides how they go "
    "on. Give them mass or inertia, or start in another position"
)


class Arc:
    """The path around a closed state ``x (nx,)``, by the coordinate of one freedom; extended both ways as far as it is asked for.

    It begins there with the ``rate`` that the coordinate has at rates ``dq (F,)``.
    """

    def __init__(self, task: Task, x: Array, dq: Array) -> None:
        self.task = task
        s = task.system
        motion = closure_rank(Configuration(s, x[:, None]), engine=task.engine).motions[:, 0]
        singles = np.flatnonzero(s.single_rows >= 0)
        self.column = int(singles[np.argmax(np.abs(motion[singles]))])
        self.turn = float(s.periods[self.column]) if np.isfinite(s.periods[self.column]) else 0.0
        """By how much the coordinate grows in a whole turn, or round a closed curve; zero where it goes on."""
        columns = np.array([self.column], dtype=np.intp)
        self.path = DriverPath(s, closure_solver(task.engine, columns), partial(_same, s))
        self.begin, self.rate = float(x[s.single_rows[self.column]]), float(dq[self.column])
        self._first_way = 1 if self.rate >= 0.0 else -1
        self.terms = AlongTerms(s, task.loads)
        self._x = x
        self._kernel = None if task.library is None else KernelPath(task.library, s, self.column, x, self.terms.smooth)
        self._ways: dict[int, Way] = {}
        self.advance: Array | None = None
        """What a turn adds to the state where it comes back then; None while it does not."""
        self._sense = 1.0

    def __getstate__(self) -> dict[str, Any]:
        """Without the kernel, see ``Way``."""
        return vars(self) | {"_kernel": None}

    def _way(self, sense: int) -> Way:
        """The path in a sense of the coordinate, begun when first asked for."""
        if sense not in self._ways:
            self._ways[sense] = Way(self.path, self.terms, self._x, float(sense), self._kernel)
        return self._ways[sense]

    def piece(self, u: float) -> tuple[SeriesPiece, float] | None:
        """The piece in which a place lies, and the whole turns by which the place is further on; None where the table ends before."""
        turns, at, way = self.home(u)
        at *= way.sense
        if not at < way.length + FURTHEST:
            return None
        while (at > way.length or not way.length) and not way.closed:
            self._extend(way)
            if self.advance is not None and not turns:
                return self.piece(u)
        return None if at > way.length or not way.length else (way.piece(at), turns)

    def home(self, u: float) -> tuple[float, float, Way]:
        """Whole turns before a place, the distance from the beginning without them, and the way on which it is."""
        turns = 0.0 if self.advance is None else self._sense * math.floor(self._sense * (u - self.begin) / self.turn)
        at = u - self.turn * turns - self.begin
        return turns, at, self._way((at > 0) - (at < 0) or self._first_way)

    def number(self, u: float) -> float:
        """How many pieces of the table lie between the beginning and a place, in parts of the last, below zero on the way back."""
        turns, at, way = self.home(u)
        return turns * (self._around[0] if turns else 0.0) + way.sense * way.number(abs(at))

    def metric(self, u: float) -> float:
        """The integral of the root of the mass from the beginning to a place."""
        turns, at, way = self.home(u)
        return turns * (self._around[1] if turns else 0.0) + math.copysign(way.metric(abs(at)), at)

    @cached_property
    def _around(self) -> tuple[float, float]:
        """Number and metric over a whole turn after which all comes back."""
        way = self._way(int(self._sense))
        return way.number(self.turn), way.metric(self.turn)

    def tabulated(self) -> tuple[Array, Array]:
        """All pieces in order, their ends and series ``(n, 2 + 4 POINTS)``; places between which they lie, and between which more may be
        asked for; begin, turn and its sense.
        """
        low, high = (self._ways.get(sense) for sense in (-1, 1))
        pieces = sorted(
            (p for way in (low, high) if way is not None for p in way.pieces), key=lambda p: min(p.begin, p.end)
        )
        lengths = [0.0 if way is None else way.length for way in (low, high)]
        further = [FURTHEST * (way is None or not way.closed) for way in (low, high)]
        about = [self.begin - lengths[0], self.begin + lengths[1]]
        turn = 0.0 if self.advance is None else self.turn
        about += [about[0] - further[0], about[1] + further[1], self.begin, turn, self._sense]
        return np.array([[p.begin, p.end, *p.series.ravel()] for p in pieces]).reshape(
            len(pieces), 2 + OF_LOADS * POINTS
        ), np.array(about)

    def _turns(self, u: Array) -> Array:
        """Whole turns by which places ``u (T,)`` are further on than where they are tabulated."""
        if self.advance is None:
            return np.zeros(len(u))
        return np.asarray(self._sense * np.floor(self._sense * (u - self.begin) / self.turn))

    def close(self, u: Array) -> ClosedChart:
        """Closed states at places ``u (T,)`` within the table."""
        s = self.task.system
        turns = self._turns(u)
        home = u - self.turn * turns
        x, which = np.empty((s.n_state, len(u))), np.empty(len(u), dtype=np.intp)
        for sense in (1, -1):
            mine = np.where(home == self.begin, self._first_way, np.sign(home - self.begin)) == sense
            if mine.any():
                way = self._way(sense)
                if not way.length:
                    self._extend(way)
                x[:, mine], which[mine] = way.states(way.sense * (home[mine] - self.begin))
        if self.advance is not None:
            x += self.advance[:, None] * turns
        here = Configuration(s, x)
        return ClosedChart(here, self.path.solver.factored(here, which), np.ones(len(u), dtype=bool))

    def _extend(self, way: Way) -> None:
        """Tabulate the path further, up to where another freedom moves much faster, or until it comes back."""
        way.extend(self.turn if way.length < self.turn else np.inf)
        if 0.0 < self.turn <= way.length and self.advance is None:
            self.advance, self._sense = self._after_a_turn(way.sense), way.sense

    def _after_a_turn(self, sense: float) -> Array | None:
        """How the state has advanced after a turn of the coordinate, where all links and loads are back; None where they are not."""
        s = self.task.system
        ends = self.close(self.begin + sense * self.turn * np.array([0.0, 1.0])).here
        if np.abs(ends.poses[..., 1] - ends.poses[..., 0]).max() > RESPONSE.periodic:
            return None
        out = np.zeros(s.n_state)
        singles = np.flatnonzero(s.single_rows >= 0)
        rows = s.single_rows[singles]
        turned = sense * (ends.x[rows, 1] - ends.x[rows, 0])
        out[rows] = s.rounds(singles, turned)
        # a smooth load may count turns, as a spring in a freedom does that winds up: then nothing comes back
        # where in its part of a turn loads are compared with those a turn later: not at the quarters, where change points often are
        around = self.close(self.begin + sense * self.turn * (np.arange(POINTS) + 0.37) / POINTS)
        further = Configuration(s, around.here.x + sense * out[:, None])
        loads, factored = self.terms.smooth, self.path.solver.factored(further, around.f.which)
        both = (around.here, around.f), (further, factored)
        now, then = (along_one(*one, loads) for one in both)
        if np.abs(now - then).max() > RESPONSE.periodic * np.abs(now).max():
            return None
        # what acts in a freedom is small beside inertia where it is slow, or the unit of time is short, and counts turns all the same
        for load in (load for load in (*loads.stored, *loads.rest) if load.freedoms):
            alone = Loads((load,), ()) if any(one is load for one in loads.stored) else Loads((), (load,))
            now, then = (along_one(*one, alone)[1:] for one in both)
            if (np.abs(now - then) > RESPONSE.periodic * np.abs(now).max(axis=1, keepdims=True)).any():
                return None
        return out


class PathStage:
    """Implements ``integration.Stage`` along an arc, from a place ``u`` with rate ``v`` at a time."""

    jacobian = None
    trouble: Stopped | None = None

    def __init__(self, arc: Arc, t: float, u: float, v: float) -> None:
        self.arc, self.task, self._first = arc, arc.task, np.array([u, v, 0.0, 0.0])
        self.engine = self.task.engine if self.task.library is None else COMPILED
        self._piece: SeriesPiece | None = None
        self._turns = 0.0
        self._number = arc.number(u)
        self._mass, smooth, *_ = (terms := self._terms(u)).tolist()
        if self._piece is not None and self._mass <= RESPONSE.massless * np.abs(self._piece.series[:, 0]).sum():
            raise Stopped(AT_DEAD_POINT)
        stored, rest = arc.terms.forces(terms[OF_LOADS:], v, np.array([t]))
        self.energy = 0.5 * self._mass * v * v + abs(smooth + float(stored[0] + rest[0])) or 1.0

    def begin(self) -> Array:
        """See ``Stage``."""
        return self._first

    def table(self, place: float | None = None) -> tuple[Any, Array, Array] | None:
        """See ``Stage``."""
        if self.task.library is None or self.arc.terms.stored or self.arc.terms.rest:
            return None
        if place is not None:
            self.arc.piece(place)
        pieces, about = self.arc.tabulated()
        return self.task.library, pieces, np.append(about, self._mass)

    def _terms(self, u: float) -> Array:
        """Values of the series at a place; those of freedoms and links in the user's units."""
        z = self._in_piece(u)
        if self._piece is None or not -1.0 <= z <= 1.0:
            found = self.arc.piece(u)
            if found is None:
                return np.full(OF_LOADS + len(self.arc.terms.sizes), np.nan)
            self._piece, self._turns = found
            z = self._in_piece(u)
        # Chebyshev polynomials by their angles: one cosine each
        angle = math.acos(min(1.0, max(-1.0, z)))
        return self._in_units(np.cos(_ORDERS[:-1] * angle) @ self._piece.series)

    def _in_piece(self, u: Any) -> Any:
        """Places from -1 to 1 in the piece last used."""
        if self._piece is None:
            return np.nan
        w = u - self.arc.turn * self._turns
        return (2.0 * w - self._piece.begin - self._piece.end) / (self._piece.end - self._piece.begin)

    def _in_units(self, terms: Array) -> Array:
        """Values ``(..., 4 + m)`` of the series, those of freedoms and links in the user's units."""
        if terms.shape[-1] > OF_LOADS:
            terms[..., OF_LOADS:] *= self.arc.terms.sizes
            if self._turns and self.arc.advance is not None:
                terms[..., OF_LOADS:] += self.arc.terms.after_turns(self.arc.advance, self._turns)
        return terms

    def _terms_at(self, u: Array) -> Array:
        """Values ``(4 + m, T)`` of the series at places ``(T,)``, piece by piece."""
        out = np.empty((OF_LOADS + len(self.arc.terms.sizes), len(u)))
        left = np.ones(len(u), dtype=bool)
        while left.any():
            first = int(np.argmax(left))
            out[:, first], left[first] = self._terms(float(u[first])), False
            z = self._in_piece(u)
            here = left & (np.abs(z) <= 1.0)
            if here.any() and self._piece is not None:
                angles = np.arccos(z[here])
                out[:, here] = self._in_units(np.cos(angles[:, None] * _ORDERS[:-1]) @ self._piece.series).T
                left &= ~here
        return out

    def rates(self, t: float, y: Array) -> Array:
        """See ``Stage``."""
        u, w = float(y[0]), float(y[1])
        terms = self._terms(u)
        mass, stored, p1, p2 = terms[:OF_LOADS].tolist()
        if not mass > 0.0:
            return np.full(4, np.nan)
        size = math.sqrt(mass / self._mass)
        v = w / size
        rest = p1 + v * p2
        if len(terms) > OF_LOADS:
            by_stored, by_rest = self.arc.terms.forces(terms[OF_LOADS:], v, np.array([t]))
            stored, rest = stored + float(by_stored[0]), rest + float(by_rest[0])
        return np.array([v, (stored + rest) / (size * self._mass), 0.0, v * rest])

    def unsmooth(
        self, t: float, y: Array, dense: Callable[[Any], Array]
    ) -> tuple[Callable[[Array], Array], Array] | None:
        """See ``Stage``."""
        of = self.arc.terms
        if not (of.stored or of.rest):
            return None

        def accelerations(times: Array) -> Array:
            u, w = dense(times)[:2]
            terms = self._terms_at(u)
            if not (terms[0] > 0.0).all():
                return np.full((1, len(times)), np.nan)
            size = np.sqrt(terms[0] / self._mass)
            return np.add(*of.forces(terms[OF_LOADS:], w / size, times))[None] / (size * self._mass)

        return accelerations, y[1:2]

    def astray(self, t: float, y: Array, begin: float, dense: Callable[[Any], Array], allowed: Array) -> bool:
        """See ``Stage``: the integral of ``w`` over time is that of ``sqrt(M / M_0)`` over the path, which has no peaks in time."""
        # pieces of the table in one step from which on a peak of the mass may lie between its evaluations
        if abs(self.arc.number(float(y[0])) - self._number) <= 1:
            return False
        u, w = dense(begin + (t - begin) * _IN_STEP)[:2]
        parts = 0.25 * (t - begin) * math.sqrt(self._mass) * (w[3:].reshape(2, -1) @ _GAUSS[1])
        way = np.diff([self.arc.metric(place) for place in u[:3].tolist()])
        # over the mean root of the mass in the step it is what is missed of the place
        return not float(np.abs(way - parts).sum() * abs(u[2] - u[0])) <= allowed[0] * abs(float(way.sum()))

    def accepted(self, t: float, y: Array) -> bool:
        """See ``Stage``."""
        self._terms(float(y[0]))
        self._number = self.arc.number(float(y[0]))
        # rate of another freedom against that of the coordinate above which it becomes the coordinate
        return self._piece is not None and self._piece.steepness <= 2.0

    def following(self, t: float, y: Array) -> PathStage:
        """See ``Stage``."""
        closed, v = self.states(np.array([t]), y[:, None])
        dq = closed.f.sensitivity()[:, 0, 0] * v[0, 0]
        arc = Arc(self.arc.task, closed.here.x[:, 0], dq)
        stage = PathStage(arc, t, arc.begin, arc.rate)
        # with the energy that there is, which the rate has less well where the mass changes fast
        stage._first[1] = math.copysign(math.sqrt(self._mass / stage._mass) * y[1], arc.rate)
        return stage

    def task_at(self, t: Array) -> Task:
        """See ``Stage``."""
        return self.task

    def states(self, t: Array, y: Array) -> tuple[ClosedChart, Array]:
        """See ``Stage``."""
        mass = np.array([self._terms(u)[0] for u in y[0].tolist()])
        return self.arc.close(y[0]), y[1:2] / np.sqrt(mass / self._mass)

    def by_kernel(self, t: Array, y: Array) -> Array | None:
        """See ``Stage``."""
        return None


def _same(system: System, variants: Any) -> System:
    return system


_ORDERS = np.arange(POINTS + 1, dtype=float)
_NODES, _VALUES, _TO_SERIES = chebyshev(POINTS)
_GAUSS = np.polynomial.legendre.leggauss(4)
_IN_STEP = np.concatenate([[0.0, 0.5, 1.0], 0.25 + 0.25 * _GAUSS[0], 0.75 + 0.25 * _GAUSS[0]])
