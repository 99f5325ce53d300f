"""Reactions in both axes and about a joint's own point; what force elements do: closed forms."""

import numpy as np
import pytest
from support.internals import Evaluator, correct_initial, split
from support.motions import Motion
from support.results import ARM, MASS, PIVOT, RATE, about_z, circling, model_of, result_of, rows_of
from support.rotations import rotation
from support.scenes import scene_for

import dap3d_core as dap
from dap3d_core.result import ResultError, UnknownNameError

REGISTRY = dap.load_registry()
SEVERAL = [
    i.keyword
    for i in REGISTRY.listing()
    if i.kind == "joint"
    and i.state == "ok"
    and len(REGISTRY.get("joint", i.keyword).layout.slots) > 1
]


def test_body_axes_turn_with_the_body():
    """The pull towards the pivot is constant, along -x of the circling bob."""
    on = circling()[0].reaction("J1")
    pull = MASS * RATE**2 * ARM
    np.testing.assert_allclose(on["i"].force_body, np.tile([-pull, 0, 0], (21, 1)), atol=1e-13)
    np.testing.assert_allclose(on["i"].moment_body, 0, atol=1e-13)
    np.testing.assert_array_equal(on["j"].force_body, on["j"].force)  # ground does not turn
    np.testing.assert_array_equal(on["j"].moment_body, on["j"].moment)


def test_a_ball_joint_transmits_no_moment_at_its_point():
    """About the pivot, on the bob and on the ground, whose moment about the origin is not zero."""
    on = circling()[0].reaction("J1")
    assert np.abs(on["j"].moment).max() > 1.0
    for slot in "ij":
        np.testing.assert_allclose(on[slot].moment_at_point, 0, atol=1e-13)


def test_reactions_of_all_joints_are_those_of_each():
    from support.mechanisms import bent_chain

    scene = bent_chain(5)
    model = model_of(scene)
    rng = np.random.default_rng(1)
    t, u = np.array([0.0, 0.1]), np.tile(model.u0, (2, 1))
    u += 0.1 * rng.normal(size=u.shape)
    rows = rows_of(model, t, u, np.zeros((2, 30)), rng.normal(size=(2, model.row_count)))
    together, alone = result_of(scene, rows, model), result_of(scene, rows, model)
    everything = together.reactions()
    assert tuple(everything) == model.joint_names
    for name in model.joint_names:
        for slot, one in alone.reaction(name).items():
            for part in ("force", "moment", "force_body", "moment_body", "moment_at_point"):
                a, b = getattr(one, part), getattr(everything[name][slot], part)
                np.testing.assert_array_equal(a, b, err_msg=f"{name}.{slot}.{part}")


@pytest.mark.every(5)
@pytest.mark.parametrize("keyword", SEVERAL)
@pytest.mark.parametrize("ground", [None, "j"], ids=["body-body", "body-ground"])
def test_action_and_reaction(keyword, ground):
    """Any multipliers: forces of a joint cancel, moments about a common point too (Newton 3).
    On the constraints, where both bodies meet. Rows of the velocity level alone have to balance in
    force only: ``rel-tran`` is the manual's literal equation."""
    type_info = REGISTRY.get("joint", keyword)
    scene = scene_for(type_info, np.random.default_rng(7), ground=ground)
    model = model_of(scene)
    evaluator = Evaluator(model, "standard")
    u = correct_initial(evaluator, Motion(3, np.random.default_rng(8)).u(0.0)).u
    Lam = np.random.default_rng(9).normal(size=(2, model.row_count))
    Lam[1, ~model.position_row] = 0.0
    t, u = np.zeros(2), np.tile(u, (2, 1))
    rows = rows_of(model, t, u, np.zeros((2, 18)), Lam)
    on = result_of(scene, rows, model).reaction("element")
    r, common = split(u)[0], np.array([0.3, -2.0, 0.7])
    force, moment = np.zeros((2, 3)), np.zeros((2, 3))
    for one in on.values():
        centre = r[:, model.body_names.index(one.body)] if one.body != "ground" else 0.0
        force += one.force
        moment += one.moment + np.cross(centre - common, one.force)
        A = rotation(one.p)  # body components, by their definition
        np.testing.assert_allclose(
            np.einsum("tij,tj->ti", A, one.force_body), one.force, atol=1e-12
        )
        np.testing.assert_allclose(
            np.einsum("tij,tj->ti", A, one.moment_body), one.moment, atol=1e-12
        )
    assert max(np.abs(one.force).max() + np.abs(one.moment).max() for one in on.values()) > 0.1
    np.testing.assert_allclose(force, 0, atol=1e-12)
    np.testing.assert_allclose(moment[1], 0, atol=1e-8)  # |C| <= 1e-10 leaves an arm of that size


K, C, L0, FA = 30.0, 0.7, 0.4, 1.5


def sprung():
    """A bob that circles as in ``circling``, a spring and damper from it to a post, and weight."""
    result, out, ahead = circling()
    scene = dap.Scene(name="sprung")
    scene.add_body("bob", mass=MASS, Jp=[0.2, 0.3, 0.4], r=result.r[0, 0], w=[0, 0, RATE])
    scene.add_point("E", body="bob", sPp=[0.1, 0, 0])
    scene.add_point("post", body="ground", sPp=[1.0, 0.5, -0.2])
    scene.add_force("ptp", "spring", P_i="E", P_j="post", k=K, c=C, l0=L0, f_a=FA)
    scene.add_force("fp", "thrust", body_i="bob", fp=[1.0, 2.0, 3.0])
    scene.add_force("weight", "gravity")
    model = model_of(scene)
    rows = rows_of(model, result.t, result.u, result.v_dot, np.zeros((21, 0)))
    return result_of(scene, rows, model, "unconstrained"), out, ahead


def test_a_spring_and_damper_element():
    """Length, rate, tension and potential of ptp from the circle that its end runs on."""
    result, out, ahead = sprung()
    end, speed = PIVOT + (ARM + 0.1) * out, RATE * (ARM + 0.1) * ahead
    d = np.array([1.0, 0.5, -0.2]) - end
    length = np.sqrt((d * d).sum(axis=1))
    u = d / length[:, None]
    rate = -(u * speed).sum(axis=1)
    tension = K * (length - L0) + C * rate + FA
    found = result.force("spring")
    np.testing.assert_allclose(found.length, length, rtol=1e-14)
    np.testing.assert_allclose(found.length_rate, rate, atol=1e-13)
    np.testing.assert_allclose(found.tension, tension, rtol=1e-12)
    np.testing.assert_allclose(found.energy, K * (length - L0) ** 2 / 2 + FA * length, rtol=1e-12)
    np.testing.assert_allclose(found.on["i"].force, tension[:, None] * u, atol=1e-12)
    arm = end - result.r[:, 0]
    np.testing.assert_allclose(found.on["i"].moment, np.cross(arm, found.on["i"].force), atol=1e-12)
    np.testing.assert_allclose(found.on["i"].moment_at_point, 0, atol=1e-12)
    np.testing.assert_allclose(found.on["j"].force, -found.on["i"].force, atol=0)
    assert (found.on["i"].body, found.on["j"].body) == ("bob", "ground")
    np.testing.assert_allclose(found.on["j"].moment_at_point, 0, atol=1e-12)


def test_turns_are_counted_again_from_the_start():
    """A wheel that turns four times against a torsion spring: k times the whole angle."""
    scene = dap.Scene(name="wound")
    scene.add_body("wheel", mass=1.0, Jp=[1, 1, 1])
    scene.add_force("rot_sda", "coil", v_i="wheel.x", v_j="ground.x", axis="ground.z", k=2.0,
                    turns=True)  # fmt: skip
    model = model_of(scene)
    t = np.linspace(0.0, 1.0, 41)
    angle = 8 * np.pi * t  # a fifth of a turn and less from one instant to the next
    u = np.zeros((41, 13))
    u[:, 3:7] = about_z(angle)[:, 0]
    rows = rows_of(model, t, u, np.zeros((41, 6)), np.zeros((41, 0)), angles=-angle[:, None])
    result = result_of(scene, rows, model, "unconstrained")
    for _ in range(2):  # what a first evaluation counted does not enter a second
        found = result.force("coil")
        moment = np.zeros((41, 3))
        moment[:, 2] = -2.0 * angle
        np.testing.assert_allclose(found.on["i"].moment, moment, atol=1e-12)
        np.testing.assert_allclose(found.on["j"].moment, -moment, atol=1e-12)
        np.testing.assert_allclose(found.energy, angle**2, rtol=1e-12, atol=1e-12)
        assert found.length is None
        assert found.on["i"].moment_at_point is None
        result._forces.clear()


def test_friction_in_a_joint_has_no_quantities():
    scene = dap.Scene(name="rubbing")
    scene.add_body("wheel", mass=1.0, Jp=[1, 1, 1])
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force("friction", "rub", joint="axle", mu=0.2, radius=0.1, v_tol=1e-3)
    model = model_of(scene)
    rows = rows_of(model, np.zeros(1), model.u0[None], np.zeros((1, 6)), np.zeros((1, 5)))
    with pytest.raises(UnknownNameError, match=r"'rub' has no quantities: .* or in a joint"):
        result_of(scene, rows, model).quantity("rub.force")


def test_an_element_of_one_body_has_no_length():
    result, _, _ = sprung()
    found = result.force("thrust")
    np.testing.assert_allclose(found.on["i"].force_body, np.tile([1, 2, 3], (21, 1)), atol=1e-14)
    assert found.length is found.tension is found.energy is None


def test_forces_by_quantity_and_wrong_names():
    result, _, _ = sprung()
    found = result.force("spring")
    for name, values, unit in (
        ("spring.length", found.length, "m"),
        ("spring.length_rate", found.length_rate, "m/s"),
        ("spring.tension", found.tension, "N"),
        ("spring.energy", found.energy, "J"),
        ("spring.force", found.on["i"].force, "N"),
        ("spring.j.moment.y", found.on["j"].moment[:, 1], "N m"),
        ("thrust.force_body.z", found.on["i"].force_body[:, 2] * 0 + 3.0, "N"),
    ):
        quantity = result.quantity(name)
        np.testing.assert_allclose(quantity.values, values, atol=1e-14, err_msg=name)
        assert quantity.unit == unit
    assert result.quantity("spring.j.force.x").label == "force of spring.j, x"
    for wrong, words in {
        "spring.lenght": "did you mean 'spring.length'",
        "sprung.length": "did you mean 'spring.length'",
        "thrust.length": "the type of the force 'thrust' has no length",
        "spring.length.x": "spring.length has no components, not 'x'",
        "spring.k.force": "has the slots i, j, not 'k'",
        "spring.j.length": "not 'length'",
        "gravity.force": "it acts on every body",
    }.items():
        with pytest.raises(UnknownNameError, match=words):
            result.quantity(wrong)
    with pytest.raises(UnknownNameError, match="did you mean 'spring'"):
        result.force("Spring")


def test_reactions_by_slot_as_quantities():
    result = circling()[0]
    on = result.reaction("J1")
    for slot in "ij":
        for part in ("force", "moment", "force_body", "moment_body", "moment_at_point"):
            found = result.quantity(f"J1.{slot}.{part}").values
            np.testing.assert_array_equal(found, getattr(on[slot], part))
    np.testing.assert_array_equal(
        result.quantity("J1.moment_body.x").values, on["i"].moment_body[:, 0]
    )
    with pytest.raises(UnknownNameError, match="has the slots i, j, not 'k'"):
        result.quantity("J1.k.force")
    with pytest.raises(UnknownNameError, match="force_body, moment_body, moment_at_point, not"):
        result.quantity("J1.j.lambda")


def test_forces_of_a_result_without_its_model():
    import pickle

    found = pickle.loads(pickle.dumps(sprung()[0]))
    assert found.force_names == ("spring", "thrust", "gravity")
    with pytest.raises(ResultError, match="does not travel"):
        found.quantity("spring.length")
