"""Files that are read: their text, and the data of TOML, with limits on what a file may ask for."""

from __future__ import annotations

import itertools
import re
import stat
import tomllib
import traceback
from pathlib import Path
from typing import Any

from mechgraph.errors import FileError
from mechgraph.quantities import shown

LARGEST_FILE = 64 * 2**20
"""Bytes of the largest file that is read: some 200,000 links."""
DEEPEST = 32
"""Tables and lists of a file may stand in each other so deeply; a mechanism needs six."""


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
        raise FileError(path, f"is no {kind}: line {line}: not in UTF-8; save it in that encoding") from None
    except ValueError as error:  # a path with a null character
        raise FileError(path, f"cannot be read: {error}") from None
    if text.startswith("\ufeff"):
        raise FileError(path, f"is no {kind}: line 1 begins with a byte-order mark; save it as UTF-8 without one")
    return text


def toml_of(path: Path, text: str) -> dict[str, Any]:
    """The content of TOML; refused with its place where it is none, or where Python or a mechanism cannot hold it."""
    try:
        long = LONG_KEY.search(text)
        if long:
            raise FileError(path, f"cannot be read: line {text.count(chr(10), 0, long.start()) + 1}: nested too deeply")
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, f"is no TOML: {error}") from None
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
