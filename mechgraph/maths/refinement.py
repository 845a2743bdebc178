"""Nodes between nodes, until interpolation between them is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.track import Interpolation, Nodes
from mechgraph.maths.tracker import Follower


def refined(follower: Follower, nodes: Nodes, count: int) -> Nodes:
    """Nodes with further ones between them until interpolation is exact, or until they are too many for ``count`` positions.

    First one in the middle of every step, which tells the error there; then as many as that error asks for.
    """
    left, _ = nodes.steps
    parts = np.full(len(left), 2)
    if not len(left) or int(parts.sum()) * PATH.worth > count:
        return nodes
    exact = follower.newton.nodes(nodes.x, nodes.drive, nodes.track, nodes.which, PATH.exact)
    nodes = replace(nodes, x=exact.x, Z=np.where(exact.done, exact.Z, nodes.Z))
    for _ in range(PATH.refinements):
        if not (parts > 1).any() or int(parts.sum()) * PATH.worth > count:
            break
        interpolation = Interpolation(follower.problem, nodes)
        step = np.repeat(np.arange(len(parts)), parts - 1)
        share = np.concatenate([np.arange(1, n) / n for n in parts])
        a, b = interpolation.left[step], interpolation.right[step]
        place = nodes.place[a] + share * (nodes.place[b] - nodes.place[a])
        drive, track, which = follower.paths.drive(nodes.track[a], place), nodes.track[a], nodes.which[a]
        found = follower.newton.nodes(interpolation(step, place, drive), drive, track, which, PATH.exact)
        good = found.done & (found.correction <= PATH.correction)
        new = Nodes.closed(found, drive, track, place, sure=True).take(good)
        error = np.zeros(len(parts))
        np.maximum.at(error, step, np.where(good, found.correction, 0.0))
        parts = _divisions(error, parts, np.bincount(step[good], minlength=len(parts)))
        nodes = Nodes.join([nodes, new])
    return nodes


def _divisions(error: Array, parts: Index, added: Index) -> Index:
    """Into how many parts every step is to be cut next, from the error of interpolation in the step that it lies in."""
    halvings = np.zeros(len(error), dtype=np.intp)
    for _ in range(PATH.halvings):
        above = error > PATH.interpolation / PATH.gain
        halvings[above] += 1
        error = np.where(above, error * PATH.gain, error)
    out = np.repeat(2**halvings, added + 1)
    for _ in range(PATH.halvings):
        # neighbours at most twice as dense: interpolation reaches over both
        out[1:] = np.maximum(out[1:], out[:-1] // 2)
        out[:-1] = np.maximum(out[:-1], out[1:] // 2)
    return out
