"""Small samples of the sweeps: random topologies have the same assemblies for any seed, and Newton finds no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sweep_assemblies import TOGETHER, outside, prints, topology

import mechgraph as mg
from mechgraph.kinematics.state import Configuration
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import searched


@pytest.mark.parametrize(
    ("number", "freedoms"),
    [
        (14, None),
        *(pytest.param(number, None, marks=pytest.mark.slow) for number in (0, 16)),
        pytest.param(4, TOGETHER, marks=pytest.mark.slow),
    ],
)
def test_random_topologies_have_the_same_assemblies_for_any_seed(
    number: int, freedoms: tuple[int, ...] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mechgraph.modes.start_sets.PACKED", tmp_path / "none")
    m, at = topology(number, freedoms=freedoms)
    q = Question(m, at)
    sets = [mg.assemblies(m, at, seed=seed, cache=False) for seed in (0, 1)]
    assert len({(one.total, len(one), one.completeness) for one in sets}) == 1
    assert sets[0].completeness == "tested"
    first, second = (prints(q, one) for one in sets)
    assert first.shape[1] > 0
    assert outside(first, second) == outside(second, first) == 0
    x = searched(q.system, q.x, q.columns, q.drive[:, 0], 200, 0.5, np.random.default_rng(number))
    assert x.shape[1] > 20
    assert outside(q.family.prints(Configuration(q.system, x)), first) == 0
