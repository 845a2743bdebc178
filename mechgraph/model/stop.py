"""Stops as they are declared: limits of freedoms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import FREEDOM_NAME, NUMBER, POSITION
from mechgraph.model.nameable import Nameable
from mechgraph.quantities import is_numeric, shown, wrong


@dataclass(frozen=True)
class Stop(Described):
    """Limits of a freedom, ``lower`` and ``upper`` (None: no limit), which it strikes with a coefficient of ``restitution`` 0 to 1."""

    freedom: Annotated[str, FREEDOM_NAME("the freedom that is limited")]
    lower: Annotated[float | None, NUMBER("lower limit; at least one of the two", default="none", **POSITION)] = None
    upper: Annotated[float | None, NUMBER("upper limit", default="none", **POSITION)] = None
    restitution: Annotated[float, NUMBER("coefficient of restitution, 0 to 1", minimum=0.0)] = 0.0

    def faults(self, m: Nameable) -> list[str]:
        """What is wrong with it."""
        fault = m.freedom_fault(self.freedom, single=True)
        found = [fault] if fault else []
        limits = {name: value for name in ("lower", "upper") if (value := getattr(self, name)) is not None}
        found += [wrong(v, name, "a finite number") for name, v in limits.items() if not is_numeric(v, ())]
        if not limits:
            found.append("has neither lower nor upper limit")
        elif len(limits) == 2 and not found and not limits["lower"] < limits["upper"]:
            found.append(f"lower = {self.lower:g}, upper = {self.upper:g}: expected lower < upper")
        if not is_numeric(self.restitution, ()) or not 0.0 <= self.restitution <= 1.0:
            found.append(wrong(self.restitution, "restitution", "a number from 0 to 1"))
        return [f"stop of {shown(self.freedom)}: {fault}" for fault in found]
