"""Round trips: random mechanisms of many topologies are among the answers to their own motion."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mechgraph as mg

SLOW = pytest.mark.slow
FUNCTIONS = [
    ("RRRR", "B.point.x C.point.y"),
    ("RRRP", "B.point.x C.point.y"),
    ("RRPR", "B.point.x B.point.y"),
    ("RPRR", "C.point.x C.point.y"),
    ("PRRP", "B.point.x C.point.y"),
    ("PRRR", "B.point.x C.point.y"),
    ("R-S-S-R", "B.point.x C.point.y"),
    ("P-S-S-P", "B.point.x C.point.y"),
    *(
        pytest.param(*case, marks=SLOW)
        for case in (
            ("R-S-S-P", "B.point.x C.point.y"),
            ("R-S-C-R", "B.point.x C.point.y"),
            ("R-C-S-R", "B.point.x C.point.y"),
            ("R-S-R-C", "B.point.x C.point.y"),
            ("R-R-S-C", "B.point.x C.point.y"),
            ("R-P-S-C", "B.axis.x C.point.y"),
            ("R-S-U-R", "B.point.x C.point.y"),
            ("R-U-S-R", "B.point.x C.point.y"),
            ("R-C-C-C", "B.axis.x C.axis.y"),
            ("R-Sp-R", "B.point.x B.axis.y"),
            ("R-Sp-P", "B.point.x B.axis.y"),
            ("R-Sg-C", "B.point.x B.axis.y"),
            ("R-Cp-C", "C.axis.x C.axis.y"),
            ("R-E-U-R", "B.axis.x C.point.y"),
            ("R-E-C-R", "B.axis.x C.axis.y"),
            ("RRRRRRR 01 12 23 03 34 45 05", "B.point.x F.point.y"),
            ("RRRRRRR 01 12 23 03 24 45 05", "B.point.x F.point.y"),
        )
    ),
]
"""Types of pairs, in space with dashes, of a loop or between the links named (Watt, Stephenson); and which numbers are sought."""


def random_mechanism(name: str, rng: np.random.Generator) -> mg.Mechanism:
    """Pairs A, B, ... at random places about a circle."""
    types, *joined = name.split()
    planar, symbols = "-" not in types, types.split("-") if "-" in types else list(types)
    n, pairs = len(symbols), list[mg.Pair]()
    joined = joined or [f"{i}{(i + 1) % n}" for i in range(n)]
    for i, (symbol, (a, b)) in enumerate(zip(symbols, joined, strict=True)):
        point = np.array([np.cos(2 * np.pi * i / n), np.sin(2 * np.pi * i / n), 0]) + rng.uniform(-0.3, 0.3, 3)
        axis = rng.normal(size=3)
        where = {} if symbol == "S" or (planar and symbol == "R") else {"axis": axis * (1, 1, not planar)}
        if symbol in ("U", "Cp"):
            where["second"] = np.cross(axis, rng.normal(size=3))
        pairs.append(mg.Pair("ABCDEFG"[i], symbol, f"link{a}", f"link{b}", point=point * (1, 1, not planar), **where))
    return mg.Mechanism(name, pairs=pairs, planar=planar, frame="link0")


def changed(m: mg.Mechanism, numbers: Mapping[str, float]) -> mg.Mechanism:
    """A mechanism with other components of points and axes."""
    for name, value in numbers.items():
        pair, field, at = name.split(".")
        vector = np.array(getattr(m.pair(pair), field), dtype=float)
        vector["xyz".index(at)] = value
        m = m.replace(pairs=[p.replace(**{field: vector}) if p.name == pair else p for p in m.pairs])
    return m


def found_again(
    own: mg.Mechanism, task: object, unknown: list[str], rng: np.random.Generator, **options: object
) -> bool:
    """Whether a mechanism is among the answers where other numbers than its own are declared."""
    values = np.array(
        [getattr(own.pair(p), field)["xyz".index(at)] for p, field, at in (n.split(".") for n in unknown)]
    )
    declared = changed(own, dict(zip(unknown, values + rng.uniform(0.03, 0.08, len(values)), strict=True)))
    s = mg.synthesize(declared, task, unknown, **options)
    return bool(np.abs(s.values - values).max(axis=1).min(initial=1.0) < 1e-8)


@pytest.mark.parametrize(("name", "unknown"), FUNCTIONS)
def test_a_random_mechanism_is_among_those_that_do_its_own_function(name: str, unknown: str) -> None:
    rng, angles = np.random.default_rng(1), np.array([0.0, 0.2, 0.4])
    while True:
        own = random_mechanism(name, rng)
        s = mg.kinematics(own, {"A": angles}, on_reach="flag")
        if (s.status == "ok").all():
            break
    output = own.pairs[-1].freedom_names[0]
    task = mg.function("A", output, np.column_stack([angles, s[output[0]].position[:, 0]]))
    assert found_again(own, task, unknown.split(), rng)


def displacement(pair: mg.Pair, rng: np.random.Generator) -> np.ndarray:
    """A random motion that a pair allows, in the global frame."""
    out, axis = np.eye(4), np.asarray(pair.axis if pair.type.symbol != "S" else rng.normal(size=3))
    turns, slides = {"P": (0, 1), "C": (1, 1)}.get(pair.type.symbol, (1, 0))
    angle, way = rng.uniform(0.2, 0.8, 2) * (turns, slides)
    out[:3, :3] = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    out[:3, 3] = np.asarray(pair.point) - out[:3, :3] @ pair.point + way * axis
    return out


@pytest.mark.parametrize(
    ("name", "unknown", "further"),
    [
        ("RR 01 12", "B.point.x B.point.y", 2),
        ("PR 01 12", "B.point.x B.point.y", 2),
        ("R-S 01 12", "B.point.x B.point.y", 1),
        pytest.param("S-S 01 12", "B.point.x B.point.y B.point.z", 3, marks=SLOW),
        pytest.param("C-S 01 12", "B.point.x B.point.y", 2, marks=SLOW),
        pytest.param("R-C 01 12", "B.point.x B.axis.x B.axis.y", 1, marks=SLOW),
        pytest.param("C-C 01 12", "B.point.x B.axis.y", 1, marks=SLOW),
    ],
)
def test_a_random_chain_is_among_those_that_lead_a_link_through_its_own_places(
    name: str, unknown: str, further: int
) -> None:
    rng = np.random.default_rng(2)
    own = random_mechanism(name, rng)
    places = [np.linalg.multi_dot([np.eye(4), *(displacement(p, rng) for p in own.pairs)]) for _ in range(further)]
    assert found_again(own, mg.poses("link2", [np.eye(4), *places]), unknown.split(), rng)


def groove() -> tuple[mg.Mechanism, str, str]:
    """A pin that slides along y and stays in the circular groove of a disc."""
    at = (0.1, 0.2 + np.sqrt(0.96), 0)
    circle = mg.Curve.circle(radius=1.0, center=(0.3, 0.2, 0))
    pairs = [
        mg.Pair("A", "R", "frame", "disc", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("K", "Ps", "disc", "pin", curve=circle, point=at, closed="form"),
        mg.Pair("F", "P", "frame", "pin", point=at, axis=(0, 1, 0)),
    ]
    return mg.Mechanism("groove", pairs=pairs, drives=["A"]), "F", "A.point.x A.point.y"


def sphere() -> tuple[mg.Mechanism, str, str]:
    """A slide on a crank, with a tip that stays on a sphere."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0.1, 0, 0), axis=(0, 1, 0)),
        mg.Pair("B", "P", "crank", "slide", point=(0.1, 0, 0), axis=(0.2, 0, 0.4)),
        mg.Pair("K", "Sp", "frame", "slide", surface=mg.Surface.sphere(radius=0.5), point=(0.3, 0, 0.4)),
    ]
    return mg.Mechanism("sphere", pairs=pairs, drives=["A"]), "B", "A.point.x A.point.z"


@pytest.mark.parametrize("made", [groove, sphere])
def test_a_mechanism_with_a_curve_or_surface_is_found_again_by_a_fit(made) -> None:
    own, output, unknown = made()
    angles = np.linspace(0.0, 2.0, 7)
    task = mg.function("A", output, np.column_stack([angles, mg.kinematics(own, {"A": angles})[output].position[:, 0]]))
    with pytest.raises(mg.DeclarationError, match="pairs K: curves and surfaces are made of pieces"):
        mg.synthesize(own, task, unknown.split())
    assert found_again(own, task, unknown.split(), np.random.default_rng(0), fit="least_squares", starts=1)
    with pytest.raises(mg.DeclarationError, match=r"K\.\w+\.radius: only points and directions can be fitted"):
        mg.synthesize(own, task, [f"K.{'curve' if made is groove else 'surface'}.radius"], fit="least_squares")
