"""``export_model``: a scene as a model of another program."""

import os
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.export_scene.articulation import articulation_of
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.formats import (
    NOWHERE,
    Articulation,
    FormatError,
    Geometry,
    Remark,
    Remarks,
    ResultExporter,
)
from dap3d_core.kernels.runtime.sealed_files import replace_file
from dap3d_core.registry import Registry, load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.extensions import extensions
from dap3d_core.scene import Scene, SceneError, check, load
from dap3d_core.scene.errors import MISSING, Mistake
from dap3d_core.scene.tables import LIMITS, Element
from dap3d_core.scene.validate.validated_scene import Instance, ValidatedScene


@attrs.frozen
class ExportReport:
    """The report of an export of a scene.

    Attributes:
        format: the exporter's keyword.
        text: of the file.
        translated: contents that the format says in another way.
        left_out: contents that it cannot say.
    """

    format: str
    text: str
    translated: tuple[Remark, ...]
    left_out: tuple[Remark, ...]


@checked
def export_model(
    scene: Scene | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    format: str,
    strict: bool = False,
    force: bool = False,
    registry: Registry | None = None,
) -> ExportReport:
    """Write a scene as a model of another program: URDF, MJCF, or a format of a plugin.

    Args:
        scene: the scene; or its name, folder or file.
        path: the file; None writes none. Files of meshes are named from its folder, and without
            it from that of the scene.
        format: keyword of an exporter.
        strict: refuse a scene of which something would be left out.
        force: overwrites an existing file.
        registry: the installed types; by default all.

    Raises:
        SceneError: the scene is invalid, or the format cannot say its mechanism.
        PluginError: there is no such exporter, or it is broken.
        OSError: the file cannot be written, or exists and ``force`` is off.
    """
    exporter = extensions("exporter").load(format)()
    if isinstance(exporter, ResultExporter):
        raise PluginError(f"{format} is a format of results, which dap.export writes")
    given = scene if isinstance(scene, Scene) else load(scene)
    valid = check(given, load_registry() if registry is None else registry)
    remarks = Remarks()
    if not (np.array_equal(valid.r, valid.r_0) and np.array_equal(valid.p, valid.p_0)):
        what = "the poses at the start: bodies are where coordinates of joints are zero"
        remarks.leave_out(NOWHERE, what, motion=True)
    try:
        model = articulation_of(_plain_scene(valid), remarks)
        if path is not None and given.path is not None:
            model = _beside(model, Path(given.path).parent, Path(path).parent)
        text = exporter.write(model, remarks)
    except FormatError as error:
        mistake = Mistake("", MISSING, f"{format}: {error.what}", remedy=error.remedy)
        raise SceneError([mistake]) from None
    if strict and remarks.left_out:
        raise SceneError(
            Mistake("", MISSING, f"{one.text}: it would be left out") for one in remarks.left_out
        )
    if path is not None:
        if not force and os.path.exists(path):
            raise FileExistsError(f"{path} exists; force overwrites it")
        replace_file(Path(path), text.encode("utf-8"))
    return ExportReport(format, text, remarks.translated, remarks.left_out)


def _beside(model: Articulation, scene: Path, target: Path) -> Articulation:
    """The same model with files of meshes as they are named from another folder."""

    def named(one: Geometry) -> Geometry:
        if one.kind != "mesh":
            return one
        try:
            mesh = os.path.relpath(os.path.abspath(scene / one.mesh), os.path.abspath(target))
        except ValueError:  # on another drive
            mesh = os.path.abspath(scene / one.mesh)
        return attrs.evolve(one, mesh=Path(mesh).as_posix())

    for link in model.links.values():
        link.geometries = [named(one) for one in link.geometries]
    return model


def _plain_scene(checked: ValidatedScene) -> Scene:
    """A copy of a valid scene in its reference poses, as Euler parameters, and in SI units.

    Elements that name the joint they act in have its bodies, points and axis in place of it.
    """
    scene = checked.scene.copy()
    poses = zip(checked.r_0.tolist(), checked.p_0.tolist(), strict=True)
    for name, (r, p) in zip(checked.body_names, poses, strict=True):
        body = scene.bodies[name]
        body.r, body.p, body.rpy, body.axis_angle = tuple(r), tuple(p), None, None
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
