"""Sections 3.8 to 3.14 and the coefficient tables: formulations generated, and edited to what is printed."""

from dataclasses import dataclass, replace

import numpy as np

import mechgraph as mg
from mechgraph.equations.terms import Symbol, Term, Words, moment_of

SECTIONS = {
    "7r": ("3.8", 50),
    "rprhrrr": ("3.9", 50),
    "rrrrrrh": ("3.10", 50),
    "rprrhc": ("3.11", 42),
    "pphchp": ("3.12", 42),
    "rcrcr": ("3.13", 34),
    "phchc": ("3.14", 34),
}
"""Library name -> section and the number of unknowns that the thesis counts."""


# --- one term printed with or without epsilon -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Slip:
    """Equations of the thesis in which what a pair transmits along its axis is of the wrong kind."""

    name: str
    equations: str
    pairs: tuple[str, ...]


SLIPS = (
    Slip("rprrhc", "3.166", ("O2",)),
    Slip("pphchp", "3.183", ("O2",)),
    Slip("pphchp", "3.187", ("O6",)),
    Slip("pphchp", "3.183, 3.187", ("O2", "O6")),
    Slip("rcrcr", "3.199", ("O1",)),
    Slip("rcrcr", "3.201", ("O3",)),
    Slip("rcrcr", "3.203", ("O5",)),
    Slip("rcrcr", "3.199, 3.201, 3.203", ("O1", "O3", "O5")),
    Slip("phchc", "3.213", ("O1",)),
)


def as_printed(f: mg.Formulation, pair: str) -> mg.Formulation:
    """A formulation in which the axial part of a pair's reaction is what its freedom leaves free: a couple about the axis of
    R, a force along the axis of P. The unknown keeps its place; its terms get the screw of the pair's effort.
    """
    k = [p.name for p in f.mechanism.pairs].index(pair)
    wrong = [i for i, s in enumerate(f.screws) if s.pair == k and s.kind == "along"]
    axial = {t.unknown for e in f.equations for t in e.terms if t.screw in wrong}
    (unknown,) = axial
    couple = f.mechanism.pairs[k].type.efforts[0].is_couple
    axis = Symbol("A", str(k + 1), "dual")
    printed: dict[str, Words] = (
        {"real": (), "dual": (axis,)} if couple else {"real": (axis,), "dual": (moment_of(axis),)}
    )
    screw = replace(f.screws[wrong[0]], kind="efforts", **printed)
    screws = (*f.screws, screw)
    parts = (0, 1, 2) if couple else (0, 1, 2, 3, 4, 5)
    equations = []
    for e in f.equations:
        terms = [t for t in e.terms if t.unknown != unknown]
        link = f.mechanism.links[e.link].name if e.link is not None else None
        p = f.mechanism.pairs[k]
        if link in (p.a, p.b) and e.part in parts:
            sign = 1.0 if p.b == link else -1.0
            terms.append(Term(unknown, sign, len(f.screws), e.part))
        equations.append(replace(e, terms=tuple(terms)))
    unknowns = list(f.unknowns)
    unknowns[unknown] = replace(unknowns[unknown], couple=couple)
    return replace(f, equations=tuple(equations), screws=screws, unknowns=tuple(unknowns))


@dataclass(frozen=True)
class Effect:
    """Rank and driver effort of the generated and of the printed equations at one position, NaN where singular."""

    size: int
    rank: int
    printed_rank: int
    effort: float
    printed_effort: float


def rank(A: np.ndarray) -> int:
    """Rank with rows and columns scaled to unit size first, so that units do not matter."""
    for axis in (1, 0):
        size = np.linalg.norm(A, axis=axis, keepdims=True)
        A = A / np.where(size > 0, size, 1.0)
    return int(np.linalg.matrix_rank(A, tol=1e-10))


def effect(slip: Slip, position: int = 10) -> Effect:
    """What the slip does at one stored position of the library mechanism."""
    m = mg.load(slip.name)
    s = mg.solve(m)
    generated = mg.formulate(m, bookkeeping="lee")
    wrong = generated
    for pair in slip.pairs:
        wrong = as_printed(wrong, pair)
    state = s.state(position)
    A, b = (v if isinstance(v, np.ndarray) else v.toarray() for v in generated.assemble(state))
    B, c = (v if isinstance(v, np.ndarray) else v.toarray() for v in wrong.assemble(state))
    at = next(i for i, u in enumerate(generated.unknowns) if u.group == "driver")
    effort = float(np.linalg.solve(A, b)[at])
    assert np.isclose(effort, s[m.drives[0].freedom.partition(".")[0]].effort[position, 0], rtol=1e-9)
    found = rank(B)
    other = float(np.linalg.solve(B, c)[at]) if found == len(B) else float("nan")
    return Effect(len(A), rank(A), found, effort, other)


# --- the seven mechanisms ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Checked:
    """One mechanism over its stored sweep: counts, largest checks, and agreement of bookkeepings and of methods."""

    unknowns: int
    equations: int
    minimal: int
    positions: int
    power: float
    equilibrium: float
    methods: float
    bookkeepings: float


def solution_of(f: mg.Formulation, s: mg.Solution, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reactions ``(n, pairs, 6)`` and driver efforts ``(n,)`` that the printed equations give."""
    reactions, efforts = [], []
    for i in positions:
        state = s.state(int(i))
        A, b = f.assemble(state)
        u = np.linalg.solve(A.toarray(), b)
        total = np.zeros((len(f.mechanism.pairs), 6))
        link_of = {p.name: k for k, p in enumerate(f.mechanism.pairs)}
        seen = set()
        for e in f.equations:
            for t in e.terms:
                if e.link is None or f.unknowns[t.unknown].group == "driver":
                    continue
                k = link_of[f.unknowns[t.unknown].owner]
                if (t.unknown, t.screw, e.part, k) in seen:
                    continue
                seen.add((t.unknown, t.screw, e.part, k))
                screw = None if t.screw is None else f.screws[t.screw]
                size = 1.0 if screw is None else getattr(state, screw.kind)[screw.pair][t.part, screw.index, 0]
                total[k, e.part] += size * u[t.unknown]
        reactions.append(total)
        efforts.append(u[next(j for j, x in enumerate(f.unknowns) if x.group == "driver")])
    return np.array(reactions), np.array(efforts)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


def checked(name: str, every: int = 12) -> Checked:
    """Solve a library mechanism over its stored sweep; the printed equations at every twelfth position."""
    m = mg.load(name)
    s = mg.solve(m)
    other = mg.solve(m, method="newton_euler")
    at = np.arange(0, len(s.checks.power), every)
    drive = m.drives[0].freedom.partition(".")[0]
    direct = np.stack([s[p.name].reaction for p in m.pairs], axis=1)
    methods = max(
        relative(np.stack([other[p.name].reaction for p in m.pairs], axis=1), direct),
        relative(other[drive].effort, s[drive].effort),
    )
    books, counts = 0.0, {}
    for book in ("lee", "minimal"):
        f = mg.formulate(m, bookkeeping=book)
        counts[book] = (len(f.unknowns), len(f.equations))
        reactions, efforts = solution_of(f, s, at)
        books = max(books, relative(reactions, direct[at]), relative(efforts, s[drive].effort[at, 0]))
    return Checked(
        *counts["lee"], counts["minimal"][0], len(s.checks.power), float(np.abs(s.checks.power).max()),
        float(s.checks.equilibrium.max()), methods, books,
    )  # fmt: skip
