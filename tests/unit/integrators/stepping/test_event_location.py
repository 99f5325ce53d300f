"""Where a switch comes nearest to zero within a step."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dap3d_core as dap
from dap3d_core.integrators.stepping.event_location import cubic_minimum, lowest_between


def test_a_dip_behind_a_rise_is_seen():
    """As of a gap behind a low bounce, of a body that is about to fall and is thrown up."""
    p = np.polynomial.Polynomial([0.0, 1.0, -3.0, 2.3])
    d = p.deriv()
    roots = d.roots()
    x = cubic_minimum(p(0.0), d(0.0), p(1.0), d(1.0))
    assert p(roots[1]) < 0.5 * p(roots[0])
    assert x == pytest.approx(roots[1], rel=1e-12)


def test_what_is_clear_of_zero_is_passed():
    """A rise alone, and a dip that leaves more than half of the rise before it."""
    assert cubic_minimum(0.0, 1.0, 2.0, 1.0) == 1.0
    p = np.polynomial.Polynomial([1.0, 1.0, -3.0, 2.3])
    d = p.deriv()
    assert cubic_minimum(p(0.0), d(0.0), p(1.0), d(1.0)) == 1.0


def test_a_dip_that_the_ends_do_not_show_is_seen_by_a_sample():
    """As of a ball beside the edge of a box: by its ends the least gap is clear of zero."""
    p = np.polynomial.Polynomial([0.0102, -0.0503, 0.0758, 0.1019])
    p += -0.34 * np.polynomial.Polynomial([0.0, 0.0, 1.0, -2.0, 1.0])
    d = p.deriv()
    ends = p(0.0), d(0.0), p(1.0), d(1.0)
    assert cubic_minimum(*ends) == 1.0
    x = lowest_between(*ends, 0.645, p(0.645))
    assert p(x) < 0.0
    assert x == pytest.approx(next(r.real for r in d.roots() if 0.0 < r.real < 1.0), rel=1e-6)
    higher = ends[0] + 0.05, ends[1], ends[2] + 0.05, ends[3]
    assert lowest_between(*higher, 0.645, p(0.645) + 0.05) == 1.0


def test_without_a_sample_between_the_ends_count():
    ends = 0.0, 1.0, 0.3, 1.9
    assert lowest_between(*ends, 0.0, 0.0) == cubic_minimum(*ends) < 1.0


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_ball_that_rolls_along_a_seam_passes_none(integrator):
    """Its centre is above the edge of a box, to rounding of places 100 m away. It took 3600 steps
    where each passage was located."""
    turn, place = Rotation.from_rotvec([-0.5, -0.6, 0.9]), np.array([58.0, -16.0, 31.0])
    scene = dap.Scene(name="on an edge")
    scene.add_body("box", mass=1.0, Jp=(1.0, 1.0, 1.0), r=place,
                   p=turn.as_quat(scalar_first=True))  # fmt: skip
    scene.add_joint("fix", "hold", body_i="box")
    start, motion = turn.apply([-0.3, 0.2, 0.15]), turn.apply([1.0, 0.0, 0.0])
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=place + start, r_dot=motion)
    scene.add_force("weight", "g", wgt=turn.apply([0.0, 0.0, -1.0]))
    scene.add_contact("ball_box", "table", P_i="ball.O", P_j="box.O", radius=0.1,
                      size=(1.0, 0.4, 0.1), mu=0.5)  # fmt: skip
    result = dap.simulate(scene, t_end=0.5, dt=0.5, integrator=integrator)
    assert result.stats.steps + result.stats.rejected < 60
    slip = 2.0 / (7.0 * 0.5 * 9.81)  # then it rolls, at 5/7 of its speed
    x = turn.inv().apply(result.r[-1, 1] - place)
    assert x == pytest.approx(
        [-0.3 + slip * 6.0 / 7.0 + 5.0 / 7.0 * (0.5 - slip), 0.2, 0.15], abs=1e-6
    )
