"""Where loads act: inertia and applied wrenches of all links, given efforts, and what holds passive bodies, at a batch of positions."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import PerCase
from mechgraph.kinematics.rates import PassiveMotion, PassiveMotions, Rates, Velocities
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.maths.se3 import Array, cross, rotate, rotate_back
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.model.loads import Load, Value
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import real_array, wrong


def inertia_wrenches(here: Configuration, rates: Rates) -> Array:
    """Inertia wrenches ``-(I A + V x* I V)`` of all links about the internal origin, ``(6, N, T)``.

    Force ``-m a_c``, moment about the mass center ``-(I_c alpha + w x I_c w)``, the inertia turning with the link.
    """
    par = here.system.par
    R, p = here.poses[:, :3], here.poses[:, 3]
    c = rotate(R, par.center) + p
    w, alpha = rates.V[:3], rates.A[:3]
    velocity = rates.V[3:] + cross(w, c)
    acceleration = rates.A[3:] + cross(alpha, c) + cross(w, velocity)
    w_body, alpha_body = rotate_back(R, w), rotate_back(R, alpha)
    turning = rotate(par.inertia, alpha_body) + cross(w_body, rotate(par.inertia, w_body))
    force = -par.mass * acceleration
    return np.concatenate([cross(c, force) - rotate(R, turning), force])


OUT_OF_PLANE = "leaves the x-y plane; expected a force (x, y) or (x, y, 0), and a moment about z"
NOT_FINITE = "gives a value that is not finite at some position; check its callable, or a spring of length 0"


class Site:
    """Collects loads on links and efforts in freedoms; speaks the user's units, about the internal origin.

    Implements ``model.loads.LoadSite``. ``wrenches (6, N, T)``, ``efforts (F, T)``; ``largest`` is the largest single contribution
    (internal units), against which a sum that cancels is rounding.
    """

    solves_friction = False

    def __init__(
        self, here: Configuration, rates: Velocities, coordinates: Array, batch: tuple[int, ...], good: Any, t: Any
    ) -> None:
        self.here, self.rates, self.coordinates = here, rates, coordinates
        self.batch, self.good, self.t = batch, good, t
        system = here.system
        self.m, self.L = system.m, system.par.L
        self._link = self.m.link_index
        self.wrenches = np.zeros((6, len(self.m.links), here.T))
        self.efforts = np.zeros((system.n_freedoms, here.T))
        self.largest = 0.0

    def collect(self, loads: tuple[Load, ...]) -> None:
        """Evaluate all loads."""
        for load in loads:
            load.act(self)
        for sound, fault in ((Site._finite, NOT_FINITE), (Site._in_plane, OUT_OF_PLANE)):
            if not sound(self):
                wrong = next((load for load in loads if not sound(self._of(load))), loads[-1])
                raise DeclarationError(f"load {wrong.where.removesuffix(': ')}", [fault])

    def _finite(self) -> bool:
        return all(np.isfinite(part).all() for part in (self.wrenches, self.efforts))

    def _in_plane(self) -> bool:
        """Whether nothing acts out of the plane of a planar mechanism, but for rounding."""
        span = self.m.span
        outside = [np.abs(self.wrenches[part]).max(initial=0.0) for part in (slice(span.start), slice(span.stop, None))]
        return max(outside) <= 1e-9 * np.abs(self.wrenches).max(initial=0.0)

    def _of(self, load: Load) -> Site:
        """What a load does alone."""
        other = copy(self)
        other.wrenches, other.efforts = np.zeros_like(self.wrenches), np.zeros_like(self.efforts)
        load.act(other)
        return other

    # --- what loads ask ----------------------------------------------------------------------------------------------

    def rotation(self, link: str) -> Array:
        """Rotation of a link ``(3, 3, T)``."""
        return self.here.poses[:, :3, self._link[link]]

    def point(self, link: str, p: Any) -> tuple[Array, Array]:
        """Position and velocity of a material point given in the link's frame, or by its name."""
        i = self._link[link]
        p = self.m.links[i].point(p) if isinstance(p, str) else p
        par = self.here.system.par
        local = (np.asarray(p, dtype=float).reshape(3, -1) - par.offset[:, i, None]) / self.L
        X = self.here.poses[:, :, i]
        at = rotate(X[:, :3], local) + X[:, 3]
        V = self.rates.V[:, i]
        return self.L * at, self.L * (V[3:] + cross(V[:3], at))

    def center(self, link: str) -> Any:
        """Mass center in the link's frame, ``(3, 1)`` or ``(3, T)``, or None."""
        i, par = self._link[link], self.here.system.par
        return None if self.m.link(link).center is None else self.L * par.center[:, i] + par.offset[:, i, None]

    def second_link(self, name: str) -> str:
        """Link b of the pair of a freedom."""
        return self.m.ends_of(name)[1]

    def freedoms_of(self, pair: str) -> tuple[str, ...]:
        """Names of the single freedoms of a pair."""
        p = self.m.pair(pair)
        return tuple(name for name, single in zip(p.freedom_names, p.type.drivable, strict=True) if single)

    def time(self) -> Array | None:
        """Time of every position, ``(T,)``; None where the motion has no times."""
        return None if self.t is None else np.broadcast_to(self.t, self.batch).reshape(-1)[self.good]

    def number(self, value: Any) -> Any:
        """A number or vector, unchanged; one that varies from case to case at every position, ``(T,)`` or ``(3, T)``."""
        if not isinstance(value, PerCase):
            return value
        return np.moveaxis(value.values[self.good // self.batch[-1]], 0, -1)

    def values(self, value: Value, link: str, width: int) -> Array:
        """A value at every position, ``(width, T)``."""
        if isinstance(value, PerCase):
            return np.asarray(self.number(value)).reshape(width, self.here.T)
        if callable(value):
            try:
                given = value(*self.motion_of(link), self.t)
            except Exception as error:
                raise DeclarationError(
                    f"load on {link!r}", [f"its callable (pose, twist, t) failed: {type(error).__name__}: {error}"]
                ) from error
            value = real_array(given)
            if value is None:
                raise DeclarationError(f"load on {link!r}", [wrong(given, "value of its callable", "numbers")])
            value = self._in_space(value) if width == 3 and self.m.planar else value
        array = np.asarray(value, dtype=float)
        if width == 1 and (array.ndim == 0 or array.shape[-1:] != (1,) or len(array.shape) <= len(self.batch)):
            array = array[..., None]
        try:
            full = np.broadcast_to(array, (*self.batch, width))
        except ValueError:
            wanted = (
                "a number, or one a position"
                if width == 1
                else f"{width} components, or as many a position, on the last axis"
            )
            raise DeclarationError(
                f"load on {link!r}",
                [f"value of shape {np.shape(value)} does not fit the positions {self.batch}; expected {wanted}"],
            ) from None
        return np.moveaxis(full.reshape(-1, width)[self.good], -1, 0)

    def _in_space(self, value: Array) -> Array:
        """Of a planar mechanism a force with three numbers, where a function gives two, and a moment where it gives one a position."""
        if value.shape[-1:] == (2,):
            return np.concatenate([value, np.zeros((*value.shape[:-1], 1))], axis=-1)
        if value.shape[-1:] == (3,):
            return value
        one = value if value.shape[-1:] == (1,) and value.ndim > len(self.batch) else value[..., None]
        return np.concatenate([np.zeros((*one.shape[:-1], 2)), one], axis=-1)

    def motion_of(self, link: str) -> tuple[Array, Array]:
        """Pose ``(..., 4, 4)`` and twist ``(..., 6)`` of a link in the user's batch."""
        i = self._link[link]
        twists = user_twists(self.here, self.rates.V)[:, i]
        return self._spread(user_poses(self.here)[i]), self._spread(np.moveaxis(twists, 0, -1))

    def _spread(self, rows: Array) -> Array:
        """Values of the solved positions in the user's batch shape, NaN elsewhere."""
        out = np.full((int(np.prod(self.batch)), *rows.shape[1:]), np.nan)
        out[self.good] = rows
        return out.reshape(*self.batch, *rows.shape[1:])

    def freedom(self, name: str) -> tuple[Array, Array]:
        """Coordinate and rate of a freedom, in the user's units."""
        column = self._column(name)
        rate = self.rates.dq[column] * (self.L if self.here.system.is_length[column] else 1.0)
        return self.coordinates[column], rate

    def _column(self, name: str) -> int:
        k, j = self.m.freedom(name)
        return int(self.here.system.first_column[k]) + j

    # --- what loads do -----------------------------------------------------------------------------------------------

    def add_weight(self, acceleration: Any) -> None:
        """Force ``m g`` at the mass center of every link."""
        par, X = self.here.system.par, self.here.poses
        at = self.L * (rotate(X[:, :3], par.center) + X[:, 3])
        force = np.broadcast_to(par.mass * np.asarray(acceleration, dtype=float).reshape(3, 1, -1), at.shape)
        self._add(slice(None), cross(at, force), force)

    def weight_energy(self, acceleration: Any) -> Array:
        """See ``model.loads.LoadSite``."""
        par, X = self.here.system.par, self.here.poses
        at = self.L * (rotate(X[:, :3], par.center) + X[:, 3]) + par.origin[:, None, None]
        return -np.asarray((par.mass * np.asarray(acceleration, dtype=float).reshape(3, 1, 1) * at).sum(axis=(0, 1)))

    def add_force(self, link: str, force: Array, at: Array) -> None:
        """Force on a link at a position."""
        self._add(self._link[link], cross(at, force), force)

    def add_couple(self, link: str, moment: Array) -> None:
        """Couple on a link."""
        self._add(self._link[link], moment, 0.0)

    def _add(self, links: Any, moment: Array, force: Any) -> None:
        self.wrenches[:3, links] += moment
        self.wrenches[3:, links] += force
        self._note(np.abs(moment).max(initial=0.0) / self.L**2, np.abs(force).max(initial=0.0) / self.L)

    def _note(self, *sizes: float) -> None:
        self.largest = max(self.largest, *map(float, sizes))

    def add_effort(self, name: str, effort: Array) -> None:
        """Effort in a freedom."""
        column = self._column(name)
        self.efforts[column] += effort
        self._note(np.abs(effort).max(initial=0.0) / self.L ** (1 if self.here.system.is_length[column] else 2))

    # --- in internal units -------------------------------------------------------------------------------------------

    def applied(self) -> Array:
        """Wrenches of all loads on all links, ``(6, N, T)``, as internal ones."""
        out = np.empty(self.wrenches.shape)
        np.divide(self.wrenches[:3], self.L**2, out=out[:3])
        np.divide(self.wrenches[3:], self.L, out=out[3:])
        return out

    def scaled_efforts(self) -> Array:
        """Given efforts ``(F, T)`` as internal ones."""
        lengths = self.here.system.is_length[:, None]
        return np.where(lengths, self.efforts / self.L, self.efforts / self.L**2)


def user_twists(here: Configuration, V: Array) -> Array:
    """Twists ``(6, N, T)`` about the global origin in the user's units (rates of twists likewise)."""
    par = here.system.par
    return np.concatenate([V[:3], par.L * V[3:] + cross(par.origin[:, None, None], V[:3])])


def kinetic_power(rates: Rates, inertia: Array) -> Array:
    """Rate of kinetic energy of every link ``(N, T)``: minus the power of its inertia wrench."""
    return -np.asarray((rates.V * inertia).sum(axis=0))


def kinetic_energy(here: Configuration, V: Array) -> Array:
    """``sum over links V . I V / 2``, ``(T,)``, internal units."""
    momentum = inertia_wrenches(here, SimpleNamespace(V=np.zeros_like(V), A=V))  # type: ignore[arg-type]
    return np.asarray(-0.5 * (V * momentum).sum(axis=(0, 1)))


def is_idle(size: Array, terms: Array) -> bool:
    """Whether no effort is needed at any of the positions; those that were not solved are NaN."""
    return bool(np.nanmax(np.abs(size), initial=0.0) <= MOTIONS.idle * np.nanmax(terms, initial=0.0))


def hold_names(m: Mechanism, passive: Iterable[PassiveMotion]) -> list[str]:
    """For every passive motion the names of its links; numbered where the same links have several."""
    links = m.link_names()
    names = [" and ".join(links[i] for i in motion.links) for motion in passive]
    return [f"{name} ({n + 1})" if (n := names[:i].count(name)) else name for i, name in enumerate(names)]


def hold(
    here: Configuration, passive: tuple[PassiveMotion, ...], Z: Array, loads: Array, efforts: Array, largest: float
) -> tuple[Array, Array, Array]:
    """What keeps passive bodies at rest: wrenches ``(6, N, T)`` on them, the effort ``(p, T)`` of every passive motion, and its terms.

    Along every passive motion the power of loads, given efforts and hold vanishes. ``Z (F, p, T)`` spans the motions at each position. The
    hold of a turn is a couple about its axis, that of a slide a force along it, so that it loads no pair of the body; it comes from
    outside the mechanism. The terms ``(p, T)`` are the sizes of what adds up to an effort, with the ``largest`` single load: by them
    rounding is told from load.
    """
    at = PassiveMotions(here, passive, Z)
    of_loads = loads[:, at.links]
    power = np.einsum("cnt,cnpt->pt", of_loads, at.twists) + np.einsum("ft,fpt->pt", efforts, at.rates)
    held = -at.dual(power)
    wrenches = np.zeros_like(loads)
    wrenches[3:, at.links] = held[3:]
    wrenches[:3, at.links] = held[:3] + cross(at.points, held[3:])
    sizes, terms = np.empty(power.shape), np.empty(power.shape)
    for i, motion in enumerate(passive):
        twist, rates = at.twists[:, :, i], at.rates[:, i]
        body = twist[:, at.links.index(motion.links[0])]
        axis = body[:3] if motion.turns else body[3:]
        length = np.maximum(np.sqrt((axis * axis).sum(axis=0)), 1e-300)
        sense = _sense(rotate_back(here.poses[:, :3, motion.links[0]], axis))
        sizes[i] = -power[i] * sense / length
        terms[i] = largest + (np.abs(of_loads * twist).sum(axis=(0, 1)) + np.abs(efforts * rates).sum(axis=0)) / length
    return wrenches, sizes, terms


def _sense(axis: Array) -> Array:
    """Signs ``(T,)`` that make the first component of note of body-fixed axes ``(3, T)`` positive: the same wherever the body stands."""
    size = np.abs(axis)
    first = np.argmax(size > 0.1 * size.max(axis=0), axis=0)
    return np.where(np.take_along_axis(axis, first[None], axis=0)[0] < 0, -1.0, 1.0)


def hold_at_rest(
    here: Configuration, coordinates: Array, loads: Iterable[Load], passive: tuple[PassiveMotion, ...]
) -> tuple[Array, Array] | None:
    """Efforts ``(p, 1)`` of the passive motions at one position at rest under loads, and their terms.

    ``coordinates (F, 1)`` are the user's. None where a load has no value there, since it varies over the positions of a solution.
    """
    F, p = len(coordinates), len(passive)
    still = Rates(Velocities(here, np.zeros((F, 1))), np.zeros((F, 1)), np.zeros(1))
    site = Site(here, still, coordinates, (), np.zeros(1, dtype=np.intp), None)
    try:
        site.collect(tuple(loads))
    except DeclarationError:
        return None
    Z = np.stack([motion.rates for motion in passive], axis=1)
    return hold(here, passive, Z.reshape(F, p, 1), site.applied(), site.scaled_efforts(), site.largest)[1:]
