"""Force laws: a force that depends on a coordinate, its rate and time, in a freedom or between two points.

One convention for all of them: the force acts along the coordinate ``x``, so that its power is ``F x'``. In a freedom that is an effort,
+ on link b and - on link a; between two points ``x`` is their distance, and a positive force pushes them apart.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.field_kinds import FREEDOM_NAME, LINK_NAME, NAMED_POINT, NUMBER, POSITION, TABLE
from mechgraph.model.force_table import ForceTable
from mechgraph.model.load_base import Breaks, Load, LoadSite
from mechgraph.model.nameable import Nameable
from mechgraph.quantities import is_numeric, real_array, shown, wrong
from mechgraph.units import FORCE_PER_LENGTH, FORCE_PER_VELOCITY, LENGTH, MOMENT, MOMENT_PER_RATE


class Law(Load):
    """A force ``F(x, x', t)`` in the freedom that it names, or between the point ``p`` of link ``a`` and ``q`` of link ``b``."""

    if TYPE_CHECKING:  # fields of those that act between points; annotated here, they would come before all others
        a: Any
        b: Any
        p: Any
        q: Any

    @property
    def between_links(self) -> bool:
        """Whether it is a force that two links exert on each other."""
        return self.in_freedom is None

    @abstractmethod
    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """The force ``(T,)`` at coordinates and rates ``(T,)``."""

    def act(self, site: LoadSite) -> None:
        """Add the effort, or the forces on both links."""
        if self.in_freedom is not None:
            site.add_effort(self.in_freedom, self.force(site, *site.freedom(self.in_freedom)))
            return
        p, q, length, u, rate = self._line(site)
        force = self.force(site, length, rate)
        # between points that meet, a force has no direction
        push = np.where((length > 0) | (force == 0), force * u, np.nan)
        site.add_force(self.a, -push, p)
        site.add_force(self.b, push, q)

    def _line(self, site: LoadSite) -> tuple[Array, ...]:
        """Both points ``(3, T)``, their distance ``(T,)``, the direction from p to q, and the rate of the distance."""
        (p, vp), (q, vq) = site.point(self.a, site.number(self.p)), site.point(self.b, site.number(self.q))
        d = q - p
        length = np.sqrt((d * d).sum(axis=0))
        u = np.divide(d, length, out=np.zeros_like(d), where=length > 0)
        return p, q, length, u, (u * (vq - vp)).sum(axis=0)

    def coordinate(self, site: LoadSite) -> tuple[Array, Array]:
        """The coordinate or distance ``(T,)`` and its rate."""
        if self.in_freedom is not None:
            return site.freedom(self.in_freedom)
        _, _, length, _, rate = self._line(site)
        return length, rate

    def reading(self, site: LoadSite) -> tuple[Array, Array, Array]:
        """Coordinate, rate and force, ``(T,)`` each."""
        x, v = self.coordinate(site)
        return x, v, self.force(site, x, v)


class _ByPlace(Law):
    """Where laws act that take a freedom ``"D"``, or two links with a point of each, ``a, b, p, q`` or these four as one tuple."""

    if TYPE_CHECKING:
        freedom: Any

    def _take_place(self, first: Any, *more: Any) -> None:
        """Fields from the first four arguments, as far as they are a freedom, or four in order or in one tuple."""
        given = [item is not None for item in more]
        if isinstance(first, tuple | list) and len(first) == 4 and not any(given):
            place = (None, *first)
        elif isinstance(first, str) and all(given):
            place = (None, first, *more)
        elif isinstance(first, str) and not any(given):
            place = (first, None, None, None, None)
        else:
            return
        for name, value in zip(("freedom", "a", "b", "p", "q"), place, strict=True):
            object.__setattr__(self, name, value)

    @property
    def where(self) -> str:
        """Which load it is, for messages."""
        links = " - ".join(shown(link) for link in (self.a, self.b) if link is not None)
        place = links if self.freedom is None else f"in {shown(self.freedom)}"
        return f"{self.subject} {place}".rstrip() + ": "

    def faults(self, names: Nameable) -> list[str]:
        """What is wrong with this load."""
        given = [name for name in "abpq" if getattr(self, name) is not None]
        expected = "expected a freedom alone, e.g. 'D', or two links with a point of each, ('a', 'b', p, q)"
        if self.freedom is None and len(given) < 4:
            return [f"{self.where}{', '.join(name for name in 'abpq' if name not in given)} left out; {expected}"]
        if self.freedom is not None and given:
            return [f"{self.where}beside it {', '.join(f'{n} = {shown(getattr(self, n))}' for n in given)}; {expected}"]
        return [self.where + expected] if isinstance(self.freedom, tuple | list) else super().faults(names)


class Elastic(Law):
    """``F = -stiffness (x - free) - damping x'``; ``rest`` is the name of the free coordinate."""

    rest: ClassVar[str]
    if TYPE_CHECKING:
        stiffness: Any
        damping: Any

    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """See ``Law``."""
        stiffness, free, damping = map(site.number, (self.stiffness, getattr(self, self.rest), self.damping))
        return np.asarray(-stiffness * (x - free) - damping * v)

    def parts(self) -> tuple[Self | None, Self | None]:
        """The spring, and its damper."""
        return self.replace(damping=0.0), None if self.damping == 0.0 else self.replace(stiffness=0.0)

    def energy(self, site: LoadSite) -> Any:
        """``stiffness (x - free)^2 / 2``."""
        return 0.5 * self.stiffness * (self.coordinate(site)[0] - getattr(self, self.rest)) ** 2


@dataclass(frozen=True, eq=False)
class Spring(_ByPlace, Elastic):
    """A spring (and damper) between point ``p`` of link ``a`` and point ``q`` of link ``b``, or in a freedom, ``Spring("D", ...)``.

    Tension ``stiffness (l - free_length) + damping dl/dt`` along the line of the points, points as in ``Wrench``; in a freedom
    ``-stiffness (q - free_length) - damping dq/dt``, as ``TorsionSpring``.
    """

    kind: ClassVar[str] = "spring"
    subject: ClassVar[str] = "spring"
    rest: ClassVar[str] = "free_length"
    a: Annotated[Any, LINK_NAME("first link", default="these four,")] = None
    b: Annotated[str | None, LINK_NAME("second link", default="likewise")] = None
    p: Annotated[Any, NAMED_POINT("point of link a, or its name", LENGTH, of="a", default="likewise")] = None
    q: Annotated[Any, NAMED_POINT("point of link b, or its name", LENGTH, of="b", default="likewise")] = None
    stiffness: Annotated[
        float | None,
        NUMBER("force per length, or effort per coordinate", FORCE_PER_LENGTH, MOMENT, default="must be given"),
    ] = None
    free_length: Annotated[float, NUMBER("length, or coordinate, without tension", **POSITION)] = 0.0
    damping: Annotated[float, NUMBER("force or effort per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)] = 0.0
    freedom: Annotated[str | None, FREEDOM_NAME("a single turn or slide", default="or this alone")] = None

    def __post_init__(self) -> None:
        if self.freedom is None:
            self._take_place(self.a, self.b, self.p, self.q)
        super().__post_init__()

    def faults(self, names: Nameable) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        if self.stiffness is None:
            found.append(self.where + wrong(None, "stiffness", "a finite number"))
        if self.freedom is None and is_numeric(self.free_length, ()) and self.free_length < 0:
            found.append(self.where + wrong(self.free_length, "free_length", "a number of 0 or more"))
        return found


@dataclass(frozen=True, eq=False)
class TorsionSpring(Elastic):
    """A spring (and damper) in a single freedom: effort ``-stiffness (q - free) - damping dq/dt``; for turns and slides."""

    kind: ClassVar[str] = "torsion_spring"
    subject: ClassVar[str] = "torsion spring in {freedom}"
    rest: ClassVar[str] = "free"
    freedom: Annotated[str, FREEDOM_NAME("a single turn or slide")]
    stiffness: Annotated[float, NUMBER("effort per coordinate", FORCE_PER_LENGTH, MOMENT)]
    free: Annotated[float, NUMBER("coordinate without effort", **POSITION)] = 0.0
    damping: Annotated[float, NUMBER("effort per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)] = 0.0


Place = str | tuple[str, str, Any, Any]
"""A freedom, or two links with a point of each, ``(link a, link b, p, q)``."""


@dataclass(frozen=True, eq=False)
class _Placed(_ByPlace):
    """A law placed by its first arguments: the name of a freedom, ``(link a, link b, p, q)``, or these four."""

    freedom: Annotated[Place | None, FREEDOM_NAME("a single turn or slide", default="a, b, p and q")] = None
    a: Annotated[str | None, LINK_NAME("first link", default="freedom")] = None
    b: Annotated[str | None, LINK_NAME("second link", default="freedom")] = None
    p: Annotated[Any, NAMED_POINT("point of link a, or its name", LENGTH, of="a", default="freedom")] = None
    q: Annotated[Any, NAMED_POINT("point of link b, or its name", LENGTH, of="b", default="freedom")] = None

    def __post_init__(self) -> None:
        if self.freedom is not None and self.q is None:
            self._take_place(self.freedom, self.a, self.b, self.p)
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Damper(_Placed):
    """A linear damper: ``F = -coefficient x'``, in a freedom ``"D"`` or between points ``(link a, link b, p, q)``."""

    kind: ClassVar[str] = "damper"
    subject: ClassVar[str] = "damper"
    coefficient: Annotated[float, NUMBER("effort or force per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)] = field(
        kw_only=True
    )

    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """See ``Law``."""
        return np.asarray(-site.number(self.coefficient) * v)


@dataclass(frozen=True, eq=False)
class ForceLaw(_Placed):
    """A force ``F = scale law(x - free, x', t)``, in a freedom ``"D"`` or between points ``(link a, link b, p, q)``.

    ``law`` is a ``ForceTable`` or a function of arrays ``(T,)``: coordinate, rate and time (None where the motion has no times). ``F``
    acts along the coordinate, its power is ``F x'``: + on link b and - on link a in a freedom; + pushes the points apart. ``breaks`` are
    times at which a function jumps or bends: in ``respond`` steps end there.
    """

    kind: ClassVar[str] = "force_law"
    subject: ClassVar[str] = "force law"
    law: Annotated[Any, TABLE("force over coordinate and rate", table="law")] = field(kw_only=True)
    free: Annotated[float, NUMBER("coordinate or distance at which the `x` of the law is 0", **POSITION)] = field(
        default=0.0, kw_only=True
    )
    scale: Annotated[float, NUMBER("factor of the force")] = field(default=1.0, kw_only=True)
    breaks: Breaks = field(default=(), kw_only=True)

    def faults(self, names: Nameable) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        if isinstance(self.law, ForceTable):
            return found + [self.where + fault for fault in self.law.faults("law.")]
        if not callable(self.law):
            found.append(self.where + wrong(self.law, "law", "a function (x, v, t) or a ForceTable"))
        return found

    @property
    def by_position(self) -> bool:
        """See ``Load``; functions are given arrays of positions, any of them."""
        return True

    @property
    def of_time(self) -> bool:
        """See ``Load``; a table does not."""
        return not isinstance(self.law, ForceTable)

    @property
    def smooth(self) -> bool:
        """See ``Load``; a table is not where its points are."""
        return False

    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """See ``Law``."""
        x = x - site.number(self.free)
        try:
            found = self.law.at(x, v) if isinstance(self.law, ForceTable) else self.law(x, v, site.time())
        except Exception as error:
            hint = (
                ""
                if isinstance(self.law, ForceTable)
                else "its function of arrays x, v, t (t None without times) failed: "
            )
            raise DeclarationError(self.where.removesuffix(": "), [f"{hint}{error}"]) from error
        force = real_array(found)
        if force is None or force.shape not in ((), x.shape):
            raise DeclarationError(
                self.where.removesuffix(": "),
                [wrong(found, "value of its function", f"one number for each of {len(x)} positions")],
            )
        return site.number(self.scale) * np.broadcast_to(force, x.shape)

    def parts(self) -> tuple[Self | None, Self | None]:
        """The whole, as stored where it is a table of the coordinate alone."""
        return (self, None) if isinstance(self.law, ForceTable) and self.law.has_energy else (None, self)

    def energy(self, site: LoadSite) -> Any:
        """``-scale int F dx``."""
        return self.scale * self.law.energy(self.coordinate(site)[0] - self.free)
