"""Markers that travel along curves: limits that are other pairs, identities of mechanics, and what is said of curves that will not do."""

import math
import pickle

import numpy as np
import pytest
import strategies
from identities.test_complex_step import closed, holds
from identities.test_engines import assert_engines_agree
from numpy.testing import assert_allclose

import mechgraph as mg

Travel = strategies.Travel
T = np.linspace(0.0, 1.0, 7)
ANGLE = np.linspace(0, 2 * np.pi, 37)


TWICE = {"lift": 0.2 * (1 - np.cos(2 * ANGLE)), "slope": 0.4 * np.sin(2 * ANGLE), "bend": 0.8 * np.cos(2 * ANGLE)}


def cam(**more):
    lift = {"lift": 0.2 * (1 - np.cos(ANGLE)), "slope": 0.2 * np.sin(ANGLE), "bend": 0.2 * np.cos(ANGLE)}
    return mg.Curve.cam(**{"angle": ANGLE, "base_radius": 1.0, **lift, **more})


def spiral(u):
    """``(r cos u, r sin u, h u)`` of a growing radius, with three derivatives."""
    c, s, r = np.cos(u), np.sin(u), 1 + 0.1 * u
    rings = [
        (r * c, r * s),
        (0.1 * c - r * s, 0.1 * s + r * c),
        (-0.2 * s - r * c, 0.2 * c - r * s),
        (r * s - 0.3 * c, -r * c - 0.3 * s),
    ]
    return [np.stack([x, y, h + 0 * u]) for (x, y), h in zip(rings, (0.3 * u, 0.3, 0, 0), strict=True)]


KNOT = np.stack(
    [(2 + np.cos(1.5 * ANGLE)) * np.cos(ANGLE), (2 + np.cos(1.5 * ANGLE)) * np.sin(ANGLE), np.sin(1.5 * ANGLE)], axis=1
)
TREFOIL = np.stack(
    [(2 + np.cos(3 * ANGLE)) * np.cos(2 * ANGLE), (2 + np.cos(3 * ANGLE)) * np.sin(2 * ANGLE), np.sin(3 * ANGLE)],
    axis=1,
)
LOBES = {"lift": 0.4 * (1 - np.cos(3 * ANGLE)), "slope": 1.2 * np.sin(3 * ANGLE), "bend": 3.6 * np.cos(3 * ANGLE)}
SAMPLE = {
    "line": mg.Curve.line(point=(1, 2, 3), direction=(1, 1, 0)),
    "circle": mg.Curve.circle(radius=2.0, axis=(1, 2, 3)),
    "arc": mg.Curve.circle(radius=2.0, axis=(1, 2, 3), angles=(0.1, 1.0)),
    "ellipse": mg.Curve.ellipse(a=2.0, b=1.0),
    "helix": mg.Curve.helix(radius=1.0, pitch=0.3),
    "guided": mg.Curve.helix(radius=1.0, pitch=0.3, frame="guided"),
    "involute": mg.Curve.involute(radius=1.0, angles=(0.2, 1.5), mirrored=True),
    "points": mg.Curve.through(points=KNOT[:20]),
    "closed": mg.Curve.through(points=TREFOIL, closed=True),
    "function": mg.Curve.function(position=spiral, ends_at=(0.0, 5.0)),
    "roller": cam(roller_radius=0.2, offset=0.1),
    "flat": cam(follower="flat"),
    "arm": mg.Curve.arm_cam(
        angle=ANGLE,
        swing=0.2 * (1 - np.cos(ANGLE)),
        slope=0.2 * np.sin(ANGLE),
        bend=0.2 * np.cos(ANGLE),
        base_radius=1.0,
        arm=1.5,
        pivot=2.0,
    ),
}


def rotation_of(here):
    return np.stack([here.t, here.y, here.k], axis=1)


@pytest.mark.parametrize("name", SAMPLE)
def test_a_curve_by_its_arc_length(name):
    """Tangent, curvature and turning of the frame are the derivatives of position and frame: complex step, and differences."""
    travel = Travel(SAMPLE[name])
    begin, end = max(travel.begin, -5.0), min(travel.end, 5.0)
    s = begin + (end - begin) * np.array([0.05, 0.3, 0.52, 0.81, 0.93])
    here, there = travel.at(s), travel.at(s + 1e-30j)
    assert_allclose((here.t * here.t).sum(axis=0), 1, atol=1e-14)
    assert_allclose(there.x.imag / 1e-30, here.t, atol=1e-13)
    assert_allclose(there.t.imag / 1e-30, here.dt, atol=1e-13)
    assert_allclose(there.w.imag / 1e-30, here.dw, atol=1e-12)
    h = 1e-3
    x = [travel.at(s + k * h) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * h)
    assert_allclose(sum(w * p.x for w, p in zip(weights, x, strict=True)), here.t, atol=1e-9)
    R, dR = rotation_of(here), sum(w * rotation_of(p) for w, p in zip(weights, x, strict=True))
    W = np.einsum("ijt,kjt->ikt", dR, R)
    assert_allclose(np.stack([W[2, 1], W[0, 2], W[1, 0]]), here.w, atol=1e-8)
    if travel.minimizing:
        assert_allclose((here.w * here.t).sum(axis=0), 0, atol=1e-14)
    nearest, distance = travel.nearest(here.x[:, 2] + 0.01 * here.k[:, 2])
    assert nearest == pytest.approx(s[2], abs=1e-10)
    assert distance == pytest.approx(0.01)


def test_the_length_of_an_ellipse():
    """``4 a E(1 - b^2 / a^2)`` = 9.688448220547675 for half axes 2 and 1."""
    assert SAMPLE["ellipse"].length == pytest.approx(9.688448220547675, rel=1e-14)


# --- limits ----------------------------------------------------------------------------------------------------------


def ring(special, seed=3, n=6):
    """A ring of ``n`` pairs R and a ``special`` one, loaded; the last link carries it to the frame."""
    rng = np.random.default_rng(seed)
    links = [mg.Link("frame"), *(strategies.body(rng, f"b{k}", rng.uniform(-1, 1, 3)) for k in range(n))]
    names = [link.name for link in links]
    pairs = [
        mg.Pair(f"J{k}", "R", names[k], names[k + 1], point=rng.uniform(-1, 1, 3), axis=rng.normal(size=3))
        for k in range(n)
    ]
    loads = [mg.Gravity((1, 2, -9.81)), mg.Wrench(names[-1], force=(1, 2, 3), moment=(0.1, 0.2, 0.3), point=(1, 0, 0))]
    return mg.Mechanism("ring", links, [*pairs, special(names[-1])], ["J0"], loads)


def assert_same_motion(one, other, scale, atol=1e-10):
    """Two forms of a mechanism: motion of all links, reactions, the drive; ``scale`` is the ratio of the coordinates of X."""
    move = mg.Motion(0.05 * T, 1.3, 0.7)
    for how in ({"method": "loop_wrench"}, {"method": "newton_euler"}, {"engine": "sparse"}):
        a, b = mg.solve(one, {"J0": move}, **how), mg.solve(other, {"J0": move}, **how)
        assert a.checks.power.max() < 1e-12
        for link in one.link_names():
            for name in ("pose", "twist", "acceleration"):
                x, y = getattr(a.link(link), name), getattr(b.link(link), name)
                assert_allclose(x, y, atol=atol * max(1.0, np.abs(y).max()))
        for pair in (p.name for p in one.pairs):
            y = b[pair].reaction
            assert_allclose(a[pair].reaction, y, atol=atol * np.abs(y).max())
        assert_allclose(a["J0"].effort, b["J0"].effort, atol=atol * np.abs(b["J0"].effort).max())
        assert_allclose(a["X"].position[..., 0], scale * b["X"].position[..., 0], atol=1e-10)


CENTER, AXIS = np.array([0.2, -0.3, 0.4]), np.array([0.3, 0.5, 0.8]) / np.sqrt(0.98)


def test_a_carriage_on_a_circle_is_a_revolute():
    circle = mg.Curve.circle(radius=0.8, center=CENTER, axis=AXIS)
    at = Travel(circle).at(np.array(1.7)).x
    assert_same_motion(
        ring(lambda b: mg.Pair("X", "P", "frame", b, point=at, curve=circle)),
        ring(lambda b: mg.Pair("X", "R", "frame", b, point=CENTER, axis=AXIS)),
        0.8,
    )


def test_a_carriage_guided_along_a_helix_is_a_screw():
    helix = mg.Curve.helix(radius=0.8, pitch=0.3, center=CENTER, axis=AXIS, frame="guided")
    at = Travel(helix).at(np.array(0.9)).x
    assert_same_motion(
        ring(lambda b: mg.Pair("X", "P", "frame", b, point=at, curve=helix)),
        ring(lambda b: mg.Pair("X", "H", "frame", b, point=CENTER, axis=AXIS, pitch=0.3)),
        np.hypot(0.8, 0.3),
    )


@pytest.mark.parametrize(("symbol", "n"), [("P", 6), ("C", 5), ("Sg", 3)])
def test_a_straight_curve_is_a_straight_groove(symbol, n):
    line = mg.Curve.line(point=CENTER, direction=AXIS)
    one = ring(lambda b: mg.Pair("X", symbol, "frame", b, point=CENTER + 0.3 * AXIS, curve=line), n=n)
    bare = ring(lambda b: mg.Pair("X", symbol, "frame", b, point=CENTER + 0.3 * AXIS, axis=AXIS), n=n)
    first = one.pairs[-1].type.freedoms[0].name
    place = [f.name for f in bare.pairs[-1].type.freedoms].index("Tz")
    a, b = (mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)}) for m in (one, bare))
    assert first == "Ts"
    assert_allclose(a["X"].position[:, 0], b["X"].position[:, place], atol=1e-12)
    assert_allclose(a["X"].reaction, b["X"].reaction, atol=1e-11 * np.abs(b["X"].reaction).max())
    for name, values in b["X"].components.items():
        if name[0] == "F":  # those of P and C are moments about where they stand at coordinates zero
            assert_allclose(a["X"].components[name], values, atol=1e-11 * np.abs(b["X"].reaction).max())


def test_a_sphere_in_a_circular_groove_is_a_rod_with_a_hinge():
    """The center of a ball in a circular groove is that of an S at the end of a link that turns about the axis of the circle."""
    circle = mg.Curve.circle(radius=0.8, center=CENTER, axis=AXIS)
    at = Travel(circle).at(np.array(1.7)).x
    one = ring(lambda b: mg.Pair("X", "Sg", "frame", b, point=at, curve=circle), n=3)
    rod = [mg.Pair("Y", "R", "frame", "rod", point=CENTER, axis=AXIS), mg.Pair("X", "S", "rod", "b2", point=at)]
    other = one.replace(links=[*one.links, mg.Link("rod")], pairs=[*one.pairs[:-1], *rod])
    a, b = (mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)}) for m in (one, other))
    assert_allclose(a.link("b2").pose, b.link("b2").pose, atol=1e-12)
    assert_allclose(a.link("b2").acceleration, b.link("b2").acceleration, atol=1e-10)
    assert_allclose(a["X"].reaction, b["X"].reaction, atol=1e-10 * np.abs(b["X"].reaction).max())
    assert_allclose(a["X"].position[:, 0], 0.8 * b["Y"].position[:, 0], atol=1e-12)


# --- identities ------------------------------------------------------------------------------------------------------


def bent(seed):
    """A random mechanism with curves."""
    return strategies.with_curves(strategies.closed_mechanism(seed), seed)


@pytest.mark.seeds(4)
def test_random_mechanisms_with_curves(seed):
    """The Jacobian, its rate, and what they are made of, by complex step; reactions do no work, efforts are dual to the freedoms."""
    system, x = closed(bent(seed), seed, 0.02)
    holds(system, x, seed)


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", [4, 8, 12])
def test_random_mechanisms_with_curves_at_work(seed):
    """Both engines and both methods agree, power balances, and a position does not depend on which others are asked for."""
    m = strategies.with_drives(bent(seed), seed)
    if m is None:
        pytest.skip("no drives make it determinate")
    m = strategies.with_loads(m, seed)
    given = strategies.motions(m, seed, T, size=0.03)
    assert_engines_agree(m, given)
    a, b = (
        mg.solve(m, given, method=how, on_reach="flag", redundant="minimum_norm")
        for how in ("loop_wrench", "newton_euler")
    )
    assert np.nanmax(a.checks.power) < 1e-12
    for pair in m.pairs:
        size = np.nanmax(np.abs(a[pair.name].total))
        assert_allclose(a[pair.name].total, b[pair.name].total, atol=1e-9 * size)
    few = {name: mg.Motion(v.position[::3], v.velocity[::3], v.acceleration[::3]) for name, v in given.items()}
    some = mg.solve(m, few)
    for link in m.link_names():
        assert_allclose(some.link(link).pose, a.link(link).pose[::3], atol=1e-9)


def test_what_follows_a_mechanism_with_curves(tmp_path):
    """Files, pickles, rigid motions, units, the printed equations, the report."""
    m = strategies.with_loads(bent(4).replace(drives=[]), 4, constant=True)
    assert any(p.curve is not None for p in m.pairs)
    mg.save(m, tmp_path / "m.toml")
    for same in (mg.load(tmp_path / "m.toml"), pickle.loads(pickle.dumps(m))):
        assert same == m
    report = mg.check(m)
    moved = m.moved(strategies.pose(np.random.default_rng(0), 3.0))
    scaled = m.replace(units={"length": "m", "mass": "kg", "time": "s"}).to_units(length="mm")
    for other in (moved, scaled):
        assert (mg.check(other).mobility, mg.check(other).redundancy) == (report.mobility, report.redundancy)


@pytest.mark.parametrize("name", sorted(set(SAMPLE) - {"function"}))
def test_every_curve_in_a_file(name, tmp_path):
    curve = SAMPLE[name]
    m = mg.Mechanism("m", None, [mg.Pair("X", "Sg", "frame", "body", curve=curve)])
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m


@pytest.mark.parametrize("symbol", ["P", "Sg", "C"])
def test_the_printed_equations_hold(symbol):
    """The assembled equations of a formulation are met by the reactions that were solved for."""
    circle = mg.Curve.circle(radius=0.8, center=CENTER, axis=AXIS)
    n = {"P": 6, "C": 5, "Sg": 3}[symbol]
    m = ring(lambda b: mg.Pair("X", symbol, "frame", b, point=Travel(circle).at(np.array(1.7)).x, curve=circle), n=n)
    m = m.replace(units={"length": "m", "mass": "kg", "time": "s"}).to_units(length="mm")
    s = mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)})
    f = mg.formulate(m, bookkeeping="minimal")
    A, b = f.assemble(s.state(3))
    x = np.linalg.solve(A.toarray(), b)
    for unknown, value in zip(f.unknowns, x, strict=True):
        if unknown.owner == "X":
            name = unknown.meaning.split()[0]
            assert value == pytest.approx(s["X"].components[name][3], rel=1e-8, abs=1e-8 * np.abs(x).max())


@pytest.mark.parametrize(
    ("symbol", "curve"),
    [("Ps", mg.Curve.circle(radius=0.8, center=CENTER, axis=AXIS)), ("C", SAMPLE["guided"])],
)
def test_a_driven_turn_on_a_curve_takes_a_force_with_its_couple(symbol, curve):
    """Where the frame turns with the travel, the effort dual to the turn in it is a couple and a force: all methods agree."""
    at = Travel(curve).at(np.array(1.7)).x
    m = ring(lambda b: mg.Pair("X", symbol, "frame", b, point=at, curve=curve), n=5).replace(drives=["X.Rz"])
    assert mg.check(m).determinate
    given = {"X.Rz": mg.Motion(0.05 * T, 1.3, 0.7)}
    a = mg.solve(m, given)
    assert np.abs(a["X"].effort[:, 1]).min() > 0.1
    for method in ("newton_euler", "printed"):
        b = mg.solve(m, given, method=method)
        assert b.checks.equilibrium.max() < 1e-12
        for pair in m.pairs:
            size = np.abs(a[pair.name].total).max()
            assert_allclose(b[pair.name].total, a[pair.name].total, atol=1e-10 * size)
    f = mg.formulate(m)
    found = dict(zip([u.freedom for u in f.unknowns], f.solve(a.state(3)), strict=True))
    assert found["X.Rz"] == pytest.approx(a["X"].effort[3, 1], rel=1e-9)


# --- held in orientation ---------------------------------------------------------------------------------------------


def held(**more):
    return mg.Curve.circle(**{"radius": 0.7, "center": CENTER, "axis": AXIS, "frame": "held", **more})


def test_a_circle_held_in_orientation_is_a_parallelogram():
    """Circular translation: motion, reactions of the rest and the drive are those of a coupler on two equal parallel cranks."""
    z, r, w = (0, 0, 1), 0.5, 3.0
    angle = np.linspace(-1.5, 1.2, 25)
    body = mg.Link("body", mass=2.0, center=(0.6, 0.2, 0.1), inertia=np.diag([0.1, 0.2, 0.3]))
    loads = [mg.Gravity((0, -9.81, 0)), mg.Wrench("body", force=(1, 2, 3), moment=(0.1, 0.2, 0.3), point=(0.5, 0.1, 0))]
    rail = mg.Pair("X", "P", "frame", "body", curve=mg.Curve.circle(radius=r, frame="held"), point=(r, 0, 0))
    one = mg.Mechanism("rail", [mg.Link("frame"), body], [rail], ["X"], loads)
    cranks = [mg.Pair(f"A{i}", "R", "frame", f"crank{i}", point=(0.2 * i, 0.9 * i, 0), axis=z) for i in range(2)]
    ends = [mg.Pair(f"B{i}", "R", f"crank{i}", "body", point=(0.2 * i + r, 0.9 * i, 0), axis=z) for i in range(2)]
    links = [mg.Link("frame"), mg.Link("crank0"), mg.Link("crank1"), body]
    two = mg.Mechanism("parallelogram", links, [*cranks, *ends], ["A0"], loads)
    a = mg.solve(one, {"X": mg.Motion(r * angle, r * w, r * 2.0)})
    b = mg.solve(two, {"A0": mg.Motion(angle, w, 2.0)}, redundant="minimum_norm")
    for what in ("pose", "twist", "acceleration"):
        assert_allclose(getattr(a.link("body"), what), getattr(b.link("body"), what), atol=1e-10)
    total = b["B0"].total + b["B1"].total
    assert_allclose(a["X"].total, total, atol=1e-10 * np.abs(total).max())
    assert_allclose(a["X"].effort[:, 0] * r, b["A0"].effort[:, 0], atol=1e-10 * np.abs(b["A0"].effort).max())
    assert a.checks.power.max() < 1e-12
    tangent = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    assert np.abs((a["X"].force * tangent).sum(axis=1)).max() < 1e-11 * np.abs(a["X"].force).max()


@pytest.mark.parametrize("symbol", ["P", "C"])
@pytest.mark.parametrize("shape", ["circle", "knot"])
def test_everything_holds_of_a_frame_held_in_orientation(symbol, shape, tmp_path):
    """Jacobian and bias by complex step, both engines and methods, power, orientation; files."""
    curve = held() if shape == "circle" else mg.Curve.through(points=TREFOIL, closed=True, frame="held")
    at = curve.at(np.array(0.3))[0]
    m = ring(lambda b: mg.Pair("X", symbol, "frame", b, point=at, curve=curve), n=6 - (symbol == "C"), seed=1)
    holds(*closed(m, 1, 0.02))
    s = mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)})
    for how in ({"method": "newton_euler"}, {"engine": "sparse"}):
        other = mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)}, **how)
        for pair in (p.name for p in m.pairs):
            assert_allclose(other[pair].reaction, s[pair].reaction, atol=1e-10 * np.abs(s[pair].reaction).max())
    assert s.checks.power.max() < 1e-12
    R = s.link(m.pairs[-1].b).pose[:, :3, :3]
    if symbol == "P":
        assert_allclose(R, np.broadcast_to(np.eye(3), R.shape), atol=1e-11)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m


# --- what will not do ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"type": "Ps", "curve": mg.Curve.circle(radius=0.5), "roller": 0.2}, "0.3 off its curve at the radius of the"),
        ({"type": "Sp", "surface": mg.Surface.sphere(radius=0.5)}, "0.5 off its surface"),
    ],
)
def test_a_point_off_its_curve_is_refused_also_of_a_copy_and_where_units_are_named(given, words):
    """A copy with other fields (units make one) must not take the nearest place for the point that was given."""
    off = mg.Pair("X", a="frame", b="body", point=(1, 0, 0), **given)
    for pair, units in ((off, {"length": "m", "mass": "kg", "time": "s"}), (off.replace(closed="force"), None)):
        with pytest.raises(mg.DeclarationError, match=words):
            mg.Mechanism("m", None, [pair], units=units)


def refused(**given):
    with pytest.raises(mg.DeclarationError) as error:
        mg.Mechanism("m", None, [mg.Pair("X", **{"type": "Sg", "a": "frame", "b": "body", **given})])
    return str(error.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"curve": mg.Curve.circle(radius=1.0), "point": (1.01, 0, 0)},
            "is 0.01 off its curve, which is nearest at (1, 0, 0)",
        ),
        ({"curve": mg.Curve.circle(radius=-1.0)}, "curve.radius = -1.0"),
        ({"curve": mg.Curve.through(points=KNOT[:3])}, "3 given; a curve with a continuous curvature takes 4"),
        ({"curve": mg.Curve.function(position=spiral, ends_at=(0, 5), closed=True)}, "its ends are"),
        ({"curve": mg.Curve.function(position=lambda u: spiral(u)[:1] * 4, ends_at=(0, 5))}, "derivative 1 differs"),
        ({"curve": mg.Curve.involute(radius=1.0, angles=(0.0, 1.0))}, "cusp at angle 0"),
        (
            {"curve": mg.Curve.helix(radius=1.0, pitch=0.1, frame="guided", guide=(0, 1, 0.1))},
            "is the direction of the curve at",
        ),
        ({"curve": mg.Curve.helix(radius=1.0, pitch=0.0), "point": (1, 0, 0)}, "pitch = 0: an endless helix advances"),
        ({"curve": "circle"}, "a Curve, such as"),
        (
            {"curve": mg.Curve.circle(radius=1.0, frame="held")},
            "frame='held' is for P and C; a pair Sg turns with its curve",
        ),
        ({"curve": mg.Curve.circle(radius=1.0), "type": "R"}, "a pair R takes none; those that do: P, C, Sg"),
        ({"curve": cam(roller_radius=1.0, base_radius=0.3, **LOBES)}, "undercut: the roller of radius 1 is larger"),
        ({"curve": cam(follower="flat", base_radius=0.1, **TWICE)}, "curve has a cusp at"),
        ({"curve": cam(slope=-0.2 * np.sin(ANGLE))}, "curve.slope: is not the derivative of lift"),
        ({"curve": cam(slope=0.2 * np.sin(ANGLE) * np.pi / 180)}, "curve.slope: is not the derivative of lift"),
        ({"curve": cam(bend=0 * ANGLE)}, "curve.bend: is not the derivative of slope"),
        ({"curve": mg.Curve.circle(radius=1.0), "type": "Ps", "roller": "wide"}, "curve: roller at fault"),
        ({"curve": cam(lift=ANGLE)}, "lift: is 0 at angle 0 and 6.28319 at 2 pi; the cam is not closed"),
    ],
)
def test_curves_that_will_not_do(given, words):
    assert words in refused(**given)


def test_a_faulty_curve_is_the_only_fault():
    """The curve says the axis: one that is at fault asks for no axis as well."""
    words = refused(type="Ps", curve=mg.Curve.circle(radius=0.0), point=(1, 0, 0))
    assert words == "mechanism 'm': 1 fault\n  pair 'X': curve.radius = 0.0: expected a finite number above 0"


def test_a_cam_is_made_of_a_motion_with_times():
    for motion in (0.3, mg.Motion([0.0, 0.1])):
        with pytest.raises(mg.DeclarationError, match=r"motion = .*: expected an mg\.Motion with times"):
            mg.Curve.cam.of(motion, base_radius=1.0)


@pytest.mark.parametrize("bodies", ["P", "C"])
def test_a_ball_in_an_endless_helix_goes_on_turn_after_turn(bodies):
    """A ball screw: the nut goes back by the pitch times the angle, the torque is force times pitch, however far it turns."""
    z, at, pitch = (0, 0, 1), (0.02, 0, 0), 0.01
    pairs = [
        mg.Pair("A", "R", "frame", "screw", point=(0, 0, 0), axis=z),
        mg.Pair("B", bodies, "frame", "nut", point=(0, 0, 0), axis=z),
        mg.Pair("G", "Sg", "screw", "nut", point=at, curve=mg.Curve.helix(radius=0.02, pitch=pitch)),
    ]
    if bodies == "C":
        pairs.append(mg.Pair("E", "Sp", "frame", "nut", point=(0.03, 0, 0), axis=(0, 1, 0)))
    m = mg.Mechanism("ball screw", None, pairs, drives=["A"], loads=[mg.Wrench("nut", force=(0, 0, -100), point=at)])
    angle = np.array([-50.0, -8.0, 7.5, 40.0])
    s = mg.solve(m, {"A": mg.Motion(angle, 3.0)})
    assert_allclose(s["B"].position[:, -1], -pitch * angle, atol=1e-11)
    assert_allclose(s["A"].effort[:, 0], -100 * pitch, rtol=1e-9)
    assert s.checks.power.max() < 1e-10


def test_the_frame_of_an_endless_helix_turns_as_little_as_possible_beyond_its_grid():
    travel = Travel(mg.Curve.helix(radius=0.8, pitch=0.3))
    s, step = np.linspace(-9.3, 9.3, 41) * travel.length, 1e-5
    here, ahead, behind = travel.at(s), travel.at(s + step), travel.at(s - step)
    turning = ((ahead.y - behind.y) / (2 * step) * here.k).sum(axis=0)
    assert_allclose(turning, 0.0, atol=1e-8)


def test_a_frame_that_comes_back_turned_is_refused_where_roll_is_held():
    """The closing angle is that of the spherical image: here it is found by following the frame in small steps, too."""
    curve = SAMPLE["closed"]
    s = np.linspace(0, curve.length, 20001)
    t = Travel(mg.Curve.through(points=curve.points, closed=True, frame="guided", guide=(0, 0, 1))).at(s)
    y = t.y[:, 0]
    for i in range(1, len(s)):
        y = y - (y @ t.t[:, i]) * t.t[:, i]
        y /= np.linalg.norm(y)
    angle = np.arctan2(y @ t.k[:, -1], y @ t.y[:, -1])
    found = Travel(curve).closing
    assert np.cos(found - angle) == pytest.approx(1, abs=1e-8)
    assert f"turned by {np.rad2deg(found):.6g} degrees" in refused(type="P", curve=curve)
    for freer in ("C", "Sg"):
        mg.Mechanism("m", None, [mg.Pair("X", freer, "frame", "body", curve=curve)])


@pytest.mark.parametrize("reversed_", [False, True])
def test_the_end_of_an_open_curve_ends_the_reach_by_name(reversed_):
    """A slide driven along an arc of 1 rad and radius 2 from its middle: 1 forth and 1 back."""
    arc = mg.Curve.circle(radius=2.0, angles=(0.0, 1.0))
    m = mg.Mechanism(
        "m",
        None,
        [
            mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair(
                "X",
                "P",
                "frame",
                "arm",
                point=arc.at(np.array(0.5))[0],
                curve=arc,
                axis=(1, -1, 0) if reversed_ else None,
            ),
        ],
        ["A"],
    )
    with pytest.raises(mg.ReachError, match=r"X\.Ts reaches the end of its curve"):
        mg.solve(m, {"A": np.linspace(0, 0.7, 8)})
    s = mg.solve(m, {"A": np.linspace(-0.7, 0.7, 15)}, on_reach="flag")
    assert s.status.tolist() == ["out of reach"] * 2 + ["ok"] * 11 + ["out of reach"] * 2
    assert_allclose(np.abs(s["X"].position[2:-2, 0]), 2 * np.abs(np.linspace(-0.5, 0.5, 11)), atol=1e-12)
    assert np.isnan(s.link("arm").pose[-1]).any()


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_carriage_that_leaves_its_rail_between_positions_is_out_of_reach_from_there_on(engine):
    """A slider-crank (crank 1, rod 3) reaches 4 at the crank angle 0, 1e-6 beyond its rail; turns later it has left it as well."""
    rail = mg.Curve.through(points=[(x, 0, 0) for x in np.linspace(1.9, 4.0 - 1e-6, 6)])
    head = (np.cos(1.0) + np.sqrt(9.0 - np.sin(1.0) ** 2), 0.0, 0.0)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("B", "R", "crank", "rod", point=(np.cos(1.0), np.sin(1.0), 0), axis=(0, 0, 1)),
        mg.Pair("C", "R", "rod", "slider", point=head, axis=(0, 0, 1)),
        mg.Pair("D", "P", "frame", "slider", point=head, curve=rail),
    ]
    m = mg.Mechanism("slider-crank", None, pairs, ["A"])
    for q in ([-0.9, -2.0], [2.0, -0.9, -0.1 - 6 * np.pi], np.linspace(-0.9, -2.0, 50)):
        s = mg.kinematics(m, {"A": q}, on_reach="flag", engine=engine)
        assert (s.status == np.where(np.array(q) > -1.0, "ok", "out of reach")).all()


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("driver", ["A", "X"])
def test_two_drivers_come_back_from_beyond_an_end(driver, engine):
    """An arc of .5 rad to either side, followed by the arm or along the arc, and a hand on the arm that turns meanwhile."""
    arc = mg.Curve.circle(radius=2.0, angles=(0.0, 1.0))
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("X", "P", "frame", "arm", point=arc.at(np.array(0.5))[0], curve=arc),
        mg.Pair("B", "R", "arm", "hand", point=(1, 0, 0), axis=(0, 0, 1)),
    ]
    m = mg.Mechanism("m", None, pairs, [driver, "B"])
    for angle in ([0, 0.95, 0.1], [0, 0.95, 0.97, 0.1, 0.5, -0.4, -0.6, 0.3], [0.4, -0.9, 0.9, 0.2]):
        q = np.array(angle)
        for turned in (0 * q, 0.3 * np.arange(len(q))):
            s = mg.kinematics(m, {driver: q if driver == "A" else 2 * q, "B": turned}, on_reach="flag", engine=engine)
            ok = np.abs(q) <= 0.5
            assert s.status.tolist() == np.where(ok, "ok", "out of reach").tolist()
            assert_allclose(s["X"].position[ok, 0], 2 * q[ok], atol=1e-12)
    with pytest.raises(mg.ReachError, match=r"X\.Ts reaches the end") as error:
        mg.kinematics(m, {driver: [0.0, 1.9], "B": [0.0, 0.0]}, engine=engine)
    assert error.value.value[f"{driver}.{'Rz' if driver == 'A' else 'Ts'}"] == pytest.approx(
        1 if driver == "X" else 0.5
    )


def test_a_curve_at_fault_is_the_only_fault():
    """It says no markers, so that none are missing or too many; given by a marker on b, or by both as in a study."""

    def cusp(u):
        z = 0 * u
        return [
            np.stack([u**2, u**3, z]),
            np.stack([2 * u, 3 * u**2, z]),
            np.stack([2 + z, 6 * u, z]),
            np.stack([z, 6 + z, z]),
        ]

    curve, marker = mg.Curve.function(position=cusp, ends_at=(-1, 1)), mg.Marker((1, 1, 0), (0, 0, 1), (1, 0, 0))
    for given in ({"on_b": marker}, {"on_b": marker, "on_a": marker}, {"on_b": marker, "point": (1, 1, 0)}):
        pair = mg.Pair("K", "Ps", "frame", "pin", curve=curve, **given)
        with pytest.raises(mg.DeclarationError) as error:
            mg.Mechanism("m", None, [pair])
        (fault,) = error.value.faults
        assert "has a cusp" in fault
    with pytest.raises(mg.DeclarationError, match=r"(?s)2 faults.*on_a is missing.*on_b is missing"):
        mg.Mechanism(
            "m", None, [mg.Pair("K", "R", "frame", "pin", on_b=marker), mg.Pair("L", "R", "frame", "pin", on_a=marker)]
        )


def test_a_function_may_yield_its_derivatives():
    """One by one, as a generator does: its number of derivatives was asked by the length of what it returns."""

    def helix(u):
        for k in range(5):
            yield np.stack(
                [np.cos(u + k * np.pi / 2), np.sin(u + k * np.pi / 2), (u, 1 + 0 * u, 0 * u, 0 * u, 0 * u)[k]]
            )

    curve = mg.Curve.function(position=helix, ends_at=(0.0, 6.0))
    listed = mg.Curve.function(position=lambda u: list(helix(u)), ends_at=(0.0, 6.0))
    s = np.linspace(0, 8, 7)
    assert_allclose(curve.once(Travel).at(s).y, listed.once(Travel).at(s).y, atol=1e-15)


def test_a_function_is_never_asked_for_nothing():
    """All positions of a call may be interpolated, as beside a change point."""

    def line(u):
        assert u.min() >= 0.0
        zero = 0.0 * u
        return [np.stack([x, zero, zero]) for x in (u, zero + 1.0, zero, zero)]

    assert mg.Curve.function(position=line, ends_at=(0.0, 1.0)).at(np.zeros(0)).shape == (4, 3, 0)


# --- what contradicts itself, and what does not --------------------------------------------------------------------------------


def dwelling(u):
    """A polar curve that rises by 5 mm from a sixth to a third of a turn (poly345) and falls half a turn later: derivative 3 jumps."""
    r = np.zeros((5, u.size))
    for begin, height in ((np.pi / 3, 0.005), (4 * np.pi / 3, -0.005)):
        x, w = np.clip((u - begin) / (np.pi / 3), 0, 1), 3 / np.pi
        inside = (u > begin) & (u < begin + np.pi / 3)
        r[0] += height * x**3 * (10 - 15 * x + 6 * x**2)
        rates = (
            30 * x**2 - 60 * x**3 + 30 * x**4, 60 * x - 180 * x**2 + 120 * x**3, 60 - 360 * x + 360 * x**2, 720 * x - 360
        )  # fmt: skip
        for k, part in enumerate(rates, 1):
            r[k] += height * w**k * part * inside
    r[0] += 0.03
    return polar(r, u)


def polar(r, u):
    """``r e^(iu)`` and four derivatives from those of r, by Leibniz."""
    turn = np.exp(1j * u)
    z = [sum(math.comb(n, k) * r[k] * 1j ** (n - k) for k in range(n + 1)) * turn for n in range(5)]
    return [np.stack([part.real, part.imag, 0 * u]) for part in z]


def wavy(waves, depth):
    def position(u):
        r = [depth * waves**k * np.cos(waves * u + k * np.pi / 2) for k in range(5)]
        r[0] = r[0] + 0.05
        return polar(r, u)

    return position


@pytest.mark.parametrize(
    ("position", "more"),
    [(dwelling, {}), (dwelling, {"breaks": np.pi * np.array([1, 2, 4, 5]) / 3}),
     (wavy(50, 0.004), {}), (wavy(150, 1e-4), {}), (wavy(1000, 1e-6), {})],
    ids=["dwells", "dwells with breaks", "50 waves", "150 waves", "1000 waves"],
)  # fmt: skip
def test_a_right_function_is_taken(position, more):
    curve = mg.Curve.function(position=position, ends_at=(0, 2 * np.pi), closed=True, **more)
    assert mg.Mechanism("m", None, [mg.Pair("K", "Ps", "a", "b", curve=curve, point=curve.at(np.array(0.0))[0])]).pairs
    assert curve.grid.size < 5000


def test_the_length_of_a_wavy_curve_is_found():
    curve = mg.Curve.function(position=wavy(50, 0.004), ends_at=(0, 2 * np.pi), closed=True)
    u = 2 * np.pi * np.arange(20000) / 20000  # the trapezoidal rule is exact for what is periodic
    exact = np.linalg.norm(curve.at(u)[1], axis=0).mean() * 2 * np.pi
    assert curve.length == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("place", ["everywhere", "behind a break", "a hundredth"])
def test_a_wrong_derivative_is_found_where_it_is(order, place):
    """By 2 % everywhere, and by its size in a piece, or a hundredth of the range, that a few places would not see."""

    def position(u):
        out = wavy(3, 0.005)(u)
        at = {
            "everywhere": 0.02 + 0 * u,
            "behind a break": u > 6.1,
            "a hundredth": np.abs(u - 2.0) < 0.03,
        }[place]
        out[order] = out[order] * (1 + at)
        return out

    more = {"breaks": (6.1,)} if "break" in place else {}
    curve = mg.Curve.function(position=position, ends_at=(0, 2 * np.pi), closed=True, **more)
    with pytest.raises(mg.DeclarationError, match=f"derivative {order} differs from the slope of .* at u = "):
        mg.Mechanism("m", None, [mg.Pair("K", "Ps", "a", "b", curve=curve)])


@pytest.mark.parametrize("breaks", [(0.0,), (2.0, 1.0), (7.0,), "no", (np.nan,), [[1.0], [2.0]], [[1.0, 2.0], 3.0]])
def test_breaks_that_are_none_are_refused(breaks):
    curve = mg.Curve.function(position=dwelling, ends_at=(0, 2 * np.pi), closed=True, breaks=breaks)
    with pytest.raises(mg.DeclarationError, match="breaks"):
        mg.Mechanism("m", None, [mg.Pair("K", "Ps", "a", "b", curve=curve)])


def rise_and_fall(law, samples):
    """A rise and a fall of 10 mm over 120 degrees each, dwells between."""
    u, third = np.linspace(0, 2 * np.pi, samples + 1), 2 * np.pi / 3
    up, down = (mg.Motion.law(law, h, third, np.maximum(u - at, -1.0)) for h, at in ((0.01, 0.3), (-0.01, 3.5)))
    fields = {"lift": "position", "slope": "velocity", "bend": "acceleration"}
    return {"angle": u, **{name: getattr(up, of) + getattr(down, of) for name, of in fields.items()}}


@pytest.mark.parametrize("law", ["cycloidal", "harmonic", "poly345", "poly4567"])
@pytest.mark.parametrize("samples", [9, 24, 72, 73, 360])
def test_laws_are_compared_with_their_rates_within_the_error_of_a_spline(law, samples):
    """True ones pass, rounded to three digits too; slopes 45 % too large do not, nor 5 % from 5 degrees on, nor one wrong sample."""
    given = rise_and_fall(law, samples)

    def said(**changes):
        return mg.Curve.cam(**{**given, **changes}, base_radius=0.05, second=(0, 1, 0)).faults("")

    assert said() == []
    assert said(**{k: np.round(given[k], 5) for k in ("lift", "slope", "bend")}) == []
    if samples >= 24:
        assert "slope: is not the derivative of lift" in said(slope=1.45 * given["slope"])[0]
        assert "slope: is not the derivative of lift" in said(lift=0.6 * given["lift"])[0]
    if samples >= 72:
        assert said(slope=1.05 * given["slope"])
        assert said(bend=1.45 * given["bend"])
        wrong = given["slope"].copy()
        wrong[samples // 6] *= 1.5
        assert said(slope=wrong)
