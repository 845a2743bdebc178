"""Identities of determinacy: mobility, self-stress and uniqueness, passive and locked freedoms, errors that name what is wrong."""

import json

import numpy as np
import pytest
from strategies import closed_mechanism, pose, rescaled, unit, with_drives, with_loads

import mechgraph as mg

Z = (0, 0, 1)


def ring(name, types, points, axes, links=None, drives=("A",), **more):
    """A single loop of pairs A, B, ... through frame, l1, l2, ..."""
    n = len(types)
    names = ["frame", *(f"l{k}" for k in range(1, n))]
    letters = "ABCDEFGH"
    pairs = [
        mg.Pair(
            letters[k],
            types[k],
            names[k],
            names[(k + 1) % n],
            point=points[k],
            axis=axes[k],
            **({"pitch": 0.1 + 0.07 * k} if types[k] == "H" else {}),
        )
        for k in range(n)
    ]
    rng = np.random.default_rng(len(name))
    links = links or [
        mg.Link("frame"),
        *(
            mg.Link(
                k,
                mass=1.0 + 0.2 * i,
                center=0.5 * (np.array(points[i]) + points[i + 1]) + 0.05 * unit(rng),
                inertia=np.diag([0.03, 0.02, 0.025]),
            )
            for i, k in enumerate(names[1:])
        ),
    ]
    return mg.Mechanism(name, links=links, pairs=pairs, drives=list(drives), **more)


def planar():
    return ring(
        "planar four-bar",
        "RRRR",
        [(0, 0, 0), (0.3, 0.4, 0), (1.3, 1.1, 0), (1.2, 0, 0)],
        [Z] * 4,
        loads=[mg.Gravity((0, -9.81, 0))],
    )


def spherical():
    axes = [(0, 0, 1), (0.5, 0, 0.9), (0.6, 0.8, 0.5), (0, 0.9, 0.4)]
    return ring(
        "spherical four-bar",
        "RRRR",
        [np.array(a) * (0.5 + 0.2 * k) for k, a in enumerate(axes)],
        axes,
        loads=[mg.Gravity((1, -9.81, 2))],
    )


def bennett(a=1.0, b=0.7, alpha=0.8):
    """Links a, alpha, b, beta, a, alpha, b, beta with a / sin alpha = b / sin beta (Bennett 1903), assembled from its chain."""
    beta = np.pi - np.arcsin(b * np.sin(alpha) / a)
    links = [
        mg.Link(f"link{k}", mass=1.0 + 0.3 * k, center=(-0.4, 0.1, 0.05 * k), inertia=np.diag([0.01, 0.04, 0.04]))
        for k in (1, 2, 3)
    ]
    m = mg.chain(
        "RRRR",
        twist=[alpha, beta, alpha, beta],
        length=[a, b, a, b],
        offset=[0, 0, 0, 0],
        links=links,
        loads=[mg.Gravity((1.0, 2.0, -9.81))],
        start={"O1": 1.0, "O2": 2.0, "O3": -1.0, "O4": -2.0},
    )
    return mg.assemble(m, {"O1": 1.0})


OVERCONSTRAINED = {"planar": planar, "spherical": spherical, "bennett": bennett}


def rssr(drives=("A",), coupler=None):
    points = [(0, 0, 0), (0.3, 0, 0.1), (0.5, 1.2, 0.6), (1.1, 1.0, 0)]
    p, q = np.array(points[1]), np.array(points[2])
    coupler = coupler or mg.Link("l2", mass=1.0, center=0.5 * (p + q), inertia=mg.inertia.rod(1.0, p, q))
    links = [
        mg.Link("frame"),
        mg.Link("l1", mass=0.5, center=(0.1, 0, 0), inertia=0.01 * np.eye(3)),
        coupler,
        mg.Link("l3", mass=0.7, center=(0.8, 1.1, 0.3), inertia=0.02 * np.eye(3)),
    ]
    return ring(
        "rssr", "RSSR", points, [Z, Z, Z, (1, 0.1, 0)], links=links, drives=drives, loads=[mg.Gravity((0, 0, -9.81))]
    )


@pytest.mark.parametrize("build", OVERCONSTRAINED.values(), ids=OVERCONSTRAINED)
def test_overconstrained_four_bars_have_mobility_one_and_redundancy_three(build):
    report = mg.check(build())
    assert report.mobility_by_count == -2
    assert report.mobility == report.finite_mobility == 1
    assert report.redundancy == 3 == len(report.self_stresses)
    assert not report.determinate
    assert not report.undriven
    assert not report.passive
    for row in report.unique.values():
        if "effort" in row:
            assert row["effort"]


@pytest.mark.daily(4)
@pytest.mark.parametrize("build", OVERCONSTRAINED.values(), ids=OVERCONSTRAINED)
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_components_that_are_not_unique_are_nan_and_those_that_are_do_not_change(build, method):
    """Brute force: equilibrium plus any null-space vector of the assembled equations changes exactly the components that are NaN."""
    m = build()
    at = {
        m.drives[0].freedom: mg.Motion(
            m.start.get(m.full_name(m.drives[0].freedom), 0.0) + np.linspace(0.0, 0.5, 4), 2.0, 1.0
        )
    }
    s = mg.solve(m, at, method=method)
    least = mg.solve(m, at, method=method, redundant="minimum_norm")
    f = mg.formulate(m, "minimal")
    names = [(p.name, c) for p in m.pairs for c in p.type.component_names]
    assert len(f.unknowns) == len(names) + 1
    rng = np.random.default_rng(0)
    for i in range(4):
        A, b = f.assemble(s.state(i))
        A = A.toarray()
        u, _, rank, sigma = np.linalg.lstsq(A, b, rcond=1e-10)
        assert rank == A.shape[1] - 3
        null = np.linalg.svd(A)[2][rank:]
        changed = np.abs(null).max(axis=0) > 1e-8
        big = np.abs(u).max()
        np.testing.assert_allclose(A @ u, b, atol=1e-9 * big)
        v = u + null.T @ rng.normal(size=3) * big
        for n, (pair, component) in enumerate(names):
            value = s[pair].components[component][i]
            assert np.isnan(value) == changed[n]
            if not changed[n]:
                assert value == pytest.approx(u[n], abs=1e-8 * big)
                assert value == pytest.approx(v[n], abs=1e-7 * big)
        assert not changed[-1]
        np.testing.assert_allclose(s[m.drives[0].freedom].effort[i, 0], u[-1], atol=1e-8 * big)
        full = np.array([least[p].components[c][i] for p, c in names] + [least[m.drives[0].freedom].effort[i, 0]])
        np.testing.assert_allclose(A @ full, b, atol=1e-8 * big)
    report = mg.check(m)
    for pair, row in report.unique.items():
        for component, unique in row.items():
            if component != "effort":
                assert np.isnan(s[pair].components[component][0]) != unique


def size(m, s):
    """L of the design, RMS distance of pair points and mass centers from the centroid of the pair points; and the pair points."""
    points = np.array([(s.link(p.b).pose @ [*(p.on_b.point if p.on_b else p.point), 1.0])[:3] for p in m.pairs])
    centers = np.array([s.link(k.name).center for k in m.links if k.center is not None])
    return np.sqrt(((np.vstack([points, centers]) - points.mean(axis=0)) ** 2).sum(axis=1).mean()), points


@pytest.mark.parametrize("build", OVERCONSTRAINED.values(), ids=OVERCONSTRAINED)
def test_minimum_norm_is_the_least_of_all_states_and_the_same_for_both_methods_and_units(build):
    """sum |F|^2 + |M / L|^2 of reaction parts at the pair points, L as the design says, computed here from the geometry."""
    m = build()
    name = m.drives[0].freedom
    begin = m.start.get(m.full_name(name), 0.0)
    a, b = (mg.solve(m, {name: begin}, method=x, redundant="minimum_norm") for x in ("loop_wrench", "newton_euler"))
    big = max(np.abs(a[p.name].total).max() for p in m.pairs)
    for p in m.pairs:
        np.testing.assert_allclose(a[p.name].reaction, b[p.name].reaction, atol=1e-9 * big)
    L, points = size(m, a)
    f = mg.formulate(m, "minimal")
    state = a.state()
    A = f.assemble(state)[0].toarray()
    null = np.linalg.svd(A)[2][-3:]

    def measured(wrenches):
        """Forces and moments / L at the pair points, stacked."""
        return np.concatenate(
            [np.concatenate([(w[:3] - np.cross(x, w[3:])) / L, w[3:]]) for w, x in zip(wrenches, points, strict=True)]
        )

    mine = measured([a[p.name].reaction for p in m.pairs])
    for row in null:
        at, stress = 0, []
        for k, p in enumerate(m.pairs):
            n = 6 - p.type.f
            stress.append(state.reactions[k][:, :, 0] @ row[at : at + n])
            at += n
        direction = measured(stress)
        assert abs(direction @ mine) < 1e-8 * np.linalg.norm(direction) * np.linalg.norm(mine)
    mm = mg.solve(rescaled(m, 1000.0), {name: begin}, redundant="minimum_norm")
    for p in m.pairs:
        np.testing.assert_allclose(mm[p.name].force / 1000.0, a[p.name].force, atol=1e-8 * big)
        np.testing.assert_allclose(mm[p.name].moment / 1e6, a[p.name].moment, atol=1e-8 * big)


def test_the_unique_components_of_a_planar_four_bar_are_those_in_its_plane():
    report = mg.check(planar())
    for pair in "ABCD":
        row = report.unique[pair]
        assert (row["Fx"], row["Fy"], row["Fz"], row["Mx"], row["My"]) == (True, True, False, False, False)


@pytest.mark.parametrize("build", OVERCONSTRAINED.values(), ids=OVERCONSTRAINED)
@pytest.mark.parametrize("change", ["moved", "far", "mm"])
def test_the_verdict_does_not_depend_on_place_or_unit(build, change):
    m = build()
    X = pose(np.random.default_rng(1), 5.0)
    far = np.eye(4)
    far[:3, 3] = (6e4, -4.8e4, 6.4e4)
    other = {"moved": m.moved(X), "far": m.moved(far), "mm": rescaled(m, 1000.0)}[change]
    a, b = mg.check(m), mg.check(other)
    assert (a.mobility, a.finite_mobility, a.redundancy, a.determinate, a.unique) == (
        b.mobility,
        b.finite_mobility,
        b.redundancy,
        b.determinate,
        b.unique,
    )


@pytest.mark.parametrize("seed", range(6))
def test_redundancy_is_the_nullity_of_the_transpose_and_the_ledger_balances(seed):
    m = with_drives(closed_mechanism(seed), seed) or closed_mechanism(seed)
    report = mg.check(m)
    f = sum(p.type.f for p in m.pairs)
    assert report.mobility - report.redundancy == report.mobility_by_count == f - 6 * len(report.loops)
    for bookkeeping in ("lee", "minimal"):
        assert report.ledger(bookkeeping).balance == report.mobility_by_count - len(m.drives)


def test_pphchp_moves_and_its_helical_pairs_and_turn_of_c_stand_still():
    """With all turns locked by a rigid spherical triangle four slides are left in three dimensions: mobility 1."""
    rng = np.random.default_rng(5)
    m = ring("pphchp", "PPHCHP", rng.uniform(-1, 1, (6, 3)), [unit(rng) for _ in range(6)])
    report = mg.check(m)
    assert report.mobility_by_count == 1
    assert report.mobility == report.finite_mobility == 1
    assert report.redundancy == 0
    assert {name for finding in report.locked for name in finding.freedoms} == {"C.Rz", "D.Rz", "E.Rz"}
    s = mg.solve(m, {"A": np.linspace(0, 0.3, 5)}, loads=[mg.Gravity((0, 0, -9.81))])
    assert s.checks.equilibrium.max() < 1e-9
    for pair in "CE":
        np.testing.assert_allclose(s[pair].position, 0, atol=1e-10)


def test_the_spin_of_the_coupler_of_rssr_is_passive_and_held_without_effort():
    m = rssr()
    report = mg.check(m)
    assert report.mobility == report.finite_mobility == 2
    assert report.redundancy == 0
    (spin,) = report.passive
    assert spin.links == ("l2",)
    point, direction = (np.array(x) for x in spin.axis)
    along = np.array(m.pair("C").point) - m.pair("B").point
    np.testing.assert_allclose(np.cross(direction, along), 0, atol=1e-8)
    np.testing.assert_allclose(np.cross(point - m.pair("B").point, along), 0, atol=1e-8)
    assert report.determinate
    s = mg.solve(m, {"A": mg.Motion(np.linspace(0, 6.28, 50), 3.0)})
    big = np.abs(s["B"].force).max()
    assert s.passive_effort
    assert all(np.abs(v).max() < 1e-6 * big for v in s.passive_effort.values())
    assert s.checks.equilibrium.max() < 1e-9
    assert np.abs(s.checks.power).max() < 1e-8


def test_a_couple_about_the_coupler_has_to_be_held_and_is_returned():
    m = rssr()
    p, q = np.array(m.pair("B").point), np.array(m.pair("C").point)
    couple = 2.0 * (q - p) / np.linalg.norm(q - p)
    with pytest.warns(mg.MechgraphWarning, match=r"couple of 2 \(max\)"):
        held = mg.solve(m, {"A": 0.0}, loads=[mg.Wrench("l2", moment=couple)])
    (value,) = held.passive_effort.values()
    assert abs(value) > 0.5
    assert held.checks.equilibrium.max() < 1e-9


def test_a_pendulum_is_not_passive():
    m = mg.Mechanism("pendulum", pairs=[mg.Pair("A", "R", "frame", "bar", point=(0, 0, 0), axis=Z)])
    report = mg.check(m)
    assert report.passive == ()
    assert len(report.undriven) == 1
    assert not report.determinate
    assert [f.freedoms for f in report.drivable] == [("A.Rz",)]
    with pytest.raises(mg.IndeterminateError, match="A"):
        mg.solve(m)
    with pytest.raises(mg.IndeterminateError):
        mg.solve(m.replace(loads=[mg.Gravity((0, -1, 0))]), {})


def test_what_is_left_free_is_named():
    m = ring("five-bar", "RRRRR", [(0, 0, 0), (0.2, 1, 0), (1, 1.5, 0), (1.8, 1, 0), (2, 0, 0)], [Z] * 5)
    with pytest.raises(mg.IndeterminateError) as caught:
        mg.solve(m, {"A": 0.0})
    assert caught.value.report.mobility == 2
    assert any(pair in str(caught.value) for pair in "BCDE")
    s = mg.solve(m.replace(drives=["A", "E"]), {"A": 0.1, "E": -0.1})
    assert s.checks.closure < 1e-10


def test_drivers_that_contradict_each_other_are_refused():
    m = planar().replace(drives=["A", "D"])
    good = mg.kinematics(planar(), {"A": mg.Motion([0.0, 0.1], 1.0)})
    with pytest.raises(mg.MechgraphError) as caught:
        mg.solve(m, {"A": mg.Motion([0.0, 0.1], 1.0), "D": mg.Motion([0.0, 0.3], 1.0)})
    assert isinstance(caught.value, mg.IndeterminateError | mg.ReachError)
    with pytest.raises(mg.IndeterminateError, match="conflict"):
        mg.solve(m, {"A": mg.Motion(0.0, 1.0), "D": mg.Motion(0.0, -5.0)})
    s = mg.solve(
        m, {"A": mg.Motion(0.0, 1.0), "D": mg.Motion(0.0, good["D"].velocity[0, 0], good["D"].acceleration[0, 0])}
    )
    assert np.isnan([s["A"].effort, s["D"].effort]).all()
    assert s.checks.closure < 1e-10


def test_drivers_that_agree_are_solved_and_their_efforts_are_not_unique():
    good = mg.kinematics(planar(), {"A": mg.Motion([0.0, 0.1], 1.0)})
    agreed = {n: mg.Motion(good[n].position[:, 0], good[n].velocity[:, 0], good[n].acceleration[:, 0]) for n in "AD"}
    s = mg.solve(planar().replace(drives=["A", "D"]), agreed)
    np.testing.assert_allclose(s["B"].position, good["B"].position, atol=1e-9)
    assert np.isnan([s["A"].effort, s["D"].effort]).all()


def rocker():
    """Driven at the rocker, this crank-rocker has dead points."""
    return ring("rocker", "RRRR", [(0, 0, 0), (0.3, 0.0, 0), (1.0, 0.9, 0), (1.0, 0, 0)], [Z] * 4, drives=["D"])


def test_a_dead_point_carries_value_and_partial_solution_and_can_be_flagged():
    m = rocker()
    crank = mg.kinematics(m.replace(drives=["A"]), {"A": np.linspace(0, 2 * np.pi, 2001)})["D"].position[:, 0]
    limit = crank.max()
    path = np.linspace(0.0, limit + 0.3, 40)
    with pytest.raises((mg.DeadPointError, mg.ReachError)) as caught:
        mg.solve(m, {"D": path})
    error = caught.value
    assert error.value["D.Rz"] == pytest.approx(limit, abs=2e-3)
    assert error.value["D.Rz"] <= limit + 1e-6
    s = error.solution
    reached = path < limit - 1e-3
    assert np.isfinite(s["A"].position[reached]).all()
    assert np.isnan(s["A"].position[path > limit]).all()
    flagged = mg.solve(m, {"D": path}, on_reach="flag")
    assert (flagged.status[reached] == "ok").all()
    assert (flagged.status[path > limit] != "ok").all()
    assert np.isnan(flagged["D"].effort[path > limit]).all()
    assert np.isfinite(flagged["D"].effort[reached]).all()
    np.testing.assert_allclose(s["A"].position[reached], flagged["A"].position[reached])


def test_a_position_out_of_reach_is_an_error_that_says_so():
    m = mg.Mechanism(
        "slider-crank",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "crank", "rod", point=(0, 0.3, 0), axis=Z),
            mg.Pair("C", "R", "rod", "slider", point=(1, 0, 0), axis=Z),
            mg.Pair("D", "P", "frame", "slider", point=(1, 0, 0), axis=(1, 0, 0)),
        ],
        drives=["D"],
    )
    rod = np.hypot(1, 0.3)
    for goal in (0.3 + rod - 1 + 0.2, rod - 0.3 - 1 - 0.2):
        with pytest.raises((mg.ReachError, mg.DeadPointError)) as caught:
            mg.solve(m, {"D": goal})
        assert "D" in str(caught.value)
        assert rod - 0.3 - 1 - 1e-6 <= caught.value.value["D.Tz"] <= rod + 0.3 - 1 + 1e-6
    with pytest.raises(mg.AssemblyError) as caught:
        mg.assemble(m, {"D": 2.0})
    assert caught.value.residual > 0
    assert "D.Tz" in caught.value.best


def test_loops_that_cannot_be_closed_raise_an_assembly_error_with_the_residual():
    m = mg.chain("RRRR", twist=[0, 0, 0, 0], length=[10, 1, 1, 1], offset=[0, 0, 0, 0])
    with pytest.raises(mg.AssemblyError) as caught:
        mg.solve(m, {"O1": 0.0})
    assert caught.value.residual > 0.1
    report = mg.check(m)
    assert report.mobility is None
    assert report.mobility_by_count == -2
    assert report.note


def truss():
    """Frame, two bars on balls and a hinge: mobility 0."""
    return mg.Mechanism(
        "tripod",
        links=[
            mg.Link("frame"),
            mg.Link("boom", mass=3.0, center=(0.5, 0.1, 0.2), inertia=np.diag([0.1, 0.2, 0.2])),
            mg.Link("stay"),
        ],
        pairs=[
            mg.Pair("A", "R", "frame", "boom", point=(0, 0, 0), axis=(0, 1, 0)),
            mg.Pair("B", "S", "frame", "stay", point=(0, 0, 1)),
            mg.Pair("C", "S", "stay", "boom", point=(1, 0, 0)),
        ],
        loads=[mg.Gravity((0, 0, -9.81)), mg.Wrench("boom", force=(0, 0, -100.0), point=(1, 0, 0))],
    )


def test_a_structure_is_solved_without_a_driver():
    """The stay is a two-force bar: its pull balances the moments about the hinge."""
    m = truss()
    report = mg.check(m)
    assert (report.mobility, len(report.passive), report.redundancy) == (1, 1, 0)
    s = mg.solve(m)
    along = np.array([1, 0, -1]) / np.sqrt(2)
    pull = (100.0 * 1.0 + 3 * 9.81 * 0.5) * np.sqrt(2)
    np.testing.assert_allclose(s["C"].force, -pull * along, atol=1e-9)


def test_a_bracket_welded_to_the_frame_carries_its_loads():
    m = mg.Mechanism(
        "bracket",
        links=truss().links[:2],
        pairs=[mg.Pair("A", "W", "frame", "boom", point=(0, 0, 0))],
        loads=truss().loads,
    )
    s = mg.solve(m)
    np.testing.assert_allclose(s["A"].force, [0, 0, 100 + 3 * 9.81], atol=1e-9)
    np.testing.assert_allclose(
        s["A"].moment, -np.cross([1, 0, 0], [0, 0, -100]) - np.cross([0.5, 0.1, 0.2], [0, 0, -3 * 9.81]), atol=1e-9
    )
    assert s.batch == ()


def test_a_rigid_triangle_has_mobility_zero():
    m = ring(
        "triangle", "RRR", [(0, 0, 0), (1, 0, 0), (0.4, 0.8, 0)], [Z] * 3, drives=[], loads=[mg.Gravity((0, -9.81, 0))]
    )
    report = mg.check(m)
    assert report.mobility == report.finite_mobility == 0
    assert report.redundancy == 3
    assert {name for finding in report.locked for name in finding.freedoms} == {"A.Rz", "B.Rz", "C.Rz"}
    s = mg.solve(m)
    assert np.isfinite([s[p].components[c] for p in "ABC" for c in ("Fx", "Fy")]).all()
    assert np.isnan([s[p].components["Fz"] for p in "ABC"]).all()
    assert s.checks.equilibrium < 1e-9


def test_an_instantaneous_freedom_is_not_finite():
    """A flat triangle of hinges (1 + 1 = 2): one freedom by rank, none finite."""
    m = ring("flat triangle", "RRR", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [Z] * 3, drives=[])
    report = mg.check(m)
    assert report.mobility == 1
    assert report.finite_mobility == 0


def test_parallelogram_in_line_is_a_change_point():
    """All four hinges on one line: two freedoms here, one finite."""
    m = ring("change point", "RRRR", [(0, 0, 0), (0.5, 0, 0), (1.5, 0, 0), (1, 0, 0)], [Z] * 4)
    report = mg.check(m)
    assert report.mobility == 2
    assert report.finite_mobility == 1


@pytest.mark.parametrize("build", [planar, spherical])
def test_every_listed_self_stress_is_in_equilibrium_without_load(build):
    """Components (moments divided by L) put into the assembled equations leave nothing."""
    m = build()
    report = mg.check(m)
    s = mg.solve(m, {"A": 0.0}, loads=[], redundant="minimum_norm")
    A = mg.formulate(m, "minimal").assemble(s.state())[0].toarray()
    L = size(m, s)[0]
    found = []
    for stress in report.self_stresses:
        named = [(f"{p.name}:{c}", c) for p in m.pairs for c in p.type.component_names]
        u = [stress.components.get(name, 0.0) * (L if c.startswith("M") else 1.0) for name, c in named]
        found.append([*u, stress.efforts.get("A.Rz", 0.0) * L])
        assert np.abs(A @ found[-1]).max() < 1e-5
    assert np.linalg.matrix_rank(np.array(found), tol=1e-3) == 3


@pytest.mark.parametrize("seed", range(6))
def test_one_more_weld_inside_a_rigid_link_adds_no_redundancy_and_a_second_pair_does(seed):
    """A link held twice by the same pair: redundancy grows by 6 - f of it."""
    m = with_drives(closed_mechanism(40 + seed, loops=1, mobility=1, branches=0), seed)
    before = mg.check(m)
    p = m.pairs[0]
    twin = mg.Pair("twin", p.type, p.a, p.b, point=p.point, axis=p.axis, second=p.second, pitch=p.pitch)
    after = mg.check(m.replace(pairs=[*m.pairs, twin]))
    assert after.mobility == before.mobility
    assert after.redundancy == before.redundancy + 6 - p.type.f
    loose = after.unique[p.name]
    assert not any(v for name, v in loose.items() if name != "effort")
    kept = [q.name for q in m.pairs[1:]]
    assert all(after.unique[q] == before.unique[q] for q in kept)


@pytest.mark.parametrize("seed", range(4))
def test_drivable_freedoms_can_drive_and_others_cannot(seed):
    m = closed_mechanism(seed, loops=1, mobility=1, branches=0)
    report = mg.check(m)
    drivable = {name for finding in report.drivable for name in finding.freedoms}
    passive = len(report.passive)
    for p in m.pairs:
        for name, single in zip(p.freedom_names, p.type.drivable, strict=True):
            if not single:
                assert name not in drivable
                continue
            driven = mg.check(m.replace(drives=[name]))
            if name in drivable and report.mobility - passive == 1:
                assert not driven.undriven


def test_loads_do_not_change_the_verdict():
    m = with_drives(closed_mechanism(4), 4)
    assert mg.check(m).unique == mg.check(with_loads(m, 4)).unique


def test_the_report_is_plain_data_and_text_and_the_same_every_time():
    m = spherical()
    a, b = mg.check(m), mg.check(m)
    assert str(a) == str(b)
    assert a.to_json() == b.to_json()
    data = json.loads(a.to_json())
    assert data["redundancy"] == 3
    assert str(mg.check(rssr()))
    assert "passive" in mg.check(rssr()).to_markdown()
