"""Random mechanisms with friction in all pairs, in time, against free bodies in absolute coordinates.

Nothing is shared but the numbers: bodies with positions, quaternions and twists of their own, rows of pairs R, P, C and S that are
differentiated by hand, multipliers, and friction as a fixed point on these (A. A. Shabana, Dynamics of Multibody Systems, 2005, chapter 3).
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mechgraph as mg

G = np.array([0.0, -9.81, 0.0])
FINE = {"rtol": 1e-10, "atol": 1e-12}


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def turned(q, v):
    """A vector turned by a quaternion (w, x, y, z)."""
    t = 2.0 * cross(q[1:], v)
    return v + q[0] * t + cross(q[1:], t)


class Joint:
    """A pair between bodies a and b (-1: the frame), at a point, along an axis, with a coefficient and a radius."""

    def __init__(self, kind, a, b, point, axis, mu, radius):
        self.kind, self.a, self.b, self.point, self.axis = kind, a, b, np.array(point), axis / np.linalg.norm(axis)
        self.mu, self.radius = mu, radius
        side = cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
        self.across = [side / np.linalg.norm(side)]
        self.across.append(cross(self.axis, self.across[0]))

    def motion(self, at):
        """Rows on both twists (v, w), what they lack (bias), the axis, the point from both centers, relative turn and slide."""
        (ca, qa, va, wa), (cb, qb, vb, wb) = at(self.a), at(self.b)
        (c0a, *_), (c0b, *_) = self.start
        p = cb + turned(qb, self.point - c0b)
        u, e1, e2 = (turned(qa, one) for one in (self.axis, *self.across))
        ra, rb = p - ca, p - cb
        slides, turns = self.kind in "PC", self.kind != "P"
        drift = vb + cross(wb, rb) - va - cross(wa, ra)
        # acceleration of b's point less that of a's place there, for links that do not accelerate
        bias = cross(wb, cross(wb, rb)) - cross(wa, cross(wa, ra)) - 2.0 * cross(wa, drift)
        rows, rest = [], []
        for e in (e1, e2) if slides else np.eye(3):
            rows.append(np.concatenate([-e, -cross(ra, e), e, cross(rb, e)]))
            rest.append(e @ (bias if slides else bias + 2.0 * cross(wa, drift)))
        w = wb - wa
        for e in () if self.kind == "S" else (e1, e2) if turns else (u, e1, e2):
            rows.append(np.concatenate([0 * e, -e, 0 * e, e]))
            rest.append(cross(wa, e) @ w)
        return np.array(rows), np.array(rest), u, ra, rb, w, drift @ u

    def friction(self, forces, u, ra, rb, w, v):
        """Forces on both bodies (f, m) of friction, for the multipliers of the first rows."""
        F = forces if self.kind in "RS" else None
        mu, r = self.mu, self.radius
        if self.kind == "R":
            F = F - u * (u @ F)
            m, f = -r * mu / np.hypot(1.0, mu) * np.linalg.norm(F) * np.sign(w @ u) * u, 0 * u
        elif self.kind == "S":
            m, f = -r * mu / np.hypot(1.0, mu) * np.linalg.norm(F) * w / np.linalg.norm(w), 0 * u
        else:
            turn = w @ u if self.kind == "C" else 0.0
            speed = np.hypot(r * turn, v)
            size = mu * np.linalg.norm(forces) / np.hypot(1.0, mu * r * turn / speed)
            m, f = -size * r * (r * turn / speed) * u, -size * v / speed * u
        return np.concatenate([-f, -cross(ra, f) - m, f, cross(rb, f) + m])


class Bodies:
    """Free bodies with masses, inertias (about axes of space at the start), joints."""

    def __init__(self, masses, centers, inertias, joints):
        self.m, self.c0, self.J, self.joints, self.n = masses, centers, inertias, joints, len(masses)
        for joint in joints:
            joint.start = [(np.zeros(3) if i < 0 else centers[i],) for i in (joint.a, joint.b)]

    def accelerations(self, y):
        n = self.n
        parts = y[: 13 * n].reshape(n, 13)
        rest = (np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3))

        def at(i):
            return rest if i < 0 else (parts[i, :3], parts[i, 3:7], parts[i, 7:10], parts[i, 10:])

        M, f = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
        for i in range(n):
            _, q, _, w = at(i)
            R = np.stack([turned(q, e) for e in np.eye(3)], axis=1)
            J = R @ self.J[i] @ R.T
            M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = self.m[i] * np.eye(3)
            M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = J
            f[6 * i : 6 * i + 3], f[6 * i + 3 : 6 * i + 6] = self.m[i] * G, -cross(w, J @ w)
        moved = [joint.motion(at) for joint in self.joints]
        A, b = np.zeros((sum(len(one[0]) for one in moved), 6 * n)), np.concatenate([one[1] for one in moved])
        places, first = [], 0
        for joint, (rows, *_) in zip(self.joints, moved, strict=True):
            for i, part in ((joint.a, rows[:, :6]), (joint.b, rows[:, 6:])):
                if i >= 0:
                    A[first : first + len(rows), 6 * i : 6 * i + 6] = part
            places.append(first)
            first += len(rows)
        Mi = np.linalg.inv(M)
        D = np.linalg.pinv(A @ Mi @ A.T, rcond=1e-11)
        rubs, before = np.zeros(6 * n), None
        for _ in range(200):
            lam = -D @ (A @ (Mi @ (f + rubs)) + b)
            if before is not None and np.abs(lam - before).max() <= 1e-14 * np.abs(lam).max():
                break
            if not np.abs(lam).max() < 1e12:
                raise OverflowError
            before, rubs = lam, np.zeros(6 * n)
            for joint, at0, (_, _, u, ra, rb, w, v) in zip(self.joints, places, moved, strict=True):
                own = joint.friction(lam[at0 : at0 + (3 if joint.kind in "RS" else 2)], u, ra, rb, w, v)
                for i, part in ((joint.a, own[:6]), (joint.b, own[6:])):
                    if i >= 0:
                        rubs[6 * i : 6 * i + 6] += part
        a = Mi @ (f + rubs + A.T @ lam)
        twists = parts[:, 7:].ravel()
        return a, -rubs @ twists, moved

    def slope(self, t, y):
        n = self.n
        a, lost, _ = self.accelerations(y)
        parts, out = y[: 13 * n].reshape(n, 13), np.empty((n, 13))
        out[:, :3] = parts[:, 7:10]
        w, q = parts[:, 10:], parts[:, 3:7]
        out[:, 3] = -0.5 * (w * q[:, 1:]).sum(axis=1)
        for i in range(n):
            out[i, 4:7] = 0.5 * (q[i, 0] * w[i] + cross(w[i], q[i, 1:]))
        out[:, 7:] = a.reshape(n, 6)
        return np.append(out.ravel(), lost)

    def slips(self, which):
        """The rate of a joint with one freedom, as an event."""

        def height(t, y):
            _, _, moved = self.accelerations(y)
            _, _, u, _, _, w, v = moved[which]
            return w @ u if self.joints[which].kind == "R" else v

        height.terminal = True
        return height


SHAPES = ("R", "P", "RR", "RP", "SR", "RC", "CS", "PSR", "RRR-", "RRP-", "RSCR-", "RSSR-", "PSSR-")
"""Pairs along a chain from the frame; behind a - the last one ends at the frame."""

JAMS = (23,)
"""Seeds that friction jams at the start."""


def drawn(seed):
    """A mechanism, its bodies, rates of as many freedoms as it has."""
    rng = np.random.default_rng(seed)
    shape = SHAPES[seed % len(SHAPES)]
    closed, kinds = shape.endswith("-"), shape.rstrip("-")
    if closed and len(kinds) == 3:
        kinds = "R" + kinds  # four pairs in a plane
    n = len(kinds) - closed
    flat = closed and "S" not in kinds
    points = np.cumsum(rng.uniform(0.3, 0.8, (len(kinds), 3)) * rng.choice([-1.0, 1.0], (len(kinds), 3)), axis=0)
    if closed:  # around a loop that is long enough to move
        angle = 2 * np.pi * (np.arange(len(kinds)) + rng.uniform(-0.15, 0.15, len(kinds))) / len(kinds)
        points = np.stack([np.cos(angle), np.sin(angle), (not flat) * rng.uniform(-0.3, 0.3, len(kinds))], axis=1)
    axes = rng.normal(size=(len(kinds), 3))
    if flat:
        axes[:] = (0, 0, 1)
        axes[[i for i, kind in enumerate(kinds) if kind == "P"]] = (1, 0.3, 0)
    mu, radius = rng.uniform(0.02, 0.25, len(kinds)), rng.uniform(0.005, 0.03, len(kinds))
    masses = rng.uniform(0.5, 3.0, n)
    centers = np.array([points[i] + rng.uniform(-0.2, 0.2, 3) * (1, 1, not flat) for i in range(n)])
    roots = rng.normal(size=(n, 3, 3)) * 0.2
    spread = roots @ roots.swapaxes(1, 2) + 0.01 * np.eye(3)
    if flat:
        spread *= np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    inertias = np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(3) - spread
    joints = [
        Joint(kind, i - 1, -1 if closed and i == n else i, points[i], axes[i], mu[i], radius[i])
        for i, kind in enumerate(kinds)
    ]
    names = ["frame", *(f"b{i}" for i in range(n))]
    links = [mg.Link("frame"), *(mg.Link(f"b{i}", masses[i], centers[i], inertias[i]) for i in range(n))]
    pairs = [
        mg.Pair(
            f"J{i}",
            j.kind,
            names[j.a + 1],
            names[j.b + 1],
            point=j.point,
            **({} if j.kind == "S" else {"axis": j.axis}),
        )
        for i, j in enumerate(joints)
    ]
    dry = [
        mg.Friction(f"J{i}", mu=j.mu, **({} if j.kind == "P" else {"radius": j.radius})) for i, j in enumerate(joints)
    ]
    m = mg.Mechanism(shape, links, pairs, loads=[mg.Gravity(G), *dry])
    freedoms = m.freedom_names() if not closed else m.freedom_names()[:1]
    rates = {name: float(rng.choice([-1, 1]) * rng.uniform(1.0, 3.0)) for name in freedoms}
    return m, Bodies(masses, centers, inertias, joints), rates


@pytest.mark.filterwarnings("ignore:.*rubs nothing", "ignore:.*circle")
@pytest.mark.parametrize(
    "seed", [seed if seed in (8, 11) else pytest.param(seed, marks=pytest.mark.slow) for seed in range(52)]
)
def test_motions_up_to_the_first_stop_are_those_of_free_bodies(seed):
    m, bodies, rates = drawn(seed)
    end = 0.3
    still = mg.respond(m, [0.0, 1e-6], rates=rates, loads=[])
    links = [still.at(0.0).link(f"b{i}") for i in range(bodies.n)]
    begin = [
        np.concatenate([bodies.c0[i], [1, 0, 0, 0], link.center_velocity, link.angular_velocity])
        for i, link in enumerate(links)
    ]
    y0 = np.append(np.concatenate(begin), 0.0)
    if seed in JAMS:
        with pytest.raises(mg.FrictionError, match="jams"):
            mg.respond(m, (0.0, end), rates=rates, **FINE)
        with pytest.raises(OverflowError):
            bodies.accelerations(y0)
        return
    r = mg.respond(m, (0.0, end), rates=rates, **FINE)
    first = min([one.t for one in r.events if one.event.text.split()[-1] in ("sticks", "reverses")], default=r.t[-1])
    # in a loop rates pass zero without a stop; steps are short enough there
    single = [k for k, joint in enumerate(bodies.joints) if joint.kind in "RP" and not m.name.endswith("-")]
    events = [bodies.slips(k) for k in single]
    found = solve_ivp(bodies.slope, (0.0, first + 1e-6), y0, "DOP853", events=events, dense_output=True, **FINE)
    stop = min([float(one[0]) for one in found.t_events or () if len(one)], default=first)
    assert first == pytest.approx(stop, abs=1e-7)
    times = np.linspace(0.0, first, 4)[1:] * (1.0 - 1e-9)
    y, s = found.sol(times), r.at(times)
    for i in range(bodies.n):
        own = y[13 * i : 13 * i + 13].T
        np.testing.assert_allclose(s.link(f"b{i}").center, own[:, :3], atol=1e-7)
        np.testing.assert_allclose(
            s.link(f"b{i}").angular_velocity, own[:, 10:], atol=1e-6 * max(1.0, np.abs(own[:, 10:]).max())
        )
    np.testing.assert_allclose(s.energy.friction, y[-1], rtol=1e-6, atol=1e-8)
