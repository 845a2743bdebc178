"""Formulas of vector components, evaluated with arrays, or with plain numbers where there are few of them.

A call of numpy for a single vector takes as long as twenty operations of Python's own numbers: a path is followed from one position to
the next, and what it costs is such calls. A formula is written once, in components, with the functions of a library that is handed to it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from itertools import chain
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Library = Any
"""Where a formula finds ``sqrt``, ``sin``, ``cos``, ``arctan``, ``where`` and ``all``: numpy, or the same of plain numbers."""

FEW_VECTORS = 12
"""Vectors up to which plain numbers are faster (measured)."""


def _of_plain_numbers(module: Any) -> Library:
    return SimpleNamespace(
        sqrt=module.sqrt,
        sin=module.sin,
        cos=module.cos,
        arctan=module.atan,
        where=lambda condition, value, other: value if condition else other,
        all=bool,
    )


REAL_NUMBERS, COMPLEX_NUMBERS = _of_plain_numbers(math), _of_plain_numbers(cmath)


class by_components:
    """A ``formula(library, *components)`` that gives components, as a function of vectors ``(m, ...)``."""

    def __init__(self, formula: Callable[..., tuple[Any, ...]]) -> None:
        self.formula, self.__doc__ = formula, formula.__doc__

    def __call__(self, *vectors: Array) -> Array:
        """Vectors ``(k, ...)``; the batch axes of arguments may be broadcast."""
        batch = vectors[0].shape[1:]
        count = math.prod(batch)
        if 0 < count <= FEW_VECTORS:
            try:
                joined = np.concatenate(vectors).reshape(-1, count)
                library = COMPLEX_NUMBERS if joined.dtype.kind == "c" else REAL_NUMBERS
                found = np.array([self.formula(library, *column) for column in joined.T.tolist()])
                return found.T.reshape(-1, *batch)
            except (ArithmeticError, ValueError):
                pass  # where plain numbers have no value arrays have NaN or infinity
        rows = self.formula(np, *chain(*vectors))
        out = np.empty((len(rows), *np.broadcast_shapes(*map(np.shape, rows))), dtype=np.result_type(*rows))
        for i, row in enumerate(rows):
            out[i] = row
        return out
