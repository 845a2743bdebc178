"""Tracks in the kernel: what ``kernel/tracks.c`` needs of a class of mechanisms, of their ways and states; closure rows for circuits."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from mechgraph.kernel import build
from mechgraph.kernel.tables import fundamental, layout, tables, why_not
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Index, Mask
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array


class LedRow(NamedTuple):
    """A row of equations: how many of them are independent, of how many ``free`` coordinates they settle how many; what mixes them."""

    rank: int
    settled: int
    free: Index
    mixing: Array | None


@dataclass(frozen=True)
class Led:
    """What is led: rows of ``states`` numbers, near ``x (nx,)`` at the start, of ``columns (d,)`` of which something is asked.

    given (R, d) : whether it is asked of a row; factors (d,): unknowns up to which it is (-1: none).
    places : of what unknowns place: number of the unknown; array (point, axis, second), component, side and pair.
    head : numbers that stand before the rows; pairs: how many, with those of rods.
    rods : of both ends the pair, the side of the rod and the body beyond; ``ways (n, P)`` on which rods are passed.
    squares (n,) : where squares of their lengths stand among what is asked (-1: those of what is on the rod).
    """

    system: System
    x: Array
    states: int
    columns: Index
    given: Array
    rows: Sequence[LedRow]
    pairs: int
    rods: Sequence[Sequence[int]]
    ways: Array
    squares: Index
    unknowns: int = 0
    head: int = 0
    places: Sequence[Sequence[int]] = ()
    factors: Index | None = None

    @property
    def served(self) -> bool:
        """Whether the kernel is there and leads them."""
        conditions = sum(row.rank - row.settled for row in self.rows)
        return build.installed() is not None and conditions == self.unknowns and why_not(self.system) is None


class LegNumbers(NamedTuple):
    """Of ``n`` ways: numbers of markers at the begin ``(3, 3, 2, P, n)``, the screws ``(6, 2, P, n)`` on which they go, and how they change
    beside that; what is asked at the begin, and how that changes, ``(R, d, n)``.
    """

    begin: Array
    screws: Array
    change: Array
    asked: Array
    grown: Array

    @property
    def joined(self) -> LegNumbers:
        """All for as many ways, one after the other in memory."""
        n = max(v.shape[-1] for v in self)
        return LegNumbers(*(np.ascontiguousarray(np.broadcast_to(v, (*v.shape[:-1], n)), dtype=complex) for v in self))


class CompiledTracks:
    """Tracks of a class in the kernel."""

    def __init__(self, led: Led) -> None:
        s = led.system
        self.led, known = led, layout(s, np.zeros(0, dtype=np.intp), [])
        made = tables(known, s, led.x[:, None], None)
        assert made is not None
        self.I, self.P = made[0], made[1][0]
        through = np.zeros((s.graph.n_loops, len(s.m.pairs)))
        for loop, pair, sign in zip(*fundamental(s), strict=True):
            through[loop, pair] = sign
        R, d = led.given.shape
        head = [R, led.unknowns, led.head, led.states, led.pairs, len(led.rods), len(led.places), d]
        told = [(row.rank, row.settled, len(row.free), row.mixing is not None, *row.free) for row in led.rows]
        factors = np.full(d, -1) if led.factors is None else led.factors
        parts = [
            head, known.side, *led.places, *led.rods, led.squares, led.ways, through, led.columns, factors, led.given, *told,
        ]  # fmt: skip
        self.A = np.concatenate([np.asarray(part, dtype=np.int32).ravel() for part in parts])
        mixing = [row.mixing.ravel() for row in led.rows if row.mixing is not None]
        self.mixing = np.concatenate([np.zeros(0), *mixing]).astype(complex)

    @cached_property
    def _size(self) -> int:
        """Numbers of memory of a call."""
        return int(_library().mgk_tracks_size(self.I.ctypes.data, self.A.ctypes.data, len(self.P)))

    def tracked(
        self, ways: LegNumbers, which: Index, t: Array, x: Array, rate: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """States ``x (nx, T)`` with what is asked of them, steps of Newton's method, rates, and sizes ``(3, T)``.

        ``rate (T,)``: ``x`` are predictions to be corrected by two steps, and rates are those of states, times it; see ``kernel/tracks.c``.
        """
        led, T = self.led, x.shape[1]
        x, t = np.array(x, dtype=complex, order="C"), np.ascontiguousarray(t, dtype=complex)
        step = np.empty(
            (0 if rate is not None else led.head + len(led.given) * led.system.n_freedoms, T), dtype=complex
        )
        grown, sizes = np.empty_like(step if rate is None else x), np.empty((3, T))
        which, memory = which.astype(np.int32), np.empty(self._size, dtype=complex)
        dt = None if rate is None else np.ascontiguousarray(rate, dtype=complex)
        legs = np.array([v.ctypes.data for v in ways], dtype=np.uintp)
        _library().mgk_tracks(
            self.I.ctypes.data, self.P.ctypes.data, len(self.P), self.A.ctypes.data, self.mixing.ctypes.data, legs.ctypes.data,
            ways.begin.shape[-1], T, which.ctypes.data, t.ctypes.data, None if dt is None else dt.ctypes.data, x.ctypes.data,
            step.ctypes.data, grown.ctypes.data, sizes.ctypes.data, memory.ctypes.data,
        )  # fmt: skip
        return x, step, grown, sizes

    def rows(
        self, numbers: LegNumbers, x: Array, longest: float = 1.0, to: float = np.inf
    ) -> tuple[Array, Array, Mask]:
        """Real states ``x (T, nx)`` of one row closed in its first free coordinates, by a Newton step below the ``longest`` and shorter
        ones ``to`` a number by which it may stay open; its equations ``(T, n, free + u + 1)`` there: derivatives by free coordinates and
        unknowns, and what is left open with the other sign; whether it came ``(T,)``.
        """
        x, memory = np.array(x, dtype=float, order="C"), np.empty(self._size, dtype=complex)
        numbers = LegNumbers(*(np.ascontiguousarray(v.real) for v in numbers))
        height = self.led.system.n_rows + len(self.led.rods)
        out = np.empty((len(x), height, len(self.led.rows[0].free) + self.led.unknowns + 1))
        came, legs = np.empty(len(x), dtype=np.int32), np.array([v.ctypes.data for v in numbers], dtype=np.uintp)
        _library().mgk_rows(
            self.I.ctypes.data, self.P.ctypes.data, len(self.P), self.A.ctypes.data, legs.ctypes.data, len(x), longest, to, x.ctypes.data,
            out.ctypes.data, came.ctypes.data, memory.ctypes.data,
        )  # fmt: skip
        return x, out, came.astype(bool)


class CompiledClosure:
    """Closure rows of a system's cases in the kernel; their loops are those that chords close, about the chords."""

    def __init__(self, system: System) -> None:
        start = np.repeat(system.start_coordinates(system.m.start)[:, None], system.par.batch, axis=1)
        made = tables(layout(system, np.zeros(0, dtype=np.intp), []), system, system.state_of(start), None)
        assert made is not None
        self.I, self.P = made
        self.shape = system.n_rows, system.n_freedoms

    @staticmethod
    def of(system: System) -> CompiledClosure | None:
        """Where the kernel is there and serves them."""
        return CompiledClosure(system) if build.installed() is not None and why_not(system) is None else None

    @cached_property
    def _memory(self) -> Array:
        return np.empty(-(-int(_library().mgk_state_size(self.I.ctypes.data)) // 8))

    def at(self, x: Array, case: Index) -> tuple[Array, Array]:
        """What rows leave open ``(rows, T)`` at states ``(nx, T)``, and their derivatives ``(rows, F, T)``."""
        T = x.shape[1]
        case, x = (np.zeros_like(case) if len(self.P) == 1 else case).astype(np.int32), np.ascontiguousarray(x.T)
        left, J = np.empty((T, self.shape[0])), np.empty((T, *self.shape))
        _library().mgk_closure(
            self.I.ctypes.data, self.P.ctypes.data, self.P.shape[1], T, case.ctypes.data, x.ctypes.data, self._memory.ctypes.data,
            left.ctypes.data, J.ctypes.data,
        )  # fmt: skip
        return left.T, J.transpose(1, 2, 0)


@cache
def _library() -> ctypes.CDLL:
    """The kernel, its functions for tracks and circuits declared."""
    library = build.built()
    pointer, whole = ctypes.c_void_p, ctypes.c_int
    library.mgk_tracks_size.argtypes, library.mgk_tracks_size.restype = [pointer, pointer, whole], ctypes.c_size_t
    library.mgk_tracks.argtypes = [pointer, pointer, whole, *[pointer] * 3, whole, whole, *[pointer] * 8]
    ends = [ctypes.c_double] * 2
    library.mgk_rows.argtypes = [pointer, pointer, whole, pointer, pointer, whole, *ends, *[pointer] * 4]
    library.mgk_state_size.argtypes, library.mgk_state_size.restype = [pointer], ctypes.c_size_t
    library.mgk_closure.argtypes = [pointer, pointer, whole, whole, *[pointer] * 5]
    library.mgk_tracks.restype = library.mgk_rows.restype = library.mgk_closure.restype = None
    return library
