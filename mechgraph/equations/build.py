"""Building a formulation from the graph and the pair table: equilibrium of every moving link, conditions of every pair.

In a response the accelerations of all freedoms are unknowns beside the reactions, and their closure stands beside the equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field, replace
from typing import Literal

from mechgraph.equations.formulation import ACCELERATION, Formulation, MotionWords, has_inertia
from mechgraph.equations.terms import (
    AXES,
    Block,
    KnownSymbol,
    LeeNames,
    ScalarEquation,
    Screw,
    Symbol,
    Term,
    Unknown,
    Words,
    direction,
    dual_unit,
    factor,
    moment_of,
    names_of,
    summed,
)
from mechgraph.memo import dataclass
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs.factors import Component, Freedom
from mechgraph.quantities import door


@dataclass
class _Draft:
    """What is collected while a formulation is built.

    ``acts`` are the terms with which every pair acts on its link b (and with the opposite sign on link a), ``driven`` the pairs in
    which drivers and couplings act, each with the symbol of what it exerts, ``touched`` the forces of gears on links, ``duals`` the free
    dual forces of pairs.
    """

    m: Mechanism
    names: LeeNames
    unknowns: list[Unknown] = field(default_factory=list)
    screws: list[Screw] = field(default_factory=list)
    acts: list[list[Term]] = field(default_factory=list)
    duals: dict[int, list[int]] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    driven: list[tuple[int, Symbol]] = field(default_factory=list)
    touched: dict[str, list[tuple[float, Symbol, list[Term]]]] = field(default_factory=dict)
    accelerations: list[int] = field(default_factory=list)

    def unknown(self, symbol: Symbol, owner: str, group: str, couple: bool, meaning: str, freedom: str = "") -> int:
        self.unknowns.append(Unknown(symbol, owner, group, couple, meaning, freedom))
        return len(self.unknowns) - 1

    def block(self, words: Words, kind: str, owner: str) -> None:
        self.blocks.append(Block(words, kind, owner))

    def screw(self, kind: str, k: int, index: int, part: Component, line: Symbol) -> int:
        """A wrench of pair ``k``: a couple has the direction as its dual part, a force its moment (less pitch times it)."""
        real: Words = () if part.is_couple else (line,)
        dual: Words = (line,) if part.is_couple else (moment_of(line),)
        if any(part.per_pitch):
            dual = ("(", *dual, "-", Symbol("rho", line.place), line, ")")
        self.screws.append(Screw(kind, k, index, real, dual))
        return len(self.screws) - 1

    def carry(self, act: list[Term], unknown: int, screw: int, coupling: tuple[int, int] | None = None) -> None:
        made = self.screws[screw]
        parts = [part for part in range(6)[self.m.span] if (made.dual if part < 3 else made.real)]
        act += [Term(unknown, 1.0, screw, part, coupling) for part in parts]


def _along(draft: _Draft, k: int, kind: str, parts: Iterable[Component], act: list[Term]) -> list[tuple[str, Words]]:
    """Unknown multiples of the screws of a pair; returns how each is printed, ``+ FA_1 A_1``."""
    pair = draft.m.pairs[k]
    printed: list[tuple[str, Words]] = []
    for i, part in enumerate(parts):
        line = direction(k, part)
        symbol = Symbol("M" if part.is_couple else "F", line.place, along=line.letter)
        where = f"{part.name} in frame {part.frame} of pair {pair.name}"
        unknown = draft.unknown(symbol, pair.name, pair.type.symbol, part.is_couple, where)
        draft.carry(act, unknown, draft.screw(kind, k, i, part, line))
        turned: Words = ("(", "1", "-", "e", Symbol("rho", line.place), ")") if any(part.per_pitch) else ()
        printed.append(("+", (*turned, *dual_unit(part), symbol, line)))
    return printed


def _components_of(pair: Pair) -> tuple[Component, ...]:
    """The reaction components; those of a null space, and those combined with efforts, are named only."""
    if pair.type.reactions is not None and not pair.type.computed_reactions:
        return pair.type.reactions
    return tuple(Component(name, (1.0,) * 6) for name in pair.type.component_names)


def _effort_of(pair: Pair, j: int) -> Component:
    """The effort in a freedom; one that is combined with others (a couple then has a force with it) is named only."""
    part = pair.type.efforts[j]
    return Component(part.name, (1.0,) * 6) if pair.type.computed_efforts else part


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
    free = replace(draft.names.reaction[k], letter="F")
    act: list[Term] = []
    for letter, offset, what in (("F", 3, "force"), ("M", 0, "moment about the origin")):
        for i, axis in enumerate(AXES):
            symbol, meaning = replace(free, letter=letter, axis=axis), f"free dual {what} of pair {pair.name}, {axis}"
            unknown = draft.unknown(symbol, pair.name, pair.type.symbol, letter == "M", meaning)
            act.append(Term(unknown, 1.0, None, offset + i))
    draft.duals[k] = [term.unknown for term in act]
    printed = _along(draft, k, "along", book.along, act)
    draft.acts.append(act)
    _define(draft, k, [("+", (free,)), *printed])


BookkeepingName = Literal["lee", "minimal"]
BOOKKEEPINGS: dict[str, Callable[[_Draft, int], None]] = {"lee": _lee, "minimal": _minimal}
"""How a pair's reaction is written, by the name of the bookkeeping."""


def _define(draft: _Draft, k: int, printed: list[tuple[str, Words]]) -> None:
    draft.block((draft.names.reaction[k], "=", *summed(printed)), "reaction", draft.m.pairs[k].name)


def _driver_efforts(draft: _Draft, efforts: tuple[str, ...]) -> None:
    """One unknown for every driven (or held) freedom; + on link b, - on link a."""
    for full in efforts:
        k, j = draft.m.freedom(full)
        pair = draft.m.pairs[k]
        freedom = pair.freedom_names[j]
        couple, along = pair.type.efforts[j].is_couple, direction(k, _effort_of(pair, j)).letter
        size = Symbol("M" if couple else "F", "IN", along=along, name="" if len(efforts) == 1 else full)
        unknown = draft.unknown(size, pair.name, "driver", couple, f"effort in {freedom}", freedom)
        _exert(draft, (k, j), unknown, replace(size, letter="F", along="", kind="dual"), "effort", pair.name)


def _multipliers(draft: _Draft) -> None:
    """One unknown m for every coupling; it acts with the effort ``c_i m`` in freedom i: + on link b, - on link a."""
    m = draft.m
    for g, coupling in enumerate(m.couplings):
        places = [m.freedom(freedom) for freedom in coupling.freedoms]
        couple = not coupling.is_force and any(m.pairs[k].type.freedoms[j].turns for k, j in places)
        size = Symbol("M" if couple else "F", "C", name=coupling.name)
        unknown = draft.unknown(size, coupling.name, "coupling", couple, f"multiplier of the coupling {coupling.name}")
        if coupling.steps:
            _touch(draft, g, coupling, unknown)
            continue
        for i, (place, (freedom, _)) in enumerate(zip(places, coupling.terms, strict=True)):
            exerted = Symbol("F", "C", "dual", name=f"{coupling.name},{freedom}")
            _exert(draft, place, unknown, exerted, "coupling", coupling.name, (g, i))


def _touch(draft: _Draft, g: int, coupling: BaseCoupling, unknown: int) -> None:
    """The force of gears on each other: ``F_C(g) = M_C(g) G_C(g)`` on gear b, minus that on gear a."""
    m, line = draft.m, Symbol("G", "C", "dual", name=coupling.name)
    draft.screws.append(Screw("contacts", g, 0, (line,), (moment_of(line),)))
    exerted = Symbol("F", "C", "dual", name=coupling.name)
    first, last = coupling.steps[0], coupling.steps[-1]
    gears = [(m.pairs[first.pair], -first.sense, -1.0), (m.pairs[last.pair], last.sense, 1.0)]
    for pair, side, sign in gears:
        link = pair.b if side > 0 else pair.a
        terms = [Term(unknown, sign, len(draft.screws) - 1, part) for part in range(6)[m.span]]
        draft.touched.setdefault(link, []).append((sign, exerted, terms))
    draft.block((exerted, "=", draft.unknowns[unknown].symbol, line), "coupling", coupling.name)


def _exert(
    draft: _Draft,
    place: tuple[int, int],
    unknown: int,
    exerted: Symbol,
    kind: str,
    owner: str,
    coupling: tuple[int, int] | None = None,
) -> None:
    """The unknown acts as effort in a freedom: ``F_IN = e MA_IN A_1``, ``F_C(g,A.Rz) = 2 e M_C(g) A_1`` with the number of a coupling."""
    k, j = place
    part = _effort_of(draft.m.pairs[k], j)
    line = direction(k, part)
    draft.carry(draft.acts[k], unknown, draft.screw("efforts", k, j, part, line), coupling)
    draft.driven.append((k, exerted))
    number = 1.0 if coupling is None else draft.m.couplings[coupling[0]].coefficients[coupling[1]]
    words = (exerted, "=", *factor(number), *dual_unit(part), draft.unknowns[unknown].symbol, line)
    draft.block(words, kind, owner)


def _equilibrium(draft: _Draft, words: MotionWords | None) -> list[ScalarEquation]:
    """Six equations for every moving link: three of force, three of moment about the origin; of the plane two and one."""
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
        printed: list[tuple[str, Words]] = []
        terms: list[list[Term]] = [[] for _ in range(6)]
        for k, sign in at_link[link.name]:
            printed.append(("+", (names.reaction[k] if sign > 0 else names.opposite[k],)))
            for t in draft.acts[k]:
                terms[t.part].append(Term(t.unknown, sign, t.screw, t.part, t.coupling))
        loaded = [f"L{number}"] * (link.name in touched)
        known = [(f"I{number}", "loads"), *((place, "") for place in loaded)]  # loads hold the inertia, too
        if words is not None:
            known = [(f"B{number}", "gyroscopic")] * has_inertia(link) + [(place, "applied") for place in loaded]
            screws, resisting = words.inertia_terms(link, len(draft.screws))
            draft.screws += screws
            for part, mine in enumerate(resisting):
                terms[part] += [replace(t, unknown=draft.accelerations[t.unknown]) for t in mine]
        printed += [("+", (Symbol("F", place, "dual"),)) for place in (f"I{number}", *loaded)]
        for k, exerted in draft.driven:
            if link.name in (m.pairs[k].a, m.pairs[k].b):
                printed.append(("+" if m.pairs[k].b == link.name else "-", (exerted,)))
        for sign, exerted, acting in draft.touched.get(link.name, []):
            printed.append(("+" if sign > 0 else "-", (exerted,)))
            for term in acting:
                terms[term.part].append(term)
        draft.block((*summed(printed), "=", "0"), "link", link.name)
        for what, letter, offset in (("force", "F", 3), ("moment", "M", 0)):
            for part in sorted({*range(6)[m.span]} & {*range(offset, offset + 3)}):
                axis, name = AXES[part % 3], f"link {number} ({link.name}): {what} {AXES[part % 3]}"
                symbols = [(Symbol(letter, place, "vector", axis=axis), array) for place, array in known]
                given = tuple(KnownSymbol(symbol, array, (part, index)) for symbol, array in symbols)
                equations.append(ScalarEquation(name, link.name, "link", tuple(terms[part]), index, part, given))
    return equations


def _accelerations(draft: _Draft, words: MotionWords) -> None:
    """The accelerations of all freedoms as unknowns, those of the drives first: Lee's 24th is that of the input."""
    found = words.unknowns(ACCELERATION)
    places = [draft.m.freedom(drive.freedom) for drive in draft.m.drives]
    first = [words.first[k] + j for k, j in places]
    order = [*first, *(i for i in range(len(found)) if i not in set(first))]
    draft.accelerations = [len(draft.unknowns) + order.index(i) for i in range(len(found))]
    draft.unknowns += [found[i] for i in order]


def _closure(draft: _Draft, words: MotionWords) -> list[ScalarEquation]:
    """The acceleration closure among the equations, and the accelerations that drivers prescribe."""
    closure, offset = words.closure(ACCELERATION), len(draft.screws)
    draft.screws += closure.screws

    def moved(term: Term) -> Term:
        screw = None if term.screw is None else offset + term.screw
        return replace(term, unknown=draft.accelerations[term.unknown], screw=screw)

    equations = [replace(equation, terms=tuple(map(moved, equation.terms))) for equation in closure.equations]
    draft.blocks += words.influence_blocks()
    for unknown in [u for u in draft.unknowns if u.group == "driver"]:
        k, j = draft.m.freedom(unknown.freedom)
        column = words.first[k] + j
        acceleration = words.freedoms[k][j].numbers[ACCELERATION]
        given = replace(acceleration, name="IN")
        known = (KnownSymbol(given, "accelerations", (column,), -1.0),)
        name = f"driver {unknown.freedom}: prescribed acceleration"
        draft.block((acceleration, "=", given), "prescribed", unknown.owner)
        terms = (Term(draft.accelerations[column], 1.0),)
        equations.append(ScalarEquation(name, unknown.owner, "driver", terms, known=known))
    return equations


def _conditions(draft: _Draft) -> list[ScalarEquation]:
    """Lee's constraint equations: the free dual force is reciprocal to the condition twists of its pair."""
    equations = []
    for k, dual in draft.duals.items():
        book = draft.m.pairs[k].type.bookkeeping
        if book is None:
            continue
        equations += [_condition(draft, k, i, twist, dual) for i, twist in enumerate(book.conditions)]
        free, line = replace(draft.names.reaction[k], letter="F"), direction(k, book.conditions[0])
        draft.block((free, ".", line, "=", "0"), "condition", draft.m.pairs[k].name)
    return equations


def _condition(draft: _Draft, k: int, i: int, twist: Freedom, dual: list[int]) -> ScalarEquation:
    """The power of the free dual force of pair ``k`` on one condition twist is zero.

    The real (angular) part of the twist multiplies the moment, its dual part the force.
    """
    pair, line = draft.m.pairs[k], direction(k, twist)
    parts: tuple[Words, Words] = ((moment_of(line),), (line,)) if twist.turns else ((line,), ())
    draft.screws.append(Screw("conditions", k, i, *parts))
    at = len(draft.screws) - 1
    terms = [Term(dual[j], 1.0, at, 3 + j) for j in range(3)]
    if twist.turns:
        terms += [Term(dual[3 + j], 1.0, at, j) for j in range(3)]
    what = "moment about" if twist.turns else "force along"
    return ScalarEquation(f"pair {k + 1} ({pair.name}): {what} the axis", pair.name, pair.type.symbol, tuple(terms))


SoughtName = Literal["kinetostatics", "response"]


@door
def formulate(
    m: Mechanism,
    bookkeeping: BookkeepingName = "lee",
    efforts: Iterable[str] | None = None,
    *,
    unknowns: SoughtName = "kinetostatics",
) -> Formulation:
    """Generate the equations of a mechanism as named unknowns and equations; needs no geometry.

    For every moving link ``sum of reactions + inertia + applied + efforts of drivers and couplings = 0`` (six scalar equations about
    the global origin, in a plane three), in Lee's bookkeeping with the conditions of the pairs, and the closure equations of position,
    velocity and acceleration (``Formulation.closure``). The multiplier of a coupling ``g`` is ``M_C(g)``, or ``F_C(g)`` if all its
    freedoms are translations.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    bookkeeping : {"lee", "minimal"}
        Choice of unknowns: Lee 1977, equations 3.33 to 3.53, or the reaction components of the pair table.
    efforts : iterable of str, optional
        Freedoms with unknown effort. Default: the driven ones; none in a response.
    unknowns : {"kinetostatics", "response"}
        With ``"response"`` the efforts are given, and the accelerations of all freedoms are unknowns beside the reactions (those of the
        drives first), with their closure (2.60) among the equations; a freedom in ``efforts`` has a prescribed acceleration.

    Returns
    -------
    Formulation

    Raises
    ------
    DeclarationError
        Unknown bookkeeping or freedom.

    Examples
    --------
    >>> import mechgraph as mg
    >>> f = mg.formulate(mg.load("rcsr"))
    >>> len(f.unknowns), len(f.equations)
    (24, 24)
    """
    draft = _Draft(m, names_of(m))
    for k in range(len(m.pairs)):
        BOOKKEEPINGS[bookkeeping](draft, k)
    words = MotionWords(m) if unknowns == "response" else None
    drives = tuple(d.freedom for d in m.drives) if words is None else ()
    _driver_efforts(draft, drives if efforts is None else tuple(efforts))
    _multipliers(draft)
    if words is not None:
        _accelerations(draft, words)
    equations = _equilibrium(draft, words) + _conditions(draft) + (_closure(draft, words) if words is not None else [])
    found = (tuple(draft.unknowns), tuple(equations), tuple(draft.blocks), tuple(draft.screws))
    return Formulation(m, *found, bookkeeping, unknowns, tuple(map(tuple, draft.acts)))
