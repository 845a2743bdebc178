"""How stiff the seat of a pair is in its reaction components, and by how much it is off its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from mechgraph.fields import NUMBER, Described
from mechgraph.quantities import FORCE_PER_LENGTH, LENGTH, MOMENT, wrong


@dataclass(frozen=True)
class SeatNumbers(Described):
    """Numbers of a pair by its reaction components; those left out are None."""

    what: ClassVar[str]
    Fx: float | None = None
    Fy: float | None = None
    Fz: float | None = None
    Mx: float | None = None
    My: float | None = None
    Mz: float | None = None

    def __post_init__(self) -> None:
        self.read_numbers()

    @property
    def by_component(self) -> dict[str, float]:
        """The numbers that are given."""
        return {name: value for name in self.formats if (value := getattr(self, name)) is not None}


_K, _KM = ({"minimum": 0.0, "default": "rigid"},) * 2


@dataclass(frozen=True)
class Stiffness(SeatNumbers):
    """Declare how stiff a pair is in its reaction components: force per length, moment per radian.

    What is left out is rigid, 0 carries nothing. ``solve(..., redundant="elastic")`` splits redundant reactions by it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> p = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 1), stiffness={"Fx": 3e7, "Fz": 2e6})
    >>> p.stiffness.by_component
    {'Fx': 30000000.0, 'Fz': 2000000.0}
    """

    what: ClassVar[str] = "stiffness"
    Fx: Annotated[float | None, NUMBER("along x", FORCE_PER_LENGTH, **_K)] = None
    Fy: Annotated[float | None, NUMBER("along y", FORCE_PER_LENGTH, **_K)] = None
    Fz: Annotated[float | None, NUMBER("along z", FORCE_PER_LENGTH, **_K)] = None
    Mx: Annotated[float | None, NUMBER("about x", MOMENT, **_KM)] = None
    My: Annotated[float | None, NUMBER("about y", MOMENT, **_KM)] = None
    Mz: Annotated[float | None, NUMBER("about z", MOMENT, **_KM)] = None


@dataclass(frozen=True)
class Misfit(SeatNumbers):
    """Declare by how much the seat of a pair on link a is off its place: a length along a force, an angle about a moment.

    With the small motion u of link b there the reaction is ``-k (u - misfit)``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> p = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 1), misfit={"Fz": 2e-5})
    >>> p.misfit.by_component
    {'Fz': 2e-05}
    """

    what: ClassVar[str] = "misfit"
    Fx: Annotated[float | None, NUMBER("along x", LENGTH, default="0")] = None
    Fy: Annotated[float | None, NUMBER("along y", LENGTH, default="0")] = None
    Fz: Annotated[float | None, NUMBER("along z", LENGTH, default="0")] = None
    Mx: Annotated[float | None, NUMBER("about x", degrees=True, default="0")] = None
    My: Annotated[float | None, NUMBER("about y", degrees=True, default="0")] = None
    Mz: Annotated[float | None, NUMBER("about z", degrees=True, default="0")] = None


SEATS: dict[str, type[SeatNumbers]] = {kind.what: kind for kind in (Stiffness, Misfit)}
"""The records by the fields of a pair that hold them."""


def seat_faults(pair: Any, where: str) -> Iterator[str]:
    """What is wrong with what a pair says of its seat."""
    for what, kind in SEATS.items():
        given = getattr(pair, what)
        if given is None:
            continue
        if not isinstance(given, kind):
            yield wrong(
                given,
                where + what,
                f"a table by reaction components, such as {{'Fz': 1e7}}, or mg.{kind.__name__}(...)",
            )
            continue
        yield from given.value_faults(f"{where}{what}.")
        have = pair.type.component_names
        for name in given.by_component:
            if name not in have:
                yield f"{where}{what}: {name} is no reaction component of {pair.type.symbol}; it has {', '.join(have)}"
