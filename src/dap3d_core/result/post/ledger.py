"""The ledger of a run: what should be conserved or zero, how far it is, and how far it may be.

Error control keeps the error of each step below ``atol + rtol |y|``. The errors of many steps add
up; a run is called good while they come to no more than LOOSE times that. A run of fixed steps has
no tolerance: it is called good while what should be conserved is so to FIXED. Drift is not
accuracy: a small entry does not prove a right result, a large one proves a wrong one.
"""

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import Arrays
from dap3d_core.result.file.lazy_arrays import FileArrays
from dap3d_core.result.metadata import Record
from dap3d_core.result.model_summary import Subject
from dap3d_core.result.post.ledger_series import Course, course_of

#: How many steps' worth of error a run may gather.
LOOSE = 1e3
#: What a run of fixed steps may be off by, as an estimate of its error may (global_error.py).
FIXED = 1e-3
#: Relative rounding error of sums over a run.
ROUNDING = 1e-12
#: Residual, relative to 1 + largest magnitude, up to which a projection counts as converged
#: (formulations/standard.py: 1e3 times its tolerance 1e-13).
PROJECTED = 1e-10
#: Relative residual of solved equations of motion, whose condition is ordinary.
SOLVED = 1e-9
#: Roundings in the reactions of a solution, as a part of them: its backward error.
BACKWARD = 10.0 * float(np.finfo(float).eps)
#: Deviation of normalised Euler parameters from unit length.
UNIT_LENGTH = 1e-12


@attrs.frozen
class Entry:
    """One line of the ledger.

    Attributes:
        value: how far it is off, largest over the reported instants.
        limit: how far it may be; None where nothing says so.
        ok: whether it is within the limit (NaN is not); None without a limit.
        unit: of value and limit; "1" for relative ones.
        text: what was compared with what, in a sentence.
    """

    value: float
    limit: float | None
    ok: bool | None
    unit: str
    text: str


def _entry(value: float, limit: float | None, unit: str, text: str) -> Entry:
    value = float(value)
    limit = None if limit is None else float(limit)
    return Entry(value, limit, None if limit is None else bool(value <= limit), unit, text)


#: Work of dampers and drivers below this part of all work is taken for an error of integration,
#: where the elements of the scene do no such work.
CONSERVATIVE = 1e-3


def ledger_of(subject: Subject, arrays: Arrays | FileArrays, record: Record) -> dict[str, Entry]:
    """All entries of a run, by name; none for a run without reported instants.

    Names: energy; total energy (where potentials alone do work); momentum (where nothing
    outside acts on the bodies); position, velocity, acceleration; quaternion.
    """
    if not len(arrays):
        return {}
    course = course_of(subject, arrays, record.length)
    entries = {"energy": _energy(subject, course, record)}
    if subject.has_potential and _is_conservative(subject, course, record):
        entries["total energy"] = _total_energy(subject, course, record)
    if subject.is_isolated:
        entries["momentum"] = _momentum(subject, course, record)
    entries |= _constraints(subject, course, record)
    entries["quaternion"] = _quaternion(course, record)
    return entries


def _relative_limit(record: Record) -> float:
    """LOOSE rtol, and rounding."""
    control = record.tolerances
    return FIXED if control is None else LOOSE * control[0] + ROUNDING


def _floors(record: Record) -> dict[str, float]:
    """Magnitudes below which error control is absolute, not relative: atol / rtol; 0 without it."""
    control = record.tolerances
    if control is None:
        return dict.fromkeys("rpvw", 0.0)
    return {name: atol / control[0] for name, atol in control[1].items()}


def _energy_scale(subject: Subject, course: Course, record: Record) -> float:
    """What an imbalance of energy is compared with, J: the largest kinetic energy or work.

    Below a speed of atol / rtol error control is absolute: an error atol of the speed v is one of
    m v atol in the energy, to which m v (atol / rtol) is the scale, and without a speed it is one
    of m atol^2. A system at rest has rounding errors of its potential for energy, and of what the
    reactions do along what the constraints leave open; they are given the share that ROUNDING is of
    the limit. The potential alone would not do: its zero is anybody's choice.

    Work is done between the reported instants, too: the record has the most at accepted steps.
    """
    floors, limit = _floors(record), _relative_limit(record)
    kinetic = np.max(course.kinetic + floors["v"] * course.speed + floors["w"] * course.spin)
    at_rest = ROUNDING * _largest(course.potential_energy)
    at_rest += PROJECTED * (record.length + course.sizes[0]) * _largest(course.reaction)
    if record.tolerances is not None:
        atol = record.tolerances[1]
        at_rest += atol["v"] ** 2 * subject.mass.sum() + atol["w"] ** 2 * _inertia(subject)
    work = max(_largest(course.work - course.work[0]), float(record.settings.get("most_work", 0.0)))
    return max(float(kinetic), work, at_rest / limit, float(np.finfo(float).tiny))


def _inertia(subject: Subject) -> float:
    """Sum of the bodies' largest principal inertias, kg m^2."""
    return float(np.linalg.norm(subject.Jp, ord=2, axis=(1, 2)).sum())


def _energy(subject: Subject, course: Course, record: Record) -> Entry:
    """Kinetic energy against the work done by forces and drivers, dampers included."""
    kinetic, work = course.kinetic, course.work
    worst, when = _worst((kinetic - kinetic[0]) - (work - work[0]), course.t)
    scale = _energy_scale(subject, course, record)
    text = (
        f"change of kinetic energy less work of forces and drivers: {worst:.2g} J "
        f"at t = {when:g} s, relative to {scale:.3g} J"
    )
    return _entry(worst / scale, _relative_limit(record), "1", text)


def _is_conservative(subject: Subject, course: Course, record: Record) -> bool:
    """Whether potentials account for all work: by what the elements are, and as measured.

    As measured, because a damper may act only where bodies touch.
    """
    work, potential = course.work, course.potential_energy
    other = (work - work[0]) + (potential - potential[0])
    little = _largest(other) <= CONSERVATIVE * _energy_scale(subject, course, record)
    return little and bool(record.settings.get("conservative"))


def _total_energy(subject: Subject, course: Course, record: Record) -> Entry:
    """Change of kinetic and potential energy together: zero where potentials alone do work."""
    total = course.kinetic + course.potential_energy
    worst, when = _worst(total - total[0], course.t)
    scale = _energy_scale(subject, course, record)
    text = (
        f"change of kinetic and potential energy: {worst:.2g} J at t = {when:g} s, relative to "
        f"{scale:.3g} J"
    )
    return _entry(worst / scale, _relative_limit(record), "1", text)


def _momentum(subject: Subject, course: Course, record: Record) -> Entry:
    """Drift of linear and angular momentum, relative to the momenta of the bodies added up."""
    floors = _floors(record)
    far = floors["v"] * course.far + floors["r"] * course.speed
    scales = (
        np.max(course.speed) + floors["v"] * subject.mass.sum(),
        np.max(course.orbit + far + course.spin) + floors["w"] * _inertia(subject),
    )
    drifts = []
    for values, scale in zip((course.linear, course.angular), scales, strict=True):
        worst, _ = _worst(np.linalg.norm(values - values[0], axis=1), course.t)
        drifts.append(worst / max(float(scale), float(np.finfo(float).tiny)))
    text = (
        f"relative drift of linear momentum {drifts[0]:.2g}, of angular momentum about the origin "
        f"{drifts[1]:.2g}"
    )
    return _entry(float(np.max(drifts)), _relative_limit(record), "1", text)


def _constraints(subject: Subject, course: Course, record: Record) -> dict[str, Entry]:
    """Largest residuals of the constraints at the three levels.

    Position and velocity: with projection as far as a projection may leave them, else what errors
    of steps come to. Acceleration: the equations solved for it, at any tolerance, and what rounding
    of the reactions makes of it.
    """
    sizes = [record.length + size for size in course.sizes]
    limits: list[float | None] = [
        *(_state_limit(record, size, q) for size, q in zip(sizes[:2], "rv", strict=True)),
        SOLVED * sizes[2] + _rounding_of_accelerations(subject, course, record.length),
    ]
    from dap3d_core.formulations import FORMULATIONS  # results are read without it

    formulation = FORMULATIONS.get(record.method)
    if formulation is not None and not formulation.is_exact:
        limits[2] = None  # its springs give way, by lambda / alpha
    found = {}
    for name, residual, limit in zip(
        ("position", "velocity", "acceleration"), ("C", "D v - nu", "D v_dot - gamma"), limits,
        strict=True,
    ):  # fmt: skip
        worst, when = _worst(getattr(course, f"{name}_residual"), course.t)
        text = f"largest |{residual}| of {subject.row_count} constraint rows, at t = {when:g} s"
        if not subject.row_count:
            text = "no constraints"
        found[name] = _entry(worst, limit, "SI", text)
    return found


def _rounding_of_accelerations(subject: Subject, course: Course, length: float) -> float:
    """What rounding of the reactions leaves of D v_dot - gamma, m/s^2.

    The factors L D L^T of the matrix K of the equations of motion give a solution x of an equation
    that is off by a few roundings: |K x - b| <= c eps |K| |x| (Higham, Accuracy and Stability of
    Numerical Algorithms, chapters 10 and 11). |K| |x| has the reactions |D^T lambda| in the rows of
    the bodies; an error of c eps of them is one of c eps |D^T lambda| / m in accelerations, which
    may be small differences of large reactions. An error of lambda itself of 1e-6 is 1e8 of that.

    A moment turns the lightest body about its second smallest principal axis: the joints of a thin
    rod have no lever about the first.
    """
    second = np.linalg.eigvalsh(subject.Jp)[:, 1] / length**2
    lightest = float(np.min(np.minimum(subject.mass, second), initial=np.inf))
    return BACKWARD * _largest(course.reaction) / lightest


def _state_limit(record: Record, size: float, quantity: str) -> float:
    if record.projected:
        return PROJECTED * size
    control = record.tolerances
    return FIXED * size if control is None else LOOSE * (control[0] * size + control[1][quantity])


def _quaternion(course: Course, record: Record) -> Entry:
    """Euler parameters are normalised by projection; without it their length drifts."""
    worst, when = _worst(course.off_unit, course.t)
    limit = UNIT_LENGTH if record.projected else _state_limit(record, 1.0, "p")
    text = f"largest deviation of Euler parameters from unit length, at t = {when:g} s"
    return _entry(worst, limit, "1", text)


def _worst(values: Floats, t: Floats) -> tuple[float, float]:
    """Largest magnitude, NaN where one is NaN, and when it occurs."""
    k = int(np.argmax(np.abs(values)))  # argmax stops at a NaN
    return float(abs(values[k])), float(t[k])


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))
