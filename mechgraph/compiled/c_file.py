"""A mechanism as one C99 file and its header: the kernel's source with the tables as constants, for controllers and other programs."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from mechgraph.compiled.tabled import STATUSES, Tabled
from mechgraph.errors import DeclarationError, FileError, visible
from mechgraph.files import writable, write_whole
from mechgraph.kernel.compiler import INCLUDED
from mechgraph.quantities import unit_of, wrong

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
 * {NAME}_OK is returned nothing is written and the state stays at the last good position. */
int {name}_solve(void *state, const double *q, const double *v, const double *a, double *effort, double *reaction, double *position);
{_steps(name) if tables.efforts else ""}
#ifdef __cplusplus
}}
#endif
#endif
"""


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
    passives, moved = known[len(COUNTS) - 2 : len(COUNTS)]
    parts = [
        ("counts", len(COUNTS)), ("first factor of every pair", pairs + 1), ("kinds of factors", factors), ("their first columns", factors),
        ("their first state numbers", factors), ("their places among the factor numbers", factors),
        ("links a and b of pairs", 2 * pairs),        ("tree: pair, from a to b, parent, child", 4 * (pairs - loops)),
        ("chords", loops), ("loops: first steps", loops + 1),
        ("pairs of the steps", steps), ("their signs", steps), ("freedoms: pairs", columns), ("state numbers", columns),
        ("slides", columns),        ("places among the unknowns", columns), ("factors before their efforts", columns),
        ("efforts at marker B", columns),
        ("pairs with efforts made dual", pairs), ("drives", drives), ("unknown freedoms", unknowns),
        ("couplings: first terms", couplings + 1),        ("freedoms of the terms", terms),
        ("passive motions: first links", passives + 1), ("links that they move as one", moved), ("turns", passives), ("loads", 4 * loads),
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
    "frame", "factor numbers", "load numbers", "passive motions", "links in them",
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
