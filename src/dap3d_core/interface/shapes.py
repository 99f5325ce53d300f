"""Kinds of shapes that packages bring: solids of their own, as triangles."""

from typing import Any, ClassVar

import attrs
import pluggy

from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.hooks import PROJECT

#: Kinds of fields that a shape may have, and keys of a scene that no field may take.
KINDS = ("number", "numbers", "vec3", "matrix", "table", "choice")
RESERVED = ("type", "body", "at", "p", "color")

hookspec = pluggy.HookspecMarker(PROJECT)


class ShapeKind:
    """A kind of shape: fields of numbers and words, and the triangles that they make.

    A scene gives ``body``, ``at``, ``p`` and ``color`` besides, as for a box.

    Attributes:
        keyword: the value of ``type`` in [shapes.NAME], and the name of the entry point.
    """

    keyword: ClassVar[str] = ""

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        attrs.define(cls, slots=False, kw_only=True)

    @classmethod
    def check(cls) -> None:
        """Check the fields.

        Raises:
            PluginError: names the field.
        """
        for name, spec in specs_of(cls).items():
            if name in RESERVED:
                raise PluginError(
                    f"{where_is(cls)} has a field {name}, which every shape has; take another name"
                )
            if spec.kind not in KINDS or not spec.given:
                raise PluginError(
                    f"{where_is(cls)}.{name} is a field {spec.kind}; a shape has {', '.join(KINDS)}"
                )

    def mesh(self) -> tuple[Any, Any]:
        """Vertices (k, 3), m, in the axes of the shape, and triangles (m, 3), seen from outside.

        Raises:
            ValueError: these values make no solid; its words are shown.
        """
        raise NotImplementedError


@hookspec
def dap3d_shapes() -> list[type[ShapeKind]]:
    """The kinds of shapes of a module: a list of subclasses of ``ShapeKind``."""
    raise NotImplementedError
