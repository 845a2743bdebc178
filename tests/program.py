"""The program `mechgraph` as tests call it: inside this process, or as a process of its own."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from mechgraph.cli.commands import app

ROOT = Path(__file__).resolve().parents[1]


def schema(of: str) -> dict[str, Any]:
    """The JSON schema of ``mechanism`` files or of the program's ``output``, as it is given to users."""
    return json.loads((ROOT / "library" / f"{of}.schema.json").read_text(encoding="utf-8"))


def invoke(*arguments: str | Path, **environment: str) -> Result:
    """What the program prints and returns, whatever happens to it."""
    return CliRunner(env=environment).invoke(app, [str(a) for a in arguments])


def run(*arguments: str | Path) -> Result:
    """The same of a program that neither crashes nor colors what it prints."""
    result = invoke(*arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    assert "\x1b" not in result.output
    return result


def bad(*arguments: str | Path) -> str:
    """The message of a call that is refused as wrong usage or bad input."""
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert not result.stdout
    return result.stderr


def process(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """The program in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "mechgraph", *arguments], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment, preexec_fn=heard if os.name == "posix" else None,
    )  # fmt: skip


def heard() -> None:
    """Let Ctrl-C be heard, also where the tests run in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
