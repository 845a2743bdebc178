"""Films and pictures as files: what they hold, whole or not at all, and the command that makes them."""

import importlib.util
import json
import shutil
import sys
import xml.etree.ElementTree
from pathlib import Path

import jsonschema
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image
from program import invoke, schema
from test_show import four_bar

import mechgraph as mg
from mechgraph import show

THETA = np.linspace(0, 2 * np.pi, 9)
FAST = {"frames": 3, "dpi": 40.0}


@pytest.fixture(scope="module")
def turn() -> mg.Solution:
    return mg.solve(four_bar(), {"A": THETA})


def test_a_gif_has_its_frames_and_they_differ(turn: mg.Solution, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    show.animate(turn, tmp_path / "film.gif", fps=10, progress=lambda done, of: seen.append((done, of)), **FAST)
    assert seen == [(1, 3), (2, 3), (3, 3)]
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (3, (256, 192), 100)
        frames = []
        for i in range(3):
            film.seek(i)
            frames.append(np.asarray(film.convert("L"), dtype=float))
    assert np.abs(frames[0] - frames[1]).max() > 100
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]


def test_frames_are_files_of_their_own(turn: mg.Solution, tmp_path: Path) -> None:
    show.animate(turn, tmp_path / "still.png", frames=[0, 4], dpi=40.0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["still-000.png", "still-001.png"]
    space = mg.kinematics(mg.load("rssr"))
    show.animate(space, tmp_path / "space.png", frames=2, dpi=40.0, labels=False)
    with Image.open(tmp_path / "space-001.png") as still:
        assert still.size == (256, 192)


@pytest.mark.skipif(
    not shutil.which("ffmpeg") and importlib.util.find_spec("imageio_ffmpeg") is None, reason="there is no ffmpeg"
)
def test_a_film_in_mp4(turn: mg.Solution, tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    show.animate(turn, tmp_path / "film.mp4", **FAST)
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert dict(matplotlib.rcParams) == before


def test_without_ffmpeg_the_extra_is_named(turn: mg.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.isAvailable", lambda: False)
    with pytest.raises(mg.MissingExtraError, match=r"mechgraph\[film\]"):
        show.animate(turn, tmp_path / "film.mp4", **FAST)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["film.gif", "film.png"])
def test_what_is_broken_off_leaves_the_old_file(turn: mg.Solution, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("old")

    def broken(done: int, of: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        show.animate(turn, tmp_path / name, progress=broken, **FAST)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "old"


def test_faults_of_films_are_named(turn: mg.Solution, tmp_path: Path) -> None:
    with pytest.raises(mg.FileError, match=r"\.gif"):
        show.animate(turn, tmp_path / "film.avi")
    with pytest.raises(mg.DeclarationError, match="position 99 was not solved"):
        show.animate(turn, tmp_path / "film.gif", frames=[0, 99])
    with pytest.raises(mg.DeclarationError, match="fps"):
        show.animate(turn, tmp_path / "film.gif", fps=0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_picture_has_the_same_bytes_each_time(turn: mg.Solution, tmp_path: Path, suffix: str) -> None:
    for name in ("one", "other"):
        show.save_picture(show.draw_skeleton(turn, 2), tmp_path / f"{name}{suffix}", dpi=50)
    one, other = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("one", "other"))
    assert one == other
    assert len(one) > 1000


@pytest.mark.slow
def test_the_plot_command_draws_every_kind(tmp_path: Path) -> None:
    of = {"reaction": ["--of", "B"], "polar": ["--of", "A"]}
    kinds = [
        "skeleton",
        "graph",
        "structure",
        "equations",
        "efforts",
        "reaction",
        "ranges",
        "polar",
        "path",
        "hodograph",
        "margin",
    ]
    for kind in kinds:
        out = tmp_path / f"{kind}.svg"
        result = invoke("plot", "four-bar", kind, "--out", str(out), *of.get(kind, []))
        assert result.exit_code == 0, result.output
        assert xml.etree.ElementTree.parse(out).getroot().tag.endswith("svg")
    result = invoke("plot", "four-bar", "--out", tmp_path / "film.gif", "--frames", "2", "--json")
    assert result.exit_code == 0
    data = json.loads(result.stdout)
    jsonschema.Draft202012Validator(schema("output")).validate(data)
    assert (data["mechanism"], data["picture"], data["file"]) == ("four-bar", "skeleton", str(tmp_path / "film.gif"))
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 2
    assert not plt.get_fignums()


def test_the_plot_command_refuses(tmp_path: Path) -> None:
    for arguments, words in (
        (["four-bar", "reaction"], "--of A"),
        (["four-bar", "shadows"], "expected one of skeleton"),
        (["four-bar", "--out", str(tmp_path / "x.jpg")], ".svg"),
        (["four-bar", "efforts", "--out", str(tmp_path / "x.gif")], ".svg"),
    ):
        result = invoke("plot", *arguments)
        assert result.exit_code == 2
        assert words in result.output + result.stderr
    assert not list(tmp_path.iterdir())
