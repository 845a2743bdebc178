"""The trajectory: what a solution keeps, handed out by name in the user's units."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechgraph.equations.terms import State
from mechgraph.errors import MechgraphError
from mechgraph.force.block import hold_names, is_idle
from mechgraph.force.loads import Site, inertia_wrenches, kinetic_energy, user_poses, user_twists
from mechgraph.force.reactions import given_effort_loads
from mechgraph.maths.se3 import Array, cross, rotate
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.model.loads import Law
from mechgraph.quantities import unit_of
from mechgraph.result.kept import BlockMotion, PairForces, flat_place, user_state, user_wrench
from mechgraph.result.values import Checks, LoadBearing, LoadResult, MaterialPoint, PassedCrossing


class Trajectory(PairForces):
    """The values of a Solution (implements ``result.values.Values``)."""

    # --- motion --------------------------------------------------------------------------------------------------------

    def status(self) -> Any:
        """Named outcomes."""
        return self._status.reshape(self.batch)

    def coordinates(self, pair: int) -> tuple[Array, Array, Array]:
        """Coordinates, rates, accelerations of a pair."""
        columns = self._columns(pair)
        unit = np.where(self._system.is_length[columns], self._L, 1.0)[:, None]
        position = np.where(self._solved, self._coordinates[columns], np.nan)
        return (
            self._out(position),
            self._out(unit * self._of("dq")[columns]),
            self._out(unit * self._of("ddq")[columns]),
        )

    def frame_origin(self, pair: int, k: int) -> Array:
        """Origin of frame k of a pair."""
        number, i = self._system.place_of(pair)
        par = self._system.par
        found = self._evaluated(lambda block: block.here.frames[number][k][:, 3, i])
        return self._out(par.L * found + par.origin.reshape(3, 1))

    def screws(self, pair: int) -> Array:
        """Twists of the freedoms at unit rates."""
        columns = self._columns(pair)
        unit = np.where(self._system.is_length[columns], self._L, 1.0)[:, None]
        return self._out(self._evaluated(lambda block: user_twists(block.here, block.here.S[:, columns]) / unit))

    def link(self, link: int) -> tuple[Array, Array, Array]:
        """Pose, twist and dV/dt of a link."""

        def motion(block: BlockMotion) -> Array:
            rates, one = block.rates, slice(link, link + 1)
            pose = np.moveaxis(user_poses(block.here, one)[0], 0, -1).reshape(16, -1)
            parts = [user_twists(block.here, values[:, one])[:, 0] for values in (rates.V, rates.A)]
            return np.concatenate([pose, *parts])

        found = self._evaluated(motion)
        pose = self._out(found[:16].reshape(4, 4, -1))
        return pose, self._out(found[16:22]), self._out(found[22:])

    def link_point(self, link: int, p: Any) -> MaterialPoint:
        """Position, velocity and acceleration of a material point."""

        def motion(block: BlockMotion) -> Array:
            par = block.here.system.par
            X, V, A = block.here.poses[:, :, link], block.rates.V[:, link], block.rates.A[:, link]
            local = (
                par.center[:, link]
                if p is None
                else ((np.asarray(p, dtype=float) - par.offset[:, link]) / par.L)[:, None]
            )
            at = rotate(X[:, :3], local) + X[:, 3]
            velocity = V[3:] + cross(V[:3], at)
            acceleration = A[3:] + cross(A[:3], at) + cross(V[:3], velocity)
            return np.concatenate([par.L * at + par.origin[:, None], par.L * velocity, par.L * acceleration])

        found = self._evaluated(motion)
        return MaterialPoint(*(self._out(found[i : i + 3]) for i in (0, 3, 6)))

    def kinetic_energy(self) -> Array:
        """Kinetic energy of all links."""
        return self._out(self._L**2 * self._evaluated(lambda block: kinetic_energy(block.here, block.rates.V)))

    # --- forces --------------------------------------------------------------------------------------------------------

    def shaking(self) -> Array:
        """Wrench on the frame: loads and inertia of all moving links, and what springs do to the frame."""
        return self._out(user_wrench(self._system.par, self._force("shaking")))

    def link_hold(self, link: int) -> Array:
        """Wrench that keeps a passive body at rest, about the global origin."""
        self._force("loads")
        return self._out(user_wrench(self._system.par, self._of("hold")[:, link]))

    def passive_efforts(self) -> dict[str, Array]:
        """What keeps passive bodies at rest, by name: a couple about the axis of a turn, a force along a slide."""
        return {
            name: self._out((self._L**2 if motion.turns else self._L) * size)
            for name, motion, size in zip(
                hold_names(self.mechanism, self._passive), self._passive, self._force("holds"), strict=True
            )
        }

    def load_bearing(self) -> tuple[LoadBearing, ...]:
        """Passive freedoms that the loads of the motion would move."""
        if not self.has_forces:
            return ()
        m, terms = self.mechanism, self._of("hold_terms")
        out = []
        for motion, (name, size), part in zip(self._passive, self.passive_efforts().items(), terms, strict=True):
            scale = self._L**2 if motion.turns else self._L
            if is_idle(size.ravel(), scale * part):
                continue
            links = tuple(m.links[i].name for i in motion.links)
            pairs = tuple(p.name for p in m.pairs if p.a in links or p.b in links)
            # the freedoms of pairs that prescribe motion come last
            freedoms = tuple(n for n, r in zip(m.freedom_names(), motion.rates, strict=False) if abs(r) > MOTIONS.still)
            unit = unit_of(m.units, (2 if motion.turns else 1, 1, -2))
            out.append(LoadBearing(name, motion.turns, float(np.nanmax(np.abs(size))), unit, links, pairs, freedoms))
        return tuple(out)

    def load(self, index: int) -> LoadResult:
        """What one load does."""
        load, L = self.loads[index], self._L
        links = () if load.in_freedom is not None else load.links(self.mechanism)
        batch, t, asked = self._asked

        def effect(block: BlockMotion) -> Array:
            here, rates = block.here, block.rates
            site = Site(here, rates, self._coordinates[:, block.places], batch, asked[block.places], t)
            site.collect((load,))
            wrenches, efforts = site.applied(), site.scaled_efforts()
            power = (rates.V * wrenches).sum(axis=(0, 1)) + (rates.dq * efforts).sum(axis=0)
            on_links = [user_wrench(self._system.par, wrenches[:, self.mechanism.link_index[name]]) for name in links]
            read = (
                load.reading(site)
                if isinstance(load, Law)
                else (*np.full((2, here.T), np.nan), site.efforts.sum(axis=0))
            )
            return np.concatenate([*on_links, np.stack([L**2 * power, *read])])

        found = self._evaluated(effect) if self._solved.any() else np.full((6 * len(links) + 4, self._count), np.nan)
        wrenches = {name: self._out(found[6 * i : 6 * i + 6]) for i, name in enumerate(links)}
        return LoadResult(load, wrenches, *(self._out(row) for row in found[6 * len(links) :]))

    # --- checks and states -----------------------------------------------------------------------------------------------

    def checks(self) -> Checks:
        """Closure error, equilibrium and power, the last two relative to the largest term in the whole batch, and accuracy."""
        closure = self._out(self._of("closure"))
        accuracy = self._out(np.where(self._solved, self._of("accuracy"), np.nan))
        if not self.has_forces:
            nothing = np.full(self.batch, np.nan)
            return Checks(closure, nothing, nothing, accuracy)
        wrench, term = (float(size) or 1.0 for size in self._largest)
        balance, power = self._out(self._of("balance") / wrench), self._out(self._of("power") / term)
        return Checks(closure, balance, power, accuracy)

    def crossings(self) -> tuple[PassedCrossing, ...]:
        """Crossings of branches that the path was led over."""
        return self.passed

    def state(self, index: Any) -> State:
        """Screws and loads at one position, user's units, global origin."""
        flat = flat_place(self.batch, index)
        if not self._solved[flat]:
            raise MechgraphError(f"state({index!r}): this position was not solved ({self._status[flat]})")
        block, own = self._motion(np.array([flat])), len(self.mechanism.freedom_names())
        loads = applied = np.zeros((6, len(self.mechanism.links), 1))
        if self.has_forces:
            acting = self._of("given")[:, [flat]].copy()
            acting[own:] += self._of("efforts")[own:, [flat]]  # what moves points and links is a load on these
            loads = self._of("loads")[:, :, [flat]] + given_effort_loads(block.here, acting)
            held = self._kept["hold"][:, :, [flat]] if "hold" in self._kept else 0.0
            applied = loads - inertia_wrenches(block.here, block.rates) - held
        flank = self._of("multipliers")[:, [flat]] if self.has_forces else np.ones((len(self.whole.couplings), 1))
        state = user_state(block.rates, self._coordinates[:, [flat]], loads, applied, flank)
        return state.of_first(len(self.mechanism.pairs), own)
