"""Reactions with friction beside those without it, for any directions of motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import scipy

from mechgraph.force.friction import (
    Came,
    Place,
    Rubbed,
    answers,
    moving_rates,
    passed_on,
    places_of,
    reading,
    rubbed,
)
from mechgraph.force.reactions import (
    METHODS,
    ForceProblem,
    PairFrames,
    Stress,
    Wrenches,
    least_multiples,
    on_settled_flanks,
    on_their_flanks,
    pretensioned,
    row_efforts,
    together,
)
from mechgraph.force.redundant import (
    ForceTask,
    FreeForces,
    component_values,
    held_still,
    least_forces,
    least_on_flanks,
    openings,
    relieved,
    seats_of,
)
from mechgraph.kinematics.state import Configuration, FactoredClosure
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MOTIONS, STRESSES
from mechgraph.model.friction import Friction, pairs_of


def rubbed_in_motion(
    problem: ForceProblem, dry: Sequence[Friction], dq: Array, yields: Callable[[Array], Array]
) -> Rubbed:
    """Friction in a motion in the directions ``dq (F, T)`` whose accelerations it changes.

    ``problem`` is that without friction; ``yields`` gives the inertia wrenches ``(6, N, k, T)`` with which the links yield to efforts
    ``(F, k, T)``.
    """
    here, f = problem.here, problem.solver
    task = ForceTask("loop_wrench", (), problem.driven, (), (here.T,), None, "nan")
    first = pretensioned(here, METHODS[task.method](problem), f)
    lines = ContactLines(here)
    smooth = least_on_flanks(here, on_their_flanks(here, first, lines), f, task, lines)
    return FrictionProblem(here, task, f, first, lines, smooth, dry, yields).forces(dq)[1]


class FrictionProblem:
    """Reactions with friction beside those without it, ``smooth``, for any directions of motion, from total ``wrenches`` on the first
    flanks of teeth. ``yields``: the inertia wrenches with which links yield to efforts; where it is left out the motion is given.
    """

    def __init__(
        self,
        here: Configuration,
        task: ForceTask,
        f: FactoredClosure,
        wrenches: Wrenches,
        lines: ContactLines,
        smooth: tuple[FreeForces, Array],
        dry: Sequence[Friction],
        yields: Callable[[Array], Array] | None = None,
    ) -> None:
        self.yields = yields
        self.here, self.task, self.f, self.wrenches, self.lines, self.dry = here, task, f, wrenches, lines, dry
        self.found, self.flank = self.smooth = smooth
        # which components have lifted off, of those that only push under a split by stiffness
        push = seats_of(here.system).push
        self.push = push if push.any() and self.found.locked is not None else None
        self.lifted: Mask | None = None if self.push is None else np.zeros((len(push), here.T), dtype=bool)
        self._answer_units()

    def _answer_units(self) -> None:
        """Forces under a unit effort in every freedom of pairs through which friction would pass."""
        s, still = self.here.system, None
        pairs = dict.fromkeys(k for load in self.dry for k in pairs_of(s.m, load))
        columns = [c for k in pairs for c in range(int(s.first_column[k]), int(s.first_column[k + 1]))]
        efforts = np.zeros((s.n_freedoms, len(columns), self.here.T))
        efforts[columns, np.arange(len(columns))] = 1.0
        if self.yields is not None and self.f.complete and not self.lines:
            self.unit = dict(zip(columns, self._answers(efforts, self.yields), strict=True))
            return
        if self.found.locked is not None:
            still = self._answer(np.zeros_like(self.found.efforts))
        self.unit = {}
        for i, column in enumerate(columns):
            one = self._answer(efforts[:, i])
            self.unit[column] = one if still is None else {name: one[name] - still[name] for name in one}

    def _answers(self, efforts: Array, yields: Callable[[Array], Array]) -> list[dict[str, Array]]:
        """Forces in a motion under each of several given efforts ``(F, k, T)``, by the factors of the positions."""
        reactions, through, multipliers = together(self.here, self.f, yields(efforts), efforts)
        stress, out = self.found.stress, []
        for i in range(efforts.shape[1]):
            found = reactions[:, :, i], through[:, i], multipliers[:, i]
            if stress.wrenches.shape[2]:
                y = least_multiples(self.here, *found, stress)
                states = stress.wrenches, stress.efforts, stress.multipliers
                found = tuple(
                    part + np.einsum("...st,st->...t", state, y) for part, state in zip(found, states, strict=True)
                )
            coupled = row_efforts(self.here, found[2][:, None])[:, 0]
            out.append(dict(zip(("reactions", "efforts", "multipliers", "coupled"), (*found, coupled), strict=True)))
        return out

    def _answer(self, efforts: Array) -> dict[str, Array]:
        """Forces under given efforts ``(F, T)`` alone."""
        here, none = self.here, np.zeros((6, len(self.here.system.m.links), self.here.T))
        held, _, _ = held_still(here, self.task, self.f, none, efforts, 0.0)
        loads = none if held is None else held
        loads = loads if self.yields is None else loads + self.yields(efforts[:, None])[:, :, 0]
        problem = ForceProblem(here, loads, efforts, self.task.driven, self.f)
        wrenches = pretensioned(here, METHODS[self.task.method](problem), self.f, part=0.0)
        one = self._least(wrenches, None if self.task.redundant == "elastic" else self.found.stress)
        return {name: getattr(one, name) for name in ("reactions", "efforts", "multipliers", "coupled")}

    def _least(self, wrenches: Wrenches, known: Stress | None = None) -> FreeForces:
        """The forces of total wrenches on the first flanks, on those that act; their self-stresses may be known."""
        here, lines, flank = self.here, self.lines, self.flank
        wrenches = relieved(on_settled_flanks(here, wrenches, lines), lines, flank) if lines else wrenches
        return least_forces(here, wrenches, self.f, self.task, lines, flank, known, self.lifted)

    def forces(self, dq: Array, at_rest: bool = False) -> tuple[FreeForces, Rubbed, Array]:
        """Forces with the friction of a motion, that friction, and the flanks ``(n, T)`` on which teeth then touch: friction may turn the
        force between them round, or lift what only pushes.
        """
        self._put_on(*self.smooth, None if self.lifted is None else np.zeros_like(self.lifted))
        # how often flanks and what has lifted off are changed
        for _ in range(5 if self.lifted is None else 5 + 2 * len(self.lifted)):
            found, rubs = self._on_flanks(dq, at_rest)
            turned, (lifted, moved) = self._turned(found, rubs), self._lifts(found)
            if not (turned | moved).any():
                break
            self._put_on(None, np.where(turned, found.multipliers, self.flank), lifted)
        if self.push is not None and not at_rest:
            self._try_sets(dq)
            found, rubs = self._on_flanks(dq)
            turned, moved = self._turned(found, rubs), self._lifts(found)[1]
        found = _undetermined(found, rubs, moved, Came.FEET)
        found = _undetermined(found, rubs, turned, Came.FLANKS)
        # forces that grow without bound between feet held in place may let them lift before: then it tips, and does not jam
        grows = np.isin(rubs.outcome, (Came.JAMS, Came.NO_FINITE_FORCE)) & (self.push is not None)
        rubs.outcome[grows], rubs.factor[grows] = Came.FEET, np.nan
        return found, rubs, self.flank

    def _turned(self, found: FreeForces, rubs: Rubbed) -> Mask:
        """Where ``(T,)`` teeth press on other flanks than those that forces were found on."""
        other = (found.multipliers < 0.0) != (self.flank < 0.0)
        return np.asarray(other.any(axis=0) & (rubs.outcome == 0) & bool(self.lines))

    def _lifts(self, found: FreeForces) -> tuple[Mask | None, Mask]:
        """What has lifted off beside forces, and where ``(T,)`` that is not what it was: what would pull lifts, what would sink in bears
        again.
        """
        if self.push is None or self.lifted is None:
            return None, np.zeros(self.here.T, dtype=bool)
        values, assumed = component_values(PairFrames(self.here), found.reactions), self.lifted
        assert found.all_stress is not None
        gaps = openings(self.here, found.reactions, found.all_stress.wrenches, assumed)
        # one at a time, as in an active set method: of several that would pull most bear again as soon as one has lifted
        pulls = _worst(np.where(self.push[:, None] & ~assumed, values, 0.0), np.abs(values))
        sinks = _worst(np.where(assumed, gaps, 0.0), np.abs(gaps)) & ~pulls.any(axis=0)
        return (assumed | pulls) & ~sinks, np.asarray((pulls | sinks).any(axis=0))

    def _try_sets(self, dq: Array) -> None:
        """Put on another set of what has lifted off where forces were not found and some set, of few, stands: each lifted foot changes the
        friction of the others, so that one at a time does not always lead there.
        """
        if self.push is None or self.lifted is None or self.push.sum() > 6:
            return

        def fails() -> Mask:
            found, rubs = self._on_flanks(dq)
            unborne = False if found.unborne is None else found.unborne
            return (rubs.outcome > 0) | self._lifts(found)[1] | self._turned(found, rubs) | unborne

        left, settled, feet = fails(), self.lifted, np.flatnonzero(self.push)
        for each in sorted(product((False, True), repeat=len(feet)), key=sum):
            if not left.any():
                break
            trial = settled.copy()
            trial[np.ix_(feet, left)] = np.array(each)[:, None]
            self._put_on(None, self.flank, trial)
            stands = left & ~fails()
            settled, left = np.where(stands, trial, settled), left & ~stands
        self._put_on(None, self.flank, settled)

    def _put_on(self, found: FreeForces | None, flank: Array, lifted: Mask | None) -> None:
        """Take forces without friction, and those of unit efforts, on flanks of signs ``(n, T)``, without what has lifted off."""
        same = ((flank < 0.0) == (self.flank < 0.0)).all() and (lifted is None or (lifted == self.lifted).all())
        self.flank, self.lifted = flank, lifted
        if not same:
            self.lines.settle(flank)
            self.found = self._least(self.wrenches) if found is None else found
            self._answer_units()

    def _on_flanks(self, dq: Array, at_rest: bool = False) -> tuple[FreeForces, Rubbed]:
        """Forces with the friction of a motion with rates ``dq (F, T)``, and what that is; NaN where it has no solution, or none alone."""
        found, of = self.found, {column: self._read(one) for column, one in self.unit.items()}
        base, stress = self._read(vars(found)), self._read({"reactions": found.stress.wrenches, **vars(found.stress)})
        unknown = stress[:, :, :0] if self.task.redundant == "minimum_norm" else stress
        reactions = found.reactions
        # sides of balls and centers of pressure settle in a few rounds; what does not is not determined
        for _ in range(50):
            places = places_of(self.here, dq, reactions, self.dry, at_rest, (self.lines, self.flank))
            rubs = rubbed(self.here, places, base, of)
            sums = {
                name: getattr(found, name) + sum(one[name] * rubs.efforts[c] for c, one in self.unit.items())
                for name in ("reactions", "efforts", "multipliers", "coupled")
            }
            sums["reactions"] = sums["reactions"] - rubs.taken
            before, reactions = reactions, np.where(np.isnan(sums["reactions"]), reactions, sums["reactions"])
            moved = np.abs(reactions - before).max(axis=(0, 1))
            size = np.abs(reactions).max(axis=(0, 1))
            if not (any(place.follows for place in places) and (moved > STRESSES.rounding * size).any()):
                break
        follows = np.array([[place.follows] for place in places])
        doubtful = (moved > MOTIONS.still * size) & follows.any()
        loose = np.array([self._is_loose(place, unknown, self._read(sums), size) for place in places])
        known = _undetermined(replace(found, **sums), rubs, np.asarray(loose.any(axis=0)), Came.NOT_UNIQUE, loose)
        return _undetermined(known, rubs, doubtful, Came.UNSETTLED, follows), rubs

    def _is_loose(self, place: Place, stress: Array, forces: Array, size: Array) -> Mask:
        """Where ``(T,)`` a place rubs under components that a ``stress (6, P, s, T)`` may change and to which loads add: components that
        are zero along it stay so, the least friction, no force locked in.
        """
        here, P, A = self.here, len(self.here.system.m.pairs), place.A
        if not stress.shape[2]:
            return np.zeros(here.T, dtype=bool)
        reading = np.einsum("dct,cst->dst", A, stress[:, place.reads])
        along = np.einsum("dst,dct,ct->st", reading, A, forces[:, place.reads])
        if not place.between_teeth(P):
            group, i = here.system.place_of(place.reads)
            part = (np.einsum("dct,cjt->djt", A, here.W[group][:, :, i]) ** 2).sum(axis=0)
            loose, value = (PairFrames(here).components_of(group, i, of[:, place.reads]) for of in (stress, forces))
            along = np.einsum("jst,jt,jt->st", loose, part, value)
        most = np.sqrt((reading**2).sum(axis=(0, 1)))
        acts = place.D.any(axis=0) | place.K.any(axis=(0, 1))
        return np.asarray(
            acts & (most > STRESSES.unique) & (np.abs(along).max(axis=0, initial=0.0) > STRESSES.unique * most * size)
        )

    def _read(self, forces: Mapping[str, Array]) -> Array:
        """The wrenches that normal forces are read from: reactions, and behind them forces between teeth."""
        return np.concatenate([forces["reactions"], self.lines.on_gears(forces["multipliers"], self.flank)], axis=1)

    def at_rest(self, dq: Array, given: Array) -> tuple[Array, Array, Array]:
        """Efforts of drives ``(F, 2, T)`` on the verge of motion to - and to +, the others held; infinite where it jams, NaN in motion and
        where friction is not determined there: ``why (T,)``, with the ``growth (m, T)`` of the places, as in ``Rubbed``.

        Where what only pushes would pull on the verge, or be pressed without bound, it tips or lifts before: see ``AtRest.greatest``.
        """
        out, rest = np.full((len(dq), 2, self.here.T), np.nan), ~dq.any(axis=0)
        why, growth = np.zeros(self.here.T, dtype=int), np.zeros((1, self.here.T))
        if not rest.any():
            return out, why, growth
        jams = Came.JAMS, Came.NO_FINITE_FORCE
        moved, push = self.f.sensitivity(), seats_of(self.here.system).push
        for (j, column), (side, sense) in product(enumerate(self.task.driven), enumerate((-1.0, 1.0))):
            rates = sense * moving_rates(moved[:, j])
            found, rubs, _ = self.forces(rates, at_rest=True)
            effort = np.where(np.isin(rubs.outcome, jams), sense * np.inf, self._efforts(found, rubs, given)[column])
            stands = self._presses(found, rubs) >= -STRESSES.rounding
            tips = rest & push.any() & ~stands & np.isin(rubs.outcome, (Came.OK, *jams, Came.FEET))
            if tips.any():
                effort = np.where(tips, self._tipping(rates, tips, given, j, sense), effort)
            open_ = rest & (rubs.outcome > Came.NO_FINITE_FORCE) & ~tips
            why, growth = np.where(open_, rubs.outcome, why), np.where(open_, rubs.growth, growth)
            out[column, side, rest] = effort[rest]
        return out, why, growth

    def _efforts(self, found: FreeForces, rubs: Rubbed, given: Array) -> Array:
        """Efforts ``(F, T)`` of drives alone."""
        return np.asarray(found.efforts - given - rubs.efforts - found.coupled)

    def _presses(self, found: FreeForces, rubs: Rubbed) -> Array:
        """The least force ``(T,)`` of what only pushes beside the largest, below zero where it would pull; NaN where none are found."""
        values = component_values(PairFrames(self.here), found.reactions)
        bears = seats_of(self.here.system).push[:, None] & ~(False if self.lifted is None else self.lifted)
        least = np.where(bears, values, np.inf).min(axis=0, initial=np.inf) / np.abs(values).max(
            axis=0, initial=STRESSES.rounding
        )
        lost = (rubs.outcome > 0) | (False if found.unborne is None else found.unborne)
        return np.where(lost, np.nan, np.minimum(least, 1.0))

    def _tipping(self, dq: Array, at: Mask, given: Array, drive: int, sense: float) -> Array:
        """Effort ``(T,)`` of a drive, by its place among the driven, with which it tips at positions ``at``: see ``AtRest.greatest``."""
        found = self.found
        places = places_of(self.here, dq, found.reactions, self.dry, True, (self.lines, self.flank))
        held = self._held(list(enumerate(places)), given, found.all_stress or found.stress)
        return held.greatest(np.flatnonzero(at), drive, sense)

    def holds(self, dq: Array, given: Array) -> Array:
        """Whether friction holds it at rest with all drives off, where there are several ``(T,)``: see ``AtRest.alone``."""
        driven, m, s = self.task.driven, self.here.system.m, self.here.system
        out = np.full(self.here.T, np.nan)
        if len(driven) < 2 or dq.any(axis=0).all():
            return out
        self._put_on(*self.smooth, self.lifted)
        found, ways, count = self.found, [], 0
        for load in self.dry:
            columns = [c for k in pairs_of(m, load) for c in range(int(s.first_column[k]), int(s.first_column[k + 1]))]
            for sense, column in product((-1.0, 1.0), columns):
                one = np.zeros_like(dq)
                one[column] = sense
                places = places_of(self.here, one, found.reactions, [load], True, (self.lines, self.flank))
                ways += [(count + i, place) for i, place in enumerate(places) if place.D.any() or place.K.any()]
            count += len(places)
        if not ways:
            return np.where(dq.any(axis=0), np.nan, 0.0)
        out = self._held(ways, given).alone()
        return np.where(dq.any(axis=0), np.nan, out)

    def _held(self, ways: Sequence[tuple[int, Place]], given: Array, stress: Stress | None = None) -> AtRest:
        """What frictions may do at rest; beside all multiples of a ``stress`` if one is given, and then under what only pushes."""
        found, unit = self.found, np.eye(len(given))[..., None]
        units = {c: self._with_drives(one, unit[c]) for c, one in self.unit.items()}
        free = self._with_drives(vars(found), given)
        states = [free[:, :, None], *answers(passed_on(self.here, [place for _, place in ways]), free, units)]
        if stress is not None:
            coupled = row_efforts(self.here, stress.multipliers)
            states.append(self._with_drives({"reactions": stress.wrenches, "coupled": coupled, **vars(stress)}, 0.0))
        return AtRest(self.here, ways, states, len(self.task.driven))

    def _with_drives(self, forces: Mapping[str, Array], given: Array | float) -> Array:
        """See ``_read``; behind it the efforts of drives, as the first of six numbers."""
        own = np.asarray(forces["efforts"] - given - forces["coupled"])[self.task.driven]
        return np.concatenate([self._read(forces), [own, *np.zeros((5, *own.shape))]], axis=1)


class AtRest:
    """What may hold a mechanism at rest: of every place, by number, the frictions of the ``ways`` in which it rubs in motions of its pair,
    in parts ``g >= 0`` with ``sum g <= |V|``, and multiples of self-stresses under which what only pushes does not pull.

    With the direction u of V from the last trial ``u . V`` is below ``|V|``, and linear. ``states (6, P, n, T)``: pairs, teeth and
    ``drives`` without friction, under those of unit size, under unit normal vectors, and self-stresses if these are free.
    """

    def __init__(
        self, here: Configuration, ways: Sequence[tuple[int, Place]], states: list[Array], drives: int
    ) -> None:
        self.of, self.places = np.array([number for number, _ in ways]), [place for _, place in ways]
        self.first = np.array([int(np.argmax(self.of == number)) for number in range(self.of.max(initial=-1) + 1)])
        self.sums = (self.of == np.arange(len(self.first))[:, None]).astype(float)
        self.preload = np.array([np.broadcast_to(self.places[o].preload, here.T) for o in self.first])
        ends = np.cumsum([0, *(len(place.A) for place in self.places)])
        self.cuts = [slice(*ends[o : o + 2]) for o in range(len(ways))]
        self.V, self.own = [reading(self.places, each) for each in states], [each[0, -drives:] for each in states]
        seats, frames, P = seats_of(here.system), PairFrames(here), len(here.system.m.pairs)
        push = seats.push & (len(states) > 3)
        self.push = [component_values(frames, each[:, :P])[push] for each in states]
        # what only pushes presses one way, known before any trial
        self.pressing: dict[int, Array] = {}
        by = dict(seats.labels[i].rsplit(".", 1) for i in np.flatnonzero(push))
        for p, place in ((p, self.places[o]) for p, o in enumerate(self.first) if self.places[o].of in by):
            group, member = here.system.place_of(place.reads)
            j = here.system.groups[group].row.component_names.index(by[place.of])
            self.pressing[p] = np.einsum("dct,ct->dt", place.A, here.W[group][:, j, member])

    def _rows(self, parts: list[Array], u: list[Array], t: int) -> tuple[Array, Array]:
        """A constant ``(n,)`` and what parts and multiples add to it, with directions ``u`` of normal vectors."""
        one, D, K, *more = (each[..., t] for each in parts)
        along = [K[:, cut] @ u[o] for cut, o in zip(self.cuts, self.of, strict=True)]
        return one[:, 0], np.hstack([D + np.array(along).T, *more])

    def _trial(self, V: Array, t: int) -> tuple[list[Array], tuple[Array, Array], Array, Array]:
        """Directions of normal vectors ``V (d,)``, these by parts and multiples x, and ``A x <= b`` of those that are allowed."""
        each = [self.pressing[p][:, t] if p in self.pressing else V[self.cuts[o]] for p, o in enumerate(self.first)]
        u = [v / max(float(np.linalg.norm(v)), np.finfo(float).tiny) for v in each]
        one, per = self._rows(self.V, u, t)
        along, limit = (
            np.array([v @ all_[self.cuts[o]] for v, o in zip(u, self.first, strict=True)]) for all_ in (per, one)
        )
        sums = np.pad(self.sums, ((0, 0), (0, per.shape[1] - len(self.of))))
        return u, (one, per), sums - along, limit + self.preload[:, t]

    def greatest(self, at: Index, drive: int, sense: float) -> Array:
        """The greatest effort ``(T,)`` of a drive, with its ``sense``, at positions ``at``: a linear program for each direction of V (limit
        analysis). Infinite where no effort is too much, NaN where nothing holds it.
        """
        out = np.full(self.preload.shape[1], np.nan)
        for t in at:
            V, best = self.V[0][:, 0, t], -np.inf
            for _ in range(8):
                u, (one, per), A, b = self._trial(V, t)
                (force, pushes), (own, rates) = self._rows(self.push, u, t), self._rows(self.own, u, t)
                limits = np.concatenate([b, force])
                size = max(float(np.abs(limits).max()), np.finfo(float).tiny)
                bounds = [(0.0, None)] * len(self.of) + [(None, None)] * (per.shape[1] - len(self.of))
                # presolve would not tell what is unbounded, and jams, from what has no solution
                found: Any = scipy.optimize.linprog(
                    -sense * rates[drive],
                    np.vstack([A, -pushes]),
                    limits / size,
                    bounds=bounds,
                    options={"presolve": False},
                )
                if found.status:
                    best = np.inf if found.status == 3 else best
                    break
                x, before = found.x * size, best
                effort = sense * (own[drive] + rates[drive] @ x)
                V, best = one + per @ x, max(effort, best)
                if effort - before <= STRESSES.rounding * size:
                    break
            out[t] = np.nan if best == -np.inf else sense * best
        return out

    def alone(self) -> Array:
        """Where some friction holds it though its drives supply nothing: 1 where it is found, 0 where none can be, NaN where neither is
        proved, ``(T,)``. With what is above ``|V|``, ``|a| + sum |B| g``, too: found, or none there, by least squares under signs (Farkas).
        """
        # of what may slide in k independent ways frictions in these alone span a part 1 / sqrt(k) of all
        span = np.sqrt(np.maximum(self.sums.sum(axis=1) / 2, 1.0))
        out = np.full(self.preload.shape[1], np.nan)
        for t in range(len(out)):
            V = self.V[0][:, 0, t]
            for trial in range(8):
                u, (one, per), A, b = self._trial(V, t)
                own, rates = self._rows(self.own, u, t)
                g, met = _mixed(rates, own, A, b)
                if met:
                    out[t] = 1.0
                    break
                V = one + per @ g
                if trial == 0:
                    above = np.array([np.linalg.norm(per[self.cuts[o]], axis=0) for o in self.first])
                    size = np.array([np.linalg.norm(one[self.cuts[o]]) for o in self.first]) + self.preload[:, t]
                    if not _mixed(rates, own, self.sums / span[:, None] - above, size)[1]:
                        out[t] = 0.0
                        break
        return out


def _mixed(rates: Array, own: Array, sums: Array, limit: Array) -> tuple[Array, bool]:
    """Parts ``g >= 0`` with ``rates g + own = 0`` and ``sums g <= limit`` as nearly as there are, and whether these are."""
    size = max(float(np.abs(own).max(initial=0.0)), np.finfo(float).tiny), max(float(limit.max(initial=0.0)), 1e-300)
    A = np.block([[rates / size[0], np.zeros((len(own), len(limit)))], [sums / size[1], np.eye(len(limit)) / size[1]]])
    found, missed = scipy.optimize.nnls(A, np.concatenate([-own / size[0], limit / size[1]]))
    return found[: rates.shape[1]], bool(missed <= STRESSES.unique)


def _worst(values: Array, sizes: Array) -> Mask:
    """The least of values ``(K, T)`` at every position, where it is negative beside the largest of their sizes."""
    least = np.arange(len(values))[:, None] == values.argmin(axis=0)
    return np.asarray(least & (values < -STRESSES.rounding * sizes.max(axis=0)))


def _undetermined(found: FreeForces, rubs: Rubbed, places: Mask, why: Came, of: Mask | bool = True) -> FreeForces:
    """The same with no value where friction has no solution, or is not determined, as at some more ``places``, by the rubbing places
    ``of (m, T)`` which it is.
    """
    more = places & (rubs.outcome == 0)
    rubs.outcome[more] = why
    rubs.growth[:, more] = np.broadcast_to(of, rubs.growth.shape)[:, more]
    for values in (rubs.efforts, rubs.taken, rubs.normals, rubs.teeth, rubs.beside, rubs.rubbing):
        values[..., places] = np.nan
    places = rubs.outcome > 0
    parts = (
        np.where(places, np.nan, part) for part in (found.reactions, found.efforts, found.multipliers, found.coupled)
    )
    reactions, efforts, multipliers, coupled = parts
    return replace(found, reactions=reactions, efforts=efforts, multipliers=multipliers, coupled=coupled)
