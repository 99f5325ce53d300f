"""The disk on the ground against closed forms.
Tolerances: rtol 1e-11 over a second or two leaves some 1e-9 of the largest coordinate."""

import numpy as np
import pytest

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
MASS, RADIUS, AXIAL, ACROSS, G = 2.0, 0.5, 0.3, 0.2, 9.81


def disk(slip, *, lean=np.pi / 2, **motion):
    """A disk whose plane stands at an angle ``lean`` to the ground, its axis in the x-z plane.
    The top leans towards -x; upright it rolls along y."""
    scene = dap.Scene(name="disk")
    # eta = y is turned to (sin lean, 0, cos lean)
    turn = np.array([[0, np.sin(lean), -np.cos(lean)], [-1, 0, 0], [0, np.cos(lean), np.sin(lean)]])
    q0 = np.sqrt(1.0 + np.trace(turn)) / 2.0
    e = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    scene.add_body(
        "coin",
        mass=MASS,
        Jp=(ACROSS, AXIAL, ACROSS),
        p=(q0, *(e / (4.0 * q0))),
        **({"r": (0.0, 0.0, RADIUS * np.sin(lean))} | motion),
    )
    scene.add_joint("disk", "ground contact", body_i="coin", slip=slip, radius=RADIUS)
    scene.add_force("weight", "gravity", gravity=G)
    return scene


@pytest.mark.parametrize("lean", [0.6, 1.2])
def test_a_coin_rolls_in_a_circle(lean):
    """Steady rolling without slip: the centre goes round a circle of radius b at the rate Omega.
    Newton and Euler for the mass centre, with theta the lean, J_t and J_a the inertias across and
    along the axis: Omega^2 = m g R cos / (sin (J_t cos + (J_a / R + m R) b)), the spin about the
    axis is -Omega b / R in all."""
    b, s, c = 0.8, np.sin(lean), np.cos(lean)
    square = MASS * G * RADIUS * c / (s * (ACROSS * c + (AXIAL / RADIUS + MASS * RADIUS) * b))
    rate, eta = np.sqrt(square), np.array([s, 0.0, c])
    w = rate * np.array([0.0, 0.0, 1.0]) - rate * (b / RADIUS + c) * eta
    scene = disk("xyz", lean=lean, r=(b, 0.0, RADIUS * s), r_dot=(0.0, b * rate, 0.0), w=w)
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    angle = rate * result.t
    circle = np.stack([b * np.cos(angle), b * np.sin(angle), np.full_like(angle, RADIUS * s)], 1)
    assert result.r[:, 0] == pytest.approx(circle, abs=1e-8)
    assert result.energy.total == pytest.approx(result.energy.total[0], abs=1e-8)
    # the ground carries the weight and the centripetal force, lambda = (x, y, z)
    inward = -MASS * b * square * circle / b
    assert result.Lam[:, :2] == pytest.approx(inward[:, :2], abs=1e-7)
    assert result.Lam[:, 2] == pytest.approx(MASS * G, abs=1e-7)


def test_a_pushed_disk_rolls():
    """xyz and tz: a = F / (m + J_a / R^2) along the track; the ground brakes by J_a a / R^2."""
    for slip in ("xyz", "tz"):
        scene = disk(slip)
        scene.add_force("f", "push", body_i="coin", f=(0.0, 3.0, 0.0))
        result = dap.simulate(scene, t_end=1.0, dt=1.0, **TIGHT)
        a = 3.0 / (MASS + AXIAL / RADIUS**2)
        assert result.r[-1, 0] == pytest.approx([0.0, 0.5 * a, RADIUS], abs=1e-9)
        assert result.w[-1, 0] == pytest.approx([-a / RADIUS, 0.0, 0.0], abs=1e-9)
        force = result.reaction("ground contact")["i"].force[-1]
        assert force == pytest.approx([0.0, -AXIAL * a / RADIUS**2, MASS * G], abs=1e-8)


def test_a_disk_slides_where_it_may():
    """z and nz leave the track free: the push moves the centre alone, the spin stays as it is."""
    for slip in ("z", "nz"):
        scene = disk(slip, w=(2.0, 0.0, 0.0))
        scene.add_force("f", "push", body_i="coin", f=(0.0, 3.0, 0.0))
        result = dap.simulate(scene, t_end=1.0, dt=1.0, **TIGHT)
        assert result.r[-1, 0] == pytest.approx([0.0, 0.5 * 3.0 / MASS, RADIUS], abs=1e-9)
        assert result.w[-1, 0] == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)


def test_a_push_across_is_carried_without_lateral_slip():
    """nz: a push at the point of contact, across the track, is met by the ground and moves nothing.
    z and tz give way to it: there the disk starts with a = F / m + (F R) R / J_t."""
    for slip, moves in (("nz", False), ("z", True), ("tz", True)):
        scene = disk(slip)
        scene.add_point("low", "coin", _contact(scene))
        scene.add_force("f", "push", P_i="low", f=(1.5, 0.0, 0.0))
        result = dap.simulate(scene, t_end=0.0)
        a = result.v_dot[0][:3] + np.cross(result.v_dot[0][3:], (0.0, 0.0, -RADIUS))
        wanted = 1.5 / MASS + 1.5 * RADIUS**2 / ACROSS if moves else 0.0
        assert a == pytest.approx([wanted, 0.0, 0.0], abs=1e-12)


def _contact(scene):
    """The lowest point of the upright disk in its own axes."""
    from support.rotations import rotation

    A = rotation(np.array(scene.bodies["coin"].p))
    return A.T @ (0.0, 0.0, -RADIUS)


@pytest.mark.parametrize("slip", ["z", "nz", "tz", "xyz"])
def test_a_tumbling_disk_keeps_its_energy(slip):
    """Rows without friction do no work, whatever slips; the contact stays at height zero."""
    scene = disk(slip, lean=1.1, w=(0.3, -1.0, 2.0), r_dot=(0.4, 0.7, 0.0))
    result = dap.simulate(scene, t_end=1.0, dt=0.05, **TIGHT)
    assert result.energy.total == pytest.approx(result.energy.total[0], abs=1e-9)
    p = result.p[:, 0]
    c = 2.0 * (p[:, 2] * p[:, 3] + p[:, 0] * p[:, 1])  # z component of the body's y axis
    assert result.r[:, 0, 2] == pytest.approx(RADIUS * np.sqrt(1.0 - c * c), abs=1e-11)


def test_other_words_for_slip():
    """zn and zt are nz and tz."""
    for word, slip, rows in (("zn", "nz", 2), ("zt", "tz", 2)):
        one, other = (dap.compile(disk(w)).evaluator.model for w in (word, slip))
        assert one.row_count == rows
        assert one.joints[0].type_info.type.__name__ == other.joints[0].type_info.type.__name__


@pytest.mark.parametrize("slip", ["z", "xyz", "nz"])
def test_a_disk_that_the_ground_pulls_down_is_noted(slip):
    """A spring to a heavy body that rises at 1 m/s lifts by 10 t N: m g from t = 1.962 s on."""
    scene = disk(slip)
    del scene.forces["gravity"]
    scene.add_force("f", "load", body_i="coin", f=(0.0, 0.0, -MASS * G))
    scene.add_body("bird", mass=1e9, Jp=(1.0, 1.0, 1.0), r=(0, 0, 9.0), r_dot=(0.0, 0.0, 1.0))
    scene.add_force("ptp", "lift", P_i="coin.O", P_j="bird.O", k=10.0, l0=9.0 - RADIUS)
    result = dap.simulate(scene, t_end=3.0, dt=0.1)
    (note,) = [n for n in result.notes if "multiplier is negative" in n]
    assert note.startswith("joint ground contact (disk")
    assert "from t = 2 s on" in note  # the first report after 1.962 s
    assert f"at least {MASS * G - 30.0:.6g}, at t = 3 s" in note
    assert "the ground pulls the disk down" in note
    carried = dap.simulate(scene, t_end=1.9, dt=0.1)
    assert not any("multiplier" in n for n in carried.notes)
    swept = dap.sweep(scene, {"forces.lift.k": [1.0, 10.0]}, outputs=["coin.r.z"], t_end=3.0)
    assert ["multiplier is negative" in str(n) for n in swept["note"].values] == [False, True]
