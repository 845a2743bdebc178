"""A drawing of every pair type for the reference: its symbol, and an arrow for each freedom, in the order of the pair table.

``conf.py`` calls ``draw``; the page of the pairs includes the cards.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import mechgraph as mg
from mechgraph.pairs.pair_type import PairType
from mechgraph.show.scene import freedom_arrow
from mechgraph.show.shapes import Shape, lines_of, polyline, symbol

FOLDER = Path(__file__).resolve().parent / "_built" / "pairs"
SIZE, SCALE = 150.0, 21.0
"""Side of a picture, and pixels for half the width of a symbol."""
VIEW = np.array([[0.82, -0.57, 0.0], [0.2, 0.29, 0.94], [0.53, 0.77, -0.35]])
"""Right, up and away from the eye."""
LIGHT = np.array([0.3, -0.5, 0.81])
FILL = {"guide": (0.74, 0.79, 0.84), "body": (0.34, 0.62, 0.83), "dark": (0.2, 0.45, 0.66), "arrow": (0.84, 0.37, 0.0)}
MEANING = {
    "R": "pin, hinge", "P": "slide, piston", "H": "screw and nut", "C": "shaft in a sleeve", "U": "Cardan joint",
    "S": "ball joint", "E": "plate on a plate", "Sc": "ball with a pin, in a slotted sleeve", "Sg": "ball in a sleeve",
    "Cp": "cylinder on a plate", "Sp": "ball on a plate", "Tc": "coupling of two shafts", "Fr": "holds nothing; names freedoms",
    "W": "welded, bolted",
}  # fmt: skip
"""What a pair is called in a workshop."""


def draw() -> None:
    """Write the pictures, and the cards that show them."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    cards = []
    for name, row in mg.pair_types().items():
        (FOLDER / f"{name}.svg").write_text(svg(row), encoding="utf-8")
        freedoms = f"freedom{'s' * (row.f > 1)} {' '.join(one.name for one in row.freedoms)}" if row.f else "no freedom"
        cards += [
            f":::{{grid-item-card}} {name}: {row.name}",
            f"![{name}](/_built/pairs/{name}.svg)",
            "",
            f"{MEANING[name].capitalize()}; {freedoms}.",
            ":::",
        ]
    page = "\n".join(["::::{grid} 2 3 4 5", ":gutter: 2", ":class-container: pairs", "", *cards, "::::", ""])
    (FOLDER / "cards.md").write_text(page, encoding="utf-8")


def shapes_of(row: PairType) -> list[tuple[str, Shape]]:
    """The symbol at coordinates zero, the axes, and arrows, a turn's at the end of its axis."""
    pitch = 0.3 if row.takes_pitch else 0.0
    strokes = [(0.0, 0.0) if one.turns else (-0.5, 0.5) for one in row.freedoms]
    found = [(e.role, e.shape) for e in symbol(row, pitch, 1.0, strokes)]
    for line in lines_of(row, pitch):
        away = 2.9 * line.direction
        found.append(("axis", polyline([line.point - away, line.point + away])))
        moves = [line, replace(line, turns=False)] if line.advance else [line]
        for one in moves:
            arrow = freedom_arrow(one, 1.2)
            found.append(("arrow", arrow.moved(np.eye(3), away if one.turns else 1.6 * one.direction)))
    return found


def svg(row: PairType) -> str:
    """Polygons from the farthest to the nearest, in the light; lines over them."""
    faces: list[tuple[float, str]] = []
    lines: list[str] = []
    for role, shape in shapes_of(row):
        for face in shape.faces:
            corners = shape.vertices[list(face)]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
            size = np.linalg.norm(normal)
            bright = 0.55 + 0.45 * abs(float(normal @ LIGHT)) / size if size else 1.0
            color = ",".join(str(round(255 * bright * part)) for part in FILL[role])
            opacity = ' fill-opacity="0.5"' if role == "guide" else ""
            faces.append(
                (
                    float((corners @ VIEW[2]).mean()),
                    f'<polygon points="{_seen(corners)}" fill="rgb({color})"{opacity}/>',
                )
            )
        if not shape.faces or role in ("guide", "arrow"):
            style = ("#d55e00", 1.6) if role == "arrow" else ("#52606d", 0.7)
            lines += [
                f'<polyline points="{_seen(shape.vertices[list(run)])}" fill="none" stroke="{style[0]}" stroke-width="{style[1]}"/>'
                for run in shape.lines
            ]
    ordered = [text for _, text in sorted(faces, key=lambda face: -face[0])]
    half = SIZE / 2
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{-half:g} {-half:g} {SIZE:g} {SIZE:g}" role="img">',
            f"<title>{row.name}</title>",
            *ordered,
            *lines,
            "</svg>\n",
        ]
    )


def _seen(points: np.ndarray) -> str:
    return " ".join(f"{x:.1f},{-y:.1f}" for x, y in SCALE * points @ VIEW[:2].T)
