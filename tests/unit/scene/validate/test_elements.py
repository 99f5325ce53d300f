"""Fields of whole numbers, such as the teeth of a gear."""

import pytest
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Body, Force, body, number
from dap3d_core.scene.validate.validate import check

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
