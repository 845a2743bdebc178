"""The page as one file, or in a notebook."""

from __future__ import annotations

import base64
import hashlib
import importlib
import importlib.metadata
import io
import json
import os
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from html import escape
from importlib.resources import files
from typing import Any
from urllib.parse import quote

import numpy as np

from mechgraph.determinacy.report import DeterminacyReport, check
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Table, plain, to_html
from mechgraph.equations.build import formulate
from mechgraph.errors import (
    DeclarationError,
    FileError,
    MechgraphError,
    MechgraphWarning,
    MissingExtraError,
    counted,
    visible,
)
from mechgraph.files import PAGES, format_of, write_whole
from mechgraph.kinetostatics import kinematics, solve
from mechgraph.maths.se3 import Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.toml import written
from mechgraph.quantities import door, wrong
from mechgraph.result.solution import Solution
from mechgraph.result.values import driver_value
from mechgraph.show.curves import effort_curve, friction_losses, reaction_ranges
from mechgraph.show.diagrams import draw_graph, study_histogram, study_tornado
from mechgraph.show.page.content import MOST_ITEMS, Data, Figure, view_data
from mechgraph.show.scene import scene_at
from mechgraph.show.shapes import Shape
from mechgraph.show.skeleton import draw_skeleton
from mechgraph.show.stage import DrawnPart, DrawnPlace
from mechgraph.synthesis.answers import Syntheses, SynthesesOver, compared
from mechgraph.variants.study import IGNORED_TAIL, Study

WEB = "web"
"""Folder of the scripts, which build.js of it builds."""


def json_for_script(data: Any) -> str:
    """JSON that ends no script element and no line of one, whatever its texts hold.

    ValueError where a number is not finite: what is not known is packed, or is no number.
    """
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def text_of(name: str) -> str:
    """A file of the page."""
    return files(__package__).joinpath(*name.split("/")).read_text(encoding="utf-8")


def scripts() -> tuple[str, str]:
    """Other people's libraries, and our own modules that stand on them."""
    return text_of(f"{WEB}/vendor.js"), text_of(f"{WEB}/view.js")


def view_style() -> str:
    """The style sheet of the view."""
    return text_of(f"{WEB}/vendor.css") + text_of("view.css")


def libraries() -> str:
    """What the scripts stand on, with versions and licenses."""
    packages = json.loads(text_of(f"{WEB}/built.json"))["packages"]
    return " and ".join(f"{p['name']} {p['version']} ({p['license']})" for p in packages)


def content_policy(scripts: list[str], style: str) -> str:
    """What the page may do: run these scripts, use this style, show pictures that stand in it, and nothing else."""
    allowed = " ".join(map(_source, scripts))
    return f"default-src 'none'; script-src {allowed}; style-src {_source(style)}; img-src data:; base-uri 'none'; form-action 'none'"


def _source(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def version() -> str:
    """The version of this program."""
    try:
        return importlib.metadata.version("mechgraph")
    except importlib.metadata.PackageNotFoundError:
        return "(not installed)"


def declaration(m: Mechanism) -> str:
    """The declaration as TOML; empty where it holds functions, which no file can hold."""
    try:
        return written(m)
    except FileError:
        return ""


def provenance(
    m: Mechanism, report: DeterminacyReport | None, s: Solution | None = None, study: Study | None = None
) -> Document:
    """One table: program, mechanism, options."""
    return Document("", (Table(("what", "value"), tuple(row for row in _rows(m, report, s, study) if row[1])),))


def _rows(
    m: Mechanism, report: DeterminacyReport | None, s: Solution | None, study: Study | None
) -> Iterator[tuple[str, str]]:
    text = declaration(m)
    yield "program", f"mechgraph {version()}, numpy {np.__version__}"
    yield "mechanism", m.name
    yield "source", m.source
    yield (
        "SHA-256 of the declaration",
        hashlib.sha256(text.encode()).hexdigest() if text else "none: it holds functions",
    )
    yield "units", ", ".join(f"{base} {unit}" for base, unit in m.units.items()) or "none declared: any consistent set"
    if report is not None:
        yield "engine of the report", report.engine or "none: graph alone"
    if s is not None:
        yield "prescribed", ", ".join(s.prescribed) or "nothing"
        yield "unknown efforts", ", ".join(s.actuated) or "none"
        yield "positions", str(np.asarray(s.status).size)
        yield "engine and method", f"{s.engine}, {s.method or 'motion alone'}"
    if study is not None:
        yield "study", repr(study)


RC: dict[Any, Any] = {"svg.hashsalt": "mechgraph", "svg.fonttype": "none", "text.parse_math": False}
"""The same file at every call; names as text in the reader's fonts, none of them a formula."""


Pictures = list[tuple[str, str]]
"""Titles and pictures: addresses that hold them."""


def stills(m: Mechanism, s: Solution | None) -> Pictures:
    """The mechanism where it begins, what its drivers supply, and from what to what its reactions range."""
    # pairs up to which names stand in the still picture: finding room for them takes long
    out = [(m.name, _picture(lambda: draw_skeleton(m if s is None else s, labels=len(m.pairs) <= 40)))]
    if s is None or not s.has_forces:
        return out
    if s.losses:
        name = "Forces at the first position, tangent to the friction circles where journals rub"
        out.append(
            (name, _picture(lambda: draw_skeleton(s, ghosts=0, traces=False, forces=True, labels=len(m.pairs) <= 40)))
        )
        out.append(("Power lost by friction", _picture(lambda: friction_losses(s))))
    if s.mechanism.drives:
        out.append(("Efforts of the drivers", _picture(lambda: effort_curve(s))))
    out.append(("Reaction forces, hatched where not unique", _picture(lambda: reaction_ranges(s))))
    out.append(("Reaction moments, hatched where not unique", _picture(lambda: reaction_ranges(s, moment=True))))
    return out


def pictures_of_graph(m: Mechanism) -> Pictures:
    """The link-pair graph."""
    return [("Links and pairs, colored by the loops in which they lie", _picture(lambda: draw_graph(m)))]


def pictures_of_study(study: Study) -> Pictures:
    """How the first outputs spread, and what moves them; of those with several entries that of greatest size."""
    out = []
    # outputs of a study of which pictures are made
    for name in list(study.outputs)[:4]:
        nominal = np.abs(np.nan_to_num(study.nominal[name]))
        placed = study.outputs[name].ndim > 1 and study.outputs[name].shape[1] == study.status.shape[1]
        entries = nominal.ndim - placed
        if entries > 1 or not nominal.any() or not np.isfinite(study.outputs[name]).any():
            continue
        part = int(np.argmax(nominal.reshape(-1, nominal.shape[-1]).max(axis=0))) if entries else None
        out.append((f"{name} over the variants", _picture(partial(study_histogram, study, name, part=part))))
        out.append(
            (f"{name}: what every parameter alone does", _picture(partial(study_tornado, study, name, part=part)))
        )
    return out


def _picture(draw: Callable[[], Any]) -> str:
    """A picture as an SVG that stands in its own address."""
    try:
        from matplotlib import rc_context
    except ImportError:
        raise MissingExtraError("matplotlib", "report") from None
    buffer = io.BytesIO()
    with rc_context(RC), warnings.catch_warnings():
        # the reader's fonts may have the letters of a name; a name as long as the picture leaves the curves no room
        warnings.filterwarnings("ignore", "Glyph|constrained_layout not applied", UserWarning)
        draw().figure.savefig(buffer, format="svg", dpi=160, metadata={"Date": None, "Creator": None})
    return f"data:image/svg+xml,{quote(visible(buffer.getvalue().decode()), safe=' =:/,.;()-')}"


def _blocks(study: Study) -> Iterator[Block]:
    rows, slopes = [], []
    for name in study.outputs:
        nominal = np.asarray(study.nominal[name], dtype=float)
        if not np.isfinite(nominal).any():
            continue
        at = np.unravel_index(int(np.nanargmax(np.abs(nominal))), nominal.shape)
        middle = study.quantiles(name, (IGNORED_TAIL, 0.5, 1 - IGNORED_TAIL))
        values = [nominal, study.mean(name), study.std(name), *middle]
        where = ", ".join(map(str, map(int, at))) or "-"
        rows.append((name, where, *(f"{float(v[at]):.5g}" for v in values)))
        slopes += [(name, parameter, f"{float(v[at]):.5g}") for parameter, v in study.sensitivities(name).items()]
    head = ("output", "entry", "nominal", "mean", "deviation", "0.135 %", "median", "99.865 %")
    if rows:
        yield Heading("Outputs where they are greatest", 2)
        yield Paragraph("At the position, and of the component, where the mechanism itself has the greatest value.")
        yield Table(head, tuple(rows), align="llrrrrrr")
        yield Heading("Sensitivities there", 2)
        yield Table(("output", "parameter", "derivative"), tuple(slopes), align="llr")


STYLED = re.compile(r' style="text-align: (left|right|center)"| border="1"')
"""What the page's own style sheet does instead: its policy allows no style beside it."""
TOO_LARGE = "It has more links than are drawn in space."
START = "mechgraphView.start();"


@door
def write_report(
    m: Mechanism | Syntheses | SynthesesOver,
    solution: Solution | None = None,
    study: Study | None = None,
    *,
    path: str | os.PathLike[str],
) -> None:
    """Write a report page: one self-contained HTML file (``report`` extra).

    It shows the verdict, the report, the mechanism in space with freedoms, self-stresses and recommendations, curves and tables of a
    solution, outputs of a study, and the equations.

    Parameters
    ----------
    m : Mechanism, Syntheses or SynthesesOver
        The mechanism; or what ``synthesize`` found: all mechanisms side by side, each to be played, and what each does of what is asked.
    solution : Solution, optional
        Of that mechanism. Default: the stored motions, if all drives have one.
    study : Study, optional
        Of that mechanism.
    path : str or path
        The file, written atomically.

    Raises
    ------
    DeclarationError
        Solution or study belong to another mechanism.
    FileError
        The file extension is not that of a page, or the file cannot be written.
    MissingExtraError
        Without jinja2 or matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     mg.write_report(mg.load("rcsr").replace(drives=["O1"]), path=pathlib.Path(folder) / "page.html")
    ...     print([file.name for file in pathlib.Path(folder).iterdir()])
    ['page.html']
    """
    format_of(path, PAGES)
    write_whole(path, [report_page(m, solution, study)])


def report_page(
    m: Mechanism | Syntheses | SynthesesOver, solution: Solution | None = None, study: Study | None = None
) -> str:
    """The page as text; see ``write_report``."""
    if isinstance(m, Syntheses | SynthesesOver):
        if solution is not None or study is not None:
            raise DeclarationError("write_report", ["a page of syntheses has no solution and no study"])
        return _filled(_answers_content(m))
    faults = _faults(m, solution, study)
    if faults:
        raise DeclarationError("write_report", faults)
    s = solution if solution is not None else stored_motion(m)
    report = check(m if s is None else s.mechanism)
    return _filled(_content(m, report, s, study))


def stored_motion(m: Mechanism) -> Solution | None:
    """The solution of the motions that the drivers store; None where one of them stores none, or the loops do not close."""
    if not m.has_geometry or not m.drives or any(d.motion is None for d in m.drives) or check(m).mobility is None:
        return None
    if check(m).undriven or check(m).contradicting_drives:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)  # the page has them
        return solve(m, on_reach="flag")


def _faults(m: Mechanism, solution: Any, study: Any) -> list[str]:
    found = []
    for name, value, kind in (("solution", solution, Solution), ("study", study, Study)):
        if value is None:
            continue
        if not isinstance(value, kind):
            found.append(wrong(value, name, f"a {kind.__name__}"))
        elif (value.mechanism.link_names(), [p.name for p in value.mechanism.pairs]) != (
            m.link_names(),
            [p.name for p in m.pairs],
        ):
            found.append(
                f"{name}: belongs to the mechanism {value.mechanism.name!r} with other links or pairs than {m.name!r}"
            )
    return found


def _content(m: Mechanism, report: DeterminacyReport, s: Solution | None, study: Study | None) -> dict[str, Any]:
    told = tuple(map(str, s.warnings)) if s is not None and s.has_forces else ()
    side, word = _judged(report, s, bool(told))
    data = view_data(report, s)
    drawn = data is not None
    remarks = [report.rounding.text] if report.rounding is not None else []
    remarks += [TOO_LARGE] if report.geometry is not None and not drawn else []
    return {
        "name": m.name or "mechanism", "about": m.description, "side": side, "word": word, "verdict": report.verdict,
        "remarks": [*remarks, *([report.note] if report.note else []), *told],
        "numbers": list(_numbers(report, s)),
        "brief": _html(Document("", tuple(b for b in report.document().blocks if isinstance(b, Bullets)))),
        "report": _html(Document("", report.document(full=True).blocks)),
        "data": json_for_script(data) if data is not None else "", "seen": "The mechanism",
        "stills": stills(m if s is None else s.mechanism, s) if drawn else [],
        "graph": pictures_of_graph(m) if not m.has_geometry else [],
        "results": [(title, _html(document), pictures) for title, document, pictures in _results(s, study)],
        "equations": _html(_equations(report.mechanism)),
        "provenance": _html(provenance(m, report, s, study)), "declaration": declaration(m),
        "version": version(), "libraries": libraries(),
    }  # fmt: skip


def _answers_content(found: Syntheses | SynthesesOver) -> dict[str, Any]:
    """What a page of syntheses holds: the table, what is played, all in one picture, what each does, and the declaration."""
    every, document = list(found) if isinstance(found, SynthesesOver) else [found], found.document()
    m, shown = every[0].mechanism, _shown_answers(every)
    count, good = sum(map(len, every)), sum(len(s.good) for s in every)
    whole = {"proved": "All solutions, proved", "tested": "All solutions, by a trace test"}.get(found.completeness)
    side, word = "good" if good and whole else "fair", whole or "Others may exist"
    if not good:
        word = "None runs through all positions"
    known = all(fit.branch is not None for s in every for fit in s.fitness)
    judged = [("without defects", good)] if known else []
    numbers = [("mechanisms", count), *judged, ("left out", sum(len(s.rejected) for s in every))]
    title, caption = "Side by side", "Where each begins, with its least transmission angle"
    if isinstance(found, SynthesesOver):
        title, caption = "Where the pairs stand", "Center points at the frame, circle points at the first position"
    tables = [f"<details><summary>{escape(one.title)}</summary>{_html(one.compared())}</details>" for one in shown]
    return {
        "name": m.name or "mechanism", "about": m.description, "side": side, "word": word, "verdict": document.title, "remarks": [],
        "numbers": [(name, str(n)) for name, n in numbers],
        "brief": _html(Document("", document.blocks)), "report": "", "data": json_for_script(answers_data(shown, count)),
        "seen": "The mechanisms", "stills": [], "graph": [],
        "results": [("Asked and obtained", "".join(tables), []), (title, "", [(caption, _picture(found.plot))])],
        "equations": "", "provenance": _html(provenance(m, None)), "declaration": declaration(m),
        "version": version(), "libraries": libraries(),
    }  # fmt: skip


def _equations(m: Mechanism) -> Document:
    """All equations; of a large mechanism without their components."""
    f = formulate(m)
    # unknowns up to which the equations stand in components too: some 0.6 MB
    return Document("", f.document(components=len(f.unknowns) <= 300).blocks)


def _judged(r: DeterminacyReport, s: Solution | None, told: bool) -> tuple[str, str]:
    """A color and a word for the verdict, the word for those who do not see the color; ``told``: whether the solution warns."""
    if not r.mechanism.has_geometry:
        return "fair", "Topology only"
    if r.mobility is None or r.undriven or r.contradicting_drives:
        return "bad", "No solution"
    if told or r.near or any(p.load_bearing for p in r.passive):
        return "fair", "See warnings"
    if not (r.determinate or r.own_forces_unique):
        by_stiffness = s is not None and s.split_by_stiffness
        return "fair", "Split by stiffness" if by_stiffness else "Not all reactions are unique"
    return "good", "All is determined" if r.determinate else f"All that a {r.kind.name} model has is unique"


def _numbers(r: DeterminacyReport, s: Solution | None) -> Iterator[tuple[str, str]]:
    """The report in a line of numbers."""
    yield "links", str(len(r.links))
    yield "pairs", str(len(r.pairs))
    yield "loops", str(len(r.loops))
    yield "mobility by count", str(r.mobility_by_count)
    if r.mobility is not None:
        yield "mobility", str(r.mobility)
        yield "redundancy", str(r.redundancy)
        yield "passive freedoms", str(len(r.passive))
    if s is not None:
        status = np.asarray(s.status)
        yield "positions solved", f"{int((status == 'ok').sum())} of {status.size}"


def _results(s: Solution | None, study: Study | None) -> Iterator[tuple[str, Document, Pictures]]:
    if s is not None:
        yield "Results", Document("", s.document(asked=True).blocks), []
    if study is not None:
        yield "Study", Document("", (*study.document().blocks, *_blocks(study))), pictures_of_study(study)


def _html(document: Document) -> str:
    """A document in the style of the page."""
    return STYLED.sub(
        lambda found: f' class="{found[1]}"' if found[1] in ("right", "center") else "", to_html(document)
    )


def _filled(content: dict[str, Any]) -> str:
    """The template filled: texts are escaped, all else was made as HTML."""
    try:
        from jinja2 import Environment, StrictUndefined
        from markupsafe import Markup
    except ImportError:
        raise MissingExtraError("jinja2", "report") from None
    style = view_style() + text_of("page.css")
    run = [*scripts(), START]
    markup = {name: Markup(content[name]) for name in ("brief", "report", "equations", "provenance", "data")}
    results = [(title, Markup(html), pictures) for title, html, pictures in content["results"]]
    page = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=False).from_string(text_of("page.html"))
    return page.render(
        {**content, **markup}, results=results, style=Markup(style), scripts=[Markup(script) for script in run],
        policy=content_policy(run, style),
    )  # fmt: skip


RENDER = "\nexport default { render: ({ model, el }) => mechgraphView.mount(el, model.get('data')) };\n"


def view(shown: Mechanism | Solution) -> Any:
    """The view as a widget: the mechanism in space with every freedom, self-stress and advice, and the curves of a solution.

    A mechanism is shown with the motion that its drivers store, where they all do.

    Raises
    ------
    DeclarationError
        where it has no geometry, or its loops do not close; MissingExtraError without anywidget.
    """
    try:
        anywidget, traitlets = (importlib.import_module(name) for name in ("anywidget", "traitlets"))
    except ImportError:
        raise MissingExtraError("anywidget", "notebook") from None
    m, s = (shown.mechanism, shown) if isinstance(shown, Solution) else (shown, stored_motion(shown))
    report = check(m)
    data = view_data(report, s)
    if data is None:
        why = report.note or "it has too many links to be drawn"
        raise DeclarationError(f"view of {report.mechanism.name!r}", [why])

    def with_picture(widget: Any, **asked: Any) -> Any:
        """What a notebook keeps of it: the widget, and a picture where no widget runs, as in what is exported from it."""
        bundle = anywidget.AnyWidget._repr_mimebundle_(widget, **asked)
        kept, about = bundle if isinstance(bundle, tuple) else (bundle or {}, {})
        drawn = draw_skeleton(shown if s is None else s)._repr_png_()
        return {**kept, "image/png": base64.b64encode(drawn).decode()}, about

    members = {
        "_repr_mimebundle_": with_picture,
        "_esm": "".join(scripts()) + RENDER,
        "_css": view_style(),
        "data": traitlets.Dict().tag(sync=True),
    }
    return type("View", (anywidget.AnyWidget,), members)(data=data)


SAMPLES = 73
"""Driver values at which a mechanism is shown beside those of the rows."""


def _shown_answers(every: Sequence[Syntheses]) -> list[_ShownAnswer]:
    """The first of many answers, of one synthesis or of those of a sweep.

    Raises
    ------
    DeclarationError
        where there are none.
    """
    names = [(s, k, f"{i}, " * (len(every) > 1) + f"{k}") for i, s in enumerate(every) for k in range(len(s))]
    if not names:
        raise DeclarationError("page of syntheses", ["there is no mechanism to show"])
    return [_ShownAnswer(*one, figure) for figure, one in enumerate(names[:MOST_ITEMS])]


def answers_data(shown: Sequence[_ShownAnswer], count: int) -> Data:
    """Figures and motions of the first of ``count`` answers."""
    rest = f"Of {counted(count, 'mechanism')} the first {len(shown)} are shown." if count > len(shown) else ""
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

    def __init__(self, found: Syntheses, k: int, name: str, number: int) -> None:
        self.found, self.k, self.m, self.fit, self.number = found, k, found[k], found.fitness[k], number
        self.title = plain(f"{name}: {self.fit.words}")
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
            "group": "Mechanisms", "title": self.title, "text": plain(f"{text}{alone}."), "figure": self.number,
            "motion": motion | {"places": [plain(word) for word in self.words]}, "arrows": [], "marked": [], "axes": [],
            "pieces": [self.figure.piece(part) for part in self._paths()], "after": None,
        }  # fmt: skip

    def compared(self) -> Document:
        """What was asked beside what it does."""
        return Document("", compared(self.found, self.k))

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
            rows.append([f"point{where}", _number_list(np.asarray(marker.point)[:n])])
            if n == 3 or not pair.type.freedoms[0].turns:
                rows.append([f"axis{where}", _number_list(np.asarray(marker.axis)[:n])])
        yield pair.name, [[plain(a), plain(b)] for a, b in rows]


def _number_list(values: Any) -> str:
    return ", ".join(f"{v:.6g}" for v in values)
