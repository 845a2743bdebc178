"""The file format for editors and for readers: its JSON Schema, and the tables of its fields in Markdown."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

from mechgraph.model.field_format import FieldFormat
from mechgraph.model.field_kinds import TABLE, TABLES
from mechgraph.model.file_format import KINDS, TABLES_OF_FILE, USUAL, FileTable


def _array(count: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}


def _series_of(name: str, words: str, one: dict[str, Any]) -> dict[str, Any]:
    return {name: {"description": words, "anyOf": [one, {"type": "array", "items": {"$ref": f"#/$defs/{name}"}}]}}


SHARED = {
    "vector": _array(3),
    "six": _array(6),
    **_series_of("series", "A number, or an array of numbers, one a position.", {"type": "number"}),
    **_series_of("vector_series", "Three numbers, or an array of such, one a position.", _array(3)),
}
"""Values that many fields share."""
SCHEMA_WIDTH = 130
"""Longest line of the stored schema that is not broken."""
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
    if (depth + len(line) <= SCHEMA_WIDTH and depth > 0) or not isinstance(value, dict | list):
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
