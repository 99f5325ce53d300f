"""Motion of points and energy of bodies from a stored state."""

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import split
from dap3d_core.result.arrays import ModelSummary


def accelerations(v_dot: Floats) -> tuple[Floats, Floats]:
    """Views r_ddot, omega_dot (nt, n, 3) of v_dot (nt, 6 n)."""
    a = v_dot.reshape(v_dot.shape[0], v_dot.shape[1] // 6, 6)
    return a[..., :3], a[..., 3:]


def point_motion(
    summary: ModelSummary, u: Floats, v_dot: Floats, points: slice, level: int
) -> Floats:
    """``motion_of`` points of a model, (nt, k, 3)."""
    return motion_of(summary.point_body[points], summary.point_local[points], u, v_dot, level)


def motion_of(body: Integers, local: Floats, u: Floats, v_dot: Floats, level: int) -> Floats:
    """Position, velocity or acceleration of points fixed in bodies, global axes.

    r_P = r + s, v_P = r_dot + omega x s, a_P = r_ddot + omega_dot x s + omega x (omega x s).

    Args:
        body: (k,) body of each point, 0 for ground.
        local: (k, 3) coordinates of each in the axes of its body, m.
        u: (nt, 13 n) states.
        v_dot: (nt, 6 n) accelerations.
        level: 0 position (m), 1 velocity (m/s), 2 acceleration (m/s^2).

    Returns:
        (nt, k, 3).
    """
    out = np.zeros((len(u), len(body), 3))
    moving = body > 0
    b = body[moving] - 1
    r, p, rd, w = split(u)
    s = to_global(p[:, b], local[moving])
    if level == 0:
        out[:, ~moving] = local[~moving]
        out[:, moving] = r[:, b] + s
    elif level == 1:
        out[:, moving] = rd[:, b] + np.cross(w[:, b], s)
    else:
        rdd, wd = accelerations(v_dot)
        centripetal = np.cross(w[:, b], np.cross(w[:, b], s))
        out[:, moving] = rdd[:, b] + np.cross(wd[:, b], s) + centripetal
    return out


@attrs.frozen(eq=False)
class Energy:
    """Energies at the reported instants, (nt,) each, J.

    Attributes:
        kinetic: of all bodies.
        potential: of the forces that have a potential.
    """

    kinetic: Floats
    potential: Floats

    @property
    def total(self) -> Floats:
        """(nt,) sum of kinetic and potential energy, J."""
        return self.kinetic + self.potential


def kinetic_energy(summary: ModelSummary, u: Floats) -> Floats:
    """(nt,) kinetic energy, J: sum of m |r_dot|^2 / 2 and omega' . J' omega' / 2."""
    _, p, rd, w = split(u)
    wp = to_body(p, w)
    translation = np.einsum("b,tbc,tbc->t", summary.mass, rd, rd)
    rotation = np.einsum("tbc,bcd,tbd->t", wp, summary.Jp, wp)
    return np.asarray(0.5 * (translation + rotation))


def momentum(summary: ModelSummary, u: Floats) -> tuple[Floats, Floats]:
    """Linear momentum (nt, 3), kg m/s, and angular momentum about the origin (nt, 3), kg m^2/s."""
    r, p, rd, w = split(u)
    linear = summary.mass[:, None] * rd
    spin = to_global(p, np.einsum("bcd,tbd->tbc", summary.Jp, to_body(p, w)))
    return linear.sum(axis=1), (np.cross(r, linear) + spin).sum(axis=1)
