"""Results of closed-form motions, without a run, and comparison of results."""

import attrs
import numpy as np

import dap3d_core as dap
from dap3d_core.model import build_model
from dap3d_core.result import ResultWriter, RunMetadata
from dap3d_core.scene import check
from support.internals import COLUMNS, Evaluator, join, y_from_u

CONTROLLED = dict(rtol=1e-8, atol=1e-10, step=None, project=True, correct=True, conservative=True)


def model_of(scene, registry=None):
    return build_model(check(scene, registry or dap.load_registry()))


def about_z(angle):
    """Euler parameters (nt, 1, 4) of a rotation about z."""
    half = np.asarray(angle, dtype=float)[:, None] / 2
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def rows_of(
    model, t, u, v_dot, Lam, work=0.0, potential=0.0, residuals=(0.0, 0.0, 0.0), angles=None
):
    """Rows as the integrator delivers them."""
    angles = np.zeros((len(t), model.angle_count)) if angles is None else angles
    last = np.tile([0.0, *residuals, *model.input_values], (len(t), 1))
    last[:, 0] = potential
    states = np.tile(model.initial_states, (len(t), 1))
    return np.hstack([t[:, None], y_from_u(u, work, states), v_dot, Lam, angles, last])


def result_of(scene, rows, model=None, method="standard", **more):
    """A result whose machine is made when something asks for it."""
    model = model or model_of(scene)
    given = dict(settings=CONTROLLED, integrator="dop853", method=method) | more
    record = RunMetadata(scene_text=scene.to_toml(), **given)
    return dap.Result.of_run(model, rows, record, lambda: Evaluator(model, method))


MASS, ARM, RATE, PIVOT = 3.0, 0.4, 2.5, np.array([0.3, -0.2, 0.5])
X = np.array([1.0, 0.0, 0.0])


def circling_scene():
    """A bob on a ball joint away from the origin, without gravity; P is beyond its mass centre."""
    scene = dap.Scene(name="circling")
    scene.add_body("bob", mass=MASS, Jp=[0.2, 0.3, 0.4], r=PIVOT + ARM * X, w=[0, 0, RATE],
                   r_dot=[0, RATE * ARM, 0])  # fmt: skip
    scene.add_point("Q", body="ground", sPp=PIVOT)
    scene.add_point("H", body="bob", sPp=[-ARM, 0, 0])
    scene.add_point("P", body="bob", sPp=[0.1, 0, 0])
    scene.add_joint("sph", "J1", P_i="H", P_j="Q")
    return scene


def circling(nt=21, outputs=None, **more):
    """Its motion: uniform rotation about z through the pivot. The joint holds m RATE^2 ARM."""
    scene = circling_scene()
    scene.outputs |= outputs or {}
    model = model_of(scene)
    t = np.linspace(0.0, 1.7, nt)
    out = np.stack([np.cos(RATE * t), np.sin(RATE * t), 0 * t], axis=1)  # from the pivot outwards
    ahead = np.stack([-out[:, 1], out[:, 0], 0 * t], axis=1)
    w = np.broadcast_to([0.0, 0.0, RATE], (nt, 1, 3))
    u = join((PIVOT + ARM * out)[:, None], about_z(RATE * t), (RATE * ARM * ahead)[:, None], w)
    v_dot = np.hstack([-(RATE**2) * ARM * out, np.zeros((nt, 3))])
    Lam = MASS * RATE**2 * ARM * out  # 'sph' exerts -lambda on body i
    rows = rows_of(model, t, u, v_dot, Lam)
    return result_of(scene, rows, model, **more), out, ahead


def drifting(nt=11, joint=False, **more):
    """Two free bodies, each with constant velocity and a spin about a principal axis."""
    scene = dap.Scene(name="drifting")
    scene.add_body("a", mass=2.0, Jp=[1.0, 2.0, 3.0], r=[1, 0, 0])
    scene.add_body("b", mass=5.0, Jp=[0.1, 0.2, 0.3], r=[0, -2, 1])
    if joint:
        scene.add_joint("sph", "J", P_i="a.O", P_j="b.O")
    model = model_of(scene)
    t = np.linspace(0.0, 3.0, nt)
    velocity = np.array([[0.5, -0.2, 0.1], [-1.0, 0.3, 0.7]])
    rates = np.array([0.8, -1.3])
    r = np.array([[1.0, 0, 0], [0, -2, 1]]) + t[:, None, None] * velocity
    p = np.concatenate([about_z(rate * t) for rate in rates], axis=1)
    w = np.zeros((nt, 2, 3))
    w[..., 2] = rates
    u = join(r, p, np.broadcast_to(velocity, r.shape), w)
    rows = rows_of(model, t, u, np.zeros((nt, 12)), np.zeros((nt, model.row_count)))
    return result_of(scene, rows, model, "standard" if joint else "unconstrained", **more)


def same_bits(left, right, *, signs_of_zeros=True):
    for column in COLUMNS:
        a, b = (getattr(side.arrays, column.name) for side in (left, right))
        assert a.shape == b.shape
        assert a.dtype == b.dtype
        if not signs_of_zeros:
            a, b = a + 0.0, b + 0.0
        assert a.tobytes() == b.tobytes(), column.name
    return True


def same_run(left, right):
    """The same bits but for the signs of zeros, which change where a program takes over (0092)."""
    return same_bits(left, right, signs_of_zeros=False)


def noisy(model, nt=9, seed=3):
    """Rows of random bits, as large as a run may leave; Euler parameters and times are plain."""
    rng = np.random.default_rng(seed)
    n = model.body_count
    width = 1 + 13 * n + 1 + 6 * n + model.row_count + 4
    rows = rng.normal(size=(nt, width)) * 10.0 ** rng.integers(-200, 99, size=(nt, width))
    rows[:, 0] = np.cumsum(rng.random(nt))
    rows[:, 1 : 1 + 13 * n] = rng.normal(size=(nt, 13 * n))
    rows[0, -1] = -0.0
    rows[1, -1] = 5e-324
    return rows


def grown(path, result, *, most=None, force=False):
    """A writer for as many rows as a result has."""
    most = len(result.t) if most is None else most
    return ResultWriter(path, result.summary, result.record, most, force=force)


def without_turns(result):
    """A result as older programs left it, which did not store the angles that a run counts."""
    summary = attrs.evolve(result.summary, angle_count=0, angle_names=())
    arrays = attrs.evolve(result.arrays, angles=np.zeros((len(result.t), 0)))
    return dap.Result(summary, arrays, result.record, lambda: None)
