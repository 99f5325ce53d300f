"""Contacts of a run: what is refused, what goes on elsewhere, what a result keeps."""

import numpy as np
import pytest
from support.ended import leave, shorten_chunks
from support.internals import contact_jumps
from support.plain import long_in_plain_python
from support.results import same_run

import dap3d_core as dap


def bouncing(e=0.5, mu=0.3, height=0.2, **more):
    scene = dap.Scene(name="bouncing")
    scene.add_material("rubber", mu=mu, e=e)
    r = [0.0, 0.0, 0.1 + height]
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=r, r_dot=[1.0, 0.0, 0.0])
    scene.add_force("weight", "g")
    fields = {"P_i": "ball.O", "radius": 0.1, "material": "rubber"} | more
    scene.add_contact("ball_plane", "floor", **fields)
    scene.simulation.t_end, scene.simulation.dt = 1.0, 0.1
    return scene


def touching(scene):
    scene.bodies["ball"].r = [0.0, 0.0, 0.1]
    return scene


def test_bodies_that_overlap_are_refused_with_depth_and_remedy():
    with pytest.raises(dap.SceneError, match=r"floor.*overlap by 0\.01 m.*\n.*move them apart"):
        dap.simulate(bouncing(height=-0.01))


def test_a_joint_that_starts_beyond_its_limit_is_refused_with_the_angle():
    scene = dap.Scene(name="door")
    scene.add_body("door", mass=1.0)
    hinge = {"P_i": "door.O", "P_j": "ground.O", "a_i": "door.z", "a_j": "ground.z"}
    scene.add_joint("rev", "hinge", **hinge, lower=0.5)
    with pytest.raises(dap.SceneError, match=r"hinge_lower.*by 0\.5 rad.*\n.*turn them") as refused:
        dap.simulate(scene, t_end=1.0)
    assert "touch =" not in str(refused.value)


def test_a_driver_that_goes_on_into_a_limit_is_named_with_the_contact():
    scene = dap.Scene(name="driven")
    scene.add_body("door", mass=1.0, w=(0.0, 0.0, 1.0))
    hinge = {"P_i": "door.O", "P_j": "ground.O", "a_i": "door.z", "a_j": "ground.z"}
    scene.add_joint("rev", "hinge", **hinge, upper=0.5)
    scene.add_function("a", "turn", coeff=(0.0, 1.0, 0.0))
    scene.add_joint("drive-rot", "drive", joint="hinge", function="turn")
    with pytest.raises(dap.SimulationError, match=r"t = 0\.5 s: contact hinge_upper.*drivers"):
        dap.simulate(scene, t_end=1.0)


@long_in_plain_python
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_winch_that_lowers_a_box_into_the_floor_is_told_from_friction_that_jams(mu):
    """Each corner alone could give way; all of them together cannot."""
    scene = dap.Scene(name="winch")
    scene.add_body("box", mass=400.0, Jp=(60.0, 60.0, 60.0), r=(0.0, 0.0, 1.0))
    top = scene.add_point("top", "ground", (0.0, 0.0, 10.0))
    scene.add_function("a", "pays", coeff=(0.0, 1.0, 0.0))
    scene.add_joint("cable", "rope", points=[top, "box.O"], function="pays")
    scene.add_contact("box_plane", "floor", body_i="box", size=(1.0, 1.0, 1.0), mu=mu)
    with pytest.raises(
        dap.SimulationError, match=r"t = 0\.5 s: contact floor#1.*drivers prescribe"
    ):
        dap.simulate(scene, t_end=1.0)


@long_in_plain_python
def test_a_body_behind_a_surface_that_begins_in_it_is_named_with_the_depth():
    scene = dap.Scene(name="under a shelf")
    scene.add_body("ball", mass=1.0, r=(-0.5, -0.2, 0.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_function("a", "x", coeff=(0.0, 1.0, 0.0))
    scene.add_function("a", "y", coeff=(0.0, 0.0, 0.0))
    edge = {"x": "x", "y": "y", "s_min": 0.0, "s_max": 1.0}
    scene.add_contact("point_curve", "shelf", P_i="ball.O", **edge)
    with pytest.raises(dap.SimulationError, match=r"t = 0\.5 s: contact shelf.*overlap by 0\.2 m"):
        dap.simulate(scene, t_end=1.0)


@pytest.mark.parametrize("height", [0.2, -0.05])
def test_bodies_are_moved_until_they_touch(height):
    result = dap.simulate(bouncing(height=height, touch=True), t_end=0.1, dt=0.05)
    assert result.r[0, 0] == pytest.approx([0.0, 0.0, 0.1], abs=1e-12)
    assert not any(event.kind == "impact" for event in result.events)


def test_a_contact_of_several_points_cannot_be_moved_until_it_touches():
    scene = bouncing()
    scene.add_contact("box_plane", "box", P_i="ball.O", size=[0.1, 0.1, 0.1], touch=True)
    with pytest.raises(dap.SceneError, match=r"box.touch = true.*8 points"):
        dap.simulate(scene)


@pytest.mark.parametrize(
    ("what", "call"),
    [
        (r"touches \(floor\) sticks or slips", lambda s: dap.linearize(touching(s))),
        ("kinematics.*contacts", lambda s: dap.kinematics(s, t_end=1.0)),
        ("method standard.*contacts", lambda s: dap.simulate(s, method="standard")),
    ],
)
def test_what_does_not_know_contacts_says_so(what, call):
    with pytest.raises(dap.SimulationError, match=what):
        call(bouncing())


def test_elements_with_jumps_of_their_own_are_refused_beside_contacts():
    scene = bouncing()
    scene.add_body("other", mass=1.0, Jp=[1.0] * 3, r=[5.0, 0.0, 0.0])
    fields = {"P_i": "other.O", "P_j": "ground.O", "a_j": "ground.x", "e": 0.5, "k": 1e3}
    scene.add_force("plane_stop", "bumper", **fields)
    with pytest.raises(dap.SceneError, match=r"bumper.*law of its own"):
        dap.simulate(scene)


def test_friction_of_joints_is_refused_beside_contacts():
    scene = bouncing()
    scene.add_joint("tran", "rail", P_i="ball.O", P_j="ground.O", a_j="ground.z")
    scene.add_force("friction", "rubs", joint="rail", mu=0.1, v_tol=0.01)
    with pytest.raises(dap.SceneError, match=r"rubs.*depends on reactions in joints"):
        dap.simulate(scene)


@long_in_plain_python
def test_a_run_goes_on_from_a_checkpoint_with_the_same_bits(tmp_path, monkeypatch):
    shorten_chunks(monkeypatch)
    settings = {"t_end": 1.0, "dt": 0.01, "integrator": "dop853"}
    whole = dap.simulate(bouncing(), **settings)
    again = dap.resume(leave(bouncing(), tmp_path, 0.3, **settings))
    assert same_run(again, whole)
    assert [(e.kind, e.t) for e in again.events] == [(e.kind, e.t) for e in whole.events]


@long_in_plain_python
def test_a_run_step_by_step_meets_the_same_contacts():
    scene = bouncing()
    whole, run = dap.simulate(scene, dt=0.1), dap.start(scene)
    for _ in range(10):
        run.step(0.1)
    assert run.result().r[-1] == pytest.approx(whole.r[-1], abs=1e-9)
    assert [e.kind for e in run.result().events] == [e.kind for e in whole.events]


def test_a_result_keeps_contacts_in_a_file(tmp_path):
    result = dap.simulate(bouncing())
    result.save(tmp_path / "run.nc")
    other = dap.open(tmp_path / "run.nc")
    assert other.events == result.events
    for name in ("floor.gap", "floor.normal", "floor.friction", "floor.slip.x", "floor.mode"):
        np.testing.assert_array_equal(other.quantity(name).values, result.quantity(name).values)
    with pytest.raises(Exception, match="is a contact: its forces are those of"):
        result.reaction("floor")
    with pytest.raises(Exception, match=r"there is no contact 'flor'"):
        result.contact("flor")
    with pytest.raises(Exception, match=r"no quantity 'floor.gp'"):
        result.quantity("floor.gp")


def test_a_contact_takes_fields_of_its_material_unless_it_gives_them(tmp_path):
    scene = bouncing(mu=0.0)
    scene.save(tmp_path / "scene.toml")
    loaded = dap.load(tmp_path / "scene.toml")
    assert loaded == scene
    own = bouncing(mu=0.0)
    own.contacts["floor"].fields["e"] = 1.0
    kept = dap.simulate(own, t_end=1.0)
    assert kept.ledger["energy"].value < 1e-12
    assert all(e.work == pytest.approx(0.0, abs=1e-12) for e in kept.events)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"material": "rubbr"}, r"there is no material 'rubbr'"),
        ({"mu_s": 0.1}, r"mu_s = 0.1: is less than mu = 0.3"),
        ({"e": 1.5}, r"e = 1.5"),
        ({"law": "newtons"}, r"law = \"newtons\".*newton"),
        ({"materail": "rubber"}, r"materail.*unknown key.*did you mean 'material'"),
        ({"radiu": 0.2}, r"radiu.*unknown key.*did you mean 'radius'"),
    ],
)
def test_mistakes_in_contacts_are_reported(fields, words):
    with pytest.raises(dap.SceneError, match=words):
        dap.simulate(bouncing(**fields))


def test_a_contact_and_a_joint_of_one_name_are_refused():
    scene = bouncing()
    scene.add_joint("sph", "floor", P_i="ball.O", P_j="ground.O")
    with pytest.raises(dap.SceneError, match="is the name of a joint as well"):
        dap.simulate(scene)


def test_newtons_law_reverses_the_normal_velocity():
    result = dap.simulate(bouncing(law="newton", mu=0.0), t_end=0.3, rtol=1e-12, atol=1e-14)
    impact = result.events[0]
    assert impact.u_after[9] == pytest.approx(-0.5 * impact.u[9], rel=1e-12)


def test_an_impact_that_gives_energy_is_told():
    """A rod that strikes with its tip: Newton's law with friction (Kane and Levinson, 1985)."""
    found = {}
    for law in ("newton", "poisson"):
        scene, half = dap.Scene(name="rod"), 0.3
        scene.add_body("rod", mass=1.0, Jp=[0.1, 0.1, 0.01], r=[0.0, 0.0, 0.5 * np.cos(0.6)],
                       p=[np.cos(half), 0.0, np.sin(half), 0.0],
                       r_dot=[0.5, 0.0, -1.0])  # fmt: skip
        scene.add_point("tip", "rod", [0.0, 0.0, -0.5])
        scene.add_contact("ball_plane", "floor", P_i="tip", mu=0.3, e=0.9, law=law)
        found[law] = dap.simulate(scene, t_end=0.1, dt=0.1)
        kinetic = found[law].energy.kinetic
        assert kinetic[-1] == pytest.approx(0.5 * (0.25 + 1.0) + found[law].events[0].work)
    assert found["newton"].events[0].work > 0.01
    assert any("gave 0.02" in note and "(floor)" in note for note in found["newton"].notes)
    assert found["poisson"].events[0].work < 0.0
    assert not any("gave" in note for note in found["poisson"].notes)


def wedged(law):
    """A rod on a pin, whose tip strikes the floor so steeply that friction holds it there."""
    scene, angle = dap.Scene(name="wedged"), 0.7
    along = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    pin = [0.0, 0.0, 0.5 * np.cos(0.6)]
    turn = 0.5 * np.pi - angle
    scene.add_body("rod", mass=1.0, Jp=[0.001, 0.02, 0.02], r=pin + 0.25 * along,
                   p=[np.cos(0.5 * turn), 0.0, np.sin(0.5 * turn), 0.0],
                   r_dot=0.5 * np.array([along[2], 0.0, -along[0]]), w=[0.0, 2.0, 0.0])  # fmt: skip
    scene.add_point("eye", "rod", [-0.25, 0.0, 0.0])
    scene.add_point("tip", "rod", [0.25, 0.0, 0.0])
    scene.add_point("pin", "ground", pin)
    scene.add_joint("rev", "hinge", P_i="eye", P_j="pin", a_i="rod.y", a_j="ground.y")
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="tip", mu=1.0, e=0.5, law=law)
    return scene


def test_a_wedge_stops_by_poissons_law_and_jams_by_newtons():
    result = dap.simulate(wedged("poisson"), t_end=0.3, dt=0.1)
    assert np.abs(result.w[-1]).max() < 1e-9
    assert [event.kind for event in result.events] == ["impact", "touch"]
    with pytest.raises(dap.SimulationError, match=r"floor jams: no impulse.*poisson"):
        dap.simulate(wedged("newton"), t_end=0.3, dt=0.1)


def test_bounces_without_loss_end_where_they_are_too_low_to_tell():
    scene = touching(bouncing(e=1.0, mu=0.0))
    scene.bodies["ball"].r_dot = [1.0, 0.0, 3e-5]  # 5e-11 m high, 6 us long
    result = dap.simulate(scene)
    assert result.contact("floor").mode[-1] == 1
    assert len(result.events) < 5


def test_a_box_that_falls_on_its_face_comes_to_rest_on_four_corners():
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=1.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.25])
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.4, 0.3, 0.1], mu=0.5)
    result = dap.simulate(scene, t_end=1.0, dt=0.1)
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, 0.05], abs=1e-12)
    contact = result.contact("floor")
    assert contact.gap.shape == (11, 8)
    assert contact.normal_force[-1].sum() == pytest.approx(9.81, rel=1e-9)
    assert sorted(contact.mode[-1]) == [0, 0, 0, 0, 2, 2, 2, 2]
    assert result.contact("floor#1").gap == pytest.approx(contact.gap[:, 0])


@pytest.mark.slow
@long_in_plain_python
def test_a_sweep_runs_contacts_one_by_one():
    scene = bouncing()
    found = dap.sweep(scene, {"contacts.floor.e": [0.0, 0.9]}, outputs=["ball.r.z"])
    assert found is not None
    of_several_points = {"contacts.floor.mu": [0.1, 0.3]}
    box = sliding_box()
    box.simulation.t_end = box.simulation.dt = 0.1
    assert dap.sweep(box, of_several_points, outputs=["box.r.x"]) is not None


def sliding_box(mu=0.3):
    scene = dap.Scene(name="box")
    motion = {"r_dot": [2.0, 0.3, 0.0], "w": [0.0, 0.0, 5.0]}
    scene.add_body("box", mass=1.0, Jp=[0.01, 0.012, 0.015], r=[0.0, 0.0, 0.05], **motion)
    scene.add_force("weight", "g")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.4, 0.3, 0.1], mu=mu)
    return scene


@long_in_plain_python
def test_a_box_that_slides_and_turns_takes_few_steps():
    """Corners on a plane depend on each other, which makes no pose singular."""
    result = dap.simulate(sliding_box(), t_end=1.0, dt=0.1)
    assert result.stats.steps + result.stats.rejected < 200
    assert [e.kind for e in result.events] == ["touch"] * 4 + ["stick"] * 4
    assert np.max(np.abs(result.rd[-1])) < 1e-9


@long_in_plain_python
def test_a_box_rocks_to_rest():
    """Each rebound of its edges is lower; those too low to be told from rest are left out."""
    scene = sliding_box(mu=0.0)
    c, s = np.cos(0.05), np.sin(0.05)
    scene.bodies["box"].p, scene.bodies["box"].w = [c, s, 0.0, 0.0], [0.0, 0.0, 0.0]
    scene.bodies["box"].r = [0.0, 0.0, 0.05 * np.cos(0.1) + 0.15 * np.sin(0.1)]
    result = dap.simulate(scene, t_end=2.0, dt=0.1)
    assert sorted(result.contact("floor").mode[-1]) == [0, 0, 0, 0, 1, 1, 1, 1]
    assert result.r[-1, 0, 2] == pytest.approx(0.05, abs=1e-12)
    assert np.min(result.contact("floor").gap) > -1e-12


def test_changes_without_end_stop_the_run_and_name_the_contact(monkeypatch):
    monkeypatch.setattr(contact_jumps, "MOST_CHANGES", 5)
    monkeypatch.setattr(contact_jumps, "WITHIN", 1.0)
    with pytest.raises(dap.SimulationError, match=r"contacts floor changed 5 times") as caught:
        dap.simulate(bouncing(e=0.8), t_end=5.0)
    assert caught.value.result.t[-1] > 0.0


@long_in_plain_python
def test_steps_that_lead_nowhere_stop_the_run_and_name_the_contact(monkeypatch):
    shorten_chunks(monkeypatch)
    monkeypatch.setattr(contact_jumps, "MOST_STEPS", 5)
    monkeypatch.setattr(contact_jumps, "SLOW", 1.0)
    with pytest.raises(dap.SimulationError, match=r"contacts floor#1, .* closed; the slowest") as c:
        dap.simulate(sliding_box(), t_end=1.0, dt=0.1)
    assert c.value.result is not None


@pytest.mark.slow
@long_in_plain_python
def test_slip_that_is_stiff_is_taken_across_by_radau():
    """A coin that falls over rolls, and slips again where its point of contact races around."""
    scene = dap.Scene(name="coin")
    c, s = np.cos(0.6), np.sin(0.6)
    lean = np.array([0.0, -np.cos(1.2), -np.sin(1.2)])  # from its centre to its lowest point
    w = np.array([0.0, 0.2, 0.2])
    scene.add_body("coin", mass=2.0, Jp=[0.003, 0.003, 0.006], p=[c, s, 0, 0],
                   r=[0, 0, 0.15 * np.sin(1.2)], r_dot=-0.15 * np.cross(w, lean), w=w)  # fmt: skip
    scene.add_force("weight")
    scene.add_contact("disk_plane", "rim", P_i="coin.O", a_i="coin.z", radius=0.15, mu=0.4)
    exact = {"t_end": 0.3, "dt": 0.01, "rtol": 1e-10, "atol": 1e-12}
    result = dap.simulate(scene, **exact, integrator="dop853")
    again = dap.simulate(scene, **exact, integrator="radau")
    assert any("took the run on until it was faster" in note for note in result.notes)
    assert [e.kind for e in result.events] == ["touch", "slip", "stick", "slip"]
    size = np.max(np.abs(result.w))
    assert np.max(np.abs(result.w - again.w)) < 1e-8 * size  # of slip 100 times the tolerance
    assert result.stats.steps < 8000


def thrown_box():
    scene = dap.Scene(name="thrown")
    scene.add_material("rubber", mu=0.3, e=0.2)
    scene.add_body("box", mass=2.0, Jp=[0.01, 0.02, 0.03], r=[0, 0, 0.3], r_dot=[2, 0, 0])
    scene.add_force("weight", "g")
    fields = {"P_i": "box.O", "size": [0.2, 0.2, 0.2], "material": "rubber"}
    scene.add_contact("box_plane", "floor", **fields)
    return dap.simulate(scene, t_end=0.5, dt=0.05)


@pytest.mark.slow
@long_in_plain_python
def test_corners_that_strike_together_share_the_work_of_one_jump(tmp_path, recwarn):
    """What all of them do is the change of the kinetic energy; figures and pages have one jump."""
    result = thrown_box()
    impacts = [event for event in result.events if event.kind == "impact"]
    first = [event for event in impacts if event.t == impacts[0].t]
    assert len(first) == 4
    assert all(event.work < 0.0 for event in first)
    (v, w), (v_after, w_after) = (
        (np.array(u[7:10]), np.array(u[10:13])) for u in (first[0].u, first[0].u_after)
    )
    J = np.array([0.01, 0.02, 0.03])  # the box has not turned before
    energy, after = (v @ v + w @ (J * w) / 2.0, v_after @ v_after + w_after @ (J * w_after) / 2.0)
    assert sum(event.work for event in first) == pytest.approx(after - energy, rel=1e-12)
    moved = [event.kind for event in result.events if event.u_after is not None]
    assert set(moved) == {"impact"}  # nothing else jumps
    quantities = ["box.rd.z", "floor.mode", "floor#1.friction.x"]
    dap.plot(result, *quantities)
    dap.view(result).save(tmp_path / "a.html")
    assert not recwarn.list


def test_a_ball_may_start_in_the_middle_of_a_hollow_one():
    """Where the normal has no direction; it strikes after sqrt(2 h / g)."""
    scene = dap.Scene(name="hollow")
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3)
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "ground.O", "radius_i": 0.1, "radius_j": 1.0}
    scene.add_contact("ball_ball", "shell", inside=True, **ends)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    assert result.events[0].t == pytest.approx(np.sqrt(2.0 * 0.9 / 9.81), rel=1e-12)
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, -0.9], abs=1e-12)


@pytest.mark.slow
@long_in_plain_python
def test_a_box_that_falls_flat_sticks_where_it_lands():
    """Modes behind an impact follow from the velocities behind it: it has stopped turning."""
    scene, tilt = sliding_box(mu=1.0), 0.3
    body, c, s = scene.bodies["box"], np.cos(tilt), np.sin(tilt)
    body.p = [np.cos(tilt / 2.0), 0.0, np.sin(tilt / 2.0), 0.0]
    body.r, body.r_dot, body.w = [0.0, 0.0, 0.05 * c + 0.2 * s], [0.0] * 3, [0.0] * 3
    result = dap.simulate(scene, t_end=1.0, dt=0.1)
    lands = max(event.t for event in result.events if event.kind == "impact")
    assert max(event.t for event in result.events) == lands
    assert sorted(result.contact("floor").mode[-1]) == [0, 0, 0, 0, 2, 2, 2, 2]
    assert np.max(np.abs(result.rd[-1])) < 1e-14  # it does not creep


@pytest.mark.parametrize(("mu", "told"), [(0.2, False), (0.3, True)])
def test_unlike_friction_of_contacts_that_share_a_load_is_noted(mu, told):
    """Four feet, of which three would do: how they share the weight decides how it turns."""
    scene = dap.Scene(name="table")
    scene.add_body("top", mass=2.0, Jp=(0.1, 0.1, 0.2), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("weight", "gravity")
    for k, (x, y) in enumerate([(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)]):
        scene.add_point(f"foot{k}", "top", (x, y, 0.0))
        given = mu if k == 0 else 0.2
        scene.add_contact("ball_plane", f"c{k}", P_i=f"foot{k}", mu=given)
    notes = dap.simulate(scene, t_end=0.01, dt=0.01).notes
    assert any("c0, c1, c2, c3 share what they carry" in note for note in notes) == told
