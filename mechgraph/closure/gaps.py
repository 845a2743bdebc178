"""Polygons of several drivers taken up again behind gaps of the reach.

Behind a gap the points of the polygon (its corners, long edges divided) are tried in their order: along a straight line from the nearest
point that was reached before, or else from the start. From the first one that is reached that way the polygon is followed on, and back
into the gap. The rule is one of the polygon, not of the positions asked for on it, and every way is certified like any other path: it is
a track of its own that begins at the start, so that turns are counted and passive bodies carried along it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions, Request
from mechgraph.closure.indexing import Index
from mechgraph.closure.legs import along_polygons
from mechgraph.closure.ranges import end_at_ranges, range_ends
from mechgraph.numerics.continuation import End, Follower
from mechgraph.numerics.hermite import STRAIGHT_ON, Interpolation
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Paths, places_of

GAPS = 200
"""Most gaps behind which a polygon is taken up again."""
DIVISIONS = 64
"""Most parts into which an edge is divided."""
FIRST_CORNERS, MOST_CORNERS = 4, 128
"""Corners to which ways are tried together: of one polygon at first, and of all at most."""

SHORTLY, CAREFUL = 0.05, 8
"""Rest of a way that may be a poor condition only, and how many of these ways are followed carefully."""


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
            n = int(np.clip(np.ceil((places[b] - places[a]) / PATH.longest), 1, DIVISIONS))
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
    found = _within_ranges(path, requests, total)
    polygons = []
    for i, request in enumerate(requests):
        if (ended := _ended(found, i)) is not None:
            points = request.polygon(path.rows)
            polygons.append(_Polygon(request, points, places_of(points), [i], ended))
    for _ in range(GAPS):
        ways = _ways_back(path, found, polygons)
        if not ways:
            break
        known, again, back = len(found.tracks.end), [], []
        for way in ways:
            ahead, behind = _requests(found, polygons[way.polygon], way)
            again.append(ahead)
            back += behind
        variants = path.variant_of
        more = _within_ranges(path, again + back, total)
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


def _within_ranges(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """All positions, each polygon up to where a coordinate leaves its range."""
    found = along_polygons(path, requests, total)
    end_at_ranges(path, found)
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
    tried: list[_Way] = []
    left: list[float] = []
    count = FIRST_CORNERS
    while True:
        open_ = [i for i, p in enumerate(polygons) if p.ended is not None and i not in out and p.untried < len(p.at)]
        if not open_:
            break
        count = max(FIRST_CORNERS, min(count, MOST_CORNERS // len(open_)))
        ways = [way for i in open_ for way in _ways_to(found, polygons, i, count)]
        count *= 2
        missing = _left(path, found, ways)
        tried += ways
        left += missing.tolist()
        for way, rest in zip(ways, missing, strict=True):
            if rest <= 0.0:
                out.setdefault(way.polygon, way)
    for way in _nearly_passable(tried, left):
        first = out.get(way.polygon)
        if (first is None or way.corner < first.corner) and _left(path, found, [way], careful=True)[0] <= 0.0:
            out[way.polygon] = way
    return list(out.values())


def _nearly_passable(ways: list[_Way], left: list[float]) -> list[_Way]:
    """Ways that ended shortly before corners, nearer to them than to the next ones: a polygon may come back by as little."""
    least: dict[tuple[int, int], tuple[float, _Way]] = {}
    for way, rest in zip(ways, left, strict=True):
        key = way.polygon, way.corner
        if key not in least or rest < least[key][0]:
            least[key] = rest, way
    out = []
    for (polygon, corner), (rest, way) in least.items():
        beside = [least[polygon, k][0] for k in (corner - 1, corner + 1) if (polygon, k) in least]
        if 0.0 < rest < SHORTLY and rest <= min(beside, default=rest):
            out.append(way)
    return out[:CAREFUL]


def _left(path: DriverPath, found: Positions, ways: list[_Way], careful: bool = False) -> Array:
    """How much of every way was not reached, in steps of fair size unless ``careful``."""
    if not ways:
        return np.zeros(0)
    tracks, at = np.array([way.track for way in ways]), np.array([way.place for way in ways])
    lines = [way.line for way in ways]
    x, which = _states(path, found, tracks, at, np.stack([line[:, 0] for line in lines], axis=1))
    variants, path.variant_of = path.variant_of, path.variant_of[tracks]
    follower, paths = Follower(path), Paths(lines)
    nodes = follower.follow(x, paths, which=which, careful=careful).nodes
    outside = range_ends(path, follower, nodes, np.full(len(ways), np.inf))[0]
    path.variant_of = variants
    end = np.where(follower.stuck, -np.inf, 0.0)
    np.maximum.at(end, nodes.track, np.where(follower.stuck[nodes.track], -np.inf, nodes.place))
    return np.asarray(paths.end - np.minimum(end, outside))


def _states(path: DriverPath, found: Positions, tracks: Index, at: Array, drive: Array) -> tuple[Array, Index]:
    """Closed states at places of tracks; of one that nowhere goes on its start."""
    nodes = found.tracks.nodes
    interpolation = Interpolation(path, nodes)
    if not np.isin(tracks, nodes.track[interpolation.left]).all():
        start = np.searchsorted(nodes.track, tracks)
        x, which = nodes.x[:, start], nodes.which[start]
        goes = np.flatnonzero(np.isin(tracks, nodes.track[interpolation.left]))
        if goes.size:
            x[:, goes], which[goes] = _states(path, found, tracks[goes], at[goes], drive[:, goes])
        return x, which
    step = interpolation.find(tracks, at)
    which = interpolation.nodes.which[interpolation.left[step]]
    closed = found.follower.newton.close(interpolation(step, at, drive), drive, tracks, which)
    return closed.x, closed.which


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
