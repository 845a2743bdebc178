"""The compiled kernel: what it says is what numpy says, what it refuses numpy takes over, and what it cannot carry is named."""

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from attack import (
    conditions,
    differences,
    four_bars,
    just_out_of_reach,
    nearly_folded,
    solved,
    warned,
    without_numbers,
    wrapped,
)
from ladder import LADDER, four_bar
from machines import five_rods
from mechanisms import Z, hexapod
from strategies import closed_mechanism, motions, with_drives, with_loads, with_loads_on_links

import mechgraph as mg
from mechgraph import outcome
from mechgraph.kernel import build, tables
from mechgraph.kernel.tables import pointer
from mechgraph.kinematics import assembly
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinetostatics import Pipeline
from mechgraph.modes import compiled_tracks
from mechgraph.modes.circuits import Circuits
from mechgraph.modes.homotopy import Leg, Ways
from mechgraph.outcome import Options
from mechgraph.synthesis import fitness
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.fits import Fit
from mechgraph.synthesis.legs import Arrow, CompiledArrow, TaskLeg
from mechgraph.synthesis.system import RowProblem

pytestmark = [pytest.mark.usefixtures("compiled"), pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")]

SAME = 1e-10
"""Difference of engines over the condition (largest rate for unit rates of the drivers)."""


def agreed(m, given, **how):
    """Both engines on the same job; the one that ran."""
    one, other = solved(m, given, engine="compiled", **how), solved(m, given, engine="dense", **how)
    if isinstance(one, mg.DeclarationError) and "does not serve" in str(one):
        return "refused"
    if isinstance(one, Exception) or isinstance(other, Exception):
        assert type(one) is type(other)
        assert without_numbers(one) == without_numbers(other)
        return "error"
    worst, where, faults = differences(one, other)
    assert not faults
    assert worst <= SAME * max(1.0, conditions(other)[other.status == "ok"].max(initial=1.0)), where
    assert warned(m, given, engine="compiled", **how) == warned(m, given, engine="dense", **how)
    return one.engine


def swing(m, count=5, size=0.3):
    """A motion of all drives from the start, with rates, on either side of it."""
    out = {}
    for i, drive in enumerate(m.drives):
        at = m.start.get(m.full_name(drive.freedom), 0.0)
        reach = size if m.turns(drive.freedom) else 0.05 * size
        out[drive.freedom] = mg.Motion(at + reach * np.sin(np.linspace(-0.5, 1.0 + i, count)), 3.0 + i, 1.5 - i)
    return out


SERVED = {
    "7r",
    "bennett",
    "four-bar",
    "p-sp-r",
    "phchc",
    "r-cp-c",
    "r-sc-c-r",
    "r-sg-c",
    "rcsr",
    "rcsr-csr",
    "rssr",
    "slider-crank",
    "windows-2",
}
"""Members of the library with every kind of pair of constant screws, planar, spatial, overconstrained, of two loops."""


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", sorted(SERVED))
def test_library(name):
    m = mg.load(name)
    assert agreed(m, swing(m)) == "compiled"


@pytest.mark.parametrize("name", sorted({*mg.library()} - SERVED))
@pytest.mark.slow
def test_rest_of_the_library(name):
    m = mg.load(name)
    if m.drives:
        agreed(m, swing(m))


@pytest.mark.seeds(12)
def test_random_mechanisms(seed):
    m = with_drives(closed_mechanism(seed), seed)
    if m is None:
        pytest.skip("no drives make it determinate")
    rng = np.random.default_rng((seed, 31))
    t = np.linspace(0, rng.choice([0.1, 1.0, 3.0]), int(rng.choice([1, 6])))
    redundant = str(rng.choice(["nan", "minimum_norm"]))
    agreed(with_loads(m, seed), motions(m, seed, t, size=float(rng.choice([0.08, 0.5]))), redundant=redundant)


def test_several_drives_and_loops():
    m = hexapod()
    assert agreed(m, swing(m, size=0.5)) == "compiled"


@pytest.mark.daily(1)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_integer_geometry_beside_change_points(side):
    """A parallelogram: its change points, at which the branches cross, are left to the follower that passes them."""
    m = mg.Mechanism(
        "parallelogram",
        [mg.Link(name) for name in ("frame", "crank", "coupler", "rocker")],
        [
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "crank", "coupler", point=(0, side, 0), axis=Z),
            mg.Pair("C", "R", "coupler", "rocker", point=(2, side, 0), axis=Z),
            mg.Pair("D", "R", "frame", "rocker", point=(2, 0, 0), axis=Z),
        ],
        ["A"],
    )
    assert agreed(m, {"A": np.linspace(0.0, 1.0, 4)}) == "compiled"
    assert agreed(m, {"A": np.linspace(0.0, 2.5, 4)}) == "dense"


@pytest.mark.daily(4)
@pytest.mark.parametrize("margin", [1e-1, 1e-3, 1e-6])
@pytest.mark.parametrize("seed", range(3))
def test_branches_are_kept_where_they_come_near(seed, margin):
    """Against the closed form of the four-bar that misses its stretched position by a margin, in steps up to a right angle."""
    bar = nearly_folded(np.random.default_rng((seed, 32)), margin)
    for step in (0.1, 0.7, np.pi / 2):
        q = np.arange(0.0, 2 * np.pi, step)
        s = mg.kinematics(four_bars([bar], 1.0), {"A": q}, engine="compiled", on_reach="flag")
        found = s["D0"].position[:, 0] - (bar.rocker(1.0 + q) - bar.rocker(1.0))
        assert np.abs(wrapped(found[s.status == "ok"])).max() < 1e-12 / margin
        assert s.engine == ("compiled" if margin > 0.01 else s.engine)


def test_an_end_of_the_reach_is_named_by_numpy():
    m = four_bars([just_out_of_reach(np.random.default_rng(33), 0.3)], 1.0)
    assert agreed(m, {"A": np.linspace(0.0, 6.0, 7)}) == "dense"
    with pytest.raises(mg.ReachError, match=r"is not reachable .* stops at A"):
        mg.solve(m, {"A": np.linspace(0.0, 6.0, 7)}, engine="compiled")


@pytest.mark.parametrize("engine", ["auto", "compiled", "dense"])
def test_a_dead_point_at_the_start_is_one_in_every_engine(engine):
    """Of a crank that is stationary where coupler and rocker are in line, also as a change of a mechanism that the kernel has solved."""
    at = {"A": (0, 0, 0), "B": (0, 3, 0), "C": (2.4, 1.2, 0), "D": (4, 0, 0)}
    m = mg.Mechanism("in line", pairs=loop_of(at), drives=["A"])
    regular = m.replace(pairs=loop_of(at | {"C": (3.0, 3.0, 0)}))
    assert mg.solve(regular, {"A": 0.1}).status == "ok"
    for one in (m, regular.replace(pairs=m.pairs)):
        with pytest.raises(mg.DeadPointError, match=r"A.Rz is stationary there"):
            mg.solve(one, {"A": [0.0, 0.05]}, engine=engine)


def loop_of(at):
    """Turning pairs around one loop of links."""
    ends = zip(("o", "a", "b", "c"), ("a", "b", "c", "o"), strict=True)
    return [mg.Pair(k, "R", *both, point=at[k], axis=(0, 0, 1)) for k, both in zip(at, ends, strict=True)]


def test_rotation_vectors_go_on_beyond_half_a_turn():
    """On the way to a position alone as well as over all of them."""
    m = mg.load("haug-slider-crank")
    (drive,) = m.drives
    at = m.start.get(m.full_name(drive.freedom), 0.0) + np.array([0.5, 2.0, 3.5, 6.0])
    for q in (at, at[-1:]):
        assert agreed(m, {drive.freedom: q}) == "compiled"


def uneven_rod():
    """RSSR with a coupler whose mass center is off its line, under gravity and a couple about it; its drive makes more than a turn."""
    m = mg.load("rssr")
    links = [link.replace(center=(0.1, 0.2, 0.3), mass=2.0) if link.name == "coupler" else link for link in m.links]
    loads = [mg.Gravity((1.0, 2.0, -9.81)), mg.Wrench("coupler", moment=(1.0, 0.5, 2.0))]
    return m.replace(links=links, loads=loads)


def bars_on_a_plane():
    """Two bars that a driver moves against each other, and that turn idly as one."""
    pairs = [
        mg.Pair("A", "R", "frame", "b1", point=(-0.13, -0.45, 0), axis=Z),
        mg.Pair("B", "R", "b1", "b2", point=(0.4, 0.3, 0.1), axis=Z),
        mg.Pair("C", "Cp", "b2", "frame", point=(0.9, -0.2, 0.6), axis=Z, second=(0.6, 0.8, 0)),
    ]
    return mg.Mechanism("bars", None, pairs, ["B"], loads=[mg.Wrench("b2", force=(1.0, 2.0, 0.5), point=(0.1, 0, 0))])


def washer():
    """A washer that slides idly between two pistons."""
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "arm", "washer", point=(0.3, 0.1, 0.2), axis=(1, 0.5, 0.2)),
        mg.Pair("C", "P", "washer", "arm", point=(0.5, 0.3, 0.1), axis=(1, 0.5, 0.2)),
    ]
    links = [mg.Link("frame"), mg.Link("arm"), mg.Link("washer", 1.5, (0.2, 0.1, 0.3))]
    return mg.Mechanism("washer", links, pairs, ["A"], loads=[mg.Gravity((1.0, -9.81, 0.5))])


@pytest.mark.daily(3)
@pytest.mark.parametrize(
    ("make", "size"),
    [(uneven_rod, 4.0), (bars_on_a_plane, 1.5), (washer, 4.0), (lambda: hexapod("SPS"), 0.8), (five_rods, 0.8)],
    ids=["rod", "bars", "washer", "hexapod", "suspension"],
)
def test_passive_links_are_at_rest_and_held_as_by_numpy(make, size):
    """One or several links in a motion, turns and slides, load-bearing ones; far from the start, and wherever else positions are."""
    m = make()
    given = swing(m, 7, size)
    assert agreed(m, given) == "compiled"
    whole = mg.kinematics(m, given, engine="compiled")
    if len(m.drives) > 1:  # they are led along the polygon of their positions
        return
    ((name, motion),) = given.items()
    for some in ([6], [0, 4]):
        part = mg.kinematics(m, {name: np.asarray(motion.position)[some]}, engine="compiled")
        assert part.engine == "compiled"
        for link in m.links:
            np.testing.assert_allclose(part.link(link.name).pose, whole.link(link.name).pose[some], atol=1e-11)


@pytest.mark.parametrize("seed", [40, 64, 94, 213])
def test_random_mechanisms_with_passive_freedoms(seed):
    """Spins between spheres, turns over planes, slides; several at once."""
    m = with_loads_on_links(with_drives(closed_mechanism(seed), seed), seed)
    assert mg.solve(m, motions(m, seed, np.linspace(0, 0.1, 2), size=0.08), engine="dense").passive_effort
    assert agreed(m, motions(m, seed, np.linspace(0, 1.0, 5), size=0.08)) == "compiled"


def test_nothing_is_driven():
    pairs = [mg.Pair("A", "W", "frame", "post", point=(0, 0, 0))]
    post = mg.Mechanism("post", [mg.Link("frame"), mg.Link("post", 2.0, (0.3, 0, 1))], pairs)
    assert agreed(post.replace(loads=[mg.Gravity((1.0, 0, -9.81))]), {}) == "compiled"


def test_check_follows_no_motion():
    with pytest.raises(mg.DeclarationError, match="the kernel follows motions and decides no rank"):
        mg.check(mg.load("four-bar"), engine="compiled")


def loads_of(m):
    """Loads of every kind that is numbers."""
    a, b = m.links[1].name, m.links[2].name
    first, last = m.freedom_names()[0], m.freedom_names()[-1]
    return [
        mg.Gravity((1.0, -2.0, -9.81)),
        mg.Wrench(a, force=(1.0, 2.0, 3.0), moment=(0.1, 0.2, 0.3), point=(0.01, 0.02, 0.03)),
        mg.Wrench(b, force=(-1.0, 0.5, 2.0), moment=(0.3, -0.1, 0.2), point=(0.1, -0.2, 0.05), frame="link"),
        mg.Effort(last, 0.7),
        mg.Spring(a, m.frame, (0.3, 0.1, 0.0), (-0.2, 0.4, 0.3), 12.0, 0.1, 0.5),
        mg.TorsionSpring(first, 3.0, 0.2, 0.4),
        mg.Damper(last, coefficient=0.3),
        mg.Damper((a, b, (0.0, 0.3, 0.2), (0.5, -0.1, 0.1)), coefficient=0.8),
    ]


@pytest.mark.parametrize("name", ["four-bar", "rcsr-csr", "slider-crank"])
def test_loads_that_are_numbers(name):
    m = mg.load(name)
    m = m.replace(loads=loads_of(m))
    assert agreed(m, swing(m)) == "compiled"
    line = Pipeline(DriverMotion(m, swing(m)), Options())
    known = tables.layout(line.system, line.columns, line.passive)
    assert tables.tables(known, line.system, line.x[:, None], m.loads) is not None


def tabled_loads(m):
    """Tables over coordinates and rates, in freedoms and between points, of either interpolation, held at their ends or not."""
    place, more = np.linspace(-8.0, 8.0, 9), np.random.default_rng(5).normal(size=9)
    first, last = m.pairs[0].name, m.pairs[-1].name
    links = m.links[0].name, m.links[2].name, (0.3, 2.0, 0.1), (0.2, 0.1, 0.0)
    return [
        mg.ForceLaw(first, law=mg.ForceTable(x=place, force=more), free=0.2, scale=1.7),
        mg.ForceLaw(last, law=mg.ForceTable(v=[-30, -1, 0, 2, 30], force=more[:5], interpolation="cubic")),
        mg.ForceLaw(*links, law=mg.ForceTable(x=[0, 0.2, 3, 90], force=more[:4], interpolation="cubic"), free=0.1),
        mg.ForceLaw(*links, law=mg.ForceTable(v=[-0.1, 0.1], force=[1.0, -2.0], outside="hold"), scale=-0.4),
        mg.ForceLaw(first, law=mg.ForceTable(x=[0.05, 0.1], force=[3.0, 9.0], outside="hold")),
    ]


@pytest.mark.parametrize("name", ["four-bar", "slider-crank"])
def test_force_tables(name):
    m = mg.load(name)
    for load in tabled_loads(m):
        assert agreed(m.replace(loads=[load]), swing(m)) == "compiled"
    m = m.replace(loads=tabled_loads(m))
    c = mg.compile(m)
    c(c.tables.home + 0.3, 2.0, 0.5)
    for number in ("loads[0].scale", "loads[0].free", "loads[2].free"):
        slope, middle, h = c.gradient(f"{c.drives[0]}.effort", [number]), c.parameters[number], 1e-5
        efforts = []
        for sense in (1, -1):
            c.parameters[number] = middle + sense * h
            efforts.append(c(c.tables.home + 0.3, 2.0, 0.5))
        c.parameters[number] = middle
        c(c.tables.home + 0.3, 2.0, 0.5)
        np.testing.assert_allclose(slope, (efforts[0] - efforts[1]) / (2 * h), rtol=1e-6, atol=1e-8)


def test_beyond_a_force_table_numpy_says_where():
    m = mg.load("four-bar").replace(loads=[mg.ForceLaw("A", law=mg.ForceTable(x=[0.0, 1.0], force=[1.0, 2.0]))])
    with pytest.raises(mg.DeclarationError, match=r"x = 1\.5 lies outside of the table"):
        mg.solve(m, {"A": [0.5, 1.5]}, engine="compiled")
    c = mg.compile(m)
    assert np.isnan(c(1.5)).all()
    assert c.status == "not finite"
    assert c(0.5) == pytest.approx(-1.5)
    grid = mg.ForceLaw("A", law=mg.ForceTable(x=[-9.0, 9.0], v=[-9.0, 9.0], force=[[1.0, 2.0], [3.0, 5.0]]))
    assert agreed(m.replace(loads=[grid]), swing(m)) == "compiled"  # its states, the forces by numpy


def test_other_loads_on_the_same_start():
    """Tables are kept with a start, which mechanisms under other loads share."""
    m = mg.load("four-bar")
    for load in (mg.Effort("D", 1.0), mg.Effort("D", 3.0), mg.Gravity((0, -5.0, 0))):
        one, other = (
            mg.solve(m, {"A": [0.1, 0.2]}, loads=[load], engine=engine)["A"].effort for engine in ("compiled", "dense")
        )
        np.testing.assert_allclose(one, other, rtol=1e-10)


@pytest.mark.parametrize("actuate", [None, ["D"]])
def test_forces_that_the_kernel_does_not_give(actuate):
    """Functions, arrays over positions, other freedoms that take the efforts, other methods: by numpy, at the states of the kernel."""
    m = mg.load("four-bar")
    table = [
        mg.Effort("D", np.linspace(0.0, 1.0, 5)),
        mg.Wrench("coupler", moment=lambda pose, twist, t: pose[..., :3, 0]),
    ]
    assert agreed(m.replace(loads=table), swing(m), actuate=actuate) == "compiled"
    assert agreed(m, swing(m), method="newton_euler", actuate=actuate) == "compiled"


def test_a_freedom_about_any_line_of_its_marker():
    """A user's pair: a helical turn about a line askew in its marker, between two others; the kernel's tables turn about axes alone."""
    w = np.array([1.0, 2.0, 2.0]) / 3.0
    v = np.cross([0.2, -0.1, 0.3], w) + 0.05 * w
    askew = mg.PairType("Ha", freedoms=[mg.Freedom("Rw", (*w, *v))])
    chain = mg.Mechanism(
        "open",
        [mg.Link("frame"), mg.Link("a", 1.0, (0.1, 0.2, 0.3)), mg.Link("b", 2.0, (0.5, 0.1, 0.0))],
        [
            mg.Pair("P1", askew, "frame", "a", point=(0.1, 0.0, 0.2), axis=(0, 1, 1)),
            mg.Pair("P2", "U", "a", "b", point=(0.4, 0.1, 0.0), axis=(1, 0, 0), second=(0, 1, 0)),
        ],
        ["P1", "P2.Rz", "P2.Rx"],
        loads=[mg.Gravity((0, 0, -9.81))],
    )
    assert agreed(chain, swing(chain, size=1.5)) == "compiled"


def ring_on_a_slider():
    """A ring that both slides and turns idly between two coaxial cylinders."""
    pairs = [
        mg.Pair("A", "P", "frame", "slider", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("B", "C", "slider", "ring", point=(0.2, 0, 0), axis=(1, 0, 0)),
        mg.Pair("C", "C", "ring", "slider", point=(0.4, 0, 0), axis=(1, 0, 0)),
    ]
    return mg.Mechanism("ring", None, pairs, ["A"])


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: mg.load("geneva"), r"pair 'C' \(Ps\) travels along a curve"),
        (ring_on_a_slider, "a link has several passive motions"),
    ],
    ids=["geneva", "ring"],
)
def test_what_it_cannot_carry_is_named(make, why):
    m = make()
    with pytest.raises(mg.DeclarationError, match=why):
        mg.solve(m, swing(m), engine="compiled")
    assert mg.solve(m, swing(m)).engine == "dense"


def test_a_changed_mechanism_is_closed_in_the_kernel(monkeypatch):
    m = mg.load("7r")
    pair = m.pairs[1]
    point = (0.051, *pair.on_a.point[1:])
    longer = m.replace(
        pairs=[m.pairs[0], pair.replace(on_a=mg.Marker(point, pair.on_a.axis, pair.on_a.second)), *m.pairs[2:]]
    )
    alone = mg.solve(longer, {"O1": 0.2}, engine="dense")
    mg.solve(m, {"O1": 0.2})
    monkeypatch.setattr(assembly, "close", None)
    s = mg.solve(longer.replace(name="again"), {"O1": 0.2})
    for one in m.pairs:
        np.testing.assert_allclose(s[one.name].position, alone[one.name].position, atol=1e-12)


def test_auto_is_numpy_where_no_library_is(monkeypatch):
    m = mg.load("four-bar")
    monkeypatch.setattr(outcome, "at_hand", lambda: None)
    assert mg.solve(m, swing(m)).engine == "dense"


def test_auto_takes_the_kernel_where_it_serves():
    m = mg.load("four-bar")
    build.built()
    assert mg.solve(m, swing(m)).engine == "compiled"
    assert mg.kinematics(m, swing(m)).engine == "compiled"


def test_beyond_the_tolerance_numpy_says_how_far_the_path_led():
    pairs = [p.replace(axis=(1e-4, 0, 1)) if p.name == "C" else p for p in mg.load("four-bar").pairs]
    m = mg.load("four-bar").replace(pairs=pairs)
    texts = []
    for engine in ("compiled", "dense"):
        with pytest.raises(mg.MechgraphError) as error:
            mg.solve(m, {"A": np.linspace(0, 1, 5)}, tol=2e-5, engine=engine)
        texts.append(without_numbers(error.value))
    assert texts[0] == texts[1]


def test_record_and_tables_have_the_layout_of_the_library():
    """The places of all parts of a record as the library counts them; ``I`` and ``P`` end where its sections end."""
    m = mg.load("rssr")
    line = Pipeline(DriverMotion(m, swing(m)), Options())
    known = tables.layout(line.system, line.columns, line.passive)
    I, (P,) = tables.tables(known, line.system, line.x[:, None], m.loads)
    places = (ctypes.c_int * (len(tables.PARTS) + 1))()
    build.built().mgk_record(ctypes.c_void_p(I.ctypes.data), places)
    assert list(places) == [known.places[name].start for name in tables.PARTS] + [known.record(True)]
    assert P[0] == line.system.par.L


def test_a_state_that_stays_hot():
    """``mgk_solve`` led on from state to state, in the units of the declaration; a refused call leaves the state where it was."""
    m = mg.load("rcsr-csr")
    line = Pipeline(DriverMotion(m, swing(m)), Options())
    known = tables.layout(line.system, line.columns, line.passive)
    I, (P,) = tables.tables(known, line.system, line.x[:, None], m.loads)
    library = build.built()
    state = np.empty(ctypes.c_size_t(library.mgk_state_size(pointer(I))).value // 8 + 1)
    assert library.mgk_start(pointer(I), pointer(P), pointer(state)) == 0
    ((name, motion),) = swing(m).items()
    s = mg.solve(m, {name: motion}, engine="dense")
    v, a = np.array([3.0]), np.array([1.5])
    effort, reaction, position = np.zeros(1), np.zeros((len(m.pairs), 6)), np.zeros(line.system.n_freedoms)
    for i, q in enumerate(np.asarray(motion.position)):
        for bad in (np.array([np.nan]), np.array([q + 40.0])):
            call = [pointer(part) for part in (I, P, state, bad, v, a, effort, reaction, position)]
            assert library.mgk_solve(*call) != 0
        call = [pointer(part) for part in (I, P, state, np.array([q]), v, a, effort, reaction, position)]
        assert library.mgk_solve(*call) == 0
        pair = m.freedom(m.full_name(name))[0]
        np.testing.assert_allclose(effort, s[m.pairs[pair].name].effort[i, :1], rtol=1e-10)
        np.testing.assert_allclose(
            reaction, [s[p.name].reaction[i] for p in m.pairs], atol=1e-10 * np.abs(reaction).max()
        )
        np.testing.assert_allclose(position, np.concatenate([s[p.name].position[i] for p in m.pairs]), atol=1e-10)


@pytest.mark.parametrize("fields", [("length[0]", "twist[3]", "link2.mass"), ("link1.mass", "link3.mass")])
def test_studies(fields):
    """Variants that differ in geometry, or in masses alone."""
    m = mg.load("rcsr")
    given = {"O1": mg.Motion(np.deg2rad([150.0, 170.0, 200.0]), 0.1, 0.2)}
    nominal = {"length[0]": 0.5, "twist[3]": np.deg2rad(15), "link1.mass": 2.0, "link2.mass": 5.0, "link3.mass": 5.0}
    ways = {name: scipy.stats.uniform(0.99 * nominal[name], 0.02 * nominal[name]) for name in fields}
    names = ["O1.effort", "O3.force", "O4.position"]
    one, other = (mg.study(m, ways, names, n=6, seed=1, motions=given, engine=e) for e in ("compiled", "dense"))
    assert not one.failed.any()
    for name in names:
        np.testing.assert_allclose(one.outputs[name], other.outputs[name], rtol=1e-9, atol=1e-9)


# --- tracks of synthesis and of assemblies -------------------------------------------------------------------------------

KINDS_OF_TASKS = [
    "R-R dyad, 5 poses",  # a rod in a plane
    "slider-crank function up to a factor, 5 pairs",  # what is asked up to a factor
    "geared five-bar path, 3 points, timed",  # a coupling
    "four-bar, function and path, 3 rows",  # rows of several shapes
    "spherical R-R, 5 orientations",  # axes that are sought
    "RCCC, turns and slides at 3 positions",  # loops in space, and dependent equations
    "RSSR-SC, 3 poses",  # balls, and links that turn about themselves
    "four-bar function by markers, 3 pairs",  # places on each link by itself
    "S-S dyad, 7 poses",
    *("a rod that turns about itself", "a plane in space"),
]


def leg_of(name: str) -> tuple[TaskLeg, np.ndarray, np.ndarray, np.ndarray]:
    """A way between random members of the class of a rung, three states near a solution at its begin, places and tracks."""
    m, task, unknown = (LADDER | OWN)[name]()[:3]
    rng = np.random.default_rng(4)
    of = TaskClass(RowProblem(m, task, unknown), rng)
    (begin, end), x = of.random_closed(rng, 2)
    aside = 1e-6 * (rng.normal(size=(len(x), 3)) + 1j * rng.normal(size=(len(x), 3)))
    return of.leg(begin, end), of.normal(x[:, :1] + aside), np.full(3, 1e-6), np.arange(3)


def parallel() -> tuple[mg.Mechanism, Any, list[str]]:
    """A planar four-bar declared in space, with three dependent equations a row."""
    task = mg.function("A", "D", [[0, 0], [0.3, 0.2], [0.7, 0.3]])
    return four_bar().replace(planar=False), task, ["B.point.x", "C.point.x"]


def turning_rod() -> tuple[mg.Mechanism, Any, list[str]]:
    """RSSR, the balls of which are placed on each link by itself, so that its rod turns about itself and stays a link."""
    ball = {"on_a": mg.Marker((0.5, 0.4, 0.1)), "on_b": mg.Marker((0, 0, 0))}
    pairs = [
        mg.Pair("O", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0.2, 1)),
        mg.Pair("P", "S", "crank", "rod", **ball),
        mg.Pair("Q", "S", "rod", "rocker", on_a=mg.Marker((1.1, 0.1, 0.8)), on_b=mg.Marker((1.6, 0.5, 0.9))),
        mg.Pair("R", "R", "frame", "rocker", point=(2, 0.2, 0.5), axis=(0, 1, 0.4)),
    ]
    m = mg.Mechanism("RSSR", pairs=pairs, drives=["O"])
    return (
        m,
        mg.function("O", "R", [[0, 0], [0.3, 0.1], [0.5, 0.2]]),
        ["P.on_a.point.x", "P.on_a.point.y", "Q.on_b.point.x"],
    )


def of_points() -> tuple[mg.Mechanism, Any, list[str]]:
    """A four-bar and points of which nothing tells the crank angles."""
    points = [[1.5, 1.2], [1.3, 1.3], [1.1, 1.3], [0.9, 1.2]]
    return four_bar(), mg.path("coupler.tip", points), ["A.point", "B.point", "C.point", "D.point", "coupler.tip"]


OWN = {"a rod that turns about itself": turning_rod, "a plane in space": parallel, "a path": of_points}


def near(a: Any, b: Any, part: float) -> bool:
    return bool(np.abs(np.subtract(a, b)).max() < part * np.abs(b).max())


@pytest.mark.parametrize("name", KINDS_OF_TASKS)
def test_the_kernel_steps_as_numpy_does(name: str) -> None:
    leg, x, t, tracks = leg_of(name)
    plain, fast = Arrow(leg, t, tracks, x), CompiledArrow(leg, t, tracks, x)
    idle = plain.idle()
    # what a loop leaves open is taken to third order in either way
    assert near(fast.newton(idle), plain.newton(idle), 1e-4)
    assert near(fast.rates(idle)[0], plain.rates(idle)[0], 1e-9)
    assert near(fast.noise, plain.noise, 1e-12)
    assert near(fast.matrix, plain.matrix, 1e-12)


@pytest.mark.parametrize("name", KINDS_OF_TASKS)
def test_the_kernel_corrects_as_numpy_does(name: str) -> None:
    leg, x, t, tracks = leg_of(name)
    idle, dt = np.zeros((3, 0, 0)), np.full(3, 0.5 + 0.1j)
    fast = leg.corrected(x, t, dt, tracks, idle)
    rows, vars(leg)["compiled"] = leg.compiled, None
    plain = Ways.corrected(leg, x, t, dt, tracks, idle)
    assert rows is not None
    assert near(fast.x, plain.x, 1e-9)
    assert near(fast.v, plain.v, 1e-7)
    assert near(fast.sizes[0], plain.sizes[0], 1e-3)
    assert near(fast.noise, plain.noise, 1e-3)


@pytest.mark.parametrize(
    "name", ["slider-crank function up to a factor, 5 pairs", "R-Sp-R function, 6 pairs", "a path"]
)
def test_the_kernel_closes_rows_of_fits_as_numpy_does(name: str) -> None:
    m, task, unknown = (LADDER | OWN)[name]()[:3]
    fit = Fit(RowProblem(m, task, unknown), task)
    z = fit.z0[:, None] + np.random.default_rng(0).uniform(-0.05, 0.05, (len(fit.z0), 5))
    theta = fit.theta[:, :, None] + 0.02 * np.arange(fit.rows)[:, None, None] * np.ones(5)
    x = np.broadcast_to(fit.p.at_rest[:, None, None], (len(fit.p.at_rest), fit.rows, 5))
    assert fit.compiled is not None
    here, came = fit.closed(z, theta, x)
    vars(fit)["compiled"] = None
    there, plain = fit.closed(z, theta, x)
    assert came.any()
    assert np.array_equal(came, plain)
    for what in ("x", "matrix", "by_drivers", "by_unknowns"):
        a, b = getattr(here, what), getattr(there, what)
        a, b = (v[:, came] if what == "x" else v[came] for v in (a, b))
        assert near(a, b, 1e-11)
    assert np.abs(here.residual[came]).max() < 1e-12


@pytest.mark.parametrize(
    "name", ["four-bar function, 5 pairs", "R-Sp-R function, 6 pairs", "geared five-bar path, 3 points, timed"]
)
def test_circuits_have_the_steps_and_motions_of_numpy(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = list[Circuits]()
    monkeypatch.setattr(fitness, "Circuits", lambda *of: made.append(Circuits(*of)) or made[-1])
    m, task, unknown, _ = LADDER[name]()
    found = mg.synthesize(m, task, unknown)
    assert all(one.branch is not None for one in found.fitness)
    of = made[0]
    aside = of.s.advance(of.a.x, 1e-6 * np.random.default_rng(0).normal(size=(of.s.n_freedoms, of.a.x.shape[1])))
    (fast, here), of.compiled = of.at(aside, of.a.case), None
    plain, there = of.at(aside, of.a.case)
    assert near(fast, plain, 1e-4)
    assert np.abs(np.abs((here.t * there.t).sum(axis=0)) - 1.0).max() < 1e-9


def test_curves_of_rates_are_led_by_numpy() -> None:
    assert leg_of("R-R dyad, 2 poses and a velocity")[0].equations.compiled is None


@pytest.mark.parametrize("name", ["R-R dyad, 4 poses", "four-bar function by markers, 3 pairs"])
def test_without_a_kernel_the_same_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m, task, unknown, _ = LADDER[name]()
    fast = mg.synthesize(m, task, unknown)
    monkeypatch.setattr(compiled_tracks.build, "installed", lambda: None)
    plain = mg.synthesize(m, task, unknown)
    assert np.allclose(np.sort_complex(plain.values.ravel()), np.sort_complex(fast.values.ravel()), atol=1e-10)
    assert plain.total == fast.total


def test_a_search_that_ended_by_its_number_of_tracks_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
    m, task, unknown = parallel()
    for module in ("mechgraph.modes.start_sets", "mechgraph.synthesis.solve"):
        monkeypatch.setattr(f"{module}.MOST_TRACKED", 1)
    said: list[list[str]] = [[], []]
    first, second = (mg.synthesize(m, task, unknown, progress=lines.append) for lines in said)
    assert first.completeness == second.completeness == "searched"
    assert (first.total, first.evidence[0]) == (second.total, second.evidence[0])
    assert any("first task" in line for line in said[0])
    assert not any("first task" in line for line in said[1])


@pytest.mark.parametrize("name", ["7r", "rssr"])
def test_assemblies_are_led_as_numpy_leads_them(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m, led = mg.load(name), []

    def both(self: Leg, *args: Any) -> Any:
        fast = leads(self, *args)
        if len(led) < 3 and self.equations.compiled is not None:
            plain = Ways.corrected(self, *args)
            good = plain.sizes[0] < 1e-2
            led.append(near(fast.x[:, good], plain.x[:, good], 1e-6) and near(fast.v[:, good], plain.v[:, good], 1e-3))
        return fast

    leads = Leg.corrected
    monkeypatch.setattr(Leg, "corrected", both)
    mg.assemblies(m, {m.drives[0].freedom: 0.3})
    assert led == [True] * 3
