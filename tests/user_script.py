"""A user's script with types, checked by mypy --strict together with the package, and run by a test.

What a type checker must refuse stands in ``refused`` behind ``type: ignore``; an ignore that is not needed is an error in strict mode.
"""

import numpy as np
import numpy.typing as npt

import mechgraph as mg

Array = npt.NDArray[np.float64]


def boom(mass: float = 80.0) -> mg.Mechanism:
    """A boom on a cylinder; points and axes as tuples, lists and arrays."""
    links = [mg.Link("ground"), mg.Link("boom", mass=mass, center=[1, 0, 0]), mg.Link("rod"), mg.Link("barrel")]
    pairs = [
        mg.Pair("A", "R", "ground", "boom", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("B", "R", "boom", "rod", point=np.array([1, 0, 0]), axis=[0, 0, 1]),
        mg.Pair("C", "P", "barrel", "rod", point=(1, 0, 0), axis=(1, 1, 0)),
        mg.Pair("D", "R", "barrel", "ground", point=(0, -1, 0), axis=(0, 0, 1)),
    ]
    loads = [mg.Gravity((0, -9.81, 0)), mg.Wrench("boom", force=(0, -100, 0), point=(2, 0, 0))]
    loads.append(mg.TorsionSpring("A", stiffness=10))
    return mg.Mechanism("boom", links, pairs, ["C"], loads, units={"length": "m"}, start={"A": 0})


def stiffening(x: Array, v: Array, t: Array | None) -> Array:
    """A law of force."""
    return -10 * x**3 - v


def placed() -> list[mg.ForceLaw | mg.Damper]:
    """Laws in a freedom, between two points in one argument, and in four."""
    points = ("boom", "ground", (2, 0, 0), (2, -1, 0))
    return [
        mg.ForceLaw("A", law=stiffening),
        mg.ForceLaw(points, law=mg.ForceTable(x=[0, 1, 2], force=[0, -1, -4])),
        mg.ForceLaw(a="boom", b="ground", p="tip", q=(2, -1, 0), law=stiffening),
        mg.Damper("C", coefficient=3),
        mg.Damper(points, coefficient=3.0),
    ]


def solved() -> mg.Solution:
    """Loads of one kind, of several, with those that are declared; motions by arrays and by ``Motion``."""
    m, stroke = boom(), {"C": np.linspace(0, 0.2, 5)}
    one, several = (
        [mg.Gravity((0, -9.81, 0))],
        [mg.Effort("C", 3.0), mg.Spring("boom", "ground", (1, 0, 0), (1, 1, 0), 50)],
    )
    mg.solve(m, stroke, loads=one, actuate=["C"], redundant="minimum_norm")
    mg.solve(m, stroke, loads=[*m.loads, *several], method="newton_euler", on_reach="flag")
    mg.kinematics(m.replace(loads=several), {"C": 0.1})
    return mg.solve(m, {"C": mg.Motion(stroke["C"], velocity=0.1, acceleration=0.0)}, loads=several)


def read(s: mg.Solution) -> dict[str, Array]:
    """Results with their types."""
    pair, link = s["C"], s.link("boom")
    status: npt.NDArray[np.str_] = s.status
    assert (status == "ok").all()
    return {
        "effort": pair.effort,
        "reaction": pair.reaction,
        "Fx": pair.components["Fx"],
        "center": link.center,
        "pose": link.pose,
    }


def looked_at(m: mg.Mechanism) -> tuple[bool, int, list[str]]:
    """The report, the printed equations, a study, a response."""
    report = mg.check(m, at={"C": 0.1})
    unique: dict[str, dict[str, bool]] = report.unique
    f = mg.formulate(m, bookkeeping="minimal")
    A, b = f.assemble(mg.solve(m, {"C": 0.1}).state())
    assert A.shape == (len(b), len(f.unknowns))
    study = mg.study(
        boom, {"mass": [70, 80, 90]}, ["C.effort"], motions={"C": [0.0, 0.1]}, sampling="grid", executor=None
    )
    means: Array = study.outputs["C.effort"].mean(axis=0)
    r = mg.respond(m.replace(drives=[]), np.linspace(0, 0.1, 3), rates={"A": 0}, loads=[mg.Gravity((0, 0, 0))])
    energy: Array = r.energy.kinetic
    return report.determinate, report.mobility_by_count, [*unique, f.text(), str(means.shape), str(energy.shape)]


def refused(m: mg.Mechanism) -> None:
    """What is wrong is seen before it runs; never called."""
    mg.solve(m, method="nope")  # type: ignore[arg-type]
    mg.solve(m, on_reach="stop", redundant="none")  # type: ignore[arg-type]
    mg.solve(m, loads=mg.Gravity((0, 0, -1)))  # type: ignore[arg-type]
    mg.solve(m, loads=["gravity"])  # type: ignore[list-item]
    mg.solve("boom")  # type: ignore[arg-type]
    mg.Mechanism("boom", pairs=[mg.Link("A")])  # type: ignore[list-item]
    mg.ForceLaw(("boom", "ground"), law=stiffening)  # type: ignore[arg-type]
    mg.ForceLaw(3, law=stiffening)  # type: ignore[arg-type]
    mg.Damper("A", 3.0)  # type: ignore[call-arg, arg-type]
    mg.Wrench("boom", frame="local")  # type: ignore[arg-type]
