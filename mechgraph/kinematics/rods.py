"""The reduced form of a mechanism for following a path, and the way back: what falls away, what is left, rods at rest in their spin.

The reduced form of a mechanism for following a path: rods and spheres in grooves or on planes as rows of points.

A rod (a link with two S pairs and nothing else, or two that slide along the line of theirs) holds two points at a distance; a pair that
ends in a rotation (S, Sg, Sp) holds the center of a sphere in as many planes as there are directions in which it does not slide. These
links and pairs fall away, and with them loops of six rows each: a smaller mechanism is left with ``kinematics.loop_rows`` behind its own
rows. A link that nothing joins to the frame any more floats: it has a pair of six freedoms.

The twists of what falls away span ``6 - k`` dimensions at every position, reciprocal to the wrenches of its ``k`` rows of points (a rod
has six freedoms, one of them its spin). So in rows turned by these the closure matrix is ``[[B, *], [0, K]]``, ``B`` regular and ``K`` that
of the reduced form: one form is singular where the other is. No coordinate that falls away or comes in has a chart.

Rods between spheres at rest in their spin, along the path of the reduced form (see ``kinematics.rods``).

A rod at rest in its spin turns with its axis ``u`` alone, ``w = u x u'``. From ``R_0`` where a step begins, with the axis ``a`` there,

    R = exp(phi u) M R_0,   M the least rotation from a to u,   phi' = (a x u) . u' / (1 + a . u),

since ``M`` turns about ``u`` at the rate ``-phi'``. ``phi`` is integrated by Gauss and Legendre's rule in every step between nodes, so that
it does not hang on which positions were asked for.
Source: Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82, 1975.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import count
from typing import NamedTuple

import numpy as np
import scipy

from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.kinematics.loop_rows import PointNumbers, PointRows
from mechgraph.kinematics.motion_path import BLOCK, DriverPath, Positions, in_blocks, requests
from mechgraph.kinematics.passive_rest import at_points, parts_of_steps
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver, engine_for
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import PositionRows, System
from mechgraph.maths.se3 import (
    Array,
    Index,
    Mask,
    compose,
    cross,
    identity,
    inverse,
    matrix_quaternion,
    rotate,
    rotation_exp,
    skew,
)
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.track import Interpolation, Nodes, Rule
from mechgraph.maths.tracker import Follower
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.model.parameters import Parameters
from mechgraph.pairs.factors import ConstantScrew
from mechgraph.pairs.pair_type import PairType

ON_LINE = 1e-12
"""Sine of the angle between a slide and the line of its rod up to which they are one: rounding."""


def slides_of_sphere(row: PairType) -> Array | None:
    """Directions ``(3, k)`` in marker A along which a sphere slides, where slides and a rotation are all that a pair has; else None."""
    if not row.steps or not row.steps[-1].holds_rotation:
        return None
    slides = row.steps[:-1]
    if any(not isinstance(step, ConstantScrew) or step.freedom.turns for step in slides):
        return None
    along = np.array([step.freedoms[0].twist[3:] for step in slides]).reshape(-1, 3).T
    return along if np.abs(along.T @ along - np.eye(len(slides))).max(initial=0.0) < 1e-12 else None


class Rod(NamedTuple):
    """A link, or two that slide along their line by the pair ``slide``, between the balls ``first`` (on the first link) and ``second``."""

    links: tuple[int, ...]
    first: int
    second: int
    slide: int = -1


@dataclass(frozen=True)
class Plan:
    """What falls away: ``rods``, further ``pairs``; links ``afloat`` get a floating pair."""

    rods: tuple[Rod, ...]
    pairs: tuple[int, ...]
    afloat: tuple[int, ...]


def plan_of(start: Configuration, kept: set[int]) -> Plan:
    """What falls away of a mechanism where the pairs ``kept`` stay: drivers, couplings.

    Pairs that no loop holds stay; of spheres that do not slide those that join what else would float.
    """
    system = start.system
    ends, frame = system.graph.ends, system.graph.frame
    slides = {
        k: along
        for k in sorted({*system.graph.loop_steps[1].tolist()} - kept)
        if (along := slides_of_sphere(system.m.pairs[k].type)) is not None
    }
    balls = {k for k, along in slides.items() if not along.size}
    rods = _rods(start, balls)
    away = [k for k, along in slides.items() if along.size]
    part = components_of_edges(len(system.m.links), [pair for k, pair in enumerate(ends) if k not in slides])
    for k in sorted(balls.difference(k for rod in rods for k in (rod.first, rod.second))):
        a, b = part[list(ends[k])]
        if a == b:
            away.append(k)
        part[part == b] = a
    part[[link for rod in rods for link in rod.links]] = part[frame]
    afloat = np.unique(part, return_index=True)[1]
    return Plan(tuple(rods), tuple(sorted(away)), tuple(i for i in sorted(afloat.tolist()) if part[i] != part[frame]))


def _rods(start: Configuration, balls: set[int]) -> list[Rod]:
    """Links, or two on a slide, with two of the pairs ``balls`` and no other; a rod ends on links that stay, and not twice on one."""
    system = start.system
    ends, frame = system.graph.ends, system.graph.frame
    at: list[list[int]] = [[] for _ in system.m.links]
    for k, pair in enumerate(ends):
        for link in pair:
            at[link].append(k)
    parts: list[tuple[tuple[int, ...], int]] = [((link,), -1) for link, mine in enumerate(at) if balls.issuperset(mine)]
    parts += [
        (pair, k)
        for k, pair in enumerate(ends)
        if _is_slide(system.m.pairs[k].type) and min(map(len, (at[i] for i in pair))) > 1
    ]
    rods: list[Rod] = []
    free = set(balls)
    for links, slide in parts:
        mine = [k for link in links for k in at[link] if k != slide]
        if frame not in links and len(mine) == 2 and free.issuperset(mine):
            rod = Rod(links, mine[0], mine[1], slide)
            outer = [sum(ends[k]) - link for k, link in zip(mine, (links[0], links[-1]), strict=True)]
            if outer[0] != outer[1] and not {*outer} & {*links} and (slide < 0 or _on_line(start, rod)):
                rods.append(rod)
                free.difference_update(mine)
    return rods


def _is_slide(row: PairType) -> bool:
    return len(row.steps) == 1 and isinstance(row.steps[0], ConstantScrew) and not row.steps[0].freedom.turns


def _on_line(start: Configuration, rod: Rod) -> bool:
    """Whether both links slide along the line of the balls."""
    d = start.pair_points[:, rod.second, 0] - start.pair_points[:, rod.first, 0]
    along = start.S[3:, start.system.first_column[rod.slide], 0]
    return bool(np.abs(cross(d, along)).max() < ON_LINE * np.sqrt(d @ d))


def may_have_rods(system: System) -> bool:
    """Whether a link has two pairs that are spheres, and no other pair, or one and a slide."""
    ball, slide = (
        np.array([is_one(row) for row in system.types], dtype=bool)[system.type_of]
        for is_one in (lambda row: row.f == 3 and row.steps[0].holds_rotation, _is_slide)
    )
    ends = np.concatenate([system.a, system.b])
    balls, slides = (np.bincount(ends, np.tile(some, 2)) for some in (ball, slide))
    return bool(((np.bincount(ends) == 2) & (balls >= 1) & (balls + slides == 2)).any())


FORMS = ("auto", "full", "reduced")
"""The forms of the equations by which a path may be followed; ``"auto"``: the faster one."""
FORM_PAIRS = 2000
"""Pairs above which no reduced form is looked for: more of it would stay than a dense engine does well."""


@cache
def floating_type() -> PairType:
    """A pair that holds nothing, with a rotation that has no chart."""
    return PairType("floating", freedoms=["Tx", "Ty", "Tz", "rotation"], reactions=[])


class ReducedSystem(System):
    """The smaller mechanism with rows of points behind its own."""

    def __init__(self, m: Mechanism, par: Parameters, points: PointNumbers) -> None:
        super().__init__(m, None, par)
        self.numbers_of_points = points

    @cached_property
    def points(self) -> PointRows:
        """The rows of points."""
        paths, k = np.zeros((len(self.m.links), self.n_freedoms)), self.numbers_of_points
        for pair, sign, parent, child in self.graph.tree:
            paths[child] = paths[parent]
            paths[child, self.first_column[pair] : self.first_column[pair + 1]] = sign
        columns = np.where(k.slide >= 0, self.first_column[k.slide], -1)
        return PointRows(k, paths[k.b] - paths[k.a], columns, self.single_rows[columns])

    @cached_property
    def position_rows(self) -> Sequence[PositionRows]:
        """Those of loops, couplings, points."""
        return [*self.rows, self.points]

    @cached_property
    def carrying(self) -> Mask:
        """Which freedoms are slides that stand in no closure row."""
        return super().carrying & ~self.points.way.any(axis=0)

    def cases(self, which: Index) -> System:
        """With the numbers of some variants."""
        if self.par.batch == 1:
            return self
        return ReducedSystem(self.m, self.par.taken(which), self.numbers_of_points.taken(which))


class Reduction:
    """A mechanism and its reduced form: numbers and states of the one from those of the other.

    Attributes
    ----------
    system, plan : the full form, and what falls away.
    links, pairs : what stays of it, by numbers; floating pairs stand behind these pairs.
    columns : freedoms of the pairs that stay, in the full form.
    rods : number of rods.
    """

    def __init__(self, start: Configuration, plan: Plan) -> None:
        self.system, self.plan, self._start = start.system, plan, start
        system, m = start.system, start.system.m
        self.rods = len(plan.rods)
        whole = [rod.links[0] for rod in plan.rods if rod.slide < 0]
        self._ends = [np.array([rod[i] for rod in plan.rods], dtype=np.intp) for i in (1, 2)]
        self._inside = [np.array([rod.links[i] for rod in plan.rods], dtype=np.intp) for i in (0, -1)]
        """The links of rods on which their ends are."""
        self._slide = np.array([rod.slide for rod in plan.rods], dtype=np.intp)
        self._welded = [rod.links[0] for rod in plan.rods if rod.slide >= 0]
        self.links = np.delete(np.arange(len(m.links)), whole)
        self.pairs = np.delete(np.arange(len(m.pairs)), np.concatenate([*self._ends, plan.pairs]).astype(np.intp))
        self._sides = [(system.b[k] == on).astype(np.intp) for k, on in zip(self._ends, self._inside, strict=True)]
        """On which side of its pairs a rod is, 0 for a."""
        self._contacts = np.array(plan.pairs, dtype=np.intp)
        self._slides = {k: along for k in [*plan.pairs] if (along := slides_of_sphere(m.pairs[k].type)) is not None}
        self.columns, self._rows = _ranges(system.first_column, self.pairs), _ranges(system.first_row, self.pairs)
        outer = np.where(self._sides[0] == 1, system.a[self._ends[0]], system.b[self._ends[0]])
        self._outer = np.searchsorted(self.links, outer)
        self.n_state = len(self._rows) + floating_type().nx * len(plan.afloat)
        self.m = self._mechanism()

    def _mechanism(self) -> Mechanism:
        full = self.system.m
        taken = {pair.name for pair in full.pairs}
        fresh = (name for i in count() if (name := f"floating{i}") not in taken)
        floating = [
            Pair(next(fresh), floating_type(), full.frame, full.links[i].name, point=(0, 0, 0), axis=(0, 0, 1))
            for i in self.plan.afloat
        ]
        floating += [
            Pair(next(fresh), "W", full.frame, full.links[i].name, point=(0, 0, 0), axis=(0, 0, 1))
            for i in self._welded
        ]
        pairs, links = [full.pairs[k] for k in self.pairs], [Link(full.links[i].name) for i in self.links]
        own = {name for pair in pairs for name in pair.freedom_names}
        start = {name: value for name, value in full.start.items() if name in own}
        return Mechanism(
            full.name,
            links,
            [*pairs, *floating],
            couplings=full.couplings,
            frame=full.frame,
            start=start,
            units=full.units,
        )

    # --- numbers -----------------------------------------------------------------------------------------------------

    def reduced(self, full: System) -> ReducedSystem:
        """The reduced form of a system, with its numbers (those of variants, where it has these)."""
        par, floats = full.par, identity(len(self.plan.afloat) + len(self._welded), 1)
        numbers = replace(
            par,
            marker_a=_joined(par.marker_a[:, :, self.pairs], floats, 2),
            marker_b=_joined(par.marker_b[:, :, self.pairs], floats, 2),
            pitch=_joined(par.pitch[self.pairs], np.zeros((floats.shape[2], 1)), 0),
            mass=par.mass[self.links],
            center=par.center[:, self.links],
            inertia=par.inertia[:, :, self.links],
            offset=par.offset[:, self.links],
        )
        return ReducedSystem(self.m, numbers, self._points(par))

    def _points(self, par: Parameters) -> PointNumbers:
        """Of every rod one row, of every contact as many as there are directions in which it does not slide."""
        normals = [
            scipy.linalg.null_space(self._slides[k].T) if self._slides[k].size else np.eye(3) for k in self.plan.pairs
        ]
        many = np.repeat(self._contacts, [N.shape[1] for N in normals])
        across = np.concatenate([*normals, np.zeros((3, 0))], axis=1)
        ends, place = (
            np.stack([self.system.a, self.system.b]),
            np.searchsorted(self.links, np.arange(len(self.system.m.links))),
        )
        (first, second), (i, j) = self._ends, self._sides
        length, _, sense = self._lengths(par)
        return PointNumbers(
            a=place[np.concatenate([ends[1 - i, first], ends[0, many]])],
            b=place[np.concatenate([ends[1 - j, second], ends[1, many]])],
            at_a=_joined(_origins(par, first, 1 - i), par.marker_a[:, 3, many], 1),
            at_b=_joined(_origins(par, second, 1 - j), par.marker_b[:, 3, many], 1),
            length=length,
            slide=np.where(self._slide < 0, -1, np.searchsorted(self.pairs, self._slide)),
            sense=sense,
            normal=rotate(par.marker_a[:, :3, many], across[..., None]),
        )

    def _lengths(self, par: Parameters) -> tuple[Array, Array, Array]:
        """Of the rods the lengths ``(rods, B)`` with slides at zero, how far slides are off the lines, and their senses ``(rods, 1)``."""
        (first, second), (i, j), k = self._ends, self._sides, self._slide
        near, far = _origins(par, first, i), _origins(par, second, j)
        first_is_a = self.system.a[k] == self._inside[0]
        A, B = par.marker_a[:, :, k], par.marker_b[:, :, k]
        there = np.where(first_is_a[:, None], compose(A, inverse(B)), compose(B, inverse(A)))
        slides = k >= 0
        far = np.where(slides[:, None], rotate(there[:, :3], far) + there[:, 3], far)
        apart = far - near
        along = np.zeros((3, self.rods, 1))
        for n in np.flatnonzero(slides).tolist():
            along[:, n, 0] = self.system.m.pairs[k[n]].type.freedoms[0].twist[3:]
        along = np.where(first_is_a[:, None], rotate(A[:, :3], along), -rotate(B[:, :3], along))
        size, way = np.sqrt((apart * apart).sum(axis=0)), (apart * along).sum(axis=0)
        rows = self.system.single_rows[np.where(slides, self.system.first_column[k], 0)]
        begin = way[:, :1] + self._start.x[rows]
        sense = np.where(slides[:, None], np.where(begin < 0, -1.0, 1.0), 0.0)
        off = np.where(slides[:, None], np.sqrt((cross(apart, along) ** 2).sum(axis=0)), 0.0)
        return np.where(slides[:, None], sense * way, size), off, sense

    def holds(self, par: Parameters) -> bool:
        """Whether slides are on the lines of their rods with these numbers too."""
        length, off, _ = self._lengths(par)
        return bool((off <= ON_LINE * np.maximum(np.abs(length), 1.0)).all())

    # --- states ------------------------------------------------------------------------------------------------------

    def state_of(self, here: Configuration) -> Array:
        """States ``(nx, T)`` of the reduced form where the mechanism stands so."""
        D = compose(inverse(here.poses[:, :, [self.system.graph.frame]]), here.poses[:, :, list(self.plan.afloat)])
        floating = np.concatenate([D[:, 3], matrix_quaternion(D[:, :3])]).swapaxes(0, 1).reshape(-1, here.T)
        return np.concatenate([here.x[self._rows], floating])

    def rotations_of(self, here: Configuration) -> Array:
        """Rotations ``(3, 3, rods, T)`` of the rods where the mechanism stands so."""
        return here.poses[:, :3, self._inside[0]]

    def lifted(self, here: Configuration, full: System, R: Array) -> Array:
        """States ``(nx, T)`` of the full form where the reduced one stands so and its rods have the rotations ``R (3, 3, rods, T)``."""
        s, par = self.system, full.par
        x = np.empty((s.n_state, here.T))
        x[self._rows] = here.x[: len(self._rows)]
        poses = np.empty((3, 4, len(s.m.links), here.T))
        poses[:, :, self.links] = here.poses
        first = here.poses[:, :, self._outer]
        near, far = self._inside
        poses[:, :3, near] = R
        centre = rotate(first[:, :3], _origins(par, self._ends[0], 1 - self._sides[0])) + first[:, 3]
        poses[:, 3, near] = centre - rotate(R, _origins(par, self._ends[0], self._sides[0]))
        slides = np.flatnonzero(self._slide >= 0)
        if slides.size:
            a, b = (here.poses[:, :, np.searchsorted(self.links, on[slides])] for on in (near, far))
            poses[:, :, far[slides]] = compose(poses[:, :, near[slides]], compose(inverse(a), b))
        every = np.concatenate([*self._ends, self._contacts])
        A, B = (
            compose(poses[:, :, ends[every]], marker[:, :, every])
            for ends, marker in ((s.a, par.marker_a), (s.b, par.marker_b))
        )
        D = compose(inverse(A), B)
        for i, k in enumerate(every.tolist()):
            slid = self._slides[k].T @ D[:, 3, i] if k in self._slides else D[:0, 3, i]
            x[s.first_row[k] : s.first_row[k + 1] - 4] = slid
        last = s.first_row[every + 1] - 4 + np.arange(4)[:, None]
        x[last] = matrix_quaternion(D[:, :3])
        return x

    def spins(self, here: Configuration, u: Array) -> Array:
        """Rates ``(F, rods, T)`` in the full form of unit spins of the rods about ``u (3, rods, T)``."""
        out = np.zeros((self.system.n_freedoms, self.rods, here.T))
        for pairs, sides in zip(self._ends, self._sides, strict=True):
            columns = self.system.first_column[pairs] + np.arange(3)[:, None]
            turns = here.S[:3, columns]
            sense = np.where(sides == 1, 1.0, -1.0)[:, None]
            out[columns, np.arange(self.rods)] = sense * (turns * u[:, None]).sum(axis=0)
        return out


def _origins(par: Parameters, pairs: Index, sides: Index) -> Array:
    """Origins ``(3, n, B)`` of the markers on given sides of pairs, in the frames of their links."""
    return np.where(sides[:, None] == 0, par.marker_a[:, 3, pairs], par.marker_b[:, 3, pairs])


def _joined(first: Array, second: Array, axis: int) -> Array:
    """Both along an axis, the batch of one that has none spread over that of the other."""
    B = max(first.shape[-1], second.shape[-1])
    return np.concatenate([np.broadcast_to(v, (*v.shape[:-1], B)) for v in (first, second)], axis=axis)


def _ranges(first: Index, which: Index) -> Index:
    """The numbers that belong to some of the pairs, which begin at ``first``."""
    return np.concatenate([np.arange(first[k], first[k + 1]) for k in which] or [np.zeros(0, dtype=np.intp)]).astype(
        np.intp
    )


def reduction_of(start: Configuration, fixed: Index, passive: Sequence[PassiveMotion], form: str) -> Reduction | None:
    """The reduced form of a mechanism with the drivers ``fixed``, in which ``passive`` motions are left free.

    None where another motion than the spins of rods is left free, where too much stays for a dense engine, and, unless the ``form``
    asked for is ``"reduced"``, where no rod falls away. Measured (``tests/benchmarks/bench_rows.py``, 36 to 3,600 positions): with rods,
    whose spins the full form has to carry, a solution takes 0.4 to 0.9 times as long. With spheres alone (R-Sp-R, R-Sg-C, RCSR) it takes
    1.1 to 1.8 times as long, though the path itself takes 0.7 to 1: the full form is evaluated at every position anyway.
    """
    system = start.system
    if form == "full" or len(system.m.pairs) > FORM_PAIRS or not (form == "reduced" or may_have_rods(system)):
        return None
    kept = {int(k) for k in system.pair_of_freedom[np.concatenate([fixed, system.coupled_freedoms])]}
    plan = plan_of(start, kept)
    if not (plan.rods or (form == "reduced" and plan.pairs)):
        return None
    if sorted(motion.links for motion in passive) != sorted(tuple(sorted(rod.links)) for rod in plan.rods):
        return None
    found = Reduction(start, plan)
    return found if engine_for(found.reduced(system).n_rows, 1, "auto") == "dense" else None


NARROW = 0.2
"""Least ``1 + a . u`` of a step: an axis may turn by 140 degrees in it, far more than steps of fair size allow."""


@dataclass(frozen=True)
class _Steps:
    """Of rods in all steps: axes ``a (3, rods, n)`` and rotations ``R (3, 3, rods, n)`` where they begin, ``series (points, rods, n)`` of
    ``phi`` by a ``rule``.
    """

    rule: Rule
    a: Array
    R: Array
    series: Array

    def at(self, u: Array, step: Index, t: Array) -> Array:
        """Rotations ``(3, 3, rods, n)`` in steps at ``t`` from -1 to 1, where the axes are ``u (3, rods, n)``."""
        phi = np.einsum("grn,ng->rn", self.series[:, :, step], self.rule.integrals(t))
        return _product(_product(rotation_exp(phi * u), _least(self.a[:, :, step], u)), self.R[..., step])


class Rods:
    """The rods of a reduced form along the nodes of its tracks; ``R_0 (3, 3, rods, tracks)`` are the rotations where the tracks begin.

    ``clear``: whether the loops close all along, and all steps are so short that no axis comes near the opposite of where it was.
    """

    def __init__(
        self, path: DriverPath, follower: Follower, interpolation: Interpolation, rule: Rule, R_0: Array
    ) -> None:
        self._nodes, self._left, self._first = interpolation.nodes, interpolation.left, R_0
        nodes, left, right = interpolation.nodes, interpolation.left, interpolation.right
        self._h = nodes.place[right] - nodes.place[left]
        self._find, self._last, self._ends = interpolation.find, interpolation.last, follower.paths.end
        self.axes = axes(path.at(nodes.x, nodes.drive, nodes.track))[0]
        a, b = self.axes[:, :, left], self.axes[:, :, right]
        u, du, closed = _between(path, follower, interpolation, rule, self.axes[:, :, :0])
        many = np.repeat(a, rule.count, axis=2)
        wide = 1.0 + (many * u).sum(axis=0)
        self.clear = closed and bool(min(wide.min(initial=2.0), (1.0 + (a * b).sum(axis=0)).min(initial=2.0)) > NARROW)
        rate = (cross(many, u) * du).sum(axis=0) / wide
        series = np.einsum("rsg,gk,s->krs", rate.reshape(len(rate), len(left), rule.count), rule.to_series, self._h)
        over = _Steps(rule, a, np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, *a.shape[1:])), series)
        self._steps = _Steps(rule, a, self._begins(over.at(b, np.arange(len(left)), np.ones(len(left)))), series)

    def _begins(self, over: Array) -> Array:
        """Rotations where all steps begin, from those ``over (3, 3, rods, steps)`` each of them; backwards before the starts."""
        track, place = self._nodes.track[self._left], self._nodes.place[self._left]
        out = np.empty_like(over)
        turns = np.moveaxis(over, (0, 1), (-2, -1))
        R = np.moveaxis(self._first, (0, 1), (-2, -1))
        now = R[:, 0]
        for k in np.flatnonzero(place >= 0.0):
            if place[k] == 0.0:
                now = R[:, track[k]]
            out[:, :, :, k] = np.moveaxis(now, 0, -1)
            now = turns[:, k] @ now
        for k in np.flatnonzero(place < 0.0)[::-1]:
            if place[k + 1] == 0.0:
                now = R[:, track[k]]
            now = turns[:, k].swapaxes(-1, -2) @ now
            out[:, :, :, k] = np.moveaxis(now, 0, -1)
        return out

    def at(self, here: Configuration, track: Index, place: Array, turns: Index | int = 0) -> Array:
        """Rotations ``(3, 3, rods, n)`` at closed states of the reduced form, which lie at places of tracks, ``turns`` periods later."""
        u, moved = axes(here)[0], np.isin(track, self._nodes.track[self._left])
        out = self._first[..., track].copy()
        if moved.any():
            step = self._find(track[moved], place[moved])
            t = 2.0 * (place[moved] - self._nodes.place[self._left[step]]) / self._h[step] - 1.0
            out[..., moved] = self._steps.at(u[:, :, moved], step, t)
        if np.any(turns):
            out = _product(rotation_exp(turns * self.period[:, track] * u), out)
        return out

    @property
    def period(self) -> Array:
        """Angles ``(rods, tracks)`` by which rods are turned about their axes at the end of tracks that come back to where they start."""
        track = np.unique(self._nodes.track[self._left])
        out = np.zeros(self._first.shape[2:])
        last = self._last(track, self._ends) if len(track) else track
        u = self.axes[:, :, self._left[last] + 1]
        end, start = self._steps.at(u, last, np.ones(len(last))), self._first[..., track]
        turned = _product(end, np.swapaxes(start, 0, 1))
        sine = 0.5 * (
            np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) * u
        ).sum(axis=0)
        out[:, track] = np.arctan2(sine, 0.5 * (np.trace(turned) - 1.0))
        return out


def _between(
    path: DriverPath, follower: Follower, interpolation: Interpolation, rule: Rule, nothing: Array
) -> tuple[Array, Array, bool]:
    """Axes and their rates ``(3, rods, steps points)`` at the points of a rule in all steps, and whether all closed there."""
    found, count, done = [(nothing, nothing)], len(interpolation.left), True
    for steps in in_blocks(np.arange(count), BLOCK // rule.count) if count else []:
        closed, track, slope = at_points(interpolation, follower, rule, steps)
        here = path.at(closed.x, closed.x[path.rows], track)
        dq = (path.factored(here, closed.which).sensitivity() * slope).sum(axis=1)
        found.append(axes(here, dq))
        done &= bool((closed.done & (closed.correction <= PATH.correction)).all())
    u, du = (np.concatenate(part, axis=2) for part in zip(*found, strict=True))
    return u, du, done


def axes(here: Configuration, dq: Array | None = None) -> tuple[Array, Array]:
    """Axes ``u (3, rods, T)`` of the rods of a reduced form, and their rates for rates ``dq (F, T)``."""
    assert isinstance(here.system, ReducedSystem)
    points = here.system.points
    k = points.numbers
    u = points.lines(here)[1][3:, : len(k.length)]
    if dq is None:
        return u, np.zeros_like(u)
    V, ends = here.link_twists(dq), []
    for links, at in ((k.a, k.at_a), (k.b, k.at_b)):
        mine = slice(len(k.length))
        X, twist = here.poses[:, :, links[mine]], V[:, links[mine]]
        p = np.einsum("ijnt,jnt->int", X[:, :3], np.broadcast_to(at[:, mine], (3, len(k.length), here.T))) + X[:, 3]
        ends.append(twist[3:] + cross(twist[:3], p))
    d = ends[1] - ends[0]
    return u, (d - (d * u).sum(axis=0) * u) / points.lengths(here)


def _least(a: Array, u: Array) -> Array:
    """The least rotations ``(3, 3, ...)`` from unit vectors to others: ``1 + W + W^2 / (1 + a . u)``, ``W = (a x u)^``."""
    W = skew(cross(a, u))
    return np.eye(3).reshape(3, 3, *(1,) * (a.ndim - 1)) + W + _product(W, W) / (1.0 + (a * u).sum(axis=0))


def _product(A: Array, B: Array) -> Array:
    """Products of matrices ``(3, 3, ...)``."""
    return np.asarray(np.einsum("ij...,jk...->ik...", A, B))


def follow_reduced(
    path: DriverPath, form: Reduction, x: Array, values: Array, batch: tuple[int, ...], total: int
) -> Positions | None:
    """What ``following.follow`` finds from starts ``x (nx, V)``, NaN where there is none, with rods at rest in their spins.

    None where a rod turns too far from one node to the next to tell how it rests.
    """
    begun = np.flatnonzero(np.isfinite(x).all(axis=0))
    path.variant_of = np.arange(x.shape[1])
    start = Configuration(path.system_on(begun), x[:, begun])
    x_0, R_0 = np.full((form.n_state, x.shape[1]), np.nan), np.full((3, 3, form.rods, x.shape[1]), np.nan)
    x_0[:, begun], R_0[..., begun] = form.state_of(start), form.rotations_of(start)
    whole = path.system_on(path.variant_of)
    if not form.holds(whole.par):
        return None
    system = form.reduced(whole)
    small = DriverPath(system, closure_solver("dense", np.searchsorted(form.columns, path.columns)), system.cases)
    found = follow(small, requests(x_0, values, batch), total)
    path.variant_of = small.variant_of
    return _Lift(path, small, form, found, R_0[..., small.variant_of]).positions()


class _Lift:
    """Positions ``found`` on the path of the reduced form, in the full one."""

    def __init__(self, path: DriverPath, small: DriverPath, form: Reduction, found: Positions, R_0: Array) -> None:
        self.path, self.small, self.form, self.found = path, small, form, found
        self.rods = Rods(small, found.follower, *parts_of_steps(small, found), R_0)
        first = path.at(*self._state(found.tracks.nodes.take(np.array([0]))))
        self.which = int(path.chosen(first, np.full(1, -1))[0])

    def _state(self, nodes: Nodes) -> tuple[Array, Array, Index]:
        return self._lifted(nodes.x, nodes.drive, nodes.track, nodes.place), nodes.drive, nodes.track

    def _lifted(self, x: Array, drive: Array, track: Index, place: Array, turns: Index | int = 0) -> Array:
        here = self.small.at(x, drive, track)
        return self.form.lifted(here, self.path.system_on(track), self.rods.at(here, track, place, turns))

    def _nodes(self, nodes: Nodes) -> Nodes:
        """The same nodes with states, sensitivities and conditions of the full form."""
        x, drive, track = self._state(nodes)
        point, which = self.path.at(x, drive, track), np.full(len(nodes), self.which)
        f = self.path.factored(point, which)
        Z = self.path.sensitivity(point, f)
        return replace(nodes, x=x, Z=Z, which=which, condition=f.condition)

    def positions(self) -> Positions | None:
        """All of them; None where rods are not ``clear``."""
        if not self.rods.clear:
            return None
        found, path = self.found, self.path
        x = np.full((path.system.n_state, found.x.shape[1]), np.nan)
        turns = np.zeros(x.shape[1], dtype=np.intp) if found.turns is None else found.turns
        for at in in_blocks(np.flatnonzero(found.moved & (found.near < 0))):
            rows = found.x[self.small.rows][:, at]
            x[:, at] = self._lifted(found.x[:, at], rows, found.track[at], found.place[at], turns[at])
        follower = Follower(path)
        follower.paths = found.follower.paths
        out = replace(
            found,
            x=x,
            which=np.full(x.shape[1], self.which),
            here=None,
            tracks=replace(found.tracks, nodes=self._nodes(found.tracks.nodes)),
            follower=follower,
            crossings=[replace(c, problem=path, sides=self._nodes(c.sides)) for c in found.crossings],
        )
        if found.gained is not None:
            out.gained = np.zeros((path.system.n_freedoms, x.shape[1]))
            out.gained[self.form.columns] = found.gained[: len(self.form.columns)]
            nodes = out.tracks.nodes
            u = axes(self.small.at(found.tracks.nodes.x, nodes.drive, nodes.track))[0]
            spins = self.form.spins(path.at(nodes.x, nodes.drive, nodes.track), u)
            out.spin = np.einsum("frn,rn->fn", spins, self.rods.period[:, nodes.track])
        out.interpolate()
        return out
