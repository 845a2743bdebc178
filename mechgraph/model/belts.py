"""Belts and chains over any number of pulleys, whose centers may move.

A belt runs in the order of its pulleys, counter-clockwise about those on its inside (sense s = 1), clockwise about those on its back
(s = -1), seen against the common direction z of their axes. Its span from pulley i to pulley j, with signed radii ``w = s r``, is the
common tangent: with the centers d apart,

    l = sqrt(d^2 - (w_j - w_i)^2),   u the direction in which it runs,   phi the angle of u,

and no belt is lost between the marks of both pulleys, at the angles theta:

    l + w_j (theta_j - phi) - w_i (theta_i - phi) = constant.

The rate of this row is ``u . (v_j - v_i)`` of the points of both pulleys on the span, so that its multiplier is the force along u on
pulley j: minus the tension. All rows of a drive add up to the length of the belt, ``sum l + sum r wrap``. Where no center moves they depend
on each other, and the common tension, the pretension, is what statics leaves open.

Source: Shigley and Mischke, Mechanical Engineering Design, 1989, chapter 17 (lengths, wraps, tensions of belts).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations, product
from math import gcd
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from mechgraph.fields import (
    FLAG,
    INTEGER,
    NAMES,
    NUMBER,
    POSITIVE,
    TEXT,
)
from mechgraph.maths.se3 import Array, cross, identity
from mechgraph.memo import dataclass
from mechgraph.model.couplings import OF_BELTS, MeshStep, fitting_of, meeting, motion_of, way
from mechgraph.model.gears import (
    LineCoupling,
    LinePlaces,
    LinesAt,
    LinkPlace,
    Pulley,
    Relation,
    angle,
    dot,
    pose_along,
)
from mechgraph.model.pair import are_placed
from mechgraph.quantities import FORCE, LENGTH, shown, unknown, wrong


class Span(NamedTuple):
    """Straight parts of a belt: lengths ``(..., T)``, directions, starts and ends ``(3, ..., T)``."""

    length: Array
    along: Array
    start: Array
    end: Array


def span(ca: Array, cb: Array, z: Array, wa: Array, wb: Array) -> Span:
    """The common tangent of circles about centers ``ca, cb (3, ..., T)`` with signed radii, in the plane across ``z`` through ``ca``.

    NaN where a circle is within the other (of equal senses) or both overlap (of opposite ones).
    """
    d = cb - ca
    d = d - z * dot(d, z)
    off, square = wb - wa, dot(d, d)
    rest = square - off * off
    length = np.sqrt(np.where(rest.real > 0.0, rest, np.nan))
    u = (length * d - off * cross(z, d)) / square
    start = ca - wa * cross(z, u)
    return Span(length, u, start, start + length * u)


class BeltCourse(NamedTuple):
    """A whole belt: its spans ``(n, T)``, span k from pulley k to the next one; angles of wrap ``(n, T)``; length and turns ``(T,)``.

    ``turns`` of the direction along the belt: 1 for one that does not cross itself, 0 for a crossed one.
    """

    spans: Span
    wrap: Array
    length: Array
    turns: Array


def course(centers: Array, z: Array, w: Array) -> BeltCourse:
    """The belt about centers ``(3, n, T)`` with signed radii ``w (n,)`` or ``(n, T)``; ``z (3, 1, T)``."""
    w = np.asarray(w, dtype=float).reshape(len(w), -1)
    following = np.roll(np.arange(len(w)), -1)
    spans = span(centers, centers[:, following], z, w, w[following])
    sense = np.sign(w)
    bend = sense * angle(np.roll(spans.along, 1, axis=1), spans.along, z)
    # a wrap of nothing is one of 0, not of a whole turn less rounding
    wrap = np.where(bend < -1e-9, bend + 2 * np.pi, np.maximum(bend, 0.0))
    return BeltCourse(
        spans, wrap, spans.length.sum(axis=0) + (np.abs(w) * wrap).sum(axis=0), (sense * wrap).sum(axis=0) / (2 * np.pi)
    )


class Laid(NamedTuple):
    """The pulleys of a belt at the start of a mechanism, in the frame of the link of the first: centers and axes ``(3, n, 1)``, signed
    radii ``(n,)``.
    """

    centers: Array
    axes: Array
    w: Array

    @property
    def course(self) -> BeltCourse:
        """The belt about them."""
        return course(self.centers, self.axes[:, :1], self.w)


@dataclass(frozen=True)
class BeltDrive(LineCoupling):
    """Declare a belt or chain over two or more pulleys, open, crossed, with idlers on its back; centers may move.

    It runs over the pulleys in their order, counter-clockwise about those on its inside, seen against their axes, and clockwise about
    those on its back: two pulleys, the second on the back, are a crossed belt. A mechanism holds it span by span, ``name.p1-p2``, with
    one closure row each. ``s.coupling("name").tension["p1-p2"]`` is the tension of a span, ``.span`` its length, ``.wrap["p1"]`` an angle
    of wrap. Where no center moves the belt is redundant once: tensions are NaN without ``pretension``, the mean tension of the spans,
    weighted with their lengths (as of an elastic belt; what stretches on the pulleys is left out). A pulley on a spring-loaded arm
    determines them, and so does a span that hangs loose, ``slack="w-p"``, as that of a chain behind its driving sprocket: the others pull
    alone.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z, places = (0, 0, 1), {"p": (0, 0, 0), "w": (0.2, 0, 0)}
    >>> m = mg.Mechanism(
    ...     "belt",
    ...     pairs=[mg.Pair(k, "R", "frame", k, point=at, axis=z) for k, at in places.items()],
    ...     gears=[mg.Pulley(k, k, at, z, radius=r) for (k, at), r in zip(places.items(), (0.05, 0.1))],
    ...     couplings=[mg.BeltDrive("B", over=["p", "w"], pretension=300.0)],
    ...     drives=["p"],
    ... )
    >>> tension = mg.solve(m, {"p": 0.5}, loads=[mg.Effort("w", -20.0)]).coupling("B").tension
    >>> {name: float(T.round(3)) for name, T in tension.items()}
    {'p-w': 200.0, 'w-p': 400.0}
    """

    kind: ClassVar[str] = "belt_drive"
    alone: ClassVar[bool] = False
    name: Annotated[str, TEXT("differs from all pairs and couplings", default="g1, g2, ...")]
    over: Annotated[Any, NAMES("its pulleys, in the order in which it runs")]
    backs: Annotated[Any, NAMES("those of them that its back runs over", default="none")] = ()
    length: Annotated[
        float | None, POSITIVE("of the whole belt", LENGTH, default="as the pulleys stand at the start")
    ] = None
    pretension: Annotated[
        float | None,
        NUMBER("mean tension of the spans, where no center moves", FORCE, minimum=0.0, default="not known"),
    ] = None
    toothed: Annotated[bool, FLAG("whether it has teeth; of a flat one results tell the friction that it needs")] = True
    polygon: Annotated[
        bool, FLAG("whether it is a chain of which the chords count: its speed rises and falls with every tooth")
    ] = False
    slack: Annotated[
        str, TEXT("a span that hangs loose, `p1-p2`: it has no tension, and holds nothing", default="none")
    ] = ""
    belt: Annotated[str, TEXT("of one span: the name of the whole belt", default="the whole belt")] = ""
    span: Annotated[int | None, INTEGER("of one span: its place, from 0", default="the whole belt")] = None
    counts: ClassVar[tuple[Mapping[str, float], Mapping[str, float]] | None] = None
    """Angles of both pulleys of a span against their carrier, as sums of freedoms; None where turns go uncounted."""
    angles: ClassVar[tuple[float, ...]] = ()
    """Angles of their marks against the span at the start."""

    @property
    def part_of(self) -> str:
        """The belt."""
        return self.belt

    @property
    def rubs(self) -> tuple[str, ...]:  # type: ignore[override]
        """See ``BaseCoupling``: teeth do not slip."""
        return () if self.toothed else OF_BELTS

    # --- its pulleys -------------------------------------------------------------------------------------------------

    def pulleys(self, m: Any) -> list[Any]:
        """The pulleys, in order."""
        return [m.gear(name) for name in self.over]

    @property
    def senses(self) -> Array:
        """1 for pulleys on its inside, -1 on its back, ``(n,)``."""
        return np.array([-1.0 if name in self.backs else 1.0 for name in self.over])

    @property
    def span_names(self) -> tuple[str, ...]:
        """``p1-p2``, ``p2-p3``, ..."""
        return tuple(f"{a}-{b}" for a, b in zip(self.over, (*self.over[1:], self.over[0]), strict=True))

    def _laid(self, m: Any) -> Laid:
        """Its pulleys at the start."""
        pulleys = self.pulleys(m)
        places = [p.place for p in pulleys]
        poses = [pose_along(m, self._way(m, pulleys[0].link, p.link)) for p in pulleys]
        seen = [place.seen(pose) for place, pose in zip(places, poses, strict=True)]
        centers, axes = (np.concatenate([getattr(one, name) for one in seen], axis=1) for name in ("point", "axis"))
        return Laid(centers, axes, self.senses * [p.pitch_radius for p in pulleys])

    def _way(self, m: Any, a: str, b: str) -> tuple[MeshStep, ...]:
        steps = way(m, m.once(meeting), a, b)
        assert steps is not None
        return steps

    @property
    def tight(self) -> tuple[int, ...]:
        """The places of the spans that pull."""
        return tuple(k for k, name in enumerate(self.span_names) if name != self.slack)

    # --- faults ------------------------------------------------------------------------------------------------------

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""
        where = f"coupling {shown(self.name)}: "
        found = [where + fault for fault in (self.value_faults("") or self._name_faults(m))]
        if found or not m.has_geometry or not m.once(are_placed):
            return found
        return [where + fault for fault in self._misfits(m)]

    def _name_faults(self, m: Any) -> Iterator[str]:
        """Pulleys that are none, or stand where no belt runs."""
        if len(self.over) < 2:
            yield wrong(self.over, "over", "two pulleys or more")
        known = m.once(_pulley_names)
        for name in self.over:
            if name not in known:
                yield f"over: {unknown('pulley', name, known)}"
        for name in {name for name in self.over if self.over.count(name) > 1}:
            yield f"over: names {name!r} twice; a belt runs over a pulley once"
        for name in self.backs:
            if name not in self.over:
                yield f"backs: {unknown('pulley', name, self.over)}"
        if not set(self.over) <= known:
            return
        if self.slack and self.slack not in self.span_names:
            yield f"slack: {unknown('span', self.slack, self.span_names)}"
        if self.slack and (self.length is not None or self.pretension is not None):
            yield (
                "slack = "
                + shown(self.slack)
                + ": leave length= and pretension= out, which say how tight the whole belt is"
            )
        pulleys = self.pulleys(m)
        for one, two in zip(pulleys, (*pulleys[1:], pulleys[0]), strict=True):
            if one.link == two.link and one is not two:
                yield f"{one.name!r} and {two.name!r} are on the same link {one.link!r}; no belt can run from one to the other"
        pitches = {p.pitch for p in pulleys if p.teeth is not None}
        if len(pitches) > 1:
            yield f"its pulleys have the pitches {', '.join(f'{p:g}' for p in sorted(pitches))}; give all the same"
        if self.polygon and any(p.teeth is None for p in pulleys):
            yield "polygon = True: needs teeth= and pitch= of all its sprockets"
        if self.span is not None and (others := self._unlike(m)):
            yield f"its belt {self.belt!r} lacks {others}; declare the whole belt, mg.BeltDrive({self.belt!r}, over=[...])"
        if self.span is not None and not 0 <= self.span < len(self.over):
            yield wrong(self.span, "span", f"a place among the {len(self.over)} spans, from 0")

    def _unlike(self, m: Any) -> str:
        """Spans that are missing beside one of a belt, or have other numbers than it; told by the first one there is."""
        there = {c.span: c for c in m.once(_spans_of)[self.belt]}
        if there[min(there)] is not self and there.get(self.span) is self:
            return ""
        plain = {"name": "", "span": None}
        alike = {k for k, c in there.items() if c.replace(**plain) == self.replace(**plain)}
        return ", ".join(self.span_names[k] for k in self.tight if k not in alike)

    def _misfits(self, m: Any) -> Iterator[str]:
        """What is wrong with the places of its pulleys."""
        fitting, laid = fitting_of(m), self._laid(m)
        z, first = laid.axes[:, :1], laid.centers[:, :1]
        off = np.abs(cross(laid.axes, z)).max(axis=(0, 2))
        against = ((laid.axes * z).sum(axis=0) < 0.0)[:, 0]
        reach = float(np.abs(laid.centers - first).max())
        beside = ((laid.centers - first) * z).sum(axis=0)[:, 0]
        for k, name in enumerate(self.over):
            if off[k] > fitting:
                yield f"the axis of {name!r} is not parallel to that of {self.over[0]!r}"
            elif against[k]:
                yield f"the axis of {name!r} points against that of {self.over[0]!r}; turn one of them round"
            elif abs(beside[k]) > fitting * reach:
                yield f"{name!r} is {abs(beside[k]):.6g} beside the plane of {self.over[0]!r}; move its point along the axis"
        if (off > fitting).any() or against.any() or (np.abs(beside) > fitting * reach).any():
            return
        made = laid.course
        for name, length in zip(self.span_names, made.spans.length[:, 0].tolist(), strict=True):
            if not length > 0.0:
                yield f"the pulleys of {name} overlap, or one is inside the other; no span fits between them"
        if np.isnan(made.length).any():
            return
        turns, clear = round(float(made.turns[0])), self._clear(laid)
        if len(clear) == len(self.over) or not 0 <= turns <= 1:
            yield (
                "does not run once round, as its pulleys are listed; list them counter-clockwise, seen against their axes, and name those "
                f"on its back in backs={self._that_runs(laid)}"
            )
        elif clear:
            yield (
                f"does not touch {', '.join(map(repr, clear))} there; move the pulley, or change on which side it is "
                f"(backs=){self._that_runs(laid)}"
            )
        elif uncounted := self._uncounted(m):
            yield (
                f"nothing counts the turns between the pulleys of {uncounted}, which have no teeth; give teeth= and pitch=, or a pair Fr "
                "beside the bearings about the same axis, as mg.parts.bearings has it"
            )
        elif self.polygon and not self.slack and self._fixed(m):
            yield (
                "polygon = True: no center moves, and a chain whose speed rises and falls with every tooth hangs loose somewhere; name the "
                f"span behind the sprocket that drives, slack={self.span_names[0]!r} say, or hold a sprocket on an arm or slide"
            )
        elif (
            self.length is not None and self._fixed(m) and abs(self.length - made.length[0]) > fitting * made.length[0]
        ):
            yield (
                f"length = {self.length:.8g}: its pulleys, which keep their places, ask for {made.length[0]:.8g}; leave it out, move a "
                "pulley, or hold one on an arm or slide"
            )

    def _that_runs(self, laid: Laid) -> str:
        """The way nearest to the declared one in which a belt runs over the same pulleys once round and touches all of them, in words."""
        n = len(self.over)
        changes = (
            swapped for k in range(3) for swapped in combinations(range(n), k)
        )  # two pulleys on the wrong side at most
        for swapped, order in product(changes, (slice(None), slice(None, None, -1))):
            signs = np.where(np.isin(np.arange(n), swapped), -1.0, 1.0)
            tried = Laid(laid.centers[:, order], laid.axes, (signs * laid.w)[order])
            over = self.over[order]
            backs = [name for name, w in zip(over, tried.w, strict=True) if w < 0]
            way, made = self.replace(over=over, backs=tuple(backs)), tried.course
            if np.isfinite(made.length).all() and round(float(made.turns[0])) == 1 and not way._clear(tried):
                return f"; over={list(over)}, backs={backs} would run"
        return ""

    def _clear(self, laid: Laid) -> list[str]:
        """Pulleys that the belt would not touch: its span between their neighbors runs past them, on the right side."""
        if len(self.over) < 3:
            return []
        before, behind = (np.roll(np.arange(len(self.over)), k) for k in (1, -1))
        direct = span(
            laid.centers[:, before],
            laid.centers[:, behind],
            laid.axes[:, :1],
            laid.w[before, None],
            laid.w[behind, None],
        )
        beside = dot(
            laid.centers - direct.start, cross(np.broadcast_to(laid.axes[:, :1], direct.along.shape), direct.along)
        )
        far = self.senses * beside[:, 0] > np.abs(laid.w)
        return [name for name, clear in zip(self.over, far.tolist(), strict=True) if clear]

    # --- one span ----------------------------------------------------------------------------------------------------

    def written(self, m: Any) -> tuple[BeltDrive, ...]:
        """Its spans, as a mechanism holds them."""
        if self.span is not None:
            return (self.placed(m),)
        names = self.span_names
        spans = (self.replace(name=f"{self.name}.{names[k]}", belt=self.name, span=k) for k in self.tight)
        return tuple(one.placed(m) for one in spans)

    def placed(self, m: Any) -> Self:
        """One span with its row in a mechanism: linear in the turns of pairs where these are about the axes of its pulleys."""
        pulleys, k = self.pulleys(m), self.span or 0
        if not m.has_geometry:
            steps = self._way(m, pulleys[k].link, pulleys[(k + 1) % len(pulleys)].link)
            names = [name for step in steps for name in m.pairs[step.pair].freedom_names]
            return self._put(m, steps, dict.fromkeys(names, 1.0))
        laid = self._laid(m)
        own = k, (k + 1) % len(pulleys)
        (a, b), numbers = (pulleys[i].place for i in own), tuple(float(laid.w[i]) for i in own)
        steps = self._way(m, a.link, b.link)
        turns = _turns_of(m, steps, a, b)
        relation: Relation = tangent
        if self.polygon:
            relation = partial(chordal, pitches=tuple(2 * np.pi / pulleys[i].teeth for i in own))
        seen = a.seen(identity()), b.seen(pose_along(m, steps))
        along = relation(*seen, np.array(numbers).reshape(2, 1, 1)).along
        return self._put(
            m,
            steps,
            None if self.polygon else turns.linear(*numbers),
            ends=(a, b),
            relation=relation,
            numbers=numbers,
            period=self._period(*(pulleys[i] for i in own)),
            counts=turns.counts,
            angles=tuple(float(angle(along, end.mark, seen[0].axis)[0, 0]) for end in seen),
            longer=0.0 if self.length is None or k else self.length - float(laid.course.length[0]),
        )

    def _turning(self, m: Any) -> list[Turns]:
        """The turns on the way along every span."""
        pulleys = self.pulleys(m)
        ends = zip(pulleys, (*pulleys[1:], pulleys[0]), strict=True)
        return [_turns_of(m, self._way(m, a.link, b.link), a.place, b.place) for a, b in ends]

    def _fixed(self, m: Any) -> bool:
        """Whether all rows are linear: no center moves."""
        return all(turns.fixed for turns in self._turning(m))

    def _uncounted(self, m: Any) -> str:
        """The first span along which turns go uncounted and no teeth tell them; nothing where there is none."""
        pulleys = self.pulleys(m)
        ends = zip(self.span_names, self._turning(m), pulleys, (*pulleys[1:], pulleys[0]), strict=True)
        return next((name for name, turns, a, b in ends if not turns.known and np.isinf(self._period(a, b))), "")

    @staticmethod
    def _period(a: Pulley, b: Pulley) -> float:
        """By what the value of a row grows from one way to put the belt on to the next: of teeth their pitch, or some of them."""
        return float("inf") if a.teeth is None or b.teeth is None else gcd(a.teeth, b.teeth) * float(a.pitch or 0.0)

    def whole_turns(self, along: Array, a: LinePlaces, b: LinePlaces, turned: Callable[[str], Array]) -> Array | None:
        """What whole turns of both pulleys add to the value ``(T,)`` of a row that is not linear.

        By how much freedoms have grown since the start, ``turned(name) (T,)``, tells by how many turns the angle of a pulley against the
        span differs from the one in (-pi, pi]: seen from the carrier of both pulleys, a span swings by less than half a turn.
        """
        if self.counts is None:
            return None
        out = np.zeros(along.shape[-1])
        for place, w, first, counts in zip((a, b), self.numbers, self.angles, self.counts, strict=True):
            grown = sum((sense * turned(name) for name, sense in counts.items()), np.zeros(along.shape[-1]))
            alpha = angle(along, place.mark, a.axis)[0].real
            turns = np.round((grown - (alpha - first)) / (2 * np.pi))
            out += (w if place is b else -w) * 2 * np.pi * turns
        return out

    keeps = "pulleys that stay in its plane: hold their shafts in bearings"

    def strayed(self, a: LinePlaces, b: LinePlaces, a0: LinePlaces, b0: LinePlaces) -> tuple[Array, Array]:
        """See ``LineCoupling``: the angle between the axes, and how far beside each other the pulleys move."""
        lean, _ = super().strayed(a, b, a0, b0)
        return lean, np.abs(dot(b.point - a.point, a.axis) - dot(b0.point - a0.point, a0.axis))

    def course_of(self, m: Any, poses: Sequence[Array]) -> BeltCourse:
        """The belt where the links of its pulleys have the poses ``(3 or 4, 4, T)``, in the user's units."""
        pulleys = self.pulleys(m)
        centers = [np.einsum("ijt,j->it", X[:3, :3], p.point) + X[:3, 3] for p, X in zip(pulleys, poses, strict=True)]
        z = np.einsum("ijt,j->it", poses[0][:3, :3], pulleys[0].axis)
        z /= np.sqrt((z * z).sum(axis=0))
        return course(np.stack(centers, axis=1), z[:, None], self.senses * [p.pitch_radius for p in pulleys])


def _spans_of(m: Any) -> dict[str, list[Any]]:
    """The spans of every belt of a mechanism, by its name."""
    found: dict[str, list[Any]] = {}
    for c in m.couplings:
        if isinstance(c, BeltDrive) and c.span is not None:
            found.setdefault(c.belt, []).append(c)
    return found


def _pulley_names(m: Any) -> frozenset[str]:
    """Names of the pulleys of a mechanism."""
    return frozenset(p.name for p in m.gears if isinstance(p, Pulley) and isinstance(p.name, str))


def tangent(a: LinePlaces, b: LinePlaces, numbers: Array) -> LinesAt:
    """Value and line of a span between pulleys with the signed radii ``numbers (2, n, T)``: ``l + w_b alpha_b - w_a alpha_a``, with the
    angles alpha of their marks against the span in (-pi, pi].
    """
    wa, wb = numbers
    made = span(a.point, b.point, a.axis, wa, wb)
    value = made.length + wb * angle(made.along, b.mark, a.axis) - wa * angle(made.along, a.mark, a.axis)
    return LinesAt(value, made.end, made.along)


def chordal(a: LinePlaces, b: LinePlaces, numbers: Array, *, pitches: tuple[float, float]) -> LinesAt:
    """The same of a chain: its span runs from the last roller that sits on a to the first on b, which turn with them on circles of radius
    ``R = pitch / (2 sin(pi / teeth))``.

    A roller sits while its link is not straight behind the span, half a pitch to both sides of where the span would touch. ``numbers
    (2, n, T)``: the signed ``r = teeth pitch / (2 pi)`` of both; ``pitches`` the angles ``2 pi / teeth`` of a pitch. A jump to the next
    roller changes the length of the span by a pitch, and the value not at all.
    """
    (wa, wb), (da, db) = numbers, pitches
    z, made = a.axis, span(a.point, b.point, a.axis, wa, wb)
    # rollers are chosen by the direction of the span, which hangs on the rollers: it settles at once, but where two serve alike
    for _ in range(3):
        u = made.along
        rollers = []
        for place, w, d in ((a, wa, da), (b, wb, db)):
            sense = np.sign(w.real)
            across, alpha = -sense * cross(z, u), angle(u, place.mark, z)
            turned = alpha + 0.5 * np.pi * sense
            off = turned - d * np.round(turned.real / d)
            R = np.abs(w) * d / (2.0 * np.sin(0.5 * d))
            rollers.append(
                (place.point + R * (np.cos(off) * across + np.sin(off) * cross(z, across)), w * (turned - off))
            )
        (start, arc_a), (end, arc_b) = rollers
        end = end - z * dot(end - start, z)
        length = np.sqrt(dot(end - start, end - start))
        made = Span(length, (end - start) / length, start, end)
    return LinesAt(made.length + arc_b - arc_a, made.end, made.along)


class Turns(NamedTuple):
    """Turns on the way from a pulley to another, about the common direction of their axes: freedoms with their senses that turn the first
    against the carrier of both and those behind it; ``fixed``: whether nothing else moves on the way; ``known``: whether no turn goes
    uncounted.
    """

    before: dict[str, float]
    behind: dict[str, float]
    fixed: bool
    known: bool

    def linear(self, wa: float, wb: float) -> dict[str, float] | None:
        """The coefficients of the row where nothing else moves."""
        if not self.fixed:
            return None
        return {name: float(wa * sense) for name, sense in self.before.items()} | {
            name: wb * sense for name, sense in self.behind.items()
        }

    @property
    def counts(self) -> tuple[dict[str, float], dict[str, float]] | None:
        """Angles of both pulleys against their carrier, as sums of freedoms; None where some turns are not counted."""
        return ({name: -sense for name, sense in self.before.items()}, self.behind) if self.known else None


def _turns_of(m: Any, steps: Sequence[MeshStep], a: LinkPlace, b: LinkPlace) -> Turns:
    """The turns on the way between two pulleys."""
    fitting, first, last = fitting_of(m), a.seen(identity()), b.seen(pose_along(m, tuple(steps)))
    z = first.axis[:, 0, 0] / np.linalg.norm(first.axis)
    turned: list[dict[str, float]] = []
    off: list[tuple[float, float]] = []
    fixed = known = True
    for i, step in enumerate(steps):
        pair, X = m.pairs[step.pair], pose_along(m, tuple(steps[:i]))
        if not pair.type.f:
            continue
        near = min((m.once(meeting)[link] for link in (pair.a, pair.b)), key=len)
        beside = [k for k, _ in near if {m.pairs[k].a, m.pairs[k].b} == {pair.a, pair.b}]
        ways = [
            step,
            *(MeshStep(k, step.sense if m.pairs[k].a == pair.a else -step.sense) for k in beside if k != step.pair),
        ]
        turn = next((found for one in ways if (found := _counted(m, one, X, z, fitting)) is not None), None)
        known = known and turn is not None
        p = X[:, :3] @ np.asarray(pair.markers[0 if step.sense > 0 else 1].point) + X[:, 3]
        reach = fitting * max(1.0, float(np.abs(p).max()))
        away = [float(np.abs(cross(p - place.point[:, 0, 0], z)).max()) for place in (first, last)]
        fixed = fixed and bool(turn) and motion_of(pair) == "turn"
        turned.append(turn or {})
        off.append((away[0] * (away[0] > reach), away[1] * (away[1] > reach)))
    # the carrier: the link in which both centers stir least, so that the span hardly swings in it
    stirs = [sum(a for a, _ in off[:k]) + sum(b for _, b in off[k:]) for k in range(len(off) + 1)]
    k = stirs.index(min(stirs))
    before, behind = (dict(item for turn in part for item in turn.items()) for part in (turned[:k], turned[k:]))
    return Turns(before, behind, fixed and not stirs[k], known)


def _counted(m: Any, step: MeshStep, X: Array, z: Array, fitting: float) -> dict[str, float] | None:
    """The freedom of a pair that counts turns about ``z``, with its sense, where the link before has the pose X; nothing where the pair
    does not turn, None where its turns have no coordinate of their own. Turns about other axes are taken for small.
    """
    pair = m.pairs[step.pair]
    R = X[:, :3] @ pair.markers[0 if step.sense > 0 else 1].pose()[:, :3]
    found: dict[str, float] = {}
    for name, freedom, single in zip(pair.freedom_names, pair.type.freedoms, pair.type.drivable, strict=True):
        if not freedom.turns:
            continue
        axis = R @ np.asarray(freedom.twist[:3])
        if not single:
            return None
        if float(np.abs(cross(axis, z)).max()) <= fitting:
            found[name] = step.sense * float(np.sign(axis @ z))
    turns = any(freedom.turns for freedom in pair.type.freedoms)
    return found if len(found) == 1 or not turns else None


def pretensions(m: Any) -> list[tuple[BeltDrive, list[int]]]:
    """Belts with a pretension, by one of their spans, and the places of all their spans among the couplings."""
    found: dict[str, tuple[BeltDrive, list[int]]] = {}
    for k, one in enumerate(m.couplings):
        if isinstance(one, BeltDrive) and one.pretension is not None:
            found.setdefault(one.belt, (one, []))[1].append(k)
    return list(found.values())
