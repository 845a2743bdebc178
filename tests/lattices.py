"""Large mechanisms of mobility one with masses and gravity, for tests and benchmarks: about ``links`` links each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import mechgraph as mg

Z = (0.0, 0.0, 1.0)
GRAVITY = mg.Gravity((0.0, -9.81, 0.0))
BAR = 1.3
"""Mass of every bar."""


def _mechanism(
    name: str, bars: dict[str, tuple[np.ndarray, np.ndarray]], pairs: list[tuple[str, str, np.ndarray]], drive: str
) -> mg.Mechanism:
    """Bars by their ends, homogeneous and slender, and revolute pairs about z as (a, b, point)."""
    links = [mg.Link("frame")]
    for bar, (p, q) in bars.items():
        along = np.asarray(q, dtype=float) - p
        inertia = BAR / 12 * ((along @ along) * np.eye(3) - np.outer(along, along))
        links.append(mg.Link(bar, BAR, (np.asarray(p) + q) / 2, inertia))
    made = [mg.Pair(f"J{k}", "R", a, b, point=point, axis=Z) for k, (a, b, point) in enumerate(pairs)]
    return mg.Mechanism(name, links, made, [drive], [GRAVITY])


def _plane(*xy: float) -> np.ndarray:
    return np.array([*xy, 0.0])


def ladder(links: int, equal: bool = False) -> mg.Mechanism:
    """Four-bars side by side on the frame, the crank of one the rocker of the one before; ``equal``: parallelograms.

    The first crank is driven. Unequal cranks differ by up to a tenth, so that the motion of the last one stays like that of the first.
    """
    n = links // 2
    rng = np.random.default_rng(1)
    size = 0.0 if equal else 0.1 / n**0.5
    feet = [_plane(i + size * rng.uniform(-1, 1), size * rng.uniform(-1, 1)) for i in range(n + 1)]
    heads = [f + _plane(0.5 + size * rng.uniform(-1, 1), 1 + size * rng.uniform(-1, 1)) for f in feet]
    bars = {f"crank{i}": (feet[i], heads[i]) for i in range(n + 1)}
    bars |= {f"rod{i}": (heads[i], heads[i + 1]) for i in range(n)}
    pairs = [("frame", f"crank{i}", feet[i]) for i in range(n + 1)]
    for i in range(n):
        pairs += [(f"crank{i}", f"rod{i}", heads[i]), (f"rod{i}", f"crank{i + 1}", heads[i + 1])]
    return _mechanism(f"ladder of {n} four-bars", bars, pairs, "J0")


def parallelograms(links: int) -> mg.Mechanism:
    """A grid of parallelograms on the frame as its bottom bar, its left bar one long crank: mobility one. The crank is driven."""
    n = max(1, round((links / 2) ** 0.5))
    at = {(i, j): _plane(i + 0.3 * j, 0.9 * j) for i in range(n + 1) for j in range(n + 1)}
    bars = {"crank": (at[0, 0], at[0, n])}
    bars |= {f"h{i}_{j}": (at[i, j], at[i + 1, j]) for i in range(n) for j in range(1, n + 1)}
    bars |= {f"v{i}_{j}": (at[i, j], at[i, j + 1]) for i in range(1, n + 1) for j in range(n)}
    pairs = []
    for (i, j), point in at.items():
        level = ["frame"] if j == 0 else [f"h{i - 1}_{j}"] * (i > 0) + [f"h{i}_{j}"] * (i < n)
        upright = ["crank"] if i == 0 else [f"v{i}_{j - 1}"] * (j > 0) + [f"v{i}_{j}"] * (j < n)
        first, *others = [*level, *upright]
        pairs += [(first, other, point) for other in others]
    return _mechanism(f"{n} x {n} parallelograms", bars, pairs, "J0")


def scissors(links: int) -> mg.Mechanism:
    """A chain of scissors away from the frame: bars crossed in their middles, ends joined. The first crossing is driven."""
    n = max(2, links // 2)
    ends = [(_plane(i, 0.0), _plane(i, 0.8)) for i in range(n + 1)]
    bars, pairs = {}, []
    names = [("frame" if i == 0 else f"up{i}", f"down{i}") for i in range(n)]
    for i, (up, down) in enumerate(names):
        if i:
            bars[up] = (ends[i][0], ends[i + 1][1])
        bars[down] = (ends[i][1], ends[i + 1][0])
        pairs.append((up, down, _plane(i + 0.5, 0.4)))
        if i:
            pairs += [(names[i - 1][1], up, ends[i][0]), (names[i - 1][0], down, ends[i][1])]
    return _mechanism(f"chain of {n} scissors", bars, pairs, "J0")


def tree_of_loops(links: int) -> mg.Mechanism:
    """Four-bars that carry two more each on their couplers, and so on. The first crank is driven, and drives all others.

    A four-bar on a coupler has its first crank on that coupler; its crank is moved by a rod from the crank of the loop before.
    """
    n = max(1, links // 4)
    bars: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    pairs: list[tuple[str, str, np.ndarray]] = []

    def cell(
        k: int, base: str, foot: np.ndarray, size: float, turn: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A four-bar k on the link ``base``: corners crank foot, crank head, rocker head."""
        R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        corners = [foot + size * (R @ np.array(p)) for p in ((0, 0, 0), (0.2, 1, 0), (1.3, 1.1, 0), (1.1, 0.05, 0))]
        bars[f"crank{k}"] = (corners[0], corners[1])
        bars[f"coupler{k}"] = (corners[1], corners[2])
        bars[f"rocker{k}"] = (corners[3], corners[2])
        pairs.extend(
            [
                (base, f"crank{k}", corners[0]),
                (f"crank{k}", f"coupler{k}", corners[1]),
                (f"coupler{k}", f"rocker{k}", corners[2]),
                (base, f"rocker{k}", corners[3]),
            ]
        )
        return corners[0], corners[1], corners[2]

    placed = [(cell(0, "frame", _plane(0, 0), 1.0, 0.0), 1.0, 0.0)]
    for k in range(1, n):
        mother = (k - 1) // 2
        (foot, head, far), size, turn = placed[mother]
        side = 1 if k % 2 else -1
        less = max(0.8 * size, 0.05)
        start = (head + far) / 2 + 0.15 * side * (far - head)
        corners = cell(k, f"coupler{mother}", start, less, turn + 0.3 * side)
        placed.append((corners, less, turn + 0.3 * side))
        near, to = (foot + 2 * head) / 3, (corners[0] + corners[1]) / 2
        bars[f"rod{k}"] = (near, to)
        pairs += [(f"crank{mother}", f"rod{k}", near), (f"rod{k}", f"crank{k}", to)]
    return _mechanism(f"tree of {n} loops", bars, pairs, "J0")


def spatial_ladder(links: int) -> mg.Mechanism:
    """Spatial four-bars R-S-U-R side by side on the frame, no redundancy: every reaction is unique."""
    n = links // 2
    links_made = [mg.Link("frame")]
    pairs = [mg.Pair("J0", "R", "frame", "crank0", point=(0, 0, 0), axis=Z)]
    for i in range(n):
        head, far = np.array([i, 1.0, 0]), np.array([i + 1.0, 1.0, 0.3])
        pairs += [
            mg.Pair(f"S{i}", "S", f"crank{i}", f"rod{i}", point=head),
            mg.Pair(f"U{i}", "U", f"rod{i}", f"crank{i + 1}", point=far, axis=(0, 0.1, 1), second=(1, 0, 0)),
            mg.Pair(f"J{i + 1}", "R", "frame", f"crank{i + 1}", point=(i + 1, 0, 0), axis=Z),
        ]
        for name, middle in ((f"crank{i}", np.array([i, 0.5, 0])), (f"rod{i}", (head + far) / 2)):
            links_made.append(mg.Link(name, BAR, middle, 0.1 * np.eye(3)))
    links_made.append(mg.Link(f"crank{n}", BAR, (n, 0.5, 0), 0.1 * np.eye(3)))
    return mg.Mechanism(f"spatial ladder of {n} loops", links_made, pairs, ["J0"], [GRAVITY])


LATTICES: dict[str, Callable[[int], mg.Mechanism]] = {
    "ladder": lambda links: ladder(links, equal=True),
    "four-bars": ladder,
    "grid": parallelograms,
    "scissors": scissors,
    "tree": tree_of_loops,
    "spatial": spatial_ladder,
}
"""Generators by name; each takes the wanted number of links."""
