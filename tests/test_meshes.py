"""Gears as places on links: facts of meshes against closed forms, forces on any bearings, moving centers, planets, other kinds of gears."""

import time
import warnings

import numpy as np
import pytest
import scipy

import mechgraph as mg

X, Y, Z = np.eye(3)
RAD = np.deg2rad
FULL = RAD(20.0)


def inv(a):
    return np.tan(a) - a


def on_bearings(name, link, point, axis, bearings):
    """A shaft on the frame in a pair R, or in a ball, a ball in a groove and a free pair that names its turn; the freedom that turns."""
    p, u = np.array(point, dtype=float), np.array(axis, dtype=float)
    if bearings == "R":
        return [mg.Pair(name, "R", "frame", link, point=point, axis=axis)], f"{name}.Rz"
    return [
        mg.Pair(f"{name}S", "S", "frame", link, point=tuple(p - 0.04 * u)),
        mg.Pair(f"{name}G", "Sg", "frame", link, point=tuple(p + 0.06 * u), axis=axis),
        mg.Pair(name, "Fr", "frame", link, point=point, axis=axis),
    ], f"{name}.Rz"


def stage(gears, bearings="R", torque=-3.0, **mesh):
    """Two gears, each on a shaft of its own about its axis, the first driven, a torque on the second."""
    (pa, qa), (pb, qb) = (on_bearings(n, g.link, g.point, g.axis, bearings) for n, g in zip("AB", gears, strict=True))
    m = mg.Mechanism(
        "stage",
        pairs=[*pa, *pb],
        gears=gears,
        couplings=[mg.Mesh("m", gears[0].name, gears[1].name, **mesh)],
        drives=[qa],
        loads=[mg.Effort(qb, torque)],
    )
    return m, qa, qb


def spur(teeth=(20, 40), distance=0.06, module=0.002, helix=0.0, **more):
    a, b = ({k: v[i] for k, v in more.items()} for i in (0, 1))
    return [
        mg.Gear("a", "one", teeth[0], (0, 0, 0), Z, module=module, helix_angle=helix, **a),
        mg.Gear("b", "two", teeth[1], (distance, 0, 0), Z, module=module, helix_angle=-helix, **b),
    ]


def facts(gears):
    return mg.mesh_facts(stage(gears)[0])["m"]


# --- facts against closed forms (ISO 21771; figures by hand) ---------------------------------------------------------------


def test_a_pair_with_profile_shifts():
    """12 and 24 teeth, module 3, 56.5 apart, shifts .6 and .36."""
    f = facts(spur((12, 24), 56.5, 3.0, shift=(0.6, 0.36)))
    assert np.rad2deg(f.working_angle) == pytest.approx(26.08883, abs=5e-6)
    assert f.asked_shifts == pytest.approx(0.960056, abs=5e-7)
    np.testing.assert_allclose(2 * np.array(f.tip_radii), [44.84, 79.40], rtol=1e-12)
    assert f.contact_ratio == pytest.approx(1.202119, abs=1e-6)


def test_contact_ratio_backlash_and_force_at_another_distance():
    """20 and 40 teeth, module 2, at 60 and at 61.2: the base circles, and so the normal force, stay."""
    assert facts(spur(distance=60.0, module=2.0)).contact_ratio == pytest.approx(1.635186, abs=5e-7)
    far = facts(spur(distance=61.2, module=2.0))
    w = np.arccos(60 * np.cos(FULL) / 61.2)
    assert np.rad2deg(far.working_angle) == pytest.approx(22.88794, abs=5e-6)
    assert far.backlash == pytest.approx(2 * 61.2 * (inv(w) - inv(FULL)), rel=1e-12)
    assert far.backlash == pytest.approx(0.954013, abs=5e-7)
    for distance in (0.06, 0.0612):
        m, a, _ = stage(spur(distance=distance))
        assert abs(mg.solve(m, {a: 0.3}).coupling("m").effort) == pytest.approx(1.5 / (0.02 * np.cos(FULL)), rel=1e-12)


def test_undercut():
    """17.09726 teeth are the least without shift: 2 / sin^2 a; twelve need 1 - 12 / 17.09726."""
    f = facts(spur((12, 24), 56.5, 3.0, shift=(0.6, 0.36)))
    assert f.undercut[0] == pytest.approx(1 - 12 * np.sin(FULL) ** 2 / 2, rel=1e-12)
    assert f.undercut[0] == pytest.approx(0.298133, abs=5e-7)
    cut = facts(spur((12, 24), 54.0, 3.0))
    assert any("undercut" in fault for fault in cut.faults)


def test_helical_gears_and_their_overlap():
    f = facts(spur(distance=60 / np.cos(RAD(15)), module=2.0, helix=RAD(15), width=(30.0, 40.0)))
    assert np.rad2deg(f.working_angle) == pytest.approx(20.64690, abs=5e-6)
    assert f.overlap_ratio == pytest.approx(30 * np.sin(RAD(15)) / (2 * np.pi), rel=1e-12)


def test_ring_and_planet():
    f = facts(spur((30, 84), 54.0, 2.0, internal=(False, True)))
    assert f.contact_ratio == pytest.approx(1.930568, abs=5e-7)
    assert not f.faults
    # the tips of a ring of 84 teeth keep off the foot of involutes of gears with 84 * .226845 = 19.1 teeth or more
    assert any("interfere" in fault for fault in facts(spur((19, 84), 65.0, 2.0, internal=(False, True))).faults)
    assert not any("interfere" in fault for fault in facts(spur((20, 84), 64.0, 2.0, internal=(False, True))).faults)


def swept(teeth, bases, tips, distance, working):
    """How far the tip of a gear stays off the flank of its ring, least over its turns: 0 where they touch as they should."""
    turn = np.linspace(-2.8, 2.8, 40001)
    corner = turn - inv(np.arccos(bases[0] / tips[0])) + inv(working)
    x, y = distance + tips[0] * np.cos(corner), tips[0] * np.sin(corner)
    r, at = np.hypot(x, y), np.arctan2(y, x) - turn * teeth[0] / teeth[1]
    r, at = r[r > tips[1]], at[r > tips[1]]
    return float((r * (inv(working) - inv(np.arccos(bases[1] / r)) - at)).min())


def test_tips_of_a_gear_in_a_ring_of_few_teeth_more():
    """Where the facts say that tips strike, the tip swept through the ring is inside its flank, else outside: 80 random gears."""
    rng, seen = np.random.default_rng(3), []
    while len(seen) < 80:
        z, shifts = int(rng.integers(25, 60)), rng.uniform((0.0, 0.0), (0.4, 0.9))
        teeth, a = (z, z + int(rng.integers(5, 11))), RAD(rng.choice([20.0, 25.0]))
        bases, d = [0.5 * N * np.cos(a) for N in teeth], 0.5 * (teeth[1] - teeth[0]) + min(0.0, shifts[1] - shifts[0])
        working = np.arccos(min(1.0, (bases[1] - bases[0]) / d))
        tips = 0.5 * teeth[0] + 1.0 + shifts[0], 0.5 * teeth[1] - 1.0 + shifts[1]
        jams = (inv(working) - inv(a)) * (teeth[1] - teeth[0]) > 2 * np.tan(a) * (shifts[1] - shifts[0])
        if jams or working == 0.0 or tips[1] <= bases[1] or tips[0] + d <= tips[1]:
            continue
        found = facts(spur(teeth, d, 1.0, shift=tuple(shifts), pressure_angle=(a, a), internal=(False, True)))
        assert found.tip_radii == pytest.approx(tips)
        gap = swept(teeth, bases, tips, d, working)
        if not -1e-4 < gap < -1e-8 and not any("involutes" in fault for fault in found.faults):
            seen.append((gap < -1e-4, any("strike" in fault for fault in found.faults)))
    assert all(cut == told for cut, told in seen)
    assert 10 < sum(cut for cut, _ in seen) < 70


@pytest.mark.parametrize(
    ("gears", "told"),
    [
        ([*spur()[:1], mg.Gear("b", "two", 40, (0.06, 0, 0), Z, module=0.0021)], "module 0.002 of 'b'"),
        (spur(distance=0.0595), "asks for the sum -0.2418942 of shifts"),
        (spur(distance=0.07), "do not reach each other"),
        (spur(distance=0.05), "expected 0.06"),
        (
            [*spur(helix=0.1)[:1], mg.Gear("b", "two", 40, (0.0603, 0, 0), Z, module=0.002, helix_angle=0.1)],
            "-0.1 meshes",
        ),
        ([*spur()[:1], mg.Gear("b", "two", 40, (0.06, 0, 0), (0, 0.01, 1), module=0.002)], "rad off parallel"),
        ([*spur()[:1], mg.Gear("b", "two", 40, (0, 0.06, 0), X, module=0.002)], "would need the helix angle"),
        ([*spur()[:1], mg.Worm("b", "two", 2, (0.06, 0, 0), X, radius=0.01)], "expected a gear or a rack"),
        (spur(mark=(X, X)), "of a tooth off the gaps"),
    ],
)
def test_what_cannot_mesh_is_refused_with_what_would_fit(gears, told):
    with pytest.raises(mg.DeclarationError, match=told):
        stage(gears)


def test_a_gear_beside_the_axis_of_its_shaft_is_a_warning():
    at, z = {"p": (0, 0, 0), "w": (0.06, 0, 0)}, (0, 0, 1)
    pairs = [mg.Pair(k, "R", "frame", k, point=x, axis=z) for k, x in at.items()]
    for off, told in (
        (0.0, []),
        (0.001, ["'p' is 0.001 beside the axis of pair 'p'", "'w' is 0.001 beside the axis of pair 'w'"]),
    ):
        gears = [mg.Gear(k, k, n, (at[k][0] + off, 0, 0.1), z, module=0.002) for k, n in (("p", 20), ("w", 40))]
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            mg.Mechanism("stage", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", "p", "w")])
        assert len(found) == len(told)
        assert all(words in str(one.message) for one, words in zip(found, told, strict=True))


def test_marks_of_teeth_that_stand_in_gaps():
    """A tooth of a on the line of centers, and a gap of b: half a pitch beside its mark."""
    half = np.pi / 40
    stage(spur(mark=(X, (-np.cos(half), np.sin(half), 0.0))))


# --- force ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [-3.0, 3.0])
@pytest.mark.parametrize("helix", [0.0, 0.3])
def test_bearings_of_any_kind_feel_the_same_force(torque, helix):
    """A ball, and a ball in a groove: levers along the shaft by hand; the ball takes all thrust, F_t tan b."""
    gears = spur(distance=0.06 / np.cos(helix), helix=helix)
    plain, a, _ = stage(gears, torque=torque)
    real, q, turn = stage(gears, "S", torque)
    known, s = mg.solve(plain, {a: np.linspace(0, 2, 3)}), mg.solve(real, {q: np.linspace(0, 2, 3)})
    F = s.coupling("m").force
    np.testing.assert_allclose(F, known.coupling("m").force, rtol=1e-10)
    np.testing.assert_allclose(s["B"].position[:, -1], [0, -0.5, -1.0], atol=1e-12)
    tangential = -torque / gears[1].radius
    np.testing.assert_allclose(
        F[0], [abs(tangential) * np.tan(FULL) / np.cos(helix), -tangential, tangential * np.tan(helix)], atol=1e-9
    )
    np.testing.assert_allclose(s["BS"].force[:, 2], -F[:, 2], atol=1e-9)
    # at the groove: moments about the ball, 0.04 to the gear, 0.1 to the groove
    np.testing.assert_allclose(s["BG"].force[0, 1], -0.4 * F[0, 1], rtol=1e-10)
    for method in ("newton_euler", "printed"):
        other = mg.solve(real, {q: np.linspace(0, 2, 3)}, method=method)
        np.testing.assert_allclose(other["BS"].force, s["BS"].force, atol=1e-9)
    sparse = mg.solve(real, {q: np.linspace(0, 2, 3)}, engine="sparse")
    np.testing.assert_allclose(sparse["AG"].force, s["AG"].force, atol=1e-9)
    assert np.abs(s.checks.power).max() < 1e-10
    assert np.abs(s.checks.equilibrium).max() < 1e-9
    assert turn == "B.Rz"
    assert not s.warnings


def test_a_mesh_is_a_sphere_on_a_plane_along_its_line_of_action():
    """At one position, two helical stages, every shaft on a ball, a ball in a groove and a free pair."""
    r = 0.02 / np.cos(0.2)
    gears = [
        mg.Gear("a", "one", 20, (0, 0, 0), Z, module=0.002, helix_angle=0.2),
        mg.Gear("b", "two", 40, (3 * r, 0, 0), Z, module=0.002, helix_angle=-0.2),
        mg.Gear("c", "two", 20, (3 * r, 0, 0.02), Z, module=0.002, helix_angle=0.2),
        mg.Gear("d", "three", 40, (3 * r, 3 * r, 0.02), Z, module=0.002, helix_angle=-0.2),
    ]
    shafts = [
        on_bearings(n, g.link, g.point, Z, "S") for n, g in zip("ABD", (gears[0], gears[1], gears[3]), strict=True)
    ]
    pairs = [pair for some, _ in shafts for pair in some]
    m = mg.Mechanism("two stages", pairs=pairs, gears=gears, couplings=[mg.Mesh("m1", "a", "b"), mg.Mesh("m2", "c", "d")],
                     drives=["A.Rz"], loads=[mg.Effort("D.Rz", 7.0)])  # fmt: skip
    s = mg.solve(m, {"A.Rz": 0.0})
    lines = [(s.coupling(name).point, s.coupling(name).force) for name in ("m1", "m2")]
    planes = [
        mg.Pair(f"K{i}", "Sp", a, b, point=P, axis=F)
        for i, ((P, F), a, b) in enumerate(zip(lines, ("one", "two"), ("two", "three"), strict=True))
    ]
    alone = mg.solve(m.replace(gears=[], couplings=[], pairs=[*pairs, *planes]), {"A.Rz": 0.0})
    for pair in pairs:
        if pair.type.symbol != "Fr":
            np.testing.assert_allclose(alone[pair.name].force, s[pair.name].force, atol=1e-9)
    assert "Determinate" in mg.check(m).verdict
    np.testing.assert_allclose(alone["A"].effort, s["A"].effort, atol=1e-12)


def involutes(d, w):
    """Forward flanks of both gears through the pitch point, as curves, base radii 0.02 and 0.03 times cos 20 deg."""
    ra, rb = 0.02 * np.cos(FULL), 0.03 * np.cos(FULL)
    direction = lambda angle: (np.cos(angle), np.sin(angle), 0.0)
    return [
        mg.Curve.involute(center=(0, 0, 0), radius=ra, axis=-Z, second=direction(inv(w)), angles=(0.05, 1.5)),
        mg.Curve.involute(center=(d, 0, 0), radius=rb, axis=-Z, second=direction(np.pi + inv(w)), angles=(0.05, 1.5)),
    ]


def test_two_involutes_are_a_mesh_with_moving_centers():
    """The center of the second gear slides away along x while the first turns: positions, rates and forces of both descriptions."""
    d, w = 0.0502, np.arccos(0.05 * np.cos(FULL) / 0.0502)
    at = np.array([0.02 * np.cos(FULL) / np.cos(w), 0, 0])
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
        mg.Pair("P", "P", "frame", "slide", point=(d, 0, 0), axis=X),
        mg.Pair("B", "R", "slide", "two", point=(d, 0, 0), axis=Z),
    ]
    gears = [mg.Gear("a", "one", 20, (0, 0, 0), Z, module=0.002), mg.Gear("b", "two", 30, (d, 0, 0), Z, module=0.002)]
    links = [
        mg.Link("frame"),
        mg.Link("one"),
        mg.Link("slide", 0.2, (d, 0, 0)),
        mg.Link("two", 0.5, (d, 0, 0), np.eye(3) * 1e-4),
    ]
    more = {"drives": ["A", "P"], "loads": [mg.Effort("B", 2.0)]}
    mesh = mg.Mechanism("mesh", links, pairs, gears=gears, couplings=[mg.Mesh("m", "a", "b")], **more)
    one, two = involutes(d, w)
    flanks = mg.Mechanism(
        "flanks",
        links,
        [*pairs, mg.Pair("K", "Kc", "one", "two", curve=one, curve_b=two, point=at, closed="form")],
        **more,
    )
    t = np.linspace(0, 0.1, 9)
    given = {"A": mg.Motion(0.1 * np.sin(t / 0.1), t=t), "P": mg.Motion(0.0008 * (t / 0.1) ** 2, t=t)}
    s, k = mg.solve(mesh, given), mg.solve(flanks, given)
    for name in ("position", "velocity", "acceleration"):
        np.testing.assert_allclose(getattr(s["B"], name), getattr(k["B"], name), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(s["P"].effort, k["P"].effort, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(s["A"].force[:, :2], k["A"].force[:, :2], rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(np.abs(s.coupling("m").effort), np.abs(k.contact("K").normal_force), rtol=1e-7)


def test_energy_of_a_planet_on_a_swinging_arm_and_a_sun_on_springs():
    """Kinetic energy, springs and weight from poses and twists alone; both centers move, so that the flank is one row."""
    k, I = 1e5, 1e-3
    pairs = [
        mg.Pair("S", "E", "frame", "sun", point=(0, 0, 0), axis=Z),
        mg.Pair("A", "R", "frame", "arm", point=(0.002, 0, 0), axis=Z),
        mg.Pair("P", "R", "arm", "planet", point=(0.0415, 0, 0), axis=Z),
    ]
    bodies = {"sun": (0.5, (0, 0, 0)), "arm": (0.2, (0.02, 0, 0)), "planet": (0.3, (0.0415, 0, 0))}
    links = [mg.Link("frame"), *(mg.Link(n, mass, c, np.eye(3) * I) for n, (mass, c) in bodies.items())]
    m = mg.Mechanism(
        "floating sun", links, pairs,
        gears=[mg.Gear("s", "sun", 20, (0, 0, 0), Z, module=0.002), mg.Gear("p", "planet", 20, (0.0415, 0, 0), Z, module=0.002)],
        couplings=[mg.Mesh("m", "s", "p")],
        loads=[mg.Gravity((0, -9.81, 0)), *(mg.Spring(freedom=f"S.{q}", stiffness=k) for q in ("Tx", "Ty"))],
    )  # fmt: skip
    with pytest.warns(mg.MechgraphWarning, match="would have to pull"):  # it swings against both flanks
        s = mg.respond(m, np.linspace(0, 0.02, 6), rates={"S.Rz": 8.0, "A.Rz": -1.0})
    E = k / 2 * (s["S"].position[:, :2] ** 2).sum(axis=1)
    for name, (mass, center) in bodies.items():
        p, w = s.link(name).point(center), s.link(name).angular_velocity
        E = E + mass / 2 * (p.velocity**2).sum(axis=1) + I / 2 * (w**2).sum(axis=1) + mass * 9.81 * p.position[:, 1]
    assert np.ptp(s["S"].position[:, 0]) > 1e-5  # the sun does float
    assert np.ptp(E) < 2e-6 * abs(E).max()
    F, v = s.coupling("m").force, s.coupling("m").sliding
    assert np.abs((F * v).sum(axis=1)).max() < 1e-12 * np.abs(F).max()


def test_a_flank_that_would_pull_is_a_warning():
    """One flank where centers move, the one asked for, or that presses first: forces of the wrong sense are told with their range."""
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
        mg.Pair("P", "P", "frame", "slide", point=(0.0605, 0, 0), axis=X),
        mg.Pair("B", "R", "slide", "two", point=(0.0605, 0, 0), axis=Z),
    ]
    gears = [g.replace(point=(x, 0, 0)) for g, x in zip(spur(), (0, 0.0605), strict=True)]
    given = {"A": np.zeros(3), "P": [0.0, 1e-4, 2e-4]}
    for flank, torque, pulls in (
        ("auto", 3.0, False),
        ("auto", -3.0, False),
        ("backward", -3.0, False),
        ("backward", 3.0, True),
    ):
        m = mg.Mechanism(
            "m",
            pairs=pairs,
            gears=gears,
            couplings=[mg.Mesh("m", "a", "b", flank=flank)],
            drives=["A", "P"],
            loads=[mg.Effort("B", torque)],
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            s = mg.solve(m, given)
        assert any("would have to pull" in str(one) for one in s.warnings) is pulls
        if flank == "auto":  # as the one that is named, positions included
            named = mg.solve(
                m.replace(couplings=[mg.Mesh("m", "a", "b", flank="forward" if torque > 0 else "backward")]), given
            )
            for what in ("position", "force"):
                np.testing.assert_allclose(getattr(s["B"], what), getattr(named["B"], what), rtol=1e-12, atol=1e-15)
    # a load that turns round keeps the first flank
    swings = [mg.ForceLaw("B", reads="P", law=lambda x, v, t: -3.0 + 4e4 * x)]
    with pytest.warns(mg.MechgraphWarning, match="pull from A.Rz = 0 deg, P.Tz = 7.5e-05"):
        mg.solve(m.replace(couplings=[mg.Mesh("m", "a", "b")], loads=swings), given)


# --- backlash in time ---------------------------------------------------------------------------------------------------------


INERTIA = np.array([1e-4, 9e-4])


def heavy_stage(backlash, planar=False, **more):
    """A helical pair a little further apart than its teeth ask for, 60 teeth of module 2; in the plane without helix."""
    helix = 0.0 if planar else 0.2
    d = 0.06 / np.cos(helix) + 1e-4
    at = {"p": (0, 0), "w": (d, 0)} if planar else {"p": (0, 0, 0), "w": (d, 0, 0)}
    inertia = [i if planar else np.diag([i] * 3) for i in INERTIA]
    return mg.Mechanism(
        "stage",
        [mg.Link("frame"), *(mg.Link(k, 1.0, at[k], i) for k, i in zip(at, inertia, strict=True))],
        [mg.Pair(k, "R", "frame", k, point=x, **({} if planar else {"axis": Z})) for k, x in at.items()],
        gears=[
            mg.Gear(k, k, n, at[k], None if planar else Z, module=0.002, helix_angle=b, width=0.02)
            for k, n, b in (("p", 20, helix), ("w", 40, -helix))
        ],
        couplings=[mg.Mesh("m", "p", "w", backlash=backlash, restitution=0.6, **more)],
        planar=planar,
    )


@pytest.mark.parametrize(("flank", "planar"), [("forward", False), ("backward", True)])
def test_flanks_part_and_strike_in_time(planar, flank):
    """Free flight over the gap, Newton's law of restitution, momentum: times, impulses, energy lost of the first four blows."""
    m, sign = heavy_stage(1e-4, planar, flank=flank), 1.0 if flank == "forward" else -1.0
    fact = mg.mesh_facts(m)["m"]
    assert fact.backlash > 1.7e-4  # with what the distance leaves
    lean = np.cos(np.arctan(m.gears[0].base_lean))
    c = -lean * np.array([gear.base_radius for gear in m.gears])
    r = mg.respond(m, np.linspace(0, 0.05, 41), rates={"p": -2.0 * sign, "w": 0.0})
    w, t, at, room = np.array([-2.0 * sign, 0.0]), 0.0, 0.0, fact.backlash_angles[0] * m.gears[0].base_radius * lean
    assert len(r.events) == 4
    for event in r.events:
        speed = c @ w
        end = sign * room if sign * speed > 0 else 0.0
        t, at = t + (end - at) / speed, end
        p = -1.6 * speed / (c @ (c / INERTIA))
        after = w + c / INERTIA * p
        lost = 0.5 * INERTIA @ (w**2 - after**2)
        np.testing.assert_allclose([event.t, event.impulse, event.energy_lost], [t, abs(p), lost], rtol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(event.impulses["p"][3:]), abs(p), rtol=1e-9)
        w = after
    assert np.abs(r.energy.balance).max() < 1e-12 * r.energy.kinetic.max()
    closed = mg.respond(
        m, [0.0, 0.01], rates={"p": -2.0 * sign}
    )  # no rate of the wheel: flanks that touch keep touching
    np.testing.assert_allclose(closed["w"].velocity[0], sign, rtol=1e-12)


@pytest.mark.daily(1)
@pytest.mark.parametrize("torque", [1.0, -1.0])
def test_flanks_that_press_are_a_mesh_without_backlash(torque):
    """Motion, bearings and teeth, once the flank of the load is reached; the other one is a gap away."""
    loads, t = [mg.Effort("p", torque), mg.Effort("w", -0.5 * torque)], np.linspace(0, 0.05, 11)
    flank = "forward" if torque > 0 else "backward"
    loose, tight = (mg.respond(heavy_stage(j, flank=flank), t, loads=loads) for j in (1e-4, 0.0))
    np.testing.assert_allclose(loose["w"].position, tight["w"].position, atol=1e-12)
    for what in ("force", "moment"):
        np.testing.assert_allclose(getattr(loose["p"], what), getattr(tight["p"], what), atol=1e-9)
    np.testing.assert_allclose(loose.coupling("m").normal_force, tight.coupling("m").normal_force, rtol=1e-9)
    other = mg.respond(heavy_stage(1e-4, flank="backward" if torque > 0 else "forward"), t, loads=loads)
    assert other.events[0].t > 0
    np.testing.assert_allclose(
        np.abs(other["m.play"].position[-1]),
        mg.mesh_facts(heavy_stage(1e-4))["m"].backlash_angles[0]
        * 0.02
        / np.cos(0.2)
        * np.cos(heavy_stage(0.0).gears[0].transverse_angle)
        * np.cos(np.arctan(heavy_stage(0.0).gears[0].base_lean)),
        rtol=1e-6,
    )
    np.testing.assert_allclose(other.coupling("m").normal_force[-1], tight.coupling("m").normal_force[-1], rtol=1e-9)


def gear_on_a_slide(flank):
    """A pinion and a wheel whose axis moves away and back on a spring; the pinion is let go so that its flanks part at first."""
    d = 0.0605
    gears = [g.replace(link=link, point=(x, 0, 0)) for g, link, x in zip(spur(), ("one", "two"), (0, d), strict=True)]
    bodies = [("one", 1.0, 0, 1e-4), ("slide", 0.5, d, 1e-4), ("two", 1.0, d, 9e-4)]
    return mg.Mechanism(
        "slide",
        [mg.Link("frame"), *(mg.Link(name, mass, (x, 0, 0), np.diag([i] * 3)) for name, mass, x, i in bodies)],
        [
            mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
            mg.Pair("P", "P", "frame", "slide", point=(d, 0, 0), axis=X),
            mg.Pair("B", "R", "slide", "two", point=(d, 0, 0), axis=Z),
        ],
        gears=gears,
        couplings=[mg.Mesh("m", "a", "b", backlash=2e-4, restitution=0.7, flank=flank)],
        loads=[mg.Effort("A", 0.3), mg.Effort("B", -0.2), mg.ForceLaw("P", law=lambda x, v, t: -2e5 * x - 5 * v)],
    )


@pytest.mark.parametrize(("flank", "sense"), [("auto", 1.0), ("backward", -1.0)])
def test_flanks_part_and_strike_where_a_center_moves(flank, sense):
    """Three bodies by a solver of their own between blows, the openings of both flanks by involutes at the distance of the moment."""
    m, D, FULL_BASE = gear_on_a_slide(flank), 0.0605, np.array([0.02, 0.04]) * np.cos(FULL)
    r = mg.respond(m, np.linspace(0, 0.0045, 3), rates={"A": -30.0 * sense, "B": 0.0, "P": 0.2})
    inertia, k = np.array([1e-4, 1.5, 9e-4]), FULL_BASE.sum()
    working = lambda x: np.arccos(k / (D + x))
    inv = lambda a: np.tan(a) - a
    gap = mg.mesh_facts(m)["m"].backlash * np.cos(working(0))

    def opening(of):
        """Of the flanks in front (1) or behind (-1): what teeth turn apart, and what the distance parts."""

        def room(t, y):
            parted = k * (inv(working(y[1])) - inv(working(0)))
            return parted - of * (FULL_BASE @ y[[0, 2]]) + gap * (of != sense)

        room.terminal, room.direction = True, -1
        return room

    rhs = lambda t, y: np.r_[y[3:], np.array([0.3, -2e5 * y[1] - 5 * y[4], -0.2]) / inertia]
    y, t, flanks = np.array([0, 0, 0, -30.0 * sense, 0.2, 0.0]), 0.0, []
    for event in r.events:
        how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 3e-4}
        free = scipy.integrate.solve_ivp(rhs, (t, 0.02), y, events=[opening(1), opening(-1)], **how)
        of = 1 if free.t_events[0].size else -1
        t, y = free.t[-1], free.y[:, -1].copy()
        J = np.array([-of * FULL_BASE[0], np.sin(working(y[1])), -of * FULL_BASE[1]])
        impulse = -1.7 * (J @ y[3:]) / (J @ (J / inertia))
        y[3:] += J / inertia * impulse
        np.testing.assert_allclose([event.t, event.impulse], [t, impulse], rtol=1e-7)
        assert str(event).startswith("m.play.Tz" if of > 0 else "m.backward.play.Tz")
        flanks.append(of)
    assert {1, -1 if flank == "auto" else 1} <= set(flanks)
    assert np.abs(r.energy.balance).max() < 1e-7 * r.energy.kinetic.max()


@pytest.mark.parametrize("torque", [1.0, -1.0])
def test_flanks_that_press_on_a_moving_center_are_a_mesh_without_backlash(torque):
    """The flank of the load from the start: motion, forces of teeth and pairs; what is told of both flanks is one mesh."""
    m, t = gear_on_a_slide("forward" if torque > 0 else "backward"), np.linspace(0, 0.01, 4)
    loads = [mg.Effort("A", torque), mg.Effort("B", -torque)]
    loose, tight = (
        mg.respond(m.replace(couplings=[m.couplings[0].replace(backlash=j)]), t, loads=loads) for j in (2e-4, 0)
    )
    assert [event.t for event in loose.events if event.impulse > 0] == []
    np.testing.assert_allclose(loose["P"].position, tight["P"].position, rtol=1e-7, atol=1e-12)
    one, other = loose.coupling("m"), tight.coupling("m")
    for what in ("force", "point", "normal_force", "effort"):
        np.testing.assert_allclose(getattr(one, what), getattr(other, what), rtol=1e-6, atol=1e-9)
    assert list(mg.over_time(loose).couplings) == list(mg.over_time(tight).couplings)
    np.testing.assert_allclose(loose["A"].force, tight["A"].force, rtol=1e-6, atol=1e-9)


# --- planets -----------------------------------------------------------------------------------------------------------------


def planetary(angles, sun="E", teeth=(24, 30, 84), m=0.002):
    zs, zp, zr = teeth
    a = m * (zs + zp) / 2
    pairs = [
        mg.Pair("C", "R", "frame", "carrier", point=(0, 0, 0), axis=Z),
        mg.Pair("S", sun, "frame", "sun", point=(0, 0, 0), axis=Z),
    ]
    gears = [
        mg.Gear("s", "sun", zs, (0, 0, 0), Z, module=m),
        mg.Gear("r", "frame", zr, (0, 0, 0), Z, module=m, internal=True),
    ]
    couplings = []
    for i, t in enumerate(angles):
        at = (a * np.cos(t), a * np.sin(t), 0)
        pairs.append(mg.Pair(f"P{i}", "R", "carrier", f"planet{i}", point=at, axis=Z))
        gears.append(mg.Gear(f"p{i}", f"planet{i}", zp, at, Z, module=m))
        couplings += [mg.Mesh(f"s{i}", "s", f"p{i}"), mg.Mesh(f"r{i}", f"p{i}", "r")]
    return mg.Mechanism(
        "planetary", pairs=pairs, gears=gears, couplings=couplings, drives=["C"], loads=[mg.Effort("S.Rz", -7.0)]
    )


@pytest.mark.parametrize("degrees", [(0, 120, 240), (0, 100, 240)])
def test_a_floating_sun_shares_its_load_by_statics(degrees):
    """Three forces T / r_b in balance: shares go with the sines of the opposite angles; Willis turns the sun."""
    angles = RAD(degrees)
    m = planetary(angles)
    r = mg.check(m)
    assert (r.mobility, r.redundancy) == (1, 0)
    s = mg.solve(m, {"C": np.linspace(0, 1, 3)})
    np.testing.assert_allclose(s["S"].position[:, 2], s["C"].position[:, 0] * (1 + 84 / 24), rtol=1e-12)
    opposite = np.array([np.sin(angles[(i + 2) % 3] - angles[(i + 1) % 3]) for i in range(3)])
    shares = np.array([s.coupling(f"s{i}").effort for i in range(3)]) * 0.024 * np.cos(FULL) / 7.0
    np.testing.assert_allclose(np.abs(shares), np.repeat(opposite[:, None] / opposite.sum(), 3, axis=1), rtol=1e-9)
    if degrees[1] == 100:
        np.testing.assert_allclose(opposite / opposite.sum(), [0.2578, 0.3473, 0.3949], atol=5e-5)
    np.testing.assert_allclose(s["C"].effort[:, 0], 7.0 * (1 + 84 / 24), rtol=1e-10)


def test_a_sun_in_a_bearing_is_redundant_twice():
    m = planetary(RAD([0, 120, 240]), "R")
    r = mg.check(m)
    assert (r.mobility, r.redundancy) == (1, 2)
    assert r.ratios["S.Rz"]["C.Rz"] == pytest.approx(1 + 84 / 24, rel=1e-12)


@pytest.mark.parametrize("plane", [False, True])
def test_the_advice_is_to_let_the_sun_float(plane):
    """Its effect is that of the same set with the sun on a plane: shares T / (n r_b) of every planet."""
    held = mg.parts.planetary("P", 24, 30, 84, floating=False, module=0.002)
    m = mg.Mechanism("set", parts=[held], drives=["P.carrier.Rz", "P.ring.Rz"], loads=[mg.Effort("P.sun.Rz", 6.0)])
    m = m.to_planar() if plane else m
    advice = mg.check(m).advice[0]
    assert advice.brief == "P.sun let float, centered by its meshes: redundancy 2 -> 0"
    free = advice.apply()
    assert mg.check(free).redundancy == 0
    s = mg.solve(free, {"P.carrier.Rz": [0.0, 0.7], "P.ring.Rz": 0.0})
    forces = [np.linalg.norm(s.coupling(f"P.sun{i}").force, axis=-1) for i in (1, 2, 3)]
    np.testing.assert_allclose(forces, 6.0 / (3 * 0.024 * np.cos(FULL)), rtol=1e-9)


def test_places_of_planets():
    """(20 + 54) / 3 is not whole: places are multiples of 2 pi / 74; six of 30 teeth about 24 overlap, 54 sin 30 = 27 < 32."""
    np.testing.assert_allclose(np.rad2deg(mg.planet_places(20, 54, 3)), [0, 121.6216, 238.3784], atol=5e-5)
    with pytest.raises(mg.DeclarationError, match="27; expected more than 32"):
        mg.planet_places(24, 84, 6)
    with pytest.warns(mg.MechgraphWarning, match="cannot both be put in"):
        planetary(RAD([0, 120, 240]), teeth=(20, 17, 54))
    planetary(mg.planet_places(20, 54, 3), teeth=(20, 17, 54))


# --- thrust, screws, bevels, worms, racks --------------------------------------------------------------------------------------


def test_a_middle_shaft_without_thrust():
    """Both gears of one hand: thrust 2 T tan b / d of each; none is left where tan b2 / tan b1 = d2 / d1."""
    b1 = RAD(20.0)
    # wheel 100, pinion 40 across at their pitch circles
    b2 = np.arctan(np.tan(b1) * 40 / 100)
    assert np.rad2deg(b2) == pytest.approx(8.2834, abs=5e-5)
    mb, mc = 0.002 * np.cos(b1), 0.002 * np.cos(b2)
    wheel, pinion = 50, 20
    gears = [
        mg.Gear("a", "one", 25, (0, 0, 0), Z, module=mb, helix_angle=-b1),
        mg.Gear("b", "two", wheel, (0.075, 0, 0), Z, module=mb, helix_angle=b1),
        mg.Gear("c", "two", pinion, (0.075, 0, 0.03), Z, module=mc, helix_angle=b2),
        mg.Gear("d", "three", 40, (0.135, 0, 0.03), Z, module=mc, helix_angle=-b2),
    ]
    pairs = [
        p
        for n, g in zip("ABD", (gears[0], gears[1], gears[3]), strict=True)
        for p in on_bearings(n, g.link, g.point, Z, "S")[0]
    ]
    m = mg.Mechanism(
        "shaft",
        pairs=pairs,
        gears=gears,
        couplings=[mg.Mesh("m1", "a", "b"), mg.Mesh("m2", "c", "d")],
        drives=["A.Rz"],
        loads=[mg.Effort("D.Rz", 5.0)],
    )
    s = mg.solve(m, {"A.Rz": [0.0, 0.5]})
    assert np.abs(s["BS"].force[:, 2]).max() < 1e-9
    assert s["DS"].force[0, 2] == pytest.approx(-s.coupling("m2").force[0, 2], rel=1e-9)
    assert abs(s["DS"].force[0, 2]) == pytest.approx(2 * 5.0 * np.tan(b2) / 0.08, rel=1e-9)


KINDS = {
    "screw": (
        [
            mg.Gear("a", "one", 20, (0, 0, 0), Z, module=0.002, helix_angle=RAD(45)),
            mg.Gear("b", "two", 20, (0, 0.04 / np.cos(RAD(45)), 0), X, module=0.002, helix_angle=RAD(45)),
        ],
        None,
    ),
    "bevel": (
        [
            mg.BevelGear("a", "one", 20, (0.1, 0, 0), X, module=0.002, spiral_angle=0.3),
            mg.BevelGear("b", "two", 40, (0, 0.1, 0), Y, module=0.002, spiral_angle=-0.3),
        ],
        mg.BevelGears("m", "A", "B", teeth=(20, 40), module=0.002, spiral_angle=0.3),
    ),
    "worm": (
        [mg.Worm("a", "one", 2, (0, 0, 0), X, radius=0.01), mg.WormWheel("b", "two", 40, (0, 0.05, 0), Z)],
        mg.WormGear("m", "A", "B", teeth=(2, 40), radius=0.01),
    ),
}


@pytest.mark.parametrize("torque", [2.0, -2.0])
@pytest.mark.parametrize("kind", KINDS)
def test_gears_on_other_axes(kind, torque):
    """On pairs R, and on balls: the same forces; those of the short forms where there are any."""
    gears, short = KINDS[kind]
    plain, a, _ = stage(gears, torque=torque)
    real, q, _ = stage(gears, "S", torque)
    turn = mg.Motion(np.linspace(0, 0.3, 4), 100.0)
    known, s = (mg.solve(m, {q: turn}, engine="dense") for m in (plain, real))
    np.testing.assert_allclose(s.coupling("m").force, known.coupling("m").force, rtol=1e-9)
    np.testing.assert_allclose(s["B"].position[:, -1], known["B"].position[:, 0], atol=1e-12)
    if short is not None:
        old = mg.solve(plain.replace(gears=[], couplings=[short]), {a: turn}, engine="dense")
        np.testing.assert_allclose(known.coupling("m").force, old.coupling("m").force, rtol=1e-12)
        np.testing.assert_allclose(known["B"].position, old["B"].position, atol=1e-14)
    if kind == "screw":
        # w1 m z1 / 2 (tan b1 + tan b2), along the teeth
        np.testing.assert_allclose(np.linalg.norm(s.coupling("m").sliding, axis=1), 100 * 0.02 * 2, rtol=1e-10)
        assert gears[1].point[1] == pytest.approx(0.0565685, abs=1e-6)


@pytest.mark.parametrize("backlash", [2e-4, 0.0])
def test_gears_that_move_apart_until_no_tooth_reaches_the_other(backlash):
    """Tip circles of 22 and 42 mm, axes 60.5 mm apart: they are past each other from 3.5 mm more on, in time and at given positions."""
    m = gear_on_a_slide("forward")
    m = m.replace(couplings=[m.couplings[0].replace(backlash=backlash)])
    if not backlash:
        given = m.replace(drives=["P", "A"])
        mg.solve(given, {"P": [0.0, 0.0034], "A": [0.0, 0.0]}, loads=[])
        with pytest.raises(
            mg.DeclarationError, match=r"'two' moves against .* by up to 0.0036; .* where teeth reach each other"
        ):
            mg.solve(given, {"P": [0.0, 0.0036], "A": [0.0, 0.0]}, loads=[])
        return
    apart = [mg.Effort("P", 50.0)]
    assert mg.respond(m, [0.0, 0.01], loads=apart).t[-1] == 0.01
    with pytest.raises(mg.DeclarationError, match="where teeth reach each other"):
        mg.respond(m, [0.0, 0.016], loads=apart)


def test_shafts_that_leave_their_places():
    gears = KINDS["bevel"][0]
    pairs = [
        mg.Pair("A", "C", "frame", "one", point=(0.1, 0, 0), axis=X),
        mg.Pair("B", "R", "frame", "two", point=(0, 0.1, 0), axis=Y),
    ]
    m = mg.Mechanism("m", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", "a", "b")], drives=["A.Rz", "A.Tz"])
    with pytest.raises(
        mg.DeclarationError, match=r"axis on 'one' moves against .* by up to 0.01; it needs axes that keep their places"
    ):
        mg.solve(m, {"A.Rz": [0.0, 0.5], "A.Tz": [0.0, 0.01]})
    free = m.replace(
        drives=[],
        links=[mg.Link("frame"), *(mg.Link(k, 1.0, (0, 0, 0), mg.inertia.sphere(1.0, 0.1)) for k in ("one", "two"))],
    )
    held = free.replace(pairs=[mg.Pair("A", "R", "frame", "one", point=(0.1, 0, 0), axis=X), pairs[1]])
    assert mg.respond(held, [0.0, 0.01], rates={"A.Rz": 3.0}).t[-1] == 0.01
    with pytest.raises(mg.DeclarationError, match="it needs axes that keep their places"):
        mg.respond(free, [0.0, 0.01], rates={"A.Rz": 3.0, "A.Tz": 0.1})


def tilting(what):
    """A pinion, and a wheel or rack beside it on a cradle that tilts; two pulleys, one on a cradle that slides along its axis."""
    x, wheel = (0.06, 0, 0), what in ("wheel", "pulley")
    tilts = "P" if what == "pulley" else "R"
    held = (
        mg.Pair("B", "R", "cradle", "w", point=x, axis=Z)
        if wheel
        else mg.Pair("B", "P", "cradle", "w", point=(0, -0.02, 0), axis=X)
    )
    pairs = [
        mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=Z),
        mg.Pair("S", tilts, "frame", "cradle", point=x, axis=Z if tilts == "P" else X),
        held,
    ]
    if what == "pulley":
        pulley = {"teeth": 20, "pitch": 0.003}
        gears = [mg.Pulley("a", "p", (0, 0, 0), Z, **pulley), mg.Pulley("b", "w", x, Z, **pulley)]
        return mg.Mechanism(
            "m", pairs=pairs, gears=gears, couplings=[mg.BeltDrive("m", over=["a", "b"])], drives=["A", "S"]
        )
    mates = {
        "wheel": mg.Gear("b", "w", 40, x, Z, module=0.002),
        "rack": mg.GearRack("b", "w", (0, -0.02, 0), X, Y, module=0.002),
    }
    gears = [mg.Gear("a", "p", 20, (0, 0, 0), Z, module=0.002), mates[what]]
    return mg.Mechanism("m", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", "a", "b")], drives=["A", "S"])


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("wheel", "by up to 5.73 degrees; it needs axes that stay parallel"),
        ("rack", "by up to 5.73 degrees; it needs a rack that slides at right angles to the axis of its pinion"),
        ("pulley", "by up to 0.1; it needs pulleys that stay in its plane"),
    ],
)
def test_axes_that_do_not_stay_parallel_are_named(what, words):
    with pytest.raises(mg.DeclarationError, match=f"the axis on 'w' moves against the other one, {words}"):
        mg.kinematics(tilting(what), {"A": [0.0, 0.5], "S": [0.0, 0.1]})


def rack(order=("a", "b"), force=5.0, helix=0.2, wheel=None):
    """A pinion and a rack below it, or a wheel so large that it is one; the pinion driven."""
    r = 0.02 / np.cos(helix)
    pinion = mg.Gear("a", "one", 20, (0, 0, 0), Z, module=0.002, helix_angle=helix)
    pairs = [mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z)]
    if wheel is None:
        gears = [pinion, mg.GearRack("b", "two", (0, -r, 0), X, Y, module=0.002, helix_angle=-helix)]
        pairs.append(mg.Pair("B", "P", "frame", "two", point=(0, -r, 0), axis=X))
        loads = [mg.Effort("B", force)]
    else:
        R = 0.002 * wheel / (2 * np.cos(helix))
        gears = [pinion, mg.Gear("b", "two", wheel, (0, -r - R, 0), Z, module=0.002, helix_angle=-helix)]
        pairs.append(mg.Pair("B", "R", "frame", "two", point=(0, -r - R, 0), axis=Z))
        loads = [mg.Effort("B", -force * R)]
    return mg.Mechanism("rack", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", *order)], drives=["A"], loads=loads)


@pytest.mark.parametrize("force", [5.0, -5.0])
def test_a_rack_is_a_wheel_without_end(force):
    s, wheel = (mg.solve(m, {"A": [0.0, 0.7]}) for m in (rack(force=force), rack(force=force, wheel=10**9)))
    np.testing.assert_allclose(s.coupling("m").force, wheel.coupling("m").force, rtol=1e-6)
    other = mg.solve(rack(("b", "a"), force), {"A": [0.0, 0.7]})
    np.testing.assert_allclose(other.coupling("m").force, -s.coupling("m").force, rtol=1e-12)
    np.testing.assert_allclose(s["B"].position[:, 0], [0.0, 0.7 * 0.02 / np.cos(0.2)], rtol=1e-12)


def test_spur_gears_are_helical_ones_of_no_helix():
    forces = [
        mg.solve(stage(spur(distance=0.06 / np.cos(b), helix=b), "S")[0], {"A.Rz": 0.4}).coupling("m").force
        for b in (0.0, 1e-7)
    ]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-4)
    assert np.abs(forces[1] - forces[0])[2] > 1e-7


# --- declaration -----------------------------------------------------------------------------------------------------------------


def test_gears_go_through_files_units_and_motions(tmp_path):
    m = rack().replace(units={"length": "m", "mass": "kg", "time": "s"})
    mg.save(m, tmp_path / "rack.toml")
    assert mg.load(tmp_path / "rack.toml") == m
    small = m.to_units(length="mm")
    assert small.gear("b").module == pytest.approx(2.0)
    np.testing.assert_allclose(mg.solve(small, {"A": 0.3})["B"].position, 1e3 * mg.solve(m, {"A": 0.3})["B"].position)
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], (1, 2, 3)
    F = mg.solve(m.moved(turned), {"A": 0.3}).coupling("m").force
    np.testing.assert_allclose(F, turned[:3, :3] @ mg.solve(m, {"A": 0.3}).coupling("m").force, atol=1e-12)


def test_numbers_of_gears_vary_and_bearings_under_them_are_refused():
    """A larger pressure angle makes the radial force T tan(a) / r; a bearing does not leave its gear behind."""
    z, at = (0, 0, 1), {"p": (0, 0, 0), "w": (0.06, 0, 0)}

    def stage(a=FULL, wider=0.0):
        places = {"p": (0, 0, 0), "w": (0.06 + wider, 0, 0)}
        return mg.Mechanism(
            "stage", pairs=[mg.Pair(k, "R", "frame", k, point=places[k], axis=z) for k in at], drives=["p"],
            gears=[mg.Gear(f"g{k}", k, n, places[k], z, module=0.002, pressure_angle=a) for k, n in (("p", 20), ("w", 40))],
            couplings=[mg.Mesh("m", "gp", "gw")], loads=[mg.Effort("w", -3.0)],
        )  # fmt: skip

    force = {"F": lambda s: s.coupling("m").force}
    found = mg.study(stage(), {"gp.shift": [0.0, -0.1], "m.backlash": [0.0, 1e-4]}, force, 3, motions={"p": 0.0})
    np.testing.assert_allclose(found.outputs["F"][:, 0], np.tile([75 * np.tan(FULL), -75, 0], (3, 1)), rtol=1e-9)
    with pytest.raises(mg.DeclarationError, match=r"of .m. sit on that axis, .* a function"):
        mg.study(stage(), {"w.point.x": [0.06, 0.0612]}, force, 2, motions={"p": 0.0})
    with pytest.raises(mg.DeclarationError, match=r"no number of that name in gear 'gp' \(point.x, "):
        mg.study(stage(), {"gears[0].radius": [0.1, 0.2]}, force, 2, motions={"p": 0.0})
    wider = mg.study(stage, {"wider": [0.0, 0.0012]}, force, 3, motions={"p": 0.0})
    for i, more in enumerate(wider.parameters["wider"]):
        w = np.arccos(0.06 * np.cos(FULL) / (0.06 + more))
        T = 3.0 / (0.04 * np.cos(FULL))
        np.testing.assert_allclose(wider.outputs["F"][i, 0], [T * np.sin(w), -T * np.cos(w), 0], rtol=1e-9, atol=1e-9)


def test_the_kernel_serves_gears_on_pairs_r_and_refuses_rows_along_lines_by_name():
    a, b = stage(spur())[0], stage(spur(), "S")[0]
    assert a.couplings[0].linear
    assert not b.couplings[0].linear
    with pytest.raises(mg.DeclarationError, match="the row of the coupling 'm' is evaluated from poses"):
        mg.compile(b.replace(loads=[]))
    with pytest.raises(mg.DeclarationError, match="'m' is no polynomial"):
        mg.assemblies(b, {"A.Rz": 0.0})
    s = mg.solve(a, {"A": np.linspace(0, 1, 30)}, engine="dense")
    np.testing.assert_allclose(
        mg.kinematics(a, {"A": np.linspace(0, 1, 30)})["B"].position, s["B"].position, atol=1e-13
    )


def test_a_thousand_gears_are_declared_in_linear_time():
    def seconds(n):
        at = [(0.04 * i, 0, 0) for i in range(n)]
        given = {
            "pairs": [mg.Pair(f"P{i}", "R", "frame", f"w{i}", point=p, axis=Z) for i, p in enumerate(at)],
            "gears": [mg.Gear(f"g{i}", f"w{i}", 20, p, Z, module=0.002) for i, p in enumerate(at)],
            "couplings": [mg.Mesh(f"m{i}", f"g{i}", f"g{i + 1}") for i in range(n - 1)],
        }
        begin = time.process_time()
        mg.Mechanism("train", **given, drives=["P0"])
        return time.process_time() - begin

    seconds(10)
    few, many = min(seconds(250) for _ in range(2)), min(seconds(500) for _ in range(2))
    assert many < 3.0 * few + 0.05


@pytest.mark.parametrize(("z", "loaded"), [(0.06, "G"), (-0.04, "S"), (0.0, "GS")])
def test_two_drives_load_a_mesh_by_an_unknown_force_and_only_the_bearings_that_bear_it_are_not_unique(z, loaded):
    """By the lever: a force over one bearing loads this one alone; beside both it loads both."""
    gears = [
        mg.Gear(n, link, teeth, (x, 0, z), Z, module=0.002)
        for n, link, teeth, x in (("a", "one", 20, 0), ("b", "two", 40, 0.06))
    ]
    (pa, qa), (pb, qb) = on_bearings("A", "one", (0, 0, 0), Z, "SG"), on_bearings("B", "two", (0.06, 0, 0), Z, "SG")
    m = mg.Mechanism("twin", pairs=[*pa, *pb], gears=gears, couplings=[mg.Mesh("m", "a", "b")], drives=[qa, qb])
    unique = mg.check(m).unique
    for shaft in "AB":
        for bearing in "SG":
            across = {unique[shaft + bearing][name] for name in ("Fx", "Fy")}
            assert across == {bearing not in loaded}
        assert unique[f"{shaft}S"]["Fz"]
    assert not unique["m"]["effort"]
