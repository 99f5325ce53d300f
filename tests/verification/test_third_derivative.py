"""The third derivative of a function of time: a row on the rate of a function, formulas derived.

A point is held where a first-order law puts it: x = T f_dot(t) + f(t), the feed-forward of a servo
with the time constant T. Its velocity is T f_ddot + f_dot and its acceleration T f_dddot + f_ddot.
"""

import numpy as np
import pytest

import dap3d_core as dap

PLUGIN = """
from dap3d_core.interface import Joint, Point, function, hookimpl, number, point

interface_version = 1


class Lead(Joint):
    \"\"\"x of P_i is f + T f_dot.\"\"\"

    keyword, rows = "lead", 1
    drives = True
    P_i: Point = point()
    T: float = number()
    function: str = function()

    def C(r_P_i, f, f_dot, T):
        return r_P_i[0] - f - T * f_dot


@hookimpl
def dap3d_joints():
    return [Lead]
"""


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_row_on_the_rate_of_a_function(integrator, tmp_path):
    """Positions and accelerations of the harmonic function in closed form, to 1e-11 by rounding.
    The row holds the motion exactly, whatever the steps are."""
    (tmp_path / "plugin.py").write_text(PLUGIN)
    made = dap.Scene(name="lead")
    made.add_body("slide", mass=2.0, Jp=[0.1, 0.1, 0.1], r=[0.3 * 0.5 * 4.0, 0.0, 0.0])
    made.add_function("harmonic", "f", amplitude=0.5, frequency=4.0)
    made.add_joint("lead", "drive", P_i="slide.O", T=0.3, function="f")
    made.save(tmp_path)
    result = dap.simulate(str(tmp_path), t_end=1.0, dt=0.1, allow_code=True, integrator=integrator)
    f = [0.5 * 4.0**n * np.sin(4.0 * result.t + n * np.pi / 2) for n in range(4)]
    np.testing.assert_allclose(result.r[:, 0, 0], f[0] + 0.3 * f[1], atol=1e-11)
    np.testing.assert_allclose(result.rd[:, 0, 0], f[1] + 0.3 * f[2], atol=1e-11)
    np.testing.assert_allclose(result.rdd[:, 0, 0], f[2] + 0.3 * f[3], atol=1e-11)
    force = result.reaction("drive")["i"].force[:, 0]
    np.testing.assert_allclose(force, 2.0 * (f[2] + 0.3 * f[3]), atol=1e-10)
