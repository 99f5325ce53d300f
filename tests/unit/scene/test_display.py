"""Representations of scenes and reports at a prompt and in notebooks; texts are escaped."""

from html.parser import HTMLParser

import pytest

import dap3d_core as dap

HOSTILE = "<img src=x onerror=alert(1)>&\"'\n\x1b[31m"
#: The tags that tables of ours have.
TAGS = {"p", "strong", "table", "tr", "td", "th"}


class Seen(HTMLParser):
    """Tags, attributes and text of a piece of HTML."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.names, self.text = set(), set(), ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.names |= {name for name, _ in attributes}

    def handle_data(self, data):
        self.text += data


def test_a_scene_is_a_line_at_a_prompt_and_tables_in_a_notebook():
    scene = dap.load("fourbar3")
    assert repr(scene).startswith("<Scene 'fourbar3': 3 bodies, ")
    assert "\n" not in repr(scene)
    shown = Seen(scene._repr_html_())
    for name in (*scene.bodies, *scene.joints, *scene.forces):
        assert name in shown.text
    assert repr(dap.Scene()) == "<Scene '': empty>"


def test_texts_of_a_scene_are_no_html():
    scene = dap.Scene(name=HOSTILE, description=HOSTILE)
    scene.add_body("a", color=HOSTILE)
    scene.add_force("f", "<b onclick=x>", body_i=HOSTILE, f=[0.0, 0.0, 1.0])
    shown = Seen(scene._repr_html_())
    assert shown.tags <= TAGS
    assert not shown.names
    assert HOSTILE in shown.text
    assert "\x1b" not in repr(scene)


def test_of_many_bodies_a_notebook_shows_the_first():
    scene = dap.Scene(name="many")
    for k in range(200):
        scene.add_body(f"b{k}")
    rows = scene._repr_html_().count("<tr>") - 2  # a head, and what is left out
    assert rows < 100
    assert f"{200 - rows} more" in scene._repr_html_()


@pytest.mark.slow
def test_a_report_shows_its_settings():
    scene = dap.load("pen1")
    report = dap.report(scene, t_end=0.1, methods=["standard"], integrators=["dop853"], repeat=1)
    assert "pen1" in repr(report)
    assert len(repr(report)) < 400
    shown = Seen(report._repr_html_())
    assert shown.tags <= TAGS
    assert report._repr_html_().count("<tr>") == 1 + len(report.runs)


def test_a_sweep_is_a_line_at_a_prompt_and_tables_in_a_notebook(tmp_path):
    """Also from a file, and what is selected of it; what is no sweep any more is xarray's."""
    scene = dap.Scene(name=HOSTILE)
    scene.add_body("a", r_dot=[1.0, 0.0, 0.0])
    vary = {"bodies.a.mass": [1.0, 2.0], "simulation.rtol": [1e-6, 1e-7, 1e-8]}
    sweep = dap.sweep(
        scene, vary, outputs=["a.r.x", "a.r.x:series"], output=tmp_path / "a.nc", t_end=0.1, dt=0.1
    )
    assert repr(sweep).startswith("<Sweep '<img ")
    words = "2 x 3 points (bodies.a.mass, simulation.rtol), 6 done; a.r.x, a.r.x:series>"
    assert repr(sweep).endswith(words)
    assert "\n" not in repr(sweep)
    assert "\x1b" not in repr(sweep)
    shown = Seen(sweep._repr_html_())
    assert shown.tags <= TAGS
    assert not shown.names
    for text in ("bodies.a.mass", "kg", "1e-08", "a.r.x:series", "bodies.a.mass x simulation.rtol"):
        assert text in shown.text
    assert "1 x 3 points" in repr(sweep.isel({"bodies.a.mass": [0]}))
    assert repr(sweep[["a.r.x"]]).startswith("<xarray")
    assert "xr-" in sweep[["a.r.x"]]._repr_html_()
