"""A link cut free: all that acts on it in balance at every position, in its own frame; worst positions, envelopes, load files."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from mechgraph.determinacy.report import check
from mechgraph.document import Bullets, Document, Heading, Paragraph, Shown, Table, plain
from mechgraph.errors import DeclarationError
from mechgraph.fields import NAMED_POINT
from mechgraph.files import Format, cell, csv_of, format_of, write_whole
from mechgraph.maths.se3 import IN_PLANE, IN_SPACE, Array
from mechgraph.memo import dataclass
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.loads import Gravity, Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Marker
from mechgraph.quantities import BASE_UNITS, FORCE, LENGTH, MOMENT, Count, Positive, door, place_among, unit_of, wrong
from mechgraph.result.solution import Solution
from mechgraph.result.values import OK, Mask, bracket, number
from mechgraph.result.views import CouplingResult

COMPONENTS = ("Mx", "My", "Mz", "Fx", "Fy", "Fz")
"""Names of the components of a wrench."""
SMALL = 1e-9
"""Part of the largest force (or moment) on a link below which one is rounding."""
At = Literal["worst", "all"] | int | slice | Sequence[int]
"""Positions: the worst ones, all, or those that an index of the flat batch picks."""


@dataclass(frozen=True, eq=False, repr=False)
class PointLoad(Shown):
    """What one thing does to the link at one point of it.

    ``kind``: ``"pair"`` (all that the pair transmits: reaction and efforts), ``"load"``, ``"inertia"`` (at the mass center), ``"hold"``
    (what keeps a passive body at rest, a load that no part supplies) or ``"support"`` (what holds the frame). ``point (3,)`` and
    ``wrench (..., 6)``, (M, F) about that point, are in the link's frame; ``unique (..., 6)`` says which numbers equilibrium alone gives:
    the others are NaN, or those of least norm where the solution has these. ``about``: in words, what it is; ``distributed``: whether it
    acts on all of the mass (weight and inertia), at whose center it stands.
    """

    name: str
    kind: str
    point: tuple[float, float, float]
    wrench: Array
    unique: Mask
    about: str
    distributed: bool = False
    known_sizes: Array | None = None
    planar: bool = False

    @property
    def sizes(self) -> Array:
        """Sizes ``(..., 2)`` of moment and force, of what is unique of them; NaN where nothing is."""
        parts = np.stack([self.moment, self.force], axis=-2)
        return np.asarray(np.linalg.norm(parts, axis=-1)) if self.known_sizes is None else self.known_sizes

    @property
    def force(self) -> Array:
        """Force ``(..., 3)``."""
        return self.wrench[..., 3:]

    @property
    def moment(self) -> Array:
        """Moment about the point ``(..., 3)``."""
        return self.wrench[..., :3]

    def document(self) -> Document:
        """Least and greatest of its components; what is not unique has none."""
        rows = []
        span = IN_PLANE if self.planar else IN_SPACE
        for name, values in zip(COMPONENTS[span], self.wrench.reshape(-1, 6).T[span], strict=True):
            known = values[np.isfinite(values)]
            rows.append(
                (name, *(number(float(v)) for v in (known.min(), known.max()))) if known.size else (name, "", "")
            )
        at = ", ".join(f"{x + 0.0:.6g}" for x in self.point[: 2 if self.planar else 3])
        about = Paragraph(f"{self.kind} at ({at}) in the frame of the link: {self.about}.")
        return Document(self.name, (about, Table(("component", "least", "greatest"), rows, "lrr")))


class Case(NamedTuple):
    """A position of the flat batch as a load case: its number, the drivers' values, and what is greatest there."""

    position: int
    place: str
    why: tuple[str, ...]


class Range(NamedTuple):
    """Least and greatest value of a component (``Fx`` ..., ``|F|``, ``|M|``) of what one thing does, and the positions where they occur.

    ``|F|`` and ``|M|`` are those of what is unique. NaN (and position -1) where the component, or all of them, is not unique at some
    position.
    """

    name: str
    component: str
    unit: str
    least: float
    at_least: int
    greatest: float
    at_greatest: int


@dataclass(frozen=True, eq=False)
class BalancedLoads:
    """All that acts on a link, ``acting``: its positions, its sum and its greatest values.

    ``acceleration (..., 9)``: of the mass center (of the frame's origin where it has none), angular velocity and angular acceleration,
    in the link's frame.
    """

    solution: Solution
    link: Link
    acting: tuple[PointLoad, ...]
    acceleration: Array

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism whose link it is."""
        return self.solution.mechanism

    def __getitem__(self, name: str) -> PointLoad:
        found = {one.name: one for one in self.acting}
        if name not in found:
            raise DeclarationError(f"loads on {self.link.name!r}", [wrong(name, "name", f"one of {', '.join(found)}")])
        return found[name]

    @cached_property
    def sum(self) -> Array:
        """Sum of all, ``(..., 6)``, (M, F) about the origin of the link's frame: zero but for rounding, NaN where not unique."""
        return np.sum([about_origin(one) for one in self.acting], axis=0)

    @property
    def balance(self) -> float:
        """The largest sum, of forces over the largest force, of moments over the largest moment or force at its arm; NaN if not unique."""
        if not self.acting:
            return 0.0
        moments, forces = (np.abs(self.sum[self._solved][..., part]) for part in (slice(0, 3), slice(3, 6)))
        force = max(float(np.abs(one.force[self._solved]).max(initial=0.0)) for one in self.acting)
        moment = max(float(np.abs(one.moment[self._solved]).max(initial=0.0)) for one in self.acting)
        arm = max(float(np.linalg.norm(one.point)) for one in self.acting)
        return max(
            float(forces.max(initial=0.0)) / (force or 1.0),
            float(moments.max(initial=0.0)) / (max(moment, arm * force) or 1.0),
        )

    @property
    def _solved(self) -> Any:
        return np.asarray(self.solution.status) == OK

    # --- positions -----------------------------------------------------------------------------------------------------

    def cases(self, at: At = "worst") -> tuple[Case, ...]:
        """Return the load cases at positions.

        Parameters
        ----------
        at : {"worst", "all"}, int or sequence of int
            Where the force or moment of something that acts is largest; all positions; or flat indices.

        Returns
        -------
        tuple of Case

        Raises
        ------
        DeclarationError
            No such position, or one that was not solved.

        Examples
        --------
        >>> import mechgraph as mg
        >>> body = mg.free_body(mg.solve(mg.load("slider-crank"), {"A": [0.0, 1.0]}), "rod")
        >>> [case.place for case in body.cases("all")]
        ['A.Rz = 0 deg', 'A.Rz = 57.296 deg']
        """
        why = self._greatest()
        places = list(why) if isinstance(at, str) and at == "worst" else self._positions(at)
        return tuple(Case(i, self.solution.place(i), tuple(why.get(i, ()))) for i in sorted(places))

    def _positions(self, at: Any) -> list[int]:
        solved = np.flatnonzero(self._solved)
        if isinstance(at, str) and at == "all":
            return solved.tolist()
        try:
            places = np.atleast_1d(np.arange(np.size(self._solved))[at]).ravel().tolist()
        except (IndexError, TypeError, ValueError):
            places = []
        missing = [i for i in places if i not in set(solved.tolist())]
        if not places or missing:
            fault = (
                f"at = {at!r}: position {missing[0]} was not solved ({np.ravel(self.solution.status)[missing[0]]})"
                if missing
                else wrong(at, "at", f"'worst', 'all', or an index of {np.size(self._solved)} positions")
            )
            raise DeclarationError(f"loads on {self.link.name!r}", [fault])
        return places

    def _greatest(self) -> dict[int, list[str]]:
        """Positions at which something is greatest that is not the same everywhere, and what; the first where everything is."""
        out: dict[int, list[str]] = {}
        for what, scale in zip(("moment", "force"), self.scales, strict=True):
            for one in self.acting:
                name, size = one.name, np.where(self._solved, one.sizes[..., int(what == "force")], np.nan).ravel()
                largest = np.nanmax(size, initial=0.0)
                if largest > SMALL * scale and largest - np.nanmin(size) > SMALL * largest:
                    out.setdefault(int(np.nanargmax(size)), []).append(f"greatest {what} of {name}")
        return out or {i: [] for i in np.flatnonzero(self._solved)[:1].tolist()}

    @cached_property
    def scales(self) -> tuple[float, float]:
        """The largest moment and force, or what either makes of the other at the largest arm: beside it what is small is rounding."""
        sizes = [one.sizes[self._solved].reshape(-1, 2) for one in self.acting]
        moment, force = np.nanmax(np.concatenate([np.zeros((1, 2)), *sizes]), axis=0).tolist()
        arm = max((float(np.linalg.norm(one.point)) for one in self.acting), default=0.0)
        return max(moment, arm * force), max(force, moment / arm if arm else 0.0)

    def envelope(self) -> tuple[Range, ...]:
        """Return the smallest and largest value of every component of all that acts, over the solved positions.

        Returns
        -------
        tuple of Range
        """
        out = []
        units = {letter: unit_of(self.mechanism.units, (2 if letter == "M" else 1, 1, -2)) for letter in "MF"}
        for one in self.acting:
            span = self.mechanism.span
            values = dict(zip(COMPONENTS[span], np.moveaxis(one.wrench, -1, 0)[span], strict=True))
            values |= {"|F|": one.sizes[..., 1], "|M|": one.sizes[..., 0]}
            for component, value in values.items():
                flat = np.ravel(value)
                known = np.where(np.ravel(self._solved), flat, np.nan)
                unique = not np.isnan(flat[np.ravel(self._solved)]).any() and known.size > 0
                low, high = (int(np.nanargmin(known)), int(np.nanargmax(known))) if unique else (-1, -1)
                ends = (float(known[low]), low, float(known[high]), high) if unique else (np.nan, -1, np.nan, -1)
                out.append(Range(one.name, component, units[component.strip("|")[0]], *ends))
        return tuple(out)

    def not_unique(self, position: int) -> dict[str, tuple[str, ...]]:
        """Return the components that equilibrium does not determine, at a position.

        Parameters
        ----------
        position : int
            Flat index.

        Returns
        -------
        dict of str to tuple of str

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.free_body(mg.solve(mg.load("slider-crank"), {"A": [0.0, 1.0]}), "rod").not_unique(0)["B"]
        ('Mx', 'My', 'Fz')
        """
        at = place_among(position, self.solution.status.size, "position", f"free body of {self.link.name!r}")
        found = {one.name: one.unique.reshape(-1, 6)[at] for one in self.acting}
        return {
            name: tuple(c for c, known in zip(COMPONENTS, unique, strict=True) if not known)
            for name, unique in found.items()
            if not unique.all()
        }


def about_origin(one: PointLoad) -> Array:
    """Its wrench about the origin of the link's frame."""
    return np.concatenate([one.moment + np.cross(np.array(one.point), one.force), one.force], axis=-1)


Path = str | os.PathLike[str]


def write_table(body: BalancedLoads, path: Path, at: Any = "worst", **options: Any) -> None:
    """Write one row for each of what acts at each position; components that are not unique are left empty unless they are of least norm,
    and are named in the last but one column.
    """
    if options:
        raise DeclarationError(f"loads on {body.link.name!r}", [f"{', '.join(options)}: for a load deck (.inp) alone"])
    length, force, moment = (bracket(unit_of(body.mechanism.units, powers)) for powers in (LENGTH, FORCE, MOMENT))
    axes, about = body.mechanism.axes, "z" if body.mechanism.planar else "xyz"
    columns = [*(f"{x}{length}" for x in axes), *(f"F{x}{force}" for x in axes), *(f"M{x}{moment}" for x in about)]
    heads = ("position", "at", "name", "kind", *columns, "not unique", "about")
    write_whole(path, [csv_of(heads, _rows(body, body.cases(at)))])


def _rows(body: BalancedLoads, cases: Sequence[Case]) -> Iterator[list[Any]]:
    planar = body.mechanism.planar
    forces, moments = (slice(3, 5), slice(2, 3)) if planar else (slice(3, 6), slice(3))
    for case in cases:
        unknown = body.not_unique(case.position)
        for one in body.acting:
            wrench = _at(one, case)
            numbers = ["" if np.isnan(v) else float(v) for v in (*wrench[forces], *wrench[moments])]
            texts = (" ".join(unknown.get(one.name, ())), cell(plain(one.about)))
            yield [
                case.position,
                cell(plain(case.place)),
                cell(plain(one.name)),
                one.kind,
                *one.point[: 2 if planar else 3],
                *numbers,
                *texts,
            ]


def _at(one: PointLoad, case: Case) -> Any:
    """Its wrench ``(6,)`` at the position of a case."""
    return one.wrench.reshape(-1, 6)[case.position]


# --- a deck for finite elements ----------------------------------------------------------------------------------------


@door
def load_deck(
    body: BalancedLoads,
    path: str | os.PathLike[str],
    at: At = "worst",
    *,
    model: str = "",
    held: str = "",
    inertia: Literal["wrench", "acceleration"] = "wrench",
    elements: str = "EALL",
    couples: Positive | None = None,
    first_node: Count = 900_001,
) -> None:
    """Write a load deck of CalculiX or Abaqus: a node at every point at which something acts, in the link's frame, and a step a position.

    Parameters
    ----------
    model : name of the file with mesh, material, sections and the couplings of these nodes to the mesh; the deck includes it between its
        nodes and its steps. Left out, a comment says where it belongs.
    held : what acts at the node at which the model holds the link: its loads are written as comments, and come out as reactions there.
    inertia : ``"wrench"``, as force and couple on a node at the mass center, or ``"acceleration"``, weight and inertia as loads of
        the elements (``GRAV``, ``CENTRIF``; their density must give the mass of the link), the couple of angular acceleration alone there;
        one position a file, as CalculiX takes the axis of ``CENTRIF`` from the first step alone.
    elements : the set of elements that these loads are for.
    couples : distance at which two opposite forces make every moment, on six further nodes around each; left out, moments act in the
        rotational freedoms 4 to 6 of the nodes. CalculiX has these at reference nodes of ``*COUPLING`` and at beams and shells; at that
        of a ``*RIGID BODY`` it drops them without a word.
    first_node : the number of the first node, beyond those of a mesh.

    Raises
    ------
    DeclarationError
        where something is not unique at a position (``redundant="minimum_norm"`` gives one set of many, and the deck says so); FileError.
    """
    names = [one.name for one in body.acting]
    faults = [] if held in ("", *names) else [wrong(held, "held", f"one of {', '.join(names)}")]
    cases = body.cases(at)
    unknown: dict[str, str] = {}
    for case in cases:
        for name, missing in body.not_unique(case.position).items():
            if np.isnan(_at(body[name], case)).any():
                unknown.setdefault(name, f"{', '.join(missing)} not unique, first at position {case.position}")
    advice = "solve with redundant='minimum_norm' for one set of many that is in balance, or change pairs as the report advises"
    faults += [f"{name}: {what}; {advice}" for name, what in unknown.items()]
    if inertia == "acceleration" and len(cases) > 1:
        faults.append(
            f"at: {len(cases)} positions: with inertia='acceleration' a deck has one, as CalculiX takes the axis of CENTRIF from the "
            f"first step alone; write a file for each of {', '.join(str(case.position) for case in cases)}"
        )
    if faults:
        raise DeclarationError(f"load deck of {body.link.name!r}", faults)
    deck = _Deck(body, cases, model, held, inertia == "acceleration", elements, couples, first_node)
    write_whole(path, (f"{line}\n" for line in deck.lines()))


@dataclass(frozen=True)
class _Deck:
    """The lines of a deck; see ``load_deck``."""

    body: BalancedLoads
    cases: Sequence[Case]
    model: str
    held: str
    accelerated: bool
    elements: str
    couples: float | None
    first_node: int

    @cached_property
    def nodes(self) -> dict[tuple[float, ...], int]:
        """The points and the numbers of their nodes; with couples six more follow each."""
        points = dict.fromkeys(one.point for one in self.body.acting)
        step = 1 if self.couples is None else 7
        return {point: self.first_node + step * i for i, point in enumerate(points)}

    def lines(self) -> Iterator[str]:
        """The deck, line by line."""
        yield from self._head()
        yield "*NODE, NSET=LOADED"
        for point, node in self.nodes.items():
            yield _line(node, *point)
            for i, arm in enumerate(() if self.couples is None else self.couples / 2 * _ARMS):
                yield _line(node + 1 + i, *(point + arm).tolist())
        if self.model:
            yield f"*INCLUDE, INPUT={self.model}"
        else:
            yield "** Here belong mesh, material, sections, and couplings of these nodes to the mesh: *INCLUDE, INPUT=..."
        for count, case in enumerate(self.cases, 1):
            yield from self._step(count, case)

    def _head(self) -> Iterator[str]:
        m = self.body.mechanism
        bases = [f"{base} {m.units[base]}" for base in BASE_UNITS if base in m.units]
        names = [f"{what} {unit_of(m.units, powers)}" for what, powers in (("force", FORCE), ("moment", MOMENT))]
        units = (
            ", ".join(bases + names)
            if len(bases) == len(BASE_UNITS)
            else "those of the declaration, which does not name all of them"
        )
        yield from _comment(
            f"Loads on link {self.body.link.name} of {m.name}, in the frame of the link; they are in balance."
        )
        yield from _comment(f"Units: {units}; steps are static.")
        if self.couples is None:
            yield from _comment(
                "Moments act in freedoms 4 to 6: couple the nodes to the mesh by *COUPLING (or to beams and shells), not by *RIGID "
                "BODY, at whose reference node CalculiX drops moments."
            )
        for one in self.body.acting:
            also = "; held by the model, its loads are comments" if one.name == self.held else ""
            yield from _comment(f"node {self.nodes[one.point]}: {one.name} ({one.kind}; {one.about}{also})")

    def _step(self, number: int, case: Case) -> Iterator[str]:
        why = f" ({'; '.join(case.why)})" if case.why else ""
        yield from _comment(f"Step {number}: position {case.position}, {case.place}{why}")
        for name, missing in self.body.not_unique(case.position).items():
            yield from _comment(
                f"NOT UNIQUE: {', '.join(missing)} of {name}. These are values of least norm, one set of many: every pair as stiff "
                "as every other, nothing strained at assembly."
            )
        yield from _comment(f"mass center: {_named(self.body, case)}")
        loads, given = self._loads(case)
        yield from ["*STEP", "*STATIC", "*CLOAD, OP=NEW"]
        yield from [_line(*load[:2], load[2]) for load in loads] or [_line(self.first_node, 1, 0.0)]
        for node, freedom, value in given:
            yield f"** held: {_line(node, freedom, value)}"
        if self.accelerated and self.body.link.mass > 0:
            yield "*DLOAD, OP=NEW"
            yield from self._body_loads(case)
        yield from ["*NODE PRINT, NSET=LOADED", "U, RF", "*NODE FILE", "U", "*EL FILE", "S", "*END STEP"]

    def _loads(self, case: Case) -> tuple[list[tuple[int, int, float]], list[tuple[int, int, float]]]:
        """Node, freedom and value of what is applied, and of what the model holds; rounding left out."""
        wrenches = [(one, self._wrench(one, case)) for one in self.body.acting]
        force, moment = (
            max((float(np.abs(w[part]).max()) for _, w in wrenches), default=0.0) for part in (slice(3, 6), slice(0, 3))
        )
        arm = max(float(np.linalg.norm(one.point)) for one in self.body.acting)
        # part of the largest force or moment of a case below which one is not written
        floor = 1e-14 * np.repeat([max(moment, arm * force), force], 3)
        applied: dict[tuple[int, int], float] = {}
        held: dict[tuple[int, int], float] = {}
        for one, wrench in wrenches:
            target = held if one.name == self.held else applied
            for k in np.flatnonzero(np.abs(wrench) > floor).tolist():
                for node, freedom, part in self._at_node(self.nodes[one.point], k, float(wrench[k])):
                    target[node, freedom] = target.get((node, freedom), 0.0) + part
        return _listed(applied), _listed(held)

    def _at_node(self, node: int, k: int, value: float) -> Iterator[tuple[int, int, float]]:
        """A component of a wrench as loads of nodes: forces in freedoms 1 to 3, moments in 4 to 6 or as couples."""
        if k >= 3:
            yield node, k - 2, value
        elif self.couples is None:
            yield node, k + 4, value
        else:  # x: forces along z at both arms along y, and so on
            arm, along = (k + 1) % 3, (k + 2) % 3
            yield node + 1 + 2 * arm, along + 1, value / self.couples
            yield node + 2 + 2 * arm, along + 1, -value / self.couples

    def _wrench(self, one: PointLoad, case: Case) -> Any:
        """What acts at a node: with accelerations of the elements only the couple of the angular acceleration is left of the inertia."""
        if not (self.accelerated and one.distributed):
            return _at(one, case)
        left = np.zeros(6)
        if one.kind == "inertia" and self.body.link.inertia is not None:
            left[:3] = -np.asarray(self.body.link.inertia) @ self.body.acceleration.reshape(-1, 9)[case.position, 6:]
        return left

    def _body_loads(self, case: Case) -> Iterator[str]:
        """Weight and inertia of the elements: ``-a + g`` everywhere, and the centrifugal part about the mass center."""
        body = self.body
        field = sum((_at(one, case)[3:] for one in body.acting if one.distributed), np.zeros(3)) / body.link.mass
        w = body.acceleration.reshape(-1, 9)[case.position, 3:6]
        size, rate = float(np.linalg.norm(field)), float(np.linalg.norm(w))
        along, axis = (field / size if size else (1.0, 0.0, 0.0)), (w / rate if rate else (1.0, 0.0, 0.0))
        yield f"{self.elements}, GRAV, {_line(size, *along)}"
        yield f"{self.elements}, CENTRIF, {_line(rate**2, *map(float, body.link.center), *axis)}"


def _listed(loads: dict[tuple[int, int], float]) -> list[tuple[int, int, float]]:
    """Loads by node and freedom, in their order."""
    return [(node, freedom, value) for (node, freedom), value in sorted(loads.items())]


_ARMS = np.kron(np.eye(3), [[1.0], [-1.0]])
"""Where the six nodes of couples stand around theirs."""


def _line(*values: float) -> str:
    """Numbers with the digits that a field of twenty characters holds."""
    return ", ".join(str(v) if isinstance(v, int) else f"{v + 0.0:.12e}" for v in values)


def _named(body: BalancedLoads, case: Case) -> str:
    """The accelerations of a case in words."""
    units = [unit_of(body.mechanism.units, powers) for powers in ((1, 0, -2), (0, 0, -1), (0, 0, -2))]
    parts = body.acceleration.reshape(-1, 3, 3)[case.position]
    words = ("acceleration", "angular velocity", "angular acceleration")
    return "; ".join(
        f"{word} ({', '.join(f'{v + 0.0:.6g}' for v in part)}) {unit}".rstrip()
        for word, part, unit in zip(words, parts, units, strict=True)
    )


def _comment(text: str) -> list[str]:
    """A text as comment lines."""
    # characters of a comment in a deck
    return [f"** {line}" for line in textwrap.wrap(plain(text), 120 - 3)]


FORMATS = (
    Format("table", (".csv",), write_table),
    Format("CalculiX or Abaqus", (".inp",), load_deck),
)
"""What the loads on a link can be written as."""


class FreeBody(BalancedLoads, Shown):
    """A link with all that acts on it, in its own frame. Returned by ``free_body``.

    Attributes
    ----------
    solution, link : Solution, Link
        Where it comes from.
    acting : tuple
        Loads with ``name``, place, force and moment.
    acceleration : (..., 6) array
        Acceleration of the link in its own frame.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("slider-crank"), {"A": [0.0, 1.0]}, redundant="minimum_norm")
    >>> bool(mg.free_body(s, "rod").balance < 1e-12)
    True
    """

    def write(self, path: str | os.PathLike[str], at: At = "worst", **options: Any) -> None:
        """Write the loads at positions to a file, atomically; the extension selects the format.

        ``.csv``: one row per acting load and position; indeterminate components are empty and named. ``.inp``: a load deck of
        CalculiX or Abaqus, one step per position.

        Parameters
        ----------
        path : str or path
            The file.
        at : {"worst", "all"}, int or sequence of int
            As in ``cases``.
        **options
            Of a load deck: ``held``, ``couples``, ``model``, ...

        Raises
        ------
        DeclarationError
            An indeterminate component would have to be written as known.
        FileError
            The file cannot be written.
        """
        format_of(path, FORMATS).write(self, path, at, **options)

    def document(self, at: At = "worst") -> Document:
        """Return what acts, with its largest force and moment, and the load cases.

        Parameters
        ----------
        at : {"worst", "all"}, int or sequence of int
            As in ``cases``.

        Returns
        -------
        Document
        """
        ranges = {(r.name, r.component): r for r in self.envelope()}
        most = dict(zip(("|F|", "|M|"), reversed(self.scales), strict=True))
        rows = []
        for one in self.acting:
            row = [one.name, one.kind, ", ".join(f"{x + 0.0:.6g}" for x in one.point[: len(self.mechanism.axes)])]
            for size, largest in most.items():
                r = ranges[one.name, size]
                row += (
                    [
                        number(r.greatest, largest),
                        self.solution.place(r.at_greatest) if r.greatest > SMALL * largest else "",
                    ]
                    if r.at_greatest >= 0
                    else ["not unique", ""]
                )
            rows.append(row)
        units = [bracket(unit_of(self.mechanism.units, powers)) for powers in (LENGTH, FORCE, MOMENT)]
        head = ("what", "kind", f"point{units[0]}", f"force{units[1]}", "at", f"moment{units[2]}", "at")
        cases = [f"{case.place}{': ' if case.why else ''}{', '.join(case.why)}" for case in self.cases(at)]
        words = "Greatest force and moment of each, in the frame of the link, moments about its point"
        found = "" if np.isnan(self.balance) else f"; the sum of all is zero to {self.balance:.0e} of the largest"
        return Document(
            f"Loads on link {self.link.name} of {self.mechanism.name}",
            (
                Paragraph(f"{words}{found}.{self._part()}"),
                Table(head, rows, "lllrlrl"),
                Heading("Positions", 2),
                Bullets(cases),
            ),
        )

    def _part(self) -> str:
        """What stands for that which is not unique."""
        if all(one.unique[self._solved].all() for one in self.acting):
            return ""
        report = check(self.mechanism)
        if report.own_forces_unique:
            return f" All that a {report.kind.name} model has is unique; what else the pairs carry is not, and is left out."
        return " Of what is not unique the part that is, at right angles to what self-stresses may add."

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.acting)
        return f"FreeBody({self.link.name!r}, {np.size(self.solution.status)} positions, {names})"


@door
def free_body(s: Solution, link: str) -> FreeBody:
    """Cut a link free: list all that acts on it, at points of it and in its own frame.

    The sum of reactions, loads, weight and inertia ``-m a``, ``-(I alpha + w x I w)`` is zero at every position. On the frame it
    includes the support.

    Parameters
    ----------
    s : Solution
        A solution with forces.
    link : str
        Name of the link.

    Returns
    -------
    FreeBody

    Raises
    ------
    DeclarationError
        Unknown link, or a solution without forces.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("slider-crank"), {"A": [0.0, 1.0]})
    >>> body = mg.free_body(s, "rod")
    >>> [one.name for one in body.acting]
    ['B', 'C', 'loads[0] gravity', 'inertia']
    """
    m, i = s.mechanism, s.mechanism.place_of_link(link)
    if not s.has_forces:
        raise DeclarationError(f"loads on {link!r}", ["the solution has no forces: use solve()"])
    one, motion = m.links[i], s.link(link)
    pose = motion.pose
    R, at = pose[..., :3, :3], pose[..., :3, 3]
    acting = []
    for pair in s.whole.pairs:
        if link in (pair.a, pair.b):
            other, marker = (pair.a, pair.markers[1]) if pair.b == link else (pair.b, pair.markers[0])
            wrench, unique = s.on_link(pair.name, link)
            about = f"{pair.type.symbol}, from {other}"
            sizes = s.sizes_on_link(pair.name, link)
            acting.append(PointLoad(pair.name, "pair", _point(marker.point), wrench, unique, about, known_sizes=sizes))

    def add(name: str, kind: str, point: Any, wrench: Array, about: str, distributed: bool = False) -> None:
        """What is known at every position, (M, F) about the global origin."""
        p = _point(point)
        moment = wrench[..., :3] - np.cross(at + R @ np.array(p), wrench[..., 3:])
        local = np.concatenate([_turned_back(R, v) for v in (moment, wrench[..., 3:])], axis=-1)
        acting.append(PointLoad(name, kind, p, local, np.isfinite(local), about, distributed))

    for c in m.couplings:
        for link_of, marker, sign in _gears(m, c):
            if link_of == link:
                mesh = s.coupling(c.name)
                assert isinstance(mesh, CouplingResult)
                moment = mesh.moment + np.cross(mesh.point, mesh.force)
                wrench = sign * np.concatenate([moment, mesh.force], axis=-1)
                add(c.name, "contact", marker.point, wrench, "force of the other gear, about the middle of this one")
    for place, load in enumerate(m.loads):
        found = s.load(place).wrenches
        if load.in_freedom is None and link in found:
            about = load.where.removesuffix(": ")
            add(f"loads[{place}] {load.kind}", "load", _place(load, one), found[link], about, isinstance(load, Gravity))
    hold = motion.hold
    if np.nan_to_num(hold).any():
        add("hold", "hold", one.center, hold, "keeps the passive body at rest; no part supplies it")
    wrench, acceleration = _inertia(one, s, R)
    if one.mass > 0:
        about = "minus mass times acceleration, of all of it"
        acting.append(PointLoad("inertia", "inertia", _point(one.center), wrench, _every(wrench), about, True))
    if link == m.frame:
        add("support", "support", None, -s.shaking, "what holds the frame, at the origin of its frame")
    return FreeBody(s, one, tuple(replace(load, planar=m.planar) for load in acting), acceleration)


def _gears(m: Mechanism, c: BaseCoupling) -> Iterator[tuple[str, Marker, float]]:
    """Both gears of a coupling that has them: the link, its marker on the carrier, and the sign with which the force acts on it."""
    for step, sense, sign in ((c.steps[0], -1.0, -1.0), (c.steps[-1], 1.0, 1.0)) if c.steps else ():
        pair, at_b = m.pairs[step.pair], step.sense * sense > 0
        yield (pair.b if at_b else pair.a), pair.markers[int(at_b)], sign


def _inertia(link: Link, s: Solution, R: Array) -> tuple[Array, Array]:
    """The inertia wrench about the mass center and the accelerations (see ``FreeBody``), in the link's frame."""
    motion = s.link(link.name)
    point = motion.point(_point(link.center))
    a, w, alpha = (
        _turned_back(R, v) for v in (point.acceleration, motion.angular_velocity, motion.angular_acceleration)
    )
    inertia = np.zeros((3, 3)) if link.inertia is None else np.asarray(link.inertia, dtype=float)
    moment = -(alpha @ inertia.T + np.cross(w, w @ inertia.T))
    return np.concatenate([moment, -link.mass * a], axis=-1), np.concatenate([a, w, alpha], axis=-1)


def _every(wrench: Array) -> Mask:
    """All components are unique."""
    return np.ones(wrench.shape, dtype=np.bool_)


def _turned_back(R: Array, v: Array) -> Array:
    """``R^T v`` for ``(..., 3, 3)`` and ``(..., 3)``."""
    return np.asarray(np.einsum("...ji,...j->...i", R, v))


def _point(p: Any) -> tuple[float, float, float]:
    """A point of a link; the origin of its frame where there is none."""
    x, y, z = (0.0, 0.0, 0.0) if p is None else map(float, p)
    return x, y, z


def _place(load: Load, link: Link) -> Any:
    """The point of a link at which a load acts: the one that it names, else the mass center."""
    for name, about in load.formats.items():
        point = getattr(load, name)
        if about.kind is NAMED_POINT and point is not None and getattr(load, about.of) == link.name:
            return link.point(point) if isinstance(point, str) else point
    return link.center
