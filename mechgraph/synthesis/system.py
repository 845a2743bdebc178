"""The equations of synthesis: the closure of the declared graph at every row, with unknown dimensions ``z`` and coordinates ``q_i``.

    F(z, q_i) = 0 at every row i,    q_i = what is asked, where something is

Where all pairs are placed by point and axis the declared configuration is closed whatever ``z`` is, and row 0 adds nothing.
The Jacobian is an arrow: a block ``F_q`` per row and a border ``F_z`` of u columns.

Where rates are asked too (multiply separated positions), a row is a curve ``q(h) = q + h c_1 + h^2 c_2``, and the coefficients of ``h^k``
of all that is above are equations as well. They are those of a discrete Fourier transform over a circle of complex ``h``, on which all
of it is analytic.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import scipy.linalg

from mechgraph.errors import DeclarationError
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinematics.state import Configuration, close
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Array, Index, cross, move_twist, rotation_exp, turn_tangent
from mechgraph.memo import dataclass
from mechgraph.model.gears import moving_lines
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Declared, coupling_places, declared
from mechgraph.modes.homotopy import TRACKS_TOGETHER
from mechgraph.synthesis.tasks import FirstPoses, asked_of
from mechgraph.synthesis.unknowns import (
    UnknownPlace,
    Unknowns,
    echelon,
    marker_twists,
    norms_of,
    per_turn,
    unit_rates,
    whole_numbers,
)
from mechgraph.variants.numbers import MARKER


class WholeTurns(NamedTuple):
    """Unknowns ``which (k,)`` that whole turns change; combinations ``told (k, k)`` of these, the first ``whole`` of which grow by whole
    numbers and the others not at all; ``columns (m,)`` of the angles, independent ``ways (m, n)`` to turn them, and what each adds to the
    unknowns, ``by (k, n)``.
    """

    which: Index
    told: Array
    whole: int
    columns: Index
    ways: Array
    by: Array


@dataclass(frozen=True)
class RowNumbers:
    """``point, axis, second (2, 3, P, B)`` of all markers, points over L about the origin of the problem; complex for members.

    ``norms (2, 2, P, B)`` are those of both directions, see ``unknowns.norms_of``; ``pitch (P, B)`` over L, numbers of ``couplings
    (K, B)`` over ``RowProblem.coupling_units``; ``factors (n, B)`` are those of what is asked up to one; ``others (k, B)``: see
    ``unknowns.UnknownPlace``.
    """

    point: Array
    axis: Array
    second: Array
    norms: Array
    pitch: Array
    couplings: Array
    factors: Array
    others: Array

    def with_vectors(self, point: Array, axis: Array, second: Array, near: Array | None = None) -> RowNumbers:
        """The same with other points and directions, the norms of these nearest to others."""
        norms = norms_of(axis.swapaxes(0, 1), second.swapaxes(0, 1), near)
        return RowNumbers(point, axis, second, norms, *(_many(getattr(self, n), norms.shape[-1]) for n in PLAIN))

    @staticmethod
    def joined(numbers: Sequence[RowNumbers]) -> RowNumbers:
        """Several, one after the other."""
        parts = zip(*(vars(n).values() for n in numbers), strict=True)
        return RowNumbers(*(np.concatenate(part, axis=-1) for part in parts))

    def taken(self, which: Index) -> RowNumbers:
        """Some of them."""
        return RowNumbers(*(v[..., which] for v in vars(self).values()))

    def of_pairs(self, order: Index) -> RowNumbers:
        """Those of some pairs, in that order."""
        point, axis, second, norms = (v[:, :, order] for v in (*self.vectors, self.norms))
        return replace(self, point=point, axis=axis, second=second, norms=norms, pitch=self.pitch[order])

    @property
    def vectors(self) -> tuple[Array, Array, Array]:
        """Points, axes and second directions."""
        return self.point, self.axis, self.second

    def at(self, places: Sequence[UnknownPlace]) -> Array:
        """What stands at the places of a number, ``(B,)``."""
        return np.asarray(getattr(self, places[0].array)[places[0].index])

    def moved(self, X: Array) -> RowNumbers:
        """Markers moved rigidly by poses ``X (3, 4, 2, P, B)``."""
        point, axis, second = (np.einsum("ijspb,sjpb->sipb", X[:, :3], v) for v in self.vectors)
        norms = np.broadcast_to(self.norms, (*self.norms.shape[:-1], X.shape[-1]))
        return replace(self, point=point + X[:, 3].swapaxes(0, 1), axis=axis, second=second, norms=norms)

    def with_values(self, places: Sequence[Sequence[UnknownPlace]], z: Array, near: Array | None = None) -> RowNumbers:
        """The same with unknowns ``z (u, B)`` at their places, and norms nearest to others."""
        out = {name: _many(v, z.shape[1]) for name, v in vars(self).items()}
        for name in {p.array for own in places for p in own}:
            out[name] = np.array(out[name], dtype=np.result_type(out[name], z))
        for value, own in zip(z, places, strict=True):
            for p in own:
                out[p.array][p.index] = value
        if any(p.turns for own in places for p in own):
            axis, second = (out[name].swapaxes(0, 1) for name in MARKER[1:])
            out["norms"] = norms_of(axis, second, near)
        return RowNumbers(**out)

    @property
    def poses(self) -> Array:
        """Poses of the markers ``(3, 4, 2, P, B)``."""
        point, z, x = (v.swapaxes(0, 1) for v in self.unit())
        return np.stack(np.broadcast_arrays(x, cross(z, x), z, point), axis=1)

    def unit(self) -> tuple[Array, Array, Array]:
        """Points, unit axes, and unit second directions across them."""
        z = self.axis / self.norms[0][:, None]
        return self.point, z, (self.second - (z * self.second).sum(axis=1, keepdims=True) * z) / self.norms[1][:, None]


def _many(values: Array, B: int) -> Array:
    """One for all ``B`` as one for each."""
    return values if values.shape[-1] == B else np.broadcast_to(values, (*values.shape[:-1], B))


PLAIN = ("pitch", "couplings", "factors", "others")
"""Numbers beside those of markers."""


class RowProblem:
    """What is asked of a mechanism, what is unknown, and the equations of both.

    Attributes
    ----------
    whole, system : the mechanism with free pairs for points and links of which something is asked; its places and rows.
    own : number of pairs of the mechanism itself, which stand before free ones.
    columns (d,), asked (rows, d) : freedoms of which something is asked, and their values in internal units; NaN where nothing is.
    rows (R,) : numbers of the rows with coordinates of their own; the declared one is among them where it is not closed by itself.
    origin (3,), L : of the internal lengths.

    Raises
    ------
    DeclarationError
        with all that is wrong with tasks and unknowns, behind what is ``told`` already; faults that are no reason to stop reading are
        put there.
    """

    def __init__(self, m: Mechanism, tasks: Any, unknown: Sequence[str], told: list[str] | None = None) -> None:
        faults = list[str]() if told is None else told
        before = len(faults)
        self.first = FirstPoses(m, tasks, unknown, faults)
        self.m = m = self.first.m
        self.own = len(m.pairs)
        self.name = f"synthesis of {m.name!r}"
        self.tasks = asked_of(m, self.first.tasks, faults)
        if moving := m.once(moving_lines):
            faults.append(f"the relation of the coupling {moving[0]!r} is no polynomial; leave it out (couplings=)")
        if self.tasks is None or not m.has_geometry:
            bare = [] if m.has_geometry else ["the pairs have no geometry; a topology can be counted, not dimensioned"]
            if m.has_geometry:
                Unknowns(m, m, unknown, faults)
            raise DeclarationError(self.name, [*faults, *bare])
        values = self.tasks.values
        filled = {
            name: np.where(np.isnan(v), np.nanmean(v) if np.isfinite(v).any() else 0.0, v) for name, v in values.items()
        }
        given = DriverMotion(m, filled, asked="synthesis of")
        self.free = given.free
        self.whole = given.m.replace(pairs=[*given.m.pairs, *given.free], drives=given.names)
        faults += [
            f"function with scale='free': {name} begins at {m.start[name]:g}; expected 0"
            for name in self.tasks.scaled
            if m.start.get(name, 0.0)
        ]
        self.unknowns = Unknowns(m, self.whole, unknown, faults, self.tasks.scaled)
        if len(faults) > before:
            raise DeclarationError(self.name, faults)
        self._lay_out(given.names)
        self.order: Index = np.arange(len(self.whole.pairs))
        self._built: dict[bytes, System | None] = {}
        self.closed_at_start = self._closed_at_start()
        self.rows: Index = np.arange(self.tasks.rows)[self._row_counts :]
        faults += self._read_declared_row()
        if faults and told is None:
            raise DeclarationError(self.name, faults)

    def _lay_out(self, names: tuple[str, ...]) -> None:
        """Places and internal values of what is asked of freedoms, and of all numbers."""
        assert self.tasks is not None
        values = self.tasks.values
        # of every column that is asked, and of its rates, the number of its factor, -1 where it has none
        factor_of = [self.tasks.scaled.index(name) if name in self.tasks.scaled else -1 for name in names]
        self.factor_of = np.tile(factor_of, 1 + len(self.tasks.rates))
        user = np.array([values.get(name, values.get(self._user_name(name))) for name in names]).T
        numbers = declared(self.whole)
        self.origin, self.L = self._unit(numbers)
        par = numbers.parameters(
            self.whole, np.repeat(self.origin[:, None], len(self.m.links), axis=1), self.origin, self.L
        )
        self.system = System(self.whole, None, par)
        s = self.system
        self.columns: Index = s.columns_of(names)
        unit = np.where(s.is_length[self.columns], self.L, 1.0)
        self.asked = user / unit
        none, factor = np.full(self.tasks.rows, np.nan), (1.0, 2.0)
        # Taylor coefficients ``(rows, d)``, one array for each order of rates that are asked
        self.rates = [
            np.array([rates.get(name, rates.get(self._user_name(name), none)) for name in names]).T / unit / k
            for k, rates in zip(factor, self.tasks.rates, strict=False)
        ]
        self.coupling_units = self._coupling_units()
        start = self.unknowns.declared[:, None]
        others = [
            own[0].scale * v for own, v in zip(self.unknowns.places, start, strict=True) if own[0].array == "others"
        ]
        point, axis, second = (numbers.point - self.origin[:, None, None]) / self.L, numbers.axis, numbers.second
        self.numbers = RowNumbers(
            point,
            axis,
            second,
            norms_of(axis.swapaxes(0, 1), second.swapaxes(0, 1)),
            par.pitch,
            numbers.couplings / self.coupling_units,
            np.ones((len(self.tasks.scaled), 1)),
            np.array(others).reshape(-1, 1),
        )

    def _closed_at_start(self) -> bool:
        """Whether the declared configuration is closed whatever the dimensions: pairs stand by point and axis and begin at zero, no
        coupling has a constant.
        """
        m, constants = self.m, {own.stop for own in coupling_places(self.m)}
        sought = {p.component for own in self.unknowns.places for p in own if p.array == "couplings"}
        plain = all(pair.on_a is None and pair.contact is None for pair in m.pairs)
        return plain and not (any(m.start.values()) or any(c.constant for c in m.couplings) or sought & constants)

    def _coupling_units(self) -> Array:
        """Units ``(K, 1)`` of the numbers of couplings in which a relation is of size one where lengths are."""
        s, out = self.system, np.ones((len(self.system.par.couplings), 1))
        for g, own in enumerate(coupling_places(self.m)):
            columns = s.columns_of(self.m.couplings[g].freedoms)
            unit = np.where(s.is_length[columns], self.L, 1.0)
            size = float(np.abs(s.par.couplings[own, 0] * unit).max(initial=0.0)) or 1.0
            out[own, 0], out[own.stop] = size / unit, size
        return out

    def with_rows(self, rows: Index) -> RowProblem:
        """The same of some rows, the declared one first."""
        out = copy(self)
        vars(out).pop("turns", None), vars(out).pop("plain_angles", None)
        out.asked, out.rates = self.asked[rows], [rates[rows] for rates in self.rates]
        out.rows = np.arange(len(rows))[out._row_counts :]
        return out

    @property
    def _row_counts(self) -> int:
        """The first row with equations of its own: not the declared one, where that is closed by itself and no rates are asked there."""
        return int(self.closed_at_start and not any((~np.isnan(rates[0])).any() for rates in self.rates))

    def _user_name(self, name: str) -> str:
        """The name by which a coordinate of a free pair was asked."""
        pair, _, part = name.rpartition(".")
        return f"{pair.rstrip(chr(39))}.{part}"

    def _unit(self, numbers: Declared) -> tuple[Array, float]:
        """Middle and size of what is given: of points of pairs and of places asked."""
        assert self.tasks is not None
        points = numbers.point[:, :, : len(self.m.pairs), 0].transpose(0, 2, 1).reshape(-1, 3)
        sides: list[Array] = [points]
        for name, column in self.tasks.values.items():
            stem, _, part = name.rpartition(".")
            if part in ("Tx", "Ty", "Tz") and stem not in self.m.pair_index:
                place = np.zeros((len(column), 3))
                for k, other in enumerate(("Tx", "Ty", "Tz")):
                    place[:, k] = np.nan_to_num(self.tasks.values.get(f"{stem}.{other}", place[:, k]))
                sides.append(place)
        every = np.concatenate(sides)
        middle = 0.5 * (every.max(axis=0) + every.min(axis=0))
        size = float(np.abs(every - middle).max(initial=0.0))
        return middle, size or 1.0

    def _read_declared_row(self) -> list[str]:
        """What is asked at row 0 has to be so there, where that row is closed by itself; unknown points stand where they are asked.

        Faults are returned.
        """
        s, faults = self.system, list[str]()
        self.known: dict[int, float] = {}
        if not self.closed_at_start:
            return faults
        pinned = {
            (p.pair, p.component): k
            for k, places in enumerate(self.unknowns.places)
            for p in places
            if p.pair >= len(self.m.pairs)
        }
        at_rest = self.at_rest
        for j, column in enumerate(self.columns.tolist()):
            want, have = self.asked[0, j], at_rest[s.single_rows[column]]
            pair, part = int(s.pair_of_freedom[column]), column - int(s.first_column[s.pair_of_freedom[column]])
            if np.isnan(want):
                continue
            if (pair, part) in pinned:
                self.known[pinned[pair, part]] = float(want - self.origin[part] / self.L)
            # part of the size of the problem by which a place may be off
            elif abs(want - have) > 1e-9:
                name = self.whole.freedom_names()[column]
                scale = self.L if s.is_length[column] else 1.0
                faults.append(
                    f"row 0: {name} = {want * scale:g} is asked, and is {have * scale:g} where the mechanism is declared; "
                    "begin there" + (", or let the point be unknown" if s.is_length[column] else "")
                )
        if faults:
            return faults
        places = [self.unknowns.places[k] for k in self.known]
        self.numbers = self.numbers.with_values(places, np.array(list(self.known.values())).reshape(-1, 1))
        return faults

    @cached_property
    def at_rest(self) -> Array:
        """State ``(nx,)`` of the declared configuration, free pairs too: where pairs stand by point and axis all coordinates are zero but
        those of named points; else it is closed near ``start``.
        """
        s = self.system
        q = s.start_coordinates(self.m.start)[:, None] / s.in_user_units(np.ones((s.n_freedoms, 1)))
        for k in range(len(self.m.pairs), len(self.whole.pairs)):
            for j in range(int(s.first_column[k + 1] - s.first_column[k])):
                column = int(s.first_column[k]) + j
                if s.is_length[column]:
                    axis = s.m.pairs[k].type.freedoms[j].twist[3:]
                    a, b = s.m.pairs[k].markers
                    q[column, 0] = float(
                        np.asarray(a.pose())[:3, :3] @ axis @ (np.asarray(b.point) - np.asarray(a.point))
                    )
        x = s.state_of(q)[:, 0]
        return x if self.closed_at_start else close(s, x, np.zeros(0, dtype=np.intp))[0]

    # --- the unknowns ------------------------------------------------------------------------------------------------

    @property
    def u(self) -> int:
        """Number of unknown dimensions that are sought: row 0 says where an unknown point is, as far as it asks for its place."""
        return len(self.places)

    @cached_property
    def sought(self) -> Index:
        """Numbers of the unknowns that are sought."""
        return np.array([k for k in range(len(self.unknowns.names)) if k not in self.known], dtype=np.intp)

    @cached_property
    def places(self) -> list[list[UnknownPlace]]:
        """Places of the unknowns that are sought."""
        return [self.unknowns.places[k] for k in self.sought]

    @cached_property
    def _scales(self) -> tuple[Array, Array]:
        """Origins and units ``(u, 1)`` of the unknowns: points are counted in L from the origin of the problem."""
        return self.scales_of(self.unknowns.places)

    def scales_of(self, places: Sequence[Sequence[UnknownPlace]]) -> tuple[Array, Array]:
        """The same of numbers at some places."""
        origin, unit = (np.full((len(places), 1), value) for value in (0.0, 1.0))
        for k, (p, *_) in enumerate(places):
            if p.array == "point":
                origin[k], unit[k] = self.origin[p.component], self.L
            elif p.array == "pitch":
                unit[k] = self.L
            elif p.array == "couplings":
                unit[k] = self.coupling_units[p.component]
            origin[k], unit[k] = origin[k] / p.scale, unit[k] / p.scale
        return origin, unit

    def inside(self, values: Array) -> Array:
        """Unknowns that are sought ``z (u, T)`` in internal units, from values of all ``(names, T)`` in those of the user."""
        origin, unit = self._scales
        return np.asarray(((values - origin) / unit)[self.sought])

    def outside(self, z: Array) -> Array:
        """Values ``(names, T)`` of all unknowns in the units of the user."""
        origin, unit = self._scales
        every = np.empty((len(origin), z.shape[1]), dtype=z.dtype)
        every[self.sought] = z
        for k, value in self.known.items():
            every[k] = value
        return np.asarray(origin + unit * every)

    def mechanism(self, values: Array) -> Mechanism:
        """The mechanism with unknown dimensions of these values ``(u,)``, in the units of the user."""
        return self.unknowns.mechanism(values)

    def scaled(self, places: Sequence[Sequence[UnknownPlace]], values: Array) -> Array:
        """Values ``(n, B)`` of numbers of the user in internal units."""
        origin, unit = self.scales_of(places)
        return np.asarray((values - origin) / unit)

    @cached_property
    def turns(self) -> WholeTurns:
        """What whole turns of angles that are asked nowhere change: unknown constants of couplings, no known ones."""
        s, every = self.system, coupling_places(self.system.m)
        number = {p.component: k for k, (p, *_) in enumerate(self.places) if p.array == "couplings"}
        mine = [g for g, own in enumerate(every) if own.stop in number]
        asked, C = self.columns[~np.isnan(self.asked).all(axis=0)], s.coupling_matrix[:, :, 0]
        columns = complement(np.union1d(asked, np.flatnonzero(s.is_length | ~C.any(axis=0))), s.n_freedoms)
        if not mine:
            return WholeTurns(
                np.zeros(0, dtype=np.intp), np.zeros((0, 0)), 0, columns[:0], np.zeros((0, 0)), np.zeros((0, 0))
            )
        # a row of the matrix is over the unit of its constant
        whole, unit = zip(*(whole_numbers(row) for row in C[:, columns]), strict=True)
        rows = np.array(whole, dtype=object).reshape(len(C), len(columns))
        _, U, rank = echelon(rows[[g for g in range(len(C)) if g not in mine]])
        shifts, ways = rows[mine] @ U[:, rank:], U[:, rank:].astype(float)
        lattice, _, rank = echelon(shifts)
        basis, size = lattice[:, :rank].astype(float), 2 * np.pi * np.array([unit[g] for g in mine])
        told = np.concatenate([np.linalg.pinv(basis), scipy.linalg.null_space(basis.T).T]) / size
        which = np.array([number[every[g].stop] for g in mine], dtype=np.intp)
        return WholeTurns(which, told, rank, columns, ways, size[:, None] * shifts.astype(float))

    @cached_property
    def plain_angles(self) -> tuple[list[str], list[str], Index]:
        """Screws and couplings of unknown ratios, then other couplings, by which an angle that is not asked at all rows stands in the
        equations as a number too, not by sine and cosine alone; and columns of what is asked that may not go along a line in the trace
        test for such reasons.
        """
        s, m = self.system, self.system.m
        sought = {p.component for own in self.places for p in own if p.array == "couplings"}
        given = self.columns[~np.isnan(self.asked[self.rows]).any(axis=0)]
        asked = self.columns[~np.isnan(self.asked).all(axis=0)]
        told, endless, bound = list[str](), list[str](), list[int]()
        for k, pair in enumerate(m.pairs):
            columns = s.first_column[k] + np.flatnonzero([any(f.per_pitch) for f in pair.type.freedoms])
            told += [f"pair {pair.name}"] if not np.isin(columns, given).all() else []
            bound += columns.tolist()
        for c, own in zip(m.couplings, coupling_places(m), strict=True):
            columns = s.columns_of(c.freedoms)
            known, length = np.isin(columns, given), s.is_length[columns]
            unknown, angle = bool(sought & set(range(own.start, own.stop))), bool((~length & ~known).any())
            ratio = unknown or bool((length & ~known).any())
            told += [f"coupling {c.name}"] if unknown and angle else []
            endless += [f"coupling {c.name}"] if ratio and angle and not unknown else []
            # an angle that is asked at one row says what a constant is
            known = np.isin(columns, asked)
            open_ = bool((~length & ~known).any())
            if open_ or ratio or own.stop in sought:
                bound += columns[known & (length if open_ else ~length)].tolist()
        return told, endless, np.array(bound, dtype=np.intp)

    @cached_property
    def loop_signs(self) -> Array:
        """How every loop passes the pairs ``(loops, P)``."""
        graph = self.system.graph
        out = np.zeros((graph.n_loops, len(self.whole.pairs)))
        for i, loop in enumerate(graph.loops):
            for pair, sign in loop:
                out[i, pair] = sign
        return out

    # --- the equations -----------------------------------------------------------------------------------------------

    def placed(self, places: Sequence[Sequence[UnknownPlace]]) -> list[list[UnknownPlace]]:
        """Places of numbers of pairs where pairs stand in ``order``."""
        at = {int(k): i for i, k in enumerate(self.order)} | {-1: -1}
        return [[replace(p, pair=at[p.pair]) for p in own] for own in places]

    def system_with(self, numbers: RowNumbers) -> System:
        """The system with other numbers; of one mechanism where it has to be built from these."""
        X, plain = numbers.poses, {"pitch": numbers.pitch, "couplings": self.coupling_units * numbers.couplings}
        markers = {"marker_a": X[:, :, 0], "marker_b": X[:, :, 1]}
        if not len(numbers.others) or (built := self._system_built(numbers)) is None:
            return self.system.with_parameters(replace(self.system.par, **cast("Any", markers | plain)))
        # other points of links stand in free pairs
        own = np.arange(len(self.whole.pairs))[:, None] < self.own
        markers = {name: np.where(own, getattr(built.par, name), value) for name, value in markers.items()}
        return built.with_parameters(replace(built.par, **cast("Any", markers)))

    def is_built(self, numbers: RowNumbers) -> bool:
        """Whether there is a mechanism with the numbers of one."""
        return self._system_built(numbers) is not None

    def _system_built(self, numbers: RowNumbers) -> System | None:
        """The system of a mechanism built with the numbers of one; None where there is none. Those of many numbers are kept."""
        z = np.array([numbers.at(places)[0] for places in self.places])
        if z.tobytes() not in self._built:
            if len(self._built) > TRACKS_TOGETHER:
                self._built.clear()
            try:
                m = self.unknowns.mechanism(self.outside(z[:, None])[:, 0])
            except DeclarationError:
                self._built[z.tobytes()] = None
            else:
                pairs = [*m.pairs, *self.whole.pairs[self.own :]]
                whole = self.whole.replace(pairs=pairs, couplings=m.couplings, gears=m.gears)
                par, old = declared(whole), self.system.par
                self._built[z.tobytes()] = System(whole, None, par.parameters(whole, old.offset, old.origin, old.L))
        return self._built[z.tobytes()]

    def configuration(self, numbers: RowNumbers, states: Array) -> Configuration:
        """Mechanisms ``T`` at states ``(nx, n T)``, those of one set of ``T`` after the other."""
        T = numbers.point.shape[-1]
        if len(numbers.others):
            return cast("Configuration", Apart(self, numbers, states.reshape(len(states), -1, T)))
        system = self.system_with(numbers)
        many = states.shape[1] > T and system.par.batch > 1
        return Configuration(system.cases(np.tile(np.arange(T), states.shape[1] // T)) if many else system, states)

    @cached_property
    def asked_columns(self) -> Index:
        """Columns of all that is asked; behind them those of its rates."""
        return np.concatenate([self.columns + k * self.system.n_freedoms for k in range(1 + len(self.rates))])

    def factors(self, numbers: RowNumbers) -> Array:
        """By what ``(d, B)`` that which is asked is multiplied."""
        out = np.ones((len(self.factor_of), numbers.point.shape[-1]), dtype=numbers.factors.dtype)
        scaled = self.factor_of >= 0
        out[scaled] = numbers.factors[self.factor_of[scaled]]
        return out

    def equations(self, numbers: RowNumbers, x: Array, drive: Array | None = None) -> ArrowRows:
        """The equations of tracks with such numbers of markers (unknowns among them) at states ``x (R, nx, T)``, in internal units.

        ``drive (R, d, T)`` is asked up to factors. Where rates are asked, behind every row stand the Taylor coefficients of its
        freedoms, order by order.
        """
        return ArrowRows(self, numbers, x, drive)


class Apart:
    """Configurations of mechanisms that differ in more than arrays, as one; of numbers of which there is no mechanism nothing closes."""

    def __init__(self, problem: RowProblem, numbers: RowNumbers, states: Array) -> None:
        self.x, self.system, self._parts = states.reshape(len(states), -1), problem.system, list[Configuration]()
        self._built = np.ones(states.shape[2], dtype=bool)
        for t in range(states.shape[2]):
            one = numbers.taken(np.array([t]))
            self._built[t] = problem.is_built(one)
            self._parts.append(Configuration(problem.system_with(one), states[:, :, t]))

    @property
    def T(self) -> int:
        """Number of positions."""
        return self.x.shape[1]

    @property
    def residual(self) -> Array:
        """What is left open."""
        return np.where(np.tile(self._built, self.T // len(self._built)), self._joined("residual"), np.inf)

    @property
    def row_scale(self) -> Array:
        """See ``System.row_scale``."""
        every = np.concatenate([one.system.row_scale for one in self._parts], axis=1)
        return np.tile(every, self.T // len(self._built))

    def _joined(self, name: str) -> Array:
        every = np.stack([getattr(one, name) for one in self._parts], axis=-1)
        return every.reshape(*every.shape[:-2], -1)

    def __getattr__(self, name: str) -> Array:
        return self._joined(name)


class ArrowRows:
    """The closure of all rows at a batch of ``T`` tracks at states ``x (R, nx, T)``: in the batch of ``here`` row by row, and of each
    row, where rates are asked, one node after the other.
    """

    def __init__(self, problem: RowProblem, numbers: RowNumbers, x: Array, drive: Array | None = None) -> None:
        self.problem, self.numbers, self.x, self.drive = problem, numbers, x, drive
        s = problem.system
        self.R, _, self.T = x.shape
        # nodes of the circles on which coefficients of curves are found, and below their radius times the rates: the first coefficient of
        # the residual that is taken for another one is that of ``h^9``, below ``3^9 / 9!`` for angles that turn at 3
        orders, self.N = len(problem.rates), 8 if problem.rates else 1
        self._steps = None
        if orders:
            rates = x[:, s.n_state :].reshape(self.R, orders, s.n_freedoms, self.T)
            size = np.abs(rates).max(axis=2) ** (1.0 / np.arange(1, orders + 1))[:, None]
            around = np.exp(2j * np.pi * np.arange(self.N) / self.N)[:, None]
            h = around * (0.03 / np.maximum(1.0, size.max(axis=1)))[:, None]
            powers = h[:, None] ** np.arange(orders + 1)[:, None, None]
            self._coefficients, self._powers = 1.0 / (self.N * powers), powers
            self._steps = np.einsum("rkft,rknt->frnt", rates, powers[:, 1:])

    @cached_property
    def here(self) -> Configuration:
        """All rows and nodes in one batch."""
        s = self.problem.system
        states = np.moveaxis(self.x[:, : s.n_state, None], 1, 0)
        if self._steps is not None:
            states = s.advance(np.broadcast_to(states, (s.n_state, self.R, self.N, self.T)), self._steps)
        return self.problem.configuration(self.numbers, states.reshape(s.n_state, -1))

    def _by_row(self, values: Array) -> Array:
        """``(n, ..., R N T) -> (R, n, ..., T)``, where rates are asked with all orders of ``n`` one after the other."""
        nodes = np.moveaxis(values.reshape(*values.shape[:-1], self.R, self.N, self.T), -3, 0)
        if self._steps is None:
            return nodes[..., 0, :]
        shape = (self.R, *(1,) * (nodes.ndim - 3), self.N, self.T)
        orders = [(nodes * c.reshape(shape)).sum(axis=-2) for c in self._coefficients.swapaxes(0, 1)]
        return np.concatenate(orders, axis=1)

    @cached_property
    def residual(self) -> Array:
        """What the closure leaves open ``(R, n, T)``."""
        return self._by_row(self.here.residual)

    @cached_property
    def by_coordinates(self) -> Array:
        """Derivatives ``(R, n, F, T)`` by all freedoms of the row, those asked too; behind them those by the coefficients of rates."""
        if self._steps is None:
            return self._by_row(self.here.J)
        s, J = self.problem.system, self.here.J
        shifted, first = J, J
        if s.rotations is not None:
            # of a curve of rotations ``exp(w(h)) Q`` the first factor turns what moves ``Q``, and its steps are no rates
            (turns, _), unit = s.rotations, np.eye(3)
            w = self._steps.reshape(s.n_freedoms, -1)[turns]
            back = np.array([turn_tangent(w, np.broadcast_to(e[:, None, None], w.shape)) for e in unit])
            along = np.linalg.inv(back.transpose(2, 3, 1, 0))
            own = J[:, turns.T]
            shifted, first = J.copy(), J.copy()
            shifted[:, turns.T] = np.einsum("nbat,btac->nbct", own, along)
            first[:, turns.T] = np.einsum("nbat,acbt->nbct", own, rotation_exp(w))
        columns = [self._by_row(first)]
        for k in range(1, len(self.problem.rates) + 1):
            nodes = shifted.reshape(*J.shape[:2], self.R, self.N, self.T) * self._powers[:, k]
            columns.append(self._by_row(nodes.reshape(J.shape)))
        return np.concatenate(columns, axis=2)

    @cached_property
    def by_unknowns(self) -> Array:
        """Derivatives ``(R, n, u, T)`` by the unknown dimensions."""
        places = self.problem.places
        every = [p for own in places for p in own if p.array in MARKER]
        which = [k for k, own in enumerate(places) for p in own if p.array in MARKER]
        side, pair = (np.array([getattr(p, name) for p in every], dtype=int) for name in ("side", "pair"))
        each = self.moved(side, pair, unit_rates(every))
        out = np.zeros((*each.shape[:2], len(places), self.T), dtype=each.dtype)
        for i, k in enumerate(which):
            out[:, :, k] += each[:, :, i]
        for k, (p, *_) in enumerate(places):
            if p.array not in MARKER:
                out[:, :, k] = self.by_number(p)
        return out

    def by_number(self, p: UnknownPlace) -> Array:
        """Derivatives ``(R, n, T)`` by what stands at a place that is none of a marker."""
        problem, here, s = self.problem, self.here, self.problem.system
        if p.array == "factors":
            if self.drive is None:
                return np.zeros_like(self.residual)
            scaled = problem.factor_of == p.component
            J = self.by_coordinates[:, :, problem.asked_columns[scaled]]
            return np.asarray(np.einsum("rndt,rdt->rnt", J, self.drive[:, scaled]))
        if p.array == "pitch":
            columns = np.arange(s.first_column[p.pair], s.first_column[p.pair + 1])
            along = here.S[:3, columns] * (per_turn(s.m.pairs[p.pair])[:, None] * here.x[s.single_rows[columns]])
            V = np.concatenate([np.zeros_like(along), along]).sum(axis=1)
            return self._by_row(self.opened(np.array([0]), np.array([p.pair]), V[:, None]))[:, :, 0]
        if p.array == "couplings":
            return self._by_row(self._of_coupling(p.component))
        # central differences: the third derivative times the square of the step, and rounding over it, are alike
        step, ends = 1e-5, []
        for side in (step, -step):
            others = self.numbers.others.copy()
            others[p.index] += side
            ends.append(problem.configuration(replace(self.numbers, others=others), here.x).residual)
        # at the end of what can be built one side is left
        sides = sum(np.isfinite(end) for end in ends)
        a, b = (np.where(np.isfinite(end), end, here.residual) for end in ends)
        return self._by_row((a - b) / (step * np.maximum(sides, 1)))

    def _of_coupling(self, number: int) -> Array:
        """Derivatives ``(n, R N T)`` of all rows by a number of the couplings: the coordinate behind it, or minus one of a constant."""
        here, s, m = self.here, self.problem.system, self.problem.m
        g, own = next((g, own) for g, own in enumerate(coupling_places(m)) if number <= own.stop)
        value: Array | float = -1.0
        if number < own.stop:
            (column,) = s.columns_of([m.couplings[g].freedoms[number - own.start]])
            value = here.x[s.single_rows[column]] * (self.problem.L if s.is_length[column] else 1.0)
            if m.couplings[g].constant is None:
                value = value - s.start_coordinates(m.start)[column]
        row = s.graph.loop_rows + g
        out = np.zeros(here.residual.shape, dtype=here.residual.dtype)
        scale = here.row_scale if isinstance(here, Apart) else here.system.row_scale
        out[row] = value * scale[row] * self.problem.coupling_units[number]
        return out

    def moved(self, side: Index, pair: Index, rates: Array) -> Array:
        """Derivatives ``(R, n, k, T)`` for markers, one on a side of a pair each, of which the numbers grow at ``rates (3, 3, k, B)``."""
        return self._by_row(self.opened(side, pair, self.twists(side, pair, rates)))

    def twists(self, side: Index, pair: Index, rates: Array) -> Array:
        """Twists ``(6, k, R N T)`` of these markers in the global frame."""
        here, s, n = self.here, self.here.system, self.numbers
        vectors = [v[side, :, pair].swapaxes(0, 1) for v in n.vectors]
        eta = marker_twists(vectors, n.norms[:, side, pair], rates)
        eta = np.tile(np.broadcast_to(eta, (*eta.shape[:2], self.T)), self.R * self.N)
        return move_twist(here.poses[:, :, np.where(side == 0, s.a[pair], s.b[pair])], eta)

    def opened(self, side: Index, pair: Index, V: Array) -> Array:
        """How fast ``(n, k, R N T)`` loops open by such twists."""
        here, s = self.here, self.here.system
        out = np.zeros((len(here.residual), len(pair), here.T), dtype=V.dtype)
        C = np.where(side == 0, 1.0, -1.0) * self.problem.loop_signs[:, pair]
        loops = V[:, None] * C[:, :, None]
        loops[3:] += cross(loops[:3], here.middles[:, :, None])
        out[: s.graph.loop_rows] = loops[s.graph.span].swapaxes(0, 1).reshape(s.graph.loop_rows, *V.shape[1:])
        return out
