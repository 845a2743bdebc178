"""Mechanisms in TOML files: read with all faults at once, written whole or not at all; and where those of the library are.

What a table may hold stands in ``file_format``; reader and writer go through it. A field that is an angle may be given in degrees under
its name with ``_deg`` added. ``library/README.md`` describes the format for people.
"""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from mechgraph.errors import ContentError, DeclarationError, FileError, did_you_mean, near_names
from mechgraph.fields import (
    BY_FREEDOM,
    COEFFICIENTS,
    SIX,
    STANDS_AS,
    TABLE,
    TABLES,
    Described,
    filled_second,
    is_default,
    sound_tol,
)
from mechgraph.files import text_of, toml_of, write_whole
from mechgraph.maths.se3 import Array
from mechgraph.model.file_format import DEGREES, KINDS, OF_SCHEMA_2, SCHEMA, TABLES_OF_FILE, USUAL
from mechgraph.model.mechanism import Mechanism, chain
from mechgraph.model.motion import Motion
from mechgraph.model.plane import in_file, pair_in_plane
from mechgraph.pairs.contact_types import travels
from mechgraph.pairs.curves import Curve
from mechgraph.pairs.pair_type import TABLE as PAIR_TABLE
from mechgraph.pairs.pair_type import PairType
from mechgraph.pairs.surfaces import Surface
from mechgraph.quantities import is_numeric, real_array, shown, unknown, wrong

__all__ = ["library_names", "library_path"]

_PACKAGE = Path(__file__).resolve().parents[1]
_PLACES = (_PACKAGE / "library", _PACKAGE.parent / "library")


def library_path(name: str | None = None) -> Path:
    """Path of the library folder, or of the file of the mechanism `name` in it.

    A wheel holds the library as ``mechgraph/library``, an editable install as ``library`` beside
    ``mechgraph``; the first that exists is taken.

    Parameters
    ----------
    name
        Name as in `library_names`, without ``.toml``.

    Raises
    ------
    FileError
        No library folder in either place, or no mechanism of that name; the message lists those there are.
    """
    folder = next((place for place in _PLACES if place.is_dir()), None)
    if folder is None:
        raise FileError(_PLACES[0], f"no mechanism library there, nor in {_PLACES[1]}; install mechgraph again")
    if name is None:
        return folder
    names = _stems(folder)
    if name not in names:
        raise FileError(folder, f"no mechanism {name!r} in the library; available: {', '.join(names)}")
    return folder / f"{name}.toml"


def library_names() -> tuple[str, ...]:
    """List the names of the library mechanisms, sorted.

    Returns
    -------
    tuple of str

    Raises
    ------
    FileError
        The library folder is missing.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.library()[:3]
    ('7r', 'andrews', 'bennett')
    """
    return _stems(library_path())


def _stems(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


LONGEST_SWEEP = 1_000_000
"""Longest sweep that a file or the command line may ask for."""


DIGITS = 12
"""Digits in which a sweep is sought first: those that people write."""


def sweep_of(positions: Array) -> list[float] | None:
    """``[first, end, step]`` of which ``swept`` makes exactly these positions ``(n,)``, in the fewest digits; None where none does."""
    n = len(positions)
    if n < 4:  # three numbers are as short
        return None
    first, step = float(positions[0]), float(positions[-1] - positions[0]) / (n - 1)
    steps = float(f"{step:.{DIGITS}g}"), step, float(positions[1]) - first
    for found in ([first, float(f"{first + n * step:.{DIGITS}g}"), step] for step in steps):
        made = swept(*found)
        if not isinstance(made, str) and np.array_equal(made, positions):
            return found
    return None


def swept(first: float, end: float, step: float) -> Array | str:
    """Positions ``first + k step`` before ``end``, or why there are none."""
    if step == 0 or first == end:
        return "no positions: " + ("the step is 0" if step == 0 else "the end, which is excluded, is also the first")
    count = (end - first) / step
    if count < 0:
        return "no positions: the step leads away from the end; change its sign, or exchange first and end"
    if count > LONGEST_SWEEP:
        return f"{count:.3g} positions, at most {LONGEST_SWEEP} are taken; take a larger step"
    # part of a step by which the end may come late through rounding and still be excluded
    return np.asarray(first + step * np.arange(max(int(np.ceil(count - 1e-9)), 1)), dtype=float)


LIST = re.compile(r"""\[\n((?:\ +[^\[\]{}"'\n]+,\n)+)\ *\]""")
LIST_OF_LISTS = re.compile(r"""\[\n((?:\ +\[[^\[\]{}"'\n]*\],\n)+)\ *\]""")
"""Lists of numbers, and lists of these, one item a line."""


class _Reader:
    """Builds the objects of a file from its tables and collects the faults."""

    def __init__(self) -> None:
        self.faults: list[str] = []
        self.left_out = False
        """Whether things are missing because of their faults, so that others seem to refer to nothing."""
        self.in_degrees = list[tuple[str, str]]()
        """Where numbers were read in degrees, and of which freedom, point or link."""
        self.pair_types: dict[str, PairType] = dict(PAIR_TABLE)

    def fields(self, kind: str, raw: Any, where: str) -> dict[str, Any]:
        """The fields of one table by their names in files, degrees turned into radians."""
        if not isinstance(raw, Mapping):
            self.faults.append(wrong(raw, where, "a table"))
            return {}
        table = TABLES_OF_FILE[kind]
        out: dict[str, Any] = {}
        for key, value in raw.items():
            if key in table.fields:
                out[key] = value
            elif key in table.in_degrees and table.in_degrees[key] in raw:
                self.faults.append(f"{where}: {table.in_degrees[key]} and {key} are both given; leave one out")
            elif key in table.in_degrees:
                out[table.in_degrees[key]] = self.radians(value, f"{where}.{key}")
                self.in_degrees.append((f"{where}.{key}", ""))
            else:
                self.faults.append(f"{where}: {unknown('field', key, [*table.fields, *table.in_degrees])}")
        missing = [key for key in table.needed if key not in out]
        for key, value in list(out.items()):
            wanted = table.fields[key].kind.stands_as
            if wanted is not None and not isinstance(value, wanted):
                self.faults.append(wrong(out.pop(key), f"{where}.{key}", STANDS_AS[wanted]))
        if missing:
            self.faults.append(f"{where}: field{'s' if len(missing) > 1 else ''} {', '.join(missing)} missing")
        return out

    def radians(self, value: Any, where: str) -> Any:
        """Degrees as radians."""
        array = real_array(value)
        if array is None:
            self.faults.append(wrong(value, where, "numbers"))
            return 0.0
        return np.deg2rad(array).tolist()

    def item(self, kind: str, raw: Any, where: str) -> Any:
        """The object of one table, or None with the faults noted."""
        table, before = TABLES_OF_FILE[kind], len(self.faults)
        fields = self.fields(kind, raw, where)
        for key, value in fields.items():
            if table.fields[key].kind is TABLE:
                inner = table.fields[key].table
                read = self.of_kind if inner in KINDS else self.item
                fields[key] = read(inner, value, f"{where}.{key}")
            elif table.fields[key].kind is BY_FREEDOM:
                fields[key] = self.by_freedom(value, f"{where}.{key}")
            elif table.fields[key].kind is TABLES and kind in NESTED:
                fields[key] = self.items(table.fields[key].table, value, f"{where}.{key}")
        if kind in READ_FIRST and len(self.faults) == before:
            READ_FIRST[kind](self, fields, where)
        if any(key not in fields for key in table.needed) or (len(self.faults) > before and kind in READ_FIRST):
            return None
        try:
            return table.make(**{table.attributes.get(key, key): value for key, value in fields.items()})
        except DeclarationError as error:
            self.faults += [f"{where}: {fault}" for fault in error.faults]
        except (TypeError, ValueError) as error:
            self.faults.append(f"{where}: {error}")
        return None

    def items(self, key: str, raw: Any, named: str = "") -> list[Any]:
        """The objects of an array of tables, ``named`` otherwise than their kind in a table above; those at fault are left out."""
        named = named or key
        if not isinstance(raw, list):
            self.faults.append(wrong(raw, f"[[{named}]]", "an array of tables"))
            self.left_out = True
            return []
        out = []
        for i, entry in enumerate(raw):
            name = shown(entry.get("name", i + 1)) if isinstance(entry, Mapping) else i + 1
            where = f"{named} {name}"
            out.append(self.of_kind(key, entry, where) if key in KINDS else self.item(key, entry, where))
        made = [item for item in out if item is not None]
        self.left_out |= len(made) < len(raw)
        return made

    def of_kind(self, key: str, raw: Any, where: str) -> Any:
        """The object of a table whose ``kind`` says what stands in it."""
        kind = raw.get("kind", USUAL.get(key)) if isinstance(raw, Mapping) else None
        if isinstance(kind, str) and kind in KINDS[key]:
            return self.item(f"{key} {kind}", {key: value for key, value in raw.items() if key != "kind"}, where)
        self.faults.append(wrong(kind, f"{where}: kind", f"one of {', '.join(KINDS[key])}"))
        return None

    def by_freedom(self, raw: Any, where: str = "start") -> Any:
        """Values by freedoms, or a list of such tables, degrees turned into radians."""
        if isinstance(raw, list):
            return [self.by_freedom(one, f"{where} {i}") for i, one in enumerate(raw)]
        if not isinstance(raw, Mapping):
            self.faults.append(wrong(raw, f"[{where}]", "a table"))
            return {}
        angles = {key: key.removesuffix(DEGREES) for key in raw if key.endswith(DEGREES)}
        self.in_degrees += [(f"{where}.{key}", name) for key, name in angles.items()]
        self.faults += [
            f"{where}: {name} and {key} are both given; leave one out" for key, name in angles.items() if name in raw
        ]
        return {
            key.removesuffix(DEGREES): self.radians(value, f"{where}.{key}") if key.endswith(DEGREES) else value
            for key, value in raw.items()
        }

    def parts(self, kind: str, items: Any, where: str) -> Any:
        """Freedoms or components: names unchanged, tables as objects."""
        if not isinstance(items, list):
            self.faults.append(wrong(items, where, "a list"))
            return ()
        return tuple(self.item(kind, item, where) if isinstance(item, Mapping) else item for item in items)


# --- fields that need more than being handed on --------------------------------------------------------------------------


def _with_sweep(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """Positions of a motion from a sweep."""
    sweep = fields.pop("sweep", None)
    if sweep is None:
        if "position" not in fields:
            reader.faults.append(f"{where}: position or sweep missing")
    elif "position" in fields or not is_numeric(sweep, (3,)):
        reader.faults.append(wrong(sweep, f"{where}.sweep", "[first, end (excluded), step], and no position beside it"))
    elif isinstance(positions := swept(*sweep), str):
        reader.faults.append(f"{where}.sweep = {shown(sweep)}: {positions}")
    else:
        fields["position"] = positions


def _with_type(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """The type of a pair by its symbol, those of the file included."""
    if isinstance(fields.get("type"), str):
        fields["type"] = reader.pair_types.get(fields["type"], fields["type"])


def _with_parts(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """Freedoms and components in the lists of a pair type or of its bookkeeping."""
    part_of = {"freedoms": "freedom", "conditions": "freedom"}
    for key in ("freedoms", "reactions", "efforts", "conditions", "along"):
        if key in fields:
            fields[key] = reader.parts(part_of.get(key, "component"), fields[key], f"{where}.{key}")


def _with_lists(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """Both lists of a bookkeeping, empty where left out."""
    fields.update({key: fields.get(key, []) for key in TABLES_OF_FILE["bookkeeping"].fields})
    _with_parts(reader, fields, where)


def _with_freedoms(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """Of which freedoms a function, a drive, a spring, a stop or an event has numbers in degrees."""
    named = [str(fields[key]) for key in ("freedom", "of", "input", "output") if key in fields]
    own = [at for at, name in reader.in_degrees if not name and at.startswith(f"{where}.")]
    reader.in_degrees += [(at, name) for at in own for name in named]


def _with_six(reader: _Reader, fields: dict[str, Any], where: str) -> None:
    """Twists and wrenches as tuples."""
    formats = {**TABLES_OF_FILE["freedom"].fields, **TABLES_OF_FILE["component"].fields}
    for key, value in fields.items():
        if formats[key].kind is SIX and not is_numeric(value, (6,)):
            reader.faults.append(wrong(value, f"{where}.{key}", "six finite numbers"))
        elif isinstance(value, list):
            fields[key] = tuple(value)


NESTED = ("response", "cam_law", "synthesis")
"""Tables whose arrays of tables hold objects."""
READ_FIRST = {
    "motion": _with_sweep, "pair": _with_type, "pair_type": _with_parts, "bookkeeping": _with_lists,
    "freedom": _with_six, "component": _with_six, "synthesis_task": _with_freedoms, "drive": _with_freedoms,
    "stop": _with_freedoms, "event": _with_freedoms, "load spring": _with_freedoms,
}  # fmt: skip
"""What is done to the fields of a table before its object is made; without effect where the table is at fault."""


def parse(data: Mapping[str, Any], subject: str) -> Mechanism:
    """The mechanism of a parsed TOML file.

    Raises
    ------
    DeclarationError
        with all faults: of the format, and of the mechanism.
    """
    reader, table = _Reader(), TABLES_OF_FILE["file"]
    top = reader.fields("file", data, "file")
    if top.get("schema", SCHEMA) not in range(1, SCHEMA + 1):
        why = f"this version of mechgraph reads schemas 1 to {SCHEMA}; a file of a later one needs a newer version"
        reader.faults.append(f"schema = {shown(top['schema'])}: {why}")
    reader.pair_types |= {row.symbol: row for row in reader.items("pair_type", top.get("pair_type", []))}
    arguments: dict[str, Any] = {}
    for key, attribute in table.attributes.items():
        if key in top:
            if attribute != key:
                arguments[attribute] = reader.items(key, top[key])
            elif table.fields[key].kind is TABLE:
                inner = table.fields[key].table
                made_of = reader.fields if TABLES_OF_FILE[inner].make is None else reader.item
                arguments[key] = made_of(inner, top[key], key)
            else:
                arguments[key] = reader.by_freedom(top[key]) if table.fields[key].kind is BY_FREEDOM else top[key]
    if "chain" in top and top.get("pair"):
        reader.faults.append("both [chain] and [[pair]]; give one form")
    chained = reader.fields("chain", top["chain"], "chain") if "chain" in top else {}
    if reader.left_out or ("chain" in top and "pairs" not in chained):
        found = [fault for link in arguments.get("links", ()) for fault in link.faults()]
        pairs = arguments.get("pairs", ())
        pairs = map(pair_in_plane, pairs) if arguments.get("planar") is True else pairs
        found += [fault for pair in pairs for fault in pair.faults(sound_tol(arguments.get("tol")))]
        raise DeclarationError(subject, reader.faults + found)
    arguments = {"name": "?", **arguments}
    try:
        if chained:
            arguments.pop("pairs", None)
            made = chain(chained.pop("pairs"), drive=None, **chained, **arguments)
        else:
            made = Mechanism(**{**arguments, "links": arguments.get("links") or None})
        reader.faults += [
            f"{where}: {name} is no angle; leave {DEGREES} out, with angles in radians"
            for where, name in reader.in_degrees
            if _is_length(made, name)
        ]
    except DeclarationError as error:
        reader.faults += error.faults
    if reader.faults:
        raise DeclarationError(subject, list(dict.fromkeys(reader.faults)))
    return made


def _is_length(m: Mechanism, name: str) -> bool:
    """Whether a name is that of a freedom that slides, of a place or direction, or of a link or its point but for turns of the link."""
    if m.freedom_fault(name, single=True) is None:
        return not m.turns(name)
    owner, _, part = name.partition(".")
    if part.rpartition(".")[2] in ("x", "y", "z") or name in ("size", "ratio"):
        return True
    return owner in m.link_names() and part not in ("Rx", "Ry", "Rz")


def load(name: str | os.PathLike[str]) -> Mechanism:
    """A mechanism from the library (by name) or from a TOML file (by path).

    Raises
    ------
    FileError
        where the file cannot be read or is no TOML; ContentError, which is a DeclarationError too, where its content is at fault.
    """
    if not isinstance(name, str | os.PathLike):
        raise DeclarationError("load", [wrong(name, "name", "a name of the library or a path")])
    text = os.fsdecode(name)
    is_path = text.endswith(".toml") or os.sep in text or not isinstance(name, str)
    if not is_path and text not in library_names():
        hint = did_you_mean(near_names(text, library_names())[:2])
        raise FileError(
            text,
            f"neither a library mechanism nor an existing .toml file{hint and f'; {hint}'} (library: {', '.join(library_names())})",
        )
    path = Path(text) if is_path else library_path(text)
    data = toml_of(path, text_of(path, "TOML"))
    try:
        return parse(data, f"file {path.name}")
    except DeclarationError as error:
        raise ContentError(path, error) from None


# --- writing -----------------------------------------------------------------------------------------------------------


def _plain(value: Any, where: str, path: str) -> Any:
    """A value as TOML knows it."""
    if callable(value):
        raise FileError(path, f"{where} is a callable; a file holds numbers only. Sample it first")
    if isinstance(value, PairType):
        return value.symbol
    if isinstance(value, Curve | Surface):
        return _item_data("curve" if isinstance(value, Curve) else "surface", value, path)
    if isinstance(value, Described):
        return _data(value, path, where)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(v, where, path) for v in value]
    if isinstance(value, Mapping):
        return {k: _plain(v, where, path) for k, v in value.items()}
    return value.item() if isinstance(value, np.generic) else value


def _data(item: Described, path: str, where: str) -> dict[str, Any]:
    """The table of a declared thing: what differs from what stands where it is left out."""
    out = {}
    for key, about in item.formats.items():
        value = getattr(item, key)
        filled = about.across and value == filled_second(getattr(item, about.across))
        if (
            value is not None
            and not filled
            and not is_default(type(item), key, value)
            and not (isinstance(value, tuple) and not value)
        ):
            out[about.key or key] = dict(value) if about.kind is COEFFICIENTS else _plain(value, f"{where}.{key}", path)
    return _as_sweep(out, item) if isinstance(item, Motion) else out


def _as_sweep(out: dict[str, Any], motion: Motion) -> dict[str, Any]:
    """The table of a motion with rates as they were given, and a sweep, of degrees where that is shorter, for positions that it makes
    exactly.
    """
    rates = {name: given for name, given in zip(motion.formats, motion.given, strict=False) if name != "position"}
    out = {
        key: _plain(rates.get(key, value), key, "") for key, value in out.items() if rates.get(key, value) is not None
    }
    found = {}
    if motion.position.ndim == 1 and (plain := sweep_of(motion.position)):
        found["sweep"] = plain
        degrees = [float(f"{value:.{DIGITS}g}") for value in np.degrees(plain)]
        if np.array_equal(swept(*np.radians(degrees).tolist()), motion.position):
            found[f"sweep{DEGREES}"] = degrees
    if not found:
        return out
    key = min(found, key=lambda key: len(repr(found[key])))
    return {key: found[key]} | {name: value for name, value in out.items() if name != "position"}


def to_data(m: Mechanism, path: str = "") -> dict[str, Any]:
    """The content of the TOML file of a mechanism."""
    data: dict[str, Any] = {"schema": 1}
    rows = [p.type.spatial or p.type for p in m.pairs]
    own = {row.symbol: row for row in rows if not travels(row) and PAIR_TABLE.get(row.symbol) != row}
    if own:
        data["pair_type"] = [_type_data(row, path) for row in own.values()]
    for key, attribute in TABLES_OF_FILE["file"].attributes.items():
        value = getattr(m, attribute)
        if key != attribute:
            value = [
                _item_data(key, in_file(item) if m.planar and isinstance(item, Described) else item, path)
                for item in value
            ]
        if value:
            data[key] = _plain(value, key, path)
    return data | {"schema": SCHEMA if _is_new(data) else 1}


def _is_new(data: Any) -> bool:
    """Whether tables hold what came with the last schema."""
    if isinstance(data, Mapping):
        return not OF_SCHEMA_2.isdisjoint((*data, data.get("kind", ""))) or any(map(_is_new, data.values()))
    return isinstance(data, list | tuple) and any(map(_is_new, data))


def _item_data(key: str, item: Any, path: str) -> dict[str, Any]:
    """The table of a link, pair, coupling, drive or load."""
    if key in KINDS:
        named = {} if USUAL.get(key) == item.kind else {"kind": item.kind}
        return named | _data(item, path, f"{key} {item.kind}")
    return _data(item, path, f"{key} {getattr(item, next(iter(item.formats)))!r}")


def _type_data(row: PairType, path: str) -> dict[str, Any]:
    """The table of a pair type; what the constructor would fill in is left out."""

    def parts(kind: str, items: Any) -> list[Any]:
        names = TABLES_OF_FILE[kind].fields
        return [{name: _plain(getattr(item, name), kind, path) for name in names} for item in items]

    data = {key: getattr(row, key) for key in TABLES_OF_FILE["pair_type"].fields}
    freedoms = [parts("freedom", [row.freedoms[factor[0]]])[0] for factor in row.factors]
    data["freedoms"] = ["rotation" if len(g) == 3 else f for f, g in zip(freedoms, row.factors, strict=True)]
    data["reactions"] = None if row.reactions is None else parts("component", row.reactions)
    data["efforts"] = None if row.computed_efforts else parts("component", row.efforts)
    if row.bookkeeping is not None:
        conditions = parts("freedom", row.bookkeeping.conditions)
        data["bookkeeping"] = {"conditions": conditions, "along": parts("component", row.bookkeeping.along)}
    return {key: value for key, value in data.items() if value is not None}


def written(m: Mechanism, path: str | os.PathLike[str] = "") -> str:
    """A mechanism as TOML; ``path`` is that of errors.

    Raises
    ------
    FileError
        where a load is a callable.
    """
    try:
        text = _in_few_lines(tomli_w.dumps(to_data(m, str(path))))
        text.encode("utf-8")
    except (TypeError, ValueError, RecursionError) as error:
        raise FileError(path, f"mechanism {m.name!r} cannot be written as TOML: {error}") from None
    return text


def _in_few_lines(text: str) -> str:
    """TOML with lists of numbers, and lists of these, in as few lines as they fill; no text of it goes over the end of a line."""
    line_of_file = 120  # characters of a line of a written list

    def filled(found: re.Match[str]) -> str:
        items = [line.strip().removesuffix(",") for line in found[1].splitlines()]
        one = f"[{', '.join(items)}]"
        if len(one) <= line_of_file:
            return one
        lines = textwrap.wrap(", ".join(items), line_of_file, break_long_words=False, break_on_hyphens=False)
        return "[\n" + "".join(f"    {line.removesuffix(',')},\n" for line in lines) + "]"

    return LIST_OF_LISTS.sub(filled, LIST.sub(filled, text))


def save(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as TOML; ``load`` gives back an equal one. The file is written whole or not at all.

    Raises
    ------
    FileError
        where a load is a callable, or the file cannot be written.
    """
    write_whole(path, [written(m, path)])
