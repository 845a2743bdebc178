"""What a shell completes: names of the library, and freedoms of the mechanism that is named."""

from __future__ import annotations

import contextlib
import io

import typer

import mechgraph as mg


def library_names(incomplete: str) -> list[str]:
    """Mechanisms of the library; where none begins so, the shell completes files."""
    return [name for name in mg.library() if name.startswith(incomplete)]


def freedom_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Freedoms of the mechanism that stands before, as far as it can be read."""
    typed = [ctx.params.get("mechanism"), *ctx.args]  # an option that lacks its value leaves what was typed unread
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            names = mg.load(next(filter(None, typed), "")).freedom_names()
    except mg.MechgraphError:
        return []
    return [name for name in names if name.startswith(incomplete)]


def freedoms(ctx: typer.Context, incomplete: str) -> list[str]:
    """The same, to be followed by a value."""
    return [f"{name}=" for name in freedom_names(ctx, incomplete)]
