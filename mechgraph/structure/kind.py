"""The kind of a mechanism or of one loop: planar, spherical, or neither, found from the twists of its pairs.

Planar twists are parallel to one plane with normal n, spherical ones are turns about one centre O:

    planar  n x w = 0,  n . v = 0        spherical  v + w x O = 0

Where not all pairs have such twists alone (balls in place of pins, cylinders between balls), the mechanism still moves as a planar or
spherical one if its motions at a nearby position, passive ones set aside, are such motions of every pair.
Source: Herve, The Lie group of rigid body displacements, Mechanism and Machine Theory 34, 1999.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from mechgraph.algebra.se3 import Array, skew
from mechgraph.closure.rank import ClosureRank
from mechgraph.model.parameters import Parameters
from mechgraph.numerics.tolerances import MOTIONS, RANKS
from mechgraph.structure.finite_motion import FiniteMotion
from mechgraph.structure.mobility import Freedoms

MOST_MOTIONS = 200
"""Mobility up to which the motions of pairs of other kinds are looked at."""


@dataclass(frozen=True)
class Kind:
    """A kind by ``name`` ("" for neither) with its ``place (3,)``: the unit normal (``is_direction``), or the centre.

    ``outside (3, 6)`` are functionals that vanish on its twists about the internal origin; ``by_pairs`` whether all pairs have such
    twists alone.
    """

    name: str = ""
    place: tuple[float, ...] = ()
    outside: Array | None = field(default=None, repr=False)
    is_direction: bool = False
    by_pairs: bool = True

    @property
    def twists(self) -> Array:
        """Orthonormal twists ``(6, 3)`` of the kind; none for neither."""
        return np.zeros((6, 0)) if self.outside is None else np.linalg.svd(self.outside)[2][3:].T

    def in_global(self, par: Parameters) -> Kind:
        """The kind with its centre in the global frame."""
        centre = par.L * np.array(self.place) + par.origin if self.place and not self.is_direction else self.place
        return replace(self, place=tuple(map(float, centre)))

    def holds(self, twists: Array) -> bool:
        """Whether twists ``(6, n)`` are all of this kind."""
        if self.outside is None or not twists.size:
            return False
        size = np.abs(twists).max()
        return bool(np.abs(self.outside @ twists).max() <= RANKS.position * size * np.abs(self.outside).max())


def planar(twists: Array) -> Kind:
    """The plane to which the turns ``(6, n)`` (without any: the slides) are parallel."""
    turning = np.linalg.norm(twists[:3], axis=0) > RANKS.position
    if turning.any():
        normal = _principal(twists[:3, turning])[0][:, 0]
    else:
        U, s = _principal(twists[3:])
        if (s > RANKS.position).sum() != 2:
            return Kind()
        normal = U[:, 2]
    normal = normal * np.sign(normal[np.argmax(np.abs(normal) > 1e-6)])
    normal = np.where(np.abs(normal) < RANKS.position, 0.0, normal)
    across = skew(normal)[np.argsort(-np.linalg.norm(skew(normal), axis=1))[:2]]
    return Kind(
        "planar",
        tuple(normal.tolist()),
        np.block([[across, np.zeros((2, 3))], [np.zeros(3), normal]]),
        is_direction=True,
    )


def _principal(vectors: Array) -> tuple[Array, Array]:
    """Left singular vectors ``(3, 3)`` and singular values of vectors ``(3, n)``, by way of their triangular factor."""
    triangular: Array = np.asarray(np.linalg.qr(vectors.T, mode="r"))
    U, s, _ = np.linalg.svd(triangular.T)
    return U, s


def spherical(twists: Array) -> Kind:
    """The centre through which the turns ``(6, n)`` pass: of the least squares of ``v + w x O``."""
    rows = np.moveaxis(skew(twists[:3]), -1, 0).reshape(-1, 3)
    if np.linalg.matrix_rank(rows, tol=RANKS.position) < 3:
        return Kind()
    centre: Array = np.asarray(np.linalg.lstsq(rows, -twists[3:].T.ravel(), rcond=None)[0])
    return Kind("spherical", tuple(centre.tolist()), np.concatenate([-skew(centre), np.eye(3)], axis=1))


KINDS: tuple[Callable[[Array], Kind], ...] = (planar, spherical)
"""What is looked for, in this order: turns about one line alone are both."""


def kind_of(twists: Array) -> Kind:
    """The kind of twists ``(6, n)`` about the internal origin."""
    found = (make(twists) for make in KINDS if twists.size)
    return next((kind for kind in found if kind.holds(twists)), Kind())


def kind_of_mechanism(freedoms: Freedoms, motion: FiniteMotion | None) -> Kind:
    """The kind of all pairs, else of the motions beside the passive ones at a position nearby."""
    rows = freedoms.position.rows
    kind = kind_of(rows.S)
    look = motion and not kind.name and freedoms.mobility <= MOST_MOTIONS
    nearby = motion.closure_nearby if motion and look else None
    if nearby is None:
        return kind
    alone = rows.S[:, rows.first_column[:-1][np.diff(rows.first_column) == 1]]
    pins = alone[:, np.linalg.norm(alone[:3], axis=0) > 0.5]
    if not pins.size:
        return kind
    alike = np.abs(pins[:3].T @ pins[:3]) > 1 - RANKS.position
    candidates = (planar(pins[:, alike[np.argmax(alike.sum(axis=1))]]), spherical(pins))
    return next((replace(c, by_pairs=False) for c in candidates if _moves_so(c, freedoms, nearby)), kind)


def _moves_so(kind: Kind, freedoms: Freedoms, nearby: ClosureRank) -> bool:
    """Whether the motions nearby, but for as many as there are passive ones of other kinds, keep every pair to this kind."""
    if kind.outside is None:
        return False
    rows, motions = nearby.reduced.rows, nearby.motions
    some = rows.first_column[:-1][np.diff(rows.first_column) > 0]
    leaving = np.add.reduceat((kind.outside @ rows.S)[:, :, None] * motions, some, axis=1).reshape(-1, motions.shape[1])
    of_kind = int((np.linalg.eigvalsh(leaving.T @ leaving) < MOTIONS.nearby**2).sum())
    others = sum(not kind.holds(p.twist[:, None]) for p in freedoms.passive)
    return 0 < of_kind == motions.shape[1] - others
