"""Height fields of MJCF, which MuJoCo's documentation describes under asset/hfield."""

import numpy as np
import pytest
from PIL import Image

import dap3d_core as dap

#: Rows of a file begin at the greatest y, those of MuJoCo's ``hfield_data`` at the least.
ROWS = np.array([[0, 51, 102], [153, 204, 255]], dtype=np.uint8)
MJCF = """<mujoco><asset><hfield name="hill" size="2 1 0.5 0.1" {hfield}/></asset><worldbody>
  <geom type="hfield" hfield="{geom}" pos="0 0 1"/>
  <body pos="0 0 3"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""


def imported(folder, hfield, geom="hill"):
    (folder / "a.xml").write_text(MJCF.format(hfield=hfield, geom=geom))
    return dap.import_model(folder / "a.xml", contacts=True)


@pytest.mark.parametrize(
    ("mode", "scale"), [("L", 1), ("RGB", 1), ("RGBA", 1), ("I;16", 257), (None, 1)]
)
def test_a_height_field_is_of_an_image_or_of_numbers(tmp_path, mode, scale):
    """Red counts, and of 16 bits the upper ones; the least height is 0, the greatest that of size.

    Columns are along x, rows from the last one along y.
    """
    hfield = f'nrow="2" ncol="3" elevation="{" ".join(map(str, ROWS.ravel() + 7.0))}"'
    if mode is not None:
        hfield, image = 'file="hill.png"', Image.fromarray(ROWS)
        if mode.startswith("I"):
            image = Image.fromarray(ROWS.astype(np.uint16) * scale)
        (image if mode.startswith("I") else image.convert(mode)).save(tmp_path / "hill.png")
    scene, report = imported(tmp_path, hfield)
    (field,) = [one for one in scene.shapes.values() if one.type == "height_field"]
    np.testing.assert_allclose(field.fields["heights"], 0.5 / 255.0 * ROWS[::-1].T, atol=1e-15)
    assert (field.fields["size"], field.fields["at"]) == ((4.0, 2.0), (0.0, 0.0, 1.0))
    assert field.fields["collides"]
    assert not report.left_out


def test_a_height_field_without_heights_is_flat(tmp_path):
    """As in MuJoCo, where a program fills it in."""
    scene, _ = imported(tmp_path, 'nrow="100" ncol="100"')
    (field,) = [one for one in scene.shapes.values() if one.type == "height_field"]
    assert field.fields["heights"] == ((0.0, 0.0), (0.0, 0.0))


@pytest.mark.parametrize(
    ("hfield", "geom", "said"),
    [
        ("", "valley", "a.xml:2: there is no hfield 'valley' in <asset>"),
        ('nrow="2" ncol="3" elevation="1 2"', "hill", "a.xml:1: elevation should be nrow times"),
        ('file="a.xml"', "hill", "a.xml:1: a.xml is no PNG image"),
        ('file="large.png"', "hill", "a.xml:1: large.png has more than 1000000 pixels"),
        ('file="thin.png"', "hill", "a.xml:1: a height field should have two rows and columns"),
    ],
)
def test_a_height_field_that_is_wrong_is_refused(tmp_path, hfield, geom, said):
    Image.new("L", (1001, 1000)).save(tmp_path / "large.png")
    Image.new("L", (1, 5)).save(tmp_path / "thin.png")
    with pytest.raises(dap.SceneError, match=said):
        imported(tmp_path, hfield, geom)


def test_a_height_field_whose_file_is_missing_is_said_first(tmp_path):
    _, report = imported(tmp_path, 'file="hill.png"')
    assert report.left_out[0].motion
    assert "there is no file hill.png" in report.left_out[0].text
