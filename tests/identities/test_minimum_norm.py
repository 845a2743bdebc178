"""``redundant="minimum_norm"``: the same reactions in any unit, frame, method and engine; least by a second formulation."""

import importlib

import numpy as np
import pytest
import scipy

import mechgraph as mg

Z = (0, 0, 1)
ANGLES = {"A": np.array([0.1, 0.5])}
OPTIONS = [{"engine": e, "method": f} for e in ("dense", "sparse") for f in ("loop_wrench", "newton_euler", "printed")]


def wheels(*couplings: mg.Coupling, drives: tuple[str, ...] = ("A",)) -> mg.Mechanism:
    """Two wheels on the frame, geared; 3 is given on the second."""
    return mg.Mechanism("wheels", pairs=[
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "two", point=(1, 0, 0), axis=Z),
    ], couplings=couplings, drives=drives, loads=[mg.Effort("B", 3.0)])  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS)
def test_drivers_that_strain_each_other_without_reactions_share_by_least_effort(options: dict) -> None:
    """Both wheels driven: with no coupling force each motor holds its own wheel, 0 and -3."""
    m = wheels(mg.Coupling({"A": 2.0, "B": -3.0}, name="g"), drives=("A", "B"))
    s = mg.solve(m, {"A": [0.0, 0.3], "B": [0.0, 0.2]}, redundant="minimum_norm", **options)
    np.testing.assert_allclose(s["A"].effort[:, 0], 0, atol=1e-12)
    np.testing.assert_allclose(s["B"].effort[:, 0], -3, atol=1e-12)
    np.testing.assert_allclose(s.coupling("g").effort, 0, atol=1e-12)
    assert s.checks.equilibrium.max() < 1e-14


@pytest.mark.parametrize("options", OPTIONS)
def test_couplings_that_say_the_same_twice_share_one_force(options: dict) -> None:
    """The motor has to supply -2; the couplings of which only 2 m1 + 4 m2 = 2 is known are found, whatever the engine, and balance."""
    m = wheels(mg.Coupling({"A": 2.0, "B": -3.0}, name="g1"), mg.Coupling({"A": 4.0, "B": -6.0}, name="g2"))
    s = mg.solve(m, {"A": [0.0, 0.3]}, redundant="minimum_norm", **options)
    np.testing.assert_allclose(s["A"].effort[:, 0], -2, rtol=1e-12)
    np.testing.assert_allclose([s.coupling("g1").effort, s.coupling("g2").effort], [[0.5] * 2, [0.25] * 2], rtol=1e-10)
    assert s.checks.equilibrium.max() < 1e-14


@pytest.mark.parametrize("drives", [("A",), ("A", "D")])
def test_both_engines_and_methods_give_the_same_reactions_and_efforts(drives: tuple[str, ...]) -> None:
    m = mg.load("four-bar").replace(drives=drives)
    rocker = mg.kinematics(mg.load("four-bar"), ANGLES)["D"].position[:, 0]
    given = {**ANGLES, "D": rocker} if len(drives) > 1 else ANGLES
    first, *others = (mg.solve(m, given, redundant="minimum_norm", **options) for options in OPTIONS)
    for other in others:
        for p in m.pairs:
            np.testing.assert_allclose(other[p.name].reaction, first[p.name].reaction, atol=1e-12)
            np.testing.assert_allclose(other[p.name].effort, first[p.name].effort, atol=1e-12)


def test_a_drive_more_than_needed_leaves_the_least_reactions_as_they_are() -> None:
    """A wheel geared to the crank and driven too: that strain is of efforts alone, those of the redundant four-bar are of reactions."""
    m = mg.load("four-bar")
    wheel = mg.Pair("W", "R", m.frame, "wheel", point=(0.5, 0, 0), axis=Z)
    push = mg.Wrench(m.links[2].name, force=(1.0, 2.0, 3.0), moment=(0.1, 0.2, 0.3), point=(0, 0, 0))
    m = m.replace(
        links=[*m.links, mg.Link("wheel")],
        pairs=[*m.pairs, wheel],
        couplings=[mg.Coupling({"A": 1.0, "W": -2.0}, name="g")],
        loads=[*m.loads, push],
    )
    one, two = (
        mg.solve(m.replace(drives=drives), {name: part * ANGLES["A"] for name, part in given}, redundant="minimum_norm")
        for drives, given in ((["A"], [("A", 1.0)]), (["A", "W"], [("A", 1.0), ("W", 0.5)]))
    )
    for p in m.pairs:
        np.testing.assert_allclose(two[p.name].reaction, one[p.name].reaction, atol=1e-12)


def test_no_self_stress_makes_them_smaller() -> None:
    """Second formulation: scipy's least squares on the sum of |F|^2 + |M / L|^2 at the pair points over all self-stresses."""
    m = mg.load("four-bar")
    s = mg.solve(m, {"A": 0.5}, redundant="minimum_norm")
    # lengths over L, the RMS distance of pair points and mass centers from their middle at the start
    at = np.array([p.point for p in m.pairs] + [link.center for link in m.links if link.mass])
    L = np.sqrt(((at - at.mean(axis=0)) ** 2).sum(axis=1).mean())
    state, rows, parts = s.state(()), [], []
    moving = [link.name for link in m.links if link.name != m.frame]
    for k, p in enumerate(m.pairs):
        W = state.reactions[k][:, :, 0]
        point = s.link(p.b).point(p.markers[1].point).position
        parts.append(np.vstack([(W[:3] - np.cross(point, W[3:].T).T) / L, W[3:]]))
        rows.append(np.vstack([((p.b == name) - (p.a == name)) * W for name in moving]))
    A, weights = np.hstack(rows), scipy.linalg.block_diag(*parts)
    found = np.concatenate([list(s[p.name].components.values()) for p in m.pairs])
    drive = np.zeros((len(A), 1))
    drive[6 * moving.index("crank") : 6 * moving.index("crank") + 6] = np.array([[0.0], [0], [1], [0], [0], [0]])
    null = scipy.linalg.null_space(np.hstack([A, drive]), rcond=1e-10)[:-1]
    assert null.shape[1] == 3
    y = scipy.linalg.lstsq(weights @ null, -weights @ found)[0]
    np.testing.assert_allclose(y, 0, atol=1e-9 * np.abs(found).max())


def test_they_are_the_same_in_any_unit_and_frame() -> None:
    """In mm, and turned and moved away: the same forces, and moments a thousand times as large."""
    m = mg.load("four-bar")
    s = mg.solve(
        m, ANGLES, redundant="minimum_norm", loads=[mg.Wrench("coupler", force=(1.0, 2.0, 3.0), point=(0.5, 0.2, 0.1))]
    )
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = (
        scipy.spatial.transform.Rotation.from_rotvec([0.3, -1.0, 0.7]).as_matrix(),
        (30.0, -20.0, 10.0),
    )
    loaded = m.replace(loads=[mg.Wrench("coupler", force=(1.0, 2.0, 3.0), point=(0.5, 0.2, 0.1))])
    moved = mg.solve(loaded.moved(X), ANGLES, redundant="minimum_norm")
    scaled = mg.solve(loaded.to_units(length="mm"), ANGLES, redundant="minimum_norm")
    size = max(np.abs(s[p.name].force).max() for p in m.pairs)
    for p in m.pairs:
        for name, value in s[p.name].components.items():
            np.testing.assert_allclose(moved[p.name].components[name], value, atol=1e-9 * size)
        force = np.linalg.norm(s[p.name].force, axis=-1)
        ratio = np.linalg.norm(scaled[p.name].force, axis=-1) / np.where(force > 0, force, 1.0)
        moments = np.linalg.norm(scaled[p.name].moment, axis=-1)
        np.testing.assert_allclose(
            moments, 1000 * ratio * np.linalg.norm(s[p.name].moment, axis=-1), atol=1e-6 * size * ratio.max()
        )


@pytest.mark.parametrize("options", OPTIONS)
def test_a_gear_between_cranks_that_turn_alike_anyway_shares_by_the_least_reactions(options: dict) -> None:
    """A parallelogram whose cranks are geared too: a strain of reactions and of the coupling, the same by any method; it does no work."""
    pairs = [
        mg.Pair(name, "R", *on, point=(*at, 0), axis=Z)
        for name, on, at in (
            ("A", ("frame", "crank"), (0, 0)),
            ("B", ("crank", "rod"), (0.3, 1)),
            ("C", ("rod", "rocker"), (2.3, 1)),
            ("D", ("frame", "rocker"), (2, 0)),
        )
    ]
    push = mg.Wrench("rod", force=(1, 2, 3), moment=(0.1, 0.2, 0.3), point=(0, 0, 0))
    geared = mg.Mechanism(
        "parallelogram",
        pairs=pairs,
        couplings=[mg.Coupling({"A": 1.0, "D": -1.0}, name="g")],
        drives=["A"],
        loads=[push],
    )
    s, first = (mg.solve(geared, {"A": [0.0, 0.2]}, redundant="minimum_norm", **o) for o in (options, OPTIONS[0]))
    alone = mg.solve(geared.replace(couplings=[]), {"A": [0.0, 0.2]}, redundant="minimum_norm")
    np.testing.assert_allclose(s["A"].effort, alone["A"].effort, atol=1e-12)
    np.testing.assert_allclose(s.coupling("g").effort, first.coupling("g").effort, atol=1e-12)
    norm = [sum((r[p].reaction ** 2).sum() for p in "ABCD") for r in (s, alone)]
    assert norm[0] < 0.999 * norm[1]
    assert s.checks.equilibrium.max() < 1e-12


@pytest.mark.parametrize(("engine", "probes"), [("dense", 12), ("sparse", 12), ("sparse", 2)])
@pytest.mark.parametrize(("h", "M"), [(1.0, -3.0), (1.0, 3.0), (4.0, -3.0)])
def test_wheels_between_cranks_that_turn_alike_anyway_bear_on_the_flank_that_spares_the_bearings(
    h, M, engine, probes, monkeypatch
):
    """Cranks of length h with wheels of radius 1/2 and an idler between them; the rod has F = (tau - M) / h, teeth 2 tau across the line
    of centers and 2 |tau| tan(alpha) along it: F^2 + (F + 2 |tau| tan(alpha))^2 + 12 tau^2 is least at M (p + q) / h / (p^2 + q^2 + 12),
    p = 1 / h, q = p + 2 s tan(alpha), if that has the sign s; of long cranks on neither flank, so that teeth bear nothing. Also where
    there are more self-stresses than the sparse engine has at hand.
    """
    monkeypatch.setattr(importlib.import_module("mechgraph.kinematics.solver"), "PROBES", probes)
    ends = [
        ("A", "frame", "a", (0, 0, 0)),
        ("B", "a", "c", (0, h, 0)),
        ("C", "c", "b", (2, h, 0)),
        ("D", "frame", "b", (2, 0, 0)),
        ("I", "frame", "idler", (1, 0, 0)),
    ]
    alpha, pairs = np.deg2rad(20), [mg.Pair(n, "R", a, b, point=at, axis=(0, 0, 1)) for n, a, b, at in ends]
    gears = [mg.SpurGears(f"{n} I", n, "I", teeth=(20, 20), pressure_angle=alpha, module=0.05) for n in "AD"]
    loads = [mg.Wrench("b", moment=(0, 0, -M))]
    m = mg.Mechanism("cranks", None, pairs, ["A"], loads, couplings=gears)
    s = mg.solve(m, {"A": [0.0]}, redundant="minimum_norm", engine=engine)
    p, q = 1 / h, 1 / h + 2 * np.sign(M) * np.tan(alpha)
    tau = M * p * (p + q) / (p * p + q * q + 12)
    tau = tau if tau * M > 0 else 0.0
    along = p * (tau - M) + 2 * abs(tau) * np.tan(alpha)
    np.testing.assert_allclose(s["C"].force, [[p * (tau - M), 0.0, 0.0]], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(s["D"].force, [[-along, 2 * tau, 0.0]], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(s["A"].force, [[along, 2 * tau, 0.0]], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(s["I"].force, [[0.0, -4 * tau, 0.0]], rtol=1e-6, atol=1e-6)
