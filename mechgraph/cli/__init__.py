"""The command line, for a mechanism of the library or a file: one module for each group of commands, here put together."""

from mechgraph.cli.compiled import compile_
from mechgraph.cli.determinacy import check
from mechgraph.cli.formulation import equations
from mechgraph.cli.library import list_library, save
from mechgraph.cli.modes import assemblies, branches
from mechgraph.cli.motion import respond, solve
from mechgraph.cli.page import report
from mechgraph.cli.picture import plot
from mechgraph.cli.program import app
from mechgraph.cli.strength import loads
from mechgraph.cli.structure import structure

__all__ = ["app"]

app.command("list")(list_library)
app.command("check")(check)
app.command("structure")(structure)
app.command("equations")(equations)
app.command("solve")(solve)
app.command("respond")(respond)
app.command("save")(save)
app.command("plot")(plot)
app.command("loads")(loads)
app.command("report")(report)
app.command("assemblies")(assemblies)
app.command("branches")(branches)
app.command("compile")(compile_)
