"""Plots show the named quantities, in files of each kind, and refuse what they cannot show.

Bands of the modes of contacts behind curves.
"""

import re

import matplotlib
import matplotlib.figure
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from support.results import circling, drifting, model_of, result_of

import dap3d_core as dap
from dap3d_core.plot import plot, save_plot
from dap3d_core.plot.curves import Band, curve_picture
from dap3d_core.result import UnknownNameError


def lines(ax):
    return {line.get_label(): line.get_xydata() for line in ax.get_lines()}


def test_a_curve_over_time_with_units(result):
    ax = plot(result, "bob.r.x")
    ((name, data),) = lines(ax).items()
    assert name == "bob.r.x"
    every = (len(data) - 1) // (len(result.t) - 1)  # places between instants as well
    np.testing.assert_allclose(
        data[::every], np.stack([result.t, result.r[:, 0, 0]], axis=1), rtol=1e-15, atol=1e-15
    )
    assert ax.get_xlabel() == "time [s]"
    assert ax.get_ylabel() == "position of bob, x [m]"
    assert ax.get_legend() is None
    assert ax.figure.get_suptitle() == "circling"


def test_all_components_of_a_vector_with_a_legend(result):
    ax = plot(result, "bob.rdd")
    assert list(lines(ax)) == ["bob.rdd.x", "bob.rdd.y", "bob.rdd.z"]
    assert ax.get_ylabel() == "acceleration of bob [m/s²]"
    assert [t.get_text() for t in ax.get_legend().get_texts()] == list(lines(ax))


def test_units_share_a_figure_in_panels_below_one_another(result):
    first = plot(result, "bob.r", "energy.total", "P.r.z", "work", "bob.p.e0")
    axes = first.figure.axes
    assert [sorted(lines(ax)) for ax in axes] == [
        ["P.r.z", "bob.r.x", "bob.r.y", "bob.r.z"],
        ["energy.total (drift 0)", "work"],
        ["bob.p.e0"],
    ]
    assert [ax.get_ylabel().replace("\n", " ") for ax in axes] == [
        "position [m]",
        "total energy, work of forces and drivers [J]",
        "Euler parameters of bob, e0 [1]",
    ]
    assert axes[-1].get_xlabel() == "time [s]"


def test_a_path_has_one_scale_and_shows_where_it_begins(result):
    ax = plot(result, "bob.r.y", x="bob.r.x")
    ax.figure.draw_without_rendering()
    box = ax.get_window_extent()
    across, up = box.width / np.ptp(ax.get_xlim()), box.height / np.ptp(ax.get_ylim())
    assert across == pytest.approx(up)
    (line,) = ax.get_lines()
    assert (line.get_marker(), line.get_markevery()) == ("o", [0])
    assert plot(result, "bob.rd.y", x="bob.r.x").get_aspect() == "auto"


@pytest.mark.parametrize("x", [None, "bob.p.e0", "bob.r.x"])
def test_every_axis_has_a_unit(result, x):
    first = plot(result, "bob.r", "bob.p.e3", "constraint.position", "J1.force.norm", x=x)
    axes = first.figure.axes
    assert len(axes) == 4
    for label in (axes[-1].get_xlabel(), *(ax.get_ylabel() for ax in axes)):
        assert re.search(r"\[[^]]+\]$", label) or label.endswith("(SI\xa0units)"), label


def test_curves_between_instants_follow_the_rates():
    """A fall is a parabola, which cubics through positions and velocities are exactly."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", r_dot=[2.0, 0.0, 1.0])
    scene.add_force("weight")
    fall = dap.simulate(scene, t_end=1.0, dt=0.25)
    g = 9.81
    over_time = lines(plot(fall, "stone.r.z"))["stone.r.z"]
    assert len(over_time) > 100
    t = over_time[:, 0]
    np.testing.assert_allclose(over_time[:, 1], t - 0.5 * g * t**2, atol=1e-12)
    path = lines(plot(fall, "stone.r.z", x="stone.r.x"))["stone.r.z"]
    t = path[:, 0] / 2.0
    np.testing.assert_allclose(path[:, 1], t - 0.5 * g * t**2, atol=1e-12)
    rates = lines(plot(fall, "stone.rd.z"))["stone.rd.z"]
    np.testing.assert_allclose(rates[:, 1], 1.0 - g * rates[:, 0], atol=1e-12)


def test_curves_without_rates_keep_the_shape_of_their_instants():
    """No rate is known of an acceleration: its extreme values are reported ones."""
    scene = dap.Scene(name="spring")
    scene.add_body("stone", r=[0.0, 0.0, 1.0])
    scene.add_force("ptp", P_i="stone.O", P_j="ground.O", k=(2.0 * np.pi) ** 2)
    run = dap.simulate(scene, t_end=1.0, dt=0.025)
    ax = plot(run, "stone.rdd.z")
    data = lines(ax)["stone.rdd.z"]
    reported = run.rdd[:, 0, 2]
    assert len(data) > 500
    np.testing.assert_array_equal(data[ax.get_lines()[0].get_markevery(), 1], reported)
    assert (np.ptp(data[:, 1]), data[:, 1].max()) == (np.ptp(reported), reported.max())
    exact = -((2.0 * np.pi) ** 2) * np.cos(2.0 * np.pi * data[:, 0])
    inner = np.abs(exact) < 0.9 * exact.max()
    polygon = 0.9 * (2.0 * np.pi * 0.025) ** 2 / 8.0 * exact.max()
    assert np.abs(data[:, 1] - exact)[inner].max() < 0.1 * polygon


def test_curves_without_rates_are_straight_where_a_switch_lies_between():
    """A ball lands on a soft plane at sqrt(2 * 0.5 / g) = 0.319 s: the acceleration has a kink."""
    scene = dap.Scene(name="landing")
    scene.add_body("ball", r=[0.0, 0.0, 0.5])
    scene.add_force("weight")
    scene.add_force("plane_stop", "floor", P_i="ball.O", k=1e3, rebound=False)
    run = dap.simulate(scene, t_end=0.4, dt=0.02)
    assert [event.kind for event in run.events] == ["switch"]
    data = lines(plot(run, "ball.rdd.z"))["ball.rdd.z"]
    between = (len(data) - 1) // 20
    piece = data[15 * between : 16 * between + 1]  # from 0.30 to 0.32
    np.testing.assert_allclose(np.diff(piece[:, 1]), np.ptp(piece[:, 1]) / between, rtol=1e-9)


def test_few_instants_are_marked(result):
    """Many are not, nor those of a path, whose start is."""
    few, many = circling(nt=50)[0], circling(nt=51)[0]
    (line,) = plot(few, "bob.r.x").get_lines()
    assert line.get_marker() == "."
    np.testing.assert_allclose(line.get_xdata()[line.get_markevery()], few.t, rtol=1e-15)
    assert plot(many, "bob.r.x").get_lines()[0].get_marker() in ("", "None")
    assert plot(few, "bob.r.y", x="bob.r.x").get_lines()[0].get_markevery() == [0]


def test_a_unit_stays_on_one_line(result):
    """A bracket on each of two lines is no unit."""
    ax = plot(result, "J1.moment_body", "J1.moment_at_point")
    label = ax.get_ylabel()
    assert label.splitlines()[-1].endswith("[N\xa0m]")


def test_several_runs_in_one_figure(result):
    """One quantity is named by its run; several by both. Each run over its own instants."""
    other = circling(nt=5)[0]
    ax = plot({"fine": result, "coarse": other}, "bob.r.x")
    assert {name: len(data) for name, data in lines(ax).items()} == {
        "fine": 20 * 29 + 1,
        "coarse": 4 * 120 + 1,
    }
    assert ax.get_ylabel() == "position of bob, x [m]"
    assert ax.figure.get_suptitle() == "circling"
    both = plot({"fine": result, "coarse": other}, "bob.r", "work")
    assert list(lines(both)) == [f"bob.r.{c}, {run}" for run in ("fine", "coarse") for c in "xyz"]
    looks = {(line.get_color(), line.get_linestyle()) for line in both.get_lines()}
    assert len(looks) == 6
    assert len({line.get_linestyle() for line in both.get_lines()}) == 2  # one for each run
    assert list(lines(both.figure.axes[1])) == ["fine", "coarse"]


def test_a_run_that_lacks_a_quantity_is_named():
    with pytest.raises(UnknownNameError, match=r"^second: .*'bob'"):
        plot({"first": circling()[0], "second": drifting()}, "bob.r")
    with pytest.raises(ValueError, match="no runs"):
        plot({}, "bob.r")


def test_one_instant_is_drawn_as_markers():
    single = circling(nt=1)[0]
    for line in plot(single, "bob.rdd").get_lines():
        assert line.get_marker() not in ("", "None")
        assert len(line.get_xydata()) == 1


def test_many_curves_differ_in_colour_or_dash():
    ax = plot(drifting(), "a.r", "b.r", "a.r.norm", "b.r.norm")
    looks = [(line.get_color(), line.get_linestyle()) for line in ax.get_lines()]
    assert len(set(looks)) == len(looks) == 8


def test_nothing_is_cut_off_at_a_small_width(tmp_path):
    """The margin of the picture is white all around, legends of two panels included."""
    result = drifting()
    names = ["a.w", "b.wp", "a.rd", "b.rd"]
    path = save_plot(result, names, tmp_path / "a.png", width=3.5)
    pixels = matplotlib.image.imread(path)[..., :3]
    for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]):
        assert (edge == 1.0).all()


def test_a_result_without_instants_cannot_be_drawn():
    model = model_of(scene_with())
    empty = result_of(scene_with(), np.zeros((0, 25)), model, "unconstrained")
    with pytest.raises(ValueError, match="no instants"):
        plot(empty, "work")


def scene_with(name="b"):
    scene = dap.Scene(name="$x_2$ and _")
    scene.add_body(name, mass=1.0, Jp=[1, 1, 1])
    return scene


@pytest.mark.parametrize("name", ["_hidden", "$x^2$", "50%", "back\\slash"])
def test_names_are_shown_as_they_are(tmp_path, name):
    """matplotlib takes $ for a formula and hides what begins with _; neither happens here."""
    scene = scene_with(name)
    rows = np.zeros((2, 25))
    rows[:, 4] = 1.0
    rows[1, 0] = 1.0
    result = result_of(scene, rows, model_of(scene), "unconstrained")
    legend = plot(result, f"{name}.r").get_legend().get_texts()
    assert [t.get_text().strip().replace(r"\$", "$") for t in legend] == [
        f"{name}.r.{axis}" for axis in "xyz"
    ]
    save_plot(result, f"{name}.r", tmp_path / "a.png")


@pytest.fixture(scope="module")
def swing():
    """A pendulum: kinetic and potential energy change by the same, their sum by errors alone."""
    return dap.simulate("pen1", t_end=1.0, dt=0.02)


def test_a_conserved_energy_is_level(swing):
    ax = plot(swing, "energy.total")
    exchanged = np.ptp(swing.energy.kinetic)
    assert np.ptp(ax.get_ylim()) == pytest.approx(1.1 * exchanged, rel=1e-6)
    (line,) = ax.get_lines()
    assert np.ptp(line.get_ydata()) < 1e-6 * exchanged
    drift = f"(drift {swing.ledger['total energy'].value:.1g})"
    assert ax.get_ylabel() == f"total energy {drift} [J]"


def test_the_legend_names_the_drift(swing):
    ax = plot(swing, "energy.total", "energy.kinetic")
    total, kinetic = (t.get_text() for t in ax.get_legend().get_texts())
    assert total == f"energy.total (drift {swing.ledger['total energy'].value:.1g})"
    assert kinetic == "energy.kinetic"
    assert "drift" not in plot(swing, "work", "energy.kinetic").get_ylabel()


def test_a_free_body_has_the_scale_of_its_kinetic_energy():
    """Neither energy changes: what is seen otherwise is the error of the run."""
    scene = dap.Scene(name="free")
    scene.add_body("b", Jp=(1.0, 2.0, 3.0), w=(0.1, 5.0, 0.1))
    free = dap.simulate(scene, t_end=1.0, dt=0.05)
    ax = plot(free, "energy.total")
    assert np.ptp(ax.get_ylim()) == pytest.approx(1.1 * free.energy.kinetic[0], rel=1e-6)
    assert ax.get_ylabel() == f"total energy (drift {free.ledger['energy'].value:.1g}) [J]"


def test_an_energy_that_dampers_take_has_no_drift():
    lost = dap.simulate("bodies2", t_end=1.0, dt=0.05)
    ax = plot(lost, "energy.total")
    assert ax.get_ylabel() == "total energy [J]"
    assert np.ptp(ax.get_ylim()) >= np.ptp(lost.energy.potential)


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
