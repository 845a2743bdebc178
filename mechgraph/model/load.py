"""Loads: small classes, each says what it does to links and freedoms. A new load is a new class with the same methods.

``act`` speaks to a ``LoadSite``, which knows poses and rates at every position of a batch, in the user's units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self

import numpy as np

from mechgraph.algebra.se3 import Array, rotate
from mechgraph.model.field_format import (
    FREEDOM_NAME,
    LINK_NAME,
    NAMED_POINT,
    NUMBER,
    POSITION,
    SERIES,
    TEXT,
    VECTOR,
    VECTOR_SERIES,
    Described,
)
from mechgraph.model.link import Link
from mechgraph.model.numeric import same_fields
from mechgraph.quantities import shown
from mechgraph.units import ACCELERATION, FORCE, LENGTH, MOMENT

Value = Any
"""A number or vector, an array over positions, or a callable ``(pose, twist, t)``."""

FORCE_PER_LENGTH, FORCE_PER_VELOCITY = (0, 1, -2), (0, 1, -1)


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


class Nameable(Protocol):
    """The names that a load may refer to."""

    @property
    def link_index(self) -> Mapping[str, int]:
        """Place of every link, by name."""

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: no single freedom), or None."""

    def massive_links(self) -> tuple[str, ...]:
        """Links that have mass."""

    def link(self, name: str) -> Link:
        """The link of that name."""

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""


@dataclass(frozen=True, eq=False)
class _Load(Described):
    """What all loads share: equality that also holds for arrays, and checks of what their fields hold."""

    kind: ClassVar[str]
    """Name of the kind in files."""
    subject: ClassVar[str]
    """How messages call it; fields in braces."""
    between_links: ClassVar[bool] = False
    """Whether it is a force that two links exert on each other."""

    def __post_init__(self) -> None:
        self.read_numbers()

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash(type(self).__name__)

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
        found += self.value_faults("")
        return [self.where + fault for fault in found if fault]

    @property
    def in_freedom(self) -> str | None:
        """The freedom in which this load acts; None of a load on links."""
        named = [getattr(self, name) for name, about in self.formats.items() if about.kind is FREEDOM_NAME]
        return named[0] if named else None

    def with_full_names(self, full_name: Callable[[str], str]) -> Self:
        """The same with its freedom spelled in full."""
        names = [name for name, about in self.formats.items() if about.kind is FREEDOM_NAME]
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
        return tuple(getattr(self, name) for name, about in self.formats.items() if about.kind is LINK_NAME)


@dataclass(frozen=True, eq=False)
class Gravity(_Load):
    """Uniform gravity: force ``m g`` at the mass centre of every link; ``acceleration`` is the vector g."""

    kind: ClassVar[str] = "gravity"
    subject: ClassVar[str] = "gravity"
    acceleration: Annotated[Any, VECTOR("the vector g, global", ACCELERATION)]

    def links(self, names: Nameable) -> tuple[str, ...]:
        """Links that this load acts on: all that have mass."""
        return names.massive_links()

    def act(self, site: LoadSite) -> None:
        """Add the weight of every link."""
        site.add_weight(site.number(self.acceleration))

    def parts(self) -> tuple[Self | None, Self | None]:
        """See ``_Load``; all of it."""
        return self, None

    def energy(self, site: LoadSite) -> Any:
        """``-sum m g . c``."""
        return site.weight_energy(site.number(self.acceleration))


@dataclass(frozen=True, eq=False)
class Wrench(_Load):
    """A force at a material point and a moment on one link.

    ``point`` is in the coordinates of the declared configuration, in which link frames stand on the global one (for a link
    placed by markers: its own frame), or the name of a point of the link; the mass centre where it is left out (a force on
    a link without one needs it). ``frame`` says whether force and moment have global directions or turn with the link.
    Values may be arrays over positions or a callable ``(pose, twist, t)`` of the link.
    """

    kind: ClassVar[str] = "wrench"
    subject: ClassVar[str] = "wrench on {link}"
    link: Annotated[str, LINK_NAME("the link it acts on")]
    force: Annotated[Value, VECTOR_SERIES("at least one of the two", FORCE, default="none")] = None
    moment: Annotated[Value, VECTOR_SERIES("at least one of the two", MOMENT, default="none")] = None
    point: Annotated[
        Any,
        NAMED_POINT(
            "material point, in the coordinates of the declared configuration, or the name of one of the link",
            LENGTH,
            default="mass centre",
            of="link",
        ),
    ] = None
    frame: Annotated[
        Literal["global", "link"],
        TEXT('`"link"`: force and moment turn with the link; `"global"`: they do not', choices=("global", "link")),
    ] = "global"

    def faults(self, names: Nameable) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        if self.force is None and self.moment is None:
            found.append(f"{self.where}has neither force nor moment")
        if self.force is not None and self.point is None and not found and names.link(self.link).center is None:
            found.append(f"{self.where}has a force but no point, and the link no mass centre; give point=(x, y, z)")
        return found

    def act(self, site: LoadSite) -> None:
        """Add force and moment."""
        R = site.rotation(self.link) if self.frame == "link" else None
        if self.force is not None:
            force = site.values(self.force, self.link, 3)
            point = site.number(self.point) if self.point is not None else site.center(self.link)
            at, _ = site.point(self.link, point)
            site.add_force(self.link, force if R is None else rotate(R, force), at)
        if self.moment is not None:
            moment = site.values(self.moment, self.link, 3)
            site.add_couple(self.link, moment if R is None else rotate(R, moment))


@dataclass(frozen=True, eq=False)
class Effort(_Load):
    """A given effort in a freedom: couple about a turn, force along a slide; + on link b, - on link a.

    ``value`` may be an array over positions or a callable ``(pose, twist, t)`` of link b.
    """

    kind: ClassVar[str] = "effort"
    subject: ClassVar[str] = "effort in {freedom}"
    freedom: Annotated[str, FREEDOM_NAME("the freedom, e.g. D or B.Rx", single=False)]
    value: Annotated[Value, SERIES("couple about a turn, force along a slide; + on link b, - on link a", FORCE, MOMENT)]

    def act(self, site: LoadSite) -> None:
        """Add the effort."""
        site.add_effort(self.freedom, site.values(self.value, site.second_link(self.freedom), 1)[0])


@dataclass(frozen=True, eq=False)
class Spring(_Load):
    """A straight spring (and damper) between point ``p`` of link ``a`` and point ``q`` of link ``b``.

    Tension ``stiffness (l - free_length) + damping dl/dt`` along the line of the points; points as in ``Wrench``.
    """

    kind: ClassVar[str] = "spring"
    subject: ClassVar[str] = "spring {a} - {b}"
    between_links: ClassVar[bool] = True
    a: Annotated[str, LINK_NAME("first link")]
    b: Annotated[str, LINK_NAME("second link")]
    p: Annotated[Any, NAMED_POINT("point of link a, or its name", LENGTH, of="a")]
    q: Annotated[Any, NAMED_POINT("point of link b, or its name", LENGTH, of="b")]
    stiffness: Annotated[float, NUMBER("force per length", FORCE_PER_LENGTH)]
    free_length: Annotated[float, NUMBER("length without tension", LENGTH, minimum=0.0)] = 0.0
    damping: Annotated[float, NUMBER("force per velocity", FORCE_PER_VELOCITY)] = 0.0

    def act(self, site: LoadSite) -> None:
        """Pull both links towards each other."""
        stiffness, free_length, damping = map(site.number, (self.stiffness, self.free_length, self.damping))
        (p, vp), (q, vq) = site.point(self.a, site.number(self.p)), site.point(self.b, site.number(self.q))
        d = q - p
        length = np.sqrt((d * d).sum(axis=0))
        with np.errstate(invalid="ignore", divide="ignore"):
            u = np.where(length > 0, d / length, 0.0)
            stretched = np.where((length > 0) | (np.asarray(free_length) == 0), d - free_length * u, np.nan)
        pull = stiffness * stretched + damping * (u * (vq - vp)).sum(axis=0) * u
        site.add_force(self.a, pull, p)
        site.add_force(self.b, -pull, q)

    def parts(self) -> tuple[Self | None, Self | None]:
        """See ``_Load``; the spring, and its damper."""
        return self.replace(damping=0.0), None if self.damping == 0.0 else self.replace(stiffness=0.0)

    def energy(self, site: LoadSite) -> Any:
        """``stiffness (l - free_length)^2 / 2``."""
        (p, _), (q, _) = site.point(self.a, self.p), site.point(self.b, self.q)
        stretch = np.sqrt(((q - p) ** 2).sum(axis=0)) - self.free_length
        return 0.5 * self.stiffness * stretch**2


@dataclass(frozen=True, eq=False)
class TorsionSpring(_Load):
    """A spring (and damper) in a single freedom: effort ``-stiffness (q - free) - damping dq/dt``; for turns and slides."""

    kind: ClassVar[str] = "torsion_spring"
    subject: ClassVar[str] = "torsion spring in {freedom}"
    freedom: Annotated[str, FREEDOM_NAME("a single turn or slide")]
    stiffness: Annotated[float, NUMBER("effort per coordinate", FORCE_PER_LENGTH, MOMENT)]
    free: Annotated[float, NUMBER("coordinate without effort", **POSITION)] = 0.0
    damping: Annotated[float, NUMBER("effort per rate", FORCE_PER_VELOCITY, (2, 1, -1))] = 0.0

    def act(self, site: LoadSite) -> None:
        """Add the effort of the spring."""
        stiffness, free, damping = map(site.number, (self.stiffness, self.free, self.damping))
        q, rate = site.freedom(self.freedom)
        site.add_effort(self.freedom, -stiffness * (q - free) - damping * rate)

    def parts(self) -> tuple[Self | None, Self | None]:
        """See ``_Load``; the spring, and its damper."""
        return self.replace(damping=0.0), None if self.damping == 0.0 else self.replace(stiffness=0.0)

    def energy(self, site: LoadSite) -> Any:
        """``stiffness (q - free)^2 / 2``."""
        return 0.5 * self.stiffness * (site.freedom(self.freedom)[0] - self.free) ** 2


Load = Gravity | Wrench | Effort | Spring | TorsionSpring
LOADS: dict[str, type[Load]] = {c.kind: c for c in (Gravity, Wrench, Effort, Spring, TorsionSpring)}
"""Load classes by the name of their kind in files."""
