"""The joint formulation: accelerations and multipliers of trees in joint coordinates.

    place    joint coordinates -> poses, velocities, accelerations without q_ddot, of all bodies
    forces   through their loops, as in any formulation
    reduce   articulated inertias, from the leaves to ground
    spread   q_ddot, from ground to the leaves

Multipliers are computed only where they are reported or friction needs them.
"""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    VALUE,
    WRENCH,
    Floats,
    System,
    coordinate_offset,
    states_offset,
    velocity_offset,
)
from dap3d_core.assembly.evaluate import call_kinds, place_metric, scale_forces, state_rates, zero
from dap3d_core.assembly.metric import in_body_axes
from dap3d_core.assembly.turns import has_measured
from dap3d_core.formulations.common.constraints import linearise, report_levels, report_multipliers
from dap3d_core.formulations.common.friction import has_friction, solve_with_friction
from dap3d_core.formulations.common.switching_functions import (
    count,
    counts_own_angles,
    read_switches,
)
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.multipliers import joint_multipliers, scale_accelerations
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.formulations.joint.reduce import reduce_tree
from dap3d_core.formulations.joint.spread import body_accelerations, spread_tree
from dap3d_core.kernels.runtime.cache import compiled, compiled_into


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces last."""
    place_tree(y, system)
    apply_forces(t, system, loops)
    power = reduce_tree(system, system.force)
    if has_friction(system):
        power = accelerate(t, system, loops)
    spread_tree(y, out, system)
    state_rates(t, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled_into
def place(t: float, y: Floats, system: System, loops: Any) -> None:
    """Place the nodes of a state, and evaluate functions of time."""
    place_tree(y, system)
    call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)


@compiled
def apply_forces(t: float, system: System, loops: Any) -> None:
    """Applied forces and moments into ``force``, at the bodies as placed."""
    force = system.force
    zero(force)
    call_kinds(VALUE, WRENCH, t, system, loops, force, force, force)


@compiled
def accelerate(t: float, system: System, loops: Any) -> float:
    """Scaled ``acceleration`` and ``multipliers``, with friction; returns the power of all forces.

    The bodies are placed, and ``force`` is known.
    """
    power = linearise_tree(t, system, loops)
    return power + solve_with_friction(t, system, loops, solve)


@compiled
def linearise_tree(t: float, system: System, loops: Any) -> float:
    """Scaled forces into ``acceleration``, D^ of all joints; returns the power of the forces."""
    body, metric, size = system.body, system.metric, system.force.shape[0]
    for b in range(1, body.shape[0]):
        s, k = body[b], metric[b]
        place_metric(s, k)
        k[16], k[17], k[18] = in_body_axes(s, s[15], s[16], s[17])
    power = scale_forces(body, metric, system.force, system.acceleration)
    linearise(t, system, loops)
    if has_friction(system):
        zero(system.friction[size : 2 * size])
    return power


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``."""
    sum_forces(system)
    reduce_tree(system, system.tree.force)
    spread_tree(system.tree.slope, system.tree.slope, system)
    store_reactions(system)
    zero(system.multipliers)
    joint_multipliers(system, system.change)


@compiled
def sum_forces(system: System) -> None:
    """``tree.force``: applied forces with friction."""
    total = system.tree.force
    size = total.shape[0]
    for k in range(size):
        total[k] = system.force[k]
    if has_friction(system):
        for k in range(size):
            total[k] += system.friction[size + k]


@compiled
def store_reactions(system: System) -> None:
    """Scaled ``acceleration`` of the bodies; less the scaled forces that were there, ``change``."""
    left, v_dot = system.change, system.velocity
    body_accelerations(system, v_dot)
    for k in range(left.shape[0]):
        left[k] = system.acceleration[k]
    scale_accelerations(system, v_dot, system.acceleration)
    for k in range(left.shape[0]):
        left[k] = system.acceleration[k] - left[k]


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Bring Euler parameters to unit length: there are no rows."""
    out[0] = out[1] = out[2] = out[3] = 0.0
    normalise_rotations(y, system)


@compiled
def normalise_rotations(y: Floats, system: System) -> None:
    """Bring Euler parameters to unit length."""
    nodes = system.tree.nodes
    for n in range(1, nodes.shape[0]):
        motion, i = nodes[n, node.MOTION], nodes[n, node.COORDINATE]
        if motion >= node.SPHERICAL:
            i += 3 if motion == node.FREE else 0
            e0, e1, e2, e3 = y[i], y[i + 1], y[i + 2], y[i + 3]
            h = 1.0 / np.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
            y[i], y[i + 1], y[i + 2], y[i + 3] = e0 * h, e1 * h, e2 * h, e3 * h


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    place_tree(y, system)
    apply_forces(t, system, loops)
    accelerate(t, system, loops)
    body_accelerations(system, out)
    report_multipliers(system, out)
    report_levels(t, y, out, system, loops)


@compiled
def accepted(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """As in common/switching_functions.py; angles of the tree are brought within two turns."""
    if counts_own_angles(system):
        place(t, y, system, loops)
    elif not has_measured(t, system):
        place_tree(y, system)
    count(t, y, y[:0], out, system, loops)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``, as in common/switching_functions.py."""
    place(t, y, system, loops)
    read_switches(t, out, system, loops)


@compiled
def body_state(y: Floats, out: Floats, system: System) -> None:
    """The integrated state in coordinates of bodies of one in joint coordinates."""
    body = system.body
    n = body.shape[0] - 1
    place_tree(y, system)
    for b in range(1, n + 1):
        s, c, f = body[b], coordinate_offset(b), velocity_offset(b, n)
        for k in range(3):
            out[c + k], out[f + k] = s[k], s[12 + k]
        for k in range(4):
            out[c + 3 + k] = s[18 + k]
        out[f + 3], out[f + 4], out[f + 5] = in_body_axes(s, s[15], s[16], s[17])
    last, count = y.shape[0] - 1, system.states.shape[0]
    for k in range(count + 1):
        out[states_offset(n) + k] = y[last - count + k]
