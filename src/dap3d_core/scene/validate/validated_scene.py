"""The validated scene, from which the model is built: arrays and instances, names resolved."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import attrs

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import specs_of
from dap3d_core.registry import Registry
from dap3d_core.scene.scene import Scene

if TYPE_CHECKING:
    from dap3d_core.kernels.array_types import Floats, Integers
    from dap3d_core.scene.contacts.collision_shapes import CollisionShapes
    from dap3d_core.scene.expressions.expression import Expression


@attrs.define
class Instance:
    """A joint, a force or a function with everything its type needs.

    Attributes:
        name: its name in the scene.
        type_info: its type.
        bodies: body index of each slot of ``type_info.layout.slots`` (ground 0); empty for an
            element that acts on each body.
        functions: for each of ``type_info.layout.functions`` 0 where absent, else 1 + its index
            in the functions of the scene, behind which its inputs follow.
        others: body index of each of ``type_info.layout.others``, vectors that no slot belongs to.
        values: field -> plain value. Points and vectors: 3 numbers on their body, vectors of unit
            length; a vector2 gives the two points ``P_i`` and ``P_j``; numbers: floats, or None
            where ``prepare`` returns them; vec3, table: tuples; matrix: three rows; references to
            bodies, functions, inputs and joints: words; choices: words, False or True.
        fields: field -> as written, with those of the joints that it names.
        terms: of a function that combines functions, those.
        breaks_at: N, of a joint that may be released: it ends where its force becomes larger, by
            itself never where this is inf; None of what holds throughout.
        active: of a joint that holds only while its value is positive; None of others.
    """

    name: str
    type_info: TypeInfo = attrs.field(repr=False)
    bodies: tuple[int, ...]
    functions: tuple[int, ...]
    values: dict[str, Any]
    others: tuple[int, ...] = ()
    fields: Mapping[str, Any] = attrs.field(factory=dict, repr=False)
    terms: tuple["Instance", ...] = ()
    breaks_at: float | None = None
    active: "Expression | None" = None

    @property
    def structure(self) -> Any:
        """What instances of one group loop have in common: the type, and those of its terms."""
        terms = tuple(term.structure for term in self.terms)
        return (self.type_info.type, terms) if terms else self.type_info.type


@attrs.frozen(eq=False)
class Bodies:
    """Arrays of n bodies.

    Attributes:
        body_names: n names without ground, in file order.
        body_index: name -> index; ground 0, bodies 1 to n.
        mass: (n,) kg.
        Jp: (n, 3, 3) inertia matrices in body axes, symmetric, kg m^2.
        r: (n, 3) positions, m.
        p: (n, 4) Euler parameters of unit length.
        r_dot: (n, 3) velocities, m/s.
        w: (n, 3) angular velocities in global axes, rad/s.
        r_0, p_0: (n, 3), (n, 4) reference poses: those from which ``prepare`` finds constants, and
            in which coordinates of joints are zero.
    """

    body_names: tuple[str, ...]
    body_index: dict[str, int]
    mass: "Floats"
    Jp: "Floats"
    r: "Floats"
    p: "Floats"
    r_dot: "Floats"
    w: "Floats"
    r_0: "Floats"
    p_0: "Floats"


@attrs.frozen(eq=False)
class ValidatedScene(Bodies):
    """A scene without mistakes, as arrays and instances.

    Attributes:
        scene: the scene as described, with numbers for expressions of its parameters.
        registry: the source of its types (with those of the model's own file, where needed).
        point_names: declared points in file order, then animation points (``animation.1``, ...).
        point_body: (points,) body index of each.
        point_local: (points, 3) coordinates on that body, m.
        animation_count: number of animation points among the points.
        joints, forces, functions, contacts: in file order; of a contact one for each point.
        inputs: value of each input at the start of a run, by name, in file order.
        collisions: shapes that collide, or None.
        notes: changes, assumptions and unusual values; none of them stops a run.
    """

    scene: Scene
    registry: Registry
    point_names: tuple[str, ...]
    point_body: "Integers"
    point_local: "Floats"
    animation_count: int
    joints: list[Instance]
    forces: list[Instance]
    functions: list[Instance]
    inputs: dict[str, float]
    notes: list[str]
    contacts: list[Instance] = attrs.Factory(list)
    collisions: "CollisionShapes | None" = None

    @property
    def holding(self) -> list[Instance]:
        """All that has constraint rows: joints, then contacts."""
        return [*self.joints, *self.contacts]


def arguments_of(functions: Iterable[Instance]) -> dict[str, int]:
    """How many arguments each function takes."""
    return {f.name: f.type_info.type.arguments for f in functions}  # type: ignore[attr-defined]


def combines(type_info: TypeInfo) -> bool:
    """True if a type of function combines other functions."""
    return any(spec.kind == "functions" for spec in specs_of(type_info.type).values())
