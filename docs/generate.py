"""Pages of the reference that the program itself tells: public names, command line, file format, two sources.

``conf.py`` calls ``write`` before a build; what it writes is not kept in the repository.
"""

import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer.main

import mechgraph as mg
from mechgraph import show
from mechgraph.cli.commands import app

ROOT = Path(__file__).resolve().parents[1]
PARTS = (
    *("Parts", "bearings", "cardan_shaft", "cylinder", "four_bar", "gear_stage", "planetary", "rack_and_pinion", "rod"),
    *("screw_drive", "slider_crank", "spring_strut"),
)
"""Public names of the catalogue of parts."""
GROUPS: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "declare": (
        "Declare a mechanism",
        "Links, pairs, pair types, motions, couplings and gears, curves and surfaces; library and files.",
        (
            *(
                "Mechanism",
                "Link",
                "Pair",
                "Marker",
                "Drive",
                "Motion",
                "chain",
                "load",
                "save",
                "library",
                "pair_types",
            ),
            *(
                "PairType",
                "Freedom",
                "Component",
                "Bookkeeping",
                "Coupling",
                "SpurGears",
                "BevelGears",
                "WormGear",
                "Rack",
            ),
            *("Gear", "GearRack", "BevelGear", "Worm", "WormWheel", "Mesh", "mesh_facts", "planet_places"),
            *("Belt", "Pulley", "BeltDrive", "Curve", "CamLaw", "Segment", "cam_laws", "least_base_radius"),
            *("least_preload", "Surface", "Hertz", "Journal", "Stiffness", "Misfit"),
            *(f"inertia.{name}" for name in ("rod", "box", "cylinder", "sphere", "from_components")),
            *(f"parts.{name}" for name in PARTS),
        ),
    ),
    "loads": (
        "Loads and events",
        "What acts on links and in freedoms, and what is watched in time.",
        (
            *("Gravity", "Wrench", "Effort", "Spring", "TorsionSpring", "Damper", "ForceLaw", "ForceTable", "Friction"),
            *("Event", "Stop", "ResponseSetup"),
        ),
    ),
    "check": ("Check", "Mobility, redundancy, determinacy.", ("check", "DeterminacyReport", "Tolerances")),
    "equations": ("Equations", "The printed equations, which are the solved ones.", ("formulate", "Formulation")),
    "solve": (
        "Solve",
        "Motion and forces for prescribed drivers, and what is made of them.",
        (
            *("solve", "kinematics", "assemble", "Solution", "transmission", "Transmission", "free_body", "FreeBody"),
            *("over_time", "OverTime", "write_report", "compile", "Compiled"),
        ),
    ),
    "dynamics": ("Forward dynamics", "Motion under given loads.", ("respond", "Response", "equilibrium", "linearize")),
    "assemblies": (
        "Assembly modes",
        "All ways to close the loops, and how they are connected.",
        ("assemblies", "Assemblies", "AssembliesOver", "branches", "Branches"),
    ),
    "synthesis": (
        "Synthesis",
        "Dimensions of a declared topology that do what is asked.",
        ("synthesize", "Syntheses", "SynthesesOver", "function", "path", "poses", "positions", "SynthesisSetup"),
    ),
    "structure": (
        "Structure",
        "Kinematic chains, families, structural groups.",
        (
            *(
                "structure",
                "Structure",
                "groups",
                "Decomposition",
                "Group",
                "Families",
                "atlas",
                "identify",
                "Identity",
            ),
            *(
                "Chain",
                "MultipleJoint",
                "multiple_joints",
                "split_joint",
                "SystemGroup",
                "system_groups",
                "save_chains",
            ),
            "load_chains",
        ),
    ),
    "study": ("Study", "Many variants of one mechanism.", ("study", "Study")),
    "pictures": (
        "Pictures",
        "Module `mechgraph.show`; needs the `plot` extra.",
        tuple(f"show.{n}" for n in show.__all__),
    ),
    "errors": (
        "Errors",
        "All derive from `MechgraphError`.",
        (
            *("MechgraphError", "DeclarationError", "FileError", "ContentError", "AssemblyError", "ReachError"),
            *(
                "DeadPointError",
                "FrictionError",
                "IndeterminateError",
                "ResponseError",
                "ShapeError",
                "StudyError",
                "MissingExtraError",
            ),
            "MechgraphWarning",
        ),
    ),
}
"""Public names by what they are for: title, a sentence, names."""
BY_NAME = {'s["A"]': "a pair", 's.link("crank")': "a link", "s.load(0)": "a load"}
"""What a solution hands out, and of what."""
SECTION = re.compile(r"^ *(Parameters|Returns|Examples)\n *---", re.MULTILINE)
RETURNED = re.compile(r"(Returned|Yielded) by ``|Part of ``|Attribute ``")
LINK = re.compile(r"\[([^\]]+)\]\((?!https?:|#)([^)#]+)[^)]*\)")
SOURCES = ("lee-1977.md", "higher-pairs.md")


def write(folder: Path) -> None:
    """Write all pages into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in {**api(), **by_name(), "cli": command_line(), **library()}.items():
        _put(folder / f"{name}.md", text)


def _put(path: Path, text: str) -> None:
    """Write a page, but for one that is there already, so that it is not built again."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


# --- public names ------------------------------------------------------------------------------------------------------


def listed() -> set[str]:
    """The names that stand in a group."""
    return {name for _, _, names in GROUPS.values() for name in names}


def thing(name: str) -> Any:
    """What a name of a group stands for."""
    found: Any = show if name.startswith("show.") else mg
    for part in name.removeprefix("show.").split("."):
        found = getattr(found, part)
    return found


def page_of(name: str) -> str:
    """The page of a name: ``study`` and ``Study`` are one file where letters of both sizes count as the same."""
    return f"{'class' if inspect.isclass(thing(name)) else 'api'}-{name}"


def first_sentence(doc: str) -> str:
    return doc.partition("\n\n")[0].replace("\n", " ").replace("``", "`").replace("|", "\\|")


def api() -> dict[str, str]:
    """A page for every group and for every public name."""
    pages = {}
    for key, (title, words, names) in GROUPS.items():
        rows = [f"| [`{n}`]({page_of(n)}.md) | {first_sentence(inspect.getdoc(thing(n)) or '')} |" for n in names]
        tree = "\n".join(map(page_of, names))
        pages[f"group-{key}"] = (
            f"# {title}\n\n{words}\n\n| name | what it does |\n|---|---|\n" + "\n".join(rows) + "\n\n"
            f"```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
        )
        for name in names:
            pages[page_of(name)] = f"# {name}\n\n{directive(thing(name), f'mechgraph.{name}')}"
    return pages


def directive(found: Any, path: str) -> str:
    """What lets Sphinx show the docstring of a function, or of a class with what users call of it."""
    if not inspect.isclass(found):
        return f"```{{eval-rst}}\n.. autofunction:: {path}\n```\n"
    members = ", ".join(members_of(found))
    return f"```{{eval-rst}}\n.. autoclass:: {path}\n" + (f"   :members: {members}\n" if members else "") + "```\n"


def members_of(cls: type) -> list[str]:
    """Methods that have sections; of what users get from a call, all that is public."""
    every = bool(RETURNED.search(inspect.getdoc(cls) or "")) and not issubclass(cls, Exception)
    found = []
    for name in vars(cls):
        member = getattr(inspect.getattr_static(cls, name), "__func__", inspect.getattr_static(cls, name))
        doc = getattr(member, "__doc__", None) or ""
        called = inspect.isroutine(inspect.unwrap(member)) if callable(member) else False
        if (name == "__call__" or not name.startswith("_")) and doc and not inspect.isclass(member):
            if SECTION.search(doc) or (every and not called and not isinstance(member, str | int | tuple | dict)):
                found.append(name)
    return found


def by_name() -> dict[str, str]:
    """What a solution hands out of pairs, links and loads."""
    s = mg.solve(mg.load("four-bar"), {"A": 0.0})
    given = [s["A"], s.link("crank"), s.load(0)]
    parts = []
    for (spelled, of), value in zip(BY_NAME.items(), given, strict=True):
        rows = []
        for name in vars(type(value)):
            member = inspect.getattr_static(value, name)
            if not name.startswith("_") and name != "document" and getattr(member, "__doc__", None):
                rows.append(f"| `{name}` | {first_sentence(inspect.cleandoc(member.__doc__))} |")
        table = "| name | what it is |\n|---|---|\n" + "\n".join(rows) if rows else inspect.getdoc(type(value)) or ""
        parts.append(f"## `{spelled}`: {of}\n\n{table.replace('``', '`')}\n")
    text = "# Values by name\n\nWhat a solution `s` holds of one pair, link or load. Leading axes are positions.\n\n"
    return {"values": text + "\n".join(parts)}


# --- the command line --------------------------------------------------------------------------------------------------


def command_line() -> str:
    """Every command with its arguments and options, as the program knows them."""
    program = typer.main.get_command(app)
    lines = ["# Command line", "", plain(program.help or ""), ""]
    for name, command in program.commands.items():  # type: ignore[attr-defined]
        usage = " ".join(p.name.upper() for p in command.params if p.param_type_name == "argument")
        lines += [
            f"## mechgraph {name}",
            "",
            "```sh",
            f"mechgraph {name} {usage} [OPTIONS]".replace("  ", " "),
            "```",
            "",
        ]
        lines += [plain(command.help or ""), "", "| argument or option | meaning | default |", "|---|---|---|"]
        for one in command.params:
            spelled = (
                f"`{one.name.upper()}`" if one.param_type_name == "argument" else ", ".join(f"`{o}`" for o in one.opts)
            )
            usual = (
                one.default if isinstance(one.default, str | int | float) and not isinstance(one.default, bool) else ""
            )
            if one.name != "help":
                lines.append(f"| {spelled} | {cell(one.help or '')} | {cell(str(usual))} |")
        lines.append("")
    return "\n".join(lines)


def plain(text: str) -> str:
    """Help as Markdown: its example as code."""
    text = re.sub(r"^Example: (.*)$", r"Example: `\1`", inspect.cleandoc(text), flags=re.MULTILINE)
    return text.replace("<", "&lt;").replace("*", "\\*")


def cell(text: str) -> str:
    return text.replace("\n", " ").replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("[", "\\[")


# --- the library -------------------------------------------------------------------------------------------------------


def library() -> dict[str, str]:
    """The format of files, with the tables that follow from the schema, and what is known of two sources."""
    pages = {"toml": "README.md", **{name.removesuffix(".md"): name for name in SOURCES}}
    return {name: linked((ROOT / "library" / file).read_text(encoding="utf-8")) for name, file in pages.items()}


def linked(text: str) -> str:
    """Links to pages of the manual; other files of the repository by their names."""

    def target(found: re.Match[str]) -> str:
        if found[2] in SOURCES:
            return f"[{found[1]}]({found[2]})"
        path = (ROOT / "library" / found[2]).resolve()
        return f"{found[1]} (`{path.relative_to(ROOT)}`)"

    return LINK.sub(target, text)


if __name__ == "__main__":
    write(Path(__file__).parent / "reference" / "generated")
