"""The hooks of plugins, which return lists of classes."""

import pluggy

from dap3d_core.interface.contacts.contact import Contact
from dap3d_core.interface.types import Force, Function, Joint, TypeBase

PROJECT = "dap3d"

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def dap3d_joints() -> list[type[Joint]]:
    """The joint types of a module: a list of subclasses of ``Joint``."""
    raise NotImplementedError


@hookspec
def dap3d_forces() -> list[type[Force]]:
    """The force types of a module: a list of subclasses of ``Force``."""
    raise NotImplementedError


@hookspec
def dap3d_functions() -> list[type[Function]]:
    """The function types of a module: a list of subclasses of ``Function``."""
    raise NotImplementedError


@hookspec
def dap3d_contacts() -> list[type[Contact]]:
    """The contact types of a module: a list of subclasses of ``Contact``."""
    raise NotImplementedError


#: Base class of each kind.
KINDS: dict[str, type[TypeBase]] = {
    "joint": Joint,
    "force": Force,
    "function": Function,
    "contact": Contact,
}
#: Entry-point group and hook of each kind.
GROUPS = {
    "joint": ("dap3d.joints", "dap3d_joints"),
    "force": ("dap3d.forces", "dap3d_forces"),
    "function": ("dap3d.functions", "dap3d_functions"),
    "contact": ("dap3d.contacts", "dap3d_contacts"),
}
#: The same of what no type is, whose hooks lie in modules of their own: most scenes need none.
EXTENSIONS = {
    "importer": ("dap3d.importers", "dap3d_importers"),
    "exporter": ("dap3d.exporters", "dap3d_exporters"),
    "integrator": ("dap3d.integrators", "dap3d_integrators"),
    "shape": ("dap3d.shapes", "dap3d_shapes"),
}
