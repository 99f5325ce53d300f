"""Films and snapshots show the motion as it was: places, times, sizes."""

import itertools
import re
import stat

import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from support.results import ARM, PIVOT, RATE, circling, circling_scene, model_of, result_of, rows_of

import dap3d_core as dap
from dap3d_core.plot.film.animation import frame_times, usual_speed
from dap3d_core.plot.film.frame import Stage
from dap3d_core.plot.film.projection import camera_of, visible_rectangle, with_margin
from dap3d_core.plot.film.stick_figure import (
    MOST_TRIANGLES,
    SHADES,
    pose_at,
    shapes_of,
    sticks_of,
)
from dap3d_core.result import ResultError, UnknownNameError
from dap3d_core.scene import AnimationPoint


@pytest.fixture(scope="module")
def result():
    return circling()[0]


def hung():
    """A body on a spring, with an animation point and limits: poses at one instant."""
    scene = dap.Scene(name="hung")
    scene.add_body("bob", mass=1.0, Jp=[1, 1, 1], color="tab:green")
    scene.add_body("other", mass=1.0, Jp=[1, 1, 1], r=[1, 0, 0])
    scene.add_point("hook", body="ground", sPp=[0, 0, 2])
    scene.add_vector2("d", P_i="bob.O", P_j="hook")
    scene.add_force("ptp", "spring", d="d", k=1.0, l0=2.0)
    scene.add_joint("sph-sph", "rod", P_i="other.O", P_j="ground.O", length=1.0)
    scene.add_joint("cable", "rope", points=["hook", "other.O", "bob.O"])
    scene.animation.points.append(AnimationPoint(body="bob", sPp=[0, 0.5, 0]))
    scene.animation.limits = [[-1, 2], [-1, 1], [-1, 3]]
    return scene


def at_rest(scene):
    """A result of one instant: the poses of the scene."""
    model = model_of(scene)
    v_dot, Lam = np.zeros((1, 6 * model.body_count)), np.zeros((1, model.row_count))
    return result_of(scene, rows_of(model, np.zeros(1), model.u0[None], v_dot, Lam), model)


def test_lines_run_from_mass_centres_to_points():
    sticks = sticks_of(at_rest(hung()))
    r, p = pose_at(at_rest(hung()), 0.0)
    places = sticks.positions(r, p)
    (line,) = places[sticks.lines]
    np.testing.assert_allclose(line, [[0, 0, 0], [0, 0.5, 0]])
    (spring,), (link, *rope) = places[sticks.springs], places[sticks.links]
    np.testing.assert_allclose(spring, [[0, 0, 0], [0, 0, 2]])
    np.testing.assert_allclose(link, [[1, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(rope, [[[0, 0, 2], [1, 0, 0]], [[1, 0, 0], [0, 0, 0]]])
    assert {tuple(place) for place in places[sticks.anchors]} == {(0, 0, 2), (0, 0, 0)}
    assert sticks.names == ("bob", "other")
    assert sticks.colors[0] == SHADES["green"]
    np.testing.assert_array_equal(sticks.limits, [[-1, 2], [-1, 1], [-1, 3]])


def test_a_disk_is_a_circle_with_a_spoke():
    """About the axis of the disk, where the body is; one with a shape is drawn by that alone."""
    scene = dap.Scene(name="disk")
    scene.add_body("coin", r=[0.0, 0.0, 0.5], color="tab:green")
    scene.add_body("other", r=[3.0, 0.0, 1.0])
    scene.add_joint("disk", "rolls", body_i="coin", radius=0.5)
    result = at_rest(scene)
    sticks = sticks_of(result)
    segments = sticks.positions(*pose_at(result, 0.0))[sticks.lines]
    spoke, rim = segments[0], segments[1:]
    np.testing.assert_allclose(spoke, [[0.0, 0.0, 0.5], [0.5, 0.0, 0.5]])
    np.testing.assert_allclose(np.hypot(rim[..., 0], rim[..., 2] - 0.5), 0.5)
    np.testing.assert_array_equal(rim[..., 1], 0.0)
    edges = np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1)
    assert edges.sum() == pytest.approx(np.pi, rel=0.01)  # of a polygon of 32 sides
    extent = sticks.extent(result, np.eye(3))
    np.testing.assert_allclose(extent, [[-0.5, 3.0], [0.0, 0.0], [0.0, 1.0]], atol=1e-12)
    scene.add_shape("sphere", "ball", body="coin", radius=0.5)
    assert not len(sticks_of(at_rest(scene)).rims)


def test_every_body_has_a_colour_and_a_marker_of_its_own():
    scene = dap.Scene()
    for k in range(7):
        scene.add_body(f"b{k}", mass=1.0, Jp=[1, 1, 1])
    sticks = sticks_of(at_rest(scene))
    assert len(set(sticks.colors)) == len(set(sticks.markers)) == 7


def test_poses_between_instants_are_those_of_the_motion():
    """Uniform rotation, 21 instants 0.21 rad apart: cubics are off by less than 0.21^4 / 384."""
    result, _, _ = circling()
    for t in np.linspace(0.0, 1.7, 57):
        r, p = pose_at(result, t)
        angle = RATE * t
        np.testing.assert_allclose(
            r[0], PIVOT + ARM * np.array([np.cos(angle), np.sin(angle), 0]), atol=3e-6
        )
        np.testing.assert_allclose(np.abs(p[0] @ [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]), 1.0)
        assert np.linalg.norm(p[0]) == pytest.approx(1.0, abs=1e-15)


def test_poses_outside_are_those_at_the_ends(result):
    for t, k in ((-1.0, 0), (99.0, -1)):
        np.testing.assert_allclose(pose_at(result, t)[0], result.r[k], atol=1e-15)


@pytest.mark.parametrize(
    ("duration", "speed"), [(0.0, 1), (2.0, 1), (10.0, 1), (0.05, 0.01), (1.0, 0.2), (100.0, 20)]
)
def test_usual_speeds_make_films_of_some_seconds(duration, speed):
    assert usual_speed(duration) == speed
    assert duration == 0.0 or 2.0 <= duration / speed <= 10.0


def test_frames_are_equally_far_apart():
    np.testing.assert_allclose(
        frame_times(np.array([0.0, 1.0]), 10.0, 0.5), np.linspace(0.0, 1.0, 21), atol=1e-15
    )
    assert len(frame_times(np.array([0.0, 1.04]), 10.0, 1.0)) == 11
    with pytest.raises(ValueError, match="100,001 frames are more than"):
        frame_times(np.array([0.0, 1.0]), 50.0, 0.0005)


@pytest.mark.parametrize(
    ("view", "size"),
    [(None, (300, 0)), ("x", (300, 500)), ("z", (500, 120)), ("10,70", (300, 500))],
)
def test_all_of_the_motion_is_inside_at_one_scale(result, view, size):
    """Every place at every instant lies within the axes, whose units are equally long."""
    sticks = sticks_of(result)
    extent = sticks.extent(result, np.eye(3))
    camera = camera_of(view, extent)
    limits = with_margin(extent)
    seen = visible_rectangle(camera, limits, sticks.extent(result, camera.axes))
    stage = Stage(sticks, camera, limits, seen, size, "")
    for t in result.t:
        flat = camera.project(sticks.positions(*pose_at(result, t)))
        assert (flat >= [stage.ax.get_xlim()[0], stage.ax.get_ylim()[0]]).all()
        assert (flat <= [stage.ax.get_xlim()[1], stage.ax.get_ylim()[1]]).all()
    box = stage.ax.get_window_extent()
    scales = box.width / np.diff(stage.ax.get_xlim()), box.height / np.diff(stage.ax.get_ylim())
    assert scales[0] == pytest.approx(scales[1])


def test_a_gif_has_a_frame_for_every_instant_of_the_film(result, tmp_path):
    """1.7 s in real time at 10 a second: 18 pictures of 100 ms; the bob moves."""
    seen = []
    film = dap.animate(result, tmp_path / "a.gif", fps=10, speed=1.0, size=(200, 160),
                   progress=lambda *a: seen.append(a))  # fmt: skip
    assert seen == [(k + 1, 18) for k in range(18)]
    assert (film.frames, film.fps, film.speed, film.size) == (18, 10.0, 1.0, (200, 160))
    with Image.open(film.path) as image:
        assert (image.n_frames, image.size, image.info["loop"]) == (18, (200, 160), 0)
        pictures = []
        for k in range(image.n_frames):
            image.seek(k)
            assert image.info["duration"] == 100
            pictures.append(np.asarray(image.convert("RGB")).copy())
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))
    assert all((picture[0, 0] == 255).all() for picture in pictures)  # white is white
    again = dap.animate(result, tmp_path / "b.gif", fps=10, speed=1.0, size=(200, 160))
    assert again.path.read_bytes() == film.path.read_bytes()
    assert film._repr_html_().startswith('<img src="data:image/gif;base64,R0lGOD')


def test_what_is_drawn_is_where_the_body_is(result, tmp_path):
    """Pixels of the body's colour fill the box that its line spans, to within the marker."""
    for t in (0.0, 0.6, 1.3):
        film = dap.animate(result, tmp_path / "a.png", at=t, view="z", size=(600, 600), force=True)
        pixels = matplotlib.image.imread(film.path)[:520, :, :3]  # the legend left out
        rows, columns = np.nonzero(np.all(np.abs(pixels - to_rgb("#0072B2")) < 0.02, axis=-1))
        drawn = np.array([np.ptp(columns), np.ptp(rows)])
        places = sticks_of(result).positions(*pose_at(result, t))[[0, 2, 3], :2]
        extent = np.ptp(places, axis=0)  # from H, on the axis, to P
        scale = drawn.max() / extent.max()
        np.testing.assert_allclose(drawn, extent * scale, atol=22)  # the marker's size in pixels


def test_a_body_that_is_followed_stays_where_it_is_while_the_axes_pass(tmp_path):
    scene = dap.Scene(name="far")
    scene.add_body("car", mass=1.0, Jp=[1, 1, 1], r_dot=[10.03, 2, 0], color="tab:orange")
    scene.add_body("other", mass=1.0, Jp=[1, 1, 1], r=[0, 1, 0], r_dot=[10.03, 2, 0.1], color="b")
    film = dap.animate(
        dap.simulate(scene, t_end=2.0), tmp_path / "a.gif", follow="car", fps=1, view="z",
        size=(400, 400),
    )  # fmt: skip
    with Image.open(film.path) as picture:
        frames = []
        for k in range(film.frames):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB"), dtype=float)[:340])
    places = [np.argwhere(np.abs(f - [230, 159, 0]).max(axis=-1) < 60).mean(axis=0) for f in frames]
    np.testing.assert_allclose(places, [places[0]] * 3, atol=0.6)  # pixels
    assert not (frames[1][:, :40] == frames[2][:, :40]).all()  # numbers of the axis
    colourful = np.argwhere(np.ptp(frames[0], axis=-1) > 60)
    assert np.ptp(colourful, axis=0).max() > 100  # the two, 1 m apart, fill it
    with pytest.raises(UnknownNameError, match=r"no body 'cra'.*did you mean 'car'"):
        dap.animate(dap.simulate(scene, t_end=0.1), tmp_path / "b.gif", follow="cra")


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"


def shaped(folder):
    """A body with a red box to the left and a mesh, blue, to the right; one without a shape."""
    (folder / "square.obj").write_text(SQUARE)
    scene = dap.Scene(name="shaped")
    scene.add_body("a", r=[0.0, 0.0, 0.0])
    scene.add_body("b", r=[0.0, 2.0, 0.0])
    scene.add_shape("box", "box", body="a", size=[1.0, 1.0, 0.5], at=[-2.0, 0, 0], color="#d62728")
    scene.add_shape("mesh", "square", body="a", file="square.obj", at=[2.0, 0, 0], color="#0000ff")
    scene.save(folder / "scene.toml")
    return dap.simulate(scene, t_end=0.0, dt=1.0)


def hues(path):
    """Places (columns, rows) of the pixels of a hue, the letters of the legend left out."""
    pixels = matplotlib.image.imread(path)[:380, :, :3]
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    return {
        "red": np.nonzero((red > 0.4) & (blue < 0.3 * red) & (green < 0.3 * red)),
        "blue": np.nonzero((blue > 0.4) & (red < 0.2 * blue) & (green < 0.2 * blue)),
    }


def test_shapes_are_drawn_where_they_are(tmp_path):
    """Seen from above both are squares with edges of 1 m, their middles 4.5 m apart."""
    result = shaped(tmp_path)
    film = dap.animate(result, tmp_path / "a.png", view="z", size=(600, 480), model=tmp_path)
    assert film.notes == ()
    shapes = sticks_of(result, tmp_path).shapes
    assert set(shapes.hues) == {1}
    found = hues(film.path)
    (rows, columns), (_, beyond) = found["red"], found["blue"]
    metre = (beyond.mean() - columns.mean()) / 4.5  # in pixels, from the middle of each
    assert metre > 60.0
    for extent in (np.ptp(rows), np.ptp(columns), np.ptp(beyond)):
        assert extent == pytest.approx(metre, abs=4)  # the width of the lines at both edges
    assert len(rows) > 0.97 * metre**2  # it is filled


def test_meshes_that_are_not_at_hand_are_told(tmp_path):
    film = dap.animate(shaped(tmp_path), tmp_path / "a.png")
    assert ["square" in note and "--model" in note for note in film.notes] == [True]


def test_a_line_is_drawn_in_its_colour(tmp_path):
    scene = dap.Scene(name="line")
    scene.add_body("a")
    scene.add_shape("line", "l", body="a", points=[[0, 0, 0], [1, 0, 0], [1, 1, 0]],
                    color="#0000ff")  # fmt: skip
    film = dap.animate(dap.simulate(scene, t_end=0.0, dt=1.0), tmp_path / "a.png", view="z")
    pixels = matplotlib.image.imread(film.path)[..., :3]
    assert ((pixels[..., 2] > 0.4) & (pixels[..., 0] < 0.2)).sum() > 50


def test_a_colour_that_is_none_is_grey(tmp_path):
    """A scene may write any word there; pages leave it to the browser."""
    scene = dap.Scene(name="odd")
    scene.add_body("a")
    scene.add_shape("box", "box", body="a", size=[1.0, 1.0, 1.0], color="nocolour")
    result = dap.simulate(scene, t_end=0.0, dt=1.0)
    assert dap.animate(result, tmp_path / "a.png").frames == 1
    (color,) = sticks_of(result).colors
    assert np.ptp(to_rgb(color)) < 0.1


@pytest.mark.parametrize("balls", [0, 100])
def test_what_is_in_front_hides_what_is_behind(balls):
    """Of two boxes one over the other the upper one is seen, also where the lower one is large,
    and in a picture of so many triangles that a film has none to spare."""
    camera = camera_of("-60,22", np.zeros((3, 2)))
    back = -3.5 * np.sign(camera.towards[:2])  # where the floor is farther than in its middle
    scene = dap.Scene(name="pile")
    scene.add_body("a")
    scene.add_shape("box", "floor", body="a", size=[9.0, 9.0, 0.2], color="#ff0000")
    scene.add_shape("box", "roof", body="a", size=[0.5, 0.5, 0.2], at=[*back, 0.15],
                    color="#0000ff")  # fmt: skip
    for k in range(balls):
        scene.add_shape("sphere", body="a", radius=0.1, at=[*-back, 0.01 * k])
    shapes = shapes_of(scene, ["a"], ["#000000"], still=True)
    assert (len(shapes.triangles) > MOST_TRIANGLES) == (balls > 0)
    corners, colors = shapes.seen(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), camera)
    x = corners - camera.project(np.array([back[0] + 0.1, back[1] + 0.05, 0.25]))
    y = np.roll(x, -1, axis=1)
    ways = x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]
    around = np.all(ways > 0.0, axis=1) | np.all(ways < 0.0, axis=1)
    last = np.flatnonzero(around)[-1]
    assert colors[last, 2] > colors[last, 0]


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_snapshots(result, tmp_path, suffix):
    film = dap.animate(result, tmp_path / f"a{suffix}", at=0.5)
    assert film.frames == 1
    begin = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix]
    assert film.path.read_bytes().startswith(begin)
    if suffix == ".svg":
        assert "t = 0.50 s" in film.path.read_text()
        assert ">bob<" in film.path.read_text()


def test_a_run_at_t_0_alone_gives_one_picture(tmp_path):
    single = circling(nt=1)[0]
    assert dap.animate(single, tmp_path / "a.gif").frames == 1
    assert dap.animate(single, tmp_path / "a.png").frames == 1


def test_limits_of_the_scene_that_the_motion_leaves_are_told(tmp_path):
    scene = circling_scene()
    scene.animation.limits = [[0, 0.1], [0, 0.1], [0, 0.1]]
    moving, model = circling()[0], model_of(scene)
    rows = rows_of(model, moving.t, moving.u, moving.v_dot, moving.Lam)
    result = result_of(scene, rows, model)
    assert re.search("leaves the limits", dap.animate(result, tmp_path / "a.png").notes[0])
    assert dap.animate(result, tmp_path / "b.png", fit=True).notes == ()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(path="a.bmp"), r"an animation is one of \.gif, \.mp4, \.png"),
        (dict(fps=51), "fps of a .gif file is a number from 1 to 50"),
        (dict(fps=0), "fps"),
        (dict(speed=0.0), "above 0"),
        (dict(speed=float("nan")), "above 0"),
        (dict(size=(10, 10)), "from 100 to 4096"),
        (dict(view="front"), "a view is"),
        (dict(at=0.5), "no single time"),
        (dict(at=9.0, path="a.png"), "from 0 s to 1.7 s"),
    ],
)
def test_what_cannot_be_is_refused(result, tmp_path, options, words):
    given = dict(path="a.gif") | options
    with pytest.raises(ValueError, match=words):
        dap.animate(result, tmp_path / given.pop("path"), **given)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_film_leaves_no_file(result, tmp_path):
    def interrupt(done, total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dap.animate(result, tmp_path / "a.gif", size=(100, 100), progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_without_ffmpeg_there_is_no_mp4(result, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ResultError, match=r"needs the program ffmpeg.*or name a \.gif file"):
        dap.animate(result, tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_an_encoder_that_fails_is_quoted(result, tmp_path, monkeypatch):
    """It reads nothing and ends: what it said is told, no file is left."""
    program = tmp_path / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\necho 'Unknown encoder' >&2\nexit 3\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}:/bin:/usr/bin")
    with pytest.raises(ResultError, match="ffmpeg failed with exit code 3: Unknown encoder"):
        dap.animate(result, tmp_path / "a.mp4")
    assert [p.name for p in tmp_path.iterdir()] == ["bin"]
