"""Motion prescribed in some freedoms, the unknown efforts in others."""

from __future__ import annotations

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WAYS = [(engine, method) for engine in ("dense", "sparse") for method in ("loop_wrench", "newton_euler", "printed")]


def slider_crank(**changes: object) -> mg.Mechanism:
    """Crank of 0.1 m from x = 0, rod of 0.3 m, slider along x; A is the declared drive."""
    fields = {
        "links": [
            mg.Link("frame"),
            mg.Link("crank", 1, (0.05, 0, 0)),
            mg.Link("rod", 1.5, (0.2, 0, 0), inertia=mg.inertia.rod(1.5, (0.1, 0, 0), (0.4, 0, 0))),
            mg.Link("slider", 2, (0.4, 0, 0)),
        ],
        "pairs": [
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "crank", "rod", point=(0.1, 0, 0), axis=Z),
            mg.Pair("C", "R", "rod", "slider", point=(0.4, 0, 0), axis=Z),
            mg.Pair("D", "P", "frame", "slider", point=(0.4, 0, 0), axis=X),
        ],
        "drives": ["A"],
        "loads": [mg.Gravity((0, -9.81, 0)), mg.Effort("A", 3.0)],
    }
    return mg.Mechanism("slider-crank", **{**fields, **changes})  # type: ignore[arg-type]


def press() -> mg.Mechanism:
    """A spatial loop R-S-U-P with mass everywhere and a lever on the slider: no reaction is redundant."""
    return mg.Mechanism("ball press", [
        mg.Link("frame"), mg.Link("crank", 0.4, (0.01, 0.01, 0.03)), mg.Link("rod", 0.6, (0.13, 0.02, 0.03)),
        mg.Link("slider", 1.5, (0.28, 0.02, 0)), mg.Link("lever", 0.9, (0.37, 0.02, 0.07)),
    ], [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0.3, 1, -0.2)),
        mg.Pair("B", "S", "crank", "rod", point=(0.02, 0.006, 0.06)),
        mg.Pair("C", "U", "rod", "slider", point=(0.24, 0.04, 0.02), axis=Z, second=Y),
        mg.Pair("D", "P", "frame", "slider", point=(0.30, 0.04, -0.02), axis=X),
        mg.Pair("E", "Sp", "lever", "slider", point=(0.36, 0.04, 0.02), axis=(1, 0.1, 0.1)),
        mg.Pair("F", "R", "frame", "lever", point=(0.38, 0.04, 0.16), axis=(0, 1, 0.2)),
    ], drives=["A"], loads=[mg.Gravity((0, 0, -9.81)), mg.Effort("F", -30)])  # fmt: skip


@pytest.mark.parametrize(("engine", "method"), WAYS)
def test_a_piston_moves_a_crank_as_it_is_told(engine: str, method: str) -> None:
    """At rest, couple M on the crank: the force on the piston is M / (dx/dtheta), by hand."""
    theta, r, l = np.deg2rad([20.0, 70, 110, 200, 300]), 0.1, 0.3
    still = slider_crank(loads=[mg.Effort("A", 3.0)])
    s = mg.solve(still, {"A": theta}, actuate=["D"], engine=engine, method=method)
    slope = -r * np.sin(theta) - r**2 * np.sin(theta) * np.cos(theta) / np.sqrt(l**2 - (r * np.sin(theta)) ** 2)
    np.testing.assert_allclose(s["D"].effort[:, 0], -3.0 / slope, rtol=1e-11)
    np.testing.assert_array_equal(s["A"].effort, 0.0)
    assert (s.prescribed, s.actuated) == (("A.Rz",), ("D.Tz",))


@pytest.mark.daily(4)
@pytest.mark.parametrize(("engine", "method"), WAYS)
@pytest.mark.parametrize("freedom", ["D", "C.Rx", "F", "B"])
def test_driven_by_what_was_found_it_is_the_same(engine: str, method: str, freedom: str) -> None:
    """The motion of the actuator found, prescribed there, gives the same motion, reactions and efforts."""
    if freedom == "B":
        m, drive = slider_crank(), {"A": mg.Motion(np.deg2rad([30.0, 60, 80, 120]), velocity=5.0, acceleration=2.0)}
    else:
        m, drive = press(), {"A": mg.Motion(np.deg2rad([10.0, 20, 30]), velocity=5.0, acceleration=2.0)}
    s = mg.solve(m, drive, actuate=[freedom], engine=engine, method=method)  # type: ignore[arg-type]
    pair = freedom.partition(".")[0]
    j = m.freedom(freedom)[1]
    found = mg.Motion(*(getattr(s[pair], what)[:, j] for what in ("position", "velocity", "acceleration")))
    start = mg.assemble(m, {"A": float(drive["A"].position[0])}).start
    there = mg.solve(m.replace(start=start), {freedom: found}, engine=engine, method=method)  # type: ignore[arg-type]
    for p in m.pairs:
        for what in ("position", "velocity", "acceleration", "reaction", "effort", "force"):
            one, two = (getattr(x[p.name], what) for x in (s, there))
            np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-9 * max(1.0, np.nanmax(np.abs(two), initial=0.0)))
    direct = mg.solve(m, drive, engine=engine, method=method)  # type: ignore[arg-type]
    power = (s[pair].effort * s[pair].velocity).sum(axis=-1)
    np.testing.assert_allclose(power, (direct["A"].effort * direct["A"].velocity)[:, 0], rtol=1e-9)
    assert np.nanmax(s.checks.equilibrium) < 1e-12
    assert np.nanmax(np.abs(s.checks.power)) < 1e-12


def five_bar() -> mg.Mechanism:
    """Two freedoms, asymmetric, with mass."""
    return mg.Mechanism("five-bar", [
        mg.Link("frame"), mg.Link("a", 1.0, (-1, 0.5, 0)), mg.Link("b", 2.0, (-0.5, 1.5, 0)), mg.Link("c", 3.0, (0.5, 1.5, 0)),
        mg.Link("d", 1.0, (1, 0.5, 0)),
    ], [
        mg.Pair("A", "R", "frame", "a", point=(-1, 0, 0), axis=Z), mg.Pair("B", "R", "a", "b", point=(-1.1, 1, 0), axis=Z),
        mg.Pair("C", "R", "b", "c", point=(0, 2, 0), axis=Z), mg.Pair("D", "R", "d", "c", point=(1.2, 1, 0), axis=Z),
        mg.Pair("E", "R", "frame", "d", point=(1, 0, 0), axis=Z),
    ], drives=["A", "E"], loads=[mg.Gravity((0, -9.81, 0))])  # fmt: skip


@pytest.mark.parametrize(("engine", "method"), WAYS)
def test_two_motions_here_two_efforts_there(engine: str, method: str) -> None:
    """Cases on a leading axis; virtual work: sum of actuator powers is that of the drives, whatever the rates are."""
    turn = np.linspace(0, 0.3, 4)
    rates = np.array([[1.0], [-2.0]])
    drive = {"A": mg.Motion(turn, velocity=rates), "E": mg.Motion(-0.5 * turn, velocity=0.7)}
    s = mg.solve(five_bar(), drive, actuate=["B", "E"], engine=engine, method=method)
    direct = mg.solve(five_bar(), drive, engine=engine, method=method)
    assert s.batch == (2, 4)
    power = [sum((x[k].effort * x[k].velocity)[..., 0] for k in "ABE") for x in (s, direct)]
    np.testing.assert_allclose(power[0], power[1], rtol=1e-10)
    assert not s["A"].effort.any()
    np.testing.assert_array_equal(s["C"].position, direct["C"].position)


def test_the_printed_equations_hold_with_the_efforts_where_they_stand() -> None:
    m = press()
    s = mg.solve(m, {"A": mg.Motion(np.deg2rad([30.0, 60]), velocity=5.0)}, actuate=["D"])
    assert [d.freedom for d in s.mechanism.drives] == ["D.Tz"]
    f = mg.formulate(s.mechanism, bookkeeping="minimal")
    A, b = f.assemble(s.state(1))
    x = np.linalg.solve(A.toarray(), b)
    names = [str(u) for u in f.unknowns]
    assert len(names) == len(b)
    assert x[-1] == pytest.approx(s["D"].effort[1, 0], rel=1e-9)


def test_where_the_actuators_rest_forces_have_no_value() -> None:
    """At its dead centers no force on the piston holds a couple on the crank; the motion goes on."""
    theta = np.deg2rad(np.arange(0, 360, 30))
    for engine, method in WAYS:
        s = mg.solve(slider_crank(), {"A": mg.Motion(theta, velocity=5.0)}, actuate=["D"], engine=engine, method=method)
        rest = np.isin(np.arange(12), [0, 6])
        assert (s.status == np.where(rest, "actuators at dead point", "ok")).all()
        assert (np.isnan(s["D"].effort[:, 0]) == rest).all()
        assert np.isfinite(s["D"].velocity).all()
        assert np.nanmax(s.checks.equilibrium) < 1e-12
    text = s.summary()
    assert "position 0: actuators at dead point (before A.Rz = 30 deg)" in text
    assert "D.Tz" in text.partition("Efforts of the drivers")[2].partition("Applied")[0]
    assert "A.Rz" in text.partition("Efforts of the drivers")[0]


@pytest.mark.parametrize(
    ("actuate", "words"),
    [
        (["B", "D"], "2 freedoms are named, 1 independent motion is prescribed"),
        ([], "0 freedoms are named, 1 independent motion is prescribed; any one of A.Rz, B.Rz, C.Rz would do"),
        (["D"], "D.Tz stands still while the mechanism moves; any one of A.Rz, B.Rz, C.Rz would do in its place"),
    ],
)
def test_freedoms_that_cannot_hold_it_are_named_with_those_that_can(actuate: list, words: str) -> None:
    with pytest.raises(mg.IndeterminateError) as error:
        mg.solve(slider_crank(), {"A": 0.0}, actuate=actuate)
    assert words in str(error.value)


def test_dependent_actuators_are_named_with_what_would_do() -> None:
    """Two arms: both freedoms of one arm's gear train move together."""
    m = mg.Mechanism("arms", pairs=[
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "two", point=(1, 0, 0), axis=Z),
        mg.Pair("C", "R", "frame", "three", point=(2, 0, 0), axis=Z),
    ], couplings=[mg.Coupling({"A": 1.0, "B": 2.0})], drives=["A", "C"])  # fmt: skip
    with pytest.raises(mg.IndeterminateError, match=r"B\.Rz depends on A\.Rz; C\.Rz would do in its place"):
        mg.solve(m, {"A": [0.1], "C": [0.2]}, actuate=["A", "B"])
    assert mg.solve(m, {"A": [0.1], "C": [0.2]}, actuate=["B", "C"]).status.tolist() == ["ok"]


def test_names_of_actuators_are_checked() -> None:
    with pytest.raises(mg.DeclarationError) as error:
        mg.solve(press(), {"A": 0.1}, actuate=["X", "B.Rx", "C"])
    assert len(error.value.faults) == 3
    with pytest.raises(mg.DeclarationError, match=r"A\.Rz is given twice"):
        mg.solve(slider_crank(), {"A": 0.1}, actuate=["A", "A.Rz"])
    with pytest.raises(mg.DeclarationError, match="actuate = 3: expected"):
        mg.solve(slider_crank(), {"A": 0.1}, actuate=3)  # type: ignore[arg-type]
    assert mg.solve(slider_crank(), {"A": 0.1}, actuate="B").actuated == ("B.Rz",)


@pytest.mark.parametrize(
    "of", [lambda m: m.pair("B"), lambda m: [m.pair("B")], lambda m: m.replace(drives=["B"]).drives]
)
def test_actuators_are_given_as_the_pairs_or_drives_at_hand(of) -> None:
    m = slider_crank()
    assert mg.solve(m, {"A": 0.1}, actuate=of(m)).actuated == ("B.Rz",)


def test_drives_that_depend_on_each_other_are_taken_as_one_motion() -> None:
    m = slider_crank()
    theta = np.deg2rad([30.0, 60])
    B = mg.kinematics(m, {"A": theta})["B"].position[:, 0]
    s = mg.solve(m, {"A": theta, "B": B}, actuate=["D"])
    one = mg.solve(m, {"A": theta}, actuate=["D"])
    np.testing.assert_allclose(s["D"].effort, one["D"].effort, rtol=1e-9)


def test_a_passive_freedom_beside_actuators() -> None:
    """A rod between two spheres spins; the cylinder's force is that of the statics, and nothing turns the rod."""
    m = mg.load("rssr")
    name, other = m.drives[0].freedom, m.pairs[-1].name
    q = {name: mg.Motion(np.linspace(0.1, 0.5, 3) + m.start.get(m.full_name(name), 0.0), velocity=1.0)}
    s, direct = mg.solve(m, q, actuate=[other]), mg.solve(m, q)
    power = [sum((x[k].effort * x[k].velocity)[..., 0] for k in (name, other)) for x in (s, direct)]
    np.testing.assert_allclose(power[0], power[1], rtol=1e-9, atol=1e-12)
    assert list(s.passive_effort) == list(direct.passive_effort)
