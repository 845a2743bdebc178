"""Fourteen machines as a designer meets them, each against a calculation by hand that shares no code with mechgraph.

By hand means: closed-form positions, free bodies and their six balances, or virtual work, in numpy. Meters, kilograms, newtons; z up.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import mechgraph as mg

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)
G = 9.81
WEIGHT = mg.Gravity((0, 0, -G))


def unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def turned(axis: Array, angle: float) -> Array:
    """Rotation by Rodrigues' formula."""
    n = unit(axis)
    k = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


def wrench(force: Array, point: Array) -> Array:
    """Force and moment about the origin: what the six balances of a body add up."""
    return np.concatenate([force, np.cross(point, force)])


def rod(name: str, a: str, b: str, p: Array, q: Array) -> list[mg.Pair]:
    """A rod between two ball joints."""
    return [mg.Pair(f"{name}a", "S", a, name, point=p), mg.Pair(f"{name}b", "S", name, b, point=q)]


def strut(name: str, a: str, b: str, p: Array, q: Array) -> list[mg.Pair]:
    """A cylinder between two ball joints, its rod free to turn."""
    return [
        mg.Pair(f"{name}a", "S", a, f"{name} tube", point=p),
        mg.Pair(name, "C", f"{name} tube", f"{name} rod", point=(p + q) / 2, axis=q - p),
        mg.Pair(f"{name}b", "S", f"{name} rod", b, point=q),
    ]


def links(*heavy: mg.Link, pairs: list[mg.Pair]) -> list[mg.Link]:
    """The links with mass, and all others that the pairs name, without."""
    named = [link.name for link in heavy]
    others = dict.fromkeys(name for pair in pairs for name in (pair.a, pair.b) if name not in named)
    return [mg.Link(name) for name in others] + list(heavy)


class Drawn:
    """A machine in its x-z plane as a mechanism of space, or as its planar twin."""

    def __init__(self, planar: bool) -> None:
        self.planar, self.up = planar, "Ty" if planar else "Tz"

    def made(self, m: mg.Mechanism) -> mg.Mechanism:
        return m.to_planar() if self.planar else m

    def inside(self, s: mg.Solution, name: str) -> Array:
        """Components x and up of the force of a pair; of the twin no number is missing, and none leaves the plane."""
        force = np.asarray(s[name].force)
        if self.planar:
            assert not force[..., 2].any()
            assert not np.asarray(s[name].moment)[..., :2].any()
            return force[..., :2]
        return force[..., [0, 2]]


SPACE, PLANE = Drawn(False), Drawn(True)
both = pytest.mark.parametrize("drawn", [SPACE, PLANE], ids=["space", "plane"])


def stays_in_space(m: mg.Mechanism) -> None:
    """Of eight of the fourteen: no plane holds their motion, so that they have no planar twin."""
    with pytest.raises(mg.DeclarationError, match="does not move in a plane; expected a mechanism that moves in one"):
        m.to_planar()


def test_hexapod() -> None:
    """Six legs under a platform at given poses: six axial forces balance weight and payload."""
    angles = np.deg2rad([10, 50, 130, 170, 250, 290])
    feet = np.column_stack([0.6 * np.cos(angles), 0.6 * np.sin(angles), np.zeros(6)])
    twist = np.deg2rad([-10, 70, 110, 190, 230, 310])
    heads = np.column_stack([0.35 * np.cos(twist), 0.35 * np.sin(twist), np.full(6, 0.7)])
    pairs = []
    for i, (p, q) in enumerate(zip(feet, heads, strict=True)):
        second = np.cross(q - p, X)
        pairs += [
            mg.Pair(f"U{i}", "U", "frame", f"tube{i}", point=p, axis=np.cross(second, q - p), second=second),
            mg.Pair(f"leg{i}", "P", f"tube{i}", f"rod{i}", point=(p + q) / 2, axis=q - p),
            mg.Pair(f"S{i}", "S", f"rod{i}", "platform", point=q),
        ]
    centre, payload = np.array([0, 0, 0.72]), np.array([0.1, -0.05, 0.8])
    platform = mg.Link("platform", 40.0, centre, points={"tool": payload})
    m = mg.Mechanism(
        "hexapod", links(platform, pairs=pairs), pairs, [f"leg{i}" for i in range(6)],
        [WEIGHT, mg.Wrench("platform", force=(200, -100, -800), point="tool")],
    )  # fmt: skip
    stays_in_space(m)
    assert mg.check(m).determinate
    poses = np.tile(np.eye(4), (3, 1, 1))
    middle = np.array([0, 0, 0.7])
    for pose, (axis, angle, shift) in zip(
        poses, [(X, 0.0, (0, 0, 0)), (X + Y, 0.15, (0.05, 0, 0.1)), (Z, -0.3, (0, 0.1, 0.05))], strict=True
    ):
        pose[:3, :3] = turned(axis, angle)
        pose[:3, 3] = middle + shift - pose[:3, :3] @ middle
    s = mg.solve(m, {"platform": poses}, actuate=[f"leg{i}" for i in range(6)])
    for k, pose in enumerate(poses):

        def moved(p: Array, pose: Array = pose) -> Array:
            return np.asarray(p @ pose[:3, :3].T + pose[:3, 3])

        legs = moved(heads) - feet
        push = [wrench(n, p) for n, p in zip(unit(legs), feet, strict=True)]
        load = wrench(np.array([0, 0, -40 * G]), moved(centre)) + wrench(np.array([200.0, -100, -800]), moved(payload))
        by_hand = np.linalg.solve(np.transpose(push), -load)
        np.testing.assert_allclose([s[f"leg{i}"].effort[k, 0] for i in range(6)], by_hand, rtol=1e-8)
        lengths = np.linalg.norm(legs, axis=1) - np.linalg.norm(heads - feet, axis=1)
        np.testing.assert_allclose([s[f"leg{i}"].position[k, 0] for i in range(6)], lengths, atol=1e-10)
        along = [s[f"S{i}"].force[k] @ n for i, n in enumerate(unit(legs))]
        np.testing.assert_allclose(along, by_hand, rtol=1e-8)


def test_delta_robot() -> None:
    """A tool on an accelerated path: arm angles by the addition theorem, torques by the pull of six rods."""
    base, plate, arm, long, half = 0.20, 0.06, 0.30, 0.70, 0.04
    spokes = [turned(Z, 2 * np.pi * i / 3) @ X for i in range(3)]

    def raised(tool: Array, e: Array) -> tuple[float, Array]:
        """Angle of an arm below the horizontal, and its elbow: |elbow - (tool + plate e)| = long."""
        d = tool + (plate - base) * e
        a, b = 2 * arm * (d @ e), -2 * arm * d[2]
        c = d @ d + arm**2 - long**2
        angle = float(np.arctan2(b, a) - np.arccos(c / np.hypot(a, b)))
        if np.cos(angle) < 0:
            angle = float(np.arctan2(b, a) + np.arccos(c / np.hypot(a, b)))
        return angle, base * e + arm * (np.cos(angle) * e - np.sin(angle) * Z)

    home = np.array([0, 0, -0.62])
    pairs = []
    for i, e in enumerate(spokes):
        axis, elbow = np.cross(Z, e), raised(home, e)[1]
        pairs.append(mg.Pair(f"hip{i}", "R", "frame", f"arm{i}", point=base * e, axis=axis))
        for side in (-1, 1):
            offset = side * half * axis
            name = f"rod{i}{'lr'[side > 0]}"
            pairs += rod(name, f"arm{i}", "plate", elbow + offset, home + plate * e + offset)
    tool = mg.Link("plate", 1.2, home, np.diag([0.001, 0.001, 0.002]), points={"tool": home})
    m = mg.Mechanism("delta robot", links(tool, pairs=pairs), pairs, [f"hip{i}" for i in range(3)], [WEIGHT])
    stays_in_space(m)
    assert mg.check(m).mobility == 3 + 6  # the spins of six rods
    t = np.linspace(0, 0.2, 9)
    w, reach = 12.0, np.array([0.12, -0.05, 0.08])
    path = home + np.outer(1 - np.cos(w * t), reach)
    motion = mg.Motion(path, np.outer(w * np.sin(w * t), reach), np.outer(w**2 * np.cos(w * t), reach))
    s = mg.solve(m, {"plate.tool": motion}, actuate=[f"hip{i}" for i in range(3)])
    for k, p in enumerate(path):
        angles, elbows = zip(*(raised(p, e) for e in spokes), strict=True)
        rods = [
            (i, side, wrench(unit(elbows[i] - p - plate * e), plate * e + side * half * np.cross(Z, e)))
            for i, e in enumerate(spokes)
            for side in (-1, 1)
        ]
        inertia = 1.2 * (w**2 * np.cos(w * t[k]) * reach + G * Z)
        tension = np.linalg.solve(np.transpose([line for *_, line in rods]), [*inertia, 0, 0, 0])
        torques = np.zeros(3)
        for (i, side, line), pull in zip(rods, tension, strict=True):
            torques[i] += np.cross(elbows[i] - base * spokes[i], pull * line[:3]) @ np.cross(Z, spokes[i])
            np.testing.assert_allclose(s[f"rod{i}{'lr'[side > 0]}b"].force[k], pull * line[:3], rtol=1e-6, atol=1e-7)
        for i, e in enumerate(spokes):
            assert s[f"hip{i}"].effort[k, 0] == pytest.approx(torques[i], rel=1e-7, abs=1e-9)
            assert s[f"hip{i}"].position[k, 0] == pytest.approx(angles[i] - raised(home, e)[0], abs=1e-9)


def test_five_rod_suspension() -> None:
    """A wheel lifted by its strut: five rods and the strut carry the tyre's force, and the strut's work is that of the tyre."""
    inner = np.array([(0.1, 0.3, 0.1), (-0.1, 0.32, 0.12), (0.15, 0.25, -0.1), (-0.15, 0.27, -0.12), (0.2, 0.3, 0.0)])
    outer = np.array(
        [(0.03, 0.7, 0.15), (-0.03, 0.69, 0.14), (0.05, 0.72, -0.12), (-0.06, 0.71, -0.13), (0.14, 0.68, 0.01)]
    )
    top, eye = np.array([0.02, 0.45, 0.5]), np.array([0.0, 0.66, -0.02])
    hub, patch = np.array([0, 0.75, 0]), np.array([0, 0.75, -0.31])
    pairs = [pair for i in range(5) for pair in rod(f"rod{i}", "frame", "carrier", inner[i], outer[i])]
    pairs += strut("strut", "frame", "carrier", top, eye)
    names = {"hub": hub, "patch": patch, "eye": eye} | {f"o{i}": outer[i] for i in range(5)}
    tyre = np.array([600.0, -900, 3500])  # braking, cornering, wheel load
    carrier = mg.Link("carrier", 35.0, hub, points=names)
    m = mg.Mechanism(
        "five-rod suspension", links(carrier, pairs=pairs), pairs, ["strut.Tz"],
        [WEIGHT, mg.Wrench("carrier", force=tyre, point="patch")],
    )  # fmt: skip
    stays_in_space(m)
    travel = np.linspace(-0.06, 0.08, 281)
    s = mg.solve(m, {"carrier.hub.Tz": travel}, actuate=["strut.Tz"])
    at = {name: s.link("carrier").at(name).position for name in names}
    np.testing.assert_allclose(at["hub"][:, 2], travel, atol=1e-9)
    for i in range(5):
        lengths = np.linalg.norm(at[f"o{i}"] - inner[i], axis=1)
        np.testing.assert_allclose(lengths, np.linalg.norm(outer[i] - inner[i]), rtol=1e-9)
    push = s["strut"].effort[:, 1]
    for k in (0, 120, 280):
        ends, seats = [at[f"o{i}"][k] for i in range(5)] + [at["eye"][k]], [*inner, top]
        lines = [wrench(unit(q - p), q) for p, q in zip(seats, ends, strict=True)]
        load = wrench(tyre, at["patch"][k]) + wrench(np.array([0, 0, -35 * G]), at["hub"][k])
        by_hand = np.linalg.solve(np.transpose(lines), -load)
        assert push[k] == pytest.approx(by_hand[5], rel=1e-7)
        for i in range(5):
            np.testing.assert_allclose(s[f"rod{i}b"].force[k], by_hand[i] * lines[i][:3], rtol=1e-6, atol=1e-5)
    length = np.linalg.norm(at["eye"] - top, axis=1)
    work = np.trapezoid(push, length) + (at["patch"][-1] - at["patch"][0]) @ tyre - 35 * G * (travel[-1] - travel[0])
    assert abs(work) < 1e-4 * 3500 * 0.14


def test_double_wishbone_with_steering() -> None:
    """Wheel travel with the rack at its place: seven balances give ball joints and tie rod, an eighth the strut."""
    hinge_low, hinge_up = np.array([0.0, 0.35, -0.1]), np.array([0.0, 0.42, 0.15])
    axis_low, axis_up = np.array([1.0, 0.05, 0.02]), np.array([1.0, -0.04, -0.05])
    low, up = np.array([0.01, 0.72, -0.12]), np.array([-0.02, 0.68, 0.16])
    rack, steer = np.array([-0.12, 0.33, -0.05]), np.array([-0.13, 0.70, -0.06])
    foot, top = np.array([0.0, 0.58, -0.11]), np.array([0.0, 0.5, 0.4])
    patch = np.array([0.0, 0.78, -0.33])
    points = {"patch": patch, "low": low, "up": up, "steer": steer}
    pairs = [
        mg.Pair("AL", "R", "frame", "lower arm", point=hinge_low, axis=axis_low),
        mg.Pair("AU", "R", "frame", "upper arm", point=hinge_up, axis=axis_up),
        mg.Pair("BL", "S", "lower arm", "knuckle", point=low),
        mg.Pair("BU", "S", "upper arm", "knuckle", point=up),
        mg.Pair("rack", "P", "frame", "bar", point=rack, axis=Y),
        *rod("tie", "bar", "knuckle", rack, steer),
        *strut("strut", "frame", "lower arm", top, foot),
    ]
    tyre = np.array([-400.0, 1500, 4000])
    heavy = [mg.Link("knuckle", points=points), mg.Link("lower arm", points={"foot": foot})]
    m = mg.Mechanism(
        "double wishbone", links(*heavy, pairs=pairs), pairs, ["strut.Tz", "rack"],
        [mg.Wrench("knuckle", force=tyre, point="patch")],
    )  # fmt: skip
    stays_in_space(m)
    travel, turn = patch[2] + np.array([-0.05, 0.0, 0.06]), np.array([0.03, 0.0, -0.04])
    s = mg.solve(m, {"knuckle.patch.Tz": travel, "rack": turn}, actuate=["strut.Tz", "rack"])
    for k in range(3):
        at = {name: s.link("knuckle").at(name).position[k] for name in points}
        joint, eye = rack + turn[k] * Y, s.link("lower arm").at("foot").position[k]
        arms = [(at["low"], hinge_low, low, axis_low), (at["up"], hinge_up, up, axis_up)]
        for now, hinge, drawn, axis in arms:  # circles about the hinges, and rigid bodies
            assert unit(axis) @ (now - drawn) == pytest.approx(0, abs=1e-9)
            assert np.linalg.norm(now - hinge) == pytest.approx(np.linalg.norm(drawn - hinge), abs=1e-9)
        assert np.linalg.norm(at["steer"] - joint) == pytest.approx(np.linalg.norm(steer - rack), abs=1e-9)
        for a, b in (("low", "up"), ("low", "steer"), ("up", "steer"), ("up", "patch")):
            assert np.linalg.norm(at[a] - at[b]) == pytest.approx(np.linalg.norm(points[a] - points[b]), abs=1e-9)
        tie = unit(at["steer"] - joint)
        system = np.zeros((7, 7))
        system[:6, :3] = np.transpose([wrench(e, at["low"]) for e in np.eye(3)])
        system[:6, 3:6] = np.transpose([wrench(e, at["up"]) for e in np.eye(3)])
        system[:6, 6] = wrench(tie, at["steer"])
        system[6, 3:6] = np.cross(axis_up, at["up"] - hinge_up)  # no moment about the hinge of the upper arm
        by_hand = np.linalg.solve(system, [*-wrench(tyre, at["patch"]), 0])
        np.testing.assert_allclose(s["BL"].force[k], by_hand[:3], rtol=1e-7)
        np.testing.assert_allclose(s["BU"].force[k], by_hand[3:6], rtol=1e-7)
        assert s["rack"].effort[k, 0] == pytest.approx(by_hand[6] * tie[1], rel=1e-7)
        moment = np.cross(at["low"] - hinge_low, by_hand[:3]) @ axis_low
        arm = np.cross(eye - hinge_low, unit(eye - top)) @ axis_low
        assert s["strut"].effort[k, 1] == pytest.approx(moment / arm, rel=1e-7)


def test_double_cardan_shaft() -> None:
    """Two universal joints in Z arrangement at 25 deg: the shaft between them runs unevenly, the output does not."""
    bend, torque, speed = np.deg2rad(25), 150.0, 40.0
    along, pin = np.array([np.cos(bend), 0, np.sin(bend)]), np.array([-np.sin(bend), 0, np.cos(bend)])
    end = 0.8 * along
    pairs = [
        mg.Pair("A", "R", "frame", "input", point=-0.2 * X, axis=X),
        mg.Pair("B", "U", "input", "middle", point=(0, 0, 0), axis=Y, second=pin),
        mg.Pair("C", "U", "middle", "output", point=end, axis=pin, second=Y),
        mg.Pair("D", "C", "frame", "output", point=end + 0.2 * X, axis=X),
    ]
    m = mg.Mechanism("double Cardan shaft", pairs=pairs, drives=["A"], loads=[mg.Effort("D.Rz", -torque)])
    stays_in_space(m)
    assert mg.check(m).determinate
    q = np.deg2rad([0, 20, 55, 100, 140, 200, 290, 350])
    s = mg.solve(m, {"A": mg.Motion(q, velocity=speed)})
    np.testing.assert_allclose(s["D"].position[:, 0], q, atol=1e-10)
    np.testing.assert_allclose(s["D"].velocity[:, 0], speed, rtol=1e-10)
    np.testing.assert_allclose(s["A"].effort[:, 0], torque, rtol=1e-10)
    middle = speed * np.cos(bend) / (1 - (np.sin(bend) * np.sin(q)) ** 2)
    np.testing.assert_allclose(s.link("middle").angular_velocity @ along, middle, rtol=1e-10)
    for k, angle in enumerate(q):  # a cross hands on a couple normal to both of its pins
        first = np.cos(angle) * Y + np.sin(angle) * Z
        couple = np.cross(first, np.cross(along, first))
        couple *= torque / (couple @ X)
        np.testing.assert_allclose(s["A"].moment[k], couple - torque * X, atol=1e-8)
        np.testing.assert_allclose(s["A"].force[k], 0, atol=1e-8)
        assert couple @ along * middle[k] == pytest.approx(torque * speed, rel=1e-10)


def flat(x: float, z: float) -> Array:
    return np.array([x, 0, z])


def moment(arm: Array, force: Array) -> float:
    """About the line through the pin, along -y."""
    return float(arm[0] * force[2] - arm[2] * force[0])


@both
def test_landing_gear(drawn: Drawn) -> None:
    """Leg, folding brace of two halves, and a jack on the upper one: elbow by two circles, forces body by body."""
    top, jack, half, grip = flat(0.8, 0.15), flat(0.3, 0.35), 0.60, 0.25
    mass, drag = 120.0, np.array([-2500.0, 0, 0])

    def places(angle: float) -> tuple[Array, ...]:
        direction = flat(np.sin(angle), -np.cos(angle))
        eye = 0.7 * direction
        span = eye - top
        high = np.sqrt(half**2 - span @ span / 4)
        elbow = top + span / 2 + high * unit(flat(span[2], -span[0]))
        return direction, eye, elbow, top + grip * unit(elbow - top)

    down = np.deg2rad(5)
    direction, eye, elbow, hold = places(down)
    leg = mg.Link("leg", mass, 0.9 * direction, points={"wheel": 1.4 * direction})
    pairs = [
        mg.Pair("O", "R", "frame", "leg", point=(0, 0, 0), axis=-Y),
        mg.Pair("Q", "R", "leg", "lower brace", point=eye, axis=-Y),
        mg.Pair("E", "R", "lower brace", "upper brace", point=elbow, axis=-Y),
        mg.Pair("F", "R", "frame", "upper brace", point=top, axis=-Y),
        mg.Pair("H", "R", "frame", "tube", point=jack, axis=-Y),
        mg.Pair("jack", "P", "tube", "rod", point=(jack + hold) / 2, axis=hold - jack),
        mg.Pair("U", "R", "rod", "upper brace", point=hold, axis=-Y),
    ]
    loads = [WEIGHT, mg.Wrench("leg", force=drag, point="wheel")]
    m = mg.Mechanism("landing gear", links(leg, pairs=pairs), pairs, ["O"], loads)
    m = drawn.made(m)
    angles = np.deg2rad([5, 15, 30, 45, 60, 75, 85])
    s = mg.solve(m, {"O": angles - down}, actuate=["jack"])
    for k, angle in enumerate(angles):
        direction, eye, elbow, hold = places(angle)
        weight = np.array([0, 0, -mass * G])
        at_hinge = moment(0.9 * direction, weight) + moment(1.4 * direction, drag)
        lower = -at_hinge / moment(eye, unit(eye - elbow)) * unit(eye - elbow)
        push = moment(elbow - top, lower) / moment(hold - top, unit(hold - jack))
        assert s["jack"].effort[k, 0] == pytest.approx(push, rel=1e-8)
        stroke = np.linalg.norm(hold - jack) - np.linalg.norm(places(down)[3] - jack)
        assert s["jack"].position[k, 0] == pytest.approx(stroke, abs=1e-10)
        hinges = {"O": -weight - drag - lower, "E": -lower, "F": lower - push * unit(hold - jack)}
        for name, by_hand in hinges.items():
            np.testing.assert_allclose(drawn.inside(s, name)[k], by_hand[[0, 2]], rtol=1e-7, atol=1e-6)


def test_swash_plate_pump() -> None:
    """Three pistons on a plate at 15 deg, 200 bar on the way in and 5 bar on the way out, at 150 rad/s."""
    tilt, radius, area, mass, speed = np.deg2rad(15), 0.03, 2e-4, 0.08, 150.0
    normal = np.array([np.sin(tilt), 0, np.cos(tilt)])
    pairs, heavy, loads = [mg.Pair("shaft", "R", "frame", "block", point=(0, 0, 0.1), axis=Z)], [], []
    phases = np.deg2rad([10, 130, 250])

    def pressed(v: Array) -> Array:
        return np.where(v > 0, 200e5, 5e5) * area

    for i, phase in enumerate(phases):
        ball = radius * np.array([np.cos(phase), np.sin(phase), -np.tan(tilt) * np.cos(phase)])
        pairs += [
            mg.Pair(f"shoe{i}", "Sp", "frame", f"piston{i}", point=ball, axis=normal),
            mg.Pair(f"bore{i}", "C", "block", f"piston{i}", point=ball, axis=Z),
        ]
        heavy.append(mg.Link(f"piston{i}", mass, ball))
        loads.append(mg.ForceLaw(f"bore{i}.Tz", law=lambda x, v, t: -pressed(v)))
    m = mg.Mechanism("swash-plate pump", links(*heavy, pairs=pairs), pairs, ["shaft"], loads)
    stays_in_space(m)
    assert mg.check(m).mobility == 1 + 3  # the pistons may spin
    turn = np.deg2rad(np.arange(3, 363, 15.0))
    s = mg.solve(m, {"shaft": mg.Motion(turn, velocity=speed)})
    by_hand = 0.0
    for i, phase in enumerate(phases):
        angle = turn + phase
        lift = -radius * np.tan(tilt) * np.cos(angle)
        slope = radius * np.tan(tilt) * np.sin(angle)
        np.testing.assert_allclose(
            s[f"bore{i}"].position[:, 1], lift - lift[0] + s[f"bore{i}"].position[0, 1], atol=1e-12
        )
        axial = pressed(slope * speed) - mass * lift * speed**2
        by_hand = by_hand + axial * slope
        np.testing.assert_allclose(s[f"shoe{i}"].force, np.outer(axial / np.cos(tilt), normal), rtol=1e-9, atol=1e-6)
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        wall = -mass * radius * speed**2 * out - np.outer(axial * np.tan(tilt), [1, 0])
        np.testing.assert_allclose(s[f"bore{i}"].force[:, :2], wall, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(s["shaft"].effort[:, 0], by_hand, rtol=1e-9, atol=1e-9)


@both
def test_scissor_lift(drawn: Drawn) -> None:
    """Three stages of crossed arms, pushed at the foot: F = (n W + n^2 w) g cot(angle) by virtual work."""
    stages, long, arm, deck, load = 3, 2.0, 30.0, 150.0, 500.0
    low = np.deg2rad(20)
    wide, high = long * np.cos(low), long * np.sin(low)
    pairs = [
        mg.Pair("A", "R", "frame", "a0", point=(0, 0, 0), axis=Y),
        mg.Pair("ram", "P", "frame", "foot", point=flat(wide, 0), axis=X),
        mg.Pair("B", "R", "foot", "b0", point=flat(wide, 0), axis=Y),
        mg.Pair("C", "R", f"b{stages - 1}", "deck", point=flat(0, stages * high), axis=Y),
        mg.Pair("D", "R", f"a{stages - 1}", "shoe", point=flat(wide, stages * high), axis=Y),
        mg.Pair("guide", "P", "deck", "shoe", point=flat(wide, stages * high), axis=X),
    ]
    heavy = [
        mg.Link(
            "deck",
            deck,
            flat(wide / 2, stages * high),
            points={"edge": flat(0, stages * high), "load": flat(0.4, stages * high)},
        )
    ]
    for i in range(stages):
        heavy += [mg.Link(f"{side}{i}", arm, flat(wide / 2, (i + 0.5) * high)) for side in "ab"]
        pairs.append(mg.Pair(f"M{i}", "R", f"a{i}", f"b{i}", point=flat(wide / 2, (i + 0.5) * high), axis=Y))
        if i:
            pairs.append(mg.Pair(f"L{i}", "R", f"b{i - 1}", f"a{i}", point=flat(0, i * high), axis=Y))
            pairs.append(mg.Pair(f"R{i}", "R", f"a{i - 1}", f"b{i}", point=flat(wide, i * high), axis=Y))
    loads = [WEIGHT, mg.Wrench("deck", force=(0, 0, -load * G), point="load")]
    m = mg.Mechanism("scissor lift", links(*heavy, pairs=pairs), pairs, ["ram"], loads)
    m = drawn.made(m)
    angles = np.deg2rad([20, 30, 45, 60])
    s = mg.solve(m, {f"deck.edge.{drawn.up}": stages * long * np.sin(angles)}, actuate=["ram"])
    push = (stages * (deck + load) + stages**2 * arm) * G / np.tan(angles)
    np.testing.assert_allclose(s["ram"].effort[:, 0], -push, rtol=1e-9)
    np.testing.assert_allclose(s["ram"].position[:, 0], long * (np.cos(angles) - np.cos(low)), atol=1e-10)
    # the whole lift about its fixed foot: the load stays 0.4 from it, the deck's center where it was, the arms' half way
    foot = G * (load * 0.4 + deck * wide / 2 + stages * arm * long * np.cos(angles)) / (long * np.cos(angles))
    np.testing.assert_allclose(drawn.inside(s, "B")[:, 1], foot, rtol=1e-9)
    np.testing.assert_allclose(drawn.inside(s, "A")[:, 0], push, rtol=1e-9)
    np.testing.assert_allclose(drawn.inside(s, "A")[:, 1], (load + deck + 2 * stages * arm) * G - foot, rtol=1e-9)


@both
def test_excavator(drawn: Drawn) -> None:
    """In-plane pins and cylinders R-P-R, boom lifted and stick drawn in at once: cylinder forces by the work of each stroke."""
    elbow, tip = flat(5.2, 2.6), flat(7.0, -1.0)
    eyes = {"lift": (flat(0.5, -0.6), flat(2.4, 1.9)), "crowd": (flat(2.7, 2.9), flat(4.8, 3.4))}
    bodies = {"boom": (2000.0, flat(2.7, 1.7)), "stick": (1100.0, flat(5.9, 1.2))}
    pairs = [
        mg.Pair("A", "R", "frame", "boom", point=(0, 0, 0), axis=-Y),
        mg.Pair("B", "R", "boom", "stick", point=elbow, axis=-Y),
    ]
    for name, (a, b) in zip(eyes, [("frame", "boom"), ("boom", "stick")], strict=True):
        foot, head = eyes[name]
        pairs += [
            mg.Pair(f"{name} foot", "R", a, f"{name} tube", point=foot, axis=-Y),
            mg.Pair(name, "P", f"{name} tube", f"{name} rod", point=(foot + head) / 2, axis=head - foot),
            mg.Pair(f"{name} head", "R", f"{name} rod", b, point=head, axis=-Y),
        ]
    heavy = [mg.Link("boom", *bodies["boom"]), mg.Link("stick", *bodies["stick"], points={"tip": tip})]
    soil = np.array([30e3, 0, 8e3])
    m = mg.Mechanism(
        "excavator", links(*heavy, pairs=pairs), pairs, list(eyes),
        [WEIGHT, mg.Wrench("stick", force=soil, point="tip")],
    )  # fmt: skip
    m = drawn.made(m)
    report = mg.check(m)
    if drawn.planar:
        assert report.verdict.startswith("Determinate (planar): 2 drivers, 18 unknowns, 18 equations")
    else:
        assert report.verdict.startswith(
            "Moves with mobility 2, planar: all in-plane forces and driver efforts are unique"
        )
        assert report.redundancy == 6  # three for each of the two loops

    def state(angles: Array) -> tuple[Array, float]:
        """Strokes, and potential of weight and soil, for turns of boom and stick."""
        r1, r2 = (turned(-Y, angle) for angle in (angles[0], angles[0] + angles[1]))

        def on_stick(p: Array) -> Array:
            return np.asarray(r1 @ elbow + r2 @ (p - elbow))

        strokes = [
            np.linalg.norm(r1 @ eyes["lift"][1] - eyes["lift"][0]),
            np.linalg.norm(on_stick(eyes["crowd"][1]) - r1 @ eyes["crowd"][0]),
        ]
        heights = bodies["boom"][0] * (r1 @ bodies["boom"][1])[2] + bodies["stick"][0] * on_stick(bodies["stick"][1])[2]
        return np.array(strokes), float(G * heights - soil @ on_stick(tip))

    boom, stick = np.deg2rad([0, 10, 20, 25]), np.deg2rad([0, 15, 25, 40])
    s = mg.solve(m, {"A": boom, "B": stick}, actuate=["lift", "crowd"])
    home = state(np.zeros(2))[0]
    step = 1e-5
    for k, angles in enumerate(np.column_stack([boom, stick])):
        moved = [(state(angles + step * e), state(angles - step * e)) for e in np.eye(2)]
        slopes = np.array([(ahead[0] - back[0]) / (2 * step) for ahead, back in moved])
        rise = np.array([(ahead[1] - back[1]) / (2 * step) for ahead, back in moved])
        by_hand = np.linalg.solve(slopes, rise)
        found = [s[name].effort[k, 0] for name in eyes]
        np.testing.assert_allclose(found, by_hand, rtol=1e-6)
        np.testing.assert_allclose([s[name].position[k, 0] for name in eyes], state(angles)[0] - home, atol=1e-10)
    assert not np.isnan(drawn.inside(s, "A")).any()
    if not drawn.planar:
        assert np.isnan(s["A"].force[:, 1]).all()  # along the pins nothing decides


@both
def test_tailgate(drawn: Drawn) -> None:
    """One gas spring at the left of a lid: the couple that holds it and both hinges, by six balances."""
    mass = 28.0
    left, right = np.array([0, 0.6, 0]), np.array([0, -0.6, 0])
    seat, eye = np.array([0.25, 0.55, -0.55]), np.array([0.45, 0.55, -0.05])
    centre = np.array([0.55, 0.02, -0.1])
    pairs = [
        mg.Pair("left hinge", "S", "body", "lid", point=left),
        mg.Pair("right hinge", "Sg", "body", "lid", point=right, axis=Y),
        mg.Pair("opening", "Fr", "body", "lid", point=(0, 0, 0), axis=-Y),
    ]
    gas = mg.ForceTable(x=[0.5, 1.0], force=[343, 333])
    heavy = mg.Link("lid", mass, centre, points={"eye": eye})
    m = mg.Mechanism(
        "tailgate", [mg.Link("body", points={"seat": seat}), heavy], pairs, ["opening.Rz"],
        [WEIGHT, mg.ForceLaw(("body", "lid", "seat", "eye"), law=gas)],
    )  # fmt: skip
    m = drawn.made(m)
    assert mg.check(m).determinate is not drawn.planar  # in the plane two hinges are one pin twice
    angles = np.deg2rad([0, 20, 40, 60, 75])
    s = mg.solve(m, {"opening.Rz": angles}, redundant="minimum_norm")
    for k, angle in enumerate(angles):
        r = turned(-Y, angle)
        length = np.linalg.norm(r @ eye - seat)
        spring = (343 - 10 * (length - 0.5) / 0.5) * unit(r @ eye - seat)
        weight = np.array([0, 0, -mass * G])
        load = wrench(weight, r @ centre) + wrench(spring, r @ eye)
        # left hinge x, y, z, right hinge x, z, and a couple about the hinge line
        lines = (
            [wrench(e, left) for e in (X, Y, Z)]
            + [wrench(e, right) for e in (X, Z)]
            + [np.array([0, 0, 0, 0, -1.0, 0])]
        )
        by_hand = np.linalg.solve(np.transpose(lines), -load)
        assert s["opening"].effort[k, -1] == pytest.approx(by_hand[5], rel=1e-8)
        if drawn.planar:
            hinges = drawn.inside(s, "left hinge")[k] + drawn.inside(s, "right hinge")[k]
            np.testing.assert_allclose(hinges, by_hand[[0, 2]] + by_hand[[3, 4]], rtol=1e-8)
            continue
        np.testing.assert_allclose(s["left hinge"].force[k], by_hand[:3], rtol=1e-8, atol=1e-7)
        np.testing.assert_allclose(s["right hinge"].force[k, [0, 2]], by_hand[3:5], rtol=1e-8, atol=1e-7)
    assert s["opening"].effort[0, -1] > 0 > s["opening"].effort[-1, -1]  # lifted at first, held back when open


@both
def test_door(drawn: Drawn) -> None:
    """A door of 40 kg swung open: the lower hinge carries it, both pull sideways by its lever, and speed up its mass."""
    mass, wide, apart, swing = 40.0, 0.9, 1.6, 0.25
    low, high = np.array([0, 0, 0.2]), np.array([0, 0, 0.2 + apart])
    middle = np.array([wide / 2, 0, 1.0])
    inertia = mass / 12 * np.diag([2.0**2, 2.0**2 + wide**2, wide**2])
    pairs = [
        mg.Pair("lower hinge", "S", "wall", "door", point=low),
        mg.Pair("upper hinge", "Sg", "wall", "door", point=high, axis=Z),
        mg.Pair("swing", "Fr", "wall", "door", point=low, axis=Z),
    ]
    loads = [WEIGHT, mg.Damper("swing.Rz", coefficient=6.0)]
    m = mg.Mechanism("door", [mg.Link("wall"), mg.Link("door", mass, middle, inertia)], pairs, ["swing.Rz"], loads)
    m = drawn.made(m)
    q, rate, growth = np.deg2rad([0, 30, 90, 130]), 1.5, swing
    s = mg.solve(m, {"swing.Rz": mg.Motion(q, velocity=rate, acceleration=growth)})
    out = np.column_stack([np.cos(q), np.sin(q), np.zeros(4)])
    ahead = np.column_stack([-np.sin(q), np.cos(q), np.zeros(4)])
    np.testing.assert_allclose(s["swing"].effort[:, -1], mass * wide**2 / 3 * growth + 6 * rate, rtol=1e-10)
    # sideways: the weight's lever over the distance; m a at mid-height 0.8 above the lower hinge, half to each
    pull, thrust = -mass * rate**2 * wide / 2, mass * growth * wide / 2
    lever = mass * G * wide / 2 / apart
    share = (middle[2] - low[2]) / apart
    if drawn.planar:  # the two hinges are one pin twice: together they pull the door round
        s = mg.solve(m, {"swing.Rz": mg.Motion(q, velocity=rate, acceleration=growth)}, redundant="minimum_norm")
        hinges = drawn.inside(s, "upper hinge") + drawn.inside(s, "lower hinge")
        np.testing.assert_allclose(hinges, (pull * out + thrust * ahead)[:, :2], rtol=1e-10)
        return
    np.testing.assert_allclose(s["upper hinge"].force, (share * pull - lever) * out + share * thrust * ahead, atol=1e-8)
    lower = ((1 - share) * pull + lever) * out + (1 - share) * thrust * ahead + mass * G * Z
    np.testing.assert_allclose(s["lower hinge"].force, lower, atol=1e-8)


@both
def test_coupled_rods(drawn: Drawn) -> None:
    """Two wheels of a locomotive, the rods of a piston and between them: the first wheel's pin feels both."""
    crank, long, base, brake = 0.3, 1.8, 1.5, np.array([900.0, 1400.0])
    start = np.deg2rad(35)
    pin = crank * flat(np.cos(start), np.sin(start))
    head = flat(-np.sqrt(long**2 - pin[2] ** 2) + pin[0], 0)
    pairs = [
        mg.Pair("axle1", "R", "frame", "wheel1", point=(0, 0, 0), axis=-Y),
        mg.Pair("axle2", "R", "frame", "wheel2", point=base * X, axis=-Y),
        mg.Pair("pin1", "R", "wheel1", "coupling rod", point=pin, axis=-Y),
        mg.Pair("pin2", "R", "coupling rod", "wheel2", point=pin + base * X, axis=-Y),
        mg.Pair("big end", "R", "wheel1", "piston rod", point=pin, axis=-Y),
        mg.Pair("crosshead", "R", "piston rod", "piston", point=head, axis=-Y),
        mg.Pair("piston", "P", "frame", "piston", point=head, axis=X),
    ]
    loads = [mg.Effort("axle1", -brake[0]), mg.Effort("axle2", -brake[1])]
    m = drawn.made(mg.Mechanism("coupled rods", pairs=pairs, drives=["axle1"], loads=loads))
    angles = np.deg2rad([35, 70, 100, 145, 220, 310])
    s = mg.solve(m, {"axle1": angles - start}, actuate=["piston"])
    np.testing.assert_allclose(s["axle2"].position[:, 0], angles - start, atol=1e-9)
    for k, angle in enumerate(angles):
        pin = crank * flat(np.cos(angle), np.sin(angle))
        head = flat(pin[0] - np.sqrt(long**2 - pin[2] ** 2), 0)
        pull = brake[1] / moment(pin, X)  # the coupling rod along x turns the second wheel against its brake
        push = (brake[0] + brake[1]) / moment(pin, unit(pin - head))
        np.testing.assert_allclose(drawn.inside(s, "pin2")[k], [pull, 0], rtol=1e-8, atol=1e-6)
        by_hand = -push * unit(pin - head)
        np.testing.assert_allclose(drawn.inside(s, "big end")[k], by_hand[[0, 2]], rtol=1e-8, atol=1e-6)
        assert s["piston"].effort[k, 0] == pytest.approx(-by_hand[0], rel=1e-8)
        np.testing.assert_allclose(drawn.inside(s, "axle1")[k], (by_hand + pull * X)[[0, 2]], rtol=1e-8, atol=1e-6)


def test_screw_press() -> None:
    """A screw of 8 mm lead in a fixed nut on a ram between guides: 2 pi T = F lead, from either end."""
    lead, force, mass = 0.008, 25e3, 60.0
    pairs = [
        mg.Pair("nut", "H", "frame", "screw", point=(0, 0, 1.0), axis=Z, lead=lead),
        mg.Pair("collar", "R", "screw", "ram", point=(0, 0, 0.6), axis=Z),
        mg.Pair("guide", "P", "frame", "ram", point=(0.3, 0, 0.5), axis=Z),
    ]
    loads = [WEIGHT, mg.ForceLaw("guide", law=mg.ForceTable(x=[-0.02, -0.01, 0], force=[force, 0, 0]))]
    ram = mg.Link("ram", mass, (0, 0, 0.5))
    m = mg.Mechanism("screw press", links(ram, pairs=pairs), pairs, ["nut"], loads)
    stays_in_space(m)
    turns = np.array([0.0, -1.0, -2.5])
    s = mg.solve(m, {"nut": 2 * np.pi * turns})
    np.testing.assert_allclose(s["guide"].position[:, 0], lead * turns, atol=1e-12)
    axial = mass * G - np.array([0, 0, force])  # which lifts the ram, or presses it on
    np.testing.assert_allclose(s["nut"].effort[:, 0], axial * lead / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(s["collar"].components["Fz"], axial, rtol=1e-9)
    stretched = mg.solve(m, {"guide": lead * turns})  # backwards: the ram pushed, a screw without friction spins
    np.testing.assert_allclose(stretched["guide"].effort[:, 0], axial, rtol=1e-9)


def test_bracket() -> None:
    """A beam on a ball at the wall, held by two ties from its end, so that it may still spin: ties and push of the beam at its end."""
    end, load = np.array([1.5, 0, 0]), np.array([300.0, 200, -5000])
    walls = np.array([(0, 0.8, 0.9), (0, -0.8, 0.9)])
    pairs = [
        mg.Pair("wall", "S", "frame", "beam", point=(0, 0, 0)),
        *rod("tie0", "frame", "beam", walls[0], end),
        *rod("tie1", "frame", "beam", walls[1], end),
    ]
    beam = mg.Link("beam", 80.0, end / 2, points={"end": end})
    m = mg.Mechanism(
        "bracket", links(beam, pairs=pairs), pairs, [], [WEIGHT, mg.Wrench("beam", force=load, point="end")]
    )
    stays_in_space(m)
    s = mg.solve(m)
    pulls = unit(walls - end)
    # moments about the wall: at the end the ties take the load and half the weight, but for a push along the beam
    half = np.array([0, 0, -40 * G])
    by_hand = np.linalg.solve(np.column_stack([*pulls, X]), -load - half)
    for i in range(2):
        np.testing.assert_allclose(s[f"tie{i}b"].force, by_hand[i] * pulls[i], rtol=1e-9, atol=1e-7)
        np.testing.assert_allclose(s[f"tie{i}a"].force, by_hand[i] * pulls[i], rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(s["wall"].force, by_hand[2] * X - half, rtol=1e-9, atol=1e-7)
