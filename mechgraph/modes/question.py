"""What is asked: a mechanism, the freedoms, points or links that are given, and the class in which its assemblies are looked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.closure.assembly import CLOSED, close_all, closed_start, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.indexing import Index, System
from mechgraph.determinacy.mobility import free_motion
from mechgraph.determinacy.report import dead_point_error, undriven_error
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.family import NO_NUMBERS, SPAN, Array, Family, at_rest
from mechgraph.modes.form import Form, Rod, Whole, WithoutRods, rods_of
from mechgraph.numerics.linear import rank_of, singular_values

OFF_DEAD_POINT = 0.3
"""Motion (radians, or lengths over L) of what moves most from a singular start to where the class is read."""


class Question:
    """Values given at one position or at several, and a closed position of the mechanism, beside the start where that is singular.

    ``m`` is the mechanism with free pairs for points and links that are given (see ``closure.prescription``), ``drive (d, n)`` are the
    values in internal units; ``batch`` is ``()`` or ``(n,)``; ``declared`` is the closed position next to the start, singular or not.

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError, DeadPointError
    """

    start: Configuration

    def __init__(self, m: Mechanism, values: Mapping[str, Any] | None) -> None:
        given = DriverMotion(m, values, asked="assemblies of")
        if len(given.batch) > 1:
            raise DeclarationError(
                f"assemblies of {m.name!r}",
                [f"values of shape {given.batch}: expected single values or a list of them"],
            )
        self.asked, self.m, self.batch, self.names = m, given.m, given.batch, given.names
        self.start = closed_start(self.m)
        if given.free:
            self.m = given.whole(self.start)
            self.start = closed_start(self.m)
        self.system = self.start.system
        self.columns, _ = named_columns(self.m, self.system, dict.fromkeys(self.names, 0.0))
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self.values = given.values("position", self.batch)
        self.drive = self.values / self.unit[:, None]
        self.declared = self.start
        self._read()
        if self._loose or self.freedoms.passive:
            self._leave()

    def _read(self) -> None:
        """What can move at the start, and the class there."""
        self.x = self.start.x[:, 0]
        self.freedoms = free_motion(self.system, self.x, self.columns)
        idle = np.stack([*(p.rates for p in self.freedoms.passive), np.zeros(self.system.n_freedoms)], axis=1)[:, :-1]
        held = self._held(idle)
        self.rods = [] if self.m.couplings else rods_of(self.system, np.concatenate([self.columns, held]))
        links = np.array([link for rod in self.rods for link in rod.links], dtype=np.intp)
        self.family = Family(self.start, self.columns, idle, held, links)

    def _held(self, idle: Array) -> Index:
        """Freedoms that may rest, as one of the passive motions ``idle (F, p)`` goes on for ever with them, evenly in all freedoms.

        Other members of the class need not have such a motion; that of a rod between balls they all have.
        """
        s, out = self.system, []
        for k in np.flatnonzero((s.single_rows >= 0) & (np.abs(idle) > SPAN).any(axis=1)).tolist():
            part = idle[k] @ idle[k]
            if (
                part > SPAN**2
                and Configuration(s, s.advance(self.start.x, idle @ idle[[k]].T / part)).closure[0] < CLOSED
            ):
                out.append(k)
                idle = at_rest(idle, np.array([k]))
        return np.array(out, dtype=np.intp)

    @cached_property
    def form(self) -> Form:
        """The equations in which assemblies are looked for: without couplings and rods, where these can be left out."""
        family, drive, rods = self._uncoupled()
        if rods:
            found = WithoutRods(family, drive, rods, rods)
            if found.family.fault:
                found = WithoutRods(family, drive, rods, found.needed)
            if not found.family.fault:
                return found
        return Whole(family, drive)

    def _uncoupled(self) -> tuple[Family, Array, list[Rod]]:
        """The class, what is given, and rods; without couplings, where these say as much of freedoms as there are that are not given.

        With ``G_d`` and ``G`` the coefficients of what is given and of the others, ``q = q_0 - G^-1 G_d (d - d_0)``.
        """
        if not self.m.couplings:
            return self.family, self.drive, self.rods
        s, terms = self.system, self.system.coupling_matrix[:, :, 0]
        others = np.setdiff1d(s.coupled_freedoms, self.columns)
        if rank_of(singular_values(terms[:, others])) < max(len(terms), len(others)):
            return self.family, self.drive, []
        begin = self.start.x[:, :1]
        turned = np.linalg.solve(
            terms[:, others], terms[:, self.columns] @ (self.drive - begin[s.single_rows[self.columns]])
        )
        columns = np.concatenate([self.columns, others])
        bare = System(self.m.replace(couplings=[]), None, s.par)
        idle, held = self.family.idle, self.family.held
        rods = rods_of(bare, np.concatenate([columns, held]))
        links = np.array([link for rod in rods for link in rod.links], dtype=np.intp)
        family = Family(Configuration(bare, begin), columns, idle, np.setdiff1d(held, others), links)
        return family, np.concatenate([self.drive, begin[s.single_rows[others]] - turned]), rods

    @property
    def _loose(self) -> bool:
        """Whether what is given leaves motions free at the start."""
        return bool(self.freedoms.undriven) and (self.family.unknowns > self.family.rank or bool(self.family.fault))

    def _leave(self) -> None:
        """Read the class beside the start, where motions are left free, or are passive, at the start alone."""
        loose, passive = self._loose, len(self.freedoms.passive)
        for moved in self._beside():
            self.start = moved
            self._read()
            if not self._loose and (loose or len(self.freedoms.passive) < passive):
                return
        self.start = self.declared
        self._read()
        if loose:
            self._refuse()

    def _beside(self) -> Iterator[Configuration]:
        """Closed positions a little away from the start either way: drivers moved, those too that stand still there, or free to move."""
        x0, motions, still = self.start.x, self.freedoms.null, self.columns[self.freedoms.still(self.columns)]
        rates = motions @ np.random.default_rng(0).normal(size=motions.shape[1])
        rates *= OFF_DEAD_POINT / max(float(np.abs(rates).max(initial=0.0)), SPAN)
        for held in (self.columns, NO_NUMBERS):
            for sign in (1.0, -1.0):
                dq = sign * rates[:, None]
                dq[still] = sign * OFF_DEAD_POINT * bool(held.size)
                x, error = close_all(self.system, self.system.advance(x0, dq), held)
                if error[0] < CLOSED:
                    yield Configuration(self.system, x)

    def _refuse(self) -> None:
        """What is given leaves motions free where the mechanism is declared, and beside it."""
        names = [name for name, rests in zip(self.names, self.freedoms.still(self.columns), strict=True) if rests]
        if names and len(self.names) <= self.freedoms.mobility:
            raise dead_point_error(self.m, names, {name: self.m.start.get(name, 0.0) for name in names}, None)
        raise undriven_error(self.m, self.freedoms.undriven)

    def coordinates(self, x: Array) -> Array:
        """User coordinates ``(M, F)`` of real states ``(nx, M)``: whole rounds nearest to the start, given ones exactly as given."""
        s = self.system
        start = s.start_coordinates(self.m.start)
        q = np.stack([s.coordinates_of(x[:, [i]], start)[:, 0] for i in range(x.shape[1])] or [np.zeros(0)])
        q = q.reshape(x.shape[1], s.n_freedoms)
        period = self.periods.copy()
        period[self.columns] = np.inf
        back = np.isfinite(period)
        q[:, back] -= period[back] * np.round((q - start)[:, back] / period[back])
        return q

    @property
    def periods(self) -> Array:
        """By how much single freedoms grow until all is as it was, user units; infinite where they go on or are coupled, and for balls."""
        s, alone = self.system, self.system.single_rows >= 0
        alone[s.coupled_freedoms] = False
        return np.where(alone, s.in_user_units(self.family.periods), np.inf)

    def complex_coordinates(self, x: Array) -> Array:
        """User coordinates ``(n, F)`` of complex states ``(nx, n)``."""
        s = self.system
        q = s.difference(x, s.state_of(np.zeros((s.n_freedoms, 1))))
        q[s.is_length] *= s.par.L
        return q.T
