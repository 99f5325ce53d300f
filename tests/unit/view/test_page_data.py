"""Arrows of a page: the forces of contacts at the points where they act."""

import base64

import numpy as np
import pytest

import dap3d_core as dap


def test_a_contact_has_an_arrow_for_each_point_that_carries():
    """A sliding ball: m g upwards, mu m g against its motion, at the point below its centre."""
    mu, mass = 0.3, 2.0
    scene = dap.Scene(name="slides")
    scene.add_body("ball", mass=mass, Jp=[0.008] * 3, r=[0.0, 0.0, 0.1], r_dot=[3.0, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=mu)
    result = dap.simulate(scene, t_end=0.2, dt=0.1)
    assert result.contact("floor").force == pytest.approx(
        np.tile([-mu * mass * 9.81, 0.0, mass * 9.81], (3, 1)), abs=1e-6
    )
    (arrow,) = [a for a in dap.view(result).data["arrows"] if a["layer"] == "contacts"]
    values, places = (
        np.frombuffer(base64.b64decode(arrow[name]), dtype="<f4").reshape(-1, 3)
        for name in ("values", "places")
    )
    assert (arrow["name"], arrow["what"]) == ("floor", "force")
    assert values == pytest.approx(result.contact("floor").force, rel=1e-6)  # single precision
    assert places[:, 0] == pytest.approx(result.r[:, 0, 0], rel=1e-6)
    assert places[:, 1:] == pytest.approx(0.0, abs=1e-9)
