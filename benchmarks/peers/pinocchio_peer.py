"""Pinocchio: joint coordinates; its dynamics in C++, integrated by RK4 in Python or by SciPy.

It has no integrator of its own. Loops are closed by constraintDynamics with Baumgarte's numbers.
"""

import time

import mechanisms as scenes
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

VERSION = pin.__version__
#: Baumgarte's stabilisation: critically damped with 20 1/s. Proximal settings of the solver.
STABILISED = (400.0, 40.0)
PROXIMAL = (1e-12, 1e-10, 30)
#: pin.Data holds four tensors of nv^3 numbers; more than this is refused, bytes.
LARGEST = 2e9

JOINTS = {
    "free": pin.JointModelFreeFlyer,
    "spherical": pin.JointModelSpherical,
    "revolute": pin.JointModelRY,
}


class Tree:
    """A model and the state y = (q, v) that it starts from."""

    def __init__(self, mechanism):
        free = {"free": 6, "spherical": 3, "revolute": 1}
        size = sum(free[j.kind] for j in mechanism.joints if not j.closes)
        if 32.0 * size**3 > LARGEST:
            raise MemoryError(f"its data would need {32e-9 * size**3:.0f} GB")
        self.model = pin.Model()
        self.model.gravity.linear = np.array([0.0, 0.0, -mechanism.gravity])
        self.number, self.origin = {scenes.GROUND: 0}, {scenes.GROUND: np.zeros(3)}
        self.force = None  # generalised force of (q, v); None: no force
        q, v, cuts = [], [], []
        for joint in mechanism.joints:
            if joint.closes:
                cuts.append(joint)
                continue
            body = mechanism.bodies[joint.child]
            parent = joint.parent
            R = np.eye(3) if parent == scenes.GROUND else mechanism.bodies[parent].R
            at = body.x if joint.kind == "free" else joint.point
            start = np.zeros(3) if joint.kind == "free" else at
            place = pin.SE3(np.eye(3), R.T @ (start - self.origin[parent]))
            number = self.model.addJoint(self.number[parent], JOINTS[joint.kind](), place,
                                         f"j{joint.child}")  # fmt: skip
            inertia = pin.Inertia(body.mass, body.R.T @ (body.x - at), np.diag(body.J))
            self.model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
            self.number[joint.child], self.origin[joint.child] = number, at
            w = body.w
            if parent != scenes.GROUND:  # all axes are parallel to y or the frames still agree
                w = w - mechanism.bodies[parent].w
            if joint.kind == "revolute":
                turn = R.T @ body.R
                q, v = [*q, np.arctan2(turn[0, 2], turn[0, 0])], [*v, w[1]]
            elif joint.kind == "spherical":
                q, v = [*q, 0.0, 0.0, 0.0, 1.0], [*v, *w]
            else:
                q, v = [*q, *body.x, 0.0, 0.0, 0.0, 1.0], [*v, *body.v, *w]
        self.start = np.array([*q, *v])
        self.offset = [b.R.T @ (b.x - self.origin[k]) for k, b in enumerate(mechanism.bodies)]
        self.data = self.model.createData()
        self.tau = np.zeros(self.model.nv)
        self.constraints = self._closed(mechanism, cuts)
        self._quaternions()

    def _closed(self, mechanism, cuts):
        if not cuts:
            return None
        models, data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for joint in cuts:
            ends = []
            for k in (joint.parent, joint.child):
                local = mechanism.bodies[k].R.T @ (joint.point - self.origin[k])
                ends += [self.number[k], pin.SE3(np.eye(3), local)]
            one = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, self.model, *ends,
                                           pin.ReferenceFrame.LOCAL)  # fmt: skip
            one.m_baumgarte_parameters.Kp, one.m_baumgarte_parameters.Kd = STABILISED
            models.append(one)
        for one in models:
            data.append(one.createData())
        pin.initConstraintDynamics(self.model, self.data, models, data)
        return models, data, pin.ProximalSettings(*PROXIMAL)

    def _quaternions(self):
        """Places in q of all quaternions, in v of the rates that turn them; of free bodies."""
        q, v, self.free = [], [], []
        for number in range(1, self.model.njoints):
            joint = self.model.joints[number]
            if joint.nq == 4:
                q.append(joint.idx_q), v.append(joint.idx_v)
            elif joint.nq == 7:
                q.append(joint.idx_q + 3), v.append(joint.idx_v + 3)
                self.free.append((joint.idx_q, joint.idx_v))
        self.q_places = np.array(q, int)[:, None] + np.arange(4) if q else None
        self.v_places = np.array(v, int)[:, None] + np.arange(3) if v else None

    def normalised(self, q):
        """The same with quaternions of unit length."""
        if self.q_places is not None:
            quaternions = q[self.q_places]
            q = q.copy()
            q[self.q_places] = quaternions / np.sqrt((quaternions * quaternions).sum(1))[:, None]
        return q

    def q_rate(self, q, v):
        """dq/dt."""
        if self.q_places is None:
            return v
        rate = np.empty(self.model.nq)
        x, y, z, w = q[self.q_places].T
        a, b, c = v[self.v_places].T
        columns = (w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a,
                   -x * a - y * b - z * c)  # fmt: skip
        rate[self.q_places] = 0.5 * np.stack(columns, axis=1)
        for i, j in self.free:
            rate[i : i + 3] = scenes.rotation_of(q[[i + 6, i + 3, i + 4, i + 5]]) @ v[j : j + 3]
        return rate

    def rhs(self, _, y):
        """dy/dt."""
        nq = self.model.nq
        q, v = self.normalised(y[:nq]), y[nq:]
        tau = self.tau if self.force is None else self.force(q, v)
        if self.constraints is None:
            a = pin.aba(self.model, self.data, q, v, tau)
        else:
            models, data, settings = self.constraints
            a = pin.constraintDynamics(self.model, self.data, q, v, tau, models, data, settings)
        return np.concatenate([self.q_rate(q, v), a])

    def rk4(self, t_end, h):
        """End of steps of fixed length, and their number."""
        f, y, count = self.rhs, self.start, round(t_end / h)
        for _ in range(count):
            k1 = f(0.0, y)
            k2 = f(0.0, y + h / 2 * k1)
            k3 = f(0.0, y + h / 2 * k2)
            k4 = f(0.0, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return y, count

    def dop853(self, t_end, tolerance):
        """End of a run of SciPy, and the number of its right-hand sides."""
        done = solve_ivp(self.rhs, (0.0, t_end), self.start, "DOP853", rtol=tolerance,
                         atol=tolerance)  # fmt: skip
        return done.y[:, -1], done.nfev

    def end(self, y):
        """Mass centres and rotations."""
        pin.forwardKinematics(self.model, self.data, self.normalised(y[: self.model.nq]))
        x, R = [], []
        for k, offset in enumerate(self.offset):
            place = self.data.oMi[self.number[k]]
            x.append(place.translation + place.rotation @ offset)
            R.append(place.rotation.copy())
        return np.array(x), np.array(R)


def ladders(mechanism):
    """Methods, their parameters from coarse to fine, and what starts a trial."""
    tree = Tree(mechanism)
    if mechanism.name == "ball":

        def force(q, v):
            R = scenes.rotation_of(q[[6, 3, 4, 5]])
            lift = np.array([0.0, 0.0, scenes.contact_force(q[2], (R @ v[:3])[2])])
            return np.concatenate([R.T @ lift, np.zeros(3)])

        steps = [1e-3]
        return [("RK4, no force", steps, _trial(tree, Tree.rk4, mechanism)),
                ("RK4, Python force", steps, _trial(tree, Tree.rk4, mechanism, force))]  # fmt: skip
    steps = {"heavy-top": [5e-3, 2e-3, 1e-3, 5e-4]}.get(
        mechanism.name, [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3]
    )
    tolerances = [10.0**-k for k in range(2, 14)]
    return [("RK4", steps, _trial(tree, Tree.rk4, mechanism)),
            ("SciPy DOP853", tolerances, _trial(tree, Tree.dop853, mechanism))]  # fmt: skip


def _trial(tree, method, mechanism, force=None):
    def start(parameter):
        state = [None]

        def run():
            tree.force = force
            before = time.thread_time()
            state[0], steps = method(tree, mechanism.t_end, parameter)
            return time.thread_time() - before, steps

        return run, lambda: tree.end(state[0])

    return start
