"""Building a formulation from the graph and the pair table: equilibrium of every moving link, conditions of every pair."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from mechgraph.equations.formulation import Formulation
from mechgraph.equations.symbols import LeeNames, factor_text, names_of, screw_letter, subscript
from mechgraph.equations.terms import AXES, Block, ScalarEquation, Screw, Term, Unknown
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.model.pair_type import Component, Freedom


@dataclass
class _Draft:
    """What is collected while a formulation is built.

    ``acts`` are the terms with which every pair acts on its link b (and with the opposite sign on link a), ``driven`` the pairs in
    which drivers and couplings act, each with the symbol of what it exerts, ``duals`` the free dual forces of pairs.
    """

    m: Mechanism
    names: LeeNames
    unknowns: list[Unknown] = field(default_factory=list)
    screws: list[Screw] = field(default_factory=list)
    acts: list[list[Term]] = field(default_factory=list)
    duals: dict[int, list[int]] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    driven: list[tuple[int, str]] = field(default_factory=list)

    def unknown(self, name: str, owner: str, group: str, couple: bool, meaning: str, freedom: str = "") -> int:
        self.unknowns.append(Unknown(name, owner, group, couple, meaning, freedom))
        return len(self.unknowns) - 1

    def screw(self, kind: str, k: int, index: int, part: Component, letter: str) -> int:
        number = f"_{k + 1}"
        point = f"P{chr(39) * part.frame}_{k + 1}"
        direction = letter + number
        if part.is_couple:
            made = Screw(
                kind, k, index, "", direction, f"{direction}: unit couple {part.name} of pair {self.m.pairs[k].name}"
            )
        else:
            dual = f"{letter}0{number}"
            meaning = f"{dual} = {point} x {direction}"
            if any(part.per_pitch):
                meaning += f", rho_{k + 1} the pitch of pair {self.m.pairs[k].name} (advance per radian)"
                dual = f"({dual}{{}} - rho_{k + 1} {direction}{{}})"
            made = Screw(kind, k, index, direction, dual, meaning)
        self.screws.append(made)
        return len(self.screws) - 1

    def carry(self, act: list[Term], unknown: int, screw: int, coupling: tuple[int, int] | None = None) -> None:
        made = self.screws[screw]
        parts = [part for part in range(6) if (made.symbol if part >= 3 else made.dual)]
        act += [Term(unknown, 1.0, screw, part, coupling) for part in parts]

    def effort(self, k: int, j: int, unknown: int, coupling: tuple[int, int] | None = None) -> str:
        """The unknown acts as effort in freedom ``j`` of pair ``k``; returns the letter of its direction."""
        part = self.m.pairs[k].type.efforts[j]
        letter = screw_letter(part)
        self.carry(self.acts[k], unknown, self.screw("efforts", k, j, part, letter), coupling)
        return letter


def _along(draft: _Draft, k: int, kind: str, parts: Iterable[Component], act: list[Term]) -> list[str]:
    """Unknown multiples of the screws of a pair; returns how each is printed, ``FA_1 A_1``."""
    pair = draft.m.pairs[k]
    printed = []
    for i, part in enumerate(parts):
        letter = screw_letter(part)
        name = f"{part.name[0]}{letter}_{k + 1}"
        where = f"{part.name} in frame {part.frame} of pair {pair.name}"
        unknown = draft.unknown(name, pair.name, pair.type.symbol, part.is_couple, where)
        screw = draft.screw(kind, k, i, part, letter)
        draft.carry(act, unknown, screw)
        turned = f"(1 - e rho_{k + 1}) " if any(part.per_pitch) else ""
        printed.append(f"{turned}{'e ' if part.is_couple else ''}{name} {letter}_{k + 1}")
    return printed


def _components_of(pair: Pair) -> tuple[Component, ...]:
    """The reaction components; those of a null space are named only."""
    if pair.type.reactions is not None:
        return pair.type.reactions
    return tuple(Component(name, (1.0,) * 6) for name in pair.type.component_names)


def _minimal(draft: _Draft, k: int) -> None:
    act: list[Term] = []
    printed = _along(draft, k, "reactions", _components_of(draft.m.pairs[k]), act)
    draft.acts.append(act)
    _define(draft, k, printed)


def _lee(draft: _Draft, k: int) -> None:
    pair = draft.m.pairs[k]
    book = pair.type.bookkeeping
    if book is None:
        _minimal(draft, k)
        return
    symbol = draft.names.reaction[k]
    act: list[Term] = []
    dual = []
    for letter, offset, couple in (("F", 3, False), ("M", 0, True)):
        for i, axis in enumerate(AXES):
            what = "moment about the origin" if couple else "force"
            unknown = draft.unknown(
                f"{letter}_{symbol}{axis}",
                pair.name,
                pair.type.symbol,
                couple,
                f"free dual {what} of pair {pair.name}, {axis}",
            )
            act.append(Term(unknown, 1.0, None, offset + i))
            dual.append(unknown)
    draft.duals[k] = dual
    printed = _along(draft, k, "along", book.along, act)
    draft.acts.append(act)
    _define(draft, k, [f"F_{symbol}", *printed])


BOOKKEEPINGS: dict[str, Callable[[_Draft, int], None]] = {"lee": _lee, "minimal": _minimal}
"""How a pair's reaction is written, by the name of the bookkeeping."""


def _define(draft: _Draft, k: int, printed: list[str]) -> None:
    left = f"R_{draft.names.reaction[k]}"
    if printed:
        text = f"{left} = {' + '.join(printed)}"
        latex = f"{_hat(left)} = {' + '.join(_hat(p) for p in printed)}"
    else:
        text = latex = f"{left} = 0"
    draft.blocks.append(Block(text, latex, "reaction", draft.m.pairs[k].name))


def _hat(symbol: str) -> str:
    r"""A printed term as LaTeX with hats on dual vectors: ``FA_1 A_1`` -> ``F^{A_{1}} \hat{A}_{1}``."""
    front = ""
    if symbol.startswith("("):
        front, _, symbol = symbol.partition(") ")
        front = subscript(front + ")").replace("e rho", r"\epsilon \rho") + " "
    words = symbol.split()
    out = []
    for i, word in enumerate(words):
        head, _, tail = word.partition("_")
        if word == "e":
            out.append(r"\epsilon")
        elif i == len(words) - 1:
            out.append(rf"\hat{{{head}}}_{{{tail}}}")
        else:
            out.append(f"{head[0]}^{{{head[1:]}_{{{tail}}}}}" if len(head) > 1 else subscript(word))
    return front + " ".join(out)


def _driver_efforts(draft: _Draft, efforts: tuple[str, ...]) -> None:
    """One unknown for every driven (or held) freedom; + on link b, - on link a."""
    for name in efforts:
        k, j = draft.m.freedom(name)
        pair = draft.m.pairs[k]
        couple = pair.type.efforts[j].is_couple
        label = "IN" if len(efforts) == 1 else f"IN({name})"
        freedom = pair.freedom_names[j]
        size = f"{'M' if couple else 'F'}_{label}"
        unknown = draft.unknown(size, pair.name, "driver", couple, f"effort in {freedom}", freedom)
        letter = draft.effort(k, j, unknown)
        _define_effort(draft, k, "effort", pair.name, label, "", couple, size, letter)


def _multipliers(draft: _Draft) -> None:
    """One unknown m for every coupling; it acts with the effort ``c_i m`` in freedom i: + on link b, - on link a."""
    m = draft.m
    for g, coupling in enumerate(m.couplings):
        places = [m.freedom(freedom) for freedom in coupling.freedoms]
        couple = any(m.pairs[k].type.freedoms[j].turns for k, j in places)
        size = f"{'M' if couple else 'F'}_C({coupling.name})"
        unknown = draft.unknown(size, coupling.name, "coupling", couple, f"multiplier of the coupling {coupling.name}")
        for i, ((k, j), (freedom, c)) in enumerate(zip(places, coupling.terms, strict=True)):
            letter = draft.effort(k, j, unknown, (g, i))
            label, factor = f"C({coupling.name},{freedom})", ("-" if c < 0 else "") + factor_text(abs(c))
            turns = m.pairs[k].type.efforts[j].is_couple
            _define_effort(draft, k, "coupling", coupling.name, label, factor, turns, size, letter)


def _define_effort(
    draft: _Draft, k: int, kind: str, owner: str, label: str, factor: str, couple: bool, size: str, letter: str
) -> None:
    """The printed definition of what a driver or coupling exerts in pair ``k``: ``F_IN = e M_IN A_1``, ``F_C(g,A.Rz) = 2 e M_C(g) A_1``."""
    draft.driven.append((k, f"F_{label}"))
    text = f"F_{label} = {factor}{'e ' if couple else ''}{size} {letter}_{k + 1}"
    left = rf"\hat{{F}}^{{{label}}}" if kind == "effort" else _hat(f"F_{label}")
    dual = r"\epsilon " if couple else ""
    latex = rf"{left} = {factor}{dual}{subscript(size)} \hat{{{letter}}}_{{{k + 1}}}"
    draft.blocks.append(Block(text, latex, kind, owner))


def _equilibrium(draft: _Draft) -> list[ScalarEquation]:
    """Six equations for every moving link: three of force, three of moment about the origin."""
    m, names = draft.m, draft.names
    touched = {link for load in m.loads for link in load.links(m)}
    at_link: dict[str, list[tuple[int, float]]] = {link.name: [] for link in m.links}
    for k, pair in enumerate(m.pairs):
        at_link[pair.a].append((k, -1.0))
        at_link[pair.b].append((k, 1.0))
    equations = []
    for index, link in enumerate(m.links):
        if link.name == m.frame:
            continue
        number = names.link_number[link.name]
        printed: list[tuple[str, str]] = []
        terms: list[list[Term]] = [[] for _ in range(6)]
        for k, sign in at_link[link.name]:
            printed.append(("+", f"R_{names.reaction[k] if sign > 0 else names.opposite[k]}"))
            for t in draft.acts[k]:
                terms[t.part].append(Term(t.unknown, sign, t.screw, t.part, t.coupling))
        known = [f"I{number}"] + ([f"A{number}"] if link.name in touched else [])
        printed += [("+", f"F_{name}") for name in known]
        for k, label in draft.driven:
            if link.name in (m.pairs[k].a, m.pairs[k].b):
                printed.append(("+" if m.pairs[k].b == link.name else "-", label))
        text = "".join(f" {sign} {symbol}" for sign, symbol in printed).removeprefix(" + ") + " = 0"
        latex = "".join(f" {sign} {_hat(symbol)}" for sign, symbol in printed).removeprefix(" + ") + " = 0"
        draft.blocks.append(Block(text, latex, "link", link.name))
        for what, letter, offset in (("force", "F", 3), ("moment", "M", 0)):
            for i, axis in enumerate(AXES):
                equations.append(
                    ScalarEquation(
                        f"link {number} ({link.name}): {what} {axis}",
                        link.name,
                        "link",
                        tuple(terms[offset + i]),
                        index,
                        offset + i,
                        tuple(f"{letter}_{name}{axis}" for name in known),
                    )
                )
    return equations


def _conditions(draft: _Draft) -> list[ScalarEquation]:
    """Lee's constraint equations: the free dual force is reciprocal to the condition twists of its pair."""
    equations = []
    for k, dual in draft.duals.items():
        book = draft.m.pairs[k].type.bookkeeping
        if book is None:
            continue
        equations += [_condition(draft, k, i, twist, dual) for i, twist in enumerate(book.conditions)]
        symbol, axis = draft.names.reaction[k], screw_letter(book.conditions[0])
        text = f"F_{symbol} . {axis}_{k + 1} = 0"
        latex = rf"\hat{{F}}_{{{symbol}}} \cdot \hat{{{axis}}}_{{{k + 1}}} = 0"
        draft.blocks.append(Block(text, latex, "condition", draft.m.pairs[k].name))
    return equations


def _condition(draft: _Draft, k: int, i: int, twist: Freedom, dual: list[int]) -> ScalarEquation:
    """The power of the free dual force of pair ``k`` on one condition twist is zero.

    The real (angular) part of the twist multiplies the moment, its dual part the force.
    """
    pair, letter = draft.m.pairs[k], screw_letter(twist)
    direction, moment = f"{letter}_{k + 1}", f"{letter}0_{k + 1}"
    symbols = (moment, direction) if twist.turns else (direction, "")
    draft.screws.append(Screw("conditions", k, i, *symbols, f"{moment} = P_{k + 1} x {direction}"))
    at = len(draft.screws) - 1
    terms = [Term(dual[j], 1.0, at, 3 + j) for j in range(3)]
    if twist.turns:
        terms += [Term(dual[3 + j], 1.0, at, j) for j in range(3)]
    what = "moment about" if twist.turns else "force along"
    return ScalarEquation(f"pair {k + 1} ({pair.name}): {what} the axis", pair.name, pair.type.symbol, tuple(terms))


def formulate(m: Mechanism, bookkeeping: str = "lee", efforts: Iterable[str] | None = None) -> Formulation:
    """The d'Alembert equations of a mechanism as named unknowns and equations.

    For every moving link ``sum of reactions + inertia + applied + efforts of drivers and couplings = 0`` (six scalar equations about the
    global origin) and, in Lee's bookkeeping, the conditions of the pairs. Needs no geometry. The multiplier of a coupling ``g`` is the
    unknown ``M_C(g)``, or ``F_C(g)`` where all its freedoms are slides.

    Parameters
    ----------
    bookkeeping : ``"lee"`` (Lee 1977, equations 3.33 to 3.53) or ``"minimal"`` (reaction components of the pair table).
    efforts : freedoms whose effort is unknown; the driven ones where left out.

    Raises
    ------
    DeclarationError
        for an unknown bookkeeping or freedom.
    """
    if bookkeeping not in BOOKKEEPINGS:
        raise DeclarationError("formulate", [f"bookkeeping {bookkeeping!r}: expected one of {', '.join(BOOKKEEPINGS)}"])
    draft = _Draft(m, names_of(m))
    for k in range(len(m.pairs)):
        BOOKKEEPINGS[bookkeeping](draft, k)
    _driver_efforts(draft, tuple(d.freedom for d in m.drives) if efforts is None else tuple(efforts))
    _multipliers(draft)
    equations = _equilibrium(draft) + _conditions(draft)
    return Formulation(
        m, bookkeeping, tuple(draft.unknowns), tuple(equations), tuple(draft.blocks), tuple(draft.screws)
    )
