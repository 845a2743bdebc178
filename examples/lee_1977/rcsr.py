"""RCSR, sections 2.6 and 3.4: Tables III to IX and XV to XVIII."""

from collections.abc import Callable
from functools import cache

import numpy as np

import mechgraph as mg
from lee_1977.tables import X, largest, lees, ours, printed, table, without_axis, wrench

TWIST_1, TWIST_4 = np.deg2rad(12.0), np.deg2rad(15.0)
A4 = np.array([np.cos(TWIST_4), 0.0, -np.sin(TWIST_4)])
O4 = 4.0 * A4 + [0.0, 0.5, 0.0]
MASSES = {"link1": 2.0, "link2": 5.0, "link3": 5.0}
CENTRE = np.array([0.5, 1.0, 1.0])
TENSORS = {  # xx, yy, zz, xy, xz, yz
    "link1": (0.02, 0.0, 0.0, 0.05, 0.1, 0.0),
    "link2": (0.01, 0.2, 0.2, 0.05, 0.4, 0.0),
    "link3": (0.02, 0.3, 0.4, 0.5, 0.2, 0.0),
}
ORIGIN = (0.0, 0.0, 0.0)


@cache
def motion() -> mg.Solution:
    return mg.kinematics(mg.load("rcsr"))


@cache
def physical() -> mg.Solution:
    """Kinetostatics with the true inertia of the same masses and tensors."""
    return mg.solve(mg.load("rcsr"))


def kinematics() -> dict[str, float]:
    """Largest differences from Tables III (angles apart) to IX."""
    s = motion()
    o2, o4 = s["O2"], s["O4"]
    out = {}
    ours_iii = np.column_stack(
        [o2.position[:, 1], o2.velocity, o4.velocity, o2.acceleration, o4.acceleration]
    )  # fmt: skip
    out["III"] = largest(ours_iii - printed("III", "S2", "w2", "S2dot", "w4", "alpha2", "S2ddot", "alpha4"))
    angles = np.rad2deg(np.column_stack([o2.position[:, 0], o4.position[:, 0]]))
    out["III angles"] = largest(angles - printed("III", "theta2", "theta4"))
    for number, quantity in (("IV", "center"), ("VI", "center_velocity"), ("VIII", "center_acceleration")):
        found = np.concatenate([lees(getattr(s.link(name), quantity)) for name in MASSES], axis=1)
        out[number] = largest(found - printed(number))
    for number, order in (("V", 0), ("VII", 1), ("IX", 2)):
        found = np.concatenate([lees(s.link(name).point(ORIGIN)[order]) for name in ("link2", "link3")], axis=1)
        out[number] = largest(found - printed(number))
    return out


def axis_2(theta1: np.ndarray, twist: float = TWIST_1) -> np.ndarray:
    """Equation 2.36."""
    s, c = np.sin(theta1), np.cos(theta1)
    return np.column_stack([np.full_like(s, np.cos(twist)), s * np.sin(twist), c * np.sin(twist)])


def inertia_torque_3_31(
    mass: float, tensor: tuple[float, ...], w: np.ndarray, alpha: np.ndarray, v: np.ndarray, a: np.ndarray
) -> np.ndarray:
    """Equation 3.31 as printed: r and the tensor constant in global axes, Ixz in place of Iyz in the second row, two terms
    too many (w x (M r x v) and M {-y wy - z wz, ...}), no moment of the inertia force about the global origin.
    """
    xx, yy, zz, xy, xz, yz = tensor
    tensors = np.array([[xx, xy, xz], [xy, yy, xz], [xz, yz, zz]])
    x, y, z = CENTRE
    wx, wy, wz = w.T
    r = np.broadcast_to(CENTRE, w.shape)
    extra = np.column_stack([-y * wy - z * wz, -y * wx + 2 * x * wy, -z * wx + 2 * x * wz])
    return (
        mass * (np.cross(r, a) + extra + np.cross(w, np.cross(r, v))) + alpha @ tensors.T + np.cross(w, w @ tensors.T)
    )  # fmt: skip


def lees_inertia() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Inertia force and torque of each link as Lee's equations of motion have them, in his axes.

    Link 1 turns with +w1 about A1, link 2 with w2 A2 alone, link 3 with w4 A4 (equation 3.67: no terms with its mass).
    """
    s = motion()
    turns = len(s["O1"].position)
    still = np.zeros((turns, 3))
    a2 = axis_2(s["O1"].position[:, 0])
    w2, alpha2 = s["O2"].velocity[:, :1], s["O2"].acceleration[:, :1]
    w4, alpha4 = s["O4"].velocity, s["O4"].acceleration
    o2 = s.link("link2").point(ORIGIN)
    spins = {
        "link1": (2.0, still + 0.1 * X, still + 0.2 * X, still, still),
        "link2": (5.0, w2 * a2, alpha2 * a2, lees(o2.velocity), lees(o2.acceleration)),
        "link3": (0.0, w4 * A4, alpha4 * A4, still, still),
    }
    out = {}
    for name, (mass, w, alpha, v, a) in spins.items():
        torque = inertia_torque_3_31(mass, TENSORS[name], w, alpha, v, a)
        out[name] = (-MASSES[name] * lees(s.link(name).center_acceleration), -torque)
    return out


def with_lees_inertia() -> mg.Mechanism:
    """The mechanism without mass, his inertia put in as applied wrenches."""
    m = mg.load("rcsr")
    loads = list(m.loads)
    for name, (force, moment) in lees_inertia().items():
        at = lees(motion().link(name).point(ORIGIN).position)
        couple = moment - np.cross(at, force)
        loads.append(mg.Wrench(name, force=ours(force), moment=ours(couple), point=ORIGIN))
    return m.replace(links=[mg.Link(link.name) for link in m.links], loads=loads)


@cache
def as_lee() -> mg.Solution:
    return mg.solve(with_lees_inertia())


def spherical_directions() -> np.ndarray:
    """B, C, D of equations 2.33 to 2.35 as columns, ``(T, 3, 3)``."""
    s = motion()
    t1, t2, t4 = (s[name].position[:, 0] for name in ("O1", "O2", "O4"))
    s1, c1, s2, c2 = np.sin(t1), np.cos(t1), np.sin(t2), np.cos(t2)
    sa, ca = np.sin(TWIST_1), np.cos(TWIST_1)
    b = np.column_stack([np.sin(t4) * np.sin(TWIST_4), np.cos(t4), np.sin(t4) * np.cos(TWIST_4)])
    c = np.column_stack([-s2 * sa, -c1 * c2 + s1 * s2 * ca, c1 * s2 * ca + s1 * c2])
    return np.stack([b, c, np.cross(b, c)], axis=2)


def reactions(s: mg.Solution) -> dict[str, np.ndarray]:
    """A solution in the columns of Tables XV to XVIII."""
    o3, _ = wrench(s["O3"].reaction)
    parts = np.linalg.solve(spherical_directions(), o3[:, :, None])[:, :, 0]
    f4, m4 = wrench(-s["O4"].reaction)
    return {
        "XV": without_axis(*wrench(s["O1"].reaction), X, np.zeros(3)),
        "XVI": np.column_stack(wrench(s["O2"].reaction)),
        "XVII": without_axis(f4, m4, A4, O4),
        "XVIII": np.column_stack([parts, -s["O1"].effort[:, 0]]),
    }


def kinetostatics() -> dict[str, float]:
    """Largest differences from Tables XV to XVIII with Lee's inertia torque."""
    return {number: largest(found - printed(number)) for number, found in reactions(as_lee()).items()}


def true_driver() -> dict[int, tuple[float, float]]:
    """theta1 -> M_IN with the true inertia, M_IN as printed, first and last row."""
    theta = table("XVIII")["theta1"]
    found = -physical()["O1"].effort[:, 0]
    shown = table("XVIII")["MIN"]
    return {int(theta[i]): (float(found[i]), float(shown[i])) for i in (0, -1)}


READINGS = ("without tensors", "about the mass center", "about O_i")
"""What the printed tensors may refer to, in link axes; the thesis does not keep it apart."""


@cache
def true_drivers() -> dict[str, tuple[float, float]]:
    """M_IN with the true inertia in the first and last row, 150 and 202 degrees, by what the printed tensors are taken to be.

    About O_i (3.27 to 3.30, 3.65, 3.67): ``I_c = I_o - m (r.r 1 - r r^T)``, r = (.5, 1, 1) from O_i.
    """
    m, r = mg.load("rcsr"), ours(CENTRE)

    def with_tensors(change: Callable[[mg.Link], np.ndarray | None]) -> tuple[float, float]:
        links = [link.replace(inertia=change(link)) if link.mass else link for link in m.links]
        return ends(mg.solve(m.replace(links=links)))

    shift = r @ r * np.eye(3) - np.outer(r, r)
    readings = (lambda link: None, lambda link: link.inertia, lambda link: link.inertia - link.mass * shift)
    return dict(zip(READINGS, map(with_tensors, readings), strict=True))


def ends(s: mg.Solution) -> tuple[float, float]:
    """M_IN of the first row and of the last."""
    return -float(s["O1"].effort[0, 0]), -float(s["O1"].effort[-1, 0])
