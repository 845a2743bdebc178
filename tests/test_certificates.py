"""Certificates of assemblies: ball arithmetic encloses, roots are within their bounds, what is no root has none."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mechanisms import linked_four_bar

import mechgraph as mg
from mechgraph.closure.assembly import close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.modes.balls import Ball, loop_rows
from mechgraph.modes.certificate import certificate
from mechgraph.modes.question import Question


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


def test_a_pair_on_a_curve_has_no_certificate() -> None:
    """Bounds of second derivatives hold for screws and rotations; the word says so."""
    modes = mg.assemblies(mg.load("geneva"), guesses=20)[0]
    assert modes.completeness == "searched"
    assert all(sure is None for sure in modes.certificates)
    assert "none" in str(modes)
