"""How far a motion goes: turns that repeat, gaps, ends of curves and surfaces, poles of a sphere.

Poles of the parameters of a sphere: a path that comes near one is followed with parameters about another axis.

At a pole the rates of the parameters have no value, though nothing happens to the mechanism: at the angle d from it the longitude turns at
a rate that grows as 1 / d, accelerations lose rounding over d squared, and a path that passes very near seems to end.

Ends of curves and surfaces: where a coordinate leaves the range of its factor, the reach of a motion ends.

A coordinate may leave its range and come back between two nodes: nodes are put where it turns back near an end.

Polygons of several drivers taken up again behind gaps of the reach.

Behind a gap the points of the polygon (its corners, long edges divided) are tried in their order: along a straight line from the nearest
point that was reached before, or else from the start. From the first one that is reached that way the polygon is followed on, and back
into the gap. The rule is one of the polygon, not of the positions asked for on it, and every way is certified like any other path: it is
a track of its own that begins at the start, so that turns are counted and passive bodies carried along it.

All positions asked for along driver values: one curve for one driver, polygons for several.

A driver that turns on and on is followed only until the motion repeats itself: after one whole turn, or after several. Where all poses
are back and all freedoms are, but for whole turns, the equations are the same again, and so is the curve:
``x(s + n P) = x(s) + n shift`` to rounding. A body that may spin passively is carried on by its turn a period (see ``passive_rest``).
Where that does not hold (a screw that advances), the whole way is followed.
"""

from __future__ import annotations

from dataclasses import field, replace
from itertools import pairwise

import numpy as np

from mechgraph.kinematics.motion_path import DriverPath, Legs, Positions, Request, Status, along_polygons
from mechgraph.kinematics.system import System
from mechgraph.maths.newton import STRAIGHT_ON, Interpolation, Nodes, Paths, places_of
from mechgraph.maths.se3 import Array, Index, compose, inverse, matrix_quaternion, quaternion_log
from mechgraph.maths.singular_point import followed
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.tracker import End, Follower
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.contact_types import placed_surface


def away_from_poles(m: Mechanism, system: System, found: Positions) -> Mechanism | None:
    """The mechanism with spheres about other axes where positions lie beside poles, or a node of a path that ends; None where none does.

    The axes keep far from all places that are known; spheres whose parameters are driven, coupled or loaded keep theirs.
    """
    if not any(pair.surface is not None for pair in m.pairs):
        return None
    asked, nodes = found.x[:, np.isfinite(found.x).all(axis=0)], found.tracks.nodes.x
    q, begin = system.coordinates_of(np.concatenate([asked, nodes], axis=1)), system.start_coordinates(m.start)
    whole = bool((found.status == Status.OK).all())
    q_near = q[:, : asked.shape[1]] if whole else q
    pairs, start, bound = list(m.pairs), dict(m.start), m.bound_freedoms
    for k, pair in enumerate(m.pairs):
        place, own = placed_surface(pair.type), slice(system.first_column[k], system.first_column[k + 1])
        free = pair.surface is not None and bound.isdisjoint(pair.freedom_names)
        # angle from a pole below which too many digits are lost: nearer, accelerations are off by more than 1e-12
        if place is None or not free or not (_norm(place.from_pole(q_near[own][:2])) < 0.01).any():
            continue
        assert pair.surface is not None
        pairs[k] = pair.reshaped(surface=pair.surface.with_poles_far_from(place.points(q[own][:2])))
        start |= dict(zip(pair.freedom_names, _renamed(pair, pairs[k], begin[own]).tolist(), strict=True))
    return m.replace(pairs=pairs, start=start) if pairs != list(m.pairs) else None


def _renamed(old: Pair, new: Pair, q: Array) -> Array:
    """Coordinates ``(5,)`` of a pair about its new axis where the one about the old axis has ``q (5,)``.

    With the markers ``A`` on link a: ``A' D' = A D``.
    """
    moved, pitch = placed_surface(new.type), np.zeros((1, 1))
    assert moved is not None
    A, A_new = (pair.markers[0].pose()[..., None, None] for pair in (old, new))
    x = evaluation.coordinates_to_state(old.type, q[:, None, None])
    there = compose(A, evaluation.frames_of(old.type, pitch, x)[-1])
    at = moved.coordinates_at(there[:, 3, 0, 0])
    turn = compose(inverse(compose(A_new, moved.pose(at[:, None, None], pitch))), there)[:, :3, 0, 0]
    return np.concatenate([at, quaternion_log(matrix_quaternion(turn))])


BEYOND_END = 1e-9
"""Lengths over L by which a coordinate may be beyond its range: rounding."""
NONE = np.zeros(0, dtype=np.intp)


def beyond(system: System, x: Array) -> Array:
    """By how much the coordinates of states ``(nx, T)`` are beyond their ranges, ``(limited freedoms, T)``; at most zero within."""
    columns, low, high = system.limits
    q = x[system.single_rows[columns]]
    return np.maximum(low[:, None] - q, q - high[:, None])


def end_at_ranges(path: DriverPath, found: Positions) -> None:
    """End every track where a coordinate leaves its range, and take away its positions behind; ``found.left`` says so."""
    system = path.system
    over = np.flatnonzero((beyond(system, found.x) > BEYOND_END).any(axis=0))
    outside = np.full(len(found.tracks.end), np.inf)
    np.minimum.at(outside, found.track[over], found.place[over])
    ends, node = range_ends(path, found.follower, found.tracks.nodes, outside)
    if len(node):
        first = system.limits[0][np.argmax(beyond(system, node.x), axis=0)]
        names = [system.m.freedom_names()[i] for i in first.tolist()]
        _cut(found, ends, node, [f"{name} reaches the end of its curve or surface" for name in names])


def end_beside_poles(path: DriverPath, found: Positions) -> None:
    """End every track that passes a pole of a sphere closely where ``bound_freedoms`` keep its axis; one right over a pole goes on.

    Beside the pole rates grow as the inverse of the distance, so that how far a path seems to go is a matter of conditions.
    """
    system, nodes = path.system, found.tracks.nodes
    bound, ends, why = system.m.bound_freedoms, np.full(len(found.tracks.end), np.inf), dict[int, str]()
    for k, pair in enumerate(system.m.pairs):
        place = placed_surface(pair.type) if pair.surface is not None else None
        if place is None or bound.isdisjoint(pair.freedom_names):
            continue
        w = place.from_pole(system.coordinates_of(nodes.x)[system.first_column[k] :][:2])
        if not np.isfinite(w).all():
            continue
        # between nodes on a line: beside a pole they are as near to each other as to it
        begin, step = w[:, :-1], np.diff(w)
        same = (np.diff(nodes.track) == 0) & (nodes.place[:-1] >= 0.0)
        size = np.maximum((step * step).sum(axis=0), 1e-300)
        foot = -(begin * step).sum(axis=0) / size
        off, least = _norm(begin + foot * step), _norm(begin + np.clip(foot, 0.0, 1.0) * step)
        # the ways from a pole over the radius at which accelerations keep eight digits, and which are rounding
        for i in np.flatnonzero(same & (least < (near := 1e-4)) & (off > 1e-12)):
            s = max(0.0, foot[i] - np.sqrt((near**2 - off[i] ** 2) / size[i]))
            there = nodes.place[i] + s * (nodes.place[i + 1] - nodes.place[i])
            if there < ends[track := int(nodes.track[i])]:
                ends[track], why[track] = there, pair.name
    left = np.flatnonzero(np.isfinite(ends))
    if left.size:
        kept = "whose axis cannot change because Tu or Tv is driven, loaded or coupled; give the surface another axis"
        said = [f"it lies behind a pole of the sphere of {why[track]}, {kept}" for track in left.tolist()]
        _cut(found, ends, _nodes_at(path, found.follower, nodes, left, ends[left]), said)


def _norm(w: Array) -> Array:
    return np.asarray(np.sqrt((w * w).sum(axis=0)))


def _cut(found: Positions, ends: Array, node: Nodes, names: list[str]) -> None:
    """Take away the positions behind the ``ends (V,)`` of tracks, infinite where they have none, with a node and what to say each."""
    for i, track in enumerate(np.flatnonzero(np.isfinite(ends)).tolist()):
        after = found.place > ends[track]
        # a later period begins behind the whole first one
        gone = (found.track == track) & (after if found.turns is None else after | (found.turns > 0))
        found.status[gone], found.near[gone], found.left[gone] = Status.OUT_OF_REACH, -1, names[i]
        found.x[:, gone] = np.nan
        found.reached[:, gone] = node.drive[:, [i]]
    nodes = found.tracks.nodes
    kept = nodes.take((nodes.place < ends[nodes.track]) | (nodes.place == 0.0))
    how = [End.RANGE if there < np.inf else end for end, there in zip(found.tracks.end, ends, strict=True)]
    found.tracks = replace(found.tracks, nodes=Nodes.join([kept, node.take(node.place > 0.0)]), end=how)
    found.here = None


def range_ends(path: DriverPath, follower: Follower, nodes: Nodes, outside: Array) -> tuple[Array, Nodes]:
    """Where tracks ``(V,)`` leave a range of a coordinate, infinite where they do not, and the nodes there, one each that does.

    ``outside (V,)``: places that are known to lie behind.
    """
    V, system = len(outside), path.system
    if not system.limits[0].size:
        return outside, nodes.take(NONE)
    nodes = _with_turns(path, follower, nodes)
    out, mine = (beyond(system, nodes.x) > BEYOND_END).any(axis=0), nodes.place >= 0.0
    far, near = outside.copy(), np.zeros(V)
    np.minimum.at(far, nodes.track[out & mine], nodes.place[out & mine])
    before = mine & (nodes.place < far[nodes.track])
    np.maximum.at(near, nodes.track[before], nodes.place[before])
    left = np.flatnonzero(np.isfinite(far))
    if not left.size:
        return far, nodes.take(NONE)
    low, high = near[left], far[left]
    between = Interpolation(path, nodes)
    # times that a step is halved for the place where a coordinate leaves its range: to rounding
    for _ in range(52 if (high > low).any() else 0):
        middle = 0.5 * (low + high)
        x = between(between.find(left, middle), middle, follower.paths.drive(left, middle))
        over = (beyond(system, x) > BEYOND_END).any(axis=0)
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    ends = np.full(V, np.inf)
    ends[left] = low
    return ends, _nodes_at(path, follower, nodes, left, low)


def _nodes_at(path: DriverPath, follower: Follower, nodes: Nodes, tracks: Index, place: Array) -> Nodes:
    """One node of each of the tracks, at a place between its nodes or at its first one."""
    drive, first = follower.paths.drive(tracks, place), nodes.take(nodes.place >= 0.0)
    first = first.take(np.searchsorted(first.track, tracks))
    x, on, between = first.x, place > 0.0, Interpolation(path, nodes)
    if on.any():
        x[:, on] = between(between.find(tracks[on], place[on]), place[on], drive[:, on])
    closed = follower.newton.nodes(x, drive, tracks, first.which, PATH.node)
    return Nodes.closed(closed, drive, tracks, place, sure=True)


def _with_turns(path: DriverPath, follower: Follower, nodes: Nodes) -> Nodes:
    """The nodes of all tracks, and further ones where a limited coordinate turns back near an end of its range between two of them."""
    columns, low, high = path.system.limits
    # nodes put one after the other where a coordinate turns back; the third is there to 1e-5, and the value to its square
    for _ in range(4):
        between = Interpolation(path, nodes)
        a, b = between.left, between.right
        width, q = nodes.place[b] - nodes.place[a], nodes.x[path.system.single_rows[columns]]
        begin, end = ((nodes.Z[columns][:, :, side] * between.slope).sum(axis=1) for side in (a, b))
        slope = (q[:, b] - q[:, a]) / width
        # the rate of the cubic through both ends, ``begin + B s + A s^2``, vanishes once where its signs at the ends differ
        A, B = 3.0 * (begin + end - 2.0 * slope), 2.0 * (3.0 * slope - 2.0 * begin - end)
        root = np.sqrt(np.maximum(B * B - 4.0 * A * begin, 0.0))
        bottom = np.where(begin > 0, root - B, -root - B)
        s = np.clip(2.0 * begin / np.where(bottom == 0, 1.0, bottom), 0.0, 1.0)
        gain = width * s * (begin + s * (B / 2.0 + s * A / 3.0))
        beyond_end = np.where(begin > 0, q[:, a] + gain - high[:, None], low[:, None] - q[:, a] - gain)
        turns = (begin * end < 0) & (beyond_end + np.abs(gain) > 0) & (nodes.place[a] >= 0.0)
        _, step = np.nonzero(turns)
        if not step.size:
            break
        place = nodes.place[a[step]] + s[turns] * width[step]
        track, which = nodes.track[a[step]], nodes.which[a[step]]
        drive = follower.paths.drive(track, place)
        closed = follower.newton.nodes(between(step, place, drive), drive, track, which, PATH.node)
        nodes = Nodes.join([nodes, Nodes.closed(closed, drive, track, place, sure=True).take(closed.done)])
    return nodes


FIRST_CORNERS, MOST_CORNERS = 4, 128
"""Corners to which ways are tried together: of one polygon at first, and of all at most."""


@dataclass
class _Polygon:
    """A request, its ``points (d, M)`` with their ``places``, and the corners at which it may be taken up again.

    ``tracks`` are those followed for it, ``ended`` the place from which on nothing was reached (None: it was reached to its end).
    ``corners (d, K)`` lie ``at`` places of it, on an ``edge`` that begins at another; the first one ``untried`` comes next.
    """

    request: Request
    points: Array
    places: Array
    tracks: list[int]
    ended: float | None
    corners: Array = field(init=False)
    at: Array = field(init=False)
    edge: Array = field(init=False)
    untried: int = 0

    def __post_init__(self) -> None:
        """Divide the polygon."""
        keep = np.flatnonzero(np.diff(self.places, prepend=-1.0) > 0)
        points, places = self.points[:, keep], self.places[keep]
        unit = np.diff(points) / np.diff(places)
        bent = (unit[:, 1:] * unit[:, :-1]).sum(axis=0) <= STRAIGHT_ON
        ends = np.concatenate([[0], 1 + np.flatnonzero(bent), [len(places) - 1]])
        corners, at, edge = [points[:, :0]], [places[:0]], [places[:0]]
        for a, b in pairwise(ends.tolist()):
            # most parts into which an edge is divided
            n = int(np.clip(np.ceil((places[b] - places[a]) / PATH.longest), 1, 64))
            u = np.arange(1, n + 1) / n
            corners.append(points[:, a, None] + u * (points[:, b] - points[:, a])[:, None])
            at.append(np.append(places[a] + u[:-1] * (places[b] - places[a]), places[b]))
            edge.append(np.full(n, places[a]))
        self.corners, self.at, self.edge = np.concatenate(corners, axis=1), np.concatenate(at), np.concatenate(edge)

        self.end(self.ended)

    def end(self, at: float | None) -> None:
        """Say up to which place the polygon was followed."""
        self.ended = at
        self.untried = len(self.at) if at is None else int(np.searchsorted(self.at, at, side="right"))


@dataclass(frozen=True)
class _Way:
    """A straight line to a corner from a ``place`` of a ``track``."""

    polygon: int
    corner: int
    track: int
    place: float
    line: Array


def along_polygons_with_gaps(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """Several drivers: all positions; see the head of this file."""
    found = _within_ranges(path, along_polygons(path, requests, total))
    polygons = []
    for i, request in enumerate(requests):
        if (ended := _ended(found, i)) is not None:
            points = request.polygon(path.rows)
            polygons.append(_Polygon(request, points, places_of(points), [i], ended))
    # most gaps behind which a polygon is taken up again
    for _ in range(200):
        ways = _ways_back(path, found, polygons)
        if not ways:
            break
        known, again, back = len(found.tracks.end), [], []
        for way in ways:
            ahead, behind = _requests(found, polygons[way.polygon], way)
            again.append(ahead)
            back += behind
        variants = path.variant_of
        more = _within_ranges(path, along_polygons(path, again + back, total))
        path.variant_of = np.concatenate([variants, path.variant_of])
        places = [request.places for request in again]
        places += [r.places[more.moved[r.places]] for r in back]
        found.take_up(more, np.concatenate(places))
        for i, way in enumerate(ways):
            polygon = polygons[way.polygon]
            ended = _ended(more, i)
            polygon.tracks.append(known + i)
            # both end with the last position
            polygon.end(None if ended is None else ended - float(more.follower.paths.end[i]) + polygon.places[-1])
        for i, request in enumerate(back):
            owner = next(p for p in polygons if np.isin(request.places[0], p.request.places))
            owner.tracks.append(known + len(again) + i)
    return found


def _within_ranges(path: DriverPath, found: Positions) -> Positions:
    """All positions, each track up to where a coordinate leaves its range."""
    end_at_ranges(path, found)
    end_beside_poles(path, found)
    return found


def _ended(found: Positions, track: int) -> float | None:
    """The place where a track ended before its end."""
    return None if found.tracks.end[track] is End.REACHED else float(found.nodes_of(track).place[-1])


def _reached(found: Positions, track: int) -> tuple[Array, Array]:
    """The points of a track ``(d, n)`` as far as it was reached, and their places."""
    points, end = found.follower.paths.points[track], found.nodes_of(track).place[-1]
    places = found.follower.paths.length[track]
    inside = (places < end) | (places == 0.0)
    last = found.follower.paths.drive(np.array([track]), np.array([end]))
    return np.concatenate([points[:, inside], last], axis=1), np.append(places[inside], end)


def _nearest(points: Array, places: Array, corners: Array) -> tuple[Array, Array, Array]:
    """The points of a polyline nearest to ``corners (d, K)``: distances, places and the points themselves."""
    a, along = points[:, :-1, None], np.diff(points)[:, :, None]
    size = (along * along).sum(axis=0)
    u = ((corners[:, None] - a) * along).sum(axis=0) / np.where(size > 0, size, 1.0)
    foot = a + np.clip(u, 0.0, 1.0) * along
    distance = np.sqrt(((foot - corners[:, None]) ** 2).sum(axis=0))
    best, k = np.argmin(distance, axis=0), np.arange(corners.shape[1])
    place = places[best] + np.clip(u, 0.0, 1.0)[best, k] * np.diff(places)[best]
    return distance[best, k], place, foot[:, best, k]


def _ways_to(found: Positions, polygons: list[_Polygon], number: int, count: int) -> list[_Way]:
    """The ways to the next ``count`` corners of a polygon that were not tried yet: from the nearest point, from the start."""
    polygon = polygons[number]
    pick = np.arange(polygon.untried, min(polygon.untried + count, len(polygon.at)))
    polygon.untried += len(pick)
    corners = polygon.corners[:, pick]
    lines = [_nearest(*_reached(found, track), corners) for track in polygon.tracks]
    which = np.argmin([distance for distance, _, _ in lines], axis=0)
    out = []
    for i, corner in enumerate(pick.tolist()):
        nearest = (polygon.tracks[which[i]], float(lines[which[i]][1][i]), lines[which[i]][2][:, i])
        start = (polygon.tracks[0], 0.0, polygon.points[:, 0])
        for track, place, point in (nearest, start):
            # the edge itself did not lead there
            if track != polygon.tracks[0] or place < polygon.edge[corner]:
                out.append(_Way(number, corner, track, place, np.stack([point, corners[:, i]], axis=1)))
    return out


def _ways_back(path: DriverPath, found: Positions, polygons: list[_Polygon]) -> list[_Way]:
    """For every polygon that did not end the first way that leads back to it, where there is one."""
    out: dict[int, _Way] = {}
    count = FIRST_CORNERS
    while True:
        open_ = [i for i, p in enumerate(polygons) if p.ended is not None and i not in out and p.untried < len(p.at)]
        if not open_:
            break
        count = max(FIRST_CORNERS, min(count, MOST_CORNERS // len(open_)))
        ways = [way for i in open_ for way in _ways_to(found, polygons, i, count)]
        count *= 2
        for way, rest in zip(ways, _left(path, found, ways), strict=True):
            if rest <= 0.0:
                out.setdefault(way.polygon, way)
    return list(out.values())


def _left(path: DriverPath, found: Positions, ways: list[_Way]) -> Array:
    """How much of every way was not reached, in steps of fair size."""
    if not ways:
        return np.zeros(0)
    tracks, at = np.array([way.track for way in ways]), np.array([way.place for way in ways])
    lines = [way.line for way in ways]
    x, which = _states(path, found, tracks, at, np.stack([line[:, 0] for line in lines], axis=1))
    variants, path.variant_of = path.variant_of, path.variant_of[tracks]
    follower, paths = Follower(path), Paths(lines)
    nodes = follower.follow(x, paths, which=which, careful=False).nodes
    outside = range_ends(path, follower, nodes, np.full(len(ways), np.inf))[0]
    path.variant_of = variants
    end = np.where(follower.stuck, -np.inf, 0.0)
    np.maximum.at(end, nodes.track, np.where(follower.stuck[nodes.track], -np.inf, nodes.place))
    return np.asarray(paths.end - np.minimum(end, outside))


def _states(path: DriverPath, found: Positions, tracks: Index, at: Array, drive: Array) -> tuple[Array, Index]:
    """Closed states at places of tracks; of one that nowhere goes on its start."""
    nodes, interpolation = found.tracks.nodes, Interpolation(path, found.tracks.nodes)
    start = np.searchsorted(nodes.track, tracks)
    x, which = nodes.x[:, start], nodes.which[start]
    goes = np.flatnonzero(np.isin(tracks, nodes.track[interpolation.left]))
    if goes.size:
        tracks, at, drive = tracks[goes], at[goes], drive[:, goes]
        step = interpolation.find(tracks, at)
        form = nodes.which[interpolation.left[step]]
        closed = found.follower.newton.close(interpolation(step, at, drive), drive, tracks, form)
        x[:, goes], which[goes] = closed.x, closed.which
    return x, which


def _requests(found: Positions, polygon: _Polygon, way: _Way) -> tuple[Request, list[Request]]:
    """What is asked behind a way back: the polygon onwards from there, and back into the gap."""
    points, places = _reached(found, way.track)
    via = np.concatenate([points[:, 1:][:, places[1:] < way.place], way.line], axis=1)
    request, count = polygon.request, polygon.request.values.shape[1]
    at, entry = polygon.places[-count:], polygon.at[way.corner]
    assert polygon.ended is not None
    ahead = at >= entry
    behind = np.flatnonzero((at > polygon.ended) & ~ahead)[::-1]
    parts = [
        Request(request.x, request.variant, request.values[:, mine], request.places[mine], via)
        for mine in (np.flatnonzero(ahead), behind)
        if len(mine)
    ]
    return parts[0], parts[1:]


@dataclass
class _Curve:
    """Positions of a request to one side of its start, ``way (n,)`` from there, and the ``period`` and ``shift (F,)`` of the motion."""

    request: Request
    sense: float
    mine: Index
    way: Array
    period: float = np.inf
    shift: Array | None = None
    ends: bool = False
    """Whether the curve ends before the motion may repeat itself."""

    @property
    def length(self) -> float:
        """How far the curve is to be followed."""
        return float(min(self.way.max(), self.period))


def follow(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """States at all positions asked for; ``total`` positions in all."""
    if path.size[1] != 1:
        return along_polygons_with_gaps(path, requests, total)
    return _within_ranges(path, _along_curves(path, requests, total))


def _along_curves(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """One driver: from every start one track up and one down."""
    ways = []
    for request in requests:
        along = request.values[0] - request.x[path.rows[0]]
        for sense, there in ((1.0, along >= 0), (-1.0, along < 0)):
            if there.any():
                ways.append(_Curve(request, sense, np.flatnonzero(there), sense * along[there]))
    turn = path.system.periods[path.columns[0]]
    if np.isfinite(turn):
        # turns of the driver over which a motion is followed to see whether it repeats itself, one number after the other
        for most in (1, 4, 16):
            # worth it where positions lie twice as far
            far = [way for way in ways if way.period == np.inf and not way.ends and way.way.max() > 2 * most * turn]
            if far:
                _find_periods(path, far, most)
    legs = Legs(path, total)
    turns = np.zeros(total, dtype=np.intp)
    for way in ways:
        begin, places = way.request.x[path.rows[0]], way.request.places[way.mine]
        values, at = way.request.values[:, way.mine], way.way
        if way.period < np.inf:
            turns[places] = np.floor(at / way.period)
            at = np.clip(at - way.period * turns[places], 0.0, way.period)
            values = np.where(turns[places] > 0, begin + way.sense * at, values)
        # part of a driver's value up to which a position is the start itself: so near to it nothing is followed, dead point or not
        ahead = way.length > 1e-14 * max(1.0, abs(begin))
        points = np.array([[begin, begin + way.sense * way.length] if ahead else [begin]])
        legs.add(way.request, points, values, places, at)
    found, _ = legs.followed()
    if turns.any():
        found.turns, found.gained = turns, np.zeros((path.system.n_freedoms, total))
        for way in ways:
            if way.shift is not None:
                places = way.request.places[way.mine]
                found.gained[:, places] = way.shift[:, None] * turns[places]
        found.reached += found.gained[path.columns]
    return found


def _find_periods(path: DriverPath, ways: list[_Curve], most: int) -> None:
    """Follow the motion over some turns of the driver and note where it repeats itself."""
    path.variant_of = np.array([way.request.variant for way in ways], dtype=np.intp)
    x = np.stack([way.request.x for way in ways], axis=1)
    ends = path.system.periods[path.columns[0]] * np.arange(most + 1.0)
    points = [x[path.rows, v][:, None] + way.sense * ends for v, way in enumerate(ways)]
    follower = Follower(path)
    tracks = followed(follower, x, Paths(points, [np.ones(most + 1, dtype=bool)] * len(ways)))
    crossed = {track for track, _ in tracks.crossings}
    for v, way in enumerate(ways):
        nodes = tracks.nodes.take(tracks.nodes.track == v)
        way.ends = nodes.place[-1] < ends[-1]
        for end in ends[1:]:
            at, start = np.flatnonzero(np.abs(nodes.place - end) < 1e-9), nodes.take(nodes.place == 0.0)
            shift = _shift(path, follower, nodes.take(at[:1]), start, v in crossed) if at.size else None
            if shift is not None:
                way.period, way.shift = float(end), shift
                break


def _shift(path: DriverPath, follower: Follower, node: Nodes, start: Nodes, crossed: bool) -> Array | None:
    """Whole turns ``(F,)`` that the freedoms have gained where the motion is back at its start; None where it is not."""
    system = path.system
    x = follower.newton.close(node.x, node.drive, node.track, node.which).x
    gained = path.difference(x, start.x)[:, 0]
    turning = (system.single_rows >= 0) & np.isfinite(system.periods)
    shift = np.where(turning, system.rounds(np.arange(system.n_freedoms), gained), 0.0)
    here = path.at(start.x, start.drive, start.track)
    free = path.factored(here, start.which).motions()[:, :, 0]
    left = gained - shift
    if free.shape[1]:
        # what is left free is not followed but carried; beside a change point it is not
        left = (
            np.full_like(left, np.inf)
            if crossed or not path.carries
            else left - free @ np.linalg.lstsq(free, left, rcond=None)[0]
        )
    turned = start.x.copy()
    turned[system.single_rows[turning]] += shift[turning][:, None]
    again = path.at(turned, turned[path.rows], start.track)
    # screws and couplings of freedoms that have gained turns may not be back
    # distance (radians, lengths / L) up to which a motion is back: rounding over a poor condition; shifts are whole turns or nothing
    back_again = 1e-11
    back = np.abs(again.poses - here.poses).max() <= back_again and again.closure[0] <= back_again + here.closure[0]
    return shift if back and np.abs(left).max(initial=0.0) <= back_again else None
