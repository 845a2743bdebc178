"""The one way in which results show themselves: as text where they are printed, as HTML or LaTeX in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from mechgraph.arguments import with_doors
from mechgraph.document.html import to_html
from mechgraph.document.latex import to_latex
from mechgraph.document.text import to_text
from mechgraph.document.tree import Document


class Shown(ABC):
    """Something that a document tells: ``print(x)`` shows it as text, a notebook as HTML, what a notebook exports as LaTeX.

    At a prompt it shows the same text; a class whose document is long or takes time has a line of its own there (``__repr__``).
    """

    __slots__ = ()

    _every_method_is_a_door: ClassVar[bool] = True
    """Whether public methods that take arguments check them (``arguments``); a class may name its doors itself."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls._every_method_is_a_door:
            with_doors(cls)

    @abstractmethod
    def document(self) -> Document:
        """What is to be read."""

    def __str__(self) -> str:
        return to_text(self.document())

    def __repr__(self) -> str:
        return str(self).rstrip("\n")

    def _repr_html_(self) -> str:
        return to_html(self.document())

    def _repr_latex_(self) -> str:
        return to_latex(self.document())
