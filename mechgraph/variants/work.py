"""The work of a study in parts that can be sent to other processes: some variants solved together, the rest one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph import by_kernel
from mechgraph.algebra.se3 import Array
from mechgraph.by_kernel import COMPILED
from mechgraph.closure.driver_motion import Motions
from mechgraph.closure.driver_path import Status
from mechgraph.closure.indexing import Index
from mechgraph.closure.solver import MotionEngineName
from mechgraph.determinacy.snapping import SnappedMechanism, meant, started
from mechgraph.errors import DeclarationError, MechgraphError
from mechgraph.force.reactions import MethodName
from mechgraph.kinetostatics import RedundantName, solve_quietly
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.outcome import Options
from mechgraph.result.contacts import LiftOff, Overlap
from mechgraph.result.solution import Solution
from mechgraph.result.values import LoadBearing, Unbalanced
from mechgraph.variants.batch import solve_together
from mechgraph.variants.fields import AnyField, Variants, stacked, topology_of, varied
from mechgraph.variants.number_names import ItemField
from mechgraph.variants.outputs import Output, quantity

Doubt = LoadBearing | LiftOff | Overlap | Unbalanced
"""What makes a solution doubtful."""
Build = Callable[..., Mechanism]
NOT_SOLVED = "not solved"
"""Status of a variant that could not be built or assembled; its message says why."""
STATUSES = np.array([*(status.value for status in Status), NOT_SOLVED])
"""Named outcomes by the number that stands for them, that of a solved position first."""


@dataclass(frozen=True)
class Source:
    """Where variants come from: fields of a mechanism, or a function that builds one; ``start`` are its own values.

    With a ``tol`` every mechanism is taken as it is meant with it, ``mechanism`` too (see ``Mechanism.snapped``).
    ``stored`` are the drivers whose motion is that stored with the mechanism; ``redriven`` whether the study has other drives than those
    declared.
    """

    mechanism: Mechanism
    names: tuple[str, ...]
    start: Array
    fields: Mapping[str, AnyField] | None = None
    build: Build | None = None
    stored: tuple[str, ...] = ()
    redriven: bool = False
    tol: float | None = None

    @property
    def one_by_one(self) -> bool:
        """Whether curves, surfaces, contacts or named points vary, so that every variant is solved alone."""
        return any(isinstance(field, ItemField) and field.one_by_one for field in (self.fields or {}).values())

    def one(self, values: Array) -> Mechanism:
        """The mechanism for ``values (parameters,)``, as it is meant with the tolerance."""
        return meant(self._declared(values), self.tol, "study")

    def _declared(self, values: Array) -> Mechanism:
        if self.build is None:
            return self._varied(values[:, None]).one(0)
        made = self.build(**dict(zip(self.names, values.tolist(), strict=True)))
        if not isinstance(made, Mechanism):
            raise DeclarationError("study", [f"the function gave {type(made).__name__}; expected a Mechanism"])
        if self.redriven:
            made = made.replace(drives=self.mechanism.drives)
        if topology_of(made) != topology_of(self._as_declared):
            raise DeclarationError(
                f"study of {self.mechanism.name!r}",
                ["a variant differs in links, pairs, drives, loads or units from the first; only numbers may differ"],
            )
        return made

    def _varied(self, values: Array) -> Variants:
        assert self.fields is not None
        return varied(self._as_declared, self.fields, values)

    @property
    def _as_declared(self) -> Mechanism:
        """The mechanism itself as it was declared."""
        return self.mechanism.declared if isinstance(self.mechanism, SnappedMechanism) else self.mechanism

    def variants(self, values: Array, part: Array) -> Variants:
        """Variants at a ``part (count,)`` of the way from the mechanism itself (0) to ``values (parameters, count)`` (1, or a bit more)."""
        on_the_way = self.start[:, None] + part * (values - self.start[:, None])
        if self.build is None and self.tol is None:
            return self._varied(on_the_way)
        made: list[Mechanism | None] = []
        for column, moved in zip(on_the_way.T, np.broadcast_to(part > 0, values.shape[1:]), strict=True):
            if not moved:
                made.append(self.mechanism)
                continue
            try:
                made.append(self.one(column))
            except Exception:  # the message is given where this variant is solved alone
                made.append(None)
        return stacked(self.mechanism, made)


@dataclass(frozen=True)
class Task:
    """Some variants to be solved: ``values (parameters, count)``, motions ``(1 or count, N)``, and what is kept of them."""

    source: Source
    values: Array
    motions: Motions
    outputs: Mapping[str, Output]
    method: MethodName
    redundant: RedundantName
    engine: MotionEngineName
    actuate: tuple[str, ...] | None = None

    @property
    def may_be_compiled(self) -> bool:
        """Whether the kernel may serve, and no variant is built by a function."""
        asked = self.engine == COMPILED or (self.engine == "auto" and by_kernel.at_hand() is not None)
        return asked and self.source.build is None and self.source.tol is None and not self.source.one_by_one


@dataclass(frozen=True)
class Part:
    """What came of a task: outputs ``(count, ...)`` (None where no variant could be solved), messages, and for every position
    ``(count, N)`` the number of its outcome in ``STATUSES``; what makes reactions doubtful, of all variants; whether the compiled kernel
    solved them together.
    """

    outputs: dict[str, Array] | None
    status: NDArray[np.int8]
    messages: dict[int, str]
    warnings: tuple[Doubt, ...] = ()
    compiled: bool = False

    def cut(self, count: int) -> tuple[Part, Part]:
        """The first ``count`` variants, and the others; what makes reactions doubtful stays with the first."""

        def part(some: slice, begin: int, warnings: tuple[Doubt, ...]) -> Part:
            outputs = None if self.outputs is None else {name: values[some] for name, values in self.outputs.items()}
            messages = {i - begin: why for i, why in self.messages.items() if i in range(len(self.status))[some]}
            return Part(outputs, self.status[some], messages, warnings)

        return part(slice(count), 0, self.warnings), part(slice(count, None), count, ())


def unsolved(task: Task, why: str) -> Part:
    """A part of which nothing came."""
    count, positions = task.values.shape[1], max(motion.shape[-1] for motion in task.motions.values())
    status = np.full((count, positions), len(STATUSES) - 1, dtype=np.int8)
    return Part(None, status, dict.fromkeys(range(count), why))


def worst(found: Iterable[Doubt]) -> tuple[Doubt, ...]:
    """Of every passive freedom the warning with the greatest effort, of every contact that with the greatest pull, and the deepest cut;
    of every check the greatest error.
    """
    out: dict[tuple[type, str], tuple[float, Doubt]] = {}
    for warning in found:
        match warning:
            case LoadBearing():
                name, size = warning.name, warning.effort
            case LiftOff():
                name, size = warning.pair, warning.force
            case Overlap():
                name, size = warning.pair, warning.curvature
            case Unbalanced():
                name, size = warning.check, warning.error
        key = type(warning), name
        if size >= out.get(key, (size, warning))[0]:
            out[key] = size, warning
    return tuple(warning for _, warning in out.values())


def solved(task: Task) -> Part:
    """Solve the variants of a task: together where they can be followed in step, alone where not."""
    count = task.values.shape[1]
    together = solve_together(
        lambda part, which: task.source.variants(task.values[:, which], part),
        count,
        task.motions,
        Options(task.method, task.redundant, task.engine),
        task.actuate,
    )
    alone = together.alone
    N = max(motion.shape[-1] for motion in task.motions.values())
    status = np.full((count, N), NOT_SOLVED, dtype="U24")
    found: dict[str, Array] | None = None
    if together.solution is not None:
        status[~alone] = together.solution.status[~alone]
        found = {name: _writable(quantity(together.solution, name, what)) for name, what in task.outputs.items()}
    messages, warnings = {}, [] if together.solution is None else [*together.solution.doubts]
    for i in np.flatnonzero(alone):
        try:
            s = _solved_alone(task, int(i), together.starts[:, i])
        except MechgraphError as error:
            messages[int(i)] = str(error)
            s = None
        if s is not None:
            status[i] = s.status[0]
            warnings += s.doubts
            values = {name: quantity(s, name, what) for name, what in task.outputs.items()}
            found = found or {name: np.full((count, *v.shape[1:]), np.nan) for name, v in values.items()}
            for name, v in values.items():
                found[name][i] = v[0]
        elif found is not None:
            for v in found.values():
                v[i] = np.nan
    compiled = together.solution is not None and together.solution.engine == COMPILED
    return Part(found, numbered(status), messages, worst(warnings), compiled)


def numbered(status: NDArray[np.str_]) -> NDArray[np.int8]:
    """Outcomes as their numbers in ``STATUSES``."""
    out = np.full(status.shape, len(STATUSES) - 1, dtype=np.int8)
    for i, name in enumerate(STATUSES):
        out[status == name] = i
    return out


def _writable(values: Array) -> Array:
    return np.array(values, dtype=float)


def _solved_alone(task: Task, i: int, start: Array) -> Solution:
    """One variant alone, from coordinates ``start (F,)`` if known; positions out of reach flagged; as a batch ``(1, N)``."""
    try:
        m = task.source.one(task.values[:, i])
    except MechgraphError:
        raise
    except Exception as error:
        raise DeclarationError("study", [f"the function failed: {type(error).__name__}: {error}"]) from error
    if np.isfinite(start).all():
        m = started(m, dict(zip(m.freedom_names(), start.tolist(), strict=True)))
    motions = Motions({name: motion_of_case(motion, i) for name, motion in task.motions.items()}, task.motions.free)
    own = {m.full_name(d.freedom): d.motion for d in m.drives if d.motion is not None}
    for name in task.source.stored:
        if own[name].shape[-1:] != motions[name].shape[-1:]:
            raise DeclarationError(
                "study", [f"the motion stored with drive {name!r} has other positions than that of the first"]
            )
        motions[name] = as_rows(own[name])
    return solve_quietly(m, motions, Options(task.method, task.redundant, task.engine), task.actuate)


def as_rows(motion: Motion) -> Motion:
    """A motion as ``(cases, N)``."""
    shape = motion.shape if len(motion.shape) > 1 else (1, *(motion.shape or (1,)))

    def rows(values: Any) -> Any:
        return None if values is None else np.broadcast_to(values, motion.shape).reshape(shape)

    return Motion(rows(motion.position), rows(motion.velocity), rows(motion.acceleration), rows(motion.t))


def motion_of_case(motion: Motion, cases: int | Index) -> Motion:
    """The motion of some cases, ``(1 or count, N)``."""
    one = np.atleast_1d(cases)

    def part(values: Any) -> Any:
        return None if values is None else values[one] if np.shape(values)[0] > 1 else values

    return Motion(part(motion.position), part(motion.velocity), part(motion.acceleration), part(motion.t))
