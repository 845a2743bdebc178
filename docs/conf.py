"""The manual as a static site, without network: ``python docs``."""

import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils.nodes import literal_block
from latex2mathml.converter import convert

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS)]

import generate  # noqa: E402

generate.write(DOCS / "reference" / "generated")

project = "mechgraph"
author = "the mechgraph authors"
release = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release
project_copyright = author

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "sphinx_design"]
exclude_patterns = ["_built/**"]
nitpicky = True

myst_enable_extensions = ["amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_theme = "pydata_sphinx_theme"
html_title = f"mechgraph {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_math_renderer = "mathml"
html_theme_options = {
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_nav_level": 1,
    "header_links_before_dropdown": 5,
}
html_sidebars = {
    name: []
    for name in (
        "index",
        "gallery/index",
        "verified",
        "comparison",
        "glossary",
        "changelog",
        "architecture",
        "contributing",
    )
}
pygments_style = "default"

FOREIGN = re.compile(r"""<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=["'](?:https?:)?//[^"']*["'][^>]*>""")
"""What a browser would fetch from the network."""


def mathml(latex: str, display: str) -> str:
    if "\\\\" in latex and "\\begin" not in latex:
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    return convert(latex, display=display)


def formula(translator: Any, node: Any) -> None:
    """A formula as MathML, which browsers draw without a script."""
    from docutils.nodes import SkipNode

    translator.body.append(mathml(node.astext(), "inline"))
    raise SkipNode


def displayed(translator: Any, node: Any) -> None:
    from docutils.nodes import SkipNode

    translator.body.append(f'<div class="math">{mathml(node.astext(), "block")}</div>\n')
    raise SkipNode


def draw(app: Any) -> None:
    """Pages draw their pictures before Sphinx looks for them."""
    import gallery
    import pair_drawings
    import player

    gallery.draw()
    pair_drawings.draw()
    for page in player.PAGES:
        player.draw(page)


TABLE = re.compile(r"^ *--+  +--", re.MULTILINE)
"""The rule under the heads of a table of text."""


MADE = {
    "../library/lee-1977.md": "/reference/generated/lee-1977.md",
    "../library/higher-pairs.md": "/reference/generated/higher-pairs.md",
    "../../mechgraph/errors.py": "/reference/generated/group-errors.md",
}
"""Files of the repository to which pages link, and what the build makes of them."""


def to_made_pages(app: Any, name: str, source: list[str]) -> None:
    """Let a link that works where the repository is read lead to the page of the site."""
    for file, page in MADE.items():
        source[0] = source[0].replace(f"]({file})", f"]({page})")


def keep_tables(app: Any, document: Any, name: str) -> None:
    """Tables of text scroll where other outputs wrap."""
    for block in document.findall(literal_block):
        if TABLE.search(block.astext()):
            block["classes"].append("text-table")


def no_arguments(app: Any, what: str, name: str, found: Any, *_: Any) -> tuple[str, str] | None:
    """Of what users get from a call, no arguments are shown."""
    hidden = what == "class" and generate.RETURNED.search(found.__doc__ or "") and not issubclass(found, Exception)
    return ("", "") if hidden else None


def stays_here(app: Any, exception: Exception | None) -> None:
    """No page loads anything from elsewhere."""
    from sphinx.errors import SphinxError

    if exception is None and app.builder.format == "html":
        for page in Path(app.outdir).rglob("*.html"):
            if found := FOREIGN.search(page.read_text(encoding="utf-8")):
                raise SphinxError(f"{page.relative_to(app.outdir)} loads from the network: {found[0]}")


def setup(app: Any) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (formula, None), (displayed, None))
    app.connect("builder-inited", draw)
    app.connect("source-read", to_made_pages)
    app.connect("doctree-resolved", keep_tables)
    app.connect("autodoc-process-signature", no_arguments)
    app.connect("build-finished", stays_here)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
