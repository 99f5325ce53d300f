"""An error planted in a function of two arguments, or where one is called, is found and named."""

import re

import pytest

from dap3d_core.interface import REQUIRED, Force, Joint, Point, function, point
from dap3d_core.kernels import cross, where
from dap3d_core.testing import checks_for
from dap3d_functions.grid import Grid, surface

ZERO = (0.0, 0.0, 0.0)


class FirstOfOtherArgument(Grid):
    def value(x, y, rows, columns, cells):
        f, f_x, f_y, f_xx, f_xy, f_yy = surface(x, y, rows, columns, cells)
        return f, f_y, f_x, f_xx, f_xy, f_yy


class NoMixed(Grid):
    def value(x, y, rows, columns, cells):
        f, f_x, f_y, f_xx, _, f_yy = surface(x, y, rows, columns, cells)
        return f, f_x, f_y, f_xx, 0.0, f_yy


class SecondInWrongOrder(Grid):
    def value(x, y, rows, columns, cells):
        f, f_x, f_y, f_xx, f_xy, f_yy = surface(x, y, rows, columns, cells)
        return f, f_x, f_y, f_xx, f_yy, f_xy


class OfScaledArgument(Grid):
    def value(x, y, rows, columns, cells):
        return surface(x, 2.0 * y, rows, columns, cells)


class Branching(Grid):
    def value(x, y, rows, columns, cells):
        if x > 0.5:
            return surface(x, y, rows, columns, cells)
        return ZERO + ZERO


class OnSurface(Joint):
    """P_i stays on a surface of ground; J by hand."""

    keyword, rows, ground_axes = "on-surface", 1, True
    P_i: Point = point()
    function: str = function(REQUIRED, argument=("x, m,", "y, m"))

    def C(r_P_i, f):
        return r_P_i[2] - f(r_P_i[0], r_P_i[1])


class SlopesExchanged(OnSurface):
    def J(r_P_i, s_P_i, f_x, f_y):
        x, y = r_P_i[0], r_P_i[1]
        n = (-f_y(x, y), -f_x(x, y), 1.0)
        return ((*n, *cross(s_P_i, n)),)


class NoTwist(OnSurface):
    def gamma(r_P_i, v_P_i, w_i, s_P_i_dot, f_x, f_y, f_xx, f_yy):
        x, y, a = r_P_i[0], r_P_i[1], cross(w_i, s_P_i_dot)
        curved = f_xx(x, y) * v_P_i[0] ** 2 + f_yy(x, y) * v_P_i[1] ** 2
        return curved + f_x(x, y) * a[0] + f_y(x, y) * a[1] - a[2]


class Spring(Force):
    """A force by its potential f(x, y), and a wrench that forgets y."""

    keyword, ground_axes = "hollow", True
    P_i: Point = point()
    function: str = function(REQUIRED, argument=("x, m,", "y, m"))

    def energy(r_P_i, f):
        return f(r_P_i[0], r_P_i[1])

    def wrench(r_P_i, s_P_i, f_x):
        F = -f_x(r_P_i[0], r_P_i[1])
        return ((F, 0.0, 0.0), (0.0, s_P_i[2] * F, -s_P_i[1] * F))


class Clipped(Force):
    """Right: it branches by where, on what a map gives."""

    keyword, ground_axes = "clipped", True
    P_i: Point = point()
    function: str = function(REQUIRED, argument=("x, m,", "y, m"))

    def wrench(r_P_i, f):
        F = f(r_P_i[0], r_P_i[1])
        return ((where(F > 0.0, F, 0.0), 0.0, 0.0), ZERO)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("type_", "failing", "words"),
    [
        (FirstOfOtherArgument, {"derivatives"}, "f_x is wrong by .* the derivative of f by x"),
        (NoMixed, {"derivatives"}, "f_xy is wrong by .* should be .* the derivative of f_. by ."),
        (SecondInWrongOrder, {"derivatives"}, "f_yy is wrong by .* the derivative of f_y by y"),
        (OfScaledArgument, {"derivatives"}, "f_y is wrong by .* the derivative of f by y"),
        (Branching, {"plain"}, "value branches on a number"),
        (SlopesExchanged, {"J", "virtual power"}, "of J is wrong"),
        (NoTwist, {"gamma"}, "row 1 of gamma is wrong"),
        (Spring, {"energy"}, "the force on body i along y and the energy disagree"),
    ],
    ids=lambda v: v.__name__ if isinstance(v, type) else "",
)
def test_a_planted_error_is_found(type_, failing, words):
    """By the check that is about it and no other; compiled numbers are those of plain Python."""
    checks = [c for c in checks_for(type_) if c.name not in ("compiled", "assembly", "rank")]
    outcomes = [check.run() for check in checks]
    said = "\n".join(str(o) for o in outcomes if not o.ok)
    assert {o.check for o in outcomes if not o.ok} == failing, said
    assert re.search(words, said, re.DOTALL), said


@pytest.mark.every(2)
@pytest.mark.parametrize("type_", [OnSurface, Clipped])
def test_what_is_right_passes(type_):
    assert all(check.run().ok for check in checks_for(type_))
