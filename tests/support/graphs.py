"""Graphs of bodies and joints, with random blocks as those of joints, and the dense matrix.
The rows of a random joint are of one size and do not feel a common rigid motion of its bodies, as
those of joints: each body gets a random orthogonal 6 x 6 frame X, and a joint the blocks R X of its
bodies, with rows R that are orthonormal and that add up to zero over the bodies (ground takes its
share). The static order relies on that."""

import numpy as np

from support.internals import assemble, factor, make_plan, solve_saddle
from support.plain import jit_is_on


def chain(n, rows=3):
    """Ground - 1 - 2 - ... - n."""
    return n, [((k, k - 1), rows) for k in range(1, n + 1)]


def star(n, rows=3):
    """Body 1 on ground, and n arms on body 1."""
    return n + 1, [((1, 0), rows)] + [((k, 1), rows) for k in range(2, n + 2)]


def free_star(n, rows=5):
    """A floating body with n arms."""
    return n + 1, [((k, 1), rows) for k in range(2, n + 2)]


def tree(n, rng):
    """Each body hangs on an earlier one, on few of them mostly, so that hubs appear."""
    joints = [((1, 0), 5)]
    for k in range(2, n + 1):
        parent = int(rng.integers(0, k)) if rng.uniform() < 0.5 else int(rng.integers(0, min(k, 3)))
        joints.append(((k, parent), int(rng.integers(1, 7))))
    return n, joints


def ring(n, rows=3):
    """A closed loop of n bodies through ground."""
    return n, [*chain(n, rows)[1], ((n, 0), rows)]


def wheel(n, grounded):
    """A hub with n spokes whose rims are joined in a loop: 3 + n + n joints."""
    joints = [((k, 1), 3) for k in range(2, n + 2)]
    joints += [((k, k % (n + 1) + 1 if k <= n else 2), 1) for k in range(2, n + 2)]
    return n + 1, joints + ([((1, 0), 4)] if grounded else [])


def two_wheels(n):
    """Two hubs on ground that share all their spokes' far ends: every loop runs through both."""
    joints = [((1, 0), 5), ((2, 0), 5)]
    for k in range(3, n + 3):
        joints += [((k, 1), 3), ((k, 2), 2)]
    return n + 2, joints


def hub_under_hub(n):
    """A hub on a hub by way of one body, loops among the arms of each and between the two."""
    joints = [((1, 0), 5), ((2, 1), 5), ((3, 2), 3)]
    first = list(range(4, 4 + n))
    second = list(range(4 + n, 4 + 2 * n))
    joints += [((k, 1), 4) for k in first] + [((k, 3), 4) for k in second]
    joints += [((first[0], first[1]), 1), ((second[0], second[1]), 1), ((first[2], second[2]), 2)]
    return 3 + 2 * n, [*joints, ((second[3], 0), 1), ((3, 0), 1)]


def several_between_a_pair(rng):
    """Joints between the same bodies: within six rows one node, beyond another."""
    return 3, [((1, 0), 2), ((2, 1), 1), ((1, 2), 2), ((2, 1), 2), ((1, 0), 3), ((3, 2), 4),
               ((2, 3), 1), ((1, 0), 1)]  # fmt: skip


def three_body_joints(rng):
    """Joints between three bodies, in any order of slots, ground among them."""
    return 7, [((1, 0), 5), ((2, 1), 5), ((3, 1), 5), ((3, 2, 1), 1), ((4, 3, 2), 2), ((4, 0), 3),
               ((5, 6, 4), 3), ((6, 5), 4), ((7, 0, 5), 2)]  # fmt: skip


def gears_to_ground(rng):
    """Two hubs, one on the other, and a joint of the inner one's arms that also takes ground.
    Its loop runs through ground and thus through the outer hub, which is dear and waits long."""
    joints = [((1, 0), 2), ((2, 1), 6), ((3, 2), 6), ((4, 2), 6), ((3, 0, 4), 2)]
    joints += [((k, 1), 2) for k in range(5, 15)] + [((k, 2), 2) for k in range(15, 18)]
    return 17, [*joints, ((5, 6), 3), ((7, 8), 3), ((9, 10), 3)]


def three_bodies_on_a_hub(rng):
    """Gears: joints between an arm, its neighbour and the carrier, which is a hub."""
    joints = [((1, 0), 5)] + [((k, 1), 5) for k in range(2, 9)]
    joints += [((k, k + 1, 1), 1) for k in range(2, 6)] + [((7, 0, 8), 1)]
    return 8, joints


def floating(rng):
    """Two components that hang on nothing, a body alone, and one on ground."""
    return 9, [((1, 2), 3), ((2, 3), 5), ((3, 1), 2), ((4, 5), 6), ((6, 0), 6), ((7, 6), 2),
               ((9, 7), 1)]  # fmt: skip


def random_graph(rng):
    """Any tree with closing joints put on it, as many as degrees of freedom allow."""
    n = int(rng.integers(4, 14))
    n, joints = tree(n, rng)
    joints = [(slots, min(m, 4)) for slots, m in joints]
    for _ in range(int(rng.integers(1, n))):
        count = 3 if rng.uniform() < 0.2 else 2
        slots = tuple(int(b) for b in rng.permutation(n + 1)[:count])
        joints.append((slots, int(rng.integers(1, 3))))
    return n, joints


GRAPHS = {
    "no joints": lambda rng: (3, []),
    "chain": lambda rng: chain(9),
    "welded chain": lambda rng: chain(5, 6),
    "star": lambda rng: star(12),
    "free star": lambda rng: free_star(9),
    "tree": lambda rng: tree(25, rng),
    "ring": lambda rng: ring(7),
    "wheel": lambda rng: wheel(8, True),
    "free wheel": lambda rng: wheel(6, False),
    "two wheels": lambda rng: two_wheels(7),
    "hub under hub": lambda rng: hub_under_hub(6),
    "several between a pair": several_between_a_pair,
    "three bodies": three_body_joints,
    "three bodies on a hub": three_bodies_on_a_hub,
    "gears to ground": gears_to_ground,
    "floating": floating,
}
RANDOM = {f"random {k}": random_graph for k in range(12 if jit_is_on() else 5)}


class Case:
    """A graph with random blocks: the program's arrays, and the dense matrix they stand for.

    Attributes:
        plan, D: the program and its blocks, unscaled.
        dense: (rows, 6 n) the same Jacobian, rows in the order of the joints.
        metric: (n+1, 16) masses and inertias of one; bodies not turned.
        places: (rows,) place of each row in the row vectors.
        start: (joints + 1,) first row of each joint.
    """

    def __init__(self, graph, rng):
        self.n, joints = graph
        slots, rows = [s for s, _ in joints], [m for _, m in joints]
        self.plan = make_plan(self.n, slots, rows)
        frames = np.linalg.qr(rng.normal(size=(self.n + 1, 6, 6)))[0]
        self.D = np.zeros(self.plan.block_size)
        self.dense = np.zeros((sum(rows), 6 * self.n))
        self.places = np.zeros(sum(rows), dtype=np.int64)
        self.start = np.concatenate([[0], np.cumsum(rows)]).astype(int).tolist()
        self.joints = joints
        for joint, (bodies, m) in enumerate(joints):
            first = self.start[joint]
            R = np.linalg.qr(rng.normal(size=(len(bodies), 6, 6)))[0][:, :m]
            R[-1] = -R[:-1].sum(axis=0)
            for slot, b in enumerate(bodies):
                block = R[slot] @ frames[b]
                place = self.plan.joint_block[joint][slot]
                self.D[place : place + 6 * m] = block.ravel()
                if b:
                    self.dense[first : first + m, 6 * b - 6 : 6 * b] = block
            self.places[first : first + m] = self.plan.joint_row[joint] + np.arange(m)
        self.metric = np.zeros((self.n + 1, 16))
        self.metric[1:, [0, 1, 4, 6, 7, 11, 15]] = 1.0

    def scale_row(self, row, factor):
        """Multiply one row, given by its place among all, in both forms."""
        joint = int(np.searchsorted(self.start, row, side="right")) - 1
        self.dense[row] *= factor
        for b, place in zip(self.joints[joint][0], self.plan.joint_block[joint], strict=True):
            if b:
                at = place + 6 * (row - self.start[joint])
                self.D[at : at + 6] *= factor

    @property
    def is_full(self):
        """Whether the rows are independent, with room to spare for rounding."""
        if not self.dense.size:
            return True
        values = np.linalg.svd(self.dense, compute_uv=False)
        return len(self.dense) <= self.dense.shape[1] and values[-1] > 1e-3 * values[0]

    def factors(self, smallest=None, drop=False):
        """K with the factors, and how many pivots were counted."""
        plan, K = self.plan, np.full(self.plan.matrix_size, np.nan)
        smallest = np.zeros(plan.row_size) if smallest is None else smallest
        assemble(plan.targets, plan.contributions, self.D, K)
        return K, factor(plan.nodes, plan.columns, plan.updates, K, smallest, drop)

    def solution(self, K, g, gamma):
        """v_dot (6 n,) and lambda (rows,) by the program."""
        plan = self.plan
        x, force = np.zeros(plan.row_size), np.concatenate([np.zeros(6), g])
        x[self.places] = gamma
        solve_saddle(plan.blocks, plan.hubs, plan.nodes, plan.columns, self.D, K, x, force)
        return force[6:], -x[self.places]


def full_case(name, seed=0):
    """A case of this name with independent rows."""
    for attempt in range(100):
        rng = np.random.default_rng([seed, attempt, len(name), *name.encode()])
        case = Case((GRAPHS | RANDOM)[name](rng), rng)
        if case.is_full:
            return case
    raise AssertionError(f"{name}: no case with independent rows")


def check_solution(case):
    """The program solves [I D^T; D 0] (a; -lambda) = (g; gamma) as LU with pivoting does.
    It works on D D^T, whose condition is that of D squared: the relative error is some rounding
    times that. 1e3 is for growth along the elimination; 3 was the worst of 3000 random graphs."""
    rng = np.random.default_rng(1)
    m, columns = case.dense.shape
    g, gamma = rng.normal(size=columns), rng.normal(size=m)
    K, counted = case.factors()
    assert counted == 0
    a, multipliers = case.solution(K, g, gamma)
    matrix = np.block([[np.eye(columns), case.dense.T], [case.dense, np.zeros((m, m))]])
    wanted = np.linalg.solve(matrix, np.concatenate([g, gamma]))
    condition = np.linalg.cond(case.dense) if m else 1.0
    error = np.max(np.abs(np.concatenate([a, -multipliers]) - wanted))
    assert error <= 1e3 * np.finfo(float).eps * condition**2 * np.max(np.abs(wanted))
