"""Combinations of functions against the derivatives of the whole expression."""

import numpy as np
import pytest
import sympy

import dap3d_core as dap

X = sympy.Symbol("x")
SWING = 0.3 + 2 * sympy.sin(3 * X + sympy.Rational(1, 4))
RAMP = 1 + 2 * X + X**2 / 2
FAST = sympy.sin(7 * X) / 2


def scene_with(*combinations):
    """A body pushed by the last of some combinations: (type, name, terms)."""
    scene = dap.Scene(name="combined")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("harmonic", "swing", frequency=3.0, amplitude=2.0, phase=0.25, offset=0.3)
    scene.add_function("a", "ramp", coeff=(1.0, 2.0, 0.5))
    scene.add_function("harmonic", "fast", frequency=7.0, amplitude=0.5)
    scene.add_function("spline", "curve", x=[-1.0, 0.0, 1.0, 2.0], y=[0.0, 1.0, 0.0, 0.5])
    for type_, name, terms in combinations:
        scene.add_function(type_, name, functions=terms)
    return scene


@pytest.mark.parametrize(
    ("combinations", "expression"),
    [
        ([("sum", "s", ["swing", "ramp", "fast"])], SWING + RAMP + FAST),
        ([("product", "p", ["swing", "ramp", "fast"])], SWING * RAMP * FAST),
        (
            [("product", "p", ["swing", "s"]), ("sum", "s", ["ramp", "fast", "ramp"])],
            SWING * (2 * RAMP + FAST),
        ),
        ([("sum", "one", ["fast"])], FAST),
    ],
)
def test_values_and_derivatives_are_those_of_the_whole_expression(combinations, expression):
    """f to f''' of sums, products and both, against sympy; only rounding is left."""
    scene = scene_with(*combinations)
    name = combinations[0][1]
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), function=name)
    compiled = dap.compile(scene)
    row = compiled.model.function_names.index(name)
    for x in (-0.7, 0.0, 0.4, 1.9):
        values = compiled.evaluator.function_values(x)[row]
        wanted = [float(sympy.diff(expression, X, k).subs(X, x)) for k in range(4)]
        assert values == pytest.approx(wanted, rel=1e-13, abs=1e-13)


def test_a_combination_of_an_argument_takes_tables_too():
    """A spring curve that is a product of a spline and a polynomial, each with its own numbers."""
    from scipy.interpolate import CubicSpline

    scene = scene_with(("product", "stiff", ["curve", "ramp"]))
    scene.bodies["block"].r = (2.3, 0.0, 0.0)
    scene.add_force("ptp", "spring", P_i="block.O", P_j="ground.O", l0=2.0, function="stiff")
    scene.add_force("ptp", "other", P_i="block.O", P_j="ground.O", l0=1.5, function="ramp")
    result = dap.simulate(scene, t_end=0.0)
    curve = CubicSpline([-1.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 0.5], bc_type="natural")
    ramp = lambda x: 1.0 + 2.0 * x + 0.5 * x * x  # noqa: E731
    assert result.force("spring").tension[0] == pytest.approx(curve(0.3) * ramp(0.3), rel=1e-14)
    assert result.force("other").tension[0] == pytest.approx(ramp(0.8), rel=1e-14)


def test_steps_end_where_a_term_changes_its_form():
    """The breaks of a combination are those of all its terms, once each in the run."""
    scene = scene_with(("sum", "inner", ["late", "swing"]), ("product", "all", ["early", "inner"]))
    scene.add_function("step", "early", x_start=0.2, x_end=0.3)
    scene.add_function("step", "late", x_start=0.25, x_end=0.75)
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), function="all")
    stops = dap.compile(scene).breakpoints(1.0).stops
    assert [t for t, jumps in stops if jumps] == [0.2, 0.25, 0.3, 0.75]


def test_combinations_of_other_types_are_other_code():
    """Two sums of different types of functions, and two of equal types, in one scene."""
    names = ("swing", "fast"), ("ramp", "swing"), ("fast", "fast")
    scene = scene_with(*[("sum", f"s{k}", list(terms)) for k, terms in enumerate(names)])
    for k in range(3):
        scene.add_force("f", f"push{k}", body_i="block", f=(1.0, 0.0, 0.0), function=f"s{k}")
    compiled = dap.compile(scene)
    assert sorted(group.count for group in compiled.model.functions) == [1, 2]
    values = compiled.evaluator.function_values(0.6)[-3:, 0]
    each = {"swing": SWING, "ramp": RAMP, "fast": FAST}
    wanted = [float(sum(each[n] for n in terms).subs(X, 0.6)) for terms in names]
    assert np.max(np.abs(values - wanted)) < 1e-14
