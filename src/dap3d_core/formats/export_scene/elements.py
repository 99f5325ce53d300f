"""Bodies and joints of a scene with their frames, for export."""

from math import inf
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.interface.formats.articulation import WORLD, Actuator, Articulation, Joint
from dap3d_core.interface.formats.frames import Frame, from_quaternion
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Remarks
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import GROUND, Element

#: Type of a joint of a scene -> kind of a joint of a model.
KINDS = {"rev": "revolute", "tran": "prismatic", "sph": "ball", "cyl": "cylindrical",
         "univ": "universal"}  # fmt: skip
#: Parallel axes and points on a line, up to this.
ALIGNED = 1e-9

#: Kind of a joint -> the type of force, in axes of its body, that acts on its coordinate.
TYPES = {"revolute": "np", "prismatic": "fp"}


class SceneBody(NamedTuple):
    """Mass, inertia in body axes, and pose of the mass centre."""

    mass: float
    inertia: Floats
    pose: Frame


@attrs.frozen(eq=False)
class SceneJoint:
    """A joint with its points as frames of its bodies, and its axes in the axes of body i."""

    name: str
    kind: str
    body_i: str
    body_j: str
    on_i: Frame
    on_j: Frame
    axes: tuple[Floats, ...]
    turn: Floats  # the rotation of body j in the axes of body i

    def reversed(self) -> "SceneJoint":
        """The same joint with its bodies exchanged; coordinates keep their sense."""
        axes = tuple(-self.turn.T @ axis for axis in self.axes)
        return attrs.evolve(self, body_i=self.body_j, body_j=self.body_i, on_i=self.on_j,
                            on_j=self.on_i, axes=axes, turn=self.turn.T)  # fmt: skip


@attrs.define(eq=False)
class Rotor:
    """A wheel on ground, and the joints that turn with it: (name of a follower, its fields)."""

    inertia: float
    followers: list[tuple[str, dict[str, Any]]] = attrs.Factory(list)


@attrs.define(eq=False)
class SceneElements:
    """The elements of a scene.

    Attributes:
        bodies: by name, ground included, wheels left out.
        joints: of kinds that a model has.
        rotors: wheels of followers, by name.
    """

    scene: Scene
    bodies: dict[str, SceneBody] = attrs.Factory(dict)
    joints: list[SceneJoint] = attrs.Factory(list)
    rotors: dict[str, Rotor] = attrs.Factory(dict)

    @classmethod
    def of(cls, scene: Scene) -> "SceneElements":
        """The elements of a valid scene.

        Raises:
            FormatError: a joint has no counterpart.
        """
        elements = cls(scene)
        elements.bodies[GROUND] = SceneBody(0.0, np.zeros((3, 3)), Frame())
        for name, body in scene.bodies.items():
            given = (1.0, 1.0, 1.0) if body.Jp is None else body.Jp
            J = np.asarray(given, dtype=float)
            pose = Frame(body.r, from_quaternion(body.p))
            mass = 1.0 if body.mass is None else float(body.mass)
            elements.bodies[name] = SceneBody(mass, np.diag(J) if J.ndim == 1 else J, pose)
        elements._read_joints()
        for name in elements.rotors:
            del elements.bodies[name]
        return elements

    def point(self, name: str) -> tuple[str, Floats]:
        """The body of a point, and its coordinates."""
        body, dot, tail = name.rpartition(".")
        if dot and tail == "O":
            return body, np.zeros(3)
        point = self.scene.points[name]
        return str(point.body), np.asarray(point.sPp, dtype=float)

    def at(self, name: str) -> Floats:
        """A point in global axes."""
        body, s = self.point(name)
        pose = self.bodies[body].pose
        return np.asarray(pose.r + pose.A @ s)

    def vector(self, name: str) -> tuple[str, Floats]:
        """The body of a vector, and its direction."""
        body, dot, tail = name.rpartition(".")
        if dot and tail in ("x", "y", "z"):
            return body, np.eye(3)["xyz".index(tail)]
        vector = self.scene.vectors[name]
        sp = np.asarray(vector.sp, dtype=float)
        return str(vector.body), sp / np.linalg.norm(sp)

    def ends(self, fields: dict[str, Any]) -> tuple[str, str]:
        """The points of an element, also of a vector of type 2."""
        if "d" in fields:
            d = self.scene.vectors2[fields["d"]]
            return str(d.P_i), str(d.P_j)
        return fields["P_i"], fields["P_j"]

    def turn(self, of: str, other: str) -> Floats:
        """The rotation of body ``other`` in the axes of body ``of``."""
        return np.asarray(self.bodies[of].pose.A.T @ self.bodies[other].pose.A)

    def _read_joints(self) -> None:
        joints = self.scene.joints
        wheels = {self.vector(e.fields["a_k"])[0] for e in joints.values() if e.type == "follow"}
        locks = {
            self.ends(e.fields): name for name, e in joints.items()
            if e.type == "drive-tran" and "function" not in e.fields and "P_i" in e.fields
        }  # fmt: skip
        for name, element in joints.items():
            if element.type == "follow":
                wheel = self.vector(element.fields["a_k"])[0]
                inertia = float(self.bodies[wheel].inertia[2, 2])
                rotor = self.rotors.setdefault(wheel, Rotor(inertia))
                rotor.followers.append((name, element.fields))
            elif element.type in ("fix", "weld"):
                self._fixed(element)
            elif element.type == "drive-tran" and name in locks.values():
                continue
            elif element.type in KINDS:
                joint = self._joint(element)
                if joint.body_i in wheels or joint.body_j in wheels:
                    continue
                if element.type == "tran" and self.ends(element.fields) in locks:
                    joint = attrs.evolve(joint, kind="fixed")
                self.joints.append(joint)
            else:
                raise FormatError(f"joint {name}: no joint of a model is of type {element.type!r}")

    def _fixed(self, element: Element) -> None:
        body, other = str(element.fields["body_i"]), str(element.fields.get("body_j", GROUND))
        there = self.bodies[other].pose.inverse() @ self.bodies[body].pose
        self.joints.append(SceneJoint(element.name, "fixed", body, other, Frame(), Frame(there.r),
                                      (), self.turn(body, other)))  # fmt: skip

    def _joint(self, element: Element) -> SceneJoint:
        fields = element.fields
        (i, r_i), (j, r_j) = (self.point(end) for end in self.ends(fields))
        turn = self.turn(i, j)
        axes: tuple[Floats, ...]
        if element.type == "univ":  # the arm on the parent, then that on the child
            axes = (turn @ self.vector(fields["n_j"])[1], self.vector(fields["a_i"])[1])
        elif element.type == "sph":
            axes = ()
        elif "a_i" in fields:
            axes = (self.vector(fields["a_i"])[1],)
        else:
            axes = (turn @ self.vector(fields["a_j"])[1],)
        return SceneJoint(element.name, KINDS[str(element.type)], i, j, Frame(r_i), Frame(r_j),
                          axes, turn)  # fmt: skip


def leave_out(remarks: Remarks, element: Element, why: str, *, motion: bool = True) -> None:
    """Remark that an element of a scene is left out."""
    remarks.leave_out(NOWHERE, f"{element.name} of type {element.type}: {why}", motion=motion)


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


def add_actuators(builder: ModelBuilder, scene: Scene) -> set[str]:
    """Add inputs that are factors of forces on the coordinate of one joint, and forces actuator.

    Returns:
        the names of these forces.
    """
    taken: set[str] = set()
    for name, given in scene.inputs.items():
        users = [e for e in (*scene.forces.values(), *scene.joints.values())
                 if e.fields.get("input") == name]  # fmt: skip
        for joint in builder.elements.joints:
            gear = _gear(builder, joint, users)
            if gear:
                actuator = Actuator(name, joint.name, gear, control=_bounds(users[0], "input"))
                builder.model.actuators.append(actuator)
                taken |= {element.name for element in users}
                if given.value:
                    text = f"the value of input {name} at the start"
                    builder.remarks.leave_out(NOWHERE, text, motion=True)
                break
    for element in scene.forces.values():
        if element.type == "actuator" and element.fields["control"] in scene.inputs:
            moved = builder.placed.get(str(element.fields.get("joint")))
            if moved is not None and moved.kind in TYPES and not moved.closes:
                builder.model.actuators.append(_actuator(element, moved.name))
                taken.add(element.name)
    return taken


def _actuator(element: Element, joint: str) -> Actuator:
    """A force actuator of a joint, which counts its coordinate from the poses of the scene, too."""
    number = {"gain": 1.0, "time": 1.0} | {
        key: float(x) for key, x in element.fields.items() if isinstance(x, float | int)
    }
    kind = element.fields.get("activation", "none")
    return Actuator(
        str(element.fields["control"]), joint, number["gain"], bias=number.get("bias", 0.0),
        stiffness=number.get("k", 0.0), damping=number.get("c", 0.0),
        control=_bounds(element, "control"), force=_bounds(element, "force"),
        active=_bounds(element, "activation"), time=number["time"],
        activation="" if kind == "none" else str(kind),
    )  # fmt: skip


def _bounds(element: Element, name: str) -> tuple[float, float]:
    """NAME_min and NAME_max of an element, infinite where it has none."""
    low, high = (element.fields.get(f"{name}_{end}") for end in ("min", "max"))
    return -inf if low is None else float(low), inf if high is None else float(high)


def _gear(builder: ModelBuilder, joint: SceneJoint, users: list[Element]) -> float:
    """Force on the coordinate of a joint for an input of 1; 0.0 if that is not what acts."""
    if joint.kind not in TYPES or builder.placed[joint.name].closes:
        return 0.0
    type_ = TYPES[joint.kind]
    point = builder.elements.point
    acting = {point(_point_of(e))[0]: e for e in users if e.type == type_}
    moving = [one for one in (joint, joint.reversed()) if one.body_i != GROUND]
    if len({_bounds(e, "input") for e in users}) > 1:
        return 0.0
    if len(acting) != len(users) or acting.keys() != {one.body_i for one in moving}:
        return 0.0
    forces = [np.asarray(acting[one.body_i].fields[type_], dtype=float) for one in moving]
    gear = float(forces[0] @ moving[0].axes[0])
    apart = max(np.abs(f - gear * one.axes[0]).max() for f, one in zip(forces, moving, strict=True))
    if apart > ALIGNED * abs(gear):
        return 0.0
    if type_ == "fp":  # on one line
        places = [builder.elements.at(_point_of(acting[one.body_i])) for one in moving]
        axis = builder.elements.bodies[moving[0].body_i].pose.A @ moving[0].axes[0]
        if np.abs(np.cross(places[-1] - places[0], axis)).max() > ALIGNED:
            return 0.0
    return gear


def _point_of(element: Element) -> str:
    """The point at which a force acts."""
    return str(element.fields.get("P_i") or f"{element.fields['body_i']}.O")
