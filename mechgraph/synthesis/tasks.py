"""What a mechanism is asked to do: poses of links, places of points, functions of freedoms, position by position.

Every task is short for numbers by name, one a position: values of freedoms, coordinates of points and links as ``solve`` prescribes them
(``coupler.tip.Tx``, ``platform.Rz``), and rates of such numbers. NaN asks for nothing. Row 0 is the declared configuration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, Literal

import numpy as np

from mechgraph.kinematics.prescribed import Target, coordinate, is_pose, parts_of, target_of
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.quantities import door, items_of, real_array, shown, wrong


def _series(value: Any, shapes: Sequence[tuple[int, ...]], what: str, faults: list[str]) -> Array | None:
    """An array ``(n, *shape)`` of numbers, one of the shapes; None, with a fault, where it is none."""
    read = real_array(value)
    out = np.zeros(0) if read is None else read
    if not (out.ndim and len(out) and any(out.shape[1:] == shape for shape in shapes)):
        wanted = " or ".join(str(("n", *shape)).replace("'", "") for shape in shapes)
        got = f"shape {out.shape}" if read is not None else shown(value)
        faults.append(f"{what}: expected numbers of shape {wanted}, got {got}")
    elif endless := np.argwhere(np.isinf(out)).tolist():
        row, *rest = endless[0]
        # of positions, row by row, the row is told by these
        at = [f"row {row}"] * (len(out) > 1) + [
            f"column {rest[0]}" if len(rest) == 1 else f"entry {tuple(rest)}"
        ] * bool(rest)
        where = f" at {', '.join(at)}" if at else ""
        faults.append(f"{what}: {out[tuple(endless[0])]}{where}; expected finite numbers, NaN where nothing is asked")
    else:
        return out
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


def _rates_of(names: Sequence[str], value: Any, n: int, what: str, faults: list[str]) -> dict[str, Array]:
    """Rates ``(n, k)``, or ``(n,)`` of one number, by name; nothing where none are given."""
    shapes = [(3,), (len(names),)] if len(names) > 1 else [()]
    if value is None or (given := _series(value, shapes, what, faults)) is None:
        return {}
    if len(given) != n:
        faults.append(f"{what}: {len(given)} values at {n} positions")
        return {}
    return dict(zip(names, given.reshape(len(given), -1).T, strict=False))


class RatedTask:
    """A task at positions alone."""

    def derivatives(self, m: Mechanism, faults: list[str]) -> tuple[dict[str, Array], ...]:
        """First and second derivatives by name, by a parameter that is the same for all names at a position."""
        return {}, {}


@dataclass(frozen=True)
class PoseTask(RatedTask):
    """See ``poses``."""

    link: str
    places: Any
    at: Mapping[str, Any] = field(default_factory=dict)
    twists: Any = None

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

    def derivatives(self, m: Mechanism, faults: list[str]) -> tuple[dict[str, Array], ...]:
        """Rates of the coordinates of the link."""
        X, V = self._whole(m), self._twists(m, faults)
        if X is None or V is None or len(V) != len(X):
            faults += (
                [f"twists of {self.link!r}: {len(V)} values at {np.shape(self.places)[0]} positions"]
                if V is not None
                else []
            )
            return {}, {}
        if (np.isnan(X).any(axis=(1, 2)) & ~np.isnan(V).all(axis=1)).any():
            faults.append(f"twists of {self.link!r}: expected beside whole poses alone")
            return {}, {}
        w, v = V[:, :3], V[:, 3:] + np.cross(V[:, :3], X[:, :3, 3])
        slides, turns = parts_of(m)
        if m.planar:
            columns = [v[:, 0], v[:, 1], w[:, 2]]
        else:
            a, b = np.arctan2(-X[:, 1, 2], X[:, 2, 2]), np.arcsin(np.clip(X[:, 0, 2], -1.0, 1.0))
            ones, none = np.ones(len(X)), np.zeros(len(X))
            # about x, the new y, and the new z: the third column of the rotation
            axes = np.stack([(ones, none, none), (none, np.cos(a), np.sin(a)), tuple(X[:, :3, 2].T)])
            if (np.abs(np.cos(b)) < MODES.span).any():
                faults.append(f"twists of {self.link!r}: not served where the link has turned by 90 degrees about y")
                return {}, {}
            columns = [*v.T, *np.linalg.solve(axes.transpose(2, 1, 0), w[:, :, None])[:, :, 0].T]
        return {f"{self.link}.{part}": c for part, c in zip((*slides, *turns), columns, strict=True)}, {}

    def _twists(self, m: Mechanism, faults: list[str]) -> Array | None:
        """Twists ``(n, 6)`` about the origin of the frame."""
        if self.twists is None:
            return None
        V = _series(self.twists, [(6,), (3,)] if m.planar else [(6,)], f"twists of {self.link!r}", faults)
        X = self._whole(m)
        if V is None or X is None or V.shape[1] == 6:
            return V
        w, v = (np.zeros((len(V), 3)) for _ in range(2))
        v[:, :2], w[:, 2] = V[:, :2], V[:, 2]
        return np.concatenate([w, v - np.cross(w, X[: len(V), :3, 3])], axis=1)

    def first(self, m: Mechanism) -> Array | None:
        """The first pose ``(4, 4)``, where it is whole and not the identity."""
        X = self._whole(m)
        if X is None or np.isnan(X[0]).any() or not is_pose(X[0]) or np.allclose(X[0], np.eye(4), atol=1e-9):
            return None
        return np.asarray(X[0])

    def after(self, m: Mechanism, X0: Array, faults: list[str]) -> PoseTask:
        """The same asked of the link in another frame, which lies on the global one where the link stands at ``X0``."""
        X = self._whole(m)
        assert X is not None
        nothing = np.isnan(X).any(axis=(1, 2))
        if not np.isnan(np.asarray(self.places, dtype=float)).reshape(len(X), -1).all(axis=1)[nothing].all():
            faults.append(f"poses of {self.link!r}: a link that begins elsewhere is asked for whole poses, or nothing")
        out = X @ np.linalg.inv(X0)
        out[0] = np.eye(4)
        return replace(self, places=out, twists=self._twists(m, faults))

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
        # a place may be asked for without the rest of a matrix
        wrong_at = np.flatnonzero(asked)[~is_pose(np.where(np.isnan(X), np.eye(4), X)[asked])].tolist()
        if wrong_at:
            rows = ", ".join(map(str, wrong_at))
            faults.append(f"poses of {self.link!r}: row {rows}: expected a proper rotation and the last row 0 0 0 1")
        elif partly := np.flatnonzero(~asked & ~np.isnan(R).all(axis=(1, 2))).tolist():
            rows = ", ".join(map(str, partly))
            faults.append(
                f"poses of {self.link!r}: row {rows}: a part of a rotation is NaN; expected all of it, or nothing"
            )
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
class PathTask(RatedTask):
    """See ``path``."""

    point: str
    points: Any
    at: Mapping[str, Any] = field(default_factory=dict)
    velocities: Any = None
    accelerations: Any = None

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

    def derivatives(self, m: Mechanism, faults: list[str]) -> tuple[dict[str, Array], ...]:
        """Velocities and accelerations of the point."""
        if self.accelerations is not None and self.velocities is None:
            faults.append(f"path of {self.point!r}: accelerations are asked beside velocities")
        names = [f"{self.point}.{part}" for part in parts_of(m)[0]]
        n = np.shape(self.points)[0]
        return tuple(
            _rates_of(names, value, n, f"{what} of {self.point!r}", faults)
            for what, value in (("velocities", self.velocities), ("accelerations", self.accelerations))
        )


@dataclass(frozen=True)
class FunctionTask(RatedTask):
    """See ``function``."""

    input: str
    output: str
    pairs: Any
    scale: str = "given"
    rates: Any = None
    accelerations: Any = None

    def named(self, m: Mechanism, faults: list[str]) -> dict[str, Array]:
        """Values of both freedoms, from those of the declared configuration on."""
        given = _series(self.pairs, [(2,)], f"function {self.input!r} -> {self.output!r}", faults)
        out = {}
        for k, name in enumerate((self.input, self.output)):
            why = m.freedom_fault(name, single=True)
            if why is not None:
                faults.append(f"function: {why}")
            elif given is not None and np.isnan(given[0, k]):
                faults.append(
                    f"function: {name} is NaN at row 0, from which the others are counted; expected a number there"
                )
            elif given is not None:
                full = m.full_name(name)
                out[full] = given[:, k] - given[0, k] + float(m.start.get(full, m.start.get(name, 0.0)))
        if len(out) == 1 and given is not None and self.input == self.output:
            faults.append(f"function: input and output are both {self.input!r}")
        return out

    def derivatives(self, m: Mechanism, faults: list[str]) -> tuple[dict[str, Array], ...]:
        """Derivatives of the output by the input, whose own rate is one."""
        x, y = (m.full_name(name) for name in (self.input, self.output))
        out, n = list[dict[str, Array]](), len(self.pairs)
        for own, (what, value) in enumerate((("rates", self.rates), ("accelerations", self.accelerations))):
            found = _rates_of([y], value, n, f"function: {what}", faults)
            out.append(found)
            if found:
                asked = ~np.isnan(found[y])
                for k in range(own + 1):
                    known = out[k].setdefault(x, np.full(n, np.nan))
                    known[asked] = 1.0 if k == 0 else 0.0
        return tuple(out)


@dataclass(frozen=True)
class PositionTask(RatedTask):
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
        here: list[str] = []
        if isinstance(found, Target) and not found.part:
            out = (PathTask if found.point else PoseTask)(name, [value]).named(m, here)
        else:
            out = _timed(m, {name: [value]}, 1, here)
        faults += [f"row {i}: {fault.removeprefix('at: ')}" for fault in here]
        return out


@door
def poses(link: str, poses: Any, *, at: Mapping[str, Any] | None = None, twists: Any = None) -> PoseTask:
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
    twists : (n, 6) array, optional
        Angular velocity and velocity of the link there, about the origin of the frame as ``link(...).twist`` of a solution; in a planar
        mechanism also ``(n, 3)``: rates of x, y, angle. Only their directions matter: the speed of the mechanism is free. NaN asks for
        nothing.

    Returns
    -------
    PoseTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.poses("coupler", [[0, 0, 0], [1, 0, 0.2]]).link
    'coupler'
    """
    return PoseTask(link, poses, dict(at or {}), twists)


@door
def path(
    point: str,
    points: Any,
    *,
    at: Mapping[str, Any] | None = None,
    velocities: Any = None,
    accelerations: Any = None,
) -> PathTask:
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
    velocities, accelerations : (n, 3) arrays, optional
        First and second derivatives of the places by time; in a planar mechanism also ``(n, 2)``. The speed of the mechanism is free: they
        ask for tangent and curvature of the path, one condition each in a plane. NaN asks for nothing.

    Returns
    -------
    PathTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.path("coupler.tip", [[0, 0], [1, 0.2]]).point
    'coupler.tip'
    """
    return PathTask(point, points, dict(at or {}), velocities, accelerations)


@door
def function(
    input: str,
    output: str,
    pairs: Any,
    *,
    scale: Literal["given", "free"] = "given",
    rates: Any = None,
    accelerations: Any = None,
) -> FunctionTask:
    """Ask that one freedom is a function of another.

    Parameters
    ----------
    input, output : str
        Freedoms with one number.
    pairs : (n, 2) array
        Values of both [rad, length], counted from row 0.
    scale : {"given", "free"}
        With ``"free"`` the output is the given one times an unknown factor, ``"D.Tz.scale"`` among the unknowns: of a sliding output
        exactly, of any in fits (of an angle there is no finite number of solutions).
    rates, accelerations : (n,) arrays, optional
        First and second derivatives of the output by the input there, one condition each. NaN asks for nothing.

    Returns
    -------
    FunctionTask

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.function("A", "D", [[0, 0], [0.2, 0.3]]).output
    'D'
    """
    return FunctionTask(input, output, pairs, scale, rates, accelerations)


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
    """All that is asked: ``values (n,)`` by name, NaN where nothing is; freedoms in ``scaled`` are times an unknown factor.

    ``rates`` are first and second derivatives of values, as many as are asked.
    """

    values: Mapping[str, Array]
    scaled: tuple[str, ...] = ()
    rates: tuple[Mapping[str, Array], ...] = ()

    @property
    def rows(self) -> int:
        """Number of positions, the declared one too."""
        return len(next(iter(self.values.values())))


def asked_of(m: Mechanism, tasks: Any, faults: list[str]) -> Asked | None:
    """Tasks, one or several, as numbers by name; None where they have faults, which are put to ``faults``."""
    kinds = (PoseTask, PathTask, FunctionTask, PositionTask)
    given = [tasks] if isinstance(tasks, kinds) else items_of(tasks, "tasks", faults)
    values: tuple[dict[str, Array], ...] = ({}, {}, {})
    before, scaled = len(faults), []
    for i, task in enumerate(given):
        if not isinstance(task, kinds):
            faults.append(f"tasks[{i}]: {shown(task)} is none; expected mg.poses, mg.path, mg.function or mg.positions")
            continue
        whole, here = len(faults), task.named(m, faults)
        rates = task.derivatives(m, faults) if len(faults) == whole else ({}, {})
        every = list(zip((here, *rates), values, strict=True))
        for name, column, into in ((name, column, into) for found, into in every for name, column in found.items()):
            known = into.setdefault(name, column)
            if len(known) != len(column):
                faults.append(f"tasks[{i}]: {len(column)} positions, others have {len(known)}")
            elif (clash := np.flatnonzero(~np.isnan(known + column) & (known != column))).size:
                faults.append(
                    f"tasks[{i}]: {name} is asked twice at row {clash[0]}: {known[clash[0]]}, {column[clash[0]]}"
                )
            else:
                into[name] = np.where(np.isnan(column), known, column)
        if (
            isinstance(task, FunctionTask)
            and task.scale == "free"
            and m.freedom_fault(task.output, single=True) is None
        ):
            scaled.append(m.full_name(task.output))
    if len(faults) > before:
        return None
    orders = 2 if values[2] else 1 if values[1] else 0
    if not values[0] or (len(next(iter(values[0].values()))) < 2 and not orders):
        faults.append("tasks: nothing is asked beyond the declared configuration; give two positions or more")
        return None
    return Asked(values[0], tuple(scaled), values[1 : 1 + orders])


class FirstPoses:
    """Links that begin at other poses than the identity, ``poses (4, 4)`` by link.

    Pairs by point and axis want the frames of their links on the global one at row 0. So a link with such pairs is sought in a frame of its
    own that lies there, ``m`` and ``tasks``; what is found comes ``back`` in the frame that was declared, its pairs by markers.
    """

    def __init__(self, declared: Mechanism, tasks: Any, unknown: Sequence[str], faults: list[str]) -> None:
        every = tasks if isinstance(tasks, list | tuple) else [tasks]
        found = [(task.link, task.first(declared)) for task in every if isinstance(task, PoseTask)]
        at_once = {link for pair in declared.pairs if pair.on_a is None for link in (pair.a, pair.b)}
        known = [(link, X) for link, X in found if X is not None and link in at_once]
        self.declared, self.poses = declared, dict(known)
        self.m, self.tasks = declared, tasks
        if not self.poses:
            return
        faults += [
            f"unknown {name!r}: is a point of a link of which the first pose is not the identity; begin there, or give the point"
            for name in unknown
            for link in self.poses
            if name.startswith(f"{link}.")
        ]
        faults += [
            f"pair {pair.name!r}: is placed on each link by itself, others of its link are not, and its first pose is not the identity; "
            "place all of them alike"
            for pair in declared.pairs
            if pair.on_a is not None and self.poses.keys() & {pair.a, pair.b}
        ]
        moved = [
            link.replace(points={name: X[:3, :3] @ p + X[:3, 3] for name, p in link.points.items()})
            if (X := self.poses.get(link.name)) is not None
            else link
            for link in declared.links
        ]
        self.m = declared.replace(links=moved)
        self.tasks = [
            task.after(declared, self.poses[task.link], faults)
            if isinstance(task, PoseTask) and task.link in self.poses
            else task
            for task in every
        ]

    def back(self, m: Mechanism) -> Mechanism:
        """A mechanism found, in the frames that were declared."""
        if not self.poses:
            return m
        links = [old if old.name in self.poses else new for old, new in zip(self.declared.links, m.links, strict=True)]
        return m.replace(links=links, pairs=[self._by_markers(pair) for pair in m.pairs])

    def _by_markers(self, pair: Pair) -> Pair:
        if pair.on_a is not None or not self.poses.keys() & {pair.a, pair.b}:
            return pair
        sides = []
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True):
            X = self.poses.get(link, np.eye(4))
            axis, second = (np.asarray(v) @ X[:3, :3] for v in (marker.axis, marker.second))
            sides.append(Marker((np.asarray(marker.point) - X[:3, 3]) @ X[:3, :3], axis, second))
        return pair.replace(point=None, axis=None, second=None, on_a=sides[0], on_b=sides[1])

    def poses_of(self, here: Configuration) -> Array:
        """Poses ``(T, N, 4, 4)`` of the links as declared."""
        X = np.moveaxis(user_poses(here), 1, 0)
        for link, X0 in self.poses.items():
            k = self.declared.link_names().index(link)
            X[:, k] = X[:, k] @ X0
        return X
