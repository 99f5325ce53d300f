"""Checks of a joint: J, nu, gamma, reactions, rank, rigid motions; the motion it leaves free."""

import random
from collections.abc import Sequence
from itertools import groupby, islice

import numpy as np

from dap3d_core.assembly.motion.classify import classify_group
from dap3d_core.assembly.motion.joint_motion import BALL, TRANSLATION, JointMotions, Part
from dap3d_core.assembly.motion.joint_rows import NOT_CLOSED, ON_TIME, refusal_of, refused_joints
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.element_states import unknown_names
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group
from dap3d_core.model.rigid_motion import Pose, relative
from dap3d_core.model.rotations import to_global
from dap3d_core.testing.checks.compare import (
    DIFFERENCE_TOLERANCE,
    Comparison,
    Rate,
    body_words,
    rates,
)
from dap3d_core.testing.checks.elements import rigid_motion
from dap3d_core.testing.checks.findings import CheckOutcome, TypeMotion
from dap3d_core.testing.samples.random_element import RandomElement, RefusalError, draw
from dap3d_core.testing.samples.random_state import Direction, State, random_state
from dap3d_core.testing.samples.sampled_type import (
    UNDEFINED,
    Sample,
    SampledType,
    given_rows,
    gradient_of_rows,
    position_jacobian,
)

#: Singular values relative to the largest that count as zero.
RANK_TOLERANCE = 1e-8
#: Singular values of J that count as zero, with rows of size one off the manifold:
#: Newton's method leaves |C| < 1e-11, where the gradient of a square is some 1e-5.
VANISHING = 1e-3
#: Random joints whose motions must agree, and the most that are drawn to find so many.
JOINTS, DRAWN = 3, 24
DIFFERENT = "its motion is another for other values of its fields"
NO_MOTION = "none: the bodies move as one"
#: Components of an axis below this are printed as zero.
SMALL = 5e-7

# Texts of findings: formats of the wrong number x and of further words.
_J = (
    "row {x.n} of J is wrong by {x.error:.3g} at this pose: {x.is_:.6g} is in column {column} of "
    "body {letter}, and it should be {x.should:.6g}, the derivative of row {x.n} of C by {by} "
    "({way})"
)
_NORMAL = (
    "the gap and its normal disagree by {x.error:.3g} at this pose: by {by} the gap changes at the "
    "rate {x.should:.6g}, and by normal at the point of contact at {x.is_:.6g} ({way})"
)
_G = (
    "row {x.n} of G is wrong by {x.error:.3g} at this pose: it is {x.is_:.6g} and should be "
    "{x.should:.6g}, the derivative of row {x.n} of C by the unknown {name} ({way})"
)
_NU = (
    "row {x.n} of nu is wrong by {x.error:.3g} at this pose: it is {x.is_:.6g} and should be "
    "{x.should:.6g}, minus the rate of row {x.n} of C at a fixed pose ({way})"
)
_NO_NU = (
    "nu is missing, and row {x.n} of C depends on time: row {x.n} of nu is zero and should be "
    "{x.should:.6g}, minus the rate of row {x.n} of C at a fixed pose ({way})"
)
_FORM = (
    "row {x.n} of J and nu is not the form C_dot: C_dot is {x.is_:.6g} at this pose, J v - nu is "
    "{x.should:.6g}"
)
_IS_GAMMA = (
    "row {x.n} of gamma is wrong by {x.error:.3g} at this pose: it is {x.is_:.6g} and should be "
    "{x.should:.6g}, "
)
_GAMMA = f"{_IS_GAMMA}minus the time derivative of row {{x.n}} of J, times v ({{way}})"
_GAMMA_NU = (
    f"{_IS_GAMMA}the time derivative of row {{x.n}} of nu less that of row {{x.n}} of J, times v "
    "({way})"
)
_GAMMA_FORM = (
    f"{_IS_GAMMA}minus the {{order}} of row {{x.n}} of {{form}} at constant velocities "
    "(differences)"
)
_POWER = (
    "row {x.n} of J is a reaction that does work: its power is {x.error:.3g} on a unit velocity "
    "that keeps C as it is, and should be zero"
)
_FRAME_C = (
    "row {x.n} of C notices where ground is: it was zero and is {x.is_:.3g} after a common rigid "
    "motion of all bodies; a joint between bodies should stay assembled"
)
_FRAME_J = (
    "row {x.n} of J notices where ground is: turned with the bodies, a velocity that was allowed "
    "is no more so after a common rigid motion (by {x.error:.3g})"
)
_FRAME_SIDE = (
    "row {x.n} of {name} notices where ground is: after a common rigid motion of all bodies it is "
    "{x.is_:.6g} and should be {x.should:.6g}, as J turned with them has it"
)
_BALANCE = (
    "row {x.n} of J has no reaction: the {what} that it exerts on all bodies together is "
    "{x.is_:.3g} along {x.axis} and should be zero"
)


def jacobian(subject: SampledType) -> CheckOutcome:
    """J is the derivative of C."""
    c = Comparison("J", subject, "J", "J against dC/dq, by complex step and by differences")
    rows = subject.type.position_rows()
    text = _NORMAL if subject.type.is_contact else _J
    for sample in poses(subject):
        J = sample.value("J")
        for slot in range(J.shape[0]):
            for column in range(6):
                for rate in rates(sample, "C", Direction.of(slot, column), c):
                    letter = sample.kernels.type_info.layout.slots[slot]
                    by = body_words(sample, slot, column)
                    words = dict(column=column + 1, letter=letter, by=by, way=rate.way)
                    c.compare(sample, J[slot, rows, column], rate.value, text, words=words,
                              tolerance=rate.tolerance, bound=rate.bound, rows=rows)  # fmt: skip
    return c.outcome()


def gradient_of_unknowns(subject: SampledType) -> CheckOutcome:
    """G is the derivative of C by the unknowns."""
    c = Comparison("G", subject, "G", "G against dC/ds, by complex step and by differences")
    rows, names = subject.type.position_rows(), unknown_names(subject.type)
    for sample in poses(subject):
        G = sample.value("G")
        for k, name in enumerate(names):
            for rate in rates(sample, "C", Direction.of_unknown(k, len(names)), c):
                c.compare(sample, G[:, k], rate.value, _G, words={"name": name, "way": rate.way},
                          tolerance=rate.tolerance, bound=rate.bound, rows=rows)  # fmt: skip
    return c.outcome()


def velocity_side(subject: SampledType) -> CheckOutcome:
    """The side nu is minus the rate of C in time at a fixed pose."""
    c = Comparison("nu", subject, "nu", "nu against -dC/dt at a fixed pose")
    rows, is_defined = subject.type.position_rows(), "nu" in subject.kernels.names()
    for sample in poses(subject):
        nu = sample.value("nu")[list(rows)] if is_defined else np.zeros(len(rows))
        for rate in rates(sample, "C", Direction.in_time(), c):
            c.compare(sample, nu, -rate.value, _NU if is_defined else _NO_NU,
                      words={"way": rate.way}, tolerance=rate.tolerance, bound=rate.bound,
                      rows=rows)  # fmt: skip
    return c.outcome()


def velocity_form(subject: SampledType) -> CheckOutcome:
    """The form C_dot that a type gives for its velocity rows is J v - nu."""
    c = Comparison("velocity form", subject, "C_dot", "C_dot against J v - nu")
    rows = subject.type.velocity_rows()
    for sample in poses(subject):
        J, v = sample.value("J")[:, rows], _velocities(sample)
        form = np.einsum("srk,sk->r", J, v)
        if "nu" in subject.kernels.names():
            form = form - sample.value("nu")[list(rows)]
        size = float(np.max(np.abs(J)) * np.max(np.abs(v)))
        c.compare(sample, sample.value("C_dot"), form, _FORM,
                  tolerance=1e-12, scale=size, rows=rows)  # fmt: skip
    return c.outcome()


def acceleration_side(subject: SampledType) -> CheckOutcome:
    """Gamma is the right-hand side of J v_dot = gamma, from d/dt (J v - nu) = 0.

    Rows with a wrong J or nu are compared with C (or C_dot).
    """
    c = Comparison("gamma", subject, "gamma", "gamma against the time derivative of nu - J v")
    wrong, has_nu = _rows_apart(subject), "nu" in subject.kernels.names()
    good = [k for k in range(subject.type.rows) if k not in wrong]
    position = list(subject.type.position_rows())
    for row, form in wrong.items():
        c.note(f"row {row + 1} of J or nu is not what {form} says: gamma is compared with {form}")
    for sample in poses(subject):
        along, gamma, v = sample.state.motion(), sample.value("gamma"), _velocities(sample)
        J_dot = rates(sample, "J", along, c)
        still = [Rate(np.zeros(1), None, r.tolerance, r.way) for r in J_dot]
        nu_dot = rates(sample, "nu", along, c) if has_nu else still
        for turning in J_dot:
            pushing = next((r for r in nu_dot if r.way == turning.way), nu_dot[-1])
            terms = np.einsum("srk,sk->r", turning.value, v)
            if len(sample.state.unknowns):
                terms[position] += sample.rate("G", along) @ sample.state.unknowns[:, 1]
            bound = None
            if turning.bound is not None:
                bound = np.einsum("srk,sk->r", turning.bound, np.abs(v))
                bound = (bound if pushing.bound is None else bound + pushing.bound)[good]
            tolerance = max(turning.tolerance, pushing.tolerance)
            size = float(np.max(np.abs(turning.value), initial=0.0) * np.max(np.abs(v)))
            c.compare(sample, gamma[good], (pushing.value - terms)[good],
                      _GAMMA_NU if has_nu else _GAMMA, words={"way": turning.way}, rows=good,
                      tolerance=tolerance, bound=bound, scale=size)  # fmt: skip
        for form, rows in _forms(subject):
            if apart := [k for k in rows if wrong.get(k) == form]:
                index = [rows.index(k) for k in apart]
                rate = sample.bend(along) if form == "C" else sample.difference(form, along)
                value, bound = (x[index] for x in rate)
                order = "second time derivative" if form == "C" else "time derivative"
                c.compare(sample, gamma[apart], -value, _GAMMA_FORM, rows=apart,
                          words={"order": order, "form": form},
                          tolerance=DIFFERENCE_TOLERANCE, bound=bound)  # fmt: skip
    return c.outcome()


def _forms(subject: SampledType) -> list[tuple[str, tuple[int, ...]]]:
    """The kernels of which J, nu and gamma are derivatives, and the rows of each."""
    rows = {"C": subject.type.position_rows(), "C_dot": subject.type.velocity_rows()}
    return [(form, rows[form]) for form in rows if form in subject.kernels.names() and rows[form]]


def _rows_apart(subject: SampledType) -> dict[int, str]:
    """Rows with J v - nu other than the rate of C, or than C_dot; and which of these."""
    forms = {}
    for sample in poses(subject):
        v = _velocities(sample)
        rate = np.einsum("srk,sk->r", sample.value("J"), v)
        rate = rate + gradient_of_rows(sample) @ sample.state.unknowns[:, 1]
        if "nu" in subject.kernels.names():
            rate = rate - sample.value("nu")
        for form, rows in _forms(subject):
            want, bound = sample.value(form), np.zeros(len(rows))
            if form == "C":
                want, bound = sample.difference("C", sample.state.motion())
            size = 1.0 + float(np.max(np.abs(want)))
            for k, row in enumerate(rows):
                if abs(rate[row] - want[k]) - bound[k] > DIFFERENCE_TOLERANCE * size:
                    forms[row] = form
    return forms


def virtual_power(subject: SampledType) -> CheckOutcome:
    """Reactions do no work on velocities that C allows at a fixed time."""
    c = Comparison("virtual power", subject, "J", "reactions J^T lambda do no work where C allows")
    rows = subject.type.position_rows()
    for sample in poses(subject):
        J = sample.value("J")[:, rows].transpose(1, 0, 2).reshape(len(rows), -1)
        allowed = null_space(position_jacobian(sample).reshape(len(rows), -1))
        c.compare(sample, J @ allowed, 0.0, _POWER, tolerance=1e-6,
                  scale=float(np.max(np.abs(J))), rows=rows)  # fmt: skip
    return c.outcome()


def frame(subject: SampledType) -> CheckOutcome:
    """A common rigid motion of all bodies: allowed velocities turn with the bodies."""
    c = Comparison(
        "frame", subject, "C", "the same motions are allowed after a common rigid motion"
    )
    for k, sample in enumerate(subject.assembled):
        rows = subject.type.position_rows()
        moved, R = rigid_motion(sample.state, subject.seed, k)
        if rows:
            c.kernel = "C"
            c.compare(sample, sample.value("C", moved), 0.0, _FRAME_C, rows=rows)
        J, J_moved = sample.value("J"), sample.value("J", moved)
        turned, count = np.kron(np.eye(2 * len(J)), R), J.shape[1]
        flat, flat_moved = (x.transpose(1, 0, 2).reshape(count, -1) for x in (J, J_moved))
        c.kernel = "J"
        c.compare(sample, flat_moved @ turned @ null_space(flat), 0.0, _FRAME_J)
        for name in ("nu", "gamma"):
            if name in subject.kernels.names():
                c.kernel = name
                side, side_moved = sample.value(name), sample.value(name, moved)
                solution = turned @ np.linalg.lstsq(flat, side, rcond=None)[0]
                c.compare(
                    sample, side_moved, flat_moved @ solution, _FRAME_SIDE, words={"name": name}
                )
    return c.outcome()


def action_and_reaction(subject: SampledType) -> CheckOutcome:
    """Forces, and at C = 0 moments, of a row of J on all bodies sum to zero."""
    c = Comparison(
        "action and reaction", subject, "J", "forces and moments of each row sum to zero"
    )
    rows = subject.type.position_rows()
    if len(rows) < subject.type.rows:
        c.note("moments are checked for rows of the position level only")
    for sample in subject.assembled:
        J, r = sample.value("J"), sample.state.r[1:]
        force = J[:, :, :3].sum(axis=0)
        arms = np.cross(r[: len(J), None, :], J[:, :, :3])
        moment = (J[:, :, 3:] + arms).sum(axis=0)
        c.compare(sample, force, 0.0, _BALANCE, words={"what": "force"})
        c.compare(sample, moment[list(rows)], 0.0, _BALANCE,
                  words={"what": "moment about the origin"}, rows=rows,
                  scale=float(np.max(np.abs(arms))))  # fmt: skip
    return c.outcome()


def assembly(subject: SampledType) -> CheckOutcome:
    """There are poses with C = 0."""
    c = Comparison("assembly", subject, "C", "C = 0 is reached from random poses")
    count = len(subject.assembled)
    if not count:
        c.fail("no pose with C = 0 was found from any of many random ones: its rows contradict "
               "each other, or C is not the function that J differentiates")  # fmt: skip
    elif count < subject.poses:
        c.note(f"reached from {count} of {subject.poses}")
    for sample in subject.assembled:
        c.largest = max(c.largest or 0.0, float(np.max(np.abs(sample.value("C")), initial=0.0)))
    return c.outcome()


def rank(subject: SampledType) -> CheckOutcome:
    """The rows of J are independent at one or more of the poses."""
    c = Comparison("rank", subject, "J", f"rank of J against {subject.type.rows} declared rows")
    size = np.max([np.linalg.norm(_rows_of_J(s), axis=1) for s in subject.samples], axis=0)
    size = np.where(size > 0.0, size, 1.0)[:, None]
    ranks = [(_rank(_rows_of_J(sample) / size), sample) for sample in subject.assembled]
    best, sample = max(ranks, key=lambda pair: pair[0], default=(subject.type.rows, None))
    if sample is not None and best < subject.type.rows:
        rows = _rows_of_J(sample) / size
        row = next(k for k in range(1, len(rows) + 1) if _rank(rows[:k]) < k)
        off = max(_rank(_rows_of_J(s) / size) for s in subject.samples)
        why = f"row {row} follows from those before it, so one row is too many"
        if off > best:
            why = (
                f"where C = 0 the gradient of row {row} vanishes or follows from those before it, "
                f"though elsewhere the rank is {off}, so that nothing holds the bodies there; is C "
                "a square, whose root would do?"
            )
        c.fail(f"the rank of J is {best} at best, and {subject.type.rows} rows are declared: "
               f"{why}", sample, row)  # fmt: skip
    return c.outcome(sized=False)


def _rows_of_J(sample: Sample) -> Floats:
    """(rows, columns) J of the bodies that are not on ground, and G."""
    J = sample.value("J")
    J = J[[s for s in range(len(J)) if not (sample.grounded and s == 1)]]
    return np.hstack([J.transpose(1, 0, 2).reshape(J.shape[1], -1), gradient_of_rows(sample)])


def _rank(rows: Floats) -> int:
    """The rank of rows with sizes of about one off the manifold."""
    return int(np.sum(np.linalg.svd(rows, compute_uv=False) > VANISHING))


def null_space(matrix: Floats) -> Floats:
    """(columns, n) orthonormal basis of the null space of a matrix."""
    _, values, right = np.linalg.svd(matrix)
    count = int(np.sum(values > RANK_TOLERANCE * max(np.max(values, initial=0.0), 1e-300)))
    return right[count:].T


def poses(subject: SampledType) -> list[Sample]:
    """Random poses off the manifold and on it."""
    return [*subject.samples, *subject.assembled]


def against_ground(subject: SampledType) -> str:
    """The reason why a type need not be invariant to rigid motions; "" where it must be."""
    specs = specs_of(subject.type)
    fixed = [name for name, spec in specs.items() if spec.kind == "vector" and spec.ground]
    if fixed:
        return f"{fixed[0]} is a vector of ground"
    if len(subject.type_info.layout.slots) < 2:
        return "it acts between one body and ground"
    if subject.type.ground_axes:
        return "it is declared to use the axes of ground (ground_axes = True)"
    return ""


def _velocities(sample: Sample) -> Floats:
    return sample.state.velocities(len(sample.kernels.type_info.layout.slots))


def motion_of_type(subject: SampledType) -> TypeMotion:
    """The motion that random joints of a type have in common, or why there is none.

    Functions of time are absent where the type allows it.

    Raises:
        PluginError: the kernels of the type cannot be compiled.
    """
    reason = refusal_of(subject.type_info)
    if reason:
        drives = subject.type.drives and not subject.type.velocity_rows()
        return _refused(subject, ON_TIME if drives else reason)
    rng = random.Random(f"{subject.seed} {subject.type.__qualname__} motion")
    drawn = (_verdict(subject, rng) for _ in range(DRAWN))
    found = list(islice((verdict for verdict in drawn if verdict is not None), JOINTS))
    motions = [motion for motion, _ in found if motion is not None]
    reasons = {reason for _, reason in found}
    if not motions:
        return _refused(subject, reasons.pop() if len(reasons) == 1 else NOT_CLOSED)
    parts = motions[0].parts
    if len(motions) < len(found) or any(motion.parts != parts for motion in motions):
        return _refused(subject, DIFFERENT)
    axes = zip(*map(axis_words, motions), strict=True)
    common = [words[0] if len(set(words)) == 1 else "" for words in axes]
    return TypeMotion(subject.variant, motion_words(parts, common), parts)


def _refused(subject: SampledType, reason: str) -> TypeMotion:
    return TypeMotion(subject.variant, f"rows stay: {reason}", None)


def _verdict(subject: SampledType, rng: random.Random) -> tuple[JointMotions | None, str] | None:
    """The motion of a random joint, or the reason why it has none; None if there is no joint."""
    type_info = subject.type_info
    specs = specs_of(subject.type)
    given = given_rows(type_info, lambda: False)
    names = type_info.layout.functions
    given = [specs[n].required or one for n, one in zip(names, given, strict=True)]
    state = random_state(rng, given, grounded=False)
    try:
        group = _group_of(type_info, draw(type_info, subject.drawn_choices, rng, state))
    except (RefusalError, *UNDEFINED):
        return None
    if reasons := refused_joints(group):
        return None, reasons[0]
    pose = relative(*(_pose(state, b) for b in (2, 1)))
    if len(type_info.layout.slots) == 1:
        pose = _pose(state, 1)
    motions, reasons = classify_group(group, state.mass, state.Jp.reshape(-1, 3, 3), pose)
    if not motions:
        return None if reasons[0] == NOT_CLOSED else (None, reasons[0])
    return motions[0], ""


def _group_of(type_info: TypeInfo, element: RandomElement) -> Group:
    """A group of one random joint."""
    layout, par = type_info.layout, np.array(element.par)
    slots, others = len(layout.slots), len(layout.functions) + len(layout.others)
    tables = []
    for offset, columns in layout.tables.values():
        start, count = int(par[offset]), int(par[offset + 1])
        tables.append((0, offset, par[start : start + count * columns].reshape(count, columns)))
    idx = np.array([element.idx], dtype=np.int64)
    return Group(type_info, np.array([0]), idx[:, :slots], idx[:, slots : slots + others],
                 par[None, : layout.par_width], tuple(tables))  # fmt: skip


def _pose(state: State, body: int) -> Pose:
    return Pose(state.r[body : body + 1], state.p[body : body + 1])


def motion_words(parts: Sequence[Part], axes: Sequence[str] = ()) -> str:
    """A motion such as "1 rotation about a_j, constant in body j".

    Args:
        parts: its elementary motions.
        axes: words for the axis of each part that has no name; "" for none.
    """
    if not parts:
        return NO_MOTION
    axes = axes or [""] * len(parts)
    texts = []
    for slot, of_slot in groupby(
        zip(parts, axes, strict=True), key=lambda pair: pair[0].constant_in
    ):
        kinds = [
            _alike(list(alike)) for _, alike in groupby(of_slot, key=lambda pair: pair[0].kind)
        ]
        where = "ground" if slot == "ground" else f"body {slot}"
        texts.append(f"{' and '.join(kinds)}, constant in {where}")
    return ", and ".join(texts)


def axis_words(motion: JointMotions) -> list[str]:
    """Of each part without a name, its axis in the axes of the body that it is constant in."""
    words = []
    for k, part in enumerate(motion.parts):
        axis = motion.axis(k)[0]
        if part.constant_in != motion.slots[0]:
            axis = to_global(motion.start.p[0], axis)
        words.append("" if part.name or part.kind == BALL else _vector(axis))
    return words


def _alike(pairs: list[tuple[Part, str]]) -> str:
    """Parts of the same kind that are constant in the same body."""
    kind = pairs[0][0].kind
    count = sum(part.size for part, _ in pairs)
    noun = "rotation" if kind == BALL else kind
    names = [name for part, axis in pairs if (name := part.name or axis)]
    preposition = "along" if kind == TRANSLATION else "about"
    if not names and kind == BALL:
        names = ["a point"]
    where = f" {preposition} {' and '.join(names)}" if names else ""
    return f"{count} {noun}{'s' * (count > 1)}{where}"


def _vector(axis: Floats) -> str:
    """Three components of a direction."""
    return f"({', '.join(f'{0.0 if abs(x) < SMALL else x:.6g}' for x in axis.tolist())})"
