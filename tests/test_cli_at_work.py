"""The command line at work: examples of the help, completion, progress, and interrupts that leave nothing behind."""

import itertools
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from program import app, invoke
from rich.progress import Progress
from test_synthesis_setup import FITTED

import mechgraph as mg
from mechgraph import files

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = [command.name for command in app.registered_commands]


def help_of(command: str, columns: int = 80) -> str:
    result = invoke(command, "--help", COLUMNS=str(columns), TERMINAL_WIDTH=str(columns))
    assert result.exit_code == 0
    return result.stdout


# --- help --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_the_example_of_the_help_runs(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examples = re.findall(r"^ *Example: mechgraph (.*)$", help_of(command), re.MULTILINE)
    assert examples
    monkeypatch.chdir(tmp_path)
    Path("function.toml").write_text(FITTED, encoding="utf-8")
    for example in examples:
        assert example.split()[0] == command
        result = invoke(*example.split())
        assert result.exit_code == 0, result.output
        named = re.findall(r"(?:--out|-o) (\S+)", example)
        assert {file.stem for file in tmp_path.iterdir()} - {"function"} == {
            Path(name).stem for name in named
        }  # C beside its header


@pytest.mark.parametrize("columns", [80, 120])
@pytest.mark.parametrize("command", COMMANDS)
def test_help_stays_within_the_terminal(command: str, columns: int) -> None:
    assert max(map(len, help_of(command, columns).splitlines())) <= columns


# --- options -----------------------------------------------------------------------------------------------------------


# --- completion --------------------------------------------------------------------------------------------------------


def completed(words: str) -> list[str]:
    """What bash is told for a line whose last word is not complete."""
    done = subprocess.run(
        [sys.executable, "-c", "import sys; sys.argv[0] = 'mechgraph'; from mechgraph.__main__ import main; main()"],
        capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT), "_MECHGRAPH_COMPLETE": "complete_bash", "COMP_WORDS": words,
                          "COMP_CWORD": str(len(words.split(" ")) - 1)},
    )  # fmt: skip
    assert not done.stderr
    return done.stdout.split()


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("mechgraph sol", ["solve"]),
        ("mechgraph check rcs", ["rcsr", "rcsr-csr", "rcsr-csr-printed"]),
        ("mechgraph solve rcsr --drive O2", ["O2.Rz=", "O2.Tz="]),
        ("mechgraph solve four-bar --actuate D", ["D.Rz"]),
        ("mechgraph solve four-bar --drive A.Rz=0 --actuate", ["--actuate"]),
        ("mechgraph solve --actuate D", []),
        ("mechgraph check none-such --at A", []),
        ("mechgraph check zzz", []),
        ("mechgraph solve rcsr --method loop", ["loop_wrench"]),
    ],
)
def test_completion(words: str, expected: list[str]) -> None:
    assert completed(words) == expected


def test_completion_can_be_installed() -> None:
    shown = invoke("--help").stdout
    assert "--install-completion" in shown
    assert "--show-completion" in shown


# --- progress ----------------------------------------------------------------------------------------------------------


def test_solve_tells_how_far_it_is() -> None:
    seen: list[tuple[int, int]] = []
    theta = np.linspace(0, 2 * np.pi, 5000)
    s = mg.solve(mg.load("7r"), {"O1": theta}, progress=lambda *numbers: seen.append(numbers))
    assert len(seen) == 5
    assert seen[-1] == (5000, 5000)
    assert all(a < b for (a, _), (b, _) in itertools.pairwise(seen))
    assert np.array_equal(s["O1"].effort, mg.solve(mg.load("7r"), {"O1": theta})["O1"].effort)
    with pytest.raises(mg.DeclarationError, match="progress"):
        mg.solve(mg.load("7r"), {"O1": theta}, progress=1)


@pytest.mark.parametrize("arguments", [("solve", "7r"), ("respond", "windows-2", "--for", "1s", "--rate", "A0=-1")])
def test_bars_are_shown_on_a_terminal_alone(arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[float, float | None]] = []
    real = Progress.update
    monkeypatch.setattr(
        Progress,
        "update",
        lambda bar, task, **of: (told.append((of["completed"], of["total"])), real(bar, task, **of)),
    )
    assert invoke(*arguments).exit_code == 0
    assert not told
    monkeypatch.setattr("mechgraph.cli.options.is_terminal", lambda stream: stream is sys.stderr)
    result = invoke(*arguments)
    assert result.exit_code == 0
    assert told
    assert told[-1][0] == pytest.approx(told[-1][1])


# --- interrupts --------------------------------------------------------------------------------------------------------


@pytest.mark.daily(1)
@pytest.mark.parametrize("file", ["x.csv", "x.nc", "x.parquet"])
def test_an_interrupt_while_a_file_is_written_leaves_the_old_one(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    target = tmp_path / file
    target.write_text("old")
    monkeypatch.setattr(files.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        mg.solve(mg.load("four-bar")).write(target)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [(file, "old")]


def test_an_interrupt_in_the_middle_of_a_text_leaves_nothing(tmp_path: Path) -> None:
    def pieces():
        yield "half"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        files.write_whole(tmp_path / "x.txt", pieces())
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="signals of another kind")
def test_an_interrupted_program_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C once the temporary file is there."""
    out = tmp_path / "x.csv"
    running = subprocess.Popen(
        [sys.executable, "-m", "mechgraph", "solve", "7r", "--drive", "O1=0:3000:0.1", "--out", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    until = time.monotonic() + 120
    while not list(tmp_path.iterdir()) and running.poll() is None and time.monotonic() < until:
        time.sleep(0.005)
    for _ in range(20):  # a signal that arrives in a destructor is lost: as at a terminal, it is sent again
        if running.poll() is not None:
            break
        running.send_signal(signal.SIGINT)
        time.sleep(1.0)
    _, error = running.communicate(timeout=60)
    assert running.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in error
    assert not list(tmp_path.iterdir())
