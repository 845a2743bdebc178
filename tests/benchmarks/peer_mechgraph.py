"""The same job with mechgraph on numpy, from the same numbers as the other programs take."""

import numpy as np
from peer_cases import Case

import mechgraph as mg

VERSION = ""
FORCE = slice(3, 6)


def declared(case: Case) -> mg.Mechanism:
    """The mechanism from its bodies and joints, as assembled at the first position."""
    links = [mg.Link(case.frame)]
    links += [mg.Link(body.name, body.mass, body.center, body.inertia) for body in case.bodies]
    pairs = [
        mg.Pair(joint.name, joint.kind, joint.a, joint.b, point=joint.point, axis=joint.axes[:, 2])
        for joint in case.joints
    ]
    gravity = mg.Gravity(case.gravity)
    return mg.Mechanism(case.mechanism.name, links, pairs, drives=[case.driver], loads=[gravity])


def solve(case: Case, method: str = "loop_wrench", engine: str = "dense") -> tuple[np.ndarray, np.ndarray]:
    """Torque of the driver ``(T,)`` and wrench of every pair ``(joints, T, 6)``, moment first, in global directions."""
    s = mg.solve(declared(case), {case.driver: mg.Motion(*case.turned())}, method=method, engine=engine)
    return s[case.driver].effort[:, 0], np.array([s[joint.name].total for joint in case.joints])


def verdict(case: Case) -> str:
    """Redundant constraints."""
    return str(mg.check(declared(case)).redundancy)
