"""The view of the page in a notebook (``notebook`` extra)."""

from __future__ import annotations

import base64
import importlib
from typing import Any

from mechgraph.errors import DeclarationError, MissingExtraError
from mechgraph.model.mechanism import Mechanism
from mechgraph.report.report import check
from mechgraph.result.solution import Solution
from mechgraph.show.page import made
from mechgraph.show.page.content import view_data
from mechgraph.show.page.write import stored_motion
from mechgraph.show.skeleton import draw_skeleton

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
        "_esm": "".join(made.scripts()) + RENDER,
        "_css": made.view_style(),
        "data": traitlets.Dict().tag(sync=True),
    }
    return type("View", (anywidget.AnyWidget,), members)(data=data)
