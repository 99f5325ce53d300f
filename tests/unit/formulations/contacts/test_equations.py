"""Accelerations with contacts against dense equations of motion with Coulomb's law, by numpy."""

import numpy as np
import pytest
from support.internals import ContactTable

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

G, MU, MASS, HEIGHT = 9.81, 0.3, 2.0, 0.05
INERTIA = np.diag([0.01, 0.015, 0.02])
V, W = np.array([1.0, 0.3, 0.0]), np.array([0.0, 0.0, 2.0])


def plate(feet, states):
    """An evaluator of a body on feet (k, 2) that slides and turns, at modes of its contacts."""
    scene = dap.Scene(name="plate")
    scene.add_body("plate", mass=MASS, Jp=np.diag(INERTIA).tolist(), r=[0, 0, HEIGHT],
                   r_dot=V.tolist(), w=W.tolist())  # fmt: skip
    scene.add_force("weight", "g")
    for k, (x, y) in enumerate(feet):
        scene.add_point(f"F{k}", "plate", [x, y, -HEIGHT])
        scene.add_contact("ball_plane", f"foot{k}", P_i=f"F{k}", mu=MU)
    evaluator = CompiledModel(scene).evaluator
    modes = evaluator.model.initial_states.copy()
    modes[ContactTable(evaluator).mode] = states
    evaluator.states = modes
    return evaluator


def dense(feet, modes):
    """Rows, friction by normal forces, masses, forces and right-hand sides, of velocities."""
    M = np.zeros((6, 6))
    M[:3, :3], M[3:, 3:] = MASS * np.eye(3), INERTIA
    f = np.array([0.0, 0.0, -MASS * G, *-np.cross(W, INERTIA @ W)])
    rows, pushes, right = [], [], []
    for (x, y), mode in zip(feet, modes, strict=True):
        arm = np.array([x, y, -HEIGHT])
        slip = V + np.cross(W, arm)
        friction = -MU * slip / np.linalg.norm(slip) if mode == 1 else np.zeros(3)
        for k, axis in enumerate(np.eye(3)[[2, 0, 1]][: {0: 0, 1: 1, 2: 3}[mode]]):
            rows.append([*axis, *np.cross(arm, axis)])
            push = friction if k == 0 else np.zeros(3)
            pushes.append([*push, *np.cross(arm, push)])
            right.append(-axis @ np.cross(W, np.cross(W, arm)))
    return np.array(rows), np.array(pushes).T, M, f, np.array(right)


def accelerations(evaluator):
    """(6,) accelerations, and the multipliers of rows that are not zero."""
    report = evaluator.report(0.0, evaluator.model.u0)
    multipliers = report[evaluator.model.report_layout["Lam"]]
    return report[:6], multipliers


@pytest.mark.parametrize("modes", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (0, 0, 0)])
def test_accelerations_are_those_of_dense_equations(modes):
    feet = [(0.2, 0.1), (-0.2, 0.12), (0.05, -0.15)]
    a, _ = accelerations(plate(feet, modes))
    D, F, M, f, right = dense(feet, modes)
    k = len(right)
    if k == 0:
        assert a == pytest.approx(np.linalg.solve(M, f), abs=1e-14)
        return
    whole = np.block([[M, -(D.T + F)], [D, np.zeros((k, k))]])
    found = np.linalg.solve(whole, np.concatenate([f, right]))
    assert a == pytest.approx(found[:6], abs=1e-12 * G)  # rounding, over arms of 0.1 m


def test_forces_of_feet_that_share_a_load_are_the_least():
    """By squares of forces times those of their rows in coordinates scaled by mass and inertia."""
    feet = [(0.2, 0.15), (-0.2, 0.15), (0.2, -0.15), (-0.2, -0.15)]
    a, multipliers = accelerations(plate(feet, (1, 1, 1, 1)))
    D, F, M, f, right = dense(feet, (1, 1, 1, 1))
    forces = multipliers[::3]
    assert forces.sum() == pytest.approx(MASS * G, rel=1e-12)
    assert a == pytest.approx(np.linalg.solve(M, f + (D.T + F) @ forces), abs=1e-12 * G)
    assert D @ a == pytest.approx(right, abs=1e-12 * G)
    scaled = D @ np.diag(1.0 / np.sqrt(np.diag(M)))
    weights = np.sum(scaled**2, axis=1)
    null = np.linalg.svd(D.T)[2][3:]  # of forces that change nothing
    assert null @ (weights * forces) == pytest.approx(0.0, abs=1e-9 * MASS * G)
