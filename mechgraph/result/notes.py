"""What is told beside the numbers of a solution: positions without values and what gives them one, and what friction leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from mechgraph.force.friction import Came
from mechgraph.kinematics.motion_path import Status
from mechgraph.kinematics.prescribed import coordinate
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive
from mechgraph.model.friction import WAYS, Friction, coupling_of
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import FORCE, MOMENT, angle_hint, unit_of
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import OK, PositionLabels
from mechgraph.result.views import BeltResult, CouplingResult, PairResult

WHY_NOT = {
    Status.DEAD_POINT: (
        "is a dead point{meet}", "the drivers do not determine the motion there; drive another freedom, or leave such positions out"),
    Status.BEYOND_DEAD_POINT: ("is beyond a dead point; reached {at}{meet}",
        "the way there leads through a dead point; drive another freedom, or leave such positions out"),
    Status.OUT_OF_REACH: ("is not reachable (status 'out of reach'); the motion stops at {at}{far}",
        "the drivers do not get there on this branch; take values within reach, or another start"),
    Status.CHANGE_POINT: ("is a change point", "branches cross, so no effort of the drivers balances every load and forces are NaN; take "
        "positions beside it, or drive a freedom on the other side too"),
    Status.ACTUATORS_REST: ("is a dead point of actuate=",
        "the freedoms of actuate= rest while the mechanism moves, so forces are NaN; actuate another freedom"),
    Status.NOT_CLOSED: (
        "is not closed; last position {at}", "within reach, but the closure residual stays above round-off; start closer"),
    Status.NOT_FOLLOWED: ("was not reached; last position {at}",
        "the step limit was reached on the way; start closer, or ask for positions in between"),
    Status.BEYOND_TOLERANCE: ("exceeds tol; closure residual of the declared geometry: {miss:.3g}, over all positions {most:.3g}",
        "the geometry as declared does not close to tol there; pass a larger tol="),
    Status.JAMS: ("jams at {factor:.4g} times the friction declared", "the normal forces in {pairs} grow without bound before friction has "
        "its full size; less friction, longer guides, or a drive closer to the axis would move it"),
    Status.NO_FINITE_FORCE: ("has no finite force from {factor:.4g} times the friction declared on",
        "with friction in {pairs} the solution ends before friction has its full size; less friction would move it"),
    Status.FRICTION_OPEN: ("", "friction of {pairs} has no one value, so forces are NaN: {why}"),
    Status.LIFTS_OFF: ("", "{pairs} only push and cannot bear the loads, as of a table that tips over, so forces are NaN; press on it, set "
        "them wider, or hold them on both sides (closed='form')"),
}  # fmt: skip
"""What the error says of one position, and why positions have no values and what gives them some, by status."""
OPEN = {
    Came.SEVERAL: "more than one set of normal forces agrees with it. Less friction would leave one",
    Came.NOT_UNIQUE: "it follows reactions that are not unique. ",
    Came.UNSETTLED: "the places at which bodies touch do not settle beside it. Less friction would let them",
    Came.FEET: "pairs that only push would pull, or be pressed without bound; they may lift before. Less friction, feet set wider, or a "
    "lower drive would keep them down",
    Came.FLANKS: "teeth would press on neither flank beside it. Less friction, or a load between the teeth, would settle it",
}
"""The same of friction that is not determined."""
PULLS = "a pair that only pushes would have to pull there even without friction, and lifts off; press on it"
"""Why the ends of what holds at rest are not known where forces are."""


@dataclass(frozen=True)
class NotSolved:
    """Flat ``positions`` without values: their ``status``, the ``pairs`` that it comes from, why, and what gives them a value."""

    status: str
    positions: tuple[int, ...]
    pairs: tuple[str, ...]
    why: str
    where: str

    @property
    def text(self) -> str:
        """The warning in one sentence."""
        return f"{self.status} {self.where}: {self.why}"

    def __str__(self) -> str:
        return self.text


def not_solved(values: Trajectory) -> Iterator[NotSolved]:
    """Positions that are not solved, by status; of friction that is not determined by its reason too."""
    status, why = PositionLabels(values).status, values.why_open
    for name in dict.fromkeys(status[status != OK].tolist()):
        for reason in dict.fromkeys(why[status == name].tolist()):
            at = np.flatnonzero((status == name) & (why == reason))
            pairs = _pairs_of(values, Status(name), at)
            of = ", ".join(pairs) or "the pairs that rub"
            text = WHY_NOT[Status(name)][1].format(pairs=of, why=_open(values, reason))
            yield NotSolved(name, tuple(at.tolist()), pairs, text, _where(values, at))


def _open(values: Trajectory, reason: int) -> str:
    """Why friction is not determined, and what would determine it."""
    split = "Pass redundant='elastic' with stiffness= of these pairs (or 'minimum_norm')"
    if values.split_by_stiffness:
        split = "Give stiffness= to the components that are still rigid"
    more = f"{split}, or take a redundant constraint away" if reason == Came.NOT_UNIQUE else ""
    return OPEN.get(Came(reason), "several states of it agree with the motion") + more


def _pairs_of(values: Trajectory, status: Status, at: Index) -> tuple[str, ...]:
    """The pairs that a status at positions comes from."""
    if status is Status.LIFTS_OFF:
        return tuple(p.name for p in values.whole.pairs if p.closed == "force")
    if status in (Status.JAMS, Status.NO_FINITE_FORCE, Status.FRICTION_OPEN):
        return tuple(dict.fromkeys(name for i in at for name in values.friction_factor(int(i))[1]))
    return ()


def _where(values: Trajectory, at: Index) -> str:
    """Which of the positions: the first range of them, and how many."""
    places, count = PositionLabels(values), int(np.prod(values.batch))
    end = at[np.flatnonzero(np.diff(at, append=-1) != 1)[0]]
    span = " to ".join(dict.fromkeys(places.full_name(int(i)) for i in (at[0], end)))
    more = "" if end == at[-1] else ", ..."
    return f"at {len(at)} of {count} positions ({span}{more})" if count > 1 else f"at {span}"


@dataclass(frozen=True)
class Remark:
    """What is to be known of a pair, belt or freedom ``name``, in a sentence."""

    name: str
    text: str

    def __str__(self) -> str:
        return self.text


def angle_remarks(values: Trajectory) -> Iterator[Remark]:
    """Of turns that are driven, without times, see ``doubted_angles``."""
    names = values.prescribed if values.t is None else ()
    places = [values.whole.freedom_names().index(name) for name in names]
    at = values.coordinates_at(np.arange(values.status().size))[places]
    return doubted_angles(values.whole, dict(zip(names, at, strict=True)))


def doubted_angles(m: Mechanism, values: Mapping[str, Any]) -> Iterator[Remark]:
    """Angles given by name as whole numbers beyond two turns: radians hardly are, degrees are."""
    for name, at in values.items():
        at = np.atleast_1d(at)
        told = (
            angle_hint(float(max(at, key=abs, default=0.0)))
            if coordinate(m, name) is True and (at == np.round(at)).all()
            else ""
        )
        if told:
            yield Remark(name, f"{name}: {told}; for degrees write np.deg2rad(...)")


def friction_notes(values: Trajectory) -> Iterator[Remark]:
    """Positions at rest, moments that rub nothing, coefficients at which the circle and the whole force differ, belts that slip."""
    m = values.whole
    if values.rubbing and values.has_forces:
        # what sticks in a motion under loads has its friction: there efforts have no ends
        known = [(values.effort_range(k), PairResult(values, k).effort) for k in range(len(m.pairs))]
        between = [(ends[..., 0] < ends[..., 1]) | (np.isnan(ends).any(-1) & ~np.isnan(at)) for ends, at in known]
        held = np.concatenate(between, axis=-1).any(axis=-1)
        if rests := int(held.sum()):
            text = f"friction has no direction at {rests} of {held.size} positions, where nothing moves: efforts there are those "
            text += "without it. Give velocity= for a motion; s[...].effort_range has the ends between which it holds"
            yield Remark(values.rubbing[0], text)
        unknown = np.concatenate([np.isnan(ends).any(-1) & ~np.isnan(at) for ends, at in known], axis=-1).any(axis=-1)
        for reason in dict.fromkeys(values.why_open[unknown.reshape(-1)].tolist()):
            places = np.flatnonzero(unknown.reshape(-1) & (values.why_open == reason))
            pairs = _pairs_of(values, Status.FRICTION_OPEN, places)
            why = f"friction of {', '.join(pairs)}: {_open(values, reason)}" if reason else PULLS
            text = f"the efforts between which it holds at rest are not known {_where(values, places)}: {why}"
            yield Remark(pairs[0] if pairs else values.rubbing[0], text)
    for load in (load for load in values.loads if isinstance(load, Friction) and values.has_forces):
        if load.of in m.pair_index:
            yield from _notes_of_pair(values, load.with_numbers(values.number))
        elif "wrap" in (belt := coupling_of(m, load)).rubs:
            whole = isinstance(belt, BeltDrive)
            of = BeltResult(values, load.of) if whole else CouplingResult(values, m.couplings.index(belt))
            least = np.nanmin(
                [*of.slip_margin.values()] if isinstance(of, BeltResult) else of.slip_margin, initial=np.inf
            )
            if least < 0:
                why = f"belt {load.of} slips (slip_margin down to {least:.3g}): its strands differ by more than e^(mu wrap)"
                if not whole and not np.any(load.preload):
                    why += "; an mg.Belt has no tension in its slack strand, give it by preload="
                yield Remark(load.of, why)


def _notes_of_pair(values: Trajectory, load: Friction) -> Iterator[Remark]:
    where, result = f"friction of {load.of}: ", PairResult(values, values.whole.pair_index[load.of])
    row = values.whole.pair(load.of).type
    more = 100 * float(np.max(np.hypot(1.0, load.coefficient_at_rest)) - 1)
    if load.model == "circle" and load.radius is not None and not row.takes_pitch and more > 5:
        yield Remark(
            load.of, f"{where}model='total' gives couples {more:.2g} % larger than the circle; say which is meant"
        )
    takes = {name for way in WAYS if way.of(row) for name in way.takes}
    couples = {c.name: np.nan_to_num(result.components[c.name]) for c in row.reactions or () if c.is_couple}
    # the axis is in the plane of a planar mechanism, and the couple across it
    about = None if values.whole.planar else couples.pop("Mz", None)
    across = np.linalg.norm(np.stack([*couples.values(), np.zeros(values.batch)]), axis=0)
    if load.on == "b" and couples:  # about marker B, where the couple along the axis is the same
        along = np.zeros(values.batch) if about is None else about
        if row.takes_pitch:
            along = values.whole.pair(load.of).pitch_per_radian * np.nan_to_num(result.components["Fz"])
        across = np.sqrt(np.abs((np.nan_to_num(result.moment) ** 2).sum(axis=-1) - along**2))
    if load.radius is None and load.thrust_radius is not None:
        radial = np.hypot(*(np.nan_to_num(result.components.get(name, 0.0)) for name in ("Fx", "Fy")))
        if (radial > MOTIONS.idle * np.nan_to_num(result.magnitude)).any():
            most = f"{radial.max():.4g} {unit_of(values.mechanism.units, FORCE)}".rstrip()
            yield Remark(
                load.of, f"{where}a radial force of up to {most} rubs nothing; give radius=, that of the journal"
            )
    # a bearing as long as its diameter bears it by more than its force; of a guide any moment that is no rounding
    arm = 1e-6 * values.radius if load.radius is None else load.radius
    for name, how, moment in (("length", "across", across), ("width", "about", about)):
        if moment is None or name not in takes or getattr(load, name) is not None:
            continue
        if (np.abs(moment) > arm * np.nan_to_num(result.magnitude)).any():
            most = f"{np.abs(moment).max():.4g} {unit_of(values.mechanism.units, MOMENT)}".rstrip()
            why = f"{where}a moment of up to {most} {how} the axis rubs nothing; give {name}=, the distance at which it is borne"
            yield Remark(load.of, why)
