"""Scenes of one body: a wheel whose turns count, a driven crank, a stone in flight."""

import dap3d_core as dap


def wheel():
    """A wheel on a torsion spring that turns more than once; its axle rubs."""
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=2.0, Jp=(1.0, 1.0, 1.5), w=(0.0, 0.0, 9.0))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force(
        "rot_sda", "spring", v_i="wheel.x", v_j="ground.x", axis="ground.z", k=2.0, turns=True
    )
    scene.add_force("f", "push", body_i="wheel", f=(1.0, 0.5, 0.0))
    scene.add_force("friction", "rubbing", joint="axle", mu=0.2, radius=0.1, v_tol=0.01)
    return scene


def stone():
    """A stone in flight, whose spring an event makes stiff."""
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 2.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("weight", "gravity")
    scene.add_force("ptp", "spring", P_i="stone.O", P_j="ground.O", k=0.0, l0=1.0)
    return scene


def driven():
    """A crank that is turned by a step of 1 rad between 0.3 and 0.5 s: two steps end there."""
    scene = dap.Scene(name="driven")
    scene.add_body("crank", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("rev", "axle", P_i="crank.O", P_j="ground.O", a_i="crank.z", a_j="ground.z")
    scene.add_function("b", "turn", x_start=0.3, x_end=0.5, f_start=0.0, f_end=1.0)
    scene.add_joint("drive-rot", "motor", body_i="crank", a_j="ground.z", function="turn")
    return scene
