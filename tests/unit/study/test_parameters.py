"""Parameters of a scene by their names."""

import attrs
import numpy as np
import pytest
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.scene import check
from dap3d_core.study import all_parameters, names_under, parameters_named, with_values

#: Components by letters and by places, of fields that the scene gives or leaves to their types.
HERE = {
    "bodies.rod.mass": 2.0,
    "bodies.rod.r.x": 0.5,
    "bodies.rod.r.1": 0.5,
    "bodies.rod.p.e0": 1.0,
    "bodies.rod.Jp.1.2": 0.01,
    "bodies.bob.mass": 1.0,
    "bodies.bob.Jp.z": 1.0,
    "points.A.sPp.z": -1.0,
    "vectors.a.sp.y": 1.0,
    "forces.spring.k": 10.0,
    "forces.spring.c": 0.0,
    "forces.g.wgt.z": -1.0,
    "functions.motor.coeff.2": 3.0,
    "simulation.rtol": 1e-8,
    "simulation.step": None,
}


@pytest.fixture(scope="module")
def scene():
    """A rod with a full inertia matrix, a bob with nothing but its name, a spring, a function."""
    scene = dap.Scene(name="names")
    inertia = ((1.0, 0.01, 0.0), (0.01, 1.0, 0.0), (0.0, 0.0, 1.0))
    scene.add_body("rod", mass=2.0, Jp=inertia, r=(0.5, 0.0, 0.0))
    scene.add_body("bob")
    scene.add_point("A", "rod", (0.0, 0.0, -1.0))
    scene.add_vector("a", "rod", (0.0, 1.0, 0.0))
    scene.add_force("ptp", "spring", P_i="A", P_j="ground.O", k=10)
    scene.add_force("weight", "g")
    scene.add_function("a", "motor", coeff=(1.0, 3.0, 0.0))
    scene.add_input("torque", 0.5)
    scene.add_shape("sphere", "ball", body="rod", radius=0.1)
    return scene


@pytest.fixture(scope="module")
def checked(scene):
    return check(scene, dap.load_registry())


def test_numbers_are_found_with_what_stands_there(checked):
    found = parameters_named(checked, [name for name in HERE if name != "bodies.rod.r.1"])
    assert {n.name: n.value for n in found} == {k: v for k, v in HERE.items()
                                                if k != "bodies.rod.r.1"}  # fmt: skip
    assert parameters_named(checked, ["bodies.rod.r.1"])[0].index == (0,)
    units = {n.name: n.unit for n in found}
    assert units["bodies.rod.mass"] == "kg"
    assert units["forces.spring.k"] == "N/m"
    assert units["simulation.rtol"] == "1"


def test_every_number_is_found_by_its_name(checked):
    """Those that a list gives are those that are found one by one."""
    numbers = list(all_parameters(checked))
    assert len({n.name for n in numbers}) == len(numbers) > 50
    for number in numbers:
        assert parameters_named(checked, [number.name]) == (number,)
    assert not any("shapes" in n.name for n in numbers)


def twin(name):
    """The entry of an inertia matrix that is the same number."""
    head, *places = name.split(".Jp.")
    row, dot, column = places[0].partition(".") if places else ("", "", "")
    return f"{head}.Jp.{column}.{row}" if dot else name


def test_every_number_is_put_where_it_is_read(scene, checked):
    """Its own value changes, an inertia matrix stays symmetric, nothing else does."""
    numbers = {n.name: n for n in all_parameters(checked)}
    for name, number in numbers.items():
        changed = with_values(scene, [number], [0.375])
        found = {n.name: n.value for n in all_parameters(attrs.evolve(checked, scene=changed))}
        assert found.pop(name) == 0.375
        assert found.pop(twin(name), 0.375) == 0.375
        assert found == {n: v.value for n, v in numbers.items() if n in found}
    assert scene.bodies["bob"].mass is None
    assert "c" not in scene.forces["spring"].fields


def test_two_components_of_what_the_scene_leaves_open(scene, checked):
    """The second is put beside the first, not beside the default."""
    numbers = parameters_named(checked, ["forces.g.wgt.x", "forces.g.wgt.y"])
    changed = with_values(scene, numbers, [0.25, 0.5])
    assert changed.forces["g"].fields["wgt"] == (0.25, 0.5, -1.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bodies.rdo.mass", "there is no 'rdo' in bodies; did you mean 'bodies.rod.mass'"),
        ("bodies.rod.mas", "did you mean 'bodies.rod.mass'"),
        ("bodies.rod.color", "bodies.rod has no number 'color'"),
        ("rod.mass", "did you mean 'bodies.rod.mass'"),
        ("body.rod.mass", "did you mean 'bodies.rod.mass'"),
        ("t_end", "did you mean 'simulation.t_end'"),
        ("torque", "did you mean 'inputs.torque.value'"),
        ("simulation.method", "simulation has no number 'method'"),
        ("bodies", "this is a table"),
        ("bodies.rod", "no single number; it has bodies.rod.mass, bodies.rod.Jp, bodies.rod.r"),
        ("bodies.rod.r", "it has bodies.rod.r.x, bodies.rod.r.y, bodies.rod.r.z"),
        ("bodies.rod.r.4", "has no number '4'"),
        ("bodies.rod.r.0", "has no number '0'"),
        ("bodies.rod.r.-1", "has no number '-1'"),
        ("bodies.rod.r.x.x", "has no number 'x.x'"),
        ("bodies.rod.r.99999999999999999999", "has no number"),
        ("bodies.rod.Jp.x", "it has bodies.rod.Jp.1.1"),
        ("bodies.rod.mass.x", "it has no parts"),
        ("bodies..mass", "there is no '' in bodies"),
        ("bodies.rod.", "has no number ''"),
        ("shapes.ball.radius", "no number of this name"),
        ("", "names are TABLE.NAME.FIELD"),
        (None, "the name of a number is text"),
        (("bodies", "rod"), "the name of a number is text"),
    ],
)
def test_invalid_names(checked, name, words):
    with pytest.raises(dap.SceneError) as refused:
        parameters_named(checked, [name])
    assert words in str(refused.value)


def test_a_parameter_is_meant_by_its_name_alone(scene):
    scene.parameters["stiff"] = 4.0
    with pytest.raises(dap.SceneError, match=r"did you mean 'parameters\.stiff'"):
        parameters_named(check(scene, dap.load_registry()), ["stiff"])


def test_all_mistakes_at_once_and_no_number_twice(checked):
    names = ["bodies.rod.r.x", "bodies.rod.r.1", "none", "bodies.rod.r.x", "bodies.rod.Jp.1.2"]
    with pytest.raises(dap.SceneError) as refused:
        parameters_named(checked, [*names, "bodies.rod.Jp.2.1"])
    said = [m.what for m in refused.value.mistakes]
    assert said == [
        "this is bodies.rod.r.x under another name; a number is varied only once",
        "the scene has no number of this name",
        "a number is varied only once",
        "this is bodies.rod.Jp.1.2 under another name; a number is varied only once",
    ]


def test_names_go_on_part_by_part(checked):
    """What the tab key offers: all of it exists, and all numbers are reached."""
    todo, reached = names_under(checked), []
    while todo:
        name = todo.pop()
        if name.endswith("."):
            parts = names_under(checked, name)
            assert parts, name
            todo += parts
        else:
            reached.append(name)
    assert sorted(reached) == sorted(n.name for n in all_parameters(checked))
    assert names_under(checked, "bodies.rod.r") == ["bodies.rod.r.", "bodies.rod.r_dot."]
    assert names_under(checked, "bodies.none.") == names_under(checked, "none.") == []


@pytest.mark.slow
@pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
def test_numbers_of_what_sticks_and_of_limits():
    """Friction that sticks and limits are contacts, and have their numbers as other elements."""
    scene = dap.Scene(name="slider")
    scene.add_body("b", mass=2.0, r_dot=(1.0, 0.0, 0.0))
    scene.add_joint("tran", "rail", P_i="b.O", P_j="ground.O", a_j="ground.x", upper=0.1, e=0.5)
    scene.add_force("tran_friction", "rub", joint="rail", f_c=2.0)
    found = parameters_named(
        check(scene, dap.load_registry()), ["forces.rub.f_c", "joints.rail.upper", "joints.rail.e"]
    )
    assert [(one.value, one.unit) for one in found] == [(2.0, "N"), (0.1, "m"), (0.5, "1")]
    # v^2 = 1 - 2 a 0.1 at the stop, e^2 of it behind, and e^2 (1 / (2 a) - 0.1) to where it rests
    by = dap.sensitivities(scene, [one.name for one in found], t_end=2.0, dt=1.0).final("b.r.x")
    np.testing.assert_allclose(by, (0.25 / 4.0, 1.25, -2 * 0.5 * 0.4), atol=1e-7)
