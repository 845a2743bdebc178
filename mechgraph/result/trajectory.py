"""The trajectory: arrays over positions that a solution keeps, handed out by name in the user's units.

The arrays over positions in internal units that a solution keeps, filled block by block.
Component axes first, the flat batch of positions last, NaN where a position was not solved. What follows from states and rates alone
(poses, twists, frames) is not kept but evaluated again where it is asked for, block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from functools import cached_property
from math import prod
from typing import Any, Literal, Self

import numpy as np

from mechgraph.determinacy.uniqueness import labels_of
from mechgraph.equations.terms import State
from mechgraph.errors import DeclarationError, MechgraphError
from mechgraph.fields import PerCase
from mechgraph.force.loads import Site, hold_names, inertia_wrenches, is_idle, kinetic_energy, user_twists
from mechgraph.force.reactions import PairFrames, given_effort_loads, user_state, user_wrench
from mechgraph.force.redundant import BlockForces, displacement, seats_of, strains
from mechgraph.kernel.tables import OF_FRICTION, Records
from mechgraph.kinematics.motion_path import Status, in_blocks
from mechgraph.kinematics.rates import PassiveMotion, Rates, Velocities
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.kinematics.system import System
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.linear import EVERY, Place
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array, Index, cross, rotate, rotate_back, shift_wrench
from mechgraph.maths.tolerances import MOTIONS, PATH, STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction
from mechgraph.model.gears import moving_lines
from mechgraph.model.loads import Law, Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import unit_of
from mechgraph.result.values import (
    Checks,
    LoadBearing,
    LoadResult,
    Mask,
    MaterialPoint,
    PassedCrossing,
    flat_place,
    unique_sizes,
)


@dataclass(frozen=True)
class BlockMotion:
    """Motion at the flat ``places`` of a block: states, rates, evaluated."""

    places: Index
    rates: Rates

    @property
    def here(self) -> Configuration:
        """The evaluation of the states."""
        return self.rates.here

    def part(self, at: Index) -> BlockMotion:
        """Some of the positions."""
        rates = Velocities(self.here.part(at), self.rates.dq[:, at])
        return BlockMotion(self.places[at], Rates(rates, self.rates.ddq[:, at], self.rates.contradiction[at]))


MOVED = ("x", "dq", "ddq", "closure")
"""What is kept of the motion at every position."""
KEPT = (
    "reactions", "efforts", "given", "loads", "hold", "stress", "stress_efforts", "coupled", "multipliers", "multiplier_stress",
    "coupled_stress", "shaking", "balance", "power", "holds", "hold_terms",
    "locked", "of_misfit", "range", "holds_alone",
)  # fmt: skip
"""Fields of ``BlockForces`` that are kept for every position."""
KEPT_OF_FRICTION = ("normals", "factor", "teeth", "rubbing", "growth", "speeds", "outcome", "ends")
"""Fields of ``Rubbed`` that are kept for every position; efforts and what pairs take up without those of teeth."""


TOGETHER = 300_000
"""Wrenches that are looked at together where all pairs are."""


def _touched(stress: Array, scale: float = 1.0) -> Mask:
    """Where self-stresses have a part: ``stress (..., s, T)``."""
    return np.asarray(np.sqrt((stress * stress).sum(axis=-2)) > STRESSES.unique * scale)


class Trajectory:
    """Motion and forces at a batch of positions, filled block by block; what is public returns arrays with the batch first.

    ``mechanism`` is the one that was solved, with the freedoms that take efforts as its drives; ``whole`` the same with the free pairs
    through which the motion of points and links is prescribed, behind its own; ``prescribed`` and ``actuated`` are freedoms of that.
    ``least_norm``: reactions that are not unique have the value of least norm, not NaN; ``radius``: the mean radius L.

    ``system_at(places)`` is the system with the numbers of the positions at flat places (they differ between variants); ``driven`` are the
    freedoms with an unknown effort, ``coordinates (F, T)`` the user's ones of all positions.
    """

    def __init__(
        self,
        system: System,
        system_at: Callable[[Index], System],
        batch: tuple[int, ...],
        t: Any,
        driven: Index,
        coordinates: Array,
        mask_redundant: bool,
        passive: tuple[PassiveMotion, ...] = (),
        mechanism: Mechanism | None = None,
        prescribed: tuple[str, ...] | None = None,
    ) -> None:
        self.whole: Mechanism = system.m
        self.mechanism: Mechanism = mechanism or self.whole
        self.actuated = system.freedom_names_of(driven)
        self.prescribed = self.actuated if prescribed is None else prescribed
        self.batch, self.t, self.driven, self._passive = batch, t, driven, passive
        self._system, self._system_at, self.least_norm = system, system_at, not mask_redundant
        self._coordinates, self._L, self.radius = coordinates, float(system.par.L), float(system.par.L)
        self.loads: tuple[Load, ...] = self.whole.loads
        self._count = prod(batch)
        self._asked = batch, t, np.arange(self._count)
        self._status = np.full(self._count, Status.OK.value, dtype="U24")
        self._kept: dict[str, Array] = {}
        self.largest, self._solved = np.zeros(2), np.zeros(self._count, dtype=bool)
        self._motions: list[BlockMotion] = []
        self.passed: tuple[PassedCrossing, ...] = ()
        self.rubbing: tuple[str, ...] = ()
        self.has_forces = False
        self.engine: Literal["dense", "sparse", "compiled"] = "dense"
        self.method: str | None = None
        self.closing: Any = None
        self.work: Any = Work()

    def __getstate__(self) -> dict[str, Any]:
        """Without the retained motions, which are most of its size and are evaluated again."""
        return vars(self) | {"_motions": []}

    # --- filling -------------------------------------------------------------------------------------------------------

    def put(self, motion: BlockMotion, forces: BlockForces | None) -> None:
        """Keep a block of solved positions."""
        places, rates = motion.places, motion.rates
        self._solved[places] = True
        for name, values in zip(MOVED, (motion.here.x, rates.dq, rates.ddq, motion.here.closure), strict=True):
            self._keep(name, places, values)
        self._motions = [motion] if len(places) == self._count and self._small else []
        if forces is None:
            return
        self.has_forces = True
        found = {"points": motion.here.pair_points, **{name: getattr(forces, name) for name in KEPT}}
        self.largest = np.maximum(self.largest, forces.largest)
        if (rubs := forces.rubs) is not None:
            self.rubbing = rubs.names
            found |= {"friction": rubs.efforts - rubs.teeth, "taken": rubs.taken - rubs.beside}
            found |= {name: getattr(rubs, name) for name in KEPT_OF_FRICTION}
        for name, values in found.items():
            if values is not None:
                self._keep(name, places, values)

    def estimate(self, places: Index, error: Array) -> None:
        """Note an estimated relative error of rates and forces ``(n,)``; the greatest stays."""
        known = self._kept.setdefault("accuracy", np.zeros(self._count))
        known[places] = np.maximum(known[places], error)

    def take(self, records: Records, forces: bool, rubbing: tuple[str, ...] = ()) -> None:
        """Keep all positions from the records of a compiled solution, with the names of the places ``rubbing``."""
        self._solved[:], self.rubbing = True, rubbing
        asked = (*MOVED, *(("points", *KEPT) if forces else ()), *(OF_FRICTION if rubbing else ()))
        self._kept |= {name: records[name] for name in asked if name in records}
        if rubbing:  # nothing is at rest where the kernel decides
            own = self._kept["efforts"] - self._kept["given"] - self._kept["coupled"]
            self._kept["range"] = np.stack([own, own], axis=1)
        self.has_forces, self.largest = forces, records.largest

    def _keep(self, name: str, places: Index, values: Array) -> None:
        if len(places) == self._count:
            self._kept[name] = values
            return
        if name not in self._kept:
            self._kept[name] = np.full((*values.shape[:-1], self._count), np.nan)
        self._kept[name][..., places] = values

    def coordinates_at(self, places: Index) -> Array:
        """User coordinates ``(F, n)`` at flat places."""
        return self._coordinates[:, places]

    def states_at(self, places: Index) -> Array:
        """States ``(nx, n)`` at flat places."""
        return self._of("x")[:, places]

    def mark(self, places: Index, status: Any) -> None:
        """Say why positions are not solved."""
        self._status[places] = status

    def as_declared(self, closure: Callable[[Array, Index], Array], tol: float) -> None:
        """Let ``checks`` give errors ``closure(x, places)`` of the declared geometry; positions beyond ``tol`` do not count as solved."""
        places = np.flatnonzero(self._solved)
        if not places.size:
            return
        error = np.full(self._count, np.nan)
        error[places] = closure(self._of("x")[:, places], places)
        beyond = error > tol
        if beyond.any():
            self._motions = []
            self._solved &= ~beyond
            self.mark(np.flatnonzero(beyond), Status.BEYOND_TOLERANCE.value)
            self._kept = {name: np.where(beyond, np.nan, values) for name, values in self._kept.items()}
        self._kept["closure"] = error

    def part(self, places: slice) -> Self:
        """The values at a range of flat positions, as views."""
        out, which = copy(self), np.arange(self._count)[places]
        out.batch, out._count = which.shape, len(which)
        out.t = None if self.t is None else np.broadcast_to(self.t, self.batch).reshape(-1)[places]
        out._system_at = lambda at: self._system_at(which[at])
        out._coordinates = self._coordinates[:, places]
        out._asked = (*self._asked[:2], self._asked[2][places])
        out._status, out._solved = self._status[places], self._solved[places]
        out._kept = {name: values[..., places] for name, values in self._kept.items()}
        out._motions = []
        return out

    def bears_nothing(self, columns: Index) -> bool:
        """Whether the efforts that hold some driven freedoms are nothing beside the loads, to the accuracy of a dead point."""
        largest = max(float(np.abs(self._of(name)).max(initial=0.0)) for name in ("loads", "given"))
        held = (self._of("efforts") - self._of("given") - self._of("coupled"))[columns]
        return bool((np.abs(held) <= PATH.independent * largest).all())

    def shown_as(self, mechanism: Mechanism, driven: Index) -> Self:
        """The same of a mechanism with fewer drives, which stands at a dead point of them."""
        out = copy(self)
        out.mechanism, out.driven = mechanism, driven
        out.actuated = out.prescribed = self._system.freedom_names_of(driven)
        out._status = np.full(self._count, Status.DEAD_POINT.value, dtype="U24")
        return out

    # --- shapes and units ----------------------------------------------------------------------------------------------

    def _out(self, values: Any) -> Any:
        """``(..., T)`` -> batch first ``(*batch, ...)``; read-only."""
        rows = values.transpose(-1, *range(values.ndim - 1)).copy()
        out = rows.reshape((*self.batch, *rows.shape[1:]))
        out.setflags(write=False)
        return out

    def _evaluated(self, value: Callable[[BlockMotion], Array]) -> Array:
        """What a function gives of the motion at all solved positions, block by block, ``(..., T)``."""
        if len(self._motions) == 1 and len(self._motions[0].places) == self._count:
            return value(self._motions[0])
        motions: Iterable[BlockMotion] = self._motions or map(self._motion, in_blocks(np.flatnonzero(self._solved)))
        if self._small:
            motions = self._motions = list(motions)
        found = [(motion.places, value(motion)) for motion in motions]
        out = np.full((*found[0][1].shape[:-1], self._count), np.nan)
        for places, values in found:
            out[..., places] = values
        return out

    @property
    def _small(self) -> bool:
        """Whether motions that were evaluated are retained."""
        # links times positions up to which motions evaluated again are retained (some 30 MB), as readers ask for one pair after
        # another
        return len(self.mechanism.links) * self._count <= 40_000

    def _motion(self, places: Index) -> BlockMotion:
        """The motion at some places, evaluated again."""
        here = Configuration(self._system_at(places), self._of("x")[:, places])
        rates = Rates(Velocities(here, self._of("dq")[:, places]), self._of("ddq")[:, places], np.zeros(len(places)))
        return BlockMotion(places, rates)

    def _of(self, name: str) -> Array:
        """A kept array; all NaN where no position was solved."""
        if name in self._kept:
            return self._kept[name]
        s = self._system
        P, N, F, n = len(s.m.pairs), len(s.m.links), s.n_freedoms, len(s.m.couplings)
        shapes: dict[str, tuple[int, ...]] = {
            "x": (s.n_state,), "dq": (F,), "ddq": (F,), "closure": (), "accuracy": (), "points": (3, P), "reactions": (6, P),
            "efforts": (F,), "given": (F,), "loads": (6, N), "hold": (6, N), "stress": (6, P, 0), "stress_efforts": (F, 0), "coupled": (F,),
            "multipliers": (n,), "multiplier_stress": (n, 0), "coupled_stress": (F, 0), "shaking": (6,), "balance": (), "power": (),
            "holds": (len(self._passive),), "hold_terms": (len(self._passive),),
        }  # fmt: skip
        empty = 0.0 if name == "hold" else np.nan
        return np.broadcast_to(empty, (*shapes[name], self._count))

    def _force(self, name: str) -> Array:
        if not self.has_forces and self._solved.any():
            raise MechgraphError("this solution has no forces: kinematics() computes none; call solve()")
        return self._of(name)

    @cached_property
    def _lengths(self) -> Array:
        """What a coordinate of one is in the user's units ``(F, 1)``."""
        return np.where(self._system.is_length, self._L, 1.0)[:, None]

    def _columns(self, pair: int) -> slice:
        return slice(*map(int, self._system.first_column[pair : pair + 2]))

    # --- motion ----------

    def status(self) -> Any:
        """Named outcomes, one a position."""
        return self._status.reshape(self.batch)

    def coordinates(self, pair: int, rank: int) -> Array:
        """Coordinates (rank 0), rates (1) or accelerations (2) of the freedoms of a pair, ``(..., f)``."""
        columns = self._columns(pair)
        if rank == 0:
            return self._out(np.where(self._solved, self._coordinates[columns], np.nan))
        return self._out(self._lengths[columns] * self._of(("dq", "ddq")[rank - 1])[columns])

    def frame_origin(self, pair: int, k: int | None = None) -> Array:
        """Origin of frame k of a pair, or that of its marker on link b, of every variant its own, global ``(..., 3)``."""
        (number, i), par = self._system.place_of(pair), self._system.par
        found = self._evaluated(
            lambda at: at.here.pair_points[:, pair] if k is None else at.here.frames[number][k][:, 3, i]
        )
        return self._out(par.L * found + par.origin.reshape(3, 1))

    def screws(self, pair: int) -> Array:
        """Twists of the freedoms of a pair at unit rates about the global origin, ``(..., 6, f)``."""
        columns = self._columns(pair)
        unit = self._lengths[columns]
        return self._out(self._evaluated(lambda at: user_twists(at.here, at.here.S[:, columns]) / unit))

    def link(self, link: int) -> tuple[Array, Array, Array]:
        """Pose ``(..., 4, 4)``, twist and its rate ``(..., 6)`` of a link."""

        def motion(block: BlockMotion) -> Array:
            rates, one = block.rates, slice(link, link + 1)
            pose = np.moveaxis(user_poses(block.here, one)[0], 0, -1).reshape(16, -1)
            parts = [user_twists(block.here, values[:, one])[:, 0] for values in (rates.V, rates.A)]
            return np.concatenate([pose, *parts])

        found = self._evaluated(motion)
        pose = self._out(found[:16].reshape(4, 4, -1))
        return pose, self._out(found[16:22]), self._out(found[22:])

    def link_point(self, link: int, p: Any) -> MaterialPoint:
        """A material point given in the link's frame; the mass center where it is None."""

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
        """Kinetic energy of all links, ``(...)``."""
        return self._out(self._L**2 * self._evaluated(lambda block: kinetic_energy(block.here, block.rates.V)))

    # --- forces --------------------------------------------------------------------------------------------------------

    def shaking(self) -> Array:
        """Wrench of all that acts on the frame about the global origin, ``(..., 6)``."""
        return self._out(user_wrench(self._system.par, self._force("shaking")))

    def link_hold(self, link: int) -> Array:
        """Wrench that keeps a passive body at rest, about the global origin, ``(..., 6)``."""
        self._force("loads")
        return self._out(user_wrench(self._system.par, self._of("hold")[:, link]))

    def passive_efforts(self) -> dict[str, Array]:
        """What keeps passive bodies at rest, by name: a couple about the axis of a turn, a force along a slide, ``(...)``."""
        return {
            name: self._out((self._L**2 if motion.turns else self._L) * size)
            for name, motion, size in zip(
                hold_names(self.mechanism, self._passive), self._passive, self._force("holds"), strict=True
            )
        }

    def load_bearing(self) -> tuple[LoadBearing, ...]:
        """Passive freedoms that the loads would move."""
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
            site.solves_friction = True
            site.collect((load,))
            wrenches, efforts = site.applied(), site.scaled_efforts()
            power = (rates.V * wrenches).sum(axis=(0, 1)) + (rates.dq * efforts).sum(axis=0)
            power += self._friction_power(load, block)
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

    def _friction_power(self, load: Load, block: BlockMotion) -> Array | float:
        """Power of the dry friction that a load declares ``(T,)``, internal units."""
        if not isinstance(load, Friction) or load.of not in self.rubbing:
            return 0.0
        if load.of in self.whole.pair_index:
            mine = self._columns(self.whole.place_of_pair(load.of))
            return np.asarray((self._kept["friction"][mine][:, block.places] * block.rates.dq[mine]).sum(axis=0))
        g = [c.name for c in self.whole.couplings].index(load.of)
        a, b = (self.whole.place_of_link(name) for name in self.whole.couplings[g].gears(self.whole))
        V = block.rates.V
        return np.asarray((self._kept["rubbing"][:, g][:, block.places] * (V[:, b] - V[:, a])).sum(axis=0))

    # --- checks and states -----------------------------------------------------------------------------------------------

    def checks(self) -> Checks:
        """Closure error, equilibrium and power, the last two relative to the largest term in the whole batch, and accuracy."""
        closure = self._out(self._of("closure"))
        accuracy = self._out(np.where(self._solved, self._of("accuracy"), np.nan))
        wrench, term = (float(size) or 1.0 for size in self.largest)
        balance, power = self._out(self._of("balance") / wrench), self._out(self._of("power") / term)
        return Checks(closure, balance, power, accuracy)

    def state(self, index: Any) -> State:
        """Screws and loads at one position, in the declared units about the global origin."""
        flat = flat_place(self.batch, index)
        if not self._solved[flat]:
            raise MechgraphError(f"state({index!r}): this position was not solved ({self._status[flat]})")
        block, own = self._motion(np.array([flat])), len(self.mechanism.freedom_names())
        loads = applied = np.zeros((6, len(self.mechanism.links), 1))
        if self.has_forces:
            acting = self._of("given")[:, [flat]].copy()
            acting[own:] += self._of("efforts")[own:, [flat]]  # what moves points and links is a load on these
            more = [self._kept[name][..., [flat]] for name in ("taken", "rubbing") if name in self._kept]
            rubs = more[0] + ContactLines(block.here).on_ways(more[1]) if more else 0.0
            loads = self._of("loads")[:, :, [flat]] + given_effort_loads(block.here, acting, rubs)
            held = self._kept["hold"][:, :, [flat]] if "hold" in self._kept else 0.0
            applied = loads - inertia_wrenches(block.here, block.rates) - held
        flank = self._of("multipliers")[:, [flat]] if self.has_forces else np.ones((len(self.whole.couplings), 1))
        state = user_state(block.rates, self._coordinates[:, [flat]], loads, applied, flank)
        return state.of_first(len(self.mechanism.pairs), own)

    # --- pairs and couplings: NaN where not unique, unless values of least norm were asked for ----------

    def _masked(self, values: Array, stress: Array, scale: float = 1.0) -> Array:
        """NaN where a self-stress has a part, unless values of least norm were asked for."""
        return np.where(_touched(stress, scale), np.nan, values) if stress.shape[-2] and not self.least_norm else values

    def reaction(self, pair: int) -> Array:
        """Reaction of a pair about the global origin, ``(..., 6)``."""
        wrenches, stress = self._force("reactions"), self._of("stress")[:, pair]
        if wrenches[0].size > TOGETHER:
            return self._about_origin(user_wrench(self._system.par, wrenches[:, pair]), stress)
        if "wrenches" not in self._kept:  # of all pairs, as readers ask for one after another
            self._kept["wrenches"] = user_wrench(self._system.par, wrenches)
        return self._about_origin(self._kept["wrenches"][:, pair], stress)

    def total(self, pair: int) -> Array:
        """Total wrench of a pair about the global origin, ``(..., 6)``."""
        states = self._transmitted(pair)
        return self._about_origin(user_wrench(self._system.par, states[:, 0]), states[:, 1:])

    def _transmitted(self, pair: int) -> Array:
        """What a pair transmits, reaction and efforts, and in every self-stress, ``(6, 1 + s, T)``, internal units."""
        columns = self._columns(pair)
        efforts = self._force("efforts")[columns] - self._through_contacts("multipliers", columns)
        if "teeth" in self._kept:
            efforts = efforts - self._kept["teeth"][columns]
        stress = self._of("stress_efforts")[columns] - self._through_contacts("multiplier_stress", columns)
        states = np.concatenate([efforts[:, None], stress], axis=1)
        E = self._evaluated(lambda block: block.here.E[:, columns])
        reactions = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)
        out = np.asarray(reactions + np.einsum("cft,fst->cst", E, states))
        if "taken" in self._kept:
            out[:, 0] += self._kept["taken"][:, pair]
        return out

    def _through_contacts(self, name: str, columns: slice) -> Array:
        """Efforts ``(f, ..., T)`` of multipliers that act where gears touch each other, not through the pairs of these freedoms."""
        touching = [g for g, c in enumerate(self._system.m.couplings) if c.steps]
        rows = self._evaluated(
            lambda block: block.here.coupling_coefficients[touching, columns] + np.zeros(block.here.T)
        )
        return np.asarray(np.einsum("gft,g...t->f...t", rows, self._of(name)[touching]))

    def on_link(self, pair: int, link: int) -> tuple[Array, Mask, Array]:
        """What a pair transmits to one of its links, (M, F) in its frame about the marker there, and whether unique, ``(..., 6)``;
        sizes of what is unique of M and F ``(..., 2)``.
        """
        s, states = self._system, self._transmitted(pair)
        sign, side = (1.0, 1) if s.b[pair] == link else (-1.0, 0)
        p = np.asarray(self.whole.pairs[pair].markers[side].point, dtype=float)

        def seen(block: BlockMotion) -> Array:
            par, X = block.here.system.par, block.here.poses[:, :, link]
            R = X[:, :3]
            at = rotate(R, ((p - par.offset[:, link]) / par.L)[:, None]) + X[:, 3]
            wrench = shift_wrench(states[..., block.places], at[:, None])
            return np.concatenate([rotate_back(R, wrench[:3]), rotate_back(R, wrench[3:])])

        found = self._evaluated(seen)
        unit = np.repeat([self._L**2, self._L], 3)[:, None]
        unique = ~_touched(found[:, 1:]) & self._solved
        known = found[:, :1] if self.least_norm else found
        sizes = np.stack([self._L**2 * unique_sizes(known[:3]), self._L * unique_sizes(known[3:])])
        wrench = self._out(self._masked(sign * unit * found[:, 0], found[:, 1:]))
        return wrench, self._out(unique), self._out(sizes)

    def _about_origin(self, wrench: Array, stress: Array) -> Array:
        """Wrench ``(6, T)`` in the user's units about the global origin, NaN where the internal ``stress (6, s, T)`` has a part."""
        if stress.shape[1]:
            far = self._system.par.origin / self._L
            shifted = np.concatenate([stress[:3] + cross(far[:, None, None], stress[3:]), stress[3:]])
            wrench = self._masked(wrench, shifted, 1.0 + float(np.linalg.norm(far)))
        return self._out(wrench)

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B, global directions, ``(..., 6)``."""
        reactions, point = self._force("reactions")[:, pair], self._of("points")[:, pair]
        stress = shift_wrench(self._of("stress")[:, pair], point[:, None])
        scale = np.repeat([self._L**2, self._L], 3)[:, None]
        return self._out(self._masked(scale * shift_wrench(reactions, point), stress))

    def magnitude(self, pair: int) -> Array:
        """Size of what is unique of the force of the reaction, ``(...)``."""
        states = np.concatenate([self._force("reactions")[3:, pair][:, None], self._of("stress")[3:, pair]], axis=1)
        return self._out(self._L * unique_sizes(states[:, :1] if self.least_norm else states)[None])[..., 0]

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name, ``(...)``."""
        row, values, stress = self._components(pair)
        return {n: self._out(v) for n, v in zip(row.component_names, self._masked(values, stress), strict=True)}

    def directions(self, pair: int) -> Array:
        """Forces of the unit reaction components of a pair, global directions, ``(..., 3, components)``."""
        number, i = self._system.place_of(pair)
        return self._out(self._evaluated(lambda block: block.here.W[number][3:, :, i]))

    def unique(self, pair: int) -> dict[str, Array]:
        """Which components and efforts of drives are unique, by name, ``(...)``; also where values of least norm stand for them."""
        columns = self._columns(pair)
        driven = np.flatnonzero(self._driven(columns))
        loose = _touched(np.concatenate([self._components(pair)[2], self._stress_of_drives(columns)[driven]]))
        labelled = zip(labels_of(self.whole.pairs[pair], driven), loose, strict=True)
        return {name: self._out(~part) for (_, name), part in labelled}

    def friction(self, pair: int) -> Array:
        """Its part of the applied efforts, ``(..., f)``."""
        columns = self._columns(pair)
        return self._out(self._unit(columns) * self._kept.get("friction", 0.0 * self._force("efforts"))[columns])

    def _unit(self, columns: slice) -> Array:
        """What an effort of one is in the user's units ``(f, 1)``."""
        return np.where(self._system.is_length[columns], self._L, self._L**2)[:, None]

    @property
    def holds_alone(self) -> Array:
        """Where friction holds several drives that are off ``(...)``, 1 or 0; NaN where that is not proved. 0 where nothing rubs."""
        return self._out(self._kept.get("holds_alone", np.zeros(self._count))[None])[..., 0]

    def friction_factor(self, place: int) -> tuple[float, tuple[str, ...]]:
        """By how much friction would have to fall at a flat position that jams, and the names of what jams, or is not determined.

        Parts of the largest tell what grows with it from what is loaded beside it.
        """
        growth = self._kept["growth"][:, place] if "growth" in self._kept else np.ones(len(self.rubbing))
        most = MOTIONS.nearby * growth.max(initial=0.0)
        jammed = dict.fromkeys(name for name, size in zip(self.rubbing, growth, strict=True) if size > most)
        return float(self._kept.get("factor", np.full(self._count, np.nan))[place]), tuple(jammed)

    @property
    def why_open(self) -> Array:
        """Why friction, or the ends between which it holds, are not determined ``(T,)``, by number (``force.friction.Came``)."""
        known = [self._kept.get(name, np.zeros(self._count)) for name in ("outcome", "ends")]
        return np.nan_to_num(known).sum(axis=0).astype(int)

    def effort_range(self, pair: int) -> Array:
        """Least and greatest effort of drives at rest, ``(..., f, 2)``; the effort itself in motion and where nothing rubs."""
        columns = self._columns(pair)
        ends = np.repeat(self._efforts(columns)[0][:, None], 2, axis=1)
        if "range" in self._kept:
            found = self._unit(columns)[:, None] * self._kept["range"][columns]
            ends = np.where(self._driven(columns)[:, None], found, ends)
        return self._out(ends)

    def at_places(self, name: str, of: str) -> Array:
        """Normal forces (``"normals"``) or speeds of sliding (``"speeds"``) at the places of a pair or coupling that rubs, ``(..., n)``."""
        mine = [i for i, other in enumerate(self.rubbing) if other == of]
        return self._out(self._L * self._kept[name][mine] if mine else np.zeros((0, self._count)))

    def locked_in(self, pair: int) -> dict[str, Array]:
        """What misfits lock in of the components, by name, ``(...)``; zero where stiffness does not split reactions."""
        known = self._kept.get("locked", 0.0 * self._force("reactions"))
        row, unit, found = self._components_of(pair, known[:, pair][:, None])
        return {name: self._out(part) for name, part in zip(row.component_names, unit * found[:, 0], strict=True)}

    @property
    def split_by_stiffness(self) -> bool:
        """Whether stiffness split redundant reactions."""
        return "locked" in self._kept

    def displacement(self, link: int, deflections: Mapping[str, Array]) -> Array:
        """Small twist ``(..., 6)`` of a link where pairs give way by ``deflections (...)``, ``"A.Fz"``; drives, passive freedoms held."""
        strain = strains(self._system, deflections)

        def twist(block: BlockMotion) -> Array:
            here, at = block.here, block.places
            f = self.closing.factored(here, self.closing.chosen(here, np.full(here.T, -1)))
            flank = self._force("multipliers")[:, at]
            return user_twists(here, displacement(here, f, self.driven, link, strain[:, at], flank)[:, None])[:, 0]

        return self._out(self._evaluated(twist))

    def misfit_sensitivity(self) -> dict[str, dict[str, Array]]:
        """Change of every component ``"A.Fz"`` for a misfit of one in every component that is not rigid, ``(...)`` each."""
        if not self.split_by_stiffness:
            why = "reactions are not split by stiffness; solve(..., redundant='elastic')"
            raise DeclarationError(f"misfits of {self.whole.name!r}", [why])
        seats = seats_of(self._system)
        causes = [(seats.labels[c], 1.0 if seats.couple[c] else 1.0 / self._L) for c in seats.soft]
        out: dict[str, dict[str, Array]] = {}
        for k, p in enumerate(self.whole.pairs):
            row, unit, found = self._components_of(k, self._kept["of_misfit"][:, k])
            for name, part in zip(row.component_names, unit[..., None] * found, strict=True):
                out[f"{p.name}.{name}"] = {
                    cause: self._out(per * values) for (cause, per), values in zip(causes, part, strict=True)
                }
        return out

    def _components(self, pair: int) -> tuple[PairType, Array, Array]:
        """The type of a pair, its components ``(c, T)`` in the user's units and what self-stresses have in them ``(c, s, T)``."""
        self._force("reactions")
        states = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)
        row, unit, found = self._components_of(pair, states)
        return row, unit * found[:, 0], found[:, 1:]

    def _components_of(self, pair: int, states: Array) -> tuple[PairType, Array, Array]:
        """The type of a pair, factors ``(c, 1)`` to the user's units, components ``(c, n, T)`` of its wrenches ``(6, n, T)``."""
        number, i = self._system.place_of(pair)
        row = self._system.groups[number].row

        def components(block: BlockMotion) -> Array:
            return PairFrames(block.here).components_of(number, i, states[..., block.places])

        couples = [c.is_couple for c in row.reactions or ()] or [False] * row.held
        return row, np.where(couples, self._L**2, self._L)[:, None], self._evaluated(components)

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """What the drive supplies, and what springs, dampers and given efforts do, ``(..., f)`` each."""
        columns = self._columns(pair)
        own, given = self._efforts(columns)
        return self._out(self._masked(own, self._stress_of_drives(columns))), self._out(given)

    def _efforts(self, columns: slice, places: Place = EVERY) -> tuple[Array, Array]:
        """What drives supply in freedoms and what loads do there, ``(f, n)`` each, in the user's units."""
        total, given, coupled = (self._force(name)[columns, places] for name in ("efforts", "given", "coupled"))
        own = np.where(self._driven(columns), total - given - coupled, np.where(np.isnan(given), np.nan, 0.0))
        return self._unit(columns) * own, self._unit(columns) * given

    def _driven(self, columns: slice) -> Mask:
        return (np.arange(self._system.n_freedoms)[columns, None] == self.driven).any(axis=1, keepdims=True)

    def _stress_of_drives(self, columns: slice, places: Place = EVERY) -> Array:
        """What self-stresses have in the efforts of drives, ``(f, s, n)``."""
        stress = self._of("stress_efforts")[columns][..., places] - self._of("coupled_stress")[columns][..., places]
        return np.where(self._driven(columns)[:, None], stress, 0.0)

    # --- all pairs at once -----------------------------------------------------------------------------------------------

    def blocks(self) -> Iterator[Index]:
        """The solved flat places in parts of so few that values of all pairs there are no burden, for ``..._at``."""
        solved = np.flatnonzero(self._solved)
        size = max(1, TOGETHER // (len(self.whole.pairs) * (1 + self._of("stress").shape[2])))
        return (solved[i : i + size] for i in range(0, len(solved), size))

    def reactions_at(self, places: Index) -> tuple[Array, Mask]:
        """Reactions about the origins of markers B ``(6, P, n)``, of least norm where redundant, and which numbers are not unique."""
        points = self._of("points")[:, :, places]
        scale = np.repeat([self._L**2, self._L], 3)[:, None, None]
        loose = _touched(shift_wrench(self._of("stress")[..., places], points[:, :, None]))
        return scale * shift_wrench(self._force("reactions")[..., places], points), loose

    def components_at(self, places: Index) -> tuple[Array, Mask]:
        """Components ``(6, P, n)`` by the pair table, 0 beyond those of a pair, and which are not unique."""
        reactions, stress = self._force("reactions")[:, :, None, places], self._of("stress")[..., places]
        states = np.concatenate([reactions, stress], axis=2)
        s, found = self._system, np.zeros((6, *states.shape[1:]))
        here = Configuration(self._system_at(places), self._of("x")[:, places])
        for group, part in zip(s.groups, PairFrames(here).components(states), strict=True):
            couples = [c.is_couple for c in group.row.reactions or ()] or [False] * len(part)
            unit = np.where(couples, self._L**2, self._L).reshape(-1, 1, 1, 1)
            part[:, :, :1] *= unit
            found[: len(part), group.pairs] = part
        return found[:, :, 0], _touched(found[:, :, 1:])

    def efforts_at(self, places: Index) -> tuple[Array, Array, Mask]:
        """Own and applied efforts ``(F, n)``, and which of the former are not unique."""
        return *self._efforts(EVERY, places), _touched(self._stress_of_drives(EVERY, places))

    def multiplier(self, coupling: int) -> Array:
        """Multiplier of a coupling, ``(...)``."""
        return self._out(self._masked(self._multiplier(coupling), self._of("multiplier_stress")[coupling]))

    def multipliers(self) -> tuple[Array, Mask]:
        """Multipliers of all couplings ``(n, T)``, of least norm where redundant, and where they are not unique."""
        found = [self._multiplier(k) for k in range(len(self.mechanism.couplings))]
        loose = _touched(self._of("multiplier_stress"))[: len(found)]
        return np.array(found).reshape(len(found), self._count), loose

    def _multiplier(self, coupling: int) -> Array:
        row, blocks = self._system.graph.loop_rows + coupling, in_blocks(np.arange(self._count))
        scales = [np.broadcast_to(self._system_at(block).row_scale[row], len(block)) for block in blocks]
        return np.asarray(self._L**2 * np.concatenate(scales) * self._force("multipliers")[coupling])

    def turned_over(self, coupling: int) -> Mask:
        """Where ``(T,)`` the other flank of a mesh takes over, as its centers stand still."""
        if self._system.m.couplings[coupling].name not in self._system.m.once(moving_lines):
            return np.ones(self._count, dtype=bool)
        m = self._force("multipliers")
        found = self._evaluated(lambda at: ContactLines(at.here).settle(m[:, at.places])[coupling][None].astype(float))
        return np.asarray(found[0] > 0.5)

    def _line(self, coupling: int, of: Callable[[ContactLines, BlockMotion, Array], Array]) -> Array:
        """What a function tells of the line along which a coupling acts, from lines, motion and multipliers, at all positions."""
        c, m = self._system.m.couplings[coupling], self._force("multipliers")
        if not c.steps:
            what = "acts in its freedoms, not along a line; SpurGears and its like have a force and a point"
            raise DeclarationError(f"coupling {c.name!r}", [what])

        def at(block: BlockMotion) -> Array:
            lines = ContactLines(block.here)
            lines.settle(m[:, block.places])
            return of(lines, block, m[:, block.places])

        return self._evaluated(at)

    def contact(self, coupling: int) -> tuple[Array, Array, Array]:
        """Force of gears on the second one, the point where it acts, and the moment of friction about it, ``(..., 3)``."""
        none = np.zeros((6, len(self.whole.couplings), self._count))

        def of(lines: ContactLines, block: BlockMotion, m: Array) -> Array:
            P, W = lines.push(coupling, m)[1], self._kept.get("rubbing", none)[:, coupling, block.places]
            return np.concatenate([lines.on_gears(m, m)[3:, coupling] + W[3:], P, shift_wrench(W, P)[:3]])

        stress = self._of("multiplier_stress")[coupling]
        values, par = self._line(coupling, of), self._system.par
        force = self._masked(par.L * values[:3], np.broadcast_to(stress, (3, *stress.shape)))
        return (
            self._out(force),
            self._out(par.L * values[3:6] + par.origin.reshape(3, 1)),
            self._out(par.L**2 * values[6:]),
        )

    def pressing(self, coupling: int) -> Array:
        """Normal force between gears, ``(...)``."""
        found = self._line(
            coupling, lambda lines, _, m: np.abs(m[coupling] / lines.multiplier_of_one(coupling, m))[None]
        )
        return self._out(self._masked(self._L * found, self._of("multiplier_stress")[[coupling]]))[..., 0]

    def number(self, value: Any) -> Any:
        """A number of a load, one a position ``(...)`` where it varies from case to case."""
        batch, _, flat = self._asked
        return value.values[flat // batch[-1]].reshape(self.batch) if isinstance(value, PerCase) else value
