"""Finite mobility against the rank along the path: never above a nullity on the way, and not below what moves on.

``MECHGRAPH_MANY=10000`` runs as many random mechanisms; without it a few hundred.
"""

from __future__ import annotations

import os

import mechanisms as known
import numpy as np
import pytest
from strategies import closed_mechanism

import mechgraph as mg
from mechgraph.determinacy.finite_motion import finite_motion
from mechgraph.kinematics.assembly import close
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System

MANY = int(os.environ.get("MECHGRAPH_MANY", "240"))
STEP = 0.02
Z = np.array((0.0, 0.0, 1.0))


def loop(points: np.ndarray, axes: np.ndarray, letters: str) -> mg.Mechanism:
    return known.ring(letters, [tuple(p) for p in points], [tuple(a) for a in axes], name="random loop")


def planar(rng: np.random.Generator) -> mg.Mechanism:
    n = int(rng.choice([4, 4, 4, 5, 6]))
    points = np.column_stack([rng.uniform(-1, 1, (n, 2)), np.zeros(n)])
    letters = "".join(rng.choice(["R", "R", "R", "P"], n))
    if letters.count("R") < 2:
        letters = "R" * n
    slides = np.column_stack([rng.normal(size=(n, 2)), np.zeros(n)])
    return loop(points, np.array([Z if k == "R" else s for k, s in zip(letters, slides, strict=True)]), letters)


def spherical(rng: np.random.Generator) -> mg.Mechanism:
    n = int(rng.choice([4, 4, 5]))
    axes = rng.normal(size=(n, 3))
    return loop(axes * rng.uniform(0.3, 1.5, (n, 1)), axes, "R" * n)


def spatial(rng: np.random.Generator) -> mg.Mechanism:
    return closed_mechanism(int(rng.integers(2**31)), masses=False)


def ladder(rng: np.random.Generator) -> mg.Mechanism:
    return known.windows(int(rng.integers(2, 6)), general=bool(rng.random() < 0.7))


KINDS = {"planar": planar, "spherical": spherical, "spatial": spatial, "ladder": ladder}


def nullity(here: Configuration) -> int:
    """Nullity of the closure Jacobian, rows of every loop about its first pair."""
    J = here.J[:, :, 0].copy()
    for i, path in enumerate(here.system.graph.loops):
        p = here.pair_points[:, path[0][0], 0]
        J[6 * i + 3 : 6 * i + 6] += np.cross(J[6 * i : 6 * i + 3], p[:, None], axis=0)
    s = np.linalg.svd(J, compute_uv=False)
    return J.shape[1] - int((s > 1e-6 * s[0]).sum())


def along_the_path(system: System, x: np.ndarray, steps: int = 4) -> tuple[list[int], float]:
    """Nullities at closed positions along a motion; and the least part of a random step that closing left."""
    out = [nullity(Configuration(system, x[:, None]))]
    least = 1.0
    rng = np.random.default_rng(0)
    v = rng.normal(size=system.n_freedoms)
    for _ in range(steps):
        J = Configuration(system, x[:, None]).J[:, :, 0]
        _, s, Vt = np.linalg.svd(J)
        N = Vt[int((s > 1e-9 * s[0]).sum()) :].T
        v = N @ (N.T @ v)
        if not np.abs(v).max(initial=0.0) > 1e-6:
            break
        v /= np.linalg.norm(v)
        closed, error = close(system, system.advance(x[:, None], STEP * v[:, None])[:, 0], np.arange(0))
        if error > 1e-10 or np.abs(system.difference(closed[:, None], x[:, None])).max() < 0.1 * STEP / len(v):
            break
        change = system.difference(closed[:, None], x[:, None])[:, 0]
        least = min(least, 1.0 - float(np.linalg.norm(N.T @ (change / STEP - v))))
        x = closed
        out.append(nullity(Configuration(system, x[:, None])))
    return out, least


@pytest.mark.daily(1)
@pytest.mark.parametrize("kind", KINDS)
def test_random_mechanisms_against_the_rank_along_the_path(kind: str) -> None:
    for seed in range(MANY // len(KINDS)):
        report = mg.check(KINDS[kind](np.random.default_rng((seed, len(kind)))))
        g = report.geometry
        assert g is not None
        found, kept = along_the_path(g.system, g.x)
        assert report.finite_mobility is not None
        assert report.mobility is not None
        assert report.finite_mobility <= min(found), (kind, seed)
        if len(found) > 1 and len(set(found)) == 1 and kept > 0.995:  # constant rank, and it moves on in all directions
            assert report.finite_mobility == found[0], (kind, seed)
        assert report.motion is not None
        assert 0 <= report.finite_mobility <= report.mobility


def test_curved_motions_of_four_bars_have_mobility_one() -> None:
    """Of random planar four-bars one in twenty was said to move with mobility 2: two chords of one curve taken for directions."""
    for seed in range(150):
        rng = np.random.default_rng((seed, 77))
        m = loop(np.column_stack([rng.uniform(-1, 1, (4, 2)), np.zeros(4)]), np.tile(Z, (4, 1)), "RRRR")
        report = mg.check(m)
        assert report.finite_mobility == report.mobility == 1, seed


def test_a_chain_of_high_nullity_keeps_it() -> None:
    """Ten planar four-bars one after the other, each on the coupler of the one before: nullity 10 all around."""
    pairs, base, foot = [], "frame", np.zeros(3)
    for k in range(10):
        corners = [foot + np.array(p) for p in ((0, 0, 0), (0.3, 1, 0), (1.4, 1.2, 0), (1.1, 0.1, 0))]
        names = [base, f"a{k}", f"b{k}", f"c{k}", base]
        pairs += [mg.Pair(f"J{k}{i}", "R", names[i], names[i + 1], point=corners[i], axis=Z) for i in range(4)]
        base, foot = f"b{k}", corners[1] + (0.2, 0.3, 0.0)
    for engine in ("dense", "sparse"):
        report = mg.check(mg.Mechanism("chain", None, pairs), engine=engine)  # type: ignore[arg-type]
        assert report.finite_mobility == report.mobility == 10


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize(
    ("build", "mobility", "finite"),
    [
        (lambda: known.ring("RRR", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [Z] * 3, name="flat triangle"), 1, 0),
        (lambda: known.ring("RRRR", [(0, 0, 0), (0.5, 0, 0), (1.5, 0, 0), (1, 0, 0)], [Z] * 4, name="in line"), 2, 1),
        (known.bennett, 1, 1),
        (known.goldberg, 1, 1),
        (known.bricard_cube, 1, 1),
        (known.sarrus, 1, 1),
    ],
)
def test_shaky_and_singular_positions(build: object, mobility: int, finite: int, engine: str) -> None:
    report = mg.check(build(), engine=engine)  # type: ignore[operator, arg-type]
    assert (report.mobility, report.finite_mobility) == (mobility, finite)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("value", [0.1, -0.1, 0.001])
def test_no_position_of_a_shaky_mechanism_is_said_to_be_reached(value: float, engine: str) -> None:
    """A flat triangle: its loop opens by the square of the way, 1e-6 after a thousandth of a radian."""
    pairs = known.ring("RRR", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [Z] * 3, name="flat triangle").pairs
    m = mg.Mechanism("flat triangle", None, pairs, [pairs[0].name])
    with pytest.raises(mg.ReachError, match="no finite motion keeps the loops closed from") as error:
        mg.solve(m, {pairs[0].name: [0.0, value]}, engine=engine)  # type: ignore[arg-type]
    assert list(error.value.value.values()) == [0.0]
    assert error.value.solution.status.tolist()[0] == "ok"
    with pytest.raises(mg.AssemblyError, match=f"came to {pairs[0].name} = 0,"):
        mg.assemble(m, {pairs[0].name: value})


def test_a_shaky_part_on_a_moving_mechanism_is_not_counted() -> None:
    """A flat triangle of hinges on the coupler of a four-bar: nullity 2 all along, of which 1 moves on."""
    corners = ((0, 0, 0), (0.3, 1, 0), (1.4, 1.2, 0), (1.1, 0.1, 0))
    names = ["frame", "a", "b", "c", "frame"]
    pairs = [mg.Pair(f"J{i}", "R", names[i], names[i + 1], point=corners[i], axis=Z) for i in range(4)]
    bars = ["b", "p", "q", "b"]
    pairs += [mg.Pair(f"K{i}", "R", bars[i], bars[i + 1], point=(0.5 + i, 2.0, 0), axis=Z) for i in range(3)]
    m = mg.Mechanism("shaky on a coupler", None, pairs)
    for engine in ("dense", "sparse"):
        report = mg.check(m, engine=engine)  # type: ignore[arg-type]
        assert (report.mobility, report.finite_mobility) == (2, 1)


def test_full_row_rank_needs_no_motion() -> None:
    report = mg.check(mg.load("7r"))
    g = report.geometry
    assert g is not None
    assert finite_motion(g.system, g.x, g.freedoms.closure).mobility == 1
