"""Text in which the depth of a line is the number of its leading tabs: the tree of the lines, and numbers and names read from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mechgraph.algebra.se3 import Array
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
        rows = [numbers_of(node.text) for node in found.children]
        flat = [value for row in rows for value in row or ()]
        size = int(np.prod(shape))
        if None in rows or len(flat) != size:
            given = " ".join(word for node in found.children for word in node.text.split())
            faults.append(f"line {found.line}: {where}: {label} = {shown(given)}: expected {size} finite numbers")
            return np.zeros(shape)
        return np.array(flat).reshape(shape)


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
    for depth, node in _nodes(lines, first):
        while path[-1][0] >= depth:
            path.pop()
        path[-1][1].children.append(node)
        path.append((depth, node))
    return root


def _nodes(lines: Sequence[str], first: int) -> Iterator[tuple[int, Node]]:
    for number, line in enumerate(lines, first):
        text = line.strip()
        if text:
            yield len(line) - len(line.lstrip("\t")), Node(text, number)
