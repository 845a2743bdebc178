"""Events of a motion as they are declared: the times at which a quantity passes a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, get_args

from mechgraph.errors import DeclarationError
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import FLAG, FREEDOM_NAME, NUMBER, OTHER, POSITION, TEXT
from mechgraph.model.nameable import Nameable
from mechgraph.quantities import is_numeric, shown, wrong
from mechgraph.units import factor_of

What = Literal["position", "velocity", "acceleration"]
WHATS: tuple[What, ...] = get_args(What)


@dataclass(frozen=True)
class Event(Described):
    """A quantity that passes a value: ``of`` is the name of a freedom, or a function of the Solution at one time that gives a number.

    ``what``: of a freedom its ``"position"``, ``"velocity"`` or ``"acceleration"``; ``direction``: 1 for rising, -1 for falling, 0 for
    both; ``terminal``: the motion ends there.
    """

    of: Annotated[Any, FREEDOM_NAME("the freedom that is watched")]
    value: Annotated[float, NUMBER("the value that it passes", **POSITION)] = 0.0
    what: Annotated[What, TEXT("what of it", choices=WHATS)] = "position"
    direction: Annotated[int, OTHER("1: rising, -1: falling, 0: both", default="0", rules={"enum": [-1, 0, 1]})] = 0
    terminal: Annotated[bool, FLAG("whether the motion ends there")] = False
    name: Annotated[str, TEXT("what it is called", default="in words")] = ""

    @property
    def text(self) -> str:
        """The event in words."""
        if self.name:
            return self.name
        of = f"{self.what} of {self.of}" if isinstance(self.of, str) else getattr(self.of, "__name__", "function")
        return f"{of} passes {self.value:g}"

    def faults(self, m: Nameable) -> list[str]:
        """What is wrong with it."""
        found = []
        if isinstance(self.of, str):
            fault = m.freedom_fault(self.of, single=True)
            found += [f"event: {fault}"] if fault else []
        elif not callable(self.of):
            found.append(f"event of {shown(self.of)}: expected the name of a freedom, or a function of a Solution")
        if not is_numeric(self.value, ()):
            return [*found, f"event of {shown(self.of)}: {wrong(self.value, 'value', 'a finite number')}"]
        if self.what not in WHATS:
            found.append(f"event {self.text}: {wrong(self.what, 'what', ', '.join(map(repr, WHATS)))}")
        if self.direction not in (-1, 0, 1):
            found.append(f"event {self.text}: {wrong(self.direction, 'direction', '-1, 0 or 1')}")
        return found

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """See ``Described``; the dimension of the value is that of ``what``."""
        if not isinstance(self.of, str):
            raise DeclarationError("to_units", [f"event {self.text}: watches a function; convert it yourself"])
        dimension = (0 if turns else 1, 0, -WHATS.index(self.what))
        return self.replace(value=self.value * factor_of(dimension, base))
