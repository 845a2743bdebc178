"""Random mechanisms from a seed: one to four loops, all pair types, random geometry, masses, loads and drives.

Everything is drawn from one numpy generator, so that a failing seed is a reproduction. Loops are closed at q = 0 by the
point/axis form, whatever the geometry; by the twist/length/offset form they are open and have to be assembled.
"""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

import mechgraph as mg
from mechgraph.kinematics.assembly import assembled, named_columns
from mechgraph.kinematics.state import Configuration
from mechgraph.pairs.curves import Travel

SEEDS = st.integers(0, 2**32 - 1)

COMMON = ("R", "R", "R", "P", "H", "C", "U", "S", "E", "Sc", "Sg", "Cp", "Sp")
"""Pair types as they are drawn: revolutes more often, every movable row that bears a force at least once."""

PLANE_ON_PLANE = mg.PairType("PlTilt", "plane tilting on a plane", freedoms=["Tx", "Rz", "Ry"], reactions=None)
"""A row of a user without constant reaction components: the null space of S^T serves."""


def unit(rng, n=3):
    v = rng.normal(size=n)
    return v / np.linalg.norm(v)


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def pose(rng, size=1.0):
    """A random rigid motion (4, 4)."""
    X = np.eye(4)
    X[:3, :3] = rotation(rng)
    X[:3, 3] = size * rng.normal(size=3)
    return X


def body(rng, name, center, size=1.0):
    """A link with the mass and inertia of a turned box."""
    mass = float(rng.uniform(0.2, 3.0))
    inertia = mg.inertia.box(mass, size * rng.uniform(0.1, 0.6, 3), axes=rotation(rng))
    return mg.Link(name, mass=mass, center=center, inertia=inertia)


def symbols_with(rng, total, longest=7):
    """Random pair symbols whose freedoms add up to ``total``."""
    rows = mg.pair_types()
    while True:
        n = int(rng.integers(2, longest + 1))
        drawn = [str(s) for s in rng.choice(COMMON, n)]
        if sum(rows[s].f for s in drawn) == total:
            return drawn


def placed(rng, name, symbol, a, b, at):
    row = mg.pair_types()[symbol] if isinstance(symbol, str) else symbol
    axis = unit(rng)
    more = {"pitch": float(rng.uniform(0.05, 0.3) * rng.choice([-1, 1]))} if row.takes_pitch else {}
    if row.square_second:
        more["second"] = np.cross(axis, unit(rng))
    if rng.random() < 0.5:
        a, b = b, a
    return mg.Pair(name, symbol, a, b, point=at, axis=axis, **more)


def closed_mechanism(seed, loops=None, mobility=None, branches=None, symbols=None, masses=True):
    """A random mechanism with closed loops at q = 0, no drives and no loads.

    The first loop is a ring through the frame; every further loop is a chain between two links that are there. The freedoms
    of each add up so that the mobility by count is ``mobility``.
    """
    rng = np.random.default_rng(seed)
    loops = int(rng.integers(1, 5)) if loops is None else loops
    extra = int(rng.integers(1, 3)) if mobility is None else mobility
    branches = int(rng.integers(0, 2)) if branches is None else branches
    links, pairs = ["frame"], []

    def chain(start, goal, types):
        ends = [start, *(f"b{len(links) + i}" for i in range(len(types) - 1)), goal]
        links.extend(ends[1:-1])
        for symbol, a, b in zip(types, ends, ends[1:], strict=False):
            pairs.append(placed(rng, f"J{len(pairs) + 1}", symbol, a, b, rng.uniform(-1, 1, 3)))

    for i in range(loops):
        types = symbols or symbols_with(rng, 6 + (extra if i == 0 else 0))
        a = links[int(rng.integers(len(links)))]
        others = [x for x in links if x != a]
        b = others[int(rng.integers(len(others)))] if others else a
        chain(a, b, types)
    for _ in range(branches):
        symbol = str(rng.choice(["R", "P", "H", "W"]))
        a = links[int(rng.integers(len(links)))]
        links.append(f"arm{len(links)}")
        pairs.append(placed(rng, f"J{len(pairs) + 1}", symbol, a, links[-1], rng.uniform(-1, 1, 3)))
    bodies = [mg.Link("frame"), *(body(rng, k, rng.uniform(-1, 1, 3)) if masses else mg.Link(k) for k in links[1:])]
    return mg.Mechanism(f"random {seed}", links=bodies, pairs=pairs)


def with_drives(m, seed):
    """Drives added one after the other among the drivable freedoms, until nothing but passive freedoms is left; or None."""
    rng = np.random.default_rng((seed, 1))
    while True:
        report = mg.check(m)
        if not report.undriven:
            return m
        drivable = {name for finding in report.drivable for name in finding.freedoms}
        able = [name for finding in report.undriven for name in finding.freedoms if name in drivable]
        able = [name for name in able if name not in {d.freedom for d in m.drives}]
        if not able:
            return None
        m = m.replace(drives=[*m.drives, mg.Drive(able[int(rng.integers(len(able)))])])


def with_loads(m, seed, constant=False):
    """Gravity, wrenches in both frames, springs between points and in freedoms, a given effort."""
    rng = np.random.default_rng((seed, 2))
    moving = [k.name for k in m.links if k.name != m.frame]
    single = [n for p in m.pairs for n, d in zip(p.freedom_names, p.type.drivable, strict=True) if d]
    every = list(m.freedom_names())

    def some(names):
        return str(names[int(rng.integers(len(names)))])

    loads = [
        mg.Gravity(9.81 * unit(rng)),
        mg.Wrench(some(moving), force=10 * rng.normal(size=3), moment=rng.normal(size=3), point=rng.uniform(-1, 1, 3)),
        mg.Wrench(
            some(moving),
            force=10 * rng.normal(size=3),
            moment=rng.normal(size=3),
            point=rng.uniform(-1, 1, 3),
            frame="link",
        ),
        mg.Effort(some(every), float(rng.normal())),
    ]
    if not constant:
        a, b = rng.choice([k.name for k in m.links], 2, replace=False)
        loads += [
            mg.Spring(
                str(a),
                str(b),
                rng.uniform(-1, 1, 3),
                rng.uniform(1.5, 2.5, 3),
                stiffness=30.0,
                free_length=0.4,
                damping=0.7,
            ),
            mg.TorsionSpring(some(single), stiffness=5.0, free=0.3, damping=0.2),
        ]
    return m.replace(loads=loads)


def with_loads_on_links(m, seed):
    """The same without those in freedoms: such a load makes a freedom, passive otherwise, the mechanism's own."""
    m = with_loads(m, seed)
    return m.replace(loads=[load for load in m.loads if load.in_freedom is None])


def motions(m, seed, t, size=0.08):
    """Smooth motions of all drives from their start, ``q = start + a (cos(w t + p) - cos p)``, with exact rates."""
    rng = np.random.default_rng((seed, 3))
    out = {}
    for drive in m.drives:
        a, w, p = size * rng.uniform(0.5, 1.0), rng.uniform(0.7, 1.5), rng.uniform(0, 2 * np.pi)
        begin = m.start.get(m.full_name(drive.freedom), 0.0)
        phase = w * np.asarray(t) + p
        out[drive.freedom] = mg.Motion(
            begin + a * (np.cos(phase) - np.cos(p)), -a * w * np.sin(phase), -a * w * w * np.cos(phase), t=t
        )
    return out


def solvable(seed, **more):
    """A random mechanism with drives and loads, and its report; None where no drives make it determinate."""
    m = with_drives(closed_mechanism(seed, **more), seed)
    if m is None:
        return None
    return with_loads(m, seed)


def open_chain(seed, letters=None, masses=True):
    """A single loop declared by markers (twist, length, offset), open at q = 0, with a start found by assembling."""
    rng = np.random.default_rng((seed, 4))
    letters = letters or "".join(symbols_with(rng, 7))
    pairs = mg.chain(letters, drive=None).pairs
    n = len(pairs)
    names = [f"link{k}" for k in range(1, n)]
    links = [body(rng, k, rng.uniform(-0.5, 0.5, 3)) for k in names] if masses else None
    m = mg.chain(
        letters,
        twist=rng.uniform(0.5, 2.6, n) * rng.choice([-1, 1], n),
        length=rng.uniform(0.3, 1.0, n),
        offset=rng.uniform(-0.4, 0.4, n),
        pitch=dict.fromkeys((f"O{k + 1}" for k, p in enumerate(pairs) if p.type.takes_pitch), 0.1),
        links=links,
        drive=None,
        name=f"chain {letters} {seed}",
    )
    return m


def rescaled(m, length=1.0, mass=1.0, time=1.0):
    """The same mechanism in other units: one unit of length, mass, time is now ``length``, ``mass``, ``time`` new ones."""
    force = mass * length / time**2

    def vec(v, factor):
        return None if v is None else factor * np.asarray(v)

    def marker(k):
        return None if k is None else mg.Marker(vec(k.point, length), k.axis, k.second)

    links = [
        replace(k, mass=mass * k.mass, center=vec(k.center, length), inertia=vec(k.inertia, mass * length**2))
        for k in m.links
    ]
    pairs = [
        mg.Pair(
            p.name,
            p.type,
            p.a,
            p.b,
            point=vec(p.point, length),
            axis=p.axis,
            second=p.second,
            pitch=None if p.pitch is None else length * p.pitch,
            lead=None if p.lead is None else length * p.lead,
            on_a=marker(p.on_a),
            on_b=marker(p.on_b),
        )
        for p in m.pairs
    ]

    def turns(name):
        k, j = m.freedom(name)
        return m.pairs[k].type.freedoms[j].turns

    loads = []
    for load in m.loads:
        match load:
            case mg.Gravity():
                loads.append(mg.Gravity(vec(load.acceleration, length / time**2)))
            case mg.Wrench():
                loads.append(
                    replace(
                        load,
                        force=vec(load.force, force),
                        moment=vec(load.moment, force * length),
                        point=vec(load.point, length),
                    )
                )
            case mg.Effort():
                loads.append(replace(load, value=load.value * (force * length if turns(load.freedom) else force)))
            case mg.Spring():
                loads.append(
                    replace(
                        load,
                        p=vec(load.p, length),
                        q=vec(load.q, length),
                        stiffness=load.stiffness * force / length,
                        free_length=load.free_length * length,
                        damping=load.damping * force / length * time,
                    )
                )
            case mg.TorsionSpring():
                unit_ = force * length if turns(load.freedom) else force / length
                free = load.free * (1 if turns(load.freedom) else length)
                loads.append(
                    replace(load, stiffness=load.stiffness * unit_, free=free, damping=load.damping * unit_ * time)
                )
    start = {k: v * (1 if turns(k) else length) for k, v in m.start.items()}
    return m.replace(links=links, pairs=pairs, loads=loads, start=start)


def rescaled_motions(m, given, length=1.0, time=1.0):
    """Driver motions in other units."""
    out = {}
    for name, motion in given.items():
        k, j = m.freedom(name)
        u = 1.0 if m.pairs[k].type.freedoms[j].turns else length
        out[name] = mg.Motion(u * motion.position, u / time * motion.velocity, u / time**2 * motion.acceleration)
    return out


def chebyshev_times(begin, end, n):
    """Chebyshev points of the first kind on an interval, increasing."""
    x = -np.cos(np.pi * (np.arange(n) + 0.5) / n)
    return begin + 0.5 * (end - begin) * (x + 1)


def chebyshev_rate(t, values):
    """Time derivative of values at Chebyshev points by their interpolant, and a bound of its error from the last coefficients."""
    n = len(t)
    x = -np.cos(np.pi * (np.arange(n) + 0.5) / n)
    flat = np.asarray(values).reshape(n, -1)
    c = np.polynomial.chebyshev.chebfit(x, flat, n - 1)
    half = 0.5 * (t[-1] - t[0]) / np.cos(np.pi * 0.5 / n)
    rate = np.polynomial.chebyshev.chebval(x, np.polynomial.chebyshev.chebder(c)).T / half
    tail = n * n * np.abs(c[-3:]).max(initial=0.0) / half
    return rate.reshape(np.shape(values)), float(tail)


def curve_through(rng, point):
    """A random curve of any kind that passes ``point``, open or closed, plane or in space."""
    angle = np.linspace(0, 2 * np.pi, 25)[:-1]
    knot = np.stack(
        [(2 + np.cos(3 * angle)) * np.cos(2 * angle), (2 + np.cos(3 * angle)) * np.sin(2 * angle), np.sin(3 * angle)],
        axis=1,
    )
    axis = unit(rng)
    curve = [
        mg.Curve.line(direction=axis),
        mg.Curve.circle(radius=0.8, axis=axis),
        mg.Curve.ellipse(a=1.2, b=0.8, axis=axis),
        mg.Curve.helix(radius=0.7, pitch=0.3, axis=axis),
        mg.Curve.helix(radius=0.7, pitch=0.3, axis=axis, frame="guided"),
        mg.Curve.involute(radius=0.8, angles=(0.3, 2.0), axis=axis),
        mg.Curve.through(points=np.cumsum(rng.normal(size=(9, 3)) * 0.2 + 0.6 * axis, axis=0)),
        mg.Curve.through(points=0.7 * knot, closed=True, frame="guided", guide=axis + np.array([0, 0, 3])),
    ][int(rng.integers(8))]
    travel = Travel(curve)
    shift = np.eye(3, 4)
    begin, length = (travel.begin, travel.length) if np.isfinite(travel.begin) else (0.0, 2.0)
    shift[:, 3] = point - travel.at(np.array(begin + rng.uniform(0.4, 0.6) * length)).x
    return curve.moved(shift)


def with_curves(m, seed):
    """The mechanism with all its pairs P, C and Sg bent: curves through their points; one more in place of the last pair R."""
    rng = np.random.default_rng((seed, 6))
    last = [p.name for p in m.pairs if p.type.symbol == "R"][-1:]
    pairs = [
        mg.Pair(
            p.name, "P" if p.name in last else p.type.symbol, p.a, p.b, point=p.point, curve=curve_through(rng, p.point)
        )
        if p.name in last or p.type.symbol in ("P", "C", "Sg")
        else p
        for p in m.pairs
    ]
    return m.replace(pairs=pairs)


# --- A second opinion on positions out of reach: pseudo-arclength continuation, in which the path parameter may turn back ---


class _Path:
    """The straight path through the driver values, by its length; the last direction goes on beyond the end."""

    def __init__(self, points):
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=1), axis=0))])
        keep = np.concatenate([[True], np.diff(length) > 0])
        self.points, self.length = points[:, keep], length[keep]
        self.end = self.length[-1]

    def slope(self, s):
        i = min(max(int(np.searchsorted(self.length, s, side="right")) - 1, 0), len(self.length) - 2)
        return (self.points[:, i + 1] - self.points[:, i]) / (self.length[i + 1] - self.length[i])

    def at(self, s):
        inside = np.array([np.interp(s, self.length, row) for row in self.points])
        return inside + max(0.0, s - self.end) * self.slope(self.end)


def fold_before_the_end(m, given, step=1e-2, steps=1000):
    """Whether the curve of closed positions over the driver path turns back (or runs off) before the path ends."""
    system, x = assembled(m, {k: float(np.ravel(v.position)[0]) for k, v in given.items()})
    columns, _ = named_columns(m, system, dict.fromkeys(given, 0.0))
    rows = system.single_rows[columns]
    unit = np.where(system.is_length[columns], system.par.L, 1.0)
    values = np.array([np.ravel(v.position) for v in given.values()]) / unit[:, None]
    path = _Path(np.concatenate([x[rows][:, None], values], axis=1))
    F = system.n_freedoms

    def matrix(J, s):
        A = np.zeros((J.shape[0] + len(columns), F + 1))
        A[: J.shape[0], :F] = J
        A[J.shape[0] + np.arange(len(columns)), columns] = 1.0
        A[J.shape[0] :, F] = -path.slope(s) * path.end
        return A

    s, tangent = 0.0, np.eye(F + 1)[F]
    for _ in range(steps):
        A = matrix(Configuration(system, x[:, None]).J[:, :, 0], s)
        _, sigma, Vt = np.linalg.svd(A)
        null = Vt[(sigma > 1e-9 * sigma[0]).sum() :]
        tangent = null.T @ (null @ tangent)
        tangent /= np.linalg.norm(tangent)
        if tangent[F] <= 0:
            return True
        x = system.advance(x[:, None], (step * tangent[:F])[:, None])[:, 0]
        s += step * tangent[F] * path.end
        for _ in range(12):
            here = Configuration(system, x[:, None])
            r = np.concatenate([here.residual[:, 0], x[rows] - path.at(s)])
            if np.abs(r).max() < 1e-11:
                break
            A = np.vstack([matrix(here.J[:, :, 0], s), tangent])
            d = np.linalg.lstsq(A, np.concatenate([-r, [0.0]]), rcond=1e-9)[0]
            x = system.advance(x[:, None], d[:F, None])[:, 0]
            s += d[F] * path.end
        if s >= path.end:
            return False
    return True
