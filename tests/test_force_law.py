"""Force laws against hand calculations: signs, tables, what lies outside of them, energy, units, studies, motion in time."""

import numpy as np
import pytest
import scipy

import mechgraph as mg

X = (1.0, 0.0, 0.0)
SI = {"length": "m", "mass": "kg", "time": "s"}


def block(*loads: object, drives: tuple[str, ...] = ("P",), **more: object) -> mg.Mechanism:
    """A block of 2 kg that slides along x, its center at the origin."""
    slide = mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=X)
    return mg.Mechanism("block", [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))], [slide], drives, loads, **more)  # type: ignore[arg-type]


def wheel(*loads: object, drives: tuple[str, ...] = ("A",)) -> mg.Mechanism:
    """A wheel of 0.5 kg m^2 about z."""
    pair = mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=(0, 0, 1))
    inertia = np.diag([0.3, 0.3, 0.5])
    return mg.Mechanism("wheel", [mg.Link("frame"), mg.Link("wheel", 1.0, (0, 0, 0), inertia)], [pair], drives, loads)  # type: ignore[arg-type]


def effort(m: mg.Mechanism, x: object, v: object = 0.0, t: object = None) -> np.ndarray:
    """With what the driver holds the only freedom."""
    name = m.pairs[0].name
    s = mg.solve(m, {name: mg.Motion(x, v, 0.0, t=t)})
    if all(load.in_freedom for load in m.loads):
        np.testing.assert_allclose(s[name].applied_effort, -s[name].effort, atol=1e-12)
    assert np.abs(s.checks.power).max() < 1e-12
    return s[name].effort[..., 0]


AT = np.linspace(-0.2, 0.3, 7)
PLACES = {"freedom": ("P", 0.0), "points": (("frame", "block", (-1, 0, 0), (0, 0, 0)), 1.0)}


@pytest.mark.parametrize(("place", "zero"), PLACES.values(), ids=PLACES)
def test_a_positive_force_drives_the_coordinate_on(place: object, zero: float) -> None:
    """The distance from (-1, 0, 0) to the block is 1 + P, so that one law means the same in both places."""
    push = effort(block(mg.ForceLaw(place, law=lambda x, v, t: 5.0 + 0.0 * x)), AT)  # type: ignore[arg-type]
    np.testing.assert_allclose(push, -5.0)
    law = lambda x, v, t: -7.0 * (x - zero - 0.1) - 3.0 * v
    np.testing.assert_allclose(effort(block(mg.ForceLaw(place, law=law)), AT, 2.0), 7.0 * (AT - 0.1) + 6.0)  # type: ignore[arg-type]
    np.testing.assert_allclose(effort(block(mg.Damper(place, coefficient=3.0)), AT, 2.0), 6.0)  # type: ignore[arg-type]


def test_springs_are_laws() -> None:
    """On a four-bar in motion: a spring and the same law between the same points, and in a freedom."""
    m = mg.load("four-bar")
    place = ("crank", "rocker", (0.0, 0.1, 0.0), (0.4, 0.0, 0.0))
    spring = mg.Spring(*place, stiffness=100.0, free_length=0.1, damping=0.5)
    law = mg.ForceLaw(place, law=lambda x, v, t: -100.0 * (x - 0.1) - 0.5 * v)
    parts = [
        mg.ForceLaw(place, law=mg.ForceTable(x=[-9, 9], force=[900, -900]), free=0.1),
        mg.Damper(place, coefficient=0.5),
    ]
    turned = mg.TorsionSpring("D", stiffness=2.0, free=0.3, damping=0.01)
    turned_law = mg.ForceLaw("D", law=lambda x, v, t: -2.0 * (x - 0.3) - 0.01 * v)
    motion = {"A": mg.Motion(np.linspace(0, 6, 9), 3.0, 1.0)}
    s, *others = (mg.solve(m, motion, loads=loads) for loads in ([spring, turned], [law, turned_law], [*parts, turned]))
    assert np.abs(s["A"].effort).max() > 1.0
    for other in others:
        np.testing.assert_allclose(other["A"].effort, s["A"].effort, atol=1e-11)
        np.testing.assert_allclose(other["B"].components["Fx"], s["B"].components["Fx"], atol=1e-11)


def test_a_table_goes_through_its_points_and_not_beyond_them() -> None:
    x, force = [0.0, 0.1, 0.2, 0.3], [0.0, 0.0, 10.0, 11.0]
    at = np.linspace(0, 0.3, 61)
    monotone, cubic = (
        -effort(block(mg.ForceLaw("P", law=mg.ForceTable(x=x, force=force, interpolation=how))), at)  # type: ignore[arg-type]
        for how in ("monotone", "cubic")
    )
    for found in (monotone, cubic):
        np.testing.assert_allclose(found[::20], force, atol=1e-12)
    assert (np.diff(monotone) > -1e-12).all()
    assert np.abs(monotone[:21]).max() < 1e-12  # flat where its points are
    assert cubic[:21].min() < -0.5  # the spline swings below
    curve = np.linspace(-1, 1, 6)
    cube = mg.ForceTable(x=curve, force=curve**3 - curve, interpolation="cubic")
    np.testing.assert_allclose(-effort(block(mg.ForceLaw("P", law=cube)), at), at**3 - at, atol=1e-14)


@pytest.mark.parametrize("how", ["monotone", "cubic"])
def test_a_grid_over_coordinate_and_rate(how: str) -> None:
    """What is linear in both is met exactly; so are the points of any grid, whatever stands between them."""
    x, v = np.array([0.0, 0.1, 0.4]), np.array([-2.0, 0.0, 1.0, 3.0])
    linear = mg.ForceTable(x=x, v=v, force=4 - 30 * x[:, None] - 2 * v, interpolation=how)  # type: ignore[arg-type]
    at, rate = np.array([0.0, 0.05, 0.33, 0.4]), np.array([-2.0, 0.7, 2.5, 3.0])
    np.testing.assert_allclose(-effort(block(mg.ForceLaw("P", law=linear)), at, rate), 4 - 30 * at - 2 * rate)
    rows = np.random.default_rng(3).normal(size=(3, 4))
    m = block(mg.ForceLaw("P", law=mg.ForceTable(x=x, v=v, force=rows, interpolation=how)))  # type: ignore[arg-type]
    every = np.repeat(x, 4), np.tile(v, 3)
    np.testing.assert_allclose(-effort(m, *every), rows.ravel(), atol=1e-12)


def test_a_table_over_the_rate_alone_is_a_motor() -> None:
    motor = mg.ForceTable(v=[0, 100, 150], force=[12, 10, 0])
    np.testing.assert_allclose(
        -effort(wheel(mg.ForceLaw("A", law=motor)), 0.0, [0.0, 100.0, 150.0]), [12, 10, 0], atol=1e-12
    )


def test_outside_of_a_table() -> None:
    table = mg.ForceTable(x=[0, 0.1], force=[3, 5])
    m = block(mg.ForceLaw("P", law=table, free=-0.02))
    with pytest.raises(
        mg.DeclarationError, match=r"(?s)force law in 'P'.*x = 0\.22 lies outside.* 0 and 0\.1.*outside='hold'"
    ):
        mg.solve(m, {"P": [0.0, 0.2]})
    held = m.replace(loads=[mg.ForceLaw("P", law=mg.ForceTable(x=[0, 0.1], force=[3, 5], outside="hold"))])
    np.testing.assert_allclose(-effort(held, [-1.0, 0.05, 0.1, 2.0]), [3, 4, 5, 5])


def test_a_stroke_that_ends_with_its_table_is_within_it() -> None:
    """A screw of 8 mm lead turned 2.5 times back: -0.02 but for rounding."""
    screw = mg.Mechanism("screw", pairs=[
        mg.Pair("nut", "H", "frame", "screw", point=(0, 0, 1), axis=(0, 0, 1), lead=0.008),
        mg.Pair("collar", "R", "screw", "ram", point=(0, 0, 0.6), axis=(0, 0, 1)),
        mg.Pair("guide", "P", "frame", "ram", point=(0.3, 0, 0.5), axis=(0, 0, 1)),
    ], drives=["nut"], loads=[mg.ForceLaw("guide", law=mg.ForceTable(x=[-0.02, 0], force=[25e3, 0]))])  # fmt: skip
    s = mg.solve(screw, {"nut": 2 * np.pi * np.array([0, -2.5])})
    assert s["guide"].position[1, 0] != -0.02
    np.testing.assert_allclose(s["nut"].effort[:, 0], [0, -25e3 * 0.008 / (2 * np.pi)], atol=1e-4)


def test_time_and_what_a_function_may_give() -> None:
    t = np.linspace(0, 1, 5)
    found = effort(block(mg.ForceLaw("P", law=lambda x, v, t: 3 * np.sin(t) + x)), AT[0] + 0 * t, t=t)
    np.testing.assert_allclose(-found, 3 * np.sin(t) + AT[0])
    assert float(effort(block(mg.ForceLaw("P", law=lambda x, v, t: 2.0)), 0.1)) == -2.0
    with pytest.raises(mg.DeclarationError, match="t None without times"):
        effort(block(mg.ForceLaw("P", law=lambda x, v, t: 3 * t)), AT)
    with pytest.raises(mg.DeclarationError, match="one number for each of 7"):
        effort(block(mg.ForceLaw("P", law=lambda x, v, t: [1.0, 2.0])), AT)
    with pytest.raises(mg.DeclarationError, match=r"load force law in 'P'.*\n.*not finite"):
        effort(block(mg.ForceLaw("P", law=lambda x, v, t: x / 0 if False else x * np.nan)), AT)


def test_points_that_meet() -> None:
    """A force between points that coincide has no direction; none is needed where it is zero."""
    place = ("frame", "block", (0, 0, 0), (0, 0, 0))
    assert effort(block(mg.ForceLaw(place, law=lambda x, v, t: -4 * x)), [0.0, 0.5]).tolist() == [0.0, 2.0]
    with pytest.raises(mg.DeclarationError, match="spring of length 0"):
        effort(block(mg.ForceLaw(place, law=lambda x, v, t: 4.0 + x)), [0.0, 0.5])


BAD = {
    "no law": (dict(law=3), "a function (x, v, t) or a ForceTable"),
    "no axis": (dict(law=mg.ForceTable(force=[1, 2])), "neither is given"),
    "falling": (
        dict(law=mg.ForceTable(x=[1, 0], force=[1, 2])),
        "law.x = (1.0, 0.0): expected at least two rising numbers",
    ),
    "one point": (dict(law=mg.ForceTable(x=[1], force=[1])), "at least two rising"),
    "sizes": (dict(law=mg.ForceTable(x=[0, 1], v=[0, 1, 2], force=[1, 2])), "expected 2 x 3 numbers"),
    "NaN": (dict(law=mg.ForceTable(x=[0, 1], force=[1, np.nan])), "law.force"),
    "choice": (dict(law=mg.ForceTable(x=[0, 1], force=[1, 2], outside="guess")), "'error' or 'hold'"),  # type: ignore[arg-type]
    "half a place": (
        dict(a="frame", freedom=None, law=len),
        "b, p, q left out; expected a freedom alone, e.g. 'D', or two links",
    ),
    "links without points": (
        dict(freedom="frame", a="block", law=len),
        "beside it a = 'block'; expected a freedom alone",
    ),
    "two links as a place": (dict(freedom=("frame", "block"), law=len), "two links with a point of each"),
    "two places": (dict(a="frame", b="block", p=(0, 0, 0), q=X, law=len), "beside it a = 'frame'"),
    "scale": (dict(law=len, scale="a"), "scale"),
    "rotation": (dict(freedom="S.Rx", law=len), "unknown freedom 'S.Rx'"),
}


@pytest.mark.parametrize(("fields", "said"), BAD.values(), ids=BAD)
def test_bad_laws(fields: dict[str, object], said: str) -> None:
    with pytest.raises(mg.DeclarationError) as caught:
        block(mg.ForceLaw(**{"freedom": "P", **fields}))  # type: ignore[arg-type]
    assert said in str(caught.value)


def test_points_of_links_and_unknown_ones() -> None:
    m = block().replace(
        links=[
            mg.Link("frame", points={"seat": (-1, 0, 0)}),
            mg.Link("block", 2.0, (0, 0, 0), points={"eye": (0, 0, 0)}),
        ]
    )
    by_name = m.replace(loads=[mg.Damper(("frame", "block", "seat", "eye"), coefficient=3.0)])
    np.testing.assert_allclose(effort(by_name, AT, 2.0), 6.0)
    with pytest.raises(mg.DeclarationError, match="link 'block' has no point 'ear'"):
        m.replace(loads=[mg.Damper(("frame", "block", "seat", "ear"), coefficient=3.0)])


@pytest.mark.parametrize("place", [place for place, _ in PLACES.values()], ids=PLACES)
def test_what_two_links_exert_on_each_other_is_no_load_on_the_frame(place: object) -> None:
    """The frame bears the weight of the block, and the law through itself and the driver: together the weight alone."""
    for law in (mg.ForceLaw(place, law=lambda x, v, t: 7.0 + 0.0 * x), mg.Damper(place, coefficient=3.0)):  # type: ignore[arg-type]
        m = block(law, mg.Gravity((0.0, 0.0, -10.0)))
        s = mg.solve(m, {"P": mg.Motion(AT, 2.0, 0.0)})
        np.testing.assert_allclose(s.shaking[:, 3:], np.broadcast_to([0.0, 0.0, -20.0], (7, 3)), atol=1e-12)


# --- units, studies --------------------------------------------------------------------------------------------------------


def test_other_units() -> None:
    table = mg.ForceTable(x=[-1, 0, 1], v=[-5, 5], force=[[30, 20], [10, 5], [-3, -9]])
    loads = [
        mg.ForceLaw("P", law=table, free=0.1, scale=2.0),
        mg.Damper(("frame", "block", (-1, 0, 0), (0, 0, 0)), coefficient=3.0),
    ]
    m = block(*loads, units=SI)
    mm = m.to_units(length="mm", time="ms")
    assert mm.loads[0].law.x == (-1000.0, 0.0, 1000.0)  # type: ignore[union-attr]
    # N = kg m/s^2 = 1e-3 kg mm/ms^2
    np.testing.assert_allclose(effort(mm, 1e3 * AT, 2.0), 1e-3 * effort(m, AT, 2.0))
    turn = wheel(mg.ForceLaw("A", law=mg.ForceTable(x=[-1, 1], force=[3, -3]))).replace(units=SI)
    assert turn.to_units(length="mm").loads[0].law == mg.ForceTable(x=[-1, 1], force=[3e6, -3e6])  # type: ignore[union-attr]
    with pytest.raises(mg.DeclarationError, match="law of a ForceLaw is a callable"):
        block(mg.ForceLaw("P", law=len), units=SI).to_units(length="mm")


def test_quantities() -> None:
    U = pytest.importorskip("pint").UnitRegistry()
    table = mg.ForceTable(x=[0, 100] * U.mm, force=[0, 2] * U.kN)
    m = block(mg.ForceLaw("P", law=table, free=10 * U.mm), mg.Damper("P", coefficient=2 * U.N * U.s / U.mm), units=SI)
    assert m.loads == (
        mg.ForceLaw("P", law=mg.ForceTable(x=[0, 0.1], force=[0, 2000]), free=0.01), mg.Damper("P", coefficient=2000.0)
    )  # fmt: skip


def test_numbers_of_laws_in_a_study() -> None:
    table = mg.ForceTable(x=[-1, 1], force=[-40, 40])
    m = block(
        mg.ForceLaw("P", law=table, free=0.0), mg.Damper(("frame", "block", (-1, 0, 0), (0, 0, 0)), coefficient=3.0)
    )
    fields = {"loads[0].free": [0.1, 0.2], "loads[0].scale": [1.0, -2.0], "loads[1].coefficient": [1.0, 5.0]}
    found = mg.study(m, fields, {"force": "P.effort"}, sampling="grid", motions={"P": mg.Motion([0.0, 0.3], 2.0)})
    for row, parameters in zip(
        found.outputs["force"], np.transpose([found.parameters[k] for k in fields]), strict=True
    ):
        free, scale, c = parameters
        np.testing.assert_allclose(row.ravel(), -scale * 40 * (np.array([0.0, 0.3]) - free) + 2 * c)


# --- motion in time --------------------------------------------------------------------------------------------------------


def test_a_mass_on_a_cubic_spring() -> None:
    """m x'' = -k x^3 swings with T = 4 sqrt(2 m / k) / a * int_0^1 dz / sqrt(1 - z^4); the table stores energy."""
    a, k = 0.3, 700.0
    x = np.linspace(-0.4, 0.4, 9)
    table = mg.ForceTable(x=x, force=-k * x**3, interpolation="cubic")
    m = block(mg.ForceLaw(("frame", "block", (-1, 0, 0), (0, 0, 0)), law=table, free=1.0), drives=())
    quarter = scipy.special.beta(0.25, 0.5) / 4 * np.sqrt(2 * 2.0 / k) / a
    r = mg.respond(m, np.linspace(0, 4 * quarter, 5), start={"P": a})
    np.testing.assert_allclose(r["P"].position[:, 0], [a, 0, -a, 0, a], atol=1e-7)
    np.testing.assert_allclose(np.ptp(r.energy.potential), k * a**4 / 4, rtol=1e-7)
    assert np.abs(r.energy.balance).max() < 1e-7
    assert np.abs(r.energy.work).max() == 0.0


def test_a_damped_block_and_a_motor_come_to_their_speeds() -> None:
    t = np.linspace(0, 2, 6)
    r = mg.respond(block(mg.Damper("P", coefficient=3.0), drives=()), t, rates={"P": 4.0})
    np.testing.assert_allclose(r["P"].velocity[:, 0], 4 * np.exp(-1.5 * t), rtol=1e-7)
    np.testing.assert_allclose(r.energy.work, r.energy.kinetic - 16.0, atol=1e-6)
    motor = mg.ForceTable(v=[0, 20], force=[10, 0], outside="hold")
    r = mg.respond(wheel(mg.ForceLaw("A", law=motor), drives=()), t)
    np.testing.assert_allclose(r["A"].velocity[:, 0], 20 * (1 - np.exp(-t)), rtol=1e-6, atol=1e-9)
    r = mg.respond(block(mg.ForceLaw("P", law=lambda x, v, t: 2 * np.cos(t)), drives=()), t)
    np.testing.assert_allclose(r["P"].position[:, 0], 1 - np.cos(t), atol=1e-8)


def test_a_motion_that_leaves_its_table_says_so() -> None:
    m = block(mg.ForceLaw("P", law=mg.ForceTable(x=[0, 1], force=[2, 2])), drives=())
    with pytest.raises(mg.MechgraphError, match=r"force law in 'P'.*\n?.*lies outside of the table"):
        mg.respond(m, [0.0, 9.0])


@pytest.mark.parametrize(
    "place", [("D",), ("frame", "bar", (0, 0, 0), (1, 0, 0)), (("frame", "bar", (0, 0, 0), (1, 0, 0)),)]
)
def test_springs_and_dampers_take_the_same_arguments(place):
    """A freedom, two links with a point of each, or these four as one tuple."""
    spring, damper = mg.Spring(*place, stiffness=3.0, free_length=0.2, damping=0.5), mg.Damper(*place, coefficient=0.5)
    assert [getattr(spring, n) for n in ("freedom", *"abpq")] == [getattr(damper, n) for n in ("freedom", *"abpq")]
    assert spring.replace(damping=1.0).b == damper.b
    pairs = [mg.Pair("D", "R", "frame", "bar", point=(0, 1, 0), axis=(0, 0, 1))]

    def effort(*loads):
        m = mg.Mechanism("bar", [mg.Link("frame"), mg.Link("bar", 1.0, (1, 0, 0))], pairs, ["D"], loads)
        return mg.solve(m, {"D": mg.Motion([0.3, 0.7], 2.0)})["D"].effort[:, 0]

    mixed = effort(spring.replace(damping=0.0), damper)
    np.testing.assert_allclose(effort(spring), mixed, rtol=1e-13)
    if len(place) == 1 and place[0] == "D":
        same = effort(mg.TorsionSpring("D", 3.0, 0.2, 0.5))
        np.testing.assert_allclose(effort(spring), same, rtol=1e-14)


@pytest.mark.parametrize(
    ("spring", "words"),
    [
        (mg.Spring("D"), "spring in 'D': stiffness = None: expected a finite number"),
        (mg.Spring("D", "bar", stiffness=1.0), "spring 'D' - 'bar': p, q left out; expected a freedom alone"),
        (
            mg.Spring("frame", freedom="D", stiffness=1.0),
            "spring in 'D': beside it a = 'frame'; expected a freedom alone",
        ),
        (mg.Spring(stiffness=1.0), "a, b, p, q left out"),
        (mg.Spring("E", stiffness=1.0), "unknown freedom 'E'"),
        (
            mg.Spring("frame", "bar", (0, 0, 0), (1, 0, 0), 1.0, -0.1),
            "free_length = -0.1: expected a number of 0 or more",
        ),
        (mg.Spring("D", stiffness=1.0, free_length=-0.1), None),
    ],
)
def test_a_spring_at_no_place_is_named(spring, words):
    pairs = [mg.Pair("D", "R", "frame", "bar", point=(0, 1, 0), axis=(0, 0, 1))]
    if words is None:
        assert mg.Mechanism("bar", pairs=pairs, loads=[spring]).loads
        return
    with pytest.raises(mg.DeclarationError, match=words):
        mg.Mechanism("bar", pairs=pairs, loads=[spring])


# --- a force in one freedom from another's coordinate -------------------------------------------------------------------------


def wheel_and_block(*loads: object, drives: tuple[str, ...] = (), **more: object) -> mg.Mechanism:
    """The wheel and the block, side by side on the frame: nothing but a law joins them."""
    pairs, links = (*wheel().pairs, *block().pairs), (*wheel().links, block().link("block"))
    return mg.Mechanism("both", links, pairs, drives, loads, **more)  # type: ignore[arg-type]


GAS = mg.ForceTable(x=[0.0, 1.0, 2.0, 4.0], force=[900.0, 400.0, 150.0, 100.0])


@pytest.mark.parametrize("engine", ["dense", "sparse", "auto"])
def test_gas_force_over_the_angle_of_the_crank(engine: str) -> None:
    """Slider-crank: the crank gives what the gas takes, ``M = -F dx/dA`` with x = r cos A + sqrt(l^2 - r^2 sin^2 A)."""
    r, length = 0.05, 0.15
    ends = {"A": ("frame", "crank", 0.0), "B": ("crank", "rod", r), "C": ("rod", "piston", r + length)}
    pairs = [mg.Pair(k, "R", a, b, point=(x, 0, 0), axis=(0, 0, 1)) for k, (a, b, x) in ends.items()]
    pairs.append(mg.Pair("P", "P", "frame", "piston", point=(r + length, 0, 0), axis=X))
    m = mg.Mechanism("engine", pairs=pairs, drives=["A"], loads=[mg.ForceLaw("P", reads="A", law=GAS, scale=-1.0)])
    A, w = np.linspace(0.1, 3.9, 7), 200.0
    s = mg.solve(m, {"A": mg.Motion(A, w)}, engine=engine)  # type: ignore[arg-type]
    slope = -r * np.sin(A) - r**2 * np.sin(A) * np.cos(A) / np.sqrt(length**2 - r**2 * np.sin(A) ** 2)
    gas = -scipy.interpolate.PchipInterpolator(GAS.x, GAS.force)(A)
    np.testing.assert_allclose(s["P"].applied_effort[:, 0], gas, rtol=1e-12)
    np.testing.assert_allclose(s["A"].effort[:, 0], -gas * slope, rtol=1e-9)
    load = s.load(0)
    np.testing.assert_allclose(load.coordinate, A)
    np.testing.assert_allclose(load.rate, w)
    np.testing.assert_allclose(load.power, gas * slope * w, rtol=1e-9)
    assert np.abs(s.checks.power).max() < 1e-10


def test_a_law_between_points_may_read_a_freedom_too() -> None:
    law = mg.ForceLaw(("frame", "block", (-1, 0, 0), (0, 0, 0)), reads="A", law=lambda x, v, t: 5.0 * x + v)
    s = mg.solve(wheel_and_block(law, drives=("A", "P")), {"A": mg.Motion([0.2, 0.4], 3.0), "P": 0.1})
    np.testing.assert_allclose(s["P"].effort[:, 0], [-4.0, -5.0])
    np.testing.assert_allclose(s["A"].effort[:, 0], 0.0, atol=1e-14)
    with pytest.raises(mg.DeclarationError, match=r"acts between points and reads the freedom 'A'"):
        mg.compile(wheel_and_block(law.replace(law=GAS), drives=("A", "P")))


def test_reading_is_a_term_off_the_diagonal_of_the_stiffness() -> None:
    """Force -8 A - 2 A' on the block: rows of K and C of the block have entries in the column of the wheel, not the other way round."""
    loads = (
        mg.ForceLaw("P", reads="A", law=lambda x, v, t: -8.0 * x - 2.0 * v),
        mg.Spring("A", stiffness=5.0),
        mg.Spring("P", stiffness=7.0),
    )
    small = mg.linearize(wheel_and_block(*loads))
    order = [small.freedoms.index(name) for name in ("A.Rz", "P.Tz")]
    np.testing.assert_allclose(small.K[np.ix_(order, order)], [[5, 0], [8, 7]], atol=1e-6)
    np.testing.assert_allclose(small.C[np.ix_(order, order)], [[0, 0], [2, 0]], atol=1e-6)
    found = mg.equilibrium(wheel_and_block(*loads, mg.Effort("A", 1.0)), kind="nearest")
    assert found.start["P.Tz"] == pytest.approx(-8.0 * 0.2 / 7.0, rel=1e-6)


@pytest.mark.parametrize("law", [mg.ForceTable(x=[-1, 9], force=[-6, 54]), lambda x, v, t: 6.0 * x], ids=["table", "f"])
def test_motion_under_a_force_that_reads(law: object) -> None:
    """The wheel turns at 3 rad/s, the force is 6 A: x = 6 w t^3 / (6 m); its work becomes kinetic energy."""
    t = np.linspace(0.0, 1.5, 7)
    m = wheel_and_block(mg.ForceLaw("P", reads="A", law=law))
    r = mg.respond(m, t, rates={"A": 3.0})
    np.testing.assert_allclose(r["P"].position[:, 0], 6.0 * 3.0 * t**3 / 12.0, atol=1e-8)
    np.testing.assert_allclose(r.energy.work, r.energy.kinetic - r.energy.kinetic[0], atol=1e-6)
    assert np.abs(r.energy.potential).max() == 0.0
    one = m.replace(drives=["A"])
    driven = mg.respond(one, t, motions={"A": lambda t: (3.0 * t, 3.0, 0.0)})
    np.testing.assert_allclose(driven["P"].position[:, 0], r["P"].position[:, 0], atol=1e-7)


def test_a_read_table_in_the_kernel() -> None:
    pytest.importorskip("mechgraph.kernel.build").built()
    m = mg.load("four-bar").replace(loads=[mg.ForceLaw("D", reads="A", law=GAS, free=-0.2)])
    motion = {"A": mg.Motion(np.linspace(0.0, 3.0, 5), 4.0)}
    s, k = mg.solve(m, motion, engine="dense"), mg.solve(m, motion, engine="compiled")
    np.testing.assert_allclose(k["A"].effort, s["A"].effort, rtol=1e-11)
    c = mg.compile(m)
    c.start()
    np.testing.assert_allclose(
        [c(q, velocity=4.0)[0] for q in np.linspace(0.0, 3.0, 5)], s["A"].effort[:, 0], rtol=1e-9
    )


def test_units_files_and_names_of_what_is_read(tmp_path) -> None:
    law = mg.ForceLaw("P", reads="A", law=mg.ForceTable(x=[-1, 1], v=[-5, 5], force=[[3, 2], [1, 4]]), free=0.1)
    m = wheel_and_block(law, drives=("A", "P"), units=SI)
    assert m.loads[0].reads == "A"
    mm = m.to_units(length="mm", time="ms").loads[0]
    assert mm.law.x == (-1.0, 1.0)  # type: ignore[union-attr]
    np.testing.assert_allclose(mm.law.v, [-0.005, 0.005])  # type: ignore[union-attr]
    np.testing.assert_allclose(mm.law.force, np.array(law.law.force) * 1e-3)  # type: ignore[union-attr]
    assert mm.free == 0.1  # type: ignore[union-attr]
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    slides = wheel_and_block(
        mg.ForceLaw("A", reads="P", law=mg.ForceTable(x=[-1, 1], force=[3, 2]), free=0.1), units=SI
    )
    own = slides.to_units(length="mm").loads[0]
    assert (own.law.x, own.law.force, own.free) == ((-1000.0, 1000.0), (3e6, 2e6), 100.0)  # type: ignore[union-attr]
    s = mg.solve(m, {"A": mg.Motion(0.3, 1.0), "P": 0.0})
    frame = s.to_pandas(include=["loads"])
    assert "loads[0] force_law x" in str(list(frame.columns))
    for wrong in ("Q", "S.Rx"):
        with pytest.raises(mg.DeclarationError, match=f"unknown freedom '{wrong}'"):
            block(mg.ForceLaw("P", reads=wrong, law=len))


def test_quantities_of_what_is_read() -> None:
    U = pytest.importorskip("pint").UnitRegistry()
    table = mg.ForceTable(x=[0, 180] * U.degree, force=[0, 2] * U.kN)
    m = wheel_and_block(mg.ForceLaw("P", reads="A", law=table, free=90 * U.degree), units=SI)
    (law,) = m.loads
    np.testing.assert_allclose((*law.law.x, *law.law.force, law.free), (0, np.pi, 0, 2000, np.pi / 2))  # type: ignore[union-attr]


# --- springs along a fixed direction ------------------------------------------------------------------------------------------


def test_a_spring_along_a_direction_of_the_frame() -> None:
    """A block on a slide at 45 degrees; the spring knows its way to the right alone, l = x / sqrt 2, negative too."""
    slide = mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=(1, 1, 0))
    spring = mg.Spring(
        "frame", "block", (0, 5, 0), (0, 0, 0), stiffness=100.0, free_length=-0.1, damping=3.0, along=(2, 0, 0)
    )
    m = mg.Mechanism("block", [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))], [slide], ["P"], [spring])
    x, v = np.array([-0.4, 0.0, 0.3]), 2.0
    s = mg.solve(m, {"P": mg.Motion(x, v)})
    tension = 100.0 * (x / np.sqrt(2) + 0.1) + 3.0 * v / np.sqrt(2)
    np.testing.assert_allclose(s["P"].effort[:, 0], tension / np.sqrt(2))
    np.testing.assert_allclose(s.load(0).coordinate, x / np.sqrt(2), atol=1e-15)
    np.testing.assert_allclose(s.load(0).power, -tension * v / np.sqrt(2))
    free = m.replace(drives=[], loads=[spring.replace(damping=0.0)])
    t = np.linspace(0.0, 1.0, 9)
    r = mg.respond(free, t, start={"P": 0.5})
    rest, w = -0.1 * np.sqrt(2), np.sqrt(100.0 / 2 / 2)
    np.testing.assert_allclose(r["P"].position[:, 0], rest + (0.5 - rest) * np.cos(w * t), atol=1e-7)
    assert np.abs(r.energy.balance).max() < 1e-6


def test_a_spring_in_a_guide_on_a_moving_link() -> None:
    """Its direction turns with link a: both forces on one line, power and energy agree, for any motion of both links."""
    spring = mg.Spring("coupler", "rocker", (0.1, 0.05, 0.0), (0.4, 0.1, 0.0), 50.0, 0.1, along=(1.0, 2.0, 0.0))
    m = mg.load("four-bar").replace(loads=[spring])
    step = 1e-5
    A = np.array([0.4, 0.4 + step, 0.4 - step])
    s = mg.solve(m, {"A": mg.Motion(A, 1.0)})
    load = s.load(0)
    np.testing.assert_allclose(load.wrenches["coupler"] + load.wrenches["rocker"], 0.0, atol=1e-12)
    energy = 25.0 * (load.coordinate - 0.1) ** 2
    assert load.power[0] == pytest.approx(-(energy[1] - energy[2]) / (2 * step), rel=1e-7)
    assert load.rate[0] == pytest.approx((load.coordinate[1] - load.coordinate[2]) / (2 * step), rel=1e-7)
    assert np.abs(s.checks.power).max() < 1e-12
    turned = np.array([[0.0, -1.0, 0.0, 3.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        mg.solve(m.moved(turned), {"A": mg.Motion(A, 1.0)})["A"].effort, s["A"].effort, rtol=1e-9
    )
    law = mg.ForceLaw(
        ("coupler", "rocker", spring.p, spring.q), law=lambda x, v, t: -50.0 * (x - 0.1), along=spring.along
    )
    np.testing.assert_allclose(mg.solve(m.replace(loads=[law]), {"A": mg.Motion(A, 1.0)})["A"].effort, s["A"].effort)


def test_directions_in_files_studies_and_errors(tmp_path) -> None:
    spring = mg.Spring("frame", "block", (0, 0, 0), (0, 0, 0), stiffness=100.0, along=X)
    m = block(spring, units=SI)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    found = mg.study(m, {"loads[0].along.y": [0.0, 1.0]}, "P.effort", sampling="grid", motions={"P": 0.2})
    np.testing.assert_allclose(found.outputs["P.effort"].ravel(), [20.0, 10.0])
    with pytest.raises(mg.DeclarationError, match="acts along a fixed direction"):
        mg.compile(m)
    with pytest.raises(mg.DeclarationError, match=r"along = .*: beside the freedom 'P'"):
        block(mg.Spring("P", stiffness=1.0, along=X))
    flat = {"links": [mg.Link("frame"), mg.Link("block", 2.0, (0, 0))], "drives": ["P"], "planar": True}
    slide = mg.Pair("P", "P", "frame", "block", point=(0, 0), axis=(1, 0))
    loads = [spring.replace(along=(1, 0))]
    plane = mg.Mechanism("block", pairs=[slide], loads=loads, **flat)  # type: ignore[arg-type]
    assert mg.solve(plane, {"P": 0.2})["P"].effort == pytest.approx([20.0])
    with pytest.raises(mg.DeclarationError, match=r"along = \(1.0, 0.0, 1.0\): leaves the plane"):
        plane.replace(loads=[spring.replace(along=(1, 0, 1))])
    with pytest.raises(mg.DeclarationError, match=r"along = .*length 0"):
        block(spring.replace(along=(0, 0, 0)))


def test_a_direction_out_of_the_plane_has_no_planar_twin() -> None:
    """In the plane only a part of such a spring would act: it is refused, not turned into another one."""
    pairs = [
        mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=X),
        mg.Pair("R", "R", "block", "arm", point=(0, 0, 0), axis=(0, 0, 1)),
    ]
    spring = mg.Spring("frame", "arm", (0, 0, 0), (0, 0.2, 0), 9.0, along=(1, 0, 1))
    m = mg.Mechanism("both", pairs=pairs, drives=["P", "R"], loads=[spring])
    with pytest.raises(mg.DeclarationError, match=r"along = \(1.0, 0.0, 1.0\): leaves the plane"):
        m.to_planar()
    assert m.replace(loads=[spring.replace(along=(1, 1, 0))]).to_planar().planar
