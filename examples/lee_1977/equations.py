"""Equations 3.106 to 3.226 (sections 3.8 to 3.14) against the generated formulations, equation by equation.

Both sides become the same kind of statement. The generated one is read off the numbers of the assembled matrix: the wrench of
an unknown is taken apart along the dual axis ``A^ = A + e A0`` of its pair into ``(c + e d) A^``, so that a force along the axis
is (1, 0), a couple about it (0, 1), and what a screw of pitch rho transmits (1, -rho).
"""

import csv
import re
from dataclasses import dataclass

import numpy as np

import mechgraph as mg
from lee_1977.tables import DATA
from mechgraph.equations.terms import names_of

AGREES, OTHER_SIDE, LETTER, WRENCH, TWICE, LEFT_OUT = (
    "agrees",
    "agrees, seen from the other link",
    "another letter",
    "another wrench",
    "printed twice",
    "left out",
)


@dataclass(frozen=True)
class Statement:
    """One vector equation: what it is about (links of a pair, or one link), its parts, and how it is written.

    The parts of a reaction and of a driver effort are wrenches (``e M^A2 A2``), those of an equation of motion the terms of
    its sum, that of a condition the axis; ``left`` is the letter on the left of a definition.
    """

    kind: str
    about: tuple[int, ...]
    parts: frozenset[str]
    text: str
    left: str = "R"

    @property
    def key(self) -> tuple[str, frozenset[int]]:
        """Equations with the same key are about the same thing."""
        return self.kind, frozenset(self.about)


@dataclass(frozen=True)
class Match:
    """Number, equation as printed, equation as generated, verdict, and where they differ."""

    number: str
    printed: str
    generated: str
    verdict: str
    difference: str = ""


# --- what is printed ----------------------------------------------------------------------------------------------------


def printed_equations(name: str) -> list[tuple[str, str]]:
    """Number and equation, in the order of the thesis."""
    with (DATA / "lee_equations.csv").open(encoding="utf-8") as handle:
        rows = list(csv.reader(line for line in handle if not line.startswith("#")))
    return [(number, equation) for mechanism, number, equation in rows[1:] if mechanism == name]


def _digits(symbol: str) -> tuple[int, ...]:
    return tuple(int(c) for c in symbol if c.isdigit())


def _wrenches(right: str) -> frozenset[str]:
    """The wrenches of a right side, brackets multiplied out: ``(F^A4 + e M^A4) A4`` is two."""
    found = []
    for bracket, axis in re.findall(r"\(([^)]*)\) (A\d)", right):
        found += [f"{part.strip()} {axis}" for part in bracket.split("+")]
    plain = re.sub(r"\([^)]*\) A\d", "", right).split("+")
    return frozenset([*found, *(part.strip() for part in plain if part.strip())])


def parsed(text: str) -> Statement:
    """An equation of the thesis as a statement."""
    left, _, right = (part.strip() for part in text.partition(" = "))
    if left == "FIN":
        return Statement("driver", (), _wrenches(right), text)
    if " . " in left:
        force, axis = left.split(" . ")
        return Statement("condition", _digits(force), frozenset([axis]), text)
    if left.startswith("rho"):
        return Statement("pitch", _digits(left.partition("+")[2]), frozenset(["rho F + M"]), text)
    if right == "0":
        terms = left.split(" + ")
        return Statement("motion", _digits(terms[0])[-1:], frozenset(terms), text)
    first, _, rest = right.partition(" + ")
    return Statement("reaction", _digits(first), _wrenches(rest), text, left[0])


# --- what is generated --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Matrix:
    """The assembled equations of a mechanism at one position, and where the rows of a link and of a pair stand."""

    f: mg.Formulation
    Q: np.ndarray
    axes: np.ndarray
    number: dict[str, int]

    def rows(self, link: str) -> list[int]:
        """Rows of the six equations of a link, moment first as in a wrench."""
        mine = [(e.part, i) for i, e in enumerate(self.f.equations) if e.link is not None and e.owner == link]
        return [i for _, i in sorted(mine)]

    def columns(self, pair: str, driver: bool = False) -> list[int]:
        """Columns of the reaction of a pair, or of the effort in it."""
        return [j for j, u in enumerate(self.f.unknowns) if u.owner == pair and (u.group == "driver") == driver]

    def side(self, pair: mg.Pair) -> tuple[str, float]:
        """A moving link of a pair, and + where the reaction acts on it, - where its opposite does."""
        return (pair.b, 1.0) if pair.b != self.f.mechanism.frame else (pair.a, -1.0)

    def dual(self, k: int, wrench: np.ndarray) -> tuple[float, float]:
        """``(c, d)`` of a wrench ``(c + e d) A^`` on the axis of pair k."""
        axis, moment = self.axes[k, :3], self.axes[k, 3:]
        c = float(axis @ wrench[3:])
        d = float(axis @ (wrench[:3] - c * moment))
        assert np.allclose(wrench, [*(c * moment + d * axis), *(c * axis)], atol=1e-12)
        return c, d


def matrix(f: mg.Formulation, s: mg.Solution, position: int = 10) -> Matrix:
    """A formulation in Lee's bookkeeping at one position of a solution."""
    state = s.state(position)
    axes = np.zeros((len(f.mechanism.pairs), 6))
    for k, pair in enumerate(f.mechanism.pairs):
        turn = next(i for i, c in enumerate(pair.type.bookkeeping.conditions) if c.turns)
        axes[k] = state.conditions[k][:, turn, 0]
    return Matrix(f, f.assemble(state)[0].toarray(), axes, names_of(f.mechanism).link_number)


def _wrench_text(k: int, c: float, d: float, pitch: float | None, name: str) -> list[str]:
    """What ``(c + e d) A^`` is called; a screw is written as two parts with a condition, as Lee does."""
    axis = f"A{k + 1}"
    if pitch is not None and np.allclose([c, d], [1.0, -pitch]):
        return [f"F^{name} {axis}", f"e M^{name} {axis}"]
    if np.allclose([c, d], [1.0, 0.0]):
        return [f"F^{name} {axis}"]
    assert np.allclose([c, d], [0.0, 1.0])
    return [f"e M^{name} {axis}"]


def _of_pair(at: Matrix, k: int) -> list[Statement]:
    """Reaction of a pair, and the pitch condition of a helical one."""
    pair = at.f.mechanism.pairs[k]
    link, sign = at.side(pair)
    block = sign * at.Q[np.ix_(at.rows(link), columns := at.columns(pair.name))]
    free = [j for j, u in enumerate(columns) if at.f.unknowns[u].meaning.startswith("free")]
    assert np.array_equal(block[:, free], np.eye(6)[:, [3, 4, 5, 0, 1, 2]])
    ends = (at.number[pair.a], at.number[pair.b])
    ab, out = f"{ends[0]}{ends[1]}", []
    parts: list[str] = []
    for j in sorted(set(range(len(columns))) - set(free)):
        parts += _wrench_text(k, *at.dual(k, block[:, j]), pair.pitch, f"A{k + 1}")
    axis = f"A{k + 1}"
    along = f" + ({' + '.join(p.removesuffix(f' {axis}') for p in parts)}) {axis}" if len(parts) > 1 else ""
    text = f"R{ab} = F{ab}" + (along or "".join(f" + {p}" for p in parts))
    out.append(Statement("reaction", ends, frozenset(parts), text))
    if len(parts) > 1:
        out.append(Statement("pitch", (k + 1,), frozenset(["rho F + M"]), f"rho{k + 1} F^{axis} + M^{axis} = 0"))
    return out


def _of_driver(at: Matrix) -> Statement:
    k, _ = at.f.mechanism.freedom(at.f.mechanism.drives[0].freedom)
    pair = at.f.mechanism.pairs[k]
    link, sign = at.side(pair)
    (column,) = at.columns(pair.name, driver=True)
    (part,) = _wrench_text(k, *at.dual(k, sign * at.Q[at.rows(link), column]), None, "IN")
    return Statement("driver", (), frozenset([part]), f"FIN = {part}")


def _of_link(at: Matrix, link: str) -> Statement:
    """Sum of the reactions on a link, its inertia, the output (the only applied load), the driver effort."""
    n, rows = at.number[link], at.rows(link)
    terms = []
    for pair in at.f.mechanism.pairs:
        free = at.Q[np.ix_(rows, at.columns(pair.name)[:6])][3, 0]
        if free:
            other = at.number[pair.a if pair.b == link else pair.b]
            terms.append(f"R{other}{n}" if (free > 0) == (pair.b == link) else f"R{n}{other}")
    known = [k.symbol.place[0] for k in at.f.equations[rows[0]].known]
    terms += [f"FI{n}"] * ("I" in known) + ["FOUT"] * ("L" in known)
    drives = [j for j, u in enumerate(at.f.unknowns) if u.group == "driver"]
    terms += ["FIN"] * bool(np.abs(at.Q[np.ix_(rows, drives)]).max() > 0)
    return Statement("motion", (n,), frozenset(terms), " + ".join(terms) + " = 0")


def _of_condition(at: Matrix, k: int) -> Statement:
    """``F^ . A^ = 0``: the rows must be (A, 0), up to its free scale, and (A0, A) on the free force and moment."""
    pair = at.f.mechanism.pairs[k]
    rows = [i for i, e in enumerate(at.f.equations) if e.link is None and e.owner == pair.name]
    found = at.Q[np.ix_(rows, at.columns(pair.name)[:6])]
    axis, moment = at.axes[k, :3], at.axes[k, 3:]
    found[0] /= axis @ found[0, :3]
    assert np.allclose(found, [[*axis, 0, 0, 0], [*moment, *axis]], atol=1e-12)
    ends = (at.number[pair.a], at.number[pair.b])
    return Statement("condition", ends, frozenset([f"A{k + 1}"]), f"F{ends[0]}{ends[1]} . A{k + 1} = 0")


def generated_statements(f: mg.Formulation, s: mg.Solution) -> list[Statement]:
    """Reactions, driver, equations of motion and conditions in the order in which Lee gives them."""
    at = matrix(f, s)
    m = f.mechanism
    first, *others = [_of_pair(at, k) for k in range(len(m.pairs))]
    out = [*first, _of_driver(at), *(x for xs in others for x in xs)]
    out += [_of_link(at, link.name) for link in m.links if link.name != m.frame]
    return out + [_of_condition(at, k) for k in range(len(m.pairs))]


# --- side by side -------------------------------------------------------------------------------------------------------


def _meaning(wrench: str) -> tuple[bool, str]:
    """Whether a couple (dual part) or a force, and the axis: the letter and its superscript only name the unknown."""
    return wrench.startswith("e "), wrench.split()[-1]


def compared(printed: Statement, generated: Statement) -> tuple[str, str]:
    """Verdict and difference of two statements about the same thing."""
    left = "" if printed.left == generated.left else f"{printed.left} for {generated.left} on the left"
    if printed.parts == generated.parts:
        turned = printed.about != generated.about
        return (LETTER, left) if left else (OTHER_SIDE if turned else AGREES, "")
    extra, gone = sorted(printed.parts - generated.parts), sorted(generated.parts - printed.parts)
    words = f"{', '.join(extra) or 'nothing'} for {', '.join(gone) or 'nothing'}"
    if printed.kind in ("reaction", "driver"):
        same = {_meaning(p) for p in extra} == {_meaning(p) for p in gone}
        return (LETTER if same else WRENCH), words
    return (LETTER if extra and gone else LEFT_OUT if gone else WRENCH), words


def output_only(name: str) -> mg.Mechanism:
    """A library mechanism with its output as the only load, as the thesis has it."""
    m = mg.load(name)
    return m.replace(loads=[load for load in m.loads if isinstance(load, mg.Effort)])


def matched(name: str, f: mg.Formulation | None = None) -> list[Match]:
    """Every printed equation of a mechanism beside the generated one, and generated ones that are not printed."""
    m = output_only(name)
    s = mg.solve(m)
    statements = generated_statements(mg.formulate(m, bookkeeping="lee") if f is None else f, s)
    left = {x.key: x for x in statements}
    done: dict[tuple[str, frozenset[int]], Statement] = {}
    out = []
    for number, text in printed_equations(name):
        p = parsed(text)
        if p.key in left:
            g = done[p.key] = left.pop(p.key)
            out.append(Match(number, text, g.text, *compared(p, g)))
        else:
            g = done[p.key]
            out.append(Match(number, text, g.text, TWICE, "nothing new"))
    return out + [Match("", "", g.text, LEFT_OUT, "not printed") for g in left.values()]


def table(name: str) -> str:
    """The equations side by side as plain text."""
    rows = [("number", "Lee", "generated", "verdict")]
    for x in matched(name):
        rows.append((x.number, x.printed, x.generated, x.verdict + (f": {x.difference}" if x.difference else "")))
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    lines = ["  ".join([*(c.ljust(w) for c, w in zip(row, widths, strict=False)), row[3]]).rstrip() for row in rows]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
