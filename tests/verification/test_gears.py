"""Gears, racks and couples against closed forms: motion, tooth forces, loads of bearings."""

import math

import numpy as np
import pytest

import dap3d_core as dap

#: Of constraints that hold to rounding, and a motion that a run follows to its tolerance.
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
#: Reactions of scenes at rest are solutions of linear equations of numbers near one.
ROUNDING = 1e-11
J = 0.02


def wheels(**places):
    """Wheels of 1 kg, and J about z, on hinges in ground at x, y."""
    scene = dap.Scene(name="wheels")
    for name, (x, y) in places.items():
        scene.add_body(name, mass=1.0, Jp=(0.01, 0.01, J), r=(x, y, 0.0))
        hinge(scene, name, "ground", (x, y, 0.0))
    return scene


def hinge(scene, name, on, at, axis="z"):
    """A hinge of a wheel at its centre, on another body."""
    scene.add_point(f"at_{name}", on, at)
    scene.add_joint("rev", f"hinge_{name}", P_i=f"{name}.O", P_j=f"at_{name}",
                    a_i=f"{name}.{axis}", a_j=f"{on}.{axis}")  # fmt: skip


def pair(scene, one, other, name="mesh", type_="gear", **fields):
    """A joint between two wheels by their hinges."""
    scene.add_joint(type_, name, joint_i=f"hinge_{one}", joint_j=f"hinge_{other}", **fields)


def torque(scene, body, value, axis=2):
    """A constant torque about an axis of ground."""
    n = [0.0, 0.0, 0.0]
    n[axis] = value
    scene.add_force("n", f"on_{body}", body_i=body, n=n)


def turned(result, body, axis=2):
    """The speed of a body at the end."""
    return result.w[-1, result.summary.body_index[body], axis]


def load(result, joint):
    """The force on body i of a joint at the end."""
    return result.reaction(joint)["i"].force[-1]


@pytest.mark.parametrize("method", ["standard", "lsq", "joint"])
def test_an_idler_bears_twice_the_tooth_force(method):
    """3 N m on a wheel of 0.1 m, and on the last one so that nothing moves: 2 T / r."""
    scene = wheels(a=(0.0, 0.0), idler=(0.3, 0.0), c=(0.6, 0.0))
    pair(scene, "a", "idler", "ab", teeth_i=20, teeth_j=40, pressure_angle=0.0)
    pair(scene, "idler", "c", "bc", radius_i=0.2, radius_j=0.1, pressure_angle=0.0)
    torque(scene, "a", 3.0)
    torque(scene, "c", -3.0)
    result = dap.simulate(scene, t_end=0.1, dt=0.1, method=method)
    assert load(result, "hinge_a") == pytest.approx([0.0, 30.0, 0.0], abs=30.0 * ROUNDING)
    assert load(result, "hinge_idler") == pytest.approx([0.0, -60.0, 0.0], abs=60.0 * ROUNDING)
    assert abs(result.Lam[-1]).max() >= 30.0 - 1e-9


def planetary(type_="gear", **fields):
    """A sun of 20 teeth, a planet of 40 on a carrier, a ring of 100 in ground."""
    scene = wheels(sun=(0.0, 0.0), carrier=(0.0, 0.0))
    scene.add_body("planet", mass=0.4, Jp=(3e-4, 3e-4, 5e-4), r=(0.06, 0.0, 0.0))
    hinge(scene, "planet", "carrier", (0.06, 0.0, 0.0))
    pair(scene, "sun", "planet", "inner", type_, teeth_i=20, teeth_j=40, **fields)
    scene.add_joint(type_, "outer", joint_i="hinge_planet", P_j="ground.O", a_j="ground.z",
                    teeth_i=40, teeth_j=100, internal=True, **fields)  # fmt: skip
    torque(scene, "sun", 0.3)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_planetary_gear_obeys_willis_and_adds_up_inertia(method):
    """The carrier turns by z_s / (z_s + z_r) of the sun, over many turns."""
    result = dap.simulate(planetary(), t_end=10.0, dt=0.05, method=method, **TIGHT)
    sun, carrier, planet = (turned(result, b) for b in ("sun", "carrier", "planet"))
    assert carrier == pytest.approx(sun / 6.0, rel=1e-9)
    assert planet - carrier == pytest.approx(-(sun - carrier) / 2.0, rel=1e-9)
    inertia = J + (J + 0.4 * 0.06**2) / 36.0 + 5e-4 * (planet / sun) ** 2
    assert sun == pytest.approx(0.3 * 10.0 / inertia, rel=1e-8)
    angle = [result.coordinates(f"hinge_{b}").q[:, 0] for b in ("sun", "carrier")]
    assert np.abs(angle[1] - angle[0] / 6.0).max() < 1e-9 * angle[0].max()


def test_the_pin_of_a_planet_carries_both_tooth_forces():
    """Of a planet that turns no faster: both are tangential, and their sum moves the carrier."""
    scene = planetary()
    for body in ("sun", "planet"):  # nothing of the torque is spent on them
        scene.bodies[body].Jp = (1e-12, 1e-12, 2e-12)
    scene.bodies["planet"].mass = 1e-9
    result = dap.simulate(scene, t_end=1e-3, dt=1e-3, method="standard", **TIGHT)
    assert abs(load(result, "hinge_planet")[1]) == pytest.approx(2.0 * 0.3 / 0.02, rel=1e-6)


def bevel(kind="joint", **fields):
    """A wheel about x drives one about z: 15 and 30 teeth, 0.05 and 0.1 m."""
    scene = dap.Scene(name="bevel")
    for name, axis, r in (("a", "x", (0.1, 0.0, 0.0)), ("b", "z", (0.0, 0.0, 0.05))):
        scene.add_body(name, mass=1.0, Jp=(J, J, J), r=r)
        hinge(scene, name, "ground", r, axis)
        scene.add_point(f"apex_{name}", name, [-x for x in r])
    add = scene.add_joint if kind == "joint" else scene.add_force
    add("gear", "mesh", P_i="apex_a", P_j="apex_b", a_i="a.x", a_j="b.z", teeth_i=15, teeth_j=30,
        radius_i=0.05, radius_j=0.1, bevel=True, **fields)  # fmt: skip
    torque(scene, "a", 2.0, axis=0)
    return scene


def test_bevel_gears_turn_by_the_ratio_and_bear_the_tooth_force():
    """The driven wheel is accelerated by the tooth force; T / r on the bearings."""
    result = dap.simulate(bevel(pressure_angle=0.0), t_end=2.0, dt=0.02, **TIGHT)
    faster, slower = turned(result, "a", 0), turned(result, "b")
    assert slower == pytest.approx(-faster / 2.0, rel=1e-9)
    assert faster == pytest.approx(2.0 * 2.0 / (J + J / 4.0), rel=1e-8)
    tooth = J * (2.0 / (J + J / 4.0)) / 2.0 / 0.1  # what accelerates the driven wheel
    for joint in ("hinge_a", "hinge_b"):
        assert np.linalg.norm(load(result, joint)) == pytest.approx(tooth, rel=1e-8)
    # the force acts where the pitch cones touch, at x = 0.1, z = 0.05
    moment = result.reaction("mesh")["j"].moment[-1]
    force = result.reaction("mesh")["j"].force[-1]
    assert moment == pytest.approx(np.cross([0.1, 0.0, 0.0], force), abs=1e-9)


@pytest.mark.parametrize("kind", ["joint", "force"])
def test_teeth_of_bevel_gears_press_out_of_the_cone(kind):
    """F tan(20 deg) normal to the cone of atan(0.05 / 0.1): Shigley, radial and axial forces."""
    scene = bevel(kind, **({} if kind == "joint" else {"k": 1e5, "c": 100.0}))
    torque(scene, "b", 4.0)
    result = dap.simulate(scene, t_end=1.0, dt=1.0, **TIGHT)
    apart, cone = 40.0 * math.tan(math.radians(20.0)), math.atan(0.5)
    wanted = [-apart * math.sin(cone), -40.0, apart * math.cos(cone)]
    assert load(result, "hinge_a") == pytest.approx(wanted, abs=1e-7)
    assert load(result, "hinge_b") == pytest.approx([-x for x in wanted], abs=1e-7)
    action = (result.reaction("mesh") if kind == "joint" else result.force("mesh").on)["i"]
    arm = np.array([0.0, 0.0, 0.05])  # from the mass centre to where the cones touch
    assert action.moment[-1] == pytest.approx(np.cross(arm, action.force[-1]), abs=1e-7)
    if kind == "force":  # the wheels give way by F / k along the tangent
        a, b = (result.coordinates(f"hinge_{w}").q[-1, 0] for w in "ab")
        assert 0.05 * a + 0.1 * b == pytest.approx(40.0 / 1e5, rel=1e-6)


@pytest.mark.parametrize("method", ["standard", "lsq", "joint"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pressure_angle_presses_rigid_wheels_apart(method, sign):
    """30 N at 20 deg, whichever flank is in touch; helical teeth have tan(20 deg) / cos(0.4)."""
    for helix in (0.0, 0.4):
        scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
        pair(scene, "a", "b", teeth_i=20, teeth_j=40, helix=helix)
        torque(scene, "a", 3.0 * sign)
        torque(scene, "b", 6.0 * sign)
        result = dap.simulate(scene, t_end=0.1, dt=0.1, method=method)
        apart = 30.0 * math.tan(math.radians(20.0)) / math.cos(helix)
        for wheel, side in (("a", 1.0), ("b", -1.0)):  # what the hinges do to the wheels
            x, y, _ = load(result, f"hinge_{wheel}")
            assert (x, y) == pytest.approx((side * apart, side * sign * 30.0), abs=1e-9)
        x, y, _ = load(result, "mesh")
        assert (x, y) == pytest.approx((-apart, -sign * 30.0), abs=1e-9)


def test_a_pressure_angle_presses_a_wheel_in_a_ring_inwards():
    """A wheel of 0.1 m in a ring of 0.3 m, held by a torque of 2 N m: 20 N tan(25 deg)."""
    scene = wheels(a=(0.2, 0.0), ring=(0.0, 0.0))
    pair(scene, "a", "ring", teeth_i=20, teeth_j=60, internal=True, pressure_angle="25 deg")
    torque(scene, "a", 2.0)
    torque(scene, "ring", -6.0)
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    x, y, _ = load(result, "hinge_a")  # the ring presses the wheel to -x, and its hinge back
    assert (x, abs(y)) == pytest.approx((20.0 * math.tan(math.radians(25.0)), 20.0), abs=1e-9)


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_rubbing_bearings_carry_the_whole_tooth_force(method):
    """With F along the tangent both bearings carry F / cos(20 deg), and brake by mu r of it.
    Far beyond v_tol: T - r_a F - mu r F / cos = J alpha, r_b F - mu r F / cos = J alpha / 2."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", teeth_i=20, teeth_j=40)
    torque(scene, "a", 5.0)
    for name in "ab":
        scene.add_force("friction", f"rub_{name}", joint=f"hinge_{name}", mu=0.3, radius=0.02,
                        v_tol=1e-3)  # fmt: skip
    result = dap.simulate(scene, method=method, t_end=0.2, dt=0.1, **TIGHT)
    brake = 0.3 * 0.02 / math.cos(math.radians(20.0))
    alpha, F = np.linalg.solve([[J, 0.1 + brake], [J / 2, brake - 0.2]], [5.0, 0.0])
    assert result.wd[-1, :, 2] == pytest.approx([alpha, -alpha / 2], rel=1e-9)
    assert load(result, "mesh")[1] == pytest.approx(-F, rel=1e-9)
    assert not any("did not settle" in note for note in result.notes)


def held():
    """Two wheels, one of them held by a spring, the other under 3 N m."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", teeth_i=20, teeth_j=40)
    scene.add_force("rot_sda", "spring", joint="hinge_b", k=1e3, c=10.0)
    torque(scene, "a", 3.0)
    return scene


def test_statics_and_inverse_dynamics_know_the_pressure_angle():
    """30 N and 30 N tan(20 deg) on the hinge: at rest, and where a driver holds the wheels."""
    wanted = [30.0 * math.tan(math.radians(20.0)), 30.0]
    rest = dap.equilibrium(held())
    x, y, _ = rest.reaction("hinge_a")["i"].force
    assert (x, abs(y)) == pytest.approx(wanted, abs=1e-6)
    scene = held()
    del scene.forces["spring"]
    scene.add_joint("motor", "drive", joint="hinge_b", position=0.0)
    run = dap.simulate(scene, t_end=0.1, dt=0.1)
    for result in (run, dap.inverse(scene, run)):
        x, y, _ = load(result, "hinge_a")
        assert (x, abs(y)) == pytest.approx(wanted, abs=1e-9)
    assert result.quantity("drive.actuation").values == pytest.approx([6.0, 6.0])


def test_wheels_on_springs_are_refused_by_statics():
    """The pressure angle would move them apart; the elastic mesh knows how."""
    scene = held()
    del scene.joints["hinge_b"], scene.forces["spring"]
    scene.add_force("bushing", "spring", P_i="b.O", P_j="at_b", k=[1e5] * 6)
    mesh = scene.joints["mesh"].fields
    del mesh["joint_j"]
    mesh |= {"P_j": "b.O", "a_j": "b.z"}
    with pytest.raises(dap.SimulationError, match=r"mesh\.pressure_angle .* press apart"):
        dap.equilibrium(scene)


def test_redundant_planets_share_their_load_evenly():
    """Four planets, three rows too many: Willis for a held ring, no load of the sun's bearing."""
    scene = wheels(sun=(0.0, 0.0), carrier=(0.0, 0.0))
    for k in range(4):
        at, planet = (
            (0.06 * math.cos(k * math.pi / 2.0), 0.06 * math.sin(k * math.pi / 2.0)),
            f"p{k}",
        )
        scene.add_body(planet, mass=0.4, Jp=(3e-4, 3e-4, 5e-4), r=(*at, 0.0))
        hinge(scene, planet, "carrier", (*at, 0.0))
        pair(scene, "sun", planet, f"inner{k}", teeth_i=20, teeth_j=40)
        scene.add_joint("gear", f"outer{k}", joint_i=f"hinge_{planet}", P_j="ground.O",
                        a_j="ground.z", teeth_i=40, teeth_j=100, internal=True)  # fmt: skip
    torque(scene, "sun", 0.3)
    result = dap.simulate(scene, t_end=0.5, dt=0.5, **TIGHT)
    assert turned(result, "carrier") == pytest.approx(turned(result, "sun") / 6.0, rel=1e-9)
    assert load(result, "hinge_sun") == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    sizes = [np.linalg.norm(load(result, f"hinge_p{k}")) for k in range(4)]
    assert sizes == pytest.approx([sizes[0]] * 4, rel=1e-9)


def test_a_pressure_angle_is_varied_and_left_out_beside_contacts():
    """30 N tan of it at each point of a sweep; a note where contacts leave it out."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", teeth_i=20, teeth_j=40)
    torque(scene, "a", 3.0)
    torque(scene, "b", 6.0)
    angles = [0.0, 0.2, 0.4]
    found = dap.sweep(scene, {"joints.mesh.pressure_angle": angles},
                      outputs="hinge_a.i.force.x", t_end=0.1, dt=0.1)  # fmt: skip
    wanted = 30.0 * np.tan(angles)
    assert found["hinge_a.i.force.x"].values == pytest.approx(wanted, abs=1e-9)
    scene.add_shape("sphere", "tip", body="a", radius=0.01, collides=True)
    notes = dap.compile(scene).notes
    assert any("joints.mesh.pressure_angle is left out beside contacts" in note for note in notes)


def test_helical_teeth_push_along_the_axis():
    """By tan(helix) of the tangential force, on both wheels."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", teeth_i=20, teeth_j=40, helix=0.4, pressure_angle=0.0)
    torque(scene, "a", 3.0)
    torque(scene, "b", 6.0)
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    x, y, z = load(result, "hinge_a")
    assert [abs(v) for v in (x, y, z)] == pytest.approx([0.0, 30.0, 30.0 * math.tan(0.4)], abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_pinion_drives_a_rack(side, method):
    """(m + J / r^2) a = T / r; the rack on either side; the bearing carries what moves it."""
    scene, r, m = wheels(pinion=(0.0, 0.0)), 0.05, 3.0
    scene.add_body("rack", mass=m, Jp=(0.1, 0.1, 0.1), r=(0.2, -side * r, 0.0))
    scene.add_point("rail", "ground", (0.0, -side * r, 0.0))
    scene.add_joint("tran", "slide", P_i="rack.O", P_j="rail", a_j="ground.x")
    scene.add_joint("rack", "teeth", joint_i="hinge_pinion", P_j="rack.O", a_j="rack.x", radius=r)
    torque(scene, "pinion", 1.5)
    result = dap.simulate(scene, t_end=2.0, dt=0.01, method=method, **TIGHT)
    a = 1.5 / r / (m + J / r**2)
    index = result.summary.body_index["rack"]
    assert result.rd[-1, index, 0] == pytest.approx(side * a * 2.0, rel=1e-9)
    assert result.r[-1, index, 0] == pytest.approx(0.2 + side * a * 2.0, rel=1e-9)
    assert load(result, "hinge_pinion") == pytest.approx([side * m * a, 0.0, 0.0], abs=1e-8)
    assert turned(result, "pinion") == pytest.approx(a * 2.0 / r, rel=1e-9)


def test_a_rack_level_with_the_axis_is_on_no_side():
    """Its direction of motion would be a guess."""
    scene = wheels(pinion=(0.0, 0.0))
    scene.add_joint("rack", "teeth", joint_i="hinge_pinion", P_j="ground.O", a_j="ground.x",
                    radius=0.05)  # fmt: skip
    with pytest.raises(dap.SceneError, match="on which side the rack lies"):
        dap.simulate(scene, t_end=0.1)


def test_couples_turn_by_the_same_ratio_without_a_tooth_force():
    """The idler bears nothing of 2 T / r."""
    scene = wheels(a=(0.0, 0.0), idler=(0.3, 0.0), c=(0.6, 0.0))
    scene.add_joint("couple", "ab", a_i="a.z", a_j="idler.z", teeth_i=20, teeth_j=40)
    scene.add_joint("couple", "bc", a_i="idler.z", a_j="c.z", teeth_i=40, teeth_j=20)
    torque(scene, "a", 3.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    assert turned(result, "c") == pytest.approx(turned(result, "a"), rel=1e-9)
    assert turned(result, "idler") == pytest.approx(-turned(result, "a") / 2.0, rel=1e-9)
    assert np.abs(load(result, "hinge_idler")).max() < 1e-9


@pytest.mark.parametrize("internal", [False, True])
def test_an_elastic_mesh_rests_where_the_torque_is_held(internal):
    """T / r^2 / k of a turn, all parts of the tooth force on the bearing; damped to rest."""
    place = (0.1, 0.0) if internal else (0.3, 0.0)
    scene = wheels(a=(0.0, 0.0))
    fields = {"P_j": "centre", "a_j": "ground.z", "teeth_j": 40}
    scene.add_point("centre", "ground", (*place, 0.0))
    scene.add_force("gear", "mesh", joint_i="hinge_a", teeth_i=20, k=1e5, c=200.0, helix=0.3,
                    internal=internal, **fields)  # fmt: skip
    torque(scene, "a", 3.0)
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    r, tangent = 0.1, 30.0
    assert result.coordinates("hinge_a").q[-1, 0] == pytest.approx(3.0 / r**2 / 1e5, rel=1e-7)
    radial = tangent * math.tan(math.radians(20.0)) / math.cos(0.3)
    x, y, z = load(result, "hinge_a")
    assert abs(y) == pytest.approx(tangent, rel=1e-7)
    assert x == pytest.approx(-radial if internal else radial, rel=1e-7)
    assert abs(z) == pytest.approx(tangent * math.tan(0.3), rel=1e-7)


def test_backlash_is_crossed_freely():
    """A wheel set free in the middle of its play touches after sqrt(b J / (T r)) seconds."""
    scene = wheels(a=(0.0, 0.0))
    scene.add_point("centre", "ground", (0.3, 0.0, 0.0))
    scene.add_force("gear", "mesh", joint_i="hinge_a", P_j="centre", a_j="ground.z", teeth_i=20,
                    teeth_j=40, k=1e6, backlash=2e-3)  # fmt: skip
    torque(scene, "a", 3.0)
    result = dap.simulate(scene, t_end=0.2, dt=1e-3, **TIGHT)
    touch = math.sqrt(2e-3 * J / (3.0 * 0.1))
    w, t = result.w[:, 0, 2], result.t
    free = t < touch
    assert np.abs(w[free] - 3.0 / J * t[free]).max() < 1e-9
    assert np.abs(w[~free][3:] - 3.0 / J * t[~free][3:]).min() > 1e-2


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"teeth_i": 20}, "one wheel has a size, the other none"),
        ({"teeth_i": 20, "teeth_j": 20, "internal": True}, "not of the same size"),
        ({"radius_i": 0.1, "radius_j": 0.1, "bevel": True, "teeth_i": 3}, "one wheel has"),
    ],
)
def test_a_pair_of_no_size_is_refused(fields, words):
    """With what to give."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", **fields)
    with pytest.raises(dap.SceneError, match=words):
        dap.simulate(scene, t_end=0.1)


def test_wheels_that_do_not_meet_are_noted():
    """Radii of 0.1 m each, axes 0.3 m apart."""
    scene = wheels(a=(0.0, 0.0), b=(0.3, 0.0))
    pair(scene, "a", "b", radius_i=0.1, radius_j=0.1)
    notes = dap.simulate(scene, t_end=0.02).notes
    assert any("0.3 m apart" in note for note in notes)
    del scene.joints["mesh"].fields["radius_i"], scene.joints["mesh"].fields["radius_j"]
    notes = dap.simulate(scene, t_end=0.02).notes
    assert any("taken to be of one size" in note for note in notes)
