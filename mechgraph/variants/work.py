"""Parts of a study: their batches, what is solved, and what is read from it.

Kinetostatics of many variants of one mechanism as one batch ``(variants, positions)``.

The start of every variant is followed from the mechanism itself: from its closed start, while its numbers change into those of the
variant. This is a path like any other, with the part of the way in place of a driver.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph import outcome
from mechgraph.determinacy.snapping import SnappedMechanism, declared_closure, meant, started
from mechgraph.errors import DeclarationError, MechgraphError, did_you_mean, listed, near_names
from mechgraph.fields import XYZ
from mechgraph.force.reactions import MethodName
from mechgraph.kinematics.motion_path import DriverPath, Status
from mechgraph.kinematics.prescribed import DriverMotion, Motions
from mechgraph.kinematics.reach import away_from_poles
from mechgraph.kinematics.solver import MotionEngineName, closure_solver
from mechgraph.kinematics.state import Configuration, FactoredClosure
from mechgraph.kinematics.system import System
from mechgraph.kinetostatics import Pipeline, RedundantName, solve_quietly
from mechgraph.maths.newton import Paths
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tracker import End, Follower, Tracks
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive
from mechgraph.model.friction import Friction
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.model.parameters import Parameters
from mechgraph.outcome import COMPILED, InKernel, Options, Starts, in_kernel
from mechgraph.quantities import items_of, shown, unit_of, wrong
from mechgraph.result.contacts import LiftOff, Overlap
from mechgraph.result.film import FILM_DIMENSIONS, FilmResult
from mechgraph.result.solution import Doubt, Solution
from mechgraph.result.values import OK, LoadBearing, MisfitsLeftOut, Unbalanced, coupling_unit
from mechgraph.result.views import LinkResult, PairResult, link_units, pair_units
from mechgraph.variants.numbers import ALIKE, AnyField, ItemField, Variants, stacked, topology_of, varied

Output = str | Callable[[Solution], Any]

RESERVED = ("status", "variant", "position", "positions not solved")
"""Names that tables of a study use themselves."""
OF_COUPLING = {
    "normal_force": (1, 1, -2), "force": (1, 1, -2), "point": (1, 0, 0), "sliding": (1, 0, -1), "moment": (2, 1, -2),
    "slip_margin": (0, 0, 0),
}  # fmt: skip
OF_BELT = {
    "tension": (1, 1, -2), "span": (1, 0, 0), "wrap": (0, 0, 0), "friction": (0, 0, 0), "slip_margin": (0, 0, 0),
}  # fmt: skip
"""Dimensions of what a solution says of a coupling that acts along a line, and of the spans and pulleys of a belt."""
PURE_NUMBERS = ("friction", "slip_margin")
OF_SOLUTION = ("shaking",)
OF_CHECKS = ("closure", "equilibrium", "power", "accuracy")


def _properties(kind: type) -> tuple[str, ...]:
    return tuple(n for n, v in vars(kind).items() if isinstance(v, property) and n not in ("units", "components"))


RANKS = ("position", "velocity", "acceleration")
OF_PAIR, OF_LINK = _properties(PairResult), _properties(LinkResult)


def named_outputs(m: Mechanism, outputs: Any, parameters: Iterable[str]) -> dict[str, Output]:
    """Outputs by name, from a quantity, several, or a mapping name -> quantity or function.

    Raises
    ------
    DeclarationError
        with all names that are no quantity.
    """
    if isinstance(outputs, str):
        outputs = [outputs]
    if not isinstance(outputs, Mapping):
        unlisted: list[str] = []
        names = items_of(outputs, "", unlisted)
        if unlisted or not all(isinstance(name, str) for name in names):
            raise DeclarationError(
                "study: outputs",
                [wrong(outputs, "outputs", "names, or a mapping name -> name or function of a Solution")],
            )
        outputs = {name: name for name in names}
    faults = [
        fault
        for name, what in outputs.items()
        if (fault := None if callable(what) else _fault(m, name, what)) is not None
    ]
    faults += [
        f"{name!r}: this name is taken; give the output another one"
        for name in outputs
        if name in {*RESERVED, *parameters}
    ]
    if faults or not outputs:
        raise DeclarationError("study: outputs", faults or ["no outputs; name at least one, e.g. 'A.effort'"])
    return dict(outputs)


def _fault(m: Mechanism, name: str, what: Any) -> str | None:
    if isinstance(what, str) and _found(m, what):
        return None
    pair = m.pairs[0]
    hint = did_you_mean(near_names(what, _known(m, what), ALIKE)) if isinstance(what, str) else ""
    example = (
        f"expected e.g. '{pair.name}.effort', '{pair.name}.position', "
        f"'{pair.freedom_names[0] if pair.freedom_names else pair.name}', '{pair.name}:{(*pair.type.component_names, 'Fx')[0]}', "
        f"'{m.links[-1].name}.center', 'shaking', or a function of a Solution"
    )
    said = shown(name) if isinstance(what, str) and name == what else f"{shown(name)}: {shown(what)}"
    return f"{said}: {_missing(m, what)}; {hint or example}"


def _missing(m: Mechanism, what: Any) -> str:
    """What there is not: a pair, link or coupling of that name, or a quantity of it."""
    owner = what.rpartition(".")[0] or what.rpartition(":")[0] if isinstance(what, str) else ""
    parts = {name.rpartition(".")[0] for name in m.once(_of_couplings)}
    if not owner or owner.removesuffix(".film") in (*m.pair_index, *m.link_index, *parts):
        return "is no quantity"
    couplings = dict.fromkeys(c.belt if isinstance(c, BeltDrive) else c.name for c in m.couplings)
    known = {"pairs": m.pair_index, "links": m.link_index, "couplings": couplings}
    there = "; ".join(f"{what}: {listed(names)}" for what, names in known.items() if names)
    kinds = "pair, link or coupling" if couplings else "pair or link"
    return f"there is no {kinds} {shown(owner)} ({there})"


def _known(m: Mechanism, what: str) -> list[str]:
    """Names of the quantities of the pair or link that is named, or of all."""
    owner = what.rpartition(".")[0]
    of = [(pair.name, OF_PAIR) for pair in m.pairs] + [(link.name, OF_LINK) for link in m.links]
    points = [f"{link.name}.{name}" for link in m.links for name in link.points if owner in (link.name, "")]
    films = [f"{p.name}.film.{part}" for p in m.pairs if p.film is not None for part in FILM_DIMENSIONS]
    return [f"{name}.{part}" for name, parts in of if owner in (name, "") for part in parts] + [
        *films,
        *points,
        *(name for name in m.once(_of_couplings) if owner in (name.rpartition(".")[0], "")),
        *OF_SOLUTION,
        *OF_CHECKS,
    ]


Getter = Callable[[Solution], Any]


def _of_couplings(m: Mechanism) -> dict[str, tuple[str, Getter]]:
    """Quantities of couplings by name, ``g.normal_force``, ``belt.tension.p1-p2``, ``belt.wrap.p1``: unit, and how a solution tells it."""
    rubbing = {load.of for load in m.loads if isinstance(load, Friction)}
    rows: list[tuple[str, str, str, str]] = []  # owner, quantity, key of a span or pulley, unit
    for c in m.couplings:
        if isinstance(c, BeltDrive):
            rows.append((c.belt, "length", "", unit_of(m.units, (1, 0, 0))))
            keys = {part: c.span_names if part in ("tension", "span") else c.over for part in OF_BELT}
            units = {part: "" if part in PURE_NUMBERS else unit_of(m.units, of) for part, of in OF_BELT.items()}
            rows += [(c.belt, part, key, unit) for part, unit in units.items() for key in keys[part]]
        else:
            rows += [(c.name, "effort", "", coupling_unit(m, c)), (c.name, "loss", "", unit_of(m.units, (2, 1, -3)))]
            rows += [
                (c.name, part, "", "" if part in PURE_NUMBERS else unit_of(m.units, of))
                for part, of in OF_COUPLING.items()
                if c.steps and (part != "slip_margin" or "wrap" in c.rubs)
            ]
    return {
        f"{owner}.{part}.{key}".removesuffix("."): (unit, partial(_of_coupling, owner, part, key))
        for owner, part, key, unit in rows
        if part != "slip_margin" or owner in rubbing
    }


def _of_coupling(owner: str, part: str, key: str, s: Solution) -> Any:
    value = getattr(s.coupling(owner), part)
    return value[key] if key else value


def _found(m: Mechanism, text: str) -> Callable[[Solution], Any] | None:
    """The quantity of that name: of a pair, a freedom, a component, a link, or the whole."""
    if text in OF_SOLUTION:
        return lambda s: getattr(s, text)
    if text in OF_CHECKS:
        return lambda s: getattr(s.checks, text)
    if text in m.freedom_names():
        k, j = m.freedom(text)
        return lambda s: s[m.pairs[k].name].position[..., j]
    owner, colon, part = text.partition(":")
    if colon and owner in m.pair_index and part in m.pair(owner).type.component_names:
        return lambda s: s[owner].components[part]
    owner, _, part = text.rpartition(".")
    bearing, _, film = owner.rpartition(".")
    if film == "film" and part in FILM_DIMENSIONS and bearing in m.pair_index and m.pair(bearing).film is not None:
        return lambda s: _of_film(s, bearing, part)
    if owner in m.pair_index and part in OF_PAIR:
        return lambda s: getattr(s[owner], part)
    if owner in m.link_index and part in OF_LINK:
        if part.startswith("center") and m.link(owner).center is None:
            return None
        return lambda s: getattr(s.link(owner), part)
    if found := m.once(_of_couplings).get(text):
        return found[1]
    if point := _point(m, text):
        link, name, rank, part = point
        return lambda s: getattr(s.link(link).at(name), RANKS[rank])[..., part]
    return None


def _of_film(s: Solution, pair: str, name: str) -> Array:
    """A number of the film of a pair ``(V, ...)``; NaN for variants with positions that were not solved."""
    found = [None if film is None else np.asarray(getattr(film, name)) for film in _films(s, pair)]
    shape = next((one.shape for one in found if one is not None), s.batch[1:])
    return np.stack([np.full(shape, np.nan) if one is None else one for one in found])


@lru_cache(maxsize=1)  # one orbit serves all numbers
def _films(s: Solution, pair: str) -> list[FilmResult | None]:
    n = s.batch[-1]
    return [
        s.part(slice(v * n, v * n + n)).film(pair) if (status == OK).all() else None
        for v, status in enumerate(s.status)
    ]


def _point(m: Mechanism, text: str) -> tuple[str, str, int, Any] | None:
    """Link, name, derivative and component of ``bucket.tip``, ``bucket.tip.velocity``, ``bucket.tip.acceleration`` or ``bucket.tip.x``."""
    return next(
        (
            (link.name, name, rank, component)
            for link in m.links
            for name in link.points
            for rank, of in enumerate(RANKS)
            for component, tail in [(slice(None), ""), *((i, f".{axis}") for i, axis in enumerate(XYZ))]
            if text == f"{link.name}.{name}{f'.{of}' if rank else ''}{tail}"
        ),
        None,
    )


def unit_of_output(m: Mechanism, what: Output) -> str | tuple[str, ...]:
    """The unit of a quantity in the declared units, or one for every entry of its last axis; empty where it is not known."""
    if not isinstance(what, str):
        return ""
    if what in m.freedom_names():
        return unit_of(m.units, (0 if m.turns(what) else 1, 0, 0))
    owner, colon, part = what.partition(":")
    if colon and owner in m.pair_index:
        return str(pair_units(m.units, m.pair(owner).type)["components"][part])
    if told := m.once(_of_couplings).get(what):
        return told[0]
    owner, _, part = what.rpartition(".")
    found: Any = ""
    if owner in m.pair_index and part in OF_PAIR:
        found = pair_units(m.units, m.pair(owner).type).get(part, "")
    elif owner in m.link_index and part in OF_LINK:
        found = link_units(m.units).get(part, "")
    elif point := _point(m, what):
        found = unit_of(m.units, (1, 0, -point[2]))
    elif owner.endswith(".film"):
        found = unit_of(m.units, FILM_DIMENSIONS[part]).replace("rad", "")
    elif what == "shaking":
        found = pair_units(m.units, m.pairs[0].type)["reaction"]
    return found[0] if isinstance(found, tuple) and len(set(found)) == 1 else found


def quantity(s: Solution, name: str, what: Output) -> Array:
    """An output of a solution of variants ``(V, N)``, ``(V, ...)``; a last axis of length one (of a pair with one freedom) is dropped.

    Raises
    ------
    DeclarationError
        where a function fails or gives no array with one entry for every variant.
    """
    if isinstance(what, str):
        found = _found(s.mechanism, what)
        assert found is not None
        value = np.asarray(found(s))
        return value[..., 0] if value.ndim > len(s.batch) and value.shape[-1] == 1 else value
    try:
        value = np.asarray(what(s), dtype=float)
    except Exception as error:
        raise DeclarationError(
            f"study: output {name!r}", [f"its function failed: {type(error).__name__}: {error}"]
        ) from error
    if not value.ndim or value.shape[0] != s.batch[0]:
        raise DeclarationError(
            f"study: output {name!r}",
            [
                f"its function gave shape {value.shape} for {s.batch[0]} variants; quantities of a study are (variants, positions, ...): "
                "reduce over axis 1, not over the variants"
            ],
        )
    return value


Mask = NDArray[np.bool_]
NumbersAt = Callable[[Array, Index], Variants]
"""Gives variants ``(n,)``, each with its numbers at a part ``(n,)`` of the way from those of the mechanism itself (0) to its own (1)."""


class NumbersPath(DriverPath):
    """The closure equations while the numbers change, drivers at rest: the path value is the part of the way."""

    def __init__(self, line: Pipeline, numbers_at: NumbersAt) -> None:
        solver = closure_solver(line.engine, line.leading, line.freedoms.hold if line.passive else None)
        super().__init__(line.system, solver, line.system.cases)
        self.size, self.paced = (self.system.n_freedoms, 1), True
        self._line, self._numbers_at = line, numbers_at
        self._known: dict[bytes, System] = {}

    def system_at(self, part: Array, variants: Index) -> System:
        """The system with the numbers of variants ``(n,)``, each at its part of the way; those of the last calls are kept."""
        key = part.tobytes() + variants.tobytes()
        if key not in self._known:
            # four systems are kept: a difference asks for two, and Newton's method for both of them again
            self._known = dict([*self._known.items()][-3:])
            self._known[key] = self.system_of(self._numbers_at(part, variants))
        return self._known[key]

    def system_of(self, variants: Variants) -> System:
        """The system with the numbers of variants."""
        par, m = self.system.par, self._line.m
        made = variants.numbers.with_rest(m).parameters(m, par.offset, par.origin, par.L)
        # one array with all variants says how many there are
        mass = np.broadcast_to(made.mass, (len(m.links), variants.count))
        return self.system.with_parameters(dataclasses.replace(made, mass=mass))

    def built_at(self, part: Array, variants: Index) -> tuple[System, Mask]:
        """The system with the numbers of variants at a part of the way, and which could be built."""
        found, built = self._numbers_at(part, variants), np.ones(len(part), dtype=bool)
        built[list(found.missing)] = False
        return self.system_of(found), built

    def at(self, x: Array, drive: Array, tracks: Index) -> Configuration:
        """The equations with the numbers at a part of the way."""
        self._last = drive, tracks
        return Configuration(self.system_at(drive[0], tracks), x.copy())

    def sensitivity(self, point: Configuration, factored: FactoredClosure) -> Array:
        """Rates with the part of the way, by a forward difference: the numbers come from a function or a table of any kind."""
        drive, tracks = self._last
        step = self._step[tracks]
        ahead = Configuration(self.system_at(drive[0] + step, tracks), point.x).residual - point.residual
        return factored.solve(-ahead[:, None] / step)

    def pace(self, x: Array, rates: Array) -> Array:
        """The largest rate: where the numbers change by little, so do the equations, however far the way is."""
        return np.minimum(np.abs(rates).max(axis=0, initial=0.0), 1.0)

    def lead(self, x: Array, valid: Mask) -> Tracks:
        """The ``valid`` variants from states ``x (nx, V)`` of the mechanism itself, in one step where the numbers change by little."""
        V = x.shape[1]
        here, there = (Configuration(self.system_at(np.full(V, part), np.arange(V)), x) for part in (0.0, 1.0))
        way = np.nan_to_num(np.abs(there.residual - here.residual).max(axis=0, initial=0.0))
        form = self.solver.chosen(here.part(np.arange(1)), np.full(1, -1))  # all begin in the mechanism itself
        # the longest step for that, in parts of the way, where the numbers change by less on the whole of it
        self._step = NUMBERS_STEP / np.where(way > 0, np.clip(way, NUMBERS_STEP / 1e-3, 1.0), 1.0)
        paths = Paths([np.array([[0.0, float(ok)]]) for ok in valid])
        return Follower(self, leads=False).follow(x, paths, first=1.0, which=np.repeat(form, V))


NUMBERS_STEP = 1e-7
"""What the numbers change by in that difference (radians, lengths / L): half the digits are left, which a prediction does not miss."""


@dataclass(frozen=True)
class Together:
    """The solution of all variants that could be followed from the mechanism itself, and which could not (``alone``).

    ``starts (F, V)``: user coordinates where each variant begins, NaN where it is not known.
    """

    solution: Solution | None
    alone: Mask
    starts: Array


def solve_together(
    numbers_at: NumbersAt,
    count: int,
    motions: Mapping[str, Motion],
    options: Options,
    actuate: tuple[str, ...] | None = None,
) -> Together:
    """All variants as one batch; NaN for those to be solved alone: they cannot be built, or not followed from the mechanism itself."""
    every = np.arange(count)
    variants, V = numbers_at(np.ones(count), every), count
    nothing = np.full((sum(p.type.f for p in variants.mechanism.pairs), V), np.nan)
    line = Pipeline(DriverMotion(variants.mechanism, motions, actuate), options)
    path = NumbersPath(line, numbers_at)
    valid = variants.valid()
    good = np.flatnonzero(valid)
    if not good.size:
        return Together(None, np.ones(V, dtype=bool), nothing)
    systems = path.system_of(variants)
    kernel = in_kernel(line, systems, variants.loads, V)
    one_motion = int(np.prod(line.drive.batch[:-1])) == 1
    if V > 1 and one_motion and valid.all() and _move_alike(line.system.par, systems.par):
        begun, x, sharing = valid, line.x[:, None], V
    else:
        begun, x, sharing = *_led(line, path, kernel, valid), 1
    if not begun.any():
        return Together(None, np.ones(V, dtype=bool), nothing)
    if kernel is not None:
        kernel.begin(x)
    starts = Starts(x, systems.cases, variants.loads, sharing, kernel)
    q = systems.coordinates_of(starts.x[..., None], line.system.start_coordinates(line.m.start))[: len(nothing), :, 0]
    q = np.broadcast_to(q, nothing.shape)
    try:
        outcome = line.run(starts, np.broadcast_shapes((V, 1), line.drive.batch))
    except DeclarationError:
        return Together(None, np.ones(V, dtype=bool), q)
    if outcome.found is not None and away_from_poles(line.m, line.system, outcome.found) is not None:
        return Together(None, np.ones(V, dtype=bool), q)
    numbers, tol = variants.declared, line.m.tol
    if numbers is not None and tol is not None:
        variant = np.arange(int(np.prod(outcome.batch))) // outcome.batch[-1]
        outcome.trajectory.as_declared(lambda x, at: declared_closure(line.system, numbers, x, variant[at]), tol)
    alone = ~begun | outcome.contradicting.reshape(V, -1).any(axis=1)
    return Together(Solution(outcome.trajectory), alone, q)


def _move_alike(itself: Parameters, varied: Parameters) -> bool:
    """Whether variants differ from the mechanism itself in masses alone."""
    names = ("marker_a", "marker_b", "pitch", "couplings")
    return all(bool((getattr(itself, name) == getattr(varied, name)).all()) for name in names)


def _led(line: Pipeline, path: NumbersPath, kernel: InKernel | None, valid: Mask) -> tuple[Mask, Array]:
    """Which variants could be led from the mechanism itself, and where they begin ``(nx, V)``, NaN for the others.

    Those that the kernel does not lead, numpy does, and all that have passive freedoms.
    """
    V = len(valid)
    x = np.full((len(line.x), V), np.nan) if kernel is None or line.passive else kernel.lead(valid, path.built_at)
    left = valid & np.isnan(x).any(axis=0)
    if left.any():
        tracks = path.lead(np.repeat(line.x[:, None], V, axis=1), left)
        last = np.zeros(V, dtype=np.intp)
        last[tracks.nodes.track] = np.arange(len(tracks.nodes))
        reached = left & np.array([end is End.REACHED for end in tracks.end])
        x[:, reached] = tracks.nodes.x[:, last[reached]]
    return valid & ~np.isnan(x).any(axis=0), x


Build = Callable[..., Mechanism]
NOT_SOLVED = "not solved"
"""Status of a variant that could not be built or assembled; its message says why."""
STATUSES = np.array([*(status.value for status in Status), NOT_SOLVED])
"""Named outcomes by the number that stands for them, that of a solved position first."""


@dataclass(frozen=True)
class Source:
    """Where variants come from: fields of a mechanism, or a function that builds one; ``start`` are its own values.

    With a ``tol`` every mechanism is taken as it is meant with it, ``mechanism`` too (see ``Mechanism.snapped``).
    ``stored`` are the drivers whose motion is that stored with the mechanism; ``redriven`` whether the study has other drives than those
    declared.
    """

    mechanism: Mechanism
    names: tuple[str, ...]
    start: Array
    fields: Mapping[str, AnyField] | None = None
    build: Build | None = None
    stored: tuple[str, ...] = ()
    redriven: bool = False
    tol: float | None = None

    @property
    def one_by_one(self) -> bool:
        """Whether curves, surfaces, contacts or named points vary, so that every variant is solved alone."""
        return any(isinstance(field, ItemField) and field.one_by_one for field in (self.fields or {}).values())

    def one(self, values: Array) -> Mechanism:
        """The mechanism for ``values (parameters,)``, as it is meant with the tolerance."""
        return meant(self._declared(values), self.tol, "study")

    def _declared(self, values: Array) -> Mechanism:
        if self.build is None:
            return self._varied(values[:, None]).one(0)
        made = self.build(**dict(zip(self.names, values.tolist(), strict=True)))
        if not isinstance(made, Mechanism):
            raise DeclarationError("study", [f"the function gave {type(made).__name__}; expected a Mechanism"])
        if self.redriven:
            made = made.replace(drives=self.mechanism.drives)
        if topology_of(made) != topology_of(self._as_declared):
            raise DeclarationError(
                f"study of {self.mechanism.name!r}",
                ["a variant differs in links, pairs, drives, loads or units from the first; only numbers may differ"],
            )
        return made

    def _varied(self, values: Array) -> Variants:
        assert self.fields is not None
        return varied(self._as_declared, self.fields, values)

    @property
    def _as_declared(self) -> Mechanism:
        """The mechanism itself as it was declared."""
        return self.mechanism.declared if isinstance(self.mechanism, SnappedMechanism) else self.mechanism

    def variants(self, values: Array, part: Array) -> Variants:
        """Variants at a ``part (count,)`` of the way from the mechanism itself (0) to ``values (parameters, count)`` (1, or a bit more)."""
        on_the_way = self.start[:, None] + part * (values - self.start[:, None])
        if self.build is None and self.tol is None:
            return self._varied(on_the_way)
        made: list[Mechanism | None] = []
        for column, moved in zip(on_the_way.T, np.broadcast_to(part > 0, values.shape[1:]), strict=True):
            if not moved:
                made.append(self.mechanism)
                continue
            try:
                made.append(self.one(column))
            except Exception:  # the message is given where this variant is solved alone
                made.append(None)
        return stacked(self.mechanism, made)


@dataclass(frozen=True)
class StudyTask:
    """Some variants to be solved: ``values (parameters, count)``, motions ``(1 or count, N)``, and what is kept of them."""

    source: Source
    values: Array
    motions: Motions
    outputs: Mapping[str, Output]
    method: MethodName
    redundant: RedundantName
    engine: MotionEngineName
    actuate: tuple[str, ...] | None = None

    @property
    def may_be_compiled(self) -> bool:
        """Whether the kernel may serve, and no variant is built by a function."""
        asked = self.engine == COMPILED or (self.engine == "auto" and outcome.at_hand() is not None)
        return asked and self.source.build is None and self.source.tol is None and not self.source.one_by_one


@dataclass(frozen=True)
class StudyPart:
    """What came of a task: outputs ``(count, ...)`` (None where no variant could be solved), messages, and for every position
    ``(count, N)`` the number of its outcome in ``STATUSES``; what makes reactions doubtful, of all variants; whether the compiled kernel
    solved them together.
    """

    outputs: dict[str, Array] | None
    status: NDArray[np.int8]
    messages: dict[int, str]
    warnings: tuple[Doubt, ...] = ()
    compiled: bool = False

    def cut(self, count: int) -> tuple[StudyPart, StudyPart]:
        """The first ``count`` variants, and the others; what makes reactions doubtful stays with the first."""

        def part(some: slice, begin: int, warnings: tuple[Doubt, ...]) -> StudyPart:
            outputs = None if self.outputs is None else {name: values[some] for name, values in self.outputs.items()}
            messages = {i - begin: why for i, why in self.messages.items() if i in range(len(self.status))[some]}
            return StudyPart(outputs, self.status[some], messages, warnings)

        return part(slice(count), 0, self.warnings), part(slice(count, None), count, ())


def unsolved(task: StudyTask, why: str) -> StudyPart:
    """A part of which nothing came."""
    count, positions = task.values.shape[1], max(motion.shape[-1] for motion in task.motions.values())
    status = np.full((count, positions), len(STATUSES) - 1, dtype=np.int8)
    return StudyPart(None, status, dict.fromkeys(range(count), why))


def worst(found: Iterable[Doubt]) -> tuple[Doubt, ...]:
    """Of every passive freedom the warning with the greatest effort, of every contact that with the greatest pull, and the deepest cut;
    of every check the greatest error.
    """
    out: dict[tuple[type, str], tuple[float, Doubt]] = {}
    for warning in found:
        match warning:
            case LoadBearing():
                name, size = warning.name, warning.effort
            case LiftOff():
                name, size = warning.pair, warning.force
            case Overlap():
                name, size = warning.pair, warning.curvature
            case Unbalanced():
                name, size = warning.check, warning.error
            case MisfitsLeftOut():
                name, size = warning.text, 0.0
        key = type(warning), name
        if size >= out.get(key, (size, warning))[0]:
            out[key] = size, warning
    return tuple(warning for _, warning in out.values())


def solved(task: StudyTask) -> StudyPart:
    """Solve the variants of a task: together where they can be followed in step, alone where not."""
    count = task.values.shape[1]
    together = solve_together(
        lambda part, which: task.source.variants(task.values[:, which], part),
        count,
        task.motions,
        Options(task.method, task.redundant, task.engine),
        task.actuate,
    )
    alone = together.alone
    N = max(motion.shape[-1] for motion in task.motions.values())
    status = np.full((count, N), NOT_SOLVED, dtype="U24")
    found: dict[str, Array] | None = None
    if together.solution is not None:
        status[~alone] = together.solution.status[~alone]
        found = {name: _writable(quantity(together.solution, name, what)) for name, what in task.outputs.items()}
    messages, warnings = {}, [] if together.solution is None else [*together.solution.doubts]
    for i in np.flatnonzero(alone):
        try:
            s = _solved_alone(task, int(i), together.starts[:, i])
        except MechgraphError as error:
            messages[int(i)] = str(error)
            s = None
        if s is not None:
            status[i] = s.status[0]
            warnings += s.doubts
            values = {name: quantity(s, name, what) for name, what in task.outputs.items()}
            found = found or {name: np.full((count, *v.shape[1:]), np.nan) for name, v in values.items()}
            for name, v in values.items():
                found[name][i] = v[0]
        elif found is not None:
            for v in found.values():
                v[i] = np.nan
    compiled = together.solution is not None and together.solution.engine == COMPILED
    return StudyPart(found, numbered(status), messages, worst(warnings), compiled)


def numbered(status: NDArray[np.str_]) -> NDArray[np.int8]:
    """Outcomes as their numbers in ``STATUSES``."""
    out = np.full(status.shape, len(STATUSES) - 1, dtype=np.int8)
    for i, name in enumerate(STATUSES):
        out[status == name] = i
    return out


def _writable(values: Array) -> Array:
    return np.array(values, dtype=float)


def _solved_alone(task: StudyTask, i: int, start: Array) -> Solution:
    """One variant alone, from coordinates ``start (F,)`` if known; positions out of reach flagged; as a batch ``(1, N)``."""
    try:
        m = task.source.one(task.values[:, i])
    except MechgraphError:
        raise
    except Exception as error:
        raise DeclarationError("study", [f"the function failed: {type(error).__name__}: {error}"]) from error
    if np.isfinite(start).all():
        m = started(m, dict(zip(m.freedom_names(), start.tolist(), strict=True)))
    motions = Motions({name: motion_of_case(motion, i) for name, motion in task.motions.items()}, task.motions.free)
    own = {m.full_name(d.freedom): d.motion for d in m.drives if d.motion is not None}
    for name in task.source.stored:
        if own[name].shape[-1:] != motions[name].shape[-1:]:
            raise DeclarationError(
                "study", [f"the motion stored with drive {name!r} has other positions than that of the first"]
            )
        motions[name] = as_rows(own[name])
    return solve_quietly(m, motions, Options(task.method, task.redundant, task.engine), task.actuate)


def as_rows(motion: Motion) -> Motion:
    """A motion as ``(cases, N)``."""
    shape = motion.shape if len(motion.shape) > 1 else (1, *(motion.shape or (1,)))

    def rows(values: Any) -> Any:
        return None if values is None else np.broadcast_to(values, motion.shape).reshape(shape)

    return Motion(rows(motion.position), rows(motion.velocity), rows(motion.acceleration), rows(motion.t))


def motion_of_case(motion: Motion, cases: int | Index) -> Motion:
    """The motion of some cases, ``(1 or count, N)``."""
    one = np.atleast_1d(cases)

    def part(values: Any) -> Any:
        return None if values is None else values[one] if np.shape(values)[0] > 1 else values

    return Motion(part(motion.position), part(motion.velocity), part(motion.acceleration), part(motion.t))
