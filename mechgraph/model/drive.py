"""Drives: which freedoms are moved from outside, and the motion stored with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import FREEDOM_NAME, TABLE
from mechgraph.model.motion import Motion
from mechgraph.quantities import wrong


@dataclass(frozen=True)
class Drive(Described):
    """A driven freedom, ``"A"`` or ``"B.Tz"``, with the motion to use where ``solve`` is given none."""

    freedom: Annotated[str, FREEDOM_NAME("the driven freedom; not one of a rotation of S, Sg, Sp")]
    motion: Annotated[Motion | None, TABLE("used where `solve` is given none", table="motion", default="none")] = None

    def faults(self) -> list[str]:
        """What is wrong with the motion, one line each."""
        where = f"drive {self.freedom!r}: motion"
        if isinstance(self.motion, Motion):
            return self.motion.faults(f"{where}.")
        return [] if self.motion is None else [wrong(self.motion, where, "a Motion, mg.Motion(position, ...)")]
