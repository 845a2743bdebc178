"""Texts of other programs: indented blocks, XML, formulas.

XML from strangers: elements with their lines, read by the parser of the standard library without anything that a text could make it do.

A document type declaration, by which entities multiply and other files are read, is refused; the size of a file is limited by
``reading.text_of``.

Formulas of time, as FreeCAD's motions hold them: value, rate and acceleration, differentiated exactly.

A formula is a sum of products of numbers, ``time``, ``pi``, variables that the file defines by formulas, the four operations, powers
(``^``), the functions of ``FUNCTIONS``, ``rampstep(u, u0, y0, u1, y1)``, a straight line from one constant to another, and
``integral(time, f)`` from the time 0 (OndselSolver, SymbolicParser and RampStepFunction). It is read into a syntax tree of which only
these parts are known; nothing of it is ever executed.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from mechgraph.errors import FileError
from mechgraph.fields import second_direction
from mechgraph.files import text_of
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.pair import Marker
from mechgraph.quantities import LARGEST, shown


@dataclass
class Node:
    """A line, its number in the file, and the lines below it that stand deeper."""

    text: str
    line: int
    children: list[Node] = field(default_factory=list)

    def child(self, label: str) -> Node | None:
        """The first child of that text."""
        return next((node for node in self.children if node.text == label), None)

    def under(self, label: str) -> list[Node]:
        """The children of the first child of that text; none where there is none."""
        found = self.child(label)
        return found.children if found else []

    def word(self, label: str) -> str:
        """What stands below the first child of that text; empty where nothing does."""
        return next((node.text for node in self.under(label)), "")

    def numbers(self, label: str, shape: tuple[int, ...], where: str, faults: list[str]) -> Array:
        """Finite numbers below a label, row by row; zeros, and a fault, where they are not of that shape."""
        found = self.child(label)
        if found is None:
            faults.append(f"line {self.line}: {where}: {label} is missing")
            return np.zeros(shape)
        given, size = " ".join(node.text for node in found.children), int(np.prod(shape))
        values = numbers_of(given)
        if values is None or len(values) != size:
            text = shown(" ".join(given.split()))
            faults.append(f"line {found.line}: {where}: {label} = {text}: expected {size} finite numbers")
            return np.zeros(shape)
        return np.array(values).reshape(shape)

    def number(self, label: str, where: str, faults: list[str]) -> float:
        """One finite number below a label."""
        return float(self.numbers(label, (1,), where, faults)[0])


def numbers_of(text: str) -> list[float] | None:
    """The numbers of a line, separated by tabs or spaces; None where something else stands there or one is not finite."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        return None
    return found if all(abs(value) < LARGEST for value in found) else None


def tree_of(lines: Sequence[str], first: int = 1) -> Node:
    """The tree of some lines of a file, the first of which has the number ``first``; blank lines count for nothing."""
    root = Node("", first)
    path: list[tuple[int, Node]] = [(-1, root)]
    for number, line in enumerate(lines, first):
        if text := line.strip():
            depth, node = len(line) - len(line.lstrip("\t")), Node(text, number)
            while path[-1][0] >= depth:
                path.pop()
            path[-1][1].children.append(node)
            path.append((depth, node))
    return root


@dataclass
class XmlElement:
    """An element: its tag, attributes, line and children."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[XmlElement] = field(default_factory=list)

    def all(self, tag: str) -> list[XmlElement]:
        """The children of a tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> XmlElement | None:
        """The first child of a tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def of(self, tag: str, key: str) -> str:
        """An attribute of the first child of a tag; empty where there is none."""
        found = self.first(tag)
        return found.attributes.get(key, "") if found else ""

    @property
    def title(self) -> str:
        """Line, tag and name, for messages."""
        name = self.attributes.get("name")
        return f"line {self.line}: {self.tag}" + (f" {shown(name)}" if name is not None else "")

    def numbers(self, key: str, shape: tuple[int, ...], default: Array | None, faults: list[str]) -> Array:
        """Finite numbers of an attribute; the default where it is left out (a fault where there is none)."""
        if key not in self.attributes and default is not None:
            return default
        found = numbers_of(self.attributes.get(key, ""))
        size = int(np.prod(shape))
        if found is None or len(found) != size:
            given = f" = {shown(self.attributes[key])}" if key in self.attributes else " is missing"
            faults.append(f"{self.title}: {key}{given}: expected {size} finite number{'s' * (size > 1)}")
            return np.zeros(shape) if default is None else default
        return np.array(found).reshape(shape)

    def number(self, key: str, default: float | None, faults: list[str]) -> float:
        """A finite number of an attribute."""
        return float(self.numbers(key, (1,), None if default is None else np.array([default]), faults)[0])


def read_xml(path: Path, kind: str, root: str) -> XmlElement:
    """The root element of a file.

    Raises
    ------
    FileError
        where it cannot be read, is no XML, has a document type declaration or another root.
    """
    text = text_of(path, kind)
    parser = expat.ParserCreate()
    top = XmlElement("", {}, 0)
    open_ = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        made = XmlElement(tag, attributes, parser.CurrentLineNumber)
        open_[-1].children.append(made)
        open_.append(made)

    def declared(*_: object) -> None:
        raise FileError(path, f"line {parser.CurrentLineNumber}: a document type declaration is not read; remove it")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_.pop()
    parser.StartDoctypeDeclHandler = declared
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        why = f"line {error.lineno}: {expat.ErrorString(error.code)}"
        raise FileError(path, f"is not a valid {kind} file: {why}") from None
    found = top.children[0]
    if found.tag != root:
        raise FileError(path, f"is not a valid {kind} file: its root is <{shown(found.tag)[1:-1]}>, expected <{root}>")
    return found


def marker_at(X: Array) -> Marker:
    """The marker at a pose ``(3, 4)``."""
    return Marker(tuple(X[:, 3]), tuple(X[:, 2]), tuple(X[:, 0]))


def pose_about(z: Array, point: Array) -> Array:
    """A pose ``(3, 4)`` whose third axis has a direction."""
    z = z / np.linalg.norm(z)
    x = np.array(second_direction(z))
    return np.column_stack([x, np.cross(z, x), z, point])


DECIMAL = r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
DOUBLE = re.compile(rf"(?<![\w.])({DECIMAL})d(?:([-+]?\d+)|(?!\w))", re.ASCII)
"""A number with the letter that Smalltalk writes in one of double precision, before an exponent or without: ``4.0d*pi*time``, ``1d-3``."""
QUOTED = re.compile(r'^"(.*)"$', re.DOTALL)
"""A whole formula in quotes; a line break within it is written ``<n>``."""
TOKENS = re.compile(rf"(?:{DECIMAL}(?:d[-+]?\d+|d)?(?![\w.])|[a-z]\w*|[-+*/^(),]|\s)*+", re.ASCII)
"""What a formula consists of: not all that is an expression to Python (``0x10``, ``1_0``, what stands behind ``#``) is one."""


class FormulaFault(Exception):
    """Why a formula cannot be evaluated."""


@dataclass(frozen=True)
class Jet:
    """A function of time by its value, rate and acceleration; ``(uv)'' = u''v + 2u'v' + uv''``."""

    s: Any
    v: Any = 0.0
    a: Any = 0.0

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.s + other.s, self.v + other.v, self.a + other.a)

    def __neg__(self) -> Jet:
        return Jet(-self.s, -self.v, -self.a)

    def __sub__(self, other: Jet) -> Jet:
        return self + -other

    def __mul__(self, other: Jet) -> Jet:
        acceleration = self.a * other.s + 2 * self.v * other.v + self.s * other.a
        return Jet(self.s * other.s, self.v * other.s + self.s * other.v, acceleration)

    def __truediv__(self, other: Jet) -> Jet:
        return self * other.through(lambda u: 1 / u, lambda u: -1 / u**2, lambda u: 2 / u**3)

    def __pow__(self, other: Jet) -> Jet:
        if np.any(other.v) or np.any(other.a):
            raise FormulaFault("a power whose exponent changes with time")
        n = other.s

        def power(times: float, exponent: float) -> Callable[[Any], Any]:
            return lambda u: times * u**exponent if times else np.zeros_like(u)

        return self.through(power(1.0, n), power(n, n - 1), power(n * (n - 1), n - 2))

    def through(self, f: Callable[[Any], Any], rate: Callable[[Any], Any], second: Callable[[Any], Any]) -> Jet:
        """``f(u)``, ``f'(u) u'`` and ``f''(u) u'^2 + f'(u) u''``; a constant has no rates, also where f has no slope (``sqrt(0)``)."""
        if not (np.any(self.v) or np.any(self.a)):
            return Jet(f(self.s))
        slope = rate(self.s)
        return Jet(f(self.s), slope * self.v, second(self.s) * self.v**2 + slope * self.a)


Derivatives = tuple[Callable[[Any], Any], Callable[[Any], Any], Callable[[Any], Any]]
FUNCTIONS: dict[str, Derivatives] = {
    "sin": (np.sin, np.cos, lambda u: -np.sin(u)),
    "cos": (np.cos, lambda u: -np.sin(u), lambda u: -np.cos(u)),
    "tan": (np.tan, lambda u: 1 / np.cos(u) ** 2, lambda u: 2 * np.tan(u) / np.cos(u) ** 2),
    "arcsin": (np.arcsin, lambda u: (1 - u**2) ** -0.5, lambda u: u * (1 - u**2) ** -1.5),
    "arccos": (np.arccos, lambda u: -((1 - u**2) ** -0.5), lambda u: -u * (1 - u**2) ** -1.5),
    "arctan": (np.arctan, lambda u: 1 / (1 + u**2), lambda u: -2 * u / (1 + u**2) ** 2),
    "abs": (np.abs, np.sign, np.zeros_like),
    "exp": (np.exp, np.exp, np.exp),
    "ln": (np.log, lambda u: 1 / u, lambda u: -1 / u**2),
    "sqrt": (np.sqrt, lambda u: 0.5 * u**-0.5, lambda u: -0.25 * u**-1.5),
}
"""Functions of a formula with their first and second derivatives."""
PIECES = ("rampstep", "integral")
"""Functions of several arguments."""
FUNCTIONS |= {short: FUNCTIONS[long] for short, long in (("asin", "arcsin"), ("acos", "arccos"), ("atan", "arctan"))}
OPERATIONS: dict[type[ast.operator], Callable[[Jet, Jet], Jet]] = {
    ast.Add: Jet.__add__, ast.Sub: Jet.__sub__, ast.Mult: Jet.__mul__, ast.Div: Jet.__truediv__,
    ast.Pow: Jet.__pow__,
}  # fmt: skip


KNOWN = ("time", "pi", *FUNCTIONS, *PIECES)
NONE: Mapping[str, str] = {}


class KnownJets(dict[str, Jet]):
    """Jets by name; a variable's is found from its formula when it is first asked for. ``kinks``: where ramps begin and end."""

    def __init__(self, jets: Mapping[str, Jet], variables: Mapping[str, str]) -> None:
        super().__init__({"pi": Jet(np.pi), **jets})
        self.names = dict.fromkeys([*self, *variables])
        self.variables, self.waiting = variables, dict(variables)
        self.kinks = {0.0}

    def ramp(self, u: Jet, *ends: Jet) -> Jet:
        """``rampstep``: y0 before u0, y1 behind u1, a straight line between."""
        if len(ends) != 4 or any(np.ndim(end.s) for end in ends) or not ends[0].s < ends[2].s:
            raise FormulaFault("rampstep: expected an argument and four numbers u0, y0, u1, y1 with u0 below u1")
        u0, y0, u1, y1 = (float(end.s) for end in ends)
        self.kinks |= {u0, u1}
        slope = np.where((u.s >= u0) & (u.s < u1), (y1 - y0) / (u1 - u0), 0.0)
        return Jet(np.interp(u.s, [u0, u1], [y0, y1]), slope * u.v, slope * u.a)

    def integral(self, f: ast.expr) -> Jet:
        """``integral(time, f)`` from the time 0, by Gauss-Legendre between all times and kinks; halves of these must give the same."""
        found, t = _jet(f, self), np.asarray(self["time"].s, float)
        u, w = np.polynomial.legendre.leggauss(16)

        def over(knots: Array) -> Array:
            half = np.diff(knots)[:, None] / 2
            inner = KnownJets({"time": Jet(knots[:-1, None] + half * (1 + u))}, self.variables)
            parts = (np.broadcast_to(_jet(f, inner).s, (len(half), len(u))) * w * half).sum(1)
            whole = np.concatenate([[0.0], np.cumsum(parts)])
            return np.asarray(np.interp(t, knots, whole) - np.interp(0.0, knots, whole))

        knots = np.unique([*t.ravel(), *(k for k in self.kinks if abs(k) < LARGEST)])
        first, value = over(knots), over(np.unique([*knots, *(knots[1:] + knots[:-1]) / 2]))
        # rounding of some hundred sums
        if np.abs(value - first).max() > 1e-12 * max(np.abs(value).max(), np.abs(t).max() * np.abs(found.s).max()):
            raise FormulaFault(f"{shown(ast.unparse(f))} changes too quickly between the times to be integrated")
        return Jet(value, found.s, found.v)

    def __missing__(self, name: str) -> Jet:
        formula = self.waiting.pop(name, None)
        if formula is None:
            raise FormulaFault(f"variable {shown(name)} is defined by itself")
        self[name] = found = _jet(_tree(formula), self)
        return found


def is_name(name: str) -> bool:
    """Whether a variable may have that name."""
    key = name.lower()
    return re.fullmatch(r"[a-z]\w*", key, re.ASCII) is not None and key not in (*KNOWN, "self")


def evaluated(formula: str, t: Array, variables: Mapping[str, str] = NONE) -> tuple[Array, Array, Array]:
    """Value, rate and acceleration ``(T,)`` of a formula at times ``t (T,)``; ``variables`` are formulas by their names in lower case.

    Raises
    ------
    FormulaFault
        where it is none, holds what is not known here, or has no finite value.
    """
    jet = _found(formula, _tree(formula), KnownJets({"time": Jet(t, np.ones_like(t), np.zeros_like(t))}, variables))
    value, rate, acceleration = (np.array(np.broadcast_to(part, t.shape), float) for part in (jet.s, jet.v, jet.a))
    if not all(np.isfinite(part).all() for part in (value, rate, acceleration)):
        raise FormulaFault(f"{shown(formula)} has no finite value, rate or acceleration at some of the times")
    return value, rate, acceleration


def law(formula: str, variables: Mapping[str, str] = NONE) -> Callable[[Array, Array, Array], Array]:
    """A force by the formula of it: a function of distance ``rIJ(self)``, its rate ``vrIJ(self)`` and time, ``(T,)`` each.

    Raises
    ------
    FormulaFault
        where it is none, or holds what is not known here.
    """
    tree = _tree(formula)

    def value(x: Array, v: Array, t: Array) -> Array:
        known = KnownJets({"rij(self)": Jet(x), "vrij(self)": Jet(v), "time": Jet(t)}, variables)
        found = _found(formula, tree, known)
        return np.array(np.broadcast_to(found.s, np.shape(x)), float)

    value(*np.ones((3, 1)))
    return value


def _tree(formula: str) -> ast.expr:
    """The syntax tree of a formula."""
    text = QUOTED.sub(r"\1", formula.strip()).replace("<n>", " ").lower()
    longest_formula = 2000  # characters of a formula
    if len(text) > longest_formula:
        raise FormulaFault(f"longer than {longest_formula} characters")
    with suppress(SyntaxError, ValueError, MemoryError, RecursionError):
        if TOKENS.fullmatch(text):
            text = DOUBLE.sub(lambda m: m[1] + (f"e{m[2]}" if m[2] else ""), text)
            return ast.parse(text.replace("^", "**"), mode="eval").body
    raise FormulaFault(_none(formula))


def _none(formula: str) -> str:
    return f"{shown(formula)} is no formula of time, such as 2*pi*time"


def _found(formula: str, tree: ast.expr, known: KnownJets) -> Jet:
    """The jet of a formula where what is ``known`` has these."""
    try:
        with np.errstate(all="ignore"):
            return _jet(tree, known)
    except (ValueError, OverflowError, MemoryError, RecursionError, ZeroDivisionError):
        raise FormulaFault(_none(formula)) from None


def _jet(node: ast.expr, known: KnownJets) -> Jet:
    """The jet of a part of a formula."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return Jet(np.float64(number))  # a root of a negative number is none; that of a Python float is complex
        case ast.Name(id=name) if name in known.names:
            return known[name]
        case ast.Call(func=ast.Name(id=name), args=[ast.Name(id="self")], keywords=[]) if (
            f"{name}(self)" in known.names
        ):
            return known[f"{name}(self)"]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_jet(inner, known)
        case ast.UnaryOp(op=ast.UAdd(), operand=inner):
            return _jet(inner, known)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATIONS:
            return OPERATIONS[type(op)](_jet(left, known), _jet(right, known))
        case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in FUNCTIONS:
            return _jet(inner, known).through(*FUNCTIONS[name])
        case ast.Call(func=ast.Name(id="rampstep"), args=inner, keywords=[]) if inner:
            return known.ramp(*(_jet(part, known) for part in inner))
        case ast.Call(func=ast.Name(id="integral"), args=[ast.Name(id="time"), inner], keywords=[]):
            return known.integral(inner)
    names = ", ".join(dict.fromkeys([*KNOWN[:2], *known.names, *KNOWN]))
    raise FormulaFault(f"{shown(ast.unparse(node))} is not known in a formula (known: {names}, + - * / ^)")
