"""Reference for the model `humanoid`: the least potential of its limbs, whose feet lie flat."""

import numpy as np
from rigid import Array

GRAVITY, FOOT, TRUNK = 9.81, 1.2, 35.0
#: Two of each: shin, thigh, upper arm, forearm.
MASSES = np.array([3.5, 8.0, 2.0, 1.5])
SHIN, THIGH, CHEST, UPPER, FORE, ANKLE = 0.4, 0.4, 0.45, 0.3, 0.25, 0.08
BENT, LIFTED, K, K_ARM = 0.25, 0.6, 4000.0, 40.0
#: Pitch of shin, thigh, trunk, upper arm and forearm, where servos have no moment.
EASE = np.array([BENT, -BENT, 0.0, 0.0, -LIFTED])


def heights(a: Array) -> Array:
    """Mass centres of shin, thigh, upper arm, forearm and trunk, over the pitch of each limb."""
    shin, thigh, trunk, upper, fore = np.cos(a)
    hip = ANKLE + SHIN * shin + THIGH * thigh
    shoulder = hip + CHEST * trunk
    return np.array([
        ANKLE + 0.5 * SHIN * shin, ANKLE + SHIN * shin + 0.5 * THIGH * thigh,
        shoulder - 0.5 * UPPER * upper, shoulder - UPPER * upper - 0.5 * FORE * fore,
        hip + 0.6 * CHEST * trunk,
    ])  # fmt: skip


def potential(a: Array) -> complex:
    """Of weight and servos, J."""
    turned = a - EASE
    between = np.diff(turned, prepend=0.0)
    stiffness = np.array([K, K, K, K_ARM, K_ARM])
    masses = np.append(2.0 * MASSES, TRUNK)
    return GRAVITY * (masses @ heights(a)) + stiffness @ between**2


def slopes(a: Array) -> Array:
    """Of the potential, by complex steps."""
    step = 1e-30j * np.eye(len(a))
    return np.array([potential(a + one).imag for one in step]) / 1e-30


def quantities(_: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, when all is at rest."""
    a = EASE.copy()
    for _ in range(20):
        H = np.array([(slopes(a + 1e-6 * e) - slopes(a - 1e-6 * e)) / 2e-6 for e in np.eye(5)])
        a = a - np.linalg.solve(H, slopes(a))
    x = SHIN * np.sin(a[0]) + THIGH * np.sin(a[1]) + 0.6 * CHEST * np.sin(a[2])
    up = 0.5 * GRAVITY * (TRUNK + 2.0 * (MASSES.sum() + FOOT))
    return {
        "r.trunk": np.array([x, 0.0, heights(a)[4]]),
        "load.left_foot": np.array([0.0, 0.0, up]),
        "load.right_foot": np.array([0.0, 0.0, up]),
    }
