"""Forces of pairs and couplings from what is kept: of one pair by name and in the user's units, or of all pairs at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate, rotate_back, shift_wrench
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.contact_lines import ContactLines
from mechgraph.closure.driver_path import in_blocks
from mechgraph.closure.indexing import Index
from mechgraph.errors import DeclarationError
from mechgraph.numerics.linear import EVERY, Place
from mechgraph.pairs.pair_type import PairType
from mechgraph.result.kept import BlockMotion, Kept
from mechgraph.result.states import user_wrench
from mechgraph.result.values import Mask
from mechgraph.structure.components import labels_of
from mechgraph.structure.reaction_split import UNIQUE, PairFrames

TOGETHER = 300_000
"""Wrenches that are looked at together where all pairs are."""


def _sizes(states: Array) -> Array:
    """Sizes ``(T,)`` of what is unique of vectors ``(3, T)``: of their part at right angles to all that self-stresses add to them.

    ``states (3, 1 + s, T)`` are the vectors and what the self-stresses have in them. NaN where these take every direction.
    """
    vectors, stress = states[:, 0], np.moveaxis(states[:, 1:], -1, 0)
    if not stress.shape[-1]:
        return np.asarray(np.linalg.norm(vectors, axis=0))
    ways, sizes, _ = np.linalg.svd(stress, full_matrices=False)
    loose = sizes > UNIQUE
    along = np.einsum("tij,it->tj", ways, vectors) * loose
    left = vectors - np.einsum("tij,tj->it", ways, along)
    return np.where(loose.sum(axis=-1) == len(vectors), np.nan, np.linalg.norm(left, axis=0))


def _touched(stress: Array, scale: float = 1.0) -> Mask:
    """Where self-stresses have a part: ``stress (..., s, T)``."""
    return np.asarray(np.sqrt((stress * stress).sum(axis=-2)) > UNIQUE * scale)


class PairForces(Kept):
    """What pairs and couplings transmit; NaN where it is not unique, unless values of least norm were asked for."""

    def _masked(self, values: Array, stress: Array, scale: float = 1.0) -> Array:
        """NaN where a self-stress has a part, unless values of least norm were asked for."""
        return np.where(_touched(stress, scale), np.nan, values) if stress.shape[-2] and not self.least_norm else values

    def reaction(self, pair: int) -> Array:
        """Reaction about the global origin."""
        return self._about_origin(self._force("reactions")[:, pair], self._of("stress")[:, pair])

    def total(self, pair: int) -> Array:
        """Total wrench about the global origin."""
        states = self._transmitted(pair)
        return self._about_origin(states[:, 0], states[:, 1:])

    def _transmitted(self, pair: int) -> Array:
        """What a pair transmits, reaction and efforts, and in every self-stress, ``(6, 1 + s, T)``, internal units."""
        columns = self._columns(pair)
        efforts = self._force("efforts")[columns] - self._through_contacts("multipliers", columns)
        stress = self._of("stress_efforts")[columns] - self._through_contacts("multiplier_stress", columns)
        states = np.concatenate([efforts[:, None], stress], axis=1)
        E = self._evaluated(lambda block: block.here.E[:, columns])
        reactions = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)
        return np.asarray(reactions + np.einsum("cft,fst->cst", E, states))

    def _through_contacts(self, name: str, columns: slice) -> Array:
        """Efforts ``(f, ..., T)`` of multipliers that act where gears touch each other, not through the pairs of these freedoms."""
        touching = [g for g, c in enumerate(self._system.m.couplings) if c.steps]
        coefficients = self._system.coupling_matrix[touching, columns, 0]
        return np.asarray(np.einsum("gf,g...->f...", coefficients, self._of(name)[touching]))

    def on_link(self, pair: int, link: int) -> tuple[Array, Mask, Array]:
        """What a pair transmits to one of its links, in the link's frame about its marker there; what of it is unique; sizes of that."""
        s, states = self._system, self._transmitted(pair)
        sign, side = (1.0, 1) if s.b[pair] == link else (-1.0, 0)
        p = np.asarray(self.whole.pairs[pair].markers[side].point, dtype=float)

        def seen(block: BlockMotion) -> Array:
            par, X = block.here.system.par, block.here.poses[:, :, link]
            R = X[:, :3]
            at = rotate(R, ((p - par.offset[:, link]) / par.L)[:, None]) + X[:, 3]
            wrench = shift_wrench(states[..., block.places], at[:, None])
            return np.concatenate([rotate_back(R, wrench[:3]), rotate_back(R, wrench[3:])])

        found = self._evaluated(seen)
        unit = np.repeat([self._L**2, self._L], 3)[:, None]
        unique = (~_touched(found[:, 1:]) & self._solved).astype(float)
        known = found[:, :1] if self.least_norm else found
        sizes = np.stack([self._L**2 * _sizes(known[:3]), self._L * _sizes(known[3:])])
        wrench = self._out(self._masked(sign * unit * found[:, 0], found[:, 1:]))
        return wrench, self._out(unique).astype(bool), self._out(sizes)

    def _about_origin(self, value: Array, stress: Array) -> Array:
        """Wrench ``(6, T)`` in the user's units about the global origin, NaN where ``stress (6, s, T)`` has a part."""
        wrench = user_wrench(self._system.par, value)
        if stress.shape[1]:
            far = self._system.par.origin / self._L
            shifted = np.concatenate([stress[:3] + cross(far[:, None, None], stress[3:]), stress[3:]])
            wrench = self._masked(wrench, shifted, 1.0 + float(np.linalg.norm(far)))
        return self._out(wrench)

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B."""
        reactions, point = self._force("reactions")[:, pair], self._of("points")[:, pair]
        stress = shift_wrench(self._of("stress")[:, pair], point[:, None])
        scale = np.repeat([self._L**2, self._L], 3)[:, None]
        return self._out(self._masked(scale * shift_wrench(reactions, point), stress))

    def magnitude(self, pair: int) -> Array:
        """Size of what is unique of the force of the reaction."""
        states = np.concatenate([self._force("reactions")[3:, pair][:, None], self._of("stress")[3:, pair]], axis=1)
        return self._out(self._L * _sizes(states[:, :1] if self.least_norm else states)[None])[..., 0]

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name."""
        row, values, stress = self._components(pair)
        masked = self._masked(values, stress)
        return {name: self._out(part) for name, part in zip(row.component_names, masked, strict=True)}

    def directions(self, pair: int) -> Array:
        """Forces of the unit components."""
        number, i = self._system.place_of(pair)
        return self._out(self._evaluated(lambda block: block.here.W[number][3:, :, i]))

    def unique(self, pair: int) -> dict[str, Array]:
        """Which reaction components and efforts are unique, also where values of least norm stand for them."""
        columns = self._columns(pair)
        driven = np.flatnonzero(self._driven(columns))
        loose = _touched(np.concatenate([self._components(pair)[2], self._stress_of_drives(columns)[driven]]))
        labels = labels_of(self.whole.pairs[pair], driven)
        return {name: self._out(~part) for (_, name), part in zip(labels, loose, strict=True)}

    def _components(self, pair: int) -> tuple[PairType, Array, Array]:
        """The type of a pair, its components ``(6 - f, T)`` in the user's units and what self-stresses have in them ``(6 - f, s, T)``."""
        self._force("reactions")
        number, i = self._system.place_of(pair)
        row = self._system.groups[number].row
        states = np.concatenate([self._of("reactions")[:, pair][:, None], self._of("stress")[:, pair]], axis=1)

        def components(block: BlockMotion) -> Array:
            return PairFrames(block.here).components_of(number, i, states[..., block.places])

        found = self._evaluated(components)
        couples = [c.is_couple for c in row.reactions or ()] or [False] * (6 - row.f)
        unit = np.where(couples, self._L**2, self._L)[:, None]
        return row, unit * found[:, 0], found[:, 1:]

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """What the drive supplies, and what loads do in the freedoms."""
        columns = self._columns(pair)
        own, given = self._efforts(columns)
        return self._out(self._masked(own, self._stress_of_drives(columns))), self._out(given)

    def _efforts(self, columns: slice, places: Place = EVERY) -> tuple[Array, Array]:
        """What drives supply in freedoms and what loads do there, ``(f, n)`` each, in the user's units."""
        total, given, coupled = (self._force(name)[columns, places] for name in ("efforts", "given", "coupled"))
        own = np.where(self._driven(columns), total - given - coupled, np.where(np.isnan(given), np.nan, 0.0))
        unit = np.where(self._system.is_length[columns], self._L, self._L**2)[:, None]
        return unit * own, unit * given

    def _driven(self, columns: slice) -> Mask:
        places = np.arange(*columns.indices(self._system.n_freedoms))
        return np.asarray((places[:, None] == self.driven).any(axis=1)[:, None])

    def _stress_of_drives(self, columns: slice, places: Place = EVERY) -> Array:
        """What self-stresses have in the efforts of drives, ``(f, s, n)``."""
        stress = self._of("stress_efforts")[columns][..., places] - self._of("coupled_stress")[columns][..., places]
        return np.where(self._driven(columns)[:, None], stress, 0.0)

    # --- all pairs at once -----------------------------------------------------------------------------------------------

    def blocks(self) -> Iterator[Index]:
        """The solved places in parts of so few that values of all pairs there are no burden."""
        solved = np.flatnonzero(self._solved)
        size = max(1, TOGETHER // (len(self.whole.pairs) * (1 + self._of("stress").shape[2])))
        return (solved[i : i + size] for i in range(0, len(solved), size))

    def reactions_at(self, places: Index) -> tuple[Array, Mask]:
        """Reactions of all pairs about the origins of markers B ``(6, P, n)``, of least norm, and which numbers are not unique."""
        points = self._of("points")[:, :, places]
        scale = np.repeat([self._L**2, self._L], 3)[:, None, None]
        loose = _touched(shift_wrench(self._of("stress")[..., places], points[:, :, None]))
        return scale * shift_wrench(self._force("reactions")[..., places], points), loose

    def components_at(self, places: Index) -> tuple[Array, Mask]:
        """Components of all pairs ``(6, P, n)`` by the pair table, 0 beyond those of a pair, and which are not unique."""
        reactions, stress = self._force("reactions")[:, :, None, places], self._of("stress")[..., places]
        states = np.concatenate([reactions, stress], axis=2)
        s, found = self._system, np.zeros((6, *states.shape[1:]))
        here = Configuration(self._system_at(places), self._of("x")[:, places])
        for group, part in zip(s.groups, PairFrames(here).components(states), strict=True):
            couples = [c.is_couple for c in group.row.reactions or ()] or [False] * len(part)
            unit = np.where(couples, self._L**2, self._L).reshape(-1, 1, 1, 1)
            part[:, :, :1] *= unit
            found[: len(part), group.pairs] = part
        return found[:, :, 0], _touched(found[:, :, 1:])

    def efforts_at(self, places: Index) -> tuple[Array, Array, Mask]:
        """Own and applied efforts in all freedoms ``(F, n)``, and which of the former are not unique."""
        every = slice(None)
        own, given = self._efforts(every, places)
        return own, given, _touched(self._stress_of_drives(every, places))

    def multiplier(self, coupling: int) -> Array:
        """The multiplier of a coupling in the user's units: the effort ``c_i m`` in freedom i."""
        return self._out(self._masked(self._multiplier(coupling), self._of("multiplier_stress")[coupling]))

    def multipliers(self) -> tuple[Array, Mask]:
        """The multipliers of all couplings ``(n, T)``, of least norm where redundant, and where they are not unique."""
        found = [self._multiplier(k) for k in range(len(self.mechanism.couplings))]
        loose = _touched(self._of("multiplier_stress"))[: len(found)]
        return np.array(found).reshape(len(found), self._count), loose

    def _multiplier(self, coupling: int) -> Array:
        row, blocks = 6 * self._system.graph.n_loops + coupling, in_blocks(np.arange(self._count))
        scales = [np.broadcast_to(self._system_at(block).row_scale[row], len(block)) for block in blocks]
        return np.asarray(self._L**2 * np.concatenate(scales) * self._force("multipliers")[coupling])

    def contact(self, coupling: int) -> tuple[Array, Array]:
        """Force of gears on the second one, and the point where it acts."""
        c = self._system.m.couplings[coupling]
        if not c.steps:
            what = "acts in its freedoms, not along a line; SpurGears and its like have a force and a point"
            raise DeclarationError(f"coupling {c.name!r}", [what])
        m, stress = self._force("multipliers"), self._of("multiplier_stress")[coupling]

        def of(block: BlockMotion) -> Array:
            lines, here = ContactLines(block.here), m[:, block.places]
            which = [g for g, _ in lines.contacts].index(coupling)
            flank = (here[coupling] < 0.0).astype(np.intp)
            points = lines.wrenches[which][1][:, flank, np.arange(len(block.places))]
            return np.concatenate([lines.on_gear(here, here)[which][3:], points])

        values, par = self._evaluated(of), self._system.par
        force = self._masked(par.L * values[:3], np.broadcast_to(stress, (3, *stress.shape)))
        return self._out(force), self._out(par.L * values[3:] + par.origin.reshape(3, 1))
