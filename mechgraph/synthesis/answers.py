"""Mechanisms that do what is asked, as they are returned."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from mechgraph import methods
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, counted
from mechgraph.files import optional, plain
from mechgraph.kinematics.prescribed import coordinate, obtained
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import keeps
from mechgraph.modes.assemblies import weakest
from mechgraph.modes.certificate import Certificate
from mechgraph.quantities import items_of, place_among, real_array, unit_of, wrong
from mechgraph.result.values import bracket
from mechgraph.synthesis.fitness import Fitness
from mechgraph.synthesis.labelling import Symmetry
from mechgraph.synthesis.tasks import Asked

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class ComplexSyntheses:
    """Solutions that are not real: ``values (k, u)`` of the unknowns."""

    values: Array

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Degenerate:
    """Solutions of the equations that are no mechanisms of their own, and that ``total`` does not count."""

    kind: Annotated[str, "double, continuum, open, coincident or reversed"]
    count: int
    text: str


class PerMechanism(Shown, Sequence[Any]):
    """What is found of mechanisms when it is first asked for: fitness, certificates."""

    _every_method_is_a_door = False

    def __init__(self, makers: Sequence[Callable[[], Any]]) -> None:
        self._makers = tuple(makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __getitem__(self, i: int | slice) -> Any:
        return PerMechanism(self._makers[i]) if isinstance(i, slice) else _one_of(self._makers, i)()

    def document(self) -> Document:
        """A table, a row per mechanism, of verdicts and numbers, without what is as usual of all."""
        every = tuple(self)
        kind = next((type(one) for one in every if one is not None), None)
        named = [f for f in fields(kind) if str(f.type) not in ("int", "str")] if kind else []
        named = [f for f in named if any(getattr(one, f.name, None) != f.default for one in every)]
        turns = ["radians" in str(f.type) for f in named]
        header = [
            f.name.replace("_", " ") + " defect" * ("defect" in str(f.type)) + " [deg]" * turn
            for f, turn in zip(named, turns, strict=True)
        ]
        rows = [
            [_cell(getattr(one, f.name, None), turn) for f, turn in zip(named, turns, strict=True)] for one in every
        ]
        title = f"{kind.__name__ if kind else 'Nothing'} of {counted(len(self), 'mechanism')}"
        return Document(title, (Table(("", *header), tuple((str(i), *row) for i, row in enumerate(rows))),))

    @classmethod
    def at_once(cls, find: Callable[[], Sequence[Any]], count: int) -> PerMechanism:
        """Those that are found together."""
        found = cache(find)
        return cls([partial(lambda k: found()[k], i) for i in range(count)])

    @classmethod
    def known(cls, found: Sequence[Any]) -> PerMechanism:
        """Those that are known."""
        return cls([partial(found.__getitem__, i) for i in range(len(found))])

    def __reduce__(self) -> tuple[Any, ...]:
        return PerMechanism.known, (tuple(self),)  # before they go elsewhere


@dataclass(frozen=True)
class RejectedAnswer:
    """A mechanism that does what is asked and fell for a condition."""

    mechanism: Mechanism
    values: tuple[float, ...]
    reasons: Annotated[tuple[str, ...], "defects, and conditions that it does not keep"]


@dataclass(frozen=True)
class SynthesesData:
    """All mechanisms that do what is asked, and how sure it is that these are all."""

    mechanism: str
    unknown: tuple[str, ...]
    values: Annotated[tuple[tuple[float, ...], ...], "of every mechanism"]
    completeness: Annotated[str, "proved, tested or searched"]
    evidence: tuple[str, ...]
    total: Annotated[int | None, "over the complex numbers, for general data; none of fits"]
    classes: Annotated[int | None, "the same, those as one that symmetries make of each other"]
    complex: Annotated[int, "how many are not real"]
    infinite: Annotated[int, "how many went to infinity here"]
    degenerate: tuple[Degenerate, ...]
    residual: tuple[float, ...]
    fitness: tuple[Fitness, ...]
    rejected: Annotated[tuple[tuple[str, ...], ...], "of every mechanism that was left out, why"]
    mechanism_of: Annotated[tuple[str, ...], "of chains: of every mechanism the one that it comes from"] = ()
    certificates: Annotated[tuple[Certificate | None, ...], "of every mechanism, where there is one; none of fits"] = ()


@dataclass(frozen=True, repr=False)
class Syntheses(Shown, Sequence[Mechanism]):
    """All real mechanisms of a topology that do what is asked, each a Mechanism with ``start`` at row 0. Returned by ``synthesize``.

    Attributes
    ----------
    mechanism : Mechanism
        As declared.
    unknown : tuple of str
        The numbers that were sought.
    values : (n, u) array
        Their values.
    poses : (n, rows, N, 4, 4) array
        Poses of all links at every row.
    coordinates : (n, rows, F) array
        All freedoms [rad, length].
    residual : (n,) array
        Worst error of closure or task at any row (radians, lengths over the size of the task).
    complex : object
        ``values (k, u)`` of the solutions that are not real.
    total : int or None
        Finite nondegenerate solutions over the complex numbers for general data of this task.
    classes : int
        The same, those as one that symmetries make of each other.
    symmetries : tuple
        Exchanges of pairs that make a solution of a solution: ``name``, ``order``, ``text``.
    copies : tuple
        For each mechanism the numbers of those that symmetries make of it, itself too.
    degenerate : tuple
        Solutions that are no mechanisms of their own: ``kind`` (double, continuum, open, coincident, reversed), ``count``, ``text``.
    infinite : int
        How many went to infinity here.
    completeness : {"proved", "tested", "searched"}
        As many as are published for such tasks, and all tracks arrived; a trace test passed, and none was lost; or neither.
    evidence : tuple of str
        The reasons, with numbers.
    kinds : tuple of str
        Of each ``"regular"``, or ``"fit"``.
    condition : (n,) array
        Condition numbers of the unknowns in the conditions.
    certificates : sequence
        Of each what is proved of it, found when first asked for: a mechanism that does what is asked exactly lies within ``error``, and no
        other within ``radius`` (radians, lengths over L), see ``Certificate``. None of fits, and where rates or factors are asked.
    fitness : sequence
        Of each, found when first asked for: defects ``branch``, ``circuit``, ``order``; ``full_turn`` of the driver; ``transmission`` at
        the positions and ``transmission_between`` them [rad]; ``size`` [length], ``ratio`` [1]; ``error`` of fits [length, rad where angles
        alone are asked]; ``good``, without a defect, whatever the error. ``help(s.fitness[0])`` tells more.
    rejected : tuple
        Mechanisms that ``require``, ``conditions`` and ``bounds`` left out: ``mechanism``, ``values``, ``reasons``.
    driver : str or None
        The freedom that leads a mechanism through the rows: the input, the one with timing, or the only drive.
    asked : object
        ``values (rows,)`` by name: freedoms, coordinates of points and links as they are asked [rad, length]; NaN where nothing is.
    mechanism_of : tuple of Mechanism
        For each the mechanism that it comes from: of chains one of many, with numbers of their own; what one does not have is NaN.

    Examples
    --------
    >>> import mechgraph as mg
    >>> links = [mg.Link("frame"), mg.Link("crank"), mg.Link("body")]
    >>> A = mg.Pair("A", "R", "frame", "crank", point=(0, 0))
    >>> B = mg.Pair("B", "R", "crank", "body", point=(1, 0))
    >>> m = mg.Mechanism("crank", links, [A, B], planar=True)
    >>> poses = mg.poses("body", [[0, 0, 0], [1, 0.5, 0.4], [2, 0.4, 1.1]])
    >>> s = mg.synthesize(m, poses, ["B.point"])
    >>> len(s), s.unknown, bool(s.residual[0] < 1e-12)
    (1, ('B.point.x', 'B.point.y'), True)
    """

    mechanism: Mechanism
    mechanisms: tuple[Mechanism, ...]
    unknown: tuple[str, ...]
    values: Array
    poses: Array
    coordinates: Array
    residual: Array
    complex: ComplexSyntheses
    total: int | None
    degenerate: tuple[Degenerate, ...]
    infinite: int
    completeness: str
    evidence: tuple[str, ...]
    condition: Array
    fitness: Sequence[Fitness]
    classes: int | None = None
    symmetries: tuple[Symmetry, ...] = ()
    copies: tuple[tuple[int, ...], ...] = ()
    rejected: tuple[RejectedAnswer, ...] = ()
    sources: tuple[Mechanism, ...] = ()
    driver: str | None = None
    certificates: Sequence[Certificate | None] = ()
    asked: Asked | None = None

    @property
    def kinds(self) -> tuple[str, ...]:
        """Of each ``"regular"``, or ``"fit"``."""
        return ("fit" if self.total is None else "regular",) * len(self)

    @property
    def mechanism_of(self) -> tuple[Mechanism, ...]:
        """The mechanism from which each one comes."""
        return self.sources or (self.mechanism,) * len(self)

    @property
    def _sorted(self) -> Syntheses:
        """Good ones first, then by worst transmission, then by size."""
        return self.taken(sorted(range(len(self)), key=lambda k: _rank(self.fitness[k], k)))

    def __len__(self) -> int:
        return len(self.mechanisms)

    def __getitem__(self, i: int | slice) -> Any:
        return _one_of(self.mechanisms, i)

    def __iter__(self) -> Iterator[Mechanism]:
        return iter(self.mechanisms)

    def field(self, name: str) -> Array:
        """Values ``(n,)`` of one unknown number.

        Raises
        ------
        DeclarationError
            where it was none.
        """
        if name not in self.unknown:
            raise DeclarationError("syntheses", [f"field {name!r}: unknown were {', '.join(self.unknown)}"])
        return np.asarray(self.values[:, self.unknown.index(name)])

    def taken(self, which: Sequence[int]) -> Syntheses:
        """Some of them, in that order; what is said of the whole stays.

        Raises
        ------
        DeclarationError
            where there is no such one.
        """
        faults = list[str]()
        k = [place_among(i, len(self), "which", "syntheses") for i in items_of(which, "which", faults)]
        if faults:
            raise DeclarationError("syntheses", faults)
        place = {old: new for new, old in enumerate(k)}
        return replace(
            self,
            copies=tuple(tuple(sorted(place[j] for j in self.copies[i] if j in place)) for i in k if self.copies),
            mechanisms=tuple(self.mechanisms[i] for i in k),
            sources=tuple(self.sources[i] for i in k if self.sources),
            fitness=PerMechanism([partial(self.fitness.__getitem__, i) for i in k]),
            certificates=PerMechanism([partial(self.certificates.__getitem__, i) for i in k if self.certificates]),
            **{name: getattr(self, name)[k] for name in ("values", "poses", "coordinates", "residual", "condition")},
        )

    @property
    def distinct(self) -> Syntheses:
        """The first of every set of copies."""
        return self.taken([i for i in range(len(self)) if not self.copies or self.copies[i][0] == i])

    @property
    def good(self) -> Syntheses:
        """Those without a defect that is known; all without a driver, see ``Fitness``."""
        return self.taken([i for i, fit in enumerate(self.fitness) if fit.good])

    def ranked(self, by: str | Callable[[Mechanism], float] = "transmission") -> Syntheses:
        """Sort the mechanisms, the best first.

        Parameters
        ----------
        by : str or callable
            ``"transmission"`` (the worst one, falling), ``"size"``, ``"ratio"``, ``"error"``, or a function of a Mechanism, rising.

        Returns
        -------
        Syntheses

        Raises
        ------
        DeclarationError
            No such quantity; a function that returns no number.
        """
        names = ("transmission", "size", "ratio", "error")
        if not callable(by) and by not in names:
            raise DeclarationError("syntheses", [wrong(by, "by", f"{', '.join(map(repr, names))}, or a function")])
        values = [by(m) for m in self] if callable(by) else [getattr(fit, by) for fit in self.fitness]
        if (numbers := real_array(values)) is None or numbers.shape != (len(self),):
            raise DeclarationError("syntheses", [wrong(values, "by", "a function that returns a number")])
        sign = -1.0 if by == "transmission" else 1.0
        return self.taken(
            sorted(range(len(self)), key=lambda i: (np.isnan(numbers[i]), sign * np.nan_to_num(numbers[i]), i))
        )

    def _kept(
        self, require: Sequence[Any], bounds: Mapping[str, Any], limits: Sequence[Any], driver: str | None
    ) -> Syntheses:
        """Those without the defects named, with unknowns within bounds, that keep limits; why others were left out is in ``rejected``."""
        if not (require or bounds or limits):
            return self
        keep, out = [], list(self.rejected)
        for i, m in enumerate(self):
            lacks = self.fitness[i].lacks(require) if require else ()
            why = [_lack(name, getattr(self.fitness[i], name)) for name in lacks]
            for name, (least, most) in bounds.items():
                value = self.field(name)[i]
                why += [] if keeps(value, least, most) else [f"{name} = {value:.6g} is out of its bounds"]
            for name, measure, least, most in limits:
                values = measure(m, self.coordinates[i], driver)
                if np.isnan(values).any():
                    why.append(f"{name} is not determined at all positions")
                elif not keeps(values, least, most):
                    # transmission angles in degrees, as in tables
                    size, unit = (1.0, "") if measure.output is None else (np.rad2deg(1.0), " deg")
                    ends = dict.fromkeys(f"{size * end:.6g}" for end in (np.min(values), np.max(values)))
                    wanted = [
                        f"at {word} {size * end:.6g}"
                        for word, end in (("least", least), ("most", most))
                        if end is not None
                    ]
                    why.append(f"{name} = {' to '.join(ends)}{unit}; asked: {', '.join(wanted)}{unit}")
            if why:
                out.append(RejectedAnswer(m, tuple(self.values[i].tolist()), tuple(why)))
            else:
                keep.append(i)
        return replace(self.taken(keep), rejected=tuple(out))

    def to_pandas(self) -> pandas.DataFrame:
        """Return a DataFrame, a row per mechanism: unknowns, fitness, residual.

        In columns ``branch``, ``circuit`` and ``order`` True is a defect, see ``Fitness``; ``good`` is True where there is none.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingExtraError
            Without pandas.
        """
        columns = dict(zip(self.unknown, self.values.T, strict=True))
        columns |= {f.name: [getattr(fit, f.name) for fit in self.fitness] for f in fields(Fitness)}
        columns |= {"good": [fit.good for fit in self.fitness], "residual": self.residual}
        return optional("pandas", "pandas").DataFrame(columns)

    def plot(self) -> Any:
        """Draw all mechanisms side by side at their first position.

        Returns
        -------
        Figure
            Of matplotlib.

        Raises
        ------
        MissingExtraError
            Without matplotlib.
        """
        drawn = [(m, fit.words) for m, fit in zip(self, self.fitness, strict=True)]
        return methods.call("draw_side_by_side", self.mechanism, drawn, "there is no mechanism to draw")

    def document(self) -> Document:
        """A table of the mechanisms, and how sure it is that these are all."""
        fits: list[tuple[str, ...]] = [
            (
                ", ".join(fit.defects) or ("-" if fit.branch is None else "none"),
                _cell(fit.transmission, True),
                _cell(fit.size),
            )
            for fit in self.fitness
        ]
        judged: tuple[str, ...] = (
            "defects",
            "transmission [deg]",
            "size" + bracket(unit_of(self.mechanism.units, (1, 0, 0))),
        )
        if self.total is None:
            judged, fits = (*judged, "error"), [(*a, f"{b.error:.3g}") for a, b in zip(fits, self.fitness, strict=True)]
        parts: list[tuple[tuple[str, ...], Sequence[tuple[str, ...]]]]
        if self.sources:
            own: list[tuple[str, ...]] = [(one.name,) for one in self.sources]
            parts = [(("of", *judged), [(*a, *b) for a, b in zip(own, fits, strict=True)])]
        else:
            own = [tuple(f"{v:.6g}" for v in values) for values in self.values]
            # columns for which a terminal is wide enough
            parts = [(self.unknown[i : i + 5], [v[i : i + 5] for v in own]) for i in range(0, len(self.unknown), 5)]
            parts += [(judged, fits)]
            if len(self.unknown) + len(judged) < 8:
                parts = [((*self.unknown, *judged), [(*a, *b) for a, b in zip(own, fits, strict=True)])]
        tables = [Table(("k", *header), tuple((str(i), *row) for i, row in enumerate(rows))) for header, rows in parts]
        told = " ".join([f"Completeness: {self.completeness}.", *self.evidence, *(one.text for one in self.degenerate)])
        if any(fit.branch is None for fit in self.fitness):
            told += " No single driver determines the positions: nothing is known of defects and transmission."
        title = f"{'chains' if self.sources else self.mechanism.name}: {counted(len(self), 'mechanism')}"
        if self.total is not None:
            title += f"; such tasks have {counted(self.total, 'solution')} over the complex numbers"
        left_out = [f"{self._named(one)}: {'; '.join(one.reasons)}" for one in self.rejected]
        blocks: list[Block] = [*tables, Paragraph(told)]
        return Document(title, blocks + ([Heading("Left out", 2), Bullets(left_out)] if left_out else []))

    def _named(self, one: RejectedAnswer) -> str:
        """Which one it is: what is sought and its values, of chains the mechanism."""
        if self.sources or one.mechanism.name != self.mechanism.name:
            return one.mechanism.name
        return ", ".join(f"{name} = {v:.6g}" for name, v in zip(self.unknown, one.values, strict=False))

    @property
    def data(self) -> SynthesesData:
        """Everything but arrays of poses as a record."""
        return SynthesesData(
            self.mechanism.name,
            self.unknown,
            tuple(map(tuple, self.values.tolist())),
            self.completeness,
            self.evidence,
            self.total,
            self.classes,
            len(self.complex),
            self.infinite,
            self.degenerate,
            tuple(self.residual.tolist()),
            tuple(self.fitness),
            tuple(one.reasons for one in self.rejected),
            tuple(m.name for m in self.sources),
            tuple(self.certificates),
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


@dataclass(frozen=True)
class SynthesesOverData:
    """All mechanisms that do what is asked, for every value of what is swept."""

    sweep: Annotated[Mapping[str, tuple[float, ...]], "the values given, by name"]
    positions: Annotated[tuple[SynthesesData, ...], "for every value"]


@dataclass(frozen=True, repr=False)
class SynthesesOver(Shown, Sequence[Syntheses]):
    """Mechanisms for several values of what is swept, ``s[k][i]``. Returned by ``synthesize`` with ``sweep``.

    Attributes
    ----------
    sweep : mapping
        The values ``(n,)`` given, by name.
    fitness, rejected : tuple
        Those of ``s[k]`` for every value.

    Examples
    --------
    >>> import mechgraph as mg
    >>> links = [mg.Link("frame"), mg.Link("crank"), mg.Link("body")]
    >>> A = mg.Pair("A", "R", "frame", "crank", point=(0, 0))
    >>> B = mg.Pair("B", "R", "crank", "body", point=(1, 0))
    >>> m = mg.Mechanism("crank", links, [A, B], planar=True)
    >>> poses = mg.poses("body", [[0, 0, 0], [1, 0.5, 0.4], [2, 0.4, 1.1]])
    >>> s = mg.synthesize(m, poses, ["B.point"], sweep={"A.point.x": [0.0, 0.1]})
    >>> [len(one) for one in s], s.completeness
    ([1, 1], 'tested')
    """

    sweep: Mapping[str, Array]
    positions: tuple[Syntheses, ...]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, k: int | slice) -> Any:
        return _one_of(self.positions, k, "value")

    @property
    def completeness(self) -> str:
        """The weakest of all."""
        return weakest(s.completeness for s in self.positions)

    @property
    def fitness(self) -> tuple[Sequence[Fitness], ...]:
        """Of the mechanisms for every value."""
        return tuple(s.fitness for s in self)

    @property
    def rejected(self) -> tuple[tuple[RejectedAnswer, ...], ...]:
        """Mechanisms that were left out, for every value."""
        return tuple(s.rejected for s in self)

    @property
    def distinct(self) -> SynthesesOver:
        """For every value the first of every set of copies."""
        return replace(self, positions=tuple(s.distinct for s in self))

    @property
    def good(self) -> SynthesesOver:
        """For every value those without a defect that is known."""
        return replace(self, positions=tuple(s.good for s in self))

    def ranked(self, by: str | Callable[[Mechanism], float] = "transmission") -> SynthesesOver:
        """Sort the mechanisms for every value, the best first; see ``Syntheses.ranked``."""
        return replace(self, positions=tuple(s.ranked(by) for s in self))

    def to_pandas(self) -> pandas.DataFrame:
        """Return a DataFrame, a row per mechanism ``s[k][i]`` with index ``(k, i)``: what is swept and sought, fitness, residual.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingExtraError
            Without pandas.
        """
        found = {k: s.to_pandas() for k, s in enumerate(self) if s} or {0: self[0].to_pandas()}
        return optional("pandas", "pandas").concat(found, names=["k", "i"])

    def plot(self) -> Any:
        """Draw where the pairs that are sought or swept stand: center points at the frame, circle points (at row 0) of moving pairs.

        Returns
        -------
        Axes
            Of matplotlib.

        Raises
        ------
        MissingExtraError
            Without matplotlib.
        """
        unknown = {name for found in self for name in found.unknown}
        return methods.call("draw_points", [m for found in self for m in found], unknown)

    def document(self) -> Document:
        """How many mechanisms there are for every value."""
        rows = tuple(
            (
                *(f"{v[k]:.6g}" for v in self.sweep.values()),
                str(len(s)),
                str(len(s.rejected)),
                str(len(s.complex)),
                s.completeness,
            )
            for k, s in enumerate(self)
        )
        header = ("k", *self.sweep, "mechanisms", "left out", "not real", "completeness")
        title = (
            f"{self[0].mechanism.name}: {counted(sum(map(len, self)), 'mechanism')} for {counted(len(self), 'value')}"
        )
        return Document(title, (Table(header, tuple((str(k), *row) for k, row in enumerate(rows))),))

    @property
    def data(self) -> SynthesesOverData:
        """Everything but arrays of poses as a record."""
        return SynthesesOverData(
            {name: tuple(values.tolist()) for name, values in self.sweep.items()}, tuple(s.data for s in self)
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


def joined_answers(found: Sequence[Syntheses], told: Sequence[str]) -> Syntheses:
    """Answers of several mechanisms in one order, with what is told of the whole."""
    unknown = tuple(dict.fromkeys(name for s in found for name in s.unknown))
    first = np.cumsum([0, *map(len, found)]).tolist()

    def padded(arrays: Sequence[Array]) -> Array:
        shape = np.max([a.shape[1:] for a in arrays], axis=0)
        ends = [[(0, 0), *((0, int(n)) for n in shape - a.shape[1:])] for a in arrays]
        return np.concatenate([np.pad(a, end, constant_values=np.nan) for a, end in zip(arrays, ends, strict=True)])

    def by_name(s: Syntheses, values: Array) -> Array:
        out = np.full((len(values), len(unknown)), np.nan, dtype=values.dtype)
        out[:, [unknown.index(name) for name in s.unknown[: values.shape[1]]]] = values
        return out

    def whole(name: str) -> int | None:
        counts = [getattr(s, name) for s in found]
        return None if None in counts else sum(counts)

    out = Syntheses(
        found[0].mechanism,
        tuple(m for s in found for m in s),
        unknown,
        np.concatenate([by_name(s, s.values) for s in found]),
        padded([s.poses for s in found]),
        padded([s.coordinates for s in found]),
        np.concatenate([s.residual for s in found]),
        ComplexSyntheses(np.concatenate([by_name(s, s.complex.values) for s in found])),
        whole("total"),
        tuple(replace(one, text=f"{s.mechanism.name}: {one.text}") for s in found for one in s.degenerate),
        sum(s.infinite for s in found),
        weakest(s.completeness for s in found),
        (*told, *(f"{s.mechanism.name}: {text}" for s in found for text in s.evidence)),
        np.concatenate([s.condition for s in found]),
        PerMechanism([partial(s.fitness.__getitem__, k) for s in found for k in range(len(s))]),
        whole("classes"),
        tuple(one for s in found for one in s.symmetries),
        tuple(tuple(n + k for k in mine) for n, s in zip(first, found, strict=False) for mine in s.copies),
        tuple(one for s in found for one in s.rejected),
        tuple(s.mechanism for s in found for _ in s),
        found[0].driver,
        PerMechanism([partial(s.certificates.__getitem__, k) for s in found for k in range(len(s.certificates))]),
        found[0].asked,
    )
    return out._sorted


def compared(found: Syntheses, k: int) -> tuple[Table, ...]:
    """What is asked at every row beside what a mechanism does, as wide as a page; angles in degrees."""
    m, asked, columns = found[k], found.asked or Asked({}), list[tuple[str, Sequence[str]]]()
    for name, values in asked.values.items():
        factor = found.field(f"{name}.scale")[k] if name in asked.scaled else 1.0
        turns, want = bool(coordinate(m, name)), factor * values
        off = obtained(m, name, found.poses[k], found.coordinates[k]) - want
        off -= 2 * np.pi * np.round(off / (2 * np.pi)) if turns else 0.0
        unit, size = ("deg", np.rad2deg(1.0)) if turns else (unit_of(m.units, (1, 0, 0)), 1.0)
        columns += [
            (title, ["-" if np.isnan(v) else f"{size * v + 0.0:.{digits}g}" for v in column])
            for title, column, digits in (
                (f"{name} asked" + f" [{unit}]" * bool(unit), want, 6),
                ("obtained", want + off, 6),
                ("error", off, 2),
            )
        ]
    rows = ("position", [str(i) for i in range(len(found.coordinates[k]))])
    each = [(rows, *columns[i : i + 6]) for i in range(0, len(columns), 6)]
    return tuple(
        Table([title for title, _ in some], list(zip(*(c for _, c in some), strict=True)), "r" * len(some))
        for some in each
    )


def _one_of(items: Sequence[Any], i: int | slice, what: str = "mechanism") -> Any:
    try:
        return items[i]
    except IndexError:
        raise IndexError(f"{i}: there are {counted(len(items), what)}, counted from 0") from None


def _lack(name: str, known: bool | None) -> str:
    """Why a mechanism is left out that lacks what is required; where it is not ``known`` that is said."""
    if known is None:
        return f"{name.replace('_', ' ')} not determined"
    return "no full turn" if name == "full_turn" else f"{name} defect"


def _cell(value: Any, turns: bool = False) -> str:
    """A number, an angle in degrees, yes or no; a dash where nothing is known."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or not np.isfinite(value):
        return "-"
    return f"{np.rad2deg(value) if turns else value:.4g}"


def _rank(fit: Fitness, k: int) -> tuple[Any, ...]:
    """Good ones first, then by worst transmission, then by size."""
    transmission = fit.transmission if np.isfinite(fit.transmission) else -1.0
    return (not fit.good, -round(transmission, 9), round(fit.size, 9), k)
