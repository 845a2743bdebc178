"""Equations of chapter II as printed and as they have to be, against the motion that mechgraph computes.

Every entry is (largest difference as printed, largest difference corrected); RCSR over the rows of Table III, w1 = .1.
"""

from dataclasses import dataclass

import numpy as np

import mechgraph as mg
from lee_1977 import rchch, rcsr_csr
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
    """Equations 2.20 (closure) and 2.28 (mass center of link 2)."""
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
    """Equations 2.44 to 2.55: closure, direction of A2, point O2, mass center of link 1."""
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
    """Equations 2.64 (point O2) and 2.66 (mass center of link 1)."""
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


# --- printed beside corrected -------------------------------------------------------------------------------------------

ERRATA = (
    ("2.52", "dO3/dt = N1 w2 + N2 S2' - N4 w1", "dO3/dt = -(N1 w2 + N2 S2' - N4 w1), z of N4 with the other sign"),
    ("2.56", "dPm2/dt = A2 x (Pm2 - P2) w2 + A2 S2' + A1 x (Pm2 - P1) w1", "the same with a minus in front of the right side"),
    ("2.60", "N5x = Sa4 P3 St4 w4^2 - (P2 St2 Sa1 w2 - Sa1 P2 Ca1 St2 w1) w1 + Sa1 P2 Ca1 St2 w2",
     "N5 = dN4/dt w1 - dN1/dt w2 - dN2/dt S2' - dN3/dt w4, here N5x = P2 Sa1 St2 w2^2 + P3 Sa4 St4 w4^2"),
    ("2.89", "y of E: Ctc1 Ct7 - Sa1 St7 Ca8", "Ctc1 Ct7 - Stc1 St7 Ca8"),
    ("2.95", "N1y = Ct1 St2 C6y + ..., N1z = ... - St1 St2 C6y; N2 = (-St2 C9x, -Ct1 Ct2 C15y - St1 St2 C9z, -St2 Ct1 C9z + St1 Ct2 C15y)",
     "all terms with St2 in N1 and N2 with the other sign"),
    ("2.102", "F4 = (D14x, -St1 D14z, Ct1 D14z), F5 = (0, Ct1 D15y, St1 D15y)", "F4y = +St1 D14z, F5z = -St1 D15y"),
    ("2.115", "O3L = ... - S1 A1 + P1", "O3L = ... - S1 A1 - S2 A2j + P1"),
    ("2.121", "dO2/dt = A2 x (O2 - O1) w1 + A1 S2'", "dO2/dt = -(A1 x (O2 - O1) w1 + A2 S2')"),
    ("2.122", "dO3/dt = A2 x (O3 - O2) w2 + A3 x (O3 - O1) w1 + A3 S3' + A2 S2'",
     "dO3/dt = -(A2 x (O3 - O2) w2 + A1 x (O3 - O1) w1 + A2 S2'), O3 on link 2"),
    ("2.123", "dO4/dt = A3 x (O4 - O3) w3 + A2 x (O4 - O2) w2 + A1 x (O3 - O1) w1 + A3 S3' + A2 S2'",
     "dO4/dt = -(A3 x (O4 - O3) w3 + A2 x (O4 - O2) w2 + A1 x (O4 - O1) w1 + A3 S3' + A2 S2')"),
    ("2.131", "y of Pm1: y1 Ct1 - z1 St1", "y1 Ct1 + z1 St1"),
    ("2.132", "z of dPm1/dt: (-y1 Ct1 + z1 St1) w1", "(-y1 Ct1 - z1 St1) w1"),
    ("3.9", "R_ij . A = 0", "F_ij . A = 0: the reaction has a part along the axis, its free part F_ij has none"),
    ("3.37", "R43 = F43 + F^A1 A4", "R43 = F43 + F^A4 A4"),
    ("3.40", "F41 . A4 = 0", "F43 . A4 = 0"),
    ("3.57, 3.58", "d2Pm1/dt2 = K1 alpha1 + K2, d2Pm2/dt2 = K3 alpha1 + K4",
     "-K1 alpha1 + K2, -K3 alpha1 + K4 with K1 and K3 as they are printed: theta1 turns about -A1"),
    ("3.65", "I w' of link 1: (Ixx1, Ixy1, Ixy1) alpha1", "(Ixx1, Ixy1, Ixz1) alpha1"),
    ("3.66", "angular acceleration of link 2: (DR1 alpha1 + DR2) A2", "alpha2 A2 + alpha1 A1 + w1 w2 A1 x A2, all turns counted alike"),
    ("3.69", "v(i+1) = v(i) + alpha(i) dt", "v(i+1) = v(i) + (alpha(i) + alpha(i+1)) dt / 2 is what Table XIX was made with"),
    ("3.93", "R32 at the cylinder pair O2", "R32 at the helical pair O3"),
    ("3.97", "R12 = F12 in 3.91, F21 . A2 = 0 in 3.97", "one of the two throughout: F12 . A2 = 0"),
    ("XVI, XXVI", "headed F21, M21", "they hold R12, link 1 on link 2 (Table XXXIV holds R21)"),
)  # fmt: skip
"""Equation, as printed, corrected. Every one of chapter II is decided by numbers, see ``decided``."""


def _screws(r: Row) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """N1 to N4 of 2.44 to 2.47, z of N4 with the sign that closes, by which ``N1 w2 + N2 S2' + N3 w4 = N4 w1``."""
    n1 = columns(P2 * SA * r.c2, -P2 * r.n2 * r.c1 - P2 * CA * r.c2 * r.n1, r.n1 * P2 * r.n2 - P2 * CA * r.c1 * r.c2)
    n3 = columns(P3 * S4A * r.c4, -P3 * r.n4, P3 * C4A * r.c4)
    across, inward = P2 * CA * r.n2 - r.s2 * SA, P2 * r.c2 + P1
    n4 = columns(0, r.c1 * across + r.n1 * inward, r.c1 * inward - r.n1 * across)
    return n1, r.a2, n3, n4


def _decided_of_rcsr() -> dict[str, tuple[float, float]]:
    """Equations 2.52, 2.56, 2.60, over the rows of Table III."""
    r = letters()
    n1, n2, n3, n4 = _screws(r)
    w2, w4 = r.s["O2"].velocity[:, :1], r.s["O4"].velocity
    o3 = lees(r.s.link("link3").point((0.0, 0.0, 0.0)).velocity)
    left = n1 * w2 + n2 * r.s2dot[:, None]
    corrected = -(left - n4 * W1)
    printed = left - n4 * [1.0, 1.0, -1.0] * W1
    center, o2 = lees(r.s.link("link2").center), lees(r.s.link("link2").point((0.0, 0.0, 0.0)).position)
    swept = np.cross(r.a2, center - o2) * w2 + r.a2 * r.s2dot[:, None] + np.cross([1.0, 0.0, 0.0], center) * W1
    true_2 = lees(r.s.link("link2").center_velocity)
    rates = n1 * r.s["O2"].acceleration[:, :1] + n2 * r.s2ddot[:, None] + n3 * r.s["O4"].acceleration
    n5x = (rates - n4 * ALPHA1)[:, 0]
    u2, u4 = w2[:, 0], w4[:, 0]
    turning = P3 * S4A * r.n4 * u4**2
    printed_5 = turning - (P2 * r.n2 * SA * u2 - SA * P2 * CA * r.n2 * W1) * W1 + SA * P2 * CA * r.n2 * u2
    return {
        "2.52": (largest(printed - o3), largest(corrected - o3)),
        "2.56": (largest(swept - true_2), largest(-swept - true_2)),
        "2.60": (largest(printed_5 - n5x), largest(turning + P2 * SA * r.n2 * u2**2 - n5x)),
    }


def _decided_of_rcsr_csr() -> dict[str, tuple[float, float]]:
    """Equation 2.89: E = j turned about A7 and carried to the axis of O7, at random theta7."""
    theta7 = np.random.default_rng(89).uniform(-np.pi, np.pi, 50)
    c, s = np.cos(theta7), np.sin(theta7)
    turn, a8, a1 = rcsr_csr.TURN, rcsr_csr.A8, rcsr_csr.A1
    true = np.array([rcsr_csr.turned(rcsr_csr.AXIS_7, t, rcsr_csr.RADIAL_7) for t in theta7])
    y = [np.cos(turn) * c - np.sin(angle) * s * np.cos(a8) for angle in (a1, turn)]
    return {"2.89": (largest(y[0] - true[:, 1]), largest(y[1] - true[:, 1]))}


def _decided_directions() -> dict[str, tuple[float, float]]:
    """Equations 2.95 and 2.102: A4 and A3 of the left half of RCHCH turned about -A3, -A2, -A1, at random angles."""
    a1, a2, a3 = np.deg2rad([10.0, 80.0, 40.0])
    t1, t2, t3 = np.random.default_rng(95).uniform(-np.pi, np.pi, (3, 50))
    c1, s1, c2, s2, c3, s3 = np.cos(t1), np.sin(t1), np.cos(t2), np.sin(t2), np.cos(t3), np.sin(t3)

    def d(angle: float) -> np.ndarray:
        return np.array([np.cos(angle), 0.0, np.sin(angle)])

    axis_1, axis_2, axis_3, axis_4 = (d(a) * np.ones((50, 1)) for a in (0.0, a1, a1 + a2, a1 + a2 + a3))
    true_3 = _turn(axis_1, -t1, _turn(axis_2, -t2, axis_3))
    true_4 = _turn(axis_1, -t1, _turn(axis_2, -t2, _turn(axis_3, -t3, axis_4)))
    along, across = np.cos(a3) * d(a1 + a2), d(a1 + a2 + a3) - np.cos(a3) * d(a1 + a2)
    c15 = np.sin(a1 + a2) * np.cos(a1 + a2 + a3) - np.cos(a1 + a2) * np.sin(a1 + a2 + a3)

    def about_2(v: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Parts across and along A2 of a vector in its plane, and the y component of A2 x v."""
        part = (v @ d(a1)) * d(a1)
        return v - part, part, np.sin(a1) * v[0] - np.cos(a1) * v[2]

    c5, c7, c6 = about_2(across)
    c11, c13, c12 = about_2(along)

    def by_2_95(sign: float) -> np.ndarray:
        n1 = columns(c2 * c5[0] + c7[0], sign * c1 * s2 * c6 + s1 * (c2 * c5[2] + c7[2]),
                     c1 * (c2 * c5[2] + c7[2]) - sign * s1 * s2 * c6)  # fmt: skip
        c9 = np.array([-np.sin(a1) * c15, 0.0, np.cos(a1) * c15])
        n2 = columns(
            -sign * s2 * c9[0], -c1 * c2 * c15 - sign * s1 * s2 * c9[2], -sign * s2 * c1 * c9[2] + s1 * c2 * c15
        )
        n3 = columns(c2 * c11[0] + c13[0], -c1 * s2 * c12 + s1 * (c2 * c11[2] + c13[2]),
                     c1 * (c2 * c11[2] + c13[2]) + s1 * s2 * c12)  # fmt: skip
        return c3[:, None] * n1 + s3[:, None] * n2 + n3

    d14, d16, d15 = about_2(d(a1 + a2))

    def by_2_102(sign: float) -> np.ndarray:
        f4, f5 = columns(d14[0], -sign * s1 * d14[2], c1 * d14[2]), columns(0, c1 * d15, sign * s1 * d15)
        return c2[:, None] * f4 - s2[:, None] * f5 + columns(d16[0], s1 * d16[2], c1 * d16[2])

    return {
        "2.95": (largest(by_2_95(1.0) - true_4), largest(by_2_95(-1.0) - true_4)),
        "2.102": (largest(by_2_102(1.0) - true_3), largest(by_2_102(-1.0) - true_3)),
    }


def _decided_of_rchch() -> dict[str, tuple[float, float]]:
    """Equations 2.115, 2.121 to 2.123, 2.131, 2.132, over a true closure of RCHCH."""
    s, origin = rchch.branches()[0], (0.0, 0.0, 0.0)
    theta1, theta2, slide = s["O1"].position[:, 0], s["O2"].position[:, 0], s["O2"].position[:, 1:]
    a1 = np.array([1.0, 0.0, 0.0]) * np.ones((len(theta1), 1))
    a2, a3 = (-lees(s.link(name).pose[:, :3, 2]) for name in ("link2", "link3"))
    w1, w2, w3 = (s[name].velocity[:, :1] for name in ("O1", "O2", "O3"))
    s2, s3 = s["O2"].velocity[:, 1:], rchch.PITCH_3 * w3
    places = (
        s.link("link2").point(origin),
        s.link("link2").point((0.5, 0.0, 0.0)),
        s.link("link3").point((0.8, 0.0, 0.0)),
    )
    (o2, o3, o4), (v2, v3, v4) = ([lees(getattr(p, what)) for p in places] for what in ("position", "velocity"))
    o1 = np.zeros(3)

    unfolded = np.array([0.0, -1.0, 0.0])
    arm = _turn(
        np.array([np.cos(rchch.TWIST_1), 0.0, np.sin(rchch.TWIST_1)]) * np.ones_like(a1),
        -theta2,
        0.5 * unfolded * np.ones_like(a1),
    )
    by_2_115 = _turn(a1, -theta1, arm + rchch.P1 * unfolded) - rchch.S1 * a1
    printed_2 = np.cross(a2, o2 - o1) * w1 + a1 * s2
    printed_3 = np.cross(a2, o3 - o2) * w2 + np.cross(a3, o3 - o1) * w1 + a3 * s3 + a2 * s2
    printed_4 = np.cross(a3, o4 - o3) * w3 + np.cross(a2, o4 - o2) * w2 + np.cross(a1, o3 - o1) * w1 + a3 * s3 + a2 * s2
    right_2 = -(np.cross(a1, o2 - o1) * w1 + a2 * s2)
    right_3 = -(np.cross(a2, o3 - o2) * w2 + np.cross(a1, o3 - o1) * w1 + a2 * s2)
    right_4 = -(
        np.cross(a3, o4 - o3) * w3 + np.cross(a2, o4 - o2) * w2 + np.cross(a1, o4 - o1) * w1 + a3 * s3 + a2 * s2
    )

    y, z, c, n = 0.1, 0.01, np.cos(theta1), np.sin(theta1)
    center, speed = lees(s.link("link1").center)[:, 1], lees(s.link("link1").center_velocity)[:, 2]
    return {
        "2.115": (largest(by_2_115 - o3), largest(by_2_115 - a2 * slide - o3)),
        "2.121": (largest(printed_2 - v2), largest(right_2 - v2)),
        "2.122": (largest(printed_3 - v3), largest(right_3 - v3)),
        "2.123": (largest(printed_4 - v4), largest(right_4 - v4)),
        "2.131": (largest(y * c - z * n - center), largest(y * c + z * n - center)),
        "2.132": (largest((-y * c + z * n) * rchch.W1 - speed), largest((-y * c - z * n) * rchch.W1 - speed)),
    }


def decided() -> dict[str, tuple[float, float]]:
    """Equation number -> largest difference of its left side as printed and corrected."""
    return _decided_of_rcsr() | _decided_of_rcsr_csr() | _decided_directions() | _decided_of_rchch()
