"""What a path costs: effort is bounded near folds, for variants by the hundred and far away, and where it ends is named."""

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.kinematics import assembly
from mechgraph.kinetostatics import Pipeline
from mechgraph.maths import tracker

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


@pytest.mark.daily(4)
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
    for n in (1, 40):  # three more are solved beside them, for the sensitivities
        numbers = np.linspace(0, 1e-6, n)
        assert (mg.study(m, {"B.point.y": numbers}, ["D.effort"], n=n, motions=motions).status == "ok").all()
    few, many = works
    assert many.careful > 5 * few.careful > 0
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
    with pytest.raises(mg.ReachError, match=r"was not reached: step limit.*last position A.Rz = \d\d\.") as caught:
        mg.kinematics(m, {"A": [0.0, 20.0, 1e5]})
    assert 20.0 < caught.value.value["A.Rz"] < 40.0


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_so_is_one_of_too_many_careful_steps(monkeypatch, engine):
    monkeypatch.setattr(tracker, "PATH", mg.Tolerances(path={"careful_steps": 4, "steps_a_point": 1}).path)
    m = near_its_dead_point(1e-6)
    with pytest.raises(mg.ReachError, match="was not reached: step limit"):
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
