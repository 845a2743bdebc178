"""Gear trains: planetary trains with the ring fixed and turning, three planets and their cure, and the differential of a rear axle.

Marghitu's problems 2.11 and 2.13 ask for the freedoms of planetary trains that are drawn without numbers; here the sun has 24, a planet 18
and the ring 60 teeth of module 2 mm. By hand: Willis' equation, torques from it, tangential forces at the pitch circles.
"""

import numpy as np

import mechgraph as mg

Z = (0.0, 0.0, 1.0)
SUN, PLANET, RING, MODULE = 24, 18, 60, 0.002
LOAD = 50.0  # on the arm, N m
UNITS = {"length": "m", "mass": "kg", "time": "s"}
PINION, CROWN, WHEELS, SMALL = 9, 37, 16, 10  # teeth of the axle


def planetary(planets: int, ring_turns: bool = False, levelled: bool = False) -> mg.Mechanism:
    """Sun and arm on the frame, planets on the arm; the ring is the frame, or turns in it.

    ``levelled``: every planet has an arm of its own, and a whiffletree takes the mean of their turns to the output.
    """
    r = MODULE * (SUN + PLANET) / 2
    at_centre = {"S": "sun", "C": "arm"} | ({"G": "ring"} if ring_turns else {})
    at_centre |= {f"C{i}": f"arm {i}" for i in range(planets)} if levelled else {}
    pairs = [mg.Pair(name, "R", "frame", link, point=(0, 0, 0), axis=Z) for name, link in at_centre.items()]
    gears: list[mg.Coupling | mg.SpurGears] = []
    for i in range(planets):
        at, arm = 2 * np.pi * i / planets, f"arm {i}" if levelled else "arm"
        ring = "G" if ring_turns else f"C{i}" if levelled else "C"
        pairs.append(mg.Pair(f"P{i}", "R", arm, f"planet {i}", point=(r * np.cos(at), r * np.sin(at), 0), axis=Z))
        gears += [
            mg.SpurGears(f"sun {i}", "S", f"P{i}", teeth=(SUN, PLANET), module=MODULE),
            mg.SpurGears(f"ring {i}", ring, f"P{i}", teeth=(RING, PLANET), module=MODULE, internal=True),
        ]
    if levelled:
        gears.append(mg.Coupling({f"C{i}": 1.0 / planets for i in range(planets)} | {"C": -1.0}, name="whiffletree"))
    drives, loads = ["S", "G"] if ring_turns else ["S"], [mg.Effort("C", -LOAD)]
    return mg.Mechanism("planetary train", pairs=pairs, couplings=gears, drives=drives, loads=loads, units=UNITS)


def trains() -> None:
    turn = mg.Motion(np.linspace(0.0, 1.0, 5), 10.0)
    one = planetary(1)
    s = mg.solve(one, {"S": turn})
    assert mg.check(one).mobility == 1  # 2.11: 3 moving links, 3 pairs R, 2 pairs of teeth: 9 - 6 - 2
    assert np.allclose(s["C"].velocity, 10.0 * SUN / (SUN + RING), rtol=1e-12)
    assert np.allclose(s["S"].effort, LOAD * SUN / (SUN + RING), rtol=1e-12)
    tangential = LOAD * SUN / (SUN + RING) / (MODULE * SUN / 2)
    assert np.allclose(np.linalg.norm(s["P0"].force, axis=-1), 2 * tangential, rtol=1e-11)
    print(
        f"ring fixed: mobility 1, arm {s['C'].velocity[0, 0]:.4f} rad/s at 10 rad/s of the sun, pin {2 * tangential:.1f} N"
    )

    two = planetary(1, ring_turns=True)
    assert mg.check(two).mobility == 2  # 2.13: 4 moving links, 4 pairs R, 2 pairs of teeth: 12 - 8 - 2
    s = mg.solve(two, {"S": turn, "G": mg.Motion(np.linspace(0.0, -0.3, 5), -3.0)})
    w = {name: s[name].velocity[0, 0] for name in "SGC"}
    assert abs(SUN * (w["S"] - w["C"]) + RING * (w["G"] - w["C"])) < 1e-12  # Willis
    torques = {name: s[name].effort[0, 0] for name in "SG"}
    assert np.isclose(torques["G"] / torques["S"], RING / SUN, rtol=1e-12)
    print(
        f"ring turning: mobility 2, arm {w['C']:.4f} rad/s, torques of sun and ring {torques['S']:.3f}, {torques['G']:.3f} N m"
    )


def three_planets() -> None:
    m = planetary(3)
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 2)
    s = mg.solve(m, {"S": 0.3})
    assert np.isclose(
        s["S"].effort[0], LOAD * SUN / (SUN + RING)
    )  # torques are unique, the shares of the planets are not
    assert np.isnan([s.coupling(f"sun {i}").effort for i in range(3)]).all()
    shared = mg.solve(m, {"S": 0.3}, redundant="minimum_norm")
    even = [np.linalg.norm(shared.coupling(f"sun {i}").force) for i in range(3)]
    tangential = LOAD * SUN / (SUN + RING) / (MODULE * SUN / 2) / np.cos(np.deg2rad(20))
    assert np.allclose(even, tangential / 3, rtol=1e-8)

    cured = planetary(3, levelled=True)
    report = mg.check(cured)
    assert (report.mobility, report.redundancy) == (1, 0)
    s = mg.solve(cured, {"S": 0.3})
    shares = [float(np.linalg.norm(s.coupling(f"sun {i}").force)) for i in range(3)]
    assert np.allclose(shares, tangential / 3, rtol=1e-10)
    print(
        f"three planets: redundancy 2, only torques are unique; levelled: redundancy 0, {shares[0]:.2f} N at every planet"
    )


def rear_axle() -> mg.Mechanism:
    """x forward, y to the left wheel: propeller shaft, cage with the crown wheel, two half shafts, two planets as one."""
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    pairs = [
        mg.Pair("E", "R", "axle", "propeller shaft", point=(0.11, 0, 0), axis=x),
        mg.Pair("K", "R", "axle", "cage", point=(0, 0.03, 0), axis=y),
        mg.Pair("L", "R", "axle", "left wheel", point=(0, 0.7, 0), axis=y),
        mg.Pair("R", "R", "axle", "right wheel", point=(0, -0.7, 0), axis=y),
        mg.Pair("P", "R", "cage", "planet", point=(0.03, 0, 0), axis=x),
    ]
    gears = [
        mg.BevelGears("final drive", "E", "K", teeth=(PINION, CROWN), module=0.005),
        mg.BevelGears("left side", "L", "P", teeth=(WHEELS, SMALL), module=0.004),
        mg.BevelGears("right side", "R", "P", teeth=(WHEELS, SMALL), module=0.004),
    ]
    return mg.Mechanism(
        "rear axle", pairs=pairs, couplings=gears, drives=["L", "R"], loads=[mg.Effort("L", -800.0)], units=UNITS
    )


def differential() -> None:
    """Both wheels turn as the road asks, the left one bears 800 N m; what must the engine give, and what does the right wheel bear?"""
    m = rear_axle()
    assert mg.check(m).mobility == 2
    t = np.linspace(0.0, 1.0, 11)
    left, right = mg.Motion(28.0 * t, 28.0), mg.Motion(32.0 * t, 32.0)
    s = mg.solve(m, {"L": left, "R": right}, actuate=["E", "R"])
    speed, torque, other = s["E"].velocity[:, 0], s["E"].effort[:, 0], s["R"].effort[:, 0]
    assert np.allclose(
        np.abs(speed), (28.0 + 32.0) / 2 * CROWN / PINION, rtol=1e-12
    )  # Willis: the cage turns as the mean
    assert np.allclose(other, -800.0, rtol=1e-12)  # both wheels bear the same torque, whatever their speeds
    assert np.allclose(np.abs(torque), 2 * 800.0 * PINION / CROWN, rtol=1e-12)
    assert np.allclose(torque * speed, 800.0 * (28.0 + 32.0), rtol=1e-12)
    assert s.checks.power.max() < 1e-12
    thrust = s["E"].force[0, 0]
    print(
        f"rear axle: engine {abs(torque[0]):.1f} N m at {abs(speed[0]):.1f} rad/s, wheels {800.0:.0f} N m each, ",
        end="",
    )
    print(f"thrust in the bearing of the pinion {abs(thrust):.0f} N")


def main() -> None:
    trains()
    three_planets()
    differential()


if __name__ == "__main__":
    main()
