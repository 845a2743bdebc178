"""One call of ``solve`` up to the rates: drivers and their motions, assembly, positions and rates, in one piece or in blocks."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, closed_start, named_columns, state_rows
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.march import FAIR, SINGULAR, Status
from mechgraph.closure.passive_rest import Idle, held_well, spin_angles
from mechgraph.closure.path import Follower, Positions, in_blocks
from mechgraph.closure.rates import DEAD_POINT, Rates, closure_solver, distance_to_dead_point, rates
from mechgraph.errors import DeclarationError, IndeterminateError
from mechgraph.force.dalembert import chosen_for_all
from mechgraph.force.found import Motions
from mechgraph.force.large import Given, certified_loops, refuse_dense
from mechgraph.model.drive import Drive
from mechgraph.model.load import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.numerics.linear import Choice, ChosenSystem, choose, independent_rows, rank_of, singular_values
from mechgraph.report.report import check
from mechgraph.structure.mobility import free_motion

TURNS_BACK = 60
"""Most steps in which the spin of passive bodies is taken back."""
LONGEST_TURN = 0.25
"""Longest such step (radians)."""
FARTHEST = 1e6
"""Longest way of a driver from its start (radians, or lengths / L)."""
DOUBTFUL = 1e4
"""Condition number of the closure equations from which on the distance to a dead point is looked at."""


def _as_motion(value: Any, name: str, faults: list[str]) -> Motion | None:
    if isinstance(value, Motion):
        return value
    try:
        return Motion(value)
    except DeclarationError as error:
        faults += [f"drive {name!r}: {fault}" for fault in error.faults]
        return None


def driven(m: Mechanism, motions: Mapping[str, Any] | None) -> tuple[Mechanism, dict[str, Motion]]:
    """The mechanism with its drives, and the motion of each by full name.

    Motions given by name go to the declared drives, or become the drives where none is declared; the others use the motion
    stored with them.
    """
    if motions is not None and not isinstance(motions, Mapping):
        raise DeclarationError(
            f"solve {m.name!r}",
            [f"motions = {type(motions).__name__}: expected a mapping driver -> motion, e.g. {{'A': angles}}"],
        )
    given = dict(motions or {})
    faults: list[str] = []
    if not m.drives and given:
        faults += [f"drive {name!r}: {why}" for name in given if (why := m.freedom_fault(name, single=True))]
        if not faults:
            m = m.replace(drives=[Drive(name) for name in given])
    known = {m.full_name(d.freedom): d for d in m.drives}
    out: dict[str, Motion] = {}
    for name, value in given.items():
        why = m.freedom_fault(name, single=True)
        if why or m.full_name(name) not in known:
            faults.append(f"motion of {name!r}: {why or 'is not a drive'}; drives: {', '.join(known) or 'none'}")
            continue
        if m.full_name(name) in out:
            faults.append(f"motion of {name!r}: {m.full_name(name)} is given twice")
            continue
        motion = _as_motion(value, name, faults)
        if motion is not None:
            out[m.full_name(name)] = motion
    for name, drive in known.items():
        if name not in out and drive.motion is not None:
            out[name] = drive.motion
        elif name not in out and not faults:
            faults.append(f"drive {name!r} has no motion; give one: {{{name!r}: angles or mg.Motion(...)}}")
    if faults:
        raise DeclarationError(f"solve {m.name!r}", faults)
    return m, {name: out[name] for name in known}


def _batch(m: Mechanism, motions: Mapping[str, Motion]) -> tuple[int, ...]:
    try:
        batch = np.broadcast_shapes(*(motion.shape for motion in motions.values()))
        if 0 in batch:
            raise DeclarationError(f"solve {m.name!r}", ["the motions have no positions; give at least one"])
        return batch
    except ValueError:
        shapes = ", ".join(f"{name} {motion.shape}" for name, motion in motions.items())
        raise DeclarationError(
            f"solve {m.name!r}", [f"the motions describe different numbers of positions: {shapes}"]
        ) from None


@dataclasses.dataclass(frozen=True)
class Part:
    """Motions of some of the positions, the closure equations there, and the places of these positions in the flat batch."""

    motions: Motions
    solver: ChosenSystem
    places: Index


class Run:
    """One call of ``solve``: drivers, positions and rates."""

    def __init__(self, m: Mechanism, motions: Mapping[str, Any] | None) -> None:
        self.m, self.motions = driven(m, motions)
        self.batch = _batch(self.m, self.motions)
        first = {name: float(np.asarray(motion.position).reshape(-1)[0]) for name, motion in self.motions.items()}
        self.start = closed_start(self.m, first)
        self.system, self.x = self.start.system, self.start.x[:, 0]
        self.columns, _ = named_columns(self.m, self.system, dict.fromkeys(self.motions, 0.0))
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self._refuse_far()
        self.t = next((motion.t for motion in self.motions.values() if motion.t is not None), None)
        self.loops = certified_loops(self.start, self.columns)
        if self.loops is not None:
            return
        self.freedoms = free_motion(self.system, self.x, self.columns)
        self.lead = np.arange(len(self.columns))
        if self.freedoms.dependent:
            rank = rank_of(singular_values(self.freedoms.null[self.columns]), 1e-8)
            order = [int(c) for c in self.columns]
            chosen = independent_rows(self.freedoms.null, order, rank)
            self.lead = np.array([order.index(c) for c in sorted(chosen, key=order.index)], dtype=np.intp)
        self._check_determinate()
        refuse_dense(self.system)

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads that act."""
        return self.m.loads

    def _refuse_far(self) -> None:
        """Refuse a path that would be followed for hours."""
        far = np.abs(self.values("position") - self.x[state_rows(self.system, self.columns)][:, None]).max(axis=1)
        faults = [
            f"motion of {name!r}: comes {size * unit:.3g} away from the start; expected at most {FARTHEST * unit:.3g}"
            for name, size, unit in zip(self.motions, far, self.unit, strict=True)
            if size > FARTHEST
        ]
        if faults:
            raise DeclarationError(f"solve {self.m.name!r}", faults)

    def _check_determinate(self) -> None:
        free = self.freedoms.undriven
        if free:
            names = ", ".join(dict.fromkeys(name for motion in free for name in motion.names))
            count = f"{len(free)} freedom{'s are' if len(free) > 1 else ' is'}"
            raise IndeterminateError(
                f"mechanism {self.m.name!r}: {count} left free that {'are' if len(free) > 1 else 'is'} neither driven nor passive "
                f"(moving: {names}). Drive as many more, or change a pair",
                check(self.m),
            )

    @property
    def leading(self) -> Index:
        """The drivers that lead: independent ones; drivers that depend on them are checked to agree."""
        return self.columns[self.lead]

    def values(self, kind: str) -> Array:
        """Driver positions, velocities or accelerations ``(d, T)`` in internal units."""
        T = int(np.prod(self.batch))
        rows = [np.broadcast_to(getattr(motion, kind), self.batch).reshape(T) for motion in self.motions.values()]
        return np.array(rows).reshape(len(rows), T) / self.unit[:, None]

    @cached_property
    def _driver_rates(self) -> tuple[Array, Array]:
        """Driver velocities and accelerations ``(d, T)`` in internal units."""
        return self.values("velocity"), self.values("acceleration")

    def given(self) -> Given:
        """What the motions of the drivers say."""
        rows = (self.values(kind) for kind in ("position", "velocity", "acceleration"))
        return Given(self.batch, self.t, *rows)

    def positions(self) -> Positions:
        """All positions, followed along the last batch axis."""
        cases = int(np.prod(self.batch[:-1]))
        path = self.values("position")[self.lead].reshape(len(self.lead), cases, self_length(self.batch))
        return Follower(self.system, self.leading, self.freedoms.hold).follow(self.x, path)

    def evaluated(self, x: Array, at: Index) -> Configuration:
        """States ``x (nx, T)`` evaluated, which stand at the places ``at`` of the flat batch."""
        return self.system.at(x)

    def case(self, c: int) -> tuple[System, Array]:
        """System and start ``(nx,)`` of one case of the batch."""
        return self.system, self.x

    def move(self) -> tuple[Motions, ChosenSystem, Positions]:
        """Positions and rates, all in one piece."""
        found = self.found()
        status, good = self.outcomes(found)
        here = found.here[0] if len(found.here) == 1 and good.size == status.size else None
        part = self._rates(found, here, good, status)
        motions = dataclasses.replace(part.motions, batch=self.batch, good=part.places, status=status)
        return motions, part.solver, found

    def blocks(self, found: Positions, status: Any, good: Index) -> Iterator[Part]:
        """Positions and rates at the places ``good``, block by block; at least one block, those without a regular position left out."""
        pieces: list[tuple[Index, Configuration | None]] = [(places, None) for places in in_blocks(good)]
        if found.here and good.size == status.size:
            at = np.cumsum([0, *(here.T for here in found.here)])
            pieces = [(good[i:j], here) for (i, j), here in zip(pairwise(at), found.here, strict=True)]
        regular = False
        for places, here in pieces:
            part = self._rates(found, here, places, status)
            if part.places.size:
                regular = True
                yield part
        if not regular:
            yield part

    def found(self) -> Positions:
        """All positions, passive bodies not spinning."""
        found = self.positions()
        return self._without_spin(found, self.freedoms.bodies) if self.freedoms.bodies else found

    def outcomes(self, found: Positions) -> tuple[Any, Index]:
        """Statuses of all positions as text, and the flat places of those that were solved."""
        good = np.asarray(found.status.reshape(-1) == Status.OK, dtype=bool)
        status = np.full(good.size, Status.OK.value, dtype="U24")
        status[~good] = [s.value for s in found.status.reshape(-1)[~good]]
        return status.reshape(self.batch), np.flatnonzero(good)

    def _rates(self, found: Positions, here: Configuration | None, good: Index, status: Any) -> Part:
        """Rates at the positions ``good`` of the flat batch; those that are no regular ones are marked in ``status``."""
        bodies = self.freedoms.bodies
        here = here or self.evaluated(found.x.reshape(self.system.n_state, status.size)[:, good], good)
        choices, which, solver = self._well_chosen(here, found.choices, found.which.reshape(-1)[good])
        open_ = here.closure > CLOSED
        if open_.any():
            status.reshape(-1)[good[open_]] = Status.NOT_CLOSED.value
        dead = self._dead(here, solver, choices, which) | open_
        if dead.any():
            status.reshape(-1)[good[dead & ~open_]] = Status.DEAD_POINT.value
            good, which = good[~dead], which[~dead]
            here = here.part(np.flatnonzero(~dead))
            solver = closure_solver(here, choices, which)
        if bodies:
            choices, which, solver = held_well(here, choices, which, self.leading)
        velocity, acceleration = (values[:, good] for values in self._driver_rates)
        moved = rates(here, solver, self.leading, velocity[self.lead], acceleration[self.lead], bodies)
        if len(self.lead) < len(self.columns):
            moved.contradiction = self._disagreement(here, moved, good)
            solver = chosen_for_all(here.J, [], self.columns)
            choices, which = solver.choices, solver.which
        held = tuple(choice.held for choice in choices)
        tracks = () if bodies else found.tracks
        n = good.size
        flags = np.full(n, Status.OK.value, dtype="U24")
        motions = Motions(here, moved, (n,), np.arange(n), flags, self.t, self.columns, held, which, tracks)
        return Part(motions, solver, good)

    def _well_chosen(
        self, here: Configuration, choices: list[Choice], which: Index
    ) -> tuple[list[Choice], Index, ChosenSystem]:
        """The closure equations; in redundant loops with other independent rows where those of the path are nearly dependent."""
        solver = closure_solver(here, choices, which)
        rows = {len(choices[i].rows) for i in np.unique(which)}
        held = any(choices[i].held.size for i in np.unique(which))
        if held or rows == {here.J.shape[0]} or not (solver.condition > FAIR).any():
            return choices, which, solver
        poor = np.flatnonzero(solver.condition > FAIR)
        other = choose(here.J[:, :, int(poor[np.argmax(solver.condition[poor])])], self.leading)
        trial = ChosenSystem(here.J[:, :, poor], [other], np.zeros(poor.size, dtype=np.intp))
        better = poor[trial.condition < 0.2 * solver.condition[poor]]
        if rows != {len(other.rows)} or not better.size:
            return choices, which, solver
        choices, which = [*choices, other], which.copy()
        which[better] = len(choices) - 1
        return choices, which, closure_solver(here, choices, which)

    def _disagreement(self, here: Configuration, moved: Rates, good: Index) -> Array:
        """How far given positions and rates of dependent drivers are from those that the leading ones bring, ``(T,)``."""
        turns = self.values("position")[:, good] - here.x[state_rows(self.system, self.columns)]
        turns -= np.where(self.system.is_length[self.columns], 0.0, 2 * np.pi)[:, None] * np.round(turns / (2 * np.pi))
        out = np.abs(turns).max(axis=0, initial=0.0)
        for given, found in (("velocity", moved.dq), ("acceleration", moved.ddq)):
            asked = self.values(given)[:, good]
            size = np.abs(found).max(axis=0, initial=0.0) + np.abs(asked).max(axis=0, initial=0.0)
            gap = np.abs(found[self.columns] - asked).max(axis=0, initial=0.0)
            out = np.maximum(out, gap / np.where(size > 0, size, 1.0))
        return np.maximum(out, moved.contradiction)

    def _dead(
        self, here: Configuration, solver: ChosenSystem, choices: list[Choice], which: Index
    ) -> NDArray[np.bool_]:
        """Positions so near to a dead point that their rates would be noise."""
        dead = solver.condition > SINGULAR
        doubtful = np.flatnonzero((solver.condition > DOUBTFUL) & ~dead)
        if doubtful.size:
            few = here.part(doubtful)
            near = distance_to_dead_point(few, closure_solver(few, choices, which[doubtful]), self.leading)
            dead[doubtful] = np.logical_not(near > DEAD_POINT)
        return dead

    def _without_spin(self, found: Positions, bodies: tuple[Idle, ...]) -> Positions:
        """The same positions with passive bodies not spinning from the start to the first and from one to the next."""
        x = found.x.copy()
        for c in range(x.shape[1]):
            at = np.flatnonzero(found.status[c] == Status.OK)
            if at.size:
                system, start = self.case(c)
                path = np.concatenate([start[:, None], x[:, c, at]], axis=1)
                which = found.which[c, np.concatenate([at[:1], at])]
                x[:, c, at] = self._turned_back(system, path, found.choices, which, bodies)[:, 1:]
        return dataclasses.replace(found, x=x, here=())

    def _turned_back(
        self, system: System, x: Array, choices: list[Choice], which: Index, bodies: tuple[Idle, ...]
    ) -> Array:
        follower = Follower(system, self.leading)
        for _ in range(TURNS_BACK):
            here = system.at(x)
            follower.choices, which, solver = held_well(here, choices, which, self.leading)
            choices = follower.choices
            angles, unit = spin_angles(here, bodies, solver.null_of_columns())
            if np.abs(angles).max(initial=0.0) < 1e-9:
                break
            turned = system.advance(x, -np.einsum("fpt,pt->ft", unit, np.clip(angles, -LONGEST_TURN, LONGEST_TURN)))
            closed, shift = follower.closed_again(turned, which)
            if not (shift < LONGEST_TURN).all():
                break
            x = closed
        return x


def self_length(batch: tuple[int, ...]) -> int:
    """Number of positions of one case."""
    return batch[-1] if batch else 1
