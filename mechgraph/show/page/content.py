"""What a page shows, and how its figures are packed."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from mechgraph.determinacy.facts import Geometry
from mechgraph.determinacy.findings import component_words
from mechgraph.determinacy.report import DeterminacyReport, check
from mechgraph.determinacy.uniqueness import SelfStress
from mechgraph.document import plain
from mechgraph.kinematics.state import CLOSED, close
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs.factors import Component
from mechgraph.quantities import FORCE, LENGTH, MOMENT, TIME, unit_of
from mechgraph.result.solution import Solution
from mechgraph.result.values import SHOWN_AS_ZERO, driver_value, with_unit
from mechgraph.show.canvas import axis_label, colours
from mechgraph.show.scene import DrawnPart, Scene, place_of_states, scene, scene_at
from mechgraph.show.shapes import Shape, frame_along


def packed(values: Any) -> dict[str, Any]:
    """An array as 32-bit numbers, little-endian, in base64; NaN stays NaN."""
    array = np.ascontiguousarray(values, dtype="<f4")
    return {"shape": list(array.shape), "f32": base64.b64encode(array.tobytes()).decode()}


def rounded(values: Array) -> list[float]:
    """A few numbers, to seven digits."""
    return [float(f"{value:.7g}") for value in np.asarray(values, dtype=float).ravel()]


LEFT_OUT = {"reaction"}
"""Parts that the page draws itself, from numbers."""


class Figure:
    """What is drawn of a scene, and where it ``stands``; ``names`` are the frames that are handed over, in order."""

    def __init__(self, scene: Scene, stands: Mapping[str, Array]) -> None:
        self.stands = stands
        self.scene, self.m = scene, scene.mechanism
        self.colours = colours(self.m)
        self.home = {f"pair:{p.name}@0": (p.a, p.markers[0].pose()) for p in self.m.pairs}
        self.home |= {f"pair:{p.name}@{p.type.f}": (p.b, p.markers[1].pose()) for p in self.m.pairs}
        self.parts = [part for part in scene.parts if part.role not in LEFT_OUT]
        used = [self.placed(part.frame)[0] for part in self.parts]
        links = [f"link:{name}" for name in self.m.link_names()]
        self.names = list(dict.fromkeys([*links, *used]))
        self.number = {name: i for i, name in enumerate(self.names)}

    def placed(self, frame: str) -> tuple[str, Array]:
        """The frame that is handed over for a frame, and its pose in that."""
        if frame in self.home:
            link, pose = self.home[frame]
            return f"link:{link}", pose
        return frame, np.eye(3, 4)

    def data(self, rows: Mapping[str, list[list[str]]]) -> dict[str, Any]:
        """The figure where it stands; ``rows`` are facts of the pairs."""
        scene, frames = self.scene, self.stands
        points = np.concatenate([scene.everything, *(moved(part.shape, frames[part.frame][0]) for part in self.parts)])
        points = points[np.isfinite(points).all(axis=1)]
        oblique = (0.6, -1.0, 0.55)  # direction from which a spatial mechanism is seen, in upright axes
        look = scene.normal if scene.normal is not None else scene.upright @ np.array(oblique) / np.linalg.norm(oblique)
        screen = np.stack([np.cross(scene.upright[:, 2], look), scene.upright[:, 2], look])
        screen[0] /= np.linalg.norm(screen[0])
        screen[1] = np.cross(look, screen[0])
        seen = points @ screen.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        # room about what is drawn, for names and arrows, over the half width of a symbol
        return {
            "name": plain(self.m.name),
            "size": float(scene.size),
            "span": rounded(high[:2] - low[:2] + 6.0 * scene.symbol),
            "symbol": float(scene.symbol),
            "center": rounded(screen.T @ (low + high) / 2),
            "up": rounded(scene.upright[:, 2]),
            "look": rounded(look),
            "links": [{"name": plain(name), "colour": self.colours[name]} for name in self.m.link_names()],
            "pairs": [self._pair(pair, rows.get(pair.name, [])) for pair in self.m.pairs],
            "pieces": [self.piece(part) for part in self.parts],
            "labels": [self._label(label) for label in scene.labels],
            "frames": packed(self.of(frames, self.names)[0]),
        }

    def of(self, frames: Mapping[str, Array], names: list[str]) -> Array:
        """Affine maps ``(T, n, 12)`` of some frames, row by row."""
        return np.stack([np.asarray(frames[name]).reshape(-1, 12) for name in names], axis=1)

    def motion(self, frames: Mapping[str, Array], kind: str) -> dict[str, Any]:
        """How the figure moves: the frames that leave the place where it stands, over ``T``."""
        still = 1e-7 * self.scene.size

        def travel(name: str) -> float:
            every = np.concatenate([self.stands[name][:1], frames[name]])
            return float(np.nanmax(np.ptp(every, axis=0), initial=0.0))

        moving = [name for name in self.names if travel(name) > still]
        values = self.of(frames, moving) if moving else np.zeros((len(next(iter(frames.values()))), 0, 12))
        return {"frames": [self.number[name] for name in moving], "values": packed(values), "kind": kind}

    def _pair(self, pair: Pair, rows: list[list[str]]) -> dict[str, Any]:
        return {
            "name": plain(pair.name), "type": pair.type.symbol, "title": plain(pair.type.name), "a": plain(pair.a), "b": plain(pair.b),
            "frame": self.number[f"link:{pair.b}"], "at": rounded(np.asarray(pair.markers[1].point)), "rows": rows,
        }  # fmt: skip

    def piece(self, part: DrawnPart) -> dict[str, Any]:
        """A part in the frame that is handed over."""
        frame, X = self.placed(part.frame)
        shape = part.shape.moved(X[:, :3], X[:, 3])
        names = [p.name for p in self.m.pairs]
        return {
            "frame": self.number[frame], "role": part.role, "colour": self.colours.get(part.link, ""), "dashed": part.dashed,
            "pair": names.index(part.owner) if part.owner in names else -1,
            "scales": [0.0 if np.isinf(end) else float(end) for end in part.scales],
            "vertices": packed(shape.vertices), "triangles": triangles(shape), "lines": segments(shape),
        }  # fmt: skip

    def _label(self, label: Any) -> dict[str, Any]:
        frame, X = self.placed(label.frame)
        names = [p.name for p in self.m.pairs]
        pair = names.index(label.owner) if label.kind == "pair" else -1
        at = X[:, :3] @ label.at + X[:, 3]
        return {
            "text": plain(label.text),
            "kind": label.kind,
            "frame": self.number[frame],
            "pair": pair,
            "at": rounded(at),
        }


def moved(shape: Shape, X: Array) -> Array:
    """Vertices of a shape in a frame ``(3, 4)``."""
    return np.asarray(shape.vertices @ X[:, :3].T + X[:, 3])


def triangles(shape: Shape) -> list[int]:
    """The polygons of a shape, all convex, as triangles."""
    return [int(i) for face in shape.faces for k in range(1, len(face) - 1) for i in (face[0], face[k], face[k + 1])]


def segments(shape: Shape) -> list[int]:
    """Its lines, and the edges of its rims, as segments."""
    rims = [(*face, face[0]) for face in shape.faces[: shape.rims]]
    return [int(i) for line in (*shape.lines, *rims) for k in range(len(line) - 1) for i in line[k : k + 2]]


Data = dict[str, Any]


class ShownCycle:
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
        return np.asarray(
            array.reshape(np.size(self.s.status), *array.shape[len(self.s.batch) :])[self.scene.positions]
        )

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
                return axis_label(plain(name), unit), np.rad2deg(values) if turns else values
        if self.s.t is not None:
            return axis_label("time", self.unit(TIME)), self.at(np.broadcast_to(self.s.t, self.s.batch))
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
                            ("Applied efforts (springs, dampers, friction, given efforts)", acting)):  # fmt: skip
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


def wrench_of(
    pair: Pair, frames: Mapping[str, Array], parts: Mapping[Component, Array], length: float = 1.0
) -> tuple[Array, Array]:
    """Force and moment about marker B ``(T, 3)``, global, of components with values ``(T,)``; moments counted in forces times ``length``.

    Sum of ``v (R_k w_F)`` and of ``v (R_k w_M + (o_k - o_B) x R_k w_F)``, k the frame of the component.
    """
    end = frames[f"pair:{pair.name}@{pair.type.f}"]
    force, moment = np.zeros((2, len(end), 3))
    for part, value in parts.items():
        X = frames[f"pair:{pair.name}@{part.frame}"]
        w = np.array(part.wrench) + pair.pitch_per_radian * np.array(part.per_pitch)
        F, M = X[:, :, :3] @ w[3:], X[:, :, :3] @ w[:3]
        arm = np.zeros(3) if part.at_b else X[:, :, 3] - end[:, :, 3]
        force = force + value[:, None] * F
        moment = moment + value[:, None] * ((length if part.is_couple else 1.0) * M + np.cross(arm, F))
    return force, moment


def components_of(pair: Pair) -> dict[str, Component]:
    """The reaction components of a pair by name; none for a row whose components mix forces and moments."""
    return {c.name: c for c in pair.type.reactions or ()}


def stress_arrows(m: Mechanism, stress: SelfStress, frames: Mapping[str, Array], L: float) -> list[dict[str, Any]]:
    """What link a exerts on link b in a self-stress, at marker B; moments divided by ``L`` so that they compare."""
    out = []
    for i, pair in enumerate(m.pairs):
        parts = _parts(pair, stress)
        if not parts:
            continue
        at_first = {name: X[:1] for name, X in frames.items() if name.startswith(f"pair:{pair.name}@")}
        force, moment = wrench_of(pair, at_first, parts, L)
        at = at_first[f"pair:{pair.name}@{pair.type.f}"][0, :, 3]
        out.append(
            {"pair": i, "at": rounded(at), "force": rounded(force[0]), "moment": rounded(moment[0] / L), "open": False}
        )
    return out


def _parts(pair: Pair, stress: SelfStress) -> dict[Component, Array]:
    """Components and efforts of a pair in a self-stress."""
    own = {f"{pair.name}:{name}": c for name, c in components_of(pair).items()}
    parts = {own[name]: np.array([v]) for name, v in stress.components.items() if name in own}
    single = [name for name in stress.efforts if name == pair.name]
    for freedom, effort in zip(pair.type.freedoms, pair.type.efforts, strict=True):
        for name in (f"{pair.name}.{freedom.name}", *single):
            if name in stress.efforts:
                parts[effort] = np.array([stress.efforts[name]])
    return parts


def compared(before: DeterminacyReport, after: DeterminacyReport) -> list[list[str]]:
    """What an advice changes, as rows: name, before, after."""

    def numbers(r: DeterminacyReport) -> list[tuple[str, str]]:
        return [
            ("mobility", "-" if r.mobility is None else str(r.mobility)),
            ("redundancy", "-" if r.redundancy is None else str(r.redundancy)),
            ("passive freedoms", str(len(r.passive))),
            ("self-stresses with the drivers", str(r.reactions.count) if r.reactions else "-"),
            ("determinate", "yes" if r.determinate else "no"),
        ]

    return [[name, old, new] for (name, old), (_, new) in zip(numbers(before), numbers(after), strict=True)]


MOST_LINKS = 250
"""Links up to which a mechanism is drawn in space."""
MOST_ITEMS, LEAST_ITEMS = 24, 4
"""Freedoms, self-stresses and advice, each, that are shown of a small mechanism, and of any."""
MOST_POSITIONS = 1500
"""Positions of a cycle that are shown; of more, so many evenly spread."""

ARROWS = (
    "Arrows: force (one head) and moment (two heads) that the first link of a pair exerts on the second; striped: partly "
    "indeterminate, that part omitted. A hatched name: not all of the reaction of that pair is unique"
)


def view_data(report: DeterminacyReport, s: Solution | None) -> Data | None:
    """What the view is made of; None where there is nothing that can be drawn in space."""
    if report.geometry is None or len(report.mechanism.links) > MOST_LINKS:
        return None
    return _PageView(report, s).data()


class _PageView:
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
        self.figures = [self.figure.data(_rows_of(self.m, self.report))]

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
        cycle = ShownCycle(self.s_shown, self.scene).data() if self.s is not None else None
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
        # links that are drawn in all of these together, about
        most = max(LEAST_ITEMS, min(MOST_ITEMS, 1000 // len(self.m.links)))
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
        kind = "cycle" if ShownCycle(s, self.scene).returns else "swing"
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
        return self.figure.piece(DrawnPart("link", "", link, f"link:{link}", shape))

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
    longest_title = 48  # letters of a self-stress by which it is chosen; all of it stands below the picture
    return f"{number}: {text if len(text) <= longest_title else text[:longest_title].rsplit(' ', 1)[0] + ' ...'}"


def _told(m: Mechanism, stress: SelfStress, L: float) -> str:
    length = with_unit(f"{L:.4g}", m.units.get("length", ""))
    return (
        f"Self-equilibrated reactions; assembly can preload any multiple: {stress.text or 'efforts of couplings'}. "
        f"Arrows: on the second link of each pair, the first takes the opposite; moments (two heads) divided by {length}."
    )


REACH, STEPS_A_MODE = 0.35, 12
"""How far a freedom is followed to either side (radians, or lengths / L), in so many steps."""


@dataclass(frozen=True)
class Wiggle:
    """One freedom: states ``x (nx, T)`` in the order in which they are passed, a ``title`` and what it is in words.

    Of a passive turn also its ``axis`` and the ``links`` that turn.
    """

    group: str
    title: str
    text: str
    x: Array
    kind: str
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    links: tuple[str, ...] = ()


def wiggles(report: DeterminacyReport) -> Iterator[Wiggle]:
    """What every driver does alone, what is neither driven nor passive, and every passive freedom."""
    g = report.geometry
    if g is None:
        return
    names = report.mechanism.freedom_names()
    for column in g.driven.tolist():
        rates = _alone(g, column)
        if rates is not None:
            others = ", ".join(names[i] for i in np.flatnonzero(np.abs(rates) > MOTIONS.still) if i != column)
            text = f"{names[column]} is driven{'; with it move ' + others if others else ', nothing else moves'}"
            rest = g.driven[g.driven != column]
            yield _followed(g, "Freedoms", f"{names[column]} driven", text, rates, rest)
    for motion, finding in zip(g.freedoms.undriven, report.undriven, strict=True):
        text = f"neither driven nor passive: {finding.text}"
        yield _followed(g, "Freedoms", f"{', '.join(motion.names[:3])} free", text, motion.rates, g.driven)
    for passive, found in zip(g.freedoms.passive, report.passive, strict=True):
        rate = float(np.linalg.norm(passive.twist[:3])) if found.turns else 0.0
        if rate:
            # positions of a full turn
            along = np.linspace(0, 2 * np.pi / rate, 48 + 1)
        else:
            along = REACH * np.linspace(-1, 1, 2 * STEPS_A_MODE + 1)
        x = g.system.advance(g.x[:, None], passive.rates[:, None] * along)
        yield Wiggle(
            "Passive freedoms",
            found.name,
            found.text,
            x,
            "spin" if rate else "swing",
            found.axis if rate else None,
            found.links,
        )


def _alone(g: Geometry, column: int) -> Array | None:
    """Rates with one driver at the rate one and the others at rest, least of the motions that do it; None where there are none."""
    N = g.freedoms.inputs
    wanted = (g.driven == column).astype(float)
    mix, *_ = np.linalg.lstsq(N[g.driven], wanted, rcond=MOTIONS.dependent)
    if np.abs(N[g.driven] @ mix - wanted).max(initial=0.0) > 1e-6:
        return None
    return np.asarray(N @ mix)


def _followed(g: Geometry, group: str, title: str, text: str, rates: Array, rest: Index) -> Wiggle:
    """A motion with the freedoms ``rest`` at rest, to both sides; infinitesimal, without closing, where it cannot be followed."""
    v = rates / np.abs(rates).max()
    sides = [_side(g, sign * v, rest) for sign in (-1.0, 1.0)]
    # steps that must be closed for a motion to count as one
    if max(map(len, sides)) < 3:
        # how far an infinitesimal motion is drawn
        x = g.system.advance(g.x[:, None], v[:, None] * 0.12 * np.linspace(-1, 1, 2 * STEPS_A_MODE + 1))
        return Wiggle(
            group, title, f"{text}. Infinitesimal only: beyond it the loops open, as they are drawn here", x, "swing"
        )
    return Wiggle(group, title, text, np.stack([*sides[0][::-1], g.x, *sides[1]], axis=1), "swing")


def _side(g: Geometry, v: Array, rest: Index) -> list[Array]:
    """Closed states to one side: each step goes on in the direction of the one before."""
    h, x, out = REACH / STEPS_A_MODE, g.x, []
    kept = 0.3  # part of a step that must be left once the loops are closed
    for _ in range(STEPS_A_MODE):
        guess = g.system.advance(x[:, None], h * v[:, None])[:, 0]
        closed, error = close(g.system, guess, rest)
        moved = g.system.difference(closed[:, None], x[:, None])[:, 0]
        size = float(np.abs(moved).max())
        if error > CLOSED or size < kept * h or moved @ v < kept * h * (v @ v):
            break
        v, x = moved / size, closed
        out.append(closed)
    return out
