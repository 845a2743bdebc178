"""LaTeX files that compile: with pdflatex where it is installed, long equations in lines, signs beyond ASCII."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from test_hostile_names import NAMES, named

import mechgraph as mg
from mechgraph.document import Document, Equation, Heading, Paragraph, Table, to_latex_file

SIGNS = "ü é ñ Å ç ß ø ł ° ² ³ · × − → ≤ π Ω λ Σ – “x” … 中 ☃ \u0416"


def compiled(text: str, folder: Path) -> str:
    """What pdflatex says about a file that it takes."""
    if shutil.which("pdflatex") is None:
        pytest.skip("no pdflatex here (Debian: texlive-latex-base)")
    (folder / "x.tex").write_text(text, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "x.tex"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    log = ran.stdout.decode("utf-8", "replace")
    assert ran.returncode == 0, log[-3000:]
    assert (folder / "x.pdf").stat().st_size > 10_000
    return log


def too_wide(log: str) -> list[float]:
    """By how many points lines stand out of the page."""
    return [float(points) for points in re.findall(r"Overfull \\hbox \(([\d.]+)pt too wide", log)]


@pytest.mark.daily(12)
@pytest.mark.parametrize("name", mg.library())
def test_the_equations_of_the_library_fit_the_page(name: str, tmp_path: Path) -> None:
    f = mg.formulate(mg.load(name), unknowns="response" if name == "rcsr" else "kinetostatics")
    f.write(tmp_path / "f.tex")
    assert not too_wide(compiled((tmp_path / "f.tex").read_text(encoding="utf-8"), tmp_path))


def test_names_that_would_be_commands(tmp_path: Path) -> None:
    blocks = [block for name in NAMES for block in mg.formulate(named(name)).document().blocks]
    log = compiled(to_latex_file(Document("names", blocks)), tmp_path)
    assert "secret" not in re.sub(r"\s", "", "".join(re.findall(r"\(\S+", log)))


def test_signs_beyond_ascii(tmp_path: Path) -> None:
    text = to_latex_file(Document(SIGNS, (Paragraph(SIGNS), Table(("α",), ((SIGNS,),)), Heading(SIGNS))))
    assert r"\DeclareUnicodeCharacter{03C0}{\ensuremath{\pi}}" in text
    assert r"\DeclareUnicodeCharacter{4E2D}{[U+4E2D]}" in text
    assert "00FC" not in text  # TeX knows the letters of Latin with their accents
    log = compiled(text, tmp_path)
    assert "Missing character" not in log


def test_long_equations_are_broken_before_signs_and_in_long_products(tmp_path: Path) -> None:
    total = " + ".join(rf"\hat{{F}}_{{{i}}} (a_{{{i}}} + b)" for i in range(30)) + r" = 0 \tag{7}"
    product = " ".join(rf"\exp(\theta_{{{i}}} \hat{{A}})" for i in range(30)) + " = 1"
    short = r"a_{1} + b = 0 \tag{8}"
    text = to_latex_file(Document("", tuple(Equation("x", latex) for latex in (total, product, short))))
    first, second = re.findall(r"\\begin\{multline\*\}\n(.*?)\n\\end\{multline\*\}", text, re.DOTALL)
    lines = first.split(" \\\\\n")
    assert len(lines) > 3
    assert all(line.startswith("+ ") for line in lines[1:])
    assert " ".join(lines) == total
    assert " ".join(second.split(" \\\\\n")) == product
    assert f"\\[\n{short}\n\\]" in text
    assert not too_wide(compiled(text, tmp_path))


def test_other_files_of_a_formulation(tmp_path: Path) -> None:
    f = mg.formulate(mg.load("rcsr"))
    for suffix, text in ((".txt", f.text()), (".csv", f.coefficients().csv())):
        f.write(tmp_path / f"f{suffix}")
        assert (tmp_path / f"f{suffix}").read_text(encoding="utf-8") == text
    f.write(tmp_path / "f.md", components=False)
    assert (tmp_path / "f.md").read_text(encoding="utf-8").startswith("# Equations of rcsr")
    with pytest.raises(mg.FileError, match=r"known: .tex \(LaTeX\)"):
        f.write(tmp_path / "f.pdf")
