"""Dry friction beside reactions: one unknown normal force a place, one factorization a position.

The motion gives the directions of sliding, so friction is linear in the normal forces, and reactions are linear in friction. With the
normal vectors ``V_t = A_t w`` of the reaction ``w`` of a pair at every place t, and friction wrenches ``D_t |V_t| + K_t V_t`` on link b,

    (1 - C) V = a + B n,   n_t = |V_t|,

a without friction. A friction wrench is an effort in the freedoms of its pair, which loads the others, and a part that its own pair takes
up. Solved by semismooth Newton from ``n = |a|``; where ``|B|`` has a spectral radius below 1 the solution is the only one. Meant is the one
connected with the frictionless one while friction grows by k from 0 to 1: n without bound at k < 1 jams, a fold has no finite force.
Sources: J. E. Shigley and J. J. Uicker, Theory of Machines and Mechanisms, 1995; L. Qi and J. Sun, A nonsmooth version of Newton's method,
Mathematical Programming 58, 1993; F. Pfeiffer and Ch. Glocker, Multibody Dynamics with Unilateral Contacts, 1996.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index, cross, skew
from mechgraph.maths.tolerances import MOTIONS, STRESSES
from mechgraph.model.friction import Friction, rubs_as_ball, rubs_as_journal, rubs_as_plane, rubs_as_slide

OUTCOMES = ("ok", "jams", "no finite force", "friction not determined")
"""What becomes of a position, by number."""


@dataclass(frozen=True)
class Place:
    """A place that rubs: of which ``pair``, normal vector ``A (d, 6, T)`` of its reaction about the internal origin, friction wrench on
    link b ``D (6, T)`` for a unit of its size and ``K (6, d, T)`` linear in it; ``preload`` (internal units). ``follows``: whether its
    directions depend on the reactions themselves.
    """

    pair: int
    A: Array
    D: Array
    K: Array
    preload: float
    follows: bool = False


def _rows(moment: Array, force: Array) -> Array:
    return np.concatenate([moment, force], axis=1)


def _couple(m: Array) -> Array:
    return np.concatenate([m, np.zeros_like(m)])


def _force_at(p: Array, f: Array) -> Array:
    return np.concatenate([cross(p, f), f])


def moving_rates(dq: Array, ddq: Array | float = 0.0) -> Array:
    """Rates ``(F, T)`` without those of freedoms at rest, where friction has no direction: rounding beside the largest rate of the
    position, or a reversal within rounding of the coordinate, ``q'^2 / q''``.
    """
    size = np.abs(dq)
    rests = (size <= MOTIONS.rounding * size.max(axis=0, initial=0.0)) | (size <= MOTIONS.still * np.sqrt(np.abs(ddq)))
    return np.where(rests, 0.0, dq)


def places_of(
    here: Configuration, dq: Array, normal: Array, loads: Sequence[Friction], at_rest: bool = False
) -> list[Place]:
    """All places that rub in a motion ``dq (F, T)`` of ``moving_rates``; ``normal (6, P, T)``: reactions that tell where bodies touch."""
    return [
        place
        for load in loads
        for place in _places(here, dq, normal, load, load.coefficient_at_rest if at_rest else load.mu)
    ]


def _places(here: Configuration, dq: Array, normal: Array, load: Friction, mu: float) -> Iterator[Place]:
    s = here.system
    k = s.m.place_of_pair(load.of)
    pair, L, T = s.m.pairs[k], s.par.L, here.T
    number, i = s.place_of(k)
    row, first = pair.type, int(s.first_column[k])
    S = here.S[:, first : first + row.f]
    rate = dq[first : first + row.f]
    twist = np.einsum("cft,ft->ct", S, rate)
    preload = load.preload / L
    force = _rows(np.zeros((3, 3, T)), np.broadcast_to(np.eye(3)[:, :, None], (3, 3, T)))
    none = np.zeros((6, 3, T))
    if row.touching:
        before = next(iter(row.reactions or ())).frame
        c = here.frames[number][before][:, 3, i]
        r = (pair.radius_b or 0.0) / L
        size = np.sqrt((normal[3:, k] ** 2).sum(axis=0))
        n = normal[3:, k] / np.where(size > 0, size, 1.0)
        slip = twist[3:] + cross(twist[:3], c - r * n)
        speed = np.sqrt((slip * slip).sum(axis=0))
        u = slip / np.where(speed > MOTIONS.rounding * np.abs(twist).max(axis=0), speed, np.inf)
        yield Place(
            k, force, -mu * _force_at(c, u), np.concatenate([-mu * r * skew(u), np.zeros((3, 3, T))]), preload, True
        )
        return
    origin = here.pair_points[:, k] if load.on == "b" else here.frames[number][0][:, 3, i]
    r = (load.radius or 0.0) / L
    if rubs_as_plane(row):
        z = here.frames[number][0][:, 2, i]
        w, turn = normal[:, k], (twist[:3] * z).sum(axis=0)
        press = (w[3:] * z).sum(axis=0)
        # the center of pressure, where the force has no moment in the plane: p + z x M / F_z
        at = origin + cross(z, w[:3] - cross(origin, w[3:])) / np.where(press != 0, press, np.inf)
        v = twist[3:] + cross(twist[:3], at)
        v = v - z * (v * z).sum(axis=0)
        speed = np.sqrt((v * v).sum(axis=0) + (r * turn) ** 2)
        share = np.where(speed > MOTIONS.rounding * np.abs(twist).max(axis=0), speed, np.inf)
        D = -mu * (_force_at(at, v / share) + r * _couple(r * turn / share * z))
        yield Place(k, _rows(np.zeros((1, 3, T)), z[None]), D, np.zeros((6, 1, T)), preload, True)
        return
    if rubs_as_ball(row):
        spin = np.sqrt((twist[:3] ** 2).sum(axis=0))
        part = mu / np.hypot(1.0, mu) if load.model == "circle" else mu
        yield Place(k, force, -part * r * _couple(twist[:3] / np.where(spin > 0, spin, np.inf)), none, preload)
        return
    axes: dict[int, dict[bool, int]] = {}
    for j, f in enumerate(row.freedoms):
        axes.setdefault(int(np.argmax(np.abs(f.twist[:3] if f.turns else f.twist[3:]))), {})[f.turns] = j
    for found in axes.values():
        turn, slide = found.get(True), found.get(False)
        u = S[:3, turn] if turn is not None else S[3:, slide]
        axial = _rows(np.zeros((1, 3, T)), u[None])
        w = np.zeros(T) if turn is None else rate[turn]
        v = np.zeros(T) if slide is None else rate[slide]
        if row.takes_pitch:
            yield _thread(k, load, mu, u, axial, np.sign(w), pair.pitch_per_radian / L, r, preload)
        if rubs_as_journal(row) or rubs_as_slide(row) or load.length is not None:
            yield from _along(k, load, mu, u, origin, r, w, v, L, preload)
        if load.thrust_radius is not None:
            yield Place(k, axial, -mu * load.thrust_radius / L * _couple(np.sign(w) * u), np.zeros((6, 1, T)), preload)


def _thread(
    k: int, load: Friction, mu: float, u: Array, axial: Array, s: Array, pitch: float, r: float, preload: float
) -> Place:
    """Friction couple of a thread: more where the motion goes against the axial force Q on b's load, ``s`` the sense of the turn."""
    lead = np.arctan2(abs(pitch), r)
    phi = np.arctan(mu / np.cos(np.arctan(np.tan(load.flank) * np.cos(lead))))
    up, down = r * (np.tan(lead + phi) - np.tan(lead)), r * (np.tan(lead) - np.tan(lead - phi))
    mean, more = 0.5 * (up + down), 0.5 * (up - down) * np.sign(pitch)
    return Place(k, axial, -mean * _couple(s * u), -more * _couple(s * s * u)[:, None], preload)


def _along(
    k: int, load: Friction, mu: float, u: Array, p: Array, r: float, w: Array, v: Array, L: float, preload: float
) -> Iterator[Place]:
    """Places along an axis ``u`` through ``p`` that carry radial forces, under a turn ``w`` at the radius ``r`` and a slide ``v``."""
    T = u.shape[1]
    speed = np.hypot(r * w, v)
    share = np.where(speed > 0, speed, np.inf)
    round_, along = r * w / share, v / share
    size = mu / np.sqrt(1.0 + (mu * round_) ** 2) if load.model == "circle" else np.full(T, mu)
    D = -size * (r * round_ * _couple(u) + along * _force_at(p, u))
    across = np.eye(3)[:, :, None] - u[:, None] * u[None]
    U, at = skew(u), skew(p)
    offset = 0.5 * (load.width or 0.0) / L
    K = np.concatenate([size * along * offset * U, np.zeros((3, 3, T))])
    if load.length is None:
        yield Place(k, _rows(np.zeros((3, 3, T)), across), D, K, preload)
    else:
        b = load.length / L
        for side in (1.0, -1.0):
            bending = np.einsum("ijt,jkt->ikt", U, at)
            yield Place(k, _rows(-side / b * U, 0.5 * across + side / b * bending), D, K, preload)
    if load.width:
        about = _rows(u[None], -np.einsum("it,ijt->jt", u, at)[None])
        yield Place(
            k, 2 * L / abs(load.width) * about, -mu * np.sign(v) * _force_at(p, u), np.zeros((6, 1, T)), preload
        )


@dataclass(frozen=True)
class Rubbed:
    """Friction that came about: ``efforts (F, T)``, the part of the wrenches on links b that their own pairs take up ``taken (6, P, T)``,
    the ``normals (m, T)``; ``outcome (T,)`` by its number and by how much friction would have to
    fall ``factor (T,)``.
    """

    efforts: Array
    taken: Array
    normals: Array
    outcome: Array
    factor: Array


def rubbed(here: Configuration, places: Sequence[Place], base: Array, unit: dict[int, Array], stress: Array) -> Rubbed:
    """Solve for the normal forces; ``base (6, P, T)`` reactions without friction, ``unit`` those of a unit effort in freedoms, by column.

    Normal forces that ``stress (6, P, s, T)`` may change have to be zero along it: the least friction, no force locked in.
    """
    s, T, m = here.system, here.T, len(places)
    dims = [place.A.shape[0] for place in places]
    starts = np.concatenate([[0], np.cumsum(dims)]).astype(np.intp)
    parts = [(place.D[:, None], place.K) for place in places]
    split = [[_parted(here, place.pair, W) for W in both] for place, both in zip(places, parts, strict=True)]
    a, B, C = np.zeros((starts[-1], T)), np.zeros((starts[-1], m, T)), np.zeros((starts[-1], starts[-1], T))
    for t, place in enumerate(places):
        mine = slice(starts[t], starts[t + 1])
        a[mine] = np.einsum("dct,ct->dt", place.A, base[:, place.pair])
        for o, other in enumerate(places):
            for (efforts, taken), into in zip(
                split[o], (B[mine, o : o + 1], C[mine, starts[o] : starts[o + 1]]), strict=True
            ):
                moved = -taken if other.pair == place.pair else np.zeros_like(taken)
                first = int(s.first_column[other.pair])
                for j in range(efforts.shape[0]):
                    moved = moved + unit[first + j][:, place.pair, None] * efforts[j]
                into[:] = np.einsum("dct,cnt->dnt", place.A, moved)
    a = a + np.einsum("dnt,n->dt", B, [place.preload for place in places])
    n, V, outcome, factor = _normals(a, B, C, starts)
    largest = np.abs(base).max(axis=(0, 1), initial=0.0)
    for t, place in enumerate(places):
        loose = np.einsum("dct,cst->dst", place.A, stress[:, place.pair])
        if loose.size and (size := np.sqrt((loose**2).sum(axis=(0, 1)))).max(initial=0.0) > STRESSES.unique:
            along = np.abs(np.einsum("dst,dt->st", loose, np.nan_to_num(V[starts[t] : starts[t + 1]]))).max(
                axis=0, initial=0.0
            )
            unknown = (size > STRESSES.unique) & (along > STRESSES.unique * size * largest)
            outcome = np.where((outcome == 0) & unknown, OUTCOMES.index("friction not determined"), outcome)
    n, V = np.where(outcome > 0, np.nan, n), np.where(outcome > 0, np.nan, V)
    n = n + np.array([place.preload for place in places])[:, None]
    efforts, taken = np.zeros((s.n_freedoms, T)), np.zeros((6, len(s.m.pairs), T))
    for t, place in enumerate(places):
        first, mine = int(s.first_column[place.pair]), slice(starts[t], starts[t + 1])
        for (own, held), size in zip(split[t], (n[t : t + 1], V[mine]), strict=True):
            efforts[first : first + len(own)] += np.einsum("fnt,nt->ft", own, size)
            taken[:, place.pair] += np.einsum("cnt,nt->ct", held, size)
    return Rubbed(efforts, taken, n, outcome, factor)


def _parted(here: Configuration, k: int, W: Array) -> tuple[Array, Array]:
    """Wrenches ``(6, n, T)`` in a pair as efforts in its freedoms ``(f, n, T)``, and what is left, which it takes up itself."""
    s = here.system
    mine = slice(first := int(s.first_column[k]), first + s.m.pairs[k].type.f)
    efforts = np.einsum("cft,cnt->fnt", here.S[:, mine], W)
    return efforts, W - np.einsum("cft,fnt->cnt", here.E[:, mine], efforts)


def _normals(a: Array, B: Array, C: Array, starts: Index) -> tuple[Array, Array, Array, Array]:
    """Sizes ``n (m, T)`` and normal vectors of all places, outcomes and factors ``(T,)``."""
    a, B, C = (np.moveaxis(part, -1, 0) for part in (a, B, C))
    m = B.shape[2]
    linear = np.linalg.solve(np.eye(a.shape[1]) - C, np.concatenate([a[..., None], B], axis=2))
    free, per = linear[..., 0], linear[..., 1:]
    sized = np.sqrt(np.add.reduceat(linear**2, starts[:-1], axis=1))
    alone = np.abs(np.linalg.eigvals(sized[..., 1:])).max(axis=1, initial=0.0) < 1.0
    n, done = sized[..., 0], np.zeros(len(a), dtype=bool)
    scale = np.abs(free).max(axis=1, initial=1e-300)
    for _ in range(60):
        V = free + np.einsum("tdn,tn->td", per, n)
        size = np.sqrt(np.add.reduceat(V * V, starts[:-1], axis=1))
        off = n - size
        done = np.abs(off).max(axis=1, initial=0.0) <= 1e-14 * np.maximum(scale, size.max(axis=1, initial=0.0))
        if (done | ~alone).all():
            break
        unit = V / np.repeat(np.where(size > 0, size, np.inf), np.diff(starts), axis=1)
        slope = np.add.reduceat(unit[..., None] * per, starts[:-1], axis=1)
        slope[~alone] = 0.0  # looked at one by one, below
        n = np.where(done[:, None], n, n - np.linalg.solve(np.eye(m) - slope, off[..., None])[..., 0])
    outcome, factor = np.zeros(len(a), dtype=int), np.full(len(a), np.nan)
    for t in np.flatnonzero(~(done & alone)):
        n[t], outcome[t], factor[t] = _grown(a[t], B[t], C[t], starts)
    V = free + np.einsum("tdn,tn->td", per, n)
    return n.T, V.T, outcome, factor


def _newton(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> tuple[Array, bool]:
    """Newton's method on ``n - |V(n)|`` with friction times k, and whether it ends."""
    inverse = np.linalg.inv(np.eye(len(a)) - k * C)
    scale = max(float(np.abs(a).max(initial=0.0)), 1e-300)
    for _ in range(60):
        V = inverse @ (a + k * B @ n)
        size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
        off = n - size
        if np.abs(off).max(initial=0.0) <= 1e-14 * max(scale, float(size.max(initial=0.0))):
            return size, True
        n = n - np.linalg.lstsq(np.eye(len(n)) - _slope(V, size, k * inverse @ B, starts), off)[0]
        if not np.isfinite(n).all() or np.abs(n).max() > 1e12 * scale:
            return n, False
    return n, bool(np.abs(off).max() <= 1e-11 * max(scale, float(size.max(initial=0.0))))


def _slope(V: Array, size: Array, B: Array, starts: Index) -> Array:
    """``d|V| / dn``."""
    unit = V / np.where(size > 0, size, np.inf).repeat(np.diff(starts))
    return np.asarray(np.add.reduceat(unit[:, None] * B, starts[:-1], axis=0))


def _grown(a: Array, B: Array, C: Array, starts: Index) -> tuple[Array, int, float]:
    """The solution that is connected with the frictionless one while friction grows; why there is none, and at which part of it."""
    n, _ = _newton(a, B, C, starts, 0.0, np.zeros(B.shape[1]))
    k, step = 0.0, 1 / 64
    while k < 1.0:
        ahead = min(1.0, k + step)
        new, met = _newton(a, B, C, starts, ahead, n)
        near = np.abs(new - n).max() <= 0.5 * np.abs(new).max() or not new.any()
        if met and near and (new >= 0).all() and _rises(a, B, C, starts, ahead, new):
            k, n, step = ahead, new, min(2 * step, 1 / 64)
            continue
        step /= 2
        if step < 1e-9:  # far below what tells friction from friction
            return _ended(a, B, C, starts, k, n)
    return (n, 3, np.nan) if _others(a, B, C, starts, n) else (n, 0, np.nan)


def _rises(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> bool:
    """Whether normal forces still grow with what presses: no fold, nor its other side."""
    inverse = np.linalg.inv(np.eye(len(a)) - k * C)
    V = inverse @ (a + k * B @ n)
    size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
    return bool(np.linalg.det(np.eye(len(n)) - _slope(V, size, k * inverse @ B, starts)) > 0)


def _ended(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> tuple[Array, int, float]:
    """Why the solution ends at a part ``k`` of the friction: without bound, where ``1 - k |V|'`` is singular along n, or a fold."""
    inverse = np.linalg.inv(np.eye(len(a)) - k * C)
    V = inverse @ (a + k * B @ n)
    size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
    without_bound = float(n.max(initial=0.0)) > 1e5 * max(float(np.abs(a).max(initial=0.0)), 1e-300)
    values = np.linalg.eigvals(_slope(V, size, inverse @ B, starts))
    real = values.real[(np.abs(values.imag) < 1e-6 * np.abs(values).max()) & (values.real > 0)]
    factor = 1.0 / float(real.max()) if without_bound and real.size and not C.any() else k
    return n, 1 if without_bound else 2, factor


def _others(a: Array, B: Array, C: Array, starts: Index, n: Array) -> bool:
    """Whether other solutions are there, sought over the signs of normal forces where all are numbers and few."""
    m = len(n)
    if (np.diff(starts) > 1).any() or m > 10:
        return False
    linear = np.linalg.solve(np.eye(m) - C, np.column_stack([a, B]))
    for signs in product((1.0, -1.0), repeat=m):
        s = np.array(signs)
        try:
            found = np.linalg.solve(np.diag(s) - linear[:, 1:], linear[:, 0])
        except np.linalg.LinAlgError:
            continue
        if (found >= 0).all() and np.abs(found - n).max() > 1e-9 * max(np.abs(n).max(), 1e-300):
            return True
    return False
