"""``method="printed"`` solves what is printed: the same as the other methods; the printed system of a response gives the accelerations."""

import mechanisms as known
import numpy as np
import pytest
from attack import conditions, differences, solved
from test_complex_step import Circle, Ellipse, ring_with
from test_engines import drawn

import mechgraph as mg

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Random loads move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

SAME = 1e-9
MOVING = tuple(name for name in mg.library() if mg.load(name).expected.get("mobility", 0) > 0)
REDUNDANT = {
    "bennett": known.bennett,
    "goldberg": known.goldberg,
    "Bricard": known.bricard_line_symmetric,
    "sarrus": known.sarrus,
    "spherical": known.spherical,
    "two hinges": known.door,
    "windows": lambda: known.windows(3),
    "three cranks": known.three_cranks,
}


def library_motion(m: mg.Mechanism) -> dict[str, mg.Motion]:
    """A few positions of the stored motion with all rates, or of another one."""
    (drive,) = m.drives
    positions = [0.0, 0.1] if drive.motion is None else drive.motion.position[:3]
    return {drive.freedom: mg.Motion(positions, 2.0, 3.0)}


def assert_methods_agree(m, given, **how):
    printed, *others = (solved(m, given, method=f, **how) for f in ("printed", "loop_wrench", "newton_euler"))
    for other in others:
        if isinstance(other, Exception) or isinstance(printed, Exception):
            assert type(other) is type(printed)
            assert str(other) == str(printed)
            continue
        worst, where, faults = differences(other, printed)
        worse = conditions(other)[other.status == "ok"].max(initial=1.0)
        assert not faults
        assert worst <= SAME * max(1.0, worse), f"{where}: {worst:.1e} at condition {worse:.1e}"


@pytest.mark.daily(8)
@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
@pytest.mark.parametrize("name", MOVING)
def test_library(name, redundant):
    m = mg.load(name)
    assert_methods_agree(m, library_motion(m), redundant=redundant)


@pytest.mark.daily(4)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
@pytest.mark.parametrize("make", REDUNDANT.values(), ids=REDUNDANT)
def test_redundant_mechanisms(make, redundant, engine):
    m = make()
    (drive, *_) = m.drives
    rng = np.random.default_rng(5)
    loads = [
        mg.Gravity((1.0, 2.0, -9.81)),
        mg.Wrench(m.links[-1].name, rng.normal(size=3), rng.normal(size=3), point=(0.1, 0.2, 0.3)),
    ]
    m = m.replace(loads=loads)
    given = {drive.freedom: mg.Motion([0.0, 0.05], 1.0, 0.5)}
    assert not isinstance(solved(m, given), Exception)
    assert_methods_agree(m, given, redundant=redundant, engine=engine)


@pytest.mark.seeds(16, daily=(6, 7))
def test_random_mechanisms(seed):
    m, given, how = drawn(seed)
    how.pop("method")
    assert_methods_agree(m, given, **how)


def test_the_solution_says_which_method_ran():
    m = mg.load("four-bar")
    s = mg.solve(m, {"A": 0.3}, method="printed")
    assert s.method == "printed"
    assert mg.solve(m, {"A": 0.3}).method == "loop_wrench"
    assert mg.kinematics(m, {"A": 0.3}).method is None


@pytest.mark.daily(15)
@pytest.mark.parametrize("name", MOVING)
def test_kinetostatics_is_solved_by_its_assembled_equations(name):
    m = mg.load(name)
    s = mg.solve(m, library_motion(m))
    f = mg.formulate(m)
    u = f.solve(s.state(1))
    (drive,) = m.drives
    k, j = m.freedom(drive.freedom)
    effort = s[m.pairs[k].name].effort[1, j]
    found = u[[unknown.group == "driver" for unknown in f.unknowns]]
    np.testing.assert_allclose(found, effort, rtol=1e-9, atol=1e-9 * np.nanmax(np.abs(u)))
    # a reaction is open exactly where the solution holds none
    whole = np.array([np.isfinite(s[p.name].reaction[1]).all() for p in m.pairs])
    at = [p.name for p in m.pairs]
    solved_whole = np.ones(len(at), dtype=bool)
    for unknown, value in zip(f.unknowns, u, strict=True):
        if unknown.owner in at and unknown.group != "driver":
            solved_whole[at.index(unknown.owner)] &= np.isfinite(value)
    np.testing.assert_array_equal(solved_whole, whole)


def moves_as_held(s: mg.Solution, m: mg.Mechanism, unknown: mg.equations.terms.Unknown) -> bool:
    """Whether a freedom moves in a response as in kinetostatics, where passive bodies are held: the drive does, others unless one is."""
    return not s.passive_effort or unknown.freedom == m.full_name(m.drives[0].freedom)


@pytest.mark.daily(6)
@pytest.mark.parametrize("bookkeeping", ["lee", "minimal"])
@pytest.mark.parametrize("name", MOVING)
def test_given_the_efforts_of_a_solution_the_response_is_its_motion(name, bookkeeping):
    """The efforts of the drivers, applied as loads: accelerations of all freedoms come back, and the reactions."""
    m = mg.load(name)
    s = mg.solve(m, library_motion(m))
    (drive,) = m.drives
    k, j = m.freedom(drive.freedom)
    pair = m.pairs[k].name
    driven = m.replace(loads=[*m.loads, mg.Effort(drive.freedom, float(s[pair].effort[1, j]))])
    state = mg.solve(driven, library_motion(m)).state(1)
    assert abs(mg.solve(driven, library_motion(m))[pair].effort[1, j]) < 1e-9 * (1 + abs(s[pair].effort[1, j]))
    f = mg.formulate(driven, bookkeeping, unknowns="response")
    u = f.solve(state)
    wanted = np.concatenate([s[p.name].acceleration[1] for p in m.pairs])
    names = m.freedom_names()
    for unknown, value in zip(f.unknowns, u, strict=True):
        if unknown.group == "acceleration" and np.isfinite(value) and moves_as_held(s, m, unknown):
            np.testing.assert_allclose(
                value, wanted[names.index(unknown.freedom)], rtol=1e-7, atol=1e-7 * np.abs(wanted).max()
            )
    first = next(i for i, unknown in enumerate(f.unknowns) if unknown.group == "acceleration")
    assert f.unknowns[first].freedom == m.full_name(drive.freedom)
    massive = any(link.mass for link in m.links)
    assert np.isfinite(u[first]) == massive


def test_lee_counts_the_acceleration_of_the_input_as_number_24():
    m = mg.load("rcsr")
    f = mg.formulate(m, unknowns="response")
    assert (len(f.unknowns), len(f.equations)) == (30, 30)
    assert f.unknowns[23].name == "alpha_1"
    assert f.ledger().by_kind["closure"] == mg.equations.terms.LedgerRow(1, 0, 6)
    assert (len(mg.formulate(m).unknowns), len(mg.formulate(m).equations)) == (24, 24)


def test_a_response_obeys_its_printed_system():
    """Accelerations and reactions of an integrated motion solve the system that is printed for it, at every output."""
    m = mg.load("four-bar").replace(drives=[], loads=[mg.Gravity((0, -9.81, 0))])
    r = mg.respond(m, np.linspace(0.0, 0.4, 5), start={"A": 0.4}, rates={"A": 3.0})
    f = mg.formulate(m, unknowns="response")
    for i in range(5):
        u = f.solve(r.state(i))
        for unknown, value in zip(f.unknowns, u, strict=True):
            if unknown.group == "acceleration":
                k, j = m.freedom(unknown.freedom)
                np.testing.assert_allclose(value, r[m.pairs[k].name].acceleration[i, j], rtol=1e-9, atol=1e-9)


@pytest.mark.seeds(16, without=(0, 1, 2, 4, 10, 12, 13, 18))
def test_closure_and_response_of_random_mechanisms(seed):
    """Rates, accelerations, reactions and efforts of a solution satisfy the systems that are assembled from the printed terms."""
    m, given, how = drawn(seed)
    s = solved(m, given, redundant="minimum_norm")
    if isinstance(s, Exception) or s.status[0] != "ok" or not s.mechanism.drives:
        pytest.skip("no solution")
    m, state = s.mechanism, s.state(0)
    held = max((float(np.abs(effort[0])) for effort in s.passive_effort.values()), default=0.0)
    f = mg.formulate(m, "minimal", [d.freedom for d in m.drives], unknowns="response")
    accelerations = state.accelerations[:, 0]
    for system, values in ((f.closure.velocity, state.velocities[:, 0]), (f.closure.acceleration, accelerations)):
        A, b = system.assemble(state)
        assert np.abs(A @ values - b).max(initial=0.0) <= 1e-10 * (
            1 + np.abs(A).max() * np.abs(values).max() + np.abs(b).max()
        )
    u = []
    for unknown in f.unknowns:
        if unknown.group == "acceleration":
            u.append(accelerations[m.freedom_names().index(unknown.freedom)])
        elif unknown.group == "driver":
            k, j = m.freedom(unknown.freedom)
            u.append(s[m.pairs[k].name].effort[0, j])
        elif unknown.group == "coupling":
            u.append(s.coupling(unknown.owner).effort[0])
    components = [s[p.name].components[name][0] for p in m.pairs for name in p.type.component_names]
    whole = np.array([*components, *u])
    A, b = f.assemble(state)
    size = np.abs(A).max() * np.abs(whole).max() + np.abs(b).max()
    assert np.abs(A @ whole - b).max() <= 1e-10 * size + 10 * held


@pytest.mark.parametrize("kind", [Circle(0.3, 0.2), Ellipse(0.3, 0.2)], ids=["circle", "ellipse"])
def test_closure_with_screws_that_move_in_their_frames(kind):
    row = mg.PairType("K", "guide", freedoms=[kind], reactions=None)
    m = ring_with(row)
    s = mg.solve(m, {"O1": mg.Motion([0.02, 0.03], 2.0, 3.0)})
    f, state = mg.formulate(m), s.state(1)
    for system, values in ((f.closure.velocity, state.velocities), (f.closure.acceleration, state.accelerations)):
        A, b = system.assemble(state)
        np.testing.assert_allclose(A @ values[:, 0], b, atol=1e-11 * (1 + np.abs(values).max()))
    assert "own rate of a screw" in f.text()
    assert f.closure.position[0].text.count("D_") + f.closure.position[0].text.count("D-1_") == 2


def test_a_large_printed_system_goes_through_sparse_factors():
    """A snake of 60 links, a motor in every pair: 480 unknowns, 480 equations."""
    rng, names = np.random.default_rng(3), ["frame", *(f"link{k}" for k in range(60))]
    links = [mg.Link("frame"), *(mg.Link(name, 1.0, rng.normal(size=3)) for name in names[1:])]
    pairs = [
        mg.Pair(f"P{k}", "R", names[k], names[k + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
        for k in range(60)
    ]
    m = mg.Mechanism("snake", links, pairs, drives=[p.name for p in pairs], loads=[mg.Gravity((1.0, 2.0, -9.81))])
    s = mg.solve(m, {p.name: mg.Motion(0.1, 1.0, 0.5) for p in pairs})
    f = mg.formulate(m)
    u = f.solve(s.state())
    assert f.assemble(s.state())[0].shape == (480, 480)
    found = u[[unknown.group == "driver" for unknown in f.unknowns]]
    np.testing.assert_allclose(found, [s[p.name].effort[0] for p in pairs], rtol=1e-8)


def test_contradicting_equations_have_no_solution():
    """Two drivers for one freedom: their efforts are open. No driver: gravity has nothing that carries it."""
    m = mg.load("four-bar").replace(loads=[mg.Gravity((0, -9.81, 0))])
    state = mg.solve(m, {"A": 0.3}).state()
    assert np.isnan(mg.formulate(m, efforts=[]).solve(state)).all()
    both = mg.formulate(m, efforts=["A", "D"])
    u = both.solve(state)
    assert np.isnan(u[[unknown.group == "driver" for unknown in both.unknowns]]).all()
