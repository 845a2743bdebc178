"""Mechanisms of integer and degenerate geometry: both engines say the same, and a position alone what it says in company."""

import numpy as np
import pytest
from attack import conditions, differences, integer_mechanism, solved, without_numbers

import mechgraph as mg

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Weights move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

VALUES = np.array([0.0, 0.05, -0.1])
SAME = 1e-9
"""Difference over the condition, see ``test_engines``."""


def facts(report: mg.DeterminacyReport) -> dict[str, object]:
    return {
        "determinate": report.determinate,
        "mobility": report.mobility,
        "finite": report.finite_mobility,
        "redundancy": report.redundancy,
        "passive": {p.name for p in report.passive},
        "here only": set(report.passive_here_only),
        "undriven": len(report.undriven),
        "unique": report.unique,
    }


def assert_same(one: mg.Solution | Exception, other: mg.Solution | Exception, pick: np.ndarray | None = None) -> None:
    if isinstance(one, Exception) or isinstance(other, Exception):
        assert (type(one), without_numbers(one)) == (type(other), without_numbers(other))
        return
    worst, where, faults = differences(one, other, pick=pick)
    assert not faults
    assert worst <= SAME * conditions(one)[one.status == "ok"].max(initial=1.0), where


@pytest.mark.seeds(5, without=(2, 4))
def test_engines_and_company(seed: int) -> None:
    m = integer_mechanism(seed)
    assert facts(mg.check(m, engine="dense")) == facts(mg.check(m, engine="sparse"))
    given = {d.freedom: VALUES if i == 0 else 0.6 * VALUES for i, d in enumerate(m.drives)}
    dense, sparse = (solved(m, given, engine=engine) for engine in ("dense", "sparse"))
    assert_same(dense, sparse)
    # of several drivers the way leads from position to position; without one there is one position
    for i in range({0: 0, 1: len(VALUES)}.get(len(m.drives), 1)):
        one = solved(m, {name: values[i : i + 1] for name, values in given.items()}, engine="dense")
        assert_same(dense, one, pick=np.array([i]))


# --- what thousands of them found, one by one -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [339, 421])
def test_a_rank_below_that_of_the_graph(seed: int) -> None:
    """Borders that a matching places, where the rank is lower, or that miss what is free."""
    test_engines_and_company(seed)


@pytest.mark.parametrize("seed", [10031, 10647])
def test_a_freedom_left_free_is_held_along_itself(seed: int) -> None:
    """Passive freedoms held by random rows: rates without bound 0.17 from the start; and spins taken out that came back."""
    m = integer_mechanism(seed)
    given = {d.freedom: [-0.1 if i == 0 else -0.06] for i, d in enumerate(m.drives)}
    assert mg.kinematics(m, given, engine="sparse").status.tolist() == ["ok"]


def test_what_is_nearly_unique_is_so_with_either_engine() -> None:
    """A self-stress has 4e-7 of itself in some components: more than the limit, less than as random mixes of it were measured."""
    m = integer_mechanism(5000716)
    given = {d.freedom: [0.05] if i == 0 else [0.03] for i, d in enumerate(m.drives)}
    assert_same(*(solved(m, given, engine=engine) for engine in ("dense", "sparse")))


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_what_a_shaky_start_lets_pass_says_nothing_of_passive_motions(engine: str) -> None:
    """No way leads on from there: the nodes within rounding, where a spin strays, are no reason to ask for another driver."""
    s = mg.kinematics(integer_mechanism(6000630), {"J1.Rx": [0.0, 0.05]}, engine=engine, on_reach="flag")
    assert s.status.tolist() == ["ok", "out of reach"]


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_way_along_which_loops_open_is_no_way(engine: str) -> None:
    """Mobility 2 here and 1 finite: with both driven the loops open with the cube of the way, though their independent rows close."""
    m = integer_mechanism(10199)
    s = mg.kinematics(m, {"J4.Ry": [0.0, 0.01, 0.05], "J4.Rx": [0.0, 0.006, 0.03]}, engine=engine, on_reach="flag")
    assert s.status.tolist() == ["ok", "out of reach", "out of reach"]


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_what_holds_a_turn_is_taken_about_its_own_axis(engine: str) -> None:
    """Four bodies turn about (3, 1, 0), and slide, as the slides of all links and of the two others differ: no mix of both is held."""
    m = integer_mechanism(11396)
    bodies = ["b3", "b4", "b5", "b6"]
    couple = sum(9.81 * k.mass * (k.center[0] - 3.0) for k in m.links if k.name in bodies)
    s = mg.solve(m, dict.fromkeys((d.freedom for d in m.drives), 0.0), engine=engine)
    assert abs(s.passive_effort[" and ".join(bodies)]) == pytest.approx(abs(couple), rel=1e-10)


def test_branches_of_several_dimensions_are_all_looked_at() -> None:
    """Mobility 3 in a position where branches of one and of two dimensions meet; one random step in fifteen ends on the larger one."""
    m = integer_mechanism(223)
    assert [mg.check(m, engine=engine).finite_mobility for engine in ("dense", "sparse")] == [2, 2]


def test_pivots_alone_prove_no_rank() -> None:
    """A singular value of 5e-8 under pivots of 0.001: at a position reached by a motion it is that of a rank below."""
    m = integer_mechanism(5002643)
    assert [mg.check(m, engine=engine).finite_mobility for engine in ("dense", "sparse")] == [1, 1]


@pytest.mark.parametrize(("seed", "finite"), [(88000013, 2), (91000155, 1), (91000161, 1), (92000129, 2)])
def test_one_trial_step_proves_no_motion(seed: int, finite: int) -> None:
    """Mobility one more wherever it gets: a random direction, at a position reached and at the start, had too little of that to open
    loops. In the third they open by 2e-6 of the fourth power of the way, of which a short step sees nothing, and a long one 1e-11; in
    the last closing stalled on the way to every other position, so that nothing seemed to move.
    """
    m = integer_mechanism(seed)
    assert [mg.check(m, engine=engine).finite_mobility for engine in ("dense", "sparse")] == [finite, finite]


def test_a_trial_step_does_not_cross_to_another_branch() -> None:
    """Two branches of mobility 1 meet; a position 0.004 beside it, where the rank is a matter of rounding, had both within a step."""
    m = integer_mechanism(5000087)
    assert [mg.check(m, engine=engine).finite_mobility for engine in ("dense", "sparse")] == [1, 1]


def test_what_leads_nowhere_is_told_by_its_branches() -> None:
    """13 pairs: a passive motion that another one, free at the start alone, is tied to; the number of both changed along the path."""
    X, Y, Z = np.eye(3)
    drawn = [
        ("R", "g", "L1", (1, 0, 1), Z), ("S", "L1", "L2", (0, 1, 0), None), ("C", "L2", "L3", (1, 2, 0), Y),
        ("P", "L3", "g", (2, 2, 1), Z), ("P", "L3", "L4", (0, 0, 0), X), ("P", "L4", "L5", (0, 0, 0), Y),
        ("P", "L5", "L6", (0, 0, 0), X), ("P", "L6", "L2", (0, 0, 0), Z), ("R", "L4", "L7", (1, 2, 1), Y),
        ("R", "L7", "L8", (0, 1, 0), X), ("P", "L8", "L9", (0, 0, 0), Z), ("U", "L9", "L10", (0, 0, 0), X),
        ("C", "L10", "L5", (2, 2, 0), Z),
    ]  # fmt: skip
    pairs = [
        mg.Pair(
            f"J{k}", t, a, b, point=at, **({"axis": z} if z is not None else {}), **({"second": Y} if t == "U" else {})
        )
        for k, (t, a, b, at, z) in enumerate(drawn, 1)
    ]
    m = mg.Mechanism("integer", None, pairs, ["J10"])
    for engine in ("dense", "sparse"):
        with pytest.raises(mg.DeadPointError, match=r"2 branches meet there.*J10\.Rz at rest"):
            mg.solve(m, {"J10": [0.0, 0.05]}, engine=engine)


def test_a_search_of_check_ends_at_its_limit() -> None:
    """A ring of 60 turns and slides, each a little off an integer place: hundreds of relations are nearly met."""
    rng = np.random.default_rng(0)
    pairs = [
        mg.Pair(
            f"J{k}", str(rng.choice(["R", "P"])), f"L{k}", f"L{(k + 1) % 60}",
            point=rng.integers(0, 4, 3) + 1e-5 * rng.normal(size=3), axis=np.eye(3)[rng.integers(3)] + 1e-5 * rng.normal(size=3),
        )
        for k in range(60)
    ]  # fmt: skip
    report = mg.check(mg.Mechanism("ring", None, pairs, ["J0"]), limit=1e-6)
    assert report.rounding is None
    assert report.rounding_not_sought
    assert "looked for during 1e-06 s and not found out; pass limit=" in " ".join(str(report).split())
    with pytest.raises(mg.DeclarationError, match="limit = 0: expected a number above 0"):
        mg.check(mg.load("four-bar"), limit=0)
    assert not mg.check(mg.load("four-bar")).rounding_not_sought
