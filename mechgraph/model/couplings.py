"""Couplings: linear relations between freedoms; and contacts, which know the lines along which their force acts.

The line of a contact, ``n (3,)`` through ``P (3,)``, stands still on the carrier, the link between the two gears. The force ``F`` on
gear b (and ``-F`` on gear a) does no work on the motions that the coupling allows, ``F . (V_b - V_a) = 0``: with the freedoms ``j`` on
the way from gear a to gear b through the carrier, passed in the sense ``s_j``,

    sum_j c_j q_j = constant,   c_j m = s_j F . S_j,

where ``m`` is the multiplier. There are two lines, for the two signs of ``m``: both flanks of a tooth, both strands of a belt. Source:
Litvin and Fuentes, Gear Geometry and Applied Theory, 2004, chapters 10 (pitch points), 14 to 19.

Gears, racks and belts: the kinds of contact, each with what a designer gives: teeth or radii, angles of the flanks and of the teeth.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from mechgraph.fields import (
    COEFFICIENTS,
    FLAG,
    FREEDOM_NAME,
    NUMBER,
    POSITIVE,
    TEXT,
    TWO_POSITIVE,
    TWO_WHOLE,
    Described,
    FieldFormat,
    number_fault,
    plain,
    sound_tol,
)
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import SHAPES
from mechgraph.memo import dataclass
from mechgraph.model.pair import Marker, Nameable, Pair
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import LENGTH, PURE, is_numeric, shown, without_units, wrong

Terms = tuple[tuple[str, float], ...]


class BaseCoupling(Described, ABC):
    """What all couplings share: ``terms``, freedoms with their coefficients, and a ``constant`` (None: the value at the start)."""

    kind: ClassVar[str]
    """Name of the kind in files."""
    name: str
    terms: Terms
    constant: float | None
    is_force: ClassVar[bool] = False
    """Whether its multiplier is a force, whatever its freedoms are."""
    steps: tuple[Any, ...] = ()
    """Pairs on the way along which the force of the coupling is closed, where it acts along a line of its own."""

    rubs: ClassVar[tuple[str, ...]] = ()
    """Arguments of ``Friction`` that it takes; none of what does not rub."""
    alone: ClassVar[bool] = True
    """Whether it stands for itself, so that it may be left out and its numbers varied without others."""

    @property
    def part_of(self) -> str:
        """Name of what it is a part of, as a span is of its belt; empty where it stands for itself."""
        return ""

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Names of the freedoms, in order."""
        return tuple(freedom for freedom, _ in self.terms) if _is_terms(self.terms) else ()

    @property
    def coefficients(self) -> tuple[float, ...]:
        """The coefficients, in the order of the freedoms."""
        return tuple(coefficient for _, coefficient in self.terms)

    @property
    def text(self) -> str:
        """``2 A.Rz - 3 B.Tz = constant``."""
        terms = " ".join(f"{'-' if c < 0 else '+'} {abs(c):.6g} {name}" for name, c in self.terms).removeprefix("+ ")
        return f"{terms} = {'its value at start' if self.constant is None else f'{self.constant:.6g}'}"

    @abstractmethod
    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""

    @abstractmethod
    def placed(self, m: Any) -> Self:
        """The same with the terms that it has in a mechanism without faults, by the full names of freedoms."""

    def written(self, m: Any) -> tuple[BaseCoupling, ...]:
        """What a mechanism without faults holds of it: itself, ``placed``; of what is several relations, each of them."""
        return (self.placed(m),)

    def gears(self, m: Any) -> tuple[str, str]:
        """The links of gear a and gear b of what acts along a line, placed."""
        first, last = (m.pairs[self.steps[i].pair] for i in (0, -1))
        before, behind = self.steps[0].sense > 0, self.steps[-1].sense > 0
        return (first.a if before else first.b), (last.b if behind else last.a)

    @property
    def varies(self) -> bool:
        """Whether its coefficients are numbers of their own, which a study may vary."""
        return not self.steps

    def renumbered(self, coefficients: Sequence[float], constant: float) -> Self:
        """The same with other coefficients, and another constant where it has one."""
        return self

    @abstractmethod
    def in_own_units(self, units: Mapping[str, str], turns: Sequence[bool]) -> Self:
        """The same with quantities of pint as plain numbers in these units; ``turns`` says which freedoms are angles."""

    @abstractmethod
    def converted(self, base: tuple[float, float, float], turns: Sequence[bool]) -> Self:
        """The same relation in other units, lengths, masses and times times ``base``; ``turns`` says which freedoms are angles."""


@dataclass(frozen=True, init=False)
class Coupling(BaseCoupling):
    """Declare a linear relation between single freedoms, ``sum_i c_i q_i = constant``; its multiplier m is an unknown effort.

    The effort ``c_i m`` acts in freedom i, so the power ``m sum_i c_i q'_i`` is zero. The sum is a length if all freedoms are
    translations (m is a force), else an angle (m is a moment; the coefficient of a translation is one over a length). ``to_units``
    follows that rule.

    Parameters
    ----------
    terms : mapping of str to float
        Freedom -> coefficient, ``{"A": 2.0, "B.Tz": -3.0}``; finite, not zero.
    name : str, optional
        Differs from all pairs and couplings. Default: ``g1``, ``g2``, ...
    constant : float, optional
        Value of the sum. Default: its value at ``start``.

    Raises
    ------
    DeclarationError
        From ``Mechanism``, which checks all couplings.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [
    ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
    ...     for k, link, x in [("A", "p", 0), ("B", "w", 6)]
    ... ]
    >>> m = mg.Mechanism("gears", pairs=pairs, couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"])
    >>> s = mg.solve(m, {"A": 1.0}, loads=[mg.Effort("B", -3)])
    >>> s["B"].position, s["A"].effort, float(s.coupling("teeth").effort)
    (array([-0.5]), array([-1.5]), 0.075)
    """

    kind: ClassVar[str] = "linear"
    name: Annotated[str, TEXT("name", default="g1, g2, ...")]
    terms: Annotated[Terms, COEFFICIENTS("freedom → coefficient; single freedoms, none of the rotation of S, Sg, Sp")]
    constant: Annotated[
        float | None, NUMBER("value of the sum", LENGTH, PURE, degrees=True, default="its value at `[start]`")
    ] = None

    def __init__(
        self,
        terms: Mapping[str, float] | Iterable[tuple[str, float]],
        *,
        name: str | None = None,
        constant: float | None = None,
    ) -> None:
        object.__setattr__(self, "name", "" if name is None else name)
        object.__setattr__(self, "terms", _read_terms(terms))
        object.__setattr__(self, "constant", plain(constant))

    def placed(self, m: Nameable) -> Self:
        """See ``BaseCoupling``."""
        return self.replace(terms=[(m.full_name(freedom), value) for freedom, value in self.terms])

    def renumbered(self, coefficients: Sequence[float], constant: float) -> Self:
        """See ``BaseCoupling``."""
        terms = tuple(zip(self.freedoms, coefficients, strict=True))
        return self.replace(terms=terms, constant=None if self.constant is None else constant)

    def faults(self, m: Nameable) -> list[str]:
        """What is wrong with this coupling in a mechanism, one line each."""
        where = f"coupling {shown(self.name)}: "
        if not isinstance(self.name, str):
            return [wrong(self.name, "coupling: name", "a text")]
        if not _is_terms(self.terms):
            return [wrong(self.terms, f"{where}terms", "a mapping freedom -> coefficient")]
        found: list[str | None] = [] if self.terms else [f"{where}has no terms; name at least one freedom"]
        seen: dict[str, str] = {}
        for freedom, c in self.terms:
            fault = m.freedom_fault(freedom, single=True)
            found.append(fault and where + fault)
            if not is_numeric(c, ()) or c == 0:
                found.append(wrong(c, f"{where}coefficient of {freedom!r}", "a finite number other than 0"))
            if not fault and (
                seen.setdefault(m.full_name(freedom), freedom) != freedom or self.freedoms.count(freedom) > 1
            ):
                found.append(f"{where}names the freedom {m.full_name(freedom)} twice")
        if self.constant is not None:
            found.append(number_fault(self.constant, where + "constant"))
        return list(dict.fromkeys(fault for fault in found if fault))

    def in_own_units(self, units: Mapping[str, str], turns: Sequence[bool]) -> Self:
        """The same with quantities of pint as plain numbers in these units; ``turns`` says which freedoms are angles."""
        if not _is_terms(self.terms):
            return self
        slides = not any(turns)
        terms = [
            (name, plain(without_units(c, PURE if slides or turn else (-1, 0, 0), units)))
            for (name, c), turn in zip(self.terms, turns, strict=True)
        ]
        return self.replace(terms=terms, constant=without_units(self.constant, LENGTH if slides else PURE, units))

    def converted(self, base: tuple[float, float, float], turns: Sequence[bool]) -> Self:
        """The same relation in other units; ``turns`` says which freedoms are angles (the rule stands above)."""
        length = base[0]
        if not any(turns):
            return self.replace(constant=None if self.constant is None else self.constant * length)
        pairs = zip(self.terms, turns, strict=True)
        return self.replace(terms=[(name, c if turn else c / length) for (name, c), turn in pairs])


def _read_terms(given: Any) -> Any:
    """Pairs (freedom, coefficient); what is no mapping and no sequence of pairs is kept unchanged."""
    items = given.items() if isinstance(given, Mapping) else given
    try:
        return tuple((name, plain(c)) for name, c in items)
    except (TypeError, ValueError):
        return given


def _is_terms(terms: Any) -> bool:
    return isinstance(terms, tuple) and all(isinstance(term, tuple) and len(term) == 2 for term in terms)


class Axes(NamedTuple):
    """Axes of both gears, points and unit directions ``(3, T)`` each, and the unit of length in which they are given."""

    pa: Array
    za: Array
    pb: Array
    zb: Array
    unit: float = 1.0

    def at(self, places: Any) -> Axes:
        """Those at some positions."""
        return Axes(self.pa[:, places], self.za[:, places], self.pb[:, places], self.zb[:, places], self.unit)

    @property
    def across(self) -> Array:
        """From axis a to axis b, at right angles to axis a, ``(3, T)``."""
        d = self.pb - self.pa
        return d - self.za * (d * self.za).sum(axis=0)

    @property
    def perpendicular(self) -> tuple[Array, Array, Array]:
        """The point of axis a nearest to axis b, the unit direction ``(3, T)`` across both, and how far along it b passes a, ``(T,)``."""
        n, d = cross(self.za, self.zb), self.pb - self.pa
        square = (n * n).sum(axis=0)
        foot = self.pa + self.za * ((cross(d, self.zb) * n).sum(axis=0) / square)
        w = n / np.sqrt(square)
        return foot, w, (d * w).sum(axis=0)


Lines = tuple[Array, Array]
"""Points and unit directions ``(3, 2, T)`` of the force on gear b, for both flanks or strands; along each it acts in one sense only."""


class MeshStep(NamedTuple):
    """A pair on the way from gear a to gear b: its place, and whether it is passed from its link a to its link b (1) or back (-1)."""

    pair: int
    sense: float


def unit(v: Array) -> Array:
    """Vectors ``(3, T)`` of length 1 along ``v``."""
    return np.asarray(v / np.sqrt((v * v).sum(axis=0)))


def teeth_lines(P: Array, away: Array, trace: Array, pressure_angle: float) -> Lines:
    """Both flanks at a pitch point: normals at the pressure angle to the pitch plane, across the ``trace`` of the teeth.

    ``away (3, T)``: from gear a to gear b, at right angles to the pitch plane.
    """
    over = np.cos(pressure_angle) * unit(cross(away, trace))
    out = np.sin(pressure_angle) * away
    return np.stack([P, P], axis=1), np.stack([out + over, out - over], axis=1)


OF_TEETH = ("mu", "static", "stribeck", "preload", "efficiency")
OF_BELTS = ("mu", "wrap", "preload")


@dataclass(frozen=True)
class Contact(BaseCoupling):
    """What gears, racks and belts share.

    ``a`` and ``b`` are the freedoms of the two gears on their carrier: pairs R (of a rack P) that share a link, or that pairs R about the
    axis of a or of b connect with it, as a planet on its arm and a sun wheel or a ring on the frame.
    """

    kind: ClassVar[str]
    rubs: ClassVar[tuple[str, ...]] = OF_TEETH
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

    @property
    @abstractmethod
    def ratio(self) -> float:
        """The size of ``c_b / c_a``."""

    @abstractmethod
    def lines(self, axes: Axes) -> Lines:
        """The lines of the force on gear b."""

    @abstractmethod
    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """What is wrong with the places of the gears, which may miss theirs by ``fitting`` of a length, or angle."""

    # --- in a mechanism ----------------------------------------------------------------------------------------------

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""
        where = f"coupling {shown(self.name)}: "
        found = [where + fault for fault in self.value_faults("")]
        ends = {side: getattr(self, side) for side in "ab"}
        found += [where + fault for fault in (m.freedom_fault(q, single=True) for q in ends.values()) if fault]
        if found:
            return found
        for side, q in ends.items():
            pair, wanted = m.pairs[m.freedom(q)[0]], "slide" if side == "b" and self.slides else "turn"
            if motion_of(pair) != wanted:
                found.append(
                    f"{where}{side} = {q!r}: is a pair {pair.type.symbol}; expected one whose only freedom is a {wanted} at its axis"
                )
        if found:
            return found
        steps = self._way(m)
        if isinstance(steps, str):
            return [where + steps]
        if not m.once(are_placed):
            return []
        placed = self._axes(m, steps)
        wrong = [placed] if isinstance(placed, str) else self.misfits(placed.axes, fitting_of(m))
        return [where + fault for fault in wrong]

    def _way(self, m: Any) -> tuple[MeshStep, ...] | str:
        """The pairs from gear a to gear b, or why there is no carrier between them."""
        first, last = (m.freedom(q)[0] for q in (self.a, self.b))
        if first == last:
            return f"a and b are the same freedom {self.a!r}; name those of two gears"
        alone = (
            f"{self.a!r} and {self.b!r} have no link in common that could carry both gears, and no pairs R about the axis of one of them "
            "connect them; gears need a common carrier"
        )
        turning, ends = m.once(turning_pairs), [(m.pairs[k].a, m.pairs[k].b) for k in (first, last)]
        ways = ((a, way(m, turning, a, b, (first, last)), b) for a in ends[0] for b in ends[1])
        found = min(
            ((a, steps, b) for a, steps, b in ways if steps is not None), key=lambda one: len(one[1]), default=None
        )
        if found is None:
            return alone
        a, steps, b = found
        return (
            MeshStep(first, 1.0 if m.pairs[first].b == a else -1.0),
            *steps,
            MeshStep(last, 1.0 if m.pairs[last].a == b else -1.0),
        )

    def _axes(self, m: Any, steps: tuple[MeshStep, ...]) -> _OnCarrier | str:
        """The gears seen from their carrier in the declared configuration: between gear a and it pairs turn about the axis of a, between
        it and gear b about that of b; or what is wrong with them.
        """
        fitting, back = fitting_of(m), tuple(MeshStep(step.pair, -step.sense) for step in reversed(steps))
        p, z, senses_a, off = followed(m, steps[1:-1], *_axis_behind(m, steps[0]), fitting)
        q, w, senses_b, _ = followed(m, back[1 : -1 - len(senses_a)], *_axis_behind(m, back[0]), fitting)
        if len(senses_a) + len(senses_b) < len(steps) - 2:
            stray = m.pairs[steps[1 + len(senses_a)].pair].name
            return (
                f"pair {stray!r} between the gears is not about the axis of {self.a!r} (off by {off:.3g}); {self.a!r} and "
                f"{self.b!r} need a common carrier"
            )
        return _OnCarrier(Axes(p[:, None], z[:, None], q[:, None], w[:, None]), senses_a, senses_b[::-1])

    def axes_in(self, m: Any) -> Axes:
        """The axes of the gears on their carrier, in a mechanism without faults."""
        steps = self._way(m)
        assert not isinstance(steps, str)
        placed = self._axes(m, steps)
        assert not isinstance(placed, str)
        return placed.axes

    def placed(self, m: Any) -> Self:
        """The same with the coefficients of its freedoms, by their full names; needs sound faults-free gears."""
        steps = self._way(m)
        assert not isinstance(steps, str)
        values = [1.0] * (len(steps) - 1) + [self.ratio]
        if m.has_geometry:
            placed = self._axes(m, steps)
            assert not isinstance(placed, str)
            P, n = (part[:, 0] for part in self.lines(placed.axes))
            va, vb = self._velocities(placed.axes, P)
            ratio = float(np.sign((n * va).sum() * (n * vb).sum())) * self.ratio
            values = [1.0, *placed.senses_a, *(ratio * sense for sense in placed.senses_b), ratio]
        names = [m.pairs[step.pair].freedom_names[0] for step in steps]
        terms = [(name, v * steps[0].sense * s.sense) for name, v, s in zip(names, values, steps, strict=True)]
        out = self.replace(**{side: m.full_name(getattr(self, side)) for side in "ab"})
        object.__setattr__(out, "terms", tuple(terms))
        object.__setattr__(out, "steps", steps)
        return out

    def _velocities(self, axes: Axes, P: Array) -> tuple[Array, Array]:
        """Velocities ``(3, T)`` of both gears at a point for unit rates."""
        return cross(axes.za, P - axes.pa), axes.zb if self.slides else cross(axes.zb, P - axes.pb)

    def in_own_units(self, units: Any, turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.without_quantities(units)

    def converted(self, base: tuple[float, float, float], turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.in_units(base)


class _OnCarrier(NamedTuple):
    """The axes of two gears in the frame of their carrier, and the senses (1, -1) of those of the pairs between a gear and the carrier,
    seen along the axis of that gear.
    """

    axes: Axes
    senses_a: list[float]
    senses_b: list[float]


def fitting_of(m: Any) -> float:
    """Part of a length, or angle, by which gears may miss their place in a mechanism."""
    return max(SHAPES.met, 2.0 * sound_tol(m.tol))


def are_placed(m: Any) -> bool:
    """Whether every pair says where it sits, without faults."""
    return all(pair.has_geometry and not pair.faults() for pair in m.pairs)


def motion_of(pair: Pair) -> str:
    """``"turn"`` or ``"slide"`` of a pair whose only freedom is one about or along its axis; nothing for other pairs."""
    freedoms = pair.type.freedoms
    plain: dict[tuple[float, ...], str] = {
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0): "turn",
        (0.0, 0.0, 0.0, 0.0, 0.0, 1.0): "slide",
    }
    single = len(freedoms) == 1 and not any(freedoms[0].per_pitch)
    return plain.get(tuple(freedoms[0].twist), "") if single else ""


def meeting(m: Any) -> dict[str, list[tuple[int, str]]]:
    """The pairs on every link: their places, and the links at their other ends."""
    return _meeting(m, ("turn", "slide", ""))


def plain_pairs(m: Any) -> dict[str, list[tuple[int, str]]]:
    """Those of them whose only freedom is a turn or a slide."""
    return _meeting(m, ("turn", "slide"))


def turning_pairs(m: Any) -> dict[str, list[tuple[int, str]]]:
    """Those of them whose only freedom is a turn."""
    return _meeting(m, ("turn",))


def _meeting(m: Any, motions: tuple[str, ...]) -> dict[str, list[tuple[int, str]]]:
    found: dict[str, list[tuple[int, str]]] = {}
    for k, pair in enumerate(m.pairs):
        if (
            isinstance(pair.a, str)
            and isinstance(pair.b, str)
            and isinstance(pair.type, PairType)
            and motion_of(pair) in motions
        ):
            for link, other in ((pair.a, pair.b), (pair.b, pair.a)):
                found.setdefault(link, []).append((k, other))
    return found


def way(
    m: Any, neighbors: Mapping[str, list[tuple[int, str]]], a: str, b: str, without: tuple[int, ...] = ()
) -> tuple[MeshStep, ...] | None:
    """The pairs of a shortest way from link a to link b, ``without`` some; None where there is none.

    Searched from both ends, the one with fewer pairs ahead first, so that the frame of many links is hardly ever gone through.
    """
    came: tuple[dict[str, tuple[int, str] | None], ...] = ({a: None}, {b: None})
    fronts = [[a], [b]]
    meet = a if a == b else None
    while meet is None:
        cost = [sum(len(neighbors.get(link, ())) for link in front) for front in fronts]
        if not all(fronts):
            return None
        i = int(cost[1] < cost[0])
        ahead: list[str] = []
        for link in fronts[i]:
            for k, other in neighbors.get(link, ()):
                if other not in came[i] and k not in without:
                    came[i][other] = (k, link)
                    ahead.append(other)
                    if other in came[1 - i]:
                        meet = other
                        break
            if meet is not None:
                break
        fronts[i] = ahead
    halves: list[list[tuple[int, str]]] = []
    for known in came:
        link, half = meet, []
        while (before := known[link]) is not None:
            half.append(before)
            link = before[1]
        halves.append(half)
    steps = [MeshStep(k, 1.0 if m.pairs[k].a == start else -1.0) for k, start in reversed(halves[0])]
    return (*steps, *(MeshStep(k, -1.0 if m.pairs[k].a == start else 1.0) for k, start in halves[1]))


def followed(
    m: Any, steps: tuple[MeshStep, ...], p: Array, z: Array, fitting: float, motion: str = "turn"
) -> tuple[Array, Array, list[float], float]:
    """The axis through ``p`` along the unit direction ``z`` on the first link of a way, in the last frame to which pairs that turn about
    it (``motion`` a slide: the one that slides along it) lead, with their senses, and by how much the next one is off it.
    """
    senses: list[float] = []
    for step in steps[: 1 if motion == "slide" else None]:
        pair: Pair = m.pairs[step.pair]
        before, behind = (pair.markers[int((step.sense > 0) == later)] for later in (False, True))
        q, w = line_of(before)
        off = 0.0 if motion == "slide" else float(np.abs(cross(q - p, z)).max())
        lean = float(np.abs(cross(z, w)).max())
        if motion_of(pair) != motion or lean > fitting or off > fitting * max(1.0, float(np.abs(q - p).max())):
            return p, z, senses, off
        senses.append(float(np.sign(z @ w)))
        along, (p, w) = (p - q) @ z, line_of(behind)
        z = senses[-1] * w
        p = p + along * z
    return p, z, senses, 0.0


def line_of(marker: Marker) -> tuple[Array, Array]:
    """The axis of a marker: a point and the unit direction."""
    z = np.array(marker.axis, dtype=float)
    return np.array(marker.point, dtype=float), z / np.linalg.norm(z)


def _axis_behind(m: Any, step: MeshStep) -> tuple[Array, Array]:
    """The axis of a pair on the link behind it on the way."""
    return line_of(m.pairs[step.pair].markers[int(step.sense > 0)])


_TEETH = TWO_WHOLE("numbers of teeth of both gears")


def tooth_angle(meaning: str, minimum: float | None = None) -> FieldFormat:
    """A field that holds an angle of teeth."""
    return NUMBER(meaning, PURE, degrees=True, minimum=minimum, below=1.2)


PRESSURE = tooth_angle("of the flanks, in the normal section", minimum=0.0)
FULL = float(np.deg2rad(20.0))
"""The usual pressure angle."""


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
    pressure_angle: Annotated[float, PRESSURE] = FULL
    helix_angle: Annotated[float, tooth_angle("of gear a, right-hand positive")] = 0.0
    internal: Annotated[bool, FLAG("whether the gear with more teeth has them inside")] = False

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and self.internal and self.teeth[0] == self.teeth[1]:
            found.append(wrong(self.teeth, "teeth", "different numbers of an internal pair"))
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
        return float(2 * np.linalg.norm(self.axes_in(m).across) * np.cos(self.helix_angle) / self._sum)

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
    pressure_angle: Annotated[float, PRESSURE] = FULL
    spiral_angle: Annotated[float, tooth_angle("of gear a, right-hand positive")] = 0.0

    @property
    def ratio(self) -> float:
        """``N_b / N_a``."""
        return self.teeth[1] / self.teeth[0]

    def misfits(self, axes: Axes, fitting: float) -> list[str]:
        """See ``Contact``."""
        if np.abs(cross(axes.za, axes.zb)).max() < 1e-3:
            return ["the axes are parallel; bevel gears are on axes that intersect"]
        apex, _, apart = axes.perpendicular
        off = float(np.abs(apart).max())
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

    def _cone(self, axes: Axes) -> tuple[Array, Array, Array, Array]:
        """The apex, the axes towards both gears, and half the angle of the pitch cone of a."""
        apex = axes.perpendicular[0]
        ea, eb = (z * np.sign(((p - apex) * z).sum(axis=0)) for p, z in ((axes.pa, axes.za), (axes.pb, axes.zb)))
        cosine = (ea * eb).sum(axis=0)
        return apex, ea, eb, np.arctan2(np.sqrt(1.0 - cosine**2), self.teeth[1] / self.teeth[0] + cosine)

    def cones(self, axes: Axes) -> tuple[float, float]:
        """Half the angles of both pitch cones."""
        _, ea, eb, angle = self._cone(axes)
        return float(angle[0]), float(np.arccos(np.clip((ea * eb).sum(axis=0), -1.0, 1.0))[0] - angle[0])

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        apex, ea, eb, angle = self._cone(axes)
        side = unit(eb - ea * (ea * eb).sum(axis=0))
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
    pressure_angle: Annotated[float, PRESSURE] = FULL
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
        distance = float(np.abs(axes.perpendicular[2]).max())
        if distance <= self.radius:
            return [f"the axes are {distance:.7g} apart; expected more than the radius of the worm, {self.radius:g}"]
        return []

    def lines(self, axes: Axes) -> Lines:
        """See ``Contact``."""
        (foot, w, off), r = axes.perpendicular, self.radius / axes.unit
        away, distance = w * np.sign(off), np.abs(off)
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
    rubs: ClassVar[tuple[str, ...]] = ("preload", "efficiency")
    slides: ClassVar[bool] = True
    radius: Annotated[float, POSITIVE("pitch radius of the pinion", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL

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
    rubs: ClassVar[tuple[str, ...]] = OF_BELTS
    radii: Annotated[Any, TWO_POSITIVE("of both pulleys", LENGTH)]
    crossed: Annotated[bool, FLAG("whether the strands cross")] = False

    @property
    def ratio(self) -> float:
        """``r_b / r_a``."""
        return self.radii[1] / self.radii[0]

    def wrap(self, axes: Axes) -> float:
        """The smaller angle of wrap."""
        a, b = self.radii
        reach = -(a + b) if self.crossed else abs(a - b)
        return float(np.pi - 2 * np.arcsin(reach / np.linalg.norm(axes.across)))

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
