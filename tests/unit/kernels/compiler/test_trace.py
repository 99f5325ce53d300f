"""Every group loop of every registered type: plain Python and traced code give the same bits."""

import numpy as np
import pytest
from support.at_all_levels import made_of, same_bits, targets
from support.internals import (
    BODY_WIDTH,
    LOOP,
    LOOP_KINDS,
    LoopArrays,
    array_members,
    sample_classes,
    sized_fields,
    source_of,
    trace,
    with_functions,
    write,
)
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.interface import examine
from dap3d_core.interface.codegen.reactions import bind_joints, joints_read
from dap3d_core.interface.codegen.specialise import bind_friction
from dap3d_core.kernels.runtime import generated_modules

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
BODIES, INSTANCES, TRIALS = 8, 3, 6


def loops_of(type_info):
    """Each loop of a type and of its variants, with cubics for the functions that they call."""
    if sized_fields(type_info.type) and not hasattr(type_info.type, "shape_of_lists"):
        for sample in sample_classes(type_info.type):
            yield from loops_of(examine(sample))
        for _, variant in type_info.variants:
            yield from loops_of(variant)
        return
    if fields := joints_read(type_info):
        rubbing = bind_joints(type_info, dict.fromkeys(fields, REGISTRY.get("joint", "gear")))
        yield rubbing, write(rubbing, "friction")
        return
    type_info = with_functions(type_info, {})
    for what in LOOP_KINDS:
        if what != "friction" and (loop := write(type_info, what)) is not None:
            yield type_info, loop
    if type_info.type.kind == "joint" and "friction" in type_info.kernels:
        rubbing = bind_friction(type_info)
        yield rubbing, write(rubbing, "friction")
    for _, variant in type_info.variants:
        yield from loops_of(variant)


def arguments_of(type_info, rng):
    """Random arrays of three instances, with tables where the type has some."""
    body, F = rng.standard_normal((BODIES, BODY_WIDTH)), rng.standard_normal((BODIES, 5))
    idx, par = rng.integers(1, BODIES - 1, size=200), rng.standard_normal(1000)
    for offset, _ in type_info.layout.tables.values():
        for q in range(INSTANCES):
            par[q * type_info.layout.par_width + offset :][:2] = 400, 20
    outs = [rng.standard_normal(600) for _ in range(3)]
    outs[1][:2] = 3.0  # where switches begin, and which jump it is
    states = rng.standard_normal(BODIES + type_info.layout.state_width)
    return LoopArrays(body=body, F=F, idx=idx, par=par, states=states), outs


def run(loop, type_info, seed):
    """All that a loop writes."""
    arrays, outs = arguments_of(type_info, np.random.default_rng(seed))
    with np.errstate(all="ignore"):
        loop(0.7, arrays, 0, 0, INSTANCES, *outs)
    return np.concatenate([arrays.par, arrays.F.ravel(), arrays.rates, *outs])


REGISTRY = dap.load_registry()
TYPES = [(kind, keyword) for kind in ("joint", "force", "function")
         for keyword in REGISTRY.keywords(kind)]  # fmt: skip


#: Of each type what is optimised; of every third one the other levels, which know no types.
CASES = [(*one, "O3") for one in TYPES] + [
    pytest.param(*one, level, marks=pytest.mark.slow)
    for one in TYPES[::3]
    for level in targets()
    if level != "O3"
]


@pytest.mark.every(18)
@pytest.mark.parametrize(("kind", "keyword", "level"), CASES)
def test_traced_loops_have_the_bits_of_plain_python(kind, keyword, level):
    for type_info, loop in loops_of(REGISTRY.get(kind, keyword)):

        def python(loop=loop):
            namespace = generated_modules.load(None, "tried", source_of(loop))
            namespace.update(loop.kernels)
            return namespace

        text = trace("tried", python(), array_members())
        plain = python()["loop"]
        traced = made_of(text, "tried", LOOP, [level])[level]
        for seed in range(TRIALS):
            assert same_bits(run(plain, type_info, seed), run(traced, type_info, seed)), loop.name
