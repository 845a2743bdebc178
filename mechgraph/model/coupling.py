"""Couplings: linear relations between freedoms, as gears, belts and screws impose them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import COEFFICIENTS, NUMBER, TEXT
from mechgraph.model.nameable import Nameable
from mechgraph.model.numeric import number_fault, plain
from mechgraph.quantities import is_numeric, shown, without_units, wrong
from mechgraph.units import LENGTH, PURE

Terms = tuple[tuple[str, float], ...]


class BaseCoupling(Described, ABC):
    """What all couplings share: ``terms``, freedoms with their coefficients, and a ``constant`` (None: the value at the start)."""

    kind: ClassVar[str]
    """Name of the kind in files."""
    name: str
    terms: Terms
    constant: float | None
    steps: tuple[Any, ...] = ()
    """Pairs on the way along which the force of the coupling is closed, where it acts along a line of its own."""

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
    def converted(self, length: float, turns: Sequence[bool]) -> Self:
        """The same relation with lengths times ``length``; ``turns`` says which freedoms are angles."""


@dataclass(frozen=True, init=False)
class Coupling(BaseCoupling):
    """A linear relation between single freedoms, ``sum_i c_i q_i = constant``; its multiplier is an unknown effort.

    The multiplier m acts with the effort ``c_i m`` in freedom i, so that its power is ``m sum_i c_i q'_i = 0``. The sum is a length
    where all freedoms are slides (then m is a force, the coefficients are pure numbers) and an angle in all other cases (then m is
    a moment, the coefficient of a turn is a pure number and that of a slide one over a length). ``to_units`` follows that rule: a
    constant that is a length is multiplied by the factor of lengths, the coefficient of a slide beside turns is divided by it.

    Parameters
    ----------
    terms : freedom -> coefficient, ``{"A": 2.0, "B.Tz": -3.0}``; coefficients finite and not zero.
    name : differs from the names of all pairs and other couplings; left out, the mechanism names it ``g1``, ``g2``, ...
    constant : the value of the sum; left out, the sum keeps the value that it has at ``start``.
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

    def converted(self, length: float, turns: Sequence[bool]) -> Self:
        """The same relation with lengths times ``length``; ``turns`` says which freedoms are angles (the rule stands above)."""
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
