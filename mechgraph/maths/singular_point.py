"""Places on a track where branches cross: recognized, passed, and the states at and beside them.

Crossings that a track has passed: states at and beside them, on the branch that is followed.

Where branches cross the matrix of the equations is singular, but the branch of continuous rates is smooth. Beside the crossing, rounding
times the condition number, which grows as the inverse of the distance, moves what Newton's method closes off the branch, and once more
the rates solved there. Nearer than ``WINDOW`` states are therefore interpolated between states on the branch on both sides.

Passing a crossing of branches in one leap: extrapolated across, and proved by states on both sides.

Where the inverse of the condition falls in proportion to the distance from a place ahead, branches cross there (or the path turns back).
The branch of continuous rates is extrapolated from nodes well before that place to nodes as far behind it, which must close with a
correction that is small against the distance to any other branch. That it is one branch which passes a true crossing is then asked of
the states in between: interpolated between both sides they must close, too. Where two branches pass each other at a distance ``g`` (a
crossing that a small change of the dimensions has opened), they leave ``g^2``; the careful march tells distances as small from none.

Crossings of branches shortly behind the end of a track or beside its start, passed as longer tracks pass them.

Beside a crossing states and rates are interpolated between both sides of it (see above). So that a position has the
same values wherever its path begins and ends, a path that does so beside a crossing is followed on, over the crossing; and no path is
led over a crossing from right before it, where rounding decides which branch it takes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from mechgraph.maths.newton import BENT, Nodes, Paths, Problem, largest, through
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.tracker import LEAD, End, Follower, Tracks
from mechgraph.memo import dataclass

WINDOW = 5e-3
"""Distance from a crossing below which states and rates are interpolated: accelerations lose rounding over its cube."""
SIDES = np.array([-6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]) / 6
"""Places of the states on both sides, in parts of a span."""
SPANS = (0.08, 0.02, 0.005)
"""Spans tried. With the first, polynomials through the sides are exact to rounding where the branch is analytic within a distance of
0.5; the others serve where another singular position is near."""
BETWEEN = np.linspace(-1.0, 1.0, 8)
"""Places between the nearest sides at which interpolated states are asked how they close; not the crossing itself."""


@dataclass(frozen=True)
class Crossing:
    """A crossing at ``place`` of a ``track``, at values ``drive (d,)`` that go on in ``direction (d,)``; ``sides``: nodes beside it."""

    problem: Problem
    track: int
    place: float
    drive: Array
    direction: Array
    sides: Nodes

    @property
    def window(self) -> float:
        """Distance from the crossing up to which positions are interpolated."""
        # part of the span of the sides within which they are: towards the outermost sides polynomials lose digits
        return min(WINDOW, 0.4 * float(self.sides.place[-1] - self.place))

    def drives(self, places: Array) -> Array:
        """Path values ``(d, n)`` at places beside the crossing."""
        return self.drive[:, None] + self.direction[:, None] * (places - self.place)

    @cached_property
    def _open(self) -> tuple[float, float]:
        nearest = float(np.abs(self.sides.place - self.place).min())
        at = self.place + nearest * BETWEEN
        tracks, which = np.full(len(at), self.track), np.repeat(self.sides.which[:1], len(at))
        point = self.problem.at(self.states(at), self.drives(at), tracks)
        f = self.problem.factored(point, which)
        sizes = (f.residual_size(r) for r in (point.residual, np.ones_like(point.residual) * point.rounding))
        miss, rounding = (float(size.max()) for size in sizes)
        # residual with which states close: the roundings of a thousand loops add up in it
        return miss, max(1e-12, rounding)

    @property
    def miss(self) -> float:
        """By how much the states between the nearest sides do not close: angles, and lengths over the sizes of their loops.

        Dimensions that differ by as much would open the crossing, so that the branches pass each other.
        """
        return self._open[0]

    @property
    def least_miss(self) -> float:
        """What is not told from none."""
        return self._open[1]

    def weights(self, places: Array) -> Array:
        """Lagrange's weights ``(sides, n)`` for values at places between the sides."""
        at = self.sides.place
        gaps = at[:, None] - at + np.eye(len(at))
        distance = places - at[:, None]
        others = ~np.eye(len(at), dtype=bool)
        return np.stack([distance[mine].prod(axis=0) for mine in others]) / gaps.prod(axis=1)[:, None]

    def error(self, places: Array, ddq: Array, errors: Array) -> Array:
        """Relative error ``(n,)`` of accelerations interpolated from those at the sides ``ddq (F, n, sides)`` of ``errors (n, sides)``.

        Theirs, and by how much the result changes where the outermost sides are left out.
        """
        weights, inner = (
            self.weights(places),
            replace(self, sides=self.sides.take(np.arange(1, len(self.sides) - 1))).weights(places),
        )
        inner = np.pad(inner, ((1, 1), (0, 0)))
        off = np.abs(np.einsum("fnk,kn->fn", ddq, weights - inner)).max(axis=0, initial=0.0)
        size = np.abs(ddq).max(axis=(0, 2), initial=1.0)
        return np.asarray((np.abs(weights) * errors.T).sum(axis=0) + off / size)

    def states(self, places: Array) -> Array:
        """States ``(nx, n)`` at places, interpolated between the sides."""
        x = self.sides.x
        base = x[:, [len(self.sides) // 2]]
        dq = self.problem.difference(x, base) @ self.weights(places)
        return self.problem.advance(np.repeat(base, len(places), axis=1), dq, np.full(len(places), self.track))

    def at_another(self, places: Array) -> Mask:
        """Which places ``(n,)`` lie on another crossing, passed together with this one: condition times distance from it is constant."""
        n, probe = len(places), 10.0 * PATH.dead_zone
        ends = [(places + probe * np.array([[far], [-far]])).ravel() for far in (1.0, 2.0)]
        tracks = np.full(2 * n, self.track)
        near, far = (self.problem.at(self.states(at), self.drives(at), tracks) for at in ends)
        which = self.problem.chosen(far, np.full(2 * n, -1))
        a, b = (self.problem.factored(point, which).condition for point in (near, far))
        away = np.abs(probe - probe * b / np.where(a > b, a - b, 1.0))
        return np.asarray(((a > b) & (away < PATH.dead_zone)).reshape(2, n).all(axis=0))


def passed(follower: Follower, nodes: Nodes, track: int, place: float) -> Crossing | None:
    """The crossing at a place of a track, with states beside it; None where none are found on one smooth branch."""
    problem, paths = follower.problem, follower.paths
    here = np.array([track])
    drive = paths.drive(here, np.array([place]))[:, 0]
    direction = (paths.drive(here, np.array([place + PATH.first])) - drive[:, None])[:, 0] / PATH.first
    mine = nodes.take(nodes.track == track)
    before = follower.with_lead(mine.take(mine.place < place), track)
    mine = Nodes.join([before, mine.take(mine.place > place)])
    # distance from a crossing below which a node is not used: its sensitivities lose rounding over the square
    mine = mine.take(np.abs(mine.place - place) > 1e-3)
    off = mine.drive - drive[:, None] - direction[:, None] * (mine.place - place)
    mine = mine.take(np.abs(off).max(axis=0, initial=0.0) < 1e-12)
    if not (mine.place > place).any() or not (mine.place < place).any():
        return None
    wanted = place + np.concatenate([-_DISTANCES[::-1], _DISTANCES])
    picked = mine.take(np.unique([int(np.argmin(np.abs(mine.place - at))) for at in wanted]))
    picked = picked.take(np.unique(picked.place, return_index=True)[1])
    base = picked.take(np.full(len(SIDES), np.searchsorted(picked.place, place) - 1))
    for span in SPANS:
        at = place + span * SIDES
        drives = drive[:, None] + direction[:, None] * (at - place)
        x = through(problem, picked, base, direction, at)
        found = follower.newton.nodes(x, drives, base.track, base.which, PATH.node)
        nearness = _answer(problem, found.x, drives, base.track, found.which) * np.abs(at - place)
        # factor within which the answer to a residual times the distance is constant where there is no other singular position near
        regular = nearness.max() <= 3.0 * nearness.min()
        if found.done.all() and (found.correction <= 1e-2 * span).all() and regular:
            return Crossing(
                problem, track, place, drive, direction, Nodes.closed(found, drives, base.track, at, sure=True)
            )
    return None


def _answer(problem: Problem, x: Array, drive: Array, tracks: Index, which: Index) -> Array:
    """How much states ``(nx, n)`` answer to a random residual: as the condition one over the distance, but no matter of pivots."""
    point = problem.at(x, drive, tracks)
    b = np.random.default_rng(3).normal(size=len(point.residual))
    return largest(problem.factored(point, which).solve(np.repeat(b[:, None, None], x.shape[1], axis=2))[:, 0])


_DISTANCES = 4e-3 * 3.0 ** np.arange(4)
"""Distances of the nodes from which the sides are predicted."""


BEHIND = np.array([0.02, 0.05, 0.09])
"""Distances of the nodes behind a crossing."""


def leapt(follower: Follower, nodes: Nodes) -> tuple[Crossing, Nodes] | None:
    """The crossing ahead of the last of the nodes of one track, and nodes behind it; None where the branch does not lead to any."""
    last = nodes.take(np.unique(nodes.place, return_index=True)[1])
    if len(last) < 3:
        return None
    if not last.condition[-3:].all():  # without loops nothing is singular
        return None
    inverse, place = 1.0 / last.condition[-3:], last.place[-3:]
    fall = np.diff(inverse) / np.diff(place)
    if not (fall < 0).all():
        return None
    ahead = -inverse[-1] / fall[-1]
    crossing = float(place[-1] + ahead)
    # distance of a crossing behind the last node up to which it is leapt at
    if not ahead < 0.2:
        return None
    # steps are short where they had to be halved: nodes as far apart as those behind
    # the branch is extrapolated from five nodes that are 0.05 apart
    spread = np.unique([int(np.argmin(np.abs(last.place - at))) for at in last.place[-1] - 0.05 * np.arange(5)])
    behind = _behind(follower, last.take(spread), crossing)
    if behind is None:
        return None
    crossing = _singular_between(last.take(np.array([-1])), behind.take(np.array([0])))
    found = passed(follower, Nodes.join([nodes, behind]), int(last.track[0]), crossing)
    if found is None or not found.miss <= found.least_miss:
        return None
    middle = len(found.sides) // 2
    crossing = _singular_between(*(found.sides.take(np.array([i])) for i in (middle - 1, middle)))
    return replace(found, place=crossing, drive=found.drives(np.array([crossing]))[:, 0]), behind


def _singular_between(a: Nodes, b: Nodes) -> float:
    """Where the inverse of the condition, proportional to the distance, falls to zero between two nodes."""
    return float((a.place * a.condition + b.place * b.condition)[0] / (a.condition + b.condition)[0])


def _behind(follower: Follower, last: Nodes, crossing: float) -> Nodes | None:
    """Nodes behind a crossing, on the branch of continuous rates."""
    problem, n = follower.problem, len(BEHIND)
    base = last.take(np.full(n, len(last) - 1))
    at = crossing + BEHIND
    drive = follower.paths.drive(base.track, at)
    direction = (drive[:, 0] - base.drive[:, 0]) / (at[0] - base.place[0])
    x = through(problem, last, base, direction, at)
    found = follower.newton.nodes(x, drive, base.track, base.which, PATH.node)
    # correction of a node behind, against its distance from the crossing, from which on it may be on another branch
    if not found.done.all() or (found.correction > 1e-2 * BEHIND).any():
        return None
    return Nodes.closed(found, drive, base.track, at, sure=True)


HEADING = 2 * WINDOW
"""Distance of a crossing, as the condition foretells it, up to which a track is followed on."""


def followed(follower: Follower, x: Array, paths: Paths) -> Tracks:
    """All tracks of a follower, with the crossings beside their starts and ends.

    Nodes behind the ends and before the starts, at places below zero, tell how the branches come from the crossings.
    """
    tracks = follower.follow(x, paths)
    poor = np.count_nonzero(tracks.nodes.condition > PATH.fair)
    if poor:
        tracks = _begun_before(follower, tracks)
        alone = _alone_beside(follower, tracks)
    for side in (1, -1) if poor or tracks.crossings else ():
        tracks = _followed_on(follower, tracks, side, alone) if poor else tracks
        tracks = _with_sides(follower, tracks, side)
    return tracks


def _begun_before(follower: Follower, tracks: Tracks) -> Tracks:
    """Tracks that start shortly before a crossing taken up well before it."""
    nodes, paths, every = tracks.nodes, follower.paths, np.arange(len(tracks.end))
    start = nodes.take(_outermost(nodes.track, every, -1))
    left, right = nodes.steps
    first = nodes.place[left] == 0.0
    beside = _near(nodes, left[first], right[first])
    poor = np.intersect1d(np.flatnonzero(start.condition > PATH.fair), nodes.track[left[first][beside]])
    if not poor.size:
        return tracks
    back = _straight_on(follower, nodes, start, paths.drive(every, np.full(len(every), -LEAD)), poor)
    heading = _heading(back, start, -1)
    if not heading.size:
        return tracks
    begin = _most_regular(back.nodes)
    points, stops = list(begin.drive.T[:, :, None]), [np.zeros(1, dtype=bool)] * len(every)
    for v in heading:
        points[v] = np.concatenate([points[v], paths.points[v]], axis=1)
        stops[v] = np.append(False, paths.stops[v])
    again = Follower(follower.problem, work=follower.work).follow(begin.x, Paths(points, stops), which=begin.which)
    more = again.nodes.take(np.isin(again.nodes.track, heading))
    more = replace(more, place=more.place - begin.place[more.track])
    kept = ~np.isin(nodes.track, heading) | (nodes.place == 0.0)
    crossings = [(v, place) for v, place in tracks.crossings if v not in heading]
    crossings += [(v, float(place - begin.place[v])) for v, place in again.crossings]
    ends = [again.end[v] if v in heading else end for v, end in enumerate(tracks.end)]
    return replace(
        tracks, nodes=Nodes.join([nodes.take(kept), more.take(more.place != 0.0)]), end=ends, crossings=crossings
    )


def _alone_beside(follower: Follower, tracks: Tracks) -> Index:
    """Tracks of a start alone beside a crossing; a short step tells."""
    nodes, paths = tracks.nodes, follower.paths
    one = np.flatnonzero(paths.end[nodes.track] == 0.0)
    if (
        len(paths.points[0]) > 1 or not (nodes.condition[one] > PATH.fair).any()
    ):  # of several values a point has no direction
        return one[:0]
    start = nodes.take(_outermost(nodes.track, np.arange(len(tracks.end)), -1))
    poor = one[nodes.condition[one] > PATH.fair]
    tried = _straight_on(follower, nodes, start, start.drive + HEADING, nodes.track[poor], HEADING, careful=False).nodes
    left, right = tried.steps
    return np.setdiff1d(nodes.track[poor], tried.track[left[~_near(tried, left, right)]])


def _followed_on(follower: Follower, tracks: Tracks, side: int, alone: Index) -> Tracks:
    """Tracks with the crossings shortly behind their ends (``side`` 1) or before their starts (-1)."""
    nodes, crossings, every = tracks.nodes, list(tracks.crossings), np.arange(len(tracks.end))
    base = nodes.take(_outermost(nodes.track, every, side))
    heading = np.union1d(_heading(tracks, base, side), alone)
    if not heading.size:
        return tracks
    back, ahead = (follower.paths.drive(every, base.place + way * side * LEAD) for way in (-1.0, 1.0))
    # from well before the crossing, where the branches are apart
    found = _straight_on(follower, nodes, base, back, heading).nodes
    begin = _most_regular(found)
    over = _straight_on(follower, nodes, begin, ahead, heading, leads=True)
    for v in heading[begin.place[heading] > 0.0].tolist():
        mine = over.nodes.take(over.nodes.track == v)
        ways = mine.place - begin.place[v]
        met = [place - begin.place[v] for track, place in over.crossings if track == v]
        met = [way for way in met if 0.0 < way < ways.max()]
        if not met or met[0] > HEADING:
            continue
        crossings += [(v, float(base.place[v] + side * way)) for way in met]
        mine = replace(mine, place=base.place[v] + side * ways)
        # what is nearer to the crossing than the nodes that lead over it is noise; starts and ends of periods are asked for
        noise = np.abs(nodes.place - crossings[-len(met)][1]) < np.abs(ways - met[0]).min()
        asked = (nodes.place == 0.0) | (nodes.place == follower.paths.end[nodes.track])
        nodes = nodes.take((nodes.track != v) | ~noise | asked)
        # of short tracks they lie behind the other end as well, and where paths bend not on them
        own = nodes.place[nodes.track == v]
        off = np.abs(mine.drive - follower.paths.drive(mine.track, mine.place)).max(axis=0)
        nodes = Nodes.join([nodes, mine.take(((mine.place > own.max()) | (mine.place < own.min())) & (off < BENT))])
    return replace(tracks, nodes=nodes, crossings=crossings)


def _with_sides(follower: Follower, tracks: Tracks, side: int) -> Tracks:
    """Tracks with nodes on both sides of crossings that lie shortly before their ends (``side`` 1) or behind their starts (-1)."""
    nodes, every = tracks.nodes, np.arange(len(tracks.end))
    base = nodes.take(_outermost(nodes.track, every, side))
    near = [v for v, place in tracks.crossings if 0.0 <= side * (base.place[v] - place) < SPANS[0]]
    short = np.unique([v for v in near if side < 0 or tracks.end[v] is End.REACHED]).astype(np.intp)
    if not short.size:
        return tracks
    found = _straight_on(follower, nodes, base, follower.paths.drive(every, base.place + side * LEAD), short).nodes
    found = found.take(found.place > 0.0)
    return replace(
        tracks, nodes=Nodes.join([nodes, replace(found, place=base.place[found.track] + side * found.place)])
    )


def _straight_on(
    follower: Follower,
    known: Nodes,
    base: Nodes,
    ends: Array,
    some: Index,
    first: float | None = None,
    leads: bool = False,
    careful: bool = True,
) -> Tracks:
    """What a follower finds on straight ways of ``some`` tracks, ``known`` by nodes, from nodes ``base`` to path values ``ends (d, V)``."""
    begin, least = base.drive, np.full(base.drive.shape[1], np.inf)
    np.minimum.at(least, known.track, known.condition)
    ways = [np.stack([begin[:, v], ends[:, v]], axis=1) if v in some else begin[:, [v]] for v in range(begin.shape[1])]
    walk = Follower(follower.problem, leads, follower.work)
    return walk.follow(base.x, Paths(ways), first, base.which, careful, least)


def _outermost(track: Index, tracks: Index, side: int) -> Index:
    """Places of the last (``side`` 1) or the first (-1) of some ``tracks`` in a sorted array."""
    return np.searchsorted(track, tracks, side="right") - 1 if side > 0 else np.searchsorted(track, tracks)


def _most_regular(nodes: Nodes) -> Nodes:
    """The node of least condition of every track: the way back from one singular point may end at another, as between two folds."""
    order = np.lexsort((nodes.condition, nodes.track))
    return nodes.take(order[np.unique(nodes.track[order], return_index=True)[1]])


def _near(nodes: Nodes, here: Index, there: Index) -> Mask:
    """Whether the condition, which is as one over the distance, tells of a crossing beside nodes ``here`` by what it is ``there``."""
    a, b = nodes.condition[here], nodes.condition[there]
    return np.abs(nodes.place[there] - nodes.place[here]) * b < HEADING * np.abs(a - b)


def _heading(tracks: Tracks, base: Nodes, side: int) -> Index:
    """The tracks that head for a crossing shortly behind their end nodes ``base``."""
    nodes = tracks.nodes
    left, right = nodes.steps
    poor = base.condition > PATH.fair
    if side > 0:
        poor &= np.array([end is End.REACHED for end in tracks.end])
    moved = np.intersect1d(np.flatnonzero(poor), nodes.track[left])
    step = _outermost(nodes.track[left], moved, side)
    inner, outer = (left[step], right[step]) if side > 0 else (right[step], left[step])
    near = _near(nodes, outer, inner) & (nodes.condition[outer] > nodes.condition[inner])
    for track, place in tracks.crossings:
        near &= (moved != track) | (place < nodes.place[left[step]]) | (place > nodes.place[right[step]])
    return moved[near]
