"""What depends on time by itself is not stepped over: pulses, breaks, the longest step; laws along a path and in charts."""

from itertools import pairwise

import numpy as np
import pytest
import scipy
from test_response import slider_crank

import mechgraph as mg

X, Y, Z = np.eye(3)
BEGIN, END, FORCE = 5.0, 5.05, 100.0


def block(*loads, mass=1.0, axis=X):
    """A block on a slide."""
    body = mg.Link("body", mass=mass, center=(0, 0, 0), inertia=np.eye(3))
    return mg.Mechanism(
        "block", [mg.Link("frame"), body], [mg.Pair("P", "P", "frame", "body", point=(0, 0, 0), axis=axis)], loads=loads
    )


def pulse(t):
    return np.where((t >= BEGIN) & (t < END), FORCE, 0.0)


def on_link(pose, twist, t):
    return pulse(t)[..., None] * X


PULSES = {
    "law": mg.ForceLaw("P", law=lambda x, v, t: pulse(t)),
    "points": mg.ForceLaw(("frame", "body", (-1, 0, 0), (0, 0, 0)), law=lambda x, v, t: pulse(t)),
    "effort": mg.Effort("P", lambda pose, twist, t: pulse(t)),
    "force": mg.Wrench("body", force=on_link, point=(0, 0, 0)),
}


@pytest.mark.daily(3)
@pytest.mark.parametrize(
    ("what", "method"), [*((what, "DOP853") for what in PULSES), *(("law", one) for one in ("RK23", "Radau", "LSODA"))]
)
def test_a_pulse_is_not_stepped_over(what, method):
    """v = F dt / m, and the way since then."""
    r = mg.respond(block(PULSES[what]), (0, 10), method=method, rtol=1e-7)
    v = FORCE * (END - BEGIN)
    np.testing.assert_allclose(r["P"].velocity[-1], v, rtol=1e-5)
    np.testing.assert_allclose(r["P"].position[-1], v * (10 - 0.5 * (BEGIN + END)), rtol=1e-5)


HUMP = {"force": [0, 0, 40, 0, 0], "outside": "hold"}
NARROW = {
    "coordinate": lambda: mg.ForceLaw("P", law=mg.ForceTable(x=[-1e3, 27.6, 27.7, 27.8, 1e3], **HUMP)),
    "function": lambda: mg.ForceLaw("P", law=lambda x, v, t: 40 * np.clip(1 - 10 * np.abs(x - 27.7), 0, None)),
    "distance": lambda: mg.ForceLaw(
        ("frame", "body", (-9, 0, 0), (0, 0, 0)), law=mg.ForceTable(x=[0, 36.6, 36.7, 36.8, 1e3], **HUMP)
    ),
    "effort": lambda: mg.Effort(
        "P", lambda pose, twist, t: 40 * np.clip(1 - 10 * np.abs(pose[..., 0, 3] - 27.7), 0, None)
    ),
}


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("what", NARROW)
def test_a_hump_of_a_table_or_function_of_place_is_not_stepped_over(what, beside):
    """Passed at 10 within a hundredth of a second in one of eight: the energy that it brings; along a path, and in a chart of two."""
    load, m = NARROW[what](), block()
    other = mg.Pair("Q", "P", "frame", "other", point=(0, 1, 0), axis=X)
    more = {"links": [*m.links, mg.Link("other", 1.0, (0, 1, 0))], "pairs": [*m.pairs, other]} if beside else {}
    r = mg.respond(m.replace(loads=[load], **more), (0, 8), rates={"P": 10.0})
    law = getattr(load, "law", None)
    gained = law.energy(np.array([0.0]))[0] - law.energy(np.array([1e3]))[0] if isinstance(law, mg.ForceTable) else 4.0
    np.testing.assert_allclose(r["P"].velocity[-1], np.sqrt(100 + 2 * gained), rtol=1e-5)


def test_a_hump_of_a_table_of_rates_is_not_stepped_over():
    """v' = 5 - g(v): the time lost in the hump, by quadrature."""
    table = mg.ForceTable(v=[-1e3, 10, 10.2, 10.4, 1e3], force=[0, 0, -4, 0, 0], outside="hold")
    r = mg.respond(block(mg.ForceLaw("P", law=table), mg.Effort("P", 5.0)), (0, 8))

    def slower(v):
        return 1 / (5 + table.at(np.zeros(1), np.array([v]))[0]) - 0.2

    lost = scipy.integrate.quad(slower, 10, 10.4, points=[10.2])[0]
    np.testing.assert_allclose(r["P"].velocity[-1], 5 * (8 - lost), rtol=1e-6)


@pytest.mark.parametrize("load", [mg.Effort, mg.ForceLaw, mg.Wrench])
def test_steps_end_at_breaks_so_that_the_shortest_pulse_is_exact(load):
    """A thousandth of what is looked at; the number of steps stays small."""
    begin, end = 5.0, 5.0 + 1e-6

    def short(t):
        return np.where((t >= begin) & (t < end), 1e6, 0.0)

    made = {
        mg.Effort: lambda: mg.Effort("P", lambda pose, twist, t: short(t), breaks=(begin, end)),
        mg.ForceLaw: lambda: mg.ForceLaw("P", law=lambda x, v, t: short(t), breaks=(begin, end)),
        mg.Wrench: lambda: mg.Wrench("body", force=lambda p, w, t: short(t)[..., None] * X, breaks=[begin, end]),
    }[load]()
    r = mg.respond(block(made), (0, 10))
    np.testing.assert_allclose(r["P"].velocity[-1], 1.0, rtol=1e-9)
    assert r.work.steps < 40
    assert {begin, end} <= set(r.t.tolist())


def test_the_longest_step_is_kept_and_stored_with_a_mechanism():
    m = block(mg.ForceLaw("P", law=lambda x, v, t: np.where((t > 5.0) & (t < 5.001), 1e3, 0.0)))
    setup = mg.ResponseSetup((0, 10), max_step=5e-4)
    r = mg.respond(m.replace(loads=[mg.Effort("P", 1.0)], response=mg.ResponseSetup((0, 10), max_step=0.5)))
    assert np.diff(r.t).max() <= 0.5 + 1e-12
    assert setup.converted((1.0, 1.0, 1e3), lambda name: False).max_step == pytest.approx(0.5)
    free = [mg.respond(m.replace(loads=[]), (0, 1), rates={"P": 1.0}, max_step=most).t for most in (None, np.inf)]
    np.testing.assert_array_equal(*free)
    assert mg.ResponseSetup((0, 10), max_step=np.inf) == mg.ResponseSetup((0, 10))
    for bad in (0.0, -1.0, "long", np.nan, -np.inf):
        with pytest.raises(mg.DeclarationError, match="max_step"):
            mg.respond(m, (0, 1), max_step=bad)


def test_a_bump_of_what_is_prescribed_is_not_stepped_over():
    """A weight on a spring under a slide that moves and comes back within a tenth of a second, once in ten, by hand."""
    k, mass, rise, span = 8.0, 2.0, 0.5, 0.1

    def bump(t):
        s = (t - 7.0) / span
        if not 0.0 < s < 1.0:
            return 0.0, 0.0, 0.0
        w = 2 * np.pi
        return (
            rise * (1 - np.cos(w * s)) ** 2,
            rise * 2 * w / span * (1 - np.cos(w * s)) * np.sin(w * s),
            rise * 2 * (w / span) ** 2 * (np.sin(w * s) ** 2 + np.cos(w * s) - np.cos(w * s) ** 2),
        )

    links = [mg.Link("frame"), mg.Link("slide"), mg.Link("body", mass=mass, center=(0, 0, 0), inertia=np.eye(3))]
    pairs = [
        mg.Pair("A", "P", "frame", "slide", point=(0, 0, 0), axis=X),
        mg.Pair("B", "P", "slide", "body", point=(0, 0, 0), axis=X),
    ]
    m = mg.Mechanism("shaken", links, pairs, loads=[mg.TorsionSpring("B", stiffness=k)])
    r = mg.respond(m, (0, 8), motions={"A": bump}, rtol=1e-6, atol=1e-8)
    w = np.sqrt(k / mass)
    exact = scipy.integrate.quad(lambda s: -bump(s)[2] * np.sin(w * (8 - s)) / w, 7, 7.1)[0]
    assert abs(exact) > 0.01
    np.testing.assert_allclose(r["B"].position[-1], exact, atol=1e-5)


def test_smooth_loads_of_time_are_followed_in_the_same_steps():
    """A look refuses no step that follows a load well: as many steps as by the equation, the work with it."""
    m = block(mg.ForceLaw("P", law=lambda x, v, t: np.sin(30 * t)))
    r = mg.respond(m, (0, 3))

    def by_hand(t, y):
        return [y[1], np.sin(30 * t), y[1] * np.sin(30 * t)]

    own = scipy.integrate.solve_ivp(by_hand, (0, 3), np.zeros(3), "DOP853", rtol=1e-8, atol=1e-10)
    assert r.work.steps <= 1.05 * len(own.t)
    np.testing.assert_allclose(r["P"].velocity[-1], (1 - np.cos(90)) / 30, atol=1e-7)


def law_of(position, velocity, acceleration):
    return lambda t: (float(position(t)), float(velocity(t)), float(acceleration(t)))


NONE = np.zeros_like
WRONG = {
    "velocity": (law_of(np.sin, lambda t: 5.0 + 0 * t, NONE), "position changes by .* velocity says"),
    "nearly": (law_of(np.sin, lambda t: 1.0001 * np.cos(t), lambda t: -1.0001 * np.sin(t)), "position changes by"),
    "acceleration": (law_of(np.sin, np.cos, np.sin), "velocity changes by .* acceleration says"),
    "jump": (law_of(lambda t: np.where(t > 1.3, 1.0, 0.0), NONE, NONE), "position jumps by 1 at t = 1.3"),
    "jump of a motion": (
        law_of(lambda t: np.sin(t) + (t > 2), np.cos, lambda t: -np.sin(t)),
        "position jumps by 1 at t = 2",
    ),
    "kink": (
        law_of(lambda t: np.maximum(t - 1.3, 0), lambda t: 1.0 * (t > 1.3), NONE),
        "velocity jumps by 1 at t = 1.3",
    ),
    "samples": (mg.Motion(np.sin(np.linspace(0, 3, 40)), 5.0, 0.0, np.linspace(0, 3, 40)), "position of its samples"),
    "steps": (mg.Motion(np.arange(40) // 20, 0.0, 0.0, np.linspace(0, 3, 40)), "position of its samples changes by 1"),
}


@pytest.mark.parametrize("what", WRONG)
def test_rates_that_are_not_those_of_the_position_are_refused_by_name(what):
    motion, words = WRONG[what]
    with pytest.raises(mg.DeclarationError, match=f"motion of 'P.Tz': .*{words}"):
        mg.respond(block(), (0, 3), motions={"P": motion})


def test_motions_that_are_right_are_taken_and_their_jumps_of_acceleration_are_breaks():
    """A harmonic rise between dwells."""

    def rise(t):
        if not 1.1 < t < 1.4:
            return 0.0 if t <= 1.1 else 0.2, 0.0, 0.0
        w = np.pi / 0.3
        s = w * (t - 1.1)
        return 0.1 * (1 - np.cos(s)), 0.1 * w * np.sin(s), 0.1 * w * w * np.cos(s)

    r = mg.respond(block(), (0, 3), motions={"P": rise}, loads=[])
    np.testing.assert_allclose(r["P"].position[-1], 0.2, atol=1e-12)


def turning(pose, twist, t):
    """A force that depends on the pose, the twist and time."""
    return (
        np.stack([0.03 * pose[..., 1, 2], -0.01 * twist[..., 0], 0.1 * np.cos(5 * t)], axis=-1) - 0.01 * twist[..., 3:]
    )


LAWS = {
    "between points": mg.ForceLaw(
        ("frame", "slider", (0, 0.3, 0), (0.2, 0, 0)), law=lambda x, v, t: -40 * (x - 0.2) - v**3
    ),
    "motor": mg.ForceLaw("A", law=mg.ForceTable(v=[-20, 0, 20], force=[0.5, 0.2, -0.2], outside="hold")),
    "stored table": mg.ForceLaw("D", law=mg.ForceTable(x=[-1, 0, 1], force=[9, 0, -4])),
    "winds up": mg.ForceLaw("A", law=lambda x, v, t: -0.05 * x),
    "in a freedom": mg.Effort("B.Rx", lambda pose, twist, t: 0.1 * twist[..., 1] - 0.2 * pose[..., 0, 2]),
    "turns with the link": mg.Wrench("rod", force=turning, moment=turning, point=(0.1, 0.0, 0.1), frame="link"),
    "fixed direction": mg.Wrench("rod", force=turning),
}


@pytest.mark.daily(3)
@pytest.mark.parametrize("what", LAWS)
def test_laws_along_the_path_give_the_accelerations_of_the_equations_of_motion(what):
    """Rates integrated with tabulated laws, their differences against the accelerations at closed states with the loads themselves."""
    m = slider_crank().replace(loads=[LAWS[what], mg.Gravity((0, 0, -9.81))])
    r = mg.respond(m, (0, 0.45), rates={"A": 30.0}, rtol=1e-9)
    assert r.work.coordinates == "along the path"
    assert r["A"].position[-1] > 7
    h = 1e-4
    at = r.at(np.array([0.1, 0.4])[:, None].repeat(5, 1).ravel() + np.tile(h * np.array([-2, -1, 0, 1, 2]), 2))
    v = at["A"].velocity.reshape(2, 5)
    np.testing.assert_allclose(v @ [1, -8, 0, 8, -1] / (12 * h), at["A"].acceleration.reshape(2, 5)[:, 2], rtol=2e-6)
    assert abs(at["A"].applied_effort).max() + abs(at.load(0).power).max() > 0.0


def test_a_motor_curve_costs_little_more_than_the_same_line_as_a_damper():
    """Counts, not time: the same stage, as many evaluations, and few closures of loops."""
    line = mg.ForceLaw("A", law=mg.ForceTable(v=[-100, 0, 100], force=[0.4, 0, -0.4]))
    motor, damper = (
        mg.respond(slider_crank().replace(loads=[load]), (0, 0.3), rates={"A": 20.0})
        for load in (line, mg.Damper("A", coefficient=0.004))
    )
    assert motor.work.coordinates == damper.work.coordinates == "along the path"
    assert motor.work.evaluations <= 1.1 * damper.work.evaluations
    np.testing.assert_allclose(motor["A"].position[-1], damper["A"].position[-1], rtol=1e-7)


@pytest.mark.daily(3)
@pytest.mark.parametrize("value", [4.9, 4.999, 5.0 - 1e-7])
@pytest.mark.parametrize("of", ["P", lambda s: float(s["P"].position[0])])
def test_a_throw_that_just_passes_a_height_passes_it_twice(of, value):
    """z = 10 t - 5 t^2, in a step or two."""
    r = mg.respond(block(mg.Gravity((0, 0, -10)), axis=Z), (0, 3), rates={"P": 10.0}, events=mg.Event(of, value))
    half = np.sqrt((5.0 - value) / 5.0)
    np.testing.assert_allclose([one.t for one in r.events], [1 - half, 1 + half], atol=1e-8)
    assert [one.rising for one in r.events] == [True, False]
    r = mg.respond(block(mg.Gravity((0, 0, -10)), axis=Z), (0, 3), rates={"P": 10.0}, events=mg.Event(of, 5.0 + 1e-6))
    assert not r.events


def test_what_an_event_passes_many_times_in_a_step_is_passed_each_time():
    """At a constant rate, in few long steps: a wave of the place, and a hump a six hundredth of the way wide."""
    events = [
        mg.Event(lambda s: np.sin(2 * s["P"].position[0]), 0.5),
        mg.Event(lambda s: np.exp(-np.square((s["P"].position[0] - 53.3) / 0.1)), 0.5),
    ]
    r = mg.respond(block(), (0, 100), rates={"P": 1.0}, events=events)
    assert r.work.steps < 20
    first = (np.pi * np.arange(64) + np.arcsin(0.5) * (-1.0) ** np.arange(64)) / 2
    np.testing.assert_allclose([one.t for one in r.events if one.event is events[0]], first, atol=1e-8)
    half = 0.1 * np.sqrt(np.log(2))
    np.testing.assert_allclose(
        [one.t for one in r.events if one.event is events[1]], [53.3 - half, 53.3 + half], atol=1e-8
    )


@pytest.mark.parametrize("limit", [0.9, 0.999, 1 - 1e-6])
def test_a_stop_that_is_just_grazed_is_met(limit):
    """An amplitude of 1 against a stop: met where -cos t reaches it, not where it does not."""
    m, start = block(mg.TorsionSpring("P", stiffness=1.0)), {"P": -1.0}
    r = mg.respond(m, (0, 6), start=start, stops=mg.Stop("P", upper=limit, restitution=1.0))
    np.testing.assert_allclose(
        -np.cos([one.t for one in r.events]), [limit], atol=2e-9
    )  # its rate there is 1.4e-3 and more
    assert not mg.respond(m, (0, 6), start=start, stops=mg.Stop("P", upper=1 + 1e-6)).events


@pytest.mark.parametrize("law", [np.sign, lambda v: np.where(v > 0, 1.0, -1.0)])
@pytest.mark.parametrize("place", ["P", ("frame", "body", (-9, 0, 0), (0, 0, 0))])
def test_dry_friction_in_a_law_is_named_where_it_sticks(law, place):
    """v = 1 - 2 t: up to there as it should be, then at once said which law, where and when."""
    m = block(mg.ForceLaw(place, law=lambda x, v, t: -2.0 * law(v)))
    with pytest.raises(
        mg.ResponseError, match=r"force law .*jumps by 4 where its rate changes sign.* at t = 0.5.*np.tanh"
    ) as stopped:
        mg.respond(m, (0, 3), rates={"P": 1.0})
    r = stopped.value.solution
    assert r.work.steps < 100
    np.testing.assert_allclose(r["P"].position[-1], 0.25, atol=1e-6)


def test_friction_that_slides_on_or_rises_with_the_rate_is_followed():
    """Turned round by a strong spring without sticking: amplitudes fall by 4 F / k a period; and a steep tanh."""
    m = block(mg.ForceLaw("P", law=lambda x, v, t: -0.01 * np.sign(v)), mg.TorsionSpring("P", stiffness=1.0))
    r = mg.respond(m, np.array([0.0, np.pi, 2 * np.pi]), start={"P": 1.0})
    np.testing.assert_allclose(r["P"].position[:, 0], [1.0, -0.98, 0.96], atol=1e-5)
    smooth = block(mg.ForceLaw("P", law=lambda x, v, t: -2.0 * np.tanh(v / 1e-2)))
    assert abs(mg.respond(smooth, (0, 1), rates={"P": 1.0})["P"].velocity[-1, 0]) < 1e-6


def test_breaks_belong_to_functions():
    for load in (
        mg.Effort("P", 1.0, breaks=(1,)),
        mg.ForceLaw("P", law=mg.ForceTable(x=[0, 1], force=[0, 1]), breaks=2.0),
    ):
        with pytest.raises(mg.DeclarationError, match=r"breaks = .* beside no function of time"):
            block(load)
    with pytest.raises(mg.DeclarationError, match=r"breaks = 'soon': expected finite numbers that rise"):
        block(mg.ForceLaw("P", law=lambda x, v, t: -x, breaks="soon"))


@pytest.mark.parametrize("breaks", [(2.0, 1.0), (1.0, 1.0), [[1.0], [2.0]], [[1.0, 2.0], 3.0], (0.0, np.inf)])
def test_breaks_rise(breaks):
    for load in (
        mg.Effort("P", lambda pose, twist, t: t, breaks=breaks),
        mg.ForceLaw("P", law=lambda x, v, t: -x, breaks=breaks),
        mg.Wrench("body", force=lambda p, w, t: X, breaks=breaks),
    ):
        with pytest.raises(mg.DeclarationError, match=r"1 fault\n.*breaks = .*: expected finite numbers that rise"):
            block(load)


@pytest.mark.parametrize("place", [0.233, 0.356, 0.4682, 0.72])
@pytest.mark.parametrize("kind", ["function", "table"])
def test_a_hump_on_which_only_the_polynomial_of_a_step_stands_is_not_missed(kind: str, place: float) -> None:
    """1 kg at 1 m/s gains the work of a hump of 7.5 mm that the stages of a step pass by; a table may end where only a trial state goes."""
    x, force = place + 0.0075 * np.array([0.0, 0.25, 0.5, 1.0]), np.array([0.0, 1.0, 1.0, 0.0]) * 800.0 / 3.0
    laws = {
        "function": lambda q, v, t: np.interp(q, x, force),
        "table": mg.ForceTable(x=[-9.0, *x, 9.0], force=[0.0, *force, 0.0]),
    }
    slide = mg.Pair("A", "P", "frame", "a", point=(0, 0, 0), axis=(1, 0, 0))
    links = [mg.Link("frame"), mg.Link("a", 1.0, (0, 0, 0))]
    m = mg.Mechanism("slide", links, [slide], loads=[mg.ForceLaw("A", law=laws[kind])])
    r = mg.respond(m, (0.0, 1.0), rates={"A": 1.0})
    assert r["A"].velocity[-1, 0] == pytest.approx(np.sqrt(1.0 + 2.0 * np.trapezoid(force, x)), abs=1e-5)


@pytest.mark.parametrize("second", [1.0, 1e-6])
def test_a_weak_spring_winds_up_whatever_the_unit_of_time(second: float) -> None:
    """Many turns against a spring that is nothing beside the inertia in one of the units: sin(w t) / w."""
    k = 4e-4 * second**2
    links = [mg.Link("frame"), mg.Link("wheel", 1.0, (0, 0, 0), np.eye(3))]
    axle = mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=(0, 0, 1))
    m = mg.Mechanism("wheel", links, [axle], loads=[mg.TorsionSpring("A", k)])
    r = mg.respond(m, np.linspace(0.0, 150.0 / second, 6), rates={"A": second})
    np.testing.assert_allclose(r["A"].position[:, 0], 50.0 * np.sin(0.02 * np.linspace(0.0, 150.0, 6)), atol=1e-4)


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(("off", "begin"), [(0.003, 4.5), (0.1, np.pi)])
def test_a_peak_of_the_mass_beside_a_change_point_is_not_stepped_over(off: float, begin: float) -> None:
    """A crank whose pin passes the pivot of its guide at a distance: t is the integral of sqrt(M / E) over its angle."""
    far, turn = 1.0 + off, 4.6 * np.pi
    pin, pivot = np.array([np.cos(begin), np.sin(begin), 0.0]), np.array([far, 0.0, 0.0])
    links = [mg.Link("frame"), mg.Link("block")]
    links += [mg.Link(name, 1.0, at, np.eye(3)) for name, at in (("crank", (0, 0, 0)), ("guide", pivot))]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "crank", "block", point=pin, axis=Z),
        mg.Pair("C", "P", "guide", "block", point=pin, axis=pin - pivot),
        mg.Pair("D", "R", "frame", "guide", point=pivot, axis=Z),
    ]

    def root_of_mass(angle: float) -> float:
        ratio = (1.0 - far * np.cos(angle)) / (1.0 + far**2 - 2.0 * far * np.cos(angle))
        return float(np.sqrt(1.0 + ratio**2))

    peaks = 2.0 * np.pi * np.arange(1, 4)[:, None] + [-0.1, -0.01, 0.0, 0.01, 0.1]
    ends = [begin, *(at for at in np.sort(peaks.ravel()).tolist() if at < begin + turn), begin + turn]
    parts = [scipy.integrate.quad(root_of_mass, *part, epsabs=1e-11)[0] for part in pairwise(ends)]
    r = mg.respond(mg.Mechanism("guide", links, pairs), (0.0, sum(parts) / root_of_mass(begin)), rates={"A": 1.0})
    assert r["A"].position[-1, 0] == pytest.approx(turn, abs=1e-6)
