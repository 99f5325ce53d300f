"""Fields that a type may declare.

A field is one line in a type's class: ``P_i: Point = point()``. Its last letter after ``_``, one of
i, j, k, l, m, n, o and p, names its body slot. The maker specifies its values in the scene;
``codegen/kernel_arguments.py`` lists the names it offers to kernels.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NewType

import attrs

Point = NewType("Point", str)
Vector = NewType("Vector", str)
Vector2 = NewType("Vector2", str)
Body = NewType("Body", str)

#: Body slots that a type may have: those after k follow one another without a gap. A list of bodies
#: may need more than there are letters free.
SLOTS = (*"ijklmnop", *(f"b{k}" for k in range(9, 25)))
#: Marks a field that the scene must give.
REQUIRED = attrs.NOTHING


@attrs.frozen
class FieldSpec:
    """Properties of a field, for validation, documentation and the generation of loops.

    Attributes:
        kind: body, point, vector, vector2, number, numbers, vec3, matrix, square, table, function,
            functions, input, choice, joint, joint_fields or angle; bodies, points or vectors of a
            list.
        default: value where the scene gives none; REQUIRED where it must.
        unit: SI unit of a number, "" for none.
        doc: its meaning, one short sentence.
        positive, minimum, maximum: limits of a number.
        whole: a number must be whole.
        usual: least and greatest number (None: none) outside of which a scene gets a note.
        choices: allowed words of a choice (or False and True).
        aliases: other words for some of them.
        direction: a vector between two points must not have zero length at the start of a run, or
            only where one of these fields is given and not zero; three numbers should have unit
            length (with a note otherwise).
        across: the field of a vector that this one must not be parallel to at the start of a run.
        unit_length: a vector is normalised (with a warning where its length is not 1).
        ground: a vector must be fixed in ground.
        in_ground: three numbers are components in ground axes.
        argument: the argument of a function, or both of one of two; "" for time.
        arguments: how many a function takes.
        columns: numbers in a row of a table; count of ``numbers``; size of a square matrix.
        given: a table is given in the scene; False: ``prepare`` returns it.
        by_rows: a table is given as rows of equal length.
        axes: the fields an angle is measured between: two vectors, and the axis.
        rows: number of rows that a joint must have; None for any.
        by_name: what a number may also name: a function (of time), an input.
        instead_of: fields that an input or a number takes the place of.
        gives: fields that a joint gives -> its own, as of ``joint_fields``.
        facts: fields that it gives where the scene does not, by attributes of its type.
        acts_in: the coordinate of the joint that the element acts in, "angle" or "length"; or "".
        size: name of the number of entries of a list, which the scene gives by its length; "" of
            all else.
        least: smallest number of entries of a list.
        apart: each entry of a list is on a body of its own.
        constant: numbers of a list are constants of the kernels.
    """

    kind: str
    default: Any = REQUIRED
    unit: str = ""
    doc: str = ""
    positive: bool = False
    minimum: float | None = None
    maximum: float | None = None
    whole: bool = False
    usual: tuple[float | None, float | None] = (None, None)
    choices: tuple[Any, ...] = ()
    aliases: Mapping[str, str] = attrs.field(factory=dict)
    unit_length: bool = False
    direction: bool | tuple[str, ...] = False
    across: str = ""
    ground: bool = False
    in_ground: bool = False
    argument: str = ""
    arguments: int = 1
    columns: int = 1
    given: bool = True
    by_rows: bool = False
    axes: tuple[str, str, str] = ("", "", "")
    rows: int | None = None
    by_name: tuple[str, ...] = ()
    instead_of: tuple[str, ...] = ()
    gives: Mapping[str, str] = attrs.field(factory=dict)
    facts: tuple[str, ...] = ()
    acts_in: str = ""
    size: str = ""
    least: int = 1
    apart: bool = False
    constant: bool = False

    @property
    def for_prepare(self) -> bool:
        """True if ``prepare`` alone reads the field, and no kernel."""
        return self.by_rows or self.kind == "square"

    @property
    def is_reference(self) -> bool:
        """True if it names a function or input."""
        return self.kind in ("function", "input") or bool(self.by_name)

    @property
    def is_optional(self) -> bool:
        """True if it is a number that may be left out."""
        return self.kind == "number" and self.default is None and not self.by_name

    @property
    def asks_presence(self) -> bool:
        """True if variants ask whether the field is given, not for its value."""
        return self.is_reference or self.is_optional

    @property
    def required(self) -> bool:
        """True if the scene must give this field."""
        return self.default is REQUIRED


def field_of(spec: FieldSpec) -> Any:
    """The attribute of a class that declares a field."""
    return attrs.field(default=None if spec.required else spec.default, metadata={"dap3d": spec})


def body(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A body by name; the last letter of the field is its slot (``body_i``)."""
    return field_of(FieldSpec("body", default, doc=doc))


def point(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A point on a body, by name; ``P_i`` lies on the body of slot i."""
    return field_of(FieldSpec("point", default, unit="m", doc=doc))


def vector(
    default: Any = REQUIRED, *, ground: bool = False, across: str = "", doc: str = ""
) -> Any:
    """A unit vector fixed in a body (type 1), by name; ``a_i`` is fixed in the body of slot i.

    It is normalised, with a warning where its length is not 1. A vector without a slot in its name
    (``axis``) may be fixed in any body of the element. With ``ground`` it must be fixed in ground,
    and has no body slot. With ``across``, the name of another vector field, a scene is refused
    where the two are parallel at the start of a run.
    """
    spec = FieldSpec("vector", default, doc=doc, unit_length=True, ground=ground, across=across)
    return field_of(spec)


def vector2(
    default: Any = REQUIRED, *, direction: bool | tuple[str, ...] = False, doc: str = ""
) -> Any:
    """A vector between two points (type 2), by name; ``P_i`` and ``P_j`` may be given instead.

    With ``direction`` the element acts along it: a scene is refused where the two points coincide
    at the start of a run. With names of fields (numbers, a function of an argument) only where one
    of them is given and not zero.
    """
    return field_of(FieldSpec("vector2", default, unit="m", doc=doc, direction=direction))


def number(
    default: Any = REQUIRED,
    *,
    unit: str = "",
    doc: str = "",
    positive: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
    whole: bool = False,
    usual: tuple[float | None, float | None] = (None, None),
    by_name: Sequence[str] = (),
    instead_of: Sequence[str] = (),
) -> Any:
    """A finite number; a whole one (of teeth, say) with ``whole``.

    With ``default=None`` the scene may omit it: ``prepare`` then returns it. Outside of ``usual``,
    (least, greatest) with None for no limit, it is allowed, and noted.

    With ``by_name``, ("function", "input") or one of them, the scene gives a number, or names a
    function of time or an input: a field ``torque`` offers its value then, and ``torque_dot``,
    ``torque_ddot``, ``torque_dddot``, which are zero of numbers and inputs. Left out it is zero.
    Kernels for where it is given may be a variant of the type, for ``torque=True``. A scene gives
    it or a field of ``instead_of``, not both. Of a driver the first such field is its coordinate.
    """
    names = tuple(by_name), tuple(instead_of)
    spec = FieldSpec("number", default, unit, doc, positive, minimum, maximum, whole, usual)
    return field_of(attrs.evolve(spec, by_name=names[0], instead_of=names[1]))


def vec3(
    default: Any = REQUIRED,
    *,
    unit: str = "",
    direction: bool = False,
    in_ground: bool = False,
    doc: str = "",
) -> Any:
    """Three finite numbers; with ``direction`` a length other than 1 is noted.

    With ``in_ground`` they are components in ground axes: a scene that is included in another, and
    turned there, has them turned.
    """
    return field_of(FieldSpec("vec3", default, unit, doc, direction=direction, in_ground=in_ground))


def numbers(
    count: int | str,
    default: Any = REQUIRED,
    *,
    constant: bool = False,
    positive: bool = False,
    unit: str = "",
    doc: str = "",
) -> Any:
    """As many finite numbers as ``count``.

    With the name of a size, ``numbers("n")``, the length of the list in the scene is that size, and
    a default is one number, of all entries (docs/how-to/what-a-type-can-say.md, Lists). With
    ``constant`` these numbers are known when kernels are compiled, which may index and branch by
    them; each other list makes another type. Those of a list may have to be ``positive``.
    """
    if isinstance(count, str):
        spec = FieldSpec("numbers", default, unit, doc, positive, size=count, constant=constant)
        return field_of(spec)
    return field_of(FieldSpec("numbers", default, unit, doc, columns=count))


def points(size: str = "n", *, least: int = 1, apart: bool = False, doc: str = "") -> Any:
    """A list of points on any bodies, by name; its length is the size of this name.

    Several may lie on one body, unless they are ``apart``. A field ``points`` offers tuples
    ``r_points``, ``s_points``, ``v_points``, ``s_points_dot``, and ``w_points`` of the bodies that
    they lie on; ``on_points`` are the indices of these bodies, for ``by_body``; the size and
    ``body_count`` are whole numbers. A list of ``least=0`` may be left out.
    """
    default = () if least == 0 else REQUIRED
    return field_of(FieldSpec("points", default, "m", doc, size=size, least=least, apart=apart))


def vectors(size: str = "n", *, least: int = 1, doc: str = "") -> Any:
    """A list of unit vectors fixed in any bodies, by name, as ``points``.

    A field ``axes`` offers tuples ``axes``, ``axes_dot`` and ``w_axes``, and ``on_axes``.
    """
    default = () if least == 0 else REQUIRED
    spec = FieldSpec("vectors", default, "", doc, unit_length=True, size=size, least=least)
    return field_of(spec)


def bodies(size: str = "n", *, least: int = 1, doc: str = "") -> Any:
    """A list of bodies by name, as ``points``.

    A field ``wheels`` offers tuples ``r_wheels``, ``A_wheels``, ``p_wheels``, ``v_wheels``,
    ``w_wheels``, ``mass_wheels`` and ``Jp_wheels``, and ``on_wheels``.
    """
    return field_of(FieldSpec("bodies", REQUIRED, "", doc, size=size, least=least))


def matrix(default: Any = REQUIRED, *, unit: str = "", doc: str = "") -> Any:
    """A 3x3 matrix of finite numbers, by rows."""
    return field_of(FieldSpec("matrix", default, unit, doc))


def square(size: int, default: Any = REQUIRED, *, unit: str = "", doc: str = "") -> Any:
    """A symmetric matrix, or its diagonal alone as ``size`` numbers; ``prepare`` alone reads it."""
    return field_of(FieldSpec("square", default, unit, doc, columns=size))


def table(
    *, columns: int = 1, given: bool = True, by_rows: bool = False, unit: str = "", doc: str = ""
) -> Any:
    """Numbers of any count, which kernels read by ``lookup``.

    A table of one column is given in the scene as a list; with ``by_rows`` as a list of rows of
    equal length, which ``prepare`` alone reads. With ``given=False`` it is not in the scene:
    ``prepare`` returns it under the field's name, rows of ``columns`` numbers with increasing first
    numbers.
    """
    default = REQUIRED if given else None
    spec = FieldSpec("table", default, unit, doc, columns=columns, given=given, by_rows=by_rows)
    return field_of(spec)


def function(default: Any = None, *, argument: str | tuple[str, str] = "", doc: str = "") -> Any:
    """A function by name; absent, it is zero. With ``REQUIRED`` the scene must give it.

    Of time it offers its value and derivatives ``f``, ``f_dot``, ``f_ddot``, ``f_dddot``, and
    ``f_0``, its value at t = 0; next to a field of the name ``f`` they begin with its own name.
    With ``argument`` (the name of its argument) kernels call ``f(x)``, ``f_dot(x)``, ``f_ddot(x)``,
    ``f_dddot(x)``: value and derivatives; where it may be omitted, such kernels belong to a variant
    of the type for ``function=True``. With two names they call ``f(x, y)`` and its partial
    derivatives ``f_x(x, y)``, ``f_y``, ``f_xx``, ``f_xy``, ``f_yy``; the scene gives a function of
    two arguments.
    """
    names = (argument,) if isinstance(argument, str) else argument
    words, count = " and ".join(names), len(names)
    return field_of(FieldSpec("function", default, doc=doc, argument=words, arguments=count))


def functions(*, doc: str = "") -> Any:
    """Several functions by name, for a function type that combines them.

    The field offers its kernel a tuple of functions of one argument, each of which returns
    (f, f', f'', f''') there. A function that names itself, directly or through others, is refused.
    """
    return field_of(FieldSpec("functions", REQUIRED, doc=doc))


def input_(default: Any = None, *, instead_of: str = "", unit: str = "", doc: str = "") -> Any:
    """An input of the scene by name: a number that is set from outside, and held until then.

    It offers its value under the name of the field. Where it may be omitted, kernels that name it
    belong to a variant of the type for ``input=True`` (the name of the field). A scene gives it or
    the field ``instead_of``, not both.
    """
    others = (instead_of,) if instead_of else ()
    return field_of(FieldSpec("input", default, unit, doc, instead_of=others))


def choice(
    choices: Sequence[Any],
    default: Any = REQUIRED,
    *,
    aliases: Mapping[str, str] | None = None,
    doc: str = "",
) -> Any:
    """One of several words, or of False and True; ``aliases`` are other names of some of them."""
    spec = FieldSpec("choice", default, doc=doc, choices=tuple(choices), aliases=aliases or {})
    return field_of(spec)


def joint(*, rows: int | None = None, doc: str = "") -> Any:
    """A joint by name; with ``rows`` one of so many constraint rows.

    A field ``pin`` offers to the ``wrench`` of a force ``lam_pin``, the multipliers of the joint,
    and ``force_pin``, ``moment_pin``, its reaction on its body i as ``Result.reaction`` has it:
    force and moment about the mass centre, global axes. A force without a ``wrench`` acts by the
    kernel ``friction`` of its one joint.
    """
    return field_of(FieldSpec("joint", REQUIRED, doc=doc, rows=rows))


def joint_fields(
    *same: str, facts: Sequence[str] = (), acts_in: str = "", doc: str = "", **others: str
) -> Any:
    """A joint by name, from which an element takes fields that it then leaves out.

    ``joint_fields("body_i", "body_j", "a_j")`` takes fields of the same names: what acts in the
    coordinate of a joint names the joint. ``joint_fields(P_j="P", a_j="a")`` takes the point and
    the axis that the joint has on the body that moves: body i, or body j where body i is ground.
    The scene gives the joint or the fields. ``facts`` are attributes of the joint's type, such as
    ``coordinate``, for fields of the same names that the scene does not give. With ``acts_in``,
    "angle" or "length", joints of the other coordinate are refused. A list field takes something
    of each of several joints.
    """
    gives = {name: name for name in same} | others
    return field_of(FieldSpec("joint_fields", None, doc=doc, gives=gives, facts=tuple(facts),
                              acts_in=acts_in))  # fmt: skip


def angle(first: str, second: str, about: str, *, doc: str = "") -> Any:
    """The angle from one vector field to another about a third; not a field of the scene.

    Offers ``theta`` and ``theta_dot`` under its name: atan2(k . (a x b), a . b - (a . k) (b . k)),
    unwound (turns are counted at accepted steps), and its rate k . (w_j - w_i).
    """
    return field_of(FieldSpec("angle", None, "rad", doc, given=False, axes=(first, second, about)))


def specs_of(type_: type) -> dict[str, FieldSpec]:
    """The declared fields of a type, in order, with their properties."""
    return {a.name: a.metadata["dap3d"] for a in attrs.fields(type_) if "dap3d" in a.metadata}


def slot_of(name: str) -> str | None:
    """The body slot of a name, its last letter (``P_i`` -> i), or None."""
    head, _, tail = name.rpartition("_")
    return tail if head and tail in SLOTS else None


def sized_fields(type_: type) -> dict[str, FieldSpec]:
    """The fields of a type that are lists of a length given by the scene."""
    return {name: spec for name, spec in specs_of(type_).items() if spec.size}
