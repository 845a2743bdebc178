"""The right-hand side of the equations of motion by the compiled kernel, where it carries what moves (``kernel/motion.c``)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mechgraph import by_kernel
from mechgraph.kernel import build
from mechgraph.kernel.loads import in_tables
from mechgraph.kernel.tables import layout, tables, why_not
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array
from mechgraph.response.motion_equations import SPARSE_FROM, Chart, Loads


@dataclass(frozen=True)
class Evaluated:
    """Of one state: the rates of ``u``, ``v`` and the work, how steep the chart is there and its condition; and the state itself."""

    rates: Array
    steepness: float
    condition: float
    state: Array


def cannot(system: System, loads: Loads, held: bool) -> str | None:
    """Why the kernel does not serve a motion; None where it does."""
    if held:
        return "passive freedoms are held at rest"
    if system.n_freedoms * len(system.m.links) >= SPARSE_FROM:
        return f"it has {system.n_freedoms} freedoms and {len(system.m.links)} links; expected fewer than {SPARSE_FROM} of the product"
    other = next((load for load in (*loads.stored, *loads.rest) if not in_tables(load)), None)
    if other is not None:
        return f"load {other.where.removesuffix(': ')} is a function or a table"
    return why_not(system)


def library_for(system: System, loads: Loads, held: bool, engine: str) -> Any:
    """The library as ``engine`` asks, for a motion with passive freedoms held or not; None where numpy is to serve.

    Raises
    ------
    DeclarationError
        where the kernel was asked for by name and cannot carry it; MissingExtraError without a compiler.
    """
    library = build.built() if engine == by_kernel.COMPILED else by_kernel.at_hand() if engine == "auto" else None
    why = None if library is None else cannot(system, loads, held)
    if why is not None and engine == by_kernel.COMPILED:
        raise build.not_served(f"respond {system.m.name!r}", why)
    return library if why is None else None


class KernelRates:
    """The tables of a chart with the library that evaluates them."""

    def __init__(self, library: Any, chart: Chart, loads: Loads) -> None:
        s, columns = chart.system, np.concatenate([chart.free, chart.prescribed])
        places = layout(s, columns, ())
        found = tables(places, s, chart.x0[:, None], (*loads.stored, *loads.rest))
        assert found is not None
        self.n, self._x0 = len(chart.free), np.ascontiguousarray(chart.x0)
        self._tables = found
        size, of_motion = library.mgk_motion_size, library.mgk_motion
        size.argtypes, size.restype = [ctypes.c_void_p], ctypes.c_size_t
        of_motion.argtypes = [
            *[ctypes.c_void_p] * 3,
            *[ctypes.c_int] * 2,
            *[ctypes.c_void_p] * 4,
            ctypes.c_double,
            *[ctypes.c_void_p] * 2,
        ]
        self._memory = np.empty(size(found[0].ctypes.data) // 8 + 1)
        self._y, self._p, self._out = (
            np.empty(2 * self.n),
            np.empty((3, len(chart.prescribed))),
            np.empty(2 * self.n + 3),
        )
        of_tables, own = (
            [array.ctypes.data for array in some] for some in ((*found, self._memory), (self._x0, self._y, self._p))
        )
        self._call, self._result = (
            partial(of_motion, *of_tables, self.n, len(loads.stored), *own),
            self._out.ctypes.data,
        )

    def __call__(self, known: Array, h: float, y: Array, p: Array) -> Evaluated | None:
        """At ``y = (u, v)`` a time ``h`` behind a ``known`` state (x, q', q''), prescribed freedoms at ``p (3, p)``; None where it does not
        serve.
        """
        self._y[:], self._p[:] = y, p
        found = np.empty(len(known))
        if self._call(known.ctypes.data, h, found.ctypes.data, self._result):
            return None
        *_, steepness, condition = self._out.tolist()
        return Evaluated(self._out[:-2].copy(), steepness, condition, found)
