"""The right-hand side of a chain of 8 revolutes beside code that CasADi generates, and Pinocchio.

``build/peers-venv/bin/python benchmarks/peers/generated.py``, with casadi in it and gcc at hand.

CasADi gets the articulated-body algorithm (Featherstone 2008, table 7.1) in its scalar symbols,
whose matrices know their zeros, and writes C for this chain; dap3d gets the scene. Least CPU times
of many rounds in turn. Pinocchio's ``aba`` is called from Python: the call with a model of one
joint is taken off. All accelerations are compared.
"""

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

import dap3d_peer
import mechanisms
import numpy as np

COUNT, CALLS, ROUNDS = 8, 20_000, 25
FLAGS = ("-O3", "-march=native", "-ffp-contract=off")
#: Calls a function so often; its arguments are arrays of pointers to arrays.
LOOP = """
#include <stddef.h>
int rates(const double**, double**, long long*, double*, int);
void repeat(long n, const double** given, double** out) {
  double work[4096];
  for (long k = 0; k < n; ++k) rates(given, out, NULL, work, 0);
}
"""


def casadi_function(mechanism):
    """(q, v) -> dv/dt."""
    import casadi as ca

    q, v = ca.SX.sym("q", COUNT), ca.SX.sym("v", COUNT)
    return ca.Function("rates", [q, v], [accelerations(mechanism, q, v)], {"cse": True})


def accelerations(mechanism, q, v):
    """dv/dt by articulated bodies; frames at the joints, whose axes are parallel to y."""
    import casadi as ca

    def cross(a):
        return ca.vertcat(
            ca.horzcat(0, -a[2], a[1]), ca.horzcat(a[2], 0, -a[0]), ca.horzcat(-a[1], a[0], 0)
        )

    axis = ca.sparsify(ca.SX([0, 1, 0, 0, 0, 0]))
    shifts, inertias, forces, biases = [], [], [], []
    speed, at = ca.SX(6, 1), np.zeros(3)
    for k, (joint, body) in enumerate(zip(mechanism.joints, mechanism.bodies, strict=True)):
        c, s = ca.cos(q[k]), ca.sin(q[k])
        E = ca.SX(3, 3)
        E[0, 0], E[0, 2], E[1, 1], E[2, 0], E[2, 2] = c, -s, 1, s, c
        step = ca.sparsify(ca.SX(joint.point - at))
        X = ca.sparsify(ca.blockcat([[E, ca.SX(3, 3)], [-E @ cross(step), E]]))
        arm, m = ca.sparsify(ca.SX(body.x - joint.point)), body.mass
        turn = ca.diag(ca.SX(body.J)) + m * cross(arm) @ cross(arm).T
        inertia = ca.sparsify(
            ca.blockcat([[turn, m * cross(arm)], [m * cross(arm).T, m * ca.SX.eye(3)]])
        )
        speed = X @ speed + axis * v[k]
        w, u = cross(speed[:3]), cross(speed[3:])
        motion = ca.sparsify(ca.blockcat([[w, ca.SX(3, 3)], [u, w]]))
        biases.append(motion @ (axis * v[k]))
        forces.append(-motion.T @ (inertia @ speed))
        shifts.append(X)
        inertias.append(inertia)
        at = joint.point
    gains, divisors, rests = [None] * COUNT, [None] * COUNT, [None] * COUNT
    for k in range(COUNT - 1, -1, -1):
        gains[k] = inertias[k] @ axis
        divisors[k] = ca.dot(axis, gains[k])
        rests[k] = -ca.dot(axis, forces[k])
        if k:
            left = inertias[k] - gains[k] @ gains[k].T / divisors[k]
            load = forces[k] + left @ biases[k] + gains[k] * (rests[k] / divisors[k])
            inertias[k - 1] += shifts[k].T @ left @ shifts[k]
            forces[k - 1] += shifts[k].T @ load
    acceleration = ca.sparsify(ca.SX([0, 0, 0, 0, 0, mechanism.gravity]))
    found = []
    for k in range(COUNT):
        acceleration = shifts[k] @ acceleration + biases[k]
        found.append((rests[k] - ca.dot(gains[k], acceleration)) / divisors[k])
        acceleration = acceleration + axis * found[k]
    return ca.vertcat(*found)


def library_of(function, loop):
    """The C that CasADi writes for a function, and a loop that calls it, loaded."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / f"{function.name()}.c"
        function.generate(source.name, {"with_header": False})
        Path(source.name).replace(source)
        source.write_text(source.read_text() + loop)
        library = source.with_suffix(".so")
        command = ["gcc", *FLAGS, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
        subprocess.run(command, check=True)
        return ctypes.CDLL(str(library))


def compiled(function):
    """(q, v) -> dv/dt, seconds of so many calls; by the C that CasADi writes."""
    repeat = library_of(function, LOOP).repeat
    repeat.argtypes = [ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]

    def run(q, v):
        arrays, out = [np.array(q), np.array(v)], np.zeros(COUNT)
        given = (ctypes.c_void_p * 2)(*(a.ctypes.data for a in arrays))
        results = (ctypes.c_void_p * 1)(out.ctypes.data)
        begun = time.thread_time()
        repeat(CALLS, given, results)
        return out, (time.thread_time() - begun) / CALLS

    return run


def ours(mechanism):
    """The same by the scene's program, in joint coordinates."""
    from dap3d_core.kernels.runtime.cache import compiled as kernel

    @kernel
    def repeat(functions, count, y, out, system, loops):
        rhs = functions[0]
        for _ in range(count):
            rhs(0.0, y, out, system, loops)

    model = dap3d_peer.Model(dap3d_peer.scene_of(mechanism), 1.0, method="joint")
    model.take_programs()
    evaluator, y0 = model.evaluator, model.problem[3]

    def run(q, v):
        y, out = y0 + np.array([*q, *v, 0.0]), np.zeros_like(y0)  # y0 has angles, not zeros
        given = evaluator.functions, CALLS, y, out, evaluator.system, evaluator.loops
        repeat(*given)
        begun = time.thread_time()
        repeat(*given)
        return out[COUNT : 2 * COUNT], (time.thread_time() - begun) / CALLS

    return run


def pinocchios(mechanism):
    """The same by Pinocchio's ``aba``, called from Python."""
    import pinocchio as pin
    from pinocchio_peer import Tree

    tree, one = Tree(mechanism), Tree(mechanisms.mechanism_of("revolute-chain-1"))

    def seconds(model, q, v):
        data, tau = model.createData(), np.zeros(model.nv)
        begun = time.thread_time()
        for _ in range(CALLS // 10):
            pin.aba(model, data, q, v, tau)
        return data.ddq.copy(), (time.thread_time() - begun) / (CALLS // 10)

    def run(q, v):
        found, whole = seconds(tree.model, np.array(q), np.array(v))
        return found, whole - seconds(one.model, np.array(q[:1]), np.array(v[:1]))[1]

    return run


def measure():
    """Rows of the table: program, nanoseconds, part of CasADi's; accelerations agree."""
    mechanism = mechanisms.mechanism_of(f"revolute-chain-{COUNT}")
    ways = {"CasADi, C": compiled(casadi_function(mechanism)), "dap3d, joint": ours(mechanism),
            "Pinocchio, aba": pinocchios(mechanism)}  # fmt: skip
    rng = np.random.default_rng(1)
    q, v = rng.uniform(-1.0, 1.0, COUNT), rng.uniform(-1.0, 1.0, COUNT)
    found, least = {}, dict.fromkeys(ways, np.inf)
    for _ in range(ROUNDS):
        for name, run in ways.items():
            found[name], seconds = run(q, v)
            least[name] = min(least[name], seconds)
    first = found["CasADi, C"]
    for name, rates in found.items():
        assert np.allclose(rates, first, rtol=1e-9, atol=1e-9), (name, rates, first)
    return [{"program": name, "ns": 1e9 * s, "over_casadi": s / least["CasADi, C"]}
            for name, s in least.items()]  # fmt: skip


if __name__ == "__main__":
    import run
    from rich.console import Console

    Console(width=100).print(run.shown(measure(), "right-hand side of a chain of 8 revolutes"))
