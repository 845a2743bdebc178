"""The arrays over positions in internal units that a solution keeps, filled block by block.

Component axes first, the flat batch of positions last, NaN where a position was not solved. What follows from states and rates alone
(poses, twists, frames) is not kept but evaluated again where it is asked for, block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import Status, in_blocks
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.errors import MechgraphError
from mechgraph.force.block import BlockForces
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.newton import Work
from mechgraph.numerics.tolerances import PATH
from mechgraph.result.values import PassedCrossing


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
