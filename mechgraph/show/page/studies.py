"""A study in tables: how its outputs spread, and what they depend on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechgraph.document import Block, Document, Heading, Paragraph, Table
from mechgraph.variants.result import Study

Q = (0.00135, 0.5, 0.99865)


def study_document(study: Study) -> Document:
    """What the study tells of itself; and outputs where the mechanism itself has them greatest, with quantiles and sensitivities."""
    return Document("", (*study.document().blocks, *_blocks(study)))


def _blocks(study: Study) -> Iterator[Block]:
    rows, slopes = [], []
    for name in study.outputs:
        nominal = np.asarray(study.nominal[name], dtype=float)
        if not np.isfinite(nominal).any():
            continue
        at = np.unravel_index(int(np.nanargmax(np.abs(nominal))), nominal.shape)
        values = [nominal, study.mean(name), study.std(name), *study.quantiles(name, Q)]
        where = ", ".join(map(str, map(int, at))) or "-"
        rows.append((name, where, *(f"{float(v[at]):.5g}" for v in values)))
        slopes += [(name, parameter, f"{float(v[at]):.5g}") for parameter, v in study.sensitivities(name).items()]
    head = ("output", "entry", "nominal", "mean", "deviation", "0.135 %", "median", "99.865 %")
    if rows:
        yield Heading("Outputs where they are greatest", 2)
        yield Paragraph("At the position, and of the component, where the mechanism itself has the greatest value.")
        yield Table(head, tuple(rows), align="llrrrrrr")
        yield Heading("Sensitivities there", 2)
        yield Table(("output", "parameter", "derivative"), tuple(slopes), align="llr")
