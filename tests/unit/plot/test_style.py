"""Texts of plots: numbers of axes that can be added up, names in short lines."""

import matplotlib.figure
import pytest

from dap3d_core.plot.style import (
    PlainOffset,
    folded,
    legend_above,
    show_rounding_flat,
    style_axes,
)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([-43.0, -43.0 - 4e-9], r"×10⁻⁹ − 43"),
        ([1e9, 3e9], r"×10⁹"),
        ([0.0, 1.0], ""),
        ([43.0, 43.0 + 2e-14], ""),
    ],
)
def test_an_axis_says_what_its_numbers_are(values, words):
    """Not 1e-9-4.3e1; and rounding is no curve."""
    axes = matplotlib.figure.Figure().subplots()
    axes.plot([0.0, 1.0], values)
    axes.yaxis.set_major_formatter(PlainOffset())
    show_rounding_flat(axes)
    axes.figure.draw_without_rendering()
    assert axes.yaxis.get_offset_text().get_text() == words


def test_long_names_are_folded_at_their_dots():
    words = folded("bodies.the_connecting_rod.Jp.x [kg m²]", 16)
    assert max(map(len, words.split("\n"))) <= 16
    assert words.replace("\n", "").replace(" ", "") == "bodies.the_connecting_rod.Jp.x[kgm²]"
    assert folded("a" * 50, 20).replace("\n", "") == "a" * 50


def test_a_power_of_ten_stands_beside_the_legend():
    figure = matplotlib.figure.Figure(figsize=(5.0, 3.0), layout="constrained")
    ax, names = figure.subplots(), [f"a long name of curve {k}" for k in range(4)]
    for k, name in enumerate(names):
        ax.plot([0.0, 1.0], [0.0, (k + 1) * 1e-17], label=name)
    style_axes(ax, "t", "y")
    legend_above(ax, names, 5.0)
    figure.draw_without_rendering()
    offset = ax.yaxis.get_offset_text()
    assert offset.get_text()
    assert not offset.get_window_extent().overlaps(ax.get_legend().get_window_extent())
    assert offset.get_window_extent().x0 >= 0.0
