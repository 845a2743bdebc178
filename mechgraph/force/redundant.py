"""Redundant reactions: of least norm, or split by the stiffness of the pairs, and the forces that misfits lock in.

Of all reactions ``l = l0 + N x`` in balance with the loads (N: self-stresses) those come about that make ``sum l^2 / (2 k) - sum l misfit``
least (Castigliano): with the compliances ``C = diag 1/k``, zero where rigid,

    (N^T C N) x = N^T (misfit - C l0).

A component with k = 0 carries nothing: ``l = 0`` is a condition. Self-stresses that strain rigid components alone stay unknown. Where a
force closes a pair its normal component is not negative, and lifts off else (least squares under signs, ``force.reactions``); where it is
among what stays unknown no sign is asked of it.

Links move by small twists d with what their pairs give way, ``misfit - l / k``: with the reactions u that balance a unit load P on a link,
``P . d = - sum u (misfit - l / k)`` (virtual work).
Source: S. Timoshenko, Strength of Materials II, 1956; C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, 1974.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy

from mechgraph.errors import DeclarationError
from mechgraph.force.friction import Came, Rubbed
from mechgraph.force.loads import hold
from mechgraph.force.reactions import (
    METHODS,
    STRAIN,
    ForceProblem,
    PairFrames,
    Stress,
    Wrenches,
    at_pair_points,
    effort_map,
    least_above,
    least_multiples,
    least_under_signs,
    loop_wrench,
    on_their_flanks,
    orthonormal_stress,
    pair_power,
    pretensioned,
    reaction_map,
    reaction_part,
    row_efforts,
    split_stress,
)
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.state import Configuration, FactoredClosure
from mechgraph.kinematics.system import System
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism


@dataclass(frozen=True)
class BlockForces:
    """Forces at the positions of a block, internal units about the internal origin.

    ``reactions (6, P, T)`` and all ``efforts (F, T)`` (of least norm where redundant), ``given (F, T)`` efforts of loads, ``loads
    (6, N, T)`` inertia, applied wrenches and what holds passive bodies (``hold (6, N, T)`` that alone, or None), self-stresses
    ``stress (6, P, s, T)`` with ``stress_efforts (F, s, T)``, ``coupled (F, T)`` efforts of couplings, ``shaking (6, T)``;
    ``balance (T,)`` and ``power (T,)`` the residuals of equilibrium and power, ``largest`` the largest term of each; ``holds`` and
    ``hold_terms (p, T)`` of the passive motions. ``multipliers (n, T)`` of the closure rows behind those of
    the loops with ``multiplier_stress (n, s, T)``, of which ``coupled_stress (F, s, T)`` are the efforts in freedoms.
    Where stiffness splits reactions: those that misfits lock in ``locked (6, P, T)``, and those of a misfit of one in every component
    that is not rigid ``of_misfit (6, P, k, T)``. With friction: what came about, ``rubs``, and at rest the least and greatest efforts
    between which drives may be ``range (F, 2, T)``, and whether it ``holds_alone (T,)`` with several of them off;
    ``unborne (T,)`` where feet that only push cannot bear the loads.
    """

    reactions: Array
    efforts: Array
    given: Array
    loads: Array
    hold: Array | None
    stress: Array
    stress_efforts: Array
    coupled: Array
    multipliers: Array
    multiplier_stress: Array
    coupled_stress: Array
    shaking: Array
    balance: Array
    power: Array
    largest: tuple[float, float]
    holds: Array
    hold_terms: Array
    locked: Array | None = None
    of_misfit: Array | None = None
    rubs: Rubbed | None = None
    range: Array | None = None
    holds_alone: Array | None = None
    unborne: Mask | None = None

    @property
    def outcome(self) -> Array:
        """What became of every position ``(T,)``, by its number (``Came``)."""
        came = np.zeros(self.power.shape, int) if self.rubs is None else self.rubs.outcome
        return came if self.unborne is None else np.where(self.unborne, Came.LIFTS_OFF, came)


@dataclass(frozen=True)
class Seats:
    """What pairs say of their seats: for every reaction component ``(K,)`` of all pairs, group by group, its name ``A.Fz`` (``labels``),
    whether it is a ``couple``, the ``compliance`` and the ``misfit`` in internal units, whether it carries nothing (``loose``) or can only
    ``push``.
    """

    labels: tuple[str, ...]
    couple: Mask
    compliance: Array
    misfit: Array
    loose: Mask
    push: Mask

    @property
    def soft(self) -> Index:
        """The components with a stiffness that is not 0."""
        return np.flatnonzero(self.compliance > 0)


@dataclass(frozen=True)
class ElasticSplit:
    """Multiples ``y (s, T)`` of the self-stresses, those of them that misfits lock in ``locked (s, T)``; ``left (s, s, T)`` are the mixes
    that stay unknown (columns of zeros else), ``unit (s, K, T)`` what a misfit of one in each component adds, ``soft`` the components
    that are not rigid; ``unborne (T,)`` where what only pushes cannot bear the loads.
    """

    y: Array
    locked: Array
    left: Array
    unit: Array
    soft: Index
    unborne: Mask


def component_values(frames: PairFrames, wrenches: Array) -> Array:
    """Components ``(K, ..., T)`` of reaction wrenches ``(6, P, ..., T)``, group by group."""
    return np.concatenate([each for part in frames.components(wrenches) for each in part])


def seats_of(system: System) -> Seats:
    """The seats of the pairs of a system, in the order of ``component_values``."""
    m: Mechanism = system.m
    L = system.par.L
    rows: list[tuple[str, bool, float, float, bool, bool]] = []
    for g in system.groups:
        parts = g.row.reactions or ()
        for c, name in enumerate(g.row.component_names):
            couple = bool(parts) and parts[c].is_couple
            for k in g.pairs:
                pair = m.pairs[k]
                stiff = None if pair.stiffness is None else getattr(pair.stiffness, name, None)
                off = 0.0 if pair.misfit is None else getattr(pair.misfit, name, None) or 0.0
                unit = L * L if couple else 1.0
                form = pair.type.touching if pair.closed == "force" else None
                pushed = form is not None and not form.curved and form.forces == (name,)
                soft = unit / stiff if stiff else 0.0
                rows.append((f"{pair.name}.{name}", couple, soft, off if couple else off / L, stiff == 0.0, pushed))
    labels, *parts = zip(*rows, strict=True) if rows else ((),) * 6
    return Seats(labels, *map(np.array, parts))


def elastic_split(
    here: Configuration, reactions: Array, efforts: Array, stress: Stress, lifted: Mask | None
) -> ElasticSplit:
    """The multiples of all self-stresses that come about in reactions ``(6, P, T)`` beside ``efforts (F, T)``, at every position.

    ``lifted (K, T)``: which components carry nothing, and what else only pushes is held as if it could pull; found here if left out.
    """
    seats, frames, T = seats_of(here.system), PairFrames(here), here.T
    push = np.zeros(0, dtype=np.intp) if lifted is not None else np.flatnonzero(seats.push)
    loose = np.repeat(seats.loose[:, None], T, axis=1) if lifted is None else seats.loose[:, None] | lifted
    if not (seats.compliance.any() or seats.loose.any()):
        m = here.system.m
        raise DeclarationError(
            f"solve {m.name!r}",
            ["redundant='elastic': no pair has a stiffness; give those that share a load stiffness="],
        )
    N = np.moveaxis(component_values(frames, stress.wrenches), -1, 0)
    own = component_values(frames, reactions).T
    K, s = N.shape[1:]
    parts = np.zeros((s, T)), np.zeros((s, T)), np.zeros((s, s, T)), np.zeros((s, K, T))
    out = ElasticSplit(*parts, seats.soft, np.zeros(T, dtype=bool))
    size = np.maximum(np.abs(own).max(axis=1, initial=0.0), np.abs(efforts).max(axis=0, initial=0.0))
    for t in range(T):
        _split_at(t, seats, push, loose[:, t], N[t], own[t], out, float(size[t]))
    return out


def openings(here: Configuration, reactions: Array, stress: Array, lifted: Mask) -> Array:
    """How far components that are ``lifted (K, T)`` stand off, ``(K, T)``, zero elsewhere; ``reactions (6, P, T)`` are those that come
    about, ``stress (6, P, s, T)`` all self-stresses, along which the motions ``misfit - l / k + opening`` of a closed graph cancel.
    """
    seats, frames, out = seats_of(here.system), PairFrames(here), np.zeros(lifted.shape)
    N, own = component_values(frames, stress), component_values(frames, reactions)
    for t in np.flatnonzero(lifted.any(axis=0)):
        open_ = lifted[:, t] | seats.loose
        strain = N[:, :, t].T @ (seats.misfit - seats.compliance * own[:, t])
        out[open_, t] = np.linalg.lstsq(N[open_, :, t].T, -strain)[0]
    return np.where(lifted, out, 0.0)


def _split_at(
    t: int, seats: Seats, push: Index, loose: Mask, N: Array, own: Array, out: ElasticSplit, size: float
) -> None:
    """Fill in one position: self-stresses ``N (K, s)``, reactions ``own (K,)``; ``size`` of the largest one, components that only push,
    and those that carry nothing.
    """
    C, s = seats.compliance, N.shape[1]
    free, fixed = _conditions(N[loose], own[loose], s, size)
    if fixed is None:  # the loads ask for what carries nothing: no self-stress is known
        out.left[:, :, t] = np.eye(s)
        out.unborne[t] = (loose > seats.loose).any()
        return
    strain = np.sqrt(C)[:, None] * (N @ free)
    _, sizes, turn = np.linalg.svd(strain, full_matrices=True)
    known = np.zeros(turn.shape[0], dtype=bool)
    known[: len(sizes)] = sizes > STRESSES.unique * max(sizes.max(initial=0.0), 1e-300)
    Z, left = free @ turn[known].T, free @ turn[~known].T
    out.left[:, : left.shape[1], t] = left
    if not known.any():
        out.y[:, t] = fixed
        return
    A = np.sqrt(C)[:, None] * (N @ Z)
    inverse = np.linalg.inv(A.T @ A)
    N_own = own + N @ fixed
    push = push[np.abs(N[push] @ left).max(axis=1, initial=0.0) <= STRESSES.unique]
    G = N[push] @ Z

    def least(misfit: Array) -> tuple[Array, Array]:
        """Multiples of Z, and the self-stresses that stay where what lifts off carries nothing."""
        pull = (N @ Z).T @ (misfit - C * N_own)
        z, stays = inverse @ pull, np.eye(Z.shape[1])
        if (N_own[push] + G @ z < -STRESSES.rounding * size).any():
            b = -A @ inverse @ pull
            found = least_above(A, b, G, -N_own[push])
            z = np.full(Z.shape[1], np.nan) if found is None else found
            lifted = G[np.abs(N_own[push] + G @ z) <= STRESSES.unique * max(size, 1e-300)]
            stays = _conditions(lifted, np.zeros(len(lifted)), Z.shape[1])[0]
        return z, stays

    z, stays = least(seats.misfit)
    out.y[:, t], out.unborne[t] = fixed + Z @ z, np.isnan(z).any()
    if seats.misfit.any():
        out.locked[:, t] = Z @ (z - least(np.zeros(len(C)))[0])
    Zs = Z @ stays
    if Zs.shape[1]:
        out.unit[:, :, t] = Zs @ np.linalg.solve(Zs.T @ N.T @ (C[:, None] * N) @ Zs, (N @ Zs).T)


def _conditions(A: Array, b: Array, s: int, size: float = 0.0) -> tuple[Array, Array | None]:
    """The null space of conditions ``A y + b = 0``, and a solution; None where there is none beside reactions of a ``size``."""
    if not len(A):
        return np.eye(s), np.zeros(s)
    ways, sizes, turn = np.linalg.svd(A, full_matrices=True)
    r = int((sizes > STRESSES.unique * max(sizes.max(initial=0.0), 1.0)).sum())
    y = -turn[:r].T @ ((ways[:, :r].T @ b) / sizes[:r])
    met = np.abs(A @ y + b).max() <= STRESSES.unique * max(np.abs(b).max(), size, 1e-300)
    return turn[r:].T, y if met else None


def strains(system: System, deflections: Mapping[str, Array]) -> Array:
    """Deflections by component ``A.Fz``, in the user's units, as ``(K, T)`` in internal ones, in the order of ``component_values``."""
    seats = seats_of(system)
    unit = np.where(seats.couple, 1.0, system.par.L)
    return np.array([deflections[name].reshape(-1) / u for name, u in zip(seats.labels, unit, strict=True)])


def displacement(
    here: Configuration, f: FactoredClosure, driven: Index, link: int, strain: Array, flank: Array
) -> Array:
    """The small twist ``(6, T)`` of a link where pairs give way by ``strain (K, T)`` in their components and drives hold; on the flanks
    of multipliers ``(n, T)``.

    A strain that is NaN is one that the others decide. NaN for what they do not decide, or contradict.
    """
    frames, lines = PairFrames(here), ContactLines(here)

    def components(totals: Array, multipliers: Array) -> Array:
        """Of reactions alone ``(T, K, n)``, on the flanks."""
        totals = totals - lines.relief(multipliers, flank) if lines else totals
        part = split_stress(here, totals, multipliers, np.arange(here.system.n_freedoms)).wrenches
        return np.moveaxis(component_values(frames, part), -1, 0)

    P, n = len(here.system.m.pairs), here.system.n_rows - here.system.graph.loop_rows
    totals, multipliers = np.zeros((6, P, 6, here.T)), np.zeros((n, 6, here.T))
    for i in range(6):
        loads = np.zeros((6, len(here.system.m.links), here.T))
        loads[i, link] = link != here.system.graph.frame
        found = loop_wrench(ForceProblem(here, loads, np.zeros((here.system.n_freedoms, here.T)), driven, f))
        totals[:, :, i], multipliers[:, i] = found.totals, found.multipliers
    x = f.self_stresses(every=True)
    stress = components(here.pair_wrenches(x), -x[here.system.graph.loop_rows :])
    out = np.empty((6, here.T))
    for t, (N, u) in enumerate(zip(stress, components(totals, multipliers), strict=True)):
        open_ = np.isnan(strain[:, t])
        known, scale = np.where(open_, 0.0, strain[:, t]), np.linalg.norm(N, axis=0)
        N = N / np.where(scale > 0, scale, 1.0)
        y = -np.linalg.lstsq(N[open_], u[open_])[0] if open_.any() else np.zeros((N.shape[1], 6))
        rest = _conditions(N[open_], np.zeros(int(open_.sum())), N.shape[1])[0]
        u = u + N @ y
        contradicts = np.abs((N @ rest).T @ known).max(initial=0.0) > STRESSES.unique * np.abs(known).max(initial=0.0)
        loose = np.abs(u[open_]).max(axis=0, initial=0.0) > STRESSES.unique * np.abs(u).max(initial=0.0)
        out[:, t] = np.where(loose | contradicts, np.nan, 0.0 - known @ u)
    return out


@dataclass(frozen=True)
class ForceTask:
    """The task for every block: force ``method``, ``loads``, ``driven`` freedoms, ``passive`` motions; ``batch`` and times ``t``."""

    method: str
    loads: tuple[Load, ...]
    driven: Index
    passive: tuple[PassiveMotion, ...]
    batch: tuple[int, ...]
    t: object
    redundant: str
    idle: Index | None = None
    """Fixed freedoms, by their places, whose unit rates are the passive motions; None where these are the motions left free."""


def held_still(
    here: Configuration, task: ForceTask, f: FactoredClosure, loads: Array, efforts: Array, largest: float
) -> tuple[Array | None, Array, Array]:
    """What keeps the passive bodies of a task at rest (see ``hold``); None where it has none."""
    if not task.passive:
        return None, np.zeros((0, here.T)), np.zeros((0, here.T))
    passive = f.motions() if task.idle is None else f.sensitivity()[:, task.idle]
    return hold(here, task.passive, passive, loads, efforts, largest)


@dataclass(frozen=True)
class FreeForces:
    """Reactions and efforts, of least norm where redundant, with the self-stresses; see ``BlockForces``."""

    reactions: Array
    efforts: Array
    stress: Stress
    multipliers: Array
    coupled: Array
    locked: Array | None = None
    of_misfit: Array | None = None
    unborne: Mask | None = None
    all_stress: Stress | None = None
    """All self-stresses of which stiffness decides."""


def least_on_flanks(
    here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask, lines: ContactLines
) -> tuple[FreeForces, Array]:
    """See ``_least``; with the signs of the multipliers ``(n, T)`` that tell on which flanks gears touch each other.

    Where multipliers are not unique those of least norm may touch on other flanks than the first ones found: then once more on these, and
    where that does not settle under the condition that they keep the signs of their flanks (see ``force.reactions.least_under_signs``).
    """
    flank = wrenches.multipliers
    if not lines:
        return least_forces(here, wrenches, f, task, lines, flank), flank
    # how often flanks are changed in search of multipliers of least norm
    for _ in range(3):
        found = least_forces(here, relieved(wrenches, lines, flank), f, task, lines, flank)
        moved = ((found.multipliers < 0.0) != (flank < 0.0)).any(axis=0)
        if not moved.any():
            return found, flank
        flank = np.where(moved, found.multipliers, flank)
    whole, flank = _kept_on_flanks(here, wrenches, f, task, flank, np.flatnonzero(moved))
    bare = relieved(whole, lines, flank)
    kept = _found(here, bare.totals, bare.multipliers, _stress(here, bare, f, task))
    for name in ("reactions", "efforts", "multipliers", "coupled"):
        getattr(found, name)[..., moved] = getattr(kept, name)[..., moved]
    return replace(found, stress=kept.stress), flank


def _kept_on_flanks(
    here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask, flank: Array, at: Index
) -> tuple[Wrenches, Array]:
    """Total wrenches and multipliers of least norm at the positions ``at``, on their flanks; the other positions as they are."""
    totals, multipliers, flank = wrenches.totals.copy(), wrenches.multipliers.copy(), flank.copy()
    for t in at:
        one = np.array([t])
        alone = here.part(one)
        x = f.part(one, alone).self_stresses(every=True)
        change = -x[here.system.graph.loop_rows :]
        own = Wrenches(totals[..., one], alone.pair_wrenches(x), multipliers[:, one], change)
        own = pretensioned(alone, own, f.part(one, alone))
        y, flank[:, t] = least_under_signs(alone, own, ContactLines(alone), _acting(here, task))
        totals[..., t] += own.stress[..., 0] @ y
        multipliers[:, t] += own.multiplier_stress[..., 0] @ y
    return replace(wrenches, totals=totals, multipliers=multipliers), flank


def relieved(wrenches: Wrenches, lines: ContactLines, flank: Array) -> Wrenches:
    """Total wrenches and self-stresses without what contacts on their flanks take off."""
    relief = [lines.relief(part, flank) for part in (wrenches.multipliers, wrenches.multiplier_stress)]
    return replace(wrenches, totals=wrenches.totals - relief[0], stress=wrenches.stress - relief[1])


def least_forces(
    here: Configuration,
    wrenches: Wrenches,
    f: FactoredClosure,
    task: ForceTask,
    lines: ContactLines,
    flank: Array,
    known: Stress | None = None,
    lifted: Mask | None = None,
) -> FreeForces:
    """Reactions and efforts of least norm; where self-stresses are random ones only if that is asked for. They may be ``known``.

    ``lifted``: see ``elastic_split``; beside friction nothing is as long as it is left out.
    """
    totals, multipliers = wrenches.totals, wrenches.multipliers
    if task.redundant == "elastic" and not f.complete:
        every = f.self_stresses(every=True)
        others = -every[here.system.graph.loop_rows :]
        wrenches = replace(wrenches, stress=here.pair_wrenches(every), multiplier_stress=others)
    stress = known or _stress(here, wrenches, f, task)
    s = stress.wrenches.shape[2]
    if s and not f.complete and task.redundant == "minimum_norm":
        x = _least_multipliers(here, totals, multipliers, f, _acting(here, task), lines, flank)
        others = x[here.system.graph.loop_rows :]
        totals = totals + here.pair_wrenches(x[:, None])[:, :, 0]
        totals = totals + lines.relief(others, flank) if lines else totals
        multipliers = multipliers - others
    found = _found(here, totals, multipliers, stress)
    if s and task.redundant == "elastic":
        if lifted is None and any(load.follows_reactions for load in task.loads):
            lifted = np.zeros((len(seats_of(here.system).labels), here.T), dtype=bool)
        return _elastic(here, found, lifted)
    if not (s and f.complete):
        return found
    y = least_multiples(here, found.reactions, found.efforts, multipliers, stress)
    multipliers = multipliers + np.einsum("nit,it->nt", stress.multipliers, y)
    return FreeForces(
        found.reactions + np.einsum("cpit,it->cpt", stress.wrenches, y),
        found.efforts + np.einsum("fit,it->ft", stress.efforts, y),
        stress,
        multipliers,
        row_efforts(here, multipliers[:, None])[:, 0],
    )


def unique_reactions(problem: ForceProblem) -> Array:
    """Reactions ``(6, P, T)`` at the pair points, or impulses where loads and efforts are such; NaN where self-stresses may change them."""
    here, f = problem.here, problem.solver
    task = ForceTask("loop_wrench", (), problem.driven, (), (here.T,), None, "nan")
    lines = ContactLines(here)
    wrenches = on_their_flanks(here, METHODS[task.method](problem), lines)
    found, _ = least_on_flanks(here, wrenches, f, task, lines)
    stress = np.abs(at_pair_points(here, found.stress.wrenches)).max(axis=2, initial=0.0)
    return np.where(stress > STRESSES.unique, np.nan, at_pair_points(here, found.reactions))


def _elastic(here: Configuration, found: FreeForces, lifted: Mask | None) -> FreeForces:
    """Reactions and efforts as stiffness splits them; the self-stresses that stay unknown. ``lifted``: see ``elastic_split``."""
    split, stress = elastic_split(here, found.reactions, found.efforts, found.stress, lifted), found.stress

    def of(multiples: Array) -> Array:
        return np.asarray(np.einsum("cpit,it->cpt", stress.wrenches, multiples))

    multipliers = found.multipliers + np.einsum("nit,it->nt", stress.multipliers, split.y)
    mixed = (np.einsum("nit,ijt->njt", part, split.left) for part in (stress.efforts, stress.multipliers))
    return FreeForces(
        found.reactions + of(split.y),
        found.efforts + np.einsum("fit,it->ft", stress.efforts, split.y),
        Stress(np.einsum("cpit,ijt->cpjt", stress.wrenches, split.left), *mixed),
        multipliers,
        row_efforts(here, multipliers[:, None])[:, 0],
        of(split.locked),
        np.einsum("cpit,ikt->cpkt", stress.wrenches, split.unit[:, split.soft]),
        split.unborne,
        stress,
    )


def _found(here: Configuration, totals: Array, multipliers: Array, stress: Stress) -> FreeForces:
    """What total wrenches are made of."""
    efforts = pair_power(here, totals)
    # in the freedom in which a contact opens a presses on b: that is a reaction
    efforts[here.system.gaps] = 0.0
    coupled = row_efforts(here, multipliers[:, None])[:, 0]
    return FreeForces(reaction_part(here, totals, efforts), efforts, stress, multipliers, coupled)


def _acting(here: Configuration, task: ForceTask) -> Index:
    """The freedoms with efforts: driven, coupled."""
    return np.setdiff1d(np.union1d(task.driven, here.system.coupled_freedoms), here.system.gaps)


def _stress(here: Configuration, wrenches: Wrenches, f: FactoredClosure, task: ForceTask) -> Stress:
    """The self-stresses of total wrenches, orthonormal where they are all there are."""
    split = orthonormal_stress if f.complete or task.redundant == "elastic" else split_stress
    return split(here, wrenches.stress, wrenches.multiplier_stress, _acting(here, task))


def _least_multipliers(
    here: Configuration,
    totals: Array,
    multipliers: Array,
    f: FactoredClosure,
    acting: Index,
    lines: ContactLines,
    flank: Array,
) -> Array:
    """Multipliers ``(rows, T)`` of the closure rows that make the reactions least, and then the efforts that leave them as they are.

    Minimizes ``|r + R x|^2 + w^2 |e + M x|^2``, then the same with ``M (x - x_1)`` in place of ``e + M x``: what the weight took from the
    reactions in the first is given back, up to w^4 (method of multipliers, Bertsekas 1982).
    """
    if here.system.m.once(pretensions):
        fault = (
            "redundant='minimum_norm' beside belts with a pretension, of so many self-stresses, takes engine='dense'"
        )
        raise DeclarationError(f"mechanism {here.system.m.name!r}", [fault])
    efforts = pair_power(here, totals)
    points = at_pair_points(here, reaction_part(here, totals, efforts)).swapaxes(0, 1).reshape(-1, here.T)
    R = [reaction_map(here, t) for t in range(here.T)]
    if lines:
        n = len(multipliers)
        of_unit = lines.relief(np.repeat(np.eye(n)[:, :, None], here.T, axis=2), flank)
        of_unit = at_pair_points(here, of_unit).swapaxes(0, 1).reshape(-1, n, here.T)
        behind = np.zeros((len(of_unit), here.system.n_rows, here.T))
        behind[:, -n:] = of_unit
        R = [R[t] + scipy.sparse.csr_array(behind[..., t]) for t in range(here.T)]
    if len(acting) < 2:
        return f.least(R, points)
    M = [STRAIN * effort_map(here, t, acting) for t in range(here.T)]
    both = [scipy.sparse.csr_array(scipy.sparse.vstack(maps)) for maps in zip(R, M, strict=True)]
    first = f.least(both, np.concatenate([points, STRAIN * efforts[acting], STRAIN * multipliers]))
    back = np.stack([-(part @ x) for part, x in zip(M, first.T, strict=True)], axis=1)
    return f.least(both, np.concatenate([points, back]))
