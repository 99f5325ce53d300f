"""Bodies: masses, inertia matrices, poses and velocities as arrays."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.scene.errors import MISSING
from dap3d_core.scene.scene import Body
from dap3d_core.scene.validate.coerce_columns import Floats, Keys, numbers, vectors
from dap3d_core.scene.validate.coerce_values import Fault, matrix_of, numbers_of
from dap3d_core.scene.validate.mistake_collector import Collector

#: Masses and principal inertias outside leave double precision in products and quotients.
SMALLEST_INERTIA = 1e-100
#: A quaternion farther from unit length is refused; one farther than ROUNDING is noted.
UNIT_TOLERANCE = 1e-6
ROUNDING = 1e-9
#: Relative slack of symmetry and of the triangle inequality of principal inertias.
INERTIA_TOLERANCE = 1e-9
#: A principal inertia below this part of the largest counts as zero.
ZERO_INERTIA = 1e-14

ZERO_REMEDY = (
    "an infinitely thin rod or a point mass has no unique motion: give a small value, such as "
    "1e-6 of the largest, and show by a second run with another that its effect is small"
)


@attrs.frozen(eq=False)
class Bodies:
    """Arrays of n bodies, as in ``Checked``."""

    names: tuple[str, ...]
    index: dict[str, int]
    mass: Floats
    Jp: Floats
    r: Floats
    p: Floats
    r_dot: Floats
    w: Floats


def read_bodies(report: Collector) -> Bodies:
    """The bodies of a scene as arrays; what is wrong is reported."""
    table = report.scene.bodies
    bodies, names = list(table.values()), tuple(table)
    if not bodies and not report.has(("bodies",)):
        report.add(("bodies",), MISSING, "no bodies: a scene needs at least one, [bodies.NAME]")
    _note_defaults(report, names, bodies)
    _check_colors(report, names, bodies)
    columns = {
        field: vectors(report, Keys("bodies", names, field), [getattr(b, field) for b in bodies], 3)
        for field in ("r", "r_dot", "w")
    }
    return Bodies(
        names,
        {"ground": 0} | {name: k for k, name in enumerate(names, 1)},
        _masses(report, names, bodies),
        _inertias(report, names, bodies),
        columns["r"],
        _quaternions(report, names, bodies),
        columns["r_dot"],
        columns["w"],
    )


def _note_defaults(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> None:
    for field, default in (("mass", "1.0 kg"), ("Jp", "[1.0, 1.0, 1.0] kg m^2")):
        for place, body in enumerate(bodies):
            if getattr(body, field) is None:
                report.note(
                    f"bodies.{names[place]}.{field} is not given; {default} is used",
                    f"bodies without {field}",
                )


def _check_colors(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> None:
    if {type(b.color) for b in bodies} <= {str}:
        return
    for name, body in zip(names, bodies, strict=True):
        if not isinstance(body.color, str):
            what = 'should be the name of a colour, such as "tab:blue"'
            report.add(("bodies", name, "color"), body.color, what)


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


def _quaternions(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> Floats:
    keys = Keys("bodies", names, "p")
    p = vectors(report, keys, [b.p for b in bodies], 4)
    length = np.sqrt(np.einsum("nk,nk->n", p, p))
    off = np.abs(length - 1.0)
    for k in np.flatnonzero(off > ROUNDING):
        if length[k] == 0.0:
            what = "Euler parameters of zero length mean no rotation at all"
            remedy = "write [1.0, 0.0, 0.0, 0.0] for a body that is not turned"
            report.add(keys[k], bodies[k].p, what, remedy=remedy)
        elif off[k] > UNIT_TOLERANCE:
            what = (
                f"should be four numbers e0, e1, e2, e3 of unit length (within {UNIT_TOLERANCE:g})"
                f"; the length is {length[k]:.9g}"
            )
            report.add(keys[k], bodies[k].p, what, remedy=_unit_remedy(p[k] / length[k]))
        else:
            report.note(
                f"bodies.{names[k]}.p: length {length[k]:.12g}, normalised to 1",
                "Euler parameters normalised",
            )
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(p / length[:, None])


def _unit_remedy(p: Any) -> str:
    return f"if the direction is meant, write [{', '.join(f'{x:.16g}' for x in p)}]"


def _inertias(report: Collector, names: tuple[str, ...], bodies: list[Body]) -> Floats:
    """(n, 3, 3) inertia matrices, symmetric; faulty ones become the identity."""
    J = np.tile(np.eye(3), (len(bodies), 1, 1))
    given = [b.Jp for b in bodies]
    is_full = [_has_rows(value) for value in given]
    flat = [k for k, full in enumerate(is_full) if not full and given[k] is not None]
    rows = [k for k, full in enumerate(is_full) if full]
    if flat:
        diagonal = _diagonals(report, names, [given[k] for k in flat], flat)
        J[flat] = np.einsum("nk,kl->nkl", diagonal, np.eye(3))
    for k in rows:
        matrix = matrix_of(given[k])
        if isinstance(matrix, Fault):
            report.add(("bodies", names[k], "Jp"), given[k], matrix.what, remedy=matrix.remedy)
            J[k] = np.nan
        else:
            J[k] = matrix
    good = np.isfinite(J).all(axis=(1, 2))
    J[~good] = np.eye(3)
    if rows:
        J = _symmetric(report, names, given, J)
    _check_principal(report, names, given, J)
    return J


def _has_rows(value: Any) -> bool:
    return type(value) is tuple and len(value) > 0 and type(value[0]) is tuple


def _diagonals(
    report: Collector, names: tuple[str, ...], values: list[Any], places: list[int]
) -> Floats:
    keys = Keys("bodies", [names[k] for k in places], "Jp")
    if all(type(v) is tuple and len(v) == 3 for v in values):
        return vectors(report, keys, values, 3)
    array = np.full((len(values), 3), np.nan)
    for place, value in enumerate(values):
        found: Any = numbers_of(value, 3)
        if isinstance(found, Fault) and not (type(value) is tuple and len(value) == 3):
            remedy = found.remedy
            if type(value) is tuple and len(value) == 9:
                remedy = "write three rows: [[..., ..., ...], [..., ..., ...], [..., ..., ...]]"
            what = f"should be 3 numbers (the diagonal) or 3x3; it {_count(value)}"
            report.add(keys[place], value, what, remedy=remedy)
        elif isinstance(found, Fault):
            report.add(keys[place], value, found.what, remedy=found.remedy)
        else:
            array[place] = found
    return array


def _count(value: Any) -> str:
    return f"has {len(value)} numbers" if type(value) is tuple else "is no list"


def _symmetric(report: Collector, names: tuple[str, ...], given: list[Any], J: Floats) -> Floats:
    turned = J.transpose(0, 2, 1)
    off = np.abs(J - turned).max(axis=(1, 2))
    for k in np.flatnonzero(off > INERTIA_TOLERANCE * np.abs(J).max(axis=(1, 2))):
        at = np.unravel_index(np.argmax(np.abs(J[k] - J[k].T)), (3, 3))
        a, b = int(at[0]), int(at[1])
        what = (
            f"should be symmetric; entry ({a + 1}, {b + 1}) is {J[k, a, b]:g}, "
            f"entry ({b + 1}, {a + 1}) is {J[k, b, a]:g}"
        )
        report.add(("bodies", names[k], "Jp"), given[k], what)
        J[k] = np.eye(3)
    return np.asarray(0.5 * (J + J.transpose(0, 2, 1)))


def _check_principal(
    report: Collector, names: tuple[str, ...], given: list[Any], J: Floats
) -> None:
    """Positive principal inertias that fulfil the triangle inequality, or a mistake."""
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
        words = ", ".join(f"{x:.6g}" for x in principal[k])
        if least[k] < 0.0 and not zero[k]:
            what, remedy = f"should be positive definite; principal inertias: {words}", ""
        elif zero[k]:
            what, remedy = f"a principal inertia is zero; principal inertias: {words}", ZERO_REMEDY
        elif tiny[k]:
            what, remedy = f"should be at least {SMALLEST_INERTIA:g}: its inverse overflows", ""
        else:
            remedy = ""
            what = (
                f"no body has these principal inertias: {words}; the largest is at most the sum "
                "of the other two (triangle inequality)"
            )
        report.add(("bodies", names[k], "Jp"), given[k], what, remedy=remedy)
