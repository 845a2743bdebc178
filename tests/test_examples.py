"""The examples run, and the numbers that they assert hold."""

import contextlib
import io
import json
import runpy
import sys
from pathlib import Path

import player
import pytest

import mechgraph as mg

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
LARGEST_PICTURE = 150_000


def run(script: Path, *arguments: str) -> str:
    """What a script prints; in this process, as a program of its own would spend most of its time on imports."""
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as printed:
        patch.setattr(sys, "argv", [str(script), *arguments])
        runpy.run_path(str(script), run_name="__main__")
    return printed.getvalue()


def draws(script: Path) -> bool:
    text = script.read_text(encoding="utf-8")
    return "sys.argv" in text and "draw" in text and "write_report" not in text


@pytest.mark.parametrize("script", EXAMPLES, ids=[script.stem for script in EXAMPLES])
def test_example(script: Path, tmp_path: Path) -> None:
    text = script.read_text(encoding="utf-8")
    assert text.startswith('"""')
    assert "assert " in text
    picture = tmp_path / "picture.png"
    assert run(script, *([str(picture)] if draws(script) else []))
    assert bool(list(tmp_path.rglob("*.png"))) == draws(script)


def test_examples_are_numbered_without_gaps() -> None:
    assert [script.stem.partition("_")[0] for script in EXAMPLES] == [f"{i + 1:02d}" for i in range(len(EXAMPLES))]


def test_a_worked_example_draws_only_on_request() -> None:
    script = next(script for script in EXAMPLES if script.stem == "03_lee_rcsr")
    assert draws(script)
    assert ".png:" not in run(script)


def test_the_worked_machine_has_its_page(tmp_path: Path) -> None:
    """Written on request from what is declared, so that it is always current."""
    script = next(script for script in EXAMPLES if script.stem == "12_excavator")
    run(script, str(tmp_path / "excavator.html"))
    page = (tmp_path / "excavator.html").read_text(encoding="utf-8")
    assert all(f"{name} (R)" in page for name in "ABCK")


def test_pictures_of_the_pages_are_current_and_small() -> None:
    """They were drawn from what the examples declare now, in the way that is stated now; and a page shows each of them."""
    script = runpy.run_path(str(ROOT / "examples" / "04_readme_figures.py"))
    folder = script["FIGURES"]
    notes = json.loads((folder / script["NOTES"]).read_text(encoding="utf-8"))
    assert notes == {name: script["fingerprint"](name) for name in script["PICTURES"]}, (
        "run examples/04_readme_figures.py"
    )
    pages = "".join(page.read_text(encoding="utf-8") for page in player.PAGES)
    for name in script["PICTURES"]:
        assert 0 < (folder / name).stat().st_size < LARGEST_PICTURE
        assert f"examples/figures/{name})" in pages


def test_a_fingerprint_tells_other_numbers_and_another_way_to_draw() -> None:
    script = runpy.run_path(str(ROOT / "examples" / "04_readme_figures.py"))
    pictures, fingerprint = script["PICTURES"], script["fingerprint"]
    made, draw = pictures["readme.png"]
    first = fingerprint("readme.png")
    m, s = made()
    heavy = m.replace(loads=[mg.Gravity((0, 0, -1.62))])
    pictures["readme.png"] = (lambda: (heavy, s)), draw
    assert fingerprint("readme.png") != first
    pictures["readme.png"] = made, script["draw_forces"]
    assert fingerprint("readme.png") != first
