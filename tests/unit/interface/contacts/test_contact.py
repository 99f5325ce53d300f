"""Contact types: what is derived from gap, point and normal, checked as check-plugin does."""

import math
import re

import pytest

import dap3d_core as dap
from dap3d_contacts.box_box import BoxBox, part_of
from dap3d_core.interface import Contact, PluginError, Point, examine, number, point
from dap3d_core.interface.contacts.rates import rate_of
from dap3d_core.kernels import (
    acos,
    asin,
    atan,
    atan2,
    cos,
    exp,
    log,
    root,
    scale,
    sin,
    sqrt,
    tan,
    where,
)
from dap3d_core.testing import checks_for


class Pipe(Contact):
    keyword = "pipe"
    P_i: Point = point()
    bore: float = number(positive=True)

    def gap(r_P_i, bore):
        return bore - sqrt(r_P_i[1] * r_P_i[1] + r_P_i[2] * r_P_i[2])

    def at(r_P_i, bore):
        size = sqrt(r_P_i[1] * r_P_i[1] + r_P_i[2] * r_P_i[2])
        return (r_P_i[0], bore / size * r_P_i[1], bore / size * r_P_i[2])

    def normal(r_P_i):
        size = sqrt(r_P_i[1] * r_P_i[1] + r_P_i[2] * r_P_i[2])
        return scale(-1.0 / size, (0.0, r_P_i[1], r_P_i[2]))


@pytest.mark.slow
def test_a_type_of_ones_own_on_one_body():
    failed = [str(outcome) for check in checks_for(Pipe) if not (outcome := check.run()).ok]
    assert not failed


def test_a_velocity_in_a_gap_is_refused():
    class Fast(Pipe):
        keyword = "fast"

        def gap(v_P_i):
            return v_P_i[0]

    with pytest.raises(PluginError, match=r"Fast\.gap asks for v_P_i, a quantity of the velocity"):
        examine(Fast)


@pytest.mark.parametrize(
    ("surfaces", "said"),
    [
        ({"i": "blob"}, "'blob'}: bodies are i, surfaces sphere, shell"),
        ({"j": "sphere"}, "{'j': 'sphere'}: bodies are i,"),
        ({"i": "sphere"}, "is drawn from radius, which the type does not have"),
    ],
)
def test_surfaces_that_cannot_be_drawn_are_refused(surfaces, said):
    class Drawn(Pipe):
        keyword = "drawn"

    Drawn.surfaces = surfaces
    with pytest.raises(PluginError, match=re.escape(said)):
        examine(Drawn)


@pytest.mark.parametrize(
    ("function", "slope"),
    [
        (sqrt, lambda x: 0.5 / math.sqrt(x)),
        (sin, math.cos),
        (cos, lambda x: -math.sin(x)),
        (tan, lambda x: 1.0 / math.cos(x) ** 2),
        (atan, lambda x: 1.0 / (1.0 + x * x)),
        (asin, lambda x: 1.0 / math.sqrt(1.0 - x * x)),
        (acos, lambda x: -1.0 / math.sqrt(1.0 - x * x)),
        (exp, math.exp),
        (log, lambda x: 1.0 / x),
        (lambda x: x**3, lambda x: 3.0 * x * x),
        (lambda x: 2.0 - 1.0 / (1.0 + x), lambda x: 1.0 / (1.0 + x) ** 2),
        (lambda x: where(x > 0.2, x * x, -x), lambda x: 2.0 * x),
    ],
)
def test_rates_of_functions(function, slope):
    x, rate = 0.3, 2.0
    assert rate_of(function, (x,), (rate,)) == pytest.approx(rate * slope(x), rel=1e-14)
    assert rate_of(function, (x,), (None,)) == 0.0


def test_rates_of_an_angle_and_of_functions_of_the_scene():
    x, y, x_dot, y_dot = 0.3, -0.7, 2.0, 0.5
    rate = (x * y_dot - y * x_dot) / (x * x + y * y)
    assert rate_of(atan2, (y, x), (y_dot, x_dot)) == pytest.approx(rate, rel=1e-14)
    values = (lambda a, b: a * a * b), x, y
    slopes = (lambda a, b: 2.0 * a * b), (lambda a, b: a * a)
    rates = slopes, x_dot, y_dot
    found = rate_of(lambda f, a, b: f(a, b), values, rates)
    assert found == pytest.approx(2.0 * x * y * x_dot + x * x * y_dot, rel=1e-14)


def test_rates_of_what_is_sought_follow_from_its_equation():
    """s^3 + s = x: s_dot = x_dot / (3 s^2 + 1)."""

    def sought(x):
        return root((x,), lambda s: (s**3 + s - x,), lambda s: ((3.0 * s * s + 1.0,),))[0]

    (s,), (s_dot,) = sought(0.9), rate_of(sought, (0.9,), (2.0,))
    assert s**3 + s == pytest.approx(0.9, rel=1e-15)
    assert s_dot == pytest.approx(2.0 / (3.0 * s * s + 1.0), rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    "part", [16, *(pytest.param(k, marks=pytest.mark.long) for k in (8, 21, 51))]
)
def test_corners_and_edges_of_boxes_are_exact_derivatives(part):
    class Part(BoxBox):
        keyword = "part_of_boxes"

        def prepare(self, bodies):
            return {**super().prepare(bodies), **part_of(part, self.size_i, self.size_j)}

    failed = [str(outcome) for check in checks_for(Part) if not (outcome := check.run()).ok]
    assert not failed


TABLE = """
from dap3d_core.interface import Contact, Point, hookimpl, point

interface_version = 1


class Table(Contact):
    keyword = "table"
    P_i: Point = point()

    def gap(r_P_i):
        return r_P_i[2]

    def at(r_P_i):
        return r_P_i

    def normal():
        return (0.0, 0.0, 1.0)

    def reach(r_P_i):
        return 0.5 - r_P_i[0]


@hookimpl
def dap3d_contacts():
    return [Table]
"""


def test_a_contact_opens_where_its_surfaces_end(tmp_path):
    """What slides off a table falls freely from its edge on."""
    (tmp_path / "plugin.py").write_text(TABLE, encoding="utf-8")
    scene = dap.Scene(name="table", path=tmp_path / "scene.toml")
    scene.add_body("ball", mass=1.0, Jp=[1.0, 1.0, 1.0], r_dot=[1.0, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("table", "top", P_i="ball.O")
    result = dap.simulate(scene, t_end=1.0, dt=0.25, allow_code=True, rtol=1e-12, atol=1e-14)
    lift = next(e for e in result.events if e.kind == "lift")
    assert lift.t == pytest.approx(0.5, abs=1e-9)
    assert result.r[-1, 0, 2] == pytest.approx(-0.5 * 9.81 * 0.25, abs=1e-9)
