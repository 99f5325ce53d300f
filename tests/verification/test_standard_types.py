"""Standard types on mechanisms with closed forms.
Tolerances: rtol 1e-11 over a second leaves some 1e-10."""

import numpy as np
import pytest

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def block(*, angle=0.0, **fields):
    """One body, its x axis turned by an angle about y, so that it points downhill."""
    scene = dap.Scene(name="block")
    p = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.2, 0.3), p=p, **fields)
    return scene


def last(scene, t=1.0):
    return dap.simulate(scene, t_end=t, dt=t, **TIGHT)


def test_a_ring_falls_along_its_axis_and_keeps_its_spin():
    """cyl: free fall along the axis, constant spin about it."""
    scene = block(w=(0.0, 0.0, 3.0))
    scene.add_joint("cyl", "rod", a_i="block.z", a_j="ground.z", P_i="block.O", P_j="ground.O")
    scene.add_force("weight", "gravity")
    result = last(scene)
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, -0.5 * 9.81], abs=1e-10)
    assert result.w[-1, 0] == pytest.approx([0.0, 0.0, 3.0], abs=1e-10)


def test_a_fixed_body_stays_and_carries_its_weight():
    """fix: the pose stays, whatever acts on it; the reaction is weight and moment applied."""
    scene = block(angle=0.7, r=(1.0, 2.0, 3.0))
    scene.add_joint("fix", "wall", body_i="block")
    scene.add_force("weight", "gravity")
    scene.add_force("n", "twist", body_i="block", n=(1.0, -2.0, 0.5))
    result = last(scene)
    assert result.r[-1, 0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-12)
    assert result.p[-1, 0] == pytest.approx(result.p[0, 0], abs=1e-12)
    reaction = result.reaction("wall")["i"]
    assert reaction.force[-1] == pytest.approx([0.0, 0.0, 2.0 * 9.81], abs=1e-10)
    assert reaction.moment[-1] == pytest.approx([-1.0, 2.0, -0.5], abs=1e-10)


def test_a_universal_joint_leaves_two_rotations():
    """univ: two degrees of freedom to ground, and the arms stay perpendicular while it tumbles."""
    scene = block(r=(0.0, 0.0, -0.5))
    scene.add_point("top", "block", (0.0, 0.0, 0.5))
    scene.bodies["block"].w = (1.0, 2.0, 0.0)
    scene.add_joint("univ", "cross", P_i="top", P_j="ground.O", a_i="block.x", n_j="ground.y")
    scene.add_force("weight", "gravity")
    compiled = dap.compile(scene)
    assert compiled.redundancy().rank.dof == 2
    result = dap.simulate(compiled, t_end=2.0, dt=0.1, **TIGHT)
    p = result.p[:, 0]
    y_of_x_axis = 2.0 * (p[:, 1] * p[:, 2] + p[:, 0] * p[:, 3])
    assert np.max(np.abs(y_of_x_axis)) < 1e-12
    assert result.energy.total == pytest.approx(result.energy.total[0], abs=1e-9)


def test_constant_forces_and_moments():
    """f, fp, n, np on free bodies: a = F / m; spin about a principal axis grows with n / J."""
    scene = block(angle=0.3)
    scene.add_force("f", "push", body_i="block", f=(1.0, 2.0, 3.0))
    scene.add_force("n", "twist", body_i="block", n=(0.0, 0.4, 0.0))
    result = last(scene)
    assert result.r[-1, 0] == pytest.approx([0.25, 0.5, 0.75], abs=1e-11)
    assert result.w[-1, 0] == pytest.approx([0.0, 2.0, 0.0], abs=1e-10)
    scene = block(angle=0.3)
    scene.add_force("fp", "thrust", body_i="block", fp=(2.0, 0.0, 0.0))
    scene.add_force("np", "screw", body_i="block", np=(0.3, 0.0, 0.0))
    result = last(scene)
    axis = np.array([np.cos(0.3), 0.0, -np.sin(0.3)])  # the spin about x does not turn x
    assert result.r[-1, 0] == pytest.approx(0.5 * axis, abs=1e-11)
    assert result.w[-1, 0] == pytest.approx(3.0 * axis, abs=1e-10)


def test_a_force_off_the_mass_centre_turns_the_body():
    """f at a point: moment s x f about the mass centre at the start."""
    scene = block()
    scene.add_point("tip", "block", (0.0, 0.5, 0.0))
    scene.add_force("f", "push", P_i="tip", f=(3.0, 0.0, 0.0))
    result = dap.simulate(scene, t_end=0.0)
    assert result.v_dot[0] == pytest.approx([1.5, 0.0, 0.0, 0.0, 0.0, -1.5 / 0.3], abs=1e-12)


def values(keyword, fields, x):
    """(f, f', f'', f''') of a function at x, by the kernel itself."""
    type_info = dap.load_registry().get("function", keyword)
    instance = type_info.type(**fields)
    known = {**fields, **instance.prepare({})}
    from inspect import signature

    names = signature(type_info.type.value).parameters
    return np.array(type_info.type.value(*(x if n == "x" else known[n] for n in names)))


def test_functions_meet_their_ends():
    """b, c, d: values, slopes, curvatures at the ends and beyond as the manual states."""
    b = {"x_start": 0.5, "x_end": 2.0, "f_start": 1.0, "f_end": -1.0}
    assert values("b", b, 0.4)[:3] == pytest.approx([1.0, 0.0, 0.0], abs=0.0)
    assert values("b", b, 1.25)[:3] == pytest.approx([0.0, -2.0 * 1.875 / 1.5, 0.0], abs=1e-14)
    assert values("b", b, 2.1)[:3] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-15)
    c = {"x_start": 0.0, "x_end": 0.8, "f_start": 0.0, "f_end": 0.8, "x_max": 0.4, "f_max": 1.0}
    assert values("c", c, 0.4)[:2] == pytest.approx([1.0, 0.0], abs=1e-12)
    assert values("c", c, 0.8)[:3] == pytest.approx([0.8, 0.0, 0.0], abs=1e-11)
    assert values("c", c, 0.6742)[0] == pytest.approx(0.78856, abs=1e-5)  # its dip
    hump = {**c, "f_end": 0.0}
    u = 0.3
    assert values("c", hump, 0.8 * u)[0] == pytest.approx(64.0 * (u * (1.0 - u)) ** 3, abs=1e-12)
    d = {"x_start": 1.0, "x_end": 3.0, "f_start": 0.5, "fp_end": 4.0}
    assert values("d", d, 3.0)[:3] == pytest.approx([4.5, 4.0, 0.0], abs=1e-14)
    assert values("d", d, 5.0)[:3] == pytest.approx([12.5, 4.0, 0.0], abs=1e-14)
