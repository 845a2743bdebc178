"""Still pictures for paper, and for where scripts do not run."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import quote

from mechgraph.errors import MissingExtraError, visible
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution
from mechgraph.show.curves import effort_curve
from mechgraph.show.skeleton import draw_skeleton

RC: dict[Any, Any] = {"svg.hashsalt": "mechgraph", "svg.fonttype": "none", "text.parse_math": False}
"""The same file at every call; names as text in the reader's fonts, none of them a formula."""


def stills(m: Mechanism, s: Solution | None) -> Iterator[tuple[str, str]]:
    """Titles and pictures (addresses that hold them): the mechanism, and what its first driver supplies."""
    yield m.name, _picture(lambda: draw_skeleton(m if s is None else s))
    if s is not None and s.has_forces and s.mechanism.drives and len(s.batch) == 1:
        yield "Effort of the driver", _picture(lambda: effort_curve(s))


def _picture(draw: Callable[[], Any]) -> str:
    """A picture as an SVG that stands in its own address."""
    try:
        from matplotlib import rc_context
    except ImportError:
        raise MissingExtraError("matplotlib", "report") from None
    buffer = io.BytesIO()
    with rc_context(RC), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph", UserWarning)  # the reader's fonts may have it
        draw().figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return f"data:image/svg+xml,{quote(visible(buffer.getvalue().decode()), safe=' =:/,.;()-')}"
