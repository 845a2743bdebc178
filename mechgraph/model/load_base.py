"""What all loads share: what they see of a mechanism at a batch of positions (``LoadSite``), and their checks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, Self

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import BREAKS, FREEDOM_NAME, LINK_NAME
from mechgraph.model.nameable import Nameable
from mechgraph.model.numeric import same_fields
from mechgraph.quantities import shown
from mechgraph.units import TIME

Value = Any
"""A number or vector, an array over positions, or a callable ``(pose, twist, t)``."""


Breaks = Annotated[Any, BREAKS("of a function of time: when it jumps or bends, for `respond`", TIME, default="none")]
"""Field of a load that may be a function of time; steps end there."""


class LoadSite(Protocol):
    """What a load sees of a mechanism at a batch of ``T`` positions (component axes first, positions last)."""

    def add_weight(self, acceleration: Any) -> None:
        """Force ``m g`` at the mass centre of every link, for one ``g (3,)``."""

    def rotation(self, link: str) -> Array:
        """Rotation of the link, ``(3, 3, T)``."""

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """Position and velocity ``(3, T)`` of a material point, given in the link's frame or by its name."""

    def center(self, link: str) -> Any:
        """Mass centre in the link's frame, or None."""

    def values(self, value: Value, link: str, width: int) -> Array:
        """A value at every position, ``(width, T)``; callables are called with the pose and twist of ``link``."""

    def time(self) -> Array | None:
        """Time of every position, ``(T,)``; None where the motion has no times."""

    def number(self, value: Any) -> Any:
        """A number or vector, unchanged; one that varies from case to case at every position, ``(T,)`` or ``(3, T)``."""

    def freedom(self, name: str) -> tuple[Array, Array]:
        """Coordinate and rate ``(T,)`` of a freedom."""

    def second_link(self, name: str) -> str:
        """Link b of the pair of a freedom."""

    def add_force(self, link: str, force: Array, at: Array) -> None:
        """Force ``(3, T)`` on a link at the position ``at``."""

    def add_couple(self, link: str, moment: Array) -> None:
        """Couple ``(3, T)`` on a link."""

    def add_effort(self, name: str, effort: Array) -> None:
        """Effort ``(T,)`` in a freedom: + on link b, - on link a."""

    def weight_energy(self, acceleration: Any) -> Array:
        """Potential energy ``-sum m g . c`` of the weight of all links, ``(T,)``."""


@dataclass(frozen=True, eq=False)
class Load(Described, ABC):
    """What all loads share: equality that also holds for arrays, and checks of what their fields hold."""

    _wanted = "mg.Gravity(...) or another load"

    kind: ClassVar[str]
    """Name of the kind in files."""
    subject: ClassVar[str]
    """How messages call it; fields in braces."""

    def __post_init__(self) -> None:
        self.read_numbers()

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash(type(self).__name__)

    @abstractmethod
    def act(self, site: LoadSite) -> None:
        """Add the load's forces, couples and efforts at the positions of ``site``."""

    @property
    def where(self) -> str:
        """Which load it is, for messages."""
        names = {name: shown(getattr(self, name)) for name in self.formats}
        return f"{self.subject.format(**names)}: "

    def faults(self, names: Nameable) -> list[str]:
        """What is wrong with this load."""
        found: list[str | None] = []
        for name, about in self.formats.items():
            value = getattr(self, name)
            if not isinstance(value, str):
                continue
            if about.kind is LINK_NAME and value not in names.link_index:
                found.append(f"unknown link {value!r} (links: {', '.join(names.link_index)})")
            elif about.kind is FREEDOM_NAME:
                found.append(names.freedom_fault(value, single=about.single))
            elif about.of and (link := getattr(self, about.of)) in names.link_index:
                found.append(None if value in names.link(link).points else names.link(link).point_fault(value))
        values = self.value_faults("")
        found += values
        if not values and self.break_times and not self.of_time:
            found.append(f"breaks = {shown(self.break_times)}: beside no function of time; leave them out")
        return [self.where + fault for fault in found if fault]

    @property
    def between_links(self) -> bool:
        """Whether it is a force that two links exert on each other."""
        return False

    @property
    def by_position(self) -> bool:
        """Whether it can be evaluated some positions at a time: it holds values, no callables, which see the whole batch."""
        return not any(callable(getattr(self, name)) for name in self.formats)

    @property
    def over_positions(self) -> tuple[str, ...]:
        """Names of its fields that hold an array over positions."""
        given = {name: getattr(self, name) for name, about in self.formats.items() if about.kind.shape is not None}
        return tuple(
            name
            for name, value in given.items()
            if value is not None and not callable(value) and np.ndim(value) > len(self.formats[name].kind.shape or ())
        )

    @property
    def of_time(self) -> bool:
        """Whether it may depend on time by itself."""
        return not self.by_position

    @property
    def break_times(self) -> tuple[float, ...]:
        """Times at which it is known not to be smooth."""
        return tuple(np.ravel(getattr(self, "breaks", ())).tolist())

    @property
    def smooth(self) -> bool:
        """Whether it is a smooth function of the place, and linear in the rates."""
        return self.by_position

    @property
    def in_freedom(self) -> str | None:
        """The freedom in which this load acts; None of a load on links."""
        named = [getattr(self, name) for name, about in self.formats.items() if about.kind is FREEDOM_NAME]
        return named[0] if named else None

    @property
    def takes_coordinate(self) -> bool:
        """Whether it depends on the coordinate of its freedom, which then has to be a single one."""
        return any(about.kind is FREEDOM_NAME and about.single for about in self.formats.values())

    def with_full_names(self, full_name: Callable[[str], str]) -> Self:
        """The same with its freedom spelled in full."""
        names = [name for name, about in self.formats.items() if about.kind is FREEDOM_NAME and getattr(self, name)]
        return self.replace(**{name: full_name(getattr(self, name)) for name in names}) if names else self

    def parts(self) -> tuple[Self | None, Self | None]:
        """The part that has a potential energy, and the rest."""
        return None, self

    def energy(self, site: LoadSite) -> Any:
        """Potential energy ``(T,)`` of a load that has one."""
        return 0.0

    def links(self, names: Nameable) -> tuple[str, ...]:
        """Links that this load acts on: those that it names, or those of the pair of its freedom."""
        if self.in_freedom is not None:
            return names.ends_of(self.in_freedom)
        named = (getattr(self, name) for name, about in self.formats.items() if about.kind is LINK_NAME)
        return tuple(name for name in named if name is not None)
