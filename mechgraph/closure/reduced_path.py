"""Positions along a path by the reduced form of a mechanism, and the states of the full form there (see ``closure.reduction``)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath, Positions, in_blocks, requests
from mechgraph.closure.following import follow
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_rest import parts_of_steps
from mechgraph.closure.reduction import Reduction
from mechgraph.closure.rods import Rods, axes
from mechgraph.closure.solver import closure_solver
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.tracks import Nodes


def follow_reduced(
    path: DriverPath, form: Reduction, x: Array, values: Array, batch: tuple[int, ...], total: int
) -> Positions | None:
    """What ``following.follow`` finds from starts ``x (nx, V)``, NaN where there is none, with rods at rest in their spins.

    None where a rod turns too far from one node to the next to tell how it rests.
    """
    begun = np.flatnonzero(np.isfinite(x).all(axis=0))
    path.variant_of = np.arange(x.shape[1])
    start = Configuration(path.system_on(begun), x[:, begun])
    x_0, R_0 = np.full((form.n_state, x.shape[1]), np.nan), np.full((3, 3, form.rods, x.shape[1]), np.nan)
    x_0[:, begun], R_0[..., begun] = form.state_of(start), form.rotations_of(start)
    whole = path.system_on(path.variant_of)
    if not form.holds(whole.par):
        return None
    system = form.reduced(whole)
    small = DriverPath(system, closure_solver("dense", np.searchsorted(form.columns, path.columns)), system.cases)
    found = follow(small, requests(x_0, values, batch), total)
    path.variant_of = small.variant_of
    return _Lift(path, small, form, found, R_0[..., small.variant_of]).positions()


class _Lift:
    """Positions ``found`` on the path of the reduced form, in the full one."""

    def __init__(self, path: DriverPath, small: DriverPath, form: Reduction, found: Positions, R_0: Array) -> None:
        self.path, self.small, self.form, self.found = path, small, form, found
        self.rods = Rods(small, found.follower, *parts_of_steps(small, found), R_0)
        first = path.at(*self._state(found.tracks.nodes.take(np.array([0]))))
        self.which = int(path.chosen(first, np.full(1, -1))[0])

    def _state(self, nodes: Nodes) -> tuple[Array, Array, Index]:
        return self._lifted(nodes.x, nodes.drive, nodes.track, nodes.place), nodes.drive, nodes.track

    def _lifted(self, x: Array, drive: Array, track: Index, place: Array, turns: Index | int = 0) -> Array:
        here = self.small.at(x, drive, track)
        return self.form.lifted(here, self.path.system_on(track), self.rods.at(here, track, place, turns))

    def _nodes(self, nodes: Nodes) -> Nodes:
        """The same nodes with states, sensitivities and conditions of the full form."""
        x, drive, track = self._state(nodes)
        point, which = self.path.at(x, drive, track), np.full(len(nodes), self.which)
        f = self.path.factored(point, which)
        Z = self.path.sensitivity(point, f)
        return replace(nodes, x=x, Z=Z, which=which, condition=f.condition)

    def positions(self) -> Positions | None:
        """All of them; None where rods are not ``clear``."""
        if not self.rods.clear:
            return None
        found, path = self.found, self.path
        x = np.full((path.system.n_state, found.x.shape[1]), np.nan)
        turns = np.zeros(x.shape[1], dtype=np.intp) if found.turns is None else found.turns
        for at in in_blocks(np.flatnonzero(found.moved & (found.near < 0))):
            rows = found.x[self.small.rows][:, at]
            x[:, at] = self._lifted(found.x[:, at], rows, found.track[at], found.place[at], turns[at])
        follower = Follower(path)
        follower.paths = found.follower.paths
        out = replace(
            found,
            x=x,
            which=np.full(x.shape[1], self.which),
            here=None,
            tracks=replace(found.tracks, nodes=self._nodes(found.tracks.nodes)),
            follower=follower,
            crossings=[replace(c, problem=path, sides=self._nodes(c.sides)) for c in found.crossings],
        )
        if found.gained is not None:
            out.gained = np.zeros((path.system.n_freedoms, x.shape[1]))
            out.gained[self.form.columns] = found.gained[: len(self.form.columns)]
            nodes = out.tracks.nodes
            u = axes(self.small.at(found.tracks.nodes.x, nodes.drive, nodes.track))[0]
            spins = self.form.spins(path.at(nodes.x, nodes.drive, nodes.track), u)
            out.spin = np.einsum("frn,rn->fn", spins, self.rods.period[:, nodes.track])
        out.interpolate()
        return out
