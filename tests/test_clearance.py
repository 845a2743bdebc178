"""The slider-crank of Flores, Leine and Glocker with clearance in its guide, its four corners striking, sliding on and leaving both walls.

P. Flores, R. Leine, Ch. Glocker, Modeling and analysis of planar rigid multibody systems with translational clearance joints based on the
non-smooth dynamics approach, Multibody System Dynamics 23, 2010, table 1. They show diagrams; against an own program of time stepping, and
the reference results of Siconos for the same data.
"""

import numpy as np
import pytest

import mechgraph as mg

X, Y, Z = np.eye(3)
G = 9.81
CRANK, ROD, HALF, HEIGHT, PLAY = 0.153, 0.306, 0.05, 0.025, 0.001
M1, M2, M3, J1, J2, J3 = 0.038, 0.038, 0.076, 7.4e-5, 5.9e-4, 2.7e-6
MU, E = 0.01, 0.4
CORNERS = ((-1, 1), (1, 1), (-1, -1), (1, -1))


def with_clearance() -> mg.Mechanism:
    """The walls are lines, which press on what lies on their side: y of z along the third and x along the line."""
    at = {"crank": (M1, CRANK / 2, J1), "rod": (M2, CRANK + ROD / 2, J2), "slider": (M3, CRANK + ROD, J3)}
    links = [mg.Link("frame"), *(mg.Link(name, m, (x, 0, 0), j * np.eye(3)) for name, (m, x, j) in at.items())]
    ends = {"A": ("frame", "crank", 0.0), "B": ("crank", "rod", CRANK), "C": ("rod", "slider", CRANK + ROD)}
    pairs = [mg.Pair(name, "R", a, b, point=(x, 0, 0), axis=Z) for name, (a, b, x) in ends.items()]
    for i, (side, up) in enumerate(CORNERS, 1):
        along, x = (-up, 0, 0), CRANK + ROD + side * HALF
        wall = mg.Curve.line(point=(0, up * (HEIGHT + PLAY), 0), direction=along)
        on = {
            "on_a": mg.Marker((x, up * (HEIGHT + PLAY), 0), Z, along),
            "on_b": mg.Marker((x, up * HEIGHT, 0), Z, along),
        }
        pairs.append(
            mg.Pair(f"K{i}", "Ps", "frame", "slider", curve=wall, closed="force", restitution=E, gap=PLAY, **on)
        )
    dry = [mg.Friction(f"K{i}", mu=MU) for i in range(1, 5)]
    return mg.Mechanism("slider-crank", links, pairs, loads=[mg.Gravity((0, -G, 0)), *dry], planar=True)


def stepped(end: float, step: float) -> tuple[np.ndarray, list[tuple[float, int, float]]]:
    """Moreau's time stepping in the angles of crank, rod and slider: these and their rates, and the strikes (time, corner, impulse)."""
    k = (0.5 * M2 + M3) * CRANK * ROD
    q, u, strikes, before = np.zeros(3), np.array([150.0, -75.0, 0.0]), [], set()
    for n in range(round(end / step)):
        middle = q + 0.5 * step * u
        s, c = np.sin(middle), np.cos(middle)
        turn = middle[0] - middle[1]
        M = np.diag([J1 + (0.25 * M1 + M2 + M3) * CRANK**2, J2 + (0.25 * M2 + M3) * ROD**2, J3])
        M[0, 1] = M[1, 0] = k * np.cos(turn)
        force = np.array([
            -k * np.sin(turn) * u[1] ** 2 - (0.5 * M1 + M2 + M3) * G * CRANK * c[0],
            k * np.sin(turn) * u[0] ** 2 - (0.5 * M2 + M3) * G * ROD * c[1],
            0.0,
        ])  # fmt: skip
        now = u + np.linalg.solve(M, force) * step
        x = [(side * HALF * c[2] - up * HEIGHT * s[2], side * HALF * s[2] + up * HEIGHT * c[2]) for side, up in CORNERS]
        up = np.array([up for _, up in CORNERS])
        gap = HEIGHT + PLAY - up * (CRANK * s[0] + ROD * s[1] + np.array(x)[:, 1])
        closed = np.flatnonzero(gap <= 0.0)
        if len(closed):
            normal = [-up[i] * np.array([CRANK * c[0], ROD * c[1], x[i][0]]) for i in closed]
            along = [np.array([-CRANK * s[0], -ROD * s[1], -x[i][1]]) for i in closed]
            A, n_closed, free = np.array(normal + along), len(closed), now
            D, p = A @ np.linalg.solve(M, A.T), np.zeros(2 * len(closed))
            for _ in range(1000):
                last = p.copy()
                for i in range(n_closed):
                    j = n_closed + i
                    p[i] = max(0.0, p[i] - (A[i] @ (free + E * u) + D[i] @ p) / D[i, i])
                    p[j] = np.clip(p[j] - (A[j] @ free + D[j] @ p) / D[j, j], -MU * p[i], MU * p[i])
                if np.abs(p - last).max() < 1e-14:
                    break
            now = free + np.linalg.solve(M, A.T @ p)
            pressed = {int(i): float(p[m]) for m, i in enumerate(closed) if p[m] > 0.0}
            strikes += [((n + 1) * step, i + 1, size) for i, size in pressed.items() if i not in before]
            before = set(pressed)
        else:
            before = set()
        q, u = middle + 0.5 * step * now, now
    return np.concatenate([q, u]), strikes


@pytest.mark.slow
def test_corners_strike_both_walls_as_two_programs_of_time_stepping_say() -> None:
    end = 0.03
    r = mg.respond(with_clearance(), [0.0, end], rates={"A": 150.0, "B": -225.0, "C": 75.0}, rtol=1e-8, atol=1e-10)
    strikes = [(one.t, int(str(one)[1]), one.impulse) for one in r.events if one.impulse]
    # Siconos, steps of 1e-4: both lower corners in the step to 0.026 with 0.046878 and 0.046411; its own error is of first order
    lower = [one for one in strikes if one[1] > 2][:2]
    np.testing.assert_allclose([one[0] for one in lower], 0.0259, atol=1e-4)
    np.testing.assert_allclose(lower[0][2] / lower[1][2], 0.04687789894 / 0.04641145219, rtol=1e-5)
    np.testing.assert_allclose([one[2] for one in lower], [0.046878, 0.046411], rtol=0.06)
    (coarse, _), (fine, struck) = (stepped(end, step) for step in (4e-6, 2e-6))
    for got, one in zip(strikes[:8], struck, strict=False):
        assert got[1] == one[1]
        assert got[0] == pytest.approx(one[0], abs=4e-5)
    # errors of first order, extrapolated to steps of nothing: eighteen strikes, slides and the other wall are behind
    crank = r["A"].position[-1, 0]
    np.testing.assert_allclose([crank, crank + r["B"].position[-1, 0]], (2 * fine - coarse)[:2], atol=1e-5)
    assert np.abs(r.energy.balance).max() < 1e-7
