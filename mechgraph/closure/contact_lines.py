"""Forces of gears and belts in a configuration: couplings that act along lines of their own, not as efforts in freedoms.

A coupling with the multiplier m exerts the effort ``c_j m`` in freedom j, as if through that pair. Gears touch each other instead: the
wrench ``F = G m`` acts on gear b, ``-F`` on gear a, and the pairs j on the way between them, passed in the sense ``s_j``, are relieved of
``s_j F`` and of the effort that they would carry:

    wrench of the pair = wrench that closes the equilibrium - (s_j G - E_j c_j) m.

``s_j G . S_j = c_j`` (see ``model.contact``), so that what is taken off does no work in any freedom: motion and efforts are those of the
linear relation, reactions are those of the contact.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.model.couplings import Axes, Contact, Lines


class ContactLines:
    """Lines of all contacts at the positions of a configuration, internal units about the internal origin."""

    def __init__(self, here: Configuration) -> None:
        self.here = here
        self.contacts = [(g, c) for g, c in enumerate(here.system.m.couplings) if isinstance(c, Contact)]

    def __bool__(self) -> bool:
        return bool(self.contacts)

    def _columns(self, contact: Contact) -> Index:
        return np.array([self.here.system.first_column[step.pair] for step in contact.steps], dtype=np.intp)

    @cached_property
    def wrenches(self) -> list[tuple[Array, Array]]:
        """For every contact the wrench on gear b for a unit multiplier ``(6, 2, T)``, of a positive and of a negative one, and the points
        ``(3, 2, T)`` at which it acts.
        """
        return [self._of(g, contact) for g, contact in self.contacts]

    def _of(self, g: int, contact: Contact) -> tuple[Array, Array]:
        here, columns = self.here, self._columns(contact)
        first, last = contact.steps[0].pair, contact.steps[-1].pair
        S = [here.S[:, columns[i]] for i in (0, -1)]
        along = S[1][3:] if contact.slides else S[1][:3]
        axes = Axes(here.pair_points[:, first], S[0][:3], here.pair_points[:, last], along, here.system.par.L)
        P, n = self._lines(g, axes)
        line = np.concatenate([cross(P, n), n])
        power = contact.steps[0].sense * (line * S[0][:, None]).sum(axis=0)
        size = here.system.coupling_matrix[g, columns[0]] / power
        # the first line serves the multipliers that make its force push, the second the others
        turned = size[0] < 0.0
        pick = np.where(turned, [[1], [0]], [[0], [1]])
        places = np.arange(here.T)
        G = np.stack([(line * size)[:, pick[i], places] for i in range(2)], axis=1)
        return G, np.stack([P[:, pick[i], places] for i in range(2)], axis=1)

    def _lines(self, g: int, axes: Axes) -> Lines:
        """Points and directions of the force; of variants with gears of their own those of each."""
        own = self.here.system.par.items[g]
        if len(own) == 1:
            return own[0].lines(axes)
        P, n = np.empty((3, 2, self.here.T)), np.empty((3, 2, self.here.T))
        first, same = np.unique([id(gears) for gears in own], return_index=True, return_inverse=True)[1:]
        for i, gears in enumerate(own[first]):
            at = np.flatnonzero(same == i)
            P[..., at], n[..., at] = gears.lines(axes.at(at))
        return P, n

    def on_gear(self, multipliers: Array, flank: Array) -> list[Array]:
        """For every contact the wrench on gear b ``(6, ..., T)`` for multipliers ``(n, ..., T)`` of all couplings.

        ``flank (n, T)``: the sign of the multiplier that says which line acts.
        """
        out = []
        for (g, _), (G, _) in zip(self.contacts, self.wrenches, strict=True):
            acting = np.where(flank[g] < 0.0, G[:, 1], G[:, 0])
            value = multipliers[g]
            out.append(acting.reshape(6, *(1,) * (value.ndim - 1), self.here.T) * value)
        return out

    def through(self, multipliers: Array, flank: Array) -> Array:
        """What would pass through the pairs on the way between gears that do not touch each other, ``s_j F``, ``(6, P, ..., T)``."""
        out = np.zeros((6, len(self.here.system.m.pairs), *multipliers.shape[1:]))
        for (_, contact), F in zip(self.contacts, self.on_gear(multipliers, flank), strict=True):
            for step in contact.steps:
                out[:, step.pair] += step.sense * F
        return out

    def relief(self, multipliers: Array, flank: Array) -> Array:
        """What is taken off the wrenches of all pairs ``(6, P, ..., T)`` for multipliers ``(n, ..., T)`` of all couplings."""
        here, out = self.here, self.through(multipliers, flank)
        for g, contact in self.contacts:
            for step, column in zip(contact.steps, self._columns(contact).tolist(), strict=True):
                E = here.E[:, column] * here.system.coupling_matrix[g, column]
                out[:, step.pair] -= E.reshape(6, *(1,) * (multipliers.ndim - 2), here.T) * multipliers[g]
        return out

    def unit(self, flank: Array) -> list[Array]:
        """For every coupling the wrench on gear b for a unit multiplier, ``(6, 1, T)``; none for one that acts in freedoms."""
        n = len(self.here.system.m.couplings)
        out = [np.zeros((6, 0, self.here.T))] * n
        for (g, _), F in zip(self.contacts, self.on_gear(np.ones((n, self.here.T)), flank), strict=True):
            out[g] = F[:, None]
        return out
