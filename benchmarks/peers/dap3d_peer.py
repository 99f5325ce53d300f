"""dap3d: body coordinates, its explicit methods; loops closed by spherical or revolute joints."""

import importlib.metadata
import time
from pathlib import Path

import numpy as np
from levels import WHOLE
from mechanisms import GROUND, rotation_of
from prepared_run import PreparedRun

import dap3d_core as dap
from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.formulations.programs import scene_program
from dap3d_core.integrators import TABLEAUS, RungeKutta
from dap3d_core.integrators.adams import AdamsIntegration
from dap3d_core.integrators.stepping.integration import off_constraints
from dap3d_core.kernels.compiler import objects
from dap3d_core.simulation import CompiledModel

VERSION = importlib.metadata.version("dap3d")
FOLDER = Path(__file__).parent
ADAPTIVE = ("dopri5", "dop853", "adams")
FIXED = ("rk4", "dopri5", "dop853")


def quaternion(R):
    """Euler parameters of a rotation about y."""
    half = 0.5 * np.arctan2(R[0, 2], R[0, 0])
    return (np.cos(half), 0.0, np.sin(half), 0.0)


def scene_of(mechanism, loops="spherical"):
    """The scene; ``loops`` says what joins the couplers of four-bars: two spherical joints each,
    which makes rows independent, or "revolute" joints all over, whose rows are redundant."""
    scene = dap.Scene(name=mechanism.key)
    names = {GROUND: "ground"} | {k: f"b{k}" for k in range(len(mechanism.bodies))}
    for k, body in enumerate(mechanism.bodies):
        start = dict(r=body.x, p=quaternion(body.R), r_dot=body.v, w=body.R @ body.w)
        numbers = {name: tuple(map(float, value)) for name, value in start.items()}
        scene.add_body(names[k], mass=body.mass, Jp=tuple(body.J), **numbers)
    has_loops = any(joint.closes for joint in mechanism.joints)
    for k, joint in enumerate(mechanism.joints):
        if joint.kind == "free":
            continue
        ends = {}
        for end, number in (("P_i", joint.child), ("P_j", joint.parent)):
            point = joint.point
            if number != GROUND:
                body = mechanism.bodies[number]
                point = body.R.T @ (point - body.x)
            ends[end] = scene.add_point(f"{end}{k}", names[number], tuple(point))
        to_coupler = has_loops and GROUND not in (joint.parent, joint.child)
        if joint.kind == "spherical" or (to_coupler and loops == "spherical"):
            scene.add_joint("sph", f"J{k}", **ends)
        else:
            axes = {"a_i": f"{names[joint.child]}.y", "a_j": f"{names[joint.parent]}.y"}
            scene.add_joint("rev", f"J{k}", **ends, **axes)
    if mechanism.gravity:
        scene.add_force("weight", "gravity", gravity=mechanism.gravity)
    return scene


class Model:
    """A compiled model, and how its runs start."""

    def __init__(self, scene, t_end, projects=False, **options):
        self.compiled = CompiledModel(scene, **options)
        self.evaluator, self.t_end, self.projects = self.compiled.evaluator, t_end, projects
        self.u0 = self.compiled.model.u0
        store_reference_pivots(self.evaluator, 0.0, self.u0)
        self.evaluator.start(0.0, self.u0)
        evaluator, y0 = self.evaluator, self.evaluator.coordinates.start(self.u0)
        self.problem = evaluator.functions, evaluator.system, evaluator.loops, y0, [0.0, t_end]
        self.options = {
            "error_size": len(y0) - 1,
            "buffer_rows": 2,
            "report_size": evaluator.report_size,
            "length_count": evaluator.length_count,
        }

    def take_programs(self):
        """Let runs take programs of the scene, as those of ``dap.simulate`` after a while."""
        y0, evaluator = self.problem[3], self.evaluator
        name = f"peer_{id(self)}{scene_program.REPORTS}"
        text, written = scene_program.write_programs(evaluator, name, 0.0, off_constraints(y0))
        code = objects.optimised(text, written, None)
        for k, program in scene_program.load_programs(evaluator, name, written, code).items():
            if k >= 0:
                evaluator.functions.addresses[k] = program.address

    def prepared(self, method, project, **control):
        """An integration that can be run again and again."""
        options = self.options | control | {"project_on": project}
        if method == "adams":
            return PreparedRun(AdamsIntegration(*self.problem, **options))
        return PreparedRun(RungeKutta(TABLEAUS[method], *self.problem, **options))

    def trial(self, method, *, project=False, fixed=False):
        """What starts a trial, by a tolerance or by a number of steps."""

        def start(parameter):
            control = {"rtol": parameter, "atol": parameter}
            if fixed:
                control = {"step": self.t_end / parameter}
            prepared = self.prepared(method, project, **control)

            def run():
                before = time.thread_time()
                finished = prepared.run()
                seconds = time.thread_time() - before
                if not finished:
                    raise RuntimeError(f"the run stopped: {prepared.integration.status.name}")
                return seconds, prepared.integration.statistics.steps

            def end():
                return self._end(self.evaluator.body_state(prepared.integration.y))

            return run, end

        return start

    def simulate(self, integrator):
        """The same by ``dap.simulate`` with two reported times: rank, record and ledger besides."""

        def start(parameter):
            def run():
                before = time.thread_time()
                found[0] = dap.simulate(self.compiled, t_end=self.t_end, dt=self.t_end,
                                        integrator=integrator, rtol=parameter, atol=parameter,
                                        project=self.projects, correct=False)  # fmt: skip
                return time.thread_time() - before, found[0].stats.steps

            return run, lambda: self._end(found[0].u[-1])

        found = [None]
        return start

    def _end(self, y):
        count = self.compiled.model.body_count
        q = y[: 7 * count].reshape(count, 7)
        return q[:, :3], np.array([rotation_of(p) for p in q[:, 3:]])


def in_joint_coordinates(mechanism, tolerances):
    """The ladders of method joint, for trees."""
    model = Model(scene_of(mechanism), mechanism.t_end, method="joint")
    counts = sorted({round(fixed_from(mechanism) * 1.4142**k) for k in range(16)})
    found = [(f"joint, {name}", tolerances, model.trial(name)) for name in ADAPTIVE]
    return found + [
        (f"joint, {name} fixed", counts, model.trial(name, fixed=True)) for name in FIXED
    ]


def fixed_from(mechanism):
    """Least number of equal steps that is tried."""
    return {"heavy-top": 100, "free-body": 16, "four-bar": 60}.get(mechanism.name, 1)


def ladders(mechanism):
    """Methods, their parameters from coarse to fine, and what starts a trial."""
    t_end = mechanism.t_end
    if mechanism.name == "ball":
        with_force = Model(dap.load(FOLDER / "ball_model"), t_end, allow_code=True)
        without = Model(scene_of(mechanism), t_end)
        return [("rk4, no force", [5000], without.trial("rk4", fixed=True)),
                ("rk4, Python force", [5000], with_force.trial("rk4", fixed=True))]  # fmt: skip
    model = Model(scene_of(mechanism), t_end, projects=mechanism.name == "four-bars")
    tolerances = [10.0**-k for k in range(1, 15)]
    loops = any(joint.closes for joint in mechanism.joints)
    if mechanism.name == "four-bars":  # singular poses: only on the constraints
        found = [(f"{name}, projected", tolerances[1:], model.trial(name, project=True))
                 for name in ("dopri5", "dop853")]  # fmt: skip
        return [*found, (f"{WHOLE}dop853", [1e-4, 1e-7, 1e-10], model.simulate("dop853"))]
    found = [(name, tolerances, model.trial(name)) for name in ADAPTIVE]
    if not loops and mechanism.name != "free-body":
        found += in_joint_coordinates(mechanism, tolerances)
    counts = sorted({round(fixed_from(mechanism) * 1.4142**k) for k in range(16)})
    found += [(f"{name} fixed", counts, model.trial(name, fixed=True)) for name in FIXED]
    if loops:
        found += [(f"{name}, projected", tolerances, model.trial(name, project=True))
                  for name in ADAPTIVE]  # fmt: skip
    found.append((f"{WHOLE}dop853", [1e-4, 1e-7, 1e-10], model.simulate("dop853")))
    return found
