"""All positions asked for along driver values: one curve for one driver, polygons for several."""

from __future__ import annotations

import numpy as np

from mechgraph.closure.driver_path import DriverPath, Legs, Positions, Request
from mechgraph.closure.gaps import along_polygons_with_gaps


def follow(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """States at all positions asked for; ``total`` positions in all."""
    if path.size[1] == 1:
        return _one_curve(path, requests, total).followed().positions
    return along_polygons_with_gaps(path, requests, total)


def _one_curve(path: DriverPath, requests: list[Request], total: int) -> Legs:
    """One driver: from every start one track up and one down."""
    legs = Legs(path, total)
    for request in requests:
        begin, value = request.x[path.rows[0]], request.values[0]
        for sense, mine in ((1.0, value >= begin), (-1.0, value < begin)):
            if not mine.any():
                continue
            way = sense * (value[mine] - begin)
            points = np.array([[begin, begin + sense * way.max()]]) if way.max() > 0 else np.array([[begin]])
            legs.add(request, points, value[None, mine], request.places[mine], way)
    return legs
