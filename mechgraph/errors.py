"""The errors of mechgraph: one family, each carries the data that its message is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from os import PathLike


class MechgraphError(Exception):
    """The base of every error that mechgraph raises on purpose; it pickles and copies with the data that it carries."""

    def __reduce__(self) -> tuple[Any, ...]:
        """By message and data: an exception's own way calls the constructor with the message alone."""
        return _restored, (type(self), self.args, self.__dict__)


class DeclarationError(MechgraphError):
    """All faults of a declaration (or of a call's arguments), collected and raised once.

    Attributes
    ----------
    subject : what was declared, e.g. ``mechanism 'four-bar'``.
    faults : one line each: what, where, the value, what was expected, what to do.
    """

    def __init__(self, subject: str, faults: Sequence[str]) -> None:
        self.subject = subject
        self.faults = tuple(faults)
        count = f"{len(self.faults)} fault{'s' if len(self.faults) != 1 else ''}"
        super().__init__("\n".join([f"{subject}: {count}", *(f"  {fault}" for fault in self.faults)]))


class MechgraphWarning(UserWarning):
    """A result that holds only under an assumption, e.g. that something holds a passive freedom that carries load."""


class FileError(MechgraphError):
    """A file cannot be read or written; ``path`` says which."""

    def __init__(self, path: str | PathLike[str], reason: str) -> None:
        self.path = str(path)
        self.reason = reason
        super().__init__(f"{path}: {reason}")


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
