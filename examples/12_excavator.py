"""An excavator from drawing numbers to bearing forces: what the soil does to the bucket, in every pin and cylinder.

Meters, kilograms, newtons; x forward, z up, the foot of the boom at the origin. The bucket is drawn through the soil on a straight line
while its own cylinder is locked; boom and stick cylinder move the tip there. The numbers by hand are statics in the plane: a triangle for
the position, then one body after the other, moments about its pin.

``python examples/12_excavator.py excavator.html`` also writes the page to pass on: the machine in motion with all forces.
"""

import sys

import numpy as np
from numpy.typing import NDArray

import mechgraph as mg

Y, G = (0, 1, 0), 9.81
DRAWING = {  # pins (x, z) as drawn
    "A": (0.00, 0.00), "B": (5.00, 2.20), "C": (6.20, -0.50), "K": (6.05, -0.12), "L": (6.50, 0.10), "M": (6.60, -0.35),
    "boom foot": (0.60, -0.45), "boom head": (2.40, 1.55), "stick foot": (2.60, 2.10), "stick head": (4.75, 2.95),
    "bucket foot": (5.60, 1.95), "tip": (6.00, -1.95),
}  # fmt: skip
WEIGHTS = {"boom": (1800.0, (2.60, 1.60)), "stick": (900.0, (5.50, 1.10)), "bucket": (750.0, (6.50, -1.10))}
CYLINDERS = ("lift", "crowd", "curl")  # of boom, stick and bucket
SOIL = (40e3, -12e3)  # N at the tip: the soil holds the bucket back, what it carries pulls down
TIP = np.column_stack([np.linspace(8.0, 5.0, 31), np.linspace(-1.0, -2.0, 31)])


def at(name: str) -> tuple[float, float, float]:
    x, z = DRAWING[name]
    return (x, 0.0, z)


def cylinder(name: str, a: str, b: str, foot: str, head: str) -> list[mg.Pair]:
    """Ball eyes at both ends, and a rod that may turn in its barrel: pulls and pushes, and nothing else."""
    p, q = np.array(at(foot)), np.array(at(head))
    return [
        mg.Pair(f"{name} foot", "S", a, f"{name} barrel", point=p),
        mg.Pair(name, "C", f"{name} barrel", f"{name} rod", point=(p + q) / 2, axis=q - p),
        mg.Pair(f"{name} head", "S", f"{name} rod", b, point=q),
    ]


def excavator() -> mg.Mechanism:
    links = [mg.Link("frame"), mg.Link("lever"), mg.Link("tie")]
    links += [mg.Link(f"{name} {part}") for name in CYLINDERS for part in ("barrel", "rod")]
    links += [
        mg.Link(name, mass, (x, 0, z), points={"tip": at("tip")} if name == "bucket" else {})
        for name, (mass, (x, z)) in WEIGHTS.items()
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "boom", point=at("A"), axis=Y),
        mg.Pair("B", "R", "boom", "stick", point=at("B"), axis=Y),
        mg.Pair("C", "R", "stick", "bucket", point=at("C"), axis=Y),
        mg.Pair("K", "R", "stick", "lever", point=at("K"), axis=Y),
        mg.Pair("L", "S", "lever", "tie", point=at("L")),
        mg.Pair("M", "C", "tie", "bucket", point=at("M"), axis=Y),
        *cylinder("lift", "frame", "boom", "boom foot", "boom head"),
        *cylinder("crowd", "boom", "stick", "stick foot", "stick head"),
        *cylinder("curl", "stick", "lever", "bucket foot", "L"),
    ]
    soil = mg.Wrench("bucket", force=(SOIL[0], 0, SOIL[1]), point="tip")
    cylinders = [f"{name}.Tz" for name in CYLINDERS]
    units = {"length": "m", "mass": "kg", "time": "s"}
    return mg.Mechanism("excavator", links, pairs, cylinders, [mg.Gravity((0, 0, -G)), soil], units=units)


def dig(m: mg.Mechanism) -> mg.Solution:
    motion = {"bucket.tip.Tx": TIP[:, 0], "bucket.tip.Tz": TIP[:, 1], "curl.Tz": np.zeros(len(TIP))}
    return mg.solve(m, motion, actuate=[f"{name}.Tz" for name in CYLINDERS])


# By hand, in the plane (x, z); a moment is x F_z - z F_x

Plane = NDArray[np.float64]


def cross(a: Plane, b: Plane) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def carried(points: list[str], near: str, far: str, now: tuple[Plane, Plane]) -> dict[str, Plane]:
    """Points of a body whose pins ``near`` and ``far`` now stand elsewhere: complex numbers turn and shift."""
    p, q = (complex(*DRAWING[name]) for name in (near, far))
    p1, q1 = (complex(*place) for place in now)
    turn = (q1 - p1) / (q - p)
    moved = {name: p1 + turn * (complex(*DRAWING.get(name, WEIGHTS.get(name, (0, (0, 0)))[1])) - p) for name in points}
    return {name: np.array([value.real, value.imag]) for name, value in moved.items()}


def pushed(body_moment: float, pin: Plane, foot: Plane, head: Plane) -> float:
    """Push of a strut from foot to head on a body that turns about a pin and feels a moment besides."""
    return -body_moment / cross(head - pin, (head - foot) / np.linalg.norm(head - foot))


def by_hand(tip: Plane) -> dict[str, Plane | float]:
    """Cylinder pushes, and pin forces on the outer body, with the tip at a place."""
    drawn = {name: np.array(place) for name, place in DRAWING.items()}
    boom, arm, reach = np.linalg.norm(drawn["B"]), np.linalg.norm(drawn["tip"] - drawn["B"]), np.linalg.norm(tip)
    angle = np.arctan2(tip[1], tip[0]) + np.arccos((boom**2 + reach**2 - arm**2) / (2 * boom * reach))
    elbow = boom * np.array([np.cos(angle), np.sin(angle)])
    p = carried(["boom head", "stick foot", "boom"], "A", "B", (np.zeros(2), elbow))
    p |= carried(["stick head", "bucket foot", "C", "K", "L", "M", "stick", "bucket"], "B", "tip", (elbow, tip))
    weight = {name: np.array([0, -mass * G]) for name, (mass, _) in WEIGHTS.items()}
    soil = np.array(SOIL)

    def moment(bodies: list[str], pin: Plane) -> float:
        return cross(tip - pin, soil) + sum(cross(p[body] - pin, weight[body]) for body in bodies)

    def along(push: float, foot: Plane, head: Plane) -> Plane:
        return push * (head - foot) / float(np.linalg.norm(head - foot))

    tie = along(pushed(moment(["bucket"], p["C"]), p["C"], p["L"], p["M"]), p["L"], p["M"])
    bucket_cylinder = pushed(cross(p["L"] - p["K"], -tie), p["K"], p["bucket foot"], p["L"])
    stick_cylinder = pushed(moment(["stick", "bucket"], elbow), elbow, p["stick foot"], p["stick head"])
    boom_cylinder = pushed(moment(list(WEIGHTS), np.zeros(2)), np.zeros(2), drawn["boom foot"], p["boom head"])
    return {
        "lift": boom_cylinder,
        "crowd": stick_cylinder,
        "curl": bucket_cylinder,
        "A": -soil - sum(weight.values()) - along(boom_cylinder, drawn["boom foot"], p["boom head"]),
        "B": -soil - weight["stick"] - weight["bucket"] - along(stick_cylinder, p["stick foot"], p["stick head"]),
        "C": -soil - weight["bucket"] - tie,
        "K": tie - along(bucket_cylinder, p["bucket foot"], p["L"]),
        "M": tie,
    }


def main() -> None:
    m = excavator()
    print(mg.check(m))
    s = dig(m)
    hand = [by_hand(tip) for tip in TIP]
    print("Bearing table: the worst position of each pin, force on the outer body")
    print(f"{'pin':<4}{'force [kN]':>11}{'Fx [kN]':>9}{'Fz [kN]':>9}{'tip at x [m]':>14}")
    for name in ("A", "B", "C", "K", "M"):
        force = s[name].force
        worst = int(np.argmax(np.linalg.norm(force, axis=1)))
        size, (fx, _, fz) = np.linalg.norm(force[worst]), force[worst]
        print(f"{name:<4}{size / 1e3:11.1f}{fx / 1e3:9.1f}{fz / 1e3:9.1f}{TIP[worst, 0]:14.1f}")
        assert np.allclose(force[:, [0, 2]], [h[name] for h in hand], rtol=0, atol=1e-8 * size)
    for name in CYLINDERS:
        push = s[name].effort[:, m.freedom(f"{name}.Tz")[1]]
        print(f"{name}: {push.min() / 1e3:.1f} to {push.max() / 1e3:.1f} kN")
        assert np.allclose(push, [h[name] for h in hand], rtol=1e-8, atol=0)
    if len(sys.argv) > 1:
        mg.write_report(m, s, path=sys.argv[1])


if __name__ == "__main__":
    main()
