"""The macro for FreeCAD, run outside it: a stand-in for the few names of FreeCAD that it uses, files written by a script of ours."""

import runpy
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from test_asmt import four_bar

MACRO = Path(__file__).resolve().parents[1] / "examples" / "freecad_check.py"


class Console:
    def __init__(self):
        self.messages, self.warnings, self.errors = "", "", ""

    def PrintMessage(self, text):
        self.messages += text

    def PrintWarning(self, text):
        self.warnings += text

    def PrintError(self, text):
        self.errors += text


def assembly(text, name="Assembly"):
    def export(path):
        Path(path).write_text(text, encoding="utf-8")

    return SimpleNamespace(TypeId="Assembly::AssemblyObject", Name=name, Label=name, exportAsASMT=export)


def played(monkeypatch, *objects, document=True):
    """What the macro writes with these objects in the active document."""
    console = Console()
    active = SimpleNamespace(Name="Unnamed", Objects=list(objects)) if document else None
    monkeypatch.setitem(sys.modules, "FreeCAD", SimpleNamespace(ActiveDocument=active, Console=console, GuiUp=False))
    runpy.run_path(str(MACRO), run_name="__main__")
    return console


def named():
    """A four-bar with the joint names that FreeCAD writes, and a part that nothing holds."""
    w = four_bar()
    for joint in w.joints[1::2]:
        joint[1] = [f"Unnamed#Joint{joint[1][0]}"]
    w.part("Unnamed#Lamp", w.poses["frame"])
    return w


def test_the_macro_is_at_most_100_lines():
    assert len(MACRO.read_text(encoding="utf-8").splitlines()) <= 100


def test_the_report_comes_with_the_labels_of_freecad(monkeypatch):
    labels = [SimpleNamespace(TypeId="App::FeaturePython", Name=f"Joint{c}", Label=f"Hinge {c}") for c in "ABCD"]
    lamp = SimpleNamespace(TypeId="App::Link", Name="Lamp", Label="Ceiling lamp")
    found = played(monkeypatch, assembly(named().text()), *labels, lamp)
    assert not found.errors
    assert "redundan" in found.messages
    assert "Hinge A" in found.messages
    assert "Unnamed#Joint" not in found.messages
    assert "no joint and no motion holds Ceiling lamp: left out" in found.warnings


def test_what_mechgraph_refuses_is_shown(monkeypatch):
    w = named()
    w.joint("GearJoint", "Unnamed#Gears", "frame", w.poses["frame"], "crank", w.poses["frame"])
    assert "GearJoint 'Unnamed#Gears'" in played(monkeypatch, assembly(w.text())).messages


@pytest.mark.parametrize(
    ("objects", "document", "words"),
    [
        ((), False, "open a document"),
        ((), True, "select one assembly of the document (there are: none)"),
        ((assembly("", "One"), assembly("", "Two")), True, "(there are: One, Two)"),
    ],
)
def test_without_a_single_assembly_it_says_what_to_do(monkeypatch, objects, document, words):
    assert words in played(monkeypatch, *objects, document=document).errors


def test_without_the_library_the_program_is_asked(monkeypatch):
    if shutil.which("mechgraph") is None:
        pytest.skip("the program mechgraph is not on the PATH")
    monkeypatch.setitem(sys.modules, "mechgraph", None)
    found = played(monkeypatch, assembly(named().text()))
    assert "redundan" in found.messages
    assert "Unnamed#Lamp: left out" in found.warnings


def test_without_either_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "mechgraph", None)
    monkeypatch.setenv("PATH", "")
    assert (
        "neither installed in FreeCAD's Python nor on the PATH" in played(monkeypatch, assembly(named().text())).errors
    )
