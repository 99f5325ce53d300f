"""Functions by points and by pieces, the warning of c, and rows on the rate of a function."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import dap3d_core as dap
from dap3d_functions.smooth_hump import SmoothHump
from dap3d_functions.step import Step

X = np.array([0.2, 0.5, 0.6, 1.1, 2.0])
Y = np.array([1.0, -0.5, 0.3, 2.0, 1.5])


def driven(keyword, **fields):
    """The machine of a body whose driver follows a function."""
    scene = dap.Scene(name="driven")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function(keyword, "curve", **fields)
    scene.add_joint("drive-tran", "drive", body_i="a", a_j="ground.x", function="curve")
    return dap.compile(scene).evaluator


def values(evaluator, x):
    """(f, f', f'', f''') at x as the compiled driver has them."""
    evaluator.rows(x, evaluator.model.u0)
    return evaluator.system.F[1, :4].copy()


def test_a_spline_is_the_natural_cubic_spline():
    """Value and derivatives are scipy's, inside and at the points; rounding of 1e2 remains."""
    evaluator, curve = driven("spline", x=X, y=Y), CubicSpline(X, Y, bc_type="natural")
    for x in [*np.linspace(0.2, 1.999, 41), *X[:-1]]:
        expected = [float(curve(x, order)) for order in range(4)]
        assert values(evaluator, x) == pytest.approx(expected, abs=1e-11)
    assert [values(evaluator, x)[0] for x in X] == pytest.approx(Y, abs=1e-14)


def test_a_spline_goes_on_straight():
    """Beyond its ends f goes on with the slope there; f, f', f'' are continuous at all points."""
    evaluator, curve = driven("spline", x=X, y=Y), CubicSpline(X, Y, bc_type="natural")
    for end, reach in ((0, (0.15, 0.0, -3.0)), (-1, (2.05, 9.0))):
        for x in reach:
            slope = float(curve(X[end], 1))
            expected = [Y[end] + slope * (x - X[end]), slope, 0.0, 0.0]
            assert values(evaluator, x) == pytest.approx(expected, abs=1e-11)
    for x in X:
        before, after = values(evaluator, x - 1e-9), values(evaluator, x + 1e-9)
        # third derivatives of some 600 change f'' by 1.3e-6 over 2e-9
        assert before[:3] == pytest.approx(after[:3], abs=2e-6)


def test_a_spline_through_two_points_is_a_line():
    """The least a spline takes."""
    evaluator = driven("spline", x=[1.0, 3.0], y=[2.0, -2.0])
    for x in (-1.0, 1.0, 2.5, 3.0, 8.0):
        assert values(evaluator, x) == pytest.approx([4.0 - 2.0 * x, -2.0, 0.0, 0.0], abs=1e-14)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"x": [0.0, 1.0, 2.0], "y": [0.0, 1.0]}, r"curve.*x has 3 numbers and y has 2"),
        ({"x": [0.0], "y": [1.0]}, r"curve.*two points or more; x has 1"),
        ({"x": [0.0, 2.0, 2.0], "y": [0.0] * 3}, r"curve.*x must increase; number 3, 2, .* 2"),
        ({"x": [0.0, 2.0, 1.0], "y": [0.0] * 3}, r"curve.*x must increase; number 3, 1, .* 2"),
    ],
)
def test_a_spline_that_cannot_be(fields, words):
    """Points that make no curve are refused with the function's name and what is wrong."""
    with pytest.raises(dap.SceneError, match=words):
        driven("spline", **fields)


def test_a_step_is_the_cubic():
    """3 u^2 - 2 u^3 between, constant before and after, and its derivatives."""
    fields = {"x_start": 0.5, "x_end": 2.5, "f_start": 1.0, "f_end": -3.0}
    evaluator, h, D = driven("step", **fields), -4.0, 2.0
    for x in (0.5, 0.9, 1.5, 2.5):
        u = (x - 0.5) / D
        expected = [1 + h * (3 * u**2 - 2 * u**3), h * 6 * u * (1 - u) / D,
                    h * (6 - 12 * u) / D**2, -12 * h / D**3]  # fmt: skip
        assert values(evaluator, x) == pytest.approx(expected, abs=1e-14)
    assert values(evaluator, 0.4) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0.0)
    assert values(evaluator, 2.6) == pytest.approx([-3.0, 0.0, 0.0, 0.0], abs=1e-15)
    with pytest.raises(ValueError, match="x_end = 0 must lie beyond x_start = 1"):
        Step(x_start=1.0, x_end=0.0, f_start=0.0, f_end=1.0).prepare({})


def test_a_hump_that_leaves_its_range_says_so():
    """u_m = 0.4 undershoots by 1.9 %, 0.3 by 130 %; between 0.43 and 0.57 nothing is said.
    The example of the manual dips to 0.78856 on its way from 1 to 0.8, which is within its
    range."""

    def said(**fields):
        import warnings

        with warnings.catch_warnings(record=True) as record:
            warnings.simplefilter("always")
            SmoothHump(**({"x_start": 0.0, "x_end": 1.0, "f_start": 0.0} | fields)).prepare({})
        return [str(w.message) for w in record]

    for middle in (0.44, 0.5, 0.56):
        assert said(f_end=0.0, x_max=middle, f_max=2.0) == []
    assert said(x_end=0.8, f_end=0.8, x_max=0.4, f_max=1.0) == []
    for middle, depth in ((0.4, 0.019), (0.6, 0.019), (0.3, 1.30), (0.7, 1.30)):
        for top in (2.0, -2.0):
            (words,) = said(f_end=0.0, x_max=middle, f_max=top)
            reached = float(words.split()[1])
            assert -reached / top == pytest.approx(depth, rel=0.03)  # spec: to two digits
    # and it stands among the notes of a model
    fields = {"x_start": 0.0, "x_end": 1.0, "f_end": 0.0, "x_max": 0.3, "f_max": 2.0}
    (note,) = driven("c", **fields).model.notes
    assert note.startswith("function curve (c): reaches -2.6")


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
