"""What meshes of gears amount to: ratios, angles, circles, contact ratios, backlash.

Source: ISO 21771:2007, Cylindrical involute gears and gear pairs; G. Niemann and H. Winter, Maschinenelemente II, 2003, chapters 21, 22.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import acos, atan, cos, pi, sin, sqrt, tan
from typing import TYPE_CHECKING, Any

import numpy as np

from mechgraph.errors import DeclarationError, TellsNames
from mechgraph.memo import dataclass
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.gears import Gear, GearRack, involute, tip_radius
from mechgraph.model.meshes import Bevels, Mesh, Meshing, Parallel, WithRack
from mechgraph.model.pair import Link, Pair
from mechgraph.model.setups import Stop
from mechgraph.quantities import ByName, door

if TYPE_CHECKING:
    from mechgraph.model.mechanism import Mechanism

NAN2 = (float("nan"), float("nan"))


@dataclass(frozen=True)
class MeshFacts(TellsNames):
    """What a mesh amounts to at the declared places, lengths in the units of the mechanism; NaN and empty where it has no such thing.

    Attributes
    ----------
    kind : str
        ``parallel``, ``rack``, ``crossed``, ``bevels``, ``worms``.
    ratio : float
        ``N_b / N_a``.
    distance, working_angle : float
        Of the axes; working pressure angle in the plane across them [rad].
    pitch_radii, tip_radii, root_radii : tuple of float
        Of a and b: working pitch circles; tip circles, shortened to keep the clearance; root circles at a dedendum of 1.25 modules.
    asked_shifts : float
        Sum of the profile shifts (ring minus gear) at which the gears run without backlash at this distance.
    contact_ratio, overlap_ratio : float
        Of the profiles, and by the helix.
    backlash : float
        Along the working pitch circles: what the distance leaves and what is declared; ``backlash_angles`` of a and b [rad].
    undercut : tuple of float
        Least shifts of a and b without undercut, in modules.
    faults : tuple of str
        Undercut, interference, a contact ratio below 1.
    """

    kind: str
    ratio: float
    distance: float = float("nan")
    working_angle: float = float("nan")
    pitch_radii: tuple[float, float] = NAN2
    tip_radii: tuple[float, float] = NAN2
    root_radii: tuple[float, float] = NAN2
    asked_shifts: float = float("nan")
    contact_ratio: float = float("nan")
    overlap_ratio: float = float("nan")
    backlash: float = float("nan")
    backlash_angles: tuple[float, float] = NAN2
    undercut: tuple[float, float] = NAN2
    faults: tuple[str, ...] = ()


@door
def mesh_facts(m: Mechanism) -> dict[str, MeshFacts]:
    """Return what every mesh of a mechanism amounts to, of short forms too that say how many teeth there are.

    Parameters
    ----------
    m : Mechanism
        A mechanism with geometry.

    Returns
    -------
    dict of str to MeshFacts
        By the names of the meshes.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z, at = (0, 0, 1), {"p": (0, 0, 0), "w": (0.0612, 0, 0)}
    >>> m = mg.Mechanism(
    ...     "stage",
    ...     pairs=[mg.Pair(k, "R", "frame", k, point=x, axis=z) for k, x in at.items()],
    ...     gears=[mg.Gear(k, k, N, at[k], z, module=0.002) for k, N in (("p", 20), ("w", 40))],
    ...     couplings=[mg.Mesh("m", "p", "w")],
    ... )
    >>> round(mg.mesh_facts(m)["m"].backlash, 9)
    0.000954013
    """
    if not m.has_geometry:
        raise DeclarationError(f"mechanism {m.name!r}", ["has no geometry; meshes have facts at their places"])
    found = ((c.name, _facts(m, c)) for c in m.couplings if isinstance(c, Meshing) and c.sized)
    return ByName(f"mesh_facts {m.name!r}", "mesh", found)


def _facts(m: Mechanism, mesh: Meshing) -> MeshFacts:
    met = mesh.seen(m)
    if isinstance(met, Parallel):
        return _parallel(met, mesh)
    kind = type(met).__name__.lower()
    if isinstance(met, WithRack):
        return _rack(met, mesh)
    return MeshFacts(kind, met.two.teeth / met.one.teeth)


def least_shift(gear: Gear) -> float:
    """The least profile shift without undercut, ``1 - z sin^2 a_t / (2 cos b)``, in modules; none of a gear with its teeth inside."""
    if gear.internal:
        return -float("inf")
    return 1.0 - gear.radius / gear.module * sin(gear.transverse_angle) ** 2


def _root(gear: Gear) -> float:
    """The dedendum is 1.25 modules."""
    depth = gear.module * (1.25 - gear.shift)
    return gear.radius + gear.module * (1.25 + gear.shift) if gear.internal else gear.radius - depth


def _overlap(met: Any) -> float:
    """Width in which both run, times the lead of the helix, over the pitch."""
    if met.one.width is None and met.two.width is None:
        return float("nan")
    half_a, half_b = (np.inf if g.width is None else g.width / 2 for g in (met.one, met.two))
    width = min(half_a, met.h + half_b) - max(-half_a, met.h - half_b)
    return float(width * abs(sin(met.one.helix_angle)) / (pi * met.one.module))


def _parallel(met: Parallel, mesh: Meshing) -> MeshFacts:
    one, two, d, w = met.one, met.two, met.distance, met.working_angle
    inner = one.internal or two.internal
    tips, bases = _tips(met), (one.base_radius, two.base_radius)
    contact = sum(_reaches(bases, tips, w)) / (2 * pi * abs(bases[0]) / one.teeth)
    backlash = met.backlash + mesh.backlash
    radii = abs(bases[0]) / cos(w), abs(bases[1]) / cos(w)
    faults = [
        f"{g.name!r}: {g.teeth} teeth with the shift {g.shift:g} are undercut by a rack; expected a shift of {least_shift(g):.6g} or more"
        for g in (one, two)
        if g.shift < least_shift(g) - 1e-9
    ]
    if contact < 1.0:
        faults.append(f"contact ratio {contact:.4g}: teeth part before the next ones meet; expected more than 1")
    faults += list(_interference(met, tips)) if not inner else list(_inside(met, tips))
    return MeshFacts(
        "parallel", two.teeth / one.teeth, d, w, radii, tips, (_root(one), _root(two)), met.asked_shifts, contact, _overlap(met), backlash,
        (backlash / radii[0], backlash / radii[1]), (least_shift(one), least_shift(two)), tuple(faults),
    )  # fmt: skip


def _tips(met: Parallel) -> tuple[float, float]:
    """Radii of the tip circles, shortened to keep the clearance."""
    one, two, shorter = met.one, met.two, 0.0
    if not (one.internal or two.internal):
        shorter = max(0.0, met.shifts - (met.distance - one.radius - two.radius) / one.module)
    return tip_radius(one, shorter), tip_radius(two, shorter)


def _reaches(bases: tuple[float, float], tips: tuple[float, float], w: float) -> tuple[float, float]:
    """How far from the pitch point both tips reach along the line of action; base radii are negative with teeth inside."""
    one, two = (
        float(np.sign(k)) * (sqrt(max(tip**2 - k**2, 0.0)) - abs(k) * tan(w))
        for k, tip in zip(bases, tips, strict=True)
    )
    return one, two


def _interference(met: Parallel, tips: Any) -> Iterator[str]:
    """Tips that reach below the base circle of the other gear along the line of action."""
    whole = met.distance * sin(met.working_angle)
    for gear, mate, tip in ((met.one, met.two, tips[0]), (met.two, met.one, tips[1])):
        if sqrt(max(tip**2 - gear.base_radius**2, 0.0)) > whole * (1 + 1e-12):
            yield f"the tips of {gear.name!r} reach below the base circle of {mate.name!r}: involutes interfere"


def _inside(met: Parallel, tips: Any) -> Iterator[str]:
    """Interference of a gear and its ring: of the involutes, and of the tips where their circles cross beside the line of centers.

    There, both gears turned by their ratio from the flanks in touch, the tip of the gear must have passed that of the ring (ISO 21771;
    Litvin and Fuentes, chapter 11): ``(t + inv a - inv w) z / z_r + inv w - inv a_r > t_r`` with t, t_r the angles of the crossing
    about both centers against the line of centers and a, a_r the pressure angles at both tips.
    """
    (ring, top), (other, tip) = sorted(zip((met.one, met.two), tips, strict=True), key=lambda of: -of[0].internal)
    base = abs(ring.base_radius)
    if top <= base:
        yield f"the tip circle {top:.6g} of {ring.name!r} is inside its base circle {base:.6g}; there is no involute there"
        return
    # the tips of the ring must not reach the foot of the involute of the gear
    least = 1.0 - tan(acos(base / top)) / tan(met.working_angle)
    if other.teeth / ring.teeth < least:
        yield f"involutes of {other.name!r} and {ring.name!r} interfere: {other.teeth}/{ring.teeth} is below {least:.6g}"
    d, w = met.distance, involute(met.working_angle)
    if d + tip <= top or tip <= other.base_radius:
        return
    turn, turn_of_ring = acos((top**2 - tip**2 - d**2) / (2 * tip * d)), acos((top**2 - tip**2 + d**2) / (2 * top * d))
    passed = turn + involute(acos(other.base_radius / tip)) - w
    room = passed * other.teeth / ring.teeth + w - involute(acos(base / top)) - turn_of_ring
    if room < 0.0:
        yield (
            f"tips of {other.name!r} and {ring.name!r} strike each other beside the line of centers, by {-room * top:.4g}: "
            f"{ring.teeth} - {other.teeth} = {ring.teeth - other.teeth} teeth are too few; expected more, or a larger shift of the ring"
        )


def _rack(met: WithRack, mesh: Meshing) -> MeshFacts:
    pinion, a = met.pinion, met.pinion.transverse_angle
    distance = -float((np.ravel(met.there.point - met.at.point)) @ np.ravel(met.there.mark))
    tip, contact = tip_radius(pinion), sum(_reaches_of_rack(met)) / (2 * pi * pinion.base_radius / pinion.teeth)
    backlash = 2.0 * (distance - pinion.radius - pinion.module * pinion.shift) * tan(a) + mesh.backlash
    faults = []
    if pinion.shift < least_shift(pinion) - 1e-9:
        faults.append(
            f"{pinion.name!r}: {pinion.teeth} teeth are undercut; expected a shift of {least_shift(pinion):.6g} or more"
        )
    nan = float("nan")

    def both(value: float, other: float) -> tuple[float, float]:
        return (value, other) if met.sign > 0 else (other, value)

    return MeshFacts(
        "rack", nan, distance, a, both(pinion.radius, np.inf), both(tip, nan), both(_root(pinion), nan),
        (distance - pinion.radius) / pinion.module, contact, _overlap(met), backlash, both(backlash / pinion.radius, 0.0),
        both(least_shift(pinion), nan), tuple(faults),
    )  # fmt: skip


def _reaches_of_rack(met: WithRack) -> tuple[float, float]:
    """How far the tips of the pinion and of the rack reach along the line of action."""
    pinion, a = met.pinion, met.pinion.transverse_angle
    distance = -float((np.ravel(met.there.point - met.at.point)) @ np.ravel(met.there.mark))
    tip = sqrt(max(tip_radius(pinion) ** 2 - pinion.base_radius**2, 0.0))
    # the tip line of the rack is a module above its pitch line
    return tip - pinion.radius * sin(a), (pinion.module - (distance - pinion.radius)) / sin(a)


def with_play(m: Mechanism) -> tuple[Mechanism, list[Stop]]:
    """The mechanism with the gap between the flanks of meshes with backlash as a freedom, ``m.play``, and the stops of these.

    The gap is that along the line of action: the backlash, of the distance and declared, by the part of a velocity along the pitch circle
    that the line takes up. It begins closed, on the flank that is given, else forward. Where axes move, the lines of both flanks and the
    gap go with them: the flanks behind have a row, a freedom ``m.backward.play`` and a stop of their own.
    """
    pairs, links, couplings, stops, loads = list(m.pairs), list(m.links), [], [], list(m.loads)

    def freed(c: Mesh, name: str, flank: str, low: float | None, high: float | None = None) -> Mesh:
        play = f"{name}.play"
        links.append(Link(play))
        pairs.append(Pair(play, "P", m.frame, play, point=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)))
        stops.append(Stop(f"{play}.Tz", low, high, c.restitution))
        return c.replace(name=name, play=f"{play}.Tz", flank=flank)

    for c in m.couplings:
        if not isinstance(c, Mesh) or c.backlash == 0.0 or c.play:
            couplings.append(c)
            continue
        met = c.seen(m)
        line = met.line()
        n, z, arm = (v[:, 0, 0] for v in (line.along, met.a.axis, line.point - met.a.point))
        way = z if isinstance(met.one, GearRack) else np.cross(z, arm)
        known = _facts(m, c).backlash
        gap = (c.backlash if np.isnan(known) else known) * float(abs(n @ way) / np.linalg.norm(way))
        low, high = (-gap, 0.0) if c.flank == "backward" else (0.0, gap)
        if c.placed(m).linear:
            couplings.append(freed(c, c.name, c.flank, low, high))
            continue
        behind = behind_of(c.name)
        couplings += [freed(c, c.name, "forward", low), freed(c, behind, "backward", None, high)]
        loads += [load.replace(of=behind) for load in m.loads if getattr(load, "of", None) == c.name]
    if not stops:
        return m, stops
    return m.replace(links=links, pairs=pairs, couplings=couplings, loads=loads), stops


def behind_of(name: str) -> str:
    """The name of the row of the flanks behind, of a mesh with backlash whose axes move."""
    return f"{name}.backward"


def without_play(m: Mechanism) -> Mechanism:
    """The mechanism without the freedoms of such gaps, as it is drawn."""
    plays = {c.play.rpartition(".")[0]: c for c in m.couplings if isinstance(c, Mesh) and c.play == f"{c.name}.play.Tz"}
    if not plays:
        return m
    behind = {behind_of(c.name) for c in plays.values()}
    return m.replace(
        links=[one for one in m.links if one.name not in plays],
        pairs=[one for one in m.pairs if one.name not in plays],
        couplings=[c.replace(play="") if c in plays.values() else c for c in m.couplings if c.name not in behind],
        loads=[one for one in m.loads if getattr(one, "of", None) not in behind],
        drives=[one for one in m.drives if one.freedom.rpartition(".")[0] not in plays],
    )


# --- how far from the pitch point teeth touch -------------------------------------------------------------------------------


def mean_sliding(m: Mechanism, coupling: BaseCoupling) -> float | None:
    """Mean distance ``s`` of the contact of teeth from their pitch point: a normal force N loses ``mu N s |w_b - w_a|``. None of worms
    and crossed gears, which slide at the pitch point; NaN where the numbers of the teeth are not known.

    The same load on all teeth in contact. For contact ratios ``e = e_1 + e_2`` of 1 and more, no part above 1, it is ``p (1 - e + e_1^2 +
    e_2^2) / 2`` with the base pitch p: the loss of Niemann and Winter.
    """
    met = coupling.seen(m) if isinstance(coupling, Meshing) else None
    path = next((make for kind, make in PATHS.items() if isinstance(met, kind)), None)
    if path is None or not isinstance(coupling, Meshing):
        return None
    return _mean_distance(*path(met)) if coupling.sized else float("nan")


def _mean_distance(one: float, two: float, pitch: float) -> float:
    """Mean of ``|s| / n`` over a base pitch for teeth in contact from ``-one`` to ``two``, n of them where one is at s."""
    if not np.isfinite(one + two):
        return float("nan")
    steps = pitch * np.arange(np.ceil((one + two) / pitch))
    cuts = np.unique(np.clip([0.0, *(steps - one), *(two - steps)], -one, two))
    total = 0.0
    for low, high in pairwise(cuts):
        s = (low + high) / 2
        total += abs(high**2 - low**2) / 2 / (np.floor((s + one) / pitch) + np.floor((two - s) / pitch) + 1)
    return float(total / pitch)


Path = tuple[float, float, float]
"""How far both tips reach from the pitch point along the line of action, and the base pitch."""


def _path_of_bevel(met: Bevels) -> Path:
    """Of the spur gears on the back cones (Tredgold), which turn against each other as the bevel gears do."""
    one, cones = met.one, met.cones
    w = atan(tan(one.pressure_angle) / cos(one.spiral_angle))
    sides = [float(np.sign(cos(cone))) for cone in cones]
    radii = [one.module * gear.teeth / (2 * abs(cos(cone))) for gear, cone in zip((one, met.two), cones, strict=True)]
    bases = (sides[0] * radii[0] * cos(w), sides[1] * radii[1] * cos(w))
    tips = [r + side * one.module * cos(one.spiral_angle) for r, side in zip(radii, sides, strict=True)]
    return *_reaches(bases, (tips[0], tips[1]), w), 2 * pi * radii[0] * cos(w) * abs(cos(cones[0])) / one.teeth


def _path_of_parallel(met: Parallel) -> Path:
    bases = (met.one.base_radius, met.two.base_radius)
    return *_reaches(bases, _tips(met), met.working_angle), 2 * pi * abs(bases[0]) / met.one.teeth


def _path_of_rack(met: WithRack) -> Path:
    return *_reaches_of_rack(met), 2 * pi * met.pinion.base_radius / met.pinion.teeth


PATHS: dict[type, Any] = {Parallel: _path_of_parallel, WithRack: _path_of_rack, Bevels: _path_of_bevel}
"""Where teeth touch, of gears that do not slide at their pitch point."""
