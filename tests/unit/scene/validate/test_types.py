"""Types of a model's own: run only where allowed and needed; their fields are checked."""

import pytest
from unit.scene.base import mistakes_of, scene_of

from dap3d_core.scene import check

PLUGIN = """
from dap3d_core.interface import (
    Body, Force, Joint, Point, Vector, body, choice, hookimpl, matrix, number, point, vector
)
from dap3d_core.kernels import eye, hstack, skew, sub, row, cross

interface_version = 1
print("the plugin is run")

class Push(Force):
    keyword = "push"
    body_i: Body = body()
    angle: float = number(default=0.0, unit="rad")
    level: str = choice(["low", "high"], default="low")
    M: tuple = matrix(default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))

    def wrench(angle):
        return (((angle, 0.0, 0.0), (0.0, 0.0, 0.0)),)

class Between(Joint):
    keyword, rows = "between", 1
    P_i: Point = point()
    P_j: Point = point()
    P_k: Point = point()

    def C(r_P_i, r_P_j, r_P_k):
        return r_P_i[0] + r_P_j[0] - 2.0 * r_P_k[0]
    def J(s_P_i):
        zero = row((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return zero, zero, zero
    def gamma():
        return 0.0

class Rail(Joint):
    keyword, rows = "rail", 1
    body_i: Body = body(default=None)
    P_i: Point = point(default=None)
    a_j: Vector = vector(default="ground.z")

    def C(r_P_i, a_j):
        return r_P_i[2]
    def J(s_P_i, a_j):
        zero = row(a_j, s_P_i)
        return zero, zero
    def gamma():
        return 0.0

@hookimpl
def dap3d_forces():
    return [Push]

@hookimpl
def dap3d_joints():
    return [Between, Rail]
"""
THREE = """
[bodies.a]
mass = 1
Jp = [1, 1, 1]
[bodies.b]
mass = 1
Jp = [1, 1, 1]
[bodies.c]
mass = 1
Jp = [1, 1, 1]
"""


@pytest.fixture
def model(tmp_path):
    """A model with types of its own: its elements are given."""

    def make(elements):
        (tmp_path / "plugin.py").write_text(PLUGIN)
        return scene_of(tmp_path, THREE + elements)

    return make


def test_a_models_own_types_are_refused_until_code_is_allowed(model, registry, tmp_path, capfd):
    scene = model('[forces.p]\ntype = "push"\nbody_i = "a"\n')
    (mistake,) = mistakes_of(scene, registry)
    assert mistake.key == "forces.p.type"
    for word in [str(tmp_path / "plugin.py"), "--allow-code", "allow_code=True"]:
        assert word in str(mistake)
    assert "the plugin is run" not in "".join(capfd.readouterr())

    checked = check(scene, registry, allow_code=True)
    assert "the plugin is run" in capfd.readouterr().err
    assert checked.forces[0].type_info.type.__name__ == "Push"
    assert "push" in checked.registry.keywords("force")
    assert "push" not in registry.keywords("force")


def test_a_word_that_neither_the_plugin_knows_is_reported(model, registry):
    (mistake,) = mistakes_of(
        model('[forces.p]\ntype = "pull"\nbody_i = "a"\n'), registry, allow_code=True
    )
    assert "push" in str(mistake)


OWN_MISTAKES = [
    ('[forces.p]\ntype = "push"\nbody_i = "ground"\n', "forces.p.body_i", "only body"),
    ('[forces.p]\ntype = "push"\nbody_i = "a"\nlevel = "hihg"\n', "forces.p.level", "'high'?"),
    ('[forces.p]\ntype = "push"\nbody_i = "a"\nM = [1, 2, 3]\n', "forces.p.M", "row 1"),
    ('[forces.p]\ntype = "push"\nbody_i = "a"\nM = [[1, 2], [3, 4]]\n', "forces.p.M", "3x3"),
    ('[joints.j]\ntype = "between"\nP_i = "a.O"\nP_j = "b.O"\nP_k = "b.O"\n', "joints.j.P_k",
     "body j and body k are both b"),
    ('[joints.j]\ntype = "between"\nP_i = "a.O"\nP_j = "b.O"\nP_k = "a.O"\n', "joints.j.P_k",
     "body i and body k are both a"),
    ('[joints.j]\ntype = "between"\nP_i = "ground.O"\nP_j = "ground.O"\nP_k = "a.O"\n',
     "joints.j.P_j", "body i and body j are both ground"),
    ('[joints.j]\ntype = "rail"\n', "joints.j", "which body is i? Give body_i or P_i"),
    ('[joints.j]\ntype = "rail"\nbody_i = "a"\nP_i = "b.O"\n', "joints.j.P_i",
     "P_i is on b, but body_i on a"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("elements", "key", "words"), OWN_MISTAKES, ids=[c[2] for c in OWN_MISTAKES]
)
def test_fields_of_a_models_own_types_are_checked(model, registry, elements, key, words):
    (mistake,) = mistakes_of(model(elements), registry, allow_code=True)
    assert mistake.key == key
    assert words in str(mistake)


def test_ground_may_be_body_j_or_k(model, registry):
    text = '[joints.j]\ntype = "between"\nP_i = "a.O"\nP_j = "ground.O"\nP_k = "b.O"\n'
    assert check(model(text), registry, allow_code=True).joints[0].bodies == (1, 0, 2)


@pytest.mark.parametrize("given", ['body_i = "b"', 'P_i = "b.O"', 'body_i = "b"\nP_i = "b.O"'])
def test_body_and_point_of_a_slot_follow_from_each_other(model, registry, given):
    text = f'[joints.j]\ntype = "rail"\n{given}\n'
    joint = check(model(text), registry, allow_code=True).joints[0]
    assert joint.bodies == (2, 0)
    assert joint.values == {"body_i": "b", "P_i": (0.0, 0.0, 0.0), "a_j": (0.0, 0.0, 1.0)}


def test_an_angle_beyond_a_turn_is_noted(model, registry):
    text = '[forces.p]\ntype = "push"\nbody_i = "a"\nangle = 90\n'
    notes = check(model(text), registry, allow_code=True).notes
    assert any("forces.p.angle = 90 is more than a full turn" in note for note in notes)
