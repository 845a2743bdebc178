"""The Solution: values by the names of pairs, freedoms and links, batch axes first, in the declared units; its table and its exports."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from mechgraph import methods
from mechgraph.document import Document, Shown, to_text
from mechgraph.equations.terms import State
from mechgraph.errors import DeclarationError, visible
from mechgraph.files import Format, csv_of, format_of, json_text, optional, plain, whole_file, write_whole
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import CHECKS, PATH
from mechgraph.model.loads import Law
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.factors import WRENCHES
from mechgraph.pairs.journal import Journal
from mechgraph.quantities import BASE_UNITS, items_of, place_among, unit_of, unknown, wrong
from mechgraph.result.contacts import (
    ContactResult,
    LiftOff,
    Overlap,
    contact_columns,
    contacts_of,
    lift_offs,
    overlaps,
    place_of_contact,
)
from mechgraph.result.film import FilmResult
from mechgraph.result.notes import NotSolved, Remark, angle_remarks, friction_notes, not_solved
from mechgraph.result.summary import solution_data, summary
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import (
    OK,
    Checks,
    Fact,
    Inaccurate,
    LoadBearing,
    LoadResult,
    Mask,
    MaterialPoint,
    MisfitsLeftOut,
    PassedCrossing,
    PositionLabels,
    Unbalanced,
)
from mechgraph.result.views import (
    BeltResult,
    CouplingResult,
    LinkResult,
    PairResult,
    couplings_of,
    forces_of_couplings,
    geometry_of_couplings,
    losses,
    misfits_left_out,
)

if TYPE_CHECKING:
    import pandas
    import xarray


Doubt = LoadBearing | LiftOff | Overlap | Unbalanced | MisfitsLeftOut
"""What makes a solution doubtful."""


class Jam(NamedTuple):
    """By how much friction would have to fall, ``factor``, and the names of the ``places`` whose normal forces grow."""

    factor: float
    places: tuple[str, ...]


class Column(NamedTuple):
    """Name, values ``(...)`` and unit of a column; no unit where the mechanism declares none, and for what has none."""

    name: str
    values: Array
    unit: str = ""

    @property
    def label(self) -> str:
        """``A.Rz effort [N m]``."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def table_of(s: Trajectory, include: Sequence[Include] = ()) -> list[Column]:
    """All columns: coordinates, rates, efforts, reaction components, status and checks.

    Names are ``B.Tz``, ``B.Tz velocity``, ``B.Tz effort`` (of the drive), ``B.Tz applied effort`` (of springs, dampers, given efforts),
    ``B:Fx`` (component of the reaction); ``g normal force``, ``belt tension p1-p2`` (of gears and belts). ``include`` adds what ``MORE``
    has under these names.
    """
    m = s.mechanism
    faults: list[str] = []
    asked = items_of(include, "include", faults)
    faults += [wrong(name, "include", " or ".join(map(repr, MORE))) for name in asked if name not in tuple(MORE)]
    if faults:
        raise DeclarationError("table of a solution", faults)
    out: list[Column] = []

    def put(name: str, values: Array | NDArray[np.str_], *dimension: float, unit: str = "") -> None:
        out.append(Column(name, np.asarray(values), unit or unit_of(m.units, dimension)))

    if s.t is not None:
        put("t", np.broadcast_to(s.t, s.batch), 0, 0, 1)
    shown = {*m.freedom_names(), *s.prescribed}
    for k, pair in enumerate(s.whole.pairs):
        r = PairResult(s, k)
        values = (r.position, r.velocity, r.acceleration)
        for j, (name, freedom) in enumerate(zip(pair.freedom_names, pair.type.freedoms, strict=True)):
            if name not in shown:
                continue
            for order, (label, value) in enumerate(zip(("", " velocity", " acceleration"), values, strict=True)):
                put(name + label, value[..., j], 0 if freedom.turns else 1, 0, -order)
    if s.has_forces:
        for k, pair in enumerate(s.whole.pairs):
            r = PairResult(s, k)
            efforts = {"effort": r.effort, "applied effort": r.applied_effort}
            for j, (name, part) in enumerate(zip(pair.freedom_names, pair.type.efforts, strict=True)):
                for label, effort in efforts.items() if name in shown else ():
                    put(f"{name} {label}", effort[..., j], 2 if part.is_couple else 1, 1, -2)
            for name, value in r.components.items():
                put(f"{pair.name}:{name}", value, unit=r.units["components"][name])
    for column, more, dimension in (*forces_of_couplings(s), *(one for name in asked for one in MORE[name](s))):
        put(column, more, *dimension)
    for name in ("closure", "equilibrium", "power", "accuracy"):
        put(name, getattr(s.checks(), name))
    put("status", s.status())
    return out


def _vector(name: str, values: Array, dimension: tuple[int, ...], letters: Sequence[str]) -> Iterator[Fact]:
    for i, letter in enumerate(letters):
        yield f"{name}:{letter}", values[..., i], dimension


def _point(name: str, p: MaterialPoint, letters: str) -> Iterator[Fact]:
    for order, (label, values) in enumerate(zip(("", " velocity", " acceleration"), p, strict=True)):
        yield from _vector(name + label, values, (1, 0, -order), letters)


def _points(s: Trajectory) -> Iterator[Fact]:
    """Motion of the named points of links: ``bucket.tip:x``, ``bucket.tip velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        for name, p in link.points.items():
            yield from _point(f"{link.name}.{name}", s.link_point(i, p), s.mechanism.axes)


def _links(s: Trajectory) -> Iterator[Fact]:
    """Poses of the links: origin of the frame ``crank:x``, rotation matrix ``crank:Rxx``, and angular rates."""
    axes, turns = s.mechanism.axes, slice(2, 3) if s.mechanism.planar else slice(3)
    for i, link in enumerate(s.mechanism.links):
        pose, twist, acceleration = s.link(i)
        yield from _vector(link.name, pose[..., :3, 3], (1, 0, 0), axes)
        for j, row in enumerate(axes):
            for k, column in enumerate(axes):
                yield f"{link.name}:R{row}{column}", pose[..., j, k], ()
        yield from _vector(f"{link.name} angular velocity", twist[..., turns], (0, 0, -1), "xyz"[turns])
        yield from _vector(f"{link.name} angular acceleration", acceleration[..., turns], (0, 0, -2), "xyz"[turns])


def _centers(s: Trajectory) -> Iterator[Fact]:
    """Motion of the mass centers: ``crank center:x``, ``crank center velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        if link.center is not None:
            yield from _point(f"{link.name} center", s.link_point(i, None), s.mechanism.axes)


def _loads(s: Trajectory) -> Iterator[Fact]:
    """What loads do: coordinate, rate and force of laws, efforts, else wrenches on links about the global origin; and their power."""
    m = s.mechanism
    for i, load in enumerate(m.loads):
        found, name = s.load(i), f"loads[{i}] {load.kind}"
        turns = m.turns(load.in_freedom)
        if isinstance(load, Law):
            read = m.turns(load.reads_freedom)
            yield f"{name} x", found.coordinate, (0 if read else 1, 0, 0)
            yield f"{name} v", found.rate, (0 if read else 1, 0, -1)
        if isinstance(load, Law) or load.in_freedom is not None:
            yield f"{name} force", found.force, (2 if turns else 1, 1, -2)
        else:
            for link, wrench in found.wrenches.items():
                for i in range(6)[m.span]:
                    yield f"{name} on {link}:{WRENCHES[i]}", wrench[..., i], (2 if i < 3 else 1, 1, -2)
        yield f"{name} power", found.power, (2, 1, -3)


Include = Literal["points", "links", "centers", "loads", "contacts"]


def _contacts(s: Trajectory) -> Iterator[Fact]:
    yield from contact_columns(s)
    yield from geometry_of_couplings(s)


MORE: dict[str, Callable[[Trajectory], Iterator[Fact]]] = {
    "points": _points, "links": _links, "centers": _centers, "loads": _loads, "contacts": _contacts,
}  # fmt: skip
"""What a table may have beside the pairs, on request."""


ROWS_TOGETHER = 1024
"""Rows of a CSV table that are made together: bounds the memory that a long table takes."""
Path = str | os.PathLike[str]


def to_csv(s: Trajectory, path: Path, include: Sequence[Include] = ()) -> None:
    """Write one row a position; numbers with all digits. The rows are made as they are written, some at a time."""
    write_whole(path, _csv_pieces(s, include))


def _csv_pieces(s: Trajectory, include: Sequence[Include]) -> Iterator[str]:
    count = s.status().size
    for first in range(0, max(count, 1), ROWS_TOGETHER):
        table = table_of(s.part(slice(first, first + ROWS_TOGETHER)), include)
        rows = zip(*(column.values.tolist() for column in table), strict=True)
        yield csv_of([column.label for column in table] if not first else (), rows)


def to_pandas(s: Trajectory, include: Sequence[Include] = ()) -> pandas.DataFrame:
    """The table as a DataFrame; several batch axes become index levels, units by column stand in ``attrs`` too."""
    pd = optional("pandas", "pandas")
    table = table_of(s, include)
    frame = pd.DataFrame({column.label: column.values.reshape(-1) for column in table})
    if len(s.batch) > 1:
        frame.index = pd.MultiIndex.from_product([range(n) for n in s.batch], names=axis_names(s.batch))
    frame.attrs = {**_facts(s), "units": {column.label: column.unit for column in table if column.unit}}
    return frame


def to_parquet(s: Trajectory, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the DataFrame as Parquet; ``pandas.read_parquet`` gives back an equal one, ``attrs`` included."""
    frame = to_pandas(s, include).rename(columns=visible)
    frame.attrs["units"] = {visible(name): unit for name, unit in frame.attrs["units"].items()}
    with whole_file(path) as temporary:
        frame.to_parquet(temporary, engine="pyarrow")


def to_xarray(s: Trajectory, include: Sequence[Include] = ()) -> xarray.Dataset:
    """The table as a Dataset over the batch axes: units as attributes, times and what is prescribed as coordinates.

    One row of rising times is the dimension ``t``, every other last axis is ``position``.
    """
    xr = optional("xarray", "xarray")
    axes = axis_names(s.batch)
    if s.t is not None and np.shape(s.t) == s.batch and len(axes) == 1 and bool((np.diff(s.t) > 0).all()):
        axes = ["t"]
    data: dict[str, Any] = {}
    for name, values, unit in table_of(s, include):
        data[name] = (axes, values, {"units": unit} if unit else {})
    coordinates = [name for name in ("t", *s.prescribed) if name in data]
    return xr.Dataset(data, attrs=_facts(s)).set_coords(coordinates)


def to_netcdf(s: Trajectory, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the Dataset as NetCDF 4; ``xarray.open_dataset`` gives it back.

    A slash separates groups there and a space coordinates: they are quoted as in an address (``urllib.parse.unquote`` undoes it).
    """
    data = to_xarray(s, include)
    signs = {name: r"[%/\s]" if name in data.coords else "[%/]" for name in data.variables}
    names = {name: re.sub(sign, lambda found: quote(found[0], safe=""), str(name)) for name, sign in signs.items()}
    data = data.rename({name: visible(quoted) for name, quoted in names.items()})
    with whole_file(path) as temporary:
        data.to_netcdf(temporary, engine="h5netcdf")


FORMATS = (
    Format("CSV", (".csv",), to_csv),
    Format("NetCDF", (".nc",), to_netcdf, ("xarray", "h5netcdf", "h5py"), "netcdf"),
    Format("Parquet", (".parquet",), to_parquet, ("pandas", "pyarrow"), "parquet"),
)
"""What a solution can be written as."""


def write(s: Trajectory, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the table in the format that the suffix says."""
    format_of(path, FORMATS).write(s, path, include)


def _facts(s: Trajectory) -> dict[str, str]:
    """What the solution is of, and how it was made; texts alone."""
    m = s.mechanism
    texts = {"mechanism": m.name, "description": m.description, "source": m.source, "engine": s.engine}
    texts |= {"method": s.method or "", **{f"unit of {name}": m.units.get(name, "") for name in BASE_UNITS}}
    return {name: visible(text) for name, text in texts.items() if text}


def axis_names(batch: tuple[int, ...]) -> list[str]:
    """Names of the batch axes: the last is the position, those before it are cases."""
    return [f"case{i}" if len(batch) > 2 else "case" for i in range(len(batch) - 1)] + ["position"] * (len(batch) > 0)


class Solution(Shown):
    """Motion and forces at a batch of positions, by name. Returned by ``solve`` and ``kinematics``.

    ``s["D"]`` is a pair, ``s.link("coupler")`` a link, ``s.coupling("g")`` a coupling, ``s.load(0)`` a load, ``s.contact("E")`` a
    contact. Leading axes of all arrays are positions. A solution can be pickled if its loads can.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> s["D"].reaction.shape, s.link("coupler").pose.shape
    ((3, 6), (3, 4, 4))
    >>> print(s.status)
    ['ok' 'ok' 'ok']
    """

    _wanted = "a Solution; mg.solve(mechanism) makes one"
    integrated = False
    """Whether the motion was found in time; then there are values at all times."""

    def __init__(self, values: Trajectory) -> None:
        self._values = values

    def finely(self) -> Solution:
        """The same, as its paths are drawn: a response at times between its outputs too."""
        return self

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved; its drives are the freedoms that take unknown efforts."""
        return self._values.mechanism

    @property
    def planar(self) -> bool:
        """Whether the mechanism is planar: what leaves the x-y plane is zero by the model."""
        return self.mechanism.planar

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
        """Return the motion of a link.

        Parameters
        ----------
        name : str
            Name of the link.

        Returns
        -------
        LinkResult
            ``pose``, ``twist``, ``acceleration``, ``center``, ``center_velocity``, ``point(p)``, ``at("tip")``, ...

        Raises
        ------
        DeclarationError
            Unknown link.

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.kinematics(mg.load("four-bar"), {"A": mg.Motion(0.0, velocity=10.0)})
        >>> s.link("crank").twist.round(6) + 0
        array([ 0.,  0., 10.,  0.,  0.,  0.])
        """
        return LinkResult(self._values, self.mechanism.place_of_link(name))

    def on_link(self, pair: str, link: str) -> tuple[Array, Mask]:
        """Return all that a pair transmits to one of its links, in the frame of the link about the pair's marker on it.

        Parameters
        ----------
        pair, link : str
            Names.

        Returns
        -------
        wrench : (..., 6) array
            (M, F); NaN where not unique, unless the solution has minimum norm.
        unique : (..., 6) array of bool
            Which of these numbers are unique.

        Raises
        ------
        DeclarationError
            The pair does not join that link.

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.solve(mg.load("four-bar"), {"A": 0.5})
        >>> wrench, unique = s.on_link("B", "coupler")
        >>> unique
        array([False, False,  True,  True,  True, False])
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

    def coupling(self, name: str) -> CouplingResult | BeltResult:
        """Return the values of a coupling.

        Parameters
        ----------
        name : str
            Name of the coupling.

        Returns
        -------
        CouplingResult
            ``effort`` (multiplier); of gears also ``force``, ``point`` and ``sliding``.

        Raises
        ------
        DeclarationError
            Unknown coupling.

        Examples
        --------
        >>> import mechgraph as mg
        >>> pairs = [
        ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
        ...     for k, link, x in [("A", "p", 0), ("B", "w", 6)]
        ... ]
        >>> m = mg.Mechanism(
        ...     "gears", pairs=pairs, couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"]
        ... )
        >>> float(mg.solve(m, {"A": 1.0}, loads=[mg.Effort("B", -3)]).coupling("teeth").effort)
        0.075
        """
        found, m = couplings_of(self._values), self.mechanism
        return found[name] if name in found else CouplingResult(self._values, m.couplings.index(m.coupling(name)))

    @property
    def contacts(self) -> dict[str, ContactResult]:
        """Facts of all pairs whose elements touch at a point or along a line, by name: paths, normal forces, sliding, pressure."""
        return contacts_of(self._values)

    def contact(self, pair: str) -> ContactResult:
        """Return the facts of a contact: paths, normal force, sliding, rolling, pressure.

        Parameters
        ----------
        pair : str
            Name of a pair whose elements touch at a point or along a line.

        Returns
        -------
        ContactResult

        Raises
        ------
        DeclarationError
            The pair is not a contact.

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.solve(mg.load("r-sp-r"))
        >>> [name for name in s.contacts]
        ['B']
        >>> s.contact("B").normal_force.shape == s.batch
        True
        """
        return ContactResult(self._values, place_of_contact(self._values, pair))

    def film(self, pair: str, journal: Journal | None = None) -> FilmResult:
        """Return what the loads of a cycle do to the oil film of a journal bearing: orbit, least film, pressure, friction.

            de/dt = (c^2 / (eta R L^3)) H(e)^-1 W + (w_b - w_a) / 2 x e

        The load W on the journal is the force Fx, Fy of the pair, against its sign; the orbit is the periodic one where the positions make
        a whole cycle. The film does not act back.

        Parameters
        ----------
        pair : str
            Name of a pair that turns about z and bears Fx and Fy: link a is the bearing, link b the journal.
        journal : Journal, optional
            The film. Default: the pair's ``film=``.

        Returns
        -------
        FilmResult
            ``orbit (T, 2)`` on link a, ``film``, ``min``, ``at``, ``pressure``, ``torque``, ``power``, ``closed``.

        Raises
        ------
        DeclarationError
            No film, no forces, a load that is not unique, no times.

        Examples
        --------
        >>> import mechgraph as mg
        >>> import numpy as np
        >>> crank = mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))
        >>> m = mg.Mechanism("rotor", [mg.Link("frame"), mg.Link("crank", 1.0, (0.01, 0, 0))], [crank], ["A"])
        >>> s = mg.solve(m, {"A": mg.Motion(np.linspace(0, 2 * np.pi, 24, endpoint=False), velocity=100.0)})
        >>> film = s.film("A", mg.Journal(radius=0.02, length=0.02, clearance=2e-5, viscosity=0.02))
        >>> film.closed, film.orbit.shape
        (True, (24, 2))
        """
        found: FilmResult = methods.call("film_of", self, pair, journal)
        return found

    def load(self, index: int) -> LoadResult:
        """Return what a load does: wrenches on links, power, and the coordinate of a force law.

        Parameters
        ----------
        index : int
            Number in ``mechanism.loads``.

        Returns
        -------
        LoadResult

        Raises
        ------
        DeclarationError
            No such load.

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.solve(mg.load("four-bar"), {"A": mg.Motion([0.0, 0.5], velocity=10.0)})
        >>> s.load(0).power.shape
        (2,)
        """
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
    def losses(self) -> dict[str, Array]:
        """Power lost in the pairs with friction, by name, ``(...)``; never negative."""
        return losses(self._values)

    @property
    def split_by_stiffness(self) -> bool:
        """Whether redundant reactions are split by the stiffness of the pairs (``redundant="elastic"``)."""
        return self._values.split_by_stiffness

    @property
    def jams(self) -> dict[int, Jam]:
        """What jams, by the flat index of every position that does (status ``'jams'`` or ``'no finite force'``)."""
        stuck = np.flatnonzero(np.isin(self.status, ("jams", "no finite force")))
        return {int(i): Jam(*self._values.friction_factor(int(i))) for i in stuck}

    @property
    def self_locking(self) -> Array:
        """Whether the mechanism stays at rest with all drives off ``(...)``: effort 0 is within the range of a drive; of several, whose
        ranges hold with the others held, friction is found that holds all of them at once, or proved not to be there.

        Raises
        ------
        DeclarationError
            A position in motion, or without forces or ends: only what rests can stay. Of several drives, neither found nor proved.
        """
        places = [self.whole.freedom(name) for name in self.actuated]
        pairs = [(self[self.whole.pairs[k].name], j) for k, j in places]
        low, high = (np.array([pair.effort_range[..., j, end] for pair, j in pairs]) for end in (0, 1))
        moves = np.array([pair.velocity[..., j] != 0 for pair, j in pairs]).any(axis=0)
        alone = self._values.holds_alone if len(pairs) > 1 else np.ones(self.batch)
        doubts = (
            (moves, "is in motion; only what rests can stay: solve with positions alone as motions"),
            (self.status != OK, "has no forces, since its status is {!r}; s.warnings says why, and what gives it some"),
            (np.isnan(low + high).any(axis=0), "has no known ends of what holds it; s.warnings says why, and what gives them"),
            (np.isnan(alone), "is close: no friction is found that holds all drives at once, nor proved not to be there; ask with one "
             "drive"),
        )  # fmt: skip
        for doubt, why in doubts:
            if doubt.any():
                first = int(np.argmax(doubt))
                told = f"self_locking: {self.place(first)} {why.format(str(self.status.reshape(-1)[first]))}"
                raise DeclarationError(f"solution of {self.mechanism.name!r}", [told])
        held = ((low < high) & (low <= 0) & (high >= 0)).all(axis=0)
        return np.asarray(held if len(pairs) == 1 else alone > 0)

    def efficiency(self, out: str | Iterable[str], into: str | Iterable[str] | None = None) -> Array:
        """Return ``-power of out / power of into``, ``(...)``.

        Parameters
        ----------
        out : str or iterable of str
            Drives (``"A"``) or loads (``"loads[1]"``) that take power out of the mechanism.
        into : str or iterable of str, optional
            Those that bring it. Default: all drives.

        Returns
        -------
        (...) array
            NaN where ``into`` brings no power; 0 where ``out`` has to be driven too.

        Raises
        ------
        DeclarationError
            No such drive or load.

        Examples
        --------
        >>> import mechgraph as mg
        >>> screw = mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=(0, 0, 1), pitch=0.002)
        >>> lift = [mg.Wrench("nut", force=(0, 0, -1000), point=(0, 0, 0)), mg.Friction("A", mu=0.1, radius=0.01)]
        >>> m = mg.Mechanism("jack", pairs=[screw], drives=["A"], loads=lift)
        >>> float(mg.solve(m, {"A": mg.Motion(0.0, velocity=1.0)}).efficiency("loads[0]").round(4))
        0.6533
        """
        taken = -self._power_of(out)
        brought = self._power_of(self.actuated if into is None else into)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(brought > 0, np.maximum(taken, 0.0) / brought, np.nan)

    def _power_of(self, names: str | Iterable[str]) -> Array:
        """Power that drives and loads bring, ``(...)``."""
        total, loads = np.zeros(self.batch), [f"loads[{i}]" for i in range(len(self.mechanism.loads))]
        drives = [self.whole.freedom(name) for name in self.actuated]
        for name in (names,) if isinstance(names, str) else tuple(names):
            try:
                place = self.whole.freedom(self.whole.full_name(name)) if name not in loads else None
            except DeclarationError:
                place = (-1, -1)
            if place is None:
                total = total + self.load(loads.index(name)).power
            elif place in drives:
                pair = self[self.whole.pairs[place[0]].name]
                total = total + pair.effort[..., place[1]] * pair.velocity[..., place[1]]
            else:
                why = unknown("drive or load", name, [*self.actuated, *loads], self.whole.pair_index)
                raise DeclarationError(f"efficiency of {self.mechanism.name!r}", [why])
        return total

    @property
    def misfit_sensitivity(self) -> dict[str, dict[str, Array]]:
        """Change of a component for a misfit of one: ``s.misfit_sensitivity["A.Fz"]["B.Fz"]``, ``(...)``; ``redundant="elastic"``.

            dl / dmisfit = N (N^T C N)^-1 N^T

        Raises
        ------
        DeclarationError
            Where stiffness does not split the reactions.
        """
        return self._values.misfit_sensitivity()

    @property
    def passive_effort(self) -> dict[str, Array]:
        """What keeps passive bodies from spinning (or sliding) in space: a couple about the axis, or a force, by the report's name.

        Zero where nothing turns them; otherwise no part supplies it (see ``warnings``). The orientation of such a body depends on the
        path: from the start on it does not spin about its axis.
        """
        return self._values.passive_efforts()

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """What makes reactions doubtful: passive freedoms that carry load, contacts that would have to pull, or cut into each other; forces
        that fail the check of equilibrium or power; misfits that are left out.
        """
        v = self._values
        return *v.load_bearing(), *lift_offs(v), *overlaps(v), *self._unbalanced(), *misfits_left_out(v)

    def _unbalanced(self) -> Iterator[Unbalanced]:
        checks = self.checks
        names: tuple[Literal["equilibrium", "power"], ...] = ("equilibrium", "power")
        for check in names:
            error = np.abs(getattr(checks, check))
            if not (error > CHECKS.balanced).any():
                continue
            found = _worst(np.where(self.status == OK, error, np.nan), CHECKS.balanced)
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
    def warnings(self) -> tuple[Doubt | PassedCrossing | Inaccurate | Remark | NotSolved, ...]:
        """Positions that are not solved, why, and what would solve them; what makes reactions doubtful (``doubts``); crossings of branches
        that were passed, with place, miss and the other branches;
        rates and forces that rounding spoils (see ``checks.accuracy``); friction at rest, moments that rub nothing, friction circles
        that differ from the whole force by more than 5 %, belts that slip; angles that look like degrees.
        """
        worst = [Inaccurate(*one) for one in _worst(self.checks.accuracy, PATH.inaccurate)]
        v = self._values
        return (*not_solved(v), *self.doubts, *v.passed, *worst, *friction_notes(v), *angle_remarks(v))

    def document(self, asked: bool = False) -> Document:
        """Return what ``print`` shows as a document.

        Parameters
        ----------
        asked : bool
            Include what takes long, as ``summary`` does.

        Returns
        -------
        Document
        """
        return summary(self._values, asked)

    def summary(self) -> str:
        """Return positions, ranges of drivers and efforts, largest reactions, checks, engine and work as text.

        ``print`` leaves out what takes long at many positions of many pairs.

        Returns
        -------
        str

        Examples
        --------
        >>> import mechgraph as mg
        >>> print(mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5]}).summary().splitlines()[3])
        Solved 2 of 2 positions.
        """
        return to_text(self.document(asked=True))

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the summary, of all pairs, as plain data.

        Returns
        -------
        dict

        Examples
        --------
        >>> import mechgraph as mg
        >>> sorted(mg.solve(mg.load("four-bar"), {"A": 0.5}).to_dict())[:3]
        ['applied_efforts', 'checks', 'crossings']
        """
        return dict(plain(solution_data(self._values)))

    def to_json(self) -> str:
        """Return the contents of ``to_dict`` as JSON.

        Returns
        -------
        str
        """
        return json_text(self.to_dict())

    def view(self) -> Any:
        """Show the solution in a notebook: the mechanism in space, its forces and curves (``notebook`` extra).

        Returns
        -------
        object
            A widget.

        Raises
        ------
        MissingExtraError
            Without anywidget.
        """
        return methods.call("view", self)

    def place(self, index: int) -> str:
        """Describe a position of the flat batch: driver values, or time.

        Parameters
        ----------
        index : int
            Flat index.

        Returns
        -------
        str

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.kinematics(mg.load("four-bar"), {"A": [0.0, 0.5]}).place(1)
        'A.Rz = 28.648 deg'
        """
        return PositionLabels(self._values).full_name(
            place_among(index, self.status.size, "index", "place of a position")
        )

    def state(self, index: int | slice | tuple[int, ...] = ()) -> State:
        """Return screws, loads and coordinates at one position, for ``Formulation.assemble``.

        Parameters
        ----------
        index : int, slice or tuple
            Index of the position. Default: the only one.

        Returns
        -------
        State

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("rcsr")
        >>> A, b = mg.formulate(m).assemble(mg.solve(m, {"O1": [2.6, 2.7]}).state(1))
        >>> A.shape
        (24, 24)
        """
        return self._values.state(index)

    def part(self, places: slice) -> Solution:
        """Return the solution at a range of flat positions, without a copy; its checks stay relative to the whole batch.

        Parameters
        ----------
        places : slice
            Flat positions.

        Returns
        -------
        Solution

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.kinematics(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
        >>> s.part(slice(1, 3))["A"].position[:, 0]
        array([0.5, 1. ])
        """
        return Solution(self._values.part(places))

    # --- tables --------------------------------------------------------------------------------------------------------

    def columns(self, include: Sequence[Include] = ()) -> Mapping[str, Array]:
        """Return all numbers of the table by column name with unit, ``(...)`` each.

        Parameters
        ----------
        include : sequence of str
            Add the motion of named ``"points"``, of ``"links"`` (origin, rotation matrix, angular rates) and of mass ``"centers"``,
            what ``"loads"`` do, facts of ``"contacts"``.

        Returns
        -------
        mapping of str to array

        Examples
        --------
        >>> import mechgraph as mg
        >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5]})
        >>> list(s.columns())[:3]
        ['A.Rz [rad]', 'A.Rz velocity [rad/s]', 'A.Rz acceleration [rad/s^2]']
        """
        return {column.label: column.values for column in table_of(self._values, include)}

    def to_pandas(self, include: Sequence[Include] = ()) -> pandas.DataFrame:
        """Return a DataFrame with one row per position (``pandas`` extra).

        Parameters
        ----------
        include : sequence of str
            As in ``columns``.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingExtraError
            Without pandas.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5]}).to_pandas().shape[0]
        2
        """
        return to_pandas(self._values, include)

    def to_xarray(self, include: Sequence[Include] = ()) -> xarray.Dataset:
        """Return a Dataset over the batch axes (``xarray`` extra).

        Names are those of ``columns`` without units, which are in ``attrs["units"]``. Coordinates are times and prescribed values;
        one row of rising times is the dimension ``t``, every other last axis is ``position``.

        Parameters
        ----------
        include : sequence of str
            As in ``columns``.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        MissingExtraError
            Without xarray.

        Examples
        --------
        >>> import mechgraph as mg
        >>> d = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5]}).to_xarray()
        >>> d["B:Fx"].dims, d["B:Fx"].attrs["units"]
        (('position',), 'N')
        """
        return to_xarray(self._values, include)

    def write(self, path: str | os.PathLike[str], include: Sequence[Include] = ()) -> None:
        """Write the table to a file, atomically; the extension selects the format.

        ``.csv``; ``.nc``, the Dataset as NetCDF 4 (``netcdf`` extra; slashes and spaces in coordinate names are quoted: ``%2F``);
        ``.parquet``, the DataFrame (``parquet`` extra).

        Parameters
        ----------
        path : str or path
            The file.
        include : sequence of str
            As in ``columns``.

        Raises
        ------
        FileError
            Another extension, or the file cannot be written.
        MissingExtraError
            Without the extra of the format.

        Examples
        --------
        >>> import mechgraph as mg
        >>> import tempfile, pathlib
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder) / "table.csv"
        ...     mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5]}).write(path)
        ...     print(len(path.read_text().splitlines()))
        3
        """
        write(self._values, path, include)

    def to_csv(self, path: str | os.PathLike[str], include: Sequence[Include] = ()) -> None:
        """Write the table as CSV, atomically.

        Parameters
        ----------
        path : str or path
            The file.
        include : sequence of str
            As in ``columns``.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        to_csv(self._values, path, include)

    def __repr__(self) -> str:
        status = self.status
        solved = f"{int((status == OK).sum())} of {status.size} solved"
        return f"{type(self).__name__}({self.mechanism.name!r}, batch {self.batch}, {solved}; print it for its summary)"


def _worst(errors: Array, limit: float) -> list[tuple[float, int, int]]:
    """The greatest of errors above a limit, its flat position, and how many there are; empty where there are none."""
    flat = errors.reshape(-1)
    off = np.flatnonzero(flat > limit)
    return [(float(flat[i]), int(i), off.size) for i in off[np.argsort(-flat[off])][:1]]
