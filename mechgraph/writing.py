"""The one place that writes files: whole or not at all, and never in place of what is no file. Formats by suffix; cells of tables."""

from __future__ import annotations

import csv
import importlib
import io
import os
import re
import shutil
import signal
import stat
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mechgraph.errors import DeclarationError, FileError, MissingExtraError, visible

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
    target = writable(path)
    regular = not target.exists() or target.is_file()
    folder = target.parent if regular else Path(tempfile.gettempdir())
    temporary = folder / f".mechgraph-{uuid.uuid4().hex}"
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
    """The format that the suffix of a path says, whose packages are there; the first where there is no suffix (a pipe, a device).

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
    raise FileError(path, f"the suffix says how a file is written; known: {formats_text(formats)}")


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
