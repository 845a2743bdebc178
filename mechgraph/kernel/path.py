"""Positions of a mechanism by the compiled kernel: its tables with a library, and the records that come back."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.kernel.tables import Integers, Layout


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
    """One mechanism in the tables of the kernel, with the library that evaluates them."""

    library: Any
    layout: Layout
    I: Integers
    P: Array

    def follow(
        self, begin: Array, q: Array, v: Array, a: Array, batch: tuple[int, ...], forces: bool
    ) -> tuple[Records, NDArray[np.bool_]]:
        """Positions, velocities and accelerations of the drives ``(T, d)`` of a batch, from their values ``begin (d, B)`` at the starts
        of all variants, which share the positions equally.

        With the records: which variants ``(B,)`` are whole. Another one has a step that is not certified, or a position at which the
        kernel decides nothing.
        """
        count, each = begin.shape[1], len(q) // begin.shape[1]
        state = np.empty(ctypes.c_size_t(self.library.mgk_state_size(pointer(self.I))).value // 8 + 1)
        values, largest = np.empty((len(q), self.layout.record(forces))), np.zeros(2)
        done, work, whole = ctypes.c_int(), np.zeros(3, dtype=ctypes.c_long), np.ones(count, dtype=bool)
        I, memory, most, told = (pointer(array) for array in (self.I, state, largest, work))
        for i in range(count):
            mine = slice(i * each, (i + 1) * each)
            moves = [pointer(array[mine]) for array in (q, v, a)]
            for order in _orders(begin[:, i], q[mine], batch):
                whole[i] &= not self.library.mgk_path(
                    I, pointer(self.P[i]), memory, ctypes.c_int(len(order)), pointer(order), *moves, ctypes.c_int(forces),
                    pointer(values[mine]), most, ctypes.byref(done), told,
                )  # fmt: skip
                if not whole[i]:
                    values[mine] = np.nan
                    break
        return Records(self.layout, values, largest, (int(work[0]), int(work[1]), int(work[2]))), whole


def pointer(array: Array | Integers) -> ctypes.c_void_p:
    """Where an array begins, as the library takes it."""
    return ctypes.c_void_p(array.ctypes.data)


def _orders(begin: Array, q: Array, batch: tuple[int, ...]) -> Iterator[Integers]:
    """In which order positions are taken from the start: of one drive up and down its curve, of several case by case."""
    if len(begin) != 1:
        n = batch[-1] if batch else 1
        yield from np.arange(len(q), dtype=np.int32).reshape(-1, n)
        return
    along = q[:, 0] - begin[0]
    for sense in (1.0, -1.0):
        there = np.flatnonzero(along >= 0.0 if sense > 0 else along < 0.0)
        if there.size:
            yield there[np.argsort(sense * along[there], kind="stable")].astype(np.int32)
