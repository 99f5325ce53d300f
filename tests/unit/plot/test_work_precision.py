"""Work-precision diagrams show every run once, tell lines apart, and mark the front."""

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from dap3d_core.plot.work_precision import Mark, draw_work_precision, save_work_precision
from dap3d_core.result import ResultError

METHODS, INTEGRATORS = ("standard", "penalty", "lsq"), ("dop853", "dopri5", "rk4", "radau")
MARKS = [
    Mark(method, integrator, 10.0 ** -(2 + 2 * k), 1e-3 * 2**k * (1 + i + j), i + j == 0)
    for i, method in enumerate(METHODS)
    for j, integrator in enumerate(INTEGRATORS)
    for k in range(4)
]


def drawn(marks=MARKS, uncertainty=1e-7):
    return draw_work_precision(Figure(), marks, "a scene", uncertainty)


def test_every_method_and_integrator_has_a_line_of_its_own_look():
    lines = [line for line in drawn().get_lines() if not line.get_label().startswith("_")]
    assert len(lines) == len(METHODS) * len(INTEGRATORS)
    looks = {(line.get_color(), line.get_linestyle(), line.get_marker()) for line in lines}
    assert len(looks) == len(lines)
    (first,) = [line for line in lines if line.get_label() == "standard, dop853"]
    np.testing.assert_array_equal(first.get_xdata(), [m.error for m in MARKS[:4]])
    np.testing.assert_array_equal(first.get_ydata(), [m.time_s for m in MARKS[:4]])


def test_methods_differ_without_colour_and_integrators_without_dashes():
    """In grey the markers still tell methods; colours are those of the house palette."""
    lines = [line for line in drawn().get_lines() if not line.get_label().startswith("_")]
    by_method = {m: {ln.get_marker() for ln in lines if ln.get_label().startswith(m)}
                 for m in METHODS}  # fmt: skip
    assert len(set.union(*by_method.values())) == len(METHODS)
    assert all(len(markers) == 1 for markers in by_method.values())


def test_the_front_is_drawn_below_the_lines():
    ax = drawn()
    (front,) = [line for line in ax.get_lines() if line.get_label() == "_front"]
    assert len(front.get_xdata()) == sum(m.on_front for m in MARKS)
    assert front.get_zorder() < min(ln.get_zorder() for ln in ax.get_lines() if ln is not front)


def test_the_axes_say_what_they_are():
    ax = drawn()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == (
        "error e", "wall time", "a scene",
    )  # fmt: skip
    ax.figure.canvas.draw()
    low, high = ax.get_ylim()  # matplotlib up to 3.10 has labels outside of them as well
    labels = zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
    shown = [label.get_text() for y, label in labels if low <= y <= high]
    assert "10 ms" in shown
    assert 3 <= len(shown) <= 12


def test_nothing_is_cut_off(tmp_path):
    path = save_work_precision(MARKS, tmp_path / "a.png", "a scene", 1e-7)
    pixels = matplotlib.image.imread(path)[..., :3]
    for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]):
        assert (edge == 1.0).all()


def test_what_cannot_be_drawn_or_written_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no run"):
        save_work_precision([Mark("lsq", "rk4", 0.0, 1.0, True)], tmp_path / "a.png")
    with pytest.raises(ValueError, match=r"\.svg"):
        save_work_precision(MARKS, tmp_path / "a.gif")
    (tmp_path / "a.png").write_text("precious")
    with pytest.raises(ResultError, match="the file exists"):
        save_work_precision(MARKS, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_text() == "precious"
