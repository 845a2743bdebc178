"""A second kinematics and statics: absolute coordinates of all links, constraint rows of each pair, Lagrange's multipliers.

It shares nothing with the package but the declaration: no loops, no pair kernels, no scaling. A link has a rotation and an origin,
a pair is what its definition keeps constant between the marker axes on both links (groove, plane and slot on link a), and all that
is differentiated is differentiated by complex steps. Dense, one position at a time, as slow as it is simple.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import mechgraph as mg

STEP = 1e-40
"""Imaginary step of derivatives; nothing cancels, so that it may be as small as it likes."""
RANK = 1e-9
"""Singular value against the largest that counts as zero."""

HELD = {
    "R": "dx dy dz zx zy",
    "P": "dx dy xy yz zx",
    "H": "dx dy zx zy screw",
    "C": "dx dy zx zy",
    "U": "dx dy dz zx",
    "S": "dx dy dz",
    "E": "dz zx zy",
    "Sc": "dx dy yx",
    "Sg": "dx dy",
    "Cp": "dz zx",
    "Sp": "dz",
    "W": "dx dy dz xy yz zx",
}
"""What a pair keeps at zero. ``dx``: marker B's origin against A's along A's x; ``zx``: cosine of A's z and B's x."""
FREE = {
    "R": "Rz", "P": "Tz", "H": "Rz", "C": "Rz Tz", "U": "Rz Rx", "S": "rotation", "E": "Tx Ty Rz", "Sc": "Tz Ry Rx", "Sg": "Tz rotation",
    "Cp": "Tx Ty Rz Rx", "Sp": "Tx Ty rotation", "W": "",
}  # fmt: skip
"""Freedoms in order; turns follow each other about A's axes as far as the ones before leave them, x is then that of B."""
LEFT = {"U": ("zx", ("My",)), "Cp": ("zx", ("My",)), "Sc": ("xy", ("Mz",)), "Sg": ("", ()), "Sp": ("", ())}
"""Frames of later components: none is at A's own origin, and those named turn with both links."""


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def rotation(v):
    """Rotation of a rotation vector, by Rodrigues."""
    angle = np.linalg.norm(v)
    K = hat(v)
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K @ K


def shifted(w, old, new):
    """Wrenches ``(6, n)`` about the point ``old``, taken about ``new``."""
    return np.concatenate([w[:3] + hat(old - new) @ w[3:], w[3:]])


@dataclass(frozen=True)
class Markers:
    """The markers of one pair in the global frame: axes as columns, origins; ``relative`` are rows ``(couple, force)`` at B's origin."""

    symbol: str
    A: np.ndarray
    a: np.ndarray
    B: np.ndarray
    b: np.ndarray
    pitch: float

    @property
    def held(self):
        """Residuals (the screw's without its turn) and the rows of relative twists that the pair does not allow."""
        d, out = self.b - self.a, []
        for name in HELD[self.symbol].split():
            if name == "screw":
                z = self.A[:, 2]
                out.append((d @ z, np.concatenate([-self.pitch * z, z])))
            elif name[0] == "d":
                u = self.A[:, "xyz".index(name[1])]
                out.append((d @ u, np.concatenate([0 * u, u])))
            else:
                u, v = self.A[:, "xyz".index(name[0])], self.B[:, "xyz".index(name[1])]
                out.append((u @ v, np.concatenate([hat(v) @ u, 0 * u])))
        return out

    @property
    def free(self):
        """Coordinates (None in a rotation) and the rows of relative twists that are their rates: wrenches of unit efforts, too."""
        A, B, d = self.A, self.B, self.b - self.a
        x = B[:, 0]
        out = []
        for name in FREE[self.symbol].split():
            if name == "rotation":
                out += [(None, np.concatenate([u, 0 * u])) for u in A.T]
            elif name[0] == "T":
                u = A[:, "xyz".index(name[1])]
                out.append((d @ u, np.concatenate([0 * u, u])))
            else:
                still = A[:, 1] if "Ry" in FREE[self.symbol] else A[:, 2]
                turned, axis = {
                    "Rz": ((A[:, 1] @ x, A[:, 0] @ x), A[:, 2]),
                    "Ry": ((-A[:, 2] @ x, A[:, 0] @ x), A[:, 1]),
                    "Rx": ((still @ B[:, 1], still @ B[:, 2]), x)
                    if "Ry" not in FREE[self.symbol]
                    else ((-still @ B[:, 2], still @ B[:, 1]), x),
                }[name]
                out.append((np.arctan2(*np.real(turned)), np.concatenate([axis, 0 * axis])))
        return out

    def component(self, name, w):
        """A reaction component of the wrenches ``w (6, n)``, (M, F) about B's origin."""
        turning, which = LEFT.get(self.symbol, ("", ()))
        x, y, z = self.A.T
        if name in which:
            x, y, z = (
                (self.B[:, 0], np.cross(z, self.B[:, 0]), z)
                if turning == "zx"
                else (self.B[:, 0], y, np.cross(self.B[:, 0], y))
            )
        u = {"x": x, "y": y, "z": z}[name[1]]
        return u @ (w[3:] if name[0] == "F" else shifted(w, self.b, self.b if self.symbol in LEFT else self.a)[:3])


@dataclass(frozen=True)
class Bodies:
    """Where all links stand: rotations ``R (n, 3, 3)``, origins ``p (n, 3)``; coordinates of all freedoms, turns unwrapped."""

    R: np.ndarray
    p: np.ndarray
    q: np.ndarray


class Absolute:
    """A mechanism in absolute coordinates: six increments a moving link, ``(w, velocity of the link's origin)``."""

    def __init__(self, m: mg.Mechanism) -> None:
        self.m = m
        self.moving = [i for i, k in enumerate(m.links) if k.name != m.frame]
        self.ends = [(m.link_index[p.a], m.link_index[p.b]) for p in m.pairs]
        self.poses = [tuple(k.pose() for k in p.markers) for p in m.pairs]
        self.first = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(int)
        self.driven = [m.freedom_names().index(m.full_name(d.freedom)) for d in m.drives]
        self.relations = [{m.freedom_names().index(m.full_name(name)): c for name, c in g.terms} for g in m.couplings]
        n = len(m.links)
        self.start = Bodies(np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros(self.first[-1]))

    def markers(self, at):
        """Markers of all pairs."""
        out = []
        for pair, (a, b), (on_a, on_b) in zip(self.m.pairs, self.ends, self.poses, strict=True):
            R, S = at.R[a], at.R[b]
            place = at.p[a] + R @ on_a[:, 3], at.p[b] + S @ on_b[:, 3]
            out.append(
                Markers(pair.type.symbol, R @ on_a[:, :3], place[0], S @ on_b[:, :3], place[1], pair.pitch_per_radian)
            )
        return out

    def moved(self, at, x):
        """The links moved by increments, and the coordinates next to those before."""
        R, p = at.R.copy(), at.p.copy()
        for i, step in zip(self.moving, x.reshape(-1, 6), strict=True):
            R[i], p[i] = rotation(step[:3]) @ R[i], p[i] + step[3:]
        out = Bodies(R, p, at.q)
        new = np.array([v if v is not None else 0.0 for k in self.markers(out) for v, _ in k.free])
        turn = [v is not None and f[0] == "R" for k in self.m.pairs for v, f in self._kinds(k)]
        full = np.where(turn, 2 * np.pi * np.round((at.q - new) / (2 * np.pi)), 0.0)
        return replace(out, q=new + full)

    @staticmethod
    def _kinds(pair):
        names = [f.name for f in pair.type.freedoms]
        return [(None if "rotation" in FREE[pair.type.symbol] and name[0] == "R" else 1, name) for name in names]

    def spread(self, pair, rows, at, b):
        """Rows of relative twists at the point ``b`` as rows of all increments."""
        out = np.zeros((len(rows), len(at.p), 6), dtype=np.result_type(at.R, float))
        for sign, link in zip((-1, 1), self.ends[pair], strict=True):
            out[:, link, 3:] += sign * rows[:, 3:]
            out[:, link, :3] += sign * (rows[:, :3] + rows[:, 3:] @ hat(b - at.p[link]).T)
        return out[:, self.moving].reshape(len(rows), 6 * len(self.moving))

    def rows(self, at):
        """Rows ``(constraints, freedoms, drivers, couplings)`` of all increments."""
        held, free = [], []
        for k, marker in enumerate(self.markers(at)):
            for target, found in ((held, marker.held), (free, marker.free)):
                target.append(self.spread(k, np.array([row for _, row in found]).reshape(-1, 6), at, marker.b))
        held, free = np.concatenate(held), np.concatenate(free)
        coupled = [sum(c * free[j] for j, c in terms.items()) for terms in self.relations]
        return held, free, free[self.driven], np.array(coupled).reshape(-1, free.shape[1])

    def residual(self, at, drive):
        """What the constraints, the drivers and the couplings are off."""
        out = []
        for k, marker in enumerate(self.markers(at)):
            turn = self.m.pairs[k].pitch_per_radian * at.q[self.first[k]] if self.m.pairs[k].type.takes_pitch else 0.0
            names = HELD[marker.symbol].split()
            out += [r - (turn if n == "screw" else 0.0) for n, (r, _) in zip(names, marker.held, strict=True)]
        coupled = [sum(c * at.q[j] for j, c in terms.items()) for terms in self.relations]
        return np.concatenate([out, at.q[self.driven] - drive, coupled])

    def jacobian(self, at):
        """Rows of constraints, drivers and couplings; how many are those of the constraints."""
        held, _, driven, coupled = self.rows(at)
        return np.concatenate([held, driven, coupled]), len(held)

    def closed(self, at, drive):
        """Newton's method with least steps, to rounding, and its first step; None where it does not get there."""
        last, moved = np.inf, np.zeros(0)
        for _ in range(30):
            r = self.residual(at, drive)
            size = np.abs(r).max(initial=0.0)
            if size < 1e-15 or last < 1e-8:
                return (at if size < 1e-11 else None), moved
            x = -np.linalg.lstsq(self.jacobian(at)[0], r, rcond=RANK)[0]
            at, last, moved = self.moved(at, x), size, moved if len(moved) else x
        return None, moved

    def led(self, at, begin, end, limit):
        """The links led from the drivers' values ``begin`` to ``end``: tangent, correction; shorter steps where it exceeds ``limit``."""
        place, step = 0.0, 0.1
        while place < 1.0 and step > 1e-5:
            step = min(step, 1.0 - place)
            G, n = self.jacobian(at)
            rate = np.concatenate([np.zeros(n), end - begin, np.zeros(len(self.relations))])
            ahead = self.moved(at, step * np.linalg.lstsq(G, rate, rcond=RANK)[0])
            found, correction = self.closed(ahead, begin + (place + step) * (end - begin))
            if found is None or np.abs(correction).max(initial=0.0) > limit:
                step /= 2
                continue
            at, place, step = found, place + step, 2 * step
        return at if place >= 1.0 else None

    def accelerations(self, at, v, second):
        """Least accelerations for velocities ``v``."""
        G, n = self.jacobian(at)
        right = -self.change(at, v, (0, 2, 3)) @ v
        right[n : n + len(self.driven)] += second
        return np.linalg.lstsq(G, right, rcond=RANK)[0]

    def change(self, at, v, which):
        """Rate of the rows while the links move with ``v``."""
        R, p = at.R.astype(complex), at.p.astype(complex)
        for i, x in zip(self.moving, v.reshape(-1, 6), strict=True):
            R[i] += 1j * STEP * hat(x[:3]) @ at.R[i]
            p[i] += 1j * STEP * x[3:]
        rows = self.rows(replace(at, R=R, p=p))
        return np.concatenate([rows[i] for i in which]).imag / STEP

    def freedom_rates(self, at, v, a):
        """Rates and accelerations of all freedoms."""
        free = self.rows(at)[1]
        return free @ v, free @ a + self.change(at, v, (1,)) @ v

    # --- forces ------------------------------------------------------------------------------------------------------------

    def point(self, at, v, link, p):
        """A material point and its velocity."""
        arm = at.R[link] @ np.asarray(p, dtype=float)
        w = self.full(v)[link]
        return at.p[link] + arm, w[3:] + np.cross(w[:3], arm)

    def full(self, x):
        """Increments of all links, those of the frame zero."""
        out = np.zeros((len(self.m.links), 6))
        out[self.moving] = x.reshape(-1, 6)
        return out

    def loads(self, at, v, a):
        """Wrenches on all links about their origins (applied and inertia), and given efforts in freedoms, by their definitions."""
        m = self.m
        W, efforts = np.zeros((len(m.links), 6)), np.zeros(self.first[-1])
        rates = self.rows(at)[1] @ v
        V, A = self.full(v), self.full(a)
        names = m.freedom_names()

        def push(link, force, place):
            W[link] += np.concatenate([np.cross(place - at.p[link], force), force])

        for i, k in enumerate(m.links):
            if k.center is None or i not in self.moving:
                continue
            w, alpha, arm = V[i, :3], A[i, :3], at.R[i] @ np.asarray(k.center)
            I = at.R[i] @ (np.zeros((3, 3)) if k.inertia is None else np.asarray(k.inertia)) @ at.R[i].T
            push(i, -k.mass * (A[i, 3:] + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))), at.p[i] + arm)
            W[i, :3] -= I @ alpha + np.cross(w, I @ w)
        for load in m.loads:
            match load:
                case mg.Gravity(acceleration=g):
                    for i, k in enumerate(m.links):
                        if k.mass:
                            push(i, k.mass * np.asarray(g), self.point(at, v, i, k.center)[0])
                case mg.Wrench():
                    i = m.link_index[load.link]
                    R = at.R[i] if load.frame == "link" else np.eye(3)
                    push(i, R @ np.asarray(load.force), self.point(at, v, i, load.point)[0])
                    W[i, :3] += R @ np.asarray(load.moment)
                case mg.Spring():
                    i, j = m.link_index[load.a], m.link_index[load.b]
                    (p, vp), (q, vq) = self.point(at, v, i, load.p), self.point(at, v, j, load.q)
                    length = np.linalg.norm(q - p)
                    u = (q - p) / length
                    pull = load.stiffness * (length - load.free_length) + load.damping * u @ (vq - vp)
                    push(i, pull * u, p)
                    push(j, -pull * u, q)
                case mg.Effort():
                    efforts[names.index(m.full_name(load.freedom))] += load.value
                case mg.TorsionSpring():
                    j = names.index(m.full_name(load.freedom))
                    efforts[j] -= load.stiffness * (at.q[j] - load.free) + load.damping * rates[j]
        return W, efforts

    def multipliers(self, at, W, efforts):
        """Least multipliers of constraints, drivers and couplings, a basis of the states without load, and the residual of equilibrium."""
        free, (G, _) = self.rows(at)[1], self.jacobian(at)
        right = -(W[self.moving].ravel() + free.T @ efforts)
        u, sigma, vt = np.linalg.svd(G.T, full_matrices=True)
        rank = int((sigma > RANK * sigma[0]).sum())
        least = vt[:rank].T @ ((u[:, :rank].T @ right) / sigma[:rank])
        return least, vt[rank:].T, np.abs(G.T @ least - right).max(initial=0.0), sigma

    def transmitted(self, at, states):
        """For multiplier states (columns) reactions of all pairs, about B's origin ``(pairs, 6, n)``, efforts of drivers, couplings."""
        out, place = [], 0
        for marker in self.markers(at):
            rows = np.array([row for _, row in marker.held]).reshape(-1, 6)
            out.append(rows.T @ states[place : place + len(rows)])
            place += len(rows)
        n = len(self.driven)
        return np.array(out), states[place : place + n], states[place + n :]
