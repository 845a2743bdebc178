"""Dry friction in kinetostatics against the formulas of textbooks.

Screws, collars: J. E. Shigley and C. R. Mischke, Mechanical Engineering Design, 1989, chapter 8. Friction circle: J. E. Shigley and J. J.
Uicker, Theory of Machines and Mechanisms, 1995, chapter 13.
"""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import mechgraph as mg

Z, Y, X = (0, 0, 1), (0, 1, 0), (1, 0, 0)
MU, RADIUS = 0.2, 0.02
RHO = RADIUS * np.sin(np.arctan(MU))
W = 100.0


def moved(m: mg.Mechanism, rate: float = 1.0, **more: object) -> mg.Solution:
    return mg.solve(m, {m.drives[0].freedom: mg.Motion(0.0, velocity=rate)}, **more)


def shaft(*forces: mg.Wrench, **friction: object) -> mg.Mechanism:
    pin = mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=Z)
    dry = mg.Friction("A", **{"mu": MU, "radius": RADIUS, **friction})
    return mg.Mechanism("shaft", [mg.Link("frame"), mg.Link("wheel")], [pin], ["A"], [*forces, dry])


def force(x: float, y: float, at: tuple[float, float, float], link: str = "wheel") -> mg.Wrench:
    return mg.Wrench(link, force=(x, y, 0), point=at)


@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
@pytest.mark.parametrize("engine", ["dense", "sparse", "auto"])
def test_pulley(engine: str, method: str) -> None:
    """Parallel ropes at R: P/W = (R + rho)/(R - rho) when the load rises, its inverse when it sinks."""
    R = 0.1
    P = W * (R + RHO) / (R - RHO)
    for rate, pull in ((1.0, P), (-1.0, W * W / P)):
        s = moved(shaft(force(0, -W, (R, 0, 0)), force(0, -pull, (-R, 0, 0))), rate, engine=engine, method=method)
        assert abs(s["A"].effort[0]) < 1e-11
        assert s["A"].friction[0] == pytest.approx(-rate * RHO * (W + pull), rel=1e-12)
        assert abs(s.checks.power) < 1e-12
        assert s["A"].normal_forces[0] == pytest.approx(W + pull)


def test_bell_crank() -> None:
    """Ropes at right angles: (P b - W a)^2 = rho^2 (P^2 + W^2)."""
    a, b = 0.1, 0.15
    P = max(np.roots([b * b - RHO**2, -2 * a * b * W, (a * a - RHO**2) * W * W]))
    s = moved(shaft(force(0, -W, (a, 0, 0)), force(-P, 0, (0, b, 0))))
    assert abs(s["A"].effort[0]) < 1e-11


def test_the_whole_reaction_or_its_normal_part() -> None:
    circle, total = (moved(shaft(force(0, -W, (0, 0, 0)), model=model))["A"].effort[0] for model in ("circle", "total"))
    assert total / circle == pytest.approx(np.hypot(1.0, MU), rel=1e-12)


@pytest.mark.parametrize("a", [0.0, 0.02, 0.05, 0.2])
def test_a_load_beside_a_bearing_of_some_length(a: float) -> None:
    b = 0.1
    s = moved(shaft(force(0, -W, (0, 0, a)), length=b))
    assert s["A"].effort[0] == pytest.approx(RHO * W * max(1.0, 2 * a / b), rel=1e-12)


def test_a_collar_bears_the_axial_force() -> None:
    s = moved(shaft(mg.Wrench("wheel", force=(0, 0, -W), point=(0, 0, 0)), thrust_radius=0.03))
    assert s["A"].effort[0] == pytest.approx(MU * 0.03 * W, rel=1e-12)


def test_a_collar_alone_rubs_by_the_axial_force() -> None:
    """Roller bearings aside it needs no radius of a journal; a radial force beside it is told to rub nothing."""
    dry = mg.Friction("A", mu=MU, thrust_radius=0.03)
    m = shaft(mg.Wrench("wheel", force=(0, 0, -W), point=(0, 0, 0))).replace(loads=[])
    axial = mg.Wrench("wheel", force=(0, 0, -W), point=(0, 0, 0))
    s = moved(m, loads=[axial, dry])
    assert s["A"].effort[0] == pytest.approx(MU * 0.03 * W, rel=1e-12)
    assert not s.warnings
    (note,) = moved(m, loads=[axial, force(5.0, 0, (0, 0, 0)), dry]).warnings
    assert "a radial force of up to 5 rubs nothing; give radius=" in str(note)
    with pytest.raises(mg.DeclarationError, match="radius: type R turns"):
        m.replace(loads=[mg.Friction("A", mu=MU, thrust_radius=0.03, length=0.1)])


def jack(mu: float = 0.1, flank: float = 0.0, pitch: float = 0.002, **more: object) -> mg.Mechanism:
    screw = mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=Z, pitch=pitch)
    dry = mg.Friction("A", mu=mu, radius=0.01, flank=flank, **more)
    return mg.Mechanism(
        "jack",
        [mg.Link("frame"), mg.Link("nut")],
        [screw],
        ["A"],
        [mg.Wrench("nut", force=(0, 0, -W), point=(0, 0, 0)), dry],
    )


@pytest.mark.parametrize("flank", [0.0, np.deg2rad(15)])
@pytest.mark.parametrize("pitch", [0.002, -0.002, 0.0005])
def test_screw(flank: float, pitch: float) -> None:
    """W r tan(lead +- phi); efficiency tan(lead) / tan(lead + phi), below one half where it locks."""
    lead = np.arctan(abs(pitch) / 0.01)
    phi = np.arctan(0.1 / np.cos(np.arctan(np.tan(flank) * np.cos(lead))))
    up, down = (moved(jack(flank=flank, pitch=pitch), np.sign(pitch) * way) for way in (1, -1))
    assert np.sign(pitch) * up["A"].effort[0] == pytest.approx(W * 0.01 * np.tan(lead + phi), rel=1e-12)
    assert np.sign(pitch) * down["A"].effort[0] == pytest.approx(W * 0.01 * np.tan(lead - phi), rel=1e-9)
    efficiency = up.efficiency("loads[0]")
    assert efficiency == pytest.approx(np.tan(lead) / np.tan(lead + phi), rel=1e-12)
    assert abs(up.checks.power) < 1e-12
    assert up.losses["A"] == pytest.approx(-up["A"].friction[0] * up["A"].velocity[0])
    still = mg.solve(jack(flank=flank, pitch=pitch), {"A": 0.0})
    assert bool(still.self_locking) == (lead < phi)
    if lead < phi:
        assert efficiency < 0.5


def collar(mu: float, e: float = 0.2, b: float = 0.1) -> mg.Mechanism:
    """A collar on a guide, lifted by a pusher at e beside it."""
    pairs = [
        mg.Pair("A", "P", "frame", "collar", point=(0, 0, 0), axis=Z),
        mg.Pair("D", "P", "frame", "pusher", point=(e, 0, -1), axis=Z),
        mg.Pair("K", "Sp", "pusher", "collar", point=(e, 0, 0), axis=Z),
    ]
    links = [mg.Link(name) for name in ("frame", "collar", "pusher")]
    loads = [mg.Wrench("collar", force=(0, 0, -W), point=(0, 0, 0)), mg.Friction("A", mu=mu, length=b)]
    return mg.Mechanism("collar", links, pairs, ["D"], loads)


def test_a_collar_lifted_beside_its_guide_jams() -> None:
    """P = W / (1 - 2 mu e / b); it jams from e = b / (2 mu) on."""
    assert moved(collar(0.2))["D"].effort[0] == pytest.approx(W / (1 - 0.8), rel=1e-11)
    for mu in (0.2501, 0.3, 1.0):
        with pytest.raises(mg.FrictionError, match="jams") as error:
            moved(collar(mu))
        assert (error.value.kind, error.value.factor) == ("jams", pytest.approx(0.25 / mu, rel=1e-9))
        assert error.value.places == ("A",)
        assert moved(collar(mu), on_reach="flag").status == "jams"
    one = mg.Motion([0.0, 0.0], velocity=[1.0, -1.0])
    both = mg.solve(collar(0.3), {"D": one}, on_reach="flag")
    assert both.status.tolist() == ["jams", "ok"]
    assert abs(both.checks.equilibrium[1]) < 1e-12
    assert abs(both.checks.power[1]) < 1e-12


def test_a_jammed_position_is_told_and_drawn() -> None:
    """What jams, and from which part of the friction on; the picture says it and greys the links that do not."""
    pytest.importorskip("matplotlib")
    from matplotlib.colors import to_hex

    from mechgraph import show

    m = collar(0.3)
    s = mg.solve(m, {"D": mg.Motion([0.0, 0.1], velocity=[1.0, -1.0])}, on_reach="flag")
    assert s.status.tolist() == ["jams", "ok"]
    assert s.jams == {0: (pytest.approx(0.25 / 0.3, rel=1e-9), ("A",))}
    ax, free = show.draw_skeleton(s, 0, forces=True), show.draw_skeleton(s, 1, forces=True)
    assert ax.get_title() == "jams: A\nfrom 0.833 of its friction on"
    assert not free.get_title()
    colors = [{text.get_text(): to_hex(text.get_color()) for text in one.texts} for one in (ax, free)]
    assert [colors[0][link] == colors[1][link] for link in ("pusher", "collar")] == [False, True]


def test_a_guide_that_is_embraced_or_embraces() -> None:
    """The friction of a shoe acts at the side of the guide; that of two shoes that press on opposite sides cancels but for the width."""
    for w in (0.02, -0.02):
        m = collar(0.1).replace(
            loads=[
                mg.Wrench("collar", force=(0, 0, -W), point=(0, 0, 0)),
                mg.Friction("A", mu=0.1, length=0.1, width=w),
            ]
        )
        s = moved(m)
        # both shoes press on opposite sides, F = M / b each: the couples of their friction cancel but for the width
        n = s["A"].normal_forces[..., :2]
        P, arm = s["D"].effort[0], 0.2
        assert pytest.approx(0.1 * n.sum(), rel=1e-11) == P - W
        assert abs(n[..., 0] - n[..., 1]).max() < 1e-9
        # about the axis of the guide: P e = F b + mu F w / 2 - mu F w / 2
        assert P * arm == pytest.approx(n[..., 0].item() * 0.1, rel=1e-11)


def test_a_shaft_that_turns_is_pulled_along() -> None:
    w, v = 10.0, 0.05
    pair = mg.Pair("A", "C", "frame", "shaft", point=(0, 0, 0), axis=Z)
    dry = mg.Friction("A", mu=MU, radius=RADIUS)
    m = mg.Mechanism(
        "shaft",
        pairs=[pair],
        drives=["A.Rz", "A.Tz"],
        loads=[mg.Wrench("shaft", force=(30.0, 0, 0), point=(0, 0, 0)), dry],
    )
    s = mg.solve(m, {"A.Rz": mg.Motion(0.0, velocity=w), "A.Tz": mg.Motion(0.0, velocity=v)})
    speed = np.hypot(v, RADIUS * w)
    N = 30 / np.hypot(1.0, MU * RADIUS * w / speed)
    assert s["A"].effort == pytest.approx([MU * N * RADIUS**2 * w / speed, MU * N * v / speed], rel=1e-12)


def test_a_ball_rubs_against_its_angular_velocity() -> None:
    """A conical pendulum on a ball held by its drive: the couple is rho |F| against the angular velocity."""
    pairs = [
        mg.Pair("S", "S", "frame", "arm", point=(0, 0, 0)),
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, -1), axis=Z),
        mg.Pair("B", "Sg", "crank", "arm", point=(0.2, 0, -1), axis=X),
    ]
    links = [mg.Link("frame"), mg.Link("arm", 2.0, (0.1, 0, -0.5)), mg.Link("crank")]
    m = mg.Mechanism("cone", links, pairs, ["A"], [mg.Gravity((0, 0, -9.81))])
    dry = mg.Friction("S", mu=MU, radius=RADIUS)
    smooth, rough = (moved(m, 5.0, loads=loads) for loads in (m.loads, [*m.loads, dry]))
    V = rough.link("arm").angular_velocity
    lost = RHO * np.linalg.norm(rough["S"].force) * np.linalg.norm(V)
    assert rough.losses["S"] == pytest.approx(lost, rel=1e-11)
    assert (rough["A"].effort - smooth["A"].effort) * 5.0 == pytest.approx(lost, rel=1e-9)
    assert abs(rough.checks.power) < 1e-12


def slider_crank() -> mg.Mechanism:
    """Crank 0.05, rod 0.15, stretched at the start, pushed back and down at the piston."""
    r, l = 0.05, 0.15
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "crank", "rod", point=(r, 0, 0), axis=Z),
        mg.Pair("C", "R", "rod", "piston", point=(r + l, 0, 0), axis=Z), mg.Pair("D", "P", "frame", "piston", point=(r + l, 0, 0), axis=X),
    ]  # fmt: skip
    push = mg.Wrench("piston", force=(-1000.0, -50.0, 0), point=(r + l, 0, 0))
    return mg.Mechanism("slider-crank", pairs=pairs, drives=["A"], loads=[push])


def test_slider_crank_rough_everywhere() -> None:
    """What the crank brings is what the load takes and what is lost; dT/dmu at 0 = sum of the normal forces times their speeds, over w."""
    w, m = 20.0, slider_crank()
    push = m.loads[0]
    given = {"A": mg.Motion(np.linspace(0.2, 6.0, 40), velocity=w)}

    def rough(mu: float) -> mg.Solution:
        dry = [mg.Friction(name, mu=mu, radius=0.01) for name in "ABC"] + [mg.Friction("D", mu=mu)]
        return mg.solve(m, given, loads=[push, *dry])

    smooth, s, tiny = mg.solve(m, given), rough(0.1), rough(1e-7)
    lost = sum(s.losses.values())
    assert (lost > 0).all()
    assert np.allclose(s["A"].effort[:, 0] * w + s.load(0).power, lost, rtol=1e-11)
    assert np.abs(s.checks.power).max() < 1e-12
    slope = sum(0.01 * smooth[k].magnitude * np.abs(smooth[k].velocity[:, 0]) for k in "ABC")
    slope = slope + smooth["D"].magnitude * np.abs(smooth["D"].velocity[:, 0])
    assert np.allclose(
        (tiny["A"].effort - smooth["A"].effort)[:, 0] / 1e-7, slope / w, rtol=1e-4, atol=1e-6 * slope.max() / w
    )


def test_a_block_on_a_belt_is_pulled_across() -> None:
    """Force mu N v / hypot(v, belt) against the pull."""
    v, belt = 0.03, 0.4
    pairs = [
        mg.Pair("B", "P", "frame", "belt", point=(0, 0, 0), axis=X), mg.Pair("E", "E", "belt", "block", point=(0, 0, 0), axis=Z),
        mg.Pair("H", "Fr", "frame", "block", point=(0, 0, 0), axis=Z),
    ]  # fmt: skip
    loads = [mg.Wrench("block", force=(0, 0, -W), point=(0, 0, 0)), mg.Friction("E", mu=MU)]
    m = mg.Mechanism("belt", pairs=pairs, drives=["B", "H.Tx", "H.Ty", "H.Rz"], loads=loads)
    s = mg.solve(m, {"B": mg.Motion(0.0, velocity=belt), "H.Tx": 0.0, "H.Ty": mg.Motion(0.0, velocity=v), "H.Rz": 0.0})
    pull = dict(zip(m.pair("H").freedom_names, s["H"].effort, strict=True))
    assert pull["H.Ty"] == pytest.approx(MU * W * v / np.hypot(v, belt), rel=1e-12)
    assert pull["H.Tx"] == pytest.approx(-MU * W * belt / np.hypot(v, belt), rel=1e-12)


def test_a_plate_pressed_beside_its_middle() -> None:
    """It turns about the origin, pressed at distance c from it: friction acts at the center of pressure, c away."""
    c, w = 0.12, 3.0
    pairs = [mg.Pair("E", "E", "frame", "plate", point=(0, 0, 0), axis=Z)]
    loads = [mg.Wrench("plate", force=(0, 0, -W), point=(c, 0, 0.3)), mg.Friction("E", mu=MU, radius=0.05)]
    m = mg.Mechanism("plate", pairs=pairs, drives=["E.Tx", "E.Ty", "E.Rz"], loads=loads)
    s = mg.solve(m, {"E.Tx": 0.0, "E.Ty": 0.0, "E.Rz": mg.Motion(0.0, velocity=w)})
    speed = np.hypot(c, 0.05)
    assert s["E"].effort == pytest.approx([0.0, MU * W * c / speed, MU * W * (c * c + 0.05**2) / speed], abs=1e-11)
    assert abs(s.checks.power) < 1e-12


@pytest.mark.parametrize("name", ["geneva", "phchc", "r-cp-c", "r-sc-c-r", "r-sg-c", "rcsr"])
def test_friction_given_as_efforts_brings_the_same_forces(name: str) -> None:
    m = mg.load(name)
    dry = [
        mg.Friction(p.name, mu=0.05, **({"radius": 0.01} if p.type.symbol in "RCUSH" else {}))
        for p in m.pairs
        if not p.roller
    ]
    s = mg.solve(m, loads=[*m.loads, *dry], on_reach="flag")
    good = s.status == "ok"
    assert good.sum() > 20
    t = mg.solve(m, loads=[*m.loads, *given_back(m, s)], on_reach="flag")
    name = m.drives[0].freedom.partition(".")[0]
    assert np.allclose(
        t[name].effort[good], s[name].effort[good], rtol=1e-11, atol=1e-12 * np.nanmax(np.abs(s[name].effort))
    )
    assert all((power[good] >= 0).all() for power in s.losses.values())
    assert np.nanmax(np.abs(s.checks.power)) < 1e-13


def test_links_swapped_moved_and_in_other_units() -> None:
    m = collar(0.2)
    swapped = m.replace(pairs=[m.pairs[0].replace(a="collar", b="frame"), *m.pairs[1:]])
    assert moved(swapped)["D"].effort[0] == pytest.approx(moved(m)["D"].effort[0], rel=1e-11)
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = 0.3, -0.2, 0.5
    assert moved(m.moved(pose))["D"].effort[0] == pytest.approx(moved(m)["D"].effort[0], rel=1e-11)
    si = jack().replace(units={"length": "m", "mass": "kg", "time": "s"})
    mm = si.to_units(length="mm", mass="t")
    assert moved(mm)["A"].effort[0] == pytest.approx(1e3 * moved(si)["A"].effort[0], rel=1e-11)


def test_friction_of_what_is_not_unique_is_not_determined() -> None:
    bearings = [
        mg.Pair(k, "R", "frame", "shaft", point=(0, 0, z), axis=Z) for k, z in (("A", 0.0), ("B", 0.3), ("C", 0.5))
    ]
    dry = [mg.Friction(k, mu=MU, radius=RADIUS) for k in "ABC"]
    m = mg.Mechanism(
        "shaft", pairs=bearings, drives=["A"], loads=[mg.Wrench("shaft", force=(W, 0, 0), point=(0, 0, 0.2)), *dry]
    )
    s = moved(m)
    assert s.status == "friction not determined"
    assert np.isnan(s["A"].effort).all()
    least = moved(m, redundant="minimum_norm")
    forces = sum(np.hypot(least[k].components["Fx"], least[k].components["Fy"]) for k in "ABC")
    assert least["A"].effort[0] == pytest.approx(RHO * forces, rel=1e-9)
    soft = m.replace(
        pairs=[p.replace(stiffness=dict.fromkeys(("Fx", "Fy", "Fz"), 1e7) | {"Mx": 0, "My": 0}) for p in m.pairs]
    )
    couples = []
    for misfit in (0.0, 1e-5, 1e-4):
        seats = [p.replace(misfit={"Fx": misfit}) if p.name == "B" else p for p in soft.pairs]
        elastic = moved(soft.replace(pairs=seats), redundant="elastic")
        forces = sum(np.hypot(elastic[k].components["Fx"], elastic[k].components["Fy"]) for k in "ABC")
        couples.append(elastic["A"].effort[0])
        assert couples[-1] == pytest.approx(RHO * forces, rel=1e-9)
        # three springs along a rigid shaft without friction: two equations of balance, and no bending
        F = np.linalg.solve([[1, 1, 1], [0, 0.3, 0.5], [0.2, -0.5, 0.3]], [-W, -0.2 * W, -0.5 * 1e7 * misfit])
        across = RHO * np.abs(F).sum()
        assert couples[-1] == pytest.approx(across, rel=1e-9)
    assert couples[2] > 3 * couples[0]


def test_a_planar_mechanism_in_space_rubs_without_locked_in_forces() -> None:
    """Redundant out of the plane, where loads bring nothing: friction is that of the plane."""
    m = mg.load("four-bar")
    dry = [mg.Friction(p.name, mu=0.1, radius=0.02) for p in m.pairs]
    given = {"A": mg.Motion([0.3, 1.0], velocity=5.0)}
    s = mg.solve(m, given, loads=[*m.loads, *dry])
    flat = m.to_planar()
    t = mg.solve(flat, given, loads=[*flat.loads, *dry])
    assert (s.status == "ok").all()
    assert np.allclose(s["A"].effort, t["A"].effort, rtol=1e-10)


def test_at_rest_any_effort_between_holds() -> None:
    m = shaft(force(0, -W, (0.01, 0, 0)), static=0.3)
    s = mg.solve(m, {"A": 0.0})
    rho = RADIUS * np.sin(np.arctan(0.3))
    assert s["A"].effort[0] == pytest.approx(W * 0.01)
    assert s["A"].effort_range[0] == pytest.approx([W * (0.01 - rho), W * (0.01 + rho)], rel=1e-11)
    assert not s.self_locking
    assert s["A"].sticks
    with pytest.raises(mg.DeclarationError, match="in motion"):
        assert moved(m).self_locking
    assert mg.solve(shaft(force(0, -W, (0.001, 0, 0))), {"A": 0.0}).self_locking
    low, high = mg.solve(collar(0.3), {"D": 0.0})["D"].effort_range[0]
    assert (low, high) == (pytest.approx(W / (1 + 1.2), rel=1e-11), np.inf)


def geared() -> mg.Mechanism:
    """A wheel that friction holds back more than its load drives it."""
    pins = [
        mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=Z)
        for k, link, x in (("A", "pinion", 0.0), ("B", "wheel", 0.06))
    ]
    loads = [
        mg.Effort("B", -0.1),
        mg.Wrench("wheel", force=(300, 0, 0), point=(0.06, 0, 0)),
        mg.Friction("B", mu=0.1, radius=0.02),
    ]
    gears = mg.SpurGears("t", "A", "B", teeth=(20, 40), module=0.002)
    return mg.Mechanism("gears", pairs=pins, couplings=[gears], drives=["A"], loads=loads)


@pytest.mark.parametrize("engine", ["dense", "auto"])
def test_friction_may_turn_the_force_between_teeth_round(engine: str) -> None:
    """The teeth touch on the other flank."""
    s = moved(geared(), engine=engine)
    # the couple on the wheel: friction rho |F| against its turn (the other way than the pinion's), the load, the tooth force at 0.04
    rho, turn, F = (
        0.02 * np.sin(np.arctan(0.1)),
        np.array([np.sin(np.deg2rad(20)), np.cos(np.deg2rad(20))]),
        np.zeros(2),
    )
    for _ in range(100):
        tooth = (rho * np.hypot(*F) - 0.1) / 0.04
        F = -np.array([300.0, 0.0]) - np.array([abs(tooth) * turn[0] / turn[1], tooth])
    assert s["A"].effort[0] == pytest.approx(0.02 * tooth, rel=1e-9)
    assert np.allclose(s["B"].force[:2], F, rtol=1e-9)
    assert np.abs(mg.free_body(s, "wheel").sum).max() < 1e-9


def test_ends_at_rest_are_the_efforts_of_both_motions_on_the_flanks_of_each() -> None:
    ends = [moved(geared(), rate)["A"].effort[0] for rate in (-1.0, 1.0)]
    assert mg.solve(geared(), {"A": 0.0})["A"].effort_range[0] == pytest.approx(ends, rel=1e-12)
    assert ends[0] < 0 < ends[1]


def given_back(m: mg.Mechanism, s: mg.Solution) -> list[mg.Effort]:
    """The friction of a solution as given efforts."""
    efforts = [(q, s[p.name].friction[..., j]) for p in m.pairs for j, q in enumerate(p.freedom_names)]
    return [mg.Effort(q, np.nan_to_num(of)) for q, of in efforts if np.nan_to_num(of).any()]


@pytest.mark.parametrize("torque", [3.0, -3.0])
def test_gears_on_balls_touch_on_either_flank(torque: float) -> None:
    """Shafts in a ball and a ball in a groove: relations from the poses, of which the load chooses the flank."""
    pairs, gears = [], []
    for x, name, teeth in ((0.0, "a", 20), (0.06, "b", 40)):
        pairs += [
            mg.Pair(f"{name}S", "S", "frame", name, point=(x, 0, -0.04)),
            mg.Pair(f"{name}G", "Sg", "frame", name, point=(x, 0, 0.06), axis=Z),
            mg.Pair(f"{name}F", "Fr", "frame", name, point=(x, 0, 0), axis=Z),
        ]
        gears.append(mg.Gear(name, name, teeth, (x, 0, 0), Z, module=0.002))
    dry = [mg.Friction(f"{k}S", mu=0.2, radius=0.01) for k in "ab"]
    m = mg.Mechanism("balls", pairs=pairs, gears=gears, couplings=[mg.Mesh("t", "a", "b")], drives=["aF.Rz"])
    given = {"aF.Rz": mg.Motion([0.0, 0.7], velocity=2.0)}
    s = mg.solve(m, given, loads=[mg.Effort("bF.Rz", torque), *dry])
    t = mg.solve(m, given, loads=[mg.Effort("bF.Rz", torque), *given_back(m, s)])
    for k in "ab":
        assert np.linalg.norm(s[f"{k}S"].force - t[f"{k}S"].force, axis=1).max() < 1e-10
        assert (s.losses[f"{k}S"] > 0.01).all()
    assert s["aF"].effort[:, -1] == pytest.approx(t["aF"].effort[:, -1], rel=1e-11)
    assert np.abs(s.checks.power).max() < 1e-12


def test_belts_with_pretension_rub_in_their_bearings() -> None:
    """The tensions keep their mean, so that the bearings carry the pretension and the friction that follows from it."""
    pairs = [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=Z) for k, x in (("p", 0.0), ("w", 0.5))]
    m = mg.Mechanism(
        "belt", pairs=pairs, drives=["p"], gears=[mg.Pulley(k, k, (x, 0, 0), Z, radius=0.05) for k, x in (("p", 0.0), ("w", 0.5))],
        couplings=[mg.BeltDrive("B", over=["p", "w"], pretension=300.0)],
    )  # fmt: skip
    s = moved(m, loads=[mg.Friction(k, mu=MU, radius=RADIUS) for k in "pw"])
    assert sum(s.coupling("B").tension.values()) == pytest.approx(600.0)
    assert s["w"].normal_forces == pytest.approx(600.0)
    assert s["p"].effort == pytest.approx(2 * RHO * 600.0)


@pytest.mark.parametrize("k", [(1e6, 1e6, 1e6, 1e6), (1e6, 2e6, 3e6, 4e6)])
def test_a_table_is_dragged_on_four_elastic_feet(k: tuple[float, ...]) -> None:
    """Rigid plate on springs, mu N at each: pulled at a height it leans over, by mu height; a foot lifts off; it tips over."""
    at, height = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]), 0.5
    plate = [
        mg.Pair(f"f{i}", "Sp", "ground", "plate", point=(x, y, 0), axis=Z, closed="force", stiffness={"Fz": k[i]})
        for i, (x, y) in enumerate(at)
    ]
    guide = mg.Pair("G", "Fr", "ground", "plate", point=(0, 0, height), axis=Z)

    def dragged(*center: float, rate: float = 1.0, mu: float = 0.3) -> mg.Solution:
        push = mg.Wrench("plate", force=(0, 0, -W), point=(*center, 0))
        dry = [mg.Friction(p.name, mu=mu) for p in plate]
        m = mg.Mechanism("plate", pairs=[*plate, guide], drives=["G.Tx", "G.Ty", "G.Rz"], loads=[push, *dry])
        motions = {"G.Tx": mg.Motion([0.0], velocity=rate), "G.Ty": 0.0, "G.Rz": 0.0}
        return mg.solve(m, motions, redundant="elastic", on_reach="flag")

    twist = np.array([1, -1, 1, -1]) / k
    lifts = 0
    for center in ((0.1, 0.2), (0.9, 0.8), (-0.6, 0.5), (0.3, -0.55)):
        for rate in (1.0, -1.0):
            x, y = center[0] + rate * 0.3 * height, center[1]
            s = dragged(*center, rate=rate)
            if abs(x) > 1.0:
                assert s.status == "lifts off"
                assert np.isnan(s["f0"].normal_forces).all()
                continue
            N = np.linalg.solve([np.ones(4), *at.T, twist], [W, x * W, y * W, 0.0])
            if N.min() < 0:  # on three feet
                lifts, left = lifts + 1, np.arange(4) != N.argmin()
                N[~left] = 0.0
                N[left] = np.linalg.solve([np.ones(3), *at[left].T], [W, x * W, y * W])
            assert [s[p.name].components["Fz"][0] for p in plate] == pytest.approx(N, rel=1e-10, abs=1e-10 * W)
            effort = dict(zip(guide.freedom_names, s["G"].effort[0], strict=True))
            assert effort["G.Tx"] == pytest.approx(0.3 * W * rate, rel=1e-10)
            assert effort["G.Rz"] == pytest.approx(-0.3 * rate * N @ at[:, 1], rel=1e-9)
            assert abs(s.checks.power[0]) < 1e-12 * W
    assert lifts > 1
    # it tips from mu = (1 - x) / height = 1.8 on; feet held down would jam from mu = 2 on, but they lift before
    assert [dragged(0.1, 0.2, mu=mu).status for mu in (1.75, 1.85, 2.1, 4.0)] == [
        "ok", "lifts off", "friction not determined", "friction not determined",
    ]  # fmt: skip
    assert not dragged(0.1, 0.2, mu=2.1).jams


def test_two_of_five_dragged_feet_stand_off() -> None:
    """By hand: 20, 30 and 50 N balance load and friction, the plane through their feet clears the others by 150 and 397 um."""
    feet = [(-0.4, 0.2, 6e-5), (0.4, -0.3, 0.0), (0.3, -0.5, 1e-4), (-0.6, 0.2, -1e-4), (-0.1, 0.5, 6e-5)]
    table = [
        mg.Pair(
            f"K{i}", "Sp", "frame", "table", point=(x, y, 0), axis=Z, closed="force", stiffness={"Fz": 1e6}, misfit={"Fz": off}
        )
        for i, (x, y, off) in enumerate(feet)
    ]  # fmt: skip
    guide = mg.Pair("G", "Fr", "frame", "table", point=(0, 0, 0.4), axis=Z)
    dry = [mg.Friction(p.name, mu=0.2) for p in table]
    load = mg.Wrench("table", force=(0, 0, -100), point=(0.04, 0.04, 0))
    m = mg.Mechanism("table", pairs=[*table, guide], drives=["G.Tx", "G.Ty", "G.Rz"], loads=[load, *dry])
    s = mg.solve(m, {"G.Tx": mg.Motion(0.0, velocity=1.0), "G.Ty": 0.0, "G.Rz": 0.0}, redundant="elastic")
    assert [s[p.name].components["Fz"] for p in table] == pytest.approx([0, 20, 30, 0, 50], abs=1e-9)


def test_preload_and_viscous() -> None:
    s = moved(shaft(force(0, -W, (0, 0, 0)), preload=50.0, viscous=0.7), 2.0)
    assert s.load(1).power == pytest.approx(-s.losses["A"], rel=1e-12)
    si = shaft(force(0, -W, (0, 0, 0)), viscous=0.7).replace(units={"length": "m", "mass": "kg", "time": "s"})
    mm = si.to_units(length="mm", mass="t")
    assert moved(mm, 2.0)["A"].effort[0] == pytest.approx(1e3 * moved(si, 2.0)["A"].effort[0], rel=1e-12)
    assert s["A"].effort[0] == pytest.approx(RHO * (W + 50.0) + 1.4, rel=1e-12)
    assert s.losses["A"] == pytest.approx(2.0 * s["A"].effort[0], rel=1e-12)


def test_no_friction_is_the_smooth_result() -> None:
    smooth, dry = (moved(collar(0.0).replace(loads=loads)) for loads in (collar(0.0).loads[:1], collar(0.0).loads))
    assert smooth["D"].effort == dry["D"].effort


def test_the_summary_tells_what_friction_costs() -> None:
    text = str(moved(jack(), 2.0))
    s = moved(jack(), 2.0)
    row = next(line.split() for line in text.splitlines() if line.startswith("A ") and "H" not in line.split())
    assert [float(row[1]), float(row[2])] == pytest.approx([W, float(s.losses["A"])], rel=1e-4)
    assert f"leaves {float(s.efficiency('loads[0]')):.5g}" in text
    rest = str(mg.solve(jack(), {"A": 0.0}))
    low, high = mg.solve(jack(), {"A": 0.0})["A"].effort_range[0]
    assert f"{low:.5g}" in rest.partition("holds at rest")[2]
    assert f"{high:.5g}" in rest.partition("holds at rest")[2]
    assert "Friction" not in str(mg.solve(jack(), {"A": 0.0}, loads=jack().loads[:1]))


def test_an_efficiency_names_drives_and_loads() -> None:
    s = moved(jack())
    assert s.efficiency("loads[0]", ["A"]) == s.efficiency("loads[0]", "A.Rz")
    for name in ("load[0]", "loads[7]", "Q"):
        with pytest.raises(mg.DeclarationError, match=r"unknown drive or load .*loads\[0\]"):
            s.efficiency(name)


def test_faults_and_files(tmp_path) -> None:
    m = jack()
    mg.save(m, tmp_path / "jack.toml")
    assert mg.load(tmp_path / "jack.toml") == m
    for more, words in (
        ({"of": "Q"}, "unknown pair 'Q'"), ({"mu": -0.1}, "mu = -0.1"), ({"static": 0.05}, "static"),
        ({"width": 0.1}, "width: has no meaning"),
        ({"radius": None}, "radius"), ({"mu": 8.0}, "no finite force"),
    ):  # fmt: skip
        given = {"of": "A", "mu": 0.1, "radius": 0.01, **more}
        with pytest.raises(mg.DeclarationError, match=words):
            m.replace(loads=[mg.Friction(given.pop("of"), **given)])
    with pytest.raises(mg.DeclarationError) as all_of_them:
        m.replace(
            loads=[mg.Friction("A", mu=0.3, static=0.1, radius=-1.0, width=0.1), mg.Friction("Q", mu=0.3, static=0.1)]
        )
    for words in (
        "static = 0.1: expected mu = 0.3 or more",
        "radius = -1.0",
        "width: has no meaning",
        "unknown pair 'Q'",
    ):
        assert words in str(all_of_them.value)
    assert str(all_of_them.value).count("expected mu = 0.3 or more") == 2
    heavy = m.replace(links=[mg.Link("frame"), mg.Link("nut", 1.0, (0, 0, 0), np.eye(3))], drives=[])
    with pytest.raises(mg.MechgraphError, match="leave it out here"):
        mg.equilibrium(heavy)
    weld = mg.Pair("A", "W", "frame", "b", point=(0, 0, 0))
    with pytest.raises(mg.DeclarationError, match="nothing of it rubs"):
        mg.Mechanism("w", pairs=[weld], loads=[mg.Friction("A", mu=0.1)])


def test_a_slow_position_does_not_depend_on_a_fast_one_beside_it() -> None:
    """Nor does a position at rest; where one freedom reverses it alone is at rest."""
    m = shaft(force(0, -W, (0, 0, 0)))
    s = mg.solve(m, {"A": mg.Motion([0.0, 0.0, 0.0], velocity=[1e-9, 1e3, 0.0])})
    assert s["A"].effort[:2, 0] == pytest.approx(RHO * W, rel=1e-12)
    assert s["A"].effort_range[2, 0] == pytest.approx([-RHO * W, RHO * W], rel=1e-12)
    crank = slider_crank()
    dry = [mg.Friction("D", mu=0.2), mg.Friction("A", mu=0.1, radius=0.01)]
    turn = mg.solve(crank, {"A": mg.Motion([0.0, 1e-6, 1.0], velocity=5.0)}, loads=[*crank.loads, *dry])
    assert turn["D"].friction[0, 0] == 0.0
    assert abs(turn["D"].friction[1, 0]) > 1.0
    assert (turn["A"].friction[:, 0] < 0).all()


def test_coefficients_that_fall_with_speed_and_vary_from_case_to_case() -> None:
    """mu + (static - mu) exp(-(s / v)^2); a study varies numbers of friction as solving every case does."""
    for rate in (0.5, 5.0):
        s = moved(shaft(force(0, -W, (0, 0, 0)), model="total", static=0.5, stribeck=0.05), rate)
        mu = MU + (0.5 - MU) * np.exp(-((rate * RADIUS / 0.05) ** 2))
        assert s["A"].effort[0] == pytest.approx(mu * RADIUS * W, rel=1e-12)
        assert s["A"].sliding == pytest.approx(rate * RADIUS)
        assert not s["A"].sticks
    m, given = shaft(force(0, -W, (0, 0, 0.3)), length=0.1), {"A": mg.Motion([0.0, 1.0], velocity=1.0)}
    values = {"loads[1].mu": [0.05, 0.3], "loads[1].length": [0.1, 0.2], "loads[1].preload": [0.0, 7.0]}
    found = mg.study(m, values, {"T": "A.effort"}, sampling="grid", motions=given)
    for at in range(8):
        one = {name.partition(".")[2]: float(found.parameters[name][at]) for name in values}
        t = mg.solve(m, given, loads=[m.loads[0], mg.Friction("A", radius=RADIUS, **one)])
        assert np.allclose(found.outputs["T"][at], t["A"].effort, rtol=1e-12)


def test_what_is_left_out_is_told() -> None:
    """Moments that rub nothing, circles of great friction, and before any load what friction rests on."""
    bent = moved(shaft(force(0, -W, (0, 0, 0.2))))
    (note,) = bent.warnings
    assert note.text.startswith("friction of A: a moment of up to 20 across the axis")
    assert "rubs nothing" in bent.summary()
    assert not moved(shaft(force(0, -W, (0, 0, 0.2)), length=0.1)).warnings
    assert not moved(shaft(force(0, -W, (0, 0, 0)))).warnings
    assert "4.4 %" not in moved(shaft(force(0, -W, (0, 0, 0)), mu=0.3)).summary()
    (note,) = moved(shaft(force(0, -W, (0, 0, 0)), mu=0.4)).warnings
    assert note.text == "friction of A: model='total' gives couples 7.7 % larger than the circle; say which is meant"
    assert not moved(shaft(force(0, -W, (0, 0, 0)), mu=0.4, model="total")).warnings
    doors = [mg.Pair(k, "R", "frame", "door", point=(0, 0, z), axis=Z) for k, z in (("A", 0.0), ("B", 1.0))]
    m = mg.Mechanism("door", pairs=doors, drives=["A"])
    for more, read in (
        ({}, "Fx, Fy, not"),
        ({"thrust_radius": 0.01}, "Fx, Fy, Fz, not"),
        ({"length": 0.01}, "Fx, Fy, Mx, My, not"),
    ):
        report = mg.check(m.replace(loads=[mg.Friction("B", mu=0.1, radius=0.01, **more)]))
        assert report.friction[0].startswith(f"friction of 'B' rests on {read} unique")
        assert report.friction[0] in " ".join(report.text(full=True).split())
    assert not mg.check(shaft()).friction


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_ball_rubs_in_its_slotted_cylinder(engine: str) -> None:
    """By hand: mu F against v + w x (-r n) of the point on the side to which the groove pushes, which slides along the axis alone."""
    r, mu, v, wy, wx, F = 0.03, 0.2, 0.1, -4.0, 5.0, np.array([30.0, -50.0])
    m = mg.Mechanism(
        "slot", pairs=[mg.Pair("K", "Sc", "frame", "ball", point=(0, 0, 0), axis=Z, radius=r)], drives=["K.Tz", "K.Ry", "K.Rx"],
        loads=[mg.Wrench("ball", force=(*F, 0), point=(0, 0, 0)), mg.Friction("K", mu=mu)],
    )  # fmt: skip
    rates = {"K.Tz": v, "K.Ry": wy, "K.Rx": wx}
    s = mg.solve(m, {name: mg.Motion(0.0, velocity=rate) for name, rate in rates.items()}, engine=engine)
    n = -F / np.linalg.norm(F)
    slip = v - r * (wx * n[1] - wy * n[0])
    f = -mu * np.linalg.norm(F) * np.sign(slip)
    assert s["K"].effort == pytest.approx([-f, -r * f * n[0], r * f * n[1]], rel=1e-13)
    assert s.losses["K"] == pytest.approx(-f * slip, rel=1e-13)


def test_several_drives_lock_together_where_one_friction_holds_them() -> None:
    """An arm of two rough pins, each with the couple of the load about it; a table of two slides on a slope; a block on a plane."""

    def arm(first: float, second: float) -> mg.Mechanism:
        pins = [
            mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "arm", "hand", point=(1, 0, 0), axis=Z),
        ]
        dry = [mg.Friction(k, mu=mu, radius=r) for k, mu, r in (("A", first, 5.0), ("B", second, 0.2))]
        load = mg.Wrench("hand", force=(0, -W, 0), point=(1.05, 0, 0))
        return mg.Mechanism("arm", pairs=pins, drives=["A", "B"], loads=[load, *dry])

    for first, second in ((0.5, 0.5), (0.5, 0.1), (0.2, 0.5), (0.2, 0.1)):
        holds = 5.0 * np.sin(np.arctan(first)) > 1.05 and 0.2 * np.sin(np.arctan(second)) > 0.05
        s = mg.solve(arm(first, second), {"A": [0.0, 0.0], "B": 0.0})
        assert s.self_locking.tolist() == [holds, holds]
    with pytest.raises(mg.DeclarationError, match="in motion"):
        assert mg.solve(arm(0.5, 0.5), {"A": mg.Motion(0.0, velocity=1.0), "B": 0.0}).self_locking

    def on_slope(pairs: list[mg.Pair], drives: list[str], *dry: mg.Friction) -> mg.Solution:
        links = [mg.Link("frame"), *(mg.Link(p.b, 1.0, (0, 0, 0)) for p in pairs)]
        m = mg.Mechanism("slope", links, pairs, drives, [mg.Gravity((0, 0, -9.81)), *dry])
        return mg.solve(m, dict.fromkeys(drives, 0.0))

    slope = 0.3
    down = (np.cos(slope), 0, -np.sin(slope))
    slides = [
        mg.Pair("D", "P", "frame", "slide", point=(0, 0, 0), axis=down),
        mg.Pair("E", "P", "slide", "table", point=(0, 0, 0), axis=Y),
    ]
    plate = [mg.Pair("E", "E", "frame", "plate", point=(0, 0, 0), axis=(np.sin(slope), 0, np.cos(slope)), second=Y)]
    for part, holds in ((0.99, False), (1.01, True)):
        mu = part * np.tan(slope)
        for across in (0.0, 0.1):
            s = on_slope(slides, ["D", "E"], mg.Friction("D", mu=mu), mg.Friction("E", mu=across))
            assert bool(s.self_locking) == holds
    freedoms = ["E.Tx", "E.Ty", "E.Rz"]
    assert on_slope(plate, freedoms, mg.Friction("E", mu=1.01 * np.tan(slope), radius=0.1)).self_locking
    assert not on_slope(plate, freedoms, mg.Friction("E", mu=0.5 * np.tan(slope), radius=0.1)).self_locking
    with pytest.raises(mg.DeclarationError, match="no friction is found that holds all drives at once, nor proved"):
        assert on_slope(plate, freedoms, mg.Friction("E", mu=0.9 * np.tan(slope), radius=0.1)).self_locking


def test_efforts_at_rest_are_told_to_be_without_friction() -> None:
    m = shaft(force(0, -W, (0, 0, 0)))
    told = [str(note) for note in mg.solve(m, {"A": mg.Motion([0.0, 0.1], velocity=[0.0, 1.0])}).warnings]
    assert any("no direction at 1 of 2 positions" in text and "velocity=" in text for text in told)
    assert not mg.solve(m, {"A": mg.Motion(0.0, velocity=1.0)}).warnings


@pytest.mark.parametrize("height", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("feet", [3, 4, 5])
def test_a_table_at_rest_slides_or_tips_first(feet: int, height: float) -> None:
    """Drawn at a height it slides at mu W, or tips where its weight and the pull, W e / height, meet the outline of its feet."""
    at = np.random.default_rng(feet).uniform(-1, 1, (feet, 2))
    center, mu = at.mean(axis=0), 0.4
    plate = [
        mg.Pair(f"f{i}", "Sp", "ground", "plate", point=(x, y, 0), axis=Z, closed="force", stiffness={"Fz": 1e6 * (1 + i)})
        for i, (x, y) in enumerate(at)
    ]  # fmt: skip
    guide = mg.Pair("G", "Fr", "ground", "plate", point=(0, 0, height), axis=Z)
    loads = [mg.Wrench("plate", force=(0, 0, -W), point=(*center, 0)), *(mg.Friction(p.name, mu=mu) for p in plate)]
    m = mg.Mechanism("plate", pairs=[*plate, guide], drives=["G.Tx", "G.Ty", "G.Rz"], loads=loads)
    s = mg.solve(m, dict.fromkeys(("G.Tx", "G.Ty", "G.Rz"), 0.0), redundant="nan" if feet == 3 else "elastic")
    outline = ConvexHull(at).equations  # n . x + c <= 0
    for name, n in (("G.Tx", outline[:, 0]), ("G.Ty", outline[:, 1])):
        room = -(outline[:, :2] @ center + outline[:, 2]) / n
        ends = [max(room[n < 0]), min(room[n > 0])]  # to the edges behind and ahead
        by_hand = np.clip(np.array(ends) / height, -mu, mu) * W
        assert s["G"].effort_range[guide.freedom_names.index(name)] == pytest.approx(by_hand, rel=1e-11)
    assert s.self_locking


def test_bearings_of_a_length_in_a_plane_bear_no_moment_that_is_locked_in() -> None:
    """Moments across the plane are not unique and no load adds to them: halves of the force at both ends, as one force; said in words."""
    loads = [mg.Wrench("slider", force=(-W, 0, 0), point=(0.4, 0, 0))]
    links = ("frame", "crank", "rod", "slider", "frame")
    at = zip("ABC", ((0, 0, 0), (0.1, 0, 0), (0.4, 0, 0)), links, links[1:], strict=False)
    pins = [mg.Pair(k, "R", a, b, point=p, axis=Z) for k, p, a, b in at]
    guide = mg.Pair("D", "P", "frame", "slider", point=(0.4, 0, 0), axis=X)
    efforts = []
    for length in (None, 0.1):
        dry = mg.Friction("A", mu=MU, radius=RADIUS, length=length)
        m = mg.Mechanism("slider-crank", pairs=[*pins, guide], drives=["A"], loads=[*loads, dry])
        s = mg.solve(m, {"A": mg.Motion([0.5], velocity=1.0)})
        efforts.append(float(s["A"].effort[0, 0]))
        assert ("no locked-in force" in " ".join(str(s).split())) == (length is not None)
        assert "by the friction circle, to which the whole reaction is tangent: A" in " ".join(str(s).split())
    assert efforts[1] == pytest.approx(efforts[0], rel=1e-12)
    # a load beside the plane adds to them
    aside = mg.Wrench("crank", force=(0, 0, 5.0), point=(0.1, 0, 0))
    s = mg.solve(m.replace(loads=[*m.loads, aside]), {"A": mg.Motion([0.5], velocity=1.0)})
    assert s.status[0] == "friction not determined"


def test_what_has_no_value_is_told_with_pairs_and_remedy() -> None:
    """Friction on reactions that are not unique, in motion and at rest; feet that tip; what is flagged; in ``s.warnings`` and in print."""
    pins = [mg.Pair(k, "R", "frame", "shaft", point=(0, 0, z), axis=Z) for k, z in (("A", 0.0), ("B", 0.3), ("C", 0.5))]
    dry = [mg.Friction(k, mu=MU, radius=RADIUS) for k in "ABC"]
    pull = mg.Wrench("shaft", force=(W, 0, 0), point=(0, 0, 0.2))
    m = mg.Mechanism("shaft", pairs=pins, drives=["A"], loads=[pull, *dry])
    s = mg.solve(m, {"A": mg.Motion([0.0, 0.0, 0.1], velocity=[1.0, 2.0, 0.0])})
    note, _, ends = s.warnings
    assert (note.status, note.positions, note.pairs) == ("friction not determined", (0, 1), ("A", "B", "C"))
    for words in ("A, B, C", "not unique", "redundant='elastic' with stiffness=", "2 of 3 positions", "A.Rz ="):
        assert words in str(note)
    assert "redundant='elastic'" in " ".join(str(s).split())
    # at rest the effort is that without friction; between which ends it holds is not known
    assert s.status[2] == "ok"
    assert s["A"].effort[2, 0] == 0.0
    assert "not known at 1 of 3 positions" in str(ends)
    with pytest.raises(mg.DeclarationError, match="no known ends of what holds it"):
        assert mg.solve(m, {"A": 0.1}).self_locking
    at = [(1, 1), (-1, 0), (1, -1)]
    feet = [
        mg.Pair(f"f{i}", "Sp", "frame", "plate", point=(x, y, 0), axis=Z, closed="force") for i, (x, y) in enumerate(at)
    ]
    slide = mg.Pair("G", "Fr", "frame", "plate", point=(0, 0, 0), axis=Z)
    loads = [mg.Wrench("plate", force=(0, 0, -W), point=(2.0, 0, 0)), *(mg.Friction(p.name, mu=MU) for p in feet)]
    table = mg.Mechanism("table", pairs=[*feet, slide], drives=["G.Tx", "G.Ty", "G.Rz"], loads=loads)
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        s = mg.solve(table, dict.fromkeys(("G.Tx", "G.Ty", "G.Rz"), 0.0))
    assert np.isnan(s["G"].effort_range[0]).all()
    assert "would have to pull there even without friction" in str(s.warnings[-1])
    with pytest.raises(mg.DeclarationError, match="no known ends of what holds it"):
        assert s.self_locking
    out = mg.solve(mg.load("rcsr"), {"O1": np.deg2rad(np.arange(150.0, 220.0))}, on_reach="flag")
    assert [note.status for note in out.warnings] == ["out of reach"]
    assert "another start" in str(out.warnings[0])
    (jam,) = (note for note in mg.solve(collar(0.3), {"D": mg.Motion(0.0, velocity=1.0)}, on_reach="flag").warnings)
    assert (jam.status, jam.pairs) == ("jams", ("A",))
    assert "longer guides" in str(jam)
