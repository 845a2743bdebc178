"""The compiled kernel: the library that came with the package or was built on request, loaded.

A library that was built on request lies in the folder ``kernel`` of the cache (``writing.cache_folder``). Code is loaded from there only
where folder and file belong to the user and nobody else may write to them. A name holds the key of the kernel's text, options and
platform, and that of the compiler: what was made of an older text is not found.
"""

from __future__ import annotations

import ctypes
import os
import stat
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from mechgraph.errors import DeclarationError, FileError, MissingExtraError
from mechgraph.files import cache_folder
from mechgraph.kernel import compiler

PACKAGED = Path(__file__).parent
"""Where an installation puts its library."""
NEEDED = "a C compiler"


def not_served(call: str, why: str) -> DeclarationError:
    """What is said where the kernel was asked for by name and does not serve a call."""
    return DeclarationError(call, [f"engine 'compiled' does not serve: {why}. Use engine='auto'"])


@cache
def installed() -> ctypes.CDLL | None:
    """The kernel as it was installed, or built by an earlier request; None where there is none. No compiler is run.

    Of several in the cache the one built last.
    """
    files = [file for file in [PACKAGED / f"kernel-{compiler.key()}{compiler.suffix()}"] if file.is_file()]
    folder = cache_folder() / "kernel"
    if folder.is_dir() and not doubt(folder):
        found = [file for file in folder.glob(_name("*")) if not doubt(file)]
        files += sorted(found, key=lambda file: (file.stat().st_mtime_ns, file.name), reverse=True)
    for file in files:
        try:
            return ctypes.CDLL(os.fspath(file))
        except OSError:
            continue
    return None


def built() -> ctypes.CDLL:
    """The kernel, built into the cache where it is not there yet, by the first compiler that does.

    Raises
    ------
    MissingExtraError
        where no compiler is found, or none builds it: the extra ``fast`` brings one.
    FileError
        where the folder of the cache cannot be made, or is not the user's alone.
    """
    library = installed()
    if library is not None:
        return library
    folder = _own_folder()
    refused = []
    for command in compiler.compilers():
        try:
            file = folder / _name(compiler.version(command))
            compiler.compile_library(command, file)
            library = ctypes.CDLL(os.fspath(file))
        except (OSError, subprocess.SubprocessError) as error:
            refused.append(compiler.refusal(command, error))
            continue
        installed.cache_clear()
        return library
    raise missing(refused)


def missing(refused: Sequence[str]) -> MissingExtraError:
    """The error where there is no C compiler, or where all those that there are have ``refused``."""
    return MissingExtraError(f"{NEEDED} that builds the kernel ({'; '.join(refused)})" if refused else NEEDED, "fast")


def _name(compiled_by: str) -> str:
    """Of a library in the cache."""
    return f"kernel-{compiler.key()}-{compiler.platform()}-{compiled_by}{compiler.suffix()}"


def _own_folder() -> Path:
    folder = cache_folder() / "kernel"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            folder, f"the kernel cannot be built here: {error.strerror}; name a folder in MECHGRAPH_CACHE"
        ) from None
    found = doubt(folder)
    if found:
        raise FileError(folder, f"the kernel is not built here: {found}; name a folder of your own in MECHGRAPH_CACHE")
    return folder


def doubt(path: Path) -> str:
    """Why code is not loaded from a folder or file of the cache; nothing where it is the user's alone.

    It belongs to the user and nobody else may write to it; and nobody but the superuser and the user can put another one in its place.
    (On Windows the rights of the user's own folder are trusted.)
    """
    if not hasattr(os, "geteuid"):
        return ""
    here, *above = [path.resolve(), *path.resolve().parents]
    found = here.stat()
    if found.st_uid != os.geteuid():
        return f"{here} belongs to another user"
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others may write to {here}"
    for folder in above:
        found = folder.stat()
        shared = found.st_mode & stat.S_IWOTH or (found.st_mode & stat.S_IWGRP and found.st_gid != os.getegid())
        if found.st_uid not in {0, os.geteuid()} or (shared and not found.st_mode & stat.S_ISVTX):
            return f"others may put another folder in the place of one in {folder}"
    return ""
