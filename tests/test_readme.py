"""The README is run: every Python block and every mechgraph command, and what it shows is what comes out.

``python tests/test_readme.py`` writes the output of this version into the README.
"""

import contextlib
import io
import os
import re
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest
from program import invoke

import mechgraph as mg
from mechgraph.compiled.tabled import STATUSES
from mechgraph.kinematics.motion_path import Status

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
EQUATIONS = ROOT / "examples" / "rcsr_equations.txt"
"""What the README calls the page of all equations."""
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ROUNDING = re.compile(r"\b\d(?:\.\d+)?e-1[0-9]\b")
WORK = re.compile(r"\d+ (?=nodes|careful|evaluations|calls|factorizations)")


def run_python(code: str, namespace: dict[str, object]) -> str:
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(code, "README.md", "exec"), namespace)
    plt.close("all")
    return "".join(line.rstrip() + "\n" for line in output.getvalue().splitlines())


def run_command(line: str) -> str:
    program, *arguments = shlex.split(line.removeprefix("$ "))
    assert program == "mechgraph", line
    result = invoke(*arguments)
    assert not isinstance(result.exception, Exception), line
    return f"{line}\n{result.output}"


def played(text: str) -> Iterator[tuple[str, str]]:
    """Blocks of a page with what they show, and what they show when they are run now."""
    namespace: dict[str, object] = {}
    output = ""
    for kind, body in BLOCK.findall(text):
        if kind == "python":
            assert output == "", f"output without a text block after it: {output}"
            output = run_python(body, namespace)
        elif kind == "text":
            yield body, output
            output = ""
        elif kind == "console":
            yield body, run_command(body.splitlines()[0])


def comparable(text: str) -> str:
    """A text without what rounding decides: rounding errors, and how often Newton's method was repeated."""
    return WORK.sub("(count) ", ROUNDING.sub("(rounding)", text))


@contextlib.contextmanager
def stage() -> Iterator[None]:
    """A folder to run in, and no windows."""
    matplotlib.use("agg")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield


def test_what_the_readme_shows_is_what_comes_out() -> None:
    before, _, after = parts()
    shows_what_comes_out(before + after)


@pytest.mark.usefixtures("compiled")
def test_so_does_its_section_on_the_compiled_kernel() -> None:
    shows_what_comes_out(parts()[1])


def parts() -> tuple[str, str, str]:
    """The page, with what needs a C compiler by itself."""
    before, compiled, rest = README.read_text(encoding="utf-8").partition("### Compiled\n")
    section, heading, after = rest.partition("\n## ")
    return before, compiled + section, heading + after


def shows_what_comes_out(text: str) -> None:
    with stage():
        for shown, found in played(text):
            assert comparable(shown) == comparable(found)


def test_every_outcome_and_every_error_stands_in_its_table() -> None:
    """And nothing else; warnings and the common base have no row."""
    section = README.read_text(encoding="utf-8").partition("### Outcomes and errors")[2].partition("\n### ")[0]
    first = [row.split("|")[1].strip().split(", ") for row in section.splitlines() if row.startswith("| ")]
    names = [name.strip("`") for row in first for name in row if name not in ("status", "error")]
    errors = {name for name in mg.__all__ if name.endswith("Error")} - {"MechgraphError"}
    assert sorted(names) == sorted([*(status.value for status in Status), *errors])


def test_every_status_of_a_compiled_mechanism_stands_in_its_table() -> None:
    table = README.read_text(encoding="utf-8").partition("| `c.status` |")[2].partition("\n\n")[0]
    words = [word for row in table.splitlines()[2:] for word in row.split("|")[1].strip().split(", ")]
    assert sorted(words) == sorted(word for _, word, _ in STATUSES)


def equations() -> str:
    """The page of all equations, as it is printed."""
    return run_command("$ mechgraph equations rcsr --blocks").partition("\n")[2]


def test_the_page_of_equations_is_what_is_printed() -> None:
    assert EQUATIONS.read_text(encoding="utf-8") == equations()


def test_first_block_is_the_new_topology_of_the_examples() -> None:
    namespace: dict[str, object] = {}
    blocks = [body for kind, body in BLOCK.findall(README.read_text(encoding="utf-8")) if kind == "python"]
    run_python(blocks[0], namespace)
    code = (ROOT / "examples" / "02_new_topology.py").read_text(encoding="utf-8")
    example: dict[str, object] = {"__name__": "example"}
    exec(compile(code, "02_new_topology.py", "exec"), example)
    assert namespace["m"] == example["ball_press"]()  # type: ignore[operator]
    declaration = blocks[0].partition("m = ")[2].partition("\n\n")[0]
    assert len(declaration.splitlines()) <= 15


def test_commands_for_a_fresh_clone() -> None:
    main_job, tests = (body for kind, body in BLOCK.findall(README.read_text(encoding="utf-8")) if kind == "sh")
    assert ".venv/bin/mechgraph solve 7r" in main_job
    assert tests.strip().endswith("python -m pytest -n auto")
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert re.search(r"^python -m pytest -n auto$", ci, re.MULTILINE)
    for text in (main_job, tests, ci):
        assert re.search(r"-m venv ", text)
        assert re.search(r"python -m pip install .*'\.\[(cli|test|dev)\]'", text)


@pytest.mark.parametrize(
    "target", sorted(set(re.findall(r"\]\((?!http)([^)]+)\)", README.read_text(encoding="utf-8"))))
)
def test_links_lead_somewhere(target: str) -> None:
    assert (ROOT / target).exists()


def update() -> None:
    text = README.read_text(encoding="utf-8")
    with stage():
        found = [new for _, new in played(text)]
    new = iter(found)

    def replaced(match: re.Match[str]) -> str:
        return f"```{match[1]}\n{next(new)}```" if match[1] in ("text", "console") else match[0]

    README.write_text(BLOCK.sub(replaced, text), encoding="utf-8")
    EQUATIONS.write_text(equations(), encoding="utf-8")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "agg"
    update()
