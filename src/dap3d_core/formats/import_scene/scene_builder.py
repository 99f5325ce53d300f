"""A scene in the making, of an articulated model."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.import_scene.rigid_groups import RigidGroup
from dap3d_core.interface.formats.articulation import WORLD, Contact, Joint
from dap3d_core.interface.formats.frames import IDENTITY, Frame, from_quaternion
from dap3d_core.interface.formats.joint_inertia import JointInertia
from dap3d_core.interface.formats.remarks import Place, Remarks
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import GROUND, fault_of_name


@attrs.define
class Names:
    """The names taken in each table of a scene.

    Attributes:
        taken: table -> names.
        scene_names: (table, name in the file) -> name in the scene.
        places: (table, name in the scene) -> its place in the file.
    """

    taken: dict[str, set[str]] = attrs.Factory(dict)
    scene_names: dict[tuple[str, str], str] = attrs.Factory(dict)
    places: dict[tuple[str, str], Place] = attrs.Factory(dict)

    def of(self, table: str, name: str, place: Place, remarks: Remarks) -> str:
        """A name that the scene can have: the same one, or one made of it, which is remarked."""
        good = self.free(table, name)
        self.scene_names[table, name], self.places[table, good] = good, place
        if good != name:
            remarks.translate(place, f"{name!r} is called {good!r} in the scene")
        return good

    def free(self, table: str, name: str) -> str:
        """A name that the scene can have, or the first of NAME_2, ... that is free: it is taken."""
        taken, name = self.taken.setdefault(table, set()), usable(name)
        number, candidate = 1, name
        while candidate in taken:
            number += 1
            candidate = f"{name}_{number}"
        taken.add(candidate)
        return candidate


def usable(name: str) -> str:
    """A name that a scene can have: the same one, or one made of it."""
    good = "".join(c if c.isprintable() and c != "." else "_" for c in name.strip()) or "unnamed"
    return f"{good}_" if fault_of_name(good) else good


@attrs.define(eq=False)
class SceneBuilder:
    """A scene that is made of a model, and what its parts need to know of each other.

    Attributes:
        scene: the scene so far.
        remarks: of the import.
        member: link -> its group, and its frame in it.
        groups: by name.
        bodies: group -> name of its body.
        surfaces: how shapes meet others, but for their bits -> name of a material.
        names: names in the scene.
        inertia: the inertias that joints see.
        limits: what becomes of limits of joints: "off", "soft" or "hard".
    """

    scene: Scene
    remarks: Remarks
    groups: dict[str, RigidGroup]
    member: dict[str, tuple[str, Frame]]
    inertia: JointInertia
    limits: str
    names: Names = attrs.Factory(Names)
    bodies: dict[str, str] = attrs.Factory(dict)
    surfaces: dict[Contact, str] = attrs.Factory(dict)

    @property
    def takes_contacts(self) -> bool:
        """True where the method takes contacts, among them rigid limits and sticking friction."""
        return bool(self.scene.simulation.method != "joint")

    def pose_of(self, link: str) -> Frame:
        """The pose of a link where the scene starts."""
        name, frame = self.attached(link, IDENTITY)
        if name == GROUND:
            return frame
        body = self.scene.bodies[name]
        return Frame(body.r, from_quaternion(body.p)) @ frame

    def motion_of(self, link: str, at: Any) -> tuple[Floats, Floats]:
        """Velocity of a point of a link where the scene starts, and how the link turns."""
        name, frame = self.attached(link, Frame(at))
        if name == GROUND:
            return np.zeros(3), np.zeros(3)
        body = self.scene.bodies[name]
        v, w = (np.array(one or (0.0, 0.0, 0.0), dtype=float) for one in (body.r_dot, body.w))
        return v + np.cross(w, from_quaternion(body.p) @ frame.r), w

    def attached(self, link: str, frame: Frame) -> tuple[str, Frame]:
        """A frame of a link as body and frame in its axes at its mass centre."""
        group, in_group = self.member[link]
        fixed = in_group @ frame
        if group != WORLD:
            fixed = Frame(fixed.r - self.groups[group].inertial.com, fixed.A)
        return self.bodies[group], fixed

    def point_at(self, body: str, at: Floats, name: str) -> str:
        """A point of a body in its axes: its mass centre, or one of this name, which is added."""
        if not at.any():
            return f"{body}.O"
        return self.scene.add_point(self.names.free("points", name), body, float_tuple(at))

    def add_force(self, keyword: str, name: str, **fields: Any) -> None:
        """Add a force of this name, or of the first of NAME_2, ... that is free."""
        self.scene.add_force(keyword, self.names.free("forces", name), **fields)

    def add_joint(self, keyword: str, name: str, **fields: Any) -> None:
        """Add a joint; its name as of ``add_force``."""
        self.scene.add_joint(keyword, self.names.free("joints", name), **fields)

    def moves_alone(self, joint: Joint) -> bool:
        """True if a joint's two links are one body, so that it has no effect."""
        return self.member[joint.parent][0] == self.member[joint.child][0]


def float_tuple(vector: Any) -> tuple[float, ...]:
    """The components of a vector as a scene has them: Python's floats, zero without a sign."""
    return tuple(float(x) + 0.0 for x in vector)
