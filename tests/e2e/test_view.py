"""``dap3d view`` writes a page; a real browser opens it from disk, without a network."""

import json
from itertools import pairwise

import numpy as np
import pytest
from support.rotations import to_global

import dap3d_core as dap

pytestmark = pytest.mark.slow  # a browser that draws without a graphics card


@pytest.fixture(scope="module")
def four():
    """The four-bar, reported at 100 instants a second."""
    return dap.simulate("fourbar3", t_end=1.0, dt=0.01)


@pytest.fixture(scope="module")
def four_page(four, tmp_path_factory):
    return dap.view(four).save(tmp_path_factory.mktemp("view") / "four bar #1.html")


@pytest.fixture
def opened(show, four_page):
    return show(four_page)


def chain(count):
    """A chain of bodies on spherical joints, stretched out and let go."""
    scene = dap.Scene(name=f"chain of {count}")
    turned = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # z of the links along x
    hook = "ground.O"
    for k in range(count):
        link = scene.add_body(f"b{k}", Jp=(0.01, 0.01, 0.001), r=(0.1 + 0.2 * k, 0, 0), p=turned)
        top = scene.add_point(f"A{k}", link, (0.0, 0.0, -0.1))
        scene.add_joint("sph", P_i=top, P_j=hook)
        hook = scene.add_point(f"B{k}", link, (0.0, 0.0, 0.1))
    scene.add_force("weight")
    return scene


# ---------------------------------------------------------------- the command


def test_the_command_writes_a_page(dap3d, refuse, pen1):
    done = dap3d.succeed("view", "pen1.nc")
    assert "pen1.html written" in done.stdout
    assert (dap3d.folder / "pen1.html").read_text().startswith("<!DOCTYPE html>")
    assert "pen1.html exists" in refuse("view", "pen1.nc")
    asked = ("--quantity", "cone.r.z", "--quantity", "J1.force.norm", "--fps", "20")
    told = dap3d("view", "pen1.nc", "-o", "a.html", *asked, "--json", "--no-open")
    found = json.loads(told.stdout)
    assert found["file"] == "a.html"
    assert found["size_bytes"] == (dap3d.folder / "a.html").stat().st_size
    assert found["quantities"] == ["cone.r.z", "J1.force.norm"]
    assert (found["instants"], len(found["notes"])) == (3, 1)


# ---------------------------------------------------------------- the browser


def test_the_page_opens_from_disk_and_asks_for_nothing(opened):
    assert opened.page.title() == "fourbar3"
    assert opened.run("document.querySelector('#fault').hidden")
    assert opened.run("performance.getEntriesByType('resource').length") == 0
    opened.page.click("[data-tab=run]")
    shown = opened.page.inner_text("#tab-run").lower()
    for words in ("ledger", "energy", "dop853", "rtol", "llvmlite", "three.js"):
        assert words in shown
    opened.page.click("[data-tab=source]")
    assert "[joints.J1]" in opened.page.inner_text("#tab-source")


def test_what_is_drawn_is_the_pose_of_the_result(opened, four):
    """At reported instants exactly, up to single precision; between two near a finer run."""
    s = (0.1, -0.2, 3.0)
    for k in (0, 1, 37, 100):
        opened.run("t => dap3d.seek(t)", float(four.t[k]))
        assert opened.run("dap3d.time") == four.t[k]
        for b, name in enumerate(four.summary.body_names):
            expected = four.r[k, b] + to_global(four.p[k, b], np.array(s))
            drawn = opened.run("([n, s]) => dap3d.drawnAt(n, s)", [name, list(s)])
            np.testing.assert_allclose(drawn, expected, atol=3e-6)
    fine = dap.simulate("fourbar3", t_end=0.405, dt=0.405)
    opened.run("t => dap3d.seek(t)", 0.405)
    drawn = [opened.run("n => dap3d.drawnAt(n)", n) for n in four.summary.body_names]
    np.testing.assert_allclose(drawn, fine.r[-1], atol=2e-3)


def test_the_slider_and_the_field_scrub_to_the_instant_asked(opened, four):
    opened.page.fill("#time", "0.37")
    opened.page.press("#time", "Enter")
    assert opened.run("dap3d.time") == 0.37
    opened.run("""() => { const s = document.querySelector('#slider');
        s.value = 0.62; s.dispatchEvent(new Event('input')); }""")
    assert opened.run("dap3d.time") == pytest.approx(0.62)
    opened.drawn()
    drawn = opened.run("dap3d.drawnAt('crank')")
    np.testing.assert_allclose(drawn, four.r[62, 0], atol=3e-6)
    opened.page.fill("#time", "99")
    opened.page.press("#time", "Enter")
    assert opened.run("dap3d.time") == 1.0


def test_it_plays_pauses_and_steps_by_keys(opened, four):
    opened.page.press("#canvas", "Home")
    opened.page.press("#canvas", "ArrowRight")
    assert opened.run("dap3d.time") == four.t[1]
    opened.page.press("#canvas", "Shift+ArrowRight")
    assert opened.run("dap3d.time") == four.t[11]
    opened.page.press("#canvas", "ArrowLeft")
    assert opened.run("dap3d.time") == four.t[10]
    before = opened.run("dap3d.pictures")
    opened.page.press("#canvas", "Space")
    assert opened.run("dap3d.playing")
    while opened.run("dap3d.pictures") < before + 4:
        opened.page.wait_for_timeout(20)
    opened.page.press("#canvas", "Space")
    paused = opened.run("dap3d.time")
    assert paused > four.t[10]
    opened.page.wait_for_timeout(120)
    assert opened.run("[dap3d.time, dap3d.playing]") == [paused, False]
    opened.page.press("#canvas", "End")
    assert opened.run("dap3d.time") == four.t[-1]


@pytest.mark.long
def test_switches_change_the_picture_and_back(opened):
    opened.run("dap3d.seek(0.3)")
    opened.drawn()
    labelled = opened.picture()
    opened.page.keyboard.press("n")
    opened.drawn()
    whole = opened.picture()
    assert np.any(labelled != whole)
    for key in ("1", "3", "4", "5", "6", "t", "g"):
        opened.page.keyboard.press(key)
        opened.drawn()
        assert np.any(opened.picture() != whole), key
        opened.page.keyboard.press(key)
    opened.drawn()
    assert np.mean(opened.picture() != whole) < 1e-4
    opened.page.keyboard.press("d")
    opened.drawn()
    assert opened.picture()[350, 5].max() < 60
    opened.page.keyboard.press("?")
    assert "play, pause" in opened.page.inner_text("#help")


@pytest.mark.long
def test_the_camera_follows_a_body(opened):
    opened.page.keyboard.press("f")
    places = []
    for t in (0.1, 0.4, 0.8):
        opened.run("t => dap3d.seek(t)", t)
        places.append(
            opened.run("(() => { const p = dap3d.onScreen('crank'); return [p.x, p.y]; })()")
        )
    np.testing.assert_allclose(places, np.tile(places[0], (3, 1)), atol=1.0)


@pytest.mark.long
def test_the_mouse_orbits_and_zooms_and_r_brings_back(opened):
    def seen():
        return opened.run("(() => { const p = dap3d.onScreen('crank'); return [p.x, p.y]; })()")

    def distance():
        return opened.run("app => dap3d.app.stage.camera.position.distanceTo("
                          "dap3d.app.stage.controls.target)")  # fmt: skip

    first, near = seen(), distance()
    mouse = opened.page.mouse
    mouse.move(300, 300)
    mouse.down()
    mouse.move(420, 330, steps=4)
    mouse.up()
    turned = seen()
    assert np.hypot(*np.subtract(turned, first)) > 10.0
    assert distance() == pytest.approx(near)
    mouse.wheel(0, 400)
    opened.drawn()
    assert distance() > 1.1 * near
    opened.page.keyboard.press("r")
    opened.drawn()
    np.testing.assert_allclose(seen(), first, atol=0.5)


@pytest.mark.long
def test_the_speed_says_how_fast_time_goes(opened):
    """Time moves on by what has passed on the clock, up to a quarter of a second a picture."""
    opened.page.select_option("#speed", "0.01")
    start = opened.run("dap3d.play(), performance.now()")
    while opened.run("dap3d.pictures") < 12:
        opened.page.wait_for_timeout(20)
    opened.page.wait_for_timeout(300)
    passed, end = opened.run("[dap3d.time, performance.now()]")
    assert 0.0 < passed <= 0.01 * (end - start) / 1000.0


def test_pixels_are_where_the_body_is(show):
    """A red ball falls; where the page says it is, the picture is red, and elsewhere not."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 2.0), color="#ff0000")
    scene.add_shape("sphere", body="ball", radius=0.2)
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.6, dt=0.1)
    page = show(dap.view(result))
    for key in ("t", "n", "g"):  # without traces, labels, ground
        page.page.keyboard.press(key)
    seen = {}
    for t in (0.0, 0.6):
        page.run("t => dap3d.seek(t)", t)
        page.drawn()
        at = page.run("(() => { const p = dap3d.onScreen('ball'); return [p.x, p.y]; })()")
        picture = page.picture()
        red = (picture[..., 0] > 90) & (picture[..., 1] < 60) & (picture[..., 2] < 60)
        red[:, 660:] = False  # the panel has curves
        rows, columns = np.nonzero(red)
        np.testing.assert_allclose([columns.mean(), rows.mean()], at, atol=4.0)
        seen[t] = rows.mean()
    assert seen[0.6] > seen[0.0] + 100
    page.page.mouse.click(*at)
    assert page.page.inner_text("#picked") == "sphere1"


@pytest.mark.parametrize(
    ("size", "theme"),
    [pytest.param((1280, 800), "light", marks=pytest.mark.long), ((390, 844), "dark")],
)
def test_the_whole_motion_is_in_the_frame(show, four_page, four, size, theme):
    page = show(four_page, width=size[0], height=size[1], theme=theme)
    width, height = page.run("[dap3d.app.stage.width, dap3d.app.stage.height]")
    for k in range(0, 101, 10):
        page.run("t => dap3d.seek(t)", float(four.t[k]))
        for name, half in (("crank", 1.0), ("coupler", 3.2), ("follower", 3.5)):
            for end in (-half, half):
                p = page.run("([n, s]) => dap3d.onScreen(n, s)", [name, [0.0, 0.0, end]])
                assert 0 < p["x"] < width
                assert 0 < p["y"] < height
    assert page.run("document.documentElement.scrollWidth") <= size[0]


LONG = pytest.mark.long


@pytest.mark.parametrize(
    "model", ["tri", pytest.param("A05", marks=LONG), pytest.param("ball1", marks=LONG)]
)
def test_shipped_models_are_shown_without_complaint(show, model):
    result = dap.simulate(model, t_end=0.2, dt=0.02, allow_code=True)
    page = show(dap.view(result))
    page.run("dap3d.seek(0.1)")
    for tab in ("display", "run", "source", "plots"):
        page.page.click(f"[data-tab={tab}]")


def test_ten_seconds_of_five_bodies_are_under_three_megabytes(tmp_path):
    result = dap.simulate(chain(5), t_end=10.0, dt=0.01)
    assert dap.view(result).save(tmp_path / "page.html").stat().st_size < 3e6


@pytest.mark.long
def test_two_hundred_bodies_are_drawn_by_few_calls(show):
    """Bodies of one shape are one call of the graphics card."""
    result = dap.simulate(chain(200), t_end=0.02, dt=0.01, rtol=1e-5, atol=1e-6)
    page = show(dap.view(result))
    calls = page.run("dap3d.app.stage.renderer.info.render.calls")
    assert calls < 30


@pytest.mark.long
def test_a_notebook_shows_the_page_in_a_frame(chromium, four, tmp_path):
    (tmp_path / "cell.html").write_text(f"<!DOCTYPE html>{dap.view(four)._repr_html_()}")
    context = chromium.new_context(offline=True)
    page = context.new_page()
    page.goto((tmp_path / "cell.html").as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("html[data-ready]").wait_for(state="attached")
    assert frame.locator("#title").inner_text() == "fourbar3"
    context.close()


@pytest.mark.long
def test_a_single_instant_is_shown(show):
    result = dap.simulate("fourbar3", t_end=0.0)
    page = show(dap.view(result))
    page.page.press("#canvas", "Space")
    assert page.run("[dap3d.time, dap3d.playing]") == [0.0, False]
    np.testing.assert_allclose(page.run("dap3d.drawnAt('crank')"), result.r[0, 0], atol=1e-6)


def test_without_webgl_plots_and_tables_still_work(chromium, four_page):
    context = chromium.new_context(offline=True)
    page = context.new_page()
    page.add_init_script(
        "{ const get = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...more) {"
        "return kind.startsWith('webgl') ? null : get.call(this, kind, ...more); }; }"
    )
    page.goto(four_page.resolve().as_uri())
    page.wait_for_selector("html[data-ready]", state="attached")
    assert "no WebGL" in page.inner_text("#fault")
    assert page.evaluate("document.querySelectorAll('.plot').length") >= 1
    context.close()


@pytest.mark.long
def test_a_page_plays_as_it_opens(show, chromium, four, tmp_path):
    """Where that is wished, and the system of its reader does not ask for less motion."""
    page = dap.view(four, play=True).save(tmp_path / "moving.html")
    shown = show(page)
    shown.page.wait_for_function("window.dap3d.time > 0.1", timeout=20_000)
    assert shown.run("dap3d.playing")
    calm = chromium.new_context(reduced_motion="reduce").new_page()
    calm.goto(page.resolve().as_uri())
    calm.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)
    assert not calm.evaluate("dap3d.playing")
    calm.context.close()


# ---------------------------------------------------------------- curves

DRAWN = """() => {
  const kept = [], g = CanvasRenderingContext2D.prototype;
  const { moveTo, lineTo, bezierCurveTo, fillText } = g, words = [];
  g.moveTo = function (x, y) { kept.push(["m", x, y]); moveTo.call(this, x, y); };
  g.lineTo = function (x, y) { kept.push(["l", x, y]); lineTo.call(this, x, y); };
  g.bezierCurveTo = function (...p) { kept.push(["b", ...p]); bezierCurveTo.apply(this, p); };
  g.fillText = function (text, ...p) { words.push(text); fillText.call(this, text, ...p); };
  window.dap3d.app.plots.drawAll();
  Object.assign(g, { moveTo, lineTo, bezierCurveTo, fillText });
  return { kept, words };
}"""


def falling(nt):
    """A stone that falls for a second, reported at so many instants."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone")
    scene.add_force("weight")
    return dap.simulate(scene, t_end=1.0, dt=1.0 / (nt - 1))


def curve_of(show, nt):
    """What the only curve of a page is drawn by, and the words beside it."""
    result = falling(nt)
    page = dap.view(result, "stone.r.z")
    shown = show(page)
    drawn = shown.run(DRAWN)
    grid = max(k for k, (kind, *_) in enumerate(drawn["kept"]) if kind == "m")
    return drawn["kept"][grid:], drawn["words"]


@pytest.mark.long
def test_a_dense_curve_is_drawn_in_the_order_of_time(show):
    """A fall goes down alone: of some thousand instants no column goes up first."""
    pieces, words = curve_of(show, 4001)
    height = [piece[-1] for piece in pieces]
    assert 100 < len(pieces) < 4001
    assert all(b >= a for a, b in pairwise(height))
    assert "time [s]" in words


@pytest.mark.long
def test_a_coarse_curve_is_smooth_between_its_instants(show):
    """A parabola is a Bezier curve whose control points are where its tangents meet."""
    pieces, _ = curve_of(show, 5)
    assert [piece[0] for piece in pieces] == ["m", "b", "b", "b", "b"]
    y = [pieces[0][-1], *(piece[-1] for piece in pieces[1:])]
    drop = (y[-1] - y[0]) / 16.0  # of the first quarter, in pixels
    for k, (_, _, first, _, second, _, _) in enumerate(pieces[1:]):
        slopes = 2.0 * drop * k, 2.0 * drop * (k + 1)  # pixels a quarter of a second
        assert first == pytest.approx(y[k] + slopes[0] / 3.0, abs=1e-3)
        assert second == pytest.approx(y[k + 1] - slopes[1] / 3.0, abs=1e-3)


@pytest.mark.long
def test_a_curve_without_a_known_slope_keeps_its_shape(show):
    """Slopes are those of the figures, by SciPy; an interval with a cut is straight."""
    from scipy.interpolate import PchipInterpolator

    page = show(dap.view(falling(5), "energy.total"))
    t = np.array([0.0, 0.1, 0.3, 0.35, 0.5, 0.7, 1.0, 1.1])
    x = np.array([1.0, 3.0, 2.5, 2.5, 2.7, 4.0, -1.0, -1.2])
    script = """([t, x, cuts]) => {
      const { plots } = window.dap3d.app;
      plots.motion = { t, cuts };
      const { after, before } = plots.slopes({}, 0, x);
      return [[...after], [...before]];
    }"""
    after, before = page.page.evaluate(script, [t.tolist(), x.tolist(), []])
    expected = PchipInterpolator(t, x)(t, 1)
    np.testing.assert_allclose(after[:-1], expected[:-1], rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(before[1:], expected[1:], rtol=1e-13, atol=1e-14)
    after, before = page.page.evaluate(script, [t.tolist(), x.tolist(), [0.4]])
    parts = [PchipInterpolator(t[p], x[p])(t[p], 1) for p in (slice(0, 4), slice(4, 8))]
    straight = (x[4] - x[3]) / (t[4] - t[3])
    np.testing.assert_allclose(
        after[:-1], [*parts[0][:-1], straight, *parts[1][:-1]], rtol=1e-13, atol=1e-14
    )
    np.testing.assert_allclose(
        before[1:], [*parts[0][1:], straight, *parts[1][1:]], rtol=1e-13, atol=1e-14
    )
