"""The problem of contacts alone: what they feel of each other is what joints let them."""

import numpy as np

import dap3d_core as dap
from dap3d_core.integrators.moreau.problem import take_own
from dap3d_core.integrators.moreau.reduced import factor_joints, put_felt


def pressed_arm():
    """Arrays of a step in which the tip of an arm is pressed onto the floor, and slides.

    Two links on hinges about y: along y the tip hardly moves.
    """
    scene = dap.Scene(name="arm")
    scene.add_material("surface", mu=0.5)
    scene.add_collisions(material="surface")
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_force("weight", "gravity")
    for k, r in enumerate(([0.4, 0.0, 0.9], [1.0, 0.0, 0.4])):
        scene.add_body(f"link{k}", mass=1.0 + k, Jp=[0.02, 0.05, 0.05], r=r)
    scene.add_point("base", "ground", [0.0, 0.0, 1.2])
    scene.add_point("root", "link0", [-0.4, 0.0, 0.3])
    scene.add_point("end", "link0", [0.3, 0.1, -0.2])
    scene.add_point("begin", "link1", [-0.3, 0.1, 0.3])
    scene.add_shape("sphere", body="link1", at=[0.2, 0.0, -0.3], radius=0.1, collides=True)
    for k, (i, j) in enumerate((("base", "root"), ("end", "begin"))):
        a_i = "ground.y" if k == 0 else "link0.y"
        scene.add_joint("rev", f"hinge{k}", P_i=i, P_j=j, a_i=a_i, a_j=f"link{k}.y")
    run = dap.start(scene, t_end=0.1, contact_step=1e-3)
    run.step(0.005)
    return run._integration._arrays


def dense(s):
    """Masses, rows of joints and of the contact of such a step, as matrices; one group has all."""
    n, k = len(s.mass) - 1, len(s.y)
    M, D, J = np.zeros((6 * n, 6 * n)), np.zeros((k, 6 * n)), np.zeros((3, 6 * n))
    for b in range(n):
        M[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = s.mass[b + 1] * np.eye(3)
        M[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = s.spin[b + 1].reshape(3, 3)
    for row in range(k):
        for q in range(s.row_start[row], s.row_start[row + 1]):
            D[row, 6 * (s.row_body[q] - 1) :][:6] = s.D[q]
    for side in range(2):
        b = s.bodies[0, side]
        if b > 0:
            J[:, 6 * (b - 1) : 6 * b] = s.J[0].reshape(3, 2, 6)[:, side]
    return M, D, J


def test_what_a_contact_feels_is_what_joints_let_it():
    """By one pass of joints, which leaves some 1e-6 of the answer, and so the square of that.

    Limit: ten times (6e-6)^2, of the weakest of their rows. Of a tangent along which there is never
    an impulse there is nothing, whatever was there.
    """
    s = pressed_arm()
    assert s.contact_count == s.chosen_count == 1
    M, D, J = dense(s)
    free = np.linalg.inv(M)
    held = free - free @ D.T @ np.linalg.pinv(D @ free @ D.T) @ D @ free
    expected = J @ held @ J.T
    for mu in (0.5, 0.0):
        s.mu[0] = mu
        s.x[0, 1:] = 0.0
        s.felt[:] = s.answer[:] = 7.0
        take_own(s)
        assert factor_joints(s)
        put_felt(s, 1)
        limit = 3e-10 * np.abs(J @ free @ J.T).max()
        if mu == 0.0:
            expected[1:] = expected[:, 1:] = 0.0
        assert np.abs(s.felt[:3, :3] - expected).max() < limit
