"""Every mechanism of the library: counts, ledger, closure, rank and motion, against what its file and the sources say."""

import numpy as np
import pytest
from mechanisms import unclosable_four_bar

import mechgraph as mg
from mechgraph.graph.linkgraph import link_graph
from mechgraph.kinematics.assembly import assembled, named_columns, scaled_system
from mechgraph.kinematics.motion_path import DriverPath, Request, Status
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System

MOVING = tuple(name for name in mg.library() if mg.load(name).drives[0].motion is not None)
RANK = 1e-9
KEYS = {"loops", "mobility_by_count", "mobility", "redundancy", "lee_unknowns", "lee_equations", "minimal_unknowns",
        "passive", "locked", "full_cycle"}  # fmt: skip
ASKED_FOR = {
    "rcsr", "rcsr-csr", "rcsr-csr-printed", "rchch", "7r", "rprhrrr", "rrrrrrh", "prprrh", "rprrhc", "pphchp", "rcrcr", "phchc",
    "four-bar", "slider-crank", "bennett", "spherical-four-bar", "rssr", "p-sp-p", "r-sp-p", "r-sp-r", "p-sp-r", "r-sg-c",
    "r-cp-c", "r-sg-r-r", "r-sg-r-p", "r-sg-p-r", "r-sg-p-p", "r-sc-c-r", "r-sc-c-p", "r-sc-r-c", "r-sc-p-c",
}  # fmt: skip
LEE = {
    "rcsr": (24, 24), "rcsr-csr": (40, 40), "rchch": (34, 34), "7r": (50, 50), "rprhrrr": (50, 50), "rrrrrrh": (50, 50),
    "rprrhc": (42, 42), "pphchp": (42, 42), "rcrcr": (34, 34), "phchc": (34, 34), "prprrh": (43, 42),
}  # fmt: skip
"""Unknowns and equations of Lee 1977, chapter III, driver included."""


def start_state(m: mg.Mechanism) -> tuple[System, np.ndarray]:
    """The scaled system and the state that ``start`` says, as it stands."""
    raw = System(m)
    q = raw.start_coordinates(m.start)
    system = scaled_system(m, q, raw)
    return system, system.state_of(q[:, None])


def jacobian(m: mg.Mechanism) -> np.ndarray:
    system, x = start_state(m)
    return np.asarray(Configuration(system, x).J[:, :, 0])


def followed(m: mg.Mechanism) -> tuple[System, np.ndarray, np.ndarray]:
    """States along the stored sweep and their statuses."""
    system, x = assembled(m)
    columns, _ = named_columns(m, system, dict.fromkeys([d.freedom for d in m.drives], 0.0))
    unit = np.where(system.is_length[columns], system.par.L, 1.0)
    values = np.stack([d.motion.position for d in m.drives if d.motion is not None]) / unit[:, None]
    path = DriverPath(system, closure_solver("dense", columns), lambda variants: system)
    found = follow(path, [Request(x, 0, values, np.arange(values.shape[1]))], values.shape[1])
    return system, found.x, found.status


def test_the_library_is_complete() -> None:
    assert set(mg.library()) >= ASKED_FOR


@pytest.mark.parametrize("name", mg.library())
def test_a_file_says_what_it_is(name: str) -> None:
    m = mg.load(name)
    assert m.name == name
    assert m.source
    assert m.description
    assert set(m.units) == {"length", "mass", "time"}
    assert len(m.drives) == 1
    assert set(m.expected) >= KEYS


@pytest.mark.parametrize("name", mg.library())
def test_loops_and_mobility_by_count(name: str) -> None:
    m = mg.load(name)
    loops = len(link_graph(m).loops)
    assert loops == m.expected["loops"] == len(m.pairs) - len(m.links) + 1
    assert sum(p.type.f for p in m.pairs) - 6 * loops == m.expected["mobility_by_count"]


@pytest.mark.parametrize("name", mg.library())
def test_ledger(name: str) -> None:
    m = mg.load(name)
    lee, minimal = mg.formulate(m, "lee"), mg.formulate(m, "minimal")
    counts = (len(lee.unknowns), len(lee.equations))
    assert counts == (m.expected["lee_unknowns"], m.expected["lee_equations"])
    assert counts == LEE.get(name, counts)
    assert len(minimal.unknowns) == m.expected["minimal_unknowns"]
    assert len(minimal.equations) == 6 * (len(m.links) - 1)
    assert len(lee.equations) - len(lee.unknowns) == m.expected["mobility_by_count"] - 1
    assert len(minimal.equations) - len(minimal.unknowns) == m.expected["mobility_by_count"] - 1


@pytest.mark.parametrize("name", mg.library())
def test_start_is_closed(name: str) -> None:
    system, x = start_state(mg.load(name))
    assert Configuration(system, x).closure[0] < 1e-12


def test_what_cannot_close_says_so() -> None:
    m = unclosable_four_bar()
    with pytest.raises(mg.AssemblyError, match="no closed configuration") as caught:
        mg.kinematics(m, {"A": 0.0})
    assert caught.value.residual > 0.1
    assert f"{caught.value.residual:.3g}" in str(caught.value)
    assert set(caught.value.best) == set(m.freedom_names())


@pytest.mark.parametrize("name", mg.library())
def test_mobility_and_redundancy_by_rank(name: str) -> None:
    m = mg.load(name)
    J = jacobian(m)
    sigma = np.linalg.svd(J, compute_uv=False)
    rank = int((sigma > RANK * sigma[0]).sum())
    assert J.shape[1] - rank == m.expected["mobility"]
    assert J.shape[0] - rank == m.expected["redundancy"]


@pytest.mark.parametrize("name", mg.library())
def test_locked_freedoms(name: str) -> None:
    m = mg.load(name)
    J = jacobian(m)
    rank = J.shape[1] - m.expected["mobility"]
    motions = np.linalg.svd(J)[2][rank:]
    moving = np.abs(motions).max(axis=0, initial=0.0) > 1e-9
    assert [n for n, moves in zip(m.freedom_names(), moving, strict=True) if not moves] == list(m.expected["locked"])


@pytest.mark.parametrize("name", MOVING)
def test_the_stored_sweep_can_be_followed(name: str) -> None:
    m = mg.load(name)
    system, x, status = followed(m)
    assert (status == Status.OK).all()
    here = Configuration(system, x)
    assert here.closure.max() < 1e-10
    sigma = np.linalg.svd(np.moveaxis(here.J, 2, 0), compute_uv=False)
    rank = sigma.shape[1] - m.expected["redundancy"]
    assert (sigma[:, rank - 1] / sigma[:, 0]).min() > 5e-3


@pytest.mark.parametrize("name", [n for n in MOVING if mg.load(n).expected["full_cycle"]])
def test_a_full_cycle_ends_where_it_began(name: str) -> None:
    m = mg.load(name)
    motion = m.drives[0].motion
    assert motion is not None
    turn = motion.position[0] + 2 * np.pi
    assert motion.position[-1] + (motion.position[1] - motion.position[0]) == pytest.approx(turn)
    once_round = mg.Motion(np.append(motion.position, turn))
    system, x, status = followed(m.replace(drives=[mg.Drive(m.drives[0].freedom, once_round)]))
    assert (status == Status.OK).all()
    poses = Configuration(system, x).poses
    passive = m.expected["passive"]  # the links that a passive freedom moves need not come back
    away = np.abs(poses[..., -1] - poses[..., 0]).max(axis=(0, 1))
    assert (np.sort(away)[: len(away) - passive] < 1e-9).all()


def test_locked_freedoms_of_pphchp_stand_still_in_finite_motion() -> None:
    m = mg.load("pphchp")
    system, x, _ = followed(m)
    q = dict(zip(m.freedom_names(), system.coordinates_of(x), strict=True))
    for name in m.expected["locked"]:
        assert np.ptp(q[name]) < 1e-10
    assert np.ptp(q["O4.Tz"]) > 0.01


@pytest.mark.parametrize("name", MOVING)
def test_the_stored_motion_can_be_solved(name: str) -> None:
    m = mg.load(name)
    s = mg.solve(m)
    assert s.checks.closure.max() < 1e-10
    assert s.checks.equilibrium.max() < 1e-9
    assert s.checks.power.max() < 1e-8
