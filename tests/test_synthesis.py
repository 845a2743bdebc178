"""Synthesis: all mechanisms that do what is asked, their number, and that each one does it."""

import io
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from ladder import LADDER, PUBLISHED, by_markers, dyad, four_bar, geared_five_bar, slider_crank, spatial, turned
from scipy.optimize import brentq

import mechgraph as mg
from mechgraph.modes.start_sets import trace_test
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.solve import TaskPencil, kept
from mechgraph.synthesis.system import RowProblem

QUICK = [name for name in LADDER if name.split(",")[0] in ("R-R dyad", "four-bar function", "spherical R-R")]
LONG = [name for name in LADDER if name not in QUICK]


def ladder_holds(name: str, **options: Any) -> None:
    """The number of solutions over C, and that real ones do what is asked."""
    m, task, unknown, total = LADDER[name]()
    s = mg.synthesize(m, task, unknown, **options)
    kept_set = options.get("cache", True)
    assert (s.total, s.completeness) == (total, "proved" if kept_set and name in PUBLISHED else "tested"), s.evidence
    assert len(s) + len(s.complex) + s.infinite + sum(one.count for one in s.degenerate) == total
    assert (s.residual < 1e-12).all()
    # of tasks that mix and of balls, whose rotations take no drive, the residual speaks alone
    alone = isinstance(task, list) or hasattr(task, "rows") or any(p.type.symbol == "S" for p in m.pairs)
    for one, q in () if alone else zip(s, s.coordinates, strict=True):
        assert does(one, q, task) < 1e-10


def does(m: mg.Mechanism, q: np.ndarray, task: Any) -> float:
    """By how much a mechanism fails to do what is asked at its own coordinates ``(rows, F)``, driven from there."""
    names, worst = m.freedom_names(), 0.0
    for i, row in enumerate(q):
        here = m.replace(start=dict(zip(names, row.tolist(), strict=True)))
        if hasattr(task, "pairs"):
            a, b = (m.full_name(name) for name in (task.input, task.output))
            s = mg.kinematics(here, {a: task.pairs[i][0]})
            # of outputs up to a factor it is that of the second row
            factor = q[1, names.index(b)] / task.pairs[1][1] if task.scale == "free" else 1.0
            worst = max(worst, abs(s[b.split(".")[0]].position.item() - factor * task.pairs[i][1]))
        elif hasattr(task, "places"):
            X = (
                mg.kinematics(here.replace(drives=names), dict(zip(names, row.tolist(), strict=True)))
                .link(task.link)
                .pose
            )
            given = np.asarray(task.places[i])
            asked = given if given.ndim == 2 else _planar(given)
            worst = max(worst, float(np.abs(X - asked).max()))
        else:
            s = mg.kinematics(here, {"A": row[names.index("A.Rz")]})
            link, point = task.point.split(".")
            tip = s.link(link).at(point).position
            worst = max(worst, float(np.abs(tip[..., :2] - task.points[i]).max()))
    return worst


def _planar(place: np.ndarray) -> np.ndarray:
    x, y, angle = place
    out = np.eye(4)
    out[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    out[:2, 3] = x, y
    return out


@pytest.mark.parametrize("name", QUICK)
def test_all_solutions_are_counted_and_real_ones_do_what_is_asked(name: str) -> None:
    ladder_holds(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_all_solutions_of_larger_tasks(name: str) -> None:
    ladder_holds(name)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_number_of_solutions_is_that_of_any_seed(seed: int) -> None:
    ladder_holds("R-R dyad, 5 poses", seed=seed, cache=False)


def test_a_four_bar_is_among_those_that_do_its_own_function() -> None:
    m = four_bar(B=(0.4, 0.9), C=(1.9, 1.6))
    angles = np.linspace(0.0, 1.2, 5)
    pairs = np.column_stack([angles, mg.kinematics(m, {"A": angles})["D"].position])
    s = mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"])
    assert np.abs(s.values - (0.4, 0.9, 1.9, 1.6)).max(axis=1).min() < 1e-9
    assert pickle.loads(pickle.dumps(s)).to_dict() == s.to_dict()


@pytest.mark.parametrize(
    "name",
    [
        "four-bar of two dyads, 5 poses",
        pytest.param("four-bar path, 5 points, both pivots given", marks=pytest.mark.slow),
    ],
)
def test_the_trace_test_of_tasks_passes_with_all_solutions_and_with_none_left_out(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points of which one isotropic component counts have few poles: 42 where general sums have more than 100; one left out has no end."""
    m, tasks, unknown, total = LADDER[name]()
    rng = np.random.default_rng(3)
    of = TaskClass(RowProblem(m, tasks, unknown), rng)
    start = kept(of)
    assert start is not None
    assert start.x.shape[1] == total
    # as many tasks for both
    monkeypatch.setattr("mechgraph.modes.start_sets.MOST_TRACKS", 300 * total)
    trace = trace_test(of, start.member, start.x, rng, None, TaskPencil)
    assert 0 < trace.degree <= 42
    assert trace.beyond < 1e-11
    assert not trace_test(of, start.member, start.x[:, 1:], rng, None, TaskPencil).passed


def test_centre_points_of_four_poses_lie_on_one_cubic() -> None:
    """Burmester's curve: for every value of one coordinate there are at most three, and all lie on one cubic through ten terms."""
    poses = np.array([[0, 0, 0], [1.0, 0.4, 0.3], [1.6, 1.1, 0.9], [1.2, 2.0, 1.7]])
    s = mg.synthesize(
        dyad(), mg.poses("body", poses), ["A.point.y", "B.point"], sweep={"A.point.x": np.linspace(-3, 3, 6)}
    )
    x, y = np.array([v for one in s for v in zip(one.field("A.point.x"), one.field("A.point.y"), strict=True)]).T
    assert {one.total for one in s} == {3}
    with pytest.raises(IndexError, match="9: there are 6 values"):
        s[9]
    assert [one.total for one in pickle.loads(pickle.dumps(s))] == [one.total for one in s]
    assert len(x) > 9
    terms = np.array([x**i * y**j for i in range(4) for j in range(4 - i)]).T
    sigma = np.linalg.svd(terms / np.abs(terms).max(axis=0), compute_uv=False)
    assert sigma[-1] < 1e-5 * sigma[-2]
    drawn = {line.get_label(): line.get_xydata() for line in s.plot().lines}
    assert np.array_equal(drawn["A: center points"], np.column_stack([x, y]))
    assert set(drawn) == {"A: center points", "B: circle points"}


def test_counts_are_said_before_anything_is_solved() -> None:
    pairs = [[0, 0], [0.3, 0.2], [0.6, 0.5]]
    with pytest.raises(mg.DeclarationError, match=r"2 conditions .*for 4 unknowns .*fix 2 of these"):
        mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"])
    with pytest.raises(mg.DeclarationError, match=r"2 conditions .*for 1 unknown .*1 too many"):
        mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point.x"])


def test_faults_of_tasks_and_unknowns_are_told_together() -> None:
    tasks = [mg.path("coupler.top", [[0, 0], [1, 1]]), mg.function("A", "Z", [[0, 0], [1, 1]])]
    with pytest.raises(mg.DeclarationError) as caught:
        mg.synthesize(four_bar(), tasks, ["B.point"])
    assert len(caught.value.faults) == 2
    with pytest.raises(mg.DeclarationError, match="is asked, and is"):
        mg.synthesize(four_bar(), mg.path("coupler.tip", [[0, 0], [1, 1]]), ["B.point"])
    everything = {
        "bounds": {"A.point.x": (0, 1), "B.point.x": (2, 1)},
        "sweep": {"C.point.z": [1]},
        "conditions": {"siz": (0, 1)},
    }
    with pytest.raises(mg.DeclarationError) as caught:
        mg.synthesize(four_bar(), mg.path("coupler.tip", [[0, 0], [1, 1]]), ["B.point"], **everything)
    of = [
        "conditions: 'siz'",
        "bounds['B.point.x']",
        "row 0",
        "row 0",
        "bounds['A.point.x']",
        "unknown 'C.point.z'",
        "sweep",
    ]
    assert [fault for fault, start in zip(caught.value.faults, of, strict=True) if not fault.startswith(start)] == []
    with pytest.raises(
        mg.DeclarationError, match=r"synthesis of 'four-bar': 1 fault\n  minimize: 'siz': .*did you mean size"
    ):
        mg.synthesize(four_bar(), mg.function("A", "D", [[0, 0], [1, 1]]), ["B.point"], minimize="siz")
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("coupler", mass=1, center=(0, 0)), mg.Link("rocker")]
    heavy = four_bar().replace(links=links)
    with pytest.raises(mg.DeclarationError, match=r"coupler.mass': stands in no equation of closure"):
        mg.synthesize(heavy, mg.function("A", "D", [[0, 0], [1, 1]]), ["coupler.mass"])


def test_numbers_that_are_none_of_their_kind_are_told_with_their_place() -> None:
    X, mirrored = turned(3, 1.0), turned(3, 1.0)
    X[1, 0, 3] = np.inf
    mirrored[2, :3, 0] *= -1
    partly = turned(3, 1.0)
    partly[1, 0, 0] = np.nan
    balls = spatial("S-S", ("S", (0, 0, 0), None), ("S", (1, 0.3, 0.1), None))
    rows = [{}, {"coupler": (1, np.inf, 0)}, {"coupler.tip": "no"}, {"A": np.inf}]
    pairs = mg.function("A", "D", [[0, 0], [0.3, 0.2]])
    asked: list[tuple[mg.Mechanism, Any, dict[str, Any], list[str]]] = [
        (four_bar(), mg.path("coupler.tip", [[1.5, 1.2], [np.inf, 1]]), {}, ["inf at row 1, column 0"]),
        (four_bar(), mg.path("coupler.tip", [[1.5, 1.2], [1, 1]], at={"A": [0, -np.inf]}), {}, ["-inf at row 1"]),
        (balls, mg.poses("body", X), {}, ["inf at row 1, entry (0, 3)"]),
        (four_bar(), mg.positions(rows), {}, ["row 1: poses of 'coupler': inf at column 1", "got ['no']", "row 3: at['A']: inf;"]),
        (four_bar(), pairs, {"sweep": {"B.point.y": [1, np.nan]}}, ["one list of finite values each"]),
        (four_bar(), pairs, {"sweep": {"B.point.y": []}}, ["one list of finite values each"]),
        (four_bar(), pairs, {"over": {"A": [0, np.nan]}}, ["over['A'] = [0, nan]: expected finite values, one at least"]),
        (four_bar(), pairs, {"over": {"A": []}}, ["over['A'] = []: expected finite values, one at least"]),
        (four_bar(), pairs, {"conditions": {"transmission D": (40, None)}}, ["transmission angles in radians, 1.5708"]),
        (balls, mg.poses("body", mirrored), {}, ["row 2: expected a proper rotation"]),
        (balls, mg.poses("body", partly), {}, ["row 1: a part of a rotation is NaN"]),
        (four_bar(), mg.function("A", "D", [[0, np.nan], [0.3, 0.2]]), {}, ["D is NaN at row 0, from which the others are counted"]),
        (balls, mg.poses("body", np.zeros((3, 4, 4))), {}, ["row 0, 1, 2: expected a proper rotation"]),
        (four_bar(), pairs, {"bounds": {"B.point.x": (2, 1)}}, ["bounds['B.point.x'] = (2, 1): expected (least, greatest)"]),
        (four_bar(), pairs, {"conditions": {"size": (np.nan, 1)}}, ["conditions['size'] = (nan, 1)"]),
    ]  # fmt: skip
    for m, task, options, told in asked:
        with pytest.raises(mg.DeclarationError) as caught:
            mg.synthesize(m, task, ["P.point" if m is balls else "B.point.x"], **options)
        assert len(caught.value.faults) == len(told)
        for fault, words in zip(caught.value.faults, told, strict=True):
            assert words in fault


def test_what_is_not_served_is_refused_by_name() -> None:
    pairs = [[0, 0], [0.3, 0.2], [0.6, 0.5]]
    with pytest.raises(mg.DeclarationError, match=r"output D.Rz turns; of angles times an unknown factor"):
        mg.synthesize(four_bar(), mg.function("A", "D", pairs, scale="free"), ["C.point"])
    screw = mg.Mechanism(
        "jack",
        pairs=[
            mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=(0, 0, 1), pitch=0.1),
            mg.Pair("B", "P", "frame", "nut", point=(1, 0, 0), axis=(0, 0, 1)),
        ],
    )
    with pytest.raises(mg.DeclarationError, match="pair A: ties an angle to a length"):
        mg.synthesize(screw, mg.positions([{"B": 0}, {"B": 0.1}]), ["A.pitch"])
    # of a planar mechanism neither axes nor places across the plane
    for name, meant in (("B.pont", "B.point"), ("tip", "coupler.tip"), ("coupler.tp", "coupler.tip")):
        with pytest.raises(
            mg.DeclarationError, match=rf"'{name}': no element or number .*did you mean {meant}( or|\?)"
        ) as caught:
            mg.synthesize(four_bar(), mg.function("A", "D", pairs), [name])
        assert ".z" not in str(caught.value)
        assert "axis" not in str(caught.value)
    # declared or not
    for name in ("coupler.mass", "coupler.center.x"):
        with pytest.raises(mg.DeclarationError, match=f"'{name}': stands in no equation of closure"):
            mg.synthesize(four_bar(), mg.function("A", "D", pairs), [name])


def test_numbers_that_change_nothing_together_are_told() -> None:
    """The frame of a crank by markers may stand anywhere; a four-bar without a given length may have any size."""
    with pytest.raises(mg.DeclarationError, match=r"1 way to change B.on_a.point.x, B.on_a.point.y together"):
        mg.synthesize(by_markers("dyad"), mg.poses("body", np.eye(4)[:, :3]), ["B.on_a.point", "B.on_b.point"])
    pairs = np.random.default_rng(0).normal(size=(7, 2))
    unknown = ["A.point.x", "A.point.y", "B.point", "C.point"]
    with pytest.raises(mg.DeclarationError, match="2 ways to change"):
        mg.synthesize(four_bar(), mg.function("A", "D", pairs), unknown)


def test_a_four_bar_by_markers_is_that_of_freudensteins_equation() -> None:
    """With the angles of crank and rocker from the line of the pivots ``K1 cos b - K2 cos a + K3 = cos(a - b)`` is linear in all three."""
    m = by_markers("four-bar", B_a=(1, 0), C_a=(2.5, 0), C_b=(2, 0), D_a=(3, 0)).replace(start={"A": 0.5})
    a = np.array([0.5, 1.0, 1.5])
    b = mg.kinematics(m, {"A": a})["D"].position[:, 0]
    K = np.linalg.solve(np.column_stack([np.cos(b), -np.cos(a), np.ones(3)]), np.cos(a - b))
    crank, rocker = 3 / K[0], 3 / K[1]
    rod = np.sqrt(crank**2 + rocker**2 + 9 - 2 * crank * rocker * K[2])
    declared = by_markers("four-bar", B_a=(1.2, 0), C_a=(2, 0), C_b=(1.5, 0), D_a=(3, 0)).replace(
        start={"A": 0.5, "D": b[0]}
    )
    unknown = ["B.on_a.point.x", "C.on_a.point.x", "C.on_b.point.x"]
    s = mg.synthesize(declared, mg.function("A", "D", np.column_stack([a, b])), unknown)
    assert s.values == pytest.approx(np.array([[crank, -rod, rocker], [crank, rod, rocker]]), abs=1e-9)
    assert s.total == 4
    assert [one.kind for one in s.degenerate] == ["coincident"]
    for one in s:
        assert mg.kinematics(one, {"A": a})["D"].position[:, 0] == pytest.approx(b, abs=1e-9)


def test_a_dyad_by_markers_has_the_pins_of_one_by_points() -> None:
    poses = np.array([[0, 0, 0], [1.0, 0.4, 0.3], [1.6, 1.1, 0.9]])
    plain = mg.synthesize(dyad(), mg.poses("body", poses), ["B.point"])
    s = mg.synthesize(by_markers("dyad"), mg.poses("body", poses), ["B.on_a.point.x", "B.on_b.point"])
    assert s.total == 2 * plain.total
    # the crank may point to the pin or away from it
    assert s.values[:, 1:] == pytest.approx(np.repeat(plain.values, 2, axis=0), abs=1e-9)
    assert np.sort(s.values[:, 0]) == pytest.approx(np.hypot(*plain.values[0]) * np.array([-1, 1]), abs=1e-9)


def test_a_function_up_to_a_factor_is_done_by_larger_and_smaller_mechanisms() -> None:
    """A slider-crank about the pivot times a factor moves its slider by as much more."""
    m, task, unknown, _ = LADDER["slider-crank function, 5 pairs"]()
    given = mg.synthesize(m, task, unknown).values
    free = mg.function("A", "D", task.pairs, scale="free")
    s = mg.synthesize(m, free, ["B.point.y", "C.point"])
    factor = m.pair("B").point[0] / given[:, :1]
    wanted = np.column_stack([given[:, 1:] * factor, factor])
    assert s.unknown == ("B.point.y", "C.point.x", "C.point.y", "D.Tz.scale")
    assert np.sort(s.values, axis=0) == pytest.approx(np.sort(wanted, axis=0), abs=1e-8)


ANGLES = np.array([0.0, 0.4, 0.8, 1.2])
MIXED: dict[str, Any] = {
    "a pose and two points": (
        lambda pose, tip, _: mg.positions([{}, {"coupler": pose[1]}, {"coupler.tip": tip[2]}, {"coupler.tip": tip[3]}]),
        ["B.point", "C.point"], 6,
    ),
    "function and path": (
        lambda _, tip, pairs: [mg.function("A", "D", pairs[:3]), mg.path("coupler.tip", tip[:3])],
        ["B.point", "C.point", "D.point"], 1,
    ),
    "a timed point and a pose": (
        lambda pose, tip, _: [
            mg.path("coupler.tip", [tip[0], tip[1], [np.nan] * 2], at={"A": [0, 0.4, np.nan]}),
            mg.poses("coupler", [[0] * 3, [np.nan] * 3, pose[2]]),
        ],
        ["B.point", "C.point"], 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MIXED)
def test_a_four_bar_is_found_again_from_tasks_that_mix(name: str) -> None:
    task, unknown, total = MIXED[name]
    s = mg.kinematics(four_bar(B=(0.4, 0.9), C=(1.9, 1.6)), {"A": ANGLES})
    X = s.link("coupler").pose
    pose = np.column_stack([X[:, :2, 3], np.arctan2(X[:, 1, 0], X[:, 0, 0])])
    asked = task(pose, s.link("coupler").at("tip").position[:, :2], np.column_stack([ANGLES, s["D"].position]))
    found = mg.synthesize(four_bar(), asked, unknown)
    assert (found.total, found.completeness) == (total, "tested")
    assert np.abs(found.values[:, :4] - (0.4, 0.9, 1.9, 1.6)).max(axis=1).min() < 1e-9


def test_a_geared_five_bar_is_found_again_from_its_path() -> None:
    m, angles = geared_five_bar(B=(0.3, 1.0), D=(2.7, 1.2)), np.array([0, -0.2, -0.45])
    tip = mg.kinematics(m, {"A": angles}).link("rod").at("tip").position[:, :2]
    s = mg.synthesize(geared_five_bar(), mg.path("rod.tip", tip, at={"A": angles}), ["B.point", "D.point"])
    # two cranks that turn by given angles: each is unique for three places
    assert (s.total, s.completeness) == (1, "tested")
    assert s.values == pytest.approx(np.array([[0.3, 1.0, 2.7, 1.2]]), abs=1e-9)


def test_real_mechanisms_are_found_where_a_row_asks_nothing() -> None:
    """The second row leaves the crank free. In the first one the pin of both rods lies on two circles, each way with a turn of the second
    crank: a constant is twice that one, less that of the first crank.
    """
    at = {"A": (-0.039, -0.011), "B": (0.014, 0.898), "C": (1.454, 1.452), "D": (2.843, 1.222), "E": (2.89, -0.063)}
    ends = {"A": "fa", "B": "ab", "C": "bc", "D": "cd", "E": "fd"}
    pairs = [mg.Pair(name, "R", *ends[name], point=at[name]) for name in at]
    gears = mg.Coupling({"A": -1, "E": 2}, name="g", constant=0.2)
    m = mg.Mechanism("geared", pairs=pairs, drives=["A"], planar=True, frame="f", couplings=[gears])
    turn, bend = 0.3716, 0.1835
    # of this seed the track of one of both ends at a complex angle of the free crank
    s = mg.synthesize(m, mg.positions([{"A": turn, "C": bend}, {}]), ["g.constant"], seed=6, cache=False)
    a, b, c, d, e = (complex(*at[name]) for name in at)
    reach, apart = abs(c - b + (d - c) * np.exp(1j * bend)), e - (a + (b - a) * np.exp(1j * turn))
    along = (reach**2 - abs(d - e) ** 2 + abs(apart) ** 2) / (2 * abs(apart))
    pins = e - apart + apart / abs(apart) * (along + np.array([1j, -1j]) * np.sqrt(reach**2 - along**2))
    constants = np.sort((2 * np.angle((pins - e) / (d - e)) - turn) % (4 * np.pi))
    assert np.sort(s.field("g.constant") % (4 * np.pi)) == pytest.approx(constants, abs=1e-9)


def test_real_mechanisms_are_found_where_a_row_is_nearly_out_of_reach() -> None:
    """Of a row the place of the tip to the left alone is asked: it goes no farther than second crank and rod in one line."""
    cranks, pins, turns = [[0, 0], [3, 0]], [[0.3, 1.0], [2.7, 1.2]], np.array([[0, 0], [-0.3, 0.2], [-0.1, 0.4]])
    m = geared_five_bar(*map(tuple, pins)).replace(couplings=[], drives=["A", "E"])
    tips = mg.kinematics(m, dict(zip("AE", turns.T, strict=True))).link("rod").at("tip").position[:, :2]
    rows = [{"A": a, "E": e, "rod.tip": tuple(tip)} for (a, e), tip in zip(turns, tips, strict=True)]
    parts = np.linalg.norm(np.subtract(pins, cranks), axis=1), np.linalg.norm(np.subtract(pins, (1.5, 1.5)), axis=1)
    (left, right), near = np.add(*parts), abs(np.subtract(*parts))
    end = 3 - right
    # there the first crank and its rod come to as well
    assert near[0] < end < left
    for room in (1e-3, -1e-3):
        s = mg.synthesize(m, mg.positions([*rows, {"rod.tip": (end + room, np.nan)}]), ["B.point", "D.point"])
        assert (s.total, len(s), "no real position" in s.evidence[-1]) == (1, int(room > 0), room < 0)


@pytest.mark.parametrize(
    "name", ["R-Sp-R function, 6 pairs", "slider-crank function, 5 pairs", "four-bar path, 5 points, timed"]
)
def test_a_start_set_serves_whatever_the_order_of_pairs_links_and_unknowns(name: str) -> None:
    m, task, unknown, total = LADDER[name]()
    changed = [
        p.replace(a=p.b, b=p.a) if i % 2 and p.type.symbol in ("R", "P") else p for i, p in enumerate(m.pairs[::-1])
    ]
    for pairs in (m.pairs[1:] + m.pairs[:1], changed):
        words = list[str]()
        s = mg.synthesize(m.replace(pairs=pairs), task, unknown[::-1], progress=words.append)
        assert s.total == total
        assert len(words) == 1, "only tracks to the task"


def test_the_first_task_of_a_kind_is_told_before_it_takes_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the progress that is given, else where somebody looks at a terminal."""

    class Enough(Exception):
        """What was to be told has been told."""

    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

        def write(self, text: str) -> int:
            written = super().write(text)
            listen(self.getvalue())
            return written

    def listen(text: str) -> None:
        if "further one" in text:
            raise Enough
        words.append(text)

    asked = dyad(), mg.poses("body", [(0, 0, 0), (1, 0.5, 0.4)], at={"A": [0, 0.3]}), ["B.point"]
    for progress in (listen, None):
        words = list[str]()
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stderr", Screen())
            with pytest.raises(Enough):
                mg.synthesize(*asked, cache=False, progress=progress)
        assert "first task of its kind" in "".join(words)


@pytest.mark.parametrize(
    ("element", "count"), [("O", 4), ("P", 5), ("Q", 4), ("ball", 3), ("direction", 1)], ids=lambda value: str(value)
)
def test_of_an_element_only_what_matters_is_sought(element: str, count: int) -> None:
    """A line is four numbers, a direction in the plane one, a ball three, a plane with a point on it five."""
    balls = spatial("S-S", ("S", (0, 0, 0), None), ("S", (1, 0.3, 0.1), None))
    m, task, name = {
        "ball": (balls, mg.poses("body", turned(2, 1.0)), "P"),
        "direction": (slider_crank(), mg.function("A", "D", [[0, 0], [1, 1], [2, 1]]), "D.axis"),
    }.get(element, (LADDER["R-Sp-R function, 6 pairs"]()[0], mg.function("O", "Q", [[0, 0], [0.3, 0.2]]), element))
    with pytest.raises(mg.DeclarationError, match=f" for {count} unknown"):
        mg.synthesize(m, task, [name])


def test_what_no_mechanism_can_do_is_refused_before_anything_is_solved() -> None:
    """Axes that meet lead a body about their point; cranks of a planar dyad turn the body by the sum of their angles."""
    X = np.tile(np.eye(4), (5, 1, 1))
    X[1:, 0, 3] = 0.1, 0.2, 0.3, 0.4
    spherical = LADDER["spherical R-R, 5 orientations"]()[0]
    for m, task, unknown in (
        (spherical, mg.poses("body", X), ["O.axis", "P.axis"]),
        (
            dyad(),
            mg.poses("body", [[0, 0, 0], [1, 0.5, 0.4]], at={"A": [0, 0.3], "B": [0, 0.3]}),
            ["A.point", "B.point"],
        ),
    ):
        with pytest.raises(mg.DeclarationError, match=r"more is asked than such mechanisms can do.*row 1 is missed by"):
            mg.synthesize(m, task, unknown, progress=pytest.fail)


@pytest.mark.slow
def test_the_center_of_a_spherical_mechanism_may_be_anywhere() -> None:
    """The same orientations about another point have the same axes."""
    m, task, unknown, total = LADDER["spherical R-R, 5 orientations"]()
    center, X = np.array([0.7, -0.4, 1.1]), np.array(task.places)
    X[:, :3, 3] = center - X[:, :3, :3] @ center
    moved = m.replace(pairs=[pair.replace(point=center) for pair in m.pairs])
    plain, off = (mg.synthesize(one, mg.poses("body", poses), unknown) for one, poses in ((m, task.places), (moved, X)))
    assert (off.total, len(off)) == (total, len(plain))
    # of an axis the numbers that are sought depend on where it is
    directions = [np.array([[p.axis for p in one.pairs] for one in s]) for s in (off, plain)]
    a, b = (axes / np.linalg.norm(axes, axis=-1, keepdims=True) for axes in directions)
    assert abs((a * b).sum(axis=-1)) == pytest.approx(1.0, abs=1e-12)
    assert (off.residual < 1e-12).all()


def test_tracks_may_be_followed_by_others() -> None:
    m, task, unknown, _ = LADDER["R-R dyad, 5 poses"]()
    here = mg.synthesize(m, task, unknown)
    with ThreadPoolExecutor(1) as executor:
        assert np.allclose(mg.synthesize(m, task, unknown, executor=executor).values, here.values, atol=1e-9)
    with pytest.raises(mg.DeclarationError, match="executor"):
        mg.synthesize(m, task, unknown, executor="two")  # type: ignore[arg-type]


def test_what_is_found_is_told_by_tables_of_whole_words_and_by_how_many_there_are() -> None:
    m, task, unknown, _ = LADDER["four-bar path, 5 points, timed"]()
    s = mg.synthesize(m, task, unknown)
    assert all(name in str(s) for name in ("D.point.y", "transmission [deg]"))
    rows = str(s.fitness).splitlines()
    assert all(word in rows[3] for word in ("branch", "circuit", "order", "full", "size", "ratio"))
    assert rows[4].split()[:4] == ["defect", "defect", "defect", "turn"]
    assert [row.split()[0] for row in rows[7:]] == ["0", "1"]
    assert rows[7].split()[1] == ("yes" if s.fitness[0].branch else "no")
    assert "proved" in str(s.certificates)
    for of in (s, s.fitness):
        with pytest.raises(IndexError, match="9: there are 2 mechanisms"):
            of[9]


def test_where_no_solution_is_real_none_is_returned_and_all_are_counted() -> None:
    pairs = np.deg2rad([[0, 0], [15, 11], [30, 23], [45, 38], [60, 56]])
    s = mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"])
    # over the four links
    assert (len(s), s.total, s.poses.shape) == (0, 3, (0, 5, 4, 4, 4))
    assert len(s.complex) + s.infinite + sum(one.count for one in s.degenerate) == 3
    assert "0 mechanisms; such tasks have 3 solutions" in str(s)


DEGENERATE = {
    "parallel poses": ([[0, 0, 0], [1, 0, 0], [2, 1, 0], [1, 2, 0]], ["A.point.y", "B.point"], None),
    "rows alike": ([[0, 0, 0], [1, 0.5, 0.4], [1, 0.5, 0.4]], ["B.point"], "Rows 1 and 2 ask the same."),
    "a row like the first": ([[0, 0, 0], [0, 0, 0], [1, 0.5, 0.4]], ["B.point"], "Rows 0 and 1 ask the same."),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_tracks_of_degenerate_tasks_end_at_infinity_or_among_solutions_without_end(name: str) -> None:
    """Translations that lie on no circle have no crank; for two poses the pin of a crank may lie on a line."""
    poses, unknown, told = DEGENERATE[name]
    with pytest.warns(mg.MechgraphWarning) as caught:
        s = mg.synthesize(dyad(), mg.poses("body", poses), unknown)
    # seen before anything is solved
    rank, u = (1, 2) if told else (2, 3)
    words = [told] * bool(told) + [f"Here {rank} of {u} conditions are independent"]
    assert [word in str(one.message) for one, word in zip(caught, words, strict=True)] == [True] * len(words)
    assert (len(s), len(s.complex)) == (0, 0)
    if told is None:
        assert (s.infinite, s.degenerate) == (s.total, ())
    else:
        assert [(one.kind, one.count) for one in s.degenerate] == [("continuum", s.total)]
        assert told in s.evidence


def test_known_numbers_that_lead_out_of_the_kind_of_the_declared_mechanism_leave_conditions_open() -> None:
    """Only axes that meet in the center of its turns lead a body so: none of the others does, over the complex numbers either."""
    m, task, unknown, total = LADDER["spherical R-R, 5 orientations"]()
    met, beside = mg.synthesize(m, task, unknown, sweep={"P.point.x": [0, 0.3]})
    assert (len(met) + len(met.complex), met.degenerate) == (total, ())
    assert (len(beside), len(beside.complex)) == (0, 0)
    assert [(one.kind, one.count) for one in beside.degenerate] == [("open", total)]


def test_two_solutions_that_meet_are_told_as_double() -> None:
    """Where two of the three center points of four poses on a line meet, the discriminant of their cubic is zero."""
    poses = np.array([[0, 0, 0], [1.0, 0.4, 0.3], [1.6, 1.1, 0.9], [1.2, 2.0, 1.7]])

    def cubic(x: float) -> Any:
        def determinant(y: float) -> float:
            A, turn = x + 1j * y, np.exp(-1j * poses[1:, 2])
            d = poses[1:, :2] @ [1, 1j] - A
            w = turn * d + A
            return float(np.linalg.det(np.column_stack([2 * w.real, 2 * w.imag, abs(d) ** 2 - abs(A) ** 2])))

        at = np.array([-2.0, -1.0, 1.0, 2.0])
        return np.polyfit(at, [determinant(y) for y in at], 3)

    def discriminant(x: float) -> float:
        a, b, c, d = cubic(x)
        return float(18 * a * b * c * d - 4 * b**3 * d + b**2 * c**2 - 4 * a * c**3 - 27 * a**2 * d**2)

    x = brentq(discriminant, 1.1, 1.2, xtol=1e-15)
    single = max(np.roots(cubic(x)).tolist(), key=lambda y: abs(y - 1.16))
    m = dyad()
    m = m.replace(pairs=[m.pair("A").replace(point=(x, 0)), m.pair("B")])
    s = mg.synthesize(m, mg.poses("body", poses), ["A.point.y", "B.point"])
    assert [(one.kind, one.count) for one in s.degenerate] == [("double", 2)]
    assert s.field("A.point.y") == pytest.approx([single], abs=1e-9)


def test_masses_and_loads_stay_with_a_warning() -> None:
    m = dyad().replace(links=[mg.Link("frame"), mg.Link("crank", mass=2, center=(0.5, 0)), mg.Link("body")])
    with pytest.warns(mg.MechgraphWarning, match="masses and mass centers of crank stay as declared"):
        (one,) = mg.synthesize(m, mg.poses("body", [[0, 0, 0], [1, 0.5, 0.4], [2, 0.4, 1.1]]), ["B.point"])
    assert one.link("crank") == m.link("crank")


def test_a_link_that_begins_elsewhere_than_at_the_identity_comes_back_by_markers() -> None:
    """The same dyad: a body whose frame stands elsewhere on it is led through the same places."""
    poses = np.array([[0, 0, 0], [1.0, 0.4, 0.3], [1.6, 1.1, 0.9]])
    own = _planar(np.array([0.7, -0.4, 1.1]))
    m = dyad().replace(links=[mg.Link("frame"), mg.Link("crank"), mg.Link("body", points={"tip": (0.5, 0.2)})])
    plain, moved = (
        mg.synthesize(m, mg.poses("body", X), ["B.point"])
        for X in (poses, np.array([_planar(row) @ own for row in poses]))
    )
    assert np.abs(plain.values - moved.values).max() < 1e-9
    (one,) = moved
    assert one.pair("B").on_b is not None
    assert one.link("body").points == m.link("body").points
    row = dict(zip(one.freedom_names(), moved.coordinates[0, 2].tolist(), strict=True))
    body = mg.kinematics(one.replace(drives=one.freedom_names()), row).link("body")
    assert np.abs(body.pose - _planar(poses[2]) @ own).max() < 1e-9
    assert np.abs(moved.poses[0, 2, 2] - _planar(poses[2]) @ own).max() < 1e-9
    with pytest.raises(mg.DeclarationError, match="a fit begins there"):
        mg.synthesize(m, mg.poses("body", np.array([_planar(row) @ own for row in poses])), ["B.point"], fit="minimax")


def test_a_real_solution_of_large_dimensions_is_none_of_the_complex_ones() -> None:
    """Five points with both pivots given: one of the 20 real four-bars is 3,000 cranks large, and complex ones come in pairs."""
    points = [
        [1.2000000000000002, 2.2],
        [1.112112336786848, 2.209806789949453],
        [0.9391142433734428, 2.196125776555743],
        [0.5197399603005753, 2.0188589321640817],
        [0.2814256501065775, 1.8185930318084498],
    ]
    links = ("frame", "crank", "coupler", "rocker", "frame")
    at = {"A": (0, 0), "B": (0, 1), "C": (3, 2), "D": (3, 0)}
    pins = [mg.Pair(k, "R", *links[i : i + 2], point=p) for i, (k, p) in enumerate(at.items())]
    parts = [mg.Link(name, points={"tip": points[0]} if name == "coupler" else {}) for name in links[:4]]
    m = mg.Mechanism("four-bar", parts, pins, drives=["A"], planar=True)
    s = mg.synthesize(m, mg.path("coupler.tip", points), ["B.point", "C.point"])
    assert (len(s), len(s.complex), s.completeness) == (20, 16, "proved")
    # by Newton in 50 digits
    large = s.values[np.abs(s.values).max(axis=1).argmax()]
    np.testing.assert_allclose(
        large, [-3023.87347842258, 1669.70465986535, 4.39956101537635, 0.237225493006354], rtol=2e-6
    )


@pytest.mark.slow
def test_the_straight_line_of_morgan_and_wampler_has_33_four_bars_of_which_15_are_real() -> None:
    """Problem 7 of J. Mech. Des. 112, 1990, as the manual of PHCpack solves it ("the design of a 4-bar mechanism")."""
    points = [[0.50, 1.06], [-0.83, -0.27], [-0.34, 0.22], [-0.13, 0.43], [0.22, 0.78]]
    m = four_bar(A=(0, 0), D=(1, 0), tip=(0.50, 1.06))
    s = mg.synthesize(m, mg.path("coupler.tip", points), ["B.point", "C.point"])
    assert (len(s), len(s.complex), s.infinite, s.total) == (15, 18, 3, 36)
    assert (s.residual < 1e-12).all()


@pytest.mark.slow
def test_the_four_bars_of_wampler_through_five_points_are_those_printed() -> None:
    """Wampler, Isotropic coordinates, circularity and Bezout numbers, ASME DETC 1996, with all solutions by PHCpack (fbrfive12): points
    from each pivot, and both pins of the coupler from its point, as complex numbers.
    """
    from_A = [
        -0.804578095092 + 0.455949484254j, -0.341202796998 + 0.40458818397j, -0.717258427816 + 0.0375980833196j,
        -0.719882934354 - 0.0724833258428j, -0.858127587882 + 0.449623745342j,
    ]  # fmt: skip
    from_D = -0.173708513787 + 0.481007429713j
    printed = [
        (0.537811114799385 - 1.06123913869852j, -0.0805270444664818 - 0.354549318016547j),
        (0.0532080766199881 - 0.590752167855135j, 1.77071366419852 + 0.744464235315417j),
        (-0.291350510980996 - 0.629899792895949j, 0.6226202826918 - 0.158754316407521j),
        (-0.055895892925174 - 0.612044754158336j, 0.565894334350677 - 0.169263337603636j),
        (0.581836051092208 - 2.07715961140398j, -0.18457885571409 - 0.413983005870054j),
        (1.20647775640219 + 0.0936345200908908j, 0.324771126859958 - 0.214184209895579j),
        (1.13337718332122 + 0.0538858402503799j, 0.199684727516523 - 0.233955256169607j),
        (0.465117817920137 - 0.469040702576342j, -0.129838210760656 - 0.347552123056515j),
        (1.72266423393785 + 0.381388671167225j, 0.418469706943876 - 0.198044030061399j),
        (0.530483425771761 - 0.109904193402917j, 0.191379614513801 - 0.251854814844587j),
    ]
    points, D = np.column_stack([np.real(from_A), np.imag(from_A)]), from_A[0] - from_D
    m = four_bar(A=(0, 0), D=(D.real, D.imag), tip=tuple(points[0]))
    s = mg.synthesize(m, mg.path("coupler.tip", points), ["B.point", "C.point"])
    assert (len(s), len(s.complex), s.infinite, s.total) == (10, 26, 0, 36)
    found = s.values.reshape(10, 2, 2) @ [1, 1j] - from_A[0]
    for pins in printed:
        assert np.abs(found - pins).max(axis=1).min() < 1e-9


@pytest.mark.slow
def test_four_bars_through_nine_points_are_1442_times_six_over_the_complex_numbers() -> None:
    """The points of a four-bar of our own: one of those found leads its point along the same curve; all pass through the nine points."""
    own = four_bar(B=(0.2, 0.8), C=(2.1, 1.7), D=(2.3, 0.1))
    motion = mg.Motion(np.linspace(0.0, 2.4, 9), np.ones(9), np.zeros(9))
    tip = mg.kinematics(own, {"A": motion}).link("coupler").at("tip")
    points = tip.position[:, :2] @ [1, 1j]
    task = mg.path("coupler.tip", tip.position[:, :2])
    s = mg.synthesize(four_bar(), task, ["A.point", "B.point", "C.point", "D.point"])
    assert (s.total, s.classes) == (8652, 1442)
    assert not [text for text in s.evidence if "not found" in text]
    between = mg.kinematics(own, {"A": np.linspace(0.0, 2.4, 40)}).link("coupler").at("tip").position[:, :2] @ [1, 1j]
    off = []
    for values, X in zip(s.values, s.poses[:, :, 2], strict=True):
        A, B, C, D = values.reshape(4, 2) @ [1, 1j]
        turn, place = X[:, 0, 0] + 1j * X[:, 1, 0], X[:, 0, 3] + 1j * X[:, 1, 3]
        assert np.abs(place + turn * points[0] - points).max() < 1e-9
        for pin, pivot in ((B, A), (C, D)):
            assert np.ptp(np.abs(place + turn * pin - pivot)) < 1e-8 * np.abs(values).max()
        # turns of the coupler by which its point is on the curve of the other one, and the crank as long as it is; then so is the rocker
        b, c, out = B - points[0], C - points[0], between - A
        angle = np.arccos((abs(B - A) ** 2 - abs(out) ** 2 - abs(b) ** 2 + 0j) / (2 * abs(out) * abs(b)))
        turns = np.exp(1j * (np.array([angle, -angle]) - np.angle(out.conj() * b)))
        off.append((np.abs(np.abs(between + turns * c - D) - abs(C - D)).min(axis=0) / np.abs(values).max()).max())
    same = np.flatnonzero(np.array(off) < 1e-9)
    assert len(same) == 6
    assert s.copies[same[0]] == tuple(same)
    assert s.symmetries[-1].name == "cognate"
    assert s.symmetries[-1].order == 3


def test_certificates_hold_the_mechanisms() -> None:
    """Dyads by own Newton steps in long doubles lie within ``error``; of spherical ones unit axes are as far apart as is proved."""
    m, task, unknown, _ = LADDER["R-R dyad, 5 poses"]()
    s = mg.synthesize(m, task, unknown)
    assert s.kinds == ("regular",) * len(s)
    places = np.asarray(task.places, dtype=np.longdouble)
    c, d = np.cos(places[1:, 2]), np.sin(places[1:, 2])
    R, p = np.array([[c, -d], [d, c]]).transpose(2, 0, 1), places[1:, :2]
    exact = s.values.astype(np.longdouble)
    for _ in range(4):
        for z in exact:
            ends, begin = R @ z[2:] + p - z[:2], z[2:] - z[:2]
            open_ = (ends * ends).sum(axis=1) - begin @ begin
            J = np.concatenate([2 * (begin - ends), 2 * (np.einsum("kij,ki->kj", R, ends) - begin)], axis=1)
            z -= np.linalg.solve(J.astype(float), open_.astype(float))
    proofs = list(s.certificates)
    assert all(one.proved and one.dependent == 0 and one.rows == 12 for one in proofs)
    unit = np.abs(exact[0] - exact[1]).max() / proofs[0].apart
    off = np.abs(s.values - exact).max(axis=1) / unit
    assert all(gap <= one.error < one.radius for gap, one in zip(off, proofs, strict=True))
    m, task, unknown, _ = LADDER["spherical R-R, 5 orientations"]()
    s = mg.synthesize(m, task, unknown)
    axes = np.array([[one.pair(k).axis for k in {name[0] for name in unknown}] for one in s])
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    for i, one in enumerate(s.certificates):
        gaps = np.abs(np.delete(axes, i, axis=0) - axes[i]).max(axis=(1, 2))
        assert one.proved
        assert one.apart == pytest.approx(gaps.min(), abs=1e-9)
    assert s.taken([1]).to_dict()["certificates"][0]["apart"] == s.certificates[1].apart
    rated = LADDER["R-R dyad, 2 poses and a velocity"]()[:3]
    assert list(mg.synthesize(*rated).certificates) == [None]


def test_what_is_found_can_be_sought_again_and_slips_are_told() -> None:
    """Answers have a ``start`` at all pairs, those of rods too; equal bounds and names that are none are refused in words."""
    m, task, unknown, _ = LADDER["four-bar function, 5 pairs"]()
    s = mg.synthesize(m, task, unknown)
    np.testing.assert_allclose(mg.synthesize(s[-1], task, unknown).values, s.values, atol=1e-9)
    with pytest.raises(mg.DeclarationError, match=r"bounds\['B.point.x'\]: both ends are 1") as told:
        mg.synthesize(m, task, unknown, fit="minimax", bounds={"B.point.x": (1, 1)}, over={"Q": [1.0]})
    assert "over: unknown freedom 'Q'" in str(told.value)
    with pytest.warns(mg.MechgraphWarning, match=r"read as radians, .* np.deg2rad"), pytest.raises(mg.DeclarationError):
        mg.synthesize(m, mg.function("A", "D", np.rad2deg(task.pairs)), unknown[:1])


def test_other_positions_of_a_given_dyad_are_no_solutions() -> None:
    """The crank of a four-bar for three poses of its own coupler: its pivot alone is as far from the pin in all of them; the rocker, given,
    stands on its other side in no solution.
    """
    m = four_bar()
    P = mg.kinematics(m, {"A": np.array([0.0, 0.6, 1.2])}).link("coupler").pose
    q = np.stack([P[:, 0, 3], P[:, 1, 3], np.arctan2(P[:, 1, 0], P[:, 0, 0])], axis=1)
    s = mg.synthesize(m, mg.poses("coupler", q), ["A.point"], cache=False)
    assert (s.total, s.classes, len(s), len(s.complex), s.degenerate) == (1, 1, 1, 0, ())
    np.testing.assert_allclose(s.values[0], m.pair("A").point[:2], atol=1e-9)
    assert "3 more fail some of what is asked" in " ".join(s.evidence)
