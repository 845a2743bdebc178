"""XML from strangers: elements with their lines, read by the parser of the standard library without anything that a text could make it do.

A document type declaration, by which entities multiply and other files are read, is refused; the size of a file is limited by
``reading.text_of``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import FileError
from mechgraph.exchange.indented import numbers_of
from mechgraph.files import text_of
from mechgraph.quantities import shown


@dataclass
class Element:
    """An element: its tag, attributes, line and children."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> list[Element]:
        """The children of a tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Element | None:
        """The first child of a tag."""
        return next((child for child in self.children if child.tag == tag), None)

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


def read_xml(path: Path, kind: str, root: str) -> Element:
    """The root element of a file.

    Raises
    ------
    FileError
        where it cannot be read, is no XML, has a document type declaration or another root.
    """
    text = text_of(path, kind)
    parser = expat.ParserCreate()
    top = Element("", {}, 0)
    open_ = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        made = Element(tag, attributes, parser.CurrentLineNumber)
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
        raise FileError(path, f"is no {kind}: line {error.lineno}: {expat.ErrorString(error.code)}") from None
    found = top.children[0]
    if found.tag != root:
        raise FileError(path, f"is no {kind}: its root is <{shown(found.tag)[1:-1]}>, expected <{root}>")
    return found
