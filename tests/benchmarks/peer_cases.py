"""The mechanisms of ``bench_peers`` and the same geometry and masses as plain numbers, as another program takes them."""

from dataclasses import dataclass

import numpy as np

import mechgraph as mg

POSITIONS = (1, 36, 360, 3600)
"""Positions of the driver at which the job is done."""
SPEED = 10.0
SWING = 0.4
"""Half the stroke of the Bricard mechanism, rad: its hinges do not turn fully."""


@dataclass(frozen=True)
class Body:
    """A link in global coordinates at the first position: mass center, inertia about it, velocity of the mass center."""

    name: str
    mass: float
    center: np.ndarray
    inertia: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


@dataclass(frozen=True)
class Joint:
    """A pair in global coordinates at the first position: its point, and its marker whose z is the axis."""

    name: str
    kind: str
    a: str
    b: str
    point: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True)
class Case:
    """A mechanism, its driver motion over one turn or swing, and its bodies and joints at the first position.

    ``bodies`` are the links without the frame; ``joints`` go round the one loop from the frame, the driver first, as declared.
    """

    mechanism: mg.Mechanism
    motion: mg.Motion
    t: np.ndarray
    frame: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    gravity: np.ndarray

    @property
    def driver(self) -> str:
        """Name of the driven pair."""
        return self.joints[0].name

    @property
    def step(self) -> float:
        """Time from one position to the next; 0 for a single one."""
        return float(self.t[1] - self.t[0]) if len(self.t) > 1 else 0.0

    def turned(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Turn of the driver from its first position, its rate and acceleration, at every position."""
        motion = self.motion
        q, v, a = (np.broadcast_to(x, self.t.shape) for x in (motion.position, motion.velocity, motion.acceleration))
        return q - q[0], v, a


def turn(positions: int) -> tuple[np.ndarray, mg.Motion]:
    """Times and one turn at constant speed."""
    t = np.arange(positions) * (2 * np.pi / SPEED / positions)
    return t, mg.Motion(SPEED * t, SPEED, 0.0)


def swing(positions: int) -> tuple[np.ndarray, mg.Motion]:
    """Times and one harmonic swing to and fro."""
    t = np.arange(positions) * (2 * np.pi / SPEED / positions)
    s, c = SWING * np.sin(SPEED * t), SWING * np.cos(SPEED * t)
    return t, mg.Motion(s, SPEED * c, -(SPEED**2) * s)


def bricard() -> mg.Mechanism:
    """Six hinges along the edges of a cube: five rods of 1 m and 1 kg, 1 cm thick (IFToMM benchmark, without its free fall)."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)
    axes = ((0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0))
    names = ["frame", *(f"rod{k}" for k in range(1, 6))]
    links = [mg.Link("frame")]
    for k in range(5):
        start, end = corners[k], corners[k + 1]
        links.append(mg.Link(names[k + 1], 1.0, (start + end) / 2, mg.inertia.cylinder(1.0, 0.005, 1.0, end - start)))
    pairs = [mg.Pair(f"O{k + 1}", "R", names[k], names[(k + 1) % 6], point=corners[k], axis=axes[k]) for k in range(6)]
    return mg.Mechanism("bricard", links, pairs, drives=["O1"], loads=[mg.Gravity((0, -9.81, 0))])


def rscr() -> mg.Mechanism:
    """R-S-C-R with a crank that turns fully: the library's R-Sc-C-R, its slotted cylinder a ball on a shorter crank."""
    m = mg.load("r-sc-c-r").with_pair_type("B", "S")
    pairs = [pair.replace(point=(0.04, 0.0, 0.0)) if pair.name == "B" else pair for pair in m.pairs]
    return m.replace(name="r-s-c-r", pairs=pairs)


def under_gravity(m: mg.Mechanism) -> mg.Mechanism:
    """The mechanism with gravity as its only load."""
    return m.replace(loads=[load for load in m.loads if isinstance(load, mg.Gravity)])


def cases(positions: int) -> tuple[Case, ...]:
    """The four mechanisms: planar, spatial, spatial of seven links, overconstrained."""
    turning = [under_gravity(m) for m in (mg.load("four-bar"), rscr(), mg.load("7r"))]
    return (*(case_of(m, *turn(positions)) for m in turning), case_of(bricard(), *swing(positions)))


def case_of(m: mg.Mechanism, t: np.ndarray, motion: mg.Motion) -> Case:
    """Everything another program needs, read from the mechanism at its first position; one loop, driven at the frame."""
    (drive,) = m.drives
    first = mg.Motion(motion.position[0], np.broadcast_to(motion.velocity, t.shape)[0])
    s = mg.kinematics(m, {drive.freedom: first})
    joints = tuple(joint_of(pair, s) for pair in m.pairs)
    bodies = tuple(body_of(m.link(joint.b), s) for joint in joints[:-1])
    (gravity,) = (load for load in m.loads if isinstance(load, mg.Gravity))
    return Case(m, motion, t, m.frame, bodies, joints, np.asarray(gravity.acceleration))


def body_of(link: mg.Link, s: mg.Solution) -> Body:
    """A link at a position; no mass, no inertia where the link has none."""
    at = s.link(link.name)
    turned = at.pose[:3, :3]
    inertia = np.zeros((3, 3)) if link.inertia is None else np.asarray(link.inertia)
    return Body(link.name, link.mass, at.center, turned @ inertia @ turned.T, at.center_velocity, at.angular_velocity)


def joint_of(pair: mg.Pair, s: mg.Solution) -> Joint:
    """A pair at a position: the marker on link a."""
    pose, marker = s.link(pair.a).pose, pair.markers[0].pose()
    turned = pose[:3, :3] @ marker
    return Joint(pair.name, pair.type.symbol, pair.a, pair.b, turned[:, 3] + pose[:3, 3], turned[:, :3])
