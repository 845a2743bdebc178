"""Forces over a block of positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.force.friction import Rubbed, moving_rates
from mechgraph.force.friction_problem import FrictionProblem
from mechgraph.force.loads import Site, inertia_wrenches, kinetic_power
from mechgraph.force.reactions import METHODS, ForceProblem, on_their_flanks, pair_power, pretensioned, row_efforts
from mechgraph.force.redundant import BlockForces, ForceTask, held_still, least_on_flanks
from mechgraph.kinematics.rates import Rates
from mechgraph.kinematics.state import Configuration, FactoredClosure
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.linear import add_at
from mechgraph.maths.se3 import Array, Index
from mechgraph.model.friction import rubbing_loads


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
    held, holds, hold_terms = held_still(here, task, f, applied + inertia, given, site.largest)
    loads = applied + inertia if held is None else applied + inertia + held
    first = pretensioned(here, METHODS[task.method](ForceProblem(here, loads, given, task.driven, f)), f)
    lines = ContactLines(here)
    found, flank = least_on_flanks(here, on_their_flanks(here, first, lines), f, task, lines)
    dry = [load.with_numbers(site.number) for load in rubbing_loads(here.system.m, task.loads)]
    ranges: Array | None = None
    holds_alone: Array | None = None
    if rubs is not None:
        found = replace(found, reactions=found.reactions - rubs.taken)
    elif dry:
        dq = moving_rates(rates.dq, rates.ddq)
        solve = FrictionProblem(here, task, f, first, lines, (found, flank), dry)
        (ranges, why, growth), holds_alone = solve.at_rest(dq, given), solve.holds(dq, given)
        found, rubs, flank = solve.forces(dq)
        verge = (why > 0) & (rubs.outcome == 0)
        rubs.ends[verge], rubs.growth[:, verge] = why[verge], growth[:, verge]
        held, holds, hold_terms = held_still(here, task, f, applied + inertia, given + rubs.efforts, site.largest)
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
