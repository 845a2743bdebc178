"""Assemblies and branches as plain data for scripts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from mechgraph.modes.certificate import Certificate


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
