"""Prescribed motions: of drivers, of points and of links.

Prescribed motion of points and links: free pairs between the frame and a link, whose coordinates are driven like any others.

A free pair has six freedoms and transmits nothing, so that it changes neither motion nor forces; its loop adds as many equations as
unknowns. Its slides are the coordinates of a point, its turns three angles of a link.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from itertools import combinations, product
from math import prod
from typing import Any, NamedTuple

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Mask, homogeneous, rotation_log
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.plane import pair_in_plane
from mechgraph.pairs.factors import UNIT_TWISTS, Freedom
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.quantities import has_quantity, is_numeric, items_of

SLIDES, TURNS = ("Tx", "Ty", "Tz"), ("Rx", "Ry", "Rz")
PART = re.compile(r"(?P<point>.+)\.(?P<part>Tx|Ty|Tz|T\([^()]*\))")


class Target(NamedTuple):
    """What a name stands for that is no freedom: a link or (``point``) one of its points, all of it or (``part``) one coordinate."""

    link: str
    point: str
    part: str

    @property
    def turns(self) -> bool:
        """Whether it is an angle."""
        return self.part in TURNS

    @property
    def owner(self) -> str:
        """``bucket.tip`` or ``bucket``."""
        return f"{self.link}.{self.point}" if self.point else self.link


def target_of(m: Mechanism, name: str) -> Target | str:
    """The point, link or coordinate of these that a name stands for, or why there is none."""
    for link in m.links:
        if name != link.name and not name.startswith(f"{link.name}."):
            continue
        if link.name == m.frame:
            return f"{name!r} is on the frame, which does not move"
        rest = name.removeprefix(link.name).removeprefix(".")
        found, (slides, turns) = PART.fullmatch(rest), parts_of(m)
        if rest in ("", *slides, *turns):
            return Target(link.name, "", rest)
        if rest in link.points:
            return Target(link.name, rest, "")
        if found and found["point"] in link.points:
            target = Target(link.name, found["point"], found["part"])
            fits = direction_of(m, target.part) is not None
            return target if fits else (_OUT_OF_PLANE if m.planar else _NO_DIRECTION).format(name)
        if m.freedom_fault(rest, single=False) is not None:
            point = found["point"] if found else rest
            return f"{link.point_fault(point)}; of a link itself {', '.join((*slides, *turns))} can be given"
    return str(m.freedom_fault(name, single=True))


_NO_DIRECTION = "{!r}: expected a direction as in T(1,0,1)"
_OUT_OF_PLANE = "{!r}: expected Tx, Ty or a direction in the plane as in T(1,1)"


def parts_of(m: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the slides and turns that a link has."""
    return (SLIDES[:2], TURNS[2:]) if m.planar else (SLIDES, TURNS)


def coordinate(m: Mechanism, name: str) -> bool | str:
    """Whether what a name stands for, a freedom or a coordinate of a point or link, is an angle; or why it is no such."""
    fault = m.freedom_fault(name, single=True)
    if fault is None:
        return m.turns(name)
    target = target_of(m, name)
    if isinstance(target, str):
        return target
    if target.part:
        return target.turns
    slides, turns = parts_of(m)
    parts = slides if target.point else (*slides, *turns)
    return f"{name!r} has several coordinates; give one or more of {', '.join(f'{name}.{part}' for part in parts)}"


def direction_of(m: Mechanism, part: str) -> Array | None:
    """Unit vector of a slide, ``Tx`` or ``T(1,0,1)``, in a plane also of ``T(1,1)``; None where it is none, or leaves the plane."""
    try:
        d = np.eye(3)[SLIDES.index(part)] if part in SLIDES else np.array([float(v) for v in part[2:-1].split(",")])
    except ValueError:
        return None
    if m.planar:
        d = np.append(d, 0.0) if d.shape == (2,) else d
        if d[2:].any():
            return None
    return d / np.linalg.norm(d) if is_numeric(d, (3,)) and d.any() else None


# --- free pairs --------------------------------------------------------------------------------------------------------


@cache
def _of_points() -> PairType:
    return PairType("free_point", freedoms=[*SLIDES, "rotation"], reactions=())


def coordinates(pair: Pair, poses: Array) -> Array:
    """Coordinates ``(6, ...)`` (in a plane 3) of a free pair for poses ``(..., 4, 4)`` of its link; angles continued along the last."""
    A, B = (homogeneous(marker.pose()[..., None])[..., 0] for marker in pair.markers)
    D = np.linalg.inv(A) @ poses @ B
    R = D[..., :3, :3]
    if pair.type.normal is not None:
        angle = np.arctan2(R[..., 1, 0], R[..., 0, 0])
        return np.stack([D[..., 0, 3], D[..., 1, 3], np.unwrap(angle, axis=-1) if angle.ndim else angle])
    if not pair.type.drivable[-1]:
        turned = rotation_log(np.moveaxis(R, (-2, -1), (0, 1)).reshape(3, 3, -1)).reshape(3, *R.shape[:-2])
    else:
        axes = _axes(pair)
        M = axes.T @ R @ axes
        turned = np.array(
            [
                np.arctan2(-M[..., 1, 2], M[..., 2, 2]),
                np.arcsin(np.clip(M[..., 0, 2], -1.0, 1.0)),
                np.arctan2(-M[..., 0, 1], M[..., 0, 0]),
            ]
        )
        turned = np.unwrap(turned, axis=-1) if turned.ndim > 1 else turned
    return np.concatenate([np.moveaxis(D[..., :3, 3], -1, 0), turned])


def _placed(pair: Pair, m: Mechanism) -> Pair:
    """A free pair at the point for which it was made, where that is in a mechanism: variants may have it elsewhere."""
    own, start = m.link(pair.b).points, f"{pair.b}."
    name = pair.name.removeprefix(start).rstrip("'") if pair.name.startswith(start) else ""
    at = own.get(name)
    return pair if at is None else pair.replace(on_b=Marker(at, pair.markers[1].axis, pair.markers[1].second))


def _axes(pair: Pair) -> Array:
    """The axes of the three turns of a free pair as columns."""
    return np.array([freedom.twist[:3] for freedom in pair.type.freedoms[3:]]).T


# --- motions -----------------------------------------------------------------------------------------------------------


@dataclass
class Prescription:
    """What a call prescribes of points and links: ``free`` pairs and the motions of their freedoms; faults are collected.

    ``known`` are free pairs that were made before, and motions of their freedoms are taken as they are.
    """

    m: Mechanism
    faults: list[str]
    known: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        self.free: dict[str, Pair] = {pair.name: _placed(pair, self.m) for pair in self.known}
        self.motions: dict[str, Motion] = {}

    def add(self, name: str, value: Any) -> None:
        """Take up the motion of a point, a link or one coordinate of these."""
        if any(name in pair.freedom_names for pair in self.known):
            self.motions[name] = value
            return
        target = target_of(self.m, name)
        if isinstance(target, str):
            self.faults.append(f"motion of {name!r}: {target}")
            return
        try:
            motion = value if isinstance(value, Motion) else Motion(value)
            motion = (
                motion
                if not target.point and not target.part
                else motion.without_quantities(self.m.units, target.turns)
            )
        except DeclarationError as error:
            self.faults += [f"motion of {name!r}: {fault}" for fault in error.faults]
            return
        if target.part:
            self.faults += motion.faults(f"motion of {name!r}: ")
            self._put(name, self._pair_of(target), target.part, motion)
            return
        shape, what = ((3,), "points (..., 3)") if target.point else ((4, 4), "poses (..., 4, 4)")
        P, *rest = given = self._in_space(motion.given) if target.point else motion.given
        if any(map(has_quantity, motion.given)) or np.shape(P)[-len(shape) :] != shape:
            self.faults.append(
                f"motion of {name!r}: expected {what}, plain numbers, got an array of shape {np.shape(P)}"
            )
        elif self.m.planar:
            self._in_plane(name, target, given)
        elif target.point:
            self._components(name, self._pair_of(target), SLIDES, given)
        else:
            self._pose(name, target, np.asarray(P), *rest)

    def _in_space(self, given: Sequence[Any]) -> Sequence[Any]:
        """Position, velocity and acceleration of a point, given in the plane with two numbers, with three."""
        *vectors, t = given
        if not self.m.planar or np.shape(vectors[0])[-1:] != (2,):
            return given
        return (
            *(v if v is None else np.concatenate([v, np.zeros((*np.shape(v)[:-1], 1))], axis=-1) for v in vectors),
            t,
        )

    def _in_plane(self, name: str, target: Target, given: Sequence[Any]) -> None:
        """Motions of a point or a link of a planar mechanism: of x and y, and of the angle."""
        *vectors, t = given
        P = np.asarray(vectors[0])
        leaves = (
            np.abs(P[..., 2]).max(initial=0.0) if target.point else np.abs(P[..., 2, :] - (0, 0, 1, 0)).max(initial=0.0)
        )
        if leaves > 1e-9 * max(1.0, float(np.abs(P).max(initial=0.0))):
            self.faults.append(f"motion of {name!r}: leaves the x-y plane, by {leaves:.3g}")
            return
        pair = self._pair_of(target)
        if target.point:
            self._components(
                name, pair, SLIDES[:2], (*(v if v is None else np.asarray(v)[..., :2] for v in vectors), t)
            )
            return
        q, (twist, change) = np.moveaxis(coordinates(pair, P), 0, -1), vectors[1:]
        if change is not None and twist is None:
            self.faults.append(f"motion of {name!r}: has an acceleration and no velocity; give both")
            return
        rates: list[Any] = [None, None]
        if twist is not None:
            V = np.broadcast_to(twist, (*q.shape[:-1], 6))
            A = np.broadcast_to(0.0 if change is None else change, V.shape)
            w, along = V[..., 2:3], q[..., :2]
            across = np.stack([-q[..., 1], q[..., 0]], axis=-1)
            rates[0] = np.concatenate([V[..., 3:5] + w * across, w], axis=-1)
            if change is not None or t is None:
                turned = np.stack([-rates[0][..., 1], rates[0][..., 0]], axis=-1)
                bend = A[..., 3:5] + A[..., 2:3] * across + w * turned if change is not None else np.zeros(along.shape)
                rates[1] = np.concatenate([bend, A[..., 2:3]], axis=-1)
        self._components(name, pair, (*SLIDES[:2], TURNS[2]), (q, *rates, t))

    def _put(self, name: str, pair: Pair, part: str, motion: Motion) -> None:
        full = f"{pair.name}.{part}"
        if full in self.motions:
            self.faults.append(f"motion of {name!r}: {full} is given twice")
        self.motions[full] = motion

    def _pair_of(self, target: Target) -> Pair:
        """The free pair that has a coordinate; every line has one of its own."""
        if not target.part.startswith("T("):
            return self._made(target.owner, target, _of_points if target.point else lambda: TABLE["Fr"])
        d = direction_of(self.m, target.part)
        assert d is not None
        across = np.array([-d[1], d[0], 0.0]) if self.m.planar else np.linalg.svd(d[None])[2][1]

        def row() -> PairType:
            units = zip((target.part, "across", "beside"), SLIDES, strict=True)
            slides = [Freedom(name, UNIT_TWISTS[slide]) for name, slide in units]
            return PairType(f"free_line{len(self.free)}", freedoms=[*slides, "rotation"], reactions=())

        return self._made(
            f"{target.owner}.{target.part}", target, row, on_a=np.stack([d, across, np.cross(d, across)], axis=1)
        )

    def _made(
        self,
        key: str,
        target: Target,
        row: Callable[[], PairType],
        on_a: Array | None = None,
        on_b: Array | None = None,
    ) -> Pair:
        """The free pair of that key; the columns of ``on_a, on_b`` are the directions of its markers on the frame and on the link."""
        if key not in self.free:
            A, B = (np.eye(3) if frame is None else frame for frame in (on_a, on_b))
            name, taken = target.owner, {*self.m.pair_index, *(pair.name for pair in self.free.values())}
            while name in taken:
                name += "'"
            point = self.m.link(target.link).points[target.point] if target.point else (0.0, 0.0, 0.0)
            markers = Marker((0.0, 0.0, 0.0), A[:, 2], A[:, 0]), Marker(point, B[:, 2], B[:, 0])
            pair = Pair(name, row(), self.m.frame, target.link, on_a=markers[0], on_b=markers[1])
            self.free[key] = pair_in_plane(pair) if self.m.planar else pair
        return self.free[key]

    def _components(self, name: str, pair: Pair, parts: Sequence[str], given: Sequence[Any]) -> None:
        """Motions of the components of vectors: position, velocity, acceleration ``(..., n)`` and times ``(...)``."""
        *vectors, t = given
        n = len(parts)
        if t is not None and np.ndim(t) == np.ndim(vectors[0]) and np.shape(t)[-1] == 1:
            t = np.asarray(t)[..., 0]
        try:
            whole = [None if v is None else np.broadcast_to(v, np.broadcast_shapes(np.shape(v), (n,))) for v in vectors]
            for i, part in enumerate(parts):
                position, velocity, acceleration = (None if v is None else v[..., i] for v in whole)
                self._put(name, pair, part, Motion(position, velocity, acceleration, t))  # type: ignore[arg-type]
        except (DeclarationError, ValueError) as error:
            faults = error.faults if isinstance(error, DeclarationError) else [str(error)]
            self.faults += [f"motion of {name!r}: {fault}" for fault in faults]

    def _pose(self, name: str, target: Target, poses: Array, twist: Any, change: Any, t: Any) -> None:
        """Motions of a link's coordinates for its poses, its twist about the global origin and that one's rate."""
        R = poses[..., :3, :3]
        first: Array | None = None
        chart: Array | None = None
        if not is_pose(poses).all():
            fault = "expected poses with a proper rotation and the last row 0 0 0 1"
        elif change is not None and twist is None:
            fault = "has an acceleration and no velocity; give both"
        elif name in self.free:
            fault = f"{name} is given twice"
        # within 1.3 of the global directions poses are described by turns about x, the new y and the new z, as ``"arm.Rx"`` is
        elif (np.trace(R, axis1=-2, axis2=-1) > 1.0 + 2.0 * np.cos(1.3)).all():
            chart = np.eye(3)
        else:
            chart, first = _chart(R.reshape(-1, 3, 3)), R.reshape(-1, 3, 3)[0].T
            fault = "no three successive turns describe all its poses well; prescribe them in several calls"
        if chart is None:
            self.faults.append(f"motion of {name!r}: {fault}")
            return
        turns = [Freedom(n, (*axis, 0.0, 0.0, 0.0)) for n, axis in zip(TURNS, chart.T.tolist(), strict=True)]

        def row() -> PairType:
            return PairType(f"free_pose{len(self.free)}", freedoms=[*SLIDES, *turns], reactions=())

        pair = self._made(name, target, row, on_b=first)
        q = coordinates(pair, poses)
        rates = (None, None) if twist is None else _rates(pair, q, twist, change, at_rest=t is None)
        self._components(name, pair, (*SLIDES, *TURNS), (np.moveaxis(q, 0, -1), *rates, t))


def _chart(R: Array) -> Array | None:
    """Axes (columns) of three successive turns, right-handed, that stay farthest from their singular place over rotations ``(T, 3, 3)``."""
    relative = R @ R[0].T
    ways = [v for v in product((1, 0, -1), repeat=3) if any(v) and next(filter(None, v)) > 0]
    axes = np.array(ways) / np.linalg.norm(ways, axis=1)[:, None]
    steep = np.abs(np.einsum("ai,tij,bj->tab", axes, relative, axes)).max(axis=0)
    square = [
        (a, b)
        for pair in combinations(range(len(axes)), 2)
        for a, b in (pair, pair[::-1])
        if abs(axes[a] @ axes[b]) < 1e-12
    ]
    a, b = min(square, key=lambda ab: (round(float(steep[ab]), 9), ab))
    # cosine between the first and the last axis of three successive turns from which on they do not describe a rotation well
    if steep[a, b] > 0.98:
        return None
    return np.stack([axes[a], np.cross(axes[b], axes[a]), axes[b]], axis=1)


def _rates(pair: Pair, q: Array, twist: Any, change: Any, *, at_rest: bool) -> tuple[Array, Array | None]:
    """Rates ``(..., 6)`` of the coordinates ``q (6, ...)`` of a link's free pair for its twist and that one's rate ``(..., 6)``.

    Point p of the link: ``p' = v + w x p``, ``p'' = v' + w' x p + w x p'``. Turns: ``w = A E theta'`` with the axes A and what the
    turns before them do, E; so ``theta'' = E^-1 (A^T w' - E' theta')``. Where ``change`` is left out: ``p'' = 0, w' = 0`` with
    ``at_rest``, else None.
    """
    V = np.broadcast_to(twist, (*q.shape[1:], 6))
    axes, p = _axes(pair), np.moveaxis(q[:3], 0, -1)
    (sa, ca), (sb, cb) = ((np.sin(angle), np.cos(angle)) for angle in q[3:5])
    o, one = np.zeros_like(sa), np.ones_like(sa)
    E = np.moveaxis(np.array([[one, o, sb], [o, ca, -sa * cb], [o, sa, ca * cb]]), (0, 1), (-2, -1))
    w, dp = V[..., :3], V[..., 3:] + np.cross(V[..., :3], p)
    turning = np.linalg.solve(E, (w @ axes)[..., None])
    first = np.concatenate([dp, turning[..., 0]], axis=-1)
    if change is None and not at_rest:
        return first, None
    dw = ddp = np.zeros_like(dp)
    if change is not None:
        A = np.broadcast_to(change, V.shape)
        dw, ddp = A[..., :3], A[..., 3:] + np.cross(A[..., :3], p) + np.cross(w, dp)
    da, db = turning[..., 0, 0], turning[..., 1, 0]
    dE = [[o, o, cb * db], [o, -sa * da, sa * sb * db - ca * cb * da], [o, ca * da, -sa * cb * da - ca * sb * db]]
    left = (dw @ axes)[..., None] - np.moveaxis(np.array(dE), (0, 1), (-2, -1)) @ turning
    return first, np.concatenate([ddp, np.linalg.solve(E, left)[..., 0]], axis=-1)


def obtained(m: Mechanism, name: str, X: Array, q: Array) -> Array:
    """A freedom, or a coordinate of a point or link (angles within half a turn), at poses ``X (n, N, 4, 4)`` of the links and
    coordinates ``q (n, F)``.
    """
    if m.freedom_fault(name, single=True) is None:
        return np.asarray(q[:, m.freedom_names().index(m.full_name(name))])
    given = Prescription(m, [])
    given.add(name, 0.0)
    (pair,), (full,) = given.free.values(), given.motions
    found = coordinates(pair, X[:, m.place_of_link(pair.b)])[pair.freedom_names.index(full)]
    return np.angle(np.exp(1j * found)) if full.endswith(TURNS) else np.asarray(found)


def of_platform(m: Mechanism) -> list[str]:
    """Coordinates of the link that most chains carry, three at least, where none of its own pairs stands on the frame; none elsewhere."""
    ends = [{pair.a, pair.b} for pair in m.pairs]
    count = {
        name: sum(name in of for of in ends) for name in m.link_names() if not any({name, m.frame} <= of for of in ends)
    }
    body = max(count, key=count.__getitem__, default="")
    return [f"{body}.{part}" for parts in parts_of(m) for part in parts] if count.get(body, 0) > 2 else []


def with_free_pairs(m: Mechanism, free: Sequence[Pair], names: Sequence[Any], poses: Array, q: Array) -> Mechanism:
    """The mechanism with free pairs behind its own and the drives ``names``, starting at coordinates ``q (F,)``, poses ``(N, 4, 4)``."""
    start = dict(zip(m.freedom_names(), q.tolist(), strict=True))
    for pair in free:
        at = coordinates(pair, poses[m.place_of_link(pair.b)])
        start |= dict(zip(pair.freedom_names, at.tolist(), strict=True))
    made = m.replace(pairs=[*m.pairs, *free], drives=names)
    # those of a free pair in space that the plane has not are zero there
    return made.replace(start={name: start[name] for name in made.freedom_names()})


def with_pairs_at(m: Mechanism, free: Sequence[Pair], names: Sequence[Any], start: Configuration) -> Mechanism:
    """The same in a closed position of the mechanism."""
    par, X = start.system.par, start.poses[:, :, :, 0]
    R = np.moveaxis(X[:, :3], -1, 0)
    poses = np.tile(np.eye(4), (len(R), 1, 1))
    poses[:, :3, :3] = R
    poses[:, :3, 3] = par.origin + par.L * X[:, 3].T - (R @ par.offset.T[:, :, None])[..., 0]
    q = start.system.coordinates_of(start.x, start.system.start_coordinates(m.start))[:, 0]
    return with_free_pairs(m, free, names, poses, q)


def _as_motion(m: Mechanism, value: Any, name: str, faults: list[str]) -> Motion | None:
    """A motion in the units of the mechanism; positions alone are at rest."""
    try:
        motion = (value if isinstance(value, Motion) else Motion(value)).without_quantities(m.units, m.turns(name))
        faults += motion.faults(f"motion of {name!r}: ")
        return motion
    except DeclarationError as error:
        faults += [f"drive {name!r}: {fault}" for fault in error.faults]
        return None


class Motions(dict[str, Motion]):
    """Motions by full name, with the ``free`` pairs of points and links whose coordinates are among them."""

    def __init__(self, motions: Mapping[str, Motion], free: Iterable[Pair] = ()) -> None:
        super().__init__(motions)
        self.free = tuple(free)


def driven(m: Mechanism, motions: Mapping[str, Any] | None, asked: str = "solve") -> tuple[Mechanism, Motions]:
    """The mechanism with its drives, and all motions by full name; ``asked`` is what errors name.

    Motions given by name go to the declared drives; the others use the motion stored with them. Where a name is no declared drive, the
    names given are the drives of this call, in place of the declared ones.
    """
    if motions is not None and not isinstance(motions, Mapping):
        raise DeclarationError(
            f"{asked} {m.name!r}",
            [f"motions = {type(motions).__name__}: expected a mapping driver -> motion, e.g. {{'A': angles}}"],
        )
    faults: list[str] = []
    spatial = Prescription(m, faults, motions.free if isinstance(motions, Motions) else ())
    given = {}
    for name, value in dict(motions or {}).items():
        why = m.freedom_fault(name, single=True)
        if why is None:
            given[name] = value
        elif isinstance(name, str):
            spatial.add(name, value)
        else:
            faults.append(f"motion of {name!r}: {why}")
    known = {m.full_name(d.freedom): d for d in m.drives}
    if spatial.motions or any(m.full_name(name) not in known for name in given):
        known = {m.full_name(name): Drive(name) for name in given}
        m = m.replace(drives=list(known.values()))
    out: dict[str, Motion] = {}
    for name, value in given.items():
        if m.full_name(name) in out:
            faults.append(f"motion of {name!r}: {m.full_name(name)} is given twice")
            continue
        motion = _as_motion(m, value, name, faults)
        if motion is not None:
            out[m.full_name(name)] = motion
    for name, drive in known.items():
        if name not in out and drive.motion is not None:
            out[name] = drive.motion
        elif name not in out and not faults:
            faults.append(f"drive {name!r} has no motion; give one: {{{name!r}: angles or mg.Motion(...)}}")
    if faults:
        raise DeclarationError(f"{asked} {m.name!r}", faults)
    return m, Motions({name: out[name] for name in known} | spatial.motions, spatial.free.values())


def _batch(m: Mechanism, motions: Mapping[str, Motion], asked: str) -> tuple[int, ...]:
    try:
        batch = np.broadcast_shapes(*(motion.shape for motion in motions.values()))
        if 0 in batch:
            raise DeclarationError(f"{asked} {m.name!r}", ["the motions have no positions; give at least one"])
        return batch
    except ValueError:
        shapes = ", ".join(f"{name} {motion.shape}" for name, motion in motions.items())
        raise DeclarationError(
            f"{asked} {m.name!r}", [f"the motions describe different numbers of positions: {shapes}"]
        ) from None


Actuators = str | Pair | Drive | Iterable[str | Pair | Drive]
"""Where actuators act: names of freedoms, or the pairs and drives that have them."""


def actuators(m: Mechanism, actuate: Actuators) -> tuple[str, ...]:
    """Full names of the freedoms in which the unknown efforts stand.

    Raises
    ------
    DeclarationError
    """
    faults: list[str] = []
    items = items_of([actuate] if isinstance(actuate, str | Pair | Drive) else actuate, "actuate", faults)
    given = [one.name if isinstance(one, Pair) else one.freedom if isinstance(one, Drive) else one for one in items]
    faults += [f"actuate {name!r}: {why}" for name in given if (why := m.freedom_fault(name, single=True))]
    names: tuple[str, ...] = ()
    if not faults:
        names = tuple(map(m.full_name, given))
        faults += [f"actuate: {name} is given twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    if faults:
        raise DeclarationError(f"solve {m.name!r}", faults)
    return names


def is_pose(X: Array) -> Mask:
    """Whether matrices ``(..., 4, 4)`` are poses: a proper rotation, and the last row 0 0 0 1."""
    R = X[..., :3, :3]
    # largest entry of ``R R^T - 1``; numbers that are not known are no fault of it
    turns = ~(np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-2, -1)) > 1e-6) & ~(np.linalg.det(R) < 0)
    return np.asarray(turns & (X[..., 3, :] == (0, 0, 0, 1)).all(axis=-1))


class DriverMotion:
    """The mechanism ``m`` with the drives of a call, the motion of each, and the shape of the batch of positions.

    ``actuated`` are the freedoms in which the unknown efforts stand; None: in those whose motion is prescribed.
    """

    def __init__(
        self, m: Mechanism, motions: Mapping[str, Any] | None, actuate: Actuators | None = None, asked: str = "solve"
    ) -> None:
        self.m, self.motions = driven(m, motions, asked)
        self.actuated = None if actuate is None else actuators(m, actuate)
        self.batch = _batch(self.m, self.motions, asked)
        self.t = next((motion.t for motion in self.motions.values() if motion.t is not None), None)
        self._values: dict[tuple[str, tuple[int, ...]], Array] = {}

    @property
    def free(self) -> tuple[Pair, ...]:
        """The free pairs of points and links whose motion is prescribed."""
        return self.motions.free

    @property
    def shown(self) -> Mechanism:
        """The mechanism that a solution shows: its drives are the freedoms that take the unknown efforts."""
        return self.m if self.actuated is None else self.m.replace(drives=self.actuated)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the driven freedoms."""
        return tuple(self.motions)

    @property
    def first(self) -> dict[str, float]:
        """Values of the freedoms of pairs at the first position."""
        own = {self.m.full_name(drive.freedom) for drive in self.m.drives}
        return {
            name: float(np.asarray(self.motions[name].position).reshape(-1)[0]) for name in self.motions if name in own
        }

    def whole(self, start: Configuration) -> Mechanism:
        """The mechanism with the free pairs behind its own, in a closed position."""
        return with_pairs_at(self.m, self.free, self.names, start)

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver ``position``, ``velocity`` or ``acceleration`` ``(d, T)`` in the user's units, spread over a batch."""
        if (kind, batch) not in self._values:
            T = prod(batch)
            rows = [np.broadcast_to(getattr(motion, kind), batch).reshape(T) for motion in self.motions.values()]
            self._values[kind, batch] = found = np.array(rows).reshape(len(rows), T)
            found.setflags(write=False)
        return self._values[kind, batch]
