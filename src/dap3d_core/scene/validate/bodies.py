"""Bodies: masses, inertia matrices, poses and velocities as arrays."""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.errors import MISSING, dotted
from dap3d_core.scene.tables import NO_TURN, Body
from dap3d_core.scene.validate import coerce_values
from dap3d_core.scene.validate.coerce_columns import Keys, numbers, vectors
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Bodies

#: Smaller masses and principal inertias leave double precision in products and quotients.
SMALLEST_INERTIA = 1e-100
#: Relative tolerance of symmetry and of the triangle inequality of principal inertias.
INERTIA_TOLERANCE = 1e-9
#: A principal inertia of at most this fraction of the largest counts as zero.
ZERO_INERTIA = 1e-14

ZERO_REMEDY = (
    "an infinitely thin rod or a point mass has no unique motion: give a small value, such as "
    "1e-6 of the largest, and show by a second run with another that its effect is small"
)


def read_bodies(report: Collector) -> Bodies:
    """The bodies of a scene as arrays; mistakes are reported."""
    table = report.scene.bodies
    bodies, names = list(table.values()), tuple(table)
    missing = any(key == ("bodies",) or key[:1] == ("include",) for key, _ in report.mistakes)
    if not bodies and not missing:
        report.add(("bodies",), MISSING, "no bodies: a scene needs at least one, [bodies.NAME]")
    for field, default in (("mass", "1.0 kg"), ("Jp", "[1.0, 1.0, 1.0] kg m^2")):
        for name, body in table.items():
            if getattr(body, field) is None:
                text = f"bodies.{name}.{field} is not given; {default} is used"
                report.note(text, f"bodies without {field}")
    for name, body in table.items():
        if not isinstance(body.color, str):
            what = 'should be the name of a colour, such as "tab:blue"'
            report.add(("bodies", name, "color"), body.color, what)
    r, r_dot, w = (
        vectors(report, Keys("bodies", names, field), [getattr(b, field) for b in bodies], 3)
        for field in ("r", "r_dot", "w")
    )
    p = _quaternions(report, Keys("bodies", names, "p"), [
        _orientation(report, name, body) for name, body in table.items()
    ])  # fmt: skip
    return Bodies(
        names,
        {"ground": 0} | {name: k for k, name in enumerate(names, 1)},
        _masses(report, names, bodies),
        _inertias(report, names, bodies),
        r,
        p,
        r_dot,
        w,
        *_references(report, names, bodies, r, p),
    )


def _references(
    report: Collector, names: tuple[str, ...], bodies: list[Body], r: Floats, p: Floats
) -> tuple[Floats, Floats]:
    """The reference poses: those of the bodies, or others that are given."""
    r_0, p_0 = r.copy(), p.copy()
    for field, poses in (("r_0", r_0), ("p_0", p_0)):
        given = [k for k, body in enumerate(bodies) if getattr(body, field) is not None]
        keys = Keys("bodies", [names[k] for k in given], field)
        values = [getattr(bodies[k], field) for k in given]
        if given and field == "r_0":
            poses[given] = vectors(report, keys, values, 3)
        elif given:
            poses[given] = _quaternions(report, keys, values)
    return r_0, p_0


def _masses(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> Floats:
    keys = Keys("bodies", names, "mass")
    mass = numbers(report, keys, [1.0 if b.mass is None else b.mass for b in bodies])
    for k in np.flatnonzero(mass < SMALLEST_INERTIA):
        what, remedy = "should be greater than 0", ""
        if mass[k] == 0.0:
            remedy = "give a small mass, and show by a second run that its effect is small"
        elif mass[k] > 0.0:
            what = f"should be at least {SMALLEST_INERTIA:g}: its inverse overflows"
        report.add(keys[k], bodies[k].mass, what, remedy=remedy)
    return mass


def _quaternions(report: Collector, keys: Keys, given: list[Any]) -> Floats:
    """(n, 4) Euler parameters of unit length."""
    p = vectors(report, keys, given, 4)
    length = np.sqrt(np.einsum("nk,nk->n", p, p))
    deviation = np.abs(length - 1.0)
    for k in np.flatnonzero(deviation > coerce_values.UNIT_LENGTH_ROUNDING):
        if length[k] == 0.0:
            what = "Euler parameters of zero length mean no rotation at all"
            remedy = "write [1.0, 0.0, 0.0, 0.0] for a body that is not turned"
            report.add(keys[k], given[k], what, remedy=remedy)
        elif deviation[k] > coerce_values.UNIT_TOLERANCE:
            unit = ", ".join(f"{x:.16g}" for x in p[k] / length[k])
            remedy = f"if the direction is meant, write [{unit}]"
            report.add(keys[k], given[k], coerce_values.not_unit(length[k]), remedy=remedy)
        else:
            text = f"{dotted(keys[k])}: length {length[k]:.12g}, normalised to 1"
            report.note(text, "Euler parameters normalised")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(p / length[:, None])


def _orientation(report: Collector, name: str, body: Body) -> Any:
    """Euler parameters of a body as written, or of what stands in their place."""
    given = {k: v for k, v in (("rpy", body.rpy), ("axis_angle", body.axis_angle)) if v is not None}
    if not given:
        return body.p
    if body.p != NO_TURN:
        given["p"] = body.p
    if len(given) > 1:
        what = f"give one of {' and '.join(given)}"
        report.add(("bodies", name, next(iter(given))), next(iter(given.values())), what)
        return NO_TURN
    [(field, value)] = given.items()
    reader = coerce_values.from_rpy if field == "rpy" else coerce_values.from_axis_angle
    key = ("bodies", name, field)
    p = report.read(key, value, reader)
    if isinstance(p, coerce_values.Fault):
        return NO_TURN
    numbers = [x for x in value[0 if field == "rpy" else 3 :] if not isinstance(x, str)]
    if max(map(abs, numbers), default=0.0) > coerce_values.TURN:
        text = f"{dotted(key)} = {list(value)}: an angle {coerce_values.MANY_TURNS}"
        report.note(text, "angles beyond a turn")
    return p


def _inertias(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> Floats:
    """(n, 3, 3) inertia matrices, symmetric; invalid ones become the identity."""
    J = np.tile(np.eye(3), (len(bodies), 1, 1))
    keys, given = Keys("bodies", names, "Jp"), [b.Jp for b in bodies]
    is_full = [type(v) is tuple and len(v) > 0 and type(v[0]) is tuple for v in given]
    flat = [k for k, full in enumerate(is_full) if not full and given[k] is not None]
    if flat:
        flat_keys = Keys("bodies", [names[k] for k in flat], "Jp")
        diagonal = vectors(report, flat_keys, [given[k] for k in flat], 3, _diagonal_of)
        J[flat] = np.einsum("nk,kl->nkl", diagonal, np.eye(3))
    for k in np.flatnonzero(is_full):
        matrix = report.read(keys[k], given[k], coerce_values.matrix_of)
        J[k] = np.nan if isinstance(matrix, coerce_values.Fault) else matrix
    J[~np.isfinite(J).all(axis=(1, 2))] = np.eye(3)
    if any(is_full):
        J = _symmetric(report, keys, given, J)
    _check_principal(report, keys, given, J)
    return J


def _diagonal_of(value: Any) -> Any:
    """The diagonal of an inertia matrix, or its fault."""
    diagonal = coerce_values.numbers_of(value, 3)
    if not isinstance(diagonal, coerce_values.Fault) or (type(value) is tuple and len(value) == 3):
        return diagonal
    count = f"has {len(value)} numbers" if type(value) is tuple else "is no list"
    remedy = diagonal.remedy
    if type(value) is tuple and len(value) == 9:
        remedy = "write three rows: [[..., ..., ...], [..., ..., ...], [..., ..., ...]]"
    return coerce_values.Fault(f"should be 3 numbers (the diagonal) or 3x3; it {count}", remedy)


def _symmetric(report: Collector, keys: Keys, given: list[Any], J: Floats) -> Floats:
    asymmetry = np.abs(J - J.transpose(0, 2, 1))
    limit = INERTIA_TOLERANCE * np.abs(J).max(axis=(1, 2))
    for k in np.flatnonzero(asymmetry.max(axis=(1, 2)) > limit):
        a, b = (int(x) for x in np.unravel_index(np.argmax(asymmetry[k]), (3, 3)))
        what = (
            f"should be symmetric; entry ({a + 1}, {b + 1}) is {J[k, a, b]:g}, "
            f"entry ({b + 1}, {a + 1}) is {J[k, b, a]:g}"
        )
        report.add(keys[k], given[k], what)
        J[k] = np.eye(3)
    return np.asarray(0.5 * (J + J.transpose(0, 2, 1)))


def _check_principal(report: Collector, keys: Keys, given: list[Any], J: Floats) -> None:
    """Principal inertias are positive and satisfy the triangle inequality."""
    diagonal = np.einsum("nkk->nk", J)
    principal = np.sort(diagonal, axis=1)
    full = np.flatnonzero(np.abs(J).sum(axis=(1, 2)) != np.abs(diagonal).sum(axis=1))
    if len(full):
        principal[full] = np.linalg.eigvalsh(J[full])
    least, middle, most = principal.T
    zero = np.abs(least) <= ZERO_INERTIA * np.abs(principal).max(axis=1, initial=0.0)
    tiny = most < SMALLEST_INERTIA
    triangle = least + middle < most * (1.0 - INERTIA_TOLERANCE)
    for k in np.flatnonzero(zero | tiny | (least <= 0.0) | triangle):
        values, remedy = ", ".join(f"{x:.6g}" for x in principal[k]), ""
        if least[k] < 0.0 and not zero[k]:
            what = f"should be positive definite; principal inertias: {values}"
        elif zero[k]:
            what, remedy = f"a principal inertia is zero; principal inertias: {values}", ZERO_REMEDY
        elif tiny[k]:
            what = f"should be at least {SMALLEST_INERTIA:g}: its inverse overflows"
        else:
            what = (
                f"no body has these principal inertias: {values}; the largest is at most the sum "
                "of the other two (triangle inequality)"
            )
        report.add(keys[k], given[k], what, remedy=remedy)
