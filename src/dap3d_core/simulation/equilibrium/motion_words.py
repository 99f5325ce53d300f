"""Displacements of bodies in words: which bodies move most, and which way."""

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model

#: Bodies that move this part of the largest motion, or more, are named, so many of them.
ALIKE, MOST_NAMES = 0.5, 6
#: A direction counts as an axis if this cosine belongs to it.
ALONG_AXIS = 0.999


def describe_motion(model: Model, x: Floats) -> str:
    """Which bodies move most, and how the first of these does.

    Args:
        model: names of the bodies.
        x: (n, 6) or (6 n,) displacement in parts of a length of the scene, and rotation vector, of
            each body, global axes.
    """
    x = np.asarray(x).reshape(-1, 6)
    shift, turn = (np.linalg.norm(part, axis=1) for part in (x[:, :3], x[:, 3:]))
    slides = float(np.max(shift, initial=0.0)) > float(np.max(turn, initial=0.0))
    amount, part = (shift, x[:, :3]) if slides else (turn, x[:, 3:])
    order = np.argsort(-amount, kind="stable")
    most = [int(k) for k in order if amount[k] >= ALIKE * amount[order[0]]]
    names = ", ".join(model.body_names[k] for k in sorted(most[:MOST_NAMES]))
    more = f" and {len(most) - MOST_NAMES} more" if len(most) > MOST_NAMES else ""
    first = most[0]
    verb = "moves along" if slides else "turns about"
    which = "which" if len(most) == 1 else f"of which {model.body_names[first]}"
    noun = "body" if len(most) == 1 else "bodies"
    return f"{noun} {names}{more}, {which} {verb} {direction(part[first])}"


def direction(vector: Floats) -> str:
    """The direction of a vector: an axis with its sign, or three components."""
    unit = vector / np.linalg.norm(vector)
    k = int(np.argmax(np.abs(unit)))
    if abs(unit[k]) >= ALONG_AXIS:
        return f"{'-' if unit[k] < 0.0 else '+'}{'xyz'[k]}"
    return "(" + ", ".join(f"{c:.2g}" for c in np.round(unit, 2) + 0.0) + ")"
