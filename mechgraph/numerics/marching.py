"""Steps of many tracks at once: where the next nodes are predicted, how long steps are, which form the equations take at a node."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.hermite import cubic
from mechgraph.numerics.newton import Newton, Problem, Work
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes, Paths

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


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
