"""Motion under given loads with Exudyn: the graph of bodies and joints, integrated by its constraint solvers.

Planar mechanisms are made of its planar bodies, as its documentation advises. Its explicit integrators refuse joints. A loop with redundant
constraints needs the dense solver that ignores them.
"""

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    LoadMassProportional,
    LoadTorqueVector,
    MarkerBodyMass,
    MarkerBodyPosition,
    MarkerBodyRigid,
    NodeRigidBody2D,
    ObjectConnectorSpringDamper,
    ObjectGround,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
    SensorBody,
)
from exudyn.utilities import RigidBodyInertia
from motion_cases import Case

VERSION = exu.__version__
exu.config.printToConsole = False
exu.config.suppressWarnings = True
LOCKED = {"R": [1, 1, 1, 1, 1, 0], "P": [1, 1, 0, 1, 1, 1]}
SPARSE = 20
"""Bodies above which the sparse solver is the faster one."""
Setting = int


def variants(case: Case) -> tuple[str, ...]:
    """Solvers that serve."""
    return ("GeneralizedAlpha", "TrapezoidalIndex2")


def ladder(case: Case, variant: str) -> list[Setting]:
    """Steps from one output to the next."""
    return [2**k for k in range(2, 14)]


def planar(case: Case, mbs: exu.MainSystem) -> dict[str, object]:
    """Bodies and revolute joints in the plane."""
    items: dict[str, object] = {case.mechanism.frame: mbs.AddObject(ObjectGround())}
    centers = {case.mechanism.frame: np.zeros(3)}
    for body in case.bodies:
        node = mbs.AddNode(
            NodeRigidBody2D(
                referenceCoordinates=[*body.center[:2], 0.0],
                initialVelocities=[*body.velocity[:2], body.angular_velocity[2]],
            )
        )
        item = mbs.AddObject(
            ObjectRigidBody2D(nodeNumber=node, physicsMass=body.mass, physicsInertia=body.inertia[2, 2])
        )
        if case.gravity.any():
            mass = mbs.AddMarker(MarkerBodyMass(bodyNumber=item))
            mbs.AddLoad(LoadMassProportional(markerNumber=mass, loadVector=case.gravity))
        items[body.name], centers[body.name] = item, body.center
    for joint in case.joints:
        ends = [
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=items[link], localPosition=joint.point - centers[link]))
            for link in (joint.a, joint.b)
        ]
        mbs.AddObject(ObjectJointRevolute2D(markerNumbers=ends))
        if joint.name in case.couples:
            for end, sign in zip(ends, (-1.0, 1.0), strict=True):
                mbs.AddLoad(LoadTorqueVector(markerNumber=end, loadVector=[0, 0, sign * case.couples[joint.name]]))
    return items


def spatial(case: Case, mbs: exu.MainSystem) -> dict[str, object]:
    """Bodies and joints in space."""
    items: dict[str, object] = {case.mechanism.frame: mbs.CreateGround()}
    for body in case.bodies:
        items[body.name] = mbs.CreateRigidBody(
            referencePosition=body.center,
            initialVelocity=body.velocity,
            initialAngularVelocity=body.angular_velocity,
            inertia=RigidBodyInertia(mass=body.mass, inertiaTensor=body.inertia),
            gravity=case.gravity,
        )
    for joint in case.joints:
        mbs.CreateGenericJoint(
            itemNumbers=[items[joint.a], items[joint.b]],
            position=joint.point,
            rotationMatrixAxes=joint.axes,
            constrainedAxes=LOCKED[joint.kind],
        )
    return items


def settings(case: Case, steps: Setting) -> exu.SimulationSettings:
    """Steps from output to output, and the linear solver of the size."""
    out = exu.SimulationSettings()
    outputs = len(case.times) - 1
    out.timeIntegration.numberOfSteps = steps * outputs
    out.timeIntegration.endTime = case.times[-1]
    out.timeIntegration.minimumStepSize = case.times[-1] / outputs / steps / 100
    out.solution.file.write = False
    out.solution.sensors.writePeriod = case.times[-1] / outputs
    if len(case.bodies) > SPARSE:
        out.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    if not case.planar:
        out.linearSolver.solverType = exu.LinearSolverType.EigenDense
        out.linearSolver.ignoreSingularJacobian = True
    return out


def solve(case: Case, variant: str, steps: Setting) -> np.ndarray:
    """Positions ``(T, 3)``."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = (planar if case.planar else spatial)(case, mbs)
    centers = {body.name: body.center for body in case.bodies}
    for spring in case.springs:
        ends = [
            mbs.AddMarker(MarkerBodyPosition(bodyNumber=items[link], localPosition=p - centers.get(link, np.zeros(3))))
            for link, p in ((spring.a, np.asarray(spring.p)), (spring.b, np.asarray(spring.q)))
        ]
        mbs.AddObject(
            ObjectConnectorSpringDamper(
                markerNumbers=ends,
                referenceLength=spring.free_length,
                stiffness=spring.stiffness,
                damping=spring.damping,
            )
        )
    link, point = case.watched
    sensor = mbs.AddSensor(
        SensorBody(
            bodyNumber=items[link],
            localPosition=np.asarray(point) - centers[link],
            outputVariableType=exu.OutputVariableType.Position,
            storeInternal=True,
        )
    )
    mbs.Assemble()
    mbs.SolveDynamic(settings(case, steps), solverType=getattr(exu.DynamicSolverType, variant))
    found = np.asarray(mbs.GetSensorStoredData(sensor))[:, 1:4]
    return found if len(found) == len(case.times) else np.full((len(case.times), 3), np.nan)
