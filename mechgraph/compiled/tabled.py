"""A mechanism in the tables of the kernel, its numbers by the names that studies use, and what comes back in the user's units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mechgraph.by_kernel import cannot, gives_forces
from mechgraph.determinacy.snapping import meant
from mechgraph.errors import DeclarationError, listed
from mechgraph.kernel.loads import EFFORT
from mechgraph.kernel.tables import HEAD_LOAD_NUMBERS, HEAD_LOADS, Integers, Layout, layout, tables
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinematics.system import System
from mechgraph.kinetostatics import Pipeline
from mechgraph.maths.se3 import Array, homogeneous
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Declared, declared
from mechgraph.outcome import Options
from mechgraph.quantities import shown
from mechgraph.variants.numbers import AnyField, Variants, clashes, field_values, find_field, varied

STATUSES = (
    ("OK", "ok", "solved"),
    ("NOT_CLOSED", "loops not closed", "the loops of the start are not closed to rounding"),
    (
        "SINGULAR",
        "near a singular position",
        "the drives do not determine the motion well: a dead point or a change point is near",
    ),
    (
        "STEP",
        "not certified",
        "a step could not be certified: a dead point, an end of the reach or another branch is near",
    ),
    ("CONTRADICTION", "drives contradict each other", "the motions of the drives contradict each other"),
    ("NOT_FINITE", "not finite", "a coordinate, rate or load is no finite number"),
    ("STRAIN", "strained", "drives or couplings strain each other without any reaction"),
    ("TOO_FAR", "not followed", "the position is further than steps are made"),
    ("FORMAT_ERROR", "other tables", "tables of another version"),
    ("NOT_PASSIVE", "no longer passive", "a passive freedom moves other links here"),
)
"""What the kernel returns, by its number: identifier, word, meaning."""
TABLE_CHANGE = 0.02
"""Change of the tables over which their derivatives are taken, relative: where differences of order 8 are exact to rounding."""
ORDER_8 = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Central differences of order 8, see B. Fornberg, Mathematics of Computation 51 (1988) 699-706, table 1."""
FIRST_CHANGE, STEPS_TRIED = 1e-3, 8
"""First step that is tried, as a part of the number; steps tried at most."""


@dataclass(frozen=True)
class Tabled:
    """A mechanism in the tables: ``I`` what it is made of, ``P`` its numbers; ``home (d,)`` the declared position of the drives.

    ``fields`` are the declared numbers that were asked for by name; ``efforts``: whether efforts of the drives are what is given.
    """

    m: Mechanism
    system: System
    x: Array
    layout: Layout
    I: Integers
    P: Array
    drives: tuple[str, ...]
    home: Array
    fields: dict[str, AnyField] = field(default_factory=dict)
    efforts: bool = False

    def under_efforts(self) -> Tabled:
        """The same with a load more in every drive, the last ones of the tables: efforts that are given from outside."""
        I, d = self.I.copy(), len(self.drives)
        names, first = self.m.freedom_names(), int(I[HEAD_LOAD_NUMBERS])
        loads = [(EFFORT, names.index(name), 0, first + i) for i, name in enumerate(self.drives)]
        I[HEAD_LOADS] += d
        I[HEAD_LOAD_NUMBERS] += d
        I = np.concatenate([I, np.array(loads, dtype=np.int32).ravel()])
        return replace(self, I=I, P=np.append(self.P, np.zeros(d)), efforts=True)

    def copy(self) -> Tabled:
        """The same with names of its own."""
        return replace(self, fields=dict(self.fields))

    def columns(self, pair: str) -> slice:
        """The freedoms of a pair."""
        k, first = self.m.place_of_pair(pair), self.system.first_column
        return slice(int(first[k]), int(first[k]) + len(self.m.pairs[k].type.freedoms))

    @property
    def rotations(self) -> list[slice]:
        """The freedoms of every rotation."""
        return [slice(int(c), int(c) + 3) for c in np.flatnonzero(self.system.single_rows < 0)[::3]]

    def known(self, name: str) -> float:
        """The declared value of a number; its field is remembered.

        Raises
        ------
        DeclarationError
            where there is no such number.
        """
        if name not in self.fields:
            found = find_field(self.m, name) if isinstance(name, str) else f"{shown(name)}: expected a name"
            if isinstance(found, str):
                raise DeclarationError(f"parameters of {self.m.name!r}", [found])
            if faults := clashes(self.m, self.fields | {name: found}):
                raise DeclarationError(f"parameters of {self.m.name!r}", faults)
            self.fields[name] = found
        return field_values(self.m, {name: self.fields[name]})[name]

    def changed(self, values: Mapping[str, float]) -> Mechanism:
        """The mechanism with other numbers.

        Raises
        ------
        DeclarationError
            where no such mechanism can be.
        """
        fields = {name: self.fields[name] for name in values}
        return varied(self.m, fields, np.array(list(values.values()), dtype=float)[:, None]).one(0)

    def numbers(self, values: Mapping[str, Any], checked: bool = True) -> Array:
        """``P (B, numbers)`` of variants with other numbers, one number or an array ``(B,)`` of each.

        Differences are taken over numbers that are not ``checked``: a small mass less a step is none, a thin rod has no inertia beside it.

        Raises
        ------
        DeclarationError
            where no such mechanism can be.
        """
        if not values:
            return self.P[None]
        variants = self.possible(values, checked)
        if _one_by_one(variants):
            made = [variants.one(i) for i in range(variants.count)]
            return np.concatenate([self._table(m, declared(m), m.loads, 1) for m in made])
        return self._table(self.m, variants.numbers, variants.loads, variants.count)

    def possible(self, values: Mapping[str, Any], checked: bool = True) -> Variants:
        """The variants with other numbers, see ``numbers``; refused where one of them can be no mechanism."""
        rows = np.array(np.broadcast_arrays(*np.atleast_1d(*values.values(), 0.0)), dtype=float)[:-1]
        variants = varied(self.m, {name: self.fields[name] for name in values}, rows)
        if checked and _one_by_one(variants):
            variants.one(0)  # says what is wrong, as below
        for i in np.flatnonzero(~variants.valid()) if checked and not _one_by_one(variants) else ():
            variants.one(int(i))
            raise DeclarationError(
                f"parameters of {self.m.name!r}", [f"no mechanism has these numbers: {listed(values)}"]
            )
        return variants

    def _table(self, m: Mechanism, numbers: Declared, loads: Sequence[Load], count: int) -> Array:
        """``P (count, numbers)`` of variants of a mechanism."""
        par = self.system.par
        system = System(m, self.system.graph, numbers.parameters(m, par.offset, par.origin, par.L))
        found = tables(self.layout, system, np.tile(self.x[:, None], count), tuple(loads))
        assert found is not None
        return found[1]

    def derivative(self, values: Mapping[str, float], name: str) -> Array:
        """How ``P`` changes with one number."""
        middle = values[name]
        step, here = FIRST_CHANGE * (abs(middle) or 1.0), self.numbers(values)[0]
        for _ in range(STEPS_TRIED):
            there = self.numbers({**values, name: middle + step}, checked=False)[0]
            change = float((np.abs(there - here) / np.maximum(np.abs(here), 1.0)).max())
            if 0.25 * TABLE_CHANGE <= change <= TABLE_CHANGE or not change:
                break
            step *= 0.5 * TABLE_CHANGE / change
        k = np.arange(1, len(ORDER_8) + 1)
        ahead, behind = (
            self.numbers({**values, name: middle + sense * step * k}, checked=False) for sense in (1.0, -1.0)
        )
        return np.asarray(np.array(ORDER_8) @ (ahead - behind) / step)

    def poses(self, internal: Array) -> Array:
        """Poses ``(..., 4, 4)`` of the declared link frames from internal ones ``(..., N, 3, 4)``."""
        par, R = self.system.par, internal[..., :3]
        p = par.origin + par.L * internal[..., 3] - (R @ par.offset.T[:, :, None])[..., 0]
        return np.moveaxis(
            homogeneous(np.moveaxis(np.concatenate([R, p[..., None]], axis=-1), (-2, -1), (0, 1))), (0, 1), (-2, -1)
        )


def tabled(m: Mechanism, asked: str = "compile") -> Tabled:
    """The tables of a mechanism at its declared position.

    Raises
    ------
    DeclarationError
        which names what the kernel cannot carry; errors of the start as in ``solve``.
    """
    subject = f"{asked} {m.name!r}"
    own = meant(m, None, asked)
    drives = tuple(own.full_name(drive.freedom) for drive in own.drives)
    if not drives or not own.has_geometry:
        missing = "geometry" if drives else "drives: expected the freedoms that are driven, e.g. drives=['A']"
        raise DeclarationError(subject, [f"the mechanism declares no {missing}"])
    start = closed_start(own)
    coordinates = start.system.coordinates_of(start.x, start.system.start_coordinates(own.start))[:, 0]
    home = coordinates[[own.freedom_names().index(name) for name in drives]]
    line = Pipeline(DriverMotion(own, dict(zip(drives, home.tolist(), strict=True))), Options())
    system, x = line.system, line.x
    if fault := cannot(line) or (
        None if gives_forces(line) else "it does not find the forces at contacts of gears, racks and belts"
    ):
        raise DeclarationError(subject, [f"the compiled kernel does not carry it: {fault}"])
    places = layout(system, line.columns, line.passive)
    found = tables(places, system, x[:, None], own.loads)
    if found is None:
        known = listed(sorted({load.kind for load in own.loads}))
        fault = (
            f"a load is a function, a table over coordinate and rate, or varies over positions (loads: {known}); "
            "expected constant numbers"
        )
        raise DeclarationError(subject, [f"the compiled kernel does not carry it: {fault}"])
    I, P = found
    return Tabled(own, system, x, places, I, P[0], drives, home)


def _one_by_one(variants: Variants) -> bool:
    """Whether each variant has to be declared by itself."""
    return any(field.one_by_one for field, _ in variants.own)
