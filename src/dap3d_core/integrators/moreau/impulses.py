"""What is kept of the impulses of a step: for the next one to begin with, and for reports."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.integrators.moreau.arrays import MET, StepArrays
from dap3d_core.integrators.moreau.contact_set import DECLARED
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: A contact whose friction is on its cone to this part slides.
ON_CONE = 1e-6


@compiled
def slot_of(memory: Any, slots: Integers, key: int) -> int:
    """Place in a table of the row of a key, or the free one where it belongs (-1 is there)."""
    at = key % slots.size
    while slots[at] >= 0 and int(memory[slots[at], 0]) != key:
        at = at + 1 if at + 1 < slots.size else 0
    return at


@compiled
def recall(work: Any, s: StepArrays) -> None:
    """Take the impulses of the last step in the frames of the contacts, zero of new ones."""
    memory, slots, count = work.memory, s.slots, 0
    for k in range(slots.size):
        slots[k] = -1
    while count < memory.shape[0] and memory[count, 0] >= 0.0:
        at = slot_of(memory, slots, int(memory[count, 0]))
        if slots[at] < 0:
            slots[at] = count
        count += 1
    for c in range(s.contact_count):
        row, J = slots[slot_of(memory, slots, s.key[c])], s.J[c]
        for r in range(3):
            s.x[c, r] = 0.0
            for k in range(3 if row >= 0 else 0):
                s.x[c, r] += J[12 * r + k] * memory[row, 1 + k]
        s.x[c, 0] = max(s.x[c, 0], 0.0)


@compiled
def remember(work: Any, s: StepArrays) -> None:
    """Keep the impulses of contacts that push."""
    memory, count = work.memory, 0
    for c in range(s.contact_count):
        if s.x[c, 0] > 0.0 and count < memory.shape[0]:
            memory[count, 0] = s.key[c]
            for k in range(3):
                total = 0.0
                for r in range(3):
                    total += s.x[c, r] * s.J[c, 12 * r + k]
                memory[count, 1 + k] = total
            count += 1
    for k in range(count, memory.shape[0]):
        for i in range(4):
            memory[k, i] = -1.0


@compiled
def mode_of(x: Floats, mu: float) -> float:
    """Mode of a contact by its impulse: 0 open, 1 slides, 2 sticks."""
    if x[0] <= 0.0:
        return 0.0
    return 1.0 if math.sqrt(x[1] * x[1] + x[2] * x[2]) >= (1.0 - ON_CONE) * mu * x[0] else 2.0


@compiled
def keep_for_reports(s: StepArrays) -> None:
    """Keep what contacts and joints have pushed with in this step."""
    for k in range(s.y.size):
        s.joint_y[k] = s.y[k]
    for c in range(s.touch_count, s.contact_count):
        for k in range(3):
            s.declared_x[s.key[c] - DECLARED, k] = s.x[c, k]
    s.met_count = 0
    for c in range(s.touch_count):
        if s.x[c, 0] > 0.0:
            row, J, x = s.met[s.met_count], s.J[c], s.x[c]
            row[1], row[2] = s.shapes.which[c, 0], s.shapes.which[c, 1]
            row[3], row[4] = mode_of(x, s.mu[c]), s.gap[c]
            for k in range(3):
                row[5 + k], row[8 + k] = s.shapes.found[c, k], J[k]
                row[11 + k] = (x[0] * J[k] + x[1] * J[12 + k] + x[2] * J[24 + k]) / s.h
            s.met_count += 1


@compiled
def complete_row(work: Any, s: StepArrays, row: Floats) -> None:
    """Put means of the last step, and modes of declared contacts, into a row of reports."""
    if work.step_count == 0:
        return
    for b in range(1, s.end.shape[0]):
        for k in range(6):
            mean = (s.end[b, k] - s.before[b, k]) / s.h
            row[s.first_v_dot + 6 * (b - 1) + k] = mean
    own, solved = s.joint_y.size, s.is_solved != 0
    for k in range(own if solved else 0):
        row[s.first_lam + k] += s.joint_y[k] / s.h
    for c in range(s.declared_gap.size if solved else 0):
        x = s.declared_x[c]
        for k in range(3):
            row[s.first_lam + own + 3 * c + k] = x[k] / s.h
        row[s.first_state + s.declared_mode[c]] = mode_of(x, s.declared_mu[c])


@compiled
def log_contacts(work: Any, s: StepArrays, t: float) -> None:
    """Log the contacts that shapes push with at a reported instant."""
    for m in range(s.met_count if work.step_count > 0 else 0):
        log, met = s.log[s.log_count], s.met[m]
        log[0] = t
        for k in range(1, MET):
            log[k] = met[k]
        s.log_count += 1
