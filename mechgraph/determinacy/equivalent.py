"""The lower-pair mechanism that moves as a planar mechanism with higher pairs does at one position, up to accelerations.

A higher pair leaves two freedoms in the plane and takes one force, along n through P. In its place stands a link with two turning pairs on
that line: P_b of link b, at P + s n, goes on a circle about P_a of link a, at P + (s - l) n. The pair asks for n . a = B(omega, u) of the
point of b at P, a form of the rate of turn omega and of the sliding u = t . v there; with u_s = u + s omega that circle asks for

    l (B - omega u_s) + u_s^2 = 0  for all omega, u:     l = -1 / b_uu,   s = l (1 - b_wu) / 2,   l (b_ww - s) + s^2 = 0.

The points are the centers of curvature of both sides, l the sum of their radii. Where b_uu = 0 one side is straight, and a slide along t
takes the place of its turning pair; the other point is at s = b_ww (of link b, b_wu = 1) or s = -b_ww (of link a, b_wu = -1).
Gears and belts: a link between the feet of both axes on the line of contact; of a rack, which is straight, a slide across that line.
Source: Marghitu, Fundamentals, section 2.15; Hall, Kinematics and Linkage Design, 1961 (Euler-Savary).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

import numpy as np

from mechgraph.determinacy.decomposition import LinkRows, joints_at
from mechgraph.determinacy.families import kind_of
from mechgraph.determinacy.mobility import Position
from mechgraph.errors import DeclarationError
from mechgraph.graph.atlas import MultipleJoint
from mechgraph.kinematics.assembly import assembled, assembled_at, at_position
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Meshing
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.quantities import door, wrong

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
