r"""A document as a small frozen tree, and its renderings as text, Markdown, HTML and LaTeX.

The tree knows no mechanism: reports and equation listings are built from headings, paragraphs, bullets,
tables, equations and preformatted text, and every rendering is a pure function of the tree. All renderings
are deterministic, end with one newline and hold no trailing spaces. Blocks without content (a table without
rows, bullets without items, an empty text) render as nothing.

White space in running text (headings, paragraphs, bullets, cells, captions) counts as one space, as in HTML;
only `Code` and the text form of an `Equation` keep theirs.
"""

from mechgraph.document.render import Shown, latex_words, to_html, to_latex, to_latex_file, to_markdown, to_text
from mechgraph.document.tree import Block, Bullets, Code, Document, Equation, Heading, Legend, Paragraph, Table

__all__ = [
    "Block", "Bullets", "Code", "Document", "Equation", "Heading", "Legend", "Paragraph", "Shown", "Table",
    "latex_words", "to_html", "to_latex", "to_latex_file", "to_markdown", "to_text",
]  # fmt: skip
