"""Graphs of many loops, (bodies, [(bodies of a joint, rows)]) as in graphs.py."""


def rod_net(k):
    """k x k knots, rods between neighbours, the rods of a knot joined one to the next by spherical
    joints; each knot of the first line hangs by one rod more from ground."""
    at, joints, n = {(-1, j): [0] for j in range(k)}, [], 0
    for i in range(k):
        for j in range(k):
            others = [(i - 1, j)] if j + 1 == k else [(i - 1, j), (i, j + 1)]
            for other in others:
                n += 1
                for knot in ((i, j), other):
                    at.setdefault(knot, []).append(n)
                    if len(at[knot]) > 1:
                        joints.append(((n, at[knot][-2]), 3))
    return n, joints


def plate_net(k, rows=3):
    """k x k bodies, each joined to its right and its lower neighbour, the first line to ground."""
    joints = [((j + 1, 0), rows) for j in range(k)]
    for i in range(k):
        for j in range(k):
            b = i * k + j + 1
            joints += [((b + 1, b), rows)] if j + 1 < k else []
            joints += [((b + k, b), rows)] if i + 1 < k else []
    return k * k, joints


def fourbars(count):
    """A02: a row of four-bars, neighbours share a crank; revolutes."""
    joints = [((k, 0), 5) for k in range(1, count + 2)]
    for k in range(1, count + 1):
        joints += [((count + 1 + k, k), 5), ((count + 1 + k, k + 1), 5)]
    return 2 * count + 1, joints


def ladder(count):
    """Two chains from ground and a rung between them at each of their knots; spherical joints."""
    joints = [((1, 0), 3), ((2, 0), 3)]
    for k in range(1, count):
        joints += [((2 * k + 1, 2 * k - 1), 3), ((2 * k + 2, 2 * k), 3)]
    for k in range(count):
        rung = 2 * count + 1 + k
        joints += [((rung, 2 * k + 1), 3), ((rung, 2 * k + 2), 3)]
    return 3 * count, joints
