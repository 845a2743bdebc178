"""Files are written whole or not at all, through links, and never in place of a device, a pipe or what is read-only."""

import csv
import os
import signal
import stat
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.files import cell, whole_file, write_whole

posix = pytest.mark.skipif(os.name == "nt", reason="links, pipes and rights of another kind")


def m() -> mg.Mechanism:
    return mg.load("four-bar")


WRITERS: dict[str, Callable[[Any], None]] = {
    "CSV": lambda path: mg.solve(m(), {"A": np.linspace(0.0, 1.0, 3)}).to_csv(path),
    "TOML": lambda path: mg.save(m(), path),
}


@pytest.fixture(params=WRITERS)
def write(request: pytest.FixtureRequest) -> Callable[[Any], None]:
    return WRITERS[request.param]


@pytest.fixture
def text(write: Callable[[Any], None], tmp_path_factory: pytest.TempPathFactory) -> str:
    """What is written into a plain file."""
    plain = tmp_path_factory.mktemp("plain") / "x"
    write(plain)
    return plain.read_text(encoding="utf-8")


def only(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@posix
def test_a_link_stays_and_its_file_is_written(write: Callable[[Any], None], text: str, tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    file, link, second = tmp_path / "far" / "file", tmp_path / "link", tmp_path / "second"
    link.symlink_to(file)  # to a file that is not there yet
    second.symlink_to("link")
    for old in (None, "old"):
        if old:
            file.write_text(old)
        write(second)
        assert link.is_symlink()
        assert second.is_symlink()
        assert file.read_text(encoding="utf-8") == text
        assert only(tmp_path / "far") == {"file"}


@posix
def test_links_that_go_round_are_refused(write: Callable[[Any], None], tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(mg.FileError, match="cannot be written"):
        write(tmp_path / "a")
    assert only(tmp_path) == {"a", "b"}


@posix
def test_a_pipe_is_written_into(write: Callable[[Any], None], text: str, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    write(pipe)
    reader.join(timeout=10)
    assert read == [text]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix
@pytest.mark.parametrize("through_a_link", [False, True])
def test_devices_stay_what_they_are(write: Callable[[Any], None], tmp_path: Path, through_a_link: bool) -> None:
    for device in map(Path, ("/dev/full", "/dev/null")):
        if not device.is_char_device():
            pytest.skip(f"no {device} here")
        target = tmp_path / device.name if through_a_link else device
        if through_a_link:
            target.symlink_to(device)
        before = device.stat()
        if device.name == "full":
            with pytest.raises(mg.FileError, match="No space left"):
                write(target)
        else:
            write(target)
        after = device.stat()
        assert (after.st_mode, after.st_rdev, after.st_ino) == (before.st_mode, before.st_rdev, before.st_ino)


@posix
def test_what_is_read_only_is_refused_and_other_rights_are_kept(write: Callable[[Any], None], tmp_path: Path) -> None:
    file = tmp_path / "x"
    file.write_text("old")
    file.chmod(0o444)
    with pytest.raises(mg.FileError, match="read-only"):
        write(file)
    assert file.read_text() == "old"
    file.chmod(0o640)
    write(file)
    assert file.read_text() != "old"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert only(tmp_path) == {"x"}


@posix
def test_a_new_file_has_the_usual_rights(write: Callable[[Any], None], tmp_path: Path) -> None:
    usual = tmp_path / "usual"
    usual.touch()
    write(tmp_path / "x")
    assert (tmp_path / "x").stat().st_mode == usual.stat().st_mode


@pytest.mark.parametrize("length", [200, 250, 255])
def test_long_names(write: Callable[[Any], None], text: str, tmp_path: Path, length: int) -> None:
    write(tmp_path / ("x" * length))
    assert (tmp_path / ("x" * length)).read_text(encoding="utf-8") == text


@pytest.mark.parametrize("name", ["x" * 256, "x/" * 3000, "a\0b", "", ".", "none/x.csv", "file/x.csv", "\udcff/x"])
def test_names_that_no_file_can_have(
    write: Callable[[Any], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("kept")
    with pytest.raises(mg.FileError) as found:
        write(name)
    assert len(str(found.value)) < 5000
    assert str(found.value).encode()  # can be shown everywhere
    assert only(tmp_path) == {"file"}


@pytest.mark.parametrize("path", [3, None, b"x", 1.5, ["x"]])
def test_what_is_no_path(write: Callable[[Any], None], path: Any) -> None:
    with pytest.raises(mg.DeclarationError, match=r"expected a (text or a )?path"):
        write(path)


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), MemoryError()])
def test_what_fails_half_way_leaves_the_old_file(tmp_path: Path, error: BaseException) -> None:
    def pieces() -> Iterator[str]:
        yield "new" * 100_000
        raise error

    (tmp_path / "x").write_text("old")
    with pytest.raises((mg.FileError, KeyboardInterrupt, MemoryError)):
        write_whole(tmp_path / "x", pieces())
    assert only(tmp_path) == {"x"}
    assert (tmp_path / "x").read_text() == "old"


def test_what_cannot_be_encoded_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(mg.FileError, match="surrogates"):
        write_whole(tmp_path / "x", ["a", "\udcff"])
    assert not only(tmp_path)


def made(path: Path, error: BaseException | None = None) -> None:
    """A file that a library makes, of bytes that are no text; ``error`` comes when it is half done."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(b"\xff" * 100_000)
        if error is not None:
            raise error


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), ValueError("no such type"), KeyboardInterrupt()]
)
def test_what_a_library_leaves_half_made(tmp_path: Path, error: BaseException) -> None:
    (tmp_path / "x").write_text("old")
    for name in ("x", "new"):
        with pytest.raises(mg.FileError if isinstance(error, OSError) else type(error)):
            made(tmp_path / name, error)
    assert only(tmp_path) == {"x"}
    assert (tmp_path / "x").read_text() == "old"


@posix
def test_what_a_library_makes_goes_into_pipes_and_devices_too(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    made(pipe)
    reader.join(timeout=10)
    assert read == [b"\xff" * 100_000]
    with pytest.raises(mg.FileError, match="No space left"):
        made(Path("/dev/full"))
    assert Path("/dev/full").is_char_device()
    assert only(tmp_path) == {"pipe"}


# --- tables ------------------------------------------------------------------------------------------------------------


def read(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))


def test_a_table_holds_all_digits(tmp_path: Path) -> None:
    s = mg.solve(mg.load("rssr"), {"A": np.linspace(0.0, 6.0, 101)})
    s.to_csv(tmp_path / "x.csv")
    assert read(tmp_path / "x.csv") == {name: list(map(str, values.tolist())) for name, values in s.columns().items()}


def test_a_long_table_is_the_same_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    s = mg.solve(mg.load("rssr").replace(drives=["D"]), {"D": np.linspace(-0.1, 0.1, 101)}, on_reach="flag")
    monkeypatch.setattr("mechgraph.result.solution.ROWS_TOGETHER", 7)
    s.to_csv(tmp_path / "x.csv")
    found = read(tmp_path / "x.csv")
    for name, values in s.columns().items():
        if values.dtype.kind == "f":
            assert np.allclose(np.array(found[name], dtype=float), values, rtol=1e-12, atol=1e-14, equal_nan=True)
        else:
            assert found[name] == values.tolist()


@pytest.mark.slow
def test_a_long_table_needs_little_memory_beside_the_solution(tmp_path: Path) -> None:
    s = mg.solve(mg.load("four-bar"), {"A": np.linspace(0.0, 6.0, 20_000)})
    tracemalloc.start()
    try:
        s.to_csv(tmp_path / "x.csv")
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < (tmp_path / "x.csv").stat().st_size


@pytest.mark.parametrize("batch", [(), (0,), (2, 3)])
def test_tables_of_any_batch(tmp_path: Path, batch: tuple[int, ...]) -> None:
    s = mg.solve(m(), {"A": np.zeros(batch)}) if 0 not in batch else mg.solve(m(), {"A": np.zeros(3)}).part(slice(0, 0))
    s.to_csv(tmp_path / "x.csv")
    assert len((tmp_path / "x.csv").read_text().splitlines()) == 1 + int(np.prod(batch))


def test_a_part_of_a_solution_is_that_part() -> None:
    s = mg.solve(mg.load("rssr").replace(drives=["A"]), {"A": mg.Motion(np.linspace(0.0, 6.0, 40), 3.0)})
    part = s.part(slice(10, 14))
    assert part.batch == (4,)
    for name, values in part.columns().items():
        whole = s.columns()[name][10:14]
        if values.dtype.kind == "f":
            np.testing.assert_allclose(values, whole, rtol=1e-12, atol=1e-14)
        else:
            assert (values == whole).all()
    assert np.allclose(part.link("coupler").pose, s.link("coupler").pose[10:14], rtol=1e-12)
    assert np.array_equal(part.passive_effort["coupler"], s.passive_effort["coupler"][10:14])
    assert np.array_equal(part.state(1).loads, s.state(11).loads)


@pytest.mark.parametrize(
    ("text", "shown"),
    [("=1+1", "'=1+1"), ("+A", "'+A"), ("-A_1x", "'-A_1x"), ("@SUM", "'@SUM"), ("-1", "-1"), ("+2.5", "+2.5"),
     ("-1e-5", "-1e-5"), ("A", "A"), ("", ""), ("\x1b[2J", r"\x1b[2J"), ("\t=1", r"	=1"), ("\r=1", r"\r=1")],
)  # fmt: skip
def test_cells_that_a_spreadsheet_would_evaluate(text: str, shown: str) -> None:
    assert cell(text) == shown


def test_a_program_that_is_ended_leaves_no_temporary_file(tmp_path):
    code = f"""
import os, signal
from mechgraph.files import whole_file
with whole_file({str(tmp_path / "x.csv")!r}) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGTERM)
"""
    ended = subprocess.run([sys.executable, "-c", code], check=False)
    assert ended.returncode == -signal.SIGTERM
    assert list(tmp_path.iterdir()) == []
