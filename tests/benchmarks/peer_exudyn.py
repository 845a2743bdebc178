"""Driver torque and all reactions over a cycle with Exudyn: the graph of bodies and joints, integrated over the prescribed motion.

The crank is welded to a rotor of one coordinate whose law is prescribed (written as a symbolic function, so that it runs compiled);
the weld measures the torque. Index 3, generalized alpha, one step a position, starting with the true velocities, which are given.
Spectral radius and Newton tolerance are those of least error among some tried: faults of the start die away sooner than with the
defaults, for about the same time.
"""

import exudyn as exu
import numpy as np
from exudyn.itemInterface import Node1D, ObjectRotationalMass1D, SensorObject
from exudyn.utilities import CreateSymbolicUserFunction, RigidBodyInertia
from peer_cases import SPEED, SWING, Case

VERSION = exu.__version__
FORCE = slice(0, 3)
exu.config.printToConsole = False
exu.config.suppressWarnings = True
LOCKED = {"R": [1, 1, 1, 1, 1, 0], "P": [1, 1, 0, 1, 1, 1], "C": [1, 1, 0, 1, 1, 0], "S": [1, 1, 1, 0, 0, 0]}
WELD = [1, 1, 1, 1, 1, 1]


def turning(mbs, t, item, offset):
    """One turn at constant speed."""
    return SPEED * t


def swinging(mbs, t, item, offset):
    """One harmonic swing."""
    return SWING * exu.symbolic.sin(SPEED * t)


def assembled(case: Case) -> tuple[exu.MainSystem, list[exu.ObjectIndex], list[object]]:
    """The system, the joint of every pair (that of the driver is the weld to the rotor), and what has to stay alive."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = {case.frame: mbs.CreateGround()}
    for body in case.bodies:
        items[body.name] = mbs.CreateRigidBody(
            referencePosition=body.center,
            initialVelocity=body.velocity,
            initialAngularVelocity=body.angular_velocity,
            inertia=RigidBodyInertia(mass=body.mass, inertiaTensor=body.inertia),
            gravity=case.gravity,
        )
    _, rate, change = case.turned()
    node = mbs.AddNode(Node1D(initialVelocities=[rate[0]]))
    first = case.joints[0]
    rotor = mbs.AddObject(
        ObjectRotationalMass1D(
            nodeNumber=node, inertia=1.0, referencePosition=first.point, referenceRotation=first.axes
        )
    )
    law = CreateSymbolicUserFunction(
        mbs, swinging if change.any() else turning, "offsetUserFunction", itemTypeName="ObjectConnectorCoordinate"
    )
    mbs.CreateCoordinateConstraint(itemNumbers=[None, node], coordinates=[None, 0], offsetUserFunction=law)
    joints = []
    for joint in case.joints:
        joints.append(
            mbs.CreateGenericJoint(
                itemNumbers=[rotor if joint is first else items[joint.a], items[joint.b]],
                position=joint.point,
                rotationMatrixAxes=joint.axes,
                constrainedAxes=WELD if joint is first else LOCKED[joint.kind],
            )
        )
    return mbs, joints, [container, law]


def settings(case: Case, redundant: bool) -> exu.SimulationSettings:
    """One step a position; the solver that ignores a singular Jacobian where constraints are redundant."""
    out = exu.SimulationSettings()
    steps = len(case.t) - 1
    out.timeIntegration.numberOfSteps = steps
    out.timeIntegration.endTime = case.t[-1]
    out.timeIntegration.newton.relativeTolerance = 1e-10
    out.timeIntegration.generalizedAlpha.spectralRadius = 0.6
    out.solution.file.write = False
    out.solution.sensors.writePeriod = case.t[-1] / steps
    if redundant:
        out.linearSolver.solverType = exu.LinearSolverType.EigenDense
        out.linearSolver.ignoreSingularJacobian = True
    return out


def solve(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Torque of the driver ``(T,)`` and wrench of every joint ``(joints, T, 6)``, force first, in the frame of its link a."""
    if len(case.t) == 1:
        raise ValueError("integrates")
    mbs, joints, _alive = assembled(case)
    kinds = (exu.OutputVariableType.ForceLocal, exu.OutputVariableType.TorqueLocal)
    sensors = [
        [mbs.AddSensor(SensorObject(objectNumber=k, outputVariableType=x, storeInternal=True)) for x in kinds]
        for k in joints
    ]
    mbs.Assemble()
    mbs.SolveDynamic(settings(case, redundancy(mbs) > 0))
    wrenches = np.array([np.hstack([mbs.GetSensorStoredData(n)[:, 1:4] for n in pair]) for pair in sensors])
    return wrenches[0, :, 5], wrenches


def redundancy(mbs: exu.MainSystem) -> int:
    """Redundant constraints, as the program counts them."""
    return int(mbs.ComputeSystemDegreeOfFreedom()["redundantConstraints"])


def verdict(case: Case) -> str:
    """What the program says about redundant constraints."""
    mbs, _, _alive = assembled(case)
    mbs.Assemble()
    return str(redundancy(mbs))
