"""Files of other programs with random damage: a mechanism or a named error, never anything else."""

import contextlib
import random
import re
import warnings

import pytest
from program import invoke
from test_asmt import four_bar, swing
from test_mjcf import MACHINES
from test_urdf import ARM

import mechgraph as mg

JUNK = [
    "nan",
    "1e400",
    "-1",
    "0",
    "",
    "\t",
    "\n",
    "<",
    ">",
    '"',
    "&",
    "\x00",
    "é",
    "1e99",
    "/",
    "Joints",
    "9" * 400,
    "inf",
    "true",
]
WORD = re.compile(r"[^\s<>\"=/]+")


def damaged(text, rng):
    for _ in range(rng.randint(1, 3)):
        kind = rng.randrange(3)
        if kind == 0:
            lines = text.split("\n")
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            text = "\n".join(lines[: rng.choice([None, i])])
        elif kind == 1:
            words = list(WORD.finditer(text)) or [re.match("", text)]
            word = rng.choice(words)
            text = text[: word.start()] + rng.choice([*JUNK, rng.choice(words)[0]]) + text[word.end() :]
        else:
            i = rng.randrange(len(text) + 1)
            text = text[:i] + rng.choice(JUNK) + text[i + rng.randint(0, 40) :]
    return text


@pytest.mark.daily(40)
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("kind", ["asmt", "stored", "xml", "urdf"])
def test_damage_is_named(tmp_path, kind, seed):
    rng = random.Random(f"{kind} {seed}")
    if kind == "xml":
        mg.save(MACHINES[rng.choice(["press", "cylinders", "gears"])], tmp_path / "x.xml")
    text = {"asmt": four_bar().text, "stored": swing().text, "xml": (tmp_path / "x.xml").read_text if kind == "xml" else str,
            "urdf": lambda: ARM}[kind]()  # fmt: skip
    file = tmp_path / f"x.{'asmt' if kind == 'stored' else kind}"
    file.write_bytes(damaged(text, rng).encode("utf-8", "replace"))
    with warnings.catch_warnings(action="ignore", category=mg.MechgraphWarning), contextlib.suppress(mg.MechgraphError):
        made = mg.load(file)
        assert isinstance(made, mg.Mechanism)
        mg.check(made)
        if kind == "stored":
            invoke("check", file, "--compare")
