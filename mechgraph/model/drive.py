"""Drives: which freedoms are moved from outside, and the motion stored with them."""

from __future__ import annotations

from dataclasses import dataclass

from mechgraph.model.motion import Motion


@dataclass(frozen=True)
class Drive:
    """A driven freedom, ``"A"`` or ``"B.Tz"``, with the motion to use where ``solve`` is given none."""

    freedom: str
    motion: Motion | None = None
