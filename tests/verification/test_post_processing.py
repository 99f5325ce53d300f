"""Arrays of the post-processor from real runs, against derivatives and closed forms."""

import numpy as np
import pytest
from support import problems
from support.rotations import rotation

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
STEP = 1e-3
#: Sixth-order central difference of seven samples.
WEIGHTS = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60.0
#: Truncation h^6 |7th derivative| / 140: the four-bar snaps through a pose at 0.22 s at rates of
#: 60 rad/s, so (60 h)^6 / 140 = 3e-10 of the derivative; errors of the run at 1e-12 divided by h
#: give 1e-9. Ten times that is asked for.
CLOSE = 1e-8


@pytest.fixture(scope="module", params=["pen1", "fourbar3"])
def result(request):
    """A cone that spins and swings in space; a driven four-bar. Both turn in three dimensions."""
    return dap.simulate(request.param, t_end=0.3, dt=STEP, correct=True, **TIGHT)


def rate(values):
    """Derivative of samples (nt, ...) at all but the first and last three."""
    nt = len(values)
    return sum(w * values[k : nt - 6 + k] for k, w in enumerate(WEIGHTS)) / STEP


def near(found, expected):
    scale = 1.0 + np.max(np.abs(expected))
    np.testing.assert_allclose(found[3:-3], expected, rtol=0, atol=CLOSE * scale)


def test_shapes(result):
    """Time first, then bodies, points or rows, then components."""
    nt, nB = len(result.t), result.summary.body_count
    nP, m = len(result.summary.point_names), result.summary.row_count
    for name in ("r", "rd", "w", "wp", "rdd", "wd", "wpd"):
        assert getattr(result, name).shape == (nt, nB, 3), name
    assert result.p.shape == (nt, nB, 4)
    for name in ("rP", "rPd", "rPdd"):
        assert getattr(result, name).shape == (nt, nP, 3), name
    assert result.Jac.shape == (nt, m, 6 * nB)
    assert result.Lam.shape == (nt, m)
    drawn = [name.startswith("animation.") for name in result.summary.point_names]
    assert drawn == sorted(drawn)  # animation points come last
    assert any(drawn) == (result.record.title == "pen1")


def test_translation(result):
    """rd and rdd are the first and second derivative of r."""
    near(result.rd, rate(result.r))
    near(result.rdd, rate(result.rd))


def test_rotation(result):
    """omega = 2 G p_dot, omega' = 2 L p_dot = A^T omega."""
    e0, e = result.p[3:-3, :, :1], result.p[3:-3, :, 1:]
    p_dot = rate(result.p)
    d0, d = p_dot[..., :1], p_dot[..., 1:]
    near(result.w, 2 * (-e * d0 + np.cross(e, d) + e0 * d))
    near(result.wp, 2 * (-e * d0 - np.cross(e, d) + e0 * d))
    turned = np.einsum("tbij,tbj->tbi", rotation(result.p), result.wp)
    np.testing.assert_allclose(turned, result.w, atol=1e-12)


def test_angular_acceleration(result):
    """wd is the derivative of w; wpd that of wp, component by component."""
    near(result.wd, rate(result.w))
    near(result.wpd, rate(result.wp))


def test_points(result):
    """rPd and rPdd are derivatives of rP: on bodies, on ground, and of animation points, last."""
    near(result.rPd, rate(result.rP))
    near(result.rPdd, rate(result.rPd))
    bodies = np.array(result.summary.point_body)
    assert np.all(result.rPdd[:, bodies == 0] == 0)
    assert np.abs(result.rPdd[:, bodies > 0]).max() > 1.0


def test_jacobian_is_that_of_the_motion(result):
    """D v = nu and D v_dot = gamma, here with nu = 0 but for the motor: D's rows see no motion."""
    v = np.concatenate([result.rd, result.w], axis=2).reshape(len(result.t), -1)
    motion = np.einsum("trc,tc->tr", result.Jac, v)
    expected = np.zeros(result.summary.row_count)
    if result.record.title == "fourbar3":
        expected[-1] = 2 * np.pi  # a_j . (omega_j - omega_i) = f_dot
    np.testing.assert_allclose(motion, np.broadcast_to(expected, motion.shape), atol=1e-10)


def test_multipliers_fulfil_the_equations_of_motion(result):
    """M v_dot = g + D^T lambda for every body, forces from the scene's own numbers."""
    summary = result.summary
    wp, wpd, A = result.wp, result.wpd, rotation(result.p)
    force = summary.mass[:, None] * result.rdd
    spin = np.einsum("bij,tbj->tbi", summary.Jp, wp)
    turn = np.einsum("bij,tbj->tbi", summary.Jp, wpd) + np.cross(wp, spin)
    moment = np.einsum("tbij,tbj->tbi", A, turn)
    given_f, given_n = np.zeros_like(force), np.zeros_like(moment)
    if result.record.title == "pen1":
        given_f[..., 2] = -9.81 * summary.mass
    else:  # fourbar3: a spring, 50 N/m and 8 m, from the coupler's end (0, 0, 3.2) to the origin
        coupler = summary.body_index["coupler"]
        arm = 3.2 * A[:, coupler, :, 2]
        d = -(result.r[:, coupler] + arm)
        length = np.linalg.norm(d, axis=1, keepdims=True)
        given_f[:, coupler] = 50.0 * (length - 8.0) * d / length
        given_n[:, coupler] = np.cross(arm, given_f[:, coupler])
    joints = np.concatenate([force - given_f, moment - given_n], axis=2)
    found = np.einsum("trc,tr->tc", result.Jac, result.Lam).reshape(joints.shape)
    np.testing.assert_allclose(found, joints, atol=1e-9 * (1 + np.abs(joints).max()))


def test_tension_of_the_pendulum():
    """A01 over 10 s: the rod pulls the bob towards the pivot with -3 m g y, to 1e-8 (closed form).
    28.294567206067251 N at t = 10 s: elliptic functions (benchmarks.md, A01)."""
    result = dap.simulate(problems.pendulum(), t_end=10.0, dt=0.1, rtol=1e-11, atol=1e-13)
    on, r = result.reaction("rod"), result.r[:, 0]
    tension = -3 * 9.81 * r[:, 1]
    np.testing.assert_allclose(on["i"].force, -tension[:, None] * r, atol=1e-8)
    np.testing.assert_allclose(on["j"].force, -on["i"].force, atol=0)
    norm = result.quantity("rod.force.norm").values
    np.testing.assert_allclose(norm, tension, atol=1e-8)
    assert norm[-1] == pytest.approx(28.294567206067251, abs=1e-8)
    for slot in "ij":  # the force passes the mass centre, and the origin
        np.testing.assert_allclose(on[slot].moment, 0, atol=1e-8)


def test_shelf_on_an_upright_hinge():
    """A shelf of 3 kg at rest, 0.4 m from its hinge: the hinge bears m g and the moment m g a.
    The shelf is turned by 30 deg about the upright axis: in its own axes all stays as it was."""
    mass, arm, turn = 3.0, 0.4, np.radians(30.0)
    out = np.array([np.cos(turn), np.sin(turn), 0.0])
    across = np.array([-np.sin(turn), np.cos(turn), 0.0])
    scene = dap.Scene(name="shelf")
    scene.add_body("shelf", mass=mass, Jp=(0.1, 0.2, 0.25), r=arm * out + (0.0, 0.0, 1.5),
                   p=(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))  # fmt: skip
    scene.add_point("edge", "shelf", (-arm, 0.0, 0.0))
    scene.add_point("post", "ground", (0.0, 0.0, 1.5))
    scene.add_joint("rev", "hinge", P_i="edge", P_j="post", a_i="shelf.z", a_j="ground.z")
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=0.5, dt=0.25)
    on, weight = result.reaction("hinge"), mass * 9.81
    nt = len(result.t)
    np.testing.assert_allclose(on["i"].force, np.tile([0, 0, weight], (nt, 1)), atol=1e-10)
    # about the mass centre nothing else acts, so the hinge's moment is zero there
    np.testing.assert_allclose(on["i"].moment, 0, atol=1e-10)
    # about the hinge: 0 - s x f with s = -a out, which is a out x (0, 0, m g) = -m g a across
    expected = np.tile(-weight * arm * across, (nt, 1))
    np.testing.assert_allclose(on["i"].moment_at_point, expected, atol=1e-10)
    np.testing.assert_allclose(on["j"].moment_at_point, -expected, atol=1e-10)
    np.testing.assert_allclose(on["i"].force_body, np.tile([0, 0, weight], (nt, 1)), atol=1e-10)
    ground = np.cross([0, 0, 1.5], [0, 0, -weight]) - expected[0]
    np.testing.assert_allclose(on["j"].moment, np.tile(ground, (nt, 1)), atol=1e-10)
