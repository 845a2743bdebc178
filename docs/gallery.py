"""The gallery of the manual: more than thirty mechanisms, each with a picture, a film, its numbers and its source.

A mechanism is drawn from what a solution gives of it: a link joins the points of its pairs, and the path of a pair's marker on its first
link is the guide or slot there. Gears, pulleys, belts and cams of a planar one are those of ``mechgraph.show``.
``python docs/gallery.py`` draws them all below ``docs/_built``.
"""

from __future__ import annotations

import hashlib
import runpy
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

import mechgraph as mg
from mechgraph.quantities import FORCE, LENGTH, MOMENT, POWER, unit_of
from mechgraph.show.scene import scene

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "_built" / "gallery"
SIZE, MARGIN, FRAMES, SECONDS = 220.0, 26.0, 36, 4
COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#6b3a00")
SI = {"length": "m", "mass": "kg", "time": "s"}
BODIES = ("wheel", "face", "strand", "roller")
VIEW = np.array([[0.82, -0.57, 0.0], [0.2, 0.29, 0.94]])
"""Right and up of a view from above and the side."""


@dataclass(frozen=True)
class Entry:
    """A mechanism of the gallery: its title, how it is made and moved, and the page that tells more."""

    title: str
    made: Callable[[], mg.Solution]
    more: str = ""
    source: str = ""

    @property
    def slug(self) -> str:
        """The name of its files."""
        return "-".join("".join(c if c.isalnum() else " " for c in self.title.lower()).split())


def library(name: str) -> Callable[[], mg.Solution]:
    """A mechanism of the library over its stored motion, or as its stored response moves."""

    def made() -> mg.Solution:
        m = mg.load(name)
        if m.response is not None:
            return mg.respond(m, np.linspace(0.0, 1.0, 2 * FRAMES) * np.max(m.response.time))
        return mg.solve(m)

    return made


def example(
    number: str, declared: str, motions: Callable[[], dict[str, Any]], *arguments: Any
) -> Callable[[], mg.Solution]:
    """A mechanism that an example declares."""

    def made() -> mg.Solution:
        (script,) = (ROOT / "examples").glob(f"{number}_*.py")
        return mg.solve(runpy.run_path(str(script))[declared](*arguments), motions())

    return made


def turn(name: str, speed: float = 10.0, end: float = 360.0) -> Callable[[], dict[str, Any]]:
    """A freedom that rotates evenly."""
    return lambda: {name: mg.Motion(np.deg2rad(np.linspace(0.0, end, 73)), velocity=speed)}


def corner() -> dict[str, Any]:
    """Both wheels of an axle that takes a corner."""
    t = np.linspace(0.0, 1.0, 73)
    return {"L": mg.Motion(5.0 * t, 5.0), "R": mg.Motion(8.0 * t, 8.0)}


def dig() -> mg.Solution:
    """The excavator of example 12 on its path."""
    names = runpy.run_path(str(ROOT / "examples" / "12_excavator.py"))
    solution: mg.Solution = names["dig"](names["excavator"]())
    return solution


def ride() -> mg.Solution:
    """The suspension of example 13 over the travel of its wheel."""
    names = runpy.run_path(str(ROOT / "examples" / "13_five_rod_suspension.py"))
    m = names["suspension"]()
    return mg.kinematics(m, {m.drives[0].freedom: np.linspace(-0.06, 0.06, 25)} if m.drives else None)


def stages() -> mg.Solution:
    """Two stages of spur gears and a rack, in the plane."""
    at = {"A": (0.0, 0.0), "B": (0.048, 0.036), "C": (0.108, 0.036)}
    pairs = [
        mg.Pair(k, "R", "frame", link, point=at[k]) for k, link in zip(at, ("pinion", "shaft", "wheel"), strict=True)
    ]
    meshes = [
        mg.SpurGears("first stage", "A", "B", teeth=(20, 40), module=0.002),
        mg.SpurGears("second stage", "B", "C", teeth=(18, 42), module=0.002),
    ]
    m = mg.Mechanism(
        "two stages", pairs=pairs, couplings=meshes, drives=["A"], loads=[mg.Effort("C", 20.0)], planar=True, units=SI
    )
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.0, np.deg2rad(420.0), 73), velocity=10.0)})


def floating_sun() -> mg.Solution:
    """A planetary set whose sun floats between three planets, which share the load as statics asks."""
    z, arm = (0, 0, 1), 0.042
    at = [(arm * np.cos(a), arm * np.sin(a), 0) for a in 2 * np.pi * np.arange(3) / 3]
    pairs = [
        mg.Pair("S", "E", "frame", "sun", point=(0, 0, 0), axis=z),
        mg.Pair("C", "R", "frame", "arm", point=(0, 0, 0), axis=z),
    ]
    pairs += [mg.Pair(f"P{i}", "R", "arm", f"planet {i}", point=p, axis=z) for i, p in enumerate(at)]
    gears = [mg.Gear("sun", "sun", 24, (0, 0, 0), z, module=0.002)]
    gears += [mg.Gear("ring", "frame", 60, (0, 0, 0), z, module=0.002, internal=True)]
    gears += [mg.Gear(f"planet {i}", f"planet {i}", 18, p, z, module=0.002) for i, p in enumerate(at)]
    meshes = [mg.Mesh(f"{other} {i}", other, f"planet {i}") for i in range(3) for other in ("sun", "ring")]
    m = mg.Mechanism(
        "floating sun",
        pairs=pairs,
        gears=gears,
        couplings=meshes,
        drives=["S.Rz"],
        loads=[mg.Effort("C", -40.0)],
        units=SI,
    )
    return mg.solve(m, {"S.Rz": mg.Motion(np.linspace(0.0, np.deg2rad(420.0), 73), velocity=10.0)})


def tensioner() -> mg.Solution:
    """A belt over three pulleys, held tight by a spring on the arm of its idler."""
    z, at = (0, 0, 1), {"p": (0.0, 0.0, 0.0), "w": (0.2, 0.0, 0.0), "i": (0.1, 0.022, 0.0)}
    radii = {"p": 0.016, "w": 0.032, "i": 0.02}
    joints = [
        ("A", "frame", "p", at["p"]),
        ("B", "frame", "w", at["w"]),
        ("C", "arm", "i", at["i"]),
        ("D", "frame", "arm", (0.15, 0.07, 0)),
    ]
    pairs = [mg.Pair(name, "R", a, b, point=p, axis=z) for name, a, b, p in joints]
    m = mg.Mechanism(
        "tensioner", pairs=pairs, gears=[mg.Pulley(k, k, p, z, radius=radii[k]) for k, p in at.items()], drives=["A"],
        couplings=[mg.BeltDrive("belt", over=["w", "i", "p"], backs=["i"])],
        loads=[mg.Effort("B", -3.0), mg.TorsionSpring("D", stiffness=6.0, free=0.7)], units=SI,
    )  # fmt: skip
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.0, 4 * np.pi, 73), velocity=10.0)})


def engine() -> mg.Solution:
    """An engine in the plane, its gas force known over two turns of the crank."""
    angle = np.deg2rad([0, 10, 25, 60, 120, 180, 360, 540, 600, 660, 700, 720])
    gas = mg.ForceTable(x=angle, force=-np.array([3.2, 4.0, 2.4, 0.8, 0.3, 0.1, 0.1, 0.1, 0.2, 0.6, 1.8, 3.2]) * 1e3)
    links = [
        mg.Link("frame"), mg.Link("crank", 1.2, (0.0, 0.01), 0.002), mg.Link("rod", 0.5, (0.0, 0.08), 0.0015),
        mg.Link("piston", 0.4, (0.0, 0.19), 0.0002),
    ]  # fmt: skip
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)), mg.Pair("B", "R", "crank", "rod", point=(0, 0.045)),
        mg.Pair("C", "R", "rod", "piston", point=(0, 0.19)), mg.Pair("D", "P", "frame", "piston", point=(0, 0.19), axis=(0, 1)),
    ]  # fmt: skip
    loads = [mg.ForceLaw("D", reads="A", law=gas)]
    about = "Engine: gas force on the piston, read from the angle of the crank"
    m = mg.Mechanism("engine", links, pairs, ["A"], loads, planar=True, units=SI, description=about)
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.0, 4 * np.pi, 145), velocity=200.0)})


def scca() -> mg.Solution:
    """A cam with SCCA rise and return that lifts a rod through a roller against a spring, in the plane."""
    shares = {"sine": 0.25, "constant": 0.5, "cosine": 0.25}
    flanks = [mg.Segment("scca", rise, over=2.0, **shares) for rise in (0.016, -0.016)]
    rest = mg.Segment("dwell", over=2 * np.pi - 5.0)
    law = mg.CamLaw([flanks[0], mg.Segment("dwell", over=1.0), flanks[1], rest])
    profile = mg.Curve.cam(law=law, base_radius=0.03, roller_radius=0.009, offset=0.006, second=(0, 1, 0))
    top = np.sqrt(0.039**2 - 0.006**2)
    pairs = [
        mg.Pair("A", "R", "frame", "cam", point=(0, 0)), mg.Pair("B", "Ps", "cam", "rod", curve=profile, closed="force"),
        mg.Pair("C", "P", "frame", "rod", point=(-0.006, top + 0.04), axis=(0, 1)),
    ]  # fmt: skip
    spring = mg.Spring("frame", "rod", (-0.006, top + 0.11), (-0.006, top + 0.05), stiffness=2e3, free_length=0.07)
    links = [mg.Link("frame"), mg.Link("cam"), mg.Link("rod", 0.3, (-0.006, top + 0.02), 1e-4)]
    m = mg.Mechanism("cam with roller", links, pairs, ["A"], [spring], planar=True, units=SI)
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.0, 2 * np.pi, 73), velocity=30.0)})


def indexer() -> mg.Solution:
    """A barrel cam that carries a table on and holds it: its roller runs between the walls of a groove."""
    law = mg.CamLaw([
        mg.Segment("modified_sine", 0.06, over=2.4), mg.Segment("dwell", over=0.8),
        mg.Segment("modified_sine", -0.06, over=2.4), mg.Segment("dwell", over=2 * np.pi - 5.6),
    ])  # fmt: skip
    barrel, at = mg.Curve.barrel(law=law, radius=0.05, roller_radius=0.008, second=(1, 0, 0)), (0.05, 0, 0)
    pairs = [
        mg.Pair("A", "R", "frame", "barrel", point=(0, 0, -0.02), axis=(0, 0, 1)),
        mg.Pair("K", "Rg", "barrel", "table", curve=barrel, point=at),
        mg.Pair("B", "P", "frame", "table", point=(0.09, 0, 0), axis=(0, 0, 1)),
    ]
    links = [mg.Link("frame"), mg.Link("barrel"), mg.Link("table", 4.0, (0.09, 0, 0))]
    m = mg.Mechanism("barrel indexer", links, pairs, ["A"], units=SI)
    return mg.solve(m, {"A": mg.Motion(np.linspace(0.0, 2 * np.pi, 73), velocity=10.0)})


def serpentine() -> mg.Solution:
    """A serpentine belt: five pulleys, two of them on its back, one of these the idler of a tensioner."""
    at = {
        "crank": (0.0, 0.0),
        "alternator": (0.2, 0.1),
        "idler": (0.125, 0.14),
        "steering": (0.02, 0.24),
        "pump": (-0.06, 0.13),
    }
    radii = {"crank": 0.07, "alternator": 0.03, "idler": 0.035, "steering": 0.06, "pump": 0.05}
    pairs = [mg.Pair(k, "R", "arm" if k == "idler" else "frame", k, point=p) for k, p in at.items()]
    pairs.append(mg.Pair("arm", "R", "frame", "arm", point=(0.15, 0.21)))
    belt = mg.BeltDrive("belt", over=[*at], backs=["idler", "pump"], toothed=False)
    loads = [mg.Effort(k, M) for k, M in (("alternator", -4.0), ("steering", -9.0), ("pump", 3.0))]
    m = mg.Mechanism(
        "serpentine belt", pairs=pairs, gears=[mg.Pulley(k, k, p, radius=radii[k]) for k, p in at.items()], drives=["crank"],
        couplings=[belt], loads=[*loads, mg.TorsionSpring("arm", stiffness=40.0, free=-1.0)], planar=True, units=SI,
    )  # fmt: skip
    return mg.solve(m, {"crank": mg.Motion(np.linspace(0.0, 4 * np.pi, 73), velocity=100.0)})


def v_twin() -> mg.Solution:
    """A V-twin that its gas forces, known over the angle of the crank, speed up against a load."""
    reach, rod = 0.04, 0.14
    angle = np.deg2rad([0, 10, 25, 60, 120, 180, 360, 540, 600, 660, 700, 720])
    gas = np.array([3.2, 4.0, 2.4, 0.8, 0.3, 0.1, 0.1, 0.1, 0.2, 0.6, 1.8, 3.2]) * 1e3
    pin = np.array([reach * np.sin(np.pi / 4), reach * np.cos(np.pi / 4)])
    links = [mg.Link("frame"), mg.Link("crank", 3.0, (0.0, 0.0), 0.03)]
    pairs, loads = [mg.Pair("A", "R", "frame", "crank", point=(0, 0))], []
    for name, side in (("left", -1.0), ("right", 1.0)):
        along = np.array([side, 1.0]) / np.sqrt(2)
        across = pin - (pin @ along) * along
        top = (pin @ along + np.sqrt(rod**2 - across @ across)) * along
        links += [mg.Link(f"{name} rod", 0.4, (pin + top) / 2, 8e-4), mg.Link(f"{name} piston", 0.3, top, 1e-4)]
        pairs += [
            mg.Pair(f"{name} pin", "R", "crank", f"{name} rod", point=pin),
            mg.Pair(f"{name} eye", "R", f"{name} rod", f"{name} piston", point=top),
            mg.Pair(name, "P", "frame", f"{name} piston", point=top, axis=along),
        ]
        # a table over the angle of the crank, which begins at the dead center of the right piston
        firing = angle - 4 * np.pi + (np.pi / 2 if side < 0 else 0.0)
        cycles = np.concatenate([firing[:-1] + 4 * np.pi * k for k in range(6)] + [firing[:1] + 24 * np.pi])
        table = mg.ForceTable(x=cycles, force=-np.append(np.tile(gas[:-1], 6), gas[0]))
        loads.append(mg.ForceLaw(name, reads="A", law=table))
    about = "V-twin in time: gas forces on both pistons, read from the angle of the crank"
    loads.append(mg.Damper(freedom="A", coefficient=0.2))
    m = mg.Mechanism("V-twin", links, pairs, [], loads, planar=True, units=SI, description=about)
    return mg.respond(m, np.linspace(0.0, 0.16, 161), rates={"A": 100.0})


def page(name: str, blocks: int) -> dict[str, Any]:
    """What the first blocks of a page of the manual declare."""
    text = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    found: dict[str, Any] = {}
    for block in text.split("```python\n")[1 : blocks + 1]:
        code = block.partition("```")[0]
        exec("\n".join(line for line in code.splitlines() if "show." not in line and "print(" not in line), found)
    return found


def press() -> mg.Solution:
    """The toggle press of the tutorial, with friction in its pins and its guide."""
    told = page("tutorials/press", 1)
    rough = [mg.Friction(name, mu=0.12, radius=0.03) for name in "ABCDEF"] + [mg.Friction("G", mu=0.12, length=0.2)]
    m = told["m"].replace(loads=[*told["m"].loads, *rough], description="Toggle press with friction in all pairs")
    return mg.solve(m, {"A": mg.Motion(np.deg2rad(np.linspace(-120, -5, 73)), velocity=2.0)})


def jack() -> mg.Solution:
    """A scissor jack: its screw turns in a collar and pulls the knees together; thread, collar and pins rub."""
    low, high, half = 0.05, 0.25, 0.16
    middle, x, y, z = 0.5 * (low + high), (1, 0, 0), (0, 1, 0), (0, 0, 1)
    sides = {"left": -1, "right": 1}
    pairs = [
        mg.Pair("guide", "P", "base", "top", point=(0, 0, high), axis=z),
        *(mg.Pair(f"foot {k}", "R", "base", f"lower {k}", point=(0.02 * n, 0, low), axis=y) for k, n in sides.items()),
        *(
            mg.Pair(f"knee {k}", "R", f"lower {k}", f"upper {k}", point=(n * half, 0, middle), axis=y)
            for k, n in sides.items()
        ),
        *(mg.Pair(f"head {k}", "R", f"upper {k}", "top", point=(0.02 * n, 0, high), axis=y) for k, n in sides.items()),
        mg.Pair("bearing", "R", "lower left", "block", point=(-half, 0, middle), axis=y),
        mg.Pair("collar", "R", "block", "screw", point=(-half, 0, middle), axis=x),
        mg.Pair("thread", "H", "screw", "nut", point=(half, 0, middle), axis=x, lead=0.004),
        mg.Pair("trunnion", "R", "lower right", "nut", point=(half, 0, middle), axis=y),
    ]
    dry = [mg.Friction(p.name, mu=0.1, radius=0.006) for p in pairs if p.name.split()[0] in ("foot", "knee", "head")]
    dry += [
        mg.Friction("thread", mu=0.12, radius=0.008, flank=np.deg2rad(15)),
        mg.Friction("collar", mu=0.12, thrust_radius=0.01),
    ]
    about = "Scissor jack with friction in screw, collar and pins"
    load = mg.Wrench("top", force=(0, 0, -8e3), point=(0, 0, high))
    m = mg.Mechanism("jack", pairs=pairs, drives=["collar"], loads=[load, *dry], units=SI, description=about)
    return mg.solve(m, {"collar": mg.Motion(np.linspace(0, 150, 61), velocity=6.0)})


def bearing() -> mg.Solution:
    """The engine of the page on oil films, its big-end bearing with a film."""
    told = page("how-to/oil-film", 1)
    film = mg.Journal(radius=0.024, length=0.03, clearance=30e-6, viscosity=0.01)
    m = told["m"]
    m = m.replace(
        pairs=[p.replace(film=film) if p.name == "big end" else p for p in m.pairs],
        description="Engine with an oil film in its big-end bearing",
    )
    return mg.solve(m, {"turn.Rz": mg.Motion(told["angle"], velocity=told["w"])}, loads=[told["push"]])


def table() -> mg.Solution:
    """A table on four elastic feet, one of them short: it leans, and lifts off where the load asks for it."""
    z, at = (0, 0, 1), [(0.5, 0.4), (-0.5, 0.4), (-0.5, -0.4), (0.5, -0.4)]
    feet = [
        mg.Pair(f"foot {i + 1}", "Sp", "floor", "table", point=(x, y, 0), axis=z, stiffness={"Fz": 2e6}, closed="force",
                misfit={"Fz": -1e-3 * (i == 0)})
        for i, (x, y) in enumerate(at)
    ]  # fmt: skip
    guide = mg.Pair("guide", "Fr", "floor", "table", point=(0, 0, 0), axis=z)
    links, drives = [mg.Link("floor"), mg.Link("table", 40.0, (0.1, -0.06, 0.7))], ["guide.Tx", "guide.Ty", "guide.Rz"]
    about = "Table on four elastic feet, one of them 1 mm short"
    m = mg.Mechanism("table", links, [*feet, guide], drives, [mg.Gravity((0, 0, -9.81))], units=SI, description=about)
    return mg.solve(m, dict.fromkeys(drives, np.zeros(1)), redundant="elastic")


def woodpecker() -> mg.Solution:
    """The woodpecker toy, with the numbers of Glocker's thesis (1995): its sleeve grips the pole and slips, its beak strikes.

    With its geometry in full a cycle takes .1938 s; equations linear in the angles give the .1460 s in print.
    """
    pole, half, pivot, far, beak = 2.5e-3, 5.8e-3, 0.01, 0.015, (4.9e-3, 0.02)
    start, line = {"M": -0.05, "S": -0.1}, mg.Curve.line(point=(pole, 0, 0), direction=(0, -1, 0))
    links = [
        mg.Link("pole"),
        mg.Link("slider"),
        mg.Link("sleeve", 3e-4, (0, 0), 5e-9),
        mg.Link("bird", 4.5e-3, (pivot + far, 0), 7e-7),
    ]
    pairs = [
        mg.Pair("G", "P", "pole", "slider", point=(0, 0), axis=(0, 1)),
        mg.Pair("M", "R", "slider", "sleeve", point=(0, 0)),
        mg.Pair("S", "R", "sleeve", "bird", point=(pivot, 0)),
    ]
    # where the sleeve and the beak stand beside the pole as the motion begins
    m = mg.Mechanism("woodpecker", links, pairs, planar=True, units=SI)
    begun = mg.kinematics(m.replace(drives=["G", "M", "S"]), {"G": 0.0, **start})
    touching = {
        "beak": ("bird", (*beak, 0)),
        "below": ("sleeve", (3.1e-3, -half, 0)),
        "above": ("sleeve", (3.1e-3, half, 0)),
    }
    loads: list[Any] = [mg.Gravity((0, -9.81)), mg.Spring(freedom="S", stiffness=5.6e-3)]
    for name, (link, at) in touching.items():
        across = (begun.link(link).pose @ [*at, 1.0])[0]
        on = {"on_a": mg.Marker((pole, at[1], 0), (0, 0, 1), (0, -1, 0)), "on_b": mg.Marker(at, (0, 0, 1), (0, -1, 0))}
        bounce = 0.5 if name == "beak" else 0.0
        pairs.append(
            mg.Pair(name, "Ps", "pole", link, **on, closed="force", curve=line, restitution=bounce, gap=across - pole)
        )
        loads.append(mg.Friction(name, mu=0.3))
    about = "Woodpecker toy: friction holds the sleeve on the pole and lets it go, and the beak strikes"
    m = m.replace(pairs=pairs, loads=loads, description=about)
    return mg.respond(
        m, np.linspace(0.0, 0.2, 81), start=start, rates={"G": 0.0, "M": 0.0, "S": -7.4583}, rtol=1e-4, atol=1e-6
    )


ENTRIES = [
    Entry("Four-bar", library("four-bar"), "../tutorials/crank-rocker.md"),
    Entry("Slider-crank", library("slider-crank"), "../tutorials/slider-crank.md"),
    Entry("Ellipsograph", library("marghitu-2-1")),
    Entry("Shaper", library("marghitu-2-2")),
    Entry("Six-bar with two slotted levers", library("marghitu-2-6")),
    Entry("Six-bar with a slide", library("marghitu-2-7")),
    Entry("Wedges", library("marghitu-2-8")),
    Entry("Lifting jack", library("marghitu-2-5")),
    Entry("Two four-bars in a row", library("windows-2"), "../how-to/vibrations.md"),
    Entry("Andrews' squeezer", library("andrews"), "../explanation/forward-dynamics.md"),
    Entry("Geneva wheel", library("geneva"), "../how-to/slots-and-curves.md"),
    Entry("Cam with roller arm", example("16", "mechanism", turn("A", 20.0)), "../how-to/cam.md"),
    Entry("SCCA cam with roller", scca, "../tutorials/cam-from-law-to-dxf.md"),
    Entry("Barrel indexer", indexer, "../how-to/cam.md"),
    Entry("Two stages of gears", stages, "../tutorials/helical-reducer.md"),
    Entry("Differential", example("14", "rear_axle", corner), "../how-to/gears.md"),
    Entry("Planetary set with a floating sun", floating_sun, "../how-to/floating-sun.md"),
    Entry("Belt drive with a tensioner", tensioner, "../how-to/idler-and-tensioner.md"),
    Entry("Serpentine belt", serpentine, "../how-to/belts.md"),
    Entry("V-twin with gas forces in time", v_twin, "../how-to/planar.md"),
    Entry("Engine in the plane", engine, "../how-to/planar.md"),
    Entry("Toggle press with friction", press, "../tutorials/press.md"),
    Entry("Screw jack with friction", jack, "../how-to/friction.md"),
    Entry("Con-rod bearing of an engine", bearing, "../how-to/oil-film.md"),
    Entry("Table on four feet", table, "../how-to/misfits.md"),
    Entry("Woodpecker toy", woodpecker, "../how-to/simulate.md"),
    Entry("Planetary train", example("14", "planetary", turn("S", 10.0, 1260.0), 1), "../how-to/gears.md"),
    Entry("Excavator", dig, "../tutorials/excavator.md"),
    Entry("Five-rod suspension", ride),
    Entry("Globoid cam", example("17", "mechanism", turn("A"))),
    Entry("Spherical four-bar", library("spherical-four-bar")),
    Entry("Bennett's linkage", library("bennett"), "../explanation/mobility.md"),
    Entry("Bricard's linkage on a cube", library("bricard-cube")),
    Entry("Sarrus linkage", library("marghitu-2-3")),
    Entry("RSSR", library("rssr"), "../how-to/passive-freedoms.md"),
    Entry("RSUP", library("marghitu-2-9")),
    Entry("Haug's slider-crank", library("haug-slider-crank"), "../how-to/simulate.md"),
    Entry("Ball press", example("02", "ball_press", turn("A")), "../how-to/contacts.md"),
    Entry("Lee's RCSR", library("rcsr"), "../tutorials/lee-rcsr.md"),
    Entry("Lee's RCSR-CSR", library("rcsr-csr"), "../explanation/lee.md"),
    Entry("Lee's RCHCH", library("rchch"), "../how-to/equations.md"),
    Entry("7R", library("7r"), "../how-to/assembly-modes.md"),
    Entry("Sphere in a groove", library("r-sg-c")),
    Entry("Sphere on a plane", library("r-sp-r")),
]


class Film:
    """What is drawn of a solution: lines, dots and circles at every frame, in the plane of the picture."""

    def __init__(self, s: mg.Solution) -> None:
        m = s.mechanism
        good = np.flatnonzero(np.asarray(s.status).reshape(-1) == "ok")
        chosen = good[np.unique(np.linspace(0, len(good) - 1, FRAMES).round().astype(int))]
        self.poses = {name: s.link(name).pose.reshape(-1, 4, 4)[chosen] for name in m.link_names()}
        self.frame, self.loop = m.frame, len(chosen) > 1
        ends = {
            (p.name, link): self.at(link, marker.pose()[:3, 3])
            for p in m.pairs
            for link, marker in zip((p.a, p.b), p.markers, strict=True)
        }
        every = np.concatenate([path.reshape(-1, 3) for path in ends.values()])
        self.view = view(every)
        self.found = scene(s)
        self.t = np.searchsorted(self.found.positions, chosen)
        # gears, pulleys, belts and cams of a planar mechanism
        ground = {one.frame for one in self.found.parts if one.role == "foot" and one.frame.startswith("pair:")}
        self.slides = {frame.partition(":")[2].partition("@")[0] for frame in ground}
        self.bodies = [
            one
            for one in self.found.parts
            if self.found.normal is not None
            and (one.role in BODIES or (one.role == "foot" and one.frame in ground) or one.owner in self.slides)
        ]
        profiles = {(part.owner, part.link) for part in self.found.parts if part.role == "wheel" and part.shape.faces}
        self.lines: list[tuple[str, str, Any]] = []
        self.dots: list[tuple[str, Any]] = []
        self.circles: list[tuple[str, Any, Any]] = []
        for name in m.link_names():
            points = [ends[key] for key in ends if key[1] == name and key not in profiles]
            joined = (
                [(one, np.mean(points, axis=0)) for one in points] if len(points) > 3 else [*combinations(points, 2)]
            )
            self.lines += [("link", name, self.seen(np.stack(pair, axis=1))) for pair in joined if name != m.frame]
        for p in m.pairs:
            inverse = np.linalg.inv(self.poses[p.a])
            path = np.einsum("tij,tj->ti", inverse[:, :3, :3], ends[p.name, p.b]) + inverse[:, :3, 3]
            if (
                p.name not in self.slides
                and (p.name, p.a) not in profiles
                and np.linalg.norm(np.ptp(path, axis=0)) > 1e-6 * np.linalg.norm(np.ptp(every, axis=0))
            ):
                self.lines.append(("guide", p.a, self.seen(np.stack([self.at(p.a, q) for q in path], axis=1))))
            apart = ends[p.name, p.a], ends[p.name, p.b]
            if p.curve is None and p.a != m.frame and np.abs(apart[0] - apart[1]).max() > 1e-6 * np.ptp(every):
                self.lines.append(("link", p.a, self.seen(np.stack(apart, axis=1))))  # it reaches to what slides on it
            fixed = m.frame in (p.a, p.b) and p.name not in self.slides
            self.dots.append(("foot" if fixed else "pin", self.seen(ends[p.name, p.b][:, None])[:, 0]))
        for gear in m.couplings if self.found.normal is None else ():
            if hasattr(gear, "teeth"):
                contact = s.coupling(gear.name).point.reshape(-1, 3)[chosen]
                for name in (gear.a, gear.b):
                    pair = next(p for p in m.pairs if p.name == str(name).partition(".")[0])
                    middle = ends[pair.name, pair.b]
                    self.circles.append(
                        (pair.b, self.seen(middle[:, None])[:, 0], np.linalg.norm(contact - middle, axis=1))
                    )
        self.links = [name for name in m.link_names() if name != m.frame]
        low, high = (f(axis=0) for f in (self.extent().min, self.extent().max))
        self.scale = (SIZE - 2 * MARGIN) / max(*(high - low), 1e-12)
        self.middle = (low + high) / 2

    def at(self, link: str, point: Any) -> Any:
        """A point of a link at every frame."""
        pose = self.poses[link]
        return pose[:, :3, :3] @ np.asarray(point) + pose[:, :3, 3]

    def seen(self, points: Any) -> Any:
        """Points as they are seen, right and up."""
        return points @ self.view.T

    def extent(self) -> Any:
        """All places in the picture."""
        round_ = [np.concatenate([at - r[:, None], at + r[:, None]]) for _, at, r in self.circles]
        bodies = [self.seen(self.found.vertices(part, t)) for part in self.bodies for t in self.t[::4]]
        return np.concatenate(
            [*(x.reshape(-1, 2) for _, _, x in self.lines), *(x for _, x in self.dots), *round_, *bodies]
        )

    def body(self, part: Any, animated: Callable[..., str]) -> str:
        """One of them: an outline that moves as its frame does."""
        X, width = self.found.frames[part.frame][self.t], {"face": 2.5, "roller": 2.0}.get(part.role, 1.0)
        at = self.placed(self.seen(X[:, :, 3]))
        A = np.einsum("ij,tjk->tik", self.view, X[:, :, :3]) * self.scale * np.array([[1.0], [-1.0]])
        if part.role == "strand":
            ends = np.stack([at, at + A[:, :, 2]], axis=1)
            points = [" ".join(f"{a:.1f},{b:.1f}" for a, b in row) for row in ends]
            return f'<polyline points="{points[0]}" fill="none" stroke="#3e4c59" stroke-width="2">{animated("points", points)}</polyline>'
        local = part.shape.vertices @ A[0].T
        path = "".join(
            "M" + "L".join(f"{a:.1f},{b:.1f}" for a, b in local[list(line)])
            for line in (*part.shape.lines, *part.shape.faces[: part.shape.rims])
        )
        turn = np.unwrap(np.arctan2(*(A @ np.linalg.pinv(A[0]))[:, ::-1, 0].T))
        moves = [f"{a:.2f} {b:.2f}" for a, b in at], [f"{angle:.2f}" for angle in np.rad2deg(turn)]
        color = self.color(part.link or self.frame)
        fill = color if part.role in ("wheel", "roller") and part.shape.faces else "none"
        inner = f'<path d="{path}" fill="{fill}" fill-opacity="0.28" fill-rule="evenodd" stroke="{color}" stroke-width="{width}"/>'
        inner = f'<g transform="rotate({moves[1][0]})">{inner}{animated("transform", moves[1], "rotate")}</g>'
        return f'<g transform="translate({moves[0][0]})">{inner}{animated("transform", moves[0], "translate")}</g>'

    def placed(self, points: Any) -> Any:
        """Places in the picture, in its units."""
        return (points - self.middle) * self.scale * [1, -1] + SIZE / 2

    def color(self, link: str) -> str:
        """The color of a link."""
        return "#7b8794" if link == self.frame else COLORS[self.links.index(link) % len(COLORS)]

    def elements(self, moving: bool) -> Iterator[str]:
        """The elements of the picture; the film moves to and fro if the mechanism does not return."""
        closed = self.loop and all(np.abs(x[0] - x[-1]).max() * self.scale < 12 for _, x in self.dots)

        def animated(attribute: str, values: list[str], transform: str = "") -> str:
            if not moving or len(set(values)) == 1:
                return ""
            every = values if closed else values + values[-2:0:-1]
            kind = f'animateTransform type="{transform}"' if transform else "animate"
            return f'<{kind} attributeName="{attribute}" dur="{SECONDS}s" repeatCount="indefinite" values="{";".join(every)}"/>'

        def drawn(kind: str, fixed: str, values: dict[str, list[str]]) -> str:
            first = " ".join(f'{name}="{value[0]}"' for name, value in values.items())
            return f"<{kind} {first} {fixed}>{''.join(animated(*item) for item in values.items())}</{kind}>"

        # a card is small, and its film is not read closely: teeth from a third of the pixels on
        bodies = [one for one in self.bodies if one.scales[0] <= 3.0 * self.scale < one.scales[1]]
        yield from (self.body(part, animated) for part in bodies if part.role != "roller")
        for style, link, x in self.lines:
            how = 'stroke-width="5" stroke-linecap="round"' if style == "link" else 'stroke-width="1.6" opacity="0.65"'
            yield drawn(
                "polyline",
                f'fill="none" stroke="{self.color(link)}" {how}',
                {"points": [" ".join(f"{a:.1f},{b:.1f}" for a, b in self.placed(row)) for row in x]},
            )
        for link, x, r in self.circles:
            at = self.placed(x)
            yield drawn(
                "circle",
                f'fill="none" stroke="{self.color(link)}" stroke-width="2"',
                {
                    "cx": [f"{v:.1f}" for v in at[:, 0]],
                    "cy": [f"{v:.1f}" for v in at[:, 1]],
                    "r": [f"{v * self.scale:.1f}" for v in r],
                },
            )
        yield from (self.body(part, animated) for part in bodies if part.role == "roller")
        for style, x in self.dots:
            at = self.placed(x)
            fill = "#1f2933" if style == "foot" else "#ffffff"
            yield drawn(
                "circle",
                f'r="4" fill="{fill}" stroke="#1f2933" stroke-width="1.6"',
                {"cx": [f"{v:.1f}" for v in at[:, 0]], "cy": [f"{v:.1f}" for v in at[:, 1]]},
            )

    def svg(self, moving: bool) -> str:
        """The picture, or the film."""
        inner = "\n".join(self.elements(moving))
        size = f'viewBox="0 0 {SIZE:g} {SIZE:g}" width="{SIZE:g}" height="{SIZE:g}"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{inner}\n</svg>\n'


def view(points: Any) -> Any:
    """Right and up of a view: along the normal of what is planar, from above and the side of what is not."""
    _, size, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if size[2] > 1e-6 * size[0]:
        return VIEW
    up = np.eye(3)[2] if abs(axes[2, 2]) < 0.9 else np.eye(3)[1]
    up = up - (up @ axes[2]) * axes[2]
    up /= np.linalg.norm(up)
    normal = axes[2] * (np.sign(axes[2] @ (0.01, -1.0, 0.1)) if abs(axes[2, 2]) < 0.9 else np.sign(axes[2, 2]))
    return np.stack([np.cross(up, normal), up])


def numbers(s: mg.Solution) -> str:
    """Links, pairs, mobility and redundancy, and the efforts of the drivers."""
    m, report = s.mechanism, mg.check(s.mechanism)
    text = f"{len(m.link_names())} links, {' '.join(p.type.symbol for p in m.pairs)}. "
    text += f"Mobility {report.mobility}, by count {report.mobility_by_count}; redundancy {report.redundancy}."
    for drive in m.drives if s.has_forces and m.loads else ():
        freedom = drive.freedom
        effort = s[freedom.partition(".")[0]].effort
        effort = effort[np.isfinite(effort).all(axis=-1)]
        if len(m.drives) == 1 and np.abs(effort).max() > 1e-9:
            turns = m.turns(freedom)
            unit = unit_of(m.units, MOMENT if turns else FORCE)
            ends = " to ".join(dict.fromkeys((f"{effort.min():.3g}", f"{effort.max():.3g}")))
            text += f" Driver {'torque' if turns else 'force'} {ends} {unit}".rstrip() + "."
    if s.has_forces and s.losses:
        power = np.sum([np.nanmean(lost) for lost in s.losses.values()])
        text += f" Friction takes {power:.3g} {unit_of(m.units, POWER)} on average."
    for p in m.pairs if s.has_forces else ():
        if p.film is not None:
            film = s.film(p.name)
            text += f" Least film in {p.name} {film.min:.3g} {unit_of(m.units, LENGTH)} at {film.at}."
        if p.misfit is not None and any(p.misfit.by_component.values()):
            bears = ", ".join(
                f"{q.name} {round(s[q.name].components['Fz'][0], 6) + 0.0:.3g}" for q in m.pairs if q.closed == "force"
            )
            text += f" Forces: {bears} {unit_of(m.units, FORCE)}."
    return text


def card(entry: Entry) -> str:
    """Draw a mechanism, and describe it."""
    s = entry.made()
    film = Film(s)
    for suffix, moving in (("", False), ("-film", True)):
        (FOLDER / f"{entry.slug}{suffix}.svg").write_text(film.svg(moving), encoding="utf-8")
    m, place = s.mechanism, f"/_built/gallery/{entry.slug}"
    about = " ".join(
        part
        for part in (m.description.partition(":")[0].rstrip(".") + "." if m.description else "", numbers(s))
        if part
    )
    source = m.source or entry.source
    return "\n".join(
        [
            f":::{{grid-item-card}} [{entry.title}]({entry.more.removeprefix('..')})"
            if entry.more
            else f":::{{grid-item-card}} {entry.title}",
            "",
            f"![{entry.title}]({place}.svg){{.still}}![]({place}-film.svg){{.film}}",
            "",
            about,
            *(["", "{.source}", source] if source else []),
            ":::",
        ]
    )


def draw() -> None:
    """Draw the gallery, unless it was drawn before as it stands."""
    stamp, current = FOLDER / ".drawn", hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    if stamp.exists() and stamp.read_text(encoding="utf-8") == current:
        return
    FOLDER.mkdir(parents=True, exist_ok=True)
    cards = [card(entry) for entry in ENTRIES]
    page = "\n".join(["::::{grid} 1 2 3 3", ":gutter: 3", "", *cards, "::::", ""])
    (FOLDER / "cards.md").write_text(page, encoding="utf-8")
    stamp.write_text(current, encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    draw()
