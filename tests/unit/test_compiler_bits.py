"""Whole runs: plain Python, code made quickly, well, and without FMA have the same bits."""

import pytest
from support.process import run

from dap3d_core.kernels.cache import jit_is_on

pytestmark = [pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled"), pytest.mark.slow]

#: Says what a run gave. {level}: -1 changes nothing, else the level at which all code is made.
SCRIPT = """
import hashlib
import numpy as np
import dap3d_core as dap
from dap3d_core.kernels.compiler import units
if {level} >= 0:
    units.later.add = lambda unit: None
    units.QUICK = {level}
result = dap.simulate({model!r}, **{settings!r})
arrays = result.t, result.u, result.Lam, result.rdd, result.wd
print(hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest(),
      result.stats.rhs)
"""
SHORT = {"t_end": 0.03, "dt": 0.01}
CASES = [
    ("fourbar3", SHORT),
    ("fourbar3", SHORT | {"method": "penalty"}),
    ("fourbar3", SHORT | {"method": "lsq"}),
    ("pen2", SHORT | {"integrator": "adams"}),
    ("pen2", SHORT | {"integrator": "radau"}),
    ("fourbar2", SHORT | {"integrator": "dopri5"}),
    ("pen1", SHORT | {"integrator": "rk4", "step": 0.005}),
    ("bodies2", SHORT),
    ("ball1", {"t_end": 0.5, "dt": 0.1, "allow_code": True}),
    ("tri", SHORT),
    ("A03", {"t_end": 0.003, "dt": 0.001}),
    ("A05", {"t_end": 0.01, "dt": 0.01, "integrator": "radau"}),
]


@pytest.mark.parametrize(("model", "settings"), CASES, ids=lambda x: str(x))
def test_a_run_has_the_same_bits_however_it_is_compiled(model, settings, tmp_path):
    def said(level=-1, **environment):
        script = SCRIPT.format(level=level, model=model, settings=settings)
        return run(script, tmp_path / f"cache{level}{len(environment)}", **environment)

    plain = said(DAP3D_PLAIN=1)
    assert said(0) == plain
    assert said(3) == plain
    assert said(3, DAP3D_CPU="x86-64") == plain
