"""The summary of a solution: the same everywhere, extremes in their places, what is not unique marked, nothing expensive unasked."""

import re

import numpy as np
import pytest
from lattices import ladder
from program import invoke

import mechgraph as mg

Z = (0.0, 0.0, 1.0)
TURN = {"A": mg.Motion(np.deg2rad(np.arange(0, 360, 5.0)), 10.0, 0.0)}


@pytest.fixture
def four_bar() -> mg.Mechanism:
    """The planar four-bar of the library: redundancy 3, in-plane forces unique."""
    return mg.load("four-bar")


def two_motors() -> mg.Mechanism:
    """A shaft with a motor at each end: only the sum of their torques is unique."""
    return mg.Mechanism("shaft", pairs=[
        mg.Pair("A", "R", "frame", "shaft", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "shaft", point=(0, 0, 1), axis=Z),
    ], drives=["A", "B"], loads=[mg.Effort("A", -3.0)])  # fmt: skip


@pytest.mark.daily(3)
@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
@pytest.mark.parametrize("name", ["four-bar", "7r", "rssr"])
def test_python_says_what_the_command_line_says(name: str, redundant: str) -> None:
    shown = invoke("solve", name, "--redundant", redundant).stdout
    s = mg.solve(mg.load(name), redundant=redundant)
    assert s.summary() == str(s)
    assert re.split(r"\s+", shown) == re.split(r"\s+", s.summary())  # wrapped at 80 columns alone


def test_extremes_are_those_of_the_arrays() -> None:
    s = mg.solve(mg.load("7r"), {"O1": mg.Motion(np.deg2rad(np.arange(0, 360, 5.0)), 10.0)})
    told = s.to_dict()
    for row in told["reactions"]:
        for what in ("force", "moment"):
            sizes, greatest = np.linalg.norm(getattr(s[row["pair"]], what), axis=1), row[what]["greatest"]
            assert greatest["value"] == pytest.approx(sizes.max(), rel=1e-14)
            assert greatest["position"] == sizes.argmax()
    effort, (row,) = s["O1"].effort[:, 0], told["efforts"]
    assert [row["least"][k] for k in ("value", "position")] == [effort.min(), effort.argmin()]
    assert [row["greatest"][k] for k in ("value", "position")] == [effort.max(), effort.argmax()]


def test_extremes_do_not_depend_on_the_blocks(four_bar: mg.Mechanism, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mg.solve(four_bar, TURN).summary()
    monkeypatch.setattr("mechgraph.result.trajectory.TOGETHER", 1)
    assert mg.solve(four_bar, TURN).summary() == whole


def test_the_first_of_equal_values_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm that turns steadily pulls with m w^2 r wherever it stands, but for rounding; also where positions lie in different blocks."""
    monkeypatch.setattr("mechgraph.result.trajectory.TOGETHER", 1)
    arm = mg.Mechanism(
        "arm",
        [mg.Link("frame"), mg.Link("arm", 2.0, (0.3, 0.1, 0))],
        [mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z)],
        ["A"],
    )
    s = mg.solve(arm, {"A": mg.Motion(np.linspace(0.1, 2.9, 40), 3.0, 0.0)})
    sizes = np.linalg.norm(s["A"].force, axis=1)
    assert len(set(sizes.tolist())) > 1
    greatest = s.to_dict()["reactions"][0]["force"]["greatest"]
    assert greatest["position"] == 0
    assert greatest["value"] == pytest.approx(18 * np.hypot(0.3, 0.1), rel=1e-12)


@pytest.mark.daily(5)
@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
@pytest.mark.parametrize("name", ["four-bar", "7r", "rssr", "bennett", "spherical-four-bar"])
def test_what_is_unique_is_what_the_report_calls_unique(name: str, redundant: str) -> None:
    s = mg.solve(mg.load(name), redundant=redundant)
    report = mg.check(s.mechanism)
    for pair in s.mechanism.pairs:
        unique = {part: bool(np.all(ok)) for part, ok in s[pair.name].unique.items()}
        assert unique == report.unique[pair.name]
        for part, values in s[pair.name].components.items():
            assert np.isnan(values).any() == (not unique[part] and redundant == "nan")


def test_values_of_least_norm_are_marked(four_bar: mg.Mechanism) -> None:
    """A pin holds against Fz and two moments in no unique way: so neither force nor moment as a whole is unique."""
    text = mg.solve(four_bar, TURN, redundant="minimum_norm").summary()
    assert len(re.findall(r"^[ABCD] +R .* \S+ ~ +\d+ deg +0 ~$", text, re.MULTILINE)) == 4
    assert "~: some component of it is not unique" in " ".join(text.split())
    assert "Not unique" in text
    assert " ~" not in mg.solve(mg.load("7r"), redundant="minimum_norm").summary()


def test_efforts_that_are_not_unique_are_marked() -> None:
    """The motors share 3 in any way; least are all efforts together, with those of the load, where that at A takes all of it."""
    motions = {"A": mg.Motion([0.0, 1.0], 0.0, 0.0), "B": mg.Motion([0.0, 1.0], 0.0, 0.0)}
    text = mg.solve(two_motors(), motions).summary()
    assert len(re.findall(r"^[AB]\.Rz +not unique$", text, re.MULTILINE)) == 2
    assert re.search(r"^- A: .*effort", text, re.MULTILINE)
    s = mg.solve(two_motors(), motions, redundant="minimum_norm")
    found = re.findall(r"^([AB])\.Rz +(\S+) ~ +0 deg, 0 deg +(\S+) ~ +0 deg, 0 deg$", s.summary(), re.MULTILINE)
    assert found == [("A", "3", "3"), ("B", "0", "0")]
    assert not s["A"].unique["effort"].any()


def test_couplings_and_tolerances_are_told() -> None:
    """By hand: a load of -3 on the wheel of 40 teeth is 3 / 40 of a multiplier."""
    gears = mg.Mechanism("gears", pairs=[
        mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "wheel", point=(0.06, 0, 0), axis=Z),
    ], couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"], loads=[mg.Effort("B", -3)])  # fmt: skip
    s = mg.solve(gears, {"A": 0.5}, tol=1e-4)
    assert re.search(r"^teeth +0\.075 +28\.648 deg +0\.075 +28\.648 deg$", s.summary(), re.MULTILINE)
    (told,) = s.to_dict()["multipliers"]
    assert (told["coupling"], told["unique"]) == ("teeth", True)
    assert told["greatest"]["value"] == pytest.approx(0.075, rel=1e-12)
    assert "Geometry as it is meant to 0.0001" in s.summary()


def test_printing_looks_for_nothing_expensive(four_bar: mg.Mechanism, monkeypatch: pytest.MonkeyPatch) -> None:
    s = mg.solve(four_bar, TURN)
    whole = s.summary()
    monkeypatch.setattr("mechgraph.result.summary.UNASKED", 100)
    monkeypatch.setattr("mechgraph.result.summary.reactions", lambda _: pytest.fail("the reactions were looked for"))
    monkeypatch.setattr("mechgraph.result.summary.efforts", lambda _: pytest.fail("the efforts were looked for"))
    text = " ".join(str(s).split())
    assert "(4 pairs at 72 positions) were not computed; s.summary() computes them, in about 3 s" in text
    assert "Solved 72 of 72 positions." in text
    assert "closure error" in text
    assert "72 positions" in repr(s) or "(72,)" in repr(s)
    monkeypatch.undo()
    assert s.summary() == whole


def test_of_many_pairs_the_greatest_are_told() -> None:
    s = mg.solve(ladder(60), {"J0": mg.Motion(0.0, 1.0, 0.0)})
    text = s.summary()
    rows = re.findall(r"^(J\d+) +R +\S+ +\S+ +(\S+) \(Fx", text, re.MULTILINE)
    assert len(rows) == 20
    force = {p.name: np.hypot(s[p.name].components["Fx"], s[p.name].components["Fy"]) for p in s.mechanism.pairs}
    assert {name for name, _ in rows} == set(sorted(force, key=lambda name: -force[name])[:20])
    assert all(np.isclose(float(value), force[name], rtol=1e-4) for name, value in rows)
    assert f"the other {len(s.mechanism.pairs) - 20} pairs are smaller" in " ".join(text.split())
    assert f"... and {len(s.mechanism.pairs) - 20} more" in text


def test_a_response_tells_its_energies_and_events() -> None:
    m = mg.load("haug-slider-crank")
    r = mg.respond(m, (0.0, 0.1), rates={"A": 6.0}, events=[mg.Event("A", 0.3)])
    worst = np.abs(r.energy.balance).max() / r.energy.kinetic.max()
    assert f"energy balance, of the largest kinetic energy  {worst:.0e}" in r.summary()
    assert "position of A passes 0.3 at t = 0.05" in r.summary()
    assert "1 stage along the path." in " ".join(r.summary().split())
    assert repr(r).startswith("Response('haug-slider-crank', batch (")
