"""Directional derivatives, against differences and closed forms."""

import numpy as np
import pytest
from tests.unit.native.test_export import SPRING, _written, exported, falling_ball

import dap3d_core as dap


@pytest.mark.slow
@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("model", "outputs"),
    [
        ("pen1", ["cone.r", "cone.w"]),
        ("fourbar3", ["coupler.rdd", "energy.total"]),
        ("quarter_car", ["upright.r"]),
    ],
)
def test_rates_and_outputs_along_a_direction_of_states(tmp_path, model, outputs):
    scene = dap.load(model)
    scene.simulation.t_end = 0.5
    joint = next(iter(scene.joints))
    made, library = exported(scene, tmp_path, outputs=[*outputs, f"{joint}.force"])
    run = library.start(0.5)
    run.step_to(0.1)
    states = [n for n, kind in library.kinds.items() if kind == "state"][:-1]
    rates = [n for n, kind in library.kinds.items() if kind == "derivative"]
    rng = np.random.default_rng(1)
    along = dict(zip(states, rng.normal(size=len(states)).tolist(), strict=True))
    found = run.directional([*rates, *made.outputs], along)
    y = run.values([*states, "state.work"])
    h, d = 1e-6, np.array([*along.values(), 0.0])
    ahead, behind = (run.derivatives(0.1, y + s * h * d) for s in (1.0, -1.0))
    expected = (ahead - behind) / (2.0 * h)
    # differences: of order h^2, and rounding over h, of rates of the size of the largest
    size = np.abs(run.derivatives(0.1, y)).max() + np.abs(expected).max()
    np.testing.assert_allclose(found[: len(rates)], expected, rtol=0, atol=1e-7 * size)
    assert np.isfinite(found).all()
    assert np.abs(found[len(rates) :]).max() > 0.0


@pytest.mark.slow
def test_a_cart_on_a_spring_has_the_derivatives_of_its_equation(tmp_path):
    """m r'' = f - k r - c v: all partial derivatives; the reaction of the track along x is none."""
    scene = _written(SPRING, tmp_path)
    made, library = exported(
        scene, tmp_path, outputs=["cart.r.x", "cart.rdd.x", "spring.force", "double"],
        parameters=["forces.spring.k"],
    )  # fmt: skip
    assert "double" in made.outputs
    run = library.start(2.0)
    run.step_to(0.3)
    r = run["state.cart.r.x"]
    rate, acceleration = "der(state.cart.rd.x)", "cart.rdd.x"
    for along, expected in (
        ({"state.cart.r.x": 1.0}, -40.0 / 2.0),
        ({"state.cart.rd.x": 2.0}, -2.0 * 0.3 / 2.0),
        ({"push": 1.0}, 0.5),
        ({"forces.spring.k": 1.0}, -r / 2.0),
    ):
        assert run.directional([rate, acceleration], along) == pytest.approx([expected] * 2)
    assert run.directional(["double"], {"state.cart.r.x": 1.0}) == pytest.approx([2.0])
    with pytest.raises(dap.SimulationError, match="derivative by such"):
        run.directional([rate], {"cart.r.x": 1.0})


@pytest.mark.slow
def test_stepped_contacts_have_derivatives_of_what_the_state_gives(tmp_path):
    """Against differences of outputs; accelerations are means of a step, and have none."""
    scene = falling_ball()
    scene.add_point("anchor", "ground", (0.0, 0.0, 1.0))
    scene.add_vector2("line", "ball.O", "anchor")
    scene.add_force("ptp", "spring", d="line", k=40.0, l0=0.5, c=3.0)
    names = ["ball.r", "ball.w", "spring.force", "energy.total"]
    made, library = exported(scene, tmp_path, outputs=[*names, "ball.rdd"])
    run = library.start(0.5)
    run.step_to(0.1)
    states = [n for n, kind in library.kinds.items() if kind == "state"]
    assert "derivative" not in library.kinds.values()
    y, d = run.values(states), np.random.default_rng(1).normal(size=len(states))
    wanted = made.outputs[: -len("xyz")]

    def at(part):
        moved = np.ascontiguousarray(y + part * d)
        assert not library.functions.dap3d_set_states(run._model, 0.1, moved.ctypes.data)
        return run.values(wanted)

    found = run.directional(wanted, dict(zip(states, d.tolist(), strict=True)))
    # differences: of order h^2, and rounding over h
    np.testing.assert_allclose(found, (at(1e-6) - at(-1e-6)) / 2e-6, rtol=1e-7, atol=1e-7)
    with pytest.raises(dap.SimulationError, match="a mean of a step"):
        run.directional(["ball.rdd.x"], {"state.ball.r.x": 1.0})
    with pytest.raises(dap.SimulationError, match="no derivatives"):
        run.derivatives(0.1, y)
