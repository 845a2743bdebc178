"""Mutation run: small faults are put into the package one by one, and the tests that execute the line have to notice.

    python tests/mutate.py --count 100 --seed 1 --map contexts.json --out survivors.txt

Not part of the suite. The first run executes every test once under ``coverage`` and writes to ``--map`` which tests execute which
line (as long as the suite takes, twice over); later runs read it. Every mutant is a change of one place in the syntax tree, made in
a copy of the repository; of the tests that execute its line the quick ones go first, and the first failure settles it. What
survives is written with its difference: a test is missing, or the mutant is equivalent.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CORE = ("algebra", "model", "equations", "force", "structure", "graph", "variants")
LEFT_OUT = ("test_house.py", "test_layers.py", "test_readme.py", "benchmarks")
"""Tests that say nothing about numbers, or that run other tests."""

SWAPPED: dict[type, tuple[type, ...]] = {
    ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult,), ast.FloorDiv: (ast.Div,),
    ast.Mod: (ast.Mult,), ast.Pow: (ast.Mult,), ast.MatMult: (ast.Mult,), ast.BitAnd: (ast.BitOr,), ast.BitOr: (ast.BitAnd,),
    ast.BitXor: (ast.BitAnd,), ast.And: (ast.Or,), ast.Or: (ast.And,),
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip


def changed(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What may stand in place of a node, with a name for the change."""
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op):
            for other in SWAPPED.get(type(op), ()):
                yield "operator", _with(node, op=other())
        case ast.BoolOp(op=op):
            yield "and / or", _with(node, op=SWAPPED[type(op)][0]())
        case ast.Compare(left=left, ops=[op, *rest], comparators=[right, *_]):
            # the bound itself counts where whole numbers are compared; between floats it makes no difference
            whole = any(isinstance(x, ast.Constant) and isinstance(x.value, int) for x in (left, right))
            for other in SWAPPED[type(op)] if whole else SWAPPED[type(op)][-1:]:
                yield "comparison", _with(node, ops=[other(), *rest])
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert(), operand=inner):
            yield "sign or negation taken away", inner
        case ast.Constant(value=bool() as value):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int() as value):
            yield "constant", ast.Constant(value + 1)
        case ast.Constant(value=float() as value):
            # twice a tolerance is another good tolerance; a million of it is none
            yield "constant", ast.Constant(1.0 if not value else 2 * value if abs(value) > 1e-3 else 1e6 * value)
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            yield "condition negated", _with(node, test=ast.UnaryOp(ast.Not(), test))
        case ast.Return(value=value) if value is not None and not _is_none(value):
            yield "returns None", ast.Return(ast.Constant(None))
    match node:
        case ast.AugAssign() | ast.Raise() | ast.Expr(value=ast.Call()):
            yield "statement deleted", ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "statement deleted", ast.Pass()
        case ast.Continue():
            yield "statement deleted", ast.Break()
        case ast.Break():
            yield "statement deleted", ast.Continue()


def _with(node: ast.AST, **fields: Any) -> ast.AST:
    return type(node)(**{**dict(ast.iter_fields(node)), **fields})


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


NOT_COMPUTED = {"annotation", "returns", "decorator_list", "type_params", "bases"}


def places(tree: ast.AST, first: int = 0) -> Iterator[tuple[Any, str, int, int]]:
    """Every expression and statement that computes: ``(parent, field, index, first line)``; the line is that of the statement.

    No annotation, no text of a message, nothing of what is raised.
    """
    for field, value in ast.iter_fields(tree):
        if field in NOT_COMPUTED:
            continue
        for i, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr | ast.expr_context):
                continue
            if isinstance(child, ast.keyword) and child.arg == "strict":  # of zip: what it checks does not happen
                continue
            line = child.lineno if isinstance(child, ast.stmt) else first
            yield tree, field, i, line
            if not isinstance(child, ast.Raise):
                yield from places(child, line)


@dataclass(frozen=True)
class Mutant:
    file: str
    first: int
    line: int
    kind: str
    place: int
    variant: int

    def text(self, source: str) -> str:
        """The module with the change, as the syntax tree prints it."""
        tree = ast.parse(source)
        parent, field, i, _ = list(places(tree))[self.place]
        old = getattr(parent, field)
        new = list(changed(old[i] if isinstance(old, list) else old))[self.variant][1]
        if isinstance(old, list):
            old[i] = new
        else:
            setattr(parent, field, new)
        return ast.unparse(ast.fix_missing_locations(tree))

    def difference(self, source: str) -> str:
        """The change as a unified difference."""
        before = ast.unparse(ast.parse(source)).splitlines()
        return "\n".join(difflib.unified_diff(before, self.text(source).splitlines(), self.file, self.kind, "", "", 4))


def mutants(file: Path) -> list[Mutant]:
    """All mutants of a module."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    out = []
    for k, (parent, field, i, first) in enumerate(places(tree)):
        old = getattr(parent, field)
        node = old[i] if isinstance(old, list) else old
        line = getattr(node, "lineno", None)
        for v, (kind, _) in enumerate(changed(node) if line else ()):
            out.append(Mutant(file.relative_to(ROOT).as_posix(), first, line, kind, k, v))
    return out


# --- which tests execute which line: this file is also the plugin that tells coverage the test ------------------------------

DURATIONS: dict[str, float] = defaultdict(float)


def pytest_runtest_logstart(nodeid: str) -> None:
    import coverage

    current = coverage.Coverage.current()
    if current is not None:
        current.switch_context(nodeid)


def pytest_runtest_logreport(report: Any) -> None:
    DURATIONS[report.nodeid] += report.duration


def pytest_sessionfinish() -> None:
    target = os.environ.get("MUTATE_DURATIONS")
    if target:
        Path(target).write_text(json.dumps(DURATIONS), encoding="utf-8")


def environment(tree: Path) -> dict[str, str]:
    """Variables of a run in a copied tree: its own package, one thread, always the same examples."""
    return os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tree), str(tree / "tests")]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MPLBACKEND": "agg",
    }


PYTEST = (
    "-m",
    "pytest",
    "-q",
    "-p",
    "no:cacheprovider",
    "-p",
    "no:randomly",
    "--hypothesis-seed=0",
    "-o",
    "addopts=-m 'not benchmark'",
)


def contexts(tree: Path) -> dict[str, Any]:
    """``{"lines": {file: {line: [test]}}, "seconds": {test: s}}`` of one run of all tests."""
    import coverage

    data, seconds = tree / ".mutate-coverage", tree / "durations.json"
    left = [f"--ignore=tests/{name}" for name in LEFT_OUT]
    run = [
        sys.executable,
        "-m",
        "coverage",
        "run",
        f"--data-file={data}",
        "--source=mechgraph",
        *PYTEST,
        "-p",
        "mutate",
        "tests",
        *left,
    ]
    subprocess.run(run, cwd=tree, env=environment(tree) | {"MUTATE_DURATIONS": str(seconds)}, check=False)
    found = coverage.CoverageData(basename=str(data))
    found.read()
    lines = {
        Path(file).relative_to(tree).as_posix(): {
            str(line): sorted(tests) for line, tests in found.contexts_by_lineno(file).items()
        }
        for file in found.measured_files()
    }
    return {"lines": lines, "seconds": json.loads(seconds.read_text(encoding="utf-8"))}


def tests_of(mutant: Mutant, known: dict[str, Any], budget: float) -> tuple[list[str], int]:
    """Tests for a mutant, quick ones first, as many as ``budget`` seconds hold, and how many there are.

    Those that execute its line, or another one of its statement; for what runs at the import those that execute anything in its file.
    """
    lines, seconds = known["lines"].get(mutant.file, {}), known["seconds"]
    statement = {test for line in range(mutant.first, mutant.line) for test in lines.get(str(line), ())}
    found = set(lines.get(str(mutant.line), ())) or statement
    if "" in found:  # the context of the import
        found = {test for tests in lines.values() for test in tests}
    ordered = sorted(found & seconds.keys(), key=lambda test: (seconds[test], test))
    total, chosen = 0.0, []
    for test in ordered:
        total += seconds[test]
        if chosen and total > budget:
            break
        chosen.append(test)
    return chosen, len(ordered)


def outcome(tree: Path, tests: list[str], limit: float) -> str:
    """``caught``, ``survived`` or ``timeout`` of the tests in a tree."""
    names = tree / "chosen-tests.txt"
    names.write_text("\n".join(tests), encoding="utf-8")
    run = subprocess.Popen(
        [sys.executable, *PYTEST, "-x", f"@{names}"],
        cwd=tree,
        env=environment(tree),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return "survived" if run.wait(limit) == 0 else "caught"
    except subprocess.TimeoutExpired:
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
        return "timeout"


def copied(to: Path) -> Path:
    """A copy of what the tests need."""
    skip = shutil.ignore_patterns(".*_cache", "__pycache__", ".git", ".hypothesis")
    shutil.copytree(ROOT, to, ignore=skip)
    return to


def main() -> None:
    """Read the options, collect what runs where, try the mutants, write the survivors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="mutants to try")
    parser.add_argument("--seed", type=int, default=0, help="seed of the choice")
    parser.add_argument("--only", nargs="*", default=CORE, help="folders or files below mechgraph/")
    parser.add_argument(
        "--map", type=Path, default=Path("contexts.json"), help="which tests run which line; made where missing"
    )
    parser.add_argument("--out", type=Path, default=Path("survivors.txt"), help="where survivors are written")
    parser.add_argument("--budget", type=float, default=120.0, help="seconds of tests for a mutant at most")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        tree = copied(Path(scratch) / "tree")
        if not given.map.exists():
            given.map.write_text(json.dumps(contexts(tree)), encoding="utf-8")
        attempt(given, tree, json.loads(given.map.read_text(encoding="utf-8")))


def attempt(given: argparse.Namespace, tree: Path, known: dict[str, Any]) -> None:
    """Try the mutants in a copied tree."""
    chosen = [ROOT / "mechgraph" / name for name in given.only]
    files = sorted(f for path in chosen for f in (path.rglob("*.py") if path.is_dir() else [path]))
    every = [mutant for file in files for mutant in mutants(file)]
    drawn = random.Random(given.seed).sample(every, min(given.count, len(every)))
    counts: dict[str, int] = defaultdict(int)
    with given.out.open("w", encoding="utf-8") as out:
        for i, mutant in enumerate(drawn, 1):
            source = (ROOT / mutant.file).read_text(encoding="utf-8")
            tests, count = tests_of(mutant, known, given.budget)
            took = sum(known["seconds"][test] for test in tests)
            target = tree / mutant.file
            target.write_text(mutant.text(source), encoding="utf-8")
            result = outcome(tree, tests, 60 + 10 * took) if tests else "not executed"
            target.write_text(source, encoding="utf-8")
            counts[result] += 1
            print(f"{i}/{len(drawn)} {result:12} {mutant.file}:{mutant.line} {mutant.kind}", flush=True)
            if result in ("survived", "not executed"):
                note = f"{result}: {mutant.file}:{mutant.line} {mutant.kind} ({len(tests)} of {count} tests)"
                out.write(f"=== {note}\n{mutant.difference(source)}\n\n")
                out.flush()
        out.write(f"{dict(counts)} of {len(drawn)} drawn among {len(every)}\n")
    print(dict(counts))


if __name__ == "__main__":
    main()
