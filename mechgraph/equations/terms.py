"""What a formulation is made of: names of links, pairs and screws, named unknowns, terms, scalar equations and the ledger read off them.

Symbols are Lee's numbers and letters, as text, as LaTeX and as MathML. A system of linear equations is both printed and assembled from
the same terms; its numbers are the screws of all pairs and the wrenches of all links at a batch of positions.
"""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from itertools import chain

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.document import Document, Equation, Paragraph, Shown, Table, latex_words, plain
from mechgraph.errors import DeclarationError, counted
from mechgraph.files import cell, csv_of
from mechgraph.maths.linear import unique_solution
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.factors import Component, Freedom
from mechgraph.quantities import place_among, wrong

LETTERS = {"x": "X", "y": "Y", "z": "A"}
"""Letter of a marker direction: A is the pair axis, as in Lee."""

LATEX_LETTERS = {
    "rho": r"\rho", "theta": r"\theta", "omega": r"\omega", "alpha": r"\alpha", "dS": r"\dot{S}", "ddS": r"\ddot{S}",
    "dV": r"\dot{V}", "w": r"\bar{\omega}", "dw": r"\bar{\alpha}", "v": r"\bar{v}", "dv": r"\dot{\bar{v}}", "a": r"\bar{a}",
    "c": r"\bar{c}", "k": r"\bar{k}", "z": r"\bar{z}", "y": r"\bar{y}",
}  # fmt: skip
"""Letters that are not the same in LaTeX; a bar marks a vector of a link, as in Lee."""


@dataclass(frozen=True, repr=False)
class Symbol:
    r"""One symbol of the equations, the same thing in text and in LaTeX.

    ``FA'_2`` and ``F^{A'}_{2}``: a force of pair 2 along A'; ``A'0_2x`` and ``A'^{0}_{2x}``: x of the moment of A' about the
    origin; ``R_12(B)`` and ``\hat{R}_{12(\text{B})}``: a dual vector, with the name of a pair or freedom in the user's words.

    Attributes
    ----------
    letter, along : what it is, with primes for the frame of a direction, and the direction along which it is counted.
    place, name : what it belongs to, numbers of links or of a pair (none inside the displacement of a pair), and a name where numbers
        do not tell.
    kind : ``"scalar"``, ``"vector"`` or ``"dual"`` (a vector with a moment part).
    moment : the moment of that direction about the origin.
    axis : ``x``, ``y`` or ``z`` of a component.
    """

    letter: str
    place: str
    kind: str = "scalar"
    along: str = ""
    name: str = ""
    moment: bool = False
    axis: str = ""

    def __repr__(self) -> str:
        return f"Symbol({self.text!r})"

    @property
    def text(self) -> str:
        """In plain text."""
        name = f"({self.name})" if self.name else ""
        below = f"_{self.place}" if self.place else ""
        return f"{self.letter}{self.along}{'0' if self.moment else ''}{below}{name}{self.axis}"

    @property
    def latex(self) -> str:
        """In LaTeX, with a hat on a whole dual vector."""
        letter = self.letter.rstrip("'")
        primes = self.letter[len(letter) :]
        shown = LATEX_LETTERS.get(letter) or (letter if len(letter) == 1 else rf"\text{{{latex_words(letter)}}}")
        if self.kind == "dual" and not self.axis:
            shown = rf"\hat{{{shown}}}"
        above = "0" if self.moment else self.along if self.along.strip("AXY-1'") == "" else latex_words(self.along)
        name = rf"(\text{{{latex_words(self.name)}}})" if self.name else ""
        below = f"{self.place}{name}{self.axis}"
        return f"{shown}{primes}{f'^{{{above}}}' if above else ''}{f'_{{{below}}}' if below else ''}"

    def component(self, axis: str) -> Symbol:
        """One component of a vector; a scalar stays what it is."""
        return self if self.kind == "scalar" else replace(self, axis=axis)


Words = tuple["str | Symbol", ...]
"""A product or an equation: symbols, numbers, signs, brackets, ``e`` for epsilon, ``.`` and ``x`` for the products of dual vectors,
``exp(`` for the displacement by a screw."""

LATEX = {"e": r"\epsilon", ".": r"\cdot", "x": r"\times", "exp(": r"\exp("}


def written(words: Iterable[str | Symbol], latex: bool = False) -> str:
    """Words as text or as LaTeX, a blank between them but inside brackets and behind a minus in front."""
    out = ""
    for word in words:
        if isinstance(word, Symbol):
            piece = word.latex if latex else word.text
        else:
            piece = LATEX.get(word, word) if latex else word
        close = not out or piece in (")", ",") or out == "-" or out.endswith(("(", "(-", "= -"))
        out += piece if close else f" {piece}"
    return out


def summed(terms: Iterable[tuple[str, Words]]) -> Words:
    """A sum from signs and products; a plus in front is left out, and a sum of nothing is 0."""
    words = tuple(chain.from_iterable((sign, *product) for sign, product in terms))
    return words[1:] if words[:1] == ("+",) else words or ("0",)


@dataclass(frozen=True)
class LeeNames:
    """Numbers of links (moving ones first, then the frame) and names of the reactions of pairs, both ways round."""

    link_number: dict[str, int]
    reaction: tuple[Symbol, ...]
    opposite: tuple[Symbol, ...]


def names_of(m: Mechanism) -> LeeNames:
    """Lee's numbering: moving links 1, 2, ... in the order of declaration, the frame last; ``R_ab`` is a on b."""
    moving = [name for name in m.link_names() if name != m.frame]
    number = {name: i + 1 for i, name in enumerate([*moving, m.frame])}
    between = Counter(frozenset((p.a, p.b)) for p in m.pairs)

    def ends(first: str, second: str, pair: str) -> Symbol:
        i, j = number[first], number[second]
        place = f"{i}{j}" if max(i, j) < 10 else f"{i},{j}"
        return Symbol("R", place, "dual", name="" if between[frozenset((first, second))] == 1 else pair)

    return LeeNames(
        number,
        tuple(ends(p.a, p.b, p.name) for p in m.pairs),
        tuple(ends(p.b, p.a, p.name) for p in m.pairs),
    )


def direction(k: int, part: Component | Freedom, before: int = 0) -> Symbol:
    """Direction of a component or freedom of pair ``k``, a line: A, X, Y with a prime for every frame, else by its own name.

    The frame of a freedom is that ``before`` it.
    """
    values = part.wrench if isinstance(part, Component) else part.twist
    frame = part.frame if isinstance(part, Component) else before
    nonzero = [i for i, v in enumerate(values) if v]
    plain = len(nonzero) == 1 and values[nonzero[0]] == 1.0
    return Symbol(LETTERS["xyz"[nonzero[0] % 3]] + "'" * frame if plain else part.name, str(k + 1), "dual")


def moment_of(line: Symbol) -> Symbol:
    """The moment of a line about the origin: ``A0_1``."""
    return replace(line, kind="vector", moment=True)


def dual_unit(part: Component) -> Words:
    """Epsilon in front of a couple."""
    return ("e",) if part.is_couple else ()


def factor(number: float) -> Words:
    """A factor in front of a symbol, nothing for one."""
    return () if number == 1 else (f"{number:.12g}",)


OPEN, CLOSE = '<mo stretchy="false">(</mo>', '<mo stretchy="false">)</mo>'
ACCENTS = {"dot": "˙", "ddot": "¨", "bar": "¯", "hat": "^"}
GREEK = {r"\rho": "ρ", r"\theta": "θ", r"\omega": "ω", r"\alpha": "α"}
SIGNS = {
    "e": "<mi>ϵ</mi>",
    ".": "<mo>⋅</mo>",
    "x": "<mo>×</mo>",
    "exp(": f"<mi>exp</mi>{OPEN}",
    "(": OPEN,
    ")": CLOSE,
    "-": "<mo>−</mo>",
}
"""Words that are written otherwise than they stand there."""
COMMAND = re.compile(r"\\(\w+)\{(.*)\}")


def mathml(words: Iterable[str | Symbol]) -> str:
    """Words as the content of a ``math`` element; names in the user's words are escaped."""
    return "".join(_symbol(word) if isinstance(word, Symbol) else _word(word) for word in words)


def _word(word: str) -> str:
    if word in SIGNS:
        return SIGNS[word]
    tag = "mn" if word[:1].isdigit() else "mi" if word.isalpha() else "mo"
    return f"<{tag}>{html.escape(word)}</{tag}>"


def _text(name: str) -> str:
    return f"<mtext>{html.escape(plain(name))}</mtext>"


def _letter(latex: str) -> str:
    r"""A letter with its accents from the few commands that ours have: ``\dot{\bar{v}}``."""
    found = COMMAND.fullmatch(latex)
    if found is None:
        return f"<mi>{html.escape(GREEK.get(latex, latex))}</mi>"
    return f'<mover accent="true">{_letter(found[2])}<mo>{ACCENTS[found[1]]}</mo></mover>'


def _symbol(symbol: Symbol) -> str:
    """A symbol with what stands above and below; a hat on a whole dual vector."""
    letter = symbol.letter.rstrip("'")
    primes = "′" * (len(symbol.letter) - len(letter))
    base = _letter(LATEX_LETTERS.get(letter, letter)) if letter in LATEX_LETTERS or len(letter) == 1 else _text(letter)
    if symbol.kind == "dual" and not symbol.axis:
        base = f'<mover accent="true">{base}<mo>^</mo></mover>'
    along = "0" if symbol.moment else symbol.along
    above = (f"<mo>{primes}</mo>" if primes else "") + (_above(along) if along else "")
    name = f"{OPEN}{_text(symbol.name)}{CLOSE}" if symbol.name else ""
    place = f"<mi>{html.escape(symbol.place)}</mi>" if symbol.place else ""
    below = place.replace("mi>", "mn>") if symbol.place[:1].isdigit() else place
    below += name + (f"<mi>{symbol.axis}</mi>" if symbol.axis else "")
    parts = [base, *(f"<mrow>{part}</mrow>" for part in (below, above) if part)]
    tag = "m" + "sub" * bool(below) + "sup" * bool(above)
    return f"<{tag}>{''.join(parts)}</{tag}>" if below or above else base


def _above(along: str) -> str:
    """A direction, ``A'``, an inverse, or a name in the user's words."""
    if along == "-1":
        return "<mo>−</mo><mn>1</mn>"
    if along == "0":
        return "<mn>0</mn>"
    if along.rstrip("'") in ("A", "X", "Y"):
        return f"<mi>{along[0]}</mi>" + ("<mo>" + "′" * (len(along) - 1) + "</mo>" if len(along) > 1 else "")
    return _text(along)


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
class KnownSymbol:
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
    known: tuple[KnownSymbol, ...] = ()

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


@dataclass(frozen=True, repr=False)
class State:
    """A batch of ``T`` positions (no batch axis is ever dropped here).

    Attributes
    ----------
    coordinates (F, T), velocities (F, T), poses (3, 4, N, T), twists (6, N, T)
    reactions : for every pair the unit wrenches of its components ``(6, 6 - f, T)``.
    efforts : for every pair the effort wrenches ``(6, f, T)``.
    along, conditions : for every pair the axial wrenches and the condition twists of Lee's bookkeeping.
    loads (6, N, T) : inertia and applied wrench of every link.
    coefficients : for every coupling the coefficients of its freedoms ``(terms, 1 or T)``; the declared ones where left out.
    contacts : for every coupling the wrench on its gear b for a unit multiplier ``(6, 1, T)``; ``(6, 0, T)`` for one without gears.
    """

    coordinates: Array
    velocities: Array
    poses: Array
    twists: Array
    reactions: tuple[Array, ...]
    efforts: tuple[Array, ...]
    along: tuple[Array, ...]
    conditions: tuple[Array, ...]
    loads: Array
    coefficients: tuple[Array, ...] = ()
    contacts: tuple[Array, ...] = ()

    def __repr__(self) -> str:
        freedoms, positions = self.coordinates.shape
        return f"{type(self).__name__}({self.loads.shape[1]} links, {freedoms} freedoms, {positions} positions)"

    def of_first(self, pairs: int, freedoms: int) -> State:
        """The same of the first pairs alone, which have so many freedoms."""
        by_pair = {name: getattr(self, name)[:pairs] for name in ("reactions", "efforts", "along", "conditions")}
        return replace(self, coordinates=self.coordinates[:freedoms], velocities=self.velocities[:freedoms], **by_pair)


@dataclass(frozen=True, kw_only=True, repr=False)
class MovingState(State):
    """A batch of positions with rates: what the closure equations and the equations of motion are assembled from, too.

    Attributes
    ----------
    accelerations (F, T)
    freedoms : for every pair the twists of its freedoms ``(6, f, T)``.
    biases (6, P, T) : velocity part of the acceleration of link b against link a, for every pair.
    inertias (6, 6, N, T) : the inertia of every link about the global origin, twist to wrench.
    applied (6, N, T) : the applied part of ``loads``.
    gyroscopic (6, N, T) : the inertia wrench of every link were the accelerations of all freedoms zero.
    row_biases (couplings, T) : velocity part of the second rate of the relation of every coupling, zero of a linear one.
    """

    accelerations: Array
    freedoms: tuple[Array, ...]
    biases: Array
    inertias: Array
    applied: Array
    gyroscopic: Array
    row_biases: Array

    def of_first(self, pairs: int, freedoms: int) -> MovingState:
        """The same of the first pairs alone."""
        first = super().of_first(pairs, freedoms)
        assert isinstance(first, MovingState)
        return replace(
            first,
            accelerations=self.accelerations[:freedoms],
            freedoms=self.freedoms[:pairs],
            biases=self.biases[:, :pairs],
        )


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
        rows, cols, signs, values = np.array(cells).reshape(-1, 4).T
        return rows.astype(np.intp), cols.astype(np.intp), signs.astype(float), values.astype(np.intp)

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
        """Assemble matrix and right side at one position, ``A u = b``.

        Parameters
        ----------
        state : State
            ``s.state(i)`` of a Solution.
        position : int
            Position within the state.

        Returns
        -------
        A : sparse array (equations, unknowns)
            Of scipy.
        b : (equations,) array
            Right side.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("rcsr")
        >>> A, b = mg.formulate(m).assemble(mg.solve(m, {"O1": 2.6}).state())
        >>> A.shape, b.shape
        ((24, 24), (24,))
        """
        return self.matrix(state, position), self.right_side(state)[:, position]

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
        unknown = (self.unknowns[term.unknown].symbol for term in equation.terms)
        terms = [(self.sign_of(t), (*self.coefficient(t), u)) for t, u in zip(equation.terms, unknown, strict=True)]
        return (*summed([*terms, *(("+" if k.sign > 0 else "-", (k.symbol,)) for k in equation.known)]), "=", "0")

    def solve(self, state: State, position: int = 0) -> Array:
        """Solve for the unknowns at one position.

        Redundant equations are allowed. Above 400 unknowns a square system goes through sparse LU.

        Parameters
        ----------
        state : State
            ``s.state(i)`` of a Solution.
        position : int
            Position within the state.

        Returns
        -------
        (unknowns,) array
            NaN for what the equations leave open; all NaN if they conflict.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("7r")
        >>> s, f = mg.solve(m, {"O1": 0.3}), mg.formulate(m, "minimal")
        >>> bool(abs(f.solve(s.state())[-1] - s["O1"].effort[0]) < 1e-12)
        True
        """
        A, b = self.assemble(state, position)
        return unique_solution(A.tocsc(), b)

    def number_rows(self, state: State) -> Iterator[tuple[str, int, int, str]]:
        """The entries of ``coefficient_rows`` with numbers, right sides first."""
        A, b = self.assemble(state, 0)
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
