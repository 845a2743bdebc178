"""One analysed batch: motion and wrenches in internal units, handed out by name in the user's units, batch first."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.screw import shift_wrench
from mechgraph.algebra.se3 import Array, cross, rotate
from mechgraph.closure.path import continued
from mechgraph.equations.state import State
from mechgraph.errors import MechgraphError
from mechgraph.force.applied_loads import kinetic_power, user_poses, user_twists
from mechgraph.force.dalembert import given_effort_loads, internal_state
from mechgraph.force.found import Forces, Motions
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import add_at
from mechgraph.result.solution import Checks, MaterialPoint
from mechgraph.structure.reaction_split import (
    UNIQUE,
    PairFrames,
    Stress,
    least_reactions,
    orthonormal_stress,
    pair_power,
    reaction_part,
)


class Analysis:
    """The values of a Solution (implements ``result.solution.Values``)."""

    def __init__(self, motions: Motions, forces: Forces | None, coordinates: Array | None = None) -> None:
        self.motions, self.forces, self._coordinates = motions, forces, coordinates
        self.mechanism: Mechanism = motions.here.system.m
        self.batch, self.t = motions.batch, motions.t
        self.has_forces = forces is not None
        self._here, self._system = motions.here, motions.here.system
        self._L = self._system.par.L

    def settle(self) -> None:
        """Work out reactions, efforts and checks, and give back the memory of all that can be computed again from the motion."""
        for name in ("_closure", "equilibrium", "power") if self.has_forces else ("_closure",):
            getattr(self, name)
        if self.forces is not None:
            self.forces.forget()
        self.motions.rates.forget()
        self._here.forget()

    # --- shapes and units ----------------------------------------------------------------------------------------------

    def _out(self, values: Array) -> Array:
        """``(..., T)`` of the solved positions -> batch first ``(*batch, ...)``, NaN where not solved; read-only."""
        rows = np.moveaxis(values, -1, 0)
        total = int(np.prod(self.batch))
        if self.motions.good.size == total:
            full = np.array(rows, order="C")
        else:
            full = np.full((total, *rows.shape[1:]), np.nan)
            full[self.motions.good] = rows
        out = full.reshape((*self.batch, *rows.shape[1:]))
        out.setflags(write=False)
        return out

    def _user_wrench(self, f: Array) -> Array:
        """Wrench about the internal origin -> user's units about the global origin, ``(6, ...)``."""
        out = np.empty(f.shape)
        origin = self._system.par.origin.reshape(3, *(1,) * (f.ndim - 1))
        np.multiply(f[3:], self._L, out=out[3:])
        np.multiply(f[:3], self._L**2, out=out[:3])
        out[:3] += cross(origin, out[3:])
        return out

    def _columns(self, pair: int) -> slice:
        first = self._system.first_column
        return slice(int(first[pair]), int(first[pair + 1]))

    def _need_forces(self) -> Forces:
        if self.forces is None:
            raise MechgraphError("this solution has no forces: it comes from kinematics(); use solve()")
        return self.forces

    # --- motion --------------------------------------------------------------------------------------------------------

    def status(self) -> Any:
        """Named outcomes."""
        return self.motions.status

    @cached_property
    def user_coordinates(self) -> Array:
        """Coordinates ``(F, *batch)`` in the user's units, rotations continued along the last batch axis."""
        if self._coordinates is not None:
            return self._coordinates
        x = np.full((self._system.n_state, int(np.prod(self.batch))), np.nan)
        x[:, self.motions.good] = self._here.x
        return continued(self._system, x, self.batch, self.motions.tracks)

    def coordinates(self, pair: int) -> tuple[Array, Array, Array]:
        """Coordinates, rates, accelerations of a pair."""
        columns = self._columns(pair)
        unit = np.where(self._system.is_length[columns], self._L, 1.0)[:, None]
        position = np.moveaxis(self.user_coordinates[columns], 0, -1).copy()
        position.setflags(write=False)
        return (
            position,
            self._out(unit * self.motions.rates.dq[columns]),
            self._out(unit * self.motions.rates.ddq[columns]),
        )

    @cached_property
    def _poses(self) -> Array:
        return user_poses(self._here)

    def link(self, link: int) -> tuple[Array, Array, Array]:
        """Pose, twist and dV/dt of a link."""
        V = user_twists(self._here, self.motions.rates.V[:, link : link + 1])[:, 0]
        A = user_twists(self._here, self.motions.rates.A[:, link : link + 1])[:, 0]
        return self._out(np.moveaxis(self._poses[link], 0, -1)), self._out(V), self._out(A)

    def link_point(self, link: int, p: Any) -> MaterialPoint:
        """Position, velocity and acceleration of a material point."""
        par = self._system.par
        X, V, A = self._here.poses[:, :, link], self.motions.rates.V[:, link], self.motions.rates.A[:, link]
        local = (
            par.center[:, link] if p is None else ((np.asarray(p, dtype=float) - par.offset[:, link]) / par.L)[:, None]
        )
        at = rotate(X[:, :3], local) + X[:, 3]
        velocity = V[3:] + cross(V[:3], at)
        acceleration = A[3:] + cross(A[:3], at) + cross(V[:3], velocity)
        position = par.L * at + par.origin[:, None]
        return MaterialPoint(*(self._out(v) for v in (position, par.L * velocity, par.L * acceleration)))

    # --- forces --------------------------------------------------------------------------------------------------------

    @property
    def _applied(self) -> Array:
        forces = self._need_forces()
        applied = forces.site.applied()
        return applied + forces.hold if forces.holds else applied

    @property
    def _loads(self) -> Array:
        return self._need_forces().inertia + self._applied

    @cached_property
    def _stress(self) -> Stress:
        return orthonormal_stress(self._here, self._need_forces().wrenches.stress, self.motions.driven)

    @cached_property
    def _solved(self) -> tuple[Array, Array]:
        """Reactions ``(6, P, T)`` and all efforts ``(F, T)``, of minimum norm where redundant."""
        totals = self._need_forces().wrenches.totals
        efforts = pair_power(self._here, totals)
        reactions = reaction_part(self._here, totals, efforts)
        if not self._stress.wrenches.shape[2]:
            return reactions, efforts
        return least_reactions(self._here, reactions, efforts, self._stress)

    def _masked(self, values: Array, stress: Array, scale: float = 1.0) -> Array:
        """NaN where a self-stress has a part; ``stress`` has the stress index as its last but one axis."""
        if not self._need_forces().mask_redundant or not stress.shape[-2]:
            return values
        touched = np.sqrt((stress * stress).sum(axis=-2)) > UNIQUE * scale
        return np.where(touched, np.nan, values)

    def reaction(self, pair: int) -> Array:
        """Reaction about the global origin."""
        return self._about_origin(self._solved[0][:, pair], self._stress.wrenches[:, pair])

    def total(self, pair: int) -> Array:
        """Total wrench about the global origin."""
        reactions, efforts = self._solved
        columns = self._columns(pair)
        work = (self._here.E[:, columns] * efforts[columns]).sum(axis=1)
        stress_work = np.einsum("fst,cft->cst", self._stress.efforts[columns], self._here.E[:, columns])
        return self._about_origin(reactions[:, pair] + work, self._stress.wrenches[:, pair] + stress_work)

    def _about_origin(self, value: Array, stress: Array) -> Array:
        """Wrench ``(6, T)`` in the user's units about the global origin, NaN where ``stress (6, s, T)`` has a part."""
        wrench = self._user_wrench(value)
        if stress.shape[1]:
            far = self._system.par.origin / self._L
            shifted = np.concatenate([stress[:3] + cross(far[:, None, None], stress[3:]), stress[3:]])
            wrench = self._masked(wrench, shifted, 1.0 + float(np.linalg.norm(far)))
        return self._out(wrench)

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B."""
        point = self._here.pair_points[:, pair]
        local = shift_wrench(self._solved[0][:, pair], point)
        stress = shift_wrench(self._stress.wrenches[:, pair], point[:, None])
        scale = np.repeat([self._L**2, self._L], 3)[:, None]
        return self._out(self._masked(scale * local, stress))

    @cached_property
    def _components(self) -> dict[int, tuple[tuple[str, ...], Array]]:
        """For every pair names and masked components ``(6 - f, T)``."""
        frames = PairFrames(self._here)
        values = frames.components(self._solved[0])
        stress = frames.components(self._stress.wrenches)
        out = {}
        for g, value, state in zip(self._system.groups, values, stress, strict=True):
            couples = [c.is_couple for c in g.row.reactions or ()] or [False] * (6 - g.row.f)
            unit = np.where(couples, self._L**2, self._L)[:, None]
            for i, k in enumerate(g.pairs):
                out[int(k)] = (g.row.component_names, self._masked(unit * value[:, i], state[:, i]))
        return out

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name."""
        names, values = self._components[pair]
        return {name: self._out(value) for name, value in zip(names, values, strict=True)}

    @cached_property
    def _given(self) -> Array:
        """Given efforts ``(F, T)``."""
        return self._need_forces().site.scaled_efforts()

    @cached_property
    def _driver_efforts(self) -> Array:
        """What drivers add to given efforts, ``(F, T)``; zero elsewhere."""
        out = np.zeros_like(self._solved[1])
        given = self._given
        driven = self.motions.driven
        out[driven] = self._solved[1][driven] - given[driven]
        return out

    def _effort_units(self, columns: Any) -> Array:
        return np.where(self._system.is_length[columns], self._L, self._L**2)[:, None]

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """Efforts of all kinds and of the driver alone."""
        columns = self._columns(pair)
        own = self._driver_efforts[columns]
        total = own + self._given[columns]
        unit = self._effort_units(columns)
        stress = self._stress.efforts[columns]
        return self._out(self._masked(unit * total, stress)), self._out(self._masked(unit * own, stress))

    def shaking(self) -> Array:
        """Wrench on the frame: loads and inertia of all moving links, and what springs do to the frame."""
        forces = self._need_forces()
        frame = self._system.graph.frame
        moving = np.delete(self._loads, frame, axis=1).sum(axis=1)
        return self._out(self._user_wrench(moving + forces.site.scaled(forces.site.internal)[:, frame]))

    def link_hold(self, link: int) -> Array:
        """Wrench that keeps a passive body at rest, about the global origin."""
        return self._out(self._user_wrench(self._need_forces().hold[:, link]))

    def passive_efforts(self) -> dict[str, Array]:
        """What keeps passive bodies at rest, by body: a couple about the axis of a turn, a force along a slide."""
        return {
            name: self._out((self._L**2 if turns else self._L) * size)
            for name, turns, size in self._need_forces().holds
        }

    # --- checks and states -----------------------------------------------------------------------------------------------

    def closure(self) -> Array:
        """Closure error."""
        return self._out(self._closure)

    @cached_property
    def _closure(self) -> Array:
        return self._here.closure

    def checks(self) -> Checks:
        """Closure error, equilibrium and power."""
        closure = self.closure()
        if self.forces is None:
            nothing = np.full(self.batch, np.nan)
            return Checks(closure, nothing, nothing)
        residual, wrench = self.equilibrium
        gap, term = self.power
        return Checks(closure, self._out(residual / (wrench or 1.0)), self._out(gap / (term or 1.0)))

    @cached_property
    def equilibrium(self) -> tuple[Array, float]:
        """Residual ``(T,)`` of the equilibrium of all links and of ``S^T w = effort``, and the largest wrench in the batch."""
        here, s = self._here, self._system
        reactions, _ = self._solved
        totals = here.pair_sums(here.E * (self._given + self._driver_efforts))
        totals += reactions
        balance = self._loads
        add_at(balance, s.b, totals)
        add_at(balance, s.a, -totals)
        balance[:, s.graph.frame] = 0.0
        forces = self._need_forces()
        applied = self._applied - forces.hold if forces.holds else self._applied
        largest = max(largest_of(part) for part in (totals, applied, forces.inertia, forces.hold))
        residual = np.abs(balance).max(axis=(0, 1), initial=0.0)
        work = np.abs(pair_power(here, reactions)).max(axis=0, initial=0.0)
        return np.maximum(residual, work), largest

    @cached_property
    def power(self) -> tuple[Array, float]:
        """Driver power + load power - rate of kinetic energy ``(T,)``, and the largest term in the batch."""
        rates = self.motions.rates
        by_load = (rates.V * self._applied).sum(axis=0)
        by_effort = rates.dq * (self._driver_efforts + self._given)
        kinetic = kinetic_power(rates, self._need_forces().inertia)
        largest = max(largest_of(part) for part in (by_load, by_effort, kinetic))
        return by_load.sum(axis=0) + by_effort.sum(axis=0) - kinetic.sum(axis=0), largest

    def state(self, index: Any) -> State:
        """Screws and loads at one position, user's units, global origin."""
        flat = flat_place(self.batch, index)
        found = np.flatnonzero(self.motions.good == flat)
        if not found.size:
            raise MechgraphError(
                f"state({index!r}): this position was not solved ({np.ravel(self.motions.status)[flat]})"
            )
        at = int(found[0])
        here = self._here.part(np.array([at]))
        forces = self.forces
        loads = np.zeros((6, len(self.mechanism.links), 1)) if forces is None else self._loads[:, :, at : at + 1]
        if forces is not None:
            loads = loads + given_effort_loads(here, forces.site.scaled_efforts()[:, at : at + 1])
        inner = internal_state(here, loads)
        rows = [p.type for p in self.mechanism.pairs]
        spot = slice(at, at + 1)
        unit = np.where(self._system.is_length, self._L, 1.0)[:, None]
        return State(
            coordinates=self.user_coordinates.reshape(self._system.n_freedoms, int(np.prod(self.batch)))[:, flat][
                :, None
            ],
            velocities=unit * self.motions.rates.dq[:, spot],
            poses=np.moveaxis(user_poses(here)[..., :3, :], (0, 1), (2, 3)),
            twists=user_twists(here, self.motions.rates.V[:, :, spot]),
            reactions=tuple(
                self._user_screws(w, [c.is_couple for c in row.reactions or ()])
                for w, row in zip(inner.reactions, rows, strict=True)
            ),
            efforts=tuple(
                self._user_screws(w, [c.is_couple for c in row.efforts])
                for w, row in zip(inner.efforts, rows, strict=True)
            ),
            along=tuple(
                self._user_screws(w, [c.is_couple for c in row.bookkeeping.along] if row.bookkeeping else [])
                for w, row in zip(inner.along, rows, strict=True)
            ),
            conditions=tuple(user_twists(here, w) if w.shape[1] else w for w in inner.conditions),
            loads=self._user_wrench(loads),
        )

    def _user_screws(self, wrenches: Array, couples: list[bool]) -> Array:
        """Unit wrenches ``(6, n, T)``: arms in the user's length, about the global origin; unit couples stay."""
        out = wrenches.copy()
        for j in range(out.shape[1]):
            if not (j < len(couples) and couples[j]):
                out[:3, j] = self._L * out[:3, j] + cross(self._system.par.origin[:, None], out[3:, j])
        return out


def flat_place(batch: tuple[int, ...], index: Any) -> int:
    """Place in the flat batch of the one position that an index names.

    Raises
    ------
    MechgraphError
    """
    try:
        flat = np.arange(int(np.prod(batch))).reshape(batch)[index]
    except IndexError:
        text = f"state({index!r}): no such position in a batch {batch}; give one index an axis"
        raise MechgraphError(text) from None
    if np.ndim(flat):
        raise MechgraphError(
            f"state({index!r}): names {np.size(flat)} positions of a batch {batch}; give one index an axis"
        )
    return int(flat)


def largest_of(values: Array) -> float:
    """Largest size of a number in an array; 0 for none."""
    return float(max(values.max(initial=0.0), -values.min(initial=0.0)))
