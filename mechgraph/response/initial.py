"""The state in which a motion begins: closed loops, and rates that agree with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import assembled_at, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rank import closure_rank
from mechgraph.determinacy.finite_motion import branches, branches_text, finite_motion
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.quantities import is_numeric, without_units, wrong
from mechgraph.response.chart import Stopped
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import Columns
from mechgraph.response.prescribed import Prescribed

AGREEING = 1e-9
"""Part of the given rates by which they may miss the closure before they contradict it."""


def read_start(
    m: Mechanism, start: Mapping[str, Any], given: Prescribed, begin: float, faults: list[str]
) -> dict[str, float]:
    """Coordinates at the beginning by full names, those prescribed among them; adds what is wrong to ``faults``."""
    out: dict[str, float] = {}
    known = dict(zip(given.names, given.at(begin)[0].tolist(), strict=True))
    for name, value in start.items():
        fault = m.freedom_fault(name, single=True)
        number = value if fault else m.in_own_units(name, value)
        if fault:
            faults.append(f"start of {name!r}: {fault}")
        elif not is_numeric(number, ()):
            faults.append(wrong(number, f"start of {name!r}", "a finite number"))
        elif m.full_name(name) in out:
            faults.append(f"start of {name!r}: is given twice")
        elif known.get(m.full_name(name), number) != number:
            faults.append(
                f"start of {name!r} = {number!r}: its motion is prescribed, {known[m.full_name(name)]:g} at t = {begin:g}; leave it out"
            )
        else:
            out[m.full_name(name)] = float(number)
    return {**out, **known}


def read_rates(m: Mechanism, rates: Mapping[str, Any], faults: list[str]) -> dict[str, float]:
    """Rates at the beginning by full names; adds what is wrong to ``faults``."""
    out: dict[str, float] = {}
    for name, value in rates.items():
        fault = m.freedom_fault(name, single=False)
        number = value if fault else without_units(value, (0 if m.turns(name) else 1, 0, -1), m.units)
        if fault:
            faults.append(f"rate of {name!r}: {fault}")
        elif not is_numeric(number, ()):
            faults.append(wrong(number, f"rate of {name!r}", "a finite number"))
        else:
            out[m.full_name(name)] = float(number)
    return out


def started(m: Mechanism, start: Mapping[str, float], given: Prescribed) -> tuple[System, Array, Index]:
    """The scaled system, the closed state at the beginning, and the prescribed columns."""
    system, x = assembled_at(m, start)
    columns, _ = named_columns(m, system, dict.fromkeys(given.names, 0.0))
    return system, x, columns


def start_rates(m: Mechanism, task: Task, x: Array, rates: Mapping[str, float], begin: float) -> Array:
    """Rates ``(F,)`` at the beginning: those given and prescribed, the others as small as the closure lets them be.

    Raises
    ------
    DeclarationError
        where they contradict the closure.
    Stopped
        where they do not tell how the motion begins, as at a change point.
    """
    s = task.system
    names = [*task.prescribed.names, *rates]
    values = [*task.prescribed.at(begin)[1].tolist(), *rates.values()]
    places = [m.freedom(name) for name in names]
    columns = np.array([int(s.first_column[k]) + j for k, j in places], dtype=np.intp)
    wanted = np.array(values) / np.where(s.is_length[columns], s.par.L, 1.0)
    closure = closure_rank(Configuration(s, x[:, None]), engine=task.engine)
    N = closure.motions
    if N.shape[1] > 1 and closure.rank < closure.count:
        beside = finite_motion(s, x, closure, task.engine).mobility
        if beside < N.shape[1]:
            raise Stopped(_where_branches_meet(s, x, N, beside))
    if task.held:
        N = _at_rest(task, x)
    if not len(names):
        return np.zeros(s.n_freedoms)
    a = np.linalg.lstsq(N[columns], wanted, rcond=MOTIONS.dependent)[0]
    left = np.abs(N[columns] @ a - wanted)
    if left.max() > AGREEING * max(1.0, float(np.abs(wanted).max())):
        rank = rank_of(singular_values(N[columns]), MOTIONS.dependent)
        held = " with the passive freedoms at rest" if task.held else ""
        closed = ", ".join(f"{n} {v:.6g}" for n, v in zip(names, (N[columns] @ a).tolist(), strict=True))
        raise DeclarationError(
            f"respond {m.name!r}",
            [
                f"rates of {', '.join(names)}: contradict the closure{held}, which lets {rank} of these {len(names)} move independently; "
                f"nearest rates that it allows (radians, or lengths / {s.par.L:.4g}, a unit of time): {closed}"
            ],
        )
    return np.asarray(N @ a)


def _where_branches_meet(s: System, x: Array, motions: Array, beside: int) -> str:
    """What is said of a start in a singular position: its motions are not those that the mechanism has ``beside`` it."""
    fastest = int(np.argmax(np.where(s.single_rows >= 0, np.abs(motions).max(axis=1), 0.0)))
    ways = branches(s, x, np.array([fastest], dtype=np.intp)) if beside == 1 else ()
    meet = f" ({branches_text(ways, s.m.freedom_names()[fastest])})" if ways else ""
    return (
        f"it begins in a singular position{meet}: its mobility is {motions.shape[1]} there and {beside} beside it, so that rates do not "
        "tell how the motion goes on; start beside it, on the branch that is meant"
    )


def _at_rest(task: Task, x: Array) -> Array:
    """Orthonormal motions that leave the passive links at rest."""
    chart = task.chart(x)
    f = chart.solver.factored(chart.start, chart.which)
    columns = Columns(chart.start, f, len(chart.free), chart.held)
    Z = np.concatenate([columns.Z, columns.Zp], axis=1)[..., 0]
    return np.asarray(scipy.linalg.orth(Z))
