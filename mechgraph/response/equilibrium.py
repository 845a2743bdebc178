"""Positions in which loads balance: sought downhill, where a stable one is wished for, or by Newton, for the nearest one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.solver import EngineName
from mechgraph.determinacy.mobility import free_motion
from mechgraph.document import Document, Paragraph
from mechgraph.errors import ResponseError, listed
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door
from mechgraph.response.place import STEP, Derivatives, Place
from mechgraph.result.solution import Solution

EQUILIBRIUM_STEPS = 60
"""Most steps to an equilibrium."""
LONGEST_EQUILIBRIUM_STEP = 0.3
"""Longest of them (radians, lengths / L)."""
PUSH = 0.05
"""Length of the step by which an unstable equilibrium is left."""
SHORTENINGS = 40
"""Most halvings of a step that does not lead downhill, or to where the loops do not close."""
BALANCED = 1e-12
"""Generalized force, against the largest that a load exerts on the way, that counts as none."""
STIFF = 1e-9
"""Eigenvalue of the stiffness, against the largest, that counts as none: neither stable nor unstable."""
GROWS = 1e-7
"""Part of the fastest rate at which a small motion grows or dies away above which it does."""
EndKind = Literal["stable", "nearest"]

STABLE = {True: "stable", False: "unstable", None: "neither stable nor unstable to second order"}
"""How a position of equilibrium is called."""
NAMED = 8
"""Most coordinates that are shown."""


class Equilibrium(Mechanism):
    """The mechanism with ``start`` set to a position in which its loads balance.

    Attributes
    ----------
    stable : whether small motions stay small (True): the potential energy is least there; or grow (False). None where it is flat to
        second order in some direction. Where forces circulate or feed the motion the eigenvalues of the small motions decide: True where
        all of these die away, None where they go on. Passive freedoms do not count.
    idle : what passive freedoms there are, in words; nothing resists them.
    solution : everything at rest there, reactions included.
    """

    stable: bool | None
    idle: tuple[str, ...]
    solution: Solution

    def document(self) -> Document:
        """The position found, its kind, and the mechanism."""
        m = super().document()
        idle = f" Nothing resists {listed(self.idle)}." if self.idle else ""
        return Document(
            f"Equilibrium of {self.name}", (Paragraph(f"{STABLE[self.stable].capitalize()}.{idle}"), *m.blocks)
        )

    def __repr__(self) -> str:
        start = ", ".join(f"{name} = {value:.6g}" for name, value in list(self.start.items())[:NAMED])
        more = ", ..." if len(self.start) > NAMED else ""
        return f"Equilibrium({self.name!r}, {STABLE[self.stable]}, at {start or 'the declared configuration'}{more})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _balanced, (self._arguments(), self.stable, self.idle, self.solution)


def _balanced(arguments: dict[str, Any], stable: bool | None, idle: tuple[str, ...], solution: Solution) -> Equilibrium:
    out = Equilibrium(**arguments)
    out._set(stable=stable, idle=idle, solution=solution)
    return out


@door
def equilibrium(
    m: Mechanism, start: Mapping[str, float] | None = None, *, kind: EndKind = "stable", engine: EngineName = "auto"
) -> Equilibrium:
    """A position in which the declared loads balance, with the declared drives at their place.

    Parameters
    ----------
    start : coordinates of freedoms near which to look, beside the declared ``start``.
    kind : ``"stable"``: the way down from ``start``, in steps along which the loads do work, so that it ends at rest as damped motion
        does; ``"nearest"``: Newton from ``start``, which ends in any equilibrium. Where the one finds none, the other is tried; ``stable``
        says what was found.
    engine : as in ``solve``.

    Raises
    ------
    DeclarationError, AssemblyError
    ResponseError
        where none is found.
    """
    place = Place(m, "equilibrium of", start, engine)
    begin, why = place.chart.x0, ""
    ways: tuple[Callable[[Place], Derivatives | str], ...] = (_downhill, _newton)
    for way in ways if kind == "stable" else ways[::-1]:
        place.go(begin)
        found = way(place)
        if not isinstance(found, str):
            idle = free_motion(place.task.system, place.chart.x0, place.task.columns, place.task.engine).passive
            words = tuple(
                f"the {'spin' if one.turns else 'slide'} of {listed(m.links[i].name for i in one.links)}"
                for one in idle
            )
            rates = np.array([one.rates[place.chart.free] for one in idle]).reshape(len(idle), place.n)
            stable = _stability(found, scipy.linalg.null_space(rates) if len(idle) else np.eye(place.n))
            return _balanced({**m._arguments(), "start": place.start()}, stable, words, place.solution())
        why = why or found
    raise ResponseError(f"mechanism {m.name!r}: no equilibrium was found{why}")


def _largest(d: Derivatives) -> float:
    return max(float(np.abs(d.Q).max()), float(np.abs(d.K).max()) * STEP)


def _left(d: Derivatives) -> str:
    return (
        f" near start in {EQUILIBRIUM_STEPS} steps or fewer; generalized forces of {np.abs(d.Q).max():.3g} are left (internal units). "
        "Give another start; loads that drive it on and on have none"
    )


def _newton(place: Place) -> Derivatives | str:
    """Newton to where the forces balance, or why it does not come there."""
    largest = 0.0
    for _ in range(EQUILIBRIUM_STEPS):
        d = place.derivatives()
        largest = max(largest, _largest(d))
        if np.abs(d.Q).max() <= BALANCED * largest or not largest:
            return d
        step: Array = np.asarray(np.linalg.lstsq(d.K, d.Q, rcond=1e-12)[0], dtype=float)
        size = float(np.abs(step).max())
        if not size:
            return _left(d)
        for part in (1.0, 0.1):
            closed = place.closed(step[:, None] * part * min(1.0, LONGEST_EQUILIBRIUM_STEP / size))
            if closed.done[0]:
                break
        else:
            return ": the motion towards it is stopped by the loops"
        place.go(closed.here.x[:, 0])
    return _left(d)


def _downhill(place: Place) -> Derivatives | str:
    """Steps along which the loads do work, to where they balance and every small step costs some; or why it does not come there."""
    largest, longest = 0.0, LONGEST_EQUILIBRIUM_STEP
    for _ in range(EQUILIBRIUM_STEPS):
        d = place.derivatives()
        largest = max(largest, _largest(d))
        w, U = np.linalg.eigh(0.5 * (d.K + d.K.T))
        balanced = BALANCED * largest
        if np.abs(d.Q).max() <= balanced or not largest:
            if not w[0] < -STIFF * float(np.abs(w).max()):
                return d
            ways = [PUSH * U[:, 0], -PUSH * U[:, 0]]
        else:
            ways = [_step(d, w, U, balanced, longest)]
        tried = [_shortened(place, d.Q, way, balanced) for way in ways]
        work, step, x = max(tried, key=lambda one: one[0])
        if x is None:
            return ": the motion towards it is stopped by the loops"
        longest = min(LONGEST_EQUILIBRIUM_STEP, 4.0 * float(np.abs(step).max()))
        place.go(x)
    return _left(d)


def _step(d: Derivatives, w: Array, U: Array, balanced: float, longest: float) -> Array:
    """Newton's step where the energy curves upwards; elsewhere along the curvatures with their signs turned, which leads downwards."""
    if w[0] > STIFF * w[-1]:
        step = np.linalg.solve(d.K, d.Q)
    else:
        q, size = U.T @ d.Q, np.abs(w)
        far = np.abs(q) >= longest * size
        step = U @ np.where(
            np.abs(q) > balanced, np.where(far, longest * np.sign(q), q / np.where(far, 1.0, size)), 0.0
        )
    return np.asarray(step * min(1.0, longest / max(float(np.abs(step).max()), longest)))


def _shortened(place: Place, Q: Array, step: Array, noise: float) -> tuple[float, Array, Array | None]:
    """A step, or a shorter one, along which the loads do work: the work, the step, and the state; None where there is none."""
    for _ in range(SHORTENINGS):
        at = place.closed(step[:, None] * np.array([0.5, 1.0]))
        if at.done.all():
            middle, end = place.forces(at, np.zeros((place.n, 2)))[0].T
            work = float(step @ (Q + 4.0 * middle + end)) / 6.0
            if work > -noise * float(np.abs(step).max()):
                return work, step, at.here.x[:, 1]
        step = 0.5 * step
    return -np.inf, step, None


def _stability(d: Derivatives, kept: Array) -> bool | None:
    """Whether small motions in the directions ``kept (n, k)`` stay small; see ``Equilibrium.stable``."""
    M, C, K = (kept.T @ part @ kept for part in (d.M, d.C, d.K))
    if not len(K):
        return True
    w = np.linalg.eigvalsh(0.5 * (K + K.T))
    flat = STIFF * float(np.abs(w).max(initial=0.0))
    if np.abs(K - K.T).max() <= flat and np.linalg.eigvalsh(0.5 * (C + C.T))[0] >= -STIFF * np.abs(C).max():
        return False if w[0] < -flat else None if d.bent or w[0] <= flat else True
    n = len(K)
    still, unit = np.zeros((n, n)), np.eye(n)
    s = np.asarray(
        scipy.linalg.eigvals(np.block([[still, unit], [-K, -C]]), np.block([[unit, still], [still, M]])), dtype=complex
    )
    s = s[np.isfinite(s)]
    slow = GROWS * float(np.abs(s).max(initial=0.0))
    return False if (s.real > slow).any() else True if (s.real < -slow).all() and not d.bent else None
