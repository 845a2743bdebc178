"""A system of linear equations whose terms are both printed and assembled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import place_among
from mechgraph.document import Document, Shown, Table
from mechgraph.equations.state import State
from mechgraph.equations.symbols import Words, factor, summed, written
from mechgraph.equations.terms import Block, ScalarEquation, Screw, Term, Unknown
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.sparse import unique_solution
from mechgraph.quantities import wrong
from mechgraph.writing import cell, csv_of


@dataclass(frozen=True, repr=False)
class LinearSystem:
    """Linear equations of a mechanism: what is printed is what is assembled.

    ``unknowns`` and ``equations`` are scalar; ``blocks`` are the same equations as vectors. Every term names the screw component
    that is its coefficient; ``assemble`` reads that component from a State, ``scalar`` prints its symbol.
    """

    mechanism: Mechanism
    unknowns: tuple[Unknown, ...]
    equations: tuple[ScalarEquation, ...]
    blocks: tuple[Block, ...]
    screws: tuple[Screw, ...]

    def __repr__(self) -> str:
        size = f"{len(self.equations)} equations, {len(self.unknowns)} unknowns"
        return f"{type(self).__name__}({self.mechanism.name!r}, {size})"

    # --- numbers -------------------------------------------------------------------------------------------------------

    @cached_property
    def pattern(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, NDArray[np.intp]]:
        """Rows, columns, signs and value indices of all terms; value 0 is the number one, then six for every screw."""
        cells = [
            (i, t.unknown, t.sign, 0 if t.screw is None else 1 + 6 * t.screw + t.part)
            for i, equation in enumerate(self.equations)
            for t in equation.terms
        ]
        rows, cols, signs, values = zip(*cells, strict=True) if cells else ((), (), (), ())
        return (
            np.array(rows, dtype=np.intp),
            np.array(cols, dtype=np.intp),
            np.array(signs, dtype=float),
            np.array(values, dtype=np.intp),
        )

    def entries(self, state: State) -> Array:
        """Values of all coefficients ``(terms, T)`` in the order of ``pattern``."""
        if not isinstance(state, State):
            raise DeclarationError("assemble", [wrong(state, "state", "a State; s.state(i) of a Solution is one")])
        T = state.loads.shape[2]
        values = np.ones((1 + 6 * len(self.screws), T))
        for i, screw in enumerate(self.screws):
            unit = getattr(state, screw.kind)[screw.pair][:, screw.index]
            if screw.link is not None:
                unit = np.einsum("ijt,jt->it", getattr(state, "inertias")[:, :, screw.link], unit)  # noqa: B009
            values[1 + 6 * i : 7 + 6 * i] = unit
        _, _, signs, index = self.pattern
        out = np.asarray(signs[:, None] * values[index])
        if self.mechanism.couplings:
            out *= self._coupled(state)
        return out

    def _coupled(self, state: State) -> Array:
        """What the numbers of couplings multiply in every term, ``(terms, 1 or T)``; 1 in all other terms."""
        given = state.coefficients or [np.array(c.coefficients)[:, None] for c in self.mechanism.couplings]
        width = max(c.shape[1] for c in given)
        terms = [t.coupling for equation in self.equations for t in equation.terms]
        out = np.ones((len(terms), width))
        for i, place in enumerate(terms):
            if place is not None:
                out[i] = given[place[0]][place[1]]
        return out

    def right_side(self, state: State) -> Array:
        """Right sides ``(equations, T)``: minus what is known."""
        out = np.zeros((len(self.equations), state.loads.shape[2]))
        for i, equation in enumerate(self.equations):
            for known in equation.known:
                if known.array:
                    out[i] -= known.sign * getattr(state, known.array)[known.place]
        return out

    def matrix(self, state: State, position: int = 0) -> scipy.sparse.csr_array:
        """Coefficients ``(len(equations), len(unknowns))`` at one position, sparse."""
        rows, cols, _, _ = self.pattern
        shape = (len(self.equations), len(self.unknowns))
        at = place_among(position, state.loads.shape[2], "position", "equations at a position")
        return scipy.sparse.csr_array((self.entries(state)[:, at], (rows, cols)), shape=shape)

    def assemble(self, state: State, position: int = 0) -> tuple[scipy.sparse.csr_array, Array]:
        """Matrix and right side at one position: ``A u = b``.

        Returns ``A (len(equations), len(unknowns))`` as a scipy sparse array and ``b (len(equations),)``.
        """
        return self.matrix(state, position), self.right_side(state)[:, position]

    def assemble_dense(self, state: State) -> tuple[Array, Array]:
        """Matrices ``(equations, unknowns, T)`` and right sides ``(equations, T)`` of all positions."""
        rows, cols, _, _ = self.pattern
        A = np.zeros((len(self.equations), len(self.unknowns), state.loads.shape[2]))
        np.add.at(A, (rows, cols), self.entries(state))  # a multiplier may act twice on one link
        return A, self.right_side(state)

    # --- words ---------------------------------------------------------------------------------------------------------

    def coefficient(self, term: Term) -> Words:
        """The coefficient of a term without its sign, e.g. ``A_1x``, ``A0_1x`` or ``2 A_1x`` of a coupling; nothing for one."""
        words = () if term.screw is None else self.screws[term.screw].coefficient(term.part)
        return words if term.coupling is None else (*factor(abs(self._number(term.coupling))), *words)

    def sign_of(self, term: Term) -> str:
        """The sign with which a term is printed: that of its number where a coupling gives one."""
        number = 1.0 if term.coupling is None else self._number(term.coupling)
        return "+" if term.sign * number > 0 else "-"

    def _number(self, place: tuple[int, int]) -> float:
        return self.mechanism.couplings[place[0]].coefficients[place[1]]

    def scalar(self, equation: ScalarEquation) -> Words:
        """One scalar equation as it is printed."""
        terms = [
            (self.sign_of(term), (*self.coefficient(term), self.unknowns[term.unknown].symbol))
            for term in equation.terms
        ]
        return (*summed([*terms, *(("+" if k.sign > 0 else "-", (k.symbol,)) for k in equation.known)]), "=", "0")

    def solve(self, state: State, position: int = 0) -> Array:
        """The unknowns ``(len(unknowns),)`` at one position; NaN where the equations leave one open, all where they contradict.

        Redundant equations are no fault. A large square system (above 400 unknowns) goes through sparse LU.
        """
        A, b = self.assemble(state, position)
        return unique_solution(A.tocsc(), b)

    def number_rows(self, state: State, position: int = 0) -> Iterator[tuple[str, int, int, str]]:
        """The entries of ``coefficient_rows`` with numbers, right sides first."""
        A, b = self.assemble(state, position)
        for i, equation in enumerate(self.equations, 1):
            if equation.known:
                yield f"C({i})", i, 0, f"{b[i - 1]:.10g}"
        for i, row in enumerate(self.equations, 1):
            for column in sorted({t.unknown for t in row.terms}):
                yield f"Q({i}, {column + 1})", i, column + 1, f"{A[i - 1, column]:.10g}"

    def coefficient_rows(self, matrix: str = "Q", right: str = "C") -> Iterator[tuple[str, int, int, str]]:
        """Right sides ``C(row)`` and coefficients ``Q(row, column)`` that are not zero by structure."""
        for i, equation in enumerate(self.equations, 1):
            if equation.known:
                known = summed(("-" if k.sign > 0 else "+", (k.symbol,)) for k in equation.known)
                yield f"{right}({i})", i, 0, written(known)
        for i, equation in enumerate(self.equations, 1):
            cells: dict[int, list[tuple[str, Words]]] = {}
            for term in sorted(equation.terms, key=lambda t: t.unknown):  # a multiplier may act twice on one link
                cells.setdefault(term.unknown, []).append((self.sign_of(term), self.coefficient(term) or ("1",)))
            for unknown, terms in cells.items():
                yield f"{matrix}({i}, {unknown + 1})", i, unknown + 1, written(summed(terms))


@dataclass(frozen=True, repr=False)
class CoefficientTable(Shown):
    """Nonzero coefficients: rows ``(entry, row, column, value)``; right sides have column 0."""

    rows: tuple[tuple[str, int, int, str], ...]

    def text(self) -> str:
        """One entry a line, ``Q(1, 1) = 1``."""
        return "\n".join(f"{entry} = {value}" for entry, _, _, value in self.rows) + "\n"

    def csv(self) -> str:
        """The table as CSV: matrix, row, column, value."""
        rows = ((entry.partition("(")[0], row, column or "", cell(value)) for entry, row, column, value in self.rows)
        return csv_of(("matrix", "row", "column", "value"), rows)

    def __len__(self) -> int:
        return len(self.rows)

    def document(self) -> Document:
        """The table as a document."""
        return Document("", (Table(("entry", "value"), [(entry, value) for entry, _, _, value in self.rows]),))

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"CoefficientTable({len(self)} entries; print it)"
