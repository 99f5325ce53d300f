"""Elements and attributes of URDF, and what becomes of them."""

from dap3d_formats.element_table import (
    Table,
    first_counts,
    moves,
    noted,
    refused,
    taken,
    translated,
)

_CONTACT = "contact properties; bodies do not touch each other"

URDF: Table = {
    "robot": taken("name") | noted("version", "the version of the format"),
    "link": taken("name") | noted("type", "the type of a link has no effect"),
    "inertial": taken(),
    "origin": taken("xyz rpy quat_xyzw")
    | refused("rotation_format", "SDF has it; give rpy, or quat_xyzw in version 1.1"),
    "mass": taken("value"),
    "inertia": taken("ixx ixy ixz iyy iyz izz"),
    "visual": taken() | translated("name", "shapes are named after their link"),
    "collision": translated("", "drawn where a link has no visual")
    | translated("name group", "shapes are named after their link"),
    "geometry": taken(),
    "box": taken("size"),
    "sphere": taken("radius"),
    "cylinder": taken("radius length"),
    "capsule": taken("radius length"),
    "mesh": taken("filename scale"),
    "material": taken("name"),
    "color": translated("", "without its opacity") | taken("rgba"),
    "texture": noted("", "textures are not drawn"),
    "verbose": noted("", "no effect"),
    "contact": moves("", _CONTACT),
    "contact_coefficients": moves("", _CONTACT),
    "self_collision_checking": moves("", _CONTACT),
    "joint": taken("name type"),
    "parent": taken("link"),
    "child": taken("link"),
    "axis": taken("xyz"),
    "dynamics": taken("damping")
    | translated("friction", "it sticks; with method joint it fades at low rates"),
    "limit": translated("", "stops, with --limits soft, hard or off") | taken("lower upper")
    | noted("effort velocity", "limits of forces and speeds are those of a controller"),
    "mimic": translated("", "a joint follow of the same rates, and the start by ratio and offset")
    | taken("joint multiplier offset"),
    "calibration": noted("", "reference positions of encoders"),
    "safety_controller": noted("", "limits of a controller"),
    "constraint": translated("", "a joint that closes a loop") | taken("name type"),
    "child_origin": taken("xyz rpy quat_xyzw"),
    "loop_joint": moves("", "closes a loop; <constraint> is read"),
    "drake:joint": moves("", "types of Drake; its links hang from nothing"),
    "transmission": moves("", "motors and gears; add forces of your own"),
    "gazebo": noted("", "settings of a simulator"),
    "ros2_control": noted("", "settings of a controller"),
    "sensor": noted("", "sensors"),
    "mujoco": noted("", "settings of a compiler"),
}  # fmt: skip

#: What becomes of elements that the format has once, as its library reads them.
FURTHER = first_counts("link", "joint", "material", "visual", "collision", "constraint")
