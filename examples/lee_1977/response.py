"""RCSR, section 3.5: Tables XIX to XXIII (motion under a given input torque)."""

from functools import cache

import numpy as np

import mechgraph as mg
from lee_1977.rcsr import axis_2
from lee_1977.tables import X, axial_sums, largest, lees, printed, table

TWIST_1, TWIST_4 = np.deg2rad(10.0), np.deg2rad(20.0)
S1, S4, P1, P3, P4 = 5.0, 4.0, 5.0, 5.0, 10.0
A4 = np.array([np.cos(TWIST_4), 0.0, -np.sin(TWIST_4)])
O4 = S4 * A4 + [0.0, P4, 0.0]
STEP = 0.1
TORQUE = 10.0
MASSES = (2.0, 5.0, 5.0)


@cache
def mechanism() -> mg.Mechanism:
    """The RCSR of section 3.5 with S1 = 5 and S4 = 4, which it does not print, and point masses."""
    centres = ((-1.0, 1.0, 4.5), (-1.0, 1.0, -0.5), (P3 - 1.0, 1.0, -0.5))
    return mg.chain(
        "RCSR",
        twist=[TWIST_1, 0.0, 0.0, TWIST_4],
        length=[P1, 10.0, P3, P4],
        offset=[S1, 0.0, 0.0, S4],
        links=[mg.Link(f"link{i + 1}", M, c) for i, (M, c) in enumerate(zip(MASSES, centres, strict=True))],
        start={"O1": np.deg2rad(20.0), "O2.Rz": 3.046, "O2.Tz": -9.862, "O4": 2.663},
    )


def speed() -> np.ndarray:
    """w1 of every row by the trapezoid of the printed alpha1 from rest, alpha1 zero before the first row."""
    a = np.concatenate([[0.0], table("XIX")["alpha1"]])
    return np.cumsum(STEP * (a[:-1] + a[1:]) / 2)


def integration() -> dict[str, float]:
    """Table XIX: largest differences of w1 and theta1 (degrees), summed from the first row on, from the printed ones.

    w1 by the trapezoid of alpha1; theta1 by that of w1, one row late. Equation 3.69 (the slope at the beginning of a step)
    stands for comparison.
    """
    t = table("XIX")
    w = speed()
    late = np.concatenate([[0.0], w])
    turn = np.cumsum(STEP * (late[:-1] + late[1:]) / 2)[:-1]
    euler = w[0] + STEP * np.cumsum(t["alpha1"][:-1])
    return {
        "w1": largest(w - t["w1"]),
        "theta1": largest(20.0 + np.rad2deg(turn) - t["theta1"][1:]),
        "w1 by 3.69": largest(euler - t["w1"][1:]),
    }


def dependent_rates() -> dict[str, float]:
    """Table XIX: rates and accelerations of O2 and O4 with w1, alpha1 of the row before."""
    t = table("XIX")
    s = mg.kinematics(
        mechanism(),
        {"O1": mg.Motion(np.deg2rad(t["theta1"][1:]), velocity=speed()[:-1], acceleration=t["alpha1"][:-1])},
    )
    found = {
        "w2": s["O2"].velocity[:, 0],
        "w4": s["O4"].velocity[:, 0],
        "alpha2": s["O2"].acceleration[:, 0],
        "alpha4": s["O4"].acceleration[:, 0],
    }
    return {name: largest(values - t[name][1:]) for name, values in found.items()}


def acceleration_at_rest() -> float:
    """alpha1 = M_IN / J at rest in the first row, J the inertia of the point masses reduced to O1.

    The tensors of the thesis are left out: no position makes them inertias of a body.
    """
    s = mg.solve(mechanism(), {"O1": mg.Motion(np.deg2rad(20.0), velocity=0.0, acceleration=1.0)})
    return TORQUE / float(s["O1"].effort[0])


def identities() -> dict[str, float]:
    """What holds in Tables XX to XXIII: conditions of the pairs O1, O2, O4 and the torque of 10 on link 1."""
    theta1 = np.deg2rad(table("XIX")["theta1"])
    a2 = axis_2(theta1, TWIST_1)
    o2 = np.column_stack([np.full_like(theta1, -S1), -P1 * np.cos(theta1), P1 * np.sin(theta1)])
    xx, xxi, xxiii = printed("XX"), printed("XXI"), printed("XXIII")
    along_4 = np.broadcast_to(A4, a2.shape)
    return {
        "XX: F, M about A1": largest(axial_sums(xx[:, :3], xx[:, 3:6], np.broadcast_to(X, a2.shape), np.zeros(3))),
        "XXI: F . A2": largest(axial_sums(xxi[:, :3], xxi[:, 3:], a2, o2)[:, 0]),
        "XXI: M about A2": largest(axial_sums(xxi[:, :3], xxi[:, 3:], a2, o2)[:, 1]),
        "XXI: M12x - 10": largest(xxi[:, 3] - TORQUE),
        "XXIII: F . A4": largest(axial_sums(xxiii[:, :3], xxiii[:, 3:6], along_4, O4)[:, 0]),
        "XXIII: M about A4": largest(axial_sums(xxiii[:, :3], xxiii[:, 3:6], along_4, O4)[:, 1]),
    }


def link_3() -> dict[str, float]:
    """Force row of link 3: R43 + R23 against M3 times the acceleration of its center, R23 of Table XXII.

    ``decoded`` leaves the velocity terms out and takes alpha1 alone, ``true`` has both.
    """
    t, xxiii, xxii = table("XIX"), printed("XXIII"), printed("XXII")
    theta1 = np.deg2rad(t["theta1"])
    s = mg.kinematics(mechanism(), {"O1": mg.Motion(theta1, velocity=t["w1"], acceleration=t["alpha1"])})
    still = mg.kinematics(mechanism(), {"O1": mg.Motion(theta1, velocity=0.0, acceleration=t["alpha1"])})
    t2, t4 = s["O2"].position[:, 0], s["O4"].position[:, 0]
    b = np.column_stack([np.sin(t4) * np.sin(TWIST_4), np.cos(t4), np.sin(t4) * np.cos(TWIST_4)])
    s1, c1, s2, c2 = np.sin(theta1), np.cos(theta1), np.sin(t2), np.cos(t2)
    sa, ca = np.sin(TWIST_1), np.cos(TWIST_1)
    c = np.column_stack([-s2 * sa, -c1 * c2 + s1 * s2 * ca, c1 * s2 * ca + s1 * c2])
    d = np.cross(b, c)
    r23 = xxii[:, :1] * b + xxii[:, 1:2] * c + xxii[:, 2:3] * d
    total = xxiii[:, :3] + xxiii[:, 6:7] * A4 + r23
    return {
        "decoded": largest(total - MASSES[2] * lees(still.link("link3").center_acceleration)),
        "true": largest(total - MASSES[2] * lees(s.link("link3").center_acceleration)),
    }
