"""Compiled steps: the bits of plain Python, whatever room there was."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from support.internals import placed_shapes
from support.plain import jit_is_on, long_in_plain_python
from support.process import run
from verification.test_stepping import ball, collide, slope, tower
from verification.test_sticking_under_load import pendulum

import dap3d_core as dap
from dap3d_core.integrators.moreau import arrays


def quadruped():
    """Joints, servos, and feet that touch from 63 ms on."""
    return dap.load("quadruped")


#: Scene, and settings of a short run: impacts, joints, friction, squares and blocks.
CASES = {
    "slope": (slope, {"t_end": 0.02, "dt": 0.01, "contact_step": 5e-3}),
    "ball": (lambda: ball(1e-3, mu=0.3, e=0.5), {"t_end": 0.02, "dt": 0.01, "contact_step": 5e-3}),
    "tower": (tower, {"t_end": 0.005, "dt": 0.005, "contact_step": 5e-3}),
    "friction": (pendulum, {"t_end": 0.02, "dt": 0.01, "contact": "stepping",
                            "contact_step": 5e-3}),
    "quadruped": (quadruped, {"t_end": 0.07, "dt": 0.01, "contact_step": 5e-3}),
}  # fmt: skip
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


@pytest.mark.slow
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


@long_in_plain_python
def test_blocks_have_the_results_of_squares(monkeypatch):
    """A tower of 120 unknowns, to rounding of the solves, but which corner carries what."""
    make, settings = CASES["tower"]
    blocks = dap.simulate(make(), **settings)
    monkeypatch.setattr(arrays, "DENSE_SIZE", 120)
    assert dap.simulate(make(), **settings).u == pytest.approx(blocks.u, abs=1e-11)


def thrown(r_dot, c=0.0):
    """Two balls on the floor and a third on them, with a damper to a wall; an arm with limits."""
    scene = dap.Scene(name="thrown")
    for k in range(3):
        z, v = 0.1 + 0.19 * k, r_dot if k == 2 else [0.0, 0.0, 0.0]
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.01] * 3, r=[0.0, 0.0, z], r_dot=v)
        scene.add_shape("sphere", body=f"b{k}", radius=0.1, collides=True)
    scene.add_point("wall", "ground", [10.0, 0.0, 0.48])
    scene.add_force("ptp", "damper", P_i="b2.O", P_j="wall", c=c)
    scene.add_body("arm", mass=1.0, Jp=[0.01] * 3, r=[10.0, 0.0, 0.48])
    scene.add_joint("rev", "axle", P_i="arm.O", P_j="wall", a_i="arm.x", a_j="ground.x",
                    lower=-1.0, upper=1.0)  # fmt: skip
    return collide(scene, mu=0.3)


@pytest.mark.parametrize(("v", "c", "words"), [
    ([1.0, 0.0, 0.0], 1e11, r"forces change motion at [\d.e+]+ 1/s there.*shorter contact_step"),
    ([1.0, 0.0, -1e78], 0.0, "body b[012] runs away"),  # what stops has rounding of it
])  # fmt: skip
def test_numbers_that_overflow_end_a_run_in_words(v, c, words):
    """By compiled kernels and plain ones; the result until then is kept."""
    with pytest.raises(dap.SimulationError, match=words) as stopped:
        dap.simulate(thrown(v, c), t_end=2e-3, dt=1e-3, contact_step=1e-3)
    assert np.isfinite(stopped.value.result.u).all()
    assert stopped.value.result.t[0] == 0.0


@long_in_plain_python
def test_shapes_may_be_far_beyond_the_integers_of_cells():
    """A distance of 1e57 m; tolerance: rounding of two steps in 1000 parts at most."""
    result = dap.simulate(thrown([1e60, 0.0, 0.0]), t_end=2e-3, dt=1e-3, contact_step=1e-3)
    assert result.r[-1, 2, 0] == pytest.approx(2e57, rel=4.4e-13)
