"""Pairs on curves and surfaces: rows of data with places for them, which a pair fills in; their faults, and the pressure there.

``Pair(..., curve=...)`` takes the row of its type from here. The frames of a row follow the curve, so that its components keep their
meaning: Fx and Fy of a sphere in a groove act at right angles to it, Fy of two curves in contact along their common normal.

Source of the pressure: K. L. Johnson, Contact Mechanics, 1985, sections 4.2 (lines) and 4.2(c), eqs. 4.24 to 4.28 (ellipses).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import count
from typing import Annotated, Any, NamedTuple

import numpy as np
import scipy

from mechgraph.errors import ShapeError
from mechgraph.fields import POSITIVE, TWO, TWO_POSITIVE, Described
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import COMPLEX_STEP, SHAPES
from mechgraph.memo import dataclass
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.curves import Curve, Line, Travel, outside, point_text, roller_faults, shape_faults
from mechgraph.pairs.factors import UNIT_TWISTS, Factor, Freedom, Touching
from mechgraph.pairs.pair_type import TABLE, PairType, table_row
from mechgraph.pairs.surfaces import Surface
from mechgraph.pairs.travelling import (
    AlongCurve,
    Beside,
    Travelling,
    X,
    Z,
    across,
    center_path,
    extent,
    missed_by,
    placed_on,
    rounded,
    side_of,
)
from mechgraph.quantities import LENGTH, PRESSURE, PURE, is_numeric, shown, wrong


@dataclass(frozen=True)
class OnSurface(Travelling):
    """A frame that lies on a surface: z its normal, x along u; coordinates are lengths along u and v where they are zero.

    D(q) = F(home)^-1 F(home + q / sizes), ``sizes`` being ``|x_u|`` and ``|x_v|`` at home; ``turned`` has the normal the other way round;
    ``pair`` is the name for messages.
    Without a surface it is a place for one: it can be counted, not evaluated.
    """

    surface: Surface | None = None
    home: tuple[float, float] = (0.0, 0.0)
    turned: bool = False
    unit: float = 1.0
    pair: str = field(default="", compare=False)

    @property
    def shape(self) -> Surface:
        """Its surface; only a row of the table has none."""
        assert self.surface is not None
        return self.surface

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Slides along both parameters."""
        return Freedom("Tu", UNIT_TWISTS["Tx"]), Freedom("Tv", UNIT_TWISTS["Ty"])

    @cached_property
    def sizes(self) -> Array:
        """Lengths per parameter at home."""
        return np.linalg.norm(self.shape.at(*np.array(self.home)[:, None])[1:3, :, 0], axis=1)

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """The ends of the surface."""
        parts = zip(self.shape.ends, self.home, self.sizes / self.unit, strict=True)
        return tuple(((low - at) * size, (high - at) * size) for (low, high), at, size in parts)

    @property
    def periods(self) -> tuple[float, ...]:
        """Lengths after which the surface returns into itself."""
        return tuple((np.array(self.shape.periods) * self.sizes / self.unit).tolist())

    @property
    def outline(self) -> tuple[Array, ...]:
        """Lines of the surface about the frame at coordinates zero, on both sides of it as far as it goes, at most its size at home."""
        if self.surface is None:
            return ()
        ranges = [(max(low, -size), min(high, size)) for (low, high), size in zip(self.ranges, self.sizes, strict=True)]
        # lines each way by which a surface is drawn
        u, v = (np.linspace(*ends, 9) for ends in ranges)
        x = np.stack(np.meshgrid(u, v))
        p = self.here(x)[0] - self.start[:, 3].reshape(3, 1, 1)
        grid = np.tensordot(p, self.start[:, :3], (0, 0)) / self.unit
        return (*grid, *grid.swapaxes(0, 1))

    def curvatures(self, x: Array) -> Array:
        """Principal curvatures ``(2, ...)`` towards z of the frame at coordinates ``(2, ...)``."""
        found = self.shape.curvatures(*self._parameters(x))
        return -found[::-1] if self.turned else found

    @cached_property
    def bend(self) -> float:
        """Where the surface is looked at, and at coordinates zero."""
        with self.named():
            here = np.abs(self.shape.curvatures(*np.array(self.home)[:, None])).max()
            return self.unit * max(self.shape.bend, float(here))

    def _parameters(self, x: Array) -> Array:
        """Parameters ``(2, ...)`` at coordinates ``(2, ...)``."""
        return np.stack([at + self.unit / size * q for at, size, q in zip(self.home, self.sizes, x, strict=True)])

    def points(self, x: Array) -> Array:
        """Points ``(3, ...)`` at coordinates ``(2, ...)``, in the frame of the link."""
        return self.here(x)[0]

    def from_pole(self, x: Array) -> Array:
        """Ways ``(2, ...)`` from a pole of the parameters at coordinates ``(2, ...)``, over the radius."""
        return self.shape.from_pole(*self._parameters(x))

    def coordinates_at(self, p: Array) -> Array:
        """Coordinates ``(2,)`` of the point of the surface that is nearest to ``p (3,)``."""
        return (np.array(self.shape.nearest(p)) - self.home) * self.sizes / self.unit

    def place_of(self, x: Array) -> tuple[Array, Array, Array]:
        """Position, axes ``(3, 3, ...)`` and twists about the point ``(6, 2, ...)``, in the frame of the link."""
        su, sv = self.sizes
        u, v = self._parameters(x)
        J, sense = self.shape.at(u, v), self.shape.sense(u, v)
        x_, xu, xv = J[0], J[1] / su, J[2] / sv
        second = self.unit * np.stack([J[3] / su**2, J[4] / (su * sv), J[5] / sv**2])
        lu, N = sense * np.sqrt((xu * xu).sum(axis=0)), cross(xu, xv)
        ln, up = sense * np.sqrt((N * N).sum(axis=0)), -1.0 if self.turned else 1.0
        e1, n = xu / lu, up * N / ln
        axes = (e1, cross(n, e1), n)
        twists = []
        for xa, xua, xva in ((xu, second[0], second[1]), (xv, second[1], second[2])):
            # but for parts along e1 and n, in which lengths change: in w they meet themselves, c e1 x e1 and c e2 x e2
            de1, dn = xua / lu, up * (cross(xua, xv) + cross(xu, xva)) / ln
            rates = (de1, cross(dn, e1) + cross(n, de1), dn)
            w = 0.5 * sum(cross(e, de) for e, de in zip(axes, rates, strict=True))
            twists.append(np.concatenate([w, xa]))
        return x_, np.stack(axes, axis=1), np.stack(twists, axis=1)

    @cached_property
    def start(self) -> Array:
        """The frame at coordinates zero on its link ``(3, 4)``."""
        x, R, _ = self.here(np.zeros((2, 1)))
        return np.concatenate([R, x[:, None]], axis=1)[..., 0]

    def pose_at(self, here: tuple[Array, Array, Array]) -> Array:
        """Value of the motion."""
        p, R, _ = here
        return self._pose_seen(R, p)

    def twists_at(self, here: tuple[Array, Array, Array]) -> Array:
        """``(w, x_a + w x (p - x))`` for both parameters."""
        p, _, S = here
        return np.stack([self._screw_seen(p, S[:3, a], S[3:, a]) for a in range(2)], axis=1)

    def twist_rates_at(self, here: tuple[Array, Array, Array], x: Array, dq: Array) -> Array:
        """The derivative of ``sum_j S_j q'_j`` along ``q'``, by a complex step: exact."""
        ahead: Array = x.real + 1j * COMPLEX_STEP * dq.real
        return np.asarray((self.twists_at(self.here(ahead)) * dq).sum(axis=1).imag / COMPLEX_STEP)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self if self.surface is None else replace(self, unit=self.unit * L)


@dataclass(frozen=True)
class PlacedRow:
    """A row with its curves, the markers at coordinates zero on links a and b ``(3, 4)``, and by how much each misses its curve.

    ``marker_b`` is None where no curve of link b says it; a pair without a place for one has it where it likes.
    """

    row: PairType
    marker: Array
    misses: tuple[float, ...]
    marker_b: Array | None = None


def travels(row: Any) -> bool:
    """Whether a row has a place for a curve or a surface."""
    return isinstance(row, PairType) and any(isinstance(step, AlongCurve | OnSurface) for step in row.steps)


def filled(row: PairType, factors: Sequence[AlongCurve | OnSurface], pair: str) -> PairType:
    """The row with factors in the places for curves and surfaces; components that would do work are combined with efforts."""
    left = (replace(factor, pair=pair) for factor in factors)
    out = row.with_steps([next(left) if isinstance(step, AlongCurve | OnSurface) else step for step in row.steps])
    held = tuple(
        columns.start for step, columns, _ in evaluation.placed(out) if isinstance(step, AlongCurve) and step.held
    )
    if held:  # no component is constant in a frame that does not turn with the curve
        vars(out).update(pushed=held, reactions=None)
        return out
    x = tried_coordinates(out)
    pitch = np.zeros((1, 1))
    frames = evaluation.frames_of(out, pitch, x)
    S, W = evaluation.twists_of(out, pitch, frames, x), evaluation.reactions_of(out, pitch, frames, x)
    work = np.abs(np.einsum("ifnt,icnt->fcnt", S, W)).max(initial=0.0)
    vars(out).update(computed_reactions=bool(work > 1e-12 * max(1.0, np.abs(S).max())))
    return out


def tried_coordinates(row: PairType) -> Array:
    """Random coordinates ``(nx, 1, 16)``, of what travels along a curve from end to end, at which a row is tried."""
    x = evaluation.random_coordinates(row, np.random.default_rng(12345), 1, 16)
    for step, _, numbers in evaluation.placed(row):
        if isinstance(step, AlongCurve):
            low, high = (end if np.isfinite(end) else np.copysign(step.travel.length, end) for end in step.ranges[0])
            x[numbers] = np.linspace(low, high, x.shape[-1])
        elif isinstance(step, OnSurface):
            x[numbers] = 0.0
    return x


def of_function(faults: Callable[[], list[str]], where: str) -> list[str]:
    """Faults of a shape, also that its function returns what is none; what the function raises goes on, with its cause."""
    try:
        return faults()
    except ShapeError as error:
        if error.__cause__ is not None:
            raise
        return [where + error.text]


ALONG, FOLLOWING = AlongCurve("Ts", Z), AlongCurve("Ts", X)
"""Places for a curve on link a, along z and along x of the frame."""
BESIDE = AlongCurve("Tsb", X, back=True)
"""A place for a curve on link b."""
HELD = ("P", "C")
"""Types whose marker may keep its orientation on the way."""


ROWS = {
    row.symbol: row
    for row in (
        table_row("P", "rail and carriage", [ALONG], "Fx@1, Fy@1, Mx@1, My@1, Mz@1", "Fz@1"),
        table_row("C", "round rail and carriage", [ALONG, "Rz"], "Fx@1, Fy@1, Mx@1, My@1", "Fz@1, Mz@1"),
        table_row(
            "Sg", "sphere in curved groove", [ALONG, "rotation"], "Fx@1, Fy@1", "Fz@1, Mx@1, My@1, Mz@1",
            touching=Touching(("Fx", "Fy"), a=(0.0, -1.0), b=(1.0, 1.0), curved=True),
        ),
        table_row(
            "Ps", "pin in curved slot", [FOLLOWING, "Rz"], "Fy@1, Fz@1, Mx@1, My@1", "Fx@1, Mz@1",
            touching=Touching(("Fy",), a=(0.0, 0.0), b=(0.0, 1.0), curved=True),
        ),
        table_row(
            "Rg", "roller in groove", [FOLLOWING, "Tz", "rotation"], "Fy@2", "Fx@2, Fz@2, Mx@2, My@2, Mz@2",
            touching=Touching(("Fy",), a=(0.0, 0.0), b=(0.0, 1.0), curved=True),
        ),
        table_row(
            "Kc", "curves in contact", [FOLLOWING, BESIDE], "Fy@1, Fz@1, Mx@1, My@1", "Fx@1, Mz@1",
            touching=Touching(("Fy",), a=(0.0, 0.0), b=(0.0, 0.0), curved=True),
        ),
    )
}  # fmt: skip
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
) -> PlacedRow:
    """A row of a ``pair`` with its curves put in; coordinates zero where the curves pass ``point`` (where they begin if it is left out).

    ``axis`` says in which sense of two z points; ``roller`` is that of the roller whose center is the point. Where the marker ``on_b``
    ``(3, 4)`` is given apart, the point is only near the curve, and the curve of link b touches at that marker.
    """
    first, *others = takes_curves(row)
    placed = placed_on(first, center_path(across(curve, first, axis), roller, point), point)
    marker = placed.start
    if axis is not None and marker[:, 2] @ np.asarray(axis) < 0:
        placed = replace(placed, reversed=placed.tangent == Z, turned=placed.tangent == X)
        marker = placed.start
    factors, off = [placed], [0.0 if on_b is not None else missed_by(placed, point)]
    beside, back = marker if on_b is None else on_b, None
    for place in others:
        other = curve_b or Line(point=tuple(beside[:, 3]), direction=tuple(beside[:, 0]))
        second = placed_on(place, across(other, place, beside[:, 2]), beside[:, 3])
        back = second.start
        second = replace(
            second, reversed=bool(back[:, 0] @ beside[:, 0] < 0), turned=bool(back[:, 2] @ beside[:, 2] < 0)
        )
        factors.append(second)
        back = second.start
        # a marker of its own says near which direction the curve of link b runs, a contact at one point that both touch
        crossing = float(np.linalg.norm(np.cross(back[:, 0], beside[:, 0]))) if on_b is None else 0.0
        off += [missed_by(second, beside[:, 3]), crossing]
    return PlacedRow(filled(row, factors, pair), marker, tuple(off), back if on_b is not None else None)


def kept_side(row: PairType, curve: Curve, roller: float | None, point: Sequence[float]) -> Sequence[float]:
    """Where the center of a roller, which stood at ``point``, stands beside another curve: on the same side, nearest to its old foot."""
    path = takes_curves(row)[0].curve if takes_curves(row) else None
    if not isinstance(path, Beside) or not roller or _of_shape(curve, ""):
        return point
    old, new = path.base.once(Travel), curve.once(Travel)
    foot = old.at(np.array([old.nearest(np.asarray(point))[0]])).x[:, 0]
    here = new.at(np.array([new.nearest(foot)[0]]))
    return tuple((here.x + np.sign(path.distance) * roller * here.y)[:, 0].tolist())


# --- faults ----------------------------------------------------------------------------------------------------------


def curve_faults(row: Any, curve: Curve, curve_b: Any, roller: Any, point: Any, where: str) -> list[str]:
    """What is wrong with curves in a row, before they are put in."""
    if not isinstance(row, PairType) or not takes_curves(row):
        return [f"{where}curve: a pair {getattr(row, 'symbol', '?')} takes none; those that do: {', '.join(ROWS)}"]
    off = [] if isinstance(curve_b, Curve | None) else ["curve_b"]
    shapes = (("roller", roller, ()), ("point", point, (3,)))
    off += [name for name, given, shape in shapes if not (given is None or is_numeric(given, shape))]
    if off:
        return [f"{where}curve: {', '.join(off)} at fault"]
    places = takes_curves(row)
    curves = {name: given for name, given in (("curve", curve), ("curve_b", curve_b)) if given is not None}
    found = [fault for name, given in curves.items() for fault in _of_shape(given, f"{where}{name}.")]
    if found:
        return found
    if curve_b is not None and len(places) < 2:
        why = "takes one curve, on link a; exchange a and b for one on link b"
        found.append(f"{where}curve_b: a pair {row.symbol} {why}")
    if any(given.frame == "held" for given in curves.values()) and row.symbol not in HELD:
        why = f"a pair {row.symbol} turns with its curve"
        found.append(f"{where}curve: frame='held' is for {' and '.join(HELD)}; {why}")
    plane = roller or any(place.tangent == X for place in places)
    turns = any(step.holds_rotation for step in row.steps)  # so that it follows a groove about the cam
    found += [
        f"{where}{name}: is not planar; a planar curve is required by pair {row.symbol}{' with a roller' if roller else ''}"
        for name, given in curves.items()
        if plane and not given.once(Travel).is_plane and not (given.once(Travel).is_groove and turns)
    ]
    if roller and not found:
        found += roller_faults(curve, roller, "roller: ", where, side_of(curve, point))
    holds_roll = places[0].tangent == Z and not any(freedom.turns for freedom in row.freedoms)
    closing = curve.once(Travel).closing
    if holds_roll and abs(np.sin(closing / 2)) > SHAPES.even:
        found.append(
            f"{where}curve: its frame comes back turned by {np.rad2deg(closing):.6g} degrees about the tangent after one round, and this "
            "pair holds roll; guide the frame, frame='guided' with a guide, or take a C or Sg"
        )
    return found


def _of_shape(curve: Curve, where: str) -> list[str]:
    return of_function(lambda: curve.faults(where) or shape_faults(curve, where), where)


def cut_faults(contact: PlacedRow, where: str) -> Iterator[str]:
    """A closed curve, inside which link a is, that cuts into what it touches where it is declared: it bends less than a hollow there."""
    places = takes_curves(contact.row)
    if len(places) < 2 or contact.marker_b is not None or not places[0].travel.is_closed:
        return
    one, two = (pressing(contact.row) * place.curvatures(np.zeros(1))[1, 0] for place in places)
    if two - one < -SHAPES.even * (abs(one) + abs(two)):
        at = point_text(contact.marker[:, 3])
        yield (
            f"{where}curve_b: cuts into the curve beside {at}, where they touch: it is hollow there with the radius {-1 / two:.6g}, and "
            f"the curve, inside which link a is, bends with the radius {-1 / one:.6g}; make the hollow wider or the curve smaller (a disc "
            "in a ring: name the link of the disc as a, that of the ring as b)"
        )


def miss_faults(contact: PlacedRow, curves: Sequence[Curve | None], tol: float, where: str) -> Iterator[str]:
    """Contacts that are not on their curves, or where curves cross."""
    names = iter(("curve", "curve_b", ""))
    for miss, name, i in zip(contact.misses, names, count()):
        size = curves[i].once(Travel).length if i < len(curves) and curves[i] is not None else 1.0  # type: ignore[union-attr]
        if not miss > max(SHAPES.met, tol) * size:
            continue
        if name:
            marker = contact.marker_b if contact.marker_b is not None and i else contact.marker
            rolls, at = i == 0 and isinstance(takes_curves(contact.row)[0].curve, Beside), point_text(marker[:, 3])
            yield (
                f"{where}point: is {miss:.6g} off its {name}{' at the radius of the roller' * rolls}, which is nearest at {at}; "
                "give that point, or the marker on link b (on_b=mg.Marker(...), and no point) to have the mechanism assembled"
            )
        else:
            yield f"{where}curve_b: crosses the curve at {np.rad2deg(miss):.6g} degrees at the point; curves in contact touch"


SURFACE_ROWS = {
    "Sp": table_row(
        "Sp", "sphere on surface", [OnSurface(), "rotation"], "Fz@2", "Fx@2, Fy@2, Mx@2, My@2, Mz@2",
        touching=Touching(("Fz",), a=(0.0, 0.0), b=(1.0, 1.0), curved=True),
    )
}  # fmt: skip
"""The same of those that take a surface."""
_BY_SYMBOL = {**ROWS, **TABLE}
_WITH_CURVE = {**TABLE, **ROWS}
_WITH_SURFACE = {**TABLE, **SURFACE_ROWS}
_SYMBOLS = {
    name: symbol
    for rows in (ROWS, SURFACE_ROWS, TABLE)
    for symbol, row in rows.items()
    for name in (row.name, row.name.partition(" (")[0], row.name.partition(",")[0])
}
"""Symbols by full names, ``"revolute"`` or ``"sphere in groove"``, and by what stands there before a bracket or comma."""


def row_of(type: Any, curve: Any, surface: Any = None) -> Any:
    """The row of a pair of a type (a symbol or a row) with or without a curve or surface; what is no type is kept."""
    bent = curve is not None or surface is not None
    own = isinstance(type, PairType) and (type.opens or not (bent or travels(type)))
    symbol = type.symbol if isinstance(type, PairType) and not own else type
    if not isinstance(symbol, str):
        return symbol
    rows = _WITH_SURFACE if surface is not None else _WITH_CURVE if bent else _BY_SYMBOL
    return rows.get(symbol) or rows.get(_SYMBOLS.get(symbol.lower().replace("_", " "), ""), type)


def placed_surface(row: PairType) -> OnSurface | None:
    """The place for a surface in a row."""
    return next((step for step in row.steps if isinstance(step, OnSurface)), None)


def on_surface(
    row: PairType,
    surface: Surface,
    point: Sequence[float] | None,
    axis: Sequence[float] | None,
    pair: str,
    on_b: Array | None = None,
    roller: float | None = None,
) -> PlacedRow:
    """A row of a ``pair`` with its surface put in; coordinates zero at ``point`` (in the middle if left out), z towards ``axis``.

    The center of a ball (``roller``) travels beside the surface, on the side of the point.
    """
    surface = _beside(surface, roller, point) or surface
    if point is not None:
        surface = surface.away_from_pole(np.asarray(point))
    middle = tuple(
        0.5 * (low + high) if np.isfinite(low + high) else 1.0 if np.isfinite(low) else 0.0
        for low, high in surface.ends
    )
    home = middle if point is None else surface.nearest(np.asarray(point))
    x, *along = surface.at(*np.array(home)[:, None])[:3, :, 0]
    u, v = map(rounded, home, extent(surface, x) / np.linalg.norm(along, axis=1))
    placed = OnSurface(surface, (u, v))
    if axis is not None and placed.start[:, 2] @ np.asarray(axis) < 0:
        placed = replace(placed, turned=True)
    off = 0.0 if point is None or on_b is not None else float(np.linalg.norm(placed.start[:, 3] - point))
    return PlacedRow(filled(row, [placed], pair), placed.start, (off,))


def _beside(surface: Surface, roller: float | None, point: Sequence[float] | None) -> Surface | None:
    """The surface itself, or that of the center of a ball on the side of the point, or of the normal; None where there is none."""
    if not roller:
        return surface
    side = 1.0
    if point is not None:
        surface = surface.away_from_pole(np.asarray(point))
        x, xu, xv = surface.at(*np.array(surface.nearest(np.asarray(point)))[:, None])[:3, :, 0]
        side = 1.0 if (np.asarray(point) - x) @ cross(xu, xv) > 0 else -1.0
    return surface.offset(side * roller)


def _ball_faults(surface: Surface, roller: Any, point: Any, where: str) -> list[str]:
    """What is wrong with a ball on a surface."""
    if roller is None or not is_numeric(roller, ()) or not roller > 0:
        return []  # said as the number that it is
    if _beside(surface, roller, point) is not None:
        return []
    return [
        f"{where}roller: the center of a ball of radius {roller:.6g} has no {surface.kind} beside this one; give the surface on which the "
        "center travels, and radius="
    ]


def surface_faults(row: Any, surface: Surface, point: Any, where: str, roller: Any = None) -> list[str]:
    """What is wrong with a surface in a row, before it is put in."""
    if not isinstance(row, PairType) or placed_surface(row) is None:
        known = ", ".join(SURFACE_ROWS)
        return [f"{where}surface: a pair {getattr(row, 'symbol', '?')} takes none; those that do: {known}"]
    if not (point is None or is_numeric(point, (3,))):
        return [f"{where}surface: point is at fault"]
    found = of_function(lambda: surface.faults(f"{where}surface."), f"{where}surface.")
    found = found or _ball_faults(surface, roller, point, where)
    if found or point is None:
        return found
    surface = surface.away_from_pole(np.asarray(point))
    x = surface.at(*np.array(surface.nearest(np.asarray(point)))[:, None])[:, :, 0]
    normal, sizes = np.linalg.norm(np.cross(x[1], x[2])), np.linalg.norm(x[1:3], axis=1)
    if normal <= 1e-9 * sizes.max() ** 2 + 1e-300:
        return [f"{where}surface: has no normal at {point_text(x[0])}, as at a pole or an apex; take another point"]
    return []


def surface_miss(contact: PlacedRow, tol: float, where: str) -> Iterator[str]:
    """A contact that is not on its surface."""
    place = placed_surface(contact.row)
    assert place is not None
    # a miss of 1e-12 is rounding at any size of a mechanism, as of a point in a plane through the origin
    size = max(extent(place.shape, contact.marker[:, 3]), 1e-12 / SHAPES.met)
    if contact.misses[0] > max(SHAPES.met, tol) * size:
        at = point_text(contact.marker[:, 3])
        yield (
            f"{where}point: is {contact.misses[0]:.6g} off its surface, which is nearest at {at}; give that point, or the marker on "
            "link b (on_b=mg.Marker(...), and no point) to have the mechanism assembled"
        )


class Pressed(NamedTuple):
    """A contact under load, ``(...)`` each: greatest ``pressure``, half axes ``along`` and ``across`` (of a line its length and half its
    width), and how far the bodies ``approach`` each other (NaN for a line, where it depends on the bodies as a whole).
    """

    pressure: Array
    along: Array
    across: Array
    approach: Array


@dataclass(frozen=True)
class Hertz(Described):
    """Declare what the Hertz pressure in a contact needs beside the radii: materials and line length.

    Source: K. L. Johnson, Contact Mechanics, 1985.

    Examples
    --------
    >>> import mechgraph as mg
    >>> steel = mg.Hertz(moduli=(210e9, 210e9))
    >>> p = mg.Pair(
    ...     "E", "Sp", "lever", "slider", point=(0, 0, 0), axis=(1, 0, 0), closed="force", radius=0.008, hertz=steel
    ... )
    >>> p.hertz.poisson
    (0.3, 0.3)
    """

    moduli: Annotated[Any, TWO_POSITIVE("Young's moduli of the elements on a and on b", PRESSURE)]
    poisson: Annotated[Any, TWO("Poisson's ratios of the elements on a and on b", PURE, default="0.3, 0.3")] = (
        0.3,
        0.3,
    )
    groove_radius: Annotated[
        float | None, POSITIVE("of the cross section of a groove, larger than the ball's", LENGTH)
    ] = None
    length: Annotated[float | None, POSITIVE("of the line along which a cylinder touches", LENGTH)] = None

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and not all(-1.0 < nu <= 0.5 for nu in self.poisson):
            found.append(wrong(self.poisson, f"{where}poisson", "two numbers between -1 and 0.5"))
        return found

    @property
    def modulus(self) -> float:
        """``E*``: ``1 / E* = (1 - nu_a^2) / E_a + (1 - nu_b^2) / E_b``."""
        return 1.0 / sum((1.0 - nu**2) / E for E, nu in zip(self.moduli, self.poisson, strict=True))


def pressed(force: Array, curvatures: tuple[Array, Array], modulus: float) -> Pressed:
    """A point contact under the force ``(...)``; ``curvatures`` are the relative ones along and across, both above 0.

        a^3 = 3 F E(m) / (2 pi k^2 E* (A + B)),  b = k a,  p0 = 3 F / (2 pi a b),  delta = p0 b K(m) / E*,  m = 1 - k^2,
        B / A = (K - D) / (k^2 D),  D = (K - E) / m

    with half the curvatures ``A <= B`` and complete elliptic integrals (Johnson 4.26); D is Carlson's ``R_D(0, k^2, 1) / 3``.
    """
    one, two = (0.5 * np.asarray(c, dtype=float) for c in curvatures)
    A, B = np.minimum(one, two), np.maximum(one, two)
    # least ratio of the axes of an ellipse
    low, high = np.full(A.shape, np.log(1e-6)), np.zeros(A.shape)
    # halvings of the ratio of the axes of an ellipse, on a logarithmic scale
    for _ in range(60):  # the ratio falls from infinity at k = 0 to 1 at k = 1
        middle = 0.5 * (low + high)
        k = np.exp(middle)
        K, D = scipy.special.ellipkm1(k * k), scipy.special.elliprd(0.0, k * k, 1.0) / 3
        rounder = B * k * k * D < A * (K - D)
        low, high = np.where(rounder, middle, low), np.where(rounder, high, middle)
    k = np.exp(high)
    m = 1.0 - k * k
    F = np.where(np.asarray(force) >= 0, force, np.nan)
    a = np.cbrt(3 * F * scipy.special.ellipe(m) / (2 * np.pi * k**2 * modulus * (A + B)))
    b = k * a
    with np.errstate(invalid="ignore", divide="ignore"):
        p0 = np.where(F == 0, 0.0, 3 * F / (2 * np.pi * a * b))
    along, across = np.where(one <= two, a, b), np.where(one <= two, b, a)
    return Pressed(p0, along, across, p0 * b * scipy.special.ellipkm1(k * k) / modulus)


def pressed_along_line(force: Array, off: Array, length: float, curvature: Array, modulus: float) -> Pressed:
    """A line contact under the force ``(...)`` that acts ``off`` the middle of its length, as ``p0 = sqrt(w E* curvature / pi)``.

    w is the greatest load per length, taken as linear along the line: ``w = F (1 + 6 off / l) / l`` up to ``off = l / 6``, then ``2 F / (3
    (l / 2 - off))`` on what still touches; NaN where the force is off the line, which tips over. Stress at sharp ends is not in it.
    """
    F, e = np.asarray(force, dtype=float), np.abs(off)
    with np.errstate(invalid="ignore", divide="ignore"):
        w = np.where(e <= length / 6, F * (1 + 6 * e / length) / length, 2 * F / (3 * (length / 2 - e)))
        w = np.where((e < length / 2) & (F >= 0), w, np.nan)
        touching = np.where(e <= length / 6, length, 3 * (length / 2 - e))
        width = np.sqrt(4 * w / (np.pi * modulus * curvature))
    pressure = np.sqrt(w * modulus * curvature / np.pi)
    return Pressed(pressure, touching, width, np.full(F.shape, np.nan))


def contact_faults(pair: Any, where: str) -> Iterator[str | None]:
    """What is wrong with what it says as a contact of two elements."""
    yield pair.formats["closed"].fault(pair.closed, f"{where}closed")
    opens = pair.restitution is not None
    if opens and not (pair.type.can_open and pair.closed == "force"):
        yield f"{where}restitution: is for contacts that one force keeps in touch (Sp, Ps, Rg, Kc); give closed='force'"
    elif opens and not (is_numeric(pair.restitution, ()) and 0.0 <= pair.restitution <= 1.0):
        yield wrong(pair.restitution, f"{where}restitution", "a number from 0 to 1")
    yield pair.formats["gap"].fault(pair.gap, f"{where}gap")
    if pair.gap and not opens:
        yield f"{where}gap = {shown(pair.gap)}: the contact stays closed; give its restitution too"
    form, given = pair.type.touching, {"radius": pair.radius, "hertz": pair.hertz}
    if form is None:
        said = [
            name for name, value in given.items() if value is not None and not (name == "radius" and pair.type.opens)
        ]
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
    elif pair.curve_b is not None or pair.roller is not None:
        yield f"{where}has a curve_b or a roller, but no curve; give curve=, or exchange links a and b"
    elif takes_curves(pair.type) and pair.has_geometry:
        yield f"{where}type {pair.type.symbol} needs a curve, such as curve=mg.Curve.circle(radius=...)"
