"""Shafts in a locating (S) and a floating (Sg) bearing: their spin is driven, loaded and coupled through rows of the pair table."""

import numpy as np
import pytest

import mechgraph as mg

Z = np.array([0.0, 0.0, 1.0])
I_AXIAL = 0.02
BEARINGS = [
    mg.Pair("A", "S", "frame", "shaft", point=(0, 0, 0)),
    mg.Pair("B", "Sg", "frame", "shaft", point=(0, 0, 0.5), axis=Z),
]
BELT = mg.Wrench("shaft", force=(0, -100, 0), point=(0.05, 0, 0.7))
"""A belt on a pulley of 50 mm, 0.2 m beyond the floating bearing."""
GRAVITY = mg.Gravity((0, -9.81, 0))
MOTION = mg.Motion([0.0, 0.5, 10.0], 100.0, 3.0)


def shaft(*loads: object, drives: tuple[str, ...] = ("M.Rz",), motor: bool = True) -> mg.Mechanism:
    """A shaft of 5 kg along z, its center at 0.2 m, and a motor between frame and shaft."""
    links = [mg.Link("frame"), mg.Link("shaft", 5.0, (0, 0, 0.2), np.diag([0.1, 0.1, I_AXIAL]))]
    turn = [mg.Pair("M", "Fr", "frame", "shaft", point=(0, 0, 0.8), axis=Z)] if motor else []
    return mg.Mechanism("shaft", links, BEARINGS + turn, drives, loads)  # type: ignore[arg-type]


def assert_bearings(s: mg.Solution) -> None:
    """Lever rule about A: B 0.5 = 100 * 0.7 + 5 g * 0.2; the rest at A; nothing along the shaft."""
    g = 9.81
    b = (100 * 0.7 + 5 * g * 0.2) / 0.5
    np.testing.assert_allclose(s["B"].force, np.broadcast_to([0, b, 0], (3, 3)), atol=1e-9)
    np.testing.assert_allclose(s["A"].force, np.broadcast_to([0, 100 + 5 * g - b, 0], (3, 3)), atol=1e-9)


@pytest.mark.daily(3)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_a_motor_on_a_shaft_in_two_ball_bearings(method: str, engine: str) -> None:
    """The torque is that of the belt, 100 N at 50 mm, about the axis, and of the inertia; the arm turns with the shaft."""
    m = shaft(BELT, GRAVITY)
    assert mg.check(m).determinate
    s = mg.solve(m, {"M.Rz": MOTION}, method=method, engine=engine)  # type: ignore[arg-type]
    torque = 100 * 0.05 * np.cos(MOTION.position) + 3.0 * I_AXIAL
    np.testing.assert_allclose(s["M"].effort[:, 5], torque, atol=1e-10)
    np.testing.assert_allclose(s["M"].effort[:, :5], 0.0, atol=1e-10)
    np.testing.assert_allclose(s["A"].position[:, 2], MOTION.position, atol=1e-9)
    assert_bearings(s)
    assert not s.warnings


def test_the_motor_beside_the_shaft_drives_it_through_a_torque_coupling() -> None:
    """A rotor in its own hinge: its bearing carries the rotor's weight only, the coupling the torque only."""
    m = shaft(BELT, GRAVITY, motor=False, drives=())
    m = m.replace(
        links=[*m.links, mg.Link("rotor", 1.0, (0, 0, 0.9), np.diag([0.01, 0.01, 0.004]))],
        pairs=[
            *m.pairs,
            mg.Pair("R", "R", "frame", "rotor", point=(0, 0, 0.9), axis=Z),
            mg.Pair("K", "Tc", "rotor", "shaft", point=(0, 0, 0.8), axis=Z),
        ],
        drives=["R"],
    )
    report = mg.check(m)
    assert report.determinate
    assert not report.passive
    s = mg.solve(m, {"R": MOTION})
    torque = 100 * 0.05 * np.cos(MOTION.position) + 3.0 * I_AXIAL
    np.testing.assert_allclose(s["K"].components["Mz"], torque, atol=1e-10)
    np.testing.assert_allclose(s["R"].effort[:, 0], torque + 3.0 * 0.004, atol=1e-10)
    np.testing.assert_allclose(s["R"].force, np.broadcast_to([0, 9.81, 0], (3, 3)), atol=1e-9)
    np.testing.assert_allclose(s["R"].moment, 0.0, atol=1e-9)
    assert_bearings(s)


def test_a_spin_is_loaded_and_runs_up() -> None:
    """A torque, and a damper: w = T / c (1 - exp(-c t / I)). At rest nothing balances the torque: a freedom, not a passive one."""
    T, c = 4.0, 0.05
    m = shaft(GRAVITY, mg.Effort("M.Rz", T), mg.Damper("M.Rz", coefficient=c), drives=())
    assert "neither driven nor passive" in mg.check(m).verdict
    t = np.linspace(0.0, 1.0, 5)
    r = mg.respond(m, t)
    np.testing.assert_allclose(r["M"].velocity[:, 5], T / c * (1 - np.exp(-c * t / I_AXIAL)), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(r["B"].force[:, 1], 5 * 9.81 * 0.2 / 0.5, rtol=1e-9)


def test_without_a_motor_the_spin_is_passive_and_its_load_is_named() -> None:
    (found,) = mg.check(shaft(BELT, motor=False, drives=())).passive
    assert found.load_bearing
    assert found.effort == pytest.approx(5.0)


def test_the_line_of_two_ball_joints() -> None:
    """The coupler of a sphere-sphere linkage is spun about its own line by a motor that hangs on the crank, the crank at rest."""
    m = mg.load("rssr")
    rod = next(p for p in m.pairs if p.type.symbol == "S")
    far = next(p for p in m.pairs if p.type.symbol == "S" and p is not rod)
    line = np.subtract(far.point, rod.point)
    line = line / np.linalg.norm(line)
    body = m.link(rod.b)
    along = 0.5 * (np.asarray(rod.point) + np.asarray(far.point))
    links = [
        mg.Link(k.name, 2.0, tuple(along), np.eye(3) * 0.07 - 0.04 * np.outer(line, line)) if k is body else k
        for k in m.links
    ]
    motor = mg.Pair("M", "Fr", rod.a, rod.b, point=rod.point, axis=line)
    m = m.replace(links=links, pairs=[*m.pairs, motor], drives=[*m.drives, "M.Rz"], loads=[])
    assert not mg.check(m).passive
    s = mg.solve(
        m,
        {
            m.drives[0].freedom: m.start.get(m.full_name(m.drives[0].freedom), 0.0),
            "M.Rz": mg.Motion([0.0, 2.0], 5.0, 6.0),
        },
    )
    np.testing.assert_allclose(s.link(body.name).angular_velocity, [5.0 * line] * 2, atol=1e-8)
    # I about the line: 0.07 - 0.04
    np.testing.assert_allclose(s["M"].effort[:, 5], 6.0 * 0.03, atol=1e-9)
    np.testing.assert_allclose(s[far.name].force, 0.0, atol=1e-8)


def test_a_drive_of_a_rotation_is_told_what_to_add() -> None:
    with pytest.raises(mg.DeclarationError, match=r"'A\.Rz' is part of a rotation.*a pair 'Fr' beside it"):
        shaft(motor=False, drives=("A.Rz",))


# --- Cardan shafts ---------------------------------------------------------------------------------------------------------

BEND = 0.4
"""Angle of the shaft between, in the plane y-z."""
SPAN = 0.3
"""Between the two bearings of the input and of the output shaft."""


def double_cardan() -> mg.Mechanism:
    """Input and output shaft parallel to z, each in S and Sg, between them a shaft bent by 0.4 rad with a slide, its two forks in line.

    At the start the pins on the input and output shaft stand along x, perpendicular to the plane of the bend.
    """
    x, cross = np.array([1.0, 0, 0]), np.array([0.0, 0, 0.5])
    bent = np.array([0.0, np.sin(BEND), np.cos(BEND)])
    far = cross + 0.8 * bent
    point = {"A": cross - (0.1 + SPAN) * Z, "B": cross - 0.1 * Z, "C": far + 0.1 * Z, "D": far + (0.1 + SPAN) * Z}
    pairs = [
        mg.Pair("A", "S", "frame", "in", point=point["A"]),
        mg.Pair("B", "Sg", "frame", "in", point=point["B"], axis=Z),
        # U: the first turn about its axis, on link a, the second about x of its marker, on link b
        mg.Pair("U", "U", "in", "fork", point=cross, axis=x, second=np.cross(bent, x)),
        mg.Pair("P", "P", "fork", "tube", point=cross + 0.4 * bent, axis=bent),
        mg.Pair("V", "U", "out", "tube", point=far, axis=x, second=np.cross(bent, x)),
        mg.Pair("C", "Sg", "frame", "out", point=point["C"], axis=Z),
        mg.Pair("D", "S", "frame", "out", point=point["D"]),
        mg.Pair("M", "Fr", "frame", "in", point=point["A"] - 0.1 * Z, axis=Z),
        mg.Pair("L", "Fr", "frame", "out", point=point["D"] + 0.1 * Z, axis=Z),
    ]
    return mg.Mechanism("double Cardan", pairs=pairs, drives=["M.Rz"], loads=[mg.Effort("L.Rz", -50.0)])


def test_a_double_cardan_shaft() -> None:
    """Both forks in line: the output turns as the input; between them w / w_in = cos b / (1 - sin^2 b sin^2 q) with q from the start.

    The torque 50 passes unchanged. Where the pin of the input stands across the plane of the bend (q = 0), the cross lies askew to the
    input shaft and gives it a couple 50 tan b, which its bearings take as 50 tan b / span; where it lies in that plane (90 deg), none.
    """
    m = double_cardan()
    report = mg.check(m)
    assert report.determinate
    q = np.linspace(0, 2 * np.pi, 25)
    s = mg.solve(m, {"M.Rz": mg.Motion(q, 10.0)})
    np.testing.assert_allclose(s["L"].position[:, 5], q, atol=1e-9)
    np.testing.assert_allclose(s["L"].velocity[:, 5], 10.0, atol=1e-9)
    between = np.linalg.norm(s.link("tube").angular_velocity, axis=1)
    np.testing.assert_allclose(between, 10 * np.cos(BEND) / (1 - np.sin(BEND) ** 2 * np.sin(q) ** 2), rtol=1e-9)
    np.testing.assert_allclose(s["M"].effort[:, 5], 50.0, rtol=1e-9)
    size = np.linalg.norm(s["A"].force, axis=1)
    np.testing.assert_allclose(size[[0, 12]], 50 * np.tan(BEND) / SPAN, rtol=1e-9)
    np.testing.assert_allclose(size[[6, 18]], 0.0, atol=1e-8)
    np.testing.assert_allclose(s["A"].force, -s["B"].force, atol=1e-8)
