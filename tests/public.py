"""Every public callable, found from ``__all__``, ``show.__all__`` and the methods of results, with arguments that it takes."""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import mechgraph as mg
from mechgraph import show

(Shown,) = (base for base in mg.DeterminacyReport.__mro__ if base.__name__ == "Shown")
Door = tuple[str, Callable, tuple, dict]
BUILT = frozenset({"Chain", "Compiled", "Families", "Formulation", "Group", "Identity", "SystemGroup"})
"""Classes whose objects functions make; a reader of a program finds them in ``__all__`` for their names alone."""
INSIDE = {
    "Mechanism": "freedom freedom_fault full_name has_graph_of in_own_units once period place_of_link place_of_pair "
    "take_graph_of turns ends_of leaving_the_plane",
    "Ledger": "table",
    "CamLaw": "changed converted faults in_own_units in_units moved numbers_turn once replace take_graph_of value_faults "
    "with_full_names without_quantities",
}
"""Methods with public names that modules of the package call, not programs."""


def functions() -> dict[str, Callable]:
    """Public functions and constructors, by name."""
    found = {name: getattr(mg, name) for name in mg.__all__}
    found |= {
        f"{room}.{k}": v
        for room, module in (("inertia", mg.inertia), ("parts", mg.parts))
        for k, v in vars(module).items()
        if getattr(v, "__module__", "") == module.__name__ and callable(v) and k[0] != "_"
    }
    found["parts.Parts"] = mg.parts.Parts
    found |= {f"show.{name}": getattr(show, name) for name in show.__all__}
    for name in ("Curve", "Surface", "Motion"):
        own = vars(found[name]).items()
        found |= {
            f"{name}.{k}": getattr(found[name], k) for k, v in own if k[0] != "_" and isinstance(v, classmethod | type)
        }
    return {name: one for name, one in found.items() if callable(one) and not _made(name, one) and _takes_any(one)}


def _takes_any(one: Callable) -> bool:
    return bool(inspect.signature(one).parameters)


def _made(name: str, one: Any) -> bool:
    """Whether functions make the objects of a class."""
    ours = (
        isinstance(one, type) and (issubclass(one, BaseException) or issubclass(one, Shown)) and one is not mg.Mechanism
    )
    return (
        ours
        or name in BUILT
        or getattr(one, "__module__", "") == "mechgraph.errors"
        or one is mg.inertia.DeclarationError
    )


def results() -> Iterator[type]:
    """All classes of results, and the Mechanism."""
    yield from (one for one in _below(Shown) if one is mg.Mechanism or not issubclass(one, mg.Mechanism))


def _below(cls: type) -> Iterator[type]:
    for one in cls.__subclasses__():
        if one.__module__.startswith("mechgraph"):
            yield one
            yield from _below(one)


def methods(cls: type) -> dict[str, Callable]:
    """Public methods of a class that take arguments; what a sequence or mapping does with a wrong key is Python's."""
    inside = INSIDE.get(cls.__name__, "").split()
    found = {}
    for name, one in inspect.getmembers(cls, inspect.isfunction):
        ours = one.__module__.startswith("mechgraph") and name not in inside
        item = name == "__getitem__" and not issubclass(cls, Sequence | Mapping)
        inherited = any(getattr(base, name, None) is one for base in cls.__mro__[1:] if issubclass(base, Shown))
        if ours and not inherited and (name[0] != "_" or item) and len(inspect.signature(one).parameters) > 1:
            found[name] = one
    return found


RISE_AND_FALL = [mg.Segment("cycloidal", 0.01, 1.0), mg.Segment("cycloidal", -0.01, 1.0)]


@functools.cache
def made() -> tuple[tuple[Any, dict[str, Any]], ...]:
    """One of every kind of result, with what its methods take, by the names of their parameters."""
    m = mg.load("four-bar").replace(drives=["A"])
    swung = m.replace(drives=[])
    m = m.replace(links=[one.replace(points={"P": (0, 0, 0)}) for one in m.links])
    s = mg.solve(m, {"A": [0.0, 0.1]})
    f = mg.formulate(m)
    slide = mg.Pair("F", "P", "frame", "follower", point=(0, 0.1, 0), axis=(0, 1, 0))
    disc = mg.Pair(
        "K",
        "Ps",
        "cam",
        "follower",
        curve=mg.Curve.circle(radius=0.1, center=(0, -0.02, 0), second=(0, 1, 0)),
        roller=0.01,
        point=(0, 0.09, 0),
        closed="force",
    )
    geared = [mg.Pair(n, "R", "frame", n, point=(x, 0, 0), axis=(0, 0, 1)) for n, x in (("p", 0), ("w", 1))]
    gears = mg.Mechanism("gears", None, geared, drives=["p"], couplings=[mg.Coupling({"p": 1, "w": 2}, name="g")])
    cam = mg.Mechanism(
        "cam", None, [mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=(0, 0, 1)), slide, disc], drives=["A"]
    )
    response = mg.respond(swung, [0.0, 0.01])
    study = mg.study(m, {"crank.mass": [1.0, 2.0]}, "A.effort", 2, motions={"A": 0.1}, executor=None)
    lifted = mg.solve(cam, {"A": [0.0, 0.1]})
    state = {"state": s.state(0), "position": 0}
    dyad, places = dyad_and_places()
    guided = mg.synthesize(dyad, places, ["B.point"])
    swept = mg.synthesize(dyad, places, ["B.point"], sweep={"A.point.x": [0.0, 0.1]})
    term = f.equations[0].terms[0]
    return (
        (s, {"name": "crank"}),
        (response, {"t": 0.005, "name": "crank"}),
        (lifted, {"pair": "K", "link": "follower"}),
        (lifted.contact("K"), {"link": "follower"}),
        (mg.solve(gears, {"p": [0.0, 0.1]}), {"name": "g"}),
        (s["A"], {}),
        (s.link("crank"), {"p": (0, 0, 0), "name": "P"}),
        (f, state | {"term": term, "equation": f.equations[0]}),
        (mg.check(m), {"drives": ["A"], "most": 1}),
        (mg.free_body(s, "crank"), {"at": 0, "name": "A"}),
        (mg.branches(m, "A", samples=3, points=40), {"positions": [m], "output": "D"}),
        (mg.assemblies(m, {"A": 0.1}), {"i": 0}),
        (mg.assemblies(m, {"A": [0.1, 0.2]}), {"i": 0}),
        (study, {"name": "A.effort", "i": 0}),
        (mg.CamLaw(RISE_AND_FALL, turn=2.0), {"angle": 0.1}),
        (guided, {"name": "B.point.x", "which": [0], "by": "size"}),
        (swept, {"by": "size"}),
    )


def dyad_and_places() -> tuple[mg.Mechanism, Any]:
    """A crank with a body on it, and three poses of the body that one such crank reaches."""
    A = mg.Pair("A", "R", "frame", "crank", point=(0, 0))
    B = mg.Pair("B", "R", "crank", "body", point=(1, 0))
    m = mg.Mechanism("dyad", None, [A, B], planar=True)
    return m, mg.poses("body", [(0, 0, 0), (1, 0.5, 0.4), (2, 0.4, 1.1)])


GIVEN: dict[str, Any] = {
    "pair": "A",
    "link": "crank",
    "name": "g",
    "index": 0,
    "places": slice(0, 1),
    "include": ["points"],
    "asked": True,
    "full": True,
    "components": True,
    "bookkeeping": "lee",
    "position": 0,
    "matrix": "Q",
    "right": "C",
    "out": "A",
    "q": 0.5,
}


def result_doors(folder: Path) -> Iterator[Door]:
    """The methods of results with arguments."""
    for one, own in made():
        known = GIVEN | {"path": folder / "x.csv"} | own
        for name, function in methods(type(one)).items():
            parameters = list(inspect.signature(function).parameters.values())[1:]
            named = {p.name: known[p.name] for p in parameters if p.name in known}
            if all(p.name in named or p.default is not p.empty or p.kind is p.VAR_KEYWORD for p in parameters):
                yield f"{type(one).__name__}.{name}", getattr(one, name), (), named


@functools.cache
def declared_doors() -> list[tuple[str, Callable, tuple, dict]]:
    m = mg.load("four-bar").replace(drives=["A"])
    law = {"law": mg.ForceTable(x=(0, 1), force=(1, 2)), "free": 0.0, "scale": 1.0}
    Z, mass = (0, 0, 1), (1.0, (0, 0, 0), np.eye(3))
    gears = mg.Mechanism(
        "gears",
        None,
        [
            mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "frame", "w", point=(1, 0, 0), axis=Z),
        ],
        couplings=[mg.Coupling({"A": 1, "B": 2}, name="g")],
        drives=["A"],
    )

    def built(kind: Callable, where: str) -> Callable:
        """A declared thing in a mechanism."""
        return lambda *args, **more: m.replace(**{where: [*getattr(m, where), kind(*args, **more)]})

    study = functools.partial(mg.study, executor=None)
    return [
        (
            "Mechanism",
            mg.Mechanism,
            ("m", m.links, m.pairs, ["A"], m.loads),
            {
                "couplings": [],
                "frame": "frame",
                "start": {"A": 0.1},
                "units": {"length": "m"},
                "source": "",
                "description": "",
                "expected": {},
            },
        ),
        (
            "Link",
            lambda *a, **k: m.replace(links=[*m.links[:3], mg.Link(*a, **k)]),
            ("rocker", *mass),
            {"unphysical": False},
        ),
        (
            "Pair",
            built(mg.Pair, "pairs"),
            ("N", "R", "frame", "crank"),
            {"point": (0, 0, 0), "axis": Z, "second": (1, 0, 0), "pitch": None, "lead": None},
        ),
        (
            "Pair by markers",
            built(mg.Pair, "pairs"),
            ("N", "R", "frame", "crank"),
            {"on_a": mg.Marker(), "on_b": mg.Marker()},
        ),
        (
            "Marker",
            lambda *a: built(mg.Pair, "pairs")("N", "R", "frame", "crank", on_a=mg.Marker(*a), on_b=mg.Marker()),
            ((0, 0, 0), Z, (1, 0, 0)),
            {},
        ),
        ("Drive", lambda *a: m.replace(drives=[mg.Drive(*a)]), ("A", mg.Motion(0.0)), {}),
        ("Gravity", built(mg.Gravity, "loads"), ((0, 0, -9.81),), {}),
        ("Wrench", built(mg.Wrench, "loads"), ("crank", (1, 0, 0), (0, 0, 1), (0, 0, 0), "link"), {}),
        ("Effort", built(mg.Effort, "loads"), ("A", 1.0), {}),
        ("Spring", built(mg.Spring, "loads"), ("frame", "crank", (0, 0, 0), (1, 0, 0), 1.0, 0.0, 0.0), {}),
        ("TorsionSpring", built(mg.TorsionSpring, "loads"), ("A", 1.0, 0.0, 0.0), {}),
        ("Damper", built(mg.Damper, "loads"), ("A",), {"coefficient": 1.0}),
        (
            "Friction",
            built(mg.Friction, "loads"),
            ("A",),
            {
                **{
                    "mu": 0.1,
                    "static": 0.2,
                    "radius": 0.01,
                    "thrust_radius": 0.02,
                    "length": 0.1,
                    "width": None,
                    "on": "b",
                },
                **{"flank": 0.0, "model": "circle", "viscous": 0.1, "preload": 1.0},
            },
        ),
        ("ForceLaw", built(mg.ForceLaw, "loads"), (None, "frame", "crank", (0, 0, 0), (1, 0, 0)), law),
        ("ForceLaw by one argument", built(mg.ForceLaw, "loads"), (("frame", "crank", (0, 0, 0), (1, 0, 0)),), law),
        (
            "ForceTable",
            lambda *a: built(mg.ForceLaw, "loads")("A", law=mg.ForceTable(*a)),
            ((0, 1), (0, 1, 2), ((1, 2, 3), (4, 5, 6)), "cubic", "hold"),
            {},
        ),
        ("Coupling", built(mg.Coupling, "couplings"), ({"A": 1.0, "B": 2.0},), {"name": "g", "constant": 0.0}),
        (
            "PairType",
            mg.PairType,
            ("Q", "mine"),
            {
                "freedoms": ["Rz", mg.Freedom("Tx", (0, 0, 0, 1, 0, 0))],
                "reactions": None,
                "efforts": None,
                "bookkeeping": mg.Bookkeeping((), ()),
                "directed": True,
                "square_second": False,
            },
        ),
        ("Freedom", lambda *a: mg.PairType("Q", freedoms=[mg.Freedom(*a)]), ("Rz", (0, 0, 1, 0, 0, 0), (0,) * 6), {}),
        (
            "Component",
            lambda *a: mg.PairType("Q", freedoms=["Rz"], reactions=["Fx", "Fy", "Fz", "Mx", mg.Component(*a)]),
            ("My", (0, 1, 0, 0, 0, 0), 0, (0,) * 6, False),
            {},
        ),
        ("Bookkeeping", lambda *a: mg.PairType("Q", freedoms=["Rz"], bookkeeping=mg.Bookkeeping(*a)), ((), ()), {}),
        (
            "chain",
            mg.chain,
            ("RRRR",),
            {
                "twist": [0] * 4,
                "length": [1, 2, 2.5, 3],
                "offset": [0] * 4,
                "pitch": None,
                "name": "c",
                "drive": "O1",
                "links": [],
            },
        ),
        ("Motion", mg.Motion, (0.0, 1.0, 2.0, 3.0), {}),
        ("Motion.law", mg.Motion.law, ("cycloidal", 1.0, 2.0, [0.0, 1.0]), {"start": 0.0}),
        (
            "Motion.law by samples",
            mg.Motion.law,
            ("sampled",),
            {"t": [0.0], "samples": ([0, 1, 2, 3], [0, 1, 2, 3]), "degree": 3},
        ),
        ("Motion.law of speed", mg.Motion.law, ("constant_speed",), {"t": [0.0], "speed": 2.0, "start": 1.0}),
        ("Motion.law by function", mg.Motion.law, (np.sin,), {"t": [0.0, 1.0]}),
        ("load", mg.load, ("four-bar",), {}),
        ("check", mg.check, (m, {"A": 0.1}), {"engine": "dense"}),
        ("assemble", mg.assemble, (m, {"A": 0.1}, {"B": 0.1}), {}),
        ("compile", mg.compile, (m,), {}),
        ("formulate", mg.formulate, (m, "lee", ["A"]), {"unknowns": "kinetostatics"}),
        (
            "solve",
            mg.solve,
            (m, {"A": [0.0, 0.1]}),
            {"method": "newton_euler", "loads": [], "redundant": "nan", "on_reach": "flag", "engine": "auto"},
        ),
        ("kinematics", mg.kinematics, (m, {"A": [0.0, 0.1]}), {"on_reach": "flag", "engine": "auto"}),
        ("solve with a motion", lambda *a: mg.solve(m, {"A": mg.Motion(*a)}), (0.0, 1.0), {}),
        ("solve with a load", lambda *a: mg.solve(m, {"A": [0.0, 0.1]}, loads=[mg.Effort("D", *a)]), (1.0,), {}),
        (
            "solve with a wrench",
            lambda *a: mg.solve(m, {"A": [0.0, 0.1]}, loads=[mg.Wrench("rocker", *a)]),
            ((0, 0, 1), None, (0, 0, 0)),
            {},
        ),
        (
            "study",
            study,
            (m, {"crank.mass": [1.0, 2.0]}, "A.effort", 2, 0),
            {
                "motions": {"A": 0.1},
                "sampling": "random",
                "method": "loop_wrench",
                "redundant": "nan",
                "engine": "auto",
                "progress": None,
            },
        ),
        (
            "study by function",
            study,
            (lambda x: m, {"x": scipy.stats.norm(1, 0.1)}, {"y": "A.effort"}, 2),
            {"motions": {"A": 0.1}},
        ),
        (
            "study of outputs",
            lambda *a: study(m, {"crank.mass": [1.0]}, {"y": a[0]}, 2, motions={"A": 0.1}),
            (lambda s: s["A"].effort,),
            {},
        ),
        ("Mechanism.replace", m.replace, (), {"drives": ["A"], "loads": [], "start": {"A": 0.0}}),
        ("Mechanism.replace more", m.replace, (), {"name": "x", "links": m.links, "pairs": m.pairs, "units": {}}),
        ("Mechanism.with_pair_type", m.with_pair_type, ("A", "H"), {"pitch": 0.1}),
        ("Mechanism.to_units", m.to_units, (), {"length": "mm", "mass": "g", "time": "s"}),
        ("Mechanism.moved", m.moved, (np.eye(4),), {}),
        ("Mechanism.with_tolerances", m.with_tolerances, (mg.Tolerances(),), {}),
        ("Tolerances", mg.Tolerances, (), {"rank": {"loop": 1e-6}, "path": {"iterations": 12}}),
        ("Mechanism.to_planar", m.to_planar, (), {"normal": Z}),
        ("Mechanism.to_spatial", m.to_planar().to_spatial, (), {"z": {"crank": 0.1}}),
        (
            "Segment",
            lambda *a, **k: mg.CamLaw([mg.Segment(*a, **k), RISE_AND_FALL[1]], turn=2.0),
            ("cycloidal",),
            {"rise": 0.01, "over": 1.0},
        ),
        (
            "least_base_radius",
            mg.least_base_radius,
            (mg.CamLaw([one.replace(over=np.pi) for one in RISE_AND_FALL]),),
            {"follower": "roller", "roller_radius": 0.01, "offset": 0.0, "max_pressure": 0.5, "least_radius": 0.0},
        ),
        ("least_preload", mg.least_preload, (made()[2][0], "K"), {"stiffness": 1.0, "freedom": None}),
        ("Mechanism.link", m.link, ("crank",), {}),
        ("Mechanism.pair", m.pair, ("A",), {}),
        ("Mechanism.coupling", gears.coupling, ("g",), {}),
        ("inertia.rod", mg.inertia.rod, (1.0, (0, 0, 0), (1, 0, 0)), {}),
        ("inertia.box", mg.inertia.box, (1.0, (1, 2, 3)), {"axes": np.eye(3)}),
        ("inertia.cylinder", mg.inertia.cylinder, (1.0, 1.0, 1.0, Z), {}),
        ("inertia.sphere", mg.inertia.sphere, (1.0, 1.0), {}),
        ("inertia.from_components", mg.inertia.from_components, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), {}),
        ("inertia.shifted", mg.inertia.shifted, (np.eye(3), 1.0, (0, 0, 1)), {}),
        (
            "parts.cylinder",
            mg.parts.cylinder,
            ("j", "a", (0, 0), "b", (1, 0)),
            {"mass": 2.0, "bore": 0.1, "pressure": 3.0},
        ),
        ("parts.cylinder about", mg.parts.cylinder, ("j", "a", (0, 0, 0), "b", (1, 0, 0)), {"axis": Z}),
        ("parts.rod", mg.parts.rod, ("j", "a", (0, 0, 0), "b", (1, 0, 0)), {"axis": Z, "mass": 2.0}),
        (
            "parts.spring_strut",
            mg.parts.spring_strut,
            ("j", "a", (0, 0, 0), "b", (1, 0, 0)),
            {"stiffness": 1.0, "free_length": 1.0, "damping": 1.0, "axis": Z, "mass": 1.0},
        ),
        ("parts.bearings", mg.parts.bearings, ("j", "a", "b", [(0, 0, 0), (0, 0, 1)], Z), {"fixed": 1}),
        ("parts.screw_drive", mg.parts.screw_drive, ("j", "a", (0, 0, 0), "b", (1, 0, 0)), {"lead": 0.1, "mass": 1.0}),
        (
            "parts.cardan_shaft",
            mg.parts.cardan_shaft,
            ("j", "a", (0, 0, 0), "b", (1, 0, 0)),
            {"axis_a": (1, 1, 0), "axis_b": (1, 0, 0), "phase": 0.0, "mass": 1.0},
        ),
        (
            "parts.rack_and_pinion",
            mg.parts.rack_and_pinion,
            ("j", "a", (0, 0, 0), Z, (1, 0, 0)),
            {"radius": 0.1, "pressure_angle": 0.3},
        ),
        (
            "parts.gear_stage",
            mg.parts.gear_stage,
            ("j", "a", (0, 0, 0), (1, 0, 0), Z),
            {"teeth": (20, 40), "module": 0.03, "helix_angle": 0.0, "internal": False},
        ),
        ("parts.four_bar", mg.parts.four_bar, ("j", "a", [(0, 0), (0, 1), (2, 1), (2, 0)], Z), {"mass": 1.0}),
        ("parts.slider_crank", mg.parts.slider_crank, ("j", "a", [(0, 0), (1, 0), (3, 0)], (1, 0), Z), {"mass": 1.0}),
        (
            "parts.planetary",
            mg.parts.planetary,
            ("j", 24, 30, 84, 3, True),
            {"module": 1.0, "base": "f", "point": (0, 0, 0), "axis": Z, "pressure_angle": 0.3, "helix_angle": 0.0},
        ),
        ("parts.Parts", mg.parts.Parts, ((), (), (), ()), {}),
        ("inertia.physical_faults", mg.inertia.physical_faults, (np.eye(3),), {"tol": 1e-9}),
    ]


@functools.cache
def rough_pin(m: mg.Mechanism) -> mg.Solution:
    """A motion with friction in a pin."""
    return mg.solve(m, {"A": mg.Motion([0.0, 0.1], 1.0)}, loads=[*m.loads, mg.Friction("A", mu=0.1, radius=0.01)])


def drawn_doors(folder: Path) -> list[Door]:
    """Pictures and pages."""
    (s, _), (f, _), (study, _) = (
        next(x for x in made() if type(x[0]).__name__ == n) for n in ("Solution", "Formulation", "Study")
    )
    m, ax = s.mechanism, show.draw_graph(s.mechanism)
    path = {"path": folder / "x.png"}
    curve = {"over": None, "ax": None, "marked": None}
    of_study = {"output": "A.effort", "ax": None, "part": None}
    return [
        ("write_report", mg.write_report, (m, s, study), {"path": folder / "x.html"}),
        (
            "show.animate",
            show.animate,
            (s, folder / "x.gif"),
            {
                "frames": 2,
                "fps": 5.0,
                "forces": True,
                "traces": True,
                "labels": True,
                "view": (20, 30),
                "size": (2, 1),
                "dpi": 20,
                "progress": None,
            },
        ),
        ("show.draw_chains", show.draw_chains, (list(mg.atlas(4)),), {"columns": 2, "titles": None}),
        ("show.draw_graph", show.draw_graph, (m,), {"ax": None}),
        (
            "show.draw_skeleton",
            show.draw_skeleton,
            (s, 0),
            {
                "ax": None,
                "ghosts": 1,
                "traces": True,
                "labels": True,
                "forces": True,
                "highlight": (),
                "view": (20, 30),
            },
        ),
        ("show.draw_sparsity", show.draw_sparsity, (f,), {"ax": None}),
        ("show.draw_structure", show.draw_structure, (m,), {"groups": None, "ax": None}),
        ("show.effort_curve", show.effort_curve, (s, "A"), curve),
        ("show.hodograph", show.hodograph, (s, None), {"of": "velocity", "ax": None}),
        (
            "show.least_base_radius",
            show.least_base_radius,
            (mg.CamLaw([one.replace(over=np.pi) for one in RISE_AND_FALL]),),
            {"angles": [0.3, 0.5], "ax": None},
        ),
        ("show.margin_curve", show.margin_curve, (s,), {"over": None, "ax": None}),
        ("show.point_path", show.point_path, (s, None), {"ax": None}),
        ("show.film_orbit", show.film_orbit, (s, "A", mg.Journal(1.0, 1.0, 0.001, 0.01)), {"ax": None}),
        ("show.friction_losses", show.friction_losses, (rough_pin(m),), {"ax": None}),
        ("show.polar_force", show.polar_force, (s, "A"), {"on": "a", "ax": None}),
        ("show.reaction_curve", show.reaction_curve, (s, "A"), {"moment": True, **curve}),
        ("show.reaction_ranges", show.reaction_ranges, (s,), {"moment": True, "ax": None}),
        ("show.save_picture", show.save_picture, (ax,), {"dpi": 50, **path}),
        ("show.study_bands", show.study_bands, (study,), {"over": None, **of_study}),
        ("show.study_histogram", show.study_histogram, (study,), {"position": None, "bins": 3, **of_study}),
        ("show.study_tornado", show.study_tornado, (study,), {"position": None, **of_study}),
    ]


@functools.cache
def further_doors(folder: Path) -> list[Door]:
    """Functions that find, read and write; shapes, gears, events and stops."""
    m = mg.load("four-bar").replace(drives=["A"])
    timed = mg.solve(m, {"A": mg.Motion([0.0, 0.1, 0.2], 1.0)})
    s, swung, chains = mg.solve(m, {"A": [0.0, 0.1]}), m.replace(drives=[]), tuple(mg.atlas(4))
    mg.save_chains(chains, folder / "chains.txt")
    tied = mg.Mechanism(
        "tied",
        None,
        [
            mg.Pair(n, "R", a, b, point=x, axis=(0, 0, 1))
            for n, a, b, x in (
                ("O", "f", "a", (0, 0, 0)),
                ("P", "a", "b", (1, 0, 0)),
                ("Q", "a", "c", (1, 0, 0)),
                ("R", "f", "b", (2, 0, 0)),
                ("S", "f", "c", (1, 1, 0)),
            )
        ],
    )
    Z, shape = (0, 0, 1), {"center": (0, 0, 0), "axis": (0, 0, 1), "second": None}
    profile = mg.Curve.line(point=(1, 0, 0), direction=(0, 0, 1), ends_at=(0.0, 1.0))

    def ready(kind: Callable, symbol: str) -> Callable:
        """A shape of a pair in a mechanism."""
        where, size = (
            {"Ps": "curve", "Rg": "curve", "Sg": "curve", "Sp": "surface"}[symbol],
            {"Sg": {"radius": 0.05}}.get(symbol, {}),
        )

        def made(**more: Any) -> object:
            shaped = mg.Pair(
                "N", symbol, "frame", "coupler", on_b=mg.Marker((0.1, 0, 0)), **size, **{where: kind(**more)}
            )
            return m.replace(pairs=[*m.pairs, shaped])

        return made

    def waiting(kind: Callable, what: str) -> Callable:
        return lambda *args, **more: mg.respond(swung, [0.0, 0.001], **{what: [kind(*args, **more)]})

    hinge = mg.Pair("A", "R", "frame", "p", point=(0, 0, 0), axis=Z)

    def geared(kind: Callable, second: mg.Pair) -> Callable:
        shafts = [hinge, second]
        return lambda *args, **more: mg.Mechanism("g", None, shafts, couplings=[kind(*args, **more)])

    spur, bevel, worm = (
        mg.Pair("B", "R", "frame", "w", point=x, axis=z)
        for x, z in (((1.5, 0, 0), Z), ((1.0, 0, 1.0), (1, 0, 0)), ((1.5, 0, 0), (0, 1, 0)))
    )
    rack = mg.Pair("B", "P", "frame", "w", point=(0, 0.1, 0), axis=(1, 0, 0))
    on_curve = lambda kind: ready(kind, "Ps")
    on_surface = lambda kind: ready(kind, "Sp")
    frame = {"frame": "minimizing", "guide": None}
    dyad, places = dyad_and_places()
    dyad = dyad.replace(links=[one.replace(points={"tip": (1, 1, 0)}) for one in dyad.links])
    corners = {"A": "frame crank 0 0", "B": "crank rod 0 1", "C": "rod rocker 3 2", "D": "frame rocker 3 0"}
    sides = [
        mg.Pair(n, "R", a, b, point=(float(x), float(y)))
        for n, (a, b, x, y) in ((n, c.split()) for n, c in corners.items())
    ]
    flat = mg.Mechanism("flat", None, sides, drives=["A"], planar=True)
    timed_at = {"A": [0.0, 0.1]}

    def sought(task: Any, unknown: str = "B.point") -> object:
        return mg.synthesize(dyad, task, [unknown])

    disc = mg.Pulley("q", "w", (1.5, 0, 0), Z, radius=0.1)

    def belted(**more: Any) -> object:
        return mg.Mechanism(
            "b",
            None,
            [hinge, spur],
            gears=[mg.Pulley("p", "p", (0, 0, 0), Z, radius=0.2), disc],
            couplings=[mg.BeltDrive(**more)],
        )

    flanks = {"pressure_angle": 0.3}

    def toothed(kind: Callable) -> Callable:
        return lambda *args, **more: mg.Mechanism("g", None, [hinge, spur], gears=[kind(*args, **more)])

    def meshed(*args: Any, **more: Any) -> mg.Mechanism:
        wheels = [mg.Gear("p", "p", 10, (0, 0, 0), Z, module=0.1), mg.Gear("w", "w", 20, (1.5, 0, 0), Z, module=0.1)]
        return mg.Mechanism("g", None, [hinge, spur], gears=wheels, couplings=[mg.Mesh(*args, **more)])

    def placed(*args: Any, **more: Any) -> object:
        return mg.Mechanism("b", None, [hinge, spur], gears=[mg.Pulley(*args, **more)])

    return [
        (
            "BeltDrive",
            belted,
            (),
            {"name": "b", "over": ["p", "q"], "backs": [], "length": None, "pretension": 3.0, "toothed": True},
        ),
        ("Mechanism.gear", placed("p", "w", (1.5, 0, 0), Z, 0.1).gear, ("p",), {}),
        ("Pulley", placed, ("p", "w", (1.5, 0, 0), Z), {"teeth": 20, "pitch": 0.1}),
        (
            "Gear",
            toothed(mg.Gear),
            ("p", "p", 10, (0, 0, 0), Z),
            {"module": 0.1, **flanks, "helix_angle": 0.0, "shift": 0.0, "width": 0.1},
        ),
        ("GearRack", toothed(mg.GearRack), ("p", "p", (0, 0, 0), (1, 0, 0), (0, 1, 0), 0.1), {**flanks, "width": 0.1}),
        (
            "BevelGear",
            toothed(mg.BevelGear),
            ("p", "p", 10, (0.1, 0, 0), Z, 0.1),
            {**flanks, "spiral_angle": 0.0, "cone": 0.3},
        ),
        ("Worm", toothed(mg.Worm), ("p", "p", 2, (0, 0, 0), Z, 0.1), {**flanks, "left_hand": False, "mark": (1, 0, 0)}),
        ("WormWheel", toothed(mg.WormWheel), ("p", "p", 20, (0, 0, 0), Z), {"mark": (1, 0, 0)}),
        ("Mesh", meshed, ("g", "p", "w"), {"backlash": 0.01, "flank": "forward"}),
        ("mesh_facts", mg.mesh_facts, (meshed("g", "p", "w"),), {}),
        ("planet_places", mg.planet_places, (20, 54, 3), {}),
        ("Belt", geared(mg.Belt, spur), ("g", "A", "B", (0.3, 0.2)), {"crossed": False}),
        (
            "BevelGears",
            geared(mg.BevelGears, bevel),
            ("g", "A", "B", (10, 20), 0.1),
            {"pressure_angle": 0.3, "spiral_angle": 0.0},
        ),
        (
            "SpurGears",
            geared(mg.SpurGears, spur),
            ("g", "A", "B", (10, 20), 0.1),
            {"pressure_angle": 0.3, "helix_angle": 0.0, "internal": False},
        ),
        ("Rack", geared(mg.Rack, rack), ("g", "A", "B", 0.1), {"pressure_angle": 0.3}),
        (
            "WormGear",
            geared(mg.WormGear, worm),
            ("g", "A", "B", (1, 20), 0.1),
            {"pressure_angle": 0.3, "left_hand": False},
        ),
        (
            "Hertz",
            lambda *a, **k: m.replace(
                pairs=[
                    *m.pairs,
                    mg.Pair(
                        "N",
                        "Sg",
                        "frame",
                        "coupler",
                        curve=mg.Curve.circle(radius=1.0),
                        point=(1.0, 0, 0),
                        radius=0.1,
                        hertz=mg.Hertz(*a, **k),
                    ),
                ]
            ),
            ((1.0, 2.0),),
            {"poisson": (0.3, 0.3), "groove_radius": 0.2, "length": None},
        ),
        (
            "Journal",
            lambda *a, **k: m.replace(
                pairs=[
                    *m.pairs,
                    mg.Pair("N", "R", "frame", "coupler", point=(0, 0, 0), axis=Z, film=mg.Journal(*a, **k)),
                ]
            ),
            (1.0, 1.0, 0.001, 0.01),
            {},
        ),
        *(
            (
                kind.__name__,
                lambda *a, kind=kind, **k: m.replace(
                    pairs=[
                        *m.pairs,
                        mg.Pair(
                            "N", "W", "frame", "coupler", point=(0, 0, 0), **{kind.__name__.lower(): kind(*a, **k)}
                        ),
                    ]
                ),
                (),
                dict.fromkeys(("Fx", "Fy", "Fz", "Mx", "My", "Mz"), 1.0),
            )
            for kind in (mg.Stiffness, mg.Misfit)
        ),
        ("Curve", mg.Curve, (), frame),
        (
            "Curve.line",
            on_curve(mg.Curve.line),
            (),
            {**frame, "point": (0, 0, 0), "direction": Z, "ends_at": (0.0, 1.0)},
        ),
        ("Curve.circle", on_curve(mg.Curve.circle), (), {**frame, **shape, "radius": 1.0, "angles": None}),
        ("Curve.ellipse", on_curve(mg.Curve.ellipse), (), {**frame, **shape, "a": 1.0, "b": 2.0}),
        (
            "Curve.helix",
            ready(mg.Curve.helix, "Sg"),
            (),
            {**frame, **shape, "radius": 1.0, "pitch": 0.1, "angles": (0.0, 1.0)},
        ),
        (
            "Curve.involute",
            on_curve(mg.Curve.involute),
            (),
            {**frame, **shape, "radius": 1.0, "angles": (0.1, 1.0), "mirrored": False},
        ),
        (
            "Curve.through",
            on_curve(mg.Curve.through),
            (),
            {**frame, "points": [(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 1, 0)], "closed": False},
        ),
        (
            "Curve.function",
            on_curve(mg.Curve.function),
            (),
            {**frame, "position": line, "ends_at": (0.0, 1.0), "closed": False},
        ),
        (
            "Curve.cam",
            on_curve(mg.Curve.cam),
            (),
            {
                **frame,
                **shape,
                "angle": turn(),
                "base_radius": 1.0,
                "roller_radius": 0.1,
                "lift": rise(),
                "slope": rise(1),
                "bend": rise(2),
                "offset": 0.0,
                "follower": "roller",
            },
        ),
        (
            "Curve.arm_cam",
            on_curve(mg.Curve.arm_cam),
            (),
            {
                **frame,
                **shape,
                "angle": turn(),
                "base_radius": 1.0,
                "roller_radius": 0.1,
                "swing": rise(),
                "slope": rise(1),
                "bend": rise(2),
                "arm": 2.0,
                "pivot": 2.5,
                "mirrored": False,
                "offset": 0.0,
                "follower": "roller",
                "law": None,
            },
        ),
        (
            "Curve.barrel",
            ready(mg.Curve.barrel, "Rg"),
            (),
            {
                "center": (0, 0, 0),
                **shape,
                "law": None,
                "angle": turn(),
                "lift": rise(),
                "slope": rise(1),
                "bend": rise(2),
                "roller_radius": 0.1,
                "radius": 1.0,
            },
        ),
        (
            "Curve.globoid",
            ready(mg.Curve.globoid, "Rg"),
            (),
            {
                **shape,
                "law": None,
                "angle": turn(),
                "swing": rise(),
                "slope": rise(1),
                "bend": rise(2),
                "roller_radius": 0.1,
                "distance": 3.0,
                "arm": 1.0,
            },
        ),
        ("Surface", mg.Surface, (), {}),
        ("Surface.plane", on_surface(mg.Surface.plane), (), shape),
        ("Surface.sphere", on_surface(mg.Surface.sphere), (), {**shape, "radius": 1.0}),
        ("Surface.cylinder", on_surface(mg.Surface.cylinder), (), {**shape, "radius": 1.0}),
        ("Surface.cone", on_surface(mg.Surface.cone), (), {**shape, "half_angle": 0.3}),
        ("Surface.torus", on_surface(mg.Surface.torus), (), {**shape, "radius": 2.0, "tube": 0.5}),
        ("Surface.revolution", on_surface(mg.Surface.revolution), (), {**shape, "profile": profile}),
        (
            "Surface.patch",
            on_surface(mg.Surface.patch),
            (),
            {"points": [(x, y, 0.1 * x * y) for x in range(4) for y in range(4)], "rows": 4},
        ),
        (
            "Surface.function",
            on_surface(mg.Surface.function),
            (),
            {"position": sheet, "ends_u": (0.0, 1.0), "ends_v": (0.0, 1.0)},
        ),
        ("Event", waiting(mg.Event, "events"), ("A", 1.0), {}),
        ("Stop", waiting(mg.Stop, "stops"), ("A", -1.0, 1.0), {"restitution": 0.5}),
        ("poses", lambda *a, **k: sought(mg.poses(*a, **k)), ("body", places.places), {"at": {}}),
        (
            "path",
            lambda *a, **k: sought(mg.path(*a, **k), "B.point.x"),
            ("body.tip", [(1, 1), (1, 2)]),
            {"at": timed_at},
        ),
        (
            "function",
            lambda *a, **k: mg.synthesize(flat, mg.function(*a, **k), ["B.point.x"]),
            ("A", "D", [(0, 0), (0.2, 0.1)]),
            {"scale": "given"},
        ),
        ("positions", lambda *a: sought(mg.positions(*a)), ([{"body": row} for row in places.places],), {}),
        (
            "synthesize",
            mg.synthesize,
            (dyad, places, ["B.point"]),
            {
                "bounds": {"B.point.x": (0, 9)},
                "conditions": {"size": (None, 9)},
                "require": [],
                "seed": 0,
                "cache": True,
            },
        ),
        (
            "synthesize over",
            mg.synthesize,
            (dyad, places, ["B.point"]),
            {"sweep": {"A.point.x": [0.0, 0.1]}, "over": {"A": [0.0, 0.1]}, "progress": None},
        ),
        (
            "synthesize nearly",
            mg.synthesize,
            (flat, mg.function("A", "D", [(0, 0), (0.2, 0.1), (0.4, 0.25), (0.5, 0.3)]), ["B.point.x"]),
            {"fit": "least_squares", "minimize": None, "maximize": None, "starts": 2},
        ),
        (
            "SynthesisSetup",
            lambda *a, **k: mg.synthesize(dyad.replace(synthesis=mg.SynthesisSetup(*a, **k))),
            (places, ["B.point"]),
            {
                "fit": None,
                "bounds": {"B.point.x": (0, 9)},
                "conditions": {"size": (None, 9)},
                "require": ["branch"],
                "minimize": None,
                "maximize": None,
                "sweep": {},
                "over": {},
                "starts": 2,
            },
        ),
        (
            "ResponseSetup",
            lambda **k: mg.respond(swung.replace(response=mg.ResponseSetup(**k))),
            (),
            {
                "time": (0.0, 0.001),
                "points": 2,
                "start": None,
                "rates": None,
                "motions": (),
                "rtol": 1e-8,
                "atol": 1e-10,
                "method": "auto",
                "passive": "free",
                "events": (),
                "stops": (),
            },
        ),
        (
            "MultipleJoint",
            lambda *a: mg.identify(m, joints=[mg.MultipleJoint(*a)]),
            (("crank", "coupler", "rocker"), ("B", "C")),
            {},
        ),
        (
            "assemblies",
            mg.assemblies,
            (m, {"A": 0.1}),
            {"seed": 0, "guesses": 10, "turns": 1.0, "cache": True, "progress": None},
        ),
        (
            "branches",
            mg.branches,
            (m, "A"),
            {"over": (0.0, 0.5), "samples": 3, "points": 30, "seed": 0, "cache": True, "progress": None},
        ),
        (
            "atlas",
            lambda *a, **k: list(itertools.islice(mg.atlas(*a, **k), 3)),
            (4, 1),
            {"joints": None, "family": 3, "types": ("R",), "multiple": False, "fractionated": False},
        ),
        ("system_groups", lambda *a: list(itertools.islice(mg.system_groups(*a), 3)), (1, 2), {}),
        ("save_chains", mg.save_chains, (chains, folder / "more.txt"), {}),
        ("load_chains", lambda *a: list(mg.load_chains(*a)), (folder / "chains.txt",), {}),
        ("save", mg.save, (m, folder / "x.toml"), {}),
        ("identify", mg.identify, (m, 3), {"joints": []}),
        ("multiple_joints", mg.multiple_joints, (m, {"A": 0.1}), {}),
        ("split_joint", mg.split_joint, (tied, "P", "b"), {"at": None}),
        ("equilibrium", mg.equilibrium, (swung, {"A": 0.1}), {"engine": "dense"}),
        ("linearize", mg.linearize, (swung, {"A": 0.1}), {"engine": "dense"}),
        ("groups", mg.groups, (m, ["A"]), {"engine": "dense", "at": {"A": 0.1}}),
        ("structure", mg.structure, (m, ["A"]), {"engine": "dense", "at": {"A": 0.1}}),
        ("free_body", mg.free_body, (s, "crank"), {}),
        ("over_time", mg.over_time, (timed, (0, 0, 0)), {}),
        ("transmission", mg.transmission, (s, "D", "A"), {}),
        (
            "respond",
            mg.respond,
            (swung, [0.0, 0.001]),
            {
                "start": {"A": 0.1},
                "rates": {"A": 0.0},
                "motions": {},
                "loads": [],
                "rtol": 1e-6,
                "atol": 1e-8,
                "method": "RK45",
                "engine": "auto",
                "events": [],
                "stops": [],
                "on_stop": "raise",
                "passive": "free",
                "tol": None,
                "progress": None,
            },
        ),
        ("inertia.physical", mg.inertia.physical, (np.eye(3), 1e-9), {}),
        ("Mechanism.snapped", m.snapped, (1e-6,), {}),
        ("Mechanism.equivalent", m.equivalent, ({"A": 0.1},), {"rollers": "removed"}),
    ]


def line(u: Any) -> Any:
    """A curve by a function."""
    one, none = np.ones_like(u), np.zeros_like(u)
    return [np.stack(x) for x in ((u, u**2, none), (one, 2 * u, none), (none, 2 * one, none), (none, none, none))]


def sheet(u: Any, v: Any) -> Any:
    """A surface by a function."""
    one, none = np.ones_like(u), np.zeros_like(u)
    first = [np.stack(x) for x in ((u, v, none), (one, none, none), (none, one, none))]
    return [*first, *[np.stack((none, none, none))] * 7]


def turn() -> Any:
    """Angles of a cam."""
    return np.linspace(0.0, 2 * np.pi, 61)


def rise(order: int = 0) -> Any:
    """Lift of a cam, and its derivatives."""
    return (0.1 * (1 - np.cos(turn())), 0.1 * np.sin(turn()), 0.1 * np.cos(turn()))[order]


@functools.cache
def every_door(folder: Path) -> tuple[Door, ...]:
    """All public callables with arguments that they take."""
    every = (*declared_doors(), *further_doors(folder), *drawn_doors(folder), *result_doors(folder))
    return tuple(one for one in every if one[2] or one[3])
