"""Formulations as documents: block-wise, component-wise, and Lee's table of nonzero coefficients."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mechgraph.document import Block as Piece
from mechgraph.document import Bullets, Document, Equation, Heading, Paragraph, Table
from mechgraph.equations.symbols import names_of, subscript
from mechgraph.equations.terms import ScalarEquation

if TYPE_CHECKING:
    from mechgraph.equations.formulation import Formulation

SECTIONS = (
    ("reaction", "Reactions of the pairs"),
    ("effort", "Driver efforts"),
    ("coupling", "Couplings"),
    ("link", "Equations of motion"),
    ("condition", "Conditions at the pairs"),
)
COUPLINGS = "F_C(g, q): what the multiplier M_C(g) or F_C(g) of the coupling g exerts on link b in the freedom q"
"""What the symbols of couplings mean."""


def formulation_document(f: Formulation, components: bool) -> Document:
    """All equations of a formulation, with what the symbols mean."""
    m = f.mechanism
    numbers = names_of(m).link_number
    ledger = f.ledger()
    count = f"{len(f.unknowns)} unknowns, {len(f.equations)} equations"
    blocks: list[Piece] = [
        Paragraph(f"Bookkeeping {f.bookkeeping}: {count}."),
        Table(
            ("kind", "count", "unknowns", "equations"),
            tuple((k, str(r.count), str(r.unknowns), str(r.equations)) for k, r in ledger.by_kind.items()),
        ),
        Heading("Symbols", 2),
        Bullets(
            (
                "links: " + ", ".join(f"{number} = {name}" for name, number in numbers.items()),
                "pairs: " + ", ".join(f"{k + 1} = {p.name} ({p.type.symbol})" for k, p in enumerate(m.pairs)),
                "R_ab: dual force F + e M that link a exerts on link b, M about the global origin; R_ba = -R_ab",
                "F_I: inertia of a link, -(m a) and its moment; F_A: applied loads; F_IN: what a driver exerts on link b",
                "A: pair axis, X and Y: the other directions of the marker (primes: frame after so many freedoms); "
                "A0 = P x A its moment about the origin, P the origin of its frame",
                *([COUPLINGS] if m.couplings else []),
                *(s.meaning for s in f.screws if "{}" in s.dual),
            )
        ),
    ]
    for kind, title in SECTIONS:
        mine = [b for b in f.blocks if b.kind == kind]
        if mine:
            blocks.append(Heading(title, 2))
            blocks += [Equation(b.text, b.latex) for b in mine]
    if components:
        blocks.append(Heading("Components", 2))
        blocks += [
            Equation(f"({i + 1})  {_scalar(f, e, False)}", _scalar(f, e, True)) for i, e in enumerate(f.equations)
        ]
    return Document(f"Equations of {m.name}", tuple(blocks))


def _scalar(f: Formulation, equation: ScalarEquation, latex: bool) -> str:
    parts = []
    for term in equation.terms:
        symbols = [s for s in (f.coefficient_symbol(term), f.unknowns[term.unknown].name) if s]
        parts.append(("+" if f.sign_of(term) > 0 else "-", " ".join(subscript(s) if latex else s for s in symbols)))
    parts += [("+", subscript(name) if latex else name) for name in equation.known]
    if not parts:
        return "0 = 0"
    text = "".join(f" {sign} {symbol}" for sign, symbol in parts)
    return (text[3:] if text.startswith(" + ") else text.strip()) + " = 0"


def coefficient_rows(f: Formulation) -> Iterator[tuple[str, int, int, str]]:
    """Right sides ``C(row)`` and coefficients ``Q(row, column)`` that are not zero by structure."""
    for i, equation in enumerate(f.equations, 1):
        if equation.known:
            yield f"C({i})", i, 0, "-" + " - ".join(equation.known)
    for i, equation in enumerate(f.equations, 1):
        cells: dict[int, str] = {}
        for term in sorted(equation.terms, key=lambda t: t.unknown):
            value, minus = f.coefficient_symbol(term) or "1", f.sign_of(term) < 0
            before = cells.get(term.unknown)  # a multiplier may act twice on one link
            joined = f"{before} {'-' if minus else '+'} {value}"
            cells[term.unknown] = ("-" if minus else "") + value if before is None else joined
        for unknown, value in cells.items():
            yield f"Q({i}, {unknown + 1})", i, unknown + 1, value
