"""Closure rows come from contributors: six from a loop, one from a coupling of freedoms, placed one below the other."""

import mechanisms
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mechgraph as mg
from mechgraph.kinematics.assembly import scaled_system
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.model.toml import library_path


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
    bias = here.closure_bias(here.bias(dq, here.link_twists(dq)))
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
