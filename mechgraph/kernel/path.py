"""Positions of a mechanism by the compiled kernel: its tables with a library, and the records that come back."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.kernel.tables import Integers, Layout
from mechgraph.maths.se3 import Array

Mask = NDArray[np.bool_]
MIDDLE = 0.381966011250105
"""The place on a step over numbers at which they are looked at once more: the golden section, as whole turns on it are none up to there."""


@dataclass(frozen=True)
class Records:
    """What the kernel says of all positions: ``values (T, record)``, the ``largest`` wrench and power, and the ``work`` done."""

    layout: Layout
    values: Array
    largest: Array
    work: tuple[int, int, int]

    def __contains__(self, name: str) -> bool:
        return name in self.layout.places

    def __getitem__(self, name: str) -> Array:
        """A part, component axes first and positions last, as the package holds it."""
        part = self.values[:, self.layout.places[name]]
        return part.reshape(len(part), *self.layout.shapes[name]).T


@dataclass(frozen=True)
class Kernel:
    """Mechanisms of one kind in the tables of the kernel ``P (B, numbers)``, with the library that evaluates them."""

    library: Any
    layout: Layout
    I: Integers
    P: Array

    def follow(
        self, begin: Array, q: Array, v: Array, a: Array, batch: tuple[int, ...], forces: bool
    ) -> tuple[Records, Mask]:
        """Positions, velocities and accelerations of the drives ``(T, d)`` of a batch, from their values ``begin (d, B)`` at the starts
        of all variants, which share the positions equally.

        With the records: which variants ``(B,)`` are whole. Another one has a step that is not certified, or a position at which the
        kernel decides nothing.
        """
        count = begin.shape[1]
        each = len(q) // count
        order, ends = _orders(begin, q.reshape(count, each, len(begin)), batch)
        values, largest = np.empty((len(q), self.layout.record(forces))), np.zeros(2)
        work, whole, room = np.zeros(3, dtype="l"), np.ones(count, dtype=np.intc), self._room()
        self.library.mgk_variants(
            pointer(self.I), ctypes.c_int(count), ctypes.c_int(self.P.shape[1]), pointer(self.P), pointer(room),
            ctypes.c_int(each), ctypes.c_int(ends.shape[1]), *map(pointer, (ends, order, q, v, a)), ctypes.c_int(forces),
            *map(pointer, (values, whole, largest, work)),
        )  # fmt: skip
        return Records(self.layout, values, largest, (int(work[0]), int(work[1]), int(work[2]))), whole > 0

    def lead(self, x: Array, middle: Array, end: Array) -> Mask:
        """One certified step each of ``n`` mechanisms from ``P`` (of one, or one each) by tables ``middle`` at that part of it to ``end
        (n, numbers)``, drives at rest: which ``(n,)`` are closed there, the state in their row of ``x (n, nx)``; the others are left.
        """
        whole, count, room = np.zeros(len(x), dtype=np.intc), ctypes.c_int(len(x)), self._room()
        self.library.mgk_lead(
            pointer(self.I), count, ctypes.c_int(self.P.shape[1]), ctypes.c_int(len(self.P) > 1), ctypes.c_double(MIDDLE),
            *map(pointer, (self.P, middle, end, room, x, whole)),
        )  # fmt: skip
        return np.asarray(whole > 0)

    def _room(self) -> Array:
        """Memory for one state; every call has its own."""
        return np.empty(ctypes.c_size_t(self.library.mgk_state_size(pointer(self.I))).value // 8 + 1)


def pointer(array: Any) -> ctypes.c_void_p:
    """Where an array begins, as the library takes it."""
    return ctypes.c_void_p(array.ctypes.data)


def _orders(begin: Array, q: Array, batch: tuple[int, ...]) -> tuple[Integers, Integers]:
    """In which order the positions ``q (B, n, d)`` of every variant are taken from its start ``(B, n)``, and where every way of it ends
    ``(B, ways)``: of one drive up and down its curve, of several case by case.
    """
    count, n, drives = q.shape
    if drives != 1:
        case = batch[-1] if batch else 1
        ends = np.arange(case, n + 1, case, dtype=np.int32)
        return np.tile(np.arange(n, dtype=np.int32), (count, 1)), np.tile(ends, (count, 1))
    along = q[:, :, 0] - begin[0][:, None]
    order = np.lexsort((np.abs(along), along < 0.0), axis=-1).astype(np.int32)
    ends = np.full((count, 2), n, dtype=np.int32)
    ends[:, 0] = (along >= 0.0).sum(axis=1)
    return order, ends
