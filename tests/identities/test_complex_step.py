"""The kernel over complex numbers: a derivative is the imaginary part of one evaluation a tiny imaginary step away, without rounding.

Source: Squire and Trapp, Using complex variables to estimate derivatives of real functions, SIAM Review 40, 1998. The same tests hold
a factor whose twist moves with its coordinate (a frame along a curve) to everything that holds for constant screws.
"""

from dataclasses import dataclass, replace

import mechanisms
import numpy as np
import pytest
import strategies
from numpy.testing import assert_allclose

import mechgraph as mg
from mechgraph.graph import linkgraph
from mechgraph.kinematics.assembly import scaled_system
from mechgraph.kinematics.state import Configuration, close
from mechgraph.kinematics.system import System, indexed
from mechgraph.maths import se3
from mechgraph.model.toml import library_names, library_path
from mechgraph.pairs.factors import Factor

STEP = 1e-30
SYMBOLS = [symbol for symbol in mg.pair_types() if symbol != "W"]


def closed(m: mg.Mechanism, seed: int = 0, size: float = 0.1) -> tuple[System, np.ndarray]:
    """A mechanism at a closed position away from the declared one; state ``(nx, 1)``."""
    raw = indexed(m)
    start = raw.start_coordinates(m.start)
    system = scaled_system(m, start)
    rng = np.random.default_rng(seed)
    x = system.state_of(start[:, None])
    x = system.advance(x, rng.uniform(-size, size, (system.n_freedoms, 1)))
    x, error = close(system, x[:, 0], np.zeros(0, dtype=int))
    assert error < 1e-11
    return system, x[:, None]


def stepped(system: System, x: np.ndarray, dq: np.ndarray):
    """The configurations an imaginary step away in the directions ``dq (F, k)``."""
    return Configuration(system, system.advance(x, STEP * 1j * dq))


def rate(values: np.ndarray) -> np.ndarray:
    return values.imag / STEP


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max(initial=0.0) / max(1.0, np.abs(expected).max(initial=0.0)))


def jacobian_by_complex_step(system: System, x: np.ndarray) -> np.ndarray:
    return rate(stepped(system, x, np.eye(system.n_freedoms)).residual)


def bias_by_complex_step(system: System, x: np.ndarray, dq: np.ndarray) -> np.ndarray:
    there = stepped(system, x, dq)
    return rate(there.pair_sums(there.S * dq))


def holds(system: System, x: np.ndarray, seed: int = 1) -> None:
    here = Configuration(system, x)
    left_open = float(here.closure[0])  # J is the derivative of the logarithm where the closure is exactly the identity
    assert relative(jacobian_by_complex_step(system, x), here.J[:, :, 0]) < 1e-14 + 2 * left_open
    dq = np.random.default_rng(seed).normal(size=(system.n_freedoms, 1))
    assert relative(bias_by_complex_step(system, x, dq), here.bias(dq, here.link_twists(dq))) < 2e-14


def with_type(symbol: str | mg.PairType, seed: int) -> mg.Mechanism:
    """A random loop in which a pair of the given type stands between enough revolutes."""
    rng = np.random.default_rng(seed)
    f = symbol.f if isinstance(symbol, mg.PairType) else mg.pair_types()[symbol].f
    n = 8 - min(f, 5)
    types = [symbol, *["R"] * n]
    points = rng.normal(size=(n + 1, 3))
    axes = rng.normal(size=(n + 1, 3))
    names = ["frame", *(f"link{k}" for k in range(n))]
    pairs = [
        mg.Pair(
            f"O{k}",
            kind,
            names[k],
            names[(k + 1) % (n + 1)],
            point=points[k],
            axis=axes[k] if getattr(kind, "directed", kind != "S") else None,
            second=np.cross(axes[k], [0.3, 0.4, 1.0]) if getattr(kind, "directed", kind != "S") else None,
            pitch=0.2 if kind == "H" else None,
        )
        for k, kind in enumerate(types)
    ]
    return mg.Mechanism(str(symbol), None, pairs, ["O1"])


@pytest.mark.parametrize("symbol", SYMBOLS)
@pytest.mark.parametrize("seed", range(3))
def test_every_pair_type(symbol, seed):
    holds(*closed(with_type(symbol, seed), seed))


@pytest.mark.parametrize("seed", range(12))
def test_random_mechanisms(seed):
    holds(*closed(strategies.closed_mechanism(seed), seed, 0.02), seed)


@pytest.mark.parametrize("name", library_names())  # that one does not close
def test_the_library(name):
    holds(*closed(mg.load(library_path(name)), 0, 0.03))


@pytest.mark.parametrize("make", [mechanisms.bennett, mechanisms.bricard_cube, mechanisms.hexapod, mechanisms.planar])
def test_mechanisms_with_redundant_constraints(make):
    holds(*closed(make(), 0, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_everything_keeps_the_type_of_its_numbers(seed):
    system, x = closed(strategies.closed_mechanism(seed), seed, 0.02)
    dq = np.random.default_rng(seed).normal(size=(system.n_freedoms, 1))
    for kind, state in ((float, x), (complex, x.astype(complex))):
        here = Configuration(system, state)
        V = here.link_twists(dq)
        found = (here.residual, here.J, here.S, here.E, *here.W, here.poses, here.pair_points, V, here.bias(dq, V))
        assert {np.asarray(part).dtype for part in found} == {np.dtype(kind)}
        again = Configuration(system, x)
        for part, same in zip((here.J, here.S, here.E, *here.W), (again.J, again.S, again.E, *again.W), strict=True):
            assert_allclose(part, same, atol=1e-13)


@pytest.mark.parametrize("symbol", [*SYMBOLS, mg.PairType("HT", freedoms=["Rz + pitch Tz", "Tx"], reactions=None)])
def test_rates_of_wrenches_keep_reciprocity(symbol):
    """``S^T W = 0`` and ``S^T E = 1`` hold over complex numbers, without a conjugate."""
    m = with_type(symbol if isinstance(symbol, str) else "C", 2)
    system, x = closed(m, 2)
    here = stepped(system, x, np.full((system.n_freedoms, 1), 0.3 / STEP))
    for g, W in zip(system.groups, here.W, strict=True):
        S, E = here.S[:, g.columns], here.E[:, g.columns]
        assert_allclose(np.einsum("ifnt,icnt->fcnt", S, W), 0, atol=1e-11)
        unit = np.einsum("ifnt,ignt->fgnt", S, E)
        assert_allclose(unit, np.broadcast_to(np.eye(g.row.f)[:, :, None, None], unit.shape), atol=1e-11)


def test_parameters_may_be_complex():
    """The rate of the residual with a pitch and a marker point equals a difference quotient."""
    m = with_type("H", 4)
    system, x = closed(m, 4)
    par = system.par

    def residual(step):
        point = par.marker_a.astype(type(step) if isinstance(step, complex) else float)
        point[0, 3, 2] += step
        pitch = par.pitch + step * (par.pitch != 0)
        return Configuration(system.with_parameters(replace(par, marker_a=point, pitch=pitch)), x).residual

    h = 1e-4
    quotient = (8 * (residual(h) - residual(-h)) - (residual(2 * h) - residual(-2 * h))) / (12 * h)
    assert_allclose(rate(residual(STEP * 1j)), quotient, atol=1e-9)


def test_logarithms_are_analytic():
    """``log(exp(s))`` gives back a complex twist, small and large, and near a half turn."""
    rng = np.random.default_rng(0)
    s = rng.normal(size=(6, 200)) * np.geomspace(1e-9, 1.0, 200) + 0.3j * rng.normal(size=(6, 200)) * np.geomspace(
        1e-9, 1, 200
    )
    axis = np.array([0.6, 0.0, 0.8])
    half = np.concatenate([np.pi * axis * (1 - 1e-3), [1.0, 2.0, 3.0]])[:, None] * np.ones(3) + 1e-3j * rng.normal(
        size=(6, 3)
    )
    for twist in (s, half):
        assert_allclose(se3.pose_log(se3.pose_exp(twist)), twist, atol=1e-9)
        assert_allclose(se3.rotation_log(se3.rotation_exp(twist[:3])), twist[:3], atol=1e-9)
        assert_allclose(se3.quaternion_log(se3.quaternion_exp(twist[:3])), twist[:3], atol=1e-9)


# --- a frame that travels along a curve -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Circle(Factor):
    """A frame that travels along a circle about ``(0, radius, 0)`` of the marker, its x along the tangent.

    The coordinate ``u`` is not the angle but ``angle = u + bend u^2``, so the twist ``(1 + 2 bend u) s`` moves with it.
    """

    radius: float
    bend: float

    @property
    def freedoms(self):
        return (mg.Freedom("Ru", (0, 0, 1, self.radius, 0, 0)),)

    def pose(self, x, pitch):
        angle = x[0] + self.bend * x[0] ** 2
        X = se3.identity(*angle.shape).astype(x.dtype)
        X[0, 0] = X[1, 1] = np.cos(angle)
        X[1, 0], X[0, 1] = np.sin(angle), -np.sin(angle)
        X[0, 3], X[1, 3] = self.radius * np.sin(angle), self.radius * (1 - np.cos(angle))
        return X

    def twists(self, x, pitch):
        return (self._screw() * (1 + 2 * self.bend * x[0]))[:, None]

    def twist_rates(self, x, dq, pitch):
        return self._screw() * (2 * self.bend * dq[0] ** 2)

    def scaled(self, L):
        return replace(self, radius=self.radius / L)

    def _screw(self):
        """About an axis along z through the center."""
        return np.array([0, 0, 1, self.radius, 0, 0])[:, None, None]


@dataclass(frozen=True)
class Ellipse(Factor):
    """A frame that travels along half an ellipse without turning: the direction of its twist changes."""

    a: float
    b: float

    @property
    def freedoms(self):
        return (mg.Freedom("Tu", (0, 0, 0, 1, 0, 0)),)

    def pose(self, x, pitch):
        X = se3.identity(*x.shape[1:]).astype(x.dtype)
        X[0, 3], X[1, 3] = self.a * np.sin(x[0]), self.b * (1 - np.cos(x[0]))
        return X

    def twists(self, x, pitch):
        out = np.zeros((6, 1, *x.shape[1:]), dtype=x.dtype)
        out[3, 0], out[4, 0] = self.a * np.cos(x[0]), self.b * np.sin(x[0])
        return out

    def twist_rates(self, x, dq, pitch):
        out = np.zeros((6, *x.shape[1:]), dtype=np.result_type(x, dq))
        out[3], out[4] = -self.a * np.sin(x[0]) * dq[0] ** 2, self.b * np.cos(x[0]) * dq[0] ** 2
        return out

    def scaled(self, L):
        return replace(self, a=self.a / L, b=self.b / L)


def ring_with(kind, offset=0.0) -> mg.Mechanism:
    """Seven pairs in a ring of which the third and the last but one (walked backwards) are of the given kind."""
    rng = np.random.default_rng(7)
    points, axes = rng.normal(size=(7, 3)), rng.normal(size=(7, 3))
    names = ["frame", *(f"link{k}" for k in range(6))]
    pairs = []
    for k in range(7):
        special = k in (2, 5)
        z = axes[k] / np.linalg.norm(axes[k])
        x = np.cross(z, [0.3, 0.4, 1.0])
        x /= np.linalg.norm(x)
        point = points[k] + (offset * np.cross(z, x) if special else 0.0)
        row = kind if special else "R"
        pairs.append(mg.Pair(f"O{k}", row, names[k], names[(k + 1) % 7], point=point, axis=z, second=x))
    return mg.Mechanism("ring", None, pairs, ["O1"])


def test_a_frame_along_a_circle_is_a_revolute_at_its_centre():
    """Closure, J and bias, with ``angle = u + bend u^2``: ``J_u = J angle'``, ``bias_u = bias + J angle'' u'^2``."""
    radius, bend = 0.8, 0.3
    curve = System(ring_with(mg.PairType("Arc", freedoms=[Circle(radius, bend)], reactions=None)))
    hinge = System(ring_with("R", radius))
    par = curve.par  # about one origin, so that screws can be compared
    hinge = hinge.with_parameters(hinge.par.rescaled(par.origin, 1.0))
    rng = np.random.default_rng(3)
    u, du = rng.uniform(-0.5, 0.5, (7, 4)), rng.normal(size=(7, 4))
    special = np.isin(np.arange(7), (2, 5))[:, None]
    q = np.where(special, u + bend * u**2, u)
    slope, bent = np.where(special, 1 + 2 * bend * u, 1.0), np.where(special, 2 * bend, 0.0)
    a, b = Configuration(curve, u), Configuration(hinge, q)
    assert_allclose(a.S, b.S * slope, atol=1e-13)
    J = b.J * slope
    J[3:] += np.cross(J[:3], a.middles - b.middles, axis=0)  # a loop is taken about the middle of its own pair points
    assert_allclose(a.J, J, atol=1e-13)
    V = a.link_twists(du)
    assert_allclose(
        a.bias(du, V), b.bias(slope * du, b.link_twists(slope * du)) + b.pair_sums(b.S * bent * du**2), atol=1e-12
    )
    assert_allclose(a.closure_bias(a.bias(du, V), V), a.loop_sums(a.bias(du, V)), atol=1e-13)
    assert_allclose(a.closure, b.closure, atol=1e-12)


@pytest.mark.parametrize(
    ("factor", "after"),
    [
        (Circle(0.8, 0.3), ()),
        (Circle(0.8, 0.3), ("Rx",)),
        (Ellipse(1.2, 0.7), ()),
        (Ellipse(1.2, 0.7), ("Rz",)),
        (Ellipse(1.2, 0.7), ("rotation",)),
    ],
)
def test_a_factor_with_a_moving_twist(factor, after):
    """Nothing but its class is needed: rows are checked, J and bias are exact, efforts are dual, reactions do no work."""
    row = mg.PairType("Along", freedoms=["Tz", factor, *after], reactions=None)
    system, x = closed(with_type(row, 5), 5)
    holds(system, x)
    here = Configuration(system, x)
    g, W = next((g, W) for g, W in zip(system.groups, here.W, strict=True) if g.row.symbol == "Along")
    S, E = here.S[:, g.columns], here.E[:, g.columns]
    assert_allclose(np.einsum("ifnt,icnt->fcnt", S, W), 0, atol=1e-12)
    assert_allclose(np.einsum("ifnt,ignt->fgnt", S, E)[..., 0, 0], np.eye(row.f), atol=1e-12)


# --- batches ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_a_batch_is_the_evaluation_of_each(seed, monkeypatch):
    """Deep mechanisms are walked by doubling."""
    system, x = closed(strategies.closed_mechanism(seed), seed, 0.02)
    rng = np.random.default_rng(seed)
    dq = rng.uniform(-0.1, 0.1, (system.n_freedoms, 70))
    states = system.advance(x, dq)

    def everything(here, rates):
        V = here.link_twists(rates)
        parts = (here.residual, here.S, here.E, here.poses, here.pair_points, here.bias(rates, V), *here.W)
        return [np.array(part) for part in (*parts, *(X for frames in here.frames for X in frames))]

    whole = everything(Configuration(system, states), dq)
    monkeypatch.setattr(linkgraph, "DEEP", 0)
    doubled = everything(Configuration(system, states), dq)
    monkeypatch.undo()
    for t in (0, 17, 69):
        alone = everything(Configuration(system, states[:, t : t + 1]), dq[:, t : t + 1])
        for a, b, c in zip(whole, alone, doubled, strict=True):
            assert_allclose(a[..., t], b[..., 0], atol=1e-12)
            assert_allclose(a[..., t], c[..., t], atol=1e-12)


# --- Closure rows come from contributors: six from a loop, one from a coupling of freedoms, placed one below the other ---


def relation(name: str, terms: tuple[tuple[str, float], ...], constant: float | None = None) -> mg.Coupling:
    return mg.Coupling(terms, name=name, constant=constant)


def system_with(m: mg.Mechanism, *relations: mg.Coupling) -> System:
    """The scaled system of a mechanism with couplings."""
    raw = System(m.replace(couplings=relations))
    return scaled_system(raw.m, raw.start_coordinates(m.start), raw)


def slider_crank() -> mg.Mechanism:
    return mg.load(library_path("slider-crank"))


def names_of(m: mg.Mechanism) -> list[str]:
    return [m.full_name(pair.name) for pair in m.pairs if pair.type.f == 1]


@pytest.fixture
def ring() -> tuple[mg.Mechanism, System, list[str]]:
    m = mechanisms.bennett()
    names = names_of(m)
    rows = (
        relation("one", ((names[0], 2.0), (names[1], -3.0))),
        relation("two", ((names[2], -0.5), (names[0], 0.25)), 0.7),
    )
    return m, system_with(m, *rows), names


def state(system: System, T: int, seed: int = 0) -> np.ndarray:
    return system.state_of(np.random.default_rng(seed).uniform(-0.4, 0.4, (system.n_freedoms, T)))


def test_loops_come_first_and_couplings_in_order(ring):
    _, system, _ = ring
    x = state(system, 5)
    here, alone = Configuration(system, x), Configuration(System(system.m.replace(couplings=()), par=system.par), x)
    assert system.n_rows == 8
    assert here.residual.shape == (8, 5)
    assert here.J.shape == (8, 4, 5)
    assert_allclose(here.residual[:6], alone.residual, atol=0)
    assert_allclose(here.J[:6], alone.J, atol=0)
    assert_allclose(here.J[6, :, 2], [2 / 3, -1, 0, 0], atol=1e-15)
    assert_allclose(here.J[7, :, 2], [0.5, 0, -1, 0], atol=1e-15)
    assert_allclose(here.residual[6], (2 * x[0] - 3 * x[1]) / 3, atol=1e-15)
    assert_allclose(here.residual[7], (0.25 * x[0] - 0.5 * x[2] - 0.7) / 0.5, atol=1e-15)
    assert_allclose(system.row_scale[:, 0], [1, 1, 1, 1, 1, 1, 1 / 3, 2], atol=1e-15)


def test_the_closure_error_contains_the_couplings(ring):
    _, system, _ = ring
    x = state(system, 5)
    here, alone = Configuration(system, x), Configuration(System(system.m.replace(couplings=()), par=system.par), x)
    expected = np.maximum(alone.closure, np.abs(here.residual[6:]).max(axis=0))
    assert_allclose(here.closure, expected, atol=1e-15)


def test_rates_bias_and_efforts_belong_to_the_same_rows(ring):
    """``closure_rates = J q'``; efforts are the transpose of the rows: ``x^T J q' = q'^T efforts`` and the loops' wrenches' power."""
    _, system, _ = ring
    x, rng = state(system, 3), np.random.default_rng(5)
    here, dq = Configuration(system, x), rng.normal(size=(4, 3))
    assert_allclose(here.closure_rates(dq), np.einsum("rft,ft->rt", here.J, dq), atol=1e-13)
    bias = here.closure_bias(here.bias(dq, V := here.link_twists(dq)), V)
    assert bias.shape == (8, 3)
    assert not bias[6:].any()
    assert_allclose(bias[:6], here.loop_sums(here.bias(dq, here.link_twists(dq))), atol=0)
    y = rng.normal(size=(8, 2, 3))
    through_loops = np.einsum("ift,ifkt->fkt", here.S, here.pair_wrenches(y)[:, system.owners])
    assert_allclose(through_loops + here.row_efforts(y), np.einsum("rft,rkt->fkt", here.J, y), atol=1e-12)


def test_rows_hold_over_complex_numbers(ring):
    _, system, _ = ring
    x = state(system, 1)
    dq = np.random.default_rng(1).normal(size=(4, 1))
    there = Configuration(system, system.advance(x, 1e-30j * dq))
    assert_allclose(there.residual.imag[6:] / 1e-30, Configuration(system, x).closure_rates(dq)[6:], rtol=1e-14)


def test_lengths_are_in_the_users_units():
    """A relation between an angle and a length: residual times 1 / scale is the relation in the user's units."""
    m = slider_crank()
    names = names_of(m)
    pairs = [pair for pair in m.pairs if pair.type.f == 1]
    slide = next(name for name, pair in zip(names, pairs, strict=True) if not pair.type.freedoms[0].turns)
    turn = next(name for name, pair in zip(names, pairs, strict=True) if pair.type.freedoms[0].turns)
    system = system_with(m, relation("rack", ((turn, 3.0), (slide, -40.0)), 0.2))
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (system.n_freedoms, 4))
    here = Configuration(system, system.state_of(q))
    columns = [system.first_column[k] + j for k, j in (m.freedom(turn), m.freedom(slide))]
    user = 3.0 * q[columns[0]] - 40.0 * q[columns[1]] - 0.2
    assert_allclose(here.residual[-1] / system.row_scale[-1], user, atol=1e-12)
    assert np.abs(here.J[-1]).max() == pytest.approx(1.0)


def test_a_constant_that_is_not_given_holds_at_the_start():
    m = mechanisms.bennett()
    names = names_of(m)
    m = m.replace(start={names[0]: 0.4, names[1]: -0.1})
    system = system_with(m, relation("one", ((names[0], 2.0), (names[1], -3.0))))
    q = system.start_coordinates(m.start)[:, None]
    assert_allclose(Configuration(system, system.state_of(q)).residual[6], 0, atol=1e-15)


def test_turns_count_on():
    """A coupling is between coordinates: a whole turn of one of them is an error of a whole turn."""
    m = mechanisms.bennett()
    names = names_of(m)
    system = system_with(m, relation("equal", ((names[0], 1.0), (names[1], -1.0))))
    x = np.array([[2 * np.pi], [0.0], [0.0], [0.0]])
    assert_allclose(Configuration(system, x).residual[6], 2 * np.pi)
    assert_allclose(Configuration(system, x).closure, 2 * np.pi)


def test_without_couplings_rows_are_the_loops():
    system = System(mechanisms.bennett())
    here = Configuration(system, state(system, 2))
    assert system.n_rows == 6
    assert not here.row_efforts(np.ones((6, 1, 2))).any()


def test_a_mechanism_without_loops_has_no_rows_but_its_couplings():
    m = mg.Mechanism(
        "arm",
        None,
        [
            mg.Pair("A", "R", "frame", "a", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "R", "a", "b", point=(1, 0, 0), axis=(0, 0, 1)),
        ],
        ["A"],
    )
    names = names_of(m)
    system = System(m.replace(couplings=(relation("belt", ((names[0], 1.0), (names[1], 1.0))),)))
    here = Configuration(system, np.array([[0.3], [0.2]]))
    assert here.residual.shape == (1, 1)
    assert_allclose(here.residual, 0.5)
    assert_allclose(here.closure, 0.5)
    assert_allclose(here.J[:, :, 0], [[1, 1]])
    assert_allclose(here.closure_rates(np.array([[1.0], [2.0]])), 3.0)
    assert_allclose(here.row_efforts(np.array([[[2.0]]]))[:, 0, 0], [2, 2])
