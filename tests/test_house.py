"""House rules that no linter knows."""

import ast
import functools
import re
import shutil
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import pytest

parsed = functools.cache(ast.parse)

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mechgraph"

TOP_LEVEL = {
    ".ci", ".git", ".gitignore", "ARCHITECTURE.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "README.md",
    "docs", "examples", "library", "mechgraph", "pyproject.toml", "tests",
}  # fmt: skip
MAY_PRINT = {"__main__.py"}
LONGEST_FILE = 700
NOT_AT_IMPORT = (
    "matplotlib", "typer", "rich", "pandas", "xarray", "pint",
    "networkx", "numpy.random", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.sparse",
)  # fmt: skip
"""Optional packages, and what the core needs only once it works."""

ABSOLUTE_PATH = re.compile(r"(?<![\w.:/~-])(?:/(?:home|tmp|root|Users|mnt|opt|work)/\w|[A-Z]:\\\\?\w)")
SYMBOL = r"['\"](?:R|P|H|C|S|U|E|Sp|Sg|Sc|Cp|W)['\"]"
BRANCH_ON_SYMBOL = re.compile(
    rf"(?:symbol|kind|type|code)\s*(?:==|!=|(?:not\s+)?in)\s*[\[\(\{{]?\s*{SYMBOL}"
    rf"|{SYMBOL}\s*(?:==|!=)\s*[\w.]*(?:symbol|kind|type|code)\b"
    rf"|^\s*case\s+{SYMBOL}",
    re.MULTILINE,
)


def repository_files() -> list[Path]:
    """Files under version control, and new ones not ignored; without git, all but what .gitignore names."""
    git = shutil.which("git")
    if git and (ROOT / ".git").exists():
        command = [git, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listing = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
        if listing.returncode == 0:
            names = [name for name in listing.stdout.decode().split("\0") if name]
            return sorted(ROOT / name for name in names if (ROOT / name).is_file())
    patterns = [line.strip().rstrip("/") for line in (ROOT / ".gitignore").read_text().splitlines()]
    patterns = [".git", *filter(None, patterns)]

    def ignored(path: Path) -> bool:
        return any(fnmatch(part, pattern) for part in path.relative_to(ROOT).parts for pattern in patterns)

    return sorted(path for path in ROOT.rglob("*") if path.is_file() and not ignored(path))


def package_files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def lines_with(pattern: re.Pattern[str], text: str) -> list[int]:
    return [text.count("\n", 0, match.start()) + 1 for match in pattern.finditer(text)]


def test_top_level_holds_the_allowed_names_only() -> None:
    assert {file.relative_to(ROOT).parts[0] for file in repository_files()} <= TOP_LEVEL


def test_dataclasses_write_their_methods_when_they_are_used() -> None:
    """``memo.dataclass``: some 250 classes take longer to write than all else that ``import mechgraph`` does."""
    at_once = re.compile(r"^from dataclasses import [^\n]*\bdataclass\b|^@dataclasses\.dataclass", re.MULTILINE)
    found = {name_of(file) for file in package_files() if at_once.search(file.read_text(encoding="utf-8"))}
    rows = {"mechgraph/pairs/pair_type.py", "mechgraph/pairs/factors.py"}  # of the table, which is made at once
    assert found == rows


def test_library_holds_no_python() -> None:
    assert not list((ROOT / "library").rglob("*.py"))


def test_no_absolute_paths() -> None:
    found = []
    for file in repository_files():
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found += [f"{name_of(file)}:{line}" for line in lines_with(ABSOLUTE_PATH, text)]
    assert not found


@pytest.mark.parametrize("folder", ["home", "tmp", "Users"])
def test_the_check_finds_an_absolute_path(folder: str) -> None:
    assert lines_with(ABSOLUTE_PATH, f"x = 1\nopen('/{folder}/me/file')") == [2]
    assert not lines_with(ABSOLUTE_PATH, f"https://example.org/{folder}/me, a/{folder}/b")


MERGE_MARK = re.compile(r"^(?:<{7} |>{7} )", re.MULTILINE)


def test_no_merge_was_left_undecided() -> None:
    texts = {name_of(file): file.read_bytes().decode("utf-8", "replace") for file in repository_files()}
    assert not [f"{name}:{line}" for name, text in texts.items() for line in lines_with(MERGE_MARK, text)]
    assert lines_with(MERGE_MARK, "a\n" + "<" * 7 + " HEAD\nb\n" + ">" * 7 + " other\n") == [2, 4]


def test_nothing_prints_but_the_command_line() -> None:
    found = []
    for file in package_files():
        if file.parent == PACKAGE and file.name in MAY_PRINT:
            continue
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(parsed(text)) if "print(" in text else ():
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
                found.append(f"{name_of(file)}:{node.lineno}")
    assert not found


def test_no_answer_depends_on_the_clock() -> None:
    """Searches end after work that is counted: on a busy machine they find the same."""
    clock = re.compile(r"^\s*(?:import|from) (?:time|timeit)\b|process_time|perf_counter|monotonic\(", re.MULTILINE)
    assert not [name_of(file) for file in package_files() if clock.search(file.read_text(encoding="utf-8"))]


def test_files_are_written_whole() -> None:
    """What writes a file does so through ``mechgraph.files``: whole or not at all."""
    writes = re.compile(r"\.write_(?:text|bytes)\(|\bopen\([^)]*[\"'][wa]b?[\"']")
    found = [name_of(file) for file in package_files() if writes.search(file.read_text(encoding="utf-8"))]
    assert set(found) <= {"mechgraph/files.py"}


def test_nothing_branches_on_a_pair_symbol() -> None:
    found = []
    for file in package_files():
        text = file.read_text(encoding="utf-8")
        found += [f"{name_of(file)}:{line}" for line in lines_with(BRANCH_ON_SYMBOL, text)]
    assert not found


@pytest.mark.parametrize(
    "code",
    [
        "if pair.symbol == 'R':",
        'if kind != "Sp":',
        'x = 1 if pair.type.symbol in ("R", "P") else 0',
        "if code not in {'C'}:",
        "if 'H' == pair.symbol:",
        'match symbol:\n    case "W":',
    ],
)
def test_the_check_finds_a_branch_on_a_symbol(code: str) -> None:
    assert lines_with(BRANCH_ON_SYMBOL, code)


@pytest.mark.parametrize("code", ['PAIR_TYPES["R"]', 'symbol = "R"', "if symbol in PAIR_TYPES:", 'f(kind="R")'])
def test_the_check_passes_a_look_up(code: str) -> None:
    assert not lines_with(BRANCH_ON_SYMBOL, code)


def test_no_source_file_is_too_long() -> None:
    files = [*package_files(), *sorted((ROOT / "examples").rglob("*.py"))]
    texts = {name_of(file): file.read_text(encoding="utf-8") for file in files}
    long = {name: text for name, text in texts.items() if len(text.splitlines()) > LONGEST_FILE}
    assert not {name for name, text in long.items() if lines_beside_docstrings(text) > LONGEST_FILE}


def lines_beside_docstrings(text: str) -> int:
    """Lines of a module, but for its docstrings: they are the reference, and long where a name takes much."""
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [
        node.body for node in ast.walk(parsed(text)) if isinstance(node, nodes) and ast.get_docstring(node) is not None
    ]
    return len(text.splitlines()) - sum((body[0].end_lineno or 0) - body[0].lineno + 1 for body in bodies)


def test_docstrings_do_not_count() -> None:
    assert (
        lines_beside_docstrings('"""A module."""\n\ndef f():\n    """One.\n\n    More.\n    """\n    return 1\n') == 3
    )


def test_import_loads_only_what_every_start_needs() -> None:
    code = f"import sys, mechgraph; print(*[name for name in {NOT_AT_IMPORT!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == []


def test_a_bound_has_one_value() -> None:
    """The name of a number says what it bounds, so that no name stands for two numbers."""
    found: dict[str, dict[str, str]] = {}
    for path in package_files():
        for node in parsed(path.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            for target, value in [pair for t in targets for pair in parts_of(t, node.value)]:
                if isinstance(target, ast.Name) and target.id.isupper() and not any(map(is_text, ast.walk(value))):
                    found.setdefault(target.id, {})[ast.unparse(value)] = path.name
    assert not {name: values for name, values in found.items() if len(values) > 1}


def parts_of(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def test_tests_that_take_turns_are_there() -> None:
    names = (ROOT / "tests" / "turns.txt").read_text(encoding="utf-8").split()
    assert names == sorted(set(names))
    for file, _, name in (line.partition("::") for line in names):
        assert any(
            getattr(node, "name", "") == name for node in parsed((ROOT / file).read_text(encoding="utf-8")).body
        ), (file, name)
