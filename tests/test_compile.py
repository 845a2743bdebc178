"""A mechanism that stays hot: what a call gives beside ``solve``, its state, parameters, derivatives and refusals."""

import copy
import pickle
import threading
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import mechgraph as mg

pytestmark = pytest.mark.usefixtures("compiled")

CARRIED = ("four-bar", "rcsr", "7r", "rcsr-csr", "bricard-cube", "rchch", "r-sp-r", "rssr", "slider-crank")


def beside(c: mg.Compiled, m: mg.Mechanism, q: np.ndarray, rates: tuple[float, float] = (2.0, 0.5)) -> float:
    """The worst difference to ``solve`` at positions ``(n, d)``, over what is largest."""
    motions = {name: mg.Motion(q[:, i], *rates) for i, name in enumerate(c.drives)}
    s = mg.solve(m, motions, engine="dense")
    efforts = c(q, *rates)
    assert (c.status == "ok").all()
    pairs = [(c.reaction(p.name), s[p.name].reaction) for p in m.pairs] + [
        (c.position(p.name), s[p.name].position) for p in m.pairs
    ]
    pairs += [(c.link(link.name), s.link(link.name).pose) for link in m.links]
    pairs += [
        (efforts[:, i], s[m.pairs[m.freedom(n)[0]].name].effort[:, m.freedom(n)[1]]) for i, n in enumerate(c.drives)
    ]
    for mine, theirs in pairs:
        assert (np.isnan(mine) == np.isnan(theirs)).all()
    return max(
        np.nanmax(np.abs(mine - theirs), initial=0) / np.nanmax(np.abs(theirs), initial=1.0) for mine, theirs in pairs
    )


@pytest.mark.parametrize("name", CARRIED)
def test_every_result_is_that_of_solve(name):
    m = mg.load(name)
    c = mg.compile(m)
    assert beside(c, m, c.tables.home + np.linspace(0.0, 0.1, 4)[:, None]) < 1e-11


def test_several_drives():
    m = mg.Mechanism("arm", [mg.Link("frame"), mg.Link("a", 2.0, (0.5, 0, 0)), mg.Link("b", 1.0, (1.4, 0, 0))], [
        mg.Pair("A", "R", "frame", "a", point=(0, 0, 0), axis=(0, 0, 1)), mg.Pair("B", "C", "a", "b", point=(1, 0, 0), axis=(0, 0.6, 0.8)),
    ], drives=["A", "B.Rz", "B.Tz"], loads=[mg.Gravity((0, -9.81, 0))])  # fmt: skip
    c = mg.compile(m)
    assert c.drives == ("A.Rz", "B.Rz", "B.Tz")
    assert beside(c, m, np.array([[0.1, 0.2, 0.3], [0.5, -0.2, 0.1]])) < 1e-12
    assert c([0.1, 0.2, 0.3]).shape == (3,)


def test_passive_freedoms():
    """Where a passive body stands hangs on the way there, over which no parameter is followed: it has no derivative."""
    m = mg.load("rssr")
    c = mg.compile(m)
    assert beside(c, m, c.tables.home + np.linspace(0.5, 7.0, 4)[:, None]) < 1e-10
    with pytest.raises(mg.DeclarationError, match="hangs on the whole way"):
        c.gradient(f"{c.drives[0]}.effort", ["coupler.mass"])
    with pytest.raises(mg.DeclarationError, match="passive freedoms, which no motion under efforts holds"):
        c.write("rssr.c", inputs="efforts")


def test_calls_go_on_from_the_last_and_back_to_the_start():
    m = mg.load("four-bar")
    c = mg.compile(m)
    begin = c.tables.home[0]
    first = c(float(begin), 1.0, 0.0)
    turn = [c(begin + q, 1.0)[0] for q in np.linspace(0.2, 2 * np.pi, 40)]
    assert c.position("A")[0] == pytest.approx(begin + 2 * np.pi, abs=1e-12)
    assert turn[-1] == pytest.approx(first[0], rel=1e-9)
    c.start()
    assert c.position("A")[0] == pytest.approx(begin)
    s = mg.solve(m, {"A": mg.Motion(begin + np.linspace(0.2, 2 * np.pi, 40), 1.0)}, engine="dense")
    np.testing.assert_allclose(turn, s["A"].effort[:, 0], rtol=1e-9)


def test_a_refused_call_says_why_and_keeps_the_last_good_state():
    m = mg.load("rcsr")
    c = mg.compile(m)
    good = c(2.8)
    assert np.isnan(c(4.0)).all()  # beyond the end of its reach, 3.58
    assert c.status in ("not certified", "near a singular position")
    assert np.isnan(c.reaction("O1")).all()
    assert np.isnan(c.link("link1")).all()
    assert np.isnan(c.gradient("O1.effort", ["length[1]"])).all()
    np.testing.assert_allclose(c(2.8), good, rtol=1e-12)
    table = c(np.array([[2.8], [4.0], [2.9]]))
    assert list(c.status == "ok") == [True, False, True]
    assert np.isnan(table[1]).all()
    assert np.isfinite(table[[0, 2]]).all()
    assert np.isnan(c.link("link1")[1]).all()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (((0.1, 0.2),), r"q has the shape \(2,\); expected \(1,\) or \(n, 1\), for A.Rz"),
        ((np.zeros((2, 2)),), "shape"),
        ((0.1, (1.0, 2.0)), "velocity and acceleration"),
        ((float("nan"),), "not finite"),
        (([0.1], float("inf")), "not finite"),
        (("0.1",), "expected numbers"),
        ((None,), "expected numbers"),
        ((1j,), "expected numbers"),
    ],
)
def test_wrong_calls(arguments, said):
    c = mg.compile(mg.load("four-bar"))
    good = c(0.5)
    with pytest.raises(mg.DeclarationError, match=said):
        c(*arguments)
    np.testing.assert_array_equal(c(0.5), good)


def test_quantities_are_converted():
    pint = pytest.importorskip("pint")
    u = pint.UnitRegistry()
    c = mg.compile(mg.load("four-bar"))
    plain = c(np.deg2rad(30.0), 2.0)
    np.testing.assert_allclose(c(30.0 * u.degree, 2000.0 / u.second / 1000.0), plain, rtol=1e-12)
    np.testing.assert_allclose(c(u.Quantity([30.0], "deg"), u.Quantity(360 / np.pi, "deg/s")), plain, rtol=1e-12)
    with pytest.raises(mg.DeclarationError, match=r"q = .*m.*expected numbers"):
        c(30.0 * u.meter)


def test_unknown_names():
    c = mg.compile(mg.load("four-bar"))
    for wrong in (
        lambda: c.reaction("no"), lambda: c.position("no"), lambda: c.link("no"), lambda: c.parameters["no"], lambda: c.parameters[3],
        lambda: c.gradient("no.effort", ["coupler.mass"]), lambda: c.gradient("B.effort", ["coupler.mass"]),
        lambda: c.gradient(None, []), lambda: c.gradient("A.effort", ["no"]), lambda: c.parameters.__setitem__("coupler.mass", "1"),
        lambda: c.parameters.__setitem__("coupler.mass", float("nan")), lambda: c.parameters.__setitem__("no", 1.0),
    ):  # fmt: skip
        with pytest.raises(mg.DeclarationError):
            wrong()
    with pytest.raises(mg.DeclarationError, match=r"mass = -1\.0: expected a number not below 0"):
        c.parameters["coupler.mass"] = -1.0


def test_numbers_that_are_possible_only_together():
    """No inertia has one of its moments larger than the other two together; all of them may be a hundred times as large."""
    c = mg.compile(mg.load("four-bar"))
    names = [f"rocker.inertia.{entry}" for entry in ("xx", "yy", "zz", "xy")]
    with pytest.raises(mg.DeclarationError, match="two principal moments of inertia must reach the third"):
        c.parameters[names[2]] = 0.07
    assert not c.parameters.wanted
    c.parameters.update({name: 100.0 * c.parameters[name] for name in names})
    np.testing.assert_allclose(c(0.3, 10.0), mg.compile(c.tables.changed(c.parameters.wanted))(0.3, 10.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "changes"),
    [("7r", {"length[2]": 1.02, "twist[1]": 0.98}), ("four-bar", {"B.point.x": 1.1, "coupler.mass": 3.0})],
)
def test_parameters_in_place(name, changes):
    m = mg.load(name)
    c = mg.compile(m)
    c(c.tables.home + 0.2)
    for number, factor in changes.items():
        c.parameters[number] = factor * c.parameters[number]
    changed = c.tables.changed(dict(c.parameters.wanted))
    assert changed != m
    at = c.tables.home + np.array([[0.2], [0.3]])
    assert beside(c, changed, at) < 1e-9
    c.start()
    assert beside(c, changed, c.tables.home[None] + 0.0) < 1e-9


def test_parameters_that_cannot_be_reached_are_refused():
    c = mg.compile(mg.load("rcsr"))
    good, before = c(2.8), c.parameters["length[2]"]
    c.parameters["length[2]"] = 40.0 * before
    assert np.isnan(c(2.8)).all()
    assert c.status != "ok"
    c.parameters["length[2]"] = before
    np.testing.assert_allclose(c(2.8), good, rtol=1e-9)


def test_gradient_is_exact():
    """Slider-crank at rest, A at 0, force F on the slider: torque F dx/dq with x = r cos q + sqrt(l^2 - r^2 sin^2 q)."""
    r, length, force = 0.3, 0.9, 7.0
    m = mg.Mechanism("press", [mg.Link("frame"), mg.Link("crank"), mg.Link("rod"), mg.Link("slider")], [
        mg.Pair("A", "R", "frame", "crank", on_a=mg.Marker((0, 0, 0), (0, 0, 1)), on_b=mg.Marker((0, 0, 0), (0, 0, 1))),
        mg.Pair("B", "R", "crank", "rod", on_a=mg.Marker((r, 0, 0), (0, 0, 1)), on_b=mg.Marker((0, 0, 0), (0, 0, 1))),
        mg.Pair("C", "R", "rod", "slider", on_a=mg.Marker((length, 0, 0), (0, 0, 1)), on_b=mg.Marker((0, 0, 0), (0, 0, 1))),
        mg.Pair("D", "P", "frame", "slider", on_a=mg.Marker((0, 0, 0), (1, 0, 0)), on_b=mg.Marker((0, 0, 0), (1, 0, 0))),
    ], drives=["A"], loads=[mg.Wrench("slider", force=(force, 0, 0), point=(0, 0, 0))], start={"D": r + length})  # fmt: skip
    c = mg.compile(m)
    q = 0.7
    with mpmath.workdps(40):

        def x(q, r, length):
            return r * mpmath.cos(q) + mpmath.sqrt(length**2 - (r * mpmath.sin(q)) ** 2)

        at = (mpmath.mpf(q), mpmath.mpf(r), mpmath.mpf(length))
        torque = -force * mpmath.diff(x, at, (1, 0, 0))
        slopes = [float(-force * mpmath.diff(x, at, n)) for n in ((1, 1, 0), (1, 0, 1))]
        stroke = [float(mpmath.diff(x, at, n)) for n in ((0, 1, 0), (0, 0, 1))]
    assert c(q)[0] == pytest.approx(float(torque), rel=1e-12)
    names = ["B.on_a.point.x", "C.on_a.point.x"]
    np.testing.assert_allclose(c.gradient("A.effort", names), slopes, rtol=1e-11)
    np.testing.assert_allclose(c.gradient("D.position", names), stroke, rtol=1e-11)
    assert c.gradient("C.reaction", names).shape == (6, 2)
    assert c.gradient("A.effort", ["loads[0].force.x"])[0] == pytest.approx(float(torque) / force, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "number", "output"),
    [
        ("rcsr", "length[1]", "O3.position"),
        ("rcsr-csr", "O2.on_a.point.x", "O1.effort"),
        ("7r", "twist[1]", "O3.reaction"),
    ],
)
def test_gradient_beside_differences(name, number, output):
    c = mg.compile(mg.load(name))
    q, middle = c.tables.home + 0.05, c.parameters[number]

    def value(p):
        c.parameters[number] = p
        effort = c(q, 1.0, 0.3)
        return (
            effort[0] if output.endswith("effort") else getattr(c, output.rpartition(".")[2])(output.partition(".")[0])
        )

    h = 2e-3
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    slope = sum(w * (value(middle + k * h) - value(middle - k * h)) for k, w in enumerate(weights, 1)) / h
    value(middle)
    np.testing.assert_allclose(c.gradient(output, [number])[..., 0], slope, rtol=1e-8, atol=1e-8 * np.abs(slope).max())


def test_copies_run_in_threads():
    c = mg.compile(mg.load("7r"))
    c(c.tables.home + 0.1)
    q = c.tables.home + np.linspace(0.1, 1.0, 50)[:, None]
    copies, found = [c.copy() for _ in range(4)], {}
    assert (copies[0].reaction("O2") == c.reaction("O2")).all()
    threads = [threading.Thread(target=lambda i=i: found.update({i: copies[i](q)})) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = c(q)
    assert all((found[i] == expected).all() for i in range(4))
    copies[1].parameters["link3.mass"] = 2 * c.parameters["link3.mass"]
    assert copies[1](q)[0] != c(q)[0]
    assert "link3.mass" not in c.parameters.wanted


@pytest.mark.parametrize("other", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_what_is_copied_or_sent_has_a_state_of_its_own(other):
    c = mg.compile(mg.load("four-bar"))
    c.parameters["crank.mass"] = 2.0
    for q in (0.3, c.tables.home + np.linspace(0.0, 0.3, 4)[:, None]):
        c(q, 1.0)
        d = other(c)
        assert np.array_equal(d.reaction("C"), c.reaction("C"), equal_nan=True)
        assert (d.link("rocker") == c.link("rocker")).all()
        here = c.position("A")
        assert (d(q, 1.0) == c(q, 1.0)).all()
        d(0.5)
        assert (c.position("A") == here).all()
        assert d.parameters.wanted == {"crank.mass": 2.0}
        assert np.shape(d.status) == ()


def test_what_is_not_carried_is_named():
    with pytest.raises(mg.DeclarationError, match=r"pair 'C' .* travels along a curve"):
        mg.compile(mg.load("geneva"))
    with pytest.raises(mg.DeclarationError, match="load force law in 'B' is a function"):
        mg.compile(mg.load("four-bar").replace(loads=[mg.ForceLaw("B", law=lambda x, v, t: -x)]))
    with pytest.raises(mg.DeclarationError, match="no drives"):
        mg.compile(mg.load("four-bar").replace(drives=[]))
    with pytest.raises(mg.DeclarationError):
        mg.compile("four-bar")


@pytest.mark.parametrize("name", ["crank.mass", "coupler.inertia.zz", "coupler.center.x"])
def test_derivatives_by_numbers_beside_which_there_is_no_mechanism(name: str) -> None:
    """A small mass less a step would be below zero, and a rod's inertia has no body beside it; against differences of calls."""
    m = mg.load("four-bar")
    links = [link if link.name == "frame" else replace(link, unphysical=True) for link in m.links]
    c, free = mg.compile(m), mg.compile(m.replace(links=links))
    free(0.3, 5.0, 2.0)
    c(0.3, 5.0, 2.0)
    value, efforts = c.parameters[name], []
    step = 1e-4 * abs(value)
    for sense in (1.0, -1.0):
        free.parameters[name] = value + sense * step
        efforts.append(free(0.3, 5.0, 2.0)[0])
    slope = (efforts[0] - efforts[1]) / (2 * step)
    assert c.gradient("A.effort", [name])[0] == pytest.approx(slope, rel=1e-6)
    assert abs(slope) > 1e-3


def test_parameters_are_a_mapping_of_what_was_set() -> None:
    c = mg.compile(mg.load("four-bar"))
    declared = c(0.1)[0]
    assert c.parameters["crank.mass"] > 0
    assert not c.parameters
    c.parameters.update({"crank.mass": 0.05})
    assert list(c.parameters) == ["crank.mass"]
    assert abs(c(0.1)[0] - declared) > 1e-4
    del c.parameters["crank.mass"]
    assert c(0.1)[0] == pytest.approx(declared, rel=1e-13)
    with pytest.raises(AttributeError):
        c.parameters = {"crank.mass": 2.0}


def test_a_number_that_opens_redundant_loops_has_no_derivatives() -> None:
    """An axis of a planar four-bar turned out of the plane's normal leaves nothing that moves; lengths keep it planar."""
    pairs = [
        mg.Pair(name, "R", *links, point=point, axis=(0, 0, 1))
        for name, links, point in (
            ("A", ("frame", "crank"), (0, 0, 0)),
            ("B", ("crank", "rod"), (0.2, 1, 0)),
            ("C", ("rod", "rocker"), (2.2, 1.6, 0)),
            ("D", ("frame", "rocker"), (2, 0, 0)),
        )
    ]
    c = mg.compile(mg.Mechanism("four-bar", None, pairs, ["A"], [mg.Effort("D", 3.0)]))
    c(0.1)
    found = c.gradient("A.effort", ["C.axis.x", "C.point.x"])
    assert np.isnan(found[0])
    assert np.isfinite(found[1])
    assert c.status == "ok"


def test_what_is_not_unique_has_no_derivative():
    """Of a component that may be any number the derivative is none, not zero; those beside it have theirs."""
    c = mg.compile(mg.load("four-bar"))
    c(0.7, 2.0, 1.0)
    slope = c.gradient("B.reaction", ["coupler.mass"])[:, 0]
    assert (np.isnan(slope) == np.isnan(c.reaction("B"))).all()
    assert np.isfinite(slope).sum() == 3


def test_viscous_friction_that_begins_at_zero():
    """Tables are as long with as without: set in place, and its derivative."""
    m = mg.load("four-bar")
    m = m.replace(loads=[*m.loads, mg.Friction("C", mu=0.1, radius=0.02)])
    c, name = mg.compile(m), f"loads[{len(m.loads) - 1}].viscous"
    before = c(0.7, 2.0, 1.0)[0]
    slope = c.gradient("A.effort", [name])[0]
    c.parameters[name] = 1e-4
    assert c(0.7, 2.0, 1.0)[0] - before == pytest.approx(1e-4 * slope, rel=1e-5)
