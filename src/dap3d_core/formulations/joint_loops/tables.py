"""Tables of the rows that are kept on a tree: their ways to ground, and where these meet."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers, KeptRowArrays
from dap3d_core.formulations import RHS
from dap3d_core.formulations.coordinates import UnsuitableError
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.tree_nodes import TreeNodes
from dap3d_core.formulations.joint_loops import layout
from dap3d_core.formulations.joint_loops.profile import PART
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.linear.ldlt.factor import SINGULAR_PIVOT_RATIO
from dap3d_core.linear.ldlt.plan import Plan, table_of
from dap3d_core.linear.ordering.spanning_forest import CARRY
from dap3d_core.model import Group, Model

#: Freedoms of nodes, and numbers of a load there.
FREEDOMS = {node.FIXED: 0, node.REVOLUTE: 1, node.PRISMATIC: 1, node.SPHERICAL: 3, node.FREE: 6}
#: Numbers that the tables and arrays may hold: 800 MB.
MOST_NUMBERS = 100_000_000
#: Compliances by which rows are judged, as parts of their diagonals.
SMALL = 1e-9
#: They are divided by this; a pivot that falls by its root or more has nothing else.
LESS = 16.0


@attrs.frozen(eq=False)
class KeptRows:
    """The kept joints of a model in an order in which those that meet are near each other.

    Attributes:
        joints: places of the joints in the model.
        ways: of each the nodes that its loads pass, children before parents.
        first: (joints + 1,) first kept row of each, and the number of all.
        coupled: (rows,) first row that a row couples with.
        number_count: numbers of the arrays.
        work: estimate of the multiplications of one right-hand side.
    """

    joints: tuple[int, ...]
    ways: tuple[tuple[int, ...], ...]
    first: Integers
    coupled: Integers
    number_count: int
    work: int


#: Multiplications of a node of the tree; of a body in method standard, in addition to its plan's.
#: Measured: one takes some 0.5 ns in all of them.
NODE_WORK, BODY_WORK = 160, 180


def cost_ratio(kept: KeptRows, nodes: TreeNodes, plan: Plan, body_count: int) -> float:
    """Estimate of the time of a right-hand side, over that of method standard."""
    own = NODE_WORK * len(nodes.table) + kept.work
    return own / (BODY_WORK * body_count + plan.work)


def kept_rows(joints: Sequence[int], model: Model, nodes: TreeNodes) -> KeptRows:
    """Ways of the rows of kept joints."""
    node_of_body = {int(b): n for n, b in enumerate(nodes.body) if b > 0}
    parent, motion = nodes.table[:, node.PARENT].tolist(), nodes.table[:, node.MOTION].tolist()
    found = []
    for k in joints:
        way: set[int] = set()
        for body in model.joint_slots[k]:
            n = node_of_body.get(body, 0)
            while n and n not in way:
                way.add(n)
                n = parent[n]
        found.append((sorted(way), k))
    found.sort()
    ways = tuple(tuple(way[::-1]) for way, _ in found)
    acting = _acting_rows(model)
    rows = [acting[k][1] for _, k in found]
    first = np.concatenate([[0], np.cumsum(rows)]).astype(np.int64)
    passing = _passing(ways)
    coupled = np.repeat(_first_coupled(ways, first), rows)
    width = np.arange(len(coupled)) - coupled + 1
    numbers = work = int(np.sum(width))
    work += int(np.sum(width * width)) // 2
    for n, cuts in passing.items():
        count, size = sum(rows[c] for c in cuts), FREEDOMS[motion[n]]
        numbers += count * size + layout.PAIR_WIDTH * len(cuts) * (len(cuts) + 1) // 2
        work += CARRY * count + size * count * (count + 1) // 2
    return KeptRows(tuple(k for _, k in found), ways, first, coupled, numbers, work)


def _acting_rows(model: Model) -> list[tuple[int, int]]:
    """Of each joint the first of its rows that may hold, and how many: of friction, say, one."""
    found = [(0, count) for count in model.joint_rows.tolist()]
    for group in model.contacts:
        type_: Any = group.type_info.type
        which = np.flatnonzero(type_.holds).tolist()
        for k in group.members.tolist():
            found[k] = which[0], which[-1] + 1 - which[0]
    return found


def _passing(ways: Sequence[Sequence[int]]) -> dict[int, list[int]]:
    """Node -> kept joints, by their places, whose loads pass it."""
    passing: dict[int, list[int]] = defaultdict(list)
    for c, way in enumerate(ways):
        for n in way:
            passing[n].append(c)
    return passing


def _first_coupled(ways: Sequence[Sequence[int]], first: Integers) -> Integers:
    """Of each kept joint the first row that its rows couple with."""
    earliest: dict[int, int] = {}
    coupled = np.zeros(len(ways), dtype=np.int64)
    for c, way in enumerate(ways):
        coupled[c] = min((earliest.setdefault(n, int(first[c])) for n in way), default=first[c])
    return coupled


def kept_row_arrays(
    kept: KeptRows, model: Model, plan: Plan, nodes: TreeNodes, calls: tuple[Integers, Integers]
) -> KeptRowArrays:
    """The arrays of kept rows; calls: as of ``kept_calls``.

    Raises:
        UnsuitableError: they would take too much memory.
    """
    if kept.number_count > MOST_NUMBERS:
        raise UnsuitableError(
            f"its {kept.first[-1]} kept rows would take {8e-9 * kept.number_count:.3g} GB. Use "
            "method standard or auto"
        )
    cuts: list[tuple[int, ...]] = []
    ends: list[tuple[int, ...]] = []
    ways: list[tuple[int, ...]] = []
    places, size = [], 0
    node_of_body = {int(b): n for n, b in enumerate(nodes.body) if b > 0}
    parent, motion = nodes.table[:, node.PARENT].tolist(), nodes.table[:, node.MOTION].tolist()
    acting = _acting_rows(model)
    for k, way, first in zip(kept.joints, kept.ways, kept.first.tolist(), strict=False):
        (row, rows), begin = acting[k], len(ways)
        step_of = {n: begin + j for j, n in enumerate(way)}
        first_end = len(ends)
        for body, block in zip(model.joint_slots[k], plan.joint_block[k], strict=True):
            if body:
                ends.append((step_of[node_of_body[body]], block + 6 * row, body))
        load = {}
        for n in way:
            load[n] = size
            ways.append((n, step_of.get(parent[n], -1), size))
            size += rows * FREEDOMS[motion[n]]
        places.append(load)
        place = int(plan.joint_row[k]) + row
        cuts.append((rows, place, first, first_end, len(ends), begin, len(ways)))
    count = len(kept.coupled)
    width = np.arange(count) - kept.coupled + 1
    start = np.concatenate([[0], np.cumsum(width)]).astype(np.int64)
    pairs = list(_pairs(kept, motion, places))
    longest = max((6 * c[0] * (c[6] - c[5]) for c in cuts), default=0)
    return KeptRowArrays(
        calls=np.concatenate(calls),
        call_counts=np.array([len(c) for c in calls], dtype=np.int64),
        cuts=table_of(cuts, layout.CUT_WIDTH),
        ends=table_of(ends, layout.END_WIDTH),
        ways=table_of(ways, layout.STEP_WIDTH),
        pairs=table_of(pairs, layout.PAIR_WIDTH),
        profile=np.stack([kept.coupled, start[:-1] - kept.coupled], axis=1),
        D=np.zeros(plan.block_size),
        loads=np.zeros(size),
        carried=np.zeros(longest),
        matrix=np.zeros(int(start[-1])),
        **{
            name: np.zeros(count)
            for name in ("compliance", "right", "solution", "multipliers", "smallest")
        },
        settings=np.zeros(2),
    )


def _pairs(
    kept: KeptRows, motion: Sequence[int], places: Sequence[dict[int, int]]
) -> Iterator[tuple[int, ...]]:
    """The rows of ``KeptRowArrays.pairs``."""
    first = kept.first.tolist()
    for n, cuts in sorted(_passing(kept.ways).items()):
        if not FREEDOMS[motion[n]]:
            continue
        for at, c in enumerate(cuts):
            for e in cuts[: at + 1]:
                yield (n, places[c][n], places[e][n], first[c], first[e],
                       first[c + 1] - first[c], first[e + 1] - first[e])  # fmt: skip


def kept_calls(
    kept: KeptRows, loop_groups: Sequence[tuple[str, Group]], groups: Integers
) -> tuple[Integers, Integers]:
    """Loop, i0, p0, count of each run of kept joints: of accelerations, and of positions.

    Args:
        kept: the joints.
        loop_groups: kind and group of each loop.
        groups: ``System.groups``.
    """
    calls: dict[str, list[tuple[int, ...]]] = {"acceleration": [], "position": []}
    joints = np.array(kept.joints, dtype=np.int64)
    for q, (kind, group) in enumerate(loop_groups):
        if kind in calls:
            i0, p0, _ = groups[q].tolist()
            per, width = stride(group.type_info), group.type_info.layout.par_width
            of_kept = np.concatenate([[False], np.isin(group.members, joints), [False]])
            edges = np.flatnonzero(of_kept[1:] != of_kept[:-1]).reshape(-1, 2)
            for begin, end in edges.tolist():
                calls[kind].append((q, i0 + per * begin, p0 + width * begin, end - begin))
    return table_of(calls["acceleration"], 4), table_of(calls["position"], 4)


@IGNORE_FLOAT_ERRORS
def judge_kept_rows(evaluator: Evaluator, y: Floats) -> None:
    """Find out whether kept rows depend on each other at a state, and store their pivots.

    The pivot of a row that depends on others is what compliances make of it, and follows them.
    """
    kept: KeptRowArrays = evaluator.system.tree.kept
    if evaluator.model.contact_count:  # those that close make other pivots
        kept.smallest[:], kept.settings[layout.PART_OF_ROW] = 0.0, PART
        return
    more, less = (_pivots(evaluator, y, part) for part in (SMALL, SMALL / LESS))
    redundant = ~(more < np.sqrt(LESS) * less)
    kept.smallest[:] = np.where(redundant, 0.0, SINGULAR_PIVOT_RATIO * less)
    kept.settings[layout.PART_OF_ROW] = PART if redundant.any() else 0.0


def _pivots(evaluator: Evaluator, y: Floats, part: float) -> Floats:
    kept = evaluator.system.tree.kept
    kept.settings[layout.PART_OF_ROW] = part
    evaluator.functions[RHS](0.0, y, np.zeros_like(y), evaluator.system, evaluator.loops)
    return 1.0 / kept.matrix[kept.profile[:, layout.PLACE] + np.arange(len(kept.profile))]
