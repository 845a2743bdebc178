"""Where passive links stand when they are at rest in their passive motions on the way from the start, in space.

What rest is, and the rates that follow from it, is in ``passive_motion``; here it is integrated along the path.

Links with several passive motions at rest (a ring on a bar, a washer between planes), integrated step by step along the path.

How far such a link has gone along one of its motions changes what rest is in the others, so that no rate of an angle can be
integrated by itself: the states of the whole mechanism are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.kinematics.motion_path import DriverPath, Positions, Status, in_blocks
from mechgraph.kinematics.rates import PassiveMotion, PassiveMotions, Velocities, are_alone
from mechgraph.kinematics.state import FactoredClosure
from mechgraph.maths.newton import Closed, Interpolation, Nodes, Rule, rule
from mechgraph.maths.se3 import Array, Index, Mask, cross, rotate, rotate_back
from mechgraph.maths.singular_point import WINDOW
from mechgraph.maths.tolerances import PATH
from mechgraph.maths.tracker import Follower
from mechgraph.memo import dataclass


def unspun(path: DriverPath, found: Positions, passive: tuple[PassiveMotion, ...]) -> Positions:
    """The same positions with passive links at rest on the way from the start.

    Along a track some freedom of every passive motion is held, so that its links are turned about their axis ``u`` (or displaced along
    it) by an amount of no meaning. Where they are at rest follows from what does not depend on this amount: the ways of the axis in space
    and in a link, and the spins of the links against each other. They are integrated by Gauss and Legendre's rule in every step between
    nodes, so that it does not hang on which positions were asked for. Links with several passive motions: see ``passive_steps``.
    Source: Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82, 1975 (vectors carried along an axis).
    """
    nodes = found.tracks.nodes
    turns = np.zeros(found.x.shape[1], dtype=np.intp) if found.turns is None else found.turns
    # at the start all is where it is, unless that is met again after some turns
    good = np.flatnonzero((found.status == Status.OK) & (found.near < 0) & ((found.place != 0.0) | (turns != 0)))
    if not len(nodes.steps[0]) or not found.moved.any():
        return found
    carried: _Carried | PassiveSteps
    if are_alone(passive):
        parts = _with_bends(path, found)
        # where the freedom that holds a motion hardly does, it turns fast: parts of such a step are foretold one after the other
        for _ in range(8):
            carried = _Carried(path, found, *parts_of_steps(path, found, parts), passive)
            more = _nearer(carried, parts)
            if more is parts:
                break
            parts = more
    else:
        carried = PassiveSteps(path, Interpolation(path, nodes), found.follower, passive)
    x, status = found.x.copy(), found.status.copy()
    for at in in_blocks(good) if good.size else ():
        x[:, at], sure = carried.turned(found.x[:, at], found.which[at], found.track[at], found.place[at], turns[at])
        status[at[~sure]] = Status.NOT_CLOSED

    def turned(some: Nodes) -> Nodes:
        still = np.zeros(len(some), dtype=np.intp)
        return replace(some, x=carried.turned(some.x, some.which, some.track, some.place, still)[0])

    tracks = replace(found.tracks, nodes=turned(nodes))
    crossings = [replace(c, sides=turned(c.sides)) for c in found.crossings]
    spin = carried.spin(tracks.nodes) if found.turns is not None and isinstance(carried, _Carried) else None
    return replace(found, x=x, status=status, here=None, tracks=tracks, crossings=crossings, spin=spin)


def parts_of_steps(path: DriverPath, found: Positions, nodes: Nodes) -> tuple[Interpolation, Rule]:
    """Steps between nodes, of which there may be more than were found, and the rule for such parts of a step."""
    out, (left, right) = Interpolation(path, nodes), found.tracks.nodes.steps
    if nodes is found.tracks.nodes or not len(left):
        return out, rule()
    whole, span = found.tracks.nodes, float(nodes.place.max()) + 1.0
    key = span * whole.track[left] + whole.place[left]
    step = np.searchsorted(key, span * nodes.track[out.left] + nodes.place[out.left], side="right") - 1
    part = (nodes.place[out.right] - nodes.place[out.left]) / (whole.place[right] - whole.place[left])[step]
    return out, rule(float(part.max(initial=0.0)))


def _with_bends(path: DriverPath, found: Positions) -> Nodes:
    """The nodes of all tracks, with one wherever a path bends."""
    nodes, paths = found.tracks.nodes, found.follower.paths
    track, place = paths.bends
    end = np.zeros(len(paths.end))
    np.maximum.at(end, nodes.track, nodes.place)
    # beside a crossing states are interpolated
    inside = place < end[track]
    for crossed, at in found.tracks.crossings:
        inside &= (track != crossed) | (np.abs(place - at) > WINDOW)
    track, place = track[inside], place[inside]
    # bends up to which steps end at them; of more (many positions of several drivers) a step goes along its chord
    if not 0 < len(track) <= 20_000:
        return nodes
    interpolation = Interpolation(path, nodes)
    step = interpolation.find(track, place)
    which, drive = nodes.which[interpolation.left[step]], paths.drive(track, place)
    closed = found.follower.newton.nodes(interpolation(step, place, drive), drive, track, which, PATH.node)
    return Nodes.join([nodes, Nodes.closed(closed, drive, track, place, sure=True)])


def _nearer(carried: _Carried, nodes: Nodes) -> Nodes:
    """The nodes, and in every step that is not as foretold one more, at the last point of the rule up to which it is."""
    if carried.sure.all():
        return nodes
    interpolation, follower = carried.interpolation, carried.follower
    steps = np.arange(len(interpolation.left))
    closed, track, _ = at_points(interpolation, follower, rule(), steps)
    near = (closed.done & (closed.correction <= PATH.correction)).reshape(len(steps), -1)
    good = np.cumprod(near, axis=1).sum(axis=1)
    some = np.flatnonzero((good > 0) & (good < near.shape[1]))
    if not some.size:
        return nodes
    at, left, right = some * near.shape[1] + good[some] - 1, interpolation.left[some], interpolation.right[some]
    place = nodes.place[left] + 0.5 * (rule().points[good[some] - 1] + 1.0) * (nodes.place[right] - nodes.place[left])
    track, drive = track[at], follower.paths.drive(track[at], place)
    closed = follower.newton.nodes(closed.x[:, at], drive, track, closed.which[at], PATH.node)
    return Nodes.join([nodes, Nodes.closed(closed, drive, track, place, sure=True)])


def at_points(
    interpolation: Interpolation, follower: Follower, rule: Rule, steps: Index
) -> tuple[Closed, Index, Array]:
    """States at the points of a rule in steps between nodes, their tracks ``(n,)``, and the rates of the path values ``(d, n)``."""
    nodes, step = interpolation.nodes, np.repeat(steps, rule.count)
    left, right = interpolation.left[step], interpolation.right[step]
    t = 0.5 * (np.tile(rule.points, len(steps)) + 1.0)
    place, track = nodes.place[left] + t * (nodes.place[right] - nodes.place[left]), nodes.track[left]
    drive = follower.paths.drive(track, place)
    closed = follower.newton.close(interpolation(step, place, drive), drive, track, nodes.which[left])
    return closed, track, interpolation.slope[:, step]


@dataclass(frozen=True)
class _At:
    """One passive motion at a batch of positions: axes ``u (3, T)`` about which it ``turns``, or along which it displaces.

    ``unit`` its rates ``(F, T)``, ``length`` of its twist, ``R (3, 3, T)`` and ``origin (3, T)`` of the first of its links.
    """

    turns: bool
    u: Array
    unit: Array
    length: Array
    R: Array
    origin: Array

    @classmethod
    def of(cls, here: PassiveMotions, i: int) -> _At:
        """Motion ``i`` of several."""
        motion = here.passive[i]
        twist, pose = here.twists[:, here.first(i), i], here.here.poses[:, :, motion.links[0]]
        along = twist[:3] if motion.turns else twist[3:]
        length = np.sqrt((along * along).sum(axis=0))
        return cls(motion.turns, along / length, here.rates[:, i] / length, length, pose[:, :3], pose[:, 3])

    def take(self, at: Index) -> _At:
        """Some of the positions."""
        return _At(self.turns, *(part[..., at] for part in (self.u, self.unit, self.length, self.R, self.origin)))

    def in_sense(self, u: Array) -> _At:
        """The motion in the sense of other axes."""
        sense = np.where((self.u * u).sum(axis=0) < 0, -1.0, 1.0)
        return replace(self, u=sense * self.u, unit=sense * self.unit, length=sense * self.length)

    def amount(self, e: Array, c: Array) -> Array:
        """Angle about ``u`` from references ``e`` in space to references ``c`` in the link; or the place of its origin along ``u``."""
        if not self.turns:
            return np.asarray((self.origin * self.u).sum(axis=0))
        return _angle(_across(e, self.u)[0], _across(rotate(self.R, c), self.u)[0], self.u)

    def amount_rate(self, e: Array, c: Array, V: Array, change: Array) -> Array:
        """The rate of ``amount`` where the link moves with ``V (6, T)`` and the twist of the motion changes by ``change (6, T)``.

        For a turn ``w . u``, with the turning about ``u`` of the references taken across it.
        """
        du = (change[:3] if self.turns else change[3:]) / self.length
        du = du - (du * self.u).sum(axis=0) * self.u
        w, v = V[:3], V[3:] + cross(V[:3], self.origin)
        if not self.turns:
            return np.asarray((v * self.u + self.origin * du).sum(axis=0))
        in_link = _turning(rotate(self.R, c), self.u, du - cross(w, self.u))
        return np.asarray((w * self.u).sum(axis=0) + in_link - _turning(e, self.u, du))


@dataclass(frozen=True)
class _Course:
    """One passive motion at rest along all steps.

    Its axes ``u (3, steps, points + 2)`` at the places of every step by the ``rule``, references ``e``, ``c (3, steps)`` of the
    amount, the amount where a step ``begin``s, the Legendre ``series`` of its further change, what is ``missing`` to rest where a step
    begins, how much more is where it ends (``grows``), and by how much the amount differs after the whole track, where that is a
    ``period``.
    """

    rule: Rule
    u: Array
    e: Array
    c: Array
    begin: Array
    series: Array
    missing: Array
    grows: Array
    period: Array

    def left(self, at: _At, step: Index, t: Array, turns: Index, expected: Array | None) -> tuple[Array, Array]:
        """Amounts ``(n,)`` that are missing to rest in steps at ``t`` from -1 to 1, so many periods later; their increments ``(F, n)``.

        Poses tell a turn but for whole turns, of which there are as many as in what is ``expected``: along the track it grows evenly.
        """
        nearest = np.argmin(np.abs(t[:, None] - self.rule.places), axis=1)
        at = at.in_sense(self.u[:, step, nearest])
        amount = self.begin[step] + (self.series[step] * self.rule.integrals(t)).sum(axis=1) + turns * self.period[step]
        amount = amount - at.amount(self.e[:, step], self.c[:, step])
        if at.turns:
            if expected is None:
                expected = self.missing[step] + 0.5 * (t + 1.0) * self.grows[step] + turns * self.period[step]
            amount = expected + _wrapped(amount - expected)
        return amount, at.unit * amount


class _Carried:
    """Passive motions at rest along tracks."""

    def __init__(
        self,
        path: DriverPath,
        found: Positions,
        interpolation: Interpolation,
        rule: Rule,
        passive: tuple[PassiveMotion, ...],
    ) -> None:
        self.path, self.interpolation, self.follower, self.passive = path, interpolation, found.follower, passive
        self._found = found
        nodes, left = interpolation.nodes, interpolation.left
        self._h = nodes.place[interpolation.right] - nodes.place[left]
        self._rule = rule
        track = nodes.track[left]
        self._first = np.concatenate([[True], track[1:] != track[:-1]])
        here, _ = self._motions(nodes.x, nodes.which, nodes.track)
        between, V, change = self._between()
        self._courses = {
            i: self._course(_At.of(here, i), _At.of(between, i), V[:, here.first(i)], change[:, here.first(i), i])
            for i in range(len(passive))
        }

    def _motions(self, x: Array, which: Index, track: Index) -> tuple[PassiveMotions, FactoredClosure]:
        """Passive motions at states, and the equations there."""
        here = self.path.at(x, x[self.path.rows], track)
        f = self.path.factored(here, which)
        return PassiveMotions(here, self.passive, f.motions()), f

    def _between(self) -> tuple[PassiveMotions, Array, Array]:
        """The motions at the Gauss points of all steps, twists ``(6, n, T)`` at rest in them, rates ``(6, n, p, T)`` of their own."""
        closed, track, slope = at_points(self.interpolation, self.follower, self._rule, np.arange(len(self._h)))
        step = np.repeat(np.arange(len(self._h)), self._rule.count)
        self.sure = rest_is_sure(closed, step, self.interpolation.begin)
        there, f = self._motions(closed.x, closed.which, track)
        dq = (f.sensitivity() * slope).sum(axis=1)
        moving = Velocities(there.here, dq + there.at_rest(there.here.link_twists(dq)))
        return there, moving.V[:, there.links], there.twist_rates(f, moving.dq, moving.V, moving.bias)

    def _course(self, here: _At, between: _At, V: Array, change: Array) -> _Course:
        """One motion, given at the nodes and at the Gauss points; there with the twist ``V`` of its link and the rate of its own."""
        points = self._rule.count
        left, right, n = self.interpolation.left, self.interpolation.right, len(self.interpolation.left)
        first, of_track = np.unique(self.interpolation.begin, return_inverse=True)
        last = self.interpolation.last(self.interpolation.nodes.track[left[first]], self.follower.paths.end)
        u = np.concatenate([here.u[:, left, None], between.u.reshape(3, n, points), here.u[:, right, None]], axis=2)
        # one sense along every track; two nodes at one place, of other forms, may have other senses as well
        every = u.reshape(3, -1)
        turned = np.concatenate([[1.0], np.where((every[:, 1:] * every[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)])
        sense = np.cumprod(turned).reshape(n, -1)
        u *= sense * sense[first, :1][of_track]
        e = _perpendicular(u[:, :, 0])
        c = rotate_back(here.R[:, :, left], e)
        repeated = [np.repeat(references, points, axis=1) for references in (e, c)]
        rate = between.in_sense(u[:, :, 1:-1].reshape(3, -1)).amount_rate(repeated[0], repeated[1], V, change)
        series = self._h[:, None] * (rate.reshape(n, points) @ self._rule.to_series)

        def amount(nodes: Index, steps: Index, side: int) -> Array:
            return here.take(nodes).in_sense(u[:, steps, side]).amount(e[:, steps], c[:, steps])

        # from the references of a step to those of the next, at the node between them
        inner = np.flatnonzero(~self._first)
        begin = np.zeros(n)
        begin[inner] = amount(right[inner - 1], inner, 0) - amount(right[inner - 1], inner - 1, -1)
        begin[inner] += series[inner - 1, 0]
        begin = np.cumsum(begin)
        begin += (amount(left[first], first, 0) - begin[first])[of_track]
        every_step = np.arange(n)
        missing = begin - amount(left, every_step, 0)
        grows = begin + series[:, 0] - amount(right, every_step, -1) - missing
        # a track that comes back to where it starts comes back with its passive links moved
        period = begin[last] + series[last, 0] - amount(left[first], last, -1)
        if here.turns:
            grows = _wrapped(grows)
            missing = np.cumsum(grows) - grows
            missing -= missing[first][of_track]
            # from the start with the turns that count as gained, which need not be those nearest to what the held motion gains
            unit = here.unit[:, left[first]]
            of_held = (unit * self._off_gained(left[first], right[last])).sum(axis=0) / (unit * unit).sum(axis=0)
            of_held *= np.where((u[:, last, -1] * u[:, first, 0]).sum(axis=0) < 0, -1.0, 1.0)
            expected = missing[last] + grows[last] + of_held
            period = expected + _wrapped(period - expected)
        period *= np.where((u[:, last, -1] * u[:, first, 0]).sum(axis=0) < 0, -1.0, 1.0)
        return _Course(self._rule, u, e, c, begin, series, missing, grows, period[of_track])

    def _off_gained(self, start: Index, end: Index) -> Array:
        """Increments ``(F, tracks)`` from the starts of tracks, with what counts as gained in a period, to their ends."""
        found, nodes = self._found, self.interpolation.nodes
        out = self.path.difference(nodes.x[:, end], nodes.x[:, start])
        if found.turns is not None and found.gained is not None:
            later = np.flatnonzero(found.turns > 0)
            track, first = np.unique(found.track[later], return_index=True)
            gained = np.zeros((out.shape[0], 1 + max(found.track.max(initial=0), nodes.track.max(initial=0))))
            gained[:, track] = found.gained[:, later[first]] / found.turns[later[first]]
            out -= gained[:, nodes.track[start]]
        return out

    def turned(self, x: Array, which: Index, track: Index, place: Array, turns: Index) -> tuple[Array, Mask]:
        """States with all passive links moved to where they stand when they are at rest, ``turns`` periods of the track later.

        Also where that is beyond doubt.
        """
        part, left, times, most = np.ones(len(track)), None, 0, 0
        # angle that is rounding
        unturned = 1e-13
        while True:
            amounts, dq, sure = self._missing(x, which, track, place, turns, left)
            amount = np.abs(list(amounts.values())).max(axis=0)
            if left is None:
                # most repetitions of the turn that takes the spin out; over a plane half a turn takes some thirty
                most = 80 * (1 + int(amount.max(initial=0.0) / np.pi))
            if amount.max(initial=0.0) < unturned or times == most:
                break
            times += 1
            # exact where the rates of the motion are constant (ball joints, hinges), so that nothing is left to correct; over a plane it
            # comes nearer with every repetition, by parts of the way that need no large correction
            closed = self.follower.newton.close(self.path.advance(x, part * dq, track), x[self.path.rows], track, which)
            if closed.correction.max(initial=0.0) < unturned and (part == 1.0).all():
                x, amount = closed.x, np.zeros(len(track))
                break
            near = closed.done & (closed.correction <= PATH.correction)
            x = np.where(near, closed.x, x)
            left = {i: a * (1.0 - np.where(near, part, 0.0)) for i, a in amounts.items()}
            easily = near & (closed.correction <= 0.25 * PATH.correction)  # it grows with the square of the part
            part = np.where(easily, np.minimum(2.0 * part, 1.0), np.where(near, part, 0.5 * part))
            # freedoms that held the motion may no longer do so where it has led
            which = self.path.chosen(self.path.at(x, x[self.path.rows], track), which)
        # angle, or length / L, that may be missing to rest where repetition ends: what poor condition leaves of the rounding
        return x, sure & (amount < 1e-9)

    def spin(self, nodes: Nodes) -> Array:
        """Increments ``(F, nodes)`` from nodes to one period later."""
        later = np.ones(len(nodes), dtype=np.intp)
        return self._missing(nodes.x, nodes.which, nodes.track, nodes.place, later, None)[1]

    def _missing(
        self, x: Array, which: Index, track: Index, place: Array, turns: Index, expected: dict[int, Array] | None
    ) -> tuple[dict[int, Array], Array, Mask]:
        """Amounts ``(n,)`` by motion by which states miss rest, increments ``(F, n)`` that lead there, and where the way to it is beyond
        doubt.
        """
        nodes = self.interpolation.nodes
        tracks = nodes.track[self.interpolation.left]
        moved = np.isin(track, tracks)
        step = self.interpolation.find(np.where(moved, track, tracks[0]), place)
        t = 2.0 * (place - nodes.place[self.interpolation.left[step]]) / self._h[step] - 1.0
        here, _ = self._motions(x, which, track)
        dq, amounts = np.zeros((here.rates.shape[0], x.shape[1])), {}
        for i, course in self._courses.items():
            amount, part = course.left(_At.of(here, i), step, t, turns, None if expected is None else expected[i])
            amounts[i] = np.where(moved, amount, 0.0)
            dq += np.where(moved, part, 0.0)
        return amounts, dq, self.sure[step] | ~moved


def _turning(e: Array, u: Array, du: Array) -> Array:
    """Rate at which the part of ``e`` across ``u`` turns about it where ``u`` changes by ``du``: ``n' . (u x n)``."""
    n, length = _across(e, u)
    return np.asarray(-(e * u).sum(axis=0) * (du * cross(u, n)).sum(axis=0) / length)


def _perpendicular(u: Array) -> Array:
    """Unit vectors across unit vectors ``(3, n)``: of the global axis least aligned with each."""
    e = np.eye(3)[:, np.argmin(np.abs(u), axis=0)]
    return _across(e, u)[0]


def _across(e: Array, u: Array) -> tuple[Array, Array]:
    """The parts of ``e`` across unit vectors ``u``, of unit length, and their lengths."""
    r = e - (e * u).sum(axis=0) * u
    length = np.sqrt((r * r).sum(axis=0))
    return r / length, length


def _angle(a: Array, b: Array, u: Array) -> Array:
    """Angles from ``a`` to ``b`` about ``u`` (all across ``u``), ``(n,)``."""
    return np.arctan2((cross(a, b) * u).sum(axis=0), (a * b).sum(axis=0))


def _wrapped(angle: Array) -> Array:
    """Angles in [-pi, pi)."""
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def rest_is_sure(closed: Closed, step: Index, begin: Index) -> Mask:
    """Steps with which, and up to which from where tracks ``begin``, the way is sure: states ``closed`` in a ``step`` are as foretold."""
    bad = np.zeros(len(begin), dtype=bool)
    bad[step[~closed.done | (closed.correction > PATH.correction)]] = True
    before = np.cumsum(bad)
    behind = np.arange(len(begin)) < begin
    return (before - bad * behind) == (before - bad)[begin]


class PassiveSteps:
    """States at rest in all passive motions: in every step between nodes ``x(t) = x_0 + int q' dt``, closed.

    The rates ``q'`` at rest are those at Gauss and Legendre's points of the step itself, found by repetition.
    Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 1993, section II.7 (collocation).
    """

    def __init__(
        self, path: DriverPath, interpolation: Interpolation, follower: Follower, passive: tuple[PassiveMotion, ...]
    ) -> None:
        self.path, self.interpolation, self.follower, self.passive = path, interpolation, follower, passive
        nodes, left, right = interpolation.nodes, interpolation.left, interpolation.right
        self._h = nodes.place[right] - nodes.place[left]
        self._series = np.zeros((path.size[0], len(left), rule().count))
        # before a start, where nodes have places below zero, steps lead away from it as well
        self._back = nodes.place[left] < 0.0
        self._begin = nodes.x[:, np.where(self._back, right, left)]
        self._sure = np.ones(len(left), dtype=bool)
        number = np.arange(len(left)) - interpolation.begin
        for k in [*range(int(number.max(initial=-1)) + 1), *range(-1, int(number.min(initial=0)) - 1, -1)]:
            steps = np.flatnonzero(number == k)
            if k not in (0, -1):
                way = 1 if k > 0 else -1
                before = steps - way
                drive = nodes.drive[:, (right if k > 0 else left)[before]]
                closed = self._at(before, np.full(len(steps), float(way)), drive, nodes.which[left[steps]])
                self._begin[:, steps], self._sure[steps] = closed.x, self._sure[before] & closed.done
            self._follow(steps)

    def _at(self, step: Index, t: Array, drive: Array, which: Index) -> Closed:
        """States in steps at ``t`` from -1 to 1, closed."""
        dq = np.einsum("fng,ng->fn", self._series[:, step], rule().integrals(t))
        dq -= np.where(self._back[step], self._series[:, step, 0], 0.0)
        track = self.interpolation.nodes.track[self.interpolation.left[step]]
        return self.follower.newton.close(self.path.advance(self._begin[:, step], dq, track), drive, track, which)

    def _follow(self, steps: Index) -> None:
        """Find the increments of some steps, of different tracks."""
        nodes, left = self.interpolation.nodes, self.interpolation.left[steps]
        many, t = np.repeat(steps, rule().count), np.tile(rule().points, len(steps))
        place = nodes.place[np.repeat(left, rule().count)] + 0.5 * (t + 1.0) * self._h[many]
        track, which = nodes.track[np.repeat(left, rule().count)], nodes.which[np.repeat(left, rule().count)]
        drive = self.follower.paths.drive(track, place)
        # most repetitions of a step: each leaves a small part of what was wrong along the passive motions
        for _ in range(30):
            closed = self._at(many, t, drive, which)
            x, here = closed.x, self.path.at(closed.x, drive, track)
            f = self.path.factored(here, closed.which)
            if f.motions().shape[1] != len(self.passive):
                # beyond what closes, as where a shaky mechanism does not go on
                self._sure[steps] = False
                return
            dq = (f.sensitivity() * self.interpolation.slope[:, many]).sum(axis=1)
            dq += PassiveMotions(here, self.passive, f.motions()).at_rest(here.link_twists(dq))
            rates = self.path.tangent(self.path.difference(x, self._begin[:, many]), dq)
            series = self._h[steps, None] * (rates.reshape(-1, len(steps), rule().count) @ rule().to_series)
            change = np.abs(series - self._series[:, steps]).max(axis=(0, 2), initial=0.0)
            self._series[:, steps] = series
            # change of the increments of a step that is rounding
            if change.max() < 1e-14 * max(1.0, float(np.abs(series).max(initial=0.0))):
                break
        # change of the increments of a step up to which its repetitions have come to an end
        self._sure[steps] &= (change < 1e-10) & closed.done.reshape(-1, rule().count).all(axis=1)

    def turned(self, x: Array, which: Index, track: Index, place: Array, turns: Index) -> tuple[Array, Mask]:
        """States at rest at places of the tracks, as far as these have steps; their motion is followed all the way, without ``turns``.

        Also where that is beyond doubt.
        """
        nodes, left = self.interpolation.nodes, self.interpolation.left
        moved = np.flatnonzero(np.isin(track, nodes.track[left]))
        step = self.interpolation.find(track[moved], place[moved])
        t = 2.0 * (place[moved] - nodes.place[left[step]]) / self._h[step] - 1.0
        out, sure = x.copy(), np.ones(x.shape[1], dtype=bool)
        closed = self._at(step, t, x[self.path.rows][:, moved], which[moved])
        out[:, moved], sure[moved] = closed.x, self._sure[step] & closed.done
        return out, sure
