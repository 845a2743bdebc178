"""Identities of engines: the dense and the sparse engine say the same, to rounding: values, NaN, statuses, warnings, errors."""

import mechanisms as known
import numpy as np
import pytest
from attack import anywhere, conditions, differences, solved, warned, without_numbers
from lattices import LATTICES
from mechanisms import Z
from strategies import closed_mechanism, motions, open_chain, with_drives, with_loads, with_loads_on_links

import mechgraph as mg
from mechgraph.kinematics.assembly import assembled, named_columns
from mechgraph.kinematics.motion_path import DriverPath, Request
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.tolerances import PATH

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Random loads move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

SAME = 1e-9
"""Difference of engines over the condition (largest rate for unit rates of the drivers): factors of other pivots round otherwise."""


def assert_engines_agree(m, given, tolerance=SAME, **how):
    dense, sparse = (solved(m, given, engine=e, **how) for e in ("dense", "sparse"))
    if isinstance(dense, Exception) or isinstance(sparse, Exception):
        assert type(dense) is type(sparse), f"{type(dense).__name__}: {dense}\n{type(sparse).__name__}: {sparse}"
        assert without_numbers(dense) == without_numbers(sparse)
        return
    assert (dense.engine, sparse.engine) == ("dense", "sparse")
    worst, where, faults = differences(dense, sparse)
    worse = conditions(dense)[dense.status == "ok"].max(initial=1.0)
    assert not faults
    assert worst <= tolerance * max(1.0, worse), f"{where}: {worst:.1e} at condition {worse:.1e}"
    assert warned(m, given, engine="dense", **how) == warned(m, given, engine="sparse", **how)


def drawn(seed):
    """A random mechanism with drives and loads, some with a driver too many or too few, a motion, and how to solve."""
    rng = np.random.default_rng((seed, 30))
    m = with_drives(closed_mechanism(seed), seed)
    if m is None:
        pytest.skip("no drives make it determinate")
    m = with_loads(m, seed)
    if rng.random() < 0.15:
        m = m.replace(drives=m.drives[:-1])
    if rng.random() < 0.25:
        has = {m.full_name(d.freedom) for d in m.drives}
        free = [f for p in m.pairs for f, able in zip(p.freedom_names, p.type.drivable, strict=True) if able]
        more = [f for f in free if f not in has]
        if more:
            m = m.replace(drives=[*m.drives, mg.Drive(str(rng.choice(more)))])
    t = np.linspace(0, rng.choice([0.1, 1.0, 3.0]), int(rng.choice([1, 6, 15])))
    how = {
        "redundant": str(rng.choice(["nan", "minimum_norm"])),
        "method": str(rng.choice(["loop_wrench", "newton_euler"])),
    }
    return m, motions(m, seed, t, size=float(rng.choice([0.08, 0.5]))), how


@pytest.mark.seeds(24, daily=(4, 6, 9))
def test_random_mechanisms(seed):
    m, given, how = drawn(seed)
    assert_engines_agree(m, given, **how)


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", mg.library())
def test_library(name):
    m = mg.load(name)
    assert_engines_agree(m, {d.freedom: d.motion.position[:5] for d in m.drives if d.motion is not None})


@pytest.mark.daily(2)
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
@pytest.mark.parametrize("kind", LATTICES)
def test_lattices_around_the_crossover(kind, method):
    m = LATTICES[kind](8)
    given = {m.drives[0].freedom: mg.Motion(np.linspace(0.0, 0.2, 3), 1.0, 0.5)}
    for redundant in ("nan", "minimum_norm"):
        assert_engines_agree(m, given, 1e-8, redundant=redundant, method=method)


@pytest.mark.seeds(1)
def test_chains_open_at_the_start(seed):
    m = open_chain(seed)
    able = [n for p in m.pairs for n, d in zip(p.freedom_names, p.type.drivable, strict=True) if d]
    if not able:
        pytest.skip("no freedom takes a drive")
    assert_engines_agree(m.replace(drives=[able[0]]), {able[0]: np.linspace(0.0, 0.2, 2)})


def tangent_mechanism():
    """An arm about the origin, a block that slides along it, pinned to a slider on the line x = 1."""
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "arm", "block", point=(1, 0, 0), axis=(1, 0, 0)),
        mg.Pair("C", "R", "block", "slider", point=(1, 0, 0), axis=Z),
        mg.Pair("D", "P", "frame", "slider", point=(1, 0, 0), axis=(0, 1, 0)),
    ]
    return mg.Mechanism("tangent", None, pairs, ["A"])


@pytest.mark.parametrize("engine", ["dense", pytest.param("sparse", marks=pytest.mark.slow)])
def test_slides_that_grow_without_bound(engine):
    """``D = tan A``: no dead point lies before a right angle, and behind it nothing is reached."""
    a = np.array([1.5, 1.57, 1.5707, 2.0])
    with pytest.raises(mg.ReachError, match=r"B\.Tz = [\d.]+, D\.Tz = [\d.]+, growing without bound") as error:
        mg.kinematics(tangent_mechanism(), {"A": mg.Motion(a, 1.0)}, engine=engine)
    s = error.value.solution
    assert s.status.tolist() == ["ok"] * 3 + ["out of reach"]
    np.testing.assert_allclose(s["D"].position[:3, 0], np.tan(a[:3]), rtol=1e-11)
    np.testing.assert_allclose(s["D"].velocity[:3, 0], 1 / np.cos(a[:3]) ** 2, rtol=1e-9)


# --- what random mechanisms found, one by one -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [40, 139, 213])
def test_the_sign_of_what_holds_a_passive_body(seed):
    """A turn in E-S, a slide in E-E, a turn in Sp-S: the couple or force that holds the body has one sign."""
    m = with_loads_on_links(with_drives(closed_mechanism(seed), seed), seed)
    given = {d.freedom: 0.01 for d in m.drives}
    one, other = (solved(m, given, engine=e).passive_effort for e in ("dense", "sparse"))
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_allclose(value, other[name], rtol=1e-9)


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", [40, 204, 218])
def test_where_a_passive_body_stands_does_not_hang_on_the_engine(seed):
    """A body between a sphere and a plane: the turn that takes its spin out is not linear in the coordinates of the plane."""
    m = with_loads_on_links(with_drives(closed_mechanism(seed), seed), seed)
    given = {d.freedom: mg.Motion(np.linspace(0.0, 0.3, 4), 1.0) for d in m.drives}
    one, other = (solved(m, given, engine=e, forces=False) for e in ("dense", "sparse"))
    assert differences(one, other, forces=False)[0] < 1e-9


def wheels(*couplings, drives=("A",)):
    pairs = [mg.Pair(name, "R", "frame", f"wheel{name}", point=(i, 0, 0), axis=Z) for i, name in enumerate("ABC")]
    return mg.Mechanism("wheels", None, pairs, list(drives), [mg.Effort("C", 2.0)], couplings=couplings)


AB, BC = mg.Coupling({"A": 1, "B": 2}), mg.Coupling({"B": 1, "C": 3})
Q = np.array([0.0, 1.0, 2.0])
COUPLED = {
    "determinate": (wheels(AB, BC), {"A": Q}),
    "one twice": (wheels(AB, BC, mg.Coupling({"A": 2, "B": 4}, name="again")), {"A": Q}),
    "contradicting": (wheels(AB, BC, mg.Coupling({"A": 2, "B": 5}, name="other")), {"A": Q}),
    "contradicting constants": (wheels(AB, BC, mg.Coupling({"A": 1, "B": 2}, constant=0.5, name="other")), {"A": Q}),
    "locked driver": (wheels(AB, BC, mg.Coupling({"A": 1}, name="lock")), {"A": Q}),
    "one too few": (wheels(AB), {"A": Q}),
    "drivers that agree": (wheels(AB, BC, drives=("A", "B")), {"A": Q, "B": -0.5 * Q}),
    "drivers that contradict": (wheels(AB, BC, drives=("A", "B")), {"A": Q, "B": 0.5 * Q}),
    "two freedoms of a four-bar": (
        mg.load("four-bar").replace(drives=[], couplings=[mg.Coupling({"A": 1, "D": -1})]),
        {},
    ),
    "no drive, no loop": (wheels(drives=()), {}),
}


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", COUPLED)
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_couplings(name, method):
    """Redundant and contradicting ones too: a result or one of our errors, and the same from both engines."""
    m, given = COUPLED[name]
    # of drivers or couplings that strain each other without any reaction the sparse engine knows no least norm and says NaN
    alone = name in ("one twice", "drivers that agree")
    for redundant in ("nan",) if alone else ("nan", "minimum_norm"):
        assert_engines_agree(m, given, method=method, redundant=redundant)


@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_least_reactions_where_drivers_strain_each_other(method):
    """What the drivers supply is no reaction: it has no part in the norm, wherever it acts."""
    m = known.planar().moved(anywhere(np.random.default_rng(0)))
    m = m.replace(
        drives=["O1", "O4"], loads=[mg.Wrench(m.links[2].name, force=(3.0, -2.0, 5.0), point=(0.2, 0.1, 0.4))]
    )
    assert_engines_agree(m, {"O1": [0.0], "O4": [0.0]}, redundant="minimum_norm", method=method)


def test_another_freedom_is_held_where_the_one_held_no_longer_turns_the_body():
    """The coupler of a planar RSSR keeps its direction while the crank makes a turn: no freedom at the crank can hold it all along.

    At a held freedom the spin has rate one; where the line of the spheres comes to be across it, the others grow without bound.
    """
    corners = [(0, 0, 0), (1, 0, 0), (3.0, 2.4, 0), (3, 0, 0)]
    m = known.ring("RSSR", corners, [known.Z, None, None, known.Z], name="planar RSSR")
    system, x = assembled(m)
    columns, _ = named_columns(m, system, {"O1": 0.0})
    solver = closure_solver("dense", columns, np.array([m.freedom_names().index("O2.Rx")]))
    path = DriverPath(system, solver, lambda variants: system)
    turn = np.linspace(0, 2 * np.pi, 73)
    found = follow(path, [Request(x, 0, turn[None], np.arange(73))], 73)
    here = Configuration(system, found.x)

    def fastest(which):
        return np.abs(solver.factored(here, which).motions()).max(axis=(0, 1))

    first = np.zeros(73, dtype=np.intp)
    assert fastest(first).max() > 10 * PATH.held
    worst = PATH.held / PATH.better  # another one is taken where it is that much better
    assert fastest(solver.chosen(here, first)).max() <= worst
    assert fastest(solver.chosen(here, found.which)).max() <= worst
    assert len(set(found.which.tolist())) > 1


def welded(*more):
    """A frame and a link welded twice, with more pairs."""
    loop = [mg.Pair(name, "W", "frame", "base", point=(i, 0, 0)) for i, name in enumerate("AB")]
    return mg.Mechanism("welded twice", None, [*loop, *more])


@pytest.mark.parametrize("freedoms", [0, 1, 2])
def test_loops_without_any_freedom(freedoms):
    """A loop of welds, alone and with open chains on it: rows without a column."""
    m = welded(*(mg.Pair(f"C{i}", "R", "base", f"arm{i}", point=(i, 1, 0), axis=Z) for i in range(freedoms)))
    dense, sparse = (mg.check(m, engine=e) for e in ("dense", "sparse"))
    assert (dense.mobility, dense.redundancy) == (sparse.mobility, sparse.redundancy) == (freedoms, 6)
    assert str(dense) == str(sparse)
    driven = m.replace(drives=[f"C{i}" for i in range(freedoms)])
    if freedoms:
        assert_engines_agree(driven, {d.freedom: np.array([0.1, 0.3]) for d in driven.drives})


@pytest.mark.parametrize("make", [known.bennett, known.hexapod, known.sarrus, known.planar, known.rssr_sc])
def test_one_position_is_solved_as_many_are(make):
    """The dense engine factors one position by LAPACK itself, many in a batch: redundant loops, held freedoms, several drivers."""
    m = make()
    system, x = assembled(m)
    columns = np.array([m.freedom_names().index(m.full_name(d.freedom)) for d in m.drives] or [0])
    solver = closure_solver("dense", columns)
    here, many = Configuration(system, x[:, None]), Configuration(system, np.repeat(x[:, None], 9, axis=1))
    one = solver.factored(here, solver.chosen(here, np.full(1, -1)))
    others = solver.factored(many, np.repeat(one.which, 9))
    rng = np.random.default_rng(1)
    b, c = rng.normal(size=(system.n_rows, 2, 1)), rng.normal(size=(system.n_freedoms, 2, 1))
    found = [
        (f.condition, f.sensitivity(), f.motions(), f.self_stresses(), f.solve(y), f.solve_transposed(z))
        for f, y, z in ((one, b, c), (others, np.repeat(b, 9, axis=2), np.repeat(c, 9, axis=2)))
    ]
    for alone, among in zip(*found, strict=True):
        np.testing.assert_allclose(alone[..., 0], among[..., 4], rtol=0, atol=1e-13 * one.condition[0])
