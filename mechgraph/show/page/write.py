"""``write_report``: the page of a mechanism, its solution and its study as one file."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from mechgraph.arguments import door
from mechgraph.document import Bullets, Document, to_html
from mechgraph.equations.build import formulate
from mechgraph.errors import DeclarationError, MechgraphWarning, MissingExtraError
from mechgraph.kinetostatics import solve
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import wrong
from mechgraph.report.report import DeterminacyReport, check
from mechgraph.result.solution import Solution
from mechgraph.show.page import made
from mechgraph.show.page.content import view_data
from mechgraph.show.page.packing import json_for_script
from mechgraph.show.page.provenance import declaration, provenance, version
from mechgraph.show.page.stills import Pictures, pictures_of_graph, pictures_of_study, stills
from mechgraph.show.page.studies import study_document
from mechgraph.variants.result import Study
from mechgraph.writing import write_whole

STYLED = re.compile(r' style="text-align: (left|right|center)"| border="1"')
"""What the page's own style sheet does instead: its policy allows no style beside it."""
MOST_UNKNOWNS = 300
"""Unknowns up to which the equations stand in components too: some 0.6 MB."""
TOO_LARGE = "It has more links than are drawn in space."
START = "mechgraphView.start();"


@door
def write_report(
    m: Mechanism,
    solution: Solution | None = None,
    study: Study | None = None,
    *,
    path: str | os.PathLike[str],
) -> None:
    """Write the page of a mechanism: one HTML file that needs no network and can be passed on.

    The verdict first, then the determinacy report, the mechanism in space with every freedom, self-stress and advice, the curves and
    tables of a solution, the outputs of a study, the equations, and where all this comes from.

    Parameters
    ----------
    solution : of that mechanism. Left out, the motions that its drivers store are solved, where all of them do.
    study : of that mechanism, for its tables.
    path : the file, written whole or not at all.

    Raises
    ------
    DeclarationError
        where solution or study belong to another mechanism; FileError where the file cannot be written; MissingExtraError without the
        ``report`` extra (jinja2, matplotlib).
    """
    write_whole(path, [report_page(m, solution, study)])


def report_page(m: Mechanism, solution: Solution | None = None, study: Study | None = None) -> str:
    """The page as text; see ``write_report``."""
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
    side, word = _judged(report)
    data = view_data(report, s)
    drawn = data is not None
    remarks = [report.rounding.text] if report.rounding is not None else []
    remarks += [TOO_LARGE] if report.geometry is not None and not drawn else []
    return {
        "name": m.name or "mechanism", "about": m.description, "side": side, "word": word, "verdict": report.verdict,
        "remarks": [*remarks, *([report.note] if report.note else []), *map(str, s.warnings if s is not None and s.has_forces else ())],
        "numbers": list(_numbers(report, s)),
        "brief": _html(Document("", tuple(b for b in report.document().blocks if isinstance(b, Bullets)))),
        "report": _html(Document("", report.document(full=True).blocks)),
        "data": json_for_script(data) if data is not None else "",
        "stills": stills(m if s is None else s.mechanism, s) if drawn else [],
        "graph": pictures_of_graph(m) if not m.has_geometry else [],
        "results": [(title, _html(document), pictures) for title, document, pictures in _results(s, study)],
        "equations": _html(_equations(report.mechanism)),
        "provenance": _html(provenance(m, report, s, study)), "declaration": declaration(m),
        "version": version(), "libraries": made.libraries(),
    }  # fmt: skip


def _equations(m: Mechanism) -> Document:
    """All equations; of a large mechanism without their components."""
    f = formulate(m)
    return Document("", f.document(components=len(f.unknowns) <= MOST_UNKNOWNS).blocks)


def _judged(r: DeterminacyReport) -> tuple[str, str]:
    """A colour and a word for the verdict, the word for those who do not see the colour."""
    if not r.mechanism.has_geometry:
        return "fair", "By its graph alone"
    if r.mobility is None or r.undriven or r.contradicting_drives:
        return "bad", "No answer as it stands"
    if r.near or any(p.load_bearing for p in r.passive) or not (r.determinate or r.own_forces_unique):
        return "fair", "To be read with care"
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
        yield "Study", study_document(study), pictures_of_study(study)


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
    style = made.view_style() + made.text_of("page.css")
    scripts = [*made.scripts(), START]
    markup = {name: Markup(content[name]) for name in ("brief", "report", "equations", "provenance", "data")}
    results = [(title, Markup(html), pictures) for title, html, pictures in content["results"]]
    page = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=False).from_string(
        made.text_of("page.html")
    )
    return page.render(
        {**content, **markup}, results=results, style=Markup(style), scripts=[Markup(script) for script in scripts],
        policy=made.content_policy(scripts, style),
    )  # fmt: skip
