"""Joint coordinates of scenes with contacts, whose rows are kept on the tree.

Rows that do not hold are zero. Sliding friction is linear in the normal forces N of its contacts:

    N = N_0 + L N,    L_rs the normal force at r by friction of a normal force of one at s,

found with the factors of the kept rows, once for each contact that slides. Its friction is then
among the applied forces, and all else is as without contacts.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import KNOT, SCRATCH, SWITCH, Floats, System
from dap3d_core.assembly.evaluate import call_kinds, state_rates, zero
from dap3d_core.formulations.common.constraints import (
    power_of_drivers,
    report_levels,
    report_multipliers,
)
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.formulations.contacts.equations import (
    BODY_I,
    BODY_J,
    LOADED,
    NEAR,
    ROW,
    STATE,
    force_of,
    invert,
    is_given,
    is_sliding,
)
from dap3d_core.formulations.joint.equations import accepted, apply_forces, linearise_tree
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.formulations.joint.reduce import reduce_nodes
from dap3d_core.formulations.joint.spread import body_accelerations, spread_tree
from dap3d_core.formulations.joint_loops import kept_rows
from dap3d_core.formulations.joint_loops.equations import (
    factorise,
    power_of_kept_drivers,
    solve,
)
from dap3d_core.formulations.joint_loops.layout import FIRST, FIRST_ROW, ROW_COUNT
from dap3d_core.formulations.joint_loops.loads import (
    lacking_accelerations,
    linearise_kept,
    push_freedoms,
)
from dap3d_core.formulations.joint_loops.profile import solve_profile
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

__all__ = ["accepted", "project", "report", "rhs", "watch"]


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    power = accelerate(t, y, system, loops)
    spread_tree(y, out, system)
    state_rates(t, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """What ``spread`` takes, and multipliers of kept rows; returns the power."""
    place_tree(y, system)
    apply_forces(t, system, loops)
    linearise_kept(t, system, loops)
    add_contact_forces(t, system, loops)
    power = reduce_nodes(system, system.force, True)
    factorise(system)
    lacking_accelerations(system)
    solve_profile(system)
    push_freedoms(system)
    return power + power_of_kept_drivers(system)


@compiled
def add_contact_forces(t: float, system: System, loops: Any) -> None:
    """Add to ``force`` what contacts do besides their rows, which are linearised.

    Behind both forces in ``friction`` stand those without sliding friction, and what gives normal
    forces: [I - L | I], then N.
    """
    contacts, size, count = system.contacts, system.force.shape[0], 0
    zero(system.multipliers)
    for c in range(contacts.shape[0]):
        slides = is_sliding(system, c)
        if is_given(system, c) or (slides & (contacts[c, LOADED] == 1)):
            force_of(t, c, system.friction[size:], system.friction, system, loops)
            add_scaled(1.0, c, system.force, system)
        count += 1 if slides & (contacts[c, LOADED] == 0) else 0
    if count == 0:
        return
    without, A = system.friction[2 * size : 3 * size], system.friction[3 * size :]
    N, n, s = A[2 * count * count :], 2 * count, 0
    for k in range(size):
        without[k] = system.force[k]
    reduce_nodes(system, system.force, True)
    factorise(system)
    normal_forces(system, N)
    for c in range(contacts.shape[0]):
        if is_sliding(system, c) & (contacts[c, LOADED] == 0):
            force_of_one(t, c, system, loops)
            add_scaled(1.0, c, system.force, system)
            reduce_nodes(system, system.force, True)
            normal_forces(system, N[count:])
            for r in range(count):
                A[n * r + s] = (1.0 if r == s else 0.0) - (N[count + r] - N[r])
                A[n * r + count + s] = 1.0 if r == s else 0.0
            for k in range(size):
                system.force[k] = without[k]
            s += 1
    invert(A, count)
    s = 0
    for c in range(contacts.shape[0]):
        if is_sliding(system, c) & (contacts[c, LOADED] == 0):
            force_of_one(t, c, system, loops)
            pushes = 0.0
            for r in range(count):
                pushes += A[n * s + count + r] * N[r]
            add_scaled(pushes, c, system.force, system)
            s += 1


@compiled
def normal_forces(system: System, N: Floats) -> None:
    """Normal forces of contacts that slide, of forces that ``reduce`` left."""
    lacking_accelerations(system)
    solve_profile(system)
    kept, contacts, s = system.tree.kept, system.contacts, 0
    for c in range(contacts.shape[0]):
        if is_sliding(system, c) & (contacts[c, LOADED] == 0):
            for q in range(kept.cuts.shape[0]):
                if kept.cuts[q, FIRST_ROW] == contacts[c, ROW]:
                    N[s] = kept.multipliers[kept.cuts[q, FIRST]]
            s += 1


@compiled
def force_of_one(t: float, c: int, system: System, loops: Any) -> None:
    """Friction of contact c by a normal force of one, into the second part of ``friction``."""
    near, states, size = system.contacts[c, STATE] + NEAR, system.states, system.force.shape[0]
    given = states[near], states[near + 1], states[near + 2]
    states[near] = states[near + 1] = states[near + 2] = 0.0
    system.multipliers[system.contacts[c, ROW]] = -1.0
    force_of(t, c, system.friction[size:], system.friction, system, loops)
    system.multipliers[system.contacts[c, ROW]] = 0.0
    states[near], states[near + 1], states[near + 2] = given


@compiled_into
def add_scaled(factor: float, c: int, force: Floats, system: System) -> None:
    """Add a factor times the force of contact c, in the second part of ``friction``."""
    size = system.force.shape[0]
    for side in range(BODY_I, BODY_J + 1):
        first = 6 * system.contacts[c, side]
        if first > 0:
            for k in range(first, first + 6):
                force[k] += factor * system.friction[size + k]


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto the kept rows; out as in ``project_onto``, a length for each kept joint."""
    project_onto(t, y, out, system, loops, kept_rows, None, True, True)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    accelerate(t, y, system, loops)
    linearise_tree(t, system, loops)
    zero(system.friction[: 2 * system.force.shape[0]])
    solve(system)
    power_of_drivers(system)
    body_accelerations(system, out)
    report_multipliers(system, out)
    report_levels(t, y, out, system, loops)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``, by groups and instances; then distances from knots.

    Those of closed contacts read multipliers.
    """
    place_of_next, kept = system.settings[SCRATCH : SCRATCH + 1], system.tree.kept
    accelerate(t, y, system, loops)
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, FIRST], kept.cuts[q, FIRST_ROW]
        for r in range(kept.cuts[q, ROW_COUNT]):
            system.multipliers[place + r] = -kept.multipliers[first + r]
    place_of_next[0] = 0.0
    call_kinds(SWITCH, KNOT, t, system, loops, out, place_of_next, system.multipliers)
