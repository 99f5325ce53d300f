"""SDF as its versions and its folders of models have it; what is expected is written out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dap3d_core as dap
from dap3d_core.model.rotations import rotation

QUARTER = "1.5707963267948966"

#: A hinge about x of the model, whose second link is turned in it: about z of that link.
HINGE = f"""<sdf version="%s"><world name="w">%s<model name="m"><pose>0 0 1 0 0 {QUARTER}</pose>
<link name="a"><pose>0 0 0.5 0 0 0</pose></link>
<link name="b"><pose %s="a">1 0 0 0 {QUARTER} 0</pose></link>
<joint name="%s" type="revolute"><parent>a</parent><child>b</child>
<axis><xyz%s>1 0 0</xyz></axis></joint></model></world></sdf>"""
MOON = "<gravity>0 0 -1.6</gravity>"
PHYSICS = f"<physics type='ode'>{MOON}</physics>"

#: Link -> its <gravity>.
GRAVITY = {"floats": "False", "falls": "true", "drops": 1}


def imported(folder, text, **options):
    path = folder / "a.sdf"
    path.write_text(text)
    return dap.import_model(path, **options)


@pytest.mark.parametrize(
    ("version", "gravity", "frame", "joint", "expressed", "axis", "size"),
    [
        ("1.11", MOON, "relative_to", "j", "", (0, 0, -1), 1.6),
        ("1.11", PHYSICS, "relative_to", "j", ' expressed_in="a"', (0, 1, 0), 9.8),
        ("1.10", MOON, "relative_to", "j", ' expressed_in="__model__"', (0, 1, 0), 1.6),
        ("1.6", MOON, "frame", "b", "", (0, 0, -1), 1.6),
        ("1.5", PHYSICS, "frame", "j", "", (0, 0, -1), 1.6),
        ("1.4", PHYSICS, "relative_to", "b", "", (0, 1, 0), 1.6),
        ("1.2", PHYSICS, "frame", "world", "", (0, 1, 0), 1.6),
    ],
)
def test_axes_gravity_and_frames_are_those_of_the_version(
    tmp_path, version, gravity, frame, joint, expressed, axis, size
):
    """Axes are in the frame of the model before 1.5, gravity is in <physics> before 1.6, and
    relative_to is called frame before 1.7 (the conversions of the format's library)."""
    scene, report = imported(tmp_path, HINGE % (version, gravity, frame, joint, expressed))
    assert scene.forces["gravity"].fields["gravity"] == size
    b, (rev,) = scene.bodies["b"], scene.joints.values()
    assert_allclose(b.r, [0.0, 1.0, 1.5], atol=1e-15)  # beside a, along y of the world
    name = rev.fields["a_i"]
    local = scene.vectors[name].sp if name in scene.vectors else np.eye(3)["xyz".index(name[-1])]
    assert_allclose(rotation(np.array(b.p)) @ local, axis, atol=1e-15)
    called = [one.text for one in report.translated if "it is called" in one.text]
    text = f"joint {joint} has the name of a link: it is called {joint}_joint"
    assert called == ([] if joint == "j" else [text])


def test_two_frames_of_one_name_and_a_version_of_attributes_are_refused(tmp_path):
    with pytest.raises(dap.SceneError, match="there are two frames b"):
        imported(tmp_path, HINGE % ("1.7", MOON, "relative_to", "b", ""))
    with pytest.raises(dap.SceneError, match=r"(?s)version 1\.0 has.*convert it with gz sdf"):
        imported(tmp_path, HINGE % ("1.0", PHYSICS, "frame", "j", ""))


def test_a_link_without_gravity_stays_where_it_is(tmp_path):
    """Another falls by g t^2 / 2; both move on in steps that are exact for it."""
    text = "".join(f'<link name="{n}"><gravity>{g}</gravity></link>' for n, g in GRAVITY.items())
    scene, report = imported(tmp_path, f'<sdf version="1.6"><model name="m">{text}</model></sdf>')
    assert not report.left_out
    result = dap.simulate(scene, t_end=0.5, dt=0.5)
    fall = dict(zip(scene.bodies, result.r[-1, :, 2], strict=True))
    assert_allclose(fall["floats"], 0.0, atol=1e-14)
    assert_allclose([fall["falls"], fall["drops"]], -9.8 / 8.0, rtol=1e-9)


ARM = """<sdf version="1.9"><model name="arm">
<link name="base"><inertial><mass>3</mass></inertial></link>
<link name="tip"><pose>0 0 1 0 0 0</pose><inertial><mass>2</mass></inertial></link>
<frame name="flange" attached_to="tip"><pose>0 0 0.5 0 0 0</pose></frame>
<joint name="lift" type="prismatic"><parent>__model__</parent><child>tip</child><axis/></joint>
</model></sdf>"""
CONFIG = """<model><name>An arm</name><sdf version="1.5">old.sdf</sdf>
<sdf version="1.10">new.sdf</sdf><sdf version="1.9">old.sdf</sdf></model>"""
HOLDER = """<sdf version="1.9"><model name="holder">
<link name="hand"><pose>9 0 0 0 0 0</pose></link>
<include %s><uri>%s</uri><name>left</name><pose>1 0 0 %s 0 0</pose></include>
<joint name="grip" type="fixed"><parent>%sflange</parent><child>hand</child></joint>
</model></sdf>"""


def folder_of_arm(folder):
    """A folder of a model, whose configuration names the file of the newest version."""
    folder.mkdir(parents=True)
    (folder / "model.config").write_text(CONFIG)
    (folder / "old.sdf").write_text(ARM.replace("2</mass>", "7</mass>"))
    (folder / "new.sdf").write_text(ARM)


@pytest.mark.parametrize(("merge", "scope"), [("", "left::"), ('merge="true"', "")])
def test_a_merged_model_moves_as_a_nested_one_by_its_own_names(tmp_path, merge, scope):
    """A quarter turn about x takes its z axis to -y; its joint and frames keep their places."""
    folder_of_arm(tmp_path / "arm")
    scene, report = imported(tmp_path, HOLDER % (merge, "arm", QUARTER, scope))
    assert not report.left_out
    base, tip = scene.bodies[f"{scope}base"], scene.bodies[f"{scope}tip"]
    assert (base.mass, tip.mass) == (3.0, 3.0)  # the hand of 1 kg is fixed to the tip
    assert_allclose(base.r, [1.0, 0.0, 0.0], atol=1e-15)
    assert_allclose(tip.r, [(2.0 * 1.0 + 9.0) / 3.0, -2.0 / 3.0, 0.0], atol=1e-15)
    ((name, lift),) = scene.joints.items()
    assert (name, lift.type, lift.fields["a_j"]) == (f"{scope}lift", "tran", f"{scope}base.z")


@pytest.mark.parametrize(
    ("at", "uri"),
    [
        ("arm", "arm"),
        ("models/arm", "model://arm"),
        ("some/where/arm", "arm"),
        ("models/arm", "https://fuel.gazebosim.org/1.0/someone/models/arm"),
        ("models/arm", "https://fuel.gazebosim.org/1.0/someone/models/arm/tip"),
        ("models/arm", "file://arm"),
    ],
)
def test_a_model_is_found_by_its_name_below_the_root(tmp_path, at, uri):
    folder_of_arm(tmp_path / at)
    scene, _ = imported(tmp_path, HOLDER % ("", uri, 0, "left::"))
    assert scene.bodies["left::tip"].mass == 3.0


def test_an_included_light_is_left_out(tmp_path):
    (tmp_path / "sun").mkdir()
    (tmp_path / "sun" / "model.sdf").write_text('<sdf version="1.6"><light name="sun"/></sdf>')
    include = "<include><uri>model://sun</uri></include>"
    text = f'<sdf version="1.6"><world name="w">{include}<model name="m"><link name="a"/></model>'
    scene, report = imported(tmp_path, f"{text}</world></sdf>")
    assert len(scene.bodies) == 1
    assert [str(one) for one in report.left_out] == ["sun/model.sdf:1: <light>: lights"]
    (tmp_path / "sun" / "model.sdf").write_text('<sdf version="1.6"/>')
    with pytest.raises(dap.SceneError, match="model://sun holds no <model>"):
        imported(tmp_path, f"{text}</world></sdf>")


def test_a_model_that_is_not_found_is_named(tmp_path):
    text = HOLDER % ("", "https://fuel.gazebosim.org/1.0/someone/models/arm", 0, "left::")
    with pytest.raises(dap.SceneError, match=r"(?s)the package arm is not known.*--package arm="):
        imported(tmp_path, text)
    with pytest.raises(dap.SceneError, match="--package 'an arm=FOLDER'"):
        imported(tmp_path, text.replace("models/arm", "models/an arm"))
    for folder in ("one", "two"):
        folder_of_arm(tmp_path / folder / "arm")
    with pytest.raises(dap.SceneError, match=r"(?s)there are 2 folders arm within.*--package arm="):
        imported(tmp_path, text)
    scene, _ = imported(tmp_path, text, packages={"arm": tmp_path / "two" / "arm"})
    assert scene.bodies["left::tip"].mass == 3.0


BAR = """<collision name="bar"><pose>0.5 0 0 0 0 %s</pose><geometry>
<box><size>0.2 1 0.1</size></box></geometry>%s</collision>"""
TIP = """<collision name="tip"><pose>1 0 0 0 0 0</pose><geometry>%s</geometry></collision>"""
AUTO = """<sdf version="1.12"><model name="m"><link name="a"><inertial auto="true">
<pose>9 9 9 0 0 0</pose>%s</inertial>%s</link></model></sdf>"""
BALL = "<sphere><radius>0.1</radius></sphere>"
ROD = "<mesh><scale>2 1 1</scale><uri>cube.obj</uri></mesh>"
CUBE = """v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1
f 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\nf 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8
f 2 8 6"""


@pytest.mark.parametrize(
    ("density", "own", "mass"), [("", "", 0.0), ("<density>500</density>", "", 0.0),
                                 ("", "<density>250</density>", 0.0), ("", "", 3.0)]
)  # fmt: skip
def test_inertials_are_those_of_the_volumes_of_collisions(tmp_path, density, own, mass):
    """A bar of 20 l along x, turned a quarter, and a ball at its end; 1000 kg/m^3 by default."""
    usual = 500.0 if density else 1000.0
    bar, ball = 0.02 * (250.0 if own else usual), 4.0 / 3.0 * np.pi * 1e-3 * usual
    given = density + (f"<mass>{mass}</mass>" if mass else "")
    scene, _ = imported(tmp_path, AUTO % (given, BAR % (QUARTER, own) + TIP % BALL))
    ratio = mass / (bar + ball) if mass else 1.0
    at, reduced = (0.5 * bar + ball) / (bar + ball), bar * ball / (bar + ball) * 0.25
    turned = np.array([0.05, 1.01, 1.04]) / 12.0 * bar + 0.004 * ball + [0.0, reduced, reduced]
    body = scene.bodies["a"]
    assert_allclose(body.mass, ratio * (bar + ball), rtol=1e-14)
    assert_allclose(body.r, [at, 0.0, 0.0], atol=1e-15)
    J = np.array(body.Jp) if np.ndim(body.Jp) == 2 else np.diag(body.Jp)
    assert_allclose(J, ratio * np.diag(turned), rtol=1e-13, atol=1e-14)


def test_inertials_of_meshes_need_their_files(tmp_path):
    with pytest.raises(dap.SceneError, match=r"there is no file cube\.obj; its mass properties"):
        imported(tmp_path, AUTO % ("", TIP % ROD), shapes=False)
    (tmp_path / "cube.obj").write_text(CUBE)
    scene, _ = imported(tmp_path, AUTO % ("", TIP % ROD), shapes=False)
    body = scene.bodies["a"]
    assert_allclose([body.mass, *body.r], [2000.0, 2.0, 0.5, 0.5], rtol=1e-14)
    assert_allclose(body.Jp, 2000.0 / 12.0 * np.array([2.0, 5.0, 5.0]), rtol=1e-13)
    for shape, words in (("<plane/>", "the mass of a <plane> is not"), ("", "without a volume")):
        with pytest.raises(dap.SceneError, match=words):
            imported(tmp_path, AUTO % ("", TIP % shape))


def test_the_mass_centre_of_a_cone_lies_a_quarter_of_its_length_above_its_base(tmp_path):
    """Its frame is at half its length, with the tip along z; turned upside down here."""
    cone = "<cone><radius>0.3</radius><length>0.8</length></cone>"
    collision = (TIP % cone).replace("1 0 0 0 0 0", f"0 0 2 {2.0 * float(QUARTER)} 0 0")
    scene, report = imported(tmp_path, AUTO % ("", collision), contacts=True)
    (body,) = scene.bodies.values()
    mass = 1000.0 * np.pi * 0.09 * 0.8 / 3.0
    assert body.mass == pytest.approx(mass, rel=1e-14)
    assert_allclose(body.r, [0.0, 0.0, 2.2], atol=1e-15)
    assert_allclose(body.Jp, mass * np.diag([0.0375, 0.0375, 0.027]), rtol=1e-13, atol=1e-14)
    assert [(one.motion, one.text) for one in report.left_out] == [
        (True, "a shape cone meets no others")
    ]


#: A hinge, of which words are replaced below.
WORDS = """<sdf version="1.11"><model name="m"><static>false</static>
<pose degrees="false" rotation_format="euler_rpy">0 0 1 0 0 90</pose>
<link name="a"><gravity>true</gravity><inertial auto="false"><mass>2</mass></inertial></link>
<link name="b"><pose>1 0 0 0 0 0</pose></link>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><limit>
<stiffness>9</stiffness></limit><dynamics><damping>3</damping><friction>1</friction></dynamics>
</axis></joint></model></sdf>"""


@pytest.mark.parametrize(("old", "new", "message"), [
    ("<static>false", "<static>yes", "1: <static> = 'yes' should be true, false, 1 or 0"),
    ("<static>false", "<static>", "1: <static> = '' should be true, false, 1 or 0"),
    ("<gravity>true", "<gravity>2", "3: <gravity> = '2' should be true, false, 1 or 0"),
    ('auto="false"', 'auto="no"', "3: auto of <inertial> = 'no' should be true, false, 1 or 0"),
    ('degrees="false"', 'degrees="on"', "2: degrees of <pose> = 'on' should be true, false"),
    ("euler_rpy", "quat_wxyz", "2: rotation_format of <pose> = 'quat_wxyz' should be euler_rpy"),
    ("0 0 90", "0 0 90 1", "2: <pose> = '0 0 1 0 0 90 1' should be 6 finite numbers"),
    ('false" rotation_format="euler_rpy">0', 'true" rotation_format="quat_xyzw">0 0',
     'should be euler_rpy, or quat_xyzw without degrees="true"'),
    ('rotation_format="euler_rpy">0 0 1 0 0 90', 'rotation_format="quat_xyzw">0 0 0 0 0 0 0',
     "2: a quaternion of length 0 is no rotation"),
    (">2</mass>", ">2_0</mass>", "3: <mass> = '2_0' should be a finite number, 0 or more"),
    (">2</mass>", ">2 kg</mass>", "3: <mass> = '2 kg' should be a finite number"),
    (">2</mass>", ">-2</mass>", "3: <mass> = '-2' should be a finite number, 0 or more"),
    (">9</", ">-9</", "6: <stiffness> = '-9' should be a number, 0 or more"),
    (">3</", ">-3</", "6: <damping> = '-3' should be a finite number, 0 or more"),
    (">1</", ">-1</", "6: <friction> = '-1' should be a finite number, 0 or more"),
])  # fmt: skip
def test_words_that_mean_nothing_are_refused_with_their_line(tmp_path, old, new, message):
    """They were read as false, as radians, as no limit, as a damper that drives."""
    assert WORDS.count(old) == 1
    with pytest.raises(dap.SceneError, match=message):
        imported(tmp_path, WORDS.replace(old, new))


def test_booleans_may_have_capitals(tmp_path):
    """As the library of the format reads them: a static model is ground, 90 is in degrees."""
    with pytest.raises(dap.SceneError, match="no link of the model moves"):
        imported(tmp_path, WORDS.replace("<static>false", "<static> True "))
    scene, _ = imported(tmp_path, WORDS.replace('degrees="false"', 'degrees="TRUE"'))
    assert_allclose(scene.bodies["b"].r, [0.0, 1.0, 1.0], atol=1e-15)


def test_of_elements_that_the_format_has_once_the_first_counts(tmp_path):
    """Alike ones and others, of numbers and of what holds them; the report names the lines."""
    text = WORDS.replace("</mass>", "</mass>\n<mass>5</mass>")
    text = text.replace("</damping>", "</damping>\n<damping>4</damping>")
    ball = "<visual><geometry><sphere><radius>1</radius></sphere><box/></geometry></visual>"
    scene, report = imported(tmp_path, text.replace("</inertial>", f"</inertial>{ball}"))
    assert scene.bodies["a"].mass == 2.0
    assert [force.fields["c"] for force in scene.forces.values() if "c" in force.fields] == [3.0]
    assert [str(one) for one in report.left_out] == [
        "a.sdf:4: a further <mass> of <inertial>: the first counts",
        "a.sdf:4: a further <box> of <geometry>: the first counts",
        "a.sdf:8: a further <damping> of <dynamics>: the first counts",
    ]
    assert [one.motion for one in report.left_out] == [True, True, True]
