"""Still pictures for paper, and for where scripts do not run."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import quote

import numpy as np

from mechgraph.errors import MissingExtraError, visible
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution
from mechgraph.show.curves import effort_curve
from mechgraph.show.diagrams import draw_graph
from mechgraph.show.forces import reaction_ranges
from mechgraph.show.skeleton import draw_skeleton
from mechgraph.show.studies import study_histogram, study_tornado
from mechgraph.variants.result import Study

OUTPUTS = 4
"""Outputs of a study of which pictures are made."""
PAIRS_LABELLED = 40
"""Pairs up to which names stand in the still picture: finding room for them takes long."""
RC: dict[Any, Any] = {"svg.hashsalt": "mechgraph", "svg.fonttype": "none", "text.parse_math": False}
"""The same file at every call; names as text in the reader's fonts, none of them a formula."""


Pictures = list[tuple[str, str]]
"""Titles and pictures: addresses that hold them."""


def stills(m: Mechanism, s: Solution | None) -> Pictures:
    """The mechanism where it begins, what its drivers supply, and from what to what its reactions range."""
    out = [(m.name, _picture(lambda: draw_skeleton(m if s is None else s, labels=len(m.pairs) <= PAIRS_LABELLED)))]
    if s is None or not s.has_forces:
        return out
    if s.mechanism.drives:
        out.append(("Efforts of the drivers", _picture(lambda: effort_curve(s))))
    out.append(("Reaction forces, hatched where not unique", _picture(lambda: reaction_ranges(s))))
    out.append(("Reaction moments, hatched where not unique", _picture(lambda: reaction_ranges(s, moment=True))))
    return out


def pictures_of_graph(m: Mechanism) -> Pictures:
    """The link-pair graph."""
    return [("Links and pairs, coloured by the loops in which they lie", _picture(lambda: draw_graph(m)))]


def pictures_of_study(study: Study) -> Pictures:
    """How the first outputs spread, and what moves them; of those with several entries that of greatest size."""
    out = []
    for name in list(study.outputs)[:OUTPUTS]:
        nominal = np.abs(np.nan_to_num(study.nominal[name]))
        placed = study.outputs[name].ndim > 1 and study.outputs[name].shape[1] == study.status.shape[1]
        entries = nominal.ndim - placed
        if entries > 1 or not nominal.any() or not np.isfinite(study.outputs[name]).any():
            continue
        part = int(np.argmax(nominal.reshape(-1, nominal.shape[-1]).max(axis=0))) if entries else None
        out.append((f"{name} over the variants", _picture(partial(study_histogram, study, name, part=part))))
        out.append(
            (f"{name}: what every parameter alone does", _picture(partial(study_tornado, study, name, part=part)))
        )
    return out


def _picture(draw: Callable[[], Any]) -> str:
    """A picture as an SVG that stands in its own address."""
    try:
        from matplotlib import rc_context
    except ImportError:
        raise MissingExtraError("matplotlib", "report") from None
    buffer = io.BytesIO()
    with rc_context(RC), warnings.catch_warnings():
        # the reader's fonts may have the letters of a name; a name as long as the picture leaves the curves no room
        warnings.filterwarnings("ignore", "Glyph|constrained_layout not applied", UserWarning)
        draw().figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return f"data:image/svg+xml,{quote(visible(buffer.getvalue().decode()), safe=' =:/,.;()-')}"
