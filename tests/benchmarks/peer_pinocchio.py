"""Driver torque and all reactions over a cycle with Pinocchio: a tree of joints, closed by a constraint.

The loop is cut in the frame: the last link carries a frame that has to stay where it is (six rows). What a user writes: the tree,
Newton for the closure, its rates, the constraint force from the rows of the passive joints, and one more recursion for the reactions.
"""

import numpy as np
import pinocchio as pin
from peer_cases import Case

VERSION = pin.__version__
FORCE = slice(0, 3)
CLOSED = 1e-11


def joint_model(kind: str) -> pin.JointModel:
    """The joint of a pair about and along z."""
    if kind == "C":
        both = pin.JointModelComposite(pin.JointModelRZ())
        both.addJoint(pin.JointModelPZ())
        return both
    return {"R": pin.JointModelRZ, "P": pin.JointModelPZ, "S": pin.JointModelSpherical}[kind]()


def tree(case: Case) -> tuple[pin.Model, int]:
    """The chain of all joints from the frame back to it, and the frame at its end that closes it."""
    model, parent, before = pin.Model(), 0, pin.SE3.Identity()
    model.gravity.linear = case.gravity
    bodies = {body.name: body for body in case.bodies}
    for joint in case.joints:
        here = pin.SE3(joint.axes, joint.point)
        parent = model.addJoint(parent, joint_model(joint.kind), before.actInv(here), joint.name)
        before = here
        body = bodies.get(joint.b)
        if body is not None:
            turned = joint.axes.T @ body.inertia @ joint.axes
            inertia = pin.Inertia(body.mass, joint.axes.T @ (body.center - joint.point), turned)
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    closing = model.addFrame(pin.Frame("closing", parent, before.inverse(), pin.FrameType.OP_FRAME))
    return model, closing


def inverse(J: np.ndarray) -> np.ndarray:
    """Inverse of the passive columns, by normal equations where the loop is overconstrained."""
    return np.linalg.inv(J) if J.shape[0] == J.shape[1] else np.linalg.inv(J.T @ J) @ J.T


def close(model: pin.Model, data: pin.Data, closing: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton on the passive joints from ``q``: the closed position, the Jacobian of the closing frame and its inverse."""
    for _ in range(30):
        pin.computeJointJacobians(model, data, q)
        place = pin.updateFramePlacement(model, data, closing)
        J = pin.getFrameJacobian(model, data, closing, pin.LOCAL)
        back = inverse(J[:, 1:])
        error = pin.log6(place).vector
        if np.abs(error).max() < CLOSED:
            return q, J, back
        q = pin.integrate(model, q, np.concatenate([[0.0], -back @ error]))
    raise RuntimeError("the loop does not close")


def solve(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Torque of the driver ``(T,)`` and wrench of every joint ``(joints, T, 6)``, force first, in the frame of its link b."""
    model, closing = tree(case)
    data = model.createData()
    pull = model.frames[closing].placement
    turned, rate, change = case.turned()
    dt = case.step
    q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    outer = pin.StdVec_Force()
    outer.extend([pin.Force.Zero()] * model.njoints)
    torque, wrenches = np.empty(len(case.t)), np.empty((len(case.joints), len(case.t), 6))
    for i in range(len(case.t)):
        step = dt * v + 0.5 * dt * dt * a
        q = pin.integrate(model, q, step)
        q[0] = turned[i]
        q, J, back = close(model, data, closing, q)
        v = np.concatenate([[rate[i]], -back @ J[:, 0] * rate[i]])
        a = np.zeros(model.nv)
        a[0] = change[i]
        pin.forwardKinematics(model, data, q, v, a)
        a[1:] = -back @ pin.getFrameAcceleration(model, data, closing, pin.LOCAL).vector
        needed = pin.rnea(model, data, q, v, a)
        outer[model.njoints - 1] = pull.act(pin.Force(back.T @ needed[1:]))
        torque[i] = pin.rnea(model, data, q, v, a, outer)[0]
        for k in range(len(case.joints)):
            wrenches[k, i] = data.f[k + 1].vector
    return torque, wrenches


def verdict(case: Case) -> str:
    """The program has no count of redundant constraints."""
    return ""
