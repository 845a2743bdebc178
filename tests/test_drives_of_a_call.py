"""The keys of a call are its drives: motions given for freedoms that are not declared as drives."""

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)


def four_bar(**more: object) -> mg.Mechanism:
    """A drag-link in its plane, a load on the rocker; A is declared as the drive."""
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    places = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (2, 2, 0), "D": (2.5, 0, 0)}
    pairs = [mg.Pair(name, "R", *ends[name], point=places[name], axis=Z) for name in ends]
    return mg.Mechanism("four-bar", pairs=pairs, **{"drives": ["A"], "loads": [mg.Effort("D", 3.0)], **more})


@pytest.mark.parametrize("declared", [["A"], [mg.Drive("A", mg.Motion(0.3))], ["C"], []])
def test_another_drive_than_the_declared_one(declared: list) -> None:
    """D driven by the positions that A = 0 ... 0.5 gives takes A there; virtual work: the motor in D supplies -3, nothing in A."""
    angles = np.linspace(0, 0.5, 4)
    by_a = mg.solve(four_bar(), {"A": angles})
    for solve in (mg.solve, mg.kinematics):
        by_d = solve(four_bar(drives=declared), {"D": by_a["D"].position[:, 0]})
        np.testing.assert_allclose(by_d["A"].position[:, 0], angles, atol=1e-9)
        assert [d.freedom for d in by_d.mechanism.drives] == ["D"]
    s = mg.solve(four_bar(drives=declared), {"D": by_a["D"].position[:, 0]})
    np.testing.assert_allclose(s["D"].effort, -3.0, rtol=1e-12)
    assert not s["A"].effort.any()


def test_a_motion_for_some_of_the_declared_drives_leaves_the_others_theirs() -> None:
    """Two independent arms: B has a stored motion, which a call for A alone leaves to it."""
    arms = mg.Mechanism("arms", pairs=[
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "two", point=(1, 0, 0), axis=Z),
    ], drives=["A", mg.Drive("B", mg.Motion(0.4))])  # fmt: skip
    s = mg.kinematics(arms, {"A": 0.1})
    assert (s["A"].position, s["B"].position) == (pytest.approx([0.1]), pytest.approx([0.4]))


def test_faults_of_names_are_told_together() -> None:
    with pytest.raises(mg.DeclarationError) as error:
        mg.solve(four_bar(), {"X": 0.1, "Y": 0.2})
    assert len(error.value.faults) == 2
    with pytest.raises(mg.DeclarationError, match="given twice"):
        mg.solve(four_bar(), {"D": 0.1, "D.Rz": 0.2})


@pytest.mark.parametrize("built", [False, True])
def test_a_study_takes_the_drives_of_its_call(built: bool) -> None:
    made = (lambda load=3.0: four_bar(loads=[mg.Effort("D", load)])) if built else four_bar()
    name = "load" if built else "loads[0].value"
    study = mg.study(made, {name: [1.0, 2.0]}, ["D.effort", "A.effort"], motions={"D": [0.0, 0.1]}, sampling="grid")
    np.testing.assert_allclose(study.outputs["D.effort"], [[-1, -1], [-2, -2]], rtol=1e-10)
    assert not study.outputs["A.effort"].any()


def test_a_landing_gear_at_its_lock_is_solved_from_its_knee() -> None:
    """The strut is stretched, so the leg that is declared as the drive stands still: a named error; a call that drives the knee solves all.

    By hand: 100 on the wheel, 2 below the hinge, against the strut at 45 degrees from 1 below: its horizontal part is 200, and the lock
    takes no torque.
    """
    gear = mg.Mechanism("gear", pairs=[
        mg.Pair("A", "R", "frame", "leg", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "leg", "lower", point=(0, -1, 0), axis=Z),
        mg.Pair("C", "R", "lower", "upper", point=(0.5, -0.5, 0), axis=Z), mg.Pair("D", "R", "upper", "frame", point=(1, 0, 0), axis=Z),
    ], drives=["A"], loads=[mg.Wrench("leg", force=(-100.0, 0, 0), point=(0, -2, 0))])  # fmt: skip
    with pytest.raises(mg.DeadPointError, match=r"A\.Rz is stationary there"):
        mg.solve(gear, {"A": 0.0})
    s = mg.solve(gear, {"C": 0.0})
    assert s["A"].components["Fx"] == pytest.approx(-100.0)
    assert s["B"].components["Fx"] == pytest.approx(-200.0)
    assert s["B"].components["Fy"] == pytest.approx(-200.0)
    assert abs(s["C"].effort[0]) < 1e-11


def gear_with_foot(*loads: object) -> mg.Mechanism:
    """The same gear, its wheel on a foot that is welded to the leg."""
    return mg.Mechanism("gear", pairs=[
        mg.Pair("A", "R", "frame", "leg", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "leg", "lower", point=(0, -1, 0), axis=Z),
        mg.Pair("C", "R", "lower", "upper", point=(0.5, -0.5, 0), axis=Z), mg.Pair("D", "R", "upper", "frame", point=(1, 0, 0), axis=Z),
        mg.Pair("W", "W", "leg", "foot", point=(0, -1.5, 0)),
    ], drives=["A"], loads=loads)  # type: ignore[arg-type] # fmt: skip


@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler"])
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_at_a_dead_point_the_error_carries_what_equilibrium_determines(engine: str, method: str) -> None:
    """The foot gets 100 N at 0.5 below its weld from the leg, whatever the rest does; the torque of A and the force of the strut share the
    load in a way that is not unique. With a torque on the strut there is no equilibrium at all, only a position.
    """
    load = mg.Wrench("foot", force=(-100.0, 0, 0), point=(0, -2, 0))
    m = gear_with_foot(load)
    with pytest.raises(mg.DeadPointError) as caught:
        mg.solve(m, {"A": [0.0, 0.1]}, engine=engine, method=method)  # type: ignore[arg-type]
    s = caught.value.solution
    assert s.batch == ()
    assert s.status == "dead point"
    assert s.mechanism == m
    np.testing.assert_allclose(s["W"].force, [100, 0, 0], atol=1e-9)
    np.testing.assert_allclose(s["W"].moment, [0, 0, 50], atol=1e-9)
    assert np.isnan(s["A"].effort).all()
    assert np.isnan(s["B"].components["Fx"])
    assert s["C"].effort == 0
    assert s["A"].position == 0
    with pytest.raises(mg.DeadPointError) as caught:
        mg.solve(gear_with_foot(load, mg.Effort("D", 3.0)), {"A": 0.0}, engine=engine, method=method)  # type: ignore[arg-type]
    s = caught.value.solution
    assert np.isnan(s["W"].force).all()
    assert np.isnan(s["A"].effort).all()
    np.testing.assert_allclose(s["B"].position, 0.0)


def test_a_dead_point_of_kinematics_has_its_position() -> None:
    with pytest.raises(mg.DeadPointError) as caught:
        mg.kinematics(gear_with_foot(), {"A": 0.0})
    s = caught.value.solution
    assert not s.has_forces
    np.testing.assert_allclose(s.link("foot").pose, np.eye(4), atol=1e-12)


def test_load_values_that_do_not_fit_the_positions_say_what_would():
    """Three numbers at two positions: an effort takes a number, or one a position; a force three components."""
    crank = mg.Mechanism(
        "crank", pairs=[mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=(0, 0, 1))], drives=["A"]
    )
    for load, words in [
        (
            mg.Effort("A", [1, 2, 3]),
            r"shape \(3,\) does not fit the positions \(2,\); expected a number, or one a position",
        ),
        (
            mg.Wrench("p", moment=[[0, 0, 1]] * 3),
            r"shape \(3, 3\) .* expected 3 components, or as many a position, on the last axis",
        ),
    ]:
        with pytest.raises(mg.DeclarationError, match=words):
            mg.solve(crank.replace(loads=[load]), {"A": [0, 1]})
