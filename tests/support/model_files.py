"""Mechanisms as files of SDF and MJCF, written from places in global axes.
A writer of its own, for tests of what reads such files."""

import attrs
import numpy as np
from scipy.spatial.transform import Rotation


@attrs.frozen
class Link:
    """A joint in the tree, or with ``closes`` one of a loop: a place and axes in global axes."""

    kind: str
    parent: str
    child: str
    at: tuple
    axes: tuple = ()
    k: float = 0.0
    c: float = 0.0
    closes: bool = False


def _words(numbers):
    return " ".join(repr(float(x)) for x in np.ravel(numbers))


def sdf(bodies, poses, joints):
    """The text of an SDF file: all poses are in the frame of the model."""
    lines = ['<sdf version="1.11"><world name="w"><gravity>0 0 -9.81</gravity><model name="m">']
    for name, body in bodies.items():
        o, A = poses[name]
        quat = Rotation.from_matrix(A).as_quat()
        moments = zip(("ixx", "iyy", "izz"), body.J, strict=True)
        lines += [
            f'<link name="{name}"><pose rotation_format="quat_xyzw">{_words([*o, *quat])}</pose>',
            f"<inertial><pose>{_words(body.com)} 0 0 0</pose><mass>{body.mass}</mass><inertia>",
            *(f"<{key}>{value!r}</{key}>" for key, value in moments),
            "</inertia></inertial></link>",
        ]
    for name, joint in joints.items():
        lines.append(f'<joint name="{name}" type="{joint.kind}"><parent>{joint.parent}</parent>')
        lines.append(f'<child>{joint.child}</child><pose relative_to="__model__">')
        lines.append(f"{_words(joint.at)} 0 0 0</pose>")
        for tag, axis in zip(("axis", "axis2"), joint.axes, strict=False):
            lines.append(f'<{tag}><xyz expressed_in="__model__">{_words(axis)}</xyz><dynamics>')
            lines.append(f"<damping>{joint.c}</damping><spring_stiffness>{joint.k}")
            lines.append(f"</spring_stiffness></dynamics></{tag}>")
        lines.append("</joint>")
    return "\n".join([*lines, "</model></world></sdf>"])


def mjcf(bodies, poses, joints):
    """The text of an MJCF file: nested bodies; loops are <connect>."""
    lines = ['<mujoco><compiler angle="radian"/><worldbody>']
    tree = [joint for joint in joints.values() if not joint.closes]

    def write(name, o, A):
        body, (here, axes) = bodies[name], poses[name]
        quat = np.roll(Rotation.from_matrix(A.T @ axes).as_quat(), 1)
        lines.append(f'<body name="{name}" pos="{_words(A.T @ (here - o))}" quat="{_words(quat)}">')
        lines.append(f'<inertial pos="{_words(body.com)}" mass="{body.mass}" '
                     f'diaginertia="{_words(body.J)}"/>')  # fmt: skip
        joint = next((one for one in tree if one.child == name), None)
        if joint is None:
            lines.append("<freejoint/>")
        else:
            kind = {"revolute": "hinge", "universal": "hinge", "prismatic": "slide"}[joint.kind]
            at = _words(axes.T @ (np.array(joint.at) - here))
            lines.extend(
                f'<joint type="{kind}" pos="{at}" axis="{_words(axes.T @ axis)}" '
                f'stiffness="{joint.k}" damping="{joint.c}"/>'
                for axis in joint.axes
            )
        for one in tree:
            if one.parent == name:
                write(one.child, here, axes)
        lines.append("</body>")

    roots = [n for n in bodies if all(j.child != n or j.parent == "world" for j in tree)]
    for name in roots:
        write(name, np.zeros(3), np.eye(3))
    lines.append("</worldbody><equality>")
    for name, joint in joints.items():
        if joint.closes:
            one, other = joint.parent, joint.child
            if one == "world":
                one, other = other, one
            here, axes = poses[one]
            ends = f'body1="{one}"' + (f' body2="{other}"' if other != "world" else "")
            anchor = _words(axes.T @ (np.array(joint.at) - here))
            lines.append(f'<connect name="{name}" {ends} anchor="{anchor}"/>')
    return "\n".join([*lines, "</equality></mujoco>"])
