"""What a formulation is made of: named unknowns, terms, scalar equations, and the ledger read off them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mechgraph.document import Document, Equation, Paragraph, Shown, Table
from mechgraph.equations.mathml import mathml
from mechgraph.equations.symbols import Symbol, Words, written
from mechgraph.errors import counted

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Screw:
    """A unit wrench or twist of a pair that appears in coefficients: ``kind`` and ``index`` place it in a State.

    ``real`` and ``dual`` are printed for its real part (force of a wrench, velocity of a twist) and its dual part (moment, rotation),
    a component of each vector in them; empty where that part is zero. With a ``link`` it is the wrench ``I S`` that gives this link the
    acceleration ``S`` of the screw.
    """

    kind: str
    pair: int
    index: int
    real: Words
    dual: Words
    link: int | None = None

    def coefficient(self, part: int) -> Words:
        """Component ``part`` of the screw, 0 to 2 of the dual part and 3 to 5 of the real one; nothing where it is zero."""
        words = self.real if part >= 3 else self.dual
        return tuple(w.component(AXES[part % 3]) if isinstance(w, Symbol) else w for w in words)


@dataclass(frozen=True, repr=False)
class Unknown:
    """An unknown number: a component of a reaction, an effort, or the rate or acceleration of a freedom.

    ``owner`` is the pair or coupling, ``group`` what the ledger books it under, ``couple`` whether it is a moment rather than a
    force (of a rate: a turn rather than a slide); ``freedom`` the freedom of an effort, a rate or an acceleration.
    """

    symbol: Symbol
    owner: str
    group: str
    couple: bool
    meaning: str
    freedom: str = ""

    @property
    def name(self) -> str:
        """Its symbol in plain text, ``FA_1``."""
        return self.symbol.text

    def __repr__(self) -> str:
        return f"Unknown({self.name!r}, {self.meaning!r})"


@dataclass(frozen=True)
class Term:
    """``sign * coefficient * unknown``: the coefficient is component ``part`` of ``screw`` (0-2 dual, 3-5 real), or 1.

    The multiplier of a coupling acts in a freedom with that coefficient times ``c``, which ``coupling`` places: the ``coupling[1]``-th
    number of the ``coupling[0]``-th coupling.
    """

    unknown: int
    sign: float
    screw: int | None = None
    part: int = 0
    coupling: tuple[int, int] | None = None


@dataclass(frozen=True)
class Known:
    """``sign * symbol``, a known number in an equation: ``place`` in the ``array`` of a State; no array where the one before has it too."""

    symbol: Symbol
    array: str
    place: tuple[int, ...]
    sign: float = 1.0


@dataclass(frozen=True, repr=False)
class ScalarEquation:
    """One scalar equation ``sum of terms + known = 0``; ``link`` and ``part`` of the wrench that it balances, in one of a link."""

    name: str
    owner: str
    group: str
    terms: tuple[Term, ...]
    link: int | None = None
    part: int = 0
    known: tuple[Known, ...] = ()

    def __repr__(self) -> str:
        return f"ScalarEquation({self.name!r}, {counted(len(self.terms), 'term')})"


@dataclass(frozen=True, repr=False)
class Block(Shown):
    """A vector equation as it is printed block-wise: equilibrium of a link, condition of a pair, a closure, or a definition.

    ``kind`` is ``"link"``, ``"condition"``, ``"reaction"``, ``"effort"`` or ``"coupling"`` of the force equations; ``"position"``,
    ``"velocity"`` or ``"acceleration"`` of a closure; ``"bias"``, ``"twist"``, ``"inertia"`` or ``"influence"`` of what defines a symbol.
    """

    words: Words
    kind: str
    owner: str

    @property
    def text(self) -> str:
        """In plain text."""
        return written(self.words)

    @property
    def latex(self) -> str:
        """In LaTeX."""
        return written(self.words, latex=True)

    def __repr__(self) -> str:
        return f"Block({self.kind!r}, {self.text!r})"

    @property
    def equation(self) -> Equation:
        """In all forms."""
        return Equation(self.text, self.latex, self.mathml)

    def document(self) -> Document:
        """The equation."""
        return Document("", (self.equation,))

    @property
    def mathml(self) -> str:
        """The content of a MathML element."""
        return mathml(self.words)


@dataclass(frozen=True)
class LedgerRow:
    """One line of the ledger: ``count`` things of one kind and the unknowns and equations that they bring together."""

    count: int
    unknowns: int
    equations: int


@dataclass(frozen=True, repr=False)
class Ledger(Shown):
    """Unknowns against equations by kind: pair symbols, ``coupling``, ``driver``, ``link`` (moving), and of a response ``acceleration``
    and ``closure``; read off the registry.

    ``balance = equations - unknowns = mobility by count - drivers``: zero is determinate by count, positive leaves freedoms
    undriven, negative is redundant.
    """

    bookkeeping: str
    by_kind: Mapping[str, LedgerRow]

    @property
    def unknowns(self) -> int:
        """Sum of unknowns."""
        return sum(row.unknowns for row in self.by_kind.values())

    @property
    def equations(self) -> int:
        """Sum of equations."""
        return sum(row.equations for row in self.by_kind.values())

    @property
    def balance(self) -> int:
        """Equations minus unknowns."""
        return self.equations - self.unknowns

    def table(self, align: str = "lrrr") -> Table:
        """The kinds as a table."""
        rows = [(kind, *map(str, (row.count, row.unknowns, row.equations))) for kind, row in self.by_kind.items()]
        return Table(("kind", "count", "unknowns", "equations"), rows, align)

    def document(self) -> Document:
        """The kinds and the balance."""
        total = f"{self.unknowns} unknowns, {self.equations} equations, balance {self.balance}."
        return Document(f"Ledger in the bookkeeping {self.bookkeeping}", (self.table(), Paragraph(total)))
