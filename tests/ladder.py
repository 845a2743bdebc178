"""Tasks of synthesis with known numbers of solutions: a mechanism, what is asked of it, what is unknown, and how many over C."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import mechgraph as mg

Rung = tuple[mg.Mechanism, Any, list[str], int]


def four_bar(**points: tuple[float, float]) -> mg.Mechanism:
    """A planar four-bar with pivots A, B, C, D and a point on its coupler."""
    at = {"A": (0.0, 0.0), "B": (0.3, 1.0), "C": (2.0, 1.5), "D": (2.2, 0.0), "tip": (1.5, 1.2)} | points
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("coupler", points={"tip": at["tip"]}), mg.Link("rocker")]
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    pairs = [mg.Pair(name, "R", *links_of, point=at[name]) for name, links_of in ends.items()]
    return mg.Mechanism("four-bar", links, pairs, drives=["A"], planar=True)


def dyad() -> mg.Mechanism:
    """A crank that guides a body, in a plane."""
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("body")]
    ends = {"A": ("frame", "crank"), "B": ("crank", "body")}
    pairs = [mg.Pair(name, "R", *of, point=(i, 0)) for i, (name, of) in enumerate(ends.items())]
    return mg.Mechanism("dyad", links, pairs, planar=True)


def slider_crank() -> mg.Mechanism:
    """A planar slider-crank."""
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("rod"), mg.Link("slider")]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
        mg.Pair("B", "R", "crank", "rod", point=(1, 0)),
        mg.Pair("C", "R", "rod", "slider", point=(3, 0.2)),
        mg.Pair("D", "P", "frame", "slider", point=(3, 0), axis=(1, 0)),
    ]
    return mg.Mechanism("slider-crank", links, pairs, drives=["A"], planar=True)


def by_markers(kind: str, **at: tuple[float, float]) -> mg.Mechanism:
    """A planar dyad or four-bar whose pairs are placed on each link by itself: ``A_a`` on the first link of A."""

    def pair(name: str, a: str, b: str) -> mg.Pair:
        sides = (mg.Marker((*at.get(f"{name}_{side}", (0.0, 0.0)), 0.0)) for side in "ab")
        return mg.Pair(name, "R", a, b, **dict(zip(("on_a", "on_b"), sides, strict=True)))

    last = "body" if kind == "dyad" else "coupler"
    made = [pair("A", "frame", "crank"), pair("B", "crank", last)]
    made += [pair("C", "coupler", "rocker"), pair("D", "frame", "rocker")] if kind == "four-bar" else []
    return mg.Mechanism(f"{kind} by markers", pairs=made, drives=["A"] if kind == "four-bar" else [], planar=True)


def geared_five_bar(B: tuple[float, float] = (0.2, 0.9), D: tuple[float, float] = (2.8, 1.1)) -> mg.Mechanism:
    """A five-bar whose second crank turns half as fast as the first."""
    at = {"A": (0, 0), "B": B, "C": (1.5, 1.5), "D": D, "E": (3, 0)}
    links = ["frame", "first", mg.Link("rod", points={"tip": at["C"]}), "other", "second"]
    ends = {"A": (0, 1), "B": (1, 2), "C": (2, 3), "D": (3, 4), "E": (0, 4)}
    links = [mg.Link(link) if isinstance(link, str) else link for link in links]
    pairs = [mg.Pair(n, "R", links[i].name, links[k].name, point=at[n]) for n, (i, k) in ends.items()]
    geared = [mg.Coupling({"A": -1, "E": 2})]
    return mg.Mechanism("geared five-bar", links, pairs, drives=["A"], planar=True, couplings=geared)


def spatial(name: str, *pairs: tuple[str, tuple[float, ...], tuple[float, ...] | None]) -> mg.Mechanism:
    """An open or closed chain of pairs O, P, Q, ... (type, point, axis) from the frame on; closed where there are three or more."""
    last = len(pairs) - 1
    links = ["frame", *(f"link{i}" for i in range(1, last + 1)), "frame" if last > 1 else "body"]
    made = [
        mg.Pair("OPQR"[i], symbol, links[i], links[i + 1], point=point, **({"axis": axis} if axis else {}))
        for i, (symbol, point, axis) in enumerate(pairs)
    ]
    return mg.Mechanism(name, pairs=made, drives=["O"] if last > 1 else [])


def turned(n: int, shift: float) -> np.ndarray:
    """Poses ``(n, 4, 4)``, the first the identity."""
    out = np.tile(np.eye(4), (n, 1, 1))
    out[1:, :3, :3] = Rotation.from_rotvec(np.random.default_rng(3).normal(size=(n - 1, 3))).as_matrix()
    out[1:, :3, 3] = shift * np.random.default_rng(4).normal(size=(n - 1, 3))
    return out


def _rows(n: int, columns: int, first: tuple[float, ...] = ()) -> np.ndarray:
    out = np.random.default_rng(5).uniform(-1.0, 1.0, (n, columns))
    out[0] = first or 0.0
    return out


ONE, TWO = (0.0, 0.2, 1.0), (0.0, 1.0, 0.4)
LADDER: dict[str, Callable[[], Rung]] = {
    "R-R dyad, 5 poses": lambda: (dyad(), mg.poses("body", _rows(5, 3)), ["A.point", "B.point"], 4),
    "R-R dyad, 3 poses": lambda: (dyad(), mg.poses("body", _rows(3, 3)), ["B.point"], 1),
    "R-R dyad, 4 poses": lambda: (dyad(), mg.poses("body", _rows(4, 3)), ["A.point.y", "B.point"], 3),
    "R-R dyad, 2 poses and a velocity": lambda: (
        dyad(), mg.poses("body", _rows(2, 3), twists=[[1, 0.2, 0.5], [np.nan] * 3]), ["B.point"], 1,
    ),
    "four-bar function, 5 pairs": lambda: (four_bar(), mg.function("A", "D", _rows(5, 2)), ["B.point", "C.point"], 3),
    "slider-crank function, 5 pairs": lambda: (
        slider_crank(), mg.function("A", "D", _rows(5, 2)), ["B.point", "C.point"], 3,
    ),
    "spherical R-R, 5 orientations": lambda: (
        spatial("spherical", ("R", (0, 0, 0), ONE), ("R", (0, 0, 0), (1.0, 0.4, 0.1))),
        mg.poses("body", turned(5, 0.0)), ["O.axis", "P.axis"], 6,
    ),
    "R-Sp-R function, 6 pairs": lambda: (
        spatial("R-Sp-R", ("R", (0, 0, 0), ONE), ("Sp", (1, 0.3, 0.1), (0.2, 0.4, 1)), ("R", (2, 0.2, 0.5), TWO)),
        mg.function("O", "Q", _rows(6, 2)), ["P"], 3,
    ),
    "four-bar path, 5 points, timed": lambda: (
        four_bar(), mg.path("coupler.tip", _rows(5, 2, (1.5, 1.2)), at={"A": _rows(5, 1)[:, 0]}),
        ["A.point", "B.point", "C.point", "D.point"], 12,
    ),
    "slider-crank function up to a factor, 5 pairs": lambda: (
        slider_crank(), mg.function("A", "D", _rows(5, 2), scale="free"), ["B.point.y", "C.point"], 3,
    ),
    "four-bar function by markers, 3 pairs": lambda: (
        by_markers("four-bar", B_a=(1, 0), C_a=(2.5, 0), C_b=(2, 0), D_a=(3, 0)).replace(start={"A": 0.5, "D": 1.6}),
        mg.function("A", "D", [[0.5, 1.6], [1.0, 1.7], [1.5, 1.9]]), ["B.on_a.point.x", "C.on_a.point.x", "C.on_b.point.x"], 4,
    ),
    "R-R dyad by markers, 3 poses": lambda: (
        by_markers("dyad"), mg.poses("body", _rows(3, 3)), ["B.on_a.point.x", "B.on_b.point"], 2,
    ),
    "geared five-bar path, 3 points, timed": lambda: (
        geared_five_bar(), mg.path("rod.tip", _rows(3, 2, (1.5, 1.5)), at={"A": [0, -0.2, -0.45]}), ["B.point", "D.point"], 1,
    ),
    "four-bar, a pose and two points": lambda: (
        four_bar(), mg.positions([{}, {"coupler": (0.3, -0.2, 0.4)}, {"coupler.tip": (1.2, 1.6)}, {"coupler.tip": (0.9, 1.7)}]),
        ["B.point", "C.point"], 6,
    ),
    "four-bar, function and path, 3 rows": lambda: (
        four_bar(), [mg.function("A", "D", _rows(3, 2)), mg.path("coupler.tip", _rows(3, 2, (1.5, 1.2)))],
        ["B.point", "C.point", "D.point"], 1,
    ),
    "four-bar, a timed point and a pose": lambda: (
        four_bar(),
        [
            mg.path("coupler.tip", [(1.5, 1.2), (1.2, 1.6), (np.nan, np.nan)], at={"A": [0, 0.4, np.nan]}),
            mg.poses("coupler", [[0] * 3, [np.nan] * 3, [0.3, -0.2, 0.4]]),
        ],
        ["B.point", "C.point"], 1,
    ),
    "RCCC, turns and slides at 3 positions": lambda: (
        spatial(
            "RCCC", ("R", (0, 0, 0), (0, 0, 1)), ("C", (0.3, 0.2, 0.1), (-0.7, 0.2, 1)), ("C", (1.2, 0.6, 0.4), (-0.3, 0.4, 1)),
            ("C", (1.5, 0, 0), (0.5, 1, 0.6)),
        ),
        [mg.function("O", f"R.{part}", [[0, 0], [0.4, turn], [0.9, 2 * turn]]) for part, turn in (("Rz", 0.2), ("Tz", 0.1))],
        ["Q"], 1,
    ),
    "RSSR-SC, 3 poses": lambda: (
        mg.Mechanism(
            "RSSR-SC",
            pairs=[
                mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0.2, 1)),
                mg.Pair("B", "S", "crank", "coupler", point=(1, 0, 0)),
                mg.Pair("C", "S", "coupler", "rocker", point=(2, 1, 0.5)),
                mg.Pair("D", "R", "frame", "rocker", point=(2, 0, 0), axis=(0.1, 0, 1)),
                mg.Pair("E", "S", "coupler", "slider", point=(0.5, 1.5, 0.8)),
                mg.Pair("F", "C", "frame", "slider", point=(0, 2, 0), axis=(1, 0.3, 0.2)),
            ],
            drives=["A"],
        ),
        mg.poses("coupler", turned(3, 0.3)), ["A", "D", "F.point"], 1,
    ),
    "four-bar of two dyads, 5 poses": lambda: (
        four_bar(), mg.poses("coupler", _rows(5, 3)), ["A.point", "B.point", "C.point", "D.point"], 12,
    ),
    "S-S dyad, 7 poses": lambda: (
        spatial("S-S", ("S", (0, 0, 0), None), ("S", (1, 0.3, 0.1), None)),
        mg.poses("body", turned(7, 1.0)), ["O.point", "P.point"], 20,
    ),
    "four-bar path, 5 points, both pivots given": lambda: (
        four_bar(), mg.path("coupler.tip", _rows(5, 2, (1.5, 1.2))), ["B.point", "C.point"], 36,
    ),
    "RSSR function, 7 pairs": lambda: (
        spatial("RSSR", ("R", (0, 0, 0), ONE), ("S", (0.5, 0.4, 0.1), None), ("S", (1.6, 0.5, 0.9), None), ("R", (2, 0.2, 0.5), TWO)),
        mg.function("O", "R", _rows(7, 2)), ["P.point", "Q.point"], 2,
    ),
}  # fmt: skip
LARGE: dict[str, Callable[[], Rung]] = {
    "four-bar function, 3 pairs and 2 slopes": lambda: (
        four_bar(), mg.function("A", "D", _rows(3, 2), rates=[np.nan, 0.6, 0.7]), ["B.point", "C.point"], 3,
    ),
    "four-bar path, 9 points": lambda: (
        four_bar(), mg.path("coupler.tip", _rows(9, 2, (1.5, 1.2))), ["A.point", "B.point", "C.point", "D.point"], 8652,
    ),
}  # fmt: skip
"""Rungs of minutes, without kept start sets: for ``benchmarks/make_task_starts.py``."""

PUBLISHED = {
    "R-R dyad, 5 poses": "Burmester, Lehrbuch der Kinematik, 1888",
    "four-bar of two dyads, 5 poses": "pairs of the four dyads of Burmester, Lehrbuch der Kinematik, 1888",
    "spherical R-R, 5 orientations": "Roth, On the screw axes and other special lines, J. Eng. Ind. 89, 1967",
    "S-S dyad, 7 poses": "Innocenti, Polynomial solution of the spatial Burmester problem, J. Mech. Des. 117, 1995",
    "four-bar path, 5 points, both pivots given": (
        "36 or fewer, Morgan and Wampler, Solving a planar four-bar design problem using continuation, J. Mech. Des. 112, 1990"
    ),
    "four-bar path, 9 points": (
        "Wampler, Morgan and Sommese, Complete solution of the nine-point path synthesis problem for four-bar linkages, J. Mech. Des. 114, "
        "1992"
    ),
    "R-R dyad, 4 poses": "the center-point curve is a cubic, Burmester, Lehrbuch der Kinematik, 1888",
}
"""Who says in print how many solutions a rung has."""
