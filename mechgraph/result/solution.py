"""The Solution: values by the names of pairs, freedoms and links, batch axes first, in the declared units."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import place_among
from mechgraph.data import json_text, plain
from mechgraph.document import Document, Shown, to_text
from mechgraph.equations.terms import State
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.newton import Work
from mechgraph.numerics.tolerances import CHECKS, PATH
from mechgraph.quantities import wrong
from mechgraph.result import export
from mechgraph.result.contact_ranges import LiftOff, Overlap
from mechgraph.result.contacts import ContactResult, contacts_of, lift_offs, overlaps, place_of_contact
from mechgraph.result.places import OK, Places
from mechgraph.result.record import solution_data
from mechgraph.result.summary import summary
from mechgraph.result.table import Include, table_of
from mechgraph.result.values import (
    Checks,
    Inaccurate,
    LoadBearing,
    LoadResult,
    Mask,
    PassedCrossing,
    Unbalanced,
    Values,
)
from mechgraph.result.views import CouplingResult, LinkResult, PairResult

if TYPE_CHECKING:
    import pandas
    import xarray


class Solution(Shown):
    """Motion and forces at a batch of positions, by name: ``s["D"].reaction``, ``s.link("coupler").pose``.

    It can be pickled where its loads can: those that hold numbers, or a function of a module.
    """

    _wanted = "a Solution; mg.solve(mechanism) makes one"

    def __init__(self, values: Values) -> None:
        self._values = values

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved; its drives are the freedoms that take unknown efforts."""
        return self._values.mechanism

    @property
    def prescribed(self) -> tuple[str, ...]:
        """Full names of what was prescribed: freedoms, coordinates of points and links."""
        return self._values.prescribed

    @property
    def actuated(self) -> tuple[str, ...]:
        """Full names of the freedoms in which unknown efforts stand; those prescribed, unless others were named."""
        return self._values.actuated

    @property
    def whole(self) -> Mechanism:
        """The mechanism with the free pairs through which the motion of points and links is prescribed."""
        return self._values.whole

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch of positions; empty for one position."""
        return self._values.batch

    def __getitem__(self, pair: str) -> PairResult:
        return PairResult(self._values, self.whole.place_of_pair(pair))

    def link(self, name: str) -> LinkResult:
        """Motion of a link."""
        return LinkResult(self._values, self.mechanism.place_of_link(name))

    def on_link(self, pair: str, link: str) -> tuple[Array, Mask]:
        """All that a pair transmits to one of its links, ``(..., 6)``, (M, F) in the link's frame about the pair's marker on that link.

        With it ``(..., 6)`` truth values: which of these numbers are unique. The others are NaN unless the solution is of least norm.

        Raises
        ------
        DeclarationError
            where the pair does not join that link.
        """
        k, i = self.whole.place_of_pair(pair), self.whole.place_of_link(link)
        if link not in (self.whole.pairs[k].a, self.whole.pairs[k].b):
            raise DeclarationError(
                f"pair {pair!r}",
                [
                    wrong(
                        link,
                        "link",
                        f"one of the links that it joins, {self.whole.pairs[k].a!r} and {self.whole.pairs[k].b!r}",
                    )
                ],
            )
        return self._values.on_link(k, i)[:2]

    def sizes_on_link(self, pair: str, link: str) -> Array:
        """Sizes ``(..., 2)`` of what is unique of moment and force in ``on_link``, whichever directions that has."""
        return self._values.on_link(self.whole.place_of_pair(pair), self.whole.place_of_link(link))[2]

    def coupling(self, name: str) -> CouplingResult:
        """Values of a coupling."""
        m = self.mechanism
        return CouplingResult(self._values, m.couplings.index(m.coupling(name)))

    @property
    def contacts(self) -> dict[str, ContactResult]:
        """Facts of all pairs whose elements touch at a point or along a line, by name: paths, normal forces, sliding, pressure."""
        return contacts_of(self._values)

    def contact(self, pair: str) -> ContactResult:
        """Facts of one of them."""
        return ContactResult(self._values, place_of_contact(self._values, pair))

    def load(self, index: int) -> LoadResult:
        """What the load of that number in ``mechanism.loads`` does: wrenches on links, power, and how a force law is read."""
        of = f"load of {self.mechanism.name!r}"
        return self._values.load(place_among(index, len(self.mechanism.loads), "index", of))

    @property
    def has_forces(self) -> bool:
        """Whether reactions and efforts were solved (``kinematics`` leaves them out)."""
        return self._values.has_forces

    @property
    def status(self) -> NDArray[np.str_]:
        """Named outcomes, one a position: an array of texts."""
        return self._values.status()

    @property
    def t(self) -> Any:
        """Times of the motion, where it has any."""
        return self._values.t

    @property
    def engine(self) -> str:
        """Which engine ran, ``"dense"`` or ``"sparse"`` matrices, or the kernel, ``"compiled"``; the values are the same."""
        return self._values.engine

    @property
    def method(self) -> str | None:
        """How the forces were solved, ``"loop_wrench"``, ``"newton_euler"`` or ``"printed"``; None for a motion alone."""
        return self._values.method

    @property
    def work(self) -> Work:
        """How much was computed: positions, nodes of the path, evaluations and factorizations of the equations."""
        return self._values.work

    @property
    def checks(self) -> Checks:
        """Closure error, equilibrium residual, power balance and estimated accuracy at every position."""
        return self._values.checks()

    @property
    def kinetic_energy(self) -> Array:
        """Kinetic energy of all links ``(...)``."""
        return self._values.kinetic_energy()

    @property
    def shaking(self) -> Array:
        """Wrench ``(..., 6)`` about the global origin of all that acts on the frame: pairs, springs, loads on it, its own weight.

        What supports the frame bears it: it is the sum of the loads on all links and of their inertia.
        """
        return self._values.shaking()

    @property
    def passive_effort(self) -> dict[str, Array]:
        """What keeps passive bodies from spinning (or sliding) in space: a couple about the axis, or a force, by the report's name.

        Zero where nothing turns them; otherwise no part supplies it (see ``warnings``). The orientation of such a body depends on the
        path: from the start on it does not spin about its axis.
        """
        return self._values.passive_efforts()

    @property
    def doubts(self) -> tuple[LoadBearing | LiftOff | Overlap | Unbalanced, ...]:
        """What makes reactions doubtful: passive freedoms that carry load, contacts that would have to pull, or cut into each other; forces
        that fail the check of equilibrium or power.
        """
        return (*self._values.load_bearing(), *lift_offs(self._values), *overlaps(self._values), *self._unbalanced())

    def _unbalanced(self) -> Iterator[Unbalanced]:
        checks = self.checks
        names: tuple[Literal["equilibrium", "power"], ...] = ("equilibrium", "power")
        for check in names:
            error = np.where(self.status == OK, np.abs(getattr(checks, check)), np.nan)
            found = _worst(error, CHECKS.balanced)
            if found and not self._forces_are_rounding:
                yield from (Unbalanced(*one, check) for one in found)

    @property
    def _forces_are_rounding(self) -> bool:
        """Whether all pairs transmit next to nothing beside ``m v w``, and ``m v w r + I w^2`` as a moment: of links that nothing
        accelerates, what is left of forces is rounding of their motion.
        """

        def largest(values: Array) -> float:
            return float(np.nan_to_num(np.abs(values)).max(initial=0.0))

        m, force, moment = self.mechanism, 0.0, 0.0
        w = max(largest(self.link(link.name).angular_velocity) for link in m.links)
        for link in m.links:
            if link.mass:
                r = self.link(link.name)
                turned = link.mass * largest(r.center_velocity) * w
                force += turned
                moment += turned * largest(r.center) + (0.0 if link.inertia is None else largest(link.inertia)) * w * w
        totals = [self[p.name].total for p in m.pairs]
        return all(
            largest(total[..., 3:]) <= CHECKS.rounding * force and largest(total[..., :3]) <= CHECKS.rounding * moment
            for total in totals
        )

    @property
    def warnings(self) -> tuple[LoadBearing | LiftOff | Overlap | Unbalanced | PassedCrossing | Inaccurate, ...]:
        """What makes reactions doubtful (``doubts``); crossings of branches that were passed, with place, miss and the other branches;
        rates and forces that rounding spoils (see ``checks.accuracy``).
        """
        worst = [Inaccurate(*one) for one in _worst(self.checks.accuracy, PATH.inaccurate)]
        return (*self.doubts, *self._values.crossings(), *worst)

    def document(self, asked: bool = False) -> Document:
        """What ``print`` shows; ``asked`` as in ``summary()``, also what takes long."""
        return summary(self._values, asked)

    def summary(self) -> str:
        """Positions, ranges of the drivers and of their efforts, greatest reactions and where, checks, engine and work, as text.

        The text of the command line and of ``print``, which leaves out what takes long at many positions of many pairs.
        """
        return to_text(self.document(asked=True))

    def to_dict(self) -> dict[str, Any]:
        """What the summary tells as plain data, of all pairs."""
        return dict(plain(solution_data(self._values)))

    def to_json(self) -> str:
        """The same as JSON."""
        return json_text(self.to_dict())

    def view(self) -> Any:
        """The solution in a notebook: the mechanism in space, its forces and curves (``notebook`` extra).

        Raises
        ------
        MissingExtraError
            without anywidget.
        """
        # up to a room above: a user looks for it here
        return importlib.import_module("mechgraph.show.page.write").view(self)

    def place(self, index: int) -> str:
        """A position of the flat batch in words: the values of the drivers, or its time."""
        return Places(self._values).full_name(place_among(index, self.status.size, "index", "place of a position"))

    def state(self, index: int | slice | tuple[int, ...] = ()) -> State:
        """Screws, loads and coordinates at one position, for ``Formulation.assemble``."""
        return self._values.state(index)

    def part(self, places: slice) -> Solution:
        """The same at a range of flat positions, without a copy; its checks stay relative to the whole batch."""
        return Solution(self._values.part(places))

    # --- tables --------------------------------------------------------------------------------------------------------

    def columns(self, include: Sequence[Include] = ()) -> Mapping[str, Array]:
        """All numbers of the table by column name with unit, ``(...)`` each.

        ``include`` adds the motion of named ``"points"``, the poses of ``"links"`` (origin x, y, z and rotation matrix Rxx, Rxy, ...) with
        angular rates, the motion of mass ``"centers"``, what the ``"loads"`` do, and the facts of ``"contacts"``.
        """
        return {column.label: column.values for column in table_of(self._values, include)}

    def to_pandas(self, include: Sequence[Include] = ()) -> pandas.DataFrame:
        """A DataFrame, one row a position (``pandas`` extra); ``include`` as in ``columns``."""
        return export.to_pandas(self._values, include)

    def to_xarray(self, include: Sequence[Include] = ()) -> xarray.Dataset:
        """A Dataset over the batch axes (``xarray`` extra); ``include`` as in ``columns``.

        Names are those of ``columns`` without units, which stand in ``attrs["units"]``. Coordinates are the times and what was
        prescribed; one row of rising times is the dimension ``t``, every other last axis is ``position``.
        """
        return export.to_xarray(self._values, include)

    def write(self, path: str | os.PathLike[str], include: Sequence[Include] = ()) -> None:
        """Write the table, whole or not at all, as the suffix says; ``include`` as in ``columns``.

        ``.csv``; ``.nc``, the Dataset as NetCDF 4 (``netcdf`` extra; slashes in names, and spaces in those of coordinates, are quoted:
        ``%2F``); ``.parquet``, the DataFrame (``parquet`` extra).

        Raises
        ------
        FileError
            for another suffix, or where the file cannot be written; MissingExtraError.
        """
        export.write(self._values, path, include)

    def to_csv(self, path: str | os.PathLike[str], include: Sequence[Include] = ()) -> None:
        """Write the table as CSV, whole or not at all; ``include`` as in ``columns``."""
        export.to_csv(self._values, path, include)

    def __repr__(self) -> str:
        status = self.status
        solved = f"{int((status == OK).sum())} of {status.size} solved"
        return f"{type(self).__name__}({self.mechanism.name!r}, batch {self.batch}, {solved}; print it for its summary)"


def _worst(errors: Array, limit: float) -> list[tuple[float, int, int]]:
    """The greatest of errors above a limit, its flat position, and how many there are; empty where there are none."""
    flat = errors.reshape(-1)
    off = np.flatnonzero(flat > limit)
    return [(float(flat[i]), int(i), off.size) for i in off[np.argsort(-flat[off])][:1]]
