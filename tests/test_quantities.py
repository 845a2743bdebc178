"""Numbers as they are given: what counts as one, quantities of pint, units of what comes out, conversion of whole mechanisms."""

import datetime
import decimal
import fractions

import numpy as np
import pint
import pytest

import mechgraph as mg

U = pint.UnitRegistry()
SI = {"length": "m", "mass": "kg", "time": "s"}
Z = (0, 0, 1)


def arm(
    units=SI,
    mass=2.0,
    center=(0.5, 0, 0),
    point=(0, 0, 0),
    drive="A",
    loads=(),
    couplings=(),
    start=None,
    inertia=None,
    **more,
):
    """A frame, an arm on a hinge A, a block on a slide B."""
    links = [mg.Link("frame"), mg.Link("arm", mass, center, inertia), mg.Link("block", 1.0, (0, 0, 0))]
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=point, axis=Z),
        mg.Pair("B", "P", "frame", "block", point=(0, 0, 0), axis=Z),
        *more.pop("pairs", ()),
    ]
    return mg.Mechanism("arm", links, pairs, [drive, "B"], loads, couplings=couplings, start=start, units=units, **more)


def converted(field):
    """The mechanism with one field given as a quantity, and what it must be equal to."""
    mm, deg = U.mm, U.deg
    return {
        "mass": ({"mass": 2000 * U.g}, {"mass": 2.0}),
        "pounds": ({"mass": 2 * U.lb}, {"mass": 2 * 0.45359237}),
        "vector": ({"center": [500, 0, 0] * mm}, {"center": (0.5, 0, 0)}),
        "vector of quantities": ({"center": (50 * U.cm, 0, 0 * mm)}, {"center": (0.5, 0, 0)}),
        "tensor": ({"inertia": np.eye(3) * 1e6 * U.g * U.cm**2}, {"inertia": np.eye(3) * 0.1}),
        "point": ({"point": np.array([1000, 0, 0]) * mm}, {"point": (1, 0, 0)}),
        "stored motion": (
            {"drive": mg.Drive("A", mg.Motion([0, 180] * deg, 30 * U.rpm, t=[0, 1000] * U.ms))},
            {"drive": mg.Drive("A", mg.Motion([0, np.pi], np.pi, t=[0, 1]))},
        ),
        "start": ({"start": {"A": 90 * deg, "B": 20 * mm}}, {"start": {"A": np.pi / 2, "B": 0.02}}),
        "gravity": ({"loads": [mg.Gravity([0, -981, 0] * U.cm / U.s**2)]}, {"loads": [mg.Gravity((0, -9.81, 0))]}),
        "wrench": (
            {"loads": [mg.Wrench("arm", [2, 0, 0] * U.kN, [0, 0, 3] * U.N * mm, [1, 0, 0] * mm)]},
            {"loads": [mg.Wrench("arm", (2000, 0, 0), (0, 0, 0.003), (0.001, 0, 0))]},
        ),
        "effort of a turn": ({"loads": [mg.Effort("A", [1, 2] * U.N * mm)]}, {"loads": [mg.Effort("A", [0.001, 0.002])]}),
        "effort of a slide": ({"loads": [mg.Effort("B", 2 * U.kN)]}, {"loads": [mg.Effort("B", 2000)]}),
        "spring": (
            {"loads": [mg.Spring("arm", "block", [1, 0, 0] * mm, (0, 0, 0), 1 * U.N / mm, 20 * mm, 3 * U.N * U.s / mm)]},
            {"loads": [mg.Spring("arm", "block", (0.001, 0, 0), (0, 0, 0), 1000, 0.02, 3000)]},
        ),
        "torsion spring": (
            {"loads": [mg.TorsionSpring("A", 1 * U.N * U.m / deg, 180 * deg)]},
            {"loads": [mg.TorsionSpring("A", 180 / np.pi, np.pi)]},
        ),
        "coupling of slides": (
            {"drive": "A", "couplings": [mg.Coupling({"B": 1.0}, name="g", constant=5 * mm)]},
            {"drive": "A", "couplings": [mg.Coupling({"B": 1.0}, name="g", constant=0.005)]},
        ),
        "coupling of both": (
            {"couplings": [mg.Coupling({"A": 1.0, "B": 2 / mm}, name="g", constant=180 * deg)]},
            {"couplings": [mg.Coupling({"A": 1.0, "B": 2000.0}, name="g", constant=np.pi)]},
        ),
        "pitch and marker": (
            {"pairs": [mg.Pair("C", "H", "arm", "block", on_a=mg.Marker([1, 0, 0] * mm, Z), on_b=mg.Marker(), lead=2 * mm)]},
            {"pairs": [mg.Pair("C", "H", "arm", "block", on_a=mg.Marker((0.001, 0, 0), Z), on_b=mg.Marker(), lead=0.002)]},
        ),
    }[field]  # fmt: skip


FIELDS = ["mass", "pounds", "vector", "vector of quantities", "tensor", "point", "stored motion", "start", "gravity", "wrench",
          "effort of a turn", "effort of a slide", "spring", "torsion spring", "coupling of slides", "coupling of both",
          "pitch and marker"]  # fmt: skip


def numbers(value):
    """All numbers in a declared thing."""
    if isinstance(value, dict | mg.Mechanism):
        value = list(value.values()) if isinstance(value, dict) else [getattr(value, name) for name in value.formats]
    if hasattr(value, "formats"):
        value = [getattr(value, name) for name in value.formats if name != "type"]
    if hasattr(value, "items"):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return [x for item in value for x in numbers(item)]
    return [] if value is None or isinstance(value, str | bool) else np.ravel(value).tolist()


@pytest.mark.parametrize("field", FIELDS)
def test_a_quantity_is_converted_where_the_mechanism_has_units_and_refused_elsewhere(field):
    given, wanted = converted(field)
    made = numbers(arm(**given))
    assert all(type(x) is float for x in made)
    assert np.allclose(made, numbers(arm(**wanted)), rtol=1e-14, atol=0)
    for units in (
        {},
        {"length": "kg", "mass": "s", "time": "m"},
        {"length": "nonsense", "mass": "nonsense", "time": "nonsense"},
    ):
        if field == "start" and units:
            continue  # an angle fits any units
        with pytest.raises(mg.DeclarationError, match="quantities are converted where"):
            arm(units, **given)


def test_quantities_in_calls_are_converted_or_refused():
    m, bare = arm(loads=[mg.Gravity((0, -9.81, 0))]), arm({})
    at = {"A": 90 * U.deg, "B": 10 * U.mm}
    s = mg.solve(
        m,
        {"A": [0, 90] * U.deg, "B": mg.Motion([10, 20] * U.mm, 5 * U.mm / U.s)},
        loads=[mg.Effort("A", 1 * U.kN * U.mm)],
    )
    assert np.allclose(s["A"].position[:, 0], [0, np.pi / 2])
    assert np.allclose(s["B"].position[:, 0], [0.01, 0.02])
    assert np.allclose(s["B"].velocity, 0.005)
    assert np.allclose(s["A"].effort, -1.0)
    assert np.allclose(list(mg.assemble(m, at).start.values()), [np.pi / 2, 0.01])
    assert np.allclose(list(mg.assemble(m, {}, guess=at).start.values()), [np.pi / 2, 0.01])
    assert mg.check(m, at=at).mobility == 2
    chained = mg.chain("RRRR", length=[100, 200, 150, 180] * U.mm, twist=[0, 0, 0, 0] * U.deg, units=SI)
    assert np.allclose(chained.pairs[1].on_a.point, (0.1, 0, 0))
    for call in (
        lambda: mg.solve(bare, at),
        lambda: mg.solve(m, {"A": 10 * U.mm, "B": 0.0}),
        lambda: mg.solve(bare, {"A": 0, "B": 0}, loads=[mg.Effort("A", 1 * U.N * U.m)]),
        lambda: mg.assemble(bare, at),
        lambda: mg.assemble(bare, {}, guess=at),
        lambda: mg.check(bare, at=at),
        lambda: mg.chain("RRRR", length=[100, 200, 150, 180] * U.mm),
        lambda: mg.Motion.law("cycloidal", 90 * U.deg, 1.0, [0, 1]),
        lambda: mg.Motion.law("cycloidal", 1.0, 1.0, [0, 1] * U.s),
        lambda: mg.inertia.rod(1 * U.kg, (0, 0, 0), (1, 0, 0)),
        lambda: mg.inertia.box(1.0, [1, 2, 3] * U.mm),
        lambda: m.moved(np.eye(4) * U.mm),
        lambda: mg.study(m, {"arm.mass": [1 * U.kg, 2 * U.kg]}, "A.effort", motions={"A": 0, "B": 0}, n=3),
        lambda: mg.solve(m, {"A": 0, "B": 0}).link("arm").point([1, 2, 3] * U.mm),
        lambda: mg.solve(m, {"A": 0, "B": 0}, loads=[mg.Effort("A", lambda pose, twist, t: 1 * U.N * U.m)]),
        lambda: mg.Motion.law(lambda t: t * U.deg, t=[0.0, 1.0]),
    ):
        with pytest.raises(mg.DeclarationError):
            call()


NO_NUMBERS = ["0.0305", b"1", True, np.bool_(True), 1j, np.complex128(1), np.ma.array(1.0), datetime.date(2000, 1, 1),
              np.datetime64(1, "s"), decimal.Decimal(1), fractions.Fraction(1, 2), None, {}, {1}, 10**400, 10**5000, float("nan"),
              NotImplemented]  # fmt: skip


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
def test_what_is_no_number_is_refused_by_name(value):
    for give in (
        lambda: arm(mass=value),
        lambda: arm(center=(value, 0, 0)),
        lambda: arm(loads=[mg.Effort("A", value)]),
        lambda: arm(start={"A": value}),
        lambda: arm(couplings=[mg.Coupling({"A": value, "B": 1.0})]),
        lambda: arm(pairs=[mg.Pair("C", "H", "arm", "block", point=(0, 0, 0), axis=Z, pitch=value, lead=value)]),
        lambda: mg.solve(arm(), {"A": value, "B": 0.0}),
        lambda: mg.Motion(0.0, velocity=[0.0, value]),
        lambda: mg.inertia.sphere(1.0, value),
        lambda: mg.chain("RRR", length=(1, 1, value)),
    ):
        with pytest.raises(mg.DeclarationError) as caught:
            give()
        assert len(str(caught.value)) < 1000


def test_numbers_of_all_kinds_are_taken():
    for value in (2, 2.0, np.float32(2), np.int8(2), np.uint64(2), np.longdouble(2), np.array(2.0)):
        assert arm(mass=value).link("arm").mass == 2.0
    for value in ((1, 2, 3), [1, 2.0, np.int64(3)], np.arange(1, 4), range(1, 4)):
        assert arm(center=value).link("arm").center == (1.0, 2.0, 3.0)


# --- forces and points -----------------------------------------------------------------------------------------------------


def test_a_force_without_a_point_asks_for_one_where_the_link_has_no_mass_centre():
    bare = {"links": [mg.Link("frame"), mg.Link("arm"), mg.Link("block")]}
    m = arm().replace(**bare)
    with pytest.raises(mg.DeclarationError, match="give point="):
        m.replace(loads=[mg.Wrench("arm", force=(0, 1, 0))])
    couple = m.replace(loads=[mg.Wrench("arm", moment=Z)])
    force = m.replace(loads=[mg.Wrench("arm", force=(0, 1, 0), point=(1, 0, 0))])
    away = np.array([[1, 0, 0, 100.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    for loaded in (couple, force):
        assert np.allclose([mg.solve(k, {"A": 0, "B": 0})["A"].effort for k in (loaded, loaded.moved(away))], -1.0)


# --- units of what comes out -----------------------------------------------------------------------------------------------


def screw(advance, **rest):
    twist = (0, 0, 1, 0, 0, advance)
    return mg.PairType(
        "Own",
        freedoms=[mg.Freedom("turn", twist)],
        reactions=[
            "Fx",
            "Fy",
            mg.Component("bend", (1, 0, 0, 0, 0, 0)),
            mg.Component("Mforce", (0, 0, -advance, 0, 0, 1)),
            "My",
        ],
        bookkeeping=mg.Bookkeeping((mg.Freedom("turn", twist),), ()),
    )


def own(row, drives=("A",)):
    nut = mg.Link("nut", 1.0, (0.1, 0.2, 0), np.eye(3))
    pairs = [mg.Pair("A", row, "frame", "nut", point=(0, 0, 0), axis=Z)]
    return mg.Mechanism("own", [mg.Link("frame"), nut], pairs, list(drives), [mg.Gravity((1, 2, -9.81))], units=SI)


def test_units_of_components_come_from_their_wrenches_not_their_names():
    s = mg.solve(own(screw(0.01)), {"A": 1.0})
    assert s["A"].units["components"] == {"Fx": "N", "Fy": "N", "bend": "N m", "Mforce": "N", "My": "N m"}
    assert {"A:bend [N m]", "A:Mforce [N]"} <= set(s.columns())
    mixed = mg.PairType("Own", freedoms=["Rz", "Tx"])
    s = mg.solve(own(mixed, ["A.Rz", "A.Tx"]), {"A.Rz": 1.0, "A.Tx": 0.2})
    assert set(s["A"].units["components"].values()) == {"N, M/L"}
    assert "A:n1 [N, M/L]" in s.columns()


def test_lengths_in_a_pair_type_are_converted_in_all_its_parts():
    """A screw of 0.01 m a radian is one of 10 mm: travel, effort and reactions, and both ways to write the equations."""
    m = own(screw(0.01))
    forces, lengths = {"bend", "My"}, 1000.0
    one, two = (mg.solve(k, {"A": mg.Motion(1.0, 2.0, 3.0)}) for k in (m, m.to_units(length="mm")))
    assert np.isclose(one.link("nut").pose[2, 3], 0.01)
    assert np.isclose(two.link("nut").pose[2, 3], 10.0)
    assert np.allclose(two["A"].effort, 1e6 * one["A"].effort, rtol=1e-12)
    for name, value in one["A"].components.items():
        assert np.isclose(two["A"].components[name], value * lengths ** (2 if name in forces else 1), rtol=1e-11), name
    for s in (one, two):
        # Lee's way: the whole dual force under the condition that it does no work, with the moment of the drive beside it
        f = mg.formulate(s.mechanism, "lee")
        A, b = f.assemble(s.state(()))
        found = dict(zip(map(str, f.unknowns), np.linalg.solve(A.toarray(), b), strict=True))
        assert np.isclose(list(found.values())[-1], s["A"].effort[0], rtol=1e-11)


def refused(value):
    """The fault of a radius."""
    with pytest.raises(mg.DeclarationError) as caught:
        mg.inertia.sphere(1.0, value)
    (fault,) = caught.value.faults
    return fault


def test_values_in_messages_are_short():
    assert len(refused(10**5000)) < 100
    assert len(refused([list(range(10**4))] * 100)) < 2000
    deep = []
    for _ in range(10**4):
        deep = [deep]
    assert len(refused(deep)) < 100
    assert "2 pound" in refused(2 * U.lb)
