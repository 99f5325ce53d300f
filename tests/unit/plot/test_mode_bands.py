"""Bands of the modes of contacts behind curves."""

import pytest
from matplotlib.figure import Figure

import dap3d_core as dap
from dap3d_core.plot.curves import curve_picture
from dap3d_core.plot.mode_bands import Band


@pytest.fixture(scope="module")
def rolls():
    """A ball that slides until 2/7 v / (mu g), then rolls; a second one that stays."""
    scene = dap.Scene(name="rolls")
    for name, x, v in (("ball", 0.0, 3.0), ("other", 5.0, 0.0)):
        body = {"mass": 2.0, "Jp": [0.008] * 3}
        scene.add_body(name, r=[x, 0.0, 0.1], r_dot=[v, 0.0, 0.0], **body)
    scene.add_force("weight", "g")
    for name, on in (("ball", "floor"), ("other", "more")):
        scene.add_contact("ball_plane", on, P_i=f"{name}.O", radius=0.1, mu=0.3)
    return dap.simulate(scene, t_end=1.0, dt=0.1)


def test_bands_change_at_the_event_between_two_reports(rolls):
    t = 2.0 / 7.0 * 3.0 / (0.3 * 9.81)
    (bands,) = curve_picture(rolls, ["floor.normal"], None).bands.values()
    assert bands == [Band(0.0, pytest.approx(t, abs=1e-6), 1), Band(bands[0].end, 1.0, 2)]


def test_no_bands_of_two_contacts_or_of_none_or_over_another_quantity(rolls):
    assert not curve_picture(rolls, ["floor.gap", "more.gap"], None).bands["m"]
    assert not curve_picture(rolls, ["ball.r.x"], None).bands["m"]
    assert not curve_picture(rolls, ["floor.normal"], "ball.r.x").bands


def test_a_panel_has_a_patch_for_each_band_and_a_word_for_each_mode(rolls):
    (ax,) = curve_picture(rolls, ["floor.normal"], None).draw(Figure())
    assert len(ax.patches) == 2
    assert [text.get_text() for text in ax.texts] == ["slides", "sticks"]
