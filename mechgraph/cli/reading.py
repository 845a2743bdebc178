"""Mechanisms by the name or file that was typed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import mechgraph as mg
from mechgraph.cli.output import show, write
from mechgraph.errors import did_you_mean, near_names
from mechgraph.exchange.comparison import compare
from mechgraph.exchange.files import READERS
from mechgraph.typed import refuse
from mechgraph.writing import Format, format_of, writable


def loaded(name: str) -> mg.Mechanism:
    """A mechanism of the library, else of a file; an unknown name is answered with its near matches."""
    known = mg.library()
    if name in known:
        return mg.load(name)
    path = Path(name)
    if os.path.lexists(path) or path.suffix.lower() in (".toml", *READERS) or len(path.parts) > 1:
        return mg.load(path)
    hint = did_you_mean(near_names(name.lower(), known)) or f"there are: {', '.join(known)}"
    raise mg.FileError(name, f"no mechanism of that name in the library, and no such file; {hint}")


def refuse_own_file(out: Path, mechanism: str) -> None:
    """Let no output take the place of the file that the mechanism is read from."""
    if writable(out).exists() and os.path.lexists(mechanism) and out.samefile(mechanism):
        refuse(f"--out {str(out)!r}", "is the file of the mechanism; name another")


def check_out(out: Path | None, mechanism: str, formats: Sequence[Format]) -> None:
    """Refuse an output that no format takes, or that is the file of the mechanism, before anything is computed."""
    if out is not None:
        refuse_own_file(out, mechanism)
        format_of(out, formats)


def show_compared(mechanism: str) -> None:
    """What FreeCAD stored beside what comes out here, below a report or summary."""
    if Path(mechanism).suffix.lower() != ".asmt":
        refuse(f"--compare {mechanism!r}", "is no FreeCAD assembly (.asmt)")
    write("\n")
    show(compare(mechanism).document())
