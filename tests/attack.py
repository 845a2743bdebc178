"""Generators of special mechanisms with their closed forms: gaps of the reach, near folds, change points, passive rods.

Everything comes from one numpy generator: a failing seed is a reproduction.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from mechanisms import Z
from strategies import body, closed_mechanism, rotation

import mechgraph as mg


def wrapped(angle):
    """Angles in [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True)
class Bars:
    """A planar four-bar with its crank tip turned by ``offset`` against the crank angle: crank a, coupler b, rocker c, frame g.

    ``side`` is the sign of the triangle (tip, rocker foot, head); the frame line is turned by ``offset`` as well, so that all bars with
    equal lengths are stretched at the crank angle pi.
    """

    a: float
    b: float
    c: float
    g: float
    side: float = 1.0
    offset: float = 0.0
    lean: float = 0.0
    """Turn of the frame line alone."""

    @property
    def foot(self):
        return self.g * np.array([np.cos(self.offset + self.lean), np.sin(self.offset + self.lean)])

    def tip(self, crank):
        t = np.asarray(crank) + self.offset
        return self.a * np.stack([np.cos(t), np.sin(t)])

    def head(self, crank):
        """The joint of coupler and rocker; NaN out of reach."""
        P = self.tip(crank)
        D = self.foot.reshape(2, *[1] * (P.ndim - 1))
        v = P - D
        d = np.sqrt((v * v).sum(axis=0))
        x = (self.c**2 - self.b**2 + d * d) / (2 * d)
        # (c - x)(c + x) by factors, so that near a stretched position nothing cancels
        y2 = (self.b + self.c - d) * (self.b + self.c + d) * (d + self.b - self.c) * (d - self.b + self.c) / (4 * d * d)
        with np.errstate(invalid="ignore"):
            y = self.side * np.sqrt(y2)
        u = v / d
        return D + x * u + y * np.stack([-u[1], u[0]])

    def rocker(self, crank):
        v = self.head(crank) - self.foot.reshape(2, *[1] * np.ndim(crank))
        return np.arctan2(v[1], v[0])

    def interval(self, start):
        """Crank angles reached from ``start`` without passing a limit."""
        a, g = self.a, self.g
        t = wrapped(start - self.lean)

        def angle(d):
            cosine = (a * a + g * g - d * d) / (2 * a * g)
            return float(np.arccos(cosine)) if -1 < cosine < 1 else None

        most, least = angle(self.b + self.c), angle(abs(self.b - self.c))
        if most is None and least is None:
            low, high = -np.inf, np.inf
        elif most is None:
            low, high = (least, 2 * np.pi - least) if t >= 0 else (least - 2 * np.pi, -least)
        elif least is None:
            low, high = -most, most
        else:
            low, high = (least, most) if t >= 0 else (-most, -least)
        return low - t + start, high - t + start


def four_bars(bars: Sequence[Bars], start: float, moved=None, drives=("A",), masses=None) -> mg.Mechanism:
    """Four-bars on one crank, declared closed at the crank angle ``start`` (the coordinate of A is 0 there)."""
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z)]
    bodies = [mg.Link("frame"), mg.Link("crank")]
    for i, bar in enumerate(bars):
        P, H, D = bar.tip(start), bar.head(start), bar.foot
        for name, a, b, at in (
            (f"B{i}", "crank", f"coupler{i}", P),
            (f"C{i}", f"coupler{i}", f"rocker{i}", H),
            (f"D{i}", "frame", f"rocker{i}", D),
        ):
            pairs.append(mg.Pair(name, "R", a, b, point=(*at, 0), axis=Z))
        bodies += [mg.Link(f"coupler{i}"), mg.Link(f"rocker{i}")]
    if masses is not None:
        bodies = [mg.Link("frame"), *(body(masses, k.name, masses.uniform(-1, 1, 3)) for k in bodies[1:])]
    m = mg.Mechanism(f"{len(bars)} four-bars", bodies, pairs, list(drives))
    return m if moved is None else m.moved(moved)


def just_out_of_reach(rng, gap=None, folded=False) -> Bars:
    """A four-bar whose stretched (or ``folded``) position is missed by a gap of crank angles ``gap`` (radians, whole width)."""
    while True:
        a, g = rng.uniform(0.2, 1.0), rng.uniform(1.05, 2.0)
        if rng.random() < 0.5:
            a, g = g, a
        gap = float(np.radians(10 ** rng.uniform(np.log10(0.03), np.log10(2.0)))) if gap is None else gap
        if folded:
            # |b - c| = distance at the crank angle gap / 2
            d = np.sqrt((a - g) ** 2 + 4 * a * g * np.sin(gap / 4) ** 2)
            c = rng.uniform(0.5, 1.5) * max(a, g)
            b = c + d
            if b + c < 1.05 * (a + g):
                continue
        else:
            d = np.sqrt((a + g) ** 2 - 4 * a * g * np.sin(gap / 4) ** 2)
            b = rng.uniform(0.3, 0.7) * d
            c = d - b
            if abs(b - c) > 0.8 * abs(g - a):
                continue
        if rng.random() < 0.5:
            b, c = c, b
        return Bars(a, b, c, g, float(rng.choice([-1, 1])))


def nearly_folded(rng, margin, offset=0.0, lean=0.0) -> Bars:
    """A crank-rocker or double crank whose stretched position is avoided: b + c = (a + g)(1 + margin)."""
    while True:
        a, g = rng.uniform(0.2, 1.0), rng.uniform(1.05, 2.0)
        if rng.random() < 0.5:
            a, g = g, a
        b = rng.uniform(0.3, 0.7) * (a + g)
        c = (a + g) * (1 + margin) - b
        if abs(b - c) < 0.8 * abs(g - a):
            return Bars(a, b, c, g, float(rng.choice([-1, 1])), offset, lean)


# --- integer and degenerate geometry ------------------------------------------------------------------------------------------

ANY_PAIR = ("R", "P", "H", "C", "U", "S", "E", "Sc", "Sg", "Cp", "Sp")
TURN_OR_SLIDE = ("R", "R", "P")


def integer_mechanism(seed) -> mg.Mechanism:
    """A mechanism of all pairs at points 0..3 along the axes x, y, z, with one to three loops, driven so that it moves.

    Half of them have as many freedoms as random loops need; the others are any graph, mostly of pairs that turn or slide.
    """
    rng = np.random.default_rng((seed, 24))
    if rng.random() < 0.5:
        m = closed_mechanism(seed, loops=int(rng.choice([1, 1, 2, 3])), mobility=1, branches=0)
        links, drawn = list(m.links), [(p.type.symbol, p.a, p.b) for p in m.pairs]
    else:
        loops = int(rng.choice([1, 1, 2, 3]))
        count = int(rng.integers(2, 4)) + 2 * loops
        links = [mg.Link("frame"), *(body(rng, f"b{k}", rng.uniform(-1, 1, 3)) for k in range(1, count))]
        ends = [(int(rng.integers(max(k - 2, 0), k)), k) for k in range(1, count)]
        ends += [tuple(rng.choice(count, 2, replace=False).tolist()) for _ in range(loops)]
        symbols = rng.choice(ANY_PAIR if rng.random() < 0.5 else TURN_OR_SLIDE, len(ends))
        drawn = [(str(symbol), links[a].name, links[b].name) for symbol, (a, b) in zip(symbols, ends, strict=True)]
    pairs, row = [], mg.pair_types()
    for k, (symbol, a, b) in enumerate(drawn, 1):
        axis, second = np.eye(3)[rng.choice(3, 2, replace=False)]
        more = {"axis": axis} if symbol != "S" else {}
        more |= {"second": second} if row[symbol].square_second else {}
        more |= {"pitch": 0.5} if row[symbol].takes_pitch else {}
        pairs.append(mg.Pair(f"J{k}", symbol, a, b, point=rng.integers(0, 4, 3).astype(float), **more))
    m = mg.Mechanism(f"integer {seed}", links, pairs, loads=[mg.Gravity((0, 0, -9.81))])
    return m.replace(drives=mg.check(m).suggested_drives)


def anywhere(rng):
    X = np.eye(4)
    X[:3, :3] = rotation(rng)
    X[:3, 3] = rng.normal(size=3)
    return X


# --- comparing solutions ----------------------------------------------------------------------------------------------------

PAIR = ("position", "velocity", "acceleration", "reaction", "total", "effort", "applied_effort", "force", "moment")
LINK = ("pose", "twist", "acceleration")
MOTION = ("position", "velocity", "acceleration", "pose", "twist")


def everything(s, forces=True):
    """Everything that a solution says, by name, batch first."""
    out = {}
    for p in s.mechanism.pairs:
        r = s[p.name]
        for name in PAIR if forces else PAIR[:3]:
            out[p.name, name] = getattr(r, name)
        if forces:
            out |= {(p.name, f"component {name}"): value for name, value in r.components.items()}
    for k in s.mechanism.links:
        r = s.link(k.name)
        out |= {(k.name, name): getattr(r, name) for name in LINK}
    if forces:
        for c in s.mechanism.couplings:
            out[c.name, "multiplier"] = s.coupling(c.name).effort
        out["", "shaking"] = s.shaking
        out |= {("passive", name): value for name, value in s.passive_effort.items()}
    return out


def solved(m, given, forces=True, **how):
    """A solution of all positions, or the error that stands for it."""
    call = mg.solve if forces else mg.kinematics
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return call(m, given, on_reach="flag", **how)
        except mg.MechgraphError as error:
            return error


def warned(m, given, **how):
    """The texts of the warnings of a call, numbers left out (they are compared as values)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mg.solve(m, given, on_reach="flag", **how)
    return [(w.category.__name__, without_numbers(w.message)) for w in caught]


def without_numbers(text):
    """A text with its numbers left out."""
    return re.sub(r"[-+]?\d+\.?\d*(e[-+]?\d+)?", "#", str(text))


def differences(a, b, forces=True, pick=None):
    """Worst difference against the largest value of its kind, and what differs: statuses, NaN masks, values ``(name, size)``.

    ``pick``: positions of ``a`` (its last batch axis) at which ``b`` was solved. Forces are measured by the largest force or moment.
    """
    first, second = everything(a, forces), everything(b, forces)
    status = a.status if pick is None else a.status[..., pick]
    faults = []
    if (status != b.status).any():
        at = np.flatnonzero(np.ravel(status != b.status))
        faults.append(f"status {np.ravel(status)[at[:3]]} / {np.ravel(b.status)[at[:3]]} at {at[:5]}")
    if first.keys() != second.keys():
        faults.append(f"names {first.keys() ^ second.keys()}")
    both = (status == "ok") & (b.status == "ok")
    worst, where = 0.0, None
    kinds = {}
    for key, x in first.items():
        kind = key[1] if key[1] in (*PAIR[:3], *LINK) else "force"
        kinds[kind] = max(kinds.get(kind, 1e-12), float(np.nan_to_num(np.abs(x)).max(initial=0.0)))
    for key in first.keys() & second.keys():
        x = first[key] if pick is None else np.take(first[key], pick, axis=np.ndim(a.status) - 1)
        x, y = x[both], second[key][both]
        if (np.isnan(x) != np.isnan(y)).any():
            faults.append(f"NaN {key}")
            continue
        kind = key[1] if key[1] in (*PAIR[:3], *LINK) else "force"
        size = max(kinds[kind], 1.0) if kind in MOTION else kinds[kind]
        gap = float(np.nan_to_num(np.abs(x - y)).max(initial=0.0)) / size
        if gap > worst:
            worst, where = gap, key
    return worst, where, faults


def conditions(s):
    """Largest rate of any freedom for the drivers' unit rates: what multiplies rounding near a singular position, ``(T,)``."""
    size = [np.abs(s[p.name].velocity).max(axis=-1, initial=0.0) for p in s.mechanism.pairs]
    return np.nan_to_num(np.max(size, axis=0), nan=np.inf)


# --- passive bodies ---------------------------------------------------------------------------------------------------------


def carried(m, drive, link, axis, begin, end, engine="dense", nodes=120):
    """The rotation of a passive body at ``end`` from its axis alone: ``R' = (u x u') ~ R`` along the path, and the axis series' tail.

    ``axis`` is fixed in the body. Its directions come from solved positions, each of which knows it whatever the spin; between them a
    Chebyshev series, so that the integration has nothing in common with the engine's.
    """
    t = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    q = begin + (end - begin) * 0.5 * (t + 1)
    R = mg.kinematics(m, {drive: q}, engine=engine).link(link).pose[:, :3, :3]
    u = R @ axis
    c = np.polynomial.chebyshev.chebfit(t, u, nodes - 1)
    dc = np.polynomial.chebyshev.chebder(c)

    def rate(s, y):
        a = np.polynomial.chebyshev.chebval(s, c)
        b = np.polynomial.chebyshev.chebval(s, dc)
        w = np.cross(a, b) / (a @ a)
        return np.cross(w, y.reshape(3, 3).T).T.ravel()

    first = mg.kinematics(m, {drive: np.array([begin])}, engine=engine).link(link).pose[0, :3, :3]
    found = scipy.integrate.solve_ivp(rate, (-1, 1), first.ravel(), method="DOP853", rtol=1e-13, atol=1e-14)
    return found.y[:, -1].reshape(3, 3), float(np.abs(c[-3:]).max())
