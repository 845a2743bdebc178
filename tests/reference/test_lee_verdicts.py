"""``library/lee-1977.md`` against what ``examples/05_lee_verdicts.py`` computes: every table has a measured number."""

import importlib.util
import re
from pathlib import Path

import pytest
from lee_1977 import errata, rcsr, rcsr_csr

PARTS = ("verdicts", "equations", "errata", "printed", "slips", "chains", "earlier", "table-xi")
ROOT = Path(__file__).resolve().parents[2]
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]\d)")


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("lee_verdicts", ROOT / "examples" / "05_lee_verdicts.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def part_of(document, name):
    return re.search(rf"<!-- {name}: .*? -->\n(.*?)\n<!-- end of {name} -->", document, re.DOTALL)[1].strip()


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", PARTS)
def test_the_document_says_what_the_script_computes(script, name):
    """Words equal; numbers to 2 % or two units of the last place that is shown (rounding differs from machine to machine)."""
    now = script.PARTS[name]().strip()
    then = part_of(script.DOCUMENT.read_text(encoding="utf-8"), name)
    assert NUMBER.sub("#", now) == NUMBER.sub("#", then)
    for a, b in zip(NUMBER.findall(now), NUMBER.findall(then), strict=True):
        assert float(a) == pytest.approx(
            float(b), rel=0.02, abs=0.02 if "." in b and len(b.split(".")[1]) < 3 else 2e-4
        )


def test_every_part_is_tested_and_has_its_place(script):
    assert tuple(script.PARTS) == PARTS
    document = script.DOCUMENT.read_text(encoding="utf-8")
    assert re.findall(r"<!-- ([\w-]+): written", document) == list(PARTS)
    changed = document.replace("-123.5 at 160", "-84.0 at 160")
    assert changed != document
    assert script.replaced(changed, {"earlier": part_of(document, "earlier")}) == document


def test_every_erratum_of_chapter_2_is_decided_by_numbers():
    """As printed the equation is off by more than any rounding, corrected it holds."""
    found = errata.decided()
    assert set(found) == {number for number, *_ in errata.ERRATA if number.startswith("2.")}
    for as_printed, corrected in found.values():
        assert as_printed > 1e-3
        assert corrected < 1e-12


def roman(number):
    tens, ones = divmod(number, 10)
    return "X" * tens + ("", "I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX")[ones]


def test_every_table_has_a_verdict(script):
    assert [row[0] for row in script.verdicts()] == [roman(number) for number in range(3, 38)]


@pytest.mark.parametrize(("number", "motion"), [("III", rcsr.motion), ("X", rcsr_csr.motion)])
def test_the_short_degree(number, motion):
    """2 in a million going in, 4 coming out, in both tables; what is left is their rounding and that of the arithmetic."""
    going_in, coming_out, left = errata.short_degree(motion(), number)
    assert going_in == pytest.approx(2e-6, abs=0.5e-6)
    assert coming_out == pytest.approx(4e-6, abs=1e-6)
    assert left < 0.8e-3


@pytest.mark.parametrize("number", ["III", "IV", "V", "VI", "VII", "VIII", "IX"])
def test_kinematics_to_the_last_printed_digit(number):
    """0.7 of .001; the angles carry the short degree (see test_lee_kinematics)."""
    assert rcsr.kinematics()[number] <= 0.7e-3
