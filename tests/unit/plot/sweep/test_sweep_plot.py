"""Pictures of sweeps show the values of the data set, in the form that fits what varies."""

import json

import numpy as np
import pytest
import xarray
from matplotlib import pyplot
from matplotlib.collections import LineCollection, QuadMesh
from support.internals import evenly

import dap3d_core as dap
from dap3d_core.plot import save_plot
from dap3d_core.plot.sweep.panels import Band, Heat, Lines, Scatter, Strands, edges
from dap3d_core.plot.sweep.sweep_plot import Parallel, sweep_picture
from dap3d_core.plot.sweep.sweep_table import Variable, table_of
from dap3d_core.result import UnknownNameError

MASS, LENGTH, K = "bodies.bob.mass", "points.A.sPp.z", "forces.spring.k"
T = np.linspace(0.0, 1.0, 5)


def attributes(names):
    varied = json.dumps([{"name": name, "spec": "1:2:3"} for name in names])
    return {"dap3d_sweep": 1, "model": "swing", "varied": varied, "design": "grid"}


def variables(dimensions, values):
    """Two forces, a length and a series of points whose one number is known: a product."""
    v = np.asarray(values, dtype=float)
    series = v[..., None] * T
    force = {"long_name": "force of J1, norm", "units": "N"}
    return {
        "J1.force.norm:max": (dimensions, 2.0 * v, force),
        "J1.force.norm": (dimensions, 3.0 * v, force),
        "bob.r.z:min": (dimensions, -v, {"long_name": "position of bob, z", "units": "m"}),
        "bob.r.z:series": (
            (*dimensions, "time"),
            series,
            {"long_name": "position of bob, z", "units": "m"},
        ),
        "status": (dimensions, np.ones(v.shape, dtype=np.int8)),
        "note": (dimensions, np.full(v.shape, "", dtype=object)),
    }


def grid(**axes):
    """A sweep over axes; its outputs are made of the product of the numbers."""
    names = {"mass": MASS, "length": LENGTH, "k": K}
    axes = {names[name]: np.asarray(values, dtype=float) for name, values in axes.items()}
    product = np.ones(())
    for values in axes.values():
        product = np.multiply.outer(product, values)
    coordinates = {n: ((n,), v, {"units": "kg"}) for n, v in axes.items()}
    coordinates["time"] = (("time",), T, {"units": "s"})
    return xarray.Dataset(variables(tuple(axes), product), coordinates, attributes(axes))


def samples(count, names=(MASS,)):
    """A sweep of samples of (1, 2)."""
    drawn = 1.0 + np.random.default_rng(0).random((count, len(names)))
    coordinates = {n: (("point",), drawn[:, k], {"units": "kg"}) for k, n in enumerate(names)}
    coordinates["time"] = (("time",), T, {"units": "s"})
    found = variables(("point",), drawn.prod(axis=1))
    return xarray.Dataset(found, coordinates, attributes(names))


def spoilt(data, fates):
    """Points by place whose runs ended otherwise; a failed one has no values."""
    data = data.copy(deep=True)
    for place, status in fates.items():
        data["status"].values[place] = status
        if status == 3:
            for name in data.data_vars:
                if name not in ("status", "note"):
                    data[name].values[place] = np.nan
    return data


def kinds(drawing):
    return [type(panel) for panel in drawing.panels]


def test_the_picture_follows_what_varies():
    """One panel for each unit over one number, a map each over two, all in one over more."""
    one, two = grid(mass=[1, 2, 3]), grid(mass=[1, 2, 3], k=[5, 6])
    assert kinds(sweep_picture(one, [])) == [Lines, Lines, Strands]
    assert kinds(sweep_picture(two, [])) == [Heat, Heat, Heat, Strands]
    three = grid(mass=[1, 2, 3], length=[1, 2], k=[5, 6])
    assert kinds(sweep_picture(three, [])) == [Parallel, Strands]
    assert kinds(sweep_picture(samples(30), [])) == [Scatter, Scatter, Strands]
    assert kinds(sweep_picture(samples(300), [])) == [Scatter, Scatter, Band]
    assert kinds(sweep_picture(samples(30, (MASS, K)), [])) == [Parallel, Strands]
    assert kinds(sweep_picture(two, ["bob.r.z:min"], x=K)) == [Strands]
    assert kinds(sweep_picture(samples(30, (MASS, K)), [], x=K)) == [Scatter, Scatter]


def test_an_axis_of_one_value_is_told_in_words():
    drawing = sweep_picture(grid(mass=[1, 2, 3], k=[5]), ["bob.r.z:min"])
    assert kinds(drawing) == [Lines]
    assert drawing.words == ("swing", f"{K} = 5 kg")
    alone = sweep_picture(grid(mass=[2], k=[5]), ["bob.r.z:min"])
    assert kinds(alone) == [Lines]
    assert alone.panels[0].x.values.tolist() == [5.0]


def test_a_grid_is_cut_at_the_nearest_value():
    data = grid(mass=[1, 2, 3], length=[1, 2], k=[5, 6])
    drawing = sweep_picture(data, ["bob.r.z:min"], at={MASS: 1.8})
    assert kinds(drawing) == [Heat]
    np.testing.assert_array_equal(drawing.panels[0].output.values, [[-10, -12], [-20, -24]])
    assert f"{MASS} = 2 kg" in drawing.words
    lines = sweep_picture(data, ["bob.r.z:min"], at={MASS: 9.0, K: 5.0})
    np.testing.assert_array_equal(lines.panels[0].outputs[0].values, [-15, -30])
    instant = sweep_picture(grid(mass=[1, 2, 3]), ["bob.r.z:series"], at={"time": 0.5})
    np.testing.assert_array_equal(instant.panels[0].outputs[0].values, [0.5, 1.0, 1.5])
    chosen = sweep_picture(data.sel({MASS: 3.0, K: 6.0}), ["bob.r.z:min"])
    np.testing.assert_array_equal(chosen.panels[0].outputs[0].values, [-18, -36])


def test_lines_have_the_values_and_gaps_where_runs_failed():
    """A stopped run is a gap as well: its extreme is that of a shorter time."""
    ax = dap.plot(spoilt(grid(mass=[4, 1, 2, 3]), {0: 3, 2: 2}), "J1.force.norm:max")
    line, *marks = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), [1, 2, 3, 4])
    np.testing.assert_array_equal(line.get_ydata(), [2, np.nan, 6, np.nan])
    assert [mark.get_xdata().tolist() for mark in marks] == [[2.0], [4.0]]
    (legend,) = ax.figure.legends
    told = [text.get_text() for text in legend.get_texts()]
    assert told == ["stopped early (1)", "failed (1)"]
    assert ax.get_xlabel().replace("\n", "") == f"{MASS} [kg]"
    assert ax.get_ylabel().replace("\n", " ") == "force of J1, norm, max [N]"


def test_maps_have_the_values_in_their_cells():
    ax = dap.plot(spoilt(grid(mass=[1, 2, 4], k=[5, 6]), {(1, 0): 3}), "bob.r.z:min")
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    np.testing.assert_array_equal(mesh.get_array().mask, [[0, 0], [1, 0], [0, 0]])
    np.testing.assert_array_equal(mesh.get_array().filled(0), [[-5, -6], [0, -12], [-20, -24]])
    corners = mesh.get_coordinates()
    np.testing.assert_array_equal(corners[:, 0, 1], [0.5, 1.5, 3.0, 5.0])
    np.testing.assert_array_equal(corners[0, :, 0], [4.5, 5.5, 6.5])
    bar = ax.figure.axes[1]
    assert bar.get_ylabel().replace("\n", " ") == "position of bob, z, min [m]"
    assert ax.patch.get_hatch()


def test_numbers_even_in_their_logarithm_have_such_a_scale():
    ax = dap.plot(grid(mass=np.geomspace(1.0, 1e3, 4)), "bob.r.z:min")
    assert ax.get_xscale() == "log"
    assert dap.plot(grid(mass=[1, 2, 3]), "bob.r.z:min").get_xscale() == "linear"
    axis = Variable("k", "k", "", np.array([1.0, 100.0]), is_log=True)
    np.testing.assert_allclose(edges(axis), [0.1, 10.0, 1000.0])


def test_series_are_a_curve_for_each_point():
    ax = dap.plot(grid(mass=[1, 2, 3]), "bob.r.z:series")
    (curves,) = (c for c in ax.collections if isinstance(c, LineCollection))
    np.testing.assert_array_equal(curves.get_array(), [1, 2, 3])
    for path, mass in zip(curves.get_paths(), [1, 2, 3], strict=True):
        np.testing.assert_allclose(path.vertices, np.column_stack([T, mass * T]))


def test_a_band_holds_nine_tenths_of_the_curves():
    data = samples(400)
    ax = dap.plot(spoilt(data, {7: 2, 8: 3}), "bob.r.z:series")
    middle, least, most = ax.lines
    kept = np.delete(data[MASS].values, [7, 8])
    np.testing.assert_allclose(middle.get_ydata(), np.median(kept) * T)
    np.testing.assert_allclose(least.get_ydata(), kept.min() * T)
    np.testing.assert_allclose(most.get_ydata(), kept.max() * T)
    low, high = np.percentile(kept, [5, 95])
    (band,) = ax.collections
    at_end = band.get_paths()[0].vertices
    at_end = at_end[at_end[:, 0] == 1.0, 1]
    np.testing.assert_allclose([at_end.min(), at_end.max()], [low, high])
    told = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert "median of 398" in told
    assert "failed (1)" in told


def test_parallel_coordinates_join_the_values_of_a_point():
    """Each axis reaches from its least to its greatest value; colours are of the first output."""
    data = samples(20, (MASS, LENGTH, K))
    ax = dap.plot(spoilt(data, {3: 3}), "bob.r.z:min", "J1.force.norm")
    failed, lines = ax.collections
    assert len(failed.get_paths()) == 1
    order = np.argsort(np.delete(data["bob.r.z:min"].values, 3))
    for row, name in enumerate((MASS, LENGTH, K, "bob.r.z:min")):
        values = np.delete(data[name].values, 3)[order]
        low, high = values.min(), values.max()
        if row < 3:  # the failed point has its numbers
            low, high = data[name].values.min(), data[name].values.max()
        drawn = [path.vertices[row, 0] for path in lines.get_paths()]
        np.testing.assert_allclose(drawn, (values - low) / (high - low), atol=1e-12)
    np.testing.assert_array_equal(lines.get_array(), np.sort(lines.get_array()))
    shown = " ".join(text.get_text() for text in ax.texts)
    assert all(f"{name} [kg]" in shown for name in (MASS, LENGTH, K))


def test_of_many_points_quantiles_and_counts_are_drawn():
    """A thousand lines are a carpet: medians of the fifths, their middle halves, and histograms."""
    data = samples(500, (MASS, LENGTH))
    ax = dap.plot(data, "bob.r.z:min")
    output = data["bob.r.z:min"].values
    bounds = np.quantile(output, [0.2, 0.4, 0.6, 0.8])
    fifth = np.searchsorted(bounds, output, side="right")
    medians = [line for line in ax.lines if line.get_marker() == "o"]
    assert len(medians) == 5
    for row, name in enumerate((MASS, LENGTH, "bob.r.z:min")):
        values = data[name].values
        at = (values - values.min()) / (values.max() - values.min())
        expected = [np.median(at[fifth == k]) for k in range(5)]
        drawn = [line.get_xdata()[row] for line in medians]
        np.testing.assert_allclose(drawn, expected, atol=1e-12)
    bars = np.array([bar.get_height() for bar in ax.patches]).reshape(3, -1)
    counts, _ = np.histogram(data[MASS].values, bars.shape[1])
    np.testing.assert_allclose(bars[0] / bars[0].max(), counts / counts.max(), atol=1e-12)


def test_outputs_without_values_do_not_hide_the_others():
    """Colours are of the first output that has any; a band is of stopped runs if all stopped."""
    data = samples(20, (MASS, K))
    data["bob.r.z:min"].values[:] = np.inf
    (lines,) = dap.plot(data, "bob.r.z:min", "J1.force.norm").collections
    assert len(lines.get_paths()) == 20
    np.testing.assert_array_equal(lines.get_array(), np.sort(data["J1.force.norm"].values))
    stopped = samples(100)
    stopped["status"].values[:] = 2
    stopped["bob.r.z:series"].values[:, 3:] = np.nan
    middle = dap.plot(stopped, "bob.r.z:series").lines[0]
    np.testing.assert_array_equal(middle.get_xdata(), T[:3])


def test_an_output_is_scattered_over_another():
    data = samples(20, (MASS, K))
    ax = dap.plot(data, "bob.r.z:min", x="J1.force.norm")
    (dots,) = ax.lines
    np.testing.assert_array_equal(dots.get_xdata(), data["J1.force.norm"].values)
    np.testing.assert_array_equal(dots.get_ydata(), data["bob.r.z:min"].values)


def test_a_steep_map_has_colours_of_the_logarithm():
    data = grid(mass=np.geomspace(1.0, 1e4, 7), k=[1.0, 2.0])
    for name, scale in (("J1.force.norm", "log"), ("bob.r.z:min", "linear")):  # one is negative
        bar = dap.plot(data, name).figure.axes[1]
        assert bar.get_yscale() == scale


@pytest.mark.slow
def test_too_many_points_are_thinned_and_told():
    drawing = sweep_picture(grid(mass=np.arange(1, 1001), k=np.arange(1, 901)), ["bob.r.z:min"])
    panel = drawing.panels[0]
    assert panel.output.values.shape == (600, 600)
    assert drawing.words == ("swing", "360000 of 900000 points")
    np.testing.assert_array_equal(
        panel.output.values, -np.multiply.outer(panel.y.values, panel.x.values)
    )
    assert panel.y.values[[0, -1]].tolist() == [1, 1000]


@pytest.mark.parametrize("shape", [(7,), (9, 7), (100, 3), (2,) * 9, (1, 1), (51, 1, 51)])
def test_points_are_chosen_evenly(shape):
    places = evenly(shape, 50)
    assert 1 <= np.prod([len(p) for p in places]) <= 50
    for there, length in zip(places, shape, strict=True):
        assert len(there) < 2 or (there[0], there[-1]) == (0, length - 1)
        steps = np.diff(there)
        assert len(steps) == 0 or steps.max() - steps.min() <= 1


@pytest.mark.slow
def test_narrow_pictures_of_all_kinds_can_be_made(tmp_path):
    """60 mm, as beside a text: nothing is left without room, which matplotlib warns of."""
    long = "bodies.the_connecting_rod_of_the_upper_left_leg.Jp.x"
    many = samples(50, tuple(f"{long}{k}" for k in range(12)))
    for k, data in enumerate((grid(mass=[1]), grid(mass=[1, 2], k=[1, 2]), many)):
        save_plot(data, [], tmp_path / f"{k}.png", width=60 / 25.4)


def test_what_cannot_be_drawn_is_refused():
    data = grid(mass=[1, 2, 3], length=[1, 2], k=[5, 6])
    with pytest.raises(UnknownNameError, match=r"did you mean 'bob\.r\.z:min'"):
        dap.plot(data, "bob.r.z:mn")
    with pytest.raises(UnknownNameError, match=f"did you mean '{MASS}'"):
        dap.plot(data, at={"bodies.bob.mas": 1.0})
    with pytest.raises(UnknownNameError, match=f"did you mean '{K}'"):
        dap.plot(data, x="forces.spring.kk")
    with pytest.raises(ValueError, match="hold all but one"):
        dap.plot(data, "bob.r.z:min", x=MASS)
    with pytest.raises(ValueError, match="is drawn over time"):
        dap.plot(data, "bob.r.z:series", x=MASS)
    with pytest.raises(ValueError, match="samples have no axes"):
        dap.plot(samples(9), at={MASS: 1.0})
    with pytest.raises(ValueError, match="no value to cut at"):
        dap.plot(data, at={MASS: float("nan")})
    with pytest.raises(ValueError, match="is of no sweep"):
        dap.plot(xarray.Dataset({"a": 1.0}))
    with pytest.raises(ValueError, match="has no points"):
        dap.plot(data.isel({MASS: slice(0, 0)}))
    with pytest.raises(ValueError, match="takes one panel"):
        dap.plot(data, ax=pyplot.figure().subplots())
    failed = spoilt(grid(mass=[1, 2]), {0: 3, 1: 0})
    failed = failed.assign({"bob.r.z:min": failed["bob.r.z:min"] * np.nan})
    with pytest.raises(ValueError, match=r"of 2 points none has a value \(1 not run so far, 1 fai"):
        dap.plot(failed, "bob.r.z:min")


def test_a_sweep_of_any_order_of_dimensions_is_the_same():
    data = spoilt(grid(mass=[3, 1, 2], k=[5, 6]), {(0, 1): 3})
    one, other = (table_of(d).output("bob.r.z:min").values for d in (data, data.transpose()))
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one, [[-5, -6], [-10, -12], [-15, np.nan]])
