"""Curves over a motion: positions, rates, efforts, forces, margins, paths."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from mechgraph.determinacy.facts import nearly_singular
from mechgraph.errors import DeclarationError
from mechgraph.kinematics.assembly import scaled_system
from mechgraph.kinematics.solver import closure_rank
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import indexed
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import RANKS
from mechgraph.memo import dataclass
from mechgraph.pairs import cams
from mechgraph.pairs.cam_laws import CamLaw
from mechgraph.pairs.journal import Journal
from mechgraph.quantities import LENGTH, POWER, door, real_array, shown, unit_of, wrong
from mechgraph.result.film import FilmResult
from mechgraph.result.solution import Solution
from mechgraph.result.values import MaterialPoint
from mechgraph.show.canvas import HATCH, INK, MUTED, PALETTE, REACTION, Axes, axis_label, new_axes, plain, said
from mechgraph.show.scene import known_force, place_of
from mechgraph.show.stage import DrawnPose


@dataclass(frozen=True)
class Abscissa:
    """What curves are drawn over: values ``(cases, T)``, the label of the axis, and whether they are degrees."""

    values: Array
    label: str
    degrees: bool = False

    def at(self, marked: int, values: Array) -> tuple[float, float]:
        """The point of a curve at the flat index of a position."""
        if not -values.size <= marked < values.size:
            raise DeclarationError("curve", [wrong(marked, "marked", f"the index of one of {values.size} positions")])
        return self.values.reshape(-1)[marked], values.reshape(-1)[marked]


def abscissa(s: Solution, over: str | None = None) -> Abscissa:
    """Values over which a solution is drawn, one for every position.

    ``over``: a freedom, ``"t"`` for time or ``"position"`` for the number of the position; left out, time of a response, else the first
    freedom that moves as prescribed.
    """
    m, status = s.whole, np.asarray(s.status)
    rows = (-1, status.shape[-1] if status.ndim else 1)
    if over is None:
        timed = s.integrated or (not s.prescribed and s.t is not None)
        still = s.prescribed[0] if s.prescribed and rows[1] == 1 else "position"
        over = "t" if timed else next((name for name in s.prescribed if _stroke(s, name) > 0), still)
    if over == "t":
        if s.t is None:
            fault = "over='t': this motion has no times; name a freedom, or 'position'"
            raise DeclarationError(f"curve of {m.name!r}", [fault])
        t = np.broadcast_to(np.asarray(s.t, dtype=float), s.batch).reshape(rows)
        return Abscissa(t, axis_label("t", unit_of(m.units, (0, 0, 1))))
    if over == "position":
        return Abscissa(np.tile(np.arange(rows[1], dtype=float), (status.size // rows[1], 1)), "position")
    values, name = _coordinates(s, over).reshape(rows), m.full_name(over)
    if m.turns(name):
        return Abscissa(np.rad2deg(values), axis_label(name, "deg"), True)
    return Abscissa(values, axis_label(name, unit_of(m.units, (1, 0, 0))))


def _coordinates(s: Solution, freedom: str) -> Array:
    k, j = s.whole.freedom(freedom)
    return np.asarray(s[s.whole.pairs[k].name].position[..., j])


def _stroke(s: Solution, freedom: str) -> float:
    values = _coordinates(s, freedom)
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def lay_out(ax: Any, x: Abscissa, label: str) -> None:
    """Labels, grid, and ticks of angles at round ones."""
    ax.set_xlabel(x.label, color=INK)
    ax.set_ylabel(label, color=INK)
    plain(ax)
    known = x.values[np.isfinite(x.values)]
    if known.size and np.ptp(known) > 0:
        room = 0.01 * np.ptp(known)
        ax.set_xlim(known.min() - room, known.max() + room)
    if x.degrees and known.size and np.ptp(known) > 60:
        from matplotlib.ticker import MultipleLocator

        # distances of ticks of angles, degrees
        step = next((d for d in (10, 15, 30, 45, 60, 90, 180, 360) if np.ptp(known) / d <= 8), 360)
        ax.xaxis.set_major_locator(MultipleLocator(step))


def draw_curve(ax: Any, x: Abscissa, y: Array, label: str, **style: Any) -> None:
    """One curve a case; positions between others that were not solved are dots."""
    for i, (xs, ys) in enumerate(zip(x.values, np.reshape(y, x.values.shape), strict=True)):
        there = np.isfinite(xs) & np.isfinite(ys)
        ys = np.where(there, ys, np.nan)
        beside = np.concatenate([[False], there, [False]])
        alone = there & ~beside[:-2] & ~beside[2:]
        (line,) = ax.plot(xs, ys, label="_" * bool(i) + said(label), **{"lw": 2.0, "solid_capstyle": "round", **style})
        if alone.any():
            ax.plot(xs[alone], ys[alone], "o", ms=4.5, color=line.get_color(), label="_")


def hatched_strips(ax: Any, x: Abscissa, lost: Sequence[tuple[str, Array, str]]) -> None:
    """Along the upper edge one strip for each ``(name, where (positions), color)`` that is not unique somewhere."""
    from matplotlib.patches import Rectangle

    if not lost:
        return
    low, high = ax.get_ylim()
    height = 0.07  # of a strip, over that of the axes
    ax.set_ylim(low, high + (high - low) * height * len(lost) / (1 - height * len(lost)))
    for i, (name, where, colour) in enumerate(lost):
        there = x.values[np.reshape(where, x.values.shape) & np.isfinite(x.values)]
        begin, end = (there.min(), there.max()) if there.size else ax.get_xlim()
        if begin == end:
            begin, end = ax.get_xlim()
        strip = Rectangle(
            (begin, 1 - height * (i + 0.92)), end - begin, 0.84 * height, transform=ax.get_xaxis_transform(),
            facecolor="white", edgecolor=colour, hatch=HATCH, lw=0.8, label=said(f"{name}: not unique"), gid=f"not unique {name}", zorder=3,
        )  # fmt: skip
        ax.add_patch(strip)


@door
def effort_curve(
    s: Solution,
    freedom: str | Iterable[str] | None = None,
    *,
    over: str | None = None,
    ax: Axes = None,
    marked: int | None = None,
) -> Any:
    """Draw driver efforts (solid), and applied efforts in their freedoms (dashed).

    Couples are on the left axis; forces on the right one if there are both.

    Parameters
    ----------
    s : Solution
        A solution with forces, or a response.
    freedom : str or iterable of str, optional
        Driven freedoms. Default: all.
    over : str, optional
        A freedom, ``"t"`` or ``"position"``. Default: time of a response, else the first prescribed freedom.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.
    marked : int, optional
        Flat index of a position to mark.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No forces, or no such driver.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.effort_curve(s)
    """
    names, m = _driver_names(s, freedom), s.whole
    x = abscissa(s, over)
    ax = new_axes() if ax is None else ax
    found = {name: _driver_effort(s, name) for name in names}
    sides: dict[bool, Any] = dict.fromkeys((effort.couple for effort in found.values()), ax)
    if len(sides) == 2:
        sides[False] = ax.twinx()
    several, entries = len(names) > 1, 0
    for i, (name, effort) in enumerate(found.items()):
        colour, side = PALETTE[i % len(PALETTE)], sides[effort.couple]
        draw_curve(side, x, effort.known, name if several else "driver", color=colour)
        if effort.loaded:
            label = f"applied in {name}" if several else "applied"
            draw_curve(side, x, effort.applied, label, color=colour if several else MUTED, ls=(0, (4, 2)))
        entries += 1 + effort.loaded
        if marked is not None:
            side.plot(*x.at(marked, effort.known), "o", ms=8, mfc="white", mec=PALETTE[1], mew=2.2, zorder=5, label="_")
    for couple, side in sides.items():
        side.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
        own = [name for name, effort in found.items() if effort.couple == couple]
        who = "of the drivers" if len(own) > 1 else f"{'of the driver' if entries == 1 else 'in'} {own[0]}"
        lay_out(side, x, axis_label(f"{'torque' if couple else 'force'} {who}", unit_of(m.units, (1 + couple, 1, -2))))
    if len(sides) == 2:
        sides[False].spines["right"].set_visible(True)
        sides[False].grid(False)
    lost = [(name, effort.unknown, PALETTE[i % len(PALETTE)]) for i, (name, effort) in enumerate(found.items())]
    lost = [strip for strip in lost if strip[1].any()]
    hatched_strips(ax, x, lost)
    _legend(ax, [side for side in sides.values() if side is not ax], entries + len(lost))
    return ax


def _driver_names(s: Solution, freedom: str | Iterable[str] | None) -> list[str]:
    """Full names of the drivers that were asked for."""
    m = s.whole
    if not s.has_forces or not s.actuated:
        fault = "the solution has no driver effort: use solve() with a driver"
        raise DeclarationError(f"effort curve of {m.name!r}", [fault])
    asked = s.actuated if freedom is None else [freedom] if isinstance(freedom, str) else list(freedom)
    names = [m.full_name(name) for name in asked]
    faults = [f"{name!r} is no driver; drivers: {', '.join(s.actuated)}" for name in names if name not in s.actuated]
    if faults or not names:
        raise DeclarationError(f"effort curve of {m.name!r}", faults or ["no driver is named"])
    return names


@dataclass(frozen=True)
class _DriverEffort:
    """What a driver supplies, NaN where that is not unique; where it is ``unknown`` so; what loads do in its freedom."""

    couple: bool
    known: Array
    unknown: Array
    applied: Array

    @property
    def loaded(self) -> bool:
        """Whether a load acts in the freedom."""
        return bool(np.nan_to_num(self.applied).any())


def _driver_effort(s: Solution, name: str) -> _DriverEffort:
    k, j = s.whole.freedom(name)
    pair = s.whole.pairs[k]
    result = s[pair.name]
    unique = result.unique.get("effort", result.unique.get(f"effort {pair.type.freedoms[j].name}", True))
    known = np.where(unique, result.effort[..., j], np.nan)
    unknown = (np.asarray(s.status) == "ok") & ~np.isfinite(known)
    return _DriverEffort(pair.type.efforts[j].is_couple, known, unknown, np.asarray(result.applied_effort[..., j]))


def _legend(ax: Any, others: Sequence[Any], entries: int) -> None:
    """A legend of all curves, those read on the right among them, where there is more than one."""
    if entries < 2:
        return
    found = [pair for side in (ax, *others) for pair in zip(*side.get_legend_handles_labels(), strict=True)]
    ax.legend([handle for handle, _ in found], [label for _, label in found], frameon=False)


@door
def reaction_curve(
    s: Solution, pair: str, *, moment: bool = False, over: str | None = None, ax: Axes = None, marked: int | None = None
) -> Any:
    """Draw the components of a pair's reaction in its own frame, with their ranges in the legend.

    An indeterminate component has a hatched strip and no curve.

    Parameters
    ----------
    s : Solution
        A solution with forces.
    pair : str
        Name of the pair.
    moment : bool
        Moments in place of forces.
    over, ax, marked
        As in ``effort_curve``.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No forces, no such pair, or the pair transmits no such component.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.reaction_curve(s, "B")
    """
    m = s.whole
    _need_forces(s, f"reaction of {m.name!r}")
    result, row = s[pair], m.pair(pair).type
    kinds = {c.name: c.is_couple for c in row.reactions or ()} or dict.fromkeys(row.component_names, False)
    names = [name for name, couple in kinds.items() if couple == moment]
    what = "moment" if moment else "force"
    if not names:
        fault = f"pair {pair!r} ({row.symbol}) transmits no {what}; its components: {', '.join(kinds) or 'none'}"
        raise DeclarationError(f"reaction of {m.name!r}", [fault])
    x = abscissa(s, over)
    ax = new_axes() if ax is None else ax
    solved, lost = np.asarray(s.status) == "ok", []
    values, unique = result.components, result.unique
    unit = result.units["components"][names[0]]
    for i, name in enumerate(names):
        known = np.where(np.asarray(unique.get(name, True)), values[name], np.nan)
        colour = PALETTE[i % len(PALETTE)]
        unknown = solved & ~np.isfinite(known)
        if unknown.any():
            lost.append((name, unknown, colour))
        if np.isfinite(known).any():
            span = f"{np.nanmin(known):.4g} to {np.nanmax(known):.4g}"
            draw_curve(ax, x, known, f"{name}: {span} {unit}".rstrip(), color=colour)
            if marked is not None:
                ax.plot(*x.at(marked, known), "o", ms=7, mfc="white", mec=colour, mew=2)
    ax.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
    owner = m.pair(pair)
    lay_out(ax, x, axis_label(f"{what} of {owner.a} on {owner.b} in {pair}", unit))
    hatched_strips(ax, x, lost)
    ax.legend(frameon=False)
    return ax


@door
def margin_curve(s: Solution, *, over: str | None = None, ax: Axes = None) -> Any:
    """Draw over the positions how far they are from singular ones.

    The smallest nonzero singular value of the scaled closure equations over the largest: with free drivers (zero at a change point)
    and with fixed ones (zero at a dead point). Below the dashed line a report calls a position nearly singular.

    Parameters
    ----------
    s : Solution
        A solution.
    over : str, optional
        As in ``effort_curve``.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.kinematics(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.margin_curve(s)
    """
    x = abscissa(s, over)
    found = margins(s)
    ax = new_axes() if ax is None else ax
    draw_curve(ax, x, found.free, "drivers free", color=PALETTE[0])
    if found.driven is not None:
        draw_curve(ax, x, found.driven, "drivers at rest", color=PALETTE[1])
    ax.axhline(found.near_below, color=MUTED, lw=1.0, ls=(0, (5, 3)), label="nearly singular below")
    ax.set_yscale("log")
    lay_out(ax, x, "margin (smallest singular value over largest)")
    ax.legend(frameon=False)
    return ax


def known_pair(s: Solution, pair: str) -> str:
    """The name of a pair, or an error that names those there are."""
    names = [p.name for p in s.mechanism.pairs]
    if pair not in names:
        fault = f"there is no pair {shown(pair)}; pairs: {', '.join(names)}"
        raise DeclarationError(f"picture of {s.mechanism.name!r}", [fault])
    return pair


def _need_forces(s: Solution, what: str) -> None:
    if not s.has_forces:
        raise DeclarationError(what, ["the solution has no forces: use solve()"])


def _bars(ax: Any, names: Iterable[str], label: str) -> Any:
    """Names of bars from the top, and what they measure; the axes."""
    rows = [*map(said, names)]
    ax.set_yticks(range(len(rows)), rows)
    ax.invert_yaxis()
    ax.set_xlabel(label, color=INK)
    plain(ax)
    ax.tick_params(axis="y", length=0)
    return ax


class Margins(NamedTuple):
    """Margins ``(...)`` with the drivers free and at rest (None without drivers), NaN where not solved, and what is near."""

    free: Array
    driven: Array | None
    near_below: float


def margins(s: Solution) -> Margins:
    """Smallest kept singular value over the largest of the closure equations at every position, scaled about it as ``check`` does.

    With the drivers at rest a position counts as singular with them where a singular value is below what a rank tells apart.
    """
    m, status = s.whole, np.asarray(s.status)
    raw = indexed(m)
    q = np.concatenate([s[p.name].position.reshape(-1, p.type.f).T for p in m.pairs if p.type.f])
    names = m.freedom_names()
    columns = np.array(sorted(names.index(name) for name in s.prescribed if name in names), dtype=np.intp)
    out = np.full((2, status.size), np.nan)
    for i in np.flatnonzero(status.reshape(-1) == "ok"):
        system = scaled_system(m, q[:, i], raw)
        here = Configuration(system, system.state_of(q[:, i : i + 1]))
        free = closure_rank(here)
        out[0, i] = free.margin
        if len(columns):
            rest = closure_rank(here, columns)
            # the drivers at rest take from the mobility; where they do not, they stand at a dead point
            out[1, i] = rest.margin if rest.rank >= free.rank else max(rest.dropped, RANKS.position)
    driven = out[1].reshape(status.shape) if len(columns) else None
    return Margins(out[0].reshape(status.shape), driven, nearly_singular(raw.graph.n_loops))


@door
def reaction_ranges(s: Solution, *, moment: bool = False, ax: Axes = None) -> Any:
    """Draw the ranges of the reactions of all pairs over the positions, one bar per pair.

    The dot is the mean. If parts are indeterminate, the bar is that of the others and is hatched up to the end of the axis.

    Parameters
    ----------
    s : Solution
        A solution with forces.
    moment : bool
        Moments about the pair points in place of forces.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No forces.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.reaction_ranges(s)
    """
    m = s.mechanism
    _need_forces(s, f"reactions of {m.name!r}")
    sizes = {p.name: found for p in m.pairs if (found := _sizes(s, p.name, moment)) is not None}
    ax = new_axes((6.4, 1.3 + 0.34 * len(sizes))) if ax is None else ax
    largest = max((float(np.nanmax(v, initial=0.0)) for v, _, _ in sizes.values()), default=0.0) or 1.0
    labels = []
    for i, (name, (values, parts, lost)) in enumerate(sizes.items()):
        values = values if np.isfinite(values).any() else np.zeros(1)
        low, high, mean = (float(f(values)) for f in (np.nanmin, np.nanmax, np.nanmean))
        if parts:
            ax.barh(i, high - low, left=low, height=0.56, color=PALETTE[0], zorder=2)
            ax.plot(mean, i, "o", ms=6, mfc="white", mec=INK, mew=1.2, zorder=4)
            # a constant force has a bar without length
            ax.plot([low, low], [i - 0.28, i + 0.28], color=PALETTE[0], lw=1.6, zorder=3)
        if lost:
            ax.barh(
                i, 1.08 * largest - high, left=high, height=0.56, facecolor="white", edgecolor=REACTION, hatch=HATCH, lw=0.8,
                gid=f"not unique {name}",
            )  # fmt: skip
        labels.append(f"{name} ({' '.join(parts) or 'nothing'} unique)" if lost else name)
    ax.set_xlim(0.0, 1.08 * largest)
    what = "moment" if moment else "force"
    return _bars(ax, labels, axis_label(f"{what} of the reaction", unit_of(m.units, (2 if moment else 1, 1, -2))))


def _sizes(s: Solution, pair: str, moment: bool) -> tuple[Array, list[str], bool] | None:
    """Sizes at the solved positions of the parts that are unique at all of them, these, and whether there are others; None of no part."""
    result, row = s[pair], s.mechanism.pair(pair).type
    good = np.asarray(s.status).reshape(-1) == "ok"
    unique = {name: bool(np.asarray(flags).reshape(-1)[good].all()) for name, flags in result.unique.items()}
    whole = np.linalg.norm((result.moment if moment else result.force).reshape(-1, 3)[good], axis=1)
    if row.reactions is None:
        known = all(unique[name] for name in row.component_names)
        return (whole, ["all"], False) if known else (np.full(good.sum(), np.nan), [], True)
    names = [c.name for c in row.reactions if c.is_couple == moment]
    if not names:
        return None
    parts = [name for name in names if unique[name]]
    if len(parts) == len(names):
        return whole, parts, False
    values = result.components
    size = np.sqrt(sum((np.square(values[name].reshape(-1)[good]) for name in parts), np.zeros(int(good.sum()))))
    return size, parts, True


@door
def polar_force(s: Solution, pair: str, *, on: Literal["a", "b"] = "a", ax: Axes = None) -> Any:
    """Draw the radial force in a bearing in polar coordinates, fixed on a link.

    The force of link a on link b, the angle about the axis from x of the marker on the chosen link. The circle is the largest force.

    Parameters
    ----------
    s : Solution
        A solution with forces.
    pair : str
        Name of the pair.
    on : {"a", "b"}
        Link on which the picture is fixed: housing or pin.
    ax : PolarAxes, optional
        Polar axes of matplotlib (``projection="polar"``). Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No forces, no such pair, axes that are not polar, or an indeterminate radial force.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.polar_force(s, "B")
    """
    m = s.mechanism
    p = m.pair(known_pair(s, pair))
    what = f"polar force of {m.name!r}"
    _need_forces(s, what)
    if on not in ("a", "b"):
        raise DeclarationError(what, [f"on = {on!r}: expected 'a' or 'b'"])
    if ax is not None and ax.name != "polar":
        raise DeclarationError(what, ["ax: expected polar axes, add_subplot(projection='polar')"])
    good, place = place_of(s)
    stage = DrawnPose(m, place, len(good))
    frame = stage.frames[f"pair:{pair}@{0 if on == 'a' else p.type.f}"][:, :, :3]
    force = known_force(stage, s, p, good, frame[:, :, 2])
    if not np.isfinite(force).all(axis=1).any():
        fault = f"the force in {pair!r} across its axis is not unique; mg.check(m).unique says why"
        raise DeclarationError(what, [fault])
    from matplotlib.ticker import MaxNLocator

    inside = np.einsum("tij,ti->tj", frame, force)
    ax = new_axes((5.6, 5.6), projection="polar") if ax is None else ax
    full = np.full((np.asarray(s.status).size, 2), np.nan)
    full[good] = np.column_stack([np.arctan2(inside[:, 1], inside[:, 0]), np.hypot(inside[:, 0], inside[:, 1])])
    rows = full.reshape(-1, s.batch[-1] if s.batch else 1, 2)
    for turn in rows:
        ax.plot(turn[:, 0], turn[:, 1], color=REACTION, lw=1.8, marker="o" if len(turn) == 1 else "")
    peak = int(np.nanargmax(full[:, 1]))
    ax.plot(*full[peak], "o", ms=7, mfc="white", mec=REACTION, mew=1.8)
    unit = unit_of(m.units, (1, 1, -2))
    link = p.a if on == "a" else p.b
    what = axis_label(f"force of {p.a} on {p.b} in {pair} across its axis", unit)
    greatest = f"greatest {full[peak, 1]:.4g} {unit}".rstrip()
    ax.set_title(f"{what}\nas seen on {said(link)}, {greatest}", color=INK, fontsize=10)
    ax.tick_params(colors=MUTED)
    ax.set_rlabel_position(100)
    ax.yaxis.set_major_locator(MaxNLocator(4))
    return ax


@door
def film_orbit(s: Solution, pair: str, journal: Journal | FilmResult | None = None, *, ax: Axes = None) -> Any:
    """Draw the orbit of a journal in its clearance circle, with the place and direction of the least film.

    Parameters
    ----------
    s : Solution
        A solution with forces over a cycle.
    pair : str
        Name of the pair of the bearing.
    journal : Journal or FilmResult, optional
        The film, or what ``Solution.film`` found. Default: the pair's ``film=``.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        As of ``Solution.film``.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import numpy as np
    >>> from mechgraph import show
    >>> s = mg.solve(
    ...     mg.load("four-bar"), {"A": mg.Motion(np.linspace(0, 2 * np.pi, 48, endpoint=False), velocity=30.0)}
    ... )
    >>> ax = show.film_orbit(s, "B", mg.Journal(radius=0.02, length=0.02, clearance=2e-5, viscosity=0.05))
    """
    film = journal if isinstance(journal, FilmResult) else s.film(pair, journal)
    p, units = s.mechanism.pair(pair), s.mechanism.units
    ax = new_axes((5.6, 5.6)) if ax is None else ax
    turn = np.linspace(0, 2 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=MUTED, lw=1.2)
    for ring in (0.25, 0.5, 0.75):
        ax.plot(ring * np.cos(turn), ring * np.sin(turn), color=MUTED, lw=0.4)
    ends = np.concatenate([film.orbit, film.orbit[:1]]) if film.closed else film.orbit
    ax.plot(*ends.T, color=REACTION, lw=1.8)
    least = film.orbit[np.argmin(film.film)]
    ax.plot(*np.stack([least, least / max(np.hypot(*least), 1e-300)]).T, color=INK, lw=1.0)
    ax.plot(*least, "o", ms=7, mfc="white", mec=REACTION, mew=1.8)
    ax.set_aspect("equal")
    unit = unit_of(units, LENGTH)
    ax.set_title(
        f"orbit of {said(p.b)} in its clearance, seen on {said(p.a)}\nleast film {film.min:.4g} {unit} at {film.at}",
        color=INK, fontsize=10,
    )  # fmt: skip
    ax.set_xlabel("eccentricity ratio along x of the marker", color=INK)
    ax.set_ylabel("along y", color=INK)
    ax.tick_params(colors=MUTED)
    return ax


@door
def friction_losses(s: Solution, *, ax: Axes = None) -> Any:
    """Draw the power that friction takes in every pair: a bar for the mean over the positions, a dot for the greatest.

    Parameters
    ----------
    s : Solution
        A solution with forces, and friction among its loads.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No friction, or no position with forces.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> m = mg.load("four-bar")
    >>> rough = [mg.Friction(name, mu=0.1, radius=0.01) for name in "ABCD"]
    >>> ax = show.friction_losses(
    ...     mg.solve(m, {"A": mg.Motion([0.0, 0.5, 1.0], velocity=10.0)}, loads=[*m.loads, *rough])
    ... )
    """
    lost = {name: np.ravel(power) for name, power in (s.losses if s.has_forces else {}).items()}
    if not any(np.isfinite(power).any() for power in lost.values()):
        about = "needs forces at some position, and friction: solve(..., loads=[..., mg.Friction(...)])"
        raise DeclarationError(f"losses of {s.mechanism.name!r}", [about])
    ax = new_axes((6.4, 1.3 + 0.34 * len(lost))) if ax is None else ax
    for i, power in enumerate(lost.values()):
        ax.barh(i, np.nanmean(power), height=0.56, color=PALETTE[0], zorder=2)
        ax.plot(np.nanmax(power), i, "o", ms=6, mfc="white", mec=INK, mew=1.2, zorder=4)
    ax.set_xlim(left=0.0)
    return _bars(ax, lost, axis_label("power lost: mean (bar), greatest (dot)", unit_of(s.mechanism.units, POWER)))


RANK = {"position": 0, "velocity": 1, "acceleration": 2}


def motion_of(s: Solution, point: str) -> MaterialPoint:
    """Motion of a named point ``"bucket.tip"``, of a mass center by its link ``"bucket"``, or of a pair's point on its link b.

    Raises
    ------
    DeclarationError
        naming what there is.
    """
    m = s.mechanism
    for link in m.links:
        for name in link.points:
            if point == f"{link.name}.{name}":
                return s.link(link.name).at(name)
    if point in m.link_index and m.link(point).center is not None:
        return s.link(point).point(m.link(point).center)
    if point in m.pair_index:
        pair = m.pair(point)
        moving = int(pair.b == m.frame)  # a pair to the frame moves on its other link
        return s.link((pair.b, pair.a)[moving]).point(pair.markers[1 - moving].point)
    there = [f"{k.name}.{name}" for k in m.links for name in k.points]
    there += [k.name for k in m.links if k.center is not None] + [p.name for p in m.pairs]
    raise DeclarationError(f"path in {m.name!r}", [f"there is no point {shown(point)}; points: {', '.join(there)}"])


@door
def point_path(s: Solution, points: str | Iterable[str] | None = None, *, ax: Axes = None) -> Any:
    """Draw the paths of points, in the plane of a planar mechanism, else in space.

    Parameters
    ----------
    s : Solution
        A solution.
    points : str or iterable of str, optional
        Named points (``"bucket.tip"``), links (their mass centers) or pairs (on link b). Default: all named points, or all moving pairs.
    ax : Axes, optional
        Axes of matplotlib in two or three dimensions; on two, x and y of a spatial mechanism. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No such point.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.kinematics(mg.load("four-bar"), {"A": [0.0, 0.5, 1.0]})
    >>> ax = show.point_path(s, ["B", "coupler"])
    """
    s, names = s.finely(), _names(s, points)
    return _draw(s, {name: motion_of(s, name).position for name in names}, 0, ax)


@door
def hodograph(
    s: Solution,
    points: str | Iterable[str] | None = None,
    *,
    of: Literal["velocity", "acceleration"] = "velocity",
    ax: Axes = None,
) -> Any:
    """Draw the hodograph of points: the curve of the tips of their velocities (or accelerations) from one origin.

    Parameters
    ----------
    s : Solution
        A solution.
    points : str or iterable of str, optional
        As in ``point_path``.
    of : {"velocity", "acceleration"}
        What is drawn.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No such point.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> s = mg.kinematics(mg.load("four-bar"), {"A": mg.Motion([0.0, 0.5, 1.0], velocity=10.0)})
    >>> ax = show.hodograph(s, "C")
    """
    if of not in ("velocity", "acceleration"):
        fault = f"of = {of!r}: expected 'velocity' or 'acceleration'"
        raise DeclarationError(f"hodograph of {s.mechanism.name!r}", [fault])
    s = s.finely()
    return _draw(s, {name: getattr(motion_of(s, name), of) for name in _names(s, points)}, RANK[of], ax)


def _names(s: Solution, points: str | Iterable[str] | None) -> list[str]:
    if points is not None:
        return [points] if isinstance(points, str) else list(points)
    m = s.mechanism
    named = [f"{k.name}.{name}" for k in m.links for name in k.points if k.name != m.frame]
    strokes = {p.name: np.ptp(motion_of(s, p.name).position.reshape(-1, 3)[_solved(s)], axis=0).max() for p in m.pairs}
    # path of a point over the longest below which it stands still
    moving = [name for name, stroke in strokes.items() if stroke > 1e-6 * max(strokes.values())]
    return named or moving or [m.pairs[0].name]


def _solved(s: Solution) -> Array:
    return np.asarray(s.status).reshape(-1) == "ok"


def _draw(s: Solution, found: dict[str, Array], rank: int, ax: Any) -> Any:
    m = s.mechanism
    good, place = place_of(s)
    stage = DrawnPose(m, place, len(good))
    flat = stage.normal is not None
    if ax is None:
        ax = new_axes() if flat else new_axes((6.4, 5.6), projection="3d")
    space = ax.name == "3d"
    axes = np.eye(3) if space or not flat else stage.upright.T[[0, 2]]
    axes = axes if space else axes[:2]
    for i, (name, values) in enumerate(found.items()):
        colour = PALETTE[i % len(PALETTE)]
        solved = (np.asarray(s.status) == "ok")[..., None]
        rows = np.where(solved, values, np.nan).reshape(-1, s.batch[-1] if s.batch else 1, 3)
        for k, row in enumerate(rows):
            seen = row @ axes.T
            label, marker = "_" * bool(k) + said(name), "o" if len(row) == 1 else ""
            ax.plot(*seen.T, color=colour, lw=1.9, label=label, marker=marker, ms=4)
            there = seen[np.isfinite(seen).all(axis=1)]
            if len(there):
                ax.plot(*there[:1].T, "o", ms=6, mfc="white", mec=colour, mew=1.6, label="_")
    unit = unit_of(m.units, (1, 0, -rank))
    letters = [_letter(axis) for axis in axes]
    words = ("", "velocity ", "acceleration ")[rank]
    ax.set(**{f"{of}label": axis_label(f"{words}{letter}", unit) for of, letter in zip("xyz", letters, strict=False)})
    for axis in (ax.xaxis, ax.yaxis, *([ax.zaxis] if space else [])):
        axis.label.set_color(INK)
    ax.set_aspect("equal", adjustable=None if space else "datalim")
    if not space:
        plain(ax)
        if rank:
            ax.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
            ax.axvline(0.0, color=MUTED, lw=0.8, zorder=0)
    ax.legend(frameon=False, **({"loc": "upper left", "bbox_to_anchor": (-0.12, 1.0)} if space else {}))
    return ax


def _letter(axis: Array) -> str:
    """``x`` for the x axis; the direction for what is none of them."""
    k = int(np.argmax(np.abs(axis)))
    return "xyz"[k] if abs(axis[k]) > 1 - 1e-9 else f"along ({', '.join(f'{c:.3g}' for c in axis)})"


@door
def least_base_radius(law: CamLaw, *, angles: Any = None, ax: Axes = None, **follower: Any) -> Any:
    """Draw the least base radius of a cam disc over the largest pressure angle that is allowed.

    Parameters
    ----------
    law : CamLaw
        Law over 2 pi.
    angles : array_like, optional
        Largest pressure angles [rad]. Default: 10 to 50 degrees.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.
    **follower
        ``roller_radius``, ``offset``, ``least_radius`` as in ``mg.least_base_radius``.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        As ``mg.least_base_radius``.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> law = mg.CamLaw([mg.Segment("cycloidal", 0.02, 3.0), mg.Segment("cycloidal", -0.02, 2 * 3.141592653589793 - 3)])
    >>> ax = show.least_base_radius(law, roller_radius=0.008)
    """
    allowed = np.deg2rad(np.linspace(10.0, 50.0, 41)) if angles is None else real_array(angles)
    if allowed is None or not allowed.size or not np.isfinite(allowed).all():
        raise DeclarationError("least base radius", [wrong(angles, "angles", "finite numbers, at least one")])
    allowed = np.ravel(allowed)
    radii = [cams.least_base_radius(law, max_pressure=float(a), **follower) for a in allowed]
    ax = new_axes() if ax is None else ax
    x = Abscissa(np.rad2deg(allowed)[None], axis_label("largest pressure angle", "deg"), True)
    draw_curve(ax, x, np.array(radii), "least base radius", color=PALETTE[0])
    lay_out(ax, x, "least base radius")
    return ax
