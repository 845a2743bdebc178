"""What a solution keeps: arrays over positions, and the states and forces of pairs that follow from them.

The arrays over positions in internal units that a solution keeps, filled block by block.
Component axes first, the flat batch of positions last, NaN where a position was not solved. What follows from states and rates alone
(poses, twists, frames) is not kept but evaluated again where it is asked for, block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, Literal, Protocol, Self

import numpy as np

from mechgraph.determinacy.uniqueness import labels_of
from mechgraph.equations.terms import MovingState
from mechgraph.errors import DeclarationError, MechgraphError
from mechgraph.force.block import BlockForces
from mechgraph.force.loads import inertia_wrenches, user_poses, user_twists
from mechgraph.force.reactions import PairFrames, internal_state
from mechgraph.kinematics.motion_path import Status, in_blocks
from mechgraph.kinematics.rates import PassiveMotion, Rates, Velocities
from mechgraph.kinematics.state import Configuration, ContactLines
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import EVERY, Place
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array, Index, cross, rotate, rotate_back, shift_wrench
from mechgraph.maths.tolerances import PATH, STRESSES
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import shown
from mechgraph.result.values import Mask, PassedCrossing


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
)  # fmt: skip
"""Fields of ``BlockForces`` that are kept for every position."""


class Records(Protocol):
    """All positions at once, by the names of what is kept."""

    @property
    def largest(self) -> Array:
        """The largest wrench and power ``(2,)``."""

    def __contains__(self, name: str) -> bool:
        """Whether there is a part of that name."""

    def __getitem__(self, name: str) -> Array:
        """That part, component axes first and positions last."""


RETAINED = 40_000
"""Links times positions up to which motions evaluated again are retained (some 30 MB), as readers ask for one pair after another."""


class Kept:
    """Arrays over positions, filled block by block.

    ``system_at(places)`` is the system with the numbers of the positions at flat places (they differ between variants); ``driven`` are the
    freedoms with an unknown effort, ``coordinates (F, T)`` the user's ones of all positions, ``mechanism`` and
    ``prescribed`` as in ``Values``.
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
        self._L = self.radius = float(system.par.L)
        self._coordinates = coordinates
        self.loads: tuple[Load, ...] = self.whole.loads
        self._count = int(np.prod(batch))
        self._asked = batch, t, np.arange(self._count)
        self._status = np.full(self._count, Status.OK.value, dtype="U24")
        self._kept: dict[str, Array] = {}
        self._largest = np.zeros(2)
        self._solved = np.zeros(self._count, dtype=bool)
        self._motions: list[BlockMotion] = []
        self.passed: tuple[PassedCrossing, ...] = ()
        self.has_forces = False
        self.engine: Literal["dense", "sparse", "compiled"] = "dense"
        self.method: str | None = None
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
        self._keep("points", places, motion.here.pair_points)
        for name in KEPT:
            values = getattr(forces, name)
            if values is not None:
                self._keep(name, places, values)
        self._largest = np.maximum(self._largest, forces.largest)

    def estimate(self, places: Index, error: Array) -> None:
        """Note an estimated relative error of rates and forces ``(n,)``; the greatest stays."""
        known = self._kept.setdefault("accuracy", np.zeros(self._count))
        known[places] = np.maximum(known[places], error)

    def take(self, records: Records, forces: bool) -> None:
        """Keep all positions from the records of a compiled solution."""
        self._solved[:] = True
        self._kept |= {
            name: records[name] for name in (*MOVED, *(("points", *KEPT) if forces else ())) if name in records
        }
        self.has_forces, self._largest = forces, records.largest

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

    def first(self, count: int) -> Any:
        """The outcomes of the first positions."""
        return self._status[:count]

    # --- shapes and units ----------------------------------------------------------------------------------------------

    def _out(self, values: Array) -> Array:
        """``(..., T)`` -> batch first ``(*batch, ...)``; read-only."""
        rows = np.array(np.moveaxis(values, -1, 0), order="C")
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
        out: Array | None = None
        for motion in motions:
            found = value(motion)
            if out is None:
                out = np.full((*found.shape[:-1], self._count), np.nan)
            out[..., motion.places] = found
        assert out is not None
        return out

    @property
    def _small(self) -> bool:
        """Whether motions that were evaluated are retained."""
        return len(self.mechanism.links) * self._count <= RETAINED

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
            raise MechgraphError("this solution has no forces: it comes from kinematics(); use solve()")
        return self._of(name)

    def _columns(self, pair: int) -> slice:
        first = self._system.first_column
        return slice(int(first[pair]), int(first[pair + 1]))


def user_wrench(par: Parameters, f: Array) -> Array:
    """Wrench about the internal origin -> user's units about the global origin, ``(6, ...)``."""
    out = np.empty(f.shape)
    origin = par.origin.reshape(3, *(1,) * (f.ndim - 1))
    np.multiply(f[3:], par.L, out=out[3:])
    np.multiply(f[:3], par.L**2, out=out[:3])
    out[:3] += cross(origin, out[3:])
    return out


def user_state(rates: Rates, coordinates: Array, loads: Array, applied: Array, flank: Array) -> MovingState:
    """The State at one position with user coordinates ``(F, 1)``, internal loads, all and the applied ones alone, ``(6, N, 1)``, and the
    signs ``(n, 1)`` of the multipliers of couplings, which tell on which flanks gears touch each other.
    """
    here = rates.here
    s, par = here.system, here.system.par
    inner = internal_state(here, loads, flank)
    scale = np.broadcast_to(s.row_scale, (s.n_rows, 1))[6 * s.graph.n_loops :]
    rows = [p.type for p in s.m.pairs]
    couples = [[c.is_couple for c in row.reactions or ()] for row in rows]
    efforts = [[c.is_couple for c in row.efforts] for row in rows]
    along = [[c.is_couple for c in row.bookkeeping.along] if row.bookkeeping else [] for row in rows]
    unit = np.where(s.is_length, par.L, 1.0)[:, None]
    freedoms = user_twists(here, here.S) / unit
    columns = [slice(first, end) for first, end in pairwise(s.first_column.tolist())]
    without = here.accelerations_with(np.zeros_like(rates.ddq), rates.bias)
    return MovingState(
        coordinates=coordinates,
        velocities=unit * rates.dq,
        poses=np.moveaxis(user_poses(here)[..., :3, :], (0, 1), (2, 3)),
        twists=user_twists(here, rates.V),
        reactions=tuple(_user_screws(par, w, which) for w, which in zip(inner.reactions, couples, strict=True)),
        efforts=tuple(_user_screws(par, w, which) for w, which in zip(inner.efforts, efforts, strict=True)),
        along=tuple(_user_screws(par, w, which) for w, which in zip(inner.along, along, strict=True)),
        conditions=tuple(user_twists(here, w) if w.shape[1] else w for w in inner.conditions),
        loads=user_wrench(par, loads),
        contacts=tuple(user_wrench(par, G) / (par.L**2 * one) for G, one in zip(inner.contacts, scale, strict=True)),
        accelerations=unit * rates.ddq,
        freedoms=tuple(freedoms[:, mine] for mine in columns),
        biases=user_twists(here, rates.bias),
        inertias=_user_inertias(here),
        applied=user_wrench(par, applied),
        gyroscopic=user_wrench(par, _inertia_wrenches(here, rates.V, without)),
    )


def _inertia_wrenches(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


def _user_inertias(here: Configuration) -> Array:
    """Inertias of all links about the global origin ``(6, 6, N, T)``, in the user's units."""
    par, still = here.system.par, np.zeros((6, len(here.system.m.links), here.T))
    columns = []
    for unit in np.eye(6):
        inner = np.concatenate([unit[:3], (unit[3:] - cross(par.origin, unit[:3])) / par.L])
        wrenches = -_inertia_wrenches(here, still, np.broadcast_to(inner[:, None, None], still.shape))
        columns.append(user_wrench(par, wrenches))
    return np.stack(columns, axis=1)


def _user_screws(par: Parameters, wrenches: Array, couples: list[bool]) -> Array:
    """Unit wrenches ``(6, n, T)``: arms in the user's length, about the global origin; unit couples stay, forces that go with them are
    per length.
    """
    out = wrenches.copy()
    for j in range(out.shape[1]):
        if j < len(couples) and couples[j]:
            out[3:, j] /= par.L
        else:
            out[:3, j] *= par.L
        out[:3, j] += cross(par.origin[:, None], out[3:, j])
    return out


def flat_place(batch: tuple[int, ...], index: Any) -> int:
    """Place in the flat batch of the one position that an index names.

    Raises
    ------
    MechgraphError
    """
    try:
        flat = np.arange(int(np.prod(batch))).reshape(batch)[index]
    except (IndexError, ValueError, TypeError):
        text = f"state({shown(index)}): no such position in a batch {batch}; give one index an axis"
        raise MechgraphError(text) from None
    if np.ndim(flat):
        raise MechgraphError(
            f"state({shown(index)}): names {np.size(flat)} positions of a batch {batch}; give one index an axis"
        )
    return int(flat)


TOGETHER = 300_000
"""Wrenches that are looked at together where all pairs are."""


def _sizes(states: Array) -> Array:
    """Sizes ``(T,)`` of what is unique of vectors ``(3, T)``: of their part at right angles to all that self-stresses add to them.

    ``states (3, 1 + s, T)`` are the vectors and what the self-stresses have in them. NaN where these take every direction.
    """
    vectors, stress = states[:, 0], np.moveaxis(states[:, 1:], -1, 0)
    if not stress.shape[-1]:
        return np.asarray(np.linalg.norm(vectors, axis=0))
    ways, sizes, _ = np.linalg.svd(stress, full_matrices=False)
    loose = sizes > STRESSES.unique
    along = np.einsum("tij,it->tj", ways, vectors) * loose
    left = vectors - np.einsum("tij,tj->it", ways, along)
    return np.where(loose.sum(axis=-1) == len(vectors), np.nan, np.linalg.norm(left, axis=0))


def _touched(stress: Array, scale: float = 1.0) -> Mask:
    """Where self-stresses have a part: ``stress (..., s, T)``."""
    return np.asarray(np.sqrt((stress * stress).sum(axis=-2)) > STRESSES.unique * scale)


class PairForces(Kept):
    """What pairs and couplings transmit; NaN where it is not unique, unless values of least norm were asked for."""

    def _masked(self, values: Array, stress: Array, scale: float = 1.0) -> Array:
        """NaN where a self-stress has a part, unless values of least norm were asked for."""
        return np.where(_touched(stress, scale), np.nan, values) if stress.shape[-2] and not self.least_norm else values

    def reaction(self, pair: int) -> Array:
        """Reaction about the global origin."""
        return self._about_origin(self._force("reactions")[:, pair], self._of("stress")[:, pair])

    def total(self, pair: int) -> Array:
        """Total wrench about the global origin."""
        states = self._transmitted(pair)
        return self._about_origin(states[:, 0], states[:, 1:])

    def _transmitted(self, pair: int) -> Array:
        """What a pair transmits, reaction and efforts, and in every self-stress, ``(6, 1 + s, T)``, internal units."""
        columns = self._columns(pair)
        efforts = self._force("efforts")[columns] - self._through_contacts("multipliers", columns)
        stress = self._of("stress_efforts")[columns] - self._through_contacts("multiplier_stress", columns)
        states = np.concatenate([efforts[:, None], stress], axis=1)
        E = self._evaluated(lambda block: block.here.E[:, columns])
        reactions = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)
        return np.asarray(reactions + np.einsum("cft,fst->cst", E, states))

    def _through_contacts(self, name: str, columns: slice) -> Array:
        """Efforts ``(f, ..., T)`` of multipliers that act where gears touch each other, not through the pairs of these freedoms."""
        touching = [g for g, c in enumerate(self._system.m.couplings) if c.steps]
        coefficients = self._system.coupling_matrix[touching, columns, 0]
        return np.asarray(np.einsum("gf,g...->f...", coefficients, self._of(name)[touching]))

    def on_link(self, pair: int, link: int) -> tuple[Array, Mask, Array]:
        """What a pair transmits to one of its links, in the link's frame about its marker there; what of it is unique; sizes of that."""
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
        unique = (~_touched(found[:, 1:]) & self._solved).astype(float)
        known = found[:, :1] if self.least_norm else found
        sizes = np.stack([self._L**2 * _sizes(known[:3]), self._L * _sizes(known[3:])])
        wrench = self._out(self._masked(sign * unit * found[:, 0], found[:, 1:]))
        return wrench, self._out(unique).astype(bool), self._out(sizes)

    def _about_origin(self, value: Array, stress: Array) -> Array:
        """Wrench ``(6, T)`` in the user's units about the global origin, NaN where ``stress (6, s, T)`` has a part."""
        wrench = user_wrench(self._system.par, value)
        if stress.shape[1]:
            far = self._system.par.origin / self._L
            shifted = np.concatenate([stress[:3] + cross(far[:, None, None], stress[3:]), stress[3:]])
            wrench = self._masked(wrench, shifted, 1.0 + float(np.linalg.norm(far)))
        return self._out(wrench)

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B."""
        reactions, point = self._force("reactions")[:, pair], self._of("points")[:, pair]
        stress = shift_wrench(self._of("stress")[:, pair], point[:, None])
        scale = np.repeat([self._L**2, self._L], 3)[:, None]
        return self._out(self._masked(scale * shift_wrench(reactions, point), stress))

    def magnitude(self, pair: int) -> Array:
        """Size of what is unique of the force of the reaction."""
        states = np.concatenate([self._force("reactions")[3:, pair][:, None], self._of("stress")[3:, pair]], axis=1)
        return self._out(self._L * _sizes(states[:, :1] if self.least_norm else states)[None])[..., 0]

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name."""
        row, values, stress = self._components(pair)
        masked = self._masked(values, stress)
        return {name: self._out(part) for name, part in zip(row.component_names, masked, strict=True)}

    def directions(self, pair: int) -> Array:
        """Forces of the unit components."""
        number, i = self._system.place_of(pair)
        return self._out(self._evaluated(lambda block: block.here.W[number][3:, :, i]))

    def unique(self, pair: int) -> dict[str, Array]:
        """Which reaction components and efforts are unique, also where values of least norm stand for them."""
        columns = self._columns(pair)
        driven = np.flatnonzero(self._driven(columns))
        loose = _touched(np.concatenate([self._components(pair)[2], self._stress_of_drives(columns)[driven]]))
        labels = labels_of(self.whole.pairs[pair], driven)
        return {name: self._out(~part) for (_, name), part in zip(labels, loose, strict=True)}

    def _components(self, pair: int) -> tuple[PairType, Array, Array]:
        """The type of a pair, its components ``(6 - f, T)`` in the user's units and what self-stresses have in them ``(6 - f, s, T)``."""
        self._force("reactions")
        number, i = self._system.place_of(pair)
        row = self._system.groups[number].row
        states = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)

        def components(block: BlockMotion) -> Array:
            return PairFrames(block.here).components_of(number, i, states[..., block.places])

        found = self._evaluated(components)
        couples = [c.is_couple for c in row.reactions or ()] or [False] * (6 - row.f)
        unit = np.where(couples, self._L**2, self._L)[:, None]
        return row, unit * found[:, 0], found[:, 1:]

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """What the drive supplies, and what loads do in the freedoms."""
        columns = self._columns(pair)
        own, given = self._efforts(columns)
        return self._out(self._masked(own, self._stress_of_drives(columns))), self._out(given)

    def _efforts(self, columns: slice, places: Place = EVERY) -> tuple[Array, Array]:
        """What drives supply in freedoms and what loads do there, ``(f, n)`` each, in the user's units."""
        total, given, coupled = (self._force(name)[columns, places] for name in ("efforts", "given", "coupled"))
        own = np.where(self._driven(columns), total - given - coupled, np.where(np.isnan(given), np.nan, 0.0))
        unit = np.where(self._system.is_length[columns], self._L, self._L**2)[:, None]
        return unit * own, unit * given

    def _driven(self, columns: slice) -> Mask:
        places = np.arange(*columns.indices(self._system.n_freedoms))
        return np.asarray((places[:, None] == self.driven).any(axis=1)[:, None])

    def _stress_of_drives(self, columns: slice, places: Place = EVERY) -> Array:
        """What self-stresses have in the efforts of drives, ``(f, s, n)``."""
        stress = self._of("stress_efforts")[columns][..., places] - self._of("coupled_stress")[columns][..., places]
        return np.where(self._driven(columns)[:, None], stress, 0.0)

    # --- all pairs at once -----------------------------------------------------------------------------------------------

    def blocks(self) -> Iterator[Index]:
        """The solved places in parts of so few that values of all pairs there are no burden."""
        solved = np.flatnonzero(self._solved)
        size = max(1, TOGETHER // (len(self.whole.pairs) * (1 + self._of("stress").shape[2])))
        return (solved[i : i + size] for i in range(0, len(solved), size))

    def reactions_at(self, places: Index) -> tuple[Array, Mask]:
        """Reactions of all pairs about the origins of markers B ``(6, P, n)``, of least norm, and which numbers are not unique."""
        points = self._of("points")[:, :, places]
        scale = np.repeat([self._L**2, self._L], 3)[:, None, None]
        loose = _touched(shift_wrench(self._of("stress")[..., places], points[:, :, None]))
        return scale * shift_wrench(self._force("reactions")[..., places], points), loose

    def components_at(self, places: Index) -> tuple[Array, Mask]:
        """Components of all pairs ``(6, P, n)`` by the pair table, 0 beyond those of a pair, and which are not unique."""
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
        """Own and applied efforts in all freedoms ``(F, n)``, and which of the former are not unique."""
        every = slice(None)
        own, given = self._efforts(every, places)
        return own, given, _touched(self._stress_of_drives(every, places))

    def multiplier(self, coupling: int) -> Array:
        """The multiplier of a coupling in the user's units: the effort ``c_i m`` in freedom i."""
        return self._out(self._masked(self._multiplier(coupling), self._of("multiplier_stress")[coupling]))

    def multipliers(self) -> tuple[Array, Mask]:
        """The multipliers of all couplings ``(n, T)``, of least norm where redundant, and where they are not unique."""
        found = [self._multiplier(k) for k in range(len(self.mechanism.couplings))]
        loose = _touched(self._of("multiplier_stress"))[: len(found)]
        return np.array(found).reshape(len(found), self._count), loose

    def _multiplier(self, coupling: int) -> Array:
        row, blocks = 6 * self._system.graph.n_loops + coupling, in_blocks(np.arange(self._count))
        scales = [np.broadcast_to(self._system_at(block).row_scale[row], len(block)) for block in blocks]
        return np.asarray(self._L**2 * np.concatenate(scales) * self._force("multipliers")[coupling])

    def contact(self, coupling: int) -> tuple[Array, Array]:
        """Force of gears on the second one, and the point where it acts."""
        c = self._system.m.couplings[coupling]
        if not c.steps:
            what = "acts in its freedoms, not along a line; SpurGears and its like have a force and a point"
            raise DeclarationError(f"coupling {c.name!r}", [what])
        m, stress = self._force("multipliers"), self._of("multiplier_stress")[coupling]

        def of(block: BlockMotion) -> Array:
            lines, here = ContactLines(block.here), m[:, block.places]
            which = [g for g, _ in lines.contacts].index(coupling)
            flank = (here[coupling] < 0.0).astype(np.intp)
            points = lines.wrenches[which][1][:, flank, np.arange(len(block.places))]
            return np.concatenate([lines.on_gear(here, here)[which][3:], points])

        values, par = self._evaluated(of), self._system.par
        force = self._masked(par.L * values[:3], np.broadcast_to(stress, (3, *stress.shape)))
        return self._out(force), self._out(par.L * values[3:] + par.origin.reshape(3, 1))
