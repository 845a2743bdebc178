"""Which drivers move a mechanism, and which freedoms would complete them. Pure functions of what can move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import EngineName
from mechgraph.numerics.linear import independent_rows
from mechgraph.report.findings import completing
from mechgraph.structure.mobility import Freedoms, freedoms_at


def weak(freedoms: Freedoms, driven: Index) -> list[int]:
    """Columns of the drivers that move least when the mechanism does, and as little as the weakest combination of them."""
    if len(driven) < 2:
        return [int(c) for c in driven]
    size = np.sqrt((freedoms.null[driven] ** 2).sum(axis=1))
    return [int(c) for c in driven[size < 2 * freedoms.drive * size.max()]]


def moving(freedoms: Freedoms, driven: Index, near: bool) -> Index:
    """The drivers without those that depend on the ones before or stand still; ``near`` a dead point without the weak one."""
    columns = independent_rows(freedoms.null, driven.tolist(), len(driven))
    left_out = weak(freedoms, driven) if near and len(columns) == len(driven) else []
    return np.array([c for c in columns if [c] != left_out], dtype=np.intp)


def suggested(
    freedoms: Freedoms, driven: Index, moving: Index, able: NDArray[np.bool_], wanted: int, engine: EngineName
) -> list[int]:
    """Columns among those ``able (F,)`` that complete the drivers ``moving`` to at most ``wanted``, independent.

    A driver may stop a motion that was passive, and so leave another one undriven; then more are sought.
    """
    columns = moving
    after = freedoms if len(moving) == len(driven) else freedoms_at(freedoms.position, moving, engine)
    while after.undriven and len(columns) < wanted:
        both = [*columns.tolist(), *completing(after, able)]
        independent = np.array(independent_rows(freedoms.null, both, wanted), dtype=np.intp)
        if len(independent) == len(columns):
            break
        columns = independent
        after = freedoms_at(freedoms.position, columns, engine)
    return [int(c) for c in np.sort(columns[len(moving) :])]


def ratios(freedoms: Freedoms, driven: Index, of: Index) -> Array:
    """Rates of freedoms ``of (n,)`` for unit rates of the drivers, ``(n, d)`` in the user's units, passive motions at rest.

    No columns where the drivers do not say all other motions.
    """
    null, fixed = freedoms.null, np.concatenate([driven, freedoms.hold])
    if len(fixed) != null.shape[1] or freedoms.dependent or freedoms.undriven:
        return np.zeros((len(of), 0))
    rates = null[of] @ np.linalg.solve(null[fixed], np.eye(len(fixed), len(driven)))
    units = freedoms.position.declared.system.in_user_units(np.ones(len(null)))
    return np.asarray(units[of, None] * rates / units[driven])
