"""Scenes whose velocities jump, of standard types."""

import dap3d_core as dap


def bouncing(e=0.8, k=1e4):
    """A ball that bounces on the ground, 1 m below it at the start."""
    scene = dap.Scene(name="bouncing")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0), r_dot=(0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_force("plane_stop", "floor", P_i="ball.O", e=e, k=k)
    return scene


def swinging():
    """A bar on a hinge under gravity that hits a stop of its angle again and again."""
    scene = dap.Scene(name="swinging")
    scene.add_body("bar", mass=2.0, Jp=(0.1, 0.3, 0.3), r=(0.7, 0.0, 0.0))
    scene.add_point("pin", body="bar", sPp=(-0.7, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bar.z", a_j="ground.z")
    scene.add_force("weight", "gravity", gravity=9.81, wgt=(0.0, -1.0, 0.0))
    scene.add_force("rot_stop", "stop", v_i="bar.x", v_j="ground.x", axis="ground.z",
                    theta_stop=2.0, side="max", e=0.9, k=1e5, w_rest=1e-3)  # fmt: skip
    return scene
