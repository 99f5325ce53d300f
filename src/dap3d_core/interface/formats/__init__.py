"""The interface of file formats: what an importer returns and what an exporter is given."""

from dap3d_core.interface.formats.articulation import (
    FRICTION_DIRECTIONS,
    UNBOUNDED,
    WORLD,
    Actuator,
    Articulation,
    Contact,
    Coupling,
    Drum,
    Geometry,
    Inertial,
    Joint,
    Limits,
    Link,
    Tendon,
)
from dap3d_core.interface.formats.format_types import (
    Exporter,
    FolderImporter,
    Importer,
    ResultExporter,
    Source,
    hookimpl,
)
from dap3d_core.interface.formats.frames import (
    IDENTITY,
    Frame,
    axis_angle,
    euler_angles,
    from_quaternion,
    quaternion,
    rpy,
    rpy_of,
)
from dap3d_core.interface.formats.joint_inertia import LEAST, JointInertia
from dap3d_core.interface.formats.joint_motion import held
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Place, Remark, Remarks
from dap3d_core.interface.formats.solids import (
    balanced_inertia,
    inertia_moved,
    inertia_of_mesh,
    inertia_of_solid,
    total_inertia,
)
from dap3d_core.interface.formats.tendon_length import length_of_line
from dap3d_core.interface.formats.xml_tree import XmlElement, parse_xml
from dap3d_core.interface.types import INTERFACE_VERSION

__all__ = [
    "IDENTITY",
    "INTERFACE_VERSION",
    "LEAST",
    "NOWHERE",
    "FRICTION_DIRECTIONS",
    "UNBOUNDED",
    "WORLD",
    "Actuator",
    "Articulation",
    "Contact",
    "Coupling",
    "Drum",
    "Exporter",
    "FolderImporter",
    "FormatError",
    "Frame",
    "Geometry",
    "Importer",
    "Inertial",
    "Joint",
    "JointInertia",
    "Limits",
    "Link",
    "Place",
    "Remark",
    "Remarks",
    "ResultExporter",
    "Source",
    "Tendon",
    "XmlElement",
    "axis_angle",
    "balanced_inertia",
    "euler_angles",
    "from_quaternion",
    "held",
    "hookimpl",
    "inertia_moved",
    "inertia_of_mesh",
    "inertia_of_solid",
    "length_of_line",
    "parse_xml",
    "quaternion",
    "rpy",
    "rpy_of",
    "total_inertia",
]
