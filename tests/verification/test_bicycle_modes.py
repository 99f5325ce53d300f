"""Eigenvalues of the Whipple bicycle against the benchmark of Meijaard and others, to 12 digits.
J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab: Linearized dynamics equations for the
balance and steer of a bicycle: a benchmark and review, Proc. R. Soc. A 463 (2007) 1955-1982. The
bicycle is built from its table 1; the expected eigenvalues are those of its linear equations, and
at v = 0 and 5 m/s those of its table 2."""

import numpy as np
import pytest
from support.whipple import system

import dap3d_core as dap

PRINTED = {
    0.0: [-5.530943717653930, -3.131643247906560, 3.131643247906560, 5.530943717653930],
    5.0: [-14.0783896927982, -0.322866429004087,
          -0.775341882195845 - 4.46486771378823j, -0.775341882195845 + 4.46486771378823j],
}  # fmt: skip


def bicycle(speed):
    """The bicycle, upright at a forward speed; x forward, y to the left, z up."""
    scene = dap.Scene(name="bicycle")
    v = {"r_dot": [speed, 0, 0]}
    scene.add_body("rear", mass=2.0, Jp=np.diag([0.0603, 0.12, 0.0603]), r=[0, 0, 0.3],
                   w=[0, speed / 0.3, 0], **v)  # fmt: skip
    scene.add_body("frame", mass=85.0, r=[0.3, 0, 0.9], **v,
                   Jp=[[9.2, 0, -2.4], [0, 11.0, 0], [-2.4, 0, 2.8]])  # fmt: skip
    scene.add_body("fork", mass=4.0, r=[0.9, 0, 0.7], **v,
                   Jp=[[0.05892, 0, 0.00756], [0, 0.06, 0], [0.00756, 0, 0.00708]])  # fmt: skip
    scene.add_body("front", mass=3.0, Jp=np.diag([0.1405, 0.28, 0.1405]), r=[1.02, 0, 0.35],
                   w=[0, speed / 0.35, 0], **v)  # fmt: skip
    axis = np.array([-np.sin(np.pi / 10), 0, np.cos(np.pi / 10)])
    head = np.array([1.1, 0, 0]) + 0.7 / axis[2] * axis  # the axis meets the ground at x = 1.1
    for body, place in (("frame", [0.3, 0, 0.9]), ("fork", [0.9, 0, 0.7])):
        scene.add_point(f"head-{body}", body, head - place)
        scene.add_vector(f"axis-{body}", body, axis)
    scene.add_point("rear-hub", "frame", [-0.3, 0, -0.6])
    scene.add_point("front-hub", "fork", [0.12, 0, -0.35])
    scene.add_joint("rev", "rear-axle", P_i="rear.O", P_j="rear-hub", a_i="rear.y", a_j="frame.y")
    scene.add_joint("rev", "steering", P_i="head-fork", P_j="head-frame", a_i="axis-fork",
                    a_j="axis-frame")  # fmt: skip
    scene.add_joint("rev", "front-axle", P_i="front.O", P_j="front-hub", a_i="front.y",
                    a_j="fork.y")  # fmt: skip
    scene.add_joint("disk", "rear-contact", body_i="rear", radius=0.3)
    scene.add_joint("disk", "front-contact", body_i="front", radius=0.35)
    scene.add_force("weight", "gravity", gravity=9.81)
    return scene


@pytest.mark.parametrize("speed", [float(v) for v in range(11)])
def test_eigenvalues(speed):
    """Weave, capsize and castering at every speed; all other eigenvalues are exactly zero.
    They are the place (x, y), heading, both wheels' angles, and the speed."""
    expected = np.linalg.eigvals(system(speed))
    lin = dap.linearize(bicycle(speed))
    assert np.sum(lin.eigenvalues == 0.0) == 6
    own = lin.eigenvalues[6:]
    for value in (*expected, *PRINTED.get(speed, ())):
        nearest = own[np.argmin(np.abs(own - value))]
        # 12 digits of the printed numbers; the capsize eigenvalue near its zero at 6.02 m/s is
        # the small difference of large terms
        assert abs(nearest - value) <= 1e-12 * max(abs(value), 1.0)
    assert lin.is_steady
    assert lin.stable == (4.3 < speed < 6.02)  # table 2: self-stable from 4.29 to 6.02 m/s
