"""What a page shows of mechanisms that do the same: those of a synthesis, each a figure of its own that may be played."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from mechgraph.document import plain
from mechgraph.errors import DeclarationError, MechgraphError, MechgraphWarning, counted
from mechgraph.kinetostatics import kinematics
from mechgraph.maths.se3 import Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.values import driver_value
from mechgraph.show.page.content import MOST_ITEMS, Data, Figure
from mechgraph.show.scene import scene_at
from mechgraph.show.shapes import Shape
from mechgraph.show.stage import DrawnPart, DrawnPlace
from mechgraph.synthesis.answers import Syntheses

SAMPLES = 73
"""Driver values at which a mechanism is shown beside those of the rows."""


def answers_data(found: Syntheses) -> Data:
    """Figures and motions of the first of many answers.

    Raises
    ------
    DeclarationError
        where there are none.
    """
    if not len(found):
        raise DeclarationError("page of syntheses", ["there is no mechanism to show"])
    shown = [_ShownAnswer(found, k) for k in range(min(len(found), MOST_ITEMS))]
    rest = f"Of {counted(len(found), 'mechanism')} the first {len(shown)} are shown." if len(found) > len(shown) else ""
    return {
        "figures": [one.figure.data(dict(_facts(one.m))) for one in shown],
        "items": [one.item() for one in shown],
        "cycle": None,
        "note": rest,
    }


class _ShownAnswer:
    """The mechanism of one answer, where it begins and as it moves: led by its driver, or else at the rows alone.

    ``words`` say where it stands, ``rows`` are the numbers of those that were asked.
    """

    def __init__(self, found: Syntheses, k: int) -> None:
        self.found, self.k, self.m, self.fit = found, k, found[k], found.fitness[k]
        q = found.coordinates[k]
        n = int(np.isfinite(q).any(axis=1).sum())
        self.q, self.X = q[:n, : len(self.m.freedom_names())], found.poses[k][:n, : len(self.m.links)]
        led = self._led()
        self.led = led is not None
        self.words, self.rows, place = led or self._at_rows()
        self.scene = scene_at(self.m, place, np.arange(len(self.words)))
        self.figure = Figure(self.scene, {name: X[self.rows[:1]] for name, X in self.scene.frames.items()})

    def _led(self) -> tuple[list[str], Index, DrawnPlace] | None:
        """Positions over the driver, those of the rows among them; None where it does not lead from the first one to all others."""
        if self.found.driver is None:
            return None
        driver = self.m.full_name(self.found.driver)
        at = self.q[:, self.m.freedom_names().index(driver)]
        ends = at.min(), at.max()
        if self.fit.full_turn:
            at = at[0] + np.mod(at - at[0], 2 * np.pi)
            ends = at[0], at[0] + 2 * np.pi
        values = np.unique(np.concatenate([at, np.linspace(*ends, SAMPLES)]))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MechgraphWarning)
                s = kinematics(self.m.replace(drives=[driver]), {driver: values}, on_reach="flag")
        except MechgraphError:
            return None
        names = self.m.link_names()
        X, row = np.stack([s.link(name).pose for name in names], axis=1), np.searchsorted(values, at)
        # a place may be off by as much, of the size of a picture, that it is not seen
        if not np.abs(X[row] - self.X).max() < 1e-6 * max(1.0, np.abs(self.X).max()):
            return None
        good = np.flatnonzero(np.asarray(s.status) == "ok")
        rows, words = np.searchsorted(good, row), [driver_value(self.m, driver, float(v)) for v in values[good]]
        for i, place in enumerate(rows.tolist()):
            words[place] += f", position {i}"
        poses = {name: X[good, i] for i, name in enumerate(names)}
        return words, rows, DrawnPlace(poses, {p.name: s[p.name].position[good].T for p in self.m.pairs})

    def _at_rows(self) -> tuple[list[str], Index, DrawnPlace]:
        """The rows alone, each for a while."""
        steps, names = 8, self.m.freedom_names()
        which = np.repeat(np.arange(len(self.q)), steps)
        q = {p.name: self.q[which][:, [names.index(name) for name in p.freedom_names]].T for p in self.m.pairs}
        poses = {name: self.X[which, i] for i, name in enumerate(self.m.link_names())}
        return [f"position {i}" for i in which], steps * np.arange(len(self.q)), DrawnPlace(poses, q)

    def item(self) -> Data:
        """What is chosen by a button: how the mechanism moves, and where it was asked to come."""
        names = zip(self.found.unknown, self.found.values[self.k], strict=True)
        text = ", ".join(f"{name} = {value:.5g}" for name, value in names if np.isfinite(value))
        alone = "" if self.led else ". No driver leads it through the positions: they are shown one by one"
        motion = self.figure.motion(self.scene.frames, "cycle" if self.led and self.fit.full_turn else "swing")
        return {
            "group": "Mechanisms", "title": plain(f"{self.k}: {self.fit.words}"), "text": plain(f"{text}{alone}."), "figure": self.k,
            "motion": motion | {"places": [plain(word) for word in self.words]}, "arrows": [], "marked": [], "axes": [],
            "pieces": [self.figure.piece(part) for part in self._paths()], "after": None,
        }  # fmt: skip

    def _paths(self) -> Iterator[DrawnPart]:
        """Of every named point on a moving link its places at the rows, and its path."""
        frame = f"link:{self.m.frame}"
        for link in (link for link in self.m.links if link.name != self.m.frame):
            X = self.scene.frames[f"link:{link.name}"]
            for name, at in link.points.items():
                places = X[:, :, :3] @ np.asarray(at) + X[:, :, 3]
                lines = tuple((i, i + 1) for i in range(len(places) - 1)) if self.led else ()
                yield DrawnPart("axis", name, link.name, frame, Shape(places, (), lines))
                for i in self.rows:
                    yield DrawnPart("point", name, link.name, frame, Shape(places[[i]]))


def _facts(m: Mechanism) -> Iterator[tuple[str, list[list[str]]]]:
    """Of every pair what it is and where it stands."""
    n = 2 if m.planar else 3
    for pair in m.pairs:
        rows = [["type", f"{pair.type.symbol}, {pair.type.name}"], ["joins", f"{pair.a} and {pair.b}"]]
        sides = (
            (("", pair.markers[0]),)
            if pair.on_a is None
            else zip((f" on {pair.a}", f" on {pair.b}"), pair.markers, strict=True)
        )
        for where, marker in sides:
            rows.append([f"point{where}", _numbers(np.asarray(marker.point)[:n])])
            if n == 3 or not pair.type.freedoms[0].turns:
                rows.append([f"axis{where}", _numbers(np.asarray(marker.axis)[:n])])
        yield pair.name, [[plain(a), plain(b)] for a, b in rows]


def _numbers(values: Any) -> str:
    return ", ".join(f"{v:.6g}" for v in values)
