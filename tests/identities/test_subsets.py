"""Identities of paths: a position has the same values, or the same status, whichever other positions of the path were asked for."""

import itertools

import numpy as np
import pytest
from attack import Bars, anywhere, carried, conditions, differences, everything, solved, wrapped
from mechanisms import Z
from strategies import chebyshev_rate, chebyshev_times, closed_mechanism, with_drives, with_loads, with_loads_on_links

import mechgraph as mg

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Random loads move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

SAME = 1e-10
"""Difference over the condition (largest rate of a freedom for unit rates of the drivers; what multiplies rounding near a change point)."""


def subsets(rng, n):
    """Positions backwards, shuffled, some, every seventh, alone."""
    some = rng.choice(n, int(rng.integers(2, max(3, n // 2))), replace=False)
    return [np.arange(n)[::-1], rng.permutation(n), some, np.arange(0, n, 7), *rng.choice(n, (2, 1), replace=False)]


def assert_same(whole, part, pick):
    worst, where, faults = differences(whole, part, pick=pick)
    worse = conditions(whole)[pick][whole.status[pick] == "ok"].max(initial=1.0)
    assert not faults
    assert worst <= SAME * max(1.0, worse), f"{where}: {worst:.1e} at condition {worse:.1e}"


def assert_subsets_agree(m, freedom, q, rng, **how):
    """All subsets of the positions ``q`` of one driver against all positions together."""

    def motion(values):
        return {freedom: mg.Motion(values, 1.3, 0.7)}

    whole = solved(m, motion(q), **how)
    for pick in subsets(rng, len(q)):
        part = solved(m, motion(q[pick]), **how)
        if isinstance(whole, Exception) or isinstance(part, Exception):
            assert type(whole) is type(part), f"{whole} / {part}"
        else:
            assert_same(whole, part, pick)


def first_drive(m):
    freedom = m.drives[0].freedom
    begin = m.start.get(m.full_name(freedom), 0.0)
    k, j = m.freedom(freedom)
    return freedom, begin, 1.0 if m.pairs[k].type.freedoms[j].turns else 0.02


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", mg.library())
def test_library(name):
    m = mg.load(name)
    freedom, begin, size = first_drive(m)
    rng = np.random.default_rng(40)
    assert_subsets_agree(m, freedom, begin + size * np.linspace(0, 2 * np.pi, 19), rng)


@pytest.mark.daily(1)
@pytest.mark.seeds(14, without=(2, 3, 4, 5, 8, 10, 13, 16, 18, 20, 22))
def test_random_mechanisms(seed):
    rng = np.random.default_rng((seed, 41))
    m = with_drives(closed_mechanism(seed, mobility=1, loops=int(rng.integers(1, 4))), seed)
    if m is None or len(m.drives) != 1:
        pytest.skip("not of one driver")
    q = rng.choice([0.3, 1.0, 3.0]) * np.linspace(-1, 1, int(rng.choice([9, 20, 47]))) + rng.choice([0.0, 0.05])
    how = {
        "redundant": str(rng.choice(["nan", "minimum_norm"])),
        "method": str(rng.choice(["loop_wrench", "newton_euler"])),
        "engine": "sparse" if seed % 8 == 7 else "dense",
    }
    assert_subsets_agree(with_loads(m, seed), m.drives[0].freedom, q, rng, **how)


def test_names_of_a_result_do_not_hang_on_what_was_reached():
    """Where no position is reached, what holds a passive body is NaN; its name is there as otherwise."""
    m = with_loads_on_links(with_drives(closed_mechanism(40), 40), 40)
    freedom = m.drives[0].freedom
    near, far = (solved(m, {freedom: q}) for q in ([0.0, 50.0], [50.0]))
    assert far.status[0] == near.status[1] != "ok"
    assert everything(near).keys() == everything(far).keys()


# --- several drivers ------------------------------------------------------------------------------------------------------


def on_polygon(seed, rng, size=None):
    """A mechanism of several drivers, positions on a polygon, and which of them are its corners."""
    m = with_drives(closed_mechanism(seed, mobility=int(rng.integers(2, 4)), loops=int(rng.integers(1, 3))), seed)
    if m is None or len(m.drives) < 2:
        pytest.skip("not of several drivers")
    size = float(rng.choice([0.1, 0.4, 1.0]) if size is None else size)
    corners = np.vstack([np.zeros(len(m.drives)), size * rng.normal(size=(4, len(m.drives)))])
    points, corner = [], []
    for a, b in itertools.pairwise(corners):
        parts = [*np.sort(rng.uniform(0, 1, int(rng.integers(0, 6)))), 1.0]
        points += [a + u * (b - a) for u in parts]
        corner += [False] * (len(parts) - 1) + [True]
    return with_loads(m, seed), np.array(points), np.array(corner)


@pytest.mark.daily(3)
@pytest.mark.seeds(10, without=(1,))
def test_several_drivers(seed):
    rng = np.random.default_rng(seed)
    m, points, corner = on_polygon(seed, rng)

    def motion(values):
        return {d.freedom: mg.Motion(values[:, i], 1.0 + 0.1 * i, 0.3) for i, d in enumerate(m.drives)}

    whole = solved(m, motion(points))
    for _ in range(2):
        pick = np.flatnonzero(corner | (rng.random(len(points)) < 0.3))
        part = solved(m, motion(points[pick]))
        if isinstance(whole, Exception) or isinstance(part, Exception):
            assert type(whole) is type(part)
        else:
            assert_same(whole, part, pick)


# --- passive bodies ---------------------------------------------------------------------------------------------------------


def rssr(mass=True, follower="S"):
    """RSSR, the coupler's mass center off its line; ``follower`` in place of the second sphere: E, Sp take spins as well."""
    body = {"mass": 2.0, "center": (0.2, 0.15, 0.1), "inertia": 0.01 * np.eye(3)} if mass else {}
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("coupler", **body), mg.Link("rocker")]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "coupler", point=(0.06, 0, 0.02)),
        mg.Pair("C", follower, "coupler", "rocker", point=(0.33, 0.1, 0.08), axis=(0.2, 1.0, 0.3)),
        mg.Pair("D", "R", "rocker", "frame", point=(0.26, -0.03, 0.11), axis=(-1, 2, 1)),
    ]
    return mg.Mechanism("RSSR", links, pairs, ["A"], [mg.Gravity((0, 0, -9.81))])


def two_rods():
    """A crank and two rockers on two S-S rods, one of them from rocker to rocker."""
    pairs = [
        *rssr(False).pairs,
        mg.Pair("E", "S", "rocker", "rod", point=(0.4, 0.05, 0.05)),
        mg.Pair("F", "S", "rod", "second", point=(0.6, 0.3, 0.1)),
        mg.Pair("G", "R", "second", "frame", point=(0.7, 0.1, 0.05), axis=(0.3, 0.2, 1)),
    ]
    bodies = [mg.Link(n, mass=1.0, center=(0.3, 0.2, 0.1), inertia=0.01 * np.eye(3)) for n in ("coupler", "rod")]
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("rocker"), mg.Link("second"), *bodies]
    return mg.Mechanism("two rods", links, pairs, ["A"], [mg.Gravity((0, 0, -9.81))])


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("m", "engine", "end"),
    [(mg.load("rssr"), "dense", 6.0), (rssr(), "dense", 6.0), (two_rods(), "dense", 6.0), (two_rods(), "sparse", 1.0)],
    ids=["library", "rssr", "two rods", "sparse"],
)
def test_passive_bodies(m, engine, end):
    assert_subsets_agree(m, "A", np.linspace(-1.0, end, 7), np.random.default_rng(43), engine=engine)


CARRIED = {
    "H inside, S and E": {"seed": 8, "loops": 1},
    "R and P inside, S and E": {"seed": 24, "loops": 1, "mobility": 2, "branches": 0},
    "slide, Sp and E": {"seed": 130, "loops": 1},
    "slide, Cp and E": {"seed": 183, "loops": 2},
}
"""Passive links that move against each other, or that slide: what keeps them at rest is no matter of one body's axis."""


SHORTLY = chebyshev_times(0.0, 0.01, 8)


def assert_rates_are_derivatives(s):
    """Twists and accelerations of all links, at ``SHORTLY`` of a driver at unit rate."""
    for k in s.mechanism.link_names():
        pose, twist = s.link(k).pose, s.link(k).twist
        rate, tail = chebyshev_rate(SHORTLY, pose)
        spin = rate @ np.linalg.inv(pose)
        found = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0], *spin[:, :3, 3].T], axis=1)
        np.testing.assert_allclose(twist, found, atol=1e-9 + 10 * tail)
        rate, tail = chebyshev_rate(SHORTLY, twist)
        np.testing.assert_allclose(s.link(k).acceleration, rate, atol=1e-8 + 10 * tail)


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("case", CARRIED)
def test_passive_links_that_move_against_each_other_or_slide(case, engine):
    """They stand at the same place for any positions of a path, and their rates are the derivatives of it."""
    m = with_drives(closed_mechanism(**CARRIED[case], masses=False), CARRIED[case]["seed"])
    drive = m.drives[0].freedom
    assert_subsets_agree(m, drive, np.linspace(-0.4, 0.3, 6), np.random.default_rng(44), engine=engine)
    assert_rates_are_derivatives(mg.kinematics(m, {drive: mg.Motion(SHORTLY, 1.0)}, engine=engine))


def carried_ring(kind):
    """A ring between two coaxial pairs of an arm on a crank: it turns and slides, or moves in a plane, idly."""
    axis, at = np.array([1.0, 0.5, 0.7]) / np.linalg.norm([1.0, 0.5, 0.7]), np.array([0.3, 0.2, 0.5])
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "crank", "arm", point=(0.4, 0.1, 0), axis=(0, 1, 0.2)),
        mg.Pair("C", kind, "arm", "ring", point=at, axis=axis),
        mg.Pair("D", kind, "arm", "ring", point=at + 0.3 * axis, axis=axis),
    ]
    gears = [mg.Coupling({"A": 2.0, "B": -1.0}, name="g")]
    return mg.Mechanism("ring", None, pairs, ["A"], couplings=gears)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "engine"), [("C", "dense"), ("E", "sparse")])
def test_links_with_several_passive_motions(kind, engine):
    """At rest in all of them, at the same place for any positions, far ones too; no spin, and no slide of the point on the axis."""
    m = carried_ring(kind)
    assert_subsets_agree(m, "A", np.linspace(-0.4, 0.7, 3), np.random.default_rng(45), engine=engine)
    assert_rates_are_derivatives(mg.kinematics(m, {"A": mg.Motion(SHORTLY, 1.0)}, engine=engine))
    if engine == "dense":
        far, near = (mg.kinematics(m, {"A": q}).link("ring").pose[-1] for q in ([15.0], np.linspace(0.0, 15.0, 3)))
        np.testing.assert_allclose(far, near, atol=1e-9)


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("end", [0.7, -1.5])
def test_spin_is_that_of_parallel_transport(engine, end):
    """No spin at any position, and the pose of an independent integration, for any number of positions on the way."""
    m = rssr()
    axis = np.array([0.27, 0.1, 0.06]) / np.linalg.norm([0.27, 0.1, 0.06])
    goal, tail = carried(m, "A", "coupler", axis, 0.0, end)
    for q in ([end], np.linspace(0.0, end, 5), np.linspace(0.0, end, 41)):
        link = mg.kinematics(m, {"A": mg.Motion(q, 1.0)}, engine=engine).link("coupler")
        np.testing.assert_allclose(link.pose[-1, :3, :3], goal, atol=1e-11 + 100 * tail)
        spin = np.einsum("ti,tij,j->t", link.twist[:, :3], link.pose[:, :3, :3], axis)
        assert np.abs(spin).max() < 1e-13


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize(("seed", "pair", "link"), [(40, "J3", "b3"), (204, "J5", "b3"), (218, "J12", "b10")])
def test_spin_of_a_body_between_sphere_and_plane(engine, seed, pair, link):
    m = with_drives(closed_mechanism(seed), seed)
    axis = next(np.array(p.axis) / np.linalg.norm(p.axis) for p in m.pairs if p.name == pair)
    drive = m.drives[0].freedom
    goal, tail = carried(m, drive, link, axis, 0.0, 0.1, nodes=40)
    for q in ([0.1], np.linspace(0.0, 0.1, 5)):
        R = mg.kinematics(m, {drive: q}, engine=engine).link(link).pose[-1, :3, :3]
        np.testing.assert_allclose(R, goal, atol=1e-11 + 100 * tail)


# --- change points ----------------------------------------------------------------------------------------------------------


def parallelograms(bars, start, moved=None):
    """Parallelograms on one crank, declared at the crank angle ``start``, an output effort -10 in all."""
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z)]
    for i, bar in enumerate(bars):
        tip, foot = bar.tip(start), bar.foot
        at = {"B": tip, "C": foot + tip, "D": foot}
        ends = {"B": ("crank", f"coupler{i}"), "C": (f"coupler{i}", f"rocker{i}"), "D": ("frame", f"rocker{i}")}
        pairs += [mg.Pair(f"{k}{i}", "R", *ends[k], point=(*at[k], 0), axis=Z) for k in ends]
    loads = [mg.Effort(f"D{i}", -10.0 / len(bars)) for i in range(len(bars))]
    m = mg.Mechanism("parallelograms", None, pairs, ["A"], loads)
    return m if moved is None else m.moved(moved)


def from_change_point(bars, crank):
    """Angle from the nearest position in line of any parallelogram."""
    return np.min([np.abs(wrapped(2 * (crank - bar.lean))) / 2 for bar in bars], axis=0)


def assert_parallel(s, bars, q, start):
    """Every position but the change points themselves is solved, as a parallelogram, with the torque 10."""
    off, ok = from_change_point(bars, q + start), s.status == "ok"
    lost = ~ok & (off > 1e-7)
    assert not lost.any(), f"{set(s.status[lost])} {off[lost][:3]} from the change point"
    assert not ok[off < 1e-9].any()
    for i in range(len(bars)):
        # rounding over the distance for a position, over its square for a force
        assert (np.abs(s[f"D{i}"].position[..., 0] - q)[ok] * off[ok]).max(initial=0.0) < 1e-12
    assert (np.abs(s["A"].effort[..., 0] - 10.0)[ok] * np.minimum(off[ok], 1.0) ** 2).max(initial=0.0) < 1e-10


ONE = [Bars(1.0, 2.0, 1.0, 2.0)]


@pytest.mark.daily(1)
@pytest.mark.parametrize("step", [2, 7, -7, *(pytest.param(step, marks=pytest.mark.slow) for step in (1, 6, 10, 0.74))])
def test_parallelogram_over_a_turn(step):
    q = np.radians(np.arange(0, 360 + 1e-9, abs(step))) * np.sign(step)
    for start in (np.pi / 2, np.radians(137.3)):
        assert_parallel(solved(parallelograms(ONE, start), {"A": q}), ONE, q, start)


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("off", "engine"),
    [
        (1e-5, "dense"),
        (3e-3, "sparse"),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1e-5, "sparse"), (1e-3, "dense"), (5e-3, "dense"))),
    ],
)
def test_beside_a_change_point_wherever_the_path_ends(engine, off):
    """Behind a change point a position is solved alone, with one before it, and with others behind it."""
    start = np.pi / 2
    at = np.pi / 2
    for q in ([at + off], [at - off, at + off, 5.0]):
        q = np.array(q)
        assert_parallel(solved(parallelograms(ONE, start), {"A": q}, engine=engine), ONE, q, start)


def drawn_parallelograms(rng):
    k, together = int(rng.choice([1, 1, 2, 3])), rng.random() < 0.5
    bars = []
    for _ in range(k):
        a, g = rng.uniform(0.3, 1.0), rng.uniform(1.1, 2.0)
        lean = 0.0 if together else rng.uniform(-np.pi, np.pi)
        bars.append(Bars(a, g, a, g, 0.0, rng.uniform(-3, 3), lean))
    while True:
        start = rng.uniform(-np.pi, np.pi)
        if from_change_point(bars, np.array([start]))[0] > 0.05:
            return bars, start


@pytest.mark.daily(1)
@pytest.mark.seeds(6)
def test_several_parallelograms_on_one_crank(seed):
    """Change points of their own, or all at one crank angle; and any subset of the positions."""
    rng = np.random.default_rng((seed, 44))
    bars, start = drawn_parallelograms(rng)
    m = parallelograms(bars, start, anywhere(rng))
    q = rng.choice([-1, 1]) * np.linspace(0, rng.choice([3.0, 2 * np.pi]), int(rng.choice([10, 37])))
    whole = solved(m, {"A": q})
    assert_parallel(whole, bars, q, start)
    pick = rng.choice(len(q), len(q) // 3, replace=False)
    assert not differences(whole, solved(m, {"A": q[pick]}), pick=pick)[2]


def assert_same_beside(whole, part, pick, off):
    """The same statuses, and values but for what rounding leaves: over the distance ``off`` for positions, over its cube at most."""
    assert (whole.status[pick] == part.status).all(), f"{part.status} at {off} for {whole.status[pick]}"
    ok = part.status == "ok"
    for link in part.mechanism.link_names():
        gap = np.abs(whole.link(link).pose[pick] - part.link(link).pose)[ok]
        assert gap.max(initial=0.0) < SAME
        gap = np.abs(whole.link(link).twist[pick] - part.link(link).twist)[ok]
        assert gap.max(initial=0.0) < 1e-8
    gap = np.abs(whole["A"].effort[pick, 0] - part["A"].effort[:, 0])[ok] * np.minimum(off[ok], 1.0)
    assert gap.max(initial=0.0) < 1e-9


BESIDE = 10.0 ** np.array([-6.5, -5.0, -4.0, -2.5])
RHOMBUS = [Bars(1.0, 1.0, 1.0, 1.0)]


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("bars", "begin", "engine"),
    [
        (ONE, -0.5, "dense"),
        (RHOMBUS, -0.5, "sparse"),
        (RHOMBUS, 1e-5, "dense"),
        pytest.param(ONE, -3e-3, "dense", marks=pytest.mark.slow),
        pytest.param(ONE, -1e-4, "dense", marks=pytest.mark.slow),
    ],
)
def test_paths_may_begin_and_end_beside_a_change_point(bars, begin, engine):
    """Positions beside it are solved whether the path passes it or not; from a start beside it no path goes over to the other branch."""
    m = parallelograms(bars, begin)
    at = np.sort(np.concatenate([-BESIDE, BESIDE, [begin, -0.3, 0.4]]))
    whole = solved(m, {"A": mg.Motion(at - begin, 1.0)}, engine=engine)
    assert_parallel(whole, bars, at - begin, begin)
    for pick in (np.flatnonzero(at < 0), np.flatnonzero(at > 0), np.array([len(at) // 2])):
        part = solved(m, {"A": mg.Motion(at[pick] - begin, 1.0)}, engine=engine)
        assert_same_beside(whole, part, pick, np.abs(at[pick]))


def test_change_points_near_each_other():
    """Beside one of two change points a position may lie outside of what is interpolated: it is closed alone."""
    bars, begin = [ONE[0], Bars(0.8, 1.5, 0.8, 1.5, lean=0.02)], -0.5
    m = parallelograms(bars, begin)
    for off in (1e-3, 4e-3):
        assert_parallel(solved(m, {"A": [off - begin, 0.9]}), bars, np.array([off - begin, 0.9]), begin)


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("lean", [1e-4, 3e-3])
def test_change_points_that_are_passed_together(lean, engine):
    """One of two is found, the other leapt over with it: at it forces are not those of a singular matrix, beside it they are right."""
    begin, bars = -0.5, [Bars(1.0, 2.0, 1.0, 2.0), Bars(1.0, 1.5, 1.0, 1.5, 0.0, 0.0, lean)]
    m = parallelograms(bars, begin)
    for at in ([lean], [0.0, lean, lean + 1e-11, lean + 1e-6, 0.5 * lean, 0.2]):
        q = np.array(at) - begin
        assert_parallel(solved(m, {"A": q}, engine=engine), bars, q, begin)


@pytest.mark.slow
@pytest.mark.parametrize("begin", [4.935e-6, 6.329e-6, 2e-5])
def test_a_start_right_behind_a_change_point_and_before_another(begin):
    """The way back over the first change point, which rounding would lead to its other branch, tells nothing of the second one."""
    bars = [Bars(0.62, 1.7, 0.62, 1.7), Bars(0.62, 1.5, 0.62, 1.5, 0.0, 0.0, 1.5e-3)]
    m = parallelograms(bars, begin)
    q = np.array([0.01, 0.2]) - begin
    assert_parallel(solved(m, {"A": q}), bars, q, begin)


@pytest.mark.slow
def test_cases_and_periods_beside_a_change_point():
    """Cases of a call, and positions turns later, are solved as those of one path are, and on its branch."""
    m = parallelograms(ONE, -1e-5)
    q = np.array([0.0, 1.5e-5, -1e-4, 6 * np.pi - 1e-4, -6 * np.pi - 1e-4])
    for given in (q, q[:3, None]):
        s = solved(m, {"A": given})
        assert (s.status == "ok").all()
        assert np.abs(s["D0"].position[..., 0] - given).max() < 1e-11


def test_several_drivers_beside_a_change_point():
    """Where the last edge of the polygon leads on over a change point, its end has the values of a longer edge."""
    parts = [parallelograms(ONE, start) for start in (-0.5, -0.7)]
    renamed = [
        mg.Pair(f"{p.name}{i}", "R", *(k if k == "frame" else f"{k}{i}" for k in (p.a, p.b)), point=p.point, axis=Z)
        for i, part in enumerate(parts)
        for p in part.pairs
    ]
    m = mg.Mechanism("two", None, renamed, ["A0", "A1"], [mg.Effort("D00", -1.0), mg.Effort("D01", -2.0)])
    for d in (1e-3, 1e-5):
        end = np.array([0.5 - d, 0.3])
        on_line = np.array([[0.3], [1.0], [1.8]]) * end
        whole, part = (
            solved(m, {"A0": mg.Motion(q[:, 0], 1.0), "A1": mg.Motion(q[:, 1], 0.6)}) for q in (on_line, on_line[1:2])
        )
        worst, where, faults = differences(whole, part, pick=np.array([1]))
        assert not faults
        assert (part.status == "ok").all()
        assert worst < 1e-7, where


@pytest.mark.slow
@pytest.mark.parametrize("begin", [-1e-3, 1e-3])
def test_passive_bodies_beside_a_change_point(begin):
    """A rod on a rocker of a parallelogram stands where it stands, however short the path beside the change point is."""
    m, rod = parallelograms(ONE, -0.5), mg.Link("rod", mass=1.0, center=(2.5, 0.5, 0.2), inertia=0.01 * np.eye(3))
    more = [
        mg.Pair("E", "S", "rocker0", "rod", point=(2.6, -0.3, 0.5)),
        mg.Pair("F", "S", "rod", "second", point=(2.3, 1.9, 0.1)),
        mg.Pair("G", "R", "second", "frame", point=(3.8, 0.6, 0.3), axis=(0.3, 0.2, 1)),
    ]
    links = [*(mg.Link(k) for k in (*m.link_names(), "second")), rod]
    m = mg.assemble(m.replace(links=links, pairs=[*m.pairs, *more]), {"A": begin + 0.5})
    at = np.array([-0.6, -1e-2, -1e-3, 0.0, 3e-5, 1e-3, 0.2]) + begin + 0.5

    def at_rest(q):
        return mg.kinematics(m, {"A": mg.Motion(q, 1.0)}, on_reach="flag")

    whole = at_rest(at)
    for pick in ([4], [1, 2, 3]):
        part = at_rest(at[pick])
        assert (part.status == whole.status[pick]).all()
        gap = np.abs(part.link("rod").pose - whole.link("rod").pose[pick])
        assert gap.max() < SAME, f"{pick}: {gap.max():.1e}"


# --- several links in one passive motion ------------------------------------------------------------------------------------


def welded_coupler():
    """RSSR with a coupler of two welded halves: both spin as one."""
    m = mg.load("rssr").replace(loads=[])
    b, c = (np.asarray(m.pair(name).point) for name in "BC")
    pairs = [p.replace(a="half") if p.name == "C" else p for p in m.pairs]
    assert m.pair("C").a == "coupler"
    weld = mg.Pair("weld", "W", "coupler", "half", point=0.5 * (b + c))
    return m.replace(links=[*m.links, mg.Link("half")], pairs=[*pairs, weld])


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_welded_halves_stand_where_the_whole_stands(engine):
    whole = mg.load("rssr").replace(loads=[])
    drive = whole.drives[0].freedom
    for n in (2, 9):
        given = {drive: np.linspace(0.0, 2.0, n)}
        one, two = (mg.kinematics(m, given, engine=engine) for m in (whole, welded_coupler()))
        assert np.allclose(two.link("half").pose, one.link("coupler").pose, atol=1e-11)


def two_bars_on_a_plane():
    """Two bars that turn idly about the first pair as one: their mean spin vanishes, so that each takes half of the driver's turn."""
    pairs = [
        mg.Pair("A", "R", "frame", "b1", point=(-0.13, -0.45, 0), axis=(0, 0, 1)),
        mg.Pair("B", "R", "b1", "b2", point=(0.4, 0.3, 0.1), axis=(0, 0, 1)),
        mg.Pair("C", "Cp", "b2", "frame", point=(0.9, -0.2, 0.6), axis=(0, 0, 1), second=(0.6, 0.8, 0)),
    ]
    return mg.Mechanism("two bars on a plane", None, pairs, ["B"])


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("n", [2, 9])
def test_links_that_a_driver_moves_against_each_other_share_their_rest(engine, n):
    m = two_bars_on_a_plane()
    s = mg.kinematics(m, {"B": mg.Motion(np.linspace(0.0, 1.0, n), 1.0, 0.0)}, engine=engine)
    assert np.allclose(s["A"].position[-1], -0.5, atol=1e-11)
    assert np.allclose(s["A"].velocity, -0.5, atol=1e-11)


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["sparse", "dense"])
def test_shared_rest_after_more_than_a_turn(engine):
    """What is held drifts by more than a turn."""
    far = np.array([2.2, 6.0, 9.0, -6.5])
    m = two_bars_on_a_plane()
    assert np.allclose(mg.kinematics(m, {"B": far}, engine=engine)["A"].position[:, 0], -far / 2, atol=1e-11)
