"""Passing a crossing of branches in one leap: extrapolated across, and proved by states on both sides.

Where the inverse of the condition falls in proportion to the distance from a place ahead, branches cross there (or the path turns back).
The branch of continuous rates is extrapolated from nodes well before that place to nodes as far behind it, which must close with a
correction that is small against the distance to any other branch. That it is one branch which passes a true crossing is then asked of
the states in between: interpolated between both sides they must close, too. Where two branches pass each other at a distance ``g`` (a
crossing that a small change of the dimensions has opened), they leave ``g^2``; the careful march tells distances as small from none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.crossings import Crossing, passed
from mechgraph.numerics.hermite import through
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

Array = NDArray[np.float64]

NODES = 5
"""Nodes from which the branch is extrapolated."""
APART = 0.05
"""Distance between them."""
LONGEST_LEAP = 0.2
"""Distance of a crossing behind the last node up to which it is leapt at."""
BEHIND = np.array([0.02, 0.05, 0.09])
"""Distances of the nodes behind a crossing."""
OFF = 1e-2
"""Correction of a node behind, against its distance from the crossing, from which on it may be on another branch."""


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
    if not ahead < LONGEST_LEAP:
        return None
    # steps are short where they had to be halved: nodes as far apart as those behind
    spread = np.unique([int(np.argmin(np.abs(last.place - at))) for at in last.place[-1] - APART * np.arange(NODES)])
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
    if not found.done.all() or (found.correction > OFF * BEHIND).any():
        return None
    return Nodes.closed(found, drive, base.track, at, sure=True)
