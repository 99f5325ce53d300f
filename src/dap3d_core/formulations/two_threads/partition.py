"""The tables of a right-hand side in two halves: which bodies, blocks and elements each part has.

An element belongs to a half where it touches no body of another part. Joints may read bodies of the
top, which are placed before; forces add to their bodies, so they may not.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from dap3d_core.assembly.arrays import (
    BODIES,
    BY_BODIES,
    BY_ROWS,
    FORCES,
    HUBS,
    JOINTS,
    PIECES,
    RUNS,
    SCALED,
    Halves,
    Integers,
)
from dap3d_core.formulations.two_threads.rhs_halves import NUMBERS, WORDS
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.linear.ldlt.plan import Plan
from dap3d_core.linear.ordering.bisection import TOP
from dap3d_core.linear.ordering.bisection import Halves as Cut
from dap3d_core.model import Group

#: By kind and part.
Lists = dict[tuple[int, int], list[tuple[int, ...]]]


def divide(plan: Plan, what: Sequence[tuple[str, Group]], groups: Integers) -> Halves:
    """The tables of a plan that is cut in two.

    Args:
        plan: with ``halves``.
        what: (kind, group) of each group loop.
        groups: (loops, 3) i0, p0, count of each loop.
    """
    cut = plan.halves
    assert cut is not None
    pieces, evaluated = _pieces_of(plan, cut, what, groups)
    runs = _runs_of(plan, cut, evaluated)
    run_start, run_table = _listed(runs, RUNS, 2)
    piece_start, piece_table = _listed(pieces, PIECES, 4)
    return Halves(
        mail=np.zeros(WORDS, dtype=np.int64),
        numbers=np.zeros(NUMBERS),
        nodes=cut.nodes,
        rows=cut.rows,
        targets=cut.targets,
        matrix=cut.matrix,
        columns=cut.columns,
        updates=cut.updates,
        run_start=run_start,
        runs=run_table,
        piece_start=piece_start,
        pieces=piece_table,
    )


def _pieces_of(
    plan: Plan, cut: Cut, what: Sequence[tuple[str, Group]], groups: Integers
) -> tuple[Lists, Integers]:
    """Runs of instances by part, and (joint nodes,) the part in which each has its joints."""
    evaluated = cut.node_part.copy()
    node_of = np.zeros(len(plan.joint_row), dtype=np.int64)
    for k, node in enumerate(plan.ordering.nodes):
        node_of[list(node.joints)] = k
    pieces: Lists = {}
    for q, (kind, group) in enumerate(what):
        known = _bodies_of(group)
        bodies = np.where(known == 0, -1, cut.body_part[known])
        if kind == "wrench":
            _add_pieces(pieces, FORCES, q, groups, group, _common(bodies))
        elif kind == "acceleration":
            own = cut.node_part[node_of[group.members]]
            foreign = (bodies >= 0) & (bodies != TOP) & (bodies != own[:, None])
            part = np.where(foreign.any(axis=1), TOP, own)
            np.maximum.at(evaluated, node_of[group.members], part)
    for q, (kind, group) in enumerate(what):
        if kind == "acceleration":
            part = evaluated[node_of[group.members]]
            _add_pieces(pieces, JOINTS, q, groups, group, part)
    return pieces, evaluated


def _runs_of(plan: Plan, cut: Cut, evaluated: Integers) -> Lists:
    """Runs of bodies, blocks of D and hubs by part."""
    blocks, nodes = plan.blocks, plan.ordering.nodes
    node_of = np.repeat(np.arange(len(nodes)), [len(node.bodies) for node in nodes])
    of_body = np.concatenate([[-1], cut.body_part[1:]])
    own = cut.body_part[blocks[:, 1]]
    if len(early := np.flatnonzero(blocks[:, 4] == 0)):  # hubs' blocks count for no part
        nearest = np.searchsorted(early, np.arange(len(own)), side="right") - 1
        own = own[early[np.maximum(nearest, 0)]]
    runs: Lists = {}
    for kind, part in (
        (BODIES, of_body),
        (SCALED, evaluated[node_of]),
        (BY_ROWS, cut.node_part[node_of]),
        (BY_BODIES, own),
        (HUBS, cut.body_part[plan.hubs[:, 0]]),
    ):
        for first, last, where in _runs(part):
            runs.setdefault((kind, where), []).append((first, last))
    return runs


def _bodies_of(group: Group) -> Integers:
    """(m, ...) all bodies that the instances of a group know."""
    others = group.functions[:, len(group.examined.layout.functions) :]
    return np.hstack([group.bodies, others]).astype(np.int64)


def _common(bodies: Integers) -> Integers:
    """(m,) the half that all bodies of an instance belong to, ground (-1) apart; else the top."""
    most = bodies.max(axis=1, initial=-1)
    least = np.where(bodies < 0, TOP, bodies).min(axis=1, initial=TOP)
    result: Integers = np.where(most == least, most, TOP)
    return result


def _add_pieces(
    pieces: Lists,
    kind: int,
    q: int,
    groups: Integers,
    group: Group,
    part: Integers,
) -> None:
    i0, p0, _ = groups[q]
    width, height = group.examined.layout.par_width, stride(group.examined)
    for first, last, where in _runs(part):
        piece = q, i0 + first * height, p0 + first * width, last - first
        pieces.setdefault((kind, where), []).append(piece)


def _runs(part: Integers) -> Iterable[tuple[int, int, int]]:
    """Ranges (first, last + 1, part) of equal parts; those of no part (-1) are left out."""
    if not len(part):
        return
    cuts = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(part)]
    for first, last in pairwise(cuts):
        if part[first] >= 0:
            yield first, last, int(part[first])


def _listed(found: Lists, kinds: int, width: int) -> tuple[Integers, Integers]:
    """All lists behind one another, by kind and part, and where each begins."""
    lists = [found.get((kind, part), []) for kind in range(kinds) for part in range(3)]
    start = np.concatenate([[0], np.cumsum([len(rows) for rows in lists])])
    table = np.array([row for rows in lists for row in rows], dtype=np.int64).reshape(-1, width)
    return start.astype(np.int64), table
