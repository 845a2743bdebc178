"""Random gear boxes, every shaft on a ball and a ball in a groove, against free bodies written by hand: tooth forces of the textbook.

Niemann and Winter, Maschinenelemente II, 2003, chapters 21 and 22: tangential, radial and axial part of the force between helical gears,
``F_r = F_t tan a / cos b``, ``F_a = F_t tan b``, and between straight bevel gears, ``F_r = F_t tan a cos d``, ``F_a = F_t tan a sin d``.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mechgraph as mg

G = 9.81


class Shaft:
    """An axis through a point, the bearings on it, and what acts on it: forces at points, by hand."""

    def __init__(
        self, rng: np.random.Generator, name: str, at: np.ndarray, axis: np.ndarray, arms: tuple[float, float]
    ) -> None:
        self.name, self.at, self.axis = name, at, axis
        self.bearings = [at + arm * axis for arm in arms]
        self.mass = rng.uniform(1.0, 5.0)
        self.center = at + rng.uniform(-0.05, 0.05) * axis + np.cross(axis, rng.normal(size=3)) * 0.01

    def link(self) -> mg.Link:
        return mg.Link(self.name, self.mass, self.center)

    def pairs(self) -> list[mg.Pair]:
        ball, groove = self.bearings
        return [
            mg.Pair(f"{self.name} ball", "S", "frame", self.name, point=ball),
            mg.Pair(f"{self.name} groove", "Sg", "frame", self.name, point=groove, axis=self.axis),
            mg.Pair(f"{self.name} turn", "Fr", "frame", self.name, point=self.at, axis=self.axis),
        ]


class Box:
    """Stages from shaft to shaft, helical of either hand and now and then a bevel pair; weights off the axes, a torque at the end."""

    def __init__(self, seed: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        z = rng.normal(size=3)
        z /= np.linalg.norm(z)
        self.shafts = [Shaft(rng, "shaft 0", rng.normal(size=3), z, (-0.1, 0.15))]
        self.gears: list[mg.Gear | mg.BevelGear] = []
        self.stages: list[tuple[np.ndarray, np.ndarray, np.ndarray, float, float]] = []
        for k in range(rng.integers(1, 5)):
            (self.bevel if rng.random() < 0.3 else self.helical)(k)
        self.down = rng.normal(size=3)
        self.down *= G / np.linalg.norm(self.down)
        self.torque = rng.uniform(-40, 40)

    def helical(self, k: int) -> None:
        rng, a = self.rng, self.shafts[-1]
        teeth, module, full, b = (
            rng.integers(17, 60, 2),
            rng.uniform(0.001, 0.004),
            np.deg2rad(rng.uniform(15, 25)),
            rng.uniform(-0.4, 0.4),
        )
        ra, rb = module * teeth / (2 * np.cos(b))
        e = np.cross(a.axis, rng.normal(size=3))
        e /= np.linalg.norm(e)
        middle, way = a.at + rng.uniform(-0.05, 0.1) * a.axis, rng.choice([-1.0, 1.0])
        self.shafts.append(
            Shaft(
                rng,
                f"shaft {k + 1}",
                middle + (ra + rb) * e,
                way * a.axis,
                tuple(rng.uniform((-0.2, 0.05), (-0.05, 0.2))),
            )
        )
        shape = {"module": module, "pressure_angle": full}
        for shaft, point, n, helix in (
            (a, middle, teeth[0], b),
            (self.shafts[-1], middle + (ra + rb) * e, teeth[1], -b),
        ):
            self.gears.append(
                mg.Gear(f"g{len(self.gears)}", shaft.name, int(n), point, shaft.axis, helix_angle=helix, **shape)
            )
        t = np.cross(a.axis, e)
        line = t - np.tan(b) * a.axis  # the way of a right-hand tooth is z + tan(b) t: no force along it
        self.stages.append((middle + ra * e, line, np.tan(full) / np.cos(b) * e, ra, -way * rb))

    def bevel(self, k: int) -> None:
        rng, a = self.rng, self.shafts[-1]
        teeth, module, full = rng.integers(20, 50, 2), rng.uniform(0.002, 0.004), np.deg2rad(rng.uniform(15, 25))
        other = np.cross(a.axis, rng.normal(size=3))
        other /= np.linalg.norm(other)
        ra, rb = module * teeth / 2
        apex = a.at + rng.uniform(0.0, 0.1) * a.axis
        d = np.arctan2(teeth[0], teeth[1])  # half the angle of the cone of a
        self.shafts.append(Shaft(rng, f"shaft {k + 1}", apex + ra * other, other, (0.03, 0.2)))
        for shaft, point, n in ((a, apex + rb * a.axis, teeth[0]), (self.shafts[-1], apex + ra * other, teeth[1])):
            self.gears.append(mg.BevelGear(f"g{len(self.gears)}", shaft.name, int(n), point, shaft.axis, module, full))
        t = np.cross(a.axis, other)
        away = np.tan(full) * (np.cos(d) * other - np.sin(d) * a.axis)
        # at the pitch point t is the way of a at a positive turn, and against that of b
        self.stages.append((apex + rb * a.axis + ra * other, t, away, ra, rb * np.sign(np.cross(other, a.axis) @ t)))

    def mechanism(self) -> mg.Mechanism:
        meshes = [mg.Mesh(f"mesh {k}", f"g{2 * k}", f"g{2 * k + 1}") for k in range(len(self.stages))]
        links = [mg.Link("frame"), *(shaft.link() for shaft in self.shafts)]
        loads = [mg.Gravity(self.down), mg.Effort(f"{self.shafts[-1].name} turn.Rz", self.torque)]
        pairs = [pair for shaft in self.shafts for pair in shaft.pairs()]
        return mg.Mechanism("box", links, pairs, ["shaft 0 turn.Rz"], loads, gears=self.gears, couplings=meshes)

    def by_hand(self, turn: float) -> tuple[float, dict[str, np.ndarray], list[float]]:
        """Torque of the drive, forces of the bearings on the shafts, normal forces, where shaft 0 has turned."""
        turns = [turn]
        for *_, ra, rb in self.stages:  # teeth pass at one speed: ra w_a = rb w_b
            turns.append(turns[-1] * ra / rb)
        forces: list[list[tuple[np.ndarray, np.ndarray]]] = []
        for shaft, angle in zip(self.shafts, turns, strict=True):
            center = shaft.at + Rotation.from_rotvec(angle * shaft.axis).apply(shaft.center - shaft.at)
            forces.append([(center, shaft.mass * self.down)])
        drive, normal = self.torque, []
        for k in range(len(self.shafts) - 1, -1, -1):  # from the load to the drive: moments about the axes
            shaft = self.shafts[k]
            drive += sum(np.cross(p - shaft.at, f) @ shaft.axis for p, f in forces[k])
            if k:
                P, line, away, *_ = self.stages[k - 1]
                tangential = -drive / (np.cross(P - shaft.at, line) @ shaft.axis)
                force = tangential * line + abs(tangential) * away
                forces[k].append((P, force))
                forces[k - 1].append((P, -force))
                normal.insert(0, float(np.linalg.norm(force)))
                drive = 0.0
        bearings = {}
        for shaft, acting in zip(self.shafts, forces, strict=True):
            ball, groove = shaft.bearings
            moment, arm = sum(np.cross(p - ball, f) for p, f in acting), groove - ball
            bearings[f"{shaft.name} groove"] = held = np.cross(arm, moment) / (arm @ arm)
            bearings[f"{shaft.name} ball"] = -held - sum(f for _, f in acting)
        return -drive, bearings, normal


@pytest.mark.daily(3)
@pytest.mark.parametrize("seed", range(100))
def test_random_gear_boxes(seed: int) -> None:
    box = Box(seed)
    m = box.mechanism()
    assert mg.check(m).determinate
    turns = np.array([0.0, 0.7, -2.1])
    s = mg.solve(m, {"shaft 0 turn.Rz": turns})
    for i, turn in enumerate(turns):
        drive, bearings, normal = box.by_hand(turn)
        size = max(np.linalg.norm(force) for force in bearings.values())
        for name, force in bearings.items():
            np.testing.assert_allclose(s[name].force[i], force, atol=1e-10 * size)
        assert s["shaft 0 turn"].effort[i, -1] == pytest.approx(drive, abs=1e-10 * size)
        found = [s.coupling(f"mesh {k}").normal_force[i] for k in range(len(normal))]
        np.testing.assert_allclose(found, normal, rtol=1e-10, atol=1e-10 * size)
