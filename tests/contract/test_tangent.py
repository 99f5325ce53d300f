"""Derivatives of the equations of motion of every registered type against differences."""

import numpy as np
import pytest
from support.internals import FRICTION, Evaluator, call_kinds, join, specs_of, split
from support.motions import Motion
from support.rotations import rotation
from support.scenes import case_names, cases, scene_for

import dap3d_core as dap
from dap3d_core.model import build_model
from dap3d_core.scene import check as checked
from dap3d_core.simulation.linearization.tangent import tangent_matrices

REGISTRY = dap.load_registry()
#: Those that read reactions need a joint; of friction see below.
FORCES = [
    (keyword, values)
    for keyword, values in cases(REGISTRY, "force")
    if all(s.kind != "joint" for s in specs_of(REGISTRY.get("force", keyword).type).values())
]
JOINTS = cases(REGISTRY, "joint")
#: Sixth-order central differences: abscissae, weights.
STENCIL = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))


def residuals(evaluator, t, u, lam, a):
    """R = f + D^T lambda - M a with friction, then D v - nu, then D a - gamma."""
    model, system = evaluator.model, evaluator.system
    force = evaluator.applied_forces(t, u)
    rows = evaluator.rows(t, u)
    system.multipliers[system.row] = -lam
    system.force[:] = 0.0
    call_kinds(FRICTION, FRICTION, t, system, evaluator.loops, system.force, system.multipliers,
               system.multipliers)  # fmt: skip
    force = force + system.force[6:].reshape(-1, 6)
    _, p, v, w = split(u)
    J = rotation(p) @ model.Jp @ np.swapaxes(rotation(p), -1, -2)
    a = a.reshape(-1, 6)
    force[:, :3] -= model.mass[:, None] * a[:, :3]
    force[:, 3:] -= np.einsum("nij,nj->ni", J, a[:, 3:])
    force[:, 3:] -= np.cross(w, np.einsum("nij,nj->ni", J, w))
    D = rows.dense()
    v = np.hstack([v, w]).ravel()
    return np.concatenate([force.ravel() + D.T @ lam, D @ v - rows.nu, D @ a.ravel() - rows.gamma])


def moved(u, direction, step):
    """The state moved along a direction: displacements and velocities, (2, bodies, 6)."""
    r, p, v, w = split(u)
    x_dot, v_dot = step * direction
    turn = x_dot[:, 3:]  # exp(turn / 2) p
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    c, s = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) * turn / 2
    e0, e = p[:, :1], p[:, 1:]
    p = np.hstack([c * e0 - np.sum(s * e, axis=1, keepdims=True), c * e + e0 * s + np.cross(s, e)])
    return join(r + x_dot[:, :3], p, v + v_dot[:, :3], w + v_dot[:, 3:])


def by_differences(function, u, direction, h=2e-3):
    """The derivative along a direction."""
    terms = (
        weight * (function(moved(u, direction, k * h)) - function(moved(u, direction, -k * h)))
        for k, weight in STENCIL
    )
    return sum(terms) / h


def directions(rng, bodies):
    """Random ones of unit length, of displacements and of velocities: no column is left out."""
    for velocity in (False, True):
        for _ in range(3):
            direction = np.zeros((2, bodies, 6))
            direction[int(velocity)] = rng.normal(size=(bodies, 6))
            yield velocity, direction / np.linalg.norm(direction)


def compare(scene, tolerance=1e-9):
    """Compare all derivatives of a scene of three bodies at a random state off the constraints.
    Truncation: h^6 / 140 of seventh derivatives up to some 1e5 of the terms, with h = 2e-3 5e-14;
    rounding: eps / h = 1e-13."""
    evaluator = Evaluator(build_model(checked(scene, REGISTRY)), "lsq")
    u, t, n = Motion(3, np.random.default_rng(100)).u(0.1), 0.1, 18
    rng = np.random.default_rng(1)
    rows = evaluator.model.row_count
    lam, a = rng.normal(size=rows), rng.normal(size=n)
    evaluator.start(t, u)
    tangent = tangent_matrices(evaluator, t, u, lam, a)
    residual = residuals(evaluator, t, u, lam, a)[:n]
    close(tangent.f + tangent.D.T @ lam - tangent.M @ a, residual, tolerance)
    by_x = (
        -tangent.stiffness, tangent.velocity_by_displacement, tangent.acceleration_by_displacement
    )  # fmt: skip
    by_v = (-tangent.damping, tangent.D, tangent.acceleration_by_velocity)
    for velocity, direction in directions(rng, 3):
        slope = by_differences(lambda x: residuals(evaluator, t, x, lam, a), u, direction)
        parts = np.split(slope, [n, n + rows])
        for matrix, difference in zip(by_v if velocity else by_x, parts, strict=True):
            close(matrix @ direction[int(velocity)].ravel(), difference, tolerance)
    return evaluator, tangent, (t, u, lam, a)


def close(exact, difference, tolerance):
    limit = tolerance * (1.0 + np.max(np.abs(difference), initial=0.0))
    np.testing.assert_allclose(exact, difference, rtol=0.0, atol=limit)


@pytest.mark.every(11)
@pytest.mark.parametrize("case", JOINTS, ids=case_names(JOINTS))
@pytest.mark.parametrize("ground", [None, "j"], ids=["body-body", "body-ground"])
def test_joint(case, ground):
    """Rows and reactions of a joint have their derivatives, between bodies and to ground."""
    keyword, values = case
    type_info = REGISTRY.get("joint", keyword)
    compare(scene_for(type_info, np.random.default_rng(0), ground=ground, values=values))


@pytest.mark.every(9)
@pytest.mark.parametrize("case", FORCES, ids=case_names(FORCES))
def test_force(case):
    """The wrenches of a force have their derivatives."""
    keyword, values = case
    compare(scene_for(REGISTRY.get("force", keyword), np.random.default_rng(0), values=values))


def test_separation_of_gears():
    """A force on the reaction of a joint has its derivatives by poses."""
    gear = REGISTRY.get("joint", "gear")
    values = {"bevel": False, "internal": False, "helix": 0.2, "pressure_angle": 0.0}
    scene = scene_for(gear, np.random.default_rng(0), values=values)
    fields = {name: scene.joints["element"].fields[name] for name in ("P_i", "P_j", "a_i", "a_j")}
    scene.add_force("gear_separation", "flanks", mesh="element", helix=0.2, **fields)
    compare(scene)


def has_friction(keyword, values):
    """True if the type of a case, or its variant of just these values, has friction."""
    type_info = REGISTRY.get("joint", keyword)
    fields = dict.fromkeys(specs_of(type_info.type)) | values
    alone = [v for c, v in type_info.variants if c == values]
    return any("friction" in e.kernels for e in [type_info.chosen(fields), *alone])


WITH_FRICTION = [(keyword, values) for keyword, values in JOINTS if has_friction(keyword, values)]


@pytest.mark.every(9)
@pytest.mark.parametrize("case", WITH_FRICTION, ids=case_names(WITH_FRICTION))
def test_friction(case):
    """Friction of a joint has its derivatives, those by the multipliers as well."""
    keyword, values = case
    scene = scene_for(REGISTRY.get("joint", keyword), np.random.default_rng(0), values=values)
    scene.add_force("friction", joint="element", mu=0.3, v_tol=2.0, radius=0.1)
    evaluator, tangent, (t, u, lam, a) = compare(scene)
    columns = []
    for k in range(len(lam)):
        terms = []
        for step in (1e-3, -1e-3):
            other = lam + step * np.eye(len(lam))[k]
            terms.append(residuals(evaluator, t, u, other, a)[:18])
        columns.append((terms[0] - terms[1]) / 2e-3)
    exact = (tangent.D.T + tangent.friction_by_multipliers).toarray()
    np.testing.assert_allclose(exact, np.array(columns).T, rtol=0.0, atol=1e-6)
