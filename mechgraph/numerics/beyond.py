"""Crossings of branches shortly behind the end of a track or beside its start, passed as longer tracks pass them.

Beside a crossing states and rates are interpolated between both sides of it (see ``numerics.crossings``). So that a position has the
same values wherever its path begins and ends, a path that does so beside a crossing is followed on, over the crossing; and no path is
led over a crossing from right before it, where rounding decides which branch it takes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.continuation import LEAD, End, Follower, Tracks
from mechgraph.numerics.crossings import SPANS, WINDOW
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import BENT, Nodes, Paths

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

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
    first: float = PATH.first,
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
