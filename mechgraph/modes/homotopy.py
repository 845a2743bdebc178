"""Closure equations along a path of members of a class, and the tracks of their assemblies, all in one batch of complex numbers.

On a leg every marker goes from its start to its end on a screw motion ``exp(t eta)``, drivers go straight; ``t`` may be complex. The
equations are the closure rows of the kernel, mixed at random where they depend on each other; along passive motions nothing moves, so
that a track is one of assemblies up to these.

A step is predicted from the rates at the last nodes and corrected by two Newton steps; its length is such that the first of them has
the size wanted (Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapter 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from contextvars import ContextVar
from dataclasses import field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Index, finite_twist, homogeneous, move_twist, multiplied, quaternion_product
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.compiled_tracks import CompiledTracks, Led, LedRow, LegNumbers
from mechgraph.modes.family import Array, Family, Member
from mechgraph.pairs.factors import screw_terms, screw_values

Mask = NDArray[np.bool_]

ENDLESS_STATE = (25.0, 1e5, 1e3)
"""Imaginary part of an angle, length over L, and quaternion from which on an assembly is on its way to infinity."""
RATES_KEPT = 3
"""Nodes from whose rates a step is predicted."""
FIRST_STEP = 0.02
"""The first step of a track, as part of its way."""

TRACKS_TOGETHER = 600
"""Tracks followed together, at most, of several positions or loops."""


ELSEWHERE: ContextVar[Executor | None] = ContextVar("ELSEWHERE", default=None)
"""Who follows tracks, in parts; None: this process."""


class Equations:
    """Closure equations of a class: the closure rows, mixed ``(rank, rows)`` where they depend on each other."""

    def __init__(self, family: Family, mixing: Array | None) -> None:
        self.family, self.mixing = family, mixing
        s = family.system
        self.idle = family.passive.shape[1]
        self._columns = np.flatnonzero(s.single_rows >= 0)
        self._rows = s.single_rows[self._columns]
        self._lengths = s.single_rows[s.is_length]
        self._angles = np.setdiff1d(self._rows, self._lengths)
        self._quaternions = complement(self._rows, s.n_state)

    @cached_property
    def compiled(self) -> CompiledTracks | None:
        """Tracks in the kernel, where it serves the class: ends of rods are pairs of their own, on which side 1 is on the body."""
        f, s, n = self.family, self.family.system, len(self.family.points[0]) if self.family.points else 0
        P, d = len(s.m.pairs), len(f.columns)
        ends = [[P + 2 * i, 0, f.points[0][i], P + 2 * i + 1, 0, f.points[1][i]] for i in range(n)]
        rank = s.n_rows if self.mixing is None else len(self.mixing)
        columns, ways = np.concatenate([f.columns, np.full(n, -1)]), getattr(s, "ways", np.zeros(0))
        led = Led(
            s, f.here.x[:, 0], s.n_state, columns, np.ones((1, d + n)), [LedRow(rank, f.unknowns, f.free, self.mixing)],
            P + 2 * n, ends, ways, d + np.arange(n),
        )  # fmt: skip
        return CompiledTracks(led) if led.served else None

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments ``dq (F, T)``."""
        return self.family.system.advance(x, dq)

    def fingerprints(self, member: Member, x: Array) -> Array:
        """What tells assemblies of a member apart ``(n, V)``, see ``Family.prints``."""
        return self.family.prints(Configuration(self.family.system_of(member), x))

    def leg(self, begin: Member, end: Member, which: Index | None = None) -> Leg:
        """The ways between members."""
        return Leg(self, begin, end, which)

    def state_rates(self, x: Array, dq: Array) -> Array:
        """Rates ``(nx, T)`` of states for rates ``dq (F, T)``: singles are their own, ``Q' = (0, w) Q / 2``."""
        turns = self.family.system.rotations
        out = np.empty((self.family.system.n_state, *dq.shape[1:]), dtype=np.result_type(x, dq))
        out[self._rows] = dq[self._columns]
        if turns is not None:
            w = dq[turns[0]]
            out[turns[1]] = 0.5 * quaternion_product(np.concatenate([np.zeros_like(w[:1]), w]), x[turns[1]])
        return out

    def normal(self, x: Array) -> Array:
        """States with unit quaternions."""
        s = self.family.system
        if s.rotations is None:
            return x
        out, Q = x.copy(), x[s.rotations[1]]
        out[s.rotations[1]] = Q / np.sqrt((Q * Q).sum(axis=0))
        return out

    def far(self, x: Array, angle: float = ENDLESS_STATE[0]) -> Mask:
        """Which states are on their way to infinity, angles with an imaginary part above ``angle``."""
        sizes = (np.abs(x[self._angles].imag), np.abs(x[self._lengths]), np.abs(x[self._quaternions]))
        out: Mask = np.asarray(~np.isfinite(x).all(axis=0))
        for size, limit in zip(sizes, (angle, *ENDLESS_STATE[1:]), strict=True):
            out |= size.max(axis=0, initial=0.0) > limit
        return out

    def wound(self, change: Array) -> Array:
        """Largest change ``(T,)`` of an angle."""
        return np.asarray(np.abs(change[self._angles]).max(axis=0, initial=0.0))

    def size(self, x: Array, dq: Array) -> Array:
        """Largest component ``(T,)`` of increments, those of slides against their size."""
        s = self.family.system
        size = np.abs(dq)
        size[s.is_length] /= 1.0 + np.abs(x[self._lengths])
        return np.asarray(size.max(axis=0, initial=0.0))


class Corrected(NamedTuple):
    """Predictions corrected by two Newton steps: states, rates of these, sizes of both steps, their noise, and idle motions."""

    x: Array
    v: Array
    sizes: Sequence[Array]
    noise: Array
    idle: Array


class Ways:
    """What ways of all kinds have in common."""

    equations: Any
    at: Callable[..., Any]

    def keeps(self, before: Array, after: Array) -> Mask | bool:
        """Which steps may lead from states to others."""
        return True

    def corrected(self, x: Array, t: Array, dt: Array, tracks: Index, idle: Array) -> Corrected:
        """Predictions ``x (nx, T)`` at ``t (T,)`` corrected, with rates ``dt`` times those with ``t``."""
        eq = self.equations
        here = self.at(eq.normal(x), t, tracks)
        one = here.newton(idle)
        here = here.again(eq.advance(here.x, one))
        two = here.newton(idle)
        sizes = [eq.size(here.x, d) for d in (one, two)]
        rates, idle = here.rates(idle)
        return Corrected(eq.advance(here.x, two), eq.state_rates(here.x, rates) * dt, sizes, here.noise, idle)


class Leg(Ways):
    """The ways between members ``begin`` and ``end``, one or several; ``which (V,)`` says which of them a track follows."""

    def __init__(self, equations: Equations, begin: Member, end: Member, which: Index | None = None) -> None:
        self.equations, self.family = equations, equations.family
        moves = (end.markers != begin.markers).any(axis=(0, 1, 3))
        self._moving, self._still = np.flatnonzero(moves), np.flatnonzero(~moves)
        self._rest = begin.markers[:, :, self._still]
        first, last = (markers[:, :, self._moving] for markers in (begin.markers, end.markers))
        R = multiplied(last[:, :3], first[:, :3].swapaxes(0, 1))
        eta = finite_twist(R, last[:, 3], first[:, 3])
        turn = np.sqrt((eta[:3] * eta[:3]).sum(axis=0))
        slides = np.abs(turn) < MODES.slide
        self._turn = np.where(slides, 1.0, turn)
        unit = eta / self._turn
        unit[:3] = np.where(slides, 0.0, unit[:3])
        self._eta = np.zeros((6, len(moves), eta.shape[2]), dtype=complex)
        self._eta[:, self._moving] = np.where(slides, self._turn * unit, eta)
        self._paths = np.einsum("ijknt,jlnt->ilknt", screw_terms(unit)[:3], homogeneous(first))
        self._begin, self._change = begin.drive, end.drive - begin.drive
        self._begin_markers = begin.markers
        self._which = which

    def corrected(self, x: Array, t: Array, dt: Array, tracks: Index, idle: Array) -> Corrected:
        """See there."""
        compiled = self.equations.compiled
        if compiled is None:
            return super().corrected(x, t, dt, tracks, idle)
        which = np.zeros(len(t), dtype=np.intp) if self._which is None else self._which[tracks]
        x, _, v, (*sizes, size) = compiled.tracked(self._numbers, which, t, x, rate=dt)
        return Corrected(x, v, sizes, rounding(size), idle)

    @cached_property
    def _numbers(self) -> LegNumbers:
        """The ways as the kernel takes them."""
        P, n = len(self.family.system.m.pairs), len(self.family.bearers)
        # markers A, markers B, and the points of rods on their bodies, those of ends a first
        side = np.repeat([0, 1, 1], [P, P, n - 2 * P])
        pair = np.concatenate([np.arange(P), np.arange(P), P + np.arange(n - 2 * P).reshape(-1, 2).T.ravel()])
        begin = np.zeros((3, 3, 2, P + (n - 2 * P), self._begin_markers.shape[-1]), dtype=complex)
        begin[1, 2], begin[2, 0] = 1.0, 1.0
        # points, axes and second directions
        begin[:, :, side, pair] = self._begin_markers[:, [3, 2, 0]].swapaxes(0, 1)
        screws = np.zeros((6, *begin.shape[2:4], self._eta.shape[-1]), dtype=complex)
        screws[:, side, pair] = self._eta
        asked = self._begin[None], self._change[None]
        return LegNumbers(begin, screws, np.zeros((3, *begin.shape[1:4], 1)), *asked).joined

    def _of(self, values: Array, tracks: Index) -> Array:
        """Values ``(..., ways)`` for tracks."""
        return values if self._which is None or values.shape[-1] == 1 else values[..., self._which[tracks]]

    def prints(self, x: Array, t: Array, tracks: Index) -> Array:
        """What tells assemblies apart, see ``Family.prints``."""
        return self.family.prints(self.at(x, t, tracks).here)

    def at(self, x: Array, t: Array, tracks: Index) -> Linear:
        """The equations at states ``x (nx, T)`` of tracks at ``t (T,)``."""
        x = x.copy()
        change = self._of(self._change, tracks)
        drive = self._of(self._begin, tracks) + t * change
        x[self.family.rows] = drive[: len(self.family.rows)]
        paths, values = self._of(self._paths, tracks), screw_values(self._of(self._turn, tracks) * t)
        markers = np.empty((3, 4, self._eta.shape[1], len(t)), dtype=complex)
        markers[:, :, self._still] = self._of(self._rest, tracks)
        one = paths.shape[-1] == 1
        markers[:, :, self._moving] = (
            np.einsum("ijkn,knt->ijnt", paths[..., 0], values) if one else np.einsum("ijknt,knt->ijnt", paths, values)
        )
        here = Configuration(self.family.system_with(markers, drive), x)
        return Linear(self, here, change, self._of(self._eta, tracks))


class RealLeg(Leg):
    """The ways between real members, for assemblies that are not real: none goes over to its conjugate, as it could past a double point."""

    def keeps(self, before: Array, after: Array) -> Mask:
        """Those along which imaginary parts turn by less than 60 degrees."""
        a, b = before.imag, after.imag
        return np.asarray((a * b).sum(axis=0) > 0.5 * np.sqrt((a * a).sum(axis=0) * (b * b).sum(axis=0)))


class Linear:
    """The equations linearized at a batch of states."""

    def __init__(self, leg: Leg, here: Configuration, change: Array, eta: Array) -> None:
        self.equations, self.family, self.here, self.change, self._eta = leg.equations, leg.family, here, change, eta
        self._leg = leg
        self.J = self._mixed(here.J[:, self.family.free])

    @property
    def x(self) -> Array:
        """The states ``(nx, T)``."""
        return self.here.x

    def again(self, x: Array) -> Linear:
        """The equations of the same members at other states ``x (nx, T)`` with the same values of drivers."""
        return Linear(self._leg, Configuration(self.here.system, x), self.change, self._eta)

    def _mixed(self, rows: Array) -> Array:
        M = self.equations.mixing
        return rows if M is None else np.tensordot(M, rows, 1)

    def solve(self, idle: Array, right: Array) -> Array:
        """``dq (F, k, T)`` with ``J dq = right (rank, k, T)``, at rest along the motions ``idle (T, p, free)``; NaN where singular."""
        n, p, T = self.J.shape[1], idle.shape[1], right.shape[2]
        A = np.empty((T, n, n), dtype=complex)
        A[:, : n - p], A[:, n - p :] = self.J.transpose(2, 0, 1), idle
        b = np.zeros((T, n, right.shape[1]), dtype=complex)
        b[:, : n - p] = right[: n - p].transpose(2, 0, 1)
        if len(right) > n - p:
            b[:, n - p :] = right[n - p :].transpose(2, 0, 1)
        out = np.zeros((self.family.system.n_freedoms, right.shape[1], T), dtype=complex)
        out[self.family.free] = solved(A, b).transpose(1, 2, 0)
        return out

    @property
    def noise(self) -> Array:
        """Rounding ``(T,)`` to be expected of a Newton step."""
        return rounding(np.abs(self.here.poses).max(axis=(0, 1, 2)))

    def newton(self, idle: Array) -> Array:
        """The Newton step ``(F, T)``."""
        return self.solve(idle, -self._mixed(self.here.residual)[:, None])[:, 0]

    def rates(self, idle: Array) -> tuple[Array, Array]:
        """Rates ``(F, T)`` of the freedoms with ``t``, and the idle motions ``(T, p, free)`` conjugate, of unit size."""
        here, p = self.here, idle.shape[1]
        V = move_twist(
            here.poses[:, :, self.family.bearers], np.broadcast_to(self._eta, (*self._eta.shape[:2], here.T))
        )
        moved = self.family.open_by(here, V, self.change)
        right = np.zeros((self.J.shape[1], 1 + p, here.T), dtype=complex)
        right[: self.J.shape[0], 0] = -self._mixed(moved)
        right[self.J.shape[0] :, 1:] = np.eye(p)[:, :, None]
        out = self.solve(idle, right)
        rates = out[:, 0]
        rates[self.family.columns] = self.change[: len(self.family.columns)]
        if not p:
            return rates, idle
        motions = out[self.family.free, 1:].transpose(2, 0, 1)
        return rates, np.linalg.qr(np.where(np.isfinite(motions), motions, 0.0))[0].conj().swapaxes(1, 2)

    def idle(self) -> Array:
        """The motions ``(T, p, free)`` conjugate, orthonormal, that the equations leave free: passive ones."""
        J = self.J.transpose(2, 1, 0)
        rank = J.shape[2]
        if J.shape[1] == rank:
            return np.zeros((len(J), 0, rank), dtype=complex)
        Q = np.linalg.qr(np.where(np.isfinite(J), J, 0.0).conj(), mode="complete")[0]
        return np.asarray(Q[:, :, rank:].conj().swapaxes(1, 2))


def solved(A: Array, b: Array) -> Array:
    """``A^-1 b`` of a batch, NaN where a matrix is singular."""
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        out = np.full(b.shape, np.nan, dtype=complex)
        for i in range(len(b)):
            with suppress(np.linalg.LinAlgError):
                out[i] = np.linalg.solve(A[i], b[i])
        return out


@dataclass
class Tracked:
    """Where tracks came to: states ``(nx, V)``, parameters ``s (V,)``, whether they arrived, and whether they went to infinity."""

    x: Array
    s: Array
    arrived: Mask
    infinite: Mask


@dataclass(frozen=True)
class Care:
    """How carefully tracks are followed: size of the first Newton step that is wanted, and that is still accepted; ``noise`` is the
    rounding with which they may end.
    """

    aim: float = 1e-2
    most: float = 5e-2
    noise: float = field(default_factory=lambda: MODES.most_noise)

    @property
    def finer(self) -> Care:
        """Ten times as careful."""
        return replace(self, aim=0.1 * self.aim, most=0.1 * self.most)


Equated: TypeAlias = Any
Followed: TypeAlias = Any
"""Equations of a class as ``Equations`` has them, and a way of them as ``Leg``; of synthesis too, which has others of its own."""
Way = Callable[[Array], tuple[Array, Array]]
"""``t`` and ``dt/ds`` at ``s (T,)`` in [0, 1]."""


def straight(s: Array) -> tuple[Array, Array]:
    """``t = s``."""
    return s, np.ones_like(s)


def follow(
    leg: Followed,
    x: Array,
    care: Care,
    way: Way = straight,
    tracks: Index | None = None,
    polish: bool = True,
    laps: int = 1,
    stride: int = 0,
    enough: Callable[[Tracked], bool] | None = None,
    told: Callable[[str], None] | None = None,
) -> Tracked:
    """Tracks from states ``x (nx, V)`` at ``s = 0`` to ``s = 1``, at the end polished; ``tracks`` are their numbers on the leg.

    Of several ``laps`` each one follows the ways ``stride`` (else V) numbers further on from where the last one ended. There no track waits
    for others, and the last ones, which may come near to where assemblies meet, are given up where they take twice the steps of all others.
    Where what has arrived is ``enough``, the others stay on their way.
    ``told`` is now and then how far they are.
    """
    V = x.shape[1]
    every, stride = np.arange(V) if tracks is None else tracks, stride or V
    # ways round an end are short, and no data
    if (executor := ELSEWHERE.get()) is not None and way is straight and V > 1:
        blocks = np.array_split(np.arange(V), min(-(-V // 32), 64))
        parts = [
            executor.submit(_followed_here, leg, x[:, at], care, straight, every[at], polish, laps, stride)
            for at in blocks
        ]
        each = []
        for k, part in enumerate(parts, 1):
            each.append(vars(part.result()).values())
            if told is not None and k < len(parts):
                told(f"{k} of {len(parts)} parts of the tracks came")
        return Tracked(*(np.concatenate(values, axis=-1) for values in zip(*each, strict=True)))
    out = Tracked(x.copy(), np.zeros(V), np.zeros(V, dtype=bool), np.zeros(V, dtype=bool))
    march = _March(leg, x, every, way, stride)
    # steps after which a track is given up
    most, silent = 2000 * laps, 0
    for step in range(most):
        # numbers of states that are led on until a line is told: some seconds
        silent += march.x.size
        if told is not None and silent > 200_000:
            told(f"{V - len(march.who)} of {V} tracks came so far")
            silent = 0
        # tracks that are not waited for
        if laps > 1 and most == 2000 * laps and 20 * len(march.who) <= V:
            most = 2 * step
        if not len(march.who) or step >= most:
            break
        ended, infinite = march.step(care)
        ended &= ~march.again(ended & (march.lap + 1 < laps))
        for mask, flag in ((ended, out.arrived), (infinite, out.infinite)):
            flag[march.who[mask]] = True
        out.x[:, march.who], out.s[march.who] = march.x, march.s[0]
        if enough is not None and ended.any() and enough(out):
            break
        # smallest step, as part of what is left of the way (of 1e-4 of it at least: steps are short before an end that is nearly singular)
        stuck = (march.h < 1e-7 * np.clip(1.0 - march.s[0], 1e-4, 1.0)) & (march.known >= 0)
        march.keep(~(ended | infinite | stuck))
    done = np.flatnonzero(out.arrived)
    if done.size and polish:
        out.x[:, done], good = polished(
            leg, out.x[:, done], way(np.ones(1))[0][0], every[done] + (laps - 1) * stride, care.noise
        )
        out.arrived[done] = good
    return out


def _followed_here(*asked: Any) -> Tracked:
    """Tracks followed by this process, which may be a copy of one that has others do so."""
    ELSEWHERE.set(None)
    return follow(*asked)


class _March:
    """Tracks on their way: ``who`` they are, states, places and next steps, and the rates at the last nodes, the newest first."""

    def __init__(self, leg: Followed, x: Array, every: Index, way: Way, stride: int) -> None:
        V = x.shape[1]
        self.leg, self.way, self.every, self.stride = leg, way, every, stride
        self.who, self.x, self.h = np.arange(V), x.copy(), np.full(V, FIRST_STEP)
        self.s, self.known, self.lap = np.zeros((RATES_KEPT, V)), np.zeros(V, dtype=np.intp), np.zeros(V, dtype=np.intp)
        t, dt = way(self.s[0])
        here = leg.at(self.x, t, every)
        rates, self.idle = here.rates(here.idle())
        self.v = np.zeros((RATES_KEPT, *x.shape), dtype=complex)
        self.v[0] = leg.equations.state_rates(self.x, rates) * dt

    def step(self, care: Care) -> tuple[Mask, Mask]:
        """One step of all tracks; which have ended, and which are on their way to infinity."""
        s = np.minimum(self.s[0] + self.h, 1.0)
        h = s - self.s[0]
        tracks = self.every[self.who] + self.lap * self.stride
        with np.errstate(all="ignore"):
            t, dt = self.way(s)
            x, v, sizes, noise, idle = self.leg.corrected(self.x + self._ahead(h), t, dt, tracks, self.idle)
            good = (sizes[0] <= care.most) & (sizes[1] <= 0.1 * sizes[0] + np.clip(noise, 1e-10, care.aim))
        good &= np.isfinite(v).all(axis=0) & self.leg.keeps(self.x, x)
        order = 1.0 / (1.0 + np.minimum(self.known + 1, RATES_KEPT))
        grown = h * np.clip((care.aim / np.maximum(sizes[0], 1e-12)) ** order, 0.4, 2.0)
        # no step is longer than 0.25
        self.h = np.where(good, np.minimum(np.where(np.isfinite(grown), grown, h), 0.25), 0.4 * h)
        self.h[good & (self.known < 0)] = FIRST_STEP
        at = np.flatnonzero(good)
        for old, new in ((self.s, s), (self.v, v)):
            old[1:, ..., at] = old[:-1, ..., at]
            newest = old[0]
            newest[..., at] = new[..., at]
        self.known[at] += 1
        self.x[:, at], self.idle[at] = x[:, at], idle[at]
        return self.s[0] >= 1.0, self.leg.equations.far(self.x)

    def _ahead(self, h: Array) -> Array:
        """Increments ``(nx, T)`` of the states over steps ``h``: the polynomial through the rates of the last nodes, integrated.

        (Adams and Bashforth with steps of their own; an interpolation of states would carry on what no correction touches.) Beyond it terms
        go on as the last ones do, in the ratio that fits these best: so they do where a branch point is near.
        """
        (s0, s1, s2), (v0, v1, v2), two, three = self.s, self.v, self.known >= 1, self.known >= 2
        first, second, both = (
            np.where(known, gap, 1.0) for known, gap in ((two, s0 - s1), (three, s1 - s2), (three, s0 - s2))
        )
        slope, half = (v0 - v1) / first, 0.5 * h * h
        bend = (slope - (v1 - v2) / second) / both
        before = np.where(two, slope * half, 0.0)
        term = np.where(three, bend * (h**3 / 3.0 + first * half), 0.0)
        out = h * v0 + before + term
        ratio = (before.conj() * term).sum(axis=0) / np.maximum((before * before.conj()).real.sum(axis=0), 1e-300)
        ratio *= np.minimum(1.0, 0.8 / np.maximum(np.abs(ratio), 0.8))
        return out + term * ratio / (1.0 - ratio)

    def again(self, which: Mask) -> Mask:
        """Begin the next lap of some tracks, with a step of length zero, which finds its rates."""
        self.lap[which] += 1
        self.s[:, which], self.h[which], self.known[which] = 0.0, 0.0, -1
        return which

    def keep(self, going: Mask) -> None:
        """Go on with some of the tracks."""
        if not going.all():
            self.idle = self.idle[going]
            for name in ("who", "x", "h", "s", "known", "lap", "v"):
                setattr(self, name, getattr(self, name)[..., going])


def rounding(size: Array) -> Array:
    """Rounding to be expected of a Newton step where the largest numbers in poses are of such a ``size``."""
    # rounding of a Newton step, against the third power of the largest number in a pose (poses multiply along loops)
    return np.asarray(3e-14 * size**3)


def polished(leg: Followed, x: Array, t: complex, tracks: Index, most: float | None = None) -> tuple[Array, Mask]:
    """States closed by Newton to rounding at one ``t``, passive bodies turned to where they are least imaginary; which closed."""
    eq = leg.equations
    places = np.full(x.shape[1], t)
    with np.errstate(all="ignore"):
        here = leg.at(x, places, tracks)
        # passive bodies are turned in so many steps, at most
        for _ in range(8 if eq.idle else 0):
            step = _calming(eq, here)
            # so small a step ends it
            if eq.size(here.x, step).max(initial=0.0) < 1e-4:
                break
            here = here.again(eq.advance(here.x, step))
            here = here.again(eq.advance(here.x, here.newton(here.idle())))
        last, idle = np.full(x.shape[1], np.inf), here.idle()
        # Newton steps at the end of a track, at most
        for i in range(6):
            here = here.again(x) if i else here
            dq = here.newton(idle)
            size = eq.size(here.x, dq)
            x = np.where(size < last, eq.advance(here.x, dq), here.x)
            last = np.fmin(size, last)
            # last Newton step at the end of a track
            if (last < 1e-12).all():
                break
        noise = np.minimum(here.noise, MODES.most_noise if most is None else most)
    # last Newton step, against the size of the state, up to which a track has come to its end
    return x, last < 1e-8 * np.maximum(1.0, np.abs(x).max(axis=0)) + noise


def _calming(eq: Equations, here: Linear) -> Array:
    """Increments ``(F, T)`` along passive motions that take as much of the imaginary part of the states away as can be."""
    s, idle = eq.family.system, here.idle()
    moves = np.zeros((s.n_freedoms, eq.idle, here.here.T), dtype=complex)
    moves[eq.family.free] = idle.conj().transpose(2, 1, 0)
    X = np.stack([eq.state_rates(here.here.x, moves[:, i]) for i in range(eq.idle)], axis=-1).transpose(1, 0, 2)
    both = np.concatenate([X.imag, X.real], axis=2)
    c = -(np.linalg.pinv(both, rcond=1e-6) @ here.here.x.imag.T[..., None])[..., 0]
    c = c[:, : eq.idle] + 1j * c[:, eq.idle :]
    step = np.einsum("fpt,tp->ft", moves, c)
    # no step turns them further than 1
    return np.asarray(step * np.minimum(1.0, 1.0 / np.maximum(np.abs(step).max(axis=0, initial=0.0), 1e-300)))
