"""The ledger tells right runs from wrong ones: energy, momentum, constraints, quaternions."""

import numpy as np
import pytest
from support.internals import join, split
from support.results import (
    CONTROLLED,
    about_z,
    circling,
    circling_scene,
    drifting,
    model_of,
    result_of,
    rows_of,
)

import dap3d_core as dap


def test_kinetic_energy_of_bodies_that_slide_and_spin():
    result = drifting()
    # a: 2 |(0.5, -0.2, 0.1)|^2 / 2 + 3 0.8^2 / 2; b: 5 |(-1, 0.3, 0.7)|^2 / 2 + 0.3 1.3^2 / 2
    expected = 0.30 + 0.96 + 3.95 + 0.2535
    np.testing.assert_allclose(result.energy.kinetic, expected, rtol=1e-14)
    np.testing.assert_array_equal(result.energy.total, result.energy.kinetic)


def test_a_right_motion_has_a_clean_ledger():
    result, _, _ = circling()
    assert list(result.ledger) == [
        "energy", "total energy", "position", "velocity", "acceleration", "quaternion"
    ]  # fmt: skip
    for name, entry in result.ledger.items():
        assert entry.ok is True, (name, entry)
    # 1e3 rtol of the energy, and of what atol / rtol = 0.01 m/s and rad/s are to m v and J w:
    # T = 3 1^2 / 2 + 0.4 2.5^2 / 2 J. Rounding of the work of its reaction adds 1e-10 of it, 6e-5.
    assert result.ledger["energy"].limit == pytest.approx(1e-5 * (1 + 0.04 / 2.75), rel=1e-4)


@pytest.mark.parametrize(
    ("row", "column", "factor", "name", "value", "rel"),
    [
        # a speed wrong by 1e-4 at one instant: twice that in the energy, of which limit is 1e-5
        (13, slice(7, None), 1.0 + 1e-4, "energy", 2e-4, 0.02),
        (3, 7, np.nan, "energy", np.nan, None),
        (3, slice(3, 7), 1.0 + 1e-9, "quaternion", 1e-9, 1e-6),  # not of unit length
    ],
)
def test_what_no_motion_has_is_found(row, column, factor, name, value, rel):
    result, _, _ = circling()
    wrong = np.array(result.u)
    wrong[row, column] *= factor
    rows = rows_of(result.model, result.t, wrong, result.v_dot, result.Lam)
    entry = result_of(circling_scene(), rows, result.model).ledger[name]
    assert entry.ok is False
    assert entry.value == pytest.approx(value, rel=rel, nan_ok=True)
    if factor == 1.0 + 1e-4:
        assert f"t = {result.t[row]:g} s" in entry.text


def test_work_balances_kinetic_energy():
    """A body that falls: work m g h from the start, lost potential energy the same."""
    scene = dap.Scene(name="falling")
    scene.add_body("stone", mass=2.0, Jp=[1.0, 1.0, 1.0], r=[0, 0, 10])
    scene.add_force("weight", "g", gravity=9.81, wgt=[0, 0, -1])
    model = model_of(scene)
    t = np.linspace(0.0, 1.0, 6)
    fall = 9.81 * t**2 / 2
    r = np.stack([0 * t, 0 * t, 10 - fall], axis=1)[:, None]
    v = np.stack([0 * t, 0 * t, -9.81 * t], axis=1)[:, None]
    u = join(r, about_z(0 * t), v, 0 * v)
    v_dot = np.tile([0, 0, -9.81, 0, 0, 0], (6, 1))
    rows = rows_of(model, t, u, v_dot, np.zeros((6, 0)), 2 * 9.81 * fall, 2 * 9.81 * (10 - fall))
    result = result_of(scene, rows, model, "unconstrained")
    assert result.ledger["energy"].value < 1e-15
    assert result.ledger["total energy"].value < 1e-14
    assert "momentum" not in result.ledger  # weight acts from outside
    np.testing.assert_allclose(result.energy.total, 2 * 9.81 * 10, rtol=1e-14)
    np.testing.assert_array_equal(result.work, 2 * 9.81 * fall)
    rows = rows_of(model, t, u, v_dot, np.zeros((6, 0)), 0 * fall, 2 * 9.81 * (10 - fall))
    wrong = result_of(scene, rows, model, "unconstrained").ledger
    assert not wrong["energy"].ok
    assert "total energy" not in wrong  # something else than the potential did work


def test_total_energy_is_asked_for_where_potentials_alone_can_do_work():
    """Of a scene with dampers or drivers it is no error that its total energy changes."""
    result, _, _ = circling(settings=CONTROLLED | {"conservative": False})
    assert "total energy" not in result.ledger
    assert "energy" in result.ledger


def test_rounding_of_a_system_at_rest_is_no_imbalance():
    """Speeds of 1e-17, work of 1e-16 J against a potential of some J: rounding, not an error."""
    scene = circling_scene()
    scene.add_force("weight", "g")
    model = model_of(scene)
    u = np.tile(model.u0, (5, 1))
    u[:, 7:] = 1e-17
    noise = np.array([0, 1, -2, 3, 1]) * 1e-16
    rows = rows_of(model, np.arange(5.0), u, np.zeros((5, 6)), np.zeros((5, 3)), noise, -11.7)
    entry = result_of(scene, rows, model).ledger["energy"]
    assert entry.ok is True, entry


def test_energy_is_compared_with_the_work_of_each_kind_of_force():
    """A weight gives 2 J, which friction takes away but for 1e-6 J that is missing: 5e-7 of 2 J,
    whatever the zero of the potential."""
    result, _, _ = circling()
    model = result.model
    work, potential = np.linspace(0.0, 1e-6, len(result.t)), np.linspace(7.0, 5.0, len(result.t))
    still = np.tile(model.u0, (len(result.t), 1))
    still[:, 7:] = 0.0
    rows = rows_of(
        model, result.t, still, np.zeros_like(result.v_dot), 0.0 * result.Lam, work, potential
    )
    entry = result_of(circling_scene(), rows, model).ledger["energy"]
    assert entry.value == pytest.approx(5e-7)


def test_rounding_of_the_rates_widens_the_limit_of_the_energy():
    """Rates known to b = 1e-3 m/s^2 leave velocities known to b T, energies to m v b T."""
    entries = []
    for more in ({}, {"rate_noise": {"v": 1e-3, "w": 0.0}}):
        result, _, _ = circling(settings=CONTROLLED | more)
        entries.append(result.ledger["energy"])
    speed = np.max(np.linalg.norm(result.rd, axis=2) @ result.summary.mass)
    scale = np.max(result.energy.kinetic)
    span = result.t[-1] - result.t[0]
    wider = entries[1].limit - entries[0].limit
    assert wider == pytest.approx(1e-3 * speed * span / scale, rel=0.02)  # slow: atol / rtol


def test_momentum_is_in_the_ledger_where_nothing_acts_from_outside():
    """Free bodies, bodies joined to one another; not with ground in a joint."""
    for result in (drifting(), drifting(joint=True)):
        entry = result.ledger["momentum"]
        assert entry.ok is True
        assert entry.value < 1e-14
    assert "momentum" not in circling()[0].ledger


@pytest.mark.parametrize("column", ["linear", "angular"])
def test_momentum_that_is_not_conserved_is_found(column):
    result = drifting()
    wrong = np.array(result.u)
    _, _, rd, w = split(wrong)
    if column == "linear":
        rd[4:, 0, 1] += 1e-3
    else:
        w[4:, 0, 2] += 1e-3
    rows = rows_of(result.model, result.t, wrong, result.v_dot, result.Lam)
    entry = result_of(dap.Scene(), rows, result.model, "unconstrained").ledger["momentum"]
    assert entry.ok is False
    assert 1e-5 < entry.value < 1e-2


def test_residuals_of_the_three_levels_are_judged():
    result, _, _ = circling()
    for place, name in enumerate(("position", "velocity", "acceleration")):
        residuals = [1e-14, 1e-14, 1e-14]
        residuals[place] = 1e-4
        rows = rows_of(
            result.model, result.t, result.u, result.v_dot, result.Lam, residuals=residuals
        )
        ledger = result_of(circling_scene(), rows, result.model).ledger
        assert ledger[name].value == 1e-4
        judged = {n: ledger[n].ok for n in ("position", "velocity", "acceleration")}
        assert judged == {n: n != name for n in judged}


def test_without_projection_limits_follow_the_tolerance():
    strict, _, _ = circling()
    loose, _, _ = circling(settings=CONTROLLED | {"project": False})
    looser, _, _ = circling(settings=CONTROLLED | {"project": False, "rtol": 1e-6})
    for name in ("position", "velocity", "quaternion"):
        limits = [r.ledger[name].limit for r in (strict, loose, looser)]
        assert limits == sorted(limits)
        assert limits[2] / limits[1] == pytest.approx(100, rel=0.05)
    assert strict.ledger["acceleration"].limit == loose.ledger["acceleration"].limit


@pytest.mark.parametrize(("integrator", "step"), [("rk4", 0.01), ("rk4", None), ("dop853", 0.01)])
def test_fixed_steps_are_held_to_a_thousandth(integrator, step):
    """They have no tolerance: what is conserved, and a state without projection, is so to 1e-3."""
    settings = CONTROLLED | {"step": step, "project": False}
    result, _, _ = circling(integrator=integrator, settings=settings)
    for name in ("energy", "position", "velocity", "quaternion"):
        assert 1e-3 <= result.ledger[name].limit < 1e-2  # of the size of what it belongs to
        assert result.ledger[name].ok is True
        assert result.ledger[name].value < 1e-14
    projected, _, _ = circling(integrator=integrator, settings=settings | {"project": True})
    assert projected.ledger["position"].ok is True


def test_a_run_without_instants_has_an_empty_ledger():
    model = model_of(circling_scene())
    result = result_of(circling_scene(), np.zeros((0, 28)), model, status="stopped")
    assert result.ledger == {}
    assert result.rP.shape == (0, 3, 3)
    assert result.Jac.shape == (0, 3, 6)
    assert result.reaction("J1")["i"].force.shape == (0, 3)
    assert "0 instants" in repr(result)
