"""Cables over drums and muscles against closed forms."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.kernels import wrapped
from dap3d_forces.tendon_law import activated, contracted

R = 0.2
Z = (0.0, 0.0, 1.0)


@pytest.mark.parametrize("axis", [None, Z])
@pytest.mark.parametrize("side", [None, (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)])
def test_length_is_two_tangents_and_an_arc(axis, side):
    """A and B lie at the height y at -1 and 1; above y = R the way is straight, or round below."""
    for y in (-0.15, 0.1, 0.19, 0.2001, 0.5):
        A, B = (-1.0, y, 0.0), (1.0, y, 0.0)
        l, below = np.hypot(1.0, y), side is not None and side[1] < 0.0
        above = not below if side is not None else y > 0.0
        phi = np.pi - 2.0 * np.arctan(y) if above else np.pi + 2.0 * np.arctan(y)
        arc = phi - 2.0 * np.arccos(R / l)
        touches = arc > 0.0
        expected = 2.0 * np.sqrt(l * l - R * R) + R * arc if touches else 2.0
        length, *_, reach, _ = wrapped(A, B, (0.0, 0.0, 0.0), R, axis, side, inside=False)
        assert (reach > 0.0) == touches
        np.testing.assert_allclose(length, expected, rtol=1e-14)


def test_a_helix_and_a_ring():
    """On the developed cylinder the way is straight; through a ring it is of equal angles."""
    B = (1.0, 0.1, 0.7)
    flat = wrapped((-1.0, 0.1, 0.0), (1.0, 0.1, 0.0), (0.0, 0.0, 0.0), R, Z, None, inside=False)[0]
    length = wrapped((-1.0, 0.1, 0.0), B, (0.0, 0.0, 0.0), R, Z, None, inside=False)[0]
    np.testing.assert_allclose(length, np.hypot(flat, 0.7), rtol=1e-14)
    through = wrapped(
        (-1.0, 0.5, 0.0), (1.0, 0.5, 0.0), (0.0, 0.0, 0.0), R, None, None, inside=True
    )
    np.testing.assert_allclose(through[0], 2.0 * np.hypot(1.0, 0.5 - R), rtol=1e-14)


@pytest.mark.parametrize("axis", [None, Z])
def test_length_and_slope_are_continuous_where_it_touches(axis):
    """About y = R the length bends by h^1.5, no less: differences of 1e-5 leave 1e-6 of a slope."""

    def length(y):
        return wrapped((-1.0, y, 0.0), (1.0, y, 0.1), (0.0, 0.0, 0.0), R, axis, (0.0, 1.0, 0.0),
                       inside=False)[0]  # fmt: skip

    h = 1e-9
    at = R if axis is not None else np.sqrt(R * R - 0.05**2)  # the sphere lies below the middle
    step = length(at - h) - length(at + h)
    assert abs(step) < 1e-10
    slope = (length(at - 2e-5) - length(at - 1e-5)) / 1e-5
    assert 0.0 < slope < 1e-3


def swinging(**fields):
    """A load on a rope over a drum that turns about its centre beside it."""
    scene = dap.Scene(name="drum")
    scene.add_body("load", mass=2.0, Jp=[0.1, 0.1, 0.1], r=[0.6, 0.0, 0.1], r_dot=[0.0, 0.3, 1.0])
    scene.add_body("drum", mass=2.0, Jp=[0.1, 0.1, 0.1])
    scene.add_joint("rev", "axle", P_i="drum.O", P_j="ground.O", a_i="drum.y", a_j="ground.y")
    scene.add_point("hook", body="ground", sPp=[-0.6, 0.0, 0.15])
    scene.add_point("centre", body="drum", sPp=[0.05, 0.0, 0.0])
    scene.add_force("weight", "gravity")
    rope = {"points": ["hook", "load.O"], "drums": ["centre"], "after": [1], "radii": [R], **fields}
    scene.add_force("tendon", "rope", **rope)
    return scene


@pytest.mark.parametrize("fields", [{"axes": ["drum.y"]}, {}])
def test_energy_is_conserved_as_it_touches_and_leaves(fields):
    """A force that is not -dL/dq times the tension would change it: to 1e-8 at these tolerances."""
    scene = swinging(**fields, k=200.0, slack=True)
    result = dap.simulate(scene, t_end=3.0, dt=0.1, rtol=1e-10, atol=1e-12)
    energy = result.quantity("energy.total").values
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-7)
    assert np.max(np.abs(result.w[:, 1])) > 0.01
    assert result.quantity("rope.tension").values.max() > 10.0


def test_a_tackle_halves_the_force():
    """Of divisors of 2 a span counts half and pulls half; the gap between branches does not."""
    scene = dap.Scene(name="tackle")
    scene.add_body("load", mass=2.0, Jp=[0.1, 0.1, 0.1], r=[0.0, 0.0, -1.0])
    scene.add_point("hook", body="ground", sPp=[0.0, 0.0, 1.0])
    scene.add_force("tendon", "rope", points=["hook", "load.O", "load.O", "ground.O"], k=100.0,
                    divisors=[2, 0, 4, 1], length=0.5)  # fmt: skip
    result = dap.simulate(scene, t_end=0.0)
    T = 100.0 * (2.0 / 2.0 + 1.0 / 4.0 - 0.5)
    np.testing.assert_allclose(result.quantity("rope.tension").values, T, rtol=1e-14)
    np.testing.assert_allclose(result.rdd[0, 0], [0.0, 0.0, T * 0.75 / 2.0], rtol=1e-13)


def test_curves_of_a_muscle():
    """At, below and above the optimum, at rest and in motion; activation at its time constants."""
    muscle = (100.0, 0.1, 0.2, 0.5, 1.6, 1.5, 1.3, 1.2, 0.01, 0.04, 0.0)
    T = [contracted(L, v, 1.0, muscle) for L, v in
         ((0.3, 0.0), (0.275, 0.0), (0.25, 0.0), (0.3, -0.15), (0.3, 1.0),
          (0.36, 0.0))]  # fmt: skip
    np.testing.assert_allclose(
        T, [100.0, 50.0, 0.0, 0.0, 120.0, 1.5 * 130.0], rtol=1e-12, atol=1e-9
    )
    assert activated(1.0, 0.0, muscle) == pytest.approx(1.0 / 0.005)
    assert activated(0.0, 1.0, muscle) == pytest.approx(-2.0 / 0.04)


@pytest.mark.parametrize(("wrong", "words"), [
    ({"after": [2]}, "after should have a number from 1 to 1"),
    ({"radii": [-0.1]}, "numbers above 0"),
    ({"axes": ["ground.y"]}, "axes should lie on the bodies of their drums"),
    ({"ways": [1]}, "ways should be 0, 1 with sides, or 2"),
    ({"points": ["ground.O", "ground.O"], "after": [1]}, "points 1 and 2 are in one place"),
])  # fmt: skip
def test_drums_that_contradict_each_other_are_refused(wrong, words):
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(swinging(k=1.0, **wrong))


def test_a_joint_tendon_counts_turns():
    """A wheel swings on a spring about two turns: its period is 2 pi sqrt(J / (k c^2))."""
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=1.0, Jp=[0.1, 0.1, 0.1], w=[0.0, 0.0, 30.0])
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force("joint_tendon", "spring", movers=["wheel"], holders=["ground"],
                    axes=["ground.z"], coefs=[0.2], k=40.0)  # fmt: skip
    result = dap.simulate(scene, t_end=2.0, dt=0.1, rtol=1e-10, atol=1e-12)
    rate = np.sqrt(40.0 * 0.2**2 / 0.1)
    np.testing.assert_allclose(result.w[:, 0, 2], 30.0 * np.cos(rate * result.t), atol=1e-6)
    assert 0.2 * 30.0 / rate > 0.2 * 2.0 * np.pi


@pytest.mark.parametrize(("e", "h"), [(0.0, 1e-2), (0.8, 1e-2), (0.8, 1.5e-2)])
def test_a_joint_tendon_keeps_its_length_through_impacts(e, h):
    """An arm falls on a floor by stepping: the length is its angle, to the third order of a step.

    It is a state, which went on by free motion in a step with an impact, 0.034 rad, for good, and
    in one in which the arm comes to rest. Limit: (h w)^3 at the floor, w = 3 rad/s.
    """
    scene = dap.Scene(name="arm")
    scene.add_body("arm", mass=1.0, Jp=[0.02] * 3, r=[0.1, 0.0, 0.3])
    scene.add_point("hip", "ground", [0.0, 0.0, 0.3])
    scene.add_point("heel", "arm", [-0.1, 0.0, 0.0])
    scene.add_joint("rev", "pin", P_i="heel", P_j="hip", a_i="arm.y", a_j="ground.y")
    scene.add_force("joint_tendon", "line", movers=["arm"], holders=["ground"], axes=["ground.y"],
                    k=1e-6)  # fmt: skip
    scene.add_shape("sphere", body="arm", radius=0.02, at=[0.1, 0.0, 0.0], collides=True)
    scene.add_shape("plane", body="ground", at=[0.0, 0.0, 0.25], collides=True)
    scene.add_material("hard", e=e)
    scene.add_collisions(material="hard")
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=2.0, dt=1.0, contact_step=h, estimate_error=False)
    x, angle = (result.quantity(name).values[-1] for name in ("line.x", "pin.angle"))
    assert angle == pytest.approx(np.arcsin(0.03 / 0.2), rel=1e-9)
    assert abs(x - angle) < (3.0 * h) ** 3


@pytest.mark.parametrize(("contacts", "more"), [(False, ""), (True, ""), (False, "<joint/>")])
def test_a_load_hangs_at_the_limit_of_a_wrapped_tendon(tmp_path, contacts, more):
    """A slide falls until the tendon is 1.2 m: by events, by stepping, and by method joint.

    That is for a second joint, whose link has no mass. Two tangents of length t and an arc make the
    length, of points at distances l from the axis.
    """
    path = tmp_path / "a.xml"
    path.write_text(f"""<mujoco><worldbody><site name="hook" pos="-0.3 0 0.4"/>
        <geom name="post" type="cylinder" size="0.1 0.3" euler="90 0 0" contype="0"/>
        <body name="b" pos="0.5 0 0.4"><joint name="p" type="slide" axis="0 0 1"/>{more}
        <geom size="0.05"/>
        <site name="end"/></body></worldbody><tendon><spatial range="0.3 1.2"><site site="hook"/>
        <geom geom="post"/><site site="end"/></spatial></tendon></mujoco>""")
    scene, report = dap.import_model(path, contacts=contacts)
    assert not [one for one in report.left_out if one.motion]
    assert scene.simulation.method == ("joint" if more else "auto")
    b = list(scene.bodies).index("b")
    steps = {"contact_step": 2e-3} if contacts else {}
    result = dap.simulate(scene, t_end=1.0, dt=0.5, **steps)
    A, B = np.array([-0.3, 0.4]), np.array([0.5, result.r[-1, b, 2]])
    l_a, l_b = np.hypot(*A), np.hypot(*B)
    arc = np.arccos(A @ B / (l_a * l_b)) - np.arccos(0.1 / l_a) - np.arccos(0.1 / l_b)
    assert arc > 0.1
    length = np.sqrt(l_a**2 - 0.01) + np.sqrt(l_b**2 - 0.01) + 0.1 * arc
    assert length == pytest.approx(1.2, abs=1e-8)
    assert np.abs(result.rd[-1, b]).max() < 1e-8
    assert result.stats.steps < 1000  # it hangs there still
