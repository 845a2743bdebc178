"""What is shown: texts and documents on standard output, work in progress on standard error."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from mechgraph.document import Document, to_text

UNBROKEN = 10_000
"""Width in which nothing is wrapped: where the output goes to a file or another program."""


def is_terminal(stream: Any) -> bool:
    """Whether a stream, which may have been closed, is shown to somebody."""
    return stream is not None and stream.isatty()


def write(text: str, colour: str = "") -> None:
    """Write a text; on a terminal its headings in bold and the paragraph after the title in ``colour``."""
    if sys.stdout is None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    if not sys.stdout.isatty():
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    console = Console(highlight=False)
    lines = text.split("\n")
    first = 3 if colour else len(lines)
    last = lines.index("", first) if "" in lines[first:] else first
    for i, (line, following) in enumerate(zip(lines, [*lines[1:], ""], strict=True)):
        rule = (
            len(following) > 2
            and not following.strip(following[0])
            and following[0] in "=~-"
            and len(following) >= len(line.strip()) > 0
        )
        style = "bold" if rule else f"bold {colour}" if first <= i < last else ""
        console.print(Text(line, style=style), soft_wrap=True, end="\n" if i < len(lines) - 1 else "")


def show(document: Document, colour: str = "") -> None:
    """Write a document as wide as the terminal; unbroken into a file or another program."""
    width = max(shutil.get_terminal_size().columns, 40) if is_terminal(sys.stdout) else UNBROKEN
    write(to_text(document, width), colour)


@contextmanager
def working(what: str) -> Iterator[None]:
    """A spinner with the time passed on stderr, where that is a terminal."""
    if not is_terminal(sys.stderr):
        yield
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as spinner:
        spinner.add_task(what)
        yield


@contextmanager
def progress(what: str, end: float | None = None) -> Iterator[Callable[..., None] | None]:
    """A bar on stderr, where that is a terminal; ``moved(reached, of=end)``. Without an end it runs to and fro until there is one."""
    if not is_terminal(sys.stderr):
        yield None
        return
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=end)

        def moved(reached: float, of: float | None = end) -> None:
            bar.update(task, completed=reached, total=of)

        yield moved
