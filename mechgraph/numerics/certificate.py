"""Parts of the certificate of a step: its middle, and whether it lies on a smooth track (see ``continuation.Follower._certified``)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.hermite import cubic
from mechgraph.numerics.newton import Problem
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def between(problem: Problem, a: Nodes, b: Nodes, part: Array | float, drive: Array) -> Array:
    """States at a ``part`` of the way between neighbours, at path values ``drive (d, n)``, by Hermite interpolation of both ends."""
    h = b.place - a.place
    direction = (b.drive - a.drive) / h
    y = problem.difference(b.x, a.x)
    there = problem.tangent(y, (b.Z * direction).sum(axis=1))
    dq = cubic(y, (a.Z * direction).sum(axis=1), there, h, part * h)
    off = drive - a.drive - part * (b.drive - a.drive)
    dq += ((a.Z + part * (b.Z - a.Z)) * off).sum(axis=1)
    return problem.advance(a.x, dq, a.track)


def smooth(problem: Problem, a: Nodes, m: Nodes, b: Nodes, correction: Array, free: Array) -> Mask:
    """Whether states and rates in the middles ``m`` are those of the Hermite cubic of both ends, against the change of rates over the step.

    On a smooth track ``r_m = 3/2 (x_b - x_a) / h - (r_a + r_b) / 4`` and the correction of ``x_m`` vanishes, both to higher order than
    the change of rates; where a step leads from one branch onto another by a jump of the rates, the one holds for a jump at a sixth
    of the step, the other at a quarter, so never both. Motions left ``free (F, p, n)`` do not count: corrections move nodes along them.

    Nor need they be so smooth (accelerations of cams jump) where no other branch is as near. An end on another branch, ``d`` away from
    where the step should lead, makes ``2 h |r_m - ...| + 4 |correction| >= d``; and two solutions are at least ``2 / (|J^-1| |J'|)`` apart
    (``|J'|`` grows with the curvature of curves and surfaces, which may bend between two nodes and nowhere else).
    """
    h = b.place - a.place
    direction = (b.drive - a.drive) / h
    y = problem.difference(b.x, a.x)
    rates = [(a.Z * direction).sum(axis=1)]
    for node in (m, b):
        rates.append(problem.tangent(problem.difference(node.x, a.x), (node.Z * direction).sum(axis=1)))
    r_a, r_m, r_b = rates
    off_cubic = r_m - 1.5 * y / h + 0.25 * (r_a + r_b)
    if free.shape[1]:
        N = np.moveaxis(free, -1, 0)
        off_cubic -= (N @ (np.linalg.pinv(N) @ off_cubic.T[..., None]))[..., 0].T
    gap = np.abs(off_cubic).max(axis=0, initial=0.0)
    change = np.max([np.abs(p - q).max(axis=0, initial=0.0) for p, q in ((r_a, r_m), (r_m, r_b), (r_a, r_b))], axis=0)
    off = np.abs(m.drive - 0.5 * (a.drive + b.drive)).max(axis=0, initial=0.0) / h
    noise = (4.0 * off + 1e-6) * np.abs(r_m).max(axis=0, initial=0.0) + 1e-14 * m.condition / h
    noise += PATH.tiny / h  # branches that are no further apart are one
    on_cubic = (gap <= PATH.smooth * change + noise) & (correction <= h * (PATH.smooth * change / 8 + noise))
    # pivots do not tell how the inverse grows along a chain of loops, rates do
    size = np.max([np.abs(r).max(axis=0, initial=1.0) for r in rates], axis=0)
    size *= np.max([np.ones_like(h), a.condition, m.condition, b.condition], axis=0)
    size *= max(1.0, problem.bend / PATH.round)
    return np.asarray(on_cubic | (2.0 * h * gap + 4.0 * correction <= PATH.alone / size))
