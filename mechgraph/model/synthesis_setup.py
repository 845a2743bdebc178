"""What is asked of a mechanism and which of its dimensions are sought: ``[synthesis]`` in a file."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import numpy as np

from mechgraph.fields import FACTS, INTEGER, NAMES, OTHER, TABLES, TEXT, Described, Schema, plain, remade
from mechgraph.memo import dataclass
from mechgraph.quantities import is_numeric, items_of, real_array, wrong

TaskName = Literal["function", "path", "poses", "positions"]
FitName = Literal["least_squares", "minimax"]
DefectName = Literal["branch", "circuit", "order", "full_turn"]
_ROWS: Schema = {"type": "array", "items": {"type": "array"}}
_HELD: dict[TaskName, tuple[str, ...]] = {
    "function": ("input", "output", "pairs", "scale", "rates", "accelerations"),
    "path": ("point", "points", "at", "velocities", "accelerations"),
    "poses": ("link", "places", "at", "twists"),
    "positions": ("rows",),
}
"""Fields of every kind of task; those of other kinds are left out."""
_OPTIONAL = ("scale", "at", "rates", "velocities", "accelerations", "twists")


@dataclass(frozen=True, eq=False)
class SynthesisTask(Described):
    """What is asked at every position, in the form of a file; ``mg.function``, ``mg.path``, ``mg.poses``, ``mg.positions`` become it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.SynthesisSetup([mg.function("A", "D", [(0, 0), (0.2, 0.3)])], ["B.point.x"]).tasks[0].kind
    'function'
    """

    kind: Annotated[TaskName, TEXT("what is asked", choices=get_args(TaskName))]
    input: Annotated[str, TEXT("of a function: the freedom that is given", default="none")] = ""
    output: Annotated[str, TEXT("of a function: the freedom that follows it", default="none")] = ""
    pairs: Annotated[
        Any,
        OTHER("of a function: [input, output] of every position, counted from the first", degrees=True, rules=_ROWS),
    ] = None
    scale: Annotated[
        str,
        TEXT(
            "of a function: `free` where its output is times an unknown factor, which is not sought so far",
            choices=("given", "free"),
        ),
    ] = "given"
    point: Annotated[str, TEXT("of a path: link and named point", default="none")] = ""
    points: Annotated[Any, OTHER("of a path: places of the point; nan asks for nothing", rules=_ROWS)] = None
    link: Annotated[str, TEXT("of poses: the link", default="none")] = ""
    places: Annotated[
        Any,
        OTHER(
            "of poses: [x, y, angle in degrees] in a planar mechanism, else 4 x 4 matrices; the first is the identity",
            rules=_ROWS,
        ),
    ] = None
    rows: Annotated[
        Any,
        OTHER(
            "of positions: tables, freedom, point or link → value",
            rules={"type": "array", "items": {"type": "object"}},
        ),
    ] = None
    at: Annotated[Any, FACTS("freedom → values at the same positions (timing)", default="none")] = None
    rates: Annotated[
        Any, OTHER("of a function: derivatives of the output by the input, nan where none is asked", default="none")
    ] = None
    velocities: Annotated[Any, OTHER("of a path: velocities of the point", rules=_ROWS, default="none")] = None
    accelerations: Annotated[
        Any, OTHER("of a path, beside velocities; of a function: second derivatives by the input", default="none")
    ] = None
    twists: Annotated[
        Any,
        OTHER(
            "of poses: angular velocity (radians) and velocity about the origin of the frame, in a plane also rates of [x, y, angle]",
            rules=_ROWS,
            default="none",
        ),
    ] = None

    def __post_init__(self) -> None:
        for name in ("pairs", "points", "places", "rates", "velocities", "accelerations", "twists"):
            object.__setattr__(self, name, plain(getattr(self, name)))
        at = self.at if isinstance(self.at, Mapping) or self.at is None else {"": self.at}
        object.__setattr__(self, "at", {str(k): plain(v) for k, v in (at or {}).items()})
        if isinstance(self.rows, list | tuple):
            object.__setattr__(
                self,
                "rows",
                tuple({k: plain(v) for k, v in row.items()} if isinstance(row, Mapping) else row for row in self.rows),
            )

    @staticmethod
    def of(task: Any) -> Any:
        """A task of ``mg.function``, ``mg.path``, ``mg.poses``, ``mg.positions`` in this form; anything else as it is."""
        kind = next((k for k, fields in _HELD.items() if all(hasattr(task, name) for name in fields)), None)
        if kind is None or isinstance(task, SynthesisTask):
            return task
        given = {name: getattr(task, name) for name in _HELD[kind]}
        places = real_array(given.get("places"))
        if places is not None and places.ndim == 2:
            given["places"] = np.column_stack([places[:, :2], np.rad2deg(places[:, 2])])
        return SynthesisTask(kind=kind, **given)

    def arguments(self) -> dict[str, Any]:
        """Those of the call that it stands for."""
        given = {name: getattr(self, name) for name in _HELD[self.kind]}
        if "places" in given:
            given["poses"] = given.pop("places")
            places = real_array(given["poses"])
            if places is not None and places.ndim == 2:
                given["poses"] = np.column_stack([places[:, :2], np.deg2rad(places[:, 2])])
        return given

    def faults(self, where: str) -> list[str]:
        """What is wrong with it by itself; names are looked up where it is asked."""
        if self.kind not in _HELD:
            return [f"{where}: {wrong(self.kind, 'kind', ' or '.join(map(repr, _HELD)))}"]
        held, found = _HELD[self.kind], []
        for name, about in self.formats.items():
            value = getattr(self, name)
            if name == "kind":
                continue
            given = value is not None and value not in ("", "given") and value != {}
            if name in held and not given and name not in _OPTIONAL:
                found.append(f"{where}: {name} is missing ({about.meaning})")
            elif name not in held and given:
                found.append(f"{where}: a task {self.kind!r} takes no {name}")
        return found + [f"{where}: {fault}" for fault in self.value_faults("")]


@dataclass(frozen=True, eq=False)
class SynthesisSetup(Described):
    """Store arguments of ``synthesize`` with a mechanism, ``Mechanism(..., synthesis=...)`` or ``[synthesis]`` in its file.

    Examples
    --------
    >>> import mechgraph as mg
    >>> asked = mg.SynthesisSetup(mg.function("A", "D", [(0, 0), (0.2, 0.3), (0.4, 0.5)]), ["B.point"])
    >>> mg.load("four-bar").replace(synthesis=asked).synthesis.unknown
    ('B.point',)
    """

    tasks: Annotated[Any, TABLES("what is asked, one or several of equal length", key="task", table="synthesis_task")]
    unknown: Annotated[
        Any, NAMES("numbers that are sought, as studies name them, or elements: `B.point`, `coupler.tip`, `B`")
    ]
    fit: Annotated[
        FitName | None, TEXT("how more is met than can be met exactly", choices=get_args(FitName), default="exactly")
    ] = None
    bounds: Annotated[Any, FACTS("number → [least, greatest]", default="none")] = None
    conditions: Annotated[
        Any, FACTS("quantity → [least, greatest] at the positions; `inf` is no end", default="none")
    ] = None
    require: Annotated[
        Any, NAMES("of `branch`, `circuit`, `order` (no such defect) and `full_turn`", default="none")
    ] = ()
    minimize: Annotated[Any, TEXT("quantity on which freedom that is left is spent", default="none")] = None
    maximize: Annotated[Any, TEXT("likewise, to be as large as can be", default="none")] = None
    sweep: Annotated[Any, FACTS("number → values that it takes one after the other", default="none")] = None
    over: Annotated[Any, FACTS("driver → values at which conditions hold", default="the positions")] = None
    starts: Annotated[int, INTEGER("from how many dimensions fits begin")] = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        tasks = self.tasks if isinstance(self.tasks, list | tuple) else (self.tasks,)
        object.__setattr__(self, "tasks", tuple(map(SynthesisTask.of, tasks)))
        for name in ("unknown", "require"):
            if isinstance(value := getattr(self, name), str):
                object.__setattr__(self, name, (value,))
        for name, ends in (("bounds", True), ("conditions", True), ("sweep", False), ("over", False)):
            value = getattr(self, name)
            if value is None or isinstance(value, Mapping):
                read = _two_ends if ends else plain
                object.__setattr__(self, name, MappingProxyType({k: read(v) for k, v in (value or {}).items()}))

    __reduce__ = remade

    def faults(self) -> list[str]:
        """What is wrong with it by itself, one line each; names are looked up where it is asked."""
        found: list[str] = []
        for i, task in enumerate(items_of(self.tasks, "tasks", found)):
            if isinstance(task, SynthesisTask):
                found += task.faults(f"task {i + 1}")
            else:
                found.append(wrong(task, f"task {i + 1}", "mg.function, mg.path, mg.poses or mg.positions"))
        if not self.tasks:
            found.append("tasks: nothing is asked")
        for name in ("bounds", "conditions"):
            value = getattr(self, name)
            pairs = value.items() if isinstance(value, Mapping) else ()
            found += [] if isinstance(value, Mapping) else [wrong(value, name, "a mapping name -> (least, greatest)")]
            found += [wrong(v, f"{name}[{k!r}]", "(least, greatest)") for k, v in pairs if not _is_interval(v)]
        if self.fit is not None and (not isinstance(self.fit, str) or self.fit not in get_args(FitName)):
            found.append(wrong(self.fit, "fit", " or ".join(map(repr, get_args(FitName)))))
        if not isinstance(self.unknown, tuple) or not all(isinstance(name, str) for name in self.unknown):
            found.append(wrong(self.unknown, "unknown", "names"))
        found += [
            wrong(one, "require", ", ".join(get_args(DefectName)))
            for one in items_of(self.require, "require", found)
            if not isinstance(one, str) or one not in get_args(DefectName)
        ]
        if type(self.starts) is not int or self.starts < 1:
            found.append(wrong(self.starts, "starts", "a whole number above 0"))
        return [f"synthesis: {fault}" for fault in found]


def _two_ends(value: Any) -> Any:
    """Least and greatest value, infinite where there is none."""
    if not isinstance(value, list | tuple) or len(value) != 2:
        return value
    ends = zip(value, (-np.inf, np.inf), strict=True)
    return tuple(end if given is None else plain(given) for given, end in ends)


def _is_interval(value: Any) -> bool:
    fits = isinstance(value, tuple) and len(value) == 2
    return fits and all(is_numeric(v, ()) or v in (-np.inf, np.inf) for v in value) and value[0] <= value[1]
