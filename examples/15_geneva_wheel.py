"""A Geneva wheel over all phases of a turn of its crank: the pin in a slot indexes the wheel by a quarter, then an arc locks it.

Marghitu's problem 2.12 asks for the freedoms of a Geneva mechanism that is drawn without numbers; here four slots at a center distance of
100 mm, a wheel of 0.004 kg m2 that also overcomes 2 N m of friction, the crank at 10 rad/s. By hand, with lambda = sin(pi / 4):

    tan b = lambda sin a / (1 - lambda cos a),  w2 / w1 = lambda (cos a - lambda) / (1 - 2 lambda cos a + lambda^2).
"""

import numpy as np

import mechgraph as mg

SLOTS, DISTANCE, SPEED = 4, 0.1, 10.0
INERTIA, FRICTION = 0.004, 2.0
RATIO = np.sin(np.pi / SLOTS)  # of the crank to the distance: the pin enters along the slot, without a blow
CRANK = RATIO * DISTANCE
ENTRY = np.pi / 2 - np.pi / SLOTS  # crank angle before the line of centers
Z = (0.0, 0.0, 1.0)
PIN = 0.006  # radius of the pin


def links() -> list[mg.Link]:
    wheel = mg.inertia.cylinder(8.0, np.sqrt(INERTIA / 4.0), 0.02)
    return [mg.Link("frame"), mg.Link("crank"), mg.Link("wheel", 8.0, (DISTANCE, 0, 0), wheel)]


def shafts() -> list[mg.Pair]:
    return [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "frame", "wheel", point=(DISTANCE, 0, 0), axis=Z),
    ]


def engaged() -> mg.Mechanism:
    """The pin in the slot on the line of centers; the wheel turns against friction while it turns."""
    slot = mg.Curve.line(
        point=(DISTANCE, 0, 0), direction=(-1, 0, 0), ends_at=(0.02, 0.08)
    )  # from the axis of the wheel
    pin = mg.Pair("C", "Ps", "wheel", "crank", curve=slot, point=(CRANK, 0, 0), radius=PIN)
    friction = mg.Effort("B", FRICTION)  # the wheel turns clockwise, seen along -z
    return mg.Mechanism("geneva, engaged", links(), [*shafts(), pin], drives=["A"], loads=[friction])


def locked(torque: float) -> mg.Mechanism:
    """The disc of the crank in the arc of the wheel, which has its axis: two pairs R on one axis, the wheel on another, stands still."""
    arc = mg.Pair("D", "R", "wheel", "crank", point=(0, 0, 0), axis=Z, second=(1, 0, 0))
    return mg.Mechanism("geneva, locked", links(), [*shafts(), arc], drives=["A"], loads=[mg.Effort("B", torque)])


def indexing() -> tuple[mg.Solution, np.ndarray]:
    m = engaged()
    assert mg.check(m).mobility == 1  # 2.12: 2 moving links, 2 pairs R, 1 pin in a slot: 6 - 4 - 1
    a = np.linspace(-ENTRY, ENTRY, 181)
    to_entry = np.linspace(0.0, -ENTRY, 30)[:-1]  # from the line of centers, where it is declared
    s = mg.solve(m, {"A": mg.Motion(np.concatenate([to_entry, a]), SPEED)})
    part = slice(len(to_entry), None)
    b = np.arctan2(RATIO * np.sin(a), 1 - RATIO * np.cos(a))
    below = 1 - 2 * RATIO * np.cos(a) + RATIO**2
    rate = SPEED * RATIO * (np.cos(a) - RATIO) / below
    second = -(SPEED**2) * RATIO * (1 - RATIO**2) * np.sin(a) / below**2
    wheel = s["B"]
    assert np.allclose(wheel.position[part, 0], -b, atol=1e-11)
    assert np.allclose(wheel.velocity[part, 0], -rate, atol=1e-10)
    assert np.allclose(wheel.acceleration[part, 0], -second, rtol=1e-9, atol=1e-8)
    needed = (INERTIA * second + FRICTION) * rate / SPEED
    assert np.allclose(s["A"].effort[part, 0], needed, atol=1e-11)
    arm = DISTANCE * np.sqrt(below)  # from the wheel's axis to the pin
    pin = s.contact("C")
    assert np.allclose(
        pin.normal_force[part], -(INERTIA * second + FRICTION) / arm, atol=1e-8
    )  # negative: on the other wall
    path = s["C"].position[part, 0]
    turns = np.rad2deg(b[-1] - b[0])
    print(
        f"engaged from {-np.rad2deg(ENTRY):.0f} to {np.rad2deg(ENTRY):.0f} deg: the wheel turns by {turns:.6f} deg, at most ",
        end="",
    )
    print(f"{rate.max():.3f} rad/s and {second.max():.1f} rad/s2, {np.abs(second[0]):.1f} rad/s2 as the pin enters")
    force, slides = pin.normal_force[part], np.linalg.norm(pin.sliding[part], axis=1)
    print(
        f"the pin uses {1e3 * np.ptp(path):.2f} mm of the slot, slides at {slides.max():.3f} m/s at most, and presses with ",
        end="",
    )
    print(f"{force.max():.1f} N on one wall, {-force.min():.1f} N on the other")
    assert np.isclose(b[-1] - b[0], 2 * np.pi / SLOTS, rtol=1e-12)
    assert np.isclose(np.ptp(path), arm.max() - arm.min(), rtol=1e-9)
    assert np.isclose(np.abs(second[0]), SPEED**2 * np.tan(np.pi / SLOTS), rtol=1e-10)
    return s, needed


def dwelling() -> mg.Solution:
    m = locked(torque=5.0)
    report = mg.check(m)
    assert (report.mobility, report.locked[0].freedoms) == (1, ("B.Rz",))
    s = mg.solve(m, {"A": mg.Motion(np.linspace(ENTRY, 2 * np.pi - ENTRY, 91), SPEED)})
    assert np.allclose(s["B"].position, 0.0, atol=1e-12)
    assert np.allclose(s["A"].effort, 0.0, atol=1e-12)  # the arc holds the wheel, not the crank's drive
    # across the line of centers the force is unique, along it disc and shafts could be strained against each other
    assert np.allclose(np.abs(s["D"].components["Fy"]), 5.0 / DISTANCE, rtol=1e-11)
    assert np.isnan(s["D"].components["Fx"]).all()
    print(
        f"locked for the other {np.rad2deg(2 * np.pi - 2 * ENTRY):.0f} deg: 5 N m on the wheel press its arc with {5.0 / DISTANCE:.1f} N"
    )
    return s


def main() -> None:
    _, needed = indexing()
    dwelling()
    a = np.linspace(-ENTRY, ENTRY, 181)
    work = np.trapezoid(needed, a)
    print(f"work of the crank in one step {work:.4f} J, of friction {FRICTION * 2 * np.pi / SLOTS:.4f} J")
    assert abs(work - FRICTION * 2 * np.pi / SLOTS) < 1e-3


if __name__ == "__main__":
    main()
