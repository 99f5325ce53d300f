"""Kernels of a contact whose gap is an angle: one row, of a moment about its normal (rows.py).

The two rows across stay zero, as those of a contact that slides.
"""

# Kernels take numbers of any kind: floats, and symbols of a trace.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from dap3d_core.interface.contacts.rows import closed, position, rate
from dap3d_core.kernels import dot, neg, row, scale, sub, where

_ZERO = (0.0, 0.0, 0.0)
_NONE = row(_ZERO, _ZERO)


def blocks(n, mode):
    """J of both bodies."""
    u = where(closed(mode), n, _ZERO)
    return (row(_ZERO, u), _NONE, _NONE), (row(_ZERO, neg(u)), _NONE, _NONE)


def gamma(n_dot, w_i, w_j, mode):
    """-J_dot v."""
    return where(closed(mode), -dot(n_dot, sub(w_i, w_j)), 0.0), 0.0, 0.0


def moment(n, lam, mode, near):
    """The moment along the normal, with what ``near`` gives."""
    return where(closed(mode), lam[0] + dot(near, n), 0.0)


def friction(n, mode, near):
    """What acts besides the row: ``near``, a moment here."""
    given = where(closed(mode), scale(dot(near, n), n), _ZERO)
    return (_ZERO, given), (_ZERO, neg(given))


def switch(gap, n, lam, mode, near):
    """What ends a mode where it is negative: the gap, or the moment."""
    return where(closed(mode), moment(n, lam, mode, near), gap), 1.0


def output(gap, n, lam, mode, near):
    """As that of rows.py; the normal force is a moment, and there is no point of contact."""
    return (gap, moment(n, lam, mode, near), *_ZERO, *_ZERO, *_ZERO, 1.0, *_ZERO)


KERNELS = {"C": position, "J": blocks, "gamma": gamma, "friction": friction, "switch": switch,
           "rate": rate, "tension": output}  # fmt: skip
