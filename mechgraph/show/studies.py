"""Pictures of a study: how an output is spread, its bands over the positions, and which parameter moves it most."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import Count, door
from mechgraph.errors import DeclarationError
from mechgraph.quantities import wrong
from mechgraph.show.canvas import INK, PALETTE, Axes, new_axes, plain, said, with_unit
from mechgraph.show.curves import Abscissa, lay_out
from mechgraph.units import unit_of
from mechgraph.variants.result import Study

BANDS = ((0.00135, 0.99865), (0.05, 0.95), (0.25, 0.75))
"""Quantiles between which bands are drawn: three standard deviations of a normal distribution to each side, nine tenths, half."""
MOST_BARS = 20

BinsName = Literal["auto", "fd", "doane", "scott", "stone", "rice", "sturges", "sqrt"]
"""Rules of ``numpy.histogram_bin_edges``."""


@door
def study_histogram(
    study: Study,
    output: str,
    *,
    position: int | None = None,
    part: int | None = None,
    bins: Count | BinsName = "auto",
    ax: Axes = None,
) -> Any:
    """Draw how an output is spread over the variants, with the mechanism itself, the mean and the quantiles. Returns the axes.

    Parameters
    ----------
    output : its name.
    position : of an output over positions the number of one; left out, the value of greatest size of every variant.
    part : of an output with several entries the number of one.
    bins : as in ``numpy.histogram_bin_edges``.

    Raises
    ------
    DeclarationError
        where there is no such output, position or part, or no variant was solved.
    """
    picked = _Picked(study, output, part)
    values, itself, label = picked.one(position)
    values = values[np.isfinite(values)]
    if not values.size:
        raise DeclarationError(f"histogram of {output!r}", ["no variant was solved; study.messages says why"])
    ax = new_axes() if ax is None else ax
    ax.hist(values, bins=bins, color=PALETTE[0], alpha=0.8, edgecolor="white", lw=0.4)
    low, high = np.quantile(values, (0.00135, 0.99865))
    marks: list[tuple[str, float, Any, str]] = [
        ("mechanism itself", itself, "-", INK),
        ("mean", float(values.mean()), (0, (5, 2)), PALETTE[1]),
    ]
    marks += [("0.135 and 99.865 %", q, (0, (1, 1.5)), PALETTE[2]) for q in (float(low), float(high))]
    for i, (name, x, style, colour) in enumerate(marks):
        if np.isfinite(x):
            text = f"{name}: {x:.4g}" if i < 2 else f"{'_' * (i > 2)}{name}"
            ax.axvline(x, color=colour, lw=1.8, ls=style, label=text)
    ax.set_xlabel(label, color=INK)
    ax.set_ylabel(
        f"number of variants (of {len(study.failed)}, {len(study.failed) - values.size} not solved)", color=INK
    )
    plain(ax)
    ax.legend(frameon=False)
    return ax


@door
def study_bands(study: Study, output: str, *, over: str | None = None, part: int | None = None, ax: Axes = None) -> Any:
    """Draw the quantiles of an output over the positions, as bands about the median, with the mechanism itself. Returns the axes.

    Parameters
    ----------
    over : a driver of the study; left out, the first that moves, else the number of the position.
    part : of an output with several entries the number of one.

    Raises
    ------
    DeclarationError
        where there is no such output, part or driver, or the output has one value a variant.
    """
    picked = _Picked(study, output, part)
    if not picked.placed:
        raise DeclarationError(f"bands of {output!r}", ["it has one value a variant: use study_histogram"])
    x = _driver(study, over, picked.values.shape[1])
    ax = new_axes() if ax is None else ax
    some = np.isfinite(picked.values).any(axis=0)
    filled = np.where(some, picked.values, 0.0)
    for (low, high), alpha in zip(BANDS, (0.16, 0.26, 0.4), strict=True):
        ends = np.where(some, np.nanquantile(filled, (low, high), axis=0), np.nan)
        ax.fill_between(
            x.values[0], *ends, color=PALETTE[0], alpha=alpha, lw=0, label=f"{100 * low:g} to {100 * high:g} %"
        )
    ax.plot(x.values[0], np.where(some, np.nanmedian(filled, axis=0), np.nan), color=PALETTE[0], lw=1.8, label="median")
    ax.plot(x.values[0], picked.itself, color=INK, lw=1.4, ls=(0, (5, 2)), label="mechanism itself")
    lay_out(ax, x, picked.label)
    ax.legend(frameon=False)
    return ax


@door
def study_tornado(
    study: Study, output: str, *, position: int | None = None, part: int | None = None, ax: Axes = None
) -> Any:
    """Draw what every parameter alone changes of an output, to first order, at its ends, the largest on top. Returns the axes.

    A distribution without ends has them at three standard deviations. Parameters as in ``study_histogram``; without ``position`` the place
    is that of the greatest size of the mechanism itself.
    """
    picked = _Picked(study, output, part)
    itself = np.atleast_1d(picked.itself)
    if not np.isfinite(itself).any():
        raise DeclarationError(f"tornado of {output!r}", ["the mechanism itself has no value; study.messages says why"])
    at = picked.checked(position) if position is not None else int(np.nanargmax(np.abs(itself)))
    moves = {name: np.atleast_2d(picked.entry(move))[:, at] if picked.placed else picked.entry(move).reshape(2)
             for name, move in study.moves(output).items()}  # fmt: skip
    order = sorted(moves, key=lambda name: -float(np.abs(np.nan_to_num(moves[name])).max()))[:MOST_BARS]
    ax = new_axes((6.4, 1.5 + 0.36 * len(order))) if ax is None else ax
    for i, name in enumerate(order):
        for end, colour in zip(moves[name], (PALETTE[0], PALETTE[1]), strict=True):
            ax.barh(i, end, left=itself[at], height=0.6, color=colour, zorder=2)
    for colour, word in zip((PALETTE[0], PALETTE[1]), ("lower end", "upper end"), strict=True):
        ax.barh([0], [0], left=itself[at], color=colour, label=f"parameter at its {word}")
    ax.axvline(itself[at], color=INK, lw=1.4, zorder=3)
    ax.set_yticks(range(len(order)), map(said, order))
    ax.invert_yaxis()
    ax.set_xlabel(picked.label_at(at if picked.placed else None), color=INK)
    plain(ax)
    ax.tick_params(axis="y", length=0)
    ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return ax


class _Picked:
    """One number of an output for every variant, and for every position where it has them (``placed``)."""

    def __init__(self, study: Study, output: str, part: int | None) -> None:
        if output not in study.outputs:
            raise DeclarationError(
                "picture of a study", [f"{output!r} is no output; outputs: {', '.join(study.outputs)}"]
            )
        values, self.output = study.outputs[output], output
        positions = study.status.shape[1]
        self.placed = values.ndim > 1 and values.shape[1] == positions
        rest = values.shape[1 + self.placed :]
        if len(rest) > 1:
            raise DeclarationError(
                "picture of a study", [f"{output!r} has entries of shape {rest}; keep a single row as an output"]
            )
        self._entries = rest
        if rest and not (isinstance(part, int) and 0 <= part < rest[0]):
            raise DeclarationError(
                "picture of a study",
                [wrong(part, "part", f"a number below {rest[0]}: {output!r} has {rest[0]} entries")],
            )
        self._part = part if rest else None
        self.values, self.itself = self.entry(values), self.entry(study.nominal[output])
        unit = study.units[output]
        unit = unit[self._part or 0] if isinstance(unit, tuple) else unit
        self.unit = unit
        self._name = output if self._part is None else f"{output}[{self._part}]"
        self.label = self.label_at(None)

    def label_at(self, position: int | None) -> str:
        """What is drawn, at a position, with its unit."""
        return with_unit(self._name if position is None else f"{self._name} at position {position}", self.unit)

    def entry(self, values: Array) -> Array:
        """The chosen entry of the last axis."""
        return values if self._part is None else values[..., self._part]

    def checked(self, position: int) -> int:
        """The number of a position."""
        n = self.values.shape[1] if self.placed else 1
        if not isinstance(position, int) or not 0 <= position < n:
            raise DeclarationError(f"picture of {self.output!r}", [wrong(position, "position", f"a number below {n}")])
        return position

    def one(self, position: int | None) -> tuple[Array, float, str]:
        """One value a variant, that of the mechanism itself, and what it is."""
        if not self.placed:
            return self.values.reshape(-1), float(np.reshape(self.itself, -1)[0]), self.label
        if position is not None or self.values.shape[1] == 1:
            at = 0 if position is None else self.checked(position)
            return self.values[:, at], float(self.itself[at]), self.label_at(position)
        whole = np.vstack([self.values, self.itself[None]])
        some = np.asarray(np.isfinite(whole).any(axis=1))
        peaks = np.where(some, np.nanmax(np.abs(np.where(some[:, None], whole, 0.0)), axis=1), np.nan)
        return peaks[:-1], float(peaks[-1]), with_unit(f"greatest |{self._name}|", self.unit)


def _driver(study: Study, over: str | None, count: int) -> Abscissa:
    """Positions of a driver of the first variant."""
    m = study.mechanism
    rows = {name: np.asarray(motion.position, dtype=float) for name, motion in study.motions.items()}
    rows = {name: row.reshape(-1, row.shape[-1])[0] if row.ndim else row.reshape(1) for name, row in rows.items()}
    named = [
        name for name in rows if over is not None and name == (m.full_name(over) if over in m.pair_index else over)
    ]
    if over is not None and not named:
        raise DeclarationError("bands of a study", [f"{over!r} is no driver of the study; drivers: {', '.join(rows)}"])
    moving = named or [name for name, row in rows.items() if len(row) == count and np.ptp(row) > 0]
    if not moving:
        return Abscissa(np.arange(count, dtype=float)[None], "position")
    name = moving[0]
    if m.turns(name):
        return Abscissa(np.rad2deg(rows[name])[None], with_unit(name, "deg"), True)
    return Abscissa(rows[name][None], with_unit(name, unit_of(m.units, (1, 0, 0))))
