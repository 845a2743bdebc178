"""``mechgraph`` and ``python -m mechgraph``: the command line, or what to install for it."""

from __future__ import annotations

import sys

from mechgraph.errors import started

NEEDED = ("typer", "rich")
"""Packages of the ``cli`` extra."""


def main() -> None:
    """Run the command line; exit status 2 where its packages are missing, 130 where it is interrupted."""
    try:
        from mechgraph.cli.commands import app
    except ImportError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in NEEDED:
            raise
        print(f"mechgraph: the command line needs {missing}: pip install 'mechgraph[cli]'", file=sys.stderr)
        sys.exit(2)
    started()
    app()


if __name__ == "__main__":
    main()
