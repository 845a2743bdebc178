"""Studies over numbers of gears, curves, surfaces and contacts: closed forms, and every variant solved by itself."""

import numpy as np
import pytest
import test_gears
from numpy.testing import assert_allclose
from test_contacts_on_curves import STEEL, Y, Z
from test_followers import ROLLER, driven_cam, law

import mechgraph as mg

ANGLES = np.linspace(0.0, 6.0, 9)
GIVEN = {"A": mg.Motion(ANGLES, 3.0, 2.0)}
CENTER = np.array([0.3, 0.0, 0.0])
GEARS = {
    "spur": (lambda: test_gears.spur(helix_angle=0.2), {}, ["g.helix_angle", "g.pressure_angle"]),
    "bevel": (
        lambda: mg.BevelGears("g", "A", "B", teeth=(20, 30), module=0.01, spiral_angle=0.1),
        {"b": (0.2, 0, 0.2), "axis": (1, 0, 0)},
        ["g.module", "g.spiral_angle", "couplings[0].pressure_angle"],
    ),
    "worm": (
        lambda: mg.WormGear("g", "A", "B", teeth=(2, 40), radius=0.02),
        {"b": (0.1, 0, 0), "axis": (0, 1, 0)},
        ["g.radius"],
    ),
    "belt": (lambda: mg.Belt("g", "A", "B", radii=(0.05, 0.08)), {}, ["g.radii.a", "g.radii.b"]),
}


def alone(study, motions, outputs, i, **how):
    s = mg.solve(study.variant(i), motions, **how)
    return {
        name: what(s) if callable(what) else getattr(s[what.split(".")[0]], what.split(".")[1])
        for name, what in outputs.items()
    }


@pytest.mark.daily(4)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("kind", GEARS)
def test_gears_of_variants_are_solved_together(kind, engine, monkeypatch):
    """Ratio, effort, bearing reactions and the force of the teeth are those of every variant by itself."""
    gears, place, names = GEARS[kind]
    m = test_gears.two(gears(), **place)
    outputs = {
        "A": "A.effort",
        "R": "A.reaction",
        "S": "B.reaction",
        "B": "B.position",
        "F": lambda s: s.coupling("g").force,
    }
    value = {name: getattr(m.couplings[0], name.split(".")[1]) for name in names}
    spread = {n: np.atleast_1d(v)[-1 if n.endswith("b") else 0] * np.array([1.0, 1.02, 0.97]) for n, v in value.items()}
    monkeypatch.setattr("mechgraph.variants.work._solved_alone", None)
    study = mg.study(m, spread, outputs, n=3, motions=GIVEN, engine=engine)
    assert not study.failed.any(), study.messages
    for i in range(3):
        for name, value in alone(study, GIVEN, outputs, i, engine=engine).items():
            found = study.outputs[name][i]
            assert_allclose(found.reshape(value.shape), value, atol=1e-10 * (1e-9 + np.abs(value).max()))


def test_gears_of_a_function_that_builds_are_those_of_each_variant():
    """The force of bevel gears follows from their own module, not from that of the first variant."""

    def build(module):
        return test_gears.two(
            mg.BevelGears("g", "A", "B", teeth=(20, 30), module=module), b=(0.2, 0, 0.2), axis=(1, 0, 0)
        )

    outputs = {"F": lambda s: s.coupling("g").force}
    study = mg.study(build, {"module": [0.008, 0.01, 0.02]}, outputs, n=3, motions=GIVEN)
    turn = study.outputs["F"][:, 0, 1] * study.parameters["module"]
    assert_allclose(turn, turn[0], rtol=1e-12)
    assert len(set(study.parameters["module"])) > 1


def test_gears_that_do_not_mesh_are_told_and_do_not_stop_the_others():
    m = test_gears.two(test_gears.spur(module=0.01))
    study = mg.study(m, {"g.module": [0.01, 0.011]}, "A.effort", n=2, motions=GIVEN, sampling="grid")
    assert study.failed.tolist() == [False, True]
    assert "mesh at 0.33" in study.messages[1]


# --- curves ----------------------------------------------------------------------------------------------------------


def eccentric():
    at = np.array([0.1, np.sqrt((1 + ROLLER) ** 2 - 0.2**2), 0])
    slide = mg.Pair("F", "P", "frame", "follower", point=at, axis=Y)
    circle = mg.Curve.circle(radius=1.0, center=CENTER)
    return driven_cam(
        slide, mg.Pair("K", "Ps", "cam", "follower", curve=circle, roller=ROLLER, point=at, closed="form"), point=at
    ), at


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_radius_centre_and_roller_of_an_eccentric(engine):
    """The follower stands at ``y_c + sqrt((R + r)^2 - (0.1 - x_c)^2)``, (x_c, y_c) the center as it turns."""
    m, at = eccentric()
    given = {
        "K.curve.radius": [1.0, 0.8, 1.4, 1.01],
        "K.curve.center.x": [0.3, 0.5, 0.2, 0.31],
        "K.roller": [0.25, 0.2, 0.5, 0.26],
    }
    study = mg.study(m, given, ["F.position", "A.effort", "F.reaction"], n=3, motions=GIVEN, engine=engine)
    assert not study.failed.any(), study.messages
    for i, (R, x, r) in enumerate(np.transpose(list(study.parameters.values()))):
        y = x * np.sin(ANGLES) + np.sqrt((R + r) ** 2 - (0.1 - x * np.cos(ANGLES)) ** 2)
        assert_allclose(study.outputs["F.position"][i], y - at[1], atol=1e-12)
        s = mg.solve(study.variant(i), GIVEN, engine=engine)
        assert_allclose(study.outputs["A.effort"][i], s["A"].effort[:, 0], rtol=1e-9)
        assert_allclose(study.outputs["F.reaction"][i], s["F"].reaction, atol=1e-9)


def test_base_radius_and_samples_of_a_cam():
    """Follower of a roller: it stands at ``sqrt((rb + r)^2 - e^2)`` above the axis, and the lift; one sample changes its angle alone."""
    lobe = mg.Curve.cam.of(law(), 0.9, second=Y, roller_radius=0.2, offset=0.15)
    top = lobe.at(np.array(0.0))[0]
    m = driven_cam(
        mg.Pair("F", "P", "frame", "follower", point=top, axis=Y),
        mg.Pair("K", "Ps", "cam", "follower", curve=lobe, point=top),
        point=top,
    )
    base = {"K.curve.base_radius": [0.9, 1.0, 1.3]}
    study = mg.study(m, base, "F.position", n=3, motions=GIVEN)
    assert not study.failed.any(), study.messages
    lift = mg.solve(m, GIVEN)["F"].position[:, 0]
    for i, rb in enumerate(study.parameters["K.curve.base_radius"]):
        far = np.sqrt((rb + 0.2) ** 2 - 0.15**2) - np.sqrt(1.1**2 - 0.15**2)
        assert_allclose(study.outputs["F.position"][i], lift + far, atol=1e-11)
    at = {"A": np.array(lobe.angle)[[40, 41, 42]]}
    moved = mg.study(
        m, {"K.curve.lift[41]": lobe.lift[41] + np.array([0.0, 1e-4])}, "F.position", n=2, motions=at, sampling="grid"
    )
    assert_allclose(np.diff(moved.outputs["F.position"], axis=0)[0], [0, 1e-4, 0], atol=1e-11)


def test_variants_beside_a_curve_that_does_not_change_go_together(monkeypatch):
    """Masses, places of bearings, a function that builds: none is solved alone, and all are as they are alone."""
    m, at = eccentric()
    given = {"A": mg.Motion(np.linspace(0, 6, 7), 3.0, 1.0)}
    kept = {"drive": "A.effort", "force": "K:Fy", "center": "follower.center_acceleration"}

    def build(mass):
        return m.replace(links=[link.replace(mass=mass) if link.name == "follower" else link for link in m.links])

    monkeypatch.setattr("mechgraph.variants.work._solved_alone", None)
    for source, numbers in (
        (m, {"follower.mass": [1.0, 1.3], "A.point.x": [0.0, 1e-3], "F.point.y": [at[1], at[1] + 0.01]}),
        (build, {"mass": [1.0, 1.3]}),
    ):
        study = mg.study(source, numbers, kept, n=2, motions=given, sampling="grid")
        assert not study.failed.any()
        for i in range(len(study.failed)):
            s = mg.solve(study.variant(i), given)
            alone = s["A"].effort, s["K"].components["Fy"], s.link("follower").center_acceleration
            for found, expected in zip(study.outputs.values(), alone, strict=True):
                size = np.abs(expected).max()
                assert_allclose(found[i], expected.reshape(found[i].shape), atol=1e-11 * size)


def test_variants_with_curves_of_their_own_are_shared_out(monkeypatch):
    """Each is solved alone, in parts that all processors take; where the curve stays there is one part."""
    m, _ = eccentric()
    monkeypatch.setattr("mechgraph.variants.study.FEW_ALONE", 2)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    parts = {}
    for name, start in (("K.curve.radius", 1.0), ("follower.mass", 1.0)):
        study = mg.study(
            m,
            {name: start + 1e-3 * np.arange(5)},
            "A.effort",
            sampling="grid",
            motions={"A": mg.Motion(0.5, 3.0)},
            progress=lambda done, all_, name=name: parts.update({name: all_}),
        )
        assert not study.failed.any()
        for i in (1, 4):
            alone = mg.solve(study.variant(i), {"A": mg.Motion(0.5, 3.0)})["A"].effort
            assert_allclose(study.outputs["A.effort"][i], alone[None, 0] if alone.ndim > 1 else alone, rtol=1e-11)
    assert parts == {"K.curve.radius": 4, "follower.mass": 1}


def test_points_of_a_slot():
    """A pin in a slot through points passes each of them; one of them is moved."""
    s = np.linspace(-1, 1, 9)
    points = np.stack([s, 0.1 * s**2, 0 * s], axis=1)
    m = mg.Mechanism(
        "slot",
        None,
        [
            mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=(1, 0, 0)),
            mg.Pair("B", "P", "block", "pin", point=(0, 0, 0), axis=Y),
            mg.Pair("K", "Ps", "frame", "pin", curve=mg.Curve.through(points=points), point=(0, 0, 0)),
        ],
        ["A"],
    )
    more = np.array([0.0, 0.05])
    study = mg.study(
        m, {"K.curve.points[3].y": points[3, 1] + more}, "B.position", n=2, motions={"A": s}, sampling="grid"
    )
    assert not study.failed.any(), study.messages
    assert_allclose(study.outputs["B.position"], points[:, 1] + more[:, None] * (np.arange(9) == 3), atol=1e-12)


def test_radius_of_a_surface():
    """A sphere on a sphere is a rod of its radius."""

    def machine(radius):
        at = radius * np.array([0.6, 0.0, 0.8])
        return mg.Mechanism(
            "rod",
            None,
            [
                mg.Pair("A", "R", "frame", "crank", point=(0.1, 0, 0), axis=(0, 1, 0)),
                mg.Pair("B", "P", "crank", "slide", point=(0.1, 0, 0), axis=(0.6 * radius - 0.1, 0, 0.8 * radius)),
                mg.Pair("K", "Sp", "frame", "slide", surface=mg.Surface.sphere(radius=radius), point=at),
            ],
            ["A"],
        )

    m, radii = machine(0.5), np.array([0.5, 0.52, 0.8])
    study = mg.study(m, {"K.surface.radius": radii}, "B.position", n=3, motions={"A": np.linspace(0, 0.2, 4)})
    assert not study.failed.any(), study.messages
    along = np.array([0.2, 0.4]) / np.hypot(0.2, 0.4)
    for i, radius in enumerate(study.parameters["K.surface.radius"]):
        for angle, q in zip(np.linspace(0, 0.2, 4), study.outputs["B.position"][i], strict=True):
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            place = np.array([0.1, 0]) + turn @ (np.array([0.2, 0.4]) + q * along)
            assert np.hypot(*place) == pytest.approx(radius, abs=1e-12)


def test_materials_and_radii_of_a_contact():
    """The pressure of a line goes as the root of the modulus; the force is that of every variant."""
    m, _ = eccentric()
    pair = m.pair("K").replace(hertz=STEEL)
    m = m.replace(pairs=[pair if p.name == "K" else p for p in m.pairs])
    given = {f"K.hertz.moduli.{side}": 210e9 * np.array([1.0, 2.0, 0.5]) for side in "ab"}
    outputs = {"p": lambda s: s.contact("K").hertz.pressure, "N": lambda s: s.contact("K").normal_force}
    study = mg.study(m, given, outputs, n=3, motions=GIVEN)
    a, b = (study.parameters[f"K.hertz.moduli.{side}"] / 210e9 for side in "ab")
    factor = np.sqrt(2 * a * b / (a + b))[:, None]
    pressure = mg.solve(m, GIVEN).contact("K").hertz.pressure
    assert_allclose(study.outputs["p"], pressure * factor, rtol=1e-12)
    assert_allclose(study.outputs["N"], np.broadcast_to(study.outputs["N"][0], (3, 9)), rtol=1e-12)


def test_curves_of_a_function_that_builds():
    def build(radius):
        at = np.array([0.1, np.sqrt((radius + ROLLER) ** 2 - 0.2**2), 0])
        slide = mg.Pair("F", "P", "frame", "follower", point=at, axis=Y)
        circle = mg.Curve.circle(radius=radius, center=CENTER)
        return driven_cam(
            slide, mg.Pair("K", "Ps", "cam", "follower", curve=circle, roller=ROLLER, point=at, closed="form"), point=at
        )

    study = mg.study(build, {"radius": [0.9, 1.0, 1.1]}, "F.position", n=3, motions=GIVEN)
    assert not study.failed.any(), study.messages
    for i, R in enumerate(study.parameters["radius"]):
        y = 0.3 * np.sin(ANGLES) + np.sqrt((R + ROLLER) ** 2 - (0.1 - 0.3 * np.cos(ANGLES)) ** 2)
        assert_allclose(study.outputs["F.position"][i], y - y[0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "name", "words"),
    [
        (lambda: eccentric()[0], "K.point.x", "follows from its curve or surface"),
        (lambda: eccentric()[0], "K.curve.pitch", "no declared number"),
        (lambda: eccentric()[0], "K.curve.points[0].x", "no declared number"),
        (
            lambda: test_gears.two(test_gears.spur()),
            "g.module",
            "has the numbers teeth.a, teeth.b, pressure_angle, helix_angle",
        ),
    ],
)
def test_numbers_that_are_none_are_refused(make, name, words):
    with pytest.raises(mg.DeclarationError, match=words):
        mg.study(make(), {name: [1.0, 2.0]}, "A.effort", n=2, motions=GIVEN)


@pytest.mark.parametrize(
    ("given", "outputs", "words"),
    [
        ({"K.curve.radus": [1.0, 2.0]}, "A.effort", r"'K\.curve\.radus'.*; did you mean K\.curve\.radius\?"),
        ({"cm.mas": [1.0, 2.0]}, "A.effort", r"did you mean cam\.mass\?"),
        ({"K.curve.pitch": [1.0, 2.0]}, "A.effort", "no declared number of that name; expected e.g"),
        ({"K.roller": [0.25, 0.2]}, "A.efort", r"'A\.efort': is no quantity; did you mean A\.effort\?"),
        ({"K.roller": [0.25, 0.2]}, "Q.effort", r"'Q\.effort': there is no pair or link 'Q' \(pairs: A, F, K; links: "),
        ({"K.roller": [0.25, 0.2]}, {"x": "Q.effort"}, r"'x': 'Q\.effort': there is no pair or link 'Q'"),
    ],
)
def test_what_may_be_meant_is_named(given, outputs, words):
    with pytest.raises(mg.DeclarationError, match=words):
        mg.study(eccentric()[0], given, outputs, n=2, motions=GIVEN)


def test_numbers_with_units_are_told_from_what_is_no_sequence():
    pint = pytest.importorskip("pint")
    mm = pint.UnitRegistry().mm
    m = eccentric()[0].replace(units={"length": "m"})
    for given in ([250 * mm, 200 * mm], np.array([250, 200]) * mm, 250 * mm):
        with pytest.raises(mg.DeclarationError, match=r"'K\.roller' = .*: has units; a study takes plain numbers"):
            mg.study(m, {"K.roller": given}, "A.effort", n=2, motions=GIVEN)


def test_variants_in_other_units_are_refused():
    """Their numbers are others: they would stand side by side with those of the first."""

    def build(size):
        m = eccentric()[0].replace(units={"length": "m", "mass": "kg", "time": "s"})
        return m.to_units(length="mm") if size > 1 else m

    study = mg.study(build, {"size": [0.5, 0.6, 2.0]}, "F.position", motions=GIVEN, sampling="grid")
    assert study.failed.tolist() == [False, False, True]
    assert "differs in links, pairs, drives, loads or units" in study.messages[2]


def test_a_radius_of_a_ball_varies():
    """It was taken for a number that kernels read, and failed."""
    plane = mg.Pair("K", "Sp", "frame", "ball", point=(0, 0, 0), axis=Z, radius=0.1)
    hold = mg.Pair("A", "P", "frame", "ball", point=(0, 0, 0), axis=(1, 0, 0))
    m = mg.Mechanism("ball", None, [hold, plane], ["A"])
    height = {"z": lambda s: s.contact("K").point[..., 2]}
    study = mg.study(m, {"K.radius": [0.1, 0.2]}, height, n=2, motions={"A": [0.0, 1.0]}, sampling="grid")
    assert_allclose(study.outputs["z"], [[-0.1, -0.1], [-0.2, -0.2]], atol=1e-15)


@pytest.mark.parametrize("what", ["curve", "face"])
def test_curves_in_contact_by_markers_are_those_by_a_point(what):
    """The curve of link b stands where ``on_b`` is, in the frame of link b; assembled from there."""
    at = CENTER + np.array([0, 1.0, 0])
    bearing = mg.Pair("F", "P", "frame", "follower", point=at, axis=Y)
    other = mg.Curve.circle(radius=0.5, center=(0.3, 1.5, 0)) if what == "curve" else None
    circle = mg.Curve.circle(radius=1.0, center=CENTER)
    pair = mg.Pair("K", "Kc", "cam", "follower", curve=circle, curve_b=other, point=at)
    on_b = pair.markers[1] if other is None else mg.Marker(at, Z, (-1, 0.3, 0))
    apart = mg.Pair("K", "Kc", "cam", "follower", curve=circle, curve_b=other, on_b=on_b)
    one, two = (driven_cam(bearing, p, point=at) for p in (pair, apart))
    start = pair.type.steps[0].home
    a, b = mg.solve(one, GIVEN), mg.solve(two.replace(start={"K.Ts": start}), GIVEN)
    assert_allclose(a["F"].position, b["F"].position, atol=1e-12)
    assert_allclose(a["K"].reaction, b["K"].reaction, atol=1e-9)
    assert_allclose(a["K"].position[:, 0] + start, b["K"].position[:, 0], atol=1e-12)
