"""Motion under given loads with Pinocchio: a tree of joints, its loops closed by constraints; the integrator around it is ours.

A planar loop is cut at a joint of which the two points stay together, a spatial one at two points of its axis. ``constraintDynamics``
with Baumgarte's stabilization, or ``lcaba``, which leaves that out; without loops ``aba``.
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import scipy
from motion_cases import Case
from peer_cases import Body, Joint

VERSION = pin.__version__
Setting = float
Accelerations = Callable[[np.ndarray, np.ndarray], np.ndarray]
PROXIMAL = (1e-12, 1e-8, 20)
"""Accuracy, weight and most iterations."""
LOOP_PROXIMAL = (1e-12, 1e-6, 20)
"""The same for ``lcaba``, of which the documentation asks for that weight."""


def variants(case: Case) -> tuple[str, ...]:
    """Algorithms and integrators that serve."""
    if case.stiff:
        return ("aba, LSODA",)
    known = ("constraintDynamics, RK4", "constraintDynamics, DOP853")
    # lcaba goes wrong on rows of loops; on Andrews' mechanism it was given up after minutes
    one_loop = len(case.joints) == len(case.bodies) + 1 and not case.planar
    return (*known, "lcaba, RK4", "lcaba, DOP853") if one_loop else known


def ladder(case: Case, variant: str) -> list[Setting]:
    """Steps from one output to the next, or tolerances."""
    return [2, 3, 4, 6, 8, 11, 16, 23, 32, 64, 128] if variant.endswith("RK4") else [10.0**-k for k in range(3, 13)]


class Tree:
    """The spanning tree of the bodies as they are declared, and the joints that were cut."""

    def __init__(self, case: Case) -> None:
        self.model = pin.Model()
        self.model.gravity.linear = case.gravity
        bodies = {body.name: body for body in case.bodies}
        self.number, self.place = {case.mechanism.frame: 0}, {case.mechanism.frame: pin.SE3.Identity()}
        self.cut: list[Joint] = []
        self.column: dict[str, int] = {}
        known, waiting = {case.mechanism.frame}, list(case.joints)
        branches: dict[str, list[tuple[Joint, str]]] = {}
        while waiting:
            joint = next(j for j in waiting if j.a in known or j.b in known)
            waiting.remove(joint)
            if {joint.a, joint.b} <= known:
                self.cut.append(joint)
                continue
            parent, child = (joint.a, joint.b) if joint.a in known else (joint.b, joint.a)
            branches.setdefault(parent, []).append((joint, child))
            known.add(child)
        # joints have to be added branch by branch
        stack = [(case.mechanism.frame, *branch) for branch in reversed(branches[case.mechanism.frame])]
        while stack:
            parent, joint, child = stack.pop()
            self._add(parent, joint, bodies[child])
            stack += [(child, *branch) for branch in reversed(branches.get(child, []))]
        self.data = self.model.createData()

    def _add(self, parent: str, joint: Joint, body: Body) -> None:
        """A joint with the body that it carries."""
        axes = joint.axes if joint.b == body.name else joint.axes @ np.diag([1.0, -1.0, -1.0])
        here = pin.SE3(axes, joint.point)
        kind = pin.JointModelRZ() if joint.kind == "R" else pin.JointModelPZ()
        number = self.model.addJoint(self.number[parent], kind, self.place[parent].actInv(here), joint.name)
        inertia = pin.Inertia(body.mass, axes.T @ (body.center - joint.point), axes.T @ body.inertia @ axes)
        self.model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
        self.number[body.name], self.place[body.name] = number, here
        self.column[joint.name] = self.model.joints[number].idx_v

    def at(self, link: str, point: np.ndarray) -> pin.SE3:
        """The place of a point in the frame of the joint that carries a link, axes of the declared position."""
        return self.place[link].inverse() * pin.SE3(np.eye(3), np.asarray(point, dtype=float))

    def constraints(self, case: Case) -> pin.StdVec_RigidConstraintModel:
        """The points that stay together."""
        out = pin.StdVec_RigidConstraintModel()
        for joint in self.cut:
            points = [joint.point] if case.planar else [joint.point, joint.point + joint.axes[:, 2]]
            for point in points:
                out.append(
                    pin.RigidConstraintModel(
                        pin.ContactType.CONTACT_3D,
                        self.model,
                        self.number[joint.a],
                        self.at(joint.a, point),
                        self.number[joint.b],
                        self.at(joint.b, point),
                        pin.ReferenceFrame.LOCAL,
                    )
                )
        return out


def loads(case: Case, tree: Tree) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Efforts in the joints of springs and couples."""
    constant = np.zeros(tree.model.nv)
    for name, value in case.couples.items():
        constant[tree.column[name]] += value
    ends = [
        (
            spring,
            [
                (tree.number[link], tree.at(link, np.asarray(p)))
                for link, p in ((spring.a, spring.p), (spring.b, spring.q))
            ],
        )
        for spring in case.springs
    ]
    model, data = tree.model, tree.data

    def efforts(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if not ends:
            return constant
        tau = constant.copy()
        pin.computeJointJacobians(model, data, q)
        for spring, places in ends:
            at, rows = [], []
            for joint, place in places:
                X = data.oMi[joint] * place
                J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                arm = X.translation - data.oMi[joint].translation
                rows.append(J[:3] - pin.skew(arm) @ J[3:])
                at.append(X.translation)
            d, J = at[1] - at[0], rows[1] - rows[0]
            length = np.sqrt(d @ d)
            u = d / length
            pull = spring.stiffness * (length - spring.free_length) + spring.damping * (u @ (J @ v))
            tau -= pull * (J.T @ u)
        return tau

    return efforts


def dynamics(case: Case, tree: Tree, algorithm: str, pace: float) -> Accelerations:
    """Accelerations as a function of position and velocity; ``pace`` of the stabilization, 1 over time."""
    model, data, efforts = tree.model, tree.data, loads(case, tree)
    if algorithm == "aba":
        return lambda q, v: pin.aba(model, data, q, v, efforts(q, v)).copy()
    constraints = tree.constraints(case)
    for constraint in constraints:
        constraint.m_baumgarte_parameters.Kp = pace**2
        constraint.m_baumgarte_parameters.Kd = 2 * pace
    known = pin.StdVec_RigidConstraintData()
    for constraint in constraints:
        known.append(constraint.createData())
    if algorithm == "lcaba":
        pin.computeJointMinimalOrdering(model, data, constraints)
        near = pin.ProximalSettings(*LOOP_PROXIMAL)
        return lambda q, v: pin.lcaba(model, data, q, v, efforts(q, v), constraints, known, near).copy()
    pin.initConstraintDynamics(model, data, constraints, known)
    near = pin.ProximalSettings(*PROXIMAL)
    return lambda q, v: pin.constraintDynamics(model, data, q, v, efforts(q, v), constraints, known, near).copy()


def runge_kutta(f: Accelerations, q: np.ndarray, v: np.ndarray, h: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the classical Runge-Kutta method (all joints have one coordinate)."""
    for _ in range(steps):
        a1 = f(q, v)
        v2 = v + h / 2 * a1
        a2 = f(q + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = f(q + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = f(q + h * v3, v4)
        q, v = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return q, v


def solve(case: Case, variant: str, setting: Setting) -> np.ndarray:
    """Positions ``(T, 3)``."""
    algorithm, method = variant.split(", ")
    tree = Tree(case)
    n, times = tree.model.nv, case.times
    q, v = np.zeros(n), np.zeros(n)
    for name, rate in begin_rates(case, tree).items():
        v[tree.column[name]] = rate
    if method == "RK4":
        h = (times[1] - times[0]) / setting
        f = dynamics(case, tree, algorithm, 0.2 / h)
        states = [q]
        for _ in times[1:]:
            q, v = runge_kutta(f, q, v, h, int(setting))
            states.append(q)
    else:
        f = dynamics(case, tree, algorithm, 200.0 / times[-1])
        found = scipy.integrate.solve_ivp(
            lambda t, y: np.concatenate([y[n:], f(y[:n], y[n:])]),
            (times[0], times[-1]), np.concatenate([q, v]), method, times, rtol=setting, atol=1e-2 * setting,
        )  # fmt: skip
        if not found.success:
            raise RuntimeError(found.message)
        states = list(found.y[:n].T)
    link, point = case.watched
    place, out = tree.at(link, np.asarray(point)), []
    for q in states:
        pin.forwardKinematics(tree.model, tree.data, q)
        out.append((tree.data.oMi[tree.number[link]] * place).translation.copy())
    return np.array(out)


def begin_rates(case: Case, tree: Tree) -> dict[str, float]:
    """Rates of the joints of the tree, from the velocities of the bodies that the other programs are given."""
    still = np.zeros(3)
    spin = {body.name: body.angular_velocity for body in case.bodies}
    speed = {body.name: (body.velocity, body.center) for body in case.bodies}
    out = {}
    for name in tree.column:
        joint = next(j for j in case.joints if j.name == name)
        inward = tree.number[joint.a] < tree.number[joint.b]
        a, b = (joint.a, joint.b) if inward else (joint.b, joint.a)
        axis = joint.axes[:, 2] if inward else -joint.axes[:, 2]
        if joint.kind == "R":
            out[name] = float(axis @ (spin.get(b, still) - spin.get(a, still)))
        else:
            v = [speed[k][0] + np.cross(spin[k], joint.point - speed[k][1]) if k in speed else still for k in (a, b)]
            out[name] = float(axis @ (v[1] - v[0]))
    return out
