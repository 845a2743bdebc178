"""Transmission and deviation angles: planar four-bar, slider-crank, the three-link mechanisms of the papers, gears."""

import json

import numpy as np
import pytest
from program import invoke

import mechgraph as mg


def apex(s: mg.Solution, pair: str) -> np.ndarray:
    """Origin of marker B of a pair."""
    p = s.mechanism.pair(pair)
    X = s.link(p.b).pose
    return X[..., :3, :3] @ np.asarray(p.markers[1].point) + X[..., :3, 3]


def between(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Angle of two lines, 0 to pi/2."""
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), np.abs((u * v).sum(axis=-1)))


def test_planar_four_bar() -> None:
    """The angle between coupler and rocker, extreme where the crank lies along the ground."""
    s = mg.solve(mg.load("four-bar"))
    t = mg.transmission(s, "D")
    A, B, C, D = (apex(s, name) for name in "ABCD")
    assert np.allclose(t.transmission_angle, between(C - B, C - D), atol=1e-7)
    assert np.allclose(t.transmission_angle + t.deviation_angle, np.pi / 2)
    a, b, c, d = (float(np.linalg.norm((q - p)[0])) for p, q in ((A, B), (B, C), (C, D), (A, D)))
    extremes = [np.arccos((b**2 + c**2 - (d + sign * a) ** 2) / (2 * b * c)) for sign in (-1, 1)]
    assert t.transmission_angle.min() == pytest.approx(min(min(v, np.pi - v) for v in extremes), abs=1e-3)


def test_driven_from_the_other_end() -> None:
    """From the rocker to the crank: the angle between coupler and crank, zero at the dead points of the rocker."""
    s = mg.solve(mg.load("four-bar"))
    t = mg.transmission(s, "A", driver="D")
    A, B, C = (apex(s, name) for name in "ABC")
    known = np.isfinite(t.index)
    assert known.mean() > 0.9
    assert np.allclose(t.transmission_angle[known], between(C - B, B - A)[known], atol=1e-6)


@pytest.mark.parametrize("turned", [(), ("C",), ("F",), ("C", "F"), ("D",), ("g",)])
def test_an_output_that_is_pushed_in_two_places(turned: tuple[str, ...]) -> None:
    """A six-bar driven between two couplers, and an output with a gear and a pin: whichever link of a pair, or gear, is named first.

    Forces on the output do the work of its effort, one for a unit; they could do their sizes times speeds.
    """

    def pair(name: str, a: str, b: str, point: tuple[float, float]) -> mg.Pair:
        return mg.Pair(name, "R", *((b, a) if name in turned else (a, b)), point=(*point, 0), axis=(0, 0, 1))

    six = [
        pair("D", "frame", "out", (0, 0)),
        pair("C", "out", "K", (1, 1)),
        pair("F", "out", "L", (-0.6, 1.2)),
        pair("H", "K", "M", (2, 2)),
        pair("G", "L", "M", (0.2, 2.6)),
        pair("B", "K", "crank", (2.6, 0.8)),
        pair("A", "frame", "crank", (2.4, 0)),
    ]
    five = [
        pair("D", "frame", "out", (0, 0)),
        pair("A", "frame", "wheel", (3, 0)),
        pair("C", "out", "K", (0.5, 0.8)),
        pair("B", "wheel", "L", (3.4, 0.9)),
        pair("E", "K", "L", (1.6, 2.1)),
    ]
    Z = (0, 0, 1)
    gears = [mg.Gear("p", "out", 20, (0, 0, 0), Z, module=0.1), mg.Gear("w", "wheel", 40, (3, 0, 0), Z, module=0.1)]
    mesh = mg.Mesh("g", *(("w", "p") if "g" in turned else ("p", "w")))
    for m, driver, pins in (
        (mg.Mechanism("six-bar", pairs=six, planar=True, drives=["G"], frame="frame"), "G", ("C", "F")),
        (mg.Mechanism("geared", pairs=five, gears=gears, couplings=[mesh], drives=["E"], frame="frame"), "E", ("C",)),
    ):
        s = mg.solve(m.replace(loads=[mg.Effort("D", 1.0)]), {driver: 0.02}, redundant="minimum_norm")
        could = 0.0
        for name in pins:
            at = s.link("out").pose @ np.append(np.asarray(m.pair(name).point), 1.0)
            could += np.linalg.norm(s[name].total[3:]) * np.linalg.norm(at[:3])
        if m.couplings:
            could += np.linalg.norm(s.coupling("g").force) * np.linalg.norm(s.coupling("g").point)
        assert mg.transmission(s, "D").index == pytest.approx(1.0 / could, rel=1e-9)


def test_slider_crank() -> None:
    """The deviation angle of the slider is that of the rod to its way."""
    s = mg.solve(mg.load("slider-crank"))
    m = s.mechanism
    slider = next(p for p in m.pairs if p.type.symbol == "P")
    t = mg.transmission(s, slider.name)
    crank, wrist = (apex(s, name) for name in [p.name for p in m.pairs if p.name != slider.name][1:])
    along = np.asarray(slider.axis if slider.axis is not None else slider.markers[0].axis, dtype=float)
    assert np.allclose(t.deviation_angle, between(wrist - crank, np.broadcast_to(along, wrist.shape)), atol=1e-7)


@pytest.mark.parametrize("name", ["r-sp-p", "r-sp-r", "p-sp-r"])
def test_sphere_on_a_plane(name: str) -> None:
    """The deviation angle between the normal of the plane and the velocity of the output where the sphere touches it."""
    s = mg.solve(mg.load(name))
    t = mg.transmission(s, "C")
    out = s.mechanism.pair("C")
    u = np.asarray(out.axis) / np.linalg.norm(out.axis)
    point = apex(s, "B")
    v = np.broadcast_to(u, point.shape) if out.type.symbol == "P" else np.cross(u, point - np.asarray(out.point))
    n = s.contact("B").normal
    assert np.allclose(t.deviation_angle, between(n, v), atol=1e-7)
    assert np.allclose(s.contact("B").pressure_angle("output"), between(n, v), atol=1e-12)


def test_sphere_in_a_groove() -> None:
    """R-Sg-C, loaded in its turn and free to slide: the force is square to the groove and to the axis, as its slide carries none."""
    s = mg.solve(mg.load("r-sg-c"))
    t = mg.transmission(s, "C.Rz")
    pair, out = s.mechanism.pair("B"), s.mechanism.pair("C")
    u = np.asarray(out.axis) / np.linalg.norm(out.axis)
    X = s.link("output").pose
    point = apex(s, "B")
    groove = X[..., :3, :3] @ (np.asarray(pair.axis) / np.linalg.norm(pair.axis))
    v = np.cross(u, point - np.asarray(out.point))
    assert np.allclose(t.deviation_angle, between(np.cross(groove, u), v), atol=1e-6)


def test_gears() -> None:
    """A pair of spur gears deviates by its pressure angle."""
    z = (0, 0, 1)
    m = mg.Mechanism(
        "gears",
        pairs=[
            mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=z),
            mg.Pair("B", "R", "frame", "wheel", point=(0.06, 0, 0), axis=z),
        ],
        couplings=[mg.SpurGears("g", "A", "B", teeth=(20, 40), pressure_angle=np.deg2rad(25))],
        drives=["A"],
    )
    t = mg.transmission(mg.solve(m, {"A": [0.0, 1.0]}), "B")
    assert np.allclose(np.rad2deg(t.deviation_angle), 25.0)


def test_a_driver_near_its_dead_point_transmits_next_to_nothing() -> None:
    """Slider drives crank: the angle between rod and crank, which passes zero twice a turn."""
    s = mg.solve(mg.load("slider-crank"))
    slider, *_ = (p.name for p in s.mechanism.pairs if p.type.symbol == "P")
    t = mg.transmission(s, "A", driver=slider)
    ground, crank, wrist = (apex(s, p.name) for p in s.mechanism.pairs if p.name != slider)
    known = np.isfinite(t.index)
    assert known.mean() > 0.9
    assert np.allclose(t.transmission_angle[known], between(wrist - crank, crank - ground)[known], atol=1e-6)
    assert np.sin(between(wrist - crank, crank - ground)).min() < 0.02


def test_positions_that_were_not_solved_have_none() -> None:
    m = mg.load("rcsr")
    s = mg.solve(m, {"O1": np.deg2rad(np.arange(150.0, 220.0, 10.0))}, on_reach="flag")
    t = mg.transmission(s, "O4")
    assert (np.isfinite(t.index) == (s.status == "ok")).all()
    assert "transmission angle [deg]" in str(t)
    assert t.to_dict()["least"] == pytest.approx(np.nanmin(t.transmission_angle))


def test_bad_outputs() -> None:
    s = mg.solve(mg.load("four-bar"), {"A": 0.3})
    with pytest.raises(mg.DeclarationError, match=r"output: .*X"):
        mg.transmission(s, "X")
    with pytest.raises(mg.DeclarationError, match="another freedom than a driver"):
        mg.transmission(s, "A")


def test_on_the_command_line() -> None:
    result = invoke("solve", "four-bar", "--transmission", "D")
    assert result.exit_code == 0, result.output
    assert "From A.Rz to D.Rz, links at rest and without mass." in result.stdout
    told = json.loads(invoke("solve", "four-bar", "--transmission", "D", "--json").stdout)
    angles = mg.transmission(mg.solve(mg.load("four-bar")), "D").transmission_angle
    assert told["transmission"] == [
        {
            "drivers": ["A.Rz"],
            "output": "D.Rz",
            "least": pytest.approx(angles.min()),
            "greatest": pytest.approx(angles.max()),
        }
    ]
