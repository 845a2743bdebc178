"""Bodies that roll on each other without sliding, in the equations of motion.

Sliding rates are ``A q' = 0 (m,)`` while friction holds. With ``q' = Z v + Z_p p'`` and ``C = A Z`` these are equations of rates that no
coordinates meet, ``C v + A Z_p p' = 0`` and ``C v' + A q''_0 + A' q' = 0``, with forces ``f`` along the tangents for multipliers:

    v' = M^-1 (Q + C^T f),   f = -G^+ (C M^-1 Q + ...),   G = C M^-1 C^T.

Forces that move nothing, as across a guide, are those of least norm. Source: Neimark and Fufaev, Dynamics of Nonholonomic Systems, 1972.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mechgraph.force.friction import Grip, Rubbed
from mechgraph.kinematics.rates import Velocities
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.model.friction import Friction


class Rolling:
    """Friction that holds at closed states with motions ``Z (F, n, T)``; ``moves``: accelerations ``(n, T)`` under efforts ``(F, T)``."""

    def __init__(
        self, here: Configuration, loads: Sequence[Friction], Z: Array, moves: Callable[[Array], Array]
    ) -> None:
        self.here, self.grips = here, [Grip.of(here, load) for load in loads]
        self.rows = np.concatenate([grip.rows(here) for grip in self.grips])
        self.C = np.einsum("mft,fnt->mnt", self.rows, Z)
        self.yields = np.stack([moves(row) for row in self.rows], axis=1)
        G = np.moveaxis(np.einsum("mnt,nkt->mkt", self.C, self.yields), -1, 0)
        self.inverse = np.moveaxis(np.linalg.pinv(G, rcond=MOTIONS.rounding, hermitian=True), 0, -1)
        self.ends = np.cumsum([grip.W.shape[1] for grip in self.grips])[:-1]

    def held(self, off: Array) -> tuple[Array, Array]:
        """Forces ``(m, ..., T)`` that take back what slides ``(m, ..., T)``, and what the independent rates ``(n, ..., T)`` change by."""
        forces = -np.einsum("mkt,k...t->m...t", self.inverse, off)
        return forces, np.einsum("nmt,m...t->n...t", self.yields, forces)

    def accelerations(self, at: Velocities, ddq: Array) -> Array:
        """``A q'' + A' q' (m, T)``."""
        bias = np.concatenate([grip.bias(at) for grip in self.grips])
        return np.asarray((self.rows * ddq).sum(axis=1) + bias)

    def rubbing(self, rubs: Rubbed, forces: Array) -> Rubbed:
        """Friction with that of what rolls ``(m, T)``."""
        for grip, part in zip(self.grips, np.split(forces, self.ends), strict=True):
            rubs = rubs.with_grip(self.here, grip, part)
        return rubs

    def on_links(self, forces: Array) -> Array:
        """Wrenches ``(6, N, ..., T)`` of forces ``(m, ..., T)``."""
        parts = zip(self.grips, np.split(forces, self.ends), strict=True)
        return np.asarray(sum(grip.on_links(self.here, part) for grip, part in parts))
