"""The fields a type may declare, and what each offers to its kernels.

A field is one line in a type's class: ``P_i: Point = point()``. Its last letter after ``_``, one of
i, j and k, names the body slot it belongs to. The maker says what the scene may write there;
``namespace.py`` says which names it offers.
"""

from collections.abc import Sequence
from typing import Any, NewType

import attrs

Point = NewType("Point", str)
Vector = NewType("Vector", str)
Vector2 = NewType("Vector2", str)
Body = NewType("Body", str)

#: Marks a field that the scene must give.
REQUIRED = attrs.NOTHING


@attrs.frozen
class FieldSpec:
    """What a field is, for validation, documentation and the writing of loops.

    Attributes:
        kind: body, point, vector, vector2, number, vec3, matrix, function or choice.
        default: value when the scene gives none; REQUIRED when it must.
        unit: SI unit of a number, "" for none.
        doc: what it means, one short sentence.
        positive, minimum, maximum: what a number must satisfy beyond being finite.
        choices: allowed words of a choice.
        unit_length: whether a vector is normalised (with a warning where its length was not 1).
    """

    kind: str
    default: Any = REQUIRED
    unit: str = ""
    doc: str = ""
    positive: bool = False
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    unit_length: bool = False

    @property
    def required(self) -> bool:
        """Whether the scene must give this field."""
        return self.default is REQUIRED


def _field(spec: FieldSpec) -> Any:
    return attrs.field(default=None if spec.required else spec.default, metadata={"dap3d": spec})


def body(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A body by name; the field's last letter is its slot (``body_i``)."""
    return _field(FieldSpec("body", default, doc=doc))


def point(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A point on a body, by name; ``P_i`` lies on the body of slot i."""
    return _field(FieldSpec("point", default, unit="m", doc=doc))


def vector(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A unit vector fixed in a body (type 1), by name; ``a_i`` is fixed in the body of slot i.

    It is normalised, with a warning where its length was not 1.
    """
    return _field(FieldSpec("vector", default, doc=doc, unit_length=True))


def vector2(default: Any = REQUIRED, *, doc: str = "") -> Any:
    """A vector between two points (type 2), by name; ``P_i`` and ``P_j`` may be given instead."""
    return _field(FieldSpec("vector2", default, unit="m", doc=doc))


def number(
    default: Any = REQUIRED,
    *,
    unit: str = "",
    doc: str = "",
    positive: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
) -> Any:
    """A finite number. ``default=None`` lets the scene leave it out: ``prepare`` then finds it."""
    spec = FieldSpec("number", default, unit, doc, positive, minimum, maximum)
    return _field(spec)


def vec3(default: Any = REQUIRED, *, unit: str = "", doc: str = "") -> Any:
    """Three finite numbers."""
    return _field(FieldSpec("vec3", default, unit, doc))


def matrix(default: Any = REQUIRED, *, unit: str = "", doc: str = "") -> Any:
    """A 3x3 matrix of finite numbers, by rows."""
    return _field(FieldSpec("matrix", default, unit, doc))


def function(default: Any = None, *, doc: str = "") -> Any:
    """A function of time, by name; absent, it is zero. Offers ``f``, ``f_dot``, ``f_ddot``."""
    return _field(FieldSpec("function", default, doc=doc))


def choice(choices: Sequence[str], default: Any = REQUIRED, *, doc: str = "") -> Any:
    """One of several words."""
    return _field(FieldSpec("choice", default, doc=doc, choices=tuple(choices)))


def specs_of(type_: type) -> dict[str, FieldSpec]:
    """The declared fields of a type, in order, with what each is."""
    return {a.name: a.metadata["dap3d"] for a in attrs.fields(type_) if "dap3d" in a.metadata}


def slot_of(name: str) -> str | None:
    """The body slot a name belongs to by its last letter (``P_i`` -> i), or None."""
    head, _, tail = name.rpartition("_")
    return tail if head and tail in ("i", "j", "k") else None
