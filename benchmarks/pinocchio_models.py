"""URDF models in Pinocchio, the oracle of imports; their roots are fixed."""

import numpy as np


class Oracle:
    """A model that Pinocchio has read; friction, limits and mimic joints have no effect in it."""

    def __init__(self, path):
        import pinocchio

        self.pin = pinocchio
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.q, self.v, self.tau = (np.zeros(n) for n in (self.model.nq, *(self.model.nv,) * 2))
        self.links, self.largest = {}, 1.0
        for number in range(1, self.model.njoints):
            joint = self.model.joints[number]
            if joint.nv != 1 or joint.nq > 2:
                raise ValueError(f"{self.model.names[number]}: a {joint.shortname()} joint")

    def use(self, model):
        """Take the names of links, each placed by a joint."""
        names = list(self.model.names)
        self.links = {
            model.joints[name].child: number
            for number, name in enumerate(names) if name in model.joints
        }  # fmt: skip

    def randomise(self, rng):
        """A random state: coordinates, rates and forces of the joints by name."""
        positions, rates, torques = {}, {}, {}
        for number in range(1, self.model.njoints):
            joint, name = self.model.joints[number], self.model.names[number]
            q, v, torque = rng.uniform(-1.0, 1.0, 3)
            at = slice(joint.idx_q, joint.idx_q + joint.nq)
            self.q[at] = (np.cos(q), np.sin(q)) if joint.nq == 2 else q
            self.v[joint.idx_v], self.tau[joint.idx_v] = v, torque
            positions[name], rates[name], torques[name] = (q,), (v,), torque
        return positions, rates, torques

    def evaluate(self, *, accelerations):
        """Compute poses, and accelerations where asked for."""
        pin, model, data = self.pin, self.model, self.data
        if not accelerations:
            pin.forwardKinematics(model, data, self.q)
            return
        a = pin.aba(model, data, self.q, self.v, self.tau - model.damping * self.v).copy()
        self.largest = max(1.0, np.abs(a).max(initial=0.0))
        pin.forwardKinematics(model, data, self.q, self.v, a)

    def bodies(self, *, accelerations):
        """Link -> mass, mass centre, inertia and axes; acceleration there and angular one."""
        pin, found = self.pin, {}
        for link, number in self.links.items():
            place, inertia = self.data.oMi[number], self.model.inertias[number]
            A, arm, both = place.rotation, place.rotation @ inertia.lever, None
            if accelerations:
                frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
                a = pin.getClassicalAcceleration(self.model, self.data, number, frame)
                w = pin.getVelocity(self.model, self.data, number, frame).angular
                linear = a.linear + np.cross(a.angular, arm) + np.cross(w, np.cross(w, arm))
                both = np.concatenate([linear, a.angular])
            centre = place.translation + arm
            found[link] = (inertia.mass, centre, inertia.inertia, A, both)
        return found
