"""Reactions of least norm in a large mechanism: one sparse saddle system over all loop wrenches.

Loop wrenches ``x`` that load no free freedom change the reaction parts by ``R x``; wanted is the least ``|r0 + R x|^2`` with
``J^T x = 0``, in the measure ``|F|^2 + |M / L|^2`` at the pair points:

    [ R^T R   J ] [x]   [ -R^T r0 ]
    [ J^T     0 ] [z] = [    0    ]

Source: Golub and Van Loan, Matrix Computations, section 12.1 (equality constrained least squares), as an augmented system.
"""

from __future__ import annotations

import numpy as np
import scipy

from mechgraph.algebra.screw import shift_wrench
from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.follow import SparseNode
from mechgraph.numerics.sparse import Pattern
from mechgraph.structure.reaction_split import at_pair_points


def least_change(here: Configuration, node: SparseNode, reactions: Array) -> Array:
    """Loop wrenches ``(6 loops,)`` of one position that take the reaction parts ``(6, P)`` to their least norm.

    ``here`` holds that one position; both are about the internal origin.
    """
    R = reaction_map(here, node)
    H, J = scipy.sparse.coo_array(R.T @ R), scipy.sparse.coo_array(node.loops.turned_matrix(here.S[:, :, 0]))
    rows, size = H.shape[0], H.shape[0] + J.shape[1]
    pattern = Pattern(
        np.concatenate([H.row, J.row, rows + J.col]).astype(np.intp),
        np.concatenate([H.col, rows + J.col, J.row]).astype(np.intp),
        size,
    )
    factor = pattern.factor(np.concatenate([H.data, J.data, J.data]))
    r0 = at_pair_points(here, reactions[:, :, None])[:, :, 0].T.reshape(-1)
    right = np.zeros((size, 1))
    right[:rows, 0] = -(R.T @ r0)
    return node.loops.wrenches_of_rows(factor.solve(right)[:rows] * node.loops.unit)


def reaction_map(here: Configuration, node: SparseNode) -> scipy.sparse.csr_array:
    """``R (6 P, 6 loops)``: reaction parts at the pair points that unit multipliers of the turned rows of every loop bring."""
    s = here.system
    loop, pair, sign = s.graph.loop_steps
    unit = node.loops.unit * node.loops.unit_wrenches()[:, :, loop]
    points = here.pair_points[:, pair, 0]
    w = sign * np.stack([shift_wrench(unit[:, j], points) for j in range(6)], axis=1)
    S, E = (_at_points(here, part) for part in ("S", "E"))
    for g in s.groups:
        place = np.full(len(s.m.pairs), -1)
        place[g.pairs] = np.arange(len(g.pairs))
        mine = np.flatnonzero(place[pair] >= 0)
        columns = g.columns[:, place[pair[mine]]]
        effort = np.einsum("ifn,ijn->fjn", S[:, columns], w[:, :, mine])
        w[:, :, mine] -= np.einsum("ifn,fjn->ijn", E[:, columns], effort)
    rows = np.broadcast_to(6 * pair + np.arange(6)[:, None, None], w.shape)
    cols = np.broadcast_to(6 * loop + np.arange(6)[None, :, None], w.shape)
    shape = (6 * len(s.m.pairs), 6 * len(s.graph.loops))
    return scipy.sparse.csr_array((w.ravel(), (rows.ravel(), cols.ravel())), shape=shape)


def _at_points(here: Configuration, name: str) -> Array:
    """Twists ``S`` or effort wrenches ``E (6, F)`` of one position, taken about the points of their pairs."""
    screws = getattr(here, name)[:, :, 0]
    owner = np.repeat(np.arange(len(here.system.m.pairs)), np.diff(here.system.first_column))
    points = here.pair_points[:, owner, 0]
    if name == "E":
        return shift_wrench(screws, points)
    return np.concatenate([screws[:3], screws[3:] + np.cross(screws[:3], points, axis=0)])
