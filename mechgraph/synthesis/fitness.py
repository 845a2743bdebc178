"""Whether a mechanism can run through the positions that it meets: defects, transmission, sizes.

The circuit through the first position is followed, of all mechanisms of one topology together (see ``modes.circuits``). Every other one
is on one of its branches, or on another circuit.

Sources: Chase and Mirth, Circuits and branches of single-degree-of-freedom planar linkages, J. Mech. Des. 115, 1993; Filemon, Useful ranges
of centerpoint curves, Mech. Mach. Theory 7, 1972.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Annotated, Any, Literal, cast

import numpy as np

from mechgraph.determinacy.mobility import free_motion
from mechgraph.errors import DeclarationError, IndeterminateError, MechgraphWarning, did_you_mean, near_names
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.prescribed import Target, direction_of, parts_of, target_of
from mechgraph.kinematics.state import CLOSED, Configuration, user_poses
from mechgraph.kinetostatics import kinematics, solve, transmission
from mechgraph.maths.se3 import Array, Index, cross
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import is_interval, two_ends
from mechgraph.modes.circuits import SAME_VALUE, Circuits, in_order
from mechgraph.modes.family import Family
from mechgraph.quantities import wrong
from mechgraph.result.solution import Solution
from mechgraph.synthesis.unknowns import idle_moves
from mechgraph.variants.numbers import side_by_side
from mechgraph.variants.work import Output, named_outputs, quantity

Defect = Literal["branch", "circuit", "order", "full_turn"]
"""What may be required of a mechanism that runs through positions."""


@dataclass(frozen=True)
class Fitness:
    """What a mechanism is worth that meets positions one after the other.

    Without a driver that alone determines all positions nothing is known of defects, full turn (None) and transmission (NaN).

    Attributes
    ----------
    branch, circuit, order : bool or None
        Defects: positions on another branch than the first one, on another circuit, not in the order in which the driver passes them.
        Where the first one is a dead point the driver leads to no other: a defect of branch, of the others nothing is known.
    full_turn : bool or None
        Whether the driver turns right round on the branch of the first position.
    transmission, transmission_between : float
        Least transmission angle at the positions, and from the first to the last [rad]; NaN where the driver holds no output, at change
        points, or where it does not come to the last.
    size, ratio : float
        Largest distance of two elements of a link [length] (axes, centers, named points; of a slide the direction alone counts); longest
        over shortest of such distances [1].
    error : float
        Of fits the largest distance from what was asked at a row: a length, angles beside lengths as arcs of the mechanism's characteristic
        length; where angles alone are asked, radians.
    """

    branch: Annotated[bool | None, "a defect"]
    circuit: Annotated[bool | None, "a defect"]
    order: Annotated[bool | None, "a defect"]
    full_turn: bool | None
    transmission: Annotated[float, "radians"]
    transmission_between: Annotated[float, "radians"]
    size: float
    ratio: float
    error: float = 0.0

    @property
    def defects(self) -> tuple[str, ...]:
        """Names of the defects that are known."""
        return tuple(name for name in ("branch", "circuit", "order") if getattr(self, name))

    @property
    def good(self) -> bool:
        """Whether no defect is known; so too without a driver. It says nothing of errors."""
        return not self.defects

    @property
    def words(self) -> str:
        """Defects and transmission, as under a picture."""
        told = "no driver" if self.branch is None else f"{' and '.join(self.defects) or 'no'} defect"
        return told + (f", {np.rad2deg(self.transmission):.3g} deg" if np.isfinite(self.transmission) else "")

    def lacks(self, wanted: Iterable[Defect]) -> tuple[Defect, ...]:
        """Those of what is wanted (no defect of that name; a full turn) that it falls short of."""
        return tuple(name for name in wanted if getattr(self, name) is not (name == "full_turn"))


def fitnesses(
    mechanisms: Sequence[Mechanism],
    q: Array,
    driver: str | None = None,
    output: str | None = None,
    errors: Sequence[float] = (),
    asked: Mapping[str, Array] | None = None,
) -> list[Fitness]:
    """Fitness of mechanisms of one topology that meet positions with coordinates ``q (V, n, F)``; the start of each is its first.

    ``driver`` and ``output`` are freedoms; without a driver nothing is said of defects and transmission, without an output that freedom at
    the frame counts that is moved worst. A branch leads to a position where all is as there, or what is ``asked``: values ``(n,)`` by name,
    NaN where nothing is.
    """
    each = zip(mechanisms, errors or [0.0] * len(mechanisms), strict=True)
    out = [Fitness(None, None, None, None, np.nan, np.nan, *sizes(m), error) for m, error in each]
    if driver is None or not out:
        return out
    m, V = mechanisms[0], len(out)
    driver = m.full_name(driver)
    outputs = [m.full_name(output)] if output else frame_outputs(m, driver)
    base = closed_start(m.replace(drives=[driver], start=dict(zip(m.freedom_names(), q[0, 0].tolist(), strict=True))))
    s, par = base.system, base.system.par
    columns = s.columns_of([driver])
    passive = [motion.rates for motion in free_motion(s, base.x[:, 0], columns).passive]
    numbers = side_by_side(mechanisms).parameters(m, par.offset, par.origin, par.L)
    # one array with all of them says how many there are
    s = s.with_parameters(replace(numbers, mass=np.broadcast_to(numbers.mass, (len(m.links), V))))
    x, case = s.state_of(q.reshape(-1, q.shape[2]).T), np.repeat(np.arange(V), q.shape[1])
    rows = Configuration(s.cases(case), x)
    sigma = np.linalg.svd(rows.J.transpose(2, 0, 1), compute_uv=False)
    rank = int((sigma > MODES.generic * sigma[:, :1]).sum(axis=1).max())
    if s.n_freedoms - rank - len(passive) != 1:
        return out
    idle = np.array(passive).reshape(-1, s.n_freedoms).T
    of = Circuits(Family(base, columns, idle), s, int(columns[0]), rank, x[:, :: q.shape[1]])
    # of several branches on which a position lies the one of the lowest number, which comes last
    step, k, value, there = of.placed(case, x, None if asked is None else partial(_asked, of, mechanisms, asked))
    order = np.argsort(-np.abs(of.of_branch[step]), kind="stable")
    branches, values = np.full((2, len(case)), np.nan)
    branches[k[order]], values[k[order]] = of.of_branch[step[order]], value[order]
    # difference of coordinates, but for whole turns, of states of a row that are two
    if asked is not None and (np.abs(np.exp(1j * there) - np.exp(1j * x[:, k])) > 1e-6).any():
        x[:, k[order]] = there[:, order]
        rows = Configuration(s.cases(case), x)
    branches, values = branches.reshape(V, -1), values.reshape(V, -1)
    # the first one, also where it is a dead point
    branches[:, 0], values[:, 0] = 0.0, of.x[of.row]
    angles = partial(_transmitted, of, mechanisms, driver, outputs)
    at = angles(rows, case, np.arange(len(case))).reshape(q.shape[:2]).min(axis=1) if outputs else np.full(V, np.nan)
    branch, circuit = (branches != 0).any(axis=1), np.isnan(branches).any(axis=1)
    periods = np.where(of.turns > 0, of.turns, np.inf) * of.period
    ways = [None if branch[v] else in_order(values[v], float(periods[v])) for v in range(V)]
    good, between = np.array([v for v in range(V) if ways[v] is not None], dtype=np.intp), np.full(V, np.nan)
    if good.size and outputs:
        low, high = np.sort([way[[0, -1]] for way in ways if way is not None], axis=1).T
        between[good] = np.minimum(at[good], least_between(of, good, low, high, angles))
    full_turn = (of.turns > 0) & m.turns(driver)
    for v, (one, dead, off, apart, turns) in enumerate(
        zip(out, *(np.asarray(told).tolist() for told in (of.dead, branch, circuit, full_turn)), strict=True)
    ):
        known = Fitness(
            off, apart, not off and ways[v] is None, turns, float(at[v]), float(between[v]), one.size, one.ratio
        )
        out[v] = replace(one, branch=True) if dead else replace(known, error=one.error)
    return out


def _asked(
    of: Circuits, mechanisms: Sequence[Mechanism], asked: Mapping[str, Array], here: Configuration, k: Index
) -> Array:
    """What is asked at states of which ``k (T,)`` are the numbers, row by row of one mechanism after the other; zero where nothing is."""
    m, s, out = mechanisms[0], here.system, []
    case, row = np.divmod(k, len(next(iter(asked.values()))))
    for name, values in asked.items():
        if m.freedom_fault(name, single=True) is None:
            [column] = s.columns_of([name])
            found, period = here.x[s.single_rows[[column]]], of.family.periods[column]
            if np.isfinite(period):
                found = np.concatenate([np.cos(2 * np.pi * found / period), np.sin(2 * np.pi * found / period)])
        else:
            target = cast("Target", target_of(m, name))
            link = [one.name for one in m.links].index(target.link)
            X = user_poses(here, slice(link, link + 1))[0]
            if target.turns:
                # about x, the new y and the new z; these are no chart everywhere: where all are asked the whole rotation counts
                R, every = X[:, :3, :3], [asked.get(f"{target.link}.{turn}", np.nan) for turn in parts_of(m)[1]]
                whole = ~np.isnan(np.sum(np.broadcast_arrays(*every), axis=0))[row]
                angle = {"Rx": R[:, 1:, 2], "Ry": R[:, :1, 2], "Rz": R[:, 0, :2]}[target.part].T
                angle = angle if len(angle) == 1 else angle / np.linalg.norm(angle, axis=0)
                found = np.concatenate([np.where(whole, 0.0, angle), np.where(whole, R.reshape(len(k), 9).T, 0.0)])
            else:
                at = np.array([one.links[link].points.get(target.point, (0, 0, 0)) for one in mechanisms])[case]
                place = (np.einsum("tij,tj->it", X[:, :3, :3], at) + X[:, :3, 3].T) / s.par.L
                found = (cast("Array", direction_of(m, target.part)) @ place)[None]
        out.append(np.where(np.isnan(values[row]), 0.0, found))
    return np.concatenate(out)


def least_between(
    of: Circuits, cases: Index, low: Array, high: Array, angles: Callable[[Configuration, Index, Index], Array]
) -> Array:
    """Least ``angles (n,)`` of some mechanisms between driver values on the branches of their first states; NaN where not all are met."""
    least = np.full(of.V, np.inf)
    # samples, and all nodes, which are dense where circuits nearly meet; the least value lies between the neighbors of a low one
    case, places = of.a.case[of.of_branch == 0], of.a.x[of.row, of.of_branch == 0]
    some = np.flatnonzero(np.isin(case, cases))
    k = np.searchsorted(cases, case[some])
    some = some[(places[some] > low[k]) & (places[some] < high[k])]
    own = np.append(np.repeat(cases, 45), case[some])
    values = np.append(np.linspace(low, high, 45, axis=1), places[some])
    for _ in range(3):
        if not own.size:
            break
        order = np.lexsort((values, own))
        own, values = own[order], values[order]
        # of values that are one but for rounding the first; no lower one lies between them
        apart = (np.diff(own, prepend=-1) > 0) | (np.diff(values, prepend=0.0) > SAME_VALUE)
        own, values = own[apart], values[apart]
        each = [of.along(of.home[case], values[own == case]) for case in np.unique(own)]
        there, met = of.states(*(np.concatenate(part) for part in zip(*each, strict=True)))
        found = np.where(met, angles(of.here(there, own), own, own), np.nan)
        # what is not known stays so
        with np.errstate(invalid="ignore"):
            np.minimum.at(least, own, found)
        # of two dips the lower one may be the sharper one
        before, behind = (np.clip(np.arange(len(own)) + i, 0, len(own) - 1) for i in (-1, 1))
        before, behind = (np.where(own[at] == own, at, np.arange(len(own))) for at in (before, behind))
        dips = (found <= found[before]) & (found <= found[behind]) & (found <= 8.0 * least[own])
        own, values = (
            np.repeat(own[dips], 21),
            np.linspace(values[before[dips]], values[behind[dips]], 21, axis=1).ravel(),
        )
    return least[cases]


def _transmitted(
    of: Circuits,
    mechanisms: Sequence[Mechanism],
    driver: str,
    outputs: list[str],
    here: Configuration,
    case: Index,
    run: Index,
) -> Array:
    """Least transmission angles to ``outputs`` at states ``(T,)``, as ``kinetostatics.transmission`` defines them; NaN where a driver
    holds nothing. States of a ``run`` lie on one branch.
    """
    m, out = mechanisms[0], np.full((len(outputs), here.T), np.nan)
    if any(c.steps for c in m.couplings):
        # forces act along lines of gears
        names, q = m.freedom_names(), here.system.coordinates_of(here.x)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            for at in (np.flatnonzero(run == k) for k in dict.fromkeys(run.tolist())):
                start = dict(zip(names, q[:, at[0]].tolist(), strict=True))
                one = mechanisms[case[at[0]]].replace(drives=[driver], start=start)
                held = kinematics(one, {driver: q[names.index(driver), at]}, on_reach="flag")
                out[:, at] = [transmission(held, name).transmission_angle for name in outputs]
        return np.asarray(out.min(axis=0))
    # sizes of mechanisms; that of the first is the unit of length
    points = of.here(of.x, np.arange(of.V)).pair_points
    sizes_of = np.sqrt(((points - points.mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean(axis=0))
    sizes_of = np.where(sizes_of > CLOSED, sizes_of, 1.0)
    sizes_of = sizes_of / sizes_of[0]
    s, r, centers = here.system, of.rank, here.pair_points.copy()
    for k, pair in enumerate(m.pairs):
        if pair.type.touching is not None:
            number, i = s.place_of(k)
            centers[:, k] = here.frames[number][pair.type.normal_frame][:, 3, i]
    free = np.delete(np.arange(here.system.n_freedoms), of.column)
    U, sigma, V = np.linalg.svd(here.J[:, free].transpose(2, 1, 0))
    sigma = np.where(sigma[:, r - 1 : r] > MODES.generic * sigma[:, :1], sigma[:, :r], np.nan)
    for i, output in enumerate(s.columns_of(outputs).tolist()):
        # multipliers of the closure with a unit effort in the output, and self-stresses; least forces, and moments over the size
        loaded = U[:, np.searchsorted(free, output), :r] / sigma
        every = np.concatenate([loaded[:, None] @ V[:, :r], V[:, r:]], axis=1)
        w, p = here.pair_wrenches(every.transpose(2, 1, 0)), here.pair_points
        reactions = w.copy()
        for f in (of.column, output):
            own = reactions[:, s.pair_of_freedom[f]]
            own -= here.E[:, f, None] * (here.S[:, f, None] * own).sum(axis=0)
        # where forces act, as far as that moves on a link
        for wrenches, places in ((w, centers), (reactions, p)):
            wrenches[:3] -= cross(places[:, :, None], wrenches[3:])
        reactions[:3] /= sizes_of[case]
        least = np.nan_to_num(reactions.transpose(3, 0, 1, 2).reshape(here.T, -1, w.shape[2]))
        y = np.linalg.pinv(least[:, :, 1:]) @ least[:, :, :1]
        guide = int(s.pair_of_freedom[output])
        link = s.a[guide] if s.b[guide] == s.graph.frame else s.b[guide]
        pairs = np.flatnonzero(((s.a == link) | (s.b == link)) & (np.arange(len(s.a)) != guide))
        w = (w[:, :, 0] - np.einsum("cpst,ts->cpt", w[:, :, 1:], y[..., 0]))[:, pairs]
        turn = np.broadcast_to(here.S[:3, [output]], w[:3].shape)
        rates = np.concatenate([turn, here.S[3:, [output]] + cross(turn, centers[:, pairs])])
        does = (np.where(s.b[pairs] == link, 1.0, -1.0)[:, None] * (w * rates).sum(axis=0)).sum(axis=0)
        w, rates = (np.linalg.norm(v.reshape(2, 3, *v.shape[1:]), axis=1) for v in (w, rates))
        could = (w * rates).sum(axis=(0, 1))
        # what wrenches on the output could do for a unit effort, below which nothing is transmitted
        out[i] = np.arcsin(np.minimum(np.abs(does) / np.where(could > 1e-12, could, np.nan), 1.0))
    return np.asarray(out.min(axis=0))


class Measure:
    """A quantity of a mechanism that meets positions: ``size``, ``ratio``, ``transmission D``, an output of ``study``, or a function.

    It is taken at the positions, or ``over`` driver values, freedom -> values; ``asked`` tells by which argument.
    """

    def __init__(
        self, m: Mechanism, what: Output, over: Mapping[str, Any] | None = None, asked: str = "conditions"
    ) -> None:
        self.what, self.over, self.asked = what, over, asked
        self.of_dimensions = what in ("size", "ratio")
        self.output = what.removeprefix("transmission ") if isinstance(what, str) and "transmission " in what else None
        if self.output is not None and (fault := m.freedom_fault(self.output, single=True)):
            raise DeclarationError(f"synthesis of {m.name!r}", [f"{what!r}: {fault}"])
        if not self.of_dimensions and self.output is None:
            try:
                named_outputs(m, {str(what): what}, ())
            except DeclarationError as error:
                own = ("size", "ratio", *(f"transmission {name}" for name in m.freedom_names()))
                faults = [
                    f"{one}; {hint}" if (hint := did_you_mean(near_names(str(what), own))) else one
                    for one in error.faults
                ]
                raise DeclarationError(f"synthesis of {m.name!r}", faults) from None

    def __call__(self, m: Mechanism, q: Array, driver: str | None, smooth: bool = False) -> Array:
        """Its values ``(k,)`` of a mechanism at positions ``q (n, F)``, each by itself where the driver does not lead from the first
        to all; NaN ``over`` values to which it does not lead.

        ``smooth`` asks for smooth functions of the dimensions of which it is the largest one.
        """
        if self.of_dimensions and smooth:
            lengths = distances(m)
            return lengths if self.what == "size" else np.divide.outer(lengths, lengths).ravel()
        if self.of_dimensions:
            return np.array([sizes(m)[self.what == "ratio"]])
        names = m.freedom_names()
        m = m.replace(start=dict(zip(names, q[0].tolist(), strict=True)))
        drives = [drive.freedom for drive in m.drives] if driver is None else [driver]
        motions = self.over or {name: q[:, names.index(m.full_name(name))] for name in drives}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            try:
                s = solve(m, motions, on_reach="flag")
            except IndeterminateError as error:
                raise DeclarationError(f"synthesis of {m.name!r}", [f"{self._told}: {error}"]) from error
            if not self.over and len(q) > 1 and not _passes(s, q):
                return np.concatenate([self(m, q[[i]], driver, smooth) for i in range(len(q))])
            if self.output is not None:
                return transmission(s, self.output).transmission_angle.ravel()
            if not callable(self.what):
                return np.asarray(quantity(s, self.what, self.what), dtype=float).ravel()
            try:
                return np.asarray(self.what(s), dtype=float).ravel()
            except Exception as error:
                told = f"{self._told} raised {type(error).__name__}: {error}"
                raise DeclarationError(f"synthesis of {m.name!r}", [told]) from error

    @property
    def _told(self) -> str:
        return f"{self.asked}: {getattr(self.what, '__name__', repr(self.what))}"


def _passes(s: Solution, q: Array) -> bool:
    """Whether the positions of a solution are those with coordinates ``q (n, F)``, but for whole turns."""
    m = s.mechanism
    off = np.concatenate([s[pair.name].position.reshape(-1, pair.type.f) for pair in m.pairs], axis=1) - q
    turns = np.array([m.turns(name) for name in m.freedom_names()])
    off = np.where(turns, np.abs(np.exp(1j * off) - 1.0), np.abs(off))
    # what is followed may be rounded; NaN is nowhere
    return bool((off < 1e-6 * max(1.0, float(np.abs(q).max()))).all())


def limits_of(
    m: Mechanism, conditions: Any, over: Mapping[str, Any] | None, faults: list[str]
) -> list[tuple[str, Measure, float | None, float | None]]:
    """Conditions as quantities with their least and greatest values; what is wrong is put to ``faults``."""
    out = []
    items = conditions.items() if isinstance(conditions, Mapping) else ()
    if not isinstance(conditions, Mapping | None):
        faults.append(wrong(conditions, "conditions", "a mapping quantity -> (least, greatest)"))
    for what, ends in items:
        if not is_interval(two_ends(ends)):
            faults.append(wrong(ends, f"conditions[{what!r}]", "(least, greatest), None for no end"))
            continue
        least, most = (None if np.isinf(end) else end for end in two_ends(ends))
        try:
            out.append((getattr(what, "__name__", str(what)), Measure(m, what, over), least, most))
        except DeclarationError as error:
            faults += [f"conditions: {fault}" for fault in error.faults]
        else:
            if out[-1][1].output is not None and (least or 0.0) > np.pi / 2:
                faults.append(
                    wrong(
                        ends, f"conditions[{what!r}]", "transmission angles in radians, 1.5708 (a right angle) at most"
                    )
                )
    return out


def frame_outputs(m: Mechanism, driver: str) -> list[str]:
    """The freedoms that a driver moves at the frame: those of pairs with one freedom beside its own."""
    at_frame = [p for p in m.pairs if m.frame in (p.a, p.b) and p.type.f == 1]
    return [name for p in at_frame if (name := p.freedom_names[0]) != driver]


def distances(m: Mechanism) -> Array:
    """Distances of two elements of a link, of all links: named points, centers, axes (from each other the least), not slides, which have a
    direction alone; elements at one place left out.
    """
    none = np.zeros((3, 0))
    at: dict[str, list[tuple[Array, Array]]] = {
        link.name: [(np.asarray(p, dtype=float), none) for p in link.points.values()] for link in m.links
    }
    for pair in m.pairs:
        idle = none if pair.contact is not None else idle_moves(pair.type)
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True) if idle.shape[1] < 3 else ():
            at[link].append((np.asarray(marker.point, dtype=float), marker.pose()[:, :3] @ idle))
    out = []
    for elements in at.values():
        for (a, along), (b, other) in combinations(elements, 2):
            d, ways = a - b, np.concatenate([along, other], axis=1)
            out.append(np.linalg.norm(d - ways @ (np.linalg.pinv(ways, MODES.generic) @ d)))
    lengths = np.array(out)
    # elements nearer to each other, as part of the longest distance, are at one place
    return lengths[lengths > 1e-9 * lengths.max(initial=0.0)]


def sizes(m: Mechanism) -> tuple[float, float]:
    """The largest of all distances, and its ratio to the least one; NaN where there are none."""
    lengths = distances(m)
    longest = float(lengths.max(initial=0.0))
    return longest, longest / float(lengths.min(initial=np.inf)) if lengths.size else np.nan
