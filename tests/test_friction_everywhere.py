"""Machines with friction in every form of their declaration: at rest, smooth, swapped, moved, in other units, with all engines, planar.

Wedges and toggles: J. E. Shigley and J. J. Uicker, Theory of Machines and Mechanisms, 1995, chapter 13.
"""

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
W = 100.0
SI = {"length": "m", "mass": "kg", "time": "s"}


def shaft(mu: float, *forces: tuple[tuple[float, float], tuple[float, float, float]], **more: object) -> mg.Mechanism:
    pin = mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=Z)
    loads = [mg.Wrench("wheel", force=(*f, 0), point=p) for f, p in forces]
    return mg.Mechanism(
        "shaft", pairs=[pin], drives=["A"], loads=[*loads, mg.Friction("A", mu=mu, radius=0.02, **more)], units=SI
    )


def wedge(mu: float, slope: float = 0.3, bed: float = 0.05, guide: float = 0.1) -> mg.Mechanism:
    """A wedge driven under a block in a guide; all three faces rub."""
    along = (np.cos(slope), np.sin(slope), 0.0)
    pairs = [
        mg.Pair("A", "P", "frame", "wedge", point=(0, 0, 0), axis=X), mg.Pair("B", "P", "wedge", "block", point=(0.1, 0.05, 0), axis=along),
        mg.Pair("C", "P", "frame", "block", point=(0.1, 0.2, 0), axis=Y),
    ]  # fmt: skip
    dry = [mg.Friction(k, mu=part * mu) for k, part in (("A", bed / 0.15), ("B", 1.0), ("C", guide / 0.15))]
    load = mg.Wrench("block", force=(0, -W, 0), point=(0.1, 0.2, 0))
    return mg.Mechanism("wedge", pairs=pairs, drives=["A"], loads=[load, *dry], units=SI)


def toggle(mu: float, angle: float = 0.3, length: float = 0.2) -> mg.Mechanism:
    """A bar between a slide that is driven down and one that is pressed against: smooth slides, rough pins of the bar."""
    top, foot = (0, length * np.sin(angle), 0), (length * np.cos(angle), 0, 0)
    pairs = [
        mg.Pair("A", "P", "frame", "top", point=top, axis=Y), mg.Pair("B", "R", "top", "bar", point=top, axis=Z),
        mg.Pair("C", "R", "bar", "foot", point=foot, axis=Z), mg.Pair("D", "P", "frame", "foot", point=foot, axis=X),
    ]  # fmt: skip
    dry = [mg.Friction(k, mu=mu, radius=0.01) for k in "BC"]
    load = mg.Wrench("foot", force=(-W, 0, 0), point=foot)
    return mg.Mechanism("toggle", pairs=pairs, drives=["A"], loads=[load, *dry], units=SI)


def screw(mu: float) -> mg.Mechanism:
    pair = mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=Z, pitch=0.004)
    load = mg.Wrench("nut", force=(0, 0, -W), point=(0, 0, 0))
    dry = mg.Friction("A", mu=mu, radius=0.01, flank=0.25)
    return mg.Mechanism("screw", pairs=[pair], drives=["A"], loads=[load, dry], units=SI)


def collar(mu: float) -> mg.Mechanism:
    pairs = [
        mg.Pair("A", "P", "frame", "collar", point=(0, 0, 0), axis=Z), mg.Pair("D", "P", "frame", "pusher", point=(0.2, 0, -1), axis=Z),
        mg.Pair("K", "Sp", "pusher", "collar", point=(0.2, 0, 0), axis=Z),
    ]  # fmt: skip
    load = mg.Wrench("collar", force=(0, 0, -W), point=(0, 0, 0))
    return mg.Mechanism(
        "collar", pairs=pairs, drives=["D"], loads=[load, mg.Friction("A", mu=mu, length=0.1)], units=SI
    )


CASES = {
    "pulley": lambda mu: shaft(mu, ((0, -W), (0.1, 0, 0)), ((0, -0.8 * W), (-0.1, 0, 0))),
    "bell crank": lambda mu: shaft(mu, ((0, -W), (0.1, 0, 0)), ((-0.7 * W, 0), (0, 0.15, 0))),
    "total": lambda mu: shaft(mu, ((0, -W), (0.1, 0, 0)), model="total"),
    "long bearing": lambda mu: shaft(mu, ((0, -W), (0.0, 0, 0.2)), length=0.1),
    "screw": screw,
    "collar": collar,
    "wedge": wedge,
    "toggle": toggle,
}
PLANAR = ("pulley", "bell crank", "total", "wedge", "toggle")
MU = 0.15


def power(m: mg.Mechanism, rate: float, **more: object) -> float:
    """What the drive brings at a rate of one."""
    (drive,) = m.drives
    s = mg.solve(m, {drive.freedom: mg.Motion(0.0, velocity=rate)}, **more)
    assert abs(s.checks.power) < 1e-12
    return float(s[drive.freedom.partition(".")[0]].effort[0] * rate)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_wedge(way: float) -> None:
    """V (tan(slope +- phi2) +- tan phi1), V = W / (1 -+ mu3 |tan(slope +- phi2)|): lifted, and drawn out."""
    slope, f2, f1, mu3 = 0.3, np.arctan(MU), np.arctan(0.05), 0.1
    side = np.tan(slope + way * f2)
    V = W / (1 - way * mu3 * abs(side))
    # its face rises towards x: driven against x it lifts the block
    assert power(wedge(MU), -way) == pytest.approx(way * V * (side + way * np.tan(f1)), rel=1e-11)


@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_toggle(rate: float) -> None:
    """The bar turns the same way against both slides: its force is the inner tangent of the friction circles, at asin(2 rho / l)."""
    rho, angle = 0.01 * np.sin(np.arctan(MU)), 0.3
    lean = np.arcsin(2 * rho / 0.2)
    # up: the load brings the power; down: the drive does
    assert power(toggle(MU), rate) == pytest.approx(-rate * W * np.tan(angle - rate * lean), rel=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_at_rest_the_ends_are_both_motions(name: str) -> None:
    m = CASES[name](MU)
    m = m.replace(
        loads=[load.replace(static=1.5 * load.mu) if isinstance(load, mg.Friction) else load for load in m.loads]
    )
    s = mg.solve(m, {m.drives[0].freedom: 0.0})
    low, high = s[m.drives[0].freedom.partition(".")[0]].effort_range[0]
    ends = sorted(rate * power(CASES[name](1.5 * MU), rate) for rate in (-1.0, 1.0))
    assert (low, high) == pytest.approx(ends, rel=1e-10)
    assert bool(s.self_locking) == (low < 0 < high)


@pytest.mark.parametrize("name", CASES)
def test_without_friction_it_is_the_smooth_machine(name: str) -> None:
    m = CASES[name](0.0)
    smooth = m.replace(loads=[load for load in m.loads if not isinstance(load, mg.Friction)])
    assert power(m, 1.0) == pytest.approx(power(smooth, 1.0), rel=1e-13)
    assert power(CASES[name](1e-9), 1.0) == pytest.approx(power(smooth, 1.0), rel=1e-6, abs=1e-7)


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_other_declarations_of_the_same_machine(name: str, rate: float) -> None:
    m = CASES[name](MU)
    wanted = power(m, rate)
    other = {"a": "b", "b": "a"}
    swapped = m.replace(
        pairs=[p if p.type.touching else p.replace(a=p.b, b=p.a) for p in m.pairs],
        loads=[load.replace(on=other[load.on]) if isinstance(load, mg.Friction) else load for load in m.loads],
    )
    assert power(swapped, -rate) == pytest.approx(wanted, rel=1e-10)
    pose = np.eye(4)
    c, s = np.cos(0.7), np.sin(0.7)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    pose[:3, 3] = 0.3, -0.2, 0.5
    assert power(m.moved(pose), rate) == pytest.approx(wanted, rel=1e-10)
    assert power(m.to_units(length="mm", mass="t"), rate) == pytest.approx(
        wanted * (1e3 if m.turns(m.drives[0].freedom) else 1.0), rel=1e-10
    )
    for engine in ("dense", "sparse", "auto"):
        assert power(m, rate, engine=engine) == pytest.approx(wanted, rel=1e-10)
    if name in PLANAR:
        assert power(m.to_planar(), rate) == pytest.approx(wanted, rel=1e-10)
