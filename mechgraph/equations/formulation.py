"""A formulation: all that is solved, as named unknowns and equations that are both printed and assembled; documents of it.

How the motion is written: twists are dual vectors ``w + e v``, v the velocity of the body point at the global origin: a turn at the rate
omega about the line A is ``omega A``, a slide along it ``e dS A``. Successive displacements and their rates: Lee 1977, sections 2.2, 2.3
and 2.6.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property

from mechgraph.document import Block as Piece
from mechgraph.document import (
    Bullets,
    Document,
    Equation,
    Heading,
    Legend,
    Paragraph,
    Shown,
    Table,
    to_html,
    to_latex,
    to_latex_file,
    to_markdown,
    to_text,
)
from mechgraph.equations.terms import (
    AXES,
    Block,
    CoefficientTable,
    KnownSymbol,
    Ledger,
    LedgerRow,
    LeeNames,
    LinearSystem,
    ScalarEquation,
    Screw,
    State,
    Symbol,
    Term,
    Unknown,
    Words,
    direction,
    factor,
    mathml,
    moment_of,
    names_of,
    summed,
    written,
)
from mechgraph.errors import counted
from mechgraph.files import Format, format_of, write_whole
from mechgraph.graph.linkgraph import LinkGraph, link_graph
from mechgraph.memo import dataclass
from mechgraph.model.gears import moving_lines
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.pairs.factors import ConstantScrew

POSITION, RATE, ACCELERATION = range(3)
LETTERS = {True: ("theta", "omega", "alpha"), False: ("S", "dS", "ddS")}
"""Letters of position, rate and acceleration, of a turn and of a slide."""
KINDS = ("position", "velocity", "acceleration")

Signed = tuple[str, Words]


@dataclass(frozen=True)
class FreedomSymbols:
    """One freedom of a pair in symbols: ``numbers`` of its position, rate and acceleration, the ``line`` of its screw.

    ``factor`` is its place among the factors of the pair, ``constant`` whether its screw is constant in the frame before it, ``slides``
    whether it is a slide, ``pitched`` whether a pitch makes its turn helical.
    """

    name: str
    numbers: tuple[Symbol, Symbol, Symbol]
    line: Symbol
    factor: int
    constant: bool
    slides: bool
    pitched: bool

    def twist(self, which: int, line: Symbol | None = None) -> Words:
        """Its part of a twist (or of a rate of one): ``omega_1 A_1``, ``e dS_2 A_2``, ``(1 + e rho_3) omega_3 A_3``."""
        words = (self.numbers[which], line or self.line)
        if self.slides:
            return ("e", *words)
        return ("(", "1", "+", "e", Symbol("rho", self.line.place), ")", *words) if self.pitched else words

    def screw(self, kind: str, k: int, index: int) -> Screw:
        """Its unit twist among coefficients."""
        if self.slides:
            return Screw(kind, k, index, (self.line,), ())
        moment = moment_of(self.line)
        pitch: Words = ("(", moment, "+", Symbol("rho", self.line.place), self.line, ")")
        return Screw(kind, k, index, pitch if self.pitched else (moment,), (self.line,))


def _moving(k: int, pair: Pair) -> tuple[FreedomSymbols, ...]:
    row = pair.type
    alone = {turns: sum(f.turns == turns for f in row.freedoms) == 1 for turns in (True, False)}
    out = []
    for number, (step, places) in enumerate(zip(row.steps, row.factors, strict=True)):
        constant = isinstance(step, ConstantScrew) or step.holds_rotation
        for j in places:
            freedom, before = row.freedoms[j], row.frame_before[j]
            along_line = freedom.per_pitch[3:] == freedom.twist[:3]
            if constant and (along_line or not any(freedom.per_pitch)):
                line = direction(k, freedom, before)
            else:
                line = Symbol(freedom.name + "'" * before, str(k + 1), "dual")
            along = "" if alone[freedom.turns] else line.letter
            first, second, third = (Symbol(letter, line.place, along=along) for letter in LETTERS[freedom.turns])
            slides, pitched = constant and not freedom.turns, constant and any(freedom.per_pitch) and along_line
            name = f"{pair.name}.{freedom.name}"
            out.append(FreedomSymbols(name, (first, second, third), line, number, constant, slides, pitched))
    return tuple(out)


class MotionWords:
    """The motion of a mechanism in words; what depends on the graph alone is found first."""

    def __init__(self, m: Mechanism) -> None:
        self.m = m
        self.names: LeeNames = names_of(m)
        self.graph: LinkGraph = link_graph(m)
        self.freedoms = tuple(_moving(k, pair) for k, pair in enumerate(m.pairs))
        self.first = [0]
        for freedoms in self.freedoms:
            self.first.append(self.first[-1] + len(freedoms))

    def of_link(self, letter: str, link: str, kind: str = "vector") -> Symbol:
        """A symbol of a link."""
        return Symbol(letter, str(self.names.link_number[link]), kind)

    def unknowns(self, which: int) -> list[Unknown]:
        """Rates or accelerations of all freedoms."""
        what = {RATE: "rate", ACCELERATION: "acceleration"}[which]
        return [
            Unknown(f.numbers[which], pair.name, KINDS[which], not f.slides, f"{what} of {f.name}", f.name)
            for pair, freedoms in zip(self.m.pairs, self.freedoms, strict=True)
            for f in freedoms
        ]

    # --- pairs ---------------------------------------------------------------------------------------------------------

    def relative(self, k: int, which: int, sign: int = 1) -> list[Signed]:
        """Terms of the twist of link b against link a of pair ``k``, or of its rate (with the bias)."""
        mark = "+" if sign > 0 else "-"
        terms = [(mark, f.twist(which)) for f in self.freedoms[k]]
        return [*terms, (mark, (self.bias(k),))] if which == ACCELERATION and self.bias_terms(k) else terms

    def bias(self, k: int) -> Symbol:
        """Velocity part of the acceleration of link b against link a, a dual vector."""
        return Symbol("N", str(k + 1), "dual")

    def bias_terms(self, k: int) -> list[Signed]:
        """``V x (twist)`` for every factor, V the twist of the frame before it; the own rate of a screw that is not constant."""
        pair, out = self.m.pairs[k], []
        carriers: list[Signed] = [] if pair.a == self.m.frame else [("+", (self.of_link("V", pair.a, "dual"),))]
        for number, step in enumerate(pair.type.steps):
            mine = [f for f in self.freedoms[k] if f.factor == number]
            turning: list[Signed] = [("+", f.twist(RATE)) for f in mine]
            if carriers:
                out.append(("+", (*_bracketed(carriers), "x", *_bracketed(turning))))
            if not (isinstance(step, ConstantScrew) or step.holds_rotation):
                own = ", ".join(f.numbers[RATE].text for f in mine)
                out.append(("+", (Symbol("W", str(k + 1), "dual", name=own),)))
            carriers = carriers + turning
        return out

    def displacement(self, k: int, sign: int) -> Words:
        """The displacement of pair ``k`` as a product of screw displacements, seen from b where ``sign`` is -1."""
        out: list[Words] = []
        for number, step in enumerate(self.m.pairs[k].type.steps):
            mine = [f for f in self.freedoms[k] if f.factor == number]
            if isinstance(step, ConstantScrew) or step.holds_rotation:
                mark = "+" if sign > 0 else "-"
                lines = [replace(f.line, place="", letter=f.line.letter.rstrip("'")) for f in mine]
                terms = [(mark, f.twist(POSITION, line)) for f, line in zip(mine, lines, strict=True)]
                out.append(("exp(", *summed(terms), ")"))
            else:
                of = ", ".join(f.numbers[POSITION].text for f in mine)
                out.append((Symbol("D", str(k + 1), along="" if sign > 0 else "-1", name=of),))
        return tuple(word for words in (out if sign > 0 else out[::-1]) for word in words)

    # --- closure -------------------------------------------------------------------------------------------------------

    def position_blocks(self) -> Iterator[Block]:
        """The displacement closure of every loop, ``exp(theta_1 A) L_1(1,2) exp(theta_2 A) ... = 1``, and of every coupling."""
        for i, loop in enumerate(self.graph.loops):
            words: list[str | Symbol] = []
            for (k, sign), (following, _) in zip(loop, (*loop[1:], loop[0]), strict=True):
                pair = self.m.pairs[k]
                link = self.of_link("L", pair.b if sign > 0 else pair.a)
                words += [*self.displacement(k, sign), replace(link, name=f"{k + 1},{following + 1}")]
            yield Block((*words, "=", "1"), KINDS[POSITION], self.loop_name(i))
        for g, coupling in enumerate(self.m.couplings):
            constant = Symbol("K", "C", name=coupling.name)
            relation: Sequence[str | Symbol] = summed(self.coupled(g, POSITION))
            if self.moves(g):
                relation = [Symbol("f", "C", name=coupling.name)]
            yield Block((*relation, "=", constant), KINDS[POSITION], coupling.name)

    def loop_name(self, i: int) -> str:
        """What a loop is called."""
        return f"loop {i + 1}"

    def moves(self, g: int) -> bool:
        """Whether the row of a coupling is evaluated from poses: its coefficients ``c`` change with them."""
        return self.m.couplings[g].name in self.m.once(moving_lines)

    def coupled(self, g: int, which: int) -> list[Signed]:
        """The terms of a coupling."""
        out: list[Signed] = []
        moving = self.moves(g)
        for i, (freedom, c) in enumerate(self.m.couplings[g].terms):
            k, j = self.m.freedom(freedom)
            size = (Symbol("c", f"{g + 1}{i + 1}", name=freedom),) if moving else factor(abs(c))
            out.append(("+" if c > 0 else "-", (*size, self.freedoms[k][j].numbers[which])))
        return out

    def closure(self, which: int) -> LinearSystem:
        """The velocity closure (2.47) or the acceleration closure (2.60) of all loops, then those of the couplings."""
        screws = [f.screw("freedoms", k, j) for k, row in enumerate(self.freedoms) for j, f in enumerate(row)]
        blocks, equations = [], []
        for i, loop in enumerate(self.graph.loops):
            terms = [term for k, sign in loop for term in self.relative(k, which, sign)]
            blocks.append(Block((*summed(terms), "=", "0"), KINDS[which], self.loop_name(i)))
            equations += [self._loop_row(which, i, part) for part in range(6)[self.m.span]]
        for g, coupling in enumerate(self.m.couplings):
            places = [self.m.freedom(freedom) for freedom in coupling.freedoms]
            row = tuple(Term(self.first[k] + j, 1.0, coupling=(g, i)) for i, (k, j) in enumerate(places))
            bias = [Symbol("N", "C", name=coupling.name)] if which == ACCELERATION and self.moves(g) else []
            known = tuple(KnownSymbol(symbol, "row_biases", (g,), 1.0) for symbol in bias)
            words = (*summed(self.coupled(g, which)), *(w for b in bias for w in ("+", b)), "=", "0")
            blocks.append(Block(words, KINDS[which], coupling.name))
            equations.append(ScalarEquation(f"coupling {coupling.name}", coupling.name, "closure", row, known=known))
        return LinearSystem(self.m, tuple(self.unknowns(which)), tuple(equations), tuple(blocks), tuple(screws))

    def _loop_row(self, which: int, i: int, part: int) -> ScalarEquation:
        """One component of the closure of a loop: 0 to 2 of the turning, 3 to 5 of the velocity at the origin."""
        terms, known = [], []
        for k, sign in self.graph.loops[i]:
            for j, f in enumerate(self.freedoms[k]):
                if not (f.slides and part < 3):
                    column = self.first[k] + j
                    terms.append(Term(column, float(sign), column, part))
            if which == ACCELERATION and self.bias_terms(k):
                symbol = replace(self.bias(k), kind="vector", moment=part >= 3, axis=AXES[part % 3])
                known.append(KnownSymbol(symbol, "biases", (part, k), float(sign)))
        loop, what = self.loop_name(i), f"{'turning' if part < 3 else 'velocity'} {AXES[part % 3]}"
        return ScalarEquation(f"{loop}: {what}", loop, "closure", tuple(terms), None, part, tuple(known))

    # --- links ---------------------------------------------------------------------------------------------------------

    def motion_blocks(self) -> Iterator[Block]:
        """What the symbols of the accelerations are: biases of the pairs, twists of the links and their rates, along the tree."""
        for k, pair in enumerate(self.m.pairs):
            if self.bias_terms(k):
                yield Block((self.bias(k), "=", *summed(self.bias_terms(k))), "bias", pair.name)
        for which, letter in ((RATE, "V"), (ACCELERATION, "dV")):
            for k, sign, parent, child in self.graph.tree:
                above, link = self.m.links[parent].name, self.m.links[child].name
                start: list[Signed] = [] if above == self.m.frame else [("+", (self.of_link(letter, above, "dual"),))]
                terms = [*start, *self.relative(k, which, sign)]
                yield Block((self.of_link(letter, link, "dual"), "=", *summed(terms)), "twist", link)

    def inertia_blocks(self) -> Iterator[Block]:
        """The inertia written out, ``F_I = -m a - e (I alpha + w x I w + c x m a)`` (3.22, 3.30, 3.32), of every moving link."""
        for link in self.m.links:
            if link.name != self.m.frame:
                if link.mass:
                    yield self._center(link, "a", "dv", "dw")
                yield self._inertia(link, "I", "a", "dw")

    def _center(self, link: Link, out: str, dv: str, dw: str) -> Block:
        """Acceleration of the mass center."""
        a, rate, turning, v, w, c = (self.of_link(letter, link.name) for letter in (out, dv, dw, "v", "w", "c"))
        words = (a, "=", rate, "+", turning, "x", c, "+", w, "x", "(", v, "+", w, "x", c, ")")
        return Block(words, "inertia", link.name)

    def _inertia(self, link: Link, place: str, acceleration: str, turning: str) -> Block:
        force = Symbol("F", f"{place}{self.names.link_number[link.name]}", "dual")
        a, alpha, w, c = (self.of_link(letter, link.name) for letter in (acceleration, turning, "w", "c"))
        mass, tensor = self.of_link("m", link.name, "scalar"), self.of_link("I", link.name)
        moment: list[Signed] = []
        if link.inertia is not None:
            moment += [("+", (tensor, alpha)), ("+", (w, "x", tensor, w))]
        if link.mass:
            moment.append(("+", (c, "x", mass, a)))
        terms: list[Signed] = [("-", (mass, a))] if link.mass else []
        if moment:
            terms.append(("-", ("e", "(", *summed(moment), ")")))
        return Block((force, "=", *summed(terms)), "inertia", link.name)

    # --- accelerations as unknowns -------------------------------------------------------------------------------------

    def paths(self) -> dict[str, tuple[tuple[int, int], ...]]:
        """For every link the pairs from the frame to it, along the tree, each with its sign."""
        out: dict[str, tuple[tuple[int, int], ...]] = {self.m.frame: ()}
        for k, sign, parent, child in self.graph.tree:
            out[self.m.links[child].name] = (*out[self.m.links[parent].name], (k, sign))
        return out

    def influence(self, link: Link, k: int, j: int) -> tuple[Symbol, Symbol]:
        """Acceleration of the mass center of a link, and rate of its moment of momentum about the origin, for a unit acceleration."""
        f = self.freedoms[k][j]
        place = f"{self.names.link_number[link.name]},{k + 1}"
        return Symbol("K", place, "vector", along=f.line.letter), Symbol("H", place, "vector", along=f.line.letter)

    def influence_blocks(self) -> Iterator[Block]:
        """``a = K alpha + k`` (3.57 to 3.61): what multiplies the accelerations, and the inertia force ``F_B`` without them."""
        for link in self.m.links:
            if not has_inertia(link) or link.name == self.m.frame:
                continue
            path = self.paths()[link.name]
            for k, _ in path:
                for j, f in enumerate(self.freedoms[k]):
                    yield from self._influence(link, k, j, f)
            biases: list[Signed] = [("+" if s > 0 else "-", (self.bias(k),)) for k, s in path if self.bias_terms(k)]
            z, y = self.of_link("z", link.name), self.of_link("y", link.name)
            yield Block((z, "+", "e", y, "=", *summed(biases)), "influence", link.name)
            if link.mass:
                yield replace(self._center(link, "k", "y", "z"), kind="influence")
            yield replace(self._inertia(link, "B", "k", "z"), kind="influence")

    def _influence(self, link: Link, k: int, j: int, f: FreedomSymbols) -> Iterator[Block]:
        K, H = self.influence(link, k, j)
        c, tensor = (self.of_link(letter, link.name) for letter in "cI")
        mass = self.of_link("m", link.name, "scalar")
        line = replace(f.line, kind="vector")
        if link.mass:
            screw = f.screw("freedoms", k, j)
            center: list[Signed] = [("+", screw.real)] + ([] if f.slides else [("+", (line, "x", c))])
            yield Block((K, "=", *summed(center)), "influence", link.name)
        turned: list[Signed] = [("+", (tensor, line))] if link.inertia is not None and not f.slides else []
        lever: list[Signed] = [("+", (c, "x", mass, K))] if link.mass else []
        if turned or lever:
            yield Block((H, "=", *summed([*turned, *lever])), "influence", link.name)

    def inertia_terms(self, link: Link, first: int) -> tuple[list[Screw], list[list[Term]]]:
        """Screws ``I S`` of the freedoms that move a link, numbered from ``first``, and their terms by component, minus ``I S q''``.

        Terms name the freedom by its column.
        """
        screws: list[Screw] = []
        terms: list[list[Term]] = [[] for _ in range(6)]
        mass, index = self.of_link("m", link.name, "scalar"), self.m.link_index[link.name]
        for k, sign in self.paths()[link.name] if has_inertia(link) else ():
            for j, f in enumerate(self.freedoms[k]):
                K, H = self.influence(link, k, j)
                still = f.slides and not link.mass
                for part in () if still else range(6 if link.mass else 3)[self.m.span]:
                    terms[part].append(Term(self.first[k] + j, -float(sign), first + len(screws), part))
                screws.append(Screw("freedoms", k, j, (mass, K) if link.mass else (), () if still else (H,), index))
        return screws, terms


def has_inertia(link: Link) -> bool:
    """Whether a link resists acceleration."""
    return bool(link.mass) or link.inertia is not None


def _bracketed(terms: list[Signed]) -> Words:
    words = summed(terms)
    return words if len(terms) == 1 else ("(", *words, ")")


@dataclass(frozen=True, repr=False)
class Closure(Shown):
    """The closure equations: ``position`` as printed, ``velocity`` and ``acceleration`` as linear systems in the rates and accelerations.

    ``motion`` and ``inertia`` say what the symbols of twists and inertia forces are.
    """

    position: tuple[Block, ...]
    velocity: LinearSystem
    acceleration: LinearSystem
    motion: tuple[Block, ...]
    inertia: tuple[Block, ...]

    def document(self) -> Document:
        """The closure in displacement, velocity and acceleration, block-wise."""
        blocks = (*self.position, *self.velocity.blocks, *self.acceleration.blocks)
        return Document(f"Closure of {self.velocity.mechanism.name}", [b.equation for b in blocks])

    def __repr__(self) -> str:
        return f"Closure({self.velocity.mechanism.name!r}, {counted(len(self.position), 'loop')}; print it)"


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
class Formulation(LinearSystem, Shown):
    """The equations of a mechanism; what it prints is what it assembles. Returned by ``formulate``.

    Every term names the screw component that is its coefficient: ``text`` prints its symbol, ``assemble`` reads its number from a State.

    Attributes
    ----------
    unknowns, equations : tuple
        The scalar force equations and their unknowns (of a response with accelerations and their closure).
    blocks : tuple
        The same as vector equations.
    closure : object
        Closure equations of position, velocity and acceleration.
    acts : tuple
        Terms with which every pair acts on its link b.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("rcsr")
    >>> f = mg.formulate(m)
    >>> print(f.blocks[0].text)
    R_41 = F_41 + FA_1 A_1
    >>> A, b = f.assemble(mg.solve(m, {"O1": 2.6}).state())
    >>> A.shape, b.shape
    ((24, 24), (24,))
    """

    bookkeeping: str
    sought: str
    acts: tuple[tuple[Term, ...], ...]

    @cached_property
    def closure(self) -> Closure:
        """The closure equations of position, velocity and acceleration, and what defines their symbols."""
        words = MotionWords(self.mechanism)
        velocity, acceleration = words.closure(RATE), words.closure(ACCELERATION)
        motion, inertia = tuple(words.motion_blocks()), tuple(words.inertia_blocks())
        return Closure(tuple(words.position_blocks()), velocity, acceleration, motion, inertia)

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
        """Count unknowns and equations by kind.

        Returns
        -------
        Ledger

        Examples
        --------
        >>> import mechgraph as mg
        >>> ledger = mg.formulate(mg.load("rcsr"), "minimal").ledger()
        >>> ledger.unknowns, ledger.equations
        (18, 18)
        """
        groups = dict(Counter(pair.type.symbol for pair in self.mechanism.pairs))
        if self.mechanism.couplings:
            groups["coupling"] = len(self.mechanism.couplings)
        groups["driver"] = sum(u.group == "driver" for u in self.unknowns)
        groups["link"] = len(self.mechanism.links) - 1
        if self.sought == "response":
            groups["acceleration"] = sum(u.group == "acceleration" for u in self.unknowns)
            groups["closure"] = len({e.owner for e in self.equations if e.group == "closure"})
        unknowns, equations = (Counter(one.group for one in of) for of in (self.unknowns, self.equations))
        rows = {name: LedgerRow(count, unknowns[name], equations[name]) for name, count in groups.items()}
        return Ledger(self.bookkeeping, rows)

    def document(self, components: bool = True) -> Document:
        """Return the printed formulation as a document.

        Parameters
        ----------
        components : bool
            Include the scalar equations.

        Returns
        -------
        Document
        """
        return formulation_document(self, components)

    def text(self, components: bool = True) -> str:
        """Return the equations as plain text, as vectors and as components.

        Parameters
        ----------
        components : bool
            Include the scalar equations.

        Returns
        -------
        str

        Examples
        --------
        >>> import mechgraph as mg
        >>> print(mg.formulate(mg.load("rcsr")).text().splitlines()[0])
        Equations of rcsr
        """
        return to_text(self.document(components))

    def latex(self, components: bool = True) -> str:
        """Return the equations as LaTeX, as vectors and as components.

        Parameters
        ----------
        components : bool
            Include the scalar equations.

        Returns
        -------
        str
        """
        return to_latex(self.document(components))

    def write(self, path: str | os.PathLike[str], components: bool = True) -> None:
        """Write the equations to a file, atomically; the extension selects the format.

        Parameters
        ----------
        path : str or path
            ``.tex``, a LaTeX file that compiles; ``.txt``; ``.md``; ``.csv``, the coefficients.
        components : bool
            Include the scalar equations.

        Raises
        ------
        FileError
            Another extension, or the file cannot be written.
        """
        format_of(path, FORMATS).write(self, path, components)

    def coefficients(self, state: State | None = None) -> CoefficientTable:
        """Return the nonzero coefficients ``Q(row, column)`` and right sides ``C(row)``, as in Lee's Table XIV.

        Parameters
        ----------
        state : State, optional
            ``s.state(i)``: add their numbers at that position, and those of the unknowns ``u(column)`` (NaN if not unique).

        Returns
        -------
        CoefficientTable

        Examples
        --------
        >>> import mechgraph as mg
        >>> print(str(mg.formulate(mg.load("rcsr")).coefficients()).splitlines()[-1])
        Q(24, 22) = A_4z
        """
        if state is None:
            return CoefficientTable(tuple(self.coefficient_rows()))
        u = [(f"u({i})", 0, i, f"{value:.10g}") for i, value in enumerate(self.solve(state), 1)]
        return CoefficientTable((*self.number_rows(state), *u))

    def closure_coefficients(self) -> CoefficientTable:
        """Return the coefficients of the closure: ``N(row, column)`` of rates and accelerations (2.47, 2.60), right sides ``B(row)`` of
        the latter.

        Returns
        -------
        CoefficientTable
        """
        return CoefficientTable(tuple(self.closure.acceleration.coefficient_rows("N", "B")))

    def __repr__(self) -> str:
        size = f"{len(self.equations)} equations, {len(self.unknowns)} unknowns"
        return f"Formulation({self.mechanism.name!r}, {self.bookkeeping!r}, {size})"

    def _repr_html_(self) -> str:
        return to_html(self.document(components=len(self.unknowns) <= 200))  # more are shown in blocks alone

    def _repr_latex_(self) -> str:
        return self.latex(components=len(self.unknowns) <= 200)


def _dual(letter: str, place: str, name: str = "") -> Symbol:
    return Symbol(letter, place, "dual", name=name)


def _entry(*words: str | Symbol) -> Equation:
    return Equation(written(words), written(words, latex=True), mathml(words))


A = Symbol("A", "k", "vector")
A0 = moment_of(A)
SYMBOLS = (
    (_entry(_dual("R", "ab"), "=", "F", "+", "e", "M"),
     "force and moment about the global origin that link a exerts on link b, one dual vector; e times e is zero"),
    (_entry(_dual("R", "ba"), "=", "-", _dual("R", "ab")), "action and reaction"),
    (_entry(A),
     "unit vector along the axis of pair k, z of its marker; X and Y along x and y; a prime for every freedom before"),
    (_entry(A0, "=", Symbol("P", "k", "vector"), "x", A),
     "its moment about the global origin, P the origin of its frame, for an effort that of the marker on the second link"),
    (replace(_entry(_dual("A", "k"), "=", A, "+", "e", A0), text="A_k + e A0_k"),
     "the axis as a line, what A stands for among dual vectors"),
    (_entry(Symbol("F", "k", along="A")), "unknown force of pair k along A; likewise along X and Y, and couples M about them"),
    (_entry(_dual("F", "Ib")), "inertia of link b: minus mass times acceleration of its mass center, and the moment"),
)  # fmt: skip
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
    (_entry(*(word for letter in ("theta", "omega", "alpha") for word in (Symbol(letter, "k"), ",")), "..."),
     "angle of pair k, its rate and acceleration; S, dS, ddS for a slide; with a direction where pair k has several"),
    (_entry("exp(", Symbol("theta", "k"), _dual("A", ""), ")"),
     "displacement by theta about A, a slide for e S A; A, X, Y there are axes of the frame before it"),
    (_entry(Symbol("L", "b", name="k,l")),
     "shape of link b: pose of the marker of pair l on it, seen from the marker of pair k on it"),
    (_entry(_dual("V", "b"), "=", _vector("w"), "+", "e", _vector("v")),
     "twist of link b: angular velocity, and velocity of its point at the global origin"),
    (_entry(_dual("dV", "b"), "=", _vector("dw"), "+", "e", _vector("dv")), "rate of the twist of link b"),
    (_entry(_dual("N", "k")),
     "velocity part of the acceleration of pair k (N_5 of 2.60); among components N0 is its dual part"),
    (_entry(Symbol("m", "b"), ",", _vector("c"), ",", _vector("a"), ",", _vector("I")),
     "mass of link b, position and acceleration of its mass center, inertia about it in global directions, turning with the link"),
)  # fmt: skip
"""What the symbols of closure and motion mean."""
VARYING = (
    _entry(Symbol("W", "k", "dual", name="dS")),
    "own rate of a screw that is not constant in its frame; D the displacement that it belongs to",
)
RESPONSE = (
    (_entry(Symbol("K", "b,k", "vector", along="A"), ",", Symbol("H", "b,k", "vector", along="A")),
     "acceleration of mass center b, rate of the moment of momentum of link b about the origin, for a unit acceleration of pair k"),
    (_entry(_dual("F", "Bb")), "inertia of link b were the accelerations of all freedoms zero; k, z, y are a, dw, dv then"),
)  # fmt: skip


def _symbols(f: Formulation) -> Iterator[tuple[Equation, str]]:
    """The symbols that occur."""
    m = f.mechanism
    varying = not all(isinstance(step, ConstantScrew) or step.holds_rotation for p in m.pairs for step in p.type.steps)
    yield from SYMBOLS
    for meaning, occurs in (
        (LEE, any(u.meaning.startswith("free dual") for u in f.unknowns)),
        (PITCH, any(pair.pitch is not None for pair in m.pairs)),
        (LOADS, bool(m.loads)),
        (DRIVERS, any(u.group == "driver" for u in f.unknowns)),
        (COUPLINGS, any(not c.steps for c in m.couplings)),
        (CONTACTS, any(c.steps for c in m.couplings)),
        (CONSTANT, bool(m.couplings)),
    ):
        if occurs:
            yield meaning
    yield from (*MOTION, *[VARYING] * varying, *RESPONSE * (f.sought == "response"))


def formulation_document(f: Formulation, components: bool) -> Document:
    """All equations of a formulation, with what the symbols mean: closure, motion, forces, then the components and the unknowns."""
    m = f.mechanism
    numbers = names_of(m).link_number
    count = f"{len(f.unknowns)} unknowns, {len(f.equations)} equations"
    blocks: list[Piece] = [
        Paragraph(
            f"Bookkeeping {f.bookkeeping}, {f.sought}: {count}. Numbers in brackets are those of Lee (1977)."
            + " Planar: vectors have the components x and y, turns and moments z." * f.mechanism.planar
        ),
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
