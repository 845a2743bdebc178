"""The equations of motion by the compiled kernel, where it carries what moves (``kernel/motion.c``, ``kernel/calls.c``)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mechgraph import by_kernel
from mechgraph.kernel import build
from mechgraph.kernel.loads import in_tables
from mechgraph.kernel.path import pointer
from mechgraph.kernel.tables import Integers, layout, tables, why_not
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array, Index
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
        return f"load {other.where.removesuffix(': ')} is a function, or a table over coordinate and rate"
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


def _tables(
    library: Any, system: System, drives: Index, x: Array, loads: Loads
) -> tuple[tuple[Integers, Array], Array]:
    """The tables of a system at a closed state ``x (nx,)``, ``drives`` its independent freedoms, and memory for a motion."""
    found = tables(layout(system, drives, ()), system, x[:, None], (*loads.stored, *loads.rest))
    assert found is not None
    size = library.mgk_motion_size
    size.argtypes, size.restype = [ctypes.c_void_p], ctypes.c_size_t
    return found, np.empty(size(found[0].ctypes.data) // 8 + 1)


class KernelRates:
    """The tables of a chart with the library that evaluates them."""

    def __init__(self, library: Any, chart: Chart, loads: Loads) -> None:
        columns = np.concatenate([chart.free, chart.prescribed])
        self._tables, self._memory = _tables(library, chart.system, columns, chart.x0, loads)
        self.n, self._x0 = len(chart.free), np.ascontiguousarray(chart.x0)
        of_motion = library.mgk_motion
        of_motion.argtypes = [
            *[ctypes.c_void_p] * 3,
            *[ctypes.c_int] * 2,
            *[ctypes.c_void_p] * 4,
            ctypes.c_double,
            *[ctypes.c_void_p] * 2,
        ]
        self._y, self._p, self._out = (
            np.empty(2 * self.n),
            np.empty((3, len(chart.prescribed))),
            np.empty(2 * self.n + 3),
        )
        of_tables, own = (
            [array.ctypes.data for array in some]
            for some in ((*self._tables, self._memory), (self._x0, self._y, self._p))
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


MOST_NODES = 256
"""Nodes of a path that are found at once."""


class KernelPath:
    """The tables of a mechanism of mobility 1, by the coordinate of one freedom, with the library that evaluates them."""

    def __init__(self, library: Any, system: System, column: int, x: Array, loads: Loads) -> None:
        self._tables, self._memory = _tables(library, system, np.array([column]), x, loads)
        self._library, self._stored = library, len(loads.stored)

    def nodes(self, x: Array, end: float) -> tuple[Array, Array]:
        """Distances ``(n,)`` and states ``(nx, n)`` of the nodes of certified steps from a closed state ``x (nx,)`` towards a place of
        the coordinate; up to there, or to where a step is refused.
        """
        out = np.empty((MOST_NODES, 1 + len(x)))
        known = (*self._tables, self._memory, np.ascontiguousarray(x))
        n = self._library.mgk_nodes(*map(pointer, known), ctypes.c_double(end), ctypes.c_int(len(out)), pointer(out))
        return out[:n, 0], out[:n, 1:].T

    def terms(self, x: Array, u: Array) -> tuple[Array, Array, Array] | None:
        """Terms ``(4, T)`` as of ``motion_equations.along_one``, steepness and condition ``(T,)``, at states near ``x (nx, T)``, closed
        where the coordinate is ``u (T,)``; None where one of them is refused.
        """
        out, states = np.empty((len(u), 6)), x.T.copy()
        counts = ctypes.c_int(len(u)), ctypes.c_int(self._stored)
        known = map(pointer, (*self._tables, self._memory))
        if self._library.mgk_along(*known, *counts, *map(pointer, (np.ascontiguousarray(u), states, out))):
            return None
        return out[:, :4].T, out[:, 4], out[:, 5]
