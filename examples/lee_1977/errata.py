"""Equations of chapter II as printed and as they have to be, against the motion that mechgraph computes.

Every entry is (largest difference as printed, largest difference corrected); RCSR over the rows of Table III, w1 = .1.
"""

from dataclasses import dataclass

import numpy as np

import mechgraph as mg
from lee_1977.rcsr import TWIST_1, TWIST_4, motion
from lee_1977.tables import dot, largest, lees, table

P1, P2, P3, P4, S1, S4, W1, ALPHA1 = 0.5, 0.8, 0.4, 0.5, 5.0, 4.0, 0.1, 0.2
CENTRE = (0.5, 1.0, 1.0)
SA, CA, S4A, C4A = np.sin(TWIST_1), np.cos(TWIST_1), np.sin(TWIST_4), np.cos(TWIST_4)


def columns(*parts: np.ndarray | float) -> np.ndarray:
    return np.column_stack(np.broadcast_arrays(*[np.asarray(p, dtype=float) for p in parts]))


@dataclass(frozen=True)
class Row:
    """The motion of RCSR over the rows of Table III in Lee's letters: cosines ``c``, sines ``n``, S2 and its rates."""

    s: mg.Solution
    c1: np.ndarray
    n1: np.ndarray
    c2: np.ndarray
    n2: np.ndarray
    c4: np.ndarray
    n4: np.ndarray
    s2: np.ndarray
    s2dot: np.ndarray
    s2ddot: np.ndarray

    @property
    def a2(self) -> np.ndarray:
        """Direction of A2, equation 2.36."""
        return columns(CA, self.n1 * SA, self.c1 * SA)

    @property
    def axis_rate(self) -> np.ndarray:
        """dA2/dt as 2.51 prints it: the sign is reversed."""
        return columns(0, -self.c1 * SA, self.n1 * SA) * W1


def letters() -> Row:
    s = motion()
    t1, t2, t4 = (s[name].position[:, 0] for name in ("O1", "O2", "O4"))
    o2 = s["O2"]
    return Row(s, np.cos(t1), np.sin(t1), np.cos(t2), np.sin(t2), np.cos(t4), np.sin(t4),
               o2.position[:, 1], o2.velocity[:, 1], o2.acceleration[:, 1])  # fmt: skip


def positions(r: Row) -> dict[str, tuple[float, float]]:
    """Equations 2.20 (closure) and 2.28 (mass centre of link 2)."""
    left = columns(-P2 * SA * r.n2 - r.s2 * CA - S1,
                   r.c1 * (-P2 * r.c2 - P1) + r.n1 * (P2 * CA * r.n2 - r.s2 * SA),
                   r.c1 * (P2 * CA * r.n2 - r.s2 * SA) + r.n1 * (P2 * r.c2 + P1))  # fmt: skip
    right = columns(P3 * S4A * r.n4 + S4 * C4A, P4, P3 * C4A * r.n4 - S4A * S4)
    x, y, z = CENTRE

    def centre_2(arm: float) -> np.ndarray:
        radial = y * r.c2 + r.n2 * z - arm
        across = -CA * z * r.c2 + CA * y * r.n2 + r.s2 * SA - x * SA
        return columns(-S1 - z * SA * r.c2 + r.n2 * SA * y - r.s2 * CA + x * CA,
                       r.c1 * radial - r.n1 * across, -r.c1 * across - r.n1 * radial)  # fmt: skip

    d2, p1 = (
        tuple(largest(left - right - columns(0, arm * r.c4, 0)) for arm in (P4, P3)),
        tuple(largest(centre_2(arm) - lees(r.s.link("link2").center)) for arm in (P2, P1)),
    )
    return {"2.20": (d2[0], d2[1]), "2.28": (p1[0], p1[1])}


def velocities(r: Row) -> dict[str, tuple[float, float]]:
    """Equations 2.44 to 2.55: closure, direction of A2, point O2, mass centre of link 1."""
    v1 = columns(P2 * SA * r.c2, -P2 * r.n2 * r.c1 - P2 * CA * r.c2 * r.n1, r.n1 * P2 * r.n2 - P2 * CA * r.c1 * r.c2)
    v3 = columns(P3 * S4A * r.c4, -P3 * r.n4, P3 * C4A * r.c4)
    vy = r.c1 * (P2 * CA * r.n2 - r.s2 * SA) + r.n1 * (P2 * r.c2 + P1)
    vz = r.c1 * (-P2 * r.c2 - P1) + r.n1 * (P2 * CA * r.n2 - r.s2 * SA)
    rates = v1 * r.s["O2"].velocity[:, :1] + r.a2 * r.s2dot[:, None] + v3 * r.s["O4"].velocity
    closure = [largest(rates - columns(0, vy, sign * vz) * W1) for sign in (1.0, -1.0)]

    true_rate = np.cross(lees(r.s.link("link1").twist[:, :3]), r.a2)
    shift = columns(0, r.c1 * r.s2 * SA - P1 * r.n1, -r.c1 * P1 - r.s2 * r.n1 * SA) * W1
    o2_rate = r.a2 * r.s2dot[:, None] + shift
    o2 = lees(r.s.link("link2").point((0.0, 0.0, 0.0)).velocity)
    _, y, z = CENTRE
    true_1 = lees(r.s.link("link1").center_velocity)
    printed_1 = columns(0, -(y * r.n1 + z * r.c1), y * r.c1 + z * r.n1) * W1
    corrected_1 = columns(0, -y * r.n1 + z * r.c1, -y * r.c1 - z * r.n1) * W1
    return {
        "2.44, 2.47": (closure[0], closure[1]),
        "2.51": (largest(r.axis_rate - true_rate), largest(-r.axis_rate - true_rate)),
        "2.53": (largest(o2_rate - o2), largest(-o2_rate - o2)),
        "2.55": (largest(printed_1 - true_1), largest(corrected_1 - true_1)),
    }


def accelerations(r: Row) -> dict[str, tuple[float, float]]:
    """Equations 2.64 (point O2) and 2.66 (mass centre of link 1)."""
    o2 = r.s.link("link2").point((0.0, 0.0, 0.0))
    true_o2 = lees(o2.acceleration)
    inner = columns(
        0,
        -r.c1 * SA * r.s2dot + (r.c1 * P1 + r.n1 * r.s2 * SA) * W1,
        r.n1 * SA * r.s2dot + (r.c1 * r.s2 * SA - r.n1 * P1) * W1,
    )
    turning = columns(0, r.c1 * r.s2 * SA - r.n1 * P1, -r.c1 * P1 - r.n1 * r.s2 * SA)
    printed = r.axis_rate * r.s2dot[:, None] + r.a2 * r.s2ddot[:, None] + inner * W1 + turning * ALPHA1
    arm = lees(o2.position) * [0.0, 1.0, 1.0]
    true_rate = np.cross(lees(r.s.link("link1").twist[:, :3]), r.a2)
    corrected = -turning * ALPHA1 - W1**2 * arm - r.a2 * r.s2ddot[:, None] - 2 * r.s2dot[:, None] * true_rate

    _, y, z = CENTRE
    true_1 = lees(r.s.link("link1").center_acceleration)
    first = columns(0, y * r.n1 - z * r.c1, y * r.c1 + z * r.n1) * ALPHA1
    second = columns(0, -y * r.c1 - z * r.n1, y * r.n1 + z * r.c1)
    third = columns(0, -y * r.c1 - z * r.n1, y * r.n1 - z * r.c1) * W1**2
    return {
        "2.64": (largest(printed - true_o2), largest(corrected - true_o2)),
        "2.66": (largest(first + second - true_1), largest(-first + third - true_1)),
    }


def chapter_2() -> dict[str, tuple[float, float]]:
    """Equation number -> differences as printed and corrected."""
    r = letters()
    return positions(r) | velocities(r) | accelerations(r)


def short_degree(s: mg.Solution, number: str) -> tuple[float, float, float]:
    """How much the degree of the thesis is too short, for theta1 going in and for theta2, theta4 coming out, and what is left.

    Least squares over a table: printed - found = -in theta1 dtheta/dtheta1 - out theta, degrees.
    """
    theta1 = table(number)["theta1"]
    columns_in, columns_out, differences = [], [], []
    for k in (2, 4):
        result = s[f"O{k}"]
        theta = np.rad2deg(result.position[:, 0])
        columns_in.append(-theta1 * result.velocity[:, 0] / s["O1"].velocity[:, 0])
        columns_out.append(-theta)
        differences.append(table(number)[f"theta{k}"] - theta)
    A, b = np.column_stack([np.concatenate(columns_in), np.concatenate(columns_out)]), np.concatenate(differences)
    found = np.linalg.lstsq(A, b, rcond=None)[0]
    return float(found[0]), float(found[1]), largest(b - A @ found)


def zero_of_2_63() -> float:
    """Largest N2 . (N1 x N2), by which 2.63 divides."""
    rng = np.random.default_rng(63)
    n1, n2 = rng.normal(size=(2, 200, 3))
    return largest(dot(n2, np.cross(n1, n2)))


def _turn(axis: np.ndarray, angle: np.ndarray, v: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return c * v + s * np.cross(axis, v) + (1 - c) * dot(axis, v)[:, None] * axis


def same_equation() -> tuple[float, float]:
    """Equations 2.100 and 2.107 at 200 random (theta1, theta2, theta5): largest difference of their left sides, and the
    range of the left sides for comparison. Signs corrected.
    """
    a1, a2, a3, a4, a5 = np.deg2rad([10.0, 80.0, 40.0, 50.0, 60.0])
    rng = np.random.default_rng(100)
    t1, t2, t5 = rng.uniform(-np.pi, np.pi, (3, 200))
    ones = np.ones((200, 1))

    def d(angle: float) -> np.ndarray:
        return np.array([np.cos(angle), 0.0, np.sin(angle)]) * ones

    def left(v: np.ndarray) -> np.ndarray:
        return _turn(d(0.0), -t1, _turn(d(a1), -t2, v))

    def squares(target: np.ndarray, axis: np.ndarray, before: np.ndarray) -> np.ndarray:
        """cos^2 + sin^2 of the turn about ``axis`` that takes ``before`` to ``target``, by Cramer's rule as in 2.98."""
        along = dot(before, axis)[:, None] * axis
        across, normal = before - along, np.cross(axis, before)
        cosine = dot(target, np.cross(normal, along)) / dot(across, np.cross(normal, along))
        sine = dot(target, np.cross(across, along)) / dot(normal, np.cross(across, along))
        return cosine**2 + sine**2

    axis_3, axis_4 = left(d(a1 + a2)), _turn(d(-a5), t5, d(-a5 - a4))
    by_2_100 = squares(axis_4, axis_3, left(d(a1 + a2 + a3)))
    by_2_107 = squares(axis_3, axis_4, _turn(d(-a5), t5, d(-a5 - a4 - a3)))
    return largest(by_2_100 - by_2_107), float(np.ptp(by_2_100))


def rank_of_2_117() -> int:
    """Rank of the three equations 2.117 for w2, w3, w5 at a closure of RCHCH: derivatives of one direction."""
    m = mg.load("rchch")
    s = mg.kinematics(m, {"O1": np.deg2rad(20.0)})
    state = s.state()
    axes = [state.conditions[k][:3, _turning(m, k), 0] for k in range(5)]
    return int(np.linalg.matrix_rank(np.column_stack([np.cross(axes[k], axes[3]) for k in (1, 2, 4)]), tol=1e-9))


def _turning(m: mg.Mechanism, k: int) -> int:
    book = m.pairs[k].type.bookkeeping
    return next(i for i, c in enumerate(book.conditions) if c.turns)
