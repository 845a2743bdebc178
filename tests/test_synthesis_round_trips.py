"""Round trips: random mechanisms of many topologies are among the answers to their own motion."""

from collections.abc import Mapping

import numpy as np
import pytest
from ladder import geared_five_bar
from scipy.spatial.transform import Rotation

import mechgraph as mg

SLOW = pytest.mark.slow
FUNCTIONS = [
    ("RRRR", "B.point.x C.point.y"),
    ("RRRP", "B.point.x C.point.y"),
    ("RRPR", "B.point.x B.point.y"),
    ("RPRR", "C.point.x C.point.y"),
    ("PRRP", "B.point.x C.point.y"),
    ("PRRR", "B.point.x C.point.y"),
    ("R-S-S-R", "B.point.x C.point.y"),
    ("P-S-S-P", "B.point.x C.point.y"),
    *(
        pytest.param(*case, marks=SLOW)
        for case in (
            ("R-S-S-P", "B.point.x C.point.y"),
            ("R-S-C-R", "B.point.x C.point.y"),
            ("R-C-S-R", "B.point.x C.point.y"),
            ("R-S-R-C", "B.point.x C.point.y"),
            ("R-R-S-C", "B.point.x C.point.y"),
            ("R-P-S-C", "B.axis.x C.point.y"),
            ("R-S-U-R", "B.point.x C.point.y"),
            ("R-U-S-R", "B.point.x C.point.y"),
            ("R-C-C-C", "B.axis.x C.axis.y"),
            ("R-Sp-R", "B.point.x B.axis.y"),
            ("R-Sp-P", "B.point.x B.axis.y"),
            ("R-Sg-C", "B.point.x B.axis.y"),
            ("R-Cp-C", "C.axis.x C.axis.y"),
            ("R-E-U-R", "B.axis.x C.point.y"),
            ("R-E-C-R", "B.axis.x C.axis.y"),
            ("RRRRRRR 01 12 23 03 34 45 05", "B.point.x F.point.y"),
            ("RRRRRRR 01 12 23 03 24 45 05", "B.point.x F.point.y"),
        )
    ),
]
"""Types of pairs, in space with dashes, of a loop or between the links named (Watt, Stephenson); and which numbers are sought."""


def random_mechanism(name: str, rng: np.random.Generator) -> mg.Mechanism:
    """Pairs A, B, ... at random places about a circle."""
    types, *joined = name.split()
    planar, symbols = "-" not in types, types.split("-") if "-" in types else list(types)
    n, pairs = len(symbols), list[mg.Pair]()
    joined = joined or [f"{i}{(i + 1) % n}" for i in range(n)]
    for i, (symbol, (a, b)) in enumerate(zip(symbols, joined, strict=True)):
        point = np.array([np.cos(2 * np.pi * i / n), np.sin(2 * np.pi * i / n), 0]) + rng.uniform(-0.3, 0.3, 3)
        axis = rng.normal(size=3)
        where = {} if symbol == "S" or (planar and symbol == "R") else {"axis": axis * (1, 1, not planar)}
        if symbol in ("U", "Cp"):
            where["second"] = np.cross(axis, rng.normal(size=3))
        pairs.append(mg.Pair("ABCDEFG"[i], symbol, f"link{a}", f"link{b}", point=point * (1, 1, not planar), **where))
    return mg.Mechanism(name, pairs=pairs, planar=planar, frame="link0")


def changed(m: mg.Mechanism, numbers: Mapping[str, float]) -> mg.Mechanism:
    """A mechanism with other components of points and axes."""
    for name, value in numbers.items():
        pair, field, at = name.split(".")
        vector = np.array(getattr(m.pair(pair), field), dtype=float)
        vector["xyz".index(at)] = value
        m = m.replace(pairs=[p.replace(**{field: vector}) if p.name == pair else p for p in m.pairs])
    return m


def found_again(
    own: mg.Mechanism, task: object, unknown: list[str], rng: np.random.Generator, **options: object
) -> bool:
    """Whether a mechanism is among the answers where other numbers than its own are declared."""
    values = np.array(
        [getattr(own.pair(p), field)["xyz".index(at)] for p, field, at in (n.split(".") for n in unknown)]
    )
    declared = changed(own, dict(zip(unknown, values + rng.uniform(0.03, 0.08, len(values)), strict=True)))
    s = mg.synthesize(declared, task, unknown, **options)
    return bool(np.abs(s.values - values).max(axis=1).min(initial=1.0) < 1e-8)


@pytest.mark.parametrize(("name", "unknown"), FUNCTIONS)
def test_a_random_mechanism_is_among_those_that_do_its_own_function(name: str, unknown: str) -> None:
    rng, angles = np.random.default_rng(1), np.array([0.0, 0.2, 0.4])
    while True:
        own = random_mechanism(name, rng)
        s = mg.kinematics(own, {"A": angles}, on_reach="flag")
        if (s.status == "ok").all():
            break
    output = own.pairs[-1].freedom_names[0]
    task = mg.function("A", output, np.column_stack([angles, s[output[0]].position[:, 0]]))
    assert found_again(own, task, unknown.split(), rng)


def displacement(pair: mg.Pair, rng: np.random.Generator) -> np.ndarray:
    """A random motion that a pair allows, in the global frame."""
    out, axis = np.eye(4), np.asarray(pair.axis if pair.type.symbol != "S" else rng.normal(size=3))
    turns, slides = {"P": (0, 1), "C": (1, 1)}.get(pair.type.symbol, (1, 0))
    angle, way = rng.uniform(0.2, 0.8, 2) * (turns, slides)
    out[:3, :3] = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    out[:3, 3] = np.asarray(pair.point) - out[:3, :3] @ pair.point + way * axis
    return out


@pytest.mark.parametrize(
    ("name", "unknown", "further"),
    [
        ("RR 01 12", "B.point.x B.point.y", 2),
        ("PR 01 12", "B.point.x B.point.y", 2),
        ("R-S 01 12", "B.point.x B.point.y", 1),
        pytest.param("S-S 01 12", "B.point.x B.point.y B.point.z", 3, marks=SLOW),
        pytest.param("C-S 01 12", "B.point.x B.point.y", 2, marks=SLOW),
        pytest.param("R-C 01 12", "B.point.x B.axis.x B.axis.y", 1, marks=SLOW),
        pytest.param("C-C 01 12", "B.point.x B.axis.y", 1, marks=SLOW),
    ],
)
def test_a_random_chain_is_among_those_that_lead_a_link_through_its_own_places(
    name: str, unknown: str, further: int
) -> None:
    rng = np.random.default_rng(2)
    own = random_mechanism(name, rng)
    places = [np.linalg.multi_dot([np.eye(4), *(displacement(p, rng) for p in own.pairs)]) for _ in range(further)]
    assert found_again(own, mg.poses("link2", [np.eye(4), *places]), unknown.split(), rng)


def groove() -> tuple[mg.Mechanism, str, str]:
    """A pin that slides along y and stays in the circular groove of a disc."""
    at = (0.1, 0.2 + np.sqrt(0.96), 0)
    circle = mg.Curve.circle(radius=1.0, center=(0.3, 0.2, 0))
    pairs = [
        mg.Pair("A", "R", "frame", "disc", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("K", "Ps", "disc", "pin", curve=circle, point=at, closed="form"),
        mg.Pair("F", "P", "frame", "pin", point=at, axis=(0, 1, 0)),
    ]
    return mg.Mechanism("groove", pairs=pairs, drives=["A"]), "F", "A.point.x A.point.y"


def sphere() -> tuple[mg.Mechanism, str, str]:
    """A slide on a crank, with a tip that stays on a sphere."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0.1, 0, 0), axis=(0, 1, 0)),
        mg.Pair("B", "P", "crank", "slide", point=(0.1, 0, 0), axis=(0.2, 0, 0.4)),
        mg.Pair("K", "Sp", "frame", "slide", surface=mg.Surface.sphere(radius=0.5), point=(0.3, 0, 0.4)),
    ]
    return mg.Mechanism("sphere", pairs=pairs, drives=["A"]), "B", "A.point.x A.point.z"


@pytest.mark.parametrize("made", [groove, sphere])
def test_a_mechanism_with_a_curve_or_surface_is_found_again_by_a_fit(made) -> None:
    own, output, unknown = made()
    angles = np.linspace(0.0, 2.0, 7)
    task = mg.function("A", output, np.column_stack([angles, mg.kinematics(own, {"A": angles})[output].position[:, 0]]))
    with pytest.raises(mg.DeclarationError, match="pairs K: curves and surfaces are made of pieces"):
        mg.synthesize(own, task, unknown.split())
    assert found_again(own, task, unknown.split(), np.random.default_rng(0), fit="least_squares", starts=1)
    field = "K.curve.radius" if made is groove else "K.surface.radius"
    shape = field.split(".")[1]
    true = getattr(own.pair("K"), shape)
    larger = own.pair("K").reshaped(**{shape: true.replace(radius=1.1 * true.radius)})
    off = own.replace(pairs=[larger if p.name == "K" else p for p in own.pairs])
    s = mg.synthesize(off, task, [field, unknown.split()[0]], fit="least_squares", starts=1)
    assert s.values[0] == pytest.approx([true.radius, own.pair("A").point[0]], abs=1e-8)
    assert does(s[0], task) < 1e-8


def does(m: mg.Mechanism, task: object) -> float:
    """By how much the output of a mechanism fails to be the function asked of it, by its kinematics alone."""
    angles, wanted = np.asarray(task.pairs, dtype=float).T
    freedom = m.full_name(task.output)
    pair = freedom.partition(".")[0]
    moved = mg.kinematics(m, {task.input: angles + m.start.get(m.full_name(task.input), 0.0)})[pair].position
    turned = moved.reshape(len(angles), -1)[:, m.pair(pair).freedom_names.index(freedom)]
    return float(np.abs(turned - turned[0] - (wanted - wanted[0])).max())


# --- numbers that are no places of pairs ---------------------------------------------------------------------------------


def press(pitch: float = 0.2, C: float = 0.9) -> mg.Mechanism:
    """A screw lifts a nut, which tips a rocker by a rod."""
    pairs = [
        mg.Pair("A", "H", "frame", "nut", point=(0, 0, 0), axis=(0, 0, 1), pitch=pitch),
        mg.Pair("B", "S", "nut", "rod", point=(0.3, 0, 0)),
        mg.Pair("C", "S", "rod", "rocker", point=(C, 0.2, 0.8)),
        mg.Pair("D", "R", "frame", "rocker", point=(1.5, 0, 0), axis=(0, 1, 0)),
    ]
    return mg.Mechanism("press", pairs=pairs, drives=["A"])


def geared(constant: float = 0.4, ratio: float = 2.0) -> mg.Mechanism:
    """A five-bar whose second crank turns half as fast as the first, from another angle."""
    m = geared_five_bar()
    return m.replace(couplings=[mg.Coupling({"A": -1, "E": ratio}, name="g", constant=constant)])


def slide(constant: float = 0.7) -> mg.Mechanism:
    """A slider-crank, and a gauge that stands off the slider by a constant."""
    arm = mg.Marker((1, 0, 0))
    pairs = [
        mg.Pair("A", "R", "frame", "crank", on_a=mg.Marker((0, 0, 0)), on_b=mg.Marker((0, 0, 0))),
        mg.Pair("B", "R", "crank", "rod", on_a=arm, on_b=mg.Marker((0, 0, 0))),
        mg.Pair("C", "R", "rod", "slider", on_a=mg.Marker((3, 0, 0)), on_b=mg.Marker((0, 0, 0))),
        mg.Pair(
            "D", "P", "frame", "slider", on_a=mg.Marker((0, 0, 0), (1, 0, 0)), on_b=mg.Marker((0, 0, 0), (1, 0, 0))
        ),
        mg.Pair("F", "P", "frame", "gauge", on_a=mg.Marker((0, 1, 0), (1, 0, 0)), on_b=mg.Marker((0, 0, 0), (1, 0, 0))),
    ]
    off = mg.Coupling({"F": 1, "D": -1}, name="g", constant=constant)
    begin = {"A": 0.5, "B": -0.66, "C": 0.16, "D": 3.8, "F": 3.8 + constant}
    return mg.Mechanism("gauge", pairs=pairs, drives=["A"], planar=True, couplings=[off], start=begin)


def bars(*length: float) -> mg.Mechanism:
    """A four-bar as a chain, closed at 0.8 with lengths 1, 3, 2.5, 3.2."""
    start = {"O1": 0.8, "O2": 1.841215382371239, "O3": 1.540863661239548, "O4": 2.1011062635688}
    return mg.chain("RRRR", twist=[0] * 4, length=length, offset=[0] * 4).replace(start=start)


def test_a_screw_has_the_two_pitches_with_which_a_rod_keeps_its_length() -> None:
    """With ``p`` the pin of the nut is at ``(0.3 cos a, 0.3 sin a, p a)``: a quadratic for every length of the rod."""
    angles = np.array([0.0, 0.6])
    turned = mg.kinematics(press(), {"A": angles})["D"].position[:, 0]
    s = mg.synthesize(press(0.3), mg.function("A", "D", np.column_stack([angles, turned])), ["A.pitch"])
    pin, tip = np.array([0.3, 0, 0]), np.array([0.9, 0.2, 0.8])
    D = np.array([1.5, 0, 0])
    tip_then = D + Rotation.from_rotvec([0, turned[1], 0]).apply(tip - D)
    apart = tip_then - Rotation.from_rotvec([0, 0, angles[1]]).apply(pin)
    # over p: |apart - p a z|^2 = |tip - pin|^2
    wanted = np.roots([angles[1] ** 2, -2 * angles[1] * apart[2], apart @ apart - (tip - pin) @ (tip - pin)])
    assert (s.total, s.completeness) == (2, "tested")
    assert np.sort(s.field("A.pitch")) == pytest.approx(np.sort(wanted.real), abs=1e-9)
    assert all(one is not None and one.proved and one.apart > 0.1 for one in s.certificates)
    task = mg.function("A", "D", np.column_stack([angles, turned]))
    assert max(does(one, task) for one in s) < 1e-10
    assert (s.residual < 1e-12).all()


def test_a_second_crank_has_the_two_phases_with_which_a_dyad_closes() -> None:
    """Where A stands and C is bent, B and D are at a known distance: D lies on two circles. Whole turns count once."""
    q = mg.kinematics(geared(), {"A": 0.0})["C"].position.item()
    s = mg.synthesize(geared(0.1), mg.positions([{"A": 0.0, "C": q}, {}]), ["g.constant"])
    B, C, D, E = (complex(*p) for p in ((0.2, 0.9), (1.5, 1.5), (2.8, 1.1), (3, 0)))
    across, crank = abs(C - B + np.exp(1j * q) * (D - C)), D - E
    # |E + r exp(i e) - B| of the angle e from where the second crank is declared
    toward = B - E
    cosine = (abs(toward) ** 2 + abs(crank) ** 2 - across**2) / (2 * abs(toward) * abs(crank))
    angles = np.angle(toward / crank) + np.arccos(cosine) * np.array([1, -1])
    assert (s.total, s.completeness) == (2, "tested")
    assert np.sort(np.exp(1j * s.field("g.constant") / 2)) == pytest.approx(np.sort(np.exp(1j * angles)), abs=1e-9)
    assert all(one is not None and one.proved and one.apart > 0.1 for one in s.certificates)
    # of each the second crank begins within half a turn, and does so with its own constant
    for one in s:
        assert mg.kinematics(one, {"A": 0.0})["C"].position.item() == pytest.approx(q, abs=1e-10)
        assert 2 * one.start["E.Rz"] == pytest.approx(one.couplings[0].constant, abs=1e-12)
        assert abs(one.start["E.Rz"]) <= np.pi


def test_turns_of_all_wheels_of_a_train_count_once() -> None:
    """``E = (F + .2) / 2`` of an idler with ``F = (A + k) / 3``: E has turned once where F has twice and ``k`` has grown by ``12 pi``."""
    idler = mg.Pair("F", "R", "frame", "idler", point=(5, 0))
    m = geared().replace(links=[*geared().links, mg.Link("idler")], pairs=[*geared().pairs, idler])

    def train(constant: float) -> mg.Mechanism:
        first = mg.Coupling({"A": -1, "F": 3}, name="g", constant=constant)
        return m.replace(couplings=[first, mg.Coupling({"F": -1, "E": 2}, name="h", constant=0.2)])

    q = mg.kinematics(train(0.3), {"A": 0.0})["C"].position.item()
    s = mg.synthesize(train(0.1), mg.positions([{"A": 0.0, "C": q}, {}]), ["g.constant"])
    assert (s.total, s.completeness, len(s)) == (2, "tested", 2)
    assert np.abs(s.field("g.constant") - 0.3).min() < 1e-9
    for one in s:
        assert mg.kinematics(one, {"A": 0.0})["C"].position.item() == pytest.approx(q, abs=1e-10)


def test_a_gauge_has_the_two_constants_of_both_ways_in_which_the_slider_closes() -> None:
    """``F - k = r cos a +- (l^2 - r^2 sin^2 a)^(1/2)``."""
    s = mg.synthesize(slide(0.2), mg.positions([{"A": 0.5, "F": 4.0}, {}]), ["g.constant"])
    root = np.sqrt(9 - np.sin(0.5) ** 2)
    assert s.total == 2
    assert np.sort(s.field("g.constant")) == pytest.approx([4 - np.cos(0.5) - root, 4 - np.cos(0.5) + root], abs=1e-9)
    assert all(one is not None and one.proved and one.apart > 0.1 for one in s.certificates)
    for one in s:
        assert mg.kinematics(one, {"A": 0.5})["F"].position.item() == pytest.approx(4.0, abs=1e-10)


def test_lengths_of_a_chain_are_those_of_freudensteins_equation() -> None:
    """``|e^(i A) + a_3 e^(-i D) + a_4| = a_2``: over ``2 a_3 a_4`` linear in three numbers, of which lengths follow but for signs."""
    own, A = bars(1.0, 3.0, 2.5, 3.2), np.array([0.8, 1.0, 1.25])
    D = mg.kinematics(own, {"O1": A})["O4"].position[:, 0]
    rows = [{"O1": a, "O4": d} for a, d in zip(A, D, strict=True)]
    s = mg.synthesize(bars(1.0, 3.1, 2.6, 3.3), mg.positions(rows), ["length[1]", "length[2]", "length[3]"])
    K, over_a4, over_a3 = np.linalg.solve(np.column_stack([np.ones(3), np.cos(A + D), np.cos(A)]), -np.cos(D))
    a3, a4 = 1.0 / over_a3, 1.0 / over_a4
    wanted = np.abs([np.sqrt(1.0 + a3**2 + a4**2 - 2.0 * a3 * a4 * K), a3, a4])
    assert wanted == pytest.approx([3.0, 2.5, 3.2], abs=1e-9)
    assert np.abs(s.values) == pytest.approx(np.tile(wanted, (len(s), 1)), abs=1e-9)
    for one in s:
        assert np.abs(mg.kinematics(one, {"O1": A})["O4"].position[:, 0] - D).max() < 1e-10


def screwed() -> tuple[mg.Mechanism, mg.Mechanism, object, dict[str, float]]:
    angles = np.linspace(0, 1.5, 6)
    turned = mg.kinematics(press(), {"A": angles})["D"].position[:, 0]
    return (
        press(0.3, 1.0),
        press(),
        mg.function("A", "D", np.column_stack([angles, turned])),
        {"A.pitch": 0.2, "C.point.x": 0.9},
    )


def of_gears() -> tuple[mg.Mechanism, mg.Mechanism, object, dict[str, float]]:
    angles = np.linspace(0, -0.7, 6)
    tip = mg.kinematics(geared(), {"A": angles}).link("rod").at("tip").position[:, :2]
    return geared(0.3, 1.9), geared(), mg.path("rod.tip", tip, at={"A": angles}), {"g.E": 2.0, "g.constant": 0.4}


def twisted(*twist: float) -> mg.Mechanism:
    """A closed RCCC chain."""
    start = {"O1": 0.7, "O2.Rz": 1.35, "O2.Tz": -0.07, "O3.Rz": 1.79, "O3.Tz": -1.67, "O4.Rz": 1.78, "O4.Tz": -1.67}
    return mg.chain("RCCC", twist=twist, length=[1, 2, 1.5, 1.8], offset=[0, 0, 0, 0.3]).replace(start=start)


def of_twists() -> tuple[mg.Mechanism, mg.Mechanism, object, dict[str, float]]:
    own, angles = twisted(0.5, 0.9, 1.1, 0.7), np.linspace(0.7, 1.5, 5)
    turned = mg.kinematics(own, {"O1": angles})["O4"].position[:, 0]
    rows = [{"O1": a, "O4.Rz": turn} for a, turn in zip(angles, turned, strict=True)]
    return twisted(0.5, 0.95, 1.1, 0.75), own, mg.positions(rows), {"twist[1]": 0.9, "twist[3]": 0.7}


@pytest.mark.parametrize("made", [screwed, of_gears, of_twists])
@pytest.mark.parametrize("fit", ["least_squares", "minimax"])
def test_a_mechanism_is_found_again_by_numbers_that_are_no_places(made, fit) -> None:
    declared, own, task, truth = made()
    s = mg.synthesize(declared, task, list(truth), fit=fit, starts=1)
    assert s.values[0] == pytest.approx(list(truth.values()), abs=1e-7)
    drive, last = own.drives[0].freedom, own.pairs[-1].name
    begin = s[0].start.get(drive, 0.0)
    a, b = (mg.kinematics(m, {drive: begin + np.array([0.0, 0.1])})[last].position for m in (own, s[0]))
    assert a == pytest.approx(b, abs=1e-6)


def test_beside_the_best_pitch_and_radius_a_function_that_none_has_is_missed_by_more() -> None:
    """A gradient that is wrong stops beside the optimum."""
    angles = np.linspace(0, 1.5, 6)
    pairs = np.column_stack(
        [angles, mg.kinematics(press(), {"A": angles})["D"].position[:, 0] + 0.01 * np.cos(9 * angles)]
    )
    s = mg.synthesize(press(0.3), mg.function("A", "D", pairs - pairs[0]), ["A.pitch"], fit="least_squares", starts=1)
    pitch = s.values[0, 0]
    least, below, above = (
        np.linalg.norm(mg.kinematics(press(p), {"A": angles})["D"].position[:, 0] - (pairs[:, 1] - pairs[0, 1]))
        for p in (pitch, pitch - 1e-4, pitch + 1e-4)
    )
    assert least < below
    assert least < above
    # of a parabola, so that half of the gap in slope is what the optimum is off by
    assert abs(above - below) < 1e-3 * (above + below - 2 * least)


def test_a_sweep_goes_over_pitches() -> None:
    angles = np.array([0.0, 0.6])
    turned = mg.kinematics(press(), {"A": angles})["D"].position[:, 0]
    task = mg.function("A", "D", np.column_stack([angles, turned]))
    for s, pitch in zip(
        mg.synthesize(press(C=1.0), task, ["C.point.x"], sweep={"A.pitch": [0.2, 0.3]}), (0.2, 0.3), strict=True
    ):
        assert s[0].pair("A").pitch == pytest.approx(pitch, abs=1e-14)
        assert does(s[0], task) < 1e-10


def test_a_start_that_is_not_zero_is_a_row_like_the_others() -> None:
    """Where pairs are placed by points the mechanism is closed at zero alone, whatever the points are."""
    m = geared_five_bar().replace(couplings=[mg.Coupling({"A": -1, "E": 2}, constant=0.4)])
    begin = mg.kinematics(m, {"A": 0.3})
    start = {name: begin[name].position.item() for name in "ABCDE"}
    rows = [{"A": 0.3, "C": start["C"]}, {"A": 0.5, "C": mg.kinematics(m, {"A": 0.5})["C"].position.item()}]
    s = mg.synthesize(m.replace(start=start), mg.positions(rows), ["D.point.x", "D.point.y"])
    assert np.abs(s.values - [2.8, 1.1]).max(axis=1).min() < 1e-9
    for one in s:
        for row in rows:
            assert mg.kinematics(one, {"A": row["A"]})["C"].position.item() == pytest.approx(row["C"], abs=1e-10)


def test_numbers_that_cannot_be_sought_are_told_with_their_reason() -> None:
    spur = geared_five_bar().replace(couplings=[mg.SpurGears("g", "A", "E", teeth=(20, 40), internal=True)])
    path = mg.path("rod.tip", [[1.5, 1.5], [1.4, 1.6]], at={"A": [0, -0.2]})
    with pytest.raises(mg.DeclarationError) as caught:
        mg.synthesize(spur, path, ["g.teeth.b", "g.helix_angle"], fit="least_squares")
    assert [fault.split(":")[1].split(";")[0] for fault in caught.value.faults] == [
        " cannot change by a little",
        " stands in no equation of closure",
    ]
    with pytest.raises(mg.DeclarationError, match="coupling g: ties an angle to a length or by an unknown ratio"):
        mg.synthesize(geared(), mg.positions([{"A": 0.0}, {"A": 0.2, "C": -0.4}]), ["g.E"])
