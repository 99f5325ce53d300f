"""MuJoCo: joint coordinates, loops closed by soft constraints; all steps in one call of C."""

import time

import mechanisms as scenes
import mujoco
import numpy as np

VERSION = mujoco.__version__
METHODS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
JOINTS = {
    "free": mujoco.mjtJoint.mjJNT_FREE,
    "spherical": mujoco.mjtJoint.mjJNT_BALL,
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
}


def quaternion(R):
    """Quaternion of a rotation matrix."""
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ravel(R))
    return q


def model_of(mechanism, h):
    """The model, and its speeds at the start. Loops are as stiff as a step of h allows."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 0
    spec.option.gravity = [0.0, 0.0, -mechanism.gravity]
    off = mujoco.mjtDisableBit
    spec.option.disableflags = int(off.mjDSBL_CONTACT) | int(off.mjDSBL_ISLAND)
    spec.option.iterations, spec.option.tolerance = 200, 1e-14
    made, origin = {scenes.GROUND: spec.worldbody}, {scenes.GROUND: np.zeros(3)}
    speeds = {}
    for k, joint in enumerate(mechanism.joints):
        parent = joint.parent
        R = np.eye(3) if parent == scenes.GROUND else mechanism.bodies[parent].R
        if joint.closes:
            weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, name=f"e{k}",
                                     objtype=mujoco.mjtObj.mjOBJ_BODY)  # fmt: skip
            weld.name1, weld.name2 = f"b{parent}", f"b{joint.child}"
            weld.data[:3] = R.T @ (joint.point - origin[parent])
            weld.solref = [-((0.5 / h) ** 2), -1.0 / h]  # critically damped, 1/h wide
            weld.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]
            continue
        body = mechanism.bodies[joint.child]
        at = body.x if joint.kind == "free" else joint.point
        one = made[parent].add_body(
            name=f"b{joint.child}", pos=R.T @ (at - origin[parent]), quat=quaternion(R.T @ body.R),
            mass=body.mass, ipos=body.R.T @ (body.x - at), inertia=body.J, explicitinertial=True,
        )  # fmt: skip
        one.add_joint(name=f"j{k}", type=JOINTS[joint.kind], axis=[0.0, 1.0, 0.0])
        made[joint.child], origin[joint.child] = one, at
        w = body.w if parent == scenes.GROUND else body.w - mechanism.bodies[parent].w
        speeds[f"j{k}"] = {"free": [*body.v, *w], "spherical": w, "revolute": w[1:2]}[joint.kind]
    model = spec.compile()
    v = np.zeros(model.nv)
    for name, value in speeds.items():
        first = model.joint(name).dofadr[0]
        v[first : first + len(value)] = value
    return model, v


def trial(mechanism, method, step=None, callback=None):
    """What starts a trial; ``step(model, data, count)`` does the steps, by default in C."""
    kept = {}

    def start(h):
        key = h if any(j.closes for j in mechanism.joints) else 0.0
        if key not in kept:
            kept.clear()
            kept[key] = model_of(mechanism, h)
        model, v = kept[key]
        model.opt.integrator, model.opt.timestep = METHODS[method], h
        data, count = mujoco.MjData(model), round(mechanism.t_end / h)

        def run():
            mujoco.mj_resetData(model, data)
            data.qvel[:] = v
            mujoco.set_mjcb_passive(callback)
            before = time.thread_time()
            if step is None:
                mujoco.mj_step(model, data, nstep=count)
            else:
                step(model, data, count)
            seconds = time.thread_time() - before
            mujoco.set_mjcb_passive(None)
            return seconds, count

        def end():
            mujoco.mj_forward(model, data)
            return data.xipos[1:].copy(), data.xmat[1:].reshape(-1, 3, 3).copy()

        return run, end

    return start


def _held(model, data, count):
    q, v, force = data.qpos, data.qvel, data.qfrc_applied
    for _ in range(count):
        force[2] = scenes.contact_force(q[2], v[2])
        mujoco.mj_step(model, data)


def _passive(_, data):
    data.qfrc_passive[2] += scenes.contact_force(data.qpos[2], data.qvel[2])


def ladders(mechanism):
    """Methods, their parameters from coarse to fine, and what starts a trial."""
    if mechanism.size > 256:
        raise MemoryError("its dense mass matrix takes seconds a step")
    if mechanism.name == "ball":
        return [
            ("RK4, no force", [1e-3], trial(mechanism, "RK4")),
            ("RK4, Python force in a callback", [1e-3], trial(mechanism, "RK4", None, _passive)),
            ("Euler, no force", [1e-3], trial(mechanism, "Euler")),
            ("Euler, Python force held over steps", [1e-3], trial(mechanism, "Euler", _held)),
        ]
    if any(joint.closes for joint in mechanism.joints):
        names, steps = ("Euler", "RK4"), [1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4]
    elif mechanism.name == "heavy-top":
        names, steps = ("RK4",), [5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2.5e-5]
    else:
        names, steps = ("RK4",), [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4]
    return [(name, steps, trial(mechanism, name)) for name in names]
