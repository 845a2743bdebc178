"""Friction by the compiled kernel against numpy's: all pairs that are data, studies, derivatives, C files, and what is left to numpy."""

import warnings

import numpy as np
import pytest
from test_machines_as_built import COEFFICIENTS, collar, shaft
from test_rolling import ball

import mechgraph as mg

ARGUMENTS = {"radius": 0.02, "length": 0.2, "width": 0.03, "thrust_radius": 0.01, "flank": 0.2}
NAMES = (
    "four-bar",
    "rcsr",
    "rssr",
    "phchc",
    "windows-2",
    "r-cp-c",
    "r-sc-c-r",
    "r-sg-r-r",
    "p-sp-r",
    "rcsr-csr",
    "haug-slider-crank",
)


def rough(m: mg.Mechanism, seed: int, many: bool) -> list[mg.Friction]:
    """Friction in every pair that takes it, with few or all arguments that it takes."""
    rng, dry = np.random.default_rng(seed), []
    for pair in m.pairs:
        mu, given = float(rng.uniform(0.02, 0.08)), {k: v * rng.uniform(0.5, 1.5) for k, v in ARGUMENTS.items()}
        given |= {"on": "ab"[seed % 2], "preload": rng.uniform(), "static": 2 * mu, "stribeck": 0.5}
        for names in ([*ARGUMENTS, "on", "preload", "static", "stribeck"] if many else [], ["radius"], []):
            kept = {name: given[name] for name in names}
            while True:
                try:
                    m.replace(loads=[mg.Friction(pair.name, mu=mu, **kept)])
                except mg.DeclarationError as error:
                    wrong = [name for name in kept if f"{name}: has no meaning" in str(error)]
                    if not wrong:
                        break
                    kept = {name: value for name, value in kept.items() if name not in wrong}
                else:
                    dry.append(mg.Friction(pair.name, mu=mu, **kept))
                    break
            if dry and dry[-1].of == pair.name:
                break
    return dry


def same(one: mg.Solution, other: mg.Solution, within: float = 1e-10, least: float = 1e-300) -> None:
    """All that friction tells is the same in two solutions."""
    assert one.status.tolist() == other.status.tolist()
    for p in one.mechanism.pairs:
        for name in ("effort", "applied_effort", "friction", "normal_forces", "sliding", "reaction", "effort_range"):
            a, b = getattr(one[p.name], name), getattr(other[p.name], name)
            np.testing.assert_allclose(
                b, a, rtol=within, atol=within * np.nanmax(np.abs(a), initial=least), err_msg=f"{p.name}.{name}"
            )
    for name, lost in one.losses.items():
        np.testing.assert_allclose(other.losses[name], lost, rtol=within, atol=within * np.nanmax(lost, initial=1e-300))


@pytest.mark.daily(11)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_as_numpy_solves_it(name: str, many: bool) -> None:
    m = mg.load(name)
    last = next(link.name for link in reversed(m.links) if link.name != m.frame)
    pull = mg.Wrench(last, force=(3, -5, 2), moment=(0.1, 0.2, -0.3), point=(0, 0, 0))
    loads = [*m.loads, pull, *rough(m, NAMES.index(name), many)]
    given = {
        d.freedom: mg.Motion(m.start.get(m.full_name(d.freedom), 0.0) + np.linspace(0, 0.3, 4), velocity=2.0, acceleration=0.3)
        for d in m.drives
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)
        one, other = (mg.solve(m, given, loads=loads, on_reach="flag", engine=e) for e in ("dense", "compiled"))
    assert other.engine == "compiled"
    same(one, other)
    good = other.status == "ok"
    assert np.nanmax(np.abs(other.checks.power[good]), initial=0.0) < 1e-12


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("aside", [False, True])
@pytest.mark.parametrize("on", "ab")
def test_what_no_load_adds_to_stays_zero_in_the_kernel_too(on: str, aside: bool) -> None:
    """A slider-crank on a tilted plane whose rough bearings have a length: sure as long as nothing acts across the plane."""
    n, across = (0.0, 0.6, 0.8), (1.0, 0.0, 0.0)
    at = [np.array(p) @ (across, np.cross(n, across), n) for p in ((0, 0, 0), (0.1, 0, 0), (0.4, 0, 0))]
    links = ("frame", "crank", "rod", "slider")
    pins = [mg.Pair(k, "R", *links[i : i + 2], point=at[i], axis=n) for i, k in enumerate("ABC")]
    loads = [mg.Wrench("slider", force=(-100.0, 0, 0), point=at[2])]
    loads += [mg.Friction(k, mu=0.1, radius=0.01, length=0.08, on=on) for k in "ABC"]
    loads += [mg.Friction("D", mu=0.1, length=0.1, width=0.03, on=on)]
    if aside:
        loads.append(mg.Wrench("rod", force=tuple(5.0 * np.array(n)), point=at[1]))
    guide = mg.Pair("D", "P", "frame", "slider", point=at[2], axis=across)
    m = mg.Mechanism("slider-crank", pairs=[*pins, guide], drives=["A"], loads=loads)
    s = mg.solve(m, {"A": mg.Motion([0.5], 1.0, 0.0)}, engine="dense")
    hot = mg.compile(m)
    found = hot([0.5], [1.0], [0.0])
    assert (s.status[0], hot.status) == (("friction not determined", "friction not solved") if aside else ("ok", "ok"))
    np.testing.assert_allclose(found, s["A"].effort[0], rtol=1e-12)


@pytest.mark.usefixtures("compiled")
def test_what_the_kernel_leaves_open_numpy_says() -> None:
    """Positions at rest, in motion and in the other sense in one call; a collar that jams has its factor."""
    m = shaft(COEFFICIENTS[0], ((0, -100.0), (0.1, 0, 0)), static=0.3)
    given = {"A": mg.Motion([0.0, 0.1, 0.2], velocity=[0.0, 1.0, -1.0])}
    one, other = (mg.solve(m, given, engine=e) for e in ("dense", "compiled"))
    same(one, other)
    low, high = other["A"].effort_range[0, 0]
    assert high - low == pytest.approx(2 * 0.02 * np.sin(np.arctan(0.3)) * 100.0, rel=1e-12)
    with pytest.raises(mg.FrictionError) as caught:
        mg.solve(collar(0.3), {"D": mg.Motion(0.0, velocity=1.0)}, engine="compiled")
    assert caught.value.kind == "jams"
    assert caught.value.factor == pytest.approx(0.1 / (2 * 0.3 * 0.2), rel=1e-6)


@pytest.mark.usefixtures("compiled")
def test_hot_and_in_studies() -> None:
    """A mechanism kept ready, its derivatives by a coefficient and a length, and variants over both, against single solves."""
    m = mg.load("rcsr")
    pull = mg.Wrench(m.pairs[-1].a, force=(3, -5, 2), point=(0, 0, 0))
    m = m.replace(loads=[*m.loads, pull, *rough(m, 3, True)])
    drive, k = (
        m.full_name(m.drives[0].freedom),
        next(i for i, load in enumerate(m.loads) if isinstance(load, mg.Friction)),
    )
    given = {drive: mg.Motion(m.start.get(drive, 0.0) + 0.2, velocity=2.0)}

    def effort(of: mg.Mechanism) -> float:
        return float(mg.solve(of, given, engine="dense")[drive.partition(".")[0]].effort[0])

    hot = mg.compile(m)
    at = float(m.start.get(drive, 0.0) + 0.2)
    assert hot(at, 2.0)[0] == pytest.approx(effort(m), rel=1e-12)
    for name, value in ((f"loads[{k}].mu", m.loads[k].mu), (f"loads[{k}].radius", m.loads[k].radius)):
        slope = hot.gradient(f"{drive}.effort", [name])[0]
        part, load = name.partition(".")[2], m.loads[k]

        def other(v: float, part: str = part, load: mg.Friction = load) -> float:
            return effort(m.replace(loads=[*m.loads[:k], load.replace(**{part: v}), *m.loads[k + 1 :]]))

        h = 1e-4 * value
        assert slope == pytest.approx((other(value + h) - other(value - h)) / (2 * h), rel=1e-6)
        pair = drive.partition(".")[0]
        ways, output = {name: [value, 1.5 * value]}, f"{pair}.effort"
        found = mg.study(m, ways, output, motions=given, sampling="grid", engine="compiled").outputs[output]
        assert found.ravel() == pytest.approx([effort(m), other(1.5 * value)], rel=1e-11)
    jammed = mg.compile(collar(0.3))
    assert np.isnan(jammed(0.0, 1.0)).all()
    assert jammed.status == "friction not solved"


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("seed", range(2))
def test_feet_that_may_open(seed: int) -> None:
    """Three feet at random on a floor that a plate slides and turns on; also pressed so that one would have to pull."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(-1, 1, (3, 2))
    on = {"axis": (0, 0, 1), "closed": "force", "restitution": 0.1}
    feet = [mg.Pair(f"K{i}", "Sp", "ground", "plate", point=(*p, 0), **on) for i, p in enumerate(at)]
    guide = mg.Pair("G", "Fr", "ground", "plate", point=(0, 0, 0.2), axis=(0, 0, 1))
    push = mg.Wrench("plate", force=(*rng.uniform(-20, 20, 2), -100), point=(*at.mean(axis=0), 0))
    loads = [push, *(mg.Friction(p.name, mu=0.3) for p in feet)]
    m = mg.Mechanism("plate", pairs=[*feet, guide], drives=["G.Tx", "G.Ty", "G.Rz"], loads=loads)
    moves = {
        n: mg.Motion([0.0, 0.1], velocity=v) for n, v in zip(("G.Tx", "G.Ty", "G.Rz"), (0.7, -0.3, 0.5), strict=True)
    }
    s = mg.solve(m, moves, engine="dense")
    same(s, mg.solve(m, moves, engine="compiled"), 1e-12, least=100.0)
    efforts = [s["G"].effort[1, guide.freedom_names.index(n)] for n in moves]
    np.testing.assert_allclose(mg.compile(m)([0.1] * 3, [0.7, -0.3, 0.5], [0.0] * 3), efforts, rtol=1e-12)


def stage() -> mg.Mechanism:
    """Two gears that rub, on journals that rub too."""
    teeth = mg.SpurGears("t", "p", "w", teeth=(20, 40), module=0.002)
    links = [mg.Link("frame"), *(mg.Link(n, 1.0, (x, 0, 0), 0.01 * np.eye(3)) for n, x in (("p", 0.0), ("w", 0.06)))]
    pairs = [mg.Pair(n, "R", "frame", n, point=(x, 0, 0), axis=(0, 0, 1)) for n, x in (("p", 0.0), ("w", 0.06))]
    dry = [mg.Friction("p", mu=0.1, radius=0.01), mg.Friction("t", mu=0.08), mg.Friction("w", mu=0.1, radius=0.01)]
    return mg.Mechanism(
        "stage", links, pairs, couplings=[teeth], loads=[mg.Effort("p", 3.0), mg.Effort("w", 1.0), *dry]
    )


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    "machine", [ball(0.3, 0.9), ball(0.3, 0.9, restitution=0.0), stage()], ids=("ball", "opens", "gears")
)
def test_what_may_roll_slips_in_time_as_by_numpy(machine: mg.Mechanism) -> None:
    """The kernel carries it while nothing rolls."""
    one, other = (mg.respond(machine, [0.0, 0.1, 0.2], engine=engine) for engine in ("auto", "dense"))
    assert (one.engine, other.engine) == ("compiled", "dense")
    for p in machine.pairs:
        for name in ("position", "velocity", "acceleration", "friction", "normal_forces"):
            a, b = getattr(one[p.name], name), getattr(other[p.name], name)
            np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11 * np.abs(b).max(initial=1e-300))
