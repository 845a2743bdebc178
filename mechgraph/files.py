"""Files that are read, and written whole or not at all; results as plain data with their JSON Schema."""

from __future__ import annotations

import csv
import importlib
import io
import itertools
import json
import math
import os
import re
import shutil
import signal
import stat
import threading
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import astuple, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from mechgraph.errors import DeclarationError, FileError, MissingExtraError, visible
from mechgraph.memo import dataclass
from mechgraph.quantities import DEEPEST, shown

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


def read_off(hint: Any, value: Any, **more: Any) -> Any:
    """Plain data of what a type describes: of a record the attributes of the value that have the names of its fields, and ``more``."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return read_off(inner[0], value)
    if origin in (Union, types.UnionType):
        return None if value is None else read_off(inner[0], value)
    if origin is not None and issubclass(origin, Mapping):
        return {key: read_off(inner[1], of) for key, of in value.items()}
    if origin is tuple and inner[-1] is Ellipsis:
        return [read_off(inner[0], of) for of in value]
    if is_dataclass(hint) and isinstance(hint, type):
        hints = get_type_hints(hint, include_extras=True)
        names = [field.name for field in fields(hint)]
        return {n: plain(more[n]) if n in more else read_off(hints[n], getattr(value, n)) for n in names}
    if is_dataclass(value) and not isinstance(value, type):  # a row of numbers
        value = astuple(value)
    return plain(value.item() if hasattr(value, "item") else value)


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


LARGEST_FILE = 64 * 2**20
"""Bytes of the largest file that is read: some 200,000 links."""


LONG_KEY = re.compile(rf"""(?<![\w"'-])[\w"'-]++(?:[ \t]*+\.[ \t]*+[\w"'-]++){{{DEEPEST}}}""")
"""A dotted key of too many parts: the time that the parser takes for one grows with the square of their number."""


def text_of(path: Path, kind: str) -> str:
    """The text of a file that is meant to be of some kind; devices and pipes, which may never end, are refused."""
    try:
        if not path.is_dir() and not stat.S_ISREG(path.stat().st_mode):
            raise FileError(path, "cannot be read: it is no regular file")
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise FileError(path, f"cannot be read: it is larger than {LARGEST_FILE // 2**20} MB")
        text = content.decode("utf-8")
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise FileError(
            path, f"is not a valid {kind} file: line {line}: not in UTF-8; save it in that encoding"
        ) from None
    except ValueError as error:  # a path with a null character
        raise FileError(path, f"cannot be read: {error}") from None
    if text.startswith("\ufeff"):
        raise FileError(
            path, f"is not a valid {kind} file: line 1 begins with a byte-order mark; save it as UTF-8 without one"
        )
    return text


def toml_of(path: Path, text: str) -> dict[str, Any]:
    """The content of TOML; refused with its place where it is none, or where Python or a mechanism cannot hold it."""
    import tomllib

    try:
        long = LONG_KEY.search(text)
        if long:
            raise FileError(path, f"cannot be read: line {text.count(chr(10), 0, long.start()) + 1}: nested too deeply")
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, f"is not valid TOML: {error}") from None
    except (RecursionError, ValueError) as error:
        what = (
            "nested too deeply" if isinstance(error, RecursionError) else "an integer of more digits than can be read"
        )
        raise FileError(path, f"cannot be read: {_place_reached(error)}{what}") from None
    for key, value in data.items():
        fault = _unholdable(value)
        if fault:
            raise FileError(path, f"cannot be read: field {shown(key)}: {fault}")
    return data


def _place_reached(error: BaseException) -> str:
    """The line at which the parser stood, from the variables of its own frames; empty where they cannot be told."""
    import traceback

    line = ""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        source, at = frame.f_locals.get("src"), frame.f_locals.get("pos")
        if isinstance(source, str) and isinstance(at, int):
            line = f"line {source.count(chr(10), 0, at) + 1}: "
    return line


def _unholdable(value: Any) -> str:
    """What keeps a value of a file from being held: deep nesting, or an integer beyond the 64 bits of TOML."""
    level = [value]
    for _ in range(DEEPEST):
        if any(type(item) is int and abs(item) >= 2**63 for item in level):
            return "an integer beyond 64 bits"
        inner = (item.values() if isinstance(item, dict) else item for item in level if isinstance(item, dict | list))
        level = list(itertools.chain.from_iterable(inner))
        if not level:
            return ""
    return f"nested more than {DEEPEST} levels deep"


FORMULA = ("=", "+", "-", "@")
"""Beginnings of a cell that a spreadsheet takes for a formula."""
NUMBER = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?")


def cache_folder() -> Path:
    """Where files are kept that can be made anew: ``MECHGRAPH_CACHE`` where that is set, else ``mechgraph`` in the user's folder for such
    files (``XDG_CACHE_HOME``, ``LOCALAPPDATA`` or ``~/.cache``).
    """
    if os.environ.get("MECHGRAPH_CACHE"):
        return Path(os.environ["MECHGRAPH_CACHE"])
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        if os.environ.get(name):
            return Path(os.environ[name]) / "mechgraph"
    return Path.home() / ".cache" / "mechgraph"


def write_whole(path: str | os.PathLike[str], text: Iterable[str]) -> None:
    """Write a text in UTF-8, piece by piece, whole or not at all (see ``whole_file``).

    What is no regular file (a pipe, a device) is written straight into.

    Raises
    ------
    FileError
        where the file cannot be written.
    """
    target = writable(path)
    with _refused(path):
        if target.exists() and not target.is_file():
            with open(target, "w", encoding="utf-8", newline="", opener=_as_it_is) as handle:
                handle.writelines(text)
            return
    with whole_file(path) as temporary, temporary.open("x", encoding="utf-8", newline="") as handle:
        handle.writelines(text)


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The path of a temporary file, to be made in the block; at its end it takes the place, owner and rights of the target.

    Where the block fails nothing is left and the target stays what it was. A link is followed; into what is no regular file (a pipe, a
    device) the bytes of the temporary file are copied.

    Raises
    ------
    FileError
        where the file cannot be written.
    """
    import tempfile

    target = writable(path)
    regular = not target.exists() or target.is_file()
    folder = target.parent if regular else Path(tempfile.gettempdir())
    temporary = folder / f".mechgraph-{os.urandom(16).hex()}"
    try:
        with _ended_in_order(), _refused(path):
            yield temporary
            if not regular:
                with temporary.open("rb") as made, open(target, "wb", opener=_as_it_is) as handle:
                    shutil.copyfileobj(made, handle)
                return
            if target.exists():
                _take_after(temporary, target.stat())
            os.replace(temporary, target)
    except _Ended:
        temporary.unlink(missing_ok=True)
        os.kill(os.getpid(), signal.SIGTERM)
    finally:
        temporary.unlink(missing_ok=True)


class _Ended(BaseException):
    """The system asks the program to end (SIGTERM)."""


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """What asks the program to end, and would end it at once, ends it when what is in the making is taken away."""

    def ended(*_: Any) -> None:
        raise _Ended

    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if not ours:
        yield
        return
    signal.signal(signal.SIGTERM, ended)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _refused(path: str | os.PathLike[str]) -> Iterator[None]:
    """What the system says about a file as a FileError."""
    try:
        yield
    except (OSError, UnicodeEncodeError) as error:
        raise _cannot(path, error) from None


def writable(path: str | os.PathLike[str]) -> Path:
    """The file that a path names, links followed, where it can be written as far as can be said before.

    Raises
    ------
    FileError
        where it cannot; DeclarationError where this is no path.
    """
    if not isinstance(path, str | os.PathLike):
        raise DeclarationError("write", [f"path = {path!r}: expected a path, as a text or a Path"])
    try:
        found = os.stat(path)
    except FileNotFoundError:
        target = Path(os.path.realpath(path))
        if not target.parent.is_dir():
            raise FileError(path, f"cannot be written: no such folder: {target.parent}") from None
        return target
    except (OSError, ValueError) as error:
        raise _cannot(path, error) from None
    if stat.S_ISDIR(found.st_mode):
        raise FileError(path, "cannot be written: it is a folder; name a file")
    # to the superuser everything is writable: what is marked as read-only is meant so
    if not os.access(path, os.W_OK) or not found.st_mode & 0o222:
        raise FileError(path, "cannot be written: it is read-only")
    return Path(os.path.realpath(path)) if stat.S_ISREG(found.st_mode) else Path(path)


def _as_it_is(path: str, flags: int) -> int:
    """Open what is there, neither made anew nor emptied."""
    return os.open(path, flags & ~(os.O_CREAT | os.O_TRUNC))


def _take_after(made: Path, old: os.stat_result) -> None:
    """Owner, as far as that is allowed, and rights of the file that is replaced."""
    if hasattr(os, "chown"):
        with suppress(OSError):
            os.chown(made, old.st_uid, old.st_gid)
    made.chmod(stat.S_IMODE(old.st_mode))


def _cannot(path: str | os.PathLike[str], error: Exception) -> FileError:
    return FileError(path, f"cannot be written: {getattr(error, 'strerror', None) or error}")


@dataclass(frozen=True)
class Format:
    """A kind of file that something can be written as: what it is called, the ``suffixes`` of its files, and ``write(thing, path, ...)``.

    ``packages`` are needed for it and come with the ``extra`` of that name.
    """

    name: str
    suffixes: tuple[str, ...]
    write: Callable[..., None]
    packages: tuple[str, ...] = ()
    extra: str = ""

    def available(self) -> None:
        """Raise MissingExtraError where a package is missing."""
        for package in self.packages:
            optional(package, self.extra)


def format_of(path: str | os.PathLike[str], formats: Sequence[Format]) -> Format:
    """The format of a path's file extension, whose packages are there; the first where there is none (a pipe, a device).

    Raises
    ------
    FileError
        where no format has that suffix; MissingExtraError, DeclarationError where this is no path.
    """
    if not isinstance(path, str | os.PathLike):
        raise DeclarationError("write", [f"path = {path!r}: expected a path, as a text or a Path"])
    suffix = Path(os.fsdecode(path)).suffix.lower()
    for one in formats:
        if not suffix or suffix in one.suffixes:
            one.available()
            return one
    raise FileError(path, f"unknown file extension {suffix!r}; known: {formats_text(formats)}")


PAGES = (Format("page", (".html", ".htm"), write_whole),)
"""What a report is written as."""


def formats_text(formats: Sequence[Format]) -> str:
    """The suffixes and what they stand for."""
    return ", ".join(f"{' '.join(one.suffixes)} ({one.name})" for one in formats)


def optional(package: str, extra: str) -> Any:
    """A package that is not of the core.

    Raises
    ------
    MissingExtraError
        with the extra that it comes with.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise MissingExtraError(package, extra) from None


def csv_of(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Rows as CSV, below a header unless that is empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    heads = [cell(name) for name in header]
    writer.writerows([heads] if heads else [])
    writer.writerows(rows)
    return buffer.getvalue()


def cell(text: str) -> str:
    """A text that no spreadsheet takes for a formula and no terminal for a command; a number stays what it is."""
    shown = visible(text)
    return f"'{shown}" if shown.startswith(FORMULA) and not NUMBER.fullmatch(shown) else shown
