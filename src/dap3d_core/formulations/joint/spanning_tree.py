"""Spanning tree of a model's bodies: which joint joins each body to the side of ground."""

from collections import defaultdict
from collections.abc import Mapping

import attrs
import numpy as np

from dap3d_core.model import Model

Integers = np.ndarray


@attrs.frozen(eq=False)
class SpanningTree:
    """The joints of a tree, parents before their children, a chain in one piece.

    Attributes:
        joint: (n,) joint between parent and child; -1: the child is free.
        parent, child: (n,) bodies, ground 0; a free body has ground as parent.
        slot: (n, 2) slots of parent and child in the joint; -1 where the joint names ground in
            none, or there is no joint.
        kept: joints that are not in the tree.
    """

    joint: Integers
    parent: Integers
    child: Integers
    slot: Integers
    kept: tuple[int, ...]


def spanning_tree(model: Model, ends: Mapping[int, tuple[int, int]]) -> SpanningTree:
    """The tree of a model: depth first from ground, joints of many rows first.

    Bodies that no joint joins to ground hang on their first one in the scene, which is free.

    Args:
        model: the model.
        ends: the two bodies, ground 0, of each joint that may be in the tree, by its place.
    """
    near: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for k in np.argsort(-model.joint_rows, kind="stable").tolist():
        if k in ends:
            a, b = ends[k]
            near[a].append((k, b))
            near[b].append((k, a))
    seen: set[int] = set()
    found: list[tuple[int, int, int]] = []
    for root in (0, *range(1, model.body_count + 1)):
        if root in seen:
            continue
        if root:
            found.append((-1, 0, root))
        _grow(root, near, seen, found)
    joint, parent, child = np.array(found, dtype=np.int64).reshape(-1, 3).T
    slot = np.full((len(found), 2), -1, dtype=np.int64)
    for row, (k, *bodies) in zip(slot, found, strict=True):
        if k >= 0:
            slots = model.joint_slots[k]
            row[:] = [slots.index(b) if b in slots else -1 for b in bodies]
    in_tree = set(joint.tolist())
    kept = tuple(k for k in range(len(model.joint_rows)) if k not in in_tree)
    return SpanningTree(joint, parent, child, slot, kept)


def _grow(
    root: int,
    near: dict[int, list[tuple[int, int]]],
    seen: set[int],
    found: list[tuple[int, int, int]],
) -> None:
    """Add all that hangs on a body, depth first."""
    seen.add(root)
    todo = [(root, iter(near[root]))]
    while todo:
        body, others = todo[-1]
        for joint, other in others:
            if other not in seen:
                seen.add(other)
                found.append((joint, body, other))
                todo.append((other, iter(near[other])))
                break
        else:
            todo.pop()
