"""Friction between teeth and limits of belts against the formulas of textbooks.

Gears and worms: G. Niemann and H. Winter, Maschinenelemente II, III, 2003 (chapters 21, 24). Planetary trains: loss of the train at rest of
its carrier. Belts: Euler, Eytelwein.
"""

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
FULL = np.deg2rad(20.0)
LOAD = 3.0


def moved(m: mg.Mechanism, rate: float, *loads: object, **more: object) -> mg.Solution:
    return mg.solve(m, {m.drives[0].freedom: mg.Motion(0.2, velocity=rate)}, loads=[*m.loads, *loads], **more)


def shafts(**at: float) -> list[mg.Pair]:
    return [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=Z) for k, x in at.items()]


def stage(form: str = "mesh", helix: float = 0.0, inner: bool = False) -> mg.Mechanism:
    """20 teeth drive 40 (84 inside); as gears on their links, or as a coupling of freedoms."""
    z = 84 if inner else 40
    d = 0.002 * (z - 20 if inner else z + 20) / 2 / np.cos(helix)
    if form == "mesh":
        gears = [
            mg.Gear("p", "p", 20, (0, 0, 0), Z, module=0.002, helix_angle=helix),
            mg.Gear("w", "w", z, (d, 0, 0), Z, module=0.002, helix_angle=helix if inner else -helix, internal=inner),
        ]
        return mg.Mechanism(
            "stage", pairs=shafts(p=0.0, w=d), gears=gears, couplings=[mg.Mesh("t", "p", "w")], drives=["p"]
        )
    teeth = mg.SpurGears("t", "p", "w", teeth=(20, z), module=0.002, helix_angle=helix, internal=inner)
    return mg.Mechanism("stage", pairs=shafts(p=0.0, w=d), couplings=[teeth], drives=["p"])


def niemann(mu: float, z1: float, u: float, helix: float = 0.0) -> float:
    """Loss of standard gears over the power: mu pi (u + 1)(1 - e + e1^2 + e2^2) / (z1 u cos beta_b); u < 0 for a ring."""
    at = np.arctan(np.tan(FULL) / np.cos(helix))
    base = np.arcsin(np.sin(helix) * np.cos(FULL))
    parts = []
    for z, out in ((z1, 1.0), (u * z1, np.sign(u))):
        r, tip = z / np.cos(helix) / 2, z / np.cos(helix) / 2 + 1.0
        k = r * np.cos(at)
        parts.append((np.sqrt(tip**2 - k**2) - abs(k) * np.tan(at)) * out / (np.pi * np.cos(at) / np.cos(helix)))
    e1, e2 = parts
    if max(e1, e2) <= 1:
        mean = (1 - e1 - e2 + e1**2 + e2**2) / 2
    else:  # beyond the formula: every phase of the teeth, the load shared by those in contact
        s = (np.arange(20000) + 0.5) / 20000 + np.arange(-3, 4)[:, None]
        there = (s >= -e1) & (s <= e2)
        mean = ((np.abs(s) * there).sum(axis=0) / there.sum(axis=0)).mean()
    return float(mu * 2 * np.pi * (u + 1) * mean / (z1 * u * np.cos(base)))


@pytest.mark.parametrize("form", ["mesh", "coupling"])
@pytest.mark.parametrize(("helix", "inner"), [(0.0, False), (0.35, False), (0.0, True)])
def test_mean_loss_of_cylindrical_gears(form: str, helix: float, inner: bool) -> None:
    """Power over the power between the teeth without their friction: that of Niemann and Winter, in both directions."""
    m, mu, u = stage(form, helix, inner), 0.05, -4.2 if inner else 2.0
    for rate in (4.0, -4.0):
        s = moved(m, rate, mg.Effort("w", LOAD), mg.Friction("t", mu=mu))
        t = s.coupling("t")
        base = 0.02 / np.cos(helix) * np.cos(np.arctan(np.tan(FULL) / np.cos(helix)))
        lean = np.cos(np.arcsin(np.sin(helix) * np.cos(FULL)))
        between = t.normal_force * lean * base * 4.0
        assert t.loss / between == pytest.approx(niemann(mu, 20, u, helix), rel=1e-4 if inner else 1e-9)
        assert s.losses == {"t": t.loss}
        assert s["p"].effort[0] * rate + s.load(0).power == pytest.approx(t.loss, rel=1e-10)
        assert s.load(1).power == -t.loss
        assert abs(s.checks.power) < 1e-13
        assert (s["w"].friction == 0).all()
        assert s["w"].applied_effort == pytest.approx(LOAD)


def test_free_bodies_hold_the_friction_of_teeth() -> None:
    s = moved(stage(), 4.0, mg.Effort("w", LOAD), mg.Friction("t", mu=0.1))
    for link in ("p", "w"):
        assert np.abs(mg.free_body(s, link).sum).max() < 1e-12
    smooth = moved(stage(), 4.0, mg.Effort("w", LOAD))
    # the couple that rubs is borne by the tooth force: the bearings carry what the teeth do
    assert np.linalg.norm(s["p"].force) == pytest.approx(float(s.coupling("t").normal_force), rel=1e-12)
    assert float(smooth.coupling("t").normal_force) == pytest.approx(LOAD / (0.04 * np.cos(FULL)), rel=1e-12)


@pytest.mark.parametrize("form", ["mesh", "coupling"])
@pytest.mark.parametrize("inner", [False, True])
def test_an_efficiency_holds_whichever_gear_drives(form: str, inner: bool) -> None:
    """Power out over power in; the load drives where it turns with its sense."""
    m, eta = stage(form, inner=inner), 0.97
    for rate in (4.0, -4.0):
        s = moved(m, rate, mg.Effort("w", LOAD), mg.Friction("t", efficiency=eta))
        into, load = float(s["p"].effort[0] * rate), float(s.load(0).power)
        assert (eta if load < 0 else 1 / eta) == pytest.approx(-load / into, rel=1e-12)
        assert s.coupling("t").loss == pytest.approx((1 - eta) * max(into, load), rel=1e-10)


def test_a_stage_on_balls_loses_what_one_on_hinges_does() -> None:
    """The relation from the poses, shafts in a ball and a ball in a groove."""
    pairs = []
    for k, x in (("p", 0.0), ("w", 0.06)):
        pairs += [
            mg.Pair(f"{k}S", "S", "frame", k, point=(x, 0, -0.04)),
            mg.Pair(f"{k}G", "Sg", "frame", k, point=(x, 0, 0.06), axis=Z),
            mg.Pair(f"{k}F", "Fr", "frame", k, point=(x, 0, 0), axis=Z),
        ]
    hinged = stage()
    m = mg.Mechanism("balls", pairs=pairs, gears=hinged.gears, couplings=hinged.couplings, drives=["pF.Rz"])
    for torque in (LOAD, -LOAD):
        for more in ({"mu": 0.1}, {"efficiency": 0.9}):
            s = moved(m, 4.0, mg.Effort("wF.Rz", torque), mg.Friction("t", **more))
            t = moved(hinged, 4.0, mg.Effort("w", torque), mg.Friction("t", **more))
            assert s["pF"].effort[-1] == pytest.approx(t["p"].effort[0], rel=1e-10)
            assert np.linalg.norm(s["wS"].force + s["wG"].force) == pytest.approx(float(t["w"].magnitude), rel=1e-10)
            assert abs(s.checks.equilibrium) < 1e-12


def test_the_equations_hold_with_friction() -> None:
    """The printed equations of a state give the reactions and efforts of the solution."""
    dry = [mg.Friction("t", mu=0.1), *(mg.Friction(k, mu=0.15, radius=0.008, length=0.03) for k in "pw")]
    m = stage()
    s = moved(m, 4.0, mg.Effort("w", LOAD), *dry)
    f = mg.formulate(m, "minimal")
    found = dict(zip((u.name for u in f.unknowns), f.solve(s.state()), strict=True))
    told = {f"{k}.{name}": float(value) for k in "pw" for name, value in s[k].components.items()}
    for value in (*told.values(), float(s["p"].effort[0])):
        assert min(abs(value - other) for other in found.values()) < 1e-9 * max(map(abs, found.values()))


def test_gears_in_series_multiply_their_efficiencies() -> None:
    pairs = shafts(a=0.0, b=0.06, c=0.12)
    gears = [mg.Gear(n, n, z, (x, 0, h), Z, module=0.002) for n, z, x, h in (("a", 20, 0.0, 0.0), ("b", 40, 0.06, 0.0))]
    gears += [
        mg.Gear("b2", "b", 20, (0.06, 0, 0.05), Z, module=0.002),
        mg.Gear("c", "c", 40, (0.12, 0, 0.05), Z, module=0.002),
    ]
    m = mg.Mechanism(
        "train", pairs=pairs, gears=gears, couplings=[mg.Mesh("one", "a", "b"), mg.Mesh("two", "b2", "c")], drives=["a"]
    )
    s = moved(m, 5.0, mg.Effort("c", -LOAD), mg.Friction("one", efficiency=0.97), mg.Friction("two", efficiency=0.95))
    assert s.efficiency("loads[0]") == pytest.approx(0.97 * 0.95, rel=1e-12)


@pytest.mark.parametrize("form", ["mesh", "coupling"])
@pytest.mark.parametrize("sun_drives", [True, False])
def test_a_planetary_train_with_its_ring_fixed(form: str, sun_drives: bool) -> None:
    """(1 + i eta0) / (1 + i) from the sun, (1 + i) / (1 + i / eta0) from the carrier; eta0: both meshes at rest of the carrier."""
    zs, zp, zr, a = 24, 30, 84, 0.054
    pairs = [
        mg.Pair("C", "R", "frame", "carrier", point=(0, 0, 0), axis=Z),
        mg.Pair("S", "R", "frame", "sun", point=(0, 0, 0), axis=Z),
        mg.Pair("P", "R", "carrier", "planet", point=(a, 0, 0), axis=Z),
    ]
    if form == "mesh":
        gears = [
            mg.Gear("s", "sun", zs, (0, 0, 0), Z, module=0.002), mg.Gear("p", "planet", zp, (a, 0, 0), Z, module=0.002),
            mg.Gear("r", "frame", zr, (0, 0, 0), Z, module=0.002, internal=True),
        ]  # fmt: skip
        couplings = [mg.Mesh("sp", "s", "p"), mg.Mesh("pr", "p", "r")]
    else:
        gears = []
        couplings = [
            mg.SpurGears("sp", "S", "P", teeth=(zs, zp), module=0.002),
            mg.SpurGears("pr", "P", "C", teeth=(zp, zr), module=0.002, internal=True),
        ]
    m = mg.Mechanism("planetary", pairs=pairs, gears=gears, couplings=couplings, drives=["S" if sun_drives else "C"])
    one, two, i = 0.96, 0.98, zr / zs
    dry = [mg.Friction("sp", efficiency=one), mg.Friction("pr", efficiency=two)]
    s = moved(m, 5.0, mg.Effort("C" if sun_drives else "S", -LOAD), *dry)
    wanted = (1 + i * one * two) / (1 + i) if sun_drives else (1 + i) / (1 + i / (one * two))
    assert s.efficiency("loads[0]") == pytest.approx(wanted, rel=1e-11)
    assert abs(s.checks.power) < 1e-13


def worm(form: str, mu: float, load: float, starts: int = 2) -> mg.Mechanism:
    pairs = [
        mg.Pair("A", "R", "frame", "worm", point=(0, 0, 0), axis=X), mg.Pair("B", "R", "frame", "wheel", point=(0, 0.05, 0), axis=Z),
    ]  # fmt: skip
    loads = [mg.Effort("B", load), mg.Friction("t", mu=mu)]
    if form == "mesh":
        gears = [
            mg.Worm("w", "worm", starts, (0, 0, 0), X, radius=0.01),
            mg.WormWheel("v", "wheel", 40, (0, 0.05, 0), Z),
        ]
        return mg.Mechanism(
            "worm", pairs=pairs, gears=gears, couplings=[mg.Mesh("t", "w", "v")], drives=["A"], loads=loads
        )
    gears = mg.WormGear("t", "A", "B", teeth=(starts, 40), radius=0.01)
    return mg.Mechanism("worm", pairs=pairs, couplings=[gears], drives=["A"], loads=loads)


@pytest.mark.parametrize("form", ["mesh", "coupling"])
def test_worm(form: str) -> None:
    """eta = (cos an - mu tan g) / (cos an + mu cot g) from the worm, (cos an - mu cot g) / (cos an + mu tan g) from the wheel."""
    mu, tan_g = 0.06, 0.04 * 2 / 40 / 0.01
    forward = (np.cos(FULL) - mu * tan_g) / (np.cos(FULL) + mu / tan_g)
    back = (np.cos(FULL) - mu / tan_g) / (np.cos(FULL) + mu * tan_g)
    seen = set()
    for rate in (3.0, -3.0):
        for load in (LOAD, -LOAD):
            s = moved(worm(form, mu, load), rate)
            into, power = float(s["A"].effort[0] * rate), float(s.load(0).power)
            wanted = forward if power < 0 else 1 / back
            seen.add(power < 0)
            assert -power / into == pytest.approx(wanted, rel=1e-10)
            speed = np.linalg.norm(s.coupling("t").sliding)
            assert s.coupling("t").loss == pytest.approx(mu * s.coupling("t").normal_force * speed, rel=1e-10)
            assert np.abs(mg.free_body(s, "wheel").sum).max() < 1e-10
    assert seen == {True, False}


@pytest.mark.parametrize("form", ["mesh", "coupling"])
def test_a_worm_locks_from_its_lead_on(form: str) -> None:
    """At rest the load holds by itself from mu = cos an tan g on; the ends of the range are both motions."""
    limit = np.cos(FULL) * 0.04 * 2 / 40 / 0.01
    for mu, locks in ((limit * 0.999, False), (limit * 1.001, True)):
        s = mg.solve(worm(form, mu, LOAD), {"A": 0.2})
        assert bool(s.self_locking) is locks
        ends = sorted(float(moved(worm(form, mu, LOAD), rate)["A"].effort[0]) for rate in (-1.0, 1.0))
        assert s["A"].effort_range[0] == pytest.approx(ends, rel=1e-10)


def test_bevel_gears_lose_as_the_spur_gears_of_their_back_cones() -> None:
    """Shafts at right angles: teeth z / cos of the cones against each other, at the relative angular velocity."""
    za, zb, mu = 20, 40, 0.07
    pairs = [
        mg.Pair("A", "R", "frame", "p", point=(0.1, 0, 0), axis=X),
        mg.Pair("B", "R", "frame", "w", point=(0, 0.1, 0), axis=Y),
    ]
    gears = mg.BevelGears("t", "A", "B", teeth=(za, zb), module=0.002)
    m = mg.Mechanism("bevel", pairs=pairs, couplings=[gears], drives=["A"])
    s = moved(m, 4.0, mg.Effort("B", LOAD), mg.Friction("t", mu=mu))
    cones = np.arctan(za / zb), np.arctan(zb / za)
    va, vb = za / np.cos(cones[0]), zb / np.cos(cones[1])
    # the loss of the spur gears per power, at the power between the teeth here: normal force, base radius of a, its rate
    between = float(s.coupling("t").normal_force) * 0.02 * np.cos(FULL) * 4.0
    assert s.coupling("t").loss / between == pytest.approx(niemann(mu, va, vb / va), rel=1e-9)
    both = [
        mg.BevelGear(n, n, z, p, e, module=0.002)
        for n, z, p, e in (("p", za, (0.1, 0, 0), X), ("w", zb, (0, 0.1, 0), Y))
    ]
    other = mg.Mechanism("bevel", pairs=pairs, gears=both, couplings=[mg.Mesh("t", "p", "w")], drives=["A"])
    t = moved(other, 4.0, mg.Effort("B", LOAD), mg.Friction("t", mu=mu))
    assert t["A"].effort == pytest.approx(s["A"].effort, rel=1e-12)


def rack(**friction: float) -> mg.Solution:
    pairs = [
        mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "frame", "r", point=(0, -0.02, 0), axis=X),
    ]
    gears = [mg.Gear("p", "p", 20, (0, 0, 0), Z, module=0.002), mg.GearRack("r", "r", (0, -0.02, 0), X, Y, 0.002)]
    m = mg.Mechanism("rack", pairs=pairs, gears=gears, couplings=[mg.Mesh("t", "p", "r")], drives=["A"])
    return moved(m, 4.0, mg.Effort("B", -50.0), mg.Friction("t", **friction))


def test_a_rack_is_a_wheel_without_end() -> None:
    s = rack(mu=0.05)
    reach = [np.sqrt(11**2 - (10 * np.cos(FULL)) ** 2) - 10 * np.sin(FULL), 1 / np.sin(FULL)]
    e1, e2 = np.array(reach) / np.pi / np.cos(FULL)
    # two pairs of teeth or one: niemann with u without end
    wanted = 0.05 * np.pi * (1 - e1 - e2 + e1**2 + e2**2) / 20
    between = float(s.coupling("t").normal_force) * 0.02 * np.cos(FULL) * 4.0
    assert s.coupling("t").loss / between == pytest.approx(wanted, rel=1e-9)
    assert rack(efficiency=0.9).efficiency("loads[0]") == pytest.approx(0.9, rel=1e-12)


def test_teeth_and_bearings_rub_together() -> None:
    """One system: power in is power out and all losses, whichever flank; without friction it is the smooth result."""
    for torque in (LOAD, -LOAD):
        dry = [mg.Friction("t", mu=0.1), *(mg.Friction(k, mu=0.15, radius=0.008) for k in "pw")]
        s = moved(stage(), 4.0, mg.Effort("w", torque), *dry)
        lost = s.losses
        assert all(value > 0 for value in lost.values())
        assert s["p"].effort[0] * 4.0 + s.load(0).power == pytest.approx(sum(lost.values()), rel=1e-11)
        assert abs(s.checks.power) < 1e-13
        smooth, none = (
            moved(stage(), 4.0, mg.Effort("w", torque)),
            moved(stage(), 4.0, mg.Effort("w", torque), mg.Friction("t", mu=0.0)),
        )
        assert none["p"].effort == pytest.approx(smooth["p"].effort, rel=1e-13)


def test_links_swapped_planar_in_space_and_in_other_units() -> None:
    loads = (mg.Effort("w", LOAD), mg.Friction("t", mu=0.1))
    one = moved(stage(), 4.0, *loads)["p"].effort[0]
    m = stage()
    swapped = m.replace(couplings=[mg.Mesh("t", "w", "p")])
    assert moved(swapped, 4.0, *loads)["p"].effort[0] == pytest.approx(one, rel=1e-12)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], (0.3, -0.2, 0.5)
    assert moved(m.moved(pose), 4.0, *loads)["p"].effort[0] == pytest.approx(one, rel=1e-11)
    assert moved(m.to_planar(), 4.0, *loads)["p"].effort[0] == pytest.approx(one, rel=1e-12)
    si = m.replace(loads=loads, units={"length": "m", "mass": "kg", "time": "s"})
    assert moved(si.to_units(length="mm", mass="t"), 4.0)["p"].effort[0] == pytest.approx(1e3 * one, rel=1e-11)
    for engine in ("dense", "sparse"):
        for method in ("loop_wrench", "newton_euler", "printed"):
            assert moved(m, 4.0, *loads, engine=engine, method=method)["p"].effort[0] == pytest.approx(one, rel=1e-11)


def test_a_belt_slips_where_the_ratio_of_its_strands_is_e_to_the_mu_wrap() -> None:
    mu, R = 0.3, 0.05
    pulleys = [mg.Pulley(k, k, (x, 0, 0), Z, radius=R) for k, x in (("p", 0.0), ("w", 0.5))]
    ratio = np.exp(mu * np.pi)
    # T1 - T2 = 2 M / (2 R), T1 + T2 = 2 * 300: at the limit T1 = ratio T2
    limit = 600 * (ratio - 1) / (ratio + 1) * R
    for part in (0.99, 1.0, 1.01):
        m = mg.Mechanism(
            "belt", pairs=shafts(p=0.0, w=0.5), drives=["p"], gears=pulleys,
            couplings=[mg.BeltDrive("b", over=["p", "w"], pretension=300.0, toothed=False)],
            loads=[mg.Effort("w", part * limit), mg.Friction("b", mu=mu)],
        )  # fmt: skip
        found = mg.solve(m, {"p": 0.0})
        assert [str(note)[:12] for note in found.warnings] == ["belt b slips"] * (part > 1)
        margin = found.coupling("b").slip_margin
        tight, slack = 300 + part * limit / R / 2, 300 - part * limit / R / 2
        assert margin["p"] == pytest.approx(ratio * slack / tight - 1, rel=1e-9, abs=1e-12)
    short = mg.Belt("b", "p", "w", radii=(0.05, 0.1))
    wrap = np.pi - 2 * np.arcsin(0.05 / 0.5)
    m = mg.Mechanism("belt", pairs=shafts(p=0.0, w=0.5), drives=["p"], couplings=[short], loads=[mg.Effort("w", 5.0)])
    s = mg.solve(m, {"p": 0.0}, loads=[*m.loads, mg.Friction("b", mu=mu, preload=20.0)])
    assert s.coupling("b").slip_margin == pytest.approx(np.exp(mu * wrap) * 20 / 70 - 1)
    other = mg.solve(m, {"p": 0.0}, loads=[*m.loads, mg.Friction("b", mu=mu, preload=20.0, wrap=3.0)])
    assert other.coupling("b").slip_margin == pytest.approx(np.exp(mu * 3.0) * 20 / 70 - 1)
    assert not s.losses


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"mu": 0.1, "radius": 0.1}, "radius: has no meaning for a mesh coupling"),
        ({}, "mu: is missing"),
        ({"mu": 0.1, "efficiency": 0.9}, "both are given"),
        ({"efficiency": 1.1}, "efficiency"),
        ({"mu": 0.1, "wrap": 1.0}, "wrap: has no meaning"),
    ],
)
def test_faults(more: dict[str, float], told: str) -> None:
    with pytest.raises(mg.DeclarationError, match=told):
        stage().replace(loads=[mg.Friction("t", **more)])


def test_more_faults() -> None:
    twice = [mg.Friction("t", mu=0.1), mg.Friction("t", mu=0.2)]
    with pytest.raises(mg.DeclarationError, match="is declared before"):
        stage().replace(loads=twice)
    with pytest.raises(mg.DeclarationError, match="nothing of it rubs"):
        mg.Mechanism(
            "gears",
            pairs=shafts(p=0.0, w=0.06),
            couplings=[mg.Coupling({"p": 1, "w": 2}, name="t")],
            loads=[mg.Friction("t", mu=0.1)],
        )
    pairs = [
        mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "frame", "r", point=(0, -0.02, 0), axis=X),
    ]
    with pytest.raises(mg.DeclarationError, match="takes the numbers of its teeth"):
        mg.Mechanism(
            "rack", pairs=pairs, couplings=[mg.Rack("t", "A", "B", radius=0.02)], loads=[mg.Friction("t", mu=0.1)]
        )
    with pytest.raises(mg.DeclarationError, match="gear in a ring"):
        moved(stage(inner=True), 1.0, mg.Effort("w", -LOAD), mg.Friction("t", efficiency=0.1))


@pytest.mark.parametrize("name", ["g.pressure_angle", "B.point.x"])
@pytest.mark.parametrize("function", [False, True])
def test_studies_over_what_decides_the_loss_of_teeth(name, function):
    """How far teeth slide follows from each variant's own numbers: every variant as it is solved alone, forces and loss."""

    def variant(value):
        angle, x = (value, 0.06) if name == "g.pressure_angle" else (0.35, value)
        pairs = [
            mg.Pair(k, "R", "frame", link, point=(at, 0, 0), axis=(0, 0, 1))
            for k, link, at in [("A", "p", 0), ("B", "w", x)]
        ]
        teeth = mg.SpurGears("g", "A", "B", teeth=(20, 40), pressure_angle=angle)
        return mg.Mechanism(
            "g", pairs=pairs, couplings=[teeth], drives=["A"], loads=[mg.Effort("B", -3.0), mg.Friction("g", mu=0.1)]
        )

    ends = [0.25, 0.45] if name == "g.pressure_angle" else [0.05, 0.07]
    drive, outputs = {"A": mg.Motion([0.0, 1.0], velocity=1.0)}, ["g.loss", "g.normal_force", "g.force"]
    source = (lambda **given: variant(*given.values())) if function else variant(sum(ends) / 2)
    label = "value" if function else name
    found = mg.study(source, {label: ends}, outputs, 2, motions=drive, sampling="grid")
    for i, value in enumerate(found.parameters[label]):
        c = mg.solve(variant(value), drive).coupling("g")
        for output, expected in zip(outputs, (c.loss, c.normal_force, c.force), strict=True):
            np.testing.assert_allclose(found.outputs[output][i], expected, rtol=1e-9, atol=1e-12)
    assert np.ptp(found.outputs["g.loss" if name == "g.pressure_angle" else "g.normal_force"][:, 0]) > 0.005


@pytest.mark.parametrize(("preload", "told"), [(0.0, True), (1.0, False)])
def test_a_belt_without_tension_in_its_slack_strand_is_told_what_to_give(preload, told):
    pairs = [
        mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
        for k, link, x in [("A", "p", 0), ("B", "w", 0.5)]
    ]
    m = mg.Mechanism(
        "belt", pairs=pairs, couplings=[mg.Belt("g", "A", "B", radii=(0.1, 0.2))], drives=["A"],
        loads=[mg.Effort("B", -3.0), mg.Friction("g", mu=0.3, preload=preload)],
    )  # fmt: skip
    words = [str(w) for w in mg.solve(m, {"A": mg.Motion([0.0, 1.0], velocity=1.0)}).warnings]
    assert [("belt g slips" in w, "preload=" in w) for w in words] == [(True, told)]
