"""Change points leapt over: only true ones, and onto the branch that goes on."""

import numpy as np
import pytest
import scipy

import mechgraph as mg
from mechgraph.kernel import build
from mechgraph.kinematics.assembly import assembled_at
from mechgraph.response.along_path import POINTS, Arc, Way, _coarse
from mechgraph.response.charts import Prescribed, Task, differentiated, samples_fault
from mechgraph.response.motion_equations import KernelPath, Loads

Z = np.eye(3)[2]


def way(lower, engine="dense", bars=1, narrower=0.0):
    """Half a turn of ``bars`` parallelograms in a row, the last foot lower or nearer; they are flat after a right angle."""
    links = [mg.Link("frame"), *(mg.Link(f"c{i}", mass=1.0, center=(i, 0.5, 0)) for i in range(bars + 1))]
    links += [mg.Link(f"r{i}", mass=1.0, center=(i + 0.5, 1, 0)) for i in range(bars)]
    feet = [(i - narrower * (i == bars), -lower * (i == bars), 0) for i in range(bars + 1)]
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"c{i}", point=foot, axis=Z) for i, foot in enumerate(feet)]
    for i in range(bars):
        pairs.append(mg.Pair(f"B{i}", "R", f"c{i}", f"r{i}", point=(i, 1, 0), axis=Z))
        pairs.append(mg.Pair(f"C{i}", "R", f"r{i}", f"c{i + 1}", point=(i + 1, 1, 0), axis=Z))
    m = mg.Mechanism("parallelograms", links, pairs)
    system, x = assembled_at(m, {})
    loads, numpy = Loads((), ()), "dense" if engine == "compiled" else engine
    task = Task(system, loads, Prescribed({}), np.zeros(0, dtype=np.intp), numpy)
    arc = Arc(task, x, np.zeros(system.n_freedoms))
    kernel = KernelPath(build.built(), system, arc.column, x, loads) if engine == "compiled" else None
    out = Way(arc.path, arc.terms, x, -1.0, kernel)
    out.extend(2.0)
    out.extend(2.5)
    return out


@pytest.mark.daily(4)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    ("engine", "bars"),
    [("dense", 1), ("dense", 3), ("sparse", 1), ("sparse", 3), ("sparse", 100), ("compiled", 1), ("compiled", 3)],
)
def test_a_change_point_is_leapt_over(engine, bars):
    """The cranks stay parallel behind it, and no step was taken with care."""
    w = way(0.0, engine, bars)
    assert [c.place for c in w.crossings] == pytest.approx([np.pi / 2], abs=1e-3)
    assert w.follower.work.careful == 0
    assert w.length > 2.0
    at = np.array([1.0, np.pi / 2 - 1e-4, np.pi / 2, 1.6, 2.0])
    x, _ = w.states(at)
    cranks = x[w.path.system.single_rows[: bars + 1]]
    np.testing.assert_allclose(np.abs(cranks), np.broadcast_to(at, (bars + 1, 5)), atol=1e-12)


@pytest.mark.daily(2)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("engine", ["dense", "compiled"])
@pytest.mark.parametrize("lower", [1e-3, 1e-6, 1e-9, 1e-10])
def test_what_is_no_change_point_is_not_leapt_over(lower, engine):
    """One foot off the line by a little opens the crossing: the branches turn back before it, at a distance of the root of that.

    A foot that is off by 1e-11, as the digits of a declaration leave it, counts as on the line: with and without a leap.
    """
    w = way(lower, engine)
    assert not w.crossings
    assert w.follower.work.careful > 0 or lower == 1e-3  # branches a thirtieth of a step apart need no care
    assert w.closed


def test_pieces_are_halved_for_what_they_leave_out_and_not_for_rounding():
    """A series of noise stays noise however short its piece is; one that has not converged does not."""
    rng = np.random.default_rng(1)
    smooth = np.outer(0.05 ** np.arange(POINTS), [1.0, 0.3, 0.0, 0.0])
    rounding = np.zeros((POINTS, 4))
    rounding[:, 2] = 1e-13 * rng.normal(size=POINTS)
    slow = smooth.copy()
    slow[:, 2] = 1e-3 * 0.6 ** np.arange(POINTS)
    assert not _coarse(smooth, 0.0)
    assert not _coarse(smooth + rounding, 0.0)
    assert _coarse(slow, 0.0)
    assert _coarse(smooth + 1e6 * rounding, 0.0)


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("engine", ["dense", "compiled"])
def test_noise_beside_a_crossing_that_is_open_makes_no_more_pieces(engine):
    """Rounding grows with the square of the condition: where the branches pass each other no shorter series is free of it."""
    w = way(0.0, engine, narrower=3e-8)
    assert w.length > 2.0
    assert len(w.pieces) < 90


def test_motions_of_functions_break_where_their_acceleration_jumps():
    """A harmonic rise between dwells; revolutions far faster than what is looked at beside a large offset."""

    def rise(t):
        if not 1.1 < t < 1.4:
            return 0.0 if t <= 1.1 else 0.2, 0.0, 0.0
        w = np.pi / 0.3
        s = w * (t - 1.1)
        return 0.1 * (1 - np.cos(s)), 0.1 * w * np.sin(s), 0.1 * w * w * np.cos(s)

    np.testing.assert_allclose(differentiated(rise, 0.0, 3.0), [1.1, 1.4], atol=1e-6)
    assert (
        differentiated(lambda t: (1e3 + np.sin(9e3 * t), 9e3 * np.cos(9e3 * t), -81e6 * np.sin(9e3 * t)), 0.0, 3.0)
        == ()
    )


def test_coarse_samples_of_a_sine_and_of_a_trapezoidal_velocity_are_right():
    t = np.arange(0, 7, 1.2)
    assert samples_fault(t, np.stack([np.sin(t), np.cos(t), -np.sin(t)], axis=1)) == ""
    t = np.linspace(0, 4, 17)
    ramp = np.interp(t, [0, 1, 3, 4], [0, 1, 1, 0])
    position = scipy.integrate.cumulative_trapezoid(ramp, dx=0.25, initial=0)
    slope = np.select([t < 1, t > 3], [1.0, -1.0])
    assert samples_fault(t, np.stack([position, ramp, slope], axis=1)) == ""
