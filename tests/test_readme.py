"""The README and the manual are run: every Python block and every mechgraph command, and what they show is what comes out.

``python docs/player.py [PAGE ...]`` writes the output of this version into the pages; run as a script this file does so for all,
and for the page of all equations.
"""

import json
import os
import re
import tomllib
from pathlib import Path

import gallery
import pair_drawings
import player
import pytest
import rooms

import mechgraph as mg

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
EQUATIONS = ROOT / "examples" / "rcsr_equations.txt"
"""All equations of a mechanism, to which pages refer."""
LINK = re.compile(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


PLAYED = [
    page for page in player.PAGES if re.search(r"^```(?:python|console)$", page.read_text(encoding="utf-8"), re.M)
]


def drawn_when_built(page: Path) -> list[pytest.MarkDecorator]:
    """A page with pictures of its own is run, and compared, by the build of the manual."""
    return [pytest.mark.slow] if player.PICTURE.search(page.read_text(encoding="utf-8")) else []


@pytest.mark.parametrize("page", [pytest.param(page, marks=drawn_when_built(page), id=name(page)) for page in PLAYED])
def test_what_a_page_shows_is_what_comes_out(page: Path, request: pytest.FixtureRequest) -> None:
    if "mg.compile(" in page.read_text(encoding="utf-8"):
        request.getfixturevalue("compiled")
    with player.stage():
        player.check(page)


def test_a_page_without_its_output_is_found() -> None:
    with pytest.raises(AssertionError, match="without a text block"):
        list(player.played("```python\nprint(1)\n```\n"))
    assert list(player.played("```python\nprint(1)\n```\n\n```text\n2\n```\n")) == [("2\n", "1\n")]


def test_the_readme_is_short() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 200


def equations() -> str:
    """The page of all equations, as it is printed."""
    return player.run_command("$ mechgraph equations rcsr --blocks").partition("\n")[2]


def test_the_page_of_equations_is_what_is_printed() -> None:
    assert EQUATIONS.read_text(encoding="utf-8") == equations()


def test_the_spatial_block_is_the_new_topology_of_the_examples() -> None:
    namespace: dict[str, object] = {}
    blocks = [body for kind, body in player.BLOCK.findall(README.read_text(encoding="utf-8")) if kind == "python"]
    for block in blocks[:2]:
        player.run_python(block, namespace)
    code = (ROOT / "examples" / "02_new_topology.py").read_text(encoding="utf-8")
    example: dict[str, object] = {"__name__": "example"}
    exec(compile(code, "02_new_topology.py", "exec"), example)
    assert namespace["m"] == example["ball_press"]()  # type: ignore[operator]
    assert all(len(block.partition("m = ")[2].partition("\n\n")[0].splitlines()) <= 20 for block in blocks[:2])


def test_commands_for_a_fresh_clone() -> None:
    blocks = [body for kind, body in player.BLOCK.findall(README.read_text(encoding="utf-8")) if kind == "sh"]
    (main_job,) = (body for body in blocks if "mechgraph solve" in body)
    (tests,) = (body for body in blocks if "pytest" in body)
    assert ".venv/bin/mechgraph solve 7r" in main_job
    assert tests.strip().endswith("python -m pytest -n auto")
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert re.search(r"^python -m pytest -n auto$", ci, re.MULTILINE)
    for text in (main_job, tests, ci):
        assert re.search(r"-m venv ", text)
        assert re.search(r"python -m pip install .*'\.\[(cli|test|dev)\]'", text)


def anchors(page: Path) -> set[str]:
    """Of the headings of a page, as sites and forges make them."""
    text = player.BLOCK.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", one.lower()).strip().replace(" ", "-") for one in headings}


def test_every_pair_type_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_drawings, "FOLDER", tmp_path)
    pair_drawings.draw()
    assert {file.stem for file in tmp_path.glob("*.svg")} == {*mg.pair_types()}
    arrows = {
        name: (tmp_path / f"{name}.svg").read_text("utf-8").count('stroke="#d55e00"') for name in ("W", "R", "Fr")
    }
    assert arrows == {"W": 0, "R": 1, "Fr": 6}


@pytest.mark.parametrize("page", player.PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(player.BLOCK.sub("", page.read_text(encoding="utf-8"))):
        place = (page.parent / target) if target else page
        assert place.exists(), target
        assert not anchor or anchor in anchors(place), f"{target}#{anchor}"


def test_the_number_of_stored_questions_is_current() -> None:
    count = sum(len(json.loads(file.read_text("utf-8"))) for file in (ROOT / "tests" / "cases").glob("*.json"))
    assert f"| {count} stored questions" in (ROOT / "docs" / "verified.md").read_text(encoding="utf-8")


def test_tables_of_the_file_format_are_read(tmp_path: Path) -> None:
    """Every block of the page of files, beside what it needs."""
    base = 'schema = 1\nname = "page"\n' + "".join(
        f'[[pair]]\nname = "{name}"\ntype = "R"\na = "{a}"\nb = "{b}"\npoint = [0, 0, {x}]\naxis = [0, 1, 0]\n'
        for name, a, b, x in (
            ("A", "frame", "crank", 0),
            ("B", "crank", "coupler", 1),
            ("D", "cam", "lever", 2),
            ("F", "frame", "cam", 3),
        )
    )
    page = (ROOT / "library" / "README.md").read_text(encoding="utf-8")
    blocks = [body for kind, body in player.BLOCK.findall(page) if kind == "toml"]
    assert len(blocks) == 9
    for block in blocks:
        own = {one["name"] for one in tomllib.loads(block).get("pair", ())}
        parts = [part for part in base.split("[[pair]]\n") if not any(f'name = "{name}"' in part for name in own)]
        file = tmp_path / "page.toml"
        file.write_text("[[pair]]\n".join(parts) + block, encoding="utf-8")
        assert mg.load(file).pairs


@pytest.mark.parametrize("page", ["ARCHITECTURE.md", "CONTRIBUTING.md", "docs/verified.md", "docs/comparison.md"])
def test_every_file_that_is_named_is_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:mechgraph|tests|docs|library|examples)/[^`*]*)`", text))
    assert named
    assert not {place for place in named if not (ROOT / place).exists()}


def test_the_picture_of_the_architecture_is_current() -> None:
    """It is drawn from the imports, and every room has its line in the table."""
    assert rooms.PICTURE.read_text(encoding="utf-8") == rooms.drawn(), "run python docs/rooms.py"
    table = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("| room |")[2].partition("\n\n")[0]
    assert {*re.findall(r"`(\w+)`", table)} == {*rooms.rooms()}


def test_the_tour_runs() -> None:
    notebook = json.loads((ROOT / "examples" / "tour.ipynb").read_text(encoding="utf-8"))
    namespace: dict[str, object] = {"__name__": "tour"}
    with player.stage():
        for cell in notebook["cells"]:
            assert not cell.get("outputs")
            if cell["cell_type"] == "code":
                player.run_python("".join(cell["source"]), namespace, "tour.ipynb")


def test_the_gallery_draws_its_mechanisms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len({entry.slug for entry in gallery.ENTRIES}) == len(gallery.ENTRIES) > 30
    assert all((ROOT / "docs" / "gallery" / entry.more).exists() for entry in gallery.ENTRIES)
    monkeypatch.setattr(gallery, "FOLDER", tmp_path)
    card = gallery.card(gallery.ENTRIES[0])
    assert "Mobility 1, by count -2; redundancy 3" in card
    still, film = ((tmp_path / f"four-bar{suffix}.svg").read_text(encoding="utf-8") for suffix in ("", "-film"))
    assert still.count("<animate") == 0
    assert film.count("<animate") == 3 + 4  # three links; two pins that move, each right and up
    gears = next(entry for entry in gallery.ENTRIES if entry.slug == "two-stages-of-gears")
    gallery.card(gears)
    film = (tmp_path / "two-stages-of-gears-film.svg").read_text(encoding="utf-8")
    assert film.count('type="rotate"') == 2 * 4  # four wheels turn, each with its mark
    assert film.count("<path") == 2 * 4


def test_version_and_citation_agree() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {version} (" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "agg"
    for page in player.PAGES:
        player.update(page)
    EQUATIONS.write_text(equations(), encoding="utf-8")
