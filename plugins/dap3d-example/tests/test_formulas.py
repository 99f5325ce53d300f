"""The formulas of every type, by the test kit of dap3d."""

import pytest

from dap3d_core.testing import checks_for
from dap3d_example.clutch import Clutch
from dap3d_example.cycloid import Cycloid
from dap3d_example.cylinder import Cylinder
from dap3d_example.engine import Engine
from dap3d_example.point_on_plane import PointOnPlane
from dap3d_example.point_on_surface import PointOnSurface
from dap3d_example.position_servo import PositionServo
from dap3d_example.servo import Servo
from dap3d_example.stage import Stage
from dap3d_example.tyre import Tyre

TYPES = (
    PointOnPlane, PointOnSurface, PositionServo, Cylinder, Servo, Tyre, Clutch, Stage, Engine,
    Cycloid,
)  # fmt: skip
CHECKS = [(type_, check) for type_ in TYPES for check in checks_for(type_)]


@pytest.mark.parametrize(
    "check", [c for _, c in CHECKS], ids=[f"{t.keyword}-{c}" for t, c in CHECKS]
)
def test_formulas(check):
    check()
