"""The reduced form of a mechanism for following a path: rods and spheres in grooves or on planes as rows of points.

A rod (a link with two S pairs and nothing else, or two that slide along the line of theirs) holds two points at a distance; a pair that
ends in a rotation (S, Sg, Sp) holds the centre of a sphere in as many planes as there are directions in which it does not slide. These
links and pairs fall away, and with them loops of six rows each: a smaller mechanism is left with ``closure.point_rows`` behind its own
rows. A link that nothing joins to the frame any more floats: it has a pair of six freedoms.

The twists of what falls away span ``6 - k`` dimensions at every position, reciprocal to the wrenches of its ``k`` rows of points (a rod
has six freedoms, one of them its spin). So in rows turned by these the closure matrix is ``[[B, *], [0, K]]``, ``B`` regular and ``K`` that
of the reduced form: one form is singular where the other is. No coordinate that falls away or comes in has a chart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import count

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array, compose, cross, identity, inverse, matrix_quaternion, rotate
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.point_rows import PointNumbers, PointRows
from mechgraph.closure.reduction_plan import ON_LINE, Plan, may_have_rods, plan_of, slides_of_sphere
from mechgraph.closure.rows import PositionRows
from mechgraph.closure.solver import engine_for
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.model.parameters import Parameters
from mechgraph.pairs.pair_type import PairType

FORMS = ("auto", "full", "reduced")
"""The forms of the equations by which a path may be followed; ``"auto"``: the faster one."""
FORM_PAIRS = 2000
"""Pairs above which no reduced form is looked for: more of it would stay than a dense engine does well."""


Mask = NDArray[np.bool_]


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
