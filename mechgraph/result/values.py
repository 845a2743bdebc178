"""Records that a solution hands out: checks, points, loads, warnings; and numbers for people."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechgraph.document import Document, Shown, Table
from mechgraph.errors import MechgraphError
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import CHECKS, PATH, STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import shown, unit_of

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


@dataclass(frozen=True, repr=False)
class Checks(Shown):
    """Every solution's own checks, arrays over positions.

    closure : closure error, the largest angle [rad] or length / L over all loops.
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
            f"{self.name}: load-bearing passive freedom, held by an artificial {self.size.removeprefix('a ')} (max): "
            f"the real linkage would move ({', '.join(self.freedoms)}), and the reactions of {', '.join(self.pairs)} depend on it"
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
        # difference of rates on two branches from which on they are shown
        ways = [
            ", ".join(f"{k} {v:.4g}" for k, v in way.items() if abs(v - self.branches[0][k]) > 1e-6)
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


@dataclass(frozen=True)
class MisfitsLeftOut:
    """Misfits in reaction ``components`` that are not unique, of which only ``redundant="elastic"`` takes account."""

    components: tuple[str, ...]

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        return (
            f"the misfits of {', '.join(self.components)} are left out, with the forces that they lock in: only redundant='elastic', "
            "with the stiffness of the pairs, takes account of them"
        )

    def __str__(self) -> str:
        return self.text


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
    slides = coupling.is_force or not any(m.turns(name) for name in coupling.freedoms)
    return unit_of(m.units, (1 if slides else 2, 1, -2))


def flat_place(batch: tuple[int, ...], index: Any) -> int:
    """Place in the flat batch of the one position that an index names.

    Raises
    ------
    MechgraphError
    """
    try:
        flat = np.arange(int(np.prod(batch))).reshape(batch)[index]
    except (IndexError, ValueError, TypeError):
        text = f"state({shown(index)}): no such position in a batch {batch}; give one index an axis"
        raise MechgraphError(text) from None
    if np.ndim(flat):
        raise MechgraphError(
            f"state({shown(index)}): names {np.size(flat)} positions of a batch {batch}; give one index an axis"
        )
    return int(flat)


def unique_sizes(states: Array) -> Array:
    """Sizes ``(T,)`` of what is unique of vectors ``(3, T)``: of their part at right angles to all that self-stresses add to them.

    ``states (3, 1 + s, T)`` are the vectors and what the self-stresses have in them. NaN where these take every direction.
    """
    vectors, stress = states[:, 0], np.moveaxis(states[:, 1:], -1, 0)
    if not stress.shape[-1]:
        return np.asarray(np.linalg.norm(vectors, axis=0))
    solved = np.asarray(np.isfinite(stress).all(axis=(1, 2)))
    ways, sizes, _ = np.linalg.svd(np.where(solved[:, None, None], stress, 0.0), full_matrices=False)
    loose = sizes > STRESSES.unique
    along = np.einsum("tij,it->tj", ways, vectors) * loose
    left = vectors - np.einsum("tij,tj->it", ways, along)
    return np.where(solved & (loose.sum(axis=-1) < len(vectors)), np.linalg.norm(left, axis=0), np.nan)


Fact = tuple[str, Array, tuple[int, ...]]
"""Name, values ``(...)`` and dimension of a column; no exponents for a number without a unit."""


class PositionLabels:
    """The positions of a solution, the ``Trajectory`` ``values``, laid out flat."""

    def __init__(self, values: Any) -> None:
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
        position, velocity = (self.values.coordinates(k, rank) for rank in (0, 1))
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
