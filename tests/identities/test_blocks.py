"""Identities of a cycle solved in blocks: the size of the blocks, the method and the way of marching change nothing."""

import mechanisms
import numpy as np
import pytest
from identities.test_motion import gripper
from strategies import (
    closed_mechanism,
    motions,
    with_drives,
    with_loads,
)

import mechgraph as mg
from mechgraph.kinematics import assembly, motion_path
from mechgraph.kinematics.assembly import assembled
from mechgraph.kinematics.state import Configuration
from mechgraph.kinetostatics import Pipeline
from mechgraph.maths import tracker
from mechgraph.maths.tracker import Follower
from mechgraph.pairs import pair_type as evaluation

POSITIONS = 29


def solvable(seed, **more):
    """A random mechanism with drives and loads of values, and a short motion that it can make."""
    while True:
        m = with_drives(closed_mechanism(seed, **more), seed)
        if m is not None:
            m = with_loads(m, seed, constant=True)
            given = motions(m, seed, np.linspace(0.0, 0.1, POSITIONS))
            if given and (mg.kinematics(m, given, on_reach="flag").status == "ok").all():
                return m, given
        seed += 1000


def values(s):
    """Everything that a solution says about pairs, by name."""
    out = {}
    for p in s.mechanism.pairs:
        r = s[p.name]
        for name in (
            "position",
            "velocity",
            "acceleration",
            "reaction",
            "total",
            "effort",
            "applied_effort",
            "force",
            "moment",
        ):
            out[p.name, name] = getattr(r, name)
        out |= {(p.name, name): value for name, value in r.components.items()}
    return out


def assert_same(a, b, tolerance):
    """Equal statuses, equal NaN, and numbers equal to a part of the largest of their kind."""
    np.testing.assert_array_equal(a.status, b.status)
    first, second = values(a), values(b)
    assert first.keys() == second.keys()
    big = max(np.nanmax(np.abs(first[p.name, "total"]), initial=0.0) for p in a.mechanism.pairs)
    for key, x in first.items():
        y = second[key]
        own = key[1] in ("position", "velocity", "acceleration")
        size = max(1.0, np.nanmax(np.abs(x), initial=0.0)) if own else max(big, 1e-12)
        np.testing.assert_array_equal(np.isnan(x), np.isnan(y), err_msg=str(key))
        np.testing.assert_allclose(x, y, rtol=0, atol=tolerance * size, err_msg=str(key))


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks of a few positions."""
    monkeypatch.setattr(motion_path, "BLOCK", 5)


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(12))
def test_blocks_agree_with_newton_euler(small_blocks, seed):
    m, given = solvable(seed)
    assert_same(mg.solve(m, given), mg.solve(m, given, method="newton_euler"), 1e-9)


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", range(20, 32))
def test_size_of_blocks_changes_nothing(monkeypatch, seed):
    m, given = solvable(seed)
    whole = mg.solve(m, given, redundant="minimum_norm")
    monkeypatch.setattr(motion_path, "BLOCK", 4)
    parts = mg.solve(m, given, redundant="minimum_norm")
    assert_same(parts, whole, 1e-10)
    for name in ("closure", "equilibrium"):
        assert getattr(parts.checks, name).shape == (POSITIONS,)
        assert getattr(parts.checks, name).max() < 1e-12
    np.testing.assert_allclose(parts.checks.power, whole.checks.power, atol=1e-10)
    np.testing.assert_allclose(parts.shaking, whole.shaking, rtol=1e-9, atol=1e-9 * np.abs(whole.shaking).max())
    for k in m.links:
        np.testing.assert_allclose(parts.link(k.name).pose, whole.link(k.name).pose, atol=1e-11)
    one, other = parts.state(17), whole.state(17)
    np.testing.assert_allclose(one.poses, other.poses, atol=1e-11)
    np.testing.assert_allclose(one.coordinates, other.coordinates, atol=1e-11)


def redundant_cases():
    bricard = mechanisms.bricard_cube().replace(drives=["O1"])
    return [
        (mg.load("four-bar"), "A", (0.0, 6.2)),
        (mg.load("bennett"), "A", (0.6, 2.9)),
        (bricard.replace(loads=[mg.Gravity((0.3, -4.0, -9.81))]), "O1", (0.0, 3.0)),
        (mg.load("rcsr-csr"), "O1", (2.8, 3.6)),
    ]


@pytest.mark.daily(2)
@pytest.mark.parametrize("i", range(4))
def test_blocks_of_redundant_loops(monkeypatch, i):
    m, name, span = redundant_cases()[i]
    given = {name: mg.Motion(np.linspace(*span, 700), 3.0, 1.0)}
    whole = mg.solve(m, given, method="newton_euler")
    monkeypatch.setattr(motion_path, "BLOCK", 100)
    assert_same(mg.solve(m, given), whole, 1e-9)


def test_unreached_positions_in_blocks(small_blocks):
    m = mg.load("rcsr")
    s = mg.solve(m, {"O1": np.radians(np.linspace(150.0, 260.0, 60))}, on_reach="flag")
    ok = s.status == "ok"
    assert ok[:20].all()
    assert not ok[-1]
    assert (np.isnan(s["O2"].reaction).any(axis=-1) == ~ok).all()
    assert (np.isnan(s.checks.closure) == ~ok).all()
    with pytest.raises(mg.MechgraphError, match="was not solved"):
        s.state(59)
    with pytest.raises(mg.MechgraphError, match="no such position"):
        s.state(60)
    with pytest.raises(mg.MechgraphError, match="give one index an axis"):
        s.state(slice(0, 3))


def test_nothing_reached_in_blocks(small_blocks):
    m = mg.load("rcsr")
    s = mg.solve(m, {"O1": np.radians(np.linspace(250.0, 260.0, 12))}, on_reach="flag")
    assert (s.status != "ok").all()
    assert np.isnan(s["O2"].reaction).all()


def test_several_cases_in_blocks(small_blocks):
    m = mg.load("four-bar")
    angles = np.linspace(0.0, 1.0, 7) + np.array([[0.0], [2.0]])
    together = mg.solve(m, {"A": mg.Motion(angles, 2.0)})
    for case in range(2):
        alone = mg.solve(m, {"A": mg.Motion(angles[case], 2.0)})
        np.testing.assert_allclose(together["C"].force[case], alone["C"].force, rtol=1e-9, atol=1e-9)


def test_callables_still_see_all_positions(small_blocks):
    m = mg.load("four-bar")
    shapes = []

    def force(pose, twist, t):
        shapes.append(pose.shape)
        return np.zeros((*pose.shape[:-2], 3))

    mg.solve(m.replace(loads=[*m.loads, mg.Wrench("rocker", force=force)]), {"A": np.linspace(0.0, 1.0, 23)})
    assert set(shapes) == {(23, 4, 4)}


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(40, 52))
def test_the_careful_march_alone_gives_the_same_positions(monkeypatch, seed):
    m, given = solvable(seed)
    quick = mg.kinematics(m, given)
    monkeypatch.setattr(Follower, "_quick", lambda self, start, first: start.take(np.zeros(0, dtype=int)))
    careful = mg.kinematics(m, given)
    assert careful.work.careful > 0 or careful.work.nodes == len(careful.mechanism.drives)
    for p in m.pairs:
        np.testing.assert_allclose(quick[p.name].position, careful[p.name].position, atol=1e-9)


def test_interpolation_between_dense_nodes_is_closed():
    s = mg.kinematics(mg.load("four-bar"), {"A": np.linspace(0.0, 2 * np.pi, 20_000)})
    assert s.checks.closure.max() < 1e-12


@pytest.mark.parametrize("seed", range(60, 72))
def test_frames_by_columns_are_those_of_the_pair_table(seed):
    m = closed_mechanism(seed)
    system, x = assembled(m)
    rng = np.random.default_rng(seed)
    x = system.advance(x[:, None], 0.5 * rng.normal(size=(system.n_freedoms, 3)))
    here = Configuration(system, x)
    for g, frames in zip(system.groups, here.frames, strict=True):
        local = evaluation.frames_of(g.row, system.par.pitch[g.pairs], x[g.state_rows])
        for one, other in zip(frames, local, strict=True):
            base = frames[0]
            R = np.einsum("ijnt,jknt->iknt", base[:, :3], other[:, :3])
            p = np.einsum("ijnt,jnt->int", base[:, :3], other[:, 3]) + base[:, 3]
            np.testing.assert_allclose(one[:, :3], R, atol=1e-13)
            np.testing.assert_allclose(one[:, 3], p, atol=1e-13)


def test_rows_are_chosen_anew_where_those_of_the_path_are_nearly_dependent():
    """A Bennett linkage is regular at 92.5 and 180 degrees, where three of its six closure equations are not."""
    around = np.array([92.495, 92.5, 92.505, 179.999, 180.0, 180.001])
    angles = np.radians(np.sort(np.concatenate([np.linspace(30.0, 330.0, 1200, endpoint=False), around])))
    s = mg.solve(mg.load("bennett"), {"A": mg.Motion(angles, 10.0)})
    assert s.checks.equilibrium.max() < 3e-13
    assert s.checks.closure.max() < 1e-12


def test_a_position_that_does_not_close_is_not_said_to_be_out_of_reach(monkeypatch):
    """The driver came to its value: the error says that the loops are what fails."""
    closed = motion_path.Legs._closed

    def last_one_open(*args):
        bad = closed(*args)
        bad[-1] = True
        return bad

    monkeypatch.setattr(motion_path.Legs, "_closed", last_one_open)
    with pytest.raises(mg.ReachError, match="within reach, but the closure residual stays above round-off") as error:
        mg.kinematics(gripper(), {"X": [0.0, 0.1], "A": [0.0, 0.2]})
    assert "out of reach" not in str(error.value)


# --- What a path costs: effort is bounded near folds, for variants by the hundred and far away, and where it ends is named ---


Z = (0, 0, 1)


@pytest.fixture
def works(monkeypatch):
    """The work of all paths that are followed while a mechanism is assembled."""
    done, follow = [], assembly.follow

    def followed(*args):
        found = follow(*args)
        done.append(found.work)
        return found

    monkeypatch.setattr(assembly, "follow", followed)
    return done


def near_its_dead_point(before):
    """RSSR driven at its rocker, so far before the dead point."""
    m = mg.load("rssr")
    crank = 0.2904350151769896 - np.sqrt(before / 0.4)
    return mg.assemble(m, {"A": crank}).replace(drives=["D"])


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("before", [1e-3, 1e-5, 1e-7])
def test_from_beside_a_dead_point_and_to_it(engine, before):
    """Away from it steps double, towards it they halve: a few nodes for every digit of the distance; a crossing is looked for beside it."""
    m = near_its_dead_point(before)
    begin = m.start["D.Rz"]
    away = mg.kinematics(m, {"D": [begin, -0.05]}, engine=engine)
    towards = mg.kinematics(m, {"D": [begin, 0.5]}, engine=engine, on_reach="flag")
    assert list(away.status) == ["ok", "ok"]
    assert list(towards.status) == ["ok", "out of reach"]
    assert max(away.work.evaluations, towards.work.evaluations) < 4000


def test_variants_near_a_dead_point_are_followed_together(monkeypatch):
    """Ten times as many variants are as many more states, in as many batches."""
    m, works, run = near_its_dead_point(1e-5), [], Pipeline.run

    def noted(line, *args):
        outcome = run(line, *args)
        works.append(outcome.found.work)
        return outcome

    monkeypatch.setattr(Pipeline, "run", noted)
    motions = {"D": [m.start["D.Rz"], 0.0]}
    for n in (1, 12):  # three more are solved beside them, for the sensitivities
        numbers = np.linspace(0, 1e-6, n)
        assert (mg.study(m, {"B.point.y": numbers}, ["D.effort"], n=n, motions=motions).status == "ok").all()
    few, many = works
    assert many.careful > 2 * few.careful > 0
    assert many.calls < 1.5 * few.calls


@pytest.mark.filterwarnings(
    "ignore::mechgraph.MechgraphWarning"
)  # the center of mass does not move with the varied points
def test_variants_that_differ_by_little_are_led_in_a_step(monkeypatch):
    """The difference over the numbers is taken over a step that shows: rounding of its rates would halve steps a thousand times."""
    led, follow = [], tracker.Follower.follow

    def noted(follower, *args, **named):
        tracks = follow(follower, *args, **named)
        led.append((type(follower.problem).__name__, tracks.work.careful))
        return tracks

    monkeypatch.setattr(tracker.Follower, "follow", noted)
    m = near_its_dead_point(1e-5)
    mg.study(m, {"B.point.y": [1e-6, 2e-6]}, ["D.effort"], n=2, motions={"D": [m.start["D.Rz"]]})
    assert {careful for problem, careful in led if problem == "NumbersPath"} == {0}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
def test_a_study_of_which_no_variant_can_be_led():
    """The first position is out of reach of all: each is assembled and solved alone, and the study goes on."""
    m = near_its_dead_point(1e-6)
    begin = m.start["D.Rz"]
    study = mg.study(m, {"B.point.y": [0.001, 0.002]}, ["D.effort"], n=2, motions={"D": [begin, begin - 0.01]})
    assert study.status.tolist() == [["out of reach", "ok"]] * 2


def two_pairs(other, **place):
    """Two links joined by pairs of which one holds what the other leaves free: nothing moves."""
    pairs = [mg.Pair("P0", "W", "f", "a", point=(0.3, -1, 0.2), axis=(1, 2, -1), second=(2, -1, 0))]
    pairs.append(mg.Pair("P1", other, "f", "a", point=(1, 0, 0), axis=(0, -1, 1), second=(1, 0, 0), **place))
    return mg.Mechanism("structure", pairs=pairs, drives=["P1.Ty"])


@pytest.mark.parametrize("other", ["Cp", "E"])
def test_a_structure_does_not_move_by_a_step(works, other):
    """Steps that leave the residual as it is make no nodes, and no matrix of a thousand is asked for."""
    with pytest.raises(mg.AssemblyError, match="came to P1"):
        mg.assemble(two_pairs(other), {"P1.Ty": 8.0, "P1.Rz": -2.0})
    assert works[0].evaluations < 1000


def test_a_slide_far_away_is_reached_in_steps_that_grow(works):
    """Two rods on a slide that goes 1e5 of their lengths away: all that turns does so as the inverse of the distance."""
    pairs = [
        mg.Pair("A", "R", "f", "a", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "a", "b", point=(1, 1, 0), axis=(1, 1, 0)),
        mg.Pair("C", "R", "b", "c", point=(2, 2, 0), axis=Z),
        mg.Pair("D", "P", "f", "c", point=(2, 2, 0), axis=(1, 0, 0)),
    ]
    m = mg.Mechanism("far", pairs=pairs, drives=["D"])
    far = 1e5
    at = mg.assemble(m, {"D": far})
    assert at.start["A.Rz"] == pytest.approx(np.arctan2(2, 2 + far) - np.pi / 4, abs=1e-12)
    assert works[0].nodes < 300
    assert works[0].evaluations < 3000


def test_a_path_of_too_many_steps_is_named(monkeypatch):
    """A screw that goes on and on never repeats itself: after so many steps it is said how far the path was followed."""
    monkeypatch.setattr(tracker, "PATH", mg.Tolerances(path={"quick_steps": 100, "steps_a_point": 1}).path)
    places = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (3, 1, 0), "D": (3, -1, 0)}
    ends = [("f", "a"), ("a", "b"), ("b", "c"), ("c", "f")]
    how = [("H", {"pitch": 0.3}), ("R", {}), ("R", {}), ("C", {})]
    pairs = [
        mg.Pair(name, kind, *end, point=at, axis=Z, **pitch)
        for (name, at), end, (kind, pitch) in zip(places.items(), ends, how, strict=True)
    ]
    m = mg.Mechanism("screw", pairs=pairs, drives=["A"])
    s = mg.kinematics(m, {"A": [0.0, 20.0, 1e5]}, on_reach="flag")
    assert list(s.status) == ["ok", "ok", "not followed"]
    with pytest.raises(mg.ReachError, match=r"was not reached; last position A.Rz = \d\d\.") as caught:
        mg.kinematics(m, {"A": [0.0, 20.0, 1e5]})
    assert 20.0 < caught.value.value["A.Rz"] < 40.0


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_so_is_one_of_too_many_careful_steps(monkeypatch, engine):
    monkeypatch.setattr(tracker, "PATH", mg.Tolerances(path={"careful_steps": 4, "steps_a_point": 1}).path)
    m = near_its_dead_point(1e-6)
    with pytest.raises(mg.ReachError, match="was not reached; last position"):
        mg.kinematics(m, {"D": [m.start["D.Rz"], -0.05]}, engine=engine)


def test_couplings_hold_passive_freedoms_too():
    """A plate between a free pair and a plane: its slides are idle only as far as the coupling lets them."""
    pairs = [
        mg.Pair("P0", "E", "f", "a", point=(0.7, -1.3, -1.0), axis=Z),
        mg.Pair("P1", "E", "f", "a", point=(-0.2, 2.3, -0.8), axis=Z),
        mg.Pair("P2", "Cp", "a", "f", point=(0.7, 1.1, 0.4), axis=Z, second=(1, 0, 0)),
    ]
    m = mg.Mechanism("plate", pairs=pairs, couplings=[mg.Coupling({"P0.Rz": 1.0, "P2.Ty": -2.0})], drives=["P2.Rz"])
    report = mg.check(m)
    assert (report.mobility, len(report.passive)) == (2, 1)
    assert mg.solve(m, {"P2.Rz": 0.0}, on_reach="flag").status in ("ok", "dead point")
