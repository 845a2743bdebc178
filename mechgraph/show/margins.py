"""How far the positions of a solution are from singular ones: the margin of a determinacy report, at every position."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import scaled_system
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import indexed
from mechgraph.closure.rank import closure_rank
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report.facts import nearly_singular
from mechgraph.result.solution import Solution


class Margins(NamedTuple):
    """Margins ``(...)`` with the drivers free and at rest (None without drivers), NaN where not solved, and what is near."""

    free: Array
    driven: Array | None
    near_below: float


def margins(s: Solution) -> Margins:
    """Smallest kept singular value over the largest of the closure equations at every position, scaled about it as ``check`` does.

    With the drivers at rest a position counts as singular with them where a singular value is below what a rank tells apart.
    """
    m, status = s.whole, np.asarray(s.status)
    raw = indexed(m)
    q = np.concatenate([s[p.name].position.reshape(-1, p.type.f).T for p in m.pairs if p.type.f])
    names = m.freedom_names()
    columns = np.array(sorted(names.index(name) for name in s.prescribed if name in names), dtype=np.intp)
    out = np.full((2, status.size), np.nan)
    for i in np.flatnonzero(status.reshape(-1) == "ok"):
        system = scaled_system(m, q[:, i], raw)
        here = Configuration(system, system.state_of(q[:, i : i + 1]))
        free = closure_rank(here)
        out[0, i] = free.margin
        if len(columns):
            rest = closure_rank(here, columns)
            # the drivers at rest take from the mobility; where they do not, they stand at a dead point
            out[1, i] = rest.margin if rest.rank >= free.rank else max(rest.dropped, RANKS.position)
    driven = out[1].reshape(status.shape) if len(columns) else None
    return Margins(out[0].reshape(status.shape), driven, nearly_singular(raw.graph.n_loops))
