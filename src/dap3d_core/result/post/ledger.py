"""The ledger of a run: what should be conserved or zero, how far it is, and how far it may be.

Error control keeps the error of each step below ``atol + rtol |y|``. The errors of many steps add
up; a run is called good while they come to no more than LOOSE times that. A run of fixed steps has
no tolerance: it is called good while what should be conserved is so to FIXED. Whatever the
tolerances, no limit is above MOST of a quantity's scale, and the scale is the scene's: its energy
at the start and the work done, its extent, speeds that this energy allows. A run that blows up has
larger ones. Drift is not accuracy: a small entry does not prove a right result, a large one proves
a wrong one.
"""

from collections.abc import Mapping

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split, velocities_of
from dap3d_core.result.arrays import Arrays, ModelSummary
from dap3d_core.result.metadata import RunMetadata
from dap3d_core.result.post.point_motion import kinetic_energy, momentum

#: How many steps' worth of error a run may gather.
LOOSE = 1e3
#: What a run of fixed steps may be off by, as an estimate of its error may (global_error.py).
FIXED = 1e-3
#: The largest limit, as a part of a quantity's scale.
MOST = 1e-2
#: Relative rounding error of sums over a run.
SUM_ROUNDING = 1e-12
#: Residual, relative to 1 + largest magnitude, up to which a projection counts as converged
#: (formulations/standard.py: 1e3 times its tolerance 1e-13).
PROJECTED = 1e-10
#: Relative residual of solved equations of motion, whose condition is ordinary.
SOLVED = 1e-9
#: Roundings in the reactions of a solution, as a part of them: its backward error.
BACKWARD = 10.0 * float(np.finfo(float).eps)
#: A residual of stepped contacts, as a part of the largest impulse, and an overlap, as a part of
#: the length of the scene.
UNSOLVED = 1e-3
#: Scales are not zero.
SMALLEST = float(np.finfo(float).tiny)
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


@attrs.frozen(eq=False, kw_only=True)
class LedgerSeries:
    """Time series that the ledger is computed from, at nt instants.

    Attributes:
        t, work, potential_energy, position_residual, velocity_residual, acceleration_residual:
            (nt,) as in ``Arrays``.
        kinetic: (nt,) kinetic energy, J.
        speed, spin: (nt,) sums over the bodies of m |r_dot|, kg m/s, and of |J| |omega|, kg m^2/s.
        off_unit: (nt,) largest deviation of Euler parameters from unit length.
        reaction: (nt,) sum of the magnitudes of all multipliers, SI.
        far, orbit: (nt,) sums of m |r|, kg m, and of m |r| |r_dot|, kg m^2/s.
        linear, angular: (nt, 3) momenta, kg m/s, kg m^2/s about the origin.
        sizes: largest magnitude of a coordinate, a velocity and an acceleration, those of angles
            times the length that tolerances refer to (m, m/s, m/s^2).
        first_size: largest magnitude of a coordinate at the start, m.

    ``far``, ``orbit``, ``linear`` and ``angular`` only of an isolated system, else (0,).
    """

    t: Floats
    work: Floats
    potential_energy: Floats
    position_residual: Floats
    velocity_residual: Floats
    acceleration_residual: Floats
    kinetic: Floats
    speed: Floats
    spin: Floats
    off_unit: Floats
    reaction: Floats
    far: Floats = attrs.Factory(lambda: np.zeros(0))
    orbit: Floats = attrs.Factory(lambda: np.zeros(0))
    linear: Floats = attrs.Factory(lambda: np.zeros(0))
    angular: Floats = attrs.Factory(lambda: np.zeros(0))
    sizes: list[float]
    first_size: float

    @classmethod
    def of(cls, summary: ModelSummary, arrays: Arrays, length: float) -> "LedgerSeries":
        """The series of a run, computed block by block in little memory."""
        blocks, sizes = [], np.zeros(3)
        for block in arrays.blocks():
            blocks.append(_series(summary, block))
            arms = np.tile(np.repeat([1.0, length], 3), summary.body_count)
            sized = (split(block.u)[0], arms * velocities_of(block.u), arms * block.v_dot)
            sizes = np.maximum(sizes, [_largest(a) for a in sized])
        series = {name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]}
        first_size = _largest(split(arrays.part(slice(1)).u)[0])
        return cls(**series, sizes=sizes.tolist(), first_size=first_size)


def _series(summary: ModelSummary, block: Arrays) -> dict[str, Floats]:
    """Series of a block of instants by name."""
    r, p, rd, w = split(block.u)
    fast = np.linalg.norm(rd, axis=2)
    inertia = np.linalg.norm(summary.Jp, ord=2, axis=(1, 2))
    off = np.abs(np.linalg.norm(p, axis=2) - 1.0)
    residuals = ("position_residual", "velocity_residual", "acceleration_residual")
    series = {name: getattr(block, name) for name in ("t", "work", "potential_energy", *residuals)}
    series |= {
        "kinetic": kinetic_energy(summary, block.u),
        "speed": fast @ summary.mass,
        "spin": np.linalg.norm(w, axis=2) @ inertia,
        "off_unit": off.max(axis=1, initial=0.0),
        "reaction": np.abs(block.Lam).sum(axis=1),
    }
    if summary.is_isolated:
        far = np.linalg.norm(r, axis=2)
        series |= {"far": far @ summary.mass, "orbit": (far * fast) @ summary.mass}
        series |= dict(zip(("linear", "angular"), momentum(summary, block.u), strict=True))
    return series


#: Work of dampers and drivers below this part of all work is taken for an error of integration,
#: where the elements of the scene do no such work.
CONSERVATIVE = 1e-3


def ledger_of(summary: ModelSummary, arrays: Arrays, record: RunMetadata) -> dict[str, Entry]:
    """All entries of a run, by name; none for a run without reported instants.

    Names: energy (unless the work is defined by it, as in kinematics); total energy (where
    potentials, and contacts that are stepped, alone do work); residual, overlap and contact work of
    contacts that are stepped; momentum (where nothing outside acts on the bodies); position,
    velocity, acceleration; quaternion.
    """
    if not len(arrays):
        return {}
    course = LedgerSeries.of(summary, arrays, record.length)
    entries = {}
    kinetic, work, total = course.kinetic, course.work, course.kinetic + course.potential_energy
    if not record.settings.get("work_from_energy"):  # by its definition it would agree
        change = (kinetic - kinetic[0]) - (work - work[0])
        what = "change of kinetic energy less work of forces and drivers"
        entries["energy"] = _energy(summary, course, record, change, what)
    if stepping := record.stepping:
        entries |= _contacts(summary, course, record, stepping)
    elif summary.has_potential and _is_conservative(summary, course, record):
        what = "change of kinetic and potential energy"
        entries["total energy"] = _energy(summary, course, record, total - total[0], what)
    if summary.is_isolated:
        entries["momentum"] = _momentum(summary, course, record)
    entries |= _constraints(summary, course, record)
    entries["quaternion"] = _quaternion(course, record)
    return entries


def _contacts(
    summary: ModelSummary, course: LedgerSeries, record: RunMetadata, found: Mapping[str, float]
) -> dict[str, Entry]:
    """What is left of contacts that are stepped, and of energy with what they take.

    Positions are moved by other rules than velocities, and so work is compared with potentials. By
    their laws contacts take energy in each step.
    """
    took, rubbed = found["contact_work"], found["friction_work"]
    words = f"work of friction {rubbed:.6g} J, of impacts {took - rubbed:.6g} J; that gained"
    at_end = np.zeros_like(course.t)
    at_end[-1] = 1.0
    entries = {
        "residual": _entry(found["largest_residual"], UNSOLVED, "1", "of the largest impulse"),
        "overlap": _entry(found["deepest"], UNSOLVED * record.length, "m", "at ends of steps"),
        "contact work": _energy(summary, course, record, found["work_given"] * at_end, words),
    }
    if summary.has_potential and record.settings.get("conservative") and record.status == "done":
        total = course.kinetic + course.potential_energy
        change, what = (total[-1] - total[0] - took) * at_end, "change of energy less their work"
        entries["total energy"] = _energy(summary, course, record, change, what)
    return entries


def _relative_limit(record: RunMetadata) -> float:
    """LOOSE rtol, and rounding."""
    control = record.tolerances
    return FIXED if control is None else LOOSE * control[0] + SUM_ROUNDING


def _floors(record: RunMetadata) -> dict[str, float]:
    """Magnitudes below which error control is absolute, not relative: atol / rtol; 0 without it."""
    control = record.tolerances
    if control is None:
        return dict.fromkeys("rpvw", 0.0)
    return {name: atol / control[0] for name, atol in control[1].items()}


def _energy_scale(summary: ModelSummary, course: LedgerSeries, record: RunMetadata) -> float:
    """Scale for an imbalance of energy, J: the kinetic energy at the start and the work done.

    Work of all forces together, and of those with a potential: what friction or a driver takes away
    while a weight sinks has errors of its own size, not of that of the difference. Work is done
    between the reported instants, too: the record has the most at accepted steps.

    A system at rest does no work; its scale is such that its rounding may be MOST of it. It is not
    at rest where it moves with more than that: loads of a run that blew up are no measure.
    """
    rounding = _rounding_at_rest(summary, course, record)
    is_at_rest = _largest(course.kinetic) <= rounding
    work = max(_largest(course.work - course.work[0]), float(record.settings.get("most_work", 0.0)))
    exchanged = _largest(course.potential_energy - course.potential_energy[0])
    return max(
        float(course.kinetic[0]) + max(work, exchanged),
        rounding / MOST if is_at_rest else 0.0,
        SMALLEST,
    )


def _rounding_at_rest(summary: ModelSummary, course: LedgerSeries, record: RunMetadata) -> float:
    """Energy that a system at rest seems to gain, J.

    That is rounding of its potential, and what the reactions do along what the constraints leave
    open, and velocities. The potential alone would not do: its zero is anybody's choice.
    """
    open_ = PROJECTED * record.length
    far = PROJECTED * course.first_size
    work_of_reactions = (open_ + far) * _largest(course.reaction)
    moving = open_**2 * float(summary.mass.sum()) + PROJECTED**2 * _inertia(summary)
    return SUM_ROUNDING * _largest(course.potential_energy) + work_of_reactions + moving


def _inertia(summary: ModelSummary) -> float:
    """Sum of the bodies' largest principal inertias, kg m^2."""
    return float(np.linalg.norm(summary.Jp, ord=2, axis=(1, 2)).sum())


def _energy(
    summary: ModelSummary, course: LedgerSeries, record: RunMetadata, change: Floats, what: str
) -> Entry:
    """A change (nt,), J, that should be zero, relative to the energies of the scene."""
    worst, when = _worst(change, course.t)
    scale = _energy_scale(summary, course, record)
    text = f"{what}: {worst:.2g} J at t = {when:g} s, relative to {scale:.3g} J"
    floors = _floors(record)
    absolute = float(np.max(floors["v"] * course.speed + floors["w"] * course.spin))
    allowed = _relative_limit(record) * (scale + absolute) + _rounding_of_rates(course, record)
    allowed += _rounding_at_rest(summary, course, record)
    return _entry(worst / scale, min(allowed / scale, MOST), "1", text)


def _rounding_of_rates(course: LedgerSeries, record: RunMetadata) -> float:
    """What rounding of the rates may make of the energy of a run, J.

    Where the last digits of positions change accelerations by more than the tolerances ask for, the
    run has that change, b (integrators/stepping/rounding.py). Velocities may be off by b T after a
    time T, and the energy by m v b T; no shorter step would have less.
    """
    noise = record.settings.get("rate_noise", {"v": 0.0, "w": 0.0})
    power = noise["v"] * _largest(course.speed) + noise["w"] * _largest(course.spin)
    return float(power * (course.t[-1] - course.t[0]))


def _is_conservative(summary: ModelSummary, course: LedgerSeries, record: RunMetadata) -> bool:
    """True if potentials account for all work: by the kinds of the elements, and as measured.

    As measured, because a damper may act only where bodies touch.
    """
    work, potential = course.work, course.potential_energy
    other = (work - work[0]) + (potential - potential[0])
    little = _largest(other) <= CONSERVATIVE * _energy_scale(summary, course, record)
    return little and bool(record.settings.get("conservative"))


def _momentum(summary: ModelSummary, course: LedgerSeries, record: RunMetadata) -> Entry:
    """Drift of linear and angular momentum, relative to the momenta of the bodies added up."""
    floors, mass, inertia = _floors(record), float(summary.mass.sum()), _inertia(summary)
    part = _allowed_speed(summary, course, record)
    still = PROJECTED / MOST * record.length * mass  # rounding of a system at rest
    turning = still * (record.length + course.first_size) + PROJECTED / MOST * inertia
    far = _largest(floors["v"] * course.far + floors["r"] * course.speed)
    found = []
    for values, size, rest, absolute in (
        (course.linear, course.speed, still, floors["v"] * mass),
        (course.angular, course.orbit + course.spin, turning, far + floors["w"] * inertia),
    ):
        scale = max(part * _largest(size), rest)
        worst, _ = _worst(np.linalg.norm(values - values[0], axis=1), course.t)
        limit = min(_relative_limit(record) * (scale + absolute) / scale, MOST)
        found.append((worst / scale, limit))
    text = (
        f"relative drift of linear momentum {found[0][0]:.2g}, of angular momentum about the "
        f"origin {found[1][0]:.2g}"
    )
    value, limit = max(found, key=lambda pair: np.nan_to_num(pair[0] / pair[1], nan=np.inf))
    return _entry(value, limit, "1", text)


def _allowed_speed(summary: ModelSummary, course: LedgerSeries, record: RunMetadata) -> float:
    """Speeds that the energy of the scene allows, as a part of those of the run: 1 of a good run.

    Of a run that gains energy from nowhere the largest speed is no measure of anything.
    """
    allowed = _energy_scale(summary, course, record) / max(_largest(course.kinetic), SMALLEST)
    return float(min(1.0, allowed) ** 0.5)


def _constraints(
    summary: ModelSummary, course: LedgerSeries, record: RunMetadata
) -> dict[str, Entry]:
    """Largest residuals of the constraints at the three levels.

    Position and velocity: with projection as far as a projection may leave them, else what errors
    of steps come to. Acceleration: the equations solved for it, at any tolerance, and what rounding
    of the reactions makes of it. None above MOST of the scene's extent, or of the speeds and
    accelerations that its energy allows; where nothing moves, of rounding.
    """
    sizes = [record.length + size for size in course.sizes]
    part, rounding = _allowed_speed(summary, course, record), record.length / MOST
    scales = (
        record.extent,
        max(part * course.sizes[1], PROJECTED * rounding),
        max(part**2 * course.sizes[2], SOLVED * rounding),
    )
    allowed = (
        *(_state_limit(record, size, q) for size, q in zip(sizes[:2], "rv", strict=True)),
        SOLVED * sizes[2] + _rounding_of_accelerations(summary, course, record.length),
    )
    limits: list[float | None] = [
        min(limit, MOST * scale) for limit, scale in zip(allowed, scales, strict=True)
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
        text = f"largest |{residual}| of {summary.row_count} constraint rows, at t = {when:g} s"
        if not summary.row_count:
            text = "no constraints"
        found[name] = _entry(worst, limit, "SI", text)
    return found


def _rounding_of_accelerations(summary: ModelSummary, course: LedgerSeries, length: float) -> float:
    """Residual D v_dot - gamma due to rounding of the reactions, m/s^2.

    The factors L D L^T of the matrix K of the equations of motion give a solution x of an equation
    that is off by a few roundings: |K x - b| <= c eps |K| |x| (Higham, Accuracy and Stability of
    Numerical Algorithms, chapters 10 and 11). |K| |x| has the reactions |D^T lambda| in the rows of
    the bodies; an error of c eps of them is one of c eps |D^T lambda| / m in accelerations, which
    may be small differences of large reactions. An error of lambda itself of 1e-6 is 1e8 of that.

    A moment turns the lightest body about its second smallest principal axis: the joints of a thin
    rod have no lever about the first.
    """
    second = np.linalg.eigvalsh(summary.Jp)[:, 1] / length**2
    lightest = float(np.min(np.minimum(summary.mass, second), initial=np.inf))
    return BACKWARD * _largest(course.reaction) / lightest


def _state_limit(record: RunMetadata, size: float, quantity: str) -> float:
    if record.projected:
        return PROJECTED * size
    control = record.tolerances
    return FIXED * size if control is None else LOOSE * (control[0] * size + control[1][quantity])


def _quaternion(course: LedgerSeries, record: RunMetadata) -> Entry:
    """Euler parameters are normalised by projection; without it their length drifts."""
    worst, when = _worst(course.off_unit, course.t)
    limit = UNIT_LENGTH if record.projected else min(_state_limit(record, 1.0, "p"), MOST)
    text = f"largest deviation of Euler parameters from unit length, at t = {when:g} s"
    return _entry(worst, limit, "1", text)


def _worst(values: Floats, t: Floats) -> tuple[float, float]:
    """Largest magnitude, NaN where one is NaN, and when it occurs."""
    k = int(np.argmax(np.abs(values)))  # argmax stops at a NaN
    return float(abs(values[k])), float(t[k])


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))
