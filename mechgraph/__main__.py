"""``mechgraph`` and ``python -m mechgraph``: the command line, or what to install for it."""

from __future__ import annotations

import sys

NEEDED = ("typer", "rich")
"""Packages of the ``cli`` extra."""


def main() -> None:
    """Run the command line; exit status 2 where its packages are missing, 130 where it is interrupted."""
    try:
        try:
            from mechgraph.cli import app
        except ImportError as error:
            missing = (error.name or "").partition(".")[0]
            if missing not in NEEDED:
                raise
            print(f"mechgraph: the command line needs {missing}: pip install 'mechgraph[cli]'", file=sys.stderr)
            sys.exit(2)
        app()
    except KeyboardInterrupt:
        print("mechgraph: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
