"""The coordinate of a driver in place of time: ``crank_motor.q=0:6.28:200``."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import Mistake, Scene, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel

#: Name behind that of a driver, and the forms of ``over``.
COORDINATE = "q"
FORMS = "DRIVER.q=from:to:count, such as motor.q=0:6.28:200, or {'motor.q': values}"
#: Type and coefficients of the function f(x) = x.
IDENTITY = "a", [0.0, 1.0, 0.0]
MOST_VALUES = 1_000_000


@attrs.frozen(eq=False)
class DriverCoordinate:
    """A driver whose coordinate a mechanism is moved over.

    Attributes:
        driver: name of the joint.
        values: (nt,) values of the coordinate, rising or falling: how far the driver has moved from
            the poses as given, rad or m.
        field: of the driver, that names its coordinate as a function of time.
        replaced: fields that may be given in its place.
    """

    driver: str
    values: Floats
    field: str = "function"
    replaced: tuple[str, ...] = ()

    def replaced_in(self, scene: Scene) -> Scene:
        """A copy of a scene whose driver moves by f(x) = x: time is its coordinate."""
        scene = scene.copy()
        name = f"{self.driver}_q"
        while name in scene.functions:
            name += "_"
        kind, coefficients = IDENTITY
        scene.add_function(kind, name, coeff=coefficients)
        fields = scene.joints[self.driver].fields
        before, fields[self.field] = fields.get(self.field), name
        for other in self.replaced:
            fields.pop(other, None)
        users = (part.fields for part in (*scene.joints.values(), *scene.forces.values()))
        if before is not None and all(before not in map(str, used.values()) for used in users):
            del scene.functions[before]
        return scene


def driver_names(compiled: CompiledModel) -> list[str]:
    """Names of the drivers of a scene."""
    return [joint.name for joint in compiled.checked.joints
            if getattr(joint.type_info.type, "drives", False)]  # fmt: skip


def read_coordinate(over: Any, compiled: CompiledModel) -> DriverCoordinate:
    """What ``over`` names.

    Raises:
        SceneError: it is no driver of the scene, or its values are none.
    """
    label, values = _parsed(over)
    name, _, what = label.partition(".")
    drivers = driver_names(compiled)
    if name not in drivers:
        raise SceneError([_no_driver(over, name, drivers, compiled)])
    if what not in ("", COORDINATE):
        words = f"the coordinate of a driver is called {COORDINATE}"
        raise SceneError([Mistake("over", over, words, f"{name}.{COORDINATE}")])
    (driver,) = (joint for joint in compiled.checked.joints if joint.name == name)
    specs = specs_of(driver.type_info.type)
    field = next((n for n, spec in specs.items() if spec.by_name), "function")
    replaced = tuple(n for n, spec in specs.items() if field in spec.instead_of)
    return DriverCoordinate(name, values, field, replaced)


def _no_driver(over: Any, name: str, drivers: list[str], compiled: CompiledModel) -> Mistake:
    if not drivers:
        remedy = "add a driver joint, whose function the coordinate replaces"
        return Mistake("over", over, "the scene has no driver", remedy=remedy)
    joints = {joint.name: frozenset(joint.bodies) for joint in compiled.checked.joints}
    if name in joints:
        same = [driver for driver in drivers if joints[driver] == joints[name]]
        words = f"joint {name} is no driver"
        if same:
            near = f"{same[0]}.{COORDINATE}"
            return Mistake("over", over, f"{words}; {same[0]} drives its bodies", near)
        return Mistake("over", over, words, remedy=f"drivers: {', '.join(drivers)}")
    near = nearest(name, drivers)
    remedy = "" if near else f"drivers: {', '.join(drivers)}"
    near = f"{near}.{COORDINATE}" if near else ""
    return Mistake("over", over, f"there is no driver {name!r}", near, remedy)


def _parsed(over: Any) -> tuple[str, Floats]:
    """The name and the values."""
    if isinstance(over, Mapping) and len(over) == 1:
        ((label, given),) = over.items()
        try:
            values = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            values = np.zeros(0)
    elif isinstance(over, str):
        label, _, text = over.partition("=")
        values = _range(text)
    else:
        raise SceneError([Mistake("over", over, f"should be {FORMS}")])
    steps = np.diff(values) if values.ndim == 1 else np.zeros(1)
    good = values.ndim == 1 and len(values) > 1 and np.all(np.isfinite(values))
    if not (isinstance(label, str) and good and (np.all(steps > 0.0) or np.all(steps < 0.0))):
        words = "its values are two or more finite numbers that rise, or that fall"
        raise SceneError([Mistake("over", over, words, remedy=f"write {FORMS}")])
    return label.strip(), values


def _range(text: str) -> Floats:
    """from:to:count as numbers; none where it is not of that form."""
    try:
        first, last, count = text.split(":")
        number = int(count)
        return np.linspace(float(first), float(last), number if 2 <= number <= MOST_VALUES else 0)
    except ValueError:
        return np.zeros(0)
