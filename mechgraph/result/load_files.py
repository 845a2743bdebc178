"""The loads on a link as files: a table as CSV, and a load deck of CalculiX or Abaqus. A new format is a row of ``FORMATS``."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from mechgraph.arguments import Count, Positive, door
from mechgraph.document.tree import plain
from mechgraph.errors import DeclarationError
from mechgraph.quantities import wrong
from mechgraph.result.balanced_loads import At, BalancedLoads, Case, PointLoad
from mechgraph.result.numbers import bracket
from mechgraph.units import BASE_UNITS, FORCE, LENGTH, MOMENT, unit_of
from mechgraph.writing import Format, cell, csv_of, write_whole

FIRST_NODE = 900_001
"""Number of the first node of a deck: beyond those of a mesh."""
LONGEST_LINE = 120
"""Characters of a comment in a deck."""
Path = str | os.PathLike[str]


def write_table(body: BalancedLoads, path: Path, at: Any = "worst", **options: Any) -> None:
    """Write one row for each of what acts at each position; components that are not unique are left empty unless they are of least norm,
    and are named in the last but one column.
    """
    if options:
        raise DeclarationError(f"loads on {body.link.name!r}", [f"{', '.join(options)}: for a load deck (.inp) alone"])
    length, force, moment = (bracket(unit_of(body.mechanism.units, powers)) for powers in (LENGTH, FORCE, MOMENT))
    columns = [*(f"{x}{length}" for x in "xyz"), *(f"F{x}{force}" for x in "xyz"), *(f"M{x}{moment}" for x in "xyz")]
    heads = ("position", "at", "name", "kind", *columns, "not unique", "about")
    write_whole(path, [csv_of(heads, _rows(body, body.cases(at)))])


def _rows(body: BalancedLoads, cases: Sequence[Case]) -> Iterator[list[Any]]:
    for case in cases:
        unknown = body.not_unique(case.position)
        for one in body.acting:
            wrench = _at(one, case)
            numbers = ["" if np.isnan(v) else float(v) for v in (*wrench[3:], *wrench[:3])]
            texts = (" ".join(unknown.get(one.name, ())), cell(plain(one.about)))
            yield [
                case.position,
                cell(plain(case.place)),
                cell(plain(one.name)),
                one.kind,
                *one.point,
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
    first_node: Count = FIRST_NODE,
) -> None:
    """Write a load deck of CalculiX or Abaqus: a node at every point at which something acts, in the link's frame, and a step a position.

    Parameters
    ----------
    model : name of the file with mesh, material, sections and the couplings of these nodes to the mesh; the deck includes it between its
        nodes and its steps. Left out, a comment says where it belongs.
    held : what acts at the node at which the model holds the link: its loads are written as comments, and come out as reactions there.
    inertia : ``"wrench"``, as force and couple on a node at the mass centre, or ``"acceleration"``, weight and inertia as loads of
        the elements (``GRAV``, ``CENTRIF``; their density must give the mass of the link), the couple of angular acceleration alone there;
        one position a file, as CalculiX takes the axis of ``CENTRIF`` from the first step alone.
    elements : the set of elements that these loads are for.
    couples : distance at which two opposite forces make every moment, on six further nodes around each; left out, moments act in the
        rotational freedoms 4 to 6 of the nodes. CalculiX has these at reference nodes of ``*COUPLING`` and at beams and shells; at that
        of a ``*RIGID BODY`` it drops them without a word.
    first_node : the number of the first node.

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
        for point, number in self.nodes.items():
            yield _line(number, *point)
            for i, arm in enumerate(() if self.couples is None else self.couples / 2 * _ARMS):
                yield _line(number + 1 + i, *(point + arm).tolist())
        if self.model:
            yield f"*INCLUDE, INPUT={self.model}"
        else:
            yield "** Here belong mesh, material, sections, and couplings of these nodes to the mesh: *INCLUDE, INPUT=..."
        for number, case in enumerate(self.cases, 1):
            yield from self._step(number, case)

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
        yield from _comment(f"mass centre: {_named(self.body, case)}")
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
        floor = NOT_WRITTEN * np.repeat([max(moment, arm * force), force], 3)
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
        """Weight and inertia of the elements: ``-a + g`` everywhere, and the centrifugal part about the mass centre."""
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
NOT_WRITTEN = 1e-14
"""Part of the largest force or moment of a case below which one is not written."""


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
    return [f"** {line}" for line in textwrap.wrap(plain(text), LONGEST_LINE - 3)]


FORMATS = (
    Format("table", (".csv",), write_table),
    Format("CalculiX or Abaqus", (".inp",), load_deck),
)
"""What the loads on a link can be written as."""
