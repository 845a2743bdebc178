"""Mechanisms in TOML files: read with all faults at once, written whole or not at all.

The format is described field by field in ``library/README.md``; ``FIELDS`` below is what the reader accepts and the JSON Schema
beside the library is checked against it. A field that is an angle may be given in degrees under its name with ``_deg`` added.
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from mechgraph.errors import DeclarationError, FileError
from mechgraph.model.chain import chain
from mechgraph.model.conversion import UNIT_NAMES
from mechgraph.model.drive import Drive
from mechgraph.model.library import library_names, library_path
from mechgraph.model.link import Link
from mechgraph.model.load import LOADS
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.pair_table import TABLE
from mechgraph.model.pair_type import Bookkeeping, Component, Freedom, PairType
from mechgraph.model.values import is_numeric

SCHEMA = 1
"""Number of the file format."""
SWEEP_ROUNDING = 1e-12
"""Part of a sweep by which its end may come early and still be excluded (degrees turned into radians are rounded)."""

FIELDS: dict[str, tuple[str, ...]] = {
    "file": (
        "schema",
        "name",
        "description",
        "source",
        "frame",
        "units",
        "pair_type",
        "chain",
        "link",
        "pair",
        "drive",
        "load",
        "start",
        "expected",
    ),
    "units": UNIT_NAMES,
    "pair_type": ("symbol", "name", "freedoms", "reactions", "efforts", "bookkeeping", "directed", "square_second"),
    "freedom": ("name", "twist", "per_pitch"),
    "component": ("name", "wrench", "frame", "per_pitch", "at_b"),
    "bookkeeping": ("conditions", "along"),
    "chain": ("pairs", "twist", "length", "offset", "pitch"),
    "link": ("name", "mass", "center", "inertia", "unphysical"),
    "pair": ("name", "type", "a", "b", "point", "axis", "second", "pitch", "lead", "on_a", "on_b"),
    "marker": ("point", "axis", "second"),
    "drive": ("freedom", "motion"),
    "motion": ("position", "sweep", "velocity", "acceleration", "t"),
    **{f"load {kind}": ("kind", *(f.name for f in dataclasses.fields(cls))) for kind, cls in LOADS.items()},
}
"""Fields of every table of the format."""

ANGLES = {
    "chain": ("twist",),
    "motion": ("position", "sweep", "velocity", "acceleration"),
    "load torsion_spring": ("free",),
}
"""Fields that may be given in degrees, with ``_deg`` added to their names."""

NEEDED = {
    "file": ("schema", "name"),
    "pair_type": ("symbol", "freedoms"),
    "freedom": ("name", "twist"),
    "component": ("name", "wrench"),
    "chain": ("pairs",),
    "link": ("name",),
    "pair": ("name", "type", "a", "b"),
    "drive": ("freedom",),
    "load gravity": ("acceleration",),
    "load wrench": ("link",),
    "load effort": ("freedom", "value"),
    "load spring": ("a", "b", "p", "q", "stiffness"),
    "load torsion_spring": ("freedom", "stiffness"),
}
"""Fields that must be there."""

KINDS: dict[type, tuple[str, frozenset[str]]] = {
    str: (
        "a text",
        frozenset({"name", "description", "source", "frame", "symbol", "pairs", "type", "a", "b", "freedom", "link"}),
    ),
    bool: ("true or false", frozenset({"unphysical", "directed", "square_second", "at_b"})),
    dict: ("a table", frozenset({"expected"})),
}
"""Fields that hold a text, a truth value or a table, wherever they stand alone (``frame`` of a component is a number)."""
OTHERWISE = {"file": {"link"}, "component": {"frame"}}
"""Fields of a table to which ``KINDS`` does not apply."""


class _Reader:
    """Reads tables into constructor arguments and collects the faults of a file."""

    def __init__(self) -> None:
        self.faults: list[str] = []

    def table(self, kind: str, raw: Any, where: str) -> dict[str, Any]:
        """The fields of one table, degrees turned into radians."""
        if not isinstance(raw, Mapping):
            self.faults.append(f"{where}: expected a table, got {raw!r}")
            return {}
        out: dict[str, Any] = {}
        for key, value in raw.items():
            base = key.removesuffix("_deg")
            if key in FIELDS[kind]:
                out[key] = value
            elif base != key and base in ANGLES.get(kind, ()):
                out[base] = self.radians(value, f"{where}.{key}")
            else:
                known = [*FIELDS[kind], *(f"{a}_deg" for a in ANGLES.get(kind, ()))]
                self.faults.append(f"{where}: unknown field {key!r} (fields: {', '.join(known)})")
        for want, (words, keys) in KINDS.items():
            for key in (keys - OTHERWISE.get(kind, set())) & out.keys():
                if not isinstance(out[key], want):
                    self.faults.append(f"{where}.{key} = {out[key]!r}: expected {words}")
        missing = [key for key in NEEDED.get(kind, ()) if key not in out]
        if missing:
            self.faults.append(f"{where}: field{'s' if len(missing) > 1 else ''} {', '.join(missing)} missing")
        return out

    def radians(self, value: Any, where: str) -> Any:
        try:
            return np.deg2rad(np.asarray(value, dtype=float)).tolist()
        except (TypeError, ValueError):
            self.faults.append(f"{where} = {value!r}: expected numbers")
            return value

    def tables(self, kind: str, raw: Any) -> list[tuple[str, Mapping[str, Any]]]:
        """The entries of an array of tables, each with the words that say where it is."""
        if not isinstance(raw, list):
            self.faults.append(f"[[{kind}]]: expected an array of tables, got {raw!r}")
            return []
        return [
            (f"{kind} {entry.get('name', i + 1)!r}" if isinstance(entry, Mapping) else f"{kind} {i + 1}", entry)
            for i, entry in enumerate(raw)
        ]

    def made(self, where: str, make: Any, **arguments: Any) -> Any:
        """The object, or None with the fault noted."""
        try:
            return make(**arguments)
        except DeclarationError as error:
            self.faults += [f"{where}: {fault}" for fault in error.faults]
        except (TypeError, ValueError) as error:
            self.faults.append(f"{where}: {error}")
        return None


def _parts(reader: _Reader, kind: str, cls: Any, items: Any, where: str) -> Any:
    """Freedoms or components: names as they are, tables as objects."""
    if items is None:
        return None
    if not isinstance(items, list):
        reader.faults.append(f"{where}: expected a list, got {items!r}")
        return []
    out = []
    for item in items:
        if isinstance(item, Mapping):
            fields = reader.table(kind, item, where)
            wrong = [
                key for key in ("twist", "wrench", "per_pitch") if key in fields and not is_numeric(fields[key], (6,))
            ]
            reader.faults += [f"{where}.{key} = {fields[key]!r}: expected six finite numbers" for key in wrong]
            item = (
                None
                if wrong
                else reader.made(where, cls, **{k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()})
            )
        out.append(item)
    return out


def _pair_type(reader: _Reader, raw: Any, where: str) -> PairType | None:
    fields = reader.table("pair_type", raw, where)
    before = len(reader.faults)
    fields["freedoms"] = _parts(reader, "freedom", Freedom, fields.get("freedoms"), f"{where}.freedoms")
    for key in ("reactions", "efforts"):
        fields[key] = _parts(reader, "component", Component, fields.get(key), f"{where}.{key}")
    if "bookkeeping" in fields:
        book = reader.table("bookkeeping", fields["bookkeeping"], f"{where}.bookkeeping")
        conditions = _parts(reader, "freedom", Freedom, book.get("conditions", []), f"{where}.bookkeeping.conditions")
        along = _parts(reader, "component", Component, book.get("along", []), f"{where}.bookkeeping.along")
        fields["bookkeeping"] = Bookkeeping(tuple(conditions), tuple(along))
    if len(reader.faults) > before or fields["freedoms"] is None or "symbol" not in fields:
        return None
    made: PairType | None = reader.made(where, PairType, **fields)
    return made


def _motion(reader: _Reader, raw: Any, where: str) -> Motion | None:
    fields = reader.table("motion", raw, where)
    sweep = fields.pop("sweep", None)
    if sweep is not None:
        if "position" in fields or not is_numeric(sweep, (3,)) or not sweep[2]:
            reader.faults.append(
                f"{where}.sweep = {sweep!r}: expected [first, end (excluded), step], and no position beside it"
            )
            return None
        fields["position"] = _swept(*sweep)
    if "position" not in fields:
        reader.faults.append(f"{where}: position or sweep missing")
        return None
    made: Motion | None = reader.made(where, Motion, **fields)
    return made


def _swept(first: float, end: float, step: float) -> np.ndarray:
    """Positions ``first + k step`` before ``end``; an end that is a whole number of steps away is left out despite rounding."""
    count = np.ceil((end - first) / step * (1.0 - SWEEP_ROUNDING))
    return first + step * np.arange(max(int(count), 0))


def _loads(reader: _Reader, raw: Any) -> list[Any]:
    out = []
    for where, entry in reader.tables("load", raw):
        kind = entry.get("kind") if isinstance(entry, Mapping) else None
        if not isinstance(kind, str) or kind not in LOADS:
            reader.faults.append(f"{where}: kind {kind!r}: expected one of {', '.join(LOADS)}")
            continue
        fields = reader.table(f"load {kind}", entry, where)
        fields.pop("kind", None)
        if not [key for key in NEEDED[f"load {kind}"] if key not in fields]:
            out.append(reader.made(where, LOADS[kind], **fields))
    return out


def _start(reader: _Reader, raw: Any) -> dict[str, Any]:
    if not isinstance(raw, Mapping):
        reader.faults.append(f"[start]: expected a table, got {raw!r}")
        return {}
    return {
        key.removesuffix("_deg"): reader.radians(value, f"start.{key}") if key.endswith("_deg") else value
        for key, value in raw.items()
    }


def parse(data: Mapping[str, Any], subject: str) -> Mechanism:
    """The mechanism of a parsed TOML file.

    Raises
    ------
    DeclarationError
        with all faults: of the format, and of the mechanism.
    """
    reader = _Reader()
    top = reader.table("file", data, "file")
    if top.get("schema", SCHEMA) != SCHEMA:
        reader.faults.append(f"schema = {top['schema']!r}: this version reads schema {SCHEMA}")
    types: dict[str, PairType] = dict(TABLE)
    for where, entry in reader.tables("pair_type", top.get("pair_type", [])):
        row = _pair_type(reader, entry, where)
        if row is not None:
            types[row.symbol] = row
    links = [
        reader.made(where, Link, **reader.table("link", entry, where))
        for where, entry in reader.tables("link", top.get("link", []))
    ]
    drives = []
    for where, entry in reader.tables("drive", top.get("drive", [])):
        fields = reader.table("drive", entry, where)
        if "motion" in fields:
            fields["motion"] = _motion(reader, fields["motion"], f"{where}.motion")
        drives.append(reader.made(where, Drive, **fields) if "freedom" in fields else None)
    more: dict[str, Any] = {
        "drives": drives,
        "loads": _loads(reader, top.get("load", [])),
        "start": _start(reader, top.get("start", {})),
        "units": reader.table("units", top["units"], "units") if "units" in top else None,
        **{key: top[key] for key in ("source", "description", "expected", "frame") if key in top},
    }
    pairs = [_pair(reader, entry, where, types) for where, entry in reader.tables("pair", top.get("pair", []))]
    if "chain" in top and pairs:
        reader.faults.append("both [chain] and [[pair]]; give one form")
    fields = reader.table("chain", top["chain"], "chain") if "chain" in top else {}
    if reader.faults:
        raise DeclarationError(subject, reader.faults)
    name = top["name"]
    try:
        if fields:
            return chain(fields.pop("pairs"), name=name, drive=None, links=links, **fields, **more)
        return Mechanism(name, links or None, [p for p in pairs if p is not None], **more)
    except DeclarationError as error:
        raise DeclarationError(subject, error.faults) from None


def _pair(reader: _Reader, raw: Any, where: str, types: Mapping[str, PairType]) -> Pair | None:
    fields = reader.table("pair", raw, where)
    for side in ("on_a", "on_b"):
        if side in fields:
            marker = reader.table("marker", fields[side], f"{where}.{side}")
            fields[side] = reader.made(f"{where}.{side}", Marker, **marker)
    if any(key not in fields for key in NEEDED["pair"]):
        return None
    if isinstance(fields["type"], str):
        fields["type"] = types.get(fields["type"], fields["type"])
    made: Pair | None = reader.made(where, Pair, **fields)
    return made


def load(name: str | os.PathLike[str]) -> Mechanism:
    """A mechanism from the library (by name) or from a TOML file (by path).

    Raises
    ------
    FileError
        where the file cannot be read or is no TOML; DeclarationError where its content is at fault.
    """
    text = os.fspath(name)
    is_path = text.endswith(".toml") or os.sep in text or not isinstance(name, str)
    if not is_path and text not in library_names():
        raise FileError(
            text,
            f"no mechanism of that name in the library ({', '.join(library_names())}), and no path to a .toml file",
        )
    path = Path(text) if is_path else library_path(text)
    try:
        data = tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is no TOML: {error}") from None
    return parse(data, f"file {path.name}")


# --- writing -----------------------------------------------------------------------------------------------------------


def _plain(value: Any, where: str, path: str) -> Any:
    if callable(value):
        raise FileError(path, f"{where} is a callable; a file holds numbers only. Sample it first")
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(v, where, path) for v in value]
    if isinstance(value, Mapping):
        return {k: _plain(v, where, path) for k, v in value.items()}
    return value.item() if isinstance(value, np.generic) else value


def _fields(item: Any, kind: str, path: str, where: str) -> dict[str, Any]:
    values = {key: getattr(item, key, None) for key in FIELDS[kind] if key != "kind"}
    return {key: _plain(value, f"{where}.{key}", path) for key, value in values.items() if value is not None}


def to_data(m: Mechanism, path: str = "") -> dict[str, Any]:
    """The content of the TOML file of a mechanism."""
    data: dict[str, Any] = {"schema": SCHEMA, "name": m.name, "frame": m.frame}
    for key in ("description", "source"):
        if getattr(m, key):
            data[key] = getattr(m, key)
    if m.units:
        data["units"] = dict(m.units)
    own = {p.type.symbol: p.type for p in m.pairs if TABLE.get(p.type.symbol) != p.type}
    if own:
        data["pair_type"] = [_type_data(row, path) for row in own.values()]
    data["link"] = [_fields(link, "link", path, f"link {link.name!r}") for link in m.links]
    data["pair"] = []
    for p in m.pairs:
        data["pair"].append(_pair_data(p, path))
    if m.drives:
        data["drive"] = []
        for drive in m.drives:
            entry: dict[str, Any] = {"freedom": drive.freedom}
            if drive.motion is not None:
                entry["motion"] = _fields(drive.motion, "motion", path, f"drive {drive.freedom!r}")
            data["drive"].append(entry)
    if m.loads:
        data["load"] = [{"kind": x.kind} | _fields(x, f"load {x.kind}", path, f"load {x.kind}") for x in m.loads]
    if m.start:
        data["start"] = dict(m.start)
    if m.expected:
        data["expected"] = _plain(dict(m.expected), "expected", path)
    return data


def _pair_data(p: Pair, path: str) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key in FIELDS["pair"]:
        value = getattr(p, key)
        if isinstance(value, PairType):
            data[key] = value.symbol
        elif isinstance(value, Marker):
            data[key] = _fields(value, "marker", path, f"pair {p.name!r}.{key}")
        elif value is not None:
            data[key] = _plain(value, f"pair {p.name!r}.{key}", path)
    return data


def _type_data(row: PairType, path: str) -> dict[str, Any]:
    freedoms: list[Any] = []
    for factor in row.factors:
        if len(factor) == 3:
            freedoms.append("rotation")
        else:
            freedoms.append(_fields(row.freedoms[factor[0]], "freedom", path, "freedom"))
    data: dict[str, Any] = {
        "symbol": row.symbol,
        "name": row.name,
        "freedoms": freedoms,
        "directed": row.directed,
        "square_second": row.square_second,
    }
    if row.reactions is not None:
        data["reactions"] = [_fields(c, "component", path, "reaction") for c in row.reactions]
    if not row.computed_efforts:
        data["efforts"] = [_fields(c, "component", path, "effort") for c in row.efforts]
    if row.bookkeeping is not None:
        data["bookkeeping"] = {
            "conditions": [_fields(c, "freedom", path, "condition") for c in row.bookkeeping.conditions],
            "along": [_fields(c, "component", path, "along") for c in row.bookkeeping.along],
        }
    return data


def save(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as TOML; ``load`` gives back an equal one. The file is written whole or not at all.

    Raises
    ------
    FileError
        where a load is a callable, or the file cannot be written.
    """
    try:
        text = tomli_w.dumps(to_data(m, os.fspath(path)))
        text.encode("utf-8")
    except (TypeError, UnicodeEncodeError) as error:
        raise FileError(path, f"mechanism {m.name!r} cannot be written as TOML: {error}") from None
    write_whole(path, text)


def write_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file through a temporary one beside it, so that no half-written file is ever left.

    Raises
    ------
    FileError
        where the file cannot be written.
    """
    target = Path(path)
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", newline="", dir=target.parent, prefix=f".{target.name}.", delete=False
        ) as handle:
            temporary = Path(handle.name)
            handle.write(text)
        mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
        temporary.chmod(mode)
        os.replace(temporary, target)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise FileError(target, f"cannot be written: {error.strerror or error}") from None
    except BaseException:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
