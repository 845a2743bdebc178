"""Rows of the pair table in a plane: of freedoms and components those in span{Rz, Tx, Ty} of the plane remain.

The axis of the marker that stands on the plane, its ``normal``, is the same in all frames of a row, as all motions that remain turn about
it or slide across it: z for a turn, x for a slide along z. A freedom that leaves the plane is part of the model of no bearing; a row that
holds no link (a coupling of torques, names for a motion) loses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from mechgraph.maths.se3 import IN_PLANE, Array
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.contact_types import ROWS, travels
from mechgraph.pairs.factors import Component, ConstantScrew, Factor, Freedom
from mechgraph.pairs.pair_type import TABLE, PairType

NORMALS = (2, 0, 1)
"""Axes of the marker in the order in which they are tried as the normal of the plane."""
MARKERS = ("second", "third axis", "axis")
"""What the axes of a marker are called."""
CLEAR = 1e-9
"""Part of a unit screw, tried at random positions, above which it leaves the plane."""


@lru_cache(maxsize=4096)
def in_plane(row: PairType) -> PairType | None:
    """The row in a plane; None where it can leave the plane, or holds nothing there although it holds something in space."""
    return next(filter(None, (_projected(row, normal) for normal in NORMALS)), None)


def _projected(row: PairType, normal: int) -> PairType | None:
    """The row with that axis of its marker standing on the plane, None where that cannot be."""
    steps, kept = _steps(row, normal)
    sides = [_side(c.wrench, c.per_pitch, normal) for c in row.reactions or ()]
    if (row.bears and len(kept) < row.f) or None in sides:
        return None
    count = [sum(j < k for j in kept) for k in range(row.f + 1)]  # of the freedoms before a frame that remain

    def moved(part: Component) -> Component:
        return replace(part, frame=count[part.frame])

    reactions = None
    if row.reactions is not None:
        reactions = tuple(moved(c) for c, side in zip(row.reactions, sides, strict=True) if side)
        if len(reactions) != 3 - len(kept):
            return None
    if row.bears and len(kept) == 3 and not row.opens:
        return None
    touching = row.touching
    if touching is not None and not {*touching.forces} <= {c.name for c in reactions or ()}:
        touching = None
    efforts, pushed = tuple(moved(row.efforts[j]) for j in kept), tuple(kept.index(j) for j in row.pushed)
    given = {"reactions": reactions, "efforts": efforts, "pushed": pushed, "bookkeeping": None, "touching": touching}
    out = row.with_steps(steps, normal=normal, spatial=row, square_second=False, **given)
    return out if any(_empty(step) for step in steps) or _stays(out) else None


def _empty(step: Factor) -> bool:
    """Whether a factor is a place for a curve that is not there: it can be counted, not evaluated."""
    return getattr(step, "curve", 0) is None


def _steps(row: PairType, normal: int) -> tuple[list[Factor], list[int]]:
    """The factors of which something remains, and the freedoms that do."""
    steps: list[Factor] = []
    kept: list[int] = []
    for step, columns in zip(row.steps, row.factors, strict=True):
        stay = [j for j in columns if _side(row.freedoms[j].twist, row.freedoms[j].per_pitch, normal)]
        kept += stay
        if len(stay) == len(columns):
            steps.append(step)
        else:
            steps += [ConstantScrew(row.freedoms[j]) for j in stay]
    return steps, kept


def _side(screw: Sequence[float], per_pitch: Sequence[float], normal: int) -> bool | None:
    """Whether a twist or wrench (what stands along the normal, then what lies across it) is in the plane; None where it is partly."""
    parts = np.abs([screw, per_pitch])
    inside = _rows_of(normal)
    outside = np.delete(np.arange(6), inside)
    if parts[:, outside].any():
        return None if parts[:, inside].any() else False
    return True


def _rows_of(normal: int) -> list[int]:
    """Places of the turn about an axis and of the slides across it."""
    return [normal, *(3 + i for i in range(3) if i != normal)]


def _stays(row: PairType) -> bool:
    """Whether twists, efforts and components lie in the plane at random positions."""
    assert row.normal is not None
    x = _tried(row)
    pitch = np.zeros((1, 1))
    frames = evaluation.frames_of(row, pitch, x)
    parts = (evaluation.twists_of, evaluation.efforts_of, evaluation.reactions_of)
    S, E, W = (part(row, pitch, frames, x) for part in parts)
    outside = np.delete(np.arange(6), _rows_of(row.normal))
    size = max(1.0, float(np.abs(S).max(initial=0.0)))
    leaves = max(float(np.abs(part[outside]).max(initial=0.0)) for part in (S, E, W))
    work = float(np.abs(np.einsum("ifnt,icnt->fcnt", S, W)).max(initial=0.0))
    return max(leaves, work) <= CLEAR * size


def _tried(row: PairType) -> Array:
    """States at which a row is tried: random ones, along a curve places of it."""
    x = evaluation.random_coordinates(row, np.random.default_rng(12345), 1, 16)
    for step, _, numbers in evaluation.placed(row):
        if travels(row) and not isinstance(step, ConstantScrew):
            low, high = (end if np.isfinite(end) else np.copysign(1.0, end) for end in step.ranges[0])
            x[numbers] = np.linspace(low, high, x.shape[-1])
    return x


Held = tuple[int, int]
"""How many wrenches of the plane a row holds, and how many of them are forces."""


@lru_cache(maxsize=1)
def _by_held() -> dict[Held, str]:
    """For what a row can hold in the plane the symbol of a row that does."""
    out: dict[Held, str] = {}
    for row in (*TABLE.values(), ROWS["Ps"]):
        flat = in_plane(row)
        if flat is not None:
            forces = sum(not c.is_couple for c in flat.reactions or ())
            out.setdefault((flat.held, forces), row.symbol)
    return out


def instead_of(row: PairType, axes: Array) -> str:
    """The symbol of the pair that holds in the plane what a row holds at coordinates zero; ``axes (3, 3)`` of its marker, as columns."""
    if travels(row):
        return "Ps"
    inside = held_in_plane(row, axes)
    forces = int(np.linalg.matrix_rank(inside[1:], tol=CLEAR)) if inside.size else 0
    return _by_held()[inside.shape[1], forces]


def held_in_plane(row: PairType, axes: Array) -> Array:
    """A basis ``(3, k)`` of the wrenches Mz, Fx, Fy of the plane that a row holds at coordinates zero, about its own point."""
    x = evaluation.coordinates_to_state(row, np.zeros((row.f, 1, 1)))
    pitch = np.full((1, 1), 0.3 * row.takes_pitch)
    frames = evaluation.frames_of(row, pitch, x)
    W = evaluation.reactions_of(row, pitch, frames, x)[..., 0, 0]
    W = np.concatenate([axes @ W[:3], axes @ W[3:]])
    _, s, Vt = np.linalg.svd(np.delete(W, IN_PLANE, axis=0)) if W.size else (None, np.zeros(0), np.zeros((0, 0)))
    U, s, _ = np.linalg.svd(W[IN_PLANE] @ Vt[int((s > CLEAR).sum()) :].T)
    return np.asarray(U[:, : int((s > CLEAR).sum())])


def reach_of(freedoms: Sequence[Freedom], axes: Array) -> list[str]:
    """Names of freedoms, given in axes of a marker (columns), that leave the plane."""
    out = []
    for freedom in freedoms:
        twist = np.array(freedom.twist) + 0.3 * np.array(freedom.per_pitch)
        moved = np.concatenate([axes @ twist[:3], axes @ twist[3:]])
        if np.abs(np.delete(moved, IN_PLANE)).max() > CLEAR:
            out.append(freedom.name)
    return out
