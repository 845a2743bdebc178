"""Imports go down only: the contract of pyproject.toml, checked on the syntax trees, so no linter is needed.

It differs from import-linter in one point: it looks at direct imports only, which suffices where every module
has a layer.
"""

import ast
import functools
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import networkx as nx
import pytest

from mechgraph import methods

parsed = functools.cache(ast.parse)

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mechgraph"


def layers() -> dict[str, int]:
    """Height of each layer, the lowest 0."""
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = tables["tool"]["importlinter"]["contracts"]
    return {name.strip("()"): height for height, name in enumerate(reversed(contract["layers"]))}


LAYERS = layers()
FILES = [file for file in sorted(PACKAGE.rglob("*.py")) if file != PACKAGE / "__init__.py"]


def layer_of(module: str) -> str | None:
    """Layer of a dotted module name; None outside the package, '' for the package itself."""
    first, *rest = module.split(".")
    if first != "mechgraph":
        return None
    return rest[0] if rest and rest[0] in LAYERS else ""


def is_type_checking(test: ast.expr) -> bool:
    return "TYPE_CHECKING" in {getattr(test, "id", None), getattr(test, "attr", None)}


def import_statements(node: ast.AST, typing: bool = False) -> Iterator[ast.Import | ast.ImportFrom]:
    """Imports anywhere below `node`, in functions too; those for type checking only where asked for."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif isinstance(child, ast.If) and is_type_checking(child.test) and not typing:
            for other in child.orelse:
                yield from import_statements(ast.Module([other], []))
        elif not isinstance(child, ast.expr):
            yield from import_statements(child, typing)


def imported_layers(source: str, package: list[str]) -> Iterator[tuple[int, str]]:
    """(line, layer) of each import of the package, in a module that lies in the dotted `package`."""
    for statement in import_statements(parsed(source)):
        if isinstance(statement, ast.Import):
            modules = [alias.name for alias in statement.names]
        else:
            above = package[: len(package) + 1 - statement.level] if statement.level else []
            base = ".".join(above + ([statement.module] if statement.module else []))
            modules = [f"{base}.{alias.name}" for alias in statement.names]
        for module in modules:
            layer = layer_of(module)
            if layer is not None:
                yield statement.lineno, layer


def faults(source: str, package: list[str], own: str) -> list[str]:
    found = []
    for line, layer in imported_layers(source, package):
        if layer == "" and own not in {"__main__", "cli"}:
            found.append(f"line {line}: {own} imports the package mechgraph itself; import the layer")
        elif layer and LAYERS[layer] > LAYERS[own]:
            found.append(f"line {line}: {own} imports {layer}, which lies above it")
    return found


def test_imports_go_down_only() -> None:
    found = []
    for file in FILES:
        own = file.relative_to(PACKAGE).with_suffix("").parts[0]
        assert own in LAYERS, f"{own} has no place among the layers in pyproject.toml"
        package = list(file.relative_to(ROOT).parent.parts)
        found += [f"{file.name}, {fault}" for fault in faults(file.read_text(encoding="utf-8"), package, own)]
    assert not found


@pytest.mark.parametrize(
    "source",
    [
        "from mechgraph.force import dalembert",
        "from mechgraph import force",
        "import mechgraph.force.reactions",
        "import mechgraph",
        "from mechgraph import Mechanism",
        "from ..force import dalembert",
        "from .. import force",
        "def f():\n    from mechgraph.force import dalembert",
        "if TYPE_CHECKING:\n    pass\nelse:\n    import mechgraph.force",
    ],
)
def test_the_check_finds_an_import_upward(source: str) -> None:
    assert len(faults(source, ["mechgraph", "model"], "model")) == 1


@pytest.mark.parametrize(
    "source",
    [
        "import numpy as np\nfrom scipy import linalg",
        "from mechgraph.errors import FileError",
        "from mechgraph.maths import se3",
        "from . import pair\nfrom .pair import PAIR_TYPES\nfrom ..maths.se3 import exp",
        "if TYPE_CHECKING:\n    from mechgraph.force import dalembert",
        "if typing.TYPE_CHECKING:\n    import mechgraph.force",
    ],
)
def test_the_check_passes_an_import_downward(source: str) -> None:
    assert not faults(source, ["mechgraph", "model"], "model")


def circles(sources: dict[str, str]) -> list[list[str]]:
    """Modules (dotted name -> source) that import each other in circles, imports for type checking included."""
    graph: nx.DiGraph[str] = nx.DiGraph()
    for name, source in sources.items():
        for statement in import_statements(parsed(source), typing=True):
            if isinstance(statement, ast.Import):
                targets = [alias.name for alias in statement.names]
            else:
                package = name.split(".")[: -statement.level] if statement.level else []
                base = ".".join(package + ([statement.module] if statement.module else []))
                targets = [base, *(f"{base}.{alias.name}" for alias in statement.names)]
            graph.add_edges_from((name, target) for target in targets if target in sources and target != name)
    return sorted(sorted(part) for part in nx.strongly_connected_components(graph) if len(part) > 1)


def sources_of(room: Path) -> dict[str, str]:
    """The modules of a room by dotted name; the package itself imports what it likes from its own modules."""
    files = [file for file in sorted(room.rglob("*.py")) if file.name != "__init__.py"]
    names = [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files]
    return {name: file.read_text(encoding="utf-8") for name, file in zip(names, files, strict=True)}


ROOMS = sorted(folder for folder in PACKAGE.iterdir() if (folder / "__init__.py").is_file())


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_no_room_has_circles(room: Path) -> None:
    assert not circles(sources_of(room))


@pytest.mark.parametrize(
    "source",
    [
        "from room.a import f",
        "import room.a",
        "from . import a",
        "from .a import f",
        "if TYPE_CHECKING:\n    from room.a import f",
        "def g():\n    from room import a",
    ],
)
def test_the_check_finds_a_circle(source: str) -> None:
    sources = {"room.a": "from room.b import g", "room.b": "import room.c", "room.c": source, "room.d": "import room.a"}
    assert circles(sources) == [["room.a", "room.b", "room.c"]]
    assert not circles({**sources, "room.c": "import other"})


def names_of_modules(source: str) -> list[str]:
    """Texts that name a module of the package: what no check of import statements sees."""
    if not re.search(r"[\"']mechgraph\.", source):
        return []
    texts = [node.value for node in ast.walk(parsed(source)) if isinstance(node, ast.Constant)]
    return [text for text in texts if text in MODULES]


MODULES = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in FILES}


def test_nothing_imports_the_package_by_name() -> None:
    found = [(file.name, name) for file in FILES for name in names_of_modules(file.read_text(encoding="utf-8"))]
    assert not found
    assert names_of_modules("import_module('mechgraph.errors')") == ["mechgraph.errors"]


def test_methods_that_rooms_above_answer_are_thin() -> None:
    """The top finds just the names that classes of lower rooms ask for, each in a method that does nothing else."""
    asked = []
    for file in FILES:
        text = file.read_text(encoding="utf-8")
        for method in ast.walk(parsed(text)) if "methods.call" in text and file.stem != "methods" else ():
            if isinstance(method, ast.FunctionDef):
                calls = [
                    node
                    for node in ast.walk(method)
                    if isinstance(node, ast.Call) and ast.unparse(node.func) == "methods.call"
                ]
                asked += [ast.literal_eval(node.args[0]) for node in calls]
                assert not calls or len(method.body) <= 3  # docstring, call, return
    assert set(asked) == set(get_args(methods.Name))
    assert all(callable(methods.HOMES[0](name)) for name in asked)
