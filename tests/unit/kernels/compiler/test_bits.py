"""Whole runs: plain Python and optimised code have the same bits.
Each function of them, also made quickly and without FMA: test_core.py, test_trace.py."""

import json

import pytest
from support.plain import jit_is_on
from support.problems import short_runs
from support.process import run

pytestmark = [
    pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled"),
    pytest.mark.slow,
    pytest.mark.long,
]

#: Says what runs gave; all code is optimised from the beginning.
SCRIPT = """
import hashlib
import json
import numpy as np
import dap3d_core as dap
from dap3d_core.kernels.compiler import background, objects
background.optimiser.add = lambda unit: None
objects.UNOPTIMISED = objects.OPTIMISED
for model, settings in {cases!r}:
    result = dap.simulate(model, **settings)
    energy = result.energy.total
    arrays = result.t, result.u, result.v_dot, result.Lam, result.rdd, result.wd, energy
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays))
    print(json.dumps([model, settings, digest.hexdigest(), result.stats.rhs]))
"""
CASES = [
    *short_runs(0.005),
    ("A03", {"t_end": 0.001, "dt": 0.001}),
    ("A05", {"t_end": 0.001, "dt": 0.001, "integrator": "radau"}),
]


def said(cache, **environment):
    """What one process says of all cases; code that several of them need is made once."""
    script = SCRIPT.format(cases=CASES)
    return [json.loads(line) for line in run(script, cache, **environment).splitlines()]


def test_optimised_runs_have_the_bits_of_plain_python(tmp_path):
    plain = said(tmp_path / "plain", DAP3D_PLAIN=1)
    assert [(model, settings) for model, settings, *_ in plain] == CASES
    assert said(tmp_path / "optimised") == plain
