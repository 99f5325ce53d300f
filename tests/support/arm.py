"""A six-axis arm: its scene, and its equations in joint angles, derived without dap3d."""

import numpy as np

import dap3d_core as dap
from support.minimal_motion import turned

#: Axes of the six hinges in the pose of zero angles; each hinge is at the lower end of its link.
AXES = np.array([[0.0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
#: From hinge to hinge, and from each hinge to the mass centre of its link, m.
LINKS = np.array(
    [[0, 0, 0.3], [0, 0, 0.5], [0.4, 0, 0.05], [0.2, 0, 0], [0.12, 0, 0], [0.08, 0, 0]]
)
CENTRES = 0.5 * LINKS + np.array([0.01, -0.02, 0.0])
MASS = np.array([6.0, 5.0, 4.0, 2.0, 1.2, 0.6])
INERTIA = np.array(
    [[0.1, 0.1, 0.04], [0.12, 0.11, 0.02], [0.02, 0.07, 0.07], [0.006, 0.01, 0.01],
     [0.002, 0.003, 0.003], [0.0006, 0.0009, 0.0009]]
)  # fmt: skip
GRAVITY = np.array([0.0, 0.0, -9.81])
GAINS = np.array([60.0, 120.0, 70.0, 15.0, 10.0, 2.0]), np.array([9.0, 18.0, 9.0, 1.5, 1.0, 0.15])
GOAL = np.array([0.8, -0.5, 0.9, -0.6, 0.4, 1.0])
NAMES = [f"motor{k + 1}" for k in range(6)]
JOINTS = [f"hinge{k + 1}" for k in range(6)]


def arm_scene(method="standard"):
    """The arm at rest at zero angles; a motor at each hinge, whose moment is an input."""
    scene = dap.Scene(name="arm")
    scene.simulation.method = method
    place = np.zeros(3)
    for k in range(6):
        body = f"link{k + 1}"
        below = f"link{k}" if k else "ground"
        scene.add_body(body, mass=MASS[k], Jp=INERTIA[k], r=place + CENTRES[k])
        scene.add_point(f"lower{k}", body, -CENTRES[k])
        end = LINKS[k - 1] - CENTRES[k - 1] if k else (0.0, 0.0, 0.0)
        scene.add_point(f"upper{k}", below, end)
        axis = "xyz"[int(np.argmax(AXES[k]))]
        other = {"x": "y", "y": "z", "z": "x"}[axis]
        scene.add_joint("rev", JOINTS[k], P_i=f"lower{k}", P_j=f"upper{k}",
                        a_i=f"{body}.{axis}", a_j=f"{below}.{axis}")  # fmt: skip
        scene.add_input(NAMES[k])
        # n_a is a tension: the motor turns its link by -n_a seen from the link, body i, by +1 here
        scene.add_force("rot_sda", f"drive{k + 1}", v_i=f"{body}.{other}", v_j=f"{below}.{other}",
                        axis=f"{below}.{axis}", n_a=1.0, input=NAMES[k])  # fmt: skip
        place = place + LINKS[k]
    scene.add_force("weight", "gravity")
    return scene


def torque(q, q_dot):
    """The law of the controllers: towards the goal, with damping."""
    return GAINS[0] * (GOAL - q) - GAINS[1] * q_dot


def accelerations(q, q_dot, tau):
    """q_ddot (6,) by the recursive Newton-Euler algorithm, column by column of the mass matrix.
    Craig, Introduction to Robotics, 6.5: velocities outwards, forces inwards, in ground axes. All
    columns, and the moments at rest, are found at once."""
    rates, seconds = np.zeros((7, 6)), np.vstack([np.eye(6), np.zeros(6)])
    rates[6] = q_dot
    gravity = np.zeros((7, 3))
    gravity[6] = GRAVITY
    moments = _moments(q, rates, seconds, gravity)
    return np.linalg.solve(moments[:6].T, tau - moments[6])


def _moments(q, q_dot, q_ddot, gravity):
    """(k, 6) moments of the motors at q (6,) for k rates, accelerations and gravities."""
    A, w, w_dot, a = np.eye(3), np.zeros_like(gravity), np.zeros_like(gravity), -gravity
    links = []
    for k in range(6):
        axis = A @ AXES[k]
        turning = axis * q_dot[:, k, None]
        w_dot = w_dot + axis * q_ddot[:, k, None] + cross(w, turning)
        w = w + turning
        A = A @ turned(AXES[k], q[k])
        s, d = A @ CENTRES[k], A @ LINKS[k]
        a_c = a + cross(w_dot, s) + cross(w, cross(w, s))
        J = A @ np.diag(INERTIA[k]) @ A.T
        links.append((axis, s, d, MASS[k] * a_c, w_dot @ J + cross(w, w @ J)))
        a = a + cross(w_dot, d) + cross(w, cross(w, d))
    moments, F, N = np.zeros_like(q_dot), np.zeros_like(gravity), np.zeros_like(gravity)
    for k, (axis, s, d, force, moment) in reversed(list(enumerate(links))):
        N = N + moment + cross(s, force) + cross(d, F)
        F = F + force
        moments[:, k] = N @ axis
    return moments


def cross(a, b):
    """As numpy's, of (k, 3) or (3,), in a third of the time."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
