"""Files that a model names: nested and included models, and where they lie."""

import numpy as np
import pytest
from support.internals import FormatError, source_files
from support.rotations import rotation

import dap3d_core as dap

INNER = """
<sdf version="1.9"><model name="finger">
  <frame name="mount"><pose>0 0 0.1 0 0 0</pose></frame>
  <link name="tip"><pose>0 0.2 0 0 0 0</pose>
    <inertial><mass>2</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
  </link>
</model></sdf>
"""
OUTER = """
<sdf version="1.9"><world name="w">
  <model name="hand">
    <pose>1 2 3 0 0 1.5707963267948966</pose>
    <link name="palm"><inertial><mass>1</mass></inertial></link>
    <include><uri>model://parts/finger.sdf</uri><name>thumb</name>
      <pose relative_to="palm">0.5 0 0 0 0 0</pose>
      <placement_frame>mount</placement_frame></include>
    <joint name="knuckle" type="revolute"><pose relative_to="thumb::mount"/>
      <parent>palm</parent><child>thumb::tip</child>
      <axis><xyz expressed_in="__model__">0 1 0</xyz></axis></joint>
  </model>
  <model name="base"><static>true</static><link name="block"/></model>
</world></sdf>
"""

CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
TWO = """<robot name="r"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1"/></inertial>
<visual><geometry><mesh filename="{}"/></geometry></visual>
<visual><geometry><mesh filename="{}"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/></joint></robot>"""


def test_frames_of_included_models(tmp_path):
    """The thumb's frame mount lies at (0.5, 0, 0) of the palm, which is turned by a quarter."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "finger.sdf").write_text(INNER)
    (tmp_path / "model").mkdir()
    path = tmp_path / "model" / "hand.sdf"
    path.write_text(OUTER)
    scene, _ = dap.import_model(path, packages={"parts": tmp_path / "parts"})
    assert list(scene.bodies) == ["hand::palm", "hand::thumb::tip"]
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    mount = [1, 2, 3] + turn @ [0.5, 0, 0]
    tip = scene.bodies["hand::thumb::tip"]
    np.testing.assert_allclose(tip.r, mount + turn @ [0, 0.2, -0.1], atol=1e-15)
    np.testing.assert_allclose(rotation(np.array(tip.p)), turn, atol=1e-15)
    joint = scene.joints["hand::knuckle"].fields
    point, axis = scene.points[joint["P_j"]], joint["a_j"]
    assert (point.body, axis) == ("hand::palm", "hand::palm.y")
    np.testing.assert_allclose(point.sPp, (0.5, 0, 0), atol=1e-15)


def test_models_within_the_only_model_of_a_file_lie_in_its_frame(tmp_path):
    """Both that written there, and that included, half a metre along its x, which is ground's y."""
    (tmp_path / "finger.sdf").write_text(INNER.replace("0 0.2 0 0", "0 0.0 0 0"))
    inertial = "<inertial><mass>1</mass></inertial></link>"
    place = "<pose>0.5 0 0 0 0 0</pose>"
    (tmp_path / "hand.sdf").write_text(
        '<sdf version="1.9"><model name="hand"><pose>1 2 3 0 0 1.5707963267948966</pose>'
        f'<link name="palm">{inertial}<model name="thumb">{place}<link name="tip">{inertial}'
        f"</model><include><uri>finger.sdf</uri><name>little</name>{place}</include></model></sdf>"
    )
    scene, _ = dap.import_model(tmp_path / "hand.sdf")
    for name in ("thumb::tip", "little::tip"):
        np.testing.assert_allclose(scene.bodies[name].r, [1.0, 2.5, 3.0], atol=1e-15)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        ("\ufeffé 1\n".encode(), "é 1\n"),
        (b"1\n2 \xff\n", "a.txt:2: 0xff is no character of UTF-8\n    save it as UTF-8"),
    ],
    ids=["UTF-8", "Latin-1"],
)
def test_text_is_utf_8(tmp_path, data, found):
    """With or without its mark; of another character the line is named."""
    path = tmp_path / "a.txt"
    path.write_bytes(data)
    try:
        text = source_files.SourceFiles(path, tmp_path).read_text()
    except FormatError as error:
        text = str(error)
    assert text == found


@pytest.mark.parametrize("inside", [True, False])
def test_a_package_above_or_beside_the_file_is_found_within_the_root(tmp_path, inside):
    """Of its own name: the folder of a robot, or one next to it; none outside of the root."""
    folder = tmp_path / "arms" / "urdf"
    for place in (folder, tmp_path / "hands"):
        place.mkdir(parents=True)
    (tmp_path / "arms" / "a.obj").write_text(CUBE)
    (tmp_path / "hands" / "b.obj").write_text(CUBE)
    text = TWO.format("package://arms/a.obj", "package://hands/b.obj")
    (folder / "m.urdf").write_text(text)
    if inside:
        scene, _ = dap.import_model(folder / "m.urdf", root=tmp_path)
        assert sorted(path.name for path in scene.files.values()) == ["a.obj", "b.obj"]
    else:
        scene, report = dap.import_model(folder / "m.urdf", root=folder)
        said = [str(one) for one in report.left_out if "is not known" in one.text]
        assert "the package arms is not known: its shape is not drawn; name its folder" in said[0]
        assert (len(said), scene.files) == (2, {})


def test_meshes_that_are_nowhere_are_remarked_and_those_elsewhere_refused(tmp_path):
    """Paths of another machine, and out of the folder."""
    (tmp_path / "m").mkdir()
    path = tmp_path / "m" / "m.urdf"
    path.write_text(TWO.format("/home/of/another/a.obj", "../../gone/b.obj"))
    scene, report = dap.import_model(path)
    gone = [one.text for one in report.left_out if "there is no file" in one.text]
    assert (len(gone), scene.files) == (2, {})
    (tmp_path / "b.obj").write_text(CUBE)
    path.write_text(TWO.format("../b.obj", "../b.obj"))
    with pytest.raises(dap.SceneError, match="lies outside of the folder"):
        dap.import_model(path)


WORLD = """<sdf version="1.6"><model name="gripper"><pose>0 0 2 3.141592653589793 0 0</pose>
<link name="world"/><link name="base"><pose>0 0 0.5 0 0 0</pose></link>
<joint name="lift" type="prismatic"><parent>world</parent><child>base</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""


def test_an_empty_link_of_sdf_named_world_is_the_world(tmp_path):
    (tmp_path / "a.sdf").write_text(WORLD)
    scene, report = dap.import_model(tmp_path / "a.sdf")
    np.testing.assert_allclose(scene.bodies["base"].r, (0.0, 0.0, 1.5), atol=1e-15)
    assert scene.joints["lift"].fields["P_j"].partition(".")[0] != "base"
    assert any("named world is the world itself" in one.text for one in report.translated)
