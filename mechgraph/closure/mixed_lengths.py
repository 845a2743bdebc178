"""Lengths of one loop that are too far apart: two of its points coincide in ranks and differ in the mechanism.

Rows of a loop are measured in its own size, and ranks are told down to ``RANKS.loop``. Two points of a link that are nearer to each other
make a singular value of about that part of the size; where it counts as zero, mobility and positions would be those of another mechanism.
"""

from __future__ import annotations

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.closure.loop_rows import lengths_of
from mechgraph.closure.rank import closure_rank
from mechgraph.errors import DeclarationError, listed
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.tolerances import RANKS

TOO_NEAR = 10 * RANKS.loop
"""Distance of two points over the size of their loop below which it is asked whether it was lost in a rank."""
COMES_OF_IT = 0.01
"""Part of that distance above which the largest singular value that counted as zero comes of it: directions make it smaller."""
NO_DISTANCE = 1e-14
"""Distance over that size, and singular value, that is rounding."""


def refuse_mixed_lengths(here: Configuration) -> None:
    """Raise a DeclarationError where the first position of a configuration has such a loop; looked at once at a position."""
    m, key = here.system.m, here.x[:, 0].tobytes()
    told = m.once(_told)
    if key not in told:
        if fault := _fault(here):
            raise DeclarationError(f"mechanism {m.name!r}", [fault])
        told.clear()
        told.add(key)


def _told(m: Mechanism) -> set[bytes]:
    """The last state that has no such loop."""
    return set()


def _fault(here: Configuration) -> str:
    s, points, middles = here.system, here.pair_points[:, :, 0], here.middles[:, :, 0]
    loop, pair, _ = s.graph.loop_steps
    # steps of a loop stand one behind the other: the next pair, or at the end the first one, shares a link
    after = np.where(np.append(loop[1:], -1) == loop, np.arange(len(loop)) + 1, np.searchsorted(loop, loop))
    apart, size = np.linalg.norm(points[:, pair] - points[:, pair[after]], axis=0), lengths_of(s.graph, points, middles)
    part = apart / size[loop]
    near = np.flatnonzero((part < TOO_NEAR) & (part > NO_DISTANCE))
    if not near.size:
        return ""
    lost = near[closure_rank(here).dropped > np.maximum(COMES_OF_IT * part[near], NO_DISTANCE)]
    if not lost.size:
        return ""
    i, names = int(lost[np.argmin(part[lost])]), [p.name for p in s.m.pairs]
    return (
        f"lengths are too far apart: {names[pair[i]]} and {names[pair[after[i]]]} are {apart[i] * s.par.L:.3g} apart in the loop "
        f"{listed(names[k] for k in pair[loop == loop[i]])} of size {size[loop[i]] * s.par.L:.3g}; expected at least {TOO_NEAR:g} of "
        "that, or the same point. Make small lengths larger or zero, or replace long links by slides (the end of a link so long "
        "moves along a line)"
    )
