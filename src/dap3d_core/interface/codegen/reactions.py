"""Reactions of joints as arguments of forces: names of ``joint()`` fields, and their code.

A force whose ``wrench`` names them becomes one of the loops that depend on multipliers, like the
friction of joints (formulations/common/friction.py). The integers and numbers of the joints follow
those of the force, so that its loop calls their ``J``: reactions are at hand as the multipliers
change, and have derivatives by the poses of all bodies.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import attrs

from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, in_order, parameters
from dap3d_core.interface.codegen.type_info import JointOfForce, TypeInfo
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.types import TypeBase

#: Kernels that may name reactions.
READING = ("wrench", "rate")
#: Multipliers of a joint of any type, for the examination: as many as joints have rows at most.
MOST_ROWS = 6


def joint_fields(type_: type[TypeBase]) -> dict[str, FieldSpec]:
    """The ``joint()`` fields of a force, by name; none of other kinds."""
    specs = specs_of(type_) if type_.kind == "force" else {}
    return {name: spec for name, spec in specs.items() if spec.kind == "joint"}


def reaction_names(
    type_: type[TypeBase], rows: Mapping[str, int] | None = None
) -> dict[str, KernelArgument]:
    """Names that the ``joint()`` fields of a type offer to the kernels of READING.

    rows: field -> rows of its joint, where they are known.
    """
    names = {}
    for field, spec in joint_fields(type_).items():
        about = f"the reaction of joint {field} on its body i"
        for head, shape, doc in (
            (
                "lam",
                ((rows or {}).get(field) or spec.rows or MOST_ROWS,),
                f"multipliers of joint {field}, one a row",
            ),
            ("force", (3,), f"force of {about}, N, global"),
            ("moment", (3,), f"moment of {about}, N m, about its mass centre, global"),
        ):
            name = f"{head}_{field}"
            names[name] = KernelArgument(name, shape, True, "", doc=doc, derivable=False)
    return names


def joints_read(type_info: TypeInfo) -> tuple[str, ...]:
    """The ``joint()`` fields whose reactions the kernels of a force name."""
    used = _names_read(type_info)
    return tuple(
        field
        for field in joint_fields(type_info.type)
        if used & {f"{head}_{field}" for head in ("lam", "force", "moment")}
    )


def bind_joints(type_info: TypeInfo, joints: Mapping[str, TypeInfo]) -> TypeInfo:
    """A force with the joints known whose reactions it reads.

    Args:
        type_info: the type of the force.
        joints: field -> type of the joint, for all of ``joints_read``.

    Returns:
        the type, with its ``wrench`` as kernel ``friction``.

    Raises:
        PluginError: a reaction depends on an angle whose turns are counted, a state or an unknown.
    """
    layout, width, integers = (
        type_info.layout,
        type_info.layout.par_width,
        type_info.layout.integers,
    )
    bound = []
    for field, joint in joints.items():
        bound.append(JointOfForce(field, joint, integers, width))
        _check_own(type_info, bound[-1])
        integers += joint.layout.integers + 1
        width += joint.layout.par_width

    def renamed(of_kernel: Mapping[str, Any]) -> dict[str, Any]:
        return {"friction" if n == "wrench" else n: value for n, value in of_kernel.items()}

    return attrs.evolve(
        type_info,
        layout=attrs.evolve(layout, par_width=width),
        names=type_info.names | reaction_names(type_info.type),
        kernels=renamed(type_info.kernels),
        outputs=renamed(type_info.outputs),
        joints=tuple(bound),
        given=type_info.given + "".join(f" of {j.type_info.type.keyword}" for j in bound),
    )


def with_sample_reactions(type_info: TypeInfo) -> TypeInfo:
    """A force with numbers of ``out2`` in place of reactions, to be examined without a scene.

    Vectors among them are fixed in its first body, so that they turn with a common rigid motion.
    """
    first, names = 0, {}
    for name, argument in _read(type_info).items():
        slot = type_info.layout.slots[0]
        numbers = "".join(f"-out2[{first + k}], " for k in range(argument.shape[0]))
        code, needs = f"({numbers})", tuple[str, ...]()
        if not name.startswith("lam_"):
            code, needs = f"rotate(x_A_{slot}, {code})", (f"A_{slot}",)
        names[name] = attrs.evolve(argument, code=code, needs=needs)
        first += argument.shape[0]
    return attrs.evolve(type_info, names=type_info.names | names) if names else type_info


def sample_size(type_info: TypeInfo) -> int:
    """Numbers of ``out2`` that stand for reactions."""
    return sum(argument.shape[0] for argument in _read(type_info).values())


def _read(type_info: TypeInfo) -> dict[str, KernelArgument]:
    used = _names_read(type_info)
    return {n: q for n, q in reaction_names(type_info.type).items() if n in used}


def integers_of_joints(type_info: TypeInfo) -> int:
    """Integers of an instance that belong to the joints that it reads."""
    return sum(joint.type_info.layout.integers + 1 for joint in type_info.joints)


def body_columns(type_info: TypeInfo) -> list[int]:
    """Columns of ``idx`` with the bodies of the joints that an instance reads."""
    columns: list[int] = []
    for joint in type_info.joints:
        layout = joint.type_info.layout
        first = joint.integers + len(layout.slots) + len(layout.functions)
        columns += range(joint.integers, joint.integers + len(layout.slots))
        columns += range(first, first + len(layout.others))
    return columns


def rows_read(type_info: TypeInfo) -> dict[int, int]:
    """Columns of ``idx`` with the first rows of the joints that an instance reads -> their rows.

    The friction of a joint reads its own.
    """
    found = {j.integers + j.type_info.layout.integers: j.rows for j in type_info.joints}
    found = found or {type_info.layout.integers: type_info.row_count}
    if load := getattr(type_info.type, "load", ()):  # of its joint, too
        found |= {type_info.layout.integers + 1 + len(type_info.layout.slots): load[-1] + 1}
    return found


def reaction_lines(
    type_info: TypeInfo, wanted: Iterable[str], instance: str, numbers: str
) -> Iterator[str]:
    """Lines of a loop that compute the wanted reactions of an instance.

    They use the names of the joint's own kernels, which those of the force overwrite.

    Args:
        type_info: of the force, bound to its joints.
        wanted: names of arguments.
        instance, numbers: expressions of the places of its first integer and number.
    """
    wanted = set(wanted)
    for joint in type_info.joints:
        field, layout, J = joint.field, joint.type_info.layout, joint.type_info.kernels["J"]
        row = f"row_{field}"
        yield f"{row} = idx[{instance} + {joint.integers + layout.integers}]"
        multipliers = "".join(f"-out2[{row} + {k}], " for k in range(joint.rows))
        yield f"x_lam_{field} = ({multipliers})"
        if not wanted & {f"force_{field}", f"moment_{field}"}:
            continue
        yield f"b0 = {instance} + {joint.integers}"
        yield f"p1 = {numbers} + {joint.numbers}"
        yield from (f"b_{s} = idx[b0 + {n}]" for n, s in enumerate(layout.slots))
        first = len(layout.slots) + len(layout.functions)
        yield from (f"b_{name} = idx[b0 + {first + n}]" for n, name in enumerate(layout.others))
        names = parameters(J)
        yield from (f"x_{q.name} = {q.code}" for q in in_order(joint.type_info.names, names))
        yield f"out = kernel_J_{field}({', '.join(f'x_{n}' for n in names)})"
        paths = joint.type_info.outputs["J"]  # the block of slot i comes first
        sums = [
            " + ".join(f"{paths[6 * r + c]} * x_lam_{field}[{r}]" for r in range(joint.rows))
            for c in range(6)
        ]
        yield f"x_force_{field} = ({', '.join(sums[:3])})"
        yield f"x_moment_{field} = ({', '.join(sums[3:])})"


def _names_read(type_info: TypeInfo) -> set[str]:
    """The parameters of the kernels that may name reactions."""
    kernels = [type_info.kernels[name] for name in READING if name in type_info.kernels]
    return {name for kernel in kernels for name in parameters(kernel)}


def _check_own(type_info: TypeInfo, joint: JointOfForce) -> None:
    """The copy of the joint's numbers counts no turns, and has no states and no unknowns."""
    vectors = {f"force_{joint.field}", f"moment_{joint.field}"}
    if not vectors & _names_read(type_info):
        return
    of_joint = joint.type_info
    needed = {q.name for q in in_order(of_joint.names, parameters(of_joint.kernels["J"]))}
    own = sorted(needed & {*of_joint.layout.angles, *of_joint.layout.states})
    if own := [*of_joint.layout.unknowns, *own]:
        raise PluginError(
            f"{where_is(type_info.type)} asks for the reaction of joint {joint.field}; but that of "
            f"{of_joint.type.keyword} depends on {own[0]}, which only the joint knows: take "
            f"lam_{joint.field}"
        )
