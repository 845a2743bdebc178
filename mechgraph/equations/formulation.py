"""A formulation: all that is solved, as named unknowns and equations that are both printed and assembled."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

from mechgraph.document import Document, Shown, to_html, to_latex, to_latex_file, to_markdown, to_text
from mechgraph.equations.printing import Printed, formulation_document
from mechgraph.equations.state import State
from mechgraph.equations.system import CoefficientTable
from mechgraph.writing import Format, format_of, write_whole

IN_COMPONENTS = 200
"""Unknowns up to which a notebook shows the equations in components too."""


@dataclass(frozen=True)
class Formulation(Printed, Shown):
    """The equations of a mechanism: what is printed is what is assembled.

    ``unknowns`` and ``equations`` are the scalar force equations (in a response with the accelerations and their closure), ``blocks``
    the same as vectors; ``closure`` holds the closure equations of position, velocity and acceleration. Every term names the
    screw component that is its coefficient; ``assemble`` reads that component from a State, ``text`` prints its symbol.
    """

    def document(self, components: bool = True) -> Document:
        """The printed formulation as a document."""
        return formulation_document(self, components)

    def text(self, components: bool = True) -> str:
        """Block-wise and component-wise equations as plain text."""
        return to_text(self.document(components))

    def latex(self, components: bool = True) -> str:
        """Block-wise and component-wise equations as LaTeX."""
        return to_latex(self.document(components))

    def write(self, path: str | os.PathLike[str], components: bool = True) -> None:
        """Write it, whole or not at all, as the suffix says: ``.tex`` a LaTeX file that compiles, ``.txt`` text, ``.md`` Markdown, ``.csv``
        the coefficients.

        Raises
        ------
        FileError
            for another suffix, or where the file cannot be written.
        """
        format_of(path, FORMATS).write(self, path, components)

    def coefficients(self, state: State | None = None) -> CoefficientTable:
        """The nonzero coefficients ``Q(row, column)`` and right sides ``C(row)``, as Lee's Table XIV lists them.

        With a State (``s.state(i)`` of a Solution) their numbers at its position, and those of the unknowns ``u(column)``, NaN where
        they are not unique.
        """
        if state is None:
            return CoefficientTable(tuple(self.coefficient_rows()))
        u = [(f"u({i})", 0, i, f"{value:.10g}") for i, value in enumerate(self.solve(state), 1)]
        return CoefficientTable((*self.number_rows(state), *u))

    def closure_coefficients(self) -> CoefficientTable:
        """The same of the closure: ``N(row, column)`` of the rates and accelerations (2.47, 2.60), right sides ``B(row)`` of the latter."""
        return CoefficientTable(tuple(self.closure.acceleration.coefficient_rows("N", "B")))

    def __repr__(self) -> str:
        return (
            f"Formulation({self.mechanism.name!r}, {self.bookkeeping!r}, {len(self.equations)} equations, "
            f"{len(self.unknowns)} unknowns)"
        )

    def _repr_html_(self) -> str:
        return to_html(self.document(components=len(self.unknowns) <= IN_COMPONENTS))

    def _repr_latex_(self) -> str:
        return self.latex(components=len(self.unknowns) <= IN_COMPONENTS)


def _as(text: Callable[[Document], str]) -> Callable[..., None]:
    """The writer of a rendering of the document."""
    return lambda f, path, components: write_whole(path, [text(f.document(components))])


FORMATS = (
    Format("LaTeX", (".tex",), _as(to_latex_file)),
    Format("text", (".txt",), _as(to_text)),
    Format("Markdown", (".md",), _as(to_markdown)),
    Format("coefficients as CSV", (".csv",), lambda f, path, _: write_whole(path, [f.coefficients().csv()])),
)
"""What a formulation can be written as."""
