"""Checks of contacts find mistakes that are planted in a good type."""

import pytest

from dap3d_core.interface import Contact, Point, Vector, number, point, vector
from dap3d_core.kernels import add, cross, dot, scale, sub
from dap3d_core.testing import checks_for


class Floor(Contact):
    """A ball on a plane of body j."""

    keyword = "test-floor-contact"
    P_i: Point = point()
    P_j: Point = point("ground.O")
    a_j: Vector = vector("ground.z")
    radius: float = number(0.1, unit="m", positive=True)

    def gap(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def at(r_P_i, a_j, radius):
        return sub(r_P_i, scale(radius, a_j))

    def normal(a_j):
        return a_j


def twice(r_P_i, r_P_j, a_j, radius):
    """A gap twice as wide."""
    return 2.0 * Floor.gap(r_P_i, r_P_j, a_j, radius)


def double(a_j):
    """A normal twice as long."""
    return scale(2.0, a_j)


def back(a_j):
    """A normal to the wrong side."""
    return scale(-1.0, a_j)


def beside(r_P_i, a_j, radius):
    """A point beside the line of the gap."""
    return add(r_P_i, scale(radius, cross(a_j, (0.6, 0.0, 0.8))))


@pytest.mark.parametrize(
    ("planted", "found"),
    [
        ({}, set()),
        ({"gap": twice}, {"J", "gamma"}),
        ({"gap": twice, "normal": double}, {"normal"}),
        ({"normal": back}, {"J", "gamma"}),
        ({"at": beside}, {"J", "gamma"}),
    ],
    ids=["none", "gap", "length", "side", "point"],
)
def test_a_planted_mistake_is_found(planted, found):
    wrong = type("Wrong", (Floor,), {"keyword": "test-wrong-contact", **planted})
    names = {"J", "gamma", "normal"}
    outcomes = {c.name: str(c.run()) for c in checks_for(wrong) if c.name in names}
    assert {name for name, words in outcomes.items() if "failed" in words} == found
