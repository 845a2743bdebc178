"""What is wrong with what a pair says as a contact, and with its curves and surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mechgraph.model.contact_rows import ROWS, curve_faults, cut_faults, miss_faults, takes_curves
from mechgraph.model.curves import Curve
from mechgraph.model.hertz import Hertz
from mechgraph.model.pair_table import TABLE
from mechgraph.model.surface_rows import surface_faults, surface_miss
from mechgraph.model.surfaces import Surface
from mechgraph.quantities import wrong


def contact_faults(pair: Any, where: str) -> Iterator[str | None]:
    """What is wrong with what it says as a contact of two elements."""
    yield pair.formats["closed"].fault(pair.closed, f"{where}closed")
    form, given = pair.type.touching, {"radius": pair.radius, "hertz": pair.hertz}
    if form is None:
        said = [name for name, value in given.items() if value is not None]
        said += ["closed"] if isinstance(pair.closed, str) and pair.closed == "force" else []
        if said:
            have = ", ".join(symbol for symbol, row in {**TABLE, **ROWS}.items() if row.touching)
            yield f"{where}{', '.join(said)}: type {pair.type.symbol} is no contact of two elements; {have} are"
        return
    if pair.radius is not None:
        yield pair.formats["radius"].fault(pair.radius, f"{where}radius")
        if not any(form.b) or pair.radius_b != pair.radius:
            yield f"{where}radius: the curves and their roller say it; leave it out"
    if pair.hertz is None:
        return
    if not isinstance(pair.hertz, Hertz):
        yield wrong(pair.hertz, f"{where}hertz", "mg.Hertz(moduli=(E_a, E_b))")
        return
    yield from (faults := pair.hertz.value_faults(f"{where}hertz."))
    if faults:
        return
    groove, needed = pair.hertz.groove_radius, "the pressure depends on it; give it"
    if any(form.b) and pair.radius_b is None:
        yield f"{where}radius: {needed}"
    elif pair.radius is not None and any(form.a) and (groove is None or not groove > pair.radius):
        yield wrong(groove, f"{where}hertz.groove_radius", f"a number above the radius {pair.radius:g} of the ball")
    if form.along_line and pair.hertz.length is None:
        yield f"{where}hertz.length: {needed}"


def shape_faults_of(pair: Any, where: str, tol: float) -> Iterator[str | None]:
    """What is wrong with its curves, or with the contact on them."""
    if pair.roller is not None:
        yield pair.formats["roller"].fault(pair.roller, where + "roller")
    for name, given in (("curve", pair.curve), ("curve_b", pair.curve_b)):
        if not isinstance(given, Curve | None):
            yield wrong(given, where + name, "a Curve, such as mg.Curve.circle(radius=...)")
    if not isinstance(pair.surface, Surface | None):
        yield wrong(pair.surface, where + "surface", "a Surface, such as mg.Surface.sphere(radius=...)")
    elif pair.surface is not None and pair.curve is not None:
        yield f"{where}has a curve and a surface; give one of them"
    elif pair.surface is not None and pair.contact is not None:
        yield from surface_miss(pair.contact, tol, where)
    elif pair.surface is not None:
        yield from surface_faults(pair.type, pair.surface, pair.point, where, pair.roller)
    elif pair.contact is not None:
        yield from miss_faults(pair.contact, (pair.curve, pair.curve_b), tol, where)
        yield from cut_faults(pair.contact, where)
    elif isinstance(pair.curve, Curve):
        yield from curve_faults(pair.type, pair.curve, pair.curve_b, pair.roller, pair.point, where)
    elif pair.curve_b is not None or pair.roller:
        yield f"{where}has a curve_b or a roller, but no curve; give curve=, or exchange links a and b"
    elif takes_curves(pair.type) and pair.has_geometry:
        yield f"{where}type {pair.type.symbol} needs a curve, such as curve=mg.Curve.circle(radius=...)"
