"""Joints that carry and cannot pull: multipliers that must not be negative, and were."""

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import Arrays

#: A multiplier is negative beyond this part of the largest of its joint so far.
NEGATIVE_PART = 1e-6


@attrs.define
class _Row:
    """One multiplier that must not be negative.

    Attributes:
        row: its place among the multipliers.
        first, last: rows of its joint.
        words: whose it is; why: what it means that it is negative.
        largest: magnitude of a multiplier of the joint so far.
        since: the first instant at which it was negative, s; then the least value and its instant.
    """

    row: int
    first: int
    last: int
    words: str
    why: str
    largest: float = 0.0
    since: float | None = None
    least: float = 0.0
    least_at: float = 0.0


class UnilateralMonitor:
    """Looks through what is reported for multipliers that their types say cannot be negative."""

    def __init__(self, model: Model) -> None:
        self._rows: list[_Row] = []
        for group in model.joints:
            type_: Any = group.type_info.type
            for joint in group.members.tolist() if type_.unilateral else ():
                first, last = model.joint_start[joint : joint + 2].tolist()
                for k in type_.unilateral:
                    number = f", row {k + 1}" if type_.rows > 1 else ""
                    words = f"joint {model.joint_names[joint]} ({group.keyword}{number})"
                    self._rows.append(
                        _Row(first + k, first, last, words, str(type_.unilateral_words))
                    )

    def update(self, arrays: Arrays) -> None:
        """Take notice of what was reported next."""
        for one in self._rows:
            own = np.abs(arrays.Lam[:, one.first : one.last])
            one.largest = max(one.largest, float(np.max(own, initial=0.0)))
            lam = arrays.Lam[:, one.row]
            (negative,) = np.nonzero(lam < -NEGATIVE_PART * one.largest)
            if not len(negative):
                continue
            if one.since is None:
                one.since = float(arrays.t[negative[0]])
            k = int(np.argmin(lam))
            if lam[k] < one.least:
                one.least, one.least_at = float(lam[k]), float(arrays.t[k])

    def among(self, Lam: Floats) -> NDArray[np.bool_]:
        """(k,) of k runs with multipliers (k, nt, m) those that have a negative one."""
        found = np.zeros(len(Lam), dtype=bool)
        for one in self._rows:
            own = np.abs(Lam[:, :, one.first : one.last])
            largest = np.max(own, axis=(1, 2), initial=0.0)
            found |= np.any(Lam[:, :, one.row] < -NEGATIVE_PART * largest[:, None], axis=1)
        return found

    def notes(self) -> list[str]:
        """Note on a negative reaction: since when, and what that means."""
        return [
            f"{one.words}: its multiplier is negative from t = {one.since:.6g} s on, or at some "
            f"instants since; at least {one.least:.6g}, at t = {one.least_at:.6g} s"
            f"{f': {one.why}' if one.why else ''}"
            for one in self._rows
            if one.since is not None
        ]
