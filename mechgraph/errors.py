"""The errors of mechgraph, one family; what a search may spend; and Ctrl-C while the command line starts.

Ctrl-C while the command line starts, which is mostly the loading of numpy: a message and a status, no traceback.
Imported before everything else. An exception would not do: what is being loaded may turn it into another one.
"""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from os import PathLike

MOST_NAMES = 30
"""Names that a fault lists."""

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
    # characters of a wrong name that are compared with known ones
    import difflib

    folded: dict[str, list[str]] = {}
    for one in known:
        folded.setdefault(one.casefold(), []).append(one)
    near = difflib.get_close_matches(name[:100].casefold(), folded, n=4, cutoff=least)
    return [one for key in near for one in folded[key]][:4]


def did_you_mean(near: Sequence[str]) -> str:
    """``did you mean crank.mass?``; nothing where no name is near."""
    return f"did you mean {' or '.join(near)}?" if near else ""


class UnknownAttribute(AttributeError):
    """A name that something has not, told with those that may be meant."""

    def __init__(self, of: object, name: str) -> None:
        super().__init__()
        self._of, self._name = of, name

    def __str__(self) -> str:
        known = [name for name in dir(self._of) if not name.startswith("_")]
        hint = did_you_mean(near_names(self._name, known, 0.6)[:2])
        return f"{type(self._of).__name__} has no attribute {self._name!r}{hint and f'; {hint}'}"


class TellsNames:
    """Something that tells names which it has for one that it has not."""

    __slots__ = ()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise UnknownAttribute(self, name)


def counted(number: int, name: str) -> str:
    """``1 node of the path``, ``2 nodes of the path``."""
    first, *rest = name.split(" ", 1)
    return " ".join([str(number), first if number == 1 else f"{first}s", *rest])


def shortened(text: str) -> str:
    """A text without its middle, where it is too long to be read."""
    # characters of one fault: what was given may be of any size
    half = 2000 // 2
    left_out = len(text) - 2 * half
    return f"{text[:half]} ... ({left_out} characters) ... {text[-half:]}" if left_out > 0 else text


class MechgraphError(Exception):
    """Base of all errors that mechgraph raises on purpose; it pickles and copies with its data.

    Parameters
    ----------
    message : str
        What happened, where, and what to do.

    Examples
    --------
    >>> import mechgraph as mg
    >>> issubclass(mg.ReachError, mg.MechgraphError)
    True
    """

    def __init__(self, message: str) -> None:
        super().__init__(visible(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """By message and data: an exception's own way calls the constructor with the message alone."""
        return _restored, (type(self), self.args, self.__dict__)


class DeclarationError(MechgraphError):
    """Every fault of a declaration, or of the arguments of a call, in one error.

    Parameters
    ----------
    subject : str
        What was declared, e.g. ``mechanism 'four-bar'``.
    faults : sequence of str
        One line each: where, value, expected, what to do. The message lists the first of them.

    Examples
    --------
    >>> import mechgraph as mg
    >>> try:
    ...     mg.Mechanism("bad", pairs=[mg.Pair("A", "X", "frame", "crank")])
    ... except mg.DeclarationError as error:
    ...     print(len(error.faults), error.subject)
    1 mechanism 'bad'
    """

    def __init__(self, subject: str, faults: Sequence[str]) -> None:
        self.subject = shortened(subject)
        self.faults = tuple(map(shortened, faults))
        lines = [f"{self.subject}: {len(faults)} fault{'s' if len(faults) != 1 else ''}"]
        most_faults = 30  # faults that a message lists
        lines += [f"  {fault}" for fault in self.faults[:most_faults]]
        more = len(faults) - most_faults
        super().__init__("\n".join(lines + [f"  and {more} more (in .faults)"] * (more > 0)))


class ShapeError(DeclarationError):
    """A function given for a curve or surface raised (its cause), or returned unusable values.

    Parameters
    ----------
    text : str
        What it did, and at which parameters.
    pair : str, optional
        Name of the pair.

    Examples
    --------
    >>> import mechgraph as mg
    >>> issubclass(mg.ShapeError, mg.MechgraphError)
    True
    """

    def __init__(self, text: str, pair: str | None = None) -> None:
        self.text = text
        super().__init__("a curve or surface by a function" if pair is None else f"pair {pair!r}", [text])

    def of(self, pair: str) -> ShapeError:
        """The same error with the name of the pair."""
        return ShapeError(self.text, pair)


class MechgraphWarning(UserWarning):
    """A result holds only under an assumption, e.g. that something holds a load-bearing passive freedom.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", mg.MechgraphWarning)
    ...     s = mg.solve(mg.load("four-bar"), {"A": 0.5})
    """


class FileError(MechgraphError):
    """A file cannot be read or written.

    Parameters
    ----------
    path : str or path
        The file.
    reason : str
        Why.

    Examples
    --------
    >>> import mechgraph as mg
    >>> try:
    ...     mg.load("no-such-file.toml")
    ... except mg.FileError as error:
    ...     print(error.path)
    no-such-file.toml
    """

    def __init__(self, path: str | PathLike[str], reason: str) -> None:
        self.path = str(path)
        self.reason = shortened(reason)
        super().__init__(f"{shortened(self.path)}: {self.reason}")


class ContentError(DeclarationError, FileError):
    """Faults in the content of a readable file; a FileError and a DeclarationError.

    Parameters
    ----------
    path : str or path
        The file.
    found : DeclarationError
        The faults, with their places.

    Examples
    --------
    >>> import mechgraph as mg
    >>> issubclass(mg.ContentError, (mg.FileError)), issubclass(mg.ContentError, mg.DeclarationError)
    (True, True)
    """

    def __init__(self, path: str | PathLike[str], found: DeclarationError) -> None:
        self.path, self.reason = str(path), "its content is at fault"
        self.subject, self.faults = found.subject, found.faults
        MechgraphError.__init__(self, str(found))


class AssemblyError(MechgraphError):
    """The loops cannot be closed.

    Parameters
    ----------
    message : str
        What happened.
    residual : float
        Smallest closure residual found: largest angle [rad] or length / L over all loops.
    best : dict
        Pair coordinates at which it was found, freedom -> value.

    Examples
    --------
    >>> import mechgraph as mg
    >>> try:
    ...     mg.assemble(mg.chain("RRRR", length=[1, 1, 1, 5]))
    ... except mg.AssemblyError as error:
    ...     print(round(error.residual, 3))
    0.769
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
    """A position is not reachable on the present branch.

    Parameters
    ----------
    message : str
        What happened.
    value : dict
        Driver values reached.
    solution : Solution, optional
        The positions before.

    Examples
    --------
    >>> import mechgraph as mg
    >>> try:
    ...     mg.kinematics(mg.load("rcsr"), {"O1": [2.6, 3.8]})
    ... except mg.ReachError as error:
    ...     print(round(error.value["O1.Rz"], 4))
    3.5804
    """


class FrictionError(PathError):
    """A position has no finite forces with friction.

    Parameters
    ----------
    message : str
        What happened.
    value : dict
        Driver values there.
    solution : Solution, optional
        All positions; NaN where there are no forces.
    kind : {"jams", "no finite force"}
        How the solution ends while friction grows from zero.
    factor : float
        By how much friction would have to fall.
    places : tuple of str
        Pairs and couplings whose normal forces grow there.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.FrictionError("jams", {"A.Rz": 0.0}, kind="jams", factor=0.8, places=("B",)).factor
    0.8
    """

    def __init__(
        self,
        message: str,
        value: dict[str, float],
        solution: Any = None,
        *,
        kind: str = "jams",
        factor: float = 1.0,
        places: tuple[str, ...] = (),
    ) -> None:
        super().__init__(message, value, solution)
        self.kind, self.factor, self.places = kind, factor, places


class DeadPointError(PathError):
    """The drivers do not determine the motion at this position (dead point or change point).

    Parameters
    ----------
    message : str
        What happened.
    value : dict
        Driver values reached.
    solution : Solution, optional
        The positions before.

    Attributes
    ----------
    branches : tuple of dict
        Of a change point, the branches that meet there: freedom -> rate for a unit rate of the first driver.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("slider-crank").replace(drives=["D"])
    >>> try:
    ...     mg.solve(m, {"D": [0.0, 0.5]})
    ... except (mg.DeadPointError, mg.ReachError) as error:
    ...     print(sorted(error.value))
    ['D.Tz']
    """

    branches: tuple[dict[str, float], ...] = ()


class IndeterminateError(MechgraphError):
    """A freedom is neither driven nor passive, or the motions of the drivers conflict.

    Parameters
    ----------
    message : str
        What happened.
    report : DeterminacyReport, optional
        The report at that position.

    Examples
    --------
    >>> import mechgraph as mg
    >>> try:
    ...     mg.solve(mg.load("four-bar").replace(drives=[]), {})
    ... except mg.IndeterminateError as error:
    ...     print(error.report.mobility)
    1
    """

    def __init__(self, message: str, report: Any = None) -> None:
        self.report = report
        super().__init__(message)


class ResponseError(MechgraphError):
    """A motion in time cannot be integrated to its end.

    Parameters
    ----------
    message : str
        What happened, and when.
    solution : Response, optional
        The response so far.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pin = mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1))
    >>> push = mg.ForceLaw("A", law=lambda x, v, t: v**3)
    >>> bob = mg.Mechanism("bob", [mg.Link("frame"), mg.Link("bob", 1.0, (1, 0, 0))], [pin], loads=[push])
    >>> try:
    ...     mg.respond(bob, (0, 10), rates={"A": 1.0})  # v = 1 / sqrt(1 - 2 t)
    ... except mg.ResponseError as error:
    ...     print(round(float(error.solution.t[-1]), 6))
    0.5
    """

    def __init__(self, message: str, solution: Any = None) -> None:
        self.solution = solution
        super().__init__(message)


class StudyError(MechgraphError):
    """A study could not be finished.

    Parameters
    ----------
    message : str
        What happened.
    study : Study, optional
        The variants that were solved.

    Examples
    --------
    >>> import mechgraph as mg
    >>> def stop(done, of):
    ...     raise ValueError("enough")
    >>> try:
    ...     mg.study(
    ...         mg.load("four-bar"),
    ...         {"crank.mass": [0.03]},
    ...         "A.effort",
    ...         sampling="grid",
    ...         motions={"A": 0.5},
    ...         progress=stop,
    ...     )
    ... except mg.StudyError as error:
    ...     print(error)
    study of 'four-bar': progress raised ValueError: enough
    """

    def __init__(self, message: str, study: Any = None) -> None:
        self.study = study
        super().__init__(message)


class MissingExtraError(MechgraphError, ImportError):
    """An optional package is not installed; the message names the extra to install.

    Parameters
    ----------
    package, extra : str
        Names of the package and of the extra.

    Examples
    --------
    >>> import mechgraph as mg
    >>> print(mg.MissingExtraError("matplotlib", "plot"))
    matplotlib is not installed. Run: pip install 'mechgraph[plot]'
    """

    def __init__(self, package: str, extra: str) -> None:
        self.package = package
        self.extra = extra
        super().__init__(f"{package} is not installed. Run: pip install 'mechgraph[{extra}]'")


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


Item = TypeVar("Item")


class SearchEnded(MechgraphError):
    """A search was given up."""


class Budget:
    """Seconds that a search may take on one quiet core; every step of it says what it takes by the sizes of its arrays (measured)."""

    TOOK_TOO_LONG = "the search took longer than it may"

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    @property
    def ended(self) -> bool:
        """Whether more was spent than there was."""
        return self.left < 0.0

    def spend(self, seconds: float) -> None:
        """Count a step.

        Raises
        ------
        SearchEnded
            where nothing is left.
        """
        self.left -= seconds
        if self.ended:
            raise SearchEnded(self.TOOK_TOO_LONG)

    def of(self, items: Iterable[Item], seconds: float) -> Iterator[Item]:
        """The items, each of which costs as much, as far as there is something left."""
        for item in items:
            self.left -= seconds
            if self.ended:
                return
            yield item
