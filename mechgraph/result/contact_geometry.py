"""Where the elements of a contact touch at the positions of a solution, in which direction they press, and how they bend there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.pair import Pair
from mechgraph.pairs.contact_types import is_open, placed_surface, pressing, takes_curves
from mechgraph.pairs.factors import Touching
from mechgraph.result.values import Values


class ContactGeometry:
    """Centre, point, normal and curvatures of one contact, arrays over the positions."""

    def __init__(self, values: Values, index: int) -> None:
        self._values, self._index = values, index

    @property
    def _pair(self) -> Pair:
        return self._values.whole.pairs[self._index]

    @property
    def _form(self) -> Touching:
        assert self._pair.type.touching is not None
        return self._pair.type.touching

    @cached_property
    def _sense(self) -> float:
        """1 where a presses on b along the first direction of the pair, -1 where against it.

        Of two curves, the first of which is open and has no inside, towards the side on which the second bends away from it.
        """
        if not self._form.curved or len(self._form.forces) > 1:
            return 1.0
        known, apart = pressing(self._pair.type), self._apart
        if apart is None or (apart.size and takes_curves(self._pair.type)[0].travel.is_closed):
            return known
        most = apart.reshape(-1)[np.argmax(np.nan_to_num(np.abs(apart)))] if apart.size else 0.0
        return float(np.sign(most)) or known

    @property
    def _frame(self) -> int:
        """The frame of the pair in which the normal force acts."""
        return next(c.frame for c in self._pair.type.reactions or () if c.name == self._form.forces[0])

    @cached_property
    def _bodies(self) -> tuple[Array, Array, Array, Array]:
        """Poses and twists of both links."""
        m = self._values.whole
        (Xa, Va, _), (Xb, Vb, _) = (self._values.link(m.place_of_link(name)) for name in (self._pair.a, self._pair.b))
        return Xa, Va, Xb, Vb

    def _marker(self, side: int) -> tuple[Array, Array]:
        """Axes ``(..., 3, 3)`` (columns) and origin ``(..., 3)`` of the marker on a link."""
        X, local = self._bodies[2 * side], self._pair.markers[side].pose()
        return X[..., :3, :3] @ local[:, :3], (X[..., :3, :3] @ local[:, 3]) + X[..., :3, 3]

    @cached_property
    def _directions(self) -> Array:
        """Global directions ``(..., 3, n)`` of the components of the normal force."""
        names = self._pair.type.component_names
        return self._values.directions(self._index)[..., [names.index(name) for name in self._form.forces]]

    @cached_property
    def _parts(self) -> Array:
        """The components of the normal force ``(..., n)``."""
        found = self._values.components(self._index)
        return np.stack([found[name] for name in self._form.forces], axis=-1)

    @cached_property
    def normal(self) -> Array:
        """Unit direction ``(..., 3)`` in which a presses on b: the way the force acts; without forces the first direction of the pair."""
        first = self._sense * self._directions[..., 0]
        if not self._values.has_forces:
            return first
        force = (self._directions * self._parts[..., None, :]).sum(axis=-1)
        size = np.linalg.norm(force, axis=-1, keepdims=True)
        if self._pair.closed == "force" and len(self._form.forces) == 1:
            return first
        return np.where(size > 0, force / np.where(size > 0, size, 1.0), first)

    @property
    def center(self) -> Array:
        """Centre ``(..., 3)`` of the ball, roller or cylinder on b, global; where they touch where b has none."""
        return self._values.frame_origin(self._index, self._frame)

    @property
    def point(self) -> Array:
        """Where they touch ``(..., 3)``, global; of a line its middle."""
        return self.center - (self._pair.radius_b or 0.0) * self.normal

    def _velocity(self, link: int, point: Array) -> Array:
        V = self._bodies[2 * link + 1]
        return V[..., 3:] + np.cross(V[..., :3], point)

    # --- curvatures ----------------------------------------------------------------------------------------------------

    @cached_property
    def _of_centre(self) -> tuple[Array, Array]:
        """Curvatures ``(...)`` towards the normal: both principal ones of the surface of the centres of a ball; that of the curve of the
        centres of a ball or roller, twice; of two curves the relative one, twice.
        """
        row = self._pair.type
        if (surface := placed_surface(row)) is not None:
            towards = np.sign((self.normal * self._directions[..., 0]).sum(axis=-1))
            one, two = towards * self._where_known(surface.curvatures, slice(0, 2))
            return one, two
        bends = self._where_known(takes_curves(row)[0].curvatures, 0)
        if len(self._form.forces) > 1:
            n = np.einsum("...ij,...i->j...", self._directions, self.normal)
            return ((bends[:2] * n).sum(axis=0),) * 2
        return (self._sense * (bends[1] if self._apart is None else self._apart),) * 2

    @cached_property
    def _apart(self) -> Array | None:
        """By how much two curves bend away from each other ``(...)``, that of b against that of a towards y of the frame; None else."""
        places = takes_curves(self._pair.type)
        if len(places) < 2:
            return None
        one, two = (self._where_known(place.curvatures, k)[1] for k, place in enumerate(places))
        return np.asarray(two - one)

    def _where_known(self, of: Callable[[Array], Array], coordinates: int | slice) -> Array:
        """A function of some coordinates of the pair ``(n, ...)``, NaN where the position was not solved: no shape is asked there."""
        x = np.moveaxis(self._values.coordinates(self._index)[0], -1, 0)
        known = np.isfinite(x).all(axis=0)
        found = of(x[coordinates][..., known])
        out = np.full((len(found), *known.shape), np.nan)
        out[:, known] = found
        return out

    @cached_property
    def _room(self) -> tuple[Array, float]:
        """What is above zero where the elements touch at one place only ``(...)``, and its scale: the relative curvature of two curves,
        ``(1 + r k) / r`` of a ball or roller; infinite where nothing is known of the elements.
        """
        radius = self._pair.radius_b
        none = np.full(self._values.batch, np.inf)
        if not self._form.curved or len(self._form.forces) > 1 or (radius is None and self._apart is None):
            return none, 0.0
        least = np.minimum(*self._of_centre)
        if takes_curves(self._pair.type) and not is_open(self._pair) and self._pair.closed != "force":
            least = -np.abs(least)  # a slot has two sides
        if radius is not None:
            least = 1.0 / radius + least
        return least, float(np.nanmax(np.abs(least), initial=0.0))
