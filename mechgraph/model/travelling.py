"""What frames that travel along curves and on surfaces share: how they are seen from where they begin, and evaluated once a place."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.errors import ShapeError
from mechgraph.model.curves import turned
from mechgraph.model.factors import Factor, PoseStack, Stack, entries


class Travelling(Factor):
    """A frame on what a link bears, lengths over ``unit``: ``D = F(0)^-1 F(q)``; ``pair`` is its name in messages.

    ``place_of(x)`` evaluates what it travels on; from that follow the pose, the twists and their rates.
    """

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

    @property
    @abstractmethod
    def bend(self) -> float:
        """Greatest curvature, over one of ``unit``."""

    @abstractmethod
    def place_of(self, x: Array) -> Any:
        """The place at coordinates ``x``."""

    @abstractmethod
    def pose_at(self, here: Any) -> Array:
        """The pose at a place."""

    @abstractmethod
    def twists_at(self, here: Any) -> Array:
        """The twists at a place."""

    @abstractmethod
    def twist_rates_at(self, here: Any, x: Array, dq: Array) -> Array:
        """The rates of the twists at a place with coordinates ``x``."""

    def here(self, x: Array) -> Any:
        """The place at coordinates ``x``; what its shape cannot answer is named with the pair."""
        with self.named():
            return self.place_of(x)

    @contextmanager
    def named(self) -> Iterator[None]:
        """What a shape cannot answer is named with the pair."""
        try:
            yield
        except ShapeError as error:
            raise error.of(self.pair) from error.__cause__

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        return self.pose_at(self.here(x))

    def twists(self, x: Array, pitch: Array) -> Array:
        """Twists ``(w, v + w x (p - x))`` of a frame at x with the rates w and v, p the origin of the frame before the factor."""
        return self.twists_at(self.here(x))

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """The derivative of ``sum_j S_j q'_j`` along ``q'``."""
        return self.twist_rates_at(self.here(x), x, dq)

    def stack(self, factors: Sequence[Factor], counts: Sequence[int]) -> Stack:
        """Copies evaluated together."""
        return TravellingStack(self)

    def _off(self, p: Array) -> Array:
        """Points ``(3, ...)`` of the link from the origin of the frame at coordinates zero."""
        return (p - self.start[:, 3].reshape(3, *(1,) * (p.ndim - 1))) / self.unit

    def _pose_seen(self, R: Array, p: Array) -> Array:
        """The frame with axes ``R (3, 3, ...)`` at ``p (3, ...)``, seen from that at coordinates zero, ``(3, 4, ...)``."""
        X = np.empty((3, 4, *p.shape[1:]), dtype=p.dtype)
        X[:, :3], X[:, 3] = R, self._off(p)
        return turned(self.start[:, :3].T, X)

    def _screw_seen(self, p: Array, w: Array, v: Array) -> Array:
        """The screw ``(w, v)`` at ``p``, ``(3, ...)`` each, seen from the frame at coordinates zero, ``(w, v + w x (0 - p)) (6, ...)``."""
        screw = np.stack([w, v - cross(w, self._off(p))])
        return np.matmul(self.start[:, :3].T, screw.reshape(2, 3, -1)).reshape(6, *p.shape[1:])


class TravellingStack(PoseStack):
    """Copies of one of them; a place serves poses, twists and rates at the same coordinates."""

    def __init__(self, factor: Travelling) -> None:
        super().__init__(factor)
        self.travelling = factor
        self._last: tuple[Array, Any] | None = None

    def _here(self, x: Array) -> Any:
        last = self._last
        if last is None or last[0].shape != x.shape or np.count_nonzero(last[0] != x):
            last = self._last = x, self.travelling.here(x)
        return last[1]

    def values(self, x: Array) -> Array:
        """Entries of the pose and of its inverse."""
        return entries(self.travelling.pose_at(self._here(x)))

    def twists(self, x: Array, pitch: Array) -> Array:
        """Those of the factor."""
        return self.travelling.twists_at(self._here(x))

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """Those of the factor."""
        return self.travelling.twist_rates_at(self._here(x), x, dq)
