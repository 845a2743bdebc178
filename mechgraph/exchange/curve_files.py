"""Curves as drawings (DXF) and tables (CSV)."""

from __future__ import annotations

import io
import os
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, FileError
from mechgraph.files import Format, csv_of, format_of, optional, write_whole
from mechgraph.maths.se3 import Array
from mechgraph.pairs.cams import OfLaw
from mechgraph.pairs.curves import Curve, Travel
from mechgraph.quantities import is_numeric, wrong

INSUNITS = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}
"""Numbers of units in the header of a DXF file."""
FORMS = ("spline", "polyline")


def _drawn(curve: Curve, u: Array) -> Array:
    """Points ``(n, 3)``: of a cam about its center, in its axes."""
    x = curve.at(u)[0].T
    return (x - np.asarray(curve.center)) @ curve.basis if isinstance(curve, OfLaw) else x


def _within(points: Any, u: Array, error: float, spline: bool, closed: bool) -> tuple[Array, Any]:
    """Parameters close enough that chords, or the spline through the points, keep within ``error`` of the curve, and that spline."""
    for _ in range(20):  # halvings of intervals that are too long
        x = points(u)
        if closed:
            x[-1] = x[0]
        # ends with the true tangents, so that a closed curve closes smoothly and its knots are those of the ends
        ends: Any = ([(1, points(u[:1], 1)[0])], [(1, points(u[-1:], 1)[0])]) if spline else None
        through: Any = scipy.interpolate.make_interp_spline(u, x, 3 if spline else 1, bc_type=ends)
        inner = u[:-1, None] + np.diff(u)[:, None] * np.array([0.25, 0.5, 0.75])
        true = points(inner.ravel())
        if spline:
            miss = np.linalg.norm(through(inner.ravel()) - true, axis=1)
        else:
            begin, along = np.repeat(x[:-1], 3, axis=0), np.repeat(np.diff(x, axis=0), 3, axis=0)
            part = ((true - begin) * along).sum(axis=1) / (along * along).sum(axis=1)
            miss = np.linalg.norm(true - begin - np.clip(part, 0.0, 1.0)[:, None] * along, axis=1)
        wide = miss.reshape(inner.shape).max(axis=1) > 0.5 * error
        if not wide.any():
            return u, through
        u = np.sort(np.concatenate([u, 0.5 * (u[:-1] + u[1:])[wide]]))
    raise DeclarationError("write a curve", [f"error = {error:g}: is too small for this curve; give a larger one"])


def _curves(curve: Curve, cutter: float | None) -> dict[str, Curve]:
    """What is drawn, by layers."""
    out = {}
    if curve.roller and curve.is_profile:
        out["PROFILE"] = curve.cutter_path(0.0)
        out["PITCH"] = curve
    else:
        out["PITCH" if curve.roller else "PROFILE"] = curve
    if cutter is not None:
        out["CUTTER"] = curve.cutter_path(cutter)
    return out


def _start(curve: Curve) -> Array:
    """Parameters to begin with."""
    if not np.isfinite(curve.ends[0]):
        raise DeclarationError("write a curve", [f"curve: a {curve.kind} without ends; give it ends"])
    step = max(1, (len(curve.grid) - 1) // 90)  # finer where that is not enough
    return np.append(curve.grid[:-1:step], curve.grid[-1])


def _write_dxf(curve: Curve, path: Any, error: float, cutter: float | None, form: str, unit: str | None) -> None:
    ezdxf = optional("ezdxf", "dxf")
    drawing = ezdxf.new("R2010")
    drawing.header["$INSUNITS"] = INSUNITS[unit] if unit else 0
    space = drawing.modelspace()
    about = curve if isinstance(curve, OfLaw) else None
    for layer, one in _curves(curve, cutter).items():
        drawing.layers.add(layer)

        def points(u: Array, order: int = 0, one: Curve = one) -> Array:
            x = one.at(u)[order].T
            return x if about is None else (x if order else x - np.asarray(about.center)) @ about.basis

        u, through = _within(points, _start(one), error, form == "spline", one.is_closed)
        if form == "spline":
            entity = space.add_spline(dxfattribs={"layer": layer})
            entity.dxf.degree = 3
            entity.control_points, entity.knots = through.c.tolist(), through.t.tolist()
        else:
            x = points(u)
            space.add_polyline3d(
                x[: -1 if one.is_closed else None].tolist(), close=one.is_closed, dxfattribs={"layer": layer}
            )
    if about is not None:
        drawing.layers.add("MARKS")
        far = float(np.linalg.norm(points(np.array([curve.ends[0]]))))
        space.add_point((0.0, 0.0, 0.0), dxfattribs={"layer": "MARKS"})
        space.add_line((0.0, 0.0, 0.0), (far, 0.0, 0.0), dxfattribs={"layer": "MARKS"})
    text = io.StringIO()
    drawing.write(text)
    write_whole(path, [text.getvalue()])


def _write_csv(curve: Curve, path: Any, error: float, cutter: float | None, form: str, unit: str | None) -> None:
    travel = curve.once(Travel)
    u, _ = _within(lambda u, order=0: _drawn(curve, u), _start(curve), error, False, curve.is_closed)
    header, columns = ["angle" if isinstance(curve, OfLaw) else "parameter"], [u]
    frame = _frame_at(curve, travel, u)
    for layer, one in _curves(curve, cutter).items():
        x = curve.at(u)[0].T
        if one is not curve:
            x = x + getattr(one, "distance", 0.0) * frame
        x = (x - np.asarray(curve.center)) @ curve.basis if isinstance(curve, OfLaw) else x
        header += [f"{layer.lower()} {axis}" for axis in "xyz"]
        columns += list(x.T)
    if isinstance(curve, OfLaw):
        header += ["law", "slope", "bend", "jerk", "pressure angle", "pitch radius", "profile radius"]
        facts = curve.facts(u)
        columns += [*curve.pieces.at(u), facts.pressure_angle, facts.pitch_radius, facts.profile_radius]
    write_whole(path, [csv_of(header, [[repr(float(v)) for v in row] for row in zip(*columns, strict=True)])])


def _frame_at(curve: Curve, travel: Travel, u: Array) -> Array:
    """The normal y of a plane curve at parameters, ``(n, 3)``."""
    t = curve.at(u)[1]
    return np.asarray(np.cross(travel.guide, (t / np.sqrt((t * t).sum(axis=0))).T))


FORMATS = (
    Format("DXF", (".dxf",), _write_dxf, ("ezdxf",), "dxf"),
    Format("CSV", (".csv",), _write_csv),
)


def write_curve(
    curve: Curve,
    path: str | os.PathLike[str],
    *,
    error: float | None = None,
    cutter: float | None = None,
    form: str = "spline",
    unit: str | None = None,
) -> None:
    """See ``Curve.write``."""
    if error is None:
        error = float(np.ptp(_drawn(curve, _start(curve)), axis=0).max()) / 10000
    faults = [] if is_numeric(error, ()) and error > 0 else [wrong(error, "error", "a length above 0")]
    if form not in FORMS:
        faults.append(wrong(form, "form", "'spline' or 'polyline'"))
    if unit is not None and unit not in INSUNITS:
        faults.append(wrong(unit, "unit", f"one of {', '.join(INSUNITS)}"))
    if faults:
        raise DeclarationError("write a curve", faults)
    one = format_of(path, FORMATS)
    if not os.fspath(path):
        raise FileError(path, "is no path")
    one.write(curve, path, error, cutter, form, unit)
