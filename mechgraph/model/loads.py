"""Loads: small classes, each says what it does to links and freedoms. A new load is a new class with the same methods.

``act`` speaks to a ``LoadSite``, which knows poses and rates at every position of a batch, in the user's units. One convention for the
laws of force: the force acts along the coordinate ``x``, so that its power is ``F x'``. In a freedom that is an effort, + on link b and
- on link a; between two points ``x`` is their distance, and a positive force pushes them apart.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Protocol, Self

import numpy as np
import scipy

from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    BREAKS,
    DIRECTION,
    FREEDOM_NAME,
    LINK_NAME,
    NAMED_POINT,
    NUMBER,
    POSITION,
    RATE,
    SAMPLES,
    SERIES,
    TABLE,
    TEXT,
    VECTOR,
    VECTOR_SERIES,
    Described,
)
from mechgraph.maths.se3 import Array, rotate
from mechgraph.memo import dataclass
from mechgraph.quantities import (
    ACCELERATION,
    FORCE,
    FORCE_PER_LENGTH,
    FORCE_PER_VELOCITY,
    LENGTH,
    MOMENT,
    MOMENT_PER_RATE,
    TIME,
    is_numeric,
    real_array,
    shown,
    unknown,
    wrong,
)

Value = Any
"""A number or vector, an array over positions, or a callable ``(pose, twist, t)``."""


Breaks = Annotated[Any, BREAKS("of a function of time: when it jumps or bends, for `respond`", TIME, default="none")]
"""Field of a load that may be a function of time; steps end there."""


class LoadSite(Protocol):
    """What a load sees of a mechanism at a batch of ``T`` positions (component axes first, positions last).

    ``solves_friction``: whether forces that follow the reactions are found there.
    """

    solves_friction: bool

    def add_weight(self, acceleration: Any) -> None:
        """Force ``m g`` at the mass center of every link, for one ``g (3,)``."""

    def rotation(self, link: str) -> Array:
        """Rotation of the link, ``(3, 3, T)``."""

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """Position and velocity ``(3, T)`` of a material point, given in the link's frame or by its name."""

    def center(self, link: str) -> Any:
        """Mass center in the link's frame, or None."""

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

    def freedoms_of(self, pair: str) -> tuple[str, ...]:
        """Names of the single freedoms of a pair."""

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

    @abstractmethod
    def act(self, site: LoadSite) -> None:
        """Add the load's forces, couples and efforts at the positions of ``site``."""

    @property
    def where(self) -> str:
        """Which load it is, for messages."""
        names = {name: shown(getattr(self, name)) for name in self.formats}
        return f"{self.subject.format(**names)}: "

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        found: list[str | None] = []
        for name, about in self.formats.items():
            value = getattr(self, name)
            if not isinstance(value, str):
                continue
            if about.kind is LINK_NAME and value not in names.link_index:
                found.append(unknown("link", value, names.link_index))
            elif about.kind is FREEDOM_NAME:
                found.append(names.freedom_fault(value, single=about.single))
            elif about.of and isinstance(link := getattr(self, about.of), str) and link in names.link_index:
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
    def follows_reactions(self) -> bool:
        """Whether it depends on the reactions, and is solved with them."""
        return False

    @property
    def smooth(self) -> bool:
        """Whether it is a smooth function of the place, and linear in the rates."""
        return self.by_position

    @property
    def in_freedom(self) -> str | None:
        """The freedom in which this load acts; None of a load on links."""
        acting: str | None = getattr(self, "freedom", None)
        return acting

    @property
    def takes_coordinate(self) -> bool:
        """Whether it depends on the coordinate of its freedom, which then has to be a single one."""
        return any(about.kind is FREEDOM_NAME and about.single for about in self.formats.values())

    def parts(self) -> tuple[Self | None, Self | None]:
        """The part that has a potential energy, and the rest."""
        return None, self

    def energy(self, site: LoadSite) -> Any:
        """Potential energy ``(T,)`` of a load that has one."""
        return 0.0

    def links(self, names: Any) -> tuple[str, ...]:
        """Links that this load acts on: those that it names, or those of the pair of its freedom."""
        if self.in_freedom is not None:
            return names.ends_of(self.in_freedom)
        named = (getattr(self, name) for name, about in self.formats.items() if about.kind is LINK_NAME)
        return tuple(name for name in named if name is not None)


CUBICS = {"monotone": "PchipInterpolator", "cubic": "CubicSpline"}
"""Piecewise cubics of ``scipy.interpolate`` by the name of the interpolation."""


@dataclass(frozen=True)
class ForceTable(Described):
    """Tabulate a force over the coordinate ``x``, the rate ``v``, or a grid of both (``force[i][j]`` at ``x[i]``, ``v[j]``).

    ``"monotone"`` interpolation is once differentiable and never exceeds the neighboring values (Fritsch and Butland, 1984);
    ``"cubic"`` is a twice differentiable spline. ``outside`` the table raises, or holds the value at its end.

    Examples
    --------
    >>> import mechgraph as mg
    >>> gas = mg.ForceTable(x=[0.3, 0.5], force=[480, 400], outside="hold")
    >>> s = mg.solve(mg.load("four-bar"), {"A": 0.4}, loads=[mg.ForceLaw("A", law=gas)])
    >>> s["A"].applied_effort.round(6)
    array([440.])
    """

    x: Annotated[Any, SAMPLES("coordinates or distances, rising", **POSITION, default="over v alone")] = None
    v: Annotated[Any, SAMPLES("rates, rising", **RATE, default="over x alone")] = None
    force: Annotated[Any, SAMPLES("one for each `x` or `v`, or for both a row of `v` for each `x`", FORCE, MOMENT)] = ()
    interpolation: Annotated[
        Literal["monotone", "cubic"],
        TEXT('`"monotone"`: not beyond the neighboring values; `"cubic"`: smoother', choices=tuple(CUBICS)),
    ] = "monotone"
    outside: Annotated[
        Literal["error", "hold"],
        TEXT('beyond the ends an `"error"`, or the value there (`"hold"`)', choices=("error", "hold")),
    ] = "error"

    def faults(self, where: str) -> list[str]:
        """What is wrong with the table."""
        faults = self.value_faults(where)
        axes = {name: axis for name in "xv" if (axis := getattr(self, name)) is not None}
        if faults or not axes:
            return faults or [f"{where}x, {where}v: neither is given; give the places of the table"]
        for name, axis in axes.items():
            if np.ndim(axis) != 1 or len(axis) < 2 or not (np.diff(axis) > 0).all():
                faults.append(wrong(axis, where + name, "at least two rising numbers"))
        shape = tuple(np.size(axis) for axis in axes.values())
        if np.shape(self.force) != shape:
            faults.append(
                f"{where}force: expected {' x '.join(map(str, shape))} numbers, got shape {np.shape(self.force)}"
            )
        return faults

    @property
    def has_energy(self) -> bool:
        """Whether the force depends on the coordinate alone."""
        return self.v is None

    def within(self, name: str, at: Array) -> Array:
        """Places ``(T,)`` moved to the nearest in the table, where that may be.

        Raises
        ------
        ValueError
            where a place lies outside of a table that ends there.
        """
        axis = getattr(self, name)
        inside = np.clip(at, axis[0], axis[-1])
        rounding = 1e-9 * (axis[-1] - axis[0])  # a stroke that ends with the table is within it
        if self.outside == "error" and not (np.abs(at - inside) <= rounding).all():
            worst = at[np.argmax(np.abs(at - inside))]
            raise ValueError(
                f"{name} = {worst:.6g} lies outside of the table, which ends at {axis[0]:.6g} and {axis[-1]:.6g}; extend the table, or "
                "give outside='hold'"
            )
        return inside

    def _cubic(self, places: Any, values: Any, axis: int) -> Any:
        return getattr(scipy.interpolate, CUBICS[self.interpolation])(places, values, axis=axis)

    @cached_property
    def _last(self) -> Any:
        """The piecewise cubic over the last axis."""
        return self._cubic(self.x if self.v is None else self.v, self.force, -1)

    @property
    def pieces(self) -> Any:
        """The piecewise cubic, a ``scipy.interpolate.PPoly``, over the coordinate or the rate; None over a grid of both."""
        return self._last if self.v is None or self.x is None else None

    def at(self, x: Array, v: Array) -> Array:
        """The force ``(T,)`` at coordinates and rates ``(T,)``."""
        if self.v is None or self.x is None:
            return np.asarray(self._last(self.within("x", x) if self.v is None else self.within("v", v)))
        rows, x = self._last(self.within("v", v)), self.within("x", x)
        pieces = self._cubic(self.x, rows, 0)
        i = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        c, d = pieces.c[:, i, np.arange(len(x))], x - pieces.x[i]
        return np.asarray(((c[0] * d + c[1]) * d + c[2]) * d + c[3])

    def energy(self, x: Array) -> Array:
        """``-int F dx (T,)`` from the beginning of a table over ``x`` alone."""
        inside = self.within("x", x)
        return -np.asarray(self._last.antiderivative()(inside) + self._last(inside) * (x - inside))

    def __repr__(self) -> str:
        given = {name: shown(value) for name in self.formats if (value := getattr(self, name)) is not None}
        return f"ForceTable({', '.join(f'{name}={value}' for name, value in given.items())})"


class Law(Load):
    """A force ``F(x, x', t)`` in the freedom that it names, or between the point ``p`` of link ``a`` and ``q`` of link ``b``."""

    if TYPE_CHECKING:  # fields of those that act between points; annotated here, they would come before all others
        a: Any
        b: Any
        p: Any
        q: Any
        along: Any

    @property
    def between_links(self) -> bool:
        """Whether it is a force that two links exert on each other."""
        return self.in_freedom is None

    @property
    def reads_freedom(self) -> str | None:
        """The freedom whose coordinate and rate it reads: its own, or another; None between points."""
        return self.freedoms[-1] if self.freedoms else None

    @abstractmethod
    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """The force ``(T,)`` at coordinates and rates ``(T,)``."""

    def act(self, site: LoadSite) -> None:
        """Add the effort, or the forces on both links."""
        if self.in_freedom is not None:
            site.add_effort(self.in_freedom, self.force(site, *self.coordinate(site)))
            return
        p, q, _, u, _ = self._line(site)
        force = self.force(site, *self.coordinate(site))
        # between points that meet, a force has no direction
        push = np.where(u.any(axis=0) | (force == 0), force * u, np.nan)
        site.add_force(self.a, -push, p)
        site.add_force(self.b, push, q)

    def _line(self, site: LoadSite) -> tuple[Array, ...]:
        """Where it acts on links a and b ``(3, T)``, the distance ``(T,)``, the direction of its growth, and its rate.

        With a direction ``e`` fixed in link a, ``x = e . (q - p)`` grows with ``e . (q - p)' + (w_a x e) . (q - p)``, so that by power the
        force on link a acts at q too.
        """
        (p, vp), (q, vq) = site.point(self.a, site.number(self.p)), site.point(self.b, site.number(self.q))
        d = q - p
        if self.along is not None:
            along = np.asarray(site.number(self.along), dtype=float).reshape(3, -1)
            along = along / np.sqrt((along * along).sum(axis=0))
            u = rotate(site.rotation(self.a), along)
            turning = site.point(self.a, along)[1] - site.point(self.a, np.zeros(3))[1]
            return q, q, (u * d).sum(axis=0), u, (u * (vq - vp) + turning * d).sum(axis=0)
        length = np.sqrt((d * d).sum(axis=0))
        u = np.divide(d, length, out=np.zeros_like(d), where=length > 0)
        return p, q, length, u, (u * (vq - vp)).sum(axis=0)

    def coordinate(self, site: LoadSite) -> tuple[Array, Array]:
        """The coordinate or distance ``(T,)`` that it reads, and its rate."""
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

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        given = [name for name in "abpq" if getattr(self, name) is not None]
        expected = "expected a freedom alone, e.g. 'D', or two links with a point of each, ('a', 'b', p, q)"
        if self.freedom is None and len(given) < 4:
            return [f"{self.where}{', '.join(name for name in 'abpq' if name not in given)} left out; {expected}"]
        if self.freedom is not None and given:
            return [f"{self.where}beside it {', '.join(f'{n} = {shown(getattr(self, n))}' for n in given)}; {expected}"]
        if isinstance(self.freedom, tuple | list):
            return [self.where + expected]
        if self.freedom is not None and self.along is not None:
            return [
                f"{self.where}along = {shown(self.along)}: beside the freedom {shown(self.freedom)}, which has its own; leave it out"
            ]
        found = super().faults(names)
        if self.along is not None and not found and names.planar and self.along[2]:
            found.append(f"{self.where}along = {shown(self.along)}: leaves the plane; expected z = 0, or two numbers")
        return found


_Along = Annotated[
    Any, DIRECTION("fixed direction in the frame of link a: `x` is the part of `q - p` along it", default="from p to q")
]


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
    """Declare a spring (and damper) between points of two links, or in a freedom, ``Spring(freedom="D")``.

    The tension along the line from point ``p`` of link ``a`` to point ``q`` of link ``b`` is
    ``stiffness (l - free_length) + damping dl/dt``; in a freedom the effort is ``-stiffness (q - free_length) - damping dq/dt``.
    Points as in ``Wrench``. With ``along``, a direction e that is fixed in link a, l is ``e . (q - p)``, which may be negative, and both
    forces act along e at the point q, as those of a spring in a guide on link a.

    Examples
    --------
    >>> import mechgraph as mg
    >>> spring = mg.Spring("frame", "rocker", (0.4, 0.2, 0), (0.4, 0.3, 0), stiffness=200.0, free_length=0.05)
    >>> s = mg.solve(mg.load("four-bar"), {"A": 0.0}, loads=[spring])
    >>> float(s.load(0).coordinate.round(6)), float(s.load(0).force.round(6))
    (0.1, -10.0)
    """

    kind: ClassVar[str] = "spring"
    subject: ClassVar[str] = "spring"
    rest: ClassVar[str] = "free_length"
    a: Annotated[Any, LINK_NAME("first link", default="in a freedom")] = None
    b: Annotated[str | None, LINK_NAME("second link", default="in a freedom")] = None
    p: Annotated[Any, NAMED_POINT("point of link a, or its name", LENGTH, of="a", default="in a freedom")] = None
    q: Annotated[Any, NAMED_POINT("point of link b, or its name", LENGTH, of="b", default="in a freedom")] = None
    stiffness: Annotated[
        float | None,
        NUMBER("force per length, or effort per coordinate", FORCE_PER_LENGTH, MOMENT, default="needed"),
    ] = None
    free_length: Annotated[float, NUMBER("length, or coordinate, without tension", **POSITION)] = 0.0
    damping: Annotated[float, NUMBER("force or effort per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)] = 0.0
    freedom: Annotated[
        str | None, FREEDOM_NAME("a single freedom: rotation or translation", default="between points")
    ] = None
    along: _Along = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.freedom is None:
            self._take_place(self.a, self.b, self.p, self.q)
        super().__post_init__()

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        if self.stiffness is None:
            found.append(self.where + wrong(None, "stiffness", "a finite number"))
        if self.freedom is None and self.along is None and is_numeric(self.free_length, ()) and self.free_length < 0:
            found.append(self.where + wrong(self.free_length, "free_length", "a number of 0 or more"))
        return found


@dataclass(frozen=True, eq=False)
class TorsionSpring(Elastic):
    """Declare a spring (and damper) in a single freedom: effort ``-stiffness (q - free) - damping dq/dt``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": 0.5}, loads=[mg.TorsionSpring("A", stiffness=2.0)])
    >>> s["A"].applied_effort, s["A"].effort.round(9)
    (array([-1.]), array([1.]))
    """

    kind: ClassVar[str] = "torsion_spring"
    subject: ClassVar[str] = "torsion spring in {freedom}"
    rest: ClassVar[str] = "free"
    freedom: Annotated[str, FREEDOM_NAME("a single freedom: rotation or translation")]
    stiffness: Annotated[float, NUMBER("effort per coordinate", FORCE_PER_LENGTH, MOMENT)]
    free: Annotated[float, NUMBER("coordinate without effort", **POSITION)] = 0.0
    damping: Annotated[float, NUMBER("effort per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)] = 0.0


Place = str | tuple[str, str, Any, Any]
"""A freedom, or two links with a point of each, ``(link a, link b, p, q)``."""


@dataclass(frozen=True, eq=False)
class _Placed(_ByPlace):
    """A law placed by its first arguments: the name of a freedom, ``(link a, link b, p, q)``, or these four."""

    freedom: Annotated[
        Place | None, FREEDOM_NAME("a single freedom: rotation or translation", default="between points")
    ] = None
    a: Annotated[str | None, LINK_NAME("first link", default="in a freedom")] = None
    b: Annotated[str | None, LINK_NAME("second link", default="in a freedom")] = None
    p: Annotated[Any, NAMED_POINT("point of link a, or its name", LENGTH, of="a", default="in a freedom")] = None
    q: Annotated[Any, NAMED_POINT("point of link b, or its name", LENGTH, of="b", default="in a freedom")] = None
    along: _Along = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.freedom is not None and self.q is None:
            self._take_place(self.freedom, self.a, self.b, self.p)
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Damper(_Placed):
    """Declare a linear damper, ``F = -coefficient x'``, in a freedom or between points ``(link a, link b, p, q)``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> motion = {"A": mg.Motion(0.5, velocity=3.0)}
    >>> mg.solve(mg.load("four-bar"), motion, loads=[mg.Damper("A", coefficient=4.0)])["A"].applied_effort
    array([-12.])
    """

    kind: ClassVar[str] = "damper"
    subject: ClassVar[str] = "damper"
    _: KW_ONLY
    coefficient: Annotated[float, NUMBER("effort or force per rate", FORCE_PER_VELOCITY, MOMENT_PER_RATE)]

    def force(self, site: LoadSite, x: Array, v: Array) -> Array:
        """See ``Law``."""
        return np.asarray(-site.number(self.coefficient) * v)


@dataclass(frozen=True, eq=False)
class ForceLaw(_Placed):
    """Declare a force ``F = scale law(x - free, x', t)`` in a freedom or between points ``(link a, link b, p, q)``.

    ``law`` is a ``ForceTable`` or a function of arrays ``(T,)``: coordinate, rate and time (None if the motion has no times). ``F``
    acts along the coordinate and its power is ``F x'``: + on link b and - on link a in a freedom; + pushes the points apart. With
    ``reads`` the law reads ``x`` and ``x'`` of that freedom, but acts where it is declared, as gas forces that are known over the
    angle of the crank do; it then has no potential energy, and its stiffness is not symmetric.

    Examples
    --------
    >>> import mechgraph as mg
    >>> stop = mg.ForceLaw("A", law=lambda x, v, t: -300.0 * x**3)
    >>> mg.solve(mg.load("four-bar"), {"A": 0.5}, loads=[stop])["A"].applied_effort
    array([-37.5])
    >>> gas = mg.ForceLaw("D", reads="A", law=mg.ForceTable(x=[0, 1], force=[-3, -1]))
    >>> mg.solve(mg.load("four-bar"), {"A": 0.5}, loads=[gas])["D"].applied_effort
    array([-2.])
    """

    kind: ClassVar[str] = "force_law"
    subject: ClassVar[str] = "force law"
    _: KW_ONLY
    law: Annotated[Any, TABLE("force over coordinate and rate", table="law")]
    free: Annotated[float, NUMBER("coordinate or distance at which the `x` of the law is 0", **POSITION)] = 0.0
    scale: Annotated[float, NUMBER("factor of the force")] = 1.0
    reads: Annotated[
        str | None, FREEDOM_NAME("the freedom whose coordinate and rate the law reads", default="where it acts")
    ] = None
    breaks: Breaks = ()

    def faults(self, names: Any) -> list[str]:
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

    def in_own_units(self, units: Mapping[str, str], turns: Callable[[Any], bool]) -> Self:
        """See ``Load``."""
        return self._both(lambda name: self.without_quantities(units, turns(name)))

    def converted(self, base: tuple[float, float, float], turns: Callable[[Any], bool]) -> Self:
        """See ``Load``."""
        return self._both(lambda name: self.in_units(base, turns(name)))

    def _both(self, changed: Callable[[str | None], Self]) -> Self:
        """The same changed as the freedom in which it acts asks, its coordinates and rates as the one that it reads does."""
        out = changed(self.in_freedom)
        if self.reads is None:
            return out
        read = changed(self.reads)
        law = out.law
        if isinstance(law, ForceTable):
            law = law.replace(x=read.law.x, v=read.law.v)
        return out.replace(law=law, free=read.free)

    def coordinate(self, site: LoadSite) -> tuple[Array, Array]:
        """See ``Law``."""
        return super().coordinate(site) if self.reads is None else site.freedom(self.reads)

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
        stored = isinstance(self.law, ForceTable) and self.law.has_energy and self.reads is None
        return (self, None) if stored else (None, self)

    def energy(self, site: LoadSite) -> Any:
        """``-scale int F dx``."""
        return self.scale * self.law.energy(self.coordinate(site)[0] - self.free)


@dataclass(frozen=True, eq=False)
class Gravity(Load):
    """Declare uniform gravity: the force ``m g`` at the mass center of every link.

    Examples
    --------
    >>> import mechgraph as mg
    >>> bar = mg.Mechanism("bar", [mg.Link("frame"), mg.Link("bar", 2.0, (0.3, 0, 0))], [
    ...     mg.Pair("A", "R", "frame", "bar", point=(0, 0, 0), axis=(0, 0, 1)),
    ... ], drives=["A"], loads=[mg.Gravity((0, -9.81, 0))])  # fmt: skip
    >>> mg.solve(bar, {"A": 0.0})["A"].effort.round(3)
    array([5.886])
    """

    kind: ClassVar[str] = "gravity"
    subject: ClassVar[str] = "gravity"
    acceleration: Annotated[Any, VECTOR("the vector g, global", ACCELERATION)]

    def links(self, names: Any) -> tuple[str, ...]:
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
    """Declare a force at a material point and a moment on one link.

    ``point`` is in the coordinates of the declared configuration (of a link placed by markers: in its own frame), or names a point of
    the link. Values may be arrays over positions or a function ``(pose, twist, t)`` of the link.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("four-bar").replace(loads=[mg.Wrench("coupler", force=(0, 10, 0), point=(0.25, 0.15, 0))])
    >>> s = mg.solve(m, {"A": 0.0})
    >>> float(s["A"].effort[0].round(6))
    0.108696
    """

    kind: ClassVar[str] = "wrench"
    subject: ClassVar[str] = "wrench on {link}"
    link: Annotated[str, LINK_NAME("the link it acts on")]
    force: Annotated[Value, VECTOR_SERIES("at least one of the two", FORCE, default="none")] = None
    moment: Annotated[Value, VECTOR_SERIES("at least one of the two", MOMENT, default="none", normal=True)] = None
    point: Annotated[
        Any,
        NAMED_POINT(
            "material point, in the coordinates of the declared configuration, or the name of one of the link",
            LENGTH,
            default="mass center",
            of="link",
        ),
    ] = None
    frame: Annotated[
        Literal["global", "link"],
        TEXT('`"link"`: force and moment turn with the link; `"global"`: they do not', choices=("global", "link")),
    ] = "global"
    breaks: Breaks = field(default=(), kw_only=True)

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        if self.force is None and self.moment is None:
            found.append(f"{self.where}has neither force nor moment")
        if self.force is not None and self.point is None and not found and names.link(self.link).center is None:
            found.append(
                f"{self.where}has a force but no point, and the link no mass center; give point=(x, y, z), two numbers where planar=True"
            )
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
    """Declare a given effort in a freedom: a couple about a rotation, a force along a translation; + on link b, - on link a.

    ``value`` may be an array over positions or a function ``(pose, twist, t)`` of link b.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("four-bar").replace(loads=[mg.Effort("D", -5.0)])
    >>> mg.solve(m, {"A": 0.5})["D"].applied_effort
    array([-5.])
    """

    kind: ClassVar[str] = "effort"
    subject: ClassVar[str] = "effort in {freedom}"
    freedom: Annotated[str, FREEDOM_NAME("the freedom, e.g. D or B.Rx", single=False)]
    value: Annotated[Value, SERIES("couple about a turn, force along a slide; + on link b, - on link a", FORCE, MOMENT)]
    breaks: Breaks = field(default=(), kw_only=True)

    def act(self, site: LoadSite) -> None:
        """Add the effort."""
        site.add_effort(self.freedom, site.values(self.value, site.second_link(self.freedom), 1)[0])


BASIC_LOADS: dict[str, type[Load]] = {
    c.kind: c for c in (Gravity, Wrench, Effort, Spring, TorsionSpring, Damper, ForceLaw)
}
"""Load classes that act by themselves, by the name of their kind in files."""
