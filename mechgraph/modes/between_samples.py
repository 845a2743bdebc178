"""What is met between samples of a driver by assemblies that are not real.

A circuit that lies wholly between two values of the driver begins and ends at folds, where two assemblies that are not real come together.
So what is not real is followed between these values, while the driver stays real: what arrives without a double point was never real.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mechgraph.maths.se3 import Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.modes.circuits import root_between
from mechgraph.modes.family import Array, Member
from mechgraph.modes.form import EquationForm
from mechgraph.modes.homotopy import Care, Equations, RealLeg, follow, rounding
from mechgraph.modes.targets import FAR_APART, FAR_NOISE


class Station(NamedTuple):
    """A value of the driver, and what is asked there of the equations ``(d,)``; assemblies ``x (nx, n)`` that are not real, one of each two
    that are conjugate, and their ``prints``: None where they are not known.
    """

    value: float
    asked: Array
    x: Array | None = None
    prints: Array | None = None


class Double(NamedTuple):
    """A double point to which a track comes: driver value, state ``(nx,)`` next to it, and what tells assemblies apart there."""

    value: float
    x: Array
    prints: Array

    @property
    def real(self) -> bool:
        """Whether it is real: next to it imaginary parts are the root of what is left of the way."""
        return self._near(self.prints.conj())

    def _near(self, prints: Array) -> bool:
        return bool(np.abs(prints - self.prints).max() < 0.1 * max(1.0, float(np.abs(self.prints).max())))

    def meets(self, other: Double, near: float) -> bool:
        """Whether another one is the same, or its conjugate."""
        return abs(self.value - other.value) < near and (self._near(other.prints) or self._near(other.prints.conj()))


class Gap(NamedTuple):
    """What is met between two stations: double points to which tracks come as the driver rises, and as it falls, but for those of both that
    are the same and not real, where others lead on; values next to which tracks were ``lost``.

    ``near`` is the difference of driver values up to which double points are one.
    """

    rising: Sequence[Double]
    falling: Sequence[Double]
    lost: Sequence[float]
    near: float


class Unreal:
    """Assemblies of a class that are not real, in the equations of a ``form``, led from value to value of the driver."""

    def __init__(self, form: EquationForm, values: Array) -> None:
        self.form, self.family = form, form.family
        self.equations = Equations(form.family, form.family.mixing(np.random.default_rng(0)))
        # what is given at the first value, and its rate
        self._first, given = values[0], form.given
        self._given, self._rate = given[:, :1], (given[:, 1:2] - given[:, :1]) / (values[1] - values[0])

    def at(self, values: Array) -> EquationForm:
        """The equations at values ``(n,)`` of the driver."""
        return self.form.driven(self._given + self._rate * (values - self._first))

    def station(self, value: float, x: Array | None = None) -> Station:
        """A station where ``x (nx, n)`` are all assemblies that are not real."""
        asked = self.at(np.array([value])).drive
        if x is None:
            return Station(value, asked[:, 0])
        prints = self.equations.fingerprints(Member(self.family.target, asked), x)
        once = ~np.tril(_same(prints, prints), -1).any(axis=1)
        return Station(value, asked[:, 0], x[:, once], prints[:, once])

    def turning(self, a: Station, b: Station) -> list[Station]:
        """Stations between two others at which what is asked turns back, as the square of a length does at zero; none where it does not."""
        step = (b.value - a.value) / 16
        value = a.value + step * np.arange(17)
        asked = self.at(value).drive
        k = int(np.argmax(np.ptp(asked, axis=1)))
        turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(asked[k]))))
        if not turns.size:
            return []
        begin, h = value[turns] - step, 1e-3 * step
        part = root_between(
            lambda u: np.subtract(*(self.at(begin + 2 * step * u + side).drive[k] for side in (h, -h))), len(turns)
        )
        return [self.station(at) for at in (begin + 2 * step * part).tolist()]

    def gaps(self, ends: Sequence[tuple[Station, Station]]) -> list[Gap]:
        """What is met between stations; what is lost is led once more, more carefully."""
        out, left = [Gap((), (), (), 0.0)] * len(ends), list(range(len(ends)))
        for care in (Care(noise=FAR_NOISE), Care(noise=FAR_NOISE).finer):
            for i, gap in zip(left, self._gaps([ends[i] for i in left], care), strict=True):
                out[i] = gap
            left = [i for i in left if out[i].lost]
        return out

    def _gaps(self, ends: Sequence[tuple[Station, Station]], care: Care) -> list[Gap]:
        if not ends:
            return []
        lost: list[list[float]] = [[a.value] * (not self._straight(a, b)) for a, b in ends]
        rising = self._led([(a, b, a.x) for a, b in ends], care, lost)
        back = []
        for (a, b), (there, _), away in zip(ends, rising, lost, strict=True):
            left = b.x
            if left is not None and b.prints is not None and a.x is not None:
                same = _same(there, b.prints)
                away += [b.value] * int((same.sum(axis=1) != 1).sum() + (same.sum(axis=0) > 1).sum())
                left = left[:, ~same.any(axis=0)]
            back.append((b, a, left))
        falling = self._led(back, care, lost)
        for (a, _), (there, _), away in zip(ends, falling, lost, strict=True):
            # tracks back come to what tracks have left for another place
            away += [a.value] * (there.shape[1] if a.x is not None else 0)
        out = []
        for (a, b), (_, up), (_, down), away in zip(ends, rising, falling, lost, strict=True):
            # part of the way between stations
            near = 1e-4 * (b.value - a.value)
            for one in [one for one in up if not one.real]:
                other = next((other for other in down if one.meets(other, near)), None)
                if other is not None:
                    up, down = ([of for of in some if of is not it] for some, it in ((up, one), (down, other)))
            out.append(Gap(up, down, away, near))
        return out

    def _straight(self, a: Station, b: Station) -> bool:
        """Whether what is asked between stations changes straight, as tracks have it, but for the pace."""
        inner = a.value + (b.value - a.value) * np.array([0.25, 0.5, 0.75])
        change = b.asked - a.asked
        k = int(np.argmax(np.abs(change)))
        between = self.at(inner).drive - a.asked[:, None]
        parts = between[k] / change[k]
        size = 1e-9 * max(1.0, float(np.abs(b.asked).max()))
        return bool(
            (np.diff(parts, prepend=0.0, append=1.0) > 0).all()
            and np.allclose(between, np.outer(change, parts), 0, size)
        )

    def _led(
        self, legs: Sequence[tuple[Station, Station, Array | None]], care: Care, lost: Sequence[list[float]]
    ) -> list[tuple[Array, list[Double]]]:
        """Of tracks from stations to others what tells their ends apart ``(n, k)``, and the double points to which others come."""
        none = np.zeros((self.family.system.n_state, 0), dtype=complex)
        every = [none if x is None else x for _, _, x in legs]
        which, x = np.repeat(np.arange(len(legs)), [x.shape[1] for x in every]), np.concatenate([none, *every], axis=1)
        if not len(which):
            return [(none[:1], [])] * len(legs)
        begin, end = (
            np.stack([one.asked for one in side], axis=1) for side in zip(*(leg[:2] for leg in legs), strict=True)
        )
        leg = RealLeg(self.equations, Member(self.family.target, begin), Member(self.family.target, end), which)
        came = follow(leg, x, care)
        prints = leg.prints(came.x, came.s, np.arange(len(which)))
        left = np.flatnonzero(~came.arrived)
        out = [(prints[:, (which == i) & came.arrived], list[Double]()) for i in range(len(legs))]
        for k, value in zip(left.tolist(), self._values(legs, which[left], came.s[left]).tolist(), strict=True):
            i = int(which[k])
            if came.infinite[k]:
                lost[i].append(value)
            else:
                out[i][1].append(Double(value, came.x[:, k], prints[:, k]))
        return out

    def _values(self, legs: Sequence[tuple[Station, Station, Array | None]], which: Index, s: Array) -> Array:
        """Driver values at parts ``s`` of the way of some legs."""
        begin, way = np.array([(a.value, b.value - a.value) for a, b, _ in legs]).T[:, which]
        change = np.array([b.asked - a.asked for a, b, _ in legs])
        row = np.argmax(np.abs(change), axis=1)[which]
        goal = np.array([a.asked for a, _, _ in legs])[which, row] + s * change[which, row]
        n = np.arange(len(s))
        return np.asarray(begin + way * root_between(lambda u: self.at(begin + way * u).drive[row, n] - goal, len(s)))


def _same(one: Array, other: Array) -> Mask:
    """Which assemblies ``(n, k)`` are, or are conjugate to, which others ``(n, l)``, by what tells them apart."""
    size = np.maximum(1.0, np.abs(one).max(axis=0, initial=0.0))
    least = np.clip(rounding(size), MODES.one_assembly, FAR_APART) * size
    gaps = [np.abs(one[:, :, None] - of[:, None]).max(axis=0, initial=0.0) for of in (other, other.conj())]
    return np.asarray(np.minimum(*gaps) <= least[:, None])
