"""What the commands print with ``--json``, as records, and the JSON Schema of all of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any
from urllib.parse import quote

import mechgraph as mg
from mechgraph.cli.options import write
from mechgraph.determinacy.decomposition import Group
from mechgraph.determinacy.families import Families
from mechgraph.determinacy.findings import Rounding
from mechgraph.determinacy.report import KEYS, AdviceData, schemas
from mechgraph.equations.terms import written
from mechgraph.files import VERSION, Json, json_text, object_schema, patch, plain, read_off, schema_of
from mechgraph.kinetostatics import TransmissionData
from mechgraph.memo import dataclass
from mechgraph.model.toml import to_data
from mechgraph.modes.assemblies import AssembliesData
from mechgraph.modes.branches import BranchesData
from mechgraph.response.respond import ResponseData
from mechgraph.result.over_time import OverTimeData
from mechgraph.result.summary import SolutionData
from mechgraph.synthesis.answers import SynthesesData, SynthesesOverData


@dataclass(frozen=True)
class LibraryItem:
    """A mechanism of the library."""

    name: str
    description: str
    links: tuple[str, ...]
    pairs: Annotated[Mapping[str, str], "symbols of the pair types by the names of the pairs"]


@dataclass(frozen=True)
class ListData:
    """The mechanisms of the library."""

    mechanisms: tuple[LibraryItem, ...]


@dataclass(frozen=True)
class PatchStep:
    """One step of a JSON Patch (RFC 6902)."""

    op: str
    path: str
    value: Any


@dataclass(frozen=True)
class Applicable(AdviceData):
    """An advice, and the change to ``declaration`` that it advises; ``mechgraph save --advice`` makes it, by its number from 0."""

    patch: tuple[PatchStep, ...]


@dataclass(frozen=True)
class UnknownData:
    """An unknown of the force equations; its value at the position asked for, none where it is not unique."""

    name: str
    latex: str
    owner: Annotated[str, "pair or coupling"]
    group: str
    meaning: str
    value: float | None


@dataclass(frozen=True)
class EquationData:
    """One scalar equation."""

    name: str
    owner: str
    text: str
    latex: str


@dataclass(frozen=True)
class BlockData:
    """One vector equation; ``kind``: that of a link, a condition of a pair, a closure, or what it defines."""

    kind: str
    owner: str
    text: str
    latex: str


@dataclass(frozen=True)
class CoefficientData:
    """An entry of the matrix {Q} or of the right side {C} (column 0), in symbols, or as a number at the position asked for."""

    entry: str
    row: int
    column: int
    value: str


@dataclass(frozen=True)
class EquationsData:
    """The equations of a mechanism; with ``--at`` their numbers."""

    mechanism: str
    bookkeeping: str
    sought: str
    unknowns: tuple[UnknownData, ...]
    equations: tuple[EquationData, ...]
    blocks: Annotated[tuple[BlockData, ...], "closure and force equations block by block"]
    coefficients: tuple[CoefficientData, ...]


@dataclass(frozen=True)
class Written:
    """A file that was written."""

    file: str
    rows: int
    columns: int


@dataclass(frozen=True)
class ActingData:
    """Something that acts on a link at a point of it, in the frame of the link."""

    name: str
    kind: Annotated[str, "pair, load, inertia, hold (of a passive body) or support (of the frame)"]
    about: str
    point: tuple[float, float, float]
    distributed: Annotated[bool, "whether it acts on all of the mass, at whose center it stands"]


@dataclass(frozen=True)
class WrenchData:
    """Moment about the point and force, in the frame of the link; no number where it is not unique, unless that of least norm."""

    moment: tuple[float | None, float | None, float | None]
    force: tuple[float | None, float | None, float | None]
    unique: Annotated[tuple[bool, ...], "of the three numbers of the moment, then of the force"]


@dataclass(frozen=True)
class CaseData:
    """All that acts on a link at one position."""

    position: int
    place: Annotated[str, "the values of the drivers"]
    why: Annotated[tuple[str, ...], "what is greatest there"]
    wrenches: Annotated[Mapping[str, WrenchData], "by the name of what acts"]


@dataclass(frozen=True)
class LoadsData:
    """What acts on a link, in balance at every position."""

    mechanism: str
    link: str
    units: Annotated[Mapping[str, str], "names of the units of length, mass and time, where they are declared"]
    balance: Annotated[float | None, "the sum of all, of the largest; none where something is not unique"]
    acting: tuple[ActingData, ...]
    cases: tuple[CaseData, ...]
    written: Annotated[str | None, "the file that was written"]


@dataclass(frozen=True)
class CountsData:
    """Mobility by the counts of the textbooks, loops that are degenerate, and why counts and rank disagree."""

    dobrovolski: int
    apparent: float
    by_apparent: float
    degenerate: tuple[int, ...]
    why: tuple[str, ...]


@dataclass(frozen=True)
class GroupsData:
    """Driver links and structural groups in the order in which they can be solved."""

    symbol: str
    words: str
    drivers: tuple[str, ...]
    groups: tuple[Group, ...]
    free: Annotated[tuple[str, ...], "links that these drivers do not determine"]
    connectivity: Annotated[tuple[tuple[int, str, tuple[str, ...]], ...], "number, name, connected to"]


@dataclass(frozen=True)
class StructureData:
    """Chain, families and groups."""

    mechanism: str
    chain: Annotated[str | None, "usual name of the kinematic chain; none where gears belong to it"]
    inversions: Annotated[tuple[tuple[str, ...], ...], "links that are alike as frame"]
    alike: Annotated[tuple[tuple[str, ...], ...], "pairs that are alike as driver"]
    families: Families
    counts: CountsData
    groups: GroupsData
    by_driver: Annotated[Mapping[str, str], "groups with another driver"]


@dataclass(frozen=True)
class FileData:
    """A mechanism, its page or its picture, that was written as a file."""

    mechanism: str
    file: str


@dataclass(frozen=True)
class PlotData:
    """A picture that was drawn."""

    mechanism: str
    picture: str
    file: str


def check_data(m: mg.Mechanism, report: mg.DeterminacyReport) -> Json:
    """The facts of a report, each advice with the change to the declaration that it advises."""
    facts, declared = report.to_dict(), to_data(m)
    for advice, data in zip(report.advice, facts["advice"], strict=True):
        steps = patch(declared, to_data(advice.apply()))
        data["patch"] = [{"op": step["op"], "path": step["path"], "value": step.get("value")} for step in steps]
    return {"rounding": None, "not_sought": [], **facts, "declaration": declared}


def equations_data(f: mg.Formulation, s: mg.Solution | None) -> EquationsData:
    """Unknowns, equations and coefficients, with numbers where a position is asked for."""
    state = s.state() if s else None
    values = f.solve(state).tolist() if state else [None] * len(f.unknowns)
    rows = f.number_rows(state) if state else f.coefficient_rows()
    blocks = (*f.closure.position, *f.closure.velocity.blocks, *f.closure.acceleration.blocks, *f.blocks)
    return EquationsData(
        f.mechanism.name,
        f.bookkeeping,
        f.sought,
        tuple(
            UnknownData(u.name, u.symbol.latex, u.owner, u.group, u.meaning, value)
            for u, value in zip(f.unknowns, values, strict=True)
        ),
        tuple(
            EquationData(e.name, e.owner, written(f.scalar(e)), written(f.scalar(e), latex=True)) for e in f.equations
        ),
        tuple(BlockData(b.kind, b.owner, b.text, b.latex) for b in blocks),
        tuple(CoefficientData(*row) for row in rows),
    )


def loads_data(body: mg.FreeBody, at: Any, written: str | None) -> Json:
    """What acts on a link at positions."""
    flat = {one.name: (one.wrench.reshape(-1, 6), one.unique.reshape(-1, 6)) for one in body.acting}

    def wrench(name: str, position: int) -> WrenchData:
        values, unique = (part[position].tolist() for part in flat[name])
        return WrenchData(tuple(values[:3]), tuple(values[3:]), tuple(unique))

    cases = [CaseData(*case, {name: wrench(name, case.position) for name in flat}) for case in body.cases(at)]
    m, link = body.mechanism, body.link.name
    found: Json = read_off(
        LoadsData, body, mechanism=m.name, link=link, units=dict(m.units), cases=cases, written=written
    )
    return found


def structure_data(s: mg.Structure) -> Json:
    """Chain, families and groups of a mechanism."""
    chain = (s.identity.name, s.identity.inversions, s.identity.drivers) if s.identity else (None, (), ())
    named = dict(zip(("chain", "inversions", "alike"), chain, strict=True)) | {"mechanism": s.report.mechanism.name}
    counts = read_off(CountsData, s.families)
    found: Json = read_off(StructureData, s, **named, counts=counts, by_driver=s.report.groups_by_driver)
    return found


def write_json(command: str, data: Any, **more: Any) -> None:
    """The record of a command on standard output."""
    write(json_text({"schema": VERSION, "command": command, **plain(data), **more}))


def tell_file(command: str, data: FileData | PlotData, json: bool, more: str = "") -> None:
    """That a file was written."""
    if json:
        write_json(command, data)
    else:
        write(f"Wrote {data.file}{more}.\n")


def _record(kind: type, **more: Any) -> Callable[[Json], Json]:
    """The schema of a record, with more fields."""

    def schema(defs: Json) -> Json:
        schema_of(kind, defs)
        made = defs.pop(kind.__name__)
        return object_schema(made["description"], made["properties"] | {k: schema_of(h, defs) for k, h in more.items()})

    return schema


def _check(defs: Json) -> Json:
    properties = {"rounding": schema_of(Annotated[Rounding | None, "a tolerance that would change the verdict"], defs)}
    words = "what was not looked for to the end, in sentences"
    properties["not_sought"] = schema_of(Annotated[tuple[str, ...], words], defs)
    properties |= schemas(KEYS, defs)
    properties["advice"] = schema_of(Annotated[tuple[Applicable, ...], "what would help, the best first"], defs)
    words = "the mechanism as its file holds it (see mechanism.schema.json), which the patches of the advice change"
    properties["declaration"] = {"description": words, "type": "object"}
    return object_schema("The facts of the determinacy report.", properties)


COMMANDS: dict[str, Callable[[Json], Json]] = {
    "list": _record(ListData),
    "check": _check,
    "equations": _record(EquationsData),
    "solve": _record(
        SolutionData,
        over_time=OverTimeData | None,
        transmission=Annotated[tuple[TransmissionData, ...], "of the outputs that were named"],
        written=Written | None,
    ),
    "respond": _record(ResponseData, over_time=OverTimeData | None, written=Written | None),
    "save": _record(FileData),
    "compile": _record(FileData),
    "report": _record(FileData),
    "loads": _record(LoadsData),
    "plot": _record(PlotData),
    "structure": _record(StructureData),
    "assemblies": _record(AssembliesData, file=Annotated[str | None, "the picture that was drawn"]),
    "synthesize": _record(SynthesesData, file=Annotated[str | None, "the picture that was drawn"]),
    "branches": _record(BranchesData, file=Annotated[str | None, "the picture that was drawn"]),
}
"""The schema of what every command prints."""
SWEPT = {
    "synthesize, swept": _record(SynthesesOverData, file=Annotated[str | None, "the picture that was drawn"]),
}
"""The same where the mechanism holds a sweep."""


def output_schema() -> Json:
    """The JSON Schema (draft 2020-12) of all that is printed with ``--json``."""
    defs: Json = {}
    kinds = {}
    for name, make in (COMMANDS | SWEPT).items():
        made = make(defs)
        first = {"schema": {"const": VERSION}, "command": {"const": name.partition(",")[0]}}
        kinds[f"command {name}"] = object_schema(made["description"], first | made["properties"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "output.schema.json",
        "title": "what mechgraph prints with --json",
        "oneOf": [{"$ref": f"#/$defs/{quote(kind)}"} for kind in kinds],
        "$defs": kinds | defs,
    }
