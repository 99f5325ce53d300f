"""Limits of parameters: those of the checks of a scene."""

from itertools import permutations

import numpy as np
import pytest
from tests.unit.native.test_export import (
    SPRING,
    _written,
    braced,
    declared_ball,
    falling_ball,
    two_floors,
)

import dap3d_core as dap
from dap3d_core.native.run.limits import LARGEST, Limits, _Trials, limits_of
from dap3d_core.native.run.prepared import PreparedRun
from dap3d_core.study import parameters_named


def found_of(scene, *names):
    prepared = PreparedRun(scene)
    return limits_of(prepared, parameters_named(prepared.compiled.checked, names))


def closed(limits):
    return tuple(at for _, at, _ in limits.ends)


def test_they_are_those_of_fields_and_bodies(tmp_path):
    scene = braced(tmp_path)
    scene.parameters["part"] = 0.2
    scene.forces["brace"].fields["l0"] = "= 1 - part"  # at least 0, by an expression
    scene.parameters["J"] = 1.0
    scene.bodies["cart"].Jp = ("= J", 1.0, 1.0)
    names = ("forces.spring.k", "bodies.cart.r.x", "bodies.cart.mass", "parameters.J",
             "parameters.part")  # fmt: skip
    found = [closed(*found_of(scene, name)) for name in names]
    assert found[:3] == [(None, None), (None, None), (1e-100, None)]
    # principal inertias are positive to 1e-14 of the largest, their sums to 1e-9
    assert found[3] == (pytest.approx(1e-14, rel=1e-6), pytest.approx(2.0 / (1.0 - 1e-9)))
    assert found[4] == (None, 1.0)


def test_open_and_closed_ends_are_said(tmp_path):
    scene = braced(tmp_path)
    scene.add_force("maxwell", "damper", P_i="post", P_j="cart.O", k=30.0, c=2.0)
    (k,) = found_of(scene, "forces.damper.k")
    assert k == Limits(np.nextafter(0.0, 1.0), LARGEST)
    assert closed(k) == (0.0, None)
    assert [said for *_, said in k.ends] == ["should be greater than 0", ""]
    (e,) = found_of(declared_ball(), "contacts.floor.e")
    assert [said for *_, said in e.ends] == ["should be at least 0", "should be at most 1"]


@pytest.mark.slow
def test_of_two_in_order_one_is_under_the_other(tmp_path):
    """Whatever the other is; limits that are other numbers of the scene take a few checks."""
    names = "materials.surface.mu", "materials.surface.mu_s"
    scene = falling_ball(mu_s=0.45)
    assert [closed(*found_of(scene, n)) for n in names] == [(0.0, 0.45), (0.3, None)]
    for mu, mu_s in (found_of(scene, *names), found_of(scene, *names[::-1])[::-1]):
        assert closed(mu) == closed(mu_s) == (0.0, None)
        assert mu.words == ["should be at least 0", "should be at most materials.surface.mu_s"]
        assert mu_s.words == ["should be at least 0"]
    scene = _written(SPRING, tmp_path)  # beyond it, not at it
    scene.add_function("b", "push", x_start=0.1, x_end=0.5, f_end=1.0)
    scene.add_force("f", "kick", body_i="cart", f=(1.0, 0.0, 0.0), function="push")
    found = found_of(scene, "functions.push.x_end", "functions.push.x_start")
    assert [limits.under for limits in found] == [(), (("functions.push.x_end", True),)]
    assert found[1].words == ["should be less than functions.push.x_end"]


@pytest.mark.slow
def test_one_that_is_in_two_orders(tmp_path, monkeypatch):
    """Coefficients of two floors above a shared one, in any order of names, and times in a row."""
    scene, accept, known = two_floors(), _Trials.accept, {}

    def accept_once(trials, values):
        """In all orders much the same values are tried."""
        key = frozenset((one.name, x) for one, x in values)
        if key not in known:
            known[key] = accept(trials, values)
        return known[key]

    names = ["parameters.mu", "contacts.floor_a.mu_s", "contacts.floor_b.mu_s"]
    monkeypatch.setattr(_Trials, "accept", accept_once)
    for order in permutations(names):
        found = dict(zip(order, found_of(scene, *order), strict=True))
        assert {closed(limits) for limits in found.values()} == {(0.0, None)}
        assert {name for name, is_open in found["parameters.mu"].under if not is_open} == {
            *names[1:]
        }
    assert closed(*found_of(scene, "parameters.mu")) == (0.0, 0.3)
    monkeypatch.undo()
    scene = _written(SPRING, tmp_path)
    scene.parameters["middle"] = 0.5
    scene.add_function("b", "rise", x_start=0.1, x_end="= middle", f_end=1.0)
    scene.add_function("b", "fall", x_start="= middle", x_end=0.9, f_end=-1.0)
    for name in ("rise", "fall"):
        scene.add_force("f", f"kick_{name}", body_i="cart", f=(1.0, 0.0, 0.0), function=name)
    names = "functions.fall.x_end", "parameters.middle", "functions.rise.x_start"
    found = found_of(scene, *names)
    assert [limits.under for limits in found] == [(), ((names[0], True),), ((names[1], True),)]
    assert {closed(limits) for limits in found} == {(None, None)}
    assert closed(*found_of(scene, names[1])) == (0.1, 0.9)


@pytest.mark.slow
def test_other_dependence_is_refused_and_inertias_wait(tmp_path):
    scene = braced(tmp_path)
    scene.parameters |= {"one": 0.2, "more": 0.3}
    scene.forces["brace"].fields["l0"] = "= 1 - one - more"
    with pytest.raises(dap.SceneError, match=r"parameters\.one may be depends on parameters\.more"):
        found_of(scene, "parameters.one", "parameters.more")
    names = "bodies.cart.Jp.x", "bodies.cart.mass"
    *inertias, mass = found_of(_written(SPRING, tmp_path), *names)
    assert inertias == [Limits()]
    assert mass.low == 1e-100
