"""Who made a number that is not finite: the first body, force or joint to blame."""

import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.evaluate import place_bodies
from dap3d_core.assembly.system import KINDS
from dap3d_core.formulations.machine import AS_COMPILED, Machine
from dap3d_core.interface.writer import stride
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
    i0, p0, _ = s.groups[q]
    for out in (s.force, s.gamma, s.nu, s.C, s.D):
        out[:] = 0.0
    joint_outs = {"acceleration": (s.D, s.gamma, s.nu), "position": (s.C, s.C, s.C)}
    outs = joint_outs.get(kind, (s.force, s.force, s.force))
    loop, examined = machine.loops[q], group.examined
    i1 = int(i0) + k * stride(examined)
    p1 = int(p0) + k * examined.layout.par_width
    loop(t, s.body, s.F, s.idx, s.par, i1, p1, 1, *outs)
    return all(bool(np.all(np.isfinite(out))) for out in (*outs, s.F))


def _title(kind: str) -> str:
    assert kind in KINDS
    titles = {"value": "function", "wrench": "force", "energy": "the energy of force"}
    return titles.get(kind, "joint")


def _name(machine: Machine, kind: str, group: Group, k: int) -> str:
    names = {"value": machine.model.function_names, "wrench": machine.model.force_names}
    names["energy"] = machine.model.force_names
    return str(names.get(kind, machine.model.joint_names)[int(group.members[k])])


def _singular(machine: Machine, t: float) -> str:
    """The joint whose rows (nearly) depend on those before, where the pose is (nearly) singular."""
    if machine.method != "standard" or not machine.model.row_count:
        return ""
    from dap3d_core.formulations.standard import linearise

    s = machine.system
    if not linearise(t, s, machine.loops, True):
        return ""
    for size, first, diagonal, *_ in machine.plan.nodes[:-1]:
        inverse = s.K[diagonal : diagonal + size * size : size + 1]
        small = ~(1.0 / inverse**2 > s.smallest[first : first + size])
        if np.any(small):
            row = int(np.flatnonzero(s.row == first + int(np.flatnonzero(small)[0]))[0])
            joint = machine.model.row_owner(row)
            return (
                "the pose is (nearly) singular, "
                f"where the rows of joint {joint} depend on the others"
            )
    return ""
