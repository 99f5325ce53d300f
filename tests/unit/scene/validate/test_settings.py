"""Settings of scripts and of the command line obey the same rules as those of a file."""

import attrs
import pytest
from support import problems

import dap3d_core as dap
from dap3d_core import settings
from dap3d_core.formulations import FORMULATIONS
from dap3d_core.integrators import INTEGRATORS
from dap3d_core.scene import Simulation, check_simulation, mistake_at


def test_the_defaults_are_good():
    check_simulation(Simulation(), ())
    check_simulation(Simulation(t_end=0.0, dt=0.1), ("a",))


def test_mistakes_carry_the_names_of_the_settings():
    settings = attrs.evolve(Simulation(), t_end=-1.0, rtol=0, method="fast", hold=("b",))
    with pytest.raises(dap.SceneError) as caught:
        check_simulation(settings, ("a",))
    assert [m.key for m in caught.value.mistakes] == ["t_end", "method", "rtol", "hold.1"]


def test_a_mistake_of_a_higher_floor_finds_its_line(tmp_path):
    from dap3d_core.scene import load

    file = tmp_path / "scene.toml"
    file.write_text('[bodies.a]\n\n[joints.J1]\ntype = "sph"\n')
    mistake = mistake_at(load(file), ("joints", "J1"), "cannot be assembled", "move it")
    assert str(mistake) == f"{file}:3: joints.J1: cannot be assembled\n    move it"
    assert mistake_at(dap.Scene(), ("joints", "J1"), "bad").line is None


def test_names_of_formulations_and_integrators_are_those_of_their_tables():
    """The settings, below both tables, repeat their names and who takes a step as data."""
    assert set(settings.METHODS) == {"auto", *FORMULATIONS}
    assert set(settings.INTEGRATORS) == {"auto", *INTEGRATORS}
    assert set(settings.FIXED_STEP) == {n for n, one in INTEGRATORS.items() if not one.adaptive}
    model = dap.compile(problems.pendulum())
    evaluator, refusing = model.evaluator, set()
    y = evaluator.integrated(model.model.u0)
    for name, integrator in INTEGRATORS.items():
        try:
            integrator.make(evaluator, y, [0.0, 0.1], step=0.05)
        except ValueError:
            refusing.add(name)
    assert set(settings.NO_STEP) == refusing


def test_settings_of_functions_and_scenes_are_those_of_the_table():
    """Arguments of functions for type checkers, and attributes, are the settings by name."""
    names = [one.name for one in attrs.fields(Simulation)]
    assert names == list(settings.SETTINGS)
    given = {name for name, one in settings.SETTINGS.items() if one.on_command_line}
    assert settings.RunSettings.__annotations__.keys() == given - {"start"}
    assert dap.simulate.__signature__.parameters.keys() >= given
    with pytest.raises(TypeError, match="'rtoll'; did you mean 'rtol'"):
        dap.simulate("pen1", rtoll=1e-3)
