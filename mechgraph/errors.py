"""The errors of mechgraph, one family; and Ctrl-C while the command line starts.

Ctrl-C while the command line starts, which is mostly the loading of numpy: a message and a status, no traceback.
Imported before everything else. An exception would not do: what is being loaded may turn it into another one.
"""

from __future__ import annotations

import difflib
import os
import re
import signal
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from os import PathLike

MOST_FAULTS = 30
"""Faults that a message lists."""
MOST_NAMES = 30
"""Names that a fault lists."""
LONGEST_NAME = 100
"""Characters of a wrong name that are compared with known ones."""
LONGEST_FAULT = 2000
"""Characters of one fault: what was given may be of any size."""

HIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that a terminal obeys instead of showing them, that turn the direction of a text, or that cannot be encoded."""


def visible(text: str) -> str:
    """A text with its control characters written out."""
    return HIDDEN.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def listed(names: Iterable[object], most: int = MOST_NAMES) -> str:
    """Names separated by commas, and how many more there are than are worth reading."""
    shown = list(map(str, names))
    more = len(shown) - most
    return ", ".join(shown[:most]) + (f" and {more} more" if more > 0 else "")


def near_names(name: str, known: Iterable[str], least: float = 0.5) -> list[str]:
    """The known names, at most four, that may be meant by a wrong one: as like it as ``least`` (1: the same) or more."""
    return difflib.get_close_matches(name[:LONGEST_NAME], list(known), n=4, cutoff=least)


def did_you_mean(near: Sequence[str]) -> str:
    """``did you mean crank.mass?``; nothing where no name is near."""
    return f"did you mean {' or '.join(near)}?" if near else ""


def counted(number: int, name: str) -> str:
    """``1 node of the path``, ``2 nodes of the path``."""
    first, *rest = name.split(" ", 1)
    return " ".join([str(number), first if number == 1 else f"{first}s", *rest])


def shortened(text: str) -> str:
    """A text without its middle, where it is too long to be read."""
    half = LONGEST_FAULT // 2
    left_out = len(text) - 2 * half
    return f"{text[:half]} ... ({left_out} characters) ... {text[-half:]}" if left_out > 0 else text


class MechgraphError(Exception):
    """The base of every error that mechgraph raises on purpose; it pickles and copies with the data that it carries."""

    def __init__(self, message: str) -> None:
        super().__init__(visible(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """By message and data: an exception's own way calls the constructor with the message alone."""
        return _restored, (type(self), self.args, self.__dict__)


class DeclarationError(MechgraphError):
    """All faults of a declaration (or of a call's arguments), collected and raised once.

    Attributes
    ----------
    subject : what was declared, e.g. ``mechanism 'four-bar'``.
    faults : one line each: what, where, the value, what was expected, what to do. The message lists the first of them.
    """

    def __init__(self, subject: str, faults: Sequence[str]) -> None:
        self.subject = shortened(subject)
        self.faults = tuple(map(shortened, faults))
        lines = [f"{self.subject}: {len(faults)} fault{'s' if len(faults) != 1 else ''}"]
        lines += [f"  {fault}" for fault in self.faults[:MOST_FAULTS]]
        more = len(faults) - MOST_FAULTS
        super().__init__("\n".join(lines + [f"  and {more} more (in .faults)"] * (more > 0)))


class ShapeError(DeclarationError):
    """A function given for a curve or a surface raised (that is the cause of the error), or returned what is none.

    Attributes
    ----------
    text : what it did, and at which parameters.
    """

    def __init__(self, text: str, pair: str | None = None) -> None:
        self.text = text
        super().__init__("a curve or surface by a function" if pair is None else f"pair {pair!r}", [text])

    def of(self, pair: str) -> ShapeError:
        """The same error with the name of the pair."""
        return ShapeError(self.text, pair)


class MechgraphWarning(UserWarning):
    """A result that holds only under an assumption, e.g. that something holds a passive freedom that carries load."""


class FileError(MechgraphError):
    """A file cannot be read or written; ``path`` says which."""

    def __init__(self, path: str | PathLike[str], reason: str) -> None:
        self.path = str(path)
        self.reason = shortened(reason)
        super().__init__(f"{shortened(self.path)}: {self.reason}")


class ContentError(DeclarationError, FileError):
    """Faults in the content of a file that can be read: those of a declaration, and where they stand."""

    def __init__(self, path: str | PathLike[str], found: DeclarationError) -> None:
        self.path, self.reason = str(path), "its content is at fault"
        self.subject, self.faults = found.subject, found.faults
        MechgraphError.__init__(self, str(found))


class AssemblyError(MechgraphError):
    """The loops cannot be closed.

    Attributes
    ----------
    residual : the smallest closure error found (largest of angle and length / L over the loops).
    best : the pair coordinates at which it was found, as a mapping freedom -> value.
    """

    def __init__(self, message: str, residual: float, best: dict[str, float]) -> None:
        self.residual = residual
        self.best = best
        super().__init__(message)


class PathError(MechgraphError):
    """The motion cannot be followed to its end.

    Attributes
    ----------
    value : the driver coordinates reached, as a mapping freedom -> value.
    solution : the Solution so far: rows after the last position reached are NaN.
    """

    def __init__(self, message: str, value: dict[str, float], solution: Any = None) -> None:
        self.value = value
        self.solution = solution
        super().__init__(message)


class ReachError(PathError):
    """A position of the drivers that the mechanism cannot take on the branch that it is on."""


class DeadPointError(PathError):
    """At this position the drivers do not determine the motion (dead point or change point).

    ``branches``: of a change point the branches that meet there, each as a mapping freedom -> rate for a unit rate of the first driver.
    """

    branches: tuple[dict[str, float], ...] = ()


class IndeterminateError(MechgraphError):
    """A freedom is neither driven nor passive, or drivers contradict each other.

    ``report`` is the determinacy report of the position at which this was seen.
    """

    def __init__(self, message: str, report: Any = None) -> None:
        self.report = report
        super().__init__(message)


class ResponseError(MechgraphError):
    """A motion in time cannot be followed to its end; ``solution`` is the Response so far, or None."""

    def __init__(self, message: str, solution: Any = None) -> None:
        self.solution = solution
        super().__init__(message)


class StudyError(MechgraphError):
    """A study could not be finished; ``study`` is the Study, in which the variants that were not come to are not solved."""

    def __init__(self, message: str, study: Any = None) -> None:
        self.study = study
        super().__init__(message)


class MissingExtraError(MechgraphError, ImportError):
    """An optional package is needed; the message names the extra to install."""

    def __init__(self, package: str, extra: str) -> None:
        self.package = package
        self.extra = extra
        super().__init__(f"this needs {package}: pip install 'mechgraph[{extra}]'")


def _restored(kind: type[MechgraphError], message: tuple[Any, ...], data: dict[str, Any]) -> MechgraphError:
    error = kind.__new__(kind, *message)
    super(MechgraphError, error).__init__(*message)
    error.__dict__.update(data)
    return error


INTERRUPTED = 130
"""Exit status of a program that was interrupted."""


def _stop(*_: Any) -> None:
    os.write(2, b"mechgraph: interrupted\n")
    os._exit(INTERRUPTED)


def started() -> None:
    """From here on Ctrl-C raises KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _stop:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_program() -> bool:
    """Whether Python was started for the command line, not for a program that uses mechgraph."""
    name = os.path.splitext(os.path.basename(sys.argv[0]))[0] if sys.argv else ""
    return name == "mechgraph" or (name == "-m" and "mechgraph" in sys.orig_argv)


if _is_program() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)
