"""From a spatial mechanism that moves in a plane to the planar one, and back into space.

Every link keeps its frame but for a turn that puts its z on the normal of the plane, so that coordinates of pairs, and with them motions of
drives and starts, keep their values. A pair of another type takes over what the old one holds in the plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np

from mechgraph.determinacy.families import kind_of_mechanism, plane_of_motion
from mechgraph.determinacy.finite_motion import finite_motion
from mechgraph.determinacy.mobility import free_motion
from mechgraph.errors import DeclarationError, listed
from mechgraph.fields import Described, axes_of
from mechgraph.kinematics.assembly import assembled
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import SEATS, Marker, Pair, Stiffness
from mechgraph.model.plane import dropped, held_in_plane, in_plane, in_space, instead_of, lifted
from mechgraph.pairs.contact_types import row_of
from mechgraph.pairs.factors import Component
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import is_numeric, unknown, wrong

LEVEL = 1e-9
"""Sine of an angle, or length over that of a vector, up to which it is rounding."""
UPRIGHT = np.array([0.0, 0.0, 1.0])


def to_planar(m: Mechanism, normal: Any = None) -> Mechanism:
    """See ``Mechanism.to_planar``."""
    if m.planar:
        return m
    flat = _Flat(m, _normal_of(m, normal))
    return flat.made()


def _normal_of(m: Mechanism, normal: Any) -> Array:
    """The normal of the plane in which a mechanism moves, pointing to the side of z; of an upright one so that with z as y, x grows."""
    where = f"to_planar of {m.name!r}"
    if normal is not None and not (is_numeric(normal, (3,)) and np.linalg.norm(normal) > 0):
        raise DeclarationError(where, [wrong(normal, "normal", "a direction of three numbers")])
    given = None if normal is None else np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    if not m.has_geometry:
        return UPRIGHT if given is None else _seen_from_above(given)
    system, x = assembled(m)
    freedoms = free_motion(system, x, np.zeros(0, dtype=np.intp))
    motion = finite_motion(system, x, freedoms.closure, "auto")
    kind = kind_of_mechanism(freedoms, motion)
    found = np.array(kind.place) if kind.name == "planar" else plane_of_motion(freedoms, motion, given)
    if found is None and given is not None and freedoms.mobility == 0:
        found = given
    if found is None or (given is not None and np.linalg.norm(np.cross(found, given)) > LEVEL):
        what = "does not move in a plane" if found is None else f"moves in the plane with the normal {_shown(found)}"
        raise DeclarationError(
            where, [f"{what}; expected a mechanism that moves in {'one' if given is None else 'that one'}"]
        )
    return _seen_from_above(found)


def _seen_from_above(n: Array) -> Array:
    if np.linalg.norm(np.cross(n, UPRIGHT)) <= LEVEL:
        return UPRIGHT
    across = np.cross(UPRIGHT, n)
    ahead = n[2] if abs(n[2]) > LEVEL else across[np.argmax(np.abs(across) > LEVEL)]
    return np.asarray(n * np.sign(ahead))


def _shown(vector: Array) -> str:
    return f"({', '.join(f'{v + 0.0:.6g}' for v in vector)})"


def _turn_to(n: Array) -> Array:
    """The least rotation that takes a unit vector to z; none where it stands on the plane, on either side."""
    if np.linalg.norm(np.cross(n, UPRIGHT)) <= LEVEL:
        return np.eye(3)
    axis, c = np.cross(n, UPRIGHT), float(n @ UPRIGHT)
    K = np.cross(np.eye(3), axis)  # the matrix of the product with the axis
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + c))


def _turn_of_plane(n: Array) -> Array:
    """The rotation that makes a plane with the normal n x-y: z of an upright one becomes y, any other takes the least one."""
    return np.stack([np.cross(UPRIGHT, n), UPRIGHT, n]) if abs(n[2]) <= LEVEL else _turn_to(n)


class _End:
    """A link: the ``turn`` of its frame that puts z on the normal, on which ``side`` that is, the global x axis seen from it then."""

    def __init__(self, turn: Array, R: Array) -> None:
        self.turn = turn
        self.side = float(np.sign((turn @ R[2])[2]))
        x = turn @ R[0]
        self.first = np.array([x[0], x[1], 0.0])


@dataclass
class _Flat:
    """A mechanism on its way into the plane with that ``normal``; what is ``lost`` on it."""

    m: Mechanism
    normal: Array
    lost: list[str] = field(default_factory=list)

    @property
    def where(self) -> str:
        """For messages."""
        return f"to_planar of {self.m.name!r}"

    def made(self) -> Mechanism:
        """The planar mechanism."""
        G = np.column_stack([_turn_of_plane(self.normal), np.zeros(3)])
        turned = self.m if np.array_equal(G[:, :3], np.eye(3)) else self.m.moved(G)
        ends = [_End(_turn_to(R[2]), R) for R in self._poses(turned)]
        place = turned.link_index
        links = [
            self._dropped(link.moved(np.column_stack([ends[i].turn, np.zeros(3)])))
            for i, link in enumerate(turned.links)
        ]
        pairs = [self._pair(pair, (ends[place[pair.a]], ends[place[pair.b]])) for pair in turned.pairs]
        turns = {link.name: end.turn for link, end in zip(turned.links, ends, strict=True)}
        loads = [self._dropped(_in_turned_frames(load, turns)) for load in turned.loads]
        gears = [
            self._dropped(gear.moved(np.column_stack([ends[place[gear.link]].turn, np.zeros(3)])))
            for gear in turned.gears
        ]
        names = {name for pair in pairs for name in pair.freedom_names}
        old = {name for name in turned.freedom_names() if name not in names}
        drives = [d for d in turned.drives if turned.full_name(d.freedom) not in old]
        if len(drives) < len(turned.drives):
            gone = [d.freedom for d in turned.drives if d not in drives]
            raise DeclarationError(self.where, [f"drive {name!r}: leaves the plane" for name in gone])
        start = {name: value for name, value in turned.start.items() if name not in old}
        told = f"Planar; left out: {listed(self.lost, 12)}." if self.lost else ""
        description = " ".join(filter(None, (turned.description, told)))
        return turned.replace(
            planar=True,
            links=links,
            pairs=pairs,
            gears=gears,
            loads=loads,
            drives=drives,
            start=start,
            description=description,
        )

    def _poses(self, m: Mechanism) -> Array:
        """Rotations ``(N, 3, 3)`` of the links where they stand."""
        if not m.has_geometry or all(pair.on_a is None for pair in m.pairs):
            return np.tile(np.eye(3), (len(m.links), 1, 1))
        system, x = assembled(m)
        return np.asarray(user_poses(Configuration(system, x[:, None]))[:, 0, :3, :3])

    def _dropped(self, item: Any) -> Any:
        made, lost = dropped(in_space(item))
        self.lost += lost
        return made

    def _pair(self, pair: Pair, ends: tuple[_End, _End]) -> Pair:
        """A pair in the plane, of its own type or of the one that holds the same there."""
        row: PairType = pair.type
        if pair.contact is not None:
            return self._dropped(pair)
        sides = [side for side in ((pair,) if pair.on_a is None else (pair.on_a, pair.on_b)) if side is not None]
        axes = ends[0].turn @ axes_of(sides[0].axis, sides[0].second) if pair.has_geometry else np.eye(3)
        flat = in_plane(row)
        held = held_in_plane(row, axes)
        if flat is not None and (flat.held == held.shape[1] or not pair.has_geometry):
            new, symbol = flat, row
        else:
            symbol = row_of(instead_of(row, axes), None)
            found = in_plane(symbol)
            assert found is not None
            new = found
            self.lost.append(f"{pair.name} {row.symbol} -> {symbol.symbol}")
        changes: dict[str, Any] = {"type": symbol, "pitch": None, "lead": None}
        if pair.has_geometry:
            single = {f.name for f, alone in zip(row.freedoms, row.drivable, strict=True) if alone}
            same = new.normal == 0 or (abs(abs(axes[2, 2]) - 1.0) <= LEVEL and {f.name for f in new.freedoms} <= single)
            made = [
                self._marker(pair, side, end, new.normal == 0, same) for side, end in zip(sides, ends, strict=False)
            ]
            there = axes_of(made[0]["axis"], made[0]["second"])
            both = np.concatenate([held, held_in_plane(symbol, there)], axis=1)
            if symbol.symbol == "Ps" or int(np.linalg.matrix_rank(both, tol=LEVEL)) != held.shape[1]:
                what = f"pair {pair.name!r}: {row.symbol} has no counterpart in the plane where it stands; replace it yourself, a ball in a"
                raise DeclarationError(self.where, [f"{what} groove by Ps with curve=mg.Curve.line(...)"])
            changes |= made[0] if pair.on_a is None else {"on_a": Marker(**made[0]), "on_b": Marker(**made[1])}
            changes |= self._seats(pair, axes, new, there)
        return pair.replace(**changes)

    def _seats(self, pair: Pair, axes: Array, new: PairType, there: Array) -> dict[str, Any]:
        """Stiffness and misfit by the components that the pair has in the plane, those along the same lines."""
        out: dict[str, Any] = {}
        for what in SEATS:
            given = getattr(pair, what)
            values: dict[str, float] = {}
            for name, value in {} if given is None else given.by_component.items():
                old = next(c for c in pair.type.reactions or () if c.name == name)
                along = {c.name: float(_directed(c, there) @ _directed(old, axes)) for c in new.reactions or ()}
                found = next((other for other, size in along.items() if abs(abs(size) - 1.0) < LEVEL), None)
                if found is None:
                    self.lost.append(f"{pair.name} {what} {name}")
                else:
                    values[found] = value if what == Stiffness.what else value * np.sign(along[found])
            if given is not None:
                out[what] = values or None
        return out

    def _marker(self, pair: Pair, side: Any, end: _End, slides: bool, same: bool) -> dict[str, Any]:
        """Point, axis and second direction in the plane; not the ``same`` as before, they coincide on both links where these stand."""
        point, axis, second = (end.turn @ np.asarray(v) for v in (side.point, side.axis, side.second))
        if abs(point[2]) > LEVEL * np.abs(point).max():
            self.lost.append(f"{pair.name} z = {point[2]:.4g}")
        if slides:
            axis, second = np.array([axis[0], axis[1], 0.0]), np.array([0.0, 0.0, end.side])
        elif same:
            axis, second = np.array([0.0, 0.0, axis[2]]), np.array([second[0], second[1], 0.0])
        else:
            axis, second = np.array([0.0, 0.0, end.side]), end.first
        return {"point": (*point[:2].tolist(), 0.0), "axis": tuple(axis.tolist()), "second": tuple(second.tolist())}


def _in_turned_frames(load: Load, turns: Mapping[str, Array]) -> Load:
    """A load whose points and directions in frames of links stand in the turned ones."""
    of = {"p": "a", "q": "b", "along": "a", "point": "link"}
    of |= {"force": "link", "moment": "link"} if getattr(load, "frame", "") == "link" else {}
    changes = {}
    for name, field_of_link in of.items():
        about, value = load.formats.get(name), getattr(load, name, None)
        link = getattr(load, field_of_link, None)
        if (
            about is not None
            and about.kind.moved is not None
            and isinstance(link, str)
            and not isinstance(value, str | None)
        ):
            changes[name] = about.kind.moved(value, np.column_stack([turns[link], np.zeros(3)]))
    return load.replace(**changes) if changes else load


def _directed(part: Component, axes: Array) -> Array:
    """The wrench of a component ``(6,)`` in the axes of its marker."""
    wrench = np.array(part.wrench)
    return np.concatenate([axes @ wrench[:3], axes @ wrench[3:]])


def to_spatial(m: Mechanism, z: Mapping[str, float] | None = None) -> Mechanism:
    """See ``Mechanism.to_spatial``."""
    heights = {} if z is None else z
    faults = [unknown("link", name, m.link_index) for name in heights if name not in m.link_index]
    faults += [wrong(h, f"z of {name!r}", "a finite number") for name, h in heights.items() if not is_numeric(h, ())]
    if faults:
        raise DeclarationError(f"to_spatial of {m.name!r}", faults)
    out = m.replace(planar=False) if m.planar else m
    if not any(heights.values()):
        return out
    if any(pair.on_a is not None or pair.contact is not None for pair in m.pairs):
        raise DeclarationError(
            f"to_spatial of {m.name!r}", ["z: layers need pairs by point and axis; move the markers yourself"]
        )

    def height(name: str) -> float:
        return float(heights.get(name, 0.0))

    def of_load(load: Described) -> Described:
        ends = {
            name: value
            for name in load.formats
            if isinstance(value := getattr(load, name), str) and value in m.link_index
        }
        first = next(iter(ends.values()), "")
        points = {"p": ends.get("a", first), "q": ends.get("b", first), "point": first}
        for name, link in points.items():
            if name in load.formats:
                load = lifted(load, height(link), only=name)
        return load

    return out.replace(
        links=[lifted(link, height(link.name)) for link in out.links],
        pairs=[lifted(pair, 0.5 * (height(pair.a) + height(pair.b)), only="point") for pair in out.pairs],
        loads=[of_load(load) for load in out.loads],
        gears=[lifted(gear, height(gear.link)) for gear in out.gears],
    )
