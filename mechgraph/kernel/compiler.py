"""Any C compiler of the machine, and the kernel as a library made by it.

Nothing but the standard library is used: ``hatch_build.py`` runs this file before the package is installed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

SOURCES = tuple(Path(__file__).with_name(name) for name in ("calls.c", "derivative.c"))
"""What is compiled."""
INCLUDED = tuple(Path(__file__).with_name(name) for name in ("kernel.c", "kernel.h", "motion.c"))
"""What that includes, and written controllers too."""
TRACKS = Path(__file__).with_name("tracks.c")
"""What derivatives include beside it."""
FLAGS = ("-O3", "-std=c99", "-ffp-contract=off", "-shared", "-fPIC")
"""No -march and no -ffast-math: the same bits from one build, and from one source the same on every machine to rounding."""
LONGEST_BUILD = 600.0
"""Seconds that a compiler may take; one that brings its own C library makes that first."""


def compilers() -> list[list[str]]:
    """The commands of C compilers found here, the one that ``CC`` names first; running none of them."""
    import shlex

    named = shlex.split(os.environ.get("CC", ""), posix=os.name != "nt")
    commands = [named, ["cc"], ["gcc"], ["clang"]]
    found = [[path, *command[1:]] for command in commands if command and (path := shutil.which(command[0]))]
    if importlib.util.find_spec("ziglang"):
        found.append([sys.executable, "-m", "ziglang", "cc"])
    return found


def flags(target: str = "") -> list[str]:
    """The options of a build for this machine, or for a ``target`` of zig."""
    options = [flag for flag in FLAGS if flag != "-fPIC" or suffix(target) != ".dll"]
    return [*options, "-target", target] if target else options


def suffix(target: str = "") -> str:
    """How the name of a library ends on this machine, or on a ``target`` of zig."""
    system = target or sys.platform
    return (
        ".dll"
        if "windows" in system or system == "win32"
        else ".dylib"
        if "macos" in system or system == "darwin"
        else ".so"
    )


def key() -> str:
    """What a library is made of: the texts of the kernel, and the options."""
    return _digest(*(file.read_bytes() for file in (*SOURCES, *INCLUDED, TRACKS)), " ".join(FLAGS).encode())


def platform() -> str:
    """The key of the machine that a library is made for."""
    return _digest(sysconfig.get_platform().encode(), str(sysconfig.get_config_var("MULTIARCH")).encode())


def version(command: Sequence[str]) -> str:
    """A key of a compiler: its command and what it says of its version."""
    said = subprocess.run([*command, "--version"], capture_output=True, timeout=LONGEST_BUILD, check=False)
    return _digest("\n".join(command).encode(), said.stdout)


def compile_library(command: Sequence[str], target: Path, made_for: str = "", sources: Sequence[Path] = ()) -> None:
    """Compile the kernel, or other ``sources``, beside ``target``, then rename it.

    Raises
    ------
    OSError, subprocess.SubprocessError
        where the compiler cannot be run or refuses; CalledProcessError carries what it says.
    """
    with tempfile.TemporaryDirectory(prefix=".kernel-", dir=target.parent) as folder:
        made = Path(folder) / target.name
        line = [*command, *flags(made_for), "-o", os.fspath(made), *map(os.fspath, sources or SOURCES), "-lm"]
        own = {"ZIG_GLOBAL_CACHE_DIR": folder, "ZIG_LOCAL_CACHE_DIR": folder}
        subprocess.run(
            line, env=own | os.environ, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            timeout=LONGEST_BUILD, check=True,
        )  # fmt: skip
        os.replace(made, target)


def refusal(command: Sequence[str], error: Exception) -> str:
    """Why a compiler did not build the kernel, in a line: its name and what it says of the first error."""
    said = getattr(error, "stderr", None) or str(error)
    lines = [line for line in str(said).splitlines() if line.strip()] or ["no reason given"]
    return f"{Path(command[0]).name}: {next((line for line in lines if 'error' in line), lines[0])}"


def _digest(*parts: bytes) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(len(part).to_bytes(8, "little") + part)
    return found.hexdigest()[:20]
