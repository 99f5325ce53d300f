"""SDF models in Drake, the oracle of imports."""

import numpy as np


class Oracle:
    """A model that Drake has read, continuous in time; limits and friction have no effect in it."""

    def __init__(self, path, gravity):
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        self.plant = plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(path))
        plant.mutable_gravity_field().set_gravity_vector(gravity)
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.tau = np.zeros(plant.num_velocities())
        if plant.num_actuators():
            still = np.zeros(plant.num_actuated_dofs())
            plant.get_actuation_input_port().FixValue(self.context, still)
        self.joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        self.links, self.named, self.largest, self.v_dot = {}, {}, 1.0, None
        self.evaluate(accelerations=True)  # raises RuntimeError for what it cannot compute

    def use(self, model):
        """Take the names of links and joints, those of a single model without its own."""
        plant = self.plant
        for index in range(1, plant.num_bodies()):
            body = plant.get_body(_index(index))
            for name in (str(body.scoped_name()), body.name()):
                if name in model.links:
                    self.links[name] = body
                    break
        for joint in self.joints:
            owner = plant.GetModelInstanceName(joint.model_instance())
            for name in (f"{owner}::{joint.name()}", joint.name()):
                if name in model.joints and joint.num_velocities() == 1:
                    self.named[name] = joint
                    break

    def randomise(self, rng):
        """A random state: coordinates, rates and forces of the joints by name."""
        q, v = (np.array(x) for x in (self.plant.GetPositions(self.context),
                                      self.plant.GetVelocities(self.context)))  # fmt: skip
        positions, rates, torques = {}, {}, {}
        for name, joint in self.named.items():
            values = rng.uniform(-1.0, 1.0, 3)
            q[joint.position_start()], v[joint.velocity_start()] = values[:2]
            self.tau[joint.velocity_start()] = values[2]
            positions[name], rates[name], torques[name] = (values[0],), (values[1],), values[2]
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)
        return positions, rates, torques

    def evaluate(self, *, accelerations):
        """Compute accelerations where asked for."""
        plant, context = self.plant, self.context
        if accelerations:
            plant.get_applied_generalized_force_input_port().FixValue(context, self.tau)
            v_dot = plant.get_generalized_acceleration_output_port().Eval(context)
            self.largest = max(1.0, np.abs(v_dot).max(initial=0.0))
            self.v_dot = plant.CalcSpatialAccelerationsFromVdot(context, v_dot)

    def bodies(self, *, accelerations):
        """Link -> mass, mass centre, inertia and axes; acceleration there and angular one."""
        plant, context, found = self.plant, self.context, {}
        for link, body in self.links.items():
            pose = plant.EvalBodyPoseInWorld(context, body)
            welded = [one.index() for one in plant.GetBodiesWeldedTo(body)]
            inertia = plant.CalcSpatialInertia(context, body.body_frame(), welded)
            A, com = pose.rotation().matrix(), inertia.get_com()
            about = inertia.CalcRotationalInertia().CopyToFullMatrix3()
            mass = inertia.get_mass()
            J = about - mass * (com @ com * np.eye(3) - np.outer(com, com))
            arm, both = A @ com, None
            if accelerations:
                a = self.v_dot[body.index()]
                w = plant.EvalBodySpatialVelocityInWorld(context, body).rotational()
                turning = a.rotational()
                linear = a.translational() + np.cross(turning, arm) + np.cross(w, np.cross(w, arm))
                both = np.concatenate([linear, turning])
            found[link] = (mass, pose.translation() + arm, J, A, both)
        return found


def _index(number):
    from pydrake.multibody.tree import BodyIndex

    return BodyIndex(number)
