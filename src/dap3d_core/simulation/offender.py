"""Who made a number that is not finite: the first body, force or joint to blame."""

import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.evaluate import place_bodies
from dap3d_core.assembly.system import KINDS
from dap3d_core.formulations.machine import AS_COMPILED, Machine
from dap3d_core.interface.writer import stride
from dap3d_core.kernels.lists import call_loop
from dap3d_core.model import Group

Floats = NDArray[np.float64]

#: Where to look behind the last good state, as parts of the time.
AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)


@AS_COMPILED
def find_offender(machine: Machine, t: float, y: Floats, t_stop: float) -> str:
    """Name what is not finite at or just after time t with the integrated state y; else ""."""
    for later in (t, t_stop, *(t + part * (1.0 + abs(t)) for part in AHEAD)):
        found = _at(machine, later, y)
        if found:
            return f"{found} (t = {later:.9g} s)"
    return ""


def _at(machine: Machine, t: float, y: Floats) -> str:
    n = machine.model.body_count
    for b, name in enumerate(machine.model.body_names):
        numbers = np.concatenate([y[7 * b : 7 * b + 7], y[7 * n + 6 * b : 7 * n + 6 * b + 6]])
        if not np.all(np.isfinite(numbers)):
            return f"the state of body {name}"
    s = machine.system
    place_bodies(y, s.body, s.metric)
    s.F[:, :4] = 0.0  # filled again one by one: what stands there may be of no finite number
    for q, (kind, group) in enumerate(machine.what):
        for k in range(group.count):
            if not _one_is_finite(machine, q, k, kind, group, t):
                name = _name(machine, kind, group, k)
                return f"{_title(kind)} {name} (type {group.keyword}) is not finite"
    return _singular(machine, t)


def _one_is_finite(machine: Machine, q: int, k: int, kind: str, group: Group, t: float) -> bool:
    s = machine.system
    for out in (s.force, s.gamma, s.nu, s.C, s.D, s.x):
        out[:] = 0.0
    joint_outs = {"acceleration": (s.D, s.gamma, s.nu), "position": (s.C, s.C, s.C),
                  "friction": (s.force, s.x, s.x)}  # fmt: skip
    if kind == "switch":
        joint_outs[kind] = np.zeros(len(group.examined.outputs[kind])), np.zeros(1), np.zeros(1)
    outs = joint_outs.get(kind, (s.force, s.force, s.force))
    _call_one(machine, q, k, group, t, outs)
    return all(bool(np.all(np.isfinite(out))) for out in (*outs, s.F[:, :4]))


def _call_one(
    machine: Machine, q: int, k: int, group: Group, t: float, outs: tuple[Floats, Floats, Floats]
) -> None:
    """Call loop q for instance k of its group alone."""
    s = machine.system
    i0, p0, _ = s.groups[q]
    i1, p1 = i0 + k * stride(group.examined), p0 + k * group.examined.layout.par_width
    call_loop(machine.loops, q, t, s, np.array([i1, p1, 1]), *outs)


def _title(kind: str) -> str:
    assert kind in KINDS
    titles = {"value": "function", "wrench": "force", "energy": "the energy of force",
              "friction": "the friction of force"}  # fmt: skip
    return titles.get(kind, "joint")


def _name(machine: Machine, kind: str, group: Group, k: int) -> str:
    names = {"value": machine.model.function_names, "wrench": machine.model.force_names}
    names["energy"] = names["friction"] = machine.model.force_names
    return str(names.get(kind, machine.model.joint_names)[int(group.members[k])])


def _singular(machine: Machine, t: float) -> str:
    """The joint whose rows (nearly) depend on those before, where the pose is (nearly) singular."""
    if machine.method == "unconstrained" or not machine.model.row_count:
        return ""
    row = machine.poor_rows(t)
    if not len(row):
        return ""
    joint = machine.model.row_owner(int(row[0]))
    return f"the pose is (nearly) singular, where the rows of joint {joint} depend on the others"
