"""The tables of a mechanism file: what each may hold, gathered from the dataclasses that say it; for editors as JSON Schema.

Said here is only what is in no dataclass: the pieces of a pair type, a chain, a sweep, the units, the number of the format.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any
from urllib.parse import quote

from mechgraph.fields import FLAG, INTEGER, NUMBERS, OTHER, SIX, TABLE, TABLES, TEXT, FieldFormat, Formatted, Schema
from mechgraph.model.belts import BeltDrive
from mechgraph.model.couplings import BaseCoupling, Coupling
from mechgraph.model.friction import LOADS
from mechgraph.model.gears import GEARS
from mechgraph.model.loads import ForceTable
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Mesh
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Link, Marker, Misfit, Pair, Stiffness
from mechgraph.model.setups import Event, ResponseSetup, Stop, SynthesisSetup, SynthesisTask
from mechgraph.model.short_forms import Belt, BevelGears, Rack, SpurGears, WormGear
from mechgraph.pairs.cam_laws import CamLaw, Segment
from mechgraph.pairs.contact_types import Hertz
from mechgraph.pairs.factors import Bookkeeping, Component, Freedom
from mechgraph.pairs.given import CURVES, Function
from mechgraph.pairs.journal import Journal
from mechgraph.pairs.pair_type import PairType
from mechgraph.pairs.surfaces import SURFACES, ByFunction
from mechgraph.quantities import BASE_UNITS, LENGTH

WRITABLE = {kind: curve for kind, curve in CURVES.items() if curve is not Function}
"""Curves that a file can hold."""
WRITABLE_SURFACES = {kind: surface for kind, surface in SURFACES.items() if surface is not ByFunction}
"""The same of surfaces."""
EVERY_COUPLING: dict[str, type[BaseCoupling]] = {
    one.kind: one for one in (Coupling, SpurGears, BevelGears, WormGear, Rack, Belt, Mesh, BeltDrive)
}
"""Couplings by the names of their kinds."""
KINDS: dict[str, Mapping[str, Any]] = {
    "load": LOADS,
    "coupling": EVERY_COUPLING,
    "gear": GEARS,
    "curve": WRITABLE,
    "surface": WRITABLE_SURFACES,
}
"""Tables of which the field ``kind`` says what stands in them: its values, and the classes."""
USUAL = {"coupling": "linear"}
"""What is meant where ``kind`` is left out."""
SCHEMA = 2
"""Number of the file format; a file that holds nothing that came with it has the number 1."""
OF_SCHEMA_2 = frozenset({"planar", "gear", "synthesis", "segment", "barrel", "globoid", "friction"})
"""Tables, fields and kinds that came with schema 2."""
DEGREES = "_deg"
"""Ending of the name of an angle that is given in degrees."""


class FileTable:
    """One table of the format: ``make`` builds its object, ``fields`` by their names in files, ``needed`` must be there.

    The fields are those that only the file has (``first``), those that the class describes, and ``more``. ``attributes`` are the names of
    the fields in the object, ``defaults`` what a field left out counts as, ``rules`` more of its schema.
    """

    def __init__(
        self,
        make: Any,
        first: Mapping[str, FieldFormat] | None = None,
        *,
        words: str = "",
        needed: Sequence[str] | None = None,
        rules: Schema | None = None,
        **more: FieldFormat,
    ) -> None:
        self.make, self.rules = make, rules or {}
        self._first, self._more, self._words, self._needed = first or {}, more, words, needed

    @property
    def words(self) -> str:
        """What it is, in a sentence."""
        return self._words or (self.make.__doc__ or "").partition("\n")[0].replace("``", "")

    @cached_property
    def _own(self) -> Mapping[str, FieldFormat]:
        return self.make.formats if inspect.isclass(self.make) and issubclass(self.make, Formatted) else {}

    @cached_property
    def attributes(self) -> Mapping[str, str]:
        """Names of fields in files -> in the object."""
        return {about.key or name: name for name, about in self._own.items()}

    @cached_property
    def fields(self) -> Mapping[str, FieldFormat]:
        """What each field holds, by its name in files."""
        return {**self._first, **{key: self._own[name] for key, name in self.attributes.items()}, **self._more}

    @cached_property
    def defaults(self) -> Mapping[str, Any]:
        """What a field that is left out counts as."""
        taken = inspect.signature(self.make).parameters if self.make is not None else {}
        names = {key: self.attributes.get(key, key) for key in self.fields}
        return {key: taken[name].default for key, name in names.items() if name in taken}

    @cached_property
    def needed(self) -> tuple[str, ...]:
        """Fields that must be there."""
        empty = [key for key, value in self.defaults.items() if value is inspect.Parameter.empty]
        return tuple(empty if self._needed is None else self._needed)

    @property
    def in_degrees(self) -> Mapping[str, str]:
        """Names of angles given in degrees -> names of the fields."""
        return {name + DEGREES: name for name, about in self.fields.items() if about.degrees}


def _one_of(how: str, *names: str) -> Schema:
    return {how: [{"required": [name]} for name in names]}


def _named_or(table: str) -> Schema:
    """JSON Schema of a list of names and tables."""
    name = {"description": "A name.", "type": "string", "minLength": 1}
    return {"type": "array", "items": {"anyOf": [name, {"$ref": f"#/$defs/{table}"}]}}


_SWEEP = OTHER(
    "[first, end, step]: first, first + step, ... before the end, which is excluded even where rounding would let it in",
    LENGTH,
    degrees=True,
    rules={"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
)
_PITCHES = {
    "anyOf": [{"type": "number"}, NUMBERS.schema, {"type": "object", "additionalProperties": {"type": "number"}}]
}
_FILE = {
    "schema": INTEGER("number of the format, 1 or 2", default="needed", rules={"enum": [*range(1, SCHEMA + 1)]}),
    "pair_type": TABLES("pair types of your own", table="pair_type", default="none"),
    "chain": TABLE("a single loop by numbers; excludes `[[pair]]`", table="chain"),
}
_PER_PITCH = SIX("part multiplied by the pitch of the pair", default="0")

TABLES_OF_FILE: dict[str, FileTable] = {
    "file": FileTable(
        Mechanism,
        _FILE,
        needed=("schema", "name"),
        words="A mechanism file of mechgraph (TOML), schema numbers 1 and 2. Described field by field in README.md beside this file.",
        rules={"not": {"required": ["chain", "pair"]}},
    ),
    "units": FileTable(
        None,
        words="Names of the units in which the numbers of the file are given; a consistent set.",
        first={name: TEXT(f"name of the unit of {name}") for name in BASE_UNITS},
        needed=(),
    ),
    "link": FileTable(Link),
    "pair": FileTable(Pair, words="A kinematic pair from link a to link b."),
    "marker": FileTable(Marker, words="A marker frame in a link's own frame."),
    "hertz": FileTable(Hertz, words="What the pressure in a contact takes: materials and shapes of its elements."),
    "stiffness": FileTable(Stiffness, words="Stiffness of a pair by its reaction components."),
    "misfit": FileTable(Misfit, words="Misfit of the seat of a pair by its reaction components."),
    "film": FileTable(Journal, words="The oil film of a journal bearing."),
    "cam_law": FileTable(CamLaw),
    "segment": FileTable(Segment, needed=("law",)),
    **{f"curve {kind}": FileTable(curve) for kind, curve in WRITABLE.items()},
    **{f"surface {kind}": FileTable(surface) for kind, surface in WRITABLE_SURFACES.items()},
    **{f"coupling {kind}": FileTable(coupling) for kind, coupling in EVERY_COUPLING.items()},
    **{f"gear {kind}": FileTable(gear) for kind, gear in GEARS.items()},
    "chain": FileTable(
        None,
        words="A single closed loop: prod_k D_k(q_k) Tz(offset_k) Tx(length_k) Rx(twist_k) = 1.",
        needed=("pairs",),
        pairs=TEXT('symbols in a row: `"RCSR"`, `"RSgC"`; hyphens are skipped'),
        twist=NUMBERS("of the link after pair k", degrees=True, default="0, if another is given"),
        length=NUMBERS("likewise", LENGTH, default="0"),
        offset=NUMBERS("along the axis of pair k", LENGTH, default="0"),
        pitch=OTHER("of the helical pairs, in order or by name", LENGTH, rules=_PITCHES),
    ),
    "drive": FileTable(Drive),
    "motion": FileTable(
        Motion,
        words="Motion of a drive, one value a position.",
        needed=(),
        rules=_one_of("oneOf", "position", f"position{DEGREES}", "sweep", f"sweep{DEGREES}"),
        sweep=_SWEEP,
    ),
    "response": FileTable(ResponseSetup),
    "synthesis": FileTable(SynthesisSetup),
    "synthesis_task": FileTable(
        SynthesisTask, words="What is asked at every position: a function, a path, poses, or positions."
    ),
    "event": FileTable(
        Event, words="A time at which the coordinate of a freedom, or one of its rates, passes a value."
    ),
    "stop": FileTable(Stop, words="Limits of a freedom, which it strikes."),
    "law": FileTable(ForceTable, needed=("force",), rules=_one_of("anyOf", "x", "v", f"x{DEGREES}", f"v{DEGREES}")),
    **{f"load {kind}": FileTable(load) for kind, load in LOADS.items()},
    "pair_type": FileTable(
        PairType,
        words="A row of the pair table of the user's own.",
        symbol=TEXT("what `type` of a pair names; letters and digits", rules={"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"}),
        name=TEXT("in words", default="the symbol"),
        freedoms=OTHER(
            '`"Rx"` ... `"Tz"`, `"Rz + pitch Tz"`, `"rotation"` (three freedoms kept as one rotation), or tables',
            rules=_named_or("freedom"),
        ),
        reactions=OTHER(
            '6 - f of `"Mx"` ... `"Fz"`, `"Fy@1"` for frame 1, or tables',
            default="null space, n1, n2, ...",
            rules=_named_or("component"),
        ),
        efforts=OTHER(
            "one dual to every freedom, as above", default="unit couple or force", rules=_named_or("component")
        ),
        bookkeeping=TABLE("how Lee counts its unknowns and equations", table="bookkeeping", default="6 - f unknowns"),
        directed=FLAG("whether it has an axis"),
        square_second=FLAG("whether `second` must be perpendicular as given"),
    ),
    "freedom": FileTable(
        Freedom,
        words="One elementary freedom: a constant unit twist in the frame left by the freedoms before it.",
        name=TEXT("name within the pair, e.g. Rz"),
        twist=SIX("a unit twist, angular part first"),
        per_pitch=_PER_PITCH,
    ),
    "component": FileTable(
        Component,
        words="A constant wrench: a reaction component or an effort.",
        name=TEXT("name, e.g. Fx"),
        wrench=SIX("moment first, then force"),
        frame=INTEGER("frame k after k single freedoms"),
        per_pitch=_PER_PITCH,
        at_b=FLAG("whether the origin is that of marker B rather than of the frame"),
    ),
    "bookkeeping": FileTable(
        Bookkeeping,
        words="How a count in Lee's manner writes the pair: a free dual force and parts along the axis, under conditions.",
        needed=(),
        conditions=TABLES("unit twists of frame 0 to which the dual force is reciprocal", table="freedom"),
        along=TABLES("components that the pair transmits along its axis", table="component"),
    ),
}
TABLES_OF_FILE["load wrench"] = FileTable(LOADS["wrench"], rules=_one_of("anyOf", "force", "moment"))
for _kind in ("damper", "force_law"):
    _places = {"oneOf": [{"required": ["freedom"]}, {"required": ["a", "b", "p", "q"]}]}
    TABLES_OF_FILE[f"load {_kind}"] = FileTable(LOADS[_kind], rules=_places)


def _array(count: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}


def _series_of(name: str, words: str, one: dict[str, Any]) -> dict[str, Any]:
    return {name: {"description": words, "anyOf": [one, {"type": "array", "items": {"$ref": f"#/$defs/{name}"}}]}}


SHARED = {
    "vector": {"description": "Three numbers; in a planar file two will do.", **_array(3), "minItems": 2},
    "six": _array(6),
    **_series_of("series", "A number, or an array of numbers, one a position.", {"type": "number"}),
    **_series_of(
        "vector_series",
        "Three numbers, in a planar file two; or an array of such, one a position.",
        {"$ref": "#/$defs/vector"},
    ),
}
"""Values that many fields share."""
MARK = re.compile(r"(<!-- fields: ([\w, ]+) -->\n)(?:\|[^\n]*\n)*")
"""Where the Markdown of the library takes a table of fields: a comment, and the table below it."""


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a mechanism file."""
    top, *tables = TABLES_OF_FILE
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "mechanism.schema.json",
        "title": "mechgraph mechanism",
        **_table_schema(top, TABLES_OF_FILE[top]),
        "$defs": SHARED | {name: _table_schema(name, TABLES_OF_FILE[name]) for name in tables},
    }


def schema_text() -> str:
    """The JSON Schema as the library stores it."""
    return laid_out(json_schema()) + "\n"


def laid_out(value: Any, depth: int = 0) -> str:
    """JSON in which what fits in a line stands in one."""
    line = json.dumps(value, ensure_ascii=False)
    # longest line of the stored schema that is not broken
    if (depth + len(line) <= 130 and depth > 0) or not isinstance(value, dict | list):
        return line
    inner, outer = "\n" + "  " * (depth + 1), "\n" + "  " * depth
    if isinstance(value, list):
        return f"[{inner}{f',{inner}'.join(laid_out(v, depth + 1) for v in value)}{outer}]"
    entries = (f"{json.dumps(key)}: {laid_out(v, depth + 1)}" for key, v in value.items())
    return f"{{{inner}{f',{inner}'.join(entries)}{outer}}}"


def _table_schema(name: str, table: FileTable) -> dict[str, Any]:
    what, _, kind = name.partition(" ")
    properties: dict[str, Any] = {"kind": {"const": kind}} if kind else {}
    for key, about in table.fields.items():
        properties[key] = _field_schema(about, table.defaults.get(key))
        if about.degrees:
            properties[f"{key}_deg"] = _field_schema(about, None) | {"description": f"{about.meaning}; degrees"}
    needed = [*(["kind"] if kind and USUAL.get(what) != kind else []), *table.needed]
    return {
        "description": table.words,
        "type": "object",
        "properties": properties,
        **({"required": needed} if needed else {}),
        "additionalProperties": False,
        **table.rules,
    }


def _field_schema(about: FieldFormat, default: Any) -> dict[str, Any]:
    out: dict[str, Any] = {"description": about.meaning, **about.kind.schema, **about.rules}
    if about.normal:  # of a planar file one number
        out = {"description": about.meaning, "anyOf": [about.kind.schema, {"$ref": "#/$defs/series"}]}
    if about.choices:
        out = {"description": about.meaning, "enum": list(about.choices)}
    elif out.get("type") == "string" and default != "" and "pattern" not in out:
        out["minLength"] = 1
    if about.minimum is not None:
        out["minimum"] = about.minimum
    if isinstance(default, bool | float | int) or (about.choices and isinstance(default, str)):
        out["default"] = default
    if about.kind is TABLE:
        out |= _reference(about.table)
    elif about.kind is TABLES:
        out |= {"type": "array", "items": _reference(about.table)}
    return out


def _reference(name: str) -> dict[str, Any]:
    if name in KINDS:
        return {"oneOf": [_reference(f"{name} {kind}") for kind in KINDS[name]]}
    return {"$ref": f"#/$defs/{quote(name)}"}


# --- the tables of fields in Markdown ----------------------------------------------------------------------------------


def with_field_tables(markdown: str) -> str:
    """A text with the table of fields replaced below every ``<!-- fields: link -->`` (several names: one table of all)."""
    return MARK.sub(lambda found: found[1] + "".join(f"| {' | '.join(r)} |\n" for r in _rows(found[2])), markdown)


def _rows(names: str) -> Iterator[tuple[str, ...]]:
    listed = [f"{names} {kind}" for kind in KINDS[names]] if names in KINDS else names.split(", ")
    several = len(listed) > 1
    head = ("field", "type", "unit", "meaning", "default")
    yield ("table", *head) if several else head
    yield ("---",) * (len(head) + several)
    for name in listed:
        table = TABLES_OF_FILE[name]
        for i, (key, about) in enumerate(table.fields.items()):
            first = (f"`{name.rpartition(' ')[2]}`" if i == 0 else "",) if several else ()
            yield *first, *_row(key, about, table)


def _row(key: str, about: FieldFormat, table: FileTable) -> tuple[str, ...]:
    kind = about.kind.words + (" ≥ 0" if about.minimum == 0 else "")
    if about.rules.get("type") == "array":
        kind = "list"
    shown = {TABLE: f"`[{key}]`", TABLES: f"`[[{key}]]`"}.get(about.kind, f"`{key}`")
    default = table.defaults.get(key)
    if isinstance(default, bool | float):
        default = str(default).lower() if isinstance(default, bool) else f"{default:g}"
    fallback = "needed" if key in table.needed else default if isinstance(default, str) else ""
    return shown + (" (°)" if about.degrees else ""), kind, about.unit, about.meaning, about.default or fallback
