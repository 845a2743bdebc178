"""Declarations: every kind of fault, all at once; changed copies; what cannot be changed."""

import copy
import pickle
import warnings
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from strategies import closed_mechanism, pose, with_loads

import mechgraph as mg

R = {"axis": (0, 0, 1)}


def door(**more):
    """Frame, door, hinge; fields replaced by ``more``."""
    fields = {
        "links": [mg.Link("frame"), mg.Link("door", mass=1.0, center=(0.5, 0, 0), inertia=np.diag([0.1, 0.1, 0.1]))],
        "pairs": [mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 1))],
        "drives": [mg.Drive("A")],
    }
    return mg.Mechanism("door", **{**fields, **more})


def faults_of(**more):
    with pytest.raises(mg.DeclarationError) as caught:
        door(**more)
    return caught.value.faults


def hinge(**more):
    fields = {"type": "R", "a": "frame", "b": "door", "point": (0, 0, 0), "axis": (0, 0, 1)}
    return [mg.Pair("A", **{**fields, **more})]


def leaf(**more):
    fields = {"mass": 1.0, "center": (0.5, 0, 0), "inertia": np.diag([0.1, 0.1, 0.1])}
    return [mg.Link("frame"), mg.Link("door", **{**fields, **more})]


MARKER = mg.Marker((0, 0, 0), (0, 0, 1), (1, 0, 0))
NAN, INF = float("nan"), float("inf")

FAULTS = {
    "unknown link": ({"pairs": hinge(b="gate")}, ["unknown link 'gate'"]),
    "unknown type": ({"pairs": hinge(type="Q"), "drives": []}, ["unknown type", "'Q'"]),
    "type is no pair type": ({"pairs": hinge(type=3), "drives": []}, ["unknown type", "3"]),
    "zero axis": ({"pairs": hinge(axis=(0, 0, 0))}, ["axis", "length 0"]),
    "NaN axis": ({"pairs": hinge(axis=(0, NAN, 1))}, ["axis", "finite"]),
    "NaN point": ({"pairs": hinge(point=(NAN, 0, 0))}, ["point", "finite"]),
    "enormous point": ({"pairs": hinge(point=(10**400, 0, 0))}, ["point", "finite"]),
    "infinite point": ({"pairs": hinge(point=(INF, 0, 0))}, ["point", "finite"]),
    "point with two numbers": ({"pairs": hinge(point=(0, 0))}, ["point", "three"]),
    "point is a text": ({"pairs": hinge(point="here")}, ["point", "three"]),
    "point without axis": ({"pairs": hinge(axis=None)}, ["axis"]),
    "axis without point": ({"pairs": hinge(point=None)}, ["point"]),
    "axis of texts": ({"pairs": hinge(axis=("a", "b", "c"))}, ["axis", "three"]),
    "axis that has no hash": ({"pairs": hinge(axis=([1], 2, 3))}, ["axis", "three"]),
    "axis of a curve is of texts": (
        {"pairs": hinge(type="P", axis=None, curve=mg.Curve.circle(radius=1.0, axis=("a", "b", "c")))},
        ["curve.axis", "three"],
    ),
    "curve is an array": ({"pairs": hinge(curve=np.zeros(3))}, ["curve", "mg.Curve"]),
    "surface is an array": ({"pairs": hinge(surface=np.zeros(3))}, ["surface", "mg.Surface"]),
    "hertz is an array": ({"pairs": hinge(hertz=np.zeros(3))}, ["hertz", "no contact"]),
    "closed is nothing": ({"pairs": hinge(closed=None)}, ["closed", "'form'"]),
    "closed is an array": ({"pairs": hinge(closed=np.array(["form", "force"]))}, ["closed", "'form'"]),
    "type is ...": ({"pairs": hinge(type=...), "drives": []}, ["unknown type", "Ellipsis"]),
    "negative mass": ({"links": leaf(mass=-1.0)}, ["door", "mass", "-1"]),
    "NaN mass": ({"links": leaf(mass=NAN)}, ["door", "mass", "finite"]),
    "mass is a text": ({"links": leaf(mass="heavy")}, ["door", "mass"]),
    "NaN center": ({"links": leaf(center=(NAN, 0, 0))}, ["door", "center", "finite"]),
    "mass without center": ({"links": leaf(center=None, inertia=None)}, ["door", "center"]),
    "inertia without mass": ({"links": leaf(mass=0.0)}, ["door", "inertia without mass"]),
    "inertia against the triangle inequality": (
        {"links": leaf(inertia=np.diag([1.0, 0.1, 0.1]))},
        ["door", "inertia", "unphysical=True"],
    ),
    "negative inertia": ({"links": leaf(inertia=np.diag([-0.1, 0.1, 0.1]))}, ["door", "inertia"]),
    "asymmetric inertia": ({"links": leaf(inertia=[[0.1, 0.05, 0], [0, 0.1, 0], [0, 0, 0.1]])}, ["door", "inertia"]),
    "NaN inertia": ({"links": leaf(inertia=np.full((3, 3), NAN))}, ["door", "inertia", "finite"]),
    "inertia of another shape": ({"links": leaf(inertia=(0.1, 0.1, 0.1))}, ["door", "inertia", "3 x 3"]),
    "pair on one link only": ({"pairs": hinge(b=None)}, ["A", "one link only"]),
    "pair of a link with itself": ({"pairs": hinge(b="frame")}, ["A", "itself"]),
    "unconnected link": ({"links": [*leaf(), mg.Link("lost")]}, ["lost", "not connected"]),
    "duplicate link": ({"links": [*leaf(), mg.Link("door")]}, ["door", "2 times"]),
    "duplicate pair": ({"pairs": hinge() * 2}, ["A", "2 times"]),
    "duplicate drive": ({"drives": ["A", "A.Rz"]}, ["A.Rz", "2 times"]),
    "H without pitch": ({"pairs": hinge(type="H")}, ["H", "pitch", "lead"]),
    "H with pitch and lead": ({"pairs": hinge(type="H", pitch=0.1, lead=0.1)}, ["pitch", "lead", "exactly one"]),
    "H with NaN pitch": ({"pairs": hinge(type="H", pitch=NAN)}, ["pitch", "finite"]),
    "R with pitch": ({"pairs": hinge(pitch=0.1)}, ["pitch", "leave it out"]),
    "second not perpendicular": (
        {"pairs": hinge(type="U", second=(1, 0, 0.1)), "drives": []},
        ["second", "perpendicular"],
    ),
    "second parallel": ({"pairs": hinge(second=(0, 0, 2))}, ["second", "parallel"]),
    "second zero": ({"pairs": hinge(second=(0, 0, 0))}, ["second", "length 0"]),
    "drive on a freedom that the pair lacks": ({"drives": ["A.Tz"]}, ["A.Tz"]),
    "drive on an unknown pair": ({"drives": ["B"]}, ["'B'"]),
    "drive on a rotation": ({"pairs": hinge(type="S"), "drives": ["A.Rx"]}, ["A.Rx", "rotation"]),
    "drive on a pair with several freedoms": ({"pairs": hinge(type="C")}, ["A", "2 freedoms"]),
    "drive on a weld": ({"pairs": hinge(type="W")}, ["A", "no freedom"]),
    "one marker only": ({"pairs": hinge(point=None, axis=None, on_a=MARKER)}, ["on_b", "missing"]),
    "markers and point": ({"pairs": hinge(on_a=MARKER, on_b=MARKER)}, ["both"]),
    "marker with zero axis": (
        {"pairs": hinge(point=None, axis=None, on_a=MARKER, on_b=mg.Marker(axis=(0, 0, 0)))},
        ["on_b", "axis", "length 0"],
    ),
    "unknown frame": ({"frame": "ground"}, ["ground"]),
    "no pairs": ({"pairs": [], "drives": []}, ["no pairs"]),
    "a pair that is none": ({"pairs": ["A"], "drives": []}, ["mg.Pair"]),
    "a link that is none": ({"links": ["frame", "door"]}, ["mg.Link"]),
    "a load that is none": ({"loads": ["gravity"]}, ["load"]),
    "load on an unknown link": ({"loads": [mg.Wrench("gate", force=(1, 0, 0))]}, ["gate"]),
    "wrench of nothing": ({"loads": [mg.Wrench("door")]}, ["door", "neither"]),
    "wrench with NaN": ({"loads": [mg.Wrench("door", force=(NAN, 0, 0))]}, ["force"]),
    "wrench with two numbers": ({"loads": [mg.Wrench("door", force=(1, 0))]}, ["force", "expected 3 finite numbers"]),
    "effort that is none": ({"loads": [mg.Effort("A", NAN)]}, ["effort in 'A'", "expected a finite number"]),
    "wrench in an unknown frame": ({"loads": [mg.Wrench("door", force=(1, 0, 0), frame="body")]}, ["body"]),
    "wrench at a bad point": ({"loads": [mg.Wrench("door", force=(1, 0, 0), point=(0, 0))]}, ["point"]),
    "gravity with two numbers": ({"loads": [mg.Gravity((0, -9.81))]}, ["gravity"]),
    "effort in an unknown freedom": ({"loads": [mg.Effort("B", 1.0)]}, ["'B'"]),
    "effort NaN": ({"loads": [mg.Effort("A", NAN)]}, ["value"]),
    "spring on an unknown link": ({"loads": [mg.Spring("frame", "gate", (0, 0, 0), (1, 0, 0), 1.0)]}, ["gate"]),
    "spring NaN": ({"loads": [mg.Spring("frame", "door", (0, 0, 0), (1, 0, 0), NAN)]}, ["stiffness"]),
    "spring of negative length": (
        {"loads": [mg.Spring("frame", "door", (0, 0, 0), (1, 0, 0), 1.0, free_length=-1)]},
        ["free_length"],
    ),
    "torsion spring in a rotation": (
        {"pairs": hinge(type="S"), "drives": [], "loads": [mg.TorsionSpring("A.Rx", 1.0)]},
        ["A.Rx"],
    ),
    "start of an unknown freedom": ({"start": {"B": 0.1}}, ["'B'"]),
    "start NaN": ({"start": {"A": NAN}}, ["finite"]),
    "unknown unit": ({"units": {"force": "N"}}, ["force"]),
    "empty name of a pair": ({"pairs": [mg.Pair("", "R", "frame", "door")], "drives": []}, ["name"]),
    "empty name of a link": ({"links": [*leaf(), mg.Link("")]}, ["name"]),
}


@pytest.mark.parametrize(("more", "words"), FAULTS.values(), ids=FAULTS)
def test_a_faulty_declaration_is_refused_with_its_fault_named(more, words):
    faults = faults_of(**more)
    assert any(all(word in fault for word in words) for fault in faults), faults


def test_all_faults_come_at_once():
    links = [
        mg.Link("frame"),
        mg.Link("door", mass=-1.0),
        mg.Link("door"),
        mg.Link("fat", mass=1.0),
        mg.Link("flat", center=(0, 0, 0), inertia=np.diag([1, 0, 0])),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 0)),
        mg.Pair("A", "Q", "frame", "fat"),
        mg.Pair("B", "H", "frame", "gate", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("C", "U", "frame", "flat", point=(0, 0, float("nan")), axis=(0, 0, 1), second=(1, 0, 1)),
        mg.Pair("D", "R", "frame", None),
    ]
    faults = faults_of(links=links, pairs=pairs, drives=[])
    text = "\n".join(faults)
    for word in (
        "mass = -1",
        "'door' is declared 2 times",
        "'fat'",
        "'flat'",
        "length 0",
        "'Q'",
        "pitch",
        "'gate'",
        "one link only",
        "'A' is declared 2 times",
        "finite",
    ):
        assert word in text
    assert len(faults) >= 11


def test_faults_of_names_and_of_structure_come_together():
    """A drive, a load and a start that are wrong, beside an unconnected link."""
    text = "\n".join(
        faults_of(
            links=[*leaf(), mg.Link("lost")], drives=["Z"], loads=[mg.Wrench("gate", force=(1, 0, 0))], start={"Y": 1.0}
        )
    )
    for word in ("lost", "'Z'", "gate", "'Y'"):
        assert word in text


def test_faults_of_geometry_and_of_names_come_together():
    """A zero axis beside a drive and a load on what is not there."""
    text = "\n".join(faults_of(pairs=hinge(axis=(0, 0, 0)), drives=["Z"], loads=[mg.Wrench("gate", force=(1, 0, 0))]))
    for word in ("length 0", "'Z'", "gate"):
        assert word in text


def test_the_error_carries_subject_and_faults_and_prints_them():
    with pytest.raises(mg.DeclarationError) as caught:
        door(drives=["B"])
    assert "door" in caught.value.subject
    assert all(fault in str(caught.value) for fault in caught.value.faults)
    assert isinstance(caught.value, mg.MechgraphError)


def test_an_unphysical_inertia_is_accepted_on_request():
    m = door(links=leaf(inertia=np.diag([1.0, 0.1, 0.1]), unphysical=True))
    assert m.link("door").unphysical


@pytest.mark.parametrize(
    "inertia", [np.zeros((3, 3)), np.diag([0.1, 0.1, 0.0]), mg.inertia.rod(1.0, (0, 0, 0), (1, 2, 3))]
)
def test_inertia_of_points_and_rods_is_physical(inertia):
    door(links=leaf(inertia=inertia))


def test_links_may_be_left_out():
    m = mg.Mechanism(
        "m",
        pairs=[
            mg.Pair("A", "R", "ground", "crank"),
            mg.Pair("B", "S", "crank", "rod"),
            mg.Pair("C", "C", "ground", "rod"),
        ],
    )
    assert [k.name for k in m.links] == ["ground", "crank", "rod"]
    assert m.frame == "ground"
    assert not m.has_geometry


def test_collections_are_tuples_and_the_mechanism_is_frozen():
    m = with_loads(closed_mechanism(1), 1).replace(drives=[])
    for field in ("links", "pairs", "drives", "loads"):
        assert isinstance(getattr(m, field), tuple)
    for what, field in ((m, "name"), (m.links[1], "mass"), (m.pairs[0], "axis"), (m.loads[0], "acceleration")):
        with pytest.raises(FrozenInstanceError):
            setattr(what, field, 1)
    with pytest.raises(TypeError):
        m.start["A"] = 1.0
    with pytest.raises(TypeError):
        m.expected["x"] = 1


def test_arrays_are_copied_in():
    center, inertia, axis, force = np.array([0.5, 0, 0]), 0.1 * np.eye(3), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    m = door(links=leaf(center=center, inertia=inertia), pairs=hinge(axis=axis), loads=[mg.Wrench("door", force=force)])
    before = pickle.dumps(m)
    for array in (center, inertia, axis, force):
        array[...] = 7.0
    assert pickle.dumps(m) == before
    np.testing.assert_array_equal(m.link("door").center, [0.5, 0, 0])
    np.testing.assert_array_equal(m.pair("A").axis, [0, 0, 1])


def test_arrays_of_a_solution_are_read_only():
    s = mg.solve(door(), {"A": mg.Motion(np.linspace(0, 1, 5), 1.0, 0.0)})
    arrays = [
        s["A"].position,
        s["A"].velocity,
        s["A"].reaction,
        s["A"].effort,
        s["A"].components["Fx"],
        s.link("door").pose,
        s.link("door").twist,
        s.link("door").center,
        s.shaking,
        s.checks.closure,
        s.checks.power,
    ]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


@pytest.mark.parametrize("seed", range(4))
def test_pickle_and_copy_give_an_equal_mechanism(seed):
    m = with_loads(closed_mechanism(seed), seed)
    for twin in (pickle.loads(pickle.dumps(m)), copy.deepcopy(m), copy.copy(m)):
        assert twin == m
        assert hash(twin) == hash(m)
        assert twin.links == m.links
        assert twin.start == m.start
        with pytest.raises(FrozenInstanceError):
            twin.name = "x"


def test_a_mechanism_with_a_users_row_can_be_pickled():
    row = mg.PairType("Slide2", freedoms=["Tx", "Ty"], reactions=None)
    m = mg.Mechanism(
        "m", pairs=[mg.Pair("A", row, "frame", "plate", point=(0, 0, 0), axis=(0, 0, 1))], drives=["A.Tx", "A.Ty"]
    )
    twin = pickle.loads(pickle.dumps(m))
    assert twin == m
    s = mg.solve(twin, {"A.Tx": 1.0, "A.Ty": 2.0})
    np.testing.assert_allclose(
        s.link("plate").pose[:3, 3],
        [*(np.array(m.pair("A").second) * 1.0 + 2.0 * np.cross((0, 0, 1), m.pair("A").second))],
    )


def test_equality_sees_every_field():
    m = door()
    assert m == door()
    for other in (
        m.replace(name="gate"),
        m.replace(drives=[]),
        m.replace(loads=[mg.Gravity((0, 0, -1))]),
        m.replace(start={"A": 0.1}),
        door(links=leaf(mass=2.0)),
        m.replace(units={"length": "m"}),
    ):
        assert other != m
    assert m != "door"


def test_replace_leaves_the_original_and_checks_again():
    m = door()
    loads = [mg.Gravity((0, -9.81, 0))]
    other = m.replace(loads=loads)
    assert m.loads == ()
    assert other.loads == tuple(loads)
    assert other.pairs == m.pairs
    with pytest.raises(mg.DeclarationError, match="gate"):
        m.replace(loads=[mg.Wrench("gate", force=(1, 0, 0))])
    with pytest.raises(mg.DeclarationError, match="color"):
        m.replace(color="red")


def test_with_pair_type_keeps_the_place_and_drops_drives_that_are_gone():
    m = door(start={"A": 0.2})
    for drives in (["A"], ["A.Rz"]):
        ball = m.replace(drives=drives).with_pair_type("A", "S")
        assert ball.pair("A").type is mg.pair_types()["S"]
        assert ball.pair("A").point == m.pair("A").point
        assert ball.drives == ()
        slide = m.replace(drives=drives).with_pair_type("A", "P")
        assert slide.drives == ()
        assert dict(slide.start) == {}


def test_with_pair_type_keeps_drives_of_freedoms_that_stay():
    m = door(start={"A": 0.2})
    for drives in (["A"], ["A.Rz"]):
        cylinder = m.replace(drives=drives).with_pair_type("A", "C")
        assert [cylinder.full_name(d.freedom) for d in cylinder.drives] == ["A.Rz"]
        assert cylinder.start == {"A.Rz": 0.2}
        assert mg.check(cylinder).mobility == 2


def test_with_pair_type_takes_a_pitch_and_refuses_what_does_not_fit():
    m = door()
    assert m.with_pair_type("A", "H", pitch=0.1).pair("A").pitch == 0.1
    for arguments, word in ((("A", "H"), "pitch"), (("Z", "R"), "'Z'"), (("A", "Q"), "'Q'")):
        with pytest.raises(mg.DeclarationError, match=word):
            m.with_pair_type(*arguments)


def test_moved_by_two_poses_is_moved_by_their_product():
    rng = np.random.default_rng(2)
    m = with_loads(closed_mechanism(5), 5)
    X, Y = pose(rng), pose(rng)
    a, b = m.moved(X).moved(Y), m.moved(Y @ X)
    for p, q in zip(a.pairs, b.pairs, strict=True):
        np.testing.assert_allclose(p.point, q.point, atol=1e-12)
        np.testing.assert_allclose(p.axis, q.axis, atol=1e-12)
        np.testing.assert_allclose(p.second, q.second, atol=1e-12)
    for p, q in zip(a.links, b.links, strict=True):
        if p.center is not None:
            np.testing.assert_allclose(p.center, q.center, atol=1e-12)
            np.testing.assert_allclose(p.inertia, q.inertia, atol=1e-12)
    for p, q in zip(m.links, m.moved(X).links, strict=True):
        if p.center is not None:
            np.testing.assert_allclose(q.center, X[:3, :3] @ p.center + X[:3, 3], atol=1e-12)


@pytest.mark.parametrize("bad", [np.diag([1, 1, -1, 1]), 2 * np.eye(4), np.eye(3), np.full((4, 4), np.nan)])
def test_moved_refuses_what_is_no_rigid_motion(bad):
    with pytest.raises(mg.DeclarationError, match="pose"):
        door().moved(bad)


def test_the_second_direction_is_filled_at_declaration_with_the_global_axis_least_aligned():
    assert hinge(axis=(0, 0, 1))[0].second in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    second = hinge(axis=(0.9, 0.1, 0.4))[0].second
    assert np.argmax(np.abs(second)) == 1
    assert np.dot(second, (0.9, 0.1, 0.4)) == pytest.approx(0, abs=1e-15)


def test_a_second_direction_given_is_projected_where_it_need_not_be_perpendicular():
    m = door(pairs=hinge(type="E", second=(1, 0, 0.5)), drives=["A.Tx", "A.Ty", "A.Rz"])
    s = mg.kinematics(m, {"A.Tx": 1.0, "A.Ty": 0.0, "A.Rz": 0.0})
    np.testing.assert_allclose(s.link("door").pose[:3, 3], [1, 0, 0], atol=1e-15)


def test_lead_is_two_pi_pitch():
    a, b = (
        mg.solve(door(pairs=hinge(type="H", **more)), {"A": 1.3})
        for more in ({"lead": 0.5}, {"pitch": 0.5 / (2 * np.pi)})
    )
    np.testing.assert_allclose(a.link("door").pose, b.link("door").pose, atol=1e-15)


def test_freedoms_are_named_in_full_or_by_their_pair_alone():
    m = door(pairs=hinge(type="C"), drives=["A.Rz", "A.Tz"])
    assert m.full_name("A.Tz") == "A.Tz"
    with pytest.raises(mg.DeclarationError, match="2 freedoms"):
        m.full_name("A")
    one = m.replace(drives=["A.Tz"])
    assert one.full_name("A") == "A.Tz"


def test_chain_names_links_and_pairs_as_lee_does():
    m = mg.chain("RSgCScCpSp")
    assert [p.type.symbol for p in m.pairs] == ["R", "Sg", "C", "Sc", "Cp", "Sp"]
    assert [p.name for p in m.pairs] == [f"O{k}" for k in range(1, 7)]
    assert [k.name for k in m.links] == ["frame", *(f"link{k}" for k in range(1, 6))]
    assert [d.freedom for d in m.drives] == ["O1"]
    assert mg.chain("RCSR", drive=None).drives == ()


@pytest.mark.parametrize(
    ("letters", "more", "word"),
    [
        ("RQR", {}, "Q"),
        ("R", {}, "two pairs"),
        ("", {}, "pairs"),
        ("RCSR", {"twist": (1, 2)}, "twist"),
        ("RCSR", {"length": (1, 2, 3, float("nan"))}, "length"),
        ("RHR", {"twist": (1, 1, 1)}, "pitch"),
        ("RHR", {"pitch": (1, 1)}, "pitch"),
        ("RCSR", {"drive": "O9"}, "O9"),
        ("RCSR", {"links": [mg.Link("link9")]}, "link9"),
    ],
)
def test_a_faulty_chain_is_refused(letters, more, word):
    with pytest.raises(mg.DeclarationError, match=word):
        mg.chain(letters, **more)


@pytest.mark.parametrize(
    ("motions", "word"),
    [
        ({"B": 0.0}, "'B'"),
        ({"A": "fast"}, "real number"),
        ({"A": [0.0, float("nan")]}, "finite"),
        ({"A": 10**400}, "real number"),
        ({"A": 1e150}, "away from the start"),
        ({"A": [0.0, 2e6]}, "away from the start"),
        ({}, "no motion"),
        (None, "no motion"),
    ],
)
def test_motions_that_do_not_fit_are_refused(motions, word):
    with pytest.raises(mg.DeclarationError, match=word):
        mg.solve(door(), motions)


@pytest.mark.parametrize("option", [{"method": "magic"}, {"redundant": "zero"}, {"on_reach": "ignore"}])
def test_unknown_options_are_refused(option):
    with pytest.raises(mg.DeclarationError, match=next(iter(option.values()))):
        mg.solve(door(), {"A": 0.0}, **option)


def test_a_topology_cannot_be_solved_but_counted():
    m = mg.chain("RCSR")
    assert mg.check(m).mobility_by_count == 1
    with pytest.raises(mg.DeclarationError, match="geometry"):
        mg.solve(m, {"O1": 0.0})


def test_unknown_names_in_a_solution_are_told_with_the_known_ones():
    s = mg.solve(door(), {"A": 0.0})
    with pytest.raises(mg.DeclarationError, match="A"):
        s["B"]
    with pytest.raises(mg.DeclarationError, match="door"):
        s.link("gate")


def test_a_freedom_given_twice_by_two_spellings_is_refused() -> None:
    m = mg.load("four-bar")
    with pytest.raises(mg.DeclarationError, match=r"A\.Rz is given twice"):
        mg.solve(m, {"A": 0.1, "A.Rz": 0.2})
    with pytest.raises(mg.DeclarationError, match=r"A\.Rz is given twice"):
        mg.check(m, at={"A": 0.1, "A.Rz": 0.2})


def test_lengths_in_a_pair_type_of_its_own_change_with_the_units() -> None:
    """A turn with a pitch given as a number advances the same way in meters and in millimetres."""
    screw = mg.PairType("Screw", freedoms=[mg.Freedom("Rz", (0, 0, 1, 0, 0, 0.002))])
    m = door(pairs=hinge(type=screw), units={"length": "m"}).to_units(length="mm")
    assert m.pairs[0].type.freedoms[0].twist == pytest.approx((0, 0, 1, 0, 0, 2.0))
    assert mg.kinematics(m, {"A": 1.0}).link("door").pose[2, 3] == pytest.approx(2.0)


@pytest.mark.parametrize("size", [1, 40])
def test_a_fault_among_many_sound_items_is_told_alone(size):
    """Columns find that something is wrong; the words are those of the one item."""
    links = [*leaf(), *(mg.Link(f"k{i}", 1.0, (0, 0, 0), np.eye(3)) for i in range(size))]
    ends = ["door", *(f"k{i}" for i in range(size))]
    more = [mg.Pair(f"P{i}", "S", *ends[i : i + 2], point=(0, 0, i)) for i in range(size)]
    good = {"links": links, "pairs": [*hinge(), *more]}
    assert len(door(**good).pairs) == size + 1
    heavy = [*links[:-1], mg.Link(links[-1].name, 1.0, (0, 0, 0), np.diag([1.0, 1.0, 3.0]))]
    faults = faults_of(links=heavy, pairs=[*hinge(), *more[:-1], more[-1].replace(point=(0, 0, NAN))])
    assert len(faults) == 2
    assert "no body has it" in faults[0]
    assert "three finite numbers" in faults[1]


def test_a_start_is_not_sought_too_far_away():
    """Freedoms moved together are followed whole; one that turns is not."""
    axes = [mg.Pair(name, "R", a, b, point=(0, 0, 0), axis=(0, 0, 1)) for name, a, b in ("Afg", "Bgh")]
    m = mg.Mechanism("arm", None, axes, ["A", "B"], frame="f")
    with pytest.raises(mg.DeclarationError, match=r"A: comes 1e\+07 away from the start; expected at most 1e\+04"):
        mg.assemble(m, {"A": 1e7, "B": 1.0})


@pytest.mark.parametrize("values", [(0.1, 0.2), [0.1, 0.2], np.array([0.1, 0.2])])
def test_start_values_of_a_pair_in_one_sequence(values):
    m = mg.load("rcsr").replace(start={"O1": 0.5, "O2": values})
    assert dict(m.start) == {"O1.Rz": 0.5, "O2.Rz": 0.1, "O2.Tz": 0.2}
    with pytest.raises(mg.DeclarationError, match="has 2 freedoms; name one of"):
        m.replace(start={"O2": np.array([[0.1, 0.2]])})


@pytest.mark.parametrize("row", list(mg.pair_types().values()), ids=lambda row: row.symbol)
def test_full_names_are_pair_types_too(row):
    symbol, name = (mg.Pair("A", kind, "a", "b") for kind in (row.symbol, row.name.capitalize()))
    assert symbol == name
    assert mg.Pair("A", row.name.split(" (")[0].split(",")[0].replace(" ", "_"), "a", "b") == symbol


def test_full_names_with_curves_and_in_files(tmp_path):
    rail = {"curve": mg.Curve.circle(radius=1.0)}
    assert mg.Pair("K", "pin in curved slot", "a", "b", **rail) == mg.Pair("K", "Ps", "a", "b", **rail)
    assert mg.Pair("K", "prismatic", "a", "b", **rail) == mg.Pair("K", "P", "a", "b", **rail)
    path = tmp_path / "m.toml"
    path.write_text(
        'schema = 1\nname = "m"\n[[pair]]\nname = "A"\ntype = "revolute"\na = "frame"\nb = "crank"\n', "utf-8"
    )
    assert mg.load(path).pair("A").type.symbol == "R"
    with pytest.raises(mg.DeclarationError, match="unknown type 'revolut'"):
        mg.Mechanism("m", None, [mg.Pair("A", "revolut", "a", "b")])


def test_a_unit_that_is_not_known_is_a_label():
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    with pytest.warns(mg.MechgraphWarning, match=r"units: length: unknown unit 'furlong' \(units: m, .*label"):
        m = mg.Mechanism("m", pairs=pairs, units={"length": "furlong", "mass": "kg", "time": "s"})
    assert "length in furlong" in str(m)


@pytest.mark.parametrize(
    ("length", "g", "meant"),
    [("mm", 9.81, "m"), ("mm", 981, "cm"), ("m", 9810, "mm"), ("ft", 386.1, "in"), ("mm", 9.80665, "m"),
     ("m", 9.81, ""), ("mm", 9810, ""), ("ft", 32.174, ""), ("m", 1.62, ""), ("mm", 1620, ""), ("m", 0.0, ""), ("yd", 10.725, "")],
)  # fmt: skip
def test_gravity_in_other_units_than_those_declared_is_doubted(length, g, meant):
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    load, units = mg.Gravity((0.6 * g, -0.8 * g, 0)), {"length": length, "mass": "kg", "time": "s"}
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        m = mg.Mechanism("m", pairs=pairs, loads=[load], units=units)
        m.replace(source="x", loads=[])
    assert [meant + "/s^2, which is" in str(w.message) for w in said] == [True] * bool(meant)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        m.replace(loads=[]).replace(loads=[load])
    assert len(said) == bool(meant)
