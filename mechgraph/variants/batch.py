"""Kinetostatics of many variants of one mechanism as one batch ``(variants, positions)``.

The start of every variant is followed from the mechanism itself: from its closed start, while its numbers change into those of the
variant. This is a path like any other, with the part of the way in place of a driver.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.by_kernel import InKernel, in_kernel
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.driver_path import DriverPath
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.poles import away_from_poles
from mechgraph.closure.solver import FactoredClosure, closure_solver
from mechgraph.determinacy.snapping import declared_closure
from mechgraph.errors import DeclarationError
from mechgraph.kinetostatics import Pipeline
from mechgraph.model.motion import Motion
from mechgraph.model.parameters import Parameters
from mechgraph.numerics.continuation import End, Follower, Tracks
from mechgraph.numerics.tracks import Paths
from mechgraph.outcome import Options, Starts
from mechgraph.result.solution import Solution
from mechgraph.variants.fields import Variants

Mask = NDArray[np.bool_]
NumbersAt = Callable[[Array, Index], Variants]
"""Gives variants ``(n,)``, each with its numbers at a part ``(n,)`` of the way from those of the mechanism itself (0) to its own (1)."""


class NumbersPath(DriverPath):
    """The closure equations while the numbers change, drivers at rest: the path value is the part of the way."""

    def __init__(self, line: Pipeline, numbers_at: NumbersAt) -> None:
        solver = closure_solver(line.engine, line.leading, line.freedoms.hold if line.passive else None)
        super().__init__(line.system, solver, line.system.cases)
        self.size, self.paced = (self.system.n_freedoms, 1), True
        self._line, self._numbers_at = line, numbers_at
        self._known: dict[bytes, System] = {}

    def system_at(self, part: Array, variants: Index) -> System:
        """The system with the numbers of variants ``(n,)``, each at its part of the way; those of the last calls are kept."""
        key = part.tobytes() + variants.tobytes()
        if key not in self._known:
            self._known = dict([*self._known.items()][1 - SYSTEMS :])
            self._known[key] = self.system_of(self._numbers_at(part, variants))
        return self._known[key]

    def system_of(self, variants: Variants) -> System:
        """The system with the numbers of variants."""
        par, m = self.system.par, self._line.m
        made = variants.numbers.with_rest(m).parameters(m, par.offset, par.origin, par.L)
        # one array with all variants says how many there are
        mass = np.broadcast_to(made.mass, (len(m.links), variants.count))
        return self.system.with_parameters(dataclasses.replace(made, mass=mass))

    def built_at(self, part: Array, variants: Index) -> tuple[System, Mask]:
        """The system with the numbers of variants at a part of the way, and which could be built."""
        found, built = self._numbers_at(part, variants), np.ones(len(part), dtype=bool)
        built[list(found.missing)] = False
        return self.system_of(found), built

    def at(self, x: Array, drive: Array, tracks: Index) -> Configuration:
        """The equations with the numbers at a part of the way."""
        self._last = drive, tracks
        return Configuration(self.system_at(drive[0], tracks), x.copy())

    def sensitivity(self, point: Configuration, factored: FactoredClosure) -> Array:
        """Rates with the part of the way, by a forward difference: the numbers come from a function or a table of any kind."""
        drive, tracks = self._last
        step = self._step[tracks]
        ahead = Configuration(self.system_at(drive[0] + step, tracks), point.x).residual - point.residual
        return factored.solve(-ahead[:, None] / step)

    def pace(self, x: Array, rates: Array) -> Array:
        """The largest rate: where the numbers change by little, so do the equations, however far the way is."""
        return np.minimum(np.abs(rates).max(axis=0, initial=0.0), 1.0)

    def lead(self, x: Array, valid: Mask) -> Tracks:
        """The ``valid`` variants from states ``x (nx, V)`` of the mechanism itself, in one step where the numbers change by little."""
        V = x.shape[1]
        here, there = (Configuration(self.system_at(np.full(V, part), np.arange(V)), x) for part in (0.0, 1.0))
        way = np.nan_to_num(np.abs(there.residual - here.residual).max(axis=0, initial=0.0))
        form = self.solver.chosen(here.part(np.arange(1)), np.full(1, -1))  # all begin in the mechanism itself
        self._step = NUMBERS_STEP / np.where(way > 0, np.clip(way, NUMBERS_STEP / LONGEST_STEP, 1.0), 1.0)
        paths = Paths([np.array([[0.0, float(ok)]]) for ok in valid])
        return Follower(self, leads=False).follow(x, paths, first=1.0, which=np.repeat(form, V))


SYSTEMS = 4
"""Systems that are kept: a difference asks for two, and Newton's method for both of them again."""
NUMBERS_STEP = 1e-7
"""What the numbers change by in that difference (radians, lengths / L): half the digits are left, which a prediction does not miss."""
LONGEST_STEP = 1e-3
"""The longest step for that, in parts of the way, where the numbers change by less on the whole of it."""


@dataclasses.dataclass(frozen=True)
class Together:
    """The solution of all variants that could be followed from the mechanism itself, and which could not (``alone``).

    ``starts (F, V)``: user coordinates where each variant begins, NaN where it is not known.
    """

    solution: Solution | None
    alone: Mask
    starts: Array


def solve_together(
    numbers_at: NumbersAt,
    count: int,
    motions: Mapping[str, Motion],
    options: Options,
    actuate: tuple[str, ...] | None = None,
) -> Together:
    """All variants as one batch; NaN for those to be solved alone: they cannot be built, or not followed from the mechanism itself."""
    every = np.arange(count)
    variants, V = numbers_at(np.ones(count), every), count
    nothing = np.full((sum(p.type.f for p in variants.mechanism.pairs), V), np.nan)
    line = Pipeline(DriverMotion(variants.mechanism, motions, actuate), options)
    path = NumbersPath(line, numbers_at)
    valid = variants.valid()
    good = np.flatnonzero(valid)
    if not good.size:
        return Together(None, np.ones(V, dtype=bool), nothing)
    systems = path.system_of(variants)
    kernel = in_kernel(line, systems, variants.loads, V)
    one_motion = int(np.prod(line.drive.batch[:-1])) == 1
    if V > 1 and one_motion and valid.all() and _move_alike(line.system.par, systems.par):
        begun, x, sharing = valid, line.x[:, None], V
    else:
        begun, x, sharing = *_led(line, path, kernel, valid), 1
    if not begun.any():
        return Together(None, np.ones(V, dtype=bool), nothing)
    if kernel is not None:
        kernel.begin(x)
    starts = Starts(x, systems.cases, variants.loads, sharing, kernel)
    q = systems.coordinates_of(starts.x[..., None], line.system.start_coordinates(line.m.start))[: len(nothing), :, 0]
    q = np.broadcast_to(q, nothing.shape)
    try:
        outcome = line.run(starts, np.broadcast_shapes((V, 1), line.drive.batch))
    except DeclarationError:
        return Together(None, np.ones(V, dtype=bool), q)
    if outcome.found is not None and away_from_poles(line.m, line.system, outcome.found) is not None:
        return Together(None, np.ones(V, dtype=bool), q)
    numbers, tol = variants.declared, line.m.tol
    if numbers is not None and tol is not None:
        variant = np.arange(int(np.prod(outcome.batch))) // outcome.batch[-1]
        outcome.trajectory.as_declared(lambda x, at: declared_closure(line.system, numbers, x, variant[at]), tol)
    alone = ~begun | outcome.contradicting.reshape(V, -1).any(axis=1)
    return Together(Solution(outcome.trajectory), alone, q)


def _move_alike(itself: Parameters, varied: Parameters) -> bool:
    """Whether variants differ from the mechanism itself in masses alone."""
    names = ("marker_a", "marker_b", "pitch", "couplings")
    return all(bool((getattr(itself, name) == getattr(varied, name)).all()) for name in names)


def _led(line: Pipeline, path: NumbersPath, kernel: InKernel | None, valid: Mask) -> tuple[Mask, Array]:
    """Which variants could be led from the mechanism itself, and where they begin ``(nx, V)``, NaN for the others.

    Those that the kernel does not lead, numpy does, and all that have passive freedoms.
    """
    V = len(valid)
    x = np.full((len(line.x), V), np.nan) if kernel is None or line.passive else kernel.lead(valid, path.built_at)
    left = valid & np.isnan(x).any(axis=0)
    if left.any():
        tracks = path.lead(np.repeat(line.x[:, None], V, axis=1), left)
        last = np.zeros(V, dtype=np.intp)
        last[tracks.nodes.track] = np.arange(len(tracks.nodes))
        reached = left & np.array([end is End.REACHED for end in tracks.end])
        x[:, reached] = tracks.nodes.x[:, last[reached]]
    return valid & ~np.isnan(x).any(axis=0), x
