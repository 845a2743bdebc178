"""Values over the positions of a solution: where it is, what drivers supply, what every pair transmits and how it moves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document.tree import plain
from mechgraph.model.pair import Pair
from mechgraph.result.numbers import SHOWN_AS_ZERO
from mechgraph.result.places import driver_value
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import with_unit
from mechgraph.show.page.forces import components_of, wrench_of
from mechgraph.show.page.packing import packed
from mechgraph.show.scene import Scene
from mechgraph.units import unit_of

FORCE, MOMENT, LENGTH, TIME = (1, 1, -2), (2, 1, -2), (1, 0, 0), (0, 0, 1)

Data = dict[str, Any]


class Cycle:
    """A solution at the positions of its scene."""

    def __init__(self, s: Solution, scene: Scene) -> None:
        self.s, self.scene = s, scene
        self.m = s.mechanism
        self.drivers = {name: self.of_freedom(name, "position") for name in s.prescribed}
        forces = [self.at(s[p.name].force) for p in self.m.pairs] if s.has_forces else []
        moments = [self.at(s[p.name].moment) for p in self.m.pairs] if s.has_forces else []
        most = [
            max((float(np.nanmax(np.abs(v), initial=0.0)) for v in rows), default=0.0) for rows in (forces, moments)
        ]
        self.noise = SHOWN_AS_ZERO * max(most[0], most[1] / scene.size)

    def at(self, values: Any) -> Array:
        """Values at the positions of the scene, the batch flat."""
        array = np.asarray(values, dtype=float)
        return np.asarray(array.reshape(-1, *array.shape[len(self.s.batch) :])[self.scene.positions])

    def of_freedom(self, name: str, what: str) -> Array:
        """A quantity of one freedom, ``(T,)``."""
        k, j = self.s.whole.freedom(name)
        return self.at(getattr(self.s[self.s.whole.pairs[k].name], what)[..., j])

    def unique(self, pair: Pair) -> dict[str, bool]:
        """Which components of a reaction are unique at every position, also where those of least norm stand for them; and efforts."""
        return {name: bool(np.all(self.at(found))) for name, found in self.s[pair.name].unique.items()}

    def unit(self, dimension: tuple[int, int, int]) -> str:
        """A unit, as declared."""
        return unit_of(self.m.units, dimension)

    def data(self) -> Data:
        """All of it for the page."""
        label, x = self.abscissa()
        with_forces = self.s.has_forces
        return {
            "label": label, "x": packed(x), "places": self.places(),
            "efforts": list(self.efforts()) if with_forces else [],
            "forces": [self.arrows(i, p) for i, p in enumerate(self.m.pairs)] if with_forces else [],
            "pairs": [[*(self.reaction(p) if with_forces else ()), *self.positions(p)] for p in self.m.pairs],
        }  # fmt: skip

    @property
    def returns(self) -> bool:
        """Whether the last position is followed by the first: a driver that turns all the way round."""
        if len(self.drivers) != 1:
            return False
        ((name, values),) = self.drivers.items()
        steps = np.abs(np.diff(values))
        return bool(self.s.whole.turns(name) and len(values) > 8 and np.ptp(values) + 2 * steps.max() > 2 * np.pi)

    def abscissa(self) -> tuple[str, Array]:
        """What the curves are drawn over: the driver, where it is one that goes one way; else time; else numbers of positions."""
        if len(self.drivers) == 1:
            ((name, values),) = self.drivers.items()
            turns = self.s.whole.turns(name)
            steps = np.sign(values[-1] - values[0]) * np.diff(values)
            if (steps > 0).all():
                unit = "deg" if turns else self.unit(LENGTH)
                return with_unit(plain(name), unit), np.rad2deg(values) if turns else values
        if self.s.t is not None:
            return with_unit("time", self.unit(TIME)), self.at(np.broadcast_to(self.s.t, self.s.batch))
        return "number of the position", self.scene.positions.astype(float)

    def places(self) -> list[str]:
        """Every position in words."""
        if self.drivers:
            rows = zip(*self.drivers.values(), strict=True)
            return [
                ", ".join(driver_value(self.s.whole, n, v) for n, v in zip(self.drivers, row, strict=True))
                for row in rows
            ]
        if self.s.t is not None:
            return [
                f"t = {value:.5g} {self.unit(TIME)}".rstrip()
                for value in self.at(np.broadcast_to(self.s.t, self.s.batch))
            ]
        return [f"position {i}" for i in self.scene.positions]

    def efforts(self) -> Iterable[Data]:
        """What drivers supply, couples and forces apart; what springs, dampers and given efforts do in the freedoms."""
        given = {n: self.of_freedom(n, "applied_effort") for n in self.m.freedom_names()}
        acting = {n: v for n, v in given.items() if np.abs(np.nan_to_num(v)).max(initial=0.0) > 0}
        supplied = {n: self.of_freedom(n, "effort") for n in self.s.actuated}
        for title, rows in (("Effort of the driver" if len(supplied) == 1 else "Efforts of the drivers", supplied),
                            ("Applied efforts (springs, dampers, given efforts)", acting)):  # fmt: skip
            for couple, dimension in ((True, MOMENT), (False, FORCE)):
                mine = {n: v for n, v in rows.items() if self._is_couple(n) is couple}
                if mine:
                    yield self.chart(title, dimension, mine, {n: self._effort_is_unique(n) for n in mine})

    def _effort_is_unique(self, freedom: str) -> bool:
        k, j = self.s.whole.freedom(freedom)
        pair = self.s.whole.pairs[k]
        found = self.unique(pair)
        return found.get(f"effort {pair.type.freedoms[j].name}", found.get("effort", True))

    def _is_couple(self, freedom: str) -> bool:
        k, j = self.s.whole.freedom(freedom)
        return self.s.whole.pairs[k].type.efforts[j].is_couple

    def chart(
        self, title: str, dimension: tuple[int, int, int], rows: Mapping[str, Array], unique: Mapping[str, bool]
    ) -> Data:
        """Curves of one unit; what is not known at some position is named, not drawn."""
        floor = self.noise * (1.0 if dimension == FORCE else self.scene.size)
        series = [
            {
                "name": plain(name),
                "values": packed(np.where(np.abs(v) <= floor, 0.0, v)),
                "known": "unique" if unique.get(name, True) else "least norm",
            }
            for name, v in rows.items()
            if not np.isnan(v).any()
        ]
        lost = [plain(name) for name, v in rows.items() if np.isnan(v).any()]
        return {"title": title, "unit": self.unit(dimension), "series": series, "open": lost}

    def reaction(self, pair: Pair) -> Iterable[Data]:
        """Components of a reaction in the pair's own frames, forces and moments apart, with the size of each where all of it is known."""
        unique = self.unique(pair)
        found = {name: self.at(v) for name, v in self.s[pair.name].components.items()}
        own = components_of(pair)
        for couple, dimension, size, what in ((False, FORCE, "force", "F"), (True, MOMENT, "moment", "M")):
            rows = {n: v for n, v in found.items() if (n in own and own[n].is_couple) is couple}
            whole = np.linalg.norm(self.at(getattr(self.s[pair.name], size)), axis=-1)
            if not np.isnan(whole).any() and (rows or whole.max(initial=0.0) > self.noise * self.scene.size):
                rows = {f"|{what}|": whole, **rows}
            if rows:
                sure = {**unique, f"|{what}|": all(ok for n, ok in unique.items() if n in rows)}
                yield self.chart(
                    f"Reaction {size}{'' if not couple else ' about the point on link b'}", dimension, rows, sure
                )

    def positions(self, pair: Pair) -> Iterable[Data]:
        """Coordinates of a pair, turns in degrees."""
        q = self.at(self.s[pair.name].position)
        for turning in (True, False):
            rows = {
                name: v
                for name, f, v in zip(pair.freedom_names, pair.type.freedoms, q.T, strict=True)
                if f.turns is turning
            }
            if not rows:
                continue
            shown = {n: np.rad2deg(v) if turning else v for n, v in rows.items()}
            clean = {
                n: np.where(np.abs(v) < 1e-9 * (180 if turning else self.scene.size), 0.0, v) for n, v in shown.items()
            }
            made = self.chart("Coordinates", LENGTH, clean, {})
            yield {**made, "unit": "deg" if turning else self.unit(LENGTH)}

    def arrows(self, i: int, pair: Pair) -> Data:
        """Force and moment on link b at its marker: of what has a value; ``open`` names what is not unique."""
        own, unique, frames = components_of(pair), self.unique(pair), self.scene.frames
        found = {name: self.at(v) for name, v in self.s[pair.name].components.items()}
        lost = [plain(n) for n, v in found.items() if np.isnan(v).any() or not unique.get(n, True)]
        if own:
            parts = {own[n]: np.where(np.isnan(v), 0.0, v) for n, v in found.items()}
            force, moment = wrench_of(pair, frames, parts)
        else:
            force, moment = (np.nan_to_num(self.at(v)) for v in (self.s[pair.name].force, self.s[pair.name].moment))
        floor = self.noise * np.array([1.0, self.scene.size])
        force, moment = (
            np.where(np.linalg.norm(v, axis=1)[:, None] <= f, 0.0, v)
            for v, f in zip((force, moment), floor, strict=True)
        )
        at = frames[f"pair:{pair.name}@{pair.type.f}"][:, :, 3]
        return {"pair": i, "at": packed(at), "force": packed(force), "moment": packed(moment), "open": lost}
