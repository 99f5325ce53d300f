"""``dap3d plot`` and ``dap3d view`` of a sweep; a real browser chooses points of its page."""

import json
import re

import matplotlib.image
import numpy as np
import pytest
import xarray
from support import hostile
from support.pages import follow
from support.process import REPOSITORY
from support.rotations import to_global

import dap3d_core as dap

pytestmark = pytest.mark.slow  # a browser that draws without a graphics card

MASS, WY = "bodies.cone.mass", "bodies.cone.w.y"
TIMES = {"t_end": 0.4, "dt": 0.02}


@pytest.fixture(scope="module")
def swept():
    """The spinning cone: three masses, one of which cannot be, and two spins."""
    vary = {MASS: [-1.0, 1.0, 4.0], WY: [-10.0, -4.0]}
    return dap.sweep("pen1", vary, outputs=["cone.r.z:min", "J1.force.norm:max"], **TIMES)


@pytest.fixture(scope="module")
def page(swept, tmp_path_factory):
    return dap.view(swept).save(tmp_path_factory.mktemp("view") / "sweep.html")


@pytest.fixture
def opened(show, page):
    return show(page)


@pytest.fixture
def file(dap3d):
    """A sweep in the folder of the command line."""
    vary = {MASS: [1.0, 2.0, 4.0], WY: [-10.0, -4.0]}
    outputs = ["cone.r.z:min", "J1.force.norm:max"]
    dap.sweep("pen1", vary, outputs=outputs, output=dap3d.folder / "s.nc", **TIMES)
    return "s.nc"


def test_plot_draws_a_sweep(dap3d, refuse, file):
    done = dap3d.succeed("plot", file)
    assert "s.png written" in done.stdout
    cut = dap3d("plot", file, "J1.force.norm:max", "--at", f"{MASS}=2", "-o", "a.svg", "--json")
    assert json.loads(cut.stdout) == {
        "file": "a.svg",
        "size_bytes": (dap3d.folder / "a.svg").stat().st_size,
        "results": [file],
        "quantities": ["J1.force.norm:max"],
        "x": None,
        "at": {MASS: 2.0},
        "notes": [],
    }
    drawn = (dap3d.folder / "a.svg").read_text()
    assert f"{MASS} = 2 kg" in drawn
    assert f"{WY} [rad/s]" in drawn
    both = refuse("plot", file, "J1.force.nrm:max", "--at", "bodies.cone.w.z=1", "-o", "b.png")
    assert "did you mean 'J1.force.norm:max'" in both
    assert f"did you mean '{WY}'" in both
    for word in ("mass", f"{MASS}=", f"{MASS}=x", "=1", f"{MASS}=nan"):
        assert "should be NAME=VALUE" in refuse("plot", file, "--at", word, "-o", "b.png")
    twice = ("--at", f"{MASS}=1", "--at", f"{MASS}=2")
    assert "is given twice" in refuse("plot", file, *twice, "-o", "b.png")
    assert "is drawn alone" in refuse("plot", file, "other.nc", "-o", "b.png")
    dap.simulate("pen1", **TIMES).save(dap3d.folder / "run.nc")
    assert "run.nc is none" in refuse("plot", "run.nc", "--at", f"{MASS}=1", "-o", "b.png")


#: Of the sweeps on the page fewer points.
FEWER = ((":5:11", ":5:3"), ("=5:8:5", "=5:8:3"), ("--sample 60", "--sample 5"), ("== 11", "== 3"))


@pytest.mark.parametrize("changes", [pytest.param((), marks=pytest.mark.long), FEWER])
def test_the_page_and_its_pictures(tmp_path, monkeypatch, changes):
    """Its steps, in their order, make its pictures, as far as the letters of another version of
    matplotlib let them: seen from afar."""
    page = REPOSITORY / "docs" / "how-to" / "look-at-sweeps.md"
    pictures = re.findall(r"!\[.*\]\((.*)\)", page.read_text())
    assert len(pictures) == 3
    monkeypatch.setenv("MPLBACKEND", "Agg")
    assert follow(page, tmp_path, changes)
    for picture in pictures:
        one, other = (afar(folder / picture) for folder in (page.parent, tmp_path))
        assert changes or np.mean(np.abs(one - other)) < 0.03


def afar(file):
    """The mean colours of 12 x 12 parts of a picture."""
    image = matplotlib.image.imread(file)[..., :3]
    rows = [np.mean(part, axis=0) for part in np.array_split(image, 12)]
    return np.array([[np.mean(p, axis=0) for p in np.array_split(row, 12)] for row in rows])


def test_view_makes_a_page_of_a_sweep(dap3d, refuse, file):
    done = dap3d.succeed("view", file)
    assert "s.html written" in done.stdout
    assert "6 points" in done.stdout
    told = json.loads(dap3d("view", file, "--force", "--json", "--quantity", "cone.r.z").stdout)
    assert (told["points"], told["quantities"]) == (6, ["cone.r.z"])
    assert "s.html exists" in refuse("view", file)
    near = refuse("view", file, "-o", "b.html", "--quantity", "cone.rr.z")
    assert "did you mean 'cone.r.z'" in near
    own = {"bodies.ball.mass": [1.0, 2.0]}
    output = dap3d.folder / "own.nc"
    dap.sweep("ball1", own, outputs="ball.r.z", t_end=0.05, allow_code=True, output=output)
    assert "--model MODEL --allow-code" in refuse("view", "own.nc")
    assert "not run unless it is allowed" in refuse("view", "own.nc", "--model", "ball1")
    dap3d.succeed("view", "own.nc", "--model", "ball1", "--allow-code")


def test_sliders_choose_the_motion(opened, swept):
    """The page begins with the first point that runs; keys of a slider are its own."""
    box = opened.page.locator("#sweep")
    assert "1 kg" in box.inner_text()
    opened.run("t => dap3d.seek(t)", 0.2)
    for mass in (1.0, 4.0):
        for wy in (-10.0, -4.0):
            scene = dap.load("pen1")
            body = scene.bodies["cone"]
            body.mass, body.w = mass, (body.w[0], wy, body.w[2])
            expected = dap.simulate(scene, **TIMES)
            opened.run("p => dap3d.choose(...p)", [{1.0: 1, 4.0: 2}[mass], {-10.0: 0, -4.0: 1}[wy]])
            opened.drawn()
            assert opened.run("dap3d.time") == 0.2
            drawn = opened.run("dap3d.drawnAt('cone', [0.1, 0, 0])")
            place = expected.r[10, 0] + to_global(expected.p[10, 0], np.array([0.1, 0.0, 0.0]))
            np.testing.assert_allclose(drawn, place, atol=3e-6)
            force = float(swept["J1.force.norm:max"].sel({MASS: mass, WY: wy}))
            assert f"{float(f'{force:.4g}'):g} N" in box.inner_text()
    slider = opened.page.locator("#sweep input").nth(1)
    slider.focus()
    opened.page.keyboard.press("ArrowLeft")
    opened.drawn()
    assert opened.run("[dap3d.app.sweep.places[1], dap3d.time]") == [0, 0.2]
    assert slider.get_attribute("aria-valuetext") == "-10 rad/s"


@pytest.mark.long
def test_what_was_switched_stays_switched(opened):
    opened.page.keyboard.press("1")
    opened.page.keyboard.press("t")
    before = opened.run("[...dap3d.app.stage.camera.position.toArray()]")
    count = opened.run("dap3d.app.stage.scene.children.length")
    for places in ([2, 0], [1, 1], [2, 1]):
        opened.run("p => dap3d.choose(...p)", places)
        opened.drawn()
    layers = opened.run("dap3d.app.marks.layers.bodies.every((o) => !o.visible)")
    assert layers
    assert opened.run("!dap3d.app.traces.visible")
    assert opened.run("[...dap3d.app.stage.camera.position.toArray()]") == before
    assert opened.run("dap3d.app.stage.scene.children.length") == count
    keys = opened.page.inner_text("#plots")
    assert "J1.force.norm" in keys
    assert opened.run("dap3d.app.plots.panels.every((p) => p.curves.every((c) => c.values.length))")


@pytest.mark.long
def test_a_point_that_failed_says_why(opened):
    opened.run("dap3d.choose(0, 0)")
    opened.drawn()
    nothing = opened.page.inner_text("#nothing")
    assert nothing.startswith("This point has no motion. ")
    assert "mass" in nothing
    assert "mass" in opened.page.inner_text("#sweep p.bad")
    assert not opened.page.is_visible("#canvas")
    opened.run("dap3d.choose(2, 0)")
    opened.drawn()
    assert opened.page.inner_text("#nothing") == ""
    assert opened.page.is_visible("#canvas")


@pytest.mark.long
def test_gravity_is_that_of_the_point(show):
    vary = {"forces.gravity.gravity": [9.81, 1.62, 0.0]}
    data = dap.sweep("pen1", vary, outputs="cone.r.z", **TIMES)
    found = show(dap.view(data))
    told = []
    for k in range(3):
        found.run("k => dap3d.choose(k)", k)
        found.drawn()
        told.append(found.page.locator("#labels .ground").first.inner_text())
    assert [words.split()[1] for words in told] == ["9.81", "1.62", "0"]


@pytest.mark.long
def test_sliders_and_plots_have_room(show, page):
    """On a telephone."""
    size = (390, 844)
    found = show(page, width=size[0], height=size[1])
    assert found.run("document.documentElement.scrollWidth") <= size[0]
    boxes = [found.page.locator(one).bounding_box() for one in ("#sweep", "#tabs", "#tab-plots")]
    for box in boxes:
        assert box["y"] + box["height"] <= size[1] + 1
        assert box["width"] > 0.25 * size[0]
    assert boxes[0]["y"] + boxes[0]["height"] <= boxes[1]["y"] + 1


@pytest.mark.long
def test_samples_have_one_slider(show):
    data = dap.sweep(
        "pen1", {MASS: "3~0.2", WY: "-10:-4"}, outputs="cone.r.z:min", sample=60, **TIMES
    )
    found = show(dap.view(data))
    assert found.page.locator("#sweep input").count() == 1
    found.run("dap3d.choose(49)")
    found.drawn()
    words = found.page.inner_text("#sweep")
    assert "60 of 60" in words
    assert "50 of 60 points of the sweep are on this page" in words
    mass = float(data[MASS][59])
    assert f"{float(f'{mass:.4g}'):g} kg" in words


def test_texts_of_a_sweep_stay_texts(show, swept):
    """Outputs and notes of a file from somebody who means harm."""
    data = swept.rename(
        dict(zip(("cone.r.z:min", "J1.force.norm:max"), hostile.NAMES, strict=False))
    )
    data = data.assign(note=xarray.full_like(data["note"], hostile.NAMES[3]))
    for k, name in enumerate(data.data_vars):
        data[name].attrs.update(long_name=hostile.NAMES[4 + k], units=hostile.NAMES[0])
    found = show(dap.view(data))
    for k in (1, 0, 2):
        found.run("k => dap3d.choose(k, 1)", k)
        found.drawn()
    assert hostile.NAMES[0] in found.page.inner_text("#sweep")
    assert found.run(f"typeof window.{hostile.MARK}") == "undefined"
    assert found.run("document.querySelectorAll('img, iframe').length") == 0
