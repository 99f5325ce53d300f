"""Functions of two arguments: against an independent spline, and in motion against SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import NdBSpline, make_interp_spline
from support.own_types import registry_of
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.interface import REQUIRED, Force, Joint, Point, function, point

X = np.array([-1.0, -0.4, 0.1, 0.9, 1.3, 2.0])
Y = np.array([0.0, 0.3, 1.0, 1.2, 2.1])
Z = np.sin(2.0 * X[:, None]) * np.exp(-0.5 * Y) + 0.3 * X[:, None] * Y
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
NATURAL, PERIODIC = "natural", "periodic"


class Probe(Force):
    """The six numbers of a function of two arguments at (x, y) of P_i, as force and moment."""

    keyword, ground_axes = "probe", True
    P_i: Point = point()
    function: str = function(REQUIRED, argument=("x, m,", "y, m"))

    def wrench(r_P_i, f, f_x, f_y, f_xx, f_xy, f_yy):
        x, y = r_P_i[0], r_P_i[1]
        return ((f(x, y), f_x(x, y), f_y(x, y)), (f_xx(x, y), f_xy(x, y), f_yy(x, y)))


class Terrain(Joint):
    """P_i stays on the surface z = f(x, y) of ground; all but C is derived."""

    keyword, rows, ground_axes = "terrain", 1, True
    P_i: Point = point()
    function: str = function(REQUIRED, argument=("x, m,", "y, m"))

    def C(r_P_i, f):
        return r_P_i[2] - f(r_P_i[0], r_P_i[1])


REGISTRY = registry_of(Probe, Terrain)


def spline(z, ends=(NATURAL, NATURAL)):
    """B-splines in both arguments by collocation: other unknowns, other equations, other code."""
    of_x = make_interp_spline(X, z, k=3, bc_type=ends[0])
    of_y = make_interp_spline(Y, of_x.c.T, k=3, bc_type=ends[1])
    return NdBSpline((of_x.t, of_y.t), np.ascontiguousarray(of_y.c.T), 3)


def probed(**fields):
    """A function of x and y with the six numbers, as the compiled right-hand side has them."""
    scene = dap.Scene(name="probed")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("grid", "surface", **({"x": X, "y": Y} | fields))
    scene.add_force("probe", "force", P_i="a.O", function="surface")
    model = dap.compile(scene, registry=REGISTRY)

    def numbers(x, y):
        u = np.zeros(13)
        u[:4] = x, y, 0.0, 1.0
        return model.rhs(0.0, u)[7:]

    return numbers


def wanted(surface, x, y):
    return [float(surface([x, y], nu=order)) for order in ORDERS]


@pytest.mark.slow
def test_a_grid_is_the_natural_spline_of_both_arguments():
    """Six numbers, at and between the points: rounding of second derivatives of some 1e2."""
    found, surface = probed(z=Z), spline(Z)
    for x in [*np.linspace(-1.0, 1.999, 13), *X[:-1]]:
        for y in [*np.linspace(0.0, 2.099, 11), *Y[:-1]]:
            assert found(x, y) == pytest.approx(wanted(surface, x, y), rel=1e-12, abs=1e-12)


def test_a_grid_goes_on_straight():
    """Beyond an edge f is the line that touches it; across a corner the product of two lines."""
    found, surface = probed(z=Z), spline(Z)
    for x in (-3.0, 0.5, 4.0):
        for y in (-1.0, 0.7, 5.0):
            at = np.clip(x, X[0], X[-1]), np.clip(y, Y[0], Y[-1])
            dx, dy = x - at[0], y - at[1]
            f = [float(surface(at, nu=o)) for o in ((0, 0), (1, 0), (0, 1), (1, 1))]
            assert found(x, y)[0] == pytest.approx(f[0] + f[1] * dx + f[2] * dy + f[3] * dx * dy,
                                                   rel=1e-12)  # fmt: skip
            if dx:
                assert found(x, y)[3] == pytest.approx(0.0, abs=1e-13)
            if dy:
                assert found(x, y)[5] == pytest.approx(0.0, abs=1e-13)
    for x, y in ((X[0], 0.7), (X[-1], 0.7), (0.5, Y[0]), (0.5, Y[-1]), (X[2], Y[2])):
        before, after = found(x - 1e-9, y - 1e-9), found(x + 1e-9, y + 1e-9)
        # third derivatives of some 30 change the second ones by 1e-7 over 2e-9
        assert before == pytest.approx(after, abs=1e-6)


@pytest.mark.parametrize("along", ["x", "y", "xy"])
def test_a_periodic_grid_repeats_itself(along):
    """In each period the periodic spline; its argument has lost 1e-14 on the way back."""
    z = Z.copy()
    z[-1] = z[0] if "x" in along else z[-1]
    z[:, -1] = z[:, 0] if "y" in along else z[:, -1]
    ends = tuple(PERIODIC if name in along else NATURAL for name in "xy")
    surface = spline(z, ends)
    found = probed(z=z, periodic_x="x" in along, periodic_y="y" in along)
    for x in np.linspace(-0.9, 1.9, 7):
        for y in np.linspace(0.1, 2.0, 6):
            place = (x - 6.0 if "x" in along else x, y + 4.2 if "y" in along else y)
            assert found(*place) == pytest.approx(wanted(surface, x, y), rel=1e-11, abs=1e-11)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"z": Z[:-1]}, "z has 5 rows of 5 numbers; give 6 rows, one for each x, of 5 numbers"),
        ({"z": Z.T}, "z has 5 rows of 6 numbers; give 6 rows"),
        ({"z": [1.0, 2.0]}, "should be a list of rows of numbers; row 1 should be a list of"),
        ({"z": [[1.0, 2.0], [1.0]]}, "rows of numbers of one length; row 2 has 1, row 1 2"),
        ({"x": X[::-1], "z": Z}, "x must increase; number 2, 1.3, is not beyond the one before"),
        ({"y": [1.0], "z": Z[:, :1]}, "a grid takes two points or more; y has 1"),
        ({"z": Z, "periodic_x": True}, "the last row of z is not its first one; with periodic_x"),
        ({"z": Z, "periodic_y": True}, "the last column of z is not its first one; with periodic"),
    ],
)
def test_a_grid_that_cannot_be(fields, words):
    """Points that make no surface are refused with the function's name and what is wrong."""
    with pytest.raises(dap.SceneError, match=rf"functions?.surface.*{words}"):
        probed(**fields)


@pytest.mark.slow
def test_a_ball_on_measured_terrain():
    """Minimal coordinates x, y by SciPy, whose Lagrangian has the height and its derivatives.
    m (1 + h_x^2) x'' + m h_x h_y y'' + m h_x (h_xx x'^2 + 2 h_xy x' y' + h_yy y'^2) + m g h_x = 0.
    J and gamma are derived from C alone, with f_x to f_yy in their places. To the runs' own
    tolerance, 1e-12 a step and some 1e3 steps."""
    surface, g = spline(Z), 9.81

    def rhs(_t, q):
        x, y, vx, vy = q
        _, hx, hy, hxx, hxy, hyy = wanted(surface, x, y)
        curved = hxx * vx * vx + 2.0 * hxy * vx * vy + hyy * vy * vy + g
        M = np.array([[1.0 + hx * hx, hx * hy], [hx * hy, 1.0 + hy * hy]])
        return [vx, vy, *np.linalg.solve(M, [-hx * curved, -hy * curved])]

    start, speed = (0.3, 0.8), (0.2, -0.1)
    h = wanted(surface, *start)
    scene = dap.Scene(name="terrain")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(*start, h[0]),
                   r_dot=(*speed, h[1] * speed[0] + h[2] * speed[1]))  # fmt: skip
    scene.add_function("grid", "height", x=X, y=Y, z=Z)
    scene.add_joint("terrain", "ground_contact", P_i="ball.O", function="height")
    scene.add_force("weight", "g")
    settings = {"t_end": 0.5, "dt": 0.05, "rtol": 1e-12, "atol": 1e-13}
    wanted_path = solve_ivp(rhs, (0.0, 0.5), [*start, *speed], "DOP853", rtol=1e-12, atol=1e-13,
                            t_eval=np.arange(11) * 0.05).y  # fmt: skip
    model = dap.compile(scene, registry=REGISTRY)
    for integrator in ("dop853", "radau"):
        result = dap.simulate(model, integrator=integrator, **settings)
        np.testing.assert_allclose(result.r[:, 0, :2], wanted_path[:2].T, atol=1e-9)
        np.testing.assert_allclose(result.rd[:, 0, :2], wanted_path[2:].T, atol=1e-8)


def test_points_of_a_sweep_read_the_map():
    """The engine of the example package at three throttles u: w = 200 (1 - exp(-u t))."""
    throttles = [0.25, 0.5, 1.0]
    scene = dap.load(REPOSITORY / "plugins" / "dap3d-example" / "scenes" / "engine.toml")
    data = dap.sweep(scene, {"inputs.throttle.value": throttles}, outputs=["wheel.w.z"], t_end=1.0,
                     dt=0.5, rtol=1e-10, atol=1e-12)  # fmt: skip
    wanted = 200.0 * (1.0 - np.exp(-np.array(throttles)))
    np.testing.assert_allclose(np.ravel(data["wheel.w.z"]), wanted, atol=1e-7)
