"""What frames that travel along curves and on surfaces share: how they are seen from where they begin."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.curves import turned
from mechgraph.model.factors import Factor


class Travelling(Factor):
    """A frame on what a link bears, lengths over ``unit``: ``D = F(0)^-1 F(q)``; ``pair`` is its name in messages."""

    unit: float
    pair: str

    @property
    def kind(self) -> Hashable:
        """Each by itself."""
        return self

    @property
    @abstractmethod
    def start(self) -> Array:
        """The frame at coordinates zero on its link ``(3, 4)``."""

    def _off(self, p: Array) -> Array:
        """Points ``(3, ...)`` of the link from the origin of the frame at coordinates zero."""
        return (p - self.start[:, 3].reshape(3, *(1,) * (p.ndim - 1))) / self.unit

    def _pose_seen(self, R: Array, p: Array) -> Array:
        """The frame with axes ``R (3, 3, ...)`` at ``p (3, ...)``, seen from that at coordinates zero, ``(3, 4, ...)``."""
        back = self.start[:, :3].T
        return np.concatenate([turned(back, R), turned(back, self._off(p))[:, None]], axis=1)

    def _screw_seen(self, p: Array, w: Array, v: Array) -> Array:
        """The screw ``(w, v)`` at ``p``, ``(3, ...)`` each, seen from the frame at coordinates zero, ``(w, v + w x (0 - p)) (6, ...)``."""
        return np.concatenate([turned(self.start[:, :3].T, part) for part in (w, v - cross(w, self._off(p)))])
