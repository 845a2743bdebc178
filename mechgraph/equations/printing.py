"""Formulations as documents: block-wise, component-wise, and Lee's table of nonzero coefficients."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mechgraph.document import Block as Piece
from mechgraph.document import Bullets, Document, Equation, Heading, Legend, Paragraph, Table
from mechgraph.equations.symbols import Symbol, Words, moment_of, names_of, summed, written
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


def _dual(letter: str, place: str, name: str = "") -> Symbol:
    return Symbol(letter, place, "dual", name=name)


def _entry(*words: str | Symbol) -> Equation:
    return Equation(written(words), written(words, latex=True))


A = Symbol("A", "k", "vector")
A0 = moment_of(A)
SYMBOLS = (
    (
        _entry(_dual("R", "ab"), "=", "F", "+", "e", "M"),
        "force and moment about the global origin that link a exerts on link b, one dual vector; e times e is zero",
    ),
    (_entry(_dual("R", "ba"), "=", "-", _dual("R", "ab")), "action and reaction"),
    (
        _entry(A),
        "unit vector along the axis of pair k, z of its marker; X and Y along x and y; a prime for every freedom before",
    ),
    (
        _entry(A0, "=", Symbol("P", "k", "vector"), "x", A),
        "its moment about the global origin, P the origin of its frame, for an effort that of the marker on the second link",
    ),
    (
        Equation("A_k + e A0_k", _entry(_dual("A", "k"), "=", A, "+", "e", A0).latex),
        "the axis as a line, what A stands for among dual vectors",
    ),
    (
        _entry(Symbol("F", "k", along="A")),
        "unknown force of pair k along A; likewise along X and Y, and couples M about them",
    ),
    (_entry(_dual("F", "Ib")), "inertia of link b: minus mass times acceleration of its mass centre, and the moment"),
)
"""What the symbols of every formulation mean."""
LEE = (_entry(_dual("F", "ab")), "part of the reaction with no force along and no moment about the axis of the pair")
PITCH = (_entry(Symbol("rho", "k")), "pitch of pair k, advance per radian")
LOADS = (_entry(_dual("F", "Lb")), "loads applied to link b")
DRIVERS = (
    _entry(_dual("F", "IN"), "=", "e", Symbol("M", "IN", along="A"), _dual("A", "k")),
    "what a driver exerts on the second link of its pair k, minus on the first; F in place of e M for a slide",
)
COUPLINGS = (
    _entry(_dual("F", "C", "g,q")),
    "what coupling g exerts in freedom q: its number there times its multiplier, M or F with C(g)",
)


def _symbols(f: Formulation) -> Iterator[tuple[Equation, str]]:
    """The symbols that occur."""
    m = f.mechanism
    yield from SYMBOLS
    if any(u.meaning.startswith("free dual") for u in f.unknowns):
        yield LEE
    if any(pair.pitch is not None for pair in m.pairs):
        yield PITCH
    if m.loads:
        yield LOADS
    if any(u.group == "driver" for u in f.unknowns):
        yield DRIVERS
    if m.couplings:
        yield COUPLINGS


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
            )
        ),
        Legend(tuple(_symbols(f))),
    ]
    for kind, title in SECTIONS:
        mine = [b for b in f.blocks if b.kind == kind]
        if mine:
            blocks.append(Heading(title, 2))
            blocks += [Equation(b.text, b.latex) for b in mine]
    if components:
        blocks.append(Heading("Components", 2))
        blocks += [_numbered(i, _scalar(f, e)) for i, e in enumerate(f.equations, 1)]
    return Document(f"Equations of {m.name}", tuple(blocks))


def _numbered(number: int, words: Words) -> Equation:
    return Equation(f"({number})  {written(words)}", rf"{written(words, latex=True)} \tag{{{number}}}")


def _scalar(f: Formulation, equation: ScalarEquation) -> Words:
    terms = [(f.sign_of(term), (*f.coefficient(term), f.unknowns[term.unknown].symbol)) for term in equation.terms]
    return (*summed([*terms, *(("+", (symbol,)) for symbol in equation.known)]), "=", "0")


def coefficient_rows(f: Formulation) -> Iterator[tuple[str, int, int, str]]:
    """Right sides ``C(row)`` and coefficients ``Q(row, column)`` that are not zero by structure."""
    for i, equation in enumerate(f.equations, 1):
        if equation.known:
            yield f"C({i})", i, 0, written(summed(("-", (symbol,)) for symbol in equation.known))
    for i, equation in enumerate(f.equations, 1):
        cells: dict[int, list[tuple[str, Words]]] = {}
        for term in sorted(equation.terms, key=lambda t: t.unknown):  # a multiplier may act twice on one link
            cells.setdefault(term.unknown, []).append((f.sign_of(term), f.coefficient(term) or ("1",)))
        for unknown, terms in cells.items():
            yield f"Q({i}, {unknown + 1})", i, unknown + 1, written(summed(terms))
