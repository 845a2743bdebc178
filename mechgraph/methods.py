"""Methods that a user looks for on a class of a lower room and that a room above answers.

The class keeps a method of one line, ``return methods.call("view", self)``; the top of the package fills the table.
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
    "draw_assemblies",
    "draw_branches",
    "film",
    "cutter_path",
    "write_curve",
]
TABLE: dict[Name, Callable[..., Any]] = {}


def call(name: Name, *args: Any, **named: Any) -> Any:
    """What the function of that name in a room above returns."""
    return TABLE[name](*args, **named)
