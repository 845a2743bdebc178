"""Ctrl-C while the command line starts, which is mostly the loading of numpy: a message and a status, no traceback.

Imported before everything else. An exception would not do: what is being loaded may turn it into another one.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Any

INTERRUPTED = 130
"""Exit status of a program that was interrupted."""


def _stop(*_: Any) -> None:
    os.write(2, b"mechgraph: interrupted\n")
    os._exit(INTERRUPTED)


def started() -> None:
    """From here on Ctrl-C raises KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _stop:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _is_program() -> bool:
    """Whether Python was started for the command line, not for a program that uses mechgraph."""
    name = os.path.splitext(os.path.basename(sys.argv[0]))[0] if sys.argv else ""
    return name == "mechgraph" or (name == "-m" and "mechgraph" in sys.orig_argv)


if _is_program() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)
