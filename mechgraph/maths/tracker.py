"""Tracks of solutions of equations, followed together: predicted, corrected, certified, each with a step of its own.

Following many paths of solutions of equations together: a batch of tracks, each with its own place and step.

A track is followed in two ways. The *quick* march predicts every node from those before it and takes one Newton step; afterwards all
nodes of all tracks are closed in one batch, and every step is certified in one batch by a node in its middle (see ``_certified``).
Where a step cannot be certified, or the quick march does not get on, the *careful* march takes over from the last certified node: it
closes and certifies every step by itself and halves it where that fails, down to a smallest step. What lies there is named: a fold,
where the path turns back, or a crossing with another branch, which is passed on the branch of continuous velocity.

Nothing here knows what the equations are: a ``Problem`` evaluates them.
Sources: Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapters 2 and 6; Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, 2000, chapter 3.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import numpy as np

from mechgraph.maths.newton import Newton, Nodes, Paths, Problem, Work, cubic, through
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH
from mechgraph.memo import dataclass


def between(problem: Problem, a: Nodes, b: Nodes, part: Array | float, drive: Array) -> Array:
    """States at a ``part`` of the way between neighbors, at path values ``drive (d, n)``, by Hermite interpolation of both ends."""
    h = b.place - a.place
    direction = (b.drive - a.drive) / h
    y = problem.difference(b.x, a.x)
    there = problem.tangent(y, (b.Z * direction).sum(axis=1))
    dq = cubic(y, (a.Z * direction).sum(axis=1), there, h, part * h)
    off = drive - a.drive - part * (b.drive - a.drive)
    dq += ((a.Z + part * (b.Z - a.Z)) * off).sum(axis=1)
    return problem.advance(a.x, dq, a.track)


def smooth(problem: Problem, a: Nodes, m: Nodes, b: Nodes, correction: Array, free: Array) -> Mask:
    """Whether states and rates in the middles ``m`` are those of the Hermite cubic of both ends, against the change of rates over the step.

    On a smooth track ``r_m = 3/2 (x_b - x_a) / h - (r_a + r_b) / 4`` and the correction of ``x_m`` vanishes, both to higher order than
    the change of rates; where a step leads from one branch onto another by a jump of the rates, the one holds for a jump at a sixth
    of the step, the other at a quarter, so never both. Motions left ``free (F, p, n)`` do not count: corrections move nodes along them.

    Nor need they be so smooth (accelerations of cams jump) where no other branch is as near. An end on another branch, ``d`` away from
    where the step should lead, makes ``2 h |r_m - ...| + 4 |correction| >= d``; and two solutions are at least ``2 / (|J^-1| |J'|)`` apart
    (``|J'|`` grows with the curvature of curves and surfaces, which may bend between two nodes and nowhere else).
    """
    h = b.place - a.place
    direction = (b.drive - a.drive) / h
    y = problem.difference(b.x, a.x)
    rates = [(a.Z * direction).sum(axis=1)]
    for node in (m, b):
        rates.append(problem.tangent(problem.difference(node.x, a.x), (node.Z * direction).sum(axis=1)))
    r_a, r_m, r_b = rates
    off_cubic = r_m - 1.5 * y / h + 0.25 * (r_a + r_b)
    if free.shape[1]:
        N = np.moveaxis(free, -1, 0)
        off_cubic -= (N @ (np.linalg.pinv(N) @ off_cubic.T[..., None]))[..., 0].T
    gap = np.abs(off_cubic).max(axis=0, initial=0.0)
    change = np.max([np.abs(p - q).max(axis=0, initial=0.0) for p, q in ((r_a, r_m), (r_m, r_b), (r_a, r_b))], axis=0)
    off = np.abs(m.drive - 0.5 * (a.drive + b.drive)).max(axis=0, initial=0.0) / h
    noise = (4.0 * off + 1e-6) * np.abs(r_m).max(axis=0, initial=0.0) + 1e-14 * m.condition / h
    noise += PATH.tiny / h  # branches that are no further apart are one
    on_cubic = (gap <= PATH.smooth * change + noise) & (correction <= h * (PATH.smooth * change / 8 + noise))
    # pivots do not tell how the inverse grows along a chain of loops, rates do
    size = np.max([np.abs(r).max(axis=0, initial=1.0) for r in rates], axis=0)
    size *= np.max([np.ones_like(h), a.condition, m.condition, b.condition], axis=0)
    size *= max(1.0, problem.bend / PATH.round)
    return np.asarray(on_cubic | (2.0 * h * gap + 4.0 * correction <= PATH.alone / size))


@dataclass
class March:
    """Tracks on their way: the last node of each, the one ``before`` (``known`` where the last came straight from it), the next step
    ``h``, and the number of ``steps`` taken.
    """

    last: Nodes
    before: Nodes
    known: Mask
    h: Array
    steps: int = 0

    def move(self, new: Nodes, before: Nodes, at: Index) -> None:
        """Go on to new nodes of the tracks ``at``."""
        if len(at) == len(self.last):
            self.last, self.before = new, before
        else:
            self.last, self.before = self.last.replaced(new, at), self.before.replaced(before, at)
        self.known[at] = True

    def keep(self, going: Mask) -> None:
        """Go on with some of the tracks."""
        if np.count_nonzero(going) < len(going):
            self.last, self.before = self.last.take(going), self.before.take(going)
            self.known, self.h = self.known[going], self.h[going]


class Marching:
    """Steps of tracks of a problem along ``paths``, corrected by ``newton``; what is done is counted in ``work``."""

    paths: Paths

    def __init__(self, problem: Problem, work: Work) -> None:
        self.problem, self.work, self.newton = problem, work, Newton(problem, work)

    def predicted(self, march: March) -> tuple[Array, Array, Array, Array | float]:
        """Where the next steps lead: places, path values, states predicted there, and the order of their error in the step."""
        last = march.last
        at = self.paths.step(last.track, last.place, march.h)
        drive = self.paths.drive(last.track, at)
        dq, order = self._ahead(last, march.before, march.known, at, drive)
        return at, drive, self.problem.advance(last.x, dq, last.track), order

    def moved(self, march: March, new: Nodes, before: Nodes, at: Index) -> list[Nodes]:
        """The tracks ``at`` of a march moved on to new nodes, each in a better form where its own is poor; the nodes made."""
        renewed = self.renewed(new)
        march.move(renewed, before, at)
        if renewed is new:
            return [new]
        changed = (renewed.which != new.which).nonzero()[0]
        march.known[at[changed]] = False
        return [new, renewed.take(changed)]

    def renewed(self, nodes: Nodes) -> Nodes:
        """The same nodes in better forms where theirs are poor."""
        poor = (nodes.condition > PATH.fair).nonzero()[0]
        if not poor.size:
            return nodes
        few = nodes.take(poor)
        point = self.problem.at(few.x, few.drive, few.track)
        which = self.problem.chosen(point, few.which)
        f = self.problem.factored(point, which)
        Z, condition = nodes.Z.copy(), nodes.condition.copy()
        Z[:, :, poor], condition[poor] = self.problem.sensitivity(point, f), f.condition
        new = nodes.which.copy()
        new[poor] = which
        return replace(nodes, Z=Z, condition=condition, which=new)

    def _ahead(self, last: Nodes, before: Nodes, known: Mask, at: Array, drive: Array) -> tuple[Array, Array | float]:
        """Increments ``(F, n)`` from the last nodes to path values, and the order of their error in the step.

        Where the track goes straight on from the node before (``known``) in steps of fair size: Hermite interpolation through both,
        extrapolated; behind a corner the change of the sensitivity over the last step; else the sensitivity alone.
        """
        h, change = at - last.place, drive - last.drive
        back = last.place - before.place
        straight = known & (h < 16.0 * back) & (h > 0.25 * back)
        if self.paths.bent:
            came = last.drive - before.drive
            along, sizes = np.add.reduce(came * change), np.add.reduce(came * came) * np.add.reduce(change * change)
            straight &= along > (1 - 1e-9) * np.sqrt(sizes)
            known = known & (along > 0)
        if np.count_nonzero(straight) == len(straight):
            return self.problem.corrigible(self._through(before, last, change, h), last.which), 4.0
        dq = np.add.reduce(last.Z * change, axis=1)
        order = np.full(len(h), 2.0)
        two = straight.nonzero()[0]
        if two.size:
            dq[:, two] = self._through(before.take(two), last.take(two), change[:, two], h[two])
            order[two] = 4.0
        bent = (known & ~straight & (h < 4.0 * back)).nonzero()[0]
        turn = ((last.Z - before.Z)[:, :, bent] * change[:, bent]).sum(axis=1)
        dq[:, bent] += 0.5 * h[bent] / back[bent] * turn
        order[bent] = 3.0
        return self.problem.corrigible(dq, last.which), order

    def _through(self, a: Nodes, b: Nodes, change: Array, h: Array) -> Array:
        """Increments ``(F, n)`` from nodes ``b`` of Hermite's cubics through ``a`` and them, where path values have changed on."""
        direction = change / h
        y = self.problem.difference(a.x, b.x)
        here, there = np.add.reduce(b.Z * direction, axis=1), np.add.reduce(a.Z * direction, axis=1)
        return cubic(y, here, self.problem.tangent(y, there), a.place - b.place, h)

    def longest(self, last: Nodes, new: Nodes, drive: Array) -> Array | float:
        """The longest next steps, by the pace of the tracks at both ends of the last one."""
        if not self.problem.paced:
            return PATH.longest
        change = (drive - last.drive) / np.maximum(new.place - last.place, PATH.shortest)
        paces = [self.problem.pace(node.x, (node.Z * change).sum(axis=1)) for node in (last, new)]
        return PATH.longest / np.maximum(np.maximum(*paces), np.finfo(float).tiny)


def next_step(h: Array, correction: Array, order: Array | float, good: Mask, longest: Array | float) -> Array:
    """The step that aims at the wanted correction, at most the ``longest``; half of one that failed."""
    grown = h * np.minimum(np.maximum((PATH.aim / np.maximum(correction, 1e-9)) ** (1 / order), 0.5), 2.0)
    grown = np.minimum(np.maximum(grown, 10 * PATH.shortest), longest)
    return grown if np.count_nonzero(good) == len(good) else np.where(good, grown, 0.5 * h)


class End(Enum):
    """How a track ended."""

    REACHED = "reached"
    FOLD = "fold"
    CROSSING = "crossing"
    RANGE = "range"
    GIVEN_UP = "given up"


@dataclass(frozen=True)
class Tracks:
    """Nodes of all tracks, how each ended ``(V,)`` and the crossings met as (track, place)."""

    nodes: Nodes
    end: list[End]
    crossings: list[tuple[int, float]]
    work: Work


class Follower(Marching):
    """Follows the tracks of a problem; see the head of this file."""

    def __init__(self, problem: Problem, leads: bool = True, work: Work | None = None) -> None:
        """``leads``: whether tracks may be followed behind their starts, see ``with_lead``."""
        super().__init__(problem, work or Work())
        self.leads = leads

    def follow(
        self,
        x: Array,
        paths: Paths,
        first: float | None = None,
        which: Index | None = None,
        careful: bool = True,
        least: Array | None = None,
    ) -> Tracks:
        """All tracks from their closed states ``x (nx, V)`` in forms ``which``; ``first`` is the first step tried, else ``PATH.first``.

        Unless ``careful`` a track ends, not named, where the quick march or its certificate ends. ``least (V,)`` are condition numbers
        that are known of the branches elsewhere: of a start beside a singular point its own tells nothing of what is ordinary.
        """
        V = x.shape[1]
        self._least = np.full(V, np.inf) if least is None else least
        self.paths, self._x = paths, x
        self.crossings: list[tuple[int, float]] = []
        self._leads: dict[int, Nodes] = {}
        start = self._start(x, np.full(V, -1) if which is None else which)
        self.stuck = stuck = ~(start.condition <= PATH.singular) & (paths.end > 0)
        self.ends = [End.CROSSING if here else End.REACHED for here in stuck]
        self.given_up = np.zeros(V, dtype=bool)
        open_ = np.flatnonzero(~stuck & (paths.end > 0))
        if not open_.size:
            return Tracks(start, self.ends, self.crossings, self.work)
        begun = start.take(open_)
        nodes = self._filled(Nodes.join([begun, self._quick(begun, first)]))
        nodes = Nodes.join([start, self._settled(nodes.take(nodes.place > 0.0))])
        nodes = self._cut(self._certified_all(nodes))
        reached = np.zeros(V)
        np.maximum.at(reached, nodes.track, nodes.place)
        left = np.flatnonzero((reached < paths.end) & ~stuck & ~self.given_up & careful)
        if left.size:
            nodes = self._careful(nodes, left)
        for v in np.flatnonzero(self.given_up):
            self.ends[v] = End.GIVEN_UP
        return Tracks(nodes, self.ends, self.crossings, self.work)

    # --- nodes -----------------------------------------------------------------------------------------------------------

    def _start(self, x: Array, which: Index) -> Nodes:
        tracks = np.arange(x.shape[1])
        drive = self.paths.drive(tracks, np.zeros(len(tracks)))
        point = self.problem.at(x, drive, tracks)
        which = self.problem.chosen(point, which)
        f = self.problem.factored(point, which)
        Z = self.problem.sensitivity(point, f)
        return Nodes(point.x, Z, drive, tracks, np.zeros(len(tracks)), which, f.condition, np.ones(len(tracks), bool))

    # --- the quick march -------------------------------------------------------------------------------------------------

    def _quick(self, start: Nodes, first: float | None) -> Nodes:
        """Nodes behind the starts, most of them closed by one Newton step only; ends early where that does not do."""
        out: list[Nodes] = []
        march = March(start, start, np.zeros(len(start), dtype=bool), np.full(len(start), first or PATH.first))
        while len(march.last):
            last = march.last
            at, drive, x, order = self.predicted(march)
            found = self.newton.nodes(x, drive, last.track, last.which, PATH.correction)
            good = found.done & (found.correction <= PATH.correction) & (found.condition <= PATH.singular)
            new = Nodes.closed(found, drive, last.track, at, sure=False)
            longest = PATH.ahead * self.longest(last, new, drive)
            march.h = next_step(at - last.place, found.correction, order, good, longest)
            kept = good.nonzero()[0]
            moved = (new, last) if len(kept) == len(good) else (new.take(kept), last.take(kept))
            out += self.moved(march, *moved, kept)
            going = self._spend(march, PATH.quick_steps) & (march.h >= PATH.shortest_quick)
            march.keep(going & (march.last.place < self.paths.end[march.last.track]))
        return Nodes.join(out) if out else start.take(np.zeros(0, dtype=np.intp))

    def _spend(self, march: March, most: int) -> Mask | bool:
        """Count a step of a march, and give up its tracks that have taken more than ``most``; which may go on."""
        march.steps += 1
        if march.steps <= most:
            return True
        tracks = march.last.track
        self.given_up[tracks] |= march.steps > most + PATH.steps_a_point * self.paths.count[tracks]
        return np.asarray(~self.given_up[tracks])

    def _filled(self, nodes: Nodes) -> Nodes:
        """The nodes with others between them, interpolated, where steps are too long for the certificate."""
        left, right = nodes.steps
        a, b = nodes.take(left), nodes.take(right)
        parts = np.ceil((b.place - a.place) / self.longest(a, b, b.drive)).astype(np.intp)
        step = np.repeat(np.arange(len(a)), np.maximum(parts - 1, 0))
        if not step.size:
            return nodes
        part = (1 + np.arange(step.size) - np.searchsorted(step, step)) / parts[step]
        a, b = a.take(step), b.take(step)
        place = a.place + part * (b.place - a.place)
        drive = self.paths.drive(a.track, place)
        more = replace(a, x=between(self.problem, a, b, part, drive), drive=drive, place=place, sure=b.sure)
        return Nodes.join([nodes, more])

    def _settled(self, nodes: Nodes) -> Nodes:
        """All nodes closed in one batch; those that do not stay where they were marked by a condition without end."""
        if not len(nodes):
            return nodes
        found = self.newton.nodes(nodes.x, nodes.drive, nodes.track, nodes.which, PATH.node)
        stays = found.done & (found.correction <= PATH.correction) & (found.which == nodes.which)
        condition = np.where(stays, found.condition, np.inf)
        return replace(nodes, x=found.x, Z=found.Z, condition=condition)

    # --- the certificate -------------------------------------------------------------------------------------------------

    def _certified(self, nodes: Nodes, left: Index, right: Index) -> tuple[Mask, Nodes]:
        """Whether no singular point lies on the tracks between nodes ``left`` and ``right``, and the nodes in the middle of the steps.

        The middle is predicted by Hermite interpolation of both ends and closed. The matrix along the track is, up to third order, the
        parabola through those at both ends and in the middle; no matrix on it, nor near it for complex places, may be singular (see
        ``Factored.regular_between``). At a crossing or a fold between the ends the parabola has a singular point however short the
        step. That the middle closes with a small correction and moves on as its neighbors do (see ``certificate.smooth``) excludes
        that the ends lie on different branches. What is left out is the third order: a test, not interval arithmetic.
        """
        a, b = nodes.take(left), nodes.take(right)
        place = 0.5 * (a.place + b.place)
        drive = self.paths.drive(a.track, place)
        x = between(self.problem, a, b, 0.5, drive)
        found = self.newton.nodes(x, drive, a.track, a.which, PATH.node)
        middle = Nodes.closed(found, drive, a.track, place, sure=True)
        ok = found.done & (found.which == a.which) & (found.correction <= PATH.correction)
        ok &= found.condition <= PATH.singular
        ok &= np.isfinite(a.condition) & np.isfinite(b.condition)
        here = self.problem.at(found.x, drive, a.track)
        f = self.problem.factored(here, a.which)
        ok &= smooth(self.problem, a, middle, b, found.correction, f.motions())
        self.work.evaluations += len(ok)
        self.work.factorizations += len(ok)
        test = np.flatnonzero(ok)
        if test.size:
            ends, sides = nodes.ends(left[test], right[test])
            beside = self.problem.at(ends.x, ends.drive, ends.track)
            self.work.evaluations += len(ends)
            if test.size < len(ok):
                here = here.part(test)
                f = self.problem.factored(here, a.which[test])
            ok[test] = f.regular_between(beside, *sides)
        return ok, middle

    def _certified_all(self, nodes: Nodes) -> Nodes:
        """Nodes with those in the middle of all steps; steps that could not be certified are halved a few times."""
        for _ in range(PATH.finest):
            left, right = nodes.steps
            open_ = ~nodes.sure[right]
            left, right = left[open_], right[open_]
            if not left.size:
                break
            ok, middle = self._certified(nodes, left, right)
            sure = nodes.sure.copy()
            sure[right[ok]] = True
            closed = np.flatnonzero(ok | (np.isfinite(middle.condition) & (middle.condition <= PATH.singular)))
            kept = replace(middle.take(closed), sure=ok[closed])
            nodes = Nodes.join([replace(nodes, sure=sure), kept])
        return nodes

    def _cut(self, nodes: Nodes) -> Nodes:
        """Every track up to its first step that is not certified."""
        left, right = nodes.steps
        bad = ~nodes.sure[right]
        limit = np.full(len(self.paths.end), np.inf)
        np.minimum.at(limit, nodes.track[left[bad]], nodes.place[left[bad]])
        return nodes.take((nodes.place <= limit[nodes.track]) & (np.isfinite(nodes.condition) | (nodes.place == 0.0)))

    # --- the careful march -----------------------------------------------------------------------------------------------

    def _careful(self, nodes: Nodes, tracks: Index) -> Nodes:
        """Tracks taken up at their last nodes, every step closed and certified by itself, to their ends or to what ends them."""
        first, end = (np.searchsorted(nodes.track, tracks, side=side) for side in ("left", "right"))
        last, before = nodes.take(end - 1), nodes.take(np.maximum(end - 2, first))
        march = March(last, before, before.place < last.place, np.full(len(tracks), PATH.shortest_quick))
        least = self._least.copy()
        np.minimum.at(least, nodes.track, nodes.condition)
        found = [nodes]
        while len(march.last):
            stuck = ~self._careful_step(march, least, found) & (march.h < PATH.shortest)
            if stuck.any():
                nodes = Nodes.join(found)
                for i in np.flatnonzero(stuck):
                    nodes = self._passed(nodes, march, int(i))
                found = [nodes]
            going, track = self._spend(march, PATH.careful_steps), march.last.track
            reached = np.array([self.ends[v] is End.REACHED for v in track])
            march.keep(going & reached & (march.last.place < self.paths.end[track]))
        return Nodes.join(found)

    def _careful_step(self, march: March, least: Array, found: list[Nodes]) -> Mask:
        """One step of every track that is on its way, put to the nodes ``found`` where it is certified; which are.

        ``least (V,)``: the least condition numbers on the tracks up to there.
        """
        last = march.last
        at, drive, x, order = self.predicted(march)
        step = self.newton.nodes(x, drive, last.track, last.which, PATH.node)
        new = Nodes.closed(step, drive, last.track, at, sure=True)
        # beyond this condition rounding moves a state by as much as branches that cross are apart (a fold is far beyond its limit there)
        worst = np.maximum(PATH.crossing, 1e3 * least[last.track])
        good = step.done & (step.correction <= PATH.correction) & (step.condition <= worst)
        good &= step.which == last.which
        trial = np.flatnonzero(good)
        if trial.size:
            pairs, left = Nodes.join([last.take(trial), new.take(trial)]), 2 * np.arange(trial.size)
            ok, middle = self._certified(pairs, left, left + 1)
            good[trial], middle = ok, middle.take(ok)
        march.h = next_step(at - last.place, step.correction, order, good, self.longest(last, new, drive))
        kept = np.flatnonzero(good)
        if kept.size:
            self.work.careful += kept.size
            new = new.take(kept)
            np.minimum.at(least, new.track, new.condition)
            # where the condition grows as towards a fold, as |s* - s|^-1/2: no further than half of what is left
            grown = (new.condition / np.maximum(middle.condition, 1.0)) ** 2 - 1.0  # that of no equations is zero
            left_over = 0.5 * (new.place - middle.place) / np.where(grown > 0, grown, 1.0)
            h = np.where(grown > 0, np.maximum(np.minimum(march.h[kept], left_over), PATH.shortest), march.h[kept])
            march.h[kept] = h
            found += [middle, *self.moved(march, new, middle, kept)]
        return good

    def _passed(self, nodes: Nodes, march: March, i: int) -> Nodes:
        """All nodes, with the one behind the crossing where the track ``i`` of a march is stuck; as they are where it does not go on."""
        track = int(march.last.track[i])
        mine = nodes.take(nodes.track == track)
        beyond = self._beyond(self.with_lead(mine, track), track)
        if beyond is None:
            return nodes
        march.move(beyond, beyond, np.array([i]))
        march.known[i], march.h[i] = False, 0.5 * PATH.shortest_quick
        # the branch is smooth there: it is interpolated from where its nodes are not noise
        clear = max(2.0 * self.crossings[-1][1] - beyond.place[0], 0.0)
        return Nodes.join([nodes.take((nodes.track != track) | (nodes.place <= clear)), beyond])

    def with_lead(self, nodes: Nodes, track: int) -> Nodes:
        """The nodes of a track up to a singular point, and where that is soon after the start, those behind it, at places below zero.

        They are the branch on which the track begins: what the singular point is and how the branch passes it is told by them.
        """
        if not len(nodes):
            return self._leads.get(track, nodes)
        if not self.leads or nodes.place[-1] > LEAD or nodes.place[0] < 0.0:
            return nodes
        if track not in self._leads:
            starts = self.paths.drive(np.arange(len(self.paths.end)), np.zeros(len(self.paths.end)))
            direction = self.paths.drive(np.array([track]), np.array([PATH.first]))[:, 0] - starts[:, track]
            points = list(starts.T[:, :, None])
            points[track] = np.stack([starts[:, track], starts[:, track] - LEAD / PATH.first * direction], axis=1)
            back = Follower(self.problem, leads=False, work=self.work)
            least = np.full(len(points), np.nanmin(nodes.condition))
            found = back.follow(self._x, Paths(points), least=least).nodes
            found = found.take((found.track == track) & (found.place > 0.0))
            self._leads[track] = Nodes.join([replace(found, place=-found.place)])
        return Nodes.join([self._leads[track], nodes])

    def _beyond(self, nodes: Nodes, track: int) -> Nodes | None:
        """The node behind a crossing of branches, on the branch of continuous velocity; None at a fold (and the end is named).

        Towards a fold at ``s*`` rates grow as ``|s* - s|^-1/2``; towards a crossing they stay. The rates are what tells, not the condition
        of the equations, which is a matter of how they are solved. The branch is extrapolated from nodes well before the crossing, where
        the matrix is still regular, to as far behind it, and must close there with a correction that is small against the distance to
        any other branch.
        """
        # what is nearer, as where a track starts there, is rounding
        nodes = nodes.take(nodes.condition <= max(PATH.crossing, 1e3 * float(nodes.condition.min())))
        last = nodes.take(np.array([len(nodes) - 1]))
        size = np.abs(nodes.Z).max(axis=(0, 1))
        earlier = np.flatnonzero(nodes.condition < 0.05 * last.condition[0])
        if not earlier.size:
            # a start that cannot be left in either direction is a singular point itself
            there = track in self._leads and not len(self._leads[track])
            self.ends[track] = End.CROSSING if there else End.FOLD
            self.crossings += [(track, float(last.place[0]))] * there
            return None
        reference = int(earlier[-1])
        away = max(int(np.searchsorted(nodes.place, last.place[0] - PATH.away)) - 1, 0)
        if size[-1] > PATH.steeper * size[away:].min():  # a path may come back to the fold beside which it began
            self.ends[track] = End.FOLD
            return None
        self.ends[track] = End.CROSSING
        # the inverse of the condition falls to zero in proportion to the distance
        ratio = nodes.condition[reference] / last.condition[0]
        left = (last.place[0] - nodes.place[reference]) * ratio / (1.0 - ratio)
        crossing = float(last.place[0] + left)
        self.crossings.append((track, crossing))
        return self._behind(nodes, track, crossing)

    def _behind(self, nodes: Nodes, track: int, crossing: float) -> Nodes | None:
        for distance in (4e-3, 1e-3, 2.5e-4):
            # also where that is behind the end: whether a crossing is passed does not hang on where a path ends
            at = np.array([crossing + distance])
            smooth = nodes.take(nodes.place <= crossing - 0.5 * distance)
            smooth = smooth.take(smooth.which == smooth.which[-1:])
            smooth = smooth.take(np.unique(smooth.place, return_index=True)[1])
            if len(smooth) < 3:
                continue
            picked = smooth.take(_spread(smooth.place, crossing, distance))
            base = picked.take(np.array([-1]))
            drive = self.paths.drive(base.track, at)
            direction = (drive - base.drive) / (at - base.place)
            x = through(self.problem, picked, base, direction[:, 0], at)
            step = self.newton.nodes(x, drive, base.track, base.which, PATH.node)
            new = self.renewed(Nodes.closed(step, drive, base.track, at, sure=True))
            turn = np.abs((step.Z - base.Z) * direction).max() / max(1.0, float(np.abs(base.Z).max()))
            as_regular = step.condition[0] <= 4.0 * base.condition[0]
            if step.done[0] and step.correction[0] <= 1e-2 * distance and turn <= PATH.smooth and as_regular:
                self.ends[track] = End.REACHED
                return new
        return None


LEAD = 0.1
"""How far a track is followed behind its start, where a singular point lies no further ahead; as far as ``_behind`` asks for nodes."""


def _spread(places: Array, crossing: float, distance: float) -> Index:
    """A few nodes before a crossing at distances that grow, the nearest last."""
    wanted = crossing - distance * np.array([16.0, 8.0, 4.0, 2.0, 1.0])
    return np.unique(np.clip(np.searchsorted(places, wanted), 0, len(places) - 1))
