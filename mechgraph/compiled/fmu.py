"""What a mechanism in the tables is written as: C, or a functional mock-up unit for co-simulation by FMI 2.0.

Of a unit, motion of the drives goes in, and efforts, positions and reactions come out. The equations are those of kinetostatics: what is
set as ``q``, ``v``, ``a`` of the drives holds when the step ends. Or efforts of the drives go in, held over a step, and the unit
integrates the motion that they produce.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Literal, NamedTuple, get_args
from xml.sax.saxutils import quoteattr

from mechgraph.compiled.tabled import STATUSES, Tabled, header_text, identifier, source_text, write_c
from mechgraph.errors import DeclarationError, visible
from mechgraph.files import Format, format_of, whole_file, write_whole
from mechgraph.kernel import build, compiler
from mechgraph.kernel.tables import HEAD_RUBS
from mechgraph.quantities import option_faults, unit_of

SLAVE = Path(__file__).with_name("fmu.c")
COMPONENTS = ("Mx", "My", "Mz", "Fx", "Fy", "Fz")
LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""Date of all files: the same mechanism gives the same unit."""
SYSTEMS = {"win32": "win", "darwin": "darwin"}


class Variable(NamedTuple):
    """A real variable: its name, unit, the value at which it starts where it is set, and what it is then."""

    name: str
    unit: str
    start: float | None = None
    causality: str = "input"


def write_fmu(tables: Tabled, path: str | os.PathLike[str], name: str | None = None) -> None:
    """Write a unit for this platform, with its sources for others; ``name`` as of ``write_c``.

    Raises
    ------
    DeclarationError
        where ``name`` is no identifier of C; MissingExtraError where no C compiler builds it, FileError where it cannot be written.
    """
    name = identifier(Path(path).stem if name is None else name)
    sources = {"model.h": header_text(tables, "model"), "model.c": source_text(tables, "model", "model.h")}
    whole = "\n".join([*sources.values(), SLAVE.read_text(encoding="utf-8"), name])
    guid = "{" + hashlib.sha256(whole.encode()).hexdigest()[:32] + "}"
    sources["fmu.c"] = _slave(tables, guid)
    with tempfile.TemporaryDirectory() as folder:
        for file, text in sources.items():
            write_whole(Path(folder) / file, [text])
        library = Path(folder) / f"{name}{compiler.suffix()}"
        _compiled(library, [Path(folder) / "model.c", Path(folder) / "fmu.c"])
        parts = {
            "modelDescription.xml": description(tables, name, guid).encode(),
            f"binaries/{_system()}/{library.name}": library.read_bytes(),
            **{f"sources/{file}": text.encode() for file, text in sources.items()},
        }
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "x", zipfile.ZIP_DEFLATED) as archive:
        for file, content in parts.items():
            archive.writestr(zipfile.ZipInfo(file, LONG_AGO), content, zipfile.ZIP_DEFLATED)


def variables(tables: Tabled) -> tuple[list[Variable], list[Variable]]:
    """What is set, inputs before parameters, and outputs, in the order of their value references."""
    m = tables.m

    def unit(full: str, order: int = 0) -> str:
        return unit_of(m.units, (0 if m.turns(full) else 1, 0, -order))

    inputs = [
        Variable(f"{full}.{kind}", unit(full, order), float(tables.home[i]) if kind == "q" else 0.0)
        for order, kind in enumerate("qva")
        for i, full in enumerate(tables.drives)
    ]
    efforts = [Variable(f"{f}.effort", unit_of(m.units, (2 if m.turns(f) else 1, 1, -2))) for f in tables.drives]
    if tables.efforts:
        rates = [Variable(f"{f}.velocity.start", unit(f, 1), 0.0, "parameter") for f in tables.drives]
        inputs = [*(effort._replace(start=0.0) for effort in efforts), *rates]
        efforts = []
    positions = [Variable(f"{full}.position", unit(full)) for full in m.freedom_names()]
    wrench = [(part, unit_of(m.units, (2 if part.startswith("M") else 1, 1, -2))) for part in COMPONENTS]
    reactions = [Variable(f"{p.name}.reaction.{part}", unit) for p in m.pairs for part, unit in wrench]
    velocities = [Variable(f"{full}.velocity", unit(full, 1)) for full in m.freedom_names() if tables.efforts]
    return inputs, [*efforts, *positions, *velocities, *reactions]


def description(tables: Tabled, name: str, guid: str) -> str:
    """``modelDescription.xml``."""
    inputs, outputs = variables(tables)
    units = sorted({v.unit for v in (*inputs, *outputs) if v.unit})
    about = {
        "fmiVersion": "2.0", "modelName": visible(tables.m.name), "guid": guid, "description": visible(tables.m.description),
        "generationTool": f"mechgraph {version('mechgraph')}", "variableNamingConvention": "flat", "numberOfEventIndicators": "0",
    }  # fmt: skip
    lines = [f"<fmiModelDescription{_attributes(about)}>"]
    slave = {"modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true", "canGetAndSetFMUstate": "true"}
    files = '<SourceFiles><File name="model.c"/><File name="fmu.c"/></SourceFiles>'
    lines += [f"<CoSimulation{_attributes(slave)}>", files, "</CoSimulation>"]
    if units:
        lines += [
            "<UnitDefinitions>",
            *(f"<Unit{_attributes({'name': unit})}/>" for unit in units),
            "</UnitDefinitions>",
        ]
    lines += ["<ModelVariables>", *_scalars(inputs, outputs), "</ModelVariables>", "<ModelStructure>"]
    unknown = [f'<Unknown index="{i}"/>' for i in range(len(inputs) + 1, len(inputs) + len(outputs) + 2)]
    lines += [
        "<Outputs>",
        *unknown,
        "</Outputs>",
        "<InitialUnknowns>",
        *unknown,
        "</InitialUnknowns>",
        "</ModelStructure>",
    ]
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *lines, "</fmiModelDescription>", ""])


def _scalars(inputs: list[Variable], outputs: list[Variable]) -> Iterator[str]:
    for i, v in enumerate([*inputs, *outputs]):
        known = {"name": visible(v.name), "valueReference": str(i), "variability": "continuous"}
        known |= {"causality": "output", "initial": "calculated"} if v.start is None else {"causality": v.causality}
        known |= {"variability": "fixed", "initial": "exact"} if v.causality == "parameter" else {}
        real = {"unit": v.unit} if v.unit else {}
        real |= {} if v.start is None else {"start": repr(v.start)}
        yield f"<ScalarVariable{_attributes(known)}><Real{_attributes(real)}/></ScalarVariable>"
    meanings = "; ".join(f"{i}: {meaning}" for i, (_, _, meaning) in enumerate(STATUSES))
    known = {
        "name": "status",
        "valueReference": "0",
        "variability": "discrete",
        "causality": "output",
        "initial": "calculated",
    }
    yield f"<ScalarVariable{_attributes(known | {'description': meanings})}><Integer/></ScalarVariable>"


def _attributes(values: dict[str, str]) -> str:
    return "".join(f" {key}={quoteattr(value)}" for key, value in values.items())


def _slave(tables: Tabled, guid: str) -> str:
    """The slave's source with what belongs to this mechanism."""
    starts = ", ".join(repr(v.start) for v in variables(tables)[0])
    meanings = ", ".join(f'"{meaning}"' for _, _, meaning in STATUSES)
    text = SLAVE.read_text(encoding="utf-8")
    text = text.replace("@EFFORTS@", str(int(tables.efforts)))
    return text.replace("@GUID@", guid).replace("@START@", starts).replace("@MEANING@", meanings)


def _compiled(library: Path, sources: list[Path]) -> None:
    refused = []
    for command in compiler.compilers():
        try:
            compiler.compile_library(command, library, sources=sources)
            return
        except (OSError, subprocess.SubprocessError) as error:
            refused.append(compiler.refusal(command, error))
    raise build.missing(refused)


def _system() -> str:
    """The folder of the binary: of FMI 2.0 where that names one."""
    machine = platform.machine().lower()
    if machine in ("x86_64", "amd64"):
        return f"{SYSTEMS.get(sys.platform, 'linux')}64"
    return f"{machine}-{SYSTEMS.get(sys.platform, 'linux')}"


WRITTEN = (
    Format("C99, with a header beside it", (".c",), write_c),
    Format("FMI 2.0 for co-simulation", (".fmu",), write_fmu),
)


InputsName = Literal["motion", "efforts"]
"""What is given of the drives."""


def write_tables(
    tables: Tabled, path: str | os.PathLike[str], name: str | None = None, inputs: InputsName = "motion"
) -> None:
    """Write the mechanism as the suffix of ``path`` says; symbols begin with ``name``, else with the name of the file.

    Raises
    ------
    DeclarationError
        where ``name`` is no identifier of C, ``inputs`` no such word, or efforts are given and there are passive freedoms, which nothing
        would hold, or dry friction; FileError; MissingExtraError for a unit where there is no C compiler.
    """
    faults = option_faults({"inputs": (inputs, get_args(InputsName))})
    if inputs == "efforts" and tables.layout.shapes["holds"][0]:
        faults.append(
            "inputs = 'efforts': there are passive freedoms, which no motion under efforts holds; use inputs='motion', or mg.respond"
        )
    if inputs == "efforts" and tables.I[HEAD_RUBS]:
        faults.append(
            "inputs = 'efforts': dry friction holds freedoms and lets them go; use inputs='motion', or mg.respond"
        )
    if faults:
        raise DeclarationError(f"write {tables.m.name!r}", faults)
    format_of(path, WRITTEN).write(tables.under_efforts() if inputs == "efforts" else tables, path, name)
