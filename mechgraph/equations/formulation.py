"""A formulation: named unknowns and equations whose terms are both printed and assembled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.document import Document, to_html, to_latex, to_text
from mechgraph.equations.printing import coefficient_rows, formulation_document
from mechgraph.equations.state import State
from mechgraph.equations.symbols import Words, factor
from mechgraph.equations.terms import Block, Ledger, LedgerRow, ScalarEquation, Screw, Term, Unknown
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import wrong
from mechgraph.writing import cell, csv_of


@dataclass(frozen=True)
class Formulation:
    """The d'Alembert equations of a mechanism: what is printed is what is solved.

    ``unknowns`` and ``equations`` are scalar; ``blocks`` are the same equations as vectors. Every term names the screw component
    that is its coefficient; ``assemble`` reads that component from a State, ``text`` prints its symbol.
    """

    mechanism: Mechanism
    bookkeeping: str
    unknowns: tuple[Unknown, ...]
    equations: tuple[ScalarEquation, ...]
    blocks: tuple[Block, ...]
    screws: tuple[Screw, ...]

    # --- counting ------------------------------------------------------------------------------------------------------

    def ledger(self) -> Ledger:
        """The ledger: unknowns and equations by kind."""
        groups: dict[str, int] = {}
        for pair in self.mechanism.pairs:
            groups[pair.type.symbol] = groups.get(pair.type.symbol, 0) + 1
        if self.mechanism.couplings:
            groups["coupling"] = len(self.mechanism.couplings)
        groups["driver"] = sum(u.group == "driver" for u in self.unknowns)
        groups["link"] = len(self.mechanism.links) - 1
        rows = {
            name: LedgerRow(
                count,
                sum(u.group == name for u in self.unknowns),
                sum(e.group == name for e in self.equations),
            )
            for name, count in groups.items()
        }
        return Ledger(self.bookkeeping, rows)

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
            values[1 + 6 * i : 7 + 6 * i] = getattr(state, screw.kind)[screw.pair][:, screw.index]
        _, _, signs, index = self.pattern
        out = np.asarray(signs[:, None] * values[index])
        if self.mechanism.couplings:
            out *= self._coupled(state)
        return out

    def _coupled(self, state: State) -> Array:
        """What the multipliers of couplings are multiplied by in every term, ``(terms, 1 or T)``; 1 in all other terms."""
        given = state.coefficients or [np.array(c.coefficients)[:, None] for c in self.mechanism.couplings]
        width = max(c.shape[1] for c in given)
        terms = [t.coupling for equation in self.equations for t in equation.terms]
        out = np.ones((len(terms), width))
        for i, place in enumerate(terms):
            if place is not None:
                out[i] = given[place[0]][place[1]]
        return out

    def right_side(self, state: State) -> Array:
        """Right sides ``(equations, T)``: minus the inertia and applied wrenches."""
        out = np.zeros((len(self.equations), state.loads.shape[2]))
        for i, equation in enumerate(self.equations):
            if equation.link is not None:
                out[i] = -state.loads[equation.part, equation.link]
        return out

    def assemble(self, state: State, position: int = 0) -> tuple[scipy.sparse.csr_array, Array]:
        """Matrix and right side at one position: ``A u = b``.

        Returns ``A (len(equations), len(unknowns))`` as a scipy sparse array and ``b (len(equations),)``.
        """
        rows, cols, _, _ = self.pattern
        shape = (len(self.equations), len(self.unknowns))
        A = scipy.sparse.csr_array((self.entries(state)[:, position], (rows, cols)), shape=shape)
        return A, self.right_side(state)[:, position]

    def assemble_dense(self, state: State) -> tuple[Array, Array]:
        """Matrices ``(equations, unknowns, T)`` and right sides ``(equations, T)`` of all positions."""
        rows, cols, _, _ = self.pattern
        A = np.zeros((len(self.equations), len(self.unknowns), state.loads.shape[2]))
        np.add.at(A, (rows, cols), self.entries(state))  # a multiplier may act twice on one link
        return A, self.right_side(state)

    # --- print -------------------------------------------------------------------------------------------------------

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

    def document(self, components: bool = True) -> Document:
        """The printed formulation as a document."""
        return formulation_document(self, components)

    def text(self, components: bool = True) -> str:
        """Block-wise and component-wise equations as plain text."""
        return to_text(self.document(components))

    def latex(self, components: bool = True) -> str:
        """Block-wise and component-wise equations as LaTeX."""
        return to_latex(self.document(components))

    def coefficients(self) -> CoefficientTable:
        """The nonzero coefficients ``Q(row, column)`` and right sides ``C(row)``, as Lee's Table XIV lists them."""
        return CoefficientTable(tuple(coefficient_rows(self)))

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return (
            f"Formulation({self.mechanism.name!r}, {self.bookkeeping!r}, {len(self.equations)} equations, "
            f"{len(self.unknowns)} unknowns)"
        )

    def _repr_html_(self) -> str:
        return to_html(self.document())


@dataclass(frozen=True)
class CoefficientTable:
    """Nonzero coefficients: rows ``(entry, row, column, value)``; right sides have column 0."""

    rows: tuple[tuple[str, int, int, str], ...]

    def text(self) -> str:
        """One entry a line, ``Q(1, 1) = 1``."""
        return "\n".join(f"{entry} = {value}" for entry, _, _, value in self.rows) + "\n"

    def csv(self) -> str:
        """The table as CSV: matrix, row, column, value."""
        rows = ((entry[0], row, column or "", cell(value)) for entry, row, column, value in self.rows)
        return csv_of(("matrix", "row", "column", "value"), rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __str__(self) -> str:
        return self.text()
