"""Monitors of a run: joints that carry and pulled, regularised friction that crept.

Multipliers of joints that cannot pull must not be negative. Friction that fades below a speed, as
tanh(v / v_tol) does, holds nothing at rest: what should stick creeps at a part of v_tol. Which part
is seen by evaluating the law twice, as it is and with a v_tol that is far smaller, where its
friction is whole: the ratio is tanh(v / v_tol).
"""

import math
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.interface.fields import specs_of
from dap3d_core.model import Group, Model
from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import Arrays, joined

#: A multiplier is negative beyond this part of the largest of its joint so far.
NEGATIVE_PART = 1e-6

#: Evaluations of all elements together, and instants at least and at most.
WORK, FEWEST, MOST = 1000, 10, 100
#: Friction between these parts of the whole is that of a contact within three times v_tol, and not
#: of one at rest without load, whose speed is an error of the steps.
LEAST, WITHIN = 1e-3, math.tanh(3.0)
#: It creeps for long from this part of a run on, and this many instants.
LONG, INSTANTS = 0.05, 3
#: Part of v_tol at which friction is whole.
WHOLE = 1e-9
#: Field of the friction of joints (interface/codegen/kernel_arguments.py), and its unit.
OF_JOINTS = ("v_tol", "m/s")


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


class CreepMonitor:
    """Looks through what is reported for friction that should stick."""

    def __init__(self, model: Model, most: int) -> None:
        """Args: model; most: how many instants are reported at most."""
        self._model = model
        smooth = (g for g in model.forces if getattr(g.type_info.type, "regularised", ""))
        groups = (*model.friction, *smooth)
        self._elements = [(group, k) for group in groups for k in range(group.count)]
        kept = min(MOST, max(FEWEST, WORK // max(1, len(self._elements))))
        self._stride, self._count = max(1, most // kept), 0
        self._kept: list[Arrays] = []

    def update(self, arrays: Arrays) -> None:
        """Keep some of what was reported next."""
        if self._elements:
            first = -self._count % self._stride
            self._count += len(arrays)
            indices = np.arange(first, len(arrays), self._stride)
            self._kept += [arrays.at(indices)] if len(indices) else []

    @IGNORE_FLOAT_ERRORS
    def notes(self, evaluator: Evaluator) -> list[str]:
        """Note on each element that creeps for long."""
        if not self._kept:
            return []
        arrays = joined(self._kept)
        notes = (self._note(evaluator, arrays, *element) for element in self._elements)
        return [note for note in notes if note]

    def _note(self, evaluator: Evaluator, arrays: Arrays, group: Group, k: int) -> str:
        type_: Any = group.type_info.type
        field, unit = OF_JOINTS
        if group.joints is None:
            field = type_.regularised
            unit = specs_of(type_)[field].unit
        limit = float(group.numbers[k, group.type_info.layout.numbers[field][0]])
        part = _parts_of_whole(evaluator, arrays, group, k, field, limit)
        speed = limit * np.arctanh(np.minimum(part, WITHIN))
        creeps = (part > LEAST) & (part < WITHIN)
        t = arrays.t
        first, last = _longest(creeps)
        if last - first < INSTANTS or t[last - 1] - t[first] < LONG * (t[-1] - t[0]):
            return ""
        far = float(np.sum(0.5 * (speed[first + 1 : last] + speed[first : last - 1])
                           * np.diff(t[first:last])))  # fmt: skip
        fastest, length = float(np.max(speed[first:last])), unit.removesuffix("/s")
        return (
            f"forces.{self._model.force_names[int(group.members[k])]}: from t = {t[first]:.6g} to "
            f"{t[last - 1]:.6g} s its contact is near {field} = {limit:g} {unit}, where "
            "regularised friction does not stick: what should stay creeps, at up to "
            f"{fastest:.3g} {unit}, by {far:.3g} {length}. It creeps less, in proportion, with a "
            f"smaller {field}"
        )


def _parts_of_whole(
    evaluator: Evaluator, arrays: Arrays, group: Group, k: int, field: str, limit: float
) -> Floats:
    """(nt,) the wrench as a part of that at a large speed; 0 without load."""
    from dap3d_core.result.post.force_output import (
        ForceLoops,  # not without friction
        place_at,
    )

    loops, size = ForceLoops(evaluator, group, k), np.zeros((len(arrays), 2))
    force = np.zeros_like(evaluator.system.force)
    minus_lambda = np.zeros_like(evaluator.system.multipliers)
    for n, time in place_at(evaluator, arrays):
        minus_lambda[evaluator.system.row] = -arrays.Lam[n]
        for c, value in enumerate((limit, WHOLE * limit)):
            loops.parameters.scale_field(group, field, value)
            force[:] = 0.0
            reads = loops.law == "friction"
            loops.call(loops.law, time, force, minus_lambda if reads else None)
            size[n, c] = np.max(np.abs(force))
    return size[:, 0] / np.where(size[:, 1] > 0.0, size[:, 1], 1.0)


def _longest(flags: Any) -> tuple[int, int]:
    """First, and one behind the last, of the longest row of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    if not len(edges):
        return 0, 0
    k = 2 * int(np.argmax(edges[1::2] - edges[::2]))
    return int(edges[k]), int(edges[k + 1])
