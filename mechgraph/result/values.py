"""Where a solution takes its values from (``Values``), the records among them, positions as people call them, numbers for people."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mechgraph.document import Document, Shown, Table
from mechgraph.equations.terms import State
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import CHECKS, PATH
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import unit_of

SHOWN_AS_ZERO = 1e-11
"""Part of the largest value of its kind below which a value is rounding noise and shown as 0."""


def number(value: float, scale: float = 0.0) -> str:
    """Five digits; 0 for what is noise beside ``scale``."""
    if abs(value) <= SHOWN_AS_ZERO * scale or abs(value) < 1e-300:
        return "0"
    return f"{value:.5g}"


def with_unit(text: str, unit: str) -> str:
    """A number or name and the unit behind it, where there is one."""
    return f"{text} {unit}" if unit else text


def bracket(unit: str) -> str:
    """The unit in the head of a column."""
    return f" [{unit}]" if unit else ""


def ranges(rows: Iterable[tuple[str, Any]], name: Callable[[int], str] = "position {}".format) -> Table:
    """The range of every quantity over the positions, and at which it is reached; of one position the values."""
    found = [(label, np.asarray(values, dtype=float).reshape(-1)) for label, values in rows]
    if all(values.size == 1 for _, values in found):
        return Table(("quantity", "value"), [(label, _value(values[0], 0.0)) for label, values in found], "lr")
    cells: list[tuple[str, ...]] = []
    for label, values in found:
        if not np.isfinite(values).any():
            cells.append((label, "no value", "", "", ""))
            continue
        least, greatest = int(np.nanargmin(values)), int(np.nanargmax(values))
        size = max(abs(values[least]), abs(values[greatest]))
        cells.append((label, _value(values[least], size), name(least), _value(values[greatest], size), name(greatest)))
    return Table(("quantity", "least", "at", "greatest", "at"), cells, "lrrrr")


def _value(value: float, scale: float) -> str:
    return "no value" if np.isnan(value) else number(float(value), scale)


Mask = NDArray[np.bool_]
RATES_APART = 1e-6
"""Difference of rates on two branches from which on they are shown."""


@dataclass(frozen=True, repr=False)
class Checks(Shown):
    """Every solution's own checks, arrays over positions.

    closure : closure error, the largest of angle [rad] and length / L over the loops.
    equilibrium : residual of the equilibrium of all links and of ``S^T w = effort`` in all undriven freedoms, relative to the
        largest wrench in the batch (NaN without forces).
    power : driver power + load power - rate of kinetic energy, relative to the largest term in the batch. Above 1e-6 of either
        ``Solution.warnings`` says so.
    accuracy : estimated error of rates and forces (reactions that are unique), relative to the largest of the position: what rounding
        does to them over the condition of the closure equations. Some 1e-14 in ordinary positions; it grows towards dead points (with the
        square of the condition) and beside crossings of branches (with its cube). Above 1e-6 ``Solution.warnings`` says so.
        NaN for a motion in time.
    """

    closure: Array
    equilibrium: Array
    power: Array
    accuracy: Array

    def document(self) -> Document:
        """The worst of every check, and where."""
        rows = {
            "closure error (angle, length / L)": self.closure,
            "equilibrium, relative": self.equilibrium,
            "power balance, relative": self.power,
            "accuracy of rates and forces, estimated": self.accuracy,
        }
        worst = [
            (name, f"{np.nanmax(np.abs(of)):.0e}", f"position {np.nanargmax(np.abs(of))}")
            for name, of in rows.items()
            if np.isfinite(of).any()
        ]
        return Document("Checks", (Table(("check", "worst", "at"), worst, "lrr"),))


class _Point(NamedTuple):
    position: Array
    velocity: Array
    acceleration: Array


class MaterialPoint(Shown, _Point):
    """Position, velocity and acceleration of a material point, ``(..., 3)`` each."""

    __slots__ = ()

    def document(self) -> Document:
        """Ranges of the components over the positions."""
        rows = (
            (f"{what} {axis}", of[..., i])
            for what, of in zip(self._fields, self, strict=True)
            for i, axis in enumerate("xyz")
        )
        return Document("Material point", (ranges(rows),))


class _Load(NamedTuple):
    load: Load
    wrenches: dict[str, Array]
    power: Array
    coordinate: Array
    rate: Array
    force: Array


class LoadResult(Shown, _Load):
    """What one load does, ``(...)`` each.

    ``wrenches``: by the names of the links on which it acts (none for a load in a freedom), (M, F) about the global origin ``(..., 6)``;
    ``power`` on all links; of a force law ``coordinate``, ``rate`` and ``force`` along the coordinate; of an effort the ``force`` is
    the effort.
    """

    __slots__ = ()

    def document(self) -> Document:
        """Ranges over the positions of the force along the coordinate, the power, and the sizes of the wrenches."""
        rows = [(name, getattr(self, name)) for name in ("coordinate", "rate", "force", "power")]
        rows += [(f"force on {link}", np.linalg.norm(w[..., 3:], axis=-1)) for link, w in self.wrenches.items()]
        return Document(f"What {self.load!r} does", (ranges((name, of) for name, of in rows if np.isfinite(of).any()),))


@dataclass(frozen=True)
class LoadBearing:
    """A passive freedom that the loads would move: only a couple or force that no part supplies holds it there.

    ``name`` as in ``Solution.passive_effort`` and the report, whether it ``turns`` (held by a couple), the greatest ``effort`` with its
    ``unit``, the ``links`` and ``freedoms`` that would move, and the ``pairs`` of these links, whose reactions rest on that effort.
    """

    name: str
    turns: bool
    effort: float
    unit: str
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    freedoms: tuple[str, ...]

    @property
    def size(self) -> str:
        """``a couple of 20.5 N m``."""
        return f"a {'couple' if self.turns else 'force'} of {self.effort:.4g}" + (f" {self.unit}" if self.unit else "")

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        return (
            f"{self.name}: load-bearing passive freedom, held by {self.size} at most, which no part supplies: the real linkage would move "
            f"({', '.join(self.freedoms)}), and the reactions of {', '.join(self.pairs)} rest on it"
        )

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class PassedCrossing:
    """A crossing of branches that the path was led over, on the branch of continuous velocity.

    ``drivers`` by name at the crossing, ``miss`` by how much the loops stay open on the way that was assumed (angle, length over the
    size of the loop), ``branches`` the rates of all freedoms for a unit rate of the drivers on every branch that meets there,
    that of the one followed first; none where they could not be told apart.
    """

    drivers: Mapping[str, float]
    miss: float
    branches: tuple[Mapping[str, float], ...]

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        at = ", ".join(f"{name} = {value:.6g}" for name, value in self.drivers.items())
        ways = [
            ", ".join(f"{k} {v:.4g}" for k, v in way.items() if abs(v - self.branches[0][k]) > RATES_APART)
            for way in self.branches[1:]
        ]
        ways = [way for way in ways if way]
        own = f"; the others leave it with the rates {' or '.join(f'({way})' for way in ways)}" if ways else ""
        return (
            f"{at}: branches cross there, and the one of continuous velocity was followed; the loops meet to {self.miss:.0e} (angle, "
            "length over size of the loop), which dimensions that differ by as much would open, so that the motion goes on on another "
            f"branch{own}"
        )

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class _Worst:
    """The greatest relative ``error``, at which flat ``position``, and at how ``many`` it is too great."""

    error: float
    position: int
    many: int

    @property
    def places(self) -> str:
        """``3 positions``."""
        return f"{self.many} position{'s' if self.many > 1 else ''}"


@dataclass(frozen=True)
class Inaccurate(_Worst):
    """Rates and forces that rounding spoils: the greatest estimated relative ``error``, at which flat ``position``, and at how ``many``."""

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        return (
            f"rates and forces at {self.places} err by more than {PATH.inaccurate:.0e} of the "
            f"largest, at position {self.position} by some {self.error:.0e} (estimated): beside a dead point or a crossing of branches "
            "rounding grows with the condition (see checks.accuracy)"
        )

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Unbalanced(_Worst):
    """Forces that fail a ``check``: the greatest relative ``error``, at which flat ``position``, and at how ``many``."""

    check: Literal["equilibrium", "power"]

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        return (
            f"forces at {self.places} fail the check of {self.check} by more than {CHECKS.balanced:.0e} of the largest term, at position "
            f"{self.position} by {self.error:.0e} (see checks.{self.check}): do not use them; compare with the other engine and the other "
            "methods"
        )

    def __str__(self) -> str:
        return self.text


class Values(Protocol):
    """Where a Solution takes its values from (see ``result.trajectory``); every method returns batch-first arrays.

    ``mechanism`` is the one that was solved, with the freedoms that take efforts as its drives; ``whole`` the same with the free pairs
    through which the motion of points and links is prescribed, behind its own; ``prescribed`` and ``actuated`` are freedoms of that.
    ``least_norm``: reactions that are not unique have the value of least norm, not NaN; ``radius``: the mean radius L.
    """

    mechanism: Mechanism
    whole: Mechanism
    prescribed: tuple[str, ...]
    actuated: tuple[str, ...]
    batch: tuple[int, ...]
    t: Any
    has_forces: bool
    engine: Literal["dense", "sparse", "compiled"]
    method: str | None
    work: Work
    least_norm: bool
    radius: float

    def status(self) -> NDArray[np.str_]:
        """Named outcomes, one a position."""

    def checks(self) -> Checks:
        """Closure, equilibrium, power and accuracy."""

    def coordinates(self, pair: int) -> tuple[Array, Array, Array]:
        """Coordinates, rates and accelerations of the freedoms of a pair, ``(..., f)``."""

    def reaction(self, pair: int) -> Array:
        """Reaction of a pair about the global origin, ``(..., 6)``."""

    def total(self, pair: int) -> Array:
        """Total wrench of a pair about the global origin, ``(..., 6)``."""

    def on_link(self, pair: int, link: int) -> tuple[Array, Mask, Array]:
        """What a pair transmits to one of its links, (M, F) in its frame about the marker there, and whether unique, ``(..., 6)``;
        sizes of what is unique of M and F ``(..., 2)``.
        """

    def magnitude(self, pair: int) -> Array:
        """Size of what is unique of the force of the reaction, ``(...)``."""

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B, global directions, ``(..., 6)``."""

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name, ``(...)``."""

    def directions(self, pair: int) -> Array:
        """Forces of the unit reaction components of a pair, global directions, ``(..., 3, 6 - f)``."""

    def screws(self, pair: int) -> Array:
        """Twists of the freedoms of a pair at unit rates about the global origin, ``(..., 6, f)``."""

    def frame_origin(self, pair: int, k: int) -> Array:
        """Origin of frame k of a pair, global, ``(..., 3)``."""

    def unique(self, pair: int) -> dict[str, Array]:
        """Which reaction components and efforts of drives are unique, by name, ``(...)``."""

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """What the drive supplies, and what springs, dampers and given efforts do, ``(..., f)`` each."""

    def multiplier(self, coupling: int) -> Array:
        """Multiplier of a coupling, ``(...)``."""

    def contact(self, coupling: int) -> tuple[Array, Array]:
        """Force of gears on the second one, and the point where it acts, ``(..., 3)``."""

    def multipliers(self) -> tuple[Array, Mask]:
        """Multipliers of all couplings ``(n, T)``, of least norm where redundant, and where they are not unique."""

    def blocks(self) -> Iterator[Index]:
        """The solved flat places in parts, for ``..._at``: all pairs at some places ``(n,)``, the batch last."""

    def reactions_at(self, places: Index) -> tuple[Array, Mask]:
        """Reactions about the origins of markers B ``(6, P, n)``, of least norm where redundant, and which numbers are not unique."""

    def components_at(self, places: Index) -> tuple[Array, Mask]:
        """Components ``(6, P, n)`` by the pair table, 0 beyond those of a pair, and which are not unique."""

    def efforts_at(self, places: Index) -> tuple[Array, Array, Mask]:
        """Own and applied efforts ``(F, n)``, and which of the former are not unique."""

    def link(self, link: int) -> tuple[Array, Array, Array]:
        """Pose ``(..., 4, 4)``, twist and its rate ``(..., 6)`` of a link."""

    def link_hold(self, link: int) -> Array:
        """Wrench that keeps a passive body at rest, about the global origin, ``(..., 6)``."""

    def link_point(self, link: int, p: Any) -> MaterialPoint:
        """A material point given in the link's frame; the mass centre where it is None."""

    def kinetic_energy(self) -> Array:
        """Kinetic energy of all links, ``(...)``."""

    def shaking(self) -> Array:
        """Wrench of all that acts on the frame about the global origin, ``(..., 6)``."""

    def load(self, index: int) -> LoadResult:
        """What one load does."""

    def passive_efforts(self) -> dict[str, Array]:
        """What keeps passive bodies at rest, by name."""

    def load_bearing(self) -> tuple[LoadBearing, ...]:
        """Passive freedoms that the loads would move."""

    def crossings(self) -> tuple[PassedCrossing, ...]:
        """Crossings of branches that the path was led over."""

    def state(self, index: Any) -> State:
        """Screws and loads at one position, in the declared units about the global origin."""

    def part(self, places: slice) -> Values:
        """The values at a range of flat positions."""


OK = "ok"
"""Status of a solved position."""


def coordinate(m: Mechanism, name: str, value: float) -> str:
    """The value of a freedom with its unit: degrees for a turn."""
    if m.turns(name):
        return f"{number(float(np.rad2deg(value)))} deg"
    return with_unit(number(value), unit_of(m.units, (1, 0, 0)))


def driver_value(m: Mechanism, name: str, value: float) -> str:
    """``A.Rz = 30 deg``: a driver's value with its unit."""
    return f"{name} = {coordinate(m, name, value)}"


def coupling_unit(m: Mechanism, coupling: BaseCoupling) -> str:
    """The unit of the multiplier: a force where all freedoms are slides, else a moment."""
    slides = not any(m.turns(name) for name in coupling.freedoms)
    return unit_of(m.units, (1 if slides else 2, 1, -2))


class Places:
    """The positions of a solution laid out flat."""

    def __init__(self, values: Values) -> None:
        self.values = values
        self.m: Mechanism = values.mechanism
        self.status = np.asarray(values.status()).reshape(-1)
        self.solved = self.status == OK
        self.drivers = values.prescribed

    @cached_property
    def driver_values(self) -> list[Array]:
        """Coordinates of the drivers."""
        return [self.coordinates(name)[0] for name in self.drivers]

    def coordinates(self, name: str) -> tuple[Array, Array]:
        """Coordinate and rate of a freedom, one value a position."""
        k, j = self.values.whole.freedom(name)
        position, velocity, _ = self.values.coordinates(k)
        return self.flat(position[..., j]), self.flat(velocity[..., j])

    def flat(self, values: Any) -> Array:
        """One value a position."""
        return np.asarray(values, dtype=float).reshape(self.status.size)

    def runs(self) -> list[tuple[int, int]]:
        """First and last index of every run of equal statuses."""
        cuts = np.flatnonzero(self.status[1:] != self.status[:-1])
        starts = [0, *(int(c) + 1 for c in cuts)]
        ends = [*(int(c) for c in cuts), self.status.size - 1]
        return list(zip(starts, ends, strict=True)) if self.status.size else []

    def coordinate(self, name: str, value: float) -> str:
        """A driver's value with its unit."""
        return coordinate(self.values.whole, name, value)

    def name(self, index: int) -> str:
        """The driver values of a position; where these are not known its time, or its number."""
        found = [
            self.coordinate(n, v[index])
            for n, v in zip(self.drivers, self.driver_values, strict=True)
            if np.isfinite(v[index])
        ]
        if not found and self.values.t is not None:
            t = np.broadcast_to(np.asarray(self.values.t, dtype=float), self.values.batch).reshape(-1)[index]
            return f"t = {with_unit(number(t), unit_of(self.m.units, (0, 0, 1)))}"
        return ", ".join(found) or f"position {index}"

    def full_name(self, index: int) -> str:
        """The same with the names of the drivers, ``A.Rz = 30 deg``."""
        values = zip(self.drivers, self.driver_values, strict=True)
        found = [driver_value(self.values.whole, n, v[index]) for n, v in values if np.isfinite(v[index])]
        return ", ".join(found) or self.name(index)
