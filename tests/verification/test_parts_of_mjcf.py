"""Parts of MJCF files that belong to each other: options, replicas and tendons, muscles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.plain import long_in_plain_python

import dap3d_core as dap


def imported(path, text):
    path.write_text(f"<mujoco>{text}</mujoco>")
    return dap.import_model(path)


def test_a_later_option_keeps_gravity(tmp_path):
    body = '<worldbody><body><freejoint/><geom size="0.1"/></body></worldbody>'
    text = f'<option gravity="0 0 -1.6"/><option cone="elliptic"/>{body}'
    scene, _ = imported(tmp_path / "a.xml", text)
    assert scene.forces["gravity"].fields["gravity"] == 1.6


NAMED = """<default class="arm"><geom density="%d"/>
<default class="light"><geom density="100"/></default></default>%s<worldbody>
<body name="a" childclass="arm"><joint/><geom size="1"/></body><body name="b"><joint/>
<geom size="1"/></body><body name="c"><joint/><geom size="1" class="light"/></body></worldbody>"""


def test_the_outermost_default_class_may_have_a_name(tmp_path):
    """It is that of all elements, as in MuJoCo 2.3.7, which gives these masses; of two none is."""
    scene, _ = imported(tmp_path / "a.xml", NAMED % (500, ""))
    masses = [scene.bodies[name].mass * 0.75 / np.pi for name in "abc"]
    np.testing.assert_allclose(masses, [500.0, 500.0, 100.0], rtol=1e-15)
    with pytest.raises(dap.SceneError, match="outermost default classes arm, leg are one, main"):
        imported(tmp_path / "a.xml", NAMED % (500, '<default class="leg"/>'))


BALLS = """<worldbody><site name="top" pos="0 0 2"/><site name="low" pos="0 0 1"/>
<replicate count="3" offset="1 0 0">
<body name="ball"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/>
<site name="end"/></body></replicate></worldbody>
<tendon><spatial name="rope" stiffness="3"><site site="top"/><site site="end"/></spatial>
<spatial name="own" stiffness="1"><site site="top"/><site site="low"/></spatial></tendon>
<actuator><motor joint="x" name="pull"/><motor tendon="rope" name="wind"/></actuator>"""


def test_what_names_a_replica_is_copied_with_it(tmp_path):
    """Tendons to each ball, motors of these and of the joints; what is apart stays one."""
    scene, _ = imported(tmp_path / "a.xml", BALLS)
    assert set(scene.inputs) == {f"{name}{k}" for name in ("pull", "wind") for k in range(3)}
    names = [n for n, f in scene.forces.items() if f.type == "ptp" and f.fields.get("k") == 3.0]
    assert names == [f"rope{k}_spring" for k in range(3)]


def test_copies_of_tendons_have_a_bound(tmp_path):
    text = BALLS.replace('"3"', '"15000"')
    with pytest.raises(dap.SceneError, match="more than 100000"):
        imported(tmp_path / "a.xml", text)


def test_force_of_a_muscle_by_its_acceleration(tmp_path):
    """scale over the acceleration by a force of 1: 2 * 0.1 / 0.5 rad/s^2; its gear is 2."""
    text = """<worldbody><body><joint name="q" axis="0 1 0" armature="0.2"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.3 0.3 0.3"/></body></worldbody>
      <tendon><fixed name="t"><joint joint="q" coef="0.1"/></fixed></tendon>
      <actuator><muscle tendon="t" gear="2" scale="50" lengthrange="-1 1"/></actuator>"""
    scene, report = imported(tmp_path / "a.xml", text)
    assert not [one for one in report.left_out if one.motion]
    (peak,) = [f.fields["peak"] for f in scene.forces.values() if "peak" in f.fields]
    assert peak == pytest.approx(2.0 * 50.0 / 0.4, rel=1e-12)


def test_points_of_a_tendon_in_one_place_are_refused(tmp_path):
    text = BALLS.replace('"top" pos="0 0 2"', '"top" pos="0 0 0"')
    with pytest.raises(dap.SceneError, match="tendon rope0: two points that follow each other"):
        imported(tmp_path / "a.xml", text)


@pytest.mark.parametrize("half", [(0.5, 0.5, 0.5, 0.5), (0.7071068, 0.0, -0.7071068, 0.0)])
def test_a_mesh_that_is_scaled_after_a_quarter_turn(tmp_path, half):
    """Each corner, moved and turned back by the reference, then scaled, then put in the body."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    lines = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    (tmp_path / "part.obj").write_text(lines + faces)
    scene, report = imported(
        tmp_path / "a.xml",
        f"""<asset><mesh name="m" file="part.obj" scale="2 -3 4" refpos="0.1 0.2 0.3"
        refquat="{" ".join(map(str, half))}"/></asset><worldbody><body pos="5 6 7"><freejoint/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="m"/></body>
        </worldbody>""",
    )
    assert not report.left_out
    (shape,) = [one.fields for one in scene.shapes.values()]
    A = Rotation.from_quat(np.roll(half, -1))
    expected = [2.0, -3.0, 4.0] * A.inv().apply(corners - [0.1, 0.2, 0.3])
    p = shape["p"]
    found = Rotation.from_quat(np.roll(p, -1)).apply(np.array(shape["scale"]) * corners)
    np.testing.assert_allclose(found + shape["at"], expected, rtol=0, atol=1e-12)


LOCKED = """<worldbody><body name="base"><inertial pos="0.02 0 0" mass="1" diaginertia="1 1 1"/>{}
  <body name="arm"><joint name="a" armature="0.1"/><joint name="b" axis="-0.4 0.7 0.6"/>
  <inertial pos="-0.08 0.04 0.07" mass="1.6" diaginertia="0.015 0.017 0.03"/></body></body>
  </worldbody>"""


def test_a_base_that_a_loop_locks_is_as_one_without_a_joint(tmp_path):
    """Two of three rows of the loop depend on the third; a link without mass follows a rotor."""
    text = LOCKED.format('<joint name="j"/>')
    closed = '<equality><connect body1="base" anchor="-0.1 -0.05 0.1"/></equality>'
    found = []
    for k, model in enumerate((text + closed, LOCKED.format(""))):
        scene, _ = imported(tmp_path / f"{k}.xml", model)
        assert scene.simulation.method == "joint"
        model = dap.compile(scene)
        rates = model.rhs(0.0, model.model.u0)[7 * len(scene.bodies) :].reshape(-1, 6)
        found.append(rates[list(scene.bodies).index("arm")])
    np.testing.assert_allclose(*found, rtol=1e-9)


CLASSES = """<default><position kp="5" kv="3"/><default class="turns"><motor gear="2 3"/></default>
  </default><worldbody><body><joint name="q"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
  </body></worldbody><actuator>{}</actuator>"""


@pytest.mark.parametrize(
    ("actuator", "gain", "k", "c"),
    [
        ('<general joint="q"/>', 5.0, 5.0, 3.0),
        ('<general joint="q" biasprm="0 -2"/>', 5.0, 2.0, 3.0),
        ('<velocity joint="q"/>', 1.0, 0.0, 1.0),
        ('<position joint="q" class="turns"/>', 10.0, 20.0, 12.0),
        ('<general joint="q" class="turns"/>', 2.0, 0.0, 0.0),
    ],
)
def test_laws_of_actuators_by_their_classes(tmp_path, actuator, gain, k, c):
    """Of the nearest class with a law of that name, or of <general>; as MuJoCo 4.0 compiles it."""
    scene, _ = imported(tmp_path / "a.xml", CLASSES.format(actuator))
    (motor,) = [f.fields["np"][2] for f in scene.forces.values() if f.type == "np"]
    given = [f.fields for f in scene.forces.values() if f.type == "rot_sda"]
    sums = [sum(one.get(key) or 0.0 for one in given) for key in ("k", "c")]
    assert [motor, *sums] == [gain, k, c]


def test_what_an_element_has_of_a_class_in_parts(tmp_path):
    """Its own turn replaces that of the class in other words; of lists the class has the rest."""
    text = """<default><geom axisangle="0 0 1 90" friction="0.5 0.1 0.2" size="1 2 3" type="box"/>
      </default><worldbody><body><freejoint/><geom euler="90 0 0" friction="2" size="4"
      condim="6"/></body></worldbody>"""
    (tmp_path / "a.xml").write_text(f"<mujoco>{text}</mujoco>")
    scene, _ = dap.import_model(tmp_path / "a.xml", contacts=True)
    (shape,), (material,) = scene.shapes.values(), scene.materials.values()
    assert shape.fields["size"] == (8.0, 4.0, 6.0)
    assert shape.fields["p"] == pytest.approx([0.5**0.5, 0.5**0.5, 0.0, 0.0], abs=1e-15)
    assert (material.mu, material.mu_spin, material.mu_roll) == (2.0, 0.1, 0.2)


@pytest.mark.parametrize(("text", "message"), [
    ('<compiler angle="Radian"/>', "angle of <compiler> = 'Radian' should be radian or degree"),
    ('<compiler inertiafromgeom="yes"/>', "inertiafromgeom of <compiler> = 'yes' should be auto"),
    ('<option><flag gravity="false"/></option>', "gravity of <flag> = 'false' should be enable"),
    ('<default><joint limited="1"/></default>', "limited of <joint> = '1' should be auto or true"),
    ('<default><geom mass="-3"/></default>', "mass of <geom> = -3 should be 0 or more"),
    ('<default><geom density="-3"/></default>', "density of <geom> = -3 should be 0 or more"),
    ('<default><joint/><joint damping="1"/></default>', "a further <joint> of <default>: MuJoCo"),
    ('<worldbody><site name="s"/><site name="s"/></worldbody>', "there are two of <site> 's'"),
    ('<worldbody><body name="s"/><body name="s"/></worldbody>', "there are two of <body> 's'"),
    ('<worldbody><body><inertial mass="-1" pos="0 0 0"/></body></worldbody>',
     "mass of <inertial> = '-1' should be a finite number, 0 or more"),
    ('<worldbody><body><inertial mass="1" diaginertia="1 -1 1"/></body></worldbody>',
     "diaginertia of <inertial> = '1 -1 1' should be 3 finite numbers, 0 or more"),
    ('<worldbody><body><joint name="j"/><geom size="1"/></body></worldbody><actuator>'
     '<motor joint="j" ctrlrange="1 -1"/></actuator>',
     "ctrlrange of <motor>: lower = 1 lies above upper = -1"),
])  # fmt: skip
def test_words_and_masses_that_mean_nothing_are_refused(tmp_path, text, message):
    """They were read as the default: degrees, no limit, the mass of water; MuJoCo refuses them."""
    body = '<worldbody><body><joint range="-1 1"/><geom size="0.1"/></body></worldbody>'
    with pytest.raises(dap.SceneError, match=message):
        imported(tmp_path / "a.xml", text + body)


@pytest.mark.parametrize(("bound", "mass", "moment"), [
    ('boundmass="0.5"', 1.5, 0.004 + 1.0 / 3.0),
    ('boundinertia="0.01"', 1.0, 0.02),
])  # fmt: skip
def test_bounds_of_mass_and_inertia_hold_by_themselves(tmp_path, bound, mass, moment):
    """A body without geoms, 1 m above that of a ball it is fixed to: Steiner's theorem."""
    ball = '<geom size="0.1" mass="1"/><body pos="0 0 1"/>'
    scene, _ = imported(tmp_path / "a.xml", f"<compiler {bound}/><worldbody><body name='a'>"
                        f"<joint/>{ball}</body></worldbody>")  # fmt: skip
    assert scene.bodies["a"].mass == mass
    assert scene.bodies["a"].Jp[0] == pytest.approx(moment, rel=1e-15)


#: A cart on three slides, an arm of several joints a body, and its hand, which the world holds.
HELD_ARM = """<default><joint armature="0.1"/><geom type="capsule" size="0.05"/></default>
<worldbody><body name="cart"><joint type="slide" axis="1 0 0"/>
<joint type="slide" axis="0 1 0"/><joint type="slide"/><geom type="box" size="0.1 0.1 0.1"/>
<body name="upper"><joint axis="1 0 0"/><joint axis="0 -1 0"/><joint axis="0 0 1"/>
<geom fromto="0 0 0 0 0 -0.3"/>
<body name="fore" pos="0 0 -0.3"><joint axis="0 -1 0"/><joint axis="-1 0 0"/>
<geom fromto="0 0 0 0.2 0 0"/>
<body name="hand" pos="0.25 0 0"><joint/><joint axis="0 -1 0"/>
<geom fromto="0 0.02 0 0 -0.02 0"/></body></body></body></body></worldbody>
<equality><weld body1="hand"/></equality>"""


def fall_of_held_arm(bodies, t_end):
    """Positions of upper arm and cart, along x and z, by the angles of the fore and upper arms.

    Each body is at w + alpha u + beta d, of the directions u and d of the arms, from the wrist w.
    """
    terms = {"fore": (-0.15, 0.0), "upper": (-0.25, -0.15), "cart": (-0.25, -0.3)}
    inertias = (np.array(bodies[name].Jp) for name in ("fore", "upper"))
    about_y = [J[1] if J.ndim == 1 else J[1, 1] for J in inertias]
    turns = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, 1.0]])  # of wrist, elbow, shoulder

    def rates(t, y):
        (a, b), w = y[:2], y[2:]
        u, d = np.array([np.cos(a), -np.sin(a)]), np.array([-np.sin(b), -np.cos(b)])
        du, dd = np.array([-np.sin(a), -np.cos(a)]), np.array([-np.cos(b), np.sin(b)])
        M = 0.1 * turns.T @ turns + np.diag(about_y)
        right = np.zeros(2)
        for name, (alpha, beta) in terms.items():
            J, weighed = np.stack([alpha * du, beta * dd], axis=1), bodies[name].mass
            moved = weighed + (0.1 if name == "cart" else 0.0)  # the armature of the slides
            M += moved * J.T @ J
            right += J.T @ (moved * (alpha * u * w[0] ** 2 + beta * d * w[1] ** 2))
            right -= J.T @ np.array([0.0, 9.81 * weighed])
        return [*w, *np.linalg.solve(M, right)]

    a, b = solve_ivp(rates, (0.0, t_end), np.zeros(4), "DOP853", rtol=1e-11, atol=1e-13).y[:2, -1]
    u, d = np.array([np.cos(a), -np.sin(a)]), np.array([-np.sin(b), -np.cos(b)])
    return [np.array([0.25, -0.3]) + terms[n][0] * u + terms[n][1] * d for n in ("upper", "cart")]


@long_in_plain_python
def test_a_loop_through_links_without_mass_is_cut_at_bodies(tmp_path):
    """Cut at the shoulder, which has two links without mass, the run stopped at once.

    Links between the joints of a body have 1e-11 of its mass; both integrations hold 1e-9.
    """
    scene, _ = imported(tmp_path / "a.xml", HELD_ARM)
    result = dap.simulate(scene, t_end=0.3, dt=0.1, rtol=1e-9)
    places = fall_of_held_arm(scene.bodies, 0.3)
    for name, place in zip(("upper", "cart"), places, strict=True):
        found = result.quantity(f"{name}.r").values[-1]
        assert found == pytest.approx([place[0], 0.0, place[1]], abs=1e-8)
