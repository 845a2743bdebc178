"""Closed states with rates of independent freedoms, turned into a trajectory with all forces, and their energies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.force.block import ForceTask, forces_of_block
from mechgraph.force.loads import Site, kinetic_energy
from mechgraph.model.mechanism import Mechanism
from mechgraph.response.chart import Closed
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import moved
from mechgraph.result.kept import BlockMotion
from mechgraph.result.trajectory import Trajectory

Block = tuple[Index, Task, Closed, Array]
"""Places, the task by which they were followed, closed states, and the rates ``v (n, T)`` of the independent columns of their factors."""


def trajectory_of(
    task: Task, m: Mechanism, times: Array, blocks: Iterable[Block], at_rest: bool = False
) -> tuple[Trajectory, Array, Array]:
    """The trajectory at times (a number or ``(T,)``) from blocks of states, with kinetic and potential energy ``(T,)``.

    The efforts of the prescribed freedoms of ``task`` are those of drives; what else holds the tasks of the blocks acts as a load.
    ``at_rest``: nothing moves nor is about to, also where no inertia resists.
    """
    s, t, blocks = task.system, times.reshape(-1), list(blocks)
    x = np.full((s.n_state, t.size), np.nan)
    for places, _, closed, _ in blocks:
        x[:, places] = closed.here.x
    coordinates = s.coordinates_of(x, s.start_coordinates(m.start))
    out = Trajectory(s, partial(_same, s), times.shape, times, task.columns, coordinates, True, task.held)
    out.engine, out.method = task.engine, "loop_wrench"
    kinetic, potential = np.zeros(t.size), np.zeros(t.size)
    for places, own, closed, v in blocks:
        # the batch of a block is its own: loads are functions of time here, not arrays over positions
        at, count, q = t[places], len(places), coordinates[:, places]
        rates = _still(closed.here) if at_rest else moved(closed, v, own.prescribed_at(at)[1:], own.loads, at).rates
        idle = None if closed.held is None else closed.held.places
        force_task = ForceTask(out.method, m.loads, own.columns, own.held, (count,), at, "nan", idle)
        forces = forces_of_block(force_task, rates, closed.f, q, np.arange(count))
        held = np.setdiff1d(own.columns, task.columns)
        given = forces.given.copy()
        given[held] = (forces.efforts - forces.coupled)[held]
        out.put(BlockMotion(places, rates), replace(forces, given=given))
        kinetic[places] = kinetic_energy(closed.here, rates.V) * s.par.L**2
        site = Site(closed.here, rates, q, (count,), np.arange(count), at)
        for load in task.loads.stored:
            potential[places] += load.energy(site)
    return out, kinetic, potential


def _still(here: Configuration) -> Rates:
    nothing = np.zeros((here.system.n_freedoms, here.T))
    return Rates(Velocities(here, nothing), nothing, np.zeros(here.T))


def _same(system: System, places: Any) -> System:
    """The one system of all positions; a function of the module, so that solutions can be pickled."""
    return system
