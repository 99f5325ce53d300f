"""Forces and drivers whose factor is a function of time or an input, against closed forms.
Tolerances: rtol 1e-11 over a second leaves some 1e-10."""

import numpy as np
import pytest

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
OMEGA = 3.0


def block():
    """A body of 2 kg, with a harmonic function of time and an input."""
    scene = dap.Scene(name="block")
    scene.add_body("block", mass=2.0, Jp=(0.5, 0.5, 0.5))
    scene.add_function("harmonic", "swing", frequency=OMEGA)
    scene.add_input("level", 0.75)
    return scene


def end(scene):
    return dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)


#: Factor -> its double integral over a second, from rest.
FACTORS = {
    "function": ("swing", 1.0 / OMEGA - np.sin(OMEGA) / OMEGA**2),
    "input": ("level", 0.5 * 0.75),
}


@pytest.mark.parametrize("field", FACTORS)
@pytest.mark.parametrize("keyword", ["f", "fp"])
def test_a_force_moves_by_the_integral_of_its_factor(keyword, field):
    """m x'' = F s(t): x is F / m times the double integral of s."""
    name, integral = FACTORS[field]
    scene = block()
    scene.add_force(keyword, "push", body_i="block", **{keyword: (1.0, -2.0, 0.5), field: name})
    x = np.array([1.0, -2.0, 0.5]) / 2.0 * integral
    assert end(scene).r[-1, 0] == pytest.approx(x, abs=1e-10)


@pytest.mark.parametrize("field", FACTORS)
@pytest.mark.parametrize("keyword", ["n", "np"])
def test_a_moment_turns_by_the_integral_of_its_factor(keyword, field):
    """A sphere about one axis: J w' = M s(t), the angle is M / J times the double integral."""
    name, integral = FACTORS[field]
    scene = block()
    scene.add_force(keyword, "turn", body_i="block", **{keyword: (0.0, 0.0, 0.8), field: name})
    angle = 0.8 / 0.5 * integral
    assert end(scene).p[-1, 0] == pytest.approx(
        [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)], abs=1e-10
    )


@pytest.mark.parametrize("field", ["factor", "input"])
@pytest.mark.parametrize("with_curve", [False, True])
def test_an_actuator_pulls_by_its_factor(field, with_curve):
    """ptp: the factor is one of f_a alone; spring and damper stay, curve or not."""
    name = {"factor": "swing", "input": "level"}[field]
    scene = block()
    scene.bodies["block"].r = (1.5, 0.0, 0.0)
    spring = {"k": 40.0}
    if with_curve:
        scene.add_function("a", "curve", coeff=(0.0, 40.0, 0.0))
        spring = {"function": "curve"}
    scene.add_force("ptp", "pull", P_i="ground.O", P_j="block.O", l0=1.2, f_a=5.0, c=0.3,
                    **spring, **{field: name})  # fmt: skip
    result = end(scene)
    s = np.sin(OMEGA * result.t) if field == "factor" else np.full(5, 0.75)
    length, rate = result.force("pull").length, result.force("pull").length_rate
    wanted = 40.0 * (length - 1.2) + 0.3 * rate + 5.0 * s
    assert result.force("pull").tension == pytest.approx(wanted, abs=1e-12)
    assert result.rdd[:, 0, 0] == pytest.approx(-wanted / 2.0, abs=1e-10)
    balance = result.energy.kinetic - result.work
    assert np.ptp(balance) < 1e-9
    assert not result.settings["conservative"]


def test_an_input_that_is_zero_at_first_does_not_make_a_scene_conservative():
    """The spring has a potential, and the actuator will not: the ledger does not expect it."""
    scene = block()
    scene.bodies["block"].r = (1.5, 0.0, 0.0)
    scene.inputs["level"].value = 0.0
    scene.add_force("ptp", "pull", P_i="block.O", P_j="ground.O", l0=1.2, k=40.0, f_a=5.0,
                    input="level")  # fmt: skip
    controllers = [dap.Controller(every=0.1, update=lambda t, state: {"level": t})]
    result = dap.simulate(scene, t_end=1.0, dt=0.25, controllers=controllers, **TIGHT)
    assert not result.settings["conservative"]
    assert np.ptp(result.energy.total) > 0.1
    assert all(entry.ok is not False for entry in result.ledger.values())


def test_an_input_is_a_quantity_of_results(tmp_path):
    """By name, in expressions, in files and data sets; it is not a name of something else."""
    scene = block()
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0), input="level")
    scene.add_output("squared", "level ** 2 + block.r.y")
    result = end(scene)
    path = result.save(tmp_path / "run.nc")
    opened = dap.open(tmp_path / "run.nc")
    for one in (result, opened):
        assert one.quantity("level").values.tolist() == [0.75] * 5
        assert one.quantity("squared").values == pytest.approx([0.75**2] * 5)
    data = opened.to_xarray()
    assert data["inputs"].sel(input="level").values.tolist() == [0.75] * 5
    assert path is None
    scene.outputs["level"] = "1"
    with pytest.raises(dap.SceneError, match="there is one of this name in inputs already"):
        dap.compile(scene)
