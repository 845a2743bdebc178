"""A mechanism made ready for evaluation: places of everything in arrays, numbers as the kernel multiplies them, closure rows.

What follows from links, pairs and frame is in ``closure.places`` and is made once a mechanism; the numbers are in
``coefficients.Numbers`` and are made when first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.batches import Index as Index
from mechgraph.closure.coefficients import FACTORS_AT_ONCE, Numbers
from mechgraph.closure.one_state import FEW_NODES, OneStateMatrices
from mechgraph.closure.rows import CouplingRows, LoopRows, PositionRows, Rows
from mechgraph.closure.states import States
from mechgraph.graph.linkgraph import LinkGraph, link_graph
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters, coupling_places, parameters
from mechgraph.numerics.linear import add_at


class System(States):
    """A mechanism with geometry, indexed for the kernels, with the numbers ``par`` (the declared ones where left out)."""

    _taken_from: tuple[System, Index] | None = None

    def __init__(self, m: Mechanism, graph: LinkGraph | None = None, par: Parameters | None = None) -> None:
        super().__init__(m, graph or m.once(link_graph), par or m.once(parameters))

    # --- rows --------------------------------------------------------------------------------------------------------

    @cached_property
    def rows(self) -> list[Rows]:
        """The contributors of closure rows: the loops, then the couplings."""
        loops: list[Rows] = [LoopRows(self.graph.n_loops)]
        return loops + ([self._coupling_rows()] if self.m.couplings else [])

    @property
    def position_rows(self) -> Sequence[PositionRows]:
        """The same where positions alone are asked for."""
        return self.rows

    def _coupling_rows(self) -> CouplingRows:
        """The rows of the couplings; one without a constant keeps the value that it has at the start."""
        couplings, numbers, places = self.m.couplings, self.par.couplings, coupling_places(self.m)
        found = [self.m.freedom(name) for c in couplings for name in c.freedoms]
        columns = np.array([self.first_column[pair] + freedom for pair, freedom in found])
        rows = np.repeat(np.arange(len(couplings)), [len(c.terms) for c in couplings])
        first = np.searchsorted(rows, np.arange(len(couplings)))
        coefficients = np.concatenate([numbers[own] for own in places])
        start = self.start_coordinates(self.m.start)[columns, None]
        free = np.array([c.constant is None for c in couplings])[:, None]
        at_start = np.add.reduceat(coefficients * start, first, axis=0)
        constant = np.where(free, at_start, numbers[[own.stop for own in places]])
        coefficients = coefficients * np.where(self.is_length[columns], self.par.L, 1.0)[:, None]
        largest = np.maximum.reduceat(np.abs(coefficients), first, axis=0)
        scale = 1.0 / np.where(largest > 0, largest, 1.0)
        return CouplingRows(coefficients * scale[rows], rows, columns, constant * scale, scale, self.single_rows)

    @cached_property
    def n_rows(self) -> int:
        """Number of closure rows."""
        return len(self.row_scale)

    @cached_property
    def row_scale(self) -> Array:
        """Factors ``(n_rows, B)`` of every row over the user's relation: its multiplier in the user's units is ``scale * x``."""
        B = self.par.couplings.shape[1]
        return np.concatenate([np.broadcast_to(part.scale, (len(part.scale), B)) for part in self.position_rows])

    @property
    def coupling_matrix(self) -> Array:
        """Coefficients ``(couplings, F, B)`` of the rows behind those of the loops, internal units."""
        parts = [part.matrix for part in self.rows[1:] if isinstance(part, CouplingRows)]
        return parts[0] if parts else np.zeros((0, self.n_freedoms, 1))

    @property
    def coupled_freedoms(self) -> Index:
        """Freedoms into which rows other than those of loops bring efforts."""
        return np.flatnonzero(self.coupling_matrix.any(axis=(0, 2)))

    @cached_property
    def carrying(self) -> NDArray[np.bool_]:
        """Which freedoms ``(F,)`` are slides that stand in no closure row: they carry what is behind them, and leave the rows alone."""
        out = self.is_length.copy()
        out[self.entries.column] = out[self.coupled_freedoms] = False
        return out

    @cached_property
    def row_places(self) -> list[slice]:
        """The rows of every contributor."""
        ends = np.cumsum([0, *(len(part.scale) for part in self.rows)]).tolist()
        return list(starmap(slice, pairwise(ends)))

    # --- numbers ------ -----------------------------------------------------------------------------------------------

    @cached_property
    def numbers(self) -> Numbers:
        """What follows from the parameters; of variants taken from more what is known there."""
        if self._taken_from is not None:
            return self._taken_from[0].numbers.taken(self.par, self._taken_from[1])
        return Numbers(self.par, self.walk, self.batches, self.n_factors, self.n_freedoms)

    @cached_property
    def one_state(self) -> OneStateMatrices | None:
        """What evaluates one state, kept with the numbers; None for a large mechanism, one without loops, and for variants."""
        known = vars(self.numbers)
        if "one_state" not in known:
            one = self.numbers.constants.shape[3] == self.par.pitch.shape[1] == 1
            small = one and self.graph.n_loops > 0 and len(self.walk.parents) < FEW_NODES
            known["one_state"] = OneStateMatrices(self, self.numbers, self.middle_numbers) if small else None
        found: OneStateMatrices | None = known["one_state"]
        return found

    @cached_property
    def effort_numbers(self) -> Array:
        """The efforts of all freedoms in their nodes, moment and force ``(3, 2, F, B)``."""
        return self.numbers.components(self.effort_table)

    @cached_property
    def middle_numbers(self) -> Array:
        """Middles of the loops ``(loops, 4 nodes)`` from the poses of the nodes, of one mechanism: means of its pair points."""
        ends = np.concatenate([self.numbers.ends[:, 0, :, 0], np.ones((1, len(self.m.pairs)))])
        terms = np.moveaxis(self.loop_averages[:, None] * ends, 1, 2)
        out = np.zeros((len(terms), len(self.walk.parents) + 1, 4), dtype=terms.dtype)
        add_at(out, self.walk.end_node, terms)
        return np.moveaxis(out, 2, 1).reshape(len(out), 4 * out.shape[1])

    @cached_property
    def reaction_numbers(self) -> Array:
        """The constant reaction components in their nodes, moment and force ``(3, 2, K, B)``."""
        return self.numbers.components(self.reaction_table)

    def cases(self, which: Index) -> System:
        """The system with the numbers of some variants of its batch, in that order; of a batch of one, itself."""
        if self.par.batch == 1:
            return self
        out = self.with_parameters(self.par.taken(which))
        if len(which) > 1:  # of one the numbers have another form
            out._taken_from = self, which
        return out

    def with_parameters(self, par: Parameters) -> System:
        """The same mechanism with other numbers."""
        return System(self.m, self.graph, par)

    # --- kept with the mechanism -------------------------------------------------------------------------------------

    def known(self) -> dict[str, Any]:
        """All that is known of the system beside the mechanism itself, see ``remembered``."""
        return {name: value for name, value in vars(self).items() if name != "m"}

    @classmethod
    def remembered(cls, m: Mechanism, known: dict[str, Any]) -> System:
        """A system of a mechanism of which links, pairs, couplings and start are those of another one, all that is known taken over."""
        out = cls.__new__(cls)
        vars(out).update(known, m=m)
        return out


def _numbers(m: Mechanism) -> Numbers:
    return System(m).numbers


def indexed(m: Mechanism) -> System:
    """The system of a mechanism with its declared numbers, which are made once.

    Of many pairs they take more memory than all else, and serve for one state, the declared one: then they are not kept.
    """
    out = System(m)
    if len(m.pairs) <= FACTORS_AT_ONCE:
        vars(out)["numbers"] = m.once(_numbers)
    else:
        vars(out)["numbers"] = Numbers(out.par, out.walk, out.batches, out.n_factors, out.n_freedoms, for_one=True)
    return out
