"""What joints do to bodies, and the Jacobian: evaluated again at reported states (spec 2, 10)."""

from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Group

if TYPE_CHECKING:
    from dap3d_core.formulations.machine import Machine

#: With more constraint rows than this the Jacobian is a list of sparse arrays.
DENSE_ROWS = 1000


@attrs.frozen(eq=False)
class Reaction:
    """What a joint exerts on one of its bodies.

    Attributes:
        body: name of the body.
        force: (nt, 3) N, global axes.
        moment: (nt, 3) N m about the body's mass centre, global axes; for ground about the origin.
    """

    body: str
    force: Floats
    moment: Floats


def jacobians(machine: "Machine", t: Floats, u: Floats) -> Any:
    """The constraint Jacobian D of C(q, t) at each reported instant, D v = nu (spec 2).

    Args:
        machine: evaluates the model.
        t: (nt,) s.
        u: (nt, 13 n) states.

    Returns:
        (nt, m, 6 n) array; beyond 1000 rows a list of nt scipy CSR arrays (m, 6 n).
    """
    model = machine.model
    if model.row_count > DENSE_ROWS:
        return [machine.rows(time, state).sparse() for time, state in zip(t, u, strict=True)]
    D = np.zeros((len(t), model.row_count, 6 * model.body_count))
    for k, (time, state) in enumerate(zip(t, u, strict=True)):
        D[k] = machine.rows(time, state).dense()
    return D


def reactions(
    machine: "Machine", t: Floats, u: Floats, Lam: Floats, joint: int
) -> dict[str, Reaction]:
    """What one joint exerts on each of its bodies: D_slot^T lambda (spec 2).

    The joint's own loop fills blocks of its own, so that ground has its block too: in the driver
    the blocks of ground share a place that nothing reads.

    Args:
        machine: evaluates the model.
        t: (nt,) s.
        u: (nt, 13 n) states.
        Lam: (nt, m) multipliers, m rows in the order of the model.
        joint: place of the joint in the model.

    Returns:
        A reaction for each slot, by its letter.
    """
    from dap3d_core.assembly.evaluate import call_loops, place_bodies
    from dap3d_core.assembly.system import VALUE

    model, s = machine.model, machine.system
    q, group, member = _loop_of(machine, joint)
    slots, rows = group.examined.layout.slots, int(model.joint_rows[joint])
    idx, groups = _own_place(machine, q, group, member, rows)
    D, gamma, nu = np.zeros(len(slots) * rows * 6), np.zeros(rows), np.zeros(rows)
    first = int(model.joint_start[joint])
    out = np.empty((len(t), len(slots), 6))
    for k, (time, state) in enumerate(zip(t, u, strict=True)):
        place_bodies(machine.integrated(state), s.body, s.metric)
        shared = (float(time), s.body, s.F)
        call_loops(s.kinds[VALUE], s.kinds[VALUE + 1], *shared, s.idx, s.par, s.groups,
                   machine.loops, s.force, s.force, s.force)  # fmt: skip
        call_loops(q, q + 1, *shared, idx, s.par, groups, machine.loops, D, gamma, nu)
        blocks = D.reshape(len(slots), rows, 6)
        out[k] = np.einsum("srv,r->sv", blocks, Lam[k, first : first + rows])
    names = ("ground", *model.body_names)
    return {
        slot: Reaction(names[body], out[:, n, :3], out[:, n, 3:])
        for n, (slot, body) in enumerate(zip(slots, model.joint_slots[joint], strict=True))
    }


def _loop_of(machine: "Machine", joint: int) -> tuple[np.int64, Group, int]:
    """The loop that evaluates a joint's rows, its group, and the joint's place there."""
    for q, (kind, group) in enumerate(machine.what):
        if kind == "acceleration":
            found = np.flatnonzero(group.members == joint)
            if len(found):
                return np.int64(q), group, int(found[0])
    raise AssertionError("every joint has a loop")


def _own_place(
    machine: "Machine", q: np.int64, group: Group, member: int, rows: int
) -> tuple[Any, Any]:
    """Integers and group table with which the loop q runs over one joint, into arrays of its own.

    interface/writer.py says how an instance's integers are laid out: row and blocks stand last.
    """
    from dap3d_core.interface.writer import stride

    s, examined = machine.system, group.examined
    width, slots = stride(examined), len(examined.layout.slots)
    i0, p0, _ = s.groups[q]
    idx = s.idx[i0 + member * width : i0 + (member + 1) * width].copy()
    idx[-slots - 1] = 0
    idx[-slots:] = 6 * rows * np.arange(slots)
    groups = s.groups.copy()
    groups[q] = 0, p0 + member * examined.layout.par_width, 1
    return idx, groups
