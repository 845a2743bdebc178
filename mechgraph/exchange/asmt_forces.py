"""Forces of FreeCAD along the line of two markers: springs where their formula is one, else force laws.

``InLineForceTorque``: the force on marker I is ``tension`` towards J, that on J opposite; a formula of ``rIJ(self)``, their distance,
``vrIJ(self)``, its rate, and ``time``. Source: OndselSolver, ForTorActionInLine.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.exchange.asmt import Connection
from mechgraph.exchange.asmt_standing import Standing
from mechgraph.exchange.formula import FormulaFault, law
from mechgraph.model.loads import ForceLaw, Spring

LINEAR = 1e-12
"""Part of the force by which a formula may differ from a line in distance and rate."""
LOOKED_AT = np.array([[0.0, 1.0, 0.0, 0.7, 1.9, 0.7], [0.0, 0.0, 1.0, -1.3, 0.4, -1.3], [0.0, 0.0, 0.0, 0.0, 0.6, 2.0]])
"""Distances, rates and times at which it is looked at."""


def force(builder: Standing, found: Connection) -> Spring | ForceLaw | None:
    """The load of a force; None, and a fault, where a marker is not there or a formula is none."""
    ends = builder.ends(found)
    if ends is None:
        return None
    try:
        tension = law(found.node.word("tension"), builder.assembly.variables)
        if law(found.node.word("twist") or "0", builder.assembly.variables)(*LOOKED_AT).any():
            builder.faults.append(
                f"{found.title}: twist: a couple about the line of two points is no load here; delete it there"
            )
            return None
        T = tension(*LOOKED_AT)
    except FormulaFault as fault:
        builder.faults.append(f"{found.title}: {fault}")
        return None
    markers = builder.assembly.markers
    p, q = (
        tuple((builder.pose(path) if part == builder.assembly.name else markers[path].pose)[:, 3].tolist())
        for path, part in zip((found.i, found.j), ends, strict=True)
    )
    stiffness, damping = float(T[1] - T[0]), float(T[2] - T[0])
    off = np.abs(T - (T[0] + stiffness * LOOKED_AT[0] + damping * LOOKED_AT[1])).max()
    if np.isfinite(T).all() and stiffness and T[0] / stiffness <= 0 and off <= LINEAR * np.abs(T).max():
        return Spring(*ends, p, q, stiffness, float(-T[0] / stiffness), damping)

    def push(x: Array, v: Array, t: Array | None) -> Array:
        return -tension(x, v, np.zeros_like(x) if t is None else np.broadcast_to(t, x.shape))

    return ForceLaw((*ends, p, q), law=push)
