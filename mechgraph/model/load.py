"""Loads: small classes, each says what it does to links and freedoms. A new load is a new class with the same methods.

``act`` speaks to a ``LoadSite``, which knows poses and rates at every position of a batch, in the user's units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

from mechgraph.algebra.se3 import rotate
from mechgraph.model.field_kinds import FREEDOM_NAME, LINK_NAME, NAMED_POINT, SERIES, TEXT, VECTOR, VECTOR_SERIES
from mechgraph.model.force_law import Damper, ForceLaw, Spring, TorsionSpring
from mechgraph.model.load_base import Breaks, Load, LoadSite, Value
from mechgraph.model.nameable import Nameable
from mechgraph.units import ACCELERATION, FORCE, LENGTH, MOMENT


@dataclass(frozen=True, eq=False)
class Gravity(Load):
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
        """See ``Load``; all of it."""
        return self, None

    def energy(self, site: LoadSite) -> Any:
        """``-sum m g . c``."""
        return site.weight_energy(site.number(self.acceleration))


@dataclass(frozen=True, eq=False)
class Wrench(Load):
    """A force at a material point and a moment on one link.

    ``point`` is in the coordinates of the declared configuration, in which link frames stand on the global one (for a link
    placed by markers: its own frame), or the name of a point of the link; the mass centre where it is left out (a force on
    a link without one needs it). ``frame`` says whether force and moment have global directions or turn with the link.
    Values may be arrays over positions or a callable ``(pose, twist, t)`` of the link; ``breaks`` as of a ``ForceLaw``.
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
    breaks: Breaks = field(default=(), kw_only=True)

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
class Effort(Load):
    """A given effort in a freedom: couple about a turn, force along a slide; + on link b, - on link a.

    ``value`` may be an array over positions or a callable ``(pose, twist, t)`` of link b; ``breaks`` as of a ``ForceLaw``.
    """

    kind: ClassVar[str] = "effort"
    subject: ClassVar[str] = "effort in {freedom}"
    freedom: Annotated[str, FREEDOM_NAME("the freedom, e.g. D or B.Rx", single=False)]
    value: Annotated[Value, SERIES("couple about a turn, force along a slide; + on link b, - on link a", FORCE, MOMENT)]
    breaks: Breaks = field(default=(), kw_only=True)

    def act(self, site: LoadSite) -> None:
        """Add the effort."""
        site.add_effort(self.freedom, site.values(self.value, site.second_link(self.freedom), 1)[0])


LOADS: dict[str, type[Load]] = {c.kind: c for c in (Gravity, Wrench, Effort, Spring, TorsionSpring, Damper, ForceLaw)}
"""Load classes by the name of their kind in files."""
