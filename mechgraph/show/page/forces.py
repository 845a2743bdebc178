"""What pairs transmit as arrows: the part of a reaction that is unique, and what of it is not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.pair import Pair
from mechgraph.model.row_parts import Component


def wrench_of(
    pair: Pair, frames: Mapping[str, Array], parts: Mapping[Component, Array], length: float = 1.0
) -> tuple[Array, Array]:
    """Force and moment about marker B ``(T, 3)``, global, of components with values ``(T,)``; moments counted in forces times ``length``.

    Sum of ``v (R_k w_F)`` and of ``v (R_k w_M + (o_k - o_B) x R_k w_F)``, k the frame of the component.
    """
    end = frames[f"pair:{pair.name}@{pair.type.f}"]
    force, moment = np.zeros((2, len(end), 3))
    for part, value in parts.items():
        X = frames[f"pair:{pair.name}@{part.frame}"]
        w = np.array(part.wrench) + pair.pitch_per_radian * np.array(part.per_pitch)
        F, M = X[:, :, :3] @ w[3:], X[:, :, :3] @ w[:3]
        arm = np.zeros(3) if part.at_b else X[:, :, 3] - end[:, :, 3]
        force = force + value[:, None] * F
        moment = moment + value[:, None] * ((length if part.is_couple else 1.0) * M + np.cross(arm, F))
    return force, moment


def components_of(pair: Pair) -> dict[str, Component]:
    """The reaction components of a pair by name; none for a row whose components mix forces and moments."""
    return {c.name: c for c in pair.type.reactions or ()}
