"""The examples run, and the numbers that they assert hold."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
LARGEST_PICTURE = 150_000


def run(script: Path, *arguments: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def draws(script: Path) -> bool:
    return "sys.argv" in script.read_text(encoding="utf-8") and "draw" in script.read_text(encoding="utf-8")


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_example(script: Path, tmp_path: Path) -> None:
    text = script.read_text(encoding="utf-8")
    assert text.startswith('"""')
    assert "assert " in text
    picture = tmp_path / "picture.png"
    assert run(script, *([str(picture)] if draws(script) else []))
    assert picture.exists() == draws(script)


def test_examples_are_numbered_without_gaps() -> None:
    assert [script.stem.partition("_")[0] for script in EXAMPLES] == [f"{i + 1:02d}" for i in range(len(EXAMPLES))]


def test_a_worked_example_draws_only_on_request() -> None:
    script = next(script for script in EXAMPLES if script.stem == "03_lee_rcsr")
    assert draws(script)
    assert ".png:" not in run(script)


def test_picture_of_the_readme_is_small() -> None:
    assert 0 < (ROOT / "examples" / "figures" / "readme.png").stat().st_size < LARGEST_PICTURE
