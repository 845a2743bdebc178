"""Rounded numbers: special mechanisms declared with few digits, taken as they are meant with ``tol``, and hints where it is not given."""

from __future__ import annotations

import mechanisms
import numpy as np
import pytest
import scipy.stats
from program import invoke
from scipy.spatial.transform import Rotation
from strategies import closed_mechanism

import mechgraph as mg

SPECIAL = {
    **{name: getattr(mechanisms, name) for name in (
        "planar", "spherical", "bennett", "goldberg", "myard", "bricard_line_symmetric", "bricard_cube", "bricard_trihedral",
        "sarrus", "three_cranks", "three_upu", "prprrh_special",
    )},
    "slider-crank": lambda: mg.load("slider-crank"),
    "spherical-four-bar": lambda: mg.load("spherical-four-bar"),
    "parallelograms": lambda: mechanisms.windows(3, False),
}  # fmt: skip
POSITIONS = np.linspace(0, 0.8, 9)


def rounded(m: mg.Mechanism, digits: int, seed: int = 0, tol: float | None = None) -> mg.Mechanism:
    """In a random place, with axes of random length, every number to so many digits behind the point; declared with ``tol``.

    Without it second directions that must be perpendicular to the axis are made so after the rounding.
    """
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)

    def axis(v: tuple[float, ...]) -> tuple[float, ...]:
        unit = np.asarray(v) / np.linalg.norm(v)
        return tuple(np.round(rng.uniform(1, 1.6) * unit, digits).tolist())

    def marker(k: mg.Marker | mg.Pair, square: bool) -> dict[str, tuple[float, ...]]:
        point, z, x = tuple(np.round(k.point, digits).tolist()), axis(k.axis), axis(k.second)
        if square and tol is None:
            x = tuple((np.array(x) - np.dot(x, z) / np.dot(z, z) * np.array(z)).tolist())
        return {"point": point, "axis": z, "second": x}

    pairs = []
    for p in m.moved(pose).pairs:
        sides = {"on_a": p.on_a, "on_b": p.on_b}
        square = p.type.square_second
        found = (
            {k: mg.Marker(**marker(v, square)) for k, v in sides.items()} if p.on_a is not None else marker(p, square)
        )
        pairs.append(p.replace(**found))
    return m.moved(pose).replace(pairs=pairs, tol=tol)


def verdict(r: mg.DeterminacyReport) -> tuple[object, ...]:
    return r.finite_mobility, r.redundancy, sum(all(unique.values()) for unique in r.unique.values())


@pytest.mark.daily(12)
@pytest.mark.parametrize("name", SPECIAL)
@pytest.mark.parametrize(("digits", "seed"), [(2, 1), (4, 2), (6, 3), (9, 4), (12, 5)])
def test_rounded_special_mechanisms_are_what_they_are_meant_to_be(name: str, digits: int, seed: int) -> None:
    m, tol = SPECIAL[name](), 5 * 10.0**-digits
    found = mg.check(rounded(m, digits, seed, tol), tol=tol)
    assert verdict(found)[:2] == verdict(mg.check(m))[:2]


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", [name for name in SPECIAL if name != "three_upu"])
@pytest.mark.parametrize(("digits", "seed"), [(3, 1), (5, 2), (7, 3)])
def test_without_a_tolerance_the_report_says_which_would_change_the_verdict(name: str, digits: int, seed: int) -> None:
    m = SPECIAL[name]()
    exact, report = mg.check(m), mg.check(rounded(m, digits, seed))
    assert verdict(report)[:2] != verdict(exact)[:2]
    found = report.rounding
    assert found is not None
    assert found.mobility == exact.finite_mobility
    assert max(found.angle, found.distance) < 30 * 10.0**-digits
    first = str(report).split("\n\n")[1].replace("\n", " ")
    assert first.startswith("With ")
    assert f"(mobility {found.mobility})" in first
    assert verdict(mg.check(report.mechanism, tol=found.tol))[:2] == verdict(exact)[:2]


def test_the_sentence_names_plane_and_axes() -> None:
    found = mg.check(rounded(mg.load("slider-crank"), 4)).rounding
    assert found is not None
    assert found.kind == "planar"
    assert found.misses[0].endswith("deg off the normal")
    assert "the mechanism is planar and moves (mobility 1). Axis of " in found.text


def bent(m: mg.Mechanism, size: float, seed: int) -> mg.Mechanism:
    """Every axis and point off by so much in a random direction, numbers with all digits."""
    rng = np.random.default_rng(seed)

    def off(v: object, by: float) -> np.ndarray:
        d = rng.normal(size=3)
        return np.asarray(v) + by * d / np.linalg.norm(d)

    m = rounded(m, 15, seed)
    return m.replace(
        pairs=[p.replace(point=off(p.point, size), axis=off(p.axis, size * np.linalg.norm(p.axis))) for p in m.pairs]
    )


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", ["planar", "sarrus", "spherical", "bennett"])
def test_a_hint_agrees_with_the_digits(name: str) -> None:
    """A miss of some 5e-3 is explained by two digits behind the point and by no more; one below 1e-3 always."""
    wide = bent(SPECIAL[name](), 5e-3, 4)
    assert 1e-3 < wide.snapped(1e-2).changes.largest < 1e-2
    assert mg.check(wide).rounding is None
    with pytest.raises(mg.MechgraphError) as caught:
        mg.kinematics(wide, {wide.freedom_names()[0]: POSITIONS})
    assert "tol=" not in str(caught.value)
    assert mg.check(rounded(wide, 2)).rounding is not None
    assert mg.check(bent(SPECIAL[name](), 5e-4, 4)).rounding is not None


@pytest.mark.seeds(20)
def test_random_mechanisms_have_no_hint(seed: int) -> None:
    """Numbers with all digits, spatial; the second one comes within 0.0086 of a special one by chance."""
    assert mg.check(closed_mechanism(seed)).rounding is None


@pytest.mark.daily(15)
@pytest.mark.parametrize("name", mg.library())
def test_exact_mechanisms_have_no_hint(name: str) -> None:
    m = mg.load(name)
    if m.has_geometry and "printed" not in name:
        assert mg.check(m).rounding is None


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", ["slider-crank", "bennett", "sarrus", "three_cranks", "spherical"])
@pytest.mark.parametrize("digits", [3, 5, 8, 10])
def test_solutions_of_rounded_mechanisms_differ_by_the_order_of_the_tolerance(name: str, digits: int) -> None:
    m, tol = SPECIAL[name](), 10.0 ** (1 - digits)
    declared, freedom = rounded(m, digits), m.freedom_names()[0]
    with pytest.raises(mg.MechgraphError, match="Pass tol="):
        mg.kinematics(declared, {freedom: POSITIONS})
    exact = mg.kinematics(m, {freedom: POSITIONS})
    for engine in ("dense", "sparse"):
        s = mg.kinematics(declared, {freedom: POSITIONS}, tol=tol, engine=engine)
        assert (s.status == "ok").all()
        assert 0 < s.checks.closure.max() <= tol
        for pair in m.pairs:
            moved, meant = (np.abs(of[pair.name].position - of[pair.name].position[0]) for of in (s, exact))
            np.testing.assert_allclose(moved, meant, atol=5 * tol)


def test_forces_too() -> None:
    m = mg.load("four-bar")
    theta = np.linspace(0, 0.8, 5)
    exact = mg.solve(m, {"A": mg.Motion(theta, 1.0, 0.0)}, loads=[mg.Effort("D", 1.0)])
    s = mg.solve(rounded(m, 5), {"A": mg.Motion(theta, 1.0, 0.0)}, loads=[mg.Effort("D", 1.0)], tol=1e-4)
    np.testing.assert_allclose(np.abs(s["A"].effort), np.abs(exact["A"].effort), atol=1e-3)


def test_a_position_beyond_the_tolerance_is_not_solved() -> None:
    m = rounded(mechanisms.bennett(), 3)
    tol = m.snapped(5e-3).changes.largest
    s = mg.kinematics(m, {"O1": np.linspace(0, 3, 40)}, tol=tol, on_reach="flag")
    beyond = s.status == "beyond tolerance"
    assert 0 < beyond.sum() < len(beyond)
    np.testing.assert_array_equal(s.checks.closure > tol, beyond)
    assert np.isnan(s["O2"].position[beyond]).all()
    with pytest.raises(mg.ReachError, match="exceeds tol"):
        mg.kinematics(m, {"O1": np.linspace(0, 3, 40)}, tol=tol)


def test_markers_that_meet_to_1e_6() -> None:
    lengths, z = {"frame": 3.0, "crank": 1.0, "coupler": 2.5, "rocker": 2.2}, (0, 0, 1)
    tilt = [np.round(np.array(v) + d, 6) for v, d in ((z, (1e-6, 0, 0)), (z, (0, -1e-6, 0)), (z, (0, 0, 0)))]
    links = list(lengths)
    pairs = [
        mg.Pair(name, "R", a, b, on_a=mg.Marker((0, 0, 0) if a == "frame" else (lengths[a], 0, 0), tilt[k % 3]),
                on_b=mg.Marker((0, 0, 1e-6 * k) if b != "frame" else (lengths[b], 0, 0), z))
        for k, (name, a, b) in enumerate(zip("ABCD", links, [*links[1:], "frame"], strict=True))
    ]  # fmt: skip
    m = mg.Mechanism("loose", pairs=pairs, drives=["A"], start={"A": 1.0, "B": -0.6})
    with pytest.raises(mg.AssemblyError, match=r"Pass tol=\S+ to treat it as exact"):
        mg.kinematics(m, {"A": POSITIONS + 1})
    s = mg.kinematics(m, {"A": POSITIONS + 1}, tol=1e-5)
    assert s.checks.closure.max() < 1e-5
    report = mg.check(m, tol=1e-5)
    assert (report.mobility, report.redundancy) == (1, 3)
    assert mg.check(m).rounding is not None


@pytest.mark.parametrize("name", ["planar", "spherical", "sarrus", "bennett"])
def test_the_change_is_the_smallest(name: str) -> None:
    """The mechanism that was rounded is exact as well, and within the rounding: the one found is no farther away."""
    exact = SPECIAL[name]()
    declared = rounded(exact, 3, 7)
    pose = np.eye(4)
    rng = np.random.default_rng(7)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    meant, found = exact.moved(pose), declared.snapped(3e-3)
    L = found.changes.L

    def distance(one: mg.Mechanism) -> float:
        total = 0.0
        for p, q in zip(one.pairs, declared.pairs, strict=True):
            z, w = (np.asarray(k.axis) / np.linalg.norm(k.axis) for k in (p, q))
            off = np.asarray(p.point) - np.asarray(q.point)
            across = off - (off @ w) * w
            total += float(np.linalg.norm(np.cross(z, w)) ** 2 + (np.linalg.norm(across) / L) ** 2)
        return total

    assert distance(found) <= distance(meant) * (1 + 1e-2)
    assert mg.check(found).finite_mobility == 1
    axes = np.array([np.asarray(p.axis) / np.linalg.norm(p.axis) for p in found.pairs])
    if name == "planar":
        assert np.abs(np.cross(axes, axes[0])).max() < 1e-14
    text = str(found.changes)
    assert "turned [deg]" in text
    assert all(change.pair in text for change in found.changes.moved)


def test_relations_that_cannot_hold_together_are_listed_and_not_applied() -> None:
    a = 1e-3
    feet, heads = [(2 * k, 0, 0) for k in range(5)], [(2 * k, 1 + 5 * a * k, 0) for k in range(5)]
    found = mechanisms.cranks(feet, heads, "stairs").snapped(a)
    assert found.changes.dropped
    assert found.changes.largest <= 1.01 * a
    assert all(r.text in str(found.changes) for r in found.changes.dropped)


def test_an_exact_mechanism_is_left_alone() -> None:
    m = mg.load("slider-crank")
    assert m.snapped(1e-3).pairs == m.pairs
    assert not m.snapped(1e-3).changes.moved


def test_files_and_the_command_line(tmp_path) -> None:
    m = rounded(mg.load("slider-crank"), 5)
    path = tmp_path / "m.toml"
    mg.save(m.replace(tol=1e-4), path)
    assert mg.load(path).tol == 1e-4
    assert mg.check(mg.load(path)).mobility == 1
    mg.save(m, path)
    assert invoke("solve", str(path), "--drive", "A=0:60:10deg").exit_code == 1
    assert invoke("solve", str(path), "--drive", "A=0:60:10deg", "--tol", "1e-4").exit_code == 0
    assert "mobility 1" in invoke("check", str(path), "--tol", "1e-4").output


def test_a_study_takes_every_variant_as_meant() -> None:
    exact, outputs = mg.load("slider-crank"), ["D.position"]
    declared = rounded(exact, 5)
    x = {"B.point.x": scipy.stats.uniform(declared.pair("B").point[0], 1e-3)}
    study = mg.study(declared, x, outputs, n=3, motions={"A": POSITIONS}, tol=5e-3)
    assert (study.status == "ok").all()


@pytest.mark.daily(1)
@pytest.mark.parametrize("started", [False, True])
def test_a_study_looks_at_the_closure_along_the_path(started: bool) -> None:
    """Every variant has the statuses and closure errors that it has alone; followed together, or from a start of its own.

    Lengths are over the mean radius of the first variant where they are followed together.
    """
    m = rounded(mechanisms.bennett(), 3)
    tol = m.snapped(5e-3).changes.largest
    point, path = m.pair("O2").point, np.linspace(0, 3, 8)

    def variant(x: float) -> mg.Mechanism:
        pairs = [p.replace(point=(x, *point[1:])) if p.name == "O2" else p for p in m.pairs]
        return m.replace(pairs=pairs, start={"O1": 1e-3 * (x - point[0])} if started else {})

    levels = [point[0] + 1e-4]
    study = mg.study(
        variant, {"x": levels}, ["O2.position", "closure"], 1, sampling="grid", motions={"O1": path}, tol=tol
    )
    for i, x in enumerate(levels):
        alone = mg.kinematics(variant(x), {"O1": path}, tol=tol, on_reach="flag")
        assert 0 < (alone.status == "beyond tolerance").sum() < len(path)
        np.testing.assert_array_equal(study.status[i], alone.status)
        np.testing.assert_allclose(study.outputs["closure"][i], alone.checks.closure, rtol=1e-4, atol=1e-12)
        np.testing.assert_array_equal(np.isnan(study.outputs["O2.position"][i]), alone.status != "ok")


@pytest.mark.parametrize("cosine", [-1e-3, 5e-4, 3e-6])
def test_second_directions_are_perpendicular_to_the_tolerance_of_the_mechanism(cosine: float, tmp_path) -> None:
    """Of types of which it is a true direction; taken as meant then, and refused without a tolerance or with a smaller one."""
    z, x = (0.0, 0.0, 1.0), (1.0, 0.0, cosine)
    marker = mg.Marker((0, 0, 0), z, x)
    for kind in ("U", "Sc", "Cp"):
        for place in ({"point": (0, 0, 0), "axis": z, "second": x}, {"on_a": marker, "on_b": marker}):
            pairs = [mg.Pair("A", kind, "frame", "arm", **place)]
            for tol in (None, abs(cosine) / 3):
                with pytest.raises(mg.DeclarationError, match=r"not perpendicular .* pass tol= to Mechanism"):
                    mg.Mechanism("joint", pairs=pairs, tol=tol)
            m = mg.Mechanism("joint", pairs=pairs, tol=abs(cosine))
            mg.save(m, tmp_path / "joint.toml")
            assert mg.load(tmp_path / "joint.toml") == m
            exact = mg.Mechanism(
                "joint", pairs=[mg.Pair("A", kind, "frame", "arm", point=(0, 0, 0), axis=z, second=(1, 0, 0))]
            )
            row = m.pairs[0].type
            at = {f"A.{f.name}": 0.1 for f, single in zip(row.freedoms, row.drivable, strict=True) if single}
            poses = [mg.kinematics(one, at).link("arm").pose for one in (m, exact)]
            np.testing.assert_allclose(*poses, atol=1e-15)


@pytest.mark.parametrize("tol", [0, -1e-3, 0.5, "small", np.nan, True])
def test_bad_tolerances(tol: object) -> None:
    m = mg.load("four-bar")
    for call in (
        lambda: m.replace(tol=tol),
        lambda: mg.check(m, tol=tol),
        lambda: mg.kinematics(m, {"A": 0.1}, tol=tol),
        lambda: m.snapped(tol),
    ):
        with pytest.raises(mg.DeclarationError, match="tol"):
            call()
