"""Equations of chapter II as printed and as they have to be, against the motion that mechgraph computes.

Every entry is (largest difference as printed, largest difference corrected); RCSR over the rows of Table III, w1 = .1.
"""

import numpy as np

import mechgraph as mg
from lee_1977.rcsr import TWIST_1, TWIST_4, motion
from lee_1977.tables import dot, largest, lees, table

P1, P2, P3, P4, S1, S4, W1, ALPHA1 = 0.5, 0.8, 0.4, 0.5, 5.0, 4.0, 0.1, 0.2
CENTRE = (0.5, 1.0, 1.0)
SA, CA, S4A, C4A = np.sin(TWIST_1), np.cos(TWIST_1), np.sin(TWIST_4), np.cos(TWIST_4)


def columns(*parts: np.ndarray | float) -> np.ndarray:
    return np.column_stack(np.broadcast_arrays(*[np.asarray(p, dtype=float) for p in parts]))


def chapter_2() -> dict[str, tuple[float, float]]:
    """Equation number -> differences as printed and corrected."""
    s = motion()
    t1, t2, t4 = (s[name].position[:, 0] for name in ("O1", "O2", "O4"))
    s2, s2dot, s2ddot = s["O2"].position[:, 1], s["O2"].velocity[:, 1], s["O2"].acceleration[:, 1]
    w2, w4 = s["O2"].velocity[:, 0], s["O4"].velocity[:, 0]
    c1, n1, c2, n2, c4, n4 = np.cos(t1), np.sin(t1), np.cos(t2), np.sin(t2), np.cos(t4), np.sin(t4)
    x, y, z = CENTRE
    out: dict[str, tuple[float, float]] = {}

    left = columns(-P2 * SA * n2 - s2 * CA - S1,
                   c1 * (-P2 * c2 - P1) + n1 * (P2 * CA * n2 - s2 * SA),
                   c1 * (P2 * CA * n2 - s2 * SA) + n1 * (P2 * c2 + P1))  # fmt: skip
    right = columns(P3 * S4A * n4 + S4 * C4A, P4, P3 * C4A * n4 - S4A * S4)
    out["2.20"] = tuple(largest(left - right - columns(0, d2 * c4, 0)) for d2 in (P4, P3))

    def centre_2(arm: float) -> np.ndarray:
        radial = y * c2 + n2 * z - arm
        across = -CA * z * c2 + CA * y * n2 + s2 * SA - x * SA
        return columns(-S1 - z * SA * c2 + n2 * SA * y - s2 * CA + x * CA,
                       c1 * radial - n1 * across, -c1 * across - n1 * radial)  # fmt: skip

    out["2.28"] = tuple(largest(centre_2(arm) - lees(s.link("link2").center)) for arm in (P2, P1))

    v1 = columns(P2 * SA * c2, -P2 * n2 * c1 - P2 * CA * c2 * n1, n1 * P2 * n2 - P2 * CA * c1 * c2)
    v2 = columns(CA, n1 * SA, c1 * SA)
    v3 = columns(P3 * S4A * c4, -P3 * n4, P3 * C4A * c4)
    vy = c1 * (P2 * CA * n2 - s2 * SA) + n1 * (P2 * c2 + P1)
    vz = c1 * (-P2 * c2 - P1) + n1 * (P2 * CA * n2 - s2 * SA)
    rates = v1 * w2[:, None] + v2 * s2dot[:, None] + v3 * w4[:, None]
    out["2.44, 2.47"] = tuple(largest(rates - columns(0, vy, sign * vz) * W1) for sign in (1.0, -1.0))

    axis_rate = columns(0, -c1 * SA, n1 * SA) * W1
    twist = s.link("link1").twist
    true_rate = np.cross(lees(twist[:, :3]), v2)
    out["2.51"] = (largest(axis_rate - true_rate), largest(-axis_rate - true_rate))

    shift = columns(0, c1 * s2 * SA - P1 * n1, -c1 * P1 - s2 * n1 * SA) * W1
    o2 = s.link("link2").point((0.0, 0.0, 0.0))
    o2_rate = v2 * s2dot[:, None] + shift
    out["2.53"] = (largest(o2_rate - lees(o2.velocity)), largest(-o2_rate - lees(o2.velocity)))

    true_pm1 = lees(s.link("link1").center_velocity)
    out["2.55"] = (
        largest(columns(0, -(y * n1 + z * c1), y * c1 + z * n1) * W1 - true_pm1),
        largest(columns(0, -y * n1 + z * c1, -y * c1 - z * n1) * W1 - true_pm1),
    )

    true_o2 = lees(o2.acceleration)
    inner = columns(
        0, -c1 * SA * s2dot + (c1 * P1 + n1 * s2 * SA) * W1, n1 * SA * s2dot + (c1 * s2 * SA - n1 * P1) * W1
    )
    turning = columns(0, c1 * s2 * SA - n1 * P1, -c1 * P1 - n1 * s2 * SA)
    printed = axis_rate * s2dot[:, None] + v2 * s2ddot[:, None] + inner * W1 + turning * ALPHA1
    arm = lees(o2.position) + columns(S1, 0, 0) * np.ones((len(t1), 1))
    corrected = (
        columns(0, -turning[:, 1], -turning[:, 2]) * ALPHA1
        - W1**2 * columns(0, arm[:, 1], arm[:, 2])
        - v2 * s2ddot[:, None]
        - 2 * s2dot[:, None] * true_rate
    )
    out["2.64"] = (largest(printed - true_o2), largest(corrected - true_o2))

    true_a1 = lees(s.link("link1").center_acceleration)
    first = columns(0, y * n1 - z * c1, y * c1 + z * n1) * ALPHA1
    second = columns(0, -y * c1 - z * n1, y * n1 + z * c1)
    third = columns(0, -y * c1 - z * n1, y * n1 - z * c1) * W1**2
    out["2.66"] = (largest(first + second - true_a1), largest(-first + third - true_a1))
    return out


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


def rows() -> int:
    """Number of rows compared."""
    return len(table("III")["theta1"])
