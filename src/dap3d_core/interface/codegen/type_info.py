"""A type that passed its examination, with everything its group loops are generated from."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import attrs

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, parameters
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import TypeBase

#: Fields that name nothing.
NONE: Mapping[str, str] = MappingProxyType({})


@attrs.frozen
class JointOfForce:
    """A joint whose reaction a force reads (reactions.py).

    Attributes:
        field: the force's field that names it.
        type_info: the type of the joint.
        integers, numbers: where its integers and numbers begin among those of the force.
    """

    field: str
    type_info: "TypeInfo"
    integers: int
    numbers: int

    @property
    def rows(self) -> int:
        """Number of its multipliers."""
        return self.type_info.row_count


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
        joints: of a force, the joints whose reactions it reads, once a scene has named them.
        terms: of a function that combines functions, the types of those.
        loops: its loops that were compiled, by what they compute.
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
    joints: tuple[JointOfForce, ...] = ()
    terms: tuple["TypeInfo", ...] = ()
    loops: dict[Any, Any] = attrs.field(factory=dict, init=False, eq=False, repr=False)

    @property
    def row_count(self) -> int:
        """Rows of a joint that constrain the bodies; 0 of other types."""
        return int(getattr(self.type, "rows", 0)) - len(self.layout.unknowns)

    @property
    def axis_slots(self) -> tuple[str, ...]:
        """Slots whose body's axes it uses: as declared, or those whose A or p its kernels name."""
        if self.type.body_axes is not None:
            return self.type.body_axes
        types = (self, *(type_info for _, type_info in self.variants))
        kernels = [kernel for t in types for kernel in t.kernels.values()]
        kernels += [k for t in types for n in t.type.declared if (k := getattr(t.type, n, None))]
        named = {name for kernel in kernels for name in parameters(kernel)}
        return tuple(s for s in self.layout.slots if {f"A_{s}", f"p_{s}"} & named)

    def chosen(self, values: Mapping[str, Any], named: Mapping[str, str] = NONE) -> "TypeInfo":
        """The variant for the values of an instance's fields; itself where none fits.

        named: of fields that name a function or an input, which of these.
        """
        specs = specs_of(self.type)

        def holds(name: str, wanted: Any) -> bool:
            if wanted in specs[name].by_name:
                return bool(named.get(name) == wanted)
            value = values[name]
            is_given = value is not None
            return is_given == wanted if specs[name].asks_presence else bool(value == wanted)

        for conditions, type_info in self.variants:
            if all(holds(name, wanted) for name, wanted in conditions.items()):
                return type_info
        return self
