"""Self-stresses as arrows on the mechanism, and every advice before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.model.row_parts import Component
from mechgraph.report.report import DeterminacyReport
from mechgraph.show.page.forces import components_of, wrench_of
from mechgraph.show.page.packing import rounded
from mechgraph.structure.self_stress import SelfStress


def stress_arrows(m: Mechanism, stress: SelfStress, frames: Mapping[str, Array], L: float) -> list[dict[str, Any]]:
    """What link a exerts on link b in a self-stress, at marker B; moments divided by ``L`` so that they compare."""
    out = []
    for i, pair in enumerate(m.pairs):
        parts = _parts(pair, stress)
        if not parts:
            continue
        at_first = {name: X[:1] for name, X in frames.items() if name.startswith(f"pair:{pair.name}@")}
        force, moment = wrench_of(pair, at_first, parts, L)
        at = at_first[f"pair:{pair.name}@{pair.type.f}"][0, :, 3]
        out.append(
            {"pair": i, "at": rounded(at), "force": rounded(force[0]), "moment": rounded(moment[0] / L), "open": False}
        )
    return out


def _parts(pair: Pair, stress: SelfStress) -> dict[Component, Array]:
    """Components and efforts of a pair in a self-stress."""
    own = {f"{pair.name}:{name}": c for name, c in components_of(pair).items()}
    parts = {own[name]: np.array([v]) for name, v in stress.components.items() if name in own}
    single = [name for name in stress.efforts if name == pair.name]
    for freedom, effort in zip(pair.type.freedoms, pair.type.efforts, strict=True):
        for name in (f"{pair.name}.{freedom.name}", *single):
            if name in stress.efforts:
                parts[effort] = np.array([stress.efforts[name]])
    return parts


def compared(before: DeterminacyReport, after: DeterminacyReport) -> list[list[str]]:
    """What an advice changes, as rows: name, before, after."""

    def numbers(r: DeterminacyReport) -> list[tuple[str, str]]:
        return [
            ("mobility", "-" if r.mobility is None else str(r.mobility)),
            ("redundancy", "-" if r.redundancy is None else str(r.redundancy)),
            ("passive freedoms", str(len(r.passive))),
            ("self-stresses with the drivers", str(r.reactions.count) if r.reactions else "-"),
            ("determinate", "yes" if r.determinate else "no"),
        ]

    return [[name, old, new] for (name, old), (_, new) in zip(numbers(before), numbers(after), strict=True)]
