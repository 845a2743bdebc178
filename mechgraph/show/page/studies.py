"""A study in tables: how its outputs spread, and what they depend on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechgraph.document import Block, Document, Heading, Paragraph, Table
from mechgraph.variants.result import Study

Q = (0.00135, 0.5, 0.99865)


def study_document(study: Study) -> Document:
    """Outputs where the mechanism itself has them greatest: nominal value, mean, deviation, quantiles, sensitivities."""
    return Document("", tuple(_blocks(study)))


def _blocks(study: Study) -> Iterator[Block]:
    count, bad = len(study.status), int(study.failed.sum())
    yield Paragraph(f"{count} variants, {bad} of them not solved at some position.")
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
        yield Table(head, tuple(rows), align="llrrrrrr")
        yield Paragraph("Every output at the position (and component) where it is greatest for the mechanism itself.")
        yield Heading("Sensitivities there", 2)
        yield Table(("output", "parameter", "derivative"), tuple(slopes), align="llr")
