"""RCHCH, sections 2.8 and 3.7: Tables XI to XIII and XXXIII to XXXVII."""

from functools import cache
from itertools import product

import numpy as np

import mechgraph as mg
from lee_1977.rcsr import axis_2
from lee_1977.tables import axial_sums, dot, largest, lees, printed, table

TWIST_1, TWIST_5 = np.deg2rad(10.0), np.deg2rad(60.0)
S1, P1, P5 = 0.2, 1.0, 0.4
PITCH_3, PITCH_5 = 2.0, 5.0
W1 = 0.1
M4, M_OUT, Y4, Z4 = 0.5, 10.0, 0.1, 0.01
A5 = np.array([np.cos(TWIST_5), 0.0, -np.sin(TWIST_5)])
O5 = np.array([0.0, P5, 0.0])
ANGLES = ("O1.Rz", "O2.Rz", "O4.Rz")
"""Turns that come back to the same position after a full turn; the helical pairs do not."""


def printed_positions() -> mg.Solution:
    """Links of both halves of the open chain at the angles and slides of Table XI (theta4 left out: it turns about A4).

    The left half is O1, O2, O3, the right half O5; the loop of the thesis would put the axes of O4 on both halves in one line.
    """
    m = mg.load("rchch")
    by_name = {p.name: p for p in m.pairs}
    open_chain = mg.Mechanism(
        "rchch open at O4",
        links=[mg.Link(link.name) for link in m.links],
        pairs=[p for name, p in by_name.items() if name != "O4"],
        drives=["O1", "O2.Rz", "O2.Tz", "O3", "O5"],
    )
    t = table("XI")
    radians = {name: np.deg2rad(t[name]) for name in ("theta1", "theta2", "theta3", "theta5")}
    return mg.kinematics(
        open_chain,
        {"O1": radians["theta1"], "O2.Rz": radians["theta2"], "O2.Tz": t["S2"], "O3": radians["theta3"],
         "O5": radians["theta5"]},
    )  # fmt: skip


def gap_of_table_xi() -> tuple[float, float]:
    """Smallest and largest angle (degrees) between the two directions of A4 over the printed rows; a closure has zero."""
    s = printed_positions()
    o4 = next(p for p in mg.load("rchch").pairs if p.name == "O4")
    left = s.link("link3").pose[:, :3, :3] @ np.asarray(o4.on_a.axis)
    right = s.link("link4").pose[:, :3, :3] @ np.asarray(o4.on_b.axis)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    between = np.rad2deg(np.arccos(np.clip(dot(left, right), -1.0, 1.0)))
    return float(between.min()), float(between.max())


def _rotation(axis: int, angle: np.ndarray | float) -> np.ndarray:
    """Rotations ``(..., 3, 3)`` about x (0) or z (2)."""
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*np.shape(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = out[..., j, j] = c
    out[..., j, i], out[..., i, j] = s, -s
    return out


def direction_gap(angles: dict[str, np.ndarray], signs: tuple[int, ...] = (1,) * 9) -> np.ndarray:
    """Angle (degrees) between the directions of A4 on both halves of the chain, from theta1, theta2, theta3, theta5 (radians):
    Rz1 Rx1 Rz2 Rx2 Rz3 Rx3 z against Rx5^-1 Rz5^-1 Rx4^-1 z, the four angles and the five twists with the signs given.
    """
    t1, t2, t3, t5 = (
        sign * angles[name] for sign, name in zip(signs, ("theta1", "theta2", "theta3", "theta5"), strict=False)
    )
    a1, a2, a3, a4, a5 = np.array(signs[4:]) * np.deg2rad([10.0, 80.0, 40.0, 50.0, 60.0])
    left = (
        _rotation(2, t1) @ _rotation(0, a1) @ _rotation(2, t2) @ _rotation(0, a2) @ _rotation(2, t3) @ _rotation(0, a3)
    )
    right = _rotation(0, -a5) @ _rotation(2, -t5) @ _rotation(0, -a4)
    return np.rad2deg(np.arccos(np.clip(dot(left[..., 2], right[..., 2]), -1.0, 1.0)))


def smallest_gaps_of_all_signs() -> tuple[float, float]:
    """Over all signs of angles and twists, theta1 positive: smallest greatest gap, and smallest median gap of Table XI."""
    t = table("XI")
    angles = {name: np.deg2rad(t[name]) for name in ("theta1", "theta2", "theta3", "theta5")}
    gaps = [direction_gap(angles, (1, *signs)) for signs in product((1, -1), repeat=8)]
    return float(min(g.max() for g in gaps)), float(min(np.median(g) for g in gaps))


def pitch_identities() -> dict[str, float]:
    """What holds in Tables XI to XIII: S3 = 2 theta3 and S5 = 5 theta5, and their rates."""
    t = table("XI")
    out = {
        "XI": max(
            largest(PITCH_3 * np.deg2rad(t["theta3"]) - t["S3"]), largest(PITCH_5 * np.deg2rad(t["theta5"]) - t["S5"])
        )
    }
    for number, w, s in (("XII", "w", "dot"), ("XIII", "alpha", "ddot")):
        t = table(number)
        out[number] = max(largest(pitch * t[f"{w}{k}"] - t[f"S{k}{s}"]) for pitch, k in ((PITCH_3, 3), (PITCH_5, 5)))
    return out


def slope_of_table_xi() -> float:
    """Largest difference of w5 / w1, w5 of Table XII in rad/s, from the difference quotient of theta5 in Table XI."""
    theta5, theta1 = table("XI")["theta5"], table("XI")["theta1"]
    return largest(np.gradient(theta5, theta1) - table("XII")["w5"] / W1)


@cache
def modes(theta1_deg: float = 0.0, starts: int = 60, turns: float = np.pi) -> tuple[tuple[float, ...], ...]:
    """Closed positions at one theta1 from seeded random starts, sorted; angles of turning pairs within half a turn.

    Only those whose helical angles stay within ``turns`` (radians): a helical pair advances, so every further turn is another
    position, and there are more of them.
    """
    m = mg.load("rchch")
    names = m.freedom_names()
    rng = np.random.default_rng(1977)
    found = set()
    theta1 = np.deg2rad(theta1_deg)
    for _ in range(starts):
        guess = dict(zip(names, rng.uniform(-turns, turns, len(names)), strict=True))
        guess |= {"O1.Rz": theta1, "O2.Tz": rng.uniform(-10, 10), "O4.Tz": rng.uniform(-10, 10)}
        try:
            start = mg.assemble(m, {"O1": theta1}, guess=guess).start
        except mg.AssemblyError:
            continue
        q = {n: (v + np.pi) % (2 * np.pi) - np.pi if n in ANGLES else v for n, v in start.items()}
        if max(abs(q["O3.Rz"]), abs(q["O5.Rz"])) <= turns:
            found.add(tuple(round(q[n], 6) for n in names))
    return tuple(sorted(found))


@cache
def branches(step: float = 5.0, end: float = 65.0) -> tuple[mg.Solution, ...]:
    """The four modes followed over theta1 from -end to end, a Solution each, positions in order."""
    m = mg.load("rchch")
    names = m.freedom_names()
    out = []
    sweep = np.deg2rad(np.arange(0.0, end + step / 2, step))
    for mode in modes():
        there = m.replace(start=dict(zip(names, mode, strict=True)))
        down = mg.kinematics(there, {"O1": -sweep})
        begin = {name: float(v) for name, v in zip(names, _coordinates(down)[-1], strict=True)}
        theta = np.deg2rad(np.arange(-end, end + step / 2, step))
        motion = mg.Motion(theta, velocity=0.1, acceleration=0.1)
        out.append(mg.solve(m.replace(start=begin), {"O1": motion}))
    return tuple(out)


def _coordinates(s: mg.Solution) -> np.ndarray:
    return np.concatenate([s[p.name].position for p in s.mechanism.pairs], axis=1)


def force_identities() -> dict[str, float]:
    """What holds in Tables XXXIII to XXXVII."""
    theta1 = np.deg2rad(table("XXXIII")["theta1"])
    o1, o2, o3, o5 = (printed(n) for n in ("XXXIII", "XXXIV", "XXXV", "XXXVII"))
    link_1 = o1[:, :6] + o2
    link_1[:, 0] += o1[:, 6]
    link_1[:, 3] += o1[:, 7]
    link_1[(theta1 == np.deg2rad(-55.0)) | (theta1 == np.deg2rad(-5.0)), 4] = np.nan  # damaged digits
    a2 = axis_2(theta1, TWIST_1)
    point_2 = np.column_stack([np.full_like(theta1, -S1), -P1 * np.cos(theta1), P1 * np.sin(theta1)])
    about_2 = axial_sums(o2[:, :3], o2[:, 3:], a2, point_2)
    about_5 = axial_sums(o5[:, :3], o5[:, 3:6], np.broadcast_to(A5, a2.shape), O5)
    size = np.abs(o2[:, :3]).max(axis=1)
    calm = size < 100.0
    return {
        "XXXIII: R51 + R21 + M_IN": largest(link_1),
        "XXXIV: F . A2, M about A2": largest(about_2[calm]),
        "XXXV: MA3 + 2 FA3": largest(o3[:, 7] + PITCH_3 * o3[:, 6]),
        "XXXVII: F . A5, M about A5": largest(about_5[calm]),
        "XXXVII: MA5 + 5 FA5": largest(o5[:, 7] + PITCH_5 * o5[:, 6]),
    }


def work_of_output() -> dict[str, float]:
    """Driver couple at theta1 = 0 without masses, under the output couple of 10 alone and with the force -10 / rho5 along A5
    that C(21) to C(23) of Table XXXII add to it: then the output wrench does no work on the helical pair.
    """
    m = mg.load("rchch")
    link = m.pairs[4].a
    m = m.replace(links=[mg.Link(item.name) for item in m.links], loads=[])
    still = mg.kinematics(m, {"O1": 0.0})
    axis = still.state().conditions[4][:3, 0, 0]  # -A5, in the library's axes
    if np.linalg.norm(axis) < 0.5:
        axis = still.state().conditions[4][:3, 1, 0]
    o5 = next(p for p in m.pairs if p.name == "O5")
    couple = mg.Wrench(link, moment=-10.0 * axis)
    push = mg.Wrench(link, force=10.0 / PITCH_5 * axis, point=o5.on_a.point)
    return {
        "couple": float(mg.solve(m, {"O1": 0.0}, loads=[couple])["O1"].effort[0]),
        "as printed": float(mg.solve(m, {"O1": 0.0}, loads=[couple, push])["O1"].effort[0]),
    }


def axial_force_of_o4() -> float:
    """F43 . A4 of Table XXXVI, which a cylindrical pair makes zero: its greatest value over the rows with forces below 100, at the
    best choice of signs. A4 is the direction that theta5 of Table XI gives it on the half of the chain beyond O5.
    """
    force = printed("XXXVI")[:, :3]
    calm = np.linalg.norm(force, axis=1) < 100.0
    theta5 = np.deg2rad(table("XI")["theta5"])
    a4, a5 = np.deg2rad([50.0, 60.0])
    greatest = []
    for turned, first, second in product((1, -1), repeat=3):
        axes = _rotation(0, -first * a5) @ _rotation(2, -turned * theta5) @ _rotation(0, -second * a4)
        greatest.append(largest(dot(force, lees(axes[..., 2]))[calm]))
    return min(greatest)


def force_row_of_link_4(mass: float = M4, output: float = M_OUT) -> np.ndarray:
    """3.104 with the term of Table XXXII over the rows of Tables XXXVI and XXXVII, ``(25, 3)``, zero where the row holds:

    ``-F43 + F54 + (FA5 - M_out / rho5) A5 - M4 a_m4``, a_m4 by 2.130 from theta5 (XI), w5 (XII), alpha5 and S5ddot (XIII).
    """
    theta, w, alpha = np.deg2rad(table("XI")["theta5"]), table("XII")["w5"], table("XIII")["alpha5"]
    c, s = np.cos(theta), np.sin(theta)
    across, along = Y4 * c - Z4 * s, Z4 * c + Y4 * s
    turning = np.column_stack([-A5[2] * across, -along, A5[0] * across])
    inward = np.column_stack([A5[2] * along, -across, -A5[0] * along])
    a4 = turning * alpha[:, None] + inward * w[:, None] ** 2 + A5 * table("XIII")["S5ddot"][:, None]
    push = (table("XXXVII")["FA5"] - output / PITCH_5)[:, None] * A5
    return np.asarray(-printed("XXXVI")[:, :3] + printed("XXXVII")[:, :3] + push - mass * a4)
