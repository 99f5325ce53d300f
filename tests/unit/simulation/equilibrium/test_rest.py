"""Motions in words."""

import numpy as np

import dap3d_core as dap
from dap3d_core.simulation.equilibrium.rest import describe_motion, direction

MODEL = dap.compile("fourbar3").model


def test_the_bodies_that_move_most_are_named_and_the_way_of_the_first():
    x = np.zeros((3, 6))
    x[0, 2], x[1, 2], x[2, 5] = -1.0, -0.6, 0.4
    assert describe_motion(MODEL, x) == ("bodies crank, coupler, of which crank moves along -z")
    x[2, 5] = 3.0
    assert describe_motion(MODEL, x) == "body follower, which turns about +z"


def test_a_direction_is_an_axis_or_three_components():
    assert direction(np.array([0.0, 2.0, 1e-3])) == "+y"
    assert direction(np.array([3.0, 0.0, -4.0])) == "(0.6, 0, -0.8)"
