"""Quantities by name: each is the array it names, and a wrong name is answered with a right one."""

import numpy as np
import pytest
from support.results import ARM, MASS, RATE, circling, model_of, result_of
from support.state_types import REGISTRY, pulled

import dap3d_core as dap
from dap3d_core.result import UnknownNameError, find
from dap3d_core.scene import AnimationPoint


@pytest.fixture(scope="module")
def result():
    return circling()[0]


def test_vectors_of_a_body_with_label_and_unit(result):
    for name, unit in {
        "r": "m", "rd": "m/s", "rdd": "m/s^2", "w": "rad/s", "wp": "rad/s", "wd": "rad/s^2",
        "wpd": "rad/s^2", "p": "1",
    }.items():  # fmt: skip
        values, label, found = result.quantity(f"bob.{name}")
        np.testing.assert_array_equal(values, getattr(result, name)[:, 0])
        assert found == unit
        assert "of bob" in label


def test_components_and_length(result):
    r = result.r[:, 0]
    for k, axis in enumerate("xyz"):
        np.testing.assert_array_equal(result.quantity(f"bob.r.{axis}").values, r[:, k])
    np.testing.assert_allclose(result.quantity("bob.rd.norm").values, RATE * ARM, rtol=1e-14)
    assert result.quantity("bob.r.z").label == "position of bob, z"
    for k in range(4):
        np.testing.assert_array_equal(result.quantity(f"bob.p.e{k}").values, result.p[:, 0, k])


def test_roll_pitch_and_yaw_count_turns_from_one_reported_instant_to_the_next(result):
    """The bob goes round about z by RATE t, past half a turn; it neither rolls nor pitches."""
    turned = RATE * result.t
    assert turned[-1] > np.pi
    for name, expected in {"roll": 0.0, "pitch": 0.0, "yaw": turned}.items():
        values, label, unit = result.quantity(f"bob.{name}")
        np.testing.assert_allclose(values, np.broadcast_to(expected, turned.shape), atol=1e-14)
        assert (label, unit) == (f"{name} of bob", "rad")
    with pytest.raises(UnknownNameError, match=r"bob\.yaw has no components"):
        result.quantity("bob.yaw.x")


def test_roll_and_yaw_count_turns_between_reports_far_apart():
    """A free body at 40 rad/s, reported ten times a second: 4 rad from one report to the next."""
    scene = dap.Scene(name="spun")
    scene.add_body("rotor", mass=1.0, Jp=[1.0, 1.0, 1.0], w=[0.0, 0.0, -40.0])
    result = dap.simulate(scene, t_end=3.0, dt=0.1)
    np.testing.assert_allclose(result.quantity("rotor.yaw").values, -40.0 * result.t, atol=1e-9)
    np.testing.assert_allclose(result.quantity("rotor.roll").values, 0.0, atol=1e-12)


def test_points(result):
    P = result.summary.point_index["P"]
    for name, array in {"r": result.rP, "v": result.rPd, "a": result.rPdd}.items():
        np.testing.assert_array_equal(result.quantity(f"P.{name}").values, array[:, P])
    assert result.quantity("P.a.norm").unit == "m/s^2"


def test_animation_points_have_a_dot_in_their_names():
    scene = dap.Scene(name="drawn")
    scene.add_body("b", mass=1.0, Jp=[1, 1, 1])
    scene.animation.points.append(AnimationPoint(body="b", sPp=[1.0, 2.0, 3.0]))
    model = model_of(scene)
    rows = np.zeros((1, 1 + 14 + 6 + 4))
    rows[0, 4] = 1.0  # e0
    result = result_of(scene, rows, model, "unconstrained")
    np.testing.assert_array_equal(result.quantity("animation.1.r").values, [[1, 2, 3]])
    np.testing.assert_array_equal(result.quantity("animation.1.r.y").values, [2])
    with pytest.raises(UnknownNameError, match=r"did you mean 'animation\.1\.r'"):
        result.quantity("animation.2.r")


def test_reactions_are_those_on_the_first_body(result):
    values, label, unit = result.quantity("J1.force")
    np.testing.assert_array_equal(values, result.reaction("J1")["i"].force)
    assert (label, unit) == ("reaction force of J1", "N")
    norm = result.quantity("J1.force.norm").values
    np.testing.assert_allclose(norm, MASS * RATE**2 * ARM, rtol=1e-13)
    assert result.quantity("J1.moment.x").unit == "N m"


def test_multipliers_by_row_from_one(result):
    np.testing.assert_array_equal(result.quantity("J1.lambda").values, result.Lam)
    np.testing.assert_array_equal(result.quantity("J1.lambda.2").values, result.Lam[:, 1])
    assert find(result, "J1.lambda").components == ("1", "2", "3")


def test_quantities_of_the_whole(result):
    for name, array in {
        "t": result.t,
        "work": result.work,
        "energy.kinetic": result.energy.kinetic,
        "energy.potential": result.energy.potential,
        "energy.total": result.energy.total,
        "constraint.position": result.arrays.position_residual,
        "constraint.velocity": result.arrays.velocity_residual,
        "constraint.acceleration": result.arrays.acceleration_residual,
    }.items():
        np.testing.assert_array_equal(result.quantity(name).values, array)
    assert result.quantity("work").unit == "J"


def test_a_name_that_a_body_and_a_point_share_means_the_body_where_it_can():
    scene = dap.Scene(name="twins")
    scene.add_body("b", mass=1.0, Jp=[1, 1, 1])
    scene.add_point("b", body="b", sPp=[1.0, 0.0, 0.0])
    rows = np.zeros((1, 25))
    rows[0, 4] = 1.0
    result = result_of(scene, rows, model_of(scene), "unconstrained")
    np.testing.assert_array_equal(result.quantity("b.r").values, [[0, 0, 0]])
    assert result.quantity("b.v").label == "velocity of b"  # only the point has v
    np.testing.assert_array_equal(result.quantity("b.rP").values, [[1, 0, 0]])
    np.testing.assert_array_equal(result.quantity("b.rPdd.norm").values, [0])


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("bbo.r.z", "bob.r.z"),
        ("Bob.w", "bob.w"),
        ("bob.R", "bob.r"),
        ("bob.rdx.z", "bob.rd.z"),
        ("bob.r.Z", "bob.r.z"),
        ("bob.p.e", "bob.p.e0"),
        ("J1.forces.norm", "J1.force.norm"),
        ("j1.force.x", "J1.force.x"),
        ("J1.lambda.4", "J1.lambda"),
        ("energy.kinetik", "energy.kinetic"),
        ("constraint.positions", "constraint.position"),
        ("wrok", "work"),
    ],
)
def test_the_nearest_right_name(result, wrong, right):
    with pytest.raises(UnknownNameError) as caught:
        result.quantity(wrong)
    near = caught.value.nearest
    assert near.startswith(right[: -1 if right.endswith("e0") else None])
    result.quantity(near)  # what is proposed exists
    assert repr(near) in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (
            "bob",
            "which quantity of the body 'bob': r, p, rd, w, wp, rdd, wd, wpd, roll, pitch, yaw",
        ),
        ("bob.q", "the body 'bob' has r, p, rd, w, wp, rdd, wd, wpd, roll, pitch, yaw, not 'q'"),
        ("bob.r.x.y", "bob.r has x, y, z, norm, not 'x.y'"),
        ("bob.p.norm", "bob.p has e0, e1, e2, e3, not 'norm'"),
        ("P.w", "the point 'P' has r, v, a, not 'w'"),
        (
            "zzz.r",
            "no body, point, joint, contact or force 'zzz'; body: bob; point: Q, H, P; joint: J1",
        ),
        ("", "no quantity ''; there are BODY.r"),
        (".", "no body, point, joint, contact or force ''"),
    ],
)
def test_what_is_wrong_with_a_name(result, wrong, words):
    with pytest.raises(UnknownNameError) as caught:
        result.quantity(wrong)
    assert words in str(caught.value)


def test_only_what_the_type_of_a_force_has_is_listed():
    """A moment has no length and no tension, and weight has nothing."""
    scene = dap.Scene()
    scene.add_body("a", mass=1.0, Jp=[1, 1, 1], r=[1, 0, 0])
    scene.add_force("ptp", "spring", P_i="a.O", P_j="ground.O", k=1.0)
    scene.add_force("n", "twist", body_i="a", n=[1.0, 0.0, 0.0])
    scene.add_force("weight", "gravity")
    found, told = dap.simulate(scene, t_end=0.1, dt=0.1), {}
    for name in scene.forces:
        with pytest.raises(UnknownNameError) as caught:
            found.quantity(name)
        told[name] = str(caught.value).rpartition(": ")[2]
    actions = "force, moment, force_body, moment_body, moment_at_point"
    assert told == {
        "spring": f"{actions}, length, length_rate, tension, energy",
        "twist": actions,
        "gravity": "it acts on no body of its own",
    }


@pytest.fixture(scope="module")
def with_states():
    """A run of two forces with states, one of them with two."""
    scene = pulled()
    scene.add_force("test-lag", "lag", body_i="cart", k=2.0, tau=0.5, held_0=(1.0, 2.0, 3.0))
    return dap.simulate(dap.compile(scene, registry=REGISTRY), t_end=0.2, dt=0.1)


def test_states_are_quantities_by_name(with_states):
    """Numbers and vectors, whole or by components from 1; the first instant has the fields."""
    assert with_states.quantity("spring.z").values.shape == (3,)
    assert with_states.quantity("spring.z").values[0] == 0.1
    held = with_states.quantity("lag.held").values
    assert held.shape == (3, 3)
    assert list(held[0]) == [1.0, 2.0, 3.0]
    assert np.array_equal(with_states.quantity("lag.held.2").values, held[:, 1])
    assert with_states.quantity("lag.clock").values == pytest.approx([0.0, 0.1, 0.2], abs=1e-14)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("spring.zz", ["has force", "z", "not 'zz'"]),
        ("lag.held.4", ["lag.held has 1, 2, 3, not '4'"]),
        ("spring.z.1", ["no components"]),
        ("spring.i.z", ["not 'z'"]),
    ],
)
def test_a_wrong_name_is_refused(with_states, name, words):
    """The error lists what there is."""
    with pytest.raises(UnknownNameError) as caught:
        with_states.quantity(name)
    assert not [word for word in words if word not in str(caught.value)]


def test_a_file_holds_the_states(with_states, tmp_path):
    """Saved and opened, with their names; xarray has them as a variable."""
    with_states.save(tmp_path / "r.nc")
    opened = dap.open(tmp_path / "r.nc")
    assert np.array_equal(
        opened.quantity("lag.held").values, with_states.quantity("lag.held").values
    )
    data = with_states.to_xarray()["states"]
    assert list(data.coords["element_state"].values) == [
        "forces.spring.z", "forces.lag.held.1", "forces.lag.held.2", "forces.lag.held.3",
        "forces.lag.clock",
    ]  # fmt: skip


def test_the_force_of_an_element_follows_its_state(with_states):
    """A force evaluated again at reported instants takes the states of these."""
    held, force = with_states.quantity("lag.held").values, with_states.force("lag").on["i"].force
    assert np.array_equal(force, held)


def test_columns_are_names_of_quantities():
    """Of vectors, of rows, and of contacts with several points; so a sweep can keep them."""
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=1.0, Jp=(0.01, 0.01, 0.01), r=(0.0, 0.0, 0.05))
    scene.add_force("weight", "gravity")
    scene.add_contact("box_plane", "floor", body_i="box", size=(0.1, 0.1, 0.1), mu=0.5)
    result = dap.simulate(scene, t_end=0.01)
    for name, first, count in [
        ("box.r", "box.r.x", 3),
        ("box.r.z", "box.r.z", 1),
        ("floor.normal", "floor#1.normal", 8),
        ("floor#2.slip", "floor#2.slip.x", 3),
    ]:
        quantity = find(result, name)
        assert quantity.columns[0] == first
        assert len(quantity.columns) == count
        for column, values in zip(quantity.columns, np.atleast_2d(quantity.values.T), strict=True):
            np.testing.assert_array_equal(find(result, column).values, values)
    by_mass = {"bodies.box.mass": [1.0, 2.0]}
    kept = dap.sweep(scene, by_mass, outputs="floor.normal:max", t_end=0.01)
    np.testing.assert_allclose(kept["floor#1.normal:max"], [9.81 / 4, 2 * 9.81 / 4])


def test_an_expression_is_told_to_be_an_output_first(result):
    with pytest.raises(UnknownNameError, match=r"declare it in \[outputs\]"):
        find(result, "bob.r.z - 0.5 * norm(bob.rd)")
    with pytest.raises(UnknownNameError, match="no body, point, joint"):
        find(result, "my-bob.r.z")
