"""The pages of the manual are run: every Python block, every ``mechgraph`` command; a text block shows what the blocks before it print.

A page shows its own pictures: its blocks save them, and it names them below ``_built``. ``python docs/player.py [PAGE ...]`` writes
what comes out now into the pages.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import shlex
import sys
import tempfile
import unittest.mock
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
BUILT = DOCS / "_built"
"""Pictures that pages draw, and the gallery; made by the build."""
PAGES = [
    ROOT / "README.md",
    *sorted(page for page in DOCS.rglob("*.md") if not {BUILT, DOCS / "reference" / "generated"} & {*page.parents}),
]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ROUNDING = re.compile(r"\b\d(?:\.\d+)?e-1[0-9]\b")
WORK = re.compile(r"\d+ (?=nodes|careful|evaluations|calls|factorizations)")
PICTURE = re.compile(r"^```\{image\} (?:\.\./)*_built/(.+)/[^/\n]+$", re.MULTILINE)
"""A picture of a page's own, and the folder in which the page draws it."""


def run_python(code: str, namespace: dict[str, object], page: str = "page") -> str:
    """What a block prints; pages share nothing."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(code, page, "exec"), namespace)
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
    return "".join(line.rstrip() + "\n" for line in output.getvalue().splitlines())


def run_command(line: str) -> str:
    """A command as it is typed, and what it prints."""
    from typer.testing import CliRunner

    from mechgraph.cli.commands import app

    program, *arguments = shlex.split(line.removeprefix("$ "))
    assert program == "mechgraph", line
    result = CliRunner().invoke(app, arguments)
    assert not isinstance(result.exception, Exception), line
    return f"{line}\n{result.output}"


def comparable(text: str) -> str:
    """A text without what rounding decides: rounding errors, and how often Newton's method was repeated."""
    return WORK.sub("(count) ", ROUNDING.sub("(rounding)", text))


def check(page: Path) -> None:
    """Run a page; what it shows is what comes out."""
    for shown, found in played(page.read_text(encoding="utf-8"), str(page)):
        assert comparable(shown) == comparable(found), f"{page.name} shows\n{shown}\nnow\n{found}"


def played(text: str, page: str = "page") -> Iterator[tuple[str, str]]:
    """Blocks of a page with what they show, and what they show when they are run now."""
    namespace: dict[str, object] = {"__name__": "page"}
    output = ""
    for kind, body in BLOCK.findall(text):
        if kind == "python":
            assert output == "", f"output without a text block after it: {output}"
            output = run_python(body, namespace, page)
        elif kind == "text":
            yield body, output
            output = ""
        elif kind == "console":
            yield body, run_command(body.splitlines()[0])
    assert output == "", f"output without a text block after it: {output}"


@contextlib.contextmanager
def stage(folder: Path | None = None) -> Iterator[None]:
    """A folder to run in (a temporary one), no windows, and numpy for what does not ask for the kernel."""
    import matplotlib

    from mechgraph import outcome

    matplotlib.use("agg")
    numpy = unittest.mock.patch.object(outcome, "at_hand", return_value=None)
    with tempfile.TemporaryDirectory() as temporary, contextlib.chdir(folder or temporary), numpy:
        yield


def draw(page: Path) -> None:
    """Check a page in the folder in which it looks for its pictures, unless it was drawn before as it stands."""
    text = page.read_text(encoding="utf-8")
    for name in set(PICTURE.findall(text)):
        folder, stamp = BUILT / name, BUILT / name / ".drawn"
        current = hashlib.sha256(text.encode()).hexdigest()
        if not stamp.exists() or stamp.read_text(encoding="utf-8") != current:
            folder.mkdir(parents=True, exist_ok=True)
            with stage(folder):
                check(page)
            stamp.write_text(current, encoding="utf-8")


def update(page: Path) -> None:
    """Write what comes out now into a page."""
    text = page.read_text(encoding="utf-8")
    with stage():
        new = iter([found for _, found in played(text, str(page))])

    def replaced(match: re.Match[str]) -> str:
        return f"```{match[1]}\n{next(new)}```" if match[1] in ("text", "console") else match[0]

    page.write_text(BLOCK.sub(replaced, text), encoding="utf-8")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "agg"
    sys.path.insert(0, str(ROOT))
    for page in [Path(name).resolve() for name in sys.argv[1:]] or PAGES:
        update(page)
