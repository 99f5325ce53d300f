"""Types that passed their examination: what is known of them."""

import pytest

from dap3d_core.interface import Body, Force, Joint, Point, bodies, body, examine, point
from dap3d_core.kernels import dot, rotate, scale, sub
from dap3d_core.registry import load_registry

Y, ZERO = (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)


class Groove(Joint):
    keyword, rows = "groove", 1
    P_i: Point = point()
    body_j: Body = body()

    def C(r_P_i, r_j, A_j):
        return dot(rotate(A_j, Y), sub(r_P_i, r_j))


class Declared(Groove):
    keyword, body_axes = "declared", ()


class Rows(Force):
    keyword = "rows"
    wheels: tuple = bodies("n", least=2)

    def wrench(A_wheels, n):
        return tuple((scale(0.0, rotate(A_wheels[k], Y)), ZERO) for k in range(n))


@pytest.mark.parametrize(
    ("type_", "slots"), [(Groove, ("j",)), (Declared, ()), (Rows, ("wheels",))]
)
def test_axes_are_those_that_kernels_name_or_as_declared(type_, slots):
    assert examine(type_).axis_slots == slots


def test_a_contact_uses_the_axes_that_its_gap_names():
    assert load_registry().get("contact", "ball_box").axis_slots == ("j",)
