"""Models of MJCF that others attach: the scene is that of the same model in one file."""

import tomllib

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.formats.import_scene.source_files import SourceFiles
from dap3d_formats.mjcf import copies

#: In degrees with angles about x, y, z; the classes and meshes of each file are its own.
TOP = """<mujoco model="top"><asset><model name="arm" file="parts/arm.xml"/>
  <mesh name="part" vertex="0 0 0 2 0 0 0 2 0 0 0 2"/></asset>
  <default><joint damping="7" armature="1"/><default class="k"><joint damping="9"/></default>
  </default>
  <worldbody><body name="base" childclass="k"><joint name="base" type="slide"/>
  <geom type="mesh" mesh="part"/><frame pos="0 0 1" euler="90 0 0">{attach}</frame></body>
  <body name="last" pos="9 0 0"><joint name="last" range="-30 30"/><geom size="0.1" pos="1 0 0"/>
  </body></worldbody><actuator><motor name="push" joint="base"/></actuator>{key}</mujoco>"""
#: In radians with angles about z, y, x.
ARM = """<mujoco model="an arm"><compiler angle="radian" eulerseq="zyx" meshdir="shapes"
  boundmass="2"/><option gravity="0 0 -1"/><asset><mesh file="part.obj"/></asset>
  <default><joint damping="2"/><geom rgba="1 0 0 1"/>
  <default class="k"><joint damping="3" frictionloss="0.1"/></default></default>
  <worldbody><geom name="post" size="0.2" pos="0 0 0.3"/><frame name="shelf" pos="0 0.5 0">
  <body name="upper" euler="0.1 0.2 0.3" childclass="k"><joint name="shoulder" range="-1 1"/>
  <geom size="0.05" pos="0 0.2 0"/><frame pos="0 0 4"><body name="lower" pos="0 1 0">
  <joint name="elbow" axis="1 0 0"/><geom name="part" type="mesh" mesh="part" density="4000"/>
  <site name="tip" pos="0 0 1"/></body></frame></body></frame>
  <replicate count="2" offset="1 0 0"><body name="leg" pos="0 3 0"><joint name="leg" type="slide"/>
  <geom size="0.3"/></body></replicate></worldbody>
  <tendon><fixed name="sum" stiffness="3"><joint joint="shoulder" coef="1"/>
  <joint joint="elbow" coef="2"/></fixed><fixed name="legs" stiffness="2">
  <joint joint="elbow" coef="1"/><joint joint="leg0" coef="1"/></fixed></tendon>
  <equality><joint joint1="leg0" joint2="leg1"/></equality>
  <actuator><motor name="lift" joint="leg1"/><motor name="turn" joint="elbow" gear="2"/>
  <general name="wind" tendon="sum" dyntype="filter" dynprm="0.1"/></actuator>
  <keyframe><key name="bent" qpos="0.1 0.2 0.3 0.4" ctrl="1 2 3" act="4"/></keyframe></mujoco>"""
PART = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

#: The same in one file: in degrees, about x, y, z, and without classes of the top.
ONE = """<mujoco model="top"><compiler eulerseq="zyx"/><asset>
  <mesh name="own" vertex="0 0 0 2 0 0 0 2 0 0 0 2"/>
  <mesh name="x_part" file="parts/shapes/part.obj"/></asset>
  <worldbody><body name="base"><joint name="base" type="slide" damping="9" armature="1"/>
  <geom type="mesh" mesh="own"/><frame pos="0 0 1" euler="0 0 90">{parts}</frame></body>
  <body name="last" pos="9 0 0"><joint name="last" range="-30 30" damping="7" armature="1"/>
  <geom size="0.1" pos="1 0 0"/></body></worldbody>
  <tendon><fixed name="x_sum" stiffness="3"><joint joint="x_shoulder" coef="1"/>
  <joint joint="x_elbow" coef="2"/></fixed>{tendon}</tendon><equality>{equality}</equality>
  <actuator><motor name="push" joint="base"/>{lift}
  <motor name="x_turn" joint="x_elbow" gear="2"/>
  <general name="x_wind" tendon="x_sum" dyntype="filter" dynprm="0.1"/></actuator>{key}</mujoco>"""
UPPER = """<body name="x_upper" euler="{e}"><joint name="x_shoulder" range="{low} {high}"
  damping="3" frictionloss="0.1"/><geom size="0.05" pos="0 0.2 0" rgba="1 0 0 1"/>
  <inertial pos="0 0.2 0" mass="2" diaginertia="{J} {J} {J}"/>
  <frame pos="0 0 4"><body name="x_lower" pos="0 1 0"><joint name="x_elbow" axis="1 0 0" damping="3"
  frictionloss="0.1"/><geom name="x_part" type="mesh" mesh="x_part" density="4000" rgba="1 0 0 1"/>
  </body></frame></body>""".format(
    e=" ".join(repr(float(np.degrees(a))) for a in (0.1, 0.2, 0.3)),
    J=0.4 * 0.05**2 * 1000.0 * 4.0 / 3.0 * np.pi * 0.05**3,  # of its geom, before its bound
    low=-float(np.degrees(1.0)), high=float(np.degrees(1.0)),
)  # fmt: skip
SHELF = f'<frame pos="0 0.5 0">{UPPER}</frame>'
LEG = """<body name="x_leg{k}" pos="{k} 3 0"><joint name="x_leg{k}" type="slide" damping="2"/>
  <geom size="0.3" rgba="1 0 0 1"/></body>"""
ALL = f"""<geom name="x_post" size="0.2" pos="0 0 0.3" rgba="1 0 0 1"/>{SHELF}
  {LEG.format(k=0)}{LEG.format(k=1)}"""
LEGS = {
    "tendon": '<fixed name="x_legs" stiffness="2"><joint joint="x_elbow" coef="1"/>'
    '<joint joint="x_leg0" coef="1"/></fixed>',
    "equality": '<joint joint1="x_leg0" joint2="x_leg1"/>',
    "lift": '<motor name="x_lift" joint="x_leg1"/>',
}
NO_LEGS = dict.fromkeys(LEGS, "")
ATTACH = '<attach model="arm" prefix="x_" {}/>'


def written(folder, top, arm=ARM):
    """The files of both, and the path of the top."""
    (folder / "parts" / "shapes").mkdir(parents=True)
    (folder / "parts" / "shapes" / "part.obj").write_text(PART)
    (folder / "parts" / "arm.xml").write_text(arm)
    (folder / "top.xml").write_text(top)
    return folder / "top.xml"


def contents(path, folder, **options):
    """The file of the scene of a model, as data."""
    scene, report = dap.import_model(path, **options)
    report.save(scene, folder)
    data = tomllib.loads((folder / "scene.toml").read_text())
    del data["scene"]["description"]  # names the file
    return data


def flat(data, at=""):
    """All values in nested tables and lists, by where they are."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data)
    found = {}
    for key, value in pairs:
        here = f"{at}.{key}"
        found |= flat(value, here) if isinstance(value, dict | list) else {here: value}
    return found


def assert_same(one, other):
    """The same names, types and words, in the same order; numbers to the digits of degrees."""
    one, other = flat(one), flat(other)
    assert list(one) == list(other)
    numbers = [key for key, value in one.items() if isinstance(value, float)]
    assert {k: v for k, v in one.items() if k not in numbers} == {
        k: v for k, v in other.items() if k not in numbers
    }
    for key in numbers:
        assert one[key] == pytest.approx(other[key], rel=1e-13, abs=1e-14), key


CASES = pytest.mark.parametrize(
    ("which", "parts", "others"),
    [
        ("", ALL, LEGS),
        ('frame="shelf"', SHELF, NO_LEGS),
        ('body="upper"', UPPER, NO_LEGS),
    ],
)


@CASES
def test_an_attached_model_is_as_if_it_were_written_there(tmp_path, which, parts, others):
    path = written(tmp_path, TOP.format(attach=ATTACH.format(which), key=""))
    (tmp_path / "one.xml").write_text(ONE.format(parts=parts, key="", **others))
    found = contents(path, tmp_path / "a")
    assert_same(found, contents(tmp_path / "one.xml", tmp_path / "b"))
    assert "x_upper" in found["bodies"]


@CASES
def test_mujoco_makes_the_same_of_both(tmp_path, which, parts, others):
    """The one file is what it makes of the other: masses, places and accelerations in motion."""
    mujoco = pytest.importorskip("mujoco")
    written(tmp_path, TOP.format(attach=ATTACH.format(which), key=""))
    (tmp_path / "one.xml").write_text(ONE.format(parts=parts, key="", **others))
    found = []
    for name in ("top.xml", "one.xml"):
        model = mujoco.MjModel.from_xml_path(str(tmp_path / name))
        data = mujoco.MjData(model)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        data.qpos[:] += np.linspace(0.1, 0.3, model.nq)
        data.qvel[:], data.ctrl[:] = np.linspace(-0.1, 0.5, model.nv), 1.0
        mujoco.mj_forward(model, data)
        found.append((model.body_mass, data.xipos, data.qacc))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_a_body_is_attached_without_the_frames_around_it(tmp_path):
    """As MuJoCo has it, with the class that it would have there."""
    scene, _ = dap.import_model(
        written(tmp_path, TOP.format(attach=ATTACH.format('body="lower"'), key=""))
    )
    # its pose 0 1 0 in the frame that is turned about x, and raised, and a quarter of its edges
    np.testing.assert_allclose(scene.bodies["x_lower"].r, (0.25, -0.25, 2.25), atol=1e-15)
    damped = [f.fields["v_i"] for f in scene.forces.values() if f.fields.get("c") == 3.0]
    assert damped == ["x_lower.y"]
    assert set(scene.inputs) == {"push", "x_turn"}


@pytest.mark.parametrize(
    ("key", "same", "which"),
    [
        ("x_bent", 'qpos="0 0.1 0.2 0.3 0.4 0" ctrl="0 1 2 3" act="4"', ""),
        ("x_bent", 'qpos="0 0.1 0.2 0" ctrl="0 2 3" act="4"', 'body="upper"'),
        ("short", 'qpos="0.6 0.5 0 0 0 0" ctrl="7 0 0 0"', ""),
        ("own", 'qpos="1 0.1 0.2 0.3 0.4 0.5" ctrl="1 2 3 4" act="5"', ""),
    ],
)
def test_keyframes_of_both(tmp_path, key, same, which):
    """That of the arm is of its joints, or those attached; an own one has all, or the first."""
    keys = """<keyframe><key name="short" qpos="0.6 0.5" ctrl="7"/>
      <key name="own" qpos="1 0.1 0.2 0.3 0.4 0.5" ctrl="1 2 3 4" act="5"/></keyframe>"""
    path = written(tmp_path, TOP.format(attach=ATTACH.format(which), key="" if which else keys))
    parts, others = (UPPER, NO_LEGS) if which else (ALL, LEGS)
    one = ONE.format(parts=parts, key=f'<keyframe><key name="{key}" {same}/></keyframe>', **others)
    (tmp_path / "one.xml").write_text(one)
    found = contents(path, tmp_path / "a", key=key)
    assert_same(found, contents(tmp_path / "one.xml", tmp_path / "b", key=key))


def test_a_model_is_attached_twice_and_by_one_that_is_attached(tmp_path):
    """Each with its own prefix, and with all of those above it."""
    both = ATTACH.format("") + ATTACH.format("").replace("x_", "y_")
    path = written(tmp_path, TOP.format(attach=both, key=""))
    outer = """<mujoco><asset><model file="../top.xml"/></asset><worldbody>
      <attach model="top" prefix="z_"/></worldbody></mujoco>"""
    (tmp_path / "outer").mkdir()
    (tmp_path / "outer" / "all.xml").write_text(outer)
    names = {"base", "last"} | {
        f"{prefix}{name}" for prefix in ("x_", "y_") for name in ("upper", "lower", "leg0", "leg1")
    }
    scene, _ = dap.import_model(path)
    assert set(scene.bodies) >= names
    whole, report = dap.import_model(tmp_path / "outer" / "all.xml", root=tmp_path)
    for name in names:
        one, other = scene.bodies[name], whole.bodies[f"z_{name}"]
        np.testing.assert_array_equal(one.r, other.r)
        assert one.mass == other.mass
    assert list(whole.inputs) == [f"z_{name}" for name in scene.inputs]
    assert "shapes/part.obj" not in str(report.left_out)


WRONG = {
    "no model": (ATTACH.format("").replace("arm", "leg"), "no model 'leg' in <asset>; models: arm"),
    "no body": (ATTACH.format('body="q"'), "no body 'q' in model 'arm'; it has upper, lower, leg0"),
    "no frame": (ATTACH.format('frame="q"'), "no frame 'q' in model 'arm'; it has shelf"),
    "both": (ATTACH.format('frame="shelf" body="leg"'), "body or frame, not both"),
    "no prefix": ('<attach model="arm"/>', "has no prefix; it is required"),
    "no name": ('<attach prefix=""/>', "<attach> has no model; it is required"),
    "twice": (2 * ATTACH.format(""), "two of <geom> 'x_post' with it"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_attached(tmp_path, case):
    attach, said = WRONG[case]
    with pytest.raises(dap.SceneError, match=said) as error:
        dap.import_model(written(tmp_path, TOP.format(attach=attach, key="")))
    assert "top.xml:6" in str(error.value)


def test_files_that_cannot_be_attached(tmp_path):
    top, path = TOP.format(attach=ATTACH.format(""), key=""), tmp_path / "top.xml"
    written(tmp_path, top.replace("parts/arm.xml", "arm.xml"))
    with pytest.raises(dap.SceneError, match=r"top.xml:1: there is no file arm.xml"):
        dap.import_model(path)
    path.write_text(top.replace("parts/arm.xml", "../arm.xml"))
    with pytest.raises(dap.SceneError, match="lies outside of the folder of the model"):
        dap.import_model(path)
    path.write_text(top)
    (tmp_path / "parts" / "arm.xml").write_text('<robot name="arm"/>')
    with pytest.raises(dap.SceneError, match=r"arm.xml:1: an MJCF file is a <mujoco>, not a <rob"):
        dap.import_model(path)
    (tmp_path / "parts" / "arm.xml").write_text(top.replace("parts/arm", "../top"))
    with pytest.raises(dap.SceneError, match=r"includes itself: top.xml -> arm.xml -> top.xml"):
        dap.import_model(path)


@pytest.mark.slow
def test_attached_models_have_a_bound(tmp_path):
    """Nine that attach nine each, of five levels, would be of 59049 arms."""
    for k in range(6):
        inner = '<attach model="m" prefix="{}"/>' if k < 5 else '<body><geom size="1"/></body>'
        text = "".join(inner.format(f"{n}_") for n in range(9))
        (tmp_path / f"{k}.xml").write_text(f"""<mujoco><asset><model name="m" file="{k + 1}.xml"/>
          </asset><worldbody>{text}</worldbody></mujoco>""")
    with pytest.raises(dap.SceneError, match="more than"):
        dap.import_model(tmp_path / "0.xml")


def test_each_attached_file_is_read_once(tmp_path, monkeypatch):
    """Files that attach the next one twice: one of 2^24 elements is refused at the bound."""
    monkeypatch.setattr(copies, "MOST_COPIES", 2000)
    read, include = [], SourceFiles.include
    monkeypatch.setattr(SourceFiles, "include", lambda self, name, *more: (
        read.append(name), include(self, name, *more))[1])  # fmt: skip
    for k in range(25):
        twice = '<attach model="m" prefix="a"/><attach model="m" prefix="b"/>' if k < 24 else ""
        (tmp_path / f"{k}.xml").write_text(f"""<mujoco><asset><model name="m" file="{k + 1}.xml"/>
          </asset><worldbody>{twice}</worldbody></mujoco>""")
    with pytest.raises(dap.SceneError, match="more than 2000 elements"):
        dap.import_model(tmp_path / "0.xml")
    assert sorted(read) == sorted(f"{k + 1}.xml" for k in range(24))


def test_options_of_an_attached_model_are_those_of_the_top(tmp_path):
    """As in MuJoCo, which says so."""
    path = written(tmp_path, TOP.format(attach=ATTACH.format(""), key=""))
    scene, report = dap.import_model(path)
    assert scene.forces["gravity"].fields["gravity"] == 9.81
    assert "arm.xml:2: <option> of an attached model" in str(list(map(str, report.left_out)))
