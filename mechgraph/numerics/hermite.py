"""Hermite interpolation in Newton's form: values and rates at a few nodes, evaluated between them or behind the last.

Source: Stoer and Bulirsch, Introduction to Numerical Analysis, 2002, section 2.1.5 (divided differences over double nodes).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.newton import Problem
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

Array = NDArray[np.float64]
Index = NDArray[np.intp]

STRAIGHT_ON = 1 - 1e-9
"""Cosine between two steps above which a track goes straight on: rounding, no corner."""
CLOSEST = 1 / 16
"""Distance of two nodes, in parts of a step beside them, below which only the step's own nodes give its polynomial: divided differences
over nodes at a distance d err by the rounding of the nodes times (h / d)^3."""


def divided_differences(places: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Coefficients ``(2w, F, n)`` and double nodes ``(2w, n)`` of the polynomials through ``w`` nodes with value and rate.

    ``places (w, n)``, ``values (w, F, n)``, ``rates (w, F, n)``; every one of the ``n`` polynomials has its own nodes.
    """
    z = places.repeat(2, axis=0)
    coefficients = [values[0]]
    between = places[1:] - places[:-1]
    # of first order: the rate at a double node, the slope of the chord between two
    first = np.empty((len(z) - 1, *values.shape[1:]), dtype=values.dtype)
    first[::2] = rates
    if len(between):
        first[1::2] = (values[1:] - values[:-1]) / between[:, None]
    column = first
    coefficients.append(column[0])
    for order in range(2, len(z)):
        column = (column[1:] - column[:-1]) / (z[order:] - z[:-order])[:, None]
        coefficients.append(column[0])
    return np.array(coefficients), z


def newton_form(coefficients: Array, nodes: Array, at: Array) -> Array:
    """``c_0 + (s - z_0) (c_1 + (s - z_1) (c_2 + ...))`` at ``at (n,)``, ``(F, n)``."""
    out = coefficients[-1].copy()
    for order in range(len(coefficients) - 2, -1, -1):
        out *= at - nodes[order]
        out += coefficients[order]
    return out


def cubic(values: Array, rates: Array, rates_there: Array, width: Array, at: Array) -> Array:
    """Cubics ``(F, n)`` at places ``at (n,)`` that are zero at 0 and ``values`` at ``width (n,)``, with rates given at both."""
    s = at / width
    left = 1.0 - s
    part = at * left
    out = values * (s * s * (1.0 + 2.0 * left))
    out += rates * (part * left)
    out -= rates_there * (part * s)
    return np.asarray(out)


def through(problem: Problem, nodes: Nodes, base: Nodes, direction: Array, at: Array) -> Array:
    """States ``(nx, n)`` at places ``at (n,)`` of the polynomial through nodes of one track, path values changing in a ``direction (d,)``.

    ``base``: ``n`` times the node from which increments are measured.
    """
    dq = problem.difference(nodes.x, np.repeat(base.x[:, :1], len(nodes), axis=1))
    rates = problem.tangent(dq, (nodes.Z * direction[:, None]).sum(axis=1))
    form = divided_differences((nodes.place - base.place[0])[:, None], dq.T[:, :, None], rates.T[:, :, None])
    coefficients, places = (np.repeat(values, len(at), axis=-1) for values in form)
    ahead = problem.corrigible(newton_form(coefficients, places, at - base.place), base.which)
    return problem.advance(base.x, ahead, base.track)


class Interpolation:
    """States between nodes of tracks: Hermite interpolation through the nodes beside a step, as far as a track goes straight on.

    What lies off the chord between two nodes is added by the sensitivity to the path values.
    """

    def __init__(self, problem: Problem, nodes: Nodes) -> None:
        self.problem, self.nodes = problem, nodes
        self.left, self.right = nodes.steps
        slope = nodes.drive[:, self.right] - nodes.drive[:, self.left]
        self.slope = slope / (nodes.place[self.right] - nodes.place[self.left])
        self._coefficients, self._z = self._polynomials()

    @property
    def begin(self) -> Index:
        """For every step the one with which its track begins, at the place zero."""
        tracks, begin = self.nodes.track[self.left], np.flatnonzero(self.nodes.place[self.left] == 0.0)
        return np.asarray(begin[np.searchsorted(tracks[begin], tracks)])

    def last(self, tracks: Index, ends: Array) -> Index:
        """The steps that lead to the ``ends`` of tracks."""
        return self.find(tracks, np.nextafter(ends[tracks], -np.inf))

    def find(self, tracks: Index, at: Array) -> Index:
        """Steps in which places of tracks lie."""
        span = float(self.nodes.place.max(initial=0.0)) + 1.0
        key = self.nodes.track[self.left] * span + self.nodes.place[self.left]
        step = np.searchsorted(key, tracks * span + at, side="right") - 1
        first = np.searchsorted(self.nodes.track[self.left], tracks, side="left")
        last = np.searchsorted(self.nodes.track[self.left], tracks, side="right") - 1
        return np.clip(step, first, last)

    def __call__(self, step: Index, at: Array, drive: Array) -> Array:
        """States ``(nx, n)`` in steps at places ``at (n,)`` with path values ``drive (d, n)`` (not put in yet)."""
        nodes, left = self.nodes, self.left[step]
        u = at - nodes.place[left]
        dq = newton_form(self._coefficients[:, :, step], self._z[:, step], u)
        off = drive - (nodes.drive[:, left] + u * self.slope[:, step])
        if np.abs(off).max(initial=0.0) > 0.0:
            right = self.right[step]
            part = u / (nodes.place[right] - nodes.place[left])
            dq += (((1 - part) * nodes.Z[:, :, left] + part * nodes.Z[:, :, right]) * off).sum(axis=1)
        return self.problem.advance(nodes.x[:, left], dq, nodes.track[left])

    def _windows(self) -> list[tuple[Index, Index]]:
        """Steps by the number of nodes through which they are interpolated, with these nodes ``(width, n)``, nearest first."""
        n = len(self.left)
        if not n:
            return []
        length = np.sqrt((self.slope * self.slope).sum(axis=0))
        unit = self.slope / np.where(length > 0, length, 1.0)
        straight = (unit[:, 1:] * unit[:, :-1]).sum(axis=0) > STRAIGHT_ON
        joined = (self.right[:-1] == self.left[1:]) & straight
        run = np.concatenate([[0], np.cumsum(~joined)])
        begin = self.left[np.searchsorted(run, run, side="left")]
        end = self.right[np.searchsorted(run, run, side="right") - 1]
        width = np.minimum(PATH.window, end - begin + 1)
        place, first = self.nodes.place, np.clip(self.left - (width - 2) // 2, begin, end - width + 1)
        for k in range(PATH.window - 1):
            a = np.minimum(first + k, end - 1)
            inside = (k < width - 1) & (a + 1 - self.left != 1)
            near = place[a + 1] - place[a] < CLOSEST * (place[self.right] - place[self.left])
            width = np.where(inside & near, 2, width)
        first = np.where(width == 2, self.left, first)
        out = []
        for w in np.unique(width):
            i = np.flatnonzero(width == w)
            names = first[i] + np.arange(w)[:, None]
            order = np.argsort(np.abs(names - self.left[i] - 0.25), axis=0, kind="stable")
            out.append((i, np.take_along_axis(names, order, axis=0)))
        return out

    def _polynomials(self) -> tuple[Array, Array]:
        """Coefficients ``(2 width, F, steps)`` and double nodes ``(2 width, steps)``, from the left node of every step."""
        nodes, windows = self.nodes, self._windows()
        width = max((len(names) for _, names in windows), default=1)
        c = np.zeros((2 * width, nodes.Z.shape[0], len(self.left)))
        z = np.zeros((2 * width, len(self.left)))
        for i, names in windows:
            left = self.left[i]
            dq = self.problem.difference(nodes.x[:, names], nodes.x[:, None, left])
            rates = (nodes.Z[:, :, names] * self.slope[:, None, i]).sum(axis=1)
            rates = self.problem.tangent(dq, rates)
            places = nodes.place[names] - nodes.place[left]
            parts = divided_differences(places, dq.swapaxes(0, 1), rates.swapaxes(0, 1))
            c[: 2 * len(names), :, i], z[: 2 * len(names), i] = parts
        return c, z
