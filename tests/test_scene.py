"""Scenes: what a picture of a mechanism shows, as arrays; checked against the motion of the links and the rows of the pair table."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.path import Path
from numpy.testing import assert_allclose

import mechgraph as mg
from mechgraph import show
from mechgraph.show.scene import DrawnPart, Scene, scene
from mechgraph.show.shapes import frame_along, symbol
from mechgraph.show.wheels import DrawnMesh, Wheel, belt_path, gears_of, interleaved

Z = (0.0, 0.0, 1.0)


def solved(name: str) -> mg.Solution | mg.Mechanism:
    try:
        return mg.solve(mg.load(name))
    except mg.MechgraphError:
        return mg.load(name)


def parts(found: Scene, role: str, owner: str = "") -> list[DrawnPart]:
    return [p for p in found.parts if p.role == role and p.owner.startswith(owner)]


@pytest.mark.daily(5)
@pytest.mark.parametrize("name", mg.library())
def test_scenes_of_the_library(name: str) -> None:
    """Every pair has a symbol, every moving link a body; polygons and lines name vertices that are there, and rigid frames are rigid."""
    drawn = solved(name)
    found = scene(drawn, forces=True)
    m = found.mechanism
    assert {p.owner for p in found.parts if p.role in ("body", "dark")} == {p.name for p in m.pairs}
    ends = {
        link: {tuple(np.round(x[0], 9)) for (_, end), x in found.points.items() if end == link}
        for link in m.link_names()
    }
    apart = {link for link, points in ends.items() if link != m.frame and len(points) > 1}
    assert {p.owner for p in parts(found, "link")} >= apart
    for part in found.parts:
        n = len(part.shape.vertices)
        assert {i for row in (*part.shape.faces, *part.shape.lines) for i in row} <= set(range(n))
        assert found.frames[part.frame].shape == (len(found.positions), 3, 4)
    for key, X in found.frames.items():
        if key.startswith(("link:", "pair:")):
            R = X[:, :, :3]
            assert np.allclose(np.swapaxes(R, 1, 2) @ R, np.eye(3), atol=1e-9)
    if isinstance(drawn, mg.Solution):
        for pair in m.pairs:
            end = found.frames[f"pair:{pair.name}@{pair.type.f}"][:, :, 3]
            there = drawn.link(pair.b).point(pair.markers[1].point).position.reshape(-1, 3)[found.positions]
            assert np.allclose(end, there, atol=1e-8 * found.size)


def test_links_are_what_they_join() -> None:
    """A rod between two pair points; a plate between more, which holds the named points too; no plate of points on a line."""
    corners = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (3, 2, 0), "D": (3, 0, 0)}
    links = [
        mg.Link("frame"),
        mg.Link("crank"),
        mg.Link("coupler", points={"eye": (2, 3, 0)}),
        mg.Link("rocker", points={"mid": (3, 1, 0)}),
    ]
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    m = mg.Mechanism("four-bar", links, [mg.Pair(k, "R", *ends[k], point=p, axis=Z) for k, p in corners.items()], ["A"])
    found = scene(mg.kinematics(m, {"A": np.linspace(0, 0.4, 3)}))
    (plate,) = parts(found, "plate")
    assert plate.owner == "coupler"
    assert np.allclose(sorted(found.vertices(plate, 0).tolist()), [[1, 0, 0], [2, 3, 0], [3, 2, 0]])
    assert found.normal is not None
    assert np.allclose(found.normal, Z)
    assert {label.text for label in found.labels} >= {"A (R)", "coupler", "coupler.eye", "rocker.mid"}


def test_a_plane_position_of_a_spatial_mechanism_is_no_plane_mechanism() -> None:
    assert scene(mg.load("haug-slider-crank")).normal is None
    assert scene(mg.load("slider-crank")).normal is not None


def test_points_on_one_line_lie_in_the_plane_in_which_things_turn_and_slide() -> None:
    """A slider-crank stretched out is seen along its pins; with pins of two directions, or a slide along a pin, it is in space."""
    x, y, z = np.eye(3)

    def stretched(last_pin: np.ndarray, slide: np.ndarray) -> mg.Mechanism:
        pairs = [
            mg.Pair(k, "R", a, b, point=(i, 0, 0), axis=z)
            for i, (k, a, b) in enumerate([("A", "frame", "u"), ("B", "u", "v")])
        ]
        pairs.append(mg.Pair("C", "R", "v", "w", point=(2, 0, 0), axis=last_pin))
        return mg.Mechanism("m", pairs=[*pairs, mg.Pair("D", "P", "frame", "w", point=(3, 0, 0), axis=slide)])

    flat = scene(stretched(z, x)).normal
    assert flat is not None
    assert np.allclose(flat, z)
    for lost in (stretched(y, x), stretched(z, z), stretched(x, x)):
        assert scene(lost).normal is None


def test_symbols_follow_from_the_rows() -> None:
    """Guides where something slides, one drum a turn, balls where a rotation is kept, dashes where nothing touches: for every row alike."""
    roles = {}
    for key, row in mg.pair_types().items():
        pieces = symbol(row, 0.1, 1.0, [(-0.5, 2.0)] * row.f)
        assert pieces, key
        roles[key] = [e.role for e in pieces]
        assert all(e.dashed for e in pieces) == (sum(not f.turns for f in row.freedoms) == 3)
        assert ("guide" in roles[key]) == (0 < sum(not f.turns for f in row.freedoms) < 3)
    assert roles["R"] == ["body"]
    assert roles["H"] == ["body", "dark", "body"]
    assert roles["S"] == ["dark"]
    assert roles["U"] == ["dark", "body", "body"]
    own = mg.PairType("Pin", "pin in a slot", freedoms=["Tx", "Rz"])
    assert [e.role for e in symbol(own, 0.0, 1.0, [(0, 1), (0, 0)])] == ["guide", "body"]


def test_a_guide_covers_the_stroke() -> None:
    m = mg.load("slider-crank")
    s = mg.kinematics(m)
    found = scene(s)
    pair = next(p for p in m.pairs if p.type.symbol == "P")
    (guide,) = parts(found, "guide")
    along = found.vertices(guide, 0) @ found.frames[guide.frame][0][:, 2]
    block = found.points[pair.name, pair.b] @ found.frames[guide.frame][0][:, 2]
    assert along.min() < block.min()
    assert along.max() > block.max()


def test_springs_reach_from_end_to_end_and_forces_end_where_they_act() -> None:
    links = [
        mg.Link("body", points={"seat": (0.1, -0.3, 0)}),
        mg.Link("lid", 2.0, (0.5, 0, 0), points={"eye": (0.4, 0, 0)}),
    ]
    lid = mg.Mechanism("lid", links,
        [mg.Pair("A", "R", "body", "lid", point=(0, 0, 0), axis=Z)], ["A"], [
            mg.Spring("body", "lid", "seat", "eye", stiffness=100.0), mg.Wrench("lid", force=(0, -5, 0), point="eye", frame="link"),
            mg.TorsionSpring("A", stiffness=2.0), mg.Damper("A", coefficient=1.0), mg.Effort("A", -3.0),
            mg.ForceLaw(("body", "lid", "seat", "eye"), law=lambda x, v, t: 0 * x),
        ])  # fmt: skip
    s = mg.solve(lid, {"A": np.linspace(0, 1, 5)})
    for found in (scene(s), scene(lid)):
        T = len(found.positions)
        eye = s.link("lid").at("eye").position[:T]
        spring, force = found.frames["load:0"], found.frames["load:1:force"]
        assert np.allclose(spring[:, :, 3] + spring[:, :, 2], eye)
        assert np.allclose(force[:, :, 3] + force[:, :, 2], eye)
        R = s.link("lid").pose[:T, :3, :3]
        assert np.allclose(frame_along(force[:, :, 2])[..., 2], -R[:, :, 1])
        assert np.allclose(frame_along(found.frames["load:4:moment"][:, :, 2])[..., 2], [0, 0, -1])
        assert len(parts(found, "spring")) == 4


def test_a_spring_along_a_direction_is_drawn_along_it() -> None:
    """From the foot of its first point on the line through the second: two units to the right, whatever the height."""
    slide = mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=(1, 1, 0))
    spring = mg.Spring("frame", "block", (-2, 5, 0), (0, 0, 0), 9.0, along=(3, 0, 0))
    m = mg.Mechanism("block", [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))], [slide], ["P"], [spring])
    X = scene(mg.kinematics(m, {"P": [0.0, np.sqrt(2)]})).frames["load:0"]
    np.testing.assert_allclose(X[:, :, 3], [[-2, 0, 0], [-2, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(X[:, :, 2], [[2, 0, 0], [3, 0, 0]], atol=1e-12)


def test_mass_centers_are_left_out_where_asked() -> None:
    m = mg.load("four-bar")
    assert {p.role for p in scene(m).parts} - {p.role for p in scene(m, centers=False).parts} == {"center", "tie"}


def test_a_guide_of_a_plane_mechanism_stands_on_hatched_ground() -> None:
    """Under its guide, as long as that; a pin of the frame keeps its foot, and there is none at the slide."""
    found = scene(mg.kinematics(mg.load("slider-crank")))
    guide, *feet = parts(found, "guide") + parts(found, "foot")
    ground = [foot for foot in feet if foot.frame.startswith("pair:")]
    assert (len(feet), len(ground)) == (2, 1)
    along = [found.vertices(part, 0)[:, 0] for part in (guide, ground[0])]
    assert along[1].max() == pytest.approx(along[0].max())
    assert found.vertices(ground[0], 0)[:, 1].max() == pytest.approx(found.vertices(guide, 0)[:, 1].min())


def test_reactions_of_a_plane_mechanism_are_drawn_in_its_plane_and_others_only_where_unique() -> None:
    """Along the axes of a four-bar nothing is unique, in its plane all is; a spherical one has no force that is known."""
    s = mg.solve(mg.load("four-bar"))
    found = scene(s, forces=True)
    assert found.not_unique == ()
    arrow = found.frames["reaction:A"][7]
    assert np.allclose(arrow[:2, 2], found.reaction_scale * s["A"].force[7, :2])
    assert arrow[2, 2] == pytest.approx(0.0, abs=1e-12)
    spherical = scene(mg.solve(mg.load("spherical-four-bar")), forces=True)
    assert spherical.not_unique == ("A", "B", "C", "D")
    assert np.isnan(spherical.frames["reaction:A"]).any(axis=(1, 2)).all()


@pytest.mark.parametrize("planar", [True, False])
def test_a_cylinder_between_two_eyes_has_a_barrel_and_a_rod_that_fit(planar: bool) -> None:
    """Its piston stays in the barrel, which ends before the eye of the rod, at both ends of the stroke; the rod begins at the piston."""
    z = {} if planar else {"axis": Z}
    a, b, pivot = ((0.3, -1), (1, 0.2), (0, 0)) if planar else ((0.3, -1, 0), (1, 0.2, 0), (0, 0, 0))
    boom = mg.Pair("A", "R", "frame", "boom", point=pivot, **z)  # type: ignore[arg-type]
    jack = mg.parts.cylinder("jack", "frame", a, "boom", b)
    m = mg.Mechanism("crane", pairs=[boom], parts=[jack], drives=["jack.lift.Tz"], planar=planar)
    stroke = np.linspace(0.0, 0.4, 5)
    found = scene(mg.kinematics(m, {"jack.lift.Tz": stroke}))
    (barrel,), (piston,), (rod,) = (
        parts(found, "guide"),
        parts(found, "body", "jack.lift"),
        parts(found, "link", "jack.rod"),
    )
    for t in range(5):
        eye, head = found.points["jack.a", "jack.tube"][t], found.points["jack.b", "boom"][t]
        u = (head - eye) / np.linalg.norm(head - eye)
        low, high = np.sort((found.vertices(barrel, t) - eye) @ u)[[0, -1]]
        inner = np.sort((found.vertices(piston, t) - eye) @ u)[[0, -1]]
        assert low < inner[0] < inner[1] <= high + 1e-9
        assert high < np.linalg.norm(head - eye)
        ends = np.sort((found.vertices(rod, t) - eye) @ u)[[0, -1]]
        assert inner[0] < ends[0] < inner[1]
        assert ends[1] == pytest.approx(np.linalg.norm(head - eye))


# --- gears, pulleys, belts and cams: teeth that fit, lengths of belts in closed form, profiles that rollers touch -------


def train(teeth: tuple[int, ...], module: float = 2.0, **more: object) -> mg.Mechanism:
    """Wheels in a row, each on a pair R of its own."""
    xs = np.concatenate([[0.0], np.cumsum([module * (a + b) / 2 for a, b in pairwise(teeth)])])
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"w{i}", point=(x, 0, 0), axis=Z) for i, x in enumerate(xs)]
    meshes = [
        mg.SpurGears(f"g{i}", f"A{i}", f"A{i + 1}", teeth=both, module=module, **more)  # type: ignore[arg-type]
        for i, both in enumerate(pairwise(teeth))
    ]
    return mg.Mechanism("train", pairs=pairs, couplings=meshes, drives=["A0"])


def outlines(found: Scene, t: int) -> list[np.ndarray]:
    """Outlines of toothed wheels at a position, in the plane: the first line of each."""
    toothed = [p for p in parts(found, "wheel") if p.scales[0] > 0]
    return [found.vertices(p, t)[list(p.shape.lines[0]), :2] for p in toothed]


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    """By how much points of one outline lie inside of another, at most."""
    inside = Path(other).contains_points(one)
    return float(away(one[inside], other).max(initial=0.0))


def away(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distances of points from a line through others."""
    begin, d = line[:-1], np.diff(line, axis=0)
    p = points[:, None]
    u = np.clip(((p - begin) * d).sum(axis=2) / np.maximum((d * d).sum(axis=1), 1e-30), 0, 1)
    return np.asarray(np.linalg.norm(p - begin - u[..., None] * d, axis=2).min(axis=1))


def test_teeth_of_a_train_stand_in_each_other_s_gaps_wherever_it_stands() -> None:
    """Flanks are involutes: over the turn of a tooth they touch and do not cut, but for the chords of their outlines."""
    m = train((20, 40, 25))
    found = scene(mg.kinematics(m, {"A0": np.linspace(0.0, 2 * np.pi / 20, 9)}))
    for t in range(9):
        a, b, c = outlines(found, t)
        assert max(overlap(a, b), overlap(b, a), overlap(b, c), overlap(c, b)) < 0.02 * 2.0
        tips = [np.linalg.norm(x - x[:-1].mean(axis=0), axis=1) for x in (a, b, c)]
        np.testing.assert_allclose([r.max() for r in tips], [22.0, 42.0, 27.0], atol=1e-6)
        np.testing.assert_allclose([r.min() for r in tips], [17.5, 37.5, 22.5], atol=1e-6)


def test_teeth_half_a_pitch_off_would_cut() -> None:
    """The check of the test above fails where the phase is wrong."""
    m = train((20, 40))
    found = scene(mg.kinematics(m, {"A0": [0.0]}))
    a, b = outlines(found, 0)
    half = np.pi / 20
    turned = a @ np.array([[np.cos(half), np.sin(half)], [-np.sin(half), np.cos(half)]])
    assert overlap(turned, b) > 0.3 * 2.0


def test_a_pinion_inside_a_ring() -> None:
    pairs = [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=Z) for k, x in (("p", 0.0), ("ring", 30.0))]
    ring = mg.SpurGears("g", "p", "ring", teeth=(20, 50), module=2.0, internal=True)
    m = mg.Mechanism("ring", pairs=pairs, couplings=[ring], drives=["p"])
    found = scene(mg.kinematics(m, {"p": np.linspace(0.0, 0.3, 4)}))
    for t in range(4):
        pinion, hole = outlines(found, t)
        radii = np.linalg.norm(hole - [30.0, 0.0], axis=1)
        assert (radii.min(), radii.max()) == pytest.approx((48.0, 52.5))
        assert Path(hole).contains_points(pinion).mean() > 0.9
        near = np.abs(np.linalg.norm(pinion - [30.0, 0.0], axis=1) - 50.0) < 1.0
        outside = pinion[near & ~Path(hole).contains_points(pinion)]
        assert not len(outside) or overlap(outside, np.concatenate([hole, 1e3 * hole[:1]])) < 0.2


def test_thickness_of_a_shifted_tooth_at_the_pitch_circle() -> None:
    """``s / r = (pi / 2 + 2 x tan a) / (z / 2)`` at the pitch circle, where ``inv`` of both angles cancel; more below, less above."""
    a, x, m, z = np.deg2rad(20.0), 0.3, 3.0, 30
    wheel = Wheel("g", "w", np.zeros(3), np.eye(3), z, m * z / 2, m, shift=x)
    half, h = wheel.flank()
    base = m * z / 2 * np.cos(a)
    inv = np.tan(a) - a
    r = wheel.radius + h
    whole = r > base + 1e-9
    angle = np.arccos(base / r[whole])
    expected = (np.pi / 2 + 2 * x * np.tan(a)) / z + inv - (np.tan(angle) - angle)
    np.testing.assert_allclose(half[whole] * 2 * np.pi / z, expected)
    assert h.max() == pytest.approx(m * (1 + x))


@pytest.mark.parametrize("kind", ["cone", "rack", "worm"])
def test_other_wheels_interleave_at_the_pitch_point(kind: str) -> None:
    """Where pitch lines meet, a tooth of one is in the middle of a gap of the other."""
    I = np.eye(3)
    first = Wheel("a", "a", np.zeros(3), I, 20, 10.0, 1.0, phase=0.13)
    point, along = np.array([10.0, 0, 0]), np.array([0.0, 1.0, 0])
    if kind == "cone":
        first = Wheel("a", "a", np.zeros(3), I, 20, 10.0, 1.0, phase=0.13, cone=np.pi / 4)
        other = Wheel(
            "b",
            "b",
            np.array([0.0, 0, 0]),
            np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]),
            20,
            10.0,
            1.0,
            cone=np.pi / 4,
        )
        other = Wheel("b", "b", np.array([10.0, 0, -10]), other.axes, 20, 10.0, 1.0, cone=np.pi / 4)
    elif kind == "rack":
        axes = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
        other = Wheel("b", "b", point, axes, 1, np.inf, 1.0, length=60.0)
    else:
        axes = np.array([[-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])
        other = Wheel("b", "b", np.array([15.0, 0, 0]), axes, 1, 5.0, 1.0, helix=np.pi / 2 - 0.1, length=20.0)
    poses = {"a": np.eye(3, 4), "b": np.eye(3, 4)}
    found = interleaved([first, other], [DrawnMesh(0, 1, point, along)], poses)
    u, v = (float(w.count(point)) for w in found)
    ahead = [float(w.count(point + 1e-4 * along)) for w in found]
    sense = np.sign([ahead[0] - u, ahead[1] - v])
    assert (sense[0] * u - sense[1] * v) % 1.0 == pytest.approx(0.5)
    for wheel in found:
        for flat in (True, False):
            shape = wheel.toothed(flat)
            assert np.isfinite(shape.vertices).all()
            assert {i for row in (*shape.faces, *shape.lines) for i in row} <= set(range(len(shape.vertices)))


def stage(distance: float, **more: object) -> mg.Mechanism:
    """20 and 40 teeth of module 2 at a distance."""
    at = {"p": (0.0, 0.0, 0.0), "w": (distance, 0.0, 0.0)}
    gears = [mg.Gear(k, k, n, at[k], Z, module=2.0, **more) for k, n in (("p", 20), ("w", 40))]  # type: ignore[arg-type]
    pairs = [mg.Pair(k, "R", "frame", k, point=p, axis=Z) for k, p in at.items()]
    return mg.Mechanism("stage", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", "p", "w")], drives=["p"])


def test_gears_further_apart_have_backlash_on_both_sides() -> None:
    """At 61.2 teeth keep clear of each other by half the backlash along the normal, ``2 a (inv aw - inv a) cos aw``, on either side."""
    found = scene(mg.kinematics(stage(61.2), {"p": np.linspace(0.0, 0.3, 5)}))
    aw, a = np.arccos(60.0 * np.cos(np.deg2rad(20.0)) / 61.2), np.deg2rad(20.0)
    play = 2 * 61.2 * (np.tan(aw) - aw - np.tan(a) + a) * np.cos(aw)
    for t in range(5):
        p, w = outlines(found, t)
        assert overlap(p, w) == overlap(w, p) == 0.0
        assert away(p, w).min() == pytest.approx(play / 2, rel=0.05)


def test_marked_teeth_stay_where_they_are_declared() -> None:
    """Nothing is turned so that they fit: a mark that points up, and one half a pitch off that, stand in gaps as they are."""
    m = stage(60.0)
    p, w = m.gears
    up, off = (0.0, 1.0, 0.0), (np.sin(np.pi / 40), np.cos(np.pi / 40), 0.0)
    found = scene(mg.kinematics(m.replace(gears=[p.replace(mark=up), w.replace(mark=off)]), {"p": [0.0, 0.1]}))
    for outline, center, mark in zip(outlines(found, 0), ([0.0, 0.0], [60.0, 0.0]), (up, off), strict=True):
        above = (outline - center)[:-1] @ np.array([[mark[1], mark[0]], [-mark[0], mark[1]]])
        tip = above[above[:, 1] > above[:, 1].max() - 1e-6]
        assert tip[:, 0].mean() == pytest.approx(0.0, abs=1e-9)
    for t in range(2):
        a, b = outlines(found, t)
        assert max(overlap(a, b), overlap(b, a)) < 0.02 * 2.0


def test_planets_mesh_with_sun_and_ring() -> None:
    """Phases go from wheel to wheel; (24 + 60) / 3 is whole, so that the last planet fits too."""
    at = {f"p{i}": 42.0 * np.array([np.cos(a), np.sin(a), 0.0]) for i, a in enumerate(2 * np.pi * np.arange(3) / 3)}
    pairs = [mg.Pair(k, "R", "frame", k, point=(0, 0, 0), axis=Z) for k in ("sun", "arm")]
    pairs += [mg.Pair(k, "R", "arm", k, point=p, axis=Z) for k, p in at.items()]
    gears = [
        mg.Gear("sun", "sun", 24, (0, 0, 0), Z, module=2.0),
        mg.Gear("ring", "frame", 60, (0, 0, 0), Z, module=2.0, internal=True),
    ]
    gears += [mg.Gear(k, k, 18, p, Z, module=2.0) for k, p in at.items()]
    meshes = [mg.Mesh(f"{k} {other}", k, other) for k in at for other in ("sun", "ring")]
    m = mg.Mechanism("set", pairs=pairs, gears=gears, couplings=meshes, drives=["sun"], frame="frame")
    found = scene(mg.kinematics(m, {"sun": np.linspace(0.0, 1.0, 3)}))
    toothed = {p.owner: p for p in parts(found, "wheel") if p.scales[0] > 0}
    for t in range(3):
        line = {k: found.vertices(p, t)[list(p.shape.lines[0]), :2] for k, p in toothed.items()}
        for k in at:
            assert max(overlap(line[k], line["sun"]), overlap(line["sun"], line[k])) < 0.02 * 2.0
            near = line[k][np.linalg.norm(line[k], axis=1) > 59.0]
            stuck = near[~Path(line["ring"]).contains_points(near)]
            assert not len(stuck) or away(stuck, line["ring"]).max() < 0.02 * 2.0


@pytest.mark.parametrize("kind", ["rack", "bevel", "worm", "screw"])
def test_every_kind_of_mesh_is_drawn_with_teeth_that_interleave(kind: str) -> None:
    """At the pitch point, a whole motion long, tooth stands against gap."""
    x, z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    b, r = np.pi / 4, 20.0 / np.cos(np.pi / 4)
    made = {
        "rack": (("R", (0, 0, 0), z), ("P", (0, -30, 0), x), mg.Gear("a", "a", 20, (0, 0, 0), z, module=2.0),
                 mg.GearRack("b", "b", (5, -20, 0), x, (0, 1, 0), module=2.0)),
        "bevel": (("R", (90, 0, 0), x), ("R", (0, 0, 90), z), mg.BevelGear("a", "a", 20, (90, 0, 0), x, module=4.0),
                  mg.BevelGear("b", "b", 40, (0, 0, 90), z, module=4.0)),
        "worm": (("R", (0, 0, 0), x), ("R", (0, 50, 0), z), mg.Worm("a", "a", 2, (0, 0, 0), x, radius=10.0),
                 mg.WormWheel("b", "b", 40, (0, 50, 0), z)),
        "screw": (("R", (0, 0, 0), x), ("R", (0, 0, 2 * r), (0, 1, 0)), mg.Gear("a", "a", 20, (0, 0, 0), x, module=2.0, helix_angle=b),
                  mg.Gear("b", "b", 20, (0, 0, 2 * r), (0, 1, 0), module=2.0, helix_angle=b)),
    }[kind]  # fmt: skip
    pairs = [
        mg.Pair(k, symbol, "frame", k, point=p, axis=axis) for k, (symbol, p, axis) in zip("ab", made[:2], strict=True)
    ]
    m = mg.Mechanism(kind, pairs=pairs, gears=made[2:], couplings=[mg.Mesh("m", "a", "b")], drives=["a"])
    s = mg.solve(m, {"a": np.linspace(0.0, 0.7, 5)}, loads=[mg.Effort("b", 1.0)])
    found = scene(s)
    assert {p.owner for p in parts(found, "wheel") if p.scales[0] > 0} == {"a", "b"}
    poses = {k: s.link(k).pose[:, :3] for k in "ab"}
    wheels = {w.name: w for w in gears_of(m, {k: np.eye(3, 4) for k in ("frame", "a", "b")})[0]}
    P = s.coupling("m").point
    for t in range(5):
        counts, senses = [], []
        for k in "ab":
            own = [
                (q - poses[k][t, :, 3]) @ poses[k][t, :, :3]
                for q in (P[t], P[t] + 1e-4 * np.cross(x if kind != "rack" else z, P[0]))
            ]
            here, ahead = (float(wheels[k].count(q)) for q in own)
            counts.append(here)
            senses.append(np.sign(ahead - here))
        assert (senses[0] * counts[0] - senses[1] * counts[1]) % 1.0 == pytest.approx(0.5, abs=1e-6)


def test_length_and_wrap_of_belts() -> None:
    """20 and 40 teeth of pitch 5 at 200: length 551.2672, wrap of the small pulley 170.8714 degrees; crossed 561.4537."""
    radii = [20 * 5 / (2 * np.pi), 40 * 5 / (2 * np.pi)]
    centers = np.array([[0.0, 200.0], [0, 0], [0, 0]])[:, :, None]
    for senses, length in (((1.0, 1.0), 551.2672), ((1.0, -1.0), 561.4537)):
        path, number = belt_path(centers, np.array(Z)[:, None], np.array(radii) * senses)
        steps = np.linalg.norm(np.diff(np.concatenate([path, path[:, :1]], axis=1), axis=1), axis=2)[0]
        on = number % 1 > 0
        # arcs are drawn by chords: c = 2 r sin(arc / 2 r)
        r = np.array([radii[int(np.ceil(k)) % 2] for k in number[on]])
        assert steps[~on].sum() + (2 * r * np.arcsin(steps[on] / (2 * r))).sum() == pytest.approx(length, abs=1e-4)
        if senses == (1.0, 1.0):
            first = r == radii[0]
            assert np.rad2deg((2 * np.arcsin(steps[on] / (2 * r)))[first].sum()) == pytest.approx(170.8714, abs=1e-4)


def test_the_tight_strand_of_a_belt_is_the_thick_one() -> None:
    """The driven pulley is held back by -3 or 3, so that one strand or the other draws it: tension M / r = 15."""
    pairs = [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=Z) for k, x in (("A", 0.0), ("B", 0.5))]
    for load in (-3.0, 3.0):
        m = mg.Mechanism(
            "belt",
            pairs=pairs,
            couplings=[mg.Belt("g", "A", "B", radii=(0.1, 0.2))],
            drives=["A"],
            loads=[mg.Effort("B", load)],
        )
        s = mg.solve(m, {"A": [0.0, 1.0]})
        assert np.linalg.norm(s.coupling("g").force, axis=1) == pytest.approx(15.0)
        found = scene(s)
        strands = {p.frame: found.frames[p.frame][0] for p in parts(found, "strand")}
        width = {frame: np.linalg.norm(X[:, 0]) / found.symbol for frame, X in strands.items()}
        long = sorted(strands, key=lambda frame: -np.linalg.norm(strands[frame][:, 2]))[:2]
        upper, lower = sorted(long, key=lambda frame: -strands[frame][1, 3])
        # a moment of -3 turns B clockwise; A has to hold it, through the upper strand
        tight, slack = (lower, upper) if load > 0 else (upper, lower)
        assert (width[tight], width[slack]) == pytest.approx((0.2, 0.07))
    plain = scene(m)  # no forces are known
    assert len({np.linalg.norm(plain.frames[p.frame][0][:, 0]).round(12) for p in parts(plain, "strand")}) == 1


def test_a_belt_follows_its_tensioner_and_swells_with_its_tensions() -> None:
    """Around two pulleys and under an idler on its back; the lower strand has 258 N, the others 353 N (docs/how-to/belts.md)."""
    at = {"p": (0, 0, 0), "w": (0.2, 0, 0), "i": (0.1, 0.035, 0)}
    radii = {"p": 0.1 / (2 * np.pi), "w": 0.2 / (2 * np.pi), "i": 0.02}
    pairs = [mg.Pair(k, "R", "arm" if k == "i" else "frame", k, point=p, axis=Z) for k, p in at.items()]
    pairs.append(mg.Pair("arm", "R", "frame", "arm", point=(0.16, 0.06, 0), axis=Z))
    m = mg.Mechanism(
        "belt", pairs=pairs, gears=[mg.Pulley(k, k, p, Z, radius=radii[k]) for k, p in at.items()], drives=["p"], frame="frame",
        couplings=[mg.BeltDrive("b", over=["w", "i", "p"], backs=["i"])], loads=[mg.Effort("w", -3.0), mg.Effort("arm", 4.0)],
    )  # fmt: skip
    s = mg.solve(m, {"p": np.linspace(0.0, 2.0, 4)})
    found = scene(s)
    strands = [found.frames[p.frame] for p in parts(found, "strand")]
    ends = np.stack([X[:, :, 3] for X in strands], axis=1)
    for k, r in radii.items():
        away_from = np.linalg.norm(ends - s.link(k).point(at[k]).position[:, None], axis=2)
        assert away_from.min(axis=1) == pytest.approx(np.full(4, r))
        assert (np.abs(away_from - r) < 1e-9).sum(axis=1).tolist() == [25] * 4
    spans = sorted(strands, key=lambda X: -np.linalg.norm(X[0, :, 2]))[:3]
    wide = {round(float(X[0, 1, 3] + X[0, 1, 2] / 2), 3): np.linalg.norm(X[0, :, 0]) / found.symbol for X in spans}
    low, *others = (wide[y] for y in sorted(wide))
    assert others == pytest.approx([0.2, 0.2], rel=1e-6)
    assert low == pytest.approx(0.07 + 0.13 * 258.287 / 352.535, abs=1e-5)
    assert len(parts(found, "wheel")) == 2 * 3


def test_teeth_are_drawn_where_they_are_large_enough() -> None:
    """From 8 pixels a tooth on; else the pitch circle as a disc."""
    s = mg.kinematics(train((20, 40)), {"A0": [0.0]})
    found = scene(s)
    toothed, plain = parts(found, "wheel", "g0.a")[:2]
    assert toothed.scales == (8 / (np.pi * 2.0), np.inf)
    assert plain.scales == (0.0, 8 / (np.pi * 2.0))
    counts = {}
    for size in ((6.0, 4.0), (1.0, 0.8)):
        ax = show.canvas.new_axes(size)
        show.draw_skeleton(s, ax=ax, labels=False)
        lines = [c for c in ax.collections if str(c.get_gid()).startswith("wheel")]
        counts[size] = max(len(path.vertices) for c in lines for path in c.get_paths())
    assert counts[6.0, 4.0] > 300
    assert counts[1.0, 0.8] < 100


def test_a_roller_touches_the_profile_of_its_cam_wherever_it_stands() -> None:
    u = np.linspace(0, 2 * np.pi, 73)
    lift, slope, bend = 5 - 5 * np.cos(u), 5 * np.sin(u), 5 * np.cos(u)
    cam = mg.Curve.cam(angle=u, lift=lift, slope=slope, bend=bend, base_radius=30, roller_radius=8, second=(0, 1, 0))
    m = mg.Mechanism("cam", pairs=[
        mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z), mg.Pair("F", "P", "frame", "rod", point=(0, 60, 0), axis=(0, 1, 0)),
        mg.Pair("B", "Ps", "cam", "rod", curve=cam, point=(0, 38, 0), closed="force"),
    ], drives=["A"])  # fmt: skip
    found = scene(mg.kinematics(m, {"A": np.linspace(0, 5, 7)}))
    (profile,), (roller,) = parts(found, "wheel", "B"), parts(found, "roller")
    for t in range(7):
        outline = found.vertices(profile, t)[list(profile.shape.lines[0])]
        center = found.frames[roller.frame][t, :, 3]
        assert away(center[None], outline).min() == pytest.approx(8.0, abs=1e-2)
        assert np.ptp(found.vertices(roller, t)[:, 0]) == pytest.approx(16.0, rel=0.01)
    corners = np.array([profile.shape.vertices[list(face)] for face in profile.shape.faces])
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    x, y = profile.shape.vertices[:, :2].T
    assert area == pytest.approx(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)
    assert not [p for p in parts(found, "link") if p.owner == "cam"]


def test_a_roller_runs_between_the_walls_of_its_groove() -> None:
    """On a barrel: both walls are a radius away from the middle of the roller, wherever it stands."""
    law = mg.CamLaw([mg.Segment("cycloidal", 20.0, np.pi), mg.Segment("cycloidal", -20.0, np.pi)])
    groove = mg.Curve.barrel(law=law, radius=50.0, roller_radius=6.0, second=(1, 0, 0))
    m = mg.Mechanism("barrel", pairs=[
        mg.Pair("A", "R", "frame", "barrel", point=(0, 0, 0), axis=Z), mg.Pair("B", "P", "frame", "rod", point=(50, 0, 0), axis=Z),
        mg.Pair("K", "Rg", "barrel", "rod", curve=groove, point=(50, 0, 0)),
    ], drives=["A"])  # fmt: skip
    found = scene(mg.kinematics(m, {"A": np.linspace(0.1, 3.0, 4)}))
    (body,), (dark,) = parts(found, "wheel", "K"), parts(found, "dark", "K")
    _, *walls, _ = dark.shape.lines
    assert len(walls) == 2
    for t in range(4):
        center = found.points["K", "rod"][t]
        for wall in walls:
            assert away(center[None], found.vertices(dark, t)[list(wall)])[0] == pytest.approx(6.0, rel=0.03)
    skin = np.concatenate([body.shape.vertices, dark.shape.vertices])
    np.testing.assert_allclose(np.hypot(skin[:, 0], skin[:, 1]), 50.0, rtol=1e-6)
    assert (skin[:, 2].min(), skin[:, 2].max()) == pytest.approx((-12.0, 32.0), abs=0.01)
    areas = []
    for shape in (body.shape, dark.shape):  # together the whole skin, no piece twice
        corners = np.array([shape.vertices[list(face)] for face in shape.faces if len(face) == 4])
        diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        areas.append(np.linalg.norm(np.cross(*diagonals), axis=1).sum() / 2)
    assert sum(areas) == pytest.approx(2 * np.pi * 50 * 44, rel=1e-3)
    points = groove.at(np.linspace(*groove.ends, 2001))[0]
    assert areas[1] == pytest.approx(12.0 * np.linalg.norm(np.diff(points, axis=1), axis=0).sum(), rel=0.02)


def test_a_shaft_goes_through_its_wheel_in_space() -> None:
    """Seen from above: below the disc the wheel hides the shaft, above it the shaft stands before the wheel."""
    shaft = mg.parts.bearings("b", "frame", "s", [(0, 0, -0.1), (0, 0, 0.1)], Z)
    m = mg.Mechanism("shaft", parts=[shaft], gears=[mg.Gear("g", "s", 40, (0, 0, 0), Z, module=0.002, width=0.004)])
    ax = show.canvas.new_axes((6.0, 4.5))
    show.draw_skeleton(m, ax=ax, labels=False)
    right, up, _ = show.skeleton.camera_of(24.0, -58.0)
    canvas = FigureCanvasAgg(ax.figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[:, :, :3].astype(float)

    def color(p: tuple[float, float, float]) -> np.ndarray:
        x, y = ax.transData.transform([np.array(p) @ right, np.array(p) @ up])
        return image[image.shape[0] - 1 - int(y), int(x)]

    disc, below, above = color((-0.02, 0.01, 0.002)), color((0, 0, -0.01)), color((0, 0, 0.01))
    assert np.abs(below - disc).max() < 20
    assert np.abs(above - disc).max() > 60


def test_curves_and_surfaces_are_drawn_where_they_are():
    """The symbol of a pair shows its curve as a line through the marker, on link b that of its own; no straight guide beside it."""
    round_, open_ = mg.Curve.ellipse(a=2.0, b=1.0), mg.Curve.line(point=(2, 0, 0), direction=(0, 1, 0), ends_at=(-1, 1))
    pair = mg.Pair("K", "Kc", "a", "b", point=(2, 0, 0), curve=round_, curve_b=open_)
    lines = [e for e in symbol(pair.type, 0.0, 0.1, [(-1, 1), (-1, 1)]) if e.role == "axis"]
    assert [e.frame for e in lines] == [0, 2]
    marker = pair.markers[0].pose()
    first, second = (e.shape.vertices @ marker[:, :3].T + marker[:, 3] for e in lines)
    assert_allclose((first[:, 0] / 2) ** 2 + first[:, 1] ** 2, 1, atol=1e-12)
    assert_allclose(np.abs(second[:, 1]).max(), 1, atol=1e-12)
    assert_allclose(second[:, 0], 2, atol=1e-12)
    ball = mg.Pair("X", "Sp", "a", "b", point=(1, 0, 0), surface=mg.Surface.sphere(radius=1.0))
    drawn = symbol(ball.type, 0.0, 0.1, [(0, 0)] * 5)
    grid = np.concatenate([e.shape.vertices for e in drawn if e.role == "axis"])
    marker = ball.markers[0].pose()
    assert_allclose(np.linalg.norm(grid @ marker[:, :3].T + marker[:, 3], axis=1), 1, atol=1e-12)
    assert not any(e.role == "guide" for e in drawn)


def test_an_endless_helix_is_drawn_a_turn_to_either_side():
    helix, at = mg.Curve.helix(radius=0.5, pitch=0.1), np.array([0.5, 0, 0.2 * np.pi * 3])
    pair = mg.Pair("X", "Sg", "a", "b", point=at, curve=helix)
    (line,) = (e for e in symbol(pair.type, 0.0, 0.1, [(-1, 1)] * 4) if e.role == "axis")
    marker = pair.markers[0].pose()
    x = line.shape.vertices @ marker[:, :3].T + marker[:, 3] - at
    assert_allclose(x[[0, len(x) // 2, -1]], [[0, 0, -0.2 * np.pi], [0, 0, 0], [0, 0, 0.2 * np.pi]], atol=0.02)
    assert_allclose(np.hypot(x[:, 0] + 0.5, x[:, 1]), 0.5, atol=1e-12)
