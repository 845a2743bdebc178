"""How the motion of a mechanism is written: symbols of all freedoms, closure of the loops, motion and inertia of the links.

Twists are dual vectors ``w + e v``, v the velocity of the body point at the global origin: a turn at the rate omega about the line A is
``omega A``, a slide along it ``e dS A``. Successive displacements and their rates: Lee 1977, sections 2.2, 2.3 and 2.6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from mechgraph.document import Document, Shown
from mechgraph.equations.symbols import LeeNames, Symbol, Words, direction, factor, moment_of, names_of, summed
from mechgraph.equations.system import LinearSystem
from mechgraph.equations.terms import AXES, Block, Known, ScalarEquation, Screw, Term, Unknown
from mechgraph.errors import counted
from mechgraph.graph.linkgraph import LinkGraph, link_graph
from mechgraph.model.factors import ConstantScrew
from mechgraph.model.link import Link
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair

POSITION, RATE, ACCELERATION = range(3)
LETTERS = {True: ("theta", "omega", "alpha"), False: ("S", "dS", "ddS")}
"""Letters of position, rate and acceleration, of a turn and of a slide."""
KINDS = ("position", "velocity", "acceleration")

Signed = tuple[str, Words]


@dataclass(frozen=True)
class Moving:
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


def _moving(k: int, pair: Pair) -> tuple[Moving, ...]:
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
            out.append(Moving(name, (first, second, third), line, number, constant, slides, pitched))
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
            yield Block((*summed(self.coupled(g, POSITION)), "=", constant), KINDS[POSITION], coupling.name)

    def loop_name(self, i: int) -> str:
        """What a loop is called."""
        return f"loop {i + 1}"

    def coupled(self, g: int, which: int) -> list[Signed]:
        """The terms of a coupling."""
        out: list[Signed] = []
        for freedom, c in self.m.couplings[g].terms:
            k, j = self.m.freedom(freedom)
            out.append(("+" if c > 0 else "-", (*factor(abs(c)), self.freedoms[k][j].numbers[which])))
        return out

    def closure(self, which: int) -> LinearSystem:
        """The velocity closure (2.47) or the acceleration closure (2.60) of all loops, then those of the couplings."""
        screws = [f.screw("freedoms", k, j) for k, row in enumerate(self.freedoms) for j, f in enumerate(row)]
        blocks, equations = [], []
        for i, loop in enumerate(self.graph.loops):
            terms = [term for k, sign in loop for term in self.relative(k, which, sign)]
            blocks.append(Block((*summed(terms), "=", "0"), KINDS[which], self.loop_name(i)))
            equations += [self._loop_row(which, i, part) for part in range(6)]
        for g, coupling in enumerate(self.m.couplings):
            blocks.append(Block((*summed(self.coupled(g, which)), "=", "0"), KINDS[which], coupling.name))
            places = [self.m.freedom(freedom) for freedom in coupling.freedoms]
            row = tuple(Term(self.first[k] + j, 1.0, coupling=(g, i)) for i, (k, j) in enumerate(places))
            equations.append(ScalarEquation(f"coupling {coupling.name}", coupling.name, "closure", row))
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
                known.append(Known(symbol, "biases", (part, k), float(sign)))
        what = f"{'turning' if part < 3 else 'velocity'} {AXES[part % 3]}"
        return ScalarEquation(
            f"{self.loop_name(i)}: {what}", self.loop_name(i), "closure", tuple(terms), None, part, tuple(known)
        )

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
        """Acceleration of the mass centre."""
        a, rate, turning, v, w, c = (self.of_link(letter, link.name) for letter in (out, dv, dw, "v", "w", "c"))
        return Block(
            (a, "=", rate, "+", turning, "x", c, "+", w, "x", "(", v, "+", w, "x", c, ")"), "inertia", link.name
        )

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
        """Acceleration of the mass centre of a link, and rate of its moment of momentum about the origin, for a unit acceleration."""
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
            for block in ([self._center(link, "k", "y", "z")] if link.mass else []) + [
                self._inertia(link, "B", "k", "z")
            ]:
                yield replace(block, kind="influence")

    def _influence(self, link: Link, k: int, j: int, f: Moving) -> Iterator[Block]:
        K, H = self.influence(link, k, j)
        c, mass, tensor = (
            self.of_link("c", link.name),
            self.of_link("m", link.name, "scalar"),
            self.of_link("I", link.name),
        )
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
                for part in () if still else range(6 if link.mass else 3):
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


def closure_of(m: Mechanism) -> Closure:
    """The closure equations of a mechanism; needs no geometry."""
    words = MotionWords(m)
    return Closure(
        tuple(words.position_blocks()),
        words.closure(RATE),
        words.closure(ACCELERATION),
        tuple(words.motion_blocks()),
        tuple(words.inertia_blocks()),
    )
