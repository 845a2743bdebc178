"""Machines as a designer would model them: an excavator, a five-rod suspension, a double Cardan shaft."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from strategies import body, placed

import mechgraph as mg

Y = (0, 1, 0)
Z = (0.0, 0.0, 1.0)
CONTACTS = {"rod": 1, "Sp": 1, "Sg": 2, "S": 3}


def cylinder(name: str, a: str, b: str, p: ArrayLike, q: ArrayLike, types: str) -> list[mg.Pair]:
    """A hydraulic cylinder from a point on link a to one on link b; ``types`` of foot, piston and head."""
    foot, head = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    barrel, rod = f"{name}-barrel", f"{name}-rod"
    return [
        mg.Pair(f"{name}-foot", types[0], a, barrel, point=foot, axis=Y),
        mg.Pair(name, types[1], barrel, rod, point=(foot + head) / 2, axis=head - foot),
        mg.Pair(f"{name}-head", types[2], rod, b, point=head, axis=Y),
    ]


def excavator(types: str = "RPR") -> mg.Mechanism:
    """Boom, stick and bucket with three cylinders, the bucket through a lever and a tie: four loops in one plane."""
    pins = (
        ("A", "frame", "boom", (0, 0, 0)), ("B", "boom", "stick", (5, 0, 3)), ("C", "stick", "bucket", (7, 0, 0.5)),
        ("K", "stick", "lever", (6.7, 0, 1.2)), ("L", "lever", "tie", (7.3, 0, 1.3)), ("M", "tie", "bucket", (7.5, 0, 0.6)),
    )  # fmt: skip
    pairs = [mg.Pair(name, "R", a, b, point=point, axis=Y) for name, a, b, point in pins]
    pairs += cylinder("boomcyl", "frame", "boom", (1, 0, -0.5), (2.6, 0, 2.2), types)
    pairs += cylinder("stickcyl", "boom", "stick", (2.5, 0, 3.0), (4.6, 0, 3.7), types)
    pairs += cylinder("bucketcyl", "stick", "lever", (5.2, 0, 3.2), (7.2, 0, 1.5), types)
    return mg.Mechanism("excavator", None, pairs, ["boomcyl.Tz", "stickcyl.Tz", "bucketcyl.Tz"])


def five_rods() -> mg.Mechanism:
    """A wheel carrier on five rods between ball joints, lifted by the road: a plate that rises, a ball on a plane."""
    inner = [(0.1, 0.3, 0.1), (-0.1, 0.32, 0.12), (0.15, 0.25, -0.1), (-0.15, 0.27, -0.12), (0.2, 0.3, 0)]
    outer = [(0.03, 0.7, 0.15), (-0.03, 0.69, 0.14), (0.05, 0.72, -0.12), (-0.06, 0.71, -0.13), (0.14, 0.68, 0.01)]
    pairs = []
    for i, (p, q) in enumerate(zip(inner, outer, strict=True), 1):
        pairs.append(mg.Pair(f"I{i}", "S", "frame", f"rod{i}", point=p))
        pairs.append(mg.Pair(f"O{i}", "S", f"rod{i}", "carrier", point=q))
    pairs.append(mg.Pair("tyre", "Sp", "plate", "carrier", point=(0, 0.75, -0.3), axis=(0, 0, 1)))
    pairs.append(mg.Pair("road", "P", "frame", "plate", point=(0, 0.75, -0.3), axis=(0, 0, 1)))
    return mg.Mechanism("five-rod suspension", None, pairs, ["road"])


def double_cardan() -> mg.Mechanism:
    """Two parallel shafts joined by a shaft between universal joints, all bearings locating."""
    a, p = np.array((1.0, 0, 0)), np.array((1.0, 0, 0))
    d = np.array((1, 0.4, 0.1)) / np.linalg.norm((1, 0.4, 0.1))
    n, q = np.cross(a, d), p + 2 * d
    pairs = [
        mg.Pair("in", "R", "frame", "input", point=(0, 0, 0), axis=a),
        mg.Pair("U1", "U", "input", "shaft", point=p, axis=n, second=np.cross(n, d)),
        mg.Pair("U2", "U", "shaft", "output", point=q, axis=n, second=np.cross(n, a)),
        mg.Pair("out", "R", "output", "frame", point=q + a, axis=a),
    ]
    return mg.Mechanism("double Cardan", None, pairs, ["in"])


def sliders() -> mg.Mechanism:
    """A platform on six rods from sliders."""
    pairs = []
    for k in range(6):
        a, side = np.pi / 3 * k, (-1) ** k
        foot = np.array([2 * np.cos(a + 0.25 * side), 2 * np.sin(a + 0.25 * side), 0.0])
        head = np.array([np.cos(a + 0.35 - 0.3 * side), np.sin(a + 0.35 - 0.3 * side), 1.7 + 0.1 * np.sin(2 * k)])
        pairs.append(mg.Pair(f"P{k}", "P", "frame", f"slide{k}", point=foot, axis=Z))
        pairs.append(mg.Pair(f"A{k}", "S", f"slide{k}", f"rod{k}", point=foot))
        pairs.append(mg.Pair(f"B{k}", "S", f"rod{k}", "platform", point=head))
    return mg.Mechanism("6-PSS", None, pairs, [f"P{k}" for k in range(6)])


def random_platforms(seed: int) -> mg.Mechanism:
    """Bodies one above the other, each held by rods and spheres that leave it no freedom, on the frame, a crank and bodies below."""
    rng = np.random.default_rng(seed)
    pairs = [mg.Pair("A", "R", "frame", "crank", point=rng.normal(size=3), axis=rng.normal(size=3))]
    below, links = ["frame", "crank"], []
    for i in range(1 + seed % 2):
        kinds = ["rod", *rng.permutation(["Sp", "rod", ("Sg", "Sp")[seed % 2], ("rod", "S")[seed % 3 == 0]]).tolist()]
        while (left := 6 - sum(CONTACTS[kind] for kind in kinds)) < 0:
            kinds.pop()
        for n, kind in enumerate([*kinds, *["rod"] * left]):
            on, name, k = below[-1] if not n else str(rng.choice(below)), f"platform{i}", len(pairs)
            at, foot = rng.uniform(-1, 1, (2, 3))
            if kind == "rod":
                pairs.append(
                    mg.Pair(f"J{k}", "S", *rng.permutation([on, f"rod{k}"]).tolist(), point=foot - 2 * np.array(Z))
                )
                pairs.append(mg.Pair(f"K{k}", "S", *rng.permutation([name, f"rod{k}"]).tolist(), point=at))
                links.append(body(rng, f"rod{k}", 0.5 * (at + foot)))
            else:
                pairs.append(placed(rng, f"J{k}", kind, *rng.permutation([on, name]).tolist(), at))
        below.append(f"platform{i}")
    links = [mg.Link("frame"), *links, *(body(rng, name, rng.uniform(-1, 1, 3)) for name in below[1:])]
    return mg.Mechanism(f"platforms {seed}", links, pairs, ["A"], [mg.Gravity(rng.normal(size=3))])


def sine(m, freedom, size, n=19):
    """A motion about the start."""
    t = np.linspace(0, 2 * np.pi, n)
    begin = m.start.get(m.full_name(freedom), 0.0)
    return mg.Motion(begin + size * np.sin(t), size * np.cos(t), -size * np.sin(t))
