"""Assembly: closing the loops of a mechanism from a guess, and the scaled system in which everything is then computed.

Lengths of one loop that are too far apart: two of its points coincide in ranks and differ in the mechanism.

Rows of a loop are measured in its own size, and ranks are told down to ``RANKS.loop``. Two points of a link that are nearer to each other
make a singular value of about that part of the size; where it counts as zero, mobility and positions would be those of another mechanism.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mechgraph.errors import AssemblyError, DeclarationError, listed
from mechgraph.kinematics.motion_path import FARTHEST, DriverPath, Request, Status, far_faults
from mechgraph.kinematics.reach import BEYOND_END, beyond, follow
from mechgraph.kinematics.solver import closure_rank, closure_solver, engine_for
from mechgraph.kinematics.state import (
    CLOSED,
    CLOSURE_GOAL,
    Configuration,
    close,
    close_all,
    lengths_of,
)
from mechgraph.kinematics.system import System, indexed
from mechgraph.maths.linear import compact, complement
from mechgraph.maths.newton import Nodes
from mechgraph.maths.se3 import Array, Index, rotate
from mechgraph.maths.tolerances import PATH, RANKS
from mechgraph.model.belts import BeltDrive
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker
from mechgraph.quantities import is_numeric, shown, wrong


def refuse_mixed_lengths(here: Configuration) -> None:
    """Raise a DeclarationError where the first position of a configuration has such a loop; looked at once at a position."""
    m, key = here.system.m, here.x[:, 0].tobytes()
    told = m.once(_kept)["sound"]
    if key not in told:
        if fault := _fault(here):
            raise DeclarationError(f"mechanism {m.name!r}", [fault])
        told.clear()
        told[key] = True


def _kept(m: Mechanism) -> dict[str, dict[bytes, Any]]:
    """What is kept with a mechanism, by coordinates or states.

    ``sound``: the last state that has no such loop; ``starts``: what is known of a start beside the mechanism, system and configuration;
    ``searched``: the best state that a search from a start found, and its closure error; ``opposite``: what ``_opposite_axis`` says then.
    """
    return {name: {} for name in ("sound", "starts", "searched", "opposite")}


def _fault(here: Configuration) -> str:
    s, points, middles = here.system, here.pair_points[:, :, 0], here.middles[:, :, 0]
    loop, pair, _ = s.graph.loop_steps
    after, size = s.graph.step_after, lengths_of(s.graph, points, middles)
    away = points[:, pair] - points[:, pair[after]]
    apart = np.sqrt((away * away).sum(axis=0))
    part = apart / size[loop]
    too_near = 10 * RANKS.loop  # up to there it is asked whether a distance was lost in a rank
    # distance over the size of a loop, and singular value, that is rounding
    no_distance = 1e-14
    near = np.flatnonzero((part < too_near) & (part > no_distance))
    if not near.size:
        return ""
    rank = closure_rank(here)
    # the least singular value that counted where engines may differ on it, else the largest that did not; above this part of the
    # distance it comes of it: directions make it smaller
    told = rank.margin if rank.margin < too_near else rank.dropped
    lost = near[told > np.maximum(0.01 * part[near], no_distance)]
    if not lost.size:
        return ""
    i, names = int(lost[np.argmin(part[lost])]), [p.name for p in s.m.pairs]
    return (
        f"lengths are too far apart: {names[pair[i]]} and {names[pair[after[i]]]} are {apart[i] * s.par.L:.3g} apart in the loop "
        f"{listed(names[k] for k in pair[loop == loop[i]])} of size {size[loop[i]] * s.par.L:.3g}; expected at least {too_near:g} times "
        "that size, or the same point. Make small lengths larger or zero, or replace long links by slides (the end of a link so long "
        "moves along a line)"
    )


def scaled_system(m: Mechanism, q: Array, system: System | None = None) -> System:
    """The system about the centroid of the pair points at coordinates ``q``, with lengths over their RMS distance L."""
    raw = system or indexed(m)
    return scaled(Configuration(raw, raw.state_of(q[:, None]))).system


def scaled_start(m: Mechanism) -> Configuration:
    """The declared start in a system scaled about it.

    The last one of the mechanism itself is kept with it. Where it is asked for again all numbers are made ready: a mechanism that is solved
    once, by the kernel, does without most of them.
    """
    raw = indexed(m)
    q = raw.start_coordinates(m.start)
    kept, key = m.once(_kept)["starts"], q.tobytes()
    again = key in kept
    if again:
        known, evaluated = kept[key]
        here = Configuration.of(System.remembered(m, known), evaluated)
    else:
        kept.clear()
        here = scaled(Configuration(raw, raw.state_of(q[:, None])))
    if not again or "S" not in evaluated:
        for name in ("numbers", "n_rows", *(("effort_numbers",) if again else ())):
            getattr(here.system, name)
        for name in ("closure", "solvers", *(("middles", "S") if again else ())):
            getattr(here, name)
        kept[key] = here.system.known(), here.evaluated()
    return here


def scaled(here: Configuration) -> Configuration:
    """A state in the system about the centroid of the pair points there, with lengths over their RMS distance L (with mass centers)."""
    raw = here.system
    # pairs of six freedoms hold nothing: they may stand anywhere
    holding = np.flatnonzero(np.diff(raw.first_column) < 6)
    points = here.pair_points[:, compact(holding) if holding.size else slice(None), 0]
    centroid = points.mean(axis=1)
    massive = compact(np.flatnonzero([link.center is not None for link in raw.m.links]))
    X = here.poses[:, :, massive]
    centers = (rotate(X[:, :3], raw.par.center[:, massive]) + X[:, 3])[:, :, 0]
    distances = np.concatenate([points, centers], axis=1) - centroid[:, None]
    L = float(np.sqrt((distances**2).sum(axis=0).mean()))
    # points that coincide but for the error of closing make no length
    L = 1.0 if CLOSED * max(1.0, float(np.abs(points).max())) >= L else L
    par = raw.par.rescaled(raw.par.origin + raw.par.L * centroid, L * raw.par.L)
    return here.rescaled(raw.with_parameters(par))


def at_position(m: Mechanism, system: System, x: Array) -> Mechanism:
    """The mechanism with its start at a closed state ``x (nx,)``; as it is where that is its start."""
    given = system.start_coordinates(m.start)
    q = system.coordinates_of(x[:, None], given)[:, 0]
    if np.abs(q - given).max(initial=0.0) <= CLOSED:
        return m
    return m.replace(start=dict(zip(m.freedom_names(), q.tolist(), strict=True)))


def last_closed(system: System, nodes: Nodes, columns: Index) -> Nodes:
    """The last of the nodes of a track at which all loops close, the coordinates ``columns`` kept; at least its start.

    A path follows independent rows. Those that depend on them at the start of a shaky mechanism open with a power of the way, which
    the nodes, being closed coarsely, do not show at once; the first node, at half of the way that counts as closed or more, shows a part.
    """
    order = np.argsort(nodes.place, kind="stable")

    def left(i: int) -> float:
        return close(system, nodes.x[:, order[i]], columns)[1]

    last = len(order) - 1
    if last and left(last) > CLOSED:
        last = max(bisect_left(range(last), True, lo=1, key=lambda i: left(i) > CLOSED) - 1, 0)
    if last and nodes.place[order[last]] < PATH.shortest_quick and left(1) > max(CLOSURE_GOAL, 10.0 * left(0)):
        last = 0
    return nodes.take(order[last : last + 1])


def led(system: System, x: Array, columns: Index, goal: Array) -> tuple[Array, bool]:
    """A closed state followed until the coordinates ``columns`` have the values ``goal``; whether it came to them.

    Other freedoms that are free follow as they are held; a goal that is itself a singular position is closed from right before it.
    """
    path = DriverPath(system, closure_solver(engine_for(system.n_rows, 1, "auto"), columns), system.cases)
    found = follow(path, [Request(x, 0, goal[:, None], np.zeros(1, dtype=np.intp))], 1)
    if found.status[0] is Status.OK:
        return found.x[:, 0], True
    last = last_closed(system, found.tracks.nodes, columns).x[:, 0]
    if np.abs(last[path.rows] - goal).max() > PATH.dead_zone:
        return last, False
    begin = last.copy()
    begin[path.rows] = goal
    closed, error = close(system, begin, columns)
    return closed, error <= CLOSED and bool(np.abs(system.difference(closed[:, None], begin[:, None])).max() < 1e-3)


def named_columns(m: Mechanism, system: System, values: Mapping[str, float]) -> tuple[Index, Array]:
    """Columns and internal values of single freedoms given by name."""
    if not isinstance(values, Mapping):
        raise DeclarationError(f"mechanism {m.name!r}", [wrong(values, "values", "a mapping freedom -> number")])
    faults, columns, numbers = [], [], []
    for name, value in values.items():
        fault = m.freedom_fault(name, single=True)
        number = value if fault else m.in_own_units(name, value)
        if fault or not is_numeric(number, ()):
            faults.append(fault or wrong(number, name, "a finite number"))
            continue
        k, j = m.freedom(name)
        column = int(system.first_column[k]) + j
        if column in columns:
            faults.append(f"{name}: {m.full_name(name)} is given twice")
        columns.append(column)
        numbers.append(float(number) / (system.par.L if system.is_length[column] else 1.0))
    if faults:
        raise DeclarationError(f"mechanism {m.name!r}", faults)
    return np.array(columns, dtype=np.intp), np.array(numbers)


def assembled(m: Mechanism, preferred: Mapping[str, float] | None = None) -> tuple[System, Array]:
    """The system and the state of ``closed_start``."""
    return _state(closed_start(m, preferred))


def _state(here: Configuration) -> tuple[System, Array]:
    return here.system, here.x[:, 0]


Closer = Callable[[System, Array], Configuration | None]
"""Gives the closed configuration nearest to a state ``(nx,)``, coordinates of the drives kept; None where it does not serve."""


def closed_start(
    m: Mechanism, preferred: Mapping[str, float] | None = None, tol: float = 0.0, closer: Closer | None = None
) -> Configuration:
    """A closed state near ``start``, of the scaled system; closed to ``tol`` (radians, or lengths / L) where that is given.

    Tried in this order: as it stands; drives kept at their start; drives at the ``preferred`` values; everything free;
    then guesses around the start, further and further away. What a ``closer`` gives of the first guess is taken where it is closed.

    Raises
    ------
    AssemblyError
        with the smallest closure error found.
    DeclarationError
        where lengths are too far apart, unless the geometry is meant to ``tol``.
    """
    if not m.has_geometry:
        bare = [p.name for p in m.pairs if not p.has_geometry]
        raise DeclarationError(
            f"mechanism {m.name!r}",
            [f"pairs {', '.join(bare)} have no geometry; a topology can be counted, not solved"],
        )
    here = scaled_start(m)
    system, x, error = here.system, here.x[:, 0], float(here.closure[0])
    if error <= CLOSED:
        # of many loops dense least squares take longer than what they gain is worth
        if error > 10 * CLOSURE_GOAL and system.graph.n_loops <= 16:
            here = Configuration(system, close_all(system, here.x, np.arange(0))[0])
    else:
        attempts = _attempts(m, system, x, preferred or {})
        beside = closer(system, attempts[0][0]) if closer is not None else None
        # size, place and distances of points of a guess that misses by less than a tenth serve as those of the closed state do
        if beside is not None and error <= 0.1:
            refuse_mixed_lengths(here)
            return beside
        here = scaled(beside or _found(m, here, attempts, preferred or {}, tol))
    if not tol:
        refuse_mixed_lengths(here)
    return here


def _found(
    m: Mechanism,
    guess: Configuration,
    attempts: Sequence[tuple[Array, Index]],
    preferred: Mapping[str, float],
    tol: float,
) -> Configuration:
    """The closed state that a search finds."""
    system, x = guess.system, guess.x[:, 0]
    known, asked = m.once(_kept)["searched"], x.tobytes()
    if not tol or known.get(asked, (x, 0.0))[1] <= tol:  # a search with a tolerance begins at the same guesses
        known[asked] = _search(system, attempts, tol)
    x, error = known[asked]
    if error > max(CLOSED, tol):
        words = m.once(_kept)["opposite"]
        if asked not in words:
            words[asked] = _opposite_axis(m, preferred, error)
        best = dict(zip(m.freedom_names(), system.coordinates_of(x[:, None])[:, 0].tolist(), strict=True))
        raise AssemblyError(
            f"mechanism {m.name!r}: no closed configuration near start; best closure residual {error:.3g} "
            f"(largest angle [rad] or length / L over all loops, L = {system.par.L:.4g}). "
            f"{words[asked] or _belts_off(m) or 'Check the dimensions, or give another start'}",
            error,
            best,
        )
    return Configuration(system, x[:, None])


def _belts_off(m: Mechanism) -> str:
    """Which belts have another length than their pulleys take where they are declared."""
    return " ".join(
        f"Belt {c.belt!r} has the length {c.length:.6g}, and its pulleys take {c.length - c.longer:.6g} where they are declared: no place "
        f"of them was found that takes a belt {abs(c.longer):.6g} {'longer' if c.longer > 0 else 'shorter'}."
        for c in m.couplings
        if isinstance(c, BeltDrive) and c.length is not None and c.longer
    )


def _opposite_axis(m: Mechanism, preferred: Mapping[str, float], error: float) -> str:
    """Which marker axis points the opposite way, in words, where the loops close with the axis of a single marker reversed.

    Reversing any of several markers may close the loops; of these the axis most opposed to all others is named. Tried only where the
    loops miss by much and in few pairs: every try is an assembly.
    """
    marked = [k for k, pair in enumerate(m.pairs) if pair.on_a is not None]
    # a closure error of a radian, in at most 30 pairs: every marker may cost an assembly
    if error < 1.0 or not 0 < len(marked) <= 30:
        return ""
    axes = np.array(
        [[np.asarray(marker.axis) / np.linalg.norm(marker.axis) for marker in m.pairs[k].markers] for k in marked]
    )
    agreement = axes @ axes.sum(axis=(0, 1))
    for place in np.argsort(agreement, axis=None, kind="stable").tolist():
        k, side = marked[place // 2], ("on_a", "on_b")[place % 2]
        pair = m.pairs[k]
        marker = getattr(pair, side)
        other = pair.replace(**{side: Marker(marker.point, tuple(-v for v in marker.axis), marker.second)})
        changed = m.replace(pairs=[*m.pairs[:k], other, *m.pairs[k + 1 :]])
        q = indexed(changed).start_coordinates(m.start)
        system = scaled_system(changed, q)
        attempts = _attempts(changed, system, system.state_of(q[:, None])[:, 0], preferred)
        if _closed_nearby(system, attempts)[1] <= CLOSED:
            return f"They close with the axis of marker {side} of pair {pair.name!r} reversed: {shown(marker.axis)} points the opposite way"
    return ""


def _attempts(m: Mechanism, system: System, x: Array, preferred: Mapping[str, float]) -> list[tuple[Array, Index]]:
    """Guesses to close from, and the freedoms kept at each."""
    drives, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
    columns, values = named_columns(m, system, preferred)
    at_preferred = x.copy()
    at_preferred[system.single_rows[columns]] = values
    return (
        [(x, drives), (at_preferred, columns), (x, np.arange(0))]
        if m.start
        else [(at_preferred, columns), (x, drives), (x, np.arange(0))]
    )


def _closed_nearby(system: System, attempts: Sequence[tuple[Array, Index]], tol: float = 0.0) -> tuple[Array, float]:
    """The state closed from the first guess that leads to one, else the best; its closure error."""
    best, best_error = attempts[0][0], np.inf
    for guess, fixed in attempts:
        closed, error = close(system, guess, fixed, tol=tol)
        if error < best_error:
            best, best_error = closed, error
        if error <= max(CLOSED, tol):
            break
    return best, best_error


def _search(system: System, attempts: Sequence[tuple[Array, Index]], tol: float) -> tuple[Array, float]:
    goal = max(CLOSED, tol)
    best, best_error = _closed_nearby(system, attempts, tol)
    if best_error <= goal:
        return best, best_error
    rng = np.random.default_rng(20231)
    guesses = []
    # perturbed guesses, of two kinds in turn, the first eight tried before the others
    for i in range(40):
        guess, fixed = attempts[i % 2]
        free = complement(fixed, system.n_freedoms)
        dq = np.zeros((system.n_freedoms, 1))
        dq[free, 0] = rng.normal(0.0, 0.2 + 1.3 * i / 40, len(free))
        guesses.append(system.advance(guess[:, None], dq)[:, 0])
    for round_ in (slice(0, 8), slice(8, 40)):
        states, errors = np.stack(guesses[round_], axis=1), np.empty(len(guesses[round_]))
        for kind, (_, fixed) in enumerate(attempts[:2]):
            states[:, kind::2], errors[kind::2] = close_all(system, states[:, kind::2], fixed, tol=tol)
        found = int(np.argmax(errors <= goal)) if (errors <= goal).any() else int(np.argmin(errors))
        if errors[found] < best_error:
            best, best_error = states[:, found], float(errors[found])
        if best_error <= goal:
            break
    return best, best_error


def assembled_at(
    m: Mechanism, values: Mapping[str, float], guess: Mapping[str, float] | None = None
) -> tuple[System, Array]:
    """The scaled system and a closed state with some freedoms at given values.

    Without a ``guess`` the closed position near ``start`` is moved there in small steps; with one, the loops are closed from it.

    Raises
    ------
    AssemblyError
        where the values cannot be reached.
    DeclarationError
        where they are too far away to be followed.
    """
    if guess is not None:
        m = m.replace(start={**m.start, **{m.full_name(k): v for k, v in guess.items()}})
        begin = scaled_start(m)
        raw, x = begin.system, begin.x[:, 0].copy()
        columns, goal = named_columns(m, raw, values)
        x[raw.single_rows[columns]] = goal
        x, error = close(raw, x, columns)
        if error > CLOSED:
            raise _not_reached(m, raw, x, error, values)
        _refuse_beyond_ends(m, raw, x, values)
        here = scaled(Configuration(raw, x[:, None]))
        refuse_mixed_lengths(here)
        return _state(here)
    system, x = assembled(m, values)
    columns, goal = named_columns(m, system, values)
    if (x[system.single_rows[columns]] == goal).all():
        _refuse_beyond_ends(m, system, x, values)
        return system, x
    _refuse_far(
        m, values, goal - x[system.single_rows[columns]], np.where(system.is_length[columns], system.par.L, 1.0)
    )
    x, done = led(system, x, columns, goal)
    if not done:
        short = float(np.abs(x[system.single_rows[columns]] - goal).max())
        raise _not_reached(m, system, x, short, values, _outside(m, system, x, -BEYOND_END, "comes to"))
    _refuse_beyond_ends(m, system, x, values)
    return _state(scaled(Configuration(system, x[:, None])))


def _refuse_far(m: Mechanism, names: Iterable[str], way: Array, unit: Array) -> None:
    """Refuse a way that would be followed for minutes; that of one freedom that turns is cut where the motion repeats itself."""
    # longest way of freedoms that are moved together, which is followed whole: some seconds
    most = np.full(len(way), FARTHEST if len(way) == 1 else 1e4)
    faults = far_faults(names, np.abs(way), unit, most, ". Give a nearer value, or a guess")
    if faults:
        raise DeclarationError(f"assemble {m.name!r}", faults)


def _refuse_beyond_ends(m: Mechanism, system: System, x: Array, values: Mapping[str, float]) -> None:
    """Refuse a closed state in which a pair is beyond an end of its curve or surface."""
    if why := _outside(m, system, x, BEYOND_END, "is beyond"):
        raise _not_reached(m, system, x, float(beyond(system, x[:, None]).max()), values, why)


def _outside(m: Mechanism, system: System, x: Array, least: float, how: str) -> str:
    """Which coordinate is beyond its range by more than ``least``, most of all, in words."""
    over = beyond(system, x[:, None])[:, 0]
    if not (over > least).any():
        return ""
    return f"there {m.freedom_names()[int(system.limits[0][over.argmax()])]} {how} the end of its curve or surface"


def _not_reached(
    m: Mechanism, system: System, x: Array, error: float, values: Mapping[str, float], why: str = ""
) -> AssemblyError:
    best = dict(zip(m.freedom_names(), system.coordinates_of(x[:, None])[:, 0].tolist(), strict=True))
    asked = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
    reached = ", ".join(f"{name} = {best[m.full_name(name)]:.6g}" for name in values)
    return AssemblyError(
        f"mechanism {m.name!r}: cannot be assembled at {asked}; "
        f"came to {reached}{f'; {why}' if why else f', {error:.3g} short (radians, or lengths / L)'}. "
        "Choose a reachable value or another start",
        error,
        best,
    )
