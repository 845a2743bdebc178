"""Prescribed motion of points and links: whole, by coordinates, along a line, with rates; where the efforts stand; by hand and by power."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import motions, solvable

import mechgraph as mg

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WAYS = [(engine, method) for engine in ("dense", "sparse") for method in ("loop_wrench", "newton_euler", "printed")]


def boom(**changes: object) -> mg.Mechanism:
    """An arm of 5 m from the origin along x, a bucket hanging at its end; a cylinder below the arm, one from the arm to the bucket."""
    fields = {
        "links": [mg.Link("frame"), mg.Link("arm", 200, (2.5, 0, 0)), mg.Link("bucket", 100, (5.5, -1, 0), points={"tip": (6, -2, 0)}),
                  mg.Link("tube"), mg.Link("rod"), mg.Link("tube 2"), mg.Link("rod 2")],
        "pairs": [
            mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "arm", "bucket", point=(5, 0, 0), axis=Z),
            mg.Pair("C", "R", "frame", "tube", point=(1, -1, 0), axis=Z),
            mg.Pair("lift", "P", "tube", "rod", point=(1, -1, 0), axis=(1, 1, 0)),
            mg.Pair("D", "R", "rod", "arm", point=(2, 0, 0), axis=Z), mg.Pair("E", "R", "arm", "tube 2", point=(3, 1, 0), axis=Z),
            mg.Pair("curl", "P", "tube 2", "rod 2", point=(3, 1, 0), axis=(2.8, -0.2, 0)),
            mg.Pair("F", "R", "rod 2", "bucket", point=(5.8, 0.8, 0), axis=Z),
        ],
        "drives": ["lift", "curl"],
        "loads": [mg.Gravity((0, -10, 0))],
    }  # fmt: skip
    return mg.Mechanism("boom", **{**fields, **changes})  # type: ignore[arg-type]


T = np.linspace(0, 1, 5)
TIP = np.stack([6 - 0.3 * T, -2 + 0.8 * T**2, 0 * T], axis=-1)


@pytest.mark.daily(3)
@pytest.mark.parametrize(("engine", "method"), WAYS)
def test_a_tip_is_moved_and_cylinders_hold_it(engine: str, method: str) -> None:
    """At rest: angles from the cosine law, cylinder forces from moments about A and B; all by hand."""
    s = mg.solve(boom(), {"bucket.tip": TIP}, actuate=["lift", "curl"], engine=engine, method=method)
    np.testing.assert_allclose(s.link("bucket").at("tip").position, TIP, atol=1e-12)

    def turned(v: tuple[float, float], q: float) -> np.ndarray:
        return np.array([np.cos(q) * v[0] - np.sin(q) * v[1], np.sin(q) * v[0] + np.cos(q) * v[1]])

    def moment(p: np.ndarray, f: np.ndarray) -> float:
        return float(p[0] * f[1] - p[1] * f[0])

    for i, (x, y, _) in enumerate(TIP):
        r = np.hypot(x, y)
        a = np.arctan2(y, x) + np.arccos((25 + r * r - 5) / (10 * r))
        elbow = turned((5, 0), a)
        b = np.arctan2(y - elbow[1], x - elbow[0]) - np.arctan2(-2, 1)
        np.testing.assert_allclose([s["A"].position[i, 0], s["B"].position[i, 0]], [a, b - a], atol=1e-10)
        pin, eye = elbow + turned((0.8, 0.8), b), turned((3, 1), a)
        push = (pin - eye) / np.linalg.norm(pin - eye)
        centre = elbow + turned((0.5, -1), b)
        curl = 1000 * (centre - elbow)[0] / moment(pin - elbow, push)
        foot, top = np.array([1, -1]), turned((2, 0), a)
        up = (top - foot) / np.linalg.norm(top - foot)
        lift = (1000 * centre[0] + 2000 * turned((2.5, 0), a)[0]) / moment(top, up)
        np.testing.assert_allclose(s["curl"].effort[i, 0], curl, rtol=1e-9)
        np.testing.assert_allclose(s["lift"].effort[i, 0], lift, rtol=1e-9)


@cache
def bent() -> mg.Mechanism:
    """The boom with both cylinders out."""
    return mg.assemble(boom(), {"lift": 0.1, "curl": 0.2})


def tip_path() -> tuple[np.ndarray, np.ndarray]:
    """Times, and points that start where the bent boom has its tip."""
    at = (
        mg.kinematics(bent(), {k: bent().start[bent().full_name(k)] for k in ("lift", "curl")}).link("bucket").at("tip")
    )
    t = np.linspace(0, 2, 7)
    return t, at.position + np.stack([0.1 * np.sin(t), 0.2 * t, 0 * t], axis=-1)


@pytest.mark.daily(3)
@pytest.mark.parametrize(("engine", "method"), WAYS)
def test_power_and_the_way_back(engine: str, method: str) -> None:
    """Driven by the cylinder strokes found, the same; force at the tip and forces of the cylinders have the same power."""
    t, points = tip_path()
    how = {"engine": engine, "method": method}
    motion = mg.Motion(points, t=t)
    s = mg.solve(bent(), {"bucket.tip": motion}, actuate=["lift", "curl"], **how)  # type: ignore[arg-type]
    there = mg.solve(bent(), {
        k: mg.Motion(s[k].position[:, 0], s[k].velocity[:, 0], s[k].acceleration[:, 0]) for k in ("lift", "curl")
    }, **how)  # type: ignore[arg-type]  # fmt: skip
    for pair in bent().pairs:
        for what in ("position", "velocity", "acceleration", "effort", "reaction", "force"):
            one, two = (getattr(x[pair.name], what) for x in (s, there))
            np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-10 * max(1.0, np.nanmax(np.abs(two), initial=0.0)))
    at_tip = mg.solve(bent(), {"bucket.tip": motion}, **how)  # type: ignore[arg-type]
    force, v = at_tip["bucket.tip"].effort[:, :2], at_tip.link("bucket").at("tip").velocity[:, :2]
    power = sum((s[k].effort * s[k].velocity)[:, 0] for k in ("lift", "curl"))
    np.testing.assert_allclose((force * v).sum(axis=1), power, rtol=1e-9)
    assert np.isnan(at_tip["bucket.tip"].effort[:, 2]).all()  # across the plane it is one of many that hold it
    assert not at_tip["lift"].effort.any()
    np.testing.assert_allclose(v[0], [0.1, 0.2], atol=2e-3)
    for x in (s, at_tip):
        assert x.checks.closure.max() < 1e-12
        assert x.checks.equilibrium.max() < 1e-12
        assert np.abs(x.checks.power).max() < 1e-12


def test_coordinates_lines_and_given_rates_are_the_same_motion() -> None:
    t, points = tip_path()
    whole = mg.kinematics(bent(), {"bucket.tip": mg.Motion(points, t=t)})
    path = whole.link("bucket").at("tip")
    given = mg.kinematics(bent(), {"bucket.tip": mg.Motion(*path)})
    parts = mg.kinematics(
        bent(), {f"bucket.tip.{n}": mg.Motion(*(v[:, i] for v in path)) for i, n in enumerate(("Tx", "Ty"))}
    )
    d, e = np.array([3.0, 4, 0]) / 5, np.array([1.0, 1, 0]) / np.sqrt(2)
    lines = {
        "bucket.tip.T(3, 4, 0)": mg.Motion(*(v @ d for v in path)),
        "bucket.tip.T(1,1,0)": mg.Motion(*(v @ e for v in path)),
    }
    along = mg.kinematics(bent(), lines)
    mixed = mg.kinematics(bent(), {"bucket.tip.Ty": mg.Motion(*(v[:, 1] for v in path)), "A": mg.Motion(
        whole["A"].position[:, 0], whole["A"].velocity[:, 0], whole["A"].acceleration[:, 0])})  # fmt: skip
    turn = mg.kinematics(bent(), {"bucket.tip.Ty": mg.Motion(*(v[:, 1] for v in path)), "arm.Rz": mg.Motion(
        whole["A"].position[:, 0], whole["A"].velocity[:, 0], whole["A"].acceleration[:, 0])})  # fmt: skip
    for other in (given, parts, along, mixed, turn):
        for pair in bent().pairs:
            for what in ("position", "velocity", "acceleration"):
                np.testing.assert_allclose(getattr(other[pair.name], what), getattr(whole[pair.name], what), atol=1e-9)
    np.testing.assert_allclose(along["bucket.tip"].position[:, 0], path.position @ d, atol=1e-12)


# --- a platform on six legs --------------------------------------------------------------------------------------------

BASE = np.array([[np.cos(a), np.sin(a), 0] for a in np.deg2rad([0, 40, 120, 160, 240, 280])]) * 1.2
TOP = np.array([[np.cos(a), np.sin(a), 0] for a in np.deg2rad([50, 350, 170, 110, 290, 230])]) * 0.6 + [0, 0, 1.0]


def hexapod(second: str = "S") -> mg.Mechanism:
    """Six cylinders, U below (or S, then they spin) and S above; the platform of 50 kg at z = 1."""
    links = [mg.Link("frame"), mg.Link("platform", 50, (0, 0, 1.1), inertia=mg.inertia.box(50, (0.8, 0.6, 0.2)))]
    pairs = []
    for k, (a, b) in enumerate(zip(BASE, TOP, strict=True)):
        u = (b - a) / np.linalg.norm(b - a)
        links += [mg.Link(f"tube{k}"), mg.Link(f"rod{k}")]
        across = np.cross(u, Z)
        pairs.append(mg.Pair(f"U{k}", "U", "frame", f"tube{k}", point=a, axis=across, second=np.cross(across, u))
                     if second == "U" else mg.Pair(f"U{k}", "S", "frame", f"tube{k}", point=a))  # fmt: skip
        pairs.append(mg.Pair(f"leg{k}", "P", f"tube{k}", f"rod{k}", point=a, axis=u))
        pairs.append(mg.Pair(f"S{k}", "S", f"rod{k}", "platform", point=b))
    return mg.Mechanism("hexapod", links, pairs, [f"leg{k}" for k in range(6)], [mg.Gravity((0, 0, -10))])


def poses(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses of the platform from its place, with twist and rate of twist about the global origin, in closed form."""
    n = np.array([1.0, 2, 2]) / 3
    angle, rate, change = 0.3 * np.sin(t), 0.3 * np.cos(t), -0.3 * np.sin(t)
    d, dd, ddd = np.array([0.1, 0.05, 0.2]) * t[:, None], np.tile([0.1, 0.05, 0.2], (len(t), 1)), np.zeros((len(t), 3))
    out = np.tile(np.eye(4), (len(t), 1, 1))
    out[:, :3, :3] = Rotation.from_rotvec(angle[:, None] * n).as_matrix()
    out[:, :3, 3] = d
    w, dw = rate[:, None] * n, change[:, None] * n
    v = dd - np.cross(w, d)
    dv = ddd - np.cross(dw, d) - np.cross(w, dd)
    return out, np.concatenate([w, v], axis=1), np.concatenate([dw, dv], axis=1)


@pytest.mark.daily(3)
@pytest.mark.parametrize("second", ["U", "S"])
@pytest.mark.parametrize(("engine", "method"), WAYS)
def test_a_platform_goes_through_poses(second: str, engine: str, method: str) -> None:
    """Leg lengths are distances; leg forces balance weight and inertia, six equations by hand."""
    t = np.linspace(0, 1.5, 4)
    X4, V, A = poses(t)
    m = hexapod(second)
    s = mg.solve(
        m, {"platform": mg.Motion(X4, V, A)}, actuate=[f"leg{k}" for k in range(6)], engine=engine, method=method
    )
    np.testing.assert_allclose(s.link("platform").pose, X4, atol=1e-12)
    np.testing.assert_allclose(s.link("platform").twist, V, atol=1e-10)
    np.testing.assert_allclose(s.link("platform").acceleration, A, atol=1e-9)
    tops = np.einsum("tij,kj->tki", X4[:, :3, :3], TOP) + X4[:, None, :3, 3]
    legs = tops - BASE
    length = np.linalg.norm(legs, axis=-1)
    found = np.stack([s[f"leg{k}"].position[:, 0] for k in range(6)], axis=1)
    np.testing.assert_allclose(found, length - np.linalg.norm(TOP - BASE, axis=1), atol=1e-12)
    u = legs / length[..., None]
    I = mg.inertia.box(50, (0.8, 0.6, 0.2))
    for i in range(len(t)):
        R, p, w, dw = X4[i, :3, :3], X4[i, :3, 3], V[i, :3], A[i, :3]
        c = R @ np.array([0, 0, 1.1]) + p
        vc = V[i, 3:] + np.cross(w, c)
        ac = A[i, 3:] + np.cross(dw, c) + np.cross(w, vc)
        G = R @ np.asarray(I) @ R.T
        moment = G @ dw + np.cross(w, G @ w)
        force = 50 * (ac - np.array([0, 0, -10]))
        W = np.concatenate([np.cross(tops[i] - c, u[i]), u[i]], axis=1).T
        by_hand = np.linalg.solve(W, np.concatenate([moment, force]))
        np.testing.assert_allclose([s[f"leg{k}"].effort[i, 0] for k in range(6)], by_hand, rtol=1e-8)
    assert s.checks.equilibrium.max() < 1e-12
    report = mg.check(m)
    assert (report.mobility, len(report.passive)) == (12 if second == "S" else 6, 6 if second == "S" else 0)


def test_rates_of_poses_follow_from_their_times() -> None:
    t = np.linspace(0, 1.5, 121)
    X4, V, A = poses(t)
    s = mg.kinematics(hexapod("U"), {"platform": mg.Motion(X4, t=t)})
    np.testing.assert_allclose(s.link("platform").twist[5:-5], V[5:-5], atol=1e-5)
    np.testing.assert_allclose(s.link("platform").acceleration[5:-5], A[5:-5], atol=1e-3)
    still = mg.kinematics(hexapod("U"), {"platform": X4[:3]})
    assert not still.link("platform").twist.any()
    steady = mg.kinematics(hexapod("U"), {"platform": mg.Motion(X4[5], V[5])})
    assert np.abs(steady.link("platform").angular_acceleration).max() < 1e-12


def test_the_wrench_that_carries_a_pose_has_the_power_of_the_legs() -> None:
    X4, V, A = poses(np.linspace(0, 1.5, 4))
    m = hexapod("U")
    s = mg.solve(m, {"platform": mg.Motion(X4, V, A)})
    by_legs = mg.solve(m, {"platform": mg.Motion(X4, V, A)}, actuate=[f"leg{k}" for k in range(6)])
    carried = (s["platform"].effort * s["platform"].velocity).sum(axis=-1)
    power = sum((by_legs[f"leg{k}"].effort * by_legs[f"leg{k}"].velocity)[:, 0] for k in range(6))
    np.testing.assert_allclose(carried, power, rtol=1e-9)
    np.testing.assert_allclose(s["platform"].effort[:, 2], 500.0, rtol=0.2)
    np.testing.assert_allclose(s["leg0"].force, 0.0, atol=1e-9)


@pytest.mark.daily(2)
@pytest.mark.parametrize("axis", [X, Y, Z, (1, 1, 1), (1, -2, 0.5)])
def test_a_link_turns_all_the_way_round(axis: tuple) -> None:
    """A body on a U-S-like chain of three turns; poses that turn by a whole turn about any one axis, whatever the first orientation."""
    m = mg.Mechanism("wrist", pairs=[
        mg.Pair("A", "S", "frame", "body", point=(0, 0, 0)), mg.Pair("B", "P", "body", "tool", point=(0, 0, 0), axis=Z),
    ])  # fmt: skip
    n = np.asarray(axis) / np.linalg.norm(axis)
    angle = np.deg2rad(np.arange(0, 361, 30))
    R = Rotation.from_rotvec(angle[:, None] * n) * Rotation.from_rotvec([0.3, 0.2, -0.4])
    X4 = np.tile(np.eye(4), (len(angle), 1, 1))
    X4[:, :3, :3] = R.as_matrix()
    s = mg.kinematics(m, {"body": X4, "B": 0.1})
    np.testing.assert_allclose(s.link("body").pose, X4, atol=1e-12)


def test_nothing_else_is_changed_by_what_is_prescribed() -> None:
    """Counts, reactions of least norm and what is shown are those of the mechanism without free pairs."""
    t, points = tip_path()
    s = mg.solve(bent(), {"bucket.tip": mg.Motion(points, t=t)}, actuate=["lift", "curl"], redundant="minimum_norm")
    there = mg.solve(bent(), {
        k: mg.Motion(s[k].position[:, 0], s[k].velocity[:, 0], s[k].acceleration[:, 0]) for k in ("lift", "curl")
    }, redundant="minimum_norm")  # fmt: skip
    for pair in bent().pairs:
        np.testing.assert_allclose(s[pair.name].reaction, there[pair.name].reaction, rtol=1e-8, atol=1e-7)
    assert [p.name for p in s.mechanism.pairs] == [p.name for p in bent().pairs]
    assert str(mg.check(s.mechanism)) == str(mg.check(bent()))
    f = mg.formulate(s.mechanism)
    A, b = f.assemble(s.state(2))
    assert np.abs(A @ np.linalg.lstsq(A.toarray(), b)[0] - b).max() < 1e-8 * np.abs(b).max()
    at_tip = mg.solve(bent(), {"bucket.tip.Tx": points[:, 0], "bucket.tip.Ty": points[:, 1]})
    assert [d.freedom for d in at_tip.mechanism.drives] == []
    A, b = mg.formulate(at_tip.mechanism).assemble(at_tip.state(2))  # the force at the tip is a load there
    assert np.abs(A @ np.linalg.lstsq(A.toarray(), b)[0] - b).max() < 1e-8 * np.abs(b).max()
    columns = list(at_tip.columns())
    assert "bucket.tip.Tx effort" in columns
    assert "bucket.tip.Tz" not in columns


def test_far_from_the_origin_and_in_other_units() -> None:
    t, points = tip_path()
    here = mg.solve(bent(), {"bucket.tip": mg.Motion(points, t=t)}, actuate=["lift", "curl"])
    G = np.eye(4)
    G[:3, :3], G[:3, 3] = Rotation.from_rotvec([0.2, -0.4, 0.7]).as_matrix(), (1e4, -2e4, 3e3)
    moved = mg.solve(
        bent().moved(G), {"bucket.tip": mg.Motion(points @ G[:3, :3].T + G[:3, 3], t=t)}, actuate=["lift", "curl"]
    )
    np.testing.assert_allclose(moved["lift"].effort, here["lift"].effort, rtol=1e-6)
    pint = pytest.importorskip("pint")
    unit = pint.UnitRegistry()
    metric = bent().replace(units={"length": "m", "mass": "kg", "time": "s"})
    s = mg.solve(metric, {"bucket.tip": mg.Motion(1000 * points * unit.mm, t=t)}, actuate=["lift", "curl"])
    np.testing.assert_allclose(s["lift"].effort, here["lift"].effort, rtol=1e-9)
    mm = mg.solve(metric.to_units(length="mm"), {"bucket.tip": mg.Motion(1000 * points, t=t)}, actuate=["lift", "curl"])
    np.testing.assert_allclose(mm["lift"].effort, 1000 * here["lift"].effort, rtol=1e-9)


def test_cases_and_variants() -> None:
    t, points = tip_path()
    two = np.stack([points, points + np.array([0.05, 0.0, 0.0])])
    s = mg.solve(bent(), {"bucket.tip": mg.Motion(two, t=t)}, actuate=["lift", "curl"])
    assert s.batch == (2, 7)
    one = mg.solve(bent(), {"bucket.tip": mg.Motion(two[1], t=t)}, actuate=["lift", "curl"])
    np.testing.assert_allclose(s["lift"].effort[1], one["lift"].effort, rtol=1e-9)
    study = mg.study(
        bent(), {"bucket.mass": [100.0, 110.0], "D.point.x": [2.0, 2.01]}, ["lift.effort"], n=2, sampling="grid",
        motions={"bucket.tip": mg.Motion(points, t=t)}, actuate=["lift", "curl"],
    )  # fmt: skip
    assert (study.status == "ok").all()
    for i in range(4):
        alone = mg.solve(study.variant(i), {"bucket.tip": mg.Motion(points, t=t)}, actuate=["lift", "curl"])
        np.testing.assert_allclose(study.outputs["lift.effort"][i], alone["lift"].effort[:, 0], rtol=1e-8)


def test_variants_of_a_platform_that_goes_through_poses() -> None:
    """Alone and together; sent to other processes; the sixth leg's foot varies."""
    X4, V, A = poses(np.linspace(0, 1.5, 4))
    drive = {"platform": mg.Motion(X4, V, A)}
    legs = [f"leg{k}" for k in range(6)]
    study = mg.study(
        hexapod("U"), {"platform.mass": [50.0, 60.0], "S5.point.x": [TOP[5, 0], TOP[5, 0] + 0.02]}, ["leg5.effort", "leg5.position"],
        n=2, sampling="grid", motions=drive, actuate=legs,
    )  # fmt: skip
    assert (study.status == "ok").all()
    for i in range(4):
        alone = mg.solve(study.variant(i), drive, actuate=legs)
        np.testing.assert_allclose(study.outputs["leg5.effort"][i], alone["leg5"].effort[:, 0], rtol=1e-8)


def test_out_of_reach_is_told_in_the_names_that_were_typed() -> None:
    with pytest.raises(mg.ReachError, match=r"bucket\.tip\.Tx = 9") as error:
        mg.solve(bent(), {"bucket.tip": [[6.0, -1.0, 0], [9.0, 0, 0]]})
    assert set(error.value.value) <= {"bucket.tip.Tx", "bucket.tip.Ty", "bucket.tip.Tz"}
    with pytest.raises(mg.IndeterminateError, match="1 freedom is neither driven nor passive") as free:
        mg.solve(bent(), {"bucket.tip.Ty": 0.5})
    assert "bucket" not in str(free.value).partition("moving")[2]


@pytest.mark.parametrize(
    ("motions", "words"),
    [
        ({"bucket.tap": 0.1}, r"link 'bucket' has no point 'tap' \(its points: tip\); of a link itself Tx, Ty, Tz, Rx, Ry, Rz"),
        ({"bucket.tip": [1.0, 2.0]}, r"expected points \(\.\.\., 3\), plain numbers, got an array of shape \(2,\)"),
        ({"bucket": np.zeros((2, 3))}, r"expected poses \(\.\.\., 4, 4\)"),
        ({"bucket": 2 * np.eye(4)}, "expected poses with a proper rotation"),
        ({"bucket.tip": [[7, 0, 0]], "bucket.tip.Tx": [1.0]}, r"bucket\.tip\.Tx is given twice"),
        ({"bucket.tip.T(1,0)": 0.1}, r"expected a direction as in T\(1,0,1\)"),
        ({"frame.Tx": 0.1}, "is on the frame, which does not move"),
        ({"lift": mg.Motion(TIP, t=T)}, "expected one number a position"),
        ({"nobody.tip": 0.1}, "unknown freedom 'nobody.tip'"),
        ({3: 0.1}, "expected a name"),
        ({"bucket": mg.Motion(np.tile(np.eye(4), (2, 1, 1)), acceleration=np.zeros(6), t=[0.0, 1.0])}, "an acceleration and no velocity"),
    ],
)  # fmt: skip
def test_faults_are_told(motions: dict, words: str) -> None:
    with pytest.raises(mg.DeclarationError, match=words):
        mg.solve(bent(), motions)


def test_a_motion_of_vectors_is_kept_as_it_was_given() -> None:
    t, points = tip_path()
    motion = mg.Motion(points, t=t)
    assert motion == mg.Motion(points.copy(), t=t)
    assert hash(motion) == hash(mg.Motion(points.copy(), t=t))
    assert motion != mg.Motion(points + 1e-12, t=t)
    assert repr(motion).startswith(f"Motion(shape={points.shape}, position=")
    assert pickle.loads(pickle.dumps(motion)).given[0].tolist() == points.tolist()
    with pytest.raises(ValueError, match="read-only"):
        motion.given[0][0] = 1.0
    with pytest.raises(mg.DeclarationError, match="do not broadcast"):
        mg.Motion(points, t=t[:-1])


def with_points(m: mg.Mechanism, seed: int) -> mg.Mechanism:
    """A random point on every moving link."""
    rng = np.random.default_rng((seed, 8))
    links = [k if k.name == m.frame else k.replace(points={"p": rng.normal(size=3)}) for k in m.links]
    return m.replace(links=links)


def senses(m: mg.Mechanism, s: mg.Solution, drives: list[str], names: list[tuple[str, int]]) -> np.ndarray:
    """Determinant of the rates of points' coordinates for unit rates of the drives, at every position: zero where these stand still."""
    q = {name: s[m.pairs[m.freedom(name)[0]].name].position[:, m.freedom(name)[1]] for name in drives}
    rows = []
    for one in drives:
        x = mg.kinematics(m, {name: mg.Motion(at, float(name == one)) for name, at in q.items()})
        rows.append([x.link(link).at("p").velocity[:, i] for link, i in names])
    return np.linalg.det(np.moveaxis(np.array(rows), -1, 0))


@pytest.mark.seeds(12, without=(0, 1, 5, 6, 7, 9, 10, 11, 12, 13, 15, 16, 18, 22, 24, 25, 26, 27, 28, 29, 30, 32))
def test_random_mechanisms_moved_by_points_are_the_same(seed: int) -> None:
    """Drives move it; then what points did is prescribed, with the efforts in the drives: all of it is the same.

    And with the efforts at the points, or in other freedoms: the same power. Compared up to where the points stand still while the
    drives go on, as what moves the points stays on its branch there.
    """
    made = solvable(seed)
    if made is None or mg.check(made).passive:
        pytest.skip("none, or passive bodies: what they do depends on the path between positions")
    m, rng = with_points(made, seed), np.random.default_rng((seed, 9))
    how: dict = dict(zip(("engine", "method"), WAYS[seed % 4], strict=True))
    given = motions(m, seed, np.linspace(0, 1, 4), size=0.05)
    moving = [k.name for k in m.links if k.name != m.frame]
    names = [(str(rng.choice(moving)), int(rng.integers(3))) for _ in given]
    singles = [n for p in m.pairs for n, able in zip(p.freedom_names, p.type.drivable, strict=True) if able]
    others = [str(n) for n in rng.choice(singles, len(given), replace=False)]
    try:
        s = mg.solve(m, given, **how)
        told = {f"{k}.p.{['Tx', 'Ty', 'Tz'][i]}": mg.Motion(*(v[:, i] for v in s.link(k).at("p"))) for k, i in names}
        there = mg.solve(m, told, actuate=list(given), **how)
        at_points, elsewhere = mg.solve(m, told, **how), mg.solve(m, told, actuate=others, **how)
    except (mg.IndeterminateError, mg.DeadPointError, mg.ReachError):
        pytest.skip("these do not move it all the way")
    sense = senses(m, s, list(given), names)
    same = np.logical_and.accumulate(sense * sense[0] > 0)
    for what in ("velocity", "acceleration", "effort", "reaction"):
        largest = max(np.nanmax(np.abs(getattr(s[p.name], what)), initial=1.0) for p in m.pairs)
        for pair in m.pairs:
            one, two = (getattr(x[pair.name], what)[same] for x in (there, s))
            np.testing.assert_allclose(one, two, rtol=0, atol=1e-9 * largest)
    power = [[x[p.name].effort * x[p.name].velocity for p in x.whole.pairs] for x in (s, at_points, elsewhere)]
    sums = np.array([sum(np.nansum(p, axis=-1) for p in of) for of in power])[:, same & (elsewhere.status == "ok")]
    largest = max(np.nanmax(np.abs(p), initial=1.0) for of in power for p in of)
    np.testing.assert_allclose(sums, sums[[0, 0, 0]], rtol=0, atol=1e-9 * largest)


def test_a_pose_has_the_coordinates_and_efforts_of_its_angles() -> None:
    """Pose and single coordinates are two spellings of one place: the same angles, and the weight's couples about x, new y and new z."""
    angles = [0.2, 0.1, 0.05]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("XYZ", angles).as_matrix(), (0.03, -0.02, 0.04)
    single = {f"platform.T{k}": v for k, v in zip("xyz", T[:3, 3], strict=True)}
    single |= {f"platform.R{k}": v for k, v in zip("xyz", angles, strict=True)}
    whole, parts = (mg.solve(hexapod("U"), given)["platform"] for given in ({"platform": T}, single))
    np.testing.assert_allclose(whole.position, [*T[:3, 3], *angles], atol=1e-12)
    np.testing.assert_allclose(whole.effort, parts.effort, atol=1e-9)
    c = T[:3, :3] @ (0, 0, 1.1)
    np.testing.assert_allclose(whole.effort[3], np.cross(c, (0, 0, 500.0))[0], rtol=1e-9)
