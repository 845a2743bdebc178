"""What is kept with a mechanism of what is asked of it: ``[response]``, from where and how it moves; ``[synthesis]``, what is sought."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    BY_FREEDOM,
    FLAG,
    FREEDOM_NAME,
    INTEGER,
    NAMES,
    NUMBER,
    OTHER,
    POSITION,
    SERIES,
    TABLES,
    TEXT,
    Described,
    Schema,
    plain,
    remade,
)
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.motion import Drive, Motion
from mechgraph.quantities import (
    LENGTH,
    PURE,
    TIME,
    factor_of,
    is_numeric,
    items_of,
    no_limit,
    option_faults,
    real_array,
    shown,
    wrong,
)

What = Literal["position", "velocity", "acceleration"]
WHATS: tuple[What, ...] = get_args(What)


@dataclass(frozen=True)
class Event(Described):
    """Declare an event: a quantity passes a value during ``respond``.

    ``of`` names a freedom, or is a function of the Solution at one time that returns a number.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("windows-2")
    >>> r = mg.respond(m, (0, 10), rates={"A0": -1.0}, events=[mg.Event("A0", -3.0, terminal=True)])
    >>> len(r.events), round(float(r["A0"].position[-1, 0]), 6)
    (1, -3.0)
    """

    of: Annotated[Any, FREEDOM_NAME("the freedom that is watched")]
    value: Annotated[float, NUMBER("the value that it passes", **POSITION)] = 0.0
    what: Annotated[What, TEXT("what of it", choices=WHATS)] = "position"
    direction: Annotated[int, OTHER("1: rising, -1: falling, 0: both", default="0", rules={"enum": [-1, 0, 1]})] = 0
    terminal: Annotated[bool, FLAG("whether the motion ends there")] = False
    name: Annotated[str, TEXT("what it is called", default="in words")] = ""

    @property
    def text(self) -> str:
        """The event in words."""
        if self.name:
            return self.name
        of = f"{self.what} of {self.of}" if isinstance(self.of, str) else getattr(self.of, "__name__", "function")
        return f"{of} passes {self.value:g}"

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it."""
        found = []
        if isinstance(self.of, str):
            fault = m.freedom_fault(self.of, single=True)
            found += [f"event: {fault}"] if fault else []
        elif not callable(self.of):
            found.append(f"event of {shown(self.of)}: expected the name of a freedom, or a function of a Solution")
        if not is_numeric(self.value, ()):
            return [*found, f"event of {shown(self.of)}: {wrong(self.value, 'value', 'a finite number')}"]
        if self.what not in WHATS:
            found.append(f"event {self.text}: {wrong(self.what, 'what', ', '.join(map(repr, WHATS)))}")
        if self.direction not in (-1, 0, 1):
            found.append(f"event {self.text}: {wrong(self.direction, 'direction', '-1, 0 or 1')}")
        return found

    def numbers_turn(self, turns: Callable[[Any], bool]) -> bool:
        """Whether what it watches is a turn."""
        return turns(self.of)

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """See ``Described``; the dimension of the value is that of ``what``."""
        if not isinstance(self.of, str):
            raise DeclarationError("to_units", [f"event {self.text}: watches a function; convert it yourself"])
        dimension = (0 if turns else 1, 0, -WHATS.index(self.what))
        return self.replace(value=self.value * factor_of(dimension, base))


@dataclass(frozen=True)
class Occurrence:
    """An event that happened at time ``t``; ``rising`` or falling.

    Where a stop or a contact is struck: the ``impulse`` that it exerts, the ``energy_lost`` in all at that time, and the ``impulses`` in
    the pairs, by name: wrenches ``(6,)``, (M, F) about the global origin, of link a on link b, NaN where not unique.
    """

    event: Event
    t: float
    rising: bool
    impulse: float = 0.0
    energy_lost: float = 0.0
    impulses: Mapping[str, Array] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.event.text} at t = {self.t:.6g}"


@dataclass(frozen=True)
class Stop(Described):
    """Declare limits of a freedom for ``respond``: impact at ``lower`` and ``upper`` with a coefficient of restitution.

    In place of a freedom the coordinate ``"link.point.Tx"`` of a named point in the axes of the frame.

    Examples
    --------
    >>> import mechgraph as mg
    >>> bob = mg.Mechanism("bob", [mg.Link("frame"), mg.Link("bob", 1.0, (1, 0, 0))], [
    ...     mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1)),
    ... ], loads=[mg.Gravity((0, -9.81, 0))])  # fmt: skip
    >>> r = mg.respond(bob, (0, 1), stops=[mg.Stop("A", lower=-1.0, restitution=0.5)])
    >>> print(r.events[0])
    A meets its lower stop at t = 0.459381
    """

    freedom: Annotated[str, FREEDOM_NAME("the freedom that is limited")]
    lower: Annotated[float | None, NUMBER("lower limit; at least one of the two", default="none", **POSITION)] = None
    upper: Annotated[float | None, NUMBER("upper limit", default="none", **POSITION)] = None
    restitution: Annotated[float, NUMBER("coefficient of restitution, 0 to 1", minimum=0.0)] = 0.0

    def point(self, m: Any) -> tuple[str, str] | None:
        """Link and name of the point of which it limits a coordinate, ``"rod.tip.Tx"``; None where it limits a freedom."""
        name, _, along = self.freedom.rpartition(".") if isinstance(self.freedom, str) else ("", "", "")
        known = [(one.name, point) for one in m.links for point in one.points if name == f"{one.name}.{point}"]
        return known[0] if known and along in ("Tx", "Ty", "Tz") else None

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it."""
        fault = None if self.point(m) is not None else m.freedom_fault(self.freedom, single=True)
        points = ", ".join(f"{link.name}.{point}" for link in m.links for point in link.points)
        also = f"; coordinates Tx, Ty, Tz of points: {points}" if points else ""
        found = [fault + also] if fault else []
        limits = {name: value for name in ("lower", "upper") if (value := getattr(self, name)) is not None}
        found += [wrong(v, name, "a finite number") for name, v in limits.items() if not is_numeric(v, ())]
        if not limits:
            found.append("has neither lower nor upper limit")
        elif len(limits) == 2 and not found and not limits["lower"] < limits["upper"]:
            found.append(f"lower = {self.lower:g}, upper = {self.upper:g}: expected lower < upper")
        if not is_numeric(self.restitution, ()) or not 0.0 <= self.restitution <= 1.0:
            found.append(wrong(self.restitution, "restitution", "a number from 0 to 1"))
        return [f"stop of {shown(self.freedom)}: {fault}" for fault in found]


LISTS: dict[str, type[Any]] = {"motions": Drive, "events": Event, "stops": Stop}
"""What stands in lists in a set-up."""
BY_NAME = ("start", "rates")
"""What stands in it by names of freedoms."""
MethodName = Literal["auto", "RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]
METHODS: tuple[MethodName, ...] = get_args(MethodName)
PassiveName = Literal["free", "held"]


@dataclass(frozen=True, eq=False)
class ResponseSetup(Described):
    """Store default arguments of ``respond`` with a mechanism, ``Mechanism(..., response=...)`` or ``[response]`` in its file.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("windows-2").replace(response=mg.ResponseSetup((0, 1), points=5, rates={"A0": -1.0}))
    >>> mg.respond(m).t
    array([0.  , 0.25, 0.5 , 0.75, 1.  ])
    """

    time: Annotated[Any, SERIES("begin and end, or the rising times of the outputs", TIME)]
    points: Annotated[
        int | None,
        OTHER(
            "number of outputs from begin to end", default="the steps taken", rules={"type": "integer", "minimum": 2}
        ),
    ] = None
    start: Annotated[
        Any,
        BY_FREEDOM(
            "coordinates at the beginning, freedom → number; degrees with `_deg` added",
            default="`start`",
        ),
    ] = None
    rates: Annotated[
        Any,
        BY_FREEDOM("rates at the beginning, freedom → number; degrees with `_deg` added", default="at rest"),
    ] = None
    motions: Annotated[
        Any, TABLES("freedoms that are prescribed, motions with `t`", key="drive", table="drive", default="stored ones")
    ] = ()
    rtol: Annotated[float, NUMBER("relative tolerance of a step")] = 1e-8
    atol: Annotated[float, NUMBER("absolute tolerance: radians, lengths / L, and their rates")] = 1e-10
    method: Annotated[MethodName, TEXT("stepper of `scipy.integrate`", choices=METHODS)] = "auto"
    max_step: Annotated[float | None, NUMBER("longest step", TIME, default="none")] = None
    passive: Annotated[
        PassiveName, TEXT("what passive freedoms do: move freely, or stay at rest", choices=get_args(PassiveName))
    ] = "free"
    events: Annotated[Any, TABLES("events that are watched", key="event", table="event", default="none")] = ()
    stops: Annotated[Any, TABLES("limits of freedoms", key="stop", table="stop", default="none")] = ()

    def __post_init__(self) -> None:
        self.read_numbers()
        if no_limit(self.max_step):
            object.__setattr__(self, "max_step", None)
        for name in BY_NAME:
            kept = {} if (value := getattr(self, name)) is None else value
            object.__setattr__(self, name, MappingProxyType(dict(kept)) if isinstance(kept, Mapping) else kept)
        if isinstance(self.motions, Mapping):
            object.__setattr__(self, "motions", tuple(Drive(name, motion) for name, motion in self.motions.items()))
        for name, kind in LISTS.items():
            if isinstance(value := getattr(self, name), kind):
                object.__setattr__(self, name, (value,))

    __reduce__ = remade

    @property
    def times(self) -> Array:
        """Begin and end, or the times of the outputs."""
        times = np.array(self.time, dtype=float)
        return times if self.points is None else np.linspace(times[0], times[-1], self.points)

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it, one line each."""
        found: list[str] = []
        times, points = read_times(self.time, found), self.points
        most_points = 10_000_000
        if points is not None and (type(points) is not int or not 2 <= points <= most_points or len(times) != 2):
            found.append(wrong(points, "points", f"a number from 2 to {most_points}, beside time = (begin, end)"))
        for what in BY_NAME:
            found += _value_faults(m, what, getattr(self, what))
        found += tolerance_faults(self.rtol, self.atol, self.max_step)
        found += option_faults({"method": (self.method, METHODS), "passive": (self.passive, get_args(PassiveName))})
        of_items: list[str] = []
        for what, kind in LISTS.items():
            for one in items_of(getattr(self, what), what, found):
                if not isinstance(one, kind):
                    found.append(wrong(one, f"an item of {what}", f"an mg.{kind.__name__}"))
                elif isinstance(getattr(self, what), tuple):
                    of_items += _motion_faults(m, one) if isinstance(one, Drive) else one.faults(m)
        found += of_items
        return [f"response: {fault}" for fault in found]

    def _changed(self, table: Callable[[Any], Any], items: Callable[[Any], Any], **more: Any) -> ResponseSetup:
        """With what becomes of its numbers by freedoms, and of its lists."""
        tables = {name: table(getattr(self, name)) for name in BY_NAME}
        return self.replace(**tables, **{name: items(getattr(self, name)) for name in LISTS}, **more)

    def with_full_names(self, full_name: Callable[[str], str]) -> ResponseSetup:
        """The same with all freedoms spelled in full."""
        return self._changed(
            lambda table: {full_name(name): value for name, value in table.items()},
            lambda items: [one.with_full_names(full_name) for one in items],
        )

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Names of the freedoms of which it says anything."""
        named = [name for what in LISTS for one in getattr(self, what) for name in one.freedoms]
        return tuple(dict.fromkeys([*self.start, *self.rates, *named]))

    def without(self, gone: set[str]) -> ResponseSetup:
        """The same without what is said of some freedoms, named in full."""
        return self._changed(
            lambda table: {name: value for name, value in table.items() if name not in gone},
            lambda items: [one for one in items if gone.isdisjoint(one.freedoms)],
        )

    def converted(self, base: tuple[float, float, float], turns: Callable[[str], bool]) -> ResponseSetup:
        """The same in other units; ``turns``: whether a freedom is a turn."""

        def scaled(values: Mapping[str, float], order: int) -> dict[str, float]:
            powers = {True: (PURE[0], 0, -order), False: (LENGTH[0], 0, -order)}
            return {name: value * factor_of(powers[turns(name)], base) for name, value in values.items()}

        return self.replace(
            time=plain(np.asarray(self.time) * base[2]),
            max_step=None if self.max_step is None else self.max_step * base[2],
            start=scaled(self.start, 0),
            rates=scaled(self.rates, 1),
            **{name: [one.converted(base, turns) for one in getattr(self, name)] for name in LISTS},
        )


def read_times(t: Any, faults: list[str]) -> Array:
    """Times of outputs, or begin and end; adds what is wrong to ``faults``."""
    times = real_array(t)
    fits = times is not None and times.ndim == 1 and len(times) > 1 and np.isfinite(times).all()
    if times is None or not fits or not (np.diff(times) > 0).all():
        faults.append(wrong(t, "t", "(begin, end) or rising times of the outputs, at least two"))
        return np.zeros(2)
    return times


def tolerance_faults(rtol: Any, atol: Any, max_step: Any) -> list[str]:
    """What is wrong with the tolerances of a step, and with the longest one."""
    long = max_step is None or no_limit(max_step) or (is_numeric(max_step, ()) and max_step > 0.0)
    return ([] if long else [wrong(max_step, "max_step", "a time above 0, or infinity or None")]) + [
        wrong(value, name, "a number from 1e-14 to 0.1")
        for name, value in (("rtol", rtol), ("atol", atol))
        if not is_numeric(value, ()) or not 1e-14 <= value <= 0.1
    ]


def _value_faults(m: Any, what: str, values: Any) -> list[str]:
    """What is wrong with numbers by freedoms."""
    if not isinstance(values, Mapping):
        return [wrong(values, what, "a mapping")]
    found = []
    for name, value in values.items():
        fault = m.freedom_fault(name, single=what == "start")
        if fault:
            found.append(f"{what} of {name!r}: {fault}")
        elif not is_numeric(value, ()):
            found.append(wrong(value, f"{what} of {name!r}", "a finite number"))
    return found


def _motion_faults(m: Any, one: Drive) -> list[str]:
    fault = m.freedom_fault(one.freedom, single=True)
    if fault:
        return [f"motion of {one.freedom!r}: {fault}"]
    if isinstance(one.motion, Motion):
        return one.faults() or (
            [] if one.motion.t is not None else [f"motion of {one.freedom!r}: has no times; give t"]
        )
    return (
        []
        if callable(one.motion)
        else [wrong(one.motion, f"motion of {one.freedom!r}", "a Motion with t, or a function of t")]
    )


TaskName = Literal["function", "path", "poses", "positions"]
FitName = Literal["least_squares", "minimax"]
DefectName = Literal["branch", "circuit", "order", "full_turn"]
_ROWS: Schema = {"type": "array", "items": {"type": "array"}}
_LISTED: Schema = {"additionalProperties": {"type": "array"}}
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
            "of a function: `free` where its output is times an unknown factor, `D.Tz.scale` among what is found",
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
        BY_FREEDOM(
            "of positions: tables, freedom, point or link → value; degrees with `_deg` added",
            rules={"type": "array", "items": {"type": "object"}},
        ),
    ] = None
    at: Annotated[
        Any,
        BY_FREEDOM(
            "freedom → values at the same positions (timing); degrees with `_deg` added", rules=_LISTED, default="none"
        ),
    ] = None
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
    bounds: Annotated[
        Any, BY_FREEDOM("number → [least, greatest]; degrees with `_deg` added", rules=_LISTED, default="none")
    ] = None
    conditions: Annotated[
        Any,
        BY_FREEDOM(
            'quantity → [least, greatest] at the positions, `inf` for none; degrees with `_deg` added: `"transmission D_deg" = [40, inf]`',
            rules=_LISTED,
            default="none",
        ),
    ] = None
    require: Annotated[
        Any, NAMES("of `branch`, `circuit`, `order` (no such defect) and `full_turn`", default="none")
    ] = ()
    minimize: Annotated[Any, TEXT("quantity on which freedom that is left is spent", default="none")] = None
    maximize: Annotated[Any, TEXT("likewise, to be as large as can be", default="none")] = None
    sweep: Annotated[
        Any,
        BY_FREEDOM(
            "number → values that it takes one after the other; degrees with `_deg` added",
            rules=_LISTED,
            default="none",
        ),
    ] = None
    over: Annotated[
        Any,
        BY_FREEDOM(
            "driver → values at which conditions hold; degrees with `_deg` added",
            rules=_LISTED,
            default="the positions",
        ),
    ] = None
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
                read = two_ends if ends else plain
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
            found += [wrong(v, f"{name}[{k!r}]", "(least, greatest)") for k, v in pairs if not is_interval(v)]
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


def two_ends(value: Any) -> Any:
    """Least and greatest value, infinite where there is none."""
    if not isinstance(value, list | tuple | np.ndarray) or np.shape(value) != (2,):
        return value
    ends = zip(value, (-np.inf, np.inf), strict=True)
    return tuple(end if given is None else plain(given) for given, end in ends)


def keeps(values: Any, least: float | None, most: float | None) -> bool:
    """Whether all values lie between limits, but for the accuracy of an optimizer; no value that is none does."""
    slip = 1e-6 * max([1.0, *(abs(end) for end in (least, most) if end is not None and np.isfinite(end))])
    return bool(
        np.isfinite(values).all()
        and (least is None or (values >= least - slip).all())
        and (most is None or (values <= most + slip).all())
    )


def is_interval(value: Any) -> bool:
    """Whether a value is two ends, as ``two_ends`` reads them, the lower one first."""
    fits = isinstance(value, tuple) and len(value) == 2
    return fits and all(is_numeric(v, ()) or v in (-np.inf, np.inf) for v in value) and value[0] <= value[1]
