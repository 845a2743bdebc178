"""A spline inserted in a shaft: a link between two joints becomes two that slide along its line, and carry torque but no force along it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechgraph.closure.assembly import assembled, at_position, named_columns
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import EngineName
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.numerics.tolerances import MOTIONS, STRESSES
from mechgraph.structure.mobility import Freedoms, free_motion
from mechgraph.structure.pair_changes import RIGID, SPLINE, Effect, stresses_of
from mechgraph.structure.uniqueness import pair_states

TRIED = 2
"""Most shafts for which the effect is computed, each on a mechanism of its own."""


def with_spline(m: Mechanism, link: str) -> Mechanism:
    """The mechanism with a spline in a link of two pairs, along the line of their points.

    The second pair goes to the new half, which has no mass; mass and loads stay with the old one.
    """
    one, two = (p for p in m.pairs if link in (p.a, p.b))
    p, q = (np.asarray(pair.markers[pair.b == link].point) for pair in (one, two))
    taken = {*m.link_names(), *(pair.name for pair in m.pairs)}
    half, spline = (_free(f"{link}-{what}", taken) for what in ("half", "spline"))
    marker = Marker((p + q) / 2, q - p)
    moved = two.replace(**{"b" if two.b == link else "a": half})
    pairs = [moved if pair.name == two.name else pair for pair in m.pairs]
    return m.replace(
        links=[*m.links, Link(half)], pairs=[*pairs, Pair(spline, SPLINE, link, half, on_a=marker, on_b=marker)]
    )


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "'"
    return name


def splines(freedoms: Freedoms, driven: Index, engine: EngineName = "auto") -> Iterator[Effect]:
    """The effect of a spline in shafts between joints of two freedoms or more that a self-stress pulls along their line."""
    position = freedoms.position
    here, m = position.declared, position.m
    states = pair_states(here, stresses_of(freedoms))[3:, :, :, 0]
    points = here.pair_points[:, :, 0]
    of_link: dict[int, list[int]] = {}
    for k, ends in enumerate(position.graph.ends):
        for link in ends:
            of_link.setdefault(link, []).append(k)
    names, tried = m.link_names(), 0
    for link, pairs in of_link.items():
        if link == position.graph.frame or len(pairs) != 2 or min(position.type_of(k).f for k in pairs) < 2:
            continue
        line = points[:, pairs[1]] - points[:, pairs[0]]
        length = float(np.linalg.norm(line))
        if tried == TRIED or length < MOTIONS.still:
            continue
        if np.abs(line @ states[:, pairs[0]]).max(initial=0.0) > STRESSES.relieved * length:
            tried += 1
            new = with_spline(at_position(m, here.system, here.x[:, 0]), names[link])
            system, x = assembled(new)
            columns, _ = named_columns(new, system, {d.freedom: 0.0 for d in new.drives})
            after = free_motion(system, x, columns, engine)
            yield Effect(
                ((names[link], RIGID, SPLINE),),
                (freedoms.redundancy, after.redundancy),
                (freedoms.mobility, after.mobility),
                (len(freedoms.passive), len(after.passive)),
                (0.0,),
            )
