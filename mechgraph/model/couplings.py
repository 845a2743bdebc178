"""Couplings: linear relations between freedoms; and the ways between links along which gears and belts close their forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from mechgraph.fields import (
    COEFFICIENTS,
    NUMBER,
    TEXT,
    Described,
    FieldFormat,
    number_fault,
    plain,
    sound_tol,
)
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES
from mechgraph.memo import dataclass
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

    rims: tuple[tuple[str, float, float], ...] = ()
    """Freedom, teeth and helix angle of gears named by a freedom each, of which the axes say the module."""
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

    @classmethod
    def doubts(cls, m: Any) -> list[str]:
        """What may be meant otherwise of all that a mechanism holds of this kind."""
        return []

    def renumbered(self, coefficients: Sequence[float], constant: float) -> Self:
        """The same with other coefficients, and another constant where it has one."""
        return self


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

    def placed(self, m: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.replace(terms=[(m.full_name(freedom), value) for freedom, value in self.terms])

    def renumbered(self, coefficients: Sequence[float], constant: float) -> Self:
        """See ``BaseCoupling``."""
        terms = tuple(zip(self.freedoms, coefficients, strict=True))
        return self.replace(terms=terms, constant=None if self.constant is None else constant)

    def faults(self, m: Any) -> list[str]:
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

    def in_own_units(self, units: Mapping[str, str], turns: Callable[[Any], bool]) -> Self:
        """The same with quantities of pint as plain numbers in these units; ``turns`` says which freedoms are angles."""
        if not _is_terms(self.terms):
            return self
        slides = not any(map(turns, self.freedoms))
        terms = [
            (name, plain(without_units(c, PURE if slides or turns(name) else (-1, 0, 0), units)))
            for name, c in self.terms
        ]
        return self.replace(terms=terms, constant=without_units(self.constant, LENGTH if slides else PURE, units))

    def converted(self, base: tuple[float, float, float], turns: Callable[[Any], bool]) -> Self:
        """The same relation in other units; ``turns`` says which freedoms are angles (the rule stands above)."""
        length = base[0]
        if not any(map(turns, self.freedoms)):
            return self.replace(constant=None if self.constant is None else self.constant * length)
        return self.replace(terms=[(name, c if turns(name) else c / length) for name, c in self.terms])


def _read_terms(given: Any) -> Any:
    """Pairs (freedom, coefficient); what is no mapping and no sequence of pairs is kept unchanged."""
    items = given.items() if isinstance(given, Mapping) else given
    try:
        return tuple((name, plain(c)) for name, c in items)
    except (TypeError, ValueError):
        return given


def _is_terms(terms: Any) -> bool:
    return isinstance(terms, tuple) and all(isinstance(term, tuple) and len(term) == 2 for term in terms)


class MeshStep(NamedTuple):
    """A pair on the way from gear a to gear b: its place, and whether it is passed from its link a to its link b (1) or back (-1)."""

    pair: int
    sense: float


OF_TEETH = ("mu", "static", "stribeck", "preload", "efficiency")
OF_BELTS = ("mu", "wrap", "preload")


def fitting_of(m: Any) -> float:
    """Part of a length, or angle, by which gears may miss their place in a mechanism."""
    return max(SHAPES.met, 2.0 * sound_tol(m.tol))


def motion_of(pair: Any) -> str:
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
        pair = m.pairs[step.pair]
        before, behind = (pair.markers[int((step.sense > 0) == later)] for later in (False, True))
        q, w = before.line
        off = 0.0 if motion == "slide" else _largest_of_cross(q - p, z)
        lean = _largest_of_cross(z, w)
        if motion_of(pair) != motion or lean > fitting or off > fitting * max(1.0, float(np.abs(q - p).max())):
            return p, z, senses, off
        senses.append(float(np.sign(z @ w)))
        along, (p, w) = (p - q) @ z, behind.line
        z = senses[-1] * w
        p = p + along * z
    return p, z, senses, 0.0


def _largest_of_cross(u: Array, v: Array) -> float:
    """The largest part of ``u x v (3,)``, by numbers: arrays of three take longer."""
    (a, b, c), (d, e, f) = u.tolist(), v.tolist()
    return max(abs(b * f - c * e), abs(c * d - a * f), abs(a * e - b * d))


def tooth_angle(meaning: str, minimum: float | None = None) -> FieldFormat:
    """A field that holds an angle of teeth."""
    return NUMBER(meaning, PURE, degrees=True, minimum=minimum, below=1.2)


PRESSURE = tooth_angle("of the flanks, in the normal section", minimum=0.0)
FULL = float(np.deg2rad(20.0))
"""The usual pressure angle."""
