"""Whether rows do not depend on each other, so that one solution gives their multipliers."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.assembly.arrays import System
from dap3d_core.kernels.runtime.cache import compiled

#: Compliance of such rows as part of their squared length: no pivot is less than the other part of
#: it.
PART_OF_INDEPENDENT, LEAST_PIVOT = 1e-16, 1e-1
#: Less than 1 - LEAST_PIVOT by far more than rounding.
MOVED = 0.8


@compiled
def turns_little(system: System) -> bool:
    """True if rows of one contact, not scaled yet, are certainly independent.

    Their directions are across each other, so that no pivot is less than what moves its bodies
    without a turn: it is compared with the most that a row's moment adds, whatever the rotation. A
    program needs no pivots then where no force acts along them.
    """
    D, little = system.D, True
    for q in range(system.blocks.shape[0]):
        o, k = system.blocks[q, 0], system.metric[system.blocks[q, 1]]
        spread = 0.0
        for u in range(1, 7):
            spread += k[u] * k[u]
        for _ in range(system.blocks[q, 2]):
            square = D[o + 3] * D[o + 3] + D[o + 4] * D[o + 4] + D[o + 5] * D[o + 5]
            little &= LEAST_PIVOT * (spread * square) <= MOVED * (k[0] * k[0])
            o += 6
    return little


@compiled
def are_independent(system: System) -> bool:
    """True if the factors, of ``PART_OF_INDEPENDENT``, have no small pivot."""
    nodes, small = system.nodes, 0
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for r in range(m if nodes[k, 3] < 0 else 0):
            of_row = abs(system.K[d + r * (m + 1)]) * system.compliance[f + r]
            small |= not of_row * LEAST_PIVOT < PART_OF_INDEPENDENT
    return small == 0
