"""Stops of freedoms in a motion: impacts, rests and releases against closed forms and the balance of energy."""

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = np.eye(3)
G = 9.81


def body(name, mass=1.0, center=(0, 0, 0)):
    return mg.Link(name, mass=mass, center=center, inertia=0.01 * np.eye(3))


def slide(loads=(), mass=1.0):
    """A body on a vertical slide."""
    pairs = [mg.Pair("A", "P", "frame", "ball", point=(0, 0, 0), axis=Y)]
    return mg.Mechanism("slide", [mg.Link("frame"), body("ball", mass)], pairs, loads=[mg.Gravity((0, -G, 0)), *loads])


def pushed(pose, twist, t):
    """A function of time; the motion is then followed in charts, not along a path."""
    return 0.0 * t


def square(loads=()):
    """A parallelogram of massive cranks of 1 m, coupler 2 m, in a level plane unless loaded."""
    links = [
        mg.Link("frame"),
        body("a", center=(0, 0.5, 0)),
        body("c", center=(1, 1, 0)),
        body("b", center=(2, 0.5, 0)),
    ]
    ends = [
        ("A", "frame", "a", (0, 0, 0)),
        ("B", "a", "c", (0, 1, 0)),
        ("C", "c", "b", (2, 1, 0)),
        ("D", "frame", "b", (2, 0, 0)),
    ]
    return mg.Mechanism(
        "parallelogram", links, [mg.Pair(n, "R", p, q, point=at, axis=Z) for n, p, q, at in ends], loads=list(loads)
    )


@pytest.mark.daily(1)
@pytest.mark.parametrize("loads", [(), (mg.Effort("A", pushed),)])
def test_a_ball_bounces_less_and_less_and_comes_to_rest(loads):
    """Dropped from h it strikes at sqrt(2 h / g) (1 + 2 e + 2 e^2 + ...) and rests from (1 + e) / (1 - e) times the first time on."""
    h, e = 1.0, 0.5
    first = np.sqrt(2 * h / G)
    r = mg.respond(
        slide(loads),
        np.linspace(0, 3, 301),
        start={"A": h},
        rtol=1e-11,
        atol=1e-13,
        stops=mg.Stop("A", lower=0.0, restitution=e),
    )
    times = np.array([one.t for one in r.events])
    exact = first * (1 + 2 * np.cumsum(e ** np.arange(1, 9)))
    np.testing.assert_allclose(times[:9], [first, *exact], atol=1e-7)
    assert times[-1] == pytest.approx(first * (1 + e) / (1 - e), abs=1e-3)
    assert str(r.events[0]).startswith("A meets its lower stop at t = 0.45")
    resting = r.t > times[-1]
    assert resting.sum() > 100
    np.testing.assert_allclose(r["A"].position[resting], 0.0, atol=1e-12)
    np.testing.assert_allclose(r["A"].applied_effort[resting], G, rtol=1e-12)
    assert np.abs(r["A"].applied_effort[~resting]).max() == 0.0
    assert r["A"].position.min() > -1e-8
    assert np.abs(r.energy.balance).max() < 1e-7
    # all energy is lost: m g h
    assert r.energy.work[-1] == pytest.approx(-G * h, rel=1e-9)


def test_an_elastic_stop_keeps_the_energy_along_a_path():
    """A crank of a parallelogram between two elastic stops strikes them at even times."""
    r = mg.respond(
        square(), (0, 10), start={"A": 0.0}, rates={"A": 0.7}, rtol=1e-11, atol=1e-13,
        stops=[mg.Stop("A", lower=-0.5, upper=0.3, restitution=1.0)],
    )  # fmt: skip
    # the parallelogram's coupler translates: without gravity its speed is constant
    times = np.array([one.t for one in r.events])
    np.testing.assert_allclose(np.diff(times), 0.8 / 0.7, atol=1e-8)
    assert [one.rising for one in r.events] == [i % 2 == 0 for i in range(len(times))]
    assert np.abs(r.energy.balance).max() < 1e-9 * r.energy.kinetic.max()
    assert r.work.coordinates == "along the path"


def test_a_body_rests_on_its_stop_until_it_is_lifted():
    """A force that grows as 4 t lifts 1 kg from its stop at t = g / 4; then x'' = 4 (t - t0)."""
    lift = mg.Wrench("ball", force=lambda pose, twist, t: np.stack([0 * t, 4 * t, 0 * t], axis=-1), point=(0, 0, 0))
    r = mg.respond(slide([lift]), np.linspace(0, 4, 41), rtol=1e-10, atol=1e-12, stops=[mg.Stop("A", lower=0.0)])
    t0 = G / 4
    assert [str(one).split(" at ")[0] for one in r.events] == ["A meets its lower stop", "A leaves its lower stop"]
    assert r.events[1].t == pytest.approx(t0, abs=1e-9)
    after = np.maximum(r.t - t0, 0.0)
    np.testing.assert_allclose(r["A"].position[:, 0], 4 * after**3 / 6, atol=1e-9)
    np.testing.assert_allclose(r["A"].applied_effort[:, 0], np.where(after > 0, 0.0, G - 4 * r.t), atol=1e-9)


def test_one_of_two_bodies_is_lifted_and_the_other_goes_on_resting():
    """Each on a slide of its own; a force of 4 t lifts the one at t = g / 4."""
    lift = mg.Wrench("one", force=lambda pose, twist, t: np.stack([0 * t, 4 * t, 0 * t], axis=-1), point=(0, 0, 0))
    pairs = [
        mg.Pair(n, "P", "frame", link, point=(x, 0, 0), axis=Y) for n, link, x in (("A", "one", 0), ("B", "two", 1))
    ]
    links = [mg.Link("frame"), body("one"), body("two", center=(1, 0, 0))]
    m = mg.Mechanism("two slides", links, pairs, loads=[mg.Gravity((0, -G, 0)), lift])
    r = mg.respond(m, [0.0, 2.0, 4.0], stops=[mg.Stop(n, lower=0.0) for n in "AB"])
    np.testing.assert_allclose(r["A"].position[[0, -1], 0], [0.0, 4 * (4 - G / 4) ** 3 / 6], rtol=1e-7)
    np.testing.assert_allclose(r["B"].position[:, 0], 0.0, atol=1e-12)
    assert r["B"].applied_effort[-1, 0] == pytest.approx(G)


def test_of_two_feet_the_one_that_a_load_beyond_it_presses_stays_down():
    """Feet at -l and l of a bar of mass m and inertia I > m l d, a load F at d > l: held at -l alone the far foot would go through its
    stop; held at l the force there is F (1/m + l d / I) / (1/m + l^2 / I).
    """
    m, inertia, F, l, d = 2.0, 20.0, 3.0, 1.0, 1.5
    bar = mg.Link("bar", m, (0, 0, 0), inertia * np.eye(3), points={"left": (-l, 0, 0), "right": (l, 0, 0)})
    pairs = [
        mg.Pair("A", "P", "frame", "carrier", point=(0, 0, 0), axis=Y),
        mg.Pair("B", "R", "carrier", "bar", point=(0, 0, 0), axis=Z),
    ]
    load = mg.Wrench("bar", force=(0, -F, 0), point=(d, 0, 0))
    tipping = mg.Mechanism("bar", [mg.Link("frame"), mg.Link("carrier"), bar], pairs, loads=[load])
    r = mg.respond(tipping, [0.0, 0.01], stops=[mg.Stop(f"bar.{foot}.Ty", lower=0.0) for foot in ("left", "right")])
    N = F * (1 / m + l * d / inertia) / (1 / m + l * l / inertia)
    assert r["A"].acceleration[0, 0] == pytest.approx((N - F) / m, rel=1e-9)
    assert r["B"].acceleration[0, 0] == pytest.approx((l * N - d * F) / inertia, rel=1e-9)


def test_beside_a_sled_that_comes_to_rest_a_body_is_lifted_from_its_stop_once():
    """The closed forms of both: what a stop bears decides when it lets go, which is asked at few instants and not again and again."""
    asked = []

    def force(pose, twist, t):
        asked.append(t)
        return np.stack([0 * t, 4 * t, 0 * t], axis=-1)

    lift = mg.Wrench("ball", force=force, point=(0, 0, 0))
    pairs = [
        mg.Pair("A", "P", "frame", "ball", point=(0, 0, 0), axis=Y),
        mg.Pair("B", "P", "frame", "sled", point=(1, 0, 0), axis=X),
    ]
    links = [mg.Link("frame"), body("ball"), body("sled", center=(1, 0, 0))]
    m = mg.Mechanism("both", links, pairs, loads=[mg.Gravity((0, -G, 0)), lift, mg.Friction("B", mu=0.25)])
    stop = mg.Stop("A", lower=0.0)
    r = mg.respond(m, np.linspace(0, 4, 41), rates={"B": 2.0}, rtol=1e-10, atol=1e-12, stops=[stop])
    assert [str(one).split(" at ")[0] for one in r.events] == [
        "A meets its lower stop",
        "B sticks",
        "A leaves its lower stop",
    ]
    stands, t0 = 2.0 / (0.25 * G), G / 4
    np.testing.assert_allclose([one.t for one in r.events[1:]], [stands, t0], atol=1e-8)
    assert len(asked) < 1000  # 530, for four seconds of motion with three events
    after, slid = np.maximum(r.t - t0, 0.0), np.minimum(r.t, stands)
    np.testing.assert_allclose(r["A"].position[:, 0], 4 * after**3 / 6, atol=1e-8)
    np.testing.assert_allclose(r["A"].applied_effort[:, 0], np.where(after > 0, 0.0, G - 4 * r.t), atol=1e-8)
    np.testing.assert_allclose(r["B"].position[:, 0], 2.0 * slid - 0.125 * G * slid**2, atol=1e-8)


def test_two_bodies_strike_one_stop_and_pass_the_blow_on():
    """The upper of two bodies in one slide falls on the lower one, which lies on the ground: the blow goes through, both rest."""
    links = [mg.Link("frame"), body("lower"), body("upper", 2.0)]
    pairs = [
        mg.Pair("A", "P", "frame", "lower", point=(0, 0, 0), axis=Y),
        mg.Pair("B", "P", "lower", "upper", point=(0, 0, 0), axis=Y),
    ]
    m = mg.Mechanism("pile", links, pairs, loads=[mg.Gravity((0, -G, 0))])
    r = mg.respond(
        m, np.linspace(0, 1, 11), start={"A": 0.0, "B": 0.2}, rtol=1e-10, atol=1e-12,
        stops=[mg.Stop("A", lower=0.0), mg.Stop("B", lower=0.0)],
    )  # fmt: skip
    assert r.events[-1].t == pytest.approx(np.sqrt(0.4 / G), abs=1e-9)
    np.testing.assert_allclose(r["A"].position[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(r["A"].applied_effort[-1], 3 * G, rtol=1e-10)
    np.testing.assert_allclose(r["B"].applied_effort[-1], 2 * G, rtol=1e-10)


def test_two_stops_at_once_share_the_blow():
    """Both cranks of a parallelogram have a stop at the same angle; what each exerts is not unique, what both do is."""
    m = square([mg.Effort("A", -2.0)])
    both = [mg.Stop("A", lower=-0.4), mg.Stop("D", lower=-0.4)]
    r, one = (mg.respond(m, np.linspace(0, 4, 41), rtol=1e-10, atol=1e-12, stops=s) for s in (both, both[:1]))
    np.testing.assert_allclose(r["A"].position, one["A"].position, atol=1e-8)
    np.testing.assert_allclose(r["A"].position[-1], -0.4, atol=1e-10)
    assert (r["A"].applied_effort + r["D"].applied_effort)[-1, 0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("stops", "words"),
    [
        (3, "stops = 3: expected a Stop or a list"),
        ([3], r"stops = \[3\]: expected a Stop or a list"),
        (mg.Stop("Q", lower=0.0), "unknown freedom"),
        (mg.Stop("A"), "neither lower nor upper"),
        (mg.Stop("A", lower=1.0, upper=0.0), "lower < upper"),
        (mg.Stop("A", lower="low"), "lower = 'low'"),
        (mg.Stop("A", lower=0.0, restitution=1.5), "from 0 to 1"),
        (mg.Stop("A", lower=0.5), "start of 'A': is beyond its lower stop at 0.5"),
    ],
)
def test_bad_stops_are_named(stops, words):
    with pytest.raises(mg.DeclarationError, match=words):
        mg.respond(slide(), (0, 1), stops=stops)


def chain(n):
    links = [
        mg.Link("frame"),
        *(mg.Link(f"l{i}", mass=1.0, center=(i + 0.5, 0, 0), inertia=0.1 * np.eye(3)) for i in range(n)),
    ]
    pairs = [
        mg.Pair(f"P{i}", "R", f"l{i - 1}" if i else "frame", f"l{i}", point=(i, 0, 0), axis=(0, 0, 1)) for i in range(n)
    ]
    return mg.Mechanism("chain", links, pairs, loads=[mg.Gravity((0, -G, 0))])


@pytest.mark.seeds(2, daily=(1,))
def test_random_pendulums_between_stops(seed):
    """No stop is passed, none pulls, and energy is lost at impacts alone."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    stops = [
        mg.Stop(f"P{i}", -rng.uniform(0.2, 1.5), rng.uniform(0.2, 1.0), float(rng.choice([0.0, 0.3, 0.7, 1.0])))
        for i in range(n)
    ]
    r = mg.respond(chain(n), (0, 0.6), rtol=1e-9, atol=1e-11, stops=stops)
    assert r.events
    assert np.abs(r.energy.balance).max() < 1e-6
    assert (np.diff(r.energy.work) < 1e-6).all()
    for stop in stops:
        q, push = r[stop.freedom].position[:, 0], r[stop.freedom].applied_effort[:, 0]
        assert stop.lower - 1e-8 < q.min()
        assert q.max() < stop.upper + 1e-8
        low, high = np.abs(q - stop.lower) < 1e-8, np.abs(q - stop.upper) < 1e-8
        assert (push[low] > -1e-5).all()
        assert (push[high] < 1e-5).all()
        assert (push[~low & ~high] == 0.0).all()


def test_stops_of_prescribed_freedoms_are_refused():
    """And one that a prescribed freedom drives against is named when it is met."""
    falling = {"A": lambda t: (1 - t, -1.0, 0.0)}
    with pytest.raises(mg.DeclarationError, match="stop of 'A': its motion is prescribed"):
        mg.respond(slide(), (0, 2), start={"A": 1.0}, motions=falling, stops=mg.Stop("A", lower=0.0))
    turning = {"A": lambda t: (-t, -1.0, 0.0)}
    with pytest.raises(mg.ResponseError, match="moved against its stop by prescribed motions"):
        mg.respond(square(), (0, 2), motions=turning, stops=mg.Stop("D", lower=-0.5))


def bead(**more):
    """A bead on the lower half of a circle of radius 1, its coordinate the length of the arc."""
    arc = mg.Curve.circle(radius=1.0, axis=(0, 0, 1), angles=(np.pi, 2 * np.pi))
    links = [mg.Link("frame"), mg.Link("bead", mass=1.0, center=(-1, 0, 0))]
    pair = mg.Pair("A", "P", "frame", "bead", point=(-1, 0, 0), axis=(0, -1, 0), curve=arc)
    m = mg.Mechanism("bead", links, [pair], loads=[mg.Gravity((0, -9.81, 0))])
    return mg.respond(m, (0, 3), start={"A": 0.3}, rates={"A": 4.0}, **more)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_the_end_of_a_curve_ends_the_motion():
    """Where it comes to the end is told, with the speed of the closed form there; a stop before it keeps the bead on the curve."""
    with pytest.raises(mg.ResponseError, match="is at the end of its curve or surface") as caught:
        bead()
    r = caught.value.solution
    assert r["A"].position[-1, 0] == pytest.approx(np.pi, abs=1e-6)
    assert r["A"].velocity[-1, 0] == pytest.approx(np.sqrt(16 - 2 * 9.81 * np.sin(0.3)), rel=1e-6)
    stopped = bead(stops=mg.Stop("A", lower=0.2, upper=3.0, restitution=0.5))
    assert stopped.events
    assert (stopped["A"].position <= 3.0 + 1e-9).all()
    assert stopped.t[-1] == 3.0
