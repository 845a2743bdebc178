"""The mechanisms of ``bench_response`` and the same as plain numbers, as another program takes them (IFToMM benchmark problems)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from peer_cases import Body, Joint, joint_of

import mechgraph as mg

ROWS = (1, 2, 10, 40, 100, 1000)
"""Numbers of four-bars in a row (A2)."""
GOVERNOR = Path(__file__).parents[1] / "reference" / "data" / "flyball-governor.toml"
Z = (0.0, 0.0, 1.0)
Points = np.ndarray


@dataclass(frozen=True)
class Case:
    """A mechanism that moves by itself from its declared position; ``bodies`` and ``joints`` are global there.

    ``reference (T, 3)``: positions at ``times`` of the ``watched`` point of a link, of a mechanism of this ``size``. ``springs``: links,
    points, stiffness, free length, damping; ``couples`` act in joints. ``stiff``: implicit steppers serve.
    """

    name: str
    mechanism: mg.Mechanism
    rates: dict[str, float]
    times: np.ndarray
    watched: tuple[str, tuple[float, float, float]]
    size: float
    planar: bool
    stiff: bool
    reference: Points
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    springs: tuple[mg.Spring, ...]
    couples: dict[str, float]
    gravity: np.ndarray

    def error(self, found: Points) -> float:
        """The largest distance from the reference, over the size."""
        off = np.abs(found - self.reference).max()
        return float(off / self.size) if np.isfinite(off) else np.inf


def windows(n: int) -> mg.Mechanism:
    """A2: n four-bars in a row, rods of 1 m and 1 kg."""
    links = [mg.Link("frame"), *(rod(f"c{i}", (i, 0, 0), (i, 1, 0)) for i in range(n + 1))]
    links += [rod(f"r{i}", (i, 1, 0), (i + 1, 1, 0)) for i in range(n)]
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"c{i}", point=(i, 0, 0), axis=Z) for i in range(n + 1)]
    for i in range(n):
        pairs.append(mg.Pair(f"B{i}", "R", f"c{i}", f"r{i}", point=(i, 1, 0), axis=Z))
        pairs.append(mg.Pair(f"C{i}", "R", f"r{i}", f"c{i + 1}", point=(i + 1, 1, 0), axis=Z))
    return mg.Mechanism(f"windows-{n}", links, pairs, loads=[mg.Gravity((0, -9.81, 0))])


def rod(name: str, p: tuple[float, ...], q: tuple[float, ...]) -> mg.Link:
    """A slender rod of 1 kg between two points."""
    a, b = np.array(p, dtype=float), np.array(q, dtype=float)
    d = b - a
    return mg.Link(name, 1.0, (a + b) / 2, (d @ d * np.eye(3) - np.outer(d, d)) / 12)


def exact_windows(n: int, times: np.ndarray) -> Points:
    """Tip of crank 0: ``((n + 1) / 3 + n) theta'' = -g ((n + 1) / 2 + n) cos theta``, all cranks being parallel."""
    inertia, arm = (n + 1) / 3 + n, (n + 1) / 2 + n
    found = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], -9.81 * arm / inertia * np.cos(y[0])],
        (times[0], times[-1]), [np.pi / 2, -1.0], "DOP853", times, rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    return np.stack([np.cos(found.y[0]), np.sin(found.y[0]), np.zeros(len(times))], axis=1)


def row(n: int) -> Case:
    """A2 with n four-bars."""
    times = np.linspace(0.0, 10.0, 101)
    exact = exact_windows(n, times)
    return case_of("A2", windows(n), {"A0": -1.0}, times, ("c0", (0.0, 1.0, 0.0)), 1.0, reference=exact, planar=True)


def others() -> tuple[Case, ...]:
    """A4, A3, A5."""
    bricard, andrews, governor = mg.load("bricard-cube"), mg.load("andrews"), mg.load(GOVERNOR)
    tip = tuple(float(x) for x in andrews.link("K1").center)
    arm = float(np.hypot(tip[0], tip[1]))
    ten = np.linspace(0.0, 10.0, 101)
    return (
        case_of("A4, Bricard", bricard, {}, ten, ("l3", (1.0, -1.0, 1.0)), 1.0),
        case_of("A3, Andrews", andrews, {}, np.linspace(0.0, 0.03, 31), ("K1", tip), arm, planar=True),
        case_of(
            "A5, governor, 2 s", governor, {"A": 2 * np.pi}, ten[:21], ("slider", (0.0, 0.0, 0.5)), 1.0, stiff=True
        ),
    )


def converged(
    m: mg.Mechanism, rates: dict[str, float], times: np.ndarray, stiff: bool, link: str, point: Points
) -> Points:
    """Positions of a point at tolerances at which none of the digits that are compared changes any more."""
    r = mg.respond(m, times, rates=rates, rtol=1e-10, atol=1e-12, method="LSODA" if stiff else "auto")
    return np.asarray(r.link(link).point(point).position)


def case_of(
    name: str,
    m: mg.Mechanism,
    rates: dict[str, float],
    times: np.ndarray,
    watched: tuple[str, tuple[float, float, float]],
    size: float,
    *,
    reference: Points | None = None,
    planar: bool = False,
    stiff: bool = False,
) -> Case:
    """The numbers of a mechanism at its declared position, with the velocities that it begins with."""
    m = m.replace(drives=[])
    reference = converged(m, rates, times, stiff, *watched) if reference is None else reference
    begin = mg.respond(m, (0.0, 1e-6), rates=rates).at(0.0)
    gravity = next((np.asarray(load.acceleration) for load in m.loads if isinstance(load, mg.Gravity)), np.zeros(3))
    bodies = tuple(
        Body(
            link.name,
            link.mass,
            begin.link(link.name).center,
            np.zeros((3, 3)) if link.inertia is None else np.asarray(link.inertia),
            begin.link(link.name).center_velocity,
            begin.link(link.name).angular_velocity,
        )
        for link in m.links
        if link.name != m.frame
    )
    return Case(
        name=name,
        mechanism=m,
        rates=rates,
        times=times,
        watched=watched,
        size=size,
        planar=planar,
        stiff=stiff,
        reference=reference,
        bodies=bodies,
        joints=tuple(joint_of(pair, begin) for pair in m.pairs),
        springs=tuple(load for load in m.loads if isinstance(load, mg.Spring)),
        couples={load.freedom: float(load.value) for load in m.loads if isinstance(load, mg.Effort)},
        gravity=gravity,
    )
