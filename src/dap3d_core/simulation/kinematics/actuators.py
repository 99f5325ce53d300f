"""Actuators of inverse dynamics: drivers and force elements, as wrenches on the bodies."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.force_output import ForceLoops, group_of
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.kinematics.driver_coordinate import driver_names


@attrs.frozen(eq=False)
class DriverActuator:
    """A driver, whose force takes the place of its multiplier: it holds no position any more.

    The force is that on a body, N, or the moment, N m, however long the row of the driver is: that
    of a driven leg is d, not a unit vector.

    Attributes:
        name: of the joint.
        row: its constraint row.
    """

    name: str
    row: int

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of a force or moment of one; D: (rows, 6 n)."""
        return np.asarray(D[self.row] / self.size(D))

    def size(self, D: Floats) -> float:
        """The force, or moment, of a multiplier of one; 1 where it does nothing."""
        forces, moments = D[self.row].reshape(-1, 2, 3).transpose(1, 0, 2)
        sizes = np.linalg.norm(forces if forces.any() else moments, axis=1)
        return float(sizes.max()) or 1.0

    def unit(self, D: Floats) -> str:
        """Unit of its force: N of a row that holds translations."""
        return "N" if D[self.row].reshape(-1, 6)[:, :3].any() else "N m"

    given = 0.0

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J: none."""
        return 0.0


class ForceActuator:
    """A force element; what its type ``actuates`` is its force.

    Attributes:
        name: of the element.
        given: the force in the scene.
    """

    def __init__(self, evaluator: Evaluator, name: str, group: Group, index: int) -> None:
        self.name, self._group, self._evaluator = name, group, evaluator
        self._loops = ForceLoops(evaluator, group, index)
        self._field = field_of(group)
        offset, shape = group.type_info.layout.numbers[self._field]
        numbers = group.numbers[index, offset : offset + (shape[0] if shape else 1)]
        self.given = float(np.linalg.norm(numbers)) if shape else float(numbers[0])
        self.has_direction = not shape or self.given > 0.0

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of an actuation of one, at the bodies as placed."""
        return np.asarray(self._at(t, "wrench", 1.0) - self._at(t, "wrench", 0.0))[6:]

    def unit(self, D: Floats) -> str:
        """Unit of its force: that of the field."""
        return specs_of(self._group.type_info.type)[self._field].unit or "SI"

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J, at the bodies as placed."""
        if not self._loops.has("energy"):
            return 0.0
        one, none = (self._at(0.0, "energy", x)[0] for x in (self.given, 0.0))
        return float(one - none)

    def _at(self, t: float, kind: str, force: float) -> Floats:
        self._loops.parameters.scale_field(self._group, self._field, force)
        out = np.zeros_like(self._evaluator.system.force) if kind == "wrench" else np.zeros(1)
        self._loops.call(kind, t, out)
        return out


Actuator = DriverActuator | ForceActuator


def actuators_of(
    compiled: CompiledModel, evaluator: Evaluator, names: Sequence[str] | str | None
) -> list[Actuator]:
    """The actuators that are named, in their order; None: all drivers.

    Raises:
        SceneError: there is none of a name, or it cannot be an actuator.
    """
    drivers, forces = driver_names(compiled), _actuating_forces(evaluator)
    if names is None:
        names = drivers
    elif isinstance(names, str):
        names = [names]
    if not names and not evaluator.model.contact_count:
        words = "name the actuators whose forces produce the motion"
        remedy = "add drivers, or force elements such as a point-to-point actuator, to the scene"
        if drivers or forces:
            remedy = f"there can be {', '.join([*drivers, *forces])}"
        raise SceneError([Mistake("actuators", [], words, remedy=remedy)])
    found: list[Actuator] = []
    mistakes: list[Mistake] = []
    for name in names:
        if name in [actuator.name for actuator in found]:
            mistakes.append(Mistake("actuators", name, "is named twice"))
        elif name in drivers:
            found.append(_driver(evaluator, name))
        elif name in forces:
            force = ForceActuator(evaluator, name, *forces[name])
            scene, field = compiled.scene, field_of(forces[name][0])
            given = scene.forces[name].fields.get(field)
            if isinstance(given, str) and given in {*scene.functions, *scene.inputs}:
                words = f"its {field} is that of {given}, which an actuator does not set"
                mistakes.append(Mistake("actuators", name, words, remedy=f"give {field} = 0.0"))
            elif not force.has_direction:
                words = "its vector is zero, so it has no direction to act in"
                mistakes.append(Mistake("actuators", name, words, remedy="give it one"))
            found.append(force)
        else:
            mistakes.append(_unknown(compiled, name, [*drivers, *forces]))
    if mistakes:
        raise SceneError(mistakes)
    return found


def _driver(evaluator: Evaluator, name: str) -> DriverActuator:
    model = evaluator.model
    return DriverActuator(name, int(model.joint_start[model.joint_names.index(name)]))


def _actuating_forces(evaluator: Evaluator) -> dict[str, tuple[Group, int]]:
    """Force elements that can be actuators, with their groups and places there."""
    found = {}
    for k, name in enumerate(evaluator.model.force_names):
        try:
            group, index = group_of(evaluator, name, k)
        except UnknownNameError:
            continue
        if field_of(group):
            found[name] = group, index
    return found


def field_of(group: Group) -> str:
    """The field that the type of a group ``actuates``, or ""."""
    return str(getattr(group.type_info.type, "actuates", ""))


def _unknown(compiled: CompiledModel, name: Any, known: list[str]) -> Mistake:
    near = nearest(name, known) if isinstance(name, str) else ""
    remedy = "" if near else f"actuators: {', '.join(known)}" if known else ""
    scene = compiled.scene
    if name in scene.joints:
        words = "this joint is no driver: what it bears is found as its reaction"
    elif name in scene.forces:
        words = f"a force of type {scene.forces[name].type} has nothing that an actuator sets"
    else:
        words = "there is no driver and no force of this name"
    return Mistake("actuators", name, words, near, remedy)
