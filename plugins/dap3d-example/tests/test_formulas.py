"""The formulas of every type, by the test kit of dap3d."""

import pytest

from dap3d_core.testing import checks_for
from dap3d_example.bushing import Bushing
from dap3d_example.gear import Gear
from dap3d_example.motor import Motor
from dap3d_example.point_on_plane import PointOnPlane
from dap3d_example.point_on_surface import PointOnSurface
from dap3d_example.screw import Screw


@pytest.mark.parametrize("check", checks_for(Screw), ids=str)
def test_screw(check):
    check()


@pytest.mark.parametrize("check", checks_for(Gear), ids=str)
def test_gear(check):
    check()


@pytest.mark.parametrize("check", checks_for(PointOnPlane), ids=str)
def test_point_on_plane(check):
    check()


@pytest.mark.parametrize("check", checks_for(PointOnSurface), ids=str)
def test_point_on_surface(check):
    check()


@pytest.mark.parametrize("check", checks_for(Bushing), ids=str)
def test_bushing(check):
    check()


@pytest.mark.parametrize("check", checks_for(Motor), ids=str)
def test_motor(check):
    check()
