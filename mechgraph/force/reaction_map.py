"""What multipliers of the closure rows bring to the reaction parts and efforts, as sparse matrices of one position."""

from __future__ import annotations

import numpy as np
import scipy

from mechgraph.algebra.se3 import cross, shift_wrench
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index


def reaction_map(here: Configuration, t: int) -> scipy.sparse.csr_array:
    """``R (6 P, rows)`` at position ``t``: reaction parts at the pair points for unit wrenches of every loop; other rows bring none."""
    s = here.system
    loop, pair, sign = s.graph.loop_steps
    points = here.pair_points[:, :, t]
    about = (points[:, pair] - here.middles[:, loop, t])[:, None]
    w = shift_wrench(np.einsum("ij,n->ijn", np.eye(6), sign), about)
    owner = np.repeat(np.arange(len(s.m.pairs)), np.diff(s.first_column))
    E = shift_wrench(here.E[:, :, t], points[:, owner])
    S = here.S[:, :, t]
    S = np.concatenate([S[:3], S[3:] + cross(S[:3], points[:, owner])])
    for g in s.groups:
        place = np.full(len(s.m.pairs), -1)
        place[g.pairs] = np.arange(len(g.pairs))
        mine = np.flatnonzero(place[pair] >= 0)
        columns = g.columns[:, place[pair[mine]]]
        effort = np.einsum("ifn,ijn->fjn", S[:, columns], w[:, :, mine])
        w[:, :, mine] -= np.einsum("ifn,fjn->ijn", E[:, columns], effort)
    rows = np.broadcast_to(6 * pair + np.arange(6)[:, None, None], w.shape)
    cols = np.broadcast_to(6 * loop + np.arange(6)[None, :, None], w.shape)
    return scipy.sparse.csr_array((w.ravel(), (rows.ravel(), cols.ravel())), shape=(6 * len(s.m.pairs), s.n_rows))


def effort_map(here: Configuration, t: int, acting: Index) -> scipy.sparse.csr_array:
    """``M (n, rows)`` at position ``t``: efforts in the freedoms ``acting`` for unit multipliers of all rows, then minus the multipliers
    of the rows behind those of the loops.
    """
    s = here.system
    loop, pair, sign = s.graph.loop_steps
    step, place = np.nonzero(pair[:, None] == np.arange(len(s.m.pairs))[s.owners][acting])
    values = here.S[:, acting[place], t]
    values[3:] += cross(values[:3], here.middles[:, loop[step], t])
    values *= sign[step]
    shape = (6, len(step))
    rows, cols = np.broadcast_to(place, shape), 6 * loop[step] + np.arange(6)[:, None]
    efforts = scipy.sparse.csr_array((values.ravel(), (rows.ravel(), cols.ravel())), shape=(len(acting), s.n_rows))
    others = s.n_rows - 6 * len(s.graph.loops)
    return scipy.sparse.csr_array(
        scipy.sparse.vstack([efforts, -scipy.sparse.eye_array(others, s.n_rows, k=s.n_rows - others)])
    )
