"""Couplings: declared, told when wrong, written, converted, varied, counted, and their multipliers in the equations."""

import pickle
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import mechgraph as mg
from mechgraph.equations.terms import State
from mechgraph.model import toml
from mechgraph.model.file_format import json_schema
from mechgraph.variants.numbers import find_field, stacked, varied

Z = (0.0, 0.0, 1.0)
UNITS = {"length": "m", "mass": "kg", "time": "s"}


def train(couplings, **more) -> mg.Mechanism:
    """Two wheels on the frame, a cylinder on the second, a slide and a sphere beside them."""
    ends = {
        "A": ("R", "frame", "one"),
        "B": ("R", "frame", "two"),
        "C": ("C", "two", "three"),
        "D": ("P", "frame", "slide"),
        "E": ("P", "frame", "other"),
        "S": ("S", "frame", "ball"),
    }
    pairs = [mg.Pair(name, *of, point=(i, 0.1, 0), axis=Z) for i, (name, of) in enumerate(ends.items())]
    return mg.Mechanism("train", pairs=pairs, couplings=couplings, **{"drives": ["A"], **more})


def geared() -> mg.Mechanism:
    return train(
        [
            mg.Coupling({"A": 2.0, "B": -3.0}),
            mg.Coupling({"C.Rz": 1, "C.Tz": -2.5, "B": 0.5}, name="screw", constant=0.3),
            mg.Coupling({"D": 1.0, "E": 2.0}, name="slides", constant=0.01),
        ],
        units=UNITS,
    )


def faults_of(*couplings) -> str:
    with pytest.raises(mg.DeclarationError) as caught:
        train(couplings)
    return "\n".join(caught.value.faults)


# --- declaring -----------------------------------------------------------------------------------------------------------


def test_freedoms_are_kept_by_their_full_names_and_names_are_filled_in() -> None:
    m = geared()
    assert [c.name for c in m.couplings] == ["g1", "screw", "slides"]
    assert m.couplings[0].terms == (("A.Rz", 2.0), ("B.Rz", -3.0))
    assert m.coupling("screw").coefficients == (1.0, -2.5, 0.5)
    assert m.coupling("g1").constant is None
    named = train([mg.Coupling({"B": 1.0}), mg.Coupling({"A": 1.0}, name="g1"), mg.Coupling({"D": 1.0})])
    assert [c.name for c in named.couplings] == ["g2", "g1", "g3"]


def test_several_couplings_share_a_freedom_and_changed_copies_keep_them() -> None:
    m = train([mg.Coupling({"A": 1.0, "B": 1.0}), mg.Coupling({"A": 1.0, "D": 4.0})])
    for same in (m.replace(drives=["B"]), m.replace(source="x"), m.moved(np.eye(4)), m.with_pair_type("E", "R")):
        assert same.couplings == m.couplings
    assert m.replace(couplings=[]).couplings == ()
    assert m.replace(couplings=[]) != m
    assert pickle.loads(pickle.dumps(m)) == m


@pytest.mark.parametrize(
    ("coupling", "words"),
    [
        (mg.Coupling({"Q": 1.0}), "unknown freedom 'Q'"),
        (mg.Coupling({"S.Rx": 1.0}), "part of a rotation"),
        (mg.Coupling({"C": 1.0}), "2 freedoms"),
        (mg.Coupling({}), "no terms"),
        (mg.Coupling({"A": 0.0}), "other than 0"),
        (mg.Coupling({"A": float("nan")}), "finite number"),
        (mg.Coupling({"A": "much"}), "finite number"),
        (mg.Coupling({"A": 1.0, "A.Rz": 2.0}), "A.Rz twice"),
        (mg.Coupling({"A": 1.0}, constant=float("inf")), "constant"),
        (mg.Coupling({"A": 1.0}, name="B"), "a pair has that name"),
        (mg.Coupling({"A": 1.0}, name=3), "expected a text"),
        (mg.Coupling(5), "expected a mapping"),
        (("A", 1.0), "mg.Coupling"),
    ],
)
def test_a_faulty_coupling_is_told(coupling, words) -> None:
    assert words in faults_of(coupling)


def test_faults_of_couplings_come_together() -> None:
    text = faults_of(mg.Coupling({"A": 0.0}, name="g"), mg.Coupling({"Q": 1.0}, name="g"))
    for words in ("other than 0", "unknown freedom 'Q'", "coupling 'g' is declared 2 times"):
        assert words in text


def test_a_coupling_on_a_freedom_that_vanishes_is_a_fault() -> None:
    with pytest.raises(mg.DeclarationError, match=r"coupling 'screw': unknown freedom 'C\.Tz'"):
        geared().with_pair_type("C", "R")


# --- files and units -----------------------------------------------------------------------------------------------------


def test_a_file_gives_back_the_couplings(tmp_path: Path) -> None:
    m = geared()
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    data = tomllib.loads((tmp_path / "m.toml").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(json_schema()).validate(data)
    data["coupling"][1]["constant_deg"] = data["coupling"][1].pop("constant")
    assert toml.parse(data, "x").coupling("screw").constant == pytest.approx(np.deg2rad(0.3))
    data["coupling"][0]["ratio"] = 1.0
    with pytest.raises(mg.DeclarationError, match="unknown field 'ratio'"):
        toml.parse(data, "x")


def test_units_of_a_sum_of_angles_and_of_a_sum_of_lengths() -> None:
    """A slide beside turns has a coefficient per length; slides alone have a sum that is a length."""
    m = geared().to_units(length="mm")
    assert m.coupling("g1") == geared().coupling("g1")
    assert m.coupling("screw").coefficients == pytest.approx((1.0, -2.5e-3, 0.5))
    assert m.coupling("screw").constant == 0.3
    assert m.coupling("slides").coefficients == (1.0, 2.0)
    assert m.coupling("slides").constant == pytest.approx(10.0)


# --- studies -------------------------------------------------------------------------------------------------------------


def test_numbers_of_couplings_vary_by_name() -> None:
    m = geared()
    names = ["g1.A", "couplings[1].C.Tz", "screw.constant"]
    fields = {name: find_field(m, name) for name in names}
    values = np.array([[2.0, 0.0], [-1.0, -2.0], [0.1, 0.2]])
    made = varied(m, fields, values)  # type: ignore[arg-type]
    assert made.valid().tolist() == [True, False]
    one = made.one(0)
    assert one.coupling("g1").terms == (("A.Rz", 2.0), ("B.Rz", -3.0))
    assert one.coupling("screw").terms == (("C.Rz", 1.0), ("C.Tz", -1.0), ("B.Rz", 0.5))
    assert one.coupling("screw").constant == 0.1
    again = stacked(m, [one, m])
    assert again.one(0) == one
    assert again.one(1) == m


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("g1.constant", "declare constant="),
        ("g1.D", "A.Rz, B.Rz and constant"),
        ("couplings[7].A", "there are 3 couplings"),
    ],
)
def test_numbers_that_a_coupling_lacks_are_told(name: str, words: str) -> None:
    assert words in str(find_field(geared(), name))


# --- equations -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bookkeeping", ["lee", "minimal"])
def test_a_coupling_brings_one_unknown_and_the_balance_stays(bookkeeping: str) -> None:
    m = geared()
    f = mg.formulate(m, bookkeeping)
    mine = [u for u in f.unknowns if u.group == "coupling"]
    assert [(u.name, u.owner, u.couple) for u in mine] == [
        ("M_C(g1)", "g1", True),
        ("M_C(screw)", "screw", True),
        ("F_C(slides)", "slides", False),
    ]
    row = f.ledger().by_kind["coupling"]
    assert (row.count, row.unknowns, row.equations) == (3, 3, 0)
    assert f.ledger().balance == sum(p.type.f for p in m.pairs) - len(m.couplings) - len(m.drives)
    assert "coupling" not in mg.formulate(m.replace(couplings=[]), bookkeeping).ledger().by_kind


def state(m: mg.Mechanism, rng: np.random.Generator, coefficients: tuple[np.ndarray, ...] = ()) -> State:
    """A state of random screws; couples of efforts have no force."""
    efforts = []
    for pair in m.pairs:
        E = rng.normal(size=(6, pair.type.f, 2))
        for j, part in enumerate(pair.type.efforts):
            E[3:, j] *= not part.is_couple
        efforts.append(E)
    reactions = tuple(rng.normal(size=(6, 6 - p.type.f, 2)) for p in m.pairs)
    nothing = np.zeros(0)
    loads = rng.normal(size=(6, len(m.links), 2))
    return State(nothing, nothing, nothing, nothing, reactions, tuple(efforts), (), (), loads, coefficients)


def test_the_multiplier_acts_with_its_coefficient_in_every_freedom() -> None:
    """Column of the multiplier on link n: sum over its freedoms of +-c E, + where n is link b of the pair, - where it is link a."""
    m = geared()
    f = mg.formulate(m, "minimal")
    here = state(m, np.random.default_rng(0))
    A = np.stack([f.assemble(here, position)[0].toarray() for position in range(2)], axis=-1)
    for g, c in enumerate(m.couplings):
        column = A[:, next(i for i, u in enumerate(f.unknowns) if u.owner == c.name)]
        expected = np.zeros((len(m.links), 6, 2))
        for freedom, number in c.terms:
            k, j = m.freedom(freedom)
            for link, sign in ((m.pairs[k].b, 1.0), (m.pairs[k].a, -1.0)):
                expected[m.link_index[link]] += sign * number * here.efforts[k][:, j]
        for row, equation in zip(column, f.equations, strict=True):
            np.testing.assert_allclose(row, expected[equation.link, equation.part], atol=1e-15)
        assert g < 3


def test_coefficients_of_a_state_take_the_place_of_the_declared_ones() -> None:
    m = geared()
    f = mg.formulate(m, "minimal")
    declared = tuple(np.array(c.coefficients)[:, None] for c in m.couplings)
    plain = f.assemble(state(m, np.random.default_rng(0)))[0].toarray()
    same, double = (
        f.assemble(state(m, np.random.default_rng(0), tuple(s * c for c in declared)))[0].toarray() for s in (1, 2)
    )
    at = [u.group == "coupling" for u in f.unknowns]
    np.testing.assert_array_equal(same, plain)
    np.testing.assert_allclose(double[:, at], 2 * plain[:, at])


def test_couplings_are_printed() -> None:
    f = mg.formulate(geared())
    text = " ".join(f.text().split())
    assert "F_C(g1,B.Rz) = -3 e M_C(g1) A_2" in text
    assert "F_C(slides,E.Tz) = 2 F_C(slides) A_5" in text
    assert "- 3 A_2x M_C(g1)" in text
    assert r"\hat{F}_{C(\text{g1,A.Rz})} = 2 \epsilon M_{C(\text{g1})} \hat{A}_{1}" in f.latex()
    column = 1 + next(i for i, u in enumerate(f.unknowns) if u.name == "M_C(screw)")
    cells = [row for row in f.coefficients().rows if row[2] == column]
    assert len({entry for entry, *_ in cells}) == len(cells)
    assert any(value == "0.5 A_2x - A_3x + 2.5 A'0_3x" for *_, value in cells)


def test_couplings_that_say_the_same_twice_have_no_unique_effort() -> None:
    # B = 2/3 A, written twice: any part of the effort may run over either, so that only their sum is known
    pairs = [mg.Pair(n, "R", "f", n.lower(), point=(x, 0, 0), axis=(0, 0, 1)) for n, x in [("A", 0.0), ("B", 1.0)]]
    twice = [mg.Coupling({"A": 2.0, "B": -3.0}, name="g1"), mg.Coupling({"A": 4e4, "B": -6e4}, name="g2")]
    m = mg.Mechanism("gears", pairs=pairs, couplings=twice, drives=["A"], loads=[mg.Effort("B", 3.0)])
    report = mg.check(m)
    assert (report.redundancy, report.determinate) == (1, False)
    assert report.unique["g1"] == report.unique["g2"] == {"effort": False}
    assert all(report.unique["A"].values())
    assert "efforts of the couplings g1, g2 are not unique" in report.verdict
    assert "in the efforts of the couplings alone" in report.text(full=True)
    for engine in ("dense", "sparse"):
        s = mg.solve(m, {"A": [0.0, 0.5]}, engine=engine)
        assert np.isnan([s.coupling("g1").effort, s.coupling("g2").effort]).all()
        np.testing.assert_allclose(s["A"].effort, -2.0, rtol=1e-12)
    once = mg.check(m.replace(couplings=twice[:1]))
    assert once.determinate
    assert once.unique["g1"] == {"effort": True}


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("method", ["loop_wrench", "newton_euler"])
def test_couplings_that_say_the_same_share_alike(method, engine):
    """m1 + 2 m2 = 3 at the wheel; of all such pairs that with the least efforts m1 and 2 m2."""
    pairs = [mg.Pair(k, "R", "frame", k.lower(), point=(i, 0, 0), axis=(0, 0, 1)) for i, k in enumerate("ABD")]
    twice = [mg.Coupling({"A": 1, "B": 1}, name="one"), mg.Coupling({"A": 2, "B": 2}, name="two")]
    m = mg.Mechanism("gears", pairs=pairs, couplings=twice, drives=["A", "D"], loads=[mg.Effort("B", -3)])
    s = mg.solve(m, {"A": 0.0, "D": 0.0}, redundant="minimum_norm", method=method, engine=engine)
    assert s.coupling("one").effort == pytest.approx(1.5, abs=1e-12)
    assert s.coupling("two").effort == pytest.approx(0.75, abs=1e-12)
