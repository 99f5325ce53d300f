"""Places of sub-assemblies: what moves and turns with the ground of one."""

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.errors import MISSING, Key, MistakeList
from dap3d_core.scene.tables import NO_TURN, ZERO
from dap3d_core.scene.validate.coerce_values import (
    Fault,
    angle_of,
    from_axis_angle,
    from_rpy,
    numbers_of,
    quaternion_of,
)

#: How an orientation is given, and what makes Euler parameters of it.
ORIENTATIONS: Mapping[str, Callable[[Any], Any]] = {
    "p": quaternion_of,
    "rpy": from_rpy,
    "axis_angle": from_axis_angle,
}
PLACE = ("r", *ORIENTATIONS)
#: Entries of a rotation matrix below this are rounding, as of a turn of 90 deg.
ROTATION_ROUNDING = 1e-15
#: A shift below this, m, is rounding.
SHIFT_ROUNDING = 1e-12


@attrs.frozen(eq=False)
class Place:
    """Where the ground of a sub-assembly lies: its rotation, its Euler parameters, its origin."""

    A: Floats
    p: tuple[float, ...]
    r: tuple[Any, ...]

    @property
    def is_turned(self) -> bool:
        """True if its axes are others than those of ground."""
        return bool(np.any(np.eye(3) != self.A))

    @property
    def is_moved(self) -> bool:
        """True if it is at another place than ground, turned or not."""
        return self.is_turned or any(x != 0.0 for x in self.r)

    def position(self, x: Any) -> Any:
        """The coordinates in ground of a point; what is no list of three is left to the check."""
        turned = self.direction(x)
        if type(turned) is not tuple or len(turned) != 3:
            return turned
        return tuple(_sum([(1.0, a), (1.0, b)]) for a, b in zip(self.r, turned, strict=True))

    def direction(self, x: Any) -> Any:
        """The components in ground of a vector."""
        if type(x) is not tuple or len(x) != 3 or not self.is_turned:
            return x
        return tuple(_sum(list(zip(map(float, row), x, strict=True))) for row in self.A)

    def moves_along(self, d: Any) -> bool:
        """True if it is moved along a vector of its own ground, or may be."""
        v = self.direction(d)
        if not all(type(x) in (float, int) for x in v):
            return any(x != 0.0 for x in self.r)
        shift = _sum(list(zip(v, self.r, strict=True)))
        return is_expression(shift) or abs(shift) > SHIFT_ROUNDING

    def orientation(self, given: Mapping[str, Any]) -> Any:
        """Euler parameters behind the turn of the place, or a fault."""
        word = next((w for w in ("rpy", "axis_angle") if given.get(w) is not None), "p")
        written = given.get(word, NO_TURN)
        p = ORIENTATIONS[word](written)
        if isinstance(p, Fault):
            p = _with_expressions(word, written) or p
        if isinstance(p, Fault):
            return p
        e0, e1, e2, e3 = self.p
        left = ((e0, -e1, -e2, -e3), (e1, e0, -e3, e2), (e2, e3, e0, -e1), (e3, -e2, e1, e0))
        return tuple(_sum(list(zip(row, p, strict=True))) for row in left)


def read_place(mistakes: MistakeList, key: Key, at: Any) -> Place | None:
    """The place of a table ``at``; None where a mistake is reported that leaves none."""
    if not isinstance(at, dict):
        mistakes.add(key, at, "should be a table such as {r = [0.0, 0.5, 0.0], rpy = [...]}")
        return None
    mistakes.add_unknown_keys(key, at, PLACE, in_order=True)
    words = [word for word in ORIENTATIONS if word in at]
    if len(words) > 1:
        mistakes.add(key, MISSING, f"give one of {' and '.join(words)}")
    r = at.get("r", ZERO)
    if type(r) is not tuple or len(r) != 3 or not all(map(_is_number, r)):
        numbers = numbers_of(r, 3)
        what = numbers.what if isinstance(numbers, Fault) else "should be a list of 3 numbers"
        mistakes.add((*key, "r"), r, what)
        r = ZERO
    p = ORIENTATIONS[words[0]](at[words[0]]) if words else NO_TURN
    if isinstance(p, Fault):
        given = at[words[0]]
        if type(given) is tuple and any(map(is_expression, given)):
            p = Fault("takes numbers: expressions may move a sub-assembly, not turn it")
        mistakes.add((*key, words[0]), given, p.what, p.nearest, p.remedy)
        return None
    e0, e1, e2, e3 = p
    A = np.eye(3) + 2.0 * (
        e0 * np.array([[0, -e3, e2], [e3, 0, -e1], [-e2, e1, 0]])
        + np.array([[-e2 * e2 - e3 * e3, e1 * e2, e1 * e3],
                    [e1 * e2, -e1 * e1 - e3 * e3, e2 * e3],
                    [e1 * e3, e2 * e3, -e1 * e1 - e2 * e2]])
    )  # fmt: skip
    A[np.abs(A) < ROTATION_ROUNDING] = 0.0
    return Place(A, p, r)


def _with_expressions(word: str, written: Any) -> tuple[Any, ...] | None:
    """Euler parameters of an orientation with expressions, as ``p`` or ``rpy``; None of others."""
    if type(written) is not tuple or not any(map(is_expression, written)):
        return None
    if word == "p" and len(written) == 4 and all(map(_is_number, written)):
        return written
    if word != "rpy" or len(written) != 3:
        return None
    angles = [x[1:].strip() if is_expression(x) else angle_of(x) for x in written]
    if any(isinstance(x, Fault) for x in angles):
        return None
    (c0, s0), (c1, s1), (c2, s2) = ((f"cos(({x}) / 2)", f"sin(({x}) / 2)") for x in angles)
    return (
        f"= {c2} * {c1} * {c0} + {s2} * {s1} * {s0}",
        f"= {c2} * {c1} * {s0} - {s2} * {s1} * {c0}",
        f"= {c2} * {s1} * {c0} + {s2} * {c1} * {s0}",
        f"= {s2} * {c1} * {c0} - {c2} * {s1} * {s0}",
    )


def _is_number(x: Any) -> bool:
    return type(x) in (float, int) or is_expression(x)


def is_expression(x: Any) -> bool:
    """True of text in place of a number, an expression of parameters."""
    return type(x) is str and x.startswith("=")


def _sum(terms: list[tuple[float, Any]]) -> Any:
    """The sum of factors times numbers or expressions; an expression where there is one."""
    terms = [(a, x) for a, x in terms if a != 0.0 and x != 0.0]
    if all(type(x) in (float, int) for _, x in terms):
        return float(sum(a * x for a, x in terms))
    if not all(_is_number(x) for _, x in terms):
        return next(x for _, x in terms if not _is_number(x))  # the check refuses it
    if len(terms) == 1 and terms[0][0] == 1.0:
        return terms[0][1]
    texts = [f"({x[1:].strip()})" if is_expression(x) else f"({x!r})" for _, x in terms]
    factors = ["" if a == 1.0 else f"{a!r} * " for a, _ in terms]
    return "= " + " + ".join(f"{a}{x}" for a, x in zip(factors, texts, strict=True))
