"""A scene that a script builds: names, values of every numeric kind, refusals at once."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.scene import check

ROUND = [1.0, 1.0, 1.0]


def refused(call, *arguments, **fields):
    with pytest.raises(dap.SceneError) as caught:
        call(*arguments, **fields)
    return str(caught.value)


def test_every_adder_returns_the_name():
    scene = dap.Scene(name="demo")
    assert scene.add_body("a", mass=1.0, Jp=ROUND) == "a"
    assert scene.add_point("P", "a", [0.0, 0.0, 1.0]) == "P"
    assert scene.add_vector("v", body="a", sp=[0.0, 0.0, 1.0]) == "v"
    assert scene.add_vector2("d", P_i="P", P_j="ground.O") == "d"
    assert scene.add_joint("sph", "J", P_i="P", P_j="ground.O") == "J"
    assert scene.add_force("weight", name="g") == "g"
    assert scene.add_function("a", coeff=[0.0, 1.0, 0.0]) == "a1"
    assert scene.joints["J"].type == "sph"
    assert scene.joints["J"].fields == {"P_i": "P", "P_j": "ground.O"}
    assert scene.folder is None


def test_names_are_made_from_the_type_and_avoid_those_taken():
    scene = dap.Scene()
    assert scene.add_joint("sph") == "sph1"
    assert scene.add_joint("sph", "sph2") == "sph2"
    assert scene.add_joint("sph") == "sph3"
    assert scene.add_joint("rev") == "rev1"
    assert scene.add_force("sph") == "sph1"


@pytest.mark.parametrize("name", ["", "  ", "ground", "a.b", "a\nb", "a\0b", 3, None, ("a",), b"a"])
def test_an_illegal_name_is_refused_at_once(name):
    scene = dap.Scene()
    calls = [scene.add_body, scene.add_point, scene.add_vector, scene.add_vector2]
    for call in calls:
        assert "name" in refused(call, name) or "ground" in refused(call, name)
    if name is not None:
        refused(scene.add_joint, "sph", name)
    assert scene == dap.Scene(), "nothing was added"


def test_a_name_is_used_once_in_each_table():
    scene = dap.Scene()
    scene.add_body("a")
    scene.add_point("a", "a", [0, 0, 0])
    assert "bodies" in refused(scene.add_body, "a")
    assert "points" in refused(scene.add_point, "a", "a", [0, 0, 0])
    scene.add_joint("sph", "J")
    assert "joints" in refused(scene.add_joint, "rev", "J")


def test_an_unknown_key_is_refused_at_once_with_the_nearest():
    scene = dap.Scene()
    said = refused(scene.add_body, "a", mass=1.0, Jpp=ROUND, rdot=[0, 0, 0])
    assert "bodies.a.Jpp" in said
    assert "did you mean 'Jp'?" in said
    assert "bodies.a.rdot" in said
    assert "did you mean 'r_dot'?" in said
    assert "points.P.sP" in refused(scene.add_point, "P", "a", sP=[0, 0, 0])
    assert "did you mean 'sp'?" in refused(scene.add_vector, "v", body="a", sPp=[0, 0, 0])
    assert "did you mean 'P_i'?" in refused(scene.add_vector2, "d", P_I="a", P_j="b")
    assert scene == dap.Scene()


@pytest.mark.parametrize("type_", ["", None, 3, ["sph"]])
def test_the_type_of_an_element_is_a_word(type_):
    assert "keyword of a type" in refused(dap.Scene().add_joint, type_, "J")


def test_a_key_that_is_left_out_or_none_is_missing_later():
    scene = dap.Scene()
    scene.add_point("P", body="a")
    scene.add_joint("sph-sph", "J", length=None)
    scene.add_body("a", mass=1.0, Jp=ROUND, r=None)
    assert scene.joints["J"].fields == {}
    assert scene.bodies["a"].r == (0.0, 0.0, 0.0)
    with pytest.raises(dap.SceneError) as caught:
        check(scene, dap.load_registry())
    assert {m.key for m in caught.value.mistakes} == {"points.P.sPp", "joints.J.d"}


READ_ONLY = np.array([1.0, 2.0, 3.0])
READ_ONLY.flags.writeable = False
KINDS = {
    "float32": np.array([1, 2, 3], dtype=np.float32),
    "int64": np.array([1, 2, 3]),
    "uint8": np.array([1, 2, 3], dtype=np.uint8),
    "longdouble": np.array([1, 2, 3], dtype=np.longdouble),
    "big endian": np.array([1, 2, 3], dtype=">f8"),
    "not contiguous": np.array([[1.0, 9.0], [2.0, 9.0], [3.0, 9.0]])[:, 0],
    "reversed": np.array([3.0, 2.0, 1.0])[::-1],
    "read only": READ_ONLY,
    "numpy scalars": [np.float32(1), np.int8(2), np.float64(3)],
    "tuple": (1, 2.0, 3),
    "0-d arrays": [np.array(1.0), np.array(2), 3.0],
}


@pytest.mark.parametrize("value", KINDS.values(), ids=KINDS)
def test_numbers_of_every_kind_are_accepted(value):
    scene = dap.Scene()
    scene.add_body("a", mass=np.float32(2.0), Jp=np.eye(3, dtype=np.float32), r=value)
    scene.add_force("weight", gravity=np.int64(10), wgt=value)
    checked = check(scene, dap.load_registry())
    np.testing.assert_array_equal(checked.r, [[1.0, 2.0, 3.0]])
    assert checked.forces[0].values == {"gravity": 10.0, "wgt": (1.0, 2.0, 3.0)}
    assert all(type(x) is float for x in checked.forces[0].values["wgt"])


REFUSED = {
    "object": np.array([1.0, 2.0, 3.0], dtype=object),
    "complex": np.array([1.0, 2.0, 3.0j]),
    "bool": np.array([True, False, True]),
    "text": np.array(["1", "2", "3"]),
    "masked": np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]),
    "2-d": np.array([[1.0, 2.0, 3.0]]),
    "empty": np.array([]),
    "0-d": np.array(1.0),
    "set": {1.0, 2.0, 3.0},
    "generator": (x for x in (1.0, 2.0, 3.0)),
}


@pytest.mark.parametrize("value", REFUSED.values(), ids=REFUSED)
def test_what_is_no_vector_is_refused_by_the_check(value):
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=ROUND, r=value)
    scene.add_force("weight", wgt=value)
    with pytest.raises(dap.SceneError) as caught:
        check(scene, dap.load_registry())
    assert [m.key for m in caught.value.mistakes] == ["bodies.a.r", "forces.weight1.wgt"]
    assert str(caught.value)


def test_values_are_kept_as_they_were_when_given():
    scene = dap.Scene()
    r = np.array([1.0, 2.0, 3.0])
    listed = [1.0, 2.0, 3.0]
    scene.add_body("a", mass=1.0, Jp=ROUND, r=r, w=listed)
    r[0] = listed[0] = 99.0
    assert scene.bodies["a"].r == (1.0, 2.0, 3.0)
    assert scene.bodies["a"].w == (1.0, 2.0, 3.0)


def test_values_may_be_changed_and_are_checked_again():
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=ROUND)
    scene.add_force("weight", "g")
    scene.bodies["a"].r = np.array([0.0, 0.0, 5.0])
    scene.simulation.t_end = np.float32(2)
    scene.forces["g"].fields["gravity"] = np.float64(1.5)
    checked = check(scene, dap.load_registry())
    assert checked.r.tolist() == [[0.0, 0.0, 5.0]]
    assert checked.forces[0].values["gravity"] == 1.5
    assert type(scene.simulation.t_end) is float
    scene.simulation.t_end = "2"
    with pytest.raises(dap.SceneError, match=r"simulation.t_end = \"2\""):
        check(scene, dap.load_registry())


def test_two_scenes_share_nothing_and_can_be_copied():
    first = dap.Scene()
    first.add_body("a", mass=1.0, Jp=ROUND)
    first.add_joint("sph", P_i="a.O", P_j="ground.O")
    for other in (copy.deepcopy(first), pickle.loads(pickle.dumps(first))):
        assert other == first
        other.joints["sph1"].fields["P_i"] = "b.O"
        other.add_body("b")
        assert other != first
    assert list(first.bodies) == ["a"]
    assert dap.Scene() == dap.Scene()


def test_a_scene_error_can_be_pickled():
    scene = dap.Scene()
    scene.add_body("a", mass=-1.0, Jp=ROUND)
    with pytest.raises(dap.SceneError) as caught:
        check(scene, dap.load_registry())
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_checked_arrays_are_the_callers_own():
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=ROUND)
    first = check(scene, dap.load_registry())
    first.r[0, 0] = 99.0
    assert check(scene, dap.load_registry()).r[0, 0] == 0.0


def test_names_with_spaces_and_letters_of_all_scripts_work():
    scene = dap.Scene()
    scene.add_body("Kurbel №1 – links", mass=1.0, Jp=ROUND)
    scene.add_joint("sph", P_i="Kurbel №1 – links.O", P_j="ground.O")
    assert check(scene, dap.load_registry()).joints[0].bodies == (1, 0)


def test_the_path_of_a_scene_may_be_text():
    """Models' own types are looked for beside it."""
    scene = dap.Scene(name="ball", path="models/ball/scene.toml")
    assert scene.folder == Path("models/ball")
    scene.path = "elsewhere/scene.toml"
    assert scene.folder == Path("elsewhere")
