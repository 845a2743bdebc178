"""Small samples of the sweeps: random topologies have the same assemblies for any seed, and Newton finds no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from make_start_sets import families
from sweep_assemblies import TOGETHER, outside, prints, topology

import mechgraph as mg
from mechgraph.kinematics.state import Configuration
from mechgraph.modes import start_sets
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import searched
from mechgraph.modes.start_sets import bound


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "freedoms"),
    [
        *((number, None) for number in (0, 14, 16)),
        (4, TOGETHER),
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


# --- The start sets that come with the package serve the mechanisms that they were made of, and others of the same topology ---


@pytest.fixture(autouse=True)
def _no_folder_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))


def test_start_sets_of_the_library_and_of_common_topologies_come_with_the_package() -> None:
    with np.load(start_sets.PACKED) as packed:
        names = {name.split("/")[0] for name in packed.files}
    served = set()
    for name, labelling in families():
        family = labelling.family
        if start_sets.key(labelling) not in names:
            continue
        found, known = start_sets.kept(family), bound(family)
        assert found is not None, name
        assert found.trace.passed or (known is not None and known.count == found.x.shape[1])
        served.add(start_sets.key(labelling))
    assert served == names
    assert len(names) >= 20
    assert start_sets.PACKED.stat().st_size < 400_000


def test_other_mechanisms_of_the_same_topology_take_theirs_from_the_package() -> None:
    said: list[str] = []
    rng = np.random.default_rng(77)
    for letters, count in (("RSSR", 2), ("RRRRRRR", 16)):
        links = ["frame", *(f"link{i}" for i in range(1, len(letters))), "frame"]
        pairs = [
            mg.Pair(f"O{i}", symbol, links[i], links[i + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
            for i, symbol in enumerate(letters)
        ]
        modes = mg.assemblies(mg.Mechanism(letters, pairs=pairs), {"O0": 0.2}, progress=said.append)
        assert len(modes) + len(modes.complex) == modes.total == count
    assert said
    assert not any("random member" in line for line in said)
