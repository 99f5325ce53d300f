"""What a page holds equals the result; what it draws follows the scene; it loads nothing."""

import base64
import html
import json
import re
from importlib.resources import files

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.result import UnknownNameError


def numbers(text, kind="<f4"):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


@pytest.fixture(scope="module")
def four():
    return dap.simulate("fourbar3", t_end=0.1, dt=0.01)


@pytest.fixture(scope="module")
def page(four):
    return dap.view(four, "crank.r.z", "J1.force.norm")


def test_instants_and_poses_are_those_of_the_result(four, page):
    np.testing.assert_array_equal(numbers(page.data["t"], "<f8"), four.t)
    poses = numbers(page.data["poses"]).reshape(len(four.t), 3, 7)
    np.testing.assert_array_equal(poses[..., :3], four.r.astype(np.float32))
    np.testing.assert_array_equal(poses[..., 3:], four.p.astype(np.float32))


def test_curves_are_quantities_of_the_result(four, page):
    series = {s["name"]: s for s in page.data["series"]}
    assert page.data["asked"] == ["crank.r.z", "J1.force.norm"]
    for name in ("energy.total", "crank.r.z", "J1.force.norm"):
        values = numbers(series[name]["values"], "<f8")
        np.testing.assert_array_equal(values, four.quantity(name).values)
    assert series["J1.force.norm"]["unit"] == "N"


def test_outputs_and_joint_coordinates_are_curves():
    """At some of the instants, too, with turns and rates of all."""
    scene = dap.load("fourbar3")
    scene.add_output("lift", "crank.r.z - follower.r.z")
    result = dap.simulate(scene, t_end=0.1, dt=0.01)
    page = dap.view(result, "J1.angle", fps=50.0)
    series = {s["name"]: s for s in page.data["series"]}
    for name in ("lift", "J1.angle"):
        values = numbers(series[name]["values"], "<f8")
        np.testing.assert_array_equal(values, result.quantity(name).values[::2])
    rates = numbers(series["J1.angle"]["rates"], "<f8")
    np.testing.assert_array_equal(rates, result.quantity("J1.angle_rate").values[::2])


def test_a_thinned_page_says_so_and_keeps_exact_poses(four):
    page = dap.view(four, fps=50.0)
    assert page.instants == 6
    assert "6 of 11 reported instants are on this page" in page.data["about"]["view_notes"]
    poses = numbers(page.data["poses"]).reshape(6, 3, 7)
    np.testing.assert_array_equal(poses[1, :, :3], four.r[2].astype(np.float32))


def test_what_cannot_be_shown_is_refused(four):
    with pytest.raises(UnknownNameError, match=r"crank\.r"):
        dap.view(four, "crnk.r")
    for fps in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="fps"):
            dap.view(four, fps=fps)


CUBE = """\
solid cube
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid
"""


def shaped(tmp_path):
    scene = dap.Scene(name="shaped </script><!--")
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.1, 0.1), color="tab:red")
    scene.add_shape("box", "case", body="b", size=(0.1, 0.2, 0.3), at=(0.0, 0.0, 0.5))
    scene.add_shape("line", "edge", body="b", points=((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    scene.add_shape("mesh", "part", body="b", file="cube.stl", scale=0.5)
    scene.add_force("weight")
    (tmp_path / "cube.stl").write_text(CUBE)
    scene.save(tmp_path / "scene.toml")
    return dap.load(tmp_path)


def test_three_js_has_what_the_page_uses_and_nothing_else():
    folder = files("dap3d_core.view")
    program = "".join(part.read_text() for part in (folder / "assets" / "js").iterdir())
    used = set(re.findall(r"\bTHREE\.(\w+)", program))
    bundle = (folder / "vendor" / "three.min.js").read_text()
    exported = set(re.findall(r"(\w+):\(\)=>\w+[,}]", bundle[:4000]))
    assert used == exported
    assert (folder / "vendor" / "VERSION").read_text().split()[1] in bundle[:60]
    assert "MIT" in (folder / "vendor" / "LICENSE").read_text()


def test_numbers_that_json_does_not_have_become_words(page):
    json.loads(json.dumps(page.data, allow_nan=False))
    assert page.data["about"]["ledger"]["energy"]["ok"] in (True, False, None)
    assert page.data["about"]["versions"]["dap3d"]


def test_a_notebook_shows_the_same_page(page):
    frame = page._repr_html_()
    inside = re.fullmatch(r'<iframe srcdoc="([^"]*)".*</iframe>', frame, flags=re.DOTALL)[1]
    assert html.unescape(inside) == page.html


def test_a_result_whose_types_are_gone_is_still_shown(tmp_path):
    run = dap.simulate("ball1", t_end=0.1, dt=0.05, allow_code=True)
    run.save(tmp_path / "ball1.nc")
    data = dap.view(dap.open(tmp_path / "ball1.nc")).data
    assert "joints and forces are not drawn" in data["about"]["view_notes"][0]
    assert data["marks"]
    whole = dap.view(dap.open(tmp_path / "ball1.nc", model="ball1", allow_code=True)).data
    assert whole["about"]["view_notes"] == []
    assert whole["stage"]["gravity"] == (0.0, 0.0, -9.81)
