"""Frames of Euler parameters by SciPy, independent of the core's own."""

import numpy as np
from scipy.spatial.transform import Rotation


def rotation(p):
    """Rotation matrices (..., 3, 3), body to ground, of Euler parameters (..., 4) of any length."""
    p = np.asarray(p, dtype=float)
    turns = Rotation.from_quat(np.roll(p, -1, axis=-1).reshape(-1, 4))
    return turns.as_matrix().reshape(*p.shape[:-1], 3, 3)


def to_global(p, vector):
    """Global components (..., 3) of vectors given on the body."""
    return (rotation(p) @ np.asarray(vector, dtype=float)[..., None])[..., 0]


def to_body(p, vector):
    """Body components (..., 3) of global vectors."""
    return (np.swapaxes(rotation(p), -1, -2) @ np.asarray(vector, dtype=float)[..., None])[..., 0]
