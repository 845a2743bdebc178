"""What there is: ``mechgraph list``."""

from __future__ import annotations

import mechgraph as mg
from mechgraph.cli.output import show
from mechgraph.document import Document, Table


def list_library() -> None:
    """Name the mechanisms of the library, with what they are."""
    found = {name: mg.load(name) for name in mg.library()}
    rows = [(name, " ".join(p.type.symbol for p in m.pairs), m.description) for name, m in found.items()]
    show(Document("", (Table(("name", "pairs", "description"), tuple(rows)),)))
