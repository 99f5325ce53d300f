"""Compiled steps: the bits of plain Python, whatever room there was."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from support.plain import jit_is_on
from support.process import run
from verification.test_stepping import ball, slope, tower

import dap3d_core as dap
from dap3d_core.assembly.collisions import placed_shapes
from dap3d_core.integrators.moreau import arrays, problem


def quadruped():
    """Joints, servos, and feet that touch from 63 ms on."""
    return dap.load("quadruped")


#: Scene, and settings of a short run: impacts, joints, square matrices and blocks.
CASES = {
    "slope": (slope, {"t_end": 0.02, "dt": 0.01, "contact_step": 5e-3}),
    "ball": (lambda: ball(1e-3, mu=0.3, e=0.5), {"t_end": 0.02, "dt": 0.01, "contact_step": 5e-3}),
    "tower": (tower, {"t_end": 0.005, "dt": 0.005, "contact_step": 5e-3}),
    "quadruped": (quadruped, {"t_end": 0.07, "dt": 0.01, "contact_step": 5e-3}),
}
SCRIPT = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[3])!r})
from unit.integrators.moreau.test_step import digests
print(*digests())
"""


def digest(name):
    """Of all that a run gives."""
    make, settings = CASES[name]
    result = dap.simulate(make(), **settings)
    table = result.contacts
    given = result.u, result.v_dot, result.Lam, table.t, table.mode, table.gap, table.force
    parts = [np.ascontiguousarray(array).tobytes() for array in given]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def digests():
    """Of all cases."""
    return [digest(name) for name in CASES]


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
def test_compiled_steps_have_the_bits_of_plain_python():
    assert run(SCRIPT, DAP3D_PLAIN=1).split() == digests()


@pytest.mark.parametrize("name", CASES)
def test_room_changes_no_bit(monkeypatch, name):
    """Next to none at first; each stage that waits for it is done again."""
    usual = digest(name)
    for module, names in ((placed_shapes, ["ROOM"]), (arrays, ["ROOM", "LOG_ROOM"])):
        for one in names:
            monkeypatch.setattr(module, one, 1)
    assert digest(name) == usual


def test_blocks_have_the_results_of_squares(monkeypatch):
    """A tower of 120 unknowns, to rounding of the solves, but which corner carries what."""
    make, settings = CASES["tower"]
    blocks = dap.simulate(make(), **settings)
    monkeypatch.setattr(problem, "SMALL", 120)
    assert dap.simulate(make(), **settings).u == pytest.approx(blocks.u, abs=1e-11)
