"""Many positions solved group by group: against all at once, one by one, and group by hand."""

import numpy as np
import pytest
from lattices import LATTICES, ladder
from numpy.testing import assert_allclose
from test_groups import random_mechanism
from test_large import AGREE, assert_same

import mechgraph as mg


def with_random_driver(seed: int) -> tuple[mg.Mechanism, str]:
    """A random planar mechanism, and one of the freedoms that can drive it."""
    m = random_mechanism(seed)
    drivable = [finding.freedoms[0] for finding in mg.check(m).drivable]
    return m.replace(drives=[]), str(np.random.default_rng(seed).choice(drivable))


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", [1, 2, 6, 7, 8, 10, 12, 19, 22, 26])
def test_group_by_group_is_all_at_once(seed: int) -> None:
    """Poses, rates, accelerations, reactions of random planar mechanisms with random drivers: by groups, as a whole, one by one."""
    m, driver = with_random_driver(seed)
    m = m.replace(
        loads=[mg.Gravity((0, -9.81, 0))], links=[mg.Link(n, 1.0, (0.1, 0.2, 0), np.eye(3)) for n in m.link_names()]
    )
    move = mg.Motion(position=np.linspace(0, 0.003, 16), velocity=1.3, acceleration=-0.4)
    by_groups, at_once = (mg.solve(m, {driver: move}, engine=engine) for engine in ("sparse", "dense"))
    assert (by_groups.work.groups > 0, at_once.work.groups) == (True, 0)
    assert "Engine sparse, group by group" in by_groups.summary()
    for link in m.link_names():
        for what in ("pose", "twist", "acceleration"):
            a, b = (np.asarray(getattr(s.link(link), what)) for s in (by_groups, at_once))
            assert_allclose(a, b, rtol=0, atol=1e-11 * max(1.0, np.abs(b).max()))
    for p in m.pairs:
        for name, b in at_once[p.name].components.items():
            assert_allclose(
                by_groups[p.name].components[name], b, rtol=0, atol=1e-11 * max(1.0, np.nanmax(np.abs(b), initial=0))
            )
    last = mg.solve(m, {driver: mg.Motion(0.003, 1.3, -0.4)}, engine="sparse")
    assert last.work.groups == 0
    for p in m.pairs:
        assert_allclose(
            last[p.name].effort,
            by_groups[p.name].effort[-1],
            rtol=0,
            atol=1e-10 * max(1.0, np.abs(last[p.name].effort).max()),
        )


@pytest.mark.daily(3)
@pytest.mark.parametrize("kind", LATTICES)
def test_large_ones_group_by_group(kind: str) -> None:
    """Blocks of a few rows each, as many as there are loops; the reactions are those of the dense engine."""
    m = LATTICES[kind](30)
    loops = len(mg.check(m).loops)
    theta = np.linspace(0, 0.05, 40)
    s, dense = (mg.solve(m, {"J0": theta}, engine=engine) for engine in ("auto", "dense"))
    assert s.engine == "sparse"
    assert s.work.groups == loops
    assert_same(s, dense)


def test_reactions_of_least_norm_gain_nothing_from_many_positions() -> None:
    few = mg.solve(ladder(30), {"J0": np.linspace(0, 0.05, 40)}, redundant="minimum_norm")
    assert few.engine == "dense"


def test_groups_of_a_choice_that_no_longer_fits() -> None:
    """Along a whole turn of many four-bars, through places where the forms change; against the dense engine."""
    m = ladder(40, equal=True).replace(loads=[])
    theta = np.linspace(0, 1.2, 60)
    a, b = (mg.kinematics(m, {"J0": theta}, engine=engine) for engine in ("sparse", "dense"))
    assert a.work.groups > 0
    for p in m.pairs:
        assert_allclose(a[p.name].position, b[p.name].position, atol=AGREE)
