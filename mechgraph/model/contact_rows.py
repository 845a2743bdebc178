"""Pairs whose marker travels along curves: rows of data with places for curves, which a pair fills in.

``Pair(..., curve=...)`` takes the row of its type from here. The frames of a row follow the curve, so that its components keep their
meaning: Fx and Fy of a sphere in a groove act at right angles to it, Fy of two curves in contact along their common normal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.along_curve import AlongCurve, Beside, X, Z
from mechgraph.model.curves import Curve, Line
from mechgraph.model.pair_type import PairType
from mechgraph.model.placed_rows import OFF_CURVE, PLACE_STEP, Contact, extent, filled, of_function, pair_row, rounded
from mechgraph.model.row_parts import Touching
from mechgraph.model.travel import Travel, outside, roller_faults, shape_faults
from mechgraph.quantities import is_numeric

ALONG, FOLLOWING = AlongCurve("Ts", Z), AlongCurve("Ts", X)
"""Places for a curve on link a, along z and along x of the frame."""
BESIDE = AlongCurve("Tsb", X, back=True)
"""A place for a curve on link b."""
HELD = ("P", "C")
"""Types whose marker may keep its orientation on the way."""
PLACE_DIGITS = 12
"""Digits to which the direction of a plane is rounded, for the same reason."""
CONFORMAL = 1e-9
"""Part of the curvatures of two elements below which their difference is rounding: they bend alike."""
CLOSING_ANGLE = 1e-9
"""Closing angle of a frame that counts."""


ROWS = {
    row.symbol: row
    for row in (
        pair_row("P", "rail and carriage", [ALONG], ["Fx@1", "Fy@1", "Mx@1", "My@1", "Mz@1"], ["Fz@1"]),
        pair_row("C", "round rail and carriage", [ALONG, "Rz"], ["Fx@1", "Fy@1", "Mx@1", "My@1"], ["Fz@1", "Mz@1"]),
        pair_row(
            "Sg",
            "sphere in curved groove",
            [ALONG, "rotation"],
            ["Fx@1", "Fy@1"],
            ["Fz@1", "Mx@1", "My@1", "Mz@1"],
            Touching(("Fx", "Fy"), a=(0.0, -1.0), b=(1.0, 1.0), curved=True),
        ),
        pair_row(
            "Ps",
            "pin in curved slot",
            [FOLLOWING, "Rz"],
            ["Fy@1", "Fz@1", "Mx@1", "My@1"],
            ["Fx@1", "Mz@1"],
            Touching(("Fy",), a=(0.0, 0.0), b=(0.0, 1.0), curved=True),
        ),
        pair_row(
            "Kc",
            "curves in contact",
            [FOLLOWING, BESIDE],
            ["Fy@1", "Fz@1", "Mx@1", "My@1"],
            ["Fx@1", "Mz@1"],
            Touching(("Fy",), a=(0.0, 0.0), b=(0.0, 0.0), curved=True),
        ),
    )
}
"""The rows by the symbols of their types; of P, C and Sg those with a curve."""


def pressing(row: PairType) -> float:
    """1 where link a, which is only pushed against, presses on b along y of the frame that travels on its curve, -1 where against it.

    A roller is pushed away from the curve beside which it runs, what touches a closed curve away from its inside, all else along y; what
    is on a surface along z.
    """
    place = next(iter(takes_curves(row)), None)
    if place is None:
        return 1.0
    curve = place.curve
    assert curve is not None
    if isinstance(curve, Beside):
        side = 1.0 if curve.distance > 0 else -1.0
    else:
        side = outside(curve) if curve.is_closed else 1.0
    return side * place.sideways


def is_open(pair: Any) -> bool:
    """Whether a profile holds b from one side alone, as far as it says: two curves in contact, a cam, what a roller or ball runs on.

    A slot, a groove and a plane hold on both sides unless the pair says otherwise.
    """
    return len(takes_curves(pair.type)) > 1 or bool(pair.roller) or (pair.curve is not None and pair.curve.is_profile)


def takes_curves(row: PairType) -> tuple[AlongCurve, ...]:
    """The places for curves in a row."""
    return tuple(step for step in row.steps if isinstance(step, AlongCurve))


def in_contact(
    row: PairType,
    curve: Curve,
    curve_b: Curve | None = None,
    roller: float | None = None,
    point: Sequence[float] | None = None,
    axis: Sequence[float] | None = None,
    pair: str = "",
    on_b: Array | None = None,
) -> Contact:
    """A row of a ``pair`` with its curves put in; coordinates zero where the curves pass ``point`` (where they begin if it is left out).

    ``axis`` says in which sense of two z points; ``roller`` is that of the roller whose centre is the point. Where the marker ``on_b``
    ``(3, 4)`` is given apart, the point is only near the curve, and the curve of link b touches at that marker.
    """
    first, *others = takes_curves(row)
    placed = _placed(first, _path(_across(curve, first, axis), roller, point), point)
    marker = placed.start
    if axis is not None and marker[:, 2] @ np.asarray(axis) < 0:
        placed = replace(placed, reversed=placed.tangent == Z, turned=placed.tangent == X)
        marker = placed.start
    factors, off = [placed], [0.0 if on_b is not None else _off(placed, point)]
    beside, back = marker if on_b is None else on_b, None
    for place in others:
        other = curve_b or Line(point=tuple(beside[:, 3]), direction=tuple(beside[:, 0]))
        second = _placed(place, _across(other, place, beside[:, 2]), beside[:, 3])
        back = second.start
        second = replace(
            second, reversed=bool(back[:, 0] @ beside[:, 0] < 0), turned=bool(back[:, 2] @ beside[:, 2] < 0)
        )
        factors.append(second)
        back = second.start
        # a marker of its own says near which direction the curve of link b runs, a contact at one point that both touch
        crossing = float(np.linalg.norm(np.cross(back[:, 0], beside[:, 0]))) if on_b is None else 0.0
        off += [_off(second, beside[:, 3]), crossing]
    return Contact(filled(row, factors, pair), marker, tuple(off), back if on_b is not None else None)


def _across(curve: Curve, place: AlongCurve, z: Sequence[float] | Array | None) -> Curve:
    """The curve; a straight one, which lies in many planes, in that at right angles to ``z`` where the frame has one."""
    travel: Travel = curve.once(Travel)
    if place.tangent != X or z is None or not travel.is_straight or curve.guide is not None:
        return curve
    here = travel.at(np.zeros(1))
    along = [
        round(v / float(np.linalg.norm(z)), PLACE_DIGITS)
        for v in (here.k[:, 0] @ np.asarray(z), here.y[:, 0] @ np.asarray(z))
    ]
    if along[1] == 0:
        return curve
    return curve.replace(frame="guided", guide=along[0] * here.k[:, 0] + along[1] * here.y[:, 0])


def kept_side(row: PairType, curve: Curve, roller: float | None, point: Sequence[float]) -> Sequence[float]:
    """Where the centre of a roller, which stood at ``point``, stands beside another curve: on the same side, nearest to its old foot."""
    path = takes_curves(row)[0].curve if takes_curves(row) else None
    if not isinstance(path, Beside) or not roller or _of_shape(curve, ""):
        return point
    old, new = path.base.once(Travel), curve.once(Travel)
    foot = old.at(np.array([old.nearest(np.asarray(point))[0]])).x[:, 0]
    here = new.at(np.array([new.nearest(foot)[0]]))
    return tuple((here.x + np.sign(path.distance) * roller * here.y)[:, 0].tolist())


def _path(curve: Curve, roller: float | None, point: Sequence[float] | None) -> Curve:
    """The curve itself, or that of the centre of a roller, on the side of the point, or outside."""
    return Beside(base=curve, distance=_side(curve, point) * roller) if roller else curve


def _side(curve: Curve, point: Sequence[float] | None) -> float:
    travel: Travel = curve.once(Travel)
    if point is None:
        return outside(curve) if curve.is_closed else 1.0
    s, _ = travel.nearest(np.asarray(point))
    here = travel.at(np.array(s))
    return 1.0 if (np.asarray(point) - here.x) @ here.y > 0 else -1.0


def _placed(place: AlongCurve, curve: Curve, point: Sequence[float] | Array | None) -> AlongCurve:
    travel: Travel = curve.once(Travel)
    ends = np.isfinite(travel.begin)
    home = (travel.begin if ends else 0.0) if point is None else travel.nearest(np.asarray(point))[0]
    size = max(extent(curve, travel.at(np.array(home)).x), travel.length if ends else 0.0)
    again = (
        travel.is_closed and travel.length - home < PLACE_STEP * size
    )  # the end of a closed curve is where it begins
    return replace(place, curve=curve, home=0.0 if again else rounded(home, size))


def _off(factor: AlongCurve, point: Sequence[float] | Array | None) -> float:
    return 0.0 if point is None else float(np.linalg.norm(factor.start[:, 3] - point))


# --- faults ----------------------------------------------------------------------------------------------------------


def curve_faults(row: Any, curve: Curve, curve_b: Any, roller: Any, point: Any, where: str) -> list[str]:
    """What is wrong with curves in a row, before they are put in."""
    if not isinstance(row, PairType) or not takes_curves(row):
        return [f"{where}curve: a pair {getattr(row, 'symbol', '?')} takes none; those that do: {', '.join(ROWS)}"]
    fit = {
        "curve_b": isinstance(curve_b, Curve | None),
        "roller": roller is None or is_numeric(roller, ()),
        "point": point is None or is_numeric(point, (3,)),
    }
    if not all(fit.values()):
        return [f"{where}curve: {', '.join(name for name, fits in fit.items() if not fits)} at fault"]
    places = takes_curves(row)
    curves = {name: given for name, given in (("curve", curve), ("curve_b", curve_b)) if given is not None}
    found = [fault for name, given in curves.items() for fault in _of_shape(given, f"{where}{name}.")]
    if found:
        return found
    if curve_b is not None and len(places) < 2:
        found.append(
            f"{where}curve_b: a pair {row.symbol} takes one curve, on link a; exchange a and b for one on link b"
        )
    if any(given.frame == "held" for given in curves.values()) and row.symbol not in HELD:
        found.append(
            f"{where}curve: frame='held' is for {' and '.join(HELD)}; a pair {row.symbol} turns with its curve"
        )
    plane = roller or any(place.tangent == X for place in places)
    found += [
        f"{where}{name}: is no plane curve, as a pair {row.symbol}{' with a roller' if roller else ''} needs"
        for name, given in curves.items()
        if plane and not given.once(Travel).is_plane
    ]
    if roller and not found:
        found += roller_faults(curve, roller, "roller: ", where, _side(curve, point))
    holds_roll = places[0].tangent == Z and not any(freedom.turns for freedom in row.freedoms)
    closing = curve.once(Travel).closing
    if holds_roll and abs(np.sin(closing / 2)) > CLOSING_ANGLE:
        found.append(
            f"{where}curve: its frame comes back turned by {np.rad2deg(closing):.6g} degrees about the tangent after one round, and this "
            "pair holds roll; guide the frame, frame='guided' with a guide, or take a C or Sg"
        )
    return found


def _of_shape(curve: Curve, where: str) -> list[str]:
    return of_function(lambda: curve.faults(where) or shape_faults(curve, where), where)


def cut_faults(contact: Contact, where: str) -> Iterator[str]:
    """A closed curve, inside which link a is, that cuts into what it touches where it is declared: it bends less than a hollow there."""
    places = takes_curves(contact.row)
    if len(places) < 2 or contact.marker_b is not None or not places[0].travel.is_closed:
        return
    one, two = (pressing(contact.row) * place.curvatures(np.zeros(1))[1, 0] for place in places)
    if two - one < -CONFORMAL * (abs(one) + abs(two)):
        at = ", ".join(f"{v:.6g}" for v in contact.marker[:, 3])
        yield (
            f"{where}curve_b: cuts into the curve beside ({at}), where they touch: it is hollow there with the radius {-1 / two:.6g}, and "
            f"the curve, inside which link a is, bends with the radius {-1 / one:.6g}; make the hollow wider or the curve smaller (a disc "
            "in a ring: name the link of the disc as a, that of the ring as b)"
        )


def miss_faults(contact: Contact, curves: Sequence[Curve | None], tol: float, where: str) -> Iterator[str]:
    """Contacts that are not on their curves, or where curves cross."""
    names = iter(("curve", "curve_b", ""))
    for miss, name, i in zip(contact.misses, names, count()):
        size = curves[i].once(Travel).length if i < len(curves) and curves[i] is not None else 1.0  # type: ignore[union-attr]
        if not miss > max(OFF_CURVE, tol) * size:
            continue
        if name:
            marker = contact.marker_b if contact.marker_b is not None and i else contact.marker
            at = ", ".join(f"{v:.6g}" for v in marker[:, 3])
            rolls = i == 0 and isinstance(takes_curves(contact.row)[0].curve, Beside)
            yield (
                f"{where}point: is {miss:.6g} off its {name}{' at the radius of the roller' * rolls}, which is nearest at ({at}); "
                "give that point, or the marker on link b (on_b=mg.Marker(...), and no point) to have the mechanism assembled"
            )
        else:
            yield f"{where}curve_b: crosses the curve at {np.rad2deg(miss):.6g} degrees at the point; curves in contact touch"
