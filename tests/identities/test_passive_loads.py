"""Passive freedoms under load: idle or load-bearing, by hand-computed moments about their lines; every place that must say so."""

import warnings

import numpy as np
import pytest
from program import invoke

import mechgraph as mg

Z = (0, 0, 1)
SI = {"length": "m", "mass": "kg", "time": "s"}
G = 9.81


def shaft(*loads: object) -> mg.Mechanism:
    """A shaft on a ball and a groove along it, its center 25 mm off the line."""
    return mg.Mechanism("shaft", [mg.Link("frame"), mg.Link("shaft", 2.0, (0.025, 0, 0.3))], [
        mg.Pair("A", "S", "frame", "shaft", point=(0, 0, 0)), mg.Pair("B", "Sg", "frame", "shaft", point=(0, 0, 1), axis=Z),
    ], loads=loads, units=SI)  # fmt: skip


def rsss() -> mg.Mechanism:
    """A crank and two rods on three balls, flat in a horizontal plane under gravity; the center of the second rod is on its line."""
    return mg.Mechanism("rsss", [
        mg.Link("frame"), mg.Link("crank", 1.0, (0.1, 0, 0)), mg.Link("rod1", 2.0, (0.5, 0.5, 0)), mg.Link("rod2", 3.0, (1.5, 0.5, 0)),
    ], [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z), mg.Pair("B", "S", "crank", "rod1", point=(0.2, 0, 0)),
        mg.Pair("C", "S", "rod1", "rod2", point=(1, 1, 0)), mg.Pair("D", "S", "rod2", "frame", point=(2, 0, 0)),
    ], drives=["A"], loads=[mg.Gravity((0, 0, -G))], units=SI)  # fmt: skip


def sprung() -> mg.Mechanism:
    """The RSSR of the library with a coil spring from the frame to a point 0.1 off the line of its rod."""
    m = mg.load("rssr")
    q = np.array(m.pair("B").point)
    line = np.array(m.pair("C").point) - q
    seat = q + 0.5 * line + 0.1 * np.cross(line, Z) / np.linalg.norm(np.cross(line, Z))
    return m.replace(
        loads=[mg.Spring("frame", "coupler", (0.1, -0.2, 0.4), tuple(seat), stiffness=900.0, free_length=0.1)]
    )


def couple_about(line: np.ndarray, point: np.ndarray, forces: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Size of the moment of (force, at) about a line, ``(...)``: what has to hold it."""
    along = line / np.linalg.norm(line, axis=-1, keepdims=True)
    return np.abs(sum((np.cross(at - point, force) * along).sum(axis=-1) for force, at in forces))


def solved(m: mg.Mechanism, motions: object = None, **options: object) -> tuple[mg.Solution, list[str]]:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        s = mg.solve(m, motions, **options)
    assert all(w.category is mg.MechgraphWarning for w in seen)
    return s, [str(w.message) for w in seen]


def test_a_torque_on_a_shaft_that_nothing_drives_is_named_everywhere(tmp_path) -> None:
    """Torque 20 about the line, less the weight 2 g on its arm of 25 mm: 20 - 0.4905 N m; the balls carry 0.7 and 0.3 of the weight."""
    m = shaft(mg.Wrench("shaft", moment=(0, 0, 20.0)), mg.Gravity((0, -G, 0)))
    report = mg.check(m)
    (found,) = report.passive
    assert (found.name, found.load_bearing, found.unit) == ("shaft", True, "N m")
    assert found.effort == pytest.approx(20 - 2 * G * 0.025, rel=1e-12)
    assert "carries no load" not in str(report)
    assert report.verdict.startswith("Load-bearing passive freedom")
    assert "that nothing holds: shaft by 19.51 N m" in report.verdict
    s, seen = solved(m)
    (record,) = s.warnings
    assert record.effort == pytest.approx(20 - 2 * G * 0.025, rel=1e-12)
    assert (record.links, record.pairs, record.unit) == (("shaft",), ("A", "B"), "N m")
    assert len(seen) == 1
    assert "shaft" in seen[0]
    assert "an artificial couple of 19.51 N m" in seen[0]
    np.testing.assert_allclose(s["A"].force, [0, 0.7 * 2 * G, 0], atol=1e-12)
    np.testing.assert_allclose(s["B"].force, [0, 0.3 * 2 * G, 0], atol=1e-12)
    text = s.summary()
    assert "A *" in text
    assert "an artificial couple of 19.51 N m" in text
    mg.save(m, tmp_path / "shaft.toml")
    run = invoke("solve", str(tmp_path / "shaft.toml"))
    assert run.exit_code == 0
    assert "load-bearing passive freedom, held by an artificial couple of 19.51 N m (max)" in " ".join(
        run.stdout.split()
    )
    assert not run.stderr


@pytest.mark.parametrize("together", [True, False])
def test_a_study_warns_of_what_bears_load_in_any_variant(together: bool) -> None:
    """The greatest couple of all variants, also of those that are solved alone."""
    m, value = rsss(), [0.25, 0.75, 1.5]

    def variant(mass: float) -> mg.Mechanism:
        links = [link.replace(mass=mass) if link.name == "rod1" else link for link in m.links]
        return m.replace(links=links, start={} if together else {"A": 1e-3 * mass})

    with pytest.warns(mg.MechgraphWarning, match=r"study of 'rsss': rod1.*: load-bearing passive freedom") as seen:
        study = mg.study(variant, {"mass": value}, ["D.force"], 1, sampling="grid", motions={"A": [0.0, 0.1]})
    with pytest.warns(mg.MechgraphWarning):
        alone = mg.solve(variant(1.5), {"A": [0.0, 0.1]})
    assert [w.name for w in study.warnings] == [w.name for w in alone.warnings] == ["rod1", "rod1 and rod2"]
    assert len(seen) == 2
    for found, own in zip(study.warnings, alone.warnings, strict=True):
        assert found.effort == pytest.approx(own.effort, rel=1e-9)
        assert found.text in " ".join(str(study).split())
    assert not mg.study(m.replace(loads=[]), {"rod1.mass": value}, ["D.force"], 1, motions={"A": 0.1}).warnings


def test_torques_in_balance_leave_the_shaft_idle() -> None:
    """Three torques whose sum is rounding: nothing has to hold the shaft, and nothing warns."""
    m = shaft(*(mg.Wrench("shaft", moment=(0, 0, value)) for value in (0.1, 0.2, -0.3)))
    assert mg.check(m).passive[0].load_bearing is False
    assert mg.check(m).verdict.startswith("Determinate")
    s, seen = solved(m)
    assert not s.warnings
    assert not seen
    assert "idle" in s.summary()


def test_no_load_makes_a_freedom_passive() -> None:
    """The spin of a shaft is passive whatever loads it from outside; where a load acts in the freedom itself it is the mechanism's own."""
    for loads in ([], [mg.Gravity((0, 0, -G))], [mg.Wrench("shaft", moment=(0, 0, 20.0))]):
        (found,) = mg.check(shaft(*loads)).passive
        assert found.load_bearing == any(isinstance(load, mg.Wrench) for load in loads)
    driven_through = shaft(mg.Effort("A.Rz", 20.0))
    assert not mg.check(driven_through).determinate
    with pytest.raises(mg.IndeterminateError, match="neither driven nor passive"):
        mg.solve(driven_through)


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_a_chain_of_balls_that_sags_is_held_about_the_line_of_its_ends(engine: str, method: str) -> None:
    """Weights about the line B-D for both rods together, the first rod's about its own line B-C; the second one's passes through its."""
    angles = np.linspace(0, 0.6, 4)
    s, seen = solved(rsss(), {"A": angles}, engine=engine, method=method)
    B, C = s.link("crank").point((0.2, 0, 0)).position, s.link("rod1").point((1, 1, 0)).position
    down = np.array([0, 0, -G])
    weights = [(mass * down, s.link(name).center) for name, mass in (("rod1", 2.0), ("rod2", 3.0))]
    found = s.passive_effort
    assert set(found) == {p.name for p in mg.check(rsss()).passive} == {"rod1", "rod2", "rod1 and rod2"}
    np.testing.assert_allclose(
        np.abs(found["rod1 and rod2"]), couple_about(np.array([2.0, 0, 0]) - B, B, weights), atol=1e-9
    )
    np.testing.assert_allclose(np.abs(found["rod1"]), couple_about(C - B, B, weights[:1]), atol=1e-9)
    np.testing.assert_allclose(found["rod2"], 0, atol=1e-9)
    assert [w.name for w in s.warnings] == ["rod1", "rod1 and rod2"]
    assert len(seen) == 2
    at_start = {p.name: p.effort for p in mg.check(rsss()).passive}
    assert at_start["rod1 and rod2"] == pytest.approx((2 * 0.5 + 3 * 0.5) * G, rel=1e-12)


def test_a_spring_seated_off_the_line_of_a_rod_turns_it() -> None:
    """Moment of the spring force about the line of the balls, from public points alone, along the motion."""
    m = sprung()
    (spring,) = m.loads
    s, seen = solved(m, {"A": np.linspace(0, 1, 5)})
    B, C = (s.link("coupler").point(m.pair(name).point).position for name in "BC")
    seat = s.link("coupler").point(spring.q).position
    pull = np.array(spring.p) - seat
    length = np.linalg.norm(pull, axis=-1, keepdims=True)
    force = spring.stiffness * (length - spring.free_length) * pull / length
    expected = couple_about(C - B, B, [(force, seat)])
    np.testing.assert_allclose(np.abs(s.passive_effort["coupler"]), expected, rtol=1e-8)
    assert expected.min() > 1.0
    assert s.warnings[0].effort == pytest.approx(expected.max(), rel=1e-8)
    assert len(seen) == 1


def test_loads_that_vary_over_positions_leave_the_verdict_of_the_report_open() -> None:
    torque = np.outer(np.linspace(0, 2, 4), np.array(Z))
    m = mg.load("rssr").replace(loads=[mg.Wrench("coupler", moment=torque)])
    (found,) = mg.check(m).passive
    assert found.load_bearing is None
    assert "vary over positions" in found.text
    s, seen = solved(m, {"A": np.linspace(0, 1, 4)})
    assert len(s.warnings) == len(seen) == 1


def test_a_ring_that_turns_and_slides_has_a_hold_for_each() -> None:
    """On two bars in line, pulled along with 3 N and turned with 2 N m, each by its name; a crank elsewhere is driven."""
    m = mg.Mechanism("ring", pairs=[
        mg.Pair("A", "C", "frame", "ring", point=(0, 0, 0), axis=Z), mg.Pair("B", "C", "frame", "ring", point=(0, 0, 1), axis=Z),
        mg.Pair("D", "R", "frame", "crank", point=(1, 0, 0), axis=Z),
    ], drives=["D"], loads=[mg.Wrench("ring", force=(0, 0, 3.0), moment=(0, 0, 2.0), point=(0, 0, 0))], units=SI)  # fmt: skip
    found = {p.name: (p.effort, p.unit) for p in mg.check(m).passive}
    assert set(found) == {"ring", "ring (2)"}
    s, seen = solved(m, {"D": [0.0, 0.5]}, redundant="minimum_norm")
    assert len(seen) == 2
    by_unit = {w.unit: w.effort for w in s.warnings}
    assert by_unit == {"N m": pytest.approx(2.0), "N": pytest.approx(3.0)}
    assert {w.name: (pytest.approx(w.effort), w.unit) for w in s.warnings} == found


@pytest.mark.slow
@pytest.mark.parametrize("link", ["rod1", pytest.param("rod2", marks=pytest.mark.slow)])
def test_rods_that_hang_on_balls_end_in_one_pose_however_many_positions_are_asked_for(link: str) -> None:
    """Over a turn of the crank, four numbers of positions: the rest of the passive rods is a matter of the path."""
    m = rsss().replace(loads=[])
    ends = [mg.kinematics(m, {"A": np.linspace(0, 2 * np.pi, n)}).link(link).pose[-1] for n in (2, 3, 9, 40)]
    for end in ends:
        np.testing.assert_allclose(end, ends[-1], atol=1e-10)


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_an_effort_of_any_size_is_held(size: float) -> None:
    """What counts as rounding is measured by the loads that act."""
    light = shaft(mg.Wrench("shaft", moment=(0, 0, size)))
    s, said = solved(light)
    assert len(said) == 1
    assert np.abs(next(iter(s.passive_effort.values()))) == pytest.approx(size, rel=1e-9)
