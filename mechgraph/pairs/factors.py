"""What a row of the pair table consists of, and the factors that turn it into poses and twists, one after the other.

A factor is a relative motion as a function of its own coordinates: its value (a pose), its twists (one a freedom) and the rate of
these twists, all in the frame before it. A constant screw and a rotation are the two of the pair table; a frame that travels along
a curve is one class more. Nothing outside this file knows how a factor is evaluated.

Factors of one kind are evaluated together, whatever pairs they belong to: a ``Stack`` writes the poses of ``n`` of them (and the
inverse poses) as combinations of a few values of the coordinates with constant coefficients. The constant poses beside a factor
enter those coefficients once, and a batch of poses is one product of matrices.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mechgraph.maths.se3 import Array, homogeneous, inverse, quaternion_matrix, skew
from mechgraph.quantities import is_numeric, items_of, shown, wrong

Six = tuple[float, float, float, float, float, float]

UNIT_TWISTS, UNIT_WRENCHES = (
    {name: cast(Six, tuple(float(i == j) for j in range(6))) for i, name in enumerate(names)}
    for names in (("Rx", "Ry", "Rz", "Tx", "Ty", "Tz"), ("Mx", "My", "Mz", "Fx", "Fy", "Fz"))
)
WRENCHES = tuple(UNIT_WRENCHES)
"""Names of the components of a wrench, in order."""


@dataclass(frozen=True)
class Freedom:
    """One freedom of a pair type: the constant unit twist ``twist + pitch * per_pitch``, angular part first.

    Parameters
    ----------
    name : str
        E.g. ``"Rz"``.
    twist : 6 numbers
        Angular part of length 1 (a rotation) or 0 (a translation; then the linear part has length 1).
    per_pitch : 6 numbers
        Part multiplied by the pitch of the pair. Default: 0.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.PairType("Rx", freedoms=[mg.Freedom("turn", (1, 0, 0, 0, 0, 0))]).f
    1
    """

    name: str
    twist: Six
    per_pitch: Six = (0.0,) * 6

    @property
    def label(self) -> str:
        """The freedom as the table shows it: ``Rz``, or ``Rz+pitch*Tz`` where the pitch enters."""
        moved = [name for name, unit in UNIT_TWISTS.items() if np.dot(unit, self.per_pitch)]
        return "+".join([self.name, *(f"pitch*{name}" for name in moved)])

    @property
    def turns(self) -> bool:
        """Whether the coordinate is an angle (radians) rather than a length."""
        return any(self.twist[:3])

    def scaled(self, L: float) -> Freedom:
        """The freedom with its lengths divided by ``L``: the linear part of a turn; itself where it has none."""
        if not self.turns or not any(self.twist[3:]):
            return self
        a, b, c, x, y, z = self.twist
        return replace(self, twist=(a, b, c, x / L, y / L, z / L))


@dataclass(frozen=True)
class Touching:
    """How the elements of a pair touch each other at a point or along a line.

    ``forces``: the components of the normal force; where a force closes the pair, a presses on b with a positive first one. ``a``, ``b``:
    the curvatures of the elements along the groove (or line) and across it, times their radii: (0, -1) is a groove, (1, 1) a ball,
    (0, 1) a cylinder, (0, 0) a plane, or curves that say theirs. ``tilting``: of a line the couple that moves the force along it.
    ``curved``: whether the elements are curves.
    """

    forces: tuple[str, ...]
    a: tuple[float, float]
    b: tuple[float, float]
    tilting: str | None = None
    curved: bool = False

    @property
    def along_line(self) -> bool:
        """Whether it is a line."""
        return not (self.a[0] or self.b[0])


@dataclass(frozen=True)
class Component:
    """One reaction component or effort of a pair type: the constant wrench ``wrench + pitch * per_pitch`` in a frame.

    Parameters
    ----------
    name : str
        E.g. ``"Fx"``.
    wrench : 6 numbers
        Moment first.
    frame : int
        Number of single freedoms before the frame; 0 is the marker on link a.
    per_pitch : 6 numbers
        Part multiplied by the pitch of the pair. Default: 0.
    at_b : bool
        Whether its origin is that of marker b instead of that of the frame.

    Examples
    --------
    >>> import mechgraph as mg
    >>> fz = mg.Component("Fz", (0, 0, 0, 0, 0, 1), frame=2)
    >>> fz.is_couple
    False
    """

    name: str
    wrench: Six
    frame: int = 0
    per_pitch: Six = (0.0,) * 6
    at_b: bool = False

    @property
    def is_couple(self) -> bool:
        """Whether the component is a couple (unit of a moment) rather than a force."""
        return not any(self.wrench[3:])

    def scaled(self, L: float) -> Component:
        """The component with its lengths divided by ``L``: the moment (an arm) of a force; itself where it has none."""
        if self.is_couple or not any(self.wrench[:3]):
            return self
        a, b, c, x, y, z = self.wrench
        return replace(self, wrench=(a / L, b / L, c / L, x, y, z))


@dataclass(frozen=True)
class Bookkeeping:
    """Lee's unknowns of a pair type: a free dual force plus parts along the axis, under conditions.

    The dual force has six unknowns. Source: Lee 1977, section 3.3.

    Parameters
    ----------
    conditions : tuple of Freedom
        Unit twists of frame 0 to which the dual force is reciprocal: the conditions, one equation each.
    along : tuple of Component
        Components that the pair transmits along its axis: further unknowns.

    Examples
    --------
    >>> import mechgraph as mg
    >>> lee = mg.pair_types()["R"].bookkeeping
    >>> lee.unknowns, lee.equations
    (7, 2)
    """

    conditions: tuple[Freedom, ...]
    along: tuple[Component, ...]

    @property
    def unknowns(self) -> int:
        """Number of unknowns, ``6 + len(along)``."""
        return 6 + len(self.along)

    @property
    def equations(self) -> int:
        """Number of constraint equations, ``len(conditions)``."""
        return len(self.conditions)

    def scaled(self, L: float) -> Bookkeeping:
        """The bookkeeping with its lengths divided by ``L``."""
        return Bookkeeping(all_scaled(self.conditions, L), all_scaled(self.along, L))


Scaled = TypeVar("Scaled", Freedom, Component)


def all_scaled(parts: Sequence[Scaled], L: float) -> tuple[Scaled, ...]:
    """Freedoms or components with their lengths divided by ``L``."""
    return tuple(part.scaled(L) for part in parts)


def read_freedom(item: object, faults: list[str]) -> Freedom | None:
    """A freedom from ``Freedom``, ``"Tz"`` or ``"Rz + pitch Tz"``; what is wrong with it is added to ``faults``."""
    if isinstance(item, Freedom):
        found = _screw_faults("freedom", item.name, "twist, angular", item.twist, item.per_pitch)
        faults += found
        return None if found else item
    text = item if isinstance(item, str) else ""
    head, _, tail = (part.strip() for part in text.replace("pitch*", "pitch ").partition("+"))
    slide = tail.removeprefix("pitch").strip()
    if head in UNIT_TWISTS and (not tail or slide in UNIT_TWISTS):
        return Freedom(head, UNIT_TWISTS[head], UNIT_TWISTS[slide] if tail else (0.0,) * 6)
    faults.append(
        f"freedom {shown(item)}: unknown; give one of {', '.join(UNIT_TWISTS)}, 'rotation', 'Rz + pitch Tz' or a Freedom"
    )
    return None


def _screw_faults(what: str, name: object, of: str, *rows: object) -> list[str]:
    """What is wrong with a name and with ``rows`` of six numbers; ``of`` is what they are, and of which part the first three."""
    found = [] if isinstance(name, str) and name else [wrong(name, f"{what}: name", "a text")]
    screw, _, first = of.partition(", ")
    where, expected = f"{what} {shown(name)}: {screw}", f"six finite numbers, {first} part first"
    return found + [wrong(row, where, expected) for row in rows if not is_numeric(row, (6,))]


def read_component(item: object, faults: list[str], what: str) -> Component | None:
    """A component from ``Component``, ``"Fz@2"`` or ``("Fz", 2)``; what is wrong with it is added to ``faults``."""
    if isinstance(item, Component):
        found = _screw_faults(what, item.name, "wrench, moment", item.wrench, item.per_pitch)
        if not isinstance(item.at_b, bool):
            found.append(wrong(item.at_b, f"{what} {shown(item.name)}: at_b", "true or false"))
        if type(item.frame) is not int:
            found.append(wrong(item.frame, f"{what} {shown(item.name)}: frame", "a whole number"))
        faults += found
        return None if found else item
    name, frame = item if isinstance(item, tuple) and len(item) == 2 else (item, 0)
    if isinstance(name, str) and "@" in name:
        name, _, frame = name.partition("@")
    if not isinstance(name, str) or name not in UNIT_WRENCHES or not (str(frame).isdecimal() and len(str(frame)) < 3):
        faults.append(
            f"{what} {shown(item)}: expected one of {', '.join(UNIT_WRENCHES)}, with '@k' for frame k, or a Component"
        )
        return None
    return Component(name, UNIT_WRENCHES[name], int(frame))


def bookkeeping_faults(given: object) -> list[str]:
    """What is wrong with a bookkeeping."""
    if not isinstance(given, Bookkeeping):
        return [wrong(given, "bookkeeping", "a Bookkeeping")]
    faults: list[str] = []
    for name, kind in (("conditions", Freedom), ("along", Component)):
        what = f"bookkeeping: {name}"
        for item in items_of(getattr(given, name), what, faults):
            if not isinstance(item, kind):
                faults.append(wrong(item, what, f"a {kind.__name__}"))
            elif isinstance(item, Freedom):
                read_freedom(item, faults)
            else:
                read_component(item, faults, what)
    return faults


Flags = NDArray[np.bool_]


class Factor(ABC):
    """One factor of the displacement of a pair. Coordinates ``x`` are ``(n_state, n, T)``, pitches ``(n, 1)`` or ``(n, T)``."""

    @property
    @abstractmethod
    def freedoms(self) -> tuple[Freedom, ...]:
        """Names of the freedoms, with their twists at coordinates zero."""

    @property
    def holds_rotation(self) -> bool:
        """Whether the state is a unit quaternion, moved by ``exp``; otherwise it is the coordinates themselves."""
        return False

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Least and greatest value of every coordinate; infinite where it does not end."""
        return ((-np.inf, np.inf),) * len(self.freedoms)

    @property
    def periods(self) -> tuple[float, ...]:
        """By how much every coordinate grows until the motion is back; infinite where it goes on. Turns do so round by round."""
        return tuple(math.tau if freedom.turns else np.inf for freedom in self.freedoms)

    @property
    def outline(self) -> tuple[Array, ...]:
        """Lines ``(n, 3)`` by which its path is drawn, in the frame before it; none where its twists say it all."""
        return ()

    @property
    def n_state(self) -> int:
        """Number of state numbers."""
        return 4 if self.holds_rotation else len(self.freedoms)

    @property
    def kind(self) -> Hashable:
        """Factors of one kind are evaluated together."""
        return self

    @abstractmethod
    def pose(self, x: Array, pitch: Array) -> Array:
        """The relative pose ``(3, 4, n, T)`` of the frame after the factor, seen from the frame before it."""

    @abstractmethod
    def twists(self, x: Array, pitch: Array) -> Array:
        """Twists of the freedoms in the frame before the factor, ``(6, f, n, T)``; batch axes of length 1 where constant."""

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array | None:
        """``sum_j dS_j/dt q'_j (6, n, T)`` seen from the frame before the factor; None where the twists are constant there.

        For a rotation the twists are those of its angular velocity: constant unit turns.
        """
        return None

    @abstractmethod
    def scaled(self, L: float) -> Factor:
        """The factor with its lengths divided by ``L``; itself where it has none."""

    def stack(self, factors: Sequence[Factor], counts: Sequence[int]) -> Stack:
        """``counts`` copies each of ``factors`` of this kind, evaluated together."""
        return PoseStack(self)


class Stack(ABC):
    """``n`` factors of one kind, for fast evaluation: poses ``sum_i coefficients_i values_i``."""

    @abstractmethod
    def values(self, x: Array) -> Array:
        """Values ``(m, n, T)`` of the states ``(n_state, n, T)``."""

    @abstractmethod
    def coefficients(self, pitch: Array, back: Flags) -> Array:
        """Coefficients ``(4, 4, m, n, B)`` of the poses, of the inverse poses where ``back (n,)``."""

    @abstractmethod
    def constant_twists(self, pitch: Array) -> Array | None:
        """Twists ``(6, f, n, B)`` in the frames before the factors; None where they move with the coordinates."""

    def twists(self, x: Array, pitch: Array) -> Array:
        """The same ``(6, f, n, T)``, also of twists that move."""
        constant = self.constant_twists(pitch)
        assert constant is not None
        return constant

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array | None:
        """See ``Factor.twist_rates``."""
        return None


@dataclass(frozen=True)
class ConstantScrew(Factor):
    """A motion ``exp(q s)`` about a constant unit twist ``s = twist + pitch * per_pitch``: a turn, a slide, a helical motion."""

    freedom: Freedom

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """The freedoms."""
        return (self.freedom,)

    @property
    def kind(self) -> Hashable:
        """Evaluated together: all of this class."""
        return ConstantScrew

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        terms = screw_terms(self.twists(x, pitch)[:, 0])[:3]
        return np.asarray(np.einsum("ijmnt,mnt->ijnt", terms, screw_values(x[0])))

    def twists(self, x: Array, pitch: Array) -> Array:
        """Constant unit twists."""
        return _unit_twists([self], [pitch.shape[0]], pitch)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        scaled = self.freedom.scaled(L)
        return self if scaled is self.freedom else replace(self, freedom=scaled)

    def stack(self, factors: Sequence[Factor], counts: Sequence[int]) -> Stack:
        """Copies evaluated together."""
        return ScrewStack([f for f in factors if isinstance(f, ConstantScrew)], counts)


def _unit_twists(factors: Sequence[ConstantScrew], counts: Sequence[int], pitch: Array) -> Array:
    """Unit twists ``(6, 1, n, B)`` of constant screws."""
    base, per_pitch = (
        np.repeat(np.array([getattr(f.freedom, part) for f in factors]).T, counts, axis=1)[:, None, :, None]
        for part in ("twist", "per_pitch")
    )
    return np.asarray(base + per_pitch * pitch if per_pitch.any() else base)


def screw_values(q: Array) -> Array:
    """``1, sin q, 1 - cos q, q`` of coordinates ``(n, T)``, ``(4, n, T)``."""
    out = np.empty((4, *q.shape), dtype=q.dtype)
    out[0] = 1.0
    np.sin(q, out=out[1])
    np.cos(q, out=out[2])
    np.subtract(1.0, out[2], out=out[2])
    out[3] = q
    return out


def screw_terms(twist: Array) -> Array:
    """Coefficients ``(4, 4, 4, n, B)`` of ``1, sin q, 1 - cos q, q`` (third axis) in ``exp(q s)`` for unit twists ``(6, n, B)``.

    For ``s = (w, v)``, ``|w|`` one or zero: ``1``, ``[W | -W^2 v]``, ``[W^2 | W v]``, ``[0 | (1 + W^2) v]`` with ``W = w^``.
    """
    W, v = skew(twist[:3]), twist[3:]
    W2 = np.einsum("ijnt,jknt->iknt", W, W)
    W2v = np.einsum("ijnt,jnt->int", W2, v)
    out = np.zeros((4, 4, 4, *twist.shape[1:]), dtype=twist.dtype)
    out[range(4), range(4), 0] = 1.0
    out[:3, :3, 1], out[:3, 3, 1] = W, -W2v
    out[:3, :3, 2], out[:3, 3, 2] = W2, np.einsum("ijnt,jnt->int", W, v)
    out[:3, 3, 3] = v + W2v
    return out


class ScrewStack(Stack):
    """Constant screws together: every pose is linear in ``1, sin q, 1 - cos q, q``."""

    def __init__(self, factors: Sequence[ConstantScrew], counts: Sequence[int]) -> None:
        self.factors, self.counts = factors, counts
        self._turns = np.repeat([f.freedom.turns for f in factors], counts)[:, None]

    def values(self, x: Array) -> Array:
        """``1, sin q, 1 - cos q, q``."""
        q = x[0]
        if q.dtype.kind != "c":
            return screw_values(q)
        # a slide needs no sine, which of a long imaginary one has no value
        out = screw_values(np.where(self._turns, q, 0.0))
        out[3] = q
        return out

    def coefficients(self, pitch: Array, back: Flags) -> Array:
        """``screw_terms``; ``exp(-q s)`` changes the sign of the odd values, ``sin q`` and ``q``."""
        out = screw_terms(self.constant_twists(pitch)[:, 0]) if self._plain is None else self._plain[1].copy()
        out[:, :, 1::2, back] *= -1.0
        return out

    def constant_twists(self, pitch: Array) -> Array:
        """The unit twists."""
        return _unit_twists(self.factors, self.counts, pitch) if self._plain is None else self._plain[0]

    @cached_property
    def _plain(self) -> tuple[Array, Array] | None:
        """Unit twists and ``screw_terms`` where no pitch is in them: those of all mechanisms of a graph."""
        if any(any(f.freedom.per_pitch) for f in self.factors):
            return None
        twists = _unit_twists(self.factors, self.counts, np.zeros((0, 1)))
        return twists, screw_terms(twists[:, 0])


@dataclass(frozen=True)
class Rotation(Factor):
    """A rotation of three freedoms, held as a unit quaternion and moved by ``exp``: no chart, no singularity."""

    names: tuple[Freedom, ...]
    holds_rotation = True

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """The freedoms."""
        return self.names

    @property
    def kind(self) -> Hashable:
        """Evaluated together: all of this class."""
        return Rotation

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        out = np.zeros((3, 4, *x.shape[1:]), dtype=x.dtype)
        out[:, :3] = quaternion_matrix(x)
        return out

    def twists(self, x: Array, pitch: Array) -> Array:
        """Constant unit twists."""
        return np.eye(6, 3)[:, :, None, None]

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self

    def stack(self, factors: Sequence[Factor], counts: Sequence[int]) -> Stack:
        """Copies evaluated together."""
        return RotationStack(sum(counts))


FIRST, SECOND = np.array([1, 2, 3, 1, 1, 2, 0, 0, 0]), np.array([1, 2, 3, 2, 3, 3, 1, 2, 3])
"""The products of quaternion components of which the entries of a rotation matrix are made: xx yy zz xy xz yz wx wy wz."""


def _rotation_terms() -> Array:
    """Coefficients ``(4, 4, 10)`` of 1 and those products in the pose of a unit quaternion (``quaternion_matrix``)."""
    out = np.zeros((4, 4, 10))
    out[range(4), range(4), 0] = 1.0
    xx, yy, zz, xy, xz, yz, wx, wy, wz = range(1, 10)
    for i, squares in enumerate(((yy, zz), (xx, zz), (xx, yy))):
        out[i, i, squares] = -2.0
    for i, j, product, turn in ((0, 1, xy, wz), (2, 0, xz, wy), (1, 2, yz, wx)):
        out[i, j, product] = out[j, i, product] = out[j, i, turn] = 2.0
        out[i, j, turn] = -2.0
    return out


class RotationStack(Stack):
    """Rotations together: the entries of their matrices are linear in the products of quaternion components."""

    def __init__(self, n: int) -> None:
        self.n = n

    def values(self, x: Array) -> Array:
        """One and the products ``(10, n, T)``."""
        out = np.empty((10, *x.shape[1:]), dtype=x.dtype)
        out[0] = 1.0
        np.multiply(x[FIRST], x[SECOND], out=out[1:])
        return out

    def coefficients(self, pitch: Array, back: Flags) -> Array:
        """The same for all; the inverse is that of the conjugate quaternion, ``wx, wy, wz`` with the other sign."""
        out = np.repeat(_rotation_terms()[..., None, None], self.n, axis=3)
        out[:, :, 7:, back] *= -1.0
        return out

    def constant_twists(self, pitch: Array) -> Array:
        """Unit turns."""
        return np.repeat(np.eye(6, 3)[:, :, None, None], self.n, axis=2)


def entries(X: Array) -> Array:
    """Entries of homogeneous poses and of their inverses, ``(32, n, T)``."""
    return np.concatenate([homogeneous(Y).reshape(16, *X.shape[2:]) for Y in (X, inverse(X))])


class PoseStack(Stack):
    """Copies of one factor of any kind, by its pose: the values are the entries of the pose and of its inverse.

    Only constant screws take the pitch of a pair; the pose of any other factor is asked for with pitch zero.
    """

    def __init__(self, factor: Factor) -> None:
        self.factor = factor

    def values(self, x: Array) -> Array:
        """Entries of the homogeneous pose and of its inverse, ``(32, n, T)``."""
        return entries(self.factor.pose(x, np.zeros((x.shape[1], 1))))

    def coefficients(self, pitch: Array, back: Flags) -> Array:
        """Ones: the first sixteen values are the entries of the pose, the others those of its inverse."""
        pick = np.eye(16).reshape(4, 4, 16)
        out = np.zeros((4, 4, 32, len(back), 1))
        out[:, :, :16, ~back, 0], out[:, :, 16:, back, 0] = pick[..., None], pick[..., None]
        return out

    def constant_twists(self, pitch: Array) -> None:
        """None: they may move."""

    def twists(self, x: Array, pitch: Array) -> Array:
        """Those of the factor."""
        return self.factor.twists(x, pitch)

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array | None:
        """Those of the factor."""
        return self.factor.twist_rates(x, dq, pitch)


class FixedStack(Stack):
    """No motion: what stands between the markers of pairs without a freedom."""

    def __init__(self, n: int) -> None:
        self.n = n

    def values(self, x: Array) -> Array:
        """One."""
        return np.ones((1, *x.shape[1:]), dtype=x.dtype)

    def coefficients(self, pitch: Array, back: Flags) -> Array:
        """The identity."""
        return np.repeat(np.eye(4)[:, :, None, None, None], self.n, axis=3)

    def constant_twists(self, pitch: Array) -> Array:
        """None of them."""
        return np.zeros((6, 0, self.n, 1))
