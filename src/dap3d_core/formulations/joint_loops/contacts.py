"""Joint coordinates of scenes with contacts, whose rows are kept on the tree.

Rows that do not hold are zero. Sliding friction is linear in the normal forces N of its contacts:

    N = N_0 + L N,    L_rs the normal force at r by friction of a normal force of one at s,

found with the factors of the kept rows, once for each contact that slides, and by Newton's method
where loads of joints are among them (contacts/equations.py). Its friction is then among the applied
forces, and all else is as without contacts.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import copy, scale_forces, state_rates, zero
from dap3d_core.formulations.common.constraints import report_levels, report_multipliers
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.formulations.common.switching_functions import read_switches
from dap3d_core.formulations.contacts.equations import (
    BODY_I,
    BODY_J,
    LOADED,
    LOADS,
    PLACE,
    column,
    contact_of,
    force_of,
    force_of_one,
    has_loads,
    invert_responses,
    is_given,
    is_sliding,
    pressing,
)
from dap3d_core.formulations.contacts.watched_rates import store_watched, take_watched
from dap3d_core.formulations.joint.equations import accepted, apply_forces, linearise_tree
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.formulations.joint.reduce import reduce_nodes
from dap3d_core.formulations.joint.spread import body_accelerations, spread_tree
from dap3d_core.formulations.joint_loops import kept_rows, layout
from dap3d_core.formulations.joint_loops.equations import (
    reduce_with_kept_rows,
    solve,
    solve_kept,
    store_kept,
)
from dap3d_core.formulations.joint_loops.loads import lacking_accelerations, linearise_kept
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

__all__ = ["accepted", "project", "report", "rhs", "watch"]


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    if not take_watched(t, y, out, system):
        find_rates(t, y, out, system, loops)


@compiled
def find_rates(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """As ``rhs``, of a state at which switches were not read."""
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
    return reduce_with_kept_rows(system)


@compiled
def add_contact_forces(t: float, system: System, loops: Any) -> None:
    """Add to ``force`` what contacts do besides their rows, which are linearised.

    A column of contacts/equations.py has here the force of a contact and changes of multipliers.
    """
    contacts, size, count = system.contacts, system.force.shape[0], 0
    zero(system.multipliers)
    for c in range(contacts.shape[0]):
        slides = is_sliding(system, c)
        if is_given(system, c) or (slides & (contacts[c, LOADED] == 1)):
            force_of(t, c, system.friction[size:], system.acceleration, system, loops)
            add_scaled(1.0, c, system.friction[size:], system)
        if slides & (contacts[c, LOADED] == 0):
            own = column(system, count)
            zero(own)
            own[own.shape[0] - PLACE] = float(c)
            count += 1
    if count > 0:
        find_columns(t, system, loops, count)
        invert_responses(system, count)
        N = pressing(system, count)
        for s in range(count):
            add_scaled(N[s], contact_of(system, s), column(system, s), system)


@compiled
def find_columns(t: float, system: System, loops: Any, count: int) -> None:
    """Columns of contacts that slide, and ``multipliers`` without their friction.

    Of rows that are kept; of all where loads of joints are wanted.
    """
    size, x, total = system.force.shape[0], system.multipliers, system.total
    without, loaded = system.friction[system.friction.shape[0] - size :], has_loads(system, count)
    copy(without, system.force)
    if loaded:
        linearise_tree(t, system, loops)
    reduce_nodes(system, system.force, True)
    kept_rows.factorise(system, system.tree.kept.settings[layout.PART_OF_ROW])
    find_multipliers(system, loaded)
    copy(total, x)
    for s in range(count):
        own, c = column(system, s), contact_of(system, s)
        force_of_one(t, c, system.friction[size:], system.acceleration, system, loops)
        for side in range(BODY_I, BODY_J + 1):
            for k in range(6 * system.contacts[c, side], 6 * system.contacts[c, side] + 6):
                own[k] = system.friction[size + k]
        add_scaled(1.0, c, own, system)
        if not loaded:
            reduce_nodes(system, system.force, True)
        find_multipliers(system, loaded)
        for k in range(x.shape[0]):
            own[size + k] = x[k] - total[k]
        copy(system.force, without)
    copy(x, total)
    zero(total)


@compiled
def find_multipliers(system: System, loaded: bool) -> None:
    """-lambda by the present factors, of forces that ``reduce`` left; of loaded: of ``force``."""
    if loaded:
        scale_forces(system.body, system.metric, system.force, system.acceleration)
        solve_all(system)
    else:
        lacking_accelerations(system)
        solve_kept(system)
        store_kept(system)


@compiled_into
def solve_all(system: System) -> None:
    """``acceleration`` and all ``multipliers``: friction is among the applied forces."""
    size = system.force.shape[0]
    zero(system.friction[size : 2 * size])
    solve(system)


@compiled_into
def add_scaled(factor: float, c: int, of_contact: Floats, system: System) -> None:
    """Add a factor times the force of contact c to ``force``."""
    for side in range(BODY_I, BODY_J + 1):
        first = 6 * system.contacts[c, side]
        if first > 0:
            for k in range(first, first + 6):
                system.force[k] += factor * of_contact[k]


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto the kept rows; out as in ``project_onto``, a length for each kept joint."""
    project_onto(t, y, out, system, loops, kept_rows, None, True, True)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    accelerate(t, y, system, loops)
    linearise_tree(t, system, loops)
    solve_all(system)
    body_accelerations(system, out)
    report_multipliers(system, out)
    report_levels(t, y, out, system, loops)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``; those of closed contacts read multipliers."""
    loaded, n = 0, y.shape[0]
    find_rates(t, y, system.watched[1 + n : 1 + 2 * n], system, loops)
    store_watched(t, y, system)
    for c in range(system.contacts.shape[0]):
        loaded |= system.contacts[c, LOADS] > 0
    if loaded != 0:
        linearise_tree(t, system, loops)
        solve_all(system)
    else:
        store_kept(system)
    read_switches(t, out, system, loops)
