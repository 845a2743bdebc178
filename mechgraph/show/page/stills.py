"""Still pictures for paper, and for where scripts do not run."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution
from mechgraph.show.curves import effort_curve
from mechgraph.show.skeleton import draw_skeleton


def stills(m: Mechanism, s: Solution | None) -> Iterator[tuple[str, str]]:
    """Titles and pictures (addresses that hold them): the mechanism, and what its first driver supplies."""
    yield m.name, _picture(draw_skeleton(m if s is None else s))
    if s is not None and s.has_forces and s.mechanism.drives and len(s.batch) == 1:
        yield "Effort of the driver", _picture(effort_curve(s))


def _picture(ax: Any) -> str:
    """A picture as an SVG that stands in its own address, the same at every call."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "mechgraph"}):
        ax.figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return f"data:image/svg+xml,{quote(buffer.getvalue().decode(), safe=' =:/,.;()-')}"
