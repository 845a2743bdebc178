"""Oil films: Ocvirk's steady state, Booker's mobility, orbits over a cycle.

Closed forms: Petroff, Ocvirk (NACA report 1157, 1953); mobility (D/L)^2 / pi in the middle (Booker 1965). Independent: the pressure
integrals by quadrature, an orbit led by them with another integrator.
"""

import re
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import mechgraph as mg

FILM = mg.Journal(radius=0.02, length=0.02, clearance=2e-5, viscosity=0.02)
SPEED = 100.0


def rotor(
    arm: float = 0.01, gravity: float = 0.0, turned: float = 0.0, loads: Sequence[mg.Wrench] = (), **more: object
) -> mg.Mechanism:
    """A mass on a shaft in one bearing; ``turned``: the shaft along x and y of the marker turned."""
    x = (np.cos(turned), np.sin(turned), 0)
    shaft = mg.Pair("A", "R", "frame", "shaft", point=(0, 0, 0), axis=(0, 0, 1), second=x, **more)
    links = [mg.Link("frame"), mg.Link("shaft", 1.0, (arm, 0, 0))]
    return mg.Mechanism("rotor", links, [shaft], ["A"], [*loads, mg.Gravity((0, -gravity, 0))])


def turning(m: mg.Mechanism, n: int = 48) -> mg.Solution:
    return mg.solve(m, {"A": mg.Motion(np.linspace(0, 2 * np.pi, n, endpoint=False), velocity=SPEED)})


def force(e: np.ndarray, a: float) -> np.ndarray:
    """The force of a unit squeeze in direction ``a`` over ``eta R L^3 / c^2``, by quadrature."""
    thin = np.arctan2(e[1], e[0])
    peak = [thin] if abs(np.angle(np.exp(1j * (thin - a)))) < np.pi / 2 else None

    def part(t: float, k: int) -> float:
        return float(np.cos(t - a) * (np.cos(t), np.sin(t))[k] / (1 - e[0] * np.cos(t) - e[1] * np.sin(t)) ** 3)

    ends = a - np.pi / 2, a + np.pi / 2
    if peak:
        peak = [ends[0] + (peak[0] - ends[0]) % (2 * np.pi)]
    return np.array(
        [quad(part, *ends, args=(k,), epsabs=1e-13, epsrel=1e-12, limit=400, points=peak)[0] for k in (0, 1)]
    )


def test_petroff() -> None:
    at_rest = FILM.steady(eccentricity=0.0, speed=SPEED)
    assert at_rest.torque == pytest.approx(2 * np.pi * 0.02 * SPEED * 0.02**3 * 0.02 / 2e-5, rel=1e-12)
    assert (at_rest.load, at_rest.pressure) == (0.0, 0.0)


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
def test_the_load_gives_its_eccentricity_back(speed: float) -> None:
    e = np.array([0.0, 1e-6, 0.1, 0.5, 0.9, 0.999])
    state = FILM.steady(eccentricity=e, speed=speed)
    assert np.allclose(FILM.steady(load=state.load, speed=speed).eccentricity, e, rtol=1e-12, atol=0)
    assert (state.torque * speed > 0).all()


def test_mobility_in_the_middle() -> None:
    assert np.allclose(FILM.mobility(0.0, 0.0), [4 / np.pi, 0.0], atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_mobility_against_quadrature(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, angle = 0.95 * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    e = size * np.array([np.cos(angle), np.sin(angle)])
    M = FILM.mobility(*e)
    F = force(e, np.arctan2(M[1], M[0]))
    assert abs(F[1]) < 1e-10 * F[0]
    assert np.hypot(*M) == pytest.approx((0.04 / 0.02) ** 2 / (2 * F[0]), rel=1e-10)


def test_mobility_takes_arrays() -> None:
    xi, eta = np.meshgrid(np.linspace(-0.9, 0.9, 5), [-0.3, 0.0, 0.4])
    M = FILM.mobility(xi, eta)
    assert M.shape == (2, 3, 5)
    assert np.allclose(M[:, 1, 3], FILM.mobility(xi[1, 3], eta[1, 3]), rtol=1e-13)


def test_a_steady_load_ends_in_ocvirk() -> None:
    """A load that stands still on a turning shaft: the orbit is a point, its pressure and friction those of the formulas."""
    film = turning(rotor(arm=0.0, gravity=9.81)).film("A", FILM)
    state = FILM.steady(load=9.81, speed=SPEED)
    assert film.closed
    angle = -np.pi / 2 + state.attitude  # from the load, downwards, in the sense of the rotation
    assert np.allclose(film.orbit, state.eccentricity * np.array([np.cos(angle), np.sin(angle)]), rtol=0, atol=1e-8)
    for found, formula in ((film.film, state.film), (film.pressure, state.pressure), (film.torque, state.torque)):
        assert np.allclose(found, formula, rtol=1e-6)
    assert np.allclose(film.power, state.torque * SPEED, rtol=1e-6)


def test_a_load_that_turns_with_the_shaft() -> None:
    """The film sees the mean speed of both elements relative to the load: -w/2, as a steady load at the speed w backwards."""
    film = turning(rotor(), 96).film("A", FILM)
    state = FILM.steady(load=100.0, speed=-SPEED)
    assert np.allclose(film.eccentricity, state.eccentricity, rtol=1e-7)
    assert np.allclose(film.pressure, state.pressure, rtol=1e-6)


def test_an_orbit_against_quadrature_and_another_integrator() -> None:
    film = turning(rotor(arm=0.02, gravity=300.0)).film("A", FILM)
    assert film.closed
    assert 0.3 < film.eccentricity.max() < 0.95
    unit = 0.02 * 0.02 * 0.02**3 / 2e-5**2

    def rates(t: float, e: np.ndarray) -> np.ndarray:
        # the load on the journal: the centrifugal force and the weight
        W = np.array([200 * np.cos(SPEED * t), 200 * np.sin(SPEED * t) - 300.0])
        a = np.arctan2(W[1], W[0])
        for _ in range(
            40
        ):  # direction of the squeeze whose force has the direction of the load, by Newton's method on a numerical slope
            off, aside = (np.angle(complex(*force(e, b)) / complex(*W)) for b in (a, a + 1e-5))
            a -= off / ((aside - off) / 1e-5)
            if abs(off) < 1e-10:
                break
        v = np.hypot(*W) / np.hypot(*force(e, a)) / unit
        return v * np.array([np.cos(a), np.sin(a)]) + SPEED / 2 * np.array([-e[1], e[0]])

    part = solve_ivp(rates, (0, 2 * np.pi / SPEED / 8), film.orbit[0], method="RK45", rtol=1e-7, atol=1e-9)
    assert np.allclose(part.y[:, -1], film.orbit[6], atol=1e-6)


def test_the_work_of_friction_is_the_power_lost() -> None:
    """Over a whole cycle the shaft brings what the film loses, as the load does no work on a closed orbit but what the shaft brings."""
    film = turning(rotor(arm=0.02, gravity=300.0), 192).film("A", FILM)
    e, W = film.orbit, film.load
    spline = np.gradient(np.concatenate([e[-2:], e, e[:2]]), 2 * np.pi / SPEED / 192, axis=0, edge_order=2)[2:-2]
    pressed = 2e-5 * (W * spline).sum(axis=1)
    assert np.mean(film.torque * SPEED + pressed) == pytest.approx(np.mean(film.power), rel=1e-4)


def test_links_turned_and_other_units() -> None:
    m = rotor(gravity=300.0, film=FILM)
    film, other = turning(m).film("A"), turning(rotor(gravity=300.0, turned=0.7)).film("A", FILM)
    R = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    assert np.allclose(other.orbit @ R.T, film.orbit, atol=1e-7)
    si = m.replace(units={"length": "m", "mass": "kg", "time": "s"})
    mm = turning(si.to_units(length="mm", mass="t")).film("A")
    assert np.allclose(mm.orbit, film.orbit, atol=1e-7)
    assert mm.min == pytest.approx(1e3 * film.min, rel=1e-6)
    assert np.allclose(mm.pressure, 1e-6 * film.pressure, rtol=1e-6)


def test_a_film_in_a_file(tmp_path) -> None:
    m = rotor(film=FILM)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m


def test_what_is_no_cycle_starts_in_the_middle() -> None:
    s = mg.solve(rotor(), {"A": mg.Motion(np.linspace(0, 1.0, 12), velocity=SPEED)})
    film = s.film("A", FILM)
    assert not film.closed
    assert (film.orbit[0] == 0).all()
    assert "starts in the middle" in str(film)


def test_a_load_that_does_not_return_is_no_cycle() -> None:
    angle = np.linspace(0, 2 * np.pi, 49)
    push = mg.Wrench("shaft", force=np.stack([1000 + 500 * angle, 0 * angle, 0 * angle], axis=-1), point=(0, 0, 0))
    s = mg.solve(rotor(), {"A": mg.Motion(angle, velocity=SPEED)}, loads=[push])
    with pytest.warns(mg.MechgraphWarning, match="does not return"):
        assert not s.film("A", FILM).closed


def test_a_long_bearing_warns() -> None:
    with pytest.warns(mg.MechgraphWarning, match=re.escape("length / diameter = 0.75")):
        turning(rotor()).film("A", FILM.replace(length=0.03))


def test_faults() -> None:
    with pytest.raises(mg.DeclarationError, match="type P is no journal"):
        mg.Mechanism("x", pairs=[mg.Pair("A", "P", "a", "b", point=(0, 0, 0), axis=(1, 0, 0), film=FILM)])
    with pytest.raises(mg.DeclarationError, match=r"film\.clearance"):
        rotor(film=FILM.replace(clearance=-1.0))
    s = turning(rotor())
    with pytest.raises(mg.DeclarationError, match=r"film = None: expected mg\.Journal"):
        s.film("A")
    with pytest.raises(mg.DeclarationError, match=r"no forces") as two:
        mg.kinematics(rotor(), {"A": [0.0, 1.0]}).film("A", FILM)
    assert "at least 8" in str(two.value)
    with pytest.raises(mg.DeclarationError, match="below 1"):
        FILM.mobility(0.8, 0.7)
    with pytest.raises(mg.DeclarationError, match="either eccentricity= or load="):
        FILM.steady(speed=1.0)
    with pytest.raises(mg.DeclarationError, match="speed = 0"):
        FILM.steady(speed=0.0, load=1.0)


@pytest.mark.parametrize("engine", ["dense", "compiled"])
def test_rounding_in_a_freedom_that_rests_leaves_a_cycle_one(engine: str) -> None:
    """A slide that does not move: its rates are rounding, and do not lead back to where they were."""
    m = rotor(gravity=300.0)
    slide = mg.Pair("B", "Sg", "frame", "shaft", point=(0, 0, 0.1), axis=(0, 0, 1))
    ends = [m.pairs[0].replace(type="S", axis=None, second=None), slide]
    turn = mg.Pair("T", "Fr", "frame", "shaft", point=(0, 0, 0), axis=(0.0, 0, 1))
    s = mg.solve(
        m.replace(pairs=[*ends, turn], drives=["T.Rz"]),
        {"T.Rz": mg.Motion(np.linspace(0, 2 * np.pi, 90, endpoint=False), velocity=SPEED)}, engine=engine,
    )  # fmt: skip
    assert mg.over_time(s).duration == pytest.approx(2 * np.pi / SPEED, rel=1e-9)


def test_a_load_that_is_not_unique_is_told() -> None:
    m = rotor()
    second = mg.Pair("B", "R", "frame", "shaft", point=(0, 0, 0.1), axis=(0, 0, 1))
    with pytest.raises(mg.DeclarationError, match="Fx of A is not unique"):
        turning(
            m.replace(pairs=[*m.pairs, mg.Pair("C", "R", "frame", "shaft", point=(0, 0, 0.05), axis=(0, 0, 1)), second])
        ).film("A", FILM)


def test_a_load_turning_at_half_the_speed_is_borne_by_squeeze_alone() -> None:
    """The film sees no mean speed: the journal goes the way of the load, ``de/dt I(e) = W c^2 / (eta R L^3)``, and never turns aside."""
    W, t = 100.0, np.linspace(0, np.pi, 40) / SPEED
    way = np.stack([np.cos(SPEED * t / 2), np.sin(SPEED * t / 2)], axis=-1)
    push = mg.Wrench("shaft", force=np.concatenate([W * way, 0 * way[:, :1]], axis=1), point=(0, 0, 0))
    s = mg.solve(rotor(arm=0.0, loads=[push]), {"A": mg.Motion(SPEED * t, velocity=SPEED)})
    film = s.film("A", FILM)
    assert np.allclose(film.orbit, film.eccentricity[:, None] * way, atol=1e-8)
    size = W * FILM.clearance**2 / (FILM.viscosity * FILM.radius * FILM.length**3)
    for i in (5, 20, 39):
        bears = quad(lambda e: force(np.array([e, 0.0]), 0.0)[0], 0, film.eccentricity[i], epsabs=1e-11)[0]
        assert bears == pytest.approx(size * t[i], rel=1e-7)
    assert (np.diff(film.film) < 0).all()


def test_a_study_of_the_least_film() -> None:
    """Outputs of a film by name: each variant has its own orbit, that of its clearance, and of a load that others do not have."""
    m = rotor(arm=0.0, gravity=9.81, film=FILM).replace(units={"length": "m", "mass": "kg", "time": "s"})
    motion = {"A": mg.Motion(np.linspace(0, 2 * np.pi, 8, endpoint=False), velocity=SPEED)}
    names = ["A.film.min", "A.film.pressure", "A.film.torque", "A.film.power"]
    for parameter, values in (("A.film.clearance", [1.5e-5]), ("shaft.mass", [3.0])):
        study = mg.study(m, {parameter: values}, names, sampling="grid", motions=motion)
        for i, value in enumerate(study.parameters[parameter]):
            film = FILM.replace(clearance=value) if "film" in parameter else FILM
            load = 9.81 * (value if parameter == "shaft.mass" else 1.0)
            steady = film.steady(load=load, speed=SPEED)
            assert study.outputs["A.film.min"][i] == pytest.approx(steady.film, rel=1e-6)
            assert study.outputs["A.film.pressure"][i] == pytest.approx(np.full(8, steady.pressure), rel=1e-5)
            assert study.outputs["A.film.torque"][i] == pytest.approx(np.full(8, steady.torque), rel=1e-5)
    assert list(study.units.values()) == ["m", "N/m^2", "N m", "W"]
    with pytest.raises(mg.DeclarationError, match=r"did you mean A\.film\.min"):
        mg.study(m, {"shaft.mass": [1.0]}, "A.film.mim", motions=motion)
    with pytest.raises(mg.DeclarationError, match="is no quantity"):
        mg.study(rotor(), {"shaft.mass": [1.0]}, "A.film.min", motions=motion)


def test_a_clearance_as_large_as_the_radius_is_none() -> None:
    with pytest.raises(mg.DeclarationError, match=r"clearance = 0\.03: expected less than the radius"):
        mg.Journal(radius=0.025, length=0.02, clearance=0.03, viscosity=0.01)
