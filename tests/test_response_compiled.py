"""Motion in time by the compiled kernel: what the numpy engines give, its own words where it does not serve."""

import copy
import pickle
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from program import invoke

import mechgraph as mg

GOVERNOR = Path(__file__).parent / "reference" / "data" / "flyball-governor.toml"


def chain() -> mg.Mechanism:
    """A crank, a slide along it and a body on a ball at its end, on springs."""
    links = [
        mg.Link("frame"),
        mg.Link("crank", 2.0, (0.2, 0, 0), np.diag([0.01, 0.05, 0.04])),
        mg.Link("slider", 1.0, (0.5, 0, 0), np.diag([0.01, 0.02, 0.02])),
        mg.Link("body", 0.7, (0.8, 0.1, 0.05), np.diag([0.01, 0.03, 0.025])),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 1, 0.2)),
        mg.Pair("B", "P", "crank", "slider", point=(0.5, 0, 0), axis=(1, 0, 0)),
        mg.Pair("S", "S", "slider", "body", point=(0.7, 0, 0)),
    ]
    spring = mg.Spring("crank", "slider", (0, 0, 0), (0.5, 0, 0), 300.0, 0.45, 2.0)
    return mg.Mechanism(
        "chain", links, pairs, loads=[mg.Gravity((0, 0, -9.81)), spring, mg.Damper(freedom="A", coefficient=0.3)]
    )


def five_bar() -> mg.Mechanism:
    """A loop of mobility 2."""
    at = [(0, 0, 0), (0.3, 0.8, 0), (1.2, 1.3, 0), (2.1, 0.9, 0), (2, 0, 0)]
    links = [
        mg.Link("frame"),
        *(mg.Link(f"r{i}", 1.0, np.add(p, q) / 2, np.eye(3) / 12) for i, (p, q) in enumerate(pairwise(at))),
    ]
    names = [link.name for link in links]
    pairs = [mg.Pair(f"J{i}", "R", names[i], names[(i + 1) % 5], point=p, axis=(0, 0, 1)) for i, p in enumerate(at)]
    return mg.Mechanism(
        "five-bar", links, pairs, loads=[mg.Gravity((0, -9.81, 0)), mg.Wrench("r1", force=(1, 2, 0), frame="link")]
    )


def parallelogram() -> mg.Mechanism:
    """Three cranks side by side, which pass their change points, on springs with dampers."""
    links = [mg.Link("frame"), *(mg.Link(f"c{i}", 1.0, (i, 0.5, 0), np.eye(3) / 12) for i in range(3))]
    links += [mg.Link(f"r{i}", 1.0, (i + 0.5, 1, 0), np.eye(3) / 12) for i in range(2)]
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"c{i}", point=(i, 0, 0), axis=(0, 0, 1)) for i in range(3)]
    for i in range(2):
        pairs.append(mg.Pair(f"B{i}", "R", f"c{i}", f"r{i}", point=(i, 1, 0), axis=(0, 0, 1)))
        pairs.append(mg.Pair(f"C{i}", "R", f"r{i}", f"c{i + 1}", point=(i + 1, 1, 0), axis=(0, 0, 1)))
    spring = mg.Spring("frame", "r1", (0.5, 2, 0), (1.5, 1, 0), 3.0, 0.5, 0.2)
    wound = mg.TorsionSpring("A1", 0.4, damping=0.1)
    return mg.Mechanism("parallelograms", links, pairs, loads=[mg.Gravity((0, -9.81, 0)), spring, wound])


def stage() -> mg.Mechanism:
    """Two gears with a torque on each, of which the heavy one drives back."""
    at = {"p": (0.0, 0.002), "w": (0.06, 0.02)}
    links = [mg.Link("frame"), *(mg.Link(n, 1.0, (x, 0, 0), j * np.eye(3)) for n, (x, j) in at.items())]
    pairs = [mg.Pair(n, "R", "frame", n, point=(x, 0, 0), axis=(0, 0, 1)) for n, (x, _) in at.items()]
    loads = [mg.Gravity((0, -9.81, 0)), mg.Effort("w", 1.0)]
    teeth = mg.SpurGears("t", "p", "w", teeth=(20, 40), module=0.002)
    return mg.Mechanism("stage", links, pairs, couplings=[teeth], loads=loads)


def agree(r: mg.Response, s: mg.Response, within: float) -> None:
    """The same at all output times, all reactions included."""
    for pair in r.mechanism.pairs:
        for what in ("position", "velocity", "acceleration", "reaction"):
            mine, other = (np.nan_to_num(getattr(one[pair.name], what)) for one in (r, s))
            np.testing.assert_allclose(
                mine, other, atol=within * max(1.0, np.abs(other).max()), err_msg=f"{pair.name} {what}"
            )
    np.testing.assert_allclose(r.energy.work, s.energy.work, atol=within * max(1.0, np.abs(s.energy.kinetic).max()))


def rough(m: mg.Mechanism, mu: float = 0.1, **length: float) -> mg.Mechanism:
    """Friction in every pair, of journals with a length, and what springs and gravity there is."""
    numbers = {"R": {"radius": 0.01, **length}, "P": {"length": 0.1, "width": 0.05}, "S": {"radius": 0.01}}
    dry = [mg.Friction(p.name, mu=mu, **numbers[p.type.symbol]) for p in m.pairs]
    return m.replace(loads=[*m.loads, *dry], drives=[])


MOTIONS = {
    "stiff": (
        lambda: mg.load(GOVERNOR).replace(drives=[]),
        {"rates": {"A": 2 * np.pi}, "method": "Radau", "rtol": 1e-6, "atol": 1e-8},
        0.01,
    ),
    "rotations": (chain, {"rates": {"S.Rx": 3.0, "S.Rz": 0.5, "A": 1.0}}, 0.15),
    "loop": (five_bar, {"rates": {"J0": 1.0, "J4": -0.5}}, 0.2),
    "prescribed": (five_bar, {"motions": {"J0": lambda t: (np.sin(t), np.cos(t), -np.sin(t))}}, 0.2),
    "change points": (parallelogram, {"rates": {"A0": -2.0}}, 1.5),
    "one path": (lambda: mg.load("bricard-cube").replace(drives=[]), {}, 1.0),
    "event": (chain, {"events": [mg.Event("B", 0.02)], "rates": {"A": 1.0}}, 0.27),
    "friction": (
        lambda: rough(chain(), length=0.05),
        {"rates": {"S.Rx": 3.0, "S.Rz": 0.5, "A": 1.0}, "rtol": 1e-8},
        0.02,
    ),
    "friction of a prescribed loop": (
        lambda: rough(five_bar()),
        {"motions": {"J0": lambda t: (np.sin(t), np.cos(t), -np.sin(t))}},
        0.01,
    ),
    "friction beside gears": (lambda: rough(stage()), {"rates": {"p": 5.0}}, 0.1),
    "stop": (chain, {"stops": [mg.Stop("B", upper=0.01, restitution=0.5)]}, 0.3),
}


@pytest.mark.daily(4)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "stiff" else n for n in MOTIONS])
def test_it_is_the_motion_of_the_dense_engine(name):
    made, how, end = MOTIONS[name]
    m, t = made(), np.linspace(0.0, end, 7)
    r, s = (mg.respond(m, t, engine=engine, **{"rtol": 1e-9, "atol": 1e-11, **how}) for engine in ("compiled", "dense"))
    assert (r.engine, s.engine) == ("compiled", "dense")
    paths = ("change points", "one path")
    assert r.work.coordinates == ("along the path" if name in paths else "in independent freedoms")
    agree(r, s, 1e-6)
    assert [str(one.event) for one in r.events] == [str(one.event) for one in s.events]
    np.testing.assert_allclose([one.t for one in r.events], [one.t for one in s.events], atol=1e-7)
    assert bool(s.events) == (name in ("event", "stop", "friction beside gears"))
    np.testing.assert_allclose(r.energy.friction, s.energy.friction, atol=1e-7 * (1.0 + s.energy.friction.max()))
    assert (s.energy.friction.max() > 0.0) == name.startswith("friction")


@pytest.mark.usefixtures("compiled")
def test_what_the_kernel_does_not_carry():
    m = five_bar().replace(loads=[mg.Effort("J0", lambda pose, twist, t: 1.0 + 0.0 * t)])
    with pytest.raises(
        mg.DeclarationError, match=r"engine 'compiled' does not serve: load .*J0.* is a function, or varies over"
    ):
        mg.respond(m, (0.0, 0.01), engine="compiled")
    assert mg.respond(m, (0.0, 0.01)).engine == "dense"
    with pytest.raises(mg.DeclarationError, match="passive freedoms are held at rest"):
        mg.respond(mg.load("rssr").replace(drives=[]), (0.0, 0.01), passive="held", engine="compiled")


@pytest.mark.usefixtures("compiled")
def test_the_command_line_takes_the_engine():
    done = invoke("respond", str(GOVERNOR), "--for", "1ms", "--engine", "compiled", "--json")
    assert done.exit_code == 0, done.output
    assert '"engine": "compiled"' in done.output


@pytest.mark.parametrize("made", [chain, parallelogram])
def test_what_the_kernel_integrated_can_be_copied_and_sent(made, compiled: None) -> None:
    r = mg.respond(made(), (0, 0.5), engine="compiled")
    for other in (copy.deepcopy(r), pickle.loads(pickle.dumps(r))):
        assert other.engine == "compiled"
        agree(other.at([0.1, 0.33]), r.at([0.1, 0.33]), 1e-12)


@pytest.mark.parametrize("rate", [20.0, -20.0])
def test_steps_along_a_path_are_those_of_scipy(rate):
    m = mg.load("four-bar").replace(drives=[], loads=[mg.Gravity((0, -9.81, 0))])
    t = np.linspace(0.0, 0.8, 23)
    ours, scipys = (mg.respond(m, t, rates={"A": rate}, rtol=1e-11, engine=engine) for engine in ("compiled", "dense"))
    assert abs(ours["A"].position[-1] - ours["A"].position[0]) > 2 * np.pi
    assert ours.work.counts == scipys.work.counts
    for name in m.pair_index:
        np.testing.assert_allclose(ours[name].position, scipys[name].position, atol=1e-11)
    assert ours.energy.balance == pytest.approx(scipys.energy.balance, abs=1e-8 * ours.energy.greatest)
    between = pickle.loads(pickle.dumps(ours)).at(t[:-1] + 0.01)
    np.testing.assert_allclose(between["D"].position, scipys.at(t[:-1] + 0.01)["D"].position, atol=1e-11)
