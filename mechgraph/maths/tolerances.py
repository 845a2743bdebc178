"""Tolerances, each with its reason: one frozen object, of which the running call reads what it was asked with.

``RANKS``, ``MOTIONS``, ``STRESSES``, ``CHECKS``, ``PATH``, ``MODES`` and ``RESPONSE`` are the parts of the object that applies to
the running call: the default one, or the one that its mechanism carries (see ``memo.Remembers``). They are read where they are needed,
never when a module is loaded.
"""

# annotations are read at run time here: they hold the reasons
from collections.abc import Iterator, Mapping
from dataclasses import field, fields
from functools import partial
from typing import Annotated, Any, ClassVar, cast, get_type_hints

from mechgraph.errors import DeclarationError
from mechgraph.memo import ASKED, class_cached, dataclass
from mechgraph.quantities import is_numeric, wrong


@dataclass(frozen=True)
class RankTolerances:
    """When a singular value or a pivot counts as zero. Rows are those of a loop in its own measure, columns of unit size."""

    loop: Annotated[
        float,
        "Singular value of a loop's own rows; seven digits above rounding, so that printed geometry of ten digits stays "
        "redundant.",
    ] = 1e-9
    position: Annotated[
        float,
        "Singular value of all rows against the largest, and pivot of an elimination against unit rows; as for one loop.",
    ] = 1e-9
    generic: Annotated[
        float,
        "The same for random geometry of size one, where no dimension is meant to be special: far from rounding on both sides.",
    ] = 1e-7
    nearby: Annotated[
        float,
        "The same at positions reached by a motion: closing a double root to 1e-13 leaves 3e-7 of the way that returns.",
    ] = 1e-6
    proved: Annotated[
        float, "Pivot of a bordered system above which its distance to a singular one need not be above ``distance``."
    ] = 1e-3
    distance: Annotated[
        float, "Distance to a singular matrix above which the bordered system decides the rank whatever its pivots."
    ] = 1e-8
    near: Annotated[
        float,
        "Margin of one loop below which a position is called nearly singular: forces are a thousand times the loads.",
    ] = 1e-3
    doubt: Annotated[float, "Largest dropped value above which it may be more than rounding."] = 1e-11
    damping: Annotated[
        float,
        "Square of the singular value (3e-7) below which the normal equations ignore a direction; rounding of a square is "
        "1e-16.",
    ] = 1e-13


@dataclass(frozen=True)
class MotionTolerances:
    """When something counts as at rest. Motions are of size one; lengths over the length of the mechanism."""

    still: Annotated[
        float, "Part of a motion below which a freedom or a link stands still: the square root of rounding."
    ] = 1e-8
    dependent: Annotated[
        float,
        "Part of a motion below which the weakest driver stands still: drivers depend on each other, or a dead point.",
    ] = 1e-8
    rounding: Annotated[float, "Part of a unit rate that counts as zero."] = 1e-11
    nearby: Annotated[
        float,
        "Part of a motion above which a freedom that stands still here moves at a nearby position, a trial step of 0.05 away.",
    ] = 1e-5
    common: Annotated[
        float,
        "Singular value against the largest below which twists of a border are common to its pairs; as for a rank.",
    ] = 1e-9
    in_place: Annotated[
        float,
        "Rate at which a pair element may leave its place in a passive motion; central differences of step 1e-4 are good to "
        "1e-8.",
    ] = 1e-5
    tied: Annotated[float, "Singular value against the largest below which passive motions depend on each other."] = (
        1e-7
    )
    proportional: Annotated[
        float, "Sine of the angle between the parts of two freedoms in the motions up to which they move in proportion."
    ] = 3e-5
    idle: Annotated[
        float,
        "Part of the loads' power in a passive motion below which they leave it alone: inertias of five printed digits leave "
        "1e-7.",
    ] = 1e-6
    error: Annotated[
        float,
        "Error of such a part that has to be expected near a singular position: near a dead point parts are small.",
    ] = 1e-9


@dataclass(frozen=True)
class StressTolerances:
    """When a part of a self-stress counts as zero. Self-stresses are of size one, moments over the length of the mechanism."""

    unique: Annotated[
        float,
        "Part in a component above which the component is not unique: far from rounding and from shares that are meant.",
    ] = 1e-7
    doubt: Annotated[
        float,
        "Part of a component called unique above which it may be more than rounding: rounding leaves 1e-13 in regular "
        "positions.",
    ] = 1e-11
    near: Annotated[
        float,
        "Part of a component that is not unique below which a small change of dimensions may make it so: where no dimension is "
        "meant to be nearly special, parts are 3e-3 and more (215 library, known and random mechanisms).",
    ] = 1e-4
    shown: Annotated[float, "Part (of a largest part of one) below which a component is not shown."] = 1e-6
    drivers_alone: Annotated[
        float, "Part below which reactions count as none: drivers that strain each other alone."
    ] = 1e-9
    rounding: Annotated[
        float,
        "Part of the largest multiplier by which one may miss the sign of its flank, so that rounding leaves a solution.",
    ] = 1e-12
    relieved: Annotated[float, "Power of a unit twist on a self-stress above which the twist relieves it."] = 1e-6


@dataclass(frozen=True)
class CheckTolerances:
    """When a solution fails its own checks."""

    balanced: Annotated[
        float,
        "Residual of equilibrium or power, over the largest term, above which a solution warns: as for "
        "``PathTolerances.inaccurate``.",
    ] = 1e-6
    rounding: Annotated[
        float,
        "Forces, over mass times speed times angular speed, that are rounding of the motion: nothing is said of their "
        "equilibrium.",
    ] = 1e-12


@dataclass(frozen=True)
class PathTolerances:
    """Following a path of closed positions (see ``maths.tracker``)."""

    closed: Annotated[
        float,
        "Closure residual that Newton aims at: some roundings of numbers of size one; where it cannot be had, the smallest one "
        "there is.",
    ] = 1e-14
    accepted: Annotated[
        float, "Residual with which a position counts as closed where rounding lets it come no nearer (poor condition)."
    ] = 1e-11
    iterations: Annotated[
        int, "Most Newton steps at a position; from a good prediction two suffice, so that more mean a poor one."
    ] = 10
    lost: Annotated[
        float, "Sum of corrections above which Newton stops: the correction exceeds the trust radius of the prediction."
    ] = 0.3
    correction: Annotated[
        float, "Largest correction that a prediction may need; the certificate of the step asks for more than that."
    ] = 0.06
    aim: Annotated[
        float,
        "Correction that the step control aims at: a third of what is allowed. One Newton step from there leaves 4e-4, which "
        "does for a node of the first march (all nodes are closed together afterwards).",
    ] = 0.02
    node: Annotated[float, "Last Newton step of a node that counts as closed: its square is rounding."] = 1e-8
    rates: Annotated[
        float,
        "Product of the last step and the condition number up to which a node is closed: its rates err by about as much.",
    ] = 1e-6
    rounding: Annotated[float, "Part of the condition number below which a Newton step is rounding."] = 1e-14
    first: Annotated[float, "First step of a path, where there are no earlier nodes to predict from."] = 0.05
    longest: Annotated[
        float,
        "Longest step between nodes, unless tracks go straight on; longer ones would be refused by the certificate more often "
        "than not.",
    ] = 0.35
    ahead: Annotated[
        float,
        "Times that longest step up to which the first march may reach at once; nodes between are interpolated and closed with "
        "the others.",
    ] = 3.0
    shortest_quick: Annotated[float, "Step at which the first march stops and the careful one takes over."] = 2e-3
    shortest: Annotated[
        float,
        "Step at which the careful march stops; the end of the reach is known to this, far above the rounding of a driver "
        "value.",
    ] = 1e-10
    quick_steps: Annotated[
        int,
        "Most steps of a track in the first march (a thousand turns and more that do not repeat themselves): half a minute.",
    ] = 30_000
    careful_steps: Annotated[int, "The same in the careful march; past a crossing it takes some sixty."] = 4_000
    steps_a_point: Annotated[int, "Further steps of both for every point of the polyline that is followed."] = 20
    straight: Annotated[
        float, "Smallest ratio of chord to path between two nodes; a path that bends or turns back gets a node there."
    ] = 0.98
    departure: Annotated[
        float,
        "Largest change of the closure matrix from the middle of a step to its ends, against its inverse in the middle: below "
        "one nothing on the parabola through the three is singular; what is left is for the third order, which three matrices "
        "do not show.",
    ] = 0.7
    smooth: Annotated[
        float,
        "Part of the change of rates over a step by which the rates in its middle may miss those of the Hermite cubic of its "
        "ends (and of the sagitta that it makes, by which the state may).",
    ] = 0.05
    alone: Annotated[
        float,
        "Part of the inverse condition number, over rates above one, up to which another branch is not as near: matrices change "
        "by at most forty a radian (near the limits of four-bars the other branch is 170 times as far).",
    ] = 0.05
    round: Annotated[
        float,
        "Curvature of curves and surfaces, over one of the length of the mechanism, above which that part falls: to half of a "
        "radius.",
    ] = 10.0
    tiny: Annotated[
        float,
        "Distance between states below which ``smooth`` is not tested: differences of rounding and of numerical derivatives.",
    ] = 1e-9
    fair: Annotated[float, "Condition number above which another choice of rows and columns is sought."] = 1e3
    better: Annotated[float, "Part of the condition number that another choice must undercut to be taken."] = 0.2
    independent: Annotated[
        float,
        "Part of the closure rates that unit rates of the drivers may leave open before drivers count as dependent on each "
        "other.",
    ] = 1e-8
    singular: Annotated[
        float,
        "Condition number above which a position counts as a dead point: rates would keep fewer than seven digits.",
    ] = 1e9
    dead_point: Annotated[
        float, "Distance to a dead point (in driver coordinates) below which a position counts as one."
    ] = 1e-10
    scatter: Annotated[
        float,
        "Part by which rounding may change accelerations before a position counts as one: beside a crossing of branches, not "
        "near a fold.",
    ] = 1e-2
    doubtful: Annotated[float, "Condition number above which the distance to a dead point is computed."] = 1e4
    square: Annotated[
        float,
        "Condition number above which errors of rates are taken to grow with its square: so they do towards a fold.",
    ] = 5.0
    cube: Annotated[
        float,
        "The same for the cube, as beside a crossing. Estimates from both are within a factor of ten of the errors of four-bars "
        "beside change points (against 50 digits), and up to a hundred times those of ordinary positions.",
    ] = 100.0
    poor: Annotated[
        float,
        "Condition number above which what rounding does to accelerations is tried, not estimated; few mechanisms come there.",
    ] = 300.0
    inaccurate: Annotated[
        float,
        "Estimated relative error of rates and forces above which a solution warns: six digits are what dimensions are known "
        "to.",
    ] = 1e-6
    dead_zone: Annotated[
        float, "Distance from the end of a path up to which a requested position counts as the dead point itself."
    ] = 1e-7
    crossing: Annotated[
        float,
        "Condition number at which the careful march stops before a crossing: rounding over it is far below the distance of the "
        "branches there; at a fold the end of the reach is nearer than ``shortest`` before.",
    ] = 3e6
    away: Annotated[
        float, "Distance before a singular point at which its rates are compared with those next to it."
    ] = 2e-3
    steeper: Annotated[
        float,
        "Factor by which they grow towards a fold, which is met to ``shortest``: by thousands; towards a crossing they stay.",
    ] = 10.0
    held: Annotated[
        float,
        "Largest rate of a freedom for a unit rate of the freedom that holds a passive motion, before another one holds it.",
    ] = 3.0
    window: Annotated[int, "Most nodes through which one interpolation goes, each with value and rate."] = 6
    finest: Annotated[
        int,
        "Most halvings of a step for its certificate: what is left open then is beside a singular point, which the careful "
        "march takes.",
    ] = 6


@dataclass(frozen=True)
class ModeTolerances:
    """Finding all assemblies and following their branches (see ``modes``)."""

    span: Annotated[float, "Part of a twist outside a span up to which it lies in it."] = 1e-6
    member_closed: Annotated[float, "Closure error up to which a member of a class counts as closed."] = 1e-9
    generic: Annotated[
        float, "Singular value, as part of the largest, below which it counts as zero at random members."
    ] = 1e-7
    vanished: Annotated[float, "What stands for a curvature of zero, by which is divided."] = 1e-200
    singular: Annotated[
        float,
        "Smallest singular value of the closure rows, as part of the largest, below which an assembly is looked at more "
        "closely.",
    ] = 1e-5
    away: Annotated[
        float,
        "Step along motions that the rows leave free, after which a continuum is still closed: closing takes back what rows "
        "hold to a rank.",
    ] = 1e-2
    curved: Annotated[float, "Step of second differences: their rounding is 1e-10."] = 1e-3
    same_place: Annotated[float, "Difference of what does not move up to which two points are of one continuum."] = 1e-5
    slide: Annotated[float, "Turn of a marker below which it slides."] = 1e-9
    most_noise: Annotated[float, "Rounding with which a track may end."] = 1e-5
    noise_apart: Annotated[
        float,
        "Difference of solutions of a task, or of how they move, against their size, that no rounding of two runs makes: up to "
        "3e-5 where dimensions are thousands; of some tasks two in a thousand differ by less.",
    ] = 1e-4
    pole_range: Annotated[float, "Size of ``z`` or ``1 / z`` up to which poles are sampled."] = 200.0
    one_assembly: Annotated[
        float, "Difference of link poses, against their size, up to which two assemblies are one."
    ] = 1e-6
    radius: Annotated[float, "Distance from its end at which a track is led round."] = 0.04
    real_singular: Annotated[
        float,
        "Difference of link poses at which ends may be one, or real, where rows are singular, so that they are known to the "
        "root of rounding.",
    ] = 1e-3
    known_moved: Annotated[
        float,
        "Change of what is known (radians, lengths over L) at which a group must still be a member of its class.",
    ] = 0.3
    ball: Annotated[
        float, "Size of the increments (radians, lengths / L) within which second derivatives are bounded."
    ] = 0.05
    bound_rounding: Annotated[
        float,
        "Factor that stands for the rounding of bounds of second derivatives, and of bases that are orthonormal to rounding.",
    ] = 1.01
    off_dead_point: Annotated[
        float,
        "Motion (radians, or lengths over L) of what moves most from a singular start to where the class is read.",
    ] = 0.3
    real_closed: Annotated[float, "Closure error of what is real in the equations that are solved: some roundings."] = (
        1e-12
    )
    unfit: Annotated[
        float,
        "Closure error from which on a rod that has no row does not fit; between this and that of what is closed it is open "
        "whether it does.",
    ] = 1e-3
    arrives: Annotated[float, "Difference of link poses up to which a piece arrives at an assembly."] = 1e-6
    touches: Annotated[
        float,
        "Difference of link poses at a fold or a crossing: they grow with the root of the distance from a fold.",
    ] = 1e-3
    slide_stroke: Annotated[
        float, "Range of a driven slide to both sides of the start, over L, where none is given."
    ] = 2.0


@dataclass(frozen=True)
class ResponseTolerances:
    """Motion in time, equilibria and small motions (see ``response``)."""

    steepest: Annotated[
        float,
        "Largest rate of a freedom for unit rates of the independent ones, against that where the chart was laid out, before a "
        "new one is; so of a condition that is poor.",
    ] = 3.0
    last_step: Annotated[
        float,
        "Newton step from which on a state counts as closed; the step before it was a millionth, so that only rounding is "
        "left.",
    ] = 1e-13
    massless: Annotated[
        float, "Eigenvalue of the mass matrix, of which the diagonal is one, below which a motion has no inertia."
    ] = 1e-12
    unopposed: Annotated[
        float, "Part of the largest generalized force below which none acts along a motion without inertia."
    ] = 1e-9
    noise_of_motion: Annotated[float, "Part of a prescribed position or rate that is rounding of it."] = 1e-13
    halvings_alike: Annotated[
        int,
        "Halvings in which the part by which a rate is off stays alike, in both halves, where the rate is wrong.",
    ] = 6
    around_crossing: Annotated[
        float,
        "Length of the piece with a change point in its middle: the accelerations of states beside it lose rounding over the "
        "cube of the distance, 5e-12 at the nearest point of the series.",
    ] = 0.64
    at_crossing: Annotated[float, "Distance from a change point up to which a place counts as it."] = 0.01
    periodic: Annotated[
        float,
        "Difference of poses (and part of the largest term) after a turn of the coordinate up to which the path has come back.",
    ] = 1e-9
    look: Annotated[int, "Steps after which the length of steps is looked at."] = 500
    touching: Annotated[float, "Gap (radians, lengths / L) up to which a stop counts as closed."] = 1e-9
    lowest: Annotated[
        float,
        "Height (radians, lengths / L) of a rebound below which the freedom rests on its stop; what it loses is of that order.",
    ] = 1e-9
    soon: Annotated[
        float, "Part of the time that is left within which impacts and releases follow each other at once."
    ] = 1e-9
    lost_energy: Annotated[
        float,
        "Error of the balance of energies, of the greatest one, from which on a motion in time is doubtful.",
    ] = 1e-3
    corner: Annotated[
        float,
        "Difference of the slopes to both sides, or of the values there, of the largest, that is one where it does not fall "
        "with the length.",
    ] = 1e-6
    falls: Annotated[
        float, "Part of such a difference that is left at the next length where it falls: a quarter of what is smooth."
    ] = 0.5
    first_difference: Annotated[
        float,
        "First length of differences (radians, lengths / L); their error and rounding are both near 1e-13 where forces bend "
        "within 0.3.",
    ] = 0.004
    equilibrium_steps: Annotated[int, "Most steps to an equilibrium."] = 60
    longest_equilibrium_step: Annotated[float, "Longest step to an equilibrium (radians, lengths / L)."] = 0.3
    push: Annotated[float, "Length of the step by which an unstable equilibrium is left."] = 0.05
    balanced: Annotated[
        float, "Generalized force, against the largest that a load exerts on the way, that counts as none."
    ] = 1e-12
    stiff: Annotated[
        float, "Eigenvalue of the stiffness, against the largest, that counts as none: neither stable nor unstable."
    ] = 1e-9


@dataclass(frozen=True)
class ShapeTolerances:
    """When what is declared of shapes and places counts as met. Lengths over the extent of the shape, angles in radians."""

    met: float = 1e-6
    """Distance of a pair from its curve or surface, of gears from where their teeth ask for, of a second direction from the right angle;
    more where the mechanism is declared with a larger ``tol``."""
    even: float = 1e-9
    """Spread of tangents up to which a curve is straight or plane, gap at which it is closed, angle by which its frame comes back turned,
    and difference of two curvatures: seven digits above rounding."""
    standstill: float = 1e-7
    """Part of its greatest speed below which a curve stands still, as at a cusp."""
    place: float = 1e-14
    """Part of the greatest length to which a place found on a shape is rounded, so that the place of that place is the same: some fifty
    roundings."""
    parallel: float = 1e-12
    """What the cosine between axis and second direction lacks of one where they are parallel."""


COMPLEX_STEP = 1e-30
"""Imaginary step of a derivative, exact where all is analytic: its square is no number beside one."""

SHAPES = ShapeTolerances()
"""Of declared things, which know no call: the same for all."""


PARTS: dict[str, type] = {
    "rank": RankTolerances,
    "motion": MotionTolerances,
    "stress": StressTolerances,
    "check": CheckTolerances,
    "path": PathTolerances,
    "modes": ModeTolerances,
    "response": ResponseTolerances,
}


def _reasons(part: type) -> dict[str, str]:
    hints = get_type_hints(part, include_extras=True)
    return {f.name: hints[f.name].__metadata__[0] for f in fields(part)}


def _listed(text: str, cls: type) -> str:
    """The docstring with all fields, their defaults and reasons."""
    lines = [f"{text}\n    All of them, with their default values:"]
    for name, part in PARTS.items():
        lines.append(f"\n    {name}: {(part.__doc__ or '').strip()}")
        lines += [f"        {f} = {getattr(part(), f):g} : {why}" for f, why in _reasons(part).items()]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, repr=False)
class Tolerances:
    """Show every number that decides when something counts as zero, closed, singular or too long a step; change some for a call.

    Parameters
    ----------
    rank, motion, stress, check, path, modes, response : mapping of str to float, optional
        Numbers other than the default ones, by their names. Dimensionless: angles in radians, lengths over the length of the mechanism.

    Raises
    ------
    DeclarationError
        With every name that is none, and every number that is not finite and above 0.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.Tolerances().rank.loop
    1e-09
    >>> coarse = mg.Tolerances(rank={"loop": 1e-4, "position": 1e-4})
    >>> mg.check(mg.load("four-bar"), tolerances=coarse).redundancy
    3
    """

    rank: RankTolerances = field(default_factory=RankTolerances)
    motion: MotionTolerances = field(default_factory=MotionTolerances)
    stress: StressTolerances = field(default_factory=StressTolerances)
    check: CheckTolerances = field(default_factory=CheckTolerances)
    path: PathTolerances = field(default_factory=PathTolerances)
    modes: ModeTolerances = field(default_factory=ModeTolerances)
    response: ResponseTolerances = field(default_factory=ResponseTolerances)
    _wanted: ClassVar[str] = "Tolerances, as mg.Tolerances(rank={'loop': 1e-6})"

    def __post_init__(self) -> None:
        faults: list[str] = []
        for name, part in PARTS.items():
            given = getattr(self, name)
            if isinstance(given, Mapping):
                object.__setattr__(self, name, _part(name, part, given, faults))
            elif not isinstance(given, part):
                faults.append(wrong(given, name, f"numbers by name, of {', '.join(_reasons(part))}"))
        if faults:
            raise DeclarationError("Tolerances", faults)

    @property
    def asked(self) -> "Tolerances | None":
        """What calls go by: None where these are the default ones."""
        return None if self == Tolerances() else self

    @property
    def changed(self) -> str:
        """The numbers that are not the default ones."""
        return ", ".join(told for told, other, _ in self._told() if other)

    def __repr__(self) -> str:
        return "\n".join(f"{told}: {why}" for told, _, why in self._told())

    def _told(self) -> Iterator[tuple[str, bool, str]]:
        for name, part in PARTS.items():
            mine, usual = getattr(self, name), part()
            for f, why in _reasons(part).items():
                value, default = getattr(mine, f), getattr(usual, f)
                other = value != default
                yield f"{name}.{f} = {value:g}{f' (default {default:g})' if other else ''}", other, why


Tolerances.__doc__ = class_cached(partial(_listed, Tolerances.__doc__ or ""), "__doc__", Tolerances)  # type: ignore[assignment]


def _part(name: str, part: type, given: Mapping[str, Any], faults: list[str]) -> Any:
    usual, known = part(), {}
    for key, value in given.items():
        if not hasattr(usual, str(key)):
            faults.append(wrong(key, f"name in {name}", f"one of {', '.join(_reasons(part))}"))
            continue
        whole = isinstance(getattr(usual, key), int)
        if not is_numeric(value, ()) or not 0.0 < value < float("inf") or (whole and value != int(value)):
            faults.append(wrong(value, f"{name}.{key}", "a whole number above 0" if whole else "a number above 0"))
        else:
            known[key] = int(value) if whole else float(value)
    return part(**known)


class _Asked:
    """One part of the tolerances of the running call."""

    def __init__(self, part: str) -> None:
        self._part = part

    def __getattr__(self, name: str) -> Any:
        asked = ASKED.get()
        return getattr(PARTS[self._part] if asked is None else getattr(asked, self._part), name)


RANKS = cast(RankTolerances, _Asked("rank"))
MOTIONS = cast(MotionTolerances, _Asked("motion"))
STRESSES = cast(StressTolerances, _Asked("stress"))
CHECKS = cast(CheckTolerances, _Asked("check"))
PATH = cast(PathTolerances, _Asked("path"))
MODES = cast(ModeTolerances, _Asked("modes"))
RESPONSE = cast(ResponseTolerances, _Asked("response"))
