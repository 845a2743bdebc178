"""The mechanisms of two papers on higher pairs: printed table, closed-form input-output equations, and what is misprinted in them.

[S] G. N. Sandor, D. Kohli, M. V. Hernandez and A. Ghosal, Kinematic Analysis of Three-Link Spatial Mechanisms Containing Sphere-Plane and
Sphere-Groove Pairs, Mechanism and Machine Theory, 1984; [G] A. Ghosal, D. Kohli and G. N. Sandor, Kinematic Analysis of Four-Link Space
Mechanisms Containing Sphere-Groove and Sphere-Slotted-Cylinder Higher Pairs, ASME paper 82-DET-123, 1982 (both in report AD-A134519).
Numbers in brackets are those of their equations. Products whose signs are lost in the scanned text are restored by deriving them again.
``library/higher-pairs.md`` lists the errata.
"""

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import mechgraph as mg

Array = NDArray[np.float64]
THREE = ("p-sp-p", "r-sp-p", "r-sp-r", "p-sp-r", "r-sg-c", "r-cp-c")
FOUR = ("r-sg-r-r", "r-sg-r-p", "r-sg-p-r", "r-sg-p-p", "r-sc-c-r", "r-sc-c-p", "r-sc-r-c", "r-sc-p-c")
DEGREE = {
    "r-sg-r-r": 4, "r-sg-r-p": 2, "r-sg-p-r": 2, "r-sg-p-p": 1, "r-sc-c-r": 8, "r-sc-c-p": 2, "r-sc-r-c": 8, "r-sc-p-c": 2,
}  # fmt: skip
"""Degree of the input-output equation in the tangent of half the output angle, or in the output slide, as [G] states it."""

PRINTED = np.array([
    [5, 2.12, .41, -.20, -.13, -1.56, -.75, .15, 1.76, .36],
    [40, 12.99, .12, -1.23, -1.22, -1.95, -.41, 1.26, 1.79, -.32],
    [80, -95.87, -3.36, 32.3, -2.05, 1.66, 5.58, 2.04, -.81, -4.07],
    [120, -112.24, .26, .40, -.64, 1.99, -.55, 1.11, -1.59, -.63],
    [160, -93.34, .39, .11, .58, 1.42, -1.0, -.04, -1.64, .28],
    [200, -81.04, .46, .68, 1.32, .68, -1.05, -1.06, -1.20, .90],
    [240, -61.47, .51, .06, 1.55, .01, -.84, -1.65, -.44, 1.23],
    [280, -40.35, .54, .003, 1.37, -0.5, -.67, -1.65, .44, 1.24],
    [320, -19.17, .51, -.07, .55, -.97, -.71, -1.05, 1.23, .97],
    [355, -2.2, .45, -.16, .13, -1.43, -.77, -.15, 1.69, .52],
])  # fmt: skip
"""[S], section 7: theta_A, then value, rate and second rate of theta_B (degrees; radians), s_C and s_B, at 1 rad/s of A."""
WRONG = {(4, 1): -98.34, (5, 3): 0.08, (8, 4): 0.86, (3, 9): -0.43}
"""Entries that do not stand as the mechanism has them: row, column, what it has to the digits printed."""


def unit(v: object) -> Array:
    a = np.asarray(v, dtype=float)
    return a / np.linalg.norm(a)


def across(u: Array, v: Array) -> Array:
    """``U_uv = (u x v) x u`` (7a), v without its part along u."""
    return np.cross(np.cross(u, v), u)


def turned(u: Array, angle: object, v: Array) -> Array:
    """(3): v turned about the axis u, ``(..., 3)``."""
    angle = np.asarray(angle, dtype=float)[..., None]
    return v + (np.cos(angle) - 1) * across(u, v) + np.sin(angle) * np.cross(u, v)


def dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def solved(name: str) -> mg.Solution:
    m = mg.load(name)
    motion = m.drives[0].motion
    assert motion is not None
    return mg.kinematics(m, {"A": mg.Motion(motion.position[3::20], 1.3, 0.7)})


def of(s: mg.Solution, pair: str, link: str, name: str) -> Array:
    """Value, rate and second rate of a freedom of the joint of ``link``, 0 where the pair has none of that name."""
    p = s.mechanism.pair(pair)
    sign = 1.0 if p.b == link else -1.0
    names = [f.name for f in p.type.freedoms]
    if name not in names:
        return np.zeros((3, *s.batch))
    r = s[pair]
    return sign * np.array([x[..., names.index(name)] for x in (r.position, r.velocity, r.acceleration)])


class ThreeLinks:
    """The quantities of [S], sections 2 to 4, along a solution."""

    def __init__(self, s: mg.Solution) -> None:
        a, b, c = s.mechanism.pairs
        self.uA, self.uB, self.A = unit(a.axis), unit(c.axis), unit(b.axis)
        self.K = np.subtract(b.point, a.point)
        self.L = np.subtract(b.point, c.point)
        self.tA, self.tB = of(s, "A", "input", "Rz"), of(s, "C", "output", "Rz")
        self.sA, self.sB = of(s, "A", "input", "Tz"), of(s, "C", "output", "Tz")
        self.sG = of(s, "B", "input", "Tz")

    @property
    def S(self) -> Array:
        """(26) of turns, and ``u_A s_A`` of slides."""
        return turned(self.uA, self.tA[0], self.K) - self.K + self.sA[0][..., None] * self.uA

    @property
    def half_tangents(self) -> tuple[Array, Array]:
        """(28), (30): both values of tan(theta_B / 2) of R-Sp-R and P-Sp-R."""
        a = -dot(across(self.uB, self.L), self.A) - dot(self.S, across(self.uB, self.A))
        b = dot(np.cross(self.uB, self.L), self.A) - dot(self.S, np.cross(self.uB, self.A))
        c = -dot(self.S, self.A)
        root = np.sqrt(b**2 - c * (c - 2 * a))
        return (-b + root) / (c - 2 * a), (-b - root) / (c - 2 * a)

    @property
    def half_tangents_in_groove(self) -> tuple[Array, Array]:
        """(33)."""
        UL, UA = across(self.uB, self.L), across(self.uB, self.A)
        a = dot(self.S, np.cross(self.A, self.uB)) + dot(UL, np.cross(self.A, self.uB))
        b = dot(self.S, UA) + dot(UL, UA)
        c = -dot(np.cross(self.uB, self.L), UA)
        root = np.sqrt(a**2 + b**2 - c**2)
        return (-b + root) / (c - a), (-b - root) / (c - a)


def derived(u: Array, angle: Array, v: Array) -> tuple[Array, Array]:
    """(12), (13), and V, W of (16): first and minus second derivative of a turned vector by the angle."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return c * np.cross(u, v) - s * across(u, v), c * across(u, v) + s * np.cross(u, v)


def one_of(found: Array, values: tuple[Array, ...]) -> bool:
    """Whether every number found is one of the roots at its place (angles within a turn)."""
    away = np.min([np.abs(found - v) for v in values], axis=0)
    return bool(away.max() < 1e-9)


def half(angle: Array) -> Array:
    return np.tan(angle / 2)


# --- the table --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", range(len(PRINTED)))
def test_a_row_of_the_printed_table(row: int) -> None:
    """Every number within 1.1 units of its last printed digit (most are cut off, some rounded), but four that are misread or misprinted."""
    unit_length = 0.05  # the library's r-sg-c in units of the paper
    s = mg.kinematics(mg.load("r-sg-c"), {"A": mg.Motion(np.deg2rad(PRINTED[row, 0]), 1.0, 0.0)})
    theta, slide, groove = of(s, "C", "output", "Rz"), of(s, "C", "output", "Tz"), of(s, "B", "input", "Tz")
    found = np.array([np.rad2deg(theta[0]), *theta[1:], *groove / unit_length, *slide / unit_length])
    expected = np.array([WRONG.get((row, column), PRINTED[row, column]) for column in range(1, 10)])
    last = np.where(np.abs(expected) == 32.3, 0.1, np.where(np.abs(expected) == 0.003, 0.001, 0.01))
    assert (np.abs(found - expected) < 1.1 * last).all()
    for (i, column), meant in WRONG.items():
        assert i != row or abs(PRINTED[row, column] - meant) > 5 * 0.01


def test_the_document_names_what_is_wrong_in_the_table() -> None:
    text = (Path(__file__).resolve().parents[2] / "library" / "higher-pairs.md").read_text(encoding="utf-8")
    rows = [re.split(r"\s*\|\s*", line) for line in text.splitlines() if re.match(r"\| \d+ \|", line)]
    said = {(float(row[1]), float(row[3]), float(row[4])) for row in rows}
    assert said == {(PRINTED[row, 0], PRINTED[row, column], meant) for (row, column), meant in WRONG.items()}


@pytest.mark.parametrize("place", WRONG)
def test_what_is_wrong_in_the_table_contradicts_the_table_itself(place: tuple[int, int]) -> None:
    """The evidence: value, rate and second rate of a column are those of one curve. Between neighbouring rows the trapezoidal rule with end
    correction (``h (v + w) / 2 + h^2 (a - b) / 12``) and the trapezoidal rule of the rates fit the corrected number, not the printed one.
    """
    row, column = place
    start = 1 + 3 * ((column - 1) // 3)
    table = PRINTED.copy()
    for other, value in WRONG.items():
        table[other] = value
    table[:, 1] = np.deg2rad(table[:, 1])
    printed = np.deg2rad(PRINTED[place]) if column == 1 else PRINTED[place]

    def misses(value: float) -> float:
        columns = table[:, start : start + 3].copy()
        columns[row, column - start] = value
        angle = np.deg2rad(table[:, 0])
        worst = 0.0
        for i, j in pairwise(range(max(row - 1, 3), min(row + 2, len(table)))):  # beyond the sharp turn near 80 degrees
            h, (p, v, a), (q, w, b) = angle[j] - angle[i], columns[i], columns[j]
            worst = max(worst, abs(q - p - h * (v + w) / 2 - h * h * (a - b) / 12))
            worst = max(worst, abs(w - v - h * (a + b) / 2))
        return worst

    assert misses(table[place]) < 0.6 * misses(printed)


# --- three links ------------------------------------------------------------------------------------------------------


def test_p_sp_p() -> None:
    t = ThreeLinks(solved("p-sp-p"))
    ratio = dot(t.uA, t.A) / dot(t.uB, t.A)  # (23), (40), (41)
    assert np.abs(t.sB - ratio * t.sA).max() < 1e-12


def test_r_sp_p() -> None:
    t = ThreeLinks(solved("r-sp-p"))
    M, N = derived(t.uA, t.tA[0], t.K)
    along = dot(t.uB, t.A)
    assert np.abs(t.sB[0] - dot(t.S, t.A) / along).max() < 1e-12  # (24)
    assert np.abs(t.sB[1] - dot(M, t.A) / along * t.tA[1]).max() < 1e-12  # (42)
    assert np.abs(t.sB[2] - (-dot(N, t.A) * t.tA[1] ** 2 + dot(M, t.A) * t.tA[2]) / along).max() < 1e-12  # (43)


@pytest.mark.parametrize("name", ["r-sp-r", "p-sp-r"])
def test_sphere_on_a_turning_plane(name: str) -> None:
    """(25) to (30) and (44) to (48), with the errata: theta_B for theta_A in (25), no second factor 2 M_B in (45), A' in (48)."""
    t = ThreeLinks(solved(name))
    assert one_of(half(t.tB[0]), t.half_tangents)
    MA, NA = derived(t.uA, t.tA[0], t.K)
    MB, NB = derived(t.uB, t.tB[0], t.L)
    V, W = derived(t.uB, t.tB[0], t.A)
    A = turned(t.uB, t.tB[0], t.A)
    apart = t.S - (turned(t.uB, t.tB[0], t.L) - t.L)
    D = dot(MB, A) - dot(apart, V)
    ahead = MA * t.tA[1][:, None] + t.uA * t.sA[1][:, None]
    assert np.abs(t.tB[1] - dot(ahead, A) / D).max() < 1e-10
    second = -NA * t.tA[1][:, None] ** 2 + MA * t.tA[2][:, None] + t.uA * t.sA[2][:, None]
    inner = dot(NB, A) - 2 * dot(MB, V) - dot(apart, W)
    found = (dot(second, A) + 2 * dot(ahead, V) * t.tB[1] + inner * t.tB[1] ** 2) / D
    assert np.abs(t.tB[2] - found).max() < 1e-9
    printed = dot(NB, A) - 4 * dot(MB, MB) * dot(MB, V) - dot(apart, W)
    wrong = (dot(second, A) + 2 * dot(ahead, V) * t.tB[1] + printed * t.tB[1] ** 2) / D
    assert np.abs(t.tB[2] - wrong).max() > 1e-3


def test_r_sg_c() -> None:
    """(32) to (35) and (50) to (56), the last with S'' on their left sides and theta_A' on the right of (50)."""
    t = ThreeLinks(solved("r-sg-c"))
    assert one_of(half(t.tB[0]), t.half_tangents_in_groove)
    A, uL = turned(t.uB, t.tB[0], t.A), np.cross(t.uB, t.L)
    rest = t.S - (turned(t.uB, t.tB[0], t.L) - t.L)
    assert np.abs(t.sG[0] - dot(rest, uL) / dot(A, uL)).max() < 1e-12  # (34)
    assert np.abs(t.sB[0] - dot(rest - t.sG[0][:, None] * A, t.uB)).max() < 1e-12  # (35)
    MA, NA = derived(t.uA, t.tA[0], t.K)
    MB, NB = derived(t.uB, t.tB[0], t.L)
    V, W = derived(t.uB, t.tB[0], t.A)
    G = t.sG[0][:, None] * V + MB
    X = -NA * t.tA[1][:, None] ** 2 + MA * t.tA[2][:, None] + (NB + t.sG[0][:, None] * W) * t.tB[1][:, None] ** 2
    X = X - 2 * V * (t.tB[1] * t.sG[1])[:, None]
    for order, right in ((1, MA * t.tA[1][:, None]), (2, X)):
        for value, axis, others in (
            (t.tB, G, np.cross(A, t.uB)),
            (t.sB, t.uB, np.cross(A, G)),
            (t.sG, A, np.cross(t.uB, G)),
        ):
            assert (
                np.abs(value[order] - dot(right, others) / dot(axis, others)).max() < 1e-9 * np.abs(value[order]).max()
            )


def test_r_cp_c() -> None:
    """The cylinder stays square to the normal, ``e(theta_A) . A'(theta_B) = 0``, and its axis at the height of the plane."""
    s = solved("r-cp-c")
    t, e = ThreeLinks(s), unit(s.mechanism.pair("B").second)
    e = turned(t.uA, t.tA[0], e)
    a, b = dot(e, across(t.uB, t.A)), dot(e, np.cross(t.uB, t.A))
    c = dot(e, t.A) - a
    root = np.sqrt(b**2 + a**2 - c**2)
    assert one_of(half(t.tB[0]), ((b + root) / (a - c), (b - root) / (a - c)))
    A = turned(t.uB, t.tB[0], t.A)
    rest = t.S - (turned(t.uB, t.tB[0], t.L) - t.L)
    assert np.abs(t.sB[0] - dot(rest, A) / dot(t.uB, A)).max() < 1e-12


# --- four links -------------------------------------------------------------------------------------------------------


class FourLinks:
    """The quantities of [G]: a function of the output for every position of the input, which is zero at the output that belongs to it."""

    def __init__(self, name: str, s: mg.Solution) -> None:
        self.name = name
        a, b, c, d = (p for p in s.mechanism.pairs)
        self.u1, self.u3, self.u4 = (unit(p.axis) for p in (a, c, d))
        self.R, self.P1, self.P3, self.P4 = (np.asarray(p.point) for p in (b, a, c, d))
        self.A, self.b = unit(b.axis), unit(b.second)
        self.t1 = of(s, "A", "input", "Rz")[0]
        self.t3, self.s3 = of(s, "C", "coupler", "Rz")[0], of(s, "C", "coupler", "Tz")[0]
        self.t4, self.s4 = of(s, "D", "output", "Rz")[0], of(s, "D", "output", "Tz")[0]
        self.T = of(s, "B", "coupler", "Tz")[0]
        self.A1, self.b1 = turned(self.u1, self.t1, self.A), turned(self.u1, self.t1, self.b)
        self.R1 = turned(self.u1, self.t1, self.R - self.P1) + self.P1

    def carried(self, t4: Array, s4: Array) -> tuple[Array, ...]:
        """R, u3, C3 and D3 with the output at (t4, s4)."""
        K = self.R - self.P3
        R = turned(self.u4, t4, self.R - self.P4) + self.P4 + np.asarray(s4)[..., None] * self.u4
        u3, C, D = (turned(self.u4, t4, v) for v in (self.u3, across(self.u3, K), np.cross(self.u3, K)))
        return R, u3, C, D

    def groove_turn(self, t4: Array, s4: Array) -> Array:
        """(18), R-Sg-R-R and R-Sg-R-P: ``B^2 + 2 A B + C^2``."""
        A, B, C = self.abc(t4, s4)
        return B**2 + 2 * A * B + C**2

    def abc(self, t4: Array, s4: Array) -> tuple[Array, Array, Array]:
        """(17)."""
        R, _, C, D = self.carried(t4, s4)
        apart = self.R1 - R
        return dot(self.A1, np.cross(C, D)), dot(self.A1, np.cross(apart, D)), dot(self.A1, np.cross(apart, C))

    def groove_slide(self, t4: Array, s4: Array) -> Array:
        """R-Sg-P-R and R-Sg-P-P: the sphere leaves the line of the groove along u3 only."""
        R, u3, _, _ = self.carried(t4, s4)
        return dot(self.R1 - R, np.cross(u3, self.A1))

    def slot_rows(self, t4: Array, s4: Array) -> tuple[Array, Array]:
        """(26) and (28): rows (a, b, c) of ``(1 - cos theta_3) a + sin theta_3 b + c = 0``; with a C pair at the output along u4."""
        R, u3, C, D = self.carried(t4, s4)
        side = np.cross(self.A1, self.u4 if self.name == "r-sc-r-c" else u3)
        X, Y, b4 = (turned(self.u4, t4, v) for v in (across(self.u3, self.b), np.cross(self.u3, self.b), self.b))
        slot = np.cross(self.A1, self.b1)
        first = np.stack([dot(side, C), -dot(side, D), -dot(side, R - self.R1)], axis=-1)
        return first, np.stack([-dot(slot, X), dot(slot, Y), dot(slot, b4)], axis=-1)

    def brackets(self, t4: Array, s4: Array) -> tuple[Array, Array, Array]:
        """(31): |ab|, |bc|, |ac|."""
        (a1, b1, c1), (a2, b2, c2) = (np.moveaxis(row, -1, 0) for row in self.slot_rows(t4, s4))
        return (
            (2 * a1 + c1) * 2 * b2 - 2 * b1 * (2 * a2 + c2),
            2 * b1 * c2 - 2 * b2 * c1,
            (2 * a1 + c1) * c2 - (2 * a2 + c2) * c1,
        )

    def slot_turn(self, t4: Array, s4: Array) -> Array:
        """(29), R-Sc-C-R, R-Sc-C-P and R-Sc-R-C: ``|ab| |bc| - |ac|^2``."""
        ab, bc, ac = self.brackets(t4, s4)
        return ab * bc - ac**2

    def slot_slide(self, t4: Array, s4: Array) -> Array:
        """R-Sc-P-C: the condition (3) of the slot holds the output alone."""
        return dot(np.cross(self.A1, self.b1), turned(self.u4, t4, self.b)) + 0.0 * s4


FUNCTION: dict[str, Callable[[FourLinks, Array, Array], Array]] = {
    "r-sg-r-r": FourLinks.groove_turn, "r-sg-r-p": FourLinks.groove_turn, "r-sg-p-r": FourLinks.groove_slide,
    "r-sg-p-p": FourLinks.groove_slide, "r-sc-c-r": FourLinks.slot_turn, "r-sc-c-p": FourLinks.slot_turn,
    "r-sc-r-c": FourLinks.slot_turn, "r-sc-p-c": FourLinks.slot_slide,
}  # fmt: skip


def roots(name: str, f: FourLinks) -> list[Array]:
    """Real roots of the input-output equation at every position, from its values at as many outputs as it has coefficients and some more:
    the harmonics (or powers) beyond the degree that [G] states must vanish.
    """
    angular, degree = name.endswith(("-r", "-c")), DEGREE[name]
    zero, order = np.zeros(len(f.t1)), degree // 2 if name.endswith(("-r", "-c")) else degree
    count = 2 * order + 3 if angular else degree + 3
    at = 2 * np.pi * np.arange(count) / count if angular else 0.2 * np.cos(np.pi * (np.arange(count) + 0.5) / count)
    values = np.array([FUNCTION[name](f, zero + x, zero) if angular else FUNCTION[name](f, zero, zero + x) for x in at])
    out = []
    for column in values.T:
        if angular:
            harmonics = np.fft.fft(column) / count
            beyond = harmonics[order + 1 : count - order]
            powers = np.concatenate([harmonics[: order + 1][::-1], harmonics[count - order :][::-1]])
            found = np.roots(powers)
            on_circle = np.abs(np.abs(found) - 1) < 1e-6
            real = np.angle(found[on_circle])
        else:
            powers = np.polyfit(at / 0.2, column, degree + 2)
            beyond = powers[:2]
            found = 0.2 * np.roots(powers[2:])
            real = found.real[np.abs(found.imag) < 1e-6]
        assert np.abs(beyond).max() < 1e-12 * np.abs(column).max() + 1e-18
        assert len(found) == degree
        out.append(real)
    return out


@pytest.mark.parametrize("name", FOUR)
def test_output_is_a_root_of_the_closed_form(name: str) -> None:
    s = solved(name)
    f = FourLinks(name, s)
    output = f.t4 if name.endswith(("-r", "-c")) else f.s4
    for value, real in zip(output, roots(name, f), strict=True):
        away = np.abs(np.exp(1j * real) - np.exp(1j * value)) if name.endswith(("-r", "-c")) else np.abs(real - value)
        assert away.min() < 1e-7


@pytest.mark.parametrize("name", ["r-sg-r-r", "r-sg-r-p"])
def test_turn_of_the_coupler_and_place_in_the_groove(name: str) -> None:
    """(23) with minus C in its second form, and (24)."""
    s = solved(name)
    f = FourLinks(name, s)
    A, B, C = f.abc(f.t4, f.s4)
    x3, away = half(f.t3), np.abs(f.t3) > 1e-3
    assert np.abs(x3[away] - (B / C)[away]).max() < 1e-8
    assert np.abs(x3[away] + (C / (B + 2 * A))[away]).max() < 1e-8
    R, _, c, d = f.carried(f.t4, f.s4)
    there = R + (np.cos(f.t3) - 1)[:, None] * c + np.sin(f.t3)[:, None] * d
    assert (
        np.abs(dot(there - f.R1, f.A1) - f.T).max() < 1e-12
    )  # + towards the sphere, as a pair counts it: (24) has minus that


def test_r_sc_c_r_by_its_formulas() -> None:
    """(26), (30) with minus |bc| / |ac| in its second form, (32), (33) with T counted from the sphere to the groove."""
    f = FourLinks("r-sc-c-r", solved("r-sc-c-r"))
    R, u3, C, D = f.carried(f.t4, f.s4)
    ab, bc, ac = f.brackets(f.t4, f.s4)
    away = np.abs(f.t3) > 1e-3
    x3 = half(f.t3)[away]
    assert np.abs(x3 + (ac / ab)[away]).max() < 1e-7
    assert np.abs(x3 + (bc / ac)[away]).max() < 1e-7
    left = f.R1 - R - (np.cos(f.t3) - 1)[:, None] * C
    s3 = dot(left, np.cross(D, f.A1)) / dot(u3, np.cross(D, f.A1))
    T = dot(left, np.cross(D, u3)) / dot(f.A1, np.cross(D, u3))
    assert np.abs(s3 - f.s3).max() < 1e-9
    assert np.abs(T + f.T).max() < 1e-9


def test_the_printed_r_sc_c_r_stands_at_a_dead_point() -> None:
    """[G], example 2 as printed: at its start two outputs of (29) meet, and the input cannot move the mechanism."""
    m = mg.load("r-sc-c-r").replace(
        pairs=[
            mg.Pair("A", "R", "frame", "input", point=(0, 0, 0), axis=(0, 1, -1)),
            mg.Pair("B", "Sc", "input", "coupler", point=(1, 1, 1), axis=(0, 0, 1), second=(1, 0, 0)),
            mg.Pair("C", "C", "coupler", "output", point=(-1, 2, 0), axis=(1, 1, 1)),
            mg.Pair("D", "R", "output", "frame", point=(2, 3, 0), axis=(-1, 1, 0)),
        ]
    )
    with pytest.raises(mg.DeadPointError):
        mg.kinematics(m, {"A": [0.0, 0.1]})
    f = FourLinks("r-sc-c-r", mg.kinematics(m, {"D": [0.0]}))
    step = 1e-3
    at = [FourLinks.slot_turn(f, np.array([x]), np.zeros(1))[0] for x in (-step, 0.0, step, 1.0)]
    assert abs(at[1]) < 1e-12 * abs(at[3])
    assert abs(at[2] - at[0]) / (2 * step) < 0.01 * abs(at[3])
