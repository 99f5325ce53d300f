"""Spaces of twists as elementary motions: translations, a rotation or screw, a ball."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.joint_motion import BALL, ROTATION, SCREW, TRANSLATION

#: Singular values and pitches, in units of the scene's length, that count as zero.
ZERO = 1e-9


class Elementary(NamedTuple):
    """Spaces of twists of one kind.

    Attributes:
        members: (k,) their places among those given.
        kinds: of the elementary motions, translations first.
        screws: (k, d, 6) their unit twists, in units of the scene's length.
    """

    members: Integers
    kinds: tuple[str, ...]
    screws: Floats

    def in_metres(self, length: float) -> Floats:
        """The unit twists in m and 1, of a scene's length in m; those of translations stay."""
        screws = self.screws.copy()
        screws[:, self.kinds.count(TRANSLATION) :, :3] *= length
        return screws


def elementary(spaces: Floats) -> Iterator[Elementary]:
    """Elementary motions that span spaces of twists, each space given by orthonormal columns.

    What has rotations about two axes, or about three and more besides, is left out.

    Args:
        spaces: (m, 6, d) in units of the scene's length.
    """
    m, _, d = spaces.shape
    every = np.arange(m)
    if d == 0:
        yield Elementary(every, (), np.zeros((m, 0, 6)))
        return
    _, size, directions = np.linalg.svd(spaces[:, 3:])
    turning = np.sum(size > ZERO, axis=1)
    # columns in the order of their rotation: those behind ``turning`` are translations
    sorted_ = np.einsum("mab,mcb->mca", spaces, directions)
    for count in (0, 1):
        if (here := np.flatnonzero(turning == count)).size:
            yield from _along_and_about(here, sorted_[here], count)
    if d == 3 and (here := np.flatnonzero(turning == 3)).size:
        yield from _about_a_point(here, spaces[here])


def _along_and_about(members: Integers, twists: Floats, turning: int) -> Iterator[Elementary]:
    """Translations, and with ``turning`` a rotation, which comes first in ``twists`` (k, d, 6)."""
    shifts = twists[:, turning:].copy()
    shifts[..., 3:] = 0.0
    kinds = (TRANSLATION,) * shifts.shape[1]
    if not turning:
        yield Elementary(members, kinds, shifts)
        return
    turn = twists[:, 0] / np.linalg.norm(twists[:, 0, 3:], axis=-1, keepdims=True)
    along = np.einsum("kdc,kc->kd", shifts[..., :3], turn[:, :3])
    v = turn[:, :3] - np.einsum("kdc,kd->kc", shifts[..., :3], along)
    w = turn[:, 3:]
    pitch = np.sum(v * w, axis=-1)
    advances = np.abs(pitch) > ZERO
    v = np.where(advances[:, None], v, v - pitch[:, None] * w)
    screws = np.concatenate([shifts, np.concatenate([v, w], axis=-1)[:, None]], axis=1)
    for kind, here in ((ROTATION, ~advances), (SCREW, advances)):
        if here.any():
            yield Elementary(members[here], (*kinds, kind), screws[here])


def _about_a_point(members: Integers, spaces: Floats) -> Iterator[Elementary]:
    """Rotations about a point c: v = c x w for every twist (v, w)."""
    G = spaces[:, :3] @ np.linalg.inv(spaces[:, 3:])
    is_skew = np.abs(G + np.swapaxes(G, -1, -2)).max(axis=(1, 2)) < ZERO
    members, G = members[is_skew], G[is_skew]
    if members.size:
        screws = np.zeros((len(members), 3, 6))
        screws[..., 3:] = np.eye(3)
        screws[..., :3] = 0.5 * (np.swapaxes(G, -1, -2) - G)  # row k: c x e_k
        yield Elementary(members, (BALL,), screws)
