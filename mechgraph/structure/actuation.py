"""Which freedoms can take the efforts that a prescribed motion needs."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import independent_rows
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.structure.mobility import single_freedoms

MOST_NAMED = 12
"""Freedoms that a message names."""


def stand_still(Z: Array, acting: Index) -> np.ndarray:
    """Positions ``(T,)`` at which freedoms ``acting`` can rest while the mechanism moves, so that efforts in them cannot hold it.

    ``Z (F, d, T)`` are the rates of all freedoms for unit rates of the ``d`` prescribed ones. By virtual work the efforts ``tau`` in
    ``acting`` that do what ``f`` would do in the prescribed freedoms satisfy ``Z_a^T tau = f``: singular where ``Z_a`` is.
    """
    size = np.abs(Z).max(axis=(0, 1), initial=1.0)
    weakest = np.linalg.svd(np.moveaxis(Z[acting], -1, 0), compute_uv=False)[:, -1]
    return np.asarray(weakest < MOTIONS.dependent * size)


def actuation_fault(m: Mechanism, Z: Array, acting: Index) -> str:
    """What is wrong with efforts in the freedoms ``acting``, and which would do, for ``Z (F, d)`` as above at one position."""
    names, d = m.freedom_names(), Z.shape[1]
    Q = np.linalg.qr(Z)[0]
    kept = independent_rows(Q, [int(c) for c in acting], d)
    B = np.linalg.qr(Q[kept].T)[0]
    rest = np.linalg.norm(Q - Q @ B @ B.T, axis=1)
    able = [name for c, name in single_freedoms(m) if rest[c] > MOTIONS.dependent]
    spare = [names[c] for c in acting if c not in kept]
    parts = []
    if len(acting) != d:
        motions = "independent motion is" if d == 1 else "independent motions are"
        parts.append(f"{len(acting)} freedom{'s are' if len(acting) != 1 else ' is'} named, {d} {motions} prescribed")
    if spare:
        why = f"depends on {', '.join(names[c] for c in kept)}" if kept else "stands still while the mechanism moves"
        parts.append(f"{', '.join(spare)} {why}")
    if d > len(kept) and able:
        count = "any one of " if d - len(kept) == 1 else f"{d - len(kept)} independent ones of "
        which = ", ".join(able[:MOST_NAMED]) + (", ..." if len(able) > MOST_NAMED else "")
        where = " in its place" if spare else " beside them" if kept else ""
        parts.append(f"{count if len(able) > 1 else ''}{which} would do{where}")
    elif spare:
        parts.append("leave it out")
    return "; ".join(parts)
