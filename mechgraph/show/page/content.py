"""What the view shows: the mechanism, its cycle, every freedom, every self-stress, every advice before and after."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mechgraph.document.tree import plain
from mechgraph.model.mechanism import Mechanism
from mechgraph.report.findings import component_words
from mechgraph.report.report import DeterminacyReport, check
from mechgraph.result.numbers import with_unit
from mechgraph.result.solution import Solution
from mechgraph.show.page.changes import compared, stress_arrows
from mechgraph.show.page.cycle import Cycle
from mechgraph.show.page.figures import Figure
from mechgraph.show.page.motions import wiggles
from mechgraph.show.page.packing import rounded
from mechgraph.show.scene import place_of_states, scene, scene_at
from mechgraph.show.shapes import Shape, frame_along
from mechgraph.show.stage import Part
from mechgraph.structure.self_stress import SelfStress

MOST_LINKS = 250
"""Links up to which a mechanism is drawn in space."""
MOST_ITEMS, LEAST_ITEMS = 24, 4
"""Freedoms, self-stresses and advice, each, that are shown of a small mechanism, and of any."""
DRAWN = 1000
"""Links that are drawn in all of these together, about."""
LONGEST_TITLE = 48
"""Letters of a self-stress by which it is chosen; all of it stands below the picture."""
MOST_POSITIONS = 1500
"""Positions of a cycle that are shown; of more, so many evenly spread."""

ARROWS = (
    "Arrows: force (one head) and moment (two heads) that the first link of a pair exerts on the second; striped where part of the "
    "reaction is not unique and left out. A hatched name: not all of the reaction of that pair is unique"
)

Data = dict[str, Any]


def view_data(report: DeterminacyReport, s: Solution | None) -> Data | None:
    """What the view is made of; None where there is nothing that can be drawn in space."""
    if report.geometry is None or len(report.mechanism.links) > MOST_LINKS:
        return None
    return _View(report, s).data()


class _View:
    def __init__(self, report: DeterminacyReport, s: Solution | None) -> None:
        self.report, self.m = report, report.mechanism
        self.solved = s is not None and bool((np.asarray(s.status) == "ok").any())
        self.s = s if self.solved else None
        self.notes: list[str] = []
        g = report.geometry
        assert g is not None
        self.g = g
        self.start = scene_at(self.m, place_of_states(g.system, g.x[:, None]), np.zeros(1, dtype=np.intp))
        self.scene = scene(self._thinned()) if self.s is not None else self.start
        self.figure = Figure(self.scene, self.start.frames)
        self.figures = [self.figure.data(self._rows())]

    def _thinned(self) -> Solution:
        """The solution, or as many of its positions as are shown."""
        assert self.s is not None
        count = int(np.asarray(self.s.status).size)
        step = -(-count // MOST_POSITIONS)
        if step > 1:
            self.notes.append(f"Of {count} positions every {step}th is shown.")
        return self.s.part(slice(0, count, step)) if step > 1 else self.s

    def data(self) -> Data:
        """Figures, items and cycle."""
        items = [
            *self.cycle(),
            *self.limited("freedoms", self.freedoms()),
            *self.limited("self-stresses", self.stresses()),
        ]
        items += self.limited("advice", self.advice())
        cycle = Cycle(self.s_shown, self.scene).data() if self.s is not None else None
        return {"figures": self.figures, "items": items, "cycle": cycle, "note": " ".join(self.notes)}

    @property
    def s_shown(self) -> Solution:
        return self._thinned()

    def limited(self, what: str, items: Iterator[Data]) -> Iterator[Data]:
        """The first of many; how many there are is said."""
        total = {
            "freedoms": self.report.mobility or 0,
            "self-stresses": len(self.report.self_stresses),
            "advice": len(self.report.advice),
        }[what]
        most = max(LEAST_ITEMS, min(MOST_ITEMS, DRAWN // len(self.m.links)))
        for number, item in enumerate(items):
            if number == most:
                self.notes.append(f"Of {total} {what} the first {most} are shown.")
                return
            yield item

    def item(self, group: str, title: str, text: str, **more: Any) -> Data:
        """Something to show."""
        made: Data = {"figure": 0, "motion": None, "arrows": [], "marked": [], "axes": [], "pieces": [], "after": None}
        return {
            "group": group,
            "title": plain(title).replace("->", "→"),
            "text": plain(text).replace("->", "→"),
            **made,
            **more,
        }

    def cycle(self) -> Iterator[Data]:
        """The motion of the solution, or the mechanism as it stands."""
        if self.s is None:
            yield self.item("The mechanism", "as it stands", f"{plain(self.m.name)} where its loops are closed.")
            return
        s = self.s_shown
        kind = "cycle" if Cycle(s, self.scene).returns else "swing"
        count = len(self.scene.positions)
        status = np.asarray(self.s.status).size
        lost = int(np.count_nonzero(np.asarray(self.s.status) != "ok"))
        text = f"{status - lost} of {status} positions" if lost else f"{count} position{'s' * (count != 1)}"
        if s.has_forces:
            text += f". {ARROWS}"
        yield self.item("The motion", "solved motion", f"{text}.", motion=self.figure.motion(self.scene.frames, kind))

    def freedoms(self) -> Iterator[Data]:
        """Every freedom as a wiggle, every passive one spinning."""
        for w in wiggles(self.report):
            moved = scene_at(self.m, place_of_states(self.g.system, w.x), np.arange(w.x.shape[1]))
            axes = [] if w.axis is None else [rounded(np.concatenate(w.axis))]
            flags = [self.flag(name, *w.axis) for name in w.links] if w.axis is not None else []
            motion = self.figure.motion(moved.frames, w.kind)
            yield self.item(w.group, w.title, f"{w.text}.", motion=motion, axes=axes, pieces=flags)

    def flag(self, link: str, point: Any, direction: Any) -> Data:
        """A fin on a link beside an axis: a round rod is not seen to turn."""
        X, size = self.start.frames[f"link:{link}"][0], self.scene.symbol
        out = frame_along(np.asarray(direction))[:, 0]
        corners = self.start.points
        mine = [at[0] for (_, name), at in corners.items() if name == link] or [X[:, 3]]
        foot = np.asarray(point) + np.asarray(direction) * ((np.mean(mine, axis=0) - point) @ np.asarray(direction))
        square = [
            foot + a * np.asarray(direction) + b * out
            for a, b in ((-size, 0), (size, 0), (size, 3 * size), (-size, 3 * size))
        ]
        inside = (np.array(square) - X[:, 3]) @ X[:, :3]
        shape = Shape(inside, ((0, 1, 2, 3),), (), 1)
        return self.figure.piece(Part("link", "", link, f"link:{link}", shape))

    def stresses(self) -> Iterator[Data]:
        """Every self-stress on the mechanism."""
        L = self.g.system.par.L
        for i, stress in enumerate(self.report.self_stresses, 1):
            arrows = stress_arrows(self.m, stress, self.start.frames, L)
            yield self.item("Self-stresses", _title(stress, i), _told(self.m, stress, L), arrows=arrows, marked=[])

    def advice(self) -> Iterator[Data]:
        """Every advice before and after, with what it changes."""
        names = [p.name for p in self.m.pairs]
        for advice in self.report.advice:
            changed = advice.apply()
            after = check(changed)
            if after.geometry is None:
                continue
            stands = scene_at(
                changed, place_of_states(after.geometry.system, after.geometry.x[:, None]), np.zeros(1, dtype=np.intp)
            )
            self.figures.append(Figure(stands, stands.frames).data(_rows_of(changed, after)))
            pairs = [n.rsplit(".", 1)[0] if advice.effect is None else n for n in advice.freedoms]
            marked = [names.index(n) for n in pairs if n in names]
            rows = {
                "figure": len(self.figures) - 1,
                "rows": compared(self.report, after),
                "verdict": plain(after.verdict),
            }
            yield self.item("Advice", advice.brief, self.report.verdict, marked=marked, after=rows)

    def _rows(self) -> dict[str, list[list[str]]]:
        return _rows_of(self.m, self.report)


def _rows_of(m: Mechanism, report: DeterminacyReport) -> dict[str, list[list[str]]]:
    """Facts of every pair: what it is, what it joins, its freedoms, and what of its reaction is unique."""
    out = {}
    for pair in m.pairs:
        rows = [
            ["type", f"{pair.type.symbol}, {pair.type.name}"],
            ["joins", f"{pair.a} (acting) and {pair.b} (acted on)"],
        ]
        rows.append(["freedoms", ", ".join(pair.freedom_names) or "none"])
        unique = report.unique.get(pair.name, {})
        for word, side in (("unique", True), ("not unique", False)):
            some = [name for name, ok in unique.items() if ok is side]
            words = component_words(pair.type, [n for n in some if not n.startswith("effort")])
            efforts = [n for n in some if n.startswith("effort")]
            text = ", ".join(filter(None, [words if len(some) > len(efforts) else "", *efforts]))
            if text:
                rows.append([word, text])
        out[pair.name] = [[plain(a), plain(b)] for a, b in rows]
    return out


def _title(stress: SelfStress, number: int) -> str:
    text = stress.text or "efforts of couplings"
    return f"{number}: {text if len(text) <= LONGEST_TITLE else text[:LONGEST_TITLE].rsplit(' ', 1)[0] + ' ...'}"


def _told(m: Mechanism, stress: SelfStress, L: float) -> str:
    length = with_unit(f"{L:.4g}", m.units.get("length", ""))
    return (
        f"Reactions that balance each other without any load; assembly can lock in any multiple: {stress.text or 'efforts of couplings'}. "
        f"Arrows: on the second link of each pair, the first takes the opposite; moments (two heads) divided by {length}."
    )
