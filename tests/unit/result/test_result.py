"""A result gives back the motion that was put into it: closed-form motions, laws of mechanics."""

import pickle

import numpy as np
import pytest
from support.internals import Evaluator, join, y_from_u
from support.results import (
    ARM,
    MASS,
    PIVOT,
    RATE,
    circling,
    circling_scene,
    drifting,
    model_of,
    result_of,
)
from support.rotations import to_global

import dap3d_core as dap
from dap3d_core.result import ResultError, RunStatistics, UnknownNameError


def test_stored_arrays_are_those_of_the_rows():
    result, out, ahead = circling()
    assert result.t.shape == (21,)
    assert result.u.shape == (21, 13)
    assert (result.r.shape, result.p.shape) == ((21, 1, 3), (21, 1, 4))
    np.testing.assert_allclose(result.r[:, 0], PIVOT + ARM * out, atol=1e-15)
    np.testing.assert_allclose(result.rd[:, 0], RATE * ARM * ahead, atol=1e-15)
    np.testing.assert_allclose(result.rdd[:, 0], -(RATE**2) * ARM * out, atol=1e-15)
    np.testing.assert_array_equal(result.v_dot[:, 3:], result.wd[:, 0])
    assert result.Lam.shape == (21, 3)


def test_angular_velocity_of_the_rows_is_in_body_axes_and_of_the_result_in_global_ones():
    scene = dap.Scene(name="tumbling")
    scene.add_body("top", mass=1.0, Jp=[1.0, 2.0, 3.0])
    model = model_of(scene)
    rng = np.random.default_rng(5)
    p = rng.normal(size=(7, 1, 4))
    p /= np.linalg.norm(p, axis=-1, keepdims=True)
    wp, wpd, r = rng.normal(size=(3, 7, 1, 3))
    y = np.hstack([join(r, p, r, wp), np.zeros((7, 1))])
    v_dot = np.concatenate([r, to_global(p, wpd)], axis=-1).reshape(7, 6)
    rows = np.hstack([np.arange(7.0)[:, None], y, v_dot, np.zeros((7, 4))])
    result = result_of(scene, rows, model, "unconstrained")
    np.testing.assert_allclose(result.w, to_global(p, wp), atol=1e-15)
    np.testing.assert_allclose(result.wp, wp, atol=1e-14)
    np.testing.assert_allclose(result.wpd, wpd, atol=1e-14)
    assert not np.allclose(result.w, wp)


def test_points_move_as_on_a_circle_and_those_of_the_ground_stand():
    result, out, ahead = circling()
    P = result.summary.point_index
    assert result.rP.shape == result.rPd.shape == result.rPdd.shape == (21, 3, 3)
    far = ARM + 0.1
    np.testing.assert_allclose(result.rP[:, P["P"]], PIVOT + far * out, atol=1e-14)
    np.testing.assert_allclose(result.rPd[:, P["P"]], RATE * far * ahead, atol=1e-14)
    np.testing.assert_allclose(result.rPdd[:, P["P"]], -(RATE**2) * far * out, atol=1e-14)
    for name in ("Q", "H"):
        np.testing.assert_allclose(result.rP[:, P[name]] - PIVOT, 0, atol=1e-15)
        np.testing.assert_allclose(result.rPd[:, P[name]], 0, atol=1e-14)
        np.testing.assert_allclose(result.rPdd[:, P[name]], 0, atol=1e-14)


def test_stored_arrays_cannot_be_changed_by_accident():
    result, _, _ = circling()
    for array in (result.t, result.u, result.r, result.Lam, result.v_dot, result.work):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_rows_of_another_width_are_refused():
    with pytest.raises(ValueError, match=r"\(nt, 28\), not \(5, 4\)"):
        result_of(circling_scene(), np.zeros((5, 4)))


def test_reaction_is_the_centripetal_force_and_its_opposite_on_the_ground():
    result, out, _ = circling()
    reaction = result.reaction("J1")
    assert list(reaction) == ["i", "j"]
    assert (reaction["i"].body, reaction["j"].body) == ("bob", "ground")
    force = -MASS * RATE**2 * ARM * out
    np.testing.assert_allclose(reaction["i"].force, force, atol=1e-13)
    np.testing.assert_allclose(reaction["i"].moment, 0, atol=1e-13)  # it passes the mass centre
    np.testing.assert_allclose(reaction["j"].force, -force, atol=1e-13)
    np.testing.assert_allclose(reaction["j"].moment, np.cross(PIVOT, -force), atol=1e-13)


def test_the_reported_multipliers_give_that_reaction():
    """The solver finds the multipliers of the closed form."""
    result, _, _ = circling()
    evaluator = Evaluator(result.model, "standard")
    for k in (0, 7, 20):
        found = evaluator.report(result.t[k], result.u[k])
        np.testing.assert_allclose(found[:6], result.v_dot[k], atol=1e-12)
        np.testing.assert_allclose(found[6:9], result.Lam[k], atol=1e-12)


def test_jacobian_of_many_rows_is_sparse(monkeypatch):
    monkeypatch.setattr("dap3d_core.result.post.force_output.DENSE_ROWS", 2)
    result, _, _ = circling(nt=4)
    dense, _, _ = circling(nt=4)
    monkeypatch.setattr("dap3d_core.result.post.force_output.DENSE_ROWS", 3)
    expected = dense.Jac
    monkeypatch.setattr("dap3d_core.result.post.force_output.DENSE_ROWS", 2)
    assert len(result.Jac) == 4
    for found, D in zip(result.Jac, expected, strict=True):
        assert found.shape == (3, 6)
        np.testing.assert_array_equal(found.toarray(), D)


@pytest.fixture(scope="module", params=["pen2", "fourbar2", "fourbar3"])
def thrown(request):
    """A shipped model at its start, its velocities thrown at random: no constraint level holds."""
    scene = dap.load(request.param)
    evaluator = Evaluator(model_of(scene), "standard")
    model = evaluator.model  # with the angles of its joints
    rng = np.random.default_rng(11)
    u = np.tile(model.u0, (3, 1))
    u[:, 7 * model.body_count :] += rng.normal(size=(3, 6 * model.body_count))
    t = np.array([0.0, 0.3, 0.7])
    report = np.array([evaluator.report(*each) for each in zip(t, u, strict=True)])
    y = y_from_u(u)
    result = result_of(scene, np.hstack([t[:, None], y, report]), model)
    return result, evaluator


def test_reactions_are_what_the_jacobian_transposed_gives(thrown):
    """Two ways to D^T lambda: block by block, and through the assembled Jacobian."""
    result, _ = thrown
    n = result.summary.body_count
    total = np.zeros((3, n, 6))
    for name in result.summary.joint_names:
        for one in result.reaction(name).values():
            if one.body != "ground":
                k = result.summary.body_index[one.body]
                total[:, k] += np.concatenate([one.force, one.moment], axis=1)
    expected = np.einsum("trc,tr->tc", result.Jac, result.Lam).reshape(3, n, 6)
    np.testing.assert_allclose(total, expected, atol=1e-12 * np.abs(expected).max())


def test_reactions_leave_the_machine_as_it_was(thrown):
    result, evaluator = thrown
    before = evaluator.report(result.t[0], result.u[0])
    result.reaction(result.summary.joint_names[-1])
    np.testing.assert_array_equal(evaluator.report(result.t[0], result.u[0]), before)


def test_an_unknown_joint_is_answered_with_the_nearest():
    result, _, _ = circling()
    with pytest.raises(UnknownNameError, match=r"no joint 'j1'.*did you mean 'J1'") as caught:
        result.reaction("j1")
    assert caught.value.nearest == "J1"
    assert isinstance(caught.value, KeyError)
    with pytest.raises(UnknownNameError, match="the scene has no joint"):
        drifting().reaction("J1")


def test_the_machine_is_made_once_and_only_when_needed():
    result, _, _ = circling()
    made = []
    origin = result._make_origin

    def counted():
        made.append(1)
        return origin()

    result._make_origin = counted
    _ = result.rP, result.energy, result.ledger, result.quantity("bob.r.z")
    assert made == []
    _ = result.Jac, result.reaction("J1"), result.model
    assert made == [1]


def test_what_the_run_says_of_itself():
    stats = RunStatistics(steps=7, rejected=1, rhs=90, projections=8, wall_time_s=0.5)
    result, _, _ = circling(
        status="interrupted", notes=["one", "two"], stats=stats, known_versions={"dap3d": "9"}
    )
    assert result.status == "interrupted"
    assert result.notes == ["one", "two"]
    assert result.stats.rhs == 90
    assert result.stats.compile_time_s == 0.0
    assert result.method == "standard"
    assert result.integrator == "dop853"
    assert result.settings["rtol"] == 1e-8
    assert result.versions == {"dap3d": "9"}
    assert result.record.title == "circling"
    assert result.scene_text == circling_scene().to_toml()
    assert repr(result) == (
        "<Result 'circling': interrupted, 1 bodies, 3 rows, 21 instants, t = 0 ... 1.7 s>"
    )
    with pytest.raises(ValueError, match="status"):
        circling(status="ready")


def test_a_result_travels_between_processes_without_its_model():
    result, _, _ = circling()
    _ = result.reaction("J1"), result.summary.body_index
    found = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(found.u, result.u)
    np.testing.assert_array_equal(found.rP, result.rP)
    assert found.record == result.record
    assert found.ledger == result.ledger
    assert not found.u.flags.writeable
    with pytest.raises(ResultError, match="save the result and open the file"):
        found.reaction("J1")


def test_versions_name_what_the_numbers_depend_on():
    versions = circling()[0].versions
    assert set(versions) == {"dap3d", "numpy", "llvmlite", "python"}
    assert versions["numpy"] == np.__version__
