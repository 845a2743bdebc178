"""Certificates of assemblies: ball arithmetic encloses, roots are within their bounds, what is no root has none."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mechanisms import hexapod, linked_four_bar, ring

import mechgraph as mg
from mechgraph.kinematics.assembly import close_all, closed_start, scaled_start
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.tolerances import ModeTolerances
from mechgraph.modes import certificate as certificates
from mechgraph.modes.assemblies import Question
from mechgraph.modes.certificate import Ball, certificate, curvature, loop_rows, rows, told_apart


def exactly(A: np.ndarray) -> np.ndarray:
    """The stored numbers as fractions."""
    return np.vectorize(Fraction, otypes=[object])(A)


@pytest.mark.parametrize("seed", range(5))
def test_sums_and_products_of_balls_contain_what_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scales = 10.0 ** rng.integers(-12, 12, (3, 4, 4))
    a, b, c = (Ball(rng.normal(size=(4, 4)) * s, np.abs(rng.normal(size=(4, 4))) * 1e-9 * s) for s in scales)
    found = (a @ b + c) @ a - b
    for _ in range(20):
        x, y, z = (exactly(ball.mid + rng.uniform(-0.99, 0.99, (4, 4)) * ball.rad) for ball in (a, b, c))
        inside = (x @ y + z) @ x - y
        assert (np.abs(inside - exactly(found.mid)) <= exactly(found.rad)).all()
    tight = Ball(a.mid, np.zeros((4, 4))) @ Ball(b.mid, np.zeros((4, 4)))
    assert (tight.rad <= 1e-15 * (np.abs(a.mid) @ np.abs(b.mid)) + 1e-290).all()


@pytest.mark.parametrize("name", ["four-bar", "rssr", "rcsr-csr", "rchch", "7r"])
def test_loops_of_balls_are_those_of_the_closure_rows(name: str) -> None:
    """Another walk along the loops: the rows of the engine lie within the balls, and these are small."""
    m = mg.load(name)
    q = Question(m, {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives})
    for loop, (columns, _) in enumerate(q.system.loop_columns):
        opened, twists = loop_rows(q.start, loop)
        at = slice(6 * loop, 6 * loop + 6)
        assert (np.abs(opened.mid - q.start.residual[at, 0]) <= opened.rad + 1e-13).all()
        assert np.abs(twists.mid - q.start.loop_jacobian[at, columns, 0]).max() < 1e-12
        assert max(opened.rad.max(), twists.rad.max()) < 1e-11


@pytest.mark.parametrize("turned", [(), (1,), (2,), (1, 2, 3), (0, 1, 2, 3, 4)])
def test_pairs_declared_against_the_way_of_a_loop_have_their_columns_in_order(turned: tuple[int, ...]) -> None:
    """Of a pair of several freedoms that is passed from link b to a, the last is passed first: two columns were exchanged."""
    rng, pairs = np.random.default_rng(2), []
    for i, symbol in enumerate(("R", "C", "U", "Sp", "E")):
        links = [f"L{i}", f"L{(i + 1) % 5}"]
        axis = rng.normal(size=3)
        more = {"second": np.cross(axis, rng.normal(size=3))} if symbol == "U" else {}
        links = links[::-1] if i in turned else links
        pairs.append(mg.Pair(f"P{i}", symbol, *links, point=rng.normal(size=3), axis=axis, **more))
    here = closed_start(mg.Mechanism("loop", pairs=pairs, frame="L0"))
    found = rows(here)[1].mid
    assert np.abs(found - here.J[:, :, 0]).max() < 1e-12
    assert np.abs(found).max() > 0.5


@pytest.mark.parametrize("make", [hexapod, lambda: mg.load("rssr")])
def test_rods_of_balls_are_those_of_the_rows_of_rods(make: object) -> None:
    m = make()
    here = Question(m, {m.full_name(d.freedom): 0.0 for d in m.drives}).form.family.here
    opened, turned = rows(here)
    assert len(here.system.points.a) > 0
    assert (np.abs(opened.mid - here.residual[:, 0]) <= opened.rad + 1e-13).all()
    assert np.abs(turned.mid - here.J[:, :, 0]).max() < 1e-12
    assert max(opened.rad.max(), turned.rad.max()) < 1e-11


def largest_curvature(here: Configuration, rng: np.random.Generator) -> float:
    """The largest second derivative along a unit direction that is found, by differences of first ones."""
    s, h = here.system, 1e-5
    sides = [
        [rows(Configuration(s, s.advance(here.x, sign * h * e[:, None])))[1].mid for e in np.eye(s.n_freedoms)]
        for sign in (1, -1)
    ]
    T = np.stack([(a - b) / (2 * h) for a, b in zip(*sides, strict=True)], axis=2)
    T, best = 0.5 * (T + T.transpose(0, 2, 1)), 0.0
    for _ in range(10):
        u = rng.normal(size=s.n_freedoms)
        for _ in range(30):
            v = np.einsum("rij,i,j->r", T, u, u)
            w, V = np.linalg.eigh(np.einsum("rij,r->ij", T, v / np.linalg.norm(v)))
            u = V[:, np.argmax(np.abs(w))]
        best = max(best, float(np.linalg.norm(np.einsum("rij,i,j->r", T, u, u))))
    return best


def test_second_derivatives_do_not_pass_their_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turn before slides has the most: its part in them counts twice."""
    monkeypatch.setattr(certificates, "MODES", ModeTolerances(ball=1e-9))
    rng = np.random.default_rng(0)
    found = [Question(hexapod(), dict.fromkeys((f"P{k}" for k in range(1, 7)), 0.0)).form.family.here]
    for letters, arm in (("RRCRC", 1.0), ("RPPPPP", 1.0), ("RPPPPP", 0.1), ("RPPPPP", 3.0), ("RPPPPP", 10.0)):
        points, axes = rng.normal(size=(2, len(letters), 3))
        found.append(scaled_start(ring(letters, arm * points, axes)))
    for here in found:
        assert largest_curvature(here, rng) <= curvature(here) * (1 + 1e-6)


def test_roots_are_apart_where_their_balls_are() -> None:
    """Two assemblies of a four-bar; the same state twice, by a whole turn of a pair, is one root."""
    q = Question(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), {"O0": 0.5})
    family, s = q.family, q.system
    modes = mg.assemblies(q.m, {"O0": 0.5})
    states = np.concatenate([s.state_of(s.start_coordinates(mode.start)[:, None]) for mode in modes], axis=1)
    sure = [certificate(Configuration(s, states[:, [i]]), family.free, 0, True) for i in (0, 1)]
    apart = [one.apart for one in told_apart(family, states, sure)]
    angles = np.abs(np.angle(np.exp(1j * np.diff(states, axis=1)))).max()
    assert apart == [one.apart for one in modes.certificates]
    assert apart[0] == apart[1] == pytest.approx(angles, abs=1e-9)
    same = np.repeat(states[:, :1], 2, axis=1)
    same[s.single_rows[family.free[0]], 1] += 2 * np.pi
    assert all(one.apart < 0 for one in told_apart(family, same, [sure[0], sure[0]]))


def test_a_root_lies_within_its_bound_and_what_is_no_root_has_no_certificate() -> None:
    m = linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5)
    q = Question(m, {"O0": 0.5})
    family, s = q.family, q.system
    root, _ = close_all(s, q.start.x, q.columns)
    for off in (1e-14, 1e-11, 1e-9):
        x = root.copy()
        x[s.single_rows[family.free], 0] += off
        found = certificate(Configuration(s, x), family.free, 0, True)
        assert found is not None
        assert found.proved
        assert found.error >= np.linalg.norm(x - root)
        assert found.error < 20 * off + 1e-11
    for off in (1e-6, 1e-2):
        x = root.copy()
        x[s.single_rows[family.free], 0] += off
        found = certificate(Configuration(s, x), family.free, 0, True)
        assert found is not None
        assert not found.proved


def test_certificates_hold_for_every_matrix_within_the_bounds_of_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows known so coarsely that the inverse may be half as large again: the product is that of the worst of them, or more."""
    q = Question(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), {"O0": 0.5})
    free = q.family.free
    f, A = rows(q.start)
    U, sigma, Vt = np.linalg.svd(A.mid[:, free])
    u, v, least = U[:, 2], Vt[2], sigma[2]
    rad, open_ = A.rad.copy(), 1e-6 * u
    rad[:, free] += 0.35 * least * np.abs(np.outer(u, v))
    monkeypatch.setattr(certificates, "rows", lambda here: (Ball(open_, f.rad), Ball(A.mid, rad)))
    found = certificate(q.start, free, 0, True)
    assert found is not None
    worst = A.mid[:, free] - 0.34 * least * np.outer(u, v)
    inverse, step = np.linalg.pinv(worst), np.linalg.pinv(worst) @ open_
    K = curvature(q.start)
    assert np.linalg.norm(inverse, 2) * K * np.linalg.norm(step) <= found.product < 0.5
    assert np.linalg.norm(step) <= found.error
    assert found.radius <= 1 / (np.linalg.norm(inverse, 2) * K)


@pytest.mark.slow
def test_a_pair_on_a_curve_has_no_certificate() -> None:
    """Bounds of second derivatives hold for screws and rotations; the word says so."""
    modes = mg.assemblies(mg.load("geneva"), guesses=20)[0]
    assert modes.completeness == "searched"
    assert all(sure is None for sure in modes.certificates)
    assert "none" in str(modes)


def test_couplings_are_rows_of_certificates() -> None:
    """A four-bar whose crank goes half a turn for each of its motor: the two assemblies of the four-bar, both proved."""
    bare = linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5)
    motor = mg.Pair("M", "R", "ground", "motor", on_a=mg.Marker((-2.0, 0.0, 0.0)), on_b=mg.Marker())
    couplings = [mg.Coupling({"M": 1.0, "O0": 2.0})]
    links = [*bare.links, mg.Link("motor")]
    geared = bare.replace(links=links, pairs=[motor, *bare.pairs], couplings=couplings, drives=["M"])
    here = Question(geared, {"M": -0.6}).start
    opened, turned = rows(here)
    assert (np.abs(opened.mid - here.residual[:, 0]) <= opened.rad + 1e-13).all()
    assert np.abs(turned.mid - here.J[:, :, 0]).max() < 1e-12
    modes, alone = mg.assemblies(geared, {"M": -0.6}), mg.assemblies(bare, {"O0": 0.5 + 0.3})
    assert len(modes) == len(alone) == 2
    assert [one.proved for one in modes.certificates] == [True, True]
    for mode, other in zip(modes, alone, strict=True):
        assert mode.start["O0.Rz"] == pytest.approx(0.5 + 0.3, abs=1e-12)
        for name, value in other.start.items():
            assert np.cos(mode.start[name] - value) == pytest.approx(1.0, abs=1e-14)
