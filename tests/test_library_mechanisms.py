"""Every mechanism of the library: counts, ledger, closure, rank and motion, against what its file and the sources say."""

import numpy as np
import pytest
from mechanisms import unclosable_four_bar

import mechgraph as mg

MOVING = tuple(name for name in mg.library() if mg.load(name).drives[0].motion is not None)
KEYS = {"loops", "mobility_by_count", "mobility", "redundancy", "lee_unknowns", "lee_equations", "minimal_unknowns",
        "passive", "locked", "full_cycle"}  # fmt: skip
ASKED_FOR = {
    "rcsr", "rcsr-csr", "rcsr-csr-printed", "rchch", "7r", "rprhrrr", "rrrrrrh", "prprrh", "rprrhc", "pphchp", "rcrcr", "phchc",
    "four-bar", "slider-crank", "bennett", "spherical-four-bar", "rssr", "p-sp-p", "r-sp-p", "r-sp-r", "p-sp-r", "r-sg-c",
    "r-cp-c", "r-sg-r-r", "r-sg-r-p", "r-sg-p-r", "r-sg-p-p", "r-sc-c-r", "r-sc-c-p", "r-sc-r-c", "r-sc-p-c",
}  # fmt: skip
LEE = {
    "rcsr": (24, 24), "rcsr-csr": (40, 40), "rchch": (34, 34), "7r": (50, 50), "rprhrrr": (50, 50), "rrrrrrh": (50, 50),
    "rprrhc": (42, 42), "pphchp": (42, 42), "rcrcr": (34, 34), "phchc": (34, 34), "prprrh": (43, 42),
}  # fmt: skip
"""Unknowns and equations of Lee 1977, chapter III, driver included."""


def test_the_library_is_complete() -> None:
    assert set(mg.library()) >= ASKED_FOR


@pytest.mark.parametrize("name", mg.library())
def test_a_file_says_what_it_is(name: str) -> None:
    m = mg.load(name)
    assert m.name == name
    assert m.source
    assert m.description
    assert set(m.units) == {"length", "mass", "time"}
    assert len(m.drives) == 1
    assert set(m.expected) >= KEYS


@pytest.mark.parametrize("name", mg.library())
def test_loops_and_mobility_by_count(name: str) -> None:
    m = mg.load(name)
    loops = len(mg.check(m).loops)
    assert loops == m.expected["loops"] == len(m.pairs) - len(m.links) + 1
    assert sum(p.type.f for p in m.pairs) - 6 * loops == m.expected["mobility_by_count"]


@pytest.mark.parametrize("name", mg.library())
def test_ledger(name: str) -> None:
    m = mg.load(name)
    lee, minimal = mg.formulate(m, "lee"), mg.formulate(m, "minimal")
    counts = (len(lee.unknowns), len(lee.equations))
    assert counts == (m.expected["lee_unknowns"], m.expected["lee_equations"])
    assert counts == LEE.get(name, counts)
    assert len(minimal.unknowns) == m.expected["minimal_unknowns"]
    assert len(minimal.equations) == 6 * (len(m.links) - 1)
    assert len(lee.equations) - len(lee.unknowns) == m.expected["mobility_by_count"] - 1
    assert len(minimal.equations) - len(minimal.unknowns) == m.expected["mobility_by_count"] - 1


@pytest.mark.parametrize("name", [name for name in mg.library() if mg.load(name).expected["mobility"]])
def test_start_is_closed(name: str) -> None:
    m = mg.load(name)
    driver = next(name for name in m.freedom_names() if name.startswith(m.drives[0].freedom))
    s = mg.kinematics(m, {driver: m.start.get(driver, 0.0)})
    found = np.concatenate([s[pair.name].position for pair in m.pairs])
    np.testing.assert_allclose(found, [m.start.get(name, 0.0) for name in m.freedom_names()], rtol=0, atol=1e-9)


def test_what_cannot_close_says_so() -> None:
    m = unclosable_four_bar()
    with pytest.raises(mg.AssemblyError, match="no closed configuration") as caught:
        mg.kinematics(m, {"A": 0.0})
    assert caught.value.residual > 0.1
    assert f"{caught.value.residual:.3g}" in str(caught.value)
    assert set(caught.value.best) == set(m.freedom_names())


@pytest.mark.daily(13)
@pytest.mark.parametrize("name", MOVING)
def test_the_stored_sweep_can_be_followed(name: str) -> None:
    s = mg.kinematics(mg.load(name))
    assert (s.status == "ok").all()
    assert s.checks.closure.max() < 1e-10
    assert s.checks.accuracy.max() < 1e-9


@pytest.mark.daily(9)
@pytest.mark.parametrize("name", [n for n in MOVING if mg.load(n).expected["full_cycle"]])
def test_a_full_cycle_ends_where_it_began(name: str) -> None:
    m = mg.load(name)
    motion = m.drives[0].motion
    assert motion is not None
    turn = motion.position[0] + 2 * np.pi
    assert motion.position[-1] + (motion.position[1] - motion.position[0]) == pytest.approx(turn)
    once_round = mg.Motion(np.append(motion.position, turn))
    s = mg.kinematics(m.replace(drives=[mg.Drive(m.drives[0].freedom, once_round)]))
    assert (s.status == "ok").all()
    poses = np.stack([s.link(link.name).pose for link in m.links], axis=-1)
    passive = m.expected["passive"]  # the links that a passive freedom moves need not come back
    away = np.abs(poses[-1] - poses[0]).max(axis=(0, 1))
    assert (np.sort(away)[: len(away) - passive] < 1e-9).all()


def test_locked_freedoms_of_pphchp_stand_still_in_finite_motion() -> None:
    m = mg.load("pphchp")
    s = mg.kinematics(m)
    found = np.concatenate([s[pair.name].position for pair in m.pairs], axis=-1)
    ranges = dict(zip(m.freedom_names(), np.ptp(found, axis=0), strict=True))
    assert all(ranges[name] < 1e-10 for name in m.expected["locked"])
    assert ranges["O4.Tz"] > 0.01


@pytest.mark.daily(13)
@pytest.mark.parametrize("name", MOVING)
def test_the_stored_motion_can_be_solved(name: str) -> None:
    m = mg.load(name)
    s = mg.solve(m)
    assert s.checks.closure.max() < 1e-10
    assert s.checks.equilibrium.max() < 1e-9
    assert s.checks.power.max() < 1e-8
