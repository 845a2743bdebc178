r"""A LaTeX file that compiles by itself: a preamble, long equations in lines, long tables over pages.

It needs what every distribution brings (amsmath, geometry, longtable) and no fonts but Knuth's; a sign that these do not have is shown by
its number, ``[U+4E2D]``.
"""

from __future__ import annotations

import re
import unicodedata
from itertools import pairwise

from mechgraph.document.latex import block_latex, section, tabular
from mechgraph.document.tree import Block, Document, Equation, Table, joined, plain

LINE_SIGNS = 78
"""Signs of usual width that a line of an equation holds."""
ACCENTS = {0x300, 0x301, 0x302, 0x303, 0x304, 0x306, 0x307, 0x308, 0x30A, 0x30B, 0x30C, 0x327}
"""Combining accents that TeX sets on letters; it knows these letters itself."""
SIGNS = {
    "°": r"^\circ", "²": "^2", "³": "^3", "¹": "^1", "·": r"\cdot", "×": r"\times", "±": r"\pm", "µ": r"\mu", "−": "-", "→": r"\to",
    "≤": r"\le", "≥": r"\ge", "≠": r"\ne", "≈": r"\approx", "∞": r"\infty", "∑": r"\sum", "√": r"\surd", "∂": r"\partial",
}  # fmt: skip
"""Signs as formulas."""
LETTERS = "ßæøåÆØÅœŒłŁ¡¿§¶©–—‘’“”…"
"""What TeX knows itself beside letters with accents."""
GREEK = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi omega"
GREEK_CAPITALS = "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"


def to_latex_file(document: Document) -> str:
    """The document as a whole file for pdflatex."""
    body = joined([section(document.title, 0), *map(_block, document.blocks)], "\n\n")
    declared = [_declared(sign) for sign in sorted(set(body)) if ord(sign) > 127 and not _known(sign)]
    head = [
        r"\documentclass[a4paper]{article}",
        r"\usepackage{amsmath}",
        r"\usepackage[margin=2cm]{geometry}",
        r"\usepackage{longtable}",
        r"\allowdisplaybreaks",
        r"\setcounter{secnumdepth}{0}",
        *declared,
        r"\begin{document}",
    ]
    return "\n".join(head) + f"\n{body}\\end{{document}}\n"


def _block(block: Block) -> str:
    if isinstance(block, Equation) and plain(block.latex):
        return _broken(plain(block.latex))
    if isinstance(block, Table) and not plain(block.caption):
        return "\n".join(tabular(block, "longtable"))
    return block_latex(block)


# --- equations in lines ------------------------------------------------------------------------------------------------


def _broken(latex: str) -> str:
    """A displayed equation, in lines where it is long: broken before signs, and within a product where that alone is too long."""
    lines: list[str] = []
    for term in _terms(latex):
        for part in [term] if _width(term) <= LINE_SIGNS else _pieces(term):
            if lines and _width(lines[-1]) + _width(part) < LINE_SIGNS:
                lines[-1] += f" {part}"
            else:
                lines.append(part)
    if len(lines) == 1:
        return f"\\[\n{latex}\n\\]"
    return "\n".join([r"\begin{multline*}", *(rf"{line} \\" for line in lines[:-1]), lines[-1], r"\end{multline*}"])


def _pieces(latex: str) -> list[str]:
    """The pieces between spaces that stand in no brackets."""
    depth, out = 0, [""]
    for sign in latex:
        depth += (sign in "{([") - (sign in "})]")
        if sign == " " and depth == 0:
            out.append("")
        else:
            out[-1] += sign
    return [piece for piece in out if piece]


def _terms(latex: str) -> list[str]:
    """The terms of a sum with their signs; ``= 0`` is one."""
    pieces = _pieces(latex)
    cuts = [i for i, piece in enumerate(pieces) if piece in ("+", "-", "=") and i]
    return [" ".join(pieces[a:b]) for a, b in pairwise([0, *cuts, len(pieces)])]


def _width(latex: str) -> float:
    """About how many signs of usual width a formula is wide: what is raised or lowered is smaller, operators stand apart."""
    small = re.findall(r"[_^](\{[^{}]*\}|.)", latex)
    no_marks = re.sub(r"\\(hat|bar|dot|ddot|text|tag)\b", "", latex)
    operators = len(re.findall(r" (?:[-+=]|\\times) ", f" {latex} "))
    signs = re.sub(r"[{}_^\\ ]", "", re.sub(r"\\(?!exp)[a-zA-Z]+", "x", no_marks))
    return len(signs) + 1.2 * operators - 0.35 * sum(len(part.strip("{}")) for part in small)


# --- signs beyond ASCII ------------------------------------------------------------------------------------------------


def _known(sign: str) -> bool:
    """Whether TeX has a sign without being told."""
    parts = list(unicodedata.normalize("NFD", sign))
    accented = len(parts) == 2 and parts[0].isascii() and parts[0].isalpha() and ord(parts[1]) in ACCENTS
    return accented or sign in LETTERS


def _declared(sign: str) -> str:
    """What pdflatex is to make of a sign: a formula, a Greek letter, or its number."""
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(sign, ""))
    letter = (
        (greek[2].capitalize() if greek[1] == "CAPITAL" else greek[2].lower().replace("lamda", "lambda"))
        if greek
        else ""
    )
    shown = SIGNS.get(sign) or (f"\\{letter}" if letter in f"{GREEK} {GREEK_CAPITALS}".split() else "")
    meaning = rf"\ensuremath{{{shown}}}" if shown else f"[U+{ord(sign):04X}]"
    return rf"\DeclareUnicodeCharacter{{{ord(sign):04X}}}{{{meaning}}}"
