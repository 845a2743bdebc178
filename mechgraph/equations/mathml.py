"""Words of equations as MathML, from the same symbols as text and LaTeX."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable

from mechgraph.document.tree import plain
from mechgraph.equations.symbols import LATEX_LETTERS, Symbol

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
    tag = {(False, False): "", (True, False): "msub", (False, True): "msup", (True, True): "msubsup"}[
        bool(below), bool(above)
    ]
    return f"<{tag}>{''.join(parts)}</{tag}>" if tag else base


def _above(along: str) -> str:
    """A direction, ``A'``, an inverse, or a name in the user's words."""
    if along == "-1":
        return "<mo>−</mo><mn>1</mn>"
    if along == "0":
        return "<mn>0</mn>"
    if along.rstrip("'") in ("A", "X", "Y"):
        return f"<mi>{along[0]}</mi>" + ("<mo>" + "′" * (len(along) - 1) + "</mo>" if len(along) > 1 else "")
    return _text(along)
