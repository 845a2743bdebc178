"""The one place that writes files: whole or not at all, and never in place of what is no file. Cells of tables for spreadsheets."""

from __future__ import annotations

import csv
import io
import os
import re
import stat
import uuid
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from mechgraph.errors import DeclarationError, FileError, visible

FORMULA = ("=", "+", "-", "@")
"""Beginnings of a cell that a spreadsheet takes for a formula."""
NUMBER = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?")


def write_whole(path: str | os.PathLike[str], text: Iterable[str]) -> None:
    """Write a text in UTF-8, piece by piece, into a temporary file beside the target that takes its place, owner and rights at the end.

    A link is followed. What is no regular file (a pipe, a device) is written straight into.

    Raises
    ------
    FileError
        where the file cannot be written.
    """
    target, temporary = writable(path), None
    try:
        if target.exists() and not target.is_file():
            with open(target, "w", encoding="utf-8", newline="", opener=_as_it_is) as handle:
                handle.writelines(text)
            return
        temporary = target.with_name(f".mechgraph-{uuid.uuid4().hex}")
        with temporary.open("x", encoding="utf-8", newline="") as handle:
            handle.writelines(text)
        if target.exists():
            _take_after(temporary, target.stat())
        os.replace(temporary, target)
    except (OSError, UnicodeEncodeError) as error:
        raise _cannot(path, error) from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


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
            raise FileError(path, f"cannot be written: there is no folder {target.parent}") from None
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
