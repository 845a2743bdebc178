"""Gears, racks, worms and pulleys as they are drawn: pitch circles, involute teeth that interleave, belts around pulleys.

A tooth at the radius r has half the angle ``psi(r) = pi / (2 z) + 2 x tan a / z + inv a_t - inv a_r``, ``cos a_r = r_b / r``, with the base
radius r_b and ``inv a = tan a - a``. Inside a ring the same holds for the spaces.

Source: Litvin and Fuentes, Gear Geometry and Applied Theory, 2004, chapter 10.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive, course
from mechgraph.model.gears import BevelGear, Gear, GearRack, Pulley, Worm, WormWheel
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Mesh, Meshing
from mechgraph.model.short_forms import Belt
from mechgraph.show.shapes import Shape, polyline

TIP, ROOT, RIM = 1.0, 1.25, 1.6
"""Heights of teeth over and below the pitch line, and thickness of what bears them, over the module."""
FLANK, AROUND, ARC, TEETH_IN_A_ROW = 5, 64, 25, 24
"""Points along a flank, around a circle, and along a belt on a pulley; teeth of a rack that are drawn."""
READABLE = 8.0
"""Pixels from which on a tooth is drawn as one."""


@dataclass(frozen=True)
class Wheel:
    """Teeth, or the groove of a pulley (``teeth`` 0), on a link.

    ``axes (3, 3)``: the direction of the first tooth, one at right angles, and the axis, as columns, in the link's frame; of a rack the
    direction of its teeth, that in which they point, and across. ``phase``: by what part of a tooth the first one is off. ``radius``: of
    the pitch circle; infinite of a rack. ``cone``: half the angle of the pitch cone. ``length``: of a rack or worm. ``marked``: whether the
    first tooth is declared to be where it is.
    """

    name: str
    link: str
    at: Array
    axes: Array
    teeth: float
    radius: float
    module: float
    pressure: float = float(np.deg2rad(20.0))
    helix: float = 0.0
    shift: float = 0.0
    internal: bool = False
    width: float = 0.0
    cone: float = 0.0
    length: float = 0.0
    phase: float = 0.0
    marked: bool = False

    @property
    def is_rack(self) -> bool:
        """Whether its teeth lie in a row."""
        return bool(np.isinf(self.radius))

    @property
    def is_worm(self) -> bool:
        """Whether its teeth wind around it."""
        return abs(self.helix) > np.pi / 4 and not self.cone

    @property
    def outer(self) -> float:
        """The greatest radius of what is drawn."""
        if not self.teeth:
            return self.radius
        return self.radius + self.module * (ROOT + RIM if self.internal else TIP + self.shift)

    def count(self, at: Array) -> Array:
        """Which tooth is at points ``(..., 3)`` of the link, as a real number that grows about the axis; whole in the middle of teeth."""
        x, y, z = np.moveaxis((np.asarray(at) - self.at) @ self.axes, -1, 0)
        if self.is_rack:
            return np.asarray((x - z * np.tan(self.helix)) / (np.pi * self.module) - self.phase)
        return np.asarray(
            self.teeth * (np.arctan2(y, x) - z * np.tan(self.helix) / self.radius) / (2 * np.pi) - self.phase
        )

    def extent(self) -> Array:
        """Points that show where it is, in the link's frame."""
        if self.is_rack:
            return np.array([self.at + s * self.length / 2 * self.axes[:, 0] for s in (-1.0, 1.0)])
        return _circle(self.outer) @ self.axes.T + self.at

    # --- shapes --------------------------------------------------------------------------------------------------------

    def flank(self) -> tuple[Array, Array]:
        """Half the thickness of a tooth, over the pitch, and heights over the pitch line, from root to tip."""
        m, x = self.module, self.shift
        tip, root = (1.0 - x, -ROOT - x) if self.internal else (1.0 + x, -ROOT + x)
        if self.is_rack:
            h = np.linspace(-ROOT * m, TIP * m, FLANK)
            return 0.25 - h * np.tan(self.pressure) / (np.pi * m), h
        sign = -1.0 if self.internal else 1.0
        transverse = np.arctan(np.tan(self.pressure) / np.cos(self.helix))
        base = self.radius * np.cos(transverse)
        low, high = self.radius + sign * root * m, self.radius + sign * tip * m
        r = (
            np.linspace(max(low, base), max(high, base), FLANK)
            if sign > 0
            else np.linspace(low, max(high, base), FLANK)
        )
        angle = np.arccos(np.clip(base / r, -1.0, 1.0))
        inv = np.tan(transverse) - transverse - (np.tan(angle) - angle)
        half = 0.25 + (2.0 * x * np.tan(self.pressure) + self.teeth * inv) / (2 * np.pi)
        if self.internal:
            half = 0.5 - half
        if low < base and sign > 0:
            half, r = np.append(half[0], half), np.append(low, r)
        return np.clip(half, 0.02, 0.48), r - self.radius

    def place(self, u: Array, h: Array, s: float) -> Array:
        """Points ``(n, 3)`` of the link at places ``u`` along the pitch line, in teeth, heights over it, and ``s`` across."""
        if self.is_rack:
            local = np.stack(
                [np.pi * self.module * (u + self.phase) + s * np.tan(self.helix), h + 0 * u, s + 0 * u], axis=-1
            )
        else:
            turn = 2 * np.pi * (u + self.phase) / max(self.teeth, 1.0)
            rho, z, more = self.radius + h, s + 0 * u, s * np.tan(self.helix) / self.radius
            if self.cone:
                apex = -self.radius / np.tan(self.cone)
                scale = 1.0 + s * np.sin(self.cone) / self.radius
                rho = scale * (self.radius + h * np.cos(self.cone))
                z = apex + scale * (-h * np.sin(self.cone) - apex) + 0 * u
                more = np.tan(self.helix) * np.log(scale) / np.sin(self.cone)
            local = np.stack([rho * np.cos(turn + more), rho * np.sin(turn + more), z], axis=-1)
        return np.asarray(local @ self.axes.T + self.at)

    def _levels(self, flat: bool) -> tuple[float, ...]:
        """Where across the face it is cut: in the middle alone of a plane drawing."""
        if flat:
            return (0.0,)
        width = self.width or min(
            6.0 * self.module if self.teeth else 0.25 * self.radius, 0.6 * min(self.radius, self.length or np.inf)
        )
        return (-width, 0.0) if self.cone else (-width / 2, width / 2)

    def toothed(self, flat: bool) -> Shape:
        """Its teeth on their body, with the outline as a line where it is flat."""
        if self.is_worm:
            return self._thread()
        half, h = self.flank()
        n = len(half)
        if self.is_rack:
            first = np.ceil(-self.length / (2 * np.pi * self.module) - self.phase)
            k = first + np.arange(max(int(self.length / (np.pi * self.module)), 1))
        else:
            k = np.arange(int(self.teeth))
        u = (k[:, None] + np.concatenate([-half, half[::-1]])).ravel()
        return self._solid(u, np.tile(np.concatenate([h, h[::-1]]), len(k)), n, flat)

    def plain(self, flat: bool) -> Shape:
        """Its pitch circle as a disc, a ring or a bar, where teeth are too small to be seen; what a pulley is."""
        if self.is_worm:
            return self._thread()
        if self.is_rack:
            return self._solid(
                np.array([-0.5, 0.5]) * self.length / (np.pi * self.module) - self.phase, np.zeros(2), 1, flat
            )
        u = np.arange(AROUND) / AROUND * max(self.teeth, 1.0)
        return self._solid(u, np.zeros(AROUND), 1, flat)

    def _solid(self, u: Array, h: Array, n: int, flat: bool) -> Shape:
        """Convex faces of teeth with ``n`` points a flank (1: none) on a disc, ring or bar, between the levels."""
        behind = self.is_rack or self.internal
        levels = self._levels(flat)
        count, teeth = len(u), len(u) // (2 * n)
        sheets = [self.place(u, h, s) for s in levels]
        base = np.arange(teeth) * 2 * n
        feet = np.stack([base, base + 2 * n - 1], axis=1).ravel() if n > 1 else np.arange(count)
        faces: list[tuple[int, ...]] = [
            (b + i, b + i + 1, b + 2 * n - 2 - i, b + 2 * n - 1 - i) for b in base.tolist() for i in range(n - 1)
        ]
        closed = not self.is_rack
        around = [*zip(feet.tolist(), np.roll(feet, -1).tolist(), strict=True)][: len(feet) if closed else -1]
        if behind:
            back = (self.module * RIM) * (-1.0 if self.is_rack else 1.0) + h[feet[0]]
            rest = [self.place(u[feet], np.full(len(feet), back), s) for s in levels]
            sheets = [np.concatenate(both) for both in zip(sheets, rest, strict=True)]
            number = {int(f): count + i for i, f in enumerate(feet)}
            faces += [(i, j, number[j], number[i]) for i, j in around]
            rim = list(range(count, count + len(feet)))
        else:
            faces.append(tuple(feet.tolist()))
            rim = []
        loop = list(range(count))
        runs = (
            [[*loop, *rim[::-1], loop[0]]] if self.is_rack else [[*loop, loop[0]], *([[*rim, rim[0]]] if rim else [])]
        )
        if flat:
            return Shape(sheets[0], tuple(faces), tuple(map(tuple, runs)))
        size = len(sheets[0])
        both = [tuple(i + size * side for i in face) for side in (0, 1) for face in faces]
        both += [(i, j, j + size, i + size) for run in runs for i, j in pairwise(run)]
        return Shape(np.concatenate(sheets), tuple(both))

    def _thread(self) -> Shape:
        """A worm: trapezoids along its axis that wind around it."""
        m = self.module
        pitch = 2 * np.pi * self.radius / (np.tan(abs(self.helix)) * self.teeth)
        h = m * np.array([-ROOT, TIP, TIP, -ROOT])
        half = pitch / 4 - h[:2] * np.tan(self.pressure)
        z = np.concatenate([-half, half[::-1]])
        starts = np.arange(np.floor(-self.length / (2 * pitch)), np.ceil(self.length / (2 * pitch)) + 1) * pitch
        z, rho = (starts[:, None] + z).ravel(), self.radius + np.tile(h, len(starts))
        turn = np.linspace(0.0, 2 * np.pi, AROUND // 2 + 1)
        shift = np.sign(self.helix) * pitch * self.teeth * (turn - 2 * np.pi * self.phase / self.teeth) / (2 * np.pi)
        along = np.clip(z + (shift % pitch)[:, None], -self.length / 2, self.length / 2)
        local = np.stack([rho * np.cos(turn)[:, None], rho * np.sin(turn)[:, None], along], axis=-1)
        rows, n = local.shape[:2]
        faces = [
            (i * n + j, i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j)
            for i in range(rows - 1)
            for j in range(n - 1)
        ]
        ends = [tuple(i * n + j for i in range(rows - 1)) for j in (0, n - 1)]
        return Shape(local.reshape(-1, 3) @ self.axes.T + self.at, (*faces, *ends))

    def pitch_line(self, flat: bool) -> Shape:
        """The pitch circle, or line of a rack, in front of its teeth."""
        if self.is_rack:
            ends = np.array([-0.5, 0.5]) * self.length / (np.pi * self.module) - self.phase
            return polyline(self.place(ends, np.zeros(2), self._levels(flat)[-1]))
        u = np.linspace(0.0, max(self.teeth, 1.0), AROUND + 1)
        return polyline(self.place(u, np.zeros(AROUND + 1), self._levels(flat)[-1]))

    def mark(self, flat: bool) -> Shape:
        """A short line at its zero, which shows that it turns."""
        low, high = (1.02, 1.08) if self.internal else (0.5, 0.8)
        run = np.outer(np.array([low, high]) * self.radius, self.axes[:, 0]) + self.at
        return polyline(run + self._levels(flat)[-1] * self.axes[:, 2])


def _circle(radius: float) -> Array:
    turn = np.arange(16) * np.pi / 8
    return radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)


class DrawnMesh(NamedTuple):
    """Two wheels by number, the pitch point and the direction in which both pitch lines run there, global."""

    a: int
    b: int
    point: Array
    along: Array


def interleaved(wheels: Sequence[Wheel], meshes: Iterable[DrawnMesh], poses: Mapping[str, Array]) -> list[Wheel]:
    """The wheels turned so far that teeth stand in the gaps of those with which they mesh, at poses ``(3, 4)`` of the links.

    From wheel to wheel: where meshes close a ring, the last one shows whether the teeth fit.
    """
    out, fixed = list(wheels), {i for i, wheel in enumerate(wheels) if wheel.marked}
    met: dict[int, list[DrawnMesh]] = {}
    for mesh in meshes:
        met.setdefault(mesh.a, []).append(mesh)
        met.setdefault(mesh.b, []).append(mesh)
    reached: list[tuple[int, int, DrawnMesh]] = []
    for first in (*sorted(fixed & set(met)), *met):
        queue = [first] if first not in fixed or out[first].marked else []
        fixed.add(first)
        for known in queue:
            for mesh in met[known]:
                other = mesh.a + mesh.b - known
                if other not in fixed:
                    fixed.add(other)
                    queue.append(other)
                    reached.append((known, other, mesh))
    for known, other, mesh in reached:
        place, sense = {}, {}
        for i in (known, other):
            X = poses[out[i].link]
            step = 1e-4 * max(out[i].module, 1e-12) * mesh.along
            here, ahead = ((p - X[:, 3]) @ X[:, :3] for p in (mesh.point, mesh.point + step))
            place[i] = float(out[i].count(here))
            sense[i] = float(np.sign(out[i].count(ahead) - place[i]))
        off = sense[other] * (sense[known] * place[known] + 0.5)
        out[other] = replace(out[other], phase=out[other].phase + (place[other] - off) % 1.0)
    return out


def belt_path(centers: Array, axis: Array, w: Array) -> tuple[Array, Array]:
    """Points ``(T, n ARC, 3)`` of a belt over pulleys with ``centers (3, n, T)``, signed radii ``w (n,)`` and ``axis (3, T)``.

    And the span of every piece behind a point: ``k`` from pulley k to the next one, from ``k - 1`` to ``k`` on pulley k.
    """
    made = course(centers, axis[:, None], w)
    part = np.linspace(0.0, 1.0, ARC)[:, None, None]
    turn = part * np.sign(w)[:, None] * made.wrap
    out = np.roll(made.spans.end, 1, axis=1) - centers  # where the belt runs onto each pulley
    across = np.cross(axis[:, None], out, axis=0)
    points = centers[:, None] + np.cos(turn) * out[:, None] + np.sin(turn) * across[:, None]
    k = np.arange(len(w))
    number = np.concatenate([k - 1 + (part[:-1, :, 0] + part[1:, :, 0]) / 2, k[None].astype(float)])
    return points.transpose(3, 2, 1, 0).reshape(points.shape[3], -1, 3), number.T.ravel()


class DrawnBelt(NamedTuple):
    """A belt over wheels by number, in order, which it turns in the ``senses``; ``spans`` are named where each has its tension."""

    name: str
    over: tuple[int, ...]
    senses: tuple[float, ...]
    spans: tuple[str, ...] = ()


class WheelSeat(NamedTuple):
    """Where a gear sits: its link, the pose ``(3, 4)`` of that, a point of its axis and its axes as columns, global."""

    link: str
    pose: Array
    point: Array
    axes: Array

    def wheel(
        self, name: str, at: Array, axes: Array, teeth: float, radius: float, module: float, **more: Any
    ) -> Wheel:
        """A wheel with its middle ``at`` a global point."""
        R = self.pose[:, :3]
        return Wheel(name, self.link, (at - self.pose[:, 3]) @ R, R.T @ axes, teeth, radius, module, **more)


def gears_of(m: Mechanism, poses: Mapping[str, Array]) -> tuple[list[Wheel], list[DrawnMesh], list[DrawnBelt]]:
    """Wheels of all gears and belts, one where several share it, with meshes and belts; with the links at poses ``(3, 4)``."""
    wheels: list[Wheel] = []
    on_link: dict[str, list[int]] = {}
    meshes, belts = [], []

    def number(new: Wheel) -> int:
        own = on_link.setdefault(new.link, [])
        for i in own:
            old = wheels[i]
            near = 1e-6 * min(new.radius, 1e6 * new.module)  # the same wheel, but for rounding
            if old.teeth == new.teeth and np.isclose(old.radius, new.radius) and np.allclose(old.at, new.at, atol=near):
                return i
        wheels.append(new)
        own.append(len(wheels) - 1)
        return own[-1]

    named = {
        gear.name: number(PLACED[type(gear)](gear, _seat(gear, poses))) for gear in m.gears if type(gear) in PLACED
    }
    for c in m.couplings:
        if isinstance(c, BeltDrive) and c.span == c.tight[0]:
            over = tuple(named[name] for name in c.over)
            belts.append(DrawnBelt(c.belt, over, tuple(c.senses.tolist()), c.span_names))
        elif isinstance(c, Meshing):
            met, ends = c.seen(m), [end.seen(poses[end.link]) for end in c.ends]
            P = c.relation(ends[0], ends[1], np.array(c.numbers)[:, None, None]).point[:, 0, 0]
            both = {gear: _seat(gear, poses) for gear in (met.one, met.two)}
            if isinstance(c, Mesh):
                names = dict(zip(both, (c.a, c.b), strict=True))
            else:
                names = dict(zip(both, (f"{c.name}.a", f"{c.name}.b"), strict=True))
            drawn = {gear: PLACED[type(gear)](gear, seat) for gear, seat in both.items() if type(gear) in PLACED}
            if (made := SIZED.get(tuple(map(type, both)))) is not None:  # the size of one follows from the other
                drawn = dict(zip(both, made(P, *both.items()), strict=True))
            i, j = (number(replace(wheel, name=names[gear])) for gear, wheel in drawn.items())
            if isinstance(c, Belt):
                belts.append(DrawnBelt(c.name, (i, j), (1.0, -1.0 if c.crossed else 1.0)))
            else:
                meshes.append(
                    _mesh(i, j, P, next(seat for gear, seat in both.items() if not isinstance(gear, GearRack)))
                )
    return interleaved(wheels, meshes, poses), meshes, belts


def _mesh(a: int, b: int, P: Array, seat: WheelSeat) -> DrawnMesh:
    """Two wheels by number that mesh at a point, one of them sitting there."""
    along = np.cross(seat.axes[:, 2], P - seat.point)
    return DrawnMesh(a, b, P, along / np.linalg.norm(along))


def _seat(gear: Any, poses: Mapping[str, Array]) -> WheelSeat:
    place = gear.place
    pose, z, x = poses[place.link], np.asarray(place.axis), np.asarray(place.mark)
    axes = np.column_stack([x, np.cross(z, x), z])
    return WheelSeat(place.link, pose, pose[:, :3] @ np.asarray(place.point) + pose[:, 3], pose[:, :3] @ axes)


def _cylindrical(g: Any, seat: WheelSeat) -> Wheel:
    angles = {"pressure": g.pressure_angle, "helix": g.helix_angle, "shift": g.shift, "internal": g.internal}
    return seat.wheel(
        g.name,
        seat.point,
        seat.axes,
        g.teeth,
        g.radius,
        g.module,
        width=g.width or 0.0,
        marked=g.mark is not None,
        **angles,
    )


def _in_a_row(g: Any, seat: WheelSeat) -> Wheel:
    x, y = seat.axes[:, 2], seat.axes[:, 0]
    angles = {"pressure": g.pressure_angle, "helix": g.helix_angle, "width": g.width or 0.0}
    axes = np.column_stack([x, y, np.cross(x, y)])
    return seat.wheel(
        g.name,
        seat.point,
        axes,
        1,
        np.inf,
        g.module / np.cos(g.helix_angle),
        length=TEETH_IN_A_ROW * np.pi * g.module,
        **angles,
    )


def _pulley(g: Any, seat: WheelSeat) -> Wheel:
    return seat.wheel(g.name, seat.point, seat.axes, 0, g.pitch_radius, 0.05 * g.pitch_radius)


PLACED: dict[type[Any], Callable[[Any, WheelSeat], Wheel]] = {Gear: _cylindrical, GearRack: _in_a_row, Pulley: _pulley}
"""Wheels of gears that say all of themselves."""


def _foot(seat: WheelSeat, P: Array) -> tuple[Array, float]:
    """The middle of the wheel that has a pitch point, and its radius."""
    z = seat.axes[:, 2]
    at = seat.point + ((P - seat.point) @ z) * z
    return at, float(np.linalg.norm(P - at))


def _bevels(P: Array, *of: tuple[Any, WheelSeat]) -> Iterator[Wheel]:
    (p, z), (q, w) = ((seat.point, seat.axes[:, 2]) for _, seat in of)
    apex = p + np.linalg.lstsq(np.stack([z, -w], axis=1), q - p)[0][0] * z
    for gear, seat in of:
        at, r = _foot(seat, P)
        side = np.sign((at - apex) @ seat.axes[:, 2]) or 1.0
        cone = np.arctan2(r, abs((at - apex) @ seat.axes[:, 2]))
        more = {"pressure": gear.pressure_angle, "helix": gear.spiral_angle, "cone": float(cone)}
        axes = seat.axes @ np.diag([1.0, side, side])
        yield seat.wheel(gear.name, at, axes, gear.teeth, r, gear.module, marked=gear.mark is not None, **more)


def _worm(P: Array, of_worm: tuple[Any, WheelSeat], of_wheel: tuple[Any, WheelSeat]) -> Iterator[Wheel]:
    (worm, seat), (wheel, there) = of_worm, of_wheel
    at, r = _foot(there, P)
    axial, hand = 2 * r / wheel.teeth, -1.0 if worm.left_hand else 1.0
    lead = np.arctan2(axial * worm.teeth, 2 * worm.radius)
    m = axial * np.cos(lead)
    long = 2 * np.sqrt(2 * r * axial) + 2 * axial  # as the tips of the wheel reach into it, and some more
    more = {"pressure": worm.pressure_angle, "marked": worm.mark is not None}
    helix = hand * (np.pi / 2 - lead)
    yield seat.wheel(
        worm.name, _foot(seat, P)[0], seat.axes, worm.teeth, worm.radius, m, helix=helix, length=long, **more
    )
    more["marked"] = wheel.mark is not None
    yield there.wheel(wheel.name, at, there.axes, wheel.teeth, r, m, helix=hand * lead, width=1.4 * worm.radius, **more)


def _wheel_first(P: Array, *of: tuple[Any, WheelSeat]) -> Iterator[Wheel]:
    return reversed([*_worm(P, *of[::-1])])


SIZED: dict[tuple[type, ...], Callable[..., Iterator[Wheel]]] = {
    (BevelGear, BevelGear): _bevels, (Worm, WormWheel): _worm, (WormWheel, Worm): _wheel_first,
}  # fmt: skip
"""Wheels of gears whose size follows from those that they mesh with, from their pitch point and seats."""
