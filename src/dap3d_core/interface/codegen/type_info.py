"""A type that passed its examination, with everything its group loops are generated from."""

from collections.abc import Callable, Mapping
from typing import Any

import attrs

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.codegen.kernel_arguments import KernelArgument
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import TypeBase


@attrs.frozen
class TypeInfo:
    """A type that passed, with what its loops are generated from.

    Attributes:
        type: the class.
        layout: storage of its instances.
        names: every name its kernels may use.
        outputs: kernel -> expressions of its numbers in the order of their shape.
        kernels: its pure functions.
        variants: types that replace it: (values of fields, the type).
        argument_functions: its function fields of another argument than time.
        friction_joint: of a force that acts by the friction of a joint, the field that names the
            joint; "" for all others.
        given: the types of its functions of an argument, for titles.
        derived: kernels derived from others.
        terms: of a function that combines functions, the types of those.
    """

    type: type[TypeBase]
    layout: InstanceLayout
    names: dict[str, KernelArgument]
    outputs: dict[str, tuple[str, ...]]
    kernels: dict[str, Callable[..., Any]]
    variants: tuple[tuple[Mapping[str, Any], "TypeInfo"], ...] = ()
    argument_functions: tuple[str, ...] = ()
    friction_joint: str = ""
    given: str = ""
    derived: tuple[str, ...] = ()
    terms: tuple["TypeInfo", ...] = ()

    def chosen(self, values: Mapping[str, Any]) -> "TypeInfo":
        """The variant for the values of an instance's fields; itself where none fits."""
        specs = specs_of(self.type)

        def holds(name: str, wanted: Any) -> bool:
            value = values[name]
            is_reference = specs[name].kind in ("function", "input")
            return (value is not None) == wanted if is_reference else bool(value == wanted)

        for conditions, type_info in self.variants:
            if all(holds(name, wanted) for name, wanted in conditions.items()):
                return type_info
        return self
