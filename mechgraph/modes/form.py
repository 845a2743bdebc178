"""The closure as a homotopy sees it: whole, or without its rods.

Rods in the closure equations of assemblies: two points at a distance as one row each, polynomial in the poses of the links.

    ((p_b - p_a)^2 - l^2) / 2 = 0

Members of a class have other points and lengths; the squares ``l^2`` stand behind the values of the drivers.

The equations in which assemblies are looked for: those of the mechanism, or of what is left of it without its rods.

A rod is a chain of links with a ball at its one end and a ball or two turns at the other, in which all between is driven or welded (S-S,
S-P-S, U-P-S). Over the complex numbers all that it does is to keep two points at a distance, as both ends turn so that they point at
each other wherever the bodies are that it joins. So it falls away, and with it its loops of six rows, for one row;
a body that nothing else joins to the frame floats on a pair of six freedoms. A rod that holds nothing that others do not hold has no
row: an assembly in which it does not fit is none of the mechanism. Put back, a ball turns as little as it can; two turns take a
rod to its direction in two ways, which are two assemblies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cache, cached_property
from itertools import count
from operator import itemgetter
from typing import NamedTuple, Protocol, cast

import numpy as np

from mechgraph.determinacy.decomposition import MOST_SPLIT, Constraint, Constraints, rows_of_pair, smallest
from mechgraph.errors import counted
from mechgraph.graph.linkgraph import LinkGraph, components_of_edges
from mechgraph.kinematics.rows import Evaluated, Rows
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array as Reals
from mechgraph.maths.se3 import (
    Index,
    Mask,
    compose,
    cross,
    identity,
    inverse,
    matrix_quaternion,
    quaternion_matrix,
    quaternion_product,
    rotate,
)
from mechgraph.maths.tolerances import MODES, RANKS
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.model.parameters import Parameters
from mechgraph.modes.family import Array, Family, generated
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.pair_type import PairType


@dataclass(frozen=True)
class RodPoints:
    """Rods between links ``a, b (n,)``, from points ``at_a`` to ``at_b (3, n, B)`` in their frames, and squares ``l^2 (n, B)``.

    ``on_rod (2, 3, n, B)`` are their ends on the rods, where these are known.
    """

    a: Index
    b: Index
    at_a: Array
    at_b: Array
    squares: Array
    on_rod: Array | None = None


class RodRows(Rows):
    """``(d^2 - l^2) / 2`` of every rod, polynomial in the poses; ``way (n, F)``: the freedoms between both links, with signs.

    They are rows of positions alone. Where the end b has moved by ``e`` more than the end a from where it is on the rod, they are
    ``e . (2 d - e) / 2``: of long rods no digits are lost that way. Their rate is the relative twist of the links on the line of ``d``
    through ``p_b``: ``phi' = W . (V_b - V_a)``, ``W = (p_b x d, d)``.
    """

    def __init__(self, points: RodPoints, way: Reals, first: int) -> None:
        self.points, self.way, self.scale = points, way, np.ones((len(way), 1))
        self.places = slice(first, first + len(way))

    def lines(self, here: Evaluated) -> tuple[Reals, Reals]:
        """``phi (n, T)`` and ``W (6, n, T)``."""
        k = self.points
        A, B = here.poses.take(k.a, axis=2), here.poses.take(k.b, axis=2)
        p, a = rotate(B[:, :3], k.at_b) + B[:, 3], rotate(A[:, :3], k.at_a) + A[:, 3]
        d, W = p - a, np.concatenate([cross(p, p - a), p - a])
        if k.on_rod is None:
            return 0.5 * ((d * d).sum(axis=0) - k.squares), W
        e = (p - k.on_rod[1]) - (a - k.on_rod[0])
        return 0.5 * (e * (2.0 * d - e)).sum(axis=0), W

    def residual(self, here: Evaluated) -> Reals:
        """``phi (n, T)``."""
        return self.lines(here)[0]

    def jacobian(self, here: Evaluated) -> Reals:
        """``W . S`` in the freedoms between both links."""
        return ((self.lines(here)[1].transpose(2, 1, 0) @ here.S.transpose(2, 0, 1)) * self.way).transpose(1, 2, 0)


class RodSystem(System):
    """A mechanism with rows of rods behind its own; their points and squares of lengths are numbers as its markers are."""

    def __init__(self, m: Mechanism, graph: LinkGraph | None, par: Parameters, points: RodPoints) -> None:
        super().__init__(m, graph, par)
        self.points = points

    @cached_property
    def rod_rows(self) -> RodRows:
        """The rows of rods."""
        first = self.graph.loop_rows + len(self.m.couplings)
        return RodRows(self.points, self.ways[:, self.pair_of_freedom], first)

    @cached_property
    def ways(self) -> Reals:
        """Pairs ``(n, P)`` between the links of every rod, with signs."""
        paths = np.zeros((len(self.m.links), len(self.m.pairs)))
        for pair, sign, parent, child in self.graph.tree:
            paths[child] = paths[parent]
            paths[child, pair] = sign
        return np.asarray(paths[self.points.b] - paths[self.points.a])

    def way(self, rod: int) -> list[tuple[int, int]]:
        """Pairs with their signs along the tree from link a of a rod to link b."""
        before = {child: (pair, sign, parent) for pair, sign, parent, child in self.graph.tree}
        ways: list[list[tuple[int, int]]] = []
        for link in (int(self.points.a[rod]), int(self.points.b[rod])):
            steps = []
            while link in before:
                pair, sign, link = before[link]
                steps.append((pair, sign))
            ways.append(steps)
        up, down = ways
        while up and down and up[-1] == down[-1]:
            up.pop()
            down.pop()
        return [(pair, -sign) for pair, sign in up] + down[::-1]

    @cached_property
    def position_rows(self) -> Sequence[Rows]:
        """Those of loops and of rods."""
        return [*self.rows, self.rod_rows]

    def with_points(self, points: RodPoints) -> RodSystem:
        """The same with other points and lengths; all else that is known of it is taken over."""
        out = RodSystem(self.m, self.graph, self.par, points)
        for name in ("numbers", "ways"):
            vars(out)[name] = getattr(self, name)
        return out

    def cases(self, which: Index) -> System:
        """See there; points and lengths too."""
        k, out = self.points, super().cases(which)
        if k.squares.shape[1] == 1:
            return out
        on_rod = None if k.on_rod is None else k.on_rod[..., which]
        points = RodPoints(k.a, k.b, k.at_a[..., which], k.at_b[..., which], k.squares[..., which], on_rod)
        return cast("RodSystem", out).with_points(points)

    def with_parameters(self, par: Parameters) -> RodSystem:
        """The same with other markers."""
        out = RodSystem(self.m, self.graph, par, self.points)
        vars(out)["ways"] = self.ways
        return out


class RodFamily(Family):
    """The class of a mechanism with rods: points that are one on a body stay one, all else of points and lengths is free.

    ``same (2 n,)`` are numbers that points which are one share; left out, points at the same place of a link are one.
    """

    system: RodSystem

    def __init__(
        self, here: Configuration, columns: Index, idle: Array, held: Index, same: Index | None = None
    ) -> None:
        super().__init__(here, columns, idle, held)
        k, self._same = self.system.points, same
        self.rods = len(k.a)
        self.bearers = np.concatenate([self.bearers, k.a, k.b])
        points = identity(2 * self.rods, 1).astype(complex)
        points[:, 3] = np.concatenate([k.at_a, k.at_b], axis=1)
        self.target = np.concatenate([self.target, points], axis=2)

    @cached_property
    def joints(self) -> Index:
        """For every point ``(2 n,)``, those on links a first, the first one that is the same point of the same link."""
        if self._same is not None:
            return np.asarray(np.argmax(self._same[:, None] == self._same, axis=1))
        k = self.system.points
        links, at = np.concatenate([k.a, k.b]), np.concatenate([k.at_a, k.at_b], axis=1)[:, :, 0]
        same = (np.abs(at[:, :, None] - at[:, None]).max(axis=0) < MODES.span) & (links[:, None] == links)
        return np.asarray(np.argmax(same, axis=0))

    @property
    def points(self) -> list[list[int]]:
        """See there."""
        return [self.system.points.a.tolist(), self.system.points.b.tolist(), self.joints.tolist()]

    @cached_property
    def algebras(self) -> list[Array]:
        """Markers of pairs that no loop holds may go anywhere."""
        held = {pair for loop in self.system.graph.loops for pair, _ in loop}
        return [basis if pair in held else np.eye(6) for pair, basis in enumerate(super().algebras)]

    @property
    def bases(self) -> list[Array]:
        """Points go along all directions."""
        return [*super().bases, *[np.eye(6)[:, 3:]] * (2 * self.rods)]

    @property
    def moved_as(self) -> Index:
        """Points that are one move as one."""
        markers = super().moved_as
        return np.concatenate([markers, len(markers) + self.joints])

    @property
    def rank(self) -> int:
        """That of the loops, and one a rod."""
        return super().rank + self.rods

    @property
    def independent(self) -> bool:
        """See there."""
        return rank_of(singular_values(self.here.J[:, self.free, 0]), RANKS.position) == self.rank

    def system_with(self, markers: Array, drive: Array) -> System:
        """The system with other markers and points ``(3, 4, 2 P + 2 n, B)``, and squares of lengths behind the drivers."""
        n, s = self.rods, self.system
        at = markers[:, 3, -2 * n :]
        points = replace(s.points, at_a=at[:, :n], at_b=at[:, n:], squares=drive[-n:])
        if self.still:
            return s.with_points(points)
        moved = super().system_with(markers[:, :, : -2 * n], drive)
        return cast("RodSystem", moved).with_points(points)

    @cached_property
    def still(self) -> bool:
        """Whether members have the same markers, as all pairs that are left float."""
        return not any(basis.size for basis in self.moving)

    def drive_of(self, markers: Array, x: Array) -> Array:
        """Drivers, and squares of the lengths that the points have."""
        here = Configuration(self.system_with(markers, np.zeros((self.rods, 1))), x)
        return np.concatenate([super().drive_of(markers, x), 2.0 * _rows(here).residual(here)])

    def random_drive(self, rng: np.random.Generator) -> Array:
        """Random drivers and squares of lengths."""
        squares = 2.0 * rng.normal(size=(self.rods, 2)) @ [1.0, 1.0j]
        return np.concatenate([super().random_drive(rng), squares])

    def lengths_of(self, drive: Array) -> Array:
        """See there."""
        return np.concatenate([np.zeros_like(drive[: -self.rods]), drive[-self.rods :]])

    def open_by(self, here: Configuration, V: Array, change: Array) -> Array:
        """Points too open rows, and squares of lengths do."""
        n, P = self.rods, len(self.system.m.pairs)
        out = super().open_by(here, V[:, : -2 * n], change)
        W = _rows(here).lines(here)[1]
        moved = np.einsum("np,ipt->int", self.system.ways, V[:, :P] - V[:, P : 2 * P]) + V[:, -n:] - V[:, -2 * n : -n]
        out[-n:] += (W * moved).sum(axis=0) - 0.5 * change[-n:]
        return out


def _rows(here: Configuration) -> RodRows:
    assert isinstance(here.system, RodSystem)
    return here.system.rod_rows


@cache
def floating_type() -> PairType:
    """A pair that holds nothing, with a rotation that has no chart."""
    return PairType("floating", freedoms=["Tx", "Ty", "Tz", "rotation"], reactions=[])


class EquationForm(Protocol):
    """Equations of a class, at given positions."""

    family: Family
    drive: Array
    """Values ``(d, n)`` of the drivers of the class at all positions."""
    given: Array
    """The same of the drivers of the mechanism."""
    told: tuple[str, ...]
    """What is to be said of them, in words."""
    spare: int
    """Rods without a row, which may not fit where they are put back."""
    turning: list[RodChain]
    """Rods that stand in two ways each, on universal joints."""
    ways: int
    """In how many ways rods can be put back."""

    def at(self, position: int) -> System:
        """The system at a position."""

    def driven(self, given: Array) -> EquationForm:
        """The same at other positions, values ``given (d, n)`` of the drivers of the mechanism."""

    def lifted(self, x: Array, position: int, ways: int | None = None) -> Array:
        """States ``(nx, ways M)`` of the mechanism from those ``(nx, M)`` found; complex where rods cannot be put back with real numbers.

        First stand those of the way that is nearest to the start for every rod; of all ways where not so many are asked for.
        """


class Whole:
    """All of the mechanism."""

    def __init__(self, family: Family, drive: Array) -> None:
        self.family, self.drive, self.given = family, drive, drive
        self.told: tuple[str, ...] = ()
        self.turning = list[RodChain]()
        self.spare, self.ways = 0, 1

    def at(self, position: int) -> System:
        """The mechanism, of which drivers are freedoms."""
        return self.family.system

    def driven(self, given: Array) -> Whole:
        """See there."""
        return Whole(self.family, given)

    def lifted(self, x: Array, position: int, ways: int | None = None) -> Array:
        """The same."""
        return x


class RodStep(NamedTuple):
    """A pair on the way along a rod, from its link a to b (``sign`` 1) or back."""

    pair: int
    sign: int


class RodChain(NamedTuple):
    """A chain of links between two bodies: its pairs, of which the last is a ball, the links on the way, and the bodies."""

    steps: tuple[RodStep, ...]
    links: tuple[int, ...]
    bodies: tuple[int, int]


def rods_of(system: System, columns: Index) -> list[RodChain]:
    """The rods of a mechanism with freedoms ``columns`` at rest; no pair and no link belongs to two."""
    driven, rows = set(columns.tolist()), [pair.type for pair in system.m.pairs]
    at: list[list[RodStep]] = [[] for _ in system.m.links]
    for k, (a, b) in enumerate(system.graph.ends):
        at[a].append(RodStep(k, 1))
        at[b].append(RodStep(k, -1))
    ends = {k for k, row in enumerate(rows) if _points(row) and driven.isdisjoint(_columns(system, k))}
    out: list[RodChain] = []
    for k in sorted(ends, key=lambda k: is_ball(rows[k])):
        for body, sign in zip(system.graph.ends[k], (1, -1), strict=True):
            if k not in ends:
                continue
            steps, links = [RodStep(k, sign)], [sum(system.graph.ends[k]) - body]
            while len(at[links[-1]]) == 2 and links[-1] != system.graph.frame:
                steps.append(next(step for step in at[links[-1]] if step.pair != steps[-1].pair))
                links.append(sum(system.graph.ends[steps[-1].pair]) - links[-1])
                if not driven.issuperset(_columns(system, steps[-1].pair)):
                    break
            last = steps[-1].pair
            # the first end may have two turns, as ends are taken in that order; the second is a ball
            if len(steps) > 1 and last in ends and is_ball(rows[last]) and links[-1] not in links[:-1]:
                out.append(RodChain(tuple(steps), tuple(links[:-1]), (body, links[-1])))
                ends -= {k, last}
    return out


def behind(system: System, step: RodStep, x: Array) -> Array:
    """Pose ``(3, 4, T)`` of the link behind a pair, seen from the link before it, at states ``x (nx, T)``."""
    par, pair = system.par, step.pair
    row, states = system.m.pairs[pair].type.scaled(par.L), x[system.first_row[pair] : system.first_row[pair + 1], None]
    moved = evaluation.frames_of(row, par.pitch[[pair]], states)[-1][:, :, 0] if row.steps else identity(x.shape[1])
    D = compose(compose(par.marker_a[:, :, pair], moved), inverse(par.marker_b[:, :, pair]))
    return D if step.sign > 0 else inverse(D)


def _columns(system: System, pair: int) -> range:
    return range(system.first_column[pair], system.first_column[pair + 1])


def is_ball(row: PairType) -> bool:
    """Whether a pair does nothing but turn about one point, without a chart."""
    return len(row.steps) == 1 and row.steps[0].holds_rotation


def _points(row: PairType) -> bool:
    """Whether a pair can point anywhere about one point and does nothing else: a ball, or two turns about different axes."""
    if is_ball(row):
        return True
    twists = np.array([f.twist for f in row.freedoms])
    return (
        len(row.steps) == len(row.freedoms) == 2
        and not twists[:, 3:].any()
        and bool(np.linalg.norm(np.cross(*twists[:, :3])) > MODES.span)
    )


class WithoutRods:
    """What is left of the mechanism of a class, with drivers at ``drive (d, n)``, when ``rods`` fall away, of which ``rows`` have rows."""

    def __init__(self, whole: Family, drive: Array, rods: list[RodChain], rows: list[RodChain]) -> None:
        self.start, self.full, self._rows = whole.here, whole.system, whole.rows
        self.given = drive
        s = self.full
        inner = [s.graph.frame, *(link for rod in rods for link in rod.links)]
        self.links = np.array([s.graph.frame, *np.setdiff1d(np.arange(len(s.m.links)), inner)], dtype=np.intp)
        self.place = np.full(len(s.m.links), -1, dtype=np.intp)
        self.place[self.links] = np.arange(len(self.links))
        self.pairs = np.setdiff1d(np.arange(len(s.m.pairs)), [step.pair for rod in rods for step in rod.steps])
        part = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in self.pairs])[self.links]
        first = np.unique(part, return_index=True)[1]
        self.afloat = self.links[np.sort(first[first > 0])]
        self.rods, self._all, self.spare = rows, rods, len(rods) - len(rows)
        self.state_rows, self.kept = (
            np.array([i for k in self.pairs for i in range(to[k], to[k + 1])], dtype=np.intp)
            for to in (s.first_row, s.first_column)
        )
        self._own = np.isin(whole.columns, self.kept)
        self.drive = np.concatenate([drive[self._own], self._squares()])
        self.turning = [rod for rod in rods if not is_ball(s.m.pairs[rod.steps[0].pair].type)]
        self.ways = 2 ** len(self.turning)
        self.told: tuple[str, ...] = ()
        if self.turning:
            legs = counted(len(self.turning), "leg")
            self.told += (
                f"Universal joints carry {legs}, each in two ways (the cross turned by half a turn or not): a posture can be put together "
                f"in {self.ways} ways.",
            )
        if self.spare:
            self.told += (
                f"Left out: {counted(self.spare, 'rod')} of what others hold too; assemblies are those in which it closes again.",
            )
        self._small = self._mechanism()
        here = Configuration(self.at(0), self._state())
        columns, held = (np.searchsorted(self.kept, of[np.isin(of, self.kept)]) for of in (whole.columns, whole.held))
        self.family: Family = (RodFamily if self.rods else Family)(here, columns, self._passive(here, whole.idle), held)

    @property
    def needed(self) -> list[RodChain]:
        """The rods of which the rows do not depend on those of loops and of rods before."""
        J, n, out = self.family.here.J[:, self.family.free, 0], len(self.rods), []
        held = J[: len(J) - n]
        for rod, row in zip(self.rods, J[len(J) - n :], strict=True):
            more = np.concatenate([held, row[None]])
            if rank_of(singular_values(more), RANKS.position) > rank_of(singular_values(held), RANKS.position):
                held = more
                out.append(rod)
        return out

    # --- numbers -----------------------------------------------------------------------------------------------------

    def _points(self, rod: RodChain) -> list[tuple[int, Array]]:
        """The points ``(3,)`` of a rod in the frames of its bodies, with the places of these."""
        out = []
        for body, step, outside in zip(rod.bodies, (rod.steps[0], rod.steps[-1]), (1, -1), strict=True):
            marker = self.full.par.marker_a if step.sign == outside else self.full.par.marker_b
            out.append((int(self.place[body]), marker[:, 3, step.pair, 0]))
        return out

    def _inside(self, rod: RodChain, x: Array) -> tuple[Array, Array]:
        """From the first link of a rod to its last ``(3, 4, T)``, and the way between its ends ``(3, T)`` seen from the first."""
        C = identity(x.shape[1])
        for step in rod.steps[1:-1]:
            C = compose(C, behind(self.full, step, x))
        par, (near, far) = self.full.par, (rod.steps[0], rod.steps[-1])
        begin = (par.marker_b if near.sign > 0 else par.marker_a)[:, 3, near.pair]
        end = (par.marker_a if far.sign > 0 else par.marker_b)[:, 3, far.pair]
        return C, rotate(C[:, :3], end) + C[:, 3] - begin

    def _driven(self, drive: Array) -> Array:
        """The start ``(nx, n)`` with drivers at ``drive (d, n)``."""
        x = np.repeat(self.start.x[:, :1], drive.shape[1], axis=1)
        x[self._rows] = drive
        return x

    def _squares(self) -> Array:
        """Squares ``(rods, n)`` of the lengths of the rods at all positions."""
        x = self._driven(self.given)
        squares = [(d * d).sum(axis=0) for _, d in (self._inside(rod, x) for rod in self.rods)]
        return np.array(squares).reshape(len(self.rods), x.shape[1])

    def _mechanism(self) -> System:
        """What is left, and points of rods, whose lengths are those of the first position."""
        full, par = self.full.m, self.full.par
        taken = {pair.name for pair in full.pairs}
        fresh = (name for i in count() if (name := f"floating{i}") not in taken)
        floating = [
            Pair(next(fresh), floating_type(), full.frame, full.links[i].name, point=(0, 0, 0), axis=(0, 0, 1))
            for i in self.afloat.tolist()
        ]
        left = Mechanism(
            full.name,
            [Link(full.links[i].name) for i in self.links],
            [*(full.pairs[k] for k in self.pairs), *floating],
            frame=full.frame,
        )
        still = identity(len(floating), 1)
        numbers = replace(
            par,
            marker_a=np.concatenate([par.marker_a[:, :, self.pairs], still], axis=2),
            marker_b=np.concatenate([par.marker_b[:, :, self.pairs], still], axis=2),
            pitch=np.concatenate([par.pitch[self.pairs], np.zeros((len(floating), 1))]),
            mass=par.mass[self.links],
            center=par.center[:, self.links],
            inertia=par.inertia[:, :, self.links],
            offset=par.offset[:, self.links],
        )
        if not self.rods:
            return System(left, None, numbers)
        ends = list(zip(*(sorted(self._points(rod), key=itemgetter(0)) for rod in self.rods), strict=True))
        (a, at_a), (b, at_b) = (
            (np.array([place for place, _ in side]), np.stack([at for _, at in side], axis=1)[..., None])
            for side in ends
        )
        points = RodPoints(a, b, at_a, at_b, self.drive[-len(self.rods) :, :1])
        return RodSystem(left, None, numbers, points)

    def at(self, position: int) -> System:
        """What is left at a position."""
        s = self._small
        if not isinstance(s, RodSystem):
            return s
        return s.with_points(replace(s.points, squares=self.drive[-len(self.rods) :, [position]]))

    def driven(self, given: Array) -> WithoutRods:
        """See ``EquationForm``."""
        out = copy(self)
        out.given = given
        out.drive = np.concatenate([given[self._own], out._squares()])
        return out

    # --- states ------------------------------------------------------------------------------------------------------

    def _state(self) -> Array:
        """The state ``(nx, 1)`` of what is left at the start."""
        D = compose(inverse(self.start.poses[:, :, [self.full.graph.frame]]), self.start.poses[:, :, self.afloat])
        floating = np.concatenate([D[:, 3], matrix_quaternion(D[:, :3])]).swapaxes(0, 1).reshape(-1, 1)
        return np.concatenate([self.start.x[self.state_rows], floating])

    def _passive(self, here: Configuration, rates: Array) -> Array:
        """Passive motions ``(F, p)`` of what is left, of those ``rates`` of the mechanism."""
        out, s = np.zeros((here.system.n_freedoms, rates.shape[1])), here.system
        out[: len(self.kept)] = rates[self.kept]
        for i, rate in enumerate(rates.T):
            V = self.start.link_twists(rate[:, None])[:, :, 0]
            for k, link in enumerate(self.afloat.tolist(), len(self.pairs)):
                at = slice(s.first_column[k], s.first_column[k + 1])
                out[at, i] = np.linalg.solve(here.S[:, at, 0], V[:, link])
        return out[:, np.abs(out).max(axis=0, initial=0.0) > MODES.span]

    def lifted(self, x: Array, position: int, ways: int | None = None) -> Array:
        """States of the mechanism: balls and turns of the rods put back one after the other."""
        way = np.repeat(np.arange(ways or self.ways), x.shape[1])
        x = np.tile(x, ways or self.ways)
        here = Configuration(self.at(position), x)
        out = np.repeat(self._driven(self.given[:, [position]]), x.shape[1], axis=1).astype(complex)
        out[self.state_rows] = x[: len(self.state_rows)]
        begin = out.copy()
        with np.errstate(all="ignore"):
            for rod in self._all:
                other = way >> self.turning.index(rod) & 1 == 1 if rod in self.turning else way < 0
                self._put_back(rod, here, out, begin, other)
        return out

    def _put_back(self, rod: RodChain, here: Configuration, out: Array, begin: Array, other: Mask) -> None:
        """The numbers of a rod in states ``out``, near those where it ``begin``s, or the ``other`` way."""
        s, par = self.full, self.full.par
        near, far = rod.steps[0], rod.steps[-1]
        bodies = [here.poses[:, :, self.place[body]] for body in rod.bodies]
        (_, at_a), (_, at_b) = self._points(rod)
        d = (
            rotate(bodies[1][:, :3], at_b[:, None])
            + bodies[1][:, 3]
            - rotate(bodies[0][:, :3], at_a[:, None])
            - bodies[0][:, 3]
        )
        C, inside = self._inside(rod, out)
        # directions in the markers on the body and on the rod
        outer, inner = (par.marker_a, par.marker_b) if near.sign > 0 else (par.marker_b, par.marker_a)
        to = rotate(inverse(compose(bodies[0], outer[:, :, near.pair]))[:, :3], d)
        of = rotate(inverse(inner[:, :, near.pair])[:, :3], inside)
        if near.sign < 0:
            to, of = of, to
        rows = slice(s.first_row[near.pair], s.first_row[near.pair + 1])
        row = s.m.pairs[near.pair].type
        out[rows] = least_turn(of, to, begin[rows]) if is_ball(row) else two_turns(row, of, to, begin[rows], other)
        # the ball at the other end, from both its markers
        last = compose(compose(bodies[0], behind(self.full, near, out)), C)
        A, B = (last, bodies[1]) if far.sign > 0 else (bodies[1], last)
        D = compose(inverse(compose(A, par.marker_a[:, :, far.pair])), compose(B, par.marker_b[:, :, far.pair]))
        out[s.first_row[far.pair] : s.first_row[far.pair + 1]] = matrix_quaternion(D[:, :3])


def _unit(v: Array) -> Array:
    return np.asarray(v / np.sqrt((v * v).sum(axis=0)))


def least_turn(of: Array, to: Array, begin: Array) -> Array:
    """Quaternions ``(4, T)`` that take directions ``of`` to those ``to (3, T)`` by the least turn from where they ``begin``."""
    a, u = np.broadcast_arrays(_unit(rotate(quaternion_matrix(begin), of)), _unit(to))
    cosine = (a * u).sum(axis=0)
    # half a turn about any line across
    across = _unit(cross(a, np.eye(3)[np.argmin(np.abs(a), axis=0)].T.astype(complex)))
    least = np.concatenate([(1.0 + cosine)[None], cross(a, u)]) / np.sqrt(2.0 * (1.0 + cosine))
    half = np.concatenate([np.zeros_like(cosine)[None], across])
    return quaternion_product(np.where(np.abs(1.0 + cosine) < MODES.span, half, least), begin)


def two_turns(row: PairType, of: Array, to: Array, begin: Array, other: Mask) -> Array:
    """Angles ``(2, T)`` that take directions ``of`` to those ``to (3, T)``: the way nearer to where they ``begin``, or the other one.

    With ``e`` and ``g`` the directions and ``v`` the one between the turns: ``v . w_2 = e . w_2``, ``v . w_1 = g . w_1``, ``v^2 = e^2``.
    Source: Paden, Kinematics and Control of Robot Manipulators, 1986, subproblem 2.
    """
    first, second = (np.array(f.twist[:3])[:, None] for f in row.freedoms)
    e, g = np.broadcast_arrays(_unit(of), _unit(to))
    c, p, q = (first * second).sum(), (first * g).sum(axis=0), (second * e).sum(axis=0)
    alpha, beta = (p - c * q) / (1 - c * c), (q - c * p) / (1 - c * c)
    across = np.sqrt((1.0 - alpha**2 - beta**2 - 2 * alpha * beta * c + 0j) / (1 - c * c))
    normal = np.cross(first, second, axis=0)
    ways = []
    for sign in (1.0, -1.0):
        v = alpha * first + beta * second + sign * across * normal
        ways.append(np.stack([angle_about(v, g, first), angle_about(e, v, second)]))
    apart = [np.abs(np.exp(1j * way) - np.exp(1j * begin)).max(axis=0) for way in ways]
    # of two that are as near but for rounding the first
    return np.where((apart[0] <= apart[1] + 1e-9) ^ other, *ways)


def angle_about(a: Array, b: Array, axis: Array) -> Array:
    """Angles ``(T,)`` by which ``a`` turns about a unit ``axis`` into ``b``."""
    a, b = (v - axis * (axis * v).sum(axis=0) for v in (a, b))
    cosine, sine = (v / (a * a).sum(axis=0) for v in ((a * b).sum(axis=0), (axis * np.cross(a, b, axis=0)).sum(axis=0)))
    # exp(i angle) and exp(-i angle): the smaller one has lost its digits
    ahead, back = cosine + 1j * sine, cosine - 1j * sine
    return np.where(np.abs(ahead) >= np.abs(back), -1j * np.log(ahead), 1j * np.log(back))


def is_one_group(family: Family) -> bool:
    """Whether all pairs of a class have to be solved together, as far as that is looked for: of one loop, or up to ``MOST_SPLIT`` links."""
    s = family.system
    if s.graph.n_loops <= 1:
        return True
    pairs, _, known = next(sets_of(family), ((), (), ()))
    return len(pairs) + len(known) == len(s.m.pairs) and len(s.m.links) <= MOST_SPLIT


def sets_of(family: Family) -> Iterator[tuple[Index, Index, Index]]:
    """Pairs and rods of the groups, one after the other, with the pairs known before."""
    s, rows = family.system, _constraints(family)
    columns = [range(s.first_column[k], s.first_column[k + 1]) for k in range(len(s.m.pairs))]
    free = set(family.free.tolist())
    known = {k for k, own in enumerate(columns) if free.isdisjoint(own)}
    rods = list(zip(*family.points[:2], strict=True))
    left = set(range(len(rods)))
    while len(known) < len(columns):
        before = np.array(sorted(known), dtype=np.intp)
        body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in before])
        unknown = [k for k in range(len(columns)) if k not in known]
        mine = _smallest(rows, body, [s.graph.ends[k] for k in unknown], int(body[s.graph.frame]))
        pairs = [k for k in unknown if mine.issuperset(body[list(s.graph.ends[k])].tolist())]
        own = [i for i in sorted(left) if mine.issuperset(body[list(rods[i])].tolist())]
        yield np.array(pairs, dtype=np.intp), np.array(own, dtype=np.intp), before
        known.update(pairs)
        left.difference_update(own)


def _smallest(rows: Constraints, body: Index, unknown: list[tuple[int, int]], frame: int) -> set[int]:
    """The smallest set of bodies that determine each other, that of the frame with them if it has one; all where there is none."""
    count = int(body.max()) + 1
    every = set(range(count))
    if count > MOST_SPLIT:
        return every
    merged = _merged(rows, body)
    for root in sorted(every, key=lambda i: i != frame):
        mine = smallest(merged, merged.determined(every - {root}, {root}), {root}) | {root}
        joined = [(int(body[a]), int(body[b])) for a, b in unknown if mine.issuperset(body[[a, b]].tolist())]
        if 1 < len(mine) < count and len({components_of_edges(count, joined)[i] for i in mine}) == 1:
            return mine
    return every


def _constraints(family: Family) -> Constraints:
    """What pairs, rods and passive motions, which rest, ask of the motions of links."""
    here, s = family.here, family.system
    S = here.S[:, :, 0]
    T = generated(S)
    free = np.zeros(s.n_freedoms, dtype=bool)
    free[family.free] = True
    out = []
    for k, (a, b) in enumerate(s.graph.ends):
        own = np.arange(s.first_column[k], s.first_column[k + 1])
        row = rows_of_pair(S[:, own[free[own]]], T)
        out.append(Constraint(k, {a: -row, b: row}))
    if isinstance(s, RodSystem):
        W = s.rod_rows.lines(here)[1][:, :, 0]
        for a, b, w in zip(s.points.a.tolist(), s.points.b.tolist(), W.T, strict=True):
            out.append(Constraint(len(out), {a: -(w @ T)[None], b: (w @ T)[None]}))
    for rates in family.passive.T:
        V = here.link_twists(rates[:, None])[:, :, 0]
        moved = {i: (v @ T)[None] for i, v in enumerate(V.T) if np.abs(v).max() > MODES.span}
        # against a neighbor that rests
        rests = next(b if a in moved else a for a, b in s.graph.ends if (a in moved) != (b in moved))
        moved[rests] = -np.sum(list(moved.values()), axis=0)
        out.append(Constraint(len(out), moved))
    return Constraints(out, T.shape[1])


def _merged(rows: Constraints, body: Index) -> Constraints:
    """The same between bodies ``(N,)`` of links."""
    out = []
    for c in rows.constraints:
        summed: dict[int, Array] = {}
        for link, row in c.rows.items():
            i = int(body[link])
            summed[i] = summed.get(i, 0.0) + row
        left = {i: row for i, row in summed.items() if np.abs(row).max(initial=0.0) > RANKS.position}
        out.append(Constraint(c.number, left))
    return Constraints(out, rows.b)
