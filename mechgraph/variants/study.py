"""Studies of many variants: tolerances, sweeps of a design, Monte Carlo, with quantiles and sensitivities."""

from __future__ import annotations

import concurrent.futures
import os
import pickle
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from mechgraph.closure.driver_motion import Motions, actuators, driven
from mechgraph.closure.solver import MotionEngineName
from mechgraph.determinacy.snapping import meant
from mechgraph.errors import DeclarationError, MechgraphError, MechgraphWarning, StudyError, counted
from mechgraph.force.reactions import MethodName
from mechgraph.kinetostatics import RedundantName
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.quantities import Count, Index, door, wrong
from mechgraph.variants.fields import AnyField, clashes, field_values, find_field
from mechgraph.variants.outputs import named_outputs
from mechgraph.variants.result import Study
from mechgraph.variants.sampling import SAMPLINGS, SamplingName, distributions, grid_size, spread
from mechgraph.variants.work import Part, Source, Task, as_rows, motion_of_case, solved, unsolved

POSITIONS_TOGETHER = 60_000
"""Positions of all variants that are solved together: bounds the memory."""
MOST_TOGETHER = 500
"""Variants that are followed together: their arrays stay in the cache."""
FEW_ALONE = 20
"""Variants in a part where each is solved alone: so few that all processors have some."""
DIFFERENCE = 1e-4
"""Step of the central differences of the sensitivities, as a part of the spread of the parameter."""

MOST_VARIANTS = 10_000_000
"""Largest study: its outputs are kept in memory."""
SMALLEST = 1e-6
"""Smallest step of a difference, as a part of the parameter (of one, where that is zero)."""

Progress = Callable[[int, int], None]


@door
def study(
    m: Mechanism | Callable[..., Mechanism],
    parameters: Mapping[str, Any],
    outputs: Any,
    n: Count = 1000,
    seed: Index = 0,
    *,
    motions: Mapping[str, Any] | None = None,
    actuate: str | Iterable[str] | None = None,
    sampling: SamplingName = "random",
    executor: concurrent.futures.Executor | None = None,
    method: MethodName = "loop_wrench",
    redundant: RedundantName = "nan",
    engine: MotionEngineName = "auto",
    tol: float | None = None,
    progress: Progress | None = None,
) -> Study:
    """Solve many variants of one mechanism: how outputs vary with its numbers.

    Parameters
    ----------
    m : a mechanism; or a function ``build(**parameters)`` that returns one, always of the same topology.
    parameters : declared number -> distribution of ``scipy.stats`` or numbers. Declared numbers are named as in
        ``mechgraph.variants.fields``: ``crank.mass``, ``B.on_a.point.x``, ``loads[0].stiffness``, ``length[2]`` of a chain.
    outputs : quantities by name (``"A.effort"``, ``"B.force"``, ``"B:Fx"``, ``"coupler.center"``), or a mapping name -> quantity or
        function of a Solution with the batch ``(variants, positions)``.
    n : number of variants; on a grid, of levels of every distribution (a list of numbers is taken as given).
    seed : of the sample. The same seed gives the same result, whatever the executor.
    motions : of the drivers as in ``solve``; a leading axis of length ``n`` gives every variant its own.
    sampling : ``"random"``, ``"latin"`` (Latin hypercube) or ``"grid"``.
    executor : any ``concurrent.futures`` Executor, e.g. that of a cluster; left out, the processors of this machine: threads where the
        compiled kernel serves, else processes.
    actuate, method, redundant, engine, tol : as in ``solve``; every variant is taken as it is meant with the tolerance.
    progress : called with the numbers of parts done and of all parts.

    Returns
    -------
    Study
        A variant that cannot be built, assembled or moved has NaN in its outputs and says so in ``status`` and ``messages``; it
        never stops the others. The start of every variant is followed from the mechanism itself while its numbers change into those of
        the variant, so that it is on the same branch, also where the variant is then solved alone because a position is out of
        reach or near a dead point. Where that path cannot be followed, the variant is assembled and solved alone, as ``solve``
        does. The orientation of a passive body whose centre is off its line is the one that it reaches along that path.

    Raises
    ------
    DeclarationError
        with all faults of parameters and outputs at once. Errors of the mechanism itself as in ``solve``.
    StudyError
        where processes ended before their variants were solved, again when these were tried alone, where an executor gave up, or
        ``progress`` raised; carries the Study of all others.
    """
    ways = distributions(parameters)
    faults = [] if ways else ["parameters: none are named"]
    faults += [wrong(n, "n", f"at most {MOST_VARIANTS} variants")] if n > MOST_VARIANTS else []
    if faults:
        raise DeclarationError("study", faults)
    source, given = _source(m, ways, motions, tol)
    acting = None if actuate is None else actuators(source.mechanism, actuate)
    kept = named_outputs(source.mechanism, outputs, ways)
    if sampling == "grid" and (count := grid_size(list(ways.values()), int(n))) > MOST_VARIANTS:
        raise DeclarationError("study", [f"a grid of {count:.3g} variants: at most {MOST_VARIANTS} are solved"])
    values = SAMPLINGS[sampling](list(ways.values()), int(n), np.random.default_rng(seed))
    paths = {name: _rows_of(name, motion, values.shape[1]) for name, motion in given.items()}
    steps = np.array(
        [
            max(DIFFERENCE * spread(way), SMALLEST * (abs(p) or 1.0))
            for way, p in zip(ways.values(), source.start, strict=True)
        ]
    )
    near = np.concatenate([np.zeros((len(steps), 1)), np.diag(steps), -np.diag(steps)], axis=1) + source.start[:, None]

    def task(some: slice) -> Task:
        own = Motions({name: motion_of_case(motion, at[some]) for name, motion in paths.items()}, given.free)
        return Task(source, whole[:, some], own, kept, method, redundant, engine, acting)

    size = max(1, min(MOST_TOGETHER, POSITIONS_TOGETHER // max(motion.shape[-1] for motion in paths.values())))
    size = min(size, FEW_ALONE) if source.one_by_one else size
    # those near the mechanism itself and the first ones together: of few positions a part takes calls, not numbers
    few, whole = near.shape[1], np.concatenate([near, values], axis=1)
    at = np.concatenate([np.zeros(few, dtype=np.intp), np.arange(values.shape[1])])
    cuts = [0, *range(max(size, few), whole.shape[1], size), whole.shape[1]]
    tasks = [task(slice(*ends)) for ends in pairwise(cuts)]
    done, why, cause = _all_solved(tasks, executor, progress)
    parts = [done[i] if i in done else unsolved(one, why) for i, one in enumerate(tasks)]
    beside, first = parts[0].cut(few)
    found = Study(
        source, ways, values, steps, kept, paths, beside, [*([first] if first.status.size else []), *parts[1:]]
    )
    if why:
        raise StudyError(f"study of {source.mechanism.name!r}: {why}", found) from cause
    for warning in found.warnings:
        warnings.warn(f"study of {source.mechanism.name!r}: {warning}", MechgraphWarning, stacklevel=3)
    return found


def _source(
    m: Mechanism | Callable[..., Mechanism],
    ways: Mapping[str, Any],
    motions: Mapping[str, Any] | None,
    tol: float | None,
) -> tuple[Source, Motions]:
    names = tuple(ways)
    if isinstance(m, Mechanism):
        own, given = driven(m, motions)
        found = {name: find_field(own, name) for name in names}
        faults = [fault for fault in found.values() if isinstance(fault, str)]
        fields: dict[str, AnyField] = {name: f for name, f in found.items() if not isinstance(f, str)}
        faults += clashes(own, fields)
        if faults:
            raise DeclarationError(f"study of {m.name!r}", faults)
        start = field_values(own, fields)
        tol = own.tol if tol is None else tol
        begin = np.array([start[name] for name in names])
        return Source(meant(own, tol, "study"), names, begin, fields, tol=tol), given
    middle = np.array([float(way.ppf(0.5)) for way in ways.values()])
    try:
        first = m(**dict(zip(names, middle.tolist(), strict=True)))
    except Exception as error:
        raise DeclarationError(
            "study", [f"the function failed at the medians of the parameters: {type(error).__name__}: {error}"]
        ) from error
    if not isinstance(first, Mechanism):
        raise DeclarationError("study", [f"the function gave {type(first).__name__}; expected a Mechanism"])
    own, given = driven(first, motions)
    named = {own.full_name(key) for key in motions or {} if own.freedom_fault(key, single=True) is None}
    stored = tuple(name for name in given if name in own.freedom_names() and name not in named)
    tol = own.tol if tol is None else tol
    exact = meant(own, tol, "study")
    return Source(exact, names, middle, build=m, stored=stored, redriven=own is not first, tol=tol), given


def _rows_of(name: str, motion: Motion, count: int) -> Motion:
    """The motion as ``(1 or count, N)``."""
    out = as_rows(motion)
    if len(out.shape) != 2 or out.shape[0] not in (1, count) or not out.shape[1]:
        raise DeclarationError(
            "study", [f"motion of {name!r}: shape {motion.shape}; expected positions, or {count} variants x positions"]
        )
    return out


def _all_solved(
    tasks: Sequence[Task], executor: concurrent.futures.Executor | None, progress: Progress | None
) -> tuple[dict[int, Part], str, Exception | None]:
    """Parts by the numbers of their tasks; why some are missing, and the error that it came from."""
    done: dict[int, Part] = {}
    try:
        for i, part in _streamed(tasks, executor):
            done[i] = part
            try:
                if progress is not None:
                    progress(len(done), len(tasks))
            except Exception as error:
                return done, f"progress raised {type(error).__name__}: {error}", error
    except MechgraphError:
        raise
    except Exception as error:
        lost = counted(len(tasks) - len(done), "part")
        return done, f"{lost} of {len(tasks)} ended with {type(error).__name__}: {error}", error
    missing = len(tasks) - len(done)
    why = (
        f"the process of {counted(missing, 'part')} of {len(tasks)} ended before it was done (out of memory, or killed)"
    )
    return done, why if missing else "", None


def _streamed(tasks: Sequence[Task], executor: concurrent.futures.Executor | None) -> Iterator[tuple[int, Part]]:
    """Parts as they come: from the executor, from threads or processes of this machine where there is much to do, or from here.

    Threads, where the compiled kernel does nearly all of the work, for which Python's lock is released.
    """
    workers, left = os.cpu_count() or 1, dict(enumerate(tasks))
    if executor is not None:
        yield from _submitted(left, executor)
        return
    if len(tasks) > 2 and workers > 1:
        threads = False
        if tasks[0].may_be_compiled:
            first = solved(left.pop(0))
            yield 0, first
            threads = first.compiled
        if threads:
            with concurrent.futures.ThreadPoolExecutor(min(workers, len(left))) as pool:
                yield from _submitted(left, pool)
            return
        if _can_be_sent(tasks[0]):
            yield from _in_processes(left, workers)
            return
    for i, task in left.items():
        yield i, solved(task)


def _in_processes(left: dict[int, Task], workers: int) -> Iterator[tuple[int, Part]]:
    """Parts as they come from processes of this machine.

    Those that a process took with it when it ended are tried again, as long as others come, then each in a process of its own; those that
    end this one too are left out.
    """
    before = len(left) + 1
    while 0 < len(left) < before:
        before = len(left)
        with concurrent.futures.ProcessPoolExecutor(min(workers, before)) as pool:
            for i, part in _submitted(left, pool):
                del left[i]
                yield i, part
    for i, task in left.items():
        with concurrent.futures.ProcessPoolExecutor(1) as pool:
            yield from _submitted({i: task}, pool)


def _submitted(tasks: Mapping[int, Task], executor: concurrent.futures.Executor) -> Iterator[tuple[int, Part]]:
    """Parts as they come, as far as the processes of the executor live.

    Where one fails for a reason of the executor's own, as a cluster that gives up a task, the others are waited for.
    """
    futures: dict[concurrent.futures.Future[Part], int] = {}
    failed: BaseException | None = None
    try:
        for i, task in tasks.items():
            futures[executor.submit(solved, task)] = i
        for future in concurrent.futures.as_completed(futures):
            error = future.exception()
            if error is None or isinstance(error, MechgraphError):
                yield futures[future], future.result()
            elif not isinstance(error, concurrent.futures.BrokenExecutor):
                failed = failed or error
        if failed is not None:
            raise failed
    except concurrent.futures.BrokenExecutor:  # in the midst of being given tasks
        return
    finally:
        for future in futures:
            future.cancel()


def _can_be_sent(task: Task) -> bool:
    """Whether a task can go to another process: functions typed at a prompt, or without a name, cannot."""
    try:
        pickle.dumps(task)
    except Exception:
        return False
    return True
