"""Fields of whole numbers, such as the teeth of a gear, and joints that forces act in."""

import pytest
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Body, Force, body, number
from dap3d_core.scene import check

ZERO = (0.0, 0.0, 0.0)


class Blades(Force):
    """As many pushes as there are blades."""

    keyword = "blades"
    body_i: Body = body()
    count: float = number(minimum=1.0, maximum=4.0, whole=True, doc="number of blades")

    def prepare(self, bodies):
        if self.count != round(self.count):  # registration tries whole numbers alone
            raise ValueError(f"{self.count} blades")
        return {}

    def wrench(count):
        return (((count, 0.0, 0.0), ZERO),)


def scene(count):
    made = dap.Scene(name="blades")
    made.add_body("fan", mass=1.0, Jp=(1.0, 1.0, 1.0))
    made.add_force("blades", "push", body_i="fan", count=count)
    return made


@pytest.mark.parametrize("count", [3, 3.0])
def test_a_whole_number_is_taken(count):
    assert check(scene(count), registry_of(Blades)).forces[0].values["count"] == 3.0


@pytest.mark.parametrize(("count", "words"), [(2.5, "a whole number"), (5, "at most 4")])
def test_any_other_is_refused(count, words):
    with pytest.raises(dap.SceneError, match=words) as caught:
        check(scene(count), registry_of(Blades))
    assert "count" in str(caught.value)


@pytest.mark.parametrize(
    ("keyword", "fields", "joint"),
    [("rot_friction", {"n_c": 1.0}, "slide"), ("tran_friction", {"f_c": 1.0}, "hinge")],
)
def test_what_acts_in_an_angle_refuses_a_joint_without_one(keyword, fields, joint):
    """It would have no effect at all."""
    scene = dap.Scene(name="two")
    scene.add_body("a")
    scene.add_body("b")
    scene.add_joint("tran", "slide", P_i="a.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("rev", "hinge", P_i="b.O", P_j="a.O", a_i="b.z", a_j="a.z")
    scene.add_force(keyword, "rub", joint=joint, **fields)
    with pytest.raises(dap.SceneError, match=rf"rub\.joint = .{joint}.*that this could act in"):
        check(scene, dap.load_registry())
