"""Numbers of a scene reach all that has a copy of them."""

import numpy as np
import pytest
from support.plain import jit_is_on

import dap3d_core as dap


@pytest.mark.slow
def test_points_of_a_slider_move_the_spring_that_names_it():
    """x = offset of both points + r of the mass; r in closed form, and its derivatives."""
    mass, k, x_0, r_0, v_0, t = 2.0, 18.0, 0.4, 0.3, 0.5, 0.7
    scene = dap.Scene(name="slider")
    scene.add_body("slide", mass=mass, Jp=(1.0, 1.0, 1.0), r=(r_0, 0.0, 0.0), r_dot=(v_0, 0, 0))
    scene.add_point("A", "slide", (0.1, 0.0, 0.0))
    scene.add_point("B", "ground", (0.02, 0.0, 0.0))
    scene.add_joint("tran", "rail", P_i="A", P_j="B", a_j="ground.x")
    scene.add_force("tran_sda", "spring", joint="rail", k=k, x_0=x_0)
    c, s = np.cos(np.sqrt(k / mass) * t), np.sin(np.sqrt(k / mass) * t)
    for name, sign, places in (("A", 1.0, [0.1, 0.2]), ("B", -1.0, [0.02, -0.1])):
        path = f"points.{name}.sPp.x"
        offset = sign * (np.array(places) - places[0]) + 0.1 - 0.02
        rest = x_0 - offset
        wanted = rest + (r_0 - rest) * c + v_0 / np.sqrt(k / mass) * s
        swept = dap.sweep(scene, {path: places}, outputs="slide.r.x", t_end=t, dt=t, rtol=1e-10)
        assert swept["slide.r.x"].values == pytest.approx(wanted, abs=1e-9)
        if jit_is_on():  # derivatives are of compiled code
            slopes = dap.sensitivities(scene, [path], t_end=t, dt=t, rtol=1e-10)
            assert slopes.final("slide.r.x") == pytest.approx([-sign * (1.0 - c)], abs=1e-8)


def test_points_beside_what_a_joint_brings():
    """A pressure angle is a force that the scene does not have; a spring on one of two wheels."""
    scene = dap.Scene(name="wheels")
    for name, x in (("left", 0.0), ("right", 0.5)):
        scene.add_body(name, mass=1.0, Jp=(0.1, 0.1, 0.1), r=(x, 0.0, 0.0))
        axle = {"P_j": scene.add_point(f"on {name}", "ground", (x, 0.0, 0.0)), "a_j": "ground.z"}
        scene.add_joint("rev", f"{name} hinge", P_i=f"{name}.O", a_i=f"{name}.z", **axle)
    scene.add_joint("gear", "mesh", joint_i="left hinge", joint_j="right hinge", radius_i=0.25,
                    radius_j=0.25)  # fmt: skip
    scene.add_point("hook", "left", (0.1, 0.2, 0.0))
    scene.add_force("ptp", "spring", P_i="hook", P_j="ground.O", k=5.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    outputs, path = ["left.w.z", "mesh.force.x"], "points.hook.sPp.y"
    swept = dap.sweep(scene, {path: [0.2, 0.1, -0.3]}, outputs=outputs, t_end=0.2, dt=0.1)
    for k, y in enumerate(swept[path].values):
        scene.points["hook"].sPp = (0.1, float(y), 0.0)
        single = dap.simulate(scene, t_end=0.2, dt=0.1)
        for name in outputs:
            assert swept[name].values[k] == single.quantity(name).values[-1], (name, y)
