"""Forces of gears, racks and belts in the compiled kernel: those of numpy, in calls, studies, files of C and derivatives."""

import numpy as np
import pytest
import scipy
from attack import differences
from strategies import body, pose, unit
from test_c_file import entered, library_of
from test_c_file import solved as run_c
from test_compile import beside
from test_gears import planetary

import mechgraph as mg

pytestmark = [pytest.mark.usefixtures("compiled"), pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")]

STAGES = ("spur", "ring", "bevel", "worm", "belt", "mesh", "rack")


def random_train(seed: int, stages: tuple[str, ...] = ()) -> mg.Mechanism:
    """Shafts on the frame, each driven by the one before through a gear or belt of a random kind, somewhere in space, under loads."""
    rng = np.random.default_rng(seed)
    stages = stages or tuple(rng.choice(STAGES, size=rng.integers(1, 4)).tolist())
    p, z = rng.normal(size=3) * 0.1, unit(rng)
    axes, couplings, gears, kinds = [(p, z)], [], [], ["R"]
    for i, kind in enumerate(stages):
        e = unit(rng)
        e = e - z * (e @ z)
        e /= np.linalg.norm(e)
        t, a, b, name = np.cross(z, e), f"S{i}", f"S{i + 1}", f"g{i}"
        za, zb = int(rng.integers(17, 30)), int(rng.integers(35, 70))
        sense = rng.choice([-1.0, 1.0])
        module, helix = 0.002, float(rng.choice([0.0, 0.3]))
        if kind in ("spur", "ring", "mesh"):
            inner = kind == "ring"
            far = p + e * module * (zb - za if inner else zb + za) / 2 / np.cos(helix) + z * rng.normal() * 0.01
            if kind == "mesh":
                at = p + z * ((far - p) @ z)
                gears += [
                    mg.Gear(a + "m", f"l{i}", za, at, z, module=module, helix_angle=helix),
                    mg.Gear(b + "m", f"l{i + 1}", zb, far, z, module=module, helix_angle=-helix),
                ]
                couplings.append(mg.Mesh(name, a + "m", b + "m"))
            else:
                couplings.append(mg.SpurGears(name, a, b, teeth=(za, zb), helix_angle=helix, internal=inner))
            p, z = far, sense * z
        elif kind == "bevel":
            couplings.append(mg.BevelGears(name, a, b, teeth=(za, zb), module=module, spiral_angle=helix))
            p, z = p + 0.1 * z + 0.1 * e, sense * e
        elif kind == "worm":
            couplings.append(mg.WormGear(name, a, b, teeth=(2, zb), radius=0.01, left_hand=bool(helix)))
            p, z = p + 0.05 * e, sense * t
        elif kind == "belt":
            couplings.append(mg.Belt(name, a, b, radii=(0.03, 0.05), crossed=bool(helix)))
            p, z = p + 0.3 * e, sense * z
        else:
            couplings.append(mg.Rack(name, a, b, radius=0.02))
            p, z = p + 0.02 * e + 0.1 * t, sense * t
        axes.append((p, z))
        kinds.append("P" if kind == "rack" else "R")
        if kind == "rack":
            break
    pairs = []
    for i, ((at, axis), kind) in enumerate(zip(axes, kinds, strict=True)):
        ends = ("frame", f"l{i}") if rng.random() < 0.5 else (f"l{i}", "frame")
        pairs.append(mg.Pair(f"S{i}", kind, *ends, point=tuple(at), axis=tuple(axis)))
    links = [mg.Link("frame"), *(body(rng, f"l{i}", at, 0.1) for i, (at, _) in enumerate(axes))]
    loads = [
        mg.Gravity(tuple(rng.normal(size=3))),
        mg.Effort(pairs[-1].name, float(rng.choice([-1, 1]) * rng.uniform(1, 9))),
    ]
    order = rng.permutation(len(pairs)) if len(stages) > 1 else range(len(pairs))
    m = mg.Mechanism(
        "train", links, [pairs[i] for i in order], drives=["S0"], couplings=couplings, gears=gears, loads=loads
    )
    return m.moved(pose(rng))


def differ(m: mg.Mechanism, given: dict[str, mg.Motion], **how) -> float:
    """The worst difference of the kernel to numpy, forces of couplings too."""
    one, other = (mg.solve(m, given, engine=engine, **how) for engine in ("compiled", "dense"))
    worst, where, faults = differences(one, other)
    assert (one.engine, faults) == ("compiled", []), where
    for c in m.couplings:
        mine, theirs = one.coupling(c.name).force, other.coupling(c.name).force
        assert (np.isnan(mine) == np.isnan(theirs)).all()
        worst = max(worst, np.nanmax(np.abs(mine - theirs), initial=0.0) / np.nanmax(np.abs(theirs), initial=1e-3))
    return worst


def turning(m: mg.Mechanism, count: int = 5) -> dict[str, mg.Motion]:
    return {d.freedom: mg.Motion(np.linspace(-0.4, 0.7, count), 3.0 + i, -2.0) for i, d in enumerate(m.drives)}


@pytest.mark.seeds(12)
def test_random_trains(seed):
    m = random_train(seed)
    assert differ(m, turning(m)) < 1e-10


@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
@pytest.mark.parametrize("count", [1, 3])
def test_planets(count, redundant):
    m = planetary(count)
    assert differ(m, turning(m), redundant=redundant) < 1e-10
    plane = m.to_planar()
    assert differ(plane, turning(plane), redundant=redundant) < 1e-10


@pytest.mark.seeds(3)
def test_calls_one_by_one(seed):
    m = random_train(20 + seed)
    c = mg.compile(m)
    assert beside(c, m, c.tables.home + np.linspace(-0.3, 0.3, 4)[:, None]) < 1e-10


@pytest.mark.parametrize(
    ("stages", "numbers"),
    [
        (("spur", "bevel"), ("pressure_angle", "spiral_angle")),
        (("worm", "belt"), ("pressure_angle", "radii.b")),
        (("ring", "rack"), ("pressure_angle", "radius")),
    ],
)
def test_derivatives_are_exact(stages, numbers):
    """Of a reaction by a mass, a load and numbers of gears, beside differences."""
    m = random_train(1, stages)
    c = mg.compile(m)
    c(c.tables.home + 0.2, 2.0, -1.0)
    names = ["l1.mass", *(f"g{i}.{name}" for i, name in enumerate(numbers))]
    found = c.gradient("S1.reaction", names)
    for name, mine in zip(names, found.T, strict=True):
        middle, step = c.parameters[name], 1e-3 * max(abs(c.parameters[name]), 0.1)
        sides = []
        for sense in (1.0, -1.0):
            c.parameters[name] = middle + sense * step
            c(c.tables.home + 0.2, 2.0, -1.0)
            sides.append(c.reaction("S1"))
        c.parameters[name] = middle
        slope = (sides[0] - sides[1]) / (2 * step)
        np.testing.assert_allclose(mine, slope, atol=1e-5 * np.abs(slope).max() + 1e-12)


def file_agrees(m: mg.Mechanism, c: mg.Compiled, path, within: float) -> list[float]:
    """A written file of C gives efforts and reactions of ``solve``; the positions at which it was asked."""
    c.write(path)
    q = (c.tables.home + 0.1).tolist()
    status, (effort, reaction, _) = run_c(library_of(path, path.stem), path.stem, m, q)
    s = mg.solve(m, {"S0": mg.Motion(q[0], 2.0, 0.5)}, engine="dense")
    expected = np.concatenate([s[p.name].reaction for p in m.pairs])
    assert status == 0
    np.testing.assert_allclose(reaction, expected, atol=within * np.abs(expected).max())
    np.testing.assert_allclose(effort, s["S0"].effort, rtol=within)
    return q


def test_a_file_of_c(tmp_path):
    m = random_train(3, ("spur", "bevel", "belt"))
    file_agrees(m, mg.compile(m), tmp_path / "train.c", 1e-11)


def test_other_couplings_of_the_same_graph():
    """What is kept of a graph is not taken for other couplings of it, nor for the same with their terms in another order."""
    pairs = [
        mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=(0, 0, 1)) for k, x in (("p", 0.0), ("w", 0.1), ("v", 0.2))
    ]
    last = mg.Coupling({"w": 1.0, "v": 3.0}, name="h")
    m = mg.Mechanism("c", pairs=pairs, couplings=[mg.Coupling({"p": 1.0, "w": 2.0}, name="g"), last], drives=["p"])
    for terms, w in (({"p": 1.0, "w": 2.0}, -0.5), ({"w": 2.0, "p": 1.0}, -0.5), ({"p": 1.0, "v": 2.0}, 1.5)):
        s = mg.solve(
            m.replace(couplings=[mg.Coupling(terms, name="g"), last]), {"p": mg.Motion(0.5, 1.0)}, engine="compiled"
        )
        assert s["w"].velocity[0] == pytest.approx(w)


def test_bearings_that_rub():
    """Friction of all bearings beside forces between teeth, whose flanks it may change."""
    m = random_train(303)
    rough = [
        mg.Friction(p.name, mu=0.08, **({"radius": 0.01, "length": 0.05} if p.type.symbol == "R" else {}))
        for p in m.pairs
    ]
    m = m.replace(loads=[*m.loads, *rough])
    assert differ(m, turning(m)) < 1e-10


@pytest.mark.parametrize("names", [("g0.pressure_angle", "l1.mass"), ("g1.spiral_angle",)])
def test_studies_over_numbers_of_gears(names):
    m = random_train(1, ("spur", "bevel"))
    c = mg.compile(m)
    ways = {name: scipy.stats.uniform(c.parameters[name], 0.01) for name in names}
    outputs, given = ["S0.effort", "S1.force", "g0.normal_force"], {"S0": mg.Motion([0.1, 0.3], 2.0, 1.0)}
    one, other = (mg.study(m, ways, outputs, n=2, seed=1, motions=given, engine=e) for e in ("compiled", "dense"))
    for name in outputs:
        np.testing.assert_allclose(one.outputs[name], other.outputs[name], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_unit_runs_in_fmpy(tmp_path):
    m = random_train(3, ("spur", "worm"))
    mg.compile(m).write(tmp_path / "train.fmu")
    unit_, places = entered(tmp_path / "train.fmu", tmp_path)
    unit_.exitInitializationMode()
    s = mg.solve(m, {"S0": mg.Motion([0.1, 0.3], 2.0, 0.5)}, engine="dense")
    for i, q in enumerate((0.1, 0.3)):
        unit_.setReal([places[f"S0.Rz.{kind}"] for kind in "qva"], [q, 2.0, 0.5])
        unit_.doStep(0.1 * i, 0.1)
        found = unit_.getReal([places[f"S1.reaction.{part}"] for part in ("Mx", "My", "Mz", "Fx", "Fy", "Fz")])
        np.testing.assert_allclose(found, s["S1"].reaction[i], atol=1e-9 * np.abs(s["S1"].reaction[i]).max())
    unit_.terminate()
    unit_.freeInstance()


def rough_train(seed: int, loaded: bool = True, bearings: bool = True, teeth: bool = True) -> mg.Mechanism:
    """A random train whose bearings and teeth rub, by a coefficient or an efficiency."""
    m, rng = random_train(seed), np.random.default_rng(seed)
    loads = [load for load in m.loads if loaded or not isinstance(load, mg.Effort)]
    mu = float(rng.uniform(0.02, 0.3))
    for p in m.pairs if bearings else ():
        journal = {"radius": 0.02, "length": 0.05} if p.type.symbol == "R" else {}
        loads.append(mg.Friction(p.name, mu=mu, **journal))
    for c in m.couplings if teeth else ():
        one, other = {"mu": float(rng.uniform(0, 0.1))}, {"efficiency": float(rng.uniform(0.7, 0.98))}
        for given in (one, other) if rng.random() < 0.5 else (other, one):
            try:
                m.replace(loads=[*loads, mg.Friction(c.name, **given)])
            except mg.DeclarationError:  # nothing of a toothed belt rubs, and a number of teeth may be missing
                continue
            loads.append(mg.Friction(c.name, **given))
            break
    return m.replace(loads=loads)


@pytest.mark.seeds(6)
def test_teeth_that_rub(seed):
    m = rough_train(100 + seed, loaded=bool(seed % 2), bearings=bool(seed % 3))
    assert differ(m, turning(m)) < 1e-9
    c = mg.compile(m)
    assert beside(c, m, c.tables.home + np.linspace(-0.3, 0.3, 3)[:, None]) < 1e-9


@pytest.mark.parametrize("seed", [1, 3, 13])
def test_friction_turns_the_force_between_teeth_round(seed):
    """Bearings that rub press on the other flanks than the loads alone."""
    m = rough_train(seed, loaded=False, teeth=False)
    smooth = m.replace(loads=[load for load in m.loads if not isinstance(load, mg.Friction)])
    given = turning(m, 3)
    solved = [mg.solve(one, given, engine="dense") for one in (m, smooth)]
    with_, without = (np.array([s.coupling(c.name).force for c in m.couplings]) for s in solved)
    along = (with_ * without).sum(axis=-1) / np.linalg.norm(with_, axis=-1) / np.linalg.norm(without, axis=-1)
    assert along.min() < 0.5, "none is turned round"
    assert differ(m, given) < 1e-9


def test_turned_flanks_in_files_of_c_and_derivatives(tmp_path):
    """The same with teeth that rub, beside numpy and differences."""
    m = rough_train(1, loaded=False)
    c = mg.compile(m)
    q = file_agrees(m, c, tmp_path / "turned.c", 1e-10)
    name = f"loads[{sum(not isinstance(load, mg.Friction) for load in m.loads)}].mu"
    c(q[0], 2.0, 0.5)
    slope, middle, efforts = c.gradient("S0.effort", [name])[0], c.parameters[name], []
    for change in (1e-4, -1e-4):
        c.parameters[name] = middle + change
        efforts.append(c(q[0], 2.0, 0.5)[0])
    assert slope == pytest.approx((efforts[0] - efforts[1]) / 2e-4, rel=1e-6)


def test_teeth_of_unknown_size_have_an_efficiency_in_files_of_c():
    """How fast they slide is not known, which is no number in a file; derivatives are those of differences."""
    m = rough_train(7)
    c = mg.compile(m)
    c(0.15, 1.3, 0.4)
    assert np.isfinite(c.P).all()
    slope, mass = c.gradient("S0.effort", ["l0.mass"])[0], c.parameters["l0.mass"]
    efforts = []
    for part in (1.001, 0.999):
        c.parameters["l0.mass"] = part * mass
        efforts.append(c(0.15, 1.3, 0.4)[0])
    assert slope == pytest.approx((efforts[0] - efforts[1]) / (0.002 * mass), rel=1e-6)
    assert differ(m, turning(m)) < 1e-9
    rubs = mg.solve(m, turning(m), engine="compiled")
    assert np.isnan(rubs._values.at_places("speeds", "g2")).all()


def test_teeth_that_rub_in_time():
    """They may hold each other at rest, where the kernel does not follow them; it does while they slide."""
    m = rough_train(2)
    t = np.linspace(0.0, 0.003, 2)
    with pytest.raises(mg.DeclarationError, match="or teeth"):
        mg.respond(m, t, rates={"S0": 8.0}, engine="compiled")
    one, other = (mg.respond(m, t, rates={"S0": 8.0}, engine=engine) for engine in ("auto", "dense"))
    assert one.engine == "compiled"
    np.testing.assert_allclose(one["S0"].acceleration, other["S0"].acceleration, rtol=1e-9)


def belts(count: int, **more: object) -> mg.Mechanism:
    """A shaft that drives two others by a flat belt over three pulleys, with a pretension, and with a second belt a fourth one."""
    at = {"p": (0.0, 0.0, 0.0), "v": (0.5, 0.0, 0.0), "w": (0.2, 0.4, 0.0), "x": (0.9, 0.1, 0.05)}
    names = list(at)[: 2 + count]
    pairs = [mg.Pair(k, "R", "frame", k, point=at[k], axis=(0, 0, 1)) for k in names]
    pulleys = [mg.Pulley(k, k, at[k], (0, 0, 1), radius=0.05 + 0.01 * i) for i, k in enumerate(names[:3])]
    drives = [mg.BeltDrive("b", over=names[:3], pretension=300.0, toothed=False)]
    if count == 2:
        pulleys.append(mg.Pulley("vx", "v", (0.5, 0, 0.05), (0, 0, 1), radius=0.04))
        pulleys.append(mg.Pulley("x", "x", at["x"], (0, 0, 1), radius=0.08))
        drives.append(mg.BeltDrive("b2", over=["vx", "x"], pretension=150.0))
    loads = [mg.Effort(k, -2.0) for k in names[1:]]
    return mg.Mechanism("belts", pairs=pairs, gears=pulleys, couplings=drives, drives=["p"], loads=loads, **more)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("rough", [False, True])
def test_belts_with_a_pretension(count, rough):
    """Tensions of all spans, with bearings that rub; the sum of length times tension is that of the pretension."""
    m = belts(count)
    if rough:
        m = m.replace(
            loads=[*m.loads, mg.Friction("b", mu=0.4), *(mg.Friction(p.name, mu=0.2, radius=0.01) for p in m.pairs)]
        )
    given = {"p": mg.Motion([0.1, 0.6], 3.0, 2.0)}
    one, other = (mg.solve(m, given, engine=engine) for engine in ("compiled", "dense"))
    worst, where, faults = differences(one, other)
    assert (worst < 1e-10, faults) == (True, []), where
    for belt, pull in (("b", 300.0), ("b2", 150.0))[:count]:
        T, expected = one.coupling(belt).tension, other.coupling(belt).tension
        np.testing.assert_allclose([*T.values()], [*expected.values()], rtol=1e-11)
        if belt == "b2":  # both spans are as long
            np.testing.assert_allclose(sum(T.values()) / 2, pull, rtol=1e-12)
    c = mg.compile(m)
    c(0.1, 3.0, 2.0)
    np.testing.assert_allclose(c.reaction("p"), one["p"].reaction[0], rtol=1e-11, atol=1e-10)
    slope = c.gradient("p.reaction", ["b.pretension"])[:, 0]
    c.parameters["b.pretension"] = 310.0
    c(0.1, 3.0, 2.0)
    if not rough:  # linear in it
        np.testing.assert_allclose(c.reaction("p") - one["p"].reaction[0], 10.0 * slope, rtol=1e-8, atol=1e-8)
