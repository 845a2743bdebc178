"""The picture of the architecture, from the imports: rooms of the package, each above those that it imports.

Arrows that follow from others are left out. ``python docs/rooms.py`` writes ``docs/_static/rooms.svg``; a test compares.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import networkx as nx

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mechgraph"
PICTURE = ROOT / "docs" / "_static" / "rooms.svg"
WIDTH, HEIGHT, ACROSS, DOWN = 118, 30, 140, 62


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below, but for what only a type checker reads."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
            yield from statements(ast.Module(child.orelse, []))
        elif not isinstance(child, ast.expr):
            yield child
            yield from statements(child)


def imported(tree: ast.AST) -> Iterator[str]:
    """Rooms that a module imports when it is loaded, or later."""
    for node in statements(tree):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names = [
                f"{node.module}.{alias.name}" if node.module == "mechgraph" else node.module for alias in node.names
            ]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        yield from (name.split(".")[1] for name in names if name.startswith("mechgraph."))


@functools.cache
def rooms() -> nx.DiGraph:
    """Folders of the package, and which imports which; ``root`` stands for the modules beside them."""
    folders = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    graph = nx.DiGraph()
    graph.add_nodes_from(sorted(folders))
    for file in sorted(PACKAGE.rglob("*.py")):
        room = file.relative_to(PACKAGE).parts[0]
        tree = ast.parse(file.read_text(encoding="utf-8"))
        graph.add_edges_from((room, name) for name in imported(tree) if {room, name} <= folders and room != name)
    return graph


def drawn() -> str:
    """The picture as SVG."""
    graph = rooms()
    reduced = nx.transitive_reduction(nx.condensation(graph))
    members = nx.condensation(graph).nodes(data="members")
    label = {i: " / ".join(sorted(names)) for i, names in members}
    level = {}
    for node in reversed([*nx.lexicographical_topological_sort(reduced, key=label.__getitem__)]):
        level[node] = 1 + max((level[below] for below in reduced.successors(node)), default=-1)
    rows = [sorted((n for n in level if level[n] == k), key=label.__getitem__) for k in range(1 + max(level.values()))]
    widest = max(map(len, rows))
    place = {
        node: ((widest - len(row)) * ACROSS / 2 + i * ACROSS + ACROSS / 2, (len(rows) - 1 - k) * DOWN + DOWN / 2)
        for k, row in enumerate(rows)
        for i, node in enumerate(row)
    }
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {widest * ACROSS} {len(rows) * DOWN}"'
        ' font-family="sans-serif" font-size="13">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#7b8794"/></marker></defs>',
        f'<rect width="{widest * ACROSS}" height="{len(rows) * DOWN}" fill="#ffffff"/>',
    ]
    for above, below in sorted(reduced.edges, key=lambda edge: (label[edge[0]], label[edge[1]])):
        (x, y), (u, v) = place[above], place[below]
        parts.append(
            f'<line x1="{x:g}" y1="{y + HEIGHT / 2:g}" x2="{u:g}" y2="{v - HEIGHT / 2:g}" stroke="#7b8794" marker-end="url(#tip)"/>'
        )
    for node in sorted(place, key=label.__getitem__):
        x, y = place[node]
        parts.append(
            f'<rect x="{x - WIDTH / 2:g}" y="{y - HEIGHT / 2:g}" width="{WIDTH}" height="{HEIGHT}" rx="5" fill="#eef4fa" stroke="#0072b2"/>'
        )
        parts.append(f'<text x="{x:g}" y="{y + 4.5:g}" text-anchor="middle" fill="#1f2933">{label[node]}</text>')
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
