"""Drake: joint coordinates in a MultibodyPlant; loops only in its discrete plant."""

import importlib.metadata
import time

import mechanisms as scenes
import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import (
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem

VERSION = importlib.metadata.version("drake")


class Plant:
    """A plant with its bodies and what sets its start; ``h`` makes it discrete."""

    def __init__(self, mechanism, h=0.0):
        self.plant = self.system = MultibodyPlant(h)
        if h:
            self.plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        down = np.array([0.0, 0.0, -mechanism.gravity])
        self.plant.mutable_gravity_field().set_gravity_vector(down)
        self.mechanism, self.bodies, self.starts = mechanism, {}, []
        self.origin = {scenes.GROUND: np.zeros(3)}
        for k, joint in enumerate(mechanism.joints):
            self._add(k, joint)
        self.plant.Finalize()

    def _rotation(self, k):
        return np.eye(3) if k == scenes.GROUND else self.mechanism.bodies[k].R

    def _local(self, k, point):
        return self._rotation(k).T @ (point - self.origin[k])

    def _add(self, k, joint):
        a, b = joint.parent, joint.child
        if joint.closes:
            self.plant.AddBallConstraint(self.bodies[a], self._local(a, joint.point),
                                         self.bodies[b], self._local(b, joint.point))  # fmt: skip
            return
        body = self.mechanism.bodies[b]
        self.origin[b] = body.x if joint.kind == "free" else joint.point
        inertia = SpatialInertia.MakeFromCentralInertia(
            body.mass, self._local(b, body.x), RotationalInertia(*body.J)
        )
        self.bodies[b] = made = self.plant.AddRigidBody(f"b{b}", inertia)
        if joint.kind == "free":
            self.starts.append(lambda c: self._free(c, made, body))
            return
        axes = self.mechanism.axes if joint.kind == "spherical" else np.eye(3)
        where = RigidTransform(RotationMatrix(axes), self._local(a, joint.point))
        base = self.plant.world_frame() if a == scenes.GROUND else self.bodies[a].body_frame()
        turned = RigidTransform(RotationMatrix(axes), np.zeros(3))
        first = self.plant.AddFrame(FixedOffsetFrame(f"f{k}", base, where))
        second = self.plant.AddFrame(FixedOffsetFrame(f"g{k}", made.body_frame(), turned))
        w = body.w if a == scenes.GROUND else body.w - self.mechanism.bodies[a].w
        if joint.kind == "spherical":
            ball = self.plant.AddJoint(BallRpyJoint(f"j{k}", first, second))
            self.starts.append(lambda c: ball.set_angles(c, np.zeros(3)))
            self.starts.append(lambda c: ball.set_angular_velocity(c, axes.T @ w))
        else:
            hinge = self.plant.AddJoint(RevoluteJoint(f"j{k}", first, second, [0.0, 1.0, 0.0]))
            turn = self._rotation(a).T @ body.R
            angle = float(np.arctan2(turn[0, 2], turn[0, 0]))
            self.starts.append(lambda c: hinge.set_angle(c, angle))
            self.starts.append(lambda c: hinge.set_angular_rate(c, w[1]))

    def _free(self, context, made, body):
        self.plant.SetFreeBodyPose(context, made, RigidTransform(body.x))
        velocity = SpatialVelocity(body.R @ body.w, body.v)
        self.plant.SetFreeBodySpatialVelocity(context, made, velocity)

    def end(self, context):
        """Mass centres and rotations."""
        x, R = [], []
        for k, body in enumerate(self.mechanism.bodies):
            pose = self.plant.EvalBodyPoseInWorld(context, self.bodies[k])
            R.append(pose.rotation().matrix())
            x.append(pose.translation() + R[-1] @ self._local(k, body.x))
        return np.array(x), np.array(R)


def trial(plant_of, scheme, fixed=False):
    """What starts a trial: of a discrete plant where scheme is None."""

    def start(parameter):
        made = plant_of(parameter)
        t_end = made.mechanism.t_end
        context = made.system.CreateDefaultContext()
        own = made.plant.GetMyMutableContextFromRoot(context)
        simulator = Simulator(made.system, context)
        if scheme:
            ResetIntegratorFromFlags(simulator, scheme, parameter if fixed else t_end)
            integrator = simulator.get_mutable_integrator()
            integrator.set_maximum_step_size(parameter if fixed else max(t_end / 20, 1e-3))
            integrator.set_fixed_step_mode(fixed)
            if not fixed:
                integrator.set_target_accuracy(parameter)

        def run():
            context.SetTime(0.0)
            for set_start in made.starts:
                set_start(own)
            simulator.Initialize()
            if scheme:
                integrator.ResetStatistics()
            before = time.thread_time()
            simulator.AdvanceTo(t_end)
            seconds = time.thread_time() - before
            return seconds, integrator.get_num_steps_taken() if scheme else round(t_end / parameter)

        return run, lambda: made.end(own)

    return start


class PythonForce(LeafSystem):
    """The contact force of the ball, from the plant's state."""

    def __init__(self, body):
        LeafSystem.__init__(self)
        self.body = body.index()
        self.DeclareVectorInputPort("x", BasicVector(13))
        empty = Value[list[ExternallyAppliedSpatialForce]]
        self.DeclareAbstractOutputPort("f", lambda: empty(), self._calculate)

    def _calculate(self, context, output):
        x = self.get_input_port(0).Eval(context)
        force = ExternallyAppliedSpatialForce()
        force.body_index, force.p_BoBq_B = self.body, np.zeros(3)
        lift = np.array([0.0, 0.0, scenes.contact_force(x[6], x[12])])
        force.F_Bq_W = SpatialForce(np.zeros(3), lift)
        output.set_value([force])


def _ball(mechanism, with_force):
    made = Plant(mechanism)
    builder = DiagramBuilder()
    builder.AddSystem(made.plant)
    if with_force:
        force = builder.AddSystem(PythonForce(made.bodies[0]))
        builder.Connect(made.plant.get_state_output_port(), force.get_input_port(0))
        applied = made.plant.get_applied_spatial_force_input_port()
        builder.Connect(force.get_output_port(0), applied)
    made.system = builder.Build()
    return made


def ladders(mechanism):
    """Methods, their parameters from coarse to fine, and what starts a trial."""
    if mechanism.name == "ball":
        return [(f"runge_kutta3 fixed, {word}", [1e-3],
                 trial(lambda _, f=force: _ball(mechanism, f), "runge_kutta3", fixed=True))
                for word, force in (("no force", False), ("Python force", True))]  # fmt: skip
    if any(joint.closes for joint in mechanism.joints):
        discrete = trial(lambda h: Plant(mechanism, h), None)
        return [("discrete SAP", [1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4], discrete)]
    plant = Plant(mechanism)
    coarse = {"heavy-top": [2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4]}
    steps = coarse.get(mechanism.name, [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3])
    tolerances = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10]
    found = [("runge_kutta5 fixed", steps, trial(lambda _: plant, "runge_kutta5", fixed=True))]
    if mechanism.size <= 2:
        found += [(name, tolerances, trial(lambda _: plant, name))
                  for name in ("runge_kutta3", "runge_kutta5")]  # fmt: skip
    return found
