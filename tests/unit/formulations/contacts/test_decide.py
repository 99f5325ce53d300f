"""What ends a contact at an instant."""

import pytest
from support.internals import ContactTable

import dap3d_core as dap
from dap3d_core.formulations.contacts.contact_table import NORMAL, REACH
from dap3d_core.formulations.contacts.decide import put_in_touch
from dap3d_core.simulation import CompiledModel


@pytest.mark.parametrize("unit", [1.0, 1e6, 1e-3])
@pytest.mark.parametrize(("reach", "force", "stays"), [(-1e-13, -1e-14, 0), (1e-13, -1e-14, 1)])
def test_a_surface_that_has_ended_leaves_in_any_unit_of_force(unit, reach, force, stays):
    """Of a contact that carries nothing, to rounding: in m and N, mm and g mm/s^2, t and mm."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0, 0, 0.1))
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    s = ContactTable(CompiledModel(scene).evaluator).arrays()
    s.was[0], s.ended[0, 0] = 1.0, 1
    s.says.found[0, [REACH, NORMAL]] = (1e3 if unit > 1.0 else 1.0) * reach, unit * force
    put_in_touch(s)
    assert s.in_touch_count == s.ended[0, 0] == stays
