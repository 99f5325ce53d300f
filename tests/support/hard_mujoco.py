"""Models in MuJoCo with limits, equalities and contacts as hard as it has them."""

import mujoco
import numpy as np

from support.bare_mujoco import compiled
from support.mujoco_models import Oracle

#: What has a softness.
SOLREF = ("geom_solref", "jnt_solref", "eq_solref", "pair_solref", "tendon_solref_lim")
SOLIMP = ("geom_solimp", "jnt_solimp", "eq_solimp", "pair_solimp", "tendon_solimp_lim")
#: Impedances from which accelerations are extrapolated to rigid ones; MuJoCo has none above.
IMPEDANCES = (0.9998, 0.9999)
#: By this the inverse inertias are less by which MuJoCo softens constraints at rest: they are of
#: bodies alone, and armature and loops leave a thousandth of them.
HARDER = 1e-3
#: Distance from its limit at which a joint is held by it, rad and m.
AT_LIMIT = 1e-9
#: Gap below which geoms touch and limits hold once they are at rest, m and rad; overlap that is
#: left, m: more than MuJoCo's meshes lose to single precision.
NEAR, OVERLAP = 1e-6, 1e-7
#: Weights of alternating directions that are tried, beside rows of unit size; the most turns of
#: each; an impulse beyond which they are lost.
WEIGHTS, MOST_TURNS, DIVERGED = (0.1, 0.01, 1.0), 20_000, 1e12
#: Numbers of MuJoCo's kinds of constraints: equalities, limits of joints and tendons.
EQUALITY, LIMITS = 0, (3, 4)


class HardOracle(Oracle):
    """A model of an MJCF file, without dry friction of joints, fluids, and friction of spin.

    Its cone is elliptic, and it slips by no regularisation (noslip).

    Attributes:
        overlap: the largest overlap, or gap of an equality, that is left, m or rad.
    """

    def __init__(self, path):
        self.mujoco, self.unnamed, self.known = mujoco, [], set()
        self.model = m = compiled(path)
        m.opt.cone, m.opt.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
        m.opt.timestep, m.opt.tolerance, m.opt.noslip_tolerance = 5e-4, 0.0, 0.0
        m.opt.ls_iterations, m.opt.ls_tolerance, m.opt.impratio = 200, 1e-6, 1.0
        m.opt.density = m.opt.viscosity = 0.0
        m.opt.wind[:] = m.dof_frictionloss[:] = 0.0
        m.geom_margin[:] = m.geom_gap[:] = m.jnt_margin[:] = 0.0
        m.geom_condim[:] = np.minimum(m.geom_condim, 3)
        self.data, self.overlap = mujoco.MjData(m), 0.0

    def keys(self):
        """Numbers and names of the keyframes that have one."""
        names = ((k, self.name("mjOBJ_KEY", k)) for k in range(self.model.nkey))
        return ((k, name) for k, name in names if name)

    def settle(self, time, key):
        """Move for a time from a keyframe, or from the pose of the file; then at rest there.

        Accelerations are those of bodies that overlap no further, and are not pushed apart.
        """
        m, d = self.model, self.data
        if key is not None:
            mujoco.mj_resetDataKeyframe(m, d, key)
        activations = d.act.copy()
        self._soften((0.004, 1.0), IMPEDANCES[1])
        m.opt.iterations, m.opt.noslip_iterations = 50, 0
        for _ in range(round(time / m.opt.timestep)):
            mujoco.mj_step(m, d)
        m.opt.iterations, m.opt.noslip_iterations = 500, 200
        d.qvel[:], d.act[:], found = 0.0, activations, []
        m.opt.ccd_tolerance, m.opt.ccd_iterations = 1e-12, 200
        self._soften((-1e-9, -1e-9), IMPEDANCES[1])
        self._move_apart()
        for inverse in (m.body_invweight0, m.dof_invweight0, m.tendon_invweight0):
            inverse *= HARDER
        for impedance in IMPEDANCES:
            self._soften((-1e-9, -1e-9), impedance)
            mujoco.mj_forward(m, d)
            found.append(d.qacc.copy())
        d.qacc[:] = 2.0 * found[1] - found[0]

    def follow_coulomb(self):
        """Take the accelerations of rigid contacts with Coulomb's law, of MuJoCo's own matrices.

        MuJoCo's contacts yield, and lift where they slide: its friction is that of the nearest
        convex problem. De Saxce's shift of normal velocities, by mu times the slip, undoes that
        (Math. Comput. Modelling 28, 1998); solved by alternating directions.

        Raises:
            ValueError: not solved to 1e-9 of the largest force.
        """
        d = self.data
        J, M = self._rows()
        A, b = J @ np.linalg.solve(M, J.T), J @ d.qacc_smooth
        cones = [(c.efc_address, c.friction[0] if c.dim > 1 else 0.0) for c in d.contact]
        cones = [(k, mu) for k, mu in cones if k >= 0 and mu]
        alone = np.isin(d.efc_type, (3, 4, 5))  # limits, and contacts without friction
        scale = 1.0 / np.sqrt(np.diag(A))
        for k, _ in cones:  # as the same for all rows of a cone, it leaves the cone as it is
            scale[k : k + 3] = scale[k : k + 3].mean()
        A, b, start = scale * (scale * A).T, scale * b, d.efc_force / scale
        for size in WEIGHTS:
            x = solve_cones(A, b, cones, alone, start, size)
            if x is not None:
                d.qacc[:] = d.qacc_smooth + np.linalg.solve(M, J.T @ (scale * x))
                return
        raise ValueError("rigid contacts are not solved")

    def _rows(self):
        """Rows of constraints, and the mass matrix."""
        m, d, mj = self.model, self.data, self.mujoco
        J, M = np.zeros((d.nefc, m.nv)), np.zeros((m.nv, m.nv))
        mj.mj_fullM(m, d, M)
        for k in range(m.nv):  # J e_k, however J is stored
            mj.mj_mulJacVec(m, d, column := np.zeros(d.nefc), np.eye(m.nv)[k])
            J[:, k] = column
        return J, M

    def _move_apart(self):
        """Undo what contacts, limits and equalities have yielded, by Newton's method.

        What is nearer than NEAR touches: of a box that lies on a plane all corners, not the lowest.
        """
        m, d, mj = self.model, self.data, self.mujoco
        for j in np.flatnonzero(m.jnt_limited):
            if m.jnt_type[j] > 1:
                at = m.jnt_qposadr[j]
                d.qpos[at] = np.clip(d.qpos[at], *m.jnt_range[j])
        m.geom_margin[:] = m.jnt_margin[:] = m.tendon_margin[:] = NEAR
        for _ in range(50):
            mj.mj_forward(m, d)
            missed, equal = np.zeros(d.nefc), d.efc_type == EQUALITY
            missed[equal] = d.efc_pos[equal]
            for c in d.contact:
                if c.efc_address >= 0:
                    missed[c.efc_address] = c.dist + OVERLAP
            limits = np.isin(d.efc_type, LIMITS)
            missed[limits] = d.efc_pos[limits]
            self.overlap = np.abs(missed).max(initial=0.0)
            if self.overlap <= 0.1 * AT_LIMIT:
                break
            J, M = self._rows()
            J = J[missed != 0.0]
            to_q = np.linalg.solve(M, J.T)
            move = to_q @ np.linalg.lstsq(J @ to_q, -missed[missed != 0.0], rcond=1e-9)[0]
            mj.mj_integratePos(m, d.qpos, move, 1.0)
        m.geom_margin[:], m.jnt_margin[:], m.tendon_margin[:] = 0.0, AT_LIMIT, AT_LIMIT

    def _soften(self, solref, impedance):
        for name in SOLREF:
            getattr(self.model, name)[:] = solref
        for name in SOLIMP:
            getattr(self.model, name)[:] = (impedance, impedance, 0.001, 0.5, 2.0)

    def use(self, model):
        """Take the names of joints, for those that have none in the file."""
        moving = [n for n, j in model.joints.items() if j.kind != "fixed" and not j.closes]
        self.unnamed = moving if len(moving) == self.model.njnt else []
        self.known = set(model.joints)

    def positions(self):
        """Coordinates of the joints that both have, by name."""
        m, found = self.model, {}
        for j in range(m.njnt):
            at, size = m.jnt_qposadr[j], {0: 7, 1: 4}.get(int(m.jnt_type[j]), 1)
            name = self.name("mjOBJ_JOINT", j) or (self.unnamed[j] if self.unnamed else None)
            q = self.data.qpos[at : at + size]
            if name in self.known:
                found[name] = tuple(q.tolist())
        return found

    def accelerations(self):
        """Name, mass centre, its acceleration and angular acceleration of each link that moves."""
        parts = self.model.body_weldid
        for b in range(1, self.model.nbody):
            group = [k for k in range(1, self.model.nbody) if parts[k] == b]
            moves = self.model.body_mocapid[b] < 0  # others are placed by the user
            if group and moves and self.model.body_mass[group].sum():
                com = self.group(b)[1]
                yield self.name("mjOBJ_BODY", b), (com, self.acceleration(b, com))


def solve_cones(A, b, cones, alone, x, size):
    """Impulses x with u = A x + b, by alternating directions of a weight; None if not found."""
    y, solve = -(A @ x + b), np.linalg.inv(A + size * np.eye(len(b)))

    def nearest(z):
        z = np.where(alone, np.maximum(z, 0.0), z)
        for k, mu in cones:
            slip = np.hypot(*z[k + 1 : k + 3])
            if slip > mu * z[k]:
                push = max(0.0, (z[k] + mu * slip) / (1.0 + mu * mu))
                z[k], z[k + 1 : k + 3] = push, z[k + 1 : k + 3] * mu * push / slip
        return z

    for _ in range(MOST_TURNS):
        u = A @ x + b
        for k, mu in cones:
            u[k] += mu * np.hypot(*u[k + 1 : k + 3])
        largest = np.abs(x).max(initial=0.0)
        if np.abs(x - nearest(x - u)).max(initial=0.0) <= 1e-9 * largest:
            return x
        if not largest < DIVERGED:
            return None
        between = solve @ (size * x - y - (u - A @ x))
        x = nearest(between + y / size)
        y += size * (between - x)
    return None
