"""A mechanism in the tables of the kernel, its numbers by the names that studies use, and what comes back in the user's units."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mechgraph.determinacy.snapping import meant
from mechgraph.errors import DeclarationError, FileError, listed, visible
from mechgraph.files import writable, write_whole
from mechgraph.kernel.compiler import INCLUDED
from mechgraph.kernel.tables import (
    EFFORT,
    HEAD_LOAD_NUMBERS,
    HEAD_LOADS,
    HEAD_RUBS,
    Integers,
    Layout,
    layout,
    tables,
    why_no_line,
    why_not_load,
)
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinematics.system import System
from mechgraph.kinetostatics import Pipeline
from mechgraph.maths.se3 import Array, homogeneous
from mechgraph.memo import dataclass
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Declared, declared
from mechgraph.outcome import Options, cannot
from mechgraph.quantities import shown, unit_of, wrong
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
    (
        "FRICTION",
        "friction not solved",
        "friction jams here, has no finite force, none that is surely the only one, or none that settles",
    ),
    ("FLANKS", "flanks not settled", "flanks on which gears that are redundant press are not found"),
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


def tabled(m: Mechanism) -> Tabled:
    """The tables of a mechanism at its declared position.

    Raises
    ------
    DeclarationError
        which names what the kernel cannot carry; errors of the start as in ``solve``.
    """
    subject = f"compile {m.name!r}"
    own = meant(m, None, "compile")
    drives = tuple(own.full_name(drive.freedom) for drive in own.drives)
    if not drives or not own.has_geometry:
        missing = "geometry" if drives else "drives: expected the freedoms that are driven, e.g. drives=['A']"
        raise DeclarationError(subject, [f"the mechanism declares no {missing}"])
    start = closed_start(own)
    coordinates = start.system.coordinates_of(start.x, start.system.start_coordinates(own.start))[:, 0]
    home = coordinates[[own.freedom_names().index(name) for name in drives]]
    line = Pipeline(DriverMotion(own, dict(zip(drives, home.tolist(), strict=True))), Options())
    system, x = line.system, line.x
    if fault := cannot(line):
        raise DeclarationError(subject, [f"the compiled kernel does not carry it: {fault}"])
    places = layout(system, line.columns, line.passive)
    found = tables(places, system, x[:, None], own.loads)
    if found is None:
        fault = "; ".join(filter(None, (why_no_line(system), *(why_not_load(load, own) for load in own.loads))))
        raise DeclarationError(subject, [f"the compiled kernel does not carry it: {fault}"])
    I, P = found
    return Tabled(own, system, x, places, I, P[0], drives, home)


def _one_by_one(variants: Variants) -> bool:
    """Whether each variant has to be declared by itself."""
    return bool(variants.missing) or any(field.one_by_one for field, _ in variants.own)


IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
"""Names that symbols of C begin with; none of them is reserved, as something follows."""
FILE_NAME = re.compile(r"[\w.+-]+", re.ASCII)
"""Names of files that stand in an #include."""
COLUMNS = 120
"""Width of the lines of numbers."""
PATHS = re.compile(r"(?:/\*(?:(?!\*/).)*\*/\n)?^int mgk_path\([^;{]*(?:;\n|\{.*?^\}\n)", re.DOTALL | re.MULTILINE)
"""What only the package calls, with the comment before it."""


def write_c(tables: Tabled, path: str | os.PathLike[str], name: str | None = None) -> None:
    """Write ``path`` and the header beside it, symbols beginning with ``name`` (left out: the name of the file).

    Raises
    ------
    DeclarationError
        where ``name`` is no identifier of C; FileError where a file cannot be written.
    """
    file = Path(path)
    name = identifier(file.stem if name is None else name)
    header = file.with_suffix(".h")
    if not FILE_NAME.fullmatch(header.name):
        raise FileError(
            path,
            f"cannot be written: {header.name!r} cannot stand in an #include; use letters, digits, '_', '.', '+' and '-'",
        )
    writable(file)
    write_whole(header, [header_text(tables, name)])
    write_whole(file, [source_text(tables, name, header.name)])


def identifier(name: object) -> str:
    """A name that symbols of C may begin with.

    Raises
    ------
    DeclarationError
        where it is none.
    """
    if not isinstance(name, str) or not IDENTIFIER.fullmatch(name):
        raise DeclarationError(
            "write", [wrong(name, "name", "an identifier of C: a letter, then letters, digits and '_', at most 40")]
        )
    return name


def in_comment(text: str) -> str:
    """A text that ends no comment and begins none, on one line."""
    shown = visible(text).replace("\n", "\\n").replace("\t", "\\t").replace("??", "? ?")
    while "*/" in shown or "/*" in shown:
        shown = shown.replace("*/", "* /").replace("/*", "/ *")
    return shown


def header_text(tables: Tabled, name: str) -> str:
    """The header: places of everything in the arrays, statuses and three functions."""
    m, NAME = tables.m, name.upper()
    length, angle = unit_of(m.units, (1, 0, 0)), "rad"
    freedoms = m.freedom_names()

    def places(what: str, items: Iterable[str]) -> str:
        lines = [f"  {NAME}_{what}_{i} = {i}, /* {in_comment(text)} */\n" for i, text in enumerate(items)]
        return f"enum {{\n{''.join(lines)}  {NAME}_{what}S = {len(lines)}\n}};\n"

    def freedom(full: str) -> str:
        return f"{full}{_unit(angle if m.turns(full) else length)}"

    drives = [
        f"{freedom(full)}, effort{_unit(unit_of(m.units, (2 if m.turns(full) else 1, 1, -2)))}"
        for full in tables.drives
    ]
    pairs = [f"{p.name}: {p.type.symbol}, of {p.a} on {p.b}" for p in m.pairs]
    wrench = ", ".join(f"{what}{_unit(unit_of(m.units, (power, 1, -2)))}" for what, power in (("M", 2), ("F", 1)))
    statuses = "".join(f"  {NAME}_{key} = {i}, /* {meaning} */\n" for i, (key, _, meaning) in enumerate(STATUSES))
    return f"""/* Mechanism {in_comment(m.name)}: positions, efforts of the drives and reactions.
 *
 * No heap, no globals, re-entrant. Give every use a memory of {name}_state_size() bytes, aligned as malloc does; begin with {name}_start.
 */
#ifndef {NAME}_H
#define {NAME}_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {{
#endif

/* Drives: places in q, v, a and effort. */
{places("DRIVE", drives)}
/* Pairs: places of six numbers each in reaction, ({wrench}) about the global origin. */
{places("PAIR", pairs)}
/* Freedoms: places in position. */
{places("FREEDOM", map(freedom, freedoms))}
/* What {name}_solve returns. */
enum {{
{statuses}  {NAME}_STATUSES = {len(STATUSES)}
}};

/* Bytes of the memory that the other functions ask for. */
size_t {name}_state_size(void);

/* Begin at the declared position{", at rest" * tables.efforts}. */
void {name}_start(void *state);

/* One position, led on from the last good one along a straight line of the drives q with certified steps, at rates v and a (drives each).
 * effort[drives], reaction[pairs][6] of link a on link b, position[freedoms]; any of them may be NULL. What is not unique is NaN. Unless
 * {NAME}_OK is returned nothing is written and the state stays at the last good position.{_at_rest(tables)} */
int {name}_solve(void *state, const double *q, const double *v, const double *a, double *effort, double *reaction, double *position);
{_steps(name) if tables.efforts else ""}
#ifdef __cplusplus
}}
#endif
#endif
"""


def _at_rest(tables: Tabled) -> str:
    """What the header says of friction."""
    return "\n * Where nothing moves dry friction has no direction: efforts are those without it." * bool(
        tables.I[HEAD_RUBS]
    )


def _steps(name: str) -> str:
    """What the header says of motion under efforts."""
    relative, absolute = re.findall(r"(?:RELATIVE|ABSOLUTE) = ([^,;]+)", INCLUDED[-1].read_text(encoding="utf-8"))
    return f"""
/* Begin at the declared position with rates v of the drives. Returns as {name}_solve does. */
int {name}_begin(void *state, const double *v);

/* The motion that efforts of the drives produce, held for a time from the last state on, beside the loads of the mechanism; a time of 0
 * gives what is at the last state. Integrated by the method of Dormand and Prince, the error of every step within
 * {relative} of a coordinate or rate plus {absolute} (radians, or lengths over the unit of the tables, and their rates).
 * position[freedoms], velocity[freedoms] (of a rotation the angular velocity), reaction[pairs][6] as of {name}_solve, with these efforts as
 * loads; any of them may be NULL. Unless {name.upper()}_OK is returned nothing is written and the state stays. */
int {name}_step(void *state, double time, const double *effort, double *position, double *velocity, double *reaction);
"""


def source_text(tables: Tabled, name: str, header: str) -> str:
    """The source: tables as constants, the kernel with all its functions static, and what the header declares."""
    m = tables.m
    kernel, declarations, motion = (PATHS.sub("", file.read_text(encoding="utf-8")) for file in INCLUDED)
    kernel = re.sub(r"#endif\n$", "", kernel) + motion * tables.efforts
    declarations = re.sub(r"^#(?:ifndef|endif|include|define MECHGRAPH).*\n", "", declarations, flags=re.MULTILINE)
    kernel = re.sub(r'^#(?:include "kernel.h"|ifndef MGK_COMPLEX|endif)\n', "", kernel, flags=re.MULTILINE)
    both = re.sub(r"^(int|size_t) mgk_", r"static \1 mgk_", f"{declarations}\n{kernel}", flags=re.MULTILINE)
    own = {"mgk": f"{name}_kernel", "MGK": f"{name.upper()}_KERNEL"}
    both = re.sub("mgk(?=_)|MGK(?=_)", lambda found: own[found[0]], both)
    begin, steps = f"{name}_kernel_start(MECHANISM, NUMBERS, state);", ""
    if tables.efforts:
        begin = f"{name}_kernel_motion_start(MECHANISM, NUMBERS, state, NULL);"
        steps = f"""
int {name}_begin(void *state, const double *v) {{ return {name}_kernel_motion_start(MECHANISM, NUMBERS, state, v); }}

int {name}_step(void *state, double time, const double *effort, double *position, double *velocity, double *reaction) {{
  return {name}_kernel_advance(MECHANISM, NUMBERS, state, time, effort, position, velocity, reaction);
}}
"""
    home = ", ".join(f"{full} = {value!r}" for full, value in zip(tables.drives, tables.home.tolist(), strict=True))
    return f"""/* Mechanism {in_comment(m.name)}, written by mechgraph {version("mechgraph")}: see {header}.
 *
 * Tables of the mechanism (the end of this file), and the kernel that evaluates them. Declared position: {in_comment(home)}.
 */
#include "{header}"

{both}
/* --- the mechanism ----------------------------------------------------------------------------------------------------------------- */

static const int MECHANISM[] = {{
{"".join(_whole_numbers(tables))}}};

/* L is the unit of length, in the unit of length of the mechanism; see the beginning. */
static const double NUMBERS[] = {{
{"".join(_numbers(tables))}}};

size_t {name}_state_size(void) {{ return {name}_kernel_{"motion" if tables.efforts else "state"}_size(MECHANISM); }}

void {name}_start(void *state) {{ {begin} }}

int {name}_solve(void *state, const double *q, const double *v, const double *a, double *effort, double *reaction, double *position) {{
  return {name}_kernel_solve(MECHANISM, NUMBERS, state, q, v, a, effort, reaction, position);
}}
{steps}"""


def _unit(text: str) -> str:
    return f" [{in_comment(text)}]" if text else ""


def _whole_numbers(tables: Tabled) -> Iterator[str]:
    """The table of what the mechanism is made of, part by part as the comment of the kernel says."""
    known = tables.I.tolist()
    pairs, factors, columns, _, loops, steps, couplings, terms, drives, unknowns, loads = known[2:13]
    passives, moved, *_, lines, line_steps, belts, spans = known[16 : len(COUNTS)]
    parts = [
        ("counts", len(COUNTS)), ("first factor of every pair", pairs + 1), ("kinds of factors", factors),
        ("their first columns", factors + 1),
        ("their first state numbers", factors), ("their places among the factor numbers", factors),
        ("links a and b of pairs", 2 * pairs),        ("tree: pair, from a to b, parent, child", 4 * (pairs - loops)),
        ("chords", loops), ("loops: first steps", loops + 1),
        ("pairs of the steps", steps), ("their signs", steps), ("freedoms: pairs", columns), ("state numbers", columns),
        ("slides", columns),        ("places among the unknowns", columns), ("factors before their efforts", columns),
        ("efforts at marker B", columns),
        ("pairs with efforts made dual", pairs), ("drives", drives), ("unknown freedoms", unknowns),
        ("couplings: first terms", couplings + 1),        ("freedoms of the terms", terms),
        ("passive motions: first links", passives + 1), ("links that they move as one", moved), ("turns", passives),
        ("couplings along lines, links on which these stand still", 2 * lines), ("their first steps", lines + 1),
        ("pairs on the way, senses", 2 * line_steps), ("belts with a pretension: first spans", belts + 1),
        ("couplings of these", spans), ("loads", 4 * loads),
    ]  # fmt: skip
    assert sum(count for _, count in parts) == len(known)
    at = 0
    for title, count in parts:
        yield from _lines(title, known[at : at + count])
        at += count


def _numbers(tables: Tabled) -> Iterator[str]:
    """The numbers of the mechanism, with the names of what they belong to."""
    m, P, known = tables.m, tables.P.tolist(), dict(zip(COUNTS, tables.I[: len(COUNTS)].tolist(), strict=True))
    pairs, links, freedoms = (
        [in_comment(name) for name in names] for names in (m.pair_index, m.link_names(), m.freedom_names())
    )
    parts: list[tuple[str, Sequence[str], int]] = [
        (f"L{_unit(unit_of(m.units, (1, 0, 0)))}", (), 1), (f"origin{_unit(unit_of(m.units, (1, 0, 0)))}", (), 3),
        ("start", (), known["states"]), ("coordinates of the start", (), len(freedoms)), ("pose of the frame", (), 12),
        ("marker on a, over L", pairs, 12), ("marker on b, over L", pairs, 12),
        ("pitches (over L) and poses of factors", (), known["factor numbers"]),
        ("unit effort", freedoms, 6), (f"mass{_unit(unit_of(m.units, (0, 1, 0)))}", links, 1), ("mass center, over L", links, 3),
        ("inertia about it, over L^2: xx yy zz xy xz yz", links, 6), ("frame of the link, over L", links, 12),
        ("rates of the passive motions at the start", (), known["passive motions"] * len(freedoms)),
        ("coefficients of couplings", (), known["terms"]), ("their constants", (), known["couplings"]),
        ("unit wrenches of couplings along lines, on either flank", (), 12 * known["couplings along lines"]),
        ("belts with a pretension: parts of their spans", (), known["spans of these"]),
        ("pretensions", (), known["belts with a pretension"]),
        ("loads", (), known["load numbers"]),
    ]  # fmt: skip
    assert sum(max(1, len(names)) * count for _, names, count in parts) == len(P)
    at = 0
    for title, names, count in parts:
        for name in [f"{title}: {name}" for name in names] or [title]:
            yield from _lines(name, P[at : at + count])
            at += count


COUNTS = (
    "format", "links", "pairs", "factors", "columns", "states", "loops", "steps", "couplings", "terms", "drives", "unknowns", "loads",
    "frame", "factor numbers", "load numbers", "passive motions", "links in them", "first component of loops", "rows of a loop",
    "places that rub", "couplings along lines", "pairs on their ways", "belts with a pretension", "spans of these",
)  # fmt: skip
"""What stands at the head of the table."""


def _lines(title: str, values: Sequence[float]) -> Iterator[str]:
    """Numbers below a comment; nothing where there are none."""
    if not values:
        return
    yield f"  /* {title} */\n"
    line = " "
    for text in (f" {value!r}," for value in values):
        if len(line) + len(text) > COLUMNS:
            yield f"{line}\n"
            line = " "
        line += text
    yield f"{line}\n"
