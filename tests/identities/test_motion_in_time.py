"""Identities of motion in time, over random mechanisms of all pair types, mobility 1 to 6."""

import numpy as np
import pytest
from strategies import closed_mechanism, with_drives, with_loads

import mechgraph as mg
from mechgraph.kinematics.assembly import closed_start
from mechgraph.response.impact import Limit
from mechgraph.response.integration import LOOKS_IN_STEP
from mechgraph.response.motion_equations import Chart, Columns, accelerations, in_unit_inertias
from mechgraph.response.resting import Rests, _Holding

T = np.linspace(0.0, 0.25, 6)
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def moving(seed, loaded=True):
    """A random mechanism with masses, without drives, with random rates that its closure allows; gravity, springs, wrenches, efforts."""
    rng = np.random.default_rng((seed, 71))
    m = closed_mechanism(seed, mobility=int(rng.integers(1, 7)))
    driven = with_drives(m, seed)
    m = with_loads(m, seed, constant=True) if loaded else m
    names = [] if driven is None else [d.freedom for d in driven.drives]
    return m, {name: float(rng.uniform(-1, 1)) for name in names[:3]}


def size_of(r):
    """The largest energy that came and went."""
    return max(np.ptp(r.energy.kinetic), np.abs(r.energy.kinetic).max(), np.ptp(r.energy.potential), 1e-6)


@pytest.mark.daily(1)
@pytest.mark.seeds(8)
def test_energy_is_what_the_loads_bring(seed):
    """Kinetic and potential energy less the work done is constant; loops are closed at every output; both engines move alike."""
    m, rates = moving(seed)
    r = mg.respond(m, T, rates=rates, engine="dense", **TIGHT)
    assert r.checks.closure.max() < 1e-12
    assert np.nanmax(np.abs(r.checks.equilibrium)) < 1e-9
    assert np.abs(r.energy.balance).max() < 1e-7 * size_of(r)
    other = mg.respond(m, T, rates=rates, engine="sparse", **TIGHT)
    for p in m.pairs:
        size = max(1.0, np.abs(r[p.name].velocity).max(initial=0.0))
        np.testing.assert_allclose(other[p.name].velocity, r[p.name].velocity, atol=1e-6 * size)


@pytest.mark.daily(1)
@pytest.mark.seeds(8, without=(0, 2, 3, 6, 7, 9, 10, 12, 13, 15, 16, 18, 19, 20, 21, 22))
def test_back_to_the_start(seed):
    """Without loads that take energy, with the rates turned round, it goes back to where it came from."""
    m, rates = moving(seed)
    m = m.replace(loads=[load.parts()[0] for load in m.loads if load.parts()[0] is not None])
    r = mg.respond(m, T, rates=rates, **TIGHT)
    single = [(p.name, j) for p in m.pairs for j, able in enumerate(p.type.drivable) if able]
    if len(single) < len(m.freedom_names()):
        pytest.skip("rotations take no start value")
    last = {m.pair(k).freedom_names[j]: float(r[k].position[-1, j]) for k, j in single}
    rate = {m.pair(k).freedom_names[j]: -float(r[k].velocity[-1, j]) for k, j in single}
    back = mg.respond(m.replace(start={**m.start, **last}), T, rates=rate, **TIGHT)
    for k, j in single:
        assert back[k].position[-1, j] == pytest.approx(r[k].position[0, j], abs=1e-6)


@pytest.mark.daily(1)
@pytest.mark.seeds(8)
def test_doubling_the_accuracy(seed):
    """Results move by no more than the coarser tolerance allows."""
    m, rates = moving(seed)
    coarse = mg.respond(m, T, rates=rates, rtol=1e-6, atol=1e-8)
    fine = mg.respond(m, T, rates=rates, **TIGHT)
    for p in m.pairs:
        size = max(1.0, np.abs(fine[p.name].velocity).max(initial=0.0))
        np.testing.assert_allclose(coarse[p.name].velocity, fine[p.name].velocity, atol=1e-3 * size)


@pytest.mark.daily(1)
@pytest.mark.parametrize("seed", [11, 26, 49])
@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
def test_held_passive_freedoms(seed):
    """Seeds with passive freedoms, one of them with two: loads and inertia balance with what holds them, which does no work."""
    m, rates = moving(seed)
    r = mg.respond(m, np.linspace(0.0, 0.02, 3), rates=rates, passive="held")
    assert len(r.passive_effort) == len(mg.check(m).passive)
    assert r.checks.closure.max() < 1e-12
    assert np.nanmax(np.abs(r.checks.equilibrium)) < 1e-9
    assert np.nanmax(np.abs(r.checks.power)) < 1e-9
    assert np.abs(r.energy.balance).max() < 1e-7 * size_of(r)


@pytest.mark.seeds(20)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_sparse_accelerations_are_those_of_the_mass_matrix(seed, engine):
    m, _ = moving(seed)
    here = closed_start(m)
    chart = Chart(here.system, here.x[:, 0], np.zeros(0, dtype=np.intp), engine)
    columns = Columns(chart.start, chart.solver.factored(chart.start, chart.which), len(chart.free))
    rng = np.random.default_rng(seed)
    wrenches, efforts = rng.normal(size=(6, len(m.links), 1)), rng.normal(size=(len(m.freedom_names()), 1))
    force = columns.force(wrenches, efforts)
    by_links = np.einsum("ilkt,ilt->kt", columns.V, wrenches) + np.einsum("fkt,ft->kt", columns.Z, efforts)
    np.testing.assert_allclose(force, by_links, rtol=1e-10, atol=1e-10)
    wanted, left = accelerations(columns.mass, force)
    found = columns.sparse_accelerations(wrenches, efforts)
    if found is None:  # a motion may have no inertia: the mass matrix decides
        pivots = np.linalg.eigvalsh(in_unit_inertias(np.moveaxis(columns.mass, -1, 0)))
        assert pivots.min() < 1e-4
        return
    assert not left.any()
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())


def test_a_chain_of_many_rods_falls_as_one():
    """150 rods in a row: the sparse form serves; energy is kept, and the middle of the fall is that of a short time, g t^2 / 2."""
    n = 150
    rods = [mg.Link(f"l{i}", mass=1.0, center=(i + 0.5, 0, 0), inertia=np.diag([0.01, 1, 1]) / 12) for i in range(n)]
    names = ["frame", *(rod.name for rod in rods)]
    pairs = [mg.Pair(f"J{i}", "R", names[i], names[i + 1], point=(i, 0, 0), axis=(0, 0, 1)) for i in range(n)]
    m = mg.Mechanism("chain", [mg.Link("frame"), *rods], pairs, loads=[mg.Gravity((0, -9.81, 0))])
    t = 0.02
    r = mg.respond(m, np.array([0.0, t]))
    assert np.abs(r.energy.balance).max() < 1e-9 * r.energy.kinetic.max()
    fall = r.link(f"l{n // 2}").pose[-1, 1, 3] - r.link(f"l{n // 2}").pose[0, 1, 3]
    assert fall == pytest.approx(-9.81 * t**2 / 2, rel=1e-6)


class Sinking:
    """A coordinate that is beyond its limit from the beginning on, by ever more."""

    def motion(self, t):
        return -np.asarray(t)[None], np.zeros((2, 1, len(t)))


def test_what_is_passed_at_once_is_met_at_the_first_look(monkeypatch):
    """So that the least is lost: a limit that is passed, and one that no longer presses."""
    first = LOOKS_IN_STEP[1]
    limit = Limit(mg.Stop("A", lower=0.0), "lower", 0, 0, 1.0, 0.0)
    assert Rests(None, (limit,)).met(Sinking(), 0.0, 1.0) == first
    monkeypatch.setattr(Rests, "_pressing", lambda self, motion, times: motion.motion(times)[0][0])
    assert Rests(None, (limit,), holding=_Holding((limit,))).met(Sinking(), 0.0, 1.0) == first
