"""Arguments at the public doors: one check and one sentence for each that is of the wrong kind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from mechgraph.quantities import wrong


def option_faults(allowed: Mapping[str, tuple[Any, Iterable[str]]]) -> list[str]:
    """Options, name -> (value, allowed texts), whose value is not allowed."""
    return [
        wrong(value, name, f"one of {', '.join(map(repr, texts))}")
        for name, (value, texts) in allowed.items()
        if not isinstance(value, str) or value not in texts
    ]


def items_of(value: Any, what: str, faults: list[str]) -> tuple[Any, ...]:
    """The items of a list (or of any other iterable but a text or a mapping); for all else a fault and no items."""
    if not isinstance(value, str | bytes | Mapping):
        try:
            return tuple(value)
        except TypeError:
            pass
    faults.append(wrong(value, what, "a list"))
    return ()
