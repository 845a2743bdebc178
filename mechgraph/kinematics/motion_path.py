"""Positions along paths of driver values: the problem that is followed, what is asked for, and what is read off its tracks.

Positions along paths of driver values: the closure equations as a problem of path following, what is asked for and what is found.

One driver: the positions asked for lie on one curve, so it is followed once from the start up to the largest and once down to the
smallest value, whatever the order in which they are asked for, and however many cases ask. Several drivers: the path is the polygon
start -> first -> second ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.kinematics.state import ClosureSolver, Configuration, FactoredClosure
from mechgraph.kinematics.system import System
from mechgraph.maths.newton import Interpolation, Nodes, Paths, Work, places_of
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.singular_point import WINDOW, Crossing, followed, passed
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.tracker import End, Follower, Tracks
from mechgraph.memo import dataclass

FARTHEST = 1e6
"""Longest way of a driver from its start (radians, or lengths / L)."""
BLOCK = 1024
"""Positions evaluated together, so that what is computed on the way stays in the cache of a core (measured)."""


def far_faults(names: Iterable[str], ways: Array, units: Array, most: Array, advice: str = "") -> list[str]:
    """What is wrong with ways that would be followed for hours."""
    return [
        f"{name}: comes {way * unit:.3g} away from the start; expected at most {limit * unit:.3g}{advice}"
        for name, way, unit, limit in zip(names, ways, units, most, strict=True)
        if way > limit
    ]


class Status(Enum):
    """Outcome at one position; the value is the text that a table shows."""

    OK = "ok"
    DEAD_POINT = "dead point"
    OUT_OF_REACH = "out of reach"
    BEYOND_DEAD_POINT = "beyond a dead point"
    CHANGE_POINT = "change point"
    ACTUATORS_REST = "actuators at dead point"
    NOT_CLOSED = "loops not closed"
    NOT_FOLLOWED = "not followed"
    BEYOND_TOLERANCE = "beyond tolerance"
    JAMS = "jams"
    NO_FINITE_FORCE = "no finite force"
    FRICTION_OPEN = "friction not determined"
    LIFTS_OFF = "lifts off"


def in_blocks(places: Index, most: int = BLOCK) -> list[Index]:
    """Places in parts of about equal size, at most so many each; at least one part."""
    return [np.asarray(part) for part in np.array_split(places, max(1, -(-len(places) // most)))]


SystemOf = Callable[[Index], System]


class DriverPath:
    """The closure equations with the coordinates ``columns`` given along a path (implements ``maths.newton.Problem``).

    ``system_of(variants)`` is the system with the numbers of variants; ``variant_of`` says which variant each track follows. ``start`` is
    a state that is evaluated already, where there is one variant alone.
    """

    def __init__(
        self, system: System, solver: ClosureSolver, system_of: SystemOf, start: Configuration | None = None
    ) -> None:
        self.system, self.solver = system, solver
        self.columns = solver.fixed
        self.rows = system.single_rows[self.columns]
        self.size = (system.n_freedoms, len(self.columns))
        self.paced = bool(system.is_length[self.columns].any())
        self.bend = system.bend
        self.carries = True
        """Whether what is left free can be carried on by periods of the motion."""
        self._system_of, self._start = system_of, start
        self._start_bytes = b"" if start is None else start.x.tobytes()
        self.variant_of: Index = np.zeros(0, dtype=np.intp)

    def at(self, x: Array, drive: Array, tracks: Index) -> Configuration:
        """See ``maths.newton.Problem``."""
        x = x.copy()
        x[self.rows] = drive
        if x.shape[1] == 1 and self._start is not None and x.tobytes() == self._start_bytes:
            return self._start
        return Configuration(self._system_of(self.variant_of[tracks]), x)

    def chosen(self, point: Configuration, which: Index) -> Index:
        """See ``maths.newton.Problem``."""
        return self.solver.chosen(point, which)

    def factored(self, point: Configuration, which: Index) -> FactoredClosure:
        """See ``maths.newton.Problem``."""
        return self.solver.factored(point, which)

    def sensitivity(self, point: Configuration, factored: FactoredClosure) -> Array:
        """See ``maths.newton.Problem``."""
        return factored.sensitivity()

    def advance(self, x: Array, dq: Array, tracks: Index) -> Array:
        """See ``maths.newton.Problem``."""
        return self.system.advance(x, dq)

    def difference(self, x1: Array, x0: Array) -> Array:
        """See ``maths.newton.Problem``."""
        return self.system.difference(x1, x0)

    def tangent(self, dq: Array, rates: Array) -> Array:
        """See ``maths.newton.Problem``."""
        return self.system.tangent(dq, rates)

    def pace(self, x: Array, rates: Array) -> Array:
        """The largest rate, slides that stand in no closure row left out; 0 where nothing turns, so that bodies are displaced only.

        A slide that is out by more than L counts by its rate over how far it is out: so the equations change.
        """
        s, size = self.system, np.abs(rates)
        turning = size[~s.is_length].max(axis=0, initial=0.0) > 0
        size[s.is_length] /= np.maximum(np.abs(x[s.single_rows[s.is_length]]), 1.0)
        return np.where(turning, np.minimum(size[~s.carrying].max(axis=0, initial=0.0), 1.0), 0.0)

    def corrigible(self, dq: Array, which: Index) -> Array:
        """See ``ClosureSolver.corrigible``."""
        return self.solver.corrigible(dq, which)


@dataclass(frozen=True)
class Request:
    """Positions asked of one closed start ``x (nx,)`` of a ``variant``: driver values ``(d, n)`` in order, and their flat ``places``."""

    x: Array
    variant: int
    values: Array
    places: Index
    via: Array | None = None
    """Driver values ``(d, k)`` to be passed before the first position."""

    def polygon(self, rows: Index) -> Array:
        """The driver values of the start, of what is to be passed and of the positions, one after the other."""
        start = self.x[rows][:, None]
        return np.concatenate([start, self.values] if self.via is None else [start, self.via, self.values], axis=1)


def requests(x: Array, values: Array, batch: tuple[int, ...]) -> list[Request]:
    """What is asked of starts ``x (nx, V)``, NaN where there is none, by driver values ``(d, T)`` of a batch of positions.

    Of one start: with one driver all cases lie on one curve; with several, each case has a polygon of its own.
    """
    T, N = values.shape[1], batch[-1] if batch else 1
    if x.shape[1] == 1:
        whole = T if len(values) == 1 else N
        return [Request(x[:, 0], 0, values[:, i : i + whole], np.arange(i, i + whole)) for i in range(0, T, whole)]
    begun = np.flatnonzero(np.isfinite(x).all(axis=0)).tolist()
    return [Request(x[:, v], v, values[:, v * N : (v + 1) * N], np.arange(v * N, (v + 1) * N)) for v in begun]


@dataclass
class Positions:
    """States ``(nx, T)``, statuses ``(T,)`` and forms ``(T,)`` of all positions; ``reached (d, T)`` the last driver values before what was
    not reached; ``here`` the evaluation where all positions were closed in one block.

    ``place (T,)`` and ``track (T,)`` say where on the followed tracks they lie; ``near (T,)`` is the number of the crossing beside which
    a position lies, or -1. Where the motion repeats itself, ``turns (T,)`` periods are taken off, in which freedoms ``gained (F, T)``;
    ``spin (F, nodes)`` is what turns passive bodies on by a period.
    """

    x: Array
    status: np.ndarray
    which: Index
    reached: Array
    track: Index
    place: Array
    tracks: Tracks
    follower: Follower
    near: Index
    crossings: list[Crossing]
    here: Configuration | None = None
    turns: Index | None = None
    gained: Array | None = None
    spin: Array | None = None
    left: NDArray[Any] = field(default_factory=lambda: np.zeros(0, dtype=object))
    """What ends the path before a position at the end of a curve or surface or beside a pole, or an empty text."""

    def __post_init__(self) -> None:
        if not self.left.size:
            self.left = np.full(len(self.status), "", dtype=object)

    @property
    def moved(self) -> Mask:
        """Which positions have a state and rates: those that are solved, and change points."""
        return np.asarray((self.status == Status.OK) | (self.status == Status.CHANGE_POINT))

    def interpolate(self) -> None:
        """Take the states beside change points from the branch that passes them."""
        for i, crossing in enumerate(self.crossings):
            at = np.flatnonzero(self.near == i)
            self.x[:, at] = crossing.states(self.place[at])

    def take_up(self, more: Positions, places: Index) -> None:
        """Take some places from positions that were followed afterwards, with the tracks on which they lie."""
        known = len(self.tracks.end)
        for name in ("x", "status", "which", "reached", "place", "left"):
            getattr(self, name)[..., places] = getattr(more, name)[..., places]
        self.track[places] = known + more.track[places]
        self.near[places] = np.where(more.near[places] < 0, -1, len(self.crossings) + more.near[places])
        self.crossings += [replace(c, track=c.track + known, sides=c.sides.moved_by(known)) for c in more.crossings]
        for name in ("evaluations", "calls", "factorizations", "careful"):
            setattr(self.work, name, getattr(self.work, name) + getattr(more.work, name))
        crossings = [(known + track, place) for track, place in more.tracks.crossings]
        self.tracks = Tracks(
            Nodes.join([self.tracks.nodes, more.tracks.nodes.moved_by(known)]),
            self.tracks.end + more.tracks.end,
            self.tracks.crossings + crossings,
            self.work,
        )
        self.follower.paths = Paths(self.follower.paths.points + more.follower.paths.points)
        self.here = None

    def nodes_of(self, track: int) -> Nodes:
        """Nodes of a track."""
        return self.tracks.nodes.take(self.tracks.nodes.track == track)

    @property
    def work(self) -> Work:
        """What was done."""
        return self.tracks.work


CONTINUED_TOGETHER = 10_000
"""Nodes and positions, of some tracks or of some periods of one, that are continued together."""


def continued(path: DriverPath, found: Positions) -> Array:
    """User coordinates ``(F, T)`` of all positions, rotation vectors continued along their tracks from the start."""
    s = path.system
    if all(len(factor) == 1 for g in s.groups for factor in g.row.factors):
        q = s.coordinates_of(found.x)
        return q if found.gained is None else q + s.in_user_units(found.gained)
    out = np.full((s.n_freedoms, found.x.shape[1]), np.nan)
    count = np.bincount(found.tracks.nodes.track, minlength=len(found.tracks.end))
    np.add.at(count, found.track[found.moved], 1)
    for tracks in np.array_split(np.arange(len(count)), max(1, min(len(count), count.sum() // CONTINUED_TOGETHER))):
        if tracks.size:
            _continue(path, found, tracks, out)
    return out if found.gained is None else out + s.in_user_units(found.gained)


def _continue(path: DriverPath, found: Positions, tracks: Index, out: Array) -> None:
    """Put the coordinates of the positions of some neighboring ``tracks`` in their places, some periods after the other."""
    s, every = path.system, found.tracks.nodes.track
    mine = np.flatnonzero((found.track >= tracks[0]) & (found.track <= tracks[-1]) & found.moved)
    if not mine.size:
        return
    on = slice(*np.searchsorted(every, (tracks[0], tracks[-1] + 1)))
    nodes = found.tracks.nodes.take(np.arange(on.start, on.stop))
    spin = np.zeros((s.n_freedoms, len(nodes))) if found.spin is None else found.spin[:, on]
    turns = np.zeros(mine.size, dtype=np.intp) if found.turns is None else found.turns[mine]
    near = np.repeat(s.start_coordinates(s.m.start)[:, None], len(tracks), axis=1)
    together = max(1, CONTINUED_TOGETHER // len(nodes))
    for first in range(0, int(turns.max()) + 1, together):
        some = np.arange(first, min(first + together, int(turns.max()) + 1))
        number, again = np.repeat(some, len(nodes)), np.tile(np.arange(len(nodes)), len(some))
        on_the_way = path.advance(nodes.x[:, again], spin[:, again] * number.astype(float), nodes.track[again])
        within = np.isin(turns, some)
        at = mine[within]
        track, period, place = (
            np.concatenate(parts)
            for parts in (
                (nodes.track[again], found.track[at]),
                (number, turns[within]),
                (nodes.place[again], found.place[at]),
            )
        )
        order = np.lexsort((place, period, track))
        x = np.concatenate([on_the_way, found.x[:, at]], axis=1)[:, order]
        # one row a track, shorter ones go on at rest
        end = np.searchsorted(track[order], tracks, side="right")
        begin = np.searchsorted(track[order], tracks)
        along = np.minimum(begin[:, None] + np.arange((end - begin).max()), np.maximum(end - 1, 0)[:, None])
        q = s.coordinates_of(x[:, along], near)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        row = track[len(number) :] - tracks[0]
        out[:, at], near = q[:, row, back[len(number) :] - begin[row]], q[:, :, -1]


def along_polygons(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """Several drivers: from every start the polygon through its positions in their order, with nodes where interpolation does not do."""
    legs = Legs(path, total)
    for request in requests:
        points = request.polygon(path.rows)
        legs.add(request, points, request.values, request.places, places_of(points)[-request.values.shape[1] :])
    # times that polygons are followed, every time with a node at the positions that did not come out as predicted before
    for _ in range(12):
        found, bad = legs.followed()
        if not bad.size or not legs.stop_at(bad):
            break
    return found


class Legs:
    """Tracks through the positions asked for: where each position lies, and reading positions off the nodes."""

    def __init__(self, path: DriverPath, total: int) -> None:
        self.path, self.total = path, total
        self.variants: list[int] = []
        self.starts: list[Array] = []
        self.points: list[Array] = []
        self.stops: list[Mask] = []
        self.asked = np.zeros(total, dtype=bool)
        self.values = np.empty((path.size[1], total))
        self.track = np.zeros(total, dtype=np.intp)
        self.place = np.zeros(total)

    def add(self, request: Request, points: Array, values: Array, places: Index, at: Array) -> None:
        """A track through ``points (d, M)`` on which the positions ``places`` lie ``at`` path lengths."""
        self.asked[places] = True
        self.track[places], self.place[places] = len(self.points), at
        self.values[:, places] = values
        self.starts.append(request.x)
        self.variants.append(request.variant)
        self.points.append(points)
        self.stops.append(np.zeros(points.shape[1], dtype=bool))

    def stop_at(self, bad: Index) -> bool:
        """Let no step pass over positions where interpolation did not do; whether that changes anything."""
        changed = False
        for i in bad:
            stops, length = self.stops[self.track[i]], self._length[self.track[i]]
            at = int(np.argmin(np.abs(length - self.place[i])))
            changed |= not stops[at]
            stops[at] = True
        return changed

    def followed(self) -> tuple[Positions, Index]:
        """All tracks followed and all positions read off; also those that did not come out as predicted."""
        self.path.variant_of = np.array(self.variants, dtype=np.intp)
        follower = Follower(self.path)
        paths = Paths(self.points, self.stops)
        self._length = paths.length
        tracks = followed(follower, np.stack(self.starts, axis=1), paths)
        reach = self._reach(tracks)
        out = self._unread(follower, tracks)
        self._beside_crossings(out)
        inside = np.flatnonzero(self.asked & (self.place <= reach[self.track]) & (out.near < 0))
        wrong = self._read_off(out, inside)
        out.status[wrong] = Status.NOT_CLOSED
        out.x[:, wrong] = np.nan
        self._say_why_not(out, reach)
        return out, wrong

    def _reach(self, tracks: Tracks) -> Array:
        """The place up to which the positions of every track may be read off."""
        last = np.zeros(len(self.points))
        np.maximum.at(last, tracks.nodes.track, tracks.nodes.place)
        reach = np.where([end is not End.REACHED for end in tracks.end], last, np.inf)
        for track, crossing in tracks.crossings:
            # up to the crossing the branch is known, also where it is not passed
            reach[track] = max(reach[track], crossing - PATH.dead_zone)
        return reach

    def _unread(self, follower: Follower, tracks: Tracks) -> Positions:
        """All positions with their places; nothing read off yet."""
        nodes = tracks.nodes
        # the last node before every position
        span = float(max(nodes.place.max(), self.place.max(initial=0.0))) + 1.0
        before = np.searchsorted(nodes.track * span + nodes.place, self.track * span + self.place) - 1
        out = Positions(
            np.full((self.path.system.n_state, self.total), np.nan),
            np.full(self.total, Status.OK, dtype=object),
            np.zeros(self.total, dtype=np.intp),
            nodes.drive[:, np.maximum(before, np.searchsorted(nodes.track, self.track))],
            self.track,
            self.place,
            tracks,
            follower,
            np.full(self.total, -1),
            [],
        )
        out.status[~self.asked] = Status.NOT_CLOSED
        return out

    def _read_off(self, out: Positions, inside: Index) -> Index:
        """The positions ``inside`` closed from interpolation, with more nodes where that does not do; those that did not come out."""
        # times that nodes are put where positions did not come out as predicted
        for _ in range(4):
            interpolation = Interpolation(self.path, out.tracks.nodes)
            bad = [
                part[self._closed(out, interpolation, part, inside.size == self.total)] for part in in_blocks(inside)
            ]
            wrong = np.concatenate(bad)
            # tracks that end where they begin have no step
            halved = wrong[np.isin(self.track[wrong], interpolation.nodes.track[interpolation.left])]
            if not halved.size or self.path.size[1] > 1:
                break
            more = self._halved(out.follower, interpolation, halved)
            if not len(more):
                break
            out.tracks = replace(out.tracks, nodes=Nodes.join([out.tracks.nodes, more]))
        return wrong

    def _beside_crossings(self, out: Positions) -> None:
        """Positions beside change points that were passed are taken from the branch itself."""
        tracks = out.tracks
        for track, place in tracks.crossings:
            beside = np.flatnonzero(self.asked & (self.track == track) & (np.abs(self.place - place) < WINDOW))
            crossing = passed(out.follower, tracks.nodes, track, place) if beside.size else None
            if crossing is None:
                continue
            beside = beside[np.abs(self.place[beside] - place) < crossing.window]
            straight = np.abs(self.values[:, beside] - crossing.drives(self.place[beside])).max(axis=0) < 1e-12
            if straight.any():
                out.near[beside[straight]] = len(out.crossings)
                out.crossings.append(crossing)
        out.interpolate()

    def _closed(self, out: Positions, interpolation: Interpolation, at: Index, whole: bool) -> Mask:
        """Positions ``at`` closed from their prediction; which of them are not beyond doubt."""
        nodes, path = interpolation.nodes, self.path
        tracks, drive = self.track[at], self.values[:, at]
        if len(interpolation.left):
            has_step = np.isin(tracks, nodes.track[interpolation.left])
        else:
            has_step = np.zeros(len(at), dtype=bool)
        first = np.searchsorted(nodes.track, tracks)
        x, which = nodes.x[:, first], nodes.which[first]
        left = right = first
        if has_step.any():
            step = interpolation.find(tracks[has_step], self.place[at[has_step]])
            x[:, has_step] = interpolation(step, self.place[at[has_step]], drive[:, has_step])
            left, right = first.copy(), first.copy()
            left[has_step], right[has_step] = interpolation.left[step], interpolation.right[step]
            which[has_step] = nodes.which[left[has_step]]
        found = out.follower.newton.close(x, drive, tracks, which)
        out.x[:, at], out.which[at] = found.x, found.which
        bad = ~found.done | (found.correction > PATH.correction)
        # correction of an interpolated position from which on it is asked whether it lies on the branch of its nodes
        doubt = np.flatnonzero(~bad & (found.correction > 1e-4))
        if doubt.size:
            here = path.at(found.x[:, doubt], drive[:, doubt], tracks[doubt])
            ends, sides = nodes.ends(left[doubt], right[doubt])
            beside = path.at(ends.x, ends.drive, ends.track)
            bad[doubt] = ~path.factored(here, found.which[doubt]).regular_between(beside, *sides)
        if whole and len(at) == self.total:
            out.here = found.point if not bad.any() else None
        return bad

    def _halved(self, follower: Follower, interpolation: Interpolation, wrong: Index) -> Nodes:
        """Nodes in the middle of the steps in which positions did not come out as predicted."""
        nodes = interpolation.nodes
        step = np.unique(interpolation.find(self.track[wrong], self.place[wrong]))
        a, b = interpolation.left[step], interpolation.right[step]
        place = 0.5 * (nodes.place[a] + nodes.place[b])
        drive = follower.paths.drive(nodes.track[a], place)
        found = follower.newton.nodes(
            interpolation(step, place, drive), drive, nodes.track[a], nodes.which[a], PATH.node
        )
        return Nodes.closed(found, drive, nodes.track[a], place, sure=True).take(found.done)

    def _say_why_not(self, out: Positions, reach: Array) -> None:
        """Statuses of the positions behind the end of their track, and at crossings."""
        for i in np.flatnonzero(self.asked & (self.place > reach[self.track])):
            near = self.place[i] - reach[self.track[i]] < PATH.dead_zone
            crossed = Status.DEAD_POINT if near else Status.BEYOND_DEAD_POINT
            out.status[i] = BEYOND.get(out.tracks.end[self.track[i]], crossed)
        for track, crossing in out.tracks.crossings:
            there = self.asked & (self.track == track) & (np.abs(self.place - crossing) < PATH.dead_zone)
            out.status[there & (out.near < 0)] = Status.DEAD_POINT
            out.status[there & (out.near >= 0)] = Status.CHANGE_POINT
            out.reached[:, there] = out.follower.paths.drive(np.array([track]), np.array([crossing]))
        for number, known in enumerate(out.crossings):
            at = np.flatnonzero((out.near == number) & (out.status == Status.OK))
            if at.size:
                out.status[at[known.at_another(self.place[at])]] = Status.CHANGE_POINT


BEYOND = {End.FOLD: Status.OUT_OF_REACH, End.GIVEN_UP: Status.NOT_FOLLOWED}
"""Outcome behind the end of a track."""
