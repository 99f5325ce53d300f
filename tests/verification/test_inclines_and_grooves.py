"""A vibrating incline, grooves and boxes: tasks of engineers, said with standard types."""

import numpy as np
import pytest

import dap3d_core as dap

G, SLOPE, MU = 9.81, np.radians(10.0), 0.3
NORMAL, DOWN = (np.sin(SLOPE), 0.0, np.cos(SLOPE)), np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
AMPLITUDE, OMEGA = 0.001, 2.0 * np.pi * 10.0


def vibrating():
    """A parcel on an incline that a shaker moves to and fro along x; both start as fast."""
    scene = dap.Scene(name="vibrating incline")
    start = (AMPLITUDE * OMEGA, 0.0, 0.0)
    scene.add_body("table", mass=5.0, Jp=(0.1, 0.1, 0.1), r_dot=start)
    scene.add_body("parcel", mass=2.0, Jp=(0.1, 0.1, 0.1), r_dot=start)
    scene.add_vector("normal", "table", NORMAL)
    scene.add_joint("tran", "guide", P_i="table.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("motor", "shaker", joint="guide", position="shake")
    scene.add_function("harmonic", "shake", amplitude=AMPLITUDE, frequency=OMEGA)
    scene.add_contact("ball_plane", "surface", P_i="parcel.O", radius=0.0, P_j="table.O",
                      a_j="normal", mu=MU)  # fmt: skip
    scene.add_force("weight", "gravity")
    return scene


def test_a_ball_rolls_in_a_groove_and_boxes_slide_beside_it():
    """In a V of half angle a it rolls on a radius R sin a: g sin / (1 + 0.4 / sin^2 a).
    A box slides by g (sin - mu cos), and takes another along that stands on it."""
    scene, half, R = dap.Scene(name="groove"), np.radians(40.0), 0.05
    for name, side in (("left", 1.0), ("right", -1.0)):
        scene.add_vector(name, "ground", (np.sin(SLOPE) * np.sin(half), side * np.cos(half),
                                          np.cos(SLOPE) * np.sin(half)))  # fmt: skip
    up = np.array(NORMAL)
    scene.add_vector("up", "ground", NORMAL)
    scene.add_body("ball", mass=1.0, Jp=[0.4 * R**2] * 3, r=R / np.sin(half) * up)
    for side in ("left", "right"):
        scene.add_contact("ball_plane", side, P_i="ball.O", radius=R, a_j=side, mu=0.5)
    for k, name in enumerate(("lower", "upper")):
        scene.add_body(name, mass=1.0, Jp=[0.01] * 3, r=(0.05 + 0.1 * k) * up + (0.0, 1.0, 0.0),
                       rpy=(0.0, "10 deg", 0.0))  # fmt: skip
    scene.add_point("top", "lower", (0.0, 0.0, 0.05))
    size = (0.2, 0.2, 0.1)
    scene.add_contact("box_plane", "floor", P_i="lower.O", size=size, a_j="up", mu=0.1)
    scene.add_contact("box_plane", "stack", P_i="upper.O", size=size, P_j="top", a_j="lower.z",
                      mu=0.4)  # fmt: skip
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=0.5, dt=0.25)
    ball = G * np.sin(SLOPE) / (1.0 + 0.4 / np.sin(half) ** 2)
    box = G * (np.sin(SLOPE) - 0.1 * np.cos(SLOPE))
    for body, a in ((0, ball), (1, box), (2, box)):
        moved = result.r[-1, body] - result.r[0, body]
        assert moved == pytest.approx(a / 2.0 * 0.25 * DOWN, abs=1e-10)
