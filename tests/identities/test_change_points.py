"""Change points passed: pose, velocity and acceleration there, what is next to them, and paths that start there."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = np.eye(3)
TURNS = [np.eye(3), np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])]


def four_bar(a, b, c, g, crank, side=1, rod="RR", moved=TURNS[0]):
    """Crank a, coupler b, rocker c, frame g in a plane, declared at a crank angle with the coupler on one side; effort -10 at D."""
    tip, foot = a * np.array([np.cos(crank), np.sin(crank)]), np.array([g, 0.0])
    d = np.linalg.norm(foot - tip)
    u = (foot - tip) / d if d else X[:2]
    along = (b * b - c * c + d * d) / (2 * d) if d else b
    joint = tip + along * u + side * np.sqrt(max(b * b - along * along, 0.0)) * np.array([-u[1], u[0]])
    at = {"A": (0, 0), "B": tip, "C": joint, "D": foot}
    ends = {"A": ("frame", "crank"), "B": ("crank", "rod"), "C": ("rod", "rocker"), "D": ("frame", "rocker")}
    types = dict(zip("ABCD", f"R{rod}R", strict=True))
    return mg.Mechanism(
        "four-bar",
        pairs=[mg.Pair(k, types[k], *ends[k], point=moved @ [*at[k], 0], axis=moved @ Z) for k in "ABCD"],
        drives=["A"],
        loads=[mg.Effort("D", -10.0)],
    )


def kite_output(crank, side):
    """Angle of the long rocker of a kite (crank and frame 1, coupler and rocker 2), signed over its change point: an isosceles triangle.

    The base is 2 sin(crank / 2), in the direction 90 deg + crank / 2 seen from the foot; its sign goes on through zero.
    """
    return np.pi / 2 + crank / 2 - side * np.arccos(np.sin(crank / 2) / 2)


def kite_rates(crank, side, h=1e-4):
    """First and second derivative of ``kite_output``, by central differences of fourth order."""
    f = [kite_output(crank + i * h, side) for i in (-2, -1, 0, 1, 2)]
    first = (f[0] - 8 * f[1] + 8 * f[3] - f[4]) / (12 * h)
    return first, (-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / (12 * h * h)


BESIDE = np.array([0.0, 1e-7, 3e-7, 1e-6, 1e-5, 1e-4, 5e-4, 1e-3, 5e-3])


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
@pytest.mark.parametrize("moved", TURNS)
def test_parallelogram_at_and_beside_its_change_point(engine, method, moved):
    """D follows A; the torque 10 to 1e-10 times the condition, which is the inverse of the distance; at the point it does not exist."""
    m = four_bar(1, 2, 1, 2, np.pi / 2, moved=moved)
    for side in (-1, 1):
        q = np.pi / 2 + side * BESIDE
        s = mg.solve(m, {"A": mg.Motion(q, velocity=2.0, acceleration=3.0)}, engine=engine, method=method)
        assert list(s.status) == ["change point"] + (["change point"] if s.status[1] != "ok" else ["ok"]) + ["ok"] * 7
        np.testing.assert_allclose(s["D"].position[:, 0], q, atol=1e-12)
        np.testing.assert_allclose(s["D"].velocity[:, 0], 2.0, atol=1e-9)
        np.testing.assert_allclose(s["D"].acceleration[:, 0], 3.0, atol=1e-6)
        np.testing.assert_allclose(s.link("rod").angular_velocity, 0.0, atol=1e-9)
        assert np.isnan(s["A"].effort[0, 0])
        assert np.isnan(s["C"].reaction[0]).all()
        far = np.maximum(BESIDE[2:], 1e-9)
        assert (np.abs(s["A"].effort[2:, 0] - 10.0) < 1e-10 / far).all()


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("side", [1, -1])
def test_kite_at_and_beside_its_change_point(engine, side):
    """Where the crank lies on the frame the rocker could turn alone; the branch of the driven crank goes on."""
    start = -1.0
    m = four_bar(1, 2, 2, 1, start, side)
    angles = np.concatenate([-BESIDE[:0:-1], BESIDE])
    s = mg.solve(m, {"A": mg.Motion(angles - start, velocity=1.0)}, engine=engine)
    assert (s.status[np.abs(angles) > 2e-7] == "ok").all()
    assert s.status[len(BESIDE) - 1] == "change point"
    velocity, acceleration = kite_rates(angles, -side)
    turned = kite_output(angles, -side) - kite_output(start, -side)
    np.testing.assert_allclose(s["D"].position[:, 0], turned, atol=1e-11)
    np.testing.assert_allclose(s["D"].velocity[:, 0], velocity, atol=1e-9)
    np.testing.assert_allclose(s["D"].acceleration[:, 0], acceleration, atol=1e-6)
    ok = s.status == "ok"
    power = s["A"].effort[ok, 0] - 10.0 * velocity[ok]
    assert (np.abs(power * angles[ok]) < 1e-10).all()


def test_alone_and_in_any_company():
    """The change point asked for alone, last, or among others has the same motion."""
    m = four_bar(1, 2, 1, 2, np.pi / 2)
    at = np.pi / 2
    for q in ([at], [0.3, at], [at, 3.0], [5.0, at, -1.0], np.linspace(0, 2 * np.pi, 73)):
        q = np.asarray(q)
        s = mg.kinematics(m, {"A": mg.Motion(q, velocity=1.0)})
        i = int(np.argmin(np.abs(q - at)))
        assert s.status[i] == "change point"
        assert s["D"].velocity[i, 0] == pytest.approx(1.0, abs=1e-9)
        assert s["D"].acceleration[i, 0] == pytest.approx(0.0, abs=1e-6)
        np.testing.assert_allclose(s.link("rod").pose[i, :3, :3], np.eye(3), atol=1e-9)


def rocker(dims, crank, side):
    """The rocker of a four-bar as a complex number, on the branch that goes on through its change points.

    Twice the area of the triangle over the diagonal d, d^2 = a^2 + g^2 - 2 a g cos, is half the root of ((b + c)^2 - d^2)(d^2 - (b - c)^2).
    Where b + c = a + g the first bracket is 4 a g cos^2(crank / 2), where |b - c| = |a - g| the second is 4 a g sin^2(crank / 2): there the
    root goes on with its sign, which is what a change point is.
    """
    a, b, c, g = dims
    d = g - a * np.exp(1j * crank)
    square = np.abs(d) ** 2
    twice = 2 * np.sqrt(a * g)
    far = twice * np.cos(crank / 2) if b + c == a + g else np.sqrt((b + c) ** 2 - square)
    near = twice * np.sin(crank / 2) if abs(b - c) == abs(a - g) else np.sqrt(square - (b - c) ** 2)
    return d * ((b * b - c * c + square + 1j * side * far * near) / (2 * square) - 1)


@pytest.mark.daily(2)
@pytest.mark.parametrize("dims", [(1, 1, 2, 2), (1, 1, 1, 1), (1, 2, 2, 1), (1, 2, 1, 2), (2, 1, 2, 1), (2, 2, 1, 1)])
@pytest.mark.parametrize("side", [1, -1])
def test_velocity_is_continuous_over_whole_turns(dims, side):
    """Kites, a square and parallelograms over a turn: positions and rates are those of one smooth branch, change points included."""
    m, h = four_bar(*dims, crank=-0.9, side=side), 1e-4
    q = np.linspace(0, 2 * np.pi, 361)
    s = mg.kinematics(m, {"A": mg.Motion(q, velocity=1.0)})
    here = rocker(dims, q - 0.9, -side)
    np.testing.assert_allclose(s["D"].position[:, 0], np.unwrap(np.angle(here / here[0])), atol=1e-10)
    f = [np.angle(rocker(dims, q - 0.9 + i * h, -side) / here) for i in (-2, -1, 1, 2)]
    np.testing.assert_allclose(s["D"].velocity[:, 0], (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h), atol=1e-9)


@pytest.mark.daily(2)
@pytest.mark.parametrize(
    ("engine", "off"),
    [(engine, off) for off in (9e-4, 5e-4, 1e-4, 1e-5) for engine in ("dense", "sparse")] + [("dense", 1e-6)],
)
def test_a_path_that_starts_beside_a_change_point(engine, off):
    """The branch is followed behind its start too, to pass the point; rates solved beside it would be rounding over the cube."""
    m = four_bar(1, 2, 2, 1, -off, 1)
    angles = np.array([-off, -0.5 * off, 0.0, 1e-4, 1e-3, 5e-3])
    s = mg.kinematics(m, {"A": mg.Motion(angles + off, velocity=1.0)}, engine=engine)
    assert list(s.status) == ["ok"] * 2 + ["change point"] + ["ok"] * 3
    velocity, acceleration = kite_rates(angles, -1)
    np.testing.assert_allclose(s["D"].velocity[:, 0], velocity, atol=1e-8)
    np.testing.assert_allclose(s["D"].acceleration[:, 0], acceleration, atol=1e-6)


def test_dependent_drivers_are_compared_beside_a_change_point_too():
    """Both cranks of a parallelogram driven: one leads, and the other agrees, or does not for a thousandth of a radian."""
    m = four_bar(1, 2, 1, 2, np.pi / 2)
    q = np.pi / 2 + np.array([-0.1, -1e-3, 0.0, 1e-3, 0.1])
    agreeing = mg.kinematics(m, {"A": q, "D": q})
    assert list(agreeing.status) == ["ok", "ok", "change point", "ok", "ok"]
    for i in (1, 2, 3):
        other = q.copy()
        other[i] += 0.05
        with pytest.raises(mg.IndeterminateError, match="no position satisfies all prescribed motions"):
            mg.kinematics(m, {"A": q, "D": other})


def test_coupler_between_ball_joints():
    """The rod of the parallelogram between two spheres spins idly: held at rest across the change point too."""
    m = four_bar(1, 2, 1, 2, np.pi / 2, rod="SS")
    q = np.pi / 2 + np.array([-0.1, -1e-3, 0.0, 1e-3, 0.1])
    s = mg.kinematics(m, {"A": mg.Motion(q, velocity=1.0)})
    assert list(s.status) == ["ok", "ok", "change point", "ok", "ok"]
    np.testing.assert_allclose(s["D"].velocity[:, 0], 1.0, atol=1e-9)
    np.testing.assert_allclose(s.link("rod").pose[:, :3, :3], np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-9)
    np.testing.assert_allclose(s.link("rod").angular_velocity, 0.0, atol=1e-8)


def test_study_over_a_change_point():
    """Variants of loads share one motion, change point included."""
    m = four_bar(1, 2, 1, 2, np.pi / 2)
    q = np.array([0.3, np.pi / 2, 2.0])
    study = mg.study(m, {"loads[0].value": [-10.0, -5.0]}, ["A.effort", "D.velocity"], n=2, motions={"A": q})
    wanted = -study.parameters["loads[0].value"][:, None]
    np.testing.assert_allclose(study.outputs["A.effort"][:, [0, 2]], np.broadcast_to(wanted, (2, 2)), atol=1e-9)
    assert (np.asarray(study.status)[:, 1] == "change point").all()
    assert np.isnan(study.outputs["A.effort"][:, 1]).all()
    assert np.isfinite(study.outputs["D.velocity"][:, 1]).all()


@pytest.mark.parametrize(("dims", "slopes"), [((1, 2, 1, 2), {1.0, -3.0}), ((1, 3, 2, 2), {-1 - 3**0.5, -1 + 3**0.5})])
def test_a_path_cannot_start_at_a_change_point(dims, slopes):
    """All links in line: both branches by their rates, from the quadratic of the loop to second order."""
    a, b, c, g = dims
    with pytest.raises(mg.DeadPointError, match="2 branches meet there") as caught:
        mg.solve(four_bar(*dims, crank=0.0), {"A": np.array([0.0, 0.1])})
    found = sorted(way["D.Rz"] for way in caught.value.branches)
    # in line: a w1 + b w2 = c w3 (across) and a w1^2 + b w2^2 = c w3^2 (along)
    roots = np.roots([c * c - b * c, -2 * a * c, a * a + a * b])
    np.testing.assert_allclose(found, sorted(roots), atol=1e-6)
    np.testing.assert_allclose(found, sorted(slopes), atol=1e-6)


def test_a_path_cannot_be_assembled_at_a_change_point():
    """Closed from elsewhere, with the accuracy that a double root allows."""
    m = four_bar(1, 2, 1, 2, np.pi / 2).replace(start={"A": np.pi / 2})
    with pytest.raises(mg.DeadPointError, match="2 branches meet there"):
        mg.solve(m, {"A": np.array([np.pi / 2, 1.7])})


def test_branches_are_rates_for_a_unit_rate_of_a_slide_that_drives():
    """A rack of radius 0.5 turns the crank: twice the slopes of the parallelogram in line, whatever the size of the mechanism."""
    m = four_bar(1, 2, 1, 2, crank=0.0)
    rack = mg.Pair("T", "P", "frame", "rack", point=(0, 3, 0), axis=X)
    m = m.replace(links=None, pairs=[*m.pairs, rack], couplings=[mg.Coupling({"T": 2.0, "A": -1.0})], drives=["T"])
    with pytest.raises(mg.DeadPointError, match="2 branches meet there") as caught:
        mg.kinematics(m, {"T": np.array([0.0, 0.1])})
    found = sorted(tuple(np.round([way["T.Tz"], way["A.Rz"], way["D.Rz"]], 7)) for way in caught.value.branches)
    np.testing.assert_allclose(found, [(1, 2, -6), (1, 2, 2)], atol=1e-6)


def exact_rocker(bars, crank, side):
    """Angle and acceleration of the rocker of a planar four-bar whose crank turns with 1, of fifty digits.

    Two triangles give the directions of the bars, ``a e^(i crank) + b e^(i beta) = g + c e^(i phi)`` and its derivatives their rates.
    """
    with localcontext(prec=50):
        a, b, c, g = map(Decimal, bars)
        u = Decimal(math.tan(crank / 2))
        cos, sin = (1 - u * u) / (1 + u * u), 2 * u / (1 + u * u)
        x, y = g - a * cos, -a * sin
        d = (x * x + y * y).sqrt()
        along = (b * b - c * c + d * d) / (2 * d)
        h = side * (b * b - along * along).sqrt()
        bx, by = (along * x - h * y) / d, (along * y + h * x) / d
        cx, cy = bx - x, by - y

        def rates(right, up):  # (-by, bx) beta' - (-cy, cx) phi' = (right, up)
            det = bx * cy - by * cx
            return (right * cx + up * cy) / det, (right * bx + up * by) / det

        beta, phi = rates(a * sin, -a * cos)
        return math.atan2(cy, cx), float(
            rates(a * cos + bx * beta**2 - cx * phi**2, a * sin + by * beta**2 - cy * phi**2)[1]
        )


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize(("bars", "side"), [((1, 2.5, 2, 1.5), 1), ((1, 3, 2, 2), 1), ((1.5, 3, 2.5, 2), -1)])
def test_accelerations_beside_a_change_point_are_those_of_fifty_digits(engine, bars, side):
    """To 5e-8 with either engine (the inverse cube of the distance times rounding), and to ten times what the position itself estimates."""
    away = np.array([1e-5, 3e-4, 2.4e-3, 4.9e-3, 5.1e-3, 1e-2, 3e-2, 0.1, 0.3])
    q = np.concatenate([-away[::-1], away])
    m = four_bar(*bars, -1.0, side)
    s = mg.solve(m, {"A": mg.Motion(q + 1.0, velocity=1.0)}, engine=engine)
    assert (s.status == "ok").all()
    exact = np.array(
        [
            exact_rocker(bars, at, way)[1]
            for at, way in zip(q.tolist(), (-side * np.sign(q)).astype(int).tolist(), strict=True)
        ]
    )
    error = np.abs(s["D"].acceleration[:, 0] - exact)
    assert error.max() < 1e-7
    assert (error < 10 * s.checks.accuracy * np.maximum(1.0, np.abs(exact))).all()
    assert s.checks.accuracy[[0, -1]].max() < 1e-11
    (crossing, *rest) = s.warnings
    assert crossing.miss < 1e-14
    assert crossing.drivers["A.Rz"] == pytest.approx(1.0, abs=1e-6)
    own, other = (way["D.Rz"] for way in crossing.branches)
    assert own == pytest.approx(s["D"].velocity[len(away), 0], abs=1e-3)
    assert abs(other - own) > 0.1
    assert [w.many for w in rest] == [n for n in [np.count_nonzero(s.checks.accuracy > 1e-6)] if n]


def test_an_ordinary_cycle_is_accurate_and_says_so():
    s = mg.solve(four_bar(1, 3, 2.5, 3, 0.3), {"A": mg.Motion(np.linspace(0, 6, 7), velocity=1.0)})
    assert s.checks.accuracy.max() < 1e-12
    assert not s.warnings
    assert "accuracy of rates and forces" in s.summary()
    assert np.array_equal(s.to_pandas()["accuracy"], s.checks.accuracy)


@pytest.mark.daily(3)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize(("size", "gap"), [(0.0, 1e-9), (1e3, 1e-7), (1e4, 1e-7), (0.0, 1e-12)])
def test_a_narrow_gap_is_followed_or_told_whatever_stands_beside(engine, size, gap):
    """Two branches of a four-bar of 1 m pass each other; a tower of 1 km, which has nothing to do with it, changes nothing."""
    bars, start = (1 - gap, 2.5, 2, 1.5), -1.0
    m = four_bar(*bars, start)
    motions = {"A": mg.Motion(np.array([0.5, 1.5]))}
    if size:
        tower = mg.Pair("T", "R", "frame", "tower", point=(size, 0.3 * size, 0), axis=Z)
        m = mg.Mechanism("two", pairs=[*m.pairs, tower], drives=["A", "T"])
        motions["T"] = mg.Motion(np.zeros(2))
    s = mg.kinematics(m, motions, engine=engine)
    angle = [exact_rocker(bars, q, 1)[0] for q in (start, start + 0.5, start + 1.5)]
    stays = np.cos(
        s["D"].position[:, 0] - np.diff(angle)[0] * np.array([1, 0]) - (angle[2] - angle[0]) * np.array([0, 1])
    )
    if gap > 1e-11:
        np.testing.assert_allclose(stays, 1.0, atol=1e-12)
        assert not s.warnings
    else:
        assert stays[1] < 1 - 1e-6
        (told,) = s.warnings
        assert told.miss == pytest.approx(gap, rel=1.0)
        assert len(told.branches) == 2


@pytest.mark.parametrize("short", [1e-10, 4e-11, 1e-12])
def test_what_passes_a_gap_that_is_crossed_is_told_with_both_branches(short):
    """The slider of a rod as long as the crank goes on as 2 cos t, or stands still behind t = pi / 2."""
    start, rod = 0.3, 1.0 - short
    out = np.cos(start) + np.sqrt((rod - np.sin(start)) * (rod + np.sin(start)))
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "crank", "rod", point=(np.cos(start), np.sin(start), 0), axis=Z),
        mg.Pair("C", "R", "rod", "slider", point=(out, 0, 0), axis=Z),
        mg.Pair("D", "P", "frame", "slider", point=(out, 0, 0), axis=(1, 0, 0)),
    ]
    s = mg.kinematics(mg.Mechanism("slider", None, pairs, ["A"]), {"A": [1.0, 2.0]}, on_reach="flag")
    assert s.status.tolist() == ["ok", "ok"]
    (told,) = s.warnings
    assert told.miss == pytest.approx(short, rel=1.0)
    assert [way["D.Tz"] for way in told.branches] == pytest.approx([-2.0, 0.0], abs=1e-3)
