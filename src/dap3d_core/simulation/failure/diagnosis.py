"""Finds the body, force or joint that first produced a non-finite or overflowing value."""

import numpy as np

from dap3d_core.assembly.arrays import KINDS
from dap3d_core.assembly.evaluate import place_state
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.pivots import near_singular_rows
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.function_lists import call_loop
from dap3d_core.model import Group
from dap3d_core.model.state_layout import by_body, velocities_of
from dap3d_core.registry.suggestions import some
from dap3d_core.scene.validate.coerce_values import LARGEST

#: Where to look behind the last good state, as parts of the time.
AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)

#: A row this many times the others, in its own units, indicates a pose that its joint cannot have.
STEEP = 1e6
#: A state or a rate, in SI units, beyond which no step succeeds for long: cubes soon overflow.
ENORMOUS = 1e50


@IGNORE_FLOAT_ERRORS
def find_offender(evaluator: Evaluator, t: float, y: Floats, t_stop: float) -> str:
    """Name what is not finite, or too large, at or just after time t with the integrated state y.

    "" where nothing is.
    """
    for later in (t, t_stop, *(t + part * (1.0 + abs(t)) for part in AHEAD)):
        found = _at(evaluator, later, y)
        if found:
            return f"{found} (t = {later:.9g} s)"
    return _steepest(evaluator, t, y) or _runaway(evaluator, t, y)


def fastest_body(evaluator: Evaluator, y: Floats) -> str:
    """Name the body whose velocities are the largest; where all is finite it is to blame."""
    n = evaluator.model.body_count
    speeds = np.abs(velocities_of(evaluator.bodies_of(y))).reshape(n, -1)
    b = int(np.argmax(speeds.max(axis=1)))
    v, w = speeds[b, :3].max(), speeds[b, 3:].max()
    return (
        f"it was so within a step, not before; body {evaluator.model.body_names[b]} is the fastest "
        f"there, with up to {v:.3g} m/s and {w:.3g} rad/s along an axis"
    )


def _at(evaluator: Evaluator, t: float, y: Floats) -> str:
    if fault := _fault_of_bodies(evaluator, by_body(evaluator.bodies_of(y))):
        return f"the state of body {fault}"
    states = y[evaluator.model.integrated_layout["states"]]
    if fault := _fault(states):
        return f"the state {_worst_state(evaluator, states)} is {fault}"
    s = evaluator.system
    inputs = evaluator.inputs
    place_state(y, s)
    s.F[:, :4] = 0.0  # filled again one by one: the present values may not be finite
    evaluator.set_inputs(inputs)
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        for k in range(group.count):
            if fault := _fault_of(evaluator, q, k, kind, group, t):
                kind = "rate" if _fault(s.rates) else kind  # a wrench computes both
                name = _name(evaluator, kind, group, k)
                title = "contact" if group.type_info.type.is_contact else _title(kind)
                return f"{title} {name} (type {group.keyword}) is {fault}"
    found = _jammed(evaluator, t, y) or _without_direction(evaluator, t, y)
    found = found or _singular(evaluator, t)
    if found:
        return found
    # too large, though all that acts on the body is not
    fault = _fault_of_bodies(evaluator, _rates(evaluator, t, y))
    return f"the acceleration of body {fault}" if fault else ""


def _jammed(evaluator: Evaluator, t: float, y: Floats) -> str:
    """The friction of joints that slides where no load agrees with it."""
    model = evaluator.model
    first = len(model.joint_names) - model.contact_count
    loaded = [int(k) for group in model.contacts if group.loaded is not None for k in group.members]
    if not loaded:
        return ""
    from dap3d_core.formulations.contacts.contact_table import ContactTable

    modes = evaluator.states[ContactTable(evaluator).mode]
    slides = [model.joint_names[k] for k in loaded if modes[k - first] == 1.0]
    u = evaluator.bodies_of(y)
    if not slides or np.isfinite(evaluator.report(t, u)[model.report_layout["Lam"]]).all():
        return ""
    return (
        f"friction {some(slides)} slides and jams: it raises the load of its joint by "
        "more than that load, or the pose is singular, and no motion with Coulomb's law goes on"
    )


def _without_direction(evaluator: Evaluator, t: float, y: Floats) -> str:
    """The joint of the first row whose gradient is zero: no force of it can hold anything."""
    if not evaluator.model.row_count:
        return ""
    rows = evaluator.rows(t, evaluator.hold(y))
    size = np.bincount(rows.row, np.abs(rows.value), minlength=rows.shape[0])
    zero = np.flatnonzero(size == 0.0)
    zero = zero[zero < evaluator.model.joint_row_count]  # those of an open contact are zero
    if not len(zero):
        return ""
    return f"the gradient of a row of joint {evaluator.model.row_owner(int(zero[0]))} is zero"


def _steepest(evaluator: Evaluator, t: float, y: Floats) -> str:
    """The joint with the largest row, where its pose is so near to a singular one of its own."""
    model = evaluator.model
    if not model.row_count:
        return ""
    rows = evaluator.rows(t, evaluator.hold(y))
    largest = np.abs(rows.gamma)
    np.maximum.at(largest, rows.row, np.abs(rows.value))
    worst = int(np.argmax(largest))
    if not largest[worst] > STEEP * max(1.0, float(np.median(largest))):
        return ""
    size, name = largest[worst], model.row_owner(worst)
    return f"a row of joint {name} has grown to {size:.2g} (t = {t:.9g} s)"


def _runaway(evaluator: Evaluator, t: float, y: Floats) -> str:
    """The body with the largest number or rate, where no step can go on with it."""
    largest = np.max(
        np.abs(np.hstack([by_body(evaluator.bodies_of(y)), _rates(evaluator, t, y)])), axis=1
    )
    first = int(np.argmax(largest))
    if not largest[first] > ENORMOUS:
        return ""
    name = evaluator.model.body_names[first]
    return f"body {name} runs away: a number or a rate of {largest[first]:.2g} (t = {t:.9g} s)"


def _fault(*numbers: Floats) -> str:
    """Fault of numbers: not finite, or too large for a run; "" if they have none."""
    if not all(bool(np.all(np.isfinite(part))) for part in numbers):
        return "not finite"
    too_large = any(bool(np.any(np.abs(part) > LARGEST)) for part in numbers)
    return f"beyond {LARGEST:g}, too large" if too_large else ""


def _fault_of_bodies(evaluator: Evaluator, numbers: Floats) -> str:
    """The first body with a fault in its numbers (n, ...), and the fault."""
    for name, own in zip(evaluator.model.body_names, numbers, strict=True):
        if fault := _fault(own):
            return f"{name} is {fault}"
    return ""


def _rates(evaluator: Evaluator, t: float, y: Floats) -> Floats:
    """(n, 13) dy/dt of each body."""
    return by_body(evaluator.rhs(t, evaluator.hold(y)))


def _worst_state(evaluator: Evaluator, values: Floats) -> str:
    """Name of the state of an element with the largest of some numbers, or one not finite."""
    worst = int(np.argmax(np.where(np.isfinite(values), np.abs(values), np.inf)))
    for state in evaluator.model.element_states:
        if worst in range(state.first, state.first + state.length):
            return f"{state.name} of {state.kind} {state.element}"
    return ""


def _fault_of(evaluator: Evaluator, q: int, k: int, kind: str, group: Group, t: float) -> str:
    """Fault of what loop q computes for instance k of its group alone."""
    s = evaluator.system
    s.rates[:] = 0.0
    for out in (s.force, s.gamma, s.nu, s.residual, s.D, s.multipliers):
        out[:] = 0.0
    joint_outs = {"acceleration": (s.D, s.gamma, s.nu), "position": (s.residual,) * 3,
                  "friction": (s.force, s.multipliers, s.multipliers)}  # fmt: skip
    if kind == "rate":
        joint_outs[kind] = (s.multipliers,) * 3
    if kind == "switch":
        found = np.zeros(len(group.type_info.outputs[kind]))
        joint_outs[kind] = found, np.zeros(1), s.multipliers
    outs = joint_outs.get(kind, (s.force, s.force, s.force))
    i0, p0, _ = s.groups[q]
    i1, p1 = i0 + k * stride(group.type_info), p0 + k * group.type_info.layout.par_width
    call_loop(evaluator.loops, q, t, s, np.array([i1, p1, 1]), *outs)
    return _fault(*outs, s.rates, s.F[:, :4])


def _title(kind: str) -> str:
    assert kind in KINDS
    titles = {"value": "function", "wrench": "force", "energy": "the energy of force",
              "friction": "the friction of force", "rate": "the rate of the states of"}  # fmt: skip
    return titles.get(kind, "joint")


def _name(evaluator: Evaluator, kind: str, group: Group, k: int) -> str:
    names = {"value": evaluator.model.function_names, "wrench": evaluator.model.force_names}
    names["energy"] = names["friction"] = evaluator.model.force_names
    if kind == "rate" and group.type_info.type.kind == "force":
        names["rate"] = evaluator.model.force_names
    return str(names.get(kind, evaluator.model.joint_names)[int(group.members[k])])


def _singular(evaluator: Evaluator, t: float) -> str:
    """The joint whose rows (nearly) depend on those before, where the pose is (nearly) singular."""
    if not evaluator.formulation.needs_joints or not evaluator.model.row_count:
        return ""
    row = near_singular_rows(evaluator, t)
    if not len(row):
        return ""
    joint = evaluator.model.row_owner(int(row[0]))
    return f"the pose is (nearly) singular, where the rows of joint {joint} depend on the others"
