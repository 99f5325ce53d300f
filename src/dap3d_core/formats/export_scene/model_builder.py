"""An articulated model in the making."""

import attrs
import numpy as np

from dap3d_core.formats.export_scene.elements import SceneElements
from dap3d_core.interface.formats.articulation import WORLD, Articulation, Joint
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.interface.formats.remarks import Remarks
from dap3d_core.scene.tables import GROUND


@attrs.define(eq=False)
class ModelBuilder:
    """A model that is made of a scene.

    Attributes:
        elements: the elements of the scene, with their frames.
        remarks: of the export.
        model: the model so far.
        origin: body -> the origin of its link in its axes at its mass centre.
        placed: joint of the scene -> that of the model.
    """

    elements: SceneElements
    remarks: Remarks
    model: Articulation
    origin: dict[str, np.ndarray] = attrs.Factory(dict)
    placed: dict[str, Joint] = attrs.Factory(dict)

    def link(self, body: str) -> str:
        """The link of a body."""
        return WORLD if body == GROUND else body

    def in_link(self, body: str, frame: Frame) -> Frame:
        """A frame of a body at its mass centre, in its link."""
        return Frame(frame.r - self.origin.get(body, np.zeros(3)), frame.A)
