"""RCSR-CSR, sections 2.7 and 3.6: Tables X and XXV to XXXI.

The second loop of the thesis is built here with the two errors that its tables show: the axis of O2 at +P1 j (equations 2.70
to 2.73) and the direction of A5 carried about an axis at 15 degrees (the a2 of section 3.6) in place of a1 = 10 degrees. No
rigid link moves so, so every row is a mechanism of its own: links 5 and 6 on a link 2 that is held where the row has it.
"""

from dataclasses import replace
from functools import cache

import numpy as np

import mechgraph as mg
from lee_1977.tables import X, dot, largest, lees, ours, printed, table, without_axis, wrench

A1, A2, A4, A5, A8 = np.deg2rad([10.0, 15.0, 10.0, 20.0, 20.0])
TURN = np.deg2rad(20.0)  # theta_c1 = theta_c2
SLIDE_1, SLIDE_2, S1, S4, S7 = 0.5, 0.6, 5.0, 4.0, 0.8
P1, P4, P5, P6, P7, P8 = 0.5, 0.6, 0.5, 0.4, 1.0, 0.5
J = np.array([0.0, 1.0, 0.0])
AXIS_4 = np.array([np.cos(A4), 0.0, -np.sin(A4)])
POINT_4 = S4 * AXIS_4 + P4 * J
AXIS_7 = np.array([np.cos(A8), np.sin(TURN) * np.sin(A8), -np.cos(TURN) * np.sin(A8)])
RADIAL_7 = np.array([0.0, np.cos(TURN), np.sin(TURN)])
POINT_7 = SLIDE_1 * X + P8 * RADIAL_7  # equation 2.78
POINT_6R = SLIDE_1 * X + (P8 + P7) * RADIAL_7  # equation 2.77


def direction(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), 0.0, np.sin(angle)])


def turned(axis: np.ndarray, angle: float, v: np.ndarray) -> np.ndarray:
    """Rotation of v about an axis through the origin."""
    c, s = np.cos(angle), np.sin(angle)
    return c * v + s * np.cross(axis, v) + (1 - c) * (axis @ v) * axis


SHORT = 1.8e-6
"""The degree with which theta1 goes in is too short by so much (see ``errata.short_degree``)."""


def drive(short: float) -> dict[str, mg.Motion]:
    """The stored motion of O1, its angles shorter by the factor ``1 - short``."""
    stored = mg.load("rcsr-csr").drives[0].motion
    return {"O1": mg.Motion(stored.position * (1.0 - short), stored.velocity, stored.acceleration)}


@cache
def motion(short: float = 0.0) -> mg.Solution:
    """The mechanism that closes (P6 = 1): its first loop is Lee's."""
    return mg.kinematics(mg.load("rcsr-csr"), drive(short))


def loop_1() -> dict[str, float]:
    """Largest differences from theta2, theta4 (degrees) and S2 of Table X."""
    s = motion()
    angles = np.rad2deg(np.column_stack([s["O2"].position[:, 0], s["O4"].position[:, 0]]))
    return {
        "angles": largest(angles - printed("X", "theta2", "theta4")),
        "S2": largest(s["O2"].position[:, 1] - table("X")["S2"]),
    }


def carried(theta1: float, theta2: float, slide2: float, v: np.ndarray, sign: float = 1.0) -> np.ndarray:
    """A point of link 2, v from O2 unfolded, after the screws at O2 and O1; O2 at ``sign * P1 j``."""
    axis = direction(A1)
    at = turned(axis, -(theta2 + TURN), v) + sign * P1 * J - (slide2 + SLIDE_2) * axis
    return turned(X, -theta1, at) - S1 * X


def loop_2_mechanism(row: int, sign: float = 1.0, carry: float = A2, short: float = 0.0) -> mg.Mechanism:
    """Links 5 and 6 of one row of Table X; ``sign=-1, carry=A1`` is the geometry without the two errors."""
    s = motion(short)
    theta1, theta2, slide2 = s["O1"].position[row, 0], s["O2"].position[row, 0], s["O2"].position[row, 1]
    o5 = carried(theta1, theta2, slide2, -P5 * J, sign)
    o6 = carried(theta1, theta2, slide2, -(P5 + P6) * J, sign)
    axis = turned(X, -theta1, turned(direction(carry), -(theta2 + TURN), direction(A1 + A5)))
    here = {"point": o5, "axis": -axis}  # a screw left of the origin counts negative
    return mg.Mechanism(
        f"second loop of Table X, theta1 = {np.rad2deg(theta1):.0f}",
        links=[mg.Link(name) for name in ("frame", "link2", "link5", "link6")],
        pairs=[
            mg.Pair("hold", "R", "frame", "link2", point=(0, 0, 0), axis=X),
            mg.Pair("O5", "C", "link2", "link5", on_a=mg.Marker(**here), on_b=mg.Marker(**here)),
            mg.Pair("O6", "S", "link5", "link6", on_a=mg.Marker(o6), on_b=mg.Marker(POINT_6R)),
            mg.Pair(
                "O7", "R", "frame", "link6",
                on_a=mg.Marker(POINT_7 + S7 * AXIS_7, AXIS_7), on_b=mg.Marker(POINT_7, AXIS_7),
            ),
        ],
        drives=["hold"],
        loads=[mg.Wrench("link6", moment=4.0 * AXIS_7 * [1.0, 1.0, -1.0])],
        start={"O5.Rz": 0.53, "O5.Tz": 2.15, "O7.Rz": 2.85},
    )  # fmt: skip


def coordinates(s: mg.Solution) -> list[float]:
    """The coordinates of O5, O6, O7 of one position."""
    return [float(q) for name in ("O5", "O6", "O7") for q in s[name].position]


@cache
def loop_2(short: float = 0.0) -> tuple[mg.Solution, ...]:
    """Every row with the errors; one row starts the next."""
    out: list[mg.Solution] = []
    start = loop_2_mechanism(0).start
    for row in range(len(table("X")["theta1"])):
        s = mg.solve(loop_2_mechanism(row, short=short).replace(start=start), {"hold": 0.0})
        start = dict(zip(s.mechanism.freedom_names()[1:], coordinates(s), strict=True))
        out.append(s)
    return tuple(out)


def loop_2_columns() -> dict[str, float]:
    """Largest differences from S5 and theta7 of Table X, both errors copied."""
    s5 = np.array([s["O5"].position[1] for s in loop_2()])
    theta7 = np.rad2deg([s["O7"].position[0] for s in loop_2()])
    return {"S5": largest(s5 - table("X")["S5"]), "theta7": largest(theta7 - table("X")["theta7"])}


def gap_without_errors() -> float:
    """Smallest distance (inches), over the rows, between the circle of O6 about A7 and the cylinder of O6 about A5 with the
    printed P6 = .4: how far the loop is from closing on the branch of Table X.
    """
    s = motion()
    turns = np.linspace(0.0, 2 * np.pi, 721)
    circle = np.array([POINT_7 + S7 * AXIS_7 + turned(AXIS_7, t, POINT_6R - POINT_7) for t in turns])
    gaps = []
    for row in range(len(table("X")["theta1"])):
        theta1, theta2, slide2 = s["O1"].position[row, 0], s["O2"].position[row, 0], s["O2"].position[row, 1]
        o5 = carried(theta1, theta2, slide2, -P5 * J, -1.0)
        axis = turned(X, -theta1, turned(direction(A1), -(theta2 + TURN), direction(A1 + A5)))
        gaps.append((np.linalg.norm(np.cross(circle - o5, axis), axis=1) - P6).min())
    return float(min(gaps))


@cache
def other_branch() -> mg.Solution:
    """The printed dimensions, P6 = .4, over the rows of Table X: they close, but not on the branch of the table."""
    return mg.kinematics(mg.load("rcsr-csr-printed"))


def _screw(v: np.ndarray, point: np.ndarray) -> np.ndarray:
    return np.concatenate([np.cross(point, v), v])


@cache
def forces_at_o6(short: float = 0.0) -> np.ndarray:
    """F^E, F^F, F^G and the six components of R25 of every row, the dual parts of E, F, G where the thesis has them.

    E and G are taken through O6R before the rotation theta7 and the shift S7 (2.77), F through O6L before theta5 and S5
    (2.70); the z component of the output couple has the wrong sign. Everything else is the generated formulation.
    """
    rows = []
    for row, s in enumerate(loop_2(short)):
        f = mg.formulate(s.mechanism, bookkeeping="lee")
        state = s.state()
        motion_1 = motion(short)
        theta1, theta2, slide2 = (
            motion_1["O1"].position[row, 0],
            motion_1["O2"].position[row, 0],
            motion_1["O2"].position[row, 1],
        )
        theta5, theta7 = s["O5"].position[0], s["O7"].position[0]
        e = turned(AXIS_7, theta7, RADIAL_7)
        back = turned(direction(A1 + A5), -theta5, -J)
        back = turned(X, -theta1, turned(direction(A1), -(theta2 + TURN), back))
        g = np.cross(e, back)
        left = carried(theta1, theta2, slide2, -(P5 + P6) * J)
        screws = np.column_stack([_screw(e, POINT_6R), _screw(back, left), _screw(g, POINT_6R)])
        reactions = list(state.reactions)
        reactions[2] = screws[:, :, None]
        A, b = f.assemble(replace(state, reactions=tuple(reactions)))
        u = np.linalg.solve(A.toarray(), b)
        at = [i for i, unknown in enumerate(f.unknowns) if unknown.owner == "O6"]
        rows.append(np.concatenate([u[at], screws @ u[at]]))
    return np.array(rows)


def true_forces_at_o6() -> np.ndarray:
    """R25 of every row of the same closures with pure forces through O6 and the output couple about A7, ``(T, 6)``."""
    out = []
    for s in loop_2():
        m = s.mechanism.replace(loads=[mg.Effort("O7", 4.0)])
        out.append(mg.solve(m, {"hold": 0.0})["O5"].reaction)
    return np.array(out)


def loop_1_loaded(r25: np.ndarray, short: float = 0.0) -> mg.Solution:
    """The first loop without mass under M_out1 = 1 about A4 and the reaction of link 5 on link 2, ``-R25 (T, 6)``."""
    m = mg.load("rcsr-csr")
    force, moment = -r25[:, 3:], -r25[:, :3]
    at = lees(motion(short).link("link2").point((0.0, 0.0, 0.0)).position)
    push = mg.Wrench("link2", force=ours(force), moment=ours(moment - np.cross(at, force)), point=(0, 0, 0))
    names = ("O1", "O2", "O3", "O4")
    return mg.solve(
        m.replace(
            links=[link for link in m.links if link.name not in ("link5", "link6")],
            pairs=[p for p in m.pairs if p.name in names],
            loads=[mg.Effort("O4", 1.0), push],
            start={k: v for k, v in m.start.items() if k.partition(".")[0] in names},
        ),
        drive(short),
    )


def spherical_directions(s: mg.Solution) -> np.ndarray:
    """B, C, D of the sphere O3 as columns, ``(T, 3, 3)``: equations 2.33 to 2.35."""
    t1, t2, t4 = (s[name].position[:, 0] for name in ("O1", "O2", "O4"))
    b = np.column_stack([np.sin(t4) * np.sin(A4), np.cos(t4), np.sin(t4) * np.cos(A4)])
    s1, c1, s2, c2 = np.sin(t1), np.cos(t1), np.sin(t2), np.cos(t2)
    c = np.column_stack([-s2 * np.sin(A1), -c1 * c2 + s1 * s2 * np.cos(A1), c1 * s2 * np.cos(A1) + s1 * c2])
    return np.stack([b, c, np.cross(b, c)], axis=2)


def axial_force_from_table_xxviii() -> np.ndarray:
    """FA4 of every row from the printed forces at O3: link 3 has no mass, so ``FA4 = -(FB B + FC C + FD D) . A4``."""
    force = (spherical_directions(motion()) * printed("XXVIII")[:, None, :3]).sum(axis=2)
    return -force @ AXIS_4


def reactions(s: mg.Solution) -> dict[str, np.ndarray]:
    """A solution of the first loop in the columns of Tables XXV to XXVIII."""
    o3, _ = wrench(s["O3"].reaction)
    parts = np.linalg.solve(spherical_directions(s), o3[:, :, None])[:, :, 0]
    f4, m4 = wrench(-s["O4"].reaction)
    return {
        "XXV": without_axis(*wrench(s["O1"].reaction), X, np.zeros(3)),
        "XXVI": np.column_stack(wrench(s["O2"].reaction)),
        "XXVII": without_axis(f4, m4, AXIS_4, POINT_4),
        "XXVIII": np.column_stack([parts, -s["O1"].effort[:, 0]]),
    }


DAMAGED = {"XXVI": [(14, 1), (25, 0)], "XXVII": [(27, 6)]}
"""Rows and columns whose digits do not fit their neighbors: row 188 F21y, row 210 F21x, row 214 FA4."""


@cache
def copied(short: float = 0.0) -> dict[str, np.ndarray]:
    """Tables XXV to XXX with the errors of the thesis, in its columns; theta1 shorter by the factor ``1 - short``."""
    found = forces_at_o6(short)
    r25 = np.column_stack([found[:, 6:], found[:, 3:6]])
    return {**reactions(loop_1_loaded(found[:, 3:], short)), "XXIX": r25, "XXX": found[:, :3]}


def differences(number: str, short: float = 0.0) -> np.ndarray:
    """Of a table of section 3.6 with his errors from the printed one; damaged digits are NaN."""
    out = copied(short)[number] - printed(number)
    for cell in DAMAGED.get(number, []):
        out[cell] = np.nan
    return out


def kinetostatics(short: float = 0.0) -> dict[str, float]:
    """Largest differences from Tables XXV to XXXI, the errors of the thesis copied."""
    out = {number: largest(differences(number, short)) for number in copied()}
    out["XXXI"] = largest(table_xxxi(short)[0])
    out["XXXI row 214"] = largest(table_xxxi(short)[1])
    return out


def table_xxxi(short: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Differences from the column F46x of all rows, and from the whole last row."""
    found = forces_at_o6(short)[:, 3:]
    couple = 4.0 * AXIS_7 * [1.0, 1.0, -1.0]
    force, moment = -found[:, 3:], -found[:, :3] - couple
    ours_xxxi = without_axis(force, moment, AXIS_7, POINT_7)
    shown = printed("XXXI")
    return ours_xxxi[:, 0] - shown[:, 0], ours_xxxi[-1] - shown[-1]


def shifted_columns() -> float:
    """Largest difference of the other columns of Table XXXI, row k, from Table XXV, row k + 1."""
    return largest(printed("XXXI")[:-1, 1:] - printed("XXV")[1:, :6])


def spread_of_printed_r25() -> tuple[float, float]:
    """Range of F . M of the printed R25: a pure force would have zero everywhere."""
    shown = printed("XXIX")
    products = dot(shown[:, :3], shown[:, 3:])
    return float(products.min()), float(products.max())


@cache
def without_errors_at_o6() -> dict[str, np.ndarray]:
    """Tables XXV to XXVIII from the same closures with pure forces at O6."""
    return reactions(loop_1_loaded(true_forces_at_o6()))


def driver_without_errors_at_o6() -> dict[int, tuple[float, float]]:
    """theta1 -> M_IN with pure forces at O6 (same closures), M_IN as printed; first and last row."""
    found = without_errors_at_o6()["XXVIII"][:, 3]
    theta, shown = table("XXVIII")["theta1"], table("XXVIII")["MIN"]
    return {int(theta[i]): (float(found[i]), float(shown[i])) for i in (0, -1)}
