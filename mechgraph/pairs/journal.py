"""Oil film of a journal bearing: the short bearing (Ocvirk), its steady state and its mobility.

The film between a bearing of radius R (on link a) and a journal (on link b), eccentricity ``c (xi, eta)``, is ``h = c (1 - xi cos t -
eta sin t)``. A squeeze velocity ``c v`` in a direction ``a`` presses it on half the circumference; where oil flows along the axis alone
(short bearing) the force of the film is

    W = (eta R L^3 / c^2) H v,   H = int_{a - pi/2}^{a + pi/2} (cos t, sin t) (cos t, sin t)^T / (1 - xi cos t - eta sin t)^3 dt,

and turning is the same as a squeeze seen from a frame that turns with the mean of both elements. Pressures below zero are cut off.

Sources: F. W. Ocvirk, NACA TN 2808 (1952) and report 1157 (1953), steady state; J. F. Booker, Dynamically loaded journal bearings: mobility
method of solution, J. Basic Engineering 87, 1965; The table of the journal-bearing integral, 87, 1965 (Sommerfeld's substitution).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import POSITIVE, Described
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.pairs.factors import UNIT_TWISTS
from mechgraph.quantities import LENGTH, PRESSURE_TIME, is_numeric, real_array, shown, wrong

TURN, ACROSS = UNIT_TWISTS["Rz"], ("Fx", "Fy")
"""What the pair of a journal allows, and the forces that its film bears."""


class FilmState(NamedTuple):
    """A journal bearing at steady load and speed, ``(...)`` each.

    ``eccentricity`` ratio, ``load``, ``attitude`` angle [rad] from the load to the eccentricity in the sense of the rotation, least
    ``film``, greatest ``pressure``, friction ``torque`` on the journal, against a positive rotation.
    """

    eccentricity: Array
    load: Array
    attitude: Array
    film: Array
    pressure: Array
    torque: Array


@dataclass(frozen=True)
class Journal(Described):
    """Declare a journal bearing: a short oil film between the links of a pair.

    The film does not act back on the mechanism: ``Solution.film`` asks what the loads of a cycle do to it. Exact for the short bearing
    (Ocvirk) with pressures below zero cut off; real films of length over diameter above 0.7 carry less than it says.

    Examples
    --------
    >>> import mechgraph as mg
    >>> b = mg.Journal(radius=0.025, length=0.02, clearance=25e-6, viscosity=0.01)
    >>> steady = b.steady(eccentricity=0.6, speed=100.0)
    >>> float(steady.load.round(3)), float(steady.attitude.round(4))
    (407.242, 0.8084)
    """

    radius: Annotated[float, POSITIVE("of the journal", LENGTH)]
    length: Annotated[float, POSITIVE("of the bearing", LENGTH)]
    clearance: Annotated[float, POSITIVE("radial", LENGTH)]
    viscosity: Annotated[float, POSITIVE("dynamic viscosity of the oil", PRESSURE_TIME)]

    def __post_init__(self) -> None:
        self.read_numbers()
        if not self.value_faults("") and self.clearance >= self.radius:
            raise DeclarationError(
                "journal", [wrong(self.clearance, "clearance", f"less than the radius, {self.radius:g}")]
            )

    @property
    def is_short(self) -> bool:
        """Whether the length is below 0.7 of the diameter, so that the film of a short bearing is trusted.

        (Ocvirk's comparison with tests, report 1157.)
        """
        return self.length < 0.7 * 2 * self.radius

    @property
    def resistance(self) -> float:
        """``eta R L^3 / c^2`` [force per unit of the rate of the eccentricity ratio]."""
        return float(self.viscosity * self.radius * self.length**3 / self.clearance**2)

    def steady(self, *, speed: Any, eccentricity: Any = None, load: Any = None) -> FilmState:
        """Return the steady state at a relative ``speed`` [rad/s] and either an eccentricity ratio or a load.

            W = eta U L^3 / (4 c^2) e / (1 - e^2)^2 sqrt(pi^2 (1 - e^2) + 16 e^2),   U = speed R,
            tan(attitude) = pi sqrt(1 - e^2) / (4 e),
            torque = 2 pi eta speed R^3 L / (c sqrt(1 - e^2)) + c e W sin(attitude) / 2

        Parameters
        ----------
        speed : float or (...)
            Relative angular velocity of journal and bearing, not zero; its sign says the sense.
        eccentricity : float or (...), optional
            From 0 to below 1.
        load : float or (...), optional
            Force on the journal, zero or above.

        Returns
        -------
        FilmState

        Raises
        ------
        DeclarationError
            Neither or both of eccentricity and load; values out of range.
        """
        found = self.value_faults("")
        found += [] if (eccentricity is None) != (load is None) else ["give either eccentricity= or load="]
        for name, value, fits, expected in (
            ("speed", speed, lambda v: v != 0, "finite numbers other than 0"),
            ("eccentricity", eccentricity, lambda v: (v >= 0) & (v < 1), "numbers from 0 to below 1"),
            ("load", load, lambda v: v >= 0, "finite numbers of 0 or more"),
        ):
            if value is not None and not _numbers(value, fits):
                found.append(wrong(value, name, expected))
        if found:
            raise DeclarationError("steady state of a journal", found)
        w = np.asarray(speed, dtype=float)
        unit = 0.25 * self.resistance * np.abs(w)
        if load is not None:
            e = _eccentricity_of(np.asarray(load, dtype=float) / unit)
        else:
            e = np.asarray(eccentricity, dtype=float)
        root = np.sqrt(1.0 - e * e)
        W = unit * _load_number(e)
        attitude = np.arctan2(np.pi * root, 4 * e)
        # the pressure is greatest where its derivative around the bearing, d/dt (sin t / (1 + e cos t)^3), is zero
        peak = -(6 * e * e) / (1 + np.sqrt(1 + 24 * e * e)) / np.where(e > 0, e, 1.0)
        cosine = np.clip(peak, -1.0, 1.0)
        pressure = (
            0.75 * self.viscosity * np.abs(w) * (self.length / self.clearance) ** 2
            * e * np.sqrt(1 - cosine**2) / (1 + e * cosine) ** 3
        )  # fmt: skip
        torque = self._shear(e) * w + np.sign(w) * 0.5 * self.clearance * e * W * np.sin(attitude)
        return FilmState(e, W, attitude, self.clearance * (1.0 - e), pressure, torque)

    def _shear(self, e: Array) -> Array:
        """Shear torque over the relative angular velocity, ``2 pi eta R^3 L / (c sqrt(1 - e^2))``."""
        return np.asarray(
            2 * np.pi * self.viscosity * self.radius**3 * self.length / (self.clearance * np.sqrt(1.0 - e * e))
        )

    def mobility(self, xi: Any, eta: Any) -> Array:
        """Return Booker's mobility ``(2, ...)``: along the load and across it, of a journal at ``xi`` along the load and ``eta`` across.

            de/dt = W (c / R)^2 / (viscosity L D) M,   M = (D / L)^2 / (2 I) along the squeeze, I the force of a unit squeeze

        Parameters
        ----------
        xi, eta : float or (...)
            Eccentricity ratios; ``xi^2 + eta^2 < 1``.

        Returns
        -------
        (2, ...) array

        Raises
        ------
        DeclarationError
            An eccentricity of 1 or more.

        Examples
        --------
        >>> import mechgraph as mg
        >>> b = mg.Journal(radius=0.5, length=0.5, clearance=0.001, viscosity=0.01)
        >>> [float(part.round(6)) for part in b.mobility(0.0, 0.0)]
        [1.27324, 0.0]
        """
        found = self.value_faults("")
        found += [wrong(v, name, "numbers") for name, v in (("xi", xi), ("eta", eta)) if not _numbers(v, np.isfinite)]
        e = (
            np.array(np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (xi, eta))))
            if not found
            else np.empty(0)
        )
        if not found and not (np.hypot(*e) < 1.0).all():
            found = [f"xi = {shown(xi)}, eta = {shown(eta)}: expected an eccentricity below 1"]
        if found:
            raise DeclarationError("mobility of a journal", found)
        load = np.stack([np.ones(e.shape[1:]), np.zeros(e.shape[1:])])
        return 2 * (self.radius / self.length) ** 2 * squeeze(e, load)

    def rates(self, e: Array, load: Array, speed: Array) -> Array:
        """``de/dt (2, ...)`` on link a of eccentricity ratios ``e (2, ...)``, from the load on the journal and its relative speed."""
        return self.squeezed(e, load) + 0.5 * speed * np.stack([-e[1], e[0]])

    def squeezed(self, e: Array, load: Array) -> Array:
        """The squeeze velocity ``v (2, ...)`` that carries a load: the part of ``de/dt`` that is not turning with the film."""
        return squeeze(e, load) / self.resistance

    def pressure(self, e: Array, load: Array) -> Array:
        """The greatest pressure ``(...)`` in the middle of the length, ``3/2 eta L^2 |v| cos(t - a) / (c^2 h^3)``."""
        v = self.squeezed(e, load)
        size, a = np.hypot(*v), np.arctan2(v[1], v[0])
        return np.asarray(1.5 * self.viscosity * (self.length / self.clearance) ** 2 * size * _peak(e, a))

    def torque(self, e: Array, load: Array, speed: Array) -> Array:
        """Friction torque ``(...)`` on the journal, against a positive rotation: shear and ``c (W x e) / 2``."""
        return np.asarray(self._shear(np.hypot(*e)) * speed + 0.5 * self.clearance * (load[0] * e[1] - load[1] * e[0]))

    def power(self, e: Array, load: Array, speed: Array) -> Array:
        """Power lost in the film ``(...)``: shear, and pressing the oil out, ``c W . v``."""
        pressed = self.clearance * (load * self.squeezed(e, load)).sum(axis=0)
        return np.asarray(self._shear(np.hypot(*e)) * speed**2 + pressed)


def film_faults(pair: Any, where: str) -> list[str]:
    """What is wrong with the film of a pair."""
    if pair.film is not None and not isinstance(pair.film, Journal):
        return [wrong(pair.film, f"{where}film", "mg.Journal(radius=, length=, clearance=, viscosity=)")]
    found = [] if pair.film is None else pair.film.value_faults(f"{where}film.")
    borne = [c.name for c in pair.type.reactions or () if c.frame == 0]
    if TURN not in [f.twist for f in pair.type.freedoms] or not set(ACROSS) <= set(borne):
        found.append(
            f"{where}film: type {pair.type.symbol} is no journal; expected a pair that turns about z and bears Fx and Fy (R, C)"
        )
    return found


def _numbers(value: Any, fits: Callable[[Array], Any]) -> bool:
    """Whether these are finite numbers, one or an array of them, that fit."""
    array = real_array(value)
    return array is not None and is_numeric(array, array.shape) and bool(np.all(fits(array)))


def _load_number(e: Array) -> Array:
    """Ocvirk's load over ``eta U L^3 / (4 c^2)``."""
    rest = 1.0 - e * e
    return np.asarray(e / rest**2 * np.sqrt(np.pi**2 * rest + 16 * e * e))


def _eccentricity_of(load: Array) -> Array:
    """The eccentricity ratio of a load over ``eta U L^3 / (4 c^2)``; it grows with the load."""
    ends = np.zeros(load.shape), np.full(load.shape, np.nextafter(1.0, 0.0))
    return _root(lambda e, W: _load_number(e) - W, ends, load)


def _root(f: Callable[..., Array], ends: tuple[Array, Array], *more: Array) -> Array:
    """Where functions ``f(x, *more)`` that change sign between two ends are zero, element by element; NaN where they do not."""
    from scipy.optimize import elementwise

    found = elementwise.find_root(f, ends, args=more)
    return np.where(found.success, found.x, np.nan)


def _sommerfeld(e: Array, t: Array) -> Array:
    """``p (...)`` with ``tan(p / 2) = sqrt((1 + e) / (1 - e)) tan(t / 2)``, continuous, for angles t from the least film."""
    b = e / (1.0 + np.sqrt(1.0 - e * e))
    return np.asarray(t + 2 * np.arctan2(b * np.sin(t), 1.0 - b * np.cos(t)))


def _half_film(e: Array, a: Array) -> tuple[Array, Array, Array]:
    """``H`` of squeezes in directions ``a`` in the directions of ``e (2, ...)`` and across: its entries 11, 12, 22, ``(...)``.

    With ``1 - e cos t = (1 - e^2) / (1 + e cos p)`` the integrands are ``(1 - e^2)^(-5/2) (e + cos p)^2``, ``(1 - e^2)^-2 sin p (e +
    cos p)`` and ``(1 - e^2)^(-3/2) sin^2 p``.
    """
    size = np.hypot(*e)
    begin = a - np.arctan2(e[1], e[0]) - 0.5 * np.pi
    p, q = _sommerfeld(size, begin), _sommerfeld(size, begin + np.pi)
    rest = 1.0 - size * size
    whole, twice = q - p, 0.5 * (np.sin(2 * q) - np.sin(2 * p))
    along = (size * size * whole + 2 * size * (np.sin(q) - np.sin(p)) + 0.5 * (whole + twice)) / rest**2.5
    mixed = (size * (np.cos(p) - np.cos(q)) + 0.5 * (np.sin(q) ** 2 - np.sin(p) ** 2)) / rest**2
    across = 0.5 * (whole - twice) / rest**1.5
    return along, mixed, across


def squeeze(e: Array, load: Array) -> Array:
    """The squeeze ``v (2, ...)`` with ``H v = load (2, ...)``.

    The force is the gradient of a convex function of v of degree two, so its direction turns with that of v and there is one solution: ``v
    <- H(v)^-1 load`` is Newton's method, kept within a bracket of directions.
    """
    size, way = np.hypot(*load), np.arctan2(load[1], load[0])
    at = np.arctan2(e[1], e[0]) - way
    own = np.hypot(*e) * np.stack([np.cos(at), np.sin(at)])
    unit = np.stack([np.cos(at), np.sin(at)])
    low, high = np.full(size.shape, -0.5 * np.pi), np.full(size.shape, 0.5 * np.pi)
    a = np.zeros(size.shape)
    for _ in range(60):  # halvings from pi to rounding; Newton's method takes some six of them
        one, mixed, two = _half_film(own, a)
        d = np.cos(a - at), np.sin(a - at)
        force = one * d[0] + mixed * d[1], mixed * d[0] + two * d[1]
        off = force[0] * unit[1] + force[1] * unit[0]
        low, high = np.where(off <= 0, a, low), np.where(off >= 0, a, high)
        det = one * two - mixed * mixed
        v = (two * unit[0] + mixed * unit[1]) / det, -(mixed * unit[0] + one * unit[1]) / det
        new = np.arctan2(v[1] * unit[0] + v[0] * unit[1], v[0] * unit[0] - v[1] * unit[1])
        inside = (np.abs(new - a) < 1e-8) | ((new > low) & (new < high))
        moved, a = np.abs(new - a).max(initial=0.0), np.where(inside, new, 0.5 * (low + high))
        if moved < 1e-8:  # the error of v is that of a squared
            break
    along, over = v[0] * unit[0] - v[1] * unit[1], v[1] * unit[0] + v[0] * unit[1]
    turn = np.cos(way), np.sin(way)
    return size * np.stack([along * turn[0] - over * turn[1], along * turn[1] + over * turn[0]])


def _peak(e: Array, a: Array) -> Array:
    """The greatest ``cos(t - a) / (1 - e . (cos t, sin t))^3`` over t, where its slope is zero; by Sommerfeld's angle, in which a thin
    film is wide.
    """
    size, at = np.hypot(*e), np.arctan2(e[1], e[0])
    begin = a - at - 0.5 * np.pi
    ends = _sommerfeld(size, begin), _sommerfeld(size, begin + np.pi)

    def around(p: Array, size: Array, off: Array) -> tuple[Array, Array, Array, Array]:
        """Thickness, ``sin t``, and cosine and sine of the angle from the squeeze."""
        cosine, sine = (size + np.cos(p), np.sqrt(1 - size * size) * np.sin(p)) / (1 + size * np.cos(p))
        along, over = cosine * np.cos(off) + sine * np.sin(off), sine * np.cos(off) - cosine * np.sin(off)
        return 1 - size * cosine, sine, along, over

    def slope(p: Array, size: Array, off: Array) -> Array:
        h, sine, along, over = around(p, size, off)
        return -over * h - 3 * size * sine * along

    found = _root(slope, ends, size, a - at)
    h, _, along, _ = around(found, size, a - at)
    return np.asarray(along / h**3)
