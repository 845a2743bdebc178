"""How links, pairs and screws are called in equations: Lee's numbers and letters, as text and as LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain

from mechgraph.document import latex_words
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.row_parts import Component, Freedom

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
