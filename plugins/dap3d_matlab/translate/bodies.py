"""Translates bodies, points, vectors and animation data."""

from typing import Any

import numpy as np

from dap3d_core.interface.formats import from_quaternion
from dap3d_core.scene import MISSING, Mistake, Scene
from dap3d_matlab.files.report import remark
from dap3d_matlab.language.structures import LIMITS
from dap3d_matlab.language.values import Numbers, Struct, plain_value
from dap3d_matlab.translate.fields import Fields, name_of

#: Tolerance of a rotation matrix.
ROTATION_TOLERANCE = 1e-6
#: Fields of a body with reported defaults.
_DEFAULTS = {"mass": "mass = 1", "Jp": "Jp = eye(3)", "r": "r = [0;0;0]"}


def add_bodies(scene: Scene, fields: Fields) -> None:
    """Add the bodies, in the order of their array."""
    for k, struct in enumerate(fields.model.arrays["Bodies"] or [], 1):
        name = name_of("Bodies", k)
        values: dict[str, Any] = {
            "mass": fields.number(struct, "mass"),
            "Jp": _inertia(fields, struct),
            "p": _orientation(fields, struct),
            **{field: fields.vector(struct, field) for field in ("r", "r_dot")},
        }
        values["w"] = _angular_velocity(fields, struct, values["p"])
        values["color"] = _color(fields, struct)
        for field in ("mass", "Jp", "r", "p", "r_dot", "w", "color"):
            source = {"p": "A", "w": "p_dot"}.get(field, field)
            fields.placed(
                f"bodies.{name}.{field}", struct, field if field in struct.given else source
            )
        fields.placed(f"bodies.{name}", struct)
        _report(fields, struct, _DEFAULTS)
        scene.add_body(name, **values)


def _report(fields: Fields, struct: Struct, defaults: dict[str, str]) -> None:
    """Report defaults, of fields that are not given, and fields that the program computes."""
    missing = [text for field, text in defaults.items() if field not in struct.given]
    if missing:
        fields.defaulted(struct, ", ".join(missing))
    for field in struct.given:
        if field in struct.structure.computed:
            fields.left_out(struct, field, "is worked out by the program: not read")


def _inertia(fields: Fields, struct: Struct) -> Any:
    """The inertia matrix; three numbers where it is diagonal."""
    matrix = fields.matrix(struct, "Jp")
    if matrix is None:
        return None
    off = [matrix[a][b] for a in range(3) for b in range(3) if a != b]
    return matrix if any(off) else tuple(matrix[a][a] for a in range(3))


def _orientation(fields: Fields, struct: Struct) -> Any:
    """Euler parameters, or those of the rotation matrix where that is given."""
    p = fields.vector(struct, "p", 4)
    if "A" not in struct.given or p is None:
        return p
    rows = fields.matrix(struct, "A")
    if rows is None:
        return None
    A = np.array(rows)
    p_of_A = tuple(parameters_of(A).tolist())
    if np.abs(from_quaternion(p_of_A) - A).max() > ROTATION_TOLERANCE:
        what = f"should be a rotation matrix (A^T A = I, det A = 1, within {ROTATION_TOLERANCE:g})"
        fields.refuse(struct, "A", what)
        return None
    if "p" not in struct.given:
        words = "gives the orientation: p is worked out from it (the MATLAB program reads p alone)"
        fields.changed(struct, "A", words)
        return p_of_A
    if not 0.0 < np.dot(p, p) < np.inf or np.abs(from_quaternion(p) - A).max() > 1e-3:
        fields.refuse(struct, "A", "is another orientation than p", "give one of them")
        return None
    fields.left_out(struct, "A", "says what p says: p is read")
    return p


def parameters_of(A: Numbers) -> Numbers:
    """Euler parameters of a rotation matrix, e0 >= 0, from the largest of the four."""
    trace = np.trace(A)
    squares = 0.25 * np.array([1.0 + trace, *(1.0 + 2.0 * np.diag(A) - trace)])
    k = int(np.argmax(squares))
    largest = np.sqrt(max(squares[k], 1e-300))
    skew = np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])
    if k == 0:
        p = np.array([largest, *(0.25 * skew / largest)])
    else:
        column = 0.25 * (A[k - 1] + A[:, k - 1]) / largest
        column[k - 1] = largest
        p = np.array([0.25 * skew[k - 1] / largest, *column])
    with np.errstate(all="ignore"):
        p = np.nan_to_num(p / np.linalg.norm(p))
    return np.asarray(-p if p[0] < 0.0 else p)


def _angular_velocity(fields: Fields, struct: Struct, p: Any) -> Any:
    """Angular velocity in ground axes, or that of p_dot where that is given: w = 2 G p_dot."""
    w = fields.vector(struct, "w")
    if "p_dot" not in struct.given or w is None or p is None:
        return w
    given = fields.vector(struct, "p_dot", 4)
    if given is None:
        return None
    p_dot, e0, e = np.array(given), p[0], np.array(p[1:])
    rates = p_dot[1:]
    w_of_p = 2.0 * (-e * p_dot[0] + np.cross(e, rates) + e0 * rates)
    size = max(1.0, float(np.abs(p_dot).max()))
    if abs(float(np.dot(p, p_dot))) > ROTATION_TOLERANCE * size:
        what = "should be at right angles to p: Euler parameters keep unit length"
        fields.refuse(struct, "p_dot", what)
        return None
    if "w" not in struct.given:
        words = "gives the rotation: w is worked out from it (the MATLAB program reads w alone)"
        fields.changed(struct, "p_dot", words)
        return tuple(w_of_p.tolist())
    if np.abs(w_of_p - np.array(w)).max() > 1e-3 * size:
        fields.refuse(struct, "p_dot", "is another rotation than w", "give one of them")
        return None
    fields.left_out(struct, "p_dot", "says what w says: w is read")
    return w


def _color(fields: Fields, struct: Struct) -> str | None:
    """A colour by its letter or name, or three fractions of red, green and blue; "" for none."""
    if "color" not in struct.given:
        return ""
    if isinstance(struct.value("color"), str):
        return fields.word(struct, "color")
    shares = fields.vector(struct, "color")
    if shares is None:
        return None
    if not all(0.0 <= x <= 1.0 for x in shares):
        fields.refuse(struct, "color", "should be a letter, or three numbers from 0 to 1")
        return None
    return "#" + "".join(f"{round(255 * x):02x}" for x in shares)


def add_geometry(scene: Scene, fields: Fields) -> None:
    """Add points and vectors, in the order of their arrays."""
    arrays = fields.model.arrays
    for array, field, table in (("Points", "sPp", "points"), ("Vectors1", "sp", "vectors")):
        for k, struct in enumerate(arrays[array] or [], 1):
            name = name_of(array, k)
            add = scene.add_point if array == "Points" else scene.add_vector
            add(name, fields.body(struct), fields.vector(struct, field))
            _report(fields, struct, _defaults_on_body(field))
            fields.placed(f"{table}.{name}", struct)
            fields.placed(f"{table}.{name}.body", struct, "Bindex")
            fields.placed(f"{table}.{name}.{field}", struct, field)
    for k, struct in enumerate(arrays["Vectors2"] or [], 1):
        name = name_of("Vectors2", k)
        ends = [
            fields.reference(struct, f"{end}Pindex", "Points", needed=True) for end in ("i", "j")
        ]
        scene.add_vector2(name, *ends)
        _report(fields, struct, {})
        fields.placed(f"vectors2.{name}", struct)
        for end in ("i", "j"):
            fields.placed(f"vectors2.{name}.P_{end}", struct, f"{end}Pindex")


def _defaults_on_body(field: str) -> dict[str, str]:
    """The reported defaults of a point or vector with a field of its components."""
    return {"Bindex": "Bindex = 0, the ground", field: f"{field} = [0;0;0]"}


def add_animation(scene: Scene, fields: Fields) -> None:
    """Add points that are only drawn, and the limits of the drawing."""
    for k, struct in enumerate(fields.model.arrays["Points_anim"] or [], 1):
        body, local = fields.body(struct), fields.vector(struct, "sPp")
        _report(fields, struct, _defaults_on_body("sPp"))
        if body is not None and local is not None:
            scene.add_animation_point(body, local)
        fields.placed(f"animation.points.{k}", struct)
    limits = fields.model.limits
    given = [_limit(fields, name) for pair in LIMITS for name in pair if name in limits]
    missing = [name for pair in LIMITS for name in pair if name not in limits]
    if given and missing:
        text = f"no {', '.join(missing)}: the limits of the drawing are left open"
        place = next(iter(limits.values()))[1]
        fields.report.unused.append(remark(place, text))
    elif given and None not in given:
        scene.animation.limits = tuple(zip(given[::2], given[1::2], strict=True))
        fields.places["animation.limits"] = limits["xmin"][1]


def _limit(fields: Fields, name: str) -> float | None:
    value, place = fields.model.limits[name]
    if isinstance(value, np.ndarray) and value.size == 1:
        return float(value[0, 0])
    if isinstance(value, (str, np.ndarray)):
        shown = MISSING if isinstance(value, np.ndarray) and not value.size else plain_value(value)
        fields.model.mistakes.append(
            Mistake(name, shown, "should be a number", file=place.file, line=place.line)
        )
    return None
