"""How links, pairs and screws are called in equations: Lee's numbers and letters."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair_type import Component, Freedom

LETTERS = {"x": "X", "y": "Y", "z": "A"}
"""Letter of a marker direction: A is the pair axis, as in Lee."""


@dataclass(frozen=True)
class LeeNames:
    """Numbers of links (moving ones first, then the frame) and names of the reactions of pairs."""

    link_number: dict[str, int]
    reaction: tuple[str, ...]
    opposite: tuple[str, ...]


def names_of(m: Mechanism) -> LeeNames:
    """Lee's numbering: moving links 1, 2, ... in the order of declaration, the frame last; ``R_ab`` is a on b."""
    moving = [name for name in m.link_names() if name != m.frame]
    number = {name: i + 1 for i, name in enumerate([*moving, m.frame])}
    between = Counter(frozenset((p.a, p.b)) for p in m.pairs)

    def ends(first: str, second: str, pair: str) -> str:
        i, j = number[first], number[second]
        joined = f"{i}{j}" if max(i, j) < 10 else f"{i},{j}"
        return joined if between[frozenset((first, second))] == 1 else f"{joined}({pair})"

    return LeeNames(
        number,
        tuple(ends(p.a, p.b, p.name) for p in m.pairs),
        tuple(ends(p.b, p.a, p.name) for p in m.pairs),
    )


def screw_letter(part: Component | Freedom) -> str:
    """Letter of the direction of a component or freedom: A, X, Y with a prime for every frame, else its own name."""
    values = part.wrench if isinstance(part, Component) else part.twist
    frame = part.frame if isinstance(part, Component) else 0
    nonzero = [i for i, v in enumerate(values) if v]
    if len(nonzero) == 1 and values[nonzero[0]] == 1.0:
        return LETTERS["xyz"[nonzero[0] % 3]] + "'" * frame
    return part.name


def factor_text(number: float) -> str:
    """A factor before a symbol: ``"2.5 "``, nothing for one."""
    return "" if number == 1 else f"{number:.12g} "


def subscript(symbol: str) -> str:
    """Symbols as LaTeX: ``F_12x`` -> ``F_{12x}``, ``A0_1x`` -> ``A^{0}_{1x}``; primes stay on the letter, rho is Greek."""
    text = re.sub(r"([A-Za-z])0_", r"\1^{0}_", symbol)
    text = re.sub(r"_([\w,]+(?:\([^)]*\)[xyz]?)?)", r"_{\1}", text)
    return re.sub(r"\brho_", r"\\rho_", text)
