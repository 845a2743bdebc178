"""Forces over a block of positions, and the efforts that hold passive freedoms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import scipy

from mechgraph.errors import DeclarationError
from mechgraph.force.elastic import LIFTS_OFF, component_values, elastic_split, openings, seats_of
from mechgraph.force.friction import OUTCOMES, Rubbed, moving_rates, places_of, rests, rubbed
from mechgraph.force.loads import Site, inertia_wrenches, kinetic_power
from mechgraph.force.reactions import (
    METHODS,
    STRAIN,
    ForceProblem,
    PairFrames,
    Stress,
    Wrenches,
    at_pair_points,
    effort_map,
    least_multiples,
    least_under_signs,
    on_settled_flanks,
    on_their_flanks,
    orthonormal_stress,
    pair_power,
    pretensioned,
    reaction_map,
    reaction_part,
    row_efforts,
    split_stress,
    together,
)
from mechgraph.kinematics.rates import PassiveMotion, PassiveMotions, Rates, Velocities
from mechgraph.kinematics.state import Configuration, FactoredClosure
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.linear import add_at
from mechgraph.maths.se3 import Array, Index, Mask, cross, rotate_back
from mechgraph.maths.tolerances import MOTIONS, STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.friction import Friction, pairs_of, rubbing_loads
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism

FORCE_OUTCOMES = (*OUTCOMES, LIFTS_OFF)
"""What becomes of the forces at a position, by number."""


def is_idle(size: Array, terms: Array) -> bool:
    """Whether no effort is needed at any of the positions; those that were not solved are NaN."""
    return bool(np.nanmax(np.abs(size), initial=0.0) <= MOTIONS.idle * np.nanmax(terms, initial=0.0))


def hold_names(m: Mechanism, passive: Iterable[PassiveMotion]) -> list[str]:
    """For every passive motion the names of its links; numbered where the same links have several."""
    links = m.link_names()
    names = [" and ".join(links[i] for i in motion.links) for motion in passive]
    return [f"{name} ({n + 1})" if (n := names[:i].count(name)) else name for i, name in enumerate(names)]


def hold(
    here: Configuration, passive: tuple[PassiveMotion, ...], Z: Array, loads: Array, efforts: Array, largest: float
) -> tuple[Array, Array, Array]:
    """What keeps passive bodies at rest: wrenches ``(6, N, T)`` on them, the effort ``(p, T)`` of every passive motion, and its terms.

    Along every passive motion the power of loads, given efforts and hold vanishes. ``Z (F, p, T)`` spans the motions at each position. The
    hold of a turn is a couple about its axis, that of a slide a force along it, so that it loads no pair of the body; it comes from
    outside the mechanism. The terms ``(p, T)`` are the sizes of what adds up to an effort, with the ``largest`` single load: by them
    rounding is told from load.
    """
    at = PassiveMotions(here, passive, Z)
    of_loads = loads[:, at.links]
    power = np.einsum("cnt,cnpt->pt", of_loads, at.twists) + np.einsum("ft,fpt->pt", efforts, at.rates)
    held = -at.dual(power)
    wrenches = np.zeros_like(loads)
    wrenches[3:, at.links] = held[3:]
    wrenches[:3, at.links] = held[:3] + cross(at.points, held[3:])
    sizes, terms = np.empty(power.shape), np.empty(power.shape)
    for i, motion in enumerate(passive):
        twist, rates = at.twists[:, :, i], at.rates[:, i]
        body = twist[:, at.links.index(motion.links[0])]
        axis = body[:3] if motion.turns else body[3:]
        length = np.maximum(np.sqrt((axis * axis).sum(axis=0)), 1e-300)
        sense = _sense(rotate_back(here.poses[:, :3, motion.links[0]], axis))
        sizes[i] = -power[i] * sense / length
        terms[i] = largest + (np.abs(of_loads * twist).sum(axis=(0, 1)) + np.abs(efforts * rates).sum(axis=0)) / length
    return wrenches, sizes, terms


def _sense(axis: Array) -> Array:
    """Signs ``(T,)`` that make the first component of note of body-fixed axes ``(3, T)`` positive: the same wherever the body stands."""
    size = np.abs(axis)
    first = np.argmax(size > 0.1 * size.max(axis=0), axis=0)
    return np.where(np.take_along_axis(axis, first[None], axis=0)[0] < 0, -1.0, 1.0)


def hold_at_rest(
    here: Configuration, coordinates: Array, loads: Iterable[Load], passive: tuple[PassiveMotion, ...]
) -> tuple[Array, Array] | None:
    """Efforts ``(p, 1)`` of the passive motions at one position at rest under loads, and their terms.

    ``coordinates (F, 1)`` are the user's. None where a load has no value there, since it varies over the positions of a solution.
    """
    F, p = len(coordinates), len(passive)
    still = Rates(Velocities(here, np.zeros((F, 1))), np.zeros((F, 1)), np.zeros(1))
    site = Site(here, still, coordinates, (), np.zeros(1, dtype=np.intp), None)
    try:
        site.collect(tuple(loads))
    except DeclarationError:
        return None
    Z = np.stack([motion.rates for motion in passive], axis=1)
    return hold(here, passive, Z.reshape(F, p, 1), site.applied(), site.scaled_efforts(), site.largest)[1:]


@dataclass(frozen=True)
class BlockForces:
    """Forces at the positions of a block, internal units about the internal origin.

    ``reactions (6, P, T)`` and all ``efforts (F, T)`` (of least norm where redundant), ``given (F, T)`` efforts of loads, ``loads
    (6, N, T)`` inertia, applied wrenches and what holds passive bodies (``hold (6, N, T)`` that alone, or None), self-stresses
    ``stress (6, P, s, T)`` with ``stress_efforts (F, s, T)``, ``coupled (F, T)`` efforts of couplings, ``shaking (6, T)``;
    ``balance (T,)`` and ``power (T,)`` the residuals of equilibrium and power, ``largest`` the largest term of each; ``holds`` and
    ``hold_terms (p, T)`` of the passive motions. ``multipliers (n, T)`` of the closure rows behind those of
    the loops with ``multiplier_stress (n, s, T)``, of which ``coupled_stress (F, s, T)`` are the efforts in freedoms.
    Where stiffness splits reactions: those that misfits lock in ``locked (6, P, T)``, and those of a misfit of one in every component
    that is not rigid ``of_misfit (6, P, k, T)``. With friction: what came about, ``rubs``, and at rest the least and greatest efforts
    between which drives may be ``range (F, 2, T)``, and whether it ``holds_alone (T,)`` with several of them off;
    ``unborne (T,)`` where feet that only push cannot bear the loads.
    """

    reactions: Array
    efforts: Array
    given: Array
    loads: Array
    hold: Array | None
    stress: Array
    stress_efforts: Array
    coupled: Array
    multipliers: Array
    multiplier_stress: Array
    coupled_stress: Array
    shaking: Array
    balance: Array
    power: Array
    largest: tuple[float, float]
    holds: Array
    hold_terms: Array
    locked: Array | None = None
    of_misfit: Array | None = None
    rubs: Rubbed | None = None
    range: Array | None = None
    holds_alone: Array | None = None
    unborne: Mask | None = None

    @property
    def outcome(self) -> Array:
        """What became of every position ``(T,)``, by its number in ``FORCE_OUTCOMES``."""
        came = np.zeros(self.power.shape, int) if self.rubs is None else self.rubs.outcome
        return came if self.unborne is None else np.where(self.unborne, FORCE_OUTCOMES.index(LIFTS_OFF), came)


@dataclass(frozen=True)
class ForceTask:
    """The task for every block: force ``method``, ``loads``, ``driven`` freedoms, ``passive`` motions; ``batch`` and times ``t``."""

    method: str
    loads: tuple[Load, ...]
    driven: Index
    passive: tuple[PassiveMotion, ...]
    batch: tuple[int, ...]
    t: object
    redundant: str
    idle: Index | None = None
    """Fixed freedoms, by their places, whose unit rates are the passive motions; None where these are the motions left free."""


def forces_of_block(
    task: ForceTask, rates: Rates, f: FactoredClosure, coordinates: Array, places: Index, rubs: Rubbed | None = None
) -> BlockForces:
    """Forces at positions with user coordinates ``(F, T)`` that stand at the ``places`` of the flat batch.

    ``rubs``: the friction, where it is known.
    """
    here = rates.here
    site = Site(here, rates, coordinates, task.batch, places, task.t)
    site.solves_friction = True
    site.collect(task.loads)
    given, applied, inertia = site.scaled_efforts(), site.applied(), inertia_wrenches(here, rates)
    loads = applied + inertia
    if rubs is not None:
        given = given + rubs.efforts
    held, holds, hold_terms = _held(here, task, f, applied + inertia, given, site.largest)
    loads = applied + inertia if held is None else applied + inertia + held
    first = pretensioned(here, METHODS[task.method](ForceProblem(here, loads, given, task.driven, f)), f)
    lines = ContactLines(here)
    found, flank = _least_on_flanks(here, on_their_flanks(here, first, lines), f, task, lines)
    dry = [load.with_numbers(site.number) for load in rubbing_loads(here.system.m, task.loads)]
    ranges: Array | None = None
    holds_alone: Array | None = None
    if rubs is not None:
        found = replace(found, reactions=found.reactions - rubs.taken)
    elif dry:
        dq = moving_rates(rates.dq, rates.ddq)
        solve = _FrictionProblem(here, task, f, first, lines, (found, flank), dry)
        ranges, holds_alone = solve.at_rest(dq, given), solve.holds(dq, given)
        found, rubs, flank = solve.forces(dq)
        held, holds, hold_terms = _held(here, task, f, applied + inertia, given + rubs.efforts, site.largest)
        loads = loads if held is None else applied + inertia + held
        given = given + rubs.efforts
    if rubs is not None:
        given = given - rubs.teeth
        found = replace(found, coupled=found.coupled + rubs.teeth)
    own = np.zeros_like(found.efforts)
    own[task.driven] = (found.efforts - given - found.coupled)[task.driven]
    if ranges is not None:
        ranges = np.where(dq.any(axis=0), own[:, None], ranges)
    acting = own + given + found.coupled
    totals = here.pair_sums(here.E * acting) + found.reactions
    if lines:
        totals = totals + lines.relief(found.multipliers, flank)
    if rubs is not None:
        totals = totals + rubs.taken
    parts = (own, given, found.coupled)
    balance, wrench = _balance(here, found.reactions, totals, loads, (applied, inertia, held, *parts))
    power, term = _power(rates, totals, applied if held is None else applied + held, parts, inertia)
    return BlockForces(
        found.reactions,
        found.efforts,
        given,
        loads,
        held,
        found.stress.wrenches,
        found.stress.efforts,
        found.coupled,
        found.multipliers,
        found.stress.multipliers,
        row_efforts(here, found.stress.multipliers),
        loads.sum(axis=1),  # what links exert on each other cancels
        balance,
        power,
        (wrench, term),
        holds,
        hold_terms,
        found.locked,
        found.of_misfit,
        rubs=rubs,
        range=ranges,
        unborne=found.unborne,
        holds_alone=holds_alone,
    )


def _held(
    here: Configuration, task: ForceTask, f: FactoredClosure, loads: Array, efforts: Array, largest: float
) -> tuple[Array | None, Array, Array]:
    """What keeps the passive bodies of a task at rest (see ``hold``); None where it has none."""
    if not task.passive:
        return None, np.zeros((0, here.T)), np.zeros((0, here.T))
    passive = f.motions() if task.idle is None else f.sensitivity()[:, task.idle]
    return hold(here, task.passive, passive, loads, efforts, largest)


@dataclass(frozen=True)
class _FreeForces:
    """Reactions and efforts, of least norm where redundant, with the self-stresses; see ``BlockForces``."""

    reactions: Array
    efforts: Array
    stress: Stress
    multipliers: Array
    coupled: Array
    locked: Array | None = None
    of_misfit: Array | None = None
    unborne: Mask | None = None
    all_stress: Array | None = None
    """All self-stresses ``(6, P, s, T)`` of which stiffness decides."""


def _least_on_flanks(
    here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask, lines: ContactLines
) -> tuple[_FreeForces, Array]:
    """See ``_least``; with the signs of the multipliers ``(n, T)`` that tell on which flanks gears touch each other.

    Where multipliers are not unique those of least norm may touch on other flanks than the first ones found: then once more on these, and
    where that does not settle under the condition that they keep the signs of their flanks (see ``force.reactions.least_under_signs``).
    """
    flank = wrenches.multipliers
    if not lines:
        return _least(here, wrenches, f, task, lines, flank), flank
    # how often flanks are changed in search of multipliers of least norm
    for _ in range(3):
        found = _least(here, _relieved(wrenches, lines, flank), f, task, lines, flank)
        moved = ((found.multipliers < 0.0) != (flank < 0.0)).any(axis=0)
        if not moved.any():
            return found, flank
        flank = np.where(moved, found.multipliers, flank)
    whole, flank = _kept_on_flanks(here, wrenches, f, task, flank, np.flatnonzero(moved))
    relieved = _relieved(whole, lines, flank)
    kept = _found(here, relieved.totals, relieved.multipliers, _stress(here, relieved, f, task))
    for name in ("reactions", "efforts", "multipliers", "coupled"):
        getattr(found, name)[..., moved] = getattr(kept, name)[..., moved]
    return replace(found, stress=kept.stress), flank


def _kept_on_flanks(
    here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask, flank: Array, at: Index
) -> tuple[Wrenches, Array]:
    """Total wrenches and multipliers of least norm at the positions ``at``, on their flanks; the other positions as they are."""
    totals, multipliers, flank = wrenches.totals.copy(), wrenches.multipliers.copy(), flank.copy()
    for t in at:
        one = np.array([t])
        alone = here.part(one)
        x = f.part(one, alone).self_stresses(every=True)
        change = -x[here.system.graph.loop_rows :]
        own = Wrenches(totals[..., one], alone.pair_wrenches(x), multipliers[:, one], change)
        own = pretensioned(alone, own, f.part(one, alone))
        y, flank[:, t] = least_under_signs(alone, own, ContactLines(alone), _acting(here, task))
        totals[..., t] += own.stress[..., 0] @ y
        multipliers[:, t] += own.multiplier_stress[..., 0] @ y
    return replace(wrenches, totals=totals, multipliers=multipliers), flank


def _relieved(wrenches: Wrenches, lines: ContactLines, flank: Array) -> Wrenches:
    """Total wrenches and self-stresses without what contacts on their flanks take off."""
    relief = [lines.relief(part, flank) for part in (wrenches.multipliers, wrenches.multiplier_stress)]
    return replace(wrenches, totals=wrenches.totals - relief[0], stress=wrenches.stress - relief[1])


def _least(
    here: Configuration,
    wrenches: Wrenches,
    f: FactoredClosure,
    task: ForceTask,
    lines: ContactLines,
    flank: Array,
    known: Stress | None = None,
    lifted: Mask | None = None,
) -> _FreeForces:
    """Reactions and efforts of least norm; where self-stresses are random ones only if that is asked for. They may be ``known``.

    ``lifted``: see ``elastic_split``; beside friction nothing is as long as it is left out.
    """
    totals, multipliers = wrenches.totals, wrenches.multipliers
    if task.redundant == "elastic" and not f.complete:
        every = f.self_stresses(every=True)
        others = -every[here.system.graph.loop_rows :]
        wrenches = replace(wrenches, stress=here.pair_wrenches(every), multiplier_stress=others)
    stress = known or _stress(here, wrenches, f, task)
    s = stress.wrenches.shape[2]
    if s and not f.complete and task.redundant == "minimum_norm":
        x = _least_multipliers(here, totals, multipliers, f, _acting(here, task), lines, flank)
        others = x[here.system.graph.loop_rows :]
        totals = totals + here.pair_wrenches(x[:, None])[:, :, 0]
        totals = totals + lines.relief(others, flank) if lines else totals
        multipliers = multipliers - others
    found = _found(here, totals, multipliers, stress)
    if s and task.redundant == "elastic":
        if lifted is None and any(load.follows_reactions for load in task.loads):
            lifted = np.zeros((len(seats_of(here.system).labels), here.T), dtype=bool)
        return _elastic(here, found, lifted)
    if not (s and f.complete):
        return found
    y = least_multiples(here, found.reactions, found.efforts, multipliers, stress)
    multipliers = multipliers + np.einsum("nit,it->nt", stress.multipliers, y)
    return _FreeForces(
        found.reactions + np.einsum("cpit,it->cpt", stress.wrenches, y),
        found.efforts + np.einsum("fit,it->ft", stress.efforts, y),
        stress,
        multipliers,
        row_efforts(here, multipliers[:, None])[:, 0],
    )


def _undetermined(found: _FreeForces, rubs: Rubbed, places: Mask) -> _FreeForces:
    """The same with no value where friction has no solution, or is not determined, as at some more ``places``."""
    rubs.outcome[places & (rubs.outcome == 0)] = OUTCOMES.index("friction not determined")
    for values in (rubs.efforts, rubs.taken, rubs.normals, rubs.teeth, rubs.beside, rubs.rubbing):
        values[..., places] = np.nan
    places = rubs.outcome > 0
    parts = (
        np.where(places, np.nan, part) for part in (found.reactions, found.efforts, found.multipliers, found.coupled)
    )
    reactions, efforts, multipliers, coupled = parts
    return replace(found, reactions=reactions, efforts=efforts, multipliers=multipliers, coupled=coupled)


def unique_reactions(problem: ForceProblem) -> Array:
    """Reactions ``(6, P, T)`` at the pair points, or impulses where loads and efforts are such; NaN where self-stresses may change them."""
    here, f = problem.here, problem.solver
    task = ForceTask("loop_wrench", (), problem.driven, (), (here.T,), None, "nan")
    lines = ContactLines(here)
    wrenches = on_their_flanks(here, METHODS[task.method](problem), lines)
    found, _ = _least_on_flanks(here, wrenches, f, task, lines)
    stress = np.abs(at_pair_points(here, found.stress.wrenches)).max(axis=2, initial=0.0)
    return np.where(stress > STRESSES.unique, np.nan, at_pair_points(here, found.reactions))


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
    smooth = _least_on_flanks(here, on_their_flanks(here, first, lines), f, task, lines)
    return _FrictionProblem(here, task, f, first, lines, smooth, dry, yields).forces(dq)[1]


class _FrictionProblem:
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
        smooth: tuple[_FreeForces, Array],
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
        held, _, _ = _held(here, self.task, self.f, none, efforts, 0.0)
        loads = none if held is None else held
        loads = loads if self.yields is None else loads + self.yields(efforts[:, None])[:, :, 0]
        problem = ForceProblem(here, loads, efforts, self.task.driven, self.f)
        wrenches = pretensioned(here, METHODS[self.task.method](problem), self.f, part=0.0)
        one = self._least(wrenches, None if self.task.redundant == "elastic" else self.found.stress)
        return {name: getattr(one, name) for name in ("reactions", "efforts", "multipliers", "coupled")}

    def _least(self, wrenches: Wrenches, known: Stress | None = None) -> _FreeForces:
        """The forces of total wrenches on the first flanks, on those that act; their self-stresses may be known."""
        here, lines, flank = self.here, self.lines, self.flank
        wrenches = _relieved(on_settled_flanks(here, wrenches, lines), lines, flank) if lines else wrenches
        return _least(here, wrenches, self.f, self.task, lines, flank, known, self.lifted)

    def forces(self, dq: Array, at_rest: bool = False) -> tuple[_FreeForces, Rubbed, Array]:
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
        if self.push is not None:
            self._try_sets(dq, at_rest)
            found, rubs = self._on_flanks(dq, at_rest)
            turned, moved = self._turned(found, rubs), self._lifts(found)[1]
        found = _undetermined(found, rubs, turned | moved)
        # forces that grow without bound between feet held in place may let them lift before: then it tips, and does not jam
        grows = (rubs.outcome > 0) & (self.push is not None)
        rubs.outcome[grows], rubs.factor[grows] = OUTCOMES.index("friction not determined"), np.nan
        return found, rubs, self.flank

    def _turned(self, found: _FreeForces, rubs: Rubbed) -> Mask:
        """Where ``(T,)`` teeth press on other flanks than those that forces were found on."""
        other = (found.multipliers < 0.0) != (self.flank < 0.0)
        return np.asarray(other.any(axis=0) & (rubs.outcome == 0) & bool(self.lines))

    def _lifts(self, found: _FreeForces) -> tuple[Mask | None, Mask]:
        """What has lifted off beside forces, and where ``(T,)`` that is not what it was: what would pull lifts, what would sink in bears
        again.
        """
        if self.push is None or self.lifted is None:
            return None, np.zeros(self.here.T, dtype=bool)
        values, assumed = component_values(PairFrames(self.here), found.reactions), self.lifted
        assert found.all_stress is not None
        gaps = openings(self.here, found.reactions, found.all_stress, assumed)
        # one at a time, as in an active set method: of several that would pull most bear again as soon as one has lifted
        pulls = _worst(np.where(self.push[:, None] & ~assumed, values, 0.0), np.abs(values))
        sinks = _worst(np.where(assumed, gaps, 0.0), np.abs(gaps)) & ~pulls.any(axis=0)
        return (assumed | pulls) & ~sinks, np.asarray((pulls | sinks).any(axis=0))

    def _try_sets(self, dq: Array, at_rest: bool) -> None:
        """Put on another set of what has lifted off where forces were not found and some set, of few, stands: each lifted foot changes the
        friction of the others, so that one at a time does not always lead there.
        """
        if self.push is None or self.lifted is None or self.push.sum() > 6:
            return

        def fails() -> Mask:
            found, rubs = self._on_flanks(dq, at_rest)
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

    def _put_on(self, found: _FreeForces | None, flank: Array, lifted: Mask | None) -> None:
        """Take forces without friction, and those of unit efforts, on flanks of signs ``(n, T)``, without what has lifted off."""
        same = ((flank < 0.0) == (self.flank < 0.0)).all() and (lifted is None or (lifted == self.lifted).all())
        self.flank, self.lifted = flank, lifted
        if not same:
            self.lines.settle(flank)
            self.found = self._least(self.wrenches) if found is None else found
            self._answer_units()

    def _on_flanks(self, dq: Array, at_rest: bool) -> tuple[_FreeForces, Rubbed]:
        """Forces with the friction of a motion with rates ``dq (F, T)``, and what that is; NaN where it has no solution, or none alone."""
        found, of = self.found, {column: self._read(one) for column, one in self.unit.items()}
        base, stress = self._read(vars(found)), self._read({"reactions": found.stress.wrenches, **vars(found.stress)})
        unknown = stress[:, :, :0] if self.task.redundant == "minimum_norm" else stress
        reactions = found.reactions
        # sides of balls and centers of pressure settle in a few rounds; what does not is not determined
        for _ in range(50):
            places = places_of(self.here, dq, reactions, self.dry, at_rest, (self.lines, self.flank))
            rubs = rubbed(self.here, places, base, of, unknown)
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
        doubtful = (moved > MOTIONS.still * size) & any(place.follows for place in places)
        found = replace(found, **sums)
        return _undetermined(found, rubs, doubtful), rubs

    def _read(self, forces: Mapping[str, Array]) -> Array:
        """The wrenches that normal forces are read from: reactions, and behind them forces between teeth."""
        return np.concatenate([forces["reactions"], self.lines.on_gears(forces["multipliers"], self.flank)], axis=1)

    def at_rest(self, dq: Array, given: Array) -> Array:
        """Efforts of drives ``(F, 2, T)`` on the verge of motion to - and to +, the others held; infinite where it jams, NaN in motion, and
        where what only pushes would have to pull on the verge, or be pressed without bound: it tips or lifts before that.
        """
        out = np.full((len(dq), 2, self.here.T), np.nan)
        rest = ~dq.any(axis=0)
        if not rest.any():
            return out
        m, moved, push = self.here.system.m, self.f.sensitivity(), seats_of(self.here.system).push
        tips = any(m.pairs[k].closed == "force" for load in self.dry for k in pairs_of(m, load))
        for j, column in enumerate(self.task.driven):
            for side, sense in enumerate((-1.0, 1.0)):
                found, rubs, _ = self.forces(sense * moving_rates(moved[:, j]), at_rest=True)
                effort = (found.efforts - given - rubs.efforts - found.coupled)[column]
                jams = (rubs.outcome == 1) | (rubs.outcome == 2)
                effort = np.where(jams, np.nan if tips else sense * np.inf, effort)
                if push.any():
                    values = component_values(PairFrames(self.here), found.reactions)
                    pulls = (values[push] < -STRESSES.rounding * np.abs(values).max(axis=0)).any(axis=0)
                    effort = np.where(pulls, np.nan, effort)
                out[column, side, rest] = effort[rest]
        return out

    def holds(self, dq: Array, given: Array) -> Array:
        """Whether friction holds it at rest with all drives off, where there are several ``(T,)``: see ``friction.rests``."""
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
        efforts = {
            c: (one["efforts"] - one["coupled"])[driven] - (driven == c)[:, None] for c, one in self.unit.items()
        }
        own = (found.efforts - given - found.coupled)[driven]
        reads = {column: self._read(one) for column, one in self.unit.items()}
        out = rests(self.here, ways, self._read(vars(found)), reads, efforts, own)
        return np.where(dq.any(axis=0), np.nan, out)


def _worst(values: Array, sizes: Array) -> Mask:
    """The least of values ``(K, T)`` at every position, where it is negative beside the largest of their sizes."""
    least = np.arange(len(values))[:, None] == values.argmin(axis=0)
    return np.asarray(least & (values < -STRESSES.rounding * sizes.max(axis=0)))


def _elastic(here: Configuration, found: _FreeForces, lifted: Mask | None) -> _FreeForces:
    """Reactions and efforts as stiffness splits them; the self-stresses that stay unknown. ``lifted``: see ``elastic_split``."""
    split, stress = elastic_split(here, found.reactions, found.efforts, found.stress, lifted), found.stress

    def of(multiples: Array) -> Array:
        return np.asarray(np.einsum("cpit,it->cpt", stress.wrenches, multiples))

    multipliers = found.multipliers + np.einsum("nit,it->nt", stress.multipliers, split.y)
    mixed = (np.einsum("nit,ijt->njt", part, split.left) for part in (stress.efforts, stress.multipliers))
    return _FreeForces(
        found.reactions + of(split.y),
        found.efforts + np.einsum("fit,it->ft", stress.efforts, split.y),
        Stress(np.einsum("cpit,ijt->cpjt", stress.wrenches, split.left), *mixed),
        multipliers,
        row_efforts(here, multipliers[:, None])[:, 0],
        of(split.locked),
        np.einsum("cpit,ikt->cpkt", stress.wrenches, split.unit[:, split.soft]),
        split.unborne,
        stress.wrenches,
    )


def _found(here: Configuration, totals: Array, multipliers: Array, stress: Stress) -> _FreeForces:
    """What total wrenches are made of."""
    efforts = pair_power(here, totals)
    # in the freedom in which a contact opens a presses on b: that is a reaction
    efforts[here.system.gaps] = 0.0
    coupled = row_efforts(here, multipliers[:, None])[:, 0]
    return _FreeForces(reaction_part(here, totals, efforts), efforts, stress, multipliers, coupled)


def _acting(here: Configuration, task: ForceTask) -> Index:
    """The freedoms with efforts: driven, coupled."""
    return np.setdiff1d(np.union1d(task.driven, here.system.coupled_freedoms), here.system.gaps)


def _stress(here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask) -> Stress:
    """The self-stresses of total wrenches, orthonormal where they are all there are."""
    split = orthonormal_stress if f.complete or task.redundant == "elastic" else split_stress
    return split(here, wrenches.stress, wrenches.multiplier_stress, _acting(here, task))


def _least_multipliers(
    here: Configuration,
    totals: Array,
    multipliers: Array,
    f: FactoredClosure,
    acting: Index,
    lines: ContactLines,
    flank: Array,
) -> Array:
    """Multipliers ``(rows, T)`` of the closure rows that make the reactions least, and then the efforts that leave them as they are.

    Minimizes ``|r + R x|^2 + w^2 |e + M x|^2``, then the same with ``M (x - x_1)`` in place of ``e + M x``: what the weight took from the
    reactions in the first is given back, up to w^4 (method of multipliers, Bertsekas 1982).
    """
    if here.system.m.once(pretensions):
        fault = (
            "redundant='minimum_norm' beside belts with a pretension, of so many self-stresses, takes engine='dense'"
        )
        raise DeclarationError(f"mechanism {here.system.m.name!r}", [fault])
    efforts = pair_power(here, totals)
    points = at_pair_points(here, reaction_part(here, totals, efforts)).swapaxes(0, 1).reshape(-1, here.T)
    R = [reaction_map(here, t) for t in range(here.T)]
    if lines:
        n = len(multipliers)
        of_unit = lines.relief(np.repeat(np.eye(n)[:, :, None], here.T, axis=2), flank)
        of_unit = at_pair_points(here, of_unit).swapaxes(0, 1).reshape(-1, n, here.T)
        behind = np.zeros((len(of_unit), here.system.n_rows, here.T))
        behind[:, -n:] = of_unit
        R = [R[t] + scipy.sparse.csr_array(behind[..., t]) for t in range(here.T)]
    if len(acting) < 2:
        return f.least(R, points)
    M = [STRAIN * effort_map(here, t, acting) for t in range(here.T)]
    both = [scipy.sparse.csr_array(scipy.sparse.vstack(maps)) for maps in zip(R, M, strict=True)]
    first = f.least(both, np.concatenate([points, STRAIN * efforts[acting], STRAIN * multipliers]))
    back = np.stack([-(part @ x) for part, x in zip(M, first.T, strict=True)], axis=1)
    return f.least(both, np.concatenate([points, back]))


def _balance(
    here: Configuration, reactions: Array, totals: Array, loads: Array, parts: tuple[Array | None, ...]
) -> tuple[Array, float]:
    """Residual ``(T,)`` of the equilibrium of all links and of ``S^T w = effort``, and the largest wrench."""
    s = here.system
    left = loads.copy()
    add_at(left, s.b, totals)
    add_at(left, s.a, -totals)
    left[:, s.graph.frame] = 0.0
    residual = np.abs(left).max(axis=(0, 1), initial=0.0)
    work = np.abs(np.delete(pair_power(here, reactions), s.gaps, axis=0)).max(axis=0, initial=0.0)
    return np.maximum(residual, work), max(_largest(part) for part in (totals, *parts) if part is not None)


def _power(
    rates: Rates, totals: Array, applied: Array, efforts: tuple[Array, ...], inertia: Array
) -> tuple[Array, float]:
    """Driver power + load power - rate of kinetic energy ``(T,)``, and the largest term.

    A term is rate times effort, or twist times wrench of one link, for loads, inertia and what its pairs transmit, before anything
    cancels: where forces do no work, the sum is rounding of such products.
    """
    s, kinetic = rates.here.system, kinetic_power(rates, inertia)
    left = (rates.V * applied).sum(axis=(0, 1)) + (rates.dq * sum(efforts)).sum(axis=0) - kinetic.sum(axis=0)
    speed, through = np.abs(rates.V).max(axis=0), np.abs(totals).max(axis=0)
    terms = (
        speed * np.abs(applied).max(axis=0),
        speed * np.abs(inertia).max(axis=0),
        speed[s.b] * through,
        speed[s.a] * through,
        *(rates.dq * part for part in efforts),
    )
    return left, max(_largest(term) for term in terms)


def _largest(values: Array) -> float:
    """Largest size of a number in an array; 0 for none. Positions without forces are NaN."""
    return float(max(np.fmax.reduce(values, axis=None, initial=0.0), -np.fmin.reduce(values, axis=None, initial=0.0)))
