"""Closed forms of mechanics: each with its derivation or source in the docstring."""

import numpy as np
import pytest

import mechgraph as mg

pytestmark = pytest.mark.reference

Z = (0, 0, 1)
G = 9.81


def test_driven_pendulum():
    """A bar (m, c, I) turned about z with w, alpha under gravity -g y; a = alpha x r - w^2 r at the mass center.

    Newton-Euler about the hinge: force F = m (a - g), driver M = (I + m c^2) alpha + m g c cos q (textbook).
    """
    mass, c, inertia = 2.5, 0.7, 0.13
    m = mg.Mechanism(
        "pendulum",
        links=[
            mg.Link("frame"),
            mg.Link("bar", mass=mass, center=(c, 0, 0), inertia=np.diag([0.01, inertia, inertia])),
        ],
        pairs=[mg.Pair("A", "R", "frame", "bar", point=(0, 0, 0), axis=Z)],
        drives=["A"],
        loads=[mg.Gravity((0, -G, 0))],
    )
    q, w, alpha = np.linspace(-3, 4, 23), 1.7, -2.3
    s = mg.solve(m, {"A": mg.Motion(q, w, alpha)})
    r = c * np.stack([np.cos(q), np.sin(q), 0 * q], axis=-1)
    a, gravity = np.cross([0, 0, alpha], r) - w**2 * r, np.array([0, -G, 0])
    np.testing.assert_allclose(s["A"].force, mass * (a - gravity), atol=1e-12)
    np.testing.assert_allclose(
        s["A"].effort[:, 0], (inertia + mass * c**2) * alpha + mass * G * c * np.cos(q), atol=1e-12
    )
    np.testing.assert_allclose(s["A"].moment, 0, atol=1e-12)


def test_a_skew_rotor_needs_a_dynamic_couple():
    """A body turning at w about z with product of inertia: M = w x I w on the body, so M_x = -I_yz' ... (Euler 1765)."""
    I = mg.inertia.from_components(0.3, 0.25, 0.2, xz=0.04, yz=-0.03)
    m = mg.Mechanism(
        "rotor",
        links=[mg.Link("frame"), mg.Link("rotor", mass=4.0, center=(0, 0, 0.5), inertia=I)],
        pairs=[mg.Pair("A", "R", "frame", "rotor", point=(0, 0, 0.5), axis=Z)],
        drives=["A"],
    )
    w = np.array([0, 0, 12.0])
    s = mg.solve(m, {"A": mg.Motion(0.0, w[2])})
    np.testing.assert_allclose(s["A"].moment, np.cross(w, I @ w), atol=1e-12)
    np.testing.assert_allclose(s["A"].force, 0, atol=1e-12)


A1, A2, A3, A4 = 0.4, 1.1, 0.9, 1.0
"""Crank, coupler, rocker, frame of the planar four-bar (Grashof crank-rocker)."""


def four_bar(start=0.6, loads=()):
    """Crank at the angle ``start``; coupler and rocker by the circle intersection above the frame line."""
    q = np.array([A1 * np.cos(start), A1 * np.sin(start)])
    o = np.array([A4, 0.0])
    d = np.linalg.norm(o - q)
    x = (A2**2 - A3**2 + d**2) / (2 * d)
    u = (o - q) / d
    p = q + x * u + np.sqrt(A2**2 - x**2) * np.array([-u[1], u[0]])
    three = lambda v: (*v, 0.0)
    links = [
        mg.Link("frame"),
        mg.Link("crank", mass=1.2, center=three(0.5 * q), inertia=np.diag([0.01, 0.05, 0.05])),
        mg.Link("coupler", mass=2.0, center=three(0.6 * q + 0.4 * p), inertia=np.diag([0.1, 0.15, 0.2])),
        mg.Link("rocker", mass=1.5, center=three(0.5 * (o + p)), inertia=np.diag([0.1, 0.1, 0.12])),
    ]
    pairs = [
        mg.Pair(n, "R", a, b, point=three(x), axis=Z)
        for n, a, b, x in (
            ("A", "frame", "crank", (0, 0)),
            ("B", "crank", "coupler", q),
            ("C", "coupler", "rocker", p),
            ("D", "frame", "rocker", o),
        )
    ]
    return (
        mg.Mechanism("four-bar", links=links, pairs=pairs, drives=["A"], loads=loads),
        np.arctan2(p[1], p[0] - A4),
        np.arctan2(*(p - q)[::-1]),
    )


def test_four_bar_displacement():
    """Freudenstein (1955): K1 cos psi - K2 cos phi + K3 = cos(phi - psi), K1 = d/a, K2 = d/c, K3 = (a^2 - b^2 + c^2 + d^2) / (2 a c)."""
    m, psi0, _ = four_bar()
    q = np.linspace(0, 2 * np.pi, 361)
    s = mg.kinematics(m, {"A": mg.Motion(q, 1.0)})
    phi, psi = 0.6 + q, psi0 + s["D"].position[:, 0]
    K3 = (A1**2 - A2**2 + A3**2 + A4**2) / (2 * A1 * A3)
    np.testing.assert_allclose(A4 / A1 * np.cos(psi) - A4 / A3 * np.cos(phi) + K3, np.cos(phi - psi), atol=1e-10)
    np.testing.assert_allclose(s["D"].position[-1], s["D"].position[0], atol=1e-10)
    rate = (np.sin(phi - psi) + A4 / A3 * np.sin(phi)) / (np.sin(phi - psi) + A4 / A1 * np.sin(psi))
    np.testing.assert_allclose(s["D"].velocity[:, 0], rate, atol=1e-9)


def test_four_bar_driver_by_virtual_work():
    """d'Alembert's principle: M w = sum of m a . v + I alpha w - m g . v + F . v over the links, a, alpha from the loop equations.

    Velocities and accelerations of crank, coupler, rocker angles by differentiating the two loop equations (textbook), independently.
    """
    force = np.array([3.0, -20.0])
    m, psi0, theta0 = four_bar(
        loads=[mg.Gravity((0, -G, 0)), mg.Wrench("coupler", force=(*force, 0), point=(0.7, 0.5, 0))]
    )
    q, w, alpha = np.linspace(0, 6, 50), 3.0, 5.0
    s = mg.solve(m, {"A": mg.Motion(q, w, alpha)})
    phi, theta, psi = 0.6 + q, theta0 + s["B"].position[:, 0] + q, psi0 + s["D"].position[:, 0]
    e = lambda x: np.stack([np.cos(x), np.sin(x)], axis=-1)
    n = lambda x: np.stack([-np.sin(x), np.cos(x)], axis=-1)
    np.testing.assert_allclose(A1 * e(phi) + A2 * e(theta) - A3 * e(psi), np.broadcast_to([A4, 0], (50, 2)), atol=1e-10)
    M = np.stack([A2 * n(theta), -A3 * n(psi)], axis=-1)
    wt, wp = np.linalg.solve(M, (-A1 * w * n(phi))[..., None])[..., 0].T
    rhs = -A1 * alpha * n(phi) + A1 * w**2 * e(phi) + A2 * (wt**2)[:, None] * e(theta) - A3 * (wp**2)[:, None] * e(psi)
    at, ap = np.linalg.solve(M, rhs[..., None])[..., 0].T

    def rate(length, x, v):
        return length * np.reshape(v, (-1, 1)) * n(x)

    def rate2(length, x, v, a):
        return length * (np.reshape(a, (-1, 1)) * n(x) - np.reshape(v, (-1, 1)) ** 2 * e(x))

    one = np.ones(50)
    v = [rate(0.5 * A1, phi, w * one), rate(A1, phi, w * one) + rate(0.4 * A2, theta, wt), rate(0.5 * A3, psi, wp)]
    a = [
        rate2(0.5 * A1, phi, w * one, alpha * one),
        rate2(A1, phi, w * one, alpha * one) + rate2(0.4 * A2, theta, wt, at),
        rate2(0.5 * A3, psi, wp, ap),
    ]
    q0 = A1 * e(np.array(0.6))
    local = np.array([0.7, 0.5]) - q0
    angle = np.arctan2(local[1], local[0]) - theta0
    vp = rate(A1, phi, w * one) + rate(np.linalg.norm(local), theta + angle, wt)
    down = np.array([0, -G])
    power = sum(mass * ((ac - down) * vc).sum(-1) for mass, ac, vc in zip((1.2, 2.0, 1.5), a, v, strict=True))
    power = power + 0.05 * alpha * w + 0.2 * at * wt + 0.12 * ap * wp - vp @ force
    np.testing.assert_allclose(s["A"].effort[:, 0] * w, power, rtol=1e-9, atol=1e-8)


def test_slider_crank_of_marghitu():
    """R-RRT: AB = BC = 1, phi = 45 deg, 1 rad/s, masses 1, rod inertia 0.0833417, g = 10, 100 N on the slider.

    Printed F12 = (-(400 + 7 sqrt 2) / 4, 5 (84 + sqrt 2) / 4) N (Marghitu, Kinematic Chains and Machine Components Design, 2005).
    """
    b = np.array([np.sqrt(0.5), np.sqrt(0.5), 0])
    c = np.array([np.sqrt(2), 0, 0])
    I = np.diag([0.0, 0.0833417, 0.0833417])
    m = mg.Mechanism(
        "R-RRT",
        links=[
            mg.Link("frame"),
            mg.Link("crank", mass=1.0, center=b / 2, inertia=I, unphysical=True),
            mg.Link("rod", mass=1.0, center=(b + c) / 2, inertia=I, unphysical=True),
            mg.Link("slider", mass=1.0, center=c),
        ],
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "crank", "rod", point=b, axis=Z),
            mg.Pair("C", "R", "rod", "slider", point=c, axis=Z),
            mg.Pair("D", "P", "frame", "slider", point=c, axis=(1, 0, 0)),
        ],
        drives=["A"],
        loads=[mg.Gravity((0, -10, 0)), mg.Wrench("slider", force=(100, 0, 0), point=c)],
    )
    s = mg.solve(m, {"A": mg.Motion(0.0, 1.0)}, redundant="minimum_norm")
    np.testing.assert_allclose(s.link("slider").center_velocity, [-np.sqrt(2), 0, 0], atol=1e-12)
    np.testing.assert_allclose(s.link("slider").center_acceleration, [-np.sqrt(2), 0, 0], atol=1e-12)
    printed = np.array([-(400 + 7 * np.sqrt(2)) / 4, 5 * (84 + np.sqrt(2)) / 4])
    assert any(np.allclose(sign * s["B"].force[:2], printed, atol=1e-3) for sign in (1, -1)), s["B"].force
    components = mg.solve(m, {"A": mg.Motion(0.0, 1.0)})["B"].components
    np.testing.assert_allclose(np.hypot(components["Fx"], components["Fy"]), np.linalg.norm(printed), atol=1e-3)


def test_spatial_slider_crank_of_haug():
    """Printed initial velocities: rod mass center (0.12, -0.24, 0), rod angular (1.92, -0.96, 0.48), slider 0.24 (Haug 1989).

    Read with the crank turning at 6 rad/s about +x; the rod may not spin about itself as the universal pair holds it.
    """
    a, b, c = np.array([0, 0.1, 0.12]), np.array([0, 0.1, 0.2]), np.array([0.2, 0, 0])
    assert np.linalg.norm(c - b) == pytest.approx(0.3)
    m = mg.Mechanism(
        "Haug",
        links=[
            mg.Link("frame"),
            mg.Link("crank", mass=0.12, center=(a + b) / 2, inertia=np.diag([1e-4, 1e-4, 1e-5])),
            mg.Link("rod", mass=0.5, center=(b + c) / 2, inertia=4e-3 * np.eye(3)),
            mg.Link("slider", mass=2.0, center=c, inertia=1e-4 * np.eye(3)),
        ],
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=a, axis=(1, 0, 0)),
            mg.Pair("B", "S", "crank", "rod", point=b),
            mg.Pair("C", "U", "slider", "rod", point=c, axis=(1, 0, 0), second=np.cross((1, 0, 0), c - b)),
            mg.Pair("D", "P", "frame", "slider", point=c, axis=(1, 0, 0)),
        ],
        drives=["A"],
        loads=[mg.Gravity((0, 0, -G))],
    )
    s = mg.solve(m, {"A": mg.Motion(0.0, 6.0)})
    assert mg.check(m).mobility == 1
    np.testing.assert_allclose(s.link("slider").center_velocity, [0.24, 0, 0], atol=1e-9)
    np.testing.assert_allclose(s.link("rod").center_velocity, [0.12, -0.24, 0], atol=1e-9)
    np.testing.assert_allclose(s.link("rod").angular_velocity, [1.92, -0.96, 0.48], atol=1e-9)
    rotor = s.link("crank")
    np.testing.assert_allclose(rotor.angular_velocity, [6, 0, 0], atol=1e-12)


@pytest.mark.parametrize(("a", "b", "alpha"), [(1.0, 0.7, 0.8), (1.0, 0.5, 1.3)])
def test_bennett_half_angles(a, b, alpha):
    """Bennett (1903): tan(t1/2) tan(t2/2) = sin((beta + alpha)/2) / sin((beta - alpha)/2) up to sign, a / sin alpha = b / sin beta."""
    beta = np.arcsin(b * np.sin(alpha) / a)
    m = mg.chain(
        "RRRR",
        twist=[alpha, beta, alpha, beta],
        length=[a, b, a, b],
        offset=[0] * 4,
        start={"O1": 1.0, "O2": 2.0, "O3": -1.0, "O4": -2.0},
    )
    m = mg.assemble(m, {"O1": 1.0})
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 3)
    s = mg.kinematics(m, {"O1": np.linspace(1.0, 2.2, 40)})
    t1, t2, t3, t4 = (s[f"O{k}"].position[:, 0] for k in (1, 2, 3, 4))
    product = np.tan(t1 / 2) * np.tan(t2 / 2)
    np.testing.assert_allclose(product, product[0], atol=1e-9)
    constant = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    assert min(abs(abs(product[0]) - abs(constant)), abs(abs(product[0]) - 1 / abs(constant))) < 1e-9
    np.testing.assert_allclose(np.cos([t1, t2]), np.cos([t3, t4]), atol=1e-9)


def test_spherical_four_bar():
    """cos of the coupler arc stays: the unit vectors along B and C keep their angle, each at its own angle from A and D.

    With u_B(q) = Rot(A, q) u_B and u_C(p) = Rot(D, p) u_C the input-output equation is u_B(q) . u_C(p) = cos(a2) (Chiang 1988).
    """
    axes = {
        n: np.array(v) / np.linalg.norm(v)
        for n, v in {"A": (0, 0, 1), "B": (0.4, 0, 0.9), "C": (0.7, 0.9, 0.5), "D": (0, 0.9, 0.4)}.items()
    }
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    m = mg.Mechanism(
        "spherical", pairs=[mg.Pair(n, "R", *ends[n], point=2 * axes[n], axis=axes[n]) for n in "ABCD"], drives=["A"]
    )
    s = mg.kinematics(m, {"A": np.linspace(0, 8, 200)}, on_reach="flag")

    def turned(axis, angle, v):
        k = np.broadcast_to(axis, (len(angle), 3))
        c, sn = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return v * c + np.cross(k, v) * sn + k * (k @ v)[:, None] * (1 - c)

    # in reach while the arc from B to D is between the difference and the sum of the arcs of coupler and rocker
    arc = lambda a, b: np.arccos(np.clip(a @ b, -1, 1))
    coupler, rocker = arc(axes["B"], axes["C"]), arc(axes["C"], axes["D"])
    gap = arc(turned(axes["A"], np.linspace(0, 8, 200), axes["B"]), axes["D"])
    inside = (gap > abs(coupler - rocker)) & (gap < min(coupler + rocker, 2 * np.pi - coupler - rocker))
    first = len(inside) if inside.all() else int(np.argmin(inside))
    np.testing.assert_array_equal(s.status == "ok", np.arange(200) < first)
    assert 100 < first < 200
    s = mg.kinematics(m, {"A": np.linspace(0, 8, 200)[:first]})
    uB = turned(axes["A"], s["A"].position[:, 0], axes["B"])
    uC = turned(axes["D"], s["D"].position[:, 0], axes["C"])
    np.testing.assert_allclose((uB * uC).sum(-1), axes["B"] @ axes["C"], atol=1e-10)
    np.testing.assert_allclose(s.link("coupler").pose[:, :3, 3], 0, atol=1e-10)


def test_rssr_displacement():
    """The coupler keeps its length, |p(q) - r(psi)|^2 = const: A sin psi + B cos psi = C (Hartenberg and Denavit 1964)."""
    a = {"A": ((0, 0, 0), (0, 0, 1)), "D": ((1.1, 1.0, 0), (1, 0.1, 0.05))}
    p0, r0 = np.array([0.3, 0, 0.1]), np.array([0.5, 1.2, 0.6])
    m = mg.Mechanism(
        "RSSR",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=a["A"][0], axis=a["A"][1]),
            mg.Pair("B", "S", "crank", "coupler", point=p0),
            mg.Pair("C", "S", "coupler", "rocker", point=r0),
            mg.Pair("D", "R", "frame", "rocker", point=a["D"][0], axis=a["D"][1]),
        ],
        drives=["A"],
    )
    q = np.linspace(0, 2 * np.pi, 181)
    s = mg.kinematics(m, {"A": mg.Motion(q, 1.0)})
    p = np.stack([0.3 * np.cos(q), 0.3 * np.sin(q), 0.1 + 0 * q], axis=-1)
    o, k = np.array(a["D"][0]), np.array(a["D"][1]) / np.linalg.norm(a["D"][1])
    r = r0 - o
    along, x, y = (r @ k) * k, r - (r @ k) * k, np.cross(k, r)
    d = p - o - along
    A, B = 2 * d @ y, 2 * d @ x
    C = (d**2).sum(-1) + x @ x - ((p0 - r0) ** 2).sum()
    psi = s["D"].position[:, 0]
    np.testing.assert_allclose(A * np.sin(psi) + B * np.cos(psi), C, atol=1e-10)
    both = np.arctan2(A, B)[:, None] + np.arccos(C / np.hypot(A, B))[:, None] * [1, -1]
    np.testing.assert_allclose(np.abs(np.exp(1j * both) - np.exp(1j * psi)[:, None]).min(axis=1), 0, atol=1e-8)


@pytest.mark.parametrize("more", [{"pitch": 0.02}, {"lead": -0.04}])
def test_screw_jack(more):
    """Virtual work of a screw without friction: M = F pitch; the frame guide carries -M."""
    pitch = more.get("pitch", more.get("lead", 0) / (2 * np.pi))
    m = mg.Mechanism(
        "jack",
        pairs=[
            mg.Pair("S", "R", "frame", "spindle", point=(0, 0, 0), axis=Z),
            mg.Pair("N", "H", "spindle", "nut", point=(0, 0, 0.1), axis=Z, **more),
            mg.Pair("P", "P", "frame", "nut", point=(0.2, 0, 0), axis=Z),
        ],
        drives=["S"],
        loads=[mg.Wrench("nut", force=(0, 0, -500.0), point=(0, 0, 0))],
    )
    s = mg.solve(m, {"S": np.linspace(0, 3, 4)})
    np.testing.assert_allclose(s["P"].position[:, 0], -pitch * np.linspace(0, 3, 4), atol=1e-14)
    np.testing.assert_allclose(s["S"].effort, -500.0 * pitch, atol=1e-10)
    assert (mg.check(m).mobility, mg.check(m).redundancy) == (1, 4)


def door(upper):
    links = [
        mg.Link("frame"),
        mg.Link("door", mass=30.0, center=(0.45, 0, 1.0), inertia=mg.inertia.box(30.0, (0.9, 0.04, 2.0))),
    ]
    pairs = [
        mg.Pair("low", "R" if upper == "R" else "S", "frame", "door", point=(0, 0, 0.2), axis=Z),
        mg.Pair("high", upper, "frame", "door", point=(0, 0, 1.8), axis=Z),
    ]
    return mg.Mechanism(
        f"door {upper}",
        links=links,
        pairs=pairs,
        drives=["low"] if upper == "R" else [],
        loads=[mg.Gravity((0, 0, -G))],
    )


def test_door_on_two_hinges():
    """The moment is unique, the thrust and the shares of the couples are not: redundancy 5, driver shared by both hinges' freedoms."""
    report = mg.check(door("R"))
    assert (report.mobility, report.redundancy) == (1, 5)
    s = mg.solve(door("R"), {"low": mg.Motion(0.3, 0.0, 2.0)})
    Iz = 30.0 * (0.9**2 + 0.04**2) / 12 + 30.0 * 0.45**2
    np.testing.assert_allclose(s["low"].effort, Iz * 2.0, rtol=1e-12)
    for pair in ("low", "high"):
        assert np.isnan(list(s[pair].components.values())).all()
        assert not any(v for name, v in report.unique[pair].items() if name != "effort")
    least = mg.solve(door("R"), {"low": 0.3}, redundant="minimum_norm")
    np.testing.assert_allclose(least["low"].force + least["high"].force, [0, 0, 30 * G], atol=1e-9)
    np.testing.assert_allclose(least["low"].force[2], least["high"].force[2], atol=1e-9)


def test_door_on_ball_and_ring():
    """Ball below, ball in a groove along the axis above: every reaction by statics, H = m g b / h."""
    m = door("Sg")
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, 0)
    posts = m.replace(pairs=[*m.pairs, mg.Pair("stop", "Sp", "frame", "door", point=(0.9, 0, 1.0), axis=(0, 1, 0))])
    s = mg.solve(posts)
    assert mg.check(posts).determinate
    H = 30 * G * 0.45 / 1.6
    np.testing.assert_allclose(s["high"].force, [-H, 0, 0], atol=1e-9)
    np.testing.assert_allclose(s["low"].force, [H, 0, 30 * G], atol=1e-9)
    np.testing.assert_allclose(s["stop"].force, 0, atol=1e-9)


@pytest.mark.parametrize("beta", [0.2, 0.6, 1.1])
def test_universal_joint(beta):
    """tan(out) = tan(in) / cos(beta), speed ratio cos b / (1 - sin^2 b cos^2 q) (Poncelet 1822); torque by power."""
    out, pin = (np.sin(beta), 0, np.cos(beta)), (np.cos(beta), 0, -np.sin(beta))
    m = mg.Mechanism(
        "cardan",
        pairs=[
            mg.Pair("A", "R", "frame", "input", point=(0, 0, -1), axis=Z),
            mg.Pair("B", "R", "input", "cross", point=(0, 0, 0), axis=(0, 1, 0)),
            mg.Pair("C", "R", "cross", "output", point=(0, 0, 0), axis=pin),
            mg.Pair("D", "R", "frame", "output", point=out, axis=out),
        ],
        drives=["A"],
        loads=[mg.Effort("D", -10.0)],
    )
    q = np.linspace(0, 2 * np.pi, 97)
    s = mg.solve(m, {"A": mg.Motion(q, 2.0)})
    psi, ratio = s["D"].position[:, 0], s["D"].velocity[:, 0] / 2.0
    np.testing.assert_allclose(ratio, np.cos(beta) / (1 - np.sin(beta) ** 2 * np.sin(q) ** 2), atol=1e-10)
    np.testing.assert_allclose(np.sin(psi) * np.cos(q), np.cos(psi) * np.sin(q) * np.cos(beta), atol=1e-10)
    np.testing.assert_allclose(s["A"].effort[:, 0], 10.0 * ratio, atol=1e-9)
