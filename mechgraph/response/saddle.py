"""Accelerations of many freedoms by one sparse factorization a state: the accelerations of all links stay unknowns.

The mass matrix of the independent rates is full: every link moves with all freedoms on its way to the frame. Gauss' principle with the
accelerations ``A`` of the links as unknowns of their own, and the way along the tree as a constraint, is sparse (a saddle point system),
so that the effort grows with the number of links, not with its square or third power:

    [ I   0        D^T  ] [A ]   [W            ]
    [ 0   0     -(SZ)^T ] [v'] = [Z^T tau      ]     D A = A_link - A_parent,   (SZ)_kl = sum over freedoms j of the pair: s S_j Z_jl
    [ D  -SZ       0    ] [mu]   [0            ]

for the tree's pairs ``k``, independent rates ``l`` and the sense ``s`` of the tree; ``-mu`` are the wrenches that carry the loads along it.
Source of the form: Featherstone, Rigid Body Dynamics Algorithms, 2008, section 3.2 (Gauss' principle), chapter 10.
"""

from __future__ import annotations

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.closure.tree import Tree
from mechgraph.numerics.sparse import Factors

SIX = np.arange(6)
SOUND = 1e-7
"""Smallest pivot, against unit rows, from which on a factorization is trusted; below, motions may have no inertia."""


def saddle_accelerations(
    tree: Tree, pair_of: Index, S: Array, Z: Array, inertia: Array, loads: Array, forces: Array
) -> Array | None:
    """``v' (n,)`` at one state; None where the system is nearly singular.

    ``pair_of (F,)``: pair of every freedom; ``S (6, F)``, ``Z (F, n)``; ``inertia (6, N, 6)`` of the links about the origin of ``S``;
    ``loads (6, N)`` on the links, generalized ``forces (n,)`` of efforts.
    """
    n, N = Z.shape[1], len(tree.children)
    place = np.full(tree.n_links, -1, dtype=np.intp)
    place[tree.children] = np.arange(N)
    inner = np.flatnonzero(place[tree.parents] >= 0)
    masses = inertia[:, tree.children].transpose(1, 0, 2)
    size = np.abs(masses).max(initial=0.0) or 1.0
    link = 6 * np.arange(N)[:, None, None]
    D = scipy.sparse.eye_array(6 * N) - _entries(
        6 * inner[:, None] + SIX,
        6 * place[tree.parents[inner]][:, None] + SIX,
        np.ones((len(inner), 6)),
        (6 * N, 6 * N),
    )
    rows, cols, values = np.broadcast_arrays(link + SIX[:, None], link + SIX, masses / size)
    mass = _entries(rows, cols, values, (6 * N, 6 * N))
    SZ = _tree_twists(tree, pair_of, S) @ scipy.sparse.csr_array(Z)
    A = scipy.sparse.block_array(
        [[mass, None, D.T], [None, scipy.sparse.csr_array((n, n)), -SZ.T], [D, -SZ, None]], format="csc"
    )
    try:
        factors = Factors(A)
    except RuntimeError:  # exactly singular
        return None
    if np.abs(factors.lu.U.diagonal()).min() < SOUND:
        return None
    b = np.concatenate([loads[:, tree.children].T.ravel(), forces, np.zeros(6 * N)]) / size
    x = factors.solve(b)
    return np.asarray(x + factors.solve(b - A @ x))[6 * N : 6 * N + n]


def _entries(rows: Index, cols: Index, values: Array, shape: tuple[int, int]) -> scipy.sparse.csr_array:
    return scipy.sparse.csr_array((values.ravel(), (rows.ravel(), cols.ravel())), shape=shape)


def _tree_twists(tree: Tree, pair_of: Index, S: Array) -> scipy.sparse.csr_array:
    """Twists ``(6 N, F)`` of the links against those before them on the tree, for unit rates of the freedoms."""
    step = np.full(int(max(tree.pairs.max(initial=-1), pair_of.max(initial=-1))) + 1, -1, dtype=np.intp)
    step[tree.pairs] = np.arange(len(tree.pairs))
    freedom = np.flatnonzero(step[pair_of] >= 0)
    k = step[pair_of[freedom]]
    values = (S[:, freedom] * np.where(tree.forward[k], 1.0, -1.0)).T
    return _entries(
        6 * k[:, None] + SIX, np.repeat(freedom[:, None], 6, axis=1), values, (6 * len(tree.pairs), S.shape[1])
    )
