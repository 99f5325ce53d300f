"""Contacts by stepping: what is exact is so to rounding, the rest has the order of the step."""

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81


def collide(scene, **material):
    """Let the shapes of a scene that collide meet, under gravity."""
    scene.add_material("surface", **material)
    scene.add_collisions(material="surface")
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_force("weight", "gravity")
    return scene


def ball(height=0.0, v=3.0, **material):
    """A solid ball of 0.1 m on or above a floor."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0.0, 0.0, 0.1 + height], r_dot=[v, 0, 0])
    scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
    return collide(scene, **material)


def declared_ball(height=0.0, v=3.0, **contact):
    """The same ball by a declared contact."""
    scene = dap.Scene(name="declared")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0.0, 0.0, 0.1 + height], r_dot=[v, 0, 0])
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, **contact)
    scene.add_force("weight", "gravity")
    return scene


def slope():
    """A box on a slope of 0.35 rad, within its cone of mu = 0.5."""
    angle, scene = 0.35, dap.Scene(name="slope")
    n = [-np.sin(angle), 0.0, np.cos(angle)]
    p = [np.cos(0.5 * angle), 0.0, -np.sin(0.5 * angle), 0.0]
    scene.add_body("box", mass=2.0, Jp=[0.01] * 3, r=[0.1 * x for x in n], p=p)
    scene.add_shape("box", body="box", size=[0.3, 0.3, 0.2], collides=True)
    scene.add_shape("plane", body="ground", normal=n, collides=True)
    scene.add_material("surface", mu=0.5)
    scene.add_collisions(material="surface")
    scene.add_force("weight", "gravity")
    return scene


def tower():
    """Nineteen boxes of 1 kg under one of 1000 kg."""
    scene = dap.Scene(name="tower")
    for k, mass in enumerate([1.0] * 19 + [1000.0]):
        Jp, r = [mass / 600.0] * 3, [0.0, 0.0, 0.05 + 0.1 * k]
        scene.add_body(f"box{k}", mass=mass, Jp=Jp, r=r)
        scene.add_shape("box", body=f"box{k}", size=[0.1] * 3, collides=True)
    return collide(scene, mu=0.5)


def test_a_box_inside_its_cone_does_not_creep():
    """2 s; limit: rounding of its place. 60 s: benchmarks/collisions.py."""
    result = dap.simulate(slope(), t_end=2.0, dt=1.0, contact_step=5e-3)
    assert np.abs(result.r - result.r[0]).max() < 1e-14
    assert any("by stepping" in note and "2 shapes" in note for note in result.notes)


def test_a_tower_carries_a_load_a_thousand_times_its_own():
    """What they move and overlap by, in 0.1 s; 10 s: benchmarks/collisions.py."""
    result = dap.simulate(tower(), t_end=0.1, dt=0.1, contact_step=5e-3)
    assert np.abs(result.r - result.r[0]).max() < 1e-8
    z = result.r[-1, :, 2]
    assert min(z[0] - 0.05, (np.diff(z) - 0.1).min()) > -1e-10


@pytest.mark.parametrize("declared", [False, True])
def test_a_ball_that_slides_then_rolls_has_the_second_order(declared):
    """Slip that ends unseen within a step costs less than mu G h^2; first order h v0 / 7."""
    scene, v0, mu = ball(mu=0.3), 3.0, 0.3
    if declared:
        scene = declared_ball(mu=mu)
    end = 2.0 / 7.0 * v0 / (mu * G)
    exact = v0 * end - 0.5 * mu * G * end**2 + 5.0 / 7.0 * v0 * (1.0 - end)
    for h in (8e-3, 2e-3):
        result = dap.simulate(scene, t_end=1.0, dt=0.5, contact="stepping", contact_step=h)
        assert abs(result.r[-1, 0, 0] - exact) < mu * G * h**2
        assert result.rd[-1, 0, 0] == pytest.approx(5.0 / 7.0 * v0, abs=1e-11)
    took = -result.record.stepping["friction_work"]
    assert took == pytest.approx(2.0 * v0**2 / 7.0, rel=1e-6)  # what is lost


def on_slab(shape, Jp, angle, mu, **fields):
    """A shape of 2 kg, whose centre is 0.1 m above the face of a slanted box of ground."""
    scene, n = dap.Scene(name="slab"), np.array([np.sin(angle), 0.0, np.cos(angle)])
    p = [np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0]
    scene.add_body("body", mass=2.0, Jp=Jp, r=0.1 * n, p=p)
    scene.add_shape(shape, body="body", collides=True, **fields)
    scene.add_shape("box", body="ground", size=[40, 4, 1], at=-0.5 * n, p=p, collides=True)
    scene.add_material("surface", mu=mu)
    scene.add_collisions(material="surface")
    scene.add_force("weight", "gravity")
    return scene, np.array([np.cos(angle), 0.0, -np.sin(angle)])


def test_a_cylinder_rolls_down_a_box():
    """Along its side, without slip: two thirds of g sin a."""
    scene, down = on_slab("cylinder", [0.03, 0.01, 0.03], 0.3, 0.5,
                          radius=0.1, length=0.4, axis=[0, 1, 0])  # fmt: skip
    result = dap.simulate(scene, t_end=0.3, dt=0.3, contact_step=5e-3)
    assert down @ result.rd[-1, 0] == pytest.approx(2 / 3 * G * np.sin(0.3) * 0.3, rel=1e-13)
    assert len(result.contacts) == 4  # at both reports the ends of the line along which it touches


def test_a_cylinder_that_stands_on_a_slanted_box_stays():
    scene, _ = on_slab("cylinder", [0.03, 0.03, 0.04], 0.3, 0.5, radius=0.2, length=0.2)
    result = dap.simulate(scene, t_end=0.5, dt=0.5, contact_step=5e-3)
    assert np.abs(result.r - result.r[0]).max() < 1e-14


def test_a_ball_rolls_over_the_seams_of_a_height_field():
    """5/7 g sin a, as on a plane, less what seams cost, which are edges: of the order of h."""
    scene, slope = dap.Scene(name="field"), 0.3
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    scene.add_body(
        "ball", mass=2.0, Jp=[0.008] * 3, r=[0.1 * np.sin(slope), 0, 0.1 * np.cos(slope)]
    )
    scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
    heights = [[-np.tan(slope) * x] * 9 for x in np.linspace(-1.0, 1.0, 21)]
    scene.add_shape("height_field", "land", body="ground", heights=heights, size=[2.0, 0.83],
                    collides=True)  # fmt: skip
    scene.add_material("surface", mu=0.5)
    scene.add_collisions(material="surface")
    scene.add_force("weight", "gravity")
    h = 2e-3
    result = dap.simulate(scene, t_end=0.5, dt=0.25, contact_step=h)
    assert down @ result.rd[-1, 0] == pytest.approx(5 / 7 * G * np.sin(slope) * 0.5, rel=h)
    assert {result.contacts.names[k] for k in result.contacts.pair.ravel()} == {"sphere1", "land"}


def test_forces_and_modes_of_declared_contacts_are_those_of_the_step():
    """The ball of before slides for 2 v0 / (7 mu G), then rolls without friction."""
    mu = 0.3
    result = dap.simulate(
        declared_ball(mu=mu), t_end=0.4, dt=0.1, contact="stepping", contact_step=2e-3
    )
    floor = result.contact("floor")
    assert floor.mode.tolist() == [1, 1, 1, 2, 2]  # to 0.291 s
    assert floor.normal_force == pytest.approx(2.0 * G, rel=1e-12)
    slides, rolls = floor.friction[:3, 0], floor.friction[3:, 0]
    assert slides == pytest.approx(-mu * 2.0 * G, rel=1e-12)
    assert rolls == pytest.approx(0.0, abs=1e-9)


def test_the_first_report_has_the_forces_of_the_first_step():
    """Of what rests on a slope, slides, or is far away."""
    rests = dap.simulate(slope(), t_end=5e-3, dt=5e-3, contact_step=5e-3)
    table = rests.contacts
    assert table.force[table.t == 0.0].sum(0) == pytest.approx([0, 0, 2 * G], rel=1e-12, abs=1e-11)
    slides = dap.simulate(ball(mu=0.3), t_end=5e-3, dt=5e-3, contact_step=5e-3)
    assert slides.contacts.force[0] == pytest.approx([-0.6 * G, 0, 2 * G], rel=1e-12, abs=1e-11)
    assert slides.rdd[0, 0] == pytest.approx([-0.3 * G, 0.0, 0.0], rel=1e-12, abs=1e-11)
    apart = dap.simulate(ball(0.1), t_end=5e-3, dt=5e-3, contact_step=5e-3)
    assert len(apart.contacts) == 0
    assert apart.rdd[0, 0] == pytest.approx([0.0, 0.0, -G], rel=1e-12)


def test_a_small_box_that_tumbles_bounces_as_a_large_one():
    """Lengths and gravity are times the size, moments times its square: times stay."""
    found, size = [], 1e-3
    for L in (1.0, size):
        scene = dap.Scene(name="box")
        J = [2.0 * L**2 * k for k in (0.02, 0.03, 0.025)]
        start = {"r": [0.0, 0.0, 0.5 * L], "rpy": [0.3, 0.2, 0.1], "w": [1.0, 2.0, 3.0]}
        scene.add_body("box", mass=2.0, Jp=J, r_dot=[L, 0.0, 0.0], **start)
        scene.add_shape("box", body="box", size=[0.4 * L, 0.3 * L, 0.2 * L], collides=True)
        collide(scene, mu=0.4, e=0.4).forces["gravity"].fields["gravity"] = G * L
        found.append(dap.simulate(scene, t_end=0.4, dt=0.1, contact_step=1e-3))
    large, small = found
    assert small.r / size == pytest.approx(large.r, abs=1e-11)
    assert small.w == pytest.approx(large.w, abs=1e-9)
    assert small.ledger["energy"].ok


def test_a_declared_pair_of_boxes_touches_on_their_faces_alone():
    """One slides on a longer one to rest, v^2 / (2 mu g) on, with edges and corners far beyond."""
    scene, mu, v = dap.Scene(name="plank"), 0.3, 0.8
    scene.add_body("box", mass=2.0, Jp=[0.02] * 3, r=[0.0, 0.0, 0.25], r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "gravity")
    ends = {"P_i": "box.O", "size_i": [0.4] * 3, "P_j": "ground.O", "size_j": [20.0, 2.0, 0.1]}
    scene.add_contact("box_box", "plank", **ends, mu=mu)
    result = dap.simulate(scene, t_end=0.4, dt=0.1, contact="stepping", contact_step=2e-3)
    stops = [v**2 / (2.0 * mu * G), 0.0, 0.25]
    assert result.r[-1, 0] == pytest.approx(stops, abs=1e-6)  # h^2 and its place in a step
    assert not any("overlap" in note and "start" in note for note in result.notes)


def test_a_declared_column_that_spins_stands_on_its_rim_alone():
    """The moment of friction is mu m g R: it stops at t = R w / (2 mu g), after w t / 2."""
    scene, mu, w, R = dap.Scene(name="column"), 0.5, 5.0, 0.2
    scene.add_body("column", mass=3.0, Jp=[0.1, 0.1, 0.06], r=[0.0, 0.0, 0.25], w=[0.0, 0.0, w])
    scene.add_force("weight", "gravity")
    shape = {"P_i": "column.O", "a_i": "column.z", "radius": R, "length": 0.5}
    scene.add_contact("cylinder_plane", "floor", **shape, mu=mu)
    result = dap.simulate(scene, t_end=0.2, dt=0.1, contact="stepping", contact_step=2e-3)
    turned = 2.0 * np.arctan2(result.p[-1, 0, 3], result.p[-1, 0, 0])
    assert turned == pytest.approx(R * w**2 / (4.0 * mu * G), rel=1e-4)  # h^2 of 0.1 s


def test_what_rests_on_a_slope_has_no_work_of_friction():
    """Limit: rounding of what friction would take at the speed of one step of falling, 0.01 J."""
    result = dap.simulate(slope(), t_end=2.0, dt=1.0, contact_step=5e-3)
    assert abs(result.record.stepping["friction_work"]) < 1e-12
    assert all(entry.ok for entry in result.ledger.values())


def test_stepping_tends_to_events():
    """A ball dropped onto a floor, e = 0: it differs by less than what it falls in a step."""
    exact = dap.simulate(declared_ball(0.2, 1.0, mu=0.3), t_end=0.5, dt=0.5, contact="events").r[
        -1, 0
    ]
    for h in (8e-3, 2e-3):
        found = dap.simulate(ball(0.2, 1.0, mu=0.3), t_end=0.5, dt=0.5, contact_step=h).r[-1, 0]
        assert np.abs(found - exact).max() < G * h**2


@pytest.mark.every(3)
@pytest.mark.parametrize("what", ["bounces", "slides", "rolls"])
def test_stepping_extrapolates_to_events(what):
    """Steps of h, h/2, h/4 differ from events by the order of h; their limit by less than 1e-6.

    The box falls on four corners for 0.2 s and bounces by e = 0.5, so that impacts are at ends of
    steps of all lengths; friction that stops it, or lets the ball roll, ends within a step.
    """
    if what == "rolls":
        scene = declared_ball(mu=0.3)
    else:
        scene = dap.Scene(name=what)
        scene.add_force("weight", "gravity")
        z, e, v = (0.5 * G * 0.2**2, 0.5, [0.7, 0, 0]) if what == "bounces" else (0, 0, [1, 0.5, 0])
        scene.add_body("body", mass=2.0, Jp=[0.02] * 3, r=[0, 0, 0.1 + z], r_dot=v)
        mu = 0.0 if what == "bounces" else 0.3
        scene.add_contact("box_plane", P_i="body.O", size=[0.4, 0.4, 0.2], mu=mu, e=e)
    events = dap.simulate(scene, t_end=0.5, dt=0.5, contact="events", rtol=1e-10).r[-1, 0]
    steps = (4e-3, 2e-3, 1e-3)
    given = {"t_end": 0.5, "dt": 0.5, "contact": "stepping"}
    first, second, third = (
        dap.simulate(scene, contact_step=h, **given).r[-1, 0] - events for h in steps
    )
    assert (
        max(np.abs(error).max() / h for error, h in zip((first, third), steps[::2], strict=True))
        < 4
    )
    assert np.abs((8.0 * third - 6.0 * second + first) / 3.0).max() < 1e-6


def test_joints_hold_while_shapes_touch():
    """A pendulum that falls onto a floor stays on its joint, and rests on the floor."""
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", mass=1.0, Jp=[0.01] * 3, r=[1.0, 0.0, 0.5])
    scene.add_point("A", "ground", [0.0, 0.0, 0.5])
    scene.add_point("B", "bob", [-1.0, 0.0, 0.0])
    scene.add_joint("sph", "J", P_i="B", P_j="A")
    scene.add_shape("sphere", body="bob", radius=0.1, collides=True)
    result = dap.simulate(collide(scene.copy(), mu=0.5), t_end=1.5, dt=0.5, contact_step=4e-3)
    assert result.r[-1, 0, 2] == pytest.approx(0.1, abs=1e-9)
    assert np.linalg.norm(result.r[-1, 0] - [0.0, 0.0, 0.5]) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(result.rd[-1]).max() < 1e-5  # it comes to rest step by step
    smooth = dap.simulate(collide(scene.copy(), mu=0.0), t_end=1.5, dt=0.5, contact_step=4e-3)
    # The floor under its centre carries all its weight.
    assert np.abs(smooth.reaction("J")["i"].force[-1]).max() < 1e-3


def leg(**limits):
    """A trunk on a link of a thousandth of its foot, which lands beside its centre."""
    scene = dap.Scene(name="leg")
    for name, mass, z in (("trunk", 8.0, 0.51), ("link", 1e-3, 0.11), ("foot", 1.0, 0.07)):
        Jp = [2e-3 * mass] * 3
        scene.add_body(name, mass=mass, Jp=Jp, r=[0.0, 0.0, z], r_dot=[0.0, 0.0, -2.0])
    at = [0.1, 0.03, -0.03]
    scene.add_shape("sphere", body="foot", radius=0.03, at=at, collides=True)
    for i, j, axis, length in (("link", "trunk", "x", 0.4), ("foot", "link", "y", 0.04)):
        scene.add_point(f"of_{i}", j, [0.0, 0.0, -length])
        scene.add_joint("rev", f"at_{i}", P_i=f"{i}.O", P_j=f"of_{i}", a_i=f"{i}.{axis}",
                        a_j=f"{j}.{axis}", **limits)  # fmt: skip
    return collide(scene, mu=1.0)


def test_limits_that_are_far_away_change_nothing():
    """Beside them the joints' rows are solved by another method, to the residual of a step.

    That of nothing but rounding is none, as before the foot lands: by impulses of it alone the
    residual was 1, and 1e-6 came of it.
    """
    settings = {"t_end": 0.05, "dt": 0.01, "contact_step": 1e-3}
    free, limited = (
        dap.simulate(leg(**limits), **settings) for limits in ({}, {"lower": -3.0, "upper": 3.0})
    )
    assert np.abs(free.w[-1]).max() > 1.0  # it has landed, and turns
    assert (free.method, limited.method) == ("standard", "lsq")
    assert max(run.record.stepping["largest_residual"] for run in (free, limited)) < 1e-12
    assert limited.u == pytest.approx(free.u, rel=0, abs=1e-9)


def test_stiff_dampers_do_not_explode():
    """A damper of 1e4 N s/m stops 1 kg within 0.1 ms, a tenth of a step, after v m / c."""
    scene, c = dap.Scene(name="damped"), 1e4
    scene.add_body("block", mass=1.0, Jp=[0.1] * 3, r=[0.0, 0.0, 1.0], r_dot=[1.0, 0.0, 0.0])
    scene.add_shape("sphere", body="block", radius=0.1, collides=True)
    scene.add_point("wall", "ground", [10.0, 0.0, 1.0])
    scene.add_joint("tran", "rail", P_i="block.O", P_j="wall", a_j="ground.x")
    scene.add_force("ptp", "damper", P_i="block.O", P_j="wall", c=c)
    result = dap.simulate(collide(scene, mu=0.1), t_end=0.02, dt=0.01, contact_step=1e-3)
    assert result.r[-1, 0, 0] == pytest.approx(1.0 / c, rel=1e-3)  # parts are second order
    assert abs(result.rd[-1, 0, 0]) < 1e-12


def test_guided_fingers_lift_a_box():
    """Four corners on each side, more impulses than there are equations: none may be left over."""
    scene, press = dap.Scene(name="lift"), 20.0  # N
    scene.add_body("box", mass=1.0, Jp=[2e-3] * 3, r=[0.0, 0.0, 0.05])
    scene.add_shape("box", "box", body="box", size=[0.1] * 3, collides=True)
    scene.add_body("hand", mass=1.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.3])
    scene.add_point("rail", "hand", [0.0, 0.0, -0.25])
    scene.add_joint("tran", "lift", P_i="hand.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("b", "rise", x_start=0.02, x_end=0.2, f_start=0.3, f_end=0.32)
    scene.add_joint("drive-tran", joint="lift", function="rise")
    for name, side in (("left", -1.0), ("right", 1.0)):
        scene.add_body(name, mass=0.1, Jp=[1e-4] * 3, r=[0.06 * side, 0.0, 0.05])
        scene.add_shape("box", name, body=name, size=[0.02, 0.04, 0.06], collides=True)
        scene.add_joint("tran", f"slide_{name}", P_i=f"{name}.O", P_j="rail", a_j="hand.x")
        scene.add_force("fp", f"press_{name}", P_i=f"{name}.O", fp=[-press * side, 0.0, 0.0])
    result = dap.simulate(collide(scene, mu=0.6), t_end=0.24, dt=0.12, contact_step=2e-3)
    held = result.contacts.of("box").at(result.t[-1:]).force
    assert abs(held[:, 2].sum() - G) < 1e-6
    assert abs(result.r[-1, 0, 2] - 0.07) < 1e-6
    assert not [note for note in result.notes if "not to be trusted" in note]


def test_an_overlap_at_the_start_is_told():
    told = dap.simulate(ball(-0.02, mu=0.3), t_end=0.01, contact_step=1e-3).notes
    (note,) = (note for note in told if "at the start" in note)
    assert "overlapped by 0.02 m at the start, most of all shapes " in note
    assert note.severity == "warning"


def test_points_of_a_sweep_are_runs_by_stepping():
    """Each is the run of the changed scene, but for where steps end at reports, to rounding."""
    scene, name = ball(0.2, mu=0.3), "materials.surface.mu"
    given = {"t_end": 0.4, "dt": 0.1, "contact_step": 4e-3}
    swept = dap.sweep(scene, {name: [0.1, 0.3]}, outputs=["ball.r.x"], **given)["ball.r.x"].values
    runs = (dap.simulate(ball(0.2, mu=mu), **given) for mu in (0.1, 0.3))
    assert swept == pytest.approx([run.r[-1, 0, 0] for run in runs], rel=1e-14)


def test_events_refuse_shapes_that_collide():
    with pytest.raises(dap.SceneError, match="followed by stepping"):
        dap.simulate(ball(mu=0.3), t_end=0.1, contact="events")
    with pytest.raises(dap.SimulationError, match="shapes that collide"):
        dap.equilibrium(ball(mu=0.3))


def test_the_ledger_has_the_work_of_a_driver_on_what_it_lifts():
    """A lift takes a load of 2 kg and its own 1 kg up by 0.1 m, from rest to rest."""
    scene = dap.Scene(name="lift")
    scene.add_body("lift", mass=1.0, Jp=[0.1] * 3)
    scene.add_body("load", mass=2.0, Jp=[0.1] * 3, r=[0, 0, 0.1])
    scene.add_joint("tran", "shaft", P_i="lift.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("b", "up", x_start=0.0, x_end=0.4, f_start=0.0, f_end=0.1)
    scene.add_joint("drive-tran", joint="shaft", function="up")
    scene.add_shape("plane", body="lift", collides=True)
    scene.add_shape("sphere", body="load", radius=0.1, collides=True)
    scene.add_force("weight", "gravity")
    lifted = dap.simulate(scene, t_end=0.4, dt=0.4, contact_step=5e-3, contact="stepping")
    assert lifted.energy.total[-1] - lifted.energy.total[0] == pytest.approx(0.1 * 3 * 9.81, 1e-4)
    assert lifted.ledger["energy"].value < 1e-4


def test_small_problems_have_the_results_of_sparse_matrices(monkeypatch):
    """Dense arrays take the place of sparse ones up to a size, to rounding of the solves."""
    given = {"t_end": 0.4, "dt": 0.1, "contact_step": 4e-3}
    dense = dap.simulate(ball(0.2, mu=0.3), **given)
    monkeypatch.setattr("dap3d_core.integrators.moreau.arrays.DENSE_SIZE", 0)
    assert dap.simulate(ball(0.2, mu=0.3), **given).u == pytest.approx(dense.u, abs=1e-11)


def test_what_a_motor_presses_against_a_wall_does_not_creep():
    """A finger whose motor would turn it by 14 rad/s in a step holds a ball: it stays in place.

    Rows of the hinge are met where the finger is, not where it would be without the ball: that
    crept by 1 cm/s. What is left is rounding, some ulp of 0.1 m in each of 375 steps.
    """
    scene = dap.Scene(name="finger")
    scene.add_material("skin", mu=0.8)
    scene.add_collisions(material="skin")
    scene.add_body("finger", mass=0.04, Jp=[3e-5, 3e-5, 2e-6], r=[0.0501, 0.0, -0.04])
    scene.add_body("ball", mass=0.06, Jp=[1.2e-5] * 3, r=[0.0, 0.0, -0.075])
    scene.add_point("top", "finger", [0.0, 0.0, 0.04])
    scene.add_point("knuckle", "ground", [0.0501, 0.0, 0.0])
    scene.add_joint("rev", "hinge", P_i="top", P_j="knuckle", a_i="finger.y", a_j="ground.y")
    scene.add_force("rot_sda", "motor", joint="hinge", n_a=0.4, c=0.01)
    scene.add_force("weight", "gravity")
    at = [0.0, 0.0, -0.04]
    scene.add_shape("sphere", body="finger", radius=0.028, at=at, collides=True)
    scene.add_shape("sphere", body="ball", radius=0.022, collides=True)
    wall = {"at": [-0.022, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}
    scene.add_shape("plane", body="ground", collides=True, **wall)
    held = dap.simulate(scene, t_end=2.0, dt=0.1, contact_step=4e-3, estimate_error=False)
    assert np.ptp(held.r[5:], axis=0).max() < 2e-13


def test_times_that_differ_by_rounding_make_no_step_of_their_own():
    """A function ends at 0.7 s, reports stand at 35 x 0.02 s: forces there are no rounding."""
    scene = dap.Scene(name="lift")
    scene.add_body("floor", mass=1.0, Jp=[0.01] * 3)
    scene.add_body("ball", mass=0.1, Jp=[1e-4] * 3, r=[0.0, 0.0, 0.1])
    scene.add_joint("tran", "rail", P_i="floor.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("b", "height", x_start=0.2, x_end=0.7, f_start=0.0, f_end=0.1)
    scene.add_joint("drive-tran", "motor", joint="rail", function="height")
    scene.add_force("weight", "gravity")
    scene.add_contact("ball_plane", "under", P_i="ball.O", P_j="floor.O", a_j="floor.z", radius=0.1)
    run = dap.simulate(scene, t_end=1.0, dt=0.02, contact="stepping", contact_step=1e-3)
    assert 0.7 not in run.t  # 0.7000000000000001
    # the floor's acceleration is at most 5.8 * 0.1 / 0.5^2 = 2.3 m/s^2
    assert np.all(np.abs(run.contact("under").normal_force - 0.981) < 0.24)


def test_a_servo_that_is_fast_for_the_step_makes_it_shorter():
    """A foot of 0.03 kg m^2 with a damper of 40 N m s/rad: 1333 1/s; a note says so.

    It presses on the floor with the servo's moment over its length, whatever the step; 100 time
    constants later the rest of its fall is below rounding.
    """
    scene = dap.Scene(name="foot")
    scene.add_body("foot", mass=1.0, Jp=[0.02] * 3, r=[0.1, 0.0, 0.0])
    scene.add_point("hip", "ground", [0.0, 0.0, 0.0])
    scene.add_point("heel", "foot", [-0.1, 0.0, 0.0])
    scene.add_point("toe", "foot", [0.1, 0.0, 0.0])
    scene.add_joint("rev", "pin", P_i="heel", P_j="hip", a_i="foot.y", a_j="ground.y")
    scene.add_force("rot_sda", "servo", joint="pin", k=50.0, n_a=3.0, c=40.0)
    scene.add_shape("sphere", "sole", body="foot", radius=0.02, at=[0.1, 0.0, 0.0], collides=True)
    scene.add_shape("plane", body="ground", at=[0.0, 0.0, -0.0201], collides=True)
    scene.add_material("hard")
    scene.add_collisions(material="hard")
    run = dap.simulate(scene, t_end=0.2, dt=0.1, contact_step=2e-2, estimate_error=False)
    turned = run.quantity("pin.angle").values[-1]
    moment = 3.0 - 50.0 * turned
    assert turned == pytest.approx(np.arcsin(1e-4 / 0.2), rel=1e-6)
    push = run.contacts.of("sole").at(run.t[-1:]).force[0, 2]
    assert push == pytest.approx(moment / (0.2 * np.cos(turned)), rel=1e-8)
    assert any("steps are 0.0015 s" in n and "at 1.3e+03 1/s" in n for n in run.notes)


@pytest.mark.parametrize(
    ("links", "link", "base"), [(7, 5.0, 50.0), (7, 1.0, 130.0), (10, 0.2, 300.0)]
)
def test_an_arm_on_a_base_that_sticks_whose_hand_is_held(links, link, base):
    """A loop of hinges between a weld and friction: rounds leave nearly all of their residual.

    1e-8 to 1e-6 of the largest impulse is left where such rounds end the search, and where joints
    that free motion has turned, or gaps to one side, ask for what a loop does not allow; limit:
    some roundings.
    """
    scene, reach = dap.Scene(name="braced"), 0.2
    scene.add_material("rubber", mu=1.0)
    scene.add_collisions(material="rubber")
    scene.add_shape("plane", body="ground", collides=True, group=1, meets=1)
    scene.add_body("base", mass=base, Jp=[0.03 * base] * 3, r=[0.0, 0.0, 0.15])
    scene.add_shape("box", body="base", size=[0.5, 0.5, 0.3], collides=True, group=1, meets=1)
    scene.add_force("weight", "gravity")
    last, centre, end = "base", np.array([0.0, 0.0, 0.15]), np.array([0.0, 0.0, 0.3])
    for k in range(links):
        name, half = f"link{k}", reach * np.array([0.5, 0.0, 0.25 if k % 2 else -0.25])
        scene.add_body(name, mass=link, Jp=[link * reach**2 / 12.0] * 3, r=end + half)
        scene.add_point(f"outer{k}", last, end - centre)
        scene.add_point(f"inner{k}", name, -half)
        axis = "z" if k % 2 else "y"
        scene.add_joint("rev", f"hinge{k}", P_i=f"outer{k}", P_j=f"inner{k}",
                        a_i=f"{last}.{axis}", a_j=f"{name}.{axis}")  # fmt: skip
        last, centre, end = name, end + half, end + 2.0 * half
    scene.add_joint("weld", "hand", body_i=last, body_j="ground")
    result = dap.simulate(scene, t_end=0.01, dt=0.005, contact="stepping", contact_step=1e-3)
    assert result.ledger["residual"].value < 1e-12
