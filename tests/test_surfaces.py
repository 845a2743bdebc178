"""Spheres and points on surfaces: limits that are other pairs, derivatives, and the ends of surfaces."""

import math
import pickle

import numpy as np
import pytest
import strategies
from identities.test_complex_step import closed, holds
from numpy.testing import assert_allclose
from test_curves import AXIS, CENTER, T, ring

import mechgraph as mg

GRID = np.array([(i, j, 0.3 * np.sin(0.7 * i) * np.cos(0.5 * j)) for i in range(7) for j in range(8)], dtype=float)


def saddle(u, v):
    """``(u, v, u^2 v / 3)`` and its derivatives."""
    z, one = 0 * u, 1 + 0 * u
    rows = [
        (u, v, u * u * v / 3),
        (one, z, 2 * u * v / 3),
        (z, one, u * u / 3),
        (z, z, 2 * v / 3),
        (z, z, 2 * u / 3),
        (z, z, z),
    ]
    return [np.stack(row) for row in (*rows, (z, z, z), (z, z, 2 / 3 * one), (z, z, z), (z, z, z))]


SAMPLE = {
    "plane": mg.Surface.plane(center=CENTER, axis=AXIS),
    "sphere": mg.Surface.sphere(radius=0.8, center=CENTER, axis=AXIS),
    "cylinder": mg.Surface.cylinder(radius=0.8, center=CENTER, axis=AXIS),
    "cone": mg.Surface.cone(half_angle=0.5, center=CENTER, axis=AXIS),
    "torus": mg.Surface.torus(radius=0.9, tube=0.3, center=CENTER, axis=AXIS),
    "revolution": mg.Surface.revolution(profile=mg.Curve.ellipse(a=0.3, b=0.2, center=(1.0, 0, 0), axis=(0, 1, 0))),
    "patch": mg.Surface.patch(points=GRID, rows=7),
    "function": mg.Surface.function(position=saddle, ends_u=(-2, 2), ends_v=(-2, 2)),
}


def given(function, **ends):
    """A sphere on a surface, or a pin in a slot, by the function."""
    if "ends_at" in ends:
        shape = {"type": "Sg", "curve": mg.Curve.function(position=function, **ends)}
    else:
        shape = {"type": "Sp", "surface": mg.Surface.function(position=function, **ends)}
    turn = mg.Pair("A", "R", "frame", "crank", point=(0.2, 0, 0), axis=(0, 0, 1))
    return [turn, mg.Pair("K", a="frame", b="crank", point=(0, 0, 0), **shape)]


FLAT = {"ends_u": (-2, 2), "ends_v": (-2, 2)}


def straight(u):
    return [np.stack([u, 0 * u, 0 * u]), np.array([[1.0], [0], [0]]), np.zeros((3, 1)), np.zeros((3, 1))]


@pytest.mark.parametrize(
    ("function", "ends", "words"),
    [
        (lambda u, v: [[1.0 / int(u[0] - u[0])]], FLAT, "raised ZeroDivisionError: .* at u = "),
        (lambda u: [math.sqrt(4 - u * u)], {"ends_at": (-1, 1)}, "raised TypeError: .* at u = -0.666667"),
        (
            lambda u: straight(u)[:3],
            {"ends_at": (-1, 1)},
            r"curve.position: returned 3 arrays, expected 4 arrays \(3, n\)",
        ),
        (lambda u, v: [part[:2] for part in saddle(u, v)], FLAT, r"surface.position: returned an array \(2, 25\)"),
        (
            lambda u: [x + 0 / (abs(u) > 0.01) for x in straight(u)],
            {"ends_at": (-1, 1)},
            "a number that is not finite at u = 0",
        ),
        (
            lambda u, v: [*saddle(u, v)[:5], *saddle(u, v)[4:9]],
            FLAT,
            "surface.position: x_vv differs from the slope of x_v",
        ),
    ],
    ids=["raises", "one number", "few", "flat", "nan", "slope"],
)
def test_what_is_wrong_with_a_function_is_said_with_pair_and_parameter(function, ends, words):
    with np.errstate(all="ignore"), pytest.raises(mg.DeclarationError, match=f"(?s)pair 'K'.*{words}") as error:
        mg.Mechanism("m", None, given(function, **ends), ["A"])
    assert ("raised" in words) == (error.value.__cause__ is not None)


@pytest.mark.parametrize("how", ["raises", "nan"])
def test_a_function_that_fails_on_the_way_is_named_with_its_pair(how):
    """Inside its range the pin comes to where the function has no value; what it raised is the cause."""

    def broken(u):
        if begun and how == "raises" and (np.abs(u - 0.31) < 0.005).any():
            raise RuntimeError("no value here")
        near = np.abs(u - 0.31) < 0.005 if begun and how == "nan" else np.zeros(u.shape, dtype=bool)
        return [np.where(near, np.nan, x) for x in straight(u)]

    begun = False
    slide = mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=(1, 0, 0))
    pin = mg.Pair(
        "K", "Ps", "frame", "block", curve=mg.Curve.function(position=broken, ends_at=(-1, 1)), point=(0, 0, 0)
    )
    m = mg.Mechanism("m", None, [slide, pin], ["A"])
    begun = True
    words = "raised RuntimeError: no value here at u = 0.3" if how == "raises" else "not finite at u = 0.3"
    with pytest.raises(mg.ShapeError, match=f"(?s)pair 'K'.*{words}") as error:
        mg.kinematics(m, {"A": np.linspace(0, 0.6, 601)})
    assert isinstance(error.value.__cause__, RuntimeError if how == "raises" else None.__class__)


def test_a_function_is_asked_inside_its_ends_alone():
    """Beyond them Taylor's series serves, of curve and surface, real and complex."""

    def asked(*at):
        assert all(np.abs(part).max() <= 2 for part in at)
        return saddle(*at)

    surface = mg.Surface.function(position=asked, **FLAT)
    u, v = np.array([2.1, 0.3]), np.array([0.5, -2.2])
    assert_allclose(surface.at(u, v), saddle(u, v)[:6], atol=1e-14)
    curve = mg.Curve.function(
        position=lambda s: asked(s, 1.0 + 0 * s)[0:1] + asked(s, 1.0 + 0 * s)[1:7:2], ends_at=(-2, 2)
    )
    x = [saddle(u, 1.0 + 0 * u)[k] for k in (0, 1, 3, 5)]
    assert_allclose(curve.at(u), x, atol=1e-14)


INSIDE = {"patch": (0.4, 0.6)}


def place(name):
    return SAMPLE[name].at(*np.array(INSIDE.get(name, (0.7, 0.4)))[:, None])[0][:, 0]


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", SAMPLE)
def test_derivatives_of_a_surface_and_its_nearest_point(name):
    surface, (u, v) = SAMPLE[name], np.array(INSIDE.get(name, (0.7, 0.4)))[:, None]
    x = surface.at(u, v)
    by_u, by_v = (surface.at(u + 1e-30j * (i == 0), v + 1e-30j * (i == 1)).imag / 1e-30 for i in (0, 1))
    assert_allclose(by_u[:3], x[[1, 3, 4]], atol=1e-13)
    assert_allclose(by_v[:3], x[[2, 4, 5]], atol=1e-13)
    normal = np.cross(x[1, :, 0], x[2, :, 0])
    at = surface.nearest(x[0, :, 0] + 0.02 * normal / np.linalg.norm(normal))
    assert_allclose(surface.at(*np.array(at)[:, None])[0], x[0], atol=1e-10)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    ("make", "v"),
    [
        (lambda L: mg.Surface.cone(half_angle=0.5, center=L * CENTER, axis=AXIS), (1e-4, 0.01, 1.0)),
        (lambda L: mg.Surface.sphere(radius=L, center=L * CENTER, axis=AXIS), (-1.5707, -1.56, 1.5, 1.57079)),
        (lambda L: mg.Surface.torus(radius=2 * L, tube=L, axis=AXIS), (-3.0, -1.3, 0.2, 3.1)),
        (
            lambda L: mg.Surface.revolution(profile=mg.Curve.circle(center=(3 * L, 0, 0), radius=L, axis=(0, 1, 0))),
            (2.5, 5.0),
        ),
    ],
    ids=["cone", "sphere", "torus", "revolution"],
)
def test_the_nearest_point_beside_a_pole_and_at_any_size(make, v, size):
    """A point of the surface is its own nearest one, however near it lies to a pole or an apex."""
    surface = make(size)
    v = np.array(v) * (size if surface.kind == "cone" else 1.0)
    for u in (-2.5, 0.1, 3.0):
        for x in surface.at(np.full(v.shape, u), v)[0].T:
            found = surface.at(*np.array(surface.nearest(x))[:, None])[0][:, 0]
            assert np.linalg.norm(found - x) < 1e-12 * size


def on(surface, point, symbol="Sp", **more):
    return lambda b: mg.Pair("X", symbol, "frame", b, point=point, surface=surface, **more)


def solved(m, **how):
    return mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)}, **how)


def test_a_sphere_on_a_plane_is_its_own_row():
    """Positions, reaction, and its component, the normal force."""
    at = CENTER + np.cross(AXIS, [0.3, 0.2, 0.1])
    one, two = (
        ring(on(SAMPLE["plane"], at), n=2),
        ring(lambda b: mg.Pair("X", "Sp", "frame", b, point=at, axis=AXIS), n=2),
    )
    a, b = solved(one), solved(two)
    for link in ("b0", "b1"):
        assert_allclose(a.link(link).acceleration, b.link(link).acceleration, atol=1e-10)
    assert_allclose(a["X"].components["Fz"], b["X"].components["Fz"], rtol=1e-10)
    assert_allclose(a["X"].reaction, b["X"].reaction, atol=1e-10 * np.abs(b["X"].reaction).max())


def test_a_sphere_on_a_sphere_is_a_rod_between_spheres():
    at = place("sphere")
    one = ring(on(SAMPLE["sphere"], at), n=2)
    rod = [mg.Pair("Y", "S", "frame", "rod", point=CENTER), mg.Pair("X", "S", "rod", "b1", point=at)]
    two = one.replace(links=[*one.links, mg.Link("rod")], pairs=[*one.pairs[:-1], *rod])
    a, b = solved(one), solved(two)
    for how in ({"method": "newton_euler"}, {"engine": "sparse"}):
        assert_allclose(solved(one, **how)["X"].reaction, a["X"].reaction, atol=1e-10 * np.abs(a["X"].reaction).max())
    for link in ("b0", "b1"):
        for what in ("pose", "twist", "acceleration"):
            assert_allclose(getattr(a.link(link), what), getattr(b.link(link), what), atol=1e-10)
    assert_allclose(a["X"].reaction, b["X"].reaction, atol=1e-10 * np.abs(b["X"].reaction).max())
    assert a.checks.power.max() < 1e-12
    radial = a.link("b1").point(at)[0] - CENTER
    assert np.abs(np.cross(a["X"].force, radial)).max() < 1e-11 * np.abs(a["X"].force).max()


def swung(axis, away=(0.3, 0, 0.4), **more):
    """A crank that turns about y beside the center of a sphere, and a slide on it whose tip stays on the sphere."""
    pivot, tip = np.array([0.1, 0, 0]), np.array(away)
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, pivot, np.diag([0.1, 0.2, 0.3])),
        mg.Link("slide", 2.0, tip, np.diag([0.1, 0.2, 0.3])),
    ]
    surface = mg.Surface.sphere(radius=0.5, axis=axis)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=pivot, axis=(0, 1, 0)),
        mg.Pair("B", "P", "crank", "slide", point=pivot, axis=tip - pivot),
        mg.Pair("K", "Sp", "frame", "slide", surface=surface, point=tip, **more),
    ]
    return mg.Mechanism("swung", links, pairs, ["A"], [mg.Gravity((0, 0, -9.81))])


TOP = np.arctan2(0.4, 0.2) - np.arctan2(0.5, -0.1)
"""Angle of the crank of ``swung`` at which the tip is on the pole of an axis z."""


def agree(a, b):
    """Motion and forces of two mechanisms that differ in the axis of a sphere."""
    assert set(b.status.tolist()) == {"ok"}
    for link in ("crank", "slide"):
        for what in ("pose", "twist", "acceleration"):
            assert_allclose(getattr(a.link(link), what), getattr(b.link(link), what), atol=1e-10)
    assert_allclose(a["K"].force, b["K"].force, atol=1e-10 * np.abs(a["K"].force).max())
    assert_allclose(a["A"].effort, b["A"].effort, atol=1e-10 * np.abs(a["A"].effort).max())
    assert b.checks.power.max() < 1e-12
    assert_allclose(a.contact("K").normal, b.contact("K").normal, atol=1e-10)


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("tilt", "engine"),
    [
        (0.0, "dense"),
        (0.0, "sparse"),
        (1e-10, "dense"),
        (1e-8, "sparse"),
        (1e-6, "dense"),
        (1e-4, "dense"),
        (0.01, "dense"),
    ],
)
def test_a_sphere_goes_on_over_its_poles(tilt, engine):
    """A whole turn over two poles, through them and beside them at any distance: all as with poles that lie far from the path."""
    turn = {"A": mg.Motion(np.linspace(0, -2 * np.pi, 41), 2.0, 1.0)}
    agree(mg.solve(swung((0, 1, 0)), turn), mg.solve(swung((0, tilt, 1)), turn, engine=engine))


@pytest.mark.daily(1)
@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-8, 1e-4])
def test_positions_on_and_beside_a_pole(tilt):
    """There the rates of longitude and latitude have no value, or one of no accuracy; those about another axis have."""
    beside = {"A": mg.Motion(TOP * np.array([0.0, 0.5, 1.0, 1.0 + 1e-7, 1.001, 2.0]), 2.0, 1.0)}
    agree(mg.solve(swung((0, 1, 0)), beside), mg.solve(swung((0, tilt, 1)), beside))


def test_a_start_is_kept_where_the_axis_changes():
    """Coordinates of the start, of the place and the rotation, are those of the same position about the other axis."""
    m, begin = swung((0, 1e-8, 1)), {"A": mg.Motion(np.array([-0.3, 0.3]))}
    s = mg.kinematics(m, begin)
    q = {name: s[name.split(".")[0]].position[0, j] for p in m.pairs for j, name in enumerate(p.freedom_names)}
    turn = {"A": mg.Motion(np.linspace(-0.3, -2.0, 9), 2.0, 1.0)}
    agree(mg.solve(swung((0, 1, 0)), turn), mg.solve(m.replace(start=q), turn))


def test_a_ball_by_its_marker_goes_over_poles_too():
    """Its mechanism is assembled, from a place far from where it is declared by a point."""
    turn = {"A": mg.Motion(np.linspace(0, -2 * np.pi, 9), 2.0, 1.0)}
    m, marker = swung((0, 1e-8, 1)), swung((0, 0, 1)).pair("K").markers[1]
    ball = mg.Pair("K", "Sp", "frame", "slide", surface=m.pair("K").surface, on_b=marker)
    apart = m.replace(pairs=[*m.pairs[:2], ball])
    agree(mg.solve(swung((0, 1, 0)), turn), mg.solve(apart, turn))


def over_the_pole(off, loads=()):
    """A ball that slides over a sphere of radius one on a line at the distance ``off`` from its pole."""
    at = (0.5, off, np.sqrt(0.75 - off**2))
    pairs = [
        mg.Pair("X", "P", "frame", "carriage", point=at, axis=(1, 0, 0)),
        mg.Pair("Z", "P", "carriage", "ball", point=at, axis=(0, 0, 1)),
        mg.Pair("K", "Sp", "frame", "ball", point=at, surface=mg.Surface.sphere(radius=1.0)),
    ]
    return mg.Mechanism("ball", [mg.Link("frame"), mg.Link("carriage"), mg.Link("ball", 1.0, at)], pairs, ["X"], loads)


@pytest.mark.daily(1)
@pytest.mark.parametrize("off", [1e-7, 0.0, 1e-3])
def test_a_path_over_a_pole_with_a_tolerance(off):
    x = np.array([0.5, 0.2, 1e-3, 0.0, -0.3])
    s = mg.solve(over_the_pole(off), {"X": mg.Motion(x - 0.5, 1.0, 0.0)}, tol=1e-6)
    z = np.sqrt(1 - x**2 - off**2)
    assert_allclose(s["Z"].position[:, 0], z - z[0], atol=1e-12)
    assert_allclose(s["Z"].acceleration[:, 0], -(1 + x**2 / z**2) / z, atol=1e-11)


def test_a_pole_that_is_kept_is_named_where_it_ends_the_path():
    m = over_the_pole(1e-9, loads=[mg.Effort("K.Tu", 1.0)])
    with pytest.raises(mg.ReachError, match=r"lies behind a pole of the sphere of K, .* give the surface another axis"):
        mg.solve(m, {"X": [0.0, -0.3, -0.8]})
    other = m.replace(pairs=[*m.pairs[:2], m.pair("K").replace(surface=mg.Surface.sphere(radius=1.0, axis=(0, 1, 0)))])
    found = mg.solve(other, {"X": [0.0, -0.3, -0.8]})["Z"].position[-1, 0]
    assert found == pytest.approx(np.sqrt(0.91) - np.sqrt(0.75), abs=1e-12)


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("off", [1e-6, 9e-5, 1e-7, 1e-9])
def test_beside_a_pole_that_is_kept_a_path_ends_at_one_place(off, engine):
    """At the way 1e-4 from it, in whatever company and with either engine; farther away and right over it goes on."""
    far = np.sqrt(1e-8 - off**2)
    m = over_the_pole(off, loads=[mg.Effort("K.Tu", 1.0)])
    for x in ([-0.2, -0.5 + 1.001 * far, -0.5 + 0.999 * far, -0.9], [-0.9]):
        s = mg.solve(m, {"X": x}, engine=engine, on_reach="flag")
        assert s.status.tolist() == ["ok" if at > -0.5 + far else "out of reach" for at in x]
    for off in (1.1e-4, 0.0):
        m = over_the_pole(off, loads=[mg.Effort("K.Tu", 1.0)])
        assert mg.solve(m, {"X": [-0.2, -0.9]}, engine=engine).status.tolist() == ["ok", "ok"]


@pytest.mark.slow
def test_variants_beside_a_pole_are_those_by_themselves():
    m, turn = swung((0, 1e-8, 1)), {"A": mg.Motion(TOP * np.linspace(0, 2, 5), 2.0, 1.0)}
    study = mg.study(m, {"slide.mass": [1.0, 2.0]}, "A.effort", n=2, motions=turn, sampling="grid")
    assert not study.failed.any()
    for i, effort in enumerate(study.outputs["A.effort"]):
        light = swung((0, 1, 0)).replace(links=study.variant(i).links)
        assert_allclose(effort, mg.solve(light, turn)["A"].effort[:, 0], atol=1e-10 * np.abs(effort).max())


def test_a_ball_may_be_declared_on_a_pole():
    """Its coordinates are about another axis there; Jacobian and bias by complex step; the motion is the same."""
    at = (0, 0, 0.5)
    a, b = (mg.solve(swung(axis, at), {"A": mg.Motion(np.linspace(0, 1.0, 5), 2.0)}) for axis in ((0, 1, 0), (0, 0, 1)))
    assert_allclose(a.link("slide").acceleration, b.link("slide").acceleration, atol=1e-10)
    assert_allclose(a["K"].force, b["K"].force, atol=1e-9 * np.abs(a["K"].force).max())
    holds(*closed(ring(on(mg.Surface.sphere(radius=0.5, axis=(0, 0, 1)), at), n=2), 1, 0.02))


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", SAMPLE)
def test_everything_holds_on_every_surface(name, tmp_path):
    """Jacobian and bias by complex step; power; normal force; files, pickles."""
    m = ring(on(SAMPLE[name], place(name)), n=2)
    holds(*closed(m, 1, 0.02))
    s = solved(m)
    assert s.checks.power.max() < 1e-12
    if name != "function":
        mg.save(m, tmp_path / "m.toml")
        assert mg.load(tmp_path / "m.toml") == m
        assert pickle.loads(pickle.dumps(m)) == m
    moved = m.moved(strategies.pose(np.random.default_rng(0), 2.0))
    assert_allclose(solved(moved.replace(loads=[]))["X"].position, solved(m.replace(loads=[]))["X"].position, atol=1e-9)


def test_a_parameter_that_leaves_its_range_ends_the_reach_by_name():
    """A point carried over the edge of a patch of a plane, at u = 1: half a length from where it starts."""
    flat = mg.Surface.patch(points=[(i / 4, j / 4, 0.0) for i in range(5) for j in range(5)], rows=5)
    m = mg.Mechanism(
        "m",
        None,
        [
            mg.Pair("A", "P", "frame", "slide", point=(0.5, 0.5, 0), axis=(1, 0, 0)),
            mg.Pair("X", "Sp", "frame", "slide", point=(0.5, 0.5, 0), surface=flat),
        ],
        ["A"],
    )
    s = mg.kinematics(m, {"A": np.linspace(0, 0.7, 8)}, on_reach="flag")
    assert s.status.tolist() == ["ok"] * 6 + ["out of reach"] * 2
    with pytest.raises(mg.ReachError, match=r"X\.Tu reaches the end"):
        mg.kinematics(m, {"A": np.linspace(0, 0.7, 8)})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"point": (0, 0, 0.9)}, "is 0.1 off its surface, which is nearest at ("),
        ({"surface": mg.Surface.sphere(radius=-1.0)}, "surface.radius = -1.0"),
        ({"surface": mg.Surface.torus(radius=1.0, tube=2.0)}, "surface.tube = 2.0"),
        ({"surface": mg.Surface.patch(points=GRID, rows=5)}, "make no grid"),
        ({"type": "Sg"}, "a pair Sg takes none; those that do: Sp"),
        ({"surface": mg.Curve.circle(radius=1.0)}, "a Surface, such as"),
        ({"curve": mg.Curve.circle(radius=1.0)}, "has a curve and a surface"),
        (
            {"surface": mg.Surface.cone(half_angle=0.5), "point": (0, 0, 0)},
            "has no normal at (0, 0, 0)",
        ),
    ],
)
def test_surfaces_that_will_not_do(given, words):
    whole = {"type": "Sp", "surface": mg.Surface.sphere(radius=1.0, axis=(0, 1, 0)), **given}
    with pytest.raises(mg.DeclarationError) as error:
        mg.Mechanism("m", None, [mg.Pair("X", a="frame", b="body", **whole)])
    assert words in str(error.value)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_point_may_miss_its_surface_by_a_part_of_its_size(size):
    """Whatever the unit of length: a millionth, no more."""

    def ball(off):
        point = (size * (1 + off), 0.0, 0.0)
        return mg.Pair("E", "Sp", "f", "b", point=point, surface=mg.Surface.sphere(radius=size))

    assert mg.Mechanism("on", pairs=[ball(1e-7)]).pairs
    with pytest.raises(mg.DeclarationError, match="off its surface"):
        mg.Mechanism("off", pairs=[ball(1e-5)])
    assert mg.Mechanism(
        "plane", pairs=[mg.Pair("E", "Sp", "f", "b", point=(0, 0, 1e-17), surface=mg.Surface.plane())]
    ).pairs


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e4])
def test_a_point_is_kept_to_rounding_at_any_size(size):
    """A place on a plane, a cylinder, a line or a circle is no farther from the point given than its digits; its own place is the same."""
    point = size * np.array([0.6, 0.8, np.pi])
    shapes = [
        {"surface": mg.Surface.plane(center=point + size * np.array([0.3, -0.2, 0]))},
        {"surface": mg.Surface.cylinder(radius=size)},
        {"surface": mg.Surface.cone(half_angle=0.3, center=point - size * np.array([np.tan(0.3), 0, 1]))},
        {"curve": mg.Curve.line(point=point - size * np.array([1, 2, 0.5]), direction=(1, 2, 0.5))},
        {"curve": mg.Curve.circle(radius=size, center=point - size * np.array([0, 1, 0]))},
    ]
    for shape in shapes:
        pair = mg.Pair("K", "Sp" if "surface" in shape else "Sg", "a", "b", point=point, **shape)
        assert_allclose(pair.point, point, atol=1e-13 * size)
        assert pair.replace(point=pair.point) == pair
