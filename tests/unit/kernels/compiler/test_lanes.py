"""Functions of the subset for several scenes at once: each lane has the bits of its scene alone."""

import math

import numpy as np
import pytest
from support.internals import CompileError, WideArrays, compiled, pointer, wide_function
from support.plain import jit_is_on
from support.structs import Inner, Numbers

from dap3d_core.kernels.compiler import lanes

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
COUNT = 4


@compiled
def operations(numbers):
    """Every operation that is not the same for a vector as for a number."""
    x, out, order = numbers.x, numbers.out, pointer(numbers.order)
    for k in range(order.shape[0]):
        a, b = x[order[k]], x[k]
        k8 = 8 * k
        out[k8] = a + b * 3.0 - a / b
        out[k8 + 1] = math.sin(a) + math.atan2(a, b) + math.cos(2.0)
        out[k8 + 2] = np.sqrt(abs(a)) ** 0.3
        out[k8 + 3] = max(a, b, 0.5) - min(a, -b)
        out[k8 + 4] = np.sign(a) + np.rint(3.0 * b) - -a
        out[k8 + 5] = k + float(order[k] > 1) * a
        out[k8 + 6] = product(numbers.inner, a, k)
        out[k8 + 7] = 1e-300 * b * 1e-300
    if order[0] > 0:
        out[0] = 1.0


@compiled
def product(inner, a, k):
    """A row of a table times a number and its square."""
    row, (b, c) = inner.table[k], (a, a * a)
    return row[0] * b + row[1] * c


@compiled
def branches(numbers):
    if numbers.x[0] > 0.0:
        numbers.out[0] = 1.0


@compiled
def chooses_an_index(numbers):
    numbers.out[int(numbers.x[0])] = 1.0


@compiled
def counts_the_positive(numbers):
    numbers.out[0] = float(int(numbers.x[0] > 0.0))


def arrays(rng):
    """Numbers of one scene; some of them are none."""
    x = rng.normal(size=3)
    x[rng.integers(3)] = rng.choice([0.0, -0.0, np.nan, np.inf, 1e300])
    table = Inner(table=rng.normal(size=(3, 2)))
    return Numbers(x=x, out=np.zeros(24), order=np.array([0, 2, 1]), inner=table)


def test_each_lane_has_the_bits_of_its_scene():
    rng = np.random.default_rng(3)
    for _ in range(20):
        scenes = [arrays(rng) for _ in range(COUNT)]
        wide = WideArrays(scenes[0], COUNT, ("x", "out", "inner.table"))
        for k, scene in enumerate(scenes):
            wide.matrix(scenes[0].x)[:, k] = scene.x
            wide.matrix(scenes[0].inner.table)[:, k] = scene.inner.table.ravel()
            operations(scene)
        wide_function(operations, (Numbers.type_of(),), COUNT)(wide)
        found = wide.matrix(scenes[0].out)
        for k, scene in enumerate(scenes):
            assert found[:, k].tobytes() == scene.out.tobytes()


@pytest.mark.parametrize("function", [branches, chooses_an_index, counts_the_positive])
def test_what_decides_by_a_number_is_refused(function):
    with pytest.raises(CompileError, match="number that differs from scene to scene"):
        wide_function(function, (Numbers.type_of(),), COUNT)


def test_conditions_are_joined_and_chosen_lane_by_lane():
    """As traced kernels join them; with constants, too."""
    text = "define void @f(double %a, double %b) {\n" + "\n".join(
        [
            "  %v0 = fcmp olt double %a, %b",
            "  %v1 = xor i1 %v0, true",
            "  %v2 = select i1 %v0, i1 %v1, i1 false",
            "  %v3 = select i1 %v2, double %a, double 0x3FF0000000000000",
            "  %v4 = uitofp i1 %v2 to double",
            "  ret void",
            "}",
        ]
    )
    found = lanes.widen(text, 2)
    assert "%v1 = xor <2 x i1> %v0, <i1 true, i1 true>" in found
    assert "%v2 = select <2 x i1> %v0, <2 x i1> %v1, <2 x i1> <i1 false, i1 false>" in found
    one = "<double 0x3FF0000000000000, double 0x3FF0000000000000>"
    assert f"%v3 = select <2 x i1> %v2, <2 x double> %a, <2 x double> {one}" in found
    assert "%v4 = uitofp <2 x i1> %v2 to <2 x double>" in found


def test_arrays_that_lie_in_one_array_do_so_for_all_scenes():
    whole = np.arange(12.0)
    inner = Inner(table=whole[4:10].reshape(3, 2))
    numbers = Numbers(x=whole, out=whole[2:4], order=np.zeros(1, dtype=int), inner=inner)
    wide = WideArrays(numbers, COUNT, ("x", "out", "inner.table"))
    wide.spread()
    assert np.array_equal(wide.matrix(inner.table), np.repeat(whole[4:10, None], COUNT, axis=1))
    wide.matrix(whole)[5, 1] = -1.0
    assert wide.matrix(inner.table)[1].tolist() == [5.0, -1.0, 5.0, 5.0]
