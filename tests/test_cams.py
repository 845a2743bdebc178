"""Cam laws, cams and their followers: closed forms of W. Norton's and Rothbart's books, and forces along the motion."""

import csv
import pickle
import warnings

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)
D = np.deg2rad
TABLE = {  # Cv, Ca, Cj in closed form
    "constant_acceleration": (2, 4, np.inf),
    "harmonic": (np.pi / 2, np.pi**2 / 2, np.inf),
    "modified_trapezoid": (2, 8 * np.pi / (np.pi + 2), 32 * np.pi**2 / (np.pi + 2)),
    "modified_sine": (4 * np.pi / (np.pi + 4), 4 * np.pi**2 / (np.pi + 4), 16 * np.pi**3 / (np.pi + 4)),
    "cycloidal": (2, 2 * np.pi, 4 * np.pi**2),
    "poly345": (15 / 8, 10 / np.sqrt(3), 60),
    "poly4567": (35 / 16, 84 * np.sqrt(5) / 25, 52.5),
}


def neklutin(b, c, d):
    """The factors of the SCCA family by Neklutin's formulas."""
    p, e = np.pi, 1 - b - c - d
    K = b**2 * (1 / (2 * p) - 1 / p**2) + b * c / (2 * p) + c**2 / 8 + b * d / (2 * p) + c * d / 4 + d**2 / p**2
    K += (b / p + c / 2 + d / p) * e / 2
    Ca = 1 / (2 * K)
    return Ca * (b / p + c / 2 + d / p), Ca, max(p * Ca / b, p * Ca / d)


THIRD = 2 * np.pi / 3


def double_dwell(name="cycloidal", rise=0.02, over=THIRD, **more):
    """Rise, dwell, return, dwell."""
    rest = mg.Segment("dwell", over=np.pi - over)
    return mg.CamLaw([mg.Segment(name, rise, over, **more), rest, mg.Segment(name, -rise, over, **more), rest])


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", TABLE)
def test_factors_of_the_standard_laws(name):
    assert mg.cam_laws()[name] == pytest.approx(TABLE[name], rel=1e-12)


@pytest.mark.parametrize(
    ("shares", "printed"),
    [
        ((1 / 3,) * 3, (2, 5.278810, 49.751614)),
        ((0.2, 0, 0.6), (1.527539, 5.998630, 94.226265)),
        ((0.3, 0.1, 0.4), None),
    ],
)
def test_factors_of_scca(shares, printed):
    b, c, d = shares
    law = double_dwell("scca", sine=b, constant=c, cosine=d)
    assert law.factors[0] == pytest.approx(neklutin(b, c, d), rel=1e-12)
    assert law.factors[0] == pytest.approx(printed or neklutin(b, c, d), abs=5e-7)
    assert law.at(D(60))[0] == pytest.approx(0.01, rel=1e-13)


@pytest.mark.parametrize("name", [*TABLE, "scca"])
def test_derivatives_are_those_of_the_lift(name):
    """By complex steps, away from the joints of the pieces."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)
        law = double_dwell(name, **({"sine": 0.2, "constant": 0.3, "cosine": 0.1} if name == "scca" else {}))
    u = np.linspace(0.01, 6.2, 97)
    ahead = law.at(u + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(ahead[:3], law.at(u)[1:], atol=1e-13)


def test_seams_of_a_modified_sine_jump_in_the_jerk_alone():
    """Acceptance: jerk h Cj / over^3."""
    law = double_dwell("modified_sine")
    expected = 0.02 * 16 * np.pi**3 / (np.pi + 4) / D(120) ** 3
    assert [seam.angle for seam in law.seams] == pytest.approx([0, D(120), np.pi, np.pi + D(120)])
    assert law.seams[0].jump[3] == pytest.approx(expected, rel=1e-12)
    assert all(not seam.jump[:3].any() for seam in law.seams)
    assert "jump of the jerk" in str(law)


def test_a_jump_of_the_acceleration_is_a_warning_and_of_the_slope_an_error():
    with pytest.warns(mg.MechgraphWarning, match="the acceleration jumps by"):
        law = double_dwell("harmonic")
    assert law.seams[0].jump[2] == pytest.approx(0.01 * 1.5**2)
    with pytest.raises(mg.DeclarationError, match="the slope jumps by") as error:
        double_dwell("constant_speed")
    assert len(error.value.faults) == 4
    with pytest.raises(mg.DeclarationError, match=r"0\.5 is left: change over=, or add a dwell"):
        mg.CamLaw([mg.Segment("poly345", 0.01, 2.0), mg.Segment("poly345", -0.01, 1.5)], turn=4.0)
    with pytest.raises(mg.DeclarationError, match="the rises must add up to zero"):
        mg.CamLaw([mg.Segment("poly345", 0.01, 2.0), mg.Segment("poly345", -0.02, 2.0)], turn=4.0)


def test_all_faults_of_a_law_are_told_at_once():
    segments = [
        mg.Segment("dwel"),
        mg.Segment("poly345", over=-1),
        mg.Segment("scca", 1.0, 1.0),
        mg.Segment("dwell", rise=1.0),
        3,
    ]
    with pytest.raises(mg.DeclarationError) as error:
        mg.CamLaw(segments)
    assert [fault.partition(":")[0] for fault in error.value.faults] == [
        "segment 1", "segment 2", "segment 3", "segment 4", "segment 5 = 3"
    ]  # fmt: skip


def test_conditions_make_the_polynomial_and_the_spline():
    rest = {(a, k): 0.0 for a in (0.0, 2.0) for k in (1, 2)} | {(0.0, 0): 0.0, (2.0, 0): 0.03}
    made = mg.CamLaw([mg.Segment("polynomial", over=2.0, conditions=rest), mg.Segment("poly345", -0.03, 2.0)], turn=4.0)
    known = mg.CamLaw([mg.Segment("poly345", 0.03, 2.0), mg.Segment("poly345", -0.03, 2.0)], turn=4.0)
    u = np.linspace(0, 4, 57)
    np.testing.assert_allclose(made.at(u), known.at(u), atol=1e-13)
    passed = rest | {(0.7, 0): 0.012, (0.0, 3): 0.0, (2.0, 3): 0.0}
    spline = mg.Segment("bspline", over=2.0, conditions=passed, knots=(0.6, 1.4))
    law = mg.CamLaw([spline, mg.Segment("poly4567", -0.03, 2.0)], turn=4.0)
    assert law.at(0.7)[0] == pytest.approx(0.012, rel=1e-12)
    assert not law.seams[1].jump.any()
    with pytest.raises(mg.DeclarationError, match="do not determine the law"):
        mg.CamLaw(
            [spline.replace(conditions={(0.0, k): 0.0 for k in range(4)} | {(0.1 * i, 0): 0.0 for i in range(1, 6)})],
            turn=2.0,
        )


def test_motion_takes_the_same_laws():
    t = np.linspace(-1, 4, 41)
    for name, more in (
        ("modified_sine", {}),
        ("scca", {"sine": 0.2, "constant": 0.2, "cosine": 0.2}),
        ("polynomial", {"coefficients": (0, 0, 0, 10, -15, 6)}),
    ):
        motion = mg.Motion.law(name, 0.3, 2.0, t, **more)
        law = mg.CamLaw(
            [mg.Segment(name, 0.3, 2.0, **more), mg.Segment("dwell", over=2.0), mg.Segment("poly345", -0.3, 2.0)],
            turn=6.0,
        )
        inside = (t >= 0) & (t <= 2)
        found = np.array([motion.position, motion.velocity, motion.acceleration])
        np.testing.assert_allclose(found[:, inside], law.at(t[inside])[:3], atol=1e-12)
    by = mg.Motion.law("polynomial", duration=2.0, t=[1.0], conditions={(0, 0): 0, (0, 1): 0, (2, 0): 1.0, (2, 1): 0})
    assert by.position[0] == pytest.approx(0.5)
    assert mg.Motion.law("dwell", t=[0.0, 1.0], start=2.0).position.tolist() == [2.0, 2.0]


# --- cams ------------------------------------------------------------------------------------------------------------


def test_pressure_angle_and_radii_of_a_roller_cam():
    """Acceptance: prime circle 50, cycloidal 20 in 120 deg."""
    law = double_dwell(rise=20.0)
    u = np.linspace(0, D(120), 20001)
    s, v = law.at(u)[:2]
    cam = mg.Curve.cam(law=law, base_radius=40.0, roller_radius=10.0)
    found = cam.facts(u)
    np.testing.assert_allclose(found.pressure_angle, np.arctan(np.abs(v) / (50 + s)), atol=1e-12)
    assert np.rad2deg(found.pressure_angle.max()) == pytest.approx(17.84659, abs=5e-6)
    offset = cam.replace(offset=-5.0).facts(u).pressure_angle
    assert np.rad2deg(offset.max()) == pytest.approx(13.38567, abs=5e-6)
    whole = cam.facts(np.linspace(0, 2 * np.pi, 20001))
    positive = whole.pitch_radius[whole.pitch_radius > 0]
    assert positive.min() == pytest.approx(47.77415, abs=5e-5)
    assert not whole.undercut.any()
    assert mg.least_base_radius(law) == pytest.approx(24.29011, abs=5e-6)
    assert mg.least_base_radius(law, roller_radius=8.0) == pytest.approx(16.29011, abs=5e-6)
    wanted = mg.least_base_radius(law, roller_radius=8.0, least_radius=40.0)
    radii = (
        mg.Curve.cam(law=law, base_radius=wanted, roller_radius=8.0)
        .facts(np.linspace(0, 2 * np.pi, 20001))
        .profile_radius
    )
    assert radii[radii > 0].min() == pytest.approx(40.0, abs=1e-4)


def test_a_flat_face():
    """Acceptance: least base radius -min(s + s''), face max s'."""
    law = double_dwell(rise=20.0)
    assert mg.least_base_radius(law, follower="flat") == pytest.approx(10.66399, abs=5e-6)
    cam = mg.Curve.cam(law=law, base_radius=12.0, follower="flat")
    found = cam.facts(np.linspace(0, D(120), 20001))
    assert found.face == pytest.approx(19.09859, abs=5e-6)
    s, _, a, _ = law.at(np.linspace(0, D(120), 20001))
    np.testing.assert_allclose(found.profile_radius, 12.0 + s + a, rtol=1e-9)
    assert mg.Curve.cam(law=law, base_radius=10.0, follower="flat").facts(np.linspace(0, 6, 2001)).undercut.any()


@pytest.mark.parametrize("mirrored", [False, True])
def test_pressure_angle_of_an_arm(mirrored):
    """Acceptance: tan a = |l (1 + s q') - c cos p| / (c sin p); c 120, l 90, r0 50, dwell: 24.975 deg."""
    law = double_dwell(rise=0.3)
    cam = mg.Curve.arm_cam(law=law, base_radius=40.0, roller_radius=10.0, arm=90.0, pivot=120.0, mirrored=mirrored)
    u = np.linspace(0, 2 * np.pi, 401)
    q, rate = law.at(u)[:2]
    p = np.arccos((120**2 + 90**2 - 50**2) / (2 * 120 * 90)) + q
    expected = np.arctan(np.abs(90 * (1 + (-1 if mirrored else 1) * rate) - 120 * np.cos(p)) / (120 * np.sin(p)))
    np.testing.assert_allclose(cam.facts(u).pressure_angle, expected, atol=1e-12)
    assert np.rad2deg(cam.facts(6.2).pressure_angle) == pytest.approx(24.975, abs=5e-4)


TURN = mg.Motion(np.linspace(0.05, 6.2, 25), 3.0, 2.0)


def driven(pair, guide, loads):
    links = [mg.Link("frame"), mg.Link("cam"), mg.Link("follower")]
    return mg.Mechanism(
        "cam", links, [mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z), guide, pair], ["A"], loads
    )


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_flat_arm_follows_its_law(mirrored):
    law = double_dwell("poly4567", rise=0.1)
    cam = mg.Curve.arm_cam(
        law=law, base_radius=0.05, pivot=0.12, offset=0.01, follower="flat", second=(1, 0, 0), mirrored=mirrored
    )
    pivot = (0.12, 0, 0)
    m = driven(
        mg.Pair("K", "Kc", "cam", "follower", curve=cam, point=cam.at(np.array(0.0))[0], closed="form"),
        mg.Pair("B", "R", "frame", "follower", point=pivot, axis=Z),
        [mg.Effort("B", -2.0)],
    )
    s = mg.solve(m, {"A": TURN})
    q, rate, bend, _ = law.at(TURN.position)
    sense = 1.0 if mirrored else -1.0
    np.testing.assert_allclose(s["B"].position[:, 0], sense * q, atol=1e-10)
    np.testing.assert_allclose(s["B"].velocity[:, 0], sense * 3 * rate, atol=1e-9)
    np.testing.assert_allclose(s["B"].acceleration[:, 0], sense * (9 * bend + 2 * rate), atol=1e-7)
    facts = cam.facts(TURN.position)
    np.testing.assert_allclose(s.contact("K").pressure_angle("follower"), facts.pressure_angle, atol=1e-9)
    assert s.checks.power.max() < 1e-11


def test_a_barrel_lifts_by_its_law_and_its_wall_presses():
    """Acceptance: mobility 1, redundancy 0; tan a = s'/R, N = F / cos a, torque F s'."""
    law, R, F = double_dwell("modified_sine", rise=0.03), 0.05, 200.0
    cam = mg.Curve.barrel(law=law, radius=R, roller_radius=0.006, second=(1, 0, 0))
    start = (R, 0, 0)
    m = driven(
        mg.Pair("K", "Rg", "cam", "follower", curve=cam, point=start),
        mg.Pair("B", "P", "frame", "follower", point=start, axis=Z),
        [mg.Wrench("follower", force=(0, 0, -F), point=start)],
    )
    report = mg.check(m)
    assert (report.mobility, report.redundancy, report.mobility_by_count) == (1, 0, 1)
    s = mg.solve(m, {"A": TURN})
    lift, rate, bend, _ = law.at(TURN.position)
    np.testing.assert_allclose(s["B"].position[:, 0], lift, atol=1e-11)
    np.testing.assert_allclose(s["B"].velocity[:, 0], 3 * rate, atol=1e-10)
    np.testing.assert_allclose(s["B"].acceleration[:, 0], 9 * bend + 2 * rate, atol=1e-8)
    alpha = np.arctan(np.abs(rate) / R)
    np.testing.assert_allclose(cam.facts(TURN.position).pressure_angle, alpha, atol=1e-12)
    np.testing.assert_allclose(s.contact("K").pressure_angle("follower"), alpha, atol=1e-9)
    np.testing.assert_allclose(np.abs(s["K"].components["Fy"]), F / np.cos(alpha), rtol=1e-9)
    np.testing.assert_allclose(s["A"].effort[:, 0], F * rate, atol=1e-9 * F)
    assert s.checks.power.max() < 1e-11


def test_a_globoid_swings_by_its_law_and_its_wall_presses():
    """Acceptance: tan a = L q' / (C - L cos q)."""
    rest = mg.Segment("dwell", over=np.pi - 2.0)
    law = mg.CamLaw(
        [mg.Segment("modified_sine", 0.6, 2.0), rest, mg.Segment("modified_sine", -0.6, 2.0), rest], start=-0.3
    )
    L, C, M = 0.06, 0.1, 5.0
    cam = mg.Curve.globoid(law=law, distance=C, arm=L, roller_radius=0.006, second=(1, 0, 0))
    m = driven(
        mg.Pair("K", "Rg", "cam", "follower", curve=cam, point=cam.at(np.array(0.0))[0]),
        mg.Pair("B", "R", "frame", "follower", point=(C, 0, 0), axis=(0, 1, 0)),
        [mg.Effort("B", -M)],
    )
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 0)
    s = mg.solve(m, {"A": TURN})
    q, rate = law.at(TURN.position)[:2]
    np.testing.assert_allclose(s["B"].position[:, 0], q + 0.3, atol=1e-10)
    np.testing.assert_allclose(s["B"].velocity[:, 0], 3 * rate, atol=1e-9)
    alpha = np.arctan(L * np.abs(rate) / (C - L * np.cos(q)))
    np.testing.assert_allclose(cam.facts(TURN.position).pressure_angle, alpha, atol=1e-12)
    np.testing.assert_allclose(s.contact("K").pressure_angle("follower"), alpha, atol=1e-9)
    np.testing.assert_allclose(np.abs(s["K"].components["Fy"]), M / L / np.cos(alpha), rtol=1e-8)
    np.testing.assert_allclose(s["A"].effort[:, 0], M * rate, atol=1e-8)
    assert s.checks.power.max() < 1e-11


LAW = double_dwell("modified_sine")
SHAPES = {
    "cam": mg.Curve.cam(law=LAW, base_radius=0.04, roller_radius=0.01),
    "flat": mg.Curve.cam(law=LAW, base_radius=0.04, follower="flat"),
    "arm": mg.Curve.arm_cam(law=double_dwell(rise=0.3), base_radius=0.04, arm=0.09, pivot=0.12),
    "barrel": mg.Curve.barrel(law=LAW, radius=0.05),
    "globoid": mg.Curve.globoid(law=double_dwell(rise=0.3), distance=0.1, arm=0.06),
}


@pytest.mark.daily(2)
@pytest.mark.parametrize("kind", SHAPES)
def test_cams_come_back_from_files_copies_and_units(kind, tmp_path):
    curve = SHAPES[kind]
    assert pickle.loads(pickle.dumps(curve)) == curve
    type = {"flat": "Kc", "barrel": "Rg", "globoid": "Rg"}.get(kind, "Ps")
    m = mg.Mechanism("m", pairs=[mg.Pair("K", type, "a", "b", curve=curve)], units={"length": "m"})
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    in_mm = m.to_units(length="mm")
    there = in_mm.pairs[0].curve
    u = np.linspace(0, 6, 11)
    np.testing.assert_allclose(there.at(u), 1e3 * curve.at(u), atol=1e-9)
    assert in_mm.to_units(length="m").pairs[0].curve.law.at(1.0) == pytest.approx(curve.law.at(1.0))


@pytest.mark.parametrize("kind", SHAPES)
def test_derivatives_of_a_cam_are_those_of_its_place(kind):
    curve, u = SHAPES[kind], np.linspace(0.013, 6.2, 41)
    ahead = curve.at(u + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(ahead[:3], curve.at(u)[1:], atol=1e-11)
    if (depth := curve.depth(u)) is not None:
        np.testing.assert_allclose(curve.depth(u + 1e-30j).imag[:3] / 1e-30, depth[1:], atol=1e-11)
        np.testing.assert_allclose((depth[0] * curve.at(u)[1]).sum(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: mg.Curve.cam(base_radius=1.0), "law: is missing"),
        (
            lambda: mg.Curve.cam(base_radius=1.0, law=mg.CamLaw([mg.Segment("dwell", over=2.0)], turn=2.0)),
            "repeats after 2 pi",
        ),
        (lambda: mg.Curve.barrel(radius=0.05, law=LAW, roller_radius=0.3), "undercut"),
        (lambda: mg.Curve.globoid(distance=0.1, arm=0.2, law=LAW), "reaches the axis"),
        (
            lambda: mg.Curve.arm_cam(base_radius=0.1, pivot=0.05, follower="flat", law=LAW),
            "must be above base_radius - offset",
        ),
        (lambda: mg.Curve.arm_cam(base_radius=0.1, pivot=0.3, law=LAW), "a roller takes arm="),
    ],
)
def test_cams_that_cannot_be_are_refused(make, words):
    with pytest.raises(mg.DeclarationError, match=words):
        mg.Mechanism("m", pairs=[mg.Pair("K", "Rg", "a", "b", curve=make())])


# --- tables ----------------------------------------------------------------------------------------------------------


def test_a_table_is_read_and_passed(tmp_path):
    law, degrees = double_dwell("poly4567", rise=20.0), np.arange(0.0, 360.0)
    path = tmp_path / "table.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("angle", "lift"), *zip(degrees, law.at(D(degrees))[0], strict=True)])
    read = mg.CamLaw.read(path, scale=1e-3)
    u = np.linspace(0, 7, 301)
    np.testing.assert_allclose(read.at(u)[0], 1e-3 * law.at(u)[0], atol=1e-9)
    assert read.deviation < 1e-15
    assert mg.CamLaw.read({"angle": degrees, "lift": law.at(D(degrees))[0]}, scale=1e-3) == read
    with pytest.raises(
        mg.DeclarationError, match=r"column 'hub': expected six or more numbers \(columns: angle, lift\)"
    ):
        mg.CamLaw.read(path, lift="hub")


def test_rounded_samples_are_smoothed():
    """No point is moved by more than 10 um; a spline through the points has an acceleration several times too large."""
    law, degrees = (
        mg.CamLaw([mg.Segment("harmonic", 0.02, np.pi), mg.Segment("harmonic", -0.02, np.pi)]),
        np.arange(0.0, 360.0),
    )
    table = {"angle": degrees, "lift": np.round(law.at(D(degrees))[0], 5)}
    u = np.linspace(0, 2 * np.pi, 2001)
    size = np.abs(law.at(u)[2]).max()
    smooth, through = (mg.CamLaw.read(table, smooth=s) for s in (1e-5, None))
    assert smooth.deviation <= 1e-5
    miss = [np.abs(read.at(u)[2] - law.at(u)[2]).max() / size for read in (smooth, through)]
    assert miss[0] < 0.02
    assert miss[1] > 3


# --- paths of cutters and drawings -----------------------------------------------------------------------------------


def test_the_path_of_a_cutter_less_its_radius_is_the_profile():
    """Acceptance: every point of the profile is the radius of the cutter from its path, and no point is nearer."""
    cam = SHAPES["cam"]
    s = np.linspace(0, cam.length, 801)
    profile, path = (cam.cutter_path(r).at(s)[0] for r in (0.0, 0.016))
    np.testing.assert_allclose(np.linalg.norm(path - profile, axis=0), 0.016, rtol=1e-12)
    near = np.linalg.norm(path[:, ::40, None] - profile[:, None], axis=0).min(axis=1)
    np.testing.assert_allclose(near, 0.016, rtol=1e-9)
    assert cam.cutter_path(0.01) is cam
    u = np.linspace(0, 6, 301)
    assert np.abs(np.linalg.norm(SHAPES["flat"].cutter_path(0.0).at(u)[0], axis=0)).min() >= 0.04 - 1e-12


def test_a_cutter_too_large_is_refused():
    """By the least radius of curvature where the profile is hollow."""
    law = double_dwell("poly345", rise=0.03, over=1.2)
    cam = mg.Curve.cam(law=law, base_radius=0.03, roller_radius=0.006)
    radii = cam.facts(np.linspace(0, 2 * np.pi, 40001)).profile_radius
    least = -radii[radii < 0].max()
    cam.cutter_path(0.99 * least)
    with pytest.raises(mg.DeclarationError, match="the profile is hollow with the radius"):
        cam.cutter_path(1.01 * least)
    with pytest.raises(mg.DeclarationError, match="a groove is cut along the path of its roller"):
        SHAPES["barrel"].cutter_path(0.01)


@pytest.mark.parametrize("form", ["spline", "polyline"])
def test_a_drawing_read_back_is_the_cam_within_the_chord_error(form, tmp_path):
    """Read by ezdxf: points of every entity, flattened finely, against points of the curves, and the other way round."""
    ezdxf = pytest.importorskip("ezdxf")
    cam, error = SHAPES["cam"], 1e-5
    cam.write(tmp_path / "cam.dxf", error=error, cutter=0.016, form=form, unit="m")
    drawing = ezdxf.readfile(tmp_path / "cam.dxf")
    assert drawing.header["$INSUNITS"] == 6
    length = cam.length
    for layer, radius in (("PROFILE", 0.0), ("PITCH", 0.01), ("CUTTER", 0.016)):
        (entity,) = drawing.modelspace().query(f'*[layer=="{layer}"]')
        if form == "spline":
            read = np.array([tuple(p) for p in entity.flattening(error / 50, segments=64)])
        else:
            corners = np.array([tuple(v.dxf.location) for v in entity.vertices])
            ends = np.roll(corners, -1, axis=0)
            read = (corners[:, None] + (ends - corners)[:, None] * np.linspace(0, 1, 9)[:, None]).reshape(-1, 3)
        curve = cam.cutter_path(radius)
        u = np.linspace(0, 2 * np.pi if radius == 0.01 else length, 20001)
        true = curve.at(u)[0].T
        for one, other in ((read[::31], true), (true[::397], read)):
            near = np.array([np.linalg.norm(other - p, axis=1).min() for p in one])
            grain = 0.5 * np.linalg.norm(np.diff(other, axis=0), axis=1).max()
            assert near.max() < np.hypot(error, grain)


def test_a_table_of_a_cam_has_its_facts(tmp_path):
    cam = SHAPES["cam"]
    cam.write(tmp_path / "cam.csv", error=1e-5, cutter=0.0)
    with (tmp_path / "cam.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    u = np.array([float(row["angle"]) for row in rows])
    np.testing.assert_allclose([float(row["pressure angle"]) for row in rows], cam.facts(u).pressure_angle, atol=1e-15)
    profile, cut, pitch = (
        np.array([[float(row[f"{of} {x}"]) for x in "xyz"] for row in rows]) for of in ("profile", "cutter", "pitch")
    )
    np.testing.assert_allclose(profile, cut, atol=1e-16)
    np.testing.assert_allclose(np.linalg.norm(pitch - profile, axis=1), 0.01, rtol=1e-12)
    with pytest.raises(mg.FileError, match=r"unknown file extension '\.step'"):
        cam.write(tmp_path / "cam.step", error=1e-5)


@pytest.mark.parametrize(("stiffness", "expected"), [(0.0, 50.0), (1000.0, 30.0), (1e4, 0.0)])
def test_least_preload_of_a_harmonic_follower(stiffness, expected):
    """Acceptance: 20 mm a turn, .5 kg, 100 rad/s: preload + k h >= m w^2 h / 2 = 50 N, at the highest place."""
    law = mg.CamLaw([mg.Segment("harmonic", 0.02, np.pi), mg.Segment("harmonic", -0.02, np.pi)])
    cam = mg.Curve.cam(law=law, base_radius=0.05, roller_radius=0.01, second=(0, 1, 0))
    at = (0, 0.06, 0)
    guide = mg.Pair("B", "P", "frame", "follower", point=at, axis=(0, 1, 0))
    pair = mg.Pair("K", "Ps", "cam", "follower", curve=cam, point=at, closed="force")
    m = driven(pair, guide, []).replace(links=[mg.Link("frame"), mg.Link("cam"), mg.Link("follower", 0.5, at)])
    turn = mg.Motion(np.linspace(0, 2 * np.pi, 73), velocity=100.0)
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        s = mg.solve(m, {"A": turn})
    with pytest.raises(mg.DeclarationError, match="stiffness = -1"):
        mg.least_preload(s, "K", stiffness=-1.0)
    found = mg.least_preload(s, "K", stiffness=stiffness)
    assert found == pytest.approx(expected, abs=1e-8)
    # with that spring the contact holds, but not with less
    spring = mg.ForceLaw(freedom="B", law=lambda x, v, t: -(found + stiffness * x))
    assert mg.solve(m.replace(loads=[spring]), {"A": turn}).contact("K").normal_force.min() > -1e-7


def test_the_discs_of_a_conjugate_cam_keep_their_rollers_apart():
    """The second disc has the law downwards: both rollers of one follower touch at all angles, here on opposite sides, and on one arm."""
    u = np.linspace(0, 2 * np.pi, 201)
    for offset in (0.0, 0.007):
        first = mg.Curve.cam(law=LAW, base_radius=0.04, roller_radius=0.01, second=(0, 1, 0), offset=offset)
        second = first.conjugate(0.06)
        apart = first.at(u)[0] - second.at(u)[0]
        wanted = np.sqrt(0.05**2 - offset**2) + np.sqrt(0.07**2 - offset**2)
        np.testing.assert_allclose(np.linalg.norm(apart, axis=0), wanted, rtol=1e-13)
    flat = mg.Curve.cam(law=LAW, base_radius=0.04, follower="flat", second=(0, 1, 0))
    faces = [c.base_radius + sign * LAW.at(u)[0] for c, sign in ((flat, 1), (flat.conjugate(0.06), -1))]
    np.testing.assert_allclose(faces[0] + faces[1], 0.1, rtol=1e-13)
    samples = mg.Curve.cam(
        angle=[0, 2, 2 * np.pi], lift=[0, 0.01, 0], slope=[0, 0, 0], bend=[0, 0, 0], base_radius=0.04
    )
    with pytest.raises(mg.DeclarationError, match="make it of a law"):
        samples.conjugate(0.06)
    with pytest.raises(mg.DeclarationError, match="on both sides already"):
        mg.Curve.barrel(law=LAW, radius=0.05).conjugate(0.06)
    swing, arm = double_dwell(rise=0.3), {"arm": 0.09, "pivot": 0.12}
    one = mg.Curve.arm_cam(law=swing, base_radius=0.04, **arm)
    other = one.conjugate(0.06)
    apart = np.linalg.norm(one.at(u)[0] - other.at(u)[0], axis=0)
    np.testing.assert_allclose(apart, apart[0], rtol=1e-13)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: mg.least_base_radius(LAW, roller=0.008),
            "unexpected keyword argument 'roller'; did you mean follower or roller_radius?",
        ),
        (lambda: mg.cam_laws(3), "too many positional arguments; it takes no arguments"),
        (lambda: SHAPES["flat"].cutter_path(raduis=0.01), "Cam.cutter_path"),
        (lambda: SHAPES["flat"].write("x.dxf", eror=1e-5), "did you mean error?"),
        (lambda: SHAPES["flat"].facts(), "missing a required argument: 'angle'"),
        (lambda: LAW.at(), "missing a required argument: 'angle'"),
        (lambda: mg.CamLaw.read("x.csv", agle="a"), "did you mean angle"),
    ],
)
def test_calls_that_do_not_fit_are_faults(call, words):
    with pytest.raises(mg.DeclarationError) as error:
        call()
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("of", "name", "meant"),
    [
        (lambda: SHAPES["flat"].facts(1.0), "presure_angle", "pressure_angle"),
        (lambda: LAW, "seam", "seams"),
        (lambda: mg.check(mg.load("four-bar")), "mobilty", "mobility"),
    ],
)
def test_names_that_a_result_has_not(of, name, meant):
    with pytest.raises(AttributeError, match=f"has no attribute '{name}'; did you mean {meant}"):
        getattr(of(), name)
    assert getattr(of(), name, None) is None


def test_a_curve_with_faults_has_no_facts_and_is_not_written(tmp_path):
    """Slopes 60 % too large; no law at all."""
    u = np.linspace(0, 2 * np.pi, 181)
    wrong = mg.Curve.cam(
        angle=u, lift=0.01 * (1 - np.cos(u)), slope=0.016 * np.sin(u), bend=0.01 * np.cos(u), base_radius=0.03
    )
    none = mg.Curve.cam(lift=[0, 1], base_radius=0.03)
    for cam, words in ((wrong, "slope: is not the derivative of lift"), (none, "law: is missing")):
        with pytest.raises(mg.DeclarationError, match=words):
            cam.facts(1.0)
        with pytest.raises(mg.DeclarationError, match=words):
            cam.write(tmp_path / "cam.csv", error=1e-5)
