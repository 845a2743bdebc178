"""Paths by the reduced form (rods and spheres as rows of points) against paths by loops of six rows: the same solution."""

from __future__ import annotations

import machines
import mechanisms as known
import numpy as np
import pytest
from attack import differences

import mechgraph as mg
import mechgraph.kinetostatics as pipeline
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinetostatics import Pipeline
from mechgraph.outcome import Options

SAME = 1e-11
Z = (0.0, 0.0, 1.0)

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")


def assert_same(m, motions, condition=1.0, **options):
    """Both forms of one call; how the reduced one did."""
    lines = [Pipeline(DriverMotion(m, motions), Options(form=form, **options)) for form in ("full", "reduced")]
    assert lines[1].reduction is not None
    full, reduced = (mg.Solution(line.run().trajectory) for line in lines)
    assert (full.status == "ok").any()
    worst, where, faults = differences(full, reduced)
    assert not faults
    size = max(float(np.nanmax(np.abs(full[p.name].velocity))) for p in m.pairs if p.type.f)
    assert worst <= SAME * condition * max(1.0, size) ** 2, f"{where}: {worst:.1e} at rates {size:.1e}"
    return reduced


WITH_FORM = [
    "rssr",
    "rcsr",
    "rcsr-csr",
    "p-sp-p",
    "p-sp-r",
    "r-sp-p",
    "r-sp-r",
    "r-sg-c",
    "r-sg-p-p",
    "r-sg-p-r",
    "r-sg-r-p",
    "r-sg-r-r",
]


@pytest.mark.parametrize("engine", ["dense", pytest.param("sparse", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", WITH_FORM)
def test_library(name: str, engine: str) -> None:
    m = mg.load(name)
    freedom = m.drives[0].freedom
    pair, j = m.freedom(freedom)
    size = 1.0 if m.pairs[pair].type.freedoms[j].turns else 0.02
    begin = m.start.get(m.full_name(freedom), 0.0)
    assert_same(m, {freedom: mg.Motion(begin + size * np.linspace(-np.pi, np.pi, 19), 1.3, 0.7)}, engine=engine)


def geared() -> mg.Mechanism:
    """Two cranks coupled one to minus two, which move a rocker and a slide by rods; the slide is on a sphere in a groove as well."""
    pairs = [
        mg.Pair("A", "R", "frame", "first", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "frame", "second", point=(1, 0, 0), axis=Z),
        mg.Pair("C", "S", "first", "bar", point=(0, 0.3, 0)),
        mg.Pair("D", "S", "bar", "rocker", point=(0.2, 1.0, 0.7)),
        mg.Pair("E", "R", "frame", "rocker", point=(0.2, 1.0, 0.0), axis=(1, 0, 0.2)),
        mg.Pair("F", "S", "rod", "second", point=(1, 0.2, 0)),
        mg.Pair("G", "S", "slide", "rod", point=(2, 0.1, 0.3)),
        mg.Pair("H", "P", "frame", "slide", point=(2, 0, 0.3), axis=(1, 0, 0)),
        mg.Pair("K", "Sg", "slide", "follower", point=(2, 0.5, 0.3), axis=(0.2, 1, 0)),
        mg.Pair("L", "C", "frame", "follower", point=(2.4, 0.7, 0), axis=Z),
    ]
    links = [
        mg.Link("frame"),
        mg.Link("rocker", mass=2.0, center=(0.2, 1, 0.3)),
        mg.Link("bar", mass=1.0, center=(0.1, 0.6, 0.4)),
    ]
    links += map(mg.Link, ["first", "second", "rod", "slide", "follower"])
    gear = mg.Coupling({"A": 2.0, "B": 1.0}, name="gear")
    return mg.Mechanism("geared", links, pairs, ["A"], [mg.Gravity((0, 0, -9.81))], couplings=[gear])


@pytest.mark.parametrize(
    ("make", "size"),
    [
        (machines.five_rods, 0.05),
        (machines.sliders, 0.1),
        (geared, 0.5),
        (known.hexapod, 0.1),
        (lambda: known.hexapod("SPS"), 0.1),
    ],
    ids=["five rods", "6-PSS", "geared", "6-UPS", "6-SPS"],
)
@pytest.mark.parametrize("engine", ["dense", pytest.param("sparse", marks=pytest.mark.slow)])
def test_several_loops(make, size, engine) -> None:
    m = make()
    assert_same(
        m, {d.freedom: machines.sine(m, d.freedom, size * np.cos(k)) for k, d in enumerate(m.drives)}, engine=engine
    )


QUICK = (0, 2, 7, 8, 10)


@pytest.mark.parametrize(
    "seed", [seed if seed in QUICK else pytest.param(seed, marks=pytest.mark.slow) for seed in range(12)]
)
def test_random_platforms(seed: int) -> None:
    m = machines.random_platforms(seed)
    assert_same(m, {"A": machines.sine(m, "A", 0.02)}, engine=("dense", "sparse")[seed % 2])


def crank_and_rocker(crank: float = 0.3) -> mg.Mechanism:
    """R-S-S-R with a crank that turns round."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "rod", point=(crank, 0, 0)),
        mg.Pair("C", "S", "rod", "rocker", point=(1.2, 0.8, 0.2)),
        mg.Pair("D", "R", "frame", "rocker", point=(1.2, 0, 0.2), axis=(0.3, 0, 1)),
    ]
    rod = mg.Link("rod", mass=1.0, center=(0.6, 0.3, 0.1), inertia=np.diag([0.1, 0.2, 0.25]))
    links = [mg.Link("frame"), mg.Link("crank"), rod, mg.Link("rocker", mass=2.0, center=(0.9, 0.4, 0.2))]
    return mg.Mechanism("crank and rocker", links, pairs, ["A"], [mg.Gravity((0, -9.81, 0))])


def test_several_turns_carry_the_spin_on() -> None:
    m = crank_and_rocker()
    found = assert_same(m, {"A": mg.Motion(np.linspace(0, 9 * np.pi, 40), 1.0, 0.2)})
    assert np.ptp(found["A"].position) > 9 * 3.14


def test_out_of_reach_is_flagged_alike() -> None:
    found = assert_same(crank_and_rocker(0.9), {"A": mg.Motion(np.linspace(-3, 3, 60), 1.0, 0.2)}, condition=1e3)
    assert set(found.status.tolist()) > {"ok"}


def test_gaps_of_several_drivers() -> None:
    """The polygon leads out of the reach of a slider's rod and back."""
    m = machines.sliders()
    way = np.concatenate([np.linspace(0, 2.2, 12), np.linspace(2.2, 0, 12)])
    motions = {f"P{k}": mg.Motion(way if k == 0 else 0 * way, 1.0, 0.0) for k in range(6)}
    assert_same(m, motions, condition=1e4)


def strut(turned: bool, aside: float = 0.0) -> mg.Mechanism:
    """A rocker moved by a cylinder between two balls; ``turned``: its slide is declared the other way round."""
    a, b = np.array((1.0, 0.2, 0.1)), np.array((0.3, 1.1, 0.4))
    along = (b - a) * (-1.0 if turned else 1.0) + (aside, 0, 0)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "tube", "crank", point=a),
        mg.Pair("P", "P", *(("piston", "tube") if turned else ("tube", "piston")), point=0.5 * (a + b), axis=along),
        mg.Pair("C", "S", "piston", "rocker", point=b),
        mg.Pair("D", "R", "frame", "rocker", point=(0, 1, 0), axis=(0.3, 0.1, 1)),
    ]
    bodies = [
        mg.Link("tube", mass=1.0, center=0.7 * a + 0.3 * b),
        mg.Link("piston", mass=0.5, center=0.2 * a + 0.8 * b),
    ]
    links = [mg.Link("frame"), mg.Link("crank"), *bodies, mg.Link("rocker", mass=2.0, center=(0.1, 1.2, 0.2))]
    return mg.Mechanism("strut", links, pairs, ["A", "P"], [mg.Gravity((0, -9.81, 0))])


@pytest.mark.parametrize("turned", [False, True])
def test_a_cylinder_is_a_rod_that_its_slide_makes_longer(turned: bool) -> None:
    m = strut(turned)
    found = assert_same(m, {"A": machines.sine(m, "A", 0.3), "P": machines.sine(m, "P", -0.2)})
    d = found.link("rocker").pose[:, :3] @ (0.3, 1.1, 0.4, 1) - found.link("crank").pose[:, :3] @ (1.0, 0.2, 0.1, 1)
    length = np.sqrt(0.49 + 0.81 + 0.09) + found["P"].position[:, 0]
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), length, atol=1e-13)


def test_a_slide_beside_the_line_is_none() -> None:
    m = strut(False, aside=1e-6)
    line = Pipeline(
        DriverMotion(m, {"A": machines.sine(m, "A", 0.3), "P": machines.sine(m, "P", -0.2)}), Options(form="reduced")
    )
    assert line.reduction is None


def test_an_unknown_form_is_one_clear_error() -> None:
    with pytest.raises(mg.DeclarationError, match="form = 'redcued': expected one of 'auto', 'full', 'reduced'"):
        Options(form="redcued")


def curved(n: int, more: int = 1) -> dict[str, mg.Motion]:
    """Motions of the sliders round a curve, ``n`` positions; ``more - 1`` between any two of these, on the chord."""
    t = np.linspace(0, 2 * np.pi, n)
    at = np.arange(more * (n - 1) + 1) / more
    return {f"P{k}": mg.Motion(np.interp(at, np.arange(n), 0.15 * (np.sin(t + k) - np.sin(k)))) for k in range(6)}


@pytest.mark.parametrize("n", [37, pytest.param(361, marks=pytest.mark.slow)])
def test_paths_of_several_drivers_that_bend(n: int) -> None:
    """Rods rest all along the polygon, not along chords across its bends: positions between leave them where they stood."""
    m = machines.sliders()
    found = assert_same(m, curved(n))
    finer = mg.kinematics(m, curved(n, more=4))
    for k in range(6):
        np.testing.assert_allclose(found.link(f"rod{k}").pose, finer.link(f"rod{k}").pose[::4], atol=SAME)


def test_the_start_alone() -> None:
    m = crank_and_rocker()
    found = assert_same(m, {"A": mg.Motion(np.zeros(1), 2.0, 0.3)})
    np.testing.assert_allclose(found.link("rod").pose, np.eye(4)[None], atol=1e-14)


def test_change_points_are_passed_alike() -> None:
    """A parallelogram whose coupler is a rod: where it is folded its branches cross."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "rod", point=(0.5, 0.8, 0)),
        mg.Pair("C", "S", "rod", "rocker", point=(2.5, 0.8, 0)),
        mg.Pair("D", "R", "frame", "rocker", point=(2, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("parallelogram", None, pairs, ["A"])
    begin = np.arctan2(0.8, 0.5)
    turn = np.linspace(0.1, 6.2, 62) - begin
    # 0.04 beside the crossing accelerations lose rounding over the cube of that
    found = assert_same(m, {"A": mg.Motion(turn, 1.0, 0.3)}, condition=100.0)
    np.testing.assert_allclose(found["D"].position, found["A"].position, atol=1e-11)


def test_variants_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    m = crank_and_rocker()
    motions = {"A": mg.Motion(np.linspace(0, 2 * np.pi, 13), 2.0, 0.3)}
    numbers = {"rod.mass": [1.0, 1.5, 2.0], "C.point.y": [0.8, 0.82, 0.84], "rocker.mass": [0.1, 0.2, 0.3]}
    outputs = ["D.position", "D.acceleration", "A.effort", "B.force"]

    def studied():
        return mg.study(m, numbers, outputs, motions=motions, sampling="grid")

    used, found = [], pipeline.follow_reduced
    monkeypatch.setattr(pipeline, "follow_reduced", lambda *given: used.append(given) or found(*given))
    reduced = studied()
    assert used
    monkeypatch.setattr(pipeline, "reduction_of", lambda *_: None)
    full = studied()
    for name in outputs:
        np.testing.assert_allclose(
            reduced.outputs[name], full.outputs[name], rtol=0, atol=SAME * np.abs(full.outputs[name]).max()
        )
