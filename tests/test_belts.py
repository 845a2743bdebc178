"""Belts over pulleys: lengths, wraps, tensions, tensioners, against closed forms."""

import contextlib
import pickle
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)
RADII = np.array([20, 40]) * 5 / (2 * np.pi)


def belt_length(places, radii):
    """Spans are tangents, sqrt(d^2 - (r_a - r_b)^2); arcs reach from the one to the next, counterclockwise where the radius is above 0."""
    total, headings = 0.0, []
    for a, b, ra, rb in zip(places, [*places[1:], places[0]], radii, [*radii[1:], radii[0]], strict=True):
        x, y = np.subtract(b, a)
        total += np.sqrt(x * x + y * y - (ra - rb) ** 2)
        headings.append(np.arctan2(y, x) + np.arcsin((ra - rb) / np.hypot(x, y)))
    turns = np.diff(headings, prepend=headings[-1])  # at the pulley from which a span leaves
    return total + sum(abs(r) * ((np.sign(r) * turn) % (2 * np.pi)) for r, turn in zip(radii, turns, strict=True))


# --- fixed centers -------------------------------------------------------------------------------------------------------


def pulleys(places, radii, axis=Z, **more):
    return [mg.Pulley(k, k, (*p, 0), axis, radius=r, **more) for (k, p), r in zip(places.items(), radii, strict=True)]


def hinges(places):
    return [mg.Pair(k, "R", "frame", k, point=(*p, 0), axis=Z) for k, p in places.items()]


TWO = {"p": (0.0, 0.0), "w": (0.2, 0.0)}


def drive(places=TWO, radii=(0.05, 0.05), drives=("p",), loads=(), pairs=(), links=None, **belt):
    belt.setdefault("over", list(places))
    return mg.Mechanism(
        "belt",
        links,
        [*hinges(places), *pairs],
        drives,
        loads,
        gears=pulleys(places, radii),
        couplings=[mg.BeltDrive("B", **belt)],
    )


@pytest.mark.parametrize("backs", [(), ("w",)])
def test_pulleys_turn_by_their_radii(backs):
    s = mg.solve(drive(radii=(0.05, 0.1), backs=backs), {"p": np.linspace(0, 20, 5)})
    np.testing.assert_allclose(s["w"].position[:, 0], np.linspace(0, 20, 5) * (-0.5 if backs else 0.5), atol=1e-10)
    assert abs(mg.check(s.mechanism).ratios["w.Rz"]["p.Rz"]) == pytest.approx(0.5)


@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler"])
@pytest.mark.parametrize("load", [7.0, -7.0])
def test_tensions_are_the_pretension_and_half_the_load(load, method):
    """T0 +- M / 2r, and the shafts feel both strands."""
    m = drive(pretension=300.0, loads=[mg.Effort("w", load)])
    s = mg.solve(m, {"p": [0.0, 1.0]}, method=method)
    tension = s.coupling("B").tension
    np.testing.assert_allclose(tension["p-w"], 300 + load / 0.1, rtol=1e-9)
    np.testing.assert_allclose(tension["w-p"], 300 - load / 0.1, rtol=1e-9)
    np.testing.assert_allclose(s["p"].effort[:, 0], -load, rtol=1e-9)
    np.testing.assert_allclose(s["w"].force[:, 0], 600.0, rtol=1e-9)
    np.testing.assert_allclose(s["p"].force[:, 0], -600.0, rtol=1e-9)
    assert mg.check(m).redundancy >= 1


def test_without_pretension_the_tensions_are_not_known_and_their_difference_is():
    m = drive(loads=[mg.Effort("w", 7.0)])
    bare = drive(pretension=0.0).replace(couplings=[])
    assert mg.check(m).redundancy == mg.check(bare).redundancy + 1
    s = mg.solve(m, {"p": 0.0})
    assert all(np.isnan(T) for T in s.coupling("B").tension.values())
    np.testing.assert_allclose(s["p"].effort[0], -7.0, rtol=1e-12)
    least = mg.solve(m, {"p": 0.0}, redundant="minimum_norm").coupling("B").tension
    np.testing.assert_allclose(least["p-w"] - least["w-p"], 7.0 / 0.05, rtol=1e-9)


def test_facts_of_a_solution():
    m = drive({"p": (0, 0), "w": (200, 0)}, RADII, toothed=False, pretension=100.0, loads=[mg.Effort("w", 1000.0)])
    b = mg.solve(m, {"p": [0.0, 1.0]}).coupling("B")
    np.testing.assert_allclose(b.length, 551.2672, atol=5e-5)
    np.testing.assert_allclose(np.rad2deg(b.wrap["p"]), 170.8714, atol=5e-5)
    np.testing.assert_allclose(b.span["p-w"], np.sqrt(200**2 - np.diff(RADII) ** 2).item(), rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(np.diff(b.ends["w-p"], axis=1), axis=-1)[:, 0], b.span["w-p"], rtol=1e-12)
    T = 100 + np.array([1, -1]) * 1000 / (2 * RADII[1])
    np.testing.assert_allclose(b.friction["p"], np.log(T[0] / T[1]) / b.wrap["p"], rtol=1e-9)
    assert "wrap p" in str(b)


def test_a_slack_span_is_a_warning():
    m = drive(pretension=30.0, loads=[mg.Effort("w", 7.0)])
    with pytest.warns(mg.MechgraphWarning, match="w-p is slack"):
        s = mg.solve(m, {"p": [0.0, 1.0]})
    (found,) = s.warnings
    assert found.force == pytest.approx(40.0)
    assert "w-p" in found.text
    assert "slack" in found.text
    assert np.isinf(s.coupling("B").friction["p"]).all()
    assert not mg.solve(m, {"p": [0.0]}, loads=[]).warnings


def test_a_slack_belt_is_one_warning():
    with pytest.warns(mg.MechgraphWarning, match="its spans w-i, i-p, p-w are slack") as told:
        s = mg.solve(tensioner([mg.Effort("arm", -12.0)]), {"p": [0.0, 1.0]})
    assert len(told) == len(s.warnings) == 1
    assert s.warnings[0].force == pytest.approx(-min(T.min() for T in s.coupling("B").tension.values()))


def test_names_that_there_are_not_are_told_with_those_there_are():
    s = mg.solve(drive(pretension=30.0), {"p": 0.0})
    belt = s.coupling("B")
    for ask, told in (
        (lambda: s.coupling("b"), "did you mean B"),
        (lambda: belt.tension["p-x"], "unknown span 'p-x'; did you mean p-w"),
        (lambda: belt.wrap["q"], r"unknown pulley 'q' \(pulleys: p, w\)"),
        (lambda: belt.friction["q"], "unknown pulley"),
        (lambda: s["p"].components["Fw"], r"unknown component 'Fw' \(components: Fx, Fy, Fz, Mx, My\)"),
    ):
        with pytest.raises(mg.DeclarationError, match=told):
            ask()
    assert "p-w" in belt.tension
    assert belt.tension.get("q") is None


# --- centers that move ---------------------------------------------------------------------------------------------------

ARM = mg.Pair("arm", "R", "frame", "arm", point=(0.35, 0.1, 0), axis=Z)
ON_ARM = mg.Pair("i", "R", "arm", "i", point=(0.2, 0.05, 0), axis=Z)
THREE = {"w": (0.4, 0.0), "i": (0.2, 0.05), "p": (0.0, 0.0)}


def tensioner(loads=(), drives=("p",), radii=(0.1, 0.04, 0.05), **belt):
    """An idler on an arm presses on the back of the upper strand."""
    places = {k: THREE[k] for k in ("w", "p")}
    return mg.Mechanism(
        "tensioner",
        None,
        [*hinges(places), ARM, ON_ARM],
        drives,
        loads,
        gears=pulleys(THREE, radii),
        couplings=[mg.BeltDrive("B", over=["w", "i", "p"], backs=["i"], **belt)],
    )


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
@pytest.mark.parametrize("load", [6.0, -6.0])
def test_a_tensioner_determines_the_tensions(load, method, engine):
    """Tension beside the idler: couple of the arm over the arms of both strands about its pivot, whatever the load."""
    couple = 12.0
    m = tensioner([mg.Effort("arm", couple), mg.Effort("w", load)])
    plain = mg.check(m.replace(couplings=[], drives=["p", "w", "i", "arm"]))
    assert mg.check(m).redundancy == plain.redundancy
    s = mg.solve(m, {"p": [0.0, 2.0, 30.0]}, method=method, engine=engine)
    b = s.coupling("B")
    pivot = np.array([0.35, 0.1, 0])
    moment = 0.0
    for name, sense in (("w-i", -1.0), ("i-p", 1.0)):
        start, end = b.ends[name][:, 0], b.ends[name][:, 1]
        u = (end - start) / b.span[name][:, None]
        moment = moment + sense * np.cross(start - pivot, u)[:, 2]
    expected = -couple / moment
    np.testing.assert_allclose(b.tension["w-i"], expected, rtol=1e-9)
    np.testing.assert_allclose(b.tension["i-p"], expected, rtol=1e-9)
    np.testing.assert_allclose(b.tension["p-w"], expected + load / 0.1, rtol=1e-9)
    np.testing.assert_allclose(b.length, b.length[0], rtol=1e-12)
    np.testing.assert_allclose(s["w"].position[:, 0], np.array([0, 1, 15.0]), atol=1e-9)
    strands = sum(
        sense * (b.ends[k][:, 1] - b.ends[k][:, 0]) / b.span[k][:, None] * b.tension[k][:, None]
        for k, sense in (("p-w", -1), ("w-i", 1))
    )
    np.testing.assert_allclose(s["w"].force, -strands, atol=1e-7)


def on_a_slide(links=None, drives=("x", "p"), loads=()):
    """The driven pulley on a slide, the idler on an arm: as one goes, the other must follow."""
    slide = mg.Pair("x", "P", "frame", "block", point=(0.4, 0, 0), axis=(1, 0, 0))
    on_block = mg.Pair("w", "R", "block", "w", point=(0.4, 0, 0), axis=Z)
    return mg.Mechanism(
        "slide",
        links,
        [slide, on_block, *hinges({"p": (0, 0)}), ARM, ON_ARM],
        drives,
        loads,
        gears=pulleys(THREE, (0.1, 0.04, 0.05)),
        couplings=[mg.BeltDrive("B", over=["w", "i", "p"], backs=["i"])],
    )


def test_the_arm_follows_the_length_of_the_belt():
    """A pulley on a slide moves by x: d psi / dx = -(dL/dx) / (dL/dpsi), L the length about pulleys anywhere."""
    m = on_a_slide()
    x = np.array([0.0, 0.004, 0.008])
    s = mg.solve(m, {"x": mg.Motion(x, 0.1, 0.3), "p": mg.Motion(0.5 * x, 0.0, 0.0)})

    def length(x, psi):
        turn = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
        idler = np.array([0.35, 0.1]) + turn @ [-0.15, -0.05]
        return belt_length([(0.4 + x, 0), idler, (0, 0)], [0.1, -0.04, 0.05])

    for k in range(3):
        psi, h = s["arm"].position[k, 0], 1e-6
        assert length(x[k], psi) == pytest.approx(length(0, 0), rel=1e-12)
        dx = (length(x[k] + h, psi) - length(x[k] - h, psi)) / (2 * h)
        dpsi = (length(x[k], psi + h) - length(x[k], psi - h)) / (2 * h)
        assert s["arm"].velocity[k, 0] == pytest.approx(-0.1 * dx / dpsi, rel=1e-7)
    # acceleration of the arm by differences of its rate along the same motion
    h = 1e-5
    near = [mg.solve(m, {"x": mg.Motion(0.004 + d * 0.1, 0.1 + d * 0.3), "p": mg.Motion(0.002, 0.0)}) for d in (-h, h)]
    change = (near[1]["arm"].velocity - near[0]["arm"].velocity) / (2 * h)
    np.testing.assert_allclose(s["arm"].acceleration[1], change[0] if change.ndim > 1 else change, rtol=1e-5)


def test_turns_count_on_flat_belts_whose_centers_move():
    """Many turns of the driver with a tensioner that moves: the driven pulley keeps the ratio of the radii (irrational)."""
    turns = np.linspace(0, 200.0, 41)
    s = mg.solve(tensioner([mg.Effort("arm", 12.0)]), {"p": turns})
    np.testing.assert_allclose(s["w"].position[:, 0], 0.5 * turns, atol=1e-8)
    np.testing.assert_allclose(s["i"].position[:, 0] + s["arm"].position[:, 0], -1.25 * turns, atol=1e-8)


@pytest.mark.slow
def test_a_serpentine_belt_is_checked_though_a_small_motion_would_let_pulleys_meet() -> None:
    """Five pulleys, two on the back, one of them on an arm: what is near its geometry is looked for without leaving the belt."""
    at = {
        "crank": (0, 0),
        "alternator": (0.2, 0.1),
        "idler": (0.125, 0.14),
        "steering": (0.02, 0.24),
        "pump": (-0.06, 0.13),
    }
    radii = (0.07, 0.03, 0.035, 0.06, 0.05)
    pairs = [mg.Pair(k, "R", "arm" if k == "idler" else "frame", k, point=p) for k, p in at.items()]
    m = mg.Mechanism(
        "serpentine belt",
        pairs=[*pairs, mg.Pair("arm", "R", "frame", "arm", point=(0.15, 0.21))],
        gears=[mg.Pulley(k, k, p, radius=r) for (k, p), r in zip(at.items(), radii, strict=True)],
        couplings=[mg.BeltDrive("belt", over=[*at], backs=["idler", "pump"], toothed=False)],
        drives=["crank"],
        loads=[mg.TorsionSpring("arm", stiffness=40.0, free=-1.0)],
        planar=True,
    )
    assert "Determinate (planar): 1 driver, 18 unknowns, 18 equations" in str(mg.check(m))


@pytest.mark.parametrize("turns_on_it", [False, True])
def test_a_pulley_on_an_eccentric_goes_round_and_round(turns_on_it):
    """A pulley 3 mm off its shaft: with every turn of that the arm returns, and a length 2 pi r of belt has passed."""
    places = {"w": (0.4, 0.0)}
    shaft = mg.Pair("e", "R", "frame", "e", point=(0, 0, 0), axis=Z)
    loose = [mg.Pair("p", "R", "e", "p", point=(0.003, 0, 0), axis=Z)] if turns_on_it else []
    gears = pulleys(THREE, (0.1, 0.04, 0.05))
    gears[2] = mg.Pulley("p", "p" if turns_on_it else "e", (0.003, 0, 0), Z, radius=0.05)
    with (
        contextlib.nullcontext()
        if turns_on_it
        else pytest.warns(mg.MechgraphWarning, match="'p' is 0.003 beside the axis of pair 'e'")
    ):
        m = mg.Mechanism(
            "eccentric", None, [*hinges(places), ARM, ON_ARM, shaft, *loose], ["e", "w"] if turns_on_it else ["e"], gears=gears,
            couplings=[mg.BeltDrive("B", over=["w", "i", "p"], backs=["i"])],
        )  # fmt: skip
    turn = np.linspace(0, 6 * np.pi, 49)
    s = mg.kinematics(m, {"e": turn, "w": 0.0} if turns_on_it else {"e": turn})
    arm = s["arm"].position[:, 0]
    np.testing.assert_allclose(arm[16:], arm[:-16], atol=1e-10)
    assert np.ptp(arm) > 0.05
    np.testing.assert_allclose(s.coupling("B").length, s.coupling("B").length[0], rtol=1e-11)
    turned = s["p"].position[:, 0] if turns_on_it else s["w"].position[:, 0]
    np.testing.assert_allclose(turned[::16], (-1.0 if turns_on_it else 0.5) * turn[::16], atol=1e-9)


def test_a_longer_belt_lets_the_arm_swing():
    plain = mg.solve(tensioner(), {"p": 0.0}).coupling("B").length
    m = tensioner(length=float(plain) - 1e-3)
    s = mg.solve(m, {"p": [0.0, 0.3]})
    np.testing.assert_allclose(s.coupling("B").length, float(plain) - 1e-3, rtol=1e-12)
    assert (np.abs(s["arm"].position) > 1e-3).all()


def test_a_length_that_no_place_of_the_arm_takes_is_told():
    with pytest.raises(
        mg.AssemblyError, match=r"Belt 'B' has the length 0.8, and its pulleys take 1.3 .* 0.499998 shorter"
    ):
        mg.solve(tensioner(length=0.8), {"p": 0.0})


def on_bearings(turns=True, teeth=False, **belt):
    """Two pulleys on shafts in a locating and a floating bearing each."""
    held = [mg.parts.bearings(f"b{k}", "frame", k, [(*p, -0.1), (*p, 0.1)], Z) for k, p in TWO.items()]
    held = held if turns else [mg.parts.Parts(pairs=part.pairs[:2]) for part in held]
    sizes = [{"teeth": n, "pitch": 0.005} if teeth else {"radius": 0.0025 * n} for n in (20, 40)]
    gears = [mg.Pulley(k, k, (*p, 0), Z, **size) for (k, p), size in zip(TWO.items(), sizes, strict=True)]
    drives, loads = (["bp.turn.Rz"], [mg.Effort("bw.turn.Rz", 7.0)]) if turns else ([], [])
    drive = mg.BeltDrive("B", over=["p", "w"], **belt)
    return mg.Mechanism("shafts", None, (), drives, loads, parts=held, gears=gears, couplings=[drive])


@pytest.mark.daily(2)
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler", "printed"])
def test_shafts_in_real_bearings_turn_and_share_the_tensions(method):
    """The row needs no hinge: turns are counted by the pair Fr beside the bearings; every bearing takes half of both strands."""
    m = on_bearings(pretension=300.0)
    assert mg.check(m).redundancy == 1
    s = mg.solve(m, {"bp.turn.Rz": [0.0, 5.0, 50.0]}, method=method)
    np.testing.assert_allclose(s["bw.turn"].position[:, 5], [0, 2.5, 25], atol=1e-9)
    np.testing.assert_allclose(s["bp.turn"].effort[:, 5], -3.5, rtol=1e-9)
    tension = s.coupling("B").tension
    np.testing.assert_allclose(tension["p-w"], 335.0, rtol=1e-9)
    lean = np.arcsin(0.05 / 0.2)
    half = 0.5 * np.array([600 * np.cos(lean), -70 * np.sin(lean), 0])
    for name in ("bw.1", "bw.2"):
        np.testing.assert_allclose(s[name].force, np.broadcast_to(half, (3, 3)), atol=1e-9)


def test_turns_that_nothing_counts_need_teeth():
    with pytest.raises(mg.DeclarationError, match="nothing counts the turns between the pulleys of p-w"):
        on_bearings(turns=False)
    assert mg.check(on_bearings(turns=False, teeth=True)).mobility == 1


def test_a_belt_without_places_of_its_pairs_is_counted():
    m = drive()
    bare = [mg.Pair(p.name, "R", p.a, p.b) for p in m.pairs]
    assert mg.check(m.replace(pairs=bare)).mobility_by_count == 0


# --- chains --------------------------------------------------------------------------------------------------------------

PITCH, TEETH = 0.0127, {"w": 24, "i": 12, "p": 18}


def chain(**more):
    gears = [mg.Pulley(k, k, (*THREE[k], 0), Z, teeth=n, pitch=PITCH) for k, n in TEETH.items()]
    drive = mg.BeltDrive("B", over=["w", "i", "p"], backs=["i"], **more)
    loads = [mg.Effort("arm", 12.0), mg.Effort("w", -3.0)]
    places = {k: THREE[k] for k in ("w", "p")}
    return mg.Mechanism("chain", None, [*hinges(places), ARM, ON_ARM], ["p"], loads, gears=gears, couplings=[drive])


def test_a_chain_runs_unevenly_and_the_same_with_every_tooth():
    """Rollers that sit stay at their distance but for whole pitches; tensioner and speed return with every tooth of the driver."""
    tooth = 2 * np.pi / TEETH["p"]
    turn = np.linspace(0, 2 * tooth, 41)
    s = mg.solve(chain(polygon=True), {"p": mg.Motion(turn, 10.0, 0.0)})
    arm, speed = s["arm"].position[:, 0], s["w"].velocity[:, 0] / 10
    np.testing.assert_allclose(arm[:21], arm[20:], atol=1e-10)
    assert 1e-3 < np.ptp(arm) < 1e-2
    assert speed.min() < 0.75 - 5e-3 < 0.75 + 5e-3 < speed.max()
    np.testing.assert_allclose(s["w"].position[-1], 2 * tooth * 0.75, atol=1e-10)
    assert s.checks.power.max() < 1e-9
    # rollers nearest to where the strand from p to w touches: their distance is the same but for whole pitches
    b, left = s.coupling("B"), []
    for k in range(len(turn)):
        at_ = []
        for name, touch in zip(("p", "w"), b.ends["p-w"][k], strict=True):
            n, center, angle_ = TEETH[name], np.array(THREE[name]), s[name].position[k, 0]
            there = np.arctan2(*(touch[:2] - center)[::-1])
            roller = angle_ + 2 * np.pi / n * np.round((there - angle_) * n / (2 * np.pi))
            at_.append(center + PITCH / (2 * np.sin(np.pi / n)) * np.array([np.cos(roller), np.sin(roller)]))
        left.append(np.linalg.norm(at_[1] - at_[0]) / PITCH)
    off = np.array(left) - left[0]
    np.testing.assert_allclose(off, np.round(off), atol=2e-3)
    assert np.ptp(b.span["p-w"]) < 1e-12 < np.ptp(off)


def test_a_chain_of_short_pitch_is_a_belt():
    """The wave of the arm, ``R (1 - cos(pi / teeth))`` of every sprocket, falls with the square of the pitch."""
    waves = []
    for n in (1, 2):
        gears = [mg.Pulley(k, k, (*THREE[k], 0), Z, teeth=n * z, pitch=PITCH / n) for k, z in TEETH.items()]
        tooth = 2 * np.pi / TEETH["p"] / n
        s = mg.kinematics(chain(polygon=True).replace(gears=gears), {"p": mg.Motion(np.linspace(0, tooth, 61), 1.0)})
        waves.append(np.ptp(s["arm"].position))
    assert 0 < waves[1] < waves[0] / 3


def test_chords_need_teeth_and_a_center_that_moves():
    with pytest.raises(mg.DeclarationError, match="no center moves"):
        mg.Mechanism(
            "c", pairs=hinges(TWO), gears=[mg.Pulley(k, k, (*p, 0), Z, teeth=20, pitch=0.005) for k, p in TWO.items()],
            couplings=[mg.BeltDrive("B", over=["p", "w"], polygon=True)],
        )  # fmt: skip
    with pytest.raises(mg.DeclarationError, match="needs teeth= and pitch="):
        tensioner(polygon=True)


def test_energy_of_a_tensioner_that_swings():
    """Free motion with springs, centers moving: the balance of energy closes, and the length stays."""
    heavy = [
        mg.Link("frame"),
        mg.Link("block", 3.0, (0.4, 0, 0)),
        *(mg.Link(k, 2.0, (*THREE[k], 0), mg.inertia.cylinder(2.0, 0.05, 0.02)) for k in ("w", "p")),
        mg.Link("arm", 1.0, (0.3, 0.08, 0), mg.inertia.rod(1.0, (0.35, 0.1, 0), (0.2, 0.05, 0))),
        mg.Link("i", 0.5, (*THREE["i"], 0), mg.inertia.cylinder(0.5, 0.04, 0.02)),
    ]
    loads = [
        mg.TorsionSpring("arm", stiffness=40.0, free=0.2),
        mg.Spring(freedom="x", stiffness=9e3),
        mg.Effort("w", 1.0),
    ]
    r = mg.respond(on_a_slide(heavy, (), loads), np.linspace(0, 0.1, 6), rtol=1e-9, atol=1e-11)
    assert np.abs(r.energy.balance).max() < 1e-6 * np.abs(r.energy.kinetic).max()
    assert np.abs(r["arm"].position).max() > 1e-3
    np.testing.assert_allclose(r.coupling("B").length, r.coupling("B").length[0], rtol=1e-10)


# --- declaration ---------------------------------------------------------------------------------------------------------


def test_it_is_written_out_and_comes_back_equal(tmp_path: Path):
    m = drive(pretension=300.0, radii=(0.05, 0.1)).replace(units={"length": "m", "mass": "kg", "time": "s"})
    assert [c.name for c in m.couplings] == ["B.p-w", "B.w-p"]
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    assert pickle.loads(pickle.dumps(m)) == m
    mm = m.to_units(length="mm")
    assert mm.couplings[0].pretension == pytest.approx(300e3)
    assert mm.gears[1].radius == pytest.approx(100.0)
    turned = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
    s, t = (mg.solve(one, {"p": 0.5}, loads=[mg.Effort("w", 2.0)]).coupling("B") for one in (m, m.moved(turned)))
    np.testing.assert_allclose(s.tension["p-w"], t.tension["p-w"], rtol=1e-12)


def test_the_spans_of_a_belt_stay_together():
    m = drive(pretension=300.0)
    one, two = m.couplings
    with pytest.raises(mg.DeclarationError, match="its belt 'B' lacks w-p"):
        m.replace(couplings=[one])
    with pytest.raises(mg.DeclarationError, match="lacks w-p"):
        m.replace(couplings=[one, two.replace(pretension=5.0)])
    with pytest.raises(mg.DeclarationError, match=r"belong to the whole belt; vary 'B\.pretension'"):
        mg.study(
            m, {"B.w-p.pretension": [1.0, 2.0]}, {"T": lambda s: s.coupling("B").tension["p-w"]}, 3, motions={"p": 0.0}
        )
    both = m.replace(couplings=[c.replace(pretension=5.0) for c in m.couplings])
    assert mg.solve(both, {"p": 0.0}).coupling("B").tension["p-w"] == pytest.approx(5.0)
    assert not mg.check(m).advice


def test_variants_move_the_centers():
    m = tensioner([mg.Effort("arm", 12.0)])
    found = mg.study(
        m, {"arm.point.x": [0.34, 0.36]}, {"T": lambda s: s.coupling("B").tension["w-i"]}, 2, motions={"p": [0.0, 1.0]}
    )
    for i in range(2):
        alone = mg.solve(found.variant(i), {"p": [0.0, 1.0]}).coupling("B").tension["w-i"]
        np.testing.assert_allclose(found.outputs["T"][i], alone, rtol=1e-9)


def test_numbers_of_belts_and_pulleys_vary():
    """Tension T0 + M / 2r, and speeds by the radius of a pulley."""
    m = drive(pretension=300.0, loads=[mg.Effort("w", 7.0)])
    found = mg.study(
        m, {"B.pretension": [100.0, 500.0], "gears[1].radius": [0.04, 0.06]},
        {"T": lambda s: s.coupling("B").tension["p-w"], "w": "w.Rz"}, 4, motions={"p": [0.0, 2.0]},
    )  # fmt: skip
    T0, r = found.parameters["B.pretension"], found.parameters["gears[1].radius"]
    np.testing.assert_allclose(found.outputs["T"], np.repeat((T0 + 7.0 / (2 * r))[:, None], 2, axis=1), rtol=1e-9)
    np.testing.assert_allclose(found.outputs["w"][:, 1], 2.0 * 0.05 / r, rtol=1e-12)
    with pytest.raises(mg.DeclarationError, match=r"pulleys of .B\.p-w. sit on that axis"):
        mg.study(m, {"w.point.x": [0.2, 0.21]}, "w.Rz", 2, motions={"p": 0.0})


def test_outputs_of_a_belt_by_name():
    """Tensions, wraps and margins of a flat belt as outputs: the closed forms at every radius, each with its unit."""
    m = drive(pretension=300.0, loads=[mg.Effort("w", 7.0), mg.Friction("B", mu=0.3)], toothed=False)
    m = m.replace(units={"length": "m", "mass": "kg", "time": "s"})
    names = ["B.tension.p-w", "B.span.w-p", "B.wrap.w", "B.slip_margin.w", "B.length"]
    found = mg.study(m, {"gears[1].radius": [0.04, 0.06]}, names, 2, motions={"p": 2.0}, sampling="grid")
    r = found.parameters["gears[1].radius"]
    T, l, wrap, margin, length = (found.outputs[name][:, 0] for name in names)
    off = np.arcsin((r - 0.05) / 0.2)
    np.testing.assert_allclose(T, 300.0 + 7.0 / (2 * r), rtol=1e-9)
    np.testing.assert_allclose(l, 0.2 * np.cos(off), rtol=1e-12)
    np.testing.assert_allclose(wrap, np.pi + 2 * off, rtol=1e-12)
    np.testing.assert_allclose(margin, np.exp(0.3 * wrap) * (300 - 3.5 / r) / (300 + 3.5 / r) - 1, rtol=1e-9)
    np.testing.assert_allclose(length, 2 * l + r * wrap + 0.05 * (np.pi - 2 * off), rtol=1e-12)
    assert [found.units[name] for name in names] == ["N", "m", "rad", "", "m"]
    with pytest.raises(mg.DeclarationError, match=r"is no quantity; did you mean B\.wrap\.w or"):
        mg.study(m, {"gears[1].radius": [0.04, 0.06]}, "B.wrap.x", 2, motions={"p": 0.0})


def test_a_belt_in_the_plane_is_the_spatial_one():
    m = tensioner([mg.Effort("arm", 12.0), mg.Effort("w", 5.0)])
    flat = m.to_planar()
    assert mg.check(flat).determinate
    one, two = (mg.solve(each, {"p": [0.0, 2.0, 30.0]}) for each in (m, flat))
    for name in ("p-w", "w-i", "i-p"):
        np.testing.assert_allclose(one.coupling("B").tension[name], two.coupling("B").tension[name], rtol=1e-11)
    np.testing.assert_allclose(one["w"].force[:, :2], two["w"].force[:, :2], rtol=1e-11, atol=1e-9)
    assert flat.to_spatial() == m


def test_teeth_and_pitch_make_the_radius():
    p = mg.Pulley("p", "p", (0, 0, 0), Z, teeth=20, pitch=5.0)
    assert p.pitch_radius == pytest.approx(RADII[0])


WRONG = {
    "unknown pulley": (lambda: drive(over=["p", "x"]), "unknown pulley 'x'"),
    "one pulley": (lambda: drive(over=["p"]), "two pulleys or more"),
    "twice": (lambda: drive(over=["p", "w", "p"]), "names 'p' twice"),
    "a back that is none": (lambda: drive(backs=["q"]), "backs"),
    "overlap": (lambda: drive(radii=(0.15, 0.15), backs=["w"]), "overlap"),
    "inside": (lambda: drive(radii=(0.5, 0.1)), "inside the other"),
    "length": (lambda: drive(length=0.8), "ask for 0.714159"),
    "clockwise": (
        lambda: drive({"a": (0, 0), "b": (0.2, 0.3), "c": (0.4, 0)}, (0.05, 0.05, 0.05)),
        "backs=; over=['c', 'b', 'a'], backs=[] would run",
    ),
    "no touch": (
        lambda: drive({"a": (0.4, 0), "b": (0.2, 0.2), "c": (0, 0)}, (0.05, 0.05, 0.05), backs=["b"]),
        "does not touch 'b' there; move the pulley, or change on which side it is (backs=); over=['a', 'b', 'c'], backs=[] would run",
    ),
    "on the wrong side": (
        lambda: drive({"a": (0.4, 0), "b": (0.2, -0.02), "c": (0, 0)}, (0.05, 0.01, 0.05)),
        "over=['a', 'b', 'c'], backs=['b'] would run",
    ),
    "a pulley without size": (
        lambda: mg.Mechanism("m", pairs=hinges(TWO), gears=[mg.Pulley("p", "p", (0, 0, 0), Z)]), "expected the radius"),
    "pretension with tensioner": (
        lambda: mg.solve(tensioner([mg.Effort("arm", 12.0)], pretension=3.0), {"p": 0.0}),
        "leave it out",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("make", "told"), WRONG.values(), ids=WRONG)
def test_faults(make, told):
    with pytest.raises(mg.DeclarationError) as error:
        make()
    assert told in str(error.value)


@pytest.mark.parametrize("unknowns", ["kinetostatics", "response"])
def test_the_printed_equations_are_the_solved_ones(unknowns):
    """Closure and force equations of a tensioner at a position with rates: what is solved meets what is printed."""
    m = on_a_slide(loads=[mg.Effort("arm", 12.0), mg.Effort("w", 5.0)])
    s = mg.solve(m, {"x": mg.Motion([0.002], 0.3, 0.7), "p": mg.Motion([0.4], 2.0, -1.0)})
    f, state = mg.formulate(m, unknowns=unknowns), s.state(0)
    names = m.freedom_names()
    rates = {
        1: [s[n.split(".")[0]].velocity[0, 0] for n in names],
        2: [s[n.split(".")[0]].acceleration[0, 0] for n in names],
    }
    for system, values in zip((f.closure.velocity, f.closure.acceleration), rates.values(), strict=True):
        A, b = system.assemble(state)
        np.testing.assert_allclose(A @ np.array(values), b, atol=1e-9)
    assert "N_C(B.w-i)" in f.text()


@pytest.mark.parametrize("polygon", [False, True])
@pytest.mark.parametrize("load", [8.0, 3.0])
def test_a_span_that_hangs_loose(load, polygon):
    """Tension ``M / arm`` in the other span alone, torque by power; with chords its rollers keep their distance, tooth by tooth."""
    teeth, at = {"p": 9, "w": 15}, {"p": (0.0, 0.0, 0.0), "w": (0.4, 0.0, 0.0)}
    pitch = 0.0254
    m = mg.Mechanism(
        "chain",
        pairs=[mg.Pair(k, "R", "frame", k, point=x, axis=Z) for k, x in at.items()],
        gears=[mg.Pulley(k, k, at[k], Z, teeth=n, pitch=pitch) for k, n in teeth.items()],
        couplings=[mg.BeltDrive("C", over=["p", "w"], slack="p-w", polygon=polygon)],
        drives=["p"],
        loads=[mg.Effort("w", -load)],
    )
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 0)
    step = 2 * np.pi / teeth["p"]
    turn = np.linspace(0.0, 2 * step, 41)
    s = mg.solve(m, {"p": mg.Motion(turn, velocity=5.0)})
    chain, q, ratio = s.coupling("C"), s["w"].position[:, 0], s["w"].velocity[:, 0] / 5.0
    np.testing.assert_allclose(s["p"].effort[:, 0], load * ratio, rtol=1e-9)
    assert not chain.tension["p-w"].any()
    assert (chain.tension["w-p"] > 0).all()
    # a pitch of the one is a pitch of the other
    np.testing.assert_allclose(q[[20, 40]], np.array([1, 2]) * 2 * np.pi / teeth["w"], rtol=1e-9)
    if not polygon:
        np.testing.assert_allclose(chain.tension["w-p"], load / (teeth["w"] * pitch / (2 * np.pi)), rtol=1e-9)
        return
    assert np.ptp(ratio) > 0.03 * ratio.mean()
    # the tight span as a bar of a four-bar between two rollers, over the positions between two changes of rollers
    bars = []
    for k, n in teeth.items():
        angles = s[k].position[:, :1] + 2 * np.pi / n * np.arange(n)
        R = pitch / (2 * np.sin(np.pi / n))
        bars.append(np.array(at[k][:2])[:, None, None] + R * np.array([np.cos(angles), np.sin(angles)]))
    force = np.stack([s["w"].force[:, 0], s["w"].force[:, 1]]) / chain.tension["w-p"]
    apart = bars[0][:, :, :, None] - bars[1][:, :, None, :]
    length = np.linalg.norm(apart, axis=0)
    along = np.abs(np.einsum("ct,ctij->tij", force, apart)) / length
    for i in range(0, 40, 3):
        bar = along[i] > 1 - 1e-9  # rollers on the line of the force
        assert bar.any()
        same = (along[i + 1] > 1 - 1e-9) & bar
        np.testing.assert_allclose(length[i + 1][same], length[i][same], rtol=1e-9)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"slack": "w-x"}, r"slack: unknown span 'w-x'"),
        ({"slack": "w-p", "pretension": 3.0}, "leave length= and pretension= out"),
    ],
)
def test_what_hangs_loose_is_one_span(more, told):
    with pytest.raises(mg.DeclarationError, match=told):
        drive(**more)


def test_an_unknown_output_names_the_couplings_too():
    m = drive(pretension=100.0)
    with pytest.raises(
        mg.DeclarationError,
        match=r"there is no pair, link or coupling 'C\.tension' \(pairs: p, w; links: .*; couplings: B\)",
    ):
        mg.study(m, {"B.pretension": [1.0, 2.0]}, "C.tension.p-w", motions={"p": 0.0})
