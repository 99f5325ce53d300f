"""What is kept of the impulses of a step: for the next one to begin with, and for reports."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.moreau.arrays import CONE, WHOLE, StepArrays
from dap3d_core.integrators.moreau.contact_set import DECLARED, velocity_of
from dap3d_core.integrators.moreau.newton import bound_of
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: A contact whose friction is on its cone to this part slides.
ON_CONE = 1e-6
#: Modes, and the slip of what sticks at the start, m/s of a scene of ordinary size, or rad/s
#: (interface/contacts/rows.py).
OPEN, SLIDES, STICKS = 0.0, 1.0, 2.0
STILL = 1e-8
#: Part of the impulses of joints that is tried first in the next step: shares of a load that
#: nothing determines fade, and do not wander.
TRIED_PULL = 0.9


@compiled
def slot_of(memory: Any, slots: Integers, key: int) -> int:
    """Place in a table of the row of a key, or the free one where it belongs (-1 is there)."""
    at = key % slots.size
    while slots[at] >= 0 and int(memory[slots[at], 0]) != key:
        at = at + 1 if at + 1 < slots.size else 0
    return at


@compiled
def order_memory(memory: Floats, slots: Integers) -> None:
    """Put the places of keys in the memory of the last step into its table."""
    count = 0
    for k in range(slots.size):
        slots[k] = -1
    while count < memory.shape[0] and memory[count, 0] >= 0.0:
        at = slot_of(memory, slots, int(memory[count, 0]))
        if slots[at] < 0:
            slots[at] = count
        count += 1


@compiled
def recall(work: Any, s: StepArrays) -> None:
    """Take the impulses of the last step in the frames of the contacts, zero of new ones.

    Of those of joints a part.

    Those that are declared stick or slide as they did, new ones by their slip.
    """
    memory, slots = work.memory, s.slots
    for k in range(s.y.size):
        s.y[k] = TRIED_PULL * work.pulls[k]
    for c in range(s.contact_count):
        row, J = slots[slot_of(memory, slots, s.key[c])], s.J[c]
        for r in range(3):
            s.x[c, r] = 0.0
            if row >= 0 and s.kind[c] != CONE:
                s.x[c, r] = memory[row, 1 + r]
            for k in range(3 if row >= 0 and s.kind[c] == CONE else 0):
                s.x[c, r] += J[12 * r + k] * memory[row, 1 + k]
        if s.kind[c] == CONE:
            s.x[c, 0] = max(s.x[c, 0], 0.0)
        if c >= s.touch_count and c < s.law_count:
            u0, u1, u2 = velocity_of(s, c, s.before)
            u0 = u0 if s.kind[c] == WHOLE else 0.0
            still = STILL * s.declared_speed[s.key[c] - DECLARED]
            rests = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2) <= still
            put_grip(s, c, rests if row < 0 else memory[row, 4] == STICKS)


@compiled
def put_grip(s: StepArrays, c: int, holds: bool) -> None:
    """Let a declared contact have the coefficient of what sticks, or slides."""
    k = s.key[c] - DECLARED
    if s.under[c] >= 0:
        return
    s.held[k] = 1 if holds else 0
    s.grip[k] = s.declared_mu_s[k] if holds else s.declared_mu[k]
    s.mu[c] = s.grip[k] if s.kind[c] == CONE else 0.0
    ratio, J = s.declared_ratio_s[k] if holds else s.declared_ratio[k], s.J[c]
    if ratio != s.ratio[k]:  # an ellipse is a disc that is stretched
        for i in range(24, 36):
            J[i] *= ratio / s.ratio[k]
        s.x[c, 2] *= s.ratio[k] / ratio
        s.ratio[k] = ratio


@compiled
def let_slip(s: StepArrays) -> bool:
    """Let contacts slide that no longer stick; True where less friction holds them then."""
    found = False
    for c in range(s.touch_count, s.law_count):
        k = s.key[c] - DECLARED
        if s.held[k] != 0 and mode_of(s, c) == SLIDES:
            put_grip(s, c, False)
            found |= s.declared_mu[k] < s.declared_mu_s[k]
    return found


@compiled
def remember(work: Any, s: StepArrays) -> None:
    """Keep the impulses of contacts that push, and of friction of joints."""
    memory, count = work.memory, 0
    copy(work.pulls, s.y)
    for c in range(s.contact_count):
        if (s.x[c, 0] > 0.0 or s.kind[c] != CONE) and count < memory.shape[0]:
            memory[count, 0] = s.key[c]
            memory[count, 4] = SLIDES if c < s.touch_count else mode_of(s, c)
            for k in range(3):
                total = 0.0
                for r in range(3):
                    total += s.x[c, r] * s.J[c, 12 * r + k]
                memory[count, 1 + k] = total if s.kind[c] == CONE else s.x[c, k]
            count += 1
    forget(memory, count)


@compiled
def forget(memory: Floats, first: int) -> None:
    """Keep no impulses from row ``first`` on."""
    for k in range(first, memory.shape[0]):
        for i in range(memory.shape[1]):
            memory[k, i] = -1.0


@compiled
def mode_of(s: StepArrays, c: int) -> float:
    """Mode of a contact by its impulse."""
    x, first = s.x[c], 0.0
    if s.kind[c] == CONE and x[0] <= 0.0:
        return OPEN
    if s.kind[c] == WHOLE:
        first = x[0] * x[0]
    most = (1.0 - ON_CONE) * bound_of(s, c, s.x, s.y)
    return SLIDES if math.sqrt(first + (x[1] * x[1] + x[2] * x[2])) >= most else STICKS


@compiled
def keep_for_reports(s: StepArrays) -> None:
    """Keep what contacts and joints have pushed with in this step."""
    for c in range(s.touch_count, s.law_count):
        d, x, J = s.key[c] - DECLARED, s.x[c], s.J[c]
        kept, sign = s.declared_x[d], -1.0 if s.bodies[c, 0] > 0 else 1.0
        axis = J[3 * s.declared_turns[d] + (0 if sign < 0.0 else 6) :]
        arm = s.grip[d] if s.under[c] >= 0 else 1.0
        kept[0], kept[1], kept[2] = x[0], arm * x[1], arm * s.ratio[d] * x[2]
        kept[3] = mode_of(s, c)
        for k in range(3):
            kept[4 + k] = 0.0
            for r in range(3 if s.kind[c] != CONE and kept[3] == SLIDES else 0):
                kept[4 + k] += sign * x[r] * axis[12 * r + k]
    s.met_count = 0
    for c in range(s.touch_count):
        if s.x[c, 0] > 0.0:
            row, J, x = s.met[s.met_count], s.J[c], s.x[c]
            row[1], row[2] = s.shapes.which[c, 0], s.shapes.which[c, 1]
            row[3], row[4] = mode_of(s, c), s.gap[c]
            for k in range(3):
                row[5 + k], row[8 + k] = s.shapes.found[c, k], J[k]
                row[11 + k] = (x[0] * J[k] + x[1] * J[12 + k] + x[2] * J[24 + k]) / s.h
            s.met_count += 1


@compiled
def put_means(work: Any, s: StepArrays, row: Floats) -> None:
    """Put means of the last step, at the start of the first one, into a row of reports."""
    if work.step_count == 0 and s.is_solved == 0:
        return
    for b in range(1, s.end.shape[0]):
        for k in range(6):
            mean = (s.end[b, k] - s.before[b, k]) / s.h
            row[s.first_v_dot + 6 * (b - 1) + k] = mean
    own, solved = s.y.size, s.is_solved != 0
    for k in range(own if solved else 0):
        row[s.first_lam + k] += work.pulls[k] / s.h
    for c in range(s.declared_gap.size if solved else 0):
        x = s.declared_x[c]
        for k in range(3):
            row[s.first_lam + own + 3 * c + k] = x[k] / s.h
        for k in range(4):
            row[s.first_state + s.declared_mode[c] + k] = x[3 + k]


@compiled
def log_contacts(work: Any, s: StepArrays, t: float) -> None:
    """Log the contacts that shapes push with at a reported instant."""
    for m in range(s.met_count):
        log, met = s.log[s.log_count], s.met[m]
        log[0] = t
        copy(log[1:], met[1:])
        s.log_count += 1
