"""Tolerances, each with its reason; one frozen object a subject, passed on as a default and nowhere repeated."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RankTolerances:
    """When a singular value or a pivot counts as zero. Rows are those of a loop in its own measure, columns of unit size."""

    loop: float = 1e-9
    """Singular value of a loop's own rows; seven digits above rounding, so that printed geometry of ten digits stays redundant."""
    position: float = 1e-9
    """Singular value of all rows against the largest, and pivot of an elimination against unit rows; as for one loop."""
    generic: float = 1e-7
    """The same for random geometry of size one, where no dimension is meant to be special: far from rounding on both sides."""
    nearby: float = 1e-6
    """The same at positions reached by a motion: closing a double root to 1e-13 leaves 3e-7 of the way that returns."""
    proved: float = 1e-3
    """Pivot of a bordered system above which it proves the rank without another test."""
    distance: float = 1e-8
    """Distance to a singular matrix above which the bordered system decides the rank, whatever its pivots."""
    near: float = 1e-3
    """Margin of one loop below which a position is called nearly singular: forces are a thousand times the loads."""
    doubt: float = 1e-11
    """Largest dropped value above which it may be more than rounding."""
    damping: float = 1e-13
    """Square of the singular value (3e-7) below which the normal equations ignore a direction; rounding of a square is 1e-16."""


@dataclass(frozen=True)
class MotionTolerances:
    """When something counts as at rest. Motions are of size one; lengths over the length of the mechanism."""

    still: float = 1e-8
    """Part of a motion below which a freedom or a link stands still: the square root of rounding."""
    dependent: float = 1e-8
    """Part of a motion below which the weakest driver stands still: drivers depend on each other, or a dead point."""
    rounding: float = 1e-11
    """Part of a unit rate that counts as zero."""
    nearby: float = 1e-5
    """Part of a motion above which a freedom that stands still here moves at a nearby position, a trial step of 0.05 away."""
    common: float = 1e-9
    """Singular value against the largest below which twists of a border are common to its pairs; as for a rank."""
    in_place: float = 1e-5
    """Rate at which a pair element may leave its place in a passive motion; central differences of step 1e-4 are good to 1e-8."""
    tied: float = 1e-7
    """Singular value against the largest below which passive motions depend on each other."""
    proportional: float = 3e-5
    """Sine of the angle between the parts of two freedoms in the motions up to which they move in proportion."""
    idle: float = 1e-6
    """Part of the loads' power in a passive motion below which they leave it alone: inertias of five printed digits leave 1e-7."""
    error: float = 1e-9
    """Error of such a part that has to be expected near a singular position: near a dead point parts are small."""


@dataclass(frozen=True)
class StressTolerances:
    """When a part of a self-stress counts as zero. Self-stresses are of size one, moments over the length of the mechanism."""

    unique: float = 1e-7
    """Part in a component above which the component is not unique: far from rounding and from shares that are meant."""
    doubt: float = 1e-11
    """Part of a component called unique above which it may be more than rounding: rounding leaves 1e-13 in regular positions."""
    near: float = 1e-4
    """Part of a component that is not unique below which a small change of dimensions may make it so: where no dimension is meant to
    be nearly special, parts are 3e-3 and more (215 library, known and random mechanisms)."""
    shown: float = 1e-6
    """Part (of a largest part of one) below which a component is not shown."""
    drivers_alone: float = 1e-9
    """Part below which reactions count as none: drivers that strain each other alone."""
    rounding: float = 1e-12
    """Part of the largest multiplier by which one may miss the sign of its flank, so that rounding leaves a solution."""
    relieved: float = 1e-6
    """Power of a unit twist on a self-stress above which the twist relieves it."""


@dataclass(frozen=True)
class CheckTolerances:
    """When a solution fails its own checks."""

    balanced: float = 1e-6
    """Residual of equilibrium or power, over the largest term, above which a solution warns: as for ``PathTolerances.inaccurate``."""
    rounding: float = 1e-12
    """Forces, over mass times speed times angular speed, that are rounding of the motion: nothing is said of their equilibrium."""


RANKS = RankTolerances()
MOTIONS = MotionTolerances()
STRESSES = StressTolerances()
CHECKS = CheckTolerances()


@dataclass(frozen=True)
class PathTolerances:
    """Following a path of closed positions (see ``maths.tracker``)."""

    closed: float = 1e-14
    """Closure residual that Newton aims at: some roundings of numbers of size one; where it cannot be had, the smallest one there is."""
    accepted: float = 1e-11
    """Residual with which a position counts as closed where rounding lets it come no nearer (poor condition)."""
    iterations: int = 10
    """Most Newton steps at a position; from a good prediction two suffice, so that more mean a poor one."""
    lost: float = 0.3
    """Sum of corrections above which Newton stops: the correction exceeds the trust radius of the prediction."""
    correction: float = 0.06
    """Largest correction that a prediction may need; the certificate of the step asks for more than that."""
    aim: float = 0.02
    """Correction that the step control aims at: a third of what is allowed. One Newton step from there leaves 4e-4, which does for a node
    of the first march (all nodes are closed together afterwards)."""
    node: float = 1e-8
    """Last Newton step of a node that counts as closed: its square is rounding."""
    rates: float = 1e-6
    """Product of the last step and the condition number up to which a node is closed: its rates err by about as much."""
    rounding: float = 1e-14
    """Part of the condition number below which a Newton step is rounding."""
    exact: float = 1e-12
    """The same where many positions are interpolated between the nodes, so that their sensitivities must be exact as well."""
    first: float = 0.05
    """First step of a path, where there are no earlier nodes to predict from."""
    longest: float = 0.35
    """Longest step between nodes, unless tracks go straight on; longer ones would be refused by the certificate more often than not."""
    ahead: float = 3.0
    """Times that longest step up to which the first march may reach at once; nodes between are interpolated and closed with the others."""
    shortest_quick: float = 2e-3
    """Step at which the first march stops and the careful one takes over."""
    shortest: float = 1e-10
    """Step at which the careful march stops; the end of the reach is known to this, far above the rounding of a driver value."""
    quick_steps: int = 30_000
    """Most steps of a track in the first march (a thousand turns and more that do not repeat themselves): half a minute."""
    careful_steps: int = 4_000
    """The same in the careful march; past a crossing it takes some sixty."""
    steps_a_point: int = 20
    """Further steps of both for every point of the polyline that is followed."""
    straight: float = 0.98
    """Smallest ratio of chord to path between two nodes; a path that bends or turns back gets a node there."""
    departure: float = 0.7
    """Largest change of the closure matrix from the middle of a step to its ends, against its inverse in the middle: below one nothing
    on the parabola through the three is singular; what is left is for the third order, which three matrices do not show."""
    smooth: float = 0.05
    """Part of the change of rates over a step by which the rates in its middle may miss those of the Hermite cubic of its ends (and of
    the sagitta that it makes, by which the state may)."""
    alone: float = 0.05
    """Part of the inverse condition number, over rates above one, up to which another branch is not as near: matrices change by at most
    forty a radian (near the limits of four-bars the other branch is 170 times as far)."""
    round: float = 10.0
    """Curvature of curves and surfaces, over one of the length of the mechanism, above which that part falls: to half of a radius."""
    tiny: float = 1e-9
    """Distance between states below which ``smooth`` is not tested: differences of rounding and of numerical derivatives."""
    fair: float = 1e3
    """Condition number above which another choice of rows and columns is sought."""
    better: float = 0.2
    """Part of the condition number that another choice must undercut to be taken."""
    independent: float = 1e-8
    """Part of the closure rates that unit rates of the drivers may leave open before drivers count as dependent on each other."""
    singular: float = 1e9
    """Condition number above which a position counts as a dead point: rates would keep fewer than seven digits."""
    dead_point: float = 1e-10
    """Distance to a dead point (in driver coordinates) below which a position counts as one."""
    scatter: float = 1e-2
    """Part by which rounding may change accelerations before a position counts as one: beside a crossing of branches, not near a fold."""
    doubtful: float = 1e4
    """Condition number above which the distance to a dead point is computed."""
    square: float = 5.0
    """Condition number above which errors of rates are taken to grow with its square: so they do towards a fold."""
    cube: float = 100.0
    """The same for the cube, as beside a crossing. Estimates from both are within a factor of ten of the errors of four-bars beside change
    points (against 50 digits), and up to a hundred times those of ordinary positions."""
    poor: float = 300.0
    """Condition number above which what rounding does to accelerations is tried, not estimated; few mechanisms come there."""
    inaccurate: float = 1e-6
    """Estimated relative error of rates and forces above which a solution warns: six digits are what dimensions are known to."""
    dead_zone: float = 1e-7
    """Distance from the end of a path up to which a requested position counts as the dead point itself."""
    crossing: float = 3e6
    """Condition number at which the careful march stops before a crossing: rounding over it is far below the distance of the branches
    there; at a fold the end of the reach is nearer than ``shortest`` before."""
    away: float = 2e-3
    """Distance before a singular point at which its rates are compared with those next to it."""
    steeper: float = 10.0
    """Factor by which they grow towards a fold, which is met to ``shortest``: by thousands; towards a crossing they stay."""
    held: float = 3.0
    """Largest rate of a freedom for a unit rate of the freedom that holds a passive motion, before another one holds it."""
    interpolation: float = 3e-14
    """Error of interpolation that needs no correction."""
    gain: float = 1e-3
    """Part of that error that nodes twice as dense leave at most (the order is twelve, 2^-12)."""
    window: int = 6
    """Most nodes through which one interpolation goes, each with value and rate."""
    worth: int = 20
    """Positions for every new node above which new nodes save time (fewer corrections of positions)."""
    finest: int = 6
    """Most halvings of a step for its certificate: what is left open then is beside a singular point, which the careful march takes."""
    halvings: int = 4
    """Most halvings of a gap between nodes at a time."""
    refinements: int = 5
    """Times that nodes are put between nodes at most."""


PATH = PathTolerances()


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


SHAPES = ShapeTolerances()
