"""Redundant reactions split by stiffness, and forces that misfits lock in. Closed forms: springs in parallel; a rigid plate on springs."""

import numpy as np
import pytest
import scipy

import mechgraph as mg

Z = (0, 0, 1)
WEIGHT = 30 * 9.81


def door(k: tuple[float, float] = (2e6, 1e6), misfit: float = 0.0) -> mg.Mechanism:
    """A door on two hinges that bear moments by their distance alone."""
    hinges = [
        mg.Pair(name, "R", "frame", "door", point=(0, 0, z), axis=Z, stiffness={"Fx": 1e7, "Fy": 1e7, "Fz": ki, "Mx": 0, "My": 0},
                misfit={"Fz": off})
        for name, z, ki, off in (("A", 0.2, k[0], misfit), ("B", 1.6, k[1], 0.0))
    ]  # fmt: skip
    links = [mg.Link("frame"), mg.Link("door", 30.0, (0.4, 0, 0.9))]
    return mg.Mechanism("door", links, hinges, ["A"], [mg.Gravity((0, 0, -9.81))])


def feet(
    k: list[float], center: tuple[float, float] = (0.0, 0.0), misfit: float = 0.0, closed: str = "form"
) -> mg.Mechanism:
    """A table on four feet at (+-1, +-1) on a floor, kept in place by a pair Fr that bears nothing but what holds it still."""
    at = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    floor = [
        mg.Pair(f"f{i}", "Sp", "floor", "table", point=(x, y, 0), axis=Z, stiffness={"Fz": ki}, misfit={"Fz": misfit if i == 0 else 0.0},
                closed=closed, radius=None)
        for i, ((x, y), ki) in enumerate(zip(at, k, strict=True))
    ]  # fmt: skip
    links = [mg.Link("floor"), mg.Link("table", 30.0, (*center, 0.7))]
    guide = mg.Pair("guide", "Fr", "floor", "table", point=(0, 0, 0), axis=Z)
    drives = ["guide.Rz", "guide.Tx", "guide.Ty"]
    return mg.Mechanism("table", links, [*floor, guide], drives, [mg.Gravity((0, 0, -9.81))])


def loads(s: mg.Solution) -> np.ndarray:
    return np.array([s[f"f{i}"].components["Fz"] for i in range(4)])


@pytest.mark.parametrize("engine", ["auto", "dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler"])
def test_two_hinges_share_as_springs_in_parallel(engine: str, method: str) -> None:
    s = mg.solve(door(), {"A": [0.0, 0.4]}, redundant="elastic", engine=engine, method=method)
    assert np.allclose(s["A"].components["Fz"], WEIGHT * 2 / 3, rtol=1e-11)
    assert np.allclose(s["B"].components["Fz"], WEIGHT / 3, rtol=1e-11)
    assert np.allclose(s["A"].components["Fx"][0], WEIGHT * 0.4 / 1.4, rtol=1e-11)
    assert np.abs(s.checks.equilibrium).max() < 1e-12


def test_a_misfit_locks_in_springs_in_series() -> None:
    s = mg.solve(door(misfit=1e-4), {"A": [0.0, 0.4]}, redundant="elastic")
    locked = 1e-4 * 2e6 * 1e6 / 3e6
    assert np.allclose(s["A"].locked_in["Fz"], locked, rtol=1e-11)
    assert np.allclose(s["B"].locked_in["Fz"], -locked, rtol=1e-11)
    assert np.allclose(s["A"].components["Fz"], WEIGHT * 2 / 3 + locked, rtol=1e-11)
    # both hinges follow the same door
    assert np.allclose(s["A"].deflection["Fz"], s["B"].deflection["Fz"], rtol=1e-9)
    assert np.allclose(s["A"].deflection["Fz"], 1e-4 - (WEIGHT * 2 / 3 + locked) / 2e6, rtol=1e-9)
    assert np.allclose(s.misfit_sensitivity["B.Fz"]["A.Fz"], -locked / 1e-4, rtol=1e-11)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_coupling_bears_what_a_spring_beside_it_locks_in(engine: str) -> None:
    """Two blocks at equal heights by a rigid coupling ``A - B = 0`` and by a foot of stiffness k that is e too long: it bears k e."""
    k, e, weight = 1e5, 2e-3, 50.0
    links = [mg.Link("frame"), mg.Link("a"), mg.Link("b")]
    foot = mg.Pair("foot", "Sp", "a", "b", point=(0, 0, 0), axis=(0, 1, 0), stiffness={"Fz": k}, misfit={"Fz": e})
    slides = [mg.Pair(n, "P", "frame", n.lower(), point=(0, 0, 0), axis=(0, 1, 0)) for n in "AB"]
    same = mg.Coupling({"A": 1.0, "B": -1.0}, name="same")
    down = mg.Wrench("b", force=(0, -weight, 0), point=(0, 0, 0))
    m = mg.Mechanism("blocks", links, [*slides, foot], ["A"], [down], couplings=[same])
    s = mg.solve(m, {"A": [0.0, 0.3]}, redundant="elastic", engine=engine)
    pressed = s["foot"].components["Fz"]
    assert np.allclose(np.abs(pressed), k * e)
    assert np.allclose(s["A"].effort[:, 0], weight)
    # b is in balance: what the coupling gives it, the foot and its load
    assert np.allclose(-s.coupling("same").effort + pressed, weight)


def test_a_component_of_no_stiffness_carries_nothing() -> None:
    s = mg.solve(door((2e6, 0.0)), {"A": [0.2]}, redundant="elastic")
    assert s["A"].components["Fz"][0] == pytest.approx(WEIGHT, rel=1e-11)
    assert abs(s["B"].components["Fz"][0]) < 1e-10
    both = mg.solve(door((0.0, 0.0)), {"A": [0.2]}, redundant="elastic")
    assert np.isnan(both["A"].components["Fz"]).all()


def test_what_rigid_components_share_stays_unknown() -> None:
    m = door()
    rigid = m.replace(pairs=[p.replace(stiffness={"Mx": 0, "My": 0}) for p in m.pairs])
    s = mg.solve(rigid, {"A": [0.2]}, redundant="elastic")
    assert np.isnan(s["A"].components["Fz"]).all()
    assert s["A"].components["Fx"][0] == pytest.approx(WEIGHT * 0.4 / 1.4 * np.cos(0.2), rel=1e-11)


def test_equal_stiffness_everywhere_is_the_least_norm() -> None:
    """k for forces, k L^2 for moments: the measure of ``minimum_norm``."""
    m = mg.load("four-bar")
    given = {"A": mg.Motion([0.3, 1.0], velocity=5.0)}
    s = mg.solve(m, given, redundant="minimum_norm")
    L = s._values.radius
    k = {f"F{x}": 1e6 for x in "xyz"} | {f"M{x}": 1e6 * L**2 for x in "xyz"}
    pairs = [p.replace(stiffness={name: k[name] for name in p.type.component_names}) for p in m.pairs]
    e = mg.solve(m.replace(pairs=pairs), given, redundant="elastic")
    for p in m.pairs:
        for name, value in s[p.name].components.items():
            scale = max(np.abs(v).max() for v in s[p.name].components.values())
            assert np.allclose(e[p.name].components[name], value, rtol=1e-9, atol=1e-9 * scale)


@pytest.mark.parametrize("k", [[1e6, 1e6, 1e6, 1e6], [1e6, 2e6, 3e6, 4e6]])
def test_four_feet(k: list[float]) -> None:
    """A rigid plate on springs: three equations of balance, and no twist: ``sum t_i (F_i / k_i - misfit_i) = 0``."""
    m = feet(k, (0.2, -0.1), 1e-4)
    s = mg.solve(m, dict.fromkeys((d.freedom for d in m.drives), 0.0), redundant="elastic")
    t, x, y = np.array([1, -1, 1, -1]), np.array([1, -1, -1, 1]), np.array([1, 1, -1, -1])
    A = np.stack([np.ones(4), x, y, t / np.array(k)])
    expected = np.linalg.solve(A, [WEIGHT, 0.2 * WEIGHT, -0.1 * WEIGHT, 1e-4])
    assert np.allclose(loads(s), expected, rtol=1e-10)


def test_a_foot_lifts() -> None:
    """A foot 2 mm short lifts: the others carry the table as on three feet, without and with misfit."""
    m = feet([1e6] * 4, (-0.3, -0.2), -2e-3, closed="force")
    s = mg.solve(m, dict.fromkeys((d.freedom for d in m.drives), 0.0), redundant="elastic")
    A = np.stack([np.ones(3), [-1, -1, 1], [1, -1, -1]])
    expected = np.linalg.solve(A, [WEIGHT, -0.3 * WEIGHT, -0.2 * WEIGHT])
    assert abs(loads(s)[0]) < 1e-9 * WEIGHT
    assert np.allclose(loads(s)[1:], expected, rtol=1e-9)
    held = feet([1e6] * 4, (-0.3, -0.2), -2e-3)
    pulled = mg.solve(held, dict.fromkeys((d.freedom for d in m.drives), 0.0), redundant="elastic")
    assert loads(pulled)[0] < 0


def test_the_note_for_a_drawing() -> None:
    (note,) = [n for n in mg.check(door()).misfits if set(n.coefficients) == {"A.Fz", "B.Fz"}]
    assert note.coefficients == pytest.approx({"A.Fz": 1.0, "B.Fz": -1.0})
    assert note.force_per_unit == pytest.approx(2e6 / 3)
    # moments with stiffness 0 are borne by nothing, so that nothing has to cancel there
    assert not any("M" in name for one in mg.check(door()).misfits for name in one.coefficients)
    plates = mg.check(feet([1e6] * 4)).misfits
    assert {round(c) for c in plates[0].coefficients.values()} == {1, -1}
    assert plates[0].force_per_unit == pytest.approx(1e6 / 4)
    assert "these errors must cancel" in plates[0].text


def test_a_study_over_misfits() -> None:
    result = mg.study(
        door(misfit=1e-5),
        {"A.misfit.Fz": [0.0, 1e-4]},
        {"F": lambda s: s["A"].components["Fz"]},
        motions={"A": [0.0]},
        redundant="elastic",
        sampling="grid",
    )
    assert np.allclose(
        result.outputs["F"][:, 0], WEIGHT * 2 / 3 + result.parameters["A.misfit.Fz"] * 2e6 / 3, rtol=1e-9
    )


def test_files_units_and_faults(tmp_path) -> None:
    m = door(misfit=1e-4)
    mg.save(m, tmp_path / "door.toml")
    assert mg.load(tmp_path / "door.toml") == m
    mm = m.replace(units={"length": "m", "mass": "kg", "time": "s"}).to_units(length="mm", mass="t")
    assert mm.pairs[0].stiffness.Fz == pytest.approx(2e3)
    assert mm.pairs[0].misfit.Fz == pytest.approx(0.1)
    s = mg.solve(mm, {"A": [0.3]}, redundant="elastic")
    assert s["A"].locked_in["Fz"][0] == pytest.approx(1e-4 * 2e6 / 3, rel=1e-9)
    pair = m.pairs[0]
    for bad, words in (
        ({"Fq": 1.0}, "Fq"),
        ({"Mz": 1.0}, "Mz is no reaction component of R"),
        ({"Fz": -1.0}, r"stiffness\.Fz"),
    ):
        with pytest.raises(mg.DeclarationError, match=words):
            m.replace(pairs=[pair.replace(stiffness=bad), m.pairs[1]])
    with pytest.raises(mg.DeclarationError, match="redundant='elastic'"):
        mg.solve(door(), {"A": [0.0]}).misfit_sensitivity  # noqa: B018


def test_a_door_moves_as_its_hinges_give_way() -> None:
    """The twist of a rigid body whose points at both hinges move by the deflections there, from closed forms of these."""
    s = mg.solve(door(misfit=1e-4), {"A": [0.0]}, redundant="elastic")
    across, down = WEIGHT * 0.4 / 1.4 / 1e7, 1e-4 - (WEIGHT * 2 / 3 + 1e-4 * 2e6 / 3) / 2e6
    turn = 2 * across / 1.4
    assert s.link("door").displacement[0] == pytest.approx([0, turn, 0, -across - 0.2 * turn, 0, down], abs=1e-15)
    assert not s.link("frame").displacement.any()
    # least-norm reactions contradict the stiffness: no motion of the door belongs to them
    with pytest.warns(mg.MechgraphWarning, match="left out"):
        other = mg.solve(door(misfit=1e-4), {"A": [0.0]}, redundant="minimum_norm")
    assert np.isnan(other.link("door").displacement).any()


def test_a_table_sinks_and_tilts() -> None:
    m = feet([1e6, 2e6, 3e6, 4e6], (0.2, -0.1), 1e-4)
    s = mg.solve(m, dict.fromkeys((d.freedom for d in m.drives), 0.0), redundant="elastic")
    turn_x, turn_y, _, *_, down = s.link("table").displacement
    for i, (x, y) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        assert down + turn_x * y - turn_y * x == pytest.approx(s[f"f{i}"].deflection["Fz"], rel=1e-9)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_the_tip_of_a_four_bar_moves_by_the_work_of_a_unit_load(engine: str) -> None:
    """Determinate in the plane: a force on the coupler and soft pins; the work of the force is twice the energy in the pins."""
    m = mg.load("four-bar").to_planar()
    soft = [p.replace(stiffness={"Fx": 1e5, "Fy": 3e5}) for p in m.pairs]
    push = mg.Wrench("coupler", force=(3.0, -2.0), point=(0, 0))
    s = mg.solve(m.replace(pairs=soft, loads=[push]), {"A": [0.7, 1.2]}, engine=engine)
    twist, r = s.link("coupler").displacement, s.link("coupler").point((0, 0, 0)).position
    moved = twist[:, 3:] + np.cross(twist[:, :3], np.broadcast_to(r, twist[:, 3:].shape))
    work = moved @ [3.0, -2.0, 0.0]
    energy = sum(s[p.name].components[c] ** 2 / k for p in soft for c, k in (("Fx", 1e5), ("Fy", 3e5)))
    assert work == pytest.approx(energy, rel=1e-9)


def test_a_table_tips_over() -> None:
    """Its weight beyond the line through two feet: no feet that push bear it. Other positions of the batch are not touched."""
    m = feet([1e6] * 4, (0.3, 0.2), closed="force")
    x = mg.Wrench("table", force=np.array([[0, 0, 0], [900.0, 0, 0], [50.0, 0, 0]]), point=(0, 0, 0.7))
    m = m.replace(loads=[*m.loads, x])
    at = dict.fromkeys((d.freedom for d in m.drives), [0.0] * 3)
    s = mg.solve(m, at, redundant="elastic")
    assert s.status.tolist() == ["ok", "lifts off", "ok"]
    assert np.isnan(loads(s)[:, 1]).all()
    assert np.isfinite(loads(s)[:, [0, 2]]).all()
    (note,) = s.warnings
    assert (note.status, note.positions, note.pairs) == ("lifts off", (1,), ("f0", "f1", "f2", "f3"))
    assert "f0, f1, f2, f3 only push and cannot bear the loads" in str(note)
    assert "closed='form'" in " ".join(str(s).split())


def test_feet_lift_beside_what_stays_unknown() -> None:
    """Two rigid stops share what presses across them, unknown: that does not keep a short foot from lifting."""
    m = feet([1e6] * 4, (-0.3, -0.2), -2e-3, closed="force")
    stops = [mg.Pair(name, "Sp", "floor", "table", point=(1, 0, 0), axis=(0, 1, 0)) for name in ("one", "two")]
    m = m.replace(pairs=[*m.pairs, *stops], drives=["guide.Tx", "guide.Rz"])
    s = mg.solve(m, {"guide.Tx": 0.0, "guide.Rz": 0.0}, redundant="elastic")
    assert np.isnan(s["one"].components["Fz"])
    assert abs(loads(s)[0]) < 1e-9 * WEIGHT
    assert loads(s)[1:].sum() == pytest.approx(WEIGHT, rel=1e-9)


def test_results_do_not_hang_on_other_positions() -> None:
    m = feet([1e6, 2e6, 3e6, 4e6], (-0.3, -0.2), -1e-4, closed="force")
    push = mg.Wrench("table", force=np.array([[0, 0, 0], [0, 0, -1e9]]), point=(0, 0, 0))
    at = dict.fromkeys((d.freedom for d in m.drives), np.zeros(2))
    both = mg.solve(m.replace(loads=[*m.loads, push]), at, redundant="elastic")
    alone = mg.solve(m, dict.fromkeys(at, 0.0), redundant="elastic")
    assert loads(both)[:, 0] == pytest.approx(loads(alone), rel=1e-12, abs=1e-12 * WEIGHT)


def test_misfits_that_are_left_out_are_told() -> None:
    for redundant in ("nan", "minimum_norm"):
        with pytest.warns(mg.MechgraphWarning, match=r"misfits of A\.Fz are left out"):
            s = mg.solve(door(misfit=1e-4), {"A": [0.0]}, redundant=redundant)
        assert "misfits of A.Fz" in str(s)
    with pytest.warns(mg.MechgraphWarning, match="left out"):
        study = mg.study(door(), {"A.misfit.Fz": [0.0, 1e-4]}, "A.effort", motions={"A": [0.0]}, sampling="grid")
    assert "left out" in str(study)


def test_misfits_with_tolerances_give_bounds() -> None:
    """Misfits within +-h at both hinges: the split moves by at most 2 h k1 k2 / (k1 + k2), the worst case of the study."""
    h, k = 5e-5, 2e6 / 3
    both = {f"{name}.misfit.Fz": scipy.stats.uniform(-h, 2 * h) for name in "AB"}
    m = door()
    m = m.replace(pairs=[m.pairs[0], m.pairs[1].replace(misfit={"Fz": 0.0})])
    study = mg.study(m, both, "A:Fz", n=24, sampling="latin", seed=1, motions={"A": [0.0]}, redundant="elastic")
    F = study.outputs["A:Fz"][:, 0]
    off = study.parameters["A.misfit.Fz"] - study.parameters["B.misfit.Fz"]
    assert pytest.approx(WEIGHT * 2 / 3 + k * off, rel=1e-9) == F
    low, high = study.worst_case("A:Fz")
    assert (low[0], high[0]) == pytest.approx((WEIGHT * 2 / 3 - 2 * h * k, WEIGHT * 2 / 3 + 2 * h * k), rel=1e-6)
    assert ((low <= F) & (high >= F)).all()
    soft = mg.study(
        m, {"B.stiffness.Fz": [1e6, 4e6]}, "A:Fz", sampling="grid", motions={"A": [0.0]}, redundant="elastic"
    )
    assert soft.outputs["A:Fz"][:, 0] == pytest.approx(WEIGHT * np.array([2 / 3, 1 / 3]), rel=1e-9)
