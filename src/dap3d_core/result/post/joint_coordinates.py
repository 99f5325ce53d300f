"""Joint coordinates at reported states: angles and lengths of joints, and their rates."""

from itertools import pairwise

import attrs
import numpy as np

from dap3d_core.assembly.motion.coordinates import (
    aliases,
    angle_columns,
    coordinate_units,
    joint_coordinates,
)
from dap3d_core.assembly.motion.joint_motion import JointMotions
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.joint_angles import joint_angle_name
from dap3d_core.model.rotations import read_only
from dap3d_core.model.state_layout import split
from dap3d_core.result.arrays import Arrays, ModelSummary


@attrs.frozen(eq=False)
class JointCoordinates:
    """Coordinates of a joint: body i as seen from body j, zero in the pose that the scene gives.

    A rotation is right-handed about its axis, a translation goes along it; turns are counted. The
    coordinates of a ball joint are its rotation vector, of at most half a turn.

    Attributes:
        q: (nt, d) rad or m.
        q_dot: (nt, d) rad/s or m/s.
        units: (d,) "rad" or "m".
        aliases: ``angle`` and ``length``, where there is one such coordinate -> its index.
    """

    q: Floats
    q_dot: Floats
    units: tuple[str, ...]
    aliases: dict[str, int]

    @property
    def names(self) -> dict[str, tuple[int, bool]]:
        """Names of quantities -> index of the coordinate, and whether it is the rate."""
        plain = {f"q{k + 1}": k for k in range(len(self.units))}
        names = {name: (k, False) for name, k in (plain | self.aliases).items()}
        rates = {f"{name}_dot": (k, True) for name, k in plain.items()}
        rates |= {f"{name}_rate": (k, True) for name, k in self.aliases.items()}
        return names | rates

    def at(self, index: Integers) -> "JointCoordinates":
        """The coordinates at some of the instants."""
        return attrs.evolve(self, q=self.q[index], q_dot=self.q_dot[index])


def counted_angles(summary: ModelSummary, arrays: Arrays, motion: JointMotions) -> Floats | None:
    """(nt, k) angles of a joint as a run counted them; None where a file of an older program has
    none.
    """
    joint = summary.joint_names[int(motion.joints[0])]
    names = [joint_angle_name(joint, k) for k in angle_columns(motion)]
    if not set(names) <= set(summary.angle_names) or arrays.angles.shape[1] < summary.angle_count:
        return None
    return arrays.angles[:, [summary.angle_names.index(name) for name in names]]


def coordinates_of(
    motion: JointMotions, t: Floats, u: Floats, counted: Floats | None
) -> JointCoordinates:
    """Coordinates of a single joint.

    Args:
        motion: of the joint.
        t: (nt,) s; where it does not rise another run begins, and turns are counted anew.
        u: (nt, 13 n) states.
        counted: (nt, k) its angles; None to count turns from one instant to the next.
    """
    bodies = [body for body in (int(motion.body_i[0]), int(motion.body_j[0])) if body]
    place = {0: 0} | {body: k + 1 for k, body in enumerate(bodies)}
    i, j = (np.array([place[int(body[0])]]) for body in (motion.body_i, motion.body_j))
    motion = attrs.evolve(motion, body_i=i, body_j=j)
    columns = np.array(bodies) - 1
    parts = []
    for rows in _runs(t):
        r, p, v, w = (part[:, columns] for part in split(u[rows]))
        own = None if counted is None else counted[rows, None]
        parts.append(joint_coordinates(motion, t[rows], r, p, v, w, own))
    q, q_dot = (
        read_only(np.concatenate([part[k][:, 0] for part in parts]))
        if parts
        else np.zeros((0, motion.size))
        for k in (0, 1)
    )
    return JointCoordinates(q, q_dot, coordinate_units(motion), aliases(motion))


def _runs(t: Floats) -> list[slice]:
    """Parts of the instants in which time rises."""
    starts: Integers = np.concatenate([[0], 1 + np.flatnonzero(np.diff(t) <= 0.0), [len(t)]])
    return [slice(a, b) for a, b in pairwise(starts) if b > a]
