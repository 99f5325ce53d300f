"""Models in MuJoCo, the oracle of imports: states, masses and accelerations of its bodies."""

import numpy as np

import dap3d_core as dap


class Oracle:
    """A model that MuJoCo has read, without contacts, limits, friction and equalities."""

    def __init__(self, path, *, compiled=None):
        import mujoco

        self.mujoco = mujoco
        self.model = m = compiled or mujoco.MjModel.from_xml_path(str(path))
        off = mujoco.mjtDisableBit
        m.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_EQUALITY
        m.dof_frictionloss[:] = 0.0
        self.data = mujoco.MjData(m)
        #: names of all joints in their order, for files that leave some out
        self.unnamed = []

    def name(self, kind, k):
        return self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, kind), k)

    def randomise(self, rng):
        """A random state; coordinates and rates of the joints by name, as an import takes them."""
        m, d, q, rates = self.model, self.data, {}, {}
        for j in range(m.njnt):
            a, v = m.jnt_qposadr[j], m.jnt_dofadr[j]
            name = self.name("mjOBJ_JOINT", j) or (self.unnamed[j] if self.unnamed else None)
            size = {0: 6, 1: 3}.get(int(m.jnt_type[j]), 1)
            d.qvel[v : v + size] = rng.uniform(-1.0, 1.0, size)
            if size == 1:
                d.qpos[a] = m.qpos0[a] + rng.uniform(-1.0, 1.0)
                q[name] = float(d.qpos[a])
            else:
                turn = rng.normal(size=4)
                d.qpos[a : a + size - 3] = rng.normal(size=size - 3)
                d.qpos[a + size - 3 : a + size + 1] = turn / np.linalg.norm(turn)
                q[name] = tuple(d.qpos[a : a + size + 1])
            rates[name] = tuple(d.qvel[v : v + size])
        self.mujoco.mj_forward(m, d)
        return q, rates

    def scene(self, path, rng):
        """A file imported at a random state, with the controls and activations of this model."""
        positions, rates = self.randomise(rng)
        scene, report = dap.import_model(path, positions=positions, rates=rates, limits="off")
        assert not [one for one in report.left_out if one.motion]
        for value, one in zip(self.data.ctrl, scene.inputs.values(), strict=True):
            one.value = float(value)
        states = [one for one in scene.forces.values() if one.fields.get("activation")]
        for value, one in zip(self.data.act, states, strict=True):
            one.fields["z_0"] = float(value)
        return scene

    def check_accelerations(self, scene, names, atol):
        """A run of the scene begins with the accelerations of bodies that MuJoCo has now."""
        result = dap.simulate(scene, t_end=0.0)
        for name in names:
            b, k = self.model.body(name).id, list(scene.bodies).index(name)
            found = np.concatenate([result.rdd[0, k], result.wd[0, k]])
            expected = self.acceleration(b, self.group(b)[1])
            np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)

    def group(self, body):
        """Mass, mass centre, and inertia in the body's axes, of all that is fixed to a body."""
        m, d = self.model, self.data
        fixed = [b for b in range(1, m.nbody) if m.body_weldid[b] == body]
        mass = sum(m.body_mass[b] for b in fixed)
        com = sum(m.body_mass[b] * d.xipos[b] for b in fixed) / mass
        inertia = np.zeros((3, 3))
        for b in fixed:
            A, arm = d.ximat[b].reshape(3, 3), d.xipos[b] - com
            inertia += A @ np.diag(m.body_inertia[b]) @ A.T
            inertia += m.body_mass[b] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        A = d.xmat[body].reshape(3, 3)
        return mass, com, A.T @ inertia @ A

    def acceleration(self, body, point):
        """Acceleration of a point of a body, and its angular acceleration, in global axes."""
        m, d = self.model, self.data
        J, J_dot = np.zeros((2, 3, m.nv)), np.zeros((2, 3, m.nv))
        self.mujoco.mj_jac(m, d, J[0], J[1], point, body)
        self.mujoco.mj_jacDot(m, d, J_dot[0], J_dot[1], point, body)
        return (J @ d.qacc + J_dot @ d.qvel).ravel()
