"""A pair type is a row of data: freedoms, reaction components, efforts, and how Lee's ledger counts it; the table of them.

A row is an ordered list of elementary freedoms, each a constant unit twist in the marker frame left by the freedoms before
it, its reaction components, each a constant wrench in a named frame ``k`` (the marker frame left after ``k`` single
freedoms), and one effort wrench for every freedom, so that ``S^T E = 1``. Nothing branches on the symbol.
To add a pair type, add a row to the table.

One batched evaluation of every row of the pair table: displacement, twists, reaction and effort wrenches.

All functions take ``n`` pairs of one type at ``T`` positions: state numbers ``x`` are ``(nx, n, T)``, pitches
``(n, 1)``. A rotation is held as a unit quaternion (four numbers), so it has no chart singularity. Numbers may be complex.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import KW_ONLY, field, replace
from functools import cached_property
from itertools import accumulate, pairwise, starmap
from typing import Any

import numpy as np

from mechgraph.document import Document, RowsByName, Table
from mechgraph.errors import DeclarationError
from mechgraph.maths.se3 import (
    Array,
    batch_last,
    compose,
    cross,
    identity,
    move_constant,
    move_twist,
    quaternion_exp,
    quaternion_log,
    turned,
)
from mechgraph.pairs.factors import (
    UNIT_TWISTS,
    UNIT_WRENCHES,
    Bookkeeping,
    Component,
    ConstantScrew,
    Factor,
    Freedom,
    Rotation,
    Touching,
    all_scaled,
    bookkeeping_faults,
    read_component,
    read_freedom,
)
from mechgraph.quantities import items_of, shown, wrong


def placed(row: PairType) -> list[tuple[Factor, slice, slice]]:
    """Every factor of a row with the places of its freedoms and of its state numbers."""
    columns = accumulate((len(step.freedoms) for step in row.steps), initial=0)
    numbers = accumulate((step.n_state for step in row.steps), initial=0)
    return list(zip(row.steps, starmap(slice, pairwise(columns)), starmap(slice, pairwise(numbers)), strict=True))


def frames_of(row: PairType, pitch: Array, x: Array, base: Array | None = None) -> list[Array]:
    """Frames 0, 1, ... of the pair as poses ``(3, 4, n, T)``, in the frame of ``base`` (marker A where it is None).

    The list is indexed by the number of single freedoms before the frame; places inside a factor of several freedoms hold its
    start. The last entry is the frame of marker B.
    """
    frames = [identity(*x.shape[1:]) if base is None else base]
    for step, columns, numbers in placed(row):
        frames += [frames[-1]] * (columns.stop - columns.start - 1)
        frames.append(compose(frames[-1], step.pose(x[numbers], pitch)))
    return frames


def twists_of(row: PairType, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Twists of the freedoms, ``(6, f, n, T)``, in the frame in which ``frames`` are given.

    The state ``x`` may be left out where all twists are constant in their frames.
    """
    X = frames[0]
    out = np.empty((6, row.f, *X.shape[2:]), dtype=frames[-1].dtype if x is None else np.result_type(X, x))
    numbers = np.empty((row.nx, *X.shape[2:])) if x is None else x
    for step, columns, rows in placed(row):
        local = step.twists(numbers[rows], pitch)
        before = frames[columns.start]
        for j in range(local.shape[1]):
            moved = np.broadcast_to(local[:, j], (6, *X.shape[2:]))
            out[:, columns.start + j] = move_twist(before, moved)
    return out


def freedoms_of(freedoms: tuple[Freedom, ...], pitch: Array, X: Array) -> Array:
    """Unit twists of freedoms that are constant in the frame of pose ``X``, ``(6, n freedoms, n, T)``."""
    return _moved([(f.twist[3:], f.per_pitch[3:], f.twist[:3]) for f in freedoms], pitch, [(X, X)] * len(freedoms))


def components_of(components: tuple[Component, ...], pitch: Array, frames: Sequence[Array]) -> Array:
    """Wrenches of components, each constant in its frame, ``(6, n components, n, T)``."""
    moved = _moved(
        [(c.wrench[:3], c.per_pitch[:3], c.wrench[3:]) for c in components],
        pitch,
        [(frames[c.frame], frames[-1] if c.at_b else frames[c.frame]) for c in components],
    )
    out = np.concatenate([moved[3:], moved[:3]])
    return out if components else np.empty((6, 0, *frames[0].shape[2:]))


def _moved(
    screws: list[tuple[Sequence[float], Sequence[float], Sequence[float]]],
    pitch: Array,
    poses: list[tuple[Array, Array]],
) -> Array:
    """Screws given by free part, free part per pitch, and bound part, moved to the directions of the first of two poses and
    the origin of the second, ``(6, number, n, T)``: the bound part (rotation or force) first.
    """
    if not screws:
        return np.empty((6, 0, 0, 0))
    parts = []
    for (free, per_pitch, bound), (X, at) in zip(screws, poses, strict=True):
        direction, moment = move_constant(X, np.array(free), np.array(bound), at[:, 3])
        for i, share in enumerate(per_pitch):
            if share:
                moment = moment + share * pitch * X[:, i]
        parts.append(np.concatenate([direction, moment]))
    return np.stack(parts, axis=1)


def efforts_of(row: PairType, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Effort wrenches ``E``, one a freedom, ``(6, f, n, T)``; combined to ``E (S^T E)^-1`` where the row asks for it."""
    E = components_of(row.efforts, pitch, frames)
    return dual(row, E, twists_of(row, pitch, frames, x), frames[-1][:, 3]) if row.computed_efforts else E


def dual(row: PairType, E: Array, S: Array, p: Array) -> Array:
    """The combinations ``E (S^T E)^-1`` of efforts ``(6, f, n, T)`` of a row that are dual to the twists ``S``, B at ``p (3, n, T)``."""
    if row.pushed:
        E, at = E.copy(), list(row.pushed)
        along = S[3:, at] + cross(S[:3, at], np.broadcast_to(p[:, None], S[3:, at].shape))
        E[3:, at], E[:3, at] = along, cross(np.broadcast_to(p[:, None], along.shape), along)
    unit = np.einsum("ifnt,ignt->ntfg", S, E)
    return np.asarray(np.einsum("ignt,gfnt->ifnt", E, batch_last(np.linalg.inv(unit))))


def without_work(W: Array, E: Array, S: Array) -> Array:
    """``W - E S^T W``: components ``(6, c, n, T)`` less the efforts ``E`` that they take in the freedoms ``S``, to which ``E`` is dual."""
    return np.asarray(W - np.einsum("ifnt,jfnt,jcnt->icnt", E, S, W))


def reactions_of(row: PairType, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Reaction wrenches ``W``, ``(6, 6 - f, n, T)``: the row's components, or the null space of ``S^T``."""
    if row.reactions is not None:
        W = components_of(row.reactions, pitch, frames)
        if not row.computed_reactions:
            return W
        return without_work(W, efforts_of(row, pitch, frames, x), twists_of(row, pitch, frames, x))
    return reciprocal(twists_of(row, pitch, frames, x), frames[-1], row.normal)


def reciprocal(S: Array, B: Array, normal: int | None = None) -> Array:
    """Wrenches ``(6, 6 - f, n, T)`` that do no work on the twists ``S (6, f, n, T)``: the null space of ``S^T``.

    It is taken about the origin of marker B, in its directions; in a plane on which the axis ``normal`` of B stands among the three of it.
    """
    f = S.shape[1]
    if not f and normal is None:
        return np.broadcast_to(np.eye(6)[:, :, None, None], (6, 6, *B.shape[2:])).copy()
    rows = slice(None) if normal is None else [normal, *(3 + i for i in range(3) if i != normal)]
    turned = np.einsum("jint,jfnt->ifnt", B[:, :3], S[:3])
    moved = S[3:] + cross(S[:3], np.broadcast_to(B[:, None, 3], S[:3].shape))
    local = np.concatenate([turned, np.einsum("jint,jfnt->ifnt", B[:, :3], moved)])
    found = np.moveaxis(_null_of_transpose(np.moveaxis(local[rows], (0, 1), (-2, -1))), (-2, -1), (0, 1))
    null = np.zeros((6, *found.shape[1:]), dtype=found.dtype)
    null[rows] = found
    force = np.einsum("ijnt,jcnt->icnt", B[:, :3], null[3:])
    moment = np.einsum("ijnt,jcnt->icnt", B[:, :3], null[:3])
    return np.concatenate([moment + cross(np.broadcast_to(B[:, None, 3], force.shape), force), force])


def _null_of_transpose(S: Array) -> Array:
    """Bases ``(..., n, n - f)`` of the null spaces of ``S^T`` for ``S (..., n, f)``.

    Orthonormal for real ``S``. For complex ones that of the real part, corrected by its range ``U`` so that ``S^T N = 0``
    without a conjugate: ``N - U (S^T U)^-1 S^T N``.
    """
    f = S.shape[-1]
    U = np.linalg.svd(S.real, full_matrices=True)[0]
    N, U = U[..., f:], U[..., :f]
    if not np.iscomplexobj(S):
        return np.asarray(N)
    St = np.swapaxes(S, -1, -2)
    return np.asarray(N - U @ np.linalg.solve(St @ U, St @ N))


def coordinates_to_state(row: PairType, q: Array) -> Array:
    """State numbers ``(nx, ...)`` from user coordinates ``(f, ...)`` (rotation vectors for rotations)."""
    parts = [quaternion_exp(q[columns]) if step.holds_rotation else q[columns] for step, columns, _ in placed(row)]
    return np.concatenate(parts) if parts else np.empty((0, *q.shape[1:]))


def advance(row: PairType, x: Array, dq: Array) -> Array:
    """State after the increments ``dq`` ``(f, ...)``: added for single freedoms, ``exp(dq) Q`` for rotations."""
    out = np.empty(np.broadcast_shapes(x.shape, (row.nx, *dq.shape[1:])), dtype=np.result_type(x, dq))
    for step, columns, rows in placed(row):
        if step.holds_rotation:
            out[rows] = turned(x[rows], dq[columns])
        else:
            out[rows] = x[rows] + dq[columns]
    return out


def state_to_coordinates(row: PairType, x: Array, start: Array | None = None) -> Array:
    """User coordinates ``(f, n, ..., T)`` of n pairs from states, rotation vectors continued along the last axis.

    The rotation vector at the first position is the one nearest to ``start`` ``(f, n)`` (zero where it is None); at every
    further one that nearest to the one before: of ``v + 2 pi k v/|v|`` the nearest.
    """
    out = np.empty((row.f, *x.shape[1:]), dtype=x.dtype)
    for step, columns, rows in placed(row):
        if step.holds_rotation:
            first = np.zeros(3) if start is None else start[columns]
            out[columns] = _continued(quaternion_log(x[rows]), first)
        else:
            out[columns] = x[rows]
    return out


def _continued(v: Array, first: Array) -> Array:
    """Rotation vectors ``(3, n, ..., T)`` continued along the last axis: signed angles about axes that do not flip, unwrapped."""
    near = np.broadcast_to(first.reshape(*first.shape, *(1,) * (v.ndim - 1 - first.ndim)), v.shape[:-1])
    flat, starts = v.reshape(3, -1, v.shape[-1]), near.reshape(3, -1)
    if np.isfinite(flat).all():
        return _continued_paths(flat, starts).reshape(v.shape)
    out = np.full_like(flat, np.nan)
    for case in range(flat.shape[1]):
        good = np.flatnonzero(np.isfinite(flat[:, case]).all(axis=0))
        if good.size:
            out[:, case, good] = _continued_paths(flat[:, case : case + 1, good], starts[:, case : case + 1])[:, 0]
    return out.reshape(v.shape)


def _continued_paths(v: Array, first: Array) -> Array:
    """The same for ``(3, n, T)`` without gaps, ``first (3, n)``."""
    angle = np.sqrt((v * v).sum(axis=0))
    clear = angle > 1e-9
    # where the angle is nearly zero the axis of the last clear position serves, before the first one that one's
    last_clear = np.maximum.accumulate(np.where(clear, np.arange(v.shape[2]), -1), axis=1)
    last_clear = np.where(last_clear < 0, np.argmax(clear, axis=1)[:, None], last_clear)
    axis = np.take_along_axis(v / np.where(clear, angle, 1.0), last_clear[None], axis=2)
    flips = np.where((axis[..., 1:] * axis[..., :-1]).sum(axis=0) < 0, -1.0, 1.0)
    axis = axis * np.cumprod(np.concatenate([np.ones((v.shape[1], 1)), flips], axis=1), axis=1)
    signed = np.unwrap((v * axis).sum(axis=0), axis=1)
    turns = np.round(((first * axis[..., 0]).sum(axis=0) - signed[:, 0]) / (2 * np.pi))[:, None]
    moved = (signed + 2 * np.pi * turns) * axis
    turned = (clear | (np.abs(signed) > 1.0) | (turns != 0)) & clear.any(axis=1, keepdims=True)
    return np.asarray(np.where(turned, moved, v))


def random_coordinates(row: PairType, rng: np.random.Generator, n: int, T: int) -> Array:
    """Random states ``(nx, n, T)`` with coordinates of size about one."""
    return coordinates_to_state(row, rng.uniform(-1.2, 1.2, (row.f, n, T)))


ROTATION = ("Rx", "Ry", "Rz")


def _factors(given: Sequence[object], faults: list[str]) -> tuple[Factor, ...]:
    """The factors that are given as names, freedoms or factors."""
    out: list[Factor] = []
    for item in given:
        if isinstance(item, Factor):
            out.append(item)
        elif isinstance(item, str) and item == "rotation":
            out.append(Rotation(tuple(Freedom(name, UNIT_TWISTS[name]) for name in ROTATION)))
        else:
            read = read_freedom(item, faults)
            out += [] if read is None else [ConstantScrew(read)]
    return tuple(out)


def _of_steps(steps: Sequence[Factor]) -> dict[str, tuple[Any, ...]]:
    """What follows from the factors of a row: their freedoms, and the frame before each of these."""
    starts = accumulate((len(step.freedoms) for step in steps), initial=0)
    return {
        "freedoms": tuple(freedom for step in steps for freedom in step.freedoms),
        "frame_before": tuple(start for step, start in zip(steps, starts, strict=False) for _ in step.freedoms),
    }


@dataclasses.dataclass(frozen=True)  # at once: rows of the table are made without ``__init__``
class PairType:
    """Declare a row of the pair table: freedoms, reaction components, efforts.

    Pass it to ``Pair`` in place of a symbol. Freedom k acts in frame k - 1, the frame left by the freedoms before it; frame 0 is the
    marker on link a.

    Parameters
    ----------
    symbol : str
        Starts with a letter, e.g. ``"Sc"``.
    name : str
        E.g. ``"sphere in slotted cylinder"``.
    freedoms : sequence
        In order, each ``"Rx"`` to ``"Tz"``, ``"Rz + pitch Tz"``, ``"rotation"`` (three freedoms kept as one rotation) or a ``Freedom``.
    reactions : sequence, optional
        Components that do no work, each ``"Fx"`` (frame 0), ``"Fz@2"`` (frame 2) or a ``Component``. Default: the null space of the
        freedoms, components named n1, n2, ...
    efforts : sequence, optional
        One ``Component`` per freedom. Default: a unit couple about each rotation, a unit force along each translation.
    bookkeeping : Bookkeeping, optional
        Lee's choice of unknowns. Default: ``(6 - f, 0)``.
    directed : bool
        Whether the pair has an axis (False for a sphere or a weld).
    square_second : bool
        Whether ``second`` must be perpendicular to ``axis`` as given.

    Raises
    ------
    DeclarationError
        With every fault: unknown names, reactions that do work in the freedoms, efforts that are not dual to them.

    Examples
    --------
    >>> import mechgraph as mg
    >>> slot = mg.PairType("Pn", "pin in slot", freedoms=["Tx", "Rz"], reactions=["Fy@1", "Fz@1", "Mx@1", "My@1"])
    >>> slot.f, slot.component_names
    (2, ('Fy', 'Fz', 'Mx', 'My'))
    """

    symbol: str
    name: str = ""
    _: KW_ONLY
    freedoms: Any
    reactions: Any = None
    efforts: Any = None
    bookkeeping: Bookkeeping | None = None
    directed: bool = True
    square_second: bool = False
    steps: tuple[Factor, ...] = field(init=False)
    frame_before: tuple[int, ...] = field(init=False)
    computed_efforts: bool = field(init=False, default=False)
    touching: Touching | None = field(init=False, default=None)
    computed_reactions: bool = field(init=False, default=False)
    pushed: tuple[int, ...] = field(init=False, default=())
    normal: int | None = field(init=False, default=None)
    spatial: PairType | None = field(init=False, default=None)
    opens: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        tried = self.efforts is None
        faults = self.read()
        if not faults and tried:
            object.__setattr__(self, "computed_efforts", not _is_dual(self))
        if not faults:
            faults += _row_faults(self)
        if faults:
            raise DeclarationError(f"pair type {shown(self.symbol)}", faults)

    def read(self) -> list[str]:
        """Read what is given as texts and numbers; its faults, before any number is tried."""
        faults: list[str] = []
        if not isinstance(self.symbol, str) or not self.symbol.isidentifier():
            faults.append(wrong(self.symbol, "symbol", "letters and digits, starting with a letter"))
        if not isinstance(self.name, str):
            faults.append(wrong(self.name, "name", "a text"))
        if self.bookkeeping is not None:
            faults += bookkeeping_faults(self.bookkeeping)
        flags = (("directed", self.directed), ("square_second", self.square_second))
        faults += [wrong(flag, what, "true or false") for what, flag in flags if not isinstance(flag, bool)]
        steps = _factors(items_of(self.freedoms, "freedoms", faults), faults)
        parts = _of_steps(steps)
        for what in ("reactions", "efforts"):
            if (given := getattr(self, what)) is not None:
                items = items_of(given, what, faults)
                parts[what] = tuple(c for item in items if (c := read_component(item, faults, what[:-1])) is not None)
        if self.efforts is None:
            parts["efforts"] = tuple(map(_dual_effort, parts["freedoms"], parts["frame_before"]))
        named = {"name": self.symbol} if isinstance(self.name, str) and not self.name else {}
        vars(self).update(steps=steps, **parts, **named)
        return faults

    def scaled(self, L: float) -> PairType:
        """The row with its lengths divided by ``L``: pitches of turns given as numbers, arms of forces; itself where it has none."""
        if not self.has_lengths:
            return self
        return self.with_steps(
            [step.scaled(L) for step in self.steps],
            reactions=None if self.reactions is None else all_scaled(self.reactions, L),
            efforts=all_scaled(self.efforts, L),
            bookkeeping=self.bookkeeping and self.bookkeeping.scaled(L),
        )

    def with_steps(self, steps: Sequence[Factor], **changes: Any) -> PairType:
        """The row with other factors, and whatever goes with them; not tried."""
        out = copy(self)
        for name in ("factors", "nx", "has_lengths", "takes_pitch"):
            vars(out).pop(name, None)
        vars(out).update(steps=tuple(steps), **_of_steps(steps), **changes)
        return out

    @cached_property
    def has_lengths(self) -> bool:
        """Whether numbers of the row are lengths."""
        book = self.bookkeeping or Bookkeeping((), ())
        parts = (*self.steps, *(self.reactions or ()), *self.efforts, *book.conditions, *book.along)
        return any(part.scaled(2.0) is not part for part in parts)

    @property
    def gap(self) -> int | None:
        """The freedom in which a contact opens; None where it does not."""
        return next((j for j, freedom in enumerate(self.freedoms) if self.opens and freedom.name == "gap"), None)

    @property
    def normal_frame(self) -> int:
        """The frame of a contact in which the normal force acts; of other pairs 0, in which all reactions do."""
        name = self.touching.forces[0] if self.touching else ""
        return next((c.frame for c in self.reactions or () if c.name == name), 0)

    @property
    def can_open(self) -> bool:
        """Whether one force alone keeps it in touch, so that there is a row in which it opens."""
        form = self.touching
        return form is not None and len(form.forces) == 1 and form.tilting is None and self.reactions is not None

    def opened(self, side: float) -> PairType:
        """The row in which the contact may open: a slide ``gap`` to a ``side`` along its normal stands in place of the normal force."""
        row = self.spatial or self
        assert row.touching is not None
        normal = next(c for c in row.reactions or () if c.name in row.touching.forces)
        k, force = normal.frame, (0.0, 0.0, 0.0, *(side * v for v in normal.wrench[3:]))
        steps = list(row.steps)
        steps.insert([columns[0] for columns in row.factors].index(k), ConstantScrew(Freedom("gap", force)))
        behind = {c: replace(c, frame=c.frame + (c.frame >= k)) for c in (*(row.reactions or ()), *row.efforts)}
        efforts = [behind[c] for c in row.efforts]
        efforts.insert(k, Component("gap", force, k))
        reactions = tuple(behind[c] for c in row.reactions or () if c is not normal)
        computed = {"computed_efforts": True, "computed_reactions": True}
        return row.with_steps(steps, reactions=reactions, efforts=tuple(efforts), touching=None, opens=True, **computed)

    @property
    def f(self) -> int:
        """Number of freedoms."""
        return len(self.freedoms)

    @property
    def width(self) -> int:
        """Number of freedoms and components together: 6, in the plane 3."""
        return 6 if self.normal is None else 3

    @property
    def held(self) -> int:
        """Number of reaction components."""
        return self.width - self.f

    @property
    def component_names(self) -> tuple[str, ...]:
        """Names of the reaction components, in order."""
        if self.reactions is None:
            return tuple(f"n{i + 1}" for i in range(self.held))
        return tuple(c.name for c in self.reactions)

    @cached_property
    def factors(self) -> tuple[tuple[int, ...], ...]:
        """Freedoms grouped by factor: one index for a single freedom, three for a rotation."""
        return tuple(tuple(range(columns.start, columns.stop)) for _, columns, _ in placed(self))

    @cached_property
    def nx(self) -> int:
        """Number of state numbers: one for a single freedom, a unit quaternion for a rotation."""
        return sum(step.n_state for step in self.steps)

    @cached_property
    def takes_pitch(self) -> bool:
        """Whether a pair of this type needs a pitch."""
        rows = [f.per_pitch for f in self.freedoms] + [c.per_pitch for c in self.reactions or ()]
        return any(any(row) for row in rows)

    @property
    def drivable(self) -> tuple[bool, ...]:
        """Which freedoms take a drive: the single ones, not those of a rotation."""
        return tuple(not step.holds_rotation for step in self.steps for _ in step.freedoms)

    @property
    def bears(self) -> bool:
        """Whether it transmits a force, so that it can hold a link; a torque coupling does not."""
        return self.reactions is None or not all(c.is_couple for c in self.reactions)

    @property
    def unknowns_and_equations(self) -> tuple[int, int]:
        """Lee's ledger entry of the row; its components and no equation without a bookkeeping."""
        return (self.bookkeeping.unknowns, self.bookkeeping.equations) if self.bookkeeping else (self.held, 0)

    def __repr__(self) -> str:
        return f"PairType({self.symbol!r}, {self.name!r}, f={self.f})"


def _dual_effort(freedom: Freedom, frame: int) -> Component:
    """Unit couple about a turn, or unit force along a slide through the origin of marker B."""
    w, v = freedom.twist[:3], freedom.twist[3:]
    if freedom.turns:
        return Component("M" + freedom.name[1:], (*w, 0.0, 0.0, 0.0), frame, at_b=True)
    return Component("F" + freedom.name[1:], (0.0, 0.0, 0.0, *v), frame, at_b=True)


def _tried(row: PairType, of: Callable[[PairType, Array, list[Array], Array], Array]) -> Array:
    """Twists, efforts or components of a row at random positions (fixed seed)."""
    x, pitch = random_coordinates(row, np.random.default_rng(12345), 1, 7), np.array([[0.3]])
    return of(row, pitch, frames_of(row, pitch, x), x)


def _is_dual(row: PairType) -> bool:
    """Whether ``S^T E = 1`` there."""
    unit = np.einsum("ifnt,ignt->ntfg", _tried(row, twists_of), _tried(row, efforts_of))
    return bool(np.abs(unit - np.eye(row.f)).max(initial=0.0) < 1e-9)


def _row_faults(row: PairType) -> list[str]:
    """Faults of a row, seen at random positions (fixed seed): unit twists, reciprocity, ranks, ``S^T E = 1``."""
    faults = []
    steps = [step for step in row.steps for _ in step.freedoms]
    for j, freedom in enumerate(row.freedoms):
        w, v = np.array(freedom.twist[:3]), np.array(freedom.twist[3:])
        if isinstance(steps[j], ConstantScrew) and abs(np.linalg.norm(w if w.any() else v) - 1) > 1e-12:
            why = "is not a unit twist; divide it by its length"
            faults.append(f"freedom {freedom.name}: the twist {freedom.twist} {why}")
    names = [f.name for f in row.freedoms]
    if len(set(names)) < len(names):
        why = "names repeat; give each a name of its own through Freedom(name, twist)"
        faults.append(f"freedoms {', '.join(names)}: {why}")
    if len(set(row.component_names)) < len(row.component_names):
        faults.append(f"reactions {', '.join(row.component_names)}: names repeat")
    if len(row.efforts) != row.f:
        faults.append(f"efforts: {len(row.efforts)} given for {row.f} freedoms; give one for each")
    if row.reactions is not None and len(row.reactions) != 6 - row.f:
        faults.append(f"reactions: {len(row.reactions)} given, expected 6 - f = {6 - row.f}")
    legal = {0, *np.cumsum([len(g) for g in row.factors]).tolist()}
    for c in (*(row.reactions or ()), *row.efforts):
        if c.frame not in legal:
            known = f"frames of this row: {sorted(legal)}"
            faults.append(f"component {c.name}: there is no frame {shown(c.frame)}; {known}")
    if row.f > 6:
        faults.append(f"freedoms: {row.f} given, a pair has at most 6")
    if faults:
        return faults
    S = _tried(row, twists_of)
    if row.f and min(np.linalg.matrix_rank(S[:, :, 0, t], tol=1e-9) for t in range(7)) < row.f:
        faults.append(f"freedoms {', '.join(names)}: not independent at random positions")
        return faults
    W = _tried(row, reactions_of)
    if not _is_dual(row):
        faults.append("efforts: S^T E is not the unit matrix at random positions; give efforts dual to the freedoms")
    work = np.einsum("ifnt,icnt->fcnt", S, W)
    for i, name in enumerate(row.component_names):
        worst = np.abs(work[:, i]).max(initial=0.0)
        if worst > 1e-9:
            faults.append(
                f"reaction {name}: does work on the freedoms (power {worst:.3g} at a random position); "
                "reactions must be reciprocal: try another frame, or reactions=None"
            )
    if not faults and row.f < 6 and np.linalg.matrix_rank(W[:, :, 0, 0], tol=1e-9) < 6 - row.f:
        faults.append(f"reactions {', '.join(row.component_names)}: not independent")
    return faults


_AXIS = (Freedom("Tz", UNIT_TWISTS["Tz"]), Freedom("Rz", UNIT_TWISTS["Rz"]))
_FZ = Component("Fz", UNIT_WRENCHES["Fz"])
_MZ = Component("Mz", UNIT_WRENCHES["Mz"])
_IN_GROOVE = Touching(("Fx", "Fy"), a=(0.0, -1.0), b=(1.0, 1.0))
_SCREW_FZ = Component("Fz", UNIT_WRENCHES["Fz"], 0, (0.0, 0.0, -1.0, 0.0, 0.0, 0.0))


class PairTable(RowsByName[PairType]):
    """The pair table: symbol -> PairType; prints as a table."""

    def __init__(self, rows: Sequence[PairType]) -> None:
        self._rows = {row.symbol: row for row in rows}

    def __getitem__(self, symbol: str) -> PairType:
        if not isinstance(symbol, str):
            raise KeyError(symbol)
        return super().__getitem__(symbol)

    def document(self) -> Document:
        """The table as a document."""
        rows = []
        for row in self.values():
            reactions = " ".join(f"{c.name}@{c.frame}" for c in row.reactions or ()) or " ".join(row.component_names)
            unknowns, equations = row.unknowns_and_equations
            freedoms, count = " ".join(f.label for f in row.freedoms), f"{unknowns} / {equations}"
            rows.append((row.symbol, row.name, str(row.f), freedoms or "none", reactions or "none", count))
        header = ("symbol", "name", "f", "freedoms in order", "reactions @ frame", "Lee's count")
        return Document("Pair types", (Table(header, tuple(rows)),))


def table_row(
    symbol: str,
    name: str,
    freedoms: str | Sequence[object],
    reactions: str | Sequence[object],
    efforts: str | None = None,
    *,
    dual: bool = True,
    **rest: Any,
) -> PairType:
    """A row of the table, not tried at random positions: a test does that for all of them, once and not at every start.

    ``dual``: whether the efforts that are not given, unit couples about the turns and unit forces along the slides, are dual to the
    freedoms.
    """
    row = object.__new__(PairType)
    given = {"freedoms": freedoms, "reactions": reactions, "efforts": efforts}
    parts = {what: v.split(", ") if isinstance(v, str) else v for what, v in given.items()}
    vars(row).update(symbol=symbol, name=name, computed_efforts=not dual or efforts is not None, **parts, **rest)
    row.read()
    return row


TABLE = PairTable(
    [
        table_row("R", "revolute", "Rz", "Fx, Fy, Fz, Mx, My", bookkeeping=Bookkeeping(_AXIS, (_FZ,))),
        table_row("P", "prismatic", "Tz", "Fx, Fy, Mx, My, Mz", bookkeeping=Bookkeeping(_AXIS, (_MZ,))),
        table_row(
            "H", "helical", "Rz + pitch Tz", ["Fx", "Fy", "Mx", "My", _SCREW_FZ],
            bookkeeping=Bookkeeping(_AXIS, (_SCREW_FZ,)),
        ),
        table_row("C", "cylindrical", "Rz, Tz", "Fx, Fy, Mx, My", bookkeeping=Bookkeeping(_AXIS, ())),
        table_row("U", "universal (slotted sphere)", "Rz, Rx", "Fx, Fy, Fz, My@1", square_second=True),
        table_row("S", "spherical", "rotation", "Fx, Fy, Fz", directed=False),
        table_row("E", "planar", "Tx, Ty, Rz", "Fz, Mx, My"),
        table_row(
            "Sc", "sphere in slotted cylinder", "Tz, Ry, Rx", "Fx@1, Fy@1, Mz@2", square_second=True, touching=_IN_GROOVE
        ),
        table_row("Sg", "sphere in groove", "Tz, rotation", "Fx@1, Fy@1", touching=_IN_GROOVE),
        table_row(
            "Cp", "cylinder on plane", "Tx, Ty, Rz, Rx", "Fz@2, My@3", square_second=True,
            touching=Touching(("Fz",), a=(0.0, 0.0), b=(0.0, 1.0), tilting="My"),
        ),
        table_row(
            "Sp", "sphere on plane", "Tx, Ty, rotation", "Fz@2",
            touching=Touching(("Fz",), a=(0.0, 0.0), b=(1.0, 1.0)),
        ),
        table_row("Tc", "torque coupling", "Tx, Ty, Tz, Rx, Ry", "Mz@4"),
        table_row("Fr", "free, all six", "Tx, Ty, Tz, Rx, Ry, Rz", [], dual=False),
        table_row("W", "weld", [], "Fx, Fy, Fz, Mx, My, Mz", directed=False),
    ]
)  # fmt: skip


def pair_types() -> PairTable:
    """Return the pair table, a mapping symbol -> PairType that prints as a table.

    Returns
    -------
    PairTable

    Examples
    --------
    >>> import mechgraph as mg
    >>> table = mg.pair_types()
    >>> table["U"].name, table["U"].component_names
    ('universal (slotted sphere)', ('Fx', 'Fy', 'Fz', 'My'))
    """
    return TABLE
