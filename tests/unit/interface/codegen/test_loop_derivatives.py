"""Derivatives of group loops where the contract tests of types do not reach: tables."""

import numpy as np
from scipy.interpolate import CubicSpline

import dap3d_core as dap


def test_springs_by_tables():
    """Each of several springs has the slope of its own spline at its own elongation.
    Along its line a spring has the stiffness f'(x), across it f(x) / l."""
    x, y = np.linspace(-0.5, 0.5, 7), np.array([-9.0, -5.0, -2.0, 0.0, 3.0, 4.0, 8.0])
    curve, elongations = CubicSpline(x, y, bc_type="natural"), (-0.31, 0.07, 0.44)
    scene = dap.Scene(name="splines")
    scene.add_function("spline", "curve", x=x, y=y)
    for k, elongation in enumerate(elongations):
        scene.add_body(f"b{k}", mass=1.0, Jp=np.eye(3), r=[1.0 + elongation, 0, 0])
        scene.add_force("ptp", f"S{k}", P_i=f"b{k}.O", P_j="ground.O", l0=1.0, function="curve")
    lin = dap.linearize(scene)
    own = [(curve(e, 1), curve(e) / (1.0 + e), curve(e) / (1.0 + e)) for e in elongations]
    expected = np.sort(np.ravel(own))
    squares = np.real(lin.eigenvalues**2)
    found = np.sort(-squares[squares != 0.0][::2])
    np.testing.assert_allclose(np.sort(found), expected, rtol=1e-11)
