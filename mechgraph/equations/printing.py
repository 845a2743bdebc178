"""Formulations as documents: closure, motion, forces, block-wise and component-wise, and the list of unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from mechgraph.document import Block as Piece
from mechgraph.document import Bullets, Document, Equation, Heading, Legend, Paragraph, Table
from mechgraph.equations.mathml import mathml
from mechgraph.equations.motion import Closure, closure_of
from mechgraph.equations.symbols import Symbol, Words, moment_of, names_of, written
from mechgraph.equations.system import LinearSystem
from mechgraph.equations.terms import Ledger, LedgerRow, ScalarEquation, Term
from mechgraph.model.factors import ConstantScrew

SECTIONS = (
    ("reaction", "Reactions of the pairs (3.34 to 3.37)"),
    ("effort", "Driver efforts (3.42)"),
    ("coupling", "Couplings"),
    ("link", "Equations of motion (3.33)"),
    ("condition", "Conditions at the pairs (3.38 to 3.40)"),
    ("influence", "Accelerations as unknowns (3.57 to 3.64)"),
    ("prescribed", "Prescribed accelerations"),
)


@dataclass(frozen=True, repr=False)
class Printed(LinearSystem):
    """What a formulation is printed from: its equations and its closure, and how they are counted.

    ``acts`` are the terms with which every pair acts on its link b.
    """

    bookkeeping: str
    sought: str
    acts: tuple[tuple[Term, ...], ...]

    @cached_property
    def closure(self) -> Closure:
        """The closure equations of position, velocity and acceleration, and what defines their symbols."""
        return closure_of(self.mechanism)

    @cached_property
    def transmitted(self) -> LinearSystem:
        """What the pairs transmit as functions of the unknowns: six rows a pair, ``A u`` the wrench of link a on link b."""
        rows = [
            ScalarEquation("", pair.name, "", tuple(t for t in act if t.part == part), None, part)
            for pair, act in zip(self.mechanism.pairs, self.acts, strict=True)
            for part in range(6)
        ]
        return LinearSystem(self.mechanism, self.unknowns, tuple(rows), (), self.screws)

    def ledger(self) -> Ledger:
        """The ledger: unknowns and equations by kind."""
        groups: dict[str, int] = {}
        for pair in self.mechanism.pairs:
            groups[pair.type.symbol] = groups.get(pair.type.symbol, 0) + 1
        if self.mechanism.couplings:
            groups["coupling"] = len(self.mechanism.couplings)
        groups["driver"] = sum(u.group == "driver" for u in self.unknowns)
        groups["link"] = len(self.mechanism.links) - 1
        if self.sought == "response":
            groups["acceleration"] = sum(u.group == "acceleration" for u in self.unknowns)
            groups["closure"] = len({e.owner for e in self.equations if e.group == "closure"})
        rows = {
            name: LedgerRow(
                count,
                sum(u.group == name for u in self.unknowns),
                sum(e.group == name for e in self.equations),
            )
            for name, count in groups.items()
        }
        return Ledger(self.bookkeeping, rows)


def _dual(letter: str, place: str, name: str = "") -> Symbol:
    return Symbol(letter, place, "dual", name=name)


def _entry(*words: str | Symbol) -> Equation:
    return Equation(written(words), written(words, latex=True), mathml(words))


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
        replace(_entry(_dual("A", "k"), "=", A, "+", "e", A0), text="A_k + e A0_k"),
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
CONTACTS = (
    _entry(_dual("F", "C", "g"), "=", Symbol("M", "C", name="g"), _dual("G", "C", "g")),
    "force of gears g on the second one, minus that on the first: their line of contact, for a unit multiplier, times the multiplier",
)
CONSTANT = (_entry(Symbol("K", "C", name="g")), "the constant of coupling g")


def _vector(letter: str, place: str = "b") -> Symbol:
    return Symbol(letter, place, "vector")


MOTION = (
    (
        _entry(*(word for letter in ("theta", "omega", "alpha") for word in (Symbol(letter, "k"), ",")), "..."),
        "angle of pair k, its rate and acceleration; S, dS, ddS for a slide; with a direction where pair k has several",
    ),
    (
        _entry("exp(", Symbol("theta", "k"), _dual("A", ""), ")"),
        "displacement by theta about A, a slide for e S A; A, X, Y there are axes of the frame before it",
    ),
    (
        _entry(Symbol("L", "b", name="k,l")),
        "shape of link b: pose of the marker of pair l on it, seen from the marker of pair k on it",
    ),
    (
        _entry(_dual("V", "b"), "=", _vector("w"), "+", "e", _vector("v")),
        "twist of link b: angular velocity, and velocity of its point at the global origin",
    ),
    (_entry(_dual("dV", "b"), "=", _vector("dw"), "+", "e", _vector("dv")), "rate of the twist of link b"),
    (
        _entry(_dual("N", "k")),
        "velocity part of the acceleration of pair k (N_5 of 2.60); among components N0 is its dual part",
    ),
    (
        _entry(Symbol("m", "b"), ",", _vector("c"), ",", _vector("a"), ",", _vector("I")),
        "mass of link b, position and acceleration of its mass centre, inertia about it in global directions, turning with the link",
    ),
)
"""What the symbols of closure and motion mean."""
VARYING = (
    _entry(Symbol("W", "k", "dual", name="dS")),
    "own rate of a screw that is not constant in its frame; D the displacement that it belongs to",
)
RESPONSE = (
    (
        _entry(Symbol("K", "b,k", "vector", along="A"), ",", Symbol("H", "b,k", "vector", along="A")),
        "acceleration of mass centre b, rate of the moment of momentum of link b about the origin, for a unit acceleration of pair k",
    ),
    (
        _entry(_dual("F", "Bb")),
        "inertia of link b were the accelerations of all freedoms zero; k, z, y are a, dw, dv then",
    ),
)


def _symbols(f: Printed) -> Iterator[tuple[Equation, str]]:
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
    if any(not c.steps for c in m.couplings):
        yield COUPLINGS
    if any(c.steps for c in m.couplings):
        yield CONTACTS
    if m.couplings:
        yield CONSTANT
    yield from MOTION
    if not all(isinstance(step, ConstantScrew) or step.holds_rotation for p in m.pairs for step in p.type.steps):
        yield VARYING
    if f.sought == "response":
        yield from RESPONSE


def formulation_document(f: Printed, components: bool) -> Document:
    """All equations of a formulation, with what the symbols mean: closure, motion, forces, then the components and the unknowns."""
    m = f.mechanism
    numbers = names_of(m).link_number
    count = f"{len(f.unknowns)} unknowns, {len(f.equations)} equations"
    blocks: list[Piece] = [
        Paragraph(f"Bookkeeping {f.bookkeeping}, {f.sought}: {count}. Numbers in brackets are those of Lee (1977)."),
        f.ledger().table("llll"),
        Heading("Symbols", 2),
        Bullets(
            (
                "links: " + ", ".join(f"{number} = {name}" for name, number in numbers.items()),
                "pairs: " + ", ".join(f"{k + 1} = {p.name} ({p.type.symbol})" for k, p in enumerate(m.pairs)),
            )
        ),
        Legend(tuple(_symbols(f))),
    ]
    closure = f.closure
    forces = [(title, [b for b in f.blocks if b.kind == kind]) for kind, title in SECTIONS]
    for title, mine in (
        ("Displacement closure (2.19)", closure.position),
        ("Velocity closure (2.47)", closure.velocity.blocks),
        ("Acceleration closure (2.60)", closure.acceleration.blocks),
        ("Motion of the links", closure.motion),
        ("Inertia (3.22, 3.30, 3.32)", closure.inertia),
        *forces,
    ):
        if mine:
            blocks.append(Heading(title, 2))
            blocks += [b.equation for b in mine]
    blocks.append(Heading("Unknowns (3.52)", 2))
    rows = tuple((str(i), u.name, u.meaning) for i, u in enumerate(f.unknowns, 1))
    blocks.append(Table(("column", "unknown", "meaning"), rows, align="rll"))
    if components:
        blocks += _components("Components of the velocity closure", closure.velocity, "V")
        blocks += _components("Components of the acceleration closure", closure.acceleration, "A")
        blocks += _components("Components", f, "")
    return Document(f"Equations of {m.name}", tuple(blocks))


def _components(title: str, system: LinearSystem, mark: str) -> list[Piece]:
    if not system.equations:
        return []
    numbered = (_numbered(f"{mark}{i}", system.scalar(e)) for i, e in enumerate(system.equations, 1))
    return [Heading(title, 2), *numbered]


def _numbered(number: str, words: Words) -> Equation:
    shown = f'<mtext>({number})</mtext><mspace width="1em"/>{mathml(words)}'
    return Equation(f"({number})  {written(words)}", rf"{written(words, latex=True)} \tag{{{number}}}", shown)
