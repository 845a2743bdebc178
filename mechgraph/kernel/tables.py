"""A mechanism as the two flat arrays of the kernel: what it is made of, and its numbers (the layout stands in ``kernel.h``).

What follows from the graph, the types of the pairs and the drives is a ``Layout`` and serves all mechanisms of that graph; the numbers are
filled in from the parameters of a system. Every link is put into the frame of its pair in the spanning tree, so that a factor turns or
slides about an axis of coordinates: ``T_b = K_b base_b``, ``K_b = K_a A D(q)``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.fields import PerCase
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.rows import CouplingRows
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.kinematics.touching import on_carrier, pretension_conditions
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Array, Index, compose, cross, identity, inverse, rotate
from mechgraph.memo import carried, dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.friction import Friction, place_of_coupling, places_in, rubbing_loads
from mechgraph.model.gear_facts import mean_sliding
from mechgraph.model.gears import moving_lines
from mechgraph.model.loads import (
    Damper,
    Effort,
    ForceLaw,
    ForceTable,
    Gravity,
    Law,
    Load,
    Spring,
    TorsionSpring,
    Wrench,
)
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.factors import ConstantScrew, Factor, Freedom, Rotation

Integers = NDArray[np.int32]

FORMAT = 8
PARTS = (
    "x", "coordinates", "dq", "ddq", "closure", "condition", "points", "reactions", "efforts", "given", "loads", "stress", "stress_efforts",
    "coupled", "multipliers", "multiplier_stress", "coupled_stress", "shaking", "balance", "power",
    "hold", "holds", "hold_terms",
    "friction", "taken", "normals", "speeds", "teeth", "rubbing", "unsure",
)  # fmt: skip
"""Parts of a record, in order."""
OF_FRICTION = PARTS[-7:-1]
"""What is said of friction where it is sure."""
START = 4
"""Place of the start in the table of numbers."""
ROWS_OF_KERNEL = 90
"""Closure rows up to which dense elimination, state by state, serves."""


class Kind(IntEnum):
    """Kinds of factors, as in ``kernel.h``; turns and slides about x, of which those about y and z follow."""

    TURN = 0
    SLIDE = 3
    ROTATION = 6
    POSE = 7


@dataclass(frozen=True)
class _Step:
    """One factor in the tables: its kind, the factor of the row that it is part of, and its numbers: ``constant + pitch per_pitch``."""

    kind: int
    rank: int
    constant: tuple[float, ...] = ()
    per_pitch: float = 0.0


@dataclass(frozen=True)
class Layout:
    """What a mechanism is made of: ``I``, with what its numbers are filled from.

    ``places`` and ``shapes`` of the parts of a record; ``side (N,)``: the pose among identity, markers A and markers B in which every link
    stands; ``constant``, ``per_pitch``, ``pair``: of every factor number; ``ends``: links a and b of all pairs;
    ``border (p, F)``: rates of the passive motions at the start.
    """

    I: Integers
    places: dict[str, slice]
    shapes: dict[str, tuple[int, ...]]
    side: Index
    constant: Array
    per_pitch: Array
    pair: Index
    ends: tuple[Index, Index]
    border: Array

    def record(self, forces: bool) -> int:
        """Numbers of a record, with forces or of the motion alone."""
        return max(part.stop for part in self.places.values()) if forces else self.places["points"].start

    def rubbing(self, count: int) -> Layout:
        """The same with so many places that rub."""
        if not count:
            return self
        shapes = self.shapes | dict.fromkeys(("normals", "speeds"), (count,))
        shapes |= {"friction": shapes["efforts"], "taken": shapes["reactions"], "unsure": ()}
        shapes |= {"teeth": shapes["efforts"], "rubbing": (*shapes["multipliers"], 6)}
        return replace(self, places=_places_of(shapes), shapes=shapes)


def why_not(system: System) -> str | None:
    """What of a mechanism the kernel cannot carry; None where it can."""
    m = system.m
    if carried(m) is not None:
        return "it is asked with other tolerances than the default ones"
    for number, row in enumerate(system.types):
        if not all(isinstance(step, ConstantScrew | Rotation) for step in row.steps) or row.pushed:
            name = m.pairs[int(np.flatnonzero(system.type_of == number)[0])].name
            return f"pair {name!r} ({row.symbol}) travels along a curve or surface"
        if not all(map(_keeps_its_line, row.freedoms)):
            name = m.pairs[int(np.flatnonzero(system.type_of == number)[0])].name
            return f"pair {name!r} ({row.symbol}) has a freedom whose axis moves with the pitch"
    if moving := m.once(moving_lines):
        return f"the row of the coupling {moving[0]!r} is evaluated from poses"
    rows = system.graph.loop_rows + len(m.couplings)
    if rows > ROWS_OF_KERNEL:
        return f"it has {rows} closure rows; expected at most {ROWS_OF_KERNEL}"
    return None


def _steps(factor: Factor, rank: int) -> list[_Step]:
    """A factor about axes of coordinates, between constant poses where it is about another line."""
    if isinstance(factor, Rotation):
        return [_Step(Kind.ROTATION, rank)]
    freedom: Freedom = factor.freedoms[0]
    base, per_pitch = np.array(freedom.twist), np.array(freedom.per_pitch)
    line = base[:3] if freedom.turns else base[3:]
    unit = np.flatnonzero(line)
    if len(unit) == 1 and line[unit[0]] == 1.0:
        axis = int(unit[0])
        if not freedom.turns:
            return [_Step(Kind.SLIDE + axis, rank, (0.0,))]
        along = np.eye(6)[3 + axis]
        if not np.delete(base[3:], axis).any() and not (per_pitch - along * per_pitch[3 + axis]).any():
            return [_Step(Kind.TURN + axis, rank, (float(base[3 + axis]),), float(per_pitch[3 + axis]))]
    C = identity()
    x = np.cross(line, np.eye(3)[int(np.argmin(np.abs(line)))])
    C[:, 0] = x / np.sqrt(x @ x)
    C[:, 1], C[:, 2] = np.cross(line, C[:, 0]), line
    if not freedom.turns:
        turn = _Step(Kind.SLIDE + 2, rank, (0.0,))
    else:
        C[:, 3] = np.cross(line, base[3:])
        turn = _Step(Kind.TURN + 2, rank, (float(line @ base[3:]),), float(line @ per_pitch[3:]))
    there, back = (tuple(pose.ravel().tolist()) for pose in (C, inverse(C)))
    return [_Step(Kind.POSE, rank, there), turn, _Step(Kind.POSE, rank, back)]


def _keeps_its_line(freedom: Freedom) -> bool:
    """Whether the pitch of a pair enters along the axis of a freedom alone."""
    line, per_pitch = np.array(freedom.twist[:3]), np.array(freedom.per_pitch)
    return not per_pitch[:3].any() and not (per_pitch[3:] - line * (line @ per_pitch[3:])).any()


def layout(system: System, drives: Index, passive: Sequence[PassiveMotion]) -> Layout:
    """The layout of a mechanism that the kernel can carry, the freedoms ``drives`` given and ``passive`` motions at rest."""
    s, g = system, system.graph
    steps, first, effort_factor = _factors(s)
    widths = [0 if step.kind == Kind.POSE else 3 if step.kind == Kind.ROTATION else 1 for _, step in steps]
    numbers = np.cumsum([0, *(len(step.constant) for _, step in steps)])
    columns = np.cumsum([0, *widths])
    states = np.cumsum(
        [0, *(4 if step.kind == Kind.ROTATION else w for (_, step), w in zip(steps, widths, strict=True))]
    )
    unknown = complement(drives, s.n_freedoms)
    place = np.full(s.n_freedoms, -1)
    place[unknown] = np.arange(len(unknown))
    tree = g.steps.copy()
    tree[:, 1] = tree[:, 1] > 0
    loop, pair, sign = fundamental(s)
    rows = _coupling_rows(s)
    term_rows, term_columns = (rows[0].term_rows, rows[0].term_columns) if rows else np.zeros((2, 0), dtype=np.intp)
    K = len(s.m.couplings)
    stresses = g.loop_rows + K + len(passive) - len(unknown)
    belts = s.m.once(pretensions)  # whose centers stand still: the rows of each depend on one another
    spans = [k for _, rows in belts for k in rows]
    ends = np.stack([s.a, s.b], axis=1)
    moved = [link for motion in passive for link in motion.links]
    head = [
        FORMAT, len(s.m.links), len(s.m.pairs), len(steps), s.n_freedoms, s.n_state, g.n_loops, len(pair), K, len(term_columns),
        len(drives), len(unknown), 0, g.frame, int(numbers[-1]), 0, len(passive), len(moved), g.span.start, g.width,
        *[0] * 3, len(belts), len(spans),
    ]  # fmt: skip
    parts = [
        head, first, [step.kind for _, step in steps], columns, states[:-1], numbers[:-1], ends.ravel(), tree.ravel(), g.chords,
        np.searchsorted(loop, np.arange(g.n_loops + 1)), pair, sign, s.pair_of_freedom, s.single_rows, s.is_length, place, *effort_factor,
        [row.computed_efforts for row in map(s.types.__getitem__, s.type_of.tolist())], drives, unknown,
        np.searchsorted(term_rows, np.arange(K + 1)), term_columns,
        np.cumsum([0, *(len(motion.links) for motion in passive)]), moved, [motion.turns for motion in passive],
    ]  # fmt: skip
    P = len(s.m.pairs)
    side = np.zeros(len(s.m.links), dtype=np.intp)
    side[g.steps[:, 3]] = 1 + g.steps[:, 0] + np.where(g.steps[:, 1] > 0, P, 0)
    return Layout(
        np.concatenate([np.asarray(part, dtype=np.int32) for part in parts]),
        *_record(s, len(passive), stresses - len(belts)),
        side,
        np.array([value for _, step in steps for value in step.constant]),
        np.array([step.per_pitch for _, step in steps for _ in step.constant]),
        np.array([k for k, step in steps for _ in step.constant], dtype=np.intp),
        (s.a, s.b),
        np.array([motion.rates for motion in passive]).reshape(len(passive), s.n_freedoms),
    )


def _factors(s: System) -> tuple[list[tuple[int, _Step]], list[int], tuple[list[int], list[bool]]]:
    """All factors with their pairs, the first of every pair, and of every freedom the factor before which its effort stands (-1: marker
    B), and whether it acts at marker B.
    """
    steps: list[tuple[int, _Step]] = []
    first, frames, at_b = [0], [], []
    made = {id(group.row): [_steps(f, r) for r, f in enumerate(group.row.steps)] for group in s.groups}
    for k, number in enumerate(s.type_of.tolist()):
        row = s.groups[number].row
        begins = np.cumsum([len(steps), *map(len, made[id(row)])]).tolist()
        steps += [(k, step) for part in made[id(row)] for step in part]
        first.append(len(steps))
        for effort in row.efforts:
            rank = next((r for r, columns in enumerate(row.factors) if effort.frame in columns), None)
            frames.append(-1 if rank is None else begins[rank])
            at_b.append(effort.at_b)
    return steps, first, (frames, at_b)


def fundamental(s: System) -> tuple[Index, Index, Index]:
    """Loop, pair and sign of all steps of the loops that each chord closes with the tree."""
    ways: list[dict[int, int]] = [{} for _ in s.m.links]
    for k, sign, parent, child in s.graph.tree:
        ways[child] = ways[parent] | {k: sign}
    found = []
    for number, k in enumerate(s.chords.tolist()):
        row = {k: 1}
        for link, sense in ((s.a[k], 1), (s.b[k], -1)):
            for j, sign in ways[link].items():
                row[j] = row.get(j, 0) + sense * sign
        found += [(number, j, sign) for j, sign in sorted(row.items()) if sign]
    steps = np.array(found, dtype=np.intp).reshape(-1, 3)
    return steps[:, 0], steps[:, 1], steps[:, 2]


def _coupling_rows(s: System) -> list[CouplingRows]:
    """The rows of the couplings, where there are any."""
    return [row for row in s.rows if isinstance(row, CouplingRows)]


def _record(s: System, passives: int, stresses: int) -> tuple[dict[str, slice], dict[str, tuple[int, ...]]]:
    """The places and shapes of the parts of a record."""
    c, n, p, k = s.n_freedoms, len(s.m.links), len(s.m.pairs), len(s.m.couplings)
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(PARTS, (c,))
    shapes |= {
        "x": (s.n_state,),
        "points": (p, 3),
        "reactions": (p, 6),
        "loads": (n, 6),
        "multipliers": (k,),
        "shaking": (6,),
    }
    shapes |= {"stress": (stresses, p, 6), "stress_efforts": (stresses, c), "coupled_stress": (stresses, c)}
    shapes |= {"multiplier_stress": (stresses, k), "closure": (), "condition": (2,), "balance": (), "power": ()}
    shapes |= {"hold": (n if passives else 0, 6), "holds": (passives,), "hold_terms": (passives,)}
    shapes |= dict.fromkeys((*OF_FRICTION, "unsure"), (0,))
    return _places_of(shapes), shapes


def _places_of(shapes: dict[str, tuple[int, ...]]) -> dict[str, slice]:
    """The places of the parts."""
    ends = np.cumsum([0, *(int(np.prod(shapes[name])) for name in PARTS)]).tolist()
    places = {name: slice(i, j) for name, i, j in zip(PARTS, ends[:-1], ends[1:], strict=True)}
    if not shapes["hold"][0]:
        del places["hold"]
    return places


def tables(known: Layout, system: System, x: Array, loads: Sequence[Load] | None) -> tuple[Integers, Array] | None:
    """The tables of a mechanism: ``I``, and ``P (B, numbers)`` of all variants at their starts ``x (nx, B)``.

    Under loads (None: motion alone); None where a load is no number of the tables.
    """
    s, par = system, system.par
    constants, count = s.numbers.constants, x.shape[1]
    base = constants[:, :, known.side]
    own = inverse(base)
    a, b = known.ends
    P = len(s.m.pairs)
    A, B = (compose(own[:, :, link], constants[:, :, 1 + i * P : 1 + (i + 1) * P]) for i, link in enumerate((a, b)))
    effort = s.effort_table
    moment = effort.free[..., None] + effort.per_pitch[..., None] * par.pitch[effort.pairs]
    force = np.broadcast_to(effort.bound[..., None], moment.shape)
    center = rotate(own[:, :3], par.center) + own[:, 3]
    R = base[:, :3]
    turned = np.einsum("jinb,jknb,klnb->ilnb", R, par.inertia, R)
    inertia = turned[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    acts: Acting | None = Acting([], []) if loads is None else acting(s, own, known.I[HEAD:], loads)
    lines = _Lines([], [], []) if loads is None else _lines(s, own)
    if acts is None or lines is None:
        return None
    belts = _belts(s, x) if s.m.once(pretensions) else ([0], [], [])
    rows = _coupling_rows(s)
    parts = [
        np.full((1, 1), par.L), par.origin[:, None], x, s.start_coordinates(s.m.start)[:, None], par.frame.reshape(12, 1),
        _flat(A), _flat(B), known.constant[:, None] + known.per_pitch[:, None] * par.pitch[known.pair],
        _by_item(np.concatenate([moment, force])), par.mass, _by_item(center), _by_item(inertia), _flat(own), known.border.reshape(-1, 1),
        *(row.coefficients for row in rows), *(row.constant for row in rows), *lines.wrenches, *belts[2], *acts.numbers,
    ]  # fmt: skip
    entries = lines.entries, np.cumsum([0, *map(len, lines.steps)]), *lines.steps, *belts[:2], acts.entries
    I = np.concatenate([known.I, *(np.asarray(part, dtype=np.int32).ravel() for part in entries)])
    I[HEAD_LOADS], I[HEAD_LOAD_NUMBERS] = len(acts.entries), len(acts.numbers)
    I[HEAD_LINES], I[HEAD_LINE_STEPS] = len(lines.entries), sum(map(len, lines.steps))
    I[HEAD_RUBS] = sum(kind >= CONTACT for kind, *_ in acts.entries)
    parts = [np.atleast_2d(part) for part in parts]
    out = np.empty((count, sum(map(len, parts))))
    at = 0
    for part in parts:
        out[:, at : at + len(part)] = part.T
        at += len(part)
    return I, out


HEAD_LOADS, HEAD_LOAD_NUMBERS, HEAD_RUBS, HEAD_LINES, HEAD_LINE_STEPS, HEAD = 12, 15, 20, 21, 22, 25
"""Places of the numbers of loads, of places that rub, and of couplings along lines in the head, and its length."""


@dataclass(frozen=True)
class _Lines:
    """Couplings along lines in the tables: number and carrier, pairs on the way with their senses, and wrenches ``(12, B)`` of each."""

    entries: list[tuple[int, int]]
    steps: list[list[tuple[int, int]]]
    wrenches: list[Array]


def _lines(system: System, own: Array) -> _Lines | None:
    """The lines of all couplings in the frames ``own (3, 4, N, B)`` of the tables; None where one of them moves on every link."""
    out = _Lines([], [], [])
    for g, coupling in enumerate(system.m.couplings):
        if not coupling.steps:
            continue
        found = on_carrier(system, g)
        if found is None:
            return None
        R, p = own[:, :3, [found.link]], own[:, 3, [found.link]]
        moment, force = rotate(R, found.wrenches[:3]), rotate(R, found.wrenches[3:])
        out.entries.append((g, found.link))
        out.steps.append([(step.pair, int(step.sense)) for step in coupling.steps])
        out.wrenches.append(_by_item(np.concatenate([moment + cross(p, force), force])))
    return out


def _belts(system: System, x: Array) -> tuple[list[int], list[int], list[Array]]:
    """Belts with a pretension in the tables: first spans, their numbers among the couplings, and what the pretension tells of multipliers.

    Their centers stand still, so that the lengths of spans are those of the start ``x (nx, B)``.
    """
    tight = system.m.once(pretensions)
    _, C, c = pretension_conditions(Configuration(system, x))
    firsts = np.cumsum([0, *(len(rows) for _, rows in tight)]).tolist()
    spans = [(i, k) for i, (_, rows) in enumerate(tight) for k in rows]
    return firsts, [k for _, k in spans], [np.array([C[i, k] for i, k in spans]), c]


def why_no_line(system: System) -> str | None:
    """What of the lines of couplings the kernel cannot carry."""
    stray = [c.name for g, c in enumerate(system.m.couplings) if c.steps and on_carrier(system, g) is None]
    return f"the line of the coupling {stray[0]!r} stands still on no link between its gears" if stray else None


def _by_item(values: Array) -> Array:
    """Vectors ``(k, n, B)`` one after the other, ``(n k, B)``."""
    return values.swapaxes(0, 1).reshape(-1, values.shape[-1])


def _flat(poses: Array) -> Array:
    """Poses ``(3, 4, n, B)`` one after the other, by rows."""
    return poses.transpose(2, 0, 1, 3).reshape(-1, poses.shape[-1])


Mask = NDArray[np.bool_]
MIDDLE = 0.381966011250105
"""The place on a step over numbers at which they are looked at once more: the golden section, as whole turns on it are none up to there."""


@dataclass(frozen=True)
class Records:
    """What the kernel says of all positions: ``values (T, record)``, the ``largest`` wrench and power, and the ``work`` done."""

    layout: Layout
    values: Array
    largest: Array
    work: tuple[int, int, int]

    def __contains__(self, name: str) -> bool:
        return name in self.layout.places

    def __getitem__(self, name: str) -> Array:
        """A part, component axes first and positions last, as the package holds it."""
        part = self.values[:, self.layout.places[name]]
        return part.reshape(len(part), *self.layout.shapes[name]).T


@dataclass(frozen=True)
class Kernel:
    """Mechanisms of one kind in the tables of the kernel ``P (B, numbers)``, with the library that evaluates them."""

    library: Any
    layout: Layout
    I: Integers
    P: Array

    def follow(
        self, begin: Array, q: Array, v: Array, a: Array, batch: tuple[int, ...], forces: bool
    ) -> tuple[Records, Mask]:
        """Positions, velocities and accelerations of the drives ``(T, d)`` of a batch, from their values ``begin (d, B)`` at the starts
        of all variants, which share the positions equally.

        With the records: which variants ``(B,)`` are whole. Another one has a step that is not certified, or a position at which the
        kernel decides nothing.
        """
        count = begin.shape[1]
        each = len(q) // count
        order, ends = _orders(begin, q.reshape(count, each, len(begin)), batch)
        values, largest = np.empty((len(q), self.layout.record(forces))), np.zeros(2)
        work, whole, room = np.zeros(3, dtype="l"), np.ones(count, dtype=np.intc), self._room()
        self.library.mgk_variants(
            pointer(self.I), ctypes.c_int(count), ctypes.c_int(self.P.shape[1]), pointer(self.P), pointer(room),
            ctypes.c_int(each), ctypes.c_int(ends.shape[1]), *map(pointer, (ends, order, q, v, a)), ctypes.c_int(forces),
            *map(pointer, (values, whole, largest, work)),
        )  # fmt: skip
        return Records(self.layout, values, largest, (int(work[0]), int(work[1]), int(work[2]))), whole > 0

    def lead(self, x: Array, middle: Array, end: Array) -> Mask:
        """One certified step each of ``n`` mechanisms from ``P`` (of one, or one each) by tables ``middle`` at that part of it to ``end
        (n, numbers)``, drives at rest: which ``(n,)`` are closed there, the state in their row of ``x (n, nx)``; the others are left.
        """
        whole, count, room = np.zeros(len(x), dtype=np.intc), ctypes.c_int(len(x)), self._room()
        self.library.mgk_lead(
            pointer(self.I), count, ctypes.c_int(self.P.shape[1]), ctypes.c_int(len(self.P) > 1), ctypes.c_double(MIDDLE),
            *map(pointer, (self.P, middle, end, room, x, whole)),
        )  # fmt: skip
        return np.asarray(whole > 0)

    def closed(self, states: int) -> Array | None:
        """The start of one mechanism closed by small corrections ``(states,)``, its drives kept; None where these do not lead there."""
        room = self._room()
        if self.library.mgk_start(*map(pointer, (self.I, self.P, room))):
            return None
        return room[:states].copy()

    def _room(self) -> Array:
        """Memory for one state; every call has its own."""
        return np.empty(ctypes.c_size_t(self.library.mgk_state_size(pointer(self.I))).value // 8 + 1)


def pointer(array: Any) -> ctypes.c_void_p:
    """Where an array begins, as the library takes it."""
    return ctypes.c_void_p(array.ctypes.data)


def _orders(begin: Array, q: Array, batch: tuple[int, ...]) -> tuple[Integers, Integers]:
    """In which order the positions ``q (B, n, d)`` of every variant are taken from its start ``(B, n)``, and where every way of it ends
    ``(B, ways)``: of one drive up and down its curve, of several case by case.
    """
    count, n, drives = q.shape
    if drives != 1:
        case = batch[-1] if batch else 1
        ends = np.arange(case, n + 1, case, dtype=np.int32)
        return np.tile(np.arange(n, dtype=np.int32), (count, 1)), np.tile(ends, (count, 1))
    along = q[:, :, 0] - begin[0][:, None]
    order = np.lexsort((np.abs(along), along < 0.0), axis=-1).astype(np.int32)
    ends = np.full((count, 2), n, dtype=np.int32)
    ends[:, 0] = (along >= 0.0).sum(axis=1)
    return order, ends


WEIGHT, WRENCH, EFFORT, LAW, BETWEEN, TABLE, TABLE_BETWEEN, CONTACT = range(8)
"""Kinds of loads, as in ``kernel.h``."""
RUBBING = ("contact", "plane", "ball", "thread", "axis", "couple", "collar", "opening")
"""Ways in which pairs rub, in the order of their kinds from ``CONTACT`` on; behind them teeth."""


@dataclass
class Acting:
    """Loads in the tables: kind, two numbers and the place of the numbers of each, and the numbers, one row each: ``(1,)`` or ``(B,)``."""

    entries: list[tuple[int, int, int, int]]
    numbers: list[Array]

    def add(self, kind: int, i: int, j: int, *numbers: Array) -> None:
        """One load; ``numbers (n, B)``."""
        self.entries.append((kind, i, j, len(self.numbers)))
        for part in numbers:
            self.numbers += list(part)


@dataclass(frozen=True)
class _Places:
    """Where loads act: a system, the poses ``own (3, 4, N, B)`` of the link frames in those of the tables, the ``first`` factor of every
    pair.
    """

    system: System
    own: Array
    first: Integers

    @property
    def L(self) -> float:
        """The unit of length."""
        return self.system.par.L

    def link(self, name: str) -> int:
        """Number of a link."""
        return self.system.m.link_index[name]

    def point(self, link: str, p: Any) -> Array:
        """A material point ``(3, B)``, given in the link's frame or by its name; the mass center where it is None."""
        i, par = self.link(link), self.system.par
        given = self.system.m.links[i].point(p) if isinstance(p, str) else p
        local = par.center[:, i] if given is None else (rows(given, 3) - par.offset[:, i, None]) / self.L
        return self.turned(link, local) + self.own[:, 3, i]

    def turned(self, link: str, v: Array) -> Array:
        """A vector ``(3, B)`` in the frame of a link, in that of the tables."""
        return rotate(self.own[:, :3, self.link(link)], v)

    def before(self, pair: int, frame: int) -> int:
        """The factor before which a frame of a pair stands, -1: behind all."""
        row = self.system.groups[int(self.system.type_of[pair])].row
        rank = next((r for r, columns in enumerate(row.factors) if frame in columns), None)
        return -1 if rank is None else int(self.first[pair]) + sum(len(_steps(f, 0)) for f in row.steps[:rank])

    def column(self, freedom: str) -> tuple[int, bool]:
        """Number of a freedom, and whether it is a slide."""
        pair, j = self.system.m.freedom(freedom)
        column = int(self.system.first_column[pair]) + j
        return column, bool(self.system.is_length[column])


def acting(system: System, own: Array, first: Integers, loads: Sequence[Load]) -> Acting | None:
    """All loads in the tables; None where one of them varies over the positions or is a function. Of the rest see ``_Places``."""
    out, places = Acting([], []), _Places(system, own, first)
    for load in loads:
        if why_not_load(load, system.m) is not None:
            return None
        KINDS[type(load)](places, load, out)
    return out


def why_not_load(load: Load, m: Mechanism) -> str | None:
    """What of a load on a mechanism the kernel cannot carry; None where it is numbers of the tables."""
    values = [getattr(load, name) for name in load.formats]
    given = [name for name in load.over_positions if not isinstance(getattr(load, name), PerCase)]
    why = ""
    if type(load) not in KINDS or given or any(callable(value) for value in values):
        why = "is a function, or varies over positions"
    elif isinstance(load, ForceLaw) and (not isinstance(load.law, ForceTable) or load.law.pieces is None):
        why = "is a function, or a table over coordinate and rate"
    elif isinstance(load, Law) and load.in_freedom is None and load.freedoms:
        why = f"acts between points and reads the freedom {load.reads_freedom!r}"
    elif isinstance(load, Law) and load.in_freedom is None and load.along is not None:
        why = "acts along a fixed direction"
    return f"load {load.where.removesuffix(': ')} {why}" if why else None


def rows(value: Any, width: int = 1) -> Array:
    """A number or vector as ``(width, 1)``; one that varies from case to case ``(width, B)``."""
    if isinstance(value, PerCase):
        return value.values.reshape(len(value.values), width).T
    return np.asarray(value, dtype=float).reshape(width, 1)


def _weight(places: _Places, load: Any, out: Acting) -> None:
    out.add(WEIGHT, 0, 0, rows(load.acceleration, 3) / places.L)


def _wrench(places: _Places, load: Any, out: Acting) -> None:
    i = places.link(load.link)
    force, moment = (np.zeros((3, 1)) if v is None else rows(v, 3) for v in (load.force, load.moment))
    turning = load.frame == "link"
    if turning:
        force, moment = (places.turned(load.link, part) for part in (force, moment))
    at = np.zeros((3, 1)) if load.force is None else places.point(load.link, load.point)
    out.add(WRENCH, i, int(turning), force / places.L, moment / places.L**2, at)


def _effort(places: _Places, load: Any, out: Acting) -> None:
    column, slides = places.column(load.freedom)
    out.add(EFFORT, column, 0, rows(load.value) / places.L ** (1 if slides else 2))


def _law(places: _Places, load: Any, out: Acting, *law: Any) -> None:
    """``F = -stiffness (x - rest) - damping x'`` in a freedom or between points."""
    stiffness, rest, damping = map(rows, law)
    if load.in_freedom is not None:
        column, slides = places.column(load.in_freedom)
        unit = 1.0 if slides else places.L**-2
        out.add(LAW, column, 0, stiffness * unit, rest / places.L if slides else rest, damping * unit)
        return
    p, q = places.point(load.a, load.p), places.point(load.b, load.q)
    out.add(BETWEEN, places.link(load.a), places.link(load.b), p, q, stiffness, rest / places.L, damping)


def _elastic(places: _Places, load: Any, out: Acting) -> None:
    _law(places, load, out, load.stiffness, getattr(load, load.rest), load.damping)


def _damper(places: _Places, load: Any, out: Acting) -> None:
    _law(places, load, out, 0.0, 0.0, load.coefficient)


def _tabled(places: _Places, load: Any, out: Acting) -> None:
    """The cubics of a table over the coordinate or the rate, of the freedom that it reads, in internal units."""
    pieces, slides, reads_slide, column, read = load.law.pieces, True, True, -1, -1
    if load.in_freedom is not None:
        column, slides = places.column(load.in_freedom)
        read, reads_slide = places.column(load.reads_freedom)
    length, unit = places.L if reads_slide else 1.0, 1.0 / places.L if slides else places.L**-2
    cubics = (unit * pieces.c * length ** np.arange(3.0, -1.0, -1.0)[:, None]).T.reshape(-1, 1)
    kind = load.law.x is None, load.law.outside == "hold", len(pieces.x) - 1
    numbers = rows(load.free) / length, *map(rows, kind), (pieces.x / length)[:, None], cubics * rows(load.scale)
    if load.in_freedom is not None:
        out.add(TABLE, column, read, *numbers)
        return
    p, q = places.point(load.a, load.p), places.point(load.b, load.q)
    out.add(TABLE_BETWEEN, places.link(load.a), places.link(load.b), p, q, *numbers)


def _friction(places: _Places, load: Any, out: Acting) -> None:
    """Every place of a pair that rubs, and what is viscous."""
    s, L = places.system, places.L
    load = load.with_numbers(lambda value: value.values if isinstance(value, PerCase) else value)
    if load.of not in s.m.pair_index:
        _friction_of_teeth(places, load, out)
        return
    k = s.m.place_of_pair(load.of)
    pair, row, first = s.m.pairs[k], s.groups[int(s.type_of[k])].row, int(s.first_column[k])
    for rubs in places_in(load, row):
        turn, slide = (-1 if j is None else first + j for j in (rubs.turn, rubs.slide))
        if rubs.way == "contact":
            slide = places.before(k, next(iter(row.reactions or ())).frame)
        if rubs.way == "opening":
            assert row.gap is not None
            turn, slide = places.before(k, row.gap), first + row.gap
        radius = {"contact": pair.radius_b, "opening": pair.radius_b, "collar": load.thrust_radius}.get(
            rubs.way, load.radius
        )
        mu, stribeck, radius, width = (0.0 if v is None else v for v in (load.mu, load.stribeck, radius, load.width))
        numbers = (
            mu, load.coefficient_at_rest, stribeck / L, load.preload / L, load.on == "b", turn, slide, radius / L, load.model == "circle",
            s.par.pitch[k], rubs.side and rubs.side / (load.length / L), width / L, np.tan(load.flank),
        )  # fmt: skip
        out.add(CONTACT + RUBBING.index(rubs.way), k, 0, *(np.atleast_2d(np.asarray(v, dtype=float)) for v in numbers))
    # also where it is zero: the layout of a table does not hang on its numbers
    for j, freedom in enumerate(row.freedoms if len({f.turns for f in row.freedoms}) == 1 else ()):
        unit = 1.0 if not freedom.turns else L**-2
        out.add(LAW, first + j, 0, *rows((0.0, 0.0), 2)[:, None], np.atleast_2d(load.viscous * unit))


def _friction_of_teeth(places: _Places, load: Any, out: Acting) -> None:
    """Teeth that rub; belts rub without a force of their own."""
    s, L = places.system, places.L
    if not rubbing_loads(s.m, (load,)):
        return
    g = place_of_coupling(s.m, load)
    at = on_carrier(s, g)
    assert at is not None
    arm, line = mean_sliding(s.m, s.m.couplings[g]), sum(bool(c.steps) for c in s.m.couplings[:g])
    radius = 0.0 if arm is None else -1.0 if np.isnan(arm) else arm / L
    R, p = places.own[:, :3, [at.link]], places.own[:, 3, [at.link]]
    turn, slide = rotate(R, at.screws[:3]), rotate(R, at.screws[3:])
    mu, stribeck, efficiency = (0.0 if v is None else v for v in (load.mu, load.stribeck, load.efficiency))
    numbers = (
        mu, load.coefficient_at_rest, stribeck / L, load.preload / L, 0.0, -1, arm is None, radius, 0.0, 0.0, 0.0, 0.0, 0.0,
        efficiency, *at.per, *_by_item(rotate(R, at.points) + p), *_by_item(np.concatenate([turn, slide + cross(p, turn)])),
    )  # fmt: skip
    out.add(CONTACT + len(RUBBING), line, 0, *(np.atleast_2d(np.asarray(v, dtype=float)) for v in numbers))


KINDS: dict[type[Load], Callable[[_Places, Any, Acting], None]] = {
    Gravity: _weight,
    Wrench: _wrench,
    Effort: _effort,
    Spring: _elastic,
    TorsionSpring: _elastic,
    Damper: _damper,
    ForceLaw: _tabled,
    Friction: _friction,
}
"""What puts a load into the tables, by its class."""
