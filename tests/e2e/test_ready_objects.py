"""Ready-made objects as a wheel carries them: first runs compile nothing and have the same bits."""

import subprocess
import sys

import pytest
from support.process import REPOSITORY, environment, run

from dap3d_core.kernels.compiler import objects, ready
from dap3d_core.kernels.runtime.cache import jit_is_on

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled"),
]

RUNS = """
import hashlib
from pathlib import Path
from dap3d_core.kernels.compiler import ready, units
ready.FOLDER = Path({folder!r})
import dap3d_core as dap
found = hashlib.sha256()
for model in ("fourbar3", "tri", "pen2", "bodies2"):
    for integrator in ("dop853", "adams", "radau"):
        result = dap.simulate(dap.load(model), t_end=0.02, dt=0.01, integrator=integrator)
        found.update(result.u.tobytes())
print(len(units.compiled_units), found.hexdigest())
"""


def test_first_runs_compile_nothing_and_have_the_same_bits(tmp_path):
    """With an empty cache; beside runs whose code was made for this very processor."""
    target = ready.target_of(objects.processor().triple, objects.host_features())
    if target is None:
        pytest.skip("objects are made for no such machine")
    script = [sys.executable, str(REPOSITORY / "tools" / "ready_objects.py")]
    subprocess.run(
        [*script, str(tmp_path), target], env=environment(), check=True, capture_output=True
    )
    made, bits = run(RUNS.format(folder=str(tmp_path)), tmp_path / "empty").split()
    assert made == "0"
    made, other = run(RUNS.format(folder=str(tmp_path / "none")), tmp_path / "other").split()
    assert int(made) > 20
    assert bits == other
