"""Programs of the core's subset, drawn at random: their bits are the same however they are run."""

import numpy as np
from support.at_all_levels import EDGES, compiled_at_all_levels, function_of, programs, same_bits
from support.internals import FLOAT, INT, Array

from dap3d_core.kernels import atan2, exp, sin

VECTOR, MATRIX, INTEGERS = Array(FLOAT, 1), Array(FLOAT, 2), Array(INT, 1)
#: How often a program is run, each time with other numbers.
RUNS = 5


def sources():
    """Texts of programs."""
    return programs().map(str.encode)


def helper(p, q):
    """What a program calls: two ways out, and a tuple on the way."""
    pair = p * q, p - q
    if pair[0] > pair[1]:
        return pair[0]
    return pair[1] + q


def check_program(data: bytes) -> str:
    """Plain Python and compiled code, made quickly, well, and without FMA, leave the same bits."""
    source = data.decode()
    function = function_of(source, helper=helper, sin=sin, exp=exp, atan2=atan2)
    rng = np.random.default_rng(list(data))
    inputs = []
    for _ in range(RUNS):
        numbers = rng.uniform(-10.0, 10.0, 10)
        places = rng.random(10) < 0.2
        numbers[places] = rng.choice(EDGES, places.sum())
        inputs.append((numbers[:4], numbers[4:].reshape(2, 3), rng.integers(-50, 51, 3)))
    wanted = [_left_by(function, *given) for given in inputs]
    types = VECTOR, MATRIX, INTEGERS, VECTOR
    for level, tried in compiled_at_all_levels(function, types).items():
        for given, values in zip(inputs, wanted, strict=True):
            found = _left_by(tried, *given)
            assert same_bits(values, found), f"{level}: {values} {found}\n{source}"
    return "same bits"


def _left_by(function, x, m, n):
    x, m, out = x.copy(), m.copy(), np.zeros(7)
    with np.errstate(all="ignore"):
        function(x, m, n.copy(), out)
    return np.concatenate([x, m.ravel(), out])
