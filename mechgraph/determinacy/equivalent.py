"""The same mechanism declared otherwise: with lower pairs for higher ones, with joints split, in its plane and back in space.

The lower-pair mechanism that moves as a planar mechanism with higher pairs does at one position, up to accelerations.

A higher pair leaves two freedoms in the plane and takes one force, along n through P. In its place stands a link with two turning pairs on
that line: P_b of link b, at P + s n, goes on a circle about P_a of link a, at P + (s - l) n. The pair asks for n . a = B(omega, u) of the
point of b at P, a form of the rate of turn omega and of the sliding u = t . v there; with u_s = u + s omega that circle asks for

    l (B - omega u_s) + u_s^2 = 0  for all omega, u:     l = -1 / b_uu,   s = l (1 - b_wu) / 2,   l (b_ww - s) + s^2 = 0.

The points are the centers of curvature of both sides, l the sum of their radii. Where b_uu = 0 one side is straight, and a slide along t
takes the place of its turning pair; the other point is at s = b_ww (of link b, b_wu = 1) or s = -b_ww (of link a, b_wu = -1).
Gears and belts: a link between the feet of both axes on the line of contact; of a rack, which is straight, a slide across that line.
Source: Marghitu, Fundamentals, section 2.15; Hall, Kinematics and Linkage Design, 1961 (Euler-Savary).

From a spatial mechanism that moves in a plane to the planar one, and back into space.

Every link keeps its frame but for a turn that puts its z on the normal of the plane, so that coordinates of pairs, and with them motions of
drives and starts, keep their values. A pair of another type takes over what the old one holds in the plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.determinacy.decomposition import LinkRows, joints_at
from mechgraph.determinacy.families import kind_of, kind_of_mechanism, plane_of_motion
from mechgraph.determinacy.finite_motion import finite_motion
from mechgraph.determinacy.mobility import Position, free_motion
from mechgraph.errors import DeclarationError, listed
from mechgraph.fields import Described, axes_of
from mechgraph.graph.atlas import MultipleJoint
from mechgraph.kinematics.assembly import assembled, assembled_at, at_position
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Meshing
from mechgraph.model.pair import SEATS, Link, Marker, Pair, Stiffness
from mechgraph.model.plane import dropped, held_in_plane, in_plane, in_space, instead_of, lifted
from mechgraph.pairs.contact_types import row_of
from mechgraph.pairs.factors import Component
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import door, is_numeric, unknown, wrong

ONE_POINT = 1e-8
"""Distance (over L) below which two points are one, and misfit of the circle up to which there is one."""
SPATIAL = (
    "is no planar mechanism: not all its pairs move in one plane. Two surfaces that touch in space have two centers of curvature each, "
    "between which no single link moves as they do; keep the higher pairs, which check and solve take as they are"
)
NAMES = ("{}_link", "{}_a", "{}_b")
"""Names of the link that takes the place of a higher pair, and of its pairs."""


@dataclass
class _Parts:
    """What is put together: links and pairs, for a mechanism where it is at the position; ``normal`` of its plane."""

    m: Mechanism
    here: Configuration
    normal: Array
    links: list[Link] = field(default_factory=list)
    pairs: list[Pair] = field(default_factory=list)

    def marker(self, link: str, point: Array, axis: Array) -> Marker:
        """A marker where ``point`` and ``axis`` (internal) are now; a link that is new has its frame along the global one."""
        par = self.here.system.par
        p = par.L * point + par.origin
        if link not in self.m.link_index:
            return Marker(point=tuple(p.tolist()), axis=tuple(axis.tolist()), second=tuple(self._second(axis).tolist()))
        X = self.poses[self.m.link_index[link]]
        directions = (X[:3, :3].T @ d for d in (p - X[:3, 3], axis, self._second(axis)))
        point_there, axis_there, second = (tuple(d.tolist()) for d in directions)
        return Marker(point=point_there, axis=axis_there, second=second)

    @cached_property
    def poses(self) -> Array:
        """Poses ``(N, 4, 4)`` of the links."""
        return user_poses(self.here)[:, 0]

    @staticmethod
    def _second(axis: Array) -> Array:
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        return np.asarray(across / np.linalg.norm(across))

    def join(self, name: str, symbol: str, a: str, b: str, point: Array, axis: Array) -> None:
        """A pair of two links where its point and axis are now."""
        on_a, on_b = (self.marker(link, point, axis) for link in (a, b))
        self.pairs.append(Pair(name, symbol, a, b, on_a=on_a, on_b=on_b))


def equivalent(m: Mechanism, at: Mapping[str, float] | None = None, *, rollers: str = "removed") -> Mechanism:
    """The mechanism with links and lower pairs in place of higher pairs, gears and belts, equal in velocity and acceleration at a position.

    Parameters
    ----------
    at : values of freedoms at the position; left out, the declared start.
    rollers : ``"removed"``: a roller on a pin itself becomes the link between its pin and the center of curvature; ``"kept"``: it stays,
        and spins passively.

    Raises
    ------
    DeclarationError
        for a mechanism that is not planar, a coupling that has no line of contact, or sides that are both straight.
    """
    if rollers not in ("removed", "kept"):
        raise DeclarationError(f"equivalent of {m.name!r}", [f"rollers = {rollers!r}: expected 'removed' or 'kept'"])
    system, x = assembled_at(m, at) if at else assembled(m)
    placed = at_position(m, system, x)
    here = Configuration(system, x[:, None])
    position = Position.at(here)
    kind = kind_of(position.rows.S)
    if kind.name != "planar":
        raise DeclarationError(f"equivalent of {m.name!r}", [SPATIAL])
    rows = LinkRows(position, np.zeros(0, dtype=np.intp), kind.twists)
    normal = np.array(kind.place)
    parts = _Parts(m, here, normal, list(m.links))
    higher = [k for k, c in enumerate(rows.pairs) if c.count == 1]
    parts.pairs = [p for k, p in enumerate(placed.pairs) if k not in higher]
    faults: list[str] = []
    for k in higher:
        faults += _in_place_of_pair(parts, rows, k, rollers == "removed")
    faults += _in_place_of_gears(parts)
    if faults:
        raise DeclarationError(f"equivalent of {m.name!r}", faults)
    names = {p.name for p in parts.pairs}
    start = {name: value for name, value in placed.start.items() if m.pairs[m.freedom(name)[0]].name in names}
    return placed.replace(
        name=f"{m.name}, lower pairs", links=parts.links, pairs=parts.pairs, couplings=(), start=start, frame=m.frame
    )


def _in_place_of_pair(parts: _Parts, rows: LinkRows, k: int, remove: bool) -> list[str]:
    """The link, or for a roller on a pin the pair, in place of a higher pair; what is wrong with it."""
    m, pair = parts.m, parts.m.pairs[k]
    P, n, forms = _second_order(parts, rows, k)
    t = np.cross(parts.normal, n)
    bww, bwu, buu = forms
    # curvature (times L) below which a side of a contact is straight
    if abs(buu) > 1e-8:
        length = -1.0 / buu
        s = length * (1.0 - bwu) / 2.0
        if abs(length * (bww - s) + s * s) > ONE_POINT * max(1.0, length * length):
            return [f"pair {pair.name}: no link with two pairs moves as it does"]
        ends = [("R", P + (s - length) * n, parts.normal), ("R", P + s * n, parts.normal)]
    elif abs(bwu - 1.0) < ONE_POINT:
        ends = [("P", P + bww * n, t), ("R", P + bww * n, parts.normal)]
    elif abs(bwu + 1.0) < ONE_POINT:
        ends = [("R", P - bww * n, parts.normal), ("P", P - bww * n, t)]
    else:
        return [f"pair {pair.name}: both sides are straight, which no link with two pairs can be in place of"]
    names = [name.format(pair.name) for name in NAMES]
    for side, link in enumerate((pair.a, pair.b)):
        if remove and ends[side][0] == "R" and _is_roller(parts, link, ends[side][1], k):
            symbol, point, axis = ends[1 - side]
            parts.join(names[2 - side], symbol, pair.a, pair.b, point, axis)
            return []
    parts.links.append(Link(names[0]))
    parts.join(names[1], ends[0][0], pair.a, names[0], *ends[0][1:])
    parts.join(names[2], ends[1][0], names[0], pair.b, *ends[1][1:])
    return [f"link {names[0]!r} is there already: rename it" for _ in range(names[0] in m.link_index)]


def _is_roller(parts: _Parts, link: str, centre: Array, k: int) -> bool:
    """Whether a moving link has one other pair, a turn about the center of curvature of its side."""
    m, here = parts.m, parts.here
    others = [i for i, p in enumerate(m.pairs) if link in (p.a, p.b) and i != k]
    if link == m.frame or len(others) != 1:
        return False
    row = m.pairs[others[0]].type
    off = here.pair_points[:, others[0], 0] - centre
    off = off - parts.normal * (parts.normal @ off)
    return row.f == 1 and row.freedoms[0].turns and float(np.linalg.norm(off)) < ONE_POINT


def _second_order(parts: _Parts, rows: LinkRows, k: int) -> tuple[Array, Array, tuple[float, float, float]]:
    """Point and direction of the force of a higher pair, and the form ``n . a`` of (turn, slide): its squares and product."""
    here, z = parts.here, parts.normal
    a, b = here.system.graph.ends[k]
    row = rows.pairs[k].rows[b][0]
    wrench = rows.twists @ row
    size = float(np.linalg.norm(wrench[3:]))
    n, M = wrench[3:] / size, wrench[:3] / size
    P = np.cross(n, M)
    t = np.cross(z, n)
    w = np.concatenate([np.cross(P, n), n])
    free = np.linalg.svd(row[None])[2][1:].T
    twists = rows.twists @ free
    rates = np.stack([z @ twists[:3], t @ (twists[3:] + np.cross(twists[:3], P, axis=0))])
    columns = list(rows.position.columns(k))
    still = np.zeros((6, here.system.graph.n_links, 1))

    def form(turn: float, slide: float) -> float:
        V = twists @ np.linalg.solve(rates, np.array([turn, slide]))
        dq = np.zeros((rows.position.n_freedoms, 1))
        dq[columns, 0] = np.linalg.lstsq(rows.position.rows.S[:, columns], V, rcond=None)[0]
        return float(w @ here.bias(dq, still)[:, k, 0])

    ww, uu = form(1.0, 0.0), form(0.0, 1.0)
    return P, n, (ww, form(1.0, 1.0) - ww - uu, uu)


def _in_place_of_gears(parts: _Parts) -> list[str]:
    """Links in place of gears and belts, slides in place of racks; couplings for which there are none."""
    lines, m, z = ContactLines(parts.here), parts.m, parts.normal
    faults = [
        f"coupling {c.name}: has no line of contact; give gears, a rack or a belt"
        for c in m.couplings
        if not isinstance(c, Meshing) or not c.linear
    ]
    for (_, contact), (G, *_) in zip(lines.contacts, lines.wrenches, strict=True):
        if not isinstance(contact, Meshing):
            continue
        first, last = contact.steps[0], contact.steps[-1]
        one, other = m.pairs[first.pair], m.pairs[last.pair]
        wheel_a, wheel_b = (one.a if first.sense > 0 else one.b), (other.b if last.sense > 0 else other.a)
        force = G[3:, 0, 0] - z * (z @ G[3:, 0, 0])
        n = force / np.linalg.norm(force)
        P = np.cross(n, z * (z @ G[:3, 0, 0]) / np.linalg.norm(force))
        feet = [P + n * (n @ (parts.here.pair_points[:, k, 0] - P)) for k in (first.pair, last.pair)]
        link, name_a, name_b = (name.format(contact.name) for name in NAMES)
        parts.links.append(Link(link))
        parts.join(name_a, "R", wheel_a, link, feet[0], z)
        symbol, point, axis = ("P", feet[0], np.cross(z, n)) if not contact.turning[1] else ("R", feet[1], z)
        parts.join(name_b, symbol, link, wheel_b, point, axis)
    return faults


# --- multiple joints -----------------------------------------------------------------------------------------------------


@door
def multiple_joints(m: Mechanism, at: Mapping[str, float] | None = None) -> tuple[MultipleJoint, ...]:
    """Find the revolute joints of three or more links on one axis, at a closed position.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    at : mapping of str to float, optional
        Coordinates [rad, length] at which to assemble first.

    Returns
    -------
    tuple of MultipleJoint

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.multiple_joints(mg.load("four-bar"))
    ()
    """
    system, x = assembled_at(m, at) if at else assembled(m)
    return joints_at(Position.at(Configuration(system, x[:, None])))


@door
def split_joint(m: Mechanism, pair: str, on: str, at: Mapping[str, float] | None = None) -> Mechanism:
    """Redeclare a multiple joint as pairs of the link ``on`` with each of the others.

    Pairs keep their names. A pair that changes its links counts from zero at the position ``at``.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    pair : str
        Any pair of the joint.
    on : str
        Name of the link.
    at : mapping of str to float, optional
        Coordinates [rad, length] at which to assemble first. Default: the declared start.

    Returns
    -------
    Mechanism

    Raises
    ------
    DeclarationError
        The pair is in no multiple joint, the link is not in it, or a pair that would change is driven or loaded.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z, pins = (0, 0, 1), [("A", "frame", "a", 0), ("B", "a", "b", 1), ("C", "a", "c", 1), ("D", "b", "c", 2)]
    >>> m = mg.Mechanism("m", pairs=[mg.Pair(k, "R", a, b, point=(x, 0, 0), axis=z) for k, a, b, x in pins])
    >>> [(p.a, p.b) for p in mg.split_joint(m, "B", on="b").pairs[1:3]]
    [('a', 'b'), ('b', 'c')]
    """
    import networkx as nx

    system, x = assembled_at(m, at) if at else assembled(m)
    here = Configuration(system, x[:, None])
    joint = next((j for j in joints_at(Position.at(here)) if pair in j.pairs), None)
    what = f"split_joint of {m.name!r}"
    if joint is None:
        raise DeclarationError(what, [f"pair {pair!r}: is in no joint of three or more links; see mg.multiple_joints"])
    if on not in joint.links:
        raise DeclarationError(what, [wrong(on, "on", f"a link of the joint: {', '.join(joint.links)}")])
    placed = at_position(m, system, x)
    tree = nx.Graph((p.a, p.b, {"pair": p.name}) for p in m.pairs if p.name in joint.pairs)
    other = {tree.edges[a, b]["pair"]: b for a, b in nx.bfs_edges(tree, on)}
    changed = [p.name for p in m.pairs if p.name in other and on not in (p.a, p.b)]
    bound = m.bound_freedoms
    faults = [
        f"pair {name}: is driven, loaded, coupled or named by the response, and would turn between other links"
        for name in changed
        if not bound.isdisjoint(m.pair(name).freedom_names)
    ]
    if faults:
        raise DeclarationError(what, faults)
    parts = _Parts(m, here, np.zeros(3))
    for name in changed:
        k = m.pair_index[name]
        axis = here.S[:3, system.first_column[k], 0]
        parts.join(name, m.pairs[k].type.symbol, on, other[name], here.pair_points[:, k, 0], axis)
    made = {p.name: p for p in parts.pairs}
    start = {name: value for name, value in placed.start.items() if m.pairs[m.freedom(name)[0]].name not in made}
    return placed.replace(pairs=[made.get(p.name, p) for p in placed.pairs], start=start, links=m.links, frame=m.frame)


# --- planes ----------------------------------------------------------------------------------------------------------------

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
