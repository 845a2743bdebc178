"""Where a page comes from: version, the declaration and its hash, and how it was solved."""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Iterator

import numpy as np

from mechgraph.document import Document, Table
from mechgraph.errors import FileError
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.toml import written
from mechgraph.report.report import DeterminacyReport
from mechgraph.result.solution import Solution
from mechgraph.variants.result import Study


def version() -> str:
    """The version of this program."""
    try:
        return importlib.metadata.version("mechgraph")
    except importlib.metadata.PackageNotFoundError:
        return "(not installed)"


def declaration(m: Mechanism) -> str:
    """The declaration as TOML; empty where it holds functions, which no file can hold."""
    try:
        return written(m)
    except FileError:
        return ""


def provenance(m: Mechanism, report: DeterminacyReport, s: Solution | None, study: Study | None) -> Document:
    """One table: program, mechanism, options."""
    return Document("", (Table(("what", "value"), tuple(row for row in _rows(m, report, s, study) if row[1])),))


def _rows(
    m: Mechanism, report: DeterminacyReport, s: Solution | None, study: Study | None
) -> Iterator[tuple[str, str]]:
    text = declaration(m)
    yield "program", f"mechgraph {version()}, numpy {np.__version__}"
    yield "mechanism", m.name
    yield "source", m.source
    yield (
        "SHA-256 of the declaration",
        hashlib.sha256(text.encode()).hexdigest() if text else "none: it holds functions",
    )
    yield "units", ", ".join(f"{base} {unit}" for base, unit in m.units.items()) or "none declared: any consistent set"
    yield "engine of the report", report.engine or "none: graph alone"
    if s is not None:
        yield "prescribed", ", ".join(s.prescribed) or "nothing"
        yield "unknown efforts", ", ".join(s.actuated) or "none"
        yield "positions", str(np.asarray(s.status).size)
        yield "engine and method", f"{s.engine}, {s.method or 'motion alone'}"
    if study is not None:
        yield "study", repr(study)
