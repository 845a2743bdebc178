"""Lee 1977, sections 3.8 to 3.14: the seven mechanisms have complete data, print, solve, and agree with themselves.

The thesis gives topology and count alone; geometry and masses are those of the library.
"""

import numpy as np
import pytest
from lee_1977 import chains

import mechgraph as mg

pytestmark = pytest.mark.reference

NAMES = tuple(chains.SECTIONS)


@pytest.fixture(scope="module", params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def checked(name: str) -> chains.Checked:
    return chains.checked(name)


def test_data_are_complete(name: str) -> None:
    """Every pair has a geometry, every moving link a mass and the inertia of a body, the driver a motion that moves."""
    m = mg.load(name)
    assert m.has_geometry
    for link in m.links:
        if link.name != m.frame:
            assert link.mass > 0
            a, b, c = np.linalg.eigvalsh(link.inertia)
            assert a > 0
            assert a + b >= c * (1 - 1e-3)  # components are stored to five digits; of a slender rod a is nearly c - b
            assert not link.unphysical
    (drive,) = m.drives
    assert drive.motion is not None
    assert np.ptp(drive.motion.position) > 0
    assert np.all(drive.motion.velocity != 0)
    assert any(isinstance(load, mg.Effort) for load in m.loads)


def test_equations_print(name: str) -> None:
    """Blocks, components and coefficient table, one line an equation."""
    f = mg.formulate(mg.load(name), bookkeeping="lee")
    count = chains.SECTIONS[name][1]
    text = f.text()
    assert f"{count} unknowns, {count} equations" in text
    assert f"({count})" in text
    assert f"({count + 1})" not in text
    assert f.latex()
    assert len({row for _, row, _, _ in f.coefficients().rows}) == count


def test_counts(name: str, checked: chains.Checked) -> None:
    count, pairs = chains.SECTIONS[name][1], len(mg.load(name).pairs)
    assert checked.unknowns == checked.equations == count
    assert checked.minimal == 6 * (pairs - 1)


def test_kinetostatics_over_the_stored_motion(checked: chains.Checked) -> None:
    """A full turn of the revolute drivers, a stroke of .12 of the prismatic ones; power balance and equilibrium."""
    assert checked.positions in (120, 360)
    assert checked.power < 1e-12
    assert checked.equilibrium < 1e-12


def test_methods_agree(checked: chains.Checked) -> None:
    """Transposed closure against Newton-Euler: reactions and driver efforts."""
    assert checked.methods < 1e-9


def test_bookkeepings_agree(checked: chains.Checked) -> None:
    """The printed equations of both, assembled and solved, against ``mg.solve``."""
    assert checked.bookkeepings < 1e-9


@pytest.mark.parametrize("name", [n for n in NAMES if mg.load(n).expected["full_cycle"]])
def test_work_of_the_driver_over_a_turn(name: str) -> None:
    """At constant speed weights and kinetic energy come back: ``int T dtheta + M_out (q_end - q_begin) = 0``.

    The output of RPRHRRR and RPRRHC turns round with the driver, that of the others swings.
    """
    m = mg.load(name)
    theta = np.deg2rad(np.arange(361.0))
    s = mg.solve(m, {"O1": mg.Motion(theta, velocity=10.0)})
    (output,) = (load for load in m.loads if isinstance(load, mg.Effort))
    turned = s[output.freedom.partition(".")[0]].position[:, 0]
    effort = s["O1"].effort[:-1, 0]
    work = 2 * np.pi * effort.mean() + output.value * (turned[-1] - turned[0])
    assert abs(work) < 1e-6 * np.abs(effort).max()
