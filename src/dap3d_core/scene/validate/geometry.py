"""Points and vectors: the body of each, and the resolution of references."""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import islice
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.fields import FieldSpec
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.tables import GROUND, ZERO
from dap3d_core.scene.validate.coerce_columns import Keys, tuples, vectors
from dap3d_core.scene.validate.coerce_values import (
    SHORTEST,
    UNIT_LENGTH_ROUNDING,
    Fault,
    numbers_of,
)
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Bodies

#: Body index (ground 0) and components on that body.
Located = tuple[int, tuple[float, ...]]
#: Points and vectors of every body, which need no declaration.
ORIGIN = {"O": ZERO}
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
#: How a scene declares what is given by name.
DECLARED = {
    "point": "[points.NAME] with body and sPp",
    "vector": "[vectors.NAME] with body and sp",
    "vector2": "[vectors2.NAME] with P_i and P_j",
}
#: Body index of a reference already reported as a mistake.
BAD = -1


@attrs.frozen(eq=False)
class Geometry:
    """Resolves references to points and vectors.

    Attributes:
        points: name -> body index, coordinates on it.
        vectors: name -> body index, components on it, unit length.
        raw_vectors: the same with the length as given.
        vectors2: name -> points it runs from and to; None where a mistake was reported.
        point_names, point_body, point_local, animation_count: as in ``ValidatedScene``.
    """

    bodies: Bodies
    points: dict[str, Located]
    vectors: dict[str, Located]
    raw_vectors: dict[str, Located]
    vectors2: dict[str, tuple[Located, Located] | None]
    point_names: tuple[str, ...]
    point_body: NDArray[np.int64]
    point_local: Floats
    animation_count: int

    def point(self, name: Any) -> Located | None:
        """The point of this name, declared or the origin of a body; None where there is none."""
        return _look_up(name, self.points, self.bodies, ORIGIN)

    def vector(self, name: Any, *, unit: bool = True) -> Located | None:
        """The vector of this name, declared or an axis of a body; None where there is none."""
        return _look_up(name, self.vectors if unit else self.raw_vectors, self.bodies, AXES)


def _look_up(
    name: Any, declared: dict[str, Located], bodies: Bodies, offered: dict[str, Any]
) -> Located | None:
    if not isinstance(name, str):
        return None
    located = declared.get(name)
    if located is None and "." in name:
        body, _, last = name.rpartition(".")
        if body in bodies.body_index and last in offered:
            return bodies.body_index[body], offered[last]
    return located


def read_geometry(report: Collector, bodies: Bodies) -> Geometry:
    """Points, vectors and animation points of a scene; mistakes are reported."""
    scene = report.scene
    points = list(scene.points.values())
    names = tuple(scene.points)
    on = _bodies_of(report, Keys("points", names, "body"), [p.body for p in points], bodies)
    local = vectors(report, Keys("points", names, "sPp"), [p.sPp for p in points], 3)
    names1 = tuple(scene.vectors)
    on1 = [v.body for v in scene.vectors.values()]
    on1 = _bodies_of(report, Keys("vectors", names1, "body"), on1, bodies)
    raw, unit = _directions(report, names1)
    drawn = [f"animation.{k}" for k in range(1, len(scene.animation.points) + 1)]
    drawn_on, drawn_at = _animation(report, bodies)
    geometry = Geometry(
        bodies,
        dict(zip(names, zip(on, tuples(local), strict=True), strict=True)),
        dict(zip(names1, zip(on1, tuples(unit), strict=True), strict=True)),
        dict(zip(names1, zip(on1, tuples(raw), strict=True), strict=True)),
        {},
        (*names, *drawn),
        np.array([*on, *drawn_on], dtype=np.int64),
        np.concatenate([local, drawn_at]),
        len(drawn),
    )
    for name in scene.vectors2:
        geometry.vectors2[name] = _vector2(report, geometry, name)
    return geometry


def two_ends(
    report: Collector, geometry: Geometry, key: Key, P_i: Any, P_j: Any
) -> tuple[Located, Located] | None:
    """The points that a vector of type 2 runs from and to; None where a mistake is reported."""
    tail = point_of(report, geometry, (*key, "P_i"), P_i)
    head = point_of(report, geometry, (*key, "P_j"), P_j)
    if tail is None or head is None or BAD in (tail[0], head[0]):
        return None
    return (tail, head)


def _vector2(report: Collector, geometry: Geometry, name: str) -> tuple[Located, Located] | None:
    """The ends of a declared vector of type 2: on two bodies."""
    vector2, key = report.scene.vectors2[name], ("vectors2", name)
    ends = two_ends(report, geometry, key, vector2.P_i, vector2.P_j)
    if ends is None:
        return None
    if ends[0][0] == ends[1][0]:
        body = [GROUND, *geometry.bodies.body_names][ends[0][0]]
        report.add((*key, "P_j"), vector2.P_j, f"both ends are on {body}; they lie on two bodies")
        return None
    return ends


def point_of(report: Collector, geometry: Geometry, key: Key, name: Any) -> Located | None:
    """The point of a reference; a mistake is reported where there is none."""
    point = geometry.point(name)
    if point is None:
        _report_reference(report, geometry, key, name, "point", geometry.points)
    return point


def vector_of(
    report: Collector, geometry: Geometry, key: Key, name: Any, *, unit: bool
) -> Located | None:
    """The vector of a reference; a mistake is reported where there is none."""
    vector = geometry.vector(name, unit=unit)
    if vector is None:
        _report_reference(report, geometry, key, name, "vector", geometry.vectors)
    return vector


def entry_of(report: Collector, geometry: Geometry, key: Key, kind: str, name: Any) -> Any:
    """An entry of a list of points, vectors or bodies, with its body; None where it is wrong."""
    if kind == "points":
        return point_of(report, geometry, key, name)
    if kind == "vectors":
        return vector_of(report, geometry, key, name, unit=True)
    body = body_index_of(report, geometry.bodies.body_index, key, name)
    return None if body == BAD else (body, name)


def body_index_of(report: Collector, index: Mapping[str, int], key: Key, name: Any) -> int:
    """Index of the body of a reference; BAD where a mistake is reported."""
    body = index.get(name, BAD) if isinstance(name, str) else BAD
    if body == BAD:
        value = MISSING if name is None else name
        report.add(key, value, *missing_words(report, "body", name, index))
    return body


def _report_reference(
    report: Collector,
    geometry: Geometry,
    key: Key,
    name: Any,
    kind: str,
    declared: dict[str, Located],
) -> None:
    words, near, remedy = missing_words(report, kind, name, declared)
    index, options = geometry.bodies.body_index, ORIGIN if kind == "point" else AXES
    if isinstance(name, str) and "." in name:
        body, _, last = name.rpartition(".")
        if body in index:
            words = f"bodies offer as {kind}s: {', '.join(options)}; there is no {last!r}"
            close = report.nearest(last, options)
            near = f"{body}.{close}" if close else ""
        else:
            words = f"there is no body {body!r}"
            close = report.nearest(body, index)
            near = f"{close}.{last}" if close and last in options else ""
    elif isinstance(name, str) and name in index and not near:
        remedy = f"{name} is a body; of it, {name}.{next(iter(options))} is a {kind}"
    report.add(key, MISSING if name is None else name, words, near, remedy)


def missing_words(
    report: Collector, kind: str, name: Any, declared: Collection[str]
) -> tuple[str, str, str]:
    """Fault, nearest spelling and remedy of an invalid reference."""
    if name is None:
        return f"is required: the name of a {kind}", "", ""
    if isinstance(name, int) and not isinstance(name, bool):
        remedy = _numbered(name, declared)
        return f"should be the name of a {kind} (text), not a number", "", remedy
    if not isinstance(name, str):
        remedy = f"declare one, {DECLARED[kind]}, and give its name" if kind in DECLARED else ""
        return f"should be the name of a {kind}", "", remedy
    words, near = f"there is no {kind} {name!r}", report.nearest(name, declared)
    if name and declared and not near:
        few = ", ".join(islice(declared, 8)) + (", ..." if len(declared) > 8 else "")
        words += f" (there are {few})"
    return words, near, ""


def named_row(
    report: Collector,
    spec: FieldSpec,
    text: str,
    rows: Mapping[str, Mapping[str, int]],
    read: Callable[[Any], Any],
) -> int | Fault | None:
    """The row of F that a text in place of a number names; None where it is a number, "1500 rpm".

    rows: function, input -> rows of F by name.
    """
    found = [kind for kind in rows if text in rows[kind]]
    if len(found) > 1:
        return Fault("is a function and an input; rename one of them")
    if found and found[0] in spec.by_name:
        return rows[found[0]][text]
    if found:
        remedy = f"give a number or a {spec.by_name[0]}"
        return Fault(f"is an {found[0]}, which steps from value to value", remedy)
    fault = read(text)
    if not isinstance(fault, Fault):
        return None
    known = [name for kind in spec.by_name for name in rows[kind]]
    words, near, _ = missing_words(report, " or ".join(spec.by_name), text, known)
    return Fault(f"should be a number or a name; {words}", fault.remedy, near)


def _numbered(number: int, declared: Collection[str]) -> str:
    """The name of an index of the manual: bodies count from ground, 0, all else from 1."""
    index = number if GROUND in declared else number - 1
    if number == 0 and GROUND in declared:
        return "number 0 of the manual is the ground"
    if number < 1 or index >= len(declared):
        return ""
    return f"number {number} in the order of the file is {next(islice(declared, index, None))!r}"


def _bodies_of(
    report: Collector, keys: Sequence[Key], names: list[Any], bodies: Bodies
) -> list[int]:
    """Body indices of a column of names."""
    if set(map(type, names)) <= {str}:
        indices = [bodies.body_index.get(name, BAD) for name in names]
        if BAD not in indices:
            return indices
    return [body_index_of(report, bodies.body_index, keys[k], name) for k, name in enumerate(names)]


def _directions(report: Collector, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Type-1 vectors as given and as unit vectors."""
    given = [v.sp for v in report.scene.vectors.values()]
    keys = Keys("vectors", names, "sp")
    raw = vectors(report, keys, given, 3)
    length = np.sqrt(np.einsum("nk,nk->n", raw, raw))
    for k in np.flatnonzero(length < SHORTEST):
        what = f"a vector needs a direction; the length of this one is {length[k]:g}"
        report.add(keys[k], given[k], what)
    for k in np.flatnonzero((np.abs(length - 1.0) > UNIT_LENGTH_ROUNDING) & (length >= SHORTEST)):
        text = f"vectors.{names[k]}.sp: length {length[k]:.9g}, normalised to 1"
        report.note(text, "vectors normalised")
    with np.errstate(invalid="ignore", divide="ignore"):
        return raw, np.asarray(raw / length[:, None])


def _animation(report: Collector, bodies: Bodies) -> tuple[list[int], Floats]:
    """Bodies and coordinates of the animation points; the limits are checked as well."""
    points = report.scene.animation.points
    key = ("animation", "points")
    keys_of_bodies = [(*key, k, "body") for k in range(len(points))]
    on = _bodies_of(report, keys_of_bodies, [p.body for p in points], bodies)
    keys = [(*key, k, "sPp") for k in range(len(points))]
    at = vectors(report, keys, [p.sPp for p in points], 3)
    limits = report.scene.animation.limits
    if limits is not None and not _are_limits(limits):
        what = "should be three pairs [[x_min, x_max], [y_min, y_max], [z_min, z_max]], min < max"
        report.add(("animation", "limits"), limits, what)
    return on, at


def _are_limits(value: Any) -> bool:
    if type(value) is not tuple or len(value) != 3:
        return False
    pairs = [numbers_of(pair, 2) for pair in value]
    return not any(isinstance(pair, Fault) or pair[0] >= pair[1] for pair in pairs)
