"""Gears, racks and belts: the kinds of contact, each with what a designer gives: teeth or radii, angles of the flanks and of the teeth.

Source: Litvin and Fuentes, Gear Geometry and Applied Theory, 2004, chapters 10 (pitch points), 14 to 19.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from mechgraph.fields import FLAG, NUMBER, POSITIVE, TWO_POSITIVE, TWO_WHOLE
from mechgraph.maths.se3 import Array, cross
from mechgraph.model.couplings import Axes, BaseCoupling, Contact, Coupling, Lines, fitting_of, teeth_lines, unit
from mechgraph.quantities import LENGTH, PURE, wrong

_TEETH = TWO_WHOLE("numbers of teeth of both gears")
_PRESSURE = NUMBER("of the flanks, in the normal section", PURE, degrees=True, minimum=0.0)
_FULL = float(np.deg2rad(20.0))


@dataclass(frozen=True)
class SpurGears(Contact):
    """Declare two spur or helical gears on parallel axes, external or internal.

    The mesh lies in the plane through the point of pair b. Center distance and tooth numbers set the pitch radii; a normal ``module``
    must fit the center distance. The sign of the load selects the loaded flank. Power: ``z_a q'_a = -+ z_b q'_b``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [
    ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
    ...     for k, link, x in [("A", "p", 0), ("B", "w", 0.06)]
    ... ]
    >>> m = mg.Mechanism(
    ...     "gears", pairs=pairs, couplings=[mg.SpurGears("g", "A", "B", teeth=(20, 40), module=0.002)], drives=["A"]
    ... )
    >>> s = mg.solve(m, {"A": 0.0}, loads=[mg.Effort("B", -3)])
    >>> s.coupling("g").force.round(3)
    array([ 27.298, -75.   ,   0.   ])
    """

    kind: ClassVar[str] = "spur"
    teeth: Annotated[Any, _TEETH]
    module: Annotated[
        float | None, POSITIVE("normal module", LENGTH, default="what the distance of the axes asks for")
    ] = None
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    helix_angle: Annotated[float, NUMBER("of gear a, right-hand positive", PURE, degrees=True)] = 0.0
    internal: Annotated[bool, FLAG("whether the gear with more teeth has them inside")] = False

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and self.internal and self.teeth[0] == self.teeth[1]:
            found.append(wrong(self.teeth, "teeth", "different numbers of an internal pair"))
        if not found and not (0.0 <= self.pressure_angle < 1.2 and abs(self.helix_angle) < 1.2):
            found.append(
                f"pressure_angle = {self.pressure_angle:g}, helix_angle = {self.helix_angle:g}: expected angles below 1.2 rad"
            )
        return found

    @property
    def ratio(self) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    @property
    def _sum(self) -> float:
        """Teeth along the line of centers: the sum, or the difference of an internal pair."""
        return abs(self.teeth[1] - self.teeth[0]) if self.internal else self.teeth[0] + self.teeth[1]

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() > fitting:
            return ["the axes are not parallel. Use BevelGears (intersecting) or WormGear (crossed)"]
        distance = float(np.linalg.norm(axes.across))
        if distance == 0.0:
            return ["both gears have the same axis; their axes must be apart"]
        fit = distance if self.module is None else float(self.module * self._sum / (2 * np.cos(self.helix_angle)))
        if self.module is not None and abs(distance - fit) > fitting * fit:
            return [
                f"the axes are {distance:.7g} apart; {self.teeth[0]:g} and {self.teeth[1]:g} teeth of module {self.module:g} mesh at "
                f"{fit:.7g} (at {distance:.7g} with module {self.module * distance / fit:.7g})"
            ]
        return []

    @property
    def rims(self) -> tuple[tuple[str, float, float], ...]:
        """Freedom, teeth and helix angle, right-hand positive, of both gears."""
        helix = self.helix_angle if self.internal else -self.helix_angle
        return (self.a, self.teeth[0], self.helix_angle), (self.b, self.teeth[1], helix)

    def module_in(self, m: Any) -> float:
        """The normal module, that which the distance of the axes asks for where none is given."""
        if self.module is not None:
            return float(self.module)
        steps = self._way(m)
        assert not isinstance(steps, str)
        placed = self._axes(m, steps)
        assert not isinstance(placed, str)
        return float(2 * np.linalg.norm(placed.axes.across) * np.cos(self.helix_angle) / self._sum)

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        across = axes.across
        u = unit(across)
        rb = np.sqrt((across * across).sum(axis=0)) * self.teeth[1] / self._sum
        ring_a = self.internal and self.teeth[0] > self.teeth[1]
        P = axes.pb + (rb if ring_a else -rb) * u
        away = -u if self.internal else u
        out = P - axes.pa
        t = cross(axes.za, unit(out - axes.za * (out * axes.za).sum(axis=0)))
        trace = np.cos(self.helix_angle) * axes.za + np.sin(self.helix_angle) * t
        return teeth_lines(P, away, trace, self.pressure_angle)


def rim_faults(couplings: Iterable[BaseCoupling], m: Any) -> Iterator[str]:
    """Gears that would have two modules, because the distances of the axes ask for it, or two helices, among couplings without faults.

    The meshes of one rim are compared with the first that leaves the module to the axes: the time is proportional to their number.
    """
    rims: dict[tuple[str, float], list[tuple[SpurGears, str, float]]] = {}
    for gears in couplings:
        if isinstance(gears, SpurGears):
            for q, teeth, helix in gears.rims:
                rims.setdefault((m.full_name(q), teeth), []).append((gears, q, helix))
    for (_, teeth), meshes in rims.items():
        first = next((i for i, (gears, *_) in enumerate(meshes) if not gears.module), len(meshes))
        for i in range(len(meshes)) if first < len(meshes) else ():
            if i == first:
                continue
            (one, q, helix), (two, _, other) = (meshes[k] for k in sorted((i, first)))
            # radians by which the helix angles of one gear in two meshes may differ: more than
            # tolerances, less than another hand
            if abs(helix - other) > 0.02:
                yield (
                    f"couplings {one.name!r} and {two.name!r}: the {teeth:g} teeth on {q!r} would have the helix angle {helix:.7g} "
                    f"in one and {other:.7g} in the other (gear b has the opposite of helix_angle, in an internal pair the same); "
                    "change one, or give module= in both where the gear has two rims"
                )
            mine, yours = one.module_in(m), two.module_in(m)
            if abs(mine - yours) > fitting_of(m) * max(mine, yours):
                yield (
                    f"couplings {one.name!r} and {two.name!r}: the {teeth:g} teeth on {q!r} would have the module {mine:.7g} in one "
                    f"and {yours:.7g} in the other, as the distances of the axes ask for; change the teeth or the places, or give "
                    "module= in both where the gear has two rims"
                )


@dataclass(frozen=True)
class BevelGears(Contact):
    """Declare two bevel gears, straight or spiral, on intersecting axes.

    Each gear is on the side of the apex on which the point of its pair lies. ``module`` is that at the middle of the face, where the
    force acts.

    Examples
    --------
    >>> import mechgraph as mg
    >>> axes = [("A", "p", (0.1, 0, 0), (1, 0, 0)), ("B", "w", (0, 0.1, 0), (0, 1, 0))]
    >>> pairs = [mg.Pair(k, "R", "frame", link, point=p, axis=z) for k, link, p, z in axes]
    >>> m = mg.Mechanism(
    ...     "bevel", pairs=pairs, couplings=[mg.BevelGears("g", "A", "B", teeth=(20, 40), module=0.002)], drives=["A"]
    ... )
    >>> abs(mg.kinematics(m, {"A": 1.0})["B"].position)
    array([0.5])
    """

    kind: ClassVar[str] = "bevel"
    teeth: Annotated[Any, _TEETH]
    module: Annotated[float, POSITIVE("at the middle of the face", LENGTH)]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    spiral_angle: Annotated[float, NUMBER("of gear a, right-hand positive", PURE, degrees=True)] = 0.0

    @property
    def ratio(self) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    def _apex(self, axes: Axes) -> tuple[Array, float]:
        """The point of axis a nearest to axis b, and how far the axes pass by each other."""
        n = cross(axes.za, axes.zb)
        square = (n * n).sum(axis=0)
        d = axes.pb - axes.pa
        along = (cross(d, axes.zb) * n).sum(axis=0) / square
        return axes.pa + along * axes.za, float(np.abs((d * n).sum(axis=0) / np.sqrt(square)).max())

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() < 1e-3:
            return ["the axes are parallel; bevel gears are on axes that intersect"]
        apex, off = self._apex(axes)
        size = max(float(np.abs(p - apex).max()) for p in (axes.pa, axes.pb))
        if off > fitting * max(size, self.module):
            return [f"the axes pass each other at {off:.4g}; bevel gears are on axes that intersect"]
        at_apex = [
            q for q, p in ((self.a, axes.pa), (self.b, axes.pb)) if np.abs(p - apex).max() <= fitting * self.module
        ]
        return [
            f"the point of {q!r} is where the axes intersect; give one on the side of the apex on which the gear stands"
            for q in at_apex
        ]

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        apex, _ = self._apex(axes)
        ea, eb = (z * np.sign(((p - apex) * z).sum(axis=0)) for p, z in ((axes.pa, axes.za), (axes.pb, axes.zb)))
        cosine = (ea * eb).sum(axis=0)
        sine = np.sqrt(1.0 - cosine**2)
        angle = np.arctan2(sine, self.teeth[1] / self.teeth[0] + cosine)
        side = unit(eb - ea * cosine)
        line = np.cos(angle) * ea + np.sin(angle) * side
        P = apex + line * (self.module * self.teeth[0] / 2 / axes.unit / np.sin(angle))
        away = np.cos(angle) * side - np.sin(angle) * ea
        t = cross(axes.za, unit(side))
        trace = np.cos(self.spiral_angle) * line + np.sin(self.spiral_angle) * t * np.sign((ea * axes.za).sum(axis=0))
        return teeth_lines(P, away, trace, self.pressure_angle)


@dataclass(frozen=True)
class WormGear(Contact):
    """Declare a worm a and its wheel b on perpendicular crossed axes.

    ``radius`` is that of the pitch cylinder of the worm.

    Examples
    --------
    >>> import mechgraph as mg
    >>> axes = [("A", "worm", (0, 0, 0), (1, 0, 0)), ("B", "wheel", (0, 0.05, 0), (0, 0, 1))]
    >>> pairs = [mg.Pair(k, "R", "frame", link, point=p, axis=z) for k, link, p, z in axes]
    >>> m = mg.Mechanism(
    ...     "worm", pairs=pairs, couplings=[mg.WormGear("g", "A", "B", teeth=(2, 40), radius=0.01)], drives=["A"]
    ... )
    >>> abs(mg.kinematics(m, {"A": 1.0})["B"].position)
    array([0.05])
    """

    kind: ClassVar[str] = "worm"
    teeth: Annotated[Any, TWO_WHOLE("starts of the worm and teeth of the wheel")]
    radius: Annotated[float, POSITIVE("of the pitch cylinder of the worm", LENGTH)]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    left_hand: Annotated[bool, FLAG("whether the thread is left-handed")] = False

    @property
    def ratio(self) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        cosine = float(np.abs((axes.za * axes.zb).sum(axis=0)).max())
        if cosine > fitting:
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
    """Declare a pinion a on a revolute pair and a rack b on a prismatic pair.

    The rack is on the side of the pinion on which the point of its pair lies.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=(0, 0, 1))]
    >>> pairs += [mg.Pair("B", "P", "frame", "rack", point=(0, -0.02, 0), axis=(1, 0, 0))]
    >>> m = mg.Mechanism("rack", pairs=pairs, couplings=[mg.Rack("g", "A", "B", radius=0.02)], drives=["A"])
    >>> mg.kinematics(m, {"A": 1.0})["B"].position
    array([0.02])
    """

    kind: ClassVar[str] = "rack"
    slides: ClassVar[bool] = True
    radius: Annotated[float, POSITIVE("pitch radius of the pinion", LENGTH)]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL

    @property
    def ratio(self) -> float:
        """``1 / r``."""
        return 1.0 / self.radius

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        if np.abs((axes.za * axes.zb).sum(axis=0)).max() > fitting:
            return ["the rack does not slide at right angles to the axis of the pinion"]
        if np.abs(((axes.pb - axes.pa) * cross(axes.za, axes.zb)).sum(axis=0)).max() <= fitting * self.radius:
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
    """Declare a belt or chain around two pulleys on parallel axes, open or crossed.

    The tight side carries the whole load, the slack side nothing.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [
    ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
    ...     for k, link, x in [("A", "p", 0), ("B", "w", 0.5)]
    ... ]
    >>> m = mg.Mechanism("belt", pairs=pairs, couplings=[mg.Belt("g", "A", "B", radii=(0.1, 0.2))], drives=["A"])
    >>> mg.kinematics(m, {"A": 1.0})["B"].position
    array([0.5])
    """

    kind: ClassVar[str] = "belt"
    radii: Annotated[Any, TWO_POSITIVE("of both pulleys", LENGTH)]
    crossed: Annotated[bool, FLAG("whether the strands cross")] = False

    @property
    def ratio(self) -> float:
        """``r_b / r_a``."""
        return self.radii[1] / self.radii[0]

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() > fitting:
            return ["the axes are not parallel"]
        distance, needed = float(np.linalg.norm(axes.across)), sum(self.radii)
        if distance > needed:
            return []
        return [f"the axes are {distance:.7g} apart, and the pulleys overlap; expected more than {needed:.7g}"]

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        across = axes.across
        distance, u = np.sqrt((across * across).sum(axis=0)), unit(across)
        ra, rb = (r / axes.unit for r in self.radii)
        rb = -rb if self.crossed else rb
        cosine = (ra - rb) / distance
        v = cross(axes.za, u)
        normals = [u * cosine + side * v * np.sqrt(1.0 - cosine**2) for side in (1.0, -1.0)]
        level = axes.za * ((axes.pb - axes.pa) * axes.za).sum(axis=0)
        ends = np.stack([axes.pb + rb * w for w in normals], axis=1)
        starts = np.stack([axes.pa + level + ra * w for w in normals], axis=1)
        return ends, unit(starts - ends)


COUPLINGS: dict[str, type[BaseCoupling]] = {c.kind: c for c in (Coupling, SpurGears, BevelGears, WormGear, Rack, Belt)}
"""Couplings by the name of their kind in files."""
