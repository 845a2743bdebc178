"""Motion in time of mechanisms that nobody chose, and of published ones: energy, momentum, the way back, the drives it needs."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy
import strategies

import mechgraph as mg

T = np.linspace(0.0, 0.2, 9)


def random_mechanism(seed):
    """One or two loops and perhaps a branch, mobility 1 to 3 and passive freedoms, under gravity and a spring without damper."""
    rng = np.random.default_rng((seed, 7))
    m = strategies.closed_mechanism(seed, loops=1 + seed % 2, mobility=1 + seed % 3, branches=seed % 2)
    moving = [link.name for link in m.links if link.name != m.frame]
    ends = rng.uniform(-1, 1, 3), rng.uniform(1, 2, 3)
    return m.replace(
        loads=[mg.Gravity((0, -9.81, 0)), mg.Spring("frame", moving[-1], *ends, stiffness=30.0, free_length=0.5)]
    )


def places(r):
    """Poses of all links at the outputs."""
    return np.stack([r.link(link.name).pose for link in r.mechanism.links], axis=1)


def motion_of(r, freedom):
    """Position, velocity and acceleration of a freedom at the outputs."""
    name = next(pair.name for pair in r.mechanism.pairs if freedom in pair.freedom_names)
    column = r.mechanism.pair(name).freedom_names.index(freedom)
    return tuple(getattr(r[name], what)[:, column] for what in ("position", "velocity", "acceleration"))


@pytest.mark.daily(3)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.seeds(5, without=(1, 4))
def test_energy_is_kept_and_accuracy_is_that_of_the_tolerance(seed, engine):
    """Closed to rounding, with tolerances that are ten thousand times apart."""
    m = random_mechanism(seed)
    fine, coarse = (mg.respond(m, T, rtol=rtol, atol=1e-2 * rtol, engine=engine) for rtol in (1e-10, 1e-6))
    largest = fine.energy.kinetic.max()
    assert np.abs(fine.energy.balance).max() < 1e-8 * largest
    assert np.abs(coarse.energy.balance).max() < 1e-4 * largest
    assert np.abs(places(coarse) - places(fine)).max() < 1e-4
    assert max(fine.checks.closure.max(), coarse.checks.closure.max()) < 1e-12


@pytest.mark.parametrize("seed", [0, 3, 12])
def test_with_the_rates_turned_round_it_goes_back(seed):
    """From where it came to, to rest where it began."""
    m = random_mechanism(seed)
    there = mg.respond(m, T, rtol=1e-11, atol=1e-13)
    drivable = [n for p in m.pairs for n, d in zip(p.freedom_names, p.type.drivable, strict=True) if d]
    fastest = max(drivable, key=lambda name: abs(motion_of(there, name)[1][-1]))
    position, velocity, _ = motion_of(there, fastest)
    back = mg.respond(m, T, start={fastest: position[-1]}, rates={fastest: -velocity[-1]}, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(places(back)[::-1], places(there), atol=1e-8)
    assert back.energy.kinetic[-1] < 1e-12 * there.energy.kinetic.max()


def test_a_path_that_ends_by_rounding_before_its_goal_is_followed_on():
    """It was followed to the same place for ever; beyond a fold of the slide, which is passed with speed."""
    m = random_mechanism(6)
    r = mg.respond(m, T, start={"J2.Tz": 0.29614693}, rates={"J2.Tz": -17.22776129}, rtol=1e-11, atol=1e-13)
    assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()


@pytest.mark.daily(3)
@pytest.mark.parametrize("seed", [2, 3, 5, 8, 12, 13])
def test_what_moves_by_itself_needs_no_drives(seed):
    """Kinetostatics along the result: drives that hold it to its motion exert nothing, and the reactions are the same."""
    m = random_mechanism(seed)
    driven = strategies.with_drives(m, seed)
    r = mg.respond(m, T[:5], rtol=1e-10, atol=1e-12)
    motions = {drive.freedom: mg.Motion(*motion_of(r, drive.freedom)) for drive in driven.drives}
    s = mg.solve(driven, motions)
    largest = max(np.abs(s[pair.name].reaction).max(initial=0.0) for pair in m.pairs)
    for pair in m.pairs:
        assert np.nanmax(np.abs(s[pair.name].effort), initial=0.0) < 1e-9 * largest
    for pair in m.pairs:
        np.testing.assert_allclose(r[pair.name].force, s[pair.name].force, atol=1e-8 * largest)


@pytest.mark.daily(2)
@pytest.mark.parametrize("symbol", ["H", "U", "E", "Sc", "Cp"])
def test_momentum_is_kept_where_nothing_acts(symbol):
    """Momentum, and moment of momentum about the origin, of three bodies in free flight with eight to eleven freedoms."""
    rng = np.random.default_rng(8)
    links = [mg.Link("frame"), *(strategies.body(rng, name, rng.uniform(-1, 1, 3)) for name in ("one", "two", "three"))]
    pairs = [mg.Pair("F", "Fr", "frame", "one", point=(0, 0, 0), axis=(0, 0, 1))]
    pairs += [strategies.placed(rng, "A", symbol, "one", "two", rng.uniform(-1, 1, 3))]
    pairs += [strategies.placed(rng, "B", "R", "two", "three", rng.uniform(-1, 1, 3))]
    m = mg.Mechanism(f"{symbol} in free flight", links, pairs)
    rates = {"F.Tx": 0.4, "F.Rx": 0.5, "F.Ry": -0.8, m.pair("A").freedom_names[0]: 0.6, "B": -0.9}
    r = mg.respond(m, np.linspace(0, 0.5, 4), rates=rates, rtol=1e-10, atol=1e-12)
    momentum, spin = np.zeros((4, 3)), np.zeros((4, 3))
    for link in m.links[1:]:
        s = r.link(link.name)
        R = s.pose[:, :3, :3]
        momentum += link.mass * s.center_velocity
        own = np.einsum("tij,jk,tlk,tl->ti", R, np.asarray(link.inertia), R, s.angular_velocity)
        spin += link.mass * np.cross(s.center, s.center_velocity) + own
    for kept in (momentum, spin):
        np.testing.assert_allclose(kept, np.broadcast_to(kept[0], kept.shape), atol=1e-8 * np.abs(kept).max())


@pytest.mark.daily(2)
@pytest.mark.parametrize(
    ("name", "more", "end"),
    [("windows-2", {"rates": {"A0": -1.0}}, 10.0), ("bricard-cube", {}, 10.0), ("andrews", {}, 0.03)],
)
def test_published_mechanisms_keep_their_energy(name, more, end):
    """At small tolerances and at the defaults, of the greatest kinetic energy."""
    m = mg.load(name).replace(drives=[])
    for tolerances, most in (({"rtol": 1e-11, "atol": 1e-13}, 1e-8), ({}, 1e-6)):
        r = mg.respond(m, (0.0, end), **more, **tolerances)
        assert np.abs(r.energy.balance).max() < most * r.energy.kinetic.max()


def test_andrews_mechanism_against_the_published_reference():
    """Angles at 0.03 s; delta as the Test Set for IVP Solvers has it, .5244099658805."""
    begin = [-0.06171389001427645, 0.0, 0.45527981916307037, 0.22266839016588588, 0.48736497954384256,
             -0.22266839016588588, 1.2305474445498212]  # fmt: skip
    end = [15.8107711952, -15.7563710584, 0.0408222401, -0.5347301163, 0.5244099659, 0.5347301163, 1.0480807410]
    pairs = {
        "J1": 1,
        "J2": 1,
        "J4": 1,
        "J6": -1,
        "J7": 1,
        "J9": -1,
        "J10": 1,
    }  # beta, Theta, gamma, Phi, delta, Omega, epsilon
    r = mg.respond(mg.load("andrews"), (0.0, 0.03), rtol=1e-11, atol=1e-13)
    turned = [sense * r[pair].position[-1, 0] for pair, sense in pairs.items()]
    np.testing.assert_allclose(np.add(begin, turned), end, atol=1e-9)


def test_the_slider_of_the_governor_rises_and_sinks_as_published():
    """A5 of the IFToMM library: between .50 and about .743 m, about 9.7 periods in 10 s; arms that were rods would rise as high.

    With rods in place of the stiff springs, angular momentum ``I(s) w`` and energy ``(I w)^2 / 2 I + V(s)`` tell where it turns back.
    """
    m = mg.load(Path(__file__).parent / "reference" / "data" / "flyball-governor.toml").replace(drives=[])
    t = np.linspace(0.0, 1.1, 221)
    r = mg.respond(m, t, rates={"A": 2 * np.pi}, method="LSODA", rtol=1e-6, atol=1e-8)
    height, low = r.link("slider").center[:, 2], 120
    assert height.max() == pytest.approx(0.743, abs=7e-4)
    assert height[low:].min() == pytest.approx(0.50, abs=1e-4)
    assert 10.0 / t[low + np.argmin(height[low:])] == pytest.approx(9.7, abs=0.1)

    def inertia_and_potential(s):
        # sine of the angle of the arms, of length 1: their middles are as far from the slider as from the hinge
        down = 1.0 - s
        balls, own = (0.05 + np.sqrt(1 - down**2)) ** 2, 0.3 * (0.05 + 0.5 * np.sqrt(1 - down**2)) ** 2
        spin = 0.3 / 12 * (1 - down**2) + 0.3 * 0.01**2 / 12 * (1 + down**2)
        inertia = 2 * (5.0 * balls + own + spin) + 3.0 * 0.1**2 / 6 + 0.3 * 0.01**2 / 6
        return inertia, 9.81 * (3.0 * s - 2 * (5.0 + 0.15) * down)

    (I0, V0), w = inertia_and_potential(0.5), 2 * np.pi
    off = lambda s: (I0 * w) ** 2 / 2 / inertia_and_potential(s)[0] + inertia_and_potential(s)[1] - I0 * w**2 / 2 - V0
    assert height.max() == pytest.approx(scipy.optimize.brentq(off, 0.6, 0.9), abs=5e-4)


@pytest.mark.parametrize("rates", [{"A": 3.0}, {}])
def test_a_start_at_a_change_point_is_named(rates):
    """A flat parallelogram, in which two branches meet: steps collapsed, of which stiff loads were called the cause."""
    corners, names = [(0, 0, 0), (1, 0, 0), (3, 0, 0), (2, 0, 0)], ["frame", "crank", "coupler", "rocker", "frame"]
    links = [mg.Link("frame"), *(mg.Link(name, 1.0, (0.5, 0, 0), 0.1 * np.eye(3)) for name in names[1:4])]
    pairs = [mg.Pair("ABCD"[i], "R", names[i], names[i + 1], point=corners[i], axis=(0, 0, 1)) for i in range(4)]
    m = mg.Mechanism("flat", links, pairs, [], [mg.Gravity((0, -9.81, 0))])
    with pytest.raises(mg.ResponseError, match=r"2 branches meet there.*: its mobility is 2 there and 1 beside it"):
        mg.respond(m, (0.0, 1.0), rates=rates)


@pytest.mark.slow
def test_with_a_passive_freedom_it_passes_beside_a_change_point():
    """A rod as coupler of a parallelogram whose folded position is missed by 1e-7: it was given up there."""
    inertia = np.diag([0.1, 0.1, 0.1])
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, (0.2, 0.4, 0), inertia),
        mg.Link("rod", 1.0, (1.5, 0.8, 0), np.diag([0.01, 0.1, 0.1])),
        mg.Link("rocker", 1.0, (2.2, 0.4, 0), inertia),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("B", "S", "crank", "rod", point=(0.5, 0.8, 0)),
        mg.Pair("C", "S", "rod", "rocker", point=(2.5 + 1e-7, 0.8, 0)),
        mg.Pair("D", "R", "frame", "rocker", point=(2, 0, 0), axis=(0, 0, 1)),
    ]
    m = mg.Mechanism("parallelogram", links, pairs, [], [mg.Gravity((0, -9.81, 0))])
    r = mg.respond(m, np.linspace(0, 0.15, 4), rates={"A": -9.0})
    assert np.abs(r.energy.balance).max() < 1e-5 * r.energy.kinetic.max()


def nearly_a_parallelogram(off, *loads):
    """A parallelogram of which the coupler is too long by ``off``: branches all but cross where it is flat, the root of that apart."""
    z, corners = (0, 0, 1), [(0, 0, 0), (0, 1, 0), (2 + off, 1, 0), (2, 0, 0)]
    names = ["frame", "crank", "coupler", "rocker", "frame"]
    pairs = [mg.Pair("ABCD"[i], "R", names[i], names[i + 1], point=corners[i], axis=z) for i in range(4)]
    middles = {"crank": (0, 0.5, 0), "coupler": (1, 1, 0), "rocker": (2, 0.5, 0)}
    links = [mg.Link("frame"), *(mg.Link(name, 1.0, at, 0.1 * np.eye(3)) for name, at in middles.items())]
    return mg.Mechanism("nearly a parallelogram", links, pairs, ["A"], [mg.Gravity((0, -9.81, 0)), *loads])


@pytest.mark.daily(1)
@pytest.mark.parametrize("off", [1e-5, -1e-9, 1e-10])
def test_no_energy_is_lost_where_branches_all_but_cross(off):
    """Past the flat position twice, the second time folded over; up to 4 % were lost, or steps collapsed."""
    r = mg.respond(nearly_a_parallelogram(off), np.linspace(0.0, 0.8, 31), rates={"A": -9.0})
    assert "along the path" in str(r.work)
    assert np.abs(r.energy.balance).max() < 2e-6 * r.energy.greatest
    assert not r.warnings


@pytest.mark.daily(1)
@pytest.mark.parametrize("off", [1e-8, -1e-9])
def test_a_block_that_slides_beside_it_passes_there_as_well(off):
    """In independent freedoms: closing took rounding for an open loop where the condition is poor."""
    m = nearly_a_parallelogram(off)
    block = mg.Link("block", 1.0, (0, 0, 0), np.eye(3))
    slide = mg.Pair("P", "P", m.frame, "block", point=(0, 0, 0), axis=(0, 0, 1))
    m = m.replace(links=[*m.links, block], pairs=[*m.pairs, slide])
    r = mg.respond(m, np.linspace(0.0, 0.1, 11), rates={"A": -9.0})
    assert "in independent freedoms" in str(r.work)
    assert np.abs(r.energy.balance).max() < 1e-4 * r.energy.greatest


def test_energy_that_is_lost_is_said():
    """At a tolerance that does not resolve the swing of a pendulum."""
    links = [mg.Link("frame"), mg.Link("arm", 1.0, (0.5, 0, 0), 0.1 * np.eye(3))]
    pair = mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1))
    m = mg.Mechanism("pendulum", links, [pair], ["A"], [mg.Gravity((0, -9.81, 0))])
    t = np.linspace(0.0, 10.0, 41)
    with pytest.warns(mg.MechgraphWarning, match="energy balance: off by .* of the largest energy from t = "):
        lost = mg.respond(m, t, method="RK23", rtol=0.03, atol=0.03)
    assert np.abs(lost.energy.balance).max() > 1e-3 * lost.energy.kinetic.max()
    assert "Doubtful: energy balance: off by" in str(lost)  # all that the command line shows
    assert lost.to_dict()["energy_lost"] == {"error": lost.warnings[-1].error, "t": lost.warnings[-1].t}
    kept = mg.respond(m, t)
    assert not kept.warnings
    assert kept.to_dict()["energy_lost"] is None


def test_where_it_turns_back_no_energy_is_missed():
    """A pendulum has no kinetic energy at the end of its swing: the error of its balance is beside that of the whole motion."""
    links = [mg.Link("frame"), mg.Link("arm", 1.0, (0.5, 0, 0), 0.1 * np.eye(3))]
    pair = mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1))
    r = mg.respond(mg.Mechanism("pendulum", links, [pair], ["A"], [mg.Gravity((0, -9.81, 0))]), np.linspace(0, 3, 61))
    slowest = float(r.t[5 + np.argmin(r.energy.kinetic[5:])])
    grid = np.linspace(slowest - 0.05, slowest + 0.05, 2001)
    end = float(grid[np.argmin(r.at(grid).energy.kinetic)])
    at = r.at(end)
    assert np.abs(at.energy.balance) > 1e-3 * at.energy.greatest
    assert not at.warnings
    assert not r.warnings


@pytest.mark.parametrize("seed", [2, 7])
def test_derivatives_for_implicit_steppers_come_in_one_batch(seed):
    """Those of a stage of independent freedoms against central differences, with loops, turns in space and a damper."""
    m = random_mechanism(seed)
    spring = next(load for load in m.loads if isinstance(load, mg.Spring))
    m = m.replace(loads=[m.loads[0], replace(spring, damping=5.0)])
    r = mg.respond(m, (0.0, 0.05), method="Radau", rtol=1e-4)
    segment = r._course.integration.segments[-1]
    stage = segment.stage
    assert type(stage).__name__ == "ChartStage"
    t, y = segment.end, segment.dense(segment.end)
    J, h = stage.jacobian(t, y), 1e-5
    for i, nudge in enumerate(h * np.eye(len(y))):
        column = (stage.rates(t, y + nudge) - stage.rates(t, y - nudge)) / (2 * h)
        np.testing.assert_allclose(J[:, i], column, atol=1e-4 * np.abs(J).max())


@pytest.mark.parametrize(
    ("attribute", "check"),
    [("mechgraph.force.reactions.tree_wrenches", "equilibrium"), ("mechgraph.force.block.kinetic_power", "power")],
)
def test_forces_that_fail_a_check_are_warned_of(monkeypatch, attribute, check):
    """A part of the equations that is twice what it should be: a warning says which check fails, where and by how much."""
    m = strategies.solvable(3)
    motions = strategies.motions(m, 3, np.linspace(0.0, 0.5, 3))
    assert mg.solve(strategies.solvable(3), motions).warnings == ()
    module, name = attribute.rsplit(".", 1)
    right = getattr(importlib.import_module(module), name)
    monkeypatch.setattr(attribute, lambda *given: 2.0 * right(*given))
    with pytest.warns(mg.MechgraphWarning, match="fail the check of"):
        s = mg.solve(m, motions)
    found = {w.check: w for w in s.warnings}[check]
    errors = np.abs(getattr(s.checks, check))
    assert (found.error, found.position, found.many) == (errors.max(), errors.argmax(), (errors > 1e-6).sum())
