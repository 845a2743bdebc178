"""Loads: small classes, each says what it does to links and freedoms. A new load is a new class with the same methods.

``act`` speaks to a ``LoadSite``, which knows poses and rates at every position of a batch, in the user's units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from mechgraph.algebra.se3 import Array, rotate
from mechgraph.model.values import number_fault, plain, same_fields, vector_fault

Value = Any
"""A number or vector, an array over positions, or a callable ``(pose, twist, t)``."""

FORCE, MOMENT, LENGTH = (1, 1, -2), (2, 1, -2), (1, 0, 0)
"""Dimensions as exponents of length, mass and time."""


class LoadSite(Protocol):
    """What a load sees of a mechanism at a batch of ``T`` positions (component axes first, positions last)."""

    def add_weight(self, acceleration: Any) -> None:
        """Force ``m g`` at the mass centre of every link, for one ``g (3,)``."""

    def rotation(self, link: str) -> Array:
        """Rotation of the link, ``(3, 3, T)``."""

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """Position and velocity ``(3, T)`` of a material point, given in the link's frame."""

    def center(self, link: str) -> Any:
        """Mass centre in the link's frame, or None."""

    def values(self, value: Value, link: str, width: int) -> Array:
        """A value at every position, ``(width, T)``; callables are called with the pose and twist of ``link``."""

    def number(self, value: Any) -> Any:
        """A number or vector as it is; where it varies from case to case, at every position ``(T,)`` or ``(3, T)``."""

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


class Names(Protocol):
    """The names that a load may refer to."""

    @property
    def link_index(self) -> Mapping[str, int]:
        """Place of every link, by name."""

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: no single freedom), or None."""

    def massive_links(self) -> tuple[str, ...]:
        """Links that have mass."""

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""


def _value_fault(value: Value, what: str, width: int) -> str | None:
    if callable(value):
        return None
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    ok = np.isfinite(array).all() and (width == 1 or (array.ndim >= 1 and array.shape[-1] == width))
    wanted = "a finite number" if width == 1 else f"{width} finite numbers"
    return (
        None
        if ok
        else f"{what} = {value!r}: expected {wanted}, an array of them over positions, or a callable (pose, twist, t)"
    )


def _link_fault(names: Names, link: Any, where: str) -> str | None:
    known = names.link_index
    return None if link in known else f"{where}unknown link {link!r} (links: {', '.join(known)})"


@dataclass(frozen=True)
class _Turned:
    """A callable load value carried along by ``Mechanism.moved``."""

    function: Callable[..., Any]
    pose: tuple[tuple[float, ...], ...]

    def __call__(self, pose: Array, twist: Array, t: Any) -> Array:
        G = np.asarray(self.pose)
        R, back = G[:3, :3], np.linalg.inv(G)
        w, v = twist[..., :3], twist[..., 3:]
        p = back[:3, 3]
        local = np.concatenate([w @ R, v @ R + np.cross(p, w @ R)], axis=-1)
        return np.asarray(self.function(back @ pose @ G, local, t)) @ R.T


def _turned(value: Value, pose: Array) -> Value:
    if value is None:
        return None
    if callable(value):
        return _Turned(value, plain(np.vstack([pose, (0.0, 0.0, 0.0, 1.0)])))
    return plain(np.asarray(value) @ pose[:3, :3].T)


@dataclass(frozen=True, eq=False)
class _Load:
    """What all loads share: equality that also holds for arrays."""

    between_links: ClassVar[bool] = False
    """Whether it is a force that two links exert on each other."""
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {}
    freedom_dimensions: ClassVar[dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]]] = {}
    """Dimensions of fields that depend on the freedom: for a turn, for a slide."""

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash(type(self).__name__)


@dataclass(frozen=True, eq=False)
class Gravity(_Load):
    """Uniform gravity: force ``m g`` at the mass centre of every link; ``acceleration`` is the vector g."""

    kind: ClassVar[str] = "gravity"
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {"acceleration": (1, 0, -2)}
    acceleration: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceleration", plain(self.acceleration))

    def faults(self, names: Names) -> list[str]:
        """What is wrong with this load."""
        fault = vector_fault(self.acceleration, "gravity: acceleration")
        return [fault] if fault else []

    def links(self, names: Names) -> tuple[str, ...]:
        """Links that this load acts on."""
        return names.massive_links()

    def moved(self, pose: Array) -> Gravity:
        """The same load after a rigid motion of the whole mechanism."""
        return replace(self, acceleration=_turned(self.acceleration, pose))

    def act(self, site: LoadSite) -> None:
        """Add the weight of every link."""
        site.add_weight(site.number(self.acceleration))


@dataclass(frozen=True, eq=False)
class Wrench(_Load):
    """A force at a material point and a moment on one link.

    ``point`` is in the coordinates of the declared configuration, in which link frames stand on the global one (for a link
    placed by markers: its own frame); the mass centre where it is left out. ``frame`` says whether force and moment have global
    directions or turn with the link. Values may be arrays over positions or a callable ``(pose, twist, t)`` of the link.
    """

    kind: ClassVar[str] = "wrench"
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {"force": FORCE, "moment": MOMENT, "point": LENGTH}
    link: str
    force: Value = None
    moment: Value = None
    point: Any = None
    frame: str = "global"

    def __post_init__(self) -> None:
        for field in ("force", "moment", "point"):
            object.__setattr__(self, field, plain(getattr(self, field)))

    def faults(self, names: Names) -> list[str]:
        """What is wrong with this load."""
        where = f"wrench on {self.link!r}: "
        found = [_link_fault(names, self.link, where)]
        if self.frame not in ("global", "link"):
            found.append(f"{where}frame = {self.frame!r}: expected 'global' or 'link'")
        if self.force is None and self.moment is None:
            found.append(f"{where}has neither force nor moment")
        found += [
            _value_fault(v, where + n, 3) for n, v in (("force", self.force), ("moment", self.moment)) if v is not None
        ]
        if self.point is not None:
            found.append(vector_fault(self.point, where + "point"))
        return [fault for fault in found if fault]

    def links(self, names: Names) -> tuple[str, ...]:
        """Links that this load acts on."""
        return (self.link,)

    def moved(self, pose: Array) -> Wrench:
        """The same load after a rigid motion of the whole mechanism."""
        point = None if self.point is None else plain(pose[:3, :3] @ np.asarray(self.point) + pose[:3, 3])
        return replace(self, force=_turned(self.force, pose), moment=_turned(self.moment, pose), point=point)

    def act(self, site: LoadSite) -> None:
        """Add force and moment."""
        R = site.rotation(self.link) if self.frame == "link" else None
        if self.force is not None:
            force = site.values(self.force, self.link, 3)
            point = site.number(self.point) if self.point is not None else site.center(self.link)
            at, _ = site.point(self.link, (0.0, 0.0, 0.0) if point is None else point)
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
    freedom_dimensions: ClassVar[dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]]] = {
        "value": (MOMENT, FORCE)
    }
    freedom: str
    value: Value

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", plain(self.value))

    def faults(self, names: Names) -> list[str]:
        """What is wrong with this load."""
        where = f"effort in {self.freedom!r}: "
        found = [names.freedom_fault(self.freedom, single=False), _value_fault(self.value, "value", 1)]
        return [where + fault for fault in found if fault]

    def links(self, names: Names) -> tuple[str, ...]:
        """Links that this load acts on."""
        return names.ends_of(self.freedom)

    def moved(self, pose: Array) -> Effort:
        """The same load after a rigid motion of the whole mechanism: unchanged."""
        return self

    def act(self, site: LoadSite) -> None:
        """Add the effort."""
        site.add_effort(self.freedom, site.values(self.value, site.second_link(self.freedom), 1)[0])


@dataclass(frozen=True, eq=False)
class Spring(_Load):
    """A straight spring (and damper) between point ``p`` of link ``a`` and point ``q`` of link ``b``.

    Tension ``stiffness (l - free_length) + damping dl/dt`` along the line of the points; points as in ``Wrench``.
    """

    kind: ClassVar[str] = "spring"
    between_links: ClassVar[bool] = True
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {
        "p": LENGTH,
        "q": LENGTH,
        "stiffness": (0, 1, -2),
        "free_length": LENGTH,
        "damping": (0, 1, -1),
    }
    a: str
    b: str
    p: Any
    q: Any
    stiffness: float
    free_length: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        for field in ("p", "q", "stiffness", "free_length", "damping"):
            object.__setattr__(self, field, plain(getattr(self, field)))

    def faults(self, names: Names) -> list[str]:
        """What is wrong with this load."""
        where = f"spring {self.a!r} - {self.b!r}: "
        found = [
            _link_fault(names, self.a, where),
            _link_fault(names, self.b, where),
            vector_fault(self.p, where + "p"),
            vector_fault(self.q, where + "q"),
            number_fault(self.stiffness, where + "stiffness"),
            number_fault(self.free_length, where + "free_length", minimum=0.0),
            number_fault(self.damping, where + "damping"),
        ]
        return [fault for fault in found if fault]

    def links(self, names: Names) -> tuple[str, ...]:
        """Links that this load acts on."""
        return (self.a, self.b)

    def moved(self, pose: Array) -> Spring:
        """The same load after a rigid motion of the whole mechanism."""
        p, q = (plain(pose[:3, :3] @ np.asarray(v) + pose[:3, 3]) for v in (self.p, self.q))
        return replace(self, p=p, q=q)

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


@dataclass(frozen=True, eq=False)
class TorsionSpring(_Load):
    """A spring (and damper) in a single freedom: effort ``-stiffness (q - free) - damping dq/dt``; for turns and slides."""

    kind: ClassVar[str] = "torsion_spring"
    freedom_dimensions: ClassVar[dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]]] = {
        "stiffness": (MOMENT, (0, 1, -2)),
        "free": ((0, 0, 0), LENGTH),
        "damping": ((2, 1, -1), (0, 1, -1)),
    }
    freedom: str
    stiffness: float
    free: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        for field in ("stiffness", "free", "damping"):
            object.__setattr__(self, field, plain(getattr(self, field)))

    def faults(self, names: Names) -> list[str]:
        """What is wrong with this load."""
        where = f"torsion spring in {self.freedom!r}: "
        found = [
            names.freedom_fault(self.freedom, single=True),
            number_fault(self.stiffness, "stiffness"),
            number_fault(self.free, "free"),
            number_fault(self.damping, "damping"),
        ]
        return [where + fault for fault in found if fault]

    def links(self, names: Names) -> tuple[str, ...]:
        """Links that this load acts on."""
        return names.ends_of(self.freedom)

    def moved(self, pose: Array) -> TorsionSpring:
        """The same load after a rigid motion of the whole mechanism: unchanged."""
        return self

    def act(self, site: LoadSite) -> None:
        """Add the effort of the spring."""
        stiffness, free, damping = map(site.number, (self.stiffness, self.free, self.damping))
        q, rate = site.freedom(self.freedom)
        site.add_effort(self.freedom, -stiffness * (q - free) - damping * rate)


Load = Gravity | Wrench | Effort | Spring | TorsionSpring
LOADS: dict[str, type[Load]] = {c.kind: c for c in (Gravity, Wrench, Effort, Spring, TorsionSpring)}
"""Load classes by the name of their kind in files."""
