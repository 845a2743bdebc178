"""All assemblies as they are returned, and their records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mechgraph import methods
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import counted
from mechgraph.files import plain
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.certificate import Certificate
from mechgraph.modes.family import Array


@dataclass(frozen=True)
class ModeData:
    """One real assembly; ``condition`` and ``certificate`` of regular ones."""

    start: Annotated[Mapping[str, float], "the coordinates of all freedoms"]
    kind: Annotated[str, "regular or double (assemblies meet)"]
    condition: float | None
    certificate: Certificate | None


@dataclass(frozen=True)
class ContinuumData:
    """Assemblies that can move with the drivers at rest."""

    start: Annotated[Mapping[str, float], "the coordinates of all freedoms at the one nearest to the start"]
    dimension: int
    moves: Annotated[tuple[str, ...], "freedoms that change"]


@dataclass(frozen=True)
class AssembliesData:
    """All assemblies at one position, and how sure it is that these are all."""

    mechanism: str
    at: Annotated[Mapping[str, float], "the values given"]
    completeness: Annotated[str, "proved, tested or searched"]
    evidence: Annotated[tuple[str, ...], "what that rests on"]
    total: Annotated[int | None, "assemblies of a random complex mechanism of the class, where one is known"]
    infinite: Annotated[int, "how many of these lie at infinity here"]
    on_continua: Annotated[int, "how many of these lie on continua here"]
    complex: Annotated[int, "how many are not real"]
    continua: tuple[ContinuumData, ...]
    modes: tuple[ModeData, ...]


@dataclass(frozen=True)
class BranchData:
    """A branch: its interval of the driver, and the range of every freedom."""

    interval: tuple[float, float]
    full_turn: Annotated[bool | None, "null where an end could not be told"]
    turns: Annotated[int, "turns of the driver that bring it back"]
    circuit: int
    ranges: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Fold:
    """Where two branches meet and the driver has to turn back."""

    value: float
    sense: Annotated[int, "1 at an upper limit, -1 at a lower one"]
    branches: tuple[int, int]
    fastest: Annotated[str, "the freedom that moves most there, while the driver stands still"]


@dataclass(frozen=True)
class Bifurcation:
    """Where branches cross: all that meet there."""

    value: float
    branches: tuple[int, ...]


@dataclass(frozen=True)
class BranchesData:
    """All branches over a driver."""

    mechanism: str
    driver: str
    completeness: Annotated[str, "of the assemblies at the samples: proved, tested or searched"]
    resolution: Annotated[float, "distance of the samples"]
    open_ends: Annotated[int, "ends of branches that could not be told"]
    branches: tuple[BranchData, ...]
    folds: tuple[Fold, ...]
    bifurcations: tuple[Bifurcation, ...]
    circuits: Annotated[tuple[tuple[int, ...], ...], "branches of each"]


COORDINATES = 4
"""Most coordinates of an assembly in its table; all are in ``start`` of the mode."""


@dataclass(frozen=True)
class ComplexModes:
    """Assemblies that are not real: ``coordinates (n, F)`` and ``poses (n, N, 4, 4)``, complex arrays, no mechanisms."""

    coordinates: Array
    poses: Array

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True)
class Continuum:
    """Assemblies that can move with the drivers at rest: those in which only the freedoms in ``moves`` differ, of one or several parts.

    Attributes
    ----------
    point : the one nearest to the start of the mechanism, as far as was seen.
    dimension : number of independent motions.
    moves : freedoms that change.
    """

    point: Mechanism
    dimension: int
    moves: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class Assemblies(Shown, Sequence[Mechanism]):
    """All isolated real assembly modes at one position, each a Mechanism with ``start`` set. Returned by ``assemblies``.

    Attributes
    ----------
    mechanism, at : Mechanism, mapping
        The mechanism and the given values.
    poses : (M, N, 4, 4) array
        Poses of all links.
    coordinates : (M, F) array
        All freedoms, in the order of ``freedom_names`` [rad, length].
    kinds : tuple of str
        Per mode ``"regular"`` or ``"double"`` (double root: modes meet).
    condition : (M,) array
        Condition numbers of the closure equations; infinite if singular.
    certificates : tuple
        Of regular modes, else None.
    complex : object
        The solutions that are not real.
    completeness : {"proved", "tested", "searched"}
        The count equals a bound; a trace test passed, further monodromy loops found nothing and no path failed; or neither.
    evidence : tuple of str
        The reasons, with numbers.
    total : int or None
        Solutions of a generic member of the class; ``infinite`` of them diverged here, ``on_continua`` ended on self-motions.
    continua : tuple
        Self-motions with the drivers fixed; ``completeness`` does not cover them.

    Examples
    --------
    >>> import mechgraph as mg
    >>> modes = mg.assemblies(mg.load("four-bar"), {"A": 0.5})
    >>> [round(mode.start["D.Rz"], 4) for mode in modes]
    [-2.2613, -0.163]
    """

    mechanism: Mechanism
    at: Mapping[str, float]
    modes: tuple[Mechanism, ...]
    poses: Array
    coordinates: Array
    kinds: tuple[str, ...]
    condition: Array
    certificates: tuple[Certificate | None, ...]
    complex: ComplexModes
    completeness: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int
    on_continua: int
    continua: tuple[Continuum, ...]

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, i: int | slice) -> Any:
        return self.modes[i]

    def __iter__(self) -> Iterator[Mechanism]:
        return iter(self.modes)

    def document(self) -> Document:
        """A table of the assemblies, and how sure it is that these are all."""
        m = self.mechanism
        single = [
            name for pair in m.pairs for name, one in zip(pair.freedom_names, pair.type.drivable, strict=True) if one
        ]
        shown = [name for name in single if name not in self.at][:COORDINATES]
        places = [m.freedom_names().index(name) for name in shown]
        far = float(np.abs(self.poses[:, :, :3, 3]).max(initial=0.0))
        names = [f"{name} [deg]" if m.turns(name) else name for name in shown]
        header = ("mode", *names, "kind", "condition", "unique within")
        rows = []
        for i, kind in enumerate(self.kinds):
            sure = self.certificates[i]
            word = "none" if sure is None else f"{sure.radius:.2g}" if sure.proved else "not proved"
            rows.append(
                (
                    str(i),
                    *(
                        f"{in_degrees(m, name, self.coordinates[i, k], far):.5g}"
                        for name, k in zip(shown, places, strict=True)
                    ),
                    kind,
                    f"{self.condition[i]:.3g}",
                    word,
                )
            )
        title = f"{m.name}: {counted(len(self), 'mode')} at {values_text(m, self.at)}"
        moving = [
            f"Continuum of dimension {one.dimension}: {', '.join(one.moves)} move with the drivers at rest."
            for one in self.continua
        ]
        words = " ".join([*moving, f"Completeness: {self.completeness}.", *self.evidence])
        return Document(title, (Table(header, tuple(rows)), Paragraph(words)))

    def plot(self) -> Any:
        """Draw all assembly modes side by side.

        Returns
        -------
        Figure
            Of matplotlib.

        Raises
        ------
        MissingExtraError
            Without matplotlib.
        """
        return methods.call("draw_assemblies", self)

    @property
    def data(self) -> AssembliesData:
        """Everything but arrays as a record."""
        modes = zip(self.modes, self.kinds, self.condition.tolist(), self.certificates, strict=True)
        return AssembliesData(
            self.mechanism.name,
            self.at,
            self.completeness,
            self.evidence,
            self.total,
            self.infinite,
            self.on_continua,
            len(self.complex),
            tuple(ContinuumData(one.point.start, one.dimension, one.moves) for one in self.continua),
            tuple(ModeData(mode.start, kind, condition, sure) for mode, kind, condition, sure in modes),
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


@dataclass(frozen=True, repr=False)
class AssembliesOver(Shown, Sequence[Assemblies]):
    """Assembly modes at several positions, ``modes[position][mode]``. Returned by ``assemblies`` for lists of values.

    Examples
    --------
    >>> import mechgraph as mg
    >>> modes = mg.assemblies(mg.load("four-bar"), {"A": [0.5, 0.6]})
    >>> [len(at) for at in modes], modes.completeness
    ([2, 2], 'proved')
    """

    positions: tuple[Assemblies, ...]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, i: int | slice) -> Any:
        return self.positions[i]

    @property
    def completeness(self) -> str:
        """The weakest of all positions."""
        return weakest(p.completeness for p in self.positions)

    def document(self) -> Document:
        """How many assemblies there are at every position."""
        rows = tuple(
            (values_text(p.mechanism, p.at), str(len(p)), str(len(p.complex)), p.completeness) for p in self.positions
        )
        return Document(
            f"{self.positions[0].mechanism.name}: assemblies",
            (Table(("at", "real", "not real", "completeness"), rows),),
        )

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {"positions": [p.to_dict() for p in self.positions]}


def values_text(m: Mechanism, at: Mapping[str, float]) -> str:
    """Values given, turns in degrees: ``A.Rz = 30 deg, B.Tz = 0.1``."""
    return ", ".join(f"{name} = {in_degrees(m, name, value):.6g}{unit_of(m, name)}" for name, value in at.items())


def in_degrees(m: Mechanism, name: str, value: float, far: float = 0.0) -> float:
    """A value of a freedom or coordinate as it is shown: turns in degrees, zero where it is rounding (of lengths beside one of ``far``)."""
    turns = m.turns(name)
    if abs(value) <= MODES_ZERO * (1.0 if turns else far):
        return 0.0
    return float(np.rad2deg(value)) if turns else value


def unit_of(m: Mechanism, name: str) -> str:
    """What is written after it."""
    return " deg" if m.turns(name) else ""


MODES_ZERO = 1e-12
"""Angle (radians), or part of the largest length, that tables show as zero."""
WORDS = ("proved", "tested", "searched")
"""What completeness may be, the strongest first."""


def weakest(words: Iterable[str]) -> str:
    """The weakest of words for completeness."""
    return max(words, key=WORDS.index)
