"""Figures over time and over a cycle against closed forms, momentum by differences, and changes of energy."""

from __future__ import annotations

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)
M, R, G = 3.0, 0.8, 10.0
"""Mass, radius of its center, gravity: of a crank in a vertical plane."""


def crank(
    loads: tuple[mg.Wrench | mg.Gravity | mg.Damper, ...] = (mg.Gravity((0, -G, 0)),), inertia: float = 0.0
) -> mg.Mechanism:
    links = [mg.Link("frame"), mg.Link("crank", M, (R, 0, 0), np.diag([1.0, 1.0, 1.0]) * inertia)]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z)]
    return mg.Mechanism("crank", links, pairs, ["A"], list(loads), units={"length": "m", "mass": "kg", "time": "s"})


def uneven(n: int, turns: float = 1.0) -> np.ndarray:
    """Angles that crowd on one side of the turn, the end left out."""
    u = np.arange(n) / n
    return 2 * np.pi * turns * (u + 0.1 * np.sin(2 * np.pi * u) / turns)


def test_a_weight_on_a_crank_by_hand() -> None:
    """Torque ``m g r cos q``: its RMS over time is ``m g r / sqrt 2`` whatever the spacing of the angles, its mean and work are 0."""
    w = 4.0
    s = mg.solve(crank(), {"A": mg.Motion(uneven(90), velocity=w)})
    c = mg.over_time(s)
    torque = c.efforts["A.Rz"]
    assert c.closed
    assert c.revolutions == pytest.approx(1.0, abs=1e-12)
    assert c.duration == pytest.approx(2 * np.pi / w, rel=1e-12)
    assert torque.rms == pytest.approx(M * G * R / np.sqrt(2), rel=1e-7)
    assert abs(torque.mean) < 1e-6 * M * G * R
    assert (torque.peak, torque.at) == (pytest.approx(M * G * R), 0)
    samples = np.sqrt(np.mean(s["A"].effort ** 2))
    assert (
        abs(samples - M * G * R / np.sqrt(2)) > 0.01 * samples
    )  # what the mean of unevenly spaced samples makes of it
    assert c.powers["A.Rz"].rms == pytest.approx(w * M * G * R / np.sqrt(2), rel=1e-7)
    assert abs(c.work["A.Rz"]) < 1e-6 * M * G * R
    assert abs(c.balance) < 1e-12
    # the shaking force: weight and m r w^2 that goes round
    assert c.shaking["Fx"].rms == pytest.approx(M * R * w**2 / np.sqrt(2), rel=1e-7)
    assert c.shaking["Fy"].mean == pytest.approx(-M * G, rel=1e-7)
    assert c.shaking["|F|"].greatest == pytest.approx(M * (G + R * w**2), rel=1e-3)
    assert c.shaking["Mz"].rms == pytest.approx(M * G * R / np.sqrt(2), rel=1e-7)
    about = mg.over_time(s, about=(2.0, 0, 0)).shaking["Mz"]
    assert about.mean == pytest.approx(2.0 * M * G, rel=1e-6)


def test_what_a_damper_takes_a_revolution() -> None:
    """``2 pi c w`` a revolution, at any number of revolutions, with the end in or out."""
    c0, w = 0.3, 5.0
    for n, turns in ((41, 1.0), (80, 2.0)):
        for angles in (uneven(n, turns), np.append(uneven(n, turns), 2 * np.pi * turns)):
            c = mg.over_time(mg.solve(crank((mg.Damper("A", coefficient=c0),)), {"A": mg.Motion(angles, velocity=w)}))
            assert c.closed
            assert c.revolutions == pytest.approx(turns, abs=1e-12)
            assert c.work_per_revolution["A.Rz"] == pytest.approx(2 * np.pi * c0 * w, rel=1e-9)
            assert c.work_per_revolution["loads[0] damper"] == pytest.approx(-2 * np.pi * c0 * w, rel=1e-9)
            assert c.powers["A.Rz"].mean == pytest.approx(c0 * w**2, rel=1e-9)
            assert abs(c.balance) < 1e-12


def four_bar(angles: np.ndarray, w: float) -> mg.Solution:
    m = mg.load("four-bar").replace(loads=[])
    return mg.solve(m, {"A": mg.Motion(angles, velocity=w)}, redundant="minimum_norm")


def test_the_shaking_force_is_what_momentum_loses() -> None:
    """Minus the rate of momentum and of moment of momentum, by differences of positions alone (planar: about z)."""
    w, n = 3.0, 720
    q = 2 * np.pi * np.arange(n) / n
    s = four_bar(q, w)
    dt = 2 * np.pi / n / w

    def rate(y: np.ndarray) -> np.ndarray:
        """First derivative of a periodic row, sixth order."""
        return sum(k * (np.roll(y, -i, 0) - np.roll(y, i, 0)) for i, k in ((1, 45), (2, -9), (3, 1))) / (60 * dt)

    momentum, moment = np.zeros((n, 3)), np.zeros(n)
    for link in s.mechanism.links:
        if link.mass > 0:
            p = s.link(link.name).center
            v = rate(p)
            turned = np.unwrap(np.arctan2(s.link(link.name).pose[:, 1, 0], s.link(link.name).pose[:, 0, 0]))
            around = rate(turned - q * round((turned[-1] - turned[0]) / (2 * np.pi))) + w * round(
                (turned[-1] - turned[0]) / (2 * np.pi)
            )
            inertia = 0.0 if link.inertia is None else link.inertia[2][2]
            momentum += link.mass * v
            moment += link.mass * np.cross(p, v)[:, 2] + inertia * around
    force, couple = -rate(momentum), -rate(moment)
    c = mg.over_time(s)
    assert c.shaking["|F|"].peak == pytest.approx(np.linalg.norm(force, axis=1).max(), rel=1e-7)
    assert c.shaking["|F|"].rms == pytest.approx(np.sqrt((force**2).sum(axis=1).mean()), rel=1e-7)
    assert c.shaking["Fx"].rms == pytest.approx(np.sqrt((force[:, 0] ** 2).mean()), rel=1e-7)
    assert c.shaking["Mz"].peak == pytest.approx(np.abs(couple).max(), rel=1e-6)
    assert c.shaking["Mz"].rms == pytest.approx(np.sqrt((couple**2).mean()), rel=1e-6)


def test_uneven_positions_of_a_linkage_give_the_figures_of_many_even_ones() -> None:
    w = 3.0
    fine, few = (mg.over_time(four_bar(q, w)) for q in (np.linspace(0, 2 * np.pi, 1440, endpoint=False), uneven(120)))
    for one, other in ((fine.efforts, few.efforts), (fine.powers, few.powers), (fine.shaking, few.shaking)):
        for name in one:
            scale = max(float(one[name].peak), 1e-9)
            assert abs(one[name].rms - other[name].rms) < 1e-4 * scale, name
            assert abs(one[name].rms - other[name].rms) < 2 * float(other[name].error) + 1e-6 * scale, name
            sized = name.startswith("|")  # the size of a vector has a corner where it passes zero
            assert abs(one[name].mean - other[name].mean) < (1e-3 if sized else 1e-4) * scale, name


def test_work_is_the_change_of_energy_where_the_crank_gains_speed() -> None:
    """From rest by a law of time: the driver's work is the kinetic energy and the height gained."""
    t = np.linspace(0.0, 0.5, 401)
    q = 0.9 * np.sin(3 * t) ** 2
    m = crank(inertia=0.2)
    s = mg.solve(m, {"A": mg.Motion(q, 0.9 * 3 * np.sin(6 * t), 0.9 * 18 * np.cos(6 * t), t)})
    c = mg.over_time(s)
    assert not c.closed
    assert np.isfinite(c.revolutions) or c.duration == 0.5
    w = 0.9 * 3 * np.sin(6 * t[-1])
    kinetic = 0.5 * (M * R**2 + 0.2) * w**2
    assert c.kinetic_change == pytest.approx(kinetic, rel=1e-12)
    np.testing.assert_allclose(s.kinetic_energy[-1], kinetic)
    assert c.work["A.Rz"] == pytest.approx(kinetic + M * G * R * np.sin(q[-1]), rel=1e-8)
    assert c.work["loads[0] gravity"] == pytest.approx(-M * G * R * np.sin(q[-1]), rel=1e-8)
    assert abs(c.balance) < 1e-8


def test_times_follow_from_a_rate_that_varies() -> None:
    """``q' = 2 + sin q``: a turn takes ``2 pi / sqrt 3``."""
    q = np.linspace(0, 2 * np.pi, 181)
    c = mg.over_time(mg.solve(crank(), {"A": mg.Motion(q, 2 + np.sin(q), (2 + np.sin(q)) * np.cos(q))}))
    assert c.closed
    assert c.duration == pytest.approx(2 * np.pi / np.sqrt(3), rel=1e-8)
    assert abs(c.balance) < 1e-6


def test_a_response_has_figures_over_its_time() -> None:
    m = crank((mg.Gravity((0, -G, 0)), mg.Damper("A", coefficient=2.0))).replace(drives=[])
    r = mg.respond(m, np.linspace(0, 1.5, 301), rtol=1e-10, atol=1e-12)
    c = mg.over_time(r)
    assert not c.closed
    assert not c.efforts
    assert c.duration == 1.5
    assert c.kinetic_change == pytest.approx(r.energy.kinetic[-1] - r.energy.kinetic[0])
    assert c.work["loads[1] damper"] == pytest.approx(r.energy.work[-1], rel=1e-6)
    assert c.work["loads[0] gravity"] == pytest.approx(r.energy.potential[0] - r.energy.potential[-1], rel=1e-6)
    np.testing.assert_allclose(r.kinetic_energy, r.energy.kinetic, atol=1e-12)


@pytest.mark.parametrize(
    ("angles", "closed", "revolutions"),
    [
        (np.arange(0, 360, 10), True, 1.0), (np.arange(0, 361, 10), True, 1.0), (np.arange(0, 301, 10), False, 300 / 360),
        (np.arange(360, 0, -10), True, 1.0), (np.arange(5, 725, 10), True, 2.0), (np.arange(0, 720, 30), True, 2.0),
    ],
)  # fmt: skip
def test_whole_cycles(angles: np.ndarray, closed: bool, revolutions: float) -> None:
    velocity = 3.0 if angles[-1] > angles[0] else -3.0
    c = mg.over_time(mg.solve(crank(), {"A": mg.Motion(np.deg2rad(angles), velocity=velocity)}))
    assert bool(c.closed) == closed
    assert c.revolutions == pytest.approx(revolutions)


def test_what_does_not_return_is_no_cycle() -> None:
    """A crank on a slider that goes on: a whole turn of the one is no cycle of the other."""
    links = [mg.Link("frame"), mg.Link("slide", 1.0, (0, 0, 0)), mg.Link("crank", M, (R, 0, 0))]
    pairs = [
        mg.Pair("S", "P", "frame", "slide", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("A", "R", "slide", "crank", point=(0, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("both", links, pairs, ["S", "A"])
    q = np.deg2rad(np.arange(0, 361, 5))
    steady = {"A": mg.Motion(q, 2.0), "S": mg.Motion(np.cos(q), -2 * np.sin(q), -4 * np.cos(q))}
    assert mg.over_time(mg.solve(m, steady)).closed
    assert not mg.over_time(mg.solve(m, {"A": mg.Motion(q, 2.0), "S": mg.Motion(q, 2.0)})).closed


def test_cases_each_have_their_own() -> None:
    w = np.array([[2.0], [4.0]])
    c = mg.over_time(
        mg.solve(crank(), {"A": mg.Motion(np.tile(uneven(60), (2, 1)), velocity=np.broadcast_to(w, (2, 60)))})
    )
    np.testing.assert_allclose(c.duration, [np.pi, np.pi / 2])
    np.testing.assert_allclose(c.shaking["Fx"].rms, M * R * w[:, 0] ** 2 / np.sqrt(2), rtol=1e-5)
    assert c.closed.tolist() == [True, True]
    assert "2 cases" in str(c)


def test_what_has_no_time_or_no_forces_is_refused() -> None:
    m = crank()
    q = uneven(12)
    for s, words in (
        (mg.solve(m, {"A": q}), "the positions have no times. Pass t="),
        (mg.solve(m, {"A": 0.3}), "one position has no duration"),
        (mg.kinematics(m, {"A": mg.Motion(q, 1.0)}), r"no forces: use solve\(\)"),
        (mg.solve(m, {"A": mg.Motion(q, 1.0, t=np.zeros(12))}), "do not rise"),
    ):
        with pytest.raises(mg.DeclarationError, match=words):
            mg.over_time(s)
    with pytest.raises(mg.DeclarationError, match="about"):
        mg.over_time(mg.solve(m, {"A": mg.Motion(q, 1.0)}), about=(1, 2))


def test_drivers_that_disagree_about_time() -> None:
    links = [mg.Link("frame"), mg.Link("one", 1.0, (1, 0, 0)), mg.Link("two", 1.0, (2, 0, 0))]
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "one", "two", point=(1.5, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("arm", links, pairs, ["A", "B"])
    q = np.linspace(0, 1, 20)
    with pytest.raises(mg.DeclarationError, match=r"A.Rz and B.Rz disagree about the time"):
        mg.over_time(mg.solve(m, {"A": mg.Motion(q, 1.0), "B": mg.Motion(q, 2.0)}))
    assert mg.over_time(mg.solve(m, {"A": mg.Motion(q, 1.0), "B": mg.Motion(2 * q, 2.0)})).duration == pytest.approx(
        1.0
    )


def test_a_few_positions_say_how_uncertain_they_leave_it() -> None:
    m = crank((mg.Damper("A", coefficient=1.0), mg.Gravity((0, -G, 0))))
    c = mg.over_time(mg.solve(m, {"A": mg.Motion(np.deg2rad([0, 100, 200, 300]), 2.0)}))
    assert c.efforts["A.Rz"].error > 0.01 * c.efforts["A.Rz"].rms
    assert "±" in str(c)


def test_positions_without_a_value_leave_figures_open() -> None:
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "crank", "coupler", point=(0, 1, 0), axis=Z),
        mg.Pair("C", "R", "coupler", "rocker", point=(2, 1, 0), axis=Z), mg.Pair("D", "R", "frame", "rocker", point=(2, 0, 0), axis=Z),
    ]  # fmt: skip
    m = mg.Mechanism("parallelogram", pairs=pairs, drives=["A"], loads=[mg.Effort("D", 1.0)])
    s = mg.solve(m, {"A": mg.Motion(np.deg2rad(np.arange(0, 360, 45)), velocity=1)})
    c = mg.over_time(s)
    assert np.isnan(c.efforts["A.Rz"].rms)
    assert np.isnan(c.balance)
    assert np.isnan(c.work["A.Rz"])


def test_it_can_be_read() -> None:
    text = str(mg.over_time(mg.solve(crank(), {"A": mg.Motion(uneven(90), velocity=4.0)})))
    assert "1.5708 s, over a whole cycle of 1 revolution;" in text
    assert "effort of A.Rz [N m]" in text
    assert "Work per revolution" in text


def test_teeth_and_strands_have_figures_and_columns() -> None:
    """A weight on the wheel turns it with m g r cos q: ``N = |T| / r_b``, strands ``T0 +- T / (2 r)``."""
    w, r, d, teeth = 4.0, 0.1, 0.3, (40, 40)
    links = [mg.Link("frame"), mg.Link("p"), mg.Link("w", M, (d + R, 0, 0))]
    pairs = [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=Z) for k, x in (("p", 0), ("w", d))]
    gears = [
        mg.Gear(k, k, n, (x, 0, 0), Z, module=d / 40) for (k, x), n in zip((("p", 0), ("w", d)), teeth, strict=True)
    ]
    stage = mg.Mechanism(
        "stage", links, pairs, ["p"], [mg.Gravity((0, -G, 0))], gears=gears, couplings=[mg.Mesh("m", "p", "w")],
    )  # fmt: skip
    turn = {"p": mg.Motion(uneven(90), velocity=w)}
    couplings = mg.over_time(s := mg.solve(stage, turn)).couplings
    rb = d / 2 * np.cos(np.deg2rad(20))
    assert list(couplings) == ["m normal force"]
    assert couplings["m normal force"].rms == pytest.approx(M * G * R / rb / np.sqrt(2), rel=1e-6)
    np.testing.assert_allclose(
        s.columns()["m normal force"], np.abs(M * G * R * np.cos(s["w"].position[:, 0])) / rb, rtol=1e-9
    )
    assert "Gears and belts" in str(s)
    assert "m force" in s.columns(["contacts"])
    pulleys = [mg.Pulley(k, k, (x, 0, 0), Z, radius=r) for k, x in (("p", 0), ("w", d))]
    belt = mg.BeltDrive("B", over=["p", "w"], pretension=500.0, toothed=False)
    m = stage.replace(gears=pulleys, couplings=[belt], loads=[mg.Gravity((0, -G, 0)), mg.Friction("B", mu=0.5)])
    s = mg.solve(m, turn)
    couplings = mg.over_time(s).couplings
    assert list(couplings) == ["B tension p-w", "B tension w-p", "B slip margin p", "B slip margin w"]
    pull = M * G * R * np.cos(turn["p"].position) / (2 * r)
    np.testing.assert_allclose(s.columns()["B tension p-w"], 500.0 - pull, rtol=1e-9)
    low = np.min(np.exp(0.5 * np.pi) * (500 - np.abs(pull)) / (500 + np.abs(pull)) - 1)
    assert couplings["B slip margin w"].least == pytest.approx(low, rel=1e-9)
    assert couplings["B tension w-p"].mean == pytest.approx(500.0, rel=1e-7)
