"""The command line, for a mechanism of the library or a file: its name, its help, its version, its commands."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import mechgraph
from mechgraph.cli.commands import (
    assemblies,
    branches,
    check,
    compile_,
    equations,
    list_library,
    loads,
    plot,
    report,
    respond,
    save,
    solve,
    structure,
    synthesize,
)
from mechgraph.cli.options import DONE, EXIT_STATUS, in_plane, outcome, warned, write


class Program(TyperGroup):
    """The command line, all of which comes to an outcome: options and help as well as commands."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run it, with streams that show what they cannot encode; a stream may have been closed."""
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        with outcome():
            return super().main(*arguments, **options)

    def invoke(self, context: Any) -> Any:
        """Run a command, before the errors that are left are taken for those of the command line itself."""

        def options() -> list[str]:
            command = self.commands.get(context.invoked_subcommand or "")
            return [one.name or "" for one in command.params] if command else []

        with outcome(options), warned():
            return super().invoke(context)


__all__ = ["app"]

app = typer.Typer(
    name="mechgraph",
    cls=Program,
    help="Analyze spatial mechanisms: determinacy, equations, motion, driver efforts and reactions.\n\n" + EXIT_STATUS,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def _main(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        write(f"mechgraph {mechgraph.__version__}\n")
        raise typer.Exit(DONE)


app.command("list")(list_library)
for command in (
    check,
    structure,
    equations,
    solve,
    respond,
    save,
    plot,
    loads,
    report,
    assemblies,
    branches,
    synthesize,
):
    app.command(command.__name__)(in_plane(command))
app.command("compile")(in_plane(compile_))
