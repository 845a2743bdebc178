"""Gears, racks and belts: couplings that know the lines along which their force acts, so that bearings feel it.

The line of a contact, ``n (3,)`` through ``P (3,)``, stands still on the carrier, the link between the two gears. The force ``F`` on
gear b (and ``-F`` on gear a) does no work on the motions that the coupling allows, ``F . (V_b - V_a) = 0``: with the freedoms ``j`` on
the way from gear a to gear b through the carrier, passed in the sense ``s_j``,

    sum_j c_j q_j = constant,   c_j m = s_j F . S_j,

where ``m`` is the multiplier. There are two lines, for the two signs of ``m``: both flanks of a tooth, both strands of a belt. Source:
Litvin and Fuentes, Gear Geometry and Applied Theory, 2004, chapters 10 (pitch points), 14 to 19.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.coupling import BaseCoupling, Coupling
from mechgraph.model.field_format import FLAG, FREEDOM_NAME, NUMBER, TEXT, TWO
from mechgraph.model.pair import Marker, Pair
from mechgraph.quantities import is_numeric, wrong
from mechgraph.units import LENGTH, PURE

FITTING = 1e-6
"""Part of a length, or angle, by which gears may miss the place that their teeth ask for."""


class Axes(NamedTuple):
    """Axes of both gears, points and unit directions ``(3, T)`` each, and the unit of length in which they are given."""

    pa: Array
    za: Array
    pb: Array
    zb: Array
    unit: float = 1.0

    @property
    def across(self) -> Array:
        """From axis a to axis b, at right angles to axis a, ``(3, T)``."""
        d = self.pb - self.pa
        return d - self.za * (d * self.za).sum(axis=0)


Lines = tuple[Array, Array]
"""Points and unit directions ``(3, 2, T)`` of the force on gear b, for both flanks or strands; along each it acts in one sense only."""


class Step(NamedTuple):
    """A pair on the way from gear a to gear b: its place, and whether it is passed from its link a to its link b (1) or back (-1)."""

    pair: int
    sense: float


def _unit(v: Array) -> Array:
    return np.asarray(v / np.sqrt((v * v).sum(axis=0)))


def teeth_lines(P: Array, away: Array, trace: Array, pressure_angle: float) -> Lines:
    """Both flanks at a pitch point: normals at the pressure angle to the pitch plane, across the ``trace`` of the teeth.

    ``away (3, T)``: from gear a to gear b, at right angles to the pitch plane.
    """
    over = np.cos(pressure_angle) * _unit(cross(away, trace))
    out = np.sin(pressure_angle) * away
    return np.stack([P, P], axis=1), np.stack([out + over, out - over], axis=1)


@dataclass(frozen=True)
class Contact(BaseCoupling):
    """What gears, racks and belts share.

    ``a`` and ``b`` are the freedoms of the two gears on their carrier: pairs R (of a rack P) that share a link, or that pairs R about the
    axis of a connect, as a sun wheel on the frame and a planet on its arm.
    """

    kind: ClassVar[str]
    slides: ClassVar[bool] = False
    """Whether gear b slides, as a rack does."""
    name: Annotated[str, TEXT("name", default="g1, g2, ...")]
    a: Annotated[str, FREEDOM_NAME("pair of the first gear on the carrier")]
    b: Annotated[str, FREEDOM_NAME("pair of the second gear on the carrier")]

    def __post_init__(self) -> None:
        self.read_numbers()
        object.__setattr__(self, "constant", None)
        object.__setattr__(self, "terms", ())
        object.__setattr__(self, "steps", ())

    # --- what a kind of gears says -----------------------------------------------------------------------------------

    def ratio(self, axes: Axes | None) -> float:
        """The size of ``c_b / c_a``."""
        raise NotImplementedError

    def lines(self, axes: Axes) -> Lines:
        """The lines of the force on gear b."""
        raise NotImplementedError

    def misfits(self, axes: Axes) -> list[str]:
        """What is wrong with the places of the gears."""
        raise NotImplementedError

    # --- in a mechanism ----------------------------------------------------------------------------------------------

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""
        where = f"coupling {self.name!r}: "
        found = [where + fault for fault in self.value_faults("")]
        ends = {side: getattr(self, side) for side in "ab"}
        found += [where + fault for fault in (m.freedom_fault(q, single=True) for q in ends.values()) if fault]
        if found:
            return found
        for side, q in ends.items():
            pair, wanted = m.pairs[m.freedom(q)[0]], "slide" if side == "b" and self.slides else "turn"
            if _motion(pair) != wanted:
                found.append(
                    f"{where}{side} = {q!r}: is a pair {pair.type.symbol}; expected one whose only freedom is a {wanted} at its axis"
                )
        if found:
            return found
        steps = self._way(m)
        if isinstance(steps, str):
            return [where + steps]
        if any(not pair.has_geometry or pair.faults() for pair in m.pairs):
            return []
        axes = self._axes(m, steps)
        return [where + fault for fault in ([axes] if isinstance(axes, str) else self.misfits(axes))]

    def _way(self, m: Any) -> tuple[Step, ...] | str:
        """The pairs from gear a to gear b, or why there is no carrier between them."""
        first, last = (m.freedom(q)[0] for q in (self.a, self.b))
        if first == last:
            return f"a and b are the same freedom {self.a!r}; name those of two gears"
        alone = (
            f"{self.a!r} and {self.b!r} have no link in common that could carry both gears, and no pairs R about the axis of {self.a!r} "
            "connect them; gears need a common carrier"
        )
        reached: dict[str, tuple[str, int] | None] = dict.fromkeys((m.pairs[first].a, m.pairs[first].b))
        queue, goal = list(reached), {m.pairs[last].a, m.pairs[last].b}
        for link in queue:
            if link in goal:
                break
            for k, pair in enumerate(m.pairs):
                if k not in (first, last) and _motion(pair) == "turn" and link in (pair.a, pair.b):
                    other = pair.b if link == pair.a else pair.a
                    if other not in reached:
                        reached[other] = (link, k)
                        queue.append(other)
        else:
            return alone
        back, middle = link, []
        while (before := reached[back]) is not None:
            middle.append((before[0], before[1]))
            back = before[0]
        ways = [
            (m.pairs[first].b if back == m.pairs[first].a else m.pairs[first].a, first),
            *reversed(middle),
            (link, last),
        ]
        return tuple(Step(k, 1.0 if m.pairs[k].a == start else -1.0) for start, k in ways)

    def _axes(self, m: Any, steps: tuple[Step, ...]) -> Axes | str:
        """The axes of the gears in the frame of the carrier, in the declared configuration; or what is wrong with them."""
        pairs: list[Pair] = [m.pairs[step.pair] for step in steps]
        p, z = _line(_marker(pairs[0], steps[0], behind=True))
        for pair, step in zip(pairs[1:-1], steps[1:-1], strict=True):
            q, w = _line(_marker(pair, step, behind=False))
            off = np.abs(cross(q - p, z)).max()
            if np.abs(cross(z, w)).max() > FITTING or off > FITTING * max(1.0, float(np.abs(q - p).max())):
                return (
                    f"pair {pair.name!r} between the gears is not about the axis of {self.a!r} (off by {off:.3g}); {self.a!r} and "
                    f"{self.b!r} need a common carrier"
                )
            sense, along = float(np.sign((z * w).sum())), ((p - q) * z).sum()
            p, w = _line(_marker(pair, step, behind=True))
            z = sense * w
            p = p + along * z
        q, w = _line(_marker(pairs[-1], steps[-1], behind=False))
        return Axes(p, z, q, w)

    def placed(self, m: Any) -> Self:
        """The same with the coefficients of its freedoms, by their full names; needs sound faults-free gears."""
        steps = self._way(m)
        assert not isinstance(steps, str)
        geometric = all(pair.has_geometry for pair in m.pairs)
        axes = self._axes(m, steps) if geometric else None
        assert not isinstance(axes, str)
        out = self.replace(**{side: m.full_name(getattr(self, side)) for side in "ab"})
        ratio, senses = self.ratio(axes), [step.sense for step in steps]
        sign = 1.0
        middle = [1.0] * (len(steps) - 2)
        if axes is not None:
            P, n = (part[:, 0] for part in self.lines(axes))
            va, vb = self._velocities(axes, P)
            sign = float(np.sign((n * va).sum() * (n * vb).sum()))
            z = axes.za
            middle = [
                float(np.sign((_line(_marker(m.pairs[s.pair], s, behind=True))[1] * z).sum())) for s in steps[1:-1]
            ]
        values = [senses[0], *(s * one for s, one in zip(senses[1:-1], middle, strict=True)), sign * senses[-1] * ratio]
        names = [m.pairs[step.pair].freedom_names[0] for step in steps]
        object.__setattr__(
            out, "terms", tuple((name, value * senses[0]) for name, value in zip(names, values, strict=True))
        )
        object.__setattr__(out, "steps", steps)
        return out

    def _velocities(self, axes: Axes, P: Array) -> tuple[Array, Array]:
        """Velocities ``(3, T)`` of both gears at a point for unit rates."""
        return cross(axes.za, P - axes.pa), axes.zb if self.slides else cross(axes.zb, P - axes.pb)

    def in_own_units(self, units: Any, turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.without_quantities(units)

    def converted(self, length: float, turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.in_units((length, 1.0, 1.0))


def _motion(pair: Pair) -> str:
    """``"turn"`` or ``"slide"`` of a pair whose only freedom is one about or along its axis; nothing for other pairs."""
    freedoms = pair.type.freedoms
    plain: dict[tuple[float, ...], str] = {
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0): "turn",
        (0.0, 0.0, 0.0, 0.0, 0.0, 1.0): "slide",
    }
    single = len(freedoms) == 1 and not any(freedoms[0].per_pitch)
    return plain.get(tuple(freedoms[0].twist), "") if single else ""


def _marker(pair: Pair, step: Step, *, behind: bool) -> Marker:
    """The marker of a pair on the link before it on the way, or on the link behind it."""
    return pair.markers[int((step.sense > 0) == behind)]


def _line(marker: Marker) -> tuple[Array, Array]:
    return np.array(marker.point, dtype=float)[:, None], _unit(np.array(marker.axis, dtype=float)[:, None])


_TEETH = TWO("numbers of teeth of both gears")
_PRESSURE = NUMBER("of the flanks, in the normal section", PURE, degrees=True, minimum=0.0)
_FULL = float(np.deg2rad(20.0))


def _teeth_faults(teeth: Any) -> list[str]:
    good = is_numeric(teeth, (2,)) and all(float(n) == int(n) and n > 0 for n in teeth)
    return [] if good else [wrong(teeth, "teeth", "two whole numbers above 0")]


@dataclass(frozen=True)
class SpurGears(Contact):
    """Two spur or helical gears on parallel axes, external or internal; the mesh lies in the plane through the point of pair b.

    The pitch radii are those that the distance of the axes and the numbers of teeth ask for. ``module`` is the normal one; where it is
    given, the distance of the axes must fit it.
    """

    kind: ClassVar[str] = "spur"
    teeth: Annotated[Any, _TEETH] = None
    module: Annotated[
        float | None, NUMBER("normal module", LENGTH, default="what the distance of the axes asks for")
    ] = None
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    helix_angle: Annotated[float, NUMBER("of gear a, right-hand positive", PURE, degrees=True)] = 0.0
    internal: Annotated[bool, FLAG("whether the gear with more teeth has them inside")] = False

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where) + _teeth_faults(self.teeth)
        if not found and self.internal and self.teeth[0] == self.teeth[1]:
            found.append(wrong(self.teeth, "teeth", "different numbers of an internal pair"))
        if not found and not (0.0 <= self.pressure_angle < 1.2 and abs(self.helix_angle) < 1.2):
            found.append(
                f"pressure_angle = {self.pressure_angle:g}, helix_angle = {self.helix_angle:g}: expected angles below 1.2 rad"
            )
        return found

    def ratio(self, axes: Axes | None) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    @property
    def _sum(self) -> float:
        """Teeth along the line of centres: the sum, or the difference of an internal pair."""
        return abs(self.teeth[1] - self.teeth[0]) if self.internal else self.teeth[0] + self.teeth[1]

    def misfits(self, axes: Axes) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() > FITTING:
            return ["the axes are not parallel; bevel and worm gears are for axes that intersect or cross"]
        distance = float(np.linalg.norm(axes.across))
        if distance == 0.0:
            return ["both gears have the same axis; their axes must be apart"]
        fit = distance if self.module is None else float(self.module * self._sum / (2 * np.cos(self.helix_angle)))
        if self.module is not None and abs(distance - fit) > FITTING * fit:
            return [
                f"the axes are {distance:.7g} apart; {self.teeth[0]:g} and {self.teeth[1]:g} teeth of module {self.module:g} mesh at "
                f"{fit:.7g} (at {distance:.7g} with module {self.module * distance / fit:.7g})"
            ]
        return []

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        across = axes.across
        u = _unit(across)
        rb = np.sqrt((across * across).sum(axis=0)) * self.teeth[1] / self._sum
        ring_a = self.internal and self.teeth[0] > self.teeth[1]
        P = axes.pb + (rb if ring_a else -rb) * u
        away = -u if self.internal else u
        out = P - axes.pa
        t = cross(axes.za, _unit(out - axes.za * (out * axes.za).sum(axis=0)))
        trace = np.cos(self.helix_angle) * axes.za + np.sin(self.helix_angle) * t
        return teeth_lines(P, away, trace, self.pressure_angle)


@dataclass(frozen=True)
class BevelGears(Contact):
    """Two bevel gears, straight or spiral, on axes that intersect; each stands on the side of the apex where the point of its pair is.

    ``module`` is the one at the middle of the face, where the force acts.
    """

    kind: ClassVar[str] = "bevel"
    teeth: Annotated[Any, _TEETH] = None
    module: Annotated[float, NUMBER("at the middle of the face", LENGTH, minimum=0.0)] = 1.0
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    spiral_angle: Annotated[float, NUMBER("of gear a, right-hand positive", PURE, degrees=True)] = 0.0

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        return super().value_faults(where) + _teeth_faults(self.teeth)

    def ratio(self, axes: Axes | None) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    def _apex(self, axes: Axes) -> tuple[Array, float]:
        """The point of axis a nearest to axis b, and how far the axes pass by each other."""
        n = cross(axes.za, axes.zb)
        square = (n * n).sum(axis=0)
        d = axes.pb - axes.pa
        along = (cross(d, axes.zb) * n).sum(axis=0) / square
        return axes.pa + along * axes.za, float(np.abs((d * n).sum(axis=0) / np.sqrt(square)).max())

    def misfits(self, axes: Axes) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() < 1e-3:
            return ["the axes are parallel; bevel gears are on axes that intersect"]
        apex, off = self._apex(axes)
        size = max(float(np.abs(p - apex).max()) for p in (axes.pa, axes.pb))
        if off > FITTING * max(size, self.module):
            return [f"the axes pass each other at {off:.4g}; bevel gears are on axes that intersect"]
        if min(float(np.abs(p - apex).max()) for p in (axes.pa, axes.pb)) <= FITTING * self.module:
            return [
                "the point of a pair is where the axes intersect; give one on the side of the apex on which the gear stands"
            ]
        return []

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        apex, _ = self._apex(axes)
        ea, eb = (z * np.sign(((p - apex) * z).sum(axis=0)) for p, z in ((axes.pa, axes.za), (axes.pb, axes.zb)))
        cosine = (ea * eb).sum(axis=0)
        sine = np.sqrt(1.0 - cosine**2)
        angle = np.arctan2(sine, self.teeth[1] / self.teeth[0] + cosine)
        side = _unit(eb - ea * cosine)
        line = np.cos(angle) * ea + np.sin(angle) * side
        P = apex + line * (self.module * self.teeth[0] / 2 / axes.unit / np.sin(angle))
        away = np.cos(angle) * side - np.sin(angle) * ea
        t = cross(axes.za, _unit(side))
        trace = np.cos(self.spiral_angle) * line + np.sin(self.spiral_angle) * t * np.sign((ea * axes.za).sum(axis=0))
        return teeth_lines(P, away, trace, self.pressure_angle)


@dataclass(frozen=True)
class WormGear(Contact):
    """A worm a and its wheel b on axes that cross at right angles; ``radius`` is that of the worm's pitch cylinder."""

    kind: ClassVar[str] = "worm"
    teeth: Annotated[Any, TWO("starts of the worm and teeth of the wheel")] = None
    radius: Annotated[float, NUMBER("of the pitch cylinder of the worm", LENGTH, minimum=0.0)] = 1.0
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    left_hand: Annotated[bool, FLAG("whether the thread is left-handed")] = False

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        return super().value_faults(where) + _teeth_faults(self.teeth)

    def ratio(self, axes: Axes | None) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    def misfits(self, axes: Axes) -> list[str]:
        """See ``Contact``."""
        cosine = float(np.abs((axes.za * axes.zb).sum(axis=0)).max())
        if cosine > FITTING:
            return [
                f"the axes cross at {np.rad2deg(np.arccos(min(cosine, 1.0))):.5g} degrees; a worm and its wheel at 90"
            ]
        distance = float(np.abs((self._apart(axes)[1]).max()))
        if distance <= self.radius:
            return [f"the axes are {distance:.7g} apart; expected more than the radius of the worm, {self.radius:g}"]
        return []

    def _apart(self, axes: Axes) -> tuple[Array, Array]:
        """Unit direction from the worm's axis to that of the wheel, and their distance ``(T,)``."""
        n = cross(axes.za, axes.zb)
        off = ((axes.pb - axes.pa) * n).sum(axis=0)
        return n * np.sign(off), np.abs(off)

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        away, distance = self._apart(axes)
        d, r = axes.pb - axes.pa, self.radius / axes.unit
        foot = axes.pa + axes.za * (d * axes.za).sum(axis=0)
        t = cross(axes.za, away) * (-1.0 if self.left_hand else 1.0)
        lead = np.arctan2((distance - r) * self.teeth[0], self.teeth[1] * r)
        return teeth_lines(foot + r * away, away, np.cos(lead) * t + np.sin(lead) * axes.za, self.pressure_angle)


@dataclass(frozen=True)
class Rack(Contact):
    """A pinion a on a pair R and a rack b on a pair P; the rack lies on the side of the pinion where the point of its pair is."""

    kind: ClassVar[str] = "rack"
    slides: ClassVar[bool] = True
    radius: Annotated[float, NUMBER("pitch radius of the pinion", LENGTH, minimum=0.0)] = 1.0
    pressure_angle: Annotated[float, _PRESSURE] = _FULL

    def ratio(self, axes: Axes | None) -> float:
        """``1 / r``."""
        return 1.0 / self.radius

    def misfits(self, axes: Axes) -> list[str]:
        """See ``Contact``."""
        if np.abs((axes.za * axes.zb).sum(axis=0)).max() > FITTING:
            return ["the rack does not slide at right angles to the axis of the pinion"]
        if np.abs(((axes.pb - axes.pa) * cross(axes.za, axes.zb)).sum(axis=0)).max() <= FITTING * self.radius:
            return [
                "the point of the rack's pair is level with the pinion's axis; give one on the side where the rack is"
            ]
        return []

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        away = cross(axes.za, axes.zb)
        d = axes.pb - axes.pa
        away = away * np.sign((d * away).sum(axis=0))
        P = axes.pa + axes.za * (d * axes.za).sum(axis=0) + self.radius / axes.unit * away
        return teeth_lines(P, away, axes.za, self.pressure_angle)


@dataclass(frozen=True)
class Belt(Contact):
    """A belt or chain around two pulleys on parallel axes, open or crossed; the strand that pulls carries all, the other nothing."""

    kind: ClassVar[str] = "belt"
    radii: Annotated[Any, TWO("of both pulleys", LENGTH, minimum=0.0)] = None
    crossed: Annotated[bool, FLAG("whether the strands cross")] = False

    def ratio(self, axes: Axes | None) -> float:
        """``r_b / r_a``."""
        return self.radii[1] / self.radii[0]

    def misfits(self, axes: Axes) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() > FITTING:
            return ["the axes are not parallel"]
        distance, needed = (
            float(np.linalg.norm(axes.across)),
            abs(self.radii[0] + (1 if self.crossed else -1) * self.radii[1]),
        )
        return [] if distance > needed else [f"the axes are {distance:.7g} apart; expected more than {needed:.7g}"]

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        across = axes.across
        distance, u = np.sqrt((across * across).sum(axis=0)), _unit(across)
        ra, rb = (r / axes.unit for r in self.radii)
        rb = -rb if self.crossed else rb
        cosine = (ra - rb) / distance
        v = cross(axes.za, u)
        normals = [u * cosine + side * v * np.sqrt(1.0 - cosine**2) for side in (1.0, -1.0)]
        level = axes.za * ((axes.pb - axes.pa) * axes.za).sum(axis=0)
        ends = np.stack([axes.pb + rb * w for w in normals], axis=1)
        starts = np.stack([axes.pa + level + ra * w for w in normals], axis=1)
        return ends, _unit(starts - ends)


COUPLINGS: dict[str, type[BaseCoupling]] = {c.kind: c for c in (Coupling, SpurGears, BevelGears, WormGear, Rack, Belt)}
"""Couplings by the name of their kind in files."""
