"""Scenes: what a picture of a mechanism shows, as arrays; checked against the motion of the links and the rows of the pair table."""

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.show.scene import DrawnPart, Scene, scene
from mechgraph.show.shapes import frame_along, symbol

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
