"""Lower pairs in place of higher ones: velocities and accelerations of all links at the position are those of the original."""

import numpy as np
import pytest

import mechgraph as mg

Z = (0.0, 0.0, 1.0)
SLOT = mg.PairType("Rt", "pin in a slot", freedoms=("Tx", "Rz"))
MOVE = mg.Motion(position=0.0, velocity=1.3, acceleration=-0.7)


def pin(name: str, a: str, b: str, x: float, y: float) -> mg.Pair:
    return mg.Pair(name, "R", a, b, point=(x, y, 0), axis=Z)


def ellipse_on_circle(radius_b: float = 0.5, u: float = 0.9) -> mg.Mechanism:
    """An elliptic cam and a round follower on a rocker."""
    P = np.array([0.1 + np.cos(u), 0.05 + 0.6 * np.sin(u), 0.0])
    n = np.array([0.6 * np.cos(u), np.sin(u), 0.0])
    n /= np.linalg.norm(n)
    cam = mg.Curve.ellipse(a=1.0, b=0.6, center=(0.1, 0.05, 0))
    follower = mg.Curve.circle(radius=radius_b, center=P + radius_b * n)
    contact = mg.Pair("C", "Kc", "cam", "rocker", point=P, curve=cam, curve_b=follower)
    return mg.Mechanism(
        "cam", pairs=[pin("A", "frame", "cam", 0, 0), contact, pin("B", "frame", "rocker", 2.2, 0.3)], drives=["A"]
    )


def flat_follower() -> mg.Mechanism:
    """An elliptic cam under a straight edge that slides."""
    u = 0.9
    P = np.array([0.1 + np.cos(u), 0.05 + 0.6 * np.sin(u), 0.0])
    n = np.array([0.6 * np.cos(u), np.sin(u), 0.0])
    contact = mg.Pair("C", "Kc", "cam", "rod", point=P, curve=mg.Curve.ellipse(a=1.0, b=0.6, center=(0.1, 0.05, 0)))
    slide = mg.Pair("B", "P", "frame", "rod", point=(0, 2, 0), axis=n)
    return mg.Mechanism("flat", pairs=[pin("A", "frame", "cam", 0, 0), contact, slide], drives=["A"])


def slot(a: str, b: str) -> mg.Mechanism:
    """A pin of b in a straight slot of a."""
    contact = mg.Pair("C", SLOT, a, b, point=(0.8, 0.5, 0), axis=Z, second=(1, 0.4, 0))
    pins = [pin("A", "frame", "crank", 0, 0), pin("B", "frame", "arm", 2.0, -0.2)]
    return mg.Mechanism("slot", pairs=[*pins, contact], frame="frame", drives=["A"])


def roller_cam() -> mg.Mechanism:
    """The roller of a rocker on an elliptic cam."""
    u = 0.9
    P = np.array([0.1 + np.cos(u), 0.05 + 0.6 * np.sin(u), 0.0])
    n = np.array([0.6 * np.cos(u), np.sin(u), 0.0])
    centre = P + 0.2 * n / np.linalg.norm(n)
    cam, rim = mg.Curve.ellipse(a=1.0, b=0.6, center=(0.1, 0.05, 0)), mg.Curve.circle(radius=0.2, center=centre)
    contact = mg.Pair("C", "Kc", "cam", "roller", point=P, curve=cam, curve_b=rim)
    pins = [
        pin("A", "frame", "cam", 0, 0),
        pin("D", "roller", "rocker", *centre[:2]),
        pin("B", "frame", "rocker", 2.2, 0.3),
    ]
    return mg.Mechanism("roller", pairs=[*pins, contact], drives=["A"])


def gears(internal: bool = False) -> mg.Mechanism:
    distance = 1.0 if internal else 3.0
    pins = [pin("A", "frame", "one", 0, 0), pin("B", "frame", "two", distance, 0)]
    mesh = mg.SpurGears("g", "A", "B", teeth=(20, 40), internal=internal)
    return mg.Mechanism("gears", pairs=pins, couplings=[mesh], drives=["A"])


def rack() -> mg.Mechanism:
    pairs = [pin("A", "frame", "pinion", 0, 0), mg.Pair("B", "P", "frame", "rack", point=(0, -1, 0), axis=(1, 0, 0))]
    return mg.Mechanism("rack", pairs=pairs, couplings=[mg.Rack("g", "A", "B", radius=1.0)], drives=["A"])


def belt() -> mg.Mechanism:
    pins = [pin("A", "frame", "one", 0, 0), pin("B", "frame", "two", 3, 1)]
    return mg.Mechanism("belt", pairs=pins, couplings=[mg.Belt("g", "A", "B", radii=(1, 0.4))], drives=["A"])


CASES = {
    "two curves": ellipse_on_circle(),
    "small circle": ellipse_on_circle(0.05, 2.0),
    "flat follower": flat_follower(),
    "slot on the crank": slot("crank", "arm"),
    "slot on the arm": slot("arm", "crank"),
    "gears": gears(),
    "internal gears": gears(internal=True),
    "rack": rack(),
    "belt": belt(),
}


def assert_equal_motion(m: mg.Mechanism, e: mg.Mechanism, links: list[str], at: float = 0.0) -> None:
    move = mg.Motion(position=at, velocity=1.3, acceleration=-0.7)
    one, other = (mg.kinematics(x, {"A": move}) for x in (m, e))
    for link in links:
        for name in ("pose", "twist", "acceleration"):
            x, y = (getattr(s.link(link), name) for s in (one, other))
            assert x == pytest.approx(y, abs=1e-9 * max(1.0, float(np.abs(x).max()))), (link, name)


@pytest.mark.parametrize("name", CASES)
def test_equal_in_velocity_and_acceleration(name: str) -> None:
    m = CASES[name]
    e = m.equivalent()
    report = mg.check(e)
    assert report.kind.name == "planar"
    assert not e.couplings
    assert report.finite_mobility == mg.check(m).finite_mobility == 1
    assert all(p.type.f == 1 for p in e.pairs)
    assert_equal_motion(m, e, list(m.link_names()))


@pytest.mark.parametrize("name", ["two curves", "slot on the crank", "gears"])
def test_at_another_position(name: str) -> None:
    m = CASES[name]
    e = m.equivalent(at={"A": 0.12})
    assert_equal_motion(m, e, list(m.link_names()), at=0.12)


def test_the_link_of_a_cam_is_as_long_as_the_radii_of_curvature() -> None:
    """rho = (a^2 sin^2 u + b^2 cos^2 u)^(3/2) / (a b) of the ellipse, and the radius of the follower (figure 2.51)."""
    e = CASES["two curves"].equivalent()
    (a, b) = (next(p for p in e.pairs if p.name == name) for name in ("C_a", "C_b"))
    u = 0.9
    rho = (np.sin(u) ** 2 + 0.36 * np.cos(u) ** 2) ** 1.5 / 0.6
    assert np.linalg.norm(np.array(a.on_b.point) - np.array(b.on_a.point)) == pytest.approx(rho + 0.5)


def test_the_link_of_gears_is_that_of_the_chapter() -> None:
    """AB = m (N1 + N2) sin(phi) / 2, O1 A = r1 cos(phi) (figure 2.52)."""
    e = CASES["gears"].equivalent()
    a, b = (np.array(next(p for p in e.pairs if p.name == name).on_b.point) for name in ("g_a", "g_b"))
    b = np.array(next(p for p in e.pairs if p.name == "g_b").on_a.point)
    phi = np.deg2rad(20)
    assert np.linalg.norm(b - a) == pytest.approx(3 * np.sin(phi))
    assert np.linalg.norm(a) == pytest.approx(np.cos(phi))
    assert mg.identify(e).name == "four-bar"


def test_a_roller_is_the_link_or_stays() -> None:
    m = roller_cam()
    removed, kept = m.equivalent(), m.equivalent(rollers="kept")
    assert len(removed.links) == len(m.links)
    assert len(kept.links) == len(m.links) + 1
    assert mg.check(removed).finite_mobility == 1
    assert mg.check(m).finite_mobility == mg.check(kept).finite_mobility == 2
    for e in (removed, kept):
        drives = {"A": MOVE} if e is removed else {"A": MOVE, "D": 0.0}
        one, other = mg.kinematics(m, {"A": MOVE, "D": 0.0}), mg.kinematics(e, drives)
        assert one.link("rocker").acceleration == pytest.approx(other.link("rocker").acceleration, abs=1e-9)


def test_groups_of_the_transformed_mechanism() -> None:
    assert mg.groups(CASES["two curves"].equivalent()).symbol == "R - D10"


def test_what_cannot_be_transformed() -> None:
    with pytest.raises(mg.DeclarationError, match=r"is no planar mechanism(.|\n)*two centers of curvature each"):
        mg.load("rcsr").equivalent()
    m = CASES["gears"].replace(couplings=[mg.Coupling({"A": 1.0, "B": 2.0}, name="mesh")])
    with pytest.raises(mg.DeclarationError, match="coupling mesh: has no line of contact"):
        m.equivalent()
    with pytest.raises(mg.DeclarationError, match="rollers = 'gone'"):
        CASES["gears"].equivalent(rollers="gone")
