"""The library files of Lee's worked examples against the numbers that the thesis prints, corrections named one by one.

Lee's axes are (x, y, z) = (-z, -x, y) of the library; his S is an offset, his P a length, his a a twist. The frame of a link is
that of the pair before it.
"""

import numpy as np
import pytest
from lee_1977.tables import G, ours

import mechgraph as mg

pytestmark = pytest.mark.reference


def turn(axis: int, degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    pose, (i, j) = np.eye(4), [k for k in range(3) if k != axis]
    pose[i, i] = pose[j, j] = c
    pose[i, j], pose[j, i] = (-s, s) if axis != 1 else (s, -s)
    return pose


def shift(axis: int, distance: float) -> np.ndarray:
    pose = np.eye(4)
    pose[axis, 3] = distance
    return pose


def step(offset: float, length: float, twist: float) -> np.ndarray:
    """``Tz(offset) Tx(length) Rx(twist)``: from one pair to the next along a link."""
    return shift(2, offset) @ shift(0, length) @ turn(0, twist)


def tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> np.ndarray:
    """A tensor with the printed numbers in Lee's axes, turned into the library's."""
    return G.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ G


def assert_link(m: mg.Mechanism, name: str, mass: float, center: np.ndarray, inertia: np.ndarray) -> None:
    link = next(link for link in m.links if link.name == name)
    assert link.mass == mass
    np.testing.assert_allclose(link.center, center, atol=1e-12)
    np.testing.assert_allclose(link.inertia, inertia, atol=1e-12)


def test_rcsr() -> None:
    """Sections 2.6.6 and 3.4. Not printed: S1, S4, the masses, M_out. Corrected: Ixx1, Ixy2, Ixz2, Ixz3."""
    m = mg.load("rcsr")
    same = mg.chain("RCSR", twist=np.deg2rad([12, 0, 0, 15]), length=[0.5, 0.8, 0.4, 0.5], offset=[5, 0, 0, 4])
    assert [(p.on_a, p.on_b) for p in m.pairs] == [(p.on_a, p.on_b) for p in same.pairs]
    centre = ours(np.array([0.5, 1.0, 1.0]))  # X, Y, Z from the pair before, unfolded
    assert_link(m, "link1", 2.0, centre + shift(2, 5)[:3, 3], tensor(0.02, 0, 0, 0.05, 0.1, 0))
    assert_link(m, "link2", 5.0, centre, tensor(0.01, 0.2, 0.2, 0.05, 0.4, 0))
    assert_link(m, "link3", 5.0, centre + shift(0, 0.4)[:3, 3], tensor(0.02, 0.3, 0.4, 0.5, 0.2, 0))
    assert m.loads == (mg.Effort("O4", 10.0),)


def test_rchch() -> None:
    """Sections 2.8.6 and 3.7. Not printed: Ixz4, taken as 0."""
    m = mg.load("rchch")
    twist, length = np.deg2rad([10, 80, 40, 50, 60]), [1, 0.5, 0.8, 0.6, 0.4]
    same = mg.chain("RCHCH", twist=twist, length=length, offset=[0.2, 0, 0, 0, 0], pitch=[2, 5])
    assert [(p.on_a, p.on_b, p.pitch) for p in m.pairs] == [(p.on_a, p.on_b, p.pitch) for p in same.pairs]
    assert_link(
        m,
        "link1",
        0.1,
        ours(np.array([0.1, 0.1, 0.01])) + shift(2, 0.2)[:3, 3],
        tensor(0.01, 0.002, 0.02, 0.01, 0.001, 0.01),
    )
    second = tensor(0.01, 0.002, 0.02, 0.02, 0.001, 0.01)
    assert_link(m, "link2", 0.5, ours(np.array([0.2, 0.1, 0.1])), second)
    assert_link(m, "link3", 0.4, ours(np.array([0.01, 0.2, 0.01])), second)
    to_o5 = step(0, 0.6, 50)  # link 4 is given in the axes of O5
    R = to_o5[:3, :3]
    fourth = R @ tensor(0.01, 0.001, 0.02, 0.02, 0, 0.01) @ R.T
    assert_link(m, "link4", 0.5, to_o5[:3, 3] + R @ ours(np.array([0.1, 0.1, 0.01])), fourth)
    assert m.loads == (mg.Effort("O5", 10.0),)


def markers(P6: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Poses of markers a and b of the RCSR-CSR mechanism from the twists, lengths and offsets of sections 2.7.3 and 3.6.

    The CSR chain begins on link 2 at theta_c2 = 20, S_c2 = .6 and ends on the frame at theta_c1 = 20, S_c1 = .5.
    """
    one, branch = np.eye(4), turn(2, 20) @ shift(2, 0.6) @ step(0, 0.5, 20)
    end_4, end_7 = step(4, 0.6, 10), step(0.8, 0.5, 20) @ shift(2, 0.5) @ turn(2, 20)
    return {
        "O1": (one, one),
        "O2": (step(5, 0.5, 10), one),
        "O3": (step(0, 1, 0), one),
        "O4": (step(0, 0.4, 0), np.linalg.inv(end_4)),
        "O5": (branch, one),
        "O6": (step(0, P6, 0), one),
        "O7": (step(0, 1, 0), np.linalg.inv(end_7)),
    }


@pytest.mark.parametrize(("name", "P6"), [("rcsr-csr", 1.0), ("rcsr-csr-printed", 0.4)])
def test_rcsr_csr(name: str, P6: float) -> None:
    """Corrected: P6 = 1 in ``rcsr-csr``; as printed, .4."""
    m = mg.load(name)
    expected = markers(P6)
    assert [p.name for p in m.pairs] == list(expected)
    for pair in m.pairs:
        for marker, pose in zip(pair.markers, expected[pair.name], strict=True):
            np.testing.assert_allclose(marker.pose(), pose[:3], atol=1e-12)
    assert m.loads == (mg.Effort("O4", 1.0), mg.Effort("O7", 4.0))
    assert all(link.mass == 0 for link in m.links)


@pytest.mark.parametrize("name", ["rcsr", "rcsr-csr", "rcsr-csr-printed", "rchch"])
def test_units_and_motion(name: str) -> None:
    """Inches, pounds, seconds: consistent with forces in lb in/s2. ``rps`` and ``revolute per second2`` are rad/s, rad/s2."""
    m = mg.load(name)
    assert dict(m.units) == {"length": "in", "mass": "lb", "time": "s"}
    motion = m.drives[0].motion
    assert motion is not None
    assert np.all(motion.velocity == 0.1)
    assert np.all(motion.acceleration == (0.1 if name == "rchch" else 0.2))
