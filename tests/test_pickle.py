"""Everything public goes through pickle and copy, and to another process and back, with the data that it carries."""

import copy
import multiprocessing
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from lattices import spatial_ladder

import mechgraph as mg

WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}
THETA = np.linspace(0.0, 1.0, 5)


@cache
def things() -> dict[str, Any]:
    """An object of every public kind."""
    m, spatial = mg.load("four-bar"), mg.load("rssr")
    s, report, f = mg.solve(m, {"A": THETA}), mg.check(m), mg.formulate(m)
    spring = mg.Spring("frame", m.links[2].name, (0, 0, 0), (0, 0, 0), stiffness=2.0, free_length=0.1)
    coupled = mg.Coupling({"A": 2.0, "D": -3.0}, name="g")
    pushed = mg.load("windows-2").replace(loads=[mg.Effort("A1", load_of_a_module)])
    hanging = mg.equilibrium(mg.load("windows-2").replace(drives=[]), {"A0": 3.0})
    out: dict[str, Any] = {
        "mechanism": m, "link": m.links[1], "pair": m.pairs[0], "marker": m.pairs[0].markers[0], "drive": spatial.drives[0],
        "coupling": coupled, "spring": spring, "wrench": mg.Wrench("a", force=(1, 0, 0), point=(0, 0, 0)),
        "effort": mg.Effort("D", 1.0), "gravity": mg.Gravity((0, 0, -9.81)), "torsion spring": mg.TorsionSpring("D", stiffness=1.0),
        "damper": mg.Damper("D", coefficient=2.0), "law": mg.ForceLaw("D", law=mg.ForceTable(x=[0, 1], force=[2, 3])),
        "table": mg.ForceTable(v=[0, 1], force=[2, 3]),
        "load of a function": mg.solve(m.replace(loads=[mg.Effort("D", load_of_a_module)]), {"A": THETA}),
        "motion": mg.Motion.law("cycloidal", 1.0, 2.0, np.linspace(0, 2, 5)), "table of pair types": mg.pair_types(),
        "report": report, "large report": mg.check(spatial_ladder(120)), "ledger": report.ledger("lee"),
        "formulation": f, "its ledger": f.ledger(),
        "coefficients": f.coefficients(),
        "solution": s, "sparse solution": mg.solve(spatial, {"A": THETA}, engine="sparse"), "motion alone": mg.kinematics(spatial),
        "flagged": mg.solve(spatial.replace(drives=["D"]), {"D": 2.0}, on_reach="flag"),
        "pair result": s["A"], "link result": s.link(m.links[1].name), "checks": s.checks, "state": s.state(0), "work": s.work,
        "free body": mg.free_body(s, m.links[1].name), "over time": mg.over_time(mg.solve(m, {"A": mg.Motion(THETA, velocity=1.0)})),
        "synthesis setup": mg.SynthesisSetup(mg.function("A", "D", [(0, 0), (0.1, 0.2)]), ["B.point"], bounds={"B.point.x": (0, 1)}),
        "response setup": mg.ResponseSetup((0, 1), start={"A": 0.1}, motions={"D": mg.Motion([0, 1], t=[0, 1])}, events=mg.Event("A")),
        "study": mg.study(m, {f"{m.links[1].name}.mass": [1.0, 2.0], "B.point.x": [0.001, 0.0]}, ["A.effort"], n=4),
        "FileError": mg.FileError("a.toml", "is missing"), "DeclarationError": mg.DeclarationError("a", ["b", "c"]),
        "ContentError": mg.ContentError("a.toml", mg.DeclarationError("a", ["b", "c"])),
        "MechgraphWarning": mg.MechgraphWarning("a freedom carries load"), "warnings": s.warnings,
        "AssemblyError": mg.AssemblyError("open", 0.5, {"A": 1.0}), "MissingExtraError": mg.MissingExtraError("typer", "cli"),
        "DeadPointError": mg.DeadPointError("dead", {"A": 1.0}), "ReachError": mg.ReachError("far", {"A": 1.0}, s),
        "ShapeError": mg.ShapeError("raised", "A"),
        "response": mg.respond(mg.load("windows-2"), (0, 0.2)), "response in charts": mg.respond(pushed, (0, 0.2)),
        "ResponseError": mg.ResponseError("stopped", s), "StudyError": mg.StudyError("ended", s), "event": mg.Event("A0", 0.1),
        "surface": mg.Surface.sphere(radius=0.1), "curve": mg.Curve.circle(radius=0.1),
        "segment": mg.Segment("scca", 0.1, 2.0, sine=0.2, constant=0.3, cosine=0.2),
        "law of a cam": mg.CamLaw([mg.Segment("poly345", h, 1.0) for h in (0.1, -0.1)], turn=2.0),
        "on a curve": mg.Pair("X", "Sg", "a", "b", curve=mg.Curve.ellipse(a=0.2, b=0.1)),
        "spur": mg.SpurGears("g", "A", "B", teeth=(20, 40)), "bevel": mg.BevelGears("g", "A", "B", teeth=(20, 40), module=0.1),
        "worm": mg.WormGear("g", "A", "B", teeth=(1, 40), radius=0.1), "rack": mg.Rack("g", "A", "B", radius=0.1),
        "film": mg.Journal(0.02, 0.02, 2e-5, 0.01), "stiffness": mg.Stiffness(Fx=1e7), "misfit": mg.Misfit(Fz=1e-5),
        "friction": mg.Friction("D", mu=0.1, radius=0.01), "FrictionError": mg.FrictionError("jams", {"A": 1.0}, s, factor=0.5),
        "gear": mg.Gear("g", "a", 20, (0, 0, 0), (0, 0, 1), module=0.1),
        "gear rack": mg.GearRack("g", "a", (0, 0, 0), (1, 0, 0), (0, 1, 0), module=0.1),
        "bevel gear": mg.BevelGear("g", "a", 20, (0, 0, 0), (0, 0, 1), module=0.1), "mesh": mg.Mesh("m", "a", "b"),
        "worm alone": mg.Worm("g", "a", 2, (0, 0, 0), (0, 0, 1), 0.1), "wheel": mg.WormWheel("g", "a", 20, (0, 0, 0), (0, 0, 1)),
        "pulley": mg.Pulley("p", "a", (0, 0, 0), (0, 0, 1), radius=0.1), "belt drive": mg.BeltDrive("b", over=["p", "q"]),
        "hertz": mg.Hertz((2.1e11, 2.1e11)), "tolerances": mg.Tolerances(rank={"loop": 1e-6}), "transmission": mg.transmission(s, "D"),
        "belt": mg.Belt("g", "A", "B", radii=(1, 2)), "stop": mg.Stop("A0", lower=0.1), "equilibrium": hanging,
        "linearized": mg.linearize(hanging),
        "assemblies": mg.assemblies(m, {"A": 0.3}, cache=False), "at several": mg.assemblies(m, {"A": THETA}, cache=False),
        "branches": mg.branches(m, "A", samples=4, points=12, cache=False),
        "chain": next(mg.atlas(6)), "identity": mg.identify(mg.load("four-bar")), "system group": next(mg.system_groups(1)),
        "multiple joint": mg.MultipleJoint(("crank", "rod", "arm"), ("B", "E")),
        "structure": mg.structure(mg.load("four-bar")), "groups": mg.groups(mg.load("four-bar")),
        "group": mg.groups(mg.load("four-bar")).groups[1], "families": mg.check(mg.load("four-bar")).families,
        "IndeterminateError": mg.IndeterminateError("free", report),
    }  # fmt: skip
    return out | {f"row {symbol}": row for symbol, row in mg.pair_types().items()}


def load_of_a_module(pose: Any, twist: Any, t: Any) -> float:
    return 2.0


def facts(thing: Any) -> Any:
    """What two of a kind have in common: plain data that can be compared."""
    if isinstance(thing, mg.Solution):
        return (
            facts(thing.mechanism),
            facts(thing.columns()),
            [facts(thing.link(k).pose) for k in thing.mechanism.link_names()],
        )
    if isinstance(thing, mg.Study):
        return facts(
            [thing.parameters, thing.outputs, thing.messages, thing.sensitivities("A.effort"), thing.variant(0)]
        )
    if isinstance(thing, mg.DeterminacyReport):
        return str(thing), thing.to_json()
    if isinstance(thing, BaseException):
        return type(thing), str(thing), thing.args, facts(vars(thing))
    if isinstance(thing, np.ndarray):
        return thing.shape, thing.tobytes() if thing.dtype != object else facts(thing.tolist())
    if isinstance(thing, Mapping):
        return {key: facts(value) for key, value in thing.items()}
    if isinstance(thing, tuple | list):
        return [facts(item) for item in thing]
    if is_dataclass(thing):
        return type(thing), {field.name: facts(getattr(thing, field.name)) for field in fields(thing)}
    if hasattr(thing, "_values"):
        return type(thing), facts(thing.acceleration)
    return type(thing), thing if callable(thing) else str(thing)


def test_every_public_class_is_among_them() -> None:
    public = {kind for name in mg.__all__ if isinstance(kind := getattr(mg, name), type)}
    here = [type(thing) for thing in things().values()]
    parts = {mg.Component, mg.Freedom, mg.Bookkeeping}  # of the rows of pair types
    bases = {mg.MechgraphError, mg.Curve, mg.Surface}
    elsewhere = {mg.Compiled, mg.Syntheses, mg.SynthesesOver}  # have tests of their own
    assert public - set(here) <= parts | bases | elsewhere


def test_everything_comes_back_equal() -> None:
    told = {
        name: facts(thing) for name, thing in things().items()
    }  # what is worked out when asked for comes along, or again
    for way in WAYS.values():
        back = {name: way(thing) for name, thing in things().items()}
        assert [name for name, thing in things().items() if type(back[name]) is not type(thing)] == []
        assert [name for name in told if facts(back[name]) != told[name]] == []


def test_a_solution_is_sent_without_what_can_be_evaluated_again() -> None:
    m = mg.load("rssr")
    s = mg.solve(m, {"A": np.linspace(0.0, 1.0, 500)})
    numbers = sum(np.asarray(column).nbytes for column in s.columns().values())
    assert len(pickle.dumps(s)) < 5 * numbers


def test_a_load_without_a_name_is_refused_by_pickle_and_copied_all_the_same() -> None:
    m = mg.load("four-bar").replace(loads=[mg.Effort("D", lambda pose, twist, t: 2.0)])
    s = mg.solve(m, {"A": THETA})
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(s)
    assert facts(copy.deepcopy(s).columns()) == facts(s.columns())


@pytest.mark.daily(1)
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # a fork beside threads of other tests
@pytest.mark.parametrize("start", [way for way in ("spawn", "fork") if way in multiprocessing.get_all_start_methods()])
def test_to_another_process_and_back(start: str) -> None:
    here = {name: thing for name, thing in things().items() if name != "load of a function" or start == "fork"}
    with ProcessPoolExecutor(1, multiprocessing.get_context(start)) as pool:
        back = dict(zip(here, pool.map(copy.copy, here.values()), strict=True))
        raised = [
            pool.submit(mg.load, "none.toml"), pool.submit(mg.solve, mg.load("rcsr"), {"O1": [2.5, 0.0]}),
            pool.submit(mg.solve, mg.load("four-bar"), method="guess"),
        ]  # fmt: skip
        errors = [future.exception() for future in raised]
    assert {name: facts(thing) for name, thing in back.items()} == {name: facts(thing) for name, thing in here.items()}
    assert [type(error) for error in errors] == [mg.FileError, mg.ReachError, mg.DeclarationError]
    assert isinstance(errors[1], mg.ReachError)
    assert errors[1].solution.status.tolist() == ["ok", "out of reach"]
