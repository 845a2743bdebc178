"""Identities of motion, on random mechanisms: closure, and every rate equal to the derivative of what it is the rate of.

Derivatives are those of the Chebyshev interpolant of the positions along a smooth motion: spectral, so that the tolerance is
tight; where the interpolant itself has not converged (its last coefficients say so) the motion is made shorter.
"""

import numpy as np
import pytest
from strategies import (
    chebyshev_rate,
    chebyshev_times,
    closed_mechanism,
    fold_before_the_end,
    motions,
    open_chain,
    pose,
    with_drives,
)

import mechgraph as mg

NODES = 20
TYPES = [s for s, row in mg.pair_types().items() if row.f]


def slow_enough(m, seed):
    """Times, motions and solution: the motion shortened until positions are resolved to rounding by their interpolant; or None."""
    span = 0.4
    for _ in range(6):
        t = chebyshev_times(0.0, span, NODES)
        given = motions(m, seed, t)
        s = mg.kinematics(m, given, on_reach="flag")
        if given and (s.status == "ok").all():
            tails = [chebyshev_rate(t, s[p.name].position)[1] * span for p in m.pairs if p.type.f]
            if max(tails) < 1e-9:
                return t, given, s
        span /= 3
    return None


def moving(seed, **more):
    """A random mechanism that moves, its times, motions and solution; the next seed where this one stands at a dead point."""
    m = with_drives(closed_mechanism(seed, **more), seed)
    found = None if m is None else slow_enough(m, seed)
    return moving(seed + 1000, **more) if found is None else (m, *found)


def assert_rate(t, values, rate, what):
    got, tail = chebyshev_rate(t, values)
    size = max(
        np.abs(rate).max(initial=0.0),
        np.abs(got).max(initial=0.0),
        np.abs(np.ptp(values, axis=0)).max(initial=0) / (t[-1] - t[0]),
        1e-3,
    )
    error = np.abs(got - rate).max(initial=0.0)
    assert error < 1e-6 * size + 10 * tail, f"{what}: {error:.3g} of {size:.3g}"


def assert_all_rates(m, t, s):
    """All rates against spectral derivatives."""
    for p in m.pairs:
        r = s[p.name]
        single = np.array(p.type.drivable, dtype=bool)
        if single.any():
            assert_rate(t, r.position[:, single], r.velocity[:, single], f"{p.name} velocity")
        if p.type.f:
            assert_rate(t, r.velocity, r.acceleration, f"{p.name} acceleration")
    for name in m.link_names():
        k = s.link(name)
        dX, _ = chebyshev_rate(t, k.pose)
        spin = dX @ np.linalg.inv(k.pose)
        w = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
        _, tail = chebyshev_rate(t, k.pose)
        size = max(1e-3, np.abs(k.twist).max())
        np.testing.assert_allclose(np.concatenate([w, spin[:, :3, 3]], axis=-1), k.twist, atol=1e-6 * size + 10 * tail)
        assert_rate(t, k.twist, k.acceleration, f"{name} acceleration")
        point = k.point((0.3, -0.7, 0.5))
        assert_rate(t, point.position, point.velocity, f"{name} point velocity")
        assert_rate(t, point.velocity, point.acceleration, f"{name} point acceleration")
        if m.link(name).center is not None:
            assert_rate(t, k.center, k.center_velocity, f"{name} center velocity")
            assert_rate(t, k.center_velocity, k.center_acceleration, f"{name} center acceleration")


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", range(16))
def test_rates_are_the_derivatives_of_positions(seed):
    m, t, _, s = moving(seed)
    assert s.checks.closure.max() < 1e-10
    assert_all_rates(m, t, s)


@pytest.mark.daily(7)
@pytest.mark.parametrize("symbol", TYPES)
def test_rates_are_the_derivatives_of_positions_for_every_pair_type(symbol):
    """A ring that holds the type at least once, declared in both directions."""
    f = mg.pair_types()[symbol].f
    rest = {1: ["S", "C", "R"], 2: ["S", "R", "R"], 3: ["R", "C", "R"], 4: ["C", "R"], 5: ["R", "R"], 6: ["R"]}[f]
    for seed in (100, 101):
        m, t, _, s = moving(seed, symbols=[symbol, *rest], loops=1, branches=0)
        assert_all_rates(m, t, s)


@pytest.mark.daily(3)
@pytest.mark.parametrize(
    "letters", ["RCSR", "RRRRRRR", "RHCHC", "RSgC", "RScCR", "RSpR", "RESR", "PUUU", "RCpCR", "RUSR"]
)
def test_rates_are_the_derivatives_of_positions_for_chains_assembled_from_an_open_declaration(letters):
    solved = 0
    for seed in range(4):
        m = open_chain(seed, letters)
        try:
            m = mg.assemble(m, {})
        except mg.AssemblyError:
            continue
        m = with_drives(m, seed)
        found = None if m is None else slow_enough(m, seed)
        if found is None:
            continue
        t, _, s = found
        assert s.checks.closure.max() < 1e-10
        assert_all_rates(m, t, s)
        solved += 1
    assert solved


def test_markers_link_by_link_meet_at_every_position():
    """T_b B = T_a A D: axis and point of marker B stay where the type of the pair wants them on A."""
    m = with_drives(mg.assemble(open_chain(2, "RCSR"), {}), 2)
    found = slow_enough(m, 2)
    assert found
    s = found[2]
    for p in m.pairs:
        a, b = s.link(p.a).pose, s.link(p.b).pose
        pa, pb = (X @ np.array([*k.point, 1.0]) for X, k in ((a, p.on_a), (b, p.on_b)))
        za, zb = (X[:, :3, :3] @ np.array(k.axis) for X, k in ((a, p.on_a), (b, p.on_b)))
        gap = (pb - pa)[:, :3]
        if p.type.symbol in "RS":
            np.testing.assert_allclose(gap, 0, atol=1e-10)
        if p.type.symbol == "C":
            np.testing.assert_allclose(np.cross(gap, za), 0, atol=1e-10)
        if p.type.symbol in "RC":
            np.testing.assert_allclose(za, zb, atol=1e-10)


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(40))
def test_what_is_not_reached_has_a_turning_point_before_it(seed):
    """Positions that are refused: an arc-length continuation of its own finds that the drivers turn back before."""
    m = with_drives(closed_mechanism(seed), seed)
    if m is None:
        assert any("R" in name.rpartition(".")[2] for name in mg.check(closed_mechanism(seed)).undriven[0].names)
        return
    t = chebyshev_times(0.0, 0.4, 9)
    given = motions(m, seed, t)
    s = mg.kinematics(m, given, on_reach="flag")
    good = s.status == "ok"
    assert s.checks.closure[good].max(initial=0.0) < 1e-10
    if good.all():
        return
    assert fold_before_the_end(m, given)
    with pytest.raises((mg.ReachError, mg.DeadPointError)) as caught:
        mg.kinematics(m, given)
    assert set(caught.value.value) == {m.full_name(d.freedom) for d in m.drives}
    np.testing.assert_array_equal(caught.value.solution.status, s.status)


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", [1017, 1033, 1062, 1102])
def test_loops_stay_closed_where_a_passive_freedom_is_held(seed):
    m = with_drives(closed_mechanism(seed), seed)
    assert mg.check(m).passive
    s = mg.kinematics(m, motions(m, seed, chebyshev_times(0.0, 0.4, 16)), on_reach="flag")
    good = s.status == "ok"
    assert good.any()
    assert s.checks.closure[good].max() < 1e-10


@pytest.mark.daily(5)
@pytest.mark.parametrize("seed", range(8))
def test_going_back_meets_the_positions_of_going_there(seed):
    m, t, given, _ = moving(seed)
    there = {name: v.position for name, v in given.items()}
    both = {name: np.concatenate([x, x[::-1]]) for name, x in there.items()}
    s = mg.kinematics(m, both)
    for k in m.links:
        X = s.link(k.name).pose
        np.testing.assert_allclose(X[:NODES], X[NODES:][::-1], atol=1e-9)


@pytest.mark.daily(5)
@pytest.mark.parametrize("seed", range(8))
def test_positions_do_not_depend_on_how_finely_they_are_asked(seed):
    m, _, given, s = moving(seed)
    coarse = mg.kinematics(m, {name: v.position[::6] for name, v in given.items()})
    one = mg.kinematics(m, {name: float(v.position[-1]) for name, v in given.items()})
    for k in m.links:
        np.testing.assert_allclose(coarse.link(k.name).pose, s.link(k.name).pose[::6], atol=1e-9)
        if len(given) == 1:  # with several drivers the straight path is another one
            np.testing.assert_allclose(one.link(k.name).pose, s.link(k.name).pose[-1], atol=1e-9)
    assert one.batch == ()
    assert one.link(m.links[1].name).pose.shape == (4, 4)


def test_driving_another_freedom_of_the_same_motion_gives_the_same_motion():
    """Four-bar: drive the crank, read the rocker; drive the rocker with that, get the crank back."""
    m, t, given, s = moving(3, loops=1, mobility=1, branches=0)
    name = m.full_name(m.drives[0].freedom)
    k, j = m.freedom(name)
    for finding in mg.check(m).drivable:
        other = finding.freedoms[0]
        i, n = m.freedom(other)
        if other == name:
            continue
        r = s[m.pairs[i].name]
        back = mg.kinematics(
            m.replace(drives=[other]), {other: mg.Motion(r.position[:, n], r.velocity[:, n], r.acceleration[:, n])}
        )
        mine = back[m.pairs[k].name]
        np.testing.assert_allclose(mine.position[:, j], s[m.pairs[k].name].position[:, j], atol=1e-8)
        np.testing.assert_allclose(mine.velocity[:, j], s[m.pairs[k].name].velocity[:, j], atol=1e-7)
        np.testing.assert_allclose(mine.acceleration[:, j], s[m.pairs[k].name].acceleration[:, j], atol=1e-6)


def test_batch_axes_before_the_last_are_independent_cases():
    m, t, given, s = moving(3, loops=1, mobility=1, branches=0)
    name, motion = next(iter(given.items()))
    cases = np.stack([motion.position, 0.5 * motion.position, motion.position[::-1] * 0.2])
    whole = mg.kinematics(m, {name: mg.Motion(cases, 1.0)})
    assert whole.batch == (3, NODES)
    for c in range(3):
        alone = mg.kinematics(m, {name: mg.Motion(cases[c], 1.0)})
        for p in m.pairs:
            np.testing.assert_allclose(whole[p.name].position[c], alone[p.name].position, atol=1e-10)
            np.testing.assert_allclose(whole[p.name].velocity[c], alone[p.name].velocity, atol=1e-8)


@pytest.mark.daily(3)
@pytest.mark.parametrize("seed", range(6))
def test_kinematics_of_the_moved_mechanism_is_the_moved_kinematics(seed):
    m, _, given, s = moving(seed)
    X = pose(np.random.default_rng(seed), 30.0)
    moved = mg.kinematics(m.moved(X), given)
    for p in m.pairs:
        np.testing.assert_allclose(
            moved[p.name].velocity, s[p.name].velocity, atol=1e-8 * max(1, np.abs(s[p.name].velocity).max(initial=0))
        )
    for k in m.links:
        np.testing.assert_allclose(moved.link(k.name).pose, X @ s.link(k.name).pose @ np.linalg.inv(X), atol=1e-8)


def test_an_angle_is_unwrapped_over_several_turns():
    m = mg.Mechanism(
        "wheel", pairs=[mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=(0, 0, 1))], drives=["A"]
    )
    angle = np.linspace(0, 40, 300)
    np.testing.assert_allclose(mg.kinematics(m, {"A": angle})["A"].position[:, 0], angle)


def test_rotation_vectors_of_balls_are_continuous_over_turns_of_the_crank():
    """RSSR-like ring with a U instead of one S: the ball's rotation vector has no jumps over two turns."""
    m = mg.Mechanism(
        "rsur",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "S", "crank", "rod", point=(0.2, 0, 0)),
            mg.Pair("C", "U", "rod", "rocker", point=(0.2, 1.1, 0.6), axis=(0, 0.3, 1), second=(1, 0, 0)),
            mg.Pair("D", "R", "rocker", "frame", point=(1.0, 1.0, 0), axis=(1, 0.2, 0.1)),
        ],
        drives=["A"],
    )
    angle = np.linspace(0, 4 * np.pi, 721)
    s = mg.kinematics(m, {"A": mg.Motion(angle, 1.0)})
    assert (s.status == "ok").all()
    q = s["B"].position
    assert np.abs(np.diff(q, axis=0)).max() < 0.1
    assert np.abs(q[:361] - q[360:]).max() > 1.0  # the ball has turned with the crank
    np.testing.assert_allclose(s.link("rocker").pose[:361], s.link("rocker").pose[360:], atol=1e-9)


def twins(count: int, near: float) -> mg.Mechanism:
    """``count`` near-parallelograms that share nothing but the driven crank: none can feel the others."""
    z = (0, 0, 1)
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z)]
    for i in range(count):
        x = (3.0 + 0.37 * i) * (-1) ** i
        pairs += [
            mg.Pair(f"B{i}", "R", "crank", f"c{i}", point=(0, 1, 0), axis=z),
            mg.Pair(f"C{i}", "R", f"c{i}", f"r{i}", point=(x, 1 + near, 0), axis=z),
            mg.Pair(f"D{i}", "R", "frame", f"r{i}", point=(x, 0, 0), axis=z),
        ]
    return mg.Mechanism("twins", pairs=pairs, drives=["A"])


@pytest.mark.daily(6)
@pytest.mark.parametrize("near", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("positions", [4, 73])
def test_loops_that_pass_change_points_together_stay_on_their_branches(near: float, count: int, positions: int) -> None:
    """Two determinants that change sign together leave their product as it was; the branch is kept all the same."""
    turn = np.linspace(0, 2 * np.pi, positions)
    alone, together = (mg.kinematics(twins(n, near), {"A": turn})["D0"].position for n in (1, count))
    assert np.abs(together - alone).max() < 1e-9


def slider_crank(rod: float, begin: float) -> mg.Mechanism:
    """Crank of length one at the angle ``begin``: ``x = cos a + sqrt(l^2 - sin^2 a)``."""
    z, pin = (0, 0, 1), (np.cos(begin), np.sin(begin), 0.0)
    end = (slide(rod, begin), 0, 0)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z),
        mg.Pair("B", "R", "crank", "rod", point=pin, axis=z),
        mg.Pair("C", "R", "rod", "slider", point=end, axis=z),
        mg.Pair("D", "P", "frame", "slider", point=end, axis=(1, 0, 0)),
    ]
    return mg.Mechanism("slider-crank", pairs=pairs, drives=["A"])


def slide(rod, angle):
    return np.cos(angle) + np.sqrt(rod**2 - np.sin(angle) ** 2)


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("near", "begin", "positions"),
    [(1e-6, 0.6205487042125981, 5210), (1e-7, 0.3, 5000), (1e-8, 0.3, 3601), (1e-8, 0.6040731559945676, 5484)],
)
def test_no_position_is_on_the_other_branch_near_a_change_point(near: float, begin: float, positions: int) -> None:
    """A slider-crank with a rod longer than its crank by ``near`` of it turns fully."""
    turn = np.linspace(0.0, 4 * np.pi, positions)
    s = mg.kinematics(slider_crank(1.0 + near, begin), {"A": turn})
    expected = slide(1.0 + near, begin + turn) - slide(1.0 + near, begin)
    np.testing.assert_allclose(s["D"].position[:, 0], expected, atol=1e-9)


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("short", "begin"), [(1.364766307e-6, -0.3855575158413451), (1e-4, 0.2), (1e-5, -0.4), (3e-6, 0.6), (1e-8, 0.5)]
)
def test_a_narrow_gap_of_the_reach_is_not_leapt_over(short: float, begin: float) -> None:
    """A slider-crank whose rod is shorter than its crank by ``short`` of it ends at ``sin a = l``, also where it would go on behind."""
    m, limit = slider_crank(1.0 - short, begin), np.arcsin(1.0 - short) - begin
    for beyond in (0.1, 0.5, 1.0):
        with pytest.raises(mg.ReachError) as caught:
            mg.kinematics(m, {"A": [0.0, limit + beyond]})
        assert caught.value.value["A.Rz"] == pytest.approx(limit, abs=1e-6)


def gripper(on: str = "axis") -> mg.Mechanism:
    """A four-bar of 30 mm carried along x by a slide, or by two parallel ones that close a loop of their own."""
    points = [(0, 0), (0, 0.03), (0.036, 0.039), (0.033, 0)]
    links = ["carriage", "crank", "coupler", "rocker"]
    pairs = [mg.Pair("X", "P", "frame", "carriage", point=(0, 0, 0), axis=(1, 0, 0))]
    if on == "gantry":
        pairs.append(mg.Pair("Y", "P", "frame", "carriage", point=(0, 0.1, 0), axis=(1, 0, 0)))
    for k, (name, (x, y)) in enumerate(zip("ABCD", points, strict=True)):
        pairs.append(mg.Pair(name, "R", links[k], links[(k + 1) % 4], point=(x, y, 0), axis=(0, 0, 1)))
    centers = dict(zip(links, points, strict=True))
    bodies = [mg.Link("frame"), *(mg.Link(name, mass=1.0, center=(x, y, 0)) for name, (x, y) in centers.items())]
    return mg.Mechanism(on, bodies, pairs, ["X", "A"], [mg.Gravity((0, -9.81, 0))])


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("on", ["axis", "gantry"])
def test_loops_are_closed_about_their_own_place(on, engine):
    """Carried 500 m away a gripper has the angles and torques that it has at home, in as few nodes."""
    m = gripper(on)
    A = np.linspace(0, 0.5, 6)
    home, away = (
        mg.solve(m, {"X": np.concatenate([[0.0], np.full(6, x)]), "A": np.concatenate([[0.0], A])}, engine=engine)
        for x in (0.0, 500.0)
    )
    noise = 500 / 0.03 * 1e-13  # rounding of positions, over the size of the gripper
    for name in "BCD":
        np.testing.assert_allclose(away[name].position, home[name].position, atol=noise)
    np.testing.assert_allclose(away["A"].effort, home["A"].effort, rtol=10 * noise, atol=noise)
    assert away.work.nodes < 100


def five_bar():
    """A planar five-bar with both cranks driven."""
    points, links = [(0, 0), (0, 1), (0.9, 1.6), (1.6, 1), (1.6, 0)], ["f", "a", "b", "c", "d"]
    pairs = [
        mg.Pair(name, "R", links[k], links[(k + 1) % 5], point=(*points[k], 0), axis=(0, 0, 1))
        for k, name in enumerate("ABCDE")
    ]
    return mg.Mechanism("five-bar", None, pairs, ["A", "E"], frame="f")


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_first_position_beyond_the_reach_leaves_the_others(engine):
    """B3 with two drivers: the others are solved as they are alone, and the error says how far the drivers came."""
    values = {"A": [2.5, 0.1, 0.2], "E": [0.0, 0.05, 0.1]}
    s = mg.kinematics(five_bar(), values, on_reach="flag", engine=engine)
    assert s.status.tolist() == ["out of reach", "ok", "ok"]
    alone = mg.kinematics(five_bar(), {name: v[1:] for name, v in values.items()}, engine=engine)
    for name in "BCD":
        np.testing.assert_allclose(s[name].position[1:], alone[name].position, atol=1e-10)
    with pytest.raises(mg.ReachError, match=r"position 0 .* is not reachable .* stops at A\.Rz = 0\.41"):
        mg.kinematics(five_bar(), values, engine=engine)
