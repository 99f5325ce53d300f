"""With ``DAP3D_PLAIN=1`` the same sources run as plain Python and give the same numbers."""

import numpy as np
import pytest
from support.process import run

from dap3d_core.kernels.cache import jit_is_on

SCRIPT = """
import dap3d_core as dap
result = dap.simulate(dap.load({model!r}), t_end=0.02, dt=0.01, integrator={integrator!r},
                      step=0.005, allow_code=True)
for array in (result.u, result.v_dot, result.Lam, result.energy.total):
    print(" ".join(repr(float(x)) for x in array.ravel()))
"""


@pytest.mark.slow
@pytest.mark.skipif(not jit_is_on(), reason="compares with compiled code")
@pytest.mark.parametrize(
    ("model", "integrator"),
    [
        ("bodies2", "rk4"),
        ("ball1", "dopri5"),
        ("pen2", "dop853"),
        ("fourbar2", "rk4"),
        ("fourbar3", "dopri5"),
    ],
)
def test_plain_python_gives_the_numbers_of_compiled_code(model, integrator):
    """Every stored array agrees to 1e-11 of its size.

    That is some hundred roundings, and the condition of the constraints.
    """
    script = SCRIPT.format(model=model, integrator=integrator)
    compiled, plain = (run(script, DAP3D_PLAIN=off).split("\n") for off in (0, 1))
    for a, b in zip(compiled, plain, strict=True):
        a, b = np.array(a.split(), dtype=float), np.array(b.split(), dtype=float)
        assert a == pytest.approx(b, abs=1e-11 * (1.0 + np.max(np.abs(a), initial=0.0)))
