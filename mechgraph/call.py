"""What a call to solve asks for, as its positions and forces are found by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import option_faults
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.reduction import FORMS
from mechgraph.errors import DeclarationError
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism


@dataclass(frozen=True)
class Options:
    """How to solve: force ``method`` (None: motion alone), what becomes of ``redundant`` reactions, and the ``engine``.

    ``form`` says by which form of the equations paths are followed, ``"full"`` or ``"reduced"``, or ``"auto"``: the faster one.
    ``progress`` is called with the numbers of positions done and of all that were reached, block by block.
    """

    method: str | None = "loop_wrench"
    redundant: str = "nan"
    engine: str = "auto"
    progress: Callable[[int, int], None] | None = field(default=None, compare=False)
    form: str = "auto"

    def __post_init__(self) -> None:
        if faults := option_faults({"form": (self.form, FORMS)}):
            raise DeclarationError("options of a solution", faults)


@dataclass(frozen=True)
class Starts:
    """Where the paths begin: a closed state ``x (nx, V)`` for every variant, and the systems with the numbers of variants.

    ``system_of(variants)`` for variants ``(T,)``; ``loads`` act with the numbers of every variant. ``sharing`` is the number of variants
    that differ in masses and loads alone and move alike, from the only state: their motion is found once. ``kernel``: the variants in the
    tables of the compiled kernel, where it serves.
    """

    x: Array
    system_of: Callable[[Index], System]
    loads: tuple[Load, ...]
    sharing: int = 1
    kernel: Any = None


class Call(Protocol):
    """A call whose drives, start and unknown efforts are known; ``pipeline.Pipeline`` says what each of these is."""

    m: Mechanism
    drive: DriverMotion
    options: Options
    engine: Literal["dense", "sparse"]
    system: System
    columns: Index
    lead: Index
    acting: Index
    hold: Index | None
    passive: tuple[PassiveMotion, ...]

    @property
    def leading(self) -> Index:
        """The freedoms of the leading drivers."""

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver positions, velocities or accelerations ``(d, T)`` in internal units."""
