"""Velocities and accelerations of closed positions, passive motions at rest.

Passive motions at rest: links that could spin or slide idly are kept from doing so, in space.

A passive motion moves some links as one and nothing else, so it can be stopped in many ways. Here these links are at rest in it:
their twists together have no part along the passive twist ``u`` (for the coupler between two spheres, no spin about their line:
``w . u = 0``, hence ``alpha . u + w . u' = 0``; where they also move against each other, ``sum_b w_b . u = 0``). No choice of a coordinate
enters, and a body that is symmetric about its line needs no effort to be held so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import labels_of_bipartite, members
from mechgraph.kinematics.state import ClosureSolver, Configuration, FactoredClosure
from mechgraph.maths.se3 import Array, Index, cross, cross_twist
from mechgraph.maths.tolerances import MOTIONS, PATH
from mechgraph.memo import dataclass


@dataclass(frozen=True)
class PassiveMotion:
    """A passive freedom: unit rates ``(F,)``, the links that move as one, and their twist about the internal origin."""

    rates: Array
    links: tuple[int, ...]
    twist: Array

    @property
    def turns(self) -> bool:
        """Whether it turns its links, so that a couple holds them; else it displaces them, and a force does."""
        # part of a unit motion from which on it turns the links that it moves
        return bool(np.abs(self.twist[:3]).max() > 1e-6)


def are_alone(passive: Sequence[PassiveMotion]) -> bool:
    """Whether no link has several of these motions."""
    links = [link for motion in passive for link in motion.links]
    return len(links) == len(set(links))


class PassiveMotions:
    """The passive motions at a batch of positions, and the twists that are at rest in them.

    Attributes
    ----------
    links : the links that have passive motions.
    rates, twists : the motions ``(F, p, T)``, in the order of those at the start, and the twists ``(6, n, p, T)`` of the links.
    points : for every link the point ``(3, n, T)`` whose velocity counts. On the axis where one passive turn is all it has (the foot from
        the origin of the link), so that only the spin counts; else the origin of the link.
    """

    def __init__(self, here: Configuration, passive: Sequence[PassiveMotion], rates: Array) -> None:
        self.here, self.passive, self.rates = here, passive, rates
        self.links = sorted({link for motion in passive for link in motion.links})
        self.twists = self._twists(self.rates)
        self._alone = are_alone(passive)
        if len(passive) > 1:
            mixes = told_apart(passive, self.rates, self.twists, self.links)
            self.rates = np.einsum("fpt,tpq->fqt", self.rates, mixes)
            self.twists = np.einsum("cnpt,tpq->cnqt", self.twists, mixes)
        mine = [[i for i, motion in enumerate(passive) if link in motion.links] for link in self.links]
        self._on_axis = np.array([len(some) == 1 and passive[some[0]].turns for some in mine])
        self._first = [some[0] for some in mine]
        self._origins = here.poses[:, 3, self.links]
        self.points = self._origins + np.where(self._on_axis[:, None], self._feet[0], 0.0)

    def first(self, i: int) -> int:
        """The place among ``links`` of the first that motion ``i`` moves."""
        return self.links.index(self.passive[i].links[0])

    @property
    def strays(self) -> Array:
        """Parts ``(p, T)`` of the passive twists with which other links move, or their own links against each other."""
        out = np.empty((len(self.passive), self.here.T))
        for i, motion in enumerate(self.passive):
            V = self.here.link_twists(self.rates[:, i])
            of_links = V[:, motion.links[:1]]
            size = np.abs(of_links).max(axis=(0, 1))
            V[:, motion.links] -= of_links
            out[i] = np.abs(V).max(axis=(0, 1)) / np.maximum(size, np.finfo(float).tiny)
        return out

    def _twists(self, rates: Array) -> Array:
        """Twists ``(6, n, p, T)`` of the links for rates ``(F, p, T)``."""
        return np.stack([self.here.link_twists(rates[:, i])[:, self.links] for i in range(rates.shape[1])], axis=2)

    @cached_property
    def _feet(self) -> tuple[Array, Array, Array]:
        """From the origins to the feet on the axes ``w x v / w^2 (3, n, T)``, with ``w`` and ``v``; anything where there is no axis."""
        first = self.twists[:, np.arange(len(self.links)), self._first]
        w, v = first[:3], first[3:] + cross(first[:3], self._origins)
        return cross(w, v) / np.maximum((w * w).sum(axis=0), 1e-300), w, v

    @cached_property
    def _along(self) -> Array:
        """Passive twists with the velocities of the rest points, ``(6, n, p, T)``."""
        return self._at_points(self.twists)

    def _at_points(self, twists: Array) -> Array:
        """Twists ``(6, n, p, T)`` about the rest points."""
        return np.concatenate([twists[:3], twists[3:] + cross(twists[:3], self.points[:, :, None])])

    @cached_property
    def _squares(self) -> Array:
        """Squares ``(p, T)`` of the passive twists ``G``."""
        return (self._along * self._along).sum(axis=(0, 1))

    @cached_property
    def _inverse(self) -> Array:
        """``(G^T G)^-1 (T, p, p)`` of the passive twists ``G``."""
        return np.linalg.inv(np.einsum("cnpt,cnqt->tpq", self._along, self._along))

    def _shares(self, power: Array) -> Array:
        """``(G^T G)^-1 power (p, T)``; motions that share no link have nothing in common."""
        return power / self._squares if self._alone else np.einsum("tpq,qt->pt", self._inverse, power)

    def dual(self, power: Array) -> Array:
        """Wrenches ``(6, n, T)`` about the rest points, of least size, that do the power ``(p, T)`` along the motions."""
        return np.einsum("cnpt,pt->cnt", self._along, self._shares(power))

    def _against(self, power: Array) -> Array:
        """Rates ``(F, T)`` of the passive motions that take ``power (p, T)`` out."""
        return -np.einsum("fpt,pt->ft", self.rates, self._shares(power))

    def at_rest(self, V: Array) -> Array:
        """Rates ``(F, T)`` that, added to those of the twists ``V (6, N, T)``, leave no part along the motions: ``G^T (V + G x) = 0``."""
        return self._against(self._power(self._along, V[:, self.links]))

    def _power(self, along: Array, V: Array) -> Array:
        """``(p, T)``: twists ``V (6, n, T)``, taken about the rest points, times others."""
        return np.einsum("cnpt,cnt->pt", along, self._at_points(V[:, :, None])[:, :, 0])

    def still_at_rest(self, f: FactoredClosure, dq: Array, V: Array, bias: Array, A: Array) -> Array:
        """Accelerations ``(F, T)`` to be added so that the condition of rest holds on: ``G^T V' + G'^T V = 0``.

        For twists ``V`` at rest with accelerations ``A (6, N, T)``, of the rates ``dq`` with their velocity part ``bias (6, P, T)``.
        """
        moving, change = V[:, self.links], self.twist_rates(f, dq, V, bias)
        point = moving[3:] + cross(moving[:3], self._origins)
        foot, w, v = self._feet
        first = change[:, np.arange(len(self.links)), self._first]
        # of the foot w x v / w^2, v being the passive velocity of the origin
        dv = first[3:] + cross(first[:3], self._origins) + cross(w, point)
        size = np.maximum((w * w).sum(axis=0), 1e-300)
        turned = (cross(first[:3], v) + cross(w, dv) - 2.0 * (w * first[:3]).sum(axis=0) * foot) / size
        point = point + np.where(self._on_axis[:, None], turned, 0.0)
        along = self._at_points(change)
        along[3:] += cross(self.twists[:3], point[:, :, None])
        now = self._at_points(A[:, self.links][:, :, None])[:, :, 0]
        now[3:] += cross(moving[:3], point)
        return self._against(self._power(along, moving) + np.einsum("cnpt,cnt->pt", self._along, now))

    def twist_rates(self, f: FactoredClosure, dq: Array, V: Array, bias: Array) -> Array:
        """Rates ``(6, n, p, T)`` of the passive twists ``U``, up to multiples of these, where the mechanism moves with ``dq``.

        The mechanism moves along its path by ``s`` and along a passive motion by ``t``: ``dU/ds - dV/dt = ad(V) U``. The accelerations
        of both motions together, without those of each alone, are ``dU/ds + dV/dt``.
        """
        out = np.empty_like(self.twists)
        for i in range(out.shape[2]):
            z = self.rates[:, i]
            U = self.here.link_twists(z)
            both, alone = self.here.bias(dq + z, V + U), self.here.bias(z, U)
            mixed, of = both - bias - alone, self.here.closure_bias
            ddq = f.solve(-(of(both, V + U) - of(bias, V) - of(alone, U))[:, None])[:, 0]
            out[:, :, i] = self.here.accelerations_with(ddq, mixed)[:, self.links]
        return 0.5 * (out + cross_twist(V[:, self.links][:, :, None], self.twists))


def told_apart(passive: Sequence[PassiveMotion], Z: Array, V: Array, links: list[int]) -> Array:
    """Mixes ``(T, p, p)`` of motions ``Z`` with twists ``V (6, n, p, T)`` of some links: column i moves those of passive motion i as one.

    A link that has one passive motion alone has multiples of one twist: the component that is largest at a position tells its motion from
    those of all other links.
    """
    if not are_alone(passive):
        return _named(passive, Z, V, links)
    A = np.empty((V.shape[3], len(passive), len(passive)))
    for i, motion in enumerate(passive):
        part = V[: 3 if motion.turns else 6, links.index(motion.links[0])]
        largest = np.abs(part).max(axis=1).argmax(axis=0)
        A[:, i] = np.take_along_axis(part, largest[None, None], axis=0)[0].T
    return np.asarray(np.linalg.inv(A))


def _named(passive: Sequence[PassiveMotion], Z: Array, V: Array, links: list[int]) -> Array:
    """The same for any motions.

    First motions that share no link are told apart, by the dual of what each set of links does; then those that do. Where the same links
    have several motions, those that are nearest in their freedoms to the motions at the start.
    """
    p, T = V.shape[2:]
    twists = V.transpose(3, 1, 0, 2)

    def of_links(some: Iterable[int]) -> Array:
        at = [links.index(link) for link in sorted(some)]
        return twists[:, at].reshape(T, 6 * len(at), p)

    touched = scipy.sparse.lil_array((p, max(links) + 1))
    for i, motion in enumerate(passive):
        touched[[i], list(motion.links)] = 1.0
    groups = members(labels_of_bipartite(touched.tocsr()))
    moved = [{link for i in group for link in passive[i].links} for group in groups]
    spaces = [
        np.linalg.svd(of_links(some), full_matrices=False)[2][:, : len(group)]
        for group, some in zip(groups, moved, strict=True)
    ]
    alone = np.split(
        np.linalg.inv(np.concatenate(spaces, axis=1)), np.cumsum([len(group) for group in groups])[:-1], axis=2
    )
    out = np.empty((T, p, p))
    for group, some, mine in zip(groups, moved, alone, strict=True):
        for i in group:
            lead, *rest = passive[i].links
            apart = [of_links([link]) - of_links([lead]) for link in rest]
            rows = np.concatenate([of_links(some.difference(passive[i].links)), *apart], axis=1) @ mine
            squares, mixes = np.linalg.eigh(np.swapaxes(rows, 1, 2) @ rows)
            # motions of other links may differ by one of these, as slides of all and of the others do
            count = int((squares <= MOTIONS.tied**2 * np.maximum(squares[:, -1:], 1.0)).sum(axis=1).min())
            count = max(count, sum(passive[j].links == passive[i].links for j in group))
            space = mine @ mixes[:, :, :count]
            there = np.moveaxis(Z, 2, 0) @ space
            out[:, :, i] = (
                (space @ (np.linalg.pinv(there) @ passive[i].rates)[..., None])[..., 0] if count > 1 else space[..., 0]
            )
    return out


class Velocities:
    """Rates of all freedoms ``dq (F, T)`` at closed positions, and what follows from them."""

    def __init__(self, here: Configuration, dq: Array) -> None:
        self.here, self.dq = here, dq

    @cached_property
    def V(self) -> Array:
        """Twists of all links ``(6, N, T)``."""
        return self.here.link_twists(self.dq)

    @cached_property
    def bias(self) -> Array:
        """Velocity part of the relative accelerations of all pairs ``(6, P, T)``."""
        return self.here.bias(self.dq, self.V)


class Rates(Velocities):
    """Rates of all freedoms ``dq, ddq (F, T)``, twists ``V`` and accelerations ``A`` of all links ``(6, N, T)``.

    ``contradiction (T,)`` is the largest part of the closure rates that no choice of the free rates can meet, relative to the
    terms of the equation.
    """

    def __init__(self, velocities: Velocities, ddq: Array, contradiction: Array) -> None:
        vars(self).update(vars(velocities))  # with what is known of V and bias
        self.ddq, self.contradiction = ddq, contradiction

    @cached_property
    def A(self) -> Array:
        """Accelerations dV/dt of all links ``(6, N, T)``."""
        return self.here.accelerations_with(self.ddq, self.bias)

    def repeated(self, here: Configuration, count: int) -> Rates:
        """The same ``count`` times, at the states ``here``."""
        velocities = Velocities(here, np.tile(self.dq, count))
        velocities.V, velocities.bias = np.tile(self.V, count), np.tile(self.bias, count)
        out = Rates(velocities, np.tile(self.ddq, count), np.tile(self.contradiction, count))
        out.A = np.tile(self.A, count)
        return out


def rates(
    here: Configuration,
    solver: FactoredClosure,
    columns: Index,
    velocity: Array,
    acceleration: Array,
    passive: tuple[PassiveMotion, ...] = (),
) -> Rates:
    """Rates for driver velocities and accelerations ``(d, T)``.

    ``J q' = 0`` and ``J q'' = -bias``, the driven part known; ``passive`` motions at rest (see ``PassiveMotion``).
    """
    dq, gap_v = _completed(here, solver, columns, velocity, None)
    moving = Velocities(here, dq)
    rest = PassiveMotions(here, passive, solver.motions()) if passive else None
    if rest is not None:
        moving = Velocities(here, dq + rest.at_rest(moving.V))
    turning = (moving.dq * moving.dq).max(axis=0, initial=0.0)
    ddq, gap_a = _completed(here, solver, columns, acceleration, here.closure_bias(moving.bias, moving.V), turning)
    moved = Rates(moving, ddq, np.maximum(gap_v, gap_a))
    if rest is not None:
        more = rest.still_at_rest(solver, moved.dq, moved.V, moved.bias, moved.A)
        moved = Rates(moving, ddq + more, moved.contradiction)
    return moved


def distance_to_dead_point(here: Configuration, solver: FactoredClosure, columns: Index) -> Array:
    """How far, in driver coordinates, each position is from a dead point, ``(T,)``.

    Near a dead point at ``s*`` the rates per unit of driver motion grow as ``|s* - s|^-1/2``, so that the distance is half of rate
    over rate of the rate; the smallest over the drivers.
    """
    out = np.full(here.T, np.inf)
    nothing = np.zeros((len(columns), here.T))
    for i in range(len(columns)):
        one = nothing.copy()
        one[i] = 1.0
        moved = rates(here, solver, columns, one, nothing)
        grown = np.abs(moved.ddq).max(axis=0, initial=0.0)
        out = np.minimum(out, 0.5 * np.abs(moved.dq).max(axis=0, initial=0.0) / np.maximum(grown, 1e-300))
    return out


def at_dead_points(
    here: Configuration, factored: FactoredClosure, solver: ClosureSolver
) -> tuple[NDArray[np.bool_], Array]:
    """Which positions are so near to a singular one of the drivers that their rates would be noise, and the ``accuracy (T,)`` of all."""
    condition = factored.condition
    dead, out = np.asarray(condition > PATH.singular), expected_error(here.rounding, condition)
    poor = np.flatnonzero((condition > PATH.poor) & ~dead)
    if poor.size:
        few = here.part(poor)
        f = factored.part(poor, few)
        scatter = _scatter(few, f, solver)
        out[poor] = few.rounding * np.maximum(condition[poor], scatter / PATH.rounding)
        near = np.full(poor.size, np.inf)
        doubtful = np.flatnonzero(condition[poor] > PATH.doubtful)
        if doubtful.size:
            fewer = few.part(doubtful)
            near[doubtful] = distance_to_dead_point(fewer, f.part(doubtful, fewer), solver.fixed)
            dead[poor] = ~(near > PATH.dead_point) | ((scatter > PATH.scatter) & (condition[poor] > PATH.doubtful))
    return dead, out


def expected_error(rounding: Array, condition: Array) -> Array:
    """Estimated relative error ``(T,)`` of rates and forces at states of fair condition, whose residuals have a ``rounding (T,)``.

    Rounding of the residual moves a state by condition times as much, which changes rates, solved with a matrix that is moved, by
    condition times that again, and accelerations, solved from these rates, once more.
    """
    grown = np.maximum(condition / PATH.square, 1.0) * np.maximum(condition / PATH.cube, 1.0)
    return np.asarray(rounding * condition * grown)


def _scatter(here: Configuration, factored: FactoredClosure, solver: ClosureSolver) -> Array:
    """By what part the accelerations for unit driver rates change where the residual changes by rounding, ``(T,)``.

    Near a crossing of branches, at a distance ``d``, by ``rounding / d^3``, where the rates themselves do not grow; near a fold by
    ``rounding / d^1/2``.
    """
    rounding = np.where(np.arange(here.system.n_rows) % 2, PATH.rounding, -PATH.rounding)
    dx = factored.solve(np.repeat(rounding[:, None, None], here.T, axis=2))[:, 0]
    there = Configuration(here.system, here.system.advance(here.x, dx))
    beside = solver.factored(there, factored.which)
    nothing = np.zeros((len(solver.fixed), here.T))
    out = np.zeros(here.T)
    for i in range(len(solver.fixed)):
        one = nothing.copy()
        one[i] = 1.0
        a, b = (rates(x, f, solver.fixed, one, nothing) for x, f in ((here, factored), (there, beside)))
        change, size = (np.abs(values).max(axis=0, initial=0.0) for values in (a.ddq - b.ddq, a.ddq))
        out = np.maximum(out, change / np.maximum(size, 1.0))
    return out


def disagreement(moved: Rates, columns: Index, positions: Array, velocity: Array, acceleration: Array) -> Array:
    """How far motions given to freedoms ``columns (d, T)`` are from those found, relative ``(T,)``; angles up to whole turns."""
    system = moved.here.system
    off = positions - moved.here.x[system.single_rows[columns]]
    off -= system.rounds(columns, off)
    out = np.maximum(np.abs(off).max(axis=0, initial=0.0), moved.contradiction)
    for asked, found in ((velocity, moved.dq), (acceleration, moved.ddq)):
        size = np.abs(found).max(axis=0, initial=0.0) + np.abs(asked).max(axis=0, initial=0.0)
        gap = np.abs(found[columns] - asked).max(axis=0, initial=0.0)
        out = np.maximum(out, gap / np.where(size > 0, size, 1.0))
    return out


def _completed(
    here: Configuration,
    solver: FactoredClosure,
    columns: Index,
    driven: Array,
    known: Array | None,
    size: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Rates ``(F, T)`` with ``J q + known = 0`` for given driven ones, and what is left of that, relative ``(T,)``."""
    given = np.zeros((here.system.n_freedoms, here.T))
    if known is None and not driven.any():
        return given, np.zeros(here.T)
    given[columns] = driven
    rhs = -here.closure_rates(given) if driven.any() else np.zeros_like(here.residual)
    if known is not None:
        rhs -= known
    q = solver.solve(rhs[:, None])[:, 0]
    left = np.abs(here.closure_rates(q) - rhs).max(axis=0, initial=0.0)
    q[columns] = driven
    scale = np.abs(q).max(axis=0, initial=0.0) + size
    if known is not None:
        scale += np.abs(known).max(axis=0, initial=0.0)
    return q, left / np.where(scale > 0, scale, 1.0)
