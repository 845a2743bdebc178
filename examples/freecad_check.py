"""A macro for FreeCAD: mechgraph's report on the active assembly, in the report view and in a window.

Copy it into FreeCAD's macro folder (Macro > Macros...; name it freecad_check.FCMacro) and run it with an assembly open. mechgraph has to be
installed in FreeCAD's own Python, or its program `mechgraph` has to be on the PATH. The assembly is exported to a temporary file with
`exportAsASMT`, as Assembly > Export ASMT file does, and read with `mechgraph.load`.
"""

import os
import shutil
import subprocess
import tempfile
import warnings

import FreeCAD

ASSEMBLY = "Assembly::AssemblyObject"


def active_assembly(document):
    """The assembly that is selected or contains the selection, else the only one of the document."""
    found = [item for item in document.Objects if item.TypeId == ASSEMBLY]
    selected = []
    if FreeCAD.GuiUp:
        import FreeCADGui

        selected = [item for item in FreeCADGui.Selection.getSelection(document.Name) if item in found]
    if len(selected or found) != 1:
        names = ", ".join(item.Label for item in found) or "none"
        raise ValueError(f"select one assembly of the document (there are: {names})")
    return (selected or found)[0]


def labelled(text, document):
    """A text with the labels that FreeCAD shows in place of the internal names of its objects, where the two differ."""
    for item in sorted(document.Objects, key=lambda item: -len(item.Name)):
        if item.Label != item.Name:
            text = text.replace(f"{document.Name}#{item.Name}", item.Label)
    return text


def report_of(path):
    """The report and the notes on an exported file, from the library or from the program."""
    try:
        import mechgraph
    except ImportError:
        program = shutil.which("mechgraph")
        if program is None:
            raise ValueError("mechgraph is neither installed in FreeCAD's Python nor on the PATH") from None
        done = subprocess.run([program, "check", path], capture_output=True, text=True, check=False)
        return done.stdout, done.stderr
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always", mechgraph.MechgraphWarning)
        try:
            report = str(mechgraph.check(mechgraph.load(path)))
        except mechgraph.MechgraphError as error:
            report = f"{error}\n"
    return report, "".join(f"{note.message}\n" for note in notes)


def show(text):
    """The text in a window, in letters of one width."""
    try:
        from PySide import QtGui as widgets
    except ImportError:
        from PySide2 import QtWidgets as widgets
    window = widgets.QDialog()
    window.setWindowTitle("mechgraph")
    window.resize(900, 700)
    box = widgets.QPlainTextEdit(text)
    box.setReadOnly(True)
    box.setStyleSheet("font-family: monospace")
    layout = widgets.QVBoxLayout(window)
    layout.addWidget(box)
    window.exec_()


def main():
    """Export, check, show."""
    document = FreeCAD.ActiveDocument
    try:
        if document is None:
            raise ValueError("open a document with an assembly")
        assembly = active_assembly(document)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "assembly.asmt")
            assembly.exportAsASMT(path)
            report, notes = (labelled(text, document) for text in report_of(path))
    except ValueError as error:
        FreeCAD.Console.PrintError(f"mechgraph: {error}\n")
        return
    FreeCAD.Console.PrintWarning(notes)
    FreeCAD.Console.PrintMessage(report)
    if FreeCAD.GuiUp:
        show(report + notes)


if __name__ == "__main__":
    main()
