"""Loads along a path: what depends on the place alone is tabulated, other laws of place, rate and time are asked for one state.

At a rate ``u'`` of the path's coordinate a freedom has the rate ``z(u) u'`` and a link the twist ``V(u) u'``; a load that exerts the
force ``F`` on a link and the effort ``e`` in a freedom has the generalized force ``V . F + z e``. A law, a table or a function reads a few
tabulated values, as ``model.load_base.LoadSite`` says, and no loop is closed for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.closure.solver import FactoredClosure
from mechgraph.errors import DeclarationError
from mechgraph.force.loads import NOT_FINITE, Site, user_poses, user_twists
from mechgraph.model.loads import Load
from mechgraph.response.motion_equations import Loads, along_one

OF_LOADS = 4
"""Tabulated terms of the loads that depend on the place, and on rates linearly: see ``along_one``."""
VALUES_OF_FREEDOM, VALUES_OF_LINK = 2, 18
"""Tabulated values of a freedom, ``q`` and ``z``, and of a link, its pose ``(3, 4)`` and ``V``; in the user's units."""


class AlongTerms:
    """What is tabulated for loads along a path of one coordinate, and what the other loads do there."""

    def __init__(self, system: System, loads: Loads) -> None:
        self.system, m = system, system.m
        parts = [loads.stored, loads.rest]
        self.smooth = Loads(*(tuple(load for load in some if load.smooth) for some in parts))
        self.stored, self.rest = (tuple(load for load in some if not load.smooth) for some in parts)
        others = (*self.stored, *self.rest)
        named = dict.fromkeys(load.in_freedom for load in others if load.in_freedom is not None)
        self.columns = {name: i for i, name in enumerate(named)}
        links = dict.fromkeys(
            link for load in others if load.in_freedom is None or not load.by_position for link in load.links(m)
        )
        self.links = {name: len(self.columns) * VALUES_OF_FREEDOM + i * VALUES_OF_LINK for i, name in enumerate(links)}
        places = [m.freedom(name) for name in self.columns]
        self._columns = np.array([int(system.first_column[k]) + j for k, j in places], dtype=np.intp)
        self._links = [m.link_index[name] for name in self.links]
        L, lengths = system.par.L, system.is_length[self._columns]
        unit = np.where(lengths, L, 1.0)
        of_link = np.ones((VALUES_OF_LINK, len(self.links)))
        of_link[[3, 7, 11, 15, 16, 17]] = L
        self.sizes = np.concatenate([np.repeat(unit, VALUES_OF_FREEDOM), of_link.T.ravel()])
        """The units of the values behind the first terms."""

    def tabulated(self, here: Configuration, f: FactoredClosure) -> Array:
        """All terms ``(OF_LOADS + m, T)`` at closed states."""
        Z = f.sensitivity()[:, 0]
        s, columns = self.system, self._columns
        unit = np.where(s.is_length[columns], s.par.L, 1.0)[:, None]
        freedoms = np.stack([s.coordinates_of(here.x)[columns], unit * Z[columns]], axis=1)
        poses = user_poses(here)[self._links, :, :3].transpose(0, 2, 3, 1).reshape(-1, 12, here.T)
        twists = user_twists(here, here.link_twists(Z))[:, self._links].transpose(1, 0, 2)
        links = np.concatenate([poses, twists], axis=1)
        more = np.concatenate([freedoms.reshape(-1, here.T), links.reshape(-1, here.T)]) / self.sizes[:, None]
        return np.concatenate([along_one(here, f, self.smooth), more])

    def after_turns(self, advance: Array, turns: float) -> Array:
        """What the values behind the first terms have grown by after turns in which the state advances ``(nx,)``."""
        s, out = self.system, np.zeros(len(self.sizes))
        rows = s.single_rows[self._columns]
        moved = np.where(rows >= 0, advance[rows], 0.0) * np.where(s.is_length[self._columns], s.par.L, 1.0)
        out[: len(rows) * VALUES_OF_FREEDOM : VALUES_OF_FREEDOM] = turns * moved
        return out

    def forces(self, values: Array, rate: float, t: Array) -> tuple[Array, Array]:
        """Generalized forces ``(T,)`` of the other loads, stored and not, at one place with a rate and times ``(T,)``; internal units."""
        stored, rest = (
            _AlongSite(self, values, rate, t).collected(some) if some else np.zeros(len(t))
            for some in (self.stored, self.rest)
        )
        return stored, rest


class _AlongSite(Site):
    """What loads see at one place of a path at times ``(T,)``, about the global origin; ``found`` is their power for a unit rate."""

    def __init__(self, terms: AlongTerms, values: Array, rate: float, t: Array) -> None:
        self.m, self.L = terms.system.m, terms.system.par.L
        self.terms, self.rate, self.t = terms, rate, t
        self.batch, self.good = (len(t),), np.arange(len(t))
        self.tabulated = values
        self.found = np.zeros(len(t))

    def collected(self, loads: Iterable[Load]) -> Array:
        """The generalized force ``(T,)``."""
        for load in loads:
            load.act(self)
            if not np.isfinite(self.found).all():
                raise DeclarationError(f"load {load.where.removesuffix(': ')}", [NOT_FINITE])
        return self.found / self.L**2

    def _of_link(self, link: str) -> tuple[Array, Array]:
        """Pose ``(3, 4, 1)`` and unit twist ``(6, 1)``."""
        at = self.terms.links[link]
        values = self.tabulated[at : at + VALUES_OF_LINK, None]
        return values[:12].reshape(3, 4, 1), values[12:]

    def _of_freedom(self, name: str) -> tuple[float, float]:
        at = VALUES_OF_FREEDOM * self.terms.columns[name]
        return float(self.tabulated[at]), float(self.tabulated[at + 1])

    def rotation(self, link: str) -> Array:
        """See ``LoadSite``."""
        return self._spread(self._of_link(link)[0][:, :3])

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """See ``LoadSite``."""
        X, V = self._of_link(link)
        local = np.asarray(self.m.link(link).point(p) if isinstance(p, str) else p, dtype=float).reshape(3, -1)
        at = rotate(X[:, :3], local) + X[:, 3]
        return self._spread(at), self._spread(self.rate * (V[3:] + cross(V[:3], at)))

    def center(self, link: str) -> Any:
        """See ``LoadSite``."""
        return self.m.link(link).center

    def motion_of(self, link: str) -> tuple[Array, Array]:
        """See ``Site``."""
        X, V = self._of_link(link)
        pose = np.concatenate([X[..., 0], [[0.0, 0.0, 0.0, 1.0]]])
        return tuple(np.broadcast_to(one, (*self.batch, *one.shape)) for one in (pose, self.rate * V[:, 0]))  # type: ignore[return-value]

    def _spread(self, value: Array) -> Array:
        return np.broadcast_to(value, (*value.shape[:-1], *self.batch))

    def freedom(self, name: str) -> tuple[Array, Array]:
        """See ``LoadSite``."""
        q, z = self._of_freedom(name)
        return np.full(self.batch, q), np.full(self.batch, z * self.rate)

    def add_force(self, link: str, force: Array, at: Array) -> None:
        """See ``LoadSite``."""
        V = self._of_link(link)[1]
        self.found = self.found + ((V[3:] + cross(V[:3], at)) * force).sum(axis=0)

    def add_couple(self, link: str, moment: Array) -> None:
        """See ``LoadSite``."""
        self.found = self.found + (self._of_link(link)[1][:3] * moment).sum(axis=0)

    def add_effort(self, name: str, effort: Array) -> None:
        """See ``LoadSite``."""
        self.found = self.found + self._of_freedom(name)[1] * effort
