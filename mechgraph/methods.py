"""Methods that a user looks for on a class of a lower room and that a room above answers.

The class keeps a method of one line, ``return methods.call("view", self)``; the top of the package finds the function.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

Name = Literal[
    "snapped",
    "equivalent",
    "to_planar",
    "to_spatial",
    "view",
    "draw_branches",
    "draw_points",
    "draw_side_by_side",
    "film_of",
    "cutter_path",
    "write_curve",
]
HOMES: list[Callable[[Name], Callable[..., Any]]] = []
"""What gives the function of a name, put here by the top of the package."""


def call(name: Name, *args: Any, **named: Any) -> Any:
    """What the function of that name in a room above returns."""
    return HOMES[0](name)(*args, **named)
