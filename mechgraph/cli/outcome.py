"""How a command ends: exit statuses, and every error as a message."""

from __future__ import annotations

import errno
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

import numpy as np
from rich.console import Console
from rich.text import Text

import mechgraph as mg
from mechgraph.cli.output import is_terminal
from mechgraph.errors import visible
from mechgraph.result.places import OK, driver_value
from mechgraph.starting import INTERRUPTED

DONE, NO_ANSWER, BAD_INPUT = 0, 1, 2
"""Exit statuses."""

NO_ANSWERS = (mg.AssemblyError, mg.ReachError, mg.DeadPointError, mg.IndeterminateError, mg.ResponseError)
"""Errors that say that the mechanism has no answer; every other error is bad input."""


EXIT_STATUS = (
    "Exit status: 0 done; 1 the mechanism has no answer, and the message says why; 2 wrong usage or bad input."
)


def fail(message: str, status: int) -> NoReturn:
    """End with a message on standard error."""
    try:
        if is_terminal(sys.stderr):
            text = Text.assemble(("mechgraph: ", "bold red"), visible(message))
            Console(stderr=True, highlight=False).print(text, soft_wrap=True)
        elif sys.stderr is not None:
            sys.stderr.write(f"mechgraph: {visible(message)}\n")
            sys.stderr.flush()
    except OSError:  # where messages cannot be written either, the status says it
        forget(sys.stderr)
    sys.exit(status)


@contextmanager
def warned() -> Iterator[None]:
    """Every warning of the package as a message."""

    def say(message: Warning | str, *_: Any, **__: Any) -> None:
        if sys.stderr is not None:
            sys.stderr.write(f"mechgraph: {visible(str(message))}\n")

    with warnings.catch_warnings():
        warnings.simplefilter("always", mg.MechgraphWarning)
        warnings.showwarning = say
        yield


def _reached(error: mg.MechgraphError) -> str:
    """The driver values reached, in the words of the command line."""
    if not isinstance(error, mg.ReachError | mg.DeadPointError) or error.solution is None:
        return ""
    if not (np.asarray(error.solution.status) == OK).any():
        return ""
    m = error.solution.whole
    at = ", ".join(driver_value(m, name, value) for name, value in error.value.items())
    return f"\n  reached {at}; --on-reach flag solves the positions that can be reached"


@contextmanager
def outcome() -> Iterator[None]:
    """Every error as a message and an exit status."""
    try:
        yield
    except NO_ANSWERS as error:
        fail(str(error) + _reached(error), NO_ANSWER)
    except mg.MechgraphError as error:
        fail(str(error), BAD_INPUT)
    except MemoryError:
        fail("not enough memory for so many positions; take fewer", BAD_INPUT)
    except KeyboardInterrupt:
        fail("interrupted", INTERRUPTED)
    except OSError as error:  # of files there is a FileError: this is the output itself
        forget(sys.stdout)
        if error.errno == errno.EPIPE:
            sys.exit(DONE)
        fail(f"the output cannot be written: {error.strerror or error}", BAD_INPUT)


def forget(stream: Any) -> None:
    """Let nothing of what waits in a stream be written when the program ends: that would fail again."""
    with suppress(OSError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
