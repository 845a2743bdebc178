"""What a mechanism is asked to do: poses of links, places of points, functions of freedoms, position by position.

Every task is short for numbers by name, one a position: values of freedoms, coordinates of points and links as ``solve`` prescribes them
(``coupler.tip.Tx``, ``platform.Rz``). NaN asks for nothing. Row 0 is the declared configuration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, Literal

import numpy as np

from mechgraph.kinematics.prescribed import Target, coordinate, parts_of, target_of
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door, items_of, real_array, shown, wrong


def _series(value: Any, shapes: Sequence[tuple[int, ...]], what: str, faults: list[str]) -> Array | None:
    """An array ``(n, *shape)`` of numbers, one of the shapes; None, with a fault, where it is none."""
    read = real_array(value)
    out = np.zeros(0) if read is None else read
    if out.ndim and len(out) and any(out.shape[1:] == shape for shape in shapes) and not np.isinf(out).any():
        return out
    wanted = " or ".join(str(("n", *shape)).replace("'", "") for shape in shapes)
    faults.append(f"{what}: expected numbers of shape {wanted}, got shape {out.shape}")
    return None


def _timed(m: Mechanism, at: Mapping[str, Any], n: int, faults: list[str]) -> dict[str, Array]:
    """Prescribed timing: values of freedoms at the same positions."""
    out = {}
    for name, value in at.items():
        turns = coordinate(m, name) if isinstance(name, str) else f"{shown(name)} is no name"
        if isinstance(turns, str):
            faults.append(f"at: {turns}")
        elif (row := _series(value, [()], f"at[{name!r}]", faults)) is not None:
            out[m.full_name(name) if m.freedom_fault(name, single=True) is None else name] = row
            if len(row) != n:
                faults.append(f"at[{name!r}]: {len(row)} values at {n} positions")
    return out


def _on(m: Mechanism, name: str, point: bool, faults: list[str]) -> Target | None:
    """The link, or point of a link, of that name."""
    found = target_of(m, name) if isinstance(name, str) else wrong(name, "name", "a text")
    if isinstance(found, Target) and not found.part and bool(found.point) is point:
        return found
    kind = "a point of a link, e.g. 'coupler.tip'" if point else "a link that moves"
    faults.append(f"{shown(name)}: expected {kind}" + (f"; {found}" if isinstance(found, str) else ""))
    return None


@dataclass(frozen=True)
class PoseTask:
    """See ``poses``."""

    link: str
    places: Any
    at: Mapping[str, Any] = field(default_factory=dict)

    def named(self, m: Mechanism, faults: list[str]) -> dict[str, Array]:
        """Coordinates of the link; its turns are three successive ones about x, the new y and the new z."""
        shapes = [(4, 4), (3,)] if m.planar else [(4, 4)]
        given = _series(self.places, shapes, f"poses of {self.link!r}", faults)
        if _on(m, self.link, False, faults) is None or given is None:
            return {}
        slides, turns = parts_of(m)
        if given.ndim == 3:
            given = self._coordinates(m, given, faults)
        out = {f"{self.link}.{part}": column for part, column in zip((*slides, *turns), given.T, strict=True)}
        return out | _timed(m, self.at, len(given), faults)

    def first(self, m: Mechanism) -> Array | None:
        """The first pose ``(4, 4)``, where it is whole and not the identity."""
        X = self._whole(m)
        return None if X is None or np.isnan(X[0]).any() or np.allclose(X[0], np.eye(4), atol=1e-9) else X[0]

    def after(self, m: Mechanism, X0: Array, faults: list[str]) -> PoseTask:
        """The same asked of the link in another frame, which lies on the global one where the link stands at ``X0``."""
        X = self._whole(m)
        assert X is not None
        nothing = np.isnan(X).any(axis=(1, 2))
        if not np.isnan(np.asarray(self.places, dtype=float)).reshape(len(X), -1).all(axis=1)[nothing].all():
            faults.append(f"poses of {self.link!r}: a link that begins elsewhere is asked for whole poses, or nothing")
        out = X @ np.linalg.inv(X0)
        out[0] = np.eye(4)
        return replace(self, places=out)

    def _whole(self, m: Mechanism) -> Array | None:
        """The poses ``(n, 4, 4)``; None where they are none."""
        X = real_array(self.places)
        if X is None or X.shape[1:] not in ((4, 4), (3,)) or not len(X) or (X.ndim == 2 and not m.planar):
            return None
        if X.ndim == 3:
            return X
        out = np.tile(np.eye(4), (len(X), 1, 1))
        c, s = np.cos(X[:, 2]), np.sin(X[:, 2])
        out[:, :2, :2], out[:, :2, 3] = np.array([[c, -s], [s, c]]).transpose(2, 0, 1), X[:, :2]
        return out

    def _coordinates(self, m: Mechanism, X: Array, faults: list[str]) -> Array:
        R = X[:, :3, :3]
        asked = ~np.isnan(R).any(axis=(1, 2))
        # largest entry of ``R R^T - 1`` of a pose
        if np.abs(R[asked] @ R[asked].swapaxes(1, 2) - np.eye(3)).max(initial=0.0) > 1e-6:
            faults.append(f"poses of {self.link!r}: expected proper rotations")
        elif m.planar and np.abs(X[asked, 2] - (0, 0, 1, 0)).max(initial=0.0) > 1e-9 * max(1.0, np.abs(X[asked]).max()):
            faults.append(f"poses of {self.link!r}: leave the x-y plane")
        if m.planar:
            return np.column_stack([X[:, :2, 3], np.arctan2(R[:, 1, 0], R[:, 0, 0])])
        turned = [
            np.arctan2(-R[:, 1, 2], R[:, 2, 2]),
            np.arcsin(np.clip(R[:, 0, 2], -1.0, 1.0)),
            np.arctan2(-R[:, 0, 1], R[:, 0, 0]),
        ]
        return np.column_stack([X[:, :3, 3], *turned])


@dataclass(frozen=True)
class PathTask:
    """See ``path``."""

    point: str
    points: Any
    at: Mapping[str, Any] = field(default_factory=dict)

    def named(self, m: Mechanism, faults: list[str]) -> dict[str, Array]:
        """Coordinates of the point."""
        given = _series(self.points, [(3,), (2,)] if m.planar else [(3,)], f"path of {self.point!r}", faults)
        if _on(m, self.point, True, faults) is None or given is None:
            return {}
        if m.planar and given.shape[1] == 3 and np.nan_to_num(given[:, 2]).any():
            faults.append(f"path of {self.point!r}: leaves the x-y plane")
        slides, _ = parts_of(m)
        out = {f"{self.point}.{part}": given[:, k] for k, part in enumerate(slides)}
        return out | _timed(m, self.at, len(given), faults)


@dataclass(frozen=True)
class FunctionTask:
    """See ``function``."""

    input: str
    output: str
    pairs: Any
    scale: str = "given"

    def named(self, m: Mechanism, faults: list[str]) -> dict[str, Array]:
        """Values of both freedoms, from those of the declared configuration on."""
        given = _series(self.pairs, [(2,)], f"function {self.input!r} -> {self.output!r}", faults)
        out = {}
        for k, name in enumerate((self.input, self.output)):
            why = m.freedom_fault(name, single=True)
            if why is not None:
                faults.append(f"function: {why}")
            elif given is not None:
                full = m.full_name(name)
                out[full] = given[:, k] - given[0, k] + float(m.start.get(full, m.start.get(name, 0.0)))
        if len(out) == 1 and given is not None and self.input == self.output:
            faults.append(f"function: input and output are both {self.input!r}")
        return out


@dataclass(frozen=True)
class PositionTask:
    """See ``positions``."""

    rows: tuple[Mapping[str, Any], ...]

    def named(self, m: Mechanism, faults: list[str]) -> dict[str, Array]:
        """All numbers named in any row; NaN where a row does not name one."""
        out: dict[str, Array] = {}
        for i, row in enumerate(self.rows):
            for name, value in row.items():
                for key, one in self._one(m, name, value, i, faults).items():
                    column = out.setdefault(key, np.full(len(self.rows), np.nan))
                    if not np.isnan(column[i]):
                        faults.append(f"row {i}: {key} is given twice")
                    column[i] = one[0]
        return out

    def _one(self, m: Mechanism, name: Any, value: Any, i: int, faults: list[str]) -> dict[str, Array]:
        if not isinstance(name, str):
            faults.append(f"row {i}: {name!r} is no name")
            return {}
        found = None if m.freedom_fault(name, single=True) is None else target_of(m, name)
        if isinstance(found, Target) and not found.part:
            kind = PathTask if found.point else PoseTask
            return kind(name, [value]).named(m, faults)
        here: list[str] = []
        out = _timed(m, {name: [value]}, 1, here)
        faults += [f"row {i}: {fault.removeprefix('at: ')}" for fault in here]
        return out


@door
def poses(link: str, poses: Any, *, at: Mapping[str, Any] | None = None) -> PoseTask:
    """Ask that a link passes through poses.

    Parameters
    ----------
    link : str
        The link.
    poses : (n, 4, 4) array
        Its poses; in a planar mechanism also ``(n, 3)``: x, y [length], angle [rad]. NaN asks for nothing. Where the first
        one is not the identity, what is found comes back with the pairs of the link by markers (fits begin at the identity).
    at : mapping, optional
        Values of freedoms at the same positions (prescribed timing).

    Returns
    -------
    PoseTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.poses("coupler", [[0, 0, 0], [1, 0, 0.2]]).link
    'coupler'
    """
    return PoseTask(link, poses, dict(at or {}))


@door
def path(point: str, points: Any, *, at: Mapping[str, Any] | None = None) -> PathTask:
    """Ask that a point of a link passes through points.

    Parameters
    ----------
    point : str
        Link and point, as ``"coupler.tip"``.
    points : (n, 3) array
        Its places [length]; in a planar mechanism also ``(n, 2)``. NaN asks for nothing. The first is where the point is declared, or the
        point is unknown.
    at : mapping, optional
        Values of freedoms at the same positions (prescribed timing).

    Returns
    -------
    PathTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.path("coupler.tip", [[0, 0], [1, 0.2]]).point
    'coupler.tip'
    """
    return PathTask(point, points, dict(at or {}))


@door
def function(input: str, output: str, pairs: Any, *, scale: Literal["given", "free"] = "given") -> FunctionTask:
    """Ask that one freedom is a function of another.

    Parameters
    ----------
    input, output : str
        Freedoms with one number.
    pairs : (n, 2) array
        Values of both [rad, length], counted from row 0.
    scale : {"given", "free"}
        With ``"free"`` the output is times an unknown factor; ``synthesize`` refuses "free" so far.

    Returns
    -------
    FunctionTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.function("A", "D", [[0, 0], [0.2, 0.3]]).output
    'D'
    """
    return FunctionTask(input, output, pairs, scale)


@door
def positions(rows: Sequence[Mapping[str, Any]]) -> PositionTask:
    """Ask for anything that ``assemblies`` takes, row by row: values of freedoms, points, poses.

    Parameters
    ----------
    rows : sequence of mappings
        Per position name -> value; what a row does not name is not asked there.

    Returns
    -------
    PositionTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> len(mg.positions([{"A": 0.0, "coupler.tip": (1, 2)}, {"A": 0.3}]).rows)
    2
    """
    return PositionTask(tuple(rows))


@dataclass(frozen=True)
class Asked:
    """All that is asked: ``values (n,)`` by name, NaN where nothing is; freedoms in ``scaled`` are times an unknown factor."""

    values: Mapping[str, Array]
    scaled: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """Number of positions, the declared one too."""
        return len(next(iter(self.values.values())))


def asked_of(m: Mechanism, tasks: Any, faults: list[str]) -> Asked | None:
    """Tasks, one or several, as numbers by name; None where they have faults, which are put to ``faults``."""
    kinds = (PoseTask, PathTask, FunctionTask, PositionTask)
    given = [tasks] if isinstance(tasks, kinds) else items_of(tasks, "tasks", faults)
    values: dict[str, Array] = {}
    before, scaled = len(faults), []
    for i, task in enumerate(given):
        if not isinstance(task, kinds):
            faults.append(f"tasks[{i}]: {shown(task)} is none; expected mg.poses, mg.path, mg.function or mg.positions")
            continue
        for name, column in task.named(m, faults).items():
            known = values.setdefault(name, column)
            if len(known) != len(column):
                faults.append(f"tasks[{i}]: {len(column)} positions, others have {len(known)}")
            elif (clash := np.flatnonzero(~np.isnan(known + column) & (known != column))).size:
                faults.append(
                    f"tasks[{i}]: {name} is asked twice at row {clash[0]}: {known[clash[0]]}, {column[clash[0]]}"
                )
            else:
                values[name] = np.where(np.isnan(column), known, column)
        if (
            isinstance(task, FunctionTask)
            and task.scale == "free"
            and m.freedom_fault(task.output, single=True) is None
        ):
            scaled.append(m.full_name(task.output))
    if len(faults) > before:
        return None
    if not values or len(next(iter(values.values()))) < 2:
        faults.append("tasks: nothing is asked beyond the declared configuration; give two positions or more")
        return None
    return Asked(values, tuple(scaled))
