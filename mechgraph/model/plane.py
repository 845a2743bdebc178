"""A planar mechanism: what is declared with two numbers in three, pairs as rows of the x-y plane, and what leaves it.

``in_space`` and ``pair_in_plane`` give the declared things as everything else reads them: points, forces and centers with a third number
0, moments and inertias about z as vectors and tensors. What leaves the plane is kept, and is a fault (``plane_faults``).

Of the freedoms and components of a pair those in span{Rz, Tx, Ty} of the plane remain (``in_plane``). The axis of the marker that stands
on the plane, its ``normal``, is the same in all frames of a row, as all motions that remain turn about it or slide across it: z for a
turn, x for a slide along z. A freedom that leaves the plane is part of the model of no bearing; a row that holds no link (a coupling of
torques, names for a motion) loses it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    DIRECTION,
    NAMED_POINT,
    POINT,
    POINT_LIST,
    POINTS,
    TENSOR,
    VECTOR,
    VECTOR_SERIES,
    Described,
    FieldFormat,
    as_it_is,
    axes_of,
    filled_second,
    plain,
    same,
)
from mechgraph.maths.se3 import IN_PLANE, Array
from mechgraph.model.pair import NO_POINTS, Link, Marker, Pair
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.contact_types import ROWS, travels, tried_coordinates
from mechgraph.pairs.factors import Component, ConstantScrew, Factor, Freedom
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.quantities import is_numeric, real_array, shown

ROUNDING = 1e-12
"""Part of the largest number of a vector up to which a third one is rounding."""
NORMAL = (0.0, 0.0, 1.0)
INSIDE = (POINT, NAMED_POINT, POINT_LIST, VECTOR, VECTOR_SERIES)
"""Kinds of vectors that lie in the plane."""
Item = TypeVar("Item", bound=Described)


def in_space(item: Item) -> Item:
    """A declared thing with vectors of three numbers; what is no number, or has three that leave the plane, stays as it is."""
    return item.changed(_in_space, in_space)


def _in_space(name: str, about: FieldFormat, value: Any) -> Any:
    if value is None and about.normal and about.kind is DIRECTION:
        return NORMAL
    if value is None or isinstance(value, str) or callable(value):
        return value
    if about.kind is POINTS and isinstance(value, Mapping):
        made = {name: _padded(point, about) for name, point in value.items()}
        return MappingProxyType(made) if any(made[name] is not point for name, point in value.items()) else value
    if about.kind is TENSOR and is_numeric(value, ()):
        third = float(value)  # of a lamina, which has the least moments about axes in its plane that a body can have
        return ((third / 2, 0.0, 0.0), (0.0, third / 2, 0.0), (0.0, 0.0, third))
    return _padded(value, about) if about.kind in (*INSIDE, DIRECTION) else value


def in_file(item: Item) -> Item:
    """A thing of a planar mechanism as one declares it: two numbers a vector, one a moment; itself where that would say less."""
    short = _shortened(item)
    back = pair_in_plane(short) if isinstance(short, Pair) else in_space(short)
    return short if back == item else item


def _shortened(item: Item) -> Item:
    changes = {name: _short(getattr(item, name), about) for name, about in item.formats.items()}
    if changes.get("second") is not None and same(
        getattr(item, "second", None), filled_second(getattr(item, "axis", None))
    ):
        changes["second"] = None
    return item.replace(**changes)


def _short(value: Any, about: FieldFormat) -> Any:
    if isinstance(value, Mapping) and about.kind is POINTS:
        return {name: _short(point, replace(about, kind=POINT)) for name, point in value.items()}
    array = real_array(value) if about.kind in (*INSIDE, DIRECTION, TENSOR) else None
    if array is None or array.shape[-1:] != (3,):
        return _shortened(value) if isinstance(value, Marker) else value
    if about.kind is TENSOR:
        return float(array[2, 2])
    if about.kind is DIRECTION and array.tolist() == list(NORMAL):
        return None
    return plain(array[..., 2] if about.normal else array[..., :2])


def _padded(value: Any, about: FieldFormat) -> Any:
    """A vector with a third number 0, a moment as one along z; a third number that is rounding is made 0."""
    array = real_array(value)
    if array is None:
        return value
    if about.normal and about.kind is not DIRECTION:
        if array.ndim == 0 or array.shape[-1:] == (1,):
            one = array.reshape(*array.shape[:-1], 1)
            return plain(np.concatenate([np.zeros((*one.shape[:-1], 2)), one], axis=-1))
    elif array.ndim and array.shape[-1] == 2:
        return plain(np.concatenate([array, np.zeros((*array.shape[:-1], 1))], axis=-1))
    if array.ndim and array.shape[-1] == 3 and about.kind is not DIRECTION:
        off = array[..., :2] if about.normal else array[..., 2:]
        if off.any() and (np.abs(off) <= ROUNDING * np.abs(array).max(axis=-1, keepdims=True)).all():
            return plain(array * ((0, 0, 1) if about.normal else (1, 1, 0)) + 0.0)
    return value


def is_flat(item: Any) -> bool:
    """Whether a link or pair of a planar mechanism is seen at once to be as it should; False where it takes a closer look."""
    if type(item) is Pair:
        if item.on_a is not None or item.contact is not None or item.says_more or not isinstance(item.type, PairType):
            return False
        p, z, x, normal = item.point, item.axis, item.second, item.type.normal
        if not all(type(v) is tuple and len(v) == 3 for v in (p, z, x)) or p[2]:
            return False
        return bool(not (z[0] or z[1]) if normal == 2 else normal == 0 and not (z[2] or x[0] or x[1]))
    if type(item) is Link:
        c, tensor = item.center, item.inertia
        if item.points is not NO_POINTS or not (c is None or (type(c) is tuple and len(c) == 3 and not c[2])):
            return False
        if tensor is None:
            return True
        rows = (
            type(tensor) is tuple and len(tensor) == 3 and all(type(row) is tuple and len(row) == 3 for row in tensor)
        )
        return rows and not (tensor[0][2] or tensor[1][2])
    return False


def pair_in_plane(pair: Any) -> Any:
    """A pair with its row in the plane, and the normal of the plane where its marker says none; itself where it has none there."""
    if not isinstance(pair, Pair) or is_flat(pair):
        return pair
    pair = in_space(pair)
    spatial = spatial_row(pair.type)
    row = in_plane(spatial) if isinstance(spatial, PairType) else None
    if row is None:
        return pair
    if pair.contact is None and row.normal is not None:
        changes: dict[str, Any] = {}
        if pair.on_a is not None or pair.on_b is not None:
            for side in ("on_a", "on_b"):
                if isinstance(marker := getattr(pair, side), Marker):
                    changes[side] = marker.replace(**_normal_said(marker, row.normal))
        elif pair.point is not None or pair.axis is not None:
            changes = _normal_said(pair, row.normal)
        if any(not same(getattr(pair, name), value) for name, value in changes.items()):
            pair = pair.replace(**changes)
    if pair.type is row:
        return pair
    out = copy(pair)
    object.__setattr__(out, "type", row)
    return out


def _normal_said(marker: Any, normal: int) -> dict[str, Any]:
    """The axis and second direction of a marker with the normal of the plane where that is left out."""
    axis, second = marker.axis, marker.second
    if normal == 2:
        if axis is None:
            return {"axis": NORMAL, "second": filled_second(NORMAL) if second is None else second}
        if is_numeric(axis, (3,)) and _along_normal(axis):
            exact = (0.0, 0.0, float(axis[2]))
            return {"axis": exact, "second": filled_second(exact) if same(second, filled_second(axis)) else second}
        return {}
    if not is_numeric(axis, (3,)) or _along_normal(axis):
        return {}
    if second is None or same(second, filled_second(axis)):
        second = NORMAL
    elif is_numeric(second, (3,)) and _along_normal(second):
        second = (0.0, 0.0, float(second[2]))
    flat = abs(axis[2]) <= ROUNDING * max(map(abs, axis))
    return {"axis": (float(axis[0]), float(axis[1]), 0.0) if flat else axis, "second": second}


def _along_normal(direction: Any) -> bool:
    return bool(max(abs(direction[0]), abs(direction[1])) <= ROUNDING * abs(direction[2]))


def spatial_row(row: Any) -> Any:
    """The row of a pair type in space; what is no row of the plane stays."""
    return row.spatial if isinstance(row, PairType) and row.spatial is not None else row


def pair_in_space(pair: Any) -> Any:
    """A pair of a planar mechanism as one of a spatial one."""
    if not isinstance(pair, Pair) or not isinstance(pair.type, PairType) or pair.type.normal is None:
        return pair
    out = copy(pair)
    object.__setattr__(out, "type", pair.type.spatial)
    return out


def dropped(item: Item) -> tuple[Item, list[str]]:
    """A declared thing without what leaves the plane, and what that was."""
    changes: dict[str, Any] = {}
    lost: list[str] = []
    label = str(getattr(item, "name", "") or getattr(item, "kind", ""))
    for name, about in item.formats.items():
        value = getattr(item, name)
        if isinstance(value, Described):
            changes[name], more = dropped(value)
            lost += [f"{label} {what}" for what in more]
        elif about.kind is POINTS and isinstance(value, Mapping):
            out = {key: point for key, point in value.items() if _leaves(point, about)}
            lost += [f"{label} {name} {key}: z = {point[2]:.4g}" for key, point in out.items()]
            changes[name] = {**value, **{key: (point[0], point[1], 0.0) for key, point in out.items()}}
        elif _leaves(value, about):
            flat = np.array(value, dtype=float)
            if about.kind is TENSOR:
                flat[:2, 2] = flat[2, :2] = 0.0
                what = "products of inertia with z"
            elif about.normal:
                flat[..., :2], what = 0.0, "about x and y"
            else:
                flat[..., 2], what = 0.0, "along z"
            if about.kind is POINT or about.kind is NAMED_POINT:
                what = f"z = {value[2]:.4g}"
            lost.append(f"{label} {name} {what}")
            changes[name] = plain(flat)
    return item.replace(**changes) if changes else item, lost


def lifted(item: Item, height: float, only: str = "") -> Item:
    """A declared thing with its points (or one of them) moved along z."""

    def change(name: str, about: FieldFormat, value: Any) -> Any:
        if not height or value is None or isinstance(value, str) or (only and name != only):
            return value
        if about.kind is POINTS:
            return {key: (x, y, z + height) for key, (x, y, z) in value.items()}
        return (value[0], value[1], value[2] + height) if about.kind in (POINT, NAMED_POINT) else value

    return item.changed(change, as_it_is)


# --- faults ----------------------------------------------------------------------------------------------------------------

DROPPED = "m.to_planar() of the spatial mechanism drops it"


def plane_faults(
    links: Iterable[Any], pairs: Iterable[Any], loads: Iterable[Any], gears: Iterable[Any] = ()
) -> list[str]:
    """What leaves the plane, one line each."""
    found: list[str] = []
    for link in links:
        if isinstance(link, Described) and not is_flat(link):
            found += _leaving(link, f"link {shown(getattr(link, 'name', ''))}: ")
    for pair in pairs:
        if isinstance(pair, Pair) and isinstance(pair.type, PairType) and not is_flat(pair):
            found += _pair_faults(pair)
    for gear in gears:
        if isinstance(gear, Described):
            where = f"{getattr(gear, 'kind', 'gear')} {shown(getattr(gear, 'name', ''))}: "
            if "axis" in gear.formats and not gear.formats["axis"].normal:
                found.append(f"{where}meshes across the plane; expected Gear, GearRack or Pulley in a planar mechanism")
            else:
                found += _leaving(gear, where)
    for load in loads:
        if isinstance(load, Described):
            found += _leaving(load, getattr(load, "where", ""))
    return found


def _leaving(item: Described, where: str) -> Iterator[str]:
    """Vectors, moments and tensors of a thing that leave the plane."""
    for name, about in item.formats.items():
        value = getattr(item, name)
        if isinstance(value, Described):
            yield from _leaving(value, f"{where}{name}.")
        elif about.kind is POINTS and isinstance(value, Mapping):
            for key, point in value.items():
                if _leaves(point, about):
                    yield f"{where}{name}: {key} = {shown(point)}: {_third(about)}"
        elif _leaves(value, about):
            yield f"{where}{name} = {shown(value)}: {_third(about)}"


def _leaves(value: Any, about: FieldFormat) -> bool:
    if value is None or isinstance(value, str) or callable(value):
        return False
    array = real_array(value)
    if array is None:
        return False
    if about.kind is TENSOR:
        return array.shape == (3, 3) and bool(np.abs(array[:2, 2]).max() > ROUNDING * np.abs(array).max())
    direction = about.kind is DIRECTION and about.normal
    if not (direction or about.kind in (*INSIDE, POINTS)) or array.ndim == 0 or array.shape[-1] != 3:
        return False
    return bool(array[..., :2].any() if about.normal else array[..., 2].any())


def _third(about: FieldFormat) -> str:
    if about.kind is TENSOR:
        return f"products of inertia with z leave the plane; expected 0, or a number, the moment of inertia about z ({DROPPED})"
    if about.kind is DIRECTION:
        return "expected an axis that stands on the x-y plane; leave it out"
    if about.normal:
        return f"turns out of the plane; expected a number, the moment about z ({DROPPED})"
    return f"leaves the plane; expected z = 0, or two numbers ({DROPPED})"


def _pair_faults(pair: Pair) -> Iterator[str]:
    """What of a pair leaves the plane: its type, its marker, its curves."""
    where, row = f"pair {shown(pair.name)}: ", pair.type
    yield from _leaving(pair, where)
    for name, curve in (("curve", pair.curve), ("curve_b", pair.curve_b)):
        if curve is not None and pair.contact is not None and (off := _off_plane(pair, curve)):
            yield f"{where}{name}: leaves the x-y plane, by {off:.3g}; give a curve in it"
    sides = [pair] if pair.on_a is None else [pair.on_a, pair.on_b]
    markers = [side for side in sides if side is not None and _placed(side)]
    axes = axes_of(markers[0].axis, markers[0].second) if markers else np.eye(3)
    if row.normal is None:
        yield where + _not_planar(row, axes)
        return
    for side in markers:
        frame = axes_of(side.axis, side.second)
        if abs(abs(frame[2, row.normal]) - 1.0) > ROUNDING:
            name, stands, hint = MARKERS[row.normal], "stands on the x-y plane", "leave it out"
            if row.normal == 0 and abs(frame[2, 2]) > ROUNDING:
                name, stands, hint = "axis", "lies in the x-y plane", "give two numbers, axis=(x, y)"
            elif row.normal == 2 and abs(frame[2, 2]) <= ROUNDING:
                other = instead_of(row.spatial or row, frame)
                hint += f", or take {other}, which holds the same in the plane" if other != row.symbol else ""
            given = getattr(side, name, side.axis)
            yield f"{where}{name} = {shown(given)}: in a planar mechanism the {name} of {row.symbol} {stands}; {hint}"
            return


def _placed(side: Any) -> bool:
    if not isinstance(side, Pair | Marker):
        return False
    return is_numeric(side.axis, (3,)) and is_numeric(side.second, (3,)) and not _parallel(side)


def _parallel(side: Any) -> bool:
    return bool(np.linalg.norm(np.cross(side.axis, side.second)) <= ROUNDING)


def _not_planar(row: PairType, axes: Array) -> str:
    """Why a type has no row in the plane, and the one to take."""
    leaving = reach_of(row.freedoms, axes)
    why = f"can leave the plane ({', '.join(leaving)})" if leaving else "holds nothing in the plane"
    return f"{row.symbol} {why}; in a planar mechanism take {instead_of(row, axes)}, which holds the same in the plane"


def _off_plane(pair: Pair, curve: Any) -> float:
    """How far a curve leaves the plane, or the direction of one that stands in it; 0 for rounding."""
    from mechgraph.pairs.curves import Travel

    travel: Travel = curve.once(Travel)
    points = travel.at(travel.s).x
    size = max(1e-300, float(np.abs(points).max()), float(np.ptp(points)))
    off = float(np.abs(points[2]).max())
    return off if off > 1e-9 * size else 0.0


def refuse(m: Any, what: str) -> None:
    """Refuse what a planar mechanism has not.

    Raises
    ------
    DeclarationError
        for a planar one.
    """
    if m.planar:
        raise DeclarationError(
            f"mechanism {m.name!r}", [f"{what} is not known for planar mechanisms; ask m.to_spatial()"]
        )


# --- rows of pairs in the plane ---------------------------------------------------------------------------------------------

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
    x = tried_coordinates(row)
    pitch = np.zeros((1, 1))
    frames = evaluation.frames_of(row, pitch, x)
    parts = (evaluation.twists_of, evaluation.efforts_of, evaluation.reactions_of)
    S, E, W = (part(row, pitch, frames, x) for part in parts)
    outside = np.delete(np.arange(6), _rows_of(row.normal))
    size = max(1.0, float(np.abs(S).max(initial=0.0)))
    leaves = max(float(np.abs(part[outside]).max(initial=0.0)) for part in (S, E, W))
    work = float(np.abs(np.einsum("ifnt,icnt->fcnt", S, W)).max(initial=0.0))
    return max(leaves, work) <= CLEAR * size


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
