"""Exudyn: trees in joint coordinates, explicit; loops and long chains by an index-2 method."""

import sys
import time

sys.exudynFast = True  # the module without range checks

import exudyn  # noqa: E402
import exudyn.utilities as items  # noqa: E402
import mechanisms as scenes  # noqa: E402
import numpy as np  # noqa: E402

exudyn.config.printToConsole = False
VERSION = exudyn.config.Version()
SOLVERS, LINEAR = exudyn.DynamicSolverType, exudyn.LinearSolverType
OUTPUT, NODES = exudyn.OutputVariableType, exudyn.NodeType
EXPLICIT = {name: getattr(SOLVERS, name) for name in ("RK44", "RK67", "DOPRI5")}
ADAPTIVE = ("DOPRI5",)
GENERALIZED_ALPHA = SOLVERS.GeneralizedAlpha
TOLERANCES = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12]
#: Joint coordinates cost n^3 there: beyond these sizes only redundant coordinates are measured.
LARGEST_TREE = {"spherical-chain": 64, "revolute-chain": 256}


def settings(t_end, parameter, *, adaptive=False, explicit=None, linear=None):
    """Settings of a run; ``explicit`` is "body" where each body has its own mass matrix."""
    made = exudyn.SimulationSettings()
    made.solution.file.write = False
    made.solution.sensors.active = False
    run = made.timeIntegration
    run.endTime, run.verboseMode, run.stepInformation = t_end, 0, 0
    run.numberOfSteps = 20 if adaptive else round(t_end / parameter)
    run.automaticStepSize = adaptive
    if adaptive:
        run.absoluteTolerance = run.relativeTolerance = parameter
        run.initialStepSize, run.minimumStepSize = 1e-4, 1e-10
    if explicit:
        run.explicit.computeEndOfStepAccelerations = False
        run.explicit.computeMassMatrixInversePerBody = explicit == "body"
    made.linearSolver.solverType = linear or LINEAR.EXUdense
    made.linearSolver.reuseAnalyzedPattern = True
    made.linearSolver.showCausingItems = False
    made.parallel.numberOfThreads = 1
    return made


def trial(mbs, end, mechanism, name, **options):
    """What starts a trial of a solver by name."""
    solver = EXPLICIT.get(name, GENERALIZED_ALPHA)

    def start(parameter):
        how = settings(mechanism.t_end, parameter, adaptive=name in ADAPTIVE, **options)

        def run():
            before = time.thread_time()
            good = mbs.SolveDynamic(how, solverType=solver, showCausingItems=False)
            seconds = time.thread_time() - before
            if not good:
                raise RuntimeError("the solver reports failure")
            return seconds, mbs.sys["dynamicSolver"].it.currentStepIndex - 1

        return run, end

    return start


def explicit_ladders(mbs, end, mechanism, steps, mode, names=tuple(EXPLICIT)):
    """All explicit methods."""
    return [(name, TOLERANCES if name in ADAPTIVE else steps,
             trial(mbs, end, mechanism, name, explicit=mode)) for name in names]  # fmt: skip


def new():
    """A container, which must be kept, and its system."""
    container = exudyn.SystemContainer()
    return container, container.AddSystem()


def rigid(mbs, body, node, gravity, J=None, at=None):
    """A rigid body; at another place and with another inertia where these are given."""
    inertia = items.RigidBodyInertia(
        mass=body.mass, inertiaTensor=np.diag(body.J if J is None else J), com=np.zeros(3)
    )
    return mbs.CreateRigidBody(
        referencePosition=list(body.x if at is None else at), referenceRotationMatrix=body.R,
        initialVelocity=list(body.v if at is None else 0 * body.v),
        initialAngularVelocity=list(body.R @ body.w), inertia=inertia, nodeType=node,
        gravity=[0.0, 0.0, -gravity], returnDict=True,
    )  # fmt: skip


def end_of(container, mbs, bodies, arm=(0.0, 0.0, 0.0)):
    """What reads mass centres and rotations; it holds the container."""

    def read(body, what):
        current = exudyn.ConfigurationType.Current
        return np.array(mbs.GetObjectOutputBody(body, what, list(arm), current))

    def end(_keep=container):
        x = np.array([read(b, OUTPUT.Position) for b in bodies])
        return x, np.array([read(b, OUTPUT.RotationMatrix).reshape(3, 3) for b in bodies])

    return end


def free_body(mechanism):
    """Rotation vectors, each body with its own mass matrix."""
    container, mbs = new()
    made = rigid(mbs, mechanism.bodies[0], NODES.RotationRotationVector, 0.0)
    mbs.Assemble()
    end = end_of(container, mbs, [made["bodyNumber"]])
    return explicit_ladders(mbs, end, mechanism, [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3], "body")


def heavy_top(mechanism):
    """The body's origin at the pivot, held by three coordinate constraints; weight as a force.

    With the mass centre away from the origin explicit solvers converge to another motion there.
    """
    container, mbs = new()
    body = mechanism.bodies[0]
    arm = body.x
    J = body.J + body.mass * (arm @ arm - arm**2)
    made = rigid(mbs, body, NODES.RotationRotationVector, 0.0, J, np.zeros(3))
    where = items.MarkerBodyPosition(bodyNumber=made["bodyNumber"], localPosition=list(arm))
    weight = [0.0, 0.0, -body.mass * mechanism.gravity]
    mbs.AddLoad(items.LoadForceVector(markerNumber=mbs.AddMarker(where), loadVector=weight))
    ground = mbs.AddNode(items.NodePointGround())
    fixed = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for k in range(3):
        moving = items.MarkerNodeCoordinate(nodeNumber=made["nodeNumber"], coordinate=k)
        held = items.CoordinateConstraint(markerNumbers=[fixed, mbs.AddMarker(moving)])
        mbs.AddObject(held)
    mbs.Assemble()
    end = end_of(container, mbs, [made["bodyNumber"]], arm)
    return explicit_ladders(mbs, end, mechanism, [2e-3, 1e-3, 5e-4, 2e-4, 1e-4], "whole")


def tree(mechanism):
    """A KinematicTree; a spherical joint is three revolutes about y, z, x with massless links."""
    container, mbs = new()
    kinds = exudyn.JointType
    spherical = mechanism.joints[0].kind == "spherical"
    each = [kinds.RevoluteY, kinds.RevoluteZ, kinds.RevoluteX] if spherical else [kinds.RevoluteY]
    n, k = mechanism.size, len(each)
    mass, speeds = [], np.zeros(n * k)
    arms, J, offsets, turns = (exudyn.Vector3DList(), exudyn.Matrix3DList(),
                               exudyn.Vector3DList(), exudyn.Matrix3DList())  # fmt: skip
    for i in range(n * k):
        body, last = mechanism.bodies[i // k], i % k == k - 1
        mass.append(body.mass if last else 0.0)
        J.Append(np.diag(body.J) if last else np.zeros((3, 3)))
        arms.Append([0.5 if last else 0.0, 0.0, 0.0])
        offsets.Append([1.0 if i and i % k == 0 else 0.0, 0.0, 0.0])
        turns.Append(np.eye(3))
    if spherical:
        speeds[2] = mechanism.bodies[0].w[0]
    zeros = [0.0] * (n * k)
    node = mbs.AddNode(items.NodeGenericODE2(
        numberOfODE2Coordinates=n * k, referenceCoordinates=zeros, initialCoordinates=zeros,
        initialCoordinates_t=list(speeds)))  # fmt: skip
    mbs.AddObject(items.ObjectKinematicTree(
        nodeNumber=node, jointTypes=each * n, linkParents=list(np.arange(n * k) - 1),
        jointTransformations=turns, jointOffsets=offsets, linkInertiasCOM=J, linkCOMs=arms,
        linkMasses=mass, gravity=[0.0, 0.0, -mechanism.gravity]))  # fmt: skip
    mbs.Assemble()

    def end(_keep=container):
        q = np.reshape(mbs.GetNodeOutput(node, OUTPUT.Coordinates), (n, k))
        R, start, x, rotations = np.eye(3), np.zeros(3), [], []
        for angles in q:
            R = R @ scenes.about_y(angles[0])
            if spherical:
                R = R @ _about(angles[1], 2) @ _about(angles[2], 0)
            x.append(start + R[:, 0] / 2)
            start = start + R[:, 0]
            rotations.append(R)
        return np.array(x), np.array(rotations)

    steps = [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3]
    names = ("RK44", "DOPRI5") if n > 16 else tuple(EXPLICIT)
    return explicit_ladders(mbs, end, mechanism, steps, "whole", names)


def _about(angle, axis):
    """Rotation matrix about a coordinate axis."""
    c, s, R = np.cos(angle), np.sin(angle), np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R


def redundant(mechanism, steps, linear):
    """Euler parameters and all joints by constraints; the closing joint holds x and z alone."""
    container, mbs = new()
    made = {scenes.GROUND: mbs.CreateGround()}
    for k, body in enumerate(mechanism.bodies):
        node = NODES.RotationEulerParameters
        made[k] = rigid(mbs, body, node, mechanism.gravity)["bodyNumber"]
    for joint in mechanism.joints:
        common = dict(itemNumbers=[made[joint.parent], made[joint.child]],
                      position=list(joint.point), useGlobalFrame=True, show=False)  # fmt: skip
        if joint.closes:
            axes = dict(constrainedAxes=[1, 0, 1, 0, 0, 0], rotationMatrixAxes=np.eye(3))
            mbs.CreateGenericJoint(**common, **axes)
        elif joint.kind == "spherical":
            mbs.CreateSphericalJoint(**common)
        else:
            mbs.CreateRevoluteJoint(axis=[0, 1, 0], **common)
    mbs.Assemble()
    end = end_of(container, mbs, [made[k] for k in range(len(mechanism.bodies))])
    title = "GeneralizedAlpha, Euler parameters"
    return [(title, steps, trial(mbs, end, mechanism, "GeneralizedAlpha", linear=linear))]


def chain(mechanism):
    """Joint coordinates, and redundant ones where there are many bodies."""
    n, found = mechanism.size, []
    if n <= LARGEST_TREE[mechanism.name]:
        found += tree(mechanism)
    if n >= 64:
        steps = [1e-2, 2e-3, 1e-3] if n <= 256 else [1e-2, 1e-3, 5e-4]
        found += redundant(mechanism, steps, LINEAR.EigenSparse)
    return found


def loops(mechanism):
    """Four-bars."""
    linear = LINEAR.EXUdense if mechanism.size < 3 else LINEAR.EigenSparse
    return redundant(mechanism, [1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4], linear)


def ball(mechanism):
    """A mass point with a spring on its z coordinate, whose force is of different kinds."""
    k, c, radius = scenes.STIFFNESS, scenes.DAMPING, scenes.RADIUS
    height = mechanism.bodies[0].x[2]

    def contact(_mbs, _t, _item, u, v, _k, _c, _offset):
        return -scenes.contact_force(u + height, v)

    def symbolic(_mbs, _t, _item, u, v, _k, _c, _offset):
        e, depth = exudyn.symbolic, (radius - height) - u
        return e.IfThenElse(depth > 0.0, -e.max(0.0, k * depth - c * v), e.Real(0.0))

    cases = [("no force", None, None), ("built-in spring", {}, None),
             ("Python force", {"springForceUserFunction": contact}, None),
             ("symbolic Python force", {}, symbolic)]  # fmt: skip
    found = []
    for title, more, law in cases:
        container, mbs = new()
        node = mbs.AddNode(items.NodePoint(referenceCoordinates=[0.0, 0.0, height]))
        point = mbs.AddObject(items.MassPoint(mass=1.0, nodeNumber=node))
        weight = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=point))
        down = [0.0, 0.0, -mechanism.gravity]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=down))
        ground = mbs.AddNode(items.NodePointGround())
        ends = [mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=a, coordinate=b))
                for a, b in ((ground, 0), (node, 2))]  # fmt: skip
        spring = None
        if more is not None:
            more |= {"stiffness": k, "damping": c, "offset": radius - height}
            law_of = items.CoordinateSpringDamper(markerNumbers=ends, **more)
            spring = mbs.AddObject(law_of)
        mbs.Assemble()
        if law is not None:
            made = items.CreateSymbolicUserFunction(mbs, law, "springForceUserFunction", spring)
            mbs.SetObjectParameter(spring, "springForceUserFunction", made)
            mbs.Assemble()

        def end(_keep=container, mbs=mbs, node=node):
            return np.array(mbs.GetNodeOutput(node, OUTPUT.Position))[None], np.eye(3)[None]

        start = trial(mbs, end, mechanism, "RK44", explicit="whole")
        found.append((f"RK44, {title}", [1e-3], start))
    return found


MAKERS = {
    "free-body": free_body, "heavy-top": heavy_top, "spherical-chain": chain,
    "revolute-chain": chain, "four-bar": loops, "four-bars": loops, "ball": ball,
}  # fmt: skip


def ladders(mechanism):
    """Methods, their parameters from coarse to fine, and what starts a trial."""
    return MAKERS[mechanism.name](mechanism)
