"""A five-rod suspension from hard points to rod forces, toe and camber over the travel of the wheel, with the strut as the actuator.

Meters, kilograms, newtons; x forward, y to the left wheel, z up. The road lifts the wheel: its center is prescribed, the strut holds it.
By hand: rods keep their lengths, five rods and the strut balance the tyre's force in six equations, and the strut's work is the tyre's.
"""

import numpy as np

import mechgraph as mg

INNER = np.array(
    [(0.10, 0.30, 0.10), (-0.10, 0.32, 0.12), (0.15, 0.25, -0.10), (-0.15, 0.27, -0.12), (0.20, 0.30, 0.00)]
)
OUTER = np.array([(0.03, 0.70, 0.15), (-0.03, 0.69, 0.14), (0.05, 0.72, -0.12), (-0.06, 0.71, -0.13), (0.14, 0.68, 0.01)])  # fmt: skip
TOP, EYE = np.array([0.02, 0.45, 0.50]), np.array([0.00, 0.66, -0.02])
HUB, AXLE, PATCH = np.array([0, 0.75, 0]), np.array([0, 0.85, 0]), np.array([0, 0.75, -0.31])
MASS, TYRE = 35.0, np.array([-600.0, -900.0, 3500.0])  # braking, cornering, wheel load
TRAVEL = np.linspace(-0.06, 0.08, 281)


def suspension() -> mg.Mechanism:
    pairs = []
    for i in range(5):
        pairs += [mg.Pair(f"I{i}", "S", "body", f"rod{i}", point=INNER[i])]
        pairs += [mg.Pair(f"O{i}", "S", f"rod{i}", "carrier", point=OUTER[i])]
    pairs += [
        mg.Pair("top", "S", "body", "tube", point=TOP),
        mg.Pair("strut", "C", "tube", "damper rod", point=(TOP + EYE) / 2, axis=EYE - TOP),
        mg.Pair("eye", "S", "damper rod", "carrier", point=EYE),
    ]
    points = {"hub": HUB, "axle": AXLE, "patch": PATCH, "eye": EYE} | {f"O{i}": OUTER[i] for i in range(5)}
    light = [mg.Link(name) for name in ("body", *(f"rod{i}" for i in range(5)), "tube", "damper rod")]
    loads = [mg.Gravity((0, 0, -9.81)), mg.Wrench("carrier", force=TYRE, point="patch")]
    units = {"length": "m", "mass": "kg", "time": "s"}
    return mg.Mechanism(
        "five-rod suspension",
        [*light, mg.Link("carrier", MASS, HUB, points=points)],
        pairs,
        ["strut.Tz"],
        loads,
        units=units,
    )


def by_hand(at: dict[str, np.ndarray], k: int) -> np.ndarray:
    """Push of the five rods and the strut on the carrier: six balances about the origin."""
    seats, ends = [*INNER, TOP], [at[f"O{i}"][k] for i in range(5)] + [at["eye"][k]]
    columns = []
    for seat, end in zip(seats, ends, strict=True):
        along = (end - seat) / np.linalg.norm(end - seat)
        columns.append(np.concatenate([along, np.cross(end, along)]))
    weight = np.array([0, 0, -9.81 * MASS])
    moment = np.cross(at["patch"][k], TYRE) + np.cross(at["hub"][k], weight)
    return np.linalg.solve(np.transpose(columns), -np.concatenate([TYRE + weight, moment]))


def main() -> None:
    m = suspension()
    print(mg.check(m).verdict)
    s = mg.solve(m, {"carrier.hub.Tz": TRAVEL}, actuate=["strut.Tz"])
    at = {name: s.link("carrier").at(name).position for name in m.link("carrier").points}
    for i in range(5):
        lengths = np.linalg.norm(at[f"O{i}"] - INNER[i], axis=1)
        assert np.allclose(lengths, np.linalg.norm(OUTER[i] - INNER[i]), rtol=1e-9)
    axle = at["axle"] - at["hub"]
    toe = np.rad2deg(np.arctan2(axle[:, 0], axle[:, 1]))
    camber = -np.rad2deg(np.arctan2(axle[:, 2], axle[:, 1]))  # negative where the top leans inwards
    push = s["strut"].effort[:, 1]
    print("travel [mm]  toe-in [deg]  camber [deg]  strut [N]  rods, + pushes the carrier [N]")
    for k in range(0, len(TRAVEL), 40):
        hand = by_hand(at, k)
        rods = []
        for i in range(5):
            along = (at[f"O{i}"][k] - INNER[i]) / np.linalg.norm(OUTER[i] - INNER[i])
            rods.append(float(s[f"O{i}"].force[k] @ along))
        assert np.allclose([*rods, push[k]], hand, rtol=1e-7)
        shown = " ".join(f"{force:7.0f}" for force in rods)
        print(f"{1e3 * TRAVEL[k]:11.0f}{toe[k]:z14.3f}{camber[k]:z14.3f}{push[k]:11.0f}  {shown}")
    work = np.trapezoid(push, np.linalg.norm(at["eye"] - TOP, axis=1))
    tyre = (at["patch"][-1] - at["patch"][0]) @ TYRE - 9.81 * MASS * (TRAVEL[-1] - TRAVEL[0])
    print(f"work of the strut {work:.2f} J, of tyre and weight {tyre:.2f} J")
    assert abs(work + tyre) < 1e-4 * abs(tyre)


if __name__ == "__main__":
    main()
