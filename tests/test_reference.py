"""The pages of the reference are made of the program, and name all that is public."""

import sys
from pathlib import Path

import pytest

import mechgraph as mg
from mechgraph import show

DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(DOCS))

import generate  # noqa: E402


def test_every_public_name_stands_in_one_group() -> None:
    listed = [name for _, _, names in generate.GROUPS.values() for name in names]
    assert len(listed) == len(set(listed))
    parts = {name for name in listed if name.startswith(("inertia.", "parts."))}
    assert {name.partition(".")[0] for name in parts} == {"inertia", "parts"}
    assert set(listed) - parts == (set(mg.__all__) - {"inertia", "parts"}) | {f"show.{name}" for name in show.__all__}


def test_a_page_differs_from_others_in_more_than_capitals() -> None:
    pages = [*generate.api(), "cli", "values", *generate.library()]
    assert len({page.lower() for page in pages}) == len(pages)


def test_the_command_line_is_told_option_by_option() -> None:
    page = generate.command_line()
    for words in ("## mechgraph solve", "| `--on-reach` |", "| `MECHANISM` |", "Example: `mechgraph list --json`"):
        assert words in page


def test_values_by_name_are_those_of_a_solution() -> None:
    page = generate.by_name()["values"]
    for name in ("| `components` |", "| `applied_effort` |", "| `pose` |", "`wrenches`:"):
        assert name in page


@pytest.mark.parametrize("name", generate.SOURCES)
def test_pages_of_the_library_link_to_pages_of_the_manual(name: str) -> None:
    text = generate.library()[name.removesuffix(".md")]
    assert "](../" not in text


def test_pages_are_written_once(tmp_path: Path) -> None:
    generate.write(tmp_path)
    times = {page: page.stat().st_mtime_ns for page in tmp_path.iterdir()}
    generate.write(tmp_path)
    assert times == {page: page.stat().st_mtime_ns for page in tmp_path.iterdir()}
