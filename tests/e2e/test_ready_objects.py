"""A wheel with ready-made objects: first runs compile nothing and have the same bits."""

import pytest
from support.outside import Outside, build
from support.process import REPOSITORY, run

from dap3d_core.kernels.compiler import objects, ready
from dap3d_core.kernels.runtime.cache import jit_is_on

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled"),
]

RUNS = """
import hashlib
import dap3d_core as dap
from dap3d_core.kernels.compiler import units
digest = hashlib.sha256()
for model in ("fourbar3", "tri", "pen2", "bodies2"):
    for integrator in ("dop853", "adams", "radau"):
        result = dap.simulate(dap.load(model), t_end=0.02, dt=0.01, integrator=integrator)
        digest.update(result.u.tobytes())
print(len(units.compiled_units), digest.hexdigest(), dap.__file__)
"""


def test_first_runs_from_a_wheel_compile_nothing_and_have_the_same_bits(tmp_path):
    """With an empty cache; beside runs of the sources, compiled for this very processor."""
    target = ready.target_of(objects.processor().triple, objects.host_features())
    if target is None:
        pytest.skip("objects are made for no such machine")
    there = Outside(tmp_path)
    build(REPOSITORY, there.wheels, DAP3D_READY_OBJECTS=target)
    there.install(*there.wheels.iterdir())
    count, digest, file = there.run(there.python, "-c", RUNS).stdout.split()
    assert file.startswith(str(tmp_path))
    assert count == "0"
    count, other, _ = run(RUNS, tmp_path / "other").split()
    assert int(count) > 20
    assert digest == other
