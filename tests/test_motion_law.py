"""Motions and their laws: end values, derivatives, accuracy, what is refused."""

import copy
import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "drive-by-a-law.md"
LAWS = re.findall(
    r'^\| `"(\w+)"` \| `(?:rise|speed|samples|conditions|start)', PAGE.read_text(encoding="utf-8"), re.MULTILINE
)
"""What the manual lists."""
RISES = ["cycloidal", "harmonic", "poly345", "poly4567"]
H, T, START = 1.7, 0.4, -0.3


def rise(name, t):
    return mg.Motion.law(name, H, T, t, start=START)


def faults(*args, **kwargs):
    with pytest.raises(mg.DeclarationError) as caught:
        mg.Motion.law(*args, **kwargs)
    return "\n".join(caught.value.faults)


# ---- Motion


def test_rates_left_out_are_zero():
    motion = mg.Motion([1.0, 2.0])
    np.testing.assert_array_equal(motion.velocity, [0.0, 0.0])
    np.testing.assert_array_equal(motion.acceleration, [0.0, 0.0])
    assert motion.t is None


def test_arrays_broadcast_and_are_float64():
    motion = mg.Motion(np.zeros((3, 1), dtype=int), velocity=[1, 2], acceleration=5, t=[0.0, 1.0])
    assert motion.shape == (3, 2)
    for array in (motion.position, motion.velocity, motion.acceleration, motion.t):
        assert array.shape == (3, 2)
        assert array.dtype == np.float64
    np.testing.assert_array_equal(motion.velocity[2], [1.0, 2.0])


def test_one_position_has_no_leading_axis():
    assert mg.Motion(1.0).shape == ()
    assert mg.Motion(1.0, velocity=[2.0]).shape == (1,)


def test_arrays_are_copies_and_read_only():
    theirs = np.zeros(3)
    motion = mg.Motion(theirs, velocity=theirs, t=theirs)
    theirs[:] = 7.0
    np.testing.assert_array_equal(motion.position, 0.0)
    for array in (motion.position, motion.velocity, motion.acceleration, motion.t):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(AttributeError):
        motion.position = theirs


def test_equality_is_exact():
    motion = mg.Motion([1.0, 2.0], 3.0)
    assert motion == mg.Motion([1.0, 2.0], [3.0, 3.0], 0.0)
    assert motion != mg.Motion([1.0, 2.0 + 1e-15], 3.0)
    assert motion != mg.Motion([1.0, 2.0], 3.0, t=[0.0, 1.0])
    assert motion != mg.Motion([[1.0, 2.0]], 3.0)
    assert motion != "motion"
    assert hash(mg.Motion(0.0)) == hash(mg.Motion(-0.0))


def test_copies_are_equal_and_read_only():
    motion = mg.Motion([1.0, 2.0], 3.0, t=[0.0, 1.0])
    for again in (copy.deepcopy(motion), pickle.loads(pickle.dumps(motion))):
        assert again == motion
        assert not again.position.flags.writeable


def test_repr_is_short():
    assert repr(mg.Motion(0.5, 10)) == "Motion(position=0.5, velocity=10, acceleration=0)"
    assert repr(mg.Motion(np.arange(360.0), 10)) == (
        "Motion(shape=(360,), position=0..359, velocity=10, acceleration=0)"
    )


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"position": np.nan}, "position must be finite, got nan"),
        ({"position": [0.0, np.inf]}, "position must be finite, got inf at index (1,)"),
        ({"position": "fast"}, "expected a real number"),
        ({"position": None}, "expected a real number"),
        ({"position": 1j}, "expected a real number"),
        ({"position": [[1.0], [1.0, 2.0]]}, "rows of one length"),
        ({"position": np.zeros(3), "velocity": np.zeros(2)}, "position (3,), velocity (2,)"),
    ],
)
def test_what_is_no_motion_is_refused(arguments, says):
    with pytest.raises(mg.DeclarationError) as caught:
        mg.Motion(**arguments)
    assert says in "\n".join(caught.value.faults)


def test_all_faults_are_told_at_once():
    with pytest.raises(mg.DeclarationError) as caught:
        mg.Motion(np.nan, "fast", t=np.inf)
    assert len(caught.value.faults) == 3


# ---- dwell, rise, dwell


@pytest.mark.parametrize("name", RISES)
def test_rise_starts_and_ends_where_it_should(name):
    motion = rise(name, [-1.0, 0.0, T / 2, T, 2.0])
    expected = [START, START, START + H / 2, START + H, START + H]
    np.testing.assert_allclose(motion.position, expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(motion.velocity[[0, 1, 3, 4]], 0.0, atol=2e-15)
    np.testing.assert_array_equal(motion.acceleration[[0, 4]], 0.0)
    np.testing.assert_array_equal(motion.t, [-1.0, 0.0, T / 2, T, 2.0])


@pytest.mark.parametrize("name", RISES)
def test_rates_are_the_derivatives_with_second_order(name):
    t = np.linspace(0.1, 0.9, 23) * T
    motion = rise(name, t)
    errors = []
    for h in (T * 1e-2, T * 5e-3):
        ahead, behind = rise(name, t + h), rise(name, t - h)
        velocity = (ahead.position - behind.position) / (2 * h)
        acceleration = (ahead.velocity - behind.velocity) / (2 * h)
        errors.append([np.abs(velocity - motion.velocity).max(), np.abs(acceleration - motion.acceleration).max()])
    np.testing.assert_allclose(np.log2(np.divide(*errors)), 2.0, atol=0.05)
    assert errors[1][0] < 1e-3 * np.abs(motion.velocity).max()


@pytest.mark.parametrize(
    ("name", "velocity", "acceleration"),
    [
        ("cycloidal", 2.0, 2 * np.pi),
        ("harmonic", np.pi / 2, np.pi**2 / 2),
        ("poly345", 15 / 8, 10 / np.sqrt(3)),
        ("poly4567", 35 / 16, 84 / (5 * np.sqrt(5))),
    ],
)
def test_largest_rates_are_the_published_ones(name, velocity, acceleration):
    motion = rise(name, np.linspace(0, T, 20001))
    assert np.abs(motion.velocity).max() * T / H == pytest.approx(velocity, rel=1e-7)
    assert np.abs(motion.acceleration).max() * T**2 / H == pytest.approx(acceleration, rel=1e-7)


@pytest.mark.parametrize("end", [0.0, T])
@pytest.mark.parametrize("name", RISES)
def test_acceleration_is_continuous_except_for_harmonic(name, end):
    before, after = rise(name, np.array([end - 1e-12, end + 1e-12])).acceleration
    jump = abs(after - before) * T**2 / H
    assert jump == pytest.approx(np.pi**2 / 2 if name == "harmonic" else 0.0, abs=1e-9)


def test_a_negative_rise_is_a_return():
    there, back = rise("cycloidal", 0.1), mg.Motion.law("cycloidal", -H, T, 0.1, start=START + H)
    np.testing.assert_allclose(there.position + back.position, 2 * START + H)
    np.testing.assert_allclose(there.acceleration, -back.acceleration)


def test_laws_take_cases_on_leading_axes():
    t = np.linspace(0.0, 1.0, 7)
    many = mg.Motion.law("poly345", np.array([[1.0], [2.0]]), np.array([[0.5], [1.0]]), t)
    assert many.shape == (2, 7)
    np.testing.assert_array_equal(many.velocity[1], mg.Motion.law("poly345", 2.0, 1.0, t).velocity)


@pytest.mark.parametrize("name", [*RISES, "constant_speed"])
def test_scalar_time_has_no_leading_axis(name):
    motion = mg.Motion.law(name, 1.0, 2.0, 0.5)
    assert motion.shape == ()
    assert motion.t.shape == ()


def test_constant_speed_knows_no_end():
    t = np.array([-1.0, 0.0, 5.0])
    motion = mg.Motion.law("constant_speed", 3.0, 2.0, t, start=1.0)
    np.testing.assert_allclose(motion.position, 1.0 + 1.5 * t)
    np.testing.assert_array_equal(motion.velocity, 1.5)
    np.testing.assert_array_equal(motion.acceleration, 0.0)
    assert motion == mg.Motion.law("constant_speed", speed=1.5, start=1.0, t=t)


# ---- samples


@pytest.mark.parametrize("degree", [3, 5])
def test_splines_converge_with_their_order(degree):
    t = np.linspace(0.0, 3.0, 301)
    errors = []
    for n in (41, 81):
        times = np.linspace(0.0, 3.0, n)
        motion = mg.Motion.law("sampled", t=t, samples=(times, np.sin(times)), degree=degree)
        exact = (np.sin(t), np.cos(t), -np.sin(t))
        got = (motion.position, motion.velocity, motion.acceleration)
        errors.append([np.abs(a - b).max() for a, b in zip(got, exact, strict=True)])
    orders = np.log2(np.divide(*errors))
    assert (orders > degree + 1 - np.arange(3) - 0.35).all()


def test_spline_passes_through_its_samples_and_takes_quintics_exactly():
    times = np.array([0.0, 0.3, 0.5, 1.1, 1.4, 2.0, 2.2])
    quintic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.2])
    motion = mg.Motion.law("sampled", t=times, samples=(times, quintic(times)))
    np.testing.assert_allclose(motion.position, quintic(times), atol=1e-12)
    np.testing.assert_allclose(motion.velocity, quintic.deriv(1)(times), atol=1e-11)
    np.testing.assert_allclose(motion.acceleration, quintic.deriv(2)(times), atol=1e-10)


def test_few_samples_make_a_cubic():
    times = np.arange(4.0)
    motion = mg.Motion.law("sampled", t=1.5, samples=(times, times**3))
    assert motion.shape == ()
    assert motion.acceleration == pytest.approx(9.0)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            {"t": 3.5, "samples": (range(4), range(4))},
            "t = 3.5 is outside the samples, which run from 0 to 3",
        ),
        ({"t": -0.1, "samples": (range(4), range(4))}, "t = -0.1 is outside"),
        ({"t": 1.0, "samples": (range(3), range(3))}, "at least 4"),
        ({"t": 1.0, "samples": (range(5), range(4))}, "same length"),
        ({"t": 1.0, "samples": ([0, 1, 1, 2], range(4))}, "1 is followed by 1"),
        ({"t": 1.0, "samples": ([0, 1, 2, np.nan], range(4))}, "must be finite"),
        ({"t": 1.0, "samples": 3.0}, "pair (times, values)"),
        ({"t": 1.0, "samples": (range(5), range(5)), "degree": 5}, "got 5 with 5 samples"),
        ({"t": 1.0, "samples": (range(5), range(5)), "degree": 4}, "degree must be 3"),
        ({"t": 1.0, "samples": (range(5), range(5)), "start": 1.0}, "start is not an argument"),
        ({"t": 1.0}, "it needs samples"),
    ],
)
def test_sample_faults(arguments, says):
    assert says in faults("sampled", **arguments)


def test_rounding_at_the_ends_of_the_samples_is_no_fault():
    times = np.linspace(0.0, 0.3, 7)
    assert mg.Motion.law("sampled", t=0.1 * 3, samples=(times, times)).position == pytest.approx(0.3)


# ---- callables


def relative(got, exact):
    return np.abs(got - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize("end", [0.1, 1.0, 2 * np.pi, 300.0])
@pytest.mark.parametrize("offset", [0.0, 5.0])
def test_sine_is_differentiated_to_1e_8(end, offset):
    t = np.linspace(0.0, end, 1001)
    motion = mg.Motion.law(lambda t: offset + np.sin(t), t=t)
    np.testing.assert_array_equal(motion.position, offset + np.sin(t))
    assert relative(motion.velocity, np.cos(t)) < 1e-10
    # 5 + sin t on [0, 0.1]: eps |f| (2 / l)^2 alone is 4e-12 of the acceleration, and n^4 comes upon it
    assert relative(motion.acceleration, -np.sin(t)) < (1e-7 if offset and end < 1.0 else 1e-8)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_accuracy_does_not_depend_on_the_unit_of_time(scale):
    t = np.linspace(0.0, 10.0, 101) * scale
    motion = mg.Motion.law(lambda t: np.sin(t / scale), t=t)
    assert relative(motion.velocity * scale, np.cos(t / scale)) < 1e-11
    assert relative(motion.acceleration * scale**2, -np.sin(t / scale)) < 1e-10


def test_local_features_are_resolved():
    t = np.linspace(-1.0, 1.0, 801)
    motion = mg.Motion.law(lambda t: np.arctan(100 * t), t=t)
    assert relative(motion.acceleration, -2e6 * t / (1 + 1e4 * t**2) ** 2) < 1e-9


def test_jumps_between_panels_are_refused_too():
    """A kink in the middle of the range is where the panels part, each of which is smooth by itself."""
    t = np.linspace(0.0, 2.0, 21)
    assert "near t = 1 " in faults(lambda t: np.abs(t - 1.0), t=t)
    assert "near t = 1 " in faults(lambda t: mg.Motion.law("harmonic", 1.0, 1.0, t).position, t=t)
    smooth = mg.Motion.law(lambda t: mg.Motion.law("poly345", 1.0, 1.0, t).position, t=t)
    exact = mg.Motion.law("poly345", 1.0, 1.0, t)
    np.testing.assert_allclose(smooth.acceleration, exact.acceleration, atol=1e-9)


def test_callable_is_never_called_outside_the_times():
    seen = []

    def position(t):
        seen.append((np.min(t), np.max(t)))
        return np.exp(t)

    mg.Motion.law(position, t=[2.0, 2.5, 4.0])
    assert min(low for low, _ in seen) >= 2.0
    assert max(high for _, high in seen) <= 4.0


def test_scalar_time_and_scalar_functions():
    motion = mg.Motion.law(math.sin, t=0.7)
    assert motion.shape == ()
    assert motion.acceleration == pytest.approx(-math.sin(0.7), rel=1e-8)
    cycle = mg.Motion.law(lambda t: math.sin(t), t=[[0.0, 1.0], [2.0, 3.0]])
    np.testing.assert_allclose(cycle.velocity, np.cos([[0.0, 1.0], [2.0, 3.0]]), rtol=1e-10)


@pytest.mark.slow
def test_one_single_time_finds_a_range_that_serves():
    assert mg.Motion.law(np.sin, t=1e5).acceleration == pytest.approx(-np.sin(1e5), abs=1e-5)
    root = mg.Motion.law(np.sqrt, t=0.01)  # exists to the right of 0 only
    assert root.velocity == pytest.approx(5.0, rel=1e-9)
    assert root.acceleration == pytest.approx(-250.0, rel=1e-7)
    assert "not smooth enough near t = 0.5" in faults(lambda t: np.abs(t - 0.5), t=0.5)


def test_no_times_make_no_positions():
    assert mg.Motion.law(np.sin, t=[]).shape == (0,)


def test_lines_and_constants_have_no_acceleration():
    t = np.linspace(0.0, 7.0, 50)
    line = mg.Motion.law(lambda t: 3.0 + 2.0 * t, t=t)
    np.testing.assert_allclose(line.velocity, 2.0, rtol=1e-13)
    np.testing.assert_array_equal(line.acceleration, 0.0)
    np.testing.assert_array_equal(mg.Motion.law(lambda t: 3.0, t=t).velocity, 0.0)


def test_rates_that_the_callable_returns_are_taken_as_they_are():
    t = np.linspace(0.0, 1.0, 5)
    motion = mg.Motion.law(lambda t: (t**2, 2 * t, 2.0), t=t)
    assert motion == mg.Motion(t**2, 2 * t, 2.0, t=t)
    scalar = mg.Motion.law(lambda t: (math.sin(t), math.cos(t), -math.sin(t)), t=t)
    np.testing.assert_allclose(scalar.acceleration, -np.sin(t))


def test_noise_is_refused_after_a_few_looks():
    """Halved everywhere it would be asked at two million times."""
    asked = []

    def noise(t):
        asked.append(np.size(t))
        return np.random.default_rng(len(asked)).normal(size=np.shape(t))

    assert "not smooth enough" in faults(noise, t=np.linspace(0.0, 1.0, 11))
    assert sum(asked) < 100_000


@pytest.mark.parametrize("function", [lambda t: np.abs(t - 0.3), lambda t: np.abs(t - 0.3) ** 3, np.ceil])
def test_kinks_are_refused_not_smeared(function):
    said = faults(function, t=np.linspace(0.0, 1.0, 11))
    assert "not smooth enough near t = " in said
    assert "return (position, velocity, acceleration)" in said


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (lambda t: (t, t), "tuple of 2"),
        (lambda t: t[:1], "shape (1,)"),
        (lambda t: np.log(t - 10.0 + 0 * t) if np.ndim(t) == 0 else np.full(np.shape(t), np.nan), "finite"),
        (lambda t: "far", "real number"),
        (lambda t: [math.sin(t), 0.0], "one number a time"),
    ],
)
def test_callables_that_return_something_else(function, says):
    assert says in faults(function, t=np.linspace(0.0, 1.0, 5))


# ---- arguments


def test_unknown_law_lists_the_known():
    said = faults("cycloid", 1.0, 1.0, 0.0)
    assert "'cycloid'" in said
    assert all(name in said for name in LAWS)
    assert len(re.findall(r"\w+", said.partition("use ")[2].partition(" or ")[0])) == len(LAWS)


@pytest.mark.parametrize(
    ("args", "kwargs", "says"),
    [
        (("cycloidal", 1.0), {"t": 0.0}, "it needs rise and duration"),
        (("cycloidal", 1.0, 1.0), {}, "t is missing"),
        (("cycloidal", 1.0, 0.0, 0.0), {}, "duration must be positive"),
        (("cycloidal", 1.0, 1.0, np.nan), {}, "t must be finite"),
        (("cycloidal", 1.0, 1.0, 0.0), {"speed": 1.0}, "speed is not an argument"),
        (("cycloidal", [1.0, 2.0], 1.0, np.zeros(3)), {}, "t (3,), rise (2,), duration ()"),
        (("constant_speed",), {"t": 0.0}, "it needs rise and duration, or speed"),
        (("constant_speed", 1.0, 1.0, 0.0), {"speed": 1.0}, "not both"),
        ((np.sin, 1.0), {"t": 0.0}, "rise is not an argument"),
    ],
)
def test_argument_faults(args, kwargs, says):
    assert says in faults(*args, **kwargs)


def test_a_motion_with_times_and_without_rates_has_those_of_the_spline() -> None:
    """sin(3 t): the spline's rates, as `sampled` gives them, near 3 cos(3 t); without times, or with velocity=0.0, at rest."""
    t = np.linspace(0, 2, 81)
    motion, law = mg.Motion(np.sin(3 * t), t=t), mg.Motion.law("sampled", samples=(t, np.sin(3 * t)), t=t)
    assert np.abs(motion.velocity - 3 * np.cos(3 * t)).max() < 1e-6
    assert np.abs(motion.acceleration + 9 * np.sin(3 * t)).max() < 1e-4
    np.testing.assert_array_equal(motion.velocity, law.velocity)
    np.testing.assert_array_equal(motion.acceleration, law.acceleration)
    for still in (mg.Motion(np.sin(3 * t), velocity=0.0, t=t), mg.Motion(np.sin(3 * t))):
        assert not still.velocity.any()
        assert not still.acceleration.any()


def test_rates_that_are_left_out_follow_from_those_given_case_by_case() -> None:
    t = np.linspace(0, 1, 12)
    cases = np.array([[1.0], [2.0]])
    motion = mg.Motion(cases * t**2, t=t)
    np.testing.assert_allclose(motion.velocity, 2 * cases * t, atol=1e-12)
    np.testing.assert_allclose(motion.acceleration, 2 * cases + 0 * t, atol=1e-10)
    np.testing.assert_allclose(mg.Motion(t**2, velocity=2 * t, t=t).acceleration, 2.0, atol=1e-11)
    np.testing.assert_allclose(mg.Motion(t**2, acceleration=2.0, t=t).velocity, 2 * t, atol=1e-12)
    np.testing.assert_allclose(
        mg.Motion([1.0, 2.0, 4.0], t=[0, 1, 2]).velocity, [0.5, 1.5, 2.5]
    )  # the parabola through three
    assert mg.Motion(1.0, t=2.0).velocity == 0.0


def test_times_that_do_not_increase_give_no_rates() -> None:
    with pytest.raises(mg.DeclarationError, match="t must increase"):
        mg.Motion([1.0, 2.0, 3.0], t=[0.0, 1.0, 1.0])
    assert not mg.Motion([1.0, 2.0, 3.0], velocity=0.0, t=[0.0, 1.0, 1.0]).acceleration.any()


def test_a_stored_motion_with_times_keeps_rest_and_takes_rates(tmp_path) -> None:
    """An arm of 2 kg at 0.5 m on its hinge: the torque is I q''; at rest it is zero, also after a file."""
    t = np.linspace(0, 1, 30)
    arm = mg.Mechanism("arm", [mg.Link("frame"), mg.Link("arm", 2.0, (0.5, 0, 0))],
                       [mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1))])  # fmt: skip
    for motion, expected in ((mg.Motion(t**3, t=t), 0.5 * 6 * t), (mg.Motion(t**3, velocity=0.0, t=t), 0 * t)):
        m = arm.replace(drives=[mg.Drive("A", motion)])
        mg.save(m, tmp_path / "arm.toml")
        for one in (m, mg.load(tmp_path / "arm.toml")):
            np.testing.assert_allclose(mg.solve(one)["A"].effort[:, 0], expected, atol=1e-9)


def test_rates_of_a_function_that_are_not_the_derivatives_are_refused():
    """60 percent too large, or of the wrong sign: never taken; true ones are, also with a jump of the acceleration."""
    t = np.linspace(0.0, 3.0, 31)
    true = lambda t: (np.sin(t), np.cos(t), -np.sin(t))
    assert mg.Motion.law(true, t=t).velocity[0] == 1.0
    jumps = lambda t: (np.maximum(t - 1, 0) ** 2, 2 * np.maximum(t - 1, 0), 2.0 * (t > 1))
    assert mg.Motion.law(jumps, t=t).acceleration[-1] == 2.0
    assert "velocity that it returns is not the rate of the position" in faults(
        lambda t: (np.sin(t), 1.6 * np.cos(t), -np.sin(t)), t=t
    )
    assert "acceleration that it returns is not the rate of the velocity" in faults(
        lambda t: (np.sin(t), np.cos(t), np.sin(t)), t=t
    )
