"""Continuation of equilibria: joints that the parameter changes, corners, several bodies."""

import numpy as np
import pytest
from support.internals import held_solution
from support.plain import long_in_plain_python
from unit.simulation.equilibrium.test_statics import hanging

import dap3d_core as dap


def stopped():
    """A mass of a spring of 100 N/m; a stop of 2000 N/m, 0.1 m below."""
    scene = dap.Scene(name="stopped")
    scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1))
    scene.add_joint("tran", "rail", P_i="m.O", P_j="ground.O", a_j="ground.z")
    scene.add_point("up", body="ground", sPp=(0.0, 0.0, 2.0))
    scene.add_point("low", body="ground", sPp=(0.0, 0.0, -0.1))
    scene.add_force("ptp", "spring", P_i="m.O", P_j="up", k=100.0, l0=2.0)
    scene.add_force("plane_stop", "stop", P_i="m.O", P_j="low", a_j="ground.z", k=2000.0)
    scene.add_force("f", "load", body_i="m", f=(0.0, 0.0, 0.0))
    return scene


@pytest.mark.slow
def test_path_passes_a_corner():
    """Where the stop is touched, at -10 N, the stiffness jumps to 2100 N/m."""
    found = dap.equilibrium_path(stopped(), "forces.load.f.z", "0:-40:9")
    load, z = found.values, found.of("m.r.z")
    exact = np.where(load > -10.0, load / 100.0, -0.1 + (load + 10.0) / 2100.0)
    np.testing.assert_allclose(z, exact, atol=1e-13)
    assert found.end == "reached"


def toggle():
    """Two rods of 1 m over a slider that a spring pushes back; one row too many in each hinge."""
    scene = dap.Scene(name="toggle")
    angle = 0.2
    c, s = np.cos(angle), np.sin(angle)
    for name, x, sign in (("crank", 0.5 * c, 1.0), ("rod", 1.5 * c, -1.0)):
        p = (np.cos(angle / 2.0), 0.0, -sign * np.sin(angle / 2.0), 0.0)
        scene.add_body(name, mass=1.0, Jp=(0.01, 0.1, 0.1), r=(x, 0.0, 0.5 * s), p=p)
        scene.add_point(f"{name}_a", body=name, sPp=(-0.5, 0.0, 0.0))
        scene.add_point(f"{name}_b", body=name, sPp=(0.5, 0.0, 0.0))
    scene.add_body("slider", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(2.0 * c, 0.0, 0.0))
    scene.add_point("wall", body="ground", sPp=(4.0, 0.0, 0.0))
    for name, i, j in (("hinge", "crank_a", "ground.O"), ("knee", "crank_b", "rod_a"),
                       ("pin", "rod_b", "slider.O")):  # fmt: skip
        body_i, body_j = i.partition("_")[0], j.partition("_")[0].partition(".")[0]
        scene.add_joint("rev", name, P_i=i, P_j=j, a_i=f"{body_i}.y", a_j=f"{body_j}.y")
    scene.add_joint("tran", "guide", P_i="slider.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("ptp", "spring", P_i="slider.O", P_j="wall", k=200.0, l0=2.8)
    scene.add_force("f", "load", P_i="crank_b", f=(0.0, 0.0, 0.0))
    return scene


def toggle_load(angle):
    """The load along z on the knee that holds the rods at an angle, by virtual work.
    The spring pushes by 200 (2.8 - 4 + 2 cos) N against the slider at 2 cos; the knee is at sin."""
    return -2.0 * np.tan(angle) * 200.0 * (2.0 * np.cos(angle) - 1.2)


@pytest.mark.slow  # quickly: a truss in tests/unit/study/test_equilibrium_path.py
def test_toggle_turns_where_virtual_work_says():
    """Its derivative vanishes where cos^3 = 0.6: three bodies with redundant joints."""
    found = dap.equilibrium_path(toggle(), "forces.load.f.z", "80:-200:8")
    angle, turning = -found.of("crank.pitch"), np.arccos(np.cbrt(0.6))
    np.testing.assert_allclose(found.values, toggle_load(angle), atol=1e-9)
    np.testing.assert_allclose(found.values[found.turning], [toggle_load(turning)], rtol=1e-11)
    np.testing.assert_allclose(angle[found.turning], [turning], atol=1e-9)
    assert any("redundant" in note for note in found.notes)


@pytest.mark.slow
@long_in_plain_python
@pytest.mark.parametrize(
    ("parameter", "values"),
    [("points.crank_a.sPp.x", "-0.5:-0.4:3"), ("points.wall.sPp.x", "4:3.8:3")],
)
def test_geometry_as_parameter(parameter, values):
    """Joints close at each value; poses are those that a search finds there."""
    scene = toggle()
    scene.add_force("weight", "gravity")
    found = dap.equilibrium_path(scene, parameter, values)
    for k in np.flatnonzero(found.given):
        alone = dap.equilibrium(found.equilibrium(int(k)).compiled.scene)
        np.testing.assert_allclose(found.u[k], alone.u, atol=1e-9)


def reach():
    """A mass on a rail below a pin, from which a rod of 1 m holds it."""
    scene = dap.Scene(name="reach")
    scene.add_body("m", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, -0.8))
    scene.add_joint("tran", "rail", P_i="m.O", P_j="ground.O", a_j="ground.z")
    scene.add_point("pin", body="ground", sPp=(0.6, 0.0, 0.0))
    scene.add_joint("sph-sph", "rod", P_i="m.O", P_j="pin", length=1.0)
    scene.add_force("weight", "gravity")
    return scene


def test_path_without_freedoms():
    """Joints alone move the mass along a circle."""
    found = dap.equilibrium_path(reach(), "points.pin.sPp.x", "0.6:0.9:4")
    np.testing.assert_allclose(found.of("m.r.z"), -np.sqrt(1.0 - found.values**2), atol=1e-13)
    assert found.end == "reached"


@pytest.mark.slow  # quickly: tests/unit/cli/commands/test_equilibrium_path.py
def test_path_that_ends_on_its_way():
    """Nearly 1 m aside the rod is at the end of its reach: what was found is returned."""
    found = dap.equilibrium_path(reach(), "points.pin.sPp.x", "0.6:1.2:4")
    assert found.end == "stuck"
    assert 0.999 < found.values[-1] <= 1.0
    assert "no step goes on there" in found.notes[-1]


@pytest.mark.slow
def test_states_of_elements_follow():
    """The relaxed part of a solid: its state is its extension, m g / k_p."""
    found = dap.equilibrium_path(hanging(), "forces.solid.k_p", "100:200:2")
    exact = 2.0 * 9.81 / found.values
    np.testing.assert_allclose(found.of("solid.z"), exact, rtol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(found.of("bob.r"), axis=1), 1.0 + exact, rtol=1e-11)


def test_directions_that_nothing_holds_are_left_out():
    """The least solution of equations one of which is empty."""
    matrix = np.diag([4.0, 1e-15, 2.0])
    np.testing.assert_allclose(
        held_solution(matrix, np.array([8.0, 1.0, 2.0]), 1.0), [2.0, 0.0, 1.0]
    )
