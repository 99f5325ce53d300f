"""A scene without the short ways of writing that other formats have not."""

from typing import Any

import attrs

from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import LIMITS, Element
from dap3d_core.scene.validate.validated_scene import Instance, ValidatedScene


def plain_scene(checked: ValidatedScene) -> Scene:
    """A copy of a valid scene with its poses as Euler parameters and its numbers in SI units.

    Elements that name the joint they act in have its bodies, points and axis in place of it.
    """
    scene = checked.scene.copy()
    for name, p in zip(checked.body_names, checked.p.tolist(), strict=True):
        body = scene.bodies[name]
        body.p, body.rpy, body.axis_angle = tuple(p), None, None
    for contact in checked.contacts:
        joint, _, end = contact.name.rpartition("_")
        if end in LIMITS and joint in scene.joints:
            scene.joints[joint].fields[end] = contact.values["bound"]
    rigid = [contact for contact in checked.contacts if contact.name in scene.forces]
    for elements, instances in (
        (scene.joints, checked.joints),
        (scene.forces, [*checked.forces, *rigid]),
    ):
        for instance in (i for i in instances if i.name in elements):  # joints bring others
            elements[instance.name] = _plain(elements[instance.name], instance, scene, checked)
    return scene


def _plain(element: Element, instance: Instance, scene: Scene, checked: ValidatedScene) -> Element:
    specs = specs_of(instance.type_info.type)
    fields = {
        name: _number(specs[name], value, instance.values.get(name)) if name in specs else value
        for name, value in element.fields.items()
    }
    for name, spec in specs.items():
        joint = scene.joints.get(str(fields.get(name)))
        if not spec.gives or joint is None:
            continue
        of_joint = {"body_i": None, "body_j": None, **joint.fields}
        for own, other in spec.gives.items():
            value = of_joint.get(other)
            if own.startswith("body_"):
                slot = instance.type_info.layout.slots.index(own[-1])
                value = ("ground", *checked.body_names)[instance.bodies[slot]]
            if value is not None:
                fields.setdefault(own, value)
    return attrs.evolve(element, fields=fields)


def _number(spec: FieldSpec, written: Any, value: Any) -> Any:
    """A number for a text such as "30 deg"; names stay."""
    is_text = type(written) is str and isinstance(value, float) and not spec.by_name
    return value if is_text else written
