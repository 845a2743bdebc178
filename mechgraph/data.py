"""Results as plain data for scripts, and the JSON Schema of these, both read off the types of dataclasses."""

from __future__ import annotations

import json
import math
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

Json = dict[str, Any]
VERSION = 1
"""Of the layout of all data: higher where something that a script may rely on is changed, not where something is added."""
SIMPLE = {str: "string", bool: "boolean", int: "integer", float: "number", type(None): "null"}


def plain(value: Any) -> Any:
    """Dataclasses and mappings as dictionaries, sequences as lists, numbers that are not finite as None."""
    if isinstance(value, Mapping):
        return {key: plain(of) for key, of in value.items()}
    if isinstance(value, list | tuple):
        return [plain(of) for of in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(value: Any) -> str:
    """Plain data as the text of a JSON file."""
    return json.dumps(plain(value), indent=2, allow_nan=False) + "\n"


def schema_of(hint: Any, defs: Json) -> Json:
    """The JSON Schema of the plain data of a type; those of dataclasses stand in ``defs``, by the name of the class."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return {"description": inner[1], **schema_of(inner[0], defs)}
    if hint is Any:
        return {}
    if hint in SIMPLE:
        return {"type": SIMPLE[hint]}
    if origin in (Union, types.UnionType):
        return {"anyOf": [schema_of(one, defs) for one in inner]}
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is not None and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": schema_of(inner[1], defs)}
    if origin is tuple and inner[-1] is not Ellipsis:
        size = len(inner)
        return {
            "type": "array",
            "prefixItems": [schema_of(one, defs) for one in inner],
            "minItems": size,
            "maxItems": size,
        }
    if origin is not None and issubclass(origin, Sequence):
        return {"type": "array", "items": schema_of(inner[0], defs)}
    if not is_dataclass(hint) or not isinstance(hint, type):
        raise TypeError(f"no JSON Schema for {hint!r}")
    if hint.__name__ not in defs:
        defs[hint.__name__] = {}  # a type may hold itself
        hints = get_type_hints(hint, include_extras=True)
        properties = {field.name: schema_of(hints[field.name], defs) for field in fields(hint)}
        defs[hint.__name__] = object_schema(_first_sentence(hint.__doc__), properties)
    return {"$ref": f"#/$defs/{hint.__name__}"}


def object_schema(words: str, properties: Json) -> Json:
    """An object with exactly these properties."""
    return {
        "description": words,
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def members(kind: type, names: Sequence[str], defs: Json) -> Iterator[tuple[str, Json]]:
    """Names and JSON Schemas of properties of a class, from their types and the first sentence about them."""
    for name in names:
        found = getattr(kind, name)
        getter = found.fget if isinstance(found, property) else found.func
        yield (
            name,
            {"description": _first_sentence(getter.__doc__), **schema_of(get_type_hints(getter)["return"], defs)},
        )


def patch(old: Any, new: Any, path: str = "") -> list[Json]:
    """The JSON Patch (RFC 6902) that makes ``new`` of ``old``, plain data both; lists are compared item by item."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        out = []
        for key in [*old, *(key for key in new if key not in old)]:
            at = f"{path}/{key.replace('~', '~0').replace('/', '~1')}"
            if key not in new:
                out.append({"op": "remove", "path": at})
            elif key not in old:
                out.append({"op": "add", "path": at, "value": new[key]})
            else:
                out += patch(old[key], new[key], at)
        return out
    if isinstance(old, list) and isinstance(new, list) and len(old) <= len(new):
        changed = [one for i, (a, b) in enumerate(zip(old, new, strict=False)) for one in patch(a, b, f"{path}/{i}")]
        return changed + [{"op": "add", "path": f"{path}/-", "value": value} for value in new[len(old) :]]
    return [] if old == new else [{"op": "replace", "path": path, "value": new}]


def _first_sentence(text: str | None) -> str:
    return " ".join((text or "").split("\n\n")[0].split())
