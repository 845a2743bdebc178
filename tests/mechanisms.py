"""Builders of known mechanisms, as tests need them: small, massless, declared as assembled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.optimize

import mechgraph as mg

X, Y, Z = np.eye(3)
Vector = Sequence[float] | np.ndarray


def ring(
    types: str | Sequence[str], points: Sequence[Vector], axes: Sequence[Vector | None], **more: object
) -> mg.Mechanism:
    """One loop: links ``frame, link1, ...``, pairs ``O1, O2, ...``; a helical pair takes the pitch 0.1 unless ``pitch`` says."""
    n = len(points)
    names = ["frame", *(f"link{k}" for k in range(1, n))]
    pitch = more.pop("pitch", 0.1)
    drives = more.pop("drives", ["O1"])
    name = str(more.pop("name", "-".join(types)))
    pairs = [
        mg.Pair(
            f"O{k + 1}",
            kind,
            names[k],
            names[(k + 1) % n],
            point=point,
            axis=axis,
            pitch=pitch if kind == "H" else None,
        )
        for k, (kind, point, axis) in enumerate(zip(types, points, axes, strict=True))
    ]
    return mg.Mechanism(name, None, pairs, drives)


# --- single loops of revolute pairs ------------------------------------------------------------------------------------


def isogram(p: float, q: float, h: float, psi: float) -> np.ndarray:
    """Corners of a skew quadrilateral with equal opposite sides: half diagonals ``p, q`` at angle ``psi``, ``2 h`` apart."""
    u, v = q * np.cos(psi), q * np.sin(psi)
    return np.array([[-p, 0, -h], [u, v, h], [p, 0, -h], [-u, -v, h]])


def corner_axes(corners: np.ndarray) -> np.ndarray:
    """Unit normals of both sides at every corner: with them an isogram is a Bennett mechanism."""
    after, before = np.roll(corners, -1, axis=0) - corners, np.roll(corners, 1, axis=0) - corners
    n = np.cross(after, before)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def bennett() -> mg.Mechanism:
    """G. T. Bennett, A new mechanism, Engineering 76, 1903: 4R, a / sin(alpha) = b / sin(beta), no offsets."""
    corners = isogram(1.0, 0.8, 0.3, 1.1)
    return ring("RRRR", corners, corner_axes(corners), name="Bennett")


def _last_side(corners: np.ndarray) -> tuple[float, float]:
    """Length of the side from corner 4 to corner 1 and cosine of its twist."""
    axes = corner_axes(corners)
    return float(np.linalg.norm(corners[0] - corners[3])), float(axes[0] @ axes[3])


def _placed(corners: np.ndarray, onto: np.ndarray, flip: bool) -> np.ndarray:
    """Corners moved so that corners 4 and 1, and the axes there, lie on those of ``onto``, the rest on the other side."""

    def frame(c: np.ndarray, sign: float) -> np.ndarray:
        x = (c[0] - c[3]) / np.linalg.norm(c[0] - c[3])
        z = sign * corner_axes(c)[3]
        return np.column_stack([x, np.cross(z, x), z])

    R = frame(onto, 1.0) @ frame(corners, -1.0 if flip else 1.0).T
    return (corners - corners[3]) @ R.T + onto[3]


def two_bennetts(corners: np.ndarray, other: np.ndarray, name: str) -> mg.Mechanism:
    """Two Bennett mechanisms on a common link 4-1, made one link at corner 1, the common link left out: five axes."""
    a, b = corner_axes(corners), corner_axes(other)
    points = [corners[1], corners[2], corners[3], other[2], other[1]]
    return ring("RRRRR", points, [a[1], a[2], a[3], b[2], b[1]], name=name)


def goldberg() -> mg.Mechanism:
    """M. Goldberg, New five-bar and six-bar linkages in three dimensions, Trans. ASME 65, 1943: two Bennett mechanisms summed."""
    one = isogram(1.0, 0.8, 0.3, 1.1)
    length, cosine = _last_side(one)

    def miss(x: np.ndarray) -> list[float]:
        found = _last_side(isogram(0.7, x[0], x[1], 1.3))
        return [found[0] - length, found[1] - cosine]

    x = scipy.optimize.fsolve(miss, [0.9, 0.35], xtol=1e-13)
    two = isogram(0.7, x[0], x[1], 1.3)
    assert np.abs(miss(x)).max() < 1e-12
    for flip in (True, False):
        placed = _placed(two, one, flip)
        if abs(abs(corner_axes(placed)[0] @ corner_axes(one)[0]) - 1) < 1e-9:
            return two_bennetts(one, placed, "Goldberg 5R")
    raise AssertionError("the common links do not fit")


def myard() -> mg.Mechanism:
    """F. E. Myard, Contribution a la geometrie des systemes articules, Bull. Soc. Math. France 59, 1931: a Bennett mechanism and its
    mirror image, twist of a right angle on the common link."""
    x = scipy.optimize.brentq(lambda h: _last_side(isogram(1.0, 0.8, h, 2.2))[1], 0.05, 20.0, xtol=1e-13)
    one = isogram(1.0, 0.8, float(x), 2.2)
    normal = corner_axes(one)[0]
    mirrored = one - 2 * np.outer((one - one[0]) @ normal, normal)
    return two_bennetts(one, mirrored, "Myard 5R")


def bricard_line_symmetric() -> mg.Mechanism:
    """R. Bricard, Lecons de cinematique II, 1927: 6R with axes symmetrical in pairs about a line."""
    points = np.array([[1.0, 0.2, -0.3], [0.4, 1.1, 0.2], [-0.5, 0.9, 0.6]])
    axes = np.array([[0.3, 1.0, 0.4], [1.0, -0.2, 0.5], [0.2, 0.7, -1.0]])
    half_turn = np.array([-1.0, -1.0, 1.0])
    return ring("RRRRRR", [*points, *points * half_turn], [*axes, *axes * half_turn], name="Bricard, line-symmetric")


def bricard_cube() -> mg.Mechanism:
    """IFToMM library of computational benchmark problems, Bricard mechanism: one freedom, one redundant constraint."""
    points = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    return ring("RRRRRR", points, [Y, Z, X, Y, Z, X], name="Bricard, cube edges")


def bricard_trihedral() -> mg.Mechanism:
    """R. Bricard, Lecons de cinematique II, 1927: twists of a right angle and ``a1^2 + a3^2 + a5^2 = a2^2 + a4^2 + a6^2``."""
    right = np.pi / 2
    lengths = [1.0, 1.1, 0.9, 1.2, 1.15, float(np.sqrt(1.0 + 0.81 + 1.15**2 - 1.21 - 1.44))]
    start = {f"O{k + 1}": v for k, v in enumerate([2.1, -2.1, 2.1, -2.1, 2.1, -2.1])}
    m = mg.chain("RRRRRR", twist=[right, -right] * 3, length=lengths, start=start, name="Bricard, trihedral")
    return mg.assemble(m, {})


def sarrus() -> mg.Mechanism:
    """P. F. Sarrus, Comptes rendus 36, 1853: two sets of three parallel axes guide a plate along a straight line."""
    points = [(0, 1, 0), (0, 1.6, 0.8), (0, 1, 1.6), (1, 0, 1.6), (1.7, 0, 0.8), (1, 0, 0)]
    return ring("RRRRRR", points, [X, X, X, Y, Y, Y], name="Sarrus")


def spherical() -> mg.Mechanism:
    """C. H. Chiang, Kinematics of Spherical Mechanisms, 1988: four axes through one point."""
    axes = np.array([[0, 0, 1.0], [0.6, 0.1, 1.0], [0.9, 0.8, 0.7], [-0.3, 1.0, 0.6]])
    return ring("RRRR", axes * 1.2, axes, name="spherical four-bar")


def planar() -> mg.Mechanism:
    """A planar four-bar as a spatial mechanism: Hunt, Kinematic Geometry of Mechanisms, 1978, section 2.6 (fourth special 3-system)."""
    return ring("RRRR", [(0, 0, 0), (0.2, 1, 0), (2.2, 1.6, 0), (2, 0, 0)], [Z] * 4, name="planar four-bar")


def folded_bars() -> mg.Mechanism:
    """A. E. H. Love, Treatise on the Mathematical Theory of Elasticity (critical forms).

    Two bars in one line between fixed pins: no finite motion, one instantaneous.
    """
    return ring("RRR", [(0, 0, 0), (1, 0, 0), (2.3, 0, 0)], [Z] * 3, name="two bars in one line")


# --- cranks side by side ------------------------------------------------------------------------------------------------


def cranks(feet: Sequence[Vector], heads: Sequence[Vector], name: str) -> mg.Mechanism:
    """A coupler on cranks from ``feet`` to ``heads``, all axes along z."""
    pairs = []
    for k, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        pairs.append(mg.Pair(f"A{k + 1}", "R", "frame", f"crank{k + 1}", point=foot, axis=Z))
        pairs.append(mg.Pair(f"B{k + 1}", "R", f"crank{k + 1}", "coupler", point=head, axis=Z))
    return mg.Mechanism(name, None, pairs, ["A1"])


def three_cranks(detuned: float = 0.0) -> mg.Mechanism:
    """Wojtyra, Joint reaction forces in multibody systems with redundant constraints, Multibody System Dynamics 14, 2005.

    Parallelogram with three cranks; the head of the third is moved aside by ``detuned``.
    """
    feet = [(0, 0, 0), (1, 0, 0), (2.2, 0, 0)]
    heads = [(0.3, 1, 0), (1.3, 1, 0), (2.5 + detuned, 1, 0)]
    return cranks(feet, heads, "three cranks")


def concurrent_cranks() -> mg.Mechanism:
    """W. Wunderlich, Zur Geometrie wackeliger Strukturen, 1971: cranks whose lines meet in one point; infinitesimal mobility only."""
    meet = np.array([0.4, 3.0, 0])
    feet = [np.array(p, dtype=float) for p in ((0, 0, 0), (1, 0.2, 0), (2.2, -0.1, 0))]
    parts = (0.3, 0.45, 0.2)
    return cranks(feet, [f + s * (meet - f) for f, s in zip(feet, parts, strict=True)], "concurrent cranks")


# --- spatial mechanisms -------------------------------------------------------------------------------------------------


def rsur() -> mg.Mechanism:
    """Hartenberg and Denavit, Kinematic Synthesis of Linkages, 1964, chapter 12: the universal pair takes the spin of an RSSR coupler."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "coupler", point=(0.3, 0, 0.1)),
        mg.Pair("C", "U", "coupler", "rocker", point=(1.5, 0.6, 0.4), axis=(0.2, 0.1, 1.0), second=(1.0, 0, -0.2)),
        mg.Pair("D", "R", "rocker", "frame", point=(1.3, -0.2, 0.5), axis=(-1, 2, 1)),
    ]
    return mg.Mechanism("RSUR", None, pairs, ["A"])


def rssr_sc() -> mg.Mechanism:
    """Sandor and Erdman, Advanced Mechanism Design 2, 1984, chapter 6: RSSR with an S-C dyad on the coupler; two loops, mobility 1."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "coupler", point=(0.3, 0, 0.1)),
        mg.Pair("C", "S", "coupler", "rocker", point=(1.5, 0.6, 0.4)),
        mg.Pair("D", "R", "rocker", "frame", point=(1.3, -0.2, 0.5), axis=(-1, 2, 1)),
        mg.Pair("E", "S", "coupler", "follower", point=(0.9, 0.7, 0.9)),
        mg.Pair("F", "C", "follower", "frame", point=(0.7, 1.4, 0.5), axis=(1, 0.3, 0.8)),
    ]
    return mg.Mechanism("RSSR-SC", None, pairs, ["A"])


def rccc() -> mg.Mechanism:
    """A. T. Yang and F. Freudenstein, J. Appl. Mech. 31, 1964: spatial four-bar RCCC, mobility 1."""
    points = [(0, 0, 0), (0.5, 0.1, 0.2), (1.6, 0.8, 0.4), (1.2, -0.6, 0.1)]
    axes = [Z, (0.4, -0.3, 1.0), (1.0, 0.5, 0.6), (-0.3, 1.0, 0.5)]
    return ring("RCCC", points, axes, name="RCCC")


def door(first: str = "R", second: str = "R") -> mg.Mechanism:
    """L. Reshetov, Self-Aligning Mechanisms, 1982: a door on two hinges is over by five; ball and groove by none."""
    pairs = [
        mg.Pair("A", first, "frame", "door", point=(0, 0, 0.2), axis=Z, second=X),
        mg.Pair("B", second, "frame", "door", point=(0, 0, 1.8), axis=Z, second=X),
    ]
    return mg.Mechanism(f"door on {first} and {second}", None, pairs, ["A"] if first == "R" else [])


def pphchp(third: Vector, fourth: Vector, fifth: Vector) -> mg.Mechanism:
    """I.-P. J. Lee, thesis, Oklahoma State University, 1977, section 3.12, with given directions of H3, C4, H5."""
    points = [(0, 0, 0), (0.4, 0.1, 0.3), (0.9, 0.7, 0.2), (1.1, 0.2, 0.9), (0.6, -0.5, 0.8), (0.1, -0.4, 0.3)]
    axes = [(1, 0.2, 0.1), (0.3, 1, -0.2), third, fourth, fifth, (0.2, 0.5, 1)]
    return ring("PPHCHP", points, axes, name="PPHCHP")


def prprrh_special() -> mg.Mechanism:
    """I.-P. J. Lee, thesis, 1977, section 3.10, figure 26, with R2 parallel to R4 and R5 parallel to H6."""
    points = [(0, 0, 0), (0.4, 0.1, 0.3), (0.9, 0.7, 0.2), (1.1, 0.2, 0.9), (0.6, -0.5, 0.8), (0.1, -0.4, 0.3)]
    axes = [(1, 0.2, 0.1), (0.3, 1, -0.2), (0.1, 0.4, 1), (0.3, 1, -0.2), (1, 0.5, 0.7), (1, 0.5, 0.7)]
    return ring("PRPRRH", points, axes, name="PRPRRH, two pairs of parallel axes")


# --- platforms ----------------------------------------------------------------------------------------------------------


def platform(legs: Sequence[tuple[Vector, Vector, Vector]], types: str, driven: bool = True) -> mg.Mechanism:
    """A platform on legs of three pairs (first at the frame, P in the middle) from foot to head; the third entry is the x of U."""
    pairs = []
    for k, (foot, head, second) in enumerate(legs, 1):
        along = np.asarray(head) - np.asarray(foot)
        where = {
            1: (foot, f"rod{k}", "frame"),
            3: (head, f"tube{k}", "platform"),
        }
        for j, kind in ((1, types[0]), (2, types[1]), (3, types[2])):
            if j == 2:
                pairs.append(
                    mg.Pair(f"P{k}", kind, f"rod{k}", f"tube{k}", point=(np.asarray(foot) + head) / 2, axis=along)
                )
                continue
            point, link, ground = where[j]
            axis, x = (np.asarray(second), np.cross(along, second)) if kind == "U" else (Z, X)
            pairs.append(mg.Pair(f"{'AB'[j // 3]}{k}", kind, ground, link, point=point, axis=axis, second=x))
    links = ["frame", "platform", *(f"{part}{k}" for k in range(1, len(legs) + 1) for part in ("rod", "tube"))]
    return mg.Mechanism(
        f"{len(legs)}-{types}",
        [mg.Link(n) for n in links],
        pairs,
        [f"P{k}" for k in range(1, len(legs) + 1)] if driven else [],
    )


def hexapod(types: str = "UPS", driven: bool = True) -> mg.Mechanism:
    """V. E. Gough, 1957, and D. Stewart, A platform with six degrees of freedom, Proc. Inst. Mech. Eng. 180, 1965."""
    legs = []
    for k in range(6):
        angle = np.pi / 3 * k
        foot = 2.0 * np.array([np.cos(angle + 0.25 * (-1) ** k), np.sin(angle + 0.25 * (-1) ** k), 0.0])
        turn = angle + 0.35 - 0.3 * (-1) ** k
        head = np.array([np.cos(turn) + 0.1, np.sin(turn) - 0.05, 1.7 + 0.1 * np.sin(2 * k)])
        legs.append((foot, head, np.cross(head - foot, Z)))
    return platform(legs, types, driven)


def three_upu() -> mg.Mechanism:
    """L.-W. Tsai, Kinematics of a three-dof platform with three extensible limbs, 1996.

    Translations only: the outer axes of every leg are parallel, so are the inner ones.
    """
    legs = []
    for k in range(3):
        angle = 2 * np.pi / 3 * k
        foot = 1.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
        head = 0.6 * np.array([np.cos(angle + 0.2), np.sin(angle + 0.2), 0.0]) + (0.1, 0.05, 1.4)
        legs.append((foot, head, np.array([-np.sin(angle), np.cos(angle), 0.15 * k])))
    return platform(legs, "UPU")


# --- large ones -----------------------------------------------------------------------------------------------------------


def windows(n: int, general: bool = True) -> mg.Mechanism:
    """IFToMM library of computational benchmark problems, "N four-bars": cranks side by side, their tips joined by couplers.

    ``general``: with lengths all different, otherwise parallelograms.
    """
    rng = np.random.default_rng(1)
    size = 0.1 if general else 0.0
    feet = np.column_stack(
        [np.arange(n + 1.0) + size * rng.normal(size=n + 1), size * rng.normal(size=n + 1), np.zeros(n + 1)]
    )
    heads = feet + np.column_stack(
        [0.3 + size * rng.normal(size=n + 1), 1 + size * rng.normal(size=n + 1), np.zeros(n + 1)]
    )
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"crank{i}", point=feet[i], axis=Z) for i in range(n + 1)]
    for i in range(n):
        pairs.append(mg.Pair(f"B{i}", "R", f"crank{i}", f"rod{i}", point=heads[i], axis=Z))
        pairs.append(mg.Pair(f"C{i}", "R", f"rod{i}", f"crank{i + 1}", point=heads[i + 1], axis=Z))
    return mg.Mechanism(f"{n} windows", None, pairs, ["A0"])


def grid(n: int) -> mg.Mechanism:
    """Bars on a lattice of ``n x n`` parallelograms, pinned at the nodes; one bar is the frame. Mobility ``2 n - 1``."""
    pairs = []
    for i in range(n + 1):
        for j in range(n + 1):
            bars = (
                [f"h{i - 1}_{j}"] * (i > 0)
                + [f"h{i}_{j}"] * (i < n)
                + [f"v{i}_{j - 1}"] * (j > 0)
                + [f"v{i}_{j}"] * (j < n)
            )
            point = (i + 0.3 * j, 0.9 * j, 0.0)
            pairs += [mg.Pair(f"N{i}_{j}{b}", "R", bars[0], b, point=point, axis=Z) for b in bars[1:]]
    return mg.Mechanism(f"{n} x {n} parallelograms", None, pairs)


def unclosable_four_bar() -> mg.Mechanism:
    """A planar four-bar whose crank, coupler and rocker together do not span its frame: 1 + 1 + 1 < 5."""
    z = (0, 0, 1)
    lengths = {"crank": 1.0, "coupler": 1.0}
    ends = {name: mg.Marker((length, 0, 0), z) for name, length in lengths.items()}
    base = mg.Marker((0, 0, 0), z)
    return mg.Mechanism("unclosable", pairs=[
        mg.Pair("A", "R", "frame", "crank", on_a=base, on_b=base),
        mg.Pair("B", "R", "crank", "coupler", on_a=ends["crank"], on_b=base),
        mg.Pair("C", "R", "coupler", "rocker", on_a=ends["coupler"], on_b=mg.Marker((1, 0, 0), z)),
        mg.Pair("D", "R", "frame", "rocker", on_a=mg.Marker((5, 0, 0), z), on_b=base),
    ], drives=["A"])  # fmt: skip


def linked_four_bar(crank: float, coupler: float, rocker: float, ground: float, angle: float) -> mg.Mechanism:
    """A planar four-bar declared link by link, the crank along x at zero."""
    lengths = (crank, coupler, rocker, ground)
    names = ("ground", "crank", "coupler", "rocker")
    ends = list(zip(names, names[1:] + names[:1], (ground, *lengths[:3]), strict=True))
    pairs = [
        mg.Pair(f"O{i}", "R", a, b, on_a=mg.Marker((L if i else 0.0, 0, 0), Z), on_b=mg.Marker((0, 0, 0), Z))
        for i, (a, b, L) in enumerate(ends)
    ]
    # the last pair closes on the ground at its other end
    last = pairs[3]
    pairs[3] = mg.Pair("O3", "R", last.a, last.b, on_a=last.on_a, on_b=mg.Marker((ground, 0, 0), Z))
    return mg.Mechanism("four-bar", pairs=pairs, drives=["O0"], frame="ground", start={"O0": angle, "O1": -1.0})


class FourBarFormula:
    """A random ``linked_four_bar``, often near a change point, by closed forms: two circles meet on either side of their centers' line."""

    def __init__(self, rng: np.random.Generator) -> None:
        a, b, c, d = rng.uniform(0.3, 1.5, 4)
        if rng.random() < 0.4:
            near = np.array([b + c - a, a + b - c, a + c - b])[rng.integers(3)]
            d = max(0.1, near + rng.normal() * 10 ** rng.uniform(-4, -2))
        self.lengths = a, b, c, d
        cosines = np.array([(a * a + d * d - reach * reach) / (2 * a * d) for reach in (b + c, b - c)])
        folds = np.arccos(cosines[np.abs(cosines) < 1])
        self.folds = np.concatenate([folds, -folds])
        self.rng = rng

    def joint(self, angle: float, side: int) -> tuple[complex, complex]:
        """Where crank and coupler, coupler and rocker meet; the first fixed pivot at 0."""
        a, b, c, d = self.lengths
        tip = a * np.exp(1j * angle)
        reach = d - tip
        along = (b * b - c * c + abs(reach) ** 2) / (2 * abs(reach))
        return tip, tip + reach / abs(reach) * (along + 1j * side * np.sqrt(b * b - along * along))

    def start(self, angle: float, side: int) -> dict[str, float]:
        """Coordinates of all freedoms."""
        tip, joint = self.joint(angle, side)
        alpha, beta = np.angle(joint - tip), np.angle(joint - self.lengths[3]) + np.pi
        return dict(zip(("O0", "O1", "O2", "O3"), (angle, alpha - angle, beta - alpha, -beta), strict=True))

    def mechanism(self, angle: float, side: int) -> mg.Mechanism:
        """The mechanism standing there."""
        return linked_four_bar(*self.lengths, angle).replace(start=self.start(angle, side))

    def branch(self, angle: float, side: int) -> tuple[bool, int]:
        """What tells its branch: with four folds the cranks are on one side of the ground, and always the joint is on one of its line."""
        return len(self.folds) == 4 and np.sin(angle) > 0, side

    def circuit(self, angle: float, side: int) -> tuple[bool, int]:
        """What tells its circuit: at folds both sides meet."""
        return self.branch(angle, 0 if self.folds.size else side)

    def angles(self, n: int) -> Any:
        """Crank angles at which it closes, 1e-6 or more from folds: some anywhere, some near folds and change points."""
        a, b, c, d = self.lengths
        near = np.concatenate([np.repeat(self.folds, 2), [0.0, 0.0, np.pi, np.pi]])
        near += self.rng.choice([-1, 1], len(near)) * 10 ** self.rng.uniform(-5.9, -1, len(near))
        angles = self.rng.permutation(np.concatenate([self.rng.uniform(-np.pi, np.pi, 8 * n), near]))
        reach = np.abs(d - a * np.exp(1j * angles))
        gap = np.abs(np.angle(np.exp(1j * (angles[:, None] - self.folds)))).min(axis=1, initial=np.pi)
        return angles[(reach < b + c) & (reach > abs(b - c)) & (gap > 1e-6)][:n]


def marked_four_bar() -> mg.Mechanism:
    """A planar four-bar placed by markers; ``C.on_b.point.x`` is the length of its rocker."""
    z, ends = (0, 0, 1), [("frame", "crank"), ("crank", "coupler"), ("coupler", "rocker"), ("frame", "rocker")]
    places = [((0, 0, 0), (0, 0, 0)), ((1, 0, 0), (0, 0, 0)), ((3, 0, 0), (2.5, 0, 0)), ((3.2, 0, 0), (0, 0, 0))]
    pairs = [
        mg.Pair(name, "R", *links, on_a=mg.Marker(at[0], z), on_b=mg.Marker(at[1], z))
        for name, links, at in zip("ABCD", ends, places, strict=True)
    ]
    start = {"A": 0.5, "B": 0.24, "C": 0.87, "D": 1.61}
    return mg.Mechanism("four-bar", pairs=pairs, drives=["A"], loads=[mg.Effort("D", 1.0)], start=start)
