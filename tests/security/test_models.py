"""URDF, SDF and MJCF files from strangers: nothing is run, fetched or read elsewhere."""

import os
import sys

import pytest
from support.internals import source_files
from support.process import REPOSITORY

import dap3d_core as dap

ARM = (REPOSITORY / "tests" / "data" / "formats" / "arm.urdf").read_text()
BOX = '<box size="1 0.1 0.1"/>'
CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def refusal(path, text, **options):
    """What is said of a file."""
    path.write_text(text, encoding="utf-8")
    with pytest.raises(dap.SceneError) as caught:
        dap.import_model(path, **options)
    return str(caught.value)


@pytest.mark.parametrize(
    "head",
    [
        '<!DOCTYPE a [<!ENTITY b "bbb"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>',
        '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd">',
        '<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1:9/a"> %p;]>',
    ],
)
@pytest.mark.parametrize("name", ["a.urdf", "a.sdf", "a.xml"])
def test_a_document_type_is_refused(tmp_path, head, name):
    """With it entities, external ones too, and bombs of them; nothing is fetched."""
    events = []
    sys.addaudithook(lambda event, _: events.append(event) if "socket" in event else None)
    said = refusal(tmp_path / name, f'{head}<robot name="&b;"/>')
    assert f"{name}:1: has a document type" in said
    assert not events


def test_deep_and_many_elements_are_refused(tmp_path, monkeypatch):
    deep = "<robot>" + "<a>" * 100_000
    assert "nested 200 deep" in refusal(tmp_path / "a.urdf", deep)
    monkeypatch.setattr("dap3d_core.interface.formats.xml_tree.MOST_ELEMENTS", 1000)
    many = "<robot>" + "<a/>" * 1000 + "</robot>"
    assert "more than 1000 elements" in refusal(tmp_path / "a.urdf", many)


def test_a_large_file_is_not_read(tmp_path):
    with (tmp_path / "a.urdf").open("wb") as file:
        file.truncate(source_files.LARGEST + 1)
    with pytest.raises(dap.SceneError, match="more than 64 MiB"):
        dap.import_model(tmp_path / "a.urdf")


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("../secret.obj", "outside of the folder"),
        ("/etc/passwd", "outside of the folder"),
        ("file:///etc/passwd", "outside of the folder"),
        ("meshes/../../secret.obj", "outside of the folder"),
        ("package://p/../secret.obj", "outside of the folder"),
        ("link.obj", "outside of the folder"),
    ],
)
def test_meshes_elsewhere_are_refused(tmp_path, uri, words):
    """Also behind links; the message has the line and says what to do."""
    folder, package = tmp_path / "model", tmp_path / "p"
    folder.mkdir()
    package.mkdir()
    (tmp_path / "secret.obj").write_text(CUBE)
    if os.name == "posix":
        (folder / "link.obj").symlink_to(tmp_path / "secret.obj")
    text = ARM.replace(BOX, f'<mesh filename="{uri}"/>')
    said = refusal(folder / "arm.urdf", text, packages={"p": package})
    assert words in said
    assert "arm.urdf:14: " in said


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("package://nowhere/../../secret.obj", "the package nowhere is not known"),
        ("package://link/secret.obj", "the package link is not known"),
        ("package://below/secret.obj", "the package below is not known"),
        ("http://127.0.0.1:9/a.stl", "nothing is fetched"),
    ],
)
def test_meshes_of_unknown_places_are_left_out(tmp_path, uri, words):
    """A link to a folder elsewhere, beside the file or further below, is no package."""
    folder, secret = tmp_path / "model", tmp_path / "secret"
    for place in (folder / "deep", secret):
        place.mkdir(parents=True)
    (secret / "secret.obj").write_text(CUBE)
    if os.name == "posix":
        (folder / "link").symlink_to(secret)
        (folder / "deep" / "below").symlink_to(secret)
    path = folder / "arm.urdf"
    path.write_text(ARM.replace(BOX, f'<mesh filename="{uri}"/>'))
    scene, report = dap.import_model(path)
    [said] = [one.text for one in report.left_out if "its shape is not drawn" in one.text]
    assert words in said
    assert not scene.files


def test_no_file_has_a_name_that_is_too_long(tmp_path):
    """Whatever the file system says of it; nor has one that the user names."""
    name = f"{'x' * 5000}.xml"
    text = f'<mujoco><include file="{name}"/></mujoco>'
    assert "there is no file x" in refusal(tmp_path / "a.xml", text)
    with pytest.raises(dap.SceneError, match="xml: there is no such file"):
        dap.import_model(name)
    with pytest.raises(dap.SceneError, match="is no folder"):
        dap.import_model(tmp_path / "a.xml", root=name)


def test_a_package_that_the_user_names_is_read(tmp_path):
    folder, package = tmp_path / "model", tmp_path / "p"
    folder.mkdir()
    package.mkdir()
    (package / "cube.obj").write_text(CUBE)
    path = folder / "arm.urdf"
    path.write_text(ARM.replace(BOX, '<mesh filename="package://p/cube.obj" scale="2 2 2"/>'))
    scene, report = dap.import_model(path, packages={"p": package})
    target = report.save(scene, tmp_path / "out")
    assert (target.parent / "meshes" / "cube.obj").read_text() == CUBE
    assert dap.load(target).shapes["upper_mesh"].fields["scale"] == 2.0


def test_cyclic_includes_are_refused(tmp_path):
    (tmp_path / "b.xml").write_text('<mujoco>\n<include file="a.xml"/></mujoco>')
    said = refusal(tmp_path / "a.xml", '<mujoco><include file="b.xml"/></mujoco>')
    assert "b.xml:2: the file includes itself: a.xml -> b.xml -> a.xml" in said
    (tmp_path / "b.sdf").write_text(
        '<sdf><model name="m"><include><uri>a.sdf</uri></include></model></sdf>'
    )
    text = '<sdf><model name="m"><include><uri>b.sdf</uri></include></model></sdf>'
    assert "the file includes itself" in refusal(tmp_path / "a.sdf", text)


def test_includes_that_double_are_refused(tmp_path):
    """Thirty files that each include the next one twice would be a billion."""
    for k in range(30):
        twice = f'<include file="{k + 1}.xml"/>' * 2
        (tmp_path / f"{k}.xml").write_text(f"<mujoco>{twice}</mujoco>")
    (tmp_path / "30.xml").write_text("<mujoco/>")
    with pytest.raises(dap.SceneError, match="includes more than 500 files"):
        dap.import_model(tmp_path / "0.xml")


def test_macros_are_not_evaluated(tmp_path):
    """An expression of xacro is Python; without leave it is not looked at."""
    text = (
        '<robot xmlns:xacro="x" name="${open(\'hacked\', \'w\')}"><xacro:macro name="a"/></robot>'
    )
    said = refusal(tmp_path / "a.xacro", text)
    assert "is not evaluated" in said
    assert "--allow-code" in said
    assert "is not evaluated" in refusal(tmp_path / "a.urdf", text)
    assert not (tmp_path / "hacked").exists()
    assert "xacrodoc" not in sys.modules


def test_a_mesh_whose_mass_counts_has_limits(tmp_path, monkeypatch):
    pytest.importorskip("trimesh")
    text = (
        '<mujoco><asset><mesh name="m" file="m.obj"/></asset><worldbody><body><freejoint/>'
        '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    (tmp_path / "a.xml").write_text(text)
    (tmp_path / "m.obj").write_text(CUBE)
    scene, _ = dap.import_model(tmp_path / "a.xml")
    assert scene.bodies["body1"].mass == pytest.approx(1000.0 / 6.0, rel=1e-12)
    monkeypatch.setattr(source_files, "MOST_TRIANGLES", 3)
    assert "more than 3 triangles" in refusal(tmp_path / "a.xml", text)


def test_saving_does_not_leave_the_folder(tmp_path):
    """Names of meshes become plain names below the scene's folder."""
    (tmp_path / "a b;c.obj").write_text(CUBE)
    (tmp_path / "arm.urdf").write_text(ARM.replace(BOX, '<mesh filename="a b;c.obj"/>'))
    _, report = dap.import_model(tmp_path / "arm.urdf")
    assert list(report.meshes.values()) == ["meshes/a_b_c.obj"]
