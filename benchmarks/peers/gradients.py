"""Height of the tip of a chain of 8 revolutes after 1 s, and its gradient by the last 7 masses.

``build/peers-venv/bin/python benchmarks/peers/gradients.py``, with casadi and heyoka in it, and gcc
at hand.

CasADi gets the articulated bodies of generated.py, derives the variational equations, and writes C;
dop853 in C takes equal steps. Pinocchio has derivatives of ``aba`` and the regressor of masses, for
dop853 in Python; MuJoCo central differences of 14 runs of RK4; heyoka the program of CasADi, whose
variational equations it integrates by Taylor series. dap3d gets the scene, and runs the
differentiated program that ``sensitivities`` runs. Integration alone is timed: CPU time, least of
many rounds in turn, to an error of value (m) and gradient (m/kg), against CasADi's at 400 steps.
"""

import ctypes
import dataclasses
import time

import dap3d_peer
import generated
import levels
import mechanisms
import numpy as np
from scipy.integrate import DOP853

COUNT, MASSES, ROUNDS, ALL = 8, 7, 15, 10**15
STEPS = (4, 6, 8, 12, 16, 24, 32, 48)
TOLERANCES = [10.0**-k for k in range(2, 14)]
#: heyoka's, for each of which it compiles half a minute. Terms by which it would choose its first
#: step vanish at this start, from rest: it gets one that is shorter than the others, s.
FEW_TOLERANCES, FIRST_STEP = [1e-5, 1e-7, 1e-9, 1e-11], 0.02
#: Equal steps of dop853 with 12 stages; y and its rates have N numbers.
LOOP = """
#include <stddef.h>
#include <string.h>
void steps(long n, double h, const double* A, const double* b, double* y, const double* p) {
  static double work[16384], k[12][N], z[N];
  for (long step = 0; step < n; ++step) {
    for (int s = 0; s <= 12; ++s) {
      const double* a = s < 12 ? A + 12 * s : b;
      memcpy(z, y, sizeof z);
      for (int j = 0; j < s; ++j)
        if (a[j] != 0.0) for (int i = 0; i < N; ++i) z[i] += h * a[j] * k[j][i];
      if (s == 12) break;
      const double* given[2] = {z, p};
      double* out[1] = {k[s]};
      rates(given, out, NULL, work, 0);
    }
    memcpy(y, z, sizeof z);
  }
}
"""


def height(angles, slopes):
    """(8,) height of the tip and its gradient, of rods of 1 m turned downwards."""
    turned = np.cumsum(angles)
    return np.append(-np.sin(turned).sum(), -np.cos(turned) @ np.cumsum(slopes, axis=0))


def of_state(y):
    """The same of q, v and their slopes."""
    return height(y[:COUNT], y[2 * COUNT :].reshape(2 * COUNT, MASSES)[:COUNT])


def equations(mechanism):
    """Symbols of states and masses, and the rates of the states."""
    import casadi as ca

    x, m = ca.SX.sym("x", 2 * COUNT), ca.SX.sym("m", MASSES)
    bodies = mechanism.bodies[:1] + [
        dataclasses.replace(body, mass=m[k]) for k, body in enumerate(mechanism.bodies[1:])
    ]
    q, v = x[:COUNT], x[COUNT:]
    rates = generated.accelerations(dataclasses.replace(mechanism, bodies=bodies), q, v)
    return x, m, ca.vertcat(v, rates)


def casadi(mechanism):
    """What starts a trial, by a number of steps."""
    import casadi as ca

    x, m, rates = equations(mechanism)
    slopes = ca.SX.sym("s", MASSES, 2 * COUNT)  # by columns: those of each number lie together
    moved = ca.jtimes(rates, x, slopes.T) + ca.jacobian(rates, m)
    y = ca.vertcat(x, ca.vec(slopes))
    function = ca.Function("rates", [y, m], [ca.vertcat(rates, ca.vec(moved.T))], {"cse": True})
    steps = generated.library_of(function, f"#define N {y.numel()}\n{LOOP}").steps
    A, b, masses, state = DOP853.A.copy(), DOP853.B.copy(), np.ones(MASSES), np.zeros(y.numel())
    steps.argtypes = [ctypes.c_long, ctypes.c_double, *[ctypes.c_void_p] * 4]

    def start(count):
        def run():
            state[:] = 0.0
            given = [array.ctypes.data for array in (A, b, state, masses)]
            before = time.thread_time()
            steps(count, mechanism.t_end / count, *given)
            return time.thread_time() - before

        return run, lambda: of_state(state)

    return start


def pinocchio(mechanism):
    """What starts a trial, by a number of steps."""
    import pinocchio as pin
    from pinocchio_peer import Tree

    model = Tree(mechanism).model
    data, tau = model.createData(), np.zeros(COUNT)
    by_mass = np.zeros((10 * COUNT, MASSES))
    for k in range(1, COUNT):
        one = model.inertias[k + 1]
        two = pin.Inertia(one.mass + 1.0, one.lever, one.inertia)
        change = two.toDynamicParameters() - one.toDynamicParameters()
        by_mass[10 * k : 10 * k + 10, k - 1] = change

    def rates(y):
        q, v, slopes = y[:COUNT], y[COUNT : 2 * COUNT], y[2 * COUNT :].reshape(2, COUNT, MASSES)
        by_q, by_v, inverse = pin.computeABADerivatives(model, data, q, v, tau)
        a = data.ddq.copy()
        loads = pin.computeJointTorqueRegressor(model, data, q, v, a) @ by_mass
        moved = by_q @ slopes[0] + by_v @ slopes[1] - inverse @ loads
        return np.concatenate([v, a, slopes[1].ravel(), moved.ravel()])

    def start(count):
        h, state = mechanism.t_end / count, np.zeros(2 * COUNT * (1 + MASSES))

        def run():
            state[:] = 0.0
            before = time.thread_time()
            k = np.empty((12, state.size))
            for _ in range(count):
                for s in range(12):
                    k[s] = rates(state + h * (DOP853.A[s, :s] @ k[:s]))
                state[:] += h * (DOP853.B @ k)
            return time.thread_time() - before

        return run, lambda: of_state(state)

    return start


def mujoco(mechanism):
    """What starts a trial, by a number of steps."""
    import mujoco as mj
    from mujoco_peer import METHODS, model_of

    change, models = 1e-5, []
    for k in [None, *range(2, COUNT + 1)]:
        for sign in (0.0,) if k is None else (1.0, -1.0):
            model, _ = model_of(mechanism, 0.0)
            if k is not None:
                model.body_mass[k] += sign * change
                mj.mj_setConst(model, mj.MjData(model))
            model.opt.integrator = METHODS["RK4"]
            models.append((model, mj.MjData(model)))

    def start(count):
        def run():
            for model, data in models:
                model.opt.timestep = mechanism.t_end / count
                mj.mj_resetData(model, data)
            before = time.thread_time()
            for model, data in models:
                mj.mj_step(model, data, nstep=count)
            return time.thread_time() - before

        def end():
            first, *q = (data.qpos.copy() for _, data in models)
            slopes = (np.array(q[::2]) - q[1::2]).T / (2.0 * change)
            return height(first, slopes)

        return run, end

    return start


def heyoka(mechanism):
    """What starts a trial, by a tolerance."""
    import casadi as ca
    import heyoka as hy

    x, m, rates = equations(mechanism)
    program = ca.Function("rates", [x, m], [rates], {"cse": True})
    states = hy.make_vars(*(f"x{k}" for k in range(2 * COUNT)))
    given = [states, [hy.par[k] for k in range(MASSES)]]
    forms = {
        ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_SQ: lambda a: a * a,
        ca.OP_MUL: lambda a, b: a * b, ca.OP_DIV: lambda a, b: a / b, ca.OP_NEG: lambda a: -a,
        ca.OP_SIN: hy.sin, ca.OP_COS: hy.cos,
    }  # fmt: skip
    work, of_states = {}, [None] * len(states)
    for k in range(program.n_instructions()):
        operation = program.instruction_id(k)
        to, sources = program.instruction_output(k), program.instruction_input(k)
        if operation == ca.OP_INPUT:
            work[to[0]] = given[sources[0]][sources[1]]
        elif operation == ca.OP_CONST:
            work[to[0]] = hy.expression(program.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            of_states[to[1]] = work[sources[0]]
        else:
            work[to[0]] = forms[operation](*(work[j] for j in sources))
    pairs = list(zip(states, of_states, strict=True))
    system = hy.var_ode_sys(pairs, args=given[1], order=1)

    def start(tolerance):
        pars = [1.0] * MASSES
        of = hy.taylor_adaptive(
            system, [0.0] * len(states), tol=tolerance, pars=pars, compact_mode=True
        )
        first = of.state.copy()

        def run():
            of.time, of.state[:] = 0.0, first
            before = time.thread_time()
            of.step(max_delta_t=FIRST_STEP)
            of.propagate_until(mechanism.t_end)
            return time.thread_time() - before

        return run, lambda: of_state(of.state)

    return start


def dap3d(mechanism, **fixed):
    """What starts a trial, by a tolerance or, with ``fixed``, by a number of steps."""
    import dap3d_core as dap
    from dap3d_core.formulations.programs import change_over
    from dap3d_core.simulation.run_state import Callbacks
    from dap3d_core.simulation.settings import settings_of
    from dap3d_core.study.parameters import parameters_named
    from dap3d_core.study.sensitivities.differentiated_run import DifferentiatedRun
    from dap3d_core.study.sensitivities.neighbours import arrays_of, neighbours_of, run_beside

    change_over.LOAD_AFTER, change_over.MAKE_AFTER, change_over.BESIDE = 0.0, 0.0, False
    compiled = dap.compile(dap3d_peer.scene_of(mechanism), method="joint")
    by = [f"bodies.b{k}.mass" for k in range(1, COUNT)]
    parameters = parameters_named(compiled.checked, by)

    def start(parameter):
        t_end = mechanism.t_end
        given = {"t_end": t_end, "dt": t_end, "integrator": "dop853"}
        control = {"rtol": parameter, "atol": parameter}
        given |= {"step": t_end / parameter} if fixed else control
        base = run_beside(compiled, given)
        settings = settings_of(compiled, method="joint", **given)
        beside = [neighbours_of(compiled, p, given, base) for p in parameters]
        made = DifferentiatedRun(compiled, settings, Callbacks()).carry(beside, base, MASSES)
        made.initialise()
        integration, slopes_of = made.present, made._slopes_of
        wide = [numbers for _, numbers in made._differentiation._buffers.values()]
        arrays = [*(array for _, array in arrays_of(made)), *wide]
        first = [(array, array.copy()) for array in arrays]
        q0 = integration.work.state[0, :COUNT].copy()

        def run():
            for array, before in first:
                array[...] = before
            before = time.thread_time()
            made.programs.during(integration, lambda: integration.advance(ALL))
            return time.thread_time() - before

        def end():
            state = integration.work.state
            return height(state[0, :COUNT] - q0, slopes_of(state)[:COUNT])

        return run, end

    return start


def optimised(start):
    """A trial's start, once its code has been compiled as well as it will be."""
    from dap3d_core.kernels.compiler.background import optimiser

    start(1)[0]()
    while optimiser.units:
        time.sleep(0.05)
        optimiser.poll(0.0)
    return start


def trials(mechanism):
    """(program, method, parameters, what starts a trial)."""
    yield "dap3d", "joint, dop853", TOLERANCES, optimised(dap3d(mechanism))
    yield "dap3d", "joint, dop853 fixed", STEPS, optimised(dap3d(mechanism, fixed=True))
    yield "heyoka", "taylor, variational", FEW_TOLERANCES, heyoka(mechanism)
    yield "Pinocchio", "dop853 fixed, Python", STEPS, pinocchio(mechanism)
    yield "MuJoCo", "RK4, differences", [25 * 2**k for k in range(8)], mujoco(mechanism)


def measure():
    """Rows of the table: program, milliseconds to each error, part of CasADi's."""
    mechanism, cells = mechanisms.mechanism_of(f"revolute-chain-{COUNT}"), []
    in_c = casadi(mechanism)
    run, end = in_c(400)
    run()
    reference, first = end(), ("CasADi, C", "dop853 fixed", STEPS, in_c)
    for program, method, parameters, start in (first, *trials(mechanism)):
        for parameter in parameters:
            run, end = start(parameter)
            run()
            seconds = [run()]
            error = float(np.max(np.abs(end() - reference)))
            cells.append({"scene": "", "program": program, "method": method, "parameter": parameter,
                          "error": error, "seconds": seconds, "run": run})  # fmt: skip
    for _ in range(ROUNDS):
        for cell in cells:
            cell["seconds"] = [min(*cell["seconds"], cell["run"]())]
    rows, base = [], {}
    for program in dict.fromkeys(cell["program"] for cell in cells):
        row = {"program": program}
        for level in levels.LEVELS[1:]:
            seconds, method = levels.best(cells, "", program, level)
            base.setdefault(level, seconds)
            row |= {f"{level:g}, ms": 1e3 * seconds, f"{level:g}, by": method,
                    f"{level:g}, over CasADi": seconds / base[level]}  # fmt: skip
        rows.append(row)
    return rows


if __name__ == "__main__":
    import run
    from rich.console import Console

    Console(width=140).print(run.shown(measure(), "value and gradient of a chain of 8 revolutes"))
