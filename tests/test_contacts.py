"""Facts of contacts against hand calculations: force and its sign, lift-off, paths, sliding and rolling, pressure by Hertz."""

import json
from pathlib import Path

import numpy as np
import pytest
from program import invoke

import mechgraph as mg

ALPHA, WEIGHT, SPEED, G = np.deg2rad(25.0), 12.0, 0.3, 9.81
STEEL = mg.Hertz(moduli=(210e9, 210e9))
UNITS = {"length": "m", "mass": "kg", "time": "s"}


def wedge(**contact: object) -> mg.Mechanism:
    """A wedge of 25 degrees slides along x and lifts a follower, which ends in a ball, along z."""
    normal = (np.sin(ALPHA), 0.0, np.cos(ALPHA))
    return mg.Mechanism(
        "wedge",
        [mg.Link("frame"), mg.Link("wedge"), mg.Link("follower", WEIGHT / G, (0, 0, 0.1))],
        [
            mg.Pair("A", "P", "frame", "wedge", point=(0, 0, -0.1), axis=(1, 0, 0)),
            mg.Pair("B", "Sp", "wedge", "follower", point=(0, 0, 0), axis=normal, second=(1, 0, 0), **contact),
            mg.Pair("C", "P", "frame", "follower", point=(0, 0, 0.2), axis=(0, 0, 1)),
        ],
        drives=["A"],
        loads=[mg.Gravity((0, 0, -G))],
        units=UNITS,
    )


def test_wedge_by_hand() -> None:
    """Normal force W / cos, sliding v / cos along the plane, pressure angles of follower and wedge 25 and 65 degrees."""
    x = np.linspace(0.0, 0.1, 6)
    s = mg.solve(wedge(closed="force", radius=0.01, hertz=STEEL), {"A": mg.Motion(x, SPEED)})
    c = s.contact("B")
    assert np.allclose(c.normal_force, WEIGHT / np.cos(ALPHA), rtol=1e-12)
    assert np.allclose(s["A"].effort[:, 0], WEIGHT * np.tan(ALPHA), rtol=1e-12)
    assert np.allclose(np.linalg.norm(c.sliding, axis=-1), SPEED / np.cos(ALPHA), rtol=1e-12)
    assert np.allclose(c.path_a, np.outer(-x / np.cos(ALPHA), (1, 0, 0)) - (0, 0, 0.01), atol=1e-12)
    down = 0.01 * np.array([-np.sin(ALPHA), 0, -np.cos(ALPHA)])
    assert np.allclose(c.point, np.outer(x * np.tan(ALPHA), (0, 0, 1)) + down, atol=1e-12)
    assert np.allclose(c.pressure_angle("follower"), ALPHA, rtol=1e-12)
    assert np.allclose(c.pressure_angle("wedge"), np.pi / 2 - ALPHA, rtol=1e-12)
    assert np.abs(c.spin).max() < 1e-12
    modulus = 210e9 / (2 * (1 - 0.3**2))
    pressure = (6 * WEIGHT / np.cos(ALPHA) * modulus**2 / (np.pi**3 * 0.01**2)) ** (1 / 3)  # a ball on a plane
    assert np.allclose(c.hertz.pressure, pressure, rtol=1e-10)
    radius = (3 * WEIGHT / np.cos(ALPHA) * 0.01 / (4 * modulus)) ** (1 / 3)
    assert np.allclose(c.hertz.along, radius, rtol=1e-10)
    assert np.allclose(c.hertz.approach, radius**2 / 0.01, rtol=1e-10)
    assert not c.lifts.any()
    assert s.warnings == ()


def swung(closed: str) -> mg.Solution:
    """The wedge swings as 0.05 sin(theta) at 25 rad/s: the follower leaves it where X w^2 tan(alpha) sin(theta) > g."""
    theta, w, X = np.deg2rad(np.arange(0.0, 360.0)), 25.0, 0.05
    motion = mg.Motion(X * np.sin(theta), X * w * np.cos(theta), -X * w**2 * np.sin(theta), t=theta / w)
    return mg.solve(wedge(closed=closed), {"A": motion})


def test_a_contact_that_is_only_pushed_says_where_it_lifts_off() -> None:
    with pytest.warns(mg.MechgraphWarning, match=r"B: follower lifts off wedge from A\.Tz = .* to A\.Tz"):
        s = swung("force")
    c, begin = s.contact("B"), np.arcsin(G / (0.05 * 25.0**2 * np.tan(ALPHA)))
    (found,) = c.lift_off
    assert s.warnings == (found,)
    assert found.begins["t"] * 25 == pytest.approx(begin, abs=1e-4)
    assert found.ends["t"] * 25 == pytest.approx(np.pi - begin, abs=1e-4)
    assert found.begins["A.Tz"] == pytest.approx(0.05 * np.sin(begin), abs=1e-5)
    theta = np.deg2rad(np.arange(0.0, 360.0))
    force = WEIGHT / G * (G - 0.05 * 25.0**2 * np.sin(theta) * np.tan(ALPHA)) / np.cos(ALPHA)
    assert np.allclose(c.normal_force, force, atol=1e-12 * np.abs(force).max())
    assert (c.lifts == (force < 0)).all()
    assert found.force == pytest.approx(-force.min(), rel=1e-9)
    assert "lifts off" in s.summary()
    assert "only pushed" in str(c)


def test_a_contact_held_on_both_sides_pulls_without_a_word() -> None:
    s = swung("form")
    assert s.contact("B").normal_force.min() < -1
    assert s.contact("B").lift_off == ()
    assert s.warnings == ()


def test_lift_off_of_every_row_of_a_batch() -> None:
    theta = np.deg2rad(np.arange(0.0, 360.0, 3.0))
    rows = [mg.Motion(0.05 * np.sin(theta + off), 0.0, -31.25 * np.sin(theta + off)) for off in (0.0, np.pi / 2)]
    both = mg.Motion(
        *(
            np.array([getattr(r, name) * np.ones(120) for r in rows])
            for name in ("position", "velocity", "acceleration")
        )
    )
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        s = mg.solve(wedge(closed="force"), {"A": both})
    found = s.contact("B").lift_off
    assert (
        [f.first // 120 for f in found] == [f.last // 120 for f in found] == [0, 1, 1]
    )  # the second begins and ends lifted off
    assert found[1].first == 120
    assert found[2].last == 239


def test_a_ball_that_rolls_does_not_slide() -> None:
    """Speed w r of the center: no sliding, the contact travels at w r over plane and ball; a locked ball slides at full speed."""
    m = mg.Mechanism(
        "ball",
        pairs=[
            mg.Pair("A", "P", "frame", "cart", point=(0, 0, 0.2), axis=(1, 0, 0)),
            mg.Pair("R", "R", "cart", "ball", point=(0, 0, 0.05), axis=(0, 1, 0)),
            mg.Pair("B", "Sp", "frame", "ball", point=(0, 0, 0.05), axis=(0, 0, 1), radius=0.05),
        ],
        drives=["A", "R"],
    )
    s = mg.kinematics(m, {"A": mg.Motion([0.0, 0.1], 0.3), "R": mg.Motion([0.0, 2.0], [6.0, 0.0])})
    c = s.contact("B")
    assert np.allclose(c.sliding, [(0, 0, 0), (0.3, 0, 0)], atol=1e-14)
    assert np.allclose(c.rolling, [(0.3, 0, 0), (0.15, 0, 0)], atol=1e-14)
    assert np.allclose(c.point, [(0, 0, 0), (0.1, 0, 0)], atol=1e-14)
    assert np.allclose(c.path_b[1], (-0.05 * np.sin(-2.0), 0, -0.05 * np.cos(-2.0)), atol=1e-14)
    assert np.isnan(c.pressure_angle("frame")).all()


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", [n for n in mg.library() if any(p.type.touching for p in mg.load(n).pairs)])
def test_no_contact_does_work_and_force_times_velocity_is_the_power(name: str) -> None:
    """The normal force is at right angles to sliding, and carries the power that both links exchange at the center of the ball."""
    m = mg.load(name)
    pairs = [p.replace(radius=0.004) if p.type.touching else p for p in m.pairs]
    s = mg.solve(m.replace(pairs=pairs), redundant="minimum_norm")
    (c,) = s.contacts.values()
    (pair,) = (p for p in pairs if p.type.touching)
    F = c.normal_force[:, None] * (c.normal * np.sign(c.normal_force)[:, None])
    size = np.linalg.norm(F, axis=-1)
    assert np.allclose(F, s[pair.name].force, atol=1e-9 * size.max())
    work = np.abs((F * c.sliding).sum(axis=-1))
    assert (work <= 1e-9 * size * np.linalg.norm(c.sliding, axis=-1).max()).all()
    V = s.link(pair.b).twist
    through = ((V[:, 3:] + np.cross(V[:, :3], c.point)) * F).sum(axis=-1)
    at_centre = (V * s[pair.name].reaction).sum(axis=-1) - (V[:, :3] * s[pair.name].moment).sum(axis=-1)
    assert np.allclose(through, at_centre, atol=1e-9 * np.abs(at_centre).max())


def test_force_in_a_groove() -> None:
    """A ball on an arm in a groove along z, loaded across: the groove holds it with what the load asks for, open towards +x."""

    def solved(load: tuple[float, float, float], closed: str) -> mg.Solution:
        pairs = [
            mg.Pair("A", "P", "frame", "ball", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "Sg", "frame", "ball", point=(0, 0, 0.1), axis=(0, 0, 1), second=(1, 0, 0), closed=closed),
        ]
        pairs[0] = mg.Pair("A", "S", "frame", "ball", point=(0, 0, 0))
        spin = mg.Pair("M", "Fr", "frame", "ball", point=(0, 0, 0), axis=(0, 0, 1))
        m = mg.Mechanism(
            "groove", pairs=[*pairs, spin], drives=["M.Rz"], loads=[mg.Wrench("ball", force=load, point=(0, 0, 0.1))]
        )
        return mg.solve(m, {"M.Rz": 0.0})

    assert solved((3.0, 4.0, 0.0), "form").contact("B").normal_force == pytest.approx(5.0)
    assert solved((-3.0, 4.0, 0.0), "force").contact("B").normal_force == pytest.approx(5.0)
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        assert solved((3.0, 4.0, 0.0), "force").contact("B").normal_force == pytest.approx(-5.0)


def roller(off: float, length: float = 0.02) -> mg.Solution:
    """A roller of radius 8 mm along x on a plane, guided along z and about y, pressed by 100 N beside its middle."""
    m = mg.Mechanism(
        "roller",
        pairs=[
            mg.Pair("G", "Guide", "frame", "roller", point=(0, 0, 0), axis=(0, 0, 1)).replace(type=GUIDE),
            mg.Pair("B", "Cp", "frame", "roller", point=(0, 0, 0), axis=(0, 0, 1), second=(1, 0, 0), closed="force", radius=0.008,
                    hertz=mg.Hertz((210e9, 100e9), (0.3, 0.35), length=length)),
        ],
        drives=["G.Tx"],
        loads=[mg.Wrench("roller", force=(0, 0, -100.0), point=(off, 0, 0))],
    )  # fmt: skip
    return mg.solve(m, {"G.Tx": 0.0})


GUIDE = mg.PairType("Guide", freedoms=["Tx", "Tz", "Ry"], reactions=["Fy", "Mx@2", "Mz@2"])


@pytest.mark.parametrize(("off", "factor", "part"), [(0.0, 1.0, 1.0), (0.002, 1.6, 1.0), (-0.008, 2 / (3 * 0.1), 0.3)])
def test_pressure_along_a_line(off: float, factor: float, part: float) -> None:
    """``sqrt(w E* / (pi R))`` with w the load per length: even, linear, and linear on what still touches."""
    c = roller(off).contact("B")
    modulus = 1 / ((1 - 0.3**2) / 210e9 + (1 - 0.35**2) / 100e9)
    assert c.normal_force == pytest.approx(100.0)
    assert c.hertz.pressure == pytest.approx(np.sqrt(factor * 100 / 0.02 * modulus / (np.pi * 0.008)), rel=1e-9)
    assert c.hertz.along == pytest.approx(part * 0.02)


def test_a_roller_that_tips_over_has_no_pressure() -> None:
    assert np.isnan(roller(0.012).contact("B").hertz.pressure)


def test_table_file_and_command_line(tmp_path: Path) -> None:
    m = wedge(closed="force", radius=0.01, hertz=STEEL).replace(drives=[mg.Drive("A", mg.Motion([0.0, 0.1], 0.3))])
    mg.save(m, tmp_path / "wedge.toml")
    assert mg.load(tmp_path / "wedge.toml") == m
    columns = mg.solve(m).columns(["contacts"])
    assert np.allclose(columns["B normal force [N]"], WEIGHT / np.cos(ALPHA))
    assert np.allclose(columns["B path on wedge:x [m]"], [0, -0.1 / np.cos(ALPHA)], atol=1e-15)
    assert "B pressure [N/m^2]" in columns
    arguments = ["solve", str(tmp_path / "wedge.toml"), "--include", "contacts", "--out", str(tmp_path / "wedge.csv")]
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    assert "least normal force [N]" in " ".join(result.stdout.split())
    assert "B pressure [N/m^2]" in (tmp_path / "wedge.csv").read_text(encoding="utf-8").splitlines()[0]
    lifted = json.loads(invoke("solve", str(tmp_path / "wedge.toml"), "--json").stdout)
    assert lifted["lift_off"] == []


def test_in_other_units() -> None:
    pytest.importorskip("pint")
    m = wedge(closed="force", radius=0.01, hertz=STEEL)
    s, t = mg.solve(m, {"A": 0.0}), mg.solve(m.to_units(length="mm", mass="t"), {"A": 0.0})
    assert t.contact("B").hertz.pressure * 1e6 == pytest.approx(s.contact("B").hertz.pressure)  # N/mm2


@pytest.mark.parametrize(
    ("type_", "given", "said"),
    [
        ("R", {"closed": "force"}, r"closed: type R is no contact of two elements; .*Sg.* are"),
        ("Sp", {"closed": "spring"}, r"closed = 'spring': expected 'form' or 'force'"),
        ("Sp", {"radius": -1.0}, r"radius = -1\.0: expected a finite number above 0"),
        ("Sp", {"hertz": STEEL}, r"radius: the pressure depends on it"),
        ("Sg", {"radius": 0.01, "hertz": mg.Hertz((1.0, 1.0), groove_radius=0.009)}, r"groove_radius = 0\.009: .* above the radius 0\.01"),
        ("Cp", {"radius": 0.01, "hertz": STEEL}, r"hertz\.length: the pressure depends on it"),
        ("Sp", {"radius": 0.01, "hertz": mg.Hertz((1.0, 1.0), (0.3, 0.7))}, r"poisson = \(0\.3, 0\.7\)"),
        ("Sp", {"radius": 0.01, "hertz": 210e9}, r"hertz = .*expected mg\.Hertz"),
    ],
)  # fmt: skip
def test_bad_contacts(type_: str, given: dict[str, object], said: str) -> None:
    pair = mg.Pair("B", type_, "frame", "b", point=(0, 0, 0), axis=(0, 0, 1), second=(1, 0, 0), **given)
    with pytest.raises(mg.DeclarationError, match=said):
        mg.Mechanism("bad", pairs=[pair, mg.Pair("C", "R", "frame", "b", point=(0, 0, 0), axis=(0, 0, 1))])


def test_what_is_no_contact_is_named() -> None:
    s = mg.solve(wedge(), {"A": 0.0})
    with pytest.raises(mg.DeclarationError, match=r"type = 'P': expected a contact of two elements \(B\)"):
        s.contact("A")
    with pytest.raises(mg.DeclarationError, match="no materials"):
        _ = s.contact("B").hertz
    with pytest.raises(mg.DeclarationError, match=r"link = 'frame': expected 'wedge' or 'follower'"):
        s.contact("B").pressure_angle("frame")


def test_in_a_response_the_times_are_named() -> None:
    """A wedge that swings freely on a spring under the follower."""
    m = wedge(closed="force").replace(
        drives=[], loads=[mg.Gravity((0, 0, -G)), mg.TorsionSpring("A", stiffness=400.0, free=0.1)]
    )
    m = m.replace(
        links=[link.replace(mass=2.0, center=(0, 0, -0.1)) if link.name == "wedge" else link for link in m.links]
    )
    with pytest.warns(mg.MechgraphWarning, match=r"follower lifts off wedge from t = .* s to t = .* s"):
        r = mg.respond(m, np.linspace(0, 1, 201), start={"A": -0.05})
    found = r.contact("B").lift_off
    assert [set(gap.begins) for gap in found] == [{"t"}] * len(found)
    for gap in found:
        inside = (gap.begins["t"] < r.t) & (gap.ends["t"] > r.t)
        assert r.contact("B").lifts[inside].all()


def test_a_motion_alone_and_what_is_not_solved_or_not_unique() -> None:
    k = mg.kinematics(mg.load("r-sg-c"))
    assert "normal force" not in str(k.contact("B"))
    assert not [name for name in k.columns(["contacts"]) if "force" in name]
    with pytest.raises(mg.MechgraphError, match="has no forces"):
        _ = k.contact("B").normal_force
    m = mg.load("r-sg-r-r")
    s = mg.solve(
        m.replace(pairs=[p.replace(closed="force") if p.name == "B" else p for p in m.pairs]),
        {"A": 1.0},
        on_reach="flag",
    )
    assert [one.status for one in s.warnings] == [str(s.status)]
    assert "no value" in str(s.contact("B")) or np.isnan(s.contact("B").sliding).all()
    ball = mg.Mechanism(
        "ball",
        pairs=[
            mg.Pair("A", "P", "frame", "cart", point=(0, 0, 0.2), axis=(1, 0, 0)),
            mg.Pair("R", "R", "cart", "ball", point=(0, 0, 0.05), axis=(0, 1, 0)),
            mg.Pair("B", "Sp", "frame", "ball", point=(0, 0, 0.05), axis=(0, 0, 1), closed="force"),
        ],
        drives=["A", "R"],
        loads=[mg.Wrench("ball", force=(0, 0, -5.0), point=(0, 0, 0.05))],
    )
    redundant = mg.solve(ball, {"A": [0.0, 0.1], "R": [0.0, 2.0]})  # what bears the ball, its shaft or the plane?
    assert np.isnan(redundant.contact("B").normal_force).all()
    assert redundant.warnings == ()
    assert "not unique" in redundant.summary()
